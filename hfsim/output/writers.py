"""Runs to files: CSV, JSON and YAML, none of which ever gets a NaN or an infinity.

The rows of a run end before the first that is not finite (`hfsim.marching.record`); `json_ready` turns
non-finite numbers into null and says which they were.
"""

from __future__ import annotations

import json
import math
import os
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hfsim import __version__
from hfsim.marching.solution import Run
from hfsim.maths.kernel import KERNEL
from hfsim.output.disk import write_text
from hfsim.output.text import Column, printable

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck

_SUMMARY_KEYS = (
    "steps",
    "rejected",
    "newton_iterations",
    "evaluations",
    "factorisations",
    "kernel",
    "native_steps",
    "unknowns",
    "multipliers",
    "stages",
    "order",
    "energy_drift",
    "constraint_position",
    "constraint_velocity",
    "error_estimate",
    "error_estimate_reason",
    "mesh_error_estimate",
    "mesh_error_estimate_reason",
    "limiting_channel",
    "plan",
)
"""Keys that every summary has, with null where the simulation does not know."""
_LONGEST = 200
"""Characters of two values that are told whole."""
_TOLD = 20
"""Differences that are told."""
_ABSENT = "not there"


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

    @classmethod
    def of(cls, loaded: LoadedDeck, source: str, overrides: Sequence[str]) -> Provenance:
        """Return where a run of a deck comes from."""
        resolved = loaded.deck.resolved()
        return cls(source, loaded.deck_sha256, tuple(overrides), resolved)

    def facts(self) -> dict[str, Any]:
        """Return what files of results say of it."""
        return {"deck": self.source, "deck_sha256": self.deck_sha256, "overrides": list(self.overrides)}


def warnings_of(run: Run) -> list[str]:
    """Return the warnings of a run as a new list."""
    return [str(warning) for warning in run.statistics.get("warnings") or ()]


def table_text(rows: Iterable[Any], columns: Iterable[Column | str]) -> str:
    """Return rows of any kind as CSV; None and non-finite numbers become empty cells.

    A column given by its name alone is the attribute or key of that name.
    """
    known = [column if isinstance(column, Column) else Column(column) for column in columns]
    lines = [",".join(column.name for column in known)]
    lines += [",".join(cell(column.value(row)) for column in known) for row in rows]
    return "\n".join(lines) + "\n"


def cell(value: object) -> str:
    """Return a value as it stands in CSV."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    text = repr(float(value)) if isinstance(value, float) else str(value)
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',"\n') else text


def json_ready(value: Any, path: str = "", lost: list[str] | None = None) -> Any:
    """Return `value` in plain JSON types, null for numbers that are not finite, whose paths `lost` is given.

    Examples
    --------
    >>> json_ready({"a": [1.0, float("nan")]}, lost=(lost := [])), lost
    ({'a': [1.0, None]}, ['a.1'])
    """
    at = f"{path}." if path else ""
    if isinstance(value, Mapping):
        return {str(k): json_ready(v, f"{at}{k}", lost) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return json_ready(value.tolist(), path, lost)
    if isinstance(value, list | tuple):
        return [json_ready(v, f"{at}{i}", lost) for i, v in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        if lost is not None:
            lost.append(path)
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def differences(
    old: Mapping[str, Any], new: Mapping[str, Any], may_differ: Sequence[str] = ()
) -> Iterator[str]:
    """Yield a line for each entry of maps within maps that both have, or one of them, with another value."""
    then, now = dict(_leaves(old)), dict(_leaves(new))
    for key in dict.fromkeys((*then, *now)):
        if then.get(key) != now.get(key) and key not in may_differ:
            before, after = _short(then.get(key, _ABSENT), now.get(key, _ABSENT))
            yield f"  {key}: {before} then, {after} now"


def first_lines(lines: Iterable[str]) -> str:
    """Return lines as text, of many the first and how many more there are."""
    every = [*lines]
    if len(every) > _TOLD:
        every[_TOLD:] = [f"  and {len(every) - _TOLD} more"]
    return "\n".join(every)


def _leaves(entry: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted path and value of all that is in maps within maps."""
    if not isinstance(entry, dict):
        yield path, entry
        return
    for key, value in entry.items():
        yield from _leaves(value, f"{path}.{key}" if path else str(key))


