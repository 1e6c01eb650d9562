"""Elastic and damping forces of elements in absolute nodal coordinates."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol

import numpy as np

from hfsim.maths.arrays import Array, slices
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import dot
from hfsim.maths.shapes import gauss_legendre
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.force import ForcePart
from hfsim.parts.elements._base import ElasticLaw, GramLaw, Measures, join_laws
from hfsim.parts.elements.polynomial import gauss_points, gauss_rows

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong

ROLL = 1e-6
"""Curvature times the length of an element [-] from which a line in space is seen to roll."""

_IMAGINARY = 1e-30j
"""Step of derivatives, of which no part that is not of first order is left."""
AT_ONCE = 1024
"""Elements, counted once for each state, whose forces are computed together: what they take stays in the
processor's cache."""


@frozen
class ElasticForce(ForcePart):
    """Elastic force of all elements that share a law, of one or several beams.

    The energy does not change with a rotation, so it is evaluated on absolute nodal vectors; in the
    body frame the same numbers would come out.
    """

    elements: Connectivity
    law: ElasticLaw
    told: ClassVar[str] = "elastic forces, of all elements in one go"
    why: ClassVar[str] = "beams deform"

    @property
    def counts(self) -> dict[str, int | str]:
        """One kernel serves all elements in one call."""
        integrals = getattr(self.law, "integrals", "exact, done beforehand")
        pieces = getattr(self.law, "pieces", "elements")
        return {"kernels": 1, pieces: len(self.elements.columns), "integrals": integrals}

    @property
    def shared(self) -> Hashable:
        """What the law of all elements has in common."""
        return self.law.shared

    def joined(self, other: ElasticForce) -> ElasticForce:
        """Return the force of these elements followed by the other's."""
        return ElasticForce(self.elements.joined(other.elements), join_laws([self.law, other.law]))

    @property
    def quartic(self) -> bool:
        """Return what the law says."""
        return self.law.quartic

    def in_strains(self) -> ElasticForce:
        """Return it with strains of its elements."""
        law = law_in_strains(self.law)
        return self if law is None else StrainForce(self.elements, law, item=self.item)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus the derivative of the strain energy, eq. (24)."""
        elements = self.elements
        parts = slices(len(x), AT_ONCE // len(elements.columns))
        if len(parts) == 1:
            out -= elements.push(self.law.pull(elements.rows(x)), len(x))
            return
        for some in parts:
            out[some] -= elements.push(self.law.pull(elements.rows(x[some])), len(x[some]))

    def strain_energy(self, x: Array) -> Array:
        """Return the strain energy of all elements."""
        return np.asarray(self.law.energy(self.elements.vectors(x)).sum(axis=-1))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return the second derivative of the strain energy in one state."""
        return self.elements.entries(self.law.hessian(self.elements.vectors(x))[0])


class StrainLaw(ElasticLaw, Protocol):
    """An energy that is quadratic in strains e of the difference vectors: 1/2 e . C e."""

    @property
    def stiffness(self) -> Array:
        """C, shape (n_kinds, n_points)."""

    def strains_of(self, v: Array) -> Array:
        """Return e, shape (n_kinds, n_points, n_batch), of `component_rows`."""

    def slopes(self, V: Array) -> Array:
        """Return de/dV, shape (..., n_points, n_kinds, n_vectors * n_dim)."""

    def pull_of(self, v: Array, e: Array) -> Array:
        """Return `pull` with given strains, (n_kinds, n_points, n_batch or 1)."""

    def hessian_of(self, V: Array, e: Array) -> Array:
        """Return `hessian` with given strains, (n_kinds, ..., n_points)."""


