# ruff: noqa: E501
"""Starts in space: what is not stated of places, orientations and rates follows from the joints."""

import re

import numpy as np
import pytest
import yaml
from mechanisms import bennett

from hfsim.errors import DeckError
from hfsim.maths.rotations import rotation, rotation_vector
from hfsim.scene.assembly import angles_of
from hfsim.scene.build import build
from hfsim.scene.facing import Facings
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

BODIES = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
ground: {points: {o: [1.0, 2.0, 3.0]}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.2], points: {rim: [0.5, 0.0, 0.0]}}
  arm: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.2], points: {root: [-0.4, 0.0, 0.1], tip: [0.4, 0.0, 0.0]}}
  bob: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.2], points: {hook: [0.0, 0.0, 0.3]}}
joints:
"""
AXLE = "  axle: {type: revolute, between: [ground.o, hub]}\n"
ELBOW = "  elbow: {type: revolute, between: [hub.rim, arm.root], axis: [0.0, 1.0, 0.0]}\n"
WELD = "  weld: {type: fixed, between: [hub.rim, arm.root]}\n"
WRIST = "  wrist: {type: revolute, between: [arm.tip, bob.hook], axis: [1.0, 0.0, 0.0]}\n"
MOTOR = "  motor: {type: driver, between: [ground.o, hub], angle: {type: constant_rate, rate: 3.0, start: 0.4}}\n"
CRANK = "  crank: {type: driver, between: [hub.rim, arm.root], axis: [0.0, 1.0, 0.0], angle: {type: constant_rate, rate: 2.0, start: -0.3}}\n"


def scene(joints, initial="", solve="solve: {duration: 1.0}\n"):
    return build(parse_deck(f"{BODIES}{joints}{initial and f'initial: {{{initial}}}'}\n{solve}output: {{channels: [bob.x]}}\n", "start.yaml"))


def turns(built):
    return {name: pose.turned(np.eye(3)).T for name, pose in built.assembly.poses.items()}


def spins(built):
    return {name: twist.spin for name, twist in built.assembly.twists.items()}


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.8], [0.0, 0.0, -2.5]])
def test_unstated_orientations_follow_along_hinges(turn):
    """About each axis as little as can be from the axes of the ground."""
    text = f"hub: {{orientation: {{rotation_vector: {turn}}}}}"
    built = scene(AXLE + ELBOW + WRIST, text)
    R, hub = turns(built), rotation(np.array(turn))
    y = hub @ [0.0, 1.0, 0.0]
    assert R["hub"] == pytest.approx(hub, abs=1e-12)
    assert R["arm"] @ [0.0, 1.0, 0.0] == pytest.approx(y, abs=1e-12)
    angle = np.arccos(0.5 * (np.trace(R["arm"]) - 1.0))
    assert angle == pytest.approx(np.arccos(y[1]), abs=1e-9)
    assert R["bob"] @ [1.0, 0.0, 0.0] == pytest.approx(R["arm"] @ [1.0, 0.0, 0.0], abs=1e-12)
    assert not built.assembly.changes


def test_driven_hinges_give_orientations_and_rates():
    built = scene(AXLE + MOTOR + ELBOW + CRANK + "  hold: {type: fixed, between: [arm.tip, bob.hook]}\n")
    hub = rotation(np.array([0.0, 0.0, 0.4]))
    arm = hub @ rotation(np.array([0.0, -0.3, 0.0]))
    R, w = turns(built), spins(built)
    for name, expected in (("hub", hub), ("arm", arm), ("bob", arm)):
        assert R[name] == pytest.approx(expected, abs=1e-12), name
    spin = np.array([0.0, 0.0, 3.0]) + hub @ [0.0, 2.0, 0.0]
    assert w["arm"] == pytest.approx(spin, abs=1e-12) and w["bob"] == pytest.approx(spin, abs=1e-12)
    tip = arm @ [0.4, 0.0, 0.0]
    place = np.array([1.0, 2.0, 3.0]) + hub @ [0.5, 0.0, 0.0] - arm @ [-0.4, 0.0, 0.1] + tip
    assert built.assembly.poses["bob"].origin == pytest.approx(place - arm @ [0.0, 0.0, 0.3], abs=1e-12)


@pytest.mark.parametrize(
    ("joint", "expected"),
    [
        (WELD, [0.0, 0.0, 2.0]),
        (ELBOW, [0.0, 0.0, 2.0]),
        (ELBOW.replace("[0.0, 1.0, 0.0]", "[0.0, 0.0, 1.0]"), [0.0, 0.0, 0.0]),
        (ELBOW.replace("[0.0, 1.0, 0.0]", "[0.0, 1.0, 1.0]"), [0.0, -1.0, 1.0]),
        ("  ball: {type: spherical, between: [hub.rim, arm.root]}\n", [0.0, 0.0, 0.0]),
        ("  cardan: {type: universal, between: [hub.rim, arm.root], axes: [[1, 0, 0], [0, 1, 0]]}\n", [0.0, 0.0, 2.0]),
    ],
)
def test_one_stated_rate_goes_on_as_far_as_joints_hold_it(joint, expected):
    """The rest of a spin that is not stated stays zero, as in the plane: none is made up where none is needed."""
    built = scene(AXLE + joint + WRIST, "hub: {angular_velocity: [0.0, 0.0, 2.0]}")
    w = spins(built)
    assert w["hub"] == pytest.approx([0.0, 0.0, 2.0], abs=1e-12)
    assert w["arm"] == pytest.approx(expected, abs=1e-10)
    across = np.array([1.0, 0.0, 0.0])
    relative = w["bob"] - w["arm"]
    assert relative - across * (relative @ across) == pytest.approx(np.zeros(3), abs=1e-10)
    assert w["bob"] @ across == pytest.approx(0.0, abs=1e-10)
    velocity = np.cross(w["hub"], [0.5, 0.0, 0.0]) - np.cross(w["arm"], [-0.4, 0.0, 0.1])
    assert built.assembly.twists["arm"].velocity == pytest.approx(velocity, abs=1e-10)


def test_a_rate_that_a_hinge_does_not_allow_is_named_with_its_size():
    with pytest.raises(DeckError) as refusal:
        scene(AXLE, "hub: {angular_velocity: [0.0, 1.5, 2.0]}")
    (problem,) = refusal.value.problems
    assert (problem.path, problem.line) == ("joints.axle", 9)
    assert "1.5 rad/s" in problem.message


def test_a_position_that_contradicts_a_joint_is_named_with_its_size():
    with pytest.raises(DeckError) as refusal:
        scene(AXLE, "hub: {position: [1.0, 2.0, 4.0]}")
    (problem,) = refusal.value.problems
    assert problem.path == "joints.axle"
    assert "by 1 m" in problem.message


LOOP = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
ground: {{points: {{a: [0.0, 0.0, 0.0], d: [0.8, 0.3, 0.0]}}}}
bodies:
  crank: {{type: rigid, mass: 1.0, inertia: [0.01, 0.02, 0.02], points: {{r: [-0.1, 0, 0], t: [0.1, 0, 0]}}}}
  rod: {{type: rigid, mass: 1.0, inertia: [0.01, 0.1, 0.1], points: {{r: [-0.45, 0, 0], t: [0.45, 0, 0]}}}}
  rocker: {{type: rigid, mass: 1.0, inertia: [0.05, 0.05, 0.01], points: {{r: [0, 0, -0.25], t: [0, 0, 0.25]}}}}
joints:
  a: {{type: revolute, between: [ground.a, crank.r]}}
  b: {{type: spherical, between: [crank.t, rod.r]}}
  c: {{type: universal, between: [rod.t, rocker.t], axes: [[0, 1, 0], [0, 0, 1]]}}
  d: {{type: revolute, between: [ground.d, rocker.r], axis: [1, 0, 0]}}
initial:
  crank: {{angle: {angle}, angular_velocity: 3.0, exact: true}}
  {more}
solve: {{duration: 0.5}}
output: {{channels: [rod.x]}}
"""


