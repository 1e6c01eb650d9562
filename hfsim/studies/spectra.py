"""Frequencies and growing motions of a scene linearised in one state.

Where the mass matrix is constant the equations of motion have an analytic derivative
(`System.linearized`), dense or sparse.  It is all there is at rest, or where no joint changes with the
state.  Where other scenes move, the inertia that comes with the motion (centrifugal and gyroscopic
terms) decides what grows: they are linearised by differences, in body frames where they have them.  Such
eigenvalues, frozen in time, are those of the motion where the state lasts in these coordinates: at
rest, and in even rotation for beams with a body frame; rigid bodies and `ancf` count in ground axes.
Elsewhere a growth rate is that of a state passed through.  The fastest frequency, which bounds steps, is
that of stiffness against mass: the motion does not matter for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.errors import HfsimError
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Budget, TimeUp
from hfsim.maths.arrays import Array, magnitude
from hfsim.mechanics.modes import AnyModes, analytic_modes, modes_at_rest, modes_by_differences
from hfsim.scene.build import Scene, build
from hfsim.scene.gauging import gauge_of
from hfsim.trust.handover import hand_memory

MOST_UNKNOWNS = 400
"""Unknowns up to which a scene is linearised by differences, and all eigenvalues are computed."""
_STANDSTILL = 1e-3
"""Angle [rad], or exponent of growth, over the duration of a run below which a motion counts as none."""
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)


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


def linearise(scene: Scene, t: float, q: Array, v: Array) -> AnyModes:
    """Linearise the equations of motion at a state on the manifold of the joints.

    Parameters
    ----------
    q, v : ndarray, shape (n,)

    Raises
    ------
    LimitsError
        If the scene is large and its matrices change with the state.
    """
    system = scene.system
    resting = not v.any() or system.equations.phi.constant
    if system.linearizes and (resting or system.n > MOST_UNKNOWNS):
        return analytic_modes(system, t, q, v, MOST_UNKNOWNS)
    if system.n > MOST_UNKNOWNS:
        raise LimitsError(
            f"{system.n} unknowns; {scene.model} is linearised up to {MOST_UNKNOWNS}, exact and ancf beyond"
        )
    if not v.any():
        return modes_at_rest(system, t, q)
    return modes_by_differences(system, t, q, v, scene.units[system.reduction.rows])


def spectrum(scene: Scene, t: float, q: Array, v: Array) -> Spectrum:
    """Return the frequencies and the largest growth rate of a scene in one state."""
    seen, place = _in_body_frames(scene, t, q, v)
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
    """Return the frequency that bounds steps [rad/s], and its shape in the state, (n,).

    The body that moves most moves by its size in it, or some direction of it or angle by one.
    """
    system = scene.system
    analytic = system.linearizes
    near = analytic_modes(system, t, q, v, MOST_UNKNOWNS) if analytic else linearise(scene, t, q, v)
    omega, shape = near.fastest()
    gauge, moved = gauge_of(scene), system.absolute_velocity(q[None], shape[None])
    return omega, shape / max(gauge.size(moved), magnitude(moved[:, gauge.turning > 0.0]))


def _in_body_frames(scene: Scene, t: float, q: Array, v: Array) -> tuple[Scene, tuple[Array, Array]]:
    """Return a moving scene in the coordinates of its body frames, if its model has them and it is small."""
    system = scene.system
    if not v.any() or not system.linearizes or system.n_x > MOST_UNKNOWNS or scene.model == "ancf":
        return scene, (q, v)
    framed = build(scene.loaded.with_solve({"coordinates": "frame"}), scene.model)
    x, u = system.absolute(q[None]), system.absolute_velocity(q[None], v[None])
    hand_memory(system, framed.system, np.array([t]), x)
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
