"""What the kernel replays is what NumPy computes: forces, joints, balances of every case, and whole runs."""

from pathlib import Path

import numpy as np
import pytest

from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.maths.replayed import Replayed, jittered
from hfsim.maths.traced import apart
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck

pytestmark = pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")
CASES = Path(__file__).parent.parent.parent / "cases"
DECKS = sorted(path.stem for path in CASES.glob("*.yaml"))
STATES = 3


def scene_of(name, *settings):
    return build(load_deck(CASES / f"{name}.yaml", list(settings)))


def states(scene, rng):
    q, v = (np.repeat(one[None], STATES, axis=0) for one in (scene.q, scene.v))
    near = 1.0 + 1e-4 * rng.standard_normal(q.shape)
    return np.array([0.01, 0.1, 0.3]), q * near, v * near + 0.1 * rng.standard_normal(q.shape)


@pytest.mark.parametrize("name", DECKS)
def test_forces_and_balances_are_those_of_numpy(name):
    """To 1e-12 of what they amount to, or ten times what the last digit of a state makes."""
    scene = scene_of(name)
    system, rng = scene.system, np.random.default_rng(3)
    for part in system.forces:

        def force(t, q, v, part=part):
            x = system.absolute(q)
            out = np.zeros_like(x)
            apart(part.add_force, t, x, system.absolute_velocity(q, v), out)
            return out

        compare(force, scene, rng)
    compare(system.acceleration, scene, rng)
    if system.balances:
        a = rng.standard_normal((STATES, system.n))
        compare(lambda t, q, v: np.concatenate(system.imbalance(t, q, v, a), axis=1), scene, rng)


def compare(function, scene, rng):
    replayed = Replayed(function)
    replayed(*states(scene, rng))
    assert replayed.refused is None
    for _ in range(2):
        at = states(scene, rng)
        own, near = function(*at), function(*map(jittered, at))
        reach = 10.0 * np.abs(own - near).max(initial=0.0)
        size = np.abs(own).max(initial=0.0)
        assert np.abs(own - replayed(*at)).max(initial=0.0) <= max(1e-12 * size, reach, 1e-15)


@pytest.mark.parametrize(
    "name, settings",
    [
        ("pendulum", ["solve.duration=0.1"]),
        ("hub_beams", ["solve.duration=0.01"]),
        ("hub_beams", ["solve.duration=0.01", "solve.method=gauss"]),
        ("joints", ["solve.duration=0.05"]),
        ("governor", ["solve.duration=0.02"]),
    ],
)
def test_runs_are_those_of_numpy(name, settings, monkeypatch):
    """To 1e-9, step for step."""
    runs = []
    for way in ("native", "numpy"):
        monkeypatch.setattr(kernel, "KERNEL", way)
        scene = scene_of(name, *settings)
        runs.append(run_integration(scene, scene.deck.solve))
        assert runs[-1].stop is None
    one, other = runs
    assert len(one.trajectory.segments) == len(other.trajectory.segments)
    assert one.trajectory.q == pytest.approx(other.trajectory.q, abs=1e-9)
