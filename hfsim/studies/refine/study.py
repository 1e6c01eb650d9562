"""The search: refine the part with the most left until the target is kept or nothing more can be done."""

from __future__ import annotations

import time
from dataclasses import replace

from hfsim.errors import interruption_words
from hfsim.marching.solution import Run
from hfsim.marching.stop import Budget, Halted, Progress
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.agreement import tidy
from hfsim.studies.refine.part import Part
from hfsim.studies.refine.races import Races
from hfsim.studies.refine.result import concluded
from hfsim.studies.refine.search import Search
from hfsim.studies.refine.setting import beams_of, coarse
from hfsim.trust.after import Wish

DEFAULT_BUDGET = 60.0
"""Time that a refinement may take unless the deck says otherwise [s]."""
_FAILURES = 2
"""Moves that may fail in a row."""


def refine(
    loaded: LoadedDeck,
    progress: Progress | None = None,
    diagnosis: bool = False,
    after: float | None = None,
) -> tuple[Run, LoadedDeck]:
    """Simulate a scene with elements, degrees, method and tolerance that reach its ``solve.target_error``.

    Parameters
    ----------
    loaded : LoadedDeck
        With a target; if it leaves the elements of some beams open, only these are refined.
    progress : callable, optional
        Called with the share of the budget that is used.
    diagnosis : bool
        Whether to find out by short experiments why the run fails or is suspicious.
    after : float, optional
        CPU time that this may take [s]; without it as much as the run has taken, or two seconds.

    Returns
    -------
    Run
        Of the chosen level; its statistics have the section ``refinement``.  A target that is missed
        (exit code 4) or a budget used up (status ``limit``) is told in it.
    LoadedDeck
        The deck with what was chosen and without the target: a plain run of it gives the same.

    Raises
    ------
    DeckError
        If the scene cannot be assembled.
    """
    budget = Budget(loaded.deck.solve.budget or DEFAULT_BUDGET)
    if progress is not None:
        budget.report = progress
    start = time.process_time()
    search = Search(loaded, budget)
    races = Races(search)
    status, reason = _search(search, races)
    found = concluded(search, races, status, reason, time.process_time() - start)
    return found.run(Wish(False, False, diagnosis, after)), found.chosen.setting.applied(loaded)


def _search(search: Search, races: Races) -> tuple[str, str]:
    """Refine until the target is kept or nothing more can be done; return status and reason."""
    try:
        if not _begin(search):
            return "failed", search.levels[-1].reason
        failures = 0
        while True:
            part = search.next_part()
            if search.current and not part.choices(search.current.setting):
                return "missed", f"the {'mesh' if part.bodies else 'tolerance'} cannot be refined further"
            if search.move(part):
                failures = 0
            else:
                failures += 1
                if failures >= _FAILURES:
                    return "missed", f"finer levels fail: {search.levels[-1].reason}"
                continue
            if part is search.time:
                races.take_pair()
            if part.stalled and part.left > search.target:
                return "missed", _stalled_words(search, part)
            races.hold()
            answer = search.answer()
            if answer is not None and not search.stale(answer):
                return "reached", ""
    except Halted as stop:
        return "limit", str(stop)
    except MemoryError:
        return "limit", "the next level would not fit into the memory there is"
    except KeyboardInterrupt as stop:
        search.signal = stop
        return "interrupted", interruption_words(stop)


def _begin(search: Search) -> bool:
    """Run the first level, or the deck's own setting if the coarse one fails; return whether one ended."""
    first = search.solve("", coarse(search.loaded, search.target))
    if first.status != "done":
        mesh = tuple((name, spec.elements, spec.degree) for name, spec in beams_of(search.loaded).items())
        tolerance = min(first.setting.tolerance, search.loaded.deck.solve.tolerance)
        own = replace(first.setting, mesh=mesh, tolerance=tolerance)
        search.refuse_too_large(first, own)
        first = search.solve("as in the deck", own)
    search.current = first if first.status == "done" else None
    return search.current is not None


def _stalled_words(search: Search, part: Part) -> str:
    last = [level for level in search.levels if level.change is not None][-1]
    what = f"finer meshes of {', '.join(part.bodies)}" if part.bodies else "tighter tolerances"
    others = "; without it: --target-channels with the others" if len(search.counted) > 1 else ""
    return (
        f"{what} do not bring {last.channel or 'the channels'} closer: the last changes are "
        f"{', '.join(tidy(change) for change in part.changes[-3:])}{others}"
    )
