"""Axes of a map: how a number changes a deck.

Every value of an axis is a set of overrides ``KEY=VALUE``, so that each point of a map can be run again by
``hfsim run DECK --set KEY=VALUE ...``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from hfsim.deck.ranges import RangeError, Value, read_values, written
from hfsim.deck.source import Setting
from hfsim.errors import ArgumentError
from hfsim.scene.loading import LoadedDeck, parse_deck
from hfsim.scene.schema import Deck
from hfsim.studies.changes import CHANGES, Changes

_MOST = 1000
"""Values of one axis at most."""


class AxisError(ArgumentError):
    """An axis that cannot be read, or that changes nothing in this deck."""


@dataclass(frozen=True)
class Axis:
    """One direction of a map.

    Attributes
    ----------
    name : str
        Key of the deck, or the name of a scaling.
    overrides : callable
        (deck, value) -> the overrides that this value means for this deck.
    solver_only : bool
        Whether it changes how the scene is solved and not the scene: references are shared along it.
    logarithmic : bool
        Whether its middle is the geometric mean.
    unit : str
        SI unit of its values, as far as they say it or the kind of axis does; ``-`` of factors and counts.
    """

    name: str
    values: tuple[Value, ...]
    overrides: Callable[[Deck, Value], tuple[str, ...]]
    solver_only: bool = False
    logarithmic: bool = False
    unit: str = ""

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers."""
        return all(not isinstance(value, str) for value in self.values)

    def middle(self, a: float, b: float) -> float:
        """Return the value half-way between two.

        Examples
        --------
        >>> Axis("x", (1.0, 100.0), lambda deck, value: (), logarithmic=True).middle(1.0, 100.0)
        10.0
        """
        if self.logarithmic and a > 0.0 and b > 0.0:
            return math.sqrt(a * b)
        return 0.5 * (a + b)

    def at(self, values: Iterable[Value]) -> Axis:
        """Return the axis with other values."""
        return replace(self, values=tuple(values))


def parse_values(text: str, unit: str | None = None) -> tuple[tuple[Value, ...], bool, str]:
    """Return the values that a text means, whether they are spaced logarithmically, and their SI unit.

    Parameters
    ----------
    text : str
        ``log(first, last, count)``, ``lin(first, last, count)`` or values between commas; those with units
        are taken to SI.
    unit : str, optional
        SI unit that values with units must have.

    Raises
    ------
    AxisError
        If it is none of these, or of another unit.

    Examples
    --------
    >>> parse_values("log(1, 100, 3)")
    ((1.0, 10.0, 100.0), True, '')
    >>> parse_values("2 cm, 1 m"), parse_values("gauss,gear")
    (((0.02, 1.0), False, 'm'), (('gauss', 'gear'), False, ''))
    """
    try:
        found = read_values(text, _MOST)
    except RangeError as error:
        raise AxisError(str(error)) from None
    if found.kind:
        raise AxisError(f"'{text}' is random; an axis has values, random ones are for hfsim sweep")
    if unit is not None and found.quantities and found.unit != unit:
        raise AxisError(f"'{text}': values are {f'in {unit}' if unit else 'numbers'}")
    if found.quantities and not found.unit and any(unit != "-" for _, unit in found.quantities.values()):
        raise AxisError(f"'{text}': values of one axis have not several units")
    return tuple(map(found.in_si, found.listed)), found.logarithmic, found.unit


# --- kinds of axes -------------------------------------------------------------------------------


def vary(text: str) -> Axis:
    """Return the axis of ``PATH=VALUES``: any entry of a deck.

    Raises
    ------
    AxisError
        If it cannot be read.
    """
    path, equals, values = text.partition("=")
    path = path.strip()
    if not equals or not path:
        raise AxisError(f"'{text}': write PATH=log(first,last,count), PATH=lin(...) or PATH=a,b,c")
    return varied(path, "--vary", values)


_OTHERWISE = {"solve.model": "models", "solve.method": "methods"}
"""What each point of a map has of its row, by the options and arguments that name the rows."""


def varied(path: str, by: str, values: str) -> Axis:
    """Return the axis of one entry of a deck, which is asked for by an option or argument."""
    if path in _OTHERWISE:
        instead = ("--" if by.startswith("--") else "") + _OTHERWISE[path]
        raise AxisError(f"{path} is no axis: name what to map with {instead}")
    numbers, logarithmic, unit = parse_values(values)
    solver = path.startswith("solve.") and path != "solve.duration"
    with_unit = f" {unit}" if unit else ""  # which the deck checks

    def overrides(deck: Deck, value: Value) -> tuple[str, ...]:
        return (Setting.by(by, f"{path}={written(value)}{with_unit}"),)

    return Axis(path, numbers, overrides, solver, logarithmic, unit)


def _named(name: str, changes: Changes) -> Callable[[str], Axis]:
    unit = "s" if name == "step" else ""

    def read(text: str) -> Axis:
        values, logarithmic, _ = parse_values(text, unit)

        def overrides(deck: Deck, value: Value) -> tuple[str, ...]:
            assert not isinstance(value, str)
            return tuple(f"{path}={json.dumps(new)}" for path, new in changes(deck, value))

        axis = Axis(name, values, overrides, name == "step", logarithmic, unit or "-")
        if not axis.numeric or min(v for v in values if not isinstance(v, str)) <= 0.0:
            raise AxisError(f"'{text}': values of {name} are positive numbers")
        return axis

    return read


NAMED: dict[str, Callable[[str], Axis]] = {name: _named(name, changes) for name, changes in CHANGES.items()}
"""Axes by name."""


def point_overrides(loaded: LoadedDeck, axes: Sequence[Axis], values: Sequence[Value]) -> tuple[str, ...]:
    """Return the overrides of one point, the deck's own first; each axis sees what those before it did.

    Raises
    ------
    AxisError
        If an axis changes nothing in this deck.
    DeckError
        If the deck cannot be read with these values.
    """
    overrides, deck = loaded.overrides, loaded.deck
    for axis, value in zip(axes, values, strict=True):
        changes = axis.overrides(deck, value)
        if not changes:
            raise AxisError(f"{axis.name}: there is nothing in {deck.name} that it changes")
        overrides = (*overrides, *changes)
        deck = parse_deck(loaded.source.text, loaded.source.file, overrides).deck
    return overrides
