"""What `auto` chooses: explicit steps where few make a run, and when it goes over to collocation."""

from pathlib import Path

import numpy as np
import pytest
from integrators.test_stepping import read, same, written

import hfsim
from hfsim.errors import HfsimError
from hfsim.integrators import Limits, Stepping, _automatic, _loop, choose
from hfsim.integrators._automatic import followed
from hfsim.integrators.explicit import ExplicitStepper
from hfsim.marching.integration import problem_of, run_integration
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

CASES = Path(__file__).parents[2] / "cases"
DISC = """
hfsim: 1
bodies: {disc: {type: rigid, mass: 2.0, inertia: 0.5}}
joints: {axle: {type: revolute, between: [ground, disc]}}
springs: {coil: {type: rotational, between: [ground, disc], stiffness: 8.0, damping: %r}}
initial: {disc: {angle: 0.5}}
solve: {duration: 5.0, tolerance: 1.0e-4}
"""
TWO = """
hfsim: 1
bodies: {slow: {type: rigid, mass: 2.0, inertia: 0.5}, fast: {type: rigid, mass: 2.0, inertia: 0.5}}
joints: {one: {type: revolute, between: [ground, slow]}, other: {type: revolute, between: [ground, fast]}}
springs:
  soft: {type: rotational, between: [ground, slow], stiffness: 8.0}
  hard: {type: rotational, between: [ground, fast], stiffness: 800.0}
solve: {duration: 1.0}
"""
SPUN = """
hfsim: 1
bodies: {plate: {type: rigid, mass: 1.0, inertia: [1.0, 1.2, 1.8]}}
initial: {plate: {angular_velocity: [0.1, 0.0, 0.5]}}
loads: {twist: {type: moment, at: plate, moment: [0.0, 3.0, 20.0]}}
solve: {duration: 8.0, tolerance: 1.0e-4}
"""
TOP = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies: {top: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.005], points: {foot: [0.0, 0.0, -0.2]}}}
joints: {tip: {type: spherical, between: [ground, top.foot]}}
initial: {top: {orientation: {axis: [0, 1, 0], angle: 0.4}, angular_velocity: [0.0, 0.0, 400.0]}}
solve: {duration: 0.4}
"""
WHEEL = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies:
  frame: {type: rigid, mass: 3.0, inertia: [0.1, 0.1, 0.15], points: {p: [0.3, 0, 0], q: [-0.2, 0.3, 0]}}
  wheel: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.02]}
joints: {axle: {type: revolute, between: [frame, wheel], axis: [0.1, 0.0, 1.0]}}
ground: {points: {p: [0.5, 0.0, 0.3], q: [-0.3, 0.4, 0.3]}}
springs:
  s: {type: two_point, between: [ground.p, frame.p], stiffness: 2.0e3, rest_length: 0.36}
  t: {type: two_point, between: [ground.q, frame.q], stiffness: 2.0e3, rest_length: 0.36}
initial: {frame: {position: [0, 0, 0]}, axle: {angular_velocity: 60.0}}
solve: {duration: 1.0}
"""
GIMBALS = """
hfsim: 1
bodies:
  outer: {type: rigid, mass: 0.5, inertia: [0.01, 0.012, 0.01]}
  inner: {type: rigid, mass: 0.3, inertia: [0.005, 0.004, 0.005]}
  wheel: {type: rigid, mass: 1.0, inertia: [0.002, 0.002, 0.004]}
joints:
  a: {type: revolute, between: [ground, outer], damping: 0.01}
  b: {type: revolute, between: [outer, inner], axis: [1, 0, 0]}
  c: {type: revolute, between: [inner, wheel]}
loads: {push: {type: moment, at: outer, moment: [0.02, 0.1, 0.0]}}
initial: {b: {angle: 0.4}, c: {angular_velocity: 300.0}}
solve: {duration: 0.5}
"""
BEAM = """
hfsim: 1
materials: {rubber: {density: 1000.0, youngs_modulus: 1.0e4}}
sections: {bar: {shape: rectangle, width: 0.1, height: 0.1}}
bodies: {b: {type: beam, material: rubber, section: bar, length: 1.0, elements: 1}}
joints: {pin: {type: revolute, between: [ground, b.root]}}
solve: {duration: 0.1}
"""
FOUR_BARS = (CASES / "verify" / "four_bars.yaml").read_text()


