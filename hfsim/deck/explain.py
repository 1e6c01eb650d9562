"""Pydantic's refusals put into deck words, with paths into the deck."""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Annotated, Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hfsim.deck.source import Path, did_you_mean
from hfsim.deck.spec import REFUSED, Complaint, OneOf, Spec, shown, wrong_choice

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
    path = deck_path(item["loc"], data, keep_last=kind in ("missing", REFUSED))
    on_key = bool(item["loc"]) and item["loc"][-1] == "[key]"
    if kind == REFUSED:
        return Complaint(path, context["message"], context["hint"], on_key or context["on_key"])
    if kind == "extra_forbidden":
        hint = did_you_mean(str(path[-1]), _keys_at(root, data, path[:-1]))
        return Complaint(path, "unknown key", hint, True)
    if kind == "missing":
        return Complaint(path, "missing key", _description(root, data, path), True)
    if kind == "literal_error":
        return wrong_choice(path, item["input"], re.findall(r"'([^']*)'", context["expected"]))
    message = _MESSAGES[kind].format(**context) if kind in _MESSAGES else item["msg"]
    return Complaint(path, f"{message}, not {shown(item['input'])}", "", on_key)


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
    return [] if spec is None else spec.keys()


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
