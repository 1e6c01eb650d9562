"""Field types of deck entries.

A field type says what a number measures: ``Length`` takes a number in metres or text with a unit of length.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from hfsim.deck.complaints import Complaint, refusal, refused, shown
from hfsim.deck.spec import Before, ReadBy, entry_of
from hfsim.deck.units import RANGES, SI_UNITS, UnitError, describe, parse_quantity

_BOUNDS: dict[str, tuple[Callable[[float, float], bool], str]] = {
    "above": (operator.gt, "greater than"),
    "at_least": (operator.ge, "at least"),
    "below": (operator.lt, "less than"),
    "at_most": (operator.le, "at most"),
}
"""What a number must be."""


def _check(number: float, bounds: Mapping[str, float | None], written: object) -> None:
    """Refuse a number outside; it is shown as it was written."""
    for name, bound in bounds.items():
        holds, words = _BOUNDS[name]
        if bound is not None and not holds(number, bound):
            raise refusal(f"must be {words} {bound:g}, not {shown(written)}")


def _check_range(number: float, dimension: str, above_zero: bool, written: object) -> None:
    """Refuse a number beyond all that is physical."""
    (least, most), unit = RANGES[dimension], SI_UNITS[dimension].strip("-")
    if abs(number) > most:
        words = "must be at most" if number > 0 else "must be at least"
        raise refusal(f"{words} {math.copysign(most, number):g} {unit}".rstrip() + f", not {shown(written)}")
    if above_zero and number < least:
        raise refusal(f"must be at least {least:g} {unit}, not {shown(written)}")


def _read_number(dimension: str, bounds: Mapping[str, float], value: object) -> float:
    """Return a deck's number, or its text with a unit, as a finite SI number."""
    number = value
    if isinstance(value, str):
        try:
            number = parse_quantity(value, dimension)
        except UnitError as error:
            raise refusal(str(error), error.hint) from None
    if isinstance(number, bool) or not isinstance(number, int | float):
        raise refusal(f"must be {describe(dimension)}, not {shown(number)}")
    if not math.isfinite(number):
        raise refusal(f"must be finite, not {number}")
    _check(number, bounds, value)
    _check_range(number, dimension, bounds.get("above") == 0, value)
    return float(number)


def _read_count(bounds: Mapping[str, int | None], value: object) -> int:
    integral = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
    if isinstance(value, bool) or not integral:
        raise refusal(f"must be a whole number, not {shown(value)}")
    count: int = int(value)  # type: ignore[call-overload]
    _check(count, bounds, value)
    return count


def _read_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise refusal(f"must be true or false, not {shown(value)}")
    return value


def measures(dimension: str = "dimensionless", **bounds: float) -> ReadBy:
    """Return what reads a number of a dimension, with its bounds: above, at_least, below, at_most."""
    return ReadBy(partial(_read_number, dimension, bounds), quantity=dimension, **bounds)


def whole(at_least: int = 1, at_most: int | None = None, words: tuple[str, ...] = ()) -> ReadBy:
    """Return what reads a whole number within bounds; words stand for numbers to what reads before it."""
    bounds = {"at_least": at_least, "at_most": at_most}
    return ReadBy(partial(_read_count, bounds), whole=words, **bounds)


Number = Annotated[float, measures()]
Length = Annotated[float, measures("length")]
Angle = Annotated[float, measures("angle")]
Time = Annotated[float, measures("time")]
Force = Annotated[float, measures("force")]
Moment = Annotated[float, measures("moment")]
Velocity = Annotated[float, measures("velocity")]
Acceleration = Annotated[float, measures("acceleration")]

UnitInterval = Annotated[float, measures(at_least=0, at_most=1)]
PositiveLength = Annotated[float, measures("length", above=0)]
NonNegativeLength = Annotated[float, measures("length", at_least=0)]
PositiveTime = Annotated[float, measures("time", above=0)]
NonNegativeTime = Annotated[float, measures("time", at_least=0)]
PositiveFrequency = Annotated[float, measures("frequency", above=0)]
PositiveMass = Annotated[float, measures("mass", above=0)]
PositiveDensity = Annotated[float, measures("density", above=0)]
PositivePressure = Annotated[float, measures("pressure", above=0)]
PositiveArea = Annotated[float, measures("area", above=0)]
PositiveNumber = Annotated[float, measures(above=0)]
PositiveSecondMoment = Annotated[float, measures("second_moment", above=0)]
Stiffness = Annotated[float, measures("stiffness", at_least=0)]
Damping = Annotated[float, measures("damping", at_least=0)]
RotationalStiffness = Annotated[float, measures("rotational_stiffness", at_least=0)]
RotationalDamping = Annotated[float, measures("rotational_damping", at_least=0)]
PositiveStiffness = Annotated[float, measures("stiffness", above=0)]
PositiveRotationalStiffness = Annotated[float, measures("rotational_stiffness", above=0)]
PositiveAngle = Annotated[float, measures("angle", above=0)]
PositiveForce = Annotated[float, measures("force", above=0)]
PositiveMoment = Annotated[float, measures("moment", above=0)]
PositiveVelocity = Annotated[float, measures("velocity", above=0)]
PositiveAngularVelocity = Annotated[float, measures("angular_velocity", above=0)]
Dissipation = Annotated[float, measures("dissipation", at_least=0)]
RotationalDissipation = Annotated[float, measures("rotational_dissipation", at_least=0)]

