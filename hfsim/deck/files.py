"""Files beside a deck: parts that it includes and tables; none outside its folder is ever opened."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import NamedTuple

from hfsim.deck.reader import LARGEST, Mark
from hfsim.deck.source import near_file
from hfsim.errors import DeckProblem

MOST_FILES = 100
"""Files of a deck."""
_LONGEST = 255
"""Characters of a file's name."""


_sent: dict[str, str] = {}
"""Texts of files that came with a job, by their names: they stand for files."""


@contextmanager
def sent(texts: Mapping[str, str]) -> Iterator[None]:
    """Let texts stand for files of these names inside the block."""
    _sent.update(texts)
    try:
        yield
    finally:
        _sent.clear()


class FileRefusedError(Exception):
    """A file that cannot be read; ``hint`` says what would be right."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


class Text(NamedTuple):
    """What stands in a file.

    Attributes
    ----------
    name : str
        As messages show it.
    real : str
        Its one path, whatever it was called.
    """

    name: str
    text: str
    real: str


class Folder:
    """The folder of a deck.

    Parameters
    ----------
    deck : str
        File of the deck; where there is none of that name, there is no folder.
    """

    def __init__(self, deck: str) -> None:
        self.deck = os.path.realpath(deck)
        self._path = Path(deck).parent if deck in _sent or os.path.isfile(deck) else None
        self._left, self._read = LARGEST, 0

    def read(self, name: object, beside: str = "") -> Text:
        """Return the text of a file.

        Parameters
        ----------
        name : object
            Its path, as the deck has it.
        beside : str
            The file that names it, whose folder the path counts from; empty for the deck.

        Raises
        ------
        FileRefusedError
            If it is none inside the folder, or too large.
        """
        if self._path is None:
            why = "a deck that is no file has no folder, and so no other files"
            raise FileRefusedError(why, "save the deck beside them")
        folder = Path(beside).parent if beside else self._path
        if isinstance(name, str) and (found := _sent.get(str(folder / name))) is not None:
            return Text(str(folder / name), found, str(folder / name))
        path = self._inside(name, folder)
        self._read += 1
        if self._read > MOST_FILES:
            raise FileRefusedError(f"more than {MOST_FILES} files")
        try:
            with open(path, "rb") as file:
                data = file.read(4 * self._left + 4)
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            raise FileRefusedError(f"{path} is not UTF-8 text (line {line})") from error
        except OSError as error:
            raise FileRefusedError(f"{path} cannot be read: {error.strerror}") from error
        self._left -= len(text)
        if self._left < 0:
            raise FileRefusedError(f"the files of a deck have at most {LARGEST} characters together")
        return Text(str(path), text, os.path.realpath(path))

    def _inside(self, name: object, folder: Path) -> Path:
        """Return the path of a file, if that is one inside the deck's folder."""
        assert self._path is not None
        if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > _LONGEST:
            raise FileRefusedError("must be the name of a file in the deck's folder")
        plain = PurePosixPath(name)
        absolute = plain.is_absolute() or PureWindowsPath(name).drive or "\\" in name
        if absolute or ".." in plain.parts:
            why = "must stay inside the deck's folder"
            raise FileRefusedError(why, "a path such as parts/arm.yaml, without .. and not absolute")
        path, root = folder / plain, os.path.realpath(self._path)
        try:
            real = os.path.realpath(path)
            if os.path.commonpath([real, root]) != root:
                raise FileRefusedError(f"{path} is a link that leads out of the deck's folder")
            if not os.path.isfile(real):
                if os.path.exists(real):
                    raise FileRefusedError(f"{path} is no file")
                raise FileRefusedError(f"{path} is not there", _near(path, plain))
        except (OSError, ValueError) as error:
            raise FileRefusedError(f"'{name}' is no name of a file") from error
        return path


def _near(path: Path, name: PurePosixPath) -> str:
    """Return which file beside a path may be meant by a name, as a question."""
    try:
        others = sorted(one.name for one in path.parent.iterdir() if one.suffix == path.suffix)
    except OSError:
        return ""
    close = near_file(name, others)
    return f"did you mean '{close}'?" if close else ""


def placed(mark: Mark | None, path: str, message: str, hint: str = "") -> DeckProblem:
    """Return a problem at a place; without one, at the beginning of the deck."""
    return DeckProblem(path, message, hint, *(mark or Mark(1, 1, 1)))
