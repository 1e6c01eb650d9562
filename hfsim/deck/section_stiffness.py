"""Cross-sections by stiffness."""

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator

from hfsim.deck.fields import alike, entries, measures
from hfsim.deck.sections import PAIR, Moments
from hfsim.deck.spec import Complaint, Spec


class StiffnessSection(Spec):
    """Cross-section given by its mass and stiffness per length; its beam needs no material."""

    spatial = True
    stiff: ClassVar[Literal[True]] = True

    mass_per_length: Annotated[float, measures("mass_per_length", above=0)]
    """Mass per length [kg/m]."""

    rotary_inertia: Annotated[
        tuple[Annotated[float, measures("inertia_per_length", above=0)], ...],
        BeforeValidator(lambda value: entries(value, (3,), "numbers")),
    ]
    """Moments of inertia per length about the beam's axis, the section's y and its z axis [kg m]."""

    axial_stiffness: Annotated[float, measures("force", above=0)]
    """EA [N]."""

    shear_stiffness: Annotated[tuple[Annotated[float, measures("force", above=0)], ...], PAIR]
    """k_y G A and k_z G A: shear along y and along z [N]."""

    torsion_stiffness: Annotated[float, measures("flexural_rigidity", above=0)]
    """GJ [N m^2]."""

    bending_stiffness: Annotated[
        tuple[Annotated[float, measures("flexural_rigidity", above=0)], ...], PAIR
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
