"""What the kernel replays is what NumPy computes: forces, joints, balances of every case, and whole runs."""

from pathlib import Path

import numpy as np
import pytest
from natively import at_once, evaluates_alike, iterated, native, states

from hfsim.integrators._closing import Closing
from hfsim.integrators._ending import Ending, limits
from hfsim.integrators._replayed import Replay
from hfsim.integrators.collocation import CollocationStepper
from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.maths.recording import Recorder
from hfsim.maths.replayed import Replayed
from hfsim.mechanics.counting import Turns
from hfsim.mechanics.projection import ROUNDING, Projection
from hfsim.output.writers import Provenance, summary_of
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

pytestmark = native
CASES = Path(__file__).parent.parent.parent / "cases"
DECKS = sorted(path.stem for path in CASES.glob("*.yaml"))


def scene_of(name, *settings):
    return build(load_deck(CASES / f"{name}.yaml", list(settings)))


@pytest.mark.parametrize("name", DECKS)
def test_forces_and_balances_are_those_of_numpy(name):
    evaluates_alike(scene_of(name))


RUBBER = """hfsim: 1
gravity: [0.0, -9.81]
materials: {m: {density: 1100.0, youngs_modulus: 5.0e6, bending_damping: 0.01}}
sections: {s: {shape: circle, radius: 0.012}}
bodies: {arm: {type: beam, material: m, section: s, length: 0.8, elements: 3}}
joints: {pin: {type: revolute, between: [ground, arm.root], friction: {torque: 0.3, velocity: 0.01}}}
solve: {duration: 0.2, tolerance: 1.0e-6}
"""


@pytest.mark.parametrize("method", ["gear", "generalized_alpha"])
def test_corrections_of_damped_scenes_are_recorded(method, monkeypatch):
    refused, record = [], Replayed._record

    def noted(self, given):
        record(self, given)
        refused.append(self.refused)

    monkeypatch.setattr(Replayed, "_record", noted)
    run = simulate(parse_deck(RUBBER, overrides=[f"solve.method={method}"]), error_estimate=False)
    assert run.status == "done" and refused and not any(refused)


SPRUNG = """hfsim: 1
gravity: [0.0, -9.81]
bodies:
  a: {type: rigid, mass: 2.0, inertia: 0.05, points: {root: [-0.25, 0.0], tip: [0.25, 0.0]}}
  b: {type: rigid, mass: 2.0, inertia: 0.05, points: {root: [-0.25, 0.0]}}
springs:
  s: {type: bushing, between: [ground, a.root], stiffness: 1.0e5, damping: 50, rotational_stiffness: 200}
  t: {type: bushing, between: [a.tip, b.root], stiffness: 1.0e5, damping: 50, rotational_stiffness: 200}
solve: {duration: 2.0, tolerance: 1.0e-4, method: radau}
"""


def test_steps_are_recorded_once_where_stiff_ones_are_made_as_others(monkeypatch):
    """Rigid bodies in the plane have no natural coordinates but their own."""
    scene, stiff, choose = build(parse_deck(SPRUNG)), [], CollocationStepper._choose
    monkeypatch.setattr(CollocationStepper, "_choose", lambda own, now: (stiff.append(now), choose(own, now)))
    run_integration(scene, scene.deck.solve)
    recorded = [one for kept in scene.recordings.values() for one in kept.values()]
    assert {False, True} <= set(stiff) and sum(isinstance(one, Replay) for one in recorded) == 1


@pytest.mark.parametrize(
    "name, settings",
    [
        ("pendulum", ["solve.duration=0.1"]),
        ("hub_beams", ["solve.duration=0.01"]),
        ("hub_beams", ["solve.duration=0.01", "solve.method=gauss"]),
        ("joints", ["solve.duration=0.2"]),
        ("governor", ["solve.duration=0.02"]),
        ("heavy_top", ["solve.duration=0.3"]),
        ("heavy_top", ["solve.duration=0.02", "solve.method=gear"]),
        ("pendulum", ["solve.duration=0.3", "solve.coordinates=frame"]),
        ("hub_beams", ["solve.tolerance=1e-3"]),
        ("two_beams_relative", ["solve.tolerance=1e-4"]),
        ("pendulum", ["solve.model=linear", "solve.duration=0.3"]),
        ("two_beams", ["solve.model=lowOrder", "solve.duration=0.3"]),
        ("pendulum_3d", ["solve.model=linear", "solve.duration=0.3"]),
        ("door", ["solve.model=lowOrder", "solve.duration=0.5"]),
    ],
)
def test_runs_are_those_of_numpy(name, settings, monkeypatch):
    """To 1e-9, step for step."""
    at_once(monkeypatch)
    runs = []
    for way in ("native", "numpy"):
        monkeypatch.setattr(kernel, "KERNEL", way)
        scene = scene_of(name, *settings)
        runs.append(run_integration(scene, scene.deck.solve))
        assert runs[-1].stop is None
        problem = runs[-1].problem  # whole steps are replayed, or corrections and accelerations one by one
        used = problem.often.chosen if name == "heavy_top" else problem.counts.native
        assert bool(used) == (way == "native")
    one, other = runs
    assert len(one.trajectory.segments) == len(other.trajectory.segments)
    assert one.trajectory.q == pytest.approx(other.trajectory.q, abs=1e-9)


