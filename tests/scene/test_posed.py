# ruff: noqa: E501
"""Angles, distances and rates of joints as starting values: channels show at the start what is stated."""

import numpy as np
import pytest
import yaml

from hfsim.errors import DeckError
from hfsim.scene import posed
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

ARM = """
hfsim: 1
name: arm
gravity: [0.0, -9.81]
bodies:
  upper: {type: rigid, mass: 2.0, inertia: 0.1, points: {in: [-0.5, 0.0], out: [0.5, 0.0]}}
  lower: {type: rigid, mass: 1.0, inertia: 0.05, points: {in: [-0.4, 0.0], out: [0.4, 0.0]}}
  slide: {type: rigid, mass: 0.3, inertia: 0.01}
joints:
  shoulder: {type: revolute, between: [ground, upper.in]}
  elbow: {type: revolute, between: [upper.out, lower.in]}
  rod: {type: prismatic, between: [lower.out, slide], axis: [1, 1], angle: 10 deg}
initial:
  shoulder: {angle: 30 deg, angular_velocity: 10 rpm}
  elbow: {angle: 400 deg, angular_velocity: -1.5}
  rod: {distance: 10 cm, distance_rate: 0.2}
solve: {duration: 1.0e-3}
output:
  interval: 1.0e-3
  channels: [shoulder.angle, shoulder.angular_velocity, elbow.angle, elbow.angular_velocity, rod.distance,
             rod.distance_rate]
"""
STATED = [np.pi / 6, np.pi / 3, np.radians(400.0), -1.5, 0.1, 0.2]

# The base turns about z; the elbow leans, and the rod turns and slides
SPATIAL = """
hfsim: 1
name: robot
gravity: [0.0, 0.0, -9.81]
materials: {nylon: {density: 1150, youngs_modulus: 3 GPa, poisson_ratio: 0.4}}
sections: {round: {shape: circle, diameter: 4 cm}}
bodies:
  base: {type: rigid, mass: 2.0, inertia: [0.1, 0.1, 0.1], points: {top: [0, 0, 0.3]}}
  upper: {type: beam, material: nylon, section: round, length: 1.0, elements: 2}
  lower: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {in: [-0.4, 0, 0], out: [0.4, 0, 0]}}
  slide: {type: rigid, mass: 0.3, inertia: [0.01, 0.01, 0.01]}
joints:
  yaw: {type: revolute, between: [ground, base]}
  shoulder: {type: revolute, between: [base.top, upper.root], axis: [0, -1, 0]}
  elbow: {type: revolute, between: [upper.tip, lower.in], axis: [0, 1, 0.2]}
  rod: {type: cylindrical, between: [lower.out, slide], axis: [1, 0, 0]}
initial:
  yaw: {angle: 200 deg, angular_velocity: 1}
  shoulder: {angle: 30 deg, angular_velocity: 10 rpm}
  elbow: {angle: -300 deg, angular_velocity: -1.5}
  rod: {distance: 10 cm, distance_rate: 0.2, angle: -1, angular_velocity: 3}
solve: {duration: 1.0e-3}
output:
  interval: 1.0e-3
  channels: [yaw.angle, shoulder.angle, elbow.angle, rod.angle, rod.distance, yaw.angular_velocity,
             shoulder.angular_velocity, elbow.angular_velocity, rod.angular_velocity, rod.distance_rate]
"""
SPATIAL_STATED = [*np.radians([200.0, 30.0, -300.0]), -1.0, 0.1, 1.0, np.pi / 3, -1.5, 3.0, 0.2]

