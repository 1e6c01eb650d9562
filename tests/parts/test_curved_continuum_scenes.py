"""Scenes with fully parameterised beams that are curved, twisted or turned: models, joints, motion."""

import numpy as np
import posed
import pytest
import yaml
from beam_laws import (
    FORCE,
    MOMENT,
    check_force_of_energy,
    check_inertia_of_rigid,
    check_rigid_motions,
    check_small_loads,
    check_takeover,
    check_told_at_rest,
)
from cantilevers import cantilever
from solved import parsed, solved

from hfsim.maths.rotations import rotation
from hfsim.parts.bodies.linear import LinearElasticForce
from hfsim.scene.build import build

ROTOR = """
hfsim: 1
gravity: [0.0, 1.0, -9.81]
ground: {points: {wall: [0.0, 0.0, 0.0]}}
materials: {stuff: {density: 2700.0, youngs_modulus: 7.0e+7, poisson_ratio: 0.3}}
sections: {bar: {shape: rectangle, width: 0.06, height: 0.03}}
bodies:
  hub: {type: rigid, mass: 3.0, inertia: [0.1, 0.1, 0.15], points: {rim: [0.2, 0.0, 0.0]}}
  b1: {type: beam, element: continuum, section_degree: 2, material: stuff, section: bar, elements: 2,
       axis: {arc: {radius: 2.0, angle: 0.6}}, section_angle: 0.3, twist: 0.4,
       points: {side: [0.9, 0.005, 0.01]}}
  bob: {type: rigid, mass: 0.5, inertia: [0.001, 0.001, 0.001]}
joints:
  pin: {type: revolute, between: [ground.wall, hub], axis: [0.0, 0.0, 1.0]}
  clamp: {type: fixed, between: [hub.rim, b1.root]}
  hook: {type: revolute, between: [b1.side, bob], axis: [0.0, 1.0, 1.0]}
initial:
  hub: {orientation: {rotation_vector: [0.0, 0.0, 0.0]}, angular_velocity: [0.0, 0.0, 3.0]}
  b1: {orientation: {rotation_vector: [0.0, 0.0, 0.0]}}
  bob: {orientation: {rotation_vector: [0.0, 0.0, 0.0]}}
solve: {model: exact, duration: 0.03, tolerance: 1.0e-10}
output: {interval: 0.01, channels: [b1.tip.x, b1.tip.y, b1.tip.z, bob.rotation_x, energy.total]}
"""


def rotor(model="exact", **solve):
    data = yaml.safe_load(ROTOR)
    data["solve"] |= {"model": model, **solve}
    return data


@pytest.fixture(scope="module")
def exact():
    return solved(rotor())[0]


# ---------------------------------------------------------------- where it is


def test_points_and_frames_of_the_undeformed_beam():
    """Points count along the line, then along its normals; the body frame is where the root is."""
    scene = build(parsed(rotor()))
    beam, x = scene.bodies["b1"], scene.system.absolute(scene.q[None])
    angle, radius = 0.9 / 2.0, 2.0 - 0.005
    expected = [radius * np.sin(angle), 2.0 - radius * np.cos(angle), 0.01]
    assert beam.reference(beam.points["side"]) == pytest.approx(expected, abs=2e-4)
    for name in ("root", "side", "tip"):
        place = np.array([0.2, 0.0, 0.0]) + beam.reference(beam.points[name])
        assert scene.marker(f"b1.{name}").position(x)[0] == pytest.approx(place, abs=1e-12)
        for marker in (beam.marker(beam.points[name]), beam.grip(beam.points[name])):
            assert marker.frame(x)[0] == pytest.approx(np.eye(3), abs=1e-12)
    turned = beam.section_axes(x, np.array([0.0, 1.2]))[0]
    assert turned[0] == pytest.approx(rotation(np.array([0.3, 0.0, 0.0])), abs=1e-12)
    end = rotation(np.array([0.0, 0.0, 0.6])) @ rotation(np.array([0.7, 0.0, 0.0]))
    assert turned[1] == pytest.approx(end, abs=1e-12)


def test_left_alone_it_stays_as_it_is():
    data = rotor()
    data["gravity"], data["joints"], data["initial"] = [0.0, 0.0, 0.0], {}, {}
    del data["bodies"]["hub"], data["bodies"]["bob"]
    data["output"]["channels"] = ["b1.tip.x", "b1.tip.y", "b1.tip.z", "energy.strain", "energy.kinetic"]
    for model in ("exact", "linear", "rigid"):
        data["solve"]["model"] = model
        values = solved(data)[0]
        assert np.ptp(values[:, :3], axis=0) == pytest.approx(0.0, abs=1e-12)
        assert values[0, :3] == pytest.approx([2 * np.sin(0.6), 2 - 2 * np.cos(0.6), 0.0], abs=1e-12)
        assert np.abs(values[:, 3:]).max() < 1e-15


# ---------------------------------------------------------------- motion


