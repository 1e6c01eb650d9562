# ruff: noqa: E501
"""Failures and doubts are classed by evidence: deck, numerical, model, physical; one real scene for each."""

import json
import shlex
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from integrated import integrate
from mechanisms import bricard
from scipy.integrate import quad
from scipy.optimize import brentq
from zoo import DEAD_CENTRE

from hfsim.cli import app
from hfsim.deck import units
from hfsim.errors import DeckError, SolverFailure
from hfsim.integrators import Limits, Problem, _pace
from hfsim.integrators.collocation import CollocationStepper
from hfsim.integrators.explicit import Explicit
from hfsim.marching.culprit import non_finite
from hfsim.marching.integration import run_integration
from hfsim.maths.rank import Dependence
from hfsim.maths.rotations import rotation
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate
from hfsim.trust import diagnosis, suspicion
from hfsim.trust.experiments import joint_dependence
from hfsim.trust.growth import amplitude_of, loaded_items
from hfsim.trust.suspicion import singular_position

CASES = Path(__file__).parents[2] / "cases"

BOB = """hfsim: 1
bodies:
  bob: {type: rigid, mass: 1.0, inertia: 0.25, points: {pivot: [-0.5, 0.0], end: [0.5, 0.0]}}
joints:
  pin: {type: revolute, between: [ground, bob.pivot]}
solve: {duration: 1.0}
"""
OVERFLOW = f"""{BOB}
springs:
  coil: {{type: rotational, between: [ground, bob], stiffness: 1.0e308, rest_angle: 12.0}}
"""
LATE = f"""{BOB}
loads:
  twist: {{type: moment, at: bob, moment: 1.0e300, law: {{type: smooth_step, from: 0, to: 1.0e10, start: 0.5, end: 0.6}}}}
"""
LINK = """hfsim: 1
gravity: [0.0, -9.81]
bodies:
  bob: {type: rigid, mass: 1.0, inertia: 0.25, points: {pivot: [-0.5, 0.0], end: [0.5, 0.0]}}
  link: {type: rigid, mass: 1.0e-20, inertia: 1.0e-22, points: {start: [-0.1, 0.0], end: [0.1, 0.0]}}
joints:
  pin: {type: revolute, between: [ground, bob.pivot]}
  hook: {type: revolute, between: [bob.end, link.start]}
springs:
  rubber: {type: two_point, between: [ground, link.end], stiffness: 1.0e5, damping: 0.0}
solve: {duration: 10.0}
"""
COLUMN = """hfsim: 1
materials: {rubber: {density: 1100.0, youngs_modulus: 1.0e7}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
bodies:
  b1: {type: beam, material: rubber, section: bar, length: 1.0, elements: 2}
joints: {clamp: {type: fixed, between: [ground, b1.root]}}
loads:
  press: {type: force, at: b1.tip, force: [-2.0, 0.0]}
solve: {duration: 3.0, tolerance: 1.0e-6}
"""
UPRIGHT = """hfsim: 1
gravity: [0.0, -9.81]
bodies: {bob: {type: rigid, mass: 1.0, inertia: 0.1, points: {end: [-0.5, 0.0]}}}
joints: {hinge: {type: revolute, between: [ground, bob.end]}}
initial: {bob: {angle: 90 deg}}
solve: {duration: 5.0}
"""
MAST = """hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 1 MPa}}
sections: {rod: {shape: circle, radius: 5 mm}}
bodies: {mast: {type: beam, material: rubber, section: rod, length: 0.18, elements: 4}}
joints: {foot: {type: fixed, between: [ground, mast.root], angle: 90 deg}}
initial: {mast: {angle: 90 deg}}
solve: {duration: 5.0}
"""
"""Greenhill: it bears its weight up to (7.837 E I / (rho A g))^(1/3) = 0.166 m."""
DRAGGED = """hfsim: 1
gravity: [0.0, 0.0]
bodies:
  belt: {type: rigid, mass: 5.0, inertia: 0.02, points: {hook: [0.5, 0.0]}}
  block: {type: rigid, mass: 1.0, inertia: 0.02}
joints:
  guide: {type: prismatic, between: [ground, belt]}
  lead: {type: driver, between: [ground, belt], position: {type: constant_rate, rate: 0.1}}
  rail: {type: prismatic, between: [ground, block], friction: {force: 5.0, velocity: 0.001}}
springs: {pull: {type: two_point, between: [block, belt.hook], stiffness: 200.0, rest_length: 0.5}}
solve: {duration: 2.0}
"""
SHAKEN = """hfsim: 1
gravity: [0.0, -9.81]
bodies:
  pivot: {type: rigid, mass: 1.0, inertia: 1.0}
  bob: {type: rigid, mass: 1.0, inertia: 0.01, points: {top: [0.0, 1.0]}}
joints:
  guide: {type: prismatic, between: [ground, pivot], axis: [0.0, 1.0]}
  shaker: {type: driver, between: [ground, pivot], axis: [0.0, 1.0], position: {type: sine, amplitude: 0.1, frequency: 0.992}}
  hinge: {type: revolute, between: [pivot, bob.top]}
initial: {bob: {angle: 1.0e-4}}
solve: {duration: 30.0}
"""
"""Pivot shaken at twice the bob's own frequency: the Mathieu equation in its first unstable tongue."""


