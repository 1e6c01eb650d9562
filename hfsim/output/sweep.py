"""A sweep from its options to its results: what is asked for, done, kept and told."""

from __future__ import annotations

import hashlib
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hfsim import __version__
from hfsim.deck.ranges import written
from hfsim.marching.solution import Run
from hfsim.output.disk import rows_as_text
from hfsim.output.pictures import drawn_by
from hfsim.output.runfolder import RunFolder, RunLog, Stopwatch
from hfsim.output.study import Study, Table
from hfsim.output.sweep_folder import (
    FOLDER_FILES,
    KIND,
    RUNS,
    SweepFolder,
    claim_sweep,
    refuse_changed,
)
from hfsim.output.talk import Destination, Talk
from hfsim.output.text import Column, as_table, number, plural, table
from hfsim.output.writers import Provenance
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.farm import Executor
from hfsim.studies.sweep.asked import Asked
from hfsim.studies.sweep.effects import main_effects
from hfsim.studies.sweep.plan import Plan, readable
from hfsim.studies.sweep.result import Sweep, gathered
from hfsim.studies.sweep.sensitivity import (
    Differences,
    plan_differences,
    sensitivities,
    values_of,
)
from hfsim.studies.sweep.study import (
    Refusals,
    do_runs,
    refuse_entries,
    refuse_unbuilt,
    refuse_values,
)
from hfsim.studies.sweep.work import Keep, Row, Setting

_TOLD = 12
"""Quantities whose range is told, and failures."""


@dataclass(frozen=True)
class Wanted:
    """What is asked for, ready to be done.

    Attributes
    ----------
    keep : str
        What is kept of each run: ``nothing``, ``histories`` or ``folders``.
    source : str
        The deck as the user named it.
    differences : Differences or None
        What derivatives are made of, where they are asked for.
    """

    loaded: LoadedDeck
    plan: Plan
    setting: Setting
    keep: str = "nothing"
    source: str = field(default="deck", compare=False)
    differences: Differences | None = None

    @property
    def collected(self) -> tuple[str, ...]:
        """Names of what is collected."""
        return tuple(map(str, self.setting.quantities))

    @property
    def identity(self) -> dict[str, Any]:
        """What must be the same where a sweep is gone on with: deck, plan and all that rows depend on."""
        setting = self.setting
        of_runs = ("error_estimate", "mesh_estimate", "diagnosis", "limit")
        told = {key: getattr(setting, key) for key in of_runs}
        facts: dict[str, Any] = {
            "hfsim": __version__,
            "plan": self.plan.facts,
            "count": self.plan.count,
            "collect": list(self.collected),
            "setting": {**told, "keep": self.keep},
            "resolved": self.loaded.deck.resolved(),
        }
        if any(path.startswith("parameters.") for path in self.plan.paths):
            texts = "\n".join([setting.text, *self.loaded.source.others.values()])
            facts["text_sha256"] = hashlib.sha256(texts.encode()).hexdigest()
        if any("{" in text for text in setting.collected.texts):
            facts["as_written"] = list(setting.collected.texts)
        return facts


def keep_history(loaded: LoadedDeck, run: Run) -> dict[str, bytes]:
    """Return the rows of a run as a CSV file."""
    head = ",".join(["t", *(channel.name for channel in run.channels)]) + "\n"
    return {"histories/{number:06}.csv": (head + "".join(rows_as_text(run.table.tolist()))).encode()}


def keep_folder(loaded: LoadedDeck, run: Run) -> dict[str, bytes]:
    """Return what `hfsim run` writes of a run, without pictures."""
    from hfsim.output.extras import Extras
    from hfsim.output.recording import save_run

    provenance = Provenance.of(loaded, loaded.source.file, loaded.overrides)
    with tempfile.TemporaryDirectory() as made:
        path = Path(made)
        save_run(RunFolder(path), run, provenance, Stopwatch(), RunLog(), Extras())
        return {f"runs/{{number:06}}/{name}": (path / name).read_bytes() for name in FOLDER_FILES}


KEPT: dict[str, Keep | None] = {"nothing": None, "histories": keep_history, "folders": keep_folder}
"""What may be kept of each run beside its row: what makes its files."""


# --- doing it ------------------------------------------------------------------------------------


