"""States, channels and outlines at the output times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.maths.arrays import Array
from hfsim.parts.channels import Samples, kind_of
from hfsim.run.integration import Leg
from hfsim.run.solution import Channel
from hfsim.run.turns import count_turns
from hfsim.scene.build import Scene


@dataclass(frozen=True, eq=False)
class SceneSamples(Samples):
    """Samples of a whole scene, its deck included."""

    scene: Scene


def output_times(scene: Scene) -> Array:
    """Return the output times of a whole run."""
    count = int(np.floor(scene.deck.solve.duration / scene.deck.interval * (1.0 + 1e-12)))
    times = scene.deck.interval * np.arange(count + 1)
    times[-1] = min(times[-1], scene.deck.solve.duration)
    return np.asarray(times)


def sample(scene: Scene, trajectory: Trajectory) -> SceneSamples:
    """Read the trajectory at the output times and move the states onto the joints."""
    times = output_times(scene)
    return samples_at(scene, trajectory, times[times <= trajectory.t_end])


def samples_at(scene: Scene, trajectory: Trajectory, times: Array) -> SceneSamples:
    """Return samples at sorted times."""
    q, v = trajectory.at(times)
    q, v = scene.system.project(times, q, v)
    turns = count_turns(scene, trajectory, times)
    return SceneSamples(scene, times, q, v, turns)


def sample_legs(legs: Sequence[Leg]) -> list[SceneSamples]:
    """Read each leg at its output times; one at which models change belongs to the leg that ends."""
    parts, seen = [], -np.inf
    for leg in legs:
        times = output_times(leg.scene)
        mine = times[(times > seen) & (times <= leg.done.trajectory.t_end)]
        parts.append(samples_at(leg.scene, leg.done.trajectory, mine))
        seen = leg.done.trajectory.t_end
    return parts


def join_channels(samples: Sequence[SceneSamples]) -> tuple[Channel, ...]:
    """Return the columns that the deck asks for, over all legs."""
    parts = [compute_channels(one) for one in samples]
    return tuple(
        Channel(same[0].name, same[0].unit, np.concatenate([one.values for one in same]))
        for same in zip(*parts, strict=True)
    )


def compute_channels(samples: SceneSamples) -> tuple[Channel, ...]:
    """Return the columns that the deck asks for."""
    return tuple(_column(samples, name) for name in samples.scene.deck.channels)


def _column(samples: Samples, name: str) -> Channel:
    kind, subject = kind_of(name), name.rpartition(".")[0]
    return Channel(name, kind.unit, np.ascontiguousarray(kind.compute(samples, subject)))


def outlines_of(samples: Sequence[SceneSamples]) -> dict[str, Array]:
    """Return the outlines of all bodies over all legs; those of a rigid beam get as many points as later."""
    outlines: dict[str, Array] = {}
    for name in samples[0].scene.bodies:
        parts = [one.scene.bodies[name].outline(one.x) for one in samples]
        most = max(part.shape[1] for part in parts)
        outlines[name] = np.concatenate([_refined(part, most) for part in parts])
    return outlines


def _refined(points: Array, count: int) -> Array:
    """Return polylines (n_times, n_points, 2) with straight pieces cut until there are ``count`` points."""
    n = points.shape[1]
    if n == count:
        return points
    at = np.linspace(0.0, n - 1.0, count)
    left = np.minimum(at.astype(int), n - 2)
    share = (at - left)[:, None]
    return np.asarray(points[:, left] * (1.0 - share) + points[:, left + 1] * share)
