"""What a comparison measures beside its runs: the error in time of each model, and its CPU time again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from hfsim.integrators import steps_in_absolute_coordinates
from hfsim.marching.distance import channel_errors
from hfsim.marching.solution import Run
from hfsim.marching.stop import Progress
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import Deck, SolveSpec
from hfsim.simulate import simulate
from hfsim.studies.timing import in_turns, uninterrupted

_LOOSER = 30.0
"""Factor on the tolerance of the run that the error in time is measured by."""
_LOOSEST = 0.1
_FALL = 2.0
"""Part of its distance from the run that is taken as the error of the latter: in the shipped scenes the error
of the worst channel is 2.6 times smaller than this distance at the least, in the median 16 times."""
_REPEAT_BELOW = 1.0
"""Solves longer than this [s of CPU] are timed once: their scatter is small and waiting is long."""


@dataclass
class Measured:
    """What was measured of models so far.

    Attributes
    ----------
    times : dict of str to list of float
        CPU times of solves by model [s].
    errors : dict of str to dict of str to float
        Errors in time by model and channel, in the unit of the channel; no entry where there is none.
    coordinates : dict of str to str
        Those in which steps are made, by model.
    """

    times: dict[str, list[float]] = field(default_factory=dict)
    errors: dict[str, dict[str, float]] = field(default_factory=dict)
    coordinates: dict[str, str] = field(default_factory=dict)


def measure(
    decks: Mapping[str, LoadedDeck],
    runs: Sequence[Run],
    repeats: int,
    found: Measured,
    progress: Progress | None = None,
) -> None:
    """Measure the error in time of each model that reached its end, and the CPU times of short ones again.

    Parameters
    ----------
    decks : mapping of str to LoadedDeck
        By model.
    runs : sequence of Run
        One for each of these models.
    repeats : int
        How often a short solve is timed in all; models take turns.
    found : Measured
        Is added to, so that what was measured is there when a signal ends it.
    progress : callable, optional
        Told the share that is done.

    Raises
    ------
    KeyboardInterrupt
    """
    found.times |= {run.model: [run.phase_cpu("solve")] for run in runs}
    found.coordinates |= {run.model: coordinates_of(decks[run.model].deck, run.model) for run in runs}
    whole = [run for run in runs if run.status == "done"]
    short = [run.model for run in whole if run.phase_cpu("solve") <= _REPEAT_BELOW]
    tell = _shares(progress, len(whole) + (repeats - 1) * len(short))
    for run in whole:
        error = time_error(decks[run.model], run, next(tell))
        if error is not None:
            found.errors[run.model] = error
    again = in_turns([_solve_of(decks[model], model, tell) for model in short], repeats - 1)
    for model, times in zip(short, again, strict=False):
        found.times[model] += times


def _shares(progress: Progress | None, count: int) -> Iterator[Progress | None]:
    """Yield what is told the share of one of some runs that is done."""
    for number in range(count):
        yield None if progress is None else partial(_tell_share, progress, number, count)


def _tell_share(progress: Progress, number: int, count: int, share: float) -> None:
    progress((number + share) / count)


def _solve_of(loaded: LoadedDeck, model: str, tell: Iterator[Progress | None]) -> Callable[[], float]:
    def solve() -> float:
        run = simulate(loaded, model=model, progress=next(tell), error_estimate=False)
        return uninterrupted(run).phase_cpu("solve")

    return solve


def time_error(loaded: LoadedDeck, run: Run, progress: Progress | None = None) -> dict[str, float] | None:
    """Return the error in time of each channel of a run, in its unit, by a looser run of the same model.

    Returns
    -------
    dict or None
        None where the looser run does not reach the end.

    Raises
    ------
    KeyboardInterrupt
    """
    change, fall = looser(loaded.deck.solve)
    loose = simulate(loaded.with_solve(change), model=run.model, progress=progress, error_estimate=False)
    if uninterrupted(loose).status != "done":
        return None
    return {name: apart / fall for name, apart in channel_errors(loose.channels, run.channels)[0].items()}


def looser(solve: SolveSpec) -> tuple[dict[str, float], float]:
    """Return what makes a run less accurate, and by what its error is larger at the least.

    Fixed steps are doubled: the error of a method of any order is then at least twice as large.
    """
    if solve.step is not None:
        return {"step": min(2.0 * solve.step, solve.duration)}, 1.0
    return {"tolerance": min(_LOOSER * solve.tolerance, _LOOSEST)}, _FALL


def coordinates_of(deck: Deck, model: str) -> str:
    """Return the coordinates in which steps of a model are made, ``frame`` or ``absolute``, or both."""
    solve = deck.solve
    stated = "absolute" if steps_in_absolute_coordinates(solve.method) else solve.coordinates
    elements = {body.element for body in deck.bodies.values() if not body.rigid}
    framed = {MODELS[model].stepping_in(stated, element).frame for element in elements}
    return " and ".join("frame" if one else "absolute" for one in sorted(framed)) or "absolute"
