"""Entries of a deck that are set from outside: by ``--set``, by rows of studies and by sweeps."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import NamesOf
from hfsim.deck.reader import Path, dotted, parse
from hfsim.deck.source import (
    DeckSource,
    OverrideProblem,
    Setting,
    did_you_mean,
    entry_at,
    is_copy,
    path_in,
    without_ranges,
)
from hfsim.deck.spec import OneOf, ReadBy, Spec, at
from hfsim.deck.units import SI_UNITS
from hfsim.errors import DeckProblem


def why_no_text(word: str) -> str:
    """Return why a word from the command line is no text, if so: Python makes surrogates of other bytes."""
    if not any("\ud800" <= char <= "\udfff" for char in word):
        return ""
    try:
        os.fsencode(word).decode()
    except UnicodeError:
        return "is not UTF-8 text, as it must be"
    return "is UTF-8 text, but the encoding of the locale is another: set PYTHONUTF8=1"


def override(source: DeckSource, overrides: Sequence[str], spec: type[Spec]) -> None:
    """Set entries of a deck; what cannot be set is among its problems.

    Parameters
    ----------
    overrides : sequence of str
        ``KEY=VALUE`` each, KEY dotted, VALUE in YAML; ``KEY=null`` takes an entry out.
    spec : type
        The class of whole decks.
    """
    source.overrides += tuple(overrides)
    wrong = [_set_entry(source, one, spec) for one in overrides]
    source.problems.extend(one for one in wrong if one is not None)


def of_copies(data: Any, overrides: Sequence[str]) -> list[str]:
    """Return those overrides that set what only is there once patterns have been copied."""
    return [one for one in overrides if _names_copy(data, path_in(data, one.partition("=")[0].strip()))]


def _names_copy(data: Any, path: Path) -> bool:
    for depth, step in enumerate(path):
        known = entry_at(data, path[:depth])
        if isinstance(known, dict) and step not in known:
            return any(is_copy(str(step), key) for key in known)
    return False


def _set_entry(source: DeckSource, override: str, spec: type[Spec]) -> OverrideProblem | None:
    """Set one entry of the data; return why it cannot be set."""
    name, equals, value = override.partition("=")
    name, option = name.strip(), getattr(override, "option", Setting.option)
    if no_text := why_no_text(override):
        return OverrideProblem(name, no_text, file=option)
    if not equals or not name:
        return OverrideProblem(name, f"'{override}' is no override", "write KEY=VALUE", file=option)
    if name.count("{") > name.count("}"):
        message = "a pattern is named without its range"
        return OverrideProblem(name, message, "bodies.blade{k}.length=2", file=option)
    if not value.strip():
        return OverrideProblem(name, "has no value", f"{name}=null takes it out", file=option)
    reader = parse(value)
    wrong = [reader] if isinstance(reader, DeckProblem) else reader.problems
    if isinstance(reader, DeckProblem) or wrong:
        return OverrideProblem(name, f"'{value}': {wrong[0].message}", wrong[0].hint, file=option)
    path = source.path_of(name)
    if _is_of_several(source.data, name, path):
        return OverrideProblem(name, "several patterns are called so", "name copies, blade2", file=option)
    goes = reader.data is None and not isinstance(entry_at(source.data, path[:-1]), list)
    known = goes and _may_stand(source.data, path, spec)
    if not known and (why := why_unset(source.data, name, spec)):
        return OverrideProblem(name, why[0], why[1], file=option)
    if name.count("{") > dotted(path).count("{"):
        return OverrideProblem(name, *_no_pattern(source, name, path), file=option)
    if goes:
        return _take_out(source, path, OverrideProblem(name, "", file=option), known)
    parent: Any = source.data
    for depth, step in enumerate(path[:-1], 1):
        if entry_at(source.data, path[:depth]) is None:
            parent[step] = {}
            source.overridden[path[:depth]] = option
        parent = parent[step]
    parent[path[-1]] = reader.data
    source.overridden[path] = option
    return None


def _no_pattern(source: DeckSource, name: str, path: Path) -> tuple[str, str]:
    """Return why a dotted name with braces is that of no pattern, and what would be."""
    copies = [depth for depth in range(1, len(path) + 1) if path[:depth] in source.patterns]
    if not copies or "{" not in name.split(".")[copies[-1] - 1]:
        return "the deck has no such pattern", ""
    inner = ".".join(map(str, path[: copies[-1]]))
    return "in a copy there are copies of what is inside", f"name one, {inner}, or the patterns of all"


def _is_of_several(data: Any, name: str, path: Path) -> bool:
    """Tell whether a part of a dotted name is that of several patterns, which differ in their ranges."""
    for depth, word in enumerate(name.split(".")):
        around = entry_at(data, path[:depth]) if "{" in word else None
        if isinstance(around, dict) and [without_ranges(key) for key in around].count(word) > 1:
            return True
    return False


def _take_out(source: DeckSource, path: Path, place: OverrideProblem, known: bool) -> OverrideProblem | None:
    """Take an entry out of the data, if it is there; return why it cannot be one of the deck."""
    parent = entry_at(source.data, path[:-1]) or {}
    if path[-1] not in parent and not known:
        why = f"there is no {dotted(path)} in the deck"
        return replace(place, message=why, hint=did_you_mean(str(path[-1]), parent))
    parent.pop(path[-1], None)
    source.overridden[path] = place.file
    return None


def _may_stand(data: dict[str, Any], path: Path, spec: type[Spec]) -> bool:
    """Tell whether decks may have an entry at a path: its keys are known, and names are those of this one."""
    for depth, key in enumerate(path):
        around = entry_at(data, path[:depth])
        if not isinstance(around, dict | None):
            return False
        if not (around and key in around) and key not in _keys_at(data, path[:depth], spec):
            return False
    return True


def _keys_at(data: dict[str, Any], path: Path, spec: type[Spec]) -> set[Any]:
    """Return the keys with a meaning of what may stand at a path."""
    kinds = _kinds_at(spec, path, all_fields=True)[0]
    found = {key for kind in kinds if get_origin(kind) is not dict for key in kind.fields_by_key()}
    info = _field_at(spec, path[0]) if len(path) == 1 else None
    for mark in info.metadata if info else ():
        if isinstance(mark, NamesOf):
            found |= {*mark.words, *(name for one in mark.maps for name in data.get(one) or ())}
    return found


def why_unset(data: Any, name: str, spec: type[Spec]) -> tuple[str, str] | None:
    """Return why nothing can be set at a dotted name in plain data and what would be; None if it can.

    Maps that may be left out need not be there.
    """
    path = path_in(data, name)
    for depth in range(1, len(path)):
        if entry_at(data, path[:depth]) is None and not is_optional_map(spec, path[:depth]):
            known = entry_at(data, path[: depth - 1])
            names = [without_ranges(key) for key in known] if isinstance(known, dict) else []
            hint = did_you_mean(str(path[depth - 1]), names)
            return f"there is no {dotted(path[:depth])} in the deck", hint
    parent = entry_at(data, path[:-1])
    if isinstance(parent, list) and not (isinstance(path[-1], int) and path[-1] < len(parent)):
        return f"{dotted(path[:-1])} has {len(parent)} entries, counted from 0", ""
    if not isinstance(parent, dict | list | None):
        return f"{dotted(path[:-1])} is a value and has no entries", ""
    return None


def is_optional_map(spec: type[Spec], path: Path) -> bool:
    """Tell whether decks may leave out the entry at a path, and it is a map where they do not.

    An entry under a name of its own is one if nothing in it must be stated.
    """
    kinds, named = _kinds_at(spec, path)
    must = (any(info.is_required() for info in kind.model_fields.values()) for kind in kinds if named)
    return bool(kinds) and not (named and all(must))


def left_empty(source: DeckSource, spec: type[Spec]) -> Iterator[Complaint]:
    """Yield the keys of values inside entries that a deck has and gives nothing.

    Those of maps may be: all their entries may be commented out.
    """
    for path, mark in source.value_marks.items():
        stated = mark.width or entry_at(source.data, path) is not None or source.is_overridden(path)
        if stated or len(path) < 2 or _kinds_at(spec, path)[0]:
            continue
        around = (kind for kind in _kinds_at(spec, path[:-1])[0] if get_origin(kind) is not dict)
        if any(path[-1] in kind.fields_by_key() for kind in around):
            yield Complaint(path, "is empty", "give it a value, or leave the key out")


def _kinds_at(spec: type[Spec], path: Path, all_fields: bool = False) -> tuple[list[Any], bool]:
    """Return the classes of maps that may stand at a path, and whether under a name of the deck's own.

    Without all fields, parameters that nothing uses and what studies make of a deck are none.
    """
    kinds: list[Any] = [spec]
    named = False
    for step in path:
        inner, named = list[Any](), False
        for kind in kinds:
            if get_origin(kind) is dict:
                named = True
                inner += _maps_of(get_args(kind)[1])
                continue
            info = _field_at(kind, step)
            if info is not None and (all_fields or not info.exclude):
                inner += _maps_of(Annotated[info.annotation, None, *info.metadata])
        kinds = inner
    return kinds, named


def _maps_of(kind: Any) -> Iterator[Any]:
    """Yield the classes of entries, and the maps of names, that a field may have."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        read = [one for one in parts[1:] if isinstance(one, ReadBy | OneOf)]
        entries = read[0].shape.get("entries", ()) if read else ()
        yield from (at(one) if isinstance(one, str) else one for one in entries)
        if not read:
            yield from _maps_of(parts[0])
    elif origin in (Union, UnionType):
        for one in parts:
            yield from _maps_of(one)
    elif origin is dict or (isinstance(kind, type) and issubclass(kind, Spec)):
        yield kind