def diagnosed(text, *overrides, model=None):
    loaded = parse_deck(text, "scene.yaml", overrides) if "\n" in text else load_deck(CASES / text, overrides)
    return simulate(loaded, model, error_estimate=False, diagnosis=True)


def line_of(text, word):
    return next(n for n, line in enumerate(text.splitlines(), start=1) if line.strip().startswith(word))


FALLING_ROD = """hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 1000.0, youngs_modulus: 5 MPa, bending_damping: 0.01}}
sections: {rod: {shape: circle, diameter: 2 cm}}
bodies: {a: {type: beam, material: rubber, section: rod, length: 1.0, elements: 4, element: cosserat}}
joints: {pin: {type: revolute, between: [ground, a.root]}}
initial: {a: {angle: -0.3}}
solve: {duration: 0.5, model: linear}
"""
BLADE = """hfsim: 1
materials: {alu: {density: 1200, youngs_modulus: 2.8e9}}
sections: {s: {shape: rectangle, width: 0.05, height: 0.02}}
bodies: {blade: {type: beam, material: alu, section: s, length: 2.0, elements: 2}}
joints:
  mount: {type: revolute, between: [ground, blade.root]}
  motor: {type: driver, between: [ground, blade.root], angle: {type: spin_up, rate: "120 rpm", time: 1}}
solve: {duration: 4, tolerance: 1e-4}
"""


# deck ------------------------------------------------------------------------------------------------


@pytest.fixture
def unbounded(monkeypatch):
    """Let decks have numbers that overflow, as formulas in the run may make them."""
    for dimension in units.RANGES:
        monkeypatch.setitem(units.RANGES, dimension, (0.0, 1e308))


def test_a_number_out_of_range_is_named_at_the_start(unbounded):
    run = diagnosed(OVERFLOW)
    assert (run.status, run.exit_code) == ("failed", 3)
    assert (run.failure["class"], run.failure["item"]) == ("deck", "springs.coil")
    assert run.failure["line"] == line_of(OVERFLOW, "coil")
    assert "springs.coil" in run.reason and run.failure["time"] == 0.0


@pytest.mark.parametrize("settings", [(), ("solve.method=gear",), ("solve.step=0.01",)])
def test_a_law_that_grows_out_of_range_is_named_where_it_does(unbounded, settings):
    run = diagnosed(LATE, *settings)
    assert (run.failure["class"], run.failure["item"]) == ("deck", "loads.twist")
    assert run.stop_time == pytest.approx(0.5, abs=0.011)
    assert run.end_time == pytest.approx(0.5, abs=0.011), "what came before is kept"
    assert all(np.isfinite(channel.values).all() for channel in run.channels)


def test_a_body_without_mass_ends_the_crawl_and_is_named(monkeypatch):
    monkeypatch.setattr(_pace, "WINDOWS", ((100, 1e6),))
    run = diagnosed(LINK)
    assert (run.failure["class"], run.failure["item"]) == ("deck", "bodies.link")
    assert run.failure["line"] == line_of(LINK, "link")
    assert run.statistics["steps"] + run.statistics["rejected"] <= 2000


def test_redundant_joints_are_named_with_their_lines():
    text = BOB.replace("joints:", "joints:\n  nail: {type: fixed, between: [ground, bob.pivot]}")
    with pytest.raises(DeckError) as refusal:
        build(parse_deck(text, "scene.yaml"))
    (problem,) = refusal.value.problems
    assert problem.path == "joints.pin" and problem.line == line_of(text, "pin")
    assert f"'nail' (line {line_of(text, 'nail')})" in problem.message


