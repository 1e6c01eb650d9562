"""Axes of a map: how a number changes a deck.

Every value of an axis is a set of overrides ``KEY=VALUE``, so that each point of a map can be run again by
``hfsim run DECK --set KEY=VALUE ...``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import product
from typing import Any, TypeAlias

from hfsim.deck.ranges import RangeError, Value, read_values, written
from hfsim.deck.source import Setting
from hfsim.errors import ArgumentError
from hfsim.parts.bodies.beam import BeamSpec
from hfsim.scene.loading import LoadedDeck, parse_deck
from hfsim.scene.schema import Deck

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
    return vary_path(path)(values)


def vary_path(path: str, by: str = "--vary") -> Callable[[str], Axis]:
    """Return what reads the axis of one entry of a deck, which is asked for by an option or argument."""
    return partial(_varied, path, by)


def _varied(path: str, by: str, values: str) -> Axis:
    numbers, logarithmic, unit = parse_values(values)
    solver = path.startswith("solve.") and path not in ("solve.duration", "solve.model")
    with_unit = f" {unit}" if unit else ""  # which the deck checks

    def overrides(deck: Deck, value: Value) -> tuple[str, ...]:
        return (Setting.by(by, f"{path}={written(value)}{with_unit}"),)

    return Axis(path, numbers, overrides, solver, logarithmic, unit)


_Changes: TypeAlias = Callable[[Deck, float], Iterator[tuple[str, object]]]
"""(deck, value) -> entries of the deck and what each becomes."""


def _named(name: str, changes: _Changes) -> Callable[[str], Axis]:
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


def _scaled(**fields: tuple[str, ...]) -> _Changes:
    """Return changes that multiply those of the given keys, by part of the deck, which entries have."""

    def changes(deck: Deck, factor: float) -> Iterator[tuple[str, object]]:
        for part, keys in fields.items():
            for (name, entry), key in product(getattr(deck, part).items(), keys):
                value: Any = reduce(lambda at, step: getattr(at, step, None), key.split("."), entry)
                if value is not None:
                    new = [factor * v for v in value] if isinstance(value, tuple) else factor * value
                    yield f"{part}.{name}.{key}", new

    return changes


def _slenderness(deck: Deck, ratio: float) -> Iterator[tuple[str, object]]:
    """Give each beam a section of its own, alike in shape, whose height is its length over `ratio`."""
    for name, body in deck.bodies.items():
        if not isinstance(body, BeamSpec) or body.section is None:
            continue
        section = deck.sections[body.section]
        k = body.length / ratio / section.height
        own = {"area": section.area * k**2, "second_moment": section.bending[1] * k**4}
        yield f"sections.{body.section}_of_{name}", own
        yield f"bodies.{name}.section", f"{body.section}_of_{name}"


def _step(deck: Deck, step: float) -> Iterator[tuple[str, object]]:
    yield "solve.step", step


def _elements(deck: Deck, count: float) -> Iterator[tuple[str, object]]:
    for name, body in deck.bodies.items():
        if isinstance(body, BeamSpec):
            yield f"bodies.{name}.elements", int(count) if float(count).is_integer() else count


_CHANGES: dict[str, _Changes] = {
    "stiffness": _scaled(materials=("youngs_modulus",), springs=("stiffness", "rotational_stiffness")),
    "speed": _scaled(initial=("angular_velocity", "velocity"), joints=("angle.rate", "position.rate")),
    "amplitude": _scaled(
        initial=("angle",), loads=("force", "moment"), joints=("angle.amplitude", "position.amplitude")
    ),
    "slenderness": _slenderness,
    "step": _step,
    "elements": _elements,
}
NAMED: dict[str, Callable[[str], Axis]] = {name: _named(name, changes) for name, changes in _CHANGES.items()}
"""Axes by name: factors on all moduli and springs, on all speeds, on loads and initial angles; length over
section height of all beams; fixed step [s]; elements of all beams."""


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
