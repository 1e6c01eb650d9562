# ruff: noqa: E501
"""Spatial loops that are held too often: named, run with what is independent, and refused where joints disagree."""

import re
from contextlib import suppress
from unittest import mock

import mechanisms
import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

from hfsim.errors import DeckError, SolverFailure
from hfsim.marching.plan import plan_of
from hfsim.marching.runaway import RedundantWatch
from hfsim.maths.rotations import rotation
from hfsim.mechanics import spatial_markers
from hfsim.scene import redundancy
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

LOOPS = {"four_bar": 3, "bennett": 3, "bricard": 1}
"""Joint equations too many."""


@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_that_is_held_too_often_is_named_and_has_its_one_freedom(name):
    text = getattr(mechanisms, name)()
    built = build(parse_deck(text, "loop.yaml"))
    joints = list(built.deck.joints)
    assert built.redundancy.joints == tuple(joints)
    (warning,) = built.warnings
    assert f"{LOOPS[name]} of {5 * len(joints)} joint equations" in warning  # a hinge has five
    assert all(f"'{joint}' (line " in warning for joint in joints)
    assert sum(motion.number for motion in built.free_motions) == 1
    assert built.system.n - built.system.n_rows == 1


@pytest.mark.parametrize("name", ["four_bar", "bennett"])
def test_a_loop_that_is_held_too_often_moves_as_one_that_is_not(name):
    """All its equations are monitored; with a ball and a sliding hinge in it nothing is superfluous."""
    text = getattr(mechanisms, name)()
    run = simulate(parse_deck(text), error_estimate=False)
    assert run.statistics["constraint_position"] < 1e-11
    assert run.statistics["energy_drift"] < 1e-11
    if name == "four_bar":
        text = text.replace("j1: {type: revolute", "j1: {type: cylindrical").replace(
            "j2: {type: revolute", "j2: {type: spherical"
        )
        text = "\n".join(
            line.split(", axis")[0] + "}" if "spherical" in line else line for line in text.split("\n")
        )
        other = simulate(parse_deck(text), error_estimate=False)
        assert other.statistics["warnings"] == []
        for one, same in zip(run.channels[:3], other.channels[:3], strict=True):
            assert np.ptp(one.values) > 0.05 or one.name.endswith("z")
            assert one.values == pytest.approx(same.values, abs=2e-8)


def swapped(text, joint):
    """The same loop with the bodies of a hinge the other way round."""
    deck = yaml.safe_load(text)
    entry = deck["joints"][joint]
    a, b = (deck["initial"].get(end.partition(".")[0]) for end in entry["between"])
    into = [np.eye(3) if one is None else np.stack([*one["orientation"].values()]) for one in (a, b)]
    along = np.array(entry["axis"])
    for k, R in enumerate(into):
        R = R if len(R) == 3 else np.stack([*R, np.cross(*R)])
        along = R @ along if k else R.T @ along
    deck["joints"][joint] = {**entry, "between": entry["between"][::-1], "axis": along.tolist()}
    return yaml.safe_dump(deck, sort_keys=False)


@pytest.mark.parametrize(
    ("text", "joints"),
    [
        (mechanisms.bennett(), ()),
        (mechanisms.bennett(), ("j1", "j3")),
        (mechanisms.bennett(angle=1.9), ("j1",)),  # no rows of joints alone will do
        (mechanisms.bennett(twists=(0.3, 0.9)), ("j0", "j1")),
        (mechanisms.bricard(), ("j1", "j2")),
    ],
)
def test_what_is_left_of_a_loop_stays_independent_all_along_its_motion(text, joints, monkeypatch):
    """Between steps too: of a loop that goes through, rows were left out that counted twice in a turn."""
    found = []
    chosen = redundancy._Motion.superfluous

    def looked_at(motion):
        rows = chosen(motion)
        for name, value in (("STEP", redundancy.STEP / 8), ("MOST_STEPS", 800), ("EFFORT", 1e9), ("ROUND", 80)):
            monkeypatch.setattr(redundancy, name, value)
        finely = redundancy._Motion(motion._own, motion._missing, motion._start, motion._basis, motion._unit)
        assert not finely.contradiction() and len(finely.null) > 6 * len(motion.null)
        found.append(np.linalg.svd(np.array(finely.null)[:, rows], compute_uv=False)[:, -1].min())
        return rows

    monkeypatch.setattr(redundancy._Motion, "superfluous", looked_at)
    for joint in joints:
        text = swapped(text, joint)
    scene = build(parse_deck(text))
    assert scene.system.n - scene.system.n_rows == 1
    assert found[0] > 0.05


