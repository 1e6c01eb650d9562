"""What each rule saves, and that it changes nothing: the same scene with and without it, in turns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

import numpy as np

from hfsim.integrators import choose
from hfsim.marching.alike import alike
from hfsim.marching.distance import gap, unit_sizes
from hfsim.marching.integration import problem_of
from hfsim.marching.plan import keeping, plan_of
from hfsim.marching.solution import Run
from hfsim.maths.arrays import magnitude
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.simulate import simulate
from hfsim.studies.timing import clocked, in_turns, uninterrupted

ALL = "all"
"""Stands for all rules together, against ``solve.keep_all``."""
STATES = 16
"""States in a measured call of the accelerations: as many as the longest steps have stages."""
CALLS = 5e-3
"""CPU time of the calls that are timed together [s]."""
STEPS = 50
"""Steps over which results with and without a rule are compared, unless said otherwise."""
TURN = 0.25
"""Angle by which the fastest mode turns from stage to stage in these steps [rad]."""
SHORT = 200
"""These steps are at most the duration over this."""
TIGHT = 1e-13
"""Tolerance of the equations of a step in that comparison."""


@dataclass(frozen=True)
class RuleCost:
    """A scene with a rule (``after``) and without it (``before``).

    Attributes
    ----------
    unknowns, multipliers : (before, after)
    call_us : (before, after)
        CPU time of one call of the accelerations for `STATES` states [us].
    run_s : (before, after)
        CPU time of a run [s]: integration, sampling, energy balance.
    difference : float
        Largest difference of a channel in metres or radians, relative above 1; see `largest_difference`.
    difference_of_rest : float
        The same for rates, energies and forces, relative to the largest value with that unit.
    """

    rule: str
    scene: str
    unknowns: tuple[int, int]
    multipliers: tuple[int, int]
    call_us: tuple[float, float]
    run_s: tuple[float, float]
    difference: float
    difference_of_rest: float

    def facts(self) -> dict[str, Any]:
        """Return all that was measured, JSON-ready."""
        return asdict(self)


def firing(scene: Scene) -> list[str]:
    """Return the rules that leave something out of a scene, and `ALL`."""
    return [*(str(entry["rule"]) for entry in plan_of(scene)["left_out"]), ALL]


def measure(
    loaded: LoadedDeck, repeats: int = 5, share: float = 1.0, rules: Sequence[str] | None = None
) -> Iterator[RuleCost]:
    """Measure what each rule that fires in a scene saves.

    Parameters
    ----------
    repeats : int
        Runs with and without each rule, in turns; times are medians.
    share : float
        Part of the duration that the timed runs of single rules last; those of `ALL` last all of it.
    rules : sequence of str, optional
        Instead of all that fire.
    """
    for rule in firing(build(loaded)) if rules is None else rules:
        decks = keeping(loaded, rule), loaded
        scenes = build(decks[0]), build(decks[1])
        part = 1.0 if rule == ALL else share
        lasting = {"duration": part * loaded.deck.solve.duration}
        runs = [_timed(deck.with_solve(lasting)) for deck in decks]
        difference, rest = largest_difference(loaded, rule)
        yield RuleCost(
            rule=rule,
            scene=loaded.deck.name,
            unknowns=(scenes[0].system.n, scenes[1].system.n),
            multipliers=(scenes[0].system.n_rows, scenes[1].system.n_rows),
            call_us=_medians([_calls(scene) for scene in scenes], repeats),
            run_s=_medians(runs, repeats),
            difference=difference,
            difference_of_rest=rest,
        )


def _medians(tasks: Sequence[Callable[[], float]], repeats: int) -> tuple[float, float]:
    before, after = map(median, in_turns(tasks, repeats))
    return before, after


def _timed(loaded: LoadedDeck) -> Callable[[], float]:
    return lambda: uninterrupted(simulate(loaded, error_estimate=False)).phase_cpu("solve")


def _calls(scene: Scene) -> Callable[[], float]:
    """Return what times one call of the accelerations, in microseconds, near the start of a scene."""
    system = scene.system
    noise = 1e-6 * np.random.default_rng(0).normal(size=(STATES, system.n))
    t, q, v = np.zeros(STATES), scene.q + noise, np.repeat(scene.v[None], STATES, axis=0)

    def call() -> object:
        return system.acceleration(t, q, v)

    clocked(call, 2)
    count = max(3, int(CALLS / max(clocked(call, 3), 1e-6)))
    return lambda: 1e6 * clocked(call, count)


# --- agreement -----------------------------------------------------------------------------------


def largest_difference(loaded: LoadedDeck, rule: str, steps: int = STEPS) -> tuple[float, float]:
    """Return how far results with and without a rule are apart.

    Both runs make the same fixed steps of Gauss collocation, in each of which the fastest mode turns
    by `TURN` a stage, and solve them to `TIGHT`; where parts are integrated apart there are no common steps,
    and both runs follow the tolerance `TIGHT`.

    Returns
    -------
    float
        Largest difference of a channel in metres or radians, relative to its values where they exceed 1.
    float
        Largest difference of any other channel over the largest value with its unit (or 1).
    """
    one, other = (_tight(deck, loaded, rule, steps) for deck in (loaded, keeping(loaded, rule)))
    runs = [uninterrupted(simulate(deck, error_estimate=False)) for deck in (one, other)]
    return differences(*runs)


def _tight(loaded: LoadedDeck, planned: LoadedDeck, rule: str, steps: int) -> LoadedDeck:
    solve = {"method": "gauss", "tolerance": TIGHT, "stages": None, "order": None, "max_steps": None}
    scene = build(planned.with_solve(solve))
    step = choose(scene.deck.solve, False).start(problem_of(scene), 0.0, scene.q, scene.v).first
    step = min(TURN * step, scene.deck.solve.duration / SHORT)
    apart = bool(scene.parts) and rule in ("parts", ALL)
    solve |= {"duration": steps * step, "step": None if apart else step}
    output = loaded.deck.output.model_copy(update={"interval": steps * step / 10})
    tight = loaded.with_solve(solve)
    return replace(tight, deck=tight.deck.model_copy(update={"output": output}))


def differences(one: Run, other: Run) -> tuple[float, float]:
    """Return the largest difference of lengths and angles, and of all else; see `largest_difference`."""
    largest, sizes = {True: 0.0, False: 0.0}, unit_sizes(other.channels, magnitude)
    for mine, theirs in zip(alike(one.channels, other.channels), other.channels, strict=True):
        apart = gap(mine.values, theirs.values).largest / max(1.0, sizes[mine.unit])
        kind = mine.unit in ("m", "rad")
        largest[kind] = max(largest[kind], apart)
    return largest[True], largest[False]
