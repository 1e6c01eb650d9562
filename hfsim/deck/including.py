"""Parts of a deck that stand in other files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from hfsim.deck.files import FileRefusedError, Folder, Text, placed
from hfsim.deck.reader import MOST_ENTRIES, Mark, Path, Reader, dotted, parse
from hfsim.deck.source import DeckSource
from hfsim.errors import MOST_PROBLEMS, DeckProblem

INCLUDE = "include"


def include(source: DeckSource, folder: Folder) -> None:
    """Add to a deck what the files that it includes say.

    Raises
    ------
    DeckError
        If one cannot be read, or says what another one says: what follows from that is not worth telling.
    """
    including, before = _Including(source, folder), len(source.problems)
    including.add(source.data.pop(INCLUDE), source.value_marks, (folder.deck,), "")
    if len(source.problems) > before:
        raise source.error(source.problems)


@dataclass
class _Including:
    """Adds files to a deck, each once.

    Attributes
    ----------
    done : set of str
        Files that have been added.
    """

    source: DeckSource
    folder: Folder
    done: set[str] = field(default_factory=set)

    def add(self, wanted: Any, marks: dict[Path, Mark], inside: tuple[str, ...], beside: str) -> None:
        """Add the files that an entry names, and those that they name.

        Parameters
        ----------
        wanted : object
            The entry.
        marks : dict
            Where it stands.
        inside : tuple of str
            The files that are being added.
        beside : str
            The one that names them; empty for the deck.
        """
        for path, name in _listed(wanted):
            try:
                file = self.folder.read(name, beside)
            except FileRefusedError as error:
                self._refuse(placed(marks.get(path), dotted(path), error.message, error.hint))
                continue
            if file.real in inside:
                self._refuse(placed(marks.get(path), dotted(path), f"{file.name} includes itself"))
            elif file.real not in self.done:
                self.done.add(file.real)
                self._add_file(file, inside)

    def _add_file(self, file: Text, inside: tuple[str, ...]) -> None:
        source, reader = self.source, parse(file.text)
        source.others[file.name] = file.text
        if isinstance(reader, DeckProblem):
            self._refuse(replace(reader, file=file.name))
            return
        for problem in reader.problems:
            self._refuse(replace(problem, file=file.name))
        if len(source.value_marks) + len(reader.values) > MOST_ENTRIES:
            self._refuse(DeckProblem("", f"more than {MOST_ENTRIES} entries in all", "", 1, 1, 1, file.name))
            return
        if not isinstance(reader.data, dict):
            message = "a part of a deck is a map of keys"
            self._refuse(DeckProblem("", message, "e.g. materials: {...}", 1, 1, 1, file.name))
            return
        keys, values = _of_file(reader, file.name)
        wanted = reader.data.pop(INCLUDE, None)
        self._merge(source.data, reader.data, (), keys)
        for marks, more in ((source.key_marks, keys), (source.value_marks, values)):
            marks.update({path: mark for path, mark in more.items() if path not in marks})
        self.add(wanted, values, (*inside, file.real), file.name)

    def _merge(self, own: dict[str, Any], other: dict[str, Any], path: Path, keys: dict[Path, Mark]) -> None:
        """Add the entries of a map to those of another, map by map; refuse what both say."""
        for key, value in other.items():
            here, mine = (*path, key), own.get(key)
            if mine is None:
                own[key] = value
            elif isinstance(mine, dict) and isinstance(value, dict):
                self._merge(mine, value, here, keys)
            elif value is not None and not self._may_differ(here, mine, value):
                there = self.source.mark(here, on_key=True)
                where = f"line {there.line} of {there.file or self.source.file}" if there else "the deck"
                message = f"stands in {where} too"
                self._refuse(placed(keys.get(here), dotted(here), message, "keep one of the two"))

    def _may_differ(self, path: Path, mine: Any, value: Any) -> bool:
        """Tell whether what the deck has counts: its own parameters do, and the format is the same."""
        if path == ("hfsim",):
            return bool(mine == value)
        mark = self.source.mark(path, on_key=True)
        return len(path) == 2 and path[0] == "parameters" and mark is not None and not mark.file

    def _refuse(self, problem: DeckProblem) -> None:
        if len(self.source.problems) <= MOST_PROBLEMS:
            self.source.problems.append(problem)


def _of_file(reader: Reader, name: str) -> tuple[dict[Path, Mark], dict[Path, Mark]]:
    """Return the marks of keys and values of a file."""
    both = (reader.keys, reader.values)
    keys, values = ({path: mark._replace(file=name) for path, mark in marks.items()} for marks in both)
    return keys, values


def _listed(wanted: Any) -> Iterator[tuple[Path, Any]]:
    """Yield the names in an entry with their paths."""
    if isinstance(wanted, list):
        yield from (((INCLUDE, index), name) for index, name in enumerate(wanted))
    elif wanted is not None:
        yield (INCLUDE,), wanted
