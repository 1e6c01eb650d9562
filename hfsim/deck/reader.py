"""YAML text to plain data, with the place of every entry and bounds on what is read.

PyYAML follows YAML 1.1, where ``7e5`` is text, ``on`` is true and a repeated key silently wins. Decks follow
the YAML 1.2 core schema instead, and a repeated key is a problem.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from copy import copy
from functools import lru_cache
from typing import Any, NamedTuple

import yaml

from hfsim.errors import DeckProblem

Path = tuple[str | int, ...]
"""Keys and list indices from the top of a deck down to an entry."""

DEEPEST = 40
"""Lists and maps within one another; decks have six, and PyYAML's own recursion ends the program."""
_TOO_DEEP = f"lists and maps within one another, more than {DEEPEST} deep"
MOST_ENTRIES = 100_000
"""Entries of a deck, those of an alias counted wherever it stands."""
LARGEST = 4_000_000
"""Characters of a deck."""
_KNOWN, _SHORT = 32, 50_000
"""Texts that are not read again if they come again soon, and their most characters."""

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


_NUMBERS = {kind: re.compile(_SCALARS[kind]) for kind in ("int", "float")}


_WHOLE, _REST = re.compile(r"[-+]?[0-9]+"), re.compile(r"[0-9]+([eE][-+]?[0-9]+)?(\s*[^\s\d].*)?")
"""What stands before a decimal comma and after it, a unit included."""


class Mark(NamedTuple):
    """Where a piece of text stands: line and column from 1, width, and the file, empty for the deck's own."""

    line: int
    column: int
    width: int
    file: str = ""


def dotted(path: Iterable[str | int]) -> str:
    """Return a path as users write it.

    Examples
    --------
    >>> dotted(("bodies", "b1", "length"))
    'bodies.b1.length'
    """
    return ".".join(str(step) for step in path)


class Reader:
    """Turns YAML nodes into plain data and notes where everything stands.

    Attributes
    ----------
    data : object
        None where there is nothing.
    keys, values : dict
        Mark of each key and of each value.
    problems : list of DeckProblem
        Repeated keys, keys that are no text and the like; what several aliases show, once.
    """

    def __init__(self, node: yaml.Node | None) -> None:
        self.keys: dict[Path, Mark] = {}
        self.values: dict[Path, Mark] = {}
        self._problems: dict[tuple[Mark, str], DeckProblem] = {}
        self._open: list[yaml.Node] = []
        self.data: Any = None if node is None else self._read(node, ())

    @property
    def problems(self) -> list[DeckProblem]:
        """What is wrong, in the order of reading."""
        return list(self._problems.values())

    def copied(self) -> Reader:
        """Return the same with data and marks of its own."""
        made = copy(self)
        made.data, made.keys, made.values = _tree(self.data), dict(self.keys), dict(self.values)
        return made

    def _read(self, node: yaml.Node, path: Path) -> Any:
        self.values[path] = _mark(node)
        with self._opened(node, path) as fresh:
            if not fresh:
                return None
            if isinstance(node, yaml.MappingNode):
                data: dict[str, Any] = {}
                self._read_map(node, path, data)
                return data
            if isinstance(node, yaml.SequenceNode):
                return [self._read(item, (*path, index)) for index, item in enumerate(node.value)]
            return self._read_scalar(node, path)

    @contextmanager
    def _opened(self, node: yaml.Node, path: Path) -> Iterator[bool]:
        """Tell whether a node may be read: not inside itself."""
        fresh = not any(node is parent for parent in self._open)
        if not fresh:
            self._refuse(node, path, "an alias cannot contain itself")
        self._open.append(node)
        yield fresh
        self._open.pop()

    def _read_map(self, node: yaml.MappingNode, path: Path, data: dict[str, Any]) -> None:
        """Add the entries of a map to those read so far, which win."""
        merged: list[yaml.Node] = []
        lines: dict[str, int] = {}
        for at, (key_node, value_node) in enumerate(node.value):
            if at and node.flow_style and self._is_rest(node.value[at - 1], key_node, value_node, path):
                continue
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
            elif key not in data:
                self.keys[(*path, key)] = _mark(key_node)
                data[key] = self._read(value_node, (*path, key))
        for other in merged:
            self._merge(other, path, data)

    def _is_rest(
        self, before: tuple[yaml.Node, yaml.Node], key: yaml.Node, value: yaml.Node, path: Path
    ) -> bool:
        """Tell whether a key is what follows the decimal comma of a number, and refuse that."""
        name, number = before
        marks = number.end_mark, key.start_mark
        close = marks[0].line == marks[1].line and marks[0].column + 1 == marks[1].column
        if value.start_mark.index != value.end_mark.index or not close:
            return False
        if not (_WHOLE.fullmatch(str(number.value)) and _REST.fullmatch(str(key.value))):
            return False
        text, meant = (f"{number.value}{sign}{key.value}" for sign in ",.")
        mark = _mark(number)._replace(width=len(text))
        message = f"'{text}' is read as two entries"
        self._note(mark, (*path, str(name.value)), message, f"did you mean '{meant}'?")
        return True

    def _merge(self, node: yaml.Node, path: Path, data: dict[str, Any]) -> None:
        """Take over from another map the keys that are not given here."""
        if not isinstance(node, yaml.MappingNode):
            self._refuse(node, path, "'<<' takes a map or a list of maps")
            return
        with self._opened(node, path) as fresh:
            if fresh:
                self._read_map(node, path, data)

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
        self._note(_mark(node), path, message, hint)

    def _note(self, mark: Mark, path: Path, message: str, hint: str) -> None:
        problem = DeckProblem(dotted(path), message, hint, mark.line, mark.column, mark.width)
        self._problems.setdefault((mark, message), problem)


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
    if len(text) < 20:
        return int(text, 0) if text.startswith(("0o", "0x")) else int(text)
    if not text.startswith(("0o", "0x")):
        return float(text)
    try:
        return float(int(text, 0))
    except OverflowError:
        return float("inf")


