"""Natural increments of a whole state, through the joints that tie its bodies together."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray, IntArray, Places, run_of
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries, Matrix, assemble, is_sparse
from hfsim.maths.rotations import as_complex, as_vectors
from hfsim.maths.traced import changeable
from hfsim.mechanics.chart import AlikeBodies
from hfsim.mechanics.reduction import Reduction


class BodyIncrements(AlikeBodies):
    """Natural increments of some bodies, written in the places of the coordinates they replace.

    A geometry is whatever the maps need of a batch of states; changes and increments have shape
    (n_batch, n_x) and are those of the whole scene, of which only the bodies' own places are written.
    """

    def geometry(self, x: Array) -> Any:
        """Return what the maps below need of a batch of states."""
        raise NotImplementedError

    def to_natural(self, at: Any, dx: Array, out: Array) -> None:
        """Write the natural increments of small changes into ``out``."""
        raise NotImplementedError

    def from_natural(self, at: Any, y: Array, out: Array) -> None:
        """Write the changes that belong to small natural increments into ``out``."""
        raise NotImplementedError

    def advance(self, at: Any, y: Array, out: Array) -> None:
        """Write the changes that add finite natural increments into ``out``."""
        raise NotImplementedError

    def to_natural_forces(self, at: Any, f: Array, out: Array) -> None:
        """Write forces on natural increments into ``out``: the transpose of `from_natural`."""
        raise NotImplementedError

    def convective(self, at: Any, u: Array, y1: Array, out: Array) -> None:
        """Write what velocities alone make of the second derivatives of the natural coordinates."""
        raise NotImplementedError

    def spins(self, y1: Array) -> Array:
        """Return how fast the bodies turn on the whole at natural rates (n_batch, n_x), (n_batch, bodies)."""
        raise NotImplementedError

    def turned(self) -> Entries:
        """Return the map from changes to their rates where all vectors of bodies turn at 1 rad/s."""
        raise NotImplementedError

    def shifted(self) -> Entries:
        """Return what makes of these rates those about their first nodes."""
        raise NotImplementedError


@frozen
class Tie:
    """A beam or mass point whose place follows from a body nearer to the ground.

    Attributes
    ----------
    positions : ndarray of int, shape (n, 2)
        Columns in x of all positions of the body, that of its origin first: they move together.
    point : ndarray of int, shape (2,)
        Columns of the position at which it is tied.
    parent : ndarray of int, shape (2,), or None
        Columns of the position it is tied to; None for the ground or a point of a rigid body.
    """

    positions: IntArray
    point: IntArray
    parent: IntArray | None

    @cached_property
    def _at(self) -> tuple[Places, Places | None]:
        """The columns ``point`` and ``parent``."""
        return run_of(self.point), None if self.parent is None else run_of(self.parent)

    @cached_property
    def _components(self) -> tuple[Places, Places]:
        """The columns of all x and of all y in ``positions``."""
        return run_of(self.positions[:, 0]), run_of(self.positions[:, 1])

    def _shift(self, dx: Array, shift: Array) -> None:
        for k, columns in enumerate(self._components):
            dx[:, columns] += shift[:, k, None]

    def _total(self, f: Array) -> Array:
        return np.stack([f[:, columns].sum(axis=1) for columns in self._components], axis=1)

    def move(self, x: Array, y: Array, dx: Array, finite: bool) -> None:
        """Shift the body, in changes ``dx`` of the coordinates, to where its parent has moved."""
        point, parent = self._at
        self._shift(dx, -dx[:, point] if parent is None else dx[:, parent] - dx[:, point])

    def led(self, by: IntArray | None) -> Entries:
        """Return what shifts rates of its positions by those of some rows less those of its point."""
        rows = self.positions.T.ravel()
        count = len(self.positions)
        less = Entries(rows, np.repeat(self.point, count), -np.ones(len(rows)))
        if by is None:
            return less
        return Entries.joined([less, Entries(rows, np.repeat(by, count), np.ones(len(rows)))])

    def take_forces(self, x: Array, f: Array) -> Array | None:
        """Hand the forces on the body, in ``f``, to its parent: the transpose of `move` for small changes.

        Returns
        -------
        ndarray, shape (n_batch, 2), or None
            Forces on the place of the body relative to its parent, if that is a natural coordinate.
        """
        total, (point, parent) = self._total(f), self._at
        f[:, point] -= total
        if parent is not None:
            f[:, parent] += total
        return None


@frozen
class Mount(Tie):
    """A beam on a point of a rigid body, hinged or fixed to it.

    Natural coordinates are then relative to the rigid body: the place of the beam in its axes, and, of a
    fixed beam, the angle of the slope there.  In them the joint is linear, however far all turns.

    Attributes
    ----------
    rigid : ndarray of int, shape (3,)
        Columns (x, y, angle) of the rigid body.
    arm : complex
        The point in the rigid body's axes [m].
    slope : int or None
        Column of the natural coordinate that is the angle of the fixed slope.
    """

    rigid: IntArray
    arm: complex
    slope: int | None

    @cached_property
    def _place(self) -> Places:
        return run_of(self.rigid[:2])

    @cached_property
    def _root(self) -> Places:
        return run_of(self.positions[0])

    def _turn(self, x: Array) -> ComplexArray:
        return np.asarray(np.exp(1j * x[:, self.rigid[2]]))

    def make_relative(self, x: Array, dx: Array, y: Array) -> None:
        """Change natural increments of the beam into those relative to the rigid body."""
        turn, spin = self._turn(x), dx[:, self.rigid[2]]
        moved = as_complex(dx[:, self._at[0]]) - as_complex(dx[:, self._place]) - 1j * spin * turn * self.arm
        y[:, self._root] = as_vectors(moved * turn.conj())
        if self.slope is not None:
            y[:, self.slope] -= spin

    def make_absolute(self, y: Array) -> None:
        """Add the turn of the rigid body to the angle of the fixed slope."""
        if self.slope is not None:
            y[:, self.slope] += y[:, self.rigid[2]]

    def move(self, x: Array, y: Array, dx: Array, finite: bool) -> None:
        """Shift the beam to where its point of the rigid body has moved."""
        turn, spin = self._turn(x), dx[:, self.rigid[2]]
        after = turn * np.exp(1j * spin) if finite else turn
        carried = (after - turn) if finite else 1j * spin * turn
        moved = as_complex(dx[:, self._place]) + carried * self.arm
        moved += after * as_complex(y[:, self._root])
        self._shift(dx, as_vectors(moved) - dx[:, self._at[0]])

    def turned(self, rows: IntArray) -> Entries:
        """Return the rates (2 rows) of changes of its point that turns about the place of the rigid body."""
        place = Entries.of_turns(rows, self.rigid[:2], -1.0)
        return Entries.joined([Entries.of_turns(rows, self.point), place])

    def take_forces(self, x: Array, f: Array) -> Array | None:
        """Hand the forces on the beam, in ``f``, to the rigid body; return those on its relative place."""
        turn, total = self._turn(x), self._total(f)
        f[:, self._at[0]] -= total
        f[:, self._place] += total
        seen = as_complex(total) * turn.conj()
        f[:, self.rigid[2]] += (seen * np.conj(self.arm)).imag
        return as_vectors(seen)

    def take_moment(self, f: Array) -> None:
        """Add the moment on the fixed slope to that on the rigid body: the transpose of `make_absolute`."""
        if self.slope is not None:
            f[:, self.rigid[2]] += f[:, self.slope]


@frozen
class Rail(Tie):
    """A body that is guided on a line of the ground: one component of its place follows from the other.

    Attributes
    ----------
    slope : float
        Change of the second entry of ``point`` by that of the first.
    """

    slope: float

    def move(self, x: Array, y: Array, dx: Array, finite: bool) -> None:
        """Let the second component follow."""
        dx[:, self.point[1]] = self.slope * dx[:, self.point[0]]

    def take_forces(self, x: Array, f: Array) -> None:
        """Hand the force on it to the first one."""
        f[:, self.point[0]] += self.slope * f[:, self.point[1]]


@frozen
class NaturalIncrements:
    """Natural increments of a whole state; coordinates outside the beams stay as they are.

    The state are the free coordinates that joints leave.  The place of a tied body follows from what it is
    tied to, and its increments are relative to that.

    Attributes
    ----------
    ties : tuple of Tie
        In order from the ground outwards.
    columns : ndarray of int, shape (n,)
        Columns of x whose natural increments are free.
    """

    beams: tuple[BodyIncrements, ...]
    reduction: Reduction
    ties: tuple[Tie, ...]
    columns: IntArray

    @cached_property
    def _mounts(self) -> tuple[Mount, ...]:
        return tuple(tie for tie in self.ties if isinstance(tie, Mount))

    def from_state(self, q: Array) -> NaturalIncrements:
        """Return the same."""
        return self

    def geometry(self, q: Array) -> tuple[Array, list[Any]]:
        """Return what the maps below need of a batch of states (n_batch, n)."""
        x = self.reduction.expand(q)
        return x, [part.geometry(x) for part in self.beams]

    def to_natural(self, at: tuple[Array, list[Any]], dq: Array) -> Array:
        """Return natural increments of small changes of the states."""
        dx = self.reduction.expand_rates(dq)
        y = changeable(dx)
        for part, geometry in zip(self.beams, at[1], strict=True):
            part.to_natural(geometry, dx, y)
        for mount in self._mounts:
            mount.make_relative(at[0], dx, y)
        return self._free(y)

    def from_natural(self, at: tuple[Array, list[Any]], y: Array) -> Array:
        """Return the changes of the states that belong to small natural increments."""
        return self._changes(at, y, finite=False)

    def advance(self, at: tuple[Array, list[Any]], y: Array) -> Array:
        """Return the changes of the states that add finite natural increments."""
        return self._changes(at, y, finite=True)

    def _changes(self, at: tuple[Array, list[Any]], y: Array, finite: bool) -> Array:
        whole = self._whole(y)
        for mount in self._mounts:
            mount.make_absolute(whole)
        dx = changeable(whole)
        for part, geometry in zip(self.beams, at[1], strict=True):
            (part.advance if finite else part.from_natural)(geometry, whole, dx)
        for tie in self.ties:
            tie.move(at[0], whole, dx, finite)
        return self.reduction.free_rates(dx)

    def to_natural_forces(self, at: tuple[Array, list[Any]], f: Array) -> Array:
        """Return the forces on natural increments: the transpose of `from_natural`."""
        fx = f.copy() if self.reduction.identity else self.reduction.read_force(f)
        places = [(tie, tie.take_forces(at[0], fx)) for tie in reversed(self.ties)]
        out = changeable(fx)
        for part, geometry in zip(self.beams, at[1], strict=True):
            part.to_natural_forces(geometry, fx, out)
        for tie, force in places:
            if force is not None:
                out[:, run_of(tie.positions[0])] += force
        for mount in self._mounts:
            mount.take_moment(out)
        return self._free(out)

    def rates(self, at: tuple[Array, list[Any]], v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return the first and second time derivatives of the natural coordinates in one state.

        Third comes the part of the second ones that velocities alone cause.
        """
        dx = self.reduction.expand_rates(np.concatenate([v, a]))
        y = dx.copy()
        u, y1, y2 = dx[: len(v)], y[: len(v)], y[len(v) :]
        rest = np.zeros_like(u)
        for part, geometry in zip(self.beams, at[1], strict=True):
            part.to_natural(geometry, dx, y)
            part.convective(geometry, u, y1, rest)
        for mount in self._mounts:
            mount.make_relative(at[0], dx, y)
            # the joint holds, so that nothing moves relative to the rigid body
            root = run_of(mount.positions[0])
            y1[:, root], rest[:, root] = 0.0, -y2[:, root]
        return self._free(y1), self._free(y2 + rest), self._free(rest)

    def turning(self, at: tuple[Array, list[Any]], v: Array) -> Matrix:
        """Return the matrix W (n, n) with which changes of the state turn at rates v (n,).

        Where natural increments stand still, changes of the state do not: they turn with the bodies, at rates
        W dq, and their second derivatives are W W dq while bodies turn on like that.

        A body also carries along what is tied to it.  That is left out where matrices are sparse: W turns all
        vectors of a body as that body turns, which is the same where all turn as one, and couples nothing
        (along a chain, every beam would reach all beyond it, and factors would be full).  Nor do bodies turn
        there that nothing holds: the place of a first node, about which they do, would reach all of them.
        """
        u = self.reduction.expand_rates(v[None])
        y1 = changeable(u)
        for part, geometry in zip(self.beams, at[1], strict=True):
            part.to_natural(geometry, u, y1)
        spins = [part.spins(y1) for part in self.beams] + [u[:, mount.rigid[2:]] for mount in self._mounts]
        left, right, which = self._turns
        own = np.concatenate(spins, axis=1)[0].take(which)
        if is_sparse(left):
            return left.multiply(own).tocsr() @ right
        return np.asarray((left * own) @ right)

    @cached_property
    def _turns(self) -> tuple[Matrix, Matrix, IntArray]:
        """Matrices (n, m) and (m, n) between which `turning` has spins of m rows, and which spin each has.

        The rows are rates about the first node of a beam, and, for each mount, those of its point about the
        place of the rigid body; the left matrix hands them on from body to body.  Sparse ones have neither.
        """
        n, sparse = len(self.reduction.offset), is_sparse(self.reduction.basis)
        mounts = () if sparse else self._mounts
        extra = n + np.arange(2 * len(mounts)).reshape(-1, 2)
        m, counts = n + extra.size, [part.bodies for part in self.beams]
        which = np.zeros(m, dtype=np.intp)
        for part, first in zip(self.beams, np.cumsum([0, *counts]), strict=False):
            places = np.arange(part.columns.start, part.columns.stop)
            which[places] = first + np.repeat(np.arange(part.bodies), len(places) // part.bodies)
        which[n:] = np.repeat(sum(counts) + np.arange(len(mounts)), 2)
        if sparse:
            return self.reduction.reading, self._turned_apart(which) @ self.reduction.basis, which
        rates = [part for one in self.beams for part in (one.turned(), one.shifted())]
        rates += [mount.turned(rows) for mount, rows in zip(mounts, extra, strict=True)]
        own, every = iter(extra), np.arange(m)
        unit = Entries(every, every, np.ones(m))
        led = assemble([unit], (m, m), False)
        for tie in self.ties:
            if not isinstance(tie, Rail):
                by = next(own) if isinstance(tie, Mount) else tie.parent
                led = assemble([unit, tie.led(by)], (m, m), False) @ led
        right = assemble(rates, (m, n), False) @ self.reduction.basis
        return self.reduction.reading @ led[:n], right, which

    def _turned_apart(self, which: IntArray) -> Matrix:
        """Return the rates of vectors that turn as their bodies do, (n_x, n_x), where anything holds these.

        A point that is tied turns as what it is tied to, which is written into ``which``.
        """
        n = len(which)
        bent, held = np.zeros((2, n), dtype=bool)
        first, points = np.arange(n), [NOTHING]
        for part in self.beams:
            places = np.arange(part.columns.start, part.columns.stop).reshape(part.bodies, -1)
            first[places], bent[places] = places[:, :1], True
        for tie in self.ties:
            held[tie.positions] = tie.parent is None or held[tie.parent[0]]
            if tie.parent is not None and not bent[tie.point[0]]:
                which[tie.positions] = which[tie.parent[0]]
                points.append(Entries.of_turns(tie.positions, tie.positions))
        entries = Entries.joined([*(part.turned() for part in self.beams), *points])
        holds = held[first[entries.rows]]
        kept = Entries(entries.rows[holds], entries.columns[holds], entries.values[holds])
        return assemble([kept], (n, n), True)

    def _free(self, y: Array) -> Array:
        return y if self.reduction.identity else y.take(self.columns, axis=1)

    def _whole(self, y: Array) -> Array:
        if self.reduction.identity:
            return y.copy()
        whole = np.zeros((len(y), len(self.reduction.offset)))
        whole[:, self.columns] = y
        return whole