def loop(angle=0.5, more=""):
    return build(parse_deck(LOOP.format(angle=angle, more=more), "loop.yaml"))


def test_a_spatial_loop_closes_and_its_other_ways_are_told():
    built = loop()
    link, place = built.assembly.linkage, built.assembly.place
    assert np.abs(link.gaps(place[None])).max() < 1e-9
    assert set(built.assembly.closed) == {"rod", "rocker"}
    (note,) = built.assembly.notes()
    assert "rod " in note and " deg about [" in note
    ways = [built.assembly.closed, *built.assembly.branches()]
    rockers = [np.array(way["rocker"]) for way in ways]
    assert len(ways) >= 2
    assert max(np.abs(one - rockers[0]).max() for one in rockers[1:]) > 0.1
    for turn in rockers:
        assert turn[1:] == pytest.approx(np.zeros(2), abs=1e-8)
    # the one stated rate gives all others
    rates = np.concatenate([np.concatenate(twist) for twist in built.assembly.twists.values()])
    assert np.abs(link.slopes_by_rates(place) @ (rates / link.units)).max() < 1e-9
    assert np.linalg.norm(spins(built)["rocker"]) > 0.05


def test_a_rough_orientation_takes_the_way_to_close_that_is_nearest():
    ways = [loop().assembly.closed, *loop().assembly.branches()]
    for way in ways:
        rough = [float(part) for part in np.add(way["rocker"], [0.05, 0.0, 0.0])]
        built = loop(more=f"rocker: {{orientation: {{rotation_vector: {rough}}}}}")
        (change,) = built.assembly.changes
        assert (change.body, change.quantity) == ("rocker", "orientation")
        assert change.stated == pytest.approx(rough, abs=1e-9)
        assert change.taken == pytest.approx(way["rocker"], abs=1e-7)
        assert "initial.rocker.orientation:" in str(change) and "0.05 rad off" in str(change)


