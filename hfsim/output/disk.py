"""Files that are whole or not there, whatever happens while they are written."""

from __future__ import annotations

import errno
import json
import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from hfsim.errors import HfsimError
from hfsim.marching.stop import SHIELD
from hfsim.maths.arrays import slices

_BLOCK = 4096
"""Rows turned into text at a time: bounds the memory a long history needs."""
ROOM = 1 << 16
"""Bytes that are kept for a file, several times those of a common summary."""
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)


class WriteError(HfsimError):
    """The disk refused a result (full, read-only, gone)."""

    exit_code = 1


def is_full(error: BaseException) -> bool:
    """Tell whether what the system refuses is room on the disk."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def disk(path: Path) -> Iterator[None]:
    """Turn what the system refuses inside the block into a `WriteError` about `path`."""
    try:
        yield
    except OSError as error:
        place = error.filename or path
        raise WriteError(f"cannot write {place}: {error.strerror or error}") from error


def write_whole(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a file in one move: what stood there before stays until all of the new one is on disk.

    Raises
    ------
    OSError
        If the system refuses; nothing of the new file is left then.
    """
    draft = _draft_of(path)
    with SHIELD:
        draft.unlink(missing_ok=True)
        try:
            with os.fdopen(os.open(draft, _NEW, 0o666), "wb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(draft, path)
        except BaseException:
            draft.unlink(missing_ok=True)
            raise


def _draft_of(path: Path) -> Path:
    return path.with_name(f".{path.name}.part")


def keep_room(path: Path) -> None:
    """Take room on the disk for a file to be written in one move, so that a full disk takes it."""
    draft = _draft_of(path)
    with suppress(OSError), SHIELD:  # what there is of it
        draft.unlink(missing_ok=True)
        with os.fdopen(os.open(draft, _NEW, 0o666), "wb") as file:
            file.write(bytes(ROOM))


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file of some bytes in one move."""
    write_whole(path, lambda file: file.write(data))


def write_text(path: Path, text: str) -> None:
    """Write a text file in one move."""
    write_bytes(path, text.encode())


def write_json(path: Path, facts: Mapping[str, Any]) -> None:
    """Write `facts` as JSON in one move.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    write_text(path, json.dumps(facts, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


class Beginning(NamedTuple):
    """The first bytes of a file.

    Attributes
    ----------
    size : int
        How many.
    crc : int
        Their CRC-32.
    """

    size: int = 0
    crc: int = 0


class History:
    """A CSV file that grows while its rows are computed.

    Parameters
    ----------
    names : sequence of str
        Of the columns after ``t``.
    after : Beginning, optional
        Of an older file, to go on from; what comes behind is cut off. Without it a new one is made.

    Attributes
    ----------
    there : Beginning
        The whole rows in the file.
    rows : int
        Of them, those that were added to it here.
    """

    def __init__(self, path: Path, names: Sequence[str], after: Beginning | None = None) -> None:
        flags = _NEW if after is None else (_NEW & ~os.O_CREAT & ~os.O_EXCL)
        self._file = os.open(path, flags, 0o666)
        self.there, self.rows = after or Beginning(), 0
        os.ftruncate(self._file, self.there.size)
        os.lseek(self._file, 0, os.SEEK_END)
        if after is None:
            self._write(",".join(["t", *names]) + "\n")
            self.rows = 0

    def add(self, table: np.ndarray) -> None:
        """Write rows, shape (n_rows, 1 + n_names); numbers are the shortest text that reads back exactly.

        Raises
        ------
        ValueError
            If a value is not finite; nothing is written then.
        OSError
            If the system refuses; those whole rows that it took are in the file then.
        """
        if not np.isfinite(table).all():
            raise ValueError("a non-finite value must not be written")
        for some in slices(len(table), _BLOCK):
            self._write("".join(rows_as_text(table[some].tolist())))

    def _write(self, text: str) -> None:
        data, done = text.encode(), 0
        try:
            with SHIELD:
                while done < len(data):
                    done += os.write(self._file, memoryview(data)[done:])
        except OSError:
            done = data.rfind(b"\n", 0, done) + 1
            os.ftruncate(self._file, self.there.size + done)
            raise
        finally:
            size, crc = self.there
            self.there = Beginning(size + done, zlib.crc32(memoryview(data)[:done], crc))
            self.rows += data.count(b"\n", 0, done)

    def sync(self) -> None:
        """Wait until the rows are on disk."""
        os.fsync(self._file)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


def rows_as_text(rows: Iterable[Sequence[float]]) -> Iterable[str]:
    """Return a line of CSV for each row."""
    # repr of a Python float is the shortest text that reads back as the same number
    return (",".join(map(repr, row)) + "\n" for row in rows)


def read_history(path: Path, there: Beginning) -> np.ndarray:
    """Return the rows with which a history begins, shape (n_rows, n_columns).

    Raises
    ------
    OSError, ValueError
        If it cannot be read, or begins otherwise.
    """
    with path.open("rb") as file:
        data = file.read(there.size)
    if len(data) < there.size:
        raise ValueError(f"{path} has {len(data)} of the {there.size} bytes that are counted on")
    if zlib.crc32(data) != there.crc:
        raise ValueError(f"{path} was changed: its first {there.size} bytes are not those that were written")
    lines = data.decode().splitlines()
    width = lines[0].count(",") + 1
    return np.array([float(x) for line in lines[1:] for x in line.split(",")]).reshape(-1, width)