@pytest.mark.parametrize(("model", "coordinates"), [("ancf", "auto"), ("exact", "frame")])
def test_exact_in_both_coordinates_and_ancf_are_one(exact, model, coordinates):
    found = solved(rotor(model, coordinates=coordinates))[0]
    assert found == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())


def test_energy_is_kept(exact):
    assert np.ptp(exact[:, 4]) < 1e-9 * np.abs(exact[:, 4]).max()
    assert np.ptp(exact[:, 2]) > 0.003


def test_a_turned_and_shifted_scene_moves_the_same(exact):
    R, shift = rotation(np.array([0.7, -1.1, 0.4])), np.array([0.3, -2.0, 1.0])
    found = solved(posed.moved(rotor(), R, shift))[0]
    assert found[:, :3] == pytest.approx(exact[:, :3] @ R.T + shift, abs=1e-9)


# ---------------------------------------------------------------- models


def test_rigid_beams_have_the_inertia_of_their_material():
    check_inertia_of_rigid(rotor)


@pytest.fixture
def linear():
    """The scene, its state (n,), and the force of its beam, of a damped material."""
    data = rotor("linear")
    data["materials"]["stuff"] |= {"axial_damping": 1.0e-4, "bending_damping": 3.0e-4}
    scene = build(parsed(data))
    force = next(part for part in scene.system.forces if isinstance(part, LinearElasticForce))
    return scene, scene.system.absolute(scene.q[None])[0], force


def test_the_linear_force_is_the_derivative_of_its_energy(linear, rng):
    _, x, force = linear
    check_force_of_energy(force, x + 0.05 * rng.normal(size=x.shape), rng)


def test_no_rigid_motion_is_resisted_by_linear(linear, rng):
    scene, x, force = linear
    check_rigid_motions(scene.bodies["b1"], force, x, rng)
    assert np.abs(force.displacements(x[None])).max() < 1e-14


ARC = "axis: {arc: {radius: 1.0, angle: 60 deg}}, section_angle: 0.3, twist: 0.4"
SECTION = "{shape: rectangle, width: 0.05, height: 0.03}"


def bar(model, force=FORCE, moment=MOMENT):
    more = f"element: continuum, section_degree: 3, model: {model}, {ARC}"
    return cantilever(SECTION, 0, force, moment, 3, 4, "youngs_modulus: 7.0e+9", more)


def test_static_deflections_of_small_loads_are_those_of_exact():
    """The difference falls with the square of the load."""
    check_small_loads(bar, 2.0)


def test_rigid_beams_tell_how_their_forces_would_deform_them():
    """At rest it is what linear says: tip, and shape to go over to."""
    check_told_at_rest(bar("linear"), FORCE, MOMENT, 0.02)


def test_what_takes_over_goes_on_with_the_same_forces():
    data = rotor("rigid", tolerance=1.0e-8)
    data["materials"]["stuff"]["youngs_modulus"] = 7.0e10
    check_takeover(data, 5e-3)


def test_the_model_that_a_motion_needs_is_chosen(exact):
    chosen, told = solved(rotor("auto", tolerance=1.0e-8))
    assert told.statistics["auto"]["switches"]
    assert chosen[:, :3] == pytest.approx(exact[:, :3], abs=5e-3)


# ---------------------------------------------------------------- joints

HELD = {"fixed": 6, "revolute": 5, "prismatic": 5, "cylindrical": 4, "universal": 4, "spherical": 3}


@pytest.mark.parametrize("kind", HELD)
@pytest.mark.parametrize("ends", [["b1.tip", "bob"], ["bob", "b1.tip"]])
def test_joints_hold_the_section_at_the_end_of_an_arc(kind, ends, rng):
    """Undeformed they hold; all that they do not leave free changes their equations."""
    data = rotor()
    axes = {"universal": {"axes": [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "fixed": {}, "spherical": {}}
    axes["revolute"] = {"axis": [1.0, 0.0, 0.0]}
    data["joints"]["hook"] = {"type": kind, "between": ends, **axes.get(kind, {"axis": [0.6, 0.0, 0.8]})}
    data["bodies"]["b1"]["axis"]["arc"]["angle"] = 1.5
    data["bodies"]["bob"]["inertia"] = [0.001, 0.001, 0.0015]
    scene = build(parsed(data))
    system, x = scene.system, scene.system.absolute(scene.q[None])
    assert np.abs(system.residual(np.zeros(1), x)).max() < 1e-12
    bob = scene.bodies["bob"]
    assert bob.vectors(x)[0, 1:] == pytest.approx(np.eye(3), abs=1e-12)
    moved = np.zeros((6, x.shape[1]))
    moved[:, bob.columns] = bob.freedoms(x[0])
    before, after = (system.residual(np.zeros(6), x + step * moved) for step in (-1e-4, 1e-4))
    assert np.linalg.matrix_rank((after - before) / 2e-4, tol=1e-3) == HELD[kind]