Count = Annotated[int, whole()]
def _read_flag_or_csv(value: object) -> bool | str:
    if isinstance(value, bool):
        return value
    if value != "csv":
        raise refusal(f"must be true, false or csv, not {shown(value)}")
    return "csv"


FlagOrCsv = Annotated[bool | str, ReadBy(_read_flag_or_csv, enum=[True, False, "csv"])]
Flag = Annotated[bool, ReadBy(_read_flag, type="boolean")]

_MOST_TIMES = 20
"""Times in a list at most: each is a colour in a picture."""
SomeTimes = Annotated[tuple[NonNegativeTime, ...], Field(max_length=_MOST_TIMES)]


def entries(value: object, counts: tuple[int, ...], what: str) -> object:
    """Refuse what is no list of so many."""
    wanted = " or ".join(str(count) for count in counts)
    if not isinstance(value, list | tuple):
        raise refusal(f"must be a list of {wanted} {what}, not {shown(value)}")
    if len(value) not in counts:
        raise refusal(f"must be a list of {wanted} {what}, not of {len(value)}")
    return value


_vector = Before(partial(entries, counts=(2, 3), what="numbers"))

Vector = Annotated[tuple[Number, ...], _vector]
LengthVector = Annotated[tuple[Length, ...], _vector]
VelocityVector = Annotated[tuple[Velocity, ...], _vector]
AccelerationVector = Annotated[tuple[Acceleration, ...], _vector]
ForceVector = Annotated[tuple[Force, ...], _vector]
ForcePerLengthVector = Annotated[tuple[Annotated[float, measures("force_per_length")], ...], _vector]

_triple = Before(partial(entries, counts=(3,), what="numbers"))

SpatialAngle = Annotated[tuple[Angle, ...], _triple]


def _one_or_list(
    counts: tuple[int, ...], dimension: str, bounds: Mapping[str, float], value: object
) -> object:
    """Return a number, or as many as are wanted."""
    read = partial(_read_number, dimension, bounds)
    if not isinstance(value, list | tuple):
        return read(value)
    return tuple(read(one) for one in entries(value, counts, "numbers"))  # type: ignore[attr-defined]


def one_or_list(*counts: int, of: str, **bounds: float) -> ReadBy:
    """Return what reads a number of a dimension, or a list of so many, as `measures` does."""
    return ReadBy(partial(_one_or_list, counts, of, bounds), quantity=of, count=counts, **bounds)


def _read_matrix(counts: tuple[int, ...], dimension: Callable[..., str], value: object) -> object:
    """Return as many rows as a row has numbers, each of a dimension by (count, row, column)."""
    rows, found = entries(value, counts, "rows"), []
    for i, row in enumerate(rows):  # type: ignore[arg-type, var-annotated]
        try:
            numbers = enumerate(entries(row, (len(rows),), "numbers"))  # type: ignore
            found.append(tuple(_read_number(dimension(len(rows), i, j), {}, one) for j, one in numbers))  # type: ignore
        except PydanticCustomError as error:
            raise refused([_complaint_at(i, error)]) from None
    return tuple(found)


def _complaint_at(row: int, error: PydanticCustomError) -> Complaint:
    context = error.context or {}
    return Complaint((row,), str(context["message"]), str(context["hint"]))


def matrix_of(counts: tuple[int, ...], dimension: Callable[..., str]) -> ReadBy:
    """Return what reads a square matrix of so many rows; numbers have dimensions by (count, row, column)."""
    return ReadBy(partial(_read_matrix, counts, dimension), type="array", items={"type": "array"})


def _read_table(dimensions: tuple[str, str], value: object) -> tuple[tuple[float, ...], ...]:
    """Return rows of two numbers each, of which the first increases."""
    if not isinstance(value, list | tuple) or len(value) < _FEWEST_ROWS:
        example = "[[-0.1, -50.0], [0, 0], [0.1, 80.0]]"
        raise refusal("must be a list of rows of two numbers, two rows or more", example)
    rows: list[tuple[float, ...]] = []
    for index, row in enumerate(value):
        try:
            pair = entries(row, (2,), "numbers")
            read = zip(dimensions, pair, strict=True)  # type: ignore[call-overload]
            rows.append(tuple(_read_number(dimension, {}, one) for dimension, one in read))
        except PydanticCustomError as error:
            raise refused([_complaint_at(index, error)]) from None
        if index and rows[-1][0] <= rows[-2][0]:
            message = f"the first numbers must increase, {rows[-1][0]:g} follows {rows[-2][0]:g}"
            raise refused([Complaint((index,), message)])
    return tuple(rows)


_FEWEST_ROWS = 2


def table_of(argument: str, value: str) -> ReadBy:
    """Return what reads a table of numbers of two dimensions, by increasing first ones."""
    return ReadBy(partial(_read_table, (argument, value)), type="array")


