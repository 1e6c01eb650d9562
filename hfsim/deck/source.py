"""Deck text to plain data that remembers where every entry stands.

PyYAML follows YAML 1.1, where ``7e5`` is text, ``on`` is true and a repeated key silently wins. Decks follow
the YAML 1.2 core schema instead, and a repeated key is a problem.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import yaml

from hfsim.errors import DeckError, DeckProblem

Path = tuple[str | int, ...]
"""Keys and list indices from the top of a deck down to an entry."""

_BaseLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_TAG = "tag:yaml.org,2002:"
_SCALARS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+",
    "float": r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
}


class _DeckLoader(_BaseLoader):  # type: ignore[misc]
    """PyYAML's safe loader with the scalars of the YAML 1.2 core schema."""

    yaml_implicit_resolvers: dict[str | None, Any] = {}  # noqa: RUF012 (PyYAML's own convention)


for _name, _pattern in _SCALARS.items():
    _DeckLoader.add_implicit_resolver(_TAG + _name, re.compile(rf"(?:{_pattern})\Z"), None)


class Mark(NamedTuple):
    """Where a piece of text stands: line and column from 1, and its width."""

    line: int
    column: int
    width: int


@dataclass(frozen=True)
class OverrideProblem(DeckProblem):
    """A problem that came in by ``--set`` and so has no place in the file."""


class PlacedDeckError(DeckError):
    """Problems of a deck and of its overrides, each shown at the place it came from."""

    def _render_problem(self, problem: DeckProblem, lines: list[str]) -> str:
        if isinstance(problem, OverrideProblem):
            return super()._render_problem(problem, []).replace(self.file, "--set", 1)
        return super()._render_problem(problem, lines)


def dotted(path: Iterable[str | int]) -> str:
    """Return a path as users write it.

    Examples
    --------
    >>> dotted(("bodies", "b1", "length"))
    'bodies.b1.length'
    """
    return ".".join(str(step) for step in path)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return the known name most like a word as a question, or else the list of known names.

    Examples
    --------
    >>> did_you_mean("lenght", ["length", "width"])
    "did you mean 'length'?"
    >>> did_you_mean("colour", ["length", "width"])
    'known: length, width'
    """
    by_lower = {name.lower(): name for name in known}
    close = difflib.get_close_matches(word.lower(), list(by_lower), n=1)
    if close:
        return f"did you mean '{by_lower[close[0]]}'?"
    return f"known: {', '.join(by_lower.values())}" if by_lower else ""


@dataclass
class DeckSource:
    """A deck as it was written.

    Attributes
    ----------
    file : str
        Name of the file, as messages show it.
    text : str
        The file's text.
    data : dict
        Plain data of the deck, overrides applied.
    overrides : tuple of str
        The overrides as given, ``KEY=VALUE``.
    problems : list of DeckProblem
        Repeated keys, keys that are no text, overrides that lead nowhere.
    """

    file: str
    text: str
    data: dict[str, Any] = field(default_factory=dict)
    overrides: tuple[str, ...] = ()
    problems: list[DeckProblem] = field(default_factory=list)
    key_marks: dict[Path, Mark] = field(default_factory=dict, repr=False)
    value_marks: dict[Path, Mark] = field(default_factory=dict, repr=False)
    overridden: set[Path] = field(default_factory=set)

    def path_of(self, name: str) -> Path:
        """Return the path that a dotted name stands for; digits count list entries."""
        path: Path = ()
        here: Any = self.data
        for word in name.split("."):
            step: str | int = int(word) if isinstance(here, list) and word.isdecimal() else word
            here = _child(here, step)
            path += (step,)
        return path

    def is_overridden(self, path: Path) -> bool:
        """Tell whether an override set the entry or something that contains it."""
        return any(path[:depth] in self.overridden for depth in range(1, len(path) + 1))

    def mark(self, path: Path, on_key: bool = False) -> Mark | None:
        """Return where an entry stands, or where the nearest entry around it does.

        The value is marked where it starts on its key's line, otherwise the key.
        """
        if self.is_overridden(path):
            return None
        for depth in range(len(path), -1, -1):
            key, value = self.key_marks.get(path[:depth]), self.value_marks.get(path[:depth])
            inline = value is not None and (key is None or (value.line == key.line and value.width > 0))
            if value is not None and inline and not (on_key and key) and depth == len(path):
                return value
            if key is not None:
                return key
        return self.value_marks.get(())

    def problem(self, path: Path, message: str, hint: str = "", on_key: bool = False) -> DeckProblem:
        """Return a problem of the entry at a path, or of the value that stands for it, placed in the file."""
        while len(path) > 1 and not isinstance(_at(self.data, path[:-1]), dict | list):
            path = path[:-1]
        mark = self.mark(path, on_key)
        if self.is_overridden(path) or mark is None:
            return OverrideProblem(dotted(path), message, hint)
        return DeckProblem(dotted(path), message, hint, mark.line, mark.column, mark.width)

    def error(self, problems: Iterable[DeckProblem]) -> DeckError:
        """Return the exception that shows these problems in the order of the file."""
        ordered = sorted(problems, key=lambda one: (one.line == 0, one.line, one.column))
        return PlacedDeckError(self.file, ordered, self.text)


def read_source(path: str | FilePath, overrides: Sequence[str] = ()) -> DeckSource:
    """Read a deck file and apply overrides to it.

    Parameters
    ----------
    path : str or pathlib.Path
        The YAML file.
    overrides : sequence of str
        ``KEY=VALUE`` each, KEY dotted, VALUE in YAML.

    Raises
    ------
    DeckError
        The file cannot be read, or is no YAML.
    """
    file = str(path)
    try:
        text = FilePath(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise DeckError(file, [DeckProblem("", "is not UTF-8 text", f"byte {error.start}")]) from error
    except OSError as error:
        raise DeckError(file, [DeckProblem("", f"cannot be read: {error.strerror}")]) from error
    return parse_source(text, file, overrides)


def parse_source(text: str, file: str = "deck", overrides: Sequence[str] = ()) -> DeckSource:
    """Read a deck's text and apply overrides to it; see `read_source`."""
    reader = _parse(text)
    if isinstance(reader, DeckProblem):
        raise DeckError(file, [reader], text)
    if reader.data is None:
        raise DeckError(file, [DeckProblem("", "the deck is empty", "a deck starts with 'hfsim: 1'")])
    if not isinstance(reader.data, dict):
        problem = DeckProblem("", "a deck is a map of keys", "a deck starts with 'hfsim: 1'", 1, 1)
        raise DeckError(file, [problem], text)
    source = DeckSource(
        file, text, reader.data, tuple(overrides), reader.problems, reader.keys, reader.values
    )
    wrong = [_set_entry(source, override) for override in overrides]
    source.problems.extend(one for one in wrong if one is not None)
    return source