def test_an_orientation_far_from_all_ways_to_close_is_refused_with_the_nearest():
    with pytest.raises(DeckError, match=r"rocker\.orientation \[") as refusal:
        loop(more="rocker: {orientation: {rotation_vector: [2.6, 0.0, 0.0]}}")
    assert "contradict this joint by" in refusal.value.problems[0].message


@pytest.mark.parametrize(("spin", "told"), [("0.21, -0.3", "[0.205, -0.3, 1.5]"), ("0.0, 0.2", "[0.1, -0.05, 1.5]")])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_rounding_in_what_joints_leave_of_a_stated_velocity_is_no_slope(spin, told, size):
    """It was taken for slopes of full rank: the nearest velocities were 1e12 to 1e15 m/s, and guesses refused."""
    rim, lug, tip, foot = (f"[{x * size}, {y * size}, 0.0]" for x, y in ((0.3, 0.0), (0.8, -0.01), (1.0, 0.0), (-0.05, 0.02)))
    deck = parse_deck(f"""hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies:
  u: {{type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {{o: {rim}}}}}
  w: {{type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {{q: {lug}, tip: {tip}}}}}
  d: {{type: rigid, mass: 0.3, inertia: [0.001, 0.001, 0.0015], points: {{i: {foot}}}}}
joints: {{j: {{type: revolute, between: [u.o, w.q]}}, f: {{type: fixed, between: [w.tip, d.i]}}}}
initial:
  u: {{velocity: [{0.3 * size}, {0.2 * size}, {0.1 * size}], angular_velocity: [0.2, -0.3, 1.5]}}
  w: {{angular_velocity: [{spin}, -2.0]}}
solve: {{duration: 0.4}}
""")
    if spin.endswith("-0.3"):
        one, other = build(deck).assembly.changes
        assert f"allow {told} rad/s" in str(one) and (one.body, other.body) == ("u", "w")
    else:
        with pytest.raises(DeckError, match=re.escape(f"u.angular_velocity {told} rad/s, w.angular_velocity")):
            build(deck)


def test_a_loop_that_cannot_close_says_so():
    with pytest.raises(DeckError, match="cannot be closed"):
        build(parse_deck(LOOP.replace("0.8, 0.3, 0.0", "1.8, 0.3, 0.0").format(angle=0.5, more="")))


CARDAN = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {p: [1.0, 0, 0]}}
bodies:
  a: {type: rigid, mass: 1, inertia: [0.1, 0.2, 0.2], points: {l: [-0.5, 0, 0], r: [0.5, 0, 0]}}
  b: {type: rigid, mass: 1, inertia: [0.3, 0.2, 0.2], points: {l: [-0.5, 0, 0]}}
joints:
  ra: {type: revolute, between: [ground, a.l], axis: [1, 0, 0]}
  u: {type: universal, between: [a.r, b.l], axes: [[0, 1, 0], [0, 0, 1]]}
  rb: {type: cylindrical, between: [ground.p, b], axis: ["${cos(0.5)}", "${sin(0.5)}", 0]}
