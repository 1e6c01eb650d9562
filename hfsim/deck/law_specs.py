"""Laws of time as decks state them.

Values of a law are in SI of what it drives, its rates in the same per second: an `AngleLaw` takes "12 deg"
and "120 rpm", a `PositionLaw` "9 mm" and "1 m/s".
"""

import json
import math
import re
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

from pydantic import Field

from hfsim.deck.complaints import Complaint, degrees_as_radians, refusal, refuse_all
from hfsim.deck.fields import (
    Angle,
    NonNegativeTime,
    Number,
    PositiveFrequency,
    PositiveTime,
    Time,
    read_text,
)
from hfsim.deck.law_spec import LawSpec
from hfsim.deck.laws import Law, LinearLaw, SineLaw, SpinUpLaw, StepLaw
from hfsim.deck.reader import Path
from hfsim.deck.spec import Around, Before, OneOf, ReadBy
from hfsim.deck.table_spec import TableSpec
from hfsim.deck.units import UnitError, describe, parse_quantity

if TYPE_CHECKING:
    from hfsim.deck.expression_law import ExpressionLaw
    from hfsim.deck.expressions import Node


class ConstantSpec(LawSpec):
    """The same value at all times; a bare number in a deck means this."""

    value_keys = ("value",)

    type: Literal["constant"]

    value: Number
    """Value [SI of what the law drives]."""

    start: NonNegativeTime | None = None
    """Not for this law: it is the same before and after."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a start, which would change nothing."""
        if self.start is not None:
            why = "a constant is the same before and after"
            yield Complaint(("start",), why, "smooth_step or table can begin later", True)

    @property
    def constant(self) -> float:
        """The value."""
        return self.value

    def unshifted(self) -> Law:
        """Return the law."""
        return LinearLaw(self.value)


class ConstantRateSpec(LawSpec):
    """start + rate t."""

    value_keys = ("start",)
    rate_keys = ("rate",)
    begin_key = "delay"

    type: Literal["constant_rate"]

    rate: Number
    """Rate [SI of what the law drives, per s]."""

    start: Number = 0.0
    """Value at t = 0 [SI of what the law drives]."""

    delay: NonNegativeTime | None = None
    """Time at which it begins [s]; before, it is `start`."""

    @property
    def constant(self) -> float | None:
        """The start, if the rate is zero."""
        return None if self.rate else self.start

    @property
    def begin(self) -> float:
        """Time at which it begins [s]."""
        return self.delay or 0.0

    def unshifted(self) -> Law:
        """Return the law as if it began at 0."""
        return LinearLaw(self.start, self.rate)


class SmoothStepSpec(LawSpec):
    """From one value to another, with continuous acceleration."""

    value_keys = ("from", "to")

    type: Literal["smooth_step"]

    from_: Annotated[Number, Field(alias="from")]
    """Value until the start [SI of what the law drives]."""

    to: Number
    """Value from the end on [SI of what the law drives]."""

    start: Time
    """Time at which the step begins [s]."""

    end: Time
    """Time at which the step ends [s]."""
    kink: ClassVar[str] = ""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a step that ends before it starts."""
        if self.end <= self.start:
            yield Complaint(("end",), f"must be later than the start, {self.start:g} s")

    def build(self) -> Law:
        """Return the law."""
        return StepLaw(self.from_, self.to, self.start, self.end)


class SpinUpSpec(LawSpec):
    """From rest at zero to a constant rate."""

    rate_keys = ("rate",)

    type: Literal["spin_up"]

    rate: Number
    """Rate that is reached [SI of what the law drives, per s]."""

    time: PositiveTime
    """Time in which it is reached [s]."""

    start: NonNegativeTime | None = None
    """Time at which it begins [s]: before, it holds its value at 0; its own times count from there."""

    def unshifted(self) -> Law:
        """Return the law as if it began at 0."""
        return SpinUpLaw(self.rate, self.time)


class SineSpec(LawSpec):
    """offset + amplitude sin(2 pi frequency t + phase)."""

    value_keys = ("amplitude", "offset")

    type: Literal["sine"]

    amplitude: Number
    """Amplitude [SI of what the law drives]."""

    frequency: PositiveFrequency
    """Frequency [Hz]."""

    phase: Angle = 0.0
    """Phase at t = 0 [rad]."""

    offset: Number = 0.0
    """Mean value [SI of what the law drives]."""

    start: NonNegativeTime | None = None
    """Time at which it begins [s]: before, it holds its value at 0; its own times count from there."""

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a phase that looks like degrees."""
        yield from super().slips_in(around)
        yield from degrees_as_radians("phase", self.phase)

    def unshifted(self) -> Law:
        """Return the law as if it began at 0."""
        w = 2 * math.pi * self.frequency
        return SineLaw(self.amplitude, w, self.phase, self.offset)


