"""How what is collected changes with entries of a deck: differences, and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hfsim.deck.overrides import unit_of, why_unset
from hfsim.deck.ranges import Value
from hfsim.deck.source import Setting as Override
from hfsim.deck.source import entry_at, path_in
from hfsim.deck.units import quantity_of_any_kind
from hfsim.errors import DeckError, DeckProblem
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.schema import Deck
from hfsim.simulate import simulate
from hfsim.studies.collect import Collector
from hfsim.studies.sweep.collected import COLLECT
from hfsim.studies.sweep.plan import VARY, Plan, SweepError, listed
from hfsim.studies.sweep.result import Sweep
from hfsim.studies.sweep.study import refused
from hfsim.studies.sweep.work import Setting

_AROUND = (1.0, -1.0, 0.5, -0.5)
"""Where runs are made beside the deck's own value, in steps."""
_SHORTEST, _LONGEST = 1e-5, 0.05
"""Shares of a value that a step may be."""
_ROUNDING = 1e-15


@dataclass(frozen=True)
class Differences:
    """What differences are made of.

    Attributes
    ----------
    values, steps : dict of str to float
        By path: the value of the deck, and the longer step.
    errors : tuple of float
        Error of each quantity in a run, in its unit.
    """

    values: dict[str, float]
    steps: dict[str, float]
    errors: tuple[float, ...]


@dataclass(frozen=True)
class Sensitivity:
    """A derivative.

    Attributes
    ----------
    at, step : float
        Value of the entry, and the longer of both steps.
    value, derivative : float or None
        Of the quantity; None where runs gave nothing.
    error : float or None
        How far the derivative may be off: what the shorter step changes, and errors in time over the step.
    side : str
        ``up`` or ``down`` where runs gave something there alone, as at a limit of the entry; else ``both``.
    """

    quantity: str
    path: str
    at: float
    step: float
    value: float | None = None
    derivative: float | None = None
    error: float | None = None
    side: str = "both"

    @property
    def elasticity(self) -> float | None:
        """Per cent that the quantity changes for one per cent of the entry; None where either is zero."""
        if self.derivative is None or not self.value or not self.at:
            return None
        return self.derivative * self.at / self.value

    @property
    def sure(self) -> bool:
        """Whether the error is below a tenth of the derivative."""
        return self.derivative is not None and (self.error or 0.0) < 0.1 * abs(self.derivative)


def values_of(loaded: LoadedDeck, setting: Setting, vary: Mapping[str, str]) -> dict[str, float]:
    """Return the value of each entry: the one that is said, or the deck's.

    Raises
    ------
    DeckError
        With all entries that are no numbers, and what is collected that is not of runs.
    """
    found, wrong = dict[str, float](), list[DeckProblem]()
    for one in setting.quantities:
        if one.number:
            why = "derivatives are of numbers of runs alone, not of frequencies and the like"
            wrong.append(DeckProblem(str(one), why, file=COLLECT))
    for path, text in vary.items():
        value = _number(loaded, path, text)
        if isinstance(value, float):
            found[path] = value
            wrong += _none_beside(setting, path, value)
        elif why_unset(loaded.source.data, path, Deck) is None:  # else that is told
            wrong.append(DeckProblem(path, *value, file=VARY))
    if wrong:
        raise DeckError(VARY, wrong)
    return found


def _none_beside(setting: Setting, path: str, value: float) -> Iterator[DeckProblem]:
    """Yield that an entry is refused on both sides of its value, as a count is."""
    step = _SHORTEST * (abs(value) or 1.0)
    at, above, below = (refused(setting, path, one) for one in (value, value + step, value - step))
    if at is None and above is not None and below is not None:
        why = f"has no derivative, as values beside {value:g} are refused: {above.message}"
        yield DeckProblem(path, why, file=VARY)


