"""Equilibria from Python: ``hfsim.static``."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hfsim.errors import UnfinishedRunError
from hfsim.output.api import AnyDeck, load

if TYPE_CHECKING:
    from hfsim.marching.solution import Run
    from hfsim.output.runfolder import RunFolder


def static(
    deck: AnyDeck,
    changes: Mapping[str, Any] | None = None,
    *,
    at: float = 0.0,
    path: bool = False,
    buckling: int = 0,
    vary: Sequence[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    plots: bool | str = True,
    check: bool = True,
) -> Run:
    """Find where a scene comes to rest; what ``hfsim static`` does.

    Parameters
    ----------
    deck, changes
        As in `load`.
    at : float
        Time at which loads and drivers are taken [s].
    path : bool
        Whether the load is followed by arc length: a row a point, ``run["load"]`` its load factor.
    buckling : int
        How many critical load factors are sought, for ``run.statistics["critical"]``.
    vary : sequence of str, optional
        What load factors are of: loads, motors, ``gravity``; all of them without it.
    output, force, plots
        As of `run`.
    check : bool
        Whether it is an error if there is no equilibrium; if not, ``status`` and ``reason`` tell.

    Returns
    -------
    Run
        With one row without ``path``; ``run.final`` has the channels, ``run.statistics`` whether it
        is ``stable``.

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad.
    UnfinishedRunError
        If there is no equilibrium; ``error.run`` has what was reached.
    FolderError, WriteError
        If the folder must not or cannot be written to.
    """
    from hfsim.studies.static import Wish, run_static

    loaded = load(deck, changes).with_numbers()
    folder = None if output is None else _claimed(Path(output), force)
    wish = Wish(at, path, buckling, None if vary is None else tuple(vary))
    result = run_static(loaded, wish)
    if folder is not None:
        from hfsim.output.extras import Extras
        from hfsim.output.recording import save_run
        from hfsim.output.runfolder import RunLog, Stopwatch
        from hfsim.output.writers import Provenance

        provenance = Provenance.of(loaded, loaded.source.file, loaded.overrides)
        wanted = Extras(bool(plots), format=plots if isinstance(plots, str) else "png").of(loaded.deck.output)
        watch = Stopwatch(cpu_start=time.process_time())
        result, _ = save_run(folder, result, provenance, watch, RunLog(), wanted)
    if check and result.exit_code:
        raise UnfinishedRunError(result)
    return result


def _claimed(path: Path, force: bool) -> RunFolder:
    from hfsim.output.runfolder import claim

    return claim(path, force)
