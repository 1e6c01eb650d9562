"""Lines with foreshortening: what beams of the model lowOrder have in common in plane and space."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array, BoolArray, IntArray
from hfsim.maths.differences import FINE, fine_derivative
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import lever
from hfsim.maths.shapes import gauss_legendre, piecewise, shares_beyond
from hfsim.mechanics.body import Place
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.parts.bodies.balance import MeshedBeam, Pair
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.shortening import Shortening

NEARLY_SINGULAR = 0.2
"""Smallest eigenvalue of the mass matrix, relative to the undeformed scene's, below which a failure is put
down to it."""

FACTORS = 350.0
"""Full matrices that factors of derivatives by differences take: measured, 98 to 354 with 264 to 780 rows."""


class Fields(NamedTuple):
    """Values at the quadrature points, (n_batch, n_points).

    Attributes
    ----------
    v, bent : ndarray
        Deflection and H v, the latter (n_batch, n_elements, P + 1, k), see `Shortening`; in space both have
        an axis of length two, for the deflections, after the first one.
    short : ndarray
        Foreshortening 1/2 v^T H v [m].
    """

    w: Array
    v: Array
    bent: Array
    short: Array


@frozen
class ForeshortenedBeam(ForcePart):
    """A beam whose mass matrix depends on its deflections v by H(x) = int_0^x N'^T N'.

    Attributes
    ----------
    mesh : BeamMesh
        Of cable elements.
    columns : slice
        Where its coordinates stand.
    gravity : tuple of float
        [m/s^2].
    whole : bool
        Keep the terms of third and fourth order too.
    """

    name: str
    mesh: BeamMesh
    columns: slice
    gravity: tuple[float, ...]
    whole: bool
    model: ClassVar[str] = "lowOrder"
    told: ClassVar[str] = "its inertia and weight, with the shortening by deflection"
    why: ClassVar[str] = "beams deform"
    uses_rates: ClassVar[bool] = True
    """Its inertia force is counted among the forces."""

    @property
    def inner(self) -> int:
        """Where the coordinates begin that the root holds."""
        raise NotImplementedError

    @property
    def truncated(self) -> bool:
        """Whether terms of the inertia force are left out, so that it may feed energy."""
        return not self.whole

    def breakdown(self, t: float, inertia: float, straight: float) -> SolverFailure | None:
        """Return the failure of a mass matrix that has become nearly singular."""
        if inertia > NEARLY_SINGULAR * straight:
            return None
        return SolverFailure(
            reason=f"the mass matrix of body '{self.name}' in model {self.model} stops being positive "
            f"definite at t = {t:.4g} s",
            cause="the terms the model leaves out are no longer small",
            time=t,
            item=self.item,
            kind="model",
            evidence={"smallest_eigenvalue": inertia},
        )

    @property
    def support(self) -> IntArray:
        """All coordinates of the beam."""
        return np.arange(self.columns.start, self.columns.stop)

    @property
    def lengths(self) -> BoolArray:
        """Which of its coordinates are lengths, not angles or slopes, shape (n_columns,)."""
        raise NotImplementedError

    def slopes(self, values: Callable[[Array], Array], at: Array, columns: IntArray) -> Entries:
        """Return the derivative of forces (n_batch, k) by as many of its coordinates, in one state.

        By differences, in which lengths change by that of the beam as angles and slopes do by one.
        """
        units = np.where(self.lengths, self.mesh.length, 1.0)[columns - self.columns.start]
        return Entries.of_block(columns, columns, fine_derivative(values, at[0], columns, FINE * units))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state, by differences."""
        return self.slopes(lambda moved: self._own_resistance(t, moved, u), x, self.support)

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state: it is of second order in that."""
        return self.slopes(lambda moved: self._own_resistance(t, x, moved), u, self.support)

    def _own_resistance(self, t: Array, x: Array, u: Array) -> Array:
        return self._resistance(t, x, u)[:, self.columns]

    def inertia_slopes(self, x: Array, a: Array) -> Entries:
        """Return the derivative of M(x) a by x in one state, for accelerations (1, n)."""
        rates = a[:, None, self.columns]

        def momenta(moved: Array) -> Array:
            return self.momenta(moved, np.repeat(rates, len(moved), axis=0))[:, 0]

        return self.slopes(momenta, x, self.support)

    @cached_property
    def n_w(self) -> int:
        """Number of axial coordinates."""
        return self.mesh.n_vectors - 1

    @cached_property
    def n_v(self) -> int:
        """Number of coordinates of one deflection."""
        return self.mesh.n_vectors - 2

    @cached_property
    def n_points(self) -> int:
        """Number of quadrature points: what integrates the terms of highest degree (H H) exactly."""
        return len(self._rule[0]) * self.mesh.count

    @property
    def gauss(self) -> tuple[Array, Array]:
        """Places and weights of those of a piece, in the unit interval."""
        return gauss_legendre(2 * self.mesh.element.degree)

    @property
    def _cuts(self) -> tuple[float, ...]:
        """Where pieces of an element end at stations inside it, in the unit interval."""
        return self.mesh.properties.cuts(self.mesh.count)

    @property
    def pieces(self) -> Array:
        """Where all pieces begin, and the last one ends [m]."""
        starts = np.arange(self.mesh.count)[:, None] + np.array([0.0, *self._cuts])
        return self.mesh.element.length * np.append(starts.ravel(), self.mesh.count)

    @cached_property
    def _rule(self) -> tuple[Array, Array]:
        """Places and weights in the unit interval of an element, piece by piece."""
        return piecewise(self.gauss, self._cuts)

    @cached_property
    def shortening(self) -> Shortening:
        """Sums over its quadrature points."""
        return Shortening(self.mesh, *self._rule, len(self.gravity) - 1)

    @cached_property
    def points(self) -> tuple[Array, Array]:
        """Places of the quadrature points along the beam, and their masses.

        Twice the degree of the shapes is the number of points an element that integrates the terms of
        highest degree (H H, degree 10 with cubics) exactly.
        """
        x = (np.arange(self.mesh.count)[:, None] + self._rule[0]).ravel() * self.mesh.element.length
        return x, self.shortening.mass.ravel()

    def mass(self, x: Array) -> Array:
        """Return the mass matrix (10)-(12) kept as eq. (46) says, shape (n_batch, n, n)."""
        n = self.columns.stop - self.columns.start
        return self.momenta(x, np.broadcast_to(np.eye(n), (len(x), n, n)))

    def momenta(self, x: Array, rates: Array) -> Array:
        """Return the mass matrix times rates, (n_batch, m, n)."""
        raise NotImplementedError

    def _fields(self, x: Array) -> Fields:
        """Return the values at the quadrature points."""
        raise NotImplementedError

    def third_order_inertia(self, x: Array) -> float:
        """Return the largest part of the moment of inertia that eq. (46) leaves out, over the part kept."""
        place, m = self.points
        return float(np.abs(self._third_order(self._fields(x)) @ m).max(initial=0.0) / (place**2 @ m))

    def _axial(self, f: Fields) -> Array:
        return np.asarray(self.points[0] + f.w - f.short)

    def _left_out(self, f: Fields) -> Array:
        """Return what eq. (46) leaves out of the square of the axial place, the w v^2 and v^4 parts."""
        return np.zeros_like(f.w) if self.whole else self._third_order(f)

    def _third_order(self, f: Fields) -> Array:
        return np.asarray(2.0 * f.w * f.short - f.short**2)

    def foreshortening(self, x: float) -> Array:
        """Return H(x) = int_0^x N_v'^T N_v', shape (n_v, n_v) [1/m]."""
        place = x / self.mesh.element.length
        whole = min(int(place), self.mesh.count - 1)
        own = self.mesh.spans[: whole + 1]
        parts = np.repeat(self.shortening.bending(1.0)[None], whole + 1, axis=0)
        parts[whole] = self.shortening.bending(min(1.0, place - whole))
        H = np.zeros((self.mesh.n_vectors,) * 2)
        np.add.at(H, (own[:, :, None], own[:, None, :]), parts)
        return H[2:, 2:]

    def factors(self, n: int) -> float:
        """Return its share in the memory that factors take in a scene of n coordinates [B]."""
        return float(8.0 * FACTORS * n * (self.columns.stop - self.columns.start))


@frozen
class ForeshortenedMarker(Marker):
    """A point of the centre line of a beam with foreshortening."""

    beam: ForeshortenedBeam
    place: float
    linear_turn: ClassVar[bool] = False
    linear: ClassVar[bool] = False
    """The place is foreshortened."""

    @property
    def columns(self) -> slice:  # type: ignore[override]
        """Coordinates of the beam."""
        return self.beam.columns

    @property
    def support(self) -> IntArray:
        """All of them, but of the root its own."""
        own = self.columns
        return np.arange(own.start, own.start + self.beam.inner if self.place == 0.0 else own.stop)

    def position_stiffness(self, x: Array, force: Array) -> Entries:
        """Return force . d2r/dx2 in one state, by differences."""
        return self.bent(x, lambda moved: force @ self.position_jacobian(moved))

    def spin_stiffness(self, x: Array, moment: Array) -> Entries:
        """Return the derivative of moment . spin Jacobian by x in one state, by differences."""
        return self.bent(x, lambda moved: moment @ self.spin_jacobian(moved))

    def bent(self, x: Array, pulled: Callable[[Array], Array]) -> Entries:
        """Return the derivative of a force on the beam by x in one state."""
        own = self.support - self.columns.start

        def kept(moved: Array) -> Array:
            return pulled(moved).reshape(len(moved), -1)[:, own]

        return self.beam.slopes(kept, x, self.support)


class ForeshortenedBody(MeshedBeam):
    """A beam of the model lowOrder."""

    banded: ClassVar[bool] = False
    """In a body frame all coordinates are coupled."""

    if TYPE_CHECKING:

        @property
        def variable_mass(self) -> Any:
            """Its inertia and weight, a `ForeshortenedBeam`."""

        def marker(self, place: Place) -> Any:
            """Return the marker of a point of the centre line."""

    def markers(self, places: Iterable[float]) -> list[Any]:
        """Return those of points of the centre line at distances from the root [m]."""
        return [self.marker((float(place),)) for place in places]

    def along(self, marker: Marker) -> float:
        """Return how far from the root the section of one of its points is [m]."""
        assert isinstance(marker, ForeshortenedMarker)
        return marker.place

    def line(self, x: Array, places: Array) -> Array:
        """Return points of its line, (n_batch, n_places, n_dim)."""
        return np.stack([marker.position(x) for marker in self.markers(places)], axis=1)

    def carried_beyond(self, x: Array, u: Array, a: Array, places: Array) -> Pair:
        """Return weight less inertia of its parts beyond places, and their moment about the root."""
        beam: ForeshortenedBeam = self.variable_mass
        first, *markers = self._at_points
        root, masses = first.position(x), beam.points[1]
        shares = shares_beyond(beam.pieces, *beam.gauss, places)
        forces, arms = [], []
        for marker, mass in zip(markers, masses, strict=True):
            moving = (marker.position_jacobian(x) @ a[:, beam.columns, None])[..., 0]
            forces.append(mass * (np.array(beam.gravity) - moving - marker.position_bias(x, u)))
            arms.append(marker.position(x) - root)
        own = np.stack(forces, axis=1)
        return shares @ own, shares @ lever(np.stack(arms, axis=1), own)

    @cached_property
    def _at_points(self) -> list[Any]:
        """Markers of its root and of its quadrature points."""
        return self.markers([0.0, *self.variable_mass.points[0]])

    def third_order_inertia(self, x: Array) -> float:
        """Return that of the beam."""
        return float(self.variable_mass.third_order_inertia(x))

    def tables(self, n: int) -> float:
        """Return its share in the factors of derivatives by differences."""
        return float(self.variable_mass.factors(n))