def test_a_loop_in_another_place_moves_alike():
    R, shift = rotation(np.array([0.3, -1.0, 0.7])), np.array([0.2, 0.5, -1.0])
    run, other = (
        simulate(parse_deck(mechanisms.bennett(**to)), error_estimate=False)
        for to in ({}, {"R": R, "shift": shift})
    )
    here, there = (np.array([channel.values for channel in one.channels[:3]]) for one in (run, other))
    assert there == pytest.approx(R @ here + shift[:, None], abs=1e-9)


def test_kites_are_built_whatever_their_lengths():
    """Where their motion turns back, corrections lead away from the joints."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        a, b = rng.uniform(0.2, 1.0, 2)
        with np.errstate(all="raise"), suppress(DeckError):  # that they can go on in two ways is no fault
            build(parse_deck(mechanisms.four_bar(3.0, rng.uniform(0.3, 2.5), (a, a, b, b))))


FLAT = """hfsim: 1
gravity: [0, -9.81, 0]
ground: {points: {d: [1.0, 0, 0]}}
bodies:
  crank: {type: rigid, mass: 1.0, inertia: [0.02, 0.02, 0.02], points: {a: [-0.15, 0, 0], b: [0.15, 0, 0]}}
  rod: {type: rigid, mass: 2.0, inertia: [0.2, 0.2, 0.2], points: {a: [-0.5, 0, 0], b: [0.5, 0, 0]}}
  rocker: {type: rigid, mass: 1.0, inertia: [0.02, 0.02, 0.02], points: {a: [-0.15, 0, 0], b: [0.15, 0, 0]}}
joints:
  A: {type: revolute, between: [ground, crank.a]}
  B: {type: revolute, between: [crank.b, rod.a]}
  C: {type: revolute, between: [rod.b, rocker.b]}
  D: {type: revolute, between: [ground.d, rocker.a]}
initial: {crank: {angle: ANGLE, angular_velocity: 5.0}, rod: {angle: 0.0}, rocker: {angle: ANGLE}}
solve: {duration: 1.0}
output: {channels: [crank.rotation_z]}
"""


@pytest.mark.parametrize("angle", ["1.0e-4", "1.0e-7"])
def test_a_parallelogram_that_starts_next_to_its_dead_centre_runs(angle):
    run = simulate(parse_deck(FLAT.replace("ANGLE", angle)), error_estimate=False)
    # both links and the rod, which does not turn: energy of a pendulum
    inertia, weight = 2.0 * (0.02 + 0.15**2) + 2.0 * 0.3**2, 9.81 * (2.0 * 0.15 + 2.0 * 0.3)
    found = solve_ivp(
        lambda t, y: [y[1], -weight * np.cos(y[0]) / inertia], (0.0, 1.0), [float(angle), 5.0], rtol=1e-10
    )
    apart = np.angle(np.exp(1j * (run.final["crank.rotation_z"] - found.y[0, -1])))
    assert (run.status, apart) == ("done", pytest.approx(0.0, abs=2e-5))


def test_two_loops_leave_out_what_stays_superfluous_in_each():
    """Rows whose part of a null vector goes through zero, in both loops at once, leave others that fail there."""
    lines = [(line, re.sub(r"\b(?=[lj]\d)", "twin_", line)) for line in mechanisms.bricard().splitlines()]
    text = "\n".join("\n".join(dict.fromkeys(pair)) for pair in lines if "output" not in pair[0])
    run = simulate(
        parse_deck(text, "s.yaml", ["solve.method=explicit", "solve.tolerance=1e-9"]), error_estimate=False
    )
    assert (run.status, len(run.statistics["warnings"])) == ("done", 1)
    assert run.statistics["constraint_velocity"] < 1e-10
    assert run.statistics["energy_drift"] < 1e-8


DOOR = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
ground: {{points: {{low: [0.0, 0.0, 0.0], high: [0.3, 0.0, 1.8]}}}}
bodies:
  door: {{type: rigid, mass: 20.0, inertia: [5.0, 7.0, 2.0], points: {{low: [-0.4, 0, -0.9], high: [-0.1, 0, 0.9]}}}}
joints:
  lower: {{type: revolute, between: [ground.low, door.low], axis: [0.3, 0.0, 1.8]}}
  upper: {{type: {upper}, between: [ground.high, door.high]{more}}}
initial: {{door: {{angular_velocity: [0.3, 0.0, 1.8]}}}}
solve: {{duration: 0.6, tolerance: 1.0e-9}}
output: {{channels: [door.x, door.rotation_z, lower.force_z, upper.force_z, upper.force_x, lower.force_x]}}
"""
HINGED = DOOR.format(upper="revolute", more=", axis: [0.3, 0.0, 1.8]")