PARALLELOGRAM = """hfsim: 1
ground: {points: {there: [1.0, 0.0]}}
bodies:
  left: &bar {type: rigid, mass: 1.0, inertia: 0.1, points: {low: [-0.5, 0.0], top: [0.5, 0.0]}}
  right: *bar
  across: *bar
joints:
  foot: {type: revolute, between: [ground, left.low]}
  other: {type: revolute, between: [ground.there, right.low]}
  near: {type: revolute, between: [left.top, across.low]}
  far: {type: revolute, between: [across.top, right.top]}
initial:
  left: &up {angle: 90 deg, angular_velocity: -2.0}
  right: *up
  across: {angle: 0.0, angular_velocity: 0.0}
solve: {duration: 1.0, tolerance: 1.0e-5}
output: {channels: [left.angle]}
"""


ON_A_CAR = """hfsim: 1
bodies:
  car: {{type: rigid, mass: 100.0, inertia: 50.0}}
  crank: &bar {{type: rigid, mass: 1.0, inertia: 0.1, points: {{a: [-0.5, 0], b: [0.5, 0]}}}}
  rod: *bar
  block: {{type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  rail: {{type: prismatic, between: [{ends}], axis: [1, 0]}}
  axle: {{type: revolute, between: [car, crank.a]}}
  pin: {{type: revolute, between: [crank.b, rod.a]}}
  wrist: {{type: revolute, between: [rod.b, block]}}
  way: {{type: prismatic, between: [block, car], axis: [1, 0]}}
  push: {{type: driver, between: [car, block], position: {reach!r}}}
initial:
  car: {{position: [{far}, 0.0]}}
  crank: {{angle: {angle}}}
  rod: {{angle: -{angle}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("angle", [0.5, 1e-5])
def test_how_near_a_dead_centre_is_does_not_depend_on_how_far_all_has_slid(angle):
    def measured(ends, far):
        text = ON_A_CAR.format(ends=ends, far=far, angle=angle, reach=2.0 * float(np.cos(angle)))
        scene = build(parse_deck(text))
        return joint_dependence(scene, scene.q)

    near = measured("ground, car", 0.0)
    assert (near.size < 1e-5) is (angle < 1e-3)
    for ends in ("ground, car", "car, ground"):
        far = measured(ends, 2500.0)
        assert far.size == pytest.approx(near.size, rel=1e-3)
        assert angle > 1e-3 or "rail" not in far.joints == near.joints


def test_a_loop_that_lines_up_on_the_way_passed_a_singular_position():
    loaded = parse_deck(PARALLELOGRAM)
    scene = build(loaded)
    t, found = singular_position(scene, run_integration(scene, scene.deck.solve).trajectory)
    assert t == pytest.approx(0.25 * np.pi, abs=1e-3)
    assert set(found.joints) <= {"foot", "other", "near", "far"} and found.size < 1e-3
    short = build(loaded.changed(["solve.duration=0.7"]))
    assert singular_position(short, run_integration(short, short.deck.solve).trajectory) is None


def test_nearly_redundant_joints_are_suspicious():
    text = BOB.replace("end: [0.5, 0.0]", "near: [-0.5, 1.0e-7]").replace(
        "solve:",
        "  again: {type: revolute, between: [ground.near, bob.near]}\nground: {points: {near: [0.0, 1.0e-7]}}\nsolve:",
    )
    text = text.replace(
        "type: revolute, between: [ground.near",
        "type: driver, position: 0.0, axis: [1.0, 0.0], between: [ground.near",
    )
    run = diagnosed(text)
    assert run.status == "done"
    assert (run.statistics["suspicion"]["class"], run.statistics["suspicion"]["line"]) == (
        "deck",
        line_of(text, "again"),
    )


# numerical -------------------------------------------------------------------------------------------


def test_a_step_too_long_goes_away_with_a_shorter_one():
    run = diagnosed("hub_beams.yaml", "solve.step=0.15", "solve.duration=0.6")
    assert (run.status, run.failure["class"], run.failure["item"]) == ("failed", "numerical", "solve.step")
    assert run.failure["evidence"]["half the step"].startswith("fails")
    again = shlex.split(run.failure["try"])
    assert again[:2] == ["hfsim", "run"] and again[-2:] == ["--set", "solve.step=0.01875"]
    sets = [word for word in again if "=" in word]
    assert simulate(load_deck(CASES / "hub_beams.yaml", sets), error_estimate=False).status == "done"


@pytest.mark.parametrize(
    ("case", "settings"),
    [
        ("two_beams", ("solve.step=0.007", "solve.method=explicit", "solve.duration=0.05")),
        ("door", ("solve.step=0.007", "solve.method=explicit", "solve.duration=0.05")),
    ],
)
def test_a_deck_is_not_blamed_for_a_state_that_steps_have_blown_up(case, settings):
    """Forces of 1e100 follow from displacements of 1e40, whatever the numbers of the deck are."""
    run = diagnosed(f"{case}.yaml", *settings, model="exact")
    assert (run.failure["class"], run.failure["item"]) == ("numerical", "solve.step")
    assert run.failure["evidence"]["steps by tolerance"].startswith("passes")


@pytest.mark.parametrize("size", [1e40, np.inf])
def test_a_law_is_blamed_however_far_the_steps_have_gone(unbounded, size):
    scene = build(parse_deck(LATE))
    huge = np.full_like(scene.v, size)
    assert non_finite(scene, 0.4, scene.q, huge) is None
    assert non_finite(scene, 0.7, scene.q, huge).item == "loads.twist"


def test_energy_lost_by_the_method_is_a_numerical_suspicion():
    run = diagnosed(
        "pendulum.yaml",
        "solve.method=generalized_alpha",
        "solve.step=0.004",
        "solve.rho_inf=0.0",
        "solve.duration=0.3",
    )
    assert run.status == "done"
    assert run.statistics["suspicion"]["class"] == "numerical"
    assert run.statistics["suspicion"]["item"] == "solve.step"
    assert run.statistics["suspicion"]["try"].endswith("--force")


CANTILEVER = """hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}}
joints: {clamp: {type: fixed, between: [ground, b1.root]}}
loads: {push: {type: force, at: b1.tip, force: [0.0, 0.1]}}
solve: {duration: 0.5, method: explicit, step: 1.0e-4, tolerance: 1.0e-6}
"""


@pytest.mark.parametrize(("model", "step"), [("linear", 6e-3), ("lowOrder", 1e-4)])
def test_a_truncated_model_is_not_blamed_for_what_a_long_step_does(model, step):
    """The explicit method stands 0.06 ms here; the watch for what the model leaves out sees the blow-up first."""
    run = diagnosed(CANTILEVER, f"solve.step={step}", model=model)
    assert (run.failure["class"], run.failure["item"]) == ("numerical", "solve.step")
    assert "leaves out" not in run.reason and "it goes away with" in run.reason
    watched = simulate(parse_deck(CANTILEVER, "s.yaml", [f"solve.step={step}"]), model, error_estimate=False)
    assert watched.failure["class"] == "model" and "leaves out" in watched.reason, "without experiments"


# model -----------------------------------------------------------------------------------------------


def test_an_indefinite_mass_matrix_goes_away_with_exact():
    run = diagnosed("pendulum.yaml", model="lowOrder")
    assert (run.failure["class"], run.failure["item"]) == ("model", "bodies.b1")
    assert run.failure["evidence"]["model exact"].startswith("passes")
    assert "mass matrix" in run.failure["evidence"]["term"]
    assert run.failure["evidence"]["left_range_at"] < run.failure["time"]
    assert "solve.model=exact" in run.failure["try"]


def test_a_linear_blade_that_bends_outwards_misses_its_stiffening():
    run = diagnosed(BLADE, model="linear")
    assert (run.failure["class"], run.failure["item"]) == ("model", "bodies.blade")
    assert run.failure["evidence"]["model exact"].startswith("passes")
    assert run.failure["evidence"]["foreshortening"] > 1.0


def test_a_model_that_left_its_range_is_a_suspicion():
    run = diagnosed("pendulum.yaml", "materials.rubber.youngs_modulus=7e9", model="linear")
    doubt = run.statistics["suspicion"]
    assert (run.status, doubt["class"], doubt["item"]) == ("done", "model", "bodies.b1")
    assert doubt["time"] == run.statistics["validity"]["b1"]["left_at"]
    assert any("left the range of linear" in warning for warning in run.statistics["warnings"])


def test_of_models_that_left_their_range_the_first_is_told(monkeypatch):
    monkeypatch.setattr(suspicion, "command_exact", lambda *given, **named: "")
    trial = SimpleNamespace(scene=SimpleNamespace(models={"a": "linear", "b": "linear"}))
    left = {name: {"left_at": t, "reason": "bent", "largest": {}} for name, t in (("a", 2.0), ("b", 1.0))}
    found = suspicion._left_range(trial, left)
    assert (found.item, found.time) == ("bodies.b", 1.0)


def test_a_run_that_is_only_too_long_is_no_matter_of_its_mechanism():
    """A pendulum for thirty years: its steps are as long as ever."""
    run = diagnosed(BOB, "gravity=[0.0, -9.81]", "solve.duration=1.0e9", "output.interval=1.0e6")
    assert (run.failure["class"], run.failure["item"]) == ("numerical", "solve.duration")
    assert "steps crawl" in run.reason and "nothing holds them up but the duration" in run.reason
    until = float(run.failure["try"].split("solve.duration=")[-1])
    assert 0.9 < until / run.failure["time"] < 1.0


def test_what_exact_gets_through_is_no_matter_of_the_mesh():
    """A linear rod falls past the range of its model until an element turns by more than 120 deg."""
    run = diagnosed(FALLING_ROD)
    assert (run.failure["class"], run.failure["item"]) == ("model", "bodies.a")
    assert "it goes away with the model exact" in run.reason
    assert run.failure["try"].endswith("--set solve.model=exact")


# physical --------------------------------------------------------------------------------------------


def test_loops_that_line_up_where_a_step_ends():
    """Two windows of bars, all in one line at the time of the energy balance: they could go over into crossed ones."""
    centre = quad(lambda angle: (1.0 + 7.0 / 3.0 * 9.81 * (1.0 - np.sin(angle))) ** -0.5, 0.0, 0.5 * np.pi)[0]
    steps = ["solve.method=explicit", f"solve.step={centre / 100.0:.17g}", "solve.duration=1.0"]
    run = diagnosed("verify/four_bars.yaml", *steps)
    assert (run.failure["class"], run.failure["item"]) == ("physical", "joints.foot0")
    assert "lose their rank" in run.reason and run.failure["line"] == 14
    assert run.failure["time"] == pytest.approx(centre, rel=1e-9)
    assert "'foot1', 'foot2', 'left1', 'right1', 'left2', 'right2' block the same motion" in run.reason
    assert run.failure["try"].endswith("--set solve.duration=0.7")


def test_an_equation_that_was_left_out_and_counts(monkeypatch):
    """Of Bricard's loop a row without which the others depend on one another where it lies flat: no dead centre.

    Iterations with a derivative alone do not lead through such a position.
    """
    monkeypatch.setattr("hfsim.scene.redundancy._Motion.superfluous", lambda self: [22])
    monkeypatch.setattr(CollocationStepper, "_settled", lambda *_: None)
    text = bricard(angle=1.0)
    run = diagnosed(text)
    assert (run.failure["class"], run.failure["item"]) == ("numerical", "joints.j4")
    assert "an equation of joints.j4 counts that was left out" in run.reason and run.failure["line"] == line_of(text, "j4")
    assert "spherical or cylindrical" in run.failure["try"]


RSSR = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
ground: {points: {d: [0.8, -0.1, 0.0]}}
bodies:
  crank: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.01], points: {a: [-0.1, 0.0, -0.05], b: [0.1, 0.0, 0.05]}}
  rod: {type: rigid, mass: 2.0, inertia: [0.1, 0.1, 0.1], points: {b: [-0.25, -0.15, -0.2], c: [0.25, 0.15, 0.2]}}
  rocker: {type: rigid, mass: 1.5, inertia: [0.05, 0.05, 0.05], points: {c: [-0.05, 0.2, 0.25], d: [0.05, -0.2, -0.25]}}
joints:
  axle: {type: revolute, between: [ground, crank.a], axis: [0.3, 0.2, 1.0]}
  first: {type: spherical, between: [crank.b, rod.b]}
  second: {type: spherical, between: [rod.c, rocker.c]}
  swing: {type: revolute, between: [ground.d, rocker.d], axis: [1.0, 0.3, 0.2]}
  drive: {type: driver, between: [ground, crank.a], axis: [0.3, 0.2, 1.0], angle: {type: smooth_step, from: 0, to: 6, start: 0, end: 1}}
solve: {duration: 1.0, tolerance: 1.0e-8}
"""


