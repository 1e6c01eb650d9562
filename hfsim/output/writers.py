"""Runs to files: CSV, JSON and YAML, none of which ever gets a NaN or an infinity.

Two guards see to that: `finite_part` drops the rows of a run from its first non-finite value on, and
`json_ready` turns non-finite numbers into null and says which they were.
"""

from __future__ import annotations

import json
import math
import os
import platform
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hfsim import __version__
from hfsim.errors import SolverFailure
from hfsim.output.text import Column
from hfsim.run.solution import Channel, Run

_BLOCK = 4096
"""Rows turned into text at a time: bounds the memory a long history needs."""

_SUMMARY_KEYS = (
    "steps",
    "rejected",
    "newton_iterations",
    "evaluations",
    "factorisations",
    "unknowns",
    "multipliers",
    "energy_drift",
    "constraint_position",
    "constraint_velocity",
    "error_estimate",
    "plan",
)
"""Keys that every summary has, with null where the simulation does not know."""


class Provenance(NamedTuple):
    """Where a run comes from: all that is needed to repeat it.

    Attributes
    ----------
    source : str
        The deck's file as the user named it.
    deck_sha256 : str
        Hash of the deck's text.
    overrides : tuple of str
        ``key=value`` settings of the command line.
    resolved : dict
        The deck with every default filled in, plain values only.
    """

    source: str
    deck_sha256: str
    overrides: tuple[str, ...]
    resolved: dict[str, Any]

    def facts(self) -> dict[str, Any]:
        """Return what files of results say of it."""
        return {"deck": self.source, "deck_sha256": self.deck_sha256, "overrides": list(self.overrides)}


def finite_part(run: Run) -> Run:
    """Return `run` without its rows from the first non-finite value on.

    A run that claims to be done but had to be shortened becomes a failed one (exit code 3).

    Parameters
    ----------
    run : Run
        Any run.

    Returns
    -------
    Run
        The same object when every value is finite; otherwise a shorter one whose
        ``statistics["warnings"]`` names the first offender and its time.
    """
    columns = {"t": run.t, **{c.name: c.values for c in run.channels}}
    columns |= {f"outline of {body}": points for body, points in run.outlines.items()}
    ends = {name: _finite_rows(values) for name, values in columns.items()}
    offender = min(ends, key=lambda name: ends[name])
    n_rows = ends[offender]
    if n_rows == len(run.t):
        return run
    return _shortened(run, n_rows, offender)


def _finite_rows(values: np.ndarray) -> int:
    rows = np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    return len(rows) if rows.all() else int(np.argmin(rows))


def _shortened(run: Run, n_rows: int, offender: str) -> Run:
    time = run.t[n_rows]
    place = f"t = {time:.6g} s" if np.isfinite(time) else f"row {n_rows + 1}"
    reason = f"{offender} is not finite from {place} on"
    warning = f"{reason}: {len(run.t) - n_rows} rows were dropped"
    was_done = run.status == "done"
    failure = SolverFailure(reason, float(time) if np.isfinite(time) else run.end_time, offender)
    return replace(
        run,
        t=run.t[:n_rows],
        channels=tuple(Channel(c.name, c.unit, c.values[:n_rows]) for c in run.channels),
        outlines={body: points[:n_rows] for body, points in run.outlines.items()},
        statistics={**run.statistics, "warnings": [*warnings_of(run), warning]},
        status="failed" if was_done else run.status,
        reason=reason if was_done else run.reason,
        failure=failure.facts(lambda path: 0) if was_done else run.failure,
        exit_code=3 if was_done else run.exit_code,
    )


def warnings_of(run: Run) -> list[str]:
    """Return the warnings of a run as a new list."""
    return [str(warning) for warning in run.statistics.get("warnings") or ()]


def write_history(path: Path, run: Run) -> None:
    """Write ``t`` and the channels of a run as CSV, one header row, shortest text that reads back exactly.

    Parameters
    ----------
    path : Path
        File to write.
    run : Run
        A run from `finite_part`.

    Raises
    ------
    ValueError
        If a value is not finite; nothing is written then.
    """
    table = np.column_stack([run.t, *(channel.values for channel in run.channels)]).astype(float)
    if not np.isfinite(table).all():
        raise ValueError("a non-finite value must not be written")
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(["t", *(channel.name for channel in run.channels)]) + "\n")
        for start in range(0, len(table), _BLOCK):
            file.writelines(_rows_as_text(table[start : start + _BLOCK].tolist()))