def test_a_door_on_two_hinges():
    """Its motion and the sum of both forces are those with a ball and a slide in place of one hinge."""
    door = simulate(parse_deck(HINGED), error_estimate=False)
    (warning,) = door.statistics["warnings"]
    assert "5 of 10 joint equations" in warning and "not unique" in warning
    single = simulate(
        parse_deck(HINGED.replace("  upper", "  # upper").replace(", upper.force_z, upper.force_x", "")),
        error_estimate=False,
    )
    x, turn, low_z, high_z, high_x, low_x = (channel.values for channel in door.channels)
    own = [channel.values for channel in single.channels]
    assert np.ptp(turn) > 0.3
    for found, expected in zip((x, turn, low_z + high_z, low_x + high_x), own, strict=True):
        assert found == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("rate", [3.0, -2.0])
def test_joints_that_agree_at_the_start_alone_are_refused(rate):
    """A parallelogram that is stretched out can go on in two ways; there its joints hold one motion more often."""
    with pytest.raises(DeckError, match="agree at the start alone") as refusal:
        build(parse_deck(mechanisms.four_bar(rate, 0.0, (0.3, 0.8, 0.3, 0.8))))
    (problem,) = refusal.value.problems
    assert problem.path == "joints.j3" and "'j0' (line 10)" in problem.message


def test_a_driver_that_drives_what_another_drives_is_refused():
    motors = "".join(
        f"  {name}: {{type: driver, between: [ground, door], axis: [0.3, 0.0, 1.8], angle: {{type: constant_rate, rate: {rate}}}}}\n"
        for name, rate in (("m1", 1.0), ("m2", 1.0))
    )
    text = HINGED.replace("initial: {door: {angular_velocity: [0.3, 0.0, 1.8]}}\n", "").replace(
        "solve:", motors + "solve:"
    )
    with pytest.raises(DeckError, match="driver among them"):
        build(parse_deck(text))


def test_the_plane_keeps_refusing():
    text = """hfsim: 1
bodies: {bar: {type: rigid, mass: 1.0, inertia: 1.0, points: {a: [0.0, 0.0], b: [0.0, 0.0]}}}
joints: {one: {type: revolute, between: [ground, bar.a]}, two: {type: revolute, between: [ground, bar.b]}}
solve: {duration: 1.0}
"""
    with pytest.raises(DeckError, match="redundant"):
        build(parse_deck(text))


def test_a_state_in_which_left_out_equations_do_not_hold_ends_a_run():
    built = build(parse_deck(mechanisms.bennett()))
    watch, t = RedundantWatch(built.system), np.zeros(1)
    watch(0.0, built.q, built.v)
    rows = built.system.redundant
    assert sum(row.rows for row in rows) == 3
    apart = built.q + 1e-3 * np.sin(np.arange(len(built.q)))
    gaps = [np.abs(row.residual(t, built.system.absolute(apart[None]))).max() for row in rows]
    with pytest.raises(SolverFailure, match="comes apart by") as failure:
        watch(0.5, apart, built.v)
    assert failure.value.item == rows[int(np.argmax(gaps))].item
    assert failure.value.evidence["gap"] == pytest.approx(max(gaps))


def test_a_plan_tells_which_joints_have_fewer_multipliers():
    plan = plan_of(build(parse_deck(HINGED)))
    kept = {entry["item"]: entry for entry in plan["kept"] if entry["item"].startswith("joints.")}
    assert sorted(entry["multipliers"] for entry in kept.values()) == [0, 5]
    assert all("redundant equations" in entry["reason"] for entry in kept.values())


def test_many_equal_joints_are_told_by_the_first_of_them_and_soon():
    joints = "".join(f"  j{k}: {{type: fixed, between: [ground, a]}}\n" for k in range(300))
    text = "hfsim: 1\ngravity: [0.0, 0.0, -9.81]\nbodies: {a: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, 1.0]}}\n"
    counted = mock.Mock(side_effect=spatial_markers.rotation)
    with mock.patch.object(spatial_markers, "rotation", counted), pytest.raises(DeckError) as refusal:
        build(parse_deck(f"{text}joints:\n{joints}solve: {{duration: 1.0}}\n"))
    (problem,) = refusal.value.problems
    assert "1794 of 1800 joint equations" in problem.message
    assert "'j7' (line 12), and 291 more already block" in problem.message
    assert counted.call_count < 100