def test_a_driver_into_a_dead_centre_in_space():
    """Steps crawl before the joint equations have lost their rank: no joint was named."""
    run = diagnosed(RSSR)

    def beside(turn):
        """Of the pin's distance from the rocker's circle, by which the rod is too long or not."""
        along, about = (np.array(axis) / np.linalg.norm(axis) for axis in ([0.3, 0.2, 1.0], [1.0, 0.3, 0.2]))
        pin, arm = rotation(turn * along) @ [0.2, 0.0, 0.1], np.array([-0.1, 0.4, 0.5])
        centre = np.array([0.8, -0.1, 0.0]) + about * (about @ arm)
        radius, off = arm - about * (about @ arm), centre - pin
        gap = 0.5 - off @ off - radius @ radius
        return np.hypot(2.0 * off @ radius, 2.0 * off @ np.cross(about, radius)) - abs(gap)

    turn = brentq(beside, 1.0, 2.0)
    time = brentq(lambda t: 6.0 * t**3 * (10.0 - 15.0 * t + 6.0 * t * t) - turn, 0.1, 0.9)
    assert (run.failure["class"], run.failure["item"]) == ("physical", "joints.drive")
    assert run.failure["time"] == pytest.approx(time, rel=1e-5)
    assert "drives the mechanism into a dead centre" in run.reason


