# ruff: noqa: E501
"""Gears and racks: planetary gears against closed forms, with all turns, and what is refused."""

import numpy as np
import pytest

from hfsim.errors import DeckError
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

PLANETARY = """
hfsim: 1
name: planetary
parameters: {zs: 20, zp: 15, zr: 50, r: 0.175}
bodies:
  sun: {type: rigid, mass: 1.0, inertia: 0.02}
  arm: {type: rigid, mass: 2.0, inertia: 0.05, points: {"p{k=1..3}": ["${r * cos(k * tau / 3)}", "${r * sin(k * tau / 3)}"]}}
  planet{k=1..3}: {type: rigid, mass: 0.5, inertia: 0.004}
joints:
  shaft: {type: revolute, between: [ground, sun]}
  centre: {type: revolute, between: [ground, arm]}
  pin{k=1..3}: {type: revolute, between: ["arm.p{k}", "planet{k}"]}
  inner{k=1..3}: {type: gear, between: [sun, "planet{k}"], carrier: arm, ratio: "${-zs / zp}"}
  outer: {type: gear, between: [ground, planet2], carrier: arm, ratio: "${zr / zp}"}
loads: {drive: {type: moment, at: sun, moment: 0.3}}
initial: {sun: {angle: 400 deg, angular_velocity: 1.0}}
solve: {duration: 1.0}
output: {interval: 0.5, channels: [sun.angle, arm.angle, planet2.angle, sun.angular_acceleration, arm.angular_velocity, outer.moment, outer.power]}
"""
SLOW = 20.0 / 70.0
"""Turn of the arm for one of the sun, the ring standing still; of the planets:"""
BACK = SLOW * (1.0 - 50.0 / 15.0)
INERTIA = 0.02 + SLOW**2 * (0.05 + 1.5 * 0.175**2) + 3.0 * BACK**2 * 0.004

# A pinion on a frame that swings, and its bar, whose point slides along a leaning axis of the frame
RACK = """
hfsim: 1
name: rack
gravity: [0.0, -9.81]
bodies:
  frame: {type: rigid, mass: 3.0, inertia: 0.3, points: {o: [-0.5, 0.0], w: [0.2, 0.1]}}
  pinion: {type: rigid, mass: 1.0, inertia: 0.02}
  bar: {type: rigid, mass: 2.0, inertia: 0.01, points: {q: [0.1, 0.0]}}
joints:
  hinge: {type: revolute, between: [ground, frame.o]}
  axle: {type: revolute, between: [frame.w, pinion]}
  rail: {type: prismatic, between: [frame, bar.q], axis: [1, 1], angle: 0.3}
  teeth: {type: gear, between: [pinion, bar.q], carrier: frame, radius: 4 cm, axis: [1, 1]}
initial: {frame: {angle: -20 deg, angular_velocity: 1.0}, axle: {angle: 800 deg, angular_velocity: 5}}
solve: {duration: 0.5}
output: {interval: 0.5, channels: [axle.angle, rail.distance, axle.angular_velocity, rail.distance_rate]}
"""


def run_of(text, *changes):
    run = simulate(parse_deck(text, "gears.yaml", changes), error_estimate=False)
    assert run.status == "done", run.reason
    return run


@pytest.mark.parametrize("changes", [(), ("solve.method=radau",), ("solve.method=energy", "solve.step=0.01")])
def test_a_planetary_gear_turns_as_its_equivalent_inertia(changes):
    run = run_of(PLANETARY, *changes)
    pace = 0.3 / INERTIA
    turned = np.radians(400.0) + run.t + 0.5 * pace * run.t**2
    assert run["sun.angle"] == pytest.approx(turned, rel=1e-8)
    assert run["arm.angle"] == pytest.approx(SLOW * turned, rel=1e-8)
    assert run["planet2.angle"] == pytest.approx(BACK * turned, rel=1e-8)
    assert run["sun.angular_acceleration"] == pytest.approx(pace, rel=1e-9)
    assert run["outer.power"] == pytest.approx(0.0, abs=1e-9)


