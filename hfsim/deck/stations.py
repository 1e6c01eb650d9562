"""Beams whose section or material changes along them: stations, and the properties between these."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import UnitInterval
from hfsim.deck.materials import BeamProperties, MaterialSpec, SectionProperties
from hfsim.deck.section_shapes import CircleSection
from hfsim.deck.spec import Spec
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen

_SIDE = 1e-6
"""How far towards the middle of an element its ends are seen, of the way there: so steps have sides."""
_MOST_PARTS = 1000
"""Most equal elements that are proposed so that steps are at nodes."""
_ROUNDING = 1e-9
"""Distance of a step from a node, of the beam's length, that is rounding."""


class StationSpec(Spec):
    """Section and material at a place of a beam."""

    at: UnitInterval
    """Place, as a share of the beam's length from its root [-]; two stations at one place make a step, which
    has to be a node between elements."""

    section: str
    """Name of the section there; between stations of one shape and material dimensions change linearly, else
    stiffness and mass per length do."""

    material: str | None = None
    """Name of the material there; that of the beam without it."""


class Station(NamedTuple):
    """A station with what its names stand for."""

    at: float
    material: MaterialSpec | None
    section: Any


P = TypeVar("P", BeamProperties, SectionProperties, tuple[float, float])
Q = TypeVar("Q", BeamProperties, SectionProperties, tuple[float, float])


@frozen
class Varied(Generic[P]):
    """Properties along a beam: between stations linear in dimensions, or in the properties themselves.

    Dimensions are those of sections of one shape, or given by the same numbers, and of one material.

    Attributes
    ----------
    of : callable
        (material, section) -> properties.
    stations : tuple of Station
        In order, the first at 0 and the last at 1.
    """

    of: Callable[[MaterialSpec | None, Any], P]
    stations: tuple[Station, ...]

    @property
    def damped(self) -> bool:
        """Whether the material loses energy anywhere."""
        each: list[Any] = self._each
        return any(bool(one.axial_damping or one.bending_damping) for one in each)

    def seen_as(self, other: Callable[[P], Q]) -> Varied[Q]:
        """Return other properties, which follow from these station by station."""
        return Varied(lambda material, section: other(self.of(material, section)), self.stations)

    def at(self, shares: Array, inside: Array | None = None) -> P:
        """Return the properties at shares of the length, each an array of their shape.

        Parameters
        ----------
        shares : ndarray
        inside : ndarray, optional
            Places on that side of each which counts where there is a step; the side of the tip without it.
        """
        toward = shares + _SIDE * ((shares + 1e-3 if inside is None else inside) - shares)
        places = np.array([one.at for one in self.stations])
        parts = np.clip(np.searchsorted(places, toward, side="right") - 1, 0, len(places) - 2)
        share = np.clip((shares - places[parts]) / (places[parts + 1] - places[parts]), 0.0, 1.0)
        pairs = zip(parts.ravel().tolist(), share.ravel().tolist(), strict=True)
        return cast(P, _stacked([self._between(k, s) for k, s in pairs], np.shape(shares)))

    def in_elements(self, places: Array, count: int) -> P:
        """Return those at places of the unit interval in each of equal elements, arrays (count, n_places)."""
        first = np.arange(count)[:, None]
        middle = np.broadcast_to(first + 0.5, (count, len(places)))
        return self.at((first + places) / count, middle / count)

    def cuts(self, count: int) -> tuple[float, ...]:
        """Return the places of the unit interval where stations stand inside any of equal elements."""
        places = (one.at * count for one in self.stations)
        return tuple(sorted({at % 1.0 for at in places if abs(at - round(at)) > _ROUNDING * count}))

    @cached_property
    def _each(self) -> list[P]:
        return [self.of(one.material, one.section) for one in self.stations]

    def _between(self, k: int, share: float) -> P:
        """Return the properties at a share of the way from one station to the next."""
        first, second = self.stations[k : k + 2]
        same = first.material is second.material
        if share == 0.0 or (same and first.section is second.section):
            return self._each[k]
        if same and (section := _section_between(first.section, second.section, share)):
            return self.of(first.material, section)
        ends: Any = self._each[k : k + 2]
        mixed = _blended(ends[0], ends[1], share)
        return cast(P, _squared(mixed, ends, share) if isinstance(mixed, BeamProperties) else mixed)


BeamAlong: TypeAlias = BeamProperties | Varied[BeamProperties]
SectionsAlong: TypeAlias = SectionProperties | Varied[SectionProperties]
"""Properties that are the same all along a beam, or not."""


def _section_between(first: Any, second: Any, share: float) -> Any:
    """Return the section with dimensions between those of two; None if these are of different kinds."""
    first, second = _plain(first), _plain(second)
    a, b = _dimensions(first), _dimensions(second)
    if type(first) is not type(second) or {k: np.shape(v) for k, v in a.items()} != {
        k: np.shape(v) for k, v in b.items()
    }:
        return None
    return first.model_copy(update={key: _blended(a[key], b[key], share) for key in a})


def _plain(section: Any) -> Any:
    """Return a section with its dimensions in one form: circles have a radius or a diameter."""
    if isinstance(section, CircleSection):
        return CircleSection.model_construct(shape="circle", radius=section.outer_radius)
    return section