@pytest.mark.parametrize(
    ("size", "known"),
    [
        (lambda t: 1e-2 * np.sqrt(1.0 + 1e-9 - t), True),
        (lambda t: 1e-2 * (1.0 + 1e-5 - t), False),  # passes at its pace
        (lambda t: 1e-6 * np.exp((1.0 - t) * 1e4), False),
        (lambda t: 1e-6 + 0.0 * t, False),
        (lambda t: 1e-3 * np.sqrt(1.02 - t), False),  # far ahead
    ],
)
def test_a_dead_centre_ahead_is_known_by_how_what_vanishes_falls(size, known, monkeypatch):
    monkeypatch.setattr(diagnosis, "joint_dependence", lambda scene, q: Dependence(0, float(size(q)), ()))
    path = SimpleNamespace(t_end=1.0, segments=[SimpleNamespace(h=1e-11)], at=lambda t: (t, t))
    trial = SimpleNamespace(scene=None, done=SimpleNamespace(trajectory=path))
    assert diagnosis._runs_out(trial, float(size(1.0))) is known


def test_a_driver_into_a_dead_centre():
    """The slider reaches the length of crank and rod, 0.8 m, at (0.8 - 0.68397...) / 0.2 s."""
    run = diagnosed(DEAD_CENTRE)
    assert (run.failure["class"], run.failure["item"]) == ("physical", "joints.push")
    assert run.failure["line"] == line_of(DEAD_CENTRE, "push")
    assert run.failure["time"] == pytest.approx((0.8 - 0.683974572191) / 0.2, rel=1e-5)
    assert "dead centre" in run.reason
    assert (
        simulate(
            parse_deck(DEAD_CENTRE, "s.yaml", [run.failure["try"].split("--set ")[-1]]), error_estimate=False
        ).status
        == "done"
    )


