"""Base class and field types of deck entries, and pydantic's refusals put into deck words.

A field type says what a number measures: ``Length`` takes a number in metres or text with a unit of length.
An entry says what is wrong with it as a whole in `Spec.complaints`.
"""

from __future__ import annotations

import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic_core import CoreSchema, ErrorDetails, InitErrorDetails, PydanticCustomError
from pydantic_core.core_schema import no_info_plain_validator_function

from hfsim.deck.source import Path, did_you_mean
from hfsim.deck.units import UnitError, describe, parse_quantity

_REFUSED = "refused"


class Complaint(NamedTuple):
    """What is wrong with an entry.

    Attributes
    ----------
    path : tuple
        Where, counted from the entry that complains.
    message, hint : str
        What is wrong, and what would be right.
    on_key : bool
        Whether the key is to be marked, not the value.
    """

    path: Path
    message: str
    hint: str = ""
    on_key: bool = False


class Spec(BaseModel):
    """Base of everything a deck may say: frozen, no unknown keys, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    def complaints(self) -> Iterable[Complaint]:
        """Yield what is wrong with this entry where each key by itself is right."""
        return ()

    def model_post_init(self, context: Any, /) -> None:
        """Refuse an entry that has complaints."""
        refuse_all(self.complaints())


def refusal(message: str, hint: str = "", on_key: bool = False) -> PydanticCustomError:
    """Return the exception by which a validator refuses a value, with what would be right."""
    return PydanticCustomError(_REFUSED, "{message}", {"message": message, "hint": hint, "on_key": on_key})


def refused(complaints: Sequence[Complaint]) -> ValidationError:
    """Return the exception that makes all complaints at once, each at its own path."""
    errors = [
        InitErrorDetails(type=refusal(one.message, one.hint, one.on_key), loc=one.path, input=None)
        for one in complaints
    ]
    return ValidationError.from_exception_data("entry", errors)


def refuse_all(complaints: Iterable[Complaint]) -> None:
    """Raise all complaints at once; do nothing where there are none."""
    if found := list(complaints):
        raise refused(found)


class ReadBy:
    """Marks a field's type: a function turns the deck's value into it, or refuses it.

    Pydantic's own validators would look at each function's signature whenever a class is built.

    Attributes
    ----------
    read : callable
        From the deck's value to the field's.
    """

    def __init__(self, read: Callable[[Any], object]) -> None:
        self.read = read

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Tell pydantic how the field is validated."""
        return no_info_plain_validator_function(self.read)