def _rows_as_text(rows: Iterable[Sequence[float]]) -> Iterable[str]:
    # repr of a Python float is the shortest text that reads back as the same number
    return (",".join(map(repr, row)) + "\n" for row in rows)


def write_table(path: Path, rows: Iterable[Any], columns: Iterable[Column | str]) -> None:
    """Write rows of any kind as CSV; None and non-finite numbers become empty cells.

    A column given by its name alone is the attribute or key of that name.
    """
    known = [column if isinstance(column, Column) else Column(column) for column in columns]
    lines = [",".join(column.name for column in known)]
    lines += [",".join(_cell(column.value(row)) for column in known) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    text = repr(float(value)) if isinstance(value, float) else str(value)
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',"\n') else text


def json_ready(value: Any, path: str = "") -> tuple[Any, list[str]]:
    """Return `value` in plain JSON types, and the paths of the numbers that were not finite (now None).

    Examples
    --------
    >>> json_ready({"a": [1.0, float("nan")]})
    ({'a': [1.0, None]}, ['a.1'])
    """
    if isinstance(value, Mapping):
        return _collect({str(k): json_ready(v, _join(path, k)) for k, v in value.items()})
    if isinstance(value, np.ndarray | np.generic):
        return json_ready(value.tolist(), path)
    if isinstance(value, list | tuple):
        parts = _collect({str(i): json_ready(v, _join(path, i)) for i, v in enumerate(value)})
        return list(parts[0].values()), parts[1]
    if isinstance(value, float) and not math.isfinite(value):
        return None, [path]
    if value is None or isinstance(value, bool | int | float | str):
        return value, []
    return str(value), []


def _join(path: str, key: object) -> str:
    return f"{path}.{key}" if path else str(key)


def _collect(parts: dict[str, tuple[Any, list[str]]]) -> tuple[dict[str, Any], list[str]]:
    bad = [name for _, names in parts.values() for name in names]
    return {key: value for key, (value, _) in parts.items()}, bad


def summary_of(run: Run, provenance: Provenance, files: Sequence[str]) -> dict[str, Any]:
    """Return what goes into ``summary.json``: every documented key, JSON-ready.

    Parameters
    ----------
    run : Run
        A run from `finite_part`.
    provenance : Provenance
        Where it comes from.
    files : sequence of str
        Files of the run folder, relative to it; what ``--force`` may remove later.

    Returns
    -------
    dict
        Statistics the simulation gave beyond the documented ones are kept under their own names.
    """
    facts: dict[str, Any] = {
        "name": run.name,
        "status": run.status,
        "reason": run.reason,
        "exit_code": run.exit_code,
        "model": run.model,
        "method": run.method,
        "end_time": run.end_time,
        "cpu_s": {},
        "wall_s": {},
        **dict.fromkeys(_SUMMARY_KEYS),
        **run.statistics,
        "channels": {channel.name: channel.unit for channel in run.channels},
        "failure": run.failure,
        **provenance.facts(),
        "versions": versions(),
        "files": list(files),
    }
    plain: dict[str, Any]
    plain, bad = json_ready(facts)
    plain["warnings"] = warnings_of(run) + [f"{name} is not finite: written as null" for name in bad]
    return plain


def versions() -> dict[str, str]:
    """Return the versions of hfsim, Python and those libraries this process has really used."""
    found = {"hfsim": __version__, "python": platform.python_version()}
    for name in ("numpy", "scipy", "pydantic", "matplotlib"):
        module = sys.modules.get(name)
        if module is not None:
            found[name] = str(getattr(module, "__version__", "unknown"))
    return found


def write_json(path: Path, facts: Mapping[str, Any]) -> None:
    """Write `facts` as JSON in one move: the file is either whole or not there.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    text = json.dumps(facts, indent=2, allow_nan=False, ensure_ascii=False)
    draft = path.with_name(f".{path.name}.part")
    draft.write_text(text + "\n", encoding="utf-8")
    os.replace(draft, path)


def write_resolved(path: Path, provenance: Provenance, model: str) -> None:
    """Write the deck with all defaults as YAML; its ``solve.model`` is the model of the run."""
    import yaml

    deck = dict(provenance.resolved)
    deck["solve"] = {**(deck.get("solve") or {}), "model": model}
    head = f"# {provenance.source} with every default filled in, as hfsim {__version__} ran it.\n"
    path.write_text(head + yaml.safe_dump(deck, sort_keys=False, allow_unicode=True), encoding="utf-8")
