"""Cross-sections given by their mass and stiffness per length."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from hfsim.deck.fields import measures, one_or_list
from hfsim.deck.reader import Path
from hfsim.deck.sections import Moments
from hfsim.deck.spec import Around, Complaint, Spec

_ROUNDED = 1e-4
"""Part of a moment of inertia that may be the rounding of a printed table."""


class StiffnessSection(Spec):
    """Cross-section given by its mass and stiffness per length; its beam needs no material.

    A number where space has a list stands in space for all that is alike: about, or along, every diameter.
    """

    spatial = ("torsion_stiffness",)
    stiff: ClassVar[Literal[True]] = True

    mass_per_length: Annotated[float, measures("mass_per_length", above=0)]
    """Mass per length [kg/m]."""

    rotary_inertia: Annotated[Any, one_or_list(3, "inertia_per_length", above=0)]
    """Moment of inertia per length about the axis across the plane; in space a list: about the beam's axis,
    the section's y and its z axis [kg m]."""

    axial_stiffness: Annotated[float, measures("force", above=0)]
    """EA [N]."""

    shear_stiffness: Annotated[Any, one_or_list(2, "force", above=0)]
    """k G A; in space a list: of shear along y and along z [N]."""

    torsion_stiffness: Annotated[float, measures("flexural_rigidity", above=0)] | None = None
    """In space: GJ [N m^2]."""

    bending_stiffness: Annotated[Any, one_or_list(2, "flexural_rigidity", above=0)]
    """EI; in space a list: of bending about y and about z [N m^2]."""

    def _lists(self) -> Iterator[str]:
        """Yield the keys whose values are lists."""
        keys = ("rotary_inertia", "shear_stiffness", "bending_stiffness")
        return (key for key in keys if isinstance(getattr(self, key), tuple))

    def spaces(self) -> Iterator[tuple[int, Path]]:
        """Yield that lists, and what the plane has not, make a scene spatial."""
        yield from super().spaces()
        yield from ((3, (key,)) for key in self._lists())

    def complaints(self) -> Iterator[Complaint]:
        """Yield moments of inertia that no plane section has."""
        if not isinstance(self.rotary_inertia, tuple):
            return
        along, y, z = self.rotary_inertia
        if abs(along - (y + z)) > _ROUNDED * along:
            message = f"that about the axis is {along:g} kg m, the sum of the others {y + z:g} kg m"
            yield Complaint(("rotary_inertia",), message, "in a plane section they are equal")

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield lists in the plane, and a missing torsion in space."""
        yield from super().complaints_in(around)
        for key in self._lists() if around.n_dim == 2 else ():
            yield Complaint((key,), "must be one number: this scene is planar")
        if around.n_dim == 3 and self.torsion_stiffness is None:
            yield Complaint(("torsion_stiffness",), "missing key", "GJ [N m^2]", True)

    @property
    def rotary(self) -> Moments:
        """Moments of inertia per length about the section's y and its z axis [kg m]."""
        own = self.rotary_inertia
        return _both(own[1:] if isinstance(own, tuple) else own)

    @property
    def shears(self) -> Moments:
        """k_y G A and k_z G A [N]."""
        return _both(self.shear_stiffness)

    @property
    def bending(self) -> Moments:
        """EI_y and EI_z [N m^2]."""
        return _both(self.bending_stiffness)

    @property
    def height(self) -> float:
        """Height of the rectangle with the same stiffness in tension and bending [m]."""
        return math.sqrt(12 * self.bending[1] / self.axial_stiffness)


def _both(numbers: float | tuple[float, ...]) -> Moments:
    """Return two numbers, or one twice."""
    first, second = numbers if isinstance(numbers, tuple) else (numbers, numbers)
    return first, second
