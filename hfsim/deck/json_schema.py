"""What decks may say as a JSON schema, for editors and for the reference of decks in the manual.

Pydantic walks the classes; here is what it cannot know: quantities with units, entries by kind, texts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pydantic.json_schema

from hfsim.deck.field_texts import field_texts
from hfsim.deck.spec import Spec, at
from hfsim.deck.units import SI_UNITS

_BOUNDS = {
    "above": "exclusiveMinimum",
    "at_least": "minimum",
    "below": "exclusiveMaximum",
    "at_most": "maximum",
}
"""Bounds of numbers, and their names in JSON schemas."""

_EXPRESSION = {"type": "string", "pattern": r"^\s*\$\{"}


def json_schema(spec: type[Spec]) -> dict[str, Any]:
    """Return the JSON schema of an entry and all in it; ``x-unit`` has the SI unit of a quantity."""
    return {"$schema": _Generator.schema_dialect, **spec.model_json_schema(schema_generator=_Generator)}


class _Generator(pydantic.json_schema.GenerateJsonSchema):
    """Pydantic's, for fields that are read by functions and for the texts of entries."""

    def function_plain_schema(self, schema: Any) -> dict[str, Any]:
        """Return the schema of a field that a function reads: `ReadBy` and `OneOf` say what."""
        shape: Mapping[str, Any] = schema["metadata"]["shape"]
        if "quantity" in shape:
            return _quantity(shape)
        if "whole" in shape:
            words = [{"enum": [*shape["whole"]]}] if shape["whole"] else []
            return {"anyOf": [{"type": "integer", **_bounds(shape)}, _EXPRESSION, *words]}
        if "names" in shape:
            return {"enum": [*at(shape["names"]), *shape["others"]]}
        if "entries" not in shape:
            return dict(shape)
        specs = dict.fromkeys(at(one) if isinstance(one, str) else one for one in shape["entries"])
        parts = [*shape.get("others", ()), *map(self._entry, specs)]
        return parts[0] if len(parts) == 1 else {"anyOf": parts}

    def _entry(self, spec: type[Spec]) -> dict[str, Any]:
        spec.model_rebuild()
        return self.generate_inner(spec.__pydantic_core_schema__)

    def model_schema(self, schema: Any) -> dict[str, Any]:
        """Return the schema of an entry with the text of its class and of each key."""
        spec, found = schema["cls"], super().model_schema(schema)
        fields, told = spec.fields_by_key(), field_texts(spec)
        found["description"] = " ".join((spec.__doc__ or "").split("\n\n")[0].split())
        found.pop("title", None)
        for key, one in found.get("properties", {}).items():
            one.pop("title", None)
            one.update(_without_null(one))
            if text := told.get(fields[key]):
                one["description"] = text
        return found


def _bounds(shape: Mapping[str, Any]) -> dict[str, float]:
    return {_BOUNDS[key]: value for key, value in shape.items() if key in _BOUNDS and value is not None}


def _quantity(shape: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schema of a number [SI], of text with a unit, and of lists of them."""
    one: list[dict[str, Any]] = [{"type": "number", **_bounds(shape)}, {"type": "string"}]
    forms = list(one)
    for key in ("count", "rows"):
        if key in shape:
            size = {"minItems": min(shape[key]), "maxItems": max(shape[key])}
            items: dict[str, Any] = {"anyOf": one} if key == "count" else forms[-1]
            forms.append({"type": "array", "items": items, **size})
    return {"anyOf": forms, "x-unit": SI_UNITS[shape["quantity"]]}


def _without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a key that may be left out: decks do not write null for it."""
    if schema.get("default", ...) is not None:
        return {}
    del schema["default"]
    kinds = [one for one in schema.pop("anyOf", []) if one != {"type": "null"}]
    return kinds[0] if len(kinds) == 1 else {"anyOf": kinds} if kinds else {}
