"""The history of a run as CSV to a stream, rows as they come: for pipes, without a folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TextIO

import numpy as np

from hfsim.errors import LimitReached
from hfsim.integrators import Memory
from hfsim.marching.solution import Run
from hfsim.output.disk import rows_as_text
from hfsim.output.writers import Provenance


class Stream:
    """Where the rows of a run go; a `hfsim.marching.record.Sink`.

    Parameters
    ----------
    stream : TextIO
        Standard output; when its reader goes away, the run ends there.
    """

    def __init__(self, stream: TextIO, provenance: Provenance) -> None:
        self.provenance = provenance
        self._stream = stream
        self._headed = False

    def begin(self, channels: Iterable[str]) -> None:
        """Write the names of the columns, once."""
        if not self._headed:
            self._headed = True
            self._write([",".join(["t", *channels]) + "\n"])

    def rows(self, table: np.ndarray) -> None:
        """Write the next rows."""
        self._write(rows_as_text(table.tolist()))

    def block(self, memory: Callable[[], Memory]) -> None:
        """Take up nothing: what goes to a stream cannot be gone on with."""

    def solved(self, run: Run) -> None:
        """Take note of the end: all rows have been written."""

    def take(self, run: Run, provenance: Provenance) -> None:
        """Write the rows of a run that was chosen among several."""
        self.provenance = provenance
        self.rows(run.table)

    def _write(self, lines: Iterable[str]) -> None:
        try:
            self._stream.writelines(lines)
            self._stream.flush()
        except OSError as error:
            raise LimitReached(f"standard output takes no more rows: {error.strerror}") from error
