"""Bodies: what each adds of its own to a scene, whatever its kind and model.

The page to read before adding one.  A body has a run of absolute coordinates x, in which its mass matrix,
its forces and its markers are written.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from hfsim.deck.sections import Fibres
from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import lever
from hfsim.mechanics.chart import Chart
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.increments import BodyIncrements
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.mechanics.variable_mass import VariableMass

if TYPE_CHECKING:
    from hfsim.mechanics.carried import Carried
    from hfsim.mechanics.line_force import LineLoad

Place = tuple[float, ...]
"""A point in the undeformed body frame [m]."""
Load = tuple[Marker, Array]
"""A point of a body, and the force of something else there on the body's coordinates."""


class Acting(NamedTuple):
    """All that other parts do to a body, weight apart.

    Attributes
    ----------
    points : tuple of Load
        Of joints, springs and loads on points.
    lines : tuple of (LineLoad, list of Array)
        With the forces at their places [N], (n_batch, n_dim).
    """

    points: tuple[Load, ...] = ()
    lines: tuple[tuple[LineLoad, list[Array]], ...] = ()


def places(points: Mapping[str, Sequence[float]]) -> dict[str, Place]:
    """Return named points as places."""
    return {name: tuple(point) for name, point in points.items()}


@frozen
class Body:
    """A body of an assembled scene.

    Attributes
    ----------
    name : str
        Name in the deck.
    columns : slice
        Its coordinates in x.
    points : dict of str to Place
        Named points.
    n_dim : int
        Number of components of a vector.
    """

    name: str
    columns: slice
    points: dict[str, Place]
    n_dim: ClassVar[int] = 2

    @property
    def banded(self) -> bool:
        """Whether large scenes with it may use sparse matrices."""
        return True

    @property
    def item(self) -> str:
        """Its deck path."""
        return f"bodies.{self.name}"

    @property
    def still(self) -> bool:
        """Whether it cannot move: it has no coordinates."""
        return bool(self.columns.start == self.columns.stop)

    @property
    def described(self) -> tuple[str, str]:
        """What its coordinates are, and why there are these, in the words of plans."""
        return "place and angle", "rigid: no elastic coordinates"

    def folded(self, pose: Pose) -> Body:
        """Return the same body held for ever at a pose.

        Raises
        ------
        NotImplementedError
            If it deforms.
        """
        raise NotImplementedError

    # ------------------------------------------------------------------ where it is

    @property
    def angle_column(self) -> int | None:
        """Column of `System.arranged` that is its frame angle with all turns; None where slopes give it."""
        return None

    @property
    def position_columns(self) -> IntArray:
        """Coordinates that are positions, shape (n, n_dim), that of the origin first; none in body frames."""
        return np.zeros((0, self.n_dim), dtype=np.intp)

    @property
    def origin(self) -> Place:
        """The origin of the body frame."""
        return (0.0,) * self.n_dim

    def reference(self, place: Place) -> Place:
        """Return where a material point is in the undeformed body frame [m]."""
        return place

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point."""
        raise NotImplementedError

    def grip(self, place: Place) -> Marker:
        """Return the marker by which joints, springs and loads take hold of it there."""
        return self.marker(place)

    def placed(self, pose: Pose) -> Array:
        """Return the coordinates of the undeformed body, shape (n_columns,)."""
        raise NotImplementedError

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the rates of the undeformed body in rigid motion, shape (n_columns,)."""
        raise NotImplementedError

    def extent(self, x: Array) -> Array:
        """Return its origin and named points, of beams points of the line, (n_batch, n_points, n_dim)."""
        places = [self.origin, *self.points.values()]
        return np.stack([self.marker(place).position(x) for place in places], axis=1)

    def outline(self, x: Array) -> Array:
        """Return the same for pictures, in the order of a line; in space the edges of what they enclose."""
        if self.n_dim == 2:
            return self.extent(x)
        from hfsim.maths.hull import wire

        return self.extent(x)[:, wire(np.array([self.origin, *self.points.values()]))]

    @property
    def outline_places(self) -> Array:
        """Distances from the root of the points of its outline, where it has internal forces [m]."""
        return np.zeros(0)

    # ------------------------------------------------------------------ how it deforms

    def fibres(self, places: Array) -> Fibres | None:
        """Return what normal stresses at distances from the root [m] follow from; None if not known."""
        return None

    def section_forces(self, x: Array, u: Array, a: Array, acting: Acting, places: Array) -> Array:
        """Return what its part beyond a section does to that before it.

        Parameters
        ----------
        x, u, a : ndarray, shape (n_batch, n)
            Coordinates, rates and accelerations.
        places : ndarray, shape (n_places,)
            Distances from the root [m]; what acts there itself is before the section, at the tip beyond it.

        Returns
        -------
        ndarray, shape (n_batch, n_places, 6)
            Axial force, shear along y and z [N], torsion, bending about y and z [N m], in section axes; in
            the plane those of x, y and about z.

        Raises
        ------
        NotImplementedError
            If its model has no strains.
        """
        raise NotImplementedError

    @property
    def coordinates(self) -> str:
        """What its coordinates are, in a word: with the same word, bodies go on from each other's state."""
        return type(self).__name__

    def deformation(self, x: Array, u: Array) -> Deformation | None:
        """Return how it is deformed in states (n_batch, n); None where its coordinates do not say."""
        return None

    def statics(self, x: Array, u: Array, ax: Array, loads: Iterable[Load]) -> Deformation:
        """Return how it would be deformed, at rest, by all that acts on it.

        Parameters
        ----------
        x, u, ax : ndarray, shape (n_batch, n)
            Coordinates, rates and accelerations.
        loads : iterable of (Marker, ndarray)
            Points at which others act on it, and their forces on its coordinates, (n_batch, n_columns).

        Raises
        ------
        NotImplementedError
            If no deformation is left out of its coordinates.
        """
        raise NotImplementedError

    def deformed(self, pose: Pose, twist: Twist, seen: Deformation) -> tuple[Array, Array]:
        """Return coordinates and rates, (n_columns,), in rigid motion, deformed as in the one state seen.

        Raises
        ------
        NotImplementedError
            If its state has no counterpart of that.
        """
        raise NotImplementedError

    def freedoms(self, x: Array, angle: float = 0.0) -> Array:
        """Return the rates, (n_freedoms, n_columns), of each rigid motion from coordinates (n,) on.

        In the plane at an angle of its frame [rad].
        """
        pose = Pose.planar(self.origin, angle)
        return np.array([self.moving(pose, twist) for twist in Twist.units(self.n_dim)])

    def carried_along(self, twist: Twist) -> tuple[Entries, Array]:
        """Return the rates u = W x + w with which it moves, whatever its shape, in rigid motion of all.

        Here for coordinates that begin with a place and an angle in ground axes and are relative to these
        from there on.

        Parameters
        ----------
        twist : Twist
            Velocity of what is at the origin of the ground, and angular velocity.

        Returns
        -------
        W : Entries
            At the columns of x.
        w : ndarray, shape (n_columns,)
        """
        rates = np.zeros(self.columns.stop - self.columns.start)
        if self.still:
            return NOTHING, rates
        rates[: len(twist.velocity) + 1] = [*twist.velocity, *twist.spin]
        place = self.columns.start + np.arange(len(twist.velocity))
        return Entries.of_block(place, place, twist.turning(np.eye(len(place))).T), rates

    def spun_by_itself(self) -> Entries:
        """Return W of u = W x with which it turns at 1 rad/s about an axis of its own, the same all around.

        Nothing if there is no such axis.
        """
        return NOTHING

    def third_order_inertia(self, x: Array) -> float:
        """Return the largest size of inertia terms of third order, left out or not, over those kept."""
        return 0.0

    @property
    def gives_way_at(self) -> float | None:
        """Stretch below which its force gives way to more compression; None where it never does."""
        return None

    def beyond_mesh(self, t: float, x: Array) -> SolverFailure | None:
        """Return why its elements mean nothing in a state (1, n) at a time [s], if they do not."""
        return None

    def smallest_stretch(self, x: Array) -> Array:
        """Return the smallest stretch along its axis in states (n_batch, n), shape (n_batch,)."""
        return np.ones(len(x))

    # ------------------------------------------------------------------ its share in the equations

    def mass_entries(self) -> Entries:
        """Return the entries of its constant mass matrix, at the columns of x."""
        return NOTHING

    def own_constraints(self) -> Iterator[Constraint]:
        """Yield the equations between its own coordinates."""
        yield from ()

    def ballast(self) -> Entries:
        """Return what its constant mass matrix lacks of one with an inverse, on axes that it keeps itself."""
        return NOTHING

    def tables(self, n: int) -> float:
        """Return the memory of its forces, in a scene of n coordinates, that grows faster than n [byte]."""
        return 0.0

    @property
    def variable_mass(self) -> VariableMass | None:
        """Its mass matrix, where that depends on its coordinates."""
        return None

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield its own forces in a scene of n coordinates: weight, elastic forces, damping."""
        yield from ()

    def chart(self) -> Chart | None:
        """Return the map from the coordinates it is stepped in, where they are not x."""
        return None

    def increments(self) -> BodyIncrements | None:
        """Return coordinates for Newton corrections, where its own do not serve."""
        return None

    def carried(self) -> Carried | None:
        """Return which of its vectors Newton corrections see from axes that it carries along."""
        return None


class VectorBody(Body):
    """A body whose coordinates are vectors: positions, that of its origin first, and directions."""

    @property
    def undeformed(self) -> Array:
        """The vectors in the body frame, shape (n_vectors, n_dim)."""
        raise NotImplementedError

    @property
    def positions(self) -> Array:
        """One for vectors that are positions, zero for directions, shape (n_vectors,)."""
        raise NotImplementedError

    @property
    def position_columns(self) -> IntArray:
        """Those of the positions."""
        first = self.columns.start + self.n_dim * np.flatnonzero(self.positions)
        return np.asarray(first[:, None] + np.arange(self.n_dim))

    def placed(self, pose: Pose) -> Array:
        """Return the turned and shifted undeformed vectors."""
        return np.asarray(pose.turned(self.undeformed) + self.positions[:, None] * pose.origin).ravel()

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the rates of these."""
        return self.taken_along(pose, twist, self.undeformed)[1]

    def freedoms(self, x: Array, angle: float = 0.0) -> Array:
        """Return the rates of the body as it is, turning about its origin."""
        vectors, shifts = self.vectors(x), self.positions[:, None]
        arms = vectors - shifts * vectors[0]
        units = Twist.units(self.n_dim)
        return np.array([(unit.turning(arms) + shifts * unit.velocity).ravel() for unit in units])

    def carried_along(self, twist: Twist) -> tuple[Entries, Array]:
        """Return rates that turn all vectors."""
        n_dim, count = len(twist.velocity), len(self.positions)
        spin = twist.turning(np.eye(n_dim)).T
        first = self.columns.start + n_dim * np.arange(count)[:, None, None]
        rows, columns = (
            np.broadcast_to(first + one, (count, n_dim, n_dim)) for one in np.indices(spin.shape)
        )
        values = np.broadcast_to(spin, rows.shape)
        rates = np.outer(self.positions, twist.velocity).ravel()
        return Entries(rows.ravel(), columns.ravel(), values.ravel()), rates

    def mixed(self, to: IntArray, source: IntArray, factors: Array) -> Entries:
        """Return W where rates of some of its vectors are some others with a factor each."""
        own, first = np.arange(self.n_dim), self.columns.start
        rows, columns = (first + self.n_dim * one[:, None] + own for one in (to, source))
        return Entries(rows.ravel(), columns.ravel(), np.repeat(factors, self.n_dim))

    def taken_along(self, pose: Pose, twist: Twist, vectors: Array) -> tuple[Array, Array]:
        """Return coordinates and rates of vectors (n_vectors, n_dim) that keep their places in the frame."""
        turned, shifts = pose.turned(vectors), self.positions[:, None]
        rates = twist.turning(turned) + shifts * twist.velocity
        return (turned + shifts * pose.origin).ravel(), rates.ravel()

    def arms(self, x: Array) -> Array:
        """Return its vectors in states (n_batch, n), positions from that of its origin on."""
        vectors = self.vectors(x)
        return np.asarray(vectors - self.positions[:, None] * vectors[:, :1])

    def resultant(self, x: Array, force: Array) -> tuple[Array, Array]:
        """Return force, (n_batch, n_dim), and moment about its origin, (n_batch, n_spin).

        Of generalised forces (n_batch, n_columns).
        """
        own = force.reshape(len(force), -1, self.n_dim)
        return self.positions @ own, lever(self.arms(x), own).sum(axis=1)

    def vectors(self, x: Array) -> Array:
        """Return its vectors, shape (..., n_vectors, n_dim), in states (..., n)."""
        return x[..., self.columns].reshape(*x.shape[:-1], -1, self.n_dim)
