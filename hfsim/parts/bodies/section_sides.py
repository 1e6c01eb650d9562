"""Rectangles that stand for the sections of a beam: how high and wide they are along it, what is outside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.sections import equivalent_side
from hfsim.deck.spec import Around
from hfsim.maths.arrays import Array

if TYPE_CHECKING:
    from hfsim.deck.materials import ShapedSection


def _sides(section: ShapedSection) -> tuple[float, float]:
    """Return height and width of the rectangle with a section's second moments [m]."""
    return section.height, equivalent_side(section.bending[0], section.area)


def _along(stations: Sequence[tuple[float, Any]], shares: Array) -> tuple[Array, Array]:
    """Return height and width [m] at shares of the length; where there is a step, the larger ones."""
    if len(stations) == 1:
        height, width = _sides(stations[0][1])
        return np.full(shares.shape, height), np.full(shares.shape, width)
    from hfsim.deck.stations import Station, Varied

    own = Varied(lambda _, section: _sides(section), tuple(Station(at, None, one) for at, one in stations))
    before, beyond = (own.at(shares, np.full(shares.shape, side)) for side in (0.0, 1.0))
    return np.maximum(before[0], beyond[0]), np.maximum(before[1], beyond[1])


def side_complaints(beam: Any, around: Around) -> Iterator[Complaint]:
    """Yield points of a `BeamSpec` outside its sections, and a line that is bent too much, of `continuum`."""
    named = [(at, around.sections.get(name)) for _, at, _, name in beam.made_of]
    stations = [(at, section) for at, section in named if section is not None and not section.stiff]
    curved = around.n_dim == 3 and (beam.axis or beam.twist)
    if len(stations) == len(named):
        yield from _outside(beam, stations)
        if curved:
            yield from _crossing(beam, stations)
    if curved and beam.elements < (needed := beam.fewest_elements):
        message = f"{beam.elements} elements do not follow the axis: a quarter turn each at most"
        yield Complaint(("elements",), message, f"{needed} or more", True)


def _outside(beam: Any, stations: Sequence[tuple[float, Any]]) -> Iterator[Complaint]:
    """Yield points outside the section's rectangle."""
    for name, place in beam.points.items():
        own = beam.in_sections(place)
        sides = zip(_along(stations, np.array(place[:1]) / beam.length), ("high", "wide"), strict=True)
        for axis, at, ((side,), word) in zip("yz", own[1:], sides, strict=False):
            if abs(at) > side / 2:
                seen = " in its own axes" if own is not place else ""
                message = f"{axis} = {at:.6g} m{seen} is outside the section, {side:.3g} m {word}"
                yield Complaint(("points", name), message)


def _crossing(beam: Any, stations: Sequence[tuple[float, Any]]) -> Iterator[Complaint]:
    """Yield a line whose sections cut one another."""
    from hfsim.parts.bodies.beam_axis import Axis

    axis = Axis.of(beam)
    steepness = axis.steepness(*_along(stations, axis.parts))
    if steepness >= 1.0:
        message = f"sections cut one another: they reach {steepness:.3g} radii of the line from it"
        yield Complaint(("axis",), message, "a larger radius, or a thinner section")