"""
CARDAN_CRANK = "  d: {type: driver, between: [ground, a.l], axis: [1, 0, 0], angle: {type: constant_rate, rate: 4}}\n"
BENT = "orientation: {axis: [0, 0, 1], angle: 0.5}"


def cardan(crank, initial):
    more = f"initial: {{{initial}}}\n" if initial else ""
    return build(parse_deck(f"{CARDAN}{crank}{more}solve: {{duration: 1.0}}\n", "cardan.yaml"))


@pytest.mark.parametrize("crank", [CARDAN_CRANK, ""])
@pytest.mark.parametrize(
    "initial",
    [
        f"b: {{{BENT}}}",
        f"b: {{{BENT}, position: [1.43879128, 0.23971277, 0]}}",
        f"a: {{angle: 0}}, b: {{{BENT}, position: [1.43879128, 0.23971277, 0]}}",
    ],
)
def test_a_cardan_shaft_closes_with_the_axes_of_its_hinges_where_they_are_stated(crank, initial):
    """The universal joint does not hand on its bend to the shaft that a hinge holds level."""
    speed = 4.0 if crank else 0.0
    built = cardan(crank, initial)
    axis = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    R, w = turns(built), spins(built)
    assert R["a"] @ [1.0, 0.0, 0.0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert R["b"] == pytest.approx(rotation(np.array([0.0, 0.0, 0.5])), abs=1e-9)
    assert built.assembly.poses["b"].origin == pytest.approx([1.0, 0.0, 0.0] + 0.5 * axis, abs=1e-8)
    assert w["b"] == pytest.approx(speed / np.cos(0.5) * axis, abs=1e-8)
    assert all(built.assembly.branches())


def test_a_universal_joint_that_states_an_orientation_hands_it_on_before_hinges_do():
    text = CARDAN.replace("axes: [[0,", f"{BENT}, axes: [[0,")
    built = build(parse_deck(f"{text}{CARDAN_CRANK}solve: {{duration: 1.0}}\n", "cardan.yaml"))
    assert turns(built)["b"] == pytest.approx(rotation(np.array([0.0, 0.0, 0.5])), abs=1e-9)


@pytest.mark.parametrize("crank", [CARDAN_CRANK, ""])
def test_a_loop_that_does_not_close_says_which_orientations_it_does_not_know(crank):
    with pytest.raises(DeckError, match=r"cannot be closed.* hinges in a, b as they are") as refusal:
        cardan(crank, "")
    assert "state orientations" in refusal.value.problems[0].hint
    ball = CARDAN.replace("joints:", "  ball: {type: rigid, mass: 1, inertia: [0.1, 0.1, 0.1]}\njoints:")
    with pytest.raises(DeckError, match="hinges in a, b as they are"):  # not the ball, which has none
        build(parse_deck(f"{ball}{crank}solve: {{duration: 1.0}}\n", "cardan.yaml"))


def test_rounding_of_a_closed_joint_hides_no_contradicted_angle():
    axis = "axis: [0.2, 0.5, 1.0]"
    joints = AXLE.replace("hub}", f"hub.rim, {axis}}}") + MOTOR.replace("hub,", f"hub.rim, {axis},").replace("0.4", "0.0")
    with pytest.raises(DeckError, match=r"contradict this joint by 1\.0\d+ rad") as refusal:
        scene(joints, "hub: {orientation: {rotation_vector: [0.3, 0.2, 1.0]}}")
    assert refusal.value.problems[0].path == "joints.motor"


def test_free_motions_are_told_by_joint_and_axis():
    told = [str(motion) for motion in scene(AXLE + ELBOW + "  ball: {type: spherical, between: [arm.tip, bob.hook]}\n").free_motions]
    assert told == ["hub: turns about axle, axis [0, 0, 1]", "arm: turns about elbow, axis [0, 1, 0]", "bob: turns about ball, 3 axes"]
    more = "  tube: {type: cylindrical, between: [ground.o, hub.rim], axis: [0, 0, 1]}\n  rail: {type: prismatic, between: [hub, arm], axis: [0, 1, 0]}\n  hold: {type: fixed, between: [arm, bob]}\n"
    told = [str(motion) for motion in scene(more).free_motions]
    assert told == ["hub: turns and slides: tube, along [0, 0, 1], with bob", "arm: slides along [0, 1, 0]"]


def test_what_floats_stands_level_where_nothing_else_is_stated():
    """A satellite with booms: nothing is sought, so nothing is told of how joints close."""
    turned = ", orientation: {axis: [0.0, 0.0, 1.0], angle: 90 deg}}"
    built = scene(WELD.replace("}", turned) + WRIST, "hub: {angular_velocity: [0.1, 0.0, 0.3]}")
    assert not built.assembly.notes()
    R = turns(built)
    assert R["hub"] == pytest.approx(np.eye(3), abs=0.0)
    assert R["arm"] == pytest.approx(rotation(np.array([0.0, 0.0, 0.5 * np.pi])), abs=1e-15)


def test_turns_that_are_rounding_are_told_as_none():
    noisy = {"crank": (0.2, 1e-29, -1e-28), "block": (0.0, 1e-29, 3e-28), "rod": -2e-17}
    assert angles_of(noisy) == "crank 11.46 deg about [1, 0, 0], block 0 deg, rod 0 deg"


def test_welds_that_stated_orientations_contradict_are_all_named_with_what_they_would_have_to_be():
    weld = "  {0}: {{type: fixed, between: [{1}], {2}}}\n"
    arm, bob = "{axis: [0, 1, 0], angle: -90 deg}", "{axis: [1, 0, 0], angle: 120 deg}"
    initial = f"arm: {{orientation: {arm}}}, bob: {{orientation: {bob}}}, hub: {{angle: 0.0}}"
    ends = ("foot", "ground, arm"), ("grip", "arm.tip, bob"), ("base", "ground, hub")
    with pytest.raises(DeckError) as refusal:
        scene("".join(weld.format(*end, "angle: 0.0") for end in ends), initial)
    problems = refusal.value.problems
    assert [problem.path for problem in problems] == ["joints.foot", "joints.grip"]
    assert "contradict this joint by 1.5708 rad" in problems[0].message
    found = [re.search(r"'orientation: (.*?)'", problem.hint).group(1) for problem in problems]
    joints = "".join(weld.format(*end, f"orientation: {R}") for end, R in zip(ends, found, strict=False))
    R = turns(scene(joints, initial))
    assert R["arm"] == pytest.approx(rotation(np.array([0.0, -np.pi / 2, 0.0])), abs=1e-8)
    assert R["bob"] == pytest.approx(rotation(np.array([2 * np.pi / 3, 0.0, 0.0])), abs=1e-8)


BASE = "  base: {type: fixed, between: [ground.o, hub], orientation: {axis: [0.0, 1.0, 0.0], angle: 20 deg}}\n"


@pytest.mark.parametrize("first", [BASE, AXLE + MOTOR], ids=["fixed", "driven"])
@pytest.mark.parametrize("angle", [180.0, 170.0, 100.0])
def test_a_stated_orientation_that_a_weld_contradicts_through_another_body_is_refused(first, angle):
    """At half a turn its equations hold: axes that point in opposite ways are at right angles to others too."""
    stated = f"arm: {{orientation: {{axis: [0.0, 0.0, 1.0], angle: {angle} deg}}}}"
    with pytest.raises(DeckError) as refusal:
        scene(first + WELD + WRIST, stated)
    (problem,) = refusal.value.problems
    assert "contradict this joint by" in problem.message
    assert first != BASE or problem.path == "joints.weld"
    scene(first + WELD + WRIST)


def test_unstated_orientations_follow_along_welds():
    """From either end, also where both of its frames are turned."""
    weld = "  weld: {type: fixed, between: [arm.root, hub.rim], orientation: {axis: [1.0, 2.0, 0.5], angle: 50 deg}}\n"
    R = turns(scene(BASE + weld + WRIST))
    base, held = (rotation(np.radians(a) * np.array(v) / np.linalg.norm(v)) for a, v in ((20.0, [0, 1, 0]), (50.0, [1, 2, 0.5])))
    assert R["hub"] == pytest.approx(base, abs=1e-12)
    assert R["arm"] @ held == pytest.approx(R["hub"], abs=1e-12)


@pytest.mark.parametrize("ball", ["spherical", "universal"])
def test_what_is_welded_behind_a_joint_that_leaves_turns_free_stands_as_the_welds_hold_it(ball):
    """The first body is level, whatever the welds; started level, theirs would be half a turn off."""
    axis = {"axis": [1.0, 2.0, 0.5], "angle": "150 deg"}
    text = f"""hfsim: 1
