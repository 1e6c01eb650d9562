"""Cross-sections: the one given by numbers; the others stand in `section_shapes` and `section_stiffness`.

In space a section lies in the y and z axes of its beam: bending in the plane of x and y goes with
I_z = int y^2 dA, the second moment of planar scenes.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Protocol

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import PositiveArea, PositiveNumber, PositiveSecondMoment, alike, entries, within
from hfsim.deck.spec import Around, Before, OneOf, Spec

_USUAL = (1e-5, 1e5)
"""Height over width of sections that are built [-]."""
_LIKELY = (1e-2, 1e2)
"""Height over width that a corrected unit must lead to [-]."""
SHEAR_FACTOR = 5.0 / 6.0
"""Of a rectangle, and of sections that state none: shear stress over the height is a parabola."""
Moments = tuple[float, float]
"""Two numbers: of bending about the section's y axis, and about z; or along y, and along z."""
PAIR = Before(lambda value: entries(value, (2,), "numbers"))


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

    Of several sections these are arrays.
    """

    area: float
    moduli: Moments
    round: bool

    def stress(self, axial: Any, about_y: Any, about_z: Any) -> Any:
        """Return the size of the largest normal stress [Pa] from force [N] and moments [N m]."""
        bent = abs(about_y) / self.moduli[0], abs(about_z) / self.moduli[1]
        round_about = (bent[0] ** 2 + bent[1] ** 2) ** 0.5
        if isinstance(self.round, bool):
            largest = round_about if self.round else bent[0] + bent[1]
        else:
            largest = self.round * round_about + ~self.round * (bent[0] + bent[1])
        return abs(axial) / self.area + largest


class Sized(Protocol):
    """A section with an area and second moments."""

    @property
    def area(self) -> float:
        """Area [m^2]."""

    @property
    def bending(self) -> Moments:
        """I_y and I_z [m^4]."""


class EquivalentRectangle:
    """A section seen as the rectangle with its area A and second moment I, sqrt(12 I/A) high."""

    stiff: ClassVar[Literal[False]] = False
    """Whether it is given by its stiffness, so that its beam needs no material."""

    @property
    def height(self: Sized) -> float:
        """Height of the equivalent rectangle, in the bending plane [m]."""
        return equivalent_side(self.bending[1], self.area)

    @property
    def width(self: Sized) -> float:
        """Width of the equivalent rectangle, across the bending plane [m]."""
        return self.area / equivalent_side(self.bending[1], self.area)


class GeneralSection(EquivalentRectangle, Spec):
    """Cross-section given by its area and second moment, in space by both of them."""

    spatial = ("second_moments", "torsion_constant", "shear_factors")

    area: PositiveArea
    """Area [m^2]."""

    second_moment: PositiveSecondMoment | None = None
    """Second moment of area about the axis across the bending plane; in space about every axis [m^4]."""

    second_moments: Annotated[tuple[PositiveSecondMoment, ...], PAIR] | None = None
    """In space: about the section's y axis and about its z axis [m^4]."""

    torsion_constant: PositiveSecondMoment | None = None
    """In space: torsion constant [m^4]; without it the sum of both second moments, if they are equal."""

    shear_factor: PositiveNumber | None = None
    """What of the area bears shear, in space along both axes [-]; 5/6 without it."""

    shear_factors: Annotated[tuple[PositiveNumber, ...], PAIR] | None = None
    """In space: the same along y and along z [-]."""

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
        first, second = self.shear_factors or (self.shear_factor or SHEAR_FACTOR,) * 2
        return first, second

    def complaints(self) -> Iterator[Complaint]:
        """Yield a section without second moments or with too many, or whose torsion nothing tells."""
        if self.shear_factor is not None and self.shear_factors is not None:
            message = "shear_factors says this already"
            yield Complaint(("shear_factor",), message, "leave one of them out", True)
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


_STIFFNESS = ("mass_per_length", *(f"{of}_stiffness" for of in ("axial", "shear", "torsion", "bending")))
_COUPLED = {"stiffness": "hfsim.deck.section_stiffness.CoupledSection"}
_SHAPES = {one: f"hfsim.deck.section_shapes.{one.title()}Section" for one in ("rectangle", "circle", "tube")}
SectionSpec = Annotated[
    Any,
    OneOf(
        "shape",
        _SHAPES,
        otherwise=GeneralSection,
        told_by=_COUPLED | dict.fromkeys(_STIFFNESS, "hfsim.deck.section_stiffness.StiffnessSection"),
    ),
]
"""Any cross-section: a shape, area and second moments, or stiffness."""
