"""The folder of a sweep while it is done: every run at once, and at any time something to go on from.

``runs.jsonl`` gets a line for each run as it ends; ``sweep.csv`` is made of it, in the order of the plan.
"""

from __future__ import annotations

import json
import os
import time
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hfsim.deck.ranges import written
from hfsim.errors import HfsimError
from hfsim.marching.stop import SHIELD
from hfsim.output.disk import disk, write_bytes, write_json, write_whole
from hfsim.output.runfolder import SWEEP, FolderError, RunFolder, claim, folder_name
from hfsim.output.talk import Destination
from hfsim.output.writers import cell, differences, first_lines, json_ready
from hfsim.studies.sweep.plan import Plan
from hfsim.studies.sweep.work import FACTS, LOST, Row

RUNS = "runs.jsonl"
"""What is known of each run, in the order in which they ended."""
KIND = "sweep"
FOLDER_FILES = ("history.csv", "summary.json", "resolved.yaml", "run.log")
"""Files of the folder of a run that are kept."""
_SYNC = 1.0
"""Time between two waits for the disk [s]."""


class ResumeError(HfsimError):
    """A sweep that cannot be gone on with."""

    exit_code = 2


class SweepFolder:
    """A folder that gets the runs of a sweep.

    Parameters
    ----------
    folder : RunFolder
        Granted by `claim_sweep`.
    facts : mapping
        What the sweep is, JSON-ready: what must be the same when it is gone on with.
    resume : bool
        Whether what is there is gone on with.
    """

    def __init__(self, folder: RunFolder, plan: Plan, facts: Mapping[str, Any], resume: bool) -> None:
        self.folder, self.plan, self.facts, self.path = folder, plan, dict(facts), folder.path
        self.there = 0
        """Runs that were done before."""
        self._places = array("q", [-1]) * plan.count
        self._synced = time.monotonic()
        with disk(self.path):
            folder.inside = () if resume else folder.inside
            folder.prepare((RUNS, SWEEP) if resume else ())
            folder.stale = ()  # what comes now is new
            (self.path / RUNS).touch()
            self._file = os.open(self.path / RUNS, os.O_RDWR | getattr(os, "O_CLOEXEC", 0))
            self._end = self._read() if resume else 0
            os.ftruncate(self._file, self._end)
            told = {"status": "running", **self.facts, "files": [RUNS, SWEEP]}
            write_json(self.path / SWEEP, json_ready(told))

    def missing(self, number: int) -> bool:
        """Tell whether a run is yet to be done."""
        return self._places[number] < 0

    def add(self, number: int, row: Row, files: Mapping[str, bytes]) -> None:
        """Write what has come of a run.

        Raises
        ------
        WriteError
            If the system refuses.
        """
        with disk(self.path), SHIELD:
            for name, data in files.items():
                place = self.path / name.format(number=number + 1)
                place.parent.mkdir(parents=True, exist_ok=True)
                write_bytes(place, data)
            line = json.dumps({"run": number + 1, **row}, allow_nan=False, ensure_ascii=False) + "\n"
            text = line.encode()
            try:
                done = 0
                while done < len(text):
                    done += os.pwrite(self._file, text[done:], self._end + done)
            except OSError:
                os.ftruncate(self._file, self._end)
                raise
            self._places[number] = self._end
            self._end += len(text)
            if time.monotonic() >= self._synced + _SYNC:
                os.fsync(self._file)
                self._synced = time.monotonic()

    def _read(self) -> int:
        """Find out which runs are there; return where the last whole line ends."""
        end = 0
        with (self.path / RUNS).open("rb") as file:
            for line in file:
                if not line.endswith(b"\n"):
                    break
                try:
                    row = json.loads(line)
                    number = row["run"] - 1
                    known = 0 <= number < self.plan.count and row["status"] != LOST
                except (ValueError, KeyError, TypeError):
                    break
                if known:
                    self.there += self._places[number] < 0
                    self._places[number] = end
                end += len(line)
        return end

    def rows(self) -> Iterator[Row | None]:
        """Yield what is known of each run in the order of the plan; None of those that are missing."""
        with (self.path / RUNS).open("rb") as file:
            for place in self._places:
                if place < 0:
                    yield None
                    continue
                file.seek(place)
                yield json.loads(file.readline())

    def write_table(self, collected: Sequence[str]) -> None:
        """Write ``sweep.csv``: a row for each run that was done.

        Raises
        ------
        WriteError
            If the system refuses.
        """
        extra = ["mesh_error_estimate"] if self.facts["setting"].get("mesh_estimate") else []
        *early, last = FACTS
        head = ["run", *self.plan.paths, *collected, *early, *extra, last]

        def lines() -> Iterator[bytes]:
            yield (",".join(map(cell, head)) + "\n").encode()
            for number, row in enumerate(self.rows()):
                if row is not None:
                    values = [written(value) for value in self.plan.told(number)]
                    told = [row.get(key) for key in (*early, *extra, last)]
                    cells = map(cell, [number + 1, *values, *row["collected"], *told])
                    yield (",".join(cells) + "\n").encode()

        with disk(self.path):
            os.fsync(self._file)
            write_whole(self.path / "sweep.csv", lambda file: file.writelines(lines()))

    def close(self) -> None:
        """Let go of the folder."""
        os.close(self._file)
        self.folder.release()


def claim_sweep(to: Destination, name: str, resume: bool) -> tuple[RunFolder, bool]:
    """Ask for the folder of a sweep; return it, and whether there is a sweep to go on with.

    Raises
    ------
    FolderError
        If a sweep stands there and is neither to be gone on with nor to be replaced.
    """
    path = to.output or Path(folder_name(name, f".{KIND}"))
    there = (path / SWEEP).exists()
    if there and not (resume or to.force):
        what = "--resume does what is missing of it, --force replaces it, -o DIR goes elsewhere"
        raise FolderError(f"{path} already holds a sweep: {what}")
    return claim(path, to.force or (resume and there), SWEEP), resume and there


def refuse_changed(path: Path, facts: Mapping[str, Any]) -> None:
    """Refuse to go on with a sweep that was another one.

    Raises
    ------
    ResumeError
        With the differences.
    """
    try:
        old = json.loads((path / SWEEP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise ResumeError(f"{path} has no sweep to go on with") from None
    then = {key: old[key] for key in facts if key in old}
    if told := first_lines(differences(then, json_ready(facts))):
        raise ResumeError(f"{path} is another sweep:\n{told}\nuse --force without --resume to begin anew")
