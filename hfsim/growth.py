"""Physical instability: whether a small disturbance of the start grows without bound along a run.

Buckling and parametric resonance leave no trace in an undisturbed run, and neither method nor model
makes them.  The same scene started a little beside shows them: in a stable scene the two motions stay
near one another or part slowly, in an unstable one their distance grows exponentially.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hfsim.build import Scene
from hfsim.integration import Integration, Watch, run_integration

DISTURBANCE = 1e-6
"""Of all coordinates and rates at the start, absolute."""
GROWN = 100.0
"""Growth of the distance from which a scene is unstable."""
LASTING = 5.0
"""Growth that the second half of the growing part must still have: what parts steadily grows less."""
TIMES = 400
"""Times at which the motions are compared."""


@dataclass(frozen=True)
class Growth:
    """How far two motions part that start beside one another.

    Attributes
    ----------
    factor : float
        Largest distance over that in the first tenth of the run.
    rate : float
        Mean exponent of the growth [1/s].
    """

    factor: float
    rate: float


def loaded_items(scene: Scene) -> list[str]:
    """Return the deck paths of loads and drivers, those with a periodic law first."""
    loads = [f"loads.{name}" for name in scene.deck.loads]
    drivers = [f"joints.{name}" for name, joint in scene.deck.joints.items() if joint.type == "driver"]
    return sorted([*loads, *drivers], key=lambda item: amplitude_of(scene, item) is None)


def amplitude_of(scene: Scene, item: str) -> tuple[str, float] | None:
    """Return deck path and value of the amplitude of a periodic law of a load or driver, if it has one."""
    kind, name = item.split(".", 1)
    entry: Any = (scene.deck.loads if kind == "loads" else scene.deck.joints)[name]
    for key in ("law", "angle", "position"):
        law: Any = getattr(entry, key, None)
        if getattr(law, "type", "") == "sine":
            return f"{item}.{key}.amplitude", float(law.amplitude)
    return None


def disturbed_growth(scene: Scene, done: Integration, watch: Watch) -> Growth | None:
    """Run a scene again from beside its start; return how the motions part if they do so exponentially.

    Parameters
    ----------
    scene : Scene
    done : Integration
        The undisturbed run.
    watch : callable
        May end the second run; what it did until then is compared.
    """
    noise = np.random.default_rng(1).normal(size=(2, 1, scene.system.n)) * DISTURBANCE
    q, v = scene.system.project(np.zeros(1), scene.q[None] + noise[0], scene.v[None] + noise[1])
    again = run_integration(scene, scene.deck.solve, start=(0.0, q[0], v[0]), extra=watch).trajectory
    end = min(again.t_end, done.trajectory.t_end)
    if not end:
        return None
    times = np.linspace(0.0, end, TIMES + 1)
    system = scene.system
    apart = system.absolute(again.at(times)[0]) - system.absolute(done.trajectory.at(times)[0])
    distance = np.maximum.accumulate(np.linalg.norm(apart, axis=1))
    first = float(distance[TIMES // 10])
    top = int(np.argmax(distance >= 0.5 * distance[-1]))
    factor, later = float(distance[top]) / first, float(distance[top] / distance[(TIMES // 10 + top) // 2])
    if factor < GROWN or later < LASTING:
        return None
    return Growth(factor, float(np.log(factor) / (times[top] - times[TIMES // 10])))
