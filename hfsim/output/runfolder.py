"""Run folders: where results go, what may be overwritten, and in which order files are written.

``summary.json`` is written last and removed first, so a folder with one is whole. It lists the files
of its run; nothing but these is ever removed.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from hfsim.errors import HfsimError
from hfsim.output.writers import (
    Provenance,
    finite_part,
    summary_of,
    write_history,
    write_json,
    write_resolved,
)
from hfsim.run.clock import PhaseClock
from hfsim.run.solution import Run

SUMMARY = "summary.json"
_OWN_FILES = ("history.csv", SUMMARY, "resolved.yaml", "run.log")
_OWN_NAME = re.compile(r"(plots/)?[\w+-][\w.+-]*\.(csv|json|yaml|log|png)")
_UNFINISHED = ("failed", "interrupted")


class FolderError(HfsimError):
    """A folder that must not or cannot be written to; found before anything is computed."""

    exit_code = 2


class WriteError(HfsimError):
    """The disk refused a result (full, read-only, gone)."""

    exit_code = 1


@dataclass(frozen=True)
class RunFolder:
    """A folder whose use for new results was granted by `claim`.

    Attributes
    ----------
    path : Path
        The folder; it may not exist yet.
    replaces : str
        What stands there now and will be replaced, for a message; empty when nothing does.
    stale : tuple of str
        Files of the older run, relative to `path`; the one that tells it is whole comes first.
    """

    path: Path
    replaces: str = ""
    stale: tuple[str, ...] = ()

    def prepare(self) -> None:
        """Make the folder and remove the files of the older run, its summary first.

        Raises
        ------
        WriteError
            If the system refuses.
        """
        with disk(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            for name in self.stale:
                (self.path / name).unlink(missing_ok=True)


@dataclass
class Stopwatch(PhaseClock):
    """Phases of one job, beginning with the process itself.

    Attributes
    ----------
    cpu_start, wall_start : float
        Readings of ``time.process_time`` and ``time.perf_counter`` where the job began [s].
    """

    cpu_start: float = 0.0
    wall_start: float = field(default_factory=time.perf_counter)

    def added_to(self, run: Run) -> Run:
        """Return `run` with these phases and ``total`` (since the start) in its statistics."""
        total_cpu = time.process_time() - self.cpu_start
        total_wall = time.perf_counter() - self.wall_start
        times = {
            "cpu_s": {**(run.statistics.get("cpu_s") or {}), **self.cpu, "total": total_cpu},
            "wall_s": {**(run.statistics.get("wall_s") or {}), **self.wall, "total": total_wall},
        }
        return replace(run, statistics={**run.statistics, **times})


class RunLog:
    """Lines for ``run.log``, each with the time of day; told to `echo` as well under ``-v``."""

    def __init__(self, echo: Callable[[str], None] | None = None) -> None:
        self._echo = echo
        self._lines: list[str] = []

    def add(self, text: str) -> None:
        """Add one message."""
        self._lines.append(f"{time.strftime('%Y-%m-%d %H:%M:%S')}  {text}")
        if self._echo:
            self._echo(text)

    @property
    def text(self) -> str:
        """All lines so far."""
        return "\n".join(self._lines) + "\n"


def folder_name(deck_name: str, suffix: str) -> str:
    """Return the default folder name of a deck; a name can never lead out of the current folder.

    Examples
    --------
    >>> folder_name("two_beams", ".out")
    'two_beams.out'
    >>> folder_name("../a b", "")
    'a_b'
    """
    plain = re.sub(r"[^\w.+-]+", "_", deck_name).strip("._")
    return (plain or "run") + suffix


def claim(path: Path, force: bool, marker: str = SUMMARY) -> RunFolder:
    """Ask for a folder to write to, without changing anything yet.

    Parameters
    ----------
    path : Path
        Folder wanted.
    force : bool
        Allow the results of a finished run to be replaced.
    marker : str
        File whose presence means that a run there is whole.

    Returns
    -------
    RunFolder
        The folder with the files that are to go.

    Raises
    ------
    FolderError
        If a finished run or files of unknown origin stand there, or it cannot be written to.
    """
    _refuse_unwritable(path)
    present = _present(path, marker)
    if not present:
        return RunFolder(path)
    summary = _read_summary(path / marker)
    status = str(summary.get("status", "unknown"))
    if not force and status not in _UNFINISHED:
        holds = "a finished run" if (path / marker).exists() else present[0]
        raise FolderError(
            f"{path} already holds {holds}; use --force to replace it, or -o DIR to go elsewhere"
        )
    stale = tuple(name for name in _listed_files(summary, marker) if (path / name).is_file())
    return RunFolder(path, replaces=f"a run with status {status}", stale=stale)


def _present(path: Path, marker: str) -> list[str]:
    """Return the results of a run or of a study in a folder; those of other studies tell who wrote them."""
    names = (*_OWN_FILES, marker.replace(".json", ".csv"), marker)
    studies = (file for file in sorted(path.glob("*.json")) if _read_summary(file).get("versions"))
    return [name for name in names if (path / name).exists()] or [file.name for file in studies]


def _refuse_unwritable(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise FolderError(f"{path} is a file, not a folder")
    nearest = next(place for place in (path, *path.absolute().parents) if place.exists())
    if not nearest.is_dir():
        raise FolderError(f"{path} cannot be made: {nearest} is a file")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise FolderError(f"{path} cannot be written to: no permission in {nearest}")


def _read_summary(path: Path) -> dict[str, Any]:
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return summary if isinstance(summary, dict) else {}


def _listed_files(summary: dict[str, Any], marker: str) -> Iterable[str]:
    # the list comes from a file anybody may have edited: only plain names of our own kinds count
    listed = summary.get("files")
    names = [name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []
    return dict.fromkeys([marker, *filter(_OWN_NAME.fullmatch, names)])


@contextmanager
def disk(path: Path) -> Iterator[None]:
    """Turn what the system refuses inside the block into a `WriteError` about `path`."""
    try:
        yield
    except OSError as error:
        place = error.filename or path
        raise WriteError(f"cannot write {place}: {error.strerror or error}") from error


def save_run(
    folder: RunFolder, run: Run, provenance: Provenance, watch: Stopwatch, log: RunLog, plots: bool = True
) -> tuple[Run, dict[str, Any]]:
    """Write everything a run leaves behind; ``summary.json`` comes last.

    Parameters
    ----------
    folder : RunFolder
        From `claim`.
    run : Run
        As the simulation gave it; non-finite rows are dropped here.
    provenance : Provenance
        Where it comes from.
    watch : Stopwatch
        Gets the phases ``write`` and ``plots``.
    log : RunLog
        Becomes ``run.log``.
    plots : bool
        Draw pictures too.

    Returns
    -------
    Run
        What was written: shorter than `run` if something was not finite.
    dict
        The summary.

    Raises
    ------
    WriteError
        If the disk refuses; there is no ``summary.json`` then.
    """
    run = finite_part(run)
    folder.prepare()
    with disk(folder.path), watch.phase("write"):
        write_history(folder.path / "history.csv", run)
        write_resolved(folder.path / "resolved.yaml", provenance, run.model)
    files = ["history.csv", "resolved.yaml", "run.log", SUMMARY]
    if plots:
        with disk(folder.path), watch.phase("plots"):
            files += _draw(run, folder.path / "plots")
    run = watch.added_to(run)
    with disk(folder.path):
        summary = summary_of(run, provenance, files)
        _log_end(log, summary)
        (folder.path / "run.log").write_text(log.text, encoding="utf-8")
        write_json(folder.path / SUMMARY, summary)
    return run, summary


def _draw(run: Run, folder: Path) -> list[str]:
    from hfsim.output.plots import draw_run  # half a second of matplotlib, for those who want pictures

    return [f"{folder.name}/{name}" for name in draw_run(run, folder)]


def _log_end(log: RunLog, summary: dict[str, Any]) -> None:
    for note in (summary.get("assembly") or {}).get("notes", ()):
        log.add(note)
    for warning in summary["warnings"]:
        log.add(f"warning: {warning}")
    for key in ("steps", "rejected", "newton_iterations", "energy_drift", "error_estimate", "cpu_s"):
        if summary[key] is not None:
            log.add(f"{key}: {summary[key]}")
    reason = f": {summary['reason']}" if summary["reason"] else ""
    log.add(f"{summary['status']} at t = {summary['end_time']:.9g} s{reason}")