gravity: [0, 0, 0]
bodies:
  b0: {{type: rigid, mass: 1, inertia: [1, 1, 1], points: {{p: [1, 0, 0]}}}}
  b1: {{type: rigid, mass: 1, inertia: [1, 1, 1], points: {{p: [1, 0, 0]}}}}
  b2: {{type: rigid, mass: 1, inertia: [1, 1, 1]}}
joints:
  ball: {{type: {ball}, between: [ground, b0]}}
  w1: {{type: fixed, between: [b0.p, b1], angle: 180 deg}}
  w2: {{type: fixed, between: [b2, b1.p], orientation: {{axis: {axis["axis"]}, angle: {axis["angle"]}}}}}
solve: {{duration: 0.01}}
"""
    R = turns(build(parse_deck(text)))
    held = rotation(np.radians(150.0) * np.array(axis["axis"]) / np.linalg.norm(axis["axis"]))
    assert R["b0"] == pytest.approx(np.eye(3), abs=1e-12)
    assert R["b1"] == pytest.approx(np.diag([-1.0, -1.0, 1.0]), abs=1e-12)
    assert R["b2"] @ held == pytest.approx(R["b1"], abs=1e-12)


def test_a_search_that_ends_a_full_turn_off_leaves_rates_to_be_told():
    text = """hfsim: 1