def _short(old: Any, new: Any) -> tuple[str, str]:
    """Return two entries that differ as text; of long lists, where they first do so."""
    if isinstance(old, list) and isinstance(new, list) and len(str(old)) + len(str(new)) > _LONGEST:
        if len(old) != len(new):
            return f"{len(old)} entries", f"{len(new)} entries"
        k = next(k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a != b)
        return f"entry {k} {old[k]}", f"{new[k]}"
    texts = isinstance(old, str) and isinstance(new, str)
    plain = (one if texts or one is _ABSENT else json.dumps(one, ensure_ascii=False) for one in (old, new))
    then, now = (one if len(one) <= _LONGEST // 2 else f"{one[: _LONGEST // 2]}..." for one in plain)
    return then, now


def summary_of(run: Run, provenance: Provenance, files: Sequence[str]) -> dict[str, Any]:
    """Return what goes into ``summary.json``: every documented key, JSON-ready.

    Parameters
    ----------
    run : Run
        A run with finite values only.
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
        "stop_time": run.stop_time,
        "cpu_s": {},
        "wall_s": {},
        **dict.fromkeys(_SUMMARY_KEYS),
        **run.statistics,
        "channels": run.units,
        "final": run.final,
        "extremes": run.extremes,
        "failure": run.failure,
        **provenance.facts(),
        "versions": versions(),
        "files": list(files),
    }
    lost: list[str] = []
    plain: dict[str, Any] = json_ready(facts, lost=lost)
    nulls = [f"{name} is not finite: written as null" for name in lost]
    return {**plain, "warnings": [*warnings_of(run), *nulls]}


def running_summary(name: str, model: str, provenance: Provenance) -> dict[str, Any]:
    """Return what ``summary.json`` says while a run goes on, and after it was killed."""
    return {
        "name": name,
        "status": "running",
        "reason": "it has not ended: history.csv has the rows so far",
        "exit_code": None,
        "model": model,
        "started": datetime.now().astimezone().isoformat(timespec="seconds"),
        "process": os.getpid(),
        **dict.fromkeys(_SUMMARY_KEYS),
        "warnings": [],
        **provenance.facts(),
        "versions": versions(),
        "files": ["history.csv", "resolved.yaml", "run.log", "summary.json", "checkpoint.npz"],
    }


def versions() -> dict[str, str]:
    """Return the versions of hfsim, Python and libraries this process has used, and the kernel at hand."""
    found = {"hfsim": __version__, "kernel": KERNEL, "python": platform.python_version()}
    for name in ("numpy", "scipy", "pydantic", "matplotlib"):
        module = sys.modules.get(name)
        if module is not None:
            found[name] = str(getattr(module, "__version__", "unknown"))
    return found


def write_resolved(path: Path, provenance: Provenance, model: str) -> None:
    """Write the deck with all defaults as YAML; its ``solve.model`` is the model of the run."""
    import yaml

    deck = dict(provenance.resolved)
    deck["solve"] = {**(deck.get("solve") or {}), "model": model}
    source = printable(provenance.source).replace("\n", " ")
    head = f"# {source} with every default filled in, as hfsim {__version__} ran it.\n"
    dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    write_text(path, head + yaml.dump(deck, Dumper=dumper, sort_keys=False, allow_unicode=True))


def read_resolved(path: Path) -> dict[str, Any]:
    """Return the deck that `write_resolved` wrote, or another file of YAML.

    Raises
    ------
    OSError, ValueError
        If it cannot be read, or is no deck.
    """
    import yaml

    try:
        deck = yaml.load(path.read_text(encoding="utf-8"), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error
    if not isinstance(deck, dict):
        raise ValueError(f"{path} is no deck")
    return deck
