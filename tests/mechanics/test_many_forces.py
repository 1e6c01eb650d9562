"""Slopes of many forces, replayed natively, are those that each gives by itself."""

import numpy as np
import pytest
from natively import native

from hfsim.integrators import Recordings
from hfsim.maths import kernel
from hfsim.maths.matrices import dense
from hfsim.mechanics.many_forces import MANY
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

COUNT = 20


def row(dimension, **solve):
    """Bodies in a row, each held by springs with dampers at points off their centres."""
    kind = ("two_point", "bushing")[dimension - 2]
    place = ("[{x}, 0.1]", "[{x}, 0.1, -0.2]")[dimension - 2]
    inertia, gravity = (("0.1", "[0, -9.81]"), ("[0.1, 0.2, 0.15]", "[0, 0, -9.81]"))[dimension - 2]
    arm = ("[0.1, 0.05]", "[0.1, 0.05, 0.02]")[dimension - 2]
    names = range(COUNT)
    deck = {
        "points": ", ".join(f"p{k}: {place.format(x=k)}" for k in names),
        "bodies": "\n".join(
            f"  b{k}: {{type: rigid, mass: 1.0, inertia: {inertia}, points: {{a: {arm}}}}}" for k in names
        ),
        "springs": "\n".join(
            f"  s{k}: {{type: {kind}, between: [ground.p{k}, b{k}.a], stiffness: {200 + k}, damping: 2.0}}"
            for k in names
        ),
        "initial": "\n".join(f"  b{k}: {{position: {place.format(x=k + 0.1)}}}" for k in names),
    }
    assert len(names) >= MANY
    settings = ", ".join(f"{key}: {value}" for key, value in solve.items())
    return parse_deck(f"""hfsim: 1
gravity: {gravity}
ground: {{points: {{{deck["points"]}}}}}
bodies:
{deck["bodies"]}
springs:
{deck["springs"]}
initial:
{deck["initial"]}
solve: {{duration: 1.0, {settings}}}
output: {{interval: 0.1, channels: [b0.x, b3.y, b19.x, energy.total]}}
""")


@native
@pytest.mark.parametrize("dimension", [2, 3])
def test_slopes_are_replayed_as_they_are(dimension):
    scene, recordings = build(row(dimension)), Recordings()
    rng = np.random.default_rng(2)

    def through(name, function, given):
        return recordings.replayed(name, function)(*given)

    for _ in range(3):
        near, rates = scene.q + 0.05 * rng.normal(size=scene.q.shape), rng.normal(size=(1, len(scene.q)))
        q, v = (one[0] for one in scene.system.project(np.zeros(1), near[None], rates))
        own, found = scene.system.linearized(0.2, q, v), scene.system.linearized(0.2, q, v, through)
        for name in ("stiffness", "damping"):
            one, other = dense(getattr(own, name)), dense(getattr(found, name))
            assert np.abs(one).max() > 1.0
            assert np.abs(one - other).max() <= 1e-12 * np.abs(one).max()
    assert len(recordings.mine) == 2 and all(one.refused is None for one in recordings.mine.values())


@native
@pytest.mark.parametrize("method", ["gauss", "gear"])
def test_runs_with_sparse_matrices_are_those_of_numpy(method, monkeypatch):
    monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 0)
    runs = []
    for way in ("native", "numpy"):
        monkeypatch.setattr(kernel, "KERNEL", way)
        runs.append(simulate(row(2, method=method, tolerance="1e-5"), error_estimate=False))
    assert [run.status for run in runs] == ["done", "done"]
    assert np.abs(runs[0].table - runs[1].table).max() <= 1e-9 * np.abs(runs[1].table).max()