class Rows:
    """The rows of a sweep that is written nowhere; in memory, as `SweepFolder` is on disk."""

    there = 0

    def __init__(self, plan: Plan) -> None:
        self._rows: list[Row | None] = [None] * plan.count

    def missing(self, number: int) -> bool:
        """Tell whether a run is yet to be done."""
        return self._rows[number] is None

    def add(self, number: int, row: Row, files: Mapping[str, bytes]) -> None:
        """Take what has come of a run."""
        self._rows[number] = row

    def rows(self) -> Iterable[Row | None]:
        """Return what is known of each run in the order of the plan."""
        return self._rows


def wanted_of(
    asked: Asked, loaded: LoadedDeck, note: Callable[[str], None], keep: str = "nothing", source: str = "deck"
) -> Wanted:
    """Return what is asked for, ready to be done; raise `SweepError` or `DeckError` where it cannot be."""
    wrong = Refusals(loaded, asked.left_to(loaded), asked.called)
    if not asked.sensitivity:
        asked = asked.completed(loaded)
    else:
        with wrong.gathered():
            asked.refuse_runs()
    plan, differences, numbers = None, None, dict[str, float]()
    setting = common = asked.setting(loaded)
    if not asked.sensitivity:
        with wrong.gathered():
            plan = asked.plan()
    values = readable(asked.vary, random=True)[0] if plan is None else plan.by_path
    with wrong.gathered():
        setting = asked.collecting(common, loaded, values)
    with wrong.gathered():
        refuse_entries(loaded, asked.vary if plan is None else plan.paths)
    with wrong.gathered():
        if asked.sensitivity:
            numbers = values_of(loaded, setting, asked.vary)
        else:
            refuse_values(common, values, note)
    wrong.tell()
    if plan is None:
        with wrong.gathered():
            plan, differences = plan_differences(setting, numbers)
        wrong.tell()
    assert plan is not None
    with wrong.gathered():
        refuse_unbuilt(setting, plan)
    wrong.tell()
    return Wanted(loaded, plan, setting, keep, source, differences)


def check_sweep(loaded: LoadedDeck) -> list[str]:
    """Return notes on a deck's own sweep; raise `SweepError` or `DeckError`, as it would before it runs."""
    notes: list[str] = []
    wanted_of(Asked(many=True), loaded, notes.append)
    return notes


def perform(
    wanted: Wanted, executor: Executor, store: Rows | SweepFolder, progress: Callable[[float], None]
) -> Sweep:
    """Do the runs that are missing and put them down; return all there are."""
    plan, done = wanted.plan, store.there

    def take(number: int, row: Row, files: Mapping[str, bytes]) -> None:
        nonlocal done
        store.add(number, row, files)
        done += 1
        progress(done / plan.count)

    interrupted = do_runs(wanted.setting, plan, executor, store.missing, take, KEPT[wanted.keep])
    status = "interrupted" if interrupted else "done"
    return gathered(wanted.loaded, status, plan, wanted.setting.collected, store.rows())


def into_folder(
    wanted: Wanted,
    executor: Executor,
    to: Destination,
    talk: Talk,
    progress: Callable[[float], None],
    resume: bool = False,
) -> Sweep:
    """Do a sweep, write and tell it; raise `FolderError`, `ResumeError` or `WriteError`."""
    start = time.perf_counter()
    granted, going_on = claim_sweep(to, wanted.loaded.deck.name, resume)
    if going_on:
        refuse_changed(granted.path, wanted.identity)
    about = Provenance.of(wanted.loaded, wanted.source, wanted.loaded.overrides).facts()
    folder = SweepFolder(granted, wanted.plan, wanted.identity, going_on)
    if going_on:
        talk.note(f"{folder.path}: going on, {folder.there} of {wanted.plan.count} runs are there")
    result = perform(wanted, executor, folder, progress)
    wall = time.perf_counter() - start
    folder.write_table(wanted.collected)
    facts = sweep_facts(result, wall, executor.jobs)
    text = sweep_text(result, folder.path, wall, folder.there)
    tables: dict[str, Table] = {}
    draw = drawn_by("sweep:draw", result)
    if wanted.differences is not None:
        found = sensitivities(result, wanted.differences)
        tables["sensitivity"] = SENSITIVITY, found
        text = f"{text}\n{table(SENSITIVITY, found)}"
        draw = drawn_by("sweep:draw_elasticities", result.name, found)
    Study(KIND, talk, granted, to.plots, about, to.format).publish(
        {**facts, **wanted.identity},
        tables,
        text,
        draw,
        also=("sweep.csv", RUNS),
    )
    folder.close()
    return result