SINGLE = {"gear": "correction", "generalized_alpha": "correction", "explicit": "step", "energy": "correction"}


@pytest.mark.parametrize(
    "method, name",
    [(method, name) for method in SINGLE for name in ("pendulum", "heavy_top", "hub_beams_soft")],
)
def test_steps_of_other_methods_are_those_of_numpy(method, name, monkeypatch):
    """To 1e-9, step for step; what a run is told, as its tolerance, is no constant of a recording."""
    at_once(monkeypatch)
    runs, settings = [], (f"solve.method={method}", "solve.tolerance=1e-5", "solve.max_steps=25")
    scene = scene_of(name, *settings)
    for way, tolerance in (("native", 1e-3), ("native", 1e-5), ("numpy", 1e-5)):
        monkeypatch.setattr(kernel, "KERNEL", way)
        done = run_integration(scene, scene.deck.solve.model_copy(update={"tolerance": tolerance}))
        runs.append(done)
        chosen = done.problem.often.chosen
        assert any(SINGLE[method] in one for one in chosen) == (way == "native")
    kept = [one for recorded in scene.recordings.values() for one in recorded.values()]
    assert kept and all(getattr(one, "refused", None) is None for one in kept)
    one, other = (run.trajectory for run in runs[1:])
    assert len(one.segments) == len(other.segments)
    assert one.q == pytest.approx(other.q, abs=1e-9)


@pytest.mark.parametrize(
    "model, name",
    [
        *(("exact", name) for name in ("pendulum", "door", "two_beams", "blade", "bend_45_continuum")),
        *(("linear", name) for name in ("pendulum", "door", "two_beams", "blade", "bend_45_continuum")),
        *(("lowOrder", name) for name in ("door", "two_beams", "blade")),
    ],
)
def test_recorded_steps_ask_nothing_of_python(model, name):
    """What is not written down as operations takes longer than all else of a step."""
    for method in ("auto", "gear"):
        scene = scene_of(name, f"solve.model={model}", f"solve.method={method}", "solve.max_steps=6")
        run_integration(scene, scene.deck.solve)
        kept = [one for recorded in scene.recordings.values() for one in recorded.values()]
        kept = [getattr(one, "recorded", one) for one in kept if not isinstance(one, tuple)]
        assert kept and not any(isinstance(one, Exception) or getattr(one, "refused", None) for one in kept)
        assert not any(one.calls if hasattr(one, "calls") else one._program.calls for one in kept)


DAMPED = """
hfsim: 1
gravity: [%s]
materials: {m: {density: 1200.0, youngs_modulus: 1.0e6, bending_damping: 0.02, axial_damping: 0.001}}
sections: {bar: {shape: rectangle, width: 0.03, height: 0.03}}
bodies: {arm: {type: beam, material: m, section: bar, length: 1.0, %s}}
joints: {axle: {type: %s, between: [ground, arm.root]}}
solve: {duration: 0.5}
"""


AT_POINTS = "element: cable, strain: engineering, curvature: exact, quadrature: {axial: 5, bending: 3}"
EACH_DAMPED = pytest.mark.parametrize(
    "where",
    [
        ("0.0, 0.0, -9.81", "elements: 3, element: continuum, section_degree: 2", "spherical"),
        ("0.0, -9.81", "elements: 3, degree: 5", "revolute"),
        ("0.0, -9.81", f"elements: 3, {AT_POINTS}", "revolute"),
        ("0.0, 0.0, -9.81", f"elements: 2, {AT_POINTS}", "spherical"),
    ],
)


@EACH_DAMPED
def test_damping_is_that_of_numpy(where):
    evaluates_alike(build(parse_deck(DAMPED % where)))


@EACH_DAMPED
def test_damped_runs_take_the_iterations_of_numpy(where, monkeypatch):
    """So the derivative follows the state: maps of the identity are no constants of a recording."""
    at_once(monkeypatch)
    found = []
    for way in ("native", "numpy"):
        monkeypatch.setattr(kernel, "KERNEL", way)
        scene = build(parse_deck(DAMPED % where))
        counts = run_integration(scene, scene.deck.solve).problem.counts
        assert bool(counts.native) == (way == "native")
        found.append((counts.steps, counts.rejected, counts.iterations))
    assert found[0] == pytest.approx(found[1], rel=0.03)


WINDING = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {soft: {density: 1000.0, youngs_modulus: 5.0e7}}
sections: {bar: {shape: rectangle, width: 2.0e-2, height: 2.0e-2}}
bodies:
  arm: {type: beam, material: soft, section: bar, length: 0.4, elements: 1}
  flap: {type: rigid, mass: 0.02, inertia: 1.0e-4, points: {root: [-0.1, 0.0]}}
joints:
  axle: {type: revolute, between: [ground, arm.root]}
  hinge: {type: revolute, between: [arm.tip, flap.root], friction: {torque: 0.02, velocity: 5.0}}
