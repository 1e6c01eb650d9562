"""What comes to rest far from its start, in units of its inertia; and what goes on for ever."""

import numpy as np
import pytest

import hfsim
from hfsim.scene.loading import parse_deck

ARM = """hfsim: 1
gravity: [0, -9.81]
materials: {{steel: {{density: 7800, youngs_modulus: 210 GPa}}}}
sections: {{s: {{shape: rectangle, width: 2 cm, height: 8 mm}}}}
bodies:
  link: {link}
  ball: {{type: rigid, mass: 2.0, inertia: {inertia}}}
joints:
  hook: {{type: revolute, between: [ground, link.{root}]}}
  weld: {{type: fixed, between: [link.{tip}, ball]}}
initial: {{link: {{angle: {angle} deg}}}}
solve: {{duration: 1}}
output: {{channels: [ball.x, ball.y]}}
"""
RIGID = "{type: rigid, mass: 1.0, inertia: 0.1, points: {in: [-0.5, 0], out: [0.5, 0]}}"
BEAM = "{type: beam, material: steel, section: s, length: 1.0, elements: 2}"


@pytest.mark.parametrize("inertia", [1e-12, 8e-5, 1e3])
@pytest.mark.parametrize("angle", [-30.0, 0.0, 89.0])
def test_an_arm_with_a_compact_ball_hangs_down(inertia, angle):
    text = ARM.format(link=RIGID, root="in", tip="out", inertia=inertia, angle=angle)
    run = hfsim.static(parse_deck(text))
    assert [run.final["ball.x"], run.final["ball.y"]] == pytest.approx([0.0, -1.0], abs=1e-9)
    assert run.statistics["stable"] and run.statistics["newton_iterations"] < 60


def test_a_stiff_beam_with_a_compact_ball_hangs_down_in_few_steps():
    """Stretched by half of its weight and by the ball."""
    run = hfsim.static(parse_deck(ARM.format(link=BEAM, root="root", tip="tip", inertia=8e-5, angle=0.0)))
    stretch = 9.81 * (2.0 + 0.5 * 7800 * 1.6e-4) / (210e9 * 1.6e-4)
    assert run.final["ball.y"] == pytest.approx(-1.0 - stretch, abs=1e-10)
    assert run.statistics["newton_iterations"] < 60


CORD = """hfsim: 1
gravity: [0, 0, -9.81]
bodies: {{ball: {{type: rigid, mass: 2.0, inertia: [{inertia}, {inertia}, {inertia}]}}}}
springs: {{cord: {{type: two_point, between: [ground, ball], stiffness: {stiffness}, rest_length: {size}}}}}
initial: {{ball: {{position: [{aside}, 0, -{size}]}}}}
solve: {{duration: 1}}
output: {{channels: [ball.z]}}
"""


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("far", [2.0, 1e3])
def test_a_ball_on_a_soft_cord_rests_where_that_bears_it(size, far):
    values = {"inertia": 4e-5 * size**2, "stiffness": 2.0 * 9.81 / (far * size), "aside": 0.3 * size}
    run = hfsim.static(parse_deck(CORD.format(size=size, **values)))
    assert run.final["ball.z"] == pytest.approx(-size * (1.0 + far), rel=1e-9) and run.statistics["stable"]


RAIL = """hfsim: 1
gravity: [0, -9.81]
bodies: {{cart: {{type: rigid, mass: 2.0, inertia: {inertia}}}}}
joints:
  rail: {{type: prismatic, between: [ground, cart], axis: [0, 1], stops: {{lower: -{low}, stiffness: 1.0e4}}}}
solve: {{duration: 1}}
output: {{channels: [cart.y]}}
"""


@pytest.mark.parametrize("inertia", [1e-12, 8e-5])
@pytest.mark.parametrize("low", [1.0, 1e3])
def test_a_cart_falls_as_far_as_its_stop(inertia, low):
    """Whose stiffness sets in over a millimetre, which adds half of that."""
    run = hfsim.static(parse_deck(RAIL.format(inertia=inertia, low=low)))
    assert run.final["cart.y"] == pytest.approx(-low - 2.0 * 9.81 / 1e4 - 5e-4, abs=1e-8)


SHAFT = """hfsim: 1
gravity: [0, -9.81]
bodies:
  shaft: {{type: rigid, mass: 1.0, inertia: 0.1}}
  bob: {{type: rigid, mass: 1.0, inertia: 1.0e-6, points: {{eye: [-1, 0]}}}}
joints:
  bearing: {{type: revolute, between: [ground, shaft]}}
  hook: {{type: revolute, between: [ground, bob.eye]}}
springs: {{coil: {{type: rotational, between: [ground, shaft], stiffness: {stiffness}}}}}
loads: {{drive: {{type: moment, at: shaft, moment: 2.0}}}}
solve: {{duration: 1}}
output: {{channels: [shaft.angle, bob.y]}}
"""


def test_a_coil_is_wound_up_by_many_turns_beside_what_swings():
    run = hfsim.static(parse_deck(SHAFT.format(stiffness=0.02)))
    assert [run.final["shaft.angle"], run.final["bob.y"]] == pytest.approx([100.0, -1.0], rel=1e-9)