def methods(text, *settings):
    scene = build(parse_deck(text, "scene.yaml", settings))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    return done.trajectory.methods


@pytest.mark.parametrize(
    "case", ["tumbling", "heavy_top", "joints", "extreme/mass_ratio", "bricard", "verify/andrews"]
)
def test_mechanisms_of_few_turns_are_made_explicitly_and_keep_the_tolerance(case):
    def ends(*settings):
        scene = build(load_deck(CASES / f"{case}.yaml", ["solve.tolerance=1e-5", *settings]))
        done = run_integration(scene, scene.deck.solve)
        return done.trajectory.methods, done.trajectory.q

    made_by, q = ends("solve.method=auto")
    _, true = ends("solve.method=gauss", "solve.tolerance=1e-11")
    assert made_by == ["explicit"]
    assert np.abs(q - true).max() < 1e-5


@pytest.mark.parametrize("case", ["pendulum", "pendulum_3d", "extreme/modulus_low"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_so_are_rough_motions_of_soft_bodies(case, tolerance):
    def ends(*settings):
        scene = build(load_deck(CASES / f"{case}.yaml", settings))
        done = run_integration(scene, scene.deck.solve)
        return done.trajectory.methods, done.trajectory.q

    made_by, q = ends(f"solve.tolerance={tolerance}")
    _, true = ends("solve.tolerance=1e-9")
    assert made_by == ["explicit"]
    assert np.abs(q - true).max() < tolerance


@pytest.mark.parametrize("model", ["exact", "lowOrder"])
@pytest.mark.parametrize("case", sorted(CASES.rglob("*.yaml")), ids=lambda case: case.stem)
def test_accelerations_that_are_said_to_depend_on_positions_alone_do(case, model):
    try:
        scene = build(load_deck(case), model)
    except HfsimError:
        return  # not a scene by itself, or not one for this model
    problem, t = problem_of(scene), np.zeros(1)
    rng = np.random.default_rng(1)
    q, v = scene.q[None], scene.v[None]
    if problem.positional and len(scene.q) < 200:
        a = problem.acceleration(t, q, v)
        moving = problem.acceleration(t, q, v + rng.normal(size=v.shape))
        assert np.abs(moving - a).max() <= 1e-12 * np.abs(a).max()


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("text", [TOP, WHEEL, GIMBALS], ids=["top", "wheel on springs", "gimbals"])
def test_so_are_spinning_bodies_and_they_keep_the_tolerance(text, tolerance):
    """By steps of collocation, which resolve the spin too, they took three to five times as long."""

    def ends(tolerance, *settings):
        scene = build(parse_deck(text, "scene.yaml", [f"solve.tolerance={tolerance}", *settings]))
        done = run_integration(scene, scene.deck.solve)
        return done.trajectory.methods, done.trajectory.q

    made_by, q = ends(tolerance)
    _, true = ends(1e-10, "solve.method=gauss")
    assert made_by == ["explicit"]
    assert np.abs(q - true).max() < tolerance


@pytest.mark.parametrize("stiffness", [2e4, 1e5, 2e6])
def test_stiff_springs_beside_a_spin_are_for_collocation(stiffness):
    springs = [f"springs.{name}.stiffness={stiffness}" for name in ("s", "t")]
    assert methods(WHEEL) == ["explicit"]
    assert "explicit" not in methods(WHEEL, *springs, "solve.duration=2.0")


@pytest.mark.parametrize("inertia", [[1.0, 1.0, 1.9], [1.0, 1.0, 0.1], [1.0, 1.2, 1.8]])
@pytest.mark.parametrize("spin", [[0.0, 0.0, 30.0], [10.0, 0.0, 30.0], [1.0, 30.0, 0.0]])
def test_a_spin_is_told_by_what_velocities_do(inertia, spin):
    rates = [f"initial.plate.angular_velocity={spin}", f"bodies.plate.inertia={inertia}"]
    scene = build(parse_deck(SPUN, overrides=rates))
    found = followed(problem_of(scene), 0.0, scene.q, scene.v, 1e3)
    assert found.spins and 0.8 < found.by_position / np.linalg.norm(spin) < 1.5


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        (BEAM, ()),
        (BEAM, ("solve.tolerance=1e-3", "materials.rubber.youngs_modulus=1e11")),
        (FOUR_BARS, ("solve.duration=0.1", "solve.tolerance=1e-7")),
        (FOUR_BARS, ("solve.duration=0.1", *(f"initial.a{k}.angle=1e-3" for k in range(3)))),
        (DISC % 0.0, ("solve.step=0.1",)),
        (DISC % 0.0, ("solve.stages=6",)),
        (DISC % 0.0, ("solve.tolerance=1e-9",)),
        (DISC % 0.0, ("solve.duration=50",)),
        (DISC % 50.0, ()),
    ],
    ids=["bends", "stiff", "tight loop", "singular", "step", "stages", "tight", "long", "stiff damper"],
)
def test_other_scenes_are_for_collocation(text, settings):
    assert methods(DISC % 0.0) == ["explicit"]
    assert "explicit" not in methods(text, *settings)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("rate", [0.83, 0.97, 1.02, 1.14, 1.29])