springs:
  coil: {type: rotational, between: [ground, arm.root], stiffness: 0.05, damping: 0.05}
loads:
  twist: {type: moment, at: arm.tip, moment: 1.0,
          law: {type: table, times: [0.0, 0.1, 0.2, 2.0], values: [1.5, 1.5, -0.5, 0.2]}}
initial: {arm: {angular_velocity: 60.0}, flap: {angular_velocity: 60.0}}
solve: {duration: 0.23, tolerance: 1.0e-6}
"""


def test_turns_are_no_constant_of_a_recording():
    """They are counted outside of it: a spring pulls by all of them, and a law and friction go on as well."""
    scene = build(parse_deck(WINDING))
    system, rng = scene.system, np.random.default_rng(3)
    turns, replayed = Turns(system), Replayed(system.acceleration)
    turns.start(0.0, scene.q, scene.v)
    t, q, v = (one[:1] for one in states(scene, rng))
    first = replayed(t, q, v)
    assert replayed.refused is None
    with turns.supposed(0.0, turns.angles(0.0, scene.q) + 4.0 * np.pi):
        found, own = replayed(t, q, v), system.acceleration(t, q, v)
    assert np.abs(found - first).max() > 1e-3 * np.abs(first).max()
    assert found == pytest.approx(own, rel=1e-12, abs=1e-12 * np.abs(own).max())
    assert replayed(t, q, v) == pytest.approx(first, rel=1e-13)
    later = t + 0.35
    assert replayed(later, q, 2.0 * v) == pytest.approx(system.acceleration(later, q, 2.0 * v), rel=1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_iterations_end_as_in_numpy(seed):
    """Consequences and sizes of all kinds: shrinking, stagnating, growing, lost, within rounding."""
    rng = np.random.default_rng(seed)
    shrink, noise = rng.choice([0.02, 0.5, 0.95, 1.3, 30.0]), rng.choice([0.0, 0.5])
    changes = 10.0 ** rng.uniform(-9.0, 1.0) * np.cumprod(shrink * np.exp(noise * rng.standard_normal(20)))
    changes = np.where(rng.random(20) < 0.03, np.nan, changes)
    given = np.stack([changes, changes * 10.0 ** rng.choice([rng.uniform(-6.0, 1.0), -9.0])], axis=1)
    tolerance = 10.0 ** rng.uniform(-12.0, -3.0)
    ending = Ending(np.ones(3), tolerance)
    outcomes = (ending.after(k, change, size) for k, (change, size) in enumerate(given))
    expected = next(((found, k + 1) for k, found in enumerate(outcomes) if found is not None), (False, 20))
    again, tape, sizes = iter(given), Recorder(), (np.zeros(()), np.zeros(()), np.full((), 2.0))

    def correct():
        sizes[0][...], sizes[1][...] = next(again)

    tape.call(correct)
    tape.cut()
    (first,) = tape.programs()
    assert iterated(first, sizes, (*limits(tolerance), 1e-3), 20) == expected


@pytest.mark.parametrize("name", ["hub_beams", "hub_beams_soft"])
def test_ends_of_native_steps_lie_on_the_joints(name, monkeypatch):
    """Moved there in the recording of the steps, or after them where that cannot be recorded."""
    at_once(monkeypatch)
    runs = []
    for recorded in (True, False):
        if not recorded:
            monkeypatch.setattr(Closing, "of", lambda *given: None)
        scene = scene_of(name, "solve.duration=0.1")
        done = run_integration(scene, scene.deck.solve)
        called = done.problem.often.memory()
        assert done.problem.counts.native > 1
        assert recorded == ("constraints" not in (*called["names"], *called["chosen"]))
        for step in done.trajectory.segments[1:]:
            seen = Projection(scene.system).seen(np.array([step.t]), step.q[None], step.v[None])
            assert max(seen[3], seen[5]) < 2.0 * ROUNDING
        runs.append(done.trajectory)
    assert np.abs(runs[0].q - runs[1].q).max() < 1e-9


@pytest.mark.parametrize("method", ["auto", "gear"])
@pytest.mark.parametrize("way", ["native", "numpy"])
def test_runs_tell_whether_the_kernel_was_used(method, way, monkeypatch):
    at_once(monkeypatch)
    monkeypatch.setattr(kernel, "KERNEL", way)
    loaded = load_deck(CASES / "pendulum.yaml", ["solve.duration=0.1", f"solve.method={method}"])
    summary = summary_of(simulate(loaded), Provenance("pendulum.yaml", "0" * 64, (), {}), [])
    assert summary["kernel"] == way
    assert (summary["native_steps"] > 0) == ((method, way) == ("auto", "native"))


@pytest.mark.parametrize("duration, replayed", [(0.02, False), (5.0, True)])
def test_recordings_of_large_matrices_wait_for_many_steps(duration, replayed):
    settings = ("bodies.b1.elements=40", "solve.max_steps=2", f"solve.duration={duration}")
    scene = scene_of("pendulum", *settings)
    done = run_integration(scene, scene.deck.solve)
    assert (done.problem.counts.native > 0) == replayed