FOUR_BAR = """
hfsim: 1
name: four_bar
ground: {points: {d: [1.0, 0.0]}}
bodies:
  crank: {type: rigid, mass: 1.0, inertia: 0.1, points: {a: [-0.15, 0.0], b: [0.15, 0.0]}}
  coupler: {type: rigid, mass: 1.0, inertia: 0.1, points: {b: [-0.5, 0.0], c: [0.5, 0.0]}}
  rocker: {type: rigid, mass: 1.0, inertia: 0.1, points: {c: [-0.4, 0.0], d: [0.4, 0.0]}}
joints:
  a: {type: revolute, between: [ground, crank.a]}
  b: {type: revolute, between: [crank.b, coupler.b]}
  c: {type: revolute, between: [coupler.c, rocker.c]}
  d: {type: revolute, between: [ground.d, rocker.d]}
initial: {}
solve: {duration: 1.0e-3}
output: {interval: 1.0e-3, channels: [a.angle, b.angle, c.angle, d.angle, a.angular_velocity, b.angular_velocity]}
"""


def starting(text, *changes):
    """Return what the channels of a deck show at the start."""
    run = simulate(parse_deck(text, "arm.yaml", changes), error_estimate=False)
    return [float(channel.values[0]) for channel in run.channels]


@pytest.mark.parametrize("settings", [(), ("solve.keep=[tree_joints]",), ("bodies.upper.inertia=2",)])
def test_channels_of_joints_show_what_is_stated(settings):
    assert starting(ARM, *settings) == pytest.approx(STATED, abs=1e-12)


@pytest.mark.parametrize("model", ["exact", "linear", "ancf"])
def test_in_space_too(model):
    """About axes that lean, on a beam, with full turns."""
    assert starting(SPATIAL, f"solve.model={model}") == pytest.approx(SPATIAL_STATED, abs=1e-12)


@pytest.mark.parametrize("angle", [200.0, -400.0])
def test_a_distance_has_no_full_turns(angle):
    found = starting(SPATIAL, f"initial.rod.angle={angle} deg")
    assert found[3:5] == pytest.approx([np.radians(angle), 0.1], abs=1e-12)


@pytest.mark.filterwarnings("error")
def test_next_to_no_angle_is_none():
    assert starting(SPATIAL, "initial.elbow.angle=1e-300")[2] == pytest.approx(0.0, abs=1e-12)


def test_bodies_are_where_the_chain_leads():
    scene = build(parse_deck(ARM, "arm.yaml"))
    upper, lower, slide = (scene.assembly.poses[name] for name in ("upper", "lower", "slide"))
    angles = np.cumsum([np.pi / 6, np.radians(400.0), np.radians(10.0)])
    assert [upper.angle, lower.angle, slide.angle] == pytest.approx(list(angles), abs=1e-12)
    way = np.exp(1j * angles[0]) + 0.8 * np.exp(1j * angles[1]) + 0.1 * np.exp(1j * (angles[1] + np.pi / 4))
    assert list(slide.origin) == pytest.approx([way.real, way.imag], abs=1e-12)


def test_what_is_not_stated_stays_open():
    """A rate where an angle is stated, an angle where a rate is, and what stands below in the chain."""
    alone = "initial={elbow: {angle: 270 deg}, lower: {angular_velocity: 2.0}, shoulder: {angular_velocity: 0}}"
    found = starting(ARM, alone)
    assert found[2:4] == pytest.approx([1.5 * np.pi, 2.0], abs=1e-12)
    rate = starting(ARM, "initial={shoulder: {angular_velocity: 3.0}, upper: {angle: 1.0}}")
    assert rate[:2] == pytest.approx([1.0, 3.0], abs=1e-12)


def test_an_angle_beyond_half_a_turn_where_nothing_says_how_its_bodies_stand():
    assert starting(FOUR_BAR, "initial={b: {angle: 300 deg}}")[1] == pytest.approx(np.radians(300.0), abs=1e-12)


@pytest.mark.parametrize("body", ["upper", "lower"])
def test_bodies_are_guesses_beside_full_turns_of_joints(body):
    angle = {"upper": -330.0, "lower": 70.0}[body]
    assert starting(ARM, f"initial.{body}.angle={angle} deg") == pytest.approx(STATED, abs=1e-12)