def _resisting(rows: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Refuse a table of a damper that would drive: rates and forces of one sign, zero at zero.

    It goes straight on beyond its last rows, where it must not come back to zero.
    """
    if (0.0, 0.0) not in rows:
        raise refusal("a damper has no force at rest", "a row [0, 0] must be there")
    for k, (rate, force) in enumerate(rows):
        if rate * force < 0.0:
            message = f"{force:g} at the rate {rate:g} would drive, and a damper resists"
            raise refused([Complaint((k,), message, "rate and force of one sign")])
    for k, inner in ((0, 1), (len(rows) - 1, len(rows) - 2)):
        if rows[k][0] and abs(rows[k][1]) < abs(rows[inner][1]):
            message = "the force falls at the end of the table, and would drive beyond it"
            raise refused([Complaint((k,), message, "a last row with a force that is not smaller")])
    return rows


def damping_table_of(rate: str, force: str) -> tuple[Any, ...]:
    """Return what reads the table of a damper, rates and forces of two dimensions."""
    return table_of(rate, force), AfterValidator(_resisting)


def _read_inertia(value: object) -> object:
    """Return a moment of inertia, three, or a matrix of rows."""
    read = partial(_read_number, "inertia", {})
    if not isinstance(value, list | tuple):
        return _read_number("inertia", {"above": 0.0}, value)
    rows = entries(value, (3,), "numbers (principal moments) or rows (the matrix)")
    if any(isinstance(row, list | tuple) for row in rows):  # type: ignore[attr-defined]
        return tuple(tuple(map(read, entries(row, (3,), "numbers"))) for row in rows)  # type: ignore
    return tuple(_read_number("inertia", {"at_least": 0.0}, one) for one in rows)  # type: ignore


def flat(values: Iterable[object]) -> Iterator[float]:
    """Yield the numbers of a vector or of the rows of a matrix."""
    for value in values:
        yield from value if isinstance(value, tuple) else (float(value),)  # type: ignore[arg-type]


Inertia = Annotated[Any, ReadBy(_read_inertia, quantity="inertia", count=(3,), rows=(3,))]
"""A number, three of them, or three rows of three [kg m^2]."""

Spin = Annotated[float | tuple[float, ...], one_or_list(3, of="angular_velocity")]
Torque = Annotated[float | tuple[float, ...], one_or_list(3, of="moment")]


_SHORTEST_AXIS = 1e-12


def shortest(axis: tuple[float, ...], noun: str = "an axis") -> tuple[float, ...]:
    """Refuse a direction without one."""
    if max(map(abs, axis)) < _SHORTEST_AXIS:
        example = ", ".join(["1", *"0" * (len(axis) - 1)])
        raise refusal(f"{noun} cannot be zero", f"give a direction such as [{example}]")
    return axis


Axis = Annotated[Vector, AfterValidator(shortest)]

Between = Annotated[tuple[str, str], Before(partial(entries, counts=(2,), what="points"))]
"""The two points that a joint or a spring connects."""


LONGEST_NAME = 100
"""Characters of a name; a deck's becomes that of a folder."""


def _read_name(value: object) -> str:
    name = read_text(value)
    if name == "ground":
        raise refusal("'ground' is the name of the scene's ground", "choose another name")
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", name) or len(name) > LONGEST_NAME:
        hint = f"letters, digits, '_' and '-', not starting with a digit, at most {LONGEST_NAME} characters"
        raise refusal(f"{shown(name)} cannot be a name", hint)
    return name


def read_text(value: object) -> str:
    """Return a deck's text."""
    if not isinstance(value, str):
        raise refusal(f"must be text, not {shown(value)}")
    return value


Name = Annotated[str, ReadBy(_read_name, type="string")]


def within(number: float, ends: tuple[float, float]) -> bool:
    """Tell whether a number is not outside two others."""
    return ends[0] <= number <= ends[1]


_ALIKE = 1e-9
"""Difference of numbers, relative to the larger, that counts as none."""


def alike(pair: tuple[float, float]) -> bool:
    """Tell whether two numbers are the same."""
    return abs(pair[0] - pair[1]) <= _ALIKE * max(pair)


def _empty_map(value: object) -> object:
    """Take a key without a value as an empty map: all its entries may be commented out."""
    return {} if value is None else value


EmptyAllowed = Before(_empty_map)


class NamesOf:
    """Marks a map with keys of a meaning: names of other maps of the deck, and words."""

    def __init__(self, maps: Sequence[str], *words: str) -> None:
        self.maps, self.words = maps, words


Points = Annotated[dict[Name, LengthVector], EmptyAllowed]

Orientation = Annotated[Any, entry_of("hfsim.deck.orientation.OrientationSpec")]
"""Orientation of a frame in space, in one of four forms."""


def split_point(reference: str) -> tuple[str, str]:
    """Return owner and point of a point's name; an empty point is the owner's origin.

    Examples
    --------
    >>> split_point("b1.tip"), split_point("ground")
    (('b1', 'tip'), ('ground', ''))
    """
    owner, _, point = reference.partition(".")
    return owner, point
