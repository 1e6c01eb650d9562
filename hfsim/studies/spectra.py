"""Frequencies and growing motions of a scene linearised in one state.

Where the mass matrix is constant the equations of motion have an analytic derivative
(`System.linearized`), dense or sparse.  It is all there is at rest, or where no joint changes with the
state.  Elsewhere the inertia that comes with the motion (centrifugal and gyroscopic terms) decides what
grows: the scene is then linearised by differences, in body frames where its model has them.  Such
eigenvalues, frozen in time, are those of the motion where the state lasts in these coordinates: at
rest, and in even rotation for beams with a body frame; rigid bodies and `ancf` count in ground axes.
Elsewhere a growth rate is that of a state passed through.  The fastest frequency, which bounds steps, is
that of stiffness against mass: the motion does not matter for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hfsim.errors import HfsimError
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.matrices import Matrix, dense, factorised, is_sparse, saddle_point
from hfsim.mechanics.linearized import Linearized
from hfsim.run.integration import run_integration
from hfsim.run.stop import Budget, TimeUp
from hfsim.scene.build import Scene, build

MOST_UNKNOWNS = 400
"""Unknowns up to which a scene is linearised by differences, and all eigenvalues are computed."""
_DIFFERENCE = 1e-3
"""Step of the differences, fourth order: exact for cubic forces."""
_STANDSTILL = 1e-3
"""Angle [rad], or exponent of growth, over the duration of a run below which a motion counts as none."""
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)
_SLOWEST = 6
"""How many of the slowest motions of a large scene are looked at."""


class LimitsError(HfsimError):
    """The scene cannot be linearised."""

    exit_code = 2


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues of the scene linearised in one state.

    Attributes
    ----------
    time : float
        When [s].
    fastest, slowest : float
        Largest and smallest frequency that is not zero [rad/s].
    growth : float
        Largest growth rate of a motion [1/s]; zero where it is not told from round-off.
    noise : float
        Frequencies and growth rates below this are round-off, or nothing within the run [1/s].
    """

    time: float
    fastest: float
    slowest: float
    growth: float
    noise: float

    @property
    def period(self) -> float:
        """Fastest period [s]."""
        return 2.0 * np.pi / self.fastest if self.fastest > 0.0 else np.inf


@dataclass(frozen=True)
class Linearised:
    """A scene near one state: y'' = A y + B y' in independent coordinates y.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (n_free, n_free)
        A and B.
    basis : ndarray, shape (n, n_free)
        Changes of the state that the joints allow.
    precision : float
        Relative error of A and B.
    """

    stiffness: Array
    damping: Array
    basis: Array
    precision: float

    def eigenvalues(self) -> ComplexArray:
        """Return all eigenvalues, shape (2 n_free,) [1/s]."""
        if not self.damping.any():
            roots = np.sqrt(np.linalg.eigvals(self.stiffness).astype(complex))
            return np.concatenate([roots, -roots])
        n = len(self.stiffness)
        matrix = np.block([[np.zeros((n, n)), np.eye(n)], [self.stiffness, self.damping]])
        return np.linalg.eigvals(matrix).astype(complex)

    def fastest_mode(self) -> tuple[float, Array]:
        """Return the largest frequency without damping [rad/s] and its shape in the state, (n,)."""
        w2, modes = np.linalg.eig(-self.stiffness)
        k = int(np.argmax(w2.real))
        return _root(w2[k]), _scaled(self.basis @ modes[:, k].real)