def test_a_beam_crushed_beyond_the_limit_of_green_strain():
    """The force EA (s^3 - s) / 2 of a stretch s has its extreme, -0.19 EA, at s = 3^-1/2."""
    text = COLUMN.replace("[-2.0, 0.0]", "[-2000.0, 0.0]")
    run = diagnosed(text, "solve.duration=1.0")
    assert (run.failure["class"], run.failure["item"]) == ("physical", "bodies.b1")
    assert run.failure["evidence"]["collapse_at"] < run.failure["time"]
    assert run.failure["evidence"]["smallest_stretch"] < 3.0**-0.5
    assert run.failure["evidence"]["energy_drift_until_then"] < 1e-3
    assert "Green strain" in run.reason


def test_a_column_under_six_times_its_buckling_load_only_looks_straight():
    """Euler: pi^2 E I / (4 L^2) = 0.329 N."""
    run = diagnosed(COLUMN)
    assert run.status == "done"
    assert (run.statistics["suspicion"]["class"], run.statistics["suspicion"]["item"]) == (
        "physical",
        "loads.press",
    )
    assert diagnosed(COLUMN, "loads.press.force=[-0.3, 0.0]").statistics["suspicion"] is None


@pytest.mark.parametrize(
    ("text", "rate", "stable"),
    [(UPRIGHT, 3.743, "initial.bob.angle=-90 deg"), (MAST, None, "bodies.mast.length=0.15")],
)
def test_what_only_rests_under_its_weight_is_told(text, rate, stable):
    """An upright bob goes away with sqrt(m g l / (J + m l^2)), 3.74 1/s; nothing moves it but rounding."""
    doubt = diagnosed(text).statistics["suspicion"]
    assert doubt["class"] == "physical" and "under weight" in doubt["reason"]
    assert rate is None or doubt["evidence"]["growth_rate"] == pytest.approx(rate, rel=0.1)
    assert diagnosed(text, stable).statistics["suspicion"] is None


