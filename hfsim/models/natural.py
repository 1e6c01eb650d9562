"""Natural increments: coordinates in which the stiffness of a beam hardly changes as it moves.

The axial stiffness of a beam couples to the change of its slopes: in nodal vectors a Newton matrix
taken at one state serves only for small changes.  In *natural* coordinates it serves for large ones:
the logarithm of each gradient vector (stretch and angle), and of each element the mean Green strain
of its centre line and the angle of its chord.  Only Newton corrections are expressed in them; the
equations stay those of the state coordinates, and so do the results.

Planar vectors are complex numbers; everything has a leading batch axis.  Natural coordinates stand
where the coordinates they replace stand: root position; logarithm of a gradient vector; mean strain
+ i chord angle of element e in the place of the position of node e + 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hfsim.arrays import Array, ComplexArray, IntArray
from hfsim.elements.cable import mean_square_slope
from hfsim.reduction import Reduction
from hfsim.rotations import as_complex, as_vectors


@dataclass(frozen=True)
class Geometry:
    """Nodal vectors of alike beams in a batch of states.

    Attributes
    ----------
    z : ndarray of complex, shape (n_batch, n_bodies, n_vectors)
        Nodal vectors, with a body frame those relative to it.
    d : ndarray of complex, shape (n_batch, n_bodies, n_elements)
        Chords over element lengths.
    gradient : tuple of ndarray, each of the shape of d
        Half the derivative of the mean square slope by chord, first and last slope.
    """

    z: ComplexArray
    d: ComplexArray
    gradient: tuple[ComplexArray, ComplexArray, ComplexArray]


@dataclass(frozen=True)
class NaturalBeams:
    """Natural increments of alike beams that stand side by side in the state.

    Attributes
    ----------
    columns : slice
    bodies : int
    per_node : int
        Vectors at each node.
    length : float
        Element length [m].
    framed : bool
        Whether the state has a body frame.
    """

    columns: slice
    bodies: int
    per_node: int
    length: float
    framed: bool

    @cached_property
    def _metric(self) -> tuple[float, float, float, float]:
        g = mean_square_slope()
        return float(g[0, 0]), float(g[0, 1]), float(g[1, 1]), float(g[1, 2])

    def _complex(self, q: Array) -> ComplexArray:
        part = q[:, self.columns].reshape(len(q), self.bodies, -1)
        return np.ascontiguousarray(part).view(np.complex128)

    def _vectors(self, c: ComplexArray) -> ComplexArray:
        """Return nodal vectors, or changes of them, as seen from the frame."""
        if not self.framed:
            return c
        z = c.copy()
        z[..., 0] = 0.0
        z[..., 1] = c[..., 1].imag
        return z

    def _parts(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return chords over the element length, first and last slopes of all elements."""
        places, slopes = z[..., :: self.per_node], z[..., 1 :: self.per_node]
        return (places[..., 1:] - places[..., :-1]) * (1.0 / self.length), slopes[..., :-1], slopes[..., 1:]

    def _gradient(
        self, d: ComplexArray, s: ComplexArray, e: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        g00, g01, g11, g12 = self._metric
        both = g01 * d
        return g00 * d + g01 * (s + e), both + g11 * s + g12 * e, both + g12 * s + g11 * e

    def geometry(self, q: Array) -> Geometry:
        """Return what the maps below need of a batch of states."""
        z = self._vectors(self._complex(q))
        d, s, e = self._parts(z)
        return Geometry(z, d, self._gradient(d, s, e))

    def to_natural(self, at: Geometry, dq: Array, out: Array) -> None:
        """Write the natural increments of small changes ``dq`` into ``out``."""
        c = self._complex(dq)
        dz = self._vectors(c)
        dd, ds, de = self._parts(dz)
        gd, gs, ge = at.gradient
        strain = (gd.conj() * dd + gs.conj() * ds + ge.conj() * de).real
        z = at.z
        if self.framed:
            z = z.copy()
            z[..., 0] = 1.0
        y = dz / z
        y.real[..., self.per_node :: self.per_node] = strain
        y.imag[..., self.per_node :: self.per_node] = (dd / at.d).imag
        y[..., 0] = c[..., 0]
        if self.framed:
            y.imag[..., 1] = c[..., 1].real
        self._put(y, out)

    def from_natural(self, at: Geometry, y: Array, out: Array) -> None:
        """Write the changes of the state that belong to small natural increments into ``out``."""
        c = self._complex(y)
        dz = c * at.z
        if self.framed:
            dz[..., 1] = c[..., 1].real * at.z[..., 1]
        _, ds, de = self._parts(dz)
        gd, gs, ge = at.gradient
        chord = c[..., self.per_node :: self.per_node]
        turning = gd.conj() * at.d
        rest = (gs.conj() * ds + ge.conj() * de).real
        stretch = (chord.real - rest + turning.imag * chord.imag) / turning.real
        self._join(dz, (stretch + 1j * chord.imag) * at.d, c, out)

    def advance(self, at: Geometry, y: Array, out: Array) -> None:
        """Write the change of the state that adds finite natural increments, exactly, into ``out``."""
        c = self._complex(y)
        z = self._turned(at.z, c)
        _, s, e = self._parts(z)
        d0, s0, e0 = self._parts(at.z)
        gd, gs, ge = at.gradient
        square = (gd.conj() * d0 + gs.conj() * s0 + ge.conj() * e0).real
        chord = c[..., self.per_node :: self.per_node]
        direction = np.exp(1j * chord.imag) * (at.d / np.abs(at.d))
        g00, g01, g11, g12 = self._metric
        slopes = g11 * (np.abs(s) ** 2 + np.abs(e) ** 2) + 2.0 * g12 * (s.conj() * e).real
        half = (g01 / g00) * (direction.conj() * (s + e)).real
        length = np.sqrt((square + 2.0 * chord.real - slopes) / g00 + half * half) - half
        self._join(z - at.z, length * direction - at.d, c, out)

    def _turned(self, z: ComplexArray, c: ComplexArray) -> ComplexArray:
        """Return gradient vectors stretched and turned; positions come out as they may."""
        factor = np.exp(c)
        if self.framed:
            factor[..., 1] = np.abs(factor[..., 1])
        return np.asarray(factor * z)

    def _join(self, dz: ComplexArray, dd: ComplexArray, c: ComplexArray, out: Array) -> None:
        """Put changes of chords and gradient vectors together into a change of the state."""
        root = 0.0 if self.framed else c[..., :1]
        dz[..., self.per_node :: self.per_node] = np.cumsum(dd * self.length, axis=-1) + root
        dz[..., 0] = c[..., 0]
        if self.framed:
            dz[..., 1] = c[..., 1].imag + 1j * dz[..., 1].real
        self._put(dz, out)

    def rates(self, q: Array, v: Array, a: Array, y1: Array, y2: Array) -> None:
        """Write the first and second time derivatives of the natural coordinates into ``y1`` and ``y2``."""
        at = self.geometry(q)
        self.to_natural(at, v, y1)
        self.to_natural(at, a, y2)
        w = self._vectors(self._complex(v))
        dd, ds, de = self._parts(w)
        hd, hs, he = self._gradient(dd, ds, de)
        first = self._complex(y1)
        bend = -(first * first)
        chords = slice(self.per_node, None, self.per_node)
        bend[..., chords] = 1j * (-((dd / at.d) ** 2)).imag
        bend.real[..., chords] = (hd.conj() * dd + hs.conj() * ds + he.conj() * de).real
        bend[..., 0] = 0.0
        if self.framed:
            bend[..., 1] = -(first[..., 1].real ** 2)
        self._put(self._complex(y2) + bend, y2)

    def _put(self, z: ComplexArray, out: Array) -> None:
        out[:, self.columns] = z.reshape(len(out), -1).view(np.float64)


@dataclass(frozen=True)
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

    def move(self, x: Array, y: Array, dx: Array, finite: bool) -> None:
        """Shift the body, in changes ``dx`` of the coordinates, to where its parent has moved."""
        shift = -dx[:, self.point]
        if self.parent is not None:
            shift += dx[:, self.parent]
        dx[:, self.positions] += shift[:, None, :]


@dataclass(frozen=True)
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

    def _turn(self, x: Array) -> ComplexArray:
        return np.asarray(np.exp(1j * x[:, self.rigid[2]]))

    def make_relative(self, x: Array, dx: Array, y: Array) -> None:
        """Change natural increments of the beam into those relative to the rigid body."""
        turn, spin = self._turn(x), dx[:, self.rigid[2]]
        moved = (
            as_complex(dx[:, self.point]) - as_complex(dx[:, self.rigid[:2]]) - 1j * spin * turn * self.arm
        )
        y[:, self.positions[0]] = as_vectors(moved * turn.conj())
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
        moved = as_complex(dx[:, self.rigid[:2]]) + carried * self.arm
        moved += after * as_complex(y[:, self.positions[0]])
        dx[:, self.positions] += (as_vectors(moved) - dx[:, self.point])[:, None, :]


@dataclass(frozen=True)
class NaturalIncrements:
    """Natural increments of a whole state; coordinates outside the beams stay as they are.

    The state are the free coordinates that joints leave.  The place of a tied body follows from what it is
    tied to, and its increments are relative to that.

    Attributes
    ----------
    beams : tuple of NaturalBeams
    reduction : Reduction
    ties : tuple of Tie
        In order from the ground outwards.
    columns : ndarray of int, shape (n,)
        Columns of x whose natural increments are free.
    """

    beams: tuple[NaturalBeams, ...]
    reduction: Reduction
    ties: tuple[Tie, ...]
    columns: IntArray

    @cached_property
    def _mounts(self) -> tuple[Mount, ...]:
        return tuple(tie for tie in self.ties if isinstance(tie, Mount))

    def geometry(self, q: Array) -> tuple[Array, list[Geometry]]:
        """Return what the maps below need of a batch of states (n_batch, n)."""
        x = self.reduction.expand(q)
        return x, [part.geometry(x) for part in self.beams]

    def to_natural(self, at: tuple[Array, list[Geometry]], dq: Array) -> Array:
        """Return natural increments of small changes of the states."""
        dx = self.reduction.expand_rates(dq)
        y = dx.copy()
        for part, geometry in zip(self.beams, at[1], strict=True):
            part.to_natural(geometry, dx, y)
        for mount in self._mounts:
            mount.make_relative(at[0], dx, y)
        return self._free(y)

    def from_natural(self, at: tuple[Array, list[Geometry]], y: Array) -> Array:
        """Return the changes of the states that belong to small natural increments."""
        return self._changes(at, y, finite=False)

    def advance(self, at: tuple[Array, list[Geometry]], y: Array) -> Array:
        """Return the changes of the states that add finite natural increments."""
        return self._changes(at, y, finite=True)

    def _changes(self, at: tuple[Array, list[Geometry]], y: Array, finite: bool) -> Array:
        whole = self._whole(y)
        for mount in self._mounts:
            mount.make_absolute(whole)
        dx = whole.copy()
        for part, geometry in zip(self.beams, at[1], strict=True):
            (part.advance if finite else part.from_natural)(geometry, whole, dx)
        for tie in self.ties:
            tie.move(at[0], whole, dx, finite)
        return self.reduction.free_rates(dx)

    def rates(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the first and second time derivatives of the natural coordinates."""
        x, u, ax = self.reduction.expand(q), self.reduction.expand_rates(v), self.reduction.expand_rates(a)
        y1, y2 = u.copy(), ax.copy()
        for part in self.beams:
            part.rates(x, u, ax, y1, y2)
        for mount in self._mounts:
            for rates, changes in ((y1, u), (y2, ax)):
                mount.make_relative(x, changes, rates)
                # the joint holds, so that nothing moves relative to the rigid body
                rates[:, mount.positions[0]] = 0.0
        return self._free(y1), self._free(y2)

    def _free(self, y: Array) -> Array:
        return y if self.reduction.identity else y[:, self.columns]

    def _whole(self, y: Array) -> Array:
        if self.reduction.identity:
            return y.copy()
        whole = np.zeros((len(y), len(self.reduction.offset)))
        whole[:, self.columns] = y
        return whole