def test_free_motions_are_those_without_what_is_stated():
    told = {(one.body, one.kind) for one in build(parse_deck(ARM, "arm.yaml")).free_motions}
    assert told == {("upper", "turns"), ("lower", "turns"), ("slide", "slides")}


def test_loops_close_with_what_is_stated():
    """And with a second angle that fits, though the first one decides it."""
    crank = "a: {angle: 60 deg, angular_velocity: 3.0}"
    found = starting(FOUR_BAR, f"initial={{{crank}}}")
    assert [found[0], found[4]] == pytest.approx([np.pi / 3, 3.0], abs=1e-12)
    twice = f"initial={{{crank}, b: {{angle: {found[1]!r}, angular_velocity: {found[5]!r}}}}}"
    assert starting(FOUR_BAR, twice) == pytest.approx(found, abs=1e-8)
    other = starting(FOUR_BAR, f"initial={{{crank}, b: {{angle: {wrapped(found)!r}}}}}")
    assert other[0] == pytest.approx(np.pi / 3) and other[1] != pytest.approx(found[1], abs=0.1)


def wrapped(found):
    """Return the other angle between crank and coupler that closes the loop: mirrored about its diagonal."""
    hinge = 0.3 * np.exp(1j * found[0])
    lean = 2.0 * np.angle(1.0 - hinge) - 2.0 * found[0]
    return float(np.angle(np.exp(1j * (lean - found[1]))))