@dataclass(frozen=True)
class LargeLinearised:
    """A large scene near one state, with sparse matrices; damping is left out.

    Attributes
    ----------
    equations : Linearized
    """

    equations: Linearized

    precision = float(np.finfo(float).eps)

    def eigenvalues(self) -> ComplexArray:
        """Return the eigenvalues of the slowest few motions and of the fastest [1/s]."""
        fastest = self._fastest()[0]
        if not fastest[0].real > 0.0:
            return np.zeros(1, dtype=complex)
        w2 = np.concatenate([self._slowest(float(fastest[0].real)), fastest])
        roots = np.sqrt(-w2.astype(complex))
        return np.concatenate([roots, -roots])

    def fastest_mode(self) -> tuple[float, Array]:
        """Return the largest frequency [rad/s] and its shape in the state, (n,)."""
        w2, modes = self._fastest()
        return _root(w2[0]), _scaled(modes[:, 0].real)

    def _fastest(self) -> tuple[ComplexArray, ComplexArray]:
        solve, K = self._solver(self.equations.mass), self.equations.stiffness
        return self._eigs(lambda y: solve(K @ y), 1)

    def _slowest(self, fastest: float) -> ComplexArray:
        """Return the squares of the slowest frequencies, by inverse iteration from just below zero."""
        shift = -1e-10 * fastest
        M = self.equations.mass
        solve = self._solver(self.equations.stiffness - shift * M)
        n = M.shape[0]
        inverse, _ = self._eigs(lambda y: solve(M @ y), min(_SLOWEST, n - 2))
        return shift + 1.0 / inverse

    def _eigs(self, product: Callable[[Array], Array], count: int) -> tuple[ComplexArray, ComplexArray]:
        from scipy.sparse.linalg import LinearOperator, eigs

        M = self.equations.mass
        n = M.shape[0]
        start = self._solver(M)(M @ np.random.default_rng(1).standard_normal(n))
        operator: Any = LinearOperator((n, n), matvec=product, dtype=float)
        values, vectors = eigs(operator, k=count, which="LM", v0=start)
        return values, vectors

    def _solver(self, matrix: Matrix) -> Callable[[Array], Array]:
        """Return the map from forces to the motions that matrix and joints answer with."""
        Phi = self.equations.jacobian
        if Phi is None:
            return factorised(matrix)
        solve, rows = factorised(saddle_point(matrix, Phi)), np.zeros(Phi.shape[0])
        return lambda f: solve(np.concatenate([f, rows]))[: len(f)]


def _root(w2: complex) -> float:
    return float(np.sqrt(max(w2.real, 0.0)))


def _scaled(shape: Array) -> Array:
    return np.asarray(shape / np.abs(shape).max())


def linearise(scene: Scene, t: float, q: Array, v: Array) -> Linearised | LargeLinearised:
    """Linearise the equations of motion at a state on the manifold of the joints.

    Parameters
    ----------
    scene : Scene
    t : float
    q, v : ndarray, shape (n,)

    Raises
    ------
    LimitsError
        If the scene is large and its matrices change with the state.
    """
    system = scene.system
    resting = not system.linearizes or not v.any() or system.equations.constraints_constant
    if system.linearizes and (resting or system.n > MOST_UNKNOWNS):
        return _analytic(scene, t, q, v)
    if system.n > MOST_UNKNOWNS:
        raise LimitsError(
            f"{system.n} unknowns; {scene.model} is linearised up to {MOST_UNKNOWNS}, exact and ancf beyond"
        )
    return by_differences(scene, t, q, v)


def _analytic(scene: Scene, t: float, q: Array, v: Array) -> Linearised | LargeLinearised:
    found = scene.system.linearized(t, q, v)
    if len(q) > MOST_UNKNOWNS and is_sparse(found.mass):
        return LargeLinearised(found)
    M, K = dense(found.mass), dense(found.stiffness)
    Z = np.eye(len(q)) if found.jacobian is None else _null_space(dense(found.jacobian))
    mass = Z.T @ M @ Z
    damping = np.zeros_like(mass) if found.damping is None else Z.T @ dense(found.damping) @ Z
    A, B = (-np.linalg.solve(mass, part) for part in (Z.T @ K @ Z, damping))
    return Linearised(A, B, Z, float(np.finfo(float).eps))


def _null_space(rows: Array) -> Array:
    return np.asarray(np.linalg.qr(rows.T, mode="complete")[0][:, len(rows) :])


def by_differences(scene: Scene, t: float, q: Array, v: Array) -> Linearised:
    """Linearise as `linearise` does, by fourth-order differences of the accelerations."""
    system, Z = scene.system, _allowed(scene, t, q, v)
    n = Z.shape[1]
    steps = _DIFFERENCE * np.concatenate([k * np.eye(n) for k in (-2, -1, 1, 2)])
    nothing = np.zeros_like(steps)
    moved = np.concatenate([np.hstack([steps, nothing]), np.hstack([nothing, steps])])
    y, w = moved[:, :n], moved[:, n:]
    times = np.full(len(moved), t)
    Q, V = system.project(times, q + y @ Z.T, v + w @ Z.T)
    values = system.acceleration(times, Q, V) @ Z
    # where projection has moved the coordinates a little, the chain rule brings them back
    reached = np.hstack([(Q - q) @ Z, (V - v) @ Z])
    slopes = _slopes(values.reshape(2, 4, n, n)) / _DIFFERENCE
    turned = _slopes(reached.reshape(2, 4, n, 2 * n)) / _DIFFERENCE
    J = np.linalg.solve(np.concatenate(turned), np.concatenate(slopes)).T
    return Linearised(J[:, :n], J[:, n:], Z, float(np.finfo(float).eps) / _DIFFERENCE)


