# ruff: noqa: E501
"""Write the manual's page on all keys of decks from their JSON schema: ``python tests/deck_reference.py``.

Examples are the first values that shipped decks, and the decks of the manual, have for a key.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from hfsim.deck.json_schema import json_schema
from hfsim.deck.reader import parse
from hfsim.deck.units import SI_UNITS, UNITS
from hfsim.output.manual import FOLDER, decks_in
from hfsim.scene.schema import Deck

PAGE = FOLDER / "keys.md"
CASES = Path(__file__).parent.parent / "cases"
LONGEST = 44
"""Characters of an example."""
HEAD = """# Keys: all that a deck may say

Written by `python tests/deck_reference.py` from the classes that read decks. Every number may be text with a unit
(`"12 deg"`, `"7 GPa"`: [units](#units)) or an expression of parameters (`"${length / 2}"`); where a unit is named, it is that of a bare
number. Names in maps and texts in lists may be patterns (`blade{k=1..4}`). `-`: the key must be there; *none*: nothing is there without it.
"""
SHARED = {
    **{"orientation": "Orientations", "law": "Laws of time"},
    **{"friction": "Friction in joints", "stops": "Stops of joints", "latch": "Latches of joints"},
}
"""What many entries have: the section that tells of it."""
SPECIAL = {
    **{"quaternion": [1, 0, 0, 0], "expression": "2 * sin(3 * t)", "unit": "rpm", "column": "torque", "time_column": "t"},
    **{"table": "motor.csv", "second_moments": [1e-8, 4e-8], "transition": 1e-3, "velocity": 1e-3, "section_degree": 2},
    **{"vary": {"bodies.arm.length": "lin(0.5, 2, 7)"}, "sample": 200, "seed": 2, "runs": "runs.csv", "collect": ["max(arm.tip.x)"]},
    **{"rows": [{"quantity": "final(arm.tip.x)", "published": 0.9}]},
    **{"include": "parts/arm.yaml", "keep": ["damping"], "points": [[0, 0, 0], [1, 0, 0.1], [2, 0, 0.3]]},
}
"""Examples by key of what no shipped deck has..."""
USUAL = {
    **{"m": "5 cm", "rad": "30 deg", "s": "10 ms", "kg": "200 g", "N": "2 kN", "N m": "5 N*m", "Pa": "210 GPa"},
    **{"N/m": "100 N/mm", "N m/rad": "2 kN*m/rad", "N s/m": 10, "N m s/rad": 0.1, "m/s": "1 m/s", "rad/s": "60 rpm"},
    **{"Hz": "50 Hz", "m^4": 1e-8, "m^2": 1e-4, "text": "name", "whole number": 8, "`true` `false`": True},
    **{"N m^2": 500.0, "list: number": [0, 0, 1], "list: anything": [[0, 0], [0.1, 50]], "list: list: anything": [[9e3, 0, 20], [0, 3e3, 0], [20, 0, 40]], "list: text": ["arm.tip.x"]},
    **{"map": {"length": 0.5}, "s/m": 0.3, "s/rad": 0.3, "map of names: list: m": {"middle": [0.5, 0, 0]}},
}
"""... and by what it may be."""
BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


def page() -> str:
    """Return the page."""
    schema, found = json_schema(Deck), list(decks())
    parts = [HEAD, "## Top level", "", *table(schema, found, skip=sections(schema))]
    for key, one in sections(schema).items():
        parts += ["", f"## {key}", "", one["description"]]
        named = isinstance(one.get("additionalProperties"), dict)
        inner = one["additionalProperties"] if named else one
        entries = [entry for deck in found for entry in under(deck, key, named)]
        parts += told(inner, entries, key)
    for word, title in SHARED.items():
        parts += ["", f"## {title}", *told({"anyOf": list(shared(schema, word))}, list(spread(found)), word)]
    return "\n".join([*parts, "", *units(), ""])


def units() -> Iterator[str]:
    """Yield the section on units."""
    yield "## Units"
    yield ""
    yield "`N m`, `N*m` and `Nm` are one, as are `m2`, `m^2` and `m²`."
    yield ""
    yield "| what | SI | units of text |"
    yield "|---|---|---|"
    for dimension, known in UNITS.items():
        yield f"| {dimension.replace('_', ' ')} | {SI_UNITS[dimension]} | {' '.join(f'`{unit}`' for unit in known)} |"


def sections(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the top-level keys whose entries have keys of their own."""
    return {key: one for key, one in schema["properties"].items() if kinds(one.get("additionalProperties")) or kinds(one)}


def shared(schema: Any, word: str) -> Iterator[dict[str, Any]]:
    """Yield the kinds of what many entries have, each once."""
    seen: list[Any] = []
    for one in spread(schema):
        for kind in kinds(one) if isinstance(one, dict) and family(one) == word else ():
            if kind["properties"] not in seen:
                seen.append(kind["properties"])
                yield kind


def spread(value: Any) -> Iterator[Any]:
    """Yield all values inside a value, itself first."""
    yield value
    for one in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from spread(one)


def family(schema: dict[str, Any]) -> str:
    """Return the word for what many entries have; empty for all else."""
    every = kinds(schema) if "description" in schema else []
    if every and "quaternion" in every[0]["properties"]:
        return "orientation"
    if len(every) == 1 and "transition" in every[0]["properties"] and "lower" in every[0]["properties"]:
        return "stops"
    if len(every) == 1 and set(every[0]["properties"]) in ({"law", "torque", "velocity"}, {"law", "force", "velocity"}):
        return "friction"
    if len(every) == 1 and set(every[0]["properties"]) in [{one, "stiffness", "damping"} for one in ("angle", "distance")]:
        return "latch"
    return "law" if len(every) > 1 and "rate" in str(every) and {"type": "number"} in schema["anyOf"] else ""


def told(schema: dict[str, Any], entries: list[Any], name: str) -> Iterator[str]:
    """Yield the tables of an entry: one for each of its kinds, and for the entries inside."""
    every = kinds(schema)
    for kind in every:
        own = [entry for entry in entries if fits(entry, kind)]
        title = (kind["properties"].get("type") or kind["properties"].get("shape", {})).get("const")
        yield ""
        if len(every) > 1:
            keys = kind.get("required") or [*kind["properties"]][:1]
            yield f"### {name}: {title or _of(kind) or ', '.join(keys)}"
            yield ""
            yield kind["description"]
            yield ""
        yield from table(kind, own)


def _of(kind: dict[str, Any]) -> str:
    """Return what friction, stops or latches resist; empty for all else."""
    properties = kind["properties"]
    rate = properties.get("lower") or (properties.get("velocity") if len(properties) == 3 else None)
    if len(properties) == 3 and "stiffness" in properties:
        rate = properties.get("angle") or properties.get("distance")
    return "" if rate is None else "of turns" if "[rad" in rate["description"] else "of shifts"


def kinds(schema: Any) -> list[dict[str, Any]]:
    """Return the kinds of entries that a value may be."""
    if not isinstance(schema, dict):
        return []
    if "properties" in schema:
        return [schema]
    return [kind for one in schema.get("anyOf", ()) for kind in kinds(one)]


def table(schema: dict[str, Any], entries: list[Any], skip: Any = ()) -> Iterator[str]:
    """Yield the rows of all keys."""
    yield "| key | value | default | example | meaning |"
    yield "|---|---|---|---|---|"
    yield from rows(schema, entries, skip, "")


def rows(schema: dict[str, Any], entries: list[Any], skip: Any, inside: str) -> Iterator[str]:
    """Yield a row for each key, and for those of maps inside."""
    for key, one in schema["properties"].items():
        if key in skip:
            continue
        values = [entry[key] for entry in entries if isinstance(entry, dict) and key in entry]
        refused = [way["exclusiveMinimum"] for way in (one, *one.get("anyOf", ())) if "exclusiveMinimum" in way]
        stated = "default" in one and one["default"] not in refused  # what no deck may say stands for none
        default = "-" if key in schema.get("required", ()) else shown(one["default"]) if stated else "*none*"
        shown_values = (shown(value) for value in values)
        what = value_of(one)
        example = next((text for text in shown_values if len(text) <= LONGEST), "") or usual(key, one, what)
        cells = (f"`{inside}{key}`", what, default, example, one["description"])
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
        inner = kinds(one)
        if len(inner) == 1 and not family(one):
            yield from rows(inner[0], values, (), f"{inside}{key}.")


def usual(key: str, schema: dict[str, Any], what: str) -> str:
    """Return an example of what no shipped deck has."""
    if family(schema) == "law" and "never negative" in schema["description"]:
        return shown({"expression": "min(t, 1)"})
    if "const" in schema or "enum" in schema:
        return shown(schema["const"] if "const" in schema else schema["enum"][-1])
    if key in SPECIAL and what.startswith("text") == isinstance(SPECIAL[key], str):
        return shown(SPECIAL[key])
    if family(schema) in ("law", "orientation"):
        return shown({"type": "sine", "amplitude": 0.1, "frequency": 2.0} if family(schema) == "law" else {"axis": [0, 0, 1], "angle": "30 deg"})
    if inner := kinds(schema):
        needed = {name: one for name, one in inner[0]["properties"].items() if name in inner[0].get("required", [name])}
        return shown({name: yaml.safe_load(usual(name, one, value_of(one)).strip("`")) for name, one in needed.items()})
    plain = re.split(r" [<>]|, or|, `", what)[0]
    return shown(USUAL.get(plain, [0, 0, 0.5] if plain.startswith("list") else 0.5))


def value_of(schema: dict[str, Any]) -> str:
    """Return in words what a value may be."""
    if "pattern" in schema:
        return ""  # every number may be an expression
    if word := family(schema):
        link = f"[{word}](#{SHARED[word].lower().replace(' ', '-')})"
        return f"number, text or {link}" if word == "law" else link
    if "const" in schema:
        return shown(schema["const"])
    if "enum" in schema:
        return " ".join(shown(one) for one in schema["enum"])
    if "x-unit" in schema:
        return quantity(schema)
    if "anyOf" in schema:
        words = dict.fromkeys(value_of(one) for one in schema["anyOf"])
        return ", ".join(word for word in words if word)
    if "properties" in schema:
        return "map"
    if schema.get("type") == "array":
        items = schema.get("items") or schema.get("prefixItems", [{}])[0]
        return f"list: {value_of(items)}"
    if schema.get("type") == "object":
        inner = schema.get("additionalProperties")
        return f"map of names: {value_of(inner)}" if isinstance(inner, dict) else "map"
    plain = {"string": "text", "boolean": "`true` `false`", "integer": f"whole number{bounds(schema)}", "number": "number"}
    return plain.get(schema.get("type", ""), "anything")


def quantity(schema: dict[str, Any]) -> str:
    """Return the unit and bounds of a number, and how many there may be."""
    one, *others = schema.get("anyOf", [schema])
    unit = schema["x-unit"].strip("-")
    lists = [form for form in others if form.get("type") == "array"]
    sizes = "".join(f", or {counts(form)}" + (" rows of 3" if form is not lists[0] else "") for form in lists)
    return f"{unit or 'number'}{bounds(one)}{sizes}"


def counts(schema: dict[str, Any]) -> str:
    """Return how many entries a list may have."""
    return " or ".join(map(str, dict.fromkeys((schema["minItems"], schema["maxItems"]))))


def bounds(schema: dict[str, Any]) -> str:
    """Return the bounds of a number."""
    found = [f"{sign} {schema[word]:g}" for word, sign in BOUNDS.items() if word in schema]
    return f" {', '.join(found)}" if found else ""


def shown(value: Any) -> str:
    """Return a value as decks write it."""
    if isinstance(value, float):
        return f"`{value:g}`"
    text = yaml.safe_dump(value, default_flow_style=True, width=1000).strip().removesuffix("...").strip()
    return f"`{text}`"


def decks() -> Iterator[dict[str, Any]]:
    """Yield the data of all shipped decks, and of those in the manual."""
    pages = (FOLDER / f"{topic}.md" for topic in ("tutorial", "recipes", "deck"))
    texts = [text for one in pages if one.exists() for text in decks_in(one).values()]
    files = [file.read_text() for file in sorted(CASES.glob("*.yaml"))]
    yield from (parse(text).data for text in (*files, *texts))


def under(deck: dict[str, Any], key: str, named: bool) -> list[Any]:
    """Return the entries of a deck under a top-level key."""
    there = deck.get(key)
    return [] if not isinstance(there, dict) else list(there.values()) if named else [there]


def fits(entry: Any, kind: dict[str, Any]) -> bool:
    """Tell whether an entry is of a kind."""
    if not isinstance(entry, dict) or not set(entry) <= set(kind["properties"]):
        return False
    told = {key: one["const"] for key, one in kind["properties"].items() if "const" in one}
    return all(entry.get(key) == value for key, value in told.items())


if __name__ == "__main__":
    main()
