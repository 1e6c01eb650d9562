"""Properties of beams by the names of their materials and sections, or by their stations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from hfsim.deck.materials import BeamProperties, SectionProperties

if TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong, SectionsAlong


def beam_properties(beam: Any, materials: Mapping[str, Any], sections: Mapping[str, Any]) -> BeamAlong:
    """Return what follows from the material and the section of a `BeamSpec`, or from its stations."""
    of = BeamProperties.of if beam.rotary_inertia else BeamProperties.of_a_line
    found: BeamAlong = _along(beam, of, materials, sections)
    return found


def section_properties(beam: Any, materials: Mapping[str, Any], sections: Mapping[str, Any]) -> SectionsAlong:
    """Return the same in all directions of space."""
    found: SectionsAlong = _along(beam, SectionProperties.of, materials, sections)
    return found


def _along(
    beam: Any, of: Callable[[Any, Any], Any], materials: Mapping[str, Any], sections: Mapping[str, Any]
) -> Any:
    """Return properties of a material and a section each."""
    if beam.stations is None:
        return of(materials.get(beam.material or ""), sections[beam.section])
    from hfsim.deck.stations import Station, Varied

    each = ((at, materials.get(name or ""), sections[one]) for _, at, name, one in beam.made_of)
    return Varied(of, tuple(Station(*one) for one in each))
