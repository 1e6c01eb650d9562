"""How well a solution is known: two methods, ever tighter, until they agree.

What is left between them is the floor of each channel, below which no error is a number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hfsim.errors import HfsimError
from hfsim.marching.alike import alike
from hfsim.marching.distance import ChannelScale, gap, reference_scales
from hfsim.marching.sampling import compute_channels, sample
from hfsim.marching.solution import Channel
from hfsim.marching.stop import Budget, Progress, TimeUp
from hfsim.scene.build import Scene
from hfsim.scene.schema import SolveSpec
from hfsim.studies.timing import solved

LADDER = (1e-7, 1e-9, 1e-11, 1e-13)
"""Tolerances of the two, tried in this order."""

REFERENCES = (("gauss", 16, 1.0), ("radau", 16, 0.1))
"""The two methods that must agree, each with its stages and a factor on the tolerance; the first one
gives the reference."""

ROUND_OFF = 1e-14
"""Relative error that no reference is trusted below, however well its two methods agree."""

_GROWTH = 2.5
"""Growth of the cost from one rung of `LADDER` to the next."""


@dataclass(frozen=True)
class Agreement:
    """A reference: its channels, what errors are divided by, and how far its two methods differ.

    Attributes
    ----------
    floors : dict of str to float
        The last by channel, over the channel's scale [-].
    how : str
        The methods in words.
    """

    channels: tuple[Channel, ...]
    scales: tuple[ChannelScale, ...]
    floors: dict[str, float]
    how: str


def tidy(number: float) -> str:
    """Return a number with one digit.

    Examples
    --------
    >>> tidy(1e-7), tidy(3.2e-11)
    ('1e-7', '3e-11')
    """
    return f"{number:.0e}".replace("e-0", "e-").replace("e+0", "e+")


def way_in_words(method: str, stages: int | None, tolerance: float) -> str:
    """Return how a reference is solved."""
    return f"{method} ({stages} stages, tolerance {tidy(tolerance)})"


def solve_of(scene: Scene, method: str, level: float, fixed: bool, stages: int | None = None) -> SolveSpec:
    """Return how to solve a scene with a method at a tolerance, or with a fixed step."""
    asked = {"step": level} if fixed else {"tolerance": level, "step": None}
    # stages and order of the deck are kept where a point uses the deck's own method
    own = scene.deck.solve.method == method and stages is None
    options = {} if own else {"stages": stages, "order": None}
    return scene.deck.solve.model_copy(update={"method": method, **asked, **options})


def floors_of(
    channels: Sequence[Channel], others: Sequence[Channel], scales: Sequence[ChannelScale]
) -> dict[str, float]:
    """Return how far two solutions differ by channel, over the scales of the first [-]."""
    return {
        scale.channel: max(ROUND_OFF, gap(one.values, two.values).largest / scale.scale)
        for scale, one, two in zip(scales, channels, alike(others, channels), strict=True)
    }


def agreement(scene: Scene, tolerance: float, guard: Progress) -> tuple[Agreement | HfsimError, float]:
    """Return the first of two solutions, its distance to the second, and the CPU time [s]; raise `TimeUp`."""
    runs, spent = [], 0.0
    for method, stages, factor in REFERENCES:
        done, cpu = solved(scene, solve_of(scene, method, factor * tolerance, False, stages), guard)
        spent += cpu
        if isinstance(done.in_time().stop, HfsimError):
            return done.stop, spent  # type: ignore[return-value]
        samples = sample(scene, done.trajectory)
        runs.append(compute_channels(samples))
    channels, others = runs
    scales = reference_scales(samples, channels)
    how = (way_in_words(method, stages, factor * tolerance) for method, stages, factor in REFERENCES)
    return Agreement(channels, scales, floors_of(channels, others, scales), " against ".join(how)), spent


def agreements(
    scene: Scene, budget: Budget, allowed: float, must: bool = False, ladder: Sequence[float] = LADDER
) -> Iterator[tuple[Agreement | HfsimError, float]]:
    """Yield what ever tighter tolerances give within `allowed` seconds; if it must, a first at any price."""
    end = budget.used + allowed
    for level in ladder:
        start = budget.used
        left = np.inf if must and level == ladder[0] else end - start
        try:
            yield agreement(scene, level, budget.guard(left))
        except TimeUp:
            return
        if budget.used + _GROWTH * (budget.used - start) > end:
            return