def test_its_ring_bears_what_is_left_of_the_moments():
    """What the ring gives, its moment on the planet by its ratio, and the sun's change the angular momentum."""
    run, pace = run_of(PLANETARY), 0.3 / INERTIA
    spin = pace * (0.02 + SLOW * (0.05 + 1.5 * 0.175**2) + 3.0 * BACK * 0.004)
    assert run["outer.moment"] * 50.0 / 15.0 == pytest.approx(spin - 0.3, rel=1e-9)


def test_two_wheels_on_the_ground_start_at_a_stated_angle():
    text = """
hfsim: 1
name: pair
bodies: {a: {type: rigid, mass: 1, inertia: 0.2}, b: {type: rigid, mass: 1, inertia: 0.3}}
joints:
  left: {type: revolute, between: [ground, a]}
  right: {type: revolute, between: [ground, b]}
  mesh: {type: gear, between: [a, b], ratio: -2.5, angle: 10 deg}
springs: {coil: {type: rotational, between: [ground, b], stiffness: 7.0, rest_angle: 10 deg}}
initial: {a: {angle: 0.4}}
solve: {duration: 2.0}
output: {interval: 0.5, channels: [a.angle, b.angle]}
"""
    run = run_of(text)
    swing = 0.4 * np.cos(2.5 * np.sqrt(7.0 / (0.2 + 2.5**2 * 0.3)) * run.t)
    assert run["a.angle"] == pytest.approx(swing, abs=1e-6)
    assert run["b.angle"] == pytest.approx(np.radians(10.0) - 2.5 * run["a.angle"], abs=1e-12)


def test_a_rack_on_the_ground_accelerates_as_its_equivalent_mass():
    text = RACK.replace("hinge: {type: revolute", "hinge: {type: fixed").replace("[0.0, -9.81]", "[0.0, 0.0]")
    text = text.replace("frame: {angle: -20 deg, angular_velocity: 1.0}, ", "")
    run = run_of(text, "loads.drive={type: moment, at: pinion, moment: 0.3}")
    pace = 0.3 / (0.02 + 2.0 * 0.04**2)
    turned = np.radians(800.0) + 5.0 * run.t + 0.5 * pace * run.t**2
    assert run["axle.angle"] == pytest.approx(turned, rel=1e-8)
    assert run["rail.distance"] == pytest.approx(0.04 * turned, rel=1e-8)


def test_a_rack_on_a_frame_that_swings_keeps_its_energy_and_its_ratio():
    run = run_of(RACK)
    assert run["rail.distance"] == pytest.approx(0.04 * run["axle.angle"], abs=1e-9)
    assert run["rail.distance_rate"] == pytest.approx(0.04 * run["axle.angular_velocity"], abs=1e-9)
    assert run.statistics["energy_drift"] < 1e-7


def test_derivatives_of_a_rack():
    scene = build(parse_deck(RACK, "gears.yaml"))
    (row,) = (c for c in scene.system.constraints if c.item == "joints.teeth")
    rng = np.random.default_rng(1)
    x, u = rng.normal(size=(2, 1, scene.system.n_x))
    h = 1e-5
    J = np.zeros(scene.system.n_x)
    for end, jacobian in zip(row.ends, row.jacobians(x), strict=True):
        J[end.columns] += jacobian[0, 0]
    slopes = [(row.gap(x + h * e) - row.gap(x - h * e))[0, 0] / (2.0 * h) for e in np.eye(len(J))]
    np.testing.assert_allclose(J, slopes, atol=1e-8)
    bend = (row.gap(x + h * u) - 2.0 * row.gap(x) + row.gap(x - h * u)) / h**2
    assert row.bias(x, u) == pytest.approx(bend, abs=1e-4)


def test_what_turns_is_found_from_either_side_with_all_its_turns():
    scene = build(parse_deck(PLANETARY, "gears.yaml", ["initial={planet2: {angle: -30}}"]))
    angles = {name: pose.angle for name, pose in scene.assembly.poses.items()}
    assert angles["sun"] == pytest.approx(-30.0 / BACK) and angles["arm"] == pytest.approx(-30.0 * SLOW / BACK)
    assert [(one.body, one.kind) for one in scene.free_motions] == [("sun", "turns")]


