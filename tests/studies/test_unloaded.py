"""Unloaded scenes: starts have no stress of stated digits, and rounding counts in what modes are told."""

import numpy as np
import pytest
import yaml

import hfsim
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

HUNG = yaml.safe_load("""
hfsim: 1
gravity: [0, 0, 0]
ground: {points: {g: [0.31, -0.22, 0.43]}}
materials: {m: {density: 1266.7, youngs_modulus: 5.45e8}}
sections: {s: {shape: circle, diameter: 2 cm}}
bodies:
  line: {type: beam, element: cable, strain: engineering, material: m, section: s, length: 0.613, elements: 2,
         degree: 5, points: {mid: [0.21, 0, 0]}}
  first: {type: rigid, mass: 0.4, inertia: [0.002, 0.003, 0.004], points: {q: [0.05, 0.13, -0.04]}}
  last: {type: rigid, mass: 0.4, inertia: [0.002, 0.003, 0.004], points: {q: [0.05, 0.13, -0.04]}}
joints:
  c: {type: fixed, between: [ground.g, line.root], orientation: {rotation_vector: [0.7, -1.3, 0.4]}}
  w: {type: spherical, between: [line.mid, first.q]}
  e: {type: fixed, between: [first, last.q], orientation: {rotation_vector: [0.3, 0.2, 0.1]}}
initial:
  first: {orientation: {rotation_vector: [0.2, 0.9, -0.7]}}
solve: {duration: 0.1}
""")


def test_digits_of_stated_orientations_strain_nothing():
    """That of the last body is stated to twelve digits: the others are not bent by what these miss."""
    poses = build(parse_deck(yaml.safe_dump(HUNG))).assembly.poses
    rounded = [round(float(one), 12) for one in poses["last"].turn]
    stated = {**HUNG["initial"], "last": {"orientation": {"rotation_vector": rounded}}}
    scene = build(parse_deck(yaml.safe_dump({**HUNG, "initial": stated})))
    x = scene.system.absolute(scene.q[None])[0]
    for name, body in scene.bodies.items():
        assert np.abs(x[body.columns] - body.placed(scene.assembly.poses[name])).max() < 1e-15
    assert not scene.assembly.changes


@pytest.mark.parametrize("model", ["exact", "lowOrder"])
def test_bodies_that_hang_on_a_line_without_weight_move_as_rigid_ones(model):
    found = hfsim.modes(HUNG, {"solve.model": model}, count=6)
    assert [mode.kind for mode in found.modes[:3]] == ["rigid"] * 3
    assert not found.unstable


def test_a_spring_between_points_that_a_joint_holds_together_hides_no_vibration():
    """Its length is rounding: so is what it does, in all coordinates."""
    kind = {"type": "two_point", "damping": 0.5}
    turn = {**kind, "between": ["ground", "first"], "stiffness": 1.0}
    met = {**kind, "between": ["line.mid", "first.q"], "stiffness": 11.0}
    free = hfsim.modes(HUNG, {"springs": {"turn": turn}}, count=6)
    for coordinates in ("absolute", "frame"):
        held = {"springs": {"turn": turn, "met": met}, "solve.coordinates": coordinates}
        found = hfsim.modes(HUNG, held, count=6)
        for one, other in zip(found, free, strict=True):
            assert (one.kind, one.value) == (other.kind, pytest.approx(other.value, rel=1e-6, abs=1e-6))


@pytest.mark.parametrize("turn", [[-0.52, -0.18, -1.44], [0.28, 0.22, -1.67]])
def test_a_body_that_rolls_at_the_tip_of_a_line_moves_as_a_rigid_one(turn):
    """Of some states next to these one alone would have joints nearly without forces."""
    bodies = {name: HUNG["bodies"][name] for name in ("line", "last")}
    joints = {
        "c": {"type": "fixed", "between": ["ground.g", "line.mid"], "orientation": {"rotation_vector": turn}},
        "e": {**HUNG["joints"]["e"], "between": ["line.tip", "last.q"]},
    }
    deck = {**HUNG, "bodies": bodies, "joints": joints, "initial": {}}
    found = hfsim.modes(deck, {"bodies.line.degree": 4}, count=4)
    assert found[1].kind == "rigid"
    assert not found.unstable