gravity: [0, 0, 0]
bodies:
  b0: {type: rigid, mass: 1, inertia: [1, 1, 1]}
  b1: {type: rigid, mass: 1, inertia: [1, 1, 1]}
  b2: {type: rigid, mass: 1, inertia: [1, 1, 1]}
joints:
  u: {type: universal, between: [ground, b0], orientation: {rotation_vector: [0.2, 0.4, 0.2]}}
  s: {type: spherical, between: [b0, b1]}
  f: {type: fixed, between: [b1, b2], orientation: {rotation_vector: [2.0, 0.3, 0.7]}}
solve: {duration: 0.01}
"""
    assert all(np.abs(spin).max() < 1e-12 for spin in spins(build(parse_deck(text))).values())


def test_a_loop_closes_from_turns_that_its_slides_and_welds_allow():
    """Spread without regard to them, none of the starts had the slide the right way round.

    Its bodies have five freedoms, so that it closes with these numbers and with no others.
    """
    text = """hfsim: 1
ground: {points: {c1: [0.41524968662597034, 1.3530161001339223, 0.6218959994397444]}}
bodies:
  b1: {type: rigid, mass: 1, inertia: [1, 1, 1], points: {a1: [-0.04343253815402225, 0.5922759349718554, 0.4041639371422556], a2: [0.7430212974830549, -0.4339818141665379, -0.4569915629710346], c4: [0.6172911073022829, -0.9285811995989208, 0.1858072500689283]}}
  b2: {type: rigid, mass: 1, inertia: [1, 1, 1], points: {c2: [2.384951163759628, 0.024917345357145182, 0.5132367602093568], a3: [-0.24401090741276127, -0.28170492872996133, 0.9136161013365447]}}
  b3: {type: rigid, mass: 1, inertia: [1, 1, 1], points: {c3: [-0.5155875801979232, -0.7671939734914124, -2.6820807058046663], a4: [0.5008516373162549, 0.478400603606643, -0.2563002002469633]}}
joints:
  j1: {type: fixed, between: [b1.a1, ground.c1], orientation: {rotation_vector: [0.7872395873295633, -1.2874329933118025, 0.6793613650873586]}}
  j2: {type: revolute, between: [b1.a2, b2.c2], axis: [2.555921717240161, -0.3870872219959422, 0.3001704587592878]}
  j3: {type: prismatic, between: [b2.a3, b3.c3], axis: [-0.02150280438129188, 0.2650441808022512, -0.33137745996055884], orientation: {axis: [-1.1816401102704066, 2.0322732587392647, -1.3494716479092697], angle: 91.2277117039791 deg}}
  j4: {type: spherical, between: [b3.a4, b1.c4]}
solve: {duration: 0.01}
"""
    built = build(parse_deck(text))
    x = built.system.absolute(built.q[None])
    assert np.abs(built.system.residual(np.zeros(1), x)).max() < 1e-9


TILTED = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies:
  a: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}
  b: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.3]}
joints:
  w: {type: fixed, between: [ground, a], orientation: {axis: [1, 0, 0], angle: 0.5}}
  h: {type: revolute, between: [a, b]}
  led: {between: [ground, %s], %s}
initial: {%s}
solve: {duration: 0.5, tolerance: 1.0e-10}
output: {interval: 0.25, channels: [h.angle, %s]}
"""


