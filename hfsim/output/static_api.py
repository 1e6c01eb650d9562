"""Equilibria from Python: ``hfsim.static``."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hfsim.errors import UnfinishedRunError
from hfsim.output.api import folder_for, for_models, load
from hfsim.output.arguments import AnyDeck, destination, flags, in_arguments, integral, real, several

if TYPE_CHECKING:
    from hfsim.marching.solution import Run


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
        If the deck is bad, or a law of it has no value somewhere until the time.
    ArgumentError
        If there is no such time, number of factors or format of pictures.
    UnfinishedRunError
        If there is no equilibrium; ``error.run`` has what was reached.
    FolderError, WriteError
        If the folder must not or cannot be written to.
    """
    from hfsim.studies.static import Wish, run_static

    real(at=at)
    integral(buckling=buckling)
    flags(path=path, check=check)
    to = destination(output, force, plots)
    base = load(deck, changes)
    loaded = for_models(base, (base.deck.solve.model,))
    with in_arguments():
        folder = None if to is None else folder_for(loaded, to)
    result = run_static(loaded, Wish(at, path, buckling, None if vary is None else several("vary", vary)))
    if folder is not None:
        from hfsim.output.recording import save_run

        result, _ = save_run(folder[0], result, *folder[1:])
    if check and result.exit_code:
        raise UnfinishedRunError(result)
    return result
