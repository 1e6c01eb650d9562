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
from hfsim.mechanics.nearest_rates import NOISE, SINGULAR, evening, least, nearest, split
from hfsim.mechanics.pose import Twist
from hfsim.mechanics.rotors import own_turns

if TYPE_CHECKING:
    from hfsim.mechanics.body import Body
    from hfsim.mechanics.equations import Equations

APART = 1e-2
"""Part of the energy of rates that may be other than that of a rigid motion which stands for them."""


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
    lead : str or None
        Of these the one whose rate `at_rate` means; without one it is the fastest spin.
    """

    matrix: Matrix
    shift: Array
    travel: Array
    spin: Array
    centre: Array
    velocity: Array
    own: dict[str, float] = field(default_factory=dict)
    lead: str | None = None

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
    def units(
        cls, bodies: Iterable[Body], n_dim: int, sparse: bool | None = None, centre: Array | None = None
    ) -> list[Turning]:
        """Return shifts of everything along the axes of the ground, then turns about these, or a centre."""
        twists, each = (np.split(one, [n_dim]) for one in np.eye(freedoms(n_dim))), tuple(bodies)
        about = np.zeros(n_dim) if centre is None else centre
        return [cls.of(each, spin, about, sparse, shift) for shift, spin in twists]

    @classmethod
    def about_mass(
        cls, bodies: Sequence[Body], equations: Equations, x: Array, sparse: bool | None = None
    ) -> list[Turning]:
        """Return the same about the centre of mass at x (n_x,): far off, turns about the ground shift."""
        n_dim = bodies[0].n_dim
        units = cls.units(bodies, n_dim, sparse)
        shifts, turns = np.split(np.array([one.rates(x[None])[0] for one in units]), [n_dim])
        momenta = equations.momentum(x[None], shifts)
        mass = float(momenta[0] @ shifts[0])
        if not mass > 0.0:
            return units
        spins = np.eye(len(turns))
        centre = -spun(spins, turns @ momenta.T / mass).sum(axis=0) / (n_dim - 1)
        return cls.units(bodies, n_dim, sparse, centre)

    @classmethod
    def held_by_joints(cls, bodies: Sequence[Body], equations: Equations, x: Array) -> Turning | None:
        """Return the one rotation of everything, 1 rad/s, that undriven joints allow at x (n_x,), or None."""
        n_dim = bodies[0].n_dim
        units = np.concatenate([one.rates(x[None]) for one in cls.units(bodies, n_dim)])
        free = undriven(equations, x, units)
        if len(free) != 1 or not np.linalg.norm(free[0, n_dim:]) > SINGULAR:
            return None
        velocity, spin = np.split(free[0] / np.linalg.norm(free[0, n_dim:]), [n_dim])
        spin, velocity = (np.sign(spin[np.argmax(np.abs(spin))]) * one for one in (spin, velocity))
        # a screw is no rotation; where the axis runs through the origin, the velocity there is but rounding
        energies = np.sum(equations.momentum(x[None], units) * units, axis=1)
        if n_dim == 3 and (velocity @ spin) ** 2 * energies[0] > SINGULAR**2 * energies[n_dim:].max():
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
        units = cls.about_mass(bodies, equations, x, sparse)
        shifts, spins = [one.travel for one in units[:n_dim]], units[n_dim:]
        centre = spins[0].centre
        columns = np.array([*(one.rates(x[None])[0] for one in spins), *shifts])
        factors, left = nearest(equations, x, columns, u)
        _, sizes, ways = np.linalg.svd(columns.T, full_matrices=False)
        idle = ways[sizes <= SINGULAR * sizes[0]]  # a straight line does not move as it turns about itself
        spin, velocity = np.split(factors - idle.T @ (idle @ factors), [len(spins)])
        rates = np.roll(columns, n_dim, axis=0)
        # what shifts freely turns no less
        free = _unheld(equations, x, rates, velocity)
        inner = u - free @ rates[:n_dim]
        own_turn = spin @ columns[: len(spins)]
        energy, every, turning = (
            float(equations.momentum(x[None], one[None])[0] @ one) for one in (inner, u, own_turn)
        )
        if not energy > SINGULAR**2 * every:
            return None
        noise = NOISE**2 * float(equations.momentum(x[None], blur[None])[0] @ blur)
        for moved, travel in ((u, 0.0 * free), (inner, free)) if free.any() else ((u, free),):
            given = bodies, equations, x, moved, a, noise, spins, columns, alone, sets
            if (rotors := cls._with_rotors(*given, travel)) is not None:
                return rotors
        if left > APART * energy or not turning > SINGULAR**2 * every:
            return None
        plain = cls.of(bodies, spin, centre, sparse)
        # of the velocity across the spin, accelerations tell how much is that of the axis
        whirls = np.array([(plain.matrix @ one) for one in shifts])
        own, rest = nearest(equations, x, whirls, plain.matrix @ u - a)
        size = float(equations.momentum(x[None], a[None])[0] @ a)
        along = (velocity @ spin) / (spin @ spin) * spin if n_dim == 3 else 0.0 * velocity
        for moving in (own + along, along) if rest <= APART**2 * size else (along,):
            axis = centre + spun(spin, velocity - moving) / (spin @ spin)
            found = cls.of(bodies, spin, axis, sparse, moving)
            if found._allowed(equations, t, x):
                return found
        return found

    @classmethod
    def _with_rotors(
        cls, bodies: Sequence[Body], equations: Equations, x: Array, u: Array, a: Array, noise: float,
        spins: Sequence[Turning], columns: Array, alone: bool, sets: Sequence[tuple[str, ...]], travel: Array,
    ) -> Turning | None:  # fmt: skip
        """Return a steady motion in which round bodies turn by themselves; None if that is not what it is.

        Rates alone do not tell a turn of everything from that of a body: where they leave it open,
        accelerations do.  The axis moves on with travel (n_dim,) [m/s], which is not among the rates.
        """
        n, sparse, count = len(x), is_sparse(equations.constant_mass), len(spins)
        turns = own_turns(bodies, sets, equations, x, columns)
        own = {names: assemble([one], (n, n), sparse) for names, one in turns.items()}
        if not own:
            return None
        ways = [
            *(one.matrix for one in spins),
            *(0.0 * spins[0].matrix for _ in columns[count:]),
            *own.values(),
        ]
        every = np.concatenate([columns, [matrix @ x for matrix in own.values()]])
        whirls = np.array([matrix @ u for matrix in ways])
        # a shaft next to nothing beside its disc in mass is no less at rest
        even = evening(equations, x, columns, count)
        together, apart, _ = least(even * columns, even * u)
        unlike = apart > SINGULAR**0.5
        made = split(equations, x, u, a, noise, every, whirls, even, len(columns), unlike)
        if made is None:
            return None
        factors, missed = made
        size = float(equations.momentum(x[None], a[None])[0] @ a)
        before = nearest(equations, x, whirls[:0], a - together[:count] @ whirls[:count])[1]
        whole = apart <= max(NOISE * missed, SINGULAR**0.5) and before <= SINGULAR * size + noise
        if whole and (factors[: len(columns)].any() or not alone):
            return None
        spin, velocity, rates = np.split(factors, [count, len(columns)])
        square = float(spin @ spin)
        turned = square > SINGULAR**2 * float(factors @ factors)
        centre = spins[0].centre + spun(spin, velocity) / square if turned else 0.0 * velocity
        found = cls.of(bodies, spin, centre, sparse, travel)
        matrix = sum((rate * matrix for rate, matrix in zip(rates, own.values(), strict=True)), found.matrix)
        turning = {name: rate for one, rate in zip(own, rates.tolist(), strict=True) if rate for name in one}
        return replace(found, matrix=matrix, own=turning)

    def _allowed(self, equations: Equations, t: float, x: Array) -> bool:
        """Tell whether the joints allow the accelerations."""
        a, u, reduction = self.accelerations(x[None]), self.rates(x[None]), equations.reduction
        missed = reduction.expand_rates(reduction.free_rates(a)) - a
        gaps = (
            equations.phi.jacobian_at(x[None]) @ a[0] - equations.phi.curvature(np.array([t]), x[None], u)[0]
        )
        size = float(np.abs(a).max(initial=0.0))
        return max(float(np.abs(one).max(initial=0.0)) for one in (missed, gaps)) <= APART**2 * size

    def together(self, bodies: Iterable[Body]) -> Turning:
        """Return the same where no body turns by itself."""
        return self.of(bodies, self.spin, self.centre, is_sparse(self.matrix), self.velocity)

    def at_rate(self, rate: float) -> Turning:
        """Return the same at another angular velocity, of this size and sense [rad/s]."""
        factor = rate / (self.rate if self.lead is None else abs(self.own[self.lead]))
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

        points = np.concatenate([x.T, np.ones((1, len(x)))])
        return np.asarray(expm_multiply(angle * _bordered(self.matrix, self.shift), points)[:-1].T)

    def along(self, changes: Array, angle: float) -> Array:
        """Return what small changes (n_batch, n_x) of coordinates have become after such a turn."""
        return self.turned(changes, angle) - self.turned(0.0 * changes[:1], angle)


def _unheld(equations: Equations, x: Array, rates: Array, velocity: Array) -> Array:
    """Return the part of a velocity (n_dim,) of everything that joints allow by itself, as in `undriven`."""
    ways, n_dim = undriven(equations, x, rates), len(velocity)
    _, sizes, mixed = np.linalg.svd(ways[:, n_dim:].T)
    shifts = (mixed[np.count_nonzero(sizes > SINGULAR) :] @ ways)[:, :n_dim]
    return np.asarray(velocity @ shifts.T @ shifts)


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


def _bordered(matrix: Matrix, shift: Array) -> Matrix:
    """Return [[W, w], [0, 0]]."""
    n = len(shift)
    rows, columns = np.arange(n), np.full(n, n)
    own = matrix.tocoo() if not isinstance(matrix, np.ndarray) else None
    r, c = (own.row, own.col) if own is not None else np.nonzero(matrix)
    values = own.data if own is not None else matrix[r, c]
    return assemble([Entries(r, c, values), Entries(rows, columns, shift)], (n + 1, n + 1), sparse=True)
