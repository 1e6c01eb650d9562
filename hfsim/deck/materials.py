"""Materials, cross-sections and all numbers that follow from them; no other file computes these."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple, Protocol, Self

from hfsim.deck.fields import (
    NonNegativeLength,
    NonNegativeTime,
    PositiveArea,
    PositiveDensity,
    PositiveLength,
    PositivePressure,
    PositiveSecondMoment,
    measures,
    within,
)
from hfsim.deck.spec import Around, Complaint, OneOf, Spec

_PLASTIC_TO_OSMIUM = (0.5, 23.0)
"""Densities of solids [g/cm^3]."""
_MODULI = (0.05, 1200.0)
"""Young's moduli of solids [GPa]."""
_METALS = (5e4, 4.5e5)
"""Young's moduli of metals [MPa]."""
_USUAL = (1e-5, 1e5)
"""Height over width of sections that are built [-]."""
_LIKELY = (1e-2, 1e2)
"""Height over width that a corrected unit must lead to [-]."""


class MaterialSpec(Spec):
    """Isotropic elastic material with damping that grows with the strain rate."""

    density: PositiveDensity
    """Mass density [kg/m^3]."""

    youngs_modulus: PositivePressure
    """Young's modulus [Pa]."""

    poisson_ratio: Annotated[float, measures(above=-1, below=0.5)] = 0.0
    """Poisson's ratio [-]."""

    axial_damping: NonNegativeTime = 0.0
    """Kelvin-Voigt retardation time of the axial strain [s]."""

    bending_damping: NonNegativeTime = 0.0
    """Kelvin-Voigt retardation time of the curvature [s]."""

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield numbers of solids in other units."""
        rho, E = self.density, self.youngs_modulus
        for unit, scale in (("g/cm3", 1.0), ("kg/mm3", 1e-6), ("t/mm3", 1e-9)):
            if within(rho / scale, _PLASTIC_TO_OSMIUM) and rho != 1.0:
                yield Complaint(("density",), f"{rho:g} kg/m^3 is no solid's", f"'{rho:g} {unit}'?")
        if within(E, _MODULI):
            yield Complaint(("youngs_modulus",), f"{E:g} Pa is softer than jelly", f"'{E:g} GPa'?")
        elif within(E, _METALS) and rho >= 2000.0:
            message = f"{E:g} Pa is soft rubber's, and {rho:g} kg/m^3 a metal's"
            yield Complaint(("youngs_modulus",), message, f"'{E:g} MPa'?")
        if self.poisson_ratio < 0.0:
            message = f"{self.poisson_ratio:g}: this material becomes thicker when it is pulled"
            yield Complaint(("poisson_ratio",), message, f"{-self.poisson_ratio:g}?")

    @property
    def lame_lambda(self) -> float:
        r"""First Lame constant [Pa], :math:`E \nu / ((1 + \nu)(1 - 2 \nu))`."""
        nu = self.poisson_ratio
        return self.youngs_modulus * nu / ((1 + nu) * (1 - 2 * nu))

    @property
    def lame_mu(self) -> float:
        r"""Second Lame constant, the shear modulus [Pa], :math:`E / (2 (1 + \nu))`."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))


class _Moments(Protocol):
    @property
    def area(self) -> float: ...

    @property
    def second_moment(self) -> float: ...


class _EquivalentRectangle(Spec):
    """A section seen as the rectangle with its area A and second moment I, sqrt(12 I/A) high."""

    @property
    def height(self: _Moments) -> float:
        """Height of the equivalent rectangle, in the bending plane [m]."""
        return math.sqrt(12 * self.second_moment / self.area)

    @property
    def width(self: _Moments) -> float:
        """Width of the equivalent rectangle, across the bending plane [m]."""
        return self.area / math.sqrt(12 * self.second_moment / self.area)


class GeneralSection(_EquivalentRectangle):
    """Cross-section given by its area and second moment."""

    area: PositiveArea
    """Area [m^2]."""

    second_moment: PositiveSecondMoment
    """Second moment of area about the axis across the bending plane [m^4]."""

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield moments that would be a usual section's if one of them had another unit."""
        height, width = self.height, self.width
        if within(height / width, _USUAL):
            return
        others = {"mm4": 1e-12, "cm4": 1e-8, "mm2": 1e12, "cm2": 1e8}
        for unit in (unit for unit, factor in others.items() if within(height / width * factor, _LIKELY)):
            key, value = ("area", self.area) if unit.endswith("2") else ("second_moment", self.second_moment)
            message = f"the section would be {height:.3g} m high and {width:.3g} m wide"
            yield Complaint((key,), message, f"'{value:g} {unit}'?")