class _Reader:
    """Turns YAML nodes into plain data and notes where everything stands."""

    def __init__(self, node: yaml.Node | None) -> None:
        self.keys: dict[Path, Mark] = {}
        self.values: dict[Path, Mark] = {}
        self.problems: list[DeckProblem] = []
        self._open: list[yaml.Node] = []
        self.data: Any = None if node is None else self._read(node, ())

    def _read(self, node: yaml.Node, path: Path) -> Any:
        self.values[path] = _mark(node)
        if any(node is parent for parent in self._open):
            return self._refuse(node, path, "an alias cannot contain itself")
        self._open.append(node)
        try:
            if isinstance(node, yaml.MappingNode):
                return self._read_map(node, path)
            if isinstance(node, yaml.SequenceNode):
                return [self._read(item, (*path, index)) for index, item in enumerate(node.value)]
            return self._read_scalar(node, path)
        finally:
            self._open.pop()

    def _read_map(self, node: yaml.MappingNode, path: Path) -> dict[str, Any]:
        data: dict[str, Any] = {}
        merged: list[yaml.Node] = []
        lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            key = self._read_key(key_node, path)
            if key is None:
                continue
            if key in lines:
                message = f"repeated key, first given on line {lines[key]}"
                self._refuse(key_node, (*path, key), message, "keep one of the two")
                continue
            lines[key] = _mark(key_node).line
            if key == "<<" and not key_node.style:
                merged = value_node.value if isinstance(value_node, yaml.SequenceNode) else [value_node]
                continue
            self.keys[(*path, key)] = _mark(key_node)
            data[key] = self._read(value_node, (*path, key))
        for other in merged:
            self._merge(other, path, data)
        return data

    def _merge(self, node: yaml.Node, path: Path, data: dict[str, Any]) -> None:
        """Take over from another map the keys that are not given here."""
        if not isinstance(node, yaml.MappingNode):
            self._refuse(node, path, "'<<' takes a map or a list of maps")
            return
        other = _Reader(node)
        self.problems += [problem for problem in other.problems if problem not in self.problems]
        for key in other.data.keys() - data.keys():
            data[key] = other.data[key]
            for mine, theirs in ((self.keys, other.keys), (self.values, other.values)):
                mine.update({path + sub: mark for sub, mark in theirs.items() if sub[:1] == (key,)})

    def _read_key(self, node: yaml.Node, path: Path) -> str | None:
        if isinstance(node, yaml.ScalarNode) and node.tag == _TAG + "str":
            return str(node.value)
        shown = f"'{node.value}'" if isinstance(node, yaml.ScalarNode) and node.value else "this one"
        self._refuse(node, path, f"a key must be a name, {shown} is not", "names start with a letter")
        return None

    def _read_scalar(self, node: yaml.Node, path: Path) -> Any:
        kind = str(node.tag).removeprefix(_TAG)
        try:
            return _scalar(kind, str(node.value))
        except KeyError:
            return self._refuse(node, path, f"the tag {node.tag} is not supported")
        except ValueError:
            return self._refuse(node, path, f"'{node.value}' is no {kind}")

    def _refuse(self, node: yaml.Node, path: Path, message: str, hint: str = "") -> None:
        mark = _mark(node)
        self.problems.append(DeckProblem(dotted(path), message, hint, mark.line, mark.column, mark.width))