class ExpressionSpec(LawSpec):
    """An expression of t [s] in SI: numbers with units, parameters, + - * / ** and functions as `sin`."""

    type: Literal["expression"] = "expression"

    expression: Annotated[str, ReadBy(read_text, type="string")]
    """The expression; its value is in SI of what the law drives."""

    start: NonNegativeTime | None = None
    """Time at which it begins [s]: before, it holds its value at 0; its own times count from there."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield what is wrong with the text."""
        from hfsim.deck.expressions import ExpressionError

        try:
            self._tree()
        except ExpressionError as error:
            yield Complaint(("expression",), error.message, error.hint)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an expression that has no value at some time of the run."""
        if around.duration is not None and (why := self._trouble(around.duration, (0,))):
            yield Complaint(("expression",), why)

    def trouble(self, duration: float) -> str:
        """Return where its rate jumps or is not finite, or its acceleration; its value is told by itself."""
        if self._trouble(duration, (0,)):
            return ""
        if why := self._trouble(duration, (1, 2)):
            return why
        jump = self.unshifted().jump(max(duration - self.begin, 0.0))
        return "" if jump is None else f"its rate jumps at t = {jump:.4g} s, and no body's can"

    def _trouble(self, duration: float, orders: tuple[int, ...]) -> str:
        found = self.unshifted().trouble(max(duration - self.begin, 0.0), orders)
        return f"{found[1]} at t = {found[0]:.4g} s" if found else ""

    def _tree(self) -> "Node":
        from hfsim.deck.expression_law import TIME, checked
        from hfsim.deck.expressions import parsed

        return checked(parsed(self.expression, grown=True, time=TIME))

    @property
    def constant(self) -> float | None:
        """Its value where t is not in it."""
        tree = self._tree()
        return tree.value if tree.kind == "number" else None

    def unshifted(self) -> "ExpressionLaw":
        """Return the law as if it began at 0."""
        from hfsim.deck.expression_law import ExpressionLaw

        return ExpressionLaw(self._tree())


AnyLaw = ConstantSpec | ConstantRateSpec | TableSpec | SmoothStepSpec | SpinUpSpec | SineSpec | ExpressionSpec
LAWS: dict[str, type[LawSpec]] = {
    get_args(spec.model_fields["type"].annotation)[0]: spec for spec in get_args(AnyLaw)
}

_OF_TIME = re.compile(r"\b[a-z]\w*\s*\(|[-+*/(]\s*t\b|\bt\s*[-+*/)]|^\s*t\s*$")
"""A call, or time beside an operator or alone."""
TOLD_BY = {"expression": "expression", "times": "table"}
"""Types of laws by the keys that tell them where none is stated."""


def _read_law(data: object, value: str, rate: str) -> object:
    """Turn a bare number into a constant, and text with units into SI numbers of what the law drives."""
    if isinstance(data, str):
        return {"type": "constant", "value": _constant(data, value)}
    if isinstance(data, int | float) and not isinstance(data, bool):
        data = {"type": "constant", "value": data}
    if isinstance(data, dict) and "type" not in data and (told := TOLD_BY.keys() & data.keys()):
        data = {"type": TOLD_BY[min(told)], **data}
    if not isinstance(data, dict) or str(data.get("type")) not in LAWS:
        return data
    spec = LAWS[str(data["type"])]
    dimensions = dict.fromkeys(spec.value_keys, value) | dict.fromkeys(spec.rate_keys, rate)
    refused: list[Complaint] = []
    factor, data = _unit_of(data, value, refused)
    read = {
        key: _in_si(item, dimensions[key], factor, (key,), refused) if key in dimensions else item
        for key, item in data.items()
    }
    refuse_all(refused)
    return read


def _constant(text: str, dimension: str) -> float:
    """Return a text in SI; tell how one that looks like an expression would be a law."""
    try:
        return parse_quantity(text, dimension)
    except UnitError as error:
        if _OF_TIME.search(text) is None:
            raise refusal(str(error), error.hint) from error
        law = f"{{expression: {json.dumps(text, ensure_ascii=False)}}}"
        raise refusal(f"must be {describe(dimension)} or a law, not the text '{text}'", law) from error


def _unit_of(data: dict[str, Any], dimension: str, refused: list[Complaint]) -> tuple[float, dict[str, Any]]:
    """Return the size in SI of the unit that a table states, and the table without it."""
    unit = data.get("unit")
    if data["type"] != "table" or not isinstance(unit, str):
        return 1.0, data
    data = {key: item for key, item in data.items() if key != "unit"}
    try:
        return parse_quantity(f"1 {unit}", dimension), data
    except UnitError as error:
        refused.append(Complaint(("unit",), str(error), error.hint))
        return 1.0, data


def _in_si(item: object, dimension: str, factor: float, path: Path, refused: list[Complaint]) -> object:
    """Convert numbers and text with a unit; anything else is left to the field's own type."""
    if isinstance(item, list):
        return [_in_si(entry, dimension, factor, (*path, index), refused) for index, entry in enumerate(item)]
    if isinstance(item, int | float) and not isinstance(item, bool) and factor != 1.0:
        return factor * item
    if not isinstance(item, str):
        return item
    try:
        return parse_quantity(item, dimension)
    except UnitError as error:
        refused.append(Complaint(path, str(error), error.hint))
        return item


def _driving(value: str, rate: str) -> Before:
    return Before(partial(_read_law, value=value, rate=rate))


_by_type = OneOf("type", LAWS, others=({"type": "number"}, {"type": "string"}))

AngleLaw = Annotated[AnyLaw, _by_type, _driving("angle", "angular_velocity")]
PositionLaw = Annotated[AnyLaw, _by_type, _driving("length", "velocity")]
ScaleLaw = Annotated[AnyLaw, _by_type, _driving("dimensionless", "dimensionless")]
