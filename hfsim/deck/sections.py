"""Cross-sections by shape, by numbers or by stiffness, and what follows from each of their shapes alone.

In space a section lies in the y and z axes of its beam: bending in the plane of x and y goes with
I_z = int y^2 dA, the second moment of planar scenes.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Protocol

from pydantic import BeforeValidator

from hfsim.deck.fields import (
    NonNegativeLength,
    PositiveArea,
    PositiveLength,
    PositiveNumber,
    PositiveSecondMoment,
    entries,
    measures,
    within,
)
from hfsim.deck.spec import Around, Complaint, OneOf, Spec

_USUAL = (1e-5, 1e5)
"""Height over width of sections that are built [-]."""
_LIKELY = (1e-2, 1e2)
"""Height over width that a corrected unit must lead to [-]."""
SHEAR_FACTOR = 5.0 / 6.0
"""Of a rectangle, and of sections that state none: shear stress over the height is a parabola."""
_ALIKE = 1e-9
"""Difference of numbers, relative to the larger, that counts as none."""

Moments = tuple[float, float]
"""Two numbers: of bending about the section's y axis, and about z; or along y, and along z."""
_pair = BeforeValidator(lambda value: entries(value, (2,), "numbers"))


def alike(pair: Moments) -> bool:
    """Tell whether two numbers are the same."""
    return abs(pair[0] - pair[1]) <= _ALIKE * max(pair)


def equivalent_side(second_moment: float, area: float) -> float:
    """Return the side [m] along which a rectangle with an area has a second moment: sqrt(12 I / A)."""
    return math.sqrt(12 * second_moment / area)


class Fibres(NamedTuple):
    """What normal stresses in a section follow from.

    Attributes
    ----------
    area : float
        [m^2].
    moduli : tuple of float
        Section moduli: second moment over largest distance, about y and about z [m^3].
    round : bool
        Whether bending about both axes adds up as a vector, not in a corner.
    """

    area: float
    moduli: Moments
    round: bool

    def stress(self, axial: Any, about_y: Any, about_z: Any) -> Any:
        """Return the size of the largest normal stress [Pa] from force [N] and moments [N m]."""
        bent = abs(about_y) / self.moduli[0], abs(about_z) / self.moduli[1]
        largest = (bent[0] ** 2 + bent[1] ** 2) ** 0.5 if self.round else bent[0] + bent[1]
        return abs(axial) / self.area + largest


class _Sized(Protocol):
    @property
    def area(self) -> float: ...

    @property
    def bending(self) -> Moments: ...


class _OfRadius(_Sized, Protocol):
    @property
    def second_moment(self) -> float: ...

    @property
    def outer_radius(self) -> float: ...


class _EquivalentRectangle(Spec):
    """A section seen as the rectangle with its area A and second moment I, sqrt(12 I/A) high."""

    stiff: ClassVar[bool] = False
    """Whether it is given by its stiffness, so that its beam needs no material."""

    @property
    def height(self: _Sized) -> float:
        """Height of the equivalent rectangle, in the bending plane [m]."""
        return equivalent_side(self.bending[1], self.area)

    @property
    def width(self: _Sized) -> float:
        """Width of the equivalent rectangle, across the bending plane [m]."""
        return self.area / equivalent_side(self.bending[1], self.area)


class _Round(_EquivalentRectangle):
    """A section that is the same in all directions."""

    @property
    def second_moment(self) -> float:
        """Second moment of area about each diameter [m^4]."""
        raise NotImplementedError

    @property
    def bending(self) -> Moments:
        """I_y and I_z [m^4]."""
        return self.second_moment, self.second_moment

    @property
    def torsion(self) -> float:
        """Torsion constant, the polar moment [m^4]."""
        return 2.0 * self.second_moment

    @property
    def hollow(self) -> float:
        """Inner over outer radius [-]."""
        return 0.0

    @property
    def fibres(self: _OfRadius) -> Fibres:
        """What normal stresses follow from."""
        modulus = self.second_moment / self.outer_radius
        return Fibres(self.area, (modulus, modulus), True)

    def shear(self, poisson_ratio: float) -> Moments:
        """Return the shear factors along y and z (Cowper, J. Appl. Mech. 33, 1966)."""
        nu, m = poisson_ratio, self.hollow**2
        ring = (1.0 + m) ** 2
        k = 6.0 * (1.0 + nu) * ring / ((7.0 + 6.0 * nu) * ring + (20.0 + 12.0 * nu) * m)
        return k, k