def test_loops_go_on_as_they_were_through_positions_where_they_lose_their_rank(rate, tolerance):
    """There all bars line up, and could go on crossed: those that stand would no longer be parallel."""
    rates = [f"initial.a{k}.angular_velocity={-rate}" for k in range(3)]
    scene = build(parse_deck(FOUR_BARS, "scene.yaml", [*rates, f"solve.tolerance={tolerance}"]))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None and done.trajectory.methods[0] == "explicit"
    q = done.trajectory.at(np.linspace(0.0, 10.0, 201))[0]
    x = scene.system.absolute(q)
    upright = [scene.bodies[name].marker((0.0, 0.0)).frame(x)[..., 0] for name in ("a0", "a1", "a2")]
    assert np.ptp(upright, axis=0).max() < 10.0 * tolerance


def test_failures_in_a_row_count_however_they_are_made():
    """The rate of a root is infinite at the start: steps there fail until they are next to nothing."""
    text = (DISC % 0.0).replace("duration: 5.0, tolerance: 1.0e-4", "duration: 2.0")
    load = "loads: {push: {type: moment, at: disc, moment: 1.0, law: {expression: 't**0.5'}}}"
    assert methods(f"{text}\n{load}\n")[-1] == "gauss:16"


def windows(count):
    """Return a deck of so many in a row, of bars of 1 m."""
    bar = {"type": "rigid", "mass": 1.0, "inertia": 1 / 12, "points": {"low": [-0.5, 0.0], "top": [0.5, 0.0]}}
    uprights, sills = [f"a{k}" for k in range(count + 1)], [f"b{k}" for k in range(count)]
    joints = {f"foot{k}": [f"ground.g{k}", f"a{k}.low"] for k in range(count + 1)}
    joints |= {f"left{k}": [f"a{k}.top", f"b{k}.low"] for k in range(count)}
    joints |= {f"right{k}": [f"b{k}.top", f"a{k + 1}.top"] for k in range(count)}
    return {
        "hfsim": 1,
        "gravity": [0.0, -9.81],
        "ground": {"points": {f"g{k}": [float(k), 0.0] for k in range(count + 1)}},
        "bodies": dict.fromkeys([*uprights, *sills], bar),
        "joints": {name: {"type": "revolute", "between": ends} for name, ends in joints.items()},
        "initial": {name: {"angle": 0.5 * np.pi, "angular_velocity": -1.0} for name in uprights}
        | {name: {"angle": 0.0, "angular_velocity": 0.0} for name in sills},
        "solve": {"duration": 2.0},
    }