GEARED = """
hfsim: 1
bodies:
  b: {type: rigid, mass: 1.0, inertia: 0.05}
  a: {type: rigid, mass: 1.0, inertia: 0.2}
  c: {type: rigid, mass: 1.0, inertia: 0.3}
joints:
  jb: {type: revolute, between: [ground, b]}
  g: {type: gear, between: [a, b], ratio: -2.5}
  ja: {type: revolute, between: [ground, a]}
  jc: {type: revolute, between: [ground, c]}
springs:
  k1: {type: rotational, between: [ground, a], stiffness: 30.0}
  k2: {type: rotational, between: [b, c], stiffness: 12.0, damping: 0.02}
loads: {m: {type: moment, at: c, moment: 2.0}}
initial: {equilibrium: true}
solve: {duration: 1.0}
output: {channels: [a.angle, c.angle]}
"""


@pytest.mark.parametrize("duration", [0.9, 1.0, 1.5, 2.0])
def test_what_rests_but_for_errors_of_long_steps_is_disturbed_by_more_than_these(duration):
    run = diagnosed(GEARED, f"solve.duration={duration}")
    assert run.status == "done" and run.statistics["suspicion"] is None


@pytest.mark.parametrize("settings", [("gear", 1e-9), ("gauss", 0.1)])
def test_errors_that_grow_where_friction_has_eaten_a_disturbance_are_no_instability(settings):
    updates = (f"solve.{name}={value}" for name, value in zip(("method", "tolerance"), settings, strict=True))
    assert diagnosed(DRAGGED, *updates).statistics["suspicion"] is None


def test_parametric_resonance_is_physical():
    """Mathieu's first tongue: growth rate 1/4 h w0 with h = a W^2 / g, about 0.3 1/s."""
    doubt = diagnosed(SHAKEN).statistics["suspicion"]
    assert (doubt["class"], doubt["item"], doubt["line"]) == (
        "physical",
        "joints.shaker",
        line_of(SHAKEN, "shaker"),
    )
    assert doubt["evidence"]["growth_rate"] == pytest.approx(0.31, rel=0.3)
    assert diagnosed(SHAKEN, "joints.shaker.position.frequency=0.7").statistics["suspicion"] is None


# pace ------------------------------------------------------------------------------------------------


def test_steps_that_stay_hopeless_end_and_say_so(monkeypatch):
    monkeypatch.setattr(_pace, "WINDOWS", ((50, 1e7),))
    fast = Problem(lambda t, q, v: -(1e10**2) * q, lambda t, q, v: (q, v), dissipates=False)
    _, stop = integrate(
        fast, Explicit(1e-6), (0.0, np.ones(1), np.zeros(1)), 1.0, Limits(), lambda *state: None
    )
    assert isinstance(stop, SolverFailure) and "crawl" in stop.reason
    assert fast.counts.steps + fast.counts.rejected <= 150


@pytest.mark.parametrize(("step", "attempts"), [(1e-11, 200), (1e-9, 2000), (1e-6, None)])
def test_the_less_a_run_gains_the_sooner_it_ends(step, attempts):
    pace, made = _pace.Pace(0.0, 1.0), 0
    with pytest.raises(SolverFailure) if attempts else nullcontext():
        for made in range(1, 3000):
            pace.note(made * step, False, False)
    assert made == (attempts or 2999)


def test_short_steps_of_a_stiff_start_are_left_alone(monkeypatch):
    """A chirp down: steps grow all the time, from far below the pace that would be hopeless."""
    monkeypatch.setattr(_pace, "WINDOWS", ((100, 1e7),))
    slowing = Problem(
        lambda t, q, v: -((100.0 / (t[:, None] + 1e-8)) ** 2) * q, lambda t, q, v: (q, v), dissipates=False
    )
    trajectory, stop = integrate(
        slowing, Explicit(1e-6), (0.0, np.ones(1), np.zeros(1)), 1.0, Limits(), lambda *state: None
    )
    assert stop is None and trajectory.segments[0].h < 1e-8


