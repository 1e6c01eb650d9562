"""Base class and field types of deck entries, and pydantic's refusals put into deck words.

A field type says what a number measures: ``Length`` takes a number in metres or text with a unit of length.
An entry says what is wrong with it as a whole in `Spec.complaints`.
"""

from __future__ import annotations

import math
import re
import types
import typing
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import pairwise
from typing import Annotated, Any, NamedTuple, Self

from annotated_types import Ge, Gt, Le
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from hfsim.deck_source import Path, did_you_mean
from hfsim.units import UnitError, describe, parse_quantity

_REFUSED = "refused"

GENERAL = "<no shape>"
"""Tag of an entry that may state a shape and does not."""


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

    @model_validator(mode="after")
    def _refuse_complaints(self) -> Self:
        refuse_all(self.complaints())
        return self


def refusal(message: str, hint: str = "") -> PydanticCustomError:
    """Return the exception by which a validator refuses a value, with what would be right."""
    return PydanticCustomError(_REFUSED, "{message}", {"message": message, "hint": hint})


def refuse_all(complaints: Iterable[Complaint]) -> None:
    """Raise all complaints at once, each at its own path; do nothing where there are none."""
    errors = [
        InitErrorDetails(type=refusal(one.message, one.hint), loc=one.path, input=None) for one in complaints
    ]
    if errors:
        raise ValidationError.from_exception_data("entry", errors)


def read_number(value: object, dimension: str = "dimensionless") -> float:
    """Return a deck's number, or its text with a unit, as a finite SI number."""
    if isinstance(value, str):
        try:
            value = parse_quantity(value, dimension)
        except UnitError as error:
            raise refusal(str(error), error.hint) from None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise refusal(f"must be {describe(dimension)}, not {shown(value)}")
    if not math.isfinite(value):
        raise refusal(f"must be finite, not {value}")
    return float(value)


def _read_count(value: object) -> int:
    whole = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
    if isinstance(value, bool) or not whole:
        raise refusal(f"must be a whole number, not {shown(value)}")
    return int(value)  # type: ignore[call-overload, no-any-return]


def _read_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise refusal(f"must be true or false, not {shown(value)}")
    return value


def _measures(dimension: str) -> BeforeValidator:
    return BeforeValidator(partial(read_number, dimension=dimension))


Number = Annotated[float, _measures("dimensionless")]
Length = Annotated[float, _measures("length")]
Angle = Annotated[float, _measures("angle")]
Time = Annotated[float, _measures("time")]
Force = Annotated[float, _measures("force")]
Moment = Annotated[float, _measures("moment")]
Velocity = Annotated[float, _measures("velocity")]
AngularVelocity = Annotated[float, _measures("angular_velocity")]
Acceleration = Annotated[float, _measures("acceleration")]
Frequency = Annotated[float, _measures("frequency")]

NonNegative = Annotated[Number, Ge(0)]
UnitInterval = Annotated[Number, Ge(0), Le(1)]
PositiveLength = Annotated[Length, Gt(0)]
NonNegativeLength = Annotated[Length, Ge(0)]
PositiveTime = Annotated[Time, Gt(0)]
NonNegativeTime = Annotated[Time, Ge(0)]
PositiveFrequency = Annotated[Frequency, Gt(0)]
PositiveMass = Annotated[float, _measures("mass"), Gt(0)]
PositiveInertia = Annotated[float, _measures("inertia"), Gt(0)]
PositiveDensity = Annotated[float, _measures("density"), Gt(0)]
PositivePressure = Annotated[float, _measures("pressure"), Gt(0)]
PositiveArea = Annotated[float, _measures("area"), Gt(0)]
PositiveSecondMoment = Annotated[float, _measures("second_moment"), Gt(0)]
Stiffness = Annotated[float, _measures("stiffness"), Ge(0)]
Damping = Annotated[float, _measures("damping"), Ge(0)]
RotationalStiffness = Annotated[float, _measures("rotational_stiffness"), Ge(0)]
RotationalDamping = Annotated[float, _measures("rotational_damping"), Ge(0)]

