"""Where a run can be taken up again, in ``checkpoint.npz``: plain arrays, and what they belong to."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hfsim.integrators import Memory
from hfsim.output.disk import Beginning, read_history, write_whole
from hfsim.output.writers import Provenance, differences, first_lines, read_resolved, versions

CHECKPOINT = "checkpoint.npz"
_MAY_DIFFER = ("solve.max_steps", "solve.budget", "output.plots", "output.shapes")
"""Entries of a deck that have no part in what its rows are."""


class Checkpoint(NamedTuple):
    """A place from which a run goes on.

    Attributes
    ----------
    memory : Memory
        For `hfsim.simulate.simulate`.
    there : Beginning
        The history until there.
    """

    memory: Memory
    there: Beginning


class CheckpointError(Exception):
    """A checkpoint or results of another deck, version or command; says in what they differ."""


def put_down(folder: Path, memory: Memory, there: Beginning, provenance: Provenance) -> None:
    """Write the checkpoint of a run.

    Raises
    ------
    OSError
        If the system refuses.
    """
    facts = {"history": there, "resolved": provenance.resolved, "versions": versions()}
    arrays: dict[str, Any] = {**memory, "about": np.array(json.dumps(facts))}
    write_whole(folder / CHECKPOINT, lambda file: np.savez(file, **arrays))


def take_up(folder: Path, provenance: Provenance) -> Checkpoint | None:
    """Return the checkpoint in a folder; None where there is none.

    Raises
    ------
    CheckpointError
        If it is not one of this deck with these versions, or cannot be read, or the history was changed.
    """
    from zipfile import BadZipFile

    path = folder / CHECKPOINT
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as arrays:
            memory = dict(arrays)
        facts = json.loads(str(memory.pop("about")))
        differing = [*_of_versions(facts["versions"]), *_deck(facts["resolved"], provenance.resolved)]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise CheckpointError(f"{path} cannot be read: {error}") from error
    _refuse(path, differing)
    try:
        there = Beginning(*facts["history"])
        table = read_history(folder / "history.csv", there)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise CheckpointError(f"{path} does not go with the rows: {error}") from error
    return Checkpoint({**memory, "table": table}, there)


def refuse_others(folder: Path, summary: Mapping[str, Any], provenance: Provenance) -> None:
    """Refuse results in a folder that are not of this deck by their summary; raise `CheckpointError`."""
    different: Iterable[str] = ()
    if summary.get("kind"):
        different = [f"  it is a result of hfsim {summary['kind']}"]
    elif summary.get("deck_sha256") != provenance.deck_sha256:
        different = _of_deck(folder, summary, provenance)
    _refuse(folder, different)


def _of_deck(folder: Path, summary: Mapping[str, Any], provenance: Provenance) -> Iterator[str]:
    """Return in what the deck of a folder differs, or its hash where no more is known of it."""
    try:
        # where a target error was sought, resolved.yaml has what was chosen for it
        asked = (summary.get("refinement") or {}).get("deck")
        return _deck(asked or read_resolved(folder / "resolved.yaml"), provenance.resolved)
    except (OSError, ValueError):
        then, now = ({"deck_sha256": one} for one in (summary.get("deck_sha256"), provenance.deck_sha256))
        return differences(then, now)


def _of_versions(then: Mapping[str, str]) -> Iterator[str]:
    """Yield in what versions differ, as far as libraries have been imported, and what helps."""
    now = versions()
    known = {name: one for name, one in then.items() if name in now}
    yield from differences(known, {name: now[name] for name in known})
    if "kernel" in known and known["kernel"] != now["kernel"]:
        yield f"HFSIM_KERNEL={known['kernel']} goes on with that kernel"


def _refuse(path: Path, different: Iterable[str]) -> None:
    if told := first_lines(different):
        raise CheckpointError(f"{path} belongs to another run:\n{told}")


def _deck(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    then, now = (json.loads(json.dumps(one)) for one in (old, new))
    return differences(then, now, _MAY_DIFFER)
