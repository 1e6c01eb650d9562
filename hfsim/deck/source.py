"""A deck as it was written: its data, overrides of it, and where every entry stands in the file."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import field
from functools import partial
from itertools import islice
from pathlib import Path as FilePath
from pathlib import PurePath
from typing import Any, Protocol, TypeVar

from hfsim.deck.reader import LARGEST, Mark, Path, dotted, parse
from hfsim.errors import MOST_PROBLEMS, ArgumentError, DeckError, DeckProblem
from hfsim.maths.frozen import mutable

COMPARED = 200
"""Known names that a misspelt one is compared with."""
LONGEST_WORD = 64
"""Characters of a word that may be a misspelt name."""
_MISSPELT = 0.8
"""Likeness from which a word is a known name misspelt, though it shares parts with others."""
_ON = "did you mean 'on'? YAML 1.1, as PyYAML has it, reads that as true: quote it"
_LISTED = 20
"""Known names that a message lists."""
MOST_BYTES = 4 * LARGEST + 4
"""Bytes read of a file: the characters of too large a deck are too many then, whatever their size."""
_INDEX = re.compile(r"[0-9]{1,9}")
_RANGE = re.compile(r"\{\s*(\w+)\s*=[^{}]*\}")
"""Braces with the range of an index."""


class _Placed(Protocol):
    @property
    def path(self) -> Path: ...


_Complaint = TypeVar("_Complaint", bound=_Placed)


class Setting(str):
    """An override, ``KEY=VALUE``, and the option of the command line that it was given by."""

    option = "--set"

    @classmethod
    def by(cls, option: str, text: str) -> Setting:
        """Return the override that an option stands for."""
        one = cls(text)
        one.option = option
        return one


class OverrideProblem(DeckProblem):
    """A problem that came in by an option, in `file`, or else ``--set``, and so has no place in the file."""

    def headline(self, file: str, kind: str = "error") -> str:
        """Return the same of the command line."""
        return super().headline("--set", kind)


def nearest(word: str, known: Iterable[str], likeness: float = 0.6) -> str:
    """Return the known name most like a word, from a likeness up to 1; none is like a very long one."""
    import difflib

    by_lower = {name.lower(): name for name in islice(known, COMPARED)}
    like = partial(difflib.get_close_matches, n=1, cutoff=likeness)
    close = like(word.lower(), by_lower) if len(word) <= LONGEST_WORD else []
    return by_lower[close[0]] if close else ""


def near_file(path: PurePath, others: Iterable[str]) -> str:
    """Return, with the folder of a path, the file that its name is most like but for its ending.

    Examples
    --------
    >>> near_file(PurePath("parts/rotor.yaml"), ["arm.yaml", "rotors.yaml"])
    'parts/rotors.yaml'
    >>> near_file(PurePath("rotor.yaml"), ["arm.yaml"])
    ''
    """
    stems = {PurePath(one).stem: one for one in others}
    close = nearest(path.stem, stems)
    return str(path.with_name(stems[close])) if close else ""


def _parts(name: str) -> set[str]:
    return set(re.split("[_/]", name.lower()))


def likely(word: str, known: Collection[str]) -> list[str]:
    """Return the known names that a word may mean: that which it misspells, or all that share a part."""
    parts = _parts(word)
    sharing = [name for name in islice(known, COMPARED) if parts & _parts(name)]
    close = nearest(word, known, _MISSPELT) if 1 < len(sharing) <= _LISTED else nearest(word, known)
    return [close] if close else sharing[:_LISTED]


def did_you_mean(word: str, known: Collection[str]) -> str:
    """Return the known names that a word may mean as a question, or else the known names.

    Examples
    --------
    >>> did_you_mean("lenght", ["length", "width"])
    "did you mean 'length'?"
    >>> did_you_mean("damping", ["density", "axial_damping", "bending_damping"])
    "did you mean 'axial_damping' or 'bending_damping'?"
    >>> did_you_mean("colour", ["length", "width"])
    'known: length, width'
    """
    if word == "true" and "on" in known:
        return _ON
    if close := [f"'{name}'" for name in likely(word, known)]:
        *others, last = close
        return f"did you mean {', '.join(others)}{' or ' if others else ''}{last}?"
    more = [f"and {len(known) - _LISTED} more"] if len(known) > _LISTED else []
    return f"known: {', '.join([*islice(known, _LISTED), *more])}" if known else ""


def refuse_unknown(kind: str, given: Iterable[str], known: Iterable[str], more: str = "") -> None:
    """Refuse names that are not known.

    Raises
    ------
    ArgumentError
        Naming the first unknown one and the nearest known one, or all of these.
    """
    for name in given:
        if name not in known:
            close = nearest(name, known)
            hint = f" (did you mean '{close}'?)" if close else f"; there are {', '.join(known)}{more}"
            raise ArgumentError(f"there is no {kind} '{name}'{hint}")


@mutable
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
    overridden : dict of tuple to str
        Options by the paths that they set.
    failed : set of tuple
        Paths of entries that could not be worked out, and of lists of such: nothing else is said of them.
    others : dict of str to str
        Texts of other files that belong to the deck, by their names as messages show them.
    patterns : dict of tuple to str or int
        Last steps of the paths that copies of patterns stand at in the file, by their own paths.
    indices : dict of tuple to dict
        Indices by name of each copy of a pattern, by its path.
    as_written : dict of tuple to list
        Lists of what is written and collected, by their paths, before patterns in them were copied.
    known : dict of str to float
        Values of the parameters.
    """

    file: str
    text: str
    data: dict[str, Any] = field(default_factory=dict)
    overrides: tuple[str, ...] = ()
    problems: list[DeckProblem] = field(default_factory=list)
    key_marks: dict[Path, Mark] = field(default_factory=dict, repr=False)
    value_marks: dict[Path, Mark] = field(default_factory=dict, repr=False)
    overridden: dict[Path, str] = field(default_factory=dict)
    failed: set[Path] = field(default_factory=set)
    others: dict[str, str] = field(default_factory=dict, repr=False)
    patterns: dict[Path, str | int] = field(default_factory=dict, repr=False)
    indices: dict[Path, dict[str, float]] = field(default_factory=dict, repr=False)
    as_written: dict[Path, list[Any]] = field(default_factory=dict, repr=False)
    known: dict[str, float] = field(default_factory=dict, repr=False)

    @property
    def texts(self) -> dict[str, str]:
        """All files of the deck by their names, its own among them; none where the deck is all."""
        return {self.file: self.text, **self.others} if self.others else {}

    def path_of(self, name: str) -> Path:
        """Return the path that a dotted name stands for; digits count list entries."""
        return path_in(self.data, name)

    def paths_of(self, name: str) -> list[Path]:
        """Return the paths of all copies that a dotted name stands for where it names patterns."""
        found: list[Path] = [()]
        for word in name.split("."):
            found = [(*path, step) for path in found for step in self._steps(path, word)]
        return found

    def _steps(self, path: Path, word: str) -> list[str | int]:
        around = entry_at(self.data, path)
        if "{" in word and isinstance(around, dict) and word not in around:
            made_of = {key: str(self.patterns.get((*path, key), "")) for key in around}
            return [key for key, pattern in made_of.items() if without_ranges(pattern) == word]
        return [int(word) if isinstance(around, list) and _INDEX.fullmatch(word) else word]

    def is_overridden(self, path: Path) -> bool:
        """Tell whether an override set the entry or something that contains it."""
        return bool(self.option_of(path))

    def option_of(self, path: Path) -> str:
        """Return the option that set the entry or something that contains it; empty where none did."""
        both = dict.fromkeys((self._counted(path), self.written(path)))
        there = (self.overridden.get(one[:depth]) for one in both for depth in range(1, len(path) + 1))
        return next(filter(None, there), "")

    def written(self, path: Path) -> Path:
        """Return the path at which the file has an entry: inside the pattern for one in a copy."""
        if not self.patterns:
            return path
        return tuple(self.patterns.get(path[: depth + 1], step) for depth, step in enumerate(path))

    def _counted(self, path: Path) -> Path:
        """Return the path with entries of lists counted as in the file."""
        both = zip(path, self.written(path), strict=True)
        return tuple(there if isinstance(there, int) else own for own, there in both)

    def once(self, complaints: Iterable[_Complaint]) -> Iterator[_Complaint]:
        """Yield complaints; of those at one place of a pattern the first."""
        told: set[Path] = set()
        for one in complaints:
            at = self.written(one.path)
            if not self.patterns or at not in told:
                told.add(at)
                yield one

    def mark(self, path: Path, on_key: bool = False) -> Mark | None:
        """Return where an entry stands, or where the nearest entry around it does.

        The value is marked where it starts on its key's line, otherwise the key.
        """
        if self.is_overridden(path):
            return None
        at = self.written(path)
        for depth in range(len(path), -1, -1):
            both = self.key_marks, self.value_marks
            key, value = (marks.get(at[:depth]) or marks.get(path[:depth]) for marks in both)
            inline = value is not None and (key is None or (value.line == key.line and value.width > 0))
            if value is not None and inline and not (on_key and key) and depth == len(path):
                return value
            if key is not None:
                return key
        return self.value_marks.get(())

    def problem(self, path: Path, message: str, hint: str = "", on_key: bool = False) -> DeckProblem:
        """Return a problem of the entry at a path, or of the value that stands for it, placed in the file."""
        while (
            len(path) > 1
            and not isinstance(entry_at(self.data, path[:-1]), dict | list)
            and path not in self.value_marks
        ):
            path = path[:-1]
        copies = (self.indices.get(path[:depth], {}) for depth in range(1, len(path) + 1))
        if which := ", ".join(f"{name} = {value:g}" for one in copies for name, value in one.items()):
            message += f" (at {which})"
        mark = self.mark(path, on_key)
        name = dotted(self._counted(path))
        if self.is_overridden(path) or mark is None:
            return OverrideProblem(name, message, hint, file=self.option_of(path))
        return DeckProblem(name, message, hint, *mark)

    def fail(self, path: Path, problem: DeckProblem | None = None) -> None:
        """Note that an entry could not be worked out, and why if that has not been said."""
        at = self.written(path)
        told = at != path and at in self.failed  # of another copy
        if problem is not None and not told and len(self.problems) <= MOST_PROBLEMS:
            self.problems.append(problem)
        self.failed.update((path, at))
        while path and isinstance(path[-1], int):
            path = path[:-1]
            self.failed.add(path)

    def has_failed(self, path: Path) -> bool:
        """Tell whether an entry, or one around it, could not be worked out."""
        return any(path[:depth] in self.failed for depth in range(1, len(path) + 1))

    def error(self, problems: Iterable[DeckProblem]) -> DeckError:
        """Return the exception that shows these problems in the order of the file."""
        ordered = sorted(problems, key=lambda one: (one.line == 0, one.file, one.line, one.column))
        return DeckError(self.file, ordered, self.text, self.others)