def _dimensions(section: Any) -> dict[str, Any]:
    """Return the numbers that a section is given by."""
    values = {key: getattr(section, key) for key in type(section).model_fields}
    return {key: value for key, value in values.items() if isinstance(value, float | int | tuple)}


def _blended(first: Any, second: Any, share: float) -> Any:
    """Return what lies between numbers, or tuples of them; a property counts where both have it."""
    if first is None or second is None:
        return None
    if isinstance(first, bool):
        return first and second
    if isinstance(first, tuple):
        return _like(first, [_blended(a, b, share) for a, b in zip(first, second, strict=True)])
    return (1.0 - share) * first + share * second


def _squared(mixed: BeamProperties, ends: Sequence[BeamProperties], share: float) -> BeamProperties:
    """Return mixed properties with the rectangle that has their stiffness where the material is as mixed."""
    if not (mixed.lame_mu and mixed.height):
        return mixed
    mu, nu = mixed.lame_mu, 0.5 * mixed.lame_lambda / (mixed.lame_lambda + mixed.lame_mu)
    area = mixed.axial_stiffness / (2.0 * mu * (1.0 + nu))
    first, second = (one.axial_stiffness * one.breadth**2 for one in ends)
    about_y = _blended(first, second, share)
    height = math.sqrt(12.0 * mixed.bending_stiffness / mixed.axial_stiffness)
    breadth = math.sqrt(about_y / mixed.axial_stiffness)
    return mixed._replace(height=height, width=area / height, breadth=breadth)


def _stacked(values: Sequence[Any], shape: tuple[int, ...]) -> Any:
    """Return equal structures of numbers as one, of arrays."""
    if any(one is None for one in values):
        return None
    if isinstance(values[0], tuple):
        return _like(values[0], [_stacked(column, shape) for column in zip(*values, strict=True)])
    return np.array(values).reshape(shape)


def _like(one: Any, entries: list[Any]) -> Any:
    return type(one)(*entries) if hasattr(one, "_fields") else tuple(entries)


def station_complaints(stations: Sequence[StationSpec], elements: int) -> Iterator[Complaint]:
    """Yield stations that do not go from root to tip, or else steps inside one of so many elements."""
    found = list(_order_complaints(stations)) or _step_complaints(stations, elements)
    yield from (one.inside("stations") for one in found)


def _order_complaints(stations: Sequence[StationSpec]) -> Iterator[Complaint]:
    """Yield stations that do not go from root to tip, and third ones at a place."""
    if len(stations) < 2:
        yield Complaint((), "a beam has two stations or more: at its root, at 0, and at its tip, at 1")
        return
    places, last = [one.at for one in stations], len(stations) - 1
    for index, place in ((0, 0.0), (last, 1.0)):
        if places[index] != place:
            which = "first" if index == 0 else "last"
            message = f"the {which} station stands at {place:g}, not at {places[index]:g}"
            yield Complaint((index, "at"), message, "places are shares of the beam's length")
    for index, (before, place) in enumerate(pairwise(places), 1):
        if place < before:
            yield Complaint((index, "at"), f"{place:g} stands before {before:g}", "in order from root to tip")
        elif place == before and place in (places[0], places[-1]):
            yield Complaint((index, "at"), "a step at an end of the beam changes nothing", "leave it out")
        elif index > 1 and place == places[index - 2]:
            yield Complaint((index, "at"), f"a third station at {place:g}", "a step has two stations")


def _steps_of(stations: Sequence[StationSpec]) -> dict[int, float]:
    """Return the places of steps, by the index of the station beyond each."""
    pairs = enumerate(pairwise(stations), 1)
    return {index: beyond.at for index, (before, beyond) in pairs if before.at == beyond.at}


def equal_parts(stations: Sequence[StationSpec]) -> int:
    """Return the fewest equal parts into which a beam is cut so that all steps are nodes."""
    return _parts(_steps_of(stations).values())


def elements_for(places: Sequence[Any], usual: int) -> int:
    """Return a number of elements, a usual one or more, with nodes where a deck has two stations at a place.

    The usual one where that takes too many: what is wrong with the stations is told elsewhere.
    """
    pairs = ((before, beyond) for before, beyond in pairwise(places) if isinstance(beyond, float))
    steps = [beyond for before, beyond in pairs if before == beyond and math.isfinite(beyond)]
    parts = _parts(steps)
    met = all(abs(one * parts - round(one * parts)) <= _ROUNDING * parts for one in steps)
    return -(-usual // parts) * parts if met and parts <= _MOST_PARTS else usual


def _parts(places: Iterable[float]) -> int:
    return math.lcm(1, *(Fraction(one).limit_denominator(_MOST_PARTS).denominator for one in places))


def _step_complaints(stations: Sequence[StationSpec], elements: int) -> Iterator[Complaint]:
    """Yield steps inside an element."""
    for index, place in _steps_of(stations).items():
        nodes = place * elements
        if abs(nodes - round(nodes)) > _ROUNDING * elements:
            parts = equal_parts(stations)
            needed = -(-elements // parts) * parts
            hint = f"elements: {needed}" if parts <= _MOST_PARTS else "elements are equally long"
            message = f"a step at {place:g} is inside one of {elements} elements, and has to be at a node"
            yield Complaint((index, "at"), message, hint)
