"""What a comparison measures beside its runs: the error in time of each model, and its CPU time again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from hfsim.marching.distance import channel_errors
from hfsim.marching.solution import Run
from hfsim.marching.stop import Progress, Share, nobody
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import Deck, SolveSpec
from hfsim.scene.stepping import kinds_of
from hfsim.simulate import simulate
from hfsim.studies.farm import Executor
from hfsim.studies.timing import uninterrupted

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
    executor: Executor,
    progress: Progress = nobody,
) -> None:
    """Measure the error in time of each model that reached its end, and the CPU times of short ones again.

    A signal ends that: raise `KeyboardInterrupt`.

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
    executor : Executor
        Does the runs.
    progress : callable, optional
        Told the share that is done.
    """
    found.times |= {run.model: [run.phase_cpu("solve")] for run in runs}
    found.coordinates |= {run.model: coordinates_of(decks[run.model].deck, run.model) for run in runs}
    whole = [run for run in runs if run.status == "done"]
    again = [run.model for run in whole if run.phase_cpu("solve") <= _REPEAT_BELOW] * (repeats - 1)
    part = 1.0 / max(1, len(whole) + len(again))
    errors = [(decks[r.model], _rows_of(r), Share(progress, k * part, part)) for k, r in enumerate(whole)]
    for done, (k, error) in enumerate(executor.results(_error_of, errors), 1):
        progress(done * part)
        if error is not None:
            found.errors[whole[k].model] = error
    solves = [(decks[m], m, Share(progress, k * part, part)) for k, m in enumerate(again, len(whole))]
    for done, (k, seconds) in enumerate(executor.results(_solve_time, solves), len(whole) + 1):
        progress(done * part)
        found.times[again[k]].append(seconds)


def _rows_of(run: Run) -> Run:
    """Return a run without its steps."""
    return replace(run, fine=None, outlines={}, outline_forces=None, snapshots=(), states=())


def _error_of(job: tuple[LoadedDeck, Run, Progress]) -> dict[str, float] | None:
    return time_error(*job)


def _solve_time(job: tuple[LoadedDeck, str, Progress]) -> float:
    loaded, model, tell = job
    run = simulate(loaded, model=model, progress=tell, error_estimate=False)
    return uninterrupted(run).phase_cpu("solve")


def time_error(loaded: LoadedDeck, run: Run, progress: Progress | None = None) -> dict[str, float] | None:
    """Return the error in time of each channel of a run, in its unit, by another run of the same model.

    A signal ends that: raise `KeyboardInterrupt`.

    Returns
    -------
    dict or None
        None where the other run does not reach the end.
    """
    solve, errors = loaded.deck.solve, dict[str, float]()
    # where a looser run is the same, the tolerance is not what bounds the steps: shorter ones tell
    halved = {"step": 0.5 * run.end_time / max(run.statistics["steps"], 1)}
    for change, fall in (looser(solve), (halved, 1.0)):
        other = simulate(loaded.with_solve(change), model=run.model, progress=progress, error_estimate=False)
        if uninterrupted(other).status != "done":
            return None
        apart, _ = channel_errors(other.channels, run.channels)
        errors = {name: distance / fall for name, distance in apart.items()}
        if any(errors.values()):
            break
    return errors


def looser(solve: SolveSpec) -> tuple[dict[str, float], float]:
    """Return what makes a run less accurate, and by what its error is larger at the least.

    Fixed steps are doubled: the error of a method of any order is then at least twice as large.
    """
    if solve.step is not None:
        return {"step": min(2.0 * solve.step, solve.duration)}, 1.0
    return {"tolerance": min(_LOOSER * solve.tolerance, _LOOSEST)}, _FALL


def coordinates_of(deck: Deck, model: str) -> str:
    """Return the coordinates in which steps of a model are made, ``frame`` or ``absolute``, or both."""
    beams = [name for name, body in deck.bodies.items() if not body.rigid]
    framed = {kind.frame for kind in kinds_of(deck, dict.fromkeys(beams, model)).values()}
    return " and ".join("frame" if one else "absolute" for one in sorted(framed)) or "absolute"
