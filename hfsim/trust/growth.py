"""Physical instability: whether a small disturbance of the start grows without bound along a run.

Buckling and parametric resonance leave no trace in an undisturbed run, and neither method nor model
makes them.  The same scene started a little beside shows them: in a stable scene the two motions stay
near one another or part slowly, in an unstable one their distance grows exponentially.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from typing import NamedTuple

import numpy as np

from hfsim.deck.spec import Spec
from hfsim.marching.integration import Integration, run_integration
from hfsim.marching.rounding import ROUNDING
from hfsim.marching.stop import Progress
from hfsim.maths.arrays import Array
from hfsim.maths.matrices import factorised
from hfsim.mechanics.system import System
from hfsim.scene.build import Scene
from hfsim.scene.schema import SolveSpec
from hfsim.trust.experiments import DENSE

UNSTABLE = 30.0
"""Factor by which a tiny disturbance grows while the time doubles, from which a scene is unstable: growth
that is no more than a power of time (drifting apart at constant speed: 2) stays far below."""
QUARTERS = 4
"""Parts of such a time; the one of most growth leaves a share of the logarithm of growth that goes on."""
KICK = 1e2
"""Size of that disturbance over the tolerance it is solved with, relative to the largest speed of the motion:
what grows must not be the error of the integration."""
_MOST_KICK = 1e-4
_SWINGS = 50.0
"""Radians within the duration above which a mode counts as fast for the disturbance."""
WINDOWS = 8
"""Parts of the duration in each of which the largest distance is looked at."""
_TIMES = 400
"""Times at which the motions are compared."""
_LEFT = 1e-3
"""Share of a disturbance that joints and drivers must leave of it; less is their rounding."""
_TWICE, _SEEN = 1.4, 1e-2
"""How near to two the ratio of distances is that a kick and its half make, and share of the extent of the
motion from which it need not be: what friction leaves of a kick is less than the errors of both runs."""
_WHOLE = 0.5
"""Part of the run that the disturbed one must reach to be compared."""


class Growth(NamedTuple):
    """How fast two motions part that start beside one another.

    Attributes
    ----------
    factor : float
        By which their distance grows while the time doubles, at most.
    rate : float
        Mean exponent of that growth [1/s].
    """

    factor: float
    rate: float

    @property
    def unstable(self) -> bool:
        """Whether no power of time explains it."""
        return self.factor > UNSTABLE


def loaded_items(scene: Scene) -> list[str]:
    """Return the deck paths of loads and of joints driven by laws, those with a periodic law first."""
    loads = [f"loads.{name}" for name in scene.deck.loads]
    driven = dict.fromkeys(row.item for row in scene.system.constraints if row.driven)
    acting = (part.item for part in scene.system.forces if part.laws)
    driven |= dict.fromkeys(item for item in acting if item.startswith("joints."))
    return sorted([*loads, *driven], key=lambda item: amplitude_of(scene, item) is None)


def amplitude_of(scene: Scene, item: str) -> tuple[str, float] | None:
    """Return deck path and value of the amplitude of a periodic law of a load or joint, if it has one."""
    kind, name, *keys = item.split(".")
    return next(_amplitudes(item, reduce(getattr, keys, getattr(scene.deck, kind)[name])), None)


def _amplitudes(path: str, entry: Spec) -> Iterator[tuple[str, float]]:
    """Yield deck path and value of the amplitudes of periodic laws in an entry of a deck."""
    for key, own in entry:
        if hasattr(own, "amplitude"):
            yield f"{path}.{key}.amplitude", float(own.amplitude)
        elif isinstance(own, Spec):
            yield from _amplitudes(f"{path}.{key}", own)


def disturbed_growth(scene: Scene, done: Integration, solve: SolveSpec, guard: Progress) -> Growth | None:
    """Run a scene again from beside its start and return how the two motions part.

    Parameters
    ----------
    done : Integration
        The undisturbed run.
    solve : SolveSpec
        How that was solved.
    guard : callable
        May end the second run; told the share of the duration that is done.

    Returns
    -------
    Growth or None
        None if nothing is free to be disturbed, or too little of the second run was done, or the scene is
        too large for dense algebra and has no other; or if not all of the run is known, as it was taken up
        again or is too long to be kept; or if what grows is none of the disturbance.

    Raises
    ------
    KeyboardInterrupt
        If that ended the second run.
    """
    system, path = scene.system, done.trajectory
    if (system.n > DENSE and not system.linearizes) or path.t_start > 0.0 or path.condensed:
        return None
    states = path.at(np.linspace(0.0, path.t_end, _TIMES + 1))
    speed = _largest_speed(system, *states, max(solve.tolerance, ROUNDING))
    kick = min(KICK * solve.tolerance, _MOST_KICK) * speed * _slow_direction(scene, done)
    apart = _apart(scene, done, solve, guard, kick)
    if apart is None:
        return None
    found = growth_of(*apart)
    if found.unstable:
        half = _apart(scene, done, solve, guard, 0.5 * kick)
        extent = float(np.ptp(system.absolute(states[0]), axis=0).max())
        if half is None or not _of_the_kick(apart[1], half[1], extent):
            return None
    return found


def _apart(
    scene: Scene, done: Integration, solve: SolveSpec, guard: Progress, kick: Array
) -> tuple[Array, Array] | None:
    """Return times, and how far a run with disturbed rates is from an undisturbed one, if enough is known."""
    system, path = scene.system, done.trajectory
    start, rates = system.project(np.zeros(1), scene.q[None], scene.v[None] + kick)
    if np.abs(rates[0] - scene.v).max(initial=0.0) <= _LEFT * np.abs(kick).max(initial=0.0):
        return None
    tried = run_integration(scene, solve, guard, (0.0, start[0], rates[0]))
    if isinstance(tried.stop, KeyboardInterrupt):
        raise tried.stop
    again = tried.trajectory
    end = min(again.t_end, path.t_end)
    if not end > _WHOLE * path.t_end:
        return None
    times = np.linspace(0.0, end, _TIMES + 1)
    apart = system.absolute(again.at(times)[0]) - system.absolute(path.at(times)[0])
    return times, np.abs(apart).max(axis=1)


def _of_the_kick(apart: Array, half: Array, extent: float) -> bool:
    """Tell whether distances are twice those of half the kick, or so large that this need not be."""
    last = min(len(apart), len(half))
    largest, smaller = apart[:last].max(), half[:last].max()
    twice = 2.0 * smaller < _TWICE * largest and largest < _TWICE * 2.0 * smaller
    return bool(twice or smaller > _SEEN * extent)


def _largest_speed(system: System, q: Array, v: Array, least: float) -> float:
    """Return the largest speed of a motion; one at rest, for no share of errors is a disturbance.

    What moves by a part of its coordinates that is below this one is at rest but for errors of the steps.
    """
    x = system.absolute(q)
    if np.abs(x - x[0]).max(initial=0.0) <= least * np.abs(x).max(initial=0.0):
        return 1.0
    return float(np.abs(system.absolute_velocity(q, v)).max())


def _slow_direction(scene: Scene, done: Integration) -> Array:
    """Return velocities of size one in which modes that swing often within the duration hardly take part.

    Instabilities grow in slow modes; fast ones would only make the disturbed run expensive.
    """
    system, slow = scene.system, scene.deck.solve.duration / _SWINGS
    random = np.random.default_rng(1).standard_normal(system.n)
    near = done.problem.near(0.0, scene.q, scene.v)
    matrix, weighted = near.implicit(slow**2), near.mass @ random
    if near.sparse:
        direction = factorised(matrix)(weighted)
    else:
        direction = np.linalg.lstsq(matrix, weighted, rcond=None)[0]
    return np.asarray(direction / max(float(np.abs(direction).max()), 1e-300))


def growth_of(times: Array, distance: Array) -> Growth:
    """Return the largest growth of a distance while the time doubles.

    What grows at once, as by an impact, counts as the square of what the rest of that time makes of it.

    Parameters
    ----------
    times, distance : ndarray, shape (n,)
        At evenly spaced times, the first one the start.

    Examples
    --------
    >>> t = np.linspace(0.0, 8.0, 801)
    >>> round(growth_of(t, t).factor, 3), round(growth_of(t, np.exp(t) - 1.0).factor)
    (2.0, 56)
    >>> growth_of(t, np.where(t < 3.0, 1.0, 1e4)).factor
    1.0
    """
    most = np.maximum.accumulate(distance)
    at = np.linspace(0, len(distance) - 1, WINDOWS + 1).astype(int)
    best = Growth(1.0, 0.0)
    for early, late in ((at[k], at[2 * k]) for k in range(1, WINDOWS // 2 + 1)):
        parts = most[np.linspace(early, late, QUARTERS + 1).astype(int)]
        grown = parts[1:] / parts[:-1] if most[early] > 0.0 else np.ones(QUARTERS)
        factor = float(min(grown.prod(), (grown.prod() / grown.max()) ** 2))
        if factor > best.factor:
            best = Growth(factor, float(np.log(factor) / (times[late] - times[early])))
    return best