FALLING = """hfsim: 1
gravity: [0, -9.81]
materials: {m: {density: 7800, youngs_modulus: 210 GPa}}
sections: {s: {shape: rectangle, width: 2 cm, height: 8 mm}}
bodies:
  ball: {type: rigid, mass: 1.0, inertia: 1.0e-9}
  beam: {type: beam, material: m, section: s, length: 1.0, elements: 2}
solve: {duration: 1}
"""


@pytest.mark.parametrize(
    ("text", "what"), [(SHAFT.replace("springs", "# ").format(stiffness=0), "shaft"), (FALLING, "ball")]
)
def test_what_nothing_holds_is_given_up_in_reasonable_time(text, what):
    run = hfsim.static(parse_deck(text), check=False)
    assert f"nothing holds what the loads push: {what}" in run.reason
    assert run.failure["evidence"]["search"] == "it goes on and on" and run.statistics["steps"] < 400


def test_the_size_of_a_scene_has_no_unit():
    """A ball that is all of a scene is the size of that: it is held against no metre."""
    steps = {
        size: hfsim.static(parse_deck(RAIL.format(inertia=8e-5 * size**2, low=size))).statistics["steps"]
        for size in (1e-2, 1e2)
    }
    assert np.ptp(list(steps.values())) <= 12


def box(angle, height):
    """A box of 0.4 m by 0.2 m above a floor that its corners touch."""
    corners = {"a": [-0.2, -0.1], "b": [0.2, -0.1], "c": [0.2, 0.1], "d": [-0.2, 0.1]}
    touches = {"type": "contact", "stiffness": 1.0e5}
    return {
        "hfsim": 1,
        "gravity": [0.0, -9.81],
        "bodies": {"box": {"type": "rigid", "mass": 2.0, "inertia": 0.03, "points": corners}},
        "springs": {name: touches | {"between": ["ground", f"box.{name}"]} for name in corners},
        "initial": {"box": {"position": [0.0, height], "angle": angle}},
        "solve": {"duration": 1.0},
        "output": {"channels": ["box.y", "box.angle", "a.force", "b.force"]},
    }


@pytest.mark.parametrize("height", [0.13, 0.17, 0.2, 0.3])
@pytest.mark.parametrize("angle", [0.05, 0.1])
def test_a_box_falls_onto_the_floor_and_not_through_it(angle, height):
    run = hfsim.static(box(angle, height))
    assert 0.099 < run.final["box.y"] < 0.1 and run.final["box.angle"] == pytest.approx(0.0, abs=1e-9)
    assert [run.final["a.force"], run.final["b.force"]] == pytest.approx([9.81, 9.81], rel=1e-9)
    assert run.statistics["newton_iterations"] < 80


def _chain(count, joint, elements=64):
    """Return the deck of a chain of beams, of 6.4 m, that its weight bends far down."""
    ends = ["ground", *(f"b{k}.tip" for k in range(count - 1))]
    pairs = [{"between": [end, f"b{k}.root"]} for k, end in enumerate(ends)]
    kinds = ["fixed", *[joint] * (count - 1)]
    joints = [{"type": kind} | pair for kind, pair in zip(kinds, pairs, strict=True)]
    spring = {"type": "rotational", "stiffness": 1600.0}
    beam = {"type": "beam", "material": "steel", "section": "s"}
    beam |= {"length": 6.4 / count, "elements": elements // count}
    return {
        "hfsim": 1,
        "gravity": [0.0, -9.81],
        "materials": {"steel": {"density": 7800.0, "youngs_modulus": 2.1e11}},
        "sections": {"s": {"area": 1e-4, "second_moment": 8e-10}},
        "bodies": {f"b{k}": beam for k in range(count)},
        "joints": {f"j{k}": one for k, one in enumerate(joints)},
        "springs": {f"s{k}": spring | pair for k, pair in enumerate(pairs) if kinds[k] == "revolute"},
        "solve": {"duration": 1.0},
        "output": {"channels": [f"b{count - 1}.tip.x", f"b{count - 1}.tip.y"]},
    }


def test_a_beam_in_many_pieces_takes_no_more_steps_of_the_load_than_in_one():
    one, many = (hfsim.static(_chain(count, "fixed")) for count in (1, 32))
    assert [*many.final.values()] == pytest.approx([*one.final.values()], abs=1e-5)
    assert many.statistics["steps"] <= one.statistics["steps"] + 2
    assert many.statistics["newton_iterations"] <= 2 * one.statistics["newton_iterations"]


def test_a_long_chain_on_springs_takes_few_steps_of_the_load():
    few, many = (hfsim.static(_chain(count, "revolute")) for count in (8, 32))
    assert many.statistics["steps"] <= 2 * few.statistics["steps"]


def test_a_path_has_as_many_points_whatever_the_pieces_of_a_beam():
    one, many = (hfsim.static(_chain(count, "fixed", 8), path=True) for count in (1, 8))
    assert [*many.final.values()] == pytest.approx([*one.final.values()], rel=1e-3)
    assert many.statistics["steps"] == one.statistics["steps"]