def plan_differences(setting: Setting, values: dict[str, float]) -> tuple[Plan, Differences]:
    """Return the runs that derivatives need: the deck's own, and four for each entry.

    Steps are such that errors of runs and of differences are about alike: the cube root of the error in time
    of what is collected, over its size, is the share of the entry that a step is.

    Raises
    ------
    DeckError
        If the deck is refused with the values.
    SweepError
        If the deck's own run fails.
    """
    own = tuple(Override.by(VARY, f"{path}={value!r}") for path, value in values.items())
    loaded, quantities = setting.of_run(own)
    collector = Collector(quantities)
    run = simulate(loaded, outlines=False, after=math.inf, reader=collector)
    if run.status != "done":
        raise SweepError(f"the deck's own run gives nothing to differentiate: {run.status}: {run.reason}")
    found = [collector.value(one, run) for one in quantities]
    by_channel = run.statistics.get("error_by_channel") or {}
    errors = tuple(
        max(by_channel.get(one.channel, 0.0), _ROUNDING * abs(value))
        for one, value in zip(quantities, found, strict=True)
    )
    noise = max(
        (error / abs(value) for error, value in zip(errors, found, strict=True) if value), default=0.0
    )
    share = min(max(noise ** (1.0 / 3.0), _SHORTEST), _LONGEST)
    steps = {path: float(f"{share * (abs(value) or 1.0):.3g}") for path, value in values.items()}
    rows: list[tuple[Value, ...]] = [tuple(values.values())]
    for path in values:
        rows += [
            tuple(value + (part * steps[path] if other == path else 0.0) for other, value in values.items())
            for part in _AROUND
        ]
    facts = {"kind": "sensitivity", "values": values, "steps": steps}
    return listed(tuple(values), rows, facts), Differences(values, steps, errors)


def _number(loaded: LoadedDeck, path: str, text: str) -> float | tuple[str, str]:
    """Return the value of an entry, or why it is none and what would be one."""
    if text:
        try:
            return float(text)
        except ValueError:
            found = quantity_of_any_kind(text)
            unit = unit_of(loaded.deck, path_in(loaded.source.data, path))
            if found and (path.startswith("parameters.") or found[1].strip("-") == unit):
                return found[0]
            what = f"one number in {unit}" if unit else "one number"
            return f"'{text}' is not {what}", "derivatives are at one value, or at the deck's own"
    data: Any = loaded.source.data if path.startswith("parameters.") else loaded.deck.resolved()
    values = [entry_at(data, one) for one in loaded.source.paths_of(path)]
    if not values:
        return "the deck has no such pattern", ""
    value = values[0]
    if other := next((one for one in values if one != value), None):
        why = f"its copies differ, as {value} and {other} do, and derivatives are at one value"
        return why, "vary copies one by one, or a parameter"
    if isinstance(value, str) and path.startswith("parameters."):
        value = (quantity_of_any_kind(value) or (value,))[0]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "the deck has no number there", "say at which one"
    return float(value)


def sensitivities(sweep: Sweep, made: Differences) -> tuple[Sensitivity, ...]:
    """Return the derivatives of all that is collected by all that is varied."""
    return tuple(
        _sensitivity(sweep[name], k, name, path, error, made)
        for name, error in zip(sweep.collected, made.errors, strict=True)
        for k, path in enumerate(sweep.paths)
    )


def _sensitivity(
    values: Any, k: int, name: str, path: str, noise: float, made: Differences
) -> Sensitivity:
    """Return the derivative by the entry number `k`."""
    at, step = made.values[path], made.steps[path]
    mine: Sequence[float] = values[1 + len(_AROUND) * k : 1 + len(_AROUND) * (k + 1)]
    here, (up, down, half_up, half_down) = float(values[0]), map(float, mine)
    for side, way, far, near in (("up", 1.0, up, half_up), ("down", -1.0, down, half_down)):
        if np.isfinite([here, far, near]).all() and np.isnan(mine).any():
            long, short = way * (far - here) / step, 2.0 * way * (near - here) / step
            better = 2.0 * short - long  # without the error of first order
            error = abs(better - short) + 8.0 * noise / step
            return Sensitivity(name, path, at, step, here, better, error, side)
    if np.isnan(mine).any() or np.isnan(here):
        return Sensitivity(name, path, at, step)
    long, short = (up - down) / (2.0 * step), (half_up - half_down) / step
    better = (4.0 * short - long) / 3.0  # without the error of second order
    error = abs(better - short) + 2.0 * noise / step
    return Sensitivity(name, path, at, step, here, better, error)