def test_where_explicit_steps_get_ever_shorter_collocation_gets_across():
    """The more loops lose their rank at once, the less is left to explicit steps."""
    scene = build(hfsim.load(windows(10)))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None and done.trajectory.methods == ["explicit", "gauss:16"]
    x = scene.system.absolute(done.trajectory.q[None])
    upright = [scene.bodies[f"a{k}"].marker((0.0, 0.0)).frame(x)[..., 0] for k in range(11)]
    assert np.ptp(upright, axis=0).max() < 1e-9


@pytest.mark.parametrize(("damping", "rate"), [(0.0, 4.0), (4.0, 8.0), (50.0, 100.0)])
def test_rates_are_those_of_springs_and_dampers(damping, rate):
    """By position sqrt(stiffness / inertia), by velocity damping / inertia."""
    scene = build(parse_deck(DISC % damping))
    problem, start = problem_of(scene), (0.0, scene.q, scene.v)
    a, *_ = followed(problem, *start, 1.01 * rate)
    assert a == pytest.approx(problem.at(*start), rel=1e-14)
    assert followed(problem, *start, 0.99 * rate) is None


def test_a_fast_mode_is_found_though_another_moves_farther():
    """Of what any disturbance does first, the slow one is the larger part."""
    scene = build(parse_deck(TWO))
    problem, start = problem_of(scene), (0.0, scene.q, scene.v)
    assert followed(problem, *start, 1.01 * 40.0) is not None
    assert followed(problem, *start, 0.9 * 40.0) is None


def test_a_run_that_would_take_many_steps_goes_over():
    """A plate at rest is spun up: what it turns in all is not known at the start."""
    made_by = methods(SPUN)
    assert made_by[0] == "explicit" and len(made_by) == 2


def test_a_run_goes_over_where_explicit_steps_fail(monkeypatch):
    def rejected(self, *place):
        return attempt(self, *place)._replace(error=2.0)

    attempt = ExplicitStepper.attempt
    monkeypatch.setattr(ExplicitStepper, "ahead", lambda *_: None)
    monkeypatch.setattr(ExplicitStepper, "attempt", rejected)
    scene = build(parse_deck(DISC % 0.0))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None and done.problem.counts.rejected == _automatic.IN_A_ROW[False] - 1
    assert done.trajectory.methods[-1] != "explicit"


def spun(text):
    scene = build(parse_deck(text))
    problem, solve = problem_of(scene), scene.deck.solve
    begun = 0.0, scene.q, scene.v
    limits = Limits(None, max_steps=24)
    return Stepping(problem, choose(solve, False), begun, solve.duration, limits, lambda *_: None), problem


@pytest.mark.parametrize("text", [SPUN, TOP])
def test_a_run_that_goes_over_goes_on_to_the_last_bit_wherever_it_was_put_down(text, monkeypatch):
    monkeypatch.setattr(_automatic, "LOOK", 8)
    monkeypatch.setattr(_automatic, "FEW", dict.fromkeys((False, True), (60.0, 100)))
    monkeypatch.setattr(_automatic, "SPINNING", dict.fromkeys((False, True), (600.0, 100)))
    whole, problem = spun(text)
    memories = {}
    with monkeypatch.context() as one_by_one:
        one_by_one.setattr(_loop, "AT_ONCE", 0)
        for _ in whole:
            memories[len(whole.path.segments)] = written(whole.memory())
    assert len(whole.path.methods) == 2
    for k, memory in memories.items():
        again, again_problem = spun(text)
        again.recall(read(memory))
        list(again)
        assert all(same(*pair) for pair in zip(again.path.segments, whole.path.segments[k:], strict=True)), k
        assert again.path.methods == whole.path.methods
        assert vars(again_problem.counts) == vars(problem.counts), k