@frozen
class StrainForce(ElasticForce):
    """The same where the energy is quadratic in strains; these may be given instead of computed.

    Attributes
    ----------
    given : ndarray, shape (n_batch or 1, n_strains), optional
        Strains to take in place of those of the coordinates.
    """

    law: StrainLaw
    given: Array | None = None

    def in_strains(self) -> StrainForce:
        """Return itself."""
        return self

    def joined(self, other: ElasticForce) -> StrainForce:
        """Return the force of these elements followed by the other's."""
        both = super().joined(other)
        return StrainForce(both.elements, both.law)  # type: ignore[arg-type]

    @property
    def strain_stiffness(self) -> Array:
        """That of all strains, point by point for each kind."""
        return self.law.stiffness.ravel()

    def strain(self, x: Array) -> Array:
        """Return the strains, shape (n_batch, n_strains)."""
        return self.law.strains_of(self.elements.rows(x)).reshape(-1, len(x)).T

    def strain_slopes(self, x: Array) -> Entries:
        """Return their derivative by x in one state."""
        blocks = self.law.slopes(self.elements.vectors(x))[0] @ self.elements.local
        numbers = np.arange(self.law.stiffness.size).reshape(self.law.stiffness.shape).T
        return Entries.of_block(numbers, self.elements.columns, blocks)

    def strained(self, strains: Array) -> StrainForce:
        """Return the force with given strains."""
        return replace(self, given=strains)

    @property
    def _given(self) -> Array:
        """The given strains, shape (n_kinds, n_points, n_batch or 1)."""
        assert self.given is not None
        return self.given.T.reshape(*self.law.stiffness.shape, -1)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus stiffness times strain times the derivative of the strain."""
        if self.given is None:
            super().add_force(t, x, u, out)
        else:
            out -= self.elements.push(self.law.pull_of(self.elements.rows(x), self._given), len(x))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state, as if strains were not given."""
        if self.given is None:
            return super().tangent(t, x, u)
        e = self._given.transpose(0, 2, 1)
        return self.elements.entries(self.law.hessian_of(self.elements.vectors(x), e)[0])


def law_in_strains(law: ElasticLaw) -> StrainLaw | None:
    """Return the same law with strains; None if it has some, or can have none."""
    from hfsim.parts.elements.gram_strains import GramStrainLaw
    from hfsim.parts.elements.point_strains import PointStrainLaw
    from hfsim.parts.elements.points import PointLaw
    from hfsim.parts.elements.quadrature import QuadratureLaw
    from hfsim.parts.elements.quadrature_strains import QuadratureStrainLaw

    if isinstance(law, GramLaw):
        return GramStrainLaw.of(law)
    if isinstance(law, PointLaw):
        return PointStrainLaw.of(law)
    return QuadratureStrainLaw.of(law) if isinstance(law, QuadratureLaw) else None


class MaterialDamping(ForcePart):
    """Base of forces that resist the rates of strains."""

    rule: ClassVar[str] = "damping"
    told: ClassVar[str] = "damping of the material"
    why: ClassVar[str] = "materials have retardation times"
    of_strain_rates: ClassVar[bool] = True
    uses_rates: ClassVar[bool] = True

    @property
    def idle(self) -> bool:
        """Whether there is no damping."""
        return not self.dissipates