class OneOf:
    """Marks a union of entries: one key of an entry says which class it is read as.

    Pydantic's own unions build all their classes at once; here a class is built, and if need be its module
    imported, when a deck first has such an entry.

    Attributes
    ----------
    key : str
        The key.
    kinds : mapping of str to type or str
        The key's values and the class of each, or where it stands: ``hfsim.parts.joints.fixed.FixedSpec``.
    otherwise : type, optional
        The class of entries without the key.
    """

    def __init__(
        self, key: str, kinds: Mapping[str, type[Spec] | str], otherwise: type[Spec] | None = None
    ) -> None:
        self.key, self.kinds, self.otherwise = key, kinds, otherwise

    def spec_of(self, entry: dict[str, Any]) -> type[Spec] | None:
        """Return the class that an entry is read as, None where its key does not say it."""
        if self.key not in entry:
            return self.otherwise
        kind = entry[self.key]
        spec = self.kinds.get(kind) if isinstance(kind, str) else None
        if isinstance(spec, str):
            module, _, name = spec.rpartition(".")
            found: type[Spec] = getattr(import_module(module), name)
            return found
        return spec

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Tell pydantic how the field is validated."""
        return no_info_plain_validator_function(self._read)

    def _read(self, value: Any) -> Spec:
        if isinstance(value, Spec):
            return value
        if not isinstance(value, dict):
            raise refusal(f"must be a map, not {shown(value)}")
        spec = self.spec_of(value)
        if spec is not None:
            return spec.model_validate(value)
        if self.key not in value:
            wrong = Complaint((self.key,), "missing key", "it says which kind this entry is", on_key=True)
        else:
            wrong = _wrong_choice((self.key,), value[self.key], list(self.kinds))
        raise refused([wrong])


class _Bounds(NamedTuple):
    """What a number must be; its refusal shows the number as it was written."""

    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None

    def check(self, number: float, written: object) -> None:
        """Refuse a number outside."""
        if self.above is not None and not number > self.above:
            raise refusal(f"must be greater than {self.above:g}, not {shown(written)}")
        if self.at_least is not None and not number >= self.at_least:
            raise refusal(f"must be at least {self.at_least:g}, not {shown(written)}")
        if self.below is not None and not number < self.below:
            raise refusal(f"must be less than {self.below:g}, not {shown(written)}")
        if self.at_most is not None and not number <= self.at_most:
            raise refusal(f"must be at most {self.at_most:g}, not {shown(written)}")


def _read_number(dimension: str, bounds: _Bounds, value: object) -> float:
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
    bounds.check(number, value)
    return float(number)


def _read_count(bounds: _Bounds, value: object) -> int:
    integral = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
    if isinstance(value, bool) or not integral:
        raise refusal(f"must be a whole number, not {shown(value)}")
    count: int = int(value)  # type: ignore[call-overload]
    bounds.check(count, value)
    return count


def _read_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise refusal(f"must be true or false, not {shown(value)}")
    return value


def measures(dimension: str = "dimensionless", **bounds: float) -> ReadBy:
    """Return what reads a number of a dimension, with its bounds by the names of `_Bounds`."""
    return ReadBy(partial(_read_number, dimension, _Bounds(**bounds)))


def whole(at_least: int = 1, at_most: int | None = None) -> ReadBy:
    """Return what reads a whole number within bounds."""
    return ReadBy(partial(_read_count, _Bounds(at_least=at_least, at_most=at_most)))


Number = Annotated[float, measures()]
Length = Annotated[float, measures("length")]
Angle = Annotated[float, measures("angle")]
Time = Annotated[float, measures("time")]
Force = Annotated[float, measures("force")]
Moment = Annotated[float, measures("moment")]
Velocity = Annotated[float, measures("velocity")]
AngularVelocity = Annotated[float, measures("angular_velocity")]
Acceleration = Annotated[float, measures("acceleration")]

UnitInterval = Annotated[float, measures(at_least=0, at_most=1)]
PositiveLength = Annotated[float, measures("length", above=0)]
NonNegativeLength = Annotated[float, measures("length", at_least=0)]
PositiveTime = Annotated[float, measures("time", above=0)]
NonNegativeTime = Annotated[float, measures("time", at_least=0)]
PositiveFrequency = Annotated[float, measures("frequency", above=0)]
PositiveMass = Annotated[float, measures("mass", above=0)]
PositiveInertia = Annotated[float, measures("inertia", above=0)]
PositiveDensity = Annotated[float, measures("density", above=0)]
PositivePressure = Annotated[float, measures("pressure", above=0)]
PositiveArea = Annotated[float, measures("area", above=0)]
PositiveSecondMoment = Annotated[float, measures("second_moment", above=0)]
Stiffness = Annotated[float, measures("stiffness", at_least=0)]
Damping = Annotated[float, measures("damping", at_least=0)]
RotationalStiffness = Annotated[float, measures("rotational_stiffness", at_least=0)]
RotationalDamping = Annotated[float, measures("rotational_damping", at_least=0)]

Count = Annotated[int, whole()]
Flag = Annotated[bool, ReadBy(_read_flag)]


def _entries(value: object, counts: tuple[int, ...], what: str) -> object:
    wanted = " or ".join(str(count) for count in counts)
    if not isinstance(value, list | tuple):
        raise refusal(f"must be a list of {wanted} {what}, not {shown(value)}")
    if len(value) not in counts:
        raise refusal(f"must be a list of {wanted} {what}, not of {len(value)}")
    return value


_vector = BeforeValidator(partial(_entries, counts=(2, 3), what="numbers"))

Vector = Annotated[tuple[Number, ...], _vector]
LengthVector = Annotated[tuple[Length, ...], _vector]
VelocityVector = Annotated[tuple[Velocity, ...], _vector]
AccelerationVector = Annotated[tuple[Acceleration, ...], _vector]
ForceVector = Annotated[tuple[Force, ...], _vector]


def _check_axis(axis: tuple[float, ...]) -> tuple[float, ...]:
    if not any(axis):
        raise refusal("an axis cannot be zero", "give a direction such as [1, 0]")
    return axis


Axis = Annotated[Vector, AfterValidator(_check_axis)]

Between = Annotated[tuple[str, str], BeforeValidator(partial(_entries, counts=(2,), what="points"))]
"""The two points that a joint or a spring connects."""


def _read_name(value: object) -> str:
    name = read_text(value)
    if name == "ground":
        raise refusal("'ground' is the name of the scene's ground", "choose another name")
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", name):
        hint = "letters, digits, '_' and '-', not starting with a digit"
        raise refusal(f"'{name}' cannot be a name", hint)
    return name


def read_text(value: object) -> str:
    """Return a deck's text."""
    if not isinstance(value, str):
        raise refusal(f"must be text, not {shown(value)}")
    return value


