"""How the values of one variant of a deck are found, in a worker process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hfsim.deck.quantities import Quantity
from hfsim.errors import HfsimError
from hfsim.marching.sampling import SceneSamples, compute_channels
from hfsim.marching.solution import Run
from hfsim.scene.loading import LoadedDeck, parse_deck
from hfsim.scene.schema import SolveSpec
from hfsim.simulate import simulate
from hfsim.studies.collect import Answer, Collector

_SHARE = 0.25
"""Part of its bound that the error in time of a value may be."""
_TIGHTER = (1.0, 0.1, 1e-3, 1e-5, 1e-7)
"""Tolerances of the runs of one variant, as parts of the deck's; two, more where that is not enough."""
_SHORTER = (1.0, 0.5, 0.25, 0.125)
"""The same of fixed steps."""
_LEAST = 1e-13
"""Tolerance of the tightest run [-]: beyond, its error is rounding."""


@dataclass(frozen=True)
class Order:
    """One variant of a deck to be solved.

    Attributes
    ----------
    study : str
        A key of `FINDERS`.
    place : float or str
        Time of the loads at rest [s], or state of the modes.
    text, file : str
        The deck as written.
    bounds : tuple of float
        How far each may be off [SI].
    """

    study: str
    place: float | str
    text: str
    file: str
    overrides: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    bounds: tuple[float, ...]

    def load(self) -> LoadedDeck:
        """Return the deck, or raise `DeckError`."""
        return parse_deck(self.text, self.file, self.overrides)


def answer(order: Order) -> tuple[tuple[Answer, ...], float]:
    """Return what was found of each quantity, and the CPU time it took [s]."""
    start = time.process_time()
    try:
        found = FINDERS[order.study](order)
    except HfsimError as error:
        found = _without(order, str(error).splitlines()[0])
    told = tuple(
        one if one.value is None or math.isfinite(one.value) else Answer(None, reason="is not finite")
        for one in found
    )
    return told, time.process_time() - start


def _without(order: Order, reason: str) -> tuple[Answer, ...]:
    return tuple(Answer(None, reason=reason, failed=True) for _ in order.quantities)


# --- runs ----------------------------------------------------------------------------------------


def _by_run(order: Order) -> tuple[Answer, ...]:
    """Run the scene, then again more tightly until what that changes is small beside the bounds."""
    loaded = order.load()
    best = _without(order, "no run")
    for number, update in enumerate(_tighter(loaded.deck.solve)):
        found = _run(order, loaded.with_solve(update))
        if number and all(one.value is None for one in found):
            break  # tighter than rounding allows: what there is counts
        best = tuple(map(_compared, found, best))
        errors = [one.time_error or 0.0 for one in best]
        # where nothing changes at all, the tolerance is not yet what bounds the steps
        near = [error <= _SHARE * bound for error, bound in zip(errors, order.bounds, strict=True)]
        if any(errors) and all(near):
            break
    return best


def _compared(one: Answer, looser: Answer) -> Answer:
    if one.value is None or looser.value is None:
        return one
    return one._replace(time_error=abs(one.value - looser.value))


def _tighter(solve: SolveSpec) -> Iterator[dict[str, Any]]:
    if solve.step is not None:
        yield from ({"step": share * solve.step} for share in _SHORTER)
        return
    tolerances = [max(share * solve.tolerance, _LEAST) for share in _TIGHTER]
    if tolerances[1] == tolerances[0]:
        tolerances.insert(0, 10.0 * tolerances[0])
    yield from ({"tolerance": one} for one in dict.fromkeys(tolerances))


def _run(order: Order, loaded: LoadedDeck) -> tuple[Answer, ...]:
    collector = Collector(order.quantities)
    run = simulate(loaded, error_estimate=False, outlines=False, reader=collector)
    if run.status != "done":
        return _without(order, f"{run.status} at t = {run.stop_time:.6g} s: {run.reason}")
    return tuple(collector.answer(one, run) for one in order.quantities)


# --- at rest -------------------------------------------------------------------------------------


def _at_rest(order: Order) -> tuple[Answer, ...]:
    """Find where the scene rests, under the loads at 0 or at the time that the quantities name."""
    from hfsim.studies.static import Wish, run_static

    if isinstance(order.place, str):
        return _turning(order)
    most = max(one.number for one in order.quantities)
    found = run_static(order.load(), Wish(float(order.place), buckling=most))
    if found.status != "done":
        return _without(order, found.reason)
    return tuple(_rested(found, one.channel, one.number) for one in order.quantities)


def _rested(found: Run, channel: str, number: int) -> Answer:
    """Return what a channel is at rest; without one a critical load factor that is reached, from 1."""
    if channel:
        return Answer(found.final[channel])
    facts = found.statistics
    if number > len(facts["critical"]):
        return Answer(None, reason=facts["critical_reason"] or "there are not so many critical loads")
    load = facts["critical"][number - 1]
    if facts["critical_reached"][number - 1]:
        return Answer(load)
    return Answer(None, reason=f"the load factor {load:.4g} is extrapolated from smaller loads, not reached")


def _turning(order: Order) -> tuple[Answer, ...]:
    """Find the steady rotation next to the start; angles are those of the start."""
    from hfsim.studies.modes.about import about

    found = about(order.load(), str(order.place))
    x, u, scene = found.motions.x[None], found.motions.u[None], found.scene
    q, v = scene.system.state(x, u, scene.q[None])
    turns = {name: np.array([angle]) for name, angle in scene.start_angles.items()}
    columns = compute_channels(SceneSamples(scene, np.zeros(1), q, v, turns))
    values = {one.name: float(one.values[0]) for one in columns}
    return tuple(Answer(values[one.channel]) for one in order.quantities)


# --- modes ---------------------------------------------------------------------------------------


def _of_modes(order: Order) -> tuple[Answer, ...]:
    """Find the small motions about a state."""
    from hfsim.scene.measured import without_refused_channels
    from hfsim.studies.modes import modes_of
    from hfsim.studies.modes.about import about

    most, loaded = max(one.number for one in order.quantities), without_refused_channels(order.load())
    modes = modes_of(about(loaded, str(order.place)), most).modes
    found = {one.number: {"frequency": one.frequency, "damping": one.damping_ratio} for one in modes}
    missing = f"of {most} modes there are {len(found)}"
    return tuple(
        Answer(found[one.number][one.kind]) if one.number in found else Answer(None, reason=missing)
        for one in order.quantities
    )


FINDERS: dict[str, Callable[[Order], tuple[Answer, ...]]] = {
    "run": _by_run,
    "static": _at_rest,
    "modes": _of_modes,
}
"""What finds the quantities of each study."""