@frozen
class KelvinVoigtForce(MaterialDamping):
    """Damping proportional to the rates of axial strain and curvature, of cable elements.

    Dissipated per length: EA tau_a strain'^2 + EI tau_b curvature'^2 with the strain of the energy and the
    curvature (r' x r'')/|r'|^2, whose rates vanish in every rigid motion; that of r'' would not.  In space
    that is the rate of its size: a line without sections does not tell a curvature that turns about it from
    its own roll.  Where there is less than `ROLL` of it, curvature has no direction yet, and all of its rate
    counts.

    Attributes
    ----------
    slope, bend : ndarray, shape (n_points, n_vectors)
        Rows of r' and r'' (times le) at the Gauss points of an element.
    axial, bending : ndarray, shape (n_elements, n_points)
        EA le tau_a w and EI / le tau_b w [J s]; zero at points that are the other's alone.
    engineering : bool
        Strain |r'| - 1 instead of Green's.
    """

    elements: Connectivity
    slope: Array
    bend: Array
    axial: Array
    bending: Array
    engineering: bool = False

    @property
    def counts(self) -> dict[str, int | str]:
        """One kernel serves all elements in one call."""
        elements, points = self.axial.shape
        return {"kernels": 1, "elements": elements, "integrals": f"{points} Gauss points an element"}

    @property
    def dissipates(self) -> bool:
        """Whether there is any damping."""
        return bool(self.axial.any() or self.bending.any())

    @classmethod
    def of(
        cls,
        elements: Connectivity,
        degree: int,
        length: float,
        properties: BeamAlong,
        measures: Measures,
        item: str = "",
    ) -> KelvinVoigtForce:
        """Return the force of elements of a length [m] in a row, with strain and points of their energy."""
        numbers = gauss_points(measures, degree)
        rules = {n: (gauss_legendre(n)[0], *gauss_rows(n, degree)) for n in numbers}
        x, w, slope, bend = (np.concatenate(kind) for kind in zip(*rules.values(), strict=True))
        rule = np.repeat(list(rules), list(rules))
        stretched, bent = (np.where(rule == n, w, 0.0) for n in numbers)
        count = len(elements.columns)
        own = properties.in_elements(x, count)
        axial = own.axial_stiffness * length * own.axial_damping
        bending = own.bending_stiffness / length * own.bending_damping
        return cls(
            elements=elements,
            slope=slope,
            bend=bend,
            axial=np.array(np.broadcast_to(axial * stretched, (count, len(x)))),
            bending=np.array(np.broadcast_to(bending * bent, (count, len(x)))),
            engineering=measures.strain == "engineering",
            item=item,
        )

    def _rates(self, V: Array, dV: Array) -> _Rates:
        s, c = self.slope @ V, self.bend @ V
        ds, dc = self.slope @ dV, self.bend @ dV
        square, strain = dot(s, s), dot(s, ds)
        share = dot(s, c) / square
        size = np.sqrt(square)
        curvature = (c - share * s) / size
        rate = dc - share * ds
        growth = strain / square
        rate = (rate - dot(s, rate) / square * s) / size - growth * curvature
        pulled = growth if self.engineering else strain
        return _Rates(s, share, size, curvature, strain, pulled, self._kept(curvature, rate))

    def _kept(self, curvature: Array, rate: Array) -> Array:
        """Return of vectors across the axis what is along the curvature; in the plane that is all of them."""
        if curvature.shape[-1] == 2:
            return rate
        along = ROLL**2 * rate + dot(curvature, rate) * curvature
        return np.asarray(along / (ROLL**2 + dot(curvature, curvature)))

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the damping force."""
        out -= self.elements.force(self.gradient(self.elements.vectors(x), self.elements.vectors(u)))

    def gradient(self, V: Array, dV: Array) -> Array:
        """Return the work of the damping by the vectors [J], same shape, at vectors and their rates."""
        at = self._rates(V, dV)
        moment = self._kept(at.curvature, self.bending[..., None] * at.rate) / at.size
        tension = self.axial[..., None] * at.pulled - dot(at.curvature, moment) / at.size
        return np.asarray(self.slope.T @ (tension * at.s - at.share * moment) + self.bend.T @ moment)

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state, element by element.

        By imaginary steps, which lose no digits: in a steady rotation it cancels what rates make of turns.
        """
        V, dV = self.elements.vectors(x), self.elements.vectors(u)
        change = self.gradient(V + _IMAGINARY * self._units, dV).imag
        return self.elements.entries(self._blocks(change / _IMAGINARY.imag))

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state: the force is linear in u."""
        return self.elements.entries(self.resistance(self.elements.vectors(x)))

    def resistance(self, V: Array) -> Array:
        """Return the matrices by which it follows from the rates of all vectors of an element, in one state.

        Shape (n_elements, n_vectors * n_dim, n_vectors * n_dim).
        """
        return self._blocks(self.gradient(V, self._units))

    @cached_property
    def _units(self) -> Array:
        """Each component of the difference vectors by itself, in all elements at once, as a batch."""
        count, n_vectors, n_dim = self.elements.shape
        m = n_vectors * n_dim
        units = np.broadcast_to(np.eye(m)[:, None], (m, count, m))
        return units.reshape(m, count, n_vectors, n_dim)

    def _blocks(self, columns: Array) -> Array:
        """Return matrices of elements that are given column by column."""
        m, count = columns.shape[:2]
        return columns.reshape(m, count, m).transpose(1, 2, 0)

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the dissipated power."""
        at = self._rates(self.elements.vectors(x), self.elements.vectors(u))
        lost = self.axial * (at.strain * at.pulled)[..., 0] + self.bending * dot(at.rate, at.rate)[..., 0]
        return np.asarray(-lost.sum(axis=(-1, -2)))


class _Rates(NamedTuple):
    """Of points of elements: r', r'.r''/|r'|^2, |r'|, the curvature as a vector, and rates.

    These are of the Green strain, of the strain that is damped times what that changes by along r', and of
    the curvature.
    """

    s: Array
    share: Array
    size: Array
    curvature: Array
    strain: Array
    pulled: Array
    rate: Array