SENSITIVITY = (
    Column("quantity"),
    Column("path"),
    Column("at", form=".6g"),
    Column("step", form=".2g", spare=1),
    Column("value", form=".6g"),
    Column("derivative", form=".6g"),
    Column("error", form=".1e"),
    Column("elasticity", form=".4g"),
    Column("side", spare=1),
    Column("sure", lambda one: "yes" if one.sure else "no"),
)
"""Columns of a table of derivatives."""


# --- what is told --------------------------------------------------------------------------------


def sweep_facts(sweep: Sweep, wall: float, jobs: int) -> dict[str, Any]:
    """Return a sweep as JSON-ready facts, without its rows."""
    cpu = sweep["cpu_s"]
    return {
        "name": sweep.name,
        "status": sweep.status,
        "runs": len(sweep),
        "missing": sweep.missing,
        "counts": sweep.counts,
        "classes": dict(sorted(Counter(filter(None, sweep["class"].tolist())).items())),
        "jobs": jobs,
        "wall_s": wall,
        "cpu_s": float(np.nansum(cpu)),
        "ranges": {name: _range(sweep, name) for name in sweep.collected},
        "main_effects": {} if sweep.plan.kind == "sensitivity" else main_effects(sweep),
    }


def _range(sweep: Sweep, name: str) -> dict[str, Any] | None:
    """Return the smallest and largest value of what is collected, with their runs, mean and deviation."""
    values = sweep[name]
    if np.isnan(values).all():
        return None
    low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
    return {
        "min": values[low],
        "min_run": low + 1,
        "max": values[high],
        "max_run": high + 1,
        "mean": float(np.nanmean(values)),
        "deviation": float(np.nanstd(values)),
    }


def sweep_text(sweep: Sweep, path: Path, wall: float, there: int) -> str:
    """Return a sweep as people read it: how many runs, ranges of what is collected, what went wrong."""
    counts = ", ".join(f"{count} {status}" for status, count in sweep.counts.items())
    before = f" ({there} were there)" if there else ""
    lines = [f"{sweep.name}: {plural(len(sweep), 'run')}{before}: {counts}"]
    lines += [f"  varied       {_shown(sweep, name)}" for name in sweep.paths]
    lines += [f"  took         {wall:.3g} s, CPU time of the runs {np.nansum(sweep['cpu_s']):.3g} s"]
    lines += [f"  results      {path}/"]
    rows = []
    for name in sweep.collected:
        facts = _range(sweep, name)
        if facts is not None:
            cells = (facts["min"], facts["min_run"], facts["max"], facts["max_run"], facts["mean"])
            label = f"{name} [{sweep.units[name]}]" if sweep.units[name] else name
            rows.append([label, *(f"{one:.6g}" if isinstance(one, float) else str(one) for one in cells)])
    if rows:
        head = ["collected", "least", "in run", "most", "in run", "mean"]
        lines.append(as_table([head, *rows[:_TOLD]]))
    if len(rows) > _TOLD:
        lines.append(f"  and {len(rows) - _TOLD} more (sweep.json has their ranges)")
    lines += _failures(sweep)
    return "\n".join(lines)


def _shown(sweep: Sweep, name: str) -> str:
    values = sweep[name]
    if values.dtype == object:
        words = list(dict.fromkeys(values.tolist()))
        return f"{name}: {', '.join(written(word) for word in words[:_TOLD])}"
    low, high, count = values.min(), values.max(), plural(len(np.unique(values)), "value")
    unit = f" {sweep.units[name]}" if sweep.units.get(name) else ""
    if low < high and number(low) == number(high):
        return f"{name}: {count} about {number(low)}{unit}, at most {high - low:.2g} apart"
    return f"{name}: {count} from {number(low)} to {number(high)}{unit}"


def _failures(sweep: Sweep) -> list[str]:
    """Return lines on runs that gave nothing, those of one reason together."""
    found: dict[tuple[str, str, str], list[int]] = {}
    facts = zip(sweep["status"], sweep["class"], sweep["reason"], strict=True)
    for k, (status, kind, reason) in enumerate(facts):
        if status not in ("done", ""):
            found.setdefault((status, kind, reason.split(" at t =")[0]), []).append(k + 1)
    lines = []
    for (status, kind, reason), runs in [*found.items()][:_TOLD]:
        which = f"run {runs[0]}" + (f" and {len(runs) - 1} more" if len(runs) > 1 else "")
        lines.append(f"  {which}: {status}{f' ({kind})' if kind else ''}: {reason}")
    if len(found) > _TOLD:
        lines.append(f"  and {len(found) - _TOLD} more reasons (sweep.csv)")
    return lines
