"""States, channels and outlines at the output times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import NamedTuple

import numpy as np

from hfsim.integrators import Trajectory
from hfsim.marching.solution import Channel, Snapshot
from hfsim.marching.turns import read_states
from hfsim.maths.arrays import Array, IntArray, Places, at_once, slices
from hfsim.maths.frozen import frozen
from hfsim.mechanics.counting import Past
from hfsim.parts.channels import Samples, force_columns, kind_of
from hfsim.scene.build import Scene

SLIVER = 1e-9
"""Part of an interval that is no row of its own at the end of a run."""
_ROUNDING = 1e-14
"""Strain that is."""


@frozen
class SceneSamples(Samples):
    """Samples of a whole scene, its deck included.

    Attributes
    ----------
    past : Past
        What forces remember of the motion, once it has ended.
    """

    scene: Scene
    past: Past = field(default_factory=Past)

    def of(self, rows: Places) -> SceneSamples:
        """Return samples at some of the times."""
        turns = {name: angles[rows] for name, angles in self.turns.items()}
        return replace(self, t=self.t[rows], q=self.q[rows], v=self.v[rows], turns=turns)

    def batches(self) -> Iterator[tuple[slice, SceneSamples]]:
        """Yield as many times as are looked at in a batch: where they are, and their samples."""
        parts = slices(len(self.t), at_once(self.scene.system.n))
        yield from ((some, self.of(some) if len(parts) > 1 else self) for some in parts)

    def outline_forces(self, rows: IntArray) -> Iterator[tuple[str, str, Array]]:
        """Yield quantity, body, and internal forces along its outline at some times, (n_rows, n_points)."""
        some = self.of(rows)
        for name, body in self.scene.bodies.items() if len(rows) else ():
            if len(body.outline_places):
                forces = some.forces_along(name, body.outline_places)
                columns = force_columns(body, forces, body.outline_places, len(body.origin))
                yield from ((kind, name, values) for kind, values in columns.items())

    def snapshots(self) -> Iterator[Snapshot]:
        """Yield the bodies at each time."""
        if not len(self.t):
            return
        points = {name: body.outline(self.x) for name, body in self.scene.bodies.items()}
        places = {name: body.outline_places for name, body in self.scene.bodies.items()}
        places = {name: one for name, one in places.items() if len(one)}
        along: dict[str, dict[str, Array]] = {name: self._deflections(name, points[name]) for name in places}
        for kind, name, values in self.outline_forces(np.arange(len(self.t))):
            along[name][kind] = values
        rounding = {name: self._rounding(name) for name in places}
        for k, t in enumerate(self.t.tolist()):
            shape = {name: one[k] for name, one in points.items()}
            inside = {name: {kind: one[k] for kind, one in own.items()} for name, own in along.items()}
            yield Snapshot(t, shape, places, inside, rounding)

    def _rounding(self, name: str) -> dict[str, float]:
        """Return how large deflection and internal forces along a beam are where its strain is rounding."""
        body = self.scene.bodies[name]
        places = body.outline_places
        section = self.scene.deck.section_properties(name).at(places / places[-1])
        force = _ROUNDING * float(np.max(section.axial_stiffness))
        depth = float(np.sqrt(np.max(np.divide(section.bending_stiffness, section.axial_stiffness))))
        forces = np.tile(force * np.array([1.0, 1.0, 1.0, depth, depth, depth]), (len(places), 1))
        found = force_columns(body, forces, places, len(body.origin))
        return {
            **dict.fromkeys(("deflection", "deflection_y", "deflection_z"), _ROUNDING * float(places[-1])),
            **{kind: float(values.max()) for kind, values in found.items()},
        }

    def _deflections(self, name: str, points: Array) -> dict[str, Array]:
        """Return how far points (n_times, n_points, n_dim) are from the first axis of their frame [m]."""
        marker = self.scene.marker(name)
        gap = points - marker.position(self.x)[:, None]
        if gap.shape[2] == 2:
            angle = marker.angle(self.x)[:, None]
            return {"deflection": gap[..., 1] * np.cos(angle) - gap[..., 0] * np.sin(angle)}
        seen = gap @ self.frame(name)
        return {"deflection_y": seen[..., 1], "deflection_z": seen[..., 2]}


def output_times(scene: Scene) -> Array:
    """Return the output times of a whole run: every interval, and its end."""
    duration, interval = scene.deck.solve.duration, scene.deck.interval
    count = int(np.floor(duration / interval * (1.0 + 1e-12)))
    times = interval * np.arange(count + 1)
    times[-1] = min(times[-1], duration)
    return np.append(times, duration) if duration - times[-1] > SLIVER * interval else times


def sample(scene: Scene, trajectory: Trajectory) -> SceneSamples:
    """Read the trajectory at the output times and move the states onto the joints."""
    times = output_times(scene)
    return samples_at(scene, trajectory, times[times <= trajectory.t_end])


def samples_at(
    scene: Scene, trajectory: Trajectory, times: Array, angles: Mapping[str, float] | None = None
) -> SceneSamples:
    """Return samples at sorted times; angles as in `read_states`."""
    return samples_of(scene, times, *read_states(scene, trajectory, times, angles), trajectory.past)


def samples_of(
    scene: Scene, t: Array, q: Array, v: Array, turns: dict[str, Array], past: Past
) -> SceneSamples:
    """Return samples of states as they were read, which are moved onto the joints."""
    parts = slices(len(t), at_once(scene.system.n))
    moved = [scene.system.project(t[some], q[some], v[some]) for some in parts]
    if moved:
        q, v = (np.concatenate(one) for one in zip(*moved, strict=True))
    return SceneSamples(scene, t, q, v, turns, past)


def compute_channels(samples: SceneSamples) -> tuple[Channel, ...]:
    """Return all columns that the deck asks for."""
    return channels_of(samples.scene.deck.channels, table_of(samples))


def table_of(samples: SceneSamples, names: Sequence[str] = ()) -> Array:
    """Return times and some columns, or all that the deck asks for, as rows (n_times, 1 + n_channels)."""
    names = names or samples.scene.deck.channels
    table = np.empty((len(samples.t), 1 + len(names)))
    table[:, 0] = samples.t
    with samples.past.recalled():
        for some, part in samples.batches():
            for k, name in enumerate(names, start=1):
                table[some, k] = kind_of(name, samples.scene.deck).compute(part, name.rpartition(".")[0])
    return table


def channels_of(names: Sequence[str], table: Array) -> tuple[Channel, ...]:
    """Return the columns of a table, (n_times, 1 + n_channels), times first."""
    columns = np.ascontiguousarray(table.T[1:])
    return tuple(Channel(n, kind_of(n).unit, one) for n, one in zip(names, columns, strict=True))


class Outlines(NamedTuple):
    """Points along all bodies over all legs of a run.

    Attributes
    ----------
    t : ndarray, shape (n,)
    points : dict of str to ndarray, shape (n, n_points, n_dim)
    rows : ndarray of int, shape (n,)
        Which of all states of the samples each is.
    """

    t: Array
    points: dict[str, Array]
    samples: Sequence[SceneSamples]
    rows: IntArray

    def forces(self, numbers: IntArray) -> dict[str, dict[str, Array]]:
        """Return internal forces at the points of some outlines, (n_numbers, n_points), by name and body.

        They are zero in bodies without strains.
        """
        found: dict[str, dict[str, Array]] = {}
        rows, first = self.rows[numbers], 0
        for samples in self.samples:
            here = (first <= rows) & (rows < first + len(samples.t))
            for kind, name, values in samples.outline_forces(rows[here] - first):
                shape = len(rows), self.points[name].shape[1]
                own = found.setdefault(kind, {}).setdefault(name, np.zeros(shape))
                own[here] = _refined(values[..., None], shape[1])[..., 0]
            first += len(samples.t)
        return found


def outlines_of(samples: Sequence[SceneSamples]) -> Outlines:
    """Return times and outlines of all bodies over all legs; a rigid beam gets as many points as later.

    Those of states that are out of all range at the end of a failed run are left out.  A leg between two
    output times has none.
    """
    times, outlines = np.concatenate([one.t for one in samples]), dict[str, Array]()
    for name, body in samples[0].scene.bodies.items():
        parts = [one.scene.bodies[name].outline(one.x) for one in samples if len(one.t)]
        most = max((part.shape[1] for part in parts), default=1)
        nowhere = np.zeros((0, most, len(body.origin)))
        outlines[name] = np.concatenate([nowhere, *(_refined(part, most) for part in parts)])
    good = np.all([np.isfinite(one).all(axis=(1, 2)) for one in outlines.values()], axis=0)
    points = {name: one[good] for name, one in outlines.items()}
    return Outlines(times[good], points, samples, np.flatnonzero(good))


def _refined(points: Array, count: int) -> Array:
    """Return polylines (n_times, n_points, n_dim), straight pieces cut until they have ``count`` points."""
    n = points.shape[1]
    if n == count:
        return points
    at = np.linspace(0.0, n - 1.0, count)
    left = np.minimum(at.astype(int), n - 2)
    share = (at - left)[:, None]
    return np.asarray(points[:, left] * (1.0 - share) + points[:, left + 1] * share)