def test_angles_of_joints_between_wheels_are_stated_with_all_their_turns():
    scene = build(parse_deck(PLANETARY, "gears.yaml", ["initial={pin2: {angle: 400 deg}}"]))
    angles = {name: pose.angle for name, pose in scene.assembly.poses.items()}
    assert angles["planet2"] - angles["arm"] == pytest.approx(np.radians(400.0))
    assert angles["sun"] == pytest.approx(angles["planet2"] / BACK)


def test_angles_that_do_not_mesh_are_guesses_or_refused():
    near = "initial={sun: {angle: 0.1}, arm: {angle: 0.03}}"
    changes = build(parse_deck(PLANETARY, "gears.yaml", [near])).assembly.changes
    assert {one.body for one in changes} == {"sun", "arm"}
    with pytest.raises(DeckError, match="cannot be closed with what is exact"):
        build(parse_deck(PLANETARY, "gears.yaml", [near.replace("}}", ", exact: true}}").replace("0.1}", "0.1, exact: true}")]))


@pytest.mark.parametrize(
    ("gear", "at", "why"),
    [
        ("between: [sun, planet2], carrier: arm", "", "needs a ratio, or as a rack a radius"),
        ("between: [sun, planet2], ratio: 2, radius: 3", "", "needs a ratio, or as a rack a radius"),
        ("between: [sun, planet2], ratio: 0", ".ratio", "must not be zero"),
        ("between: [sun, planet2], ratio: 2, axis: [1, 0]", ".axis", "nothing slides"),
        ("between: [sun, planet2], radius: 2, angle: 1", ".angle", "a rack has a distance"),
        ("between: [sun, planet2], radius: 2, axis: [0, 1, 0]", ".axis", "must be a list of 2 numbers"),
        ("between: [sun, planet2], ratio: 2, carrier: arn", ".carrier", "no body 'arn'"),
        ("between: [sun, planet2], ratio: 2, carrier: arm.q", ".carrier", "'arm' has no point 'q'"),
        ("between: [sun, arm], ratio: 2, carrier: arm.p1", ".between.1", "is the carrier itself"),
        ("between: [ground, sun], ratio: 2", ".between.0", "is the carrier itself"),
        ("between: [sun, rod.tip], ratio: 2", ".between.1", "'rod' is no rigid body"),
        ("between: [sun, planet2], ratio: 2, carrier: rod", ".carrier", "'rod' is no rigid body"),
    ],
)  # fmt: skip
def test_what_is_no_gear_is_told_where_it_stands(gear, at, why):
    beam = "  rod: {type: beam, material: m, section: s, length: 1, elements: 1}\njoints:"
    text = PLANETARY.replace("joints:", beam).replace("joints:", f"joints:\n  new: {{type: gear, {gear}}}")
    text += "materials: {m: {density: 1000, youngs_modulus: 1e9}}\nsections: {s: {shape: circle, diameter: 0.1}}\n"
    with pytest.raises(DeckError, match=why) as told:
        parse_deck(text, "gears.yaml")
    (problem,) = told.value.problems
    assert problem.path.replace("[", ".").replace("]", "") == f"joints.new{at}"
    assert "new: " in text.splitlines()[problem.line - 1]


def test_gears_are_planar():
    with pytest.raises(DeckError, match="gears are planar"):
        parse_deck("""
hfsim: 1
gravity: [0, 0, 0]
bodies: {a: {type: rigid, mass: 1, inertia: [1, 1, 1]}, b: {type: rigid, mass: 1, inertia: [1, 1, 1]}}
joints: {mesh: {type: gear, between: [a, b], ratio: 1}}
solve: {duration: 1}
""", "gears.yaml")  # fmt: skip


def test_what_several_hold_the_same_is_told():
    more = "joints.more={type: gear, between: [ground, planet3], carrier: arm, ratio: 3.3333333333333335}"
    with pytest.raises(DeckError, match=r"joints\.more: blocks what .*'outer'.* already block"):
        build(parse_deck(PLANETARY, "gears.yaml", [more]))


