"""Models of beams in space: a planar motion in any plane of space is that of the planar model."""

import json

import numpy as np
import pytest

from hfsim.maths.rotations import rotation, rotation_vector
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate
from hfsim.trust.quasistatic import deformation_of

R = rotation(np.array([0.7, -1.1, 0.4]))
"""How the plane is turned that planar decks are put into."""
BEAM = "type: beam, material: soft, section: bar, element: cable, elements: 2"
HEAD = """hfsim: 1
materials:
  soft: {{density: 900.0, youngs_modulus: 2.0e6, axial_damping: {damping}, bending_damping: {damping}}}
sections: {{bar: {{shape: rectangle, width: 0.05, height: 0.05}}}}
solve: {{model: {model}, duration: {duration}, tolerance: 1.0e-11, coordinates: {coordinates}}}
"""
PLANE = """
gravity: [0.0, -9.81]
bodies:
  b1: {{{BEAM}, length: 1.5, points: {{mid: [0.7, 0.0]}}{options}}}
  b2: {{{BEAM}, length: 1.0{options}}}
joints:
  pin: {{type: revolute, between: [ground, b1.root]}}
  elbow: {{type: revolute, between: [b1.mid, b2.root]}}
initial: {{b1: {{angle: 0.3, angular_velocity: 2.0}}, b2: {{angle: -0.2}}}}
output: {{interval: 0.05, channels: [b1.tip.x, b1.tip.y, b2.tip.x, b2.tip.y, energy.total, energy.strain]}}
"""
SPACE = """
gravity: {gravity}
bodies:
  b1: {{{BEAM}, length: 1.5, points: {{mid: [0.7, 0.0, 0.0]}}{options}}}
  b2: {{{BEAM}, length: 1.0{options}}}
joints:
  ball: {{type: spherical, between: [ground, b1.root]}}
  elbow: {{type: spherical, between: [b1.mid, b2.root]}}
initial:
  b1: {{orientation: {{rotation_vector: {first}}}, angular_velocity: {spin}}}
  b2: {{orientation: {{rotation_vector: {second}}}}}
output: {{interval: 0.05, channels: [b1.tip.x, b1.tip.y, b1.tip.z, b2.tip.x, b2.tip.y, b2.tip.z, energy.total,
                                     energy.strain]}}
"""


def both(model, options="", damping=0.0, duration=0.5, coordinates="auto"):
    """The decks of a planar scene and of the same one in a plane of space."""
    turns = [rotation_vector(R @ rotation(np.array([0.0, 0.0, angle]))) for angle in (0.3, -0.2)]
    first, second = (json.dumps(turn.tolist()) for turn in turns)
    head = HEAD.format(damping=damping, model=model, duration=duration, coordinates=coordinates)
    space = SPACE.format(
        BEAM=BEAM,
        options=options,
        gravity=json.dumps((R @ [0.0, -9.81, 0.0]).tolist()),
        first=first,
        second=second,
        spin=json.dumps((2.0 * R[:, 2]).tolist()),
    )
    return parse_deck(head + PLANE.format(BEAM=BEAM, options=options)), parse_deck(head + space)


def values(result, name):
    return next(c.values for c in result.channels if c.name == name)


def points(result, body, n_dim):
    return np.stack([values(result, f"{body}.tip.{axis}") for axis in "xyz"[:n_dim]], axis=1)


def run(deck):
    result = simulate(deck, error_estimate=False)
    assert result.status == "done", result.reason
    return result


def check_same_motion(*args, **kwargs):
    plane, space = map(run, both(*args, **kwargs))
    for body in ("b1", "b2"):
        seen = points(space, body, 3) @ R
        assert seen[:, :2] == pytest.approx(points(plane, body, 2), abs=1e-9)
        assert np.abs(seen[:, 2]).max() < 1e-9
    for name in ("energy.total", "energy.strain"):
        assert values(space, name) == pytest.approx(values(plane, name), abs=1e-8)


@pytest.mark.parametrize("model", ["rigid"])
def test_a_planar_motion_in_space_is_the_planar_one(model):
    check_same_motion(model)


# rigid -----------------------------------------------------------------------------------------------


def test_forces_would_bend_a_rigid_line_in_space_as_in_the_plane():
    seen = []
    for deck in both("rigid"):
        scene = build(deck)
        state = np.zeros(1), scene.q[None], scene.v[None]
        seen.append({name: deformation_of(scene, body, *state) for name, body in scene.bodies.items()})
    plane, space = seen
    for name in ("b1", "b2"):
        assert np.linalg.norm(space[name].tip) == pytest.approx(abs(plane[name].tip[0, 0]), rel=1e-9)
        assert space[name].axial == pytest.approx(plane[name].axial, abs=1e-12)
        assert space[name].steepness == pytest.approx(plane[name].steepness, abs=1e-12)
        assert np.linalg.norm(space[name].spin) == pytest.approx(abs(plane[name].spin[0, 0]))


def test_a_rigid_line_keeps_its_length_and_its_energy_out_of_plane():
    deck = both("rigid", duration=2.0)[1]
    spin = (1.0, 3.0, -2.0)
    initial = deck.deck.initial["b1"].model_copy(update={"angular_velocity": spin})
    changed = deck.deck.model_copy(update={"initial": {**deck.deck.initial, "b1": initial}})
    deck = type(deck)(changed, deck.source)
    result = run(deck)
    assert np.linalg.norm(points(result, "b1", 3), axis=1) == pytest.approx(1.5, abs=1e-12)
    assert np.ptp(values(result, "energy.total")) < 1e-10