@pytest.mark.parametrize(
    ("initial", "at", "why"),
    [
        ("a: {angle: 60 deg}, b: {angle: -30 deg}", "joints.", "closed with what is stated of joints.*initial.a.angle, initial.b.angle"),
        ("a: {angular_velocity: 1}, b: {angular_velocity: 1}", "joints.", "contradict this one by .* m/s .*initial.b.angular_velocity"),
        ("a: {angle: 60 deg}, crank: {angle: 90 deg}", "initial.a.angle", "contradict this joint by 0.523599 rad"),
        ("a: {angular_velocity: 1}, crank: {angle: 1, angular_velocity: 3}", "initial.a.angular_velocity", "contradict this joint by 2 rad/s"),
        ("a: {distance: 1}", "initial.a.distance", "a revolute joint has no distance .it has angle and angular_velocity"),
        ("a: {angle: 1, exact: true}", "initial.a.exact", "has no exact"),
        ("a: [1]", "initial.a", "must be a map"),
        ("a: {angle: 1 m}", "initial.a.angle", "rad"),
        ("crank: {distance: 1}", "initial.crank.distance", "of joints, not of bodies"),
        ("crnk: {angle: 1}", "initial.crnk", "no body or joint 'crnk' .did you mean 'crank'"),
        ("fix: {angle: 1}", "initial.fix", "a fixed joint leaves no angle or distance free"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_where_it_stands(initial, at, why):
    text = FOUR_BAR.replace("initial: {}", f"initial: {{{initial}}}")
    text = text.replace("joints:", "joints:\n  fix: {type: fixed, between: [rocker, spare]}" if "fix" in initial else "joints:")
    text = text.replace("bodies:", "bodies:\n  spare: {type: rigid, mass: 1, inertia: 1}" if "fix" in initial else "bodies:")
    with pytest.raises(DeckError, match=why) as told:
        build(parse_deck(text, "arm.yaml"))
    (problem,) = told.value.problems
    assert problem.path.startswith(at)
    if at.startswith("initial"):
        assert problem.line == next(k for k, row in enumerate(text.splitlines(), 1) if "initial:" in row)


def test_beside_a_driver_of_the_same_joint():
    driver = "joints.pace={type: driver, between: [ground, crank.a], angle: 0.3}"
    with pytest.raises(DeckError, match=r"initial\.a\.angle: other joints and drivers contradict"):
        build(parse_deck(FOUR_BAR, "arm.yaml", [driver, "initial={a: {angle: 60 deg}}"]))


def test_of_a_line_without_sections_there_is_no_angle_about_its_axis():
    cable = ["bodies.upper.element=cable", "output.channels=[slide.x]"]
    with pytest.raises(DeckError, match=r"initial\.elbow\.angle: of a line without sections"):
        build(parse_deck(SPATIAL, "arm.yaml", cable))


def test_a_vector_is_no_rate_of_a_joint():
    with pytest.raises(DeckError, match=r"initial\.yaw\.angular_velocity: must be a number"):
        parse_deck(SPATIAL, "arm.yaml", ["initial.yaw.angular_velocity=[0, 0, 1]"])


def test_resolved_decks_and_parts_keep_it(monkeypatch):
    """A body that nothing connects to the arm makes parts of both."""
    monkeypatch.setattr("hfsim.scene.rules.PARTS_FROM", 1)
    pin = "  far: {type: rigid, mass: 1, inertia: 1}\njoints:\n  pin: {type: revolute, between: [ground, far]}"
    text = ARM.replace("joints:", pin).replace("initial:", "initial:\n  pin: {angle: 40 deg}")
    loaded = parse_deck(text, "arm.yaml")
    parts = build(loaded).parts
    assert [sorted(part.scene.deck.initial) for part in parts] == [["elbow", "rod", "shoulder"], ["pin"]]
    resolved = loaded.deck.resolved()
    assert resolved["initial"]["elbow"]["angle"] == pytest.approx(np.radians(400.0))
    assert parse_deck(yaml.safe_dump(resolved)).deck == loaded.deck
    assert starting(text) == pytest.approx(STATED, abs=1e-12)


def test_rates_come_on_top_of_where_it_rests():
    rates = "shoulder: {angular_velocity: 1.0}, elbow: {angular_velocity: 2.0}, rod: {distance_rate: -0.1}"
    coil = "springs.coil={type: two_point, between: [lower.out, slide], stiffness: 100, rest_length: 0.1}"
    found = starting(ARM, f"initial={{equilibrium: true, {rates}}}", coil)
    assert [abs(found[0]), *found[1:4:2], found[5]] == pytest.approx([np.pi / 2, 1.0, 2.0, -0.1], abs=1e-6)


CARTS = """hfsim: 1
bodies:
  "m{k=1..40}": {type: rigid, mass: 1.0, inertia: 0.01}
joints:
  "j{k=1..40}": {type: prismatic, between: [ground, "m{k}"], axis: [1, 0]}
initial:
  "j{k=1..40}": {distance: "${k}", distance_rate: "${sin(k)}"}
solve: {duration: 0.1}
"""


def test_starts_stated_by_joints_are_read_once_not_once_for_each(monkeypatch):
    """A thousand carts took 18 s to check, 2.5 s where their bodies are stated."""
    made = []
    monkeypatch.setattr(posed, "_driver", lambda *args, own=posed._driver: made.append(args) or own(*args))
    build(parse_deck(CARTS))
    assert len(made) <= 8 * 40


def test_rates_stated_along_a_long_chain_in_space_hold():
    """Sparse factors left 2e-5 rad/s, which was told as a contradiction."""
    points = "points: {a: [-0.5, 0, 0], b: [0.5, 0, 0]}"
    text = f"""hfsim: 1
bodies:
  "l{{k=1..90}}": {{type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.01], {points}}}
joints:
  j1: {{type: revolute, between: [ground, l1.a]}}
  "j{{k=2..90}}": {{type: revolute, between: ["l{{k-1}}.b", "l{{k}}.a"]}}
initial:
  "j{{k=1..90}}": {{angle: "${{5*k}} deg", angular_velocity: 0.1}}
solve: {{duration: 0.1}}
"""
    twists = build(parse_deck(text)).assembly.twists
    assert [twist.spin[2] for twist in twists.values()] == pytest.approx(0.1 * np.arange(1, 91))


@pytest.mark.parametrize(
    ("angle", "rate", "message", "key"),
    [(200.0, 2.0, "contradict this one by 1 rad/s", "angular_velocity"), (210.0, 1.0, "where the others close, 0.174533 rad are left", "angle")],
)
def test_contradictions_are_told_whole_and_with_the_entries_that_make_them(angle, rate, message, key):
    """Shared between both that contradict each other, rates were told by half; all entries of joints were listed."""
    law = f"{{type: constant_rate, start: {angle} deg, rate: {rate}}}"
    text = SPATIAL.replace("joints:", f"joints:\n  spin: {{type: driver, between: [ground, base], angle: {law}}}")
    with pytest.raises(DeckError) as refusal:
        build(parse_deck(text))
    (problem,) = refusal.value.problems
    assert message in problem.message
    assert problem.hint.partition(";")[0] == f"correct or leave out initial.yaw.{key}"


ROTOR = """hfsim: 1
name: rotor
gravity: [0.0, 0.0, -9.81]
bodies:
  hub: {type: rigid, mass: 5.0, inertia: [0.1, 0.1, 0.2], points: {"p{k=0..2}": ["${0.3 * cos(k * tau / 3)}", "${0.3 * sin(k * tau / 3)}", 0]}}
  blade{k=0..2}: {type: rigid, mass: 1.0, inertia: [0.01, 0.1, 0.1], points: {root: [-1.0, 0.0, 0.0]}}
joints:
  axle: {type: revolute, between: [ground, hub]}
  h{k=0..2}: {type: revolute, between: ["hub.p{k}", "blade{k}.root"], axis: AXIS ORIENTED}
initial: {"h{k=0..2}": {angle: 80 deg}}
solve: {duration: 1.0e-3}
output: {interval: 1.0e-3, channels: [axle.angle, hub.rotation_z, h0.angle, h1.angle, h2.angle]}
"""


@pytest.mark.parametrize("driven", [0.0, 0.4])
@pytest.mark.parametrize("oriented", ["", ', orientation: {axis: [0, 0, 1], angle: "${k * tau / 3}"}'])
@pytest.mark.parametrize("axis", ["[0, 0, 1]", '["${-sin(k * tau / 3)}", "${cos(k * tau / 3)}", 0]'])
def test_a_hub_of_which_nothing_is_stated_stands_unturned_or_as_it_is_driven(axis, oriented, driven):
    """Not so that it and its blades turn least together, half of 80 deg each."""
    text = ROTOR.replace("AXIS", axis).replace(" ORIENTED", oriented)
    drive = [f"joints.drive={{type: driver, between: [ground, hub], angle: {driven}}}"] if driven else []
    assert starting(text, *drive) == pytest.approx([driven, driven, *np.radians([80.0, 80.0, 80.0])], abs=1e-9)


@pytest.mark.parametrize("oriented", ["", ", orientation: {axis: [0, 0, 1], angle: 0.3}"])
def test_a_hinge_between_others_of_which_nothing_is_stated_starts_as_its_orientation_has_it(oriented):
    text = SPATIAL.replace("shoulder: {type: revolute, between: [base.top, upper.root], axis: [0, -1, 0]", f"shoulder: {{type: revolute, between: [base.top, upper.root], axis: [0, -1, 0]{oriented}")
    assert oriented in text
    found = starting(text, "initial={elbow: {angle: 2}, rod: {angle: 1}}")
    assert found[:4] == pytest.approx([0.0, 0.0, 2.0, 1.0], abs=1e-9)


SARRUS = """hfsim: 1
gravity: [0, 0, -9.81]
bodies:
  "a{k=1..2}": {type: rigid, mass: 1, inertia: [0.01, 0.02, 0.02], points: {i: [-0.2, 0, 0], o: [0.2, 0, 0]}}
  "b{k=1..2}": {type: rigid, mass: 1, inertia: [0.01, 0.02, 0.02], points: {i: [-0.2, 0, 0], o: [0.2, 0, 0]}}
  top: {type: rigid, mass: 3, inertia: [0.1, 0.1, 0.1], points: {a: [0.3, 0, 0], b: [0, 0.3, 0]}}
ground: {points: {a: [0.3, 0, 0], b: [0, 0.3, 0]}}
joints:
  A1: {type: revolute, between: [ground.a, a1.i], axis: [0, 1, 0]}
  A2: {type: revolute, between: [a1.o, a2.i], axis: [0, 1, 0]}
  A3: {type: revolute, between: [a2.o, top.a], axis: [0, 1, 0]}
  B1: {type: revolute, between: [ground.b, b1.i], axis: [1, 0, 0], orientation: {axis: [0, 0, 1], angle: 90 deg}}
  B2: {type: revolute, between: [b1.o, b2.i], axis: [0, -1, 0]}
  B3: {type: revolute, between: [b2.o, top.b], axis: [0, -1, 0], orientation: {axis: [0, 0, 1], angle: -90 deg}}
solve: {duration: 1.0e-3}
output: {interval: 1.0e-3, channels: [top.x, top.y, top.z, top.rotation_x, top.rotation_y, top.rotation_z, A3.angle, B3.angle]}
"""
STANDING = "joints.A3.orientation={axis: [0, 1, 0], angle: 0}"


@pytest.mark.parametrize("more", [(), (STANDING,)])
@pytest.mark.parametrize("fold", [pytest.param(10.0, marks=pytest.mark.slow), pytest.param(60.0, marks=pytest.mark.slow), 80.0])
def test_a_loop_in_space_closes_with_its_hinges_as_they_state_their_axes(fold, more):
    """The plate was taken to stand as B3 has it at angle zero, with the axis of A3 there, and did not close."""
    angles = {"A1": -fold, "A2": 2.0 * fold - 180.0, "B1": fold, "B2": 180.0 - 2.0 * fold}
    stated = [f"initial.{name}.angle={angle} deg" for name, angle in angles.items()]
    third = np.pi - np.radians(fold)
    height = 0.8 * np.sin(np.radians(fold))
    assert starting(SARRUS, *stated, *more) == pytest.approx([0.0, 0.0, height, 0.0, 0.0, 0.0, third, -third], abs=1e-9)


@pytest.mark.slow
def test_what_is_left_of_a_loop_in_space_is_told_with_its_hinges_as_they_state_their_axes():
    """The plate keeps level, and one of its legs stands a little beside what that takes."""
    apart = 0.4 * 4.0 * np.sin(np.radians(5.0)) * np.cos(np.radians(30.0))
    angles = {"A1": -60, "A2": -60, "B1": 50, "B2": 60}
    with pytest.raises(DeckError, match=f"where the others close, {apart:.6g} m are left"):
        build(parse_deck(SARRUS, overrides=[f"initial.{name}.angle={angle} deg" for name, angle in angles.items()]))


def test_what_is_left_of_a_loop_in_space_is_told_where_its_angles_have_a_value():
    """Of two legs in one plane one stands up, and the other one leads down and out: 5e-5 m were told."""
    over = "{type: revolute, axis: [0, 1, 0], orientation: {axis: [0, 0, 1], angle: 180 deg}"
    flat = [
        "bodies.top.points.b=[-0.3, 0, 0]", "ground.points.b=[-0.3, 0, 0]", f"joints.B1={over}, between: [ground.b, b1.i]}}",
        "joints.B2={type: revolute, axis: [0, 1, 0], between: [b1.o, b2.i]}", f"joints.B3={over}, between: [b2.o, top.b]}}",
    ]
    stated = [f"initial.{name}.angle=-60 deg" for name in ("A1", "A2", "B1", "B2")]
    apart = np.hypot(1.2, 0.6 * np.sqrt(3.0)) - 0.6
    with pytest.raises(DeckError, match=f"where the others close, {apart:.6g} m are left"):
        build(parse_deck(SARRUS, overrides=[*flat, *stated]))