Name = Annotated[str, ReadBy(_read_name)]


def _empty_map(value: object) -> object:
    """Take a key without a value as an empty map: all its entries may be commented out."""
    return {} if value is None else value


EmptyAllowed = BeforeValidator(_empty_map)

Points = Annotated[dict[Name, LengthVector], EmptyAllowed]


def split_point(reference: str) -> tuple[str, str]:
    """Return owner and point of a point's name; an empty point is the owner's origin.

    Examples
    --------
    >>> split_point("b1.tip"), split_point("ground")
    (('b1', 'tip'), ('ground', ''))
    """
    owner, _, point = reference.partition(".")
    return owner, point


def shown(value: object) -> str:
    """Return a deck's value as messages show it."""
    if value is None:
        return "empty"
    if isinstance(value, dict):
        return "a map"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    text = f"'{value}'" if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


# Pydantic's refusals in deck words --------------------------------------------------------------------

_MESSAGES = {
    "string_type": "must be text",
    "dict_type": "must be a map",
    "model_type": "must be a map",
    "model_attributes_type": "must be a map",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
}


def explain(error: ValidationError, root: type[Spec], data: Any) -> Iterator[Complaint]:
    """Yield what pydantic refused, in deck words and with paths into the deck.

    Parameters
    ----------
    error : pydantic.ValidationError
        From validating `data`.
    root : type
        The class that `data` was validated as.
    data : dict
        The plain data.
    """
    for item in error.errors(include_url=False):
        yield _explain_one(item, root, data)


def _explain_one(item: ErrorDetails, root: type[Spec], data: Any) -> Complaint:
    kind, context = item["type"], item.get("ctx", {})
    path = deck_path(item["loc"], data, keep_last=kind in ("missing", _REFUSED))
    on_key = bool(item["loc"]) and item["loc"][-1] == "[key]"
    if kind == _REFUSED:
        return Complaint(path, context["message"], context["hint"], on_key or context["on_key"])
    if kind == "extra_forbidden":
        hint = did_you_mean(str(path[-1]), _keys_at(root, data, path[:-1]))
        return Complaint(path, "unknown key", hint, True)
    if kind == "missing":
        return Complaint(path, "missing key", _description(root, data, path), True)
    if kind == "literal_error":
        return _wrong_choice(path, item["input"], re.findall(r"'([^']*)'", context["expected"]))
    message = _MESSAGES[kind].format(**context) if kind in _MESSAGES else item["msg"]
    return Complaint(path, f"{message}, not {shown(item['input'])}", "", on_key)