class GeneralSection(_EquivalentRectangle):
    """Cross-section given by its area and second moment, in space by both of them."""

    spatial = ("second_moments", "torsion_constant", "shear_factors")

    area: PositiveArea
    """Area [m^2]."""

    second_moment: PositiveSecondMoment | None = None
    """Second moment of area about the axis across the bending plane; in space about every axis [m^4]."""

    second_moments: Annotated[tuple[PositiveSecondMoment, ...], _pair] | None = None
    """In space: about the section's y axis and about its z axis [m^4]."""

    torsion_constant: PositiveSecondMoment | None = None
    """In space: torsion constant [m^4]; without it the sum of both second moments, if they are equal."""

    shear_factors: Annotated[tuple[PositiveNumber, ...], _pair] | None = None
    """In space: what of the area bears shear along y and along z [-]; 5/6 without it."""

    @property
    def bending(self) -> Moments:
        """I_y and I_z [m^4]."""
        both = self.second_moments or (self.second_moment, self.second_moment)
        return both[0] or 0.0, both[1] or 0.0

    @property
    def torsion(self) -> float:
        """Torsion constant [m^4]."""
        return self.torsion_constant or sum(self.bending)

    def shear(self, poisson_ratio: float) -> Moments:
        """Return the shear factors along y and z."""
        first, second = self.shear_factors or (SHEAR_FACTOR, SHEAR_FACTOR)
        return first, second

    def complaints(self) -> Iterator[Complaint]:
        """Yield a section without second moments or with too many, or whose torsion nothing tells."""
        if self.second_moment is None and self.second_moments is None:
            message = "Second moment of area about the axis across the bending plane [m^4]"
            yield Complaint(("second_moment",), "missing key", message, True)
        elif self.second_moment is not None and self.second_moments is not None:
            message = "second_moments says this already"
            yield Complaint(("second_moment",), message, "leave one of them out", True)
        elif self.torsion_constant is None and not alike(self.bending):
            message = "missing key: where second moments differ, their sum is not the torsion constant"
            yield Complaint(("torsion_constant",), message, "Torsion constant [m^4]", True)

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
    """Rectangular cross-section: height along y, width along z."""

    stiff: ClassVar[bool] = False

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

    @property
    def bending(self) -> Moments:
        """I_y and I_z [m^4]."""
        return self.height * self.width**3 / 12, self.second_moment

    @property
    def fibres(self) -> Fibres:
        """What normal stresses follow from."""
        I_y, I_z = self.bending
        return Fibres(self.area, (2.0 * I_y / self.width, 2.0 * I_z / self.height), False)

    @property
    def torsion(self) -> float:
        """Saint-Venant's torsion constant [m^4]."""
        return rectangle_torsion(self.width, self.height)

    def shear(self, poisson_ratio: float) -> Moments:
        """Return the shear factors along y and z."""
        return SHEAR_FACTOR, SHEAR_FACTOR


class CircleSection(_Round):
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


class TubeSection(_Round):
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

    @property
    def hollow(self) -> float:
        """Inner over outer radius [-]."""
        return self.inner_radius / self.outer_radius


class StiffnessSection(Spec):
    """Cross-section given by its mass and stiffness per length; its beam needs no material."""

    spatial = True
    stiff: ClassVar[bool] = True

    mass_per_length: Annotated[float, measures("mass_per_length", above=0)]
    """Mass per length [kg/m]."""

    rotary_inertia: Annotated[
        tuple[Annotated[float, measures("inertia_per_length", above=0)], ...],
        BeforeValidator(lambda value: entries(value, (3,), "numbers")),
    ]
    """Moments of inertia per length about the beam's axis, the section's y and its z axis [kg m]."""

    axial_stiffness: Annotated[float, measures("force", above=0)]
    """EA [N]."""

    shear_stiffness: Annotated[tuple[Annotated[float, measures("force", above=0)], ...], _pair]
    """k_y G A and k_z G A: shear along y and along z [N]."""

    torsion_stiffness: Annotated[float, measures("flexural_rigidity", above=0)]
    """GJ [N m^2]."""

    bending_stiffness: Annotated[
        tuple[Annotated[float, measures("flexural_rigidity", above=0)], ...], _pair
    ]
    """EI_y and EI_z: bending about y and about z [N m^2]."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield moments of inertia that no plane section has."""
        along, y, z = self.rotary_inertia
        if not alike((along, y + z)):
            message = f"that about the axis is {along:g} kg m, the sum of the others {y + z:g} kg m"
            yield Complaint(("rotary_inertia",), message, "in a plane section they are equal")

    @property
    def bending(self) -> Moments:
        """EI_y and EI_z [N m^2]."""
        return self.bending_stiffness[0], self.bending_stiffness[1]

    @property
    def height(self) -> float:
        """Height of the rectangle with the same stiffness in tension and bending [m]."""
        return math.sqrt(12 * self.bending_stiffness[1] / self.axial_stiffness)


def rectangle_torsion(a: float, b: float) -> float:
    """Return Saint-Venant's torsion constant of a rectangle with sides a and b [m^4].

    J = a b^3 (1/3 - 64 b / (pi^5 a) sum tanh(n pi a / (2 b)) / n^5) over odd n, a the longer side; the part
    of the sum with 1 in the place of tanh is known.

    Examples
    --------
    >>> round(rectangle_torsion(1.0, 1.0), 12)
    0.140577014955
    """
    a, b = max(a, b), min(a, b)
    known = 31.0 / 32.0 * 1.0369277551433699
    beyond = sum((1.0 - math.tanh(0.5 * n * math.pi * a / b)) / n**5 for n in range(1, 25, 2))
    return a * b**3 * (1.0 / 3.0 - 64.0 * b / (math.pi**5 * a) * (known - beyond))


ShapedSection = GeneralSection | RectangleSection | CircleSection | TubeSection
AnySection = ShapedSection | StiffnessSection
_STIFFNESS = ("mass_per_length", *(f"{of}_stiffness" for of in ("axial", "shear", "torsion", "bending")))
SectionSpec = Annotated[
    Any,
    OneOf(
        "shape",
        {"rectangle": RectangleSection, "circle": CircleSection, "tube": TubeSection},
        otherwise=GeneralSection,
        told_by=dict.fromkeys(_STIFFNESS, StiffnessSection),
    ),
]
"""Any cross-section: a shape, area and second moments, or stiffness."""