@pytest.mark.parametrize(
    ("body", "led", "channels"),
    [
        ("a", "type: servo, angle: 1.0, stiffness: 1.0", "led.angle, led.moment_x, led.moment_y, led.moment_z"),
        ("b", "type: servo, angle: 1.0, stiffness: 1.0", "led.angle, led.moment_x, led.moment_y, led.moment_z"),
        ("b", "type: motor, torque: 0.1", "led.angle, led.angular_velocity"),
        ("b", "type: driver, angle: {type: constant_rate, rate: 3.0}", "led.angle, led.moment_x, led.moment_y"),
    ],
)
def test_axes_in_second_bodies_are_those_of_the_start_not_of_a_guess(body, led, channels):
    """What acts across the axis is that of an axis which is not tilted at the start."""
    guesses = ("", *(f"{k}: {{orientation: {{axis: [1, 0, 0], angle: {x}}}}}" for k, x in (("a", 0.5), ("a", 0.1))))
    both = [f"{one}, {one.replace('a:', 'b:', 1)}" if one else "" for one in guesses]
    runs = [simulate(parse_deck(TILTED % (body, led, one, channels)), error_estimate=False) for one in both]
    assert [run.status for run in runs] == ["done"] * 3
    assert not runs[1].statistics["warnings"] and "guess" in runs[2].statistics["warnings"][0]
    for exact, *others in zip(*(run.channels for run in runs), strict=True):
        for one in others:
            assert one.values == pytest.approx(exact.values, abs=1e-8), one.name


LED_THROUGH = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies:
  a: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {e: [1, 0, 0]}}
  b: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}
joints:
  g: {type: %s, between: [ground, a]}
  h: {type: %s, between: [a.e, b]}
  d: {type: driver, between: [ground, b], axis: [0.6, -0.2, 0.5], angle: {type: constant_rate, start: -0.7, rate: 2.0}%s}
initial: {%s}
solve: {duration: 0.02}
output: {interval: 0.02, channels: [d.angle]}
"""
ROUGH = "a: {orientation: {rotation_vector: [0.4, 0.5, -0.3]}}"


@pytest.mark.parametrize("kind", ["revolute", "cylindrical"])
def test_a_hinge_that_states_its_orientation_has_its_axis_by_that(kind):
    """Not where a body is said to start, which is a guess: nothing was said, and the axis in it was tilted."""
    joint = ELBOW.replace("revolute", kind).replace("}", ", orientation: {rotation_vector: [0.1, 0.2, 0.5]}}")
    joints, guess = AXLE.replace("revolute", "fixed") + joint, "arm: {orientation: {rotation_vector: [0.3, 0.1, 0.4]}EXACT}"
    built = scene(joints, guess.replace("EXACT", ""))
    own = rotation(np.array([0.1, 0.2, 0.5])).T @ [0.0, 1.0, 0.0]
    R = turns(built)
    assert R["hub"] @ [0.0, 1.0, 0.0] == pytest.approx(R["arm"] @ own, abs=1e-12)
    assert any("initial.arm.orientation" in one and "taken as a guess" in one for one in built.warnings)
    with pytest.raises(DeckError, match="closed with what is exact"):
        scene(joints, guess.replace("EXACT", ", exact: true"))


@pytest.mark.parametrize("off", [1e-6, 1e-2])
def test_a_loop_of_hinges_that_state_their_orientations_closes_from_rough_ones_of_its_bodies(off):
    """What was left by axes that had been tilted with the bodies could not be closed."""
    deck = yaml.safe_load(bennett())
    faced = {"ground": np.eye(3)}
    for name, entry in deck["initial"].items():
        x, y = map(np.array, entry["orientation"].values())
        faced[name] = np.stack([x, y, np.cross(x, y)], axis=1)
    for joint in deck["joints"].values():
        A, B = (faced[end.partition(".")[0]] for end in joint["between"])
        joint["orientation"] = {"rotation_vector": rotation_vector(A.T @ B).tolist()}
    for k, name in enumerate(deck["initial"]):
        R = rotation(off * np.sin([1.0 + k, 2.0 + k, 3.0 - k])) @ faced[name]
        deck["initial"][name] = {"orientation": {"x": R[:, 0].tolist(), "y": R[:, 1].tolist()}}
    built = build(parse_deck(yaml.safe_dump(deck, sort_keys=False)))
    assert 0.1 * off < max(change.rough for change in built.assembly.changes) < 10.0 * off
    found = {"ground": np.eye(3), **turns(built)}
    for joint in built.deck.joints.values():
        A, B = (found[end.partition(".")[0]] for end in joint.between)
        axis = np.array(joint.axis)
        assert B @ joint.orientation.matrix.T @ axis == pytest.approx(A @ axis, abs=1e-12)


@pytest.mark.parametrize("zero", ["", ", orientation: {rotation_vector: [0.9, 0.2, 0.4]}"])
@pytest.mark.parametrize(
    ("first", "second", "initial"),
    [
        ("universal", "universal", ""),
        ("universal", "universal", "b: {orientation: {rotation_vector: [0.4, 0.5, -0.3]}}"),
        ("revolute, axis: [0.3, 0.4, 0.9]", "revolute, axis: [0.8, 0.1, 0.5]", ROUGH),
        ("spherical", "revolute, axis: [0.8, 0.1, 0.5]", ROUGH),
    ],
)
def test_a_driver_that_decides_where_bodies_start_has_its_axis_there(zero, first, second, initial):
    """Its angle there is that of swing and twist, by the quaternion of B in A."""
    deck = LED_THROUGH % (first, second, zero, initial)
    built, own = build(parse_deck(deck)), np.array([0.6, -0.2, 0.5]) / np.sqrt(0.65)
    R = turns(built)["b"]
    from_zero = R @ rotation(np.array([0.9, 0.2, 0.4])).T if zero else R
    turned = np.array([from_zero[2, 1] - from_zero[1, 2], from_zero[0, 2] - from_zero[2, 0], from_zero[1, 0] - from_zero[0, 1]])
    assert 2.0 * np.arctan2(turned @ own, np.trace(from_zero) + 1.0) == pytest.approx(-0.7, abs=1e-9)
    assert built.facings.of(built.deck.joints["d"])[0].T @ own == pytest.approx(R.T @ own, abs=1e-9)
    run = simulate(parse_deck(deck), error_estimate=False)
    assert run["d.angle"] == pytest.approx([-0.7, -0.66], abs=1e-9)


LINE = """hfsim: 1
gravity: [0, 0, 0]
materials: {steel: {density: 7800, youngs_modulus: 2.0e11, poisson_ratio: 0.3}}
sections: {round: {shape: circle, diameter: 1 cm}}
ground: {points: {c: [0, 0, 0.3]}}
bodies:
  rod: {type: beam, material: steel, section: round, length: 1.0, elements: 2, element: cable}
  b: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}
  c: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}