def _wrong_choice(path: Path, given: object, choices: list[str]) -> Complaint:
    hint = did_you_mean(str(given), choices)
    message = f"must be one of {', '.join(choices)}, not {shown(given)}"
    return Complaint(path, message, hint if "?" in hint else "")


def deck_path(loc: Iterable[str | int], data: Any, keep_last: bool = False) -> Path:
    """Return a location of pydantic's without what is not in the deck, such as its mark of a map's key.

    Parameters
    ----------
    loc : iterable of str or int
        ``loc`` of one of pydantic's errors.
    data : dict
        What was validated.
    keep_last : bool
        Keep the last step though the data lack it, as for a missing key.
    """
    steps = list(loc)
    path: list[str | int] = []
    for index, step in enumerate(steps):
        if _has(data, step):
            path.append(step)
            data = data[step]
        elif keep_last and index == len(steps) - 1 and isinstance(data, dict) and step != "[key]":
            path.append(step)
    return tuple(path)


def _has(data: Any, step: str | int) -> bool:
    if isinstance(data, dict):
        return step in data
    return isinstance(data, list) and isinstance(step, int) and step < len(data)


def _keys_at(root: type[Spec], data: Any, path: Path) -> list[str]:
    spec = spec_at(root, data, path)
    return [] if spec is None else spec_keys(spec)


def spec_keys(spec: type[Spec]) -> list[str]:
    """Return the keys that an entry may have, as decks spell them."""
    return [info.alias or name for name, info in spec.model_fields.items()]


def _description(root: type[Spec], data: Any, path: Path) -> str:
    spec = spec_at(root, data, path[:-1])
    if spec is None:
        return ""
    aliases = {info.alias or name: name for name, info in spec.model_fields.items()}
    return field_docstrings(spec).get(aliases.get(str(path[-1]), ""), "").rstrip(".")


def field_docstrings(spec: type[Spec]) -> dict[str, str]:
    """Return the text under each field of a class, from its source: pydantic would read it at every start."""
    import ast
    import inspect
    import textwrap

    found: dict[str, str] = {}
    for one in reversed(spec.__mro__):
        if not issubclass(one, Spec):
            continue
        body = ast.parse(textwrap.dedent(inspect.getsource(one))).body[0]
        assert isinstance(body, ast.ClassDef)
        for field, text in pairwise(body.body):
            if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
                continue
            if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                found[field.target.id] = " ".join(str(text.value.value).split())
    return found


def spec_at(root: type[Spec], data: Any, path: Path) -> type[Spec] | None:
    """Return the class that describes the entry at a path, None where there is none."""
    annotation: Any = root
    for step in path:
        annotation = _inside(annotation, data, step)
        data = data[step]
    return _pick(annotation, data)


def _inside(annotation: Any, data: Any, step: str | int) -> Any:
    for one in _alternatives(annotation):
        if typing.get_origin(one) in (dict, tuple, list):
            arguments = typing.get_args(one)
            return arguments[1] if typing.get_origin(one) is dict else arguments[0]
    spec = _pick(annotation, data)
    if spec is None:
        return None
    fields = {info.alias or name: info.annotation for name, info in spec.model_fields.items()}
    return fields.get(str(step))


def _alternatives(annotation: Any) -> list[Any]:
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        one_of = [mark for mark in annotation.__metadata__ if isinstance(mark, OneOf)]
        return one_of or _alternatives(typing.get_args(annotation)[0])
    if origin in (typing.Union, types.UnionType):
        return [leaf for one in typing.get_args(annotation) for leaf in _alternatives(one)]
    return [annotation]


def _pick(annotation: Any, data: Any) -> type[Spec] | None:
    """Return the one class among an annotation's alternatives that the data are read as."""
    for one in _alternatives(annotation):
        if isinstance(one, OneOf):
            return one.spec_of(data) if isinstance(data, dict) else None
        if isinstance(one, type) and issubclass(one, Spec):
            return one
    return None
