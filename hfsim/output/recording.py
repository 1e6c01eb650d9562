"""The folder of a run while it is written: every row at once, and at any time something to go on from."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext, suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from hfsim.errors import INTERRUPTIONS, LimitReached, interruption_code
from hfsim.integrators import Memory
from hfsim.marching.solution import Run
from hfsim.marching.stop import SHIELD
from hfsim.output.checkpoint import CHECKPOINT, Checkpoint, put_down
from hfsim.output.disk import Beginning, History, WriteError, disk, keep_room, write_json
from hfsim.output.extras import Extras, add_extras
from hfsim.output.runfolder import SUMMARY, RunFolder, RunLog, Stopwatch
from hfsim.output.writers import Provenance, running_summary, summary_of, write_resolved
from hfsim.simulate import AFTER_ITS_END

if TYPE_CHECKING:
    from numpy import ndarray

EVERY = 30.0
"""Time between two checkpoints [s]."""
_RESUMABLE = ("interrupted", "limit")


class Recording:
    """What becomes of a run in its folder; a `hfsim.marching.record.Sink`.

    Parameters
    ----------
    folder : RunFolder
        Granted by `claim`; touched as soon as the scene is assembled.
    name, model : str
        As of `Run`.
    watch : Stopwatch
        Gets the phases ``write`` and ``plots``.
    checkpoint : Checkpoint, optional
        From where an older run in this folder goes on.
    """

    def __init__(
        self,
        folder: RunFolder,
        name: str,
        model: str,
        provenance: Provenance,
        watch: Stopwatch,
        log: RunLog,
        checkpoint: Checkpoint | None = None,
    ) -> None:
        self.folder, self.provenance, self._log = folder, provenance, log
        self._name, self._model, self._watch = name, model, watch
        self._from = checkpoint
        self._history: History | None = None
        self._before = self._there = len(checkpoint.memory["table"]) if checkpoint else 0
        """Rows that were in the file already; those of them that are yet to come once more."""
        self._memory: Callable[[], Memory] | None = None
        self._kept = Beginning()
        self._next = time.monotonic() + EVERY
        self._full = self._ended = False
        self.path = folder.path

    # --- while it runs ---------------------------------------------------------------------------

    def begin(self, channels: Iterable[str]) -> None:
        """Make the folder with all that is known before the first step; what ends the run meanwhile waits."""
        with disk(self.path), self._watch.phase("write"), SHIELD:
            summary = running_summary(self._name, self._model, self.provenance)
            self.folder.prepare(("history.csv", CHECKPOINT) if self._from else (), summary)
            after = self._from and self._from.there
            self._history = History(self.path / "history.csv", tuple(channels), after)
            write_resolved(self.path / "resolved.yaml", self.provenance, self._model)
            self._log.to(self.path / "run.log", append=self._from is not None)
            keep_room(self.path / SUMMARY)

    def rows(self, table: ndarray) -> None:
        """Write the next rows."""
        old = min(self._there, len(table))
        self._there -= old
        if self._history is None or self._full or old == len(table):
            return
        with self._watch.phase("write"):
            try:
                self._history.add(table[old:])
            except OSError as error:
                self._full = True
                why = f"cannot write {self.path / 'history.csv'}: {error.strerror}"
                raise LimitReached(f"{why}; its last rows are missing") from error

    def block(self, memory: Callable[[], Memory]) -> None:
        """Keep in mind from where the run can go on; put it down now and then."""
        if self._history is None or self._full:
            return
        self._memory, self._kept = memory, self._history.there
        if time.monotonic() >= self._next:
            self._put_down()
            self._next = time.monotonic() + EVERY

    def _put_down(self) -> None:
        if self._memory is None or self._history is None:
            return
        with self._watch.phase("write"):
            try:
                self._history.sync()
                put_down(self.path, self._memory(), self._kept, self.provenance)
            except OSError as error:
                self._log.add(f"no checkpoint was written: {error.strerror}")

    def abandon(self, error: BaseException) -> None:
        """Say in the folder why there are no results: interrupted outside its steps, or gone wrong."""
        if self._history is None or self._ended:
            self._release()
            return
        if isinstance(error, KeyboardInterrupt):
            told = {"status": "interrupted", "reason": "interrupted", "exit_code": interruption_code(error)}
            self._put_down()
        else:
            told = {"status": "failed", "reason": f"{type(error).__name__}: {error}", "exit_code": 1}
        with disk(self.path):
            summary = running_summary(self._name, self._model, self.provenance)
            write_json(self.path / SUMMARY, {**summary, **told})
        self._release()

    def take(self, run: Run, provenance: Provenance) -> None:
        """Write the rows of a run that was chosen among several, and the deck that gives it."""
        self.provenance = provenance
        self.rows(run.table)
        with disk(self.path), self._watch.phase("write"):
            write_resolved(self.path / "resolved.yaml", provenance, run.model)

    # --- when it has ended -----------------------------------------------------------------------

    def solved(self, run: Run) -> None:
        """Write what the run itself has given, before anything else is found out about it.

        Raises
        ------
        WriteError
            If the system refuses.
        """
        self._ended = True
        if run.status in _RESUMABLE:
            self._put_down()
        with disk(self.path), self._watch.phase("write"):
            if self._history is not None:
                self._history.sync()
            # if this is the last that is written of it, what is to be done after it is missing
            missing = {"reason": AFTER_ITS_END, "exit_code": None} if run.status == "done" else {}
            self._summarise(self._on_disk(run), (), missing)

    def finish(self, run: Run, wanted: Extras) -> tuple[Run, dict[str, Any]]:
        """Make what is wanted beside, write the last summary; return the run as it is told there, and that.

        Raises
        ------
        WriteError
            If the system refuses.
        """
        try:
            run = self._on_disk(run)
            hurried = self._full or run.exit_code in INTERRUPTIONS
            run, files = add_extras(run, Extras() if hurried else wanted, self.path, self._watch)
            full = run.status == "done" and run.exit_code == WriteError.exit_code
            cut_off = full or (run.status == "done" and run.exit_code in INTERRUPTIONS)
            if cut_off:
                self._put_down()
            run = self._watch.added_to(run)
            with disk(self.path):
                if not (cut_off or run.status in _RESUMABLE):
                    (self.path / CHECKPOINT).unlink(missing_ok=True)
                summary = self._summarise(run, files, {"exit_code": None} if full else {})
                self._log.end(summary)
        finally:
            self._release()
        return run, summary

    def _release(self) -> None:
        if self._history is not None:
            self._history.close()
        self.folder.release()

    def _on_disk(self, run: Run) -> Run:
        """Return a run with those rows that could be written, at which it ends."""
        if self._history is None or not self._full:
            return run
        rows = self._before + self._history.rows
        channels = tuple(one._replace(values=one.values[:rows]) for one in run.channels)
        run = replace(run, t=run.t[:rows], channels=channels)
        return replace(run, reached=run.end_time)

    def _summarise(self, run: Run, extra: Iterable[str], told: Mapping[str, Any] = {}) -> dict[str, Any]:
        files = ["history.csv", "resolved.yaml", "run.log", SUMMARY, *extra]
        if (self.path / CHECKPOINT).exists():
            files.append(CHECKPOINT)
        summary = {**summary_of(run, self.provenance, files), **told}
        with suppress(OSError) if self._full else nullcontext():  # that the disk is full is told already
            write_json(self.path / SUMMARY, summary)
        return summary


def save_run(
    folder: RunFolder, run: Run, provenance: Provenance, watch: Stopwatch, log: RunLog, wanted: Extras
) -> tuple[Run, dict[str, Any]]:
    """Write all of a run that has ended; as `Recording.finish`. A signal costs only what is beside it."""
    recording = Recording(folder, run.name, run.model, provenance, watch, log)
    with SHIELD:
        recording.begin([channel.name for channel in run.channels])
        recording.rows(run.table)
        if wanted.any:
            recording.solved(run)
    return recording.finish(run, wanted)