class RectangleSection(Spec):
    """Rectangular cross-section."""

    shape: Literal["rectangle"]
    """Kind of section."""

    width: PositiveLength
    """Side across the bending plane [m]."""

    height: PositiveLength
    """Side in the bending plane [m]."""

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return self.width * self.height

    @property
    def second_moment(self) -> float:
        """Second moment of area, width height^3 / 12 [m^4]."""
        return self.width * self.height**3 / 12


class CircleSection(_EquivalentRectangle):
    """Full circular cross-section."""

    shape: Literal["circle"]
    """Kind of section."""

    radius: PositiveLength | None = None
    """Radius [m]; or give the diameter."""

    diameter: PositiveLength | None = None
    """Diameter [m]; or give the radius."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a circle without a size or with two."""
        if (self.radius is None) == (self.diameter is None):
            yield Complaint((), "a circle needs its radius or its diameter, one of the two")

    @property
    def outer_radius(self) -> float:
        """Radius, however it was given [m]."""
        return self.radius if self.radius is not None else (self.diameter or 0.0) / 2

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return math.pi * self.outer_radius**2

    @property
    def second_moment(self) -> float:
        """Second moment of area, pi r^4 / 4 [m^4]."""
        return math.pi * self.outer_radius**4 / 4


class TubeSection(_EquivalentRectangle):
    """Circular tube."""

    shape: Literal["tube"]
    """Kind of section."""

    outer_radius: PositiveLength
    """Outer radius [m]."""

    inner_radius: NonNegativeLength
    """Inner radius [m]."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a tube without a wall."""
        if self.inner_radius >= self.outer_radius:
            yield Complaint(("inner_radius",), f"must be less than the outer radius {self.outer_radius:g} m")

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return math.pi * (self.outer_radius - self.inner_radius) * (self.outer_radius + self.inner_radius)

    @property
    def second_moment(self) -> float:
        """Second moment of area, pi (R^4 - r^4) / 4 [m^4]."""
        return self.area * (self.outer_radius**2 + self.inner_radius**2) / 4


AnySection = GeneralSection | RectangleSection | CircleSection | TubeSection
SectionSpec = Annotated[
    AnySection,
    OneOf(
        "shape",
        {"rectangle": RectangleSection, "circle": CircleSection, "tube": TubeSection},
        otherwise=GeneralSection,
    ),
]
"""Any cross-section: area and second moment, or a shape; all have area, second_moment, height and width."""


class BeamProperties(NamedTuple):
    """All that follows from a beam's material and section.

    Attributes
    ----------
    mass_per_length : float
        rho A [kg/m].
    rotary_inertia : float
        rho I, per length [kg m].
    axial_stiffness : float
        EA [N].
    bending_stiffness : float
        EI [N m^2].
    axial_damping, bending_damping : float
        Kelvin-Voigt retardation times of strain and curvature [s].
    lame_lambda, lame_mu : float
        Lame constants [Pa].
    height, width : float
        Of the (equivalent) rectangle [m]; the height lies in the bending plane.
    """

    mass_per_length: float = 0.0
    rotary_inertia: float = 0.0
    axial_stiffness: float = 0.0
    bending_stiffness: float = 0.0
    axial_damping: float = 0.0
    bending_damping: float = 0.0
    lame_lambda: float = 0.0
    lame_mu: float = 0.0
    height: float = 0.0
    width: float = 0.0

    @classmethod
    def of(cls, material: MaterialSpec, section: AnySection) -> Self:
        """Return the properties of a beam of a material with a section."""
        return cls(
            mass_per_length=material.density * section.area,
            rotary_inertia=material.density * section.second_moment,
            axial_stiffness=material.youngs_modulus * section.area,
            bending_stiffness=material.youngs_modulus * section.second_moment,
            axial_damping=material.axial_damping,
            bending_damping=material.bending_damping,
            lame_lambda=material.lame_lambda,
            lame_mu=material.lame_mu,
            height=section.height,
            width=section.width,
        )

    @property
    def damped(self) -> bool:
        """Whether the material loses energy."""
        return bool(self.axial_damping or self.bending_damping)