joints:
  s: {type: spherical, between: [ground, rod.root]}
  f: {type: prismatic, between: [ground.c, c], axis: [1, 0, 0]}
  g: {type: prismatic, between: [c, b], axis: [0, 1, 0]}
  e: {type: spherical, between: [b, rod.tip]}
  v: {between: [ground, rod.root], %s}
initial: {rod: {angle: 0.1}}
solve: {duration: 0.01}
output: {channels: [v.angle, b.x, b.y]}
"""


def test_a_line_that_is_tilted_at_the_start_has_the_angle_of_its_tangent():
    run = simulate(parse_deck(LINE % "type: servo, angle: 0.5, stiffness: 1.0"), error_estimate=False)
    assert run["v.angle"][0] == pytest.approx(np.arctan2(run["b.y"][0], run["b.x"][0]), abs=1e-9)
    assert run["b.x"][0] ** 2 + run["b.y"][0] ** 2 == pytest.approx(0.91, abs=1e-9)
    run = simulate(parse_deck(LINE % "type: driver, angle: 0.2"), error_estimate=False)
    assert run["v.angle"][0] == pytest.approx(0.2, abs=1e-9)


def test_no_hinge_is_guessed_between_bodies_that_joints_and_drivers_hold():
    """Its axis in B is where the deck has the bodies, and none that is tried because it closes a loop."""
    joints = (
        "  seat: {type: fixed, between: [ground, hub], orientation: {axis: [1.0, 0.0, 0.0], angle: 180 deg}}\n"
        "  axle: {type: revolute, between: [ground, bob]}\n"
        "  pin: {type: revolute, between: [hub, bob]}\n"
    )
    drive = "  drive: {type: driver, between: [ground, bob], angle: 0.3}\n"
    solve = "solve: {duration: 1.0}\n"
    decks = (parse_deck(f"{BODIES}{some}{solve}", "pin.yaml").deck for some in (joints, joints + drive))
    guessed, held = map(Facings, decks)
    assert guessed.by_own() is not guessed
    assert held.by_own() is held