def _slopes(values: Array) -> Array:
    """Return fourth-order differences of values at -2, -1, 1 and 2 steps (second axis)."""
    far, near = values[:, 3] - values[:, 0], values[:, 2] - values[:, 1]
    return np.asarray((8.0 * near - far) / 12.0)


def _allowed(scene: Scene, t: float, q: Array, v: Array) -> Array:
    """Return an orthonormal basis of the changes of q that the joints allow, shape (n, n_free)."""
    system = scene.system
    if not system.constraints:
        return np.eye(system.n)
    # projected velocities are what the joints allow; the rates of drivers drop out in differences
    n = system.n
    at, times = np.repeat(q[None], n + 1, axis=0), np.full(n + 1, t)
    rates = v + np.vstack([np.eye(n), np.zeros((1, n))]) * max(1.0, float(np.abs(v).max(initial=0.0)))
    moved = system.project(times, at, rates)[1]
    left, _, _ = np.linalg.svd((moved[:-1] - moved[-1]).T)
    return np.asarray(left[:, : n - system.n_rows])


def spectrum(scene: Scene, t: float, q: Array, v: Array) -> Spectrum:
    """Return the frequencies and the largest growth rate of a scene in one state."""
    seen, place = _in_body_frames(scene, q, v)
    near = linearise(seen, t, *place)
    found = near.eigenvalues()
    sizes = np.abs(found.imag)
    fastest = float(np.abs(found).max(initial=0.0))
    noise = max(10.0 * fastest * float(np.sqrt(near.precision)), _STANDSTILL / scene.deck.solve.duration)
    growth = float(found.real.max(initial=0.0))
    swinging = sizes[sizes > noise]
    top = float(swinging.max(initial=0.0))
    return Spectrum(
        time=t,
        fastest=top,
        slowest=float(swinging.min(initial=top)),
        growth=growth if growth > noise else 0.0,
        noise=noise,
    )


def fastest_mode(scene: Scene, t: float, q: Array, v: Array) -> tuple[float, Array]:
    """Return the frequency that bounds steps [rad/s], and its shape in the state, (n,)."""
    near = _analytic(scene, t, q, v) if scene.system.linearizes else linearise(scene, t, q, v)
    return near.fastest_mode()


def _in_body_frames(scene: Scene, q: Array, v: Array) -> tuple[Scene, tuple[Array, Array]]:
    """Return a moving scene in the coordinates of its body frames, if its model has them and it is small."""
    system = scene.system
    if not v.any() or not system.linearizes or system.n_x > MOST_UNKNOWNS or scene.model == "ancf":
        return scene, (q, v)
    framed = build(scene.loaded.with_solve({"coordinates": "frame"}), scene.model)
    x, u = system.absolute(q[None]), system.absolute_velocity(q[None], v[None])
    hybrid, rates = framed.system.state(x, u, np.zeros((1, framed.system.n)))
    return framed, (hybrid[0], rates[0])


def along(scene: Scene, count: int = 9, seconds: float = 20.0) -> tuple[Spectrum, ...]:
    """Return spectra along the motion, solved as the deck says; fewer if it takes too long.

    The times are uneven, so that they do not fall in step with an oscillation.
    """
    budget, found = Budget(seconds), [spectrum(scene, 0.0, scene.q, scene.v)]
    try:
        done = run_integration(scene, scene.deck.solve, budget.guard()).in_time()
    except TimeUp:
        return tuple(found)
    k = np.arange(1, count)
    times = done.trajectory.t_end * (k - (_GOLDEN * k) % 1.0) / (count - 1)
    q, v = done.trajectory.at(times)
    q, v = scene.system.project(times, q, v)
    for at, place, rates in zip(times, q, v, strict=True):
        if budget.left <= 0.0:
            break
        found.append(spectrum(scene, float(at), place, rates))
    return tuple(found)
