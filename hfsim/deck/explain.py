"""Pydantic's refusals put into deck words; imported when there are some."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from itertools import pairwise

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hfsim.deck.source import did_you_mean
from hfsim.deck.spec import REFUSED, Complaint, Spec, shown, wrong_choice

_MESSAGES = {
    "string_type": "must be text",
    "dict_type": "must be a map",
    "model_type": "must be a map",
    "model_attributes_type": "must be a map",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
}


def explained(spec: type[Spec], error: ValidationError) -> list[Complaint]:
    """Return what pydantic refused of an entry, in deck words.

    Parameters
    ----------
    spec : type
        The class that the entry was read as.
    error : pydantic.ValidationError
        What entries inside it refused is in deck words already.
    """
    return [_explained(spec, item) for item in error.errors(include_url=False)]


def _explained(spec: type[Spec], item: ErrorDetails) -> Complaint:
    kind, context = item["type"], item.get("ctx", {})
    path = tuple(step for step in item["loc"] if step != "[key]")
    on_key = len(path) < len(item["loc"])
    if kind == REFUSED:
        return Complaint(path, context["message"], context["hint"], on_key or context["on_key"])
    if kind == "extra_forbidden":
        return Complaint(path, "unknown key", did_you_mean(str(path[-1]), spec.keys()), True)
    if kind == "missing":
        field = dict(zip(spec.keys(), spec.model_fields, strict=True))[str(path[-1])]
        return Complaint(path, "missing key", field_docstrings(spec).get(field, "").rstrip("."), True)
    if kind == "literal_error":
        return wrong_choice(path, item["input"], re.findall(r"'([^']*)'", context["expected"]))
    message = _MESSAGES[kind].format(**context) if kind in _MESSAGES else item["msg"]
    return Complaint(path, f"{message}, not {shown(item['input'])}", "", on_key)


def field_docstrings(spec: type[Spec]) -> dict[str, str]:
    """Return the text under each field of a class, from its source: pydantic would read it at every start."""
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