def read_source(path: str | FilePath) -> DeckSource:
    """Read a deck file.

    Raises
    ------
    DeckError
        The file cannot be read, or is no YAML.
    """
    return parse_source(read_bytes(path), str(path))


def read_bytes(path: str | FilePath) -> bytes:
    """Return what is in a deck file, as far as a deck may go.

    Raises
    ------
    DeckError
        It cannot be read.
    """
    try:
        with FilePath(path).open("rb") as deck:
            return deck.read(MOST_BYTES)
    except OSError as error:
        raise DeckError(str(path), [DeckProblem("", f"cannot be read: {error.strerror}")]) from error


def _decoded(data: bytes, file: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DeckError(file, [_not_text(data, error.start)]) from error


def _not_text(data: bytes, start: int) -> DeckProblem:
    line_start = data.rfind(b"\n", 0, start) + 1
    column = len(data[line_start:start].decode("utf-8", "replace")) + 1
    return DeckProblem("", "is not UTF-8 text", f"byte {start}", data.count(b"\n", 0, start) + 1, column)


def parse_source(text: str | bytes, file: str = "deck") -> DeckSource:
    """Read a deck's text; see `read_source`."""
    if isinstance(text, bytes):
        text = _decoded(text, file)
    reader = parse(text)
    if isinstance(reader, DeckProblem):
        raise DeckError(file, [reader], text)
    if reader.data is None:
        raise DeckError(file, [DeckProblem("", "the deck is empty", "a deck starts with 'hfsim: 1'")])
    if not isinstance(reader.data, dict):
        problem = DeckProblem("", "a deck is a map of keys", "a deck starts with 'hfsim: 1'", 1, 1)
        raise DeckError(file, [problem], text)
    return DeckSource(file, text, reader.data, (), reader.problems, reader.keys, reader.values)


def _child(data: Any, step: str | int) -> Any:
    if isinstance(data, dict):
        return data.get(step)
    if isinstance(data, list) and isinstance(step, int) and step < len(data):
        return data[step]
    return None


def path_in(data: Any, name: str) -> Path:
    """Return the path that a dotted name stands for in plain data; digits count list entries.

    A pattern is named without the range of its index; where there are its copies, it is the first of them.
    """
    path: Path = ()
    for word in name.split("."):
        step: str | int = int(word) if isinstance(data, list) and _INDEX.fullmatch(word) else word
        if "{" in word and isinstance(data, dict) and word not in data:
            meant = [key for key in data if without_ranges(key) == word]
            step = next(iter(meant or (key for key in data if is_copy(key, word))), word)
        data = _child(data, step)
        path += (step,)
    return path


def without_ranges(pattern: str) -> str:
    """Return a pattern as other entries name it, ``blade{k}``."""
    return _RANGE.sub(r"{\1}", pattern)


def is_copy(name: str, pattern: str) -> bool:
    """Tell whether a name is that of a copy of a pattern, whatever the range of its index.

    Examples
    --------
    >>> is_copy("blade2", "blade{k=1..4}"), is_copy("blade", "blade{k=1..4}")
    (True, False)
    """
    pieces = re.split(r"\{[^{}]*\}", pattern)
    return len(pieces) > 1 and bool(re.fullmatch("-?[0-9]+".join(map(re.escape, pieces)), name))


def entry_at(data: Any, path: Path) -> Any:
    """Return what stands at a path of plain data, None where there is nothing."""
    for step in path:
        data = _child(data, step)
    return data
