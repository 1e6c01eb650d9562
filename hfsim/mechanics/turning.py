"""Steady rotation: all bodies turn as one about an axis, and none of them changes its shape.

Rates are then an affine function of the absolute coordinates, u = W x + w: vectors turn; of coordinates
relative to a body frame only the frame's place and angle change.  Seen from axes that turn as well, the scene
stands still in an equilibrium of its forces with those of inertia, -M u', about which
`hfsim.mechanics.small_motions` are those of equations with constant coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, is_sparse
from hfsim.maths.rotations import freedoms, spun
from hfsim.mechanics.pose import Twist
from hfsim.mechanics.rotors import own_turns

if TYPE_CHECKING:
    from hfsim.mechanics.body import Body
    from hfsim.mechanics.equations import Equations

APART = 1e-2
"""Part of the energy of rates that may be other than that of a rigid motion which stands for them."""
SINGULAR = 1e-9
"""Part of its energy in others from which down a rigid motion is one by itself."""
NOISE = 10.0
"""Factor on rounding, and on the relative error of a fit, below which a share of it is none."""
CANCELLED = 1e2
"""Energy of own turns that rates leave open, over that of all, beyond which they undo what is not there."""
_ROUNDING = 1e-12
"""The least relative error."""


@frozen
class Turning:
    """Rigid motion of everything: u = W x + w + travel.

    Attributes
    ----------
    matrix : Matrix, shape (n_x, n_x)
        W [rad/s].
    shift : ndarray, shape (n_x,)
        w, that of a rotation about an axis that stands still.
    travel : ndarray, shape (n_x,)
        Rates by which the axis itself moves on, evenly.
    spin, centre, velocity : ndarray, shape (n_spin,), (n_dim,), (n_dim,)
        Angular velocity [rad/s], a point of the axis [m], and its velocity [m/s].
    own : dict of str to float
        Rates [rad/s] at which bodies that are the same all around an axis turn about it besides; nobody sees
        that they do.
    """

    matrix: Matrix
    shift: Array
    travel: Array
    spin: Array
    centre: Array
    velocity: Array
    own: dict[str, float] = field(default_factory=dict)

    @property
    def rate(self) -> float:
        """The fastest of all spins [rad/s]."""
        return max(float(np.linalg.norm(self.spin)), *map(abs, self.own.values()), 0.0)

    @classmethod
    def of(
        cls,
        bodies: Iterable[Body],
        spin: Sequence[float] | Array,
        centre: Sequence[float] | Array,
        sparse: bool | None = False,
        velocity: Sequence[float] | Array | None = None,
    ) -> Turning:
        """Return the rotation of bodies whose coordinates stand one after the other.

        Parameters
        ----------
        spin : array_like, shape (n_spin,)
            Angular velocity in ground axes: one number in the plane [rad/s].
        centre : array_like, shape (n_dim,)
            A point of the axis [m].
        sparse : bool, optional
            Whether W is to be sparse; with None, large ones are.
        velocity : array_like, shape (n_dim,), optional
            Of that point [m/s].
        """
        spin, centre = np.asarray(spin, dtype=float), np.asarray(centre, dtype=float)
        moving = np.zeros(len(centre)) if velocity is None else np.asarray(velocity, dtype=float)
        about, along = Twist(-spun(spin, centre), spin), Twist(moving, 0.0 * spin)
        parts = [(body.carried_along(about), body.carried_along(along)[1]) for body in bodies]
        shift = np.concatenate([np.zeros(0), *(own for (_, own), _ in parts)])
        travel = np.concatenate([np.zeros(0), *(own for _, own in parts)])
        matrix = assemble([entries for (entries, _), _ in parts], (len(shift), len(shift)), sparse)
        return cls(matrix, shift, travel, spin, centre, moving)

    @classmethod
    def units(cls, bodies: Iterable[Body], n_dim: int, sparse: bool | None = None) -> list[Turning]:
        """Return shifts of everything along the axes of the ground, then turns about these."""
        twists, each = (np.split(one, [n_dim]) for one in np.eye(freedoms(n_dim))), tuple(bodies)
        return [cls.of(each, spin, np.zeros(n_dim), sparse, shift) for shift, spin in twists]

    @classmethod
    def held_by_joints(cls, bodies: Sequence[Body], equations: Equations, x: Array) -> Turning | None:
        """Return the one rotation of everything, at 1 rad/s, that joints allow at x (n_x,), without drivers.

        None is returned where they allow none, or several.
        """
        n_dim = bodies[0].n_dim
        units = np.concatenate([one.rates(x[None]) for one in cls.units(bodies, n_dim)])
        free = undriven(equations, x, units)
        if len(free) != 1 or not np.linalg.norm(free[0, n_dim:]) > SINGULAR:
            return None
        velocity, spin = np.split(free[0] / np.linalg.norm(free[0, n_dim:]), [n_dim])
        spin, velocity = (np.sign(spin[np.argmax(np.abs(spin))]) * one for one in (spin, velocity))
        # a screw is no rotation
        if n_dim == 3 and abs(velocity @ spin) > SINGULAR * np.linalg.norm(velocity):
            return None
        return cls.of(bodies, spin, spun(spin, velocity), is_sparse(equations.constant_mass))

    @classmethod
    def fitting(
        cls, bodies: Sequence[Body], equations: Equations, t: float,
        x: Array, u: Array, a: Array, blur: Array, alone: bool = False, sets: Sequence[tuple[str, ...]] = (),
    ) -> Turning | None:  # fmt: skip
        """Return the rigid motion of everything that is nearest to rates, in the metric of the mass.

        Parameters
        ----------
        x, u, a : ndarray, shape (n_x,)
            A state and its accelerations, which tell whether the axis moves on where joints allow that.
        blur : ndarray, shape (n_x,)
            What the last digits of the state do to these.
        alone : bool
            Whether it is that of bodies by themselves, where the state might be one of everything as well.
        sets : sequence of tuple of str
            Rigid bodies in space that are welded together, or one alone.

        Returns
        -------
        Turning or None
            None where nothing turns, or where that leaves more than `APART` of the energy of the rates.
        """
        n_dim, sparse = bodies[0].n_dim, is_sparse(equations.constant_mass)
        origin = np.zeros(n_dim)
        units = np.eye(freedoms(n_dim) - n_dim)
        spins = [cls.of(bodies, unit, origin, sparse) for unit in units]
        shifts = [cls.of(bodies, 0.0 * units[0], origin, sparse, unit).travel for unit in np.eye(n_dim)]
        columns = np.array([*(one.rates(x[None])[0] for one in spins), *shifts])
        noise = NOISE**2 * float(equations.momentum(x[None], blur[None])[0] @ blur)
        rotors = cls._with_rotors(bodies, equations, x, u, a, noise, spins, columns, alone, sets)
        if rotors is not None:
            return rotors
        factors, left = _nearest(equations, x, columns, u)
        energy = float(equations.momentum(x[None], u[None])[0] @ u)
        if not energy > 0.0 or left > APART * energy:
            return None
        spin, velocity = factors[: len(units)], factors[len(units) :]
        turning = float(equations.kinetic_energy(x[None], spin @ columns[: len(units)][None])[0])
        if not turning > APART**2 * energy:
            return None
        plain = cls.of(bodies, spin, origin, sparse)
        # of the velocity across the spin, accelerations tell how much is that of the axis
        whirls = np.array([(plain.matrix @ one) for one in shifts])
        own, rest = _nearest(equations, x, whirls, plain.matrix @ u - a)
        size = float(equations.momentum(x[None], a[None])[0] @ a)
        along = (velocity @ spin) / (spin @ spin) * spin if n_dim == 3 else 0.0 * velocity
        for moving in (own + along, along) if rest <= APART**2 * size else (along,):
            found = cls.of(bodies, spin, spun(spin, velocity - moving) / (spin @ spin), sparse, moving)
            if found._allowed(equations, t, x):
                return found
        return found

    @classmethod
    def _with_rotors(
        cls, bodies: Sequence[Body], equations: Equations, x: Array, u: Array, a: Array, noise: float,
        spins: Sequence[Turning], columns: Array, alone: bool, sets: Sequence[tuple[str, ...]],
    ) -> Turning | None:  # fmt: skip
        """Return a steady motion in which round bodies turn by themselves; None if that is not what it is.

        Rates alone do not tell a turn of everything from that of a body: where they leave it open,
        accelerations do.
        """
        n, sparse, count = len(x), is_sparse(equations.constant_mass), len(spins)
        turns = own_turns(bodies, sets, equations, x, columns)
        own = {names: assemble([one], (n, n), sparse) for names, one in turns.items()}
        if not own or not u.any():
            return None
        ways = [
            *(one.matrix for one in spins),
            *(0.0 * spins[0].matrix for _ in columns[count:]),
            *own.values(),
        ]
        every = np.concatenate([columns, [matrix @ x for matrix in own.values()]])
        whirls = np.array([matrix @ u for matrix in ways])
        # a shaft next to nothing beside its disc in mass is no less at rest
        even = _evening(columns, count)
        together, apart, _ = _least(even * columns, even * u)
        unlike = apart > SINGULAR**0.5
        split = _split(equations, x, u, a, noise, every, whirls, even, len(columns), unlike)
        if split is None:
            return None
        factors, missed = split
        size = float(equations.momentum(x[None], a[None])[0] @ a)
        before = _nearest(equations, x, whirls[:0], a - together[:count] @ whirls[:count])[1]
        whole = apart <= max(NOISE * missed, SINGULAR**0.5) and before <= SINGULAR * size + noise
        if whole and (factors[: len(columns)].any() or not alone):
            return None
        spin, velocity, rates = np.split(factors, [count, len(columns)])
        square = float(spin @ spin)
        centre = (
            spun(spin, velocity) / square
            if square > SINGULAR**2 * float(factors @ factors)
            else 0.0 * velocity
        )
        found = cls.of(bodies, spin, centre, sparse)
        turned = sum((rate * matrix for rate, matrix in zip(rates, own.values(), strict=True)), found.matrix)
        turning = {name: rate for one, rate in zip(own, rates.tolist(), strict=True) if rate for name in one}
        return replace(found, matrix=turned, own=turning)

    def _allowed(self, equations: Equations, t: float, x: Array) -> bool:
        """Tell whether the joints allow the accelerations."""
        a, u, reduction = self.accelerations(x[None]), self.rates(x[None]), equations.reduction
        missed = reduction.expand_rates(reduction.free_rates(a)) - a
        gaps = (
            equations.phi.jacobian_at(x[None]) @ a[0] - equations.phi.curvature(np.array([t]), x[None], u)[0]
        )
        size = float(np.abs(a).max(initial=0.0))
        return max(float(np.abs(one).max(initial=0.0)) for one in (missed, gaps)) <= APART**2 * size

    def at_rate(self, rate: float) -> Turning:
        """Return the same at another angular velocity, of this size and sense [rad/s]."""
        factor = rate / self.rate
        turned = factor * self.matrix, factor * self.shift
        own = {name: factor * one for name, one in self.own.items()}
        return replace(self, matrix=turned[0], shift=turned[1], spin=factor * self.spin, own=own)

    def turned_only(self, x: Array) -> Array:
        """Return W x + w, shape (n_batch, n_x), at coordinates (n_batch, n_x)."""
        return np.asarray((self.matrix @ x.T).T + self.shift)

    def rates(self, x: Array) -> Array:
        """Return the rates u, shape (n_batch, n_x), of coordinates (n_batch, n_x)."""
        return self.turned_only(x) + self.travel

    def accelerations(self, x: Array) -> Array:
        """Return u', shape (n_batch, n_x); the force of inertia is -M(x) u'.

        What else rates do to bodies whose mass matrix depends on their coordinates is among the forces of
        the system at these rates.
        """
        return np.asarray((self.matrix @ self.turned_only(x).T).T)

    def turned(self, x: Array, angle: float) -> Array:
        """Return coordinates (n_batch, n_x) after a turn by so many times the spin [s], without travel."""
        from scipy.sparse.linalg import expm_multiply

        whole = _bordered(self.matrix, self.shift)
        points = np.concatenate([x.T, np.ones((1, len(x)))])
        return np.asarray(expm_multiply(angle * whole, points)[:-1].T)

    def along(self, changes: Array, angle: float) -> Array:
        """Return what small changes (n_batch, n_x) of coordinates have become after such a turn."""
        return self.turned(changes, angle) - self.turned(0.0 * changes[:1], angle)


def undriven(equations: Equations, x: Array, rates: Array) -> Array:
    """Return velocities and spins (k, n_freedoms) of rigid motions that joints allow, at x (n_x,).

    Rates (n_freedoms, n_x) are those of `Turning.units` there.  Drivers hinder nothing: what they drive may
    move.
    """
    reduction = equations.reduction
    free = np.ones(equations.n_rows, dtype=bool)
    for constraint, rows in zip(equations.constraints, equations.rows, strict=True):
        free[rows] = not constraint.driven
    gaps = np.asarray(equations.phi.jacobian_at(x[None]) @ rates.T)[free]
    missed = (rates - reduction.expand_rates(reduction.free_rates(rates))).T
    # a straight line that turns about itself does not move
    _, sizes, moving = np.linalg.svd(rates.T, full_matrices=False)
    moving = moving[sizes > SINGULAR * sizes[0]]
    _, sizes, ways = np.linalg.svd(np.linalg.qr(np.concatenate([gaps, missed]) @ moving.T, mode="r"))
    return np.asarray(ways[np.count_nonzero(sizes > SINGULAR * max(1.0, sizes.max(initial=0.0))) :] @ moving)


def _nearest(equations: Equations, x: Array, columns: Array, wanted: Array) -> tuple[Array, float]:
    """Return factors (k,) of rates (k, n_x) that come nearest to wanted ones, and twice the energy left."""
    if not len(columns):
        return np.zeros(0), float(equations.momentum(x[None], wanted[None])[0] @ wanted)
    momenta = equations.momentum(x[None], columns)
    sizes = np.sqrt(np.maximum(np.sum(momenta * columns, axis=1), 0.0))
    there = sizes > SINGULAR * sizes.max()
    scale = np.where(there, 1.0, 0.0) / np.where(there, sizes, 1.0)
    gram = (momenta @ columns.T) * np.outer(scale, scale)
    factors = scale * (np.linalg.pinv(gram, rcond=SINGULAR, hermitian=True) @ (scale * (momenta @ wanted)))
    left = wanted - factors @ columns
    return factors, float(equations.momentum(x[None], left[None])[0] @ left)


def _evening(columns: Array, count: int) -> Array:
    """Return factors (n_x,) that make coordinates alike: lengths, those that shifts change, over the size.

    Of rates (k, n_x), the first are rotations and the others shifts.
    """
    lengths = columns[count:].any(axis=0)
    size = float(np.abs(columns[:count, lengths]).max(initial=0.0))
    return np.where(lengths, 1.0 / size if size > 0.0 else 1.0, 1.0)


def _split(
    equations: Equations,
    x: Array,
    u: Array,
    a: Array,
    noise: float,
    every: Array,
    whirls: Array,
    even: Array,
    shared: int,
    unlike: bool,
) -> tuple[Array, float] | None:
    """Return factors (k,) of rates (k, n_x) that make rates and accelerations, and the relative error.

    Parameters
    ----------
    x, u, a : ndarray, shape (n_x,)
    noise : float
        Twice the energy that accelerations by rounding would be as rates.
    every, whirls : ndarray, shape (k, n_x)
        Rates, and accelerations that go with them.
    even : ndarray, shape (n_x,)
        What makes coordinates alike.
    shared : int
        Those of everything, before those of single bodies; none of them is wanted where the others do.
    unlike : bool
        Whether those of everything alone do not make the rates.

    Returns
    -------
    tuple or None
        None where they do not make the rates or, as far as these leave them open, the accelerations.
    """
    energy, size = (float(equations.momentum(x[None], one[None])[0] @ one) for one in (u, a))
    factors, missed, idle = _least(even * every, even * u)
    factors = factors + _nearest(equations, x, idle @ whirls, a - factors @ whirls)[0] @ idle
    alone, error, _ = _least(even * every[shared:], even * u)
    own = np.sum(equations.momentum(x[None], every[shared:]) * every[shared:], axis=1)
    for one in (np.concatenate([np.zeros(shared), alone]), factors):
        parts = u - one @ every, a - one @ whirls
        left, rest = (float(equations.momentum(x[None], part[None])[0] @ part) for part in parts)
        made = energy > 0.0 and left <= SINGULAR * energy
        # where rates alone tell, what does not last yet accelerates by more
        told = not len(idle) or (unlike and one is not factors)
        made = made and (told or rest <= SINGULAR * size + noise)
        made = made and (not len(idle) or one[shared:] ** 2 @ own <= CANCELLED * energy)
        if made and (one is factors or error <= NOISE * (missed + _ROUNDING)):
            blur = float(np.sqrt(rest / size)) if size and not told else 0.0
            return _without_noise(even * every, even * u, one, missed + blur), missed
    return None


def _least(columns: Array, wanted: Array) -> tuple[Array, float, Array]:
    """Return factors (k,) of rates (k, n) by least squares, the relative error, and what changes nothing.

    The latter are combinations of factors, (n_idle, k).
    """
    sizes = np.linalg.norm(columns, axis=1)
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    left, values, ways = np.linalg.svd((columns / sizes[:, None]).T, full_matrices=False)
    told = values > SINGULAR**0.5 * values.max(initial=0.0)
    factors = ((left.T[told] @ wanted) / values[told]) @ ways[told] / sizes
    missed = float(np.linalg.norm(wanted - factors @ columns))
    return factors, missed / (float(np.linalg.norm(wanted)) or 1.0), ways[~told] / sizes


def _without_noise(columns: Array, wanted: Array, factors: Array, error: float) -> Array:
    """Return factors (k,) with those at zero that are no more than a relative error of the whole makes."""
    sizes = np.abs(factors) * np.linalg.norm(columns, axis=1)
    kept = sizes > NOISE * (error + _ROUNDING) * sizes.max()
    found = np.where(kept, factors, 0.0)
    found[kept] += _least(columns[kept], wanted - found @ columns)[0]
    return found


def _bordered(matrix: Matrix, shift: Array) -> Matrix:
    """Return [[W, w], [0, 0]]."""
    n = len(shift)
    rows, columns = np.arange(n), np.full(n, n)
    own = matrix.tocoo() if not isinstance(matrix, np.ndarray) else None
    r, c = (own.row, own.col) if own is not None else np.nonzero(matrix)
    values = own.data if own is not None else matrix[r, c]
    return assemble([Entries(r, c, values), Entries(rows, columns, shift)], (n + 1, n + 1), sparse=True)