# as the user sees it ---------------------------------------------------------------------------------


def call(tmp_path, *arguments):
    return CliRunner().invoke(app, ["run", *arguments, "-o", str(tmp_path / "out"), "--no-plots"])


def test_run_prints_class_item_line_evidence_and_the_next_command(tmp_path):
    deck = tmp_path / "dead.yaml"
    deck.write_text(DEAD_CENTRE)
    result = call(tmp_path, str(deck), "--no-error-estimate")
    assert result.exit_code == 3
    line = line_of(DEAD_CENTRE, "push")
    for words in (
        "class     physical",
        f"item      joints.push, line {line} of the deck",
        "evidence  smallest singular value",
        f"try       hfsim run {deck} --set solve.duration=",
    ):
        assert words in result.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert set(summary["failure"]) == {"class", "item", "line", "time", "evidence", "try"}
    assert summary["failure"]["line"] == line


def test_no_diagnosis_makes_no_experiments(tmp_path):
    result = call(tmp_path, "pendulum", "--model", "lowOrder", "--no-error-estimate", "--no-diagnosis")
    assert result.exit_code == 3
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "diagnosis" not in summary["cpu_s"] and summary["failure"]["class"] == "model"


@pytest.mark.parametrize("case", ["pendulum", "two_beams", "hub_beams_soft"])
def test_sound_runs_raise_no_suspicion(case):
    run = diagnosed(f"{case}.yaml", "solve.duration=0.5")
    assert run.status == "done" and run.statistics["suspicion"] is None and not run.statistics["validity"]


FLATTENED = """hfsim: 1
materials: {m: {density: 1000, youngs_modulus: 1.0e+8}}
sections: {s: {area: 1.0e-4, second_moment: 1.0e-9}}
ground: {points: {end: [1.0, 0.0]}}
bodies:
  b: {type: beam, material: m, section: s, length: 1.0, elements: 1, strain: engineering, curvature: exact}
joints:
  foot: {type: fixed, between: [ground, b.root]}
  rail: {type: prismatic, between: [b.tip, ground.end], axis: [1, 0]}
loads: {push: {type: force, at: b.tip, force: [-2.0e+4, 0.0]}}
solve: {duration: 0.02}
"""
"""A rod that is pushed together to nothing, as engineering strain allows."""


AS_DRIVERS = [
    "joints.rail={type: driver, between: [b.tip, ground.end], axis: [0, 1], position: 0.0}",
    "joints.turn={type: driver, between: [b.tip, ground.end], angle: 0.0}",
]


@pytest.mark.parametrize("changes", [[], AS_DRIVERS])
def test_a_slope_that_shrinks_to_nothing_is_no_dead_centre(changes):
    """With the slope at the tip the rows of its rail lose their rank: no two joints block the same motion."""
    run = diagnosed(FLATTENED, *changes)
    assert (run.failure["class"], run.failure["item"]) == ("physical", "bodies.b")
    assert "dead centre" not in run.reason and "its axis has no direction there" in run.reason
    assert run.failure["evidence"]["smallest_stretch"] < 0.01
    assert 0.9 < run.failure["evidence"]["collapse_at"] / run.failure["time"] < 1.0
    assert run.failure["try"].split("solve.duration=")[-1].startswith("0.0003")


PULSING = """hfsim: 1
gravity: [0, 0, -9.81]
bodies: {b: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}}
joints:
  tube: {type: cylindrical, between: [ground, b], axis: [1, 0, 0], turning: {friction: {torque: 0.5, velocity: 0.1, law: {type: sine, amplitude: 0.3, frequency: 2, offset: 0.6}}}}
initial: {tube: {angle: 0, angular_velocity: 3, distance: 0, distance_rate: 1}}
solve: {duration: 0.1}
"""


def test_the_amplitude_of_a_law_is_found_wherever_it_stands_in_a_joint():
    scene = build(parse_deck(PULSING))
    assert loaded_items(scene) == ["joints.tube.turning"]
    path, value = amplitude_of(scene, "joints.tube.turning")
    assert (path, value) == ("joints.tube.turning.friction.law.amplitude", 0.3)
    assert build(parse_deck(PULSING, overrides=[f"{path}=0.1"]))
    assert diagnosed(PULSING).statistics["suspicion"] is None