Integer = Annotated[int, BeforeValidator(_read_count)]
Count = Annotated[Integer, Ge(1)]
Flag = Annotated[bool, BeforeValidator(_read_flag)]


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


def _check_name(value: str) -> str:
    if value == "ground":
        raise refusal("'ground' is the name of the scene's ground", "choose another name")
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", value):
        hint = "letters, digits, '_' and '-', not starting with a digit"
        raise refusal(f"'{value}' cannot be a name", hint)
    return value


Name = Annotated[str, AfterValidator(_check_name)]


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
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
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
        return Complaint(path, context["message"], context["hint"], on_key)
    if kind == "extra_forbidden":
        hint = did_you_mean(str(path[-1]), _keys_at(root, data, path[:-1]))
        return Complaint(path, "unknown key", hint, True)
    if kind == "missing":
        return Complaint(path, "missing key", _description(root, data, path), True)
    if kind == "union_tag_not_found":
        return Complaint((*path, "type"), "missing key", "it says which kind this entry is", True)
    if kind == "union_tag_invalid":
        tag = "shape" if "shape" in _at(data, path) else "type"
        return _wrong_choice((*path, tag), str(context["tag"]), str(context["expected_tags"]))
    if kind == "literal_error":
        return _wrong_choice(path, item["input"], str(context["expected"]))
    message = _MESSAGES[kind].format(**context) if kind in _MESSAGES else item["msg"]
    return Complaint(path, f"{message}, not {shown(item['input'])}", "", on_key)


def _wrong_choice(path: Path, given: object, expected: str) -> Complaint:
    choices = [one for one in re.findall(r"'([^']*)'", expected) if one != GENERAL]
    hint = did_you_mean(str(given), choices)
    message = f"must be one of {', '.join(choices)}, not {shown(given)}"
    return Complaint(path, message, hint if "?" in hint else "")


def deck_path(loc: Iterable[str | int], data: Any, keep_last: bool = False) -> Path:
    """Return a location of pydantic's without what is not in the deck: tags of unions and the like.

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
    tag_seen = False
    for index, step in enumerate(steps):
        is_tag = isinstance(data, dict) and not tag_seen and step in _tags(data)
        if is_tag:
            tag_seen = True
        elif _has(data, step):
            path.append(step)
            data = data[step]
            tag_seen = False
        elif keep_last and index == len(steps) - 1 and isinstance(data, dict) and step != "[key]":
            path.append(step)
    return tuple(path)


def _tags(data: dict[str, Any]) -> tuple[object, ...]:
    return data.get("type"), data.get("shape", GENERAL)


def _has(data: Any, step: str | int) -> bool:
    if isinstance(data, dict):
        return step in data
    return isinstance(data, list) and isinstance(step, int) and step < len(data)


def _at(data: Any, path: Path) -> Any:
    for step in path:
        data = data[step]
    return data


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
        return _alternatives(typing.get_args(annotation)[0])
    if origin in (typing.Union, types.UnionType):
        return [leaf for one in typing.get_args(annotation) for leaf in _alternatives(one)]
    return [annotation]


def _pick(annotation: Any, data: Any) -> type[Spec] | None:
    """Return the one class among an annotation's alternatives whose tags are those of the data."""
    specs = [one for one in _alternatives(annotation) if isinstance(one, type) and issubclass(one, Spec)]
    if len(specs) == 1:
        return specs[0]
    matching = [spec for spec in specs if isinstance(data, dict) and _has_tags(spec, data)]
    return matching[0] if matching else None


def _has_tags(spec: type[Spec], data: dict[str, Any]) -> bool:
    for tag in ("type", "shape"):
        info = spec.model_fields.get(tag)
        expected = typing.get_args(info.annotation)[0] if info else None
        if data.get(tag) != expected:
            return False
    return True