def test_a_carrier_alone_connects_what_it_bears(monkeypatch):
    """A differential whose three shafts are on the ground is one part."""
    monkeypatch.setattr("hfsim.scene.rules.PARTS_FROM", 1)
    text = """
hfsim: 1
name: differential
bodies:
  a: {type: rigid, mass: 1, inertia: 0.2}
  b: {type: rigid, mass: 1, inertia: 0.3}
  cage: {type: rigid, mass: 1, inertia: 0.5}
joints:
  left: {type: revolute, between: [ground, a]}
  right: {type: revolute, between: [ground, b]}
  crown: {type: revolute, between: [ground, cage]}
  mesh: {type: gear, between: [a, b], carrier: cage, ratio: -1}
loads: {drive: {type: moment, at: cage, moment: 1.0}}
solve: {duration: 1.0}
output: {interval: 1.0, channels: [a.angle, b.angle, cage.angle]}
"""
    run = run_of(text)
    assert run["a.angle"] + run["b.angle"] == pytest.approx(2.0 * run["cage.angle"], abs=1e-12)
    assert run["cage.angle"][-1] == pytest.approx(0.5 / (0.5 + 4.0 / (1 / 0.2 + 1 / 0.3)), rel=1e-9)

NEAR = """hfsim: 1
bodies:
  a: {type: rigid, mass: 1.0, inertia: 0.02}
  b: {type: rigid, mass: 1.0, inertia: 0.02}
  c: {type: rigid, mass: 1.0, inertia: 0.02}
joints:
  ja: {type: revolute, between: [ground, a]}
  jb: {type: revolute, between: [ground, b]}
  jc: {type: revolute, between: [ground, c]}
  g: {type: gear, between: [a, b], ratio: 1}
  h: {type: gear, between: [b, c], ratio: 3}
initial: {INITIAL}
solve: {duration: 0.1}
"""


def test_the_nearest_start_does_not_count_what_only_follows():
    """The third wheel, which nothing states, turns three times as far: it drew the others to 0.190909."""
    found = build(parse_deck(NEAR.replace("INITIAL", "a: {angle: 0.1}, b: {angle: 0.2}"))).assembly
    assert [pose.turn[0] for pose in found.poses.values()] == pytest.approx([0.15, 0.15, 0.45])
    assert [change.taken for change in found.changes] == [pytest.approx((0.15,)), pytest.approx((0.15,))]
    found = build(parse_deck(NEAR.replace("INITIAL", "a: {angular_velocity: 10}, b: {angular_velocity: 10.2}"))).assembly
    assert [twist.spin[0] for twist in found.twists.values()] == pytest.approx([10.1, 10.1, 30.3])
    with pytest.raises(DeckError, match=r"a\.angular_velocity 6 rad/s, b\.angular_velocity 6 rad/s"):
        build(parse_deck(NEAR.replace("INITIAL", "a: {angular_velocity: 10}, b: {angular_velocity: 2}")))
    with pytest.raises(DeckError, match=r"a\.angular_velocity 0 rad/s, b\.angular_velocity 0 rad/s"):
        build(parse_deck(NEAR.replace("INITIAL", "a: {angular_velocity: 10.1}, b: {angular_velocity: -10.1}")))


def test_the_other_way_to_close_is_told_with_the_full_turns_that_gears_count():
    """Told as 30 deg, which the deck states already, it was no other way."""
    driver = "dr: {type: driver, between: [ground, a], angle: {type: constant_rate, rate: 3.0, start: 30 deg}}"
    text = "\n".join(line for line in NEAR.splitlines() if not line.startswith(("  c:", "  jc:", "  h:")))
    text = text.replace("ratio: 1}", "ratio: 0.25}").replace("  g:", f"  {driver}\n  g:")
    found = build(parse_deck(text.replace("INITIAL", "a: {angle: 30 deg}"))).assembly
    told = [{name: np.degrees(turn) for name, turn in way.items()} for way in found.branches()]
    assert told[0]["a"] % 360.0 == pytest.approx(30.0) and abs(told[0]["a"] - 30.0) > 1.0
    other = build(parse_deck(text.replace("INITIAL", f"a: {{angle: {float(told[0]['a'])!r} deg}}"))).assembly
    assert np.degrees(other.poses["b"].turn[0]) == pytest.approx(told[0]["b"])