def unit_of(entry: Any, path: Path) -> str:
    """Return the SI unit of the number at a path of an entry that was read; empty where it has none.

    Examples
    --------
    >>> from hfsim.deck.materials import MaterialSpec
    >>> unit_of({"steel": MaterialSpec(density=7800, youngs_modulus=2.1e11)}, ("steel", "youngs_modulus"))
    'Pa'
    """
    for step in path[:-1]:
        if isinstance(entry, Spec):
            entry = getattr(entry, entry.fields_by_key().get(step, ""), None)
        else:
            entry = entry.get(step) if isinstance(entry, dict) else None
    if not isinstance(entry, Spec):
        return ""
    info = _field_at(type(entry), path[-1])
    units = () if info is None else _units_of(Annotated[info.annotation, None, *info.metadata])
    return next(iter(units), "").strip("-")


def _field_at(spec: type[Spec], key: Any) -> Any:
    """Return what is known of the field with a key in decks; None if there is none."""
    return spec.model_fields.get(spec.fields_by_key().get(key, ""))


def _units_of(kind: Any) -> Iterator[str]:
    """Yield the units of quantities that a field may be."""
    for one in get_args(kind):
        if isinstance(one, ReadBy):
            if "quantity" in one.shape:
                yield SI_UNITS[one.shape["quantity"]]
        else:
            yield from _units_of(one)
