"""Run folders: where results go, what may be overwritten, and in which order files are written.

``summary.json`` tells how far its run has come: it is there from the first step on, and replaced in one move.
It lists the files of its run; nothing but these is ever removed.
"""

from __future__ import annotations

import errno
import json
import os
import re
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from hfsim.errors import HfsimError
from hfsim.marching.clock import PhaseClock
from hfsim.marching.solution import Run
from hfsim.maths.frozen import mutable
from hfsim.output.disk import disk, write_json
from hfsim.output.text import printable

SUMMARY = "summary.json"
COMPARISON = "compare.json"
SWEEP = "sweep.json"
_OWN_FILES = ("history.csv", SUMMARY, "resolved.yaml", "run.log", "checkpoint.npz")
_INNER = ("plots", "vtk")
_OWN_NAME = re.compile(
    rf"(({'|'.join(_INNER)})/)?[\w+-][\w.+-]*\.(csv|jsonl?|yaml|log|png|svg|pdf|gif|html|npz|pvd|vtu)"
)
_UNFINISHED = ("failed", "interrupted", "running")


class FolderError(HfsimError):
    """A folder that must not or cannot be written to; found before anything is computed."""

    exit_code = 2


@mutable
class RunFolder:
    """A folder whose use for new results was granted by `claim`.

    Attributes
    ----------
    path : Path
        The folder; it may not exist yet.
    replaces : str
        What stands there now and will be replaced, for a message; empty when nothing does.
    stale : tuple of str
        Files of the older run, relative to `path`; the one that tells of it comes first.
    inside : tuple of RunFolder
        Folders inside with what an older study has kept of its runs; that goes too, once.
    """

    path: Path
    replaces: str = ""
    stale: tuple[str, ...] = ()
    inside: tuple[RunFolder, ...] = ()
    _lock: int | None = None

    def prepare(self, keep: Sequence[str] = (), summary: Mapping[str, Any] | None = None) -> None:
        """Make the folder, hold it against other processes, and remove the files of the older run.

        A summary of the new run takes the place of the old one first: at no time are there files that none
        of the two lists. What an older study has inside goes before the file that tells of it.

        Raises
        ------
        FolderError
            If another process writes there.
        WriteError
            If the system refuses.
        """
        with disk(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(self.path) if self._lock is None else self._lock
            if summary is not None:
                files = list(dict.fromkeys([*summary["files"], *self.stale]))
                write_json(self.path / SUMMARY, {**summary, "files": files})
                keep = (*keep, SUMMARY)
            inside, self.inside = self.inside, ()
            for one in inside:
                one.remove()
            gone = [name for name in self.stale if name not in keep]
            for name in gone:
                (self.path / name).unlink(missing_ok=True)
            for parent in {Path(name).parent for name in gone} - {Path()}:
                with suppress(OSError):  # somebody else's files are there
                    (self.path / parent).rmdir()

    def remove(self) -> None:
        """Remove the files of the older run, and the folders that are empty then."""
        self.prepare()
        with suppress(OSError):
            self.path.rmdir()
        self.release()

    def release(self) -> None:
        """Let other processes write there again."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _locked(path: Path) -> int | None:
    """Return what holds a folder until it is closed or this process ends; None where none can be held.

    Raises
    ------
    FolderError
        If another process holds it.
    """
    try:
        import fcntl
    except ImportError:  # not on this system
        return None
    held = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(held)
        if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
            return None
        raise FolderError(f"another hfsim is writing to {path}; use -o DIR to go elsewhere") from None
    return held


@mutable
class Stopwatch(PhaseClock):
    """Phases of one job, beginning with the process itself.

    Attributes
    ----------
    cpu_start, wall_start : float
        Readings of ``time.process_time`` and ``time.perf_counter`` where the job began [s].
    """

    cpu_start: float = 0.0
    wall_start: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        if not self.cpu_start:  # what there was before belongs to the job
            self.cpu["start_up"] = time.process_time()
            self.wall["start_up"] = time.perf_counter() - self.wall_start

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
        self._path: Path | None = None

    def to(self, path: Path, append: bool = False) -> None:
        """Write all lines so far, and from now on each one as it comes."""
        if not append:
            path.unlink(missing_ok=True)
        self._path = path
        self._write(self._lines)

    def add(self, text: str) -> None:
        """Add one message."""
        self._lines.append(f"{time.strftime('%Y-%m-%d %H:%M:%S')}  {printable(text)}")
        if self._path is not None:
            self._write(self._lines[-1:])
        if self._echo:
            self._echo(text)

    def _write(self, lines: Iterable[str]) -> None:
        assert self._path is not None
        # on a full disk it is no result that is lost
        with suppress(OSError), self._path.open("a", encoding="utf-8") as file:
            file.write("".join(f"{line}\n" for line in lines))

    def end(self, summary: Mapping[str, Any]) -> None:
        """Add what a run has come to."""
        for note in (summary.get("assembly") or {}).get("notes", ()):
            self.add(note)
        for warning in summary["warnings"]:
            self.add(f"warning: {warning}")
        errors = ("energy_drift", "error_estimate", "mesh_error_estimate")
        for key in ("steps", "rejected", "newton_iterations", *errors, "cpu_s"):
            if summary[key] is not None:
                self.add(f"{key}: {summary[key]}")
        reason = f": {summary['reason']}" if summary["reason"] else ""
        self.add(f"{summary['status']} at t = {summary['stop_time']:.9g} s{reason}")


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
        Allow the results of a finished run to be replaced, and those of any study.
    marker : str
        File whose presence means that a run there is whole.

    Returns
    -------
    RunFolder
        The folder with the files that are to go.

    Raises
    ------
    FolderError
        If a finished run or files of unknown origin stand there, or it cannot be written to, or another
        process writes there.
    """
    if str(path) == "-":
        raise FolderError(
            "only results of hfsim run and static, alone, go to standard output; name a folder with -o"
        )
    refuse_unwritable(path)
    with _reached(path):
        if path.is_dir() and (held := _locked(path)) is not None:
            os.close(held)
        present = _present(path, marker)
    if not present:
        return RunFolder(path)
    summary = read_summary(path, marker)
    status = str(summary.get("status", "unknown"))
    if not force and status not in _UNFINISHED:
        holds = "a finished run" if (path / marker).exists() else present[0]
        raise FolderError(
            f"{path} already holds {holds}; use --force to replace it, or -o DIR to go elsewhere"
        )
    studies = dict.fromkeys([marker, *(_studies(path) if force else ())])
    inside = tuple(_inside(path, studies))
    return RunFolder(path, f"a run with status {status}", _stale(path, studies), inside)


def _stale(path: Path, markers: Iterable[str]) -> tuple[str, ...]:
    """Return the files in a folder of the runs and studies that some files tell of, these first."""
    first, *others = markers
    told = {one: _listed_files(read_summary(path, one)) for one in others}
    theirs = (name for one, names in told.items() if one in names for name in names)
    listed = dict.fromkeys([first, *_listed_files(read_summary(path, first)), *theirs, *_OWN_FILES])
    return tuple(name for name in listed if os.path.lexists(path / name))


def _inside(path: Path, studies: Collection[str]) -> Iterator[RunFolder]:
    """Yield the folders inside that of some studies with what they kept of runs, inner ones first."""
    models = read_summary(path, COMPARISON).get("models") if COMPARISON in studies else None
    plain = filter(re.compile(r"\w+").fullmatch, models if isinstance(models, dict) else ())
    runs = [path / name for name in plain]
    kept = {}
    if SWEEP in studies:
        kept = {path / "runs": (), path / "histories": _names(path, "histories/[0-9]*.csv")}
        runs += [path / "runs" / name for name in _names(path, "runs/[0-9]*")]
    every = {**{one: _stale(one, [SUMMARY]) for one in runs}, **kept}
    # a link leads to what was put elsewhere on purpose
    own = (one for one in every if one.is_dir() and not one.is_symlink())
    yield from (RunFolder(one, stale=every[one]) for one in own)


def _names(path: Path, pattern: str) -> tuple[str, ...]:
    return tuple(one.name for one in path.glob(pattern) if not one.parent.is_symlink())


def _present(path: Path, marker: str) -> list[str]:
    """Return the results of a run or of a study in a folder; those of other studies tell who wrote them."""
    names = (*_OWN_FILES, marker.replace(".json", ".csv"), marker)
    return [name for name in names if os.path.lexists(path / name)] or _studies(path)


def _studies(path: Path) -> list[str]:
    """Return the files in a folder that tell of a run or a study, of whatever kind."""
    every = {file.name: read_summary(path, file.name).get("versions") for file in sorted(path.glob("*.json"))}
    return [name for name, made in every.items() if isinstance(made, dict) and "hfsim" in made]


@contextmanager
def _reached(path: Path) -> Iterator[None]:
    """Turn what the system refuses inside the block into a `FolderError` about a folder."""
    try:
        yield
    except OSError as error:
        raise FolderError(f"cannot write to {path}: {error.strerror}") from error


def refuse_unwritable(path: Path) -> None:
    """Refuse a folder that cannot be made or written to: raise `FolderError`."""
    with _reached(path):
        if path.exists() and not path.is_dir():
            raise FolderError(f"{path} is a file, not a folder")
        nearest = next(place for place in (path, *path.absolute().parents) if os.path.lexists(place))
        if not nearest.exists():
            raise FolderError(
                f"{path} cannot be made: {nearest} is a link to {os.readlink(nearest)}, which is not there"
            )
        if not nearest.is_dir():
            raise FolderError(f"{path} cannot be made: {nearest} is a file")
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise FolderError(f"{path} cannot be written to: no permission in {nearest}")


def announce(path: Path, names: Iterable[str], told_in: str) -> None:
    """Name files in the one that tells of a folder, before they are put there.

    Whatever ends the process meanwhile, they are known as those of this run or study.
    """
    if summary := read_summary(path, told_in):
        files = [*dict.fromkeys([*summary.get("files", []), *names])]
        write_json(path / told_in, {**summary, "files": files})


def read_summary(path: Path, name: str = SUMMARY) -> dict[str, Any]:
    """Return what a folder says of its run or study; empty where there is none."""
    try:
        summary = json.loads((path / name).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return summary if isinstance(summary, dict) else {}


def _listed_files(summary: dict[str, Any]) -> list[str]:
    # the list comes from a file anybody may have edited: only plain names of our own kinds count
    listed = summary.get("files")
    names = [name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []
    return [*filter(_OWN_NAME.fullmatch, names)]