CLOSE = """hfsim: 1
name: close
gravity: [0.0, -9.81]
bodies:
  sun: {type: rigid, mass: 1, inertia: 0.01}
  arm: {type: rigid, mass: 1, inertia: 0.02, points: {pin: [0.2, 0.05]}}
  planet: {type: rigid, mass: 0.5, inertia: 0.005, points: {e: [0.1, 0.02]}}
  rod: {type: rigid, mass: 0.5, inertia: 0.005, points: {e: [-0.3, 0.0]}}
joints:
  shaft: {type: revolute, between: [ground, sun]}
  centre: {type: revolute, between: [ground, arm]}
  pin: {type: revolute, between: [arm.pin, planet]}
  weld: {type: fixed, between: [planet.e, rod.e], angle: 0.7}
  inner: {type: gear, between: [sun, planet], carrier: arm, ratio: 2.0}
  outer: {type: gear, between: [ground, planet], carrier: arm, ratio: 2.08}
initial: {}
solve: {duration: 1.0e-3}
output: {interval: 1.0e-3, channels: [shaft.angle, centre.angle, pin.angle, sun.angle, arm.angle, planet.angle, rod.angle]}
"""
"""A differential gear whose arm turns 25 times as fast as its sun, the other way round."""


@pytest.mark.parametrize("sun", [0.7, 1.0, -8.0, 40.0])
@pytest.mark.parametrize(("joint", "ratio"), [("shaft", 1.0), ("centre", -25.0), ("pin", 52.0)])
def test_a_start_stated_by_a_joint_is_handed_on_by_gears_with_all_turns(joint, ratio, sun):
    """The planet turns against the arm by 2.08 (0 + 25 s), and by 2 (s + 25 s) as the sun has it."""
    run = run_of(CLOSE, f"initial.{joint}.angle={ratio * sun}")
    found = [run[f"{name}.angle"][0] for name in ("shaft", "centre", "pin", "sun", "arm", "planet", "rod")]
    assert found == pytest.approx([sun, -25 * sun, 52 * sun, sun, -25 * sun, 27 * sun, 27 * sun + 0.7], abs=1e-9)
    assert build(parse_deck(CLOSE, "c.yaml", [f"initial.{joint}.angle={ratio * sun}"])).assembly.closed.keys() >= {"planet", "rod"}


def test_where_nothing_is_stated_of_gears_the_first_wheel_stands_unturned():
    deck = NEAR.replace("INITIAL", "{}").replace("initial: {{}}", "initial: {}").replace("ratio: 3}", "ratio: 3, angle: 0.5}")
    found = build(parse_deck(deck)).assembly.poses
    assert [pose.turn[0] for pose in found.values()] == pytest.approx([0.0, 0.0, 0.5], abs=1e-12)


def test_gears_that_contradict_what_is_stated_hand_nothing_on():
    """Those of others, which two gears lock, do all the same."""
    text = CLOSE.replace("bodies:", "bodies:\n  a: {type: rigid, mass: 1, inertia: 1}\n  b: {type: rigid, mass: 1, inertia: 1}")
    text = text.replace("joints:", """joints:
  left: {type: revolute, between: [ground, a]}
  right: {type: revolute, between: [ground, b]}
  fast: {type: gear, between: [a, b], ratio: 7}
  slow: {type: gear, between: [a, b], ratio: 6.5, angle: 20}""")
    with pytest.raises(DeckError, match=r"correct or leave out initial\.shaft\.angle, initial\.centre\.angle\)"):
        build(parse_deck(text, "c.yaml", ["initial={shaft: {angle: 1}, centre: {angle: 3}}"]))
    found = build(parse_deck(text, "c.yaml", ["initial={sun: {angle: 1}, arm: {angle: -24.9}}"])).assembly
    assert {change.body for change in found.changes} == {"sun", "arm"}
    assert [found.poses[name].turn[0] for name in "ab"] == pytest.approx([40.0, 280.0])