def _scalar(kind: str, text: str) -> Any:
    readers: dict[str, Callable[[], Any]] = {
        "null": lambda: None,
        "bool": lambda: text.lower() == "true",
        "int": lambda: _integer(text),
        "float": lambda: float(re.sub(r"\.(?=inf|nan)", "", text.lower())),
        "str": lambda: text,
    }
    return readers[kind]()


def _integer(text: str) -> int | float:
    """Return a whole number; one with more digits than a float holds is taken as a float."""
    if text.startswith(("0o", "0x")):
        return int(text, 0)
    return int(text) if len(text) < 20 else float(text)


def _mark(node: yaml.Node) -> Mark:
    start, end = node.start_mark, node.end_mark
    width = end.column - start.column if end.line == start.line else 1
    return Mark(start.line + 1, start.column + 1, width)


def _child(data: Any, step: str | int) -> Any:
    if isinstance(data, dict):
        return data.get(step)
    if isinstance(data, list) and isinstance(step, int) and step < len(data):
        return data[step]
    return None


def _parse(text: str) -> _Reader | DeckProblem:
    try:
        return _Reader(yaml.compose(text, Loader=_DeckLoader))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        return DeckProblem("", _syntax_message(error), _syntax_hint(text, line), line, column)
    except yaml.YAMLError as error:
        position = getattr(error, "position", None) or 0
        before = text[:position]
        line, column = before.count("\n") + 1, position - before.rfind("\n")
        return DeckProblem("", "a character that YAML does not allow", "", line, column)
    except RecursionError:
        return DeckProblem("", "nested too deeply")


def _syntax_message(error: yaml.MarkedYAMLError) -> str:
    parts = [part for part in (error.context, error.problem) if part]
    return "not valid YAML: " + ", ".join(parts)


def _syntax_hint(text: str, line: int) -> str:
    lines = text.splitlines()
    near = lines[max(0, line - 2) : line]
    return "indent with spaces, not tabs" if any("\t" in one for one in near) else ""


def _set_entry(source: DeckSource, override: str) -> OverrideProblem | None:
    """Set one entry of the data; return why it cannot be set."""
    name, equals, value = override.partition("=")
    name = name.strip()
    if not equals or not name:
        return OverrideProblem(name, f"'{override}' is no override", "write KEY=VALUE")
    reader = _parse(value)
    wrong = [reader] if isinstance(reader, DeckProblem) else reader.problems
    if isinstance(reader, DeckProblem) or wrong:
        return OverrideProblem(name, f"'{value}': {wrong[0].message}", wrong[0].hint)
    path = source.path_of(name)
    for depth in range(1, len(path)):
        if not _child_exists(source.data, path[:depth]):
            known = _at(source.data, path[: depth - 1])
            hint = did_you_mean(str(path[depth - 1]), known if isinstance(known, dict) else ())
            return OverrideProblem(name, f"there is no {dotted(path[:depth])} in the deck", hint)
    parent = _at(source.data, path[:-1])
    if isinstance(parent, list) and not _child_exists(source.data, path):
        return OverrideProblem(name, f"{dotted(path[:-1])} has {len(parent)} entries, counted from 0")
    if not isinstance(parent, dict | list):
        return OverrideProblem(name, f"{dotted(path[:-1])} is a value and has no entries")
    parent[path[-1]] = reader.data  # type: ignore[index]
    source.overridden.add(path)
    return None


def _at(data: Any, path: Path) -> Any:
    for step in path:
        data = _child(data, step)
    return data


def _child_exists(data: Any, path: Path) -> bool:
    parent = _at(data, path[:-1])
    if isinstance(parent, dict):
        return path[-1] in parent
    return isinstance(parent, list) and isinstance(path[-1], int) and path[-1] < len(parent)
