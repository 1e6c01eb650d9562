# ruff: noqa: E501
"""The JSON schema of decks: it takes every deck that hfsim takes, tells each key's text, and refuses slips."""

import re
from functools import cache
from pathlib import Path

import deck_reference
import pytest
import yaml

from hfsim.deck.json_schema import json_schema
from hfsim.deck.reader import parse
from hfsim.scene.schema import Deck

ROOT = Path(__file__).parents[2]
BOUNDS = {
    "minimum": lambda value, bound: value >= bound,
    "maximum": lambda value, bound: value <= bound,
    "exclusiveMinimum": lambda value, bound: value > bound,
    "exclusiveMaximum": lambda value, bound: value < bound,
    "minItems": lambda value, bound: len(value) >= bound,
    "maxItems": lambda value, bound: len(value) <= bound,
    "const": lambda value, wanted: value == wanted,
    "enum": lambda value, wanted: value in wanted,
    "pattern": lambda value, wanted: re.search(wanted, value),
}
TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}
TELLING = {"anyOf", "type", "description", "default", "title", "x-unit", "properties", "required"}
TELLING |= {"items", "additionalProperties", "prefixItems", *BOUNDS, "$schema"}


@cache
def whole():
    return json_schema(Deck)


def wrong(value, schema, path=""):
    """Yield where a value breaks a schema: the words of JSON schemas that this one uses, and no others."""
    assert not set(schema) - TELLING, set(schema) - TELLING
    if "anyOf" in schema:
        tried = [list(wrong(value, one, path)) for one in schema["anyOf"]]
        yield from [] if any(not one for one in tried) else min(tried, key=len)
    kind = schema.get("type")
    if kind and (not isinstance(value, TYPES[kind]) or (isinstance(value, bool) and kind != "boolean")):
        yield f"{path}: not {kind}"
        return
    yield from (f"{path}: {word}" for word, holds in BOUNDS.items() if word in schema and not holds(value, schema[word]))
    if isinstance(value, dict):
        yield from (f"{path}: no {key}" for key in schema.get("required", ()) if key not in value)
        for key, one in value.items():
            inner = schema.get("properties", {}).get(key, schema.get("additionalProperties"))
            if inner is False:
                yield f"{path}.{key}: unknown"
            elif isinstance(inner, dict):
                yield from wrong(one, inner, f"{path}.{key}")
    for number, one in enumerate(value if isinstance(value, list) else ()):
        yield from wrong(one, schema.get("items", {}), f"{path}[{number}]")


def decks():
    files = [file for file in sorted((ROOT / "cases").rglob("*.yaml")) if "hfsim: 1" in file.read_text()]
    return [pytest.param(file.read_text(), id=str(file.relative_to(ROOT / "cases"))) for file in files]


@pytest.mark.parametrize("text", decks())
def test_it_takes_every_shipped_deck(text):
    assert not list(wrong(parse(text).data, whole()))


SLIP = """
hfsim: 1
bodies: {b: {type: beam, section: s, length: 1.0}}
sections: {s: {shape: circle, radius: 0.1}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [("length", "lenght"), ("1.0}}", "-1.0}}"), ("beam", "bean"), ("circle", "cicle"), ("duration: 1.0", ""),
     ("length: 1.0", "length: 1.0, elements: 0"), ("hfsim: 1", "hfsim: 2"), ("length: 1.0", "length: [1.0]")],
)  # fmt: skip
def test_it_refuses_slips(old, new):
    assert not list(wrong(yaml.safe_load(SLIP), whole()))
    assert list(wrong(yaml.safe_load(SLIP.replace(old, new)), whole()))


TABLE = SLIP + """
include: [parts.yaml]
parameters: {a: 2, b: 3 cm, c: "${a / 2}"}
loads:
  one: {type: force, at: b.tip, force: [0, 1], law: {table: motor.csv, column: torque, start: 0.5 s}}
  two: {type: force, at: b.tip, force: [0, "${a}"], law: {expression: "sin(a * t)"}}
"""


def test_it_takes_files_parameters_and_expressions():
    assert not list(wrong(yaml.safe_load(TABLE), whole()))
    assert list(wrong(yaml.safe_load(TABLE.replace("column", "colum")), whole()))


def beam():
    """The keys of a beam."""
    (found,) = [one for one in whole()["properties"]["bodies"]["additionalProperties"]["anyOf"] if "elements" in one["properties"]]
    return found["properties"]


@pytest.mark.parametrize("value", ["auto", 8, "${n + 1}"])
def test_elements_may_be_left_to_the_run(value):
    assert not list(wrong(value, beam()["elements"]))


def open_keys(schema):
    """The schema of entries under any name, empty where they may be anything or are not."""
    return schema["additionalProperties"] if isinstance(schema.get("additionalProperties"), dict) else {}


def keys(schema, path="deck"):
    """Yield every key of decks with its schema."""
    for number, one in enumerate(schema.get("anyOf", ())):
        yield from keys(one, f"{path}({number})")
    for key, one in schema.get("properties", {}).items():
        yield f"{path}.{key}", one
        yield from keys(one, f"{path}.{key}")
        yield from keys(open_keys(one), f"{path}.{key}")


def test_every_key_tells_what_it_is_and_what_it_may_be():
    found = dict(keys(whole()))
    assert len(found) > 120
    bare = [path for path, one in found.items() if "description" not in one]
    assert not bare
    assert not [path for path, one in found.items() if not set(one) - {"description", "default"}]
    units = [path for path, one in found.items() if re.search(r"\[(m|s|kg|N|Pa|rad)\]", one["description"])]
    assert not [path for path in units if "x-unit" not in str(found[path]) and found[path].get("type") != "string"]


def test_the_manual_has_them_all():
    """Written anew by ``python tests/deck_reference.py``."""
    page = deck_reference.page()
    assert deck_reference.PAGE.read_text() == page
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    assert len(rows) > 150
    assert all(cell.strip() for row in rows for cell in re.split(r"(?<!\\)\|", row)[1:-1])