def _mark(node: yaml.Node) -> Mark:
    start, end = node.start_mark, node.end_mark
    width = end.column - start.column if end.line == start.line else 1
    return Mark(start.line + 1, start.column + 1, width)


def parse(text: str) -> Reader | DeckProblem:
    """Return what some YAML says, or why it cannot be read; studies read one deck many times."""
    if len(text) > _SHORT:
        return _parsed(text)
    found = _known(text)
    return found.copied() if isinstance(found, Reader) and isinstance(found.data, dict | list) else found


def _tree(data: Any) -> Any:
    """Return a copy of plain data."""
    if isinstance(data, dict):
        return {key: _tree(value) for key, value in data.items()}
    return [_tree(value) for value in data] if isinstance(data, list) else data


def _parsed(text: str) -> Reader | DeckProblem:
    for kind, pattern in _NUMBERS.items():
        if pattern.fullmatch(text):  # what studies set, mostly
            start, end = (yaml.Mark("", 0, 0, column, None, 0) for column in (0, len(text)))
            return Reader(yaml.ScalarNode(_TAG + kind, text, start, end))
    if len(text) > LARGEST:
        return DeckProblem("", f"has {len(text)} characters, at most {LARGEST} are read", "", 1, 1)
    try:
        return _excess(text) or Reader(yaml.compose(text, Loader=_DeckLoader))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        return DeckProblem("", _syntax_message(error), _syntax_hint(text, line), line, column)
    except yaml.YAMLError as error:
        position = getattr(error, "position", None) or 0
        before = text[:position]
        line, column = before.count("\n") + 1, position - before.rfind("\n")
        return DeckProblem("", "a character that YAML does not allow", "", line, column)


_known = lru_cache(_KNOWN)(_parsed)


def _excess(text: str) -> DeckProblem | None:
    """Return where a text becomes too deep, or its entries too many, before either can do harm."""
    sizes: dict[str | None, int] = {}
    begun: list[tuple[str | None, int]] = []
    total = 0
    for event in yaml.parse(text, Loader=_DeckLoader):
        if isinstance(event, yaml.AliasEvent):
            total += sizes.get(event.anchor, 0)
        elif isinstance(event, yaml.CollectionStartEvent):
            begun.append((event.anchor, total))
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = begun.pop()
            sizes[anchor] = total - before
        total += isinstance(event, yaml.NodeEvent)
        wrong = ""
        if len(begun) > DEEPEST:
            wrong = _TOO_DEEP
        elif total > MOST_ENTRIES:
            wrong = f"more than {MOST_ENTRIES} entries, aliases counted in full"
        if wrong and event.start_mark is not None:
            return DeckProblem("", wrong, "", event.start_mark.line + 1, event.start_mark.column + 1)
    return None


def _syntax_message(error: yaml.MarkedYAMLError) -> str:
    if "nesting depth" in str(error.problem):  # PyYAML reads ahead, and has a limit of its own since 6.0.4
        return _TOO_DEEP
    parts = [part for part in (error.context, error.problem) if part]
    return "not valid YAML: " + ", ".join(parts)


def _syntax_hint(text: str, line: int) -> str:
    lines = text.splitlines()
    near = lines[max(0, line - 2) : line]
    if near and re.search(r"\w\{\w", near[-1]):
        return 'quote names with braces in brackets and lists: "blade{k}.root"'
    return "indent with spaces, not tabs" if any("\t" in one for one in near) else ""
