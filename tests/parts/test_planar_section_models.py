"""Models of beams with sections in the plane: rigid, what takes over from it, and the choice in a run."""

import numpy as np
import posed
import pytest
import yaml
from cantilevers import at_rest, cantilever
from solved import parsed, solved

from hfsim.errors import DeckError
from hfsim.marching.integration import run_integration
from hfsim.maths.rotations import rotation
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.build import build
from hfsim.trust.handover import hand_over
from hfsim.trust.quasistatic import deformation_of

CURVES = {"straight": {"length": 1.2}, "arc": {"axis": {"arc": {"radius": 2.0, "angle": 0.6}}}}
ROTOR = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {stuff: {density: 2700.0, youngs_modulus: 2.0e+10, poisson_ratio: 0.3}}
sections: {bar: {shape: rectangle, width: 0.06, height: 0.03}}
bodies:
  hub: {type: rigid, mass: 3.0, inertia: 0.1, points: {rim: [0.2, 0.0]}}
  b1: {type: beam, element: cosserat, material: stuff, section: bar, elements: 2, degree: 3}
joints:
  pin: {type: revolute, between: [ground, hub]}
  clamp: {type: fixed, between: [hub.rim, b1.root], angle: 0.3}
initial: {hub: {angular_velocity: 5.0}}
loads: {spin: {type: moment, at: hub, moment: 10.0}}
solve: {model: rigid, duration: 0.3, tolerance: 1.0e-9}
output: {interval: 0.02, channels: [b1.tip.x, b1.tip.y, energy.total]}
"""


def rotor(curve="straight", model="rigid", **keys):
    data = yaml.safe_load(ROTOR)
    data["bodies"]["b1"] |= CURVES[curve]
    data["solve"] |= {"model": model}
    return {**data, **keys}


@pytest.mark.parametrize("more", ["", "axis: {arc: {radius: 1.0, angle: 1.2}}, model: linear"])
def test_rigid_beams_tell_how_their_forces_would_deform_them(more):
    """At rest it is what linear says: tip, and shape to go over to."""
    length = None if "arc" in more else 1.0
    section, material = "{shape: rectangle, width: 0.2, height: 0.1}", "youngs_modulus: 7.0e+9"
    force, moment = (30.0, -20.0), 5.0
    flexible = cantilever(section, length, force, moment, material=material, more=more or "model: linear")
    x = at_rest(flexible, 1.0)
    expected = flexible.bodies["b"].deformation(x, np.zeros_like(x))
    deck = flexible.loaded.deck
    body = deck.bodies["b"].assemble("b", 0, deck, MODELS["rigid"])
    pose = Pose.level([0.0, 0.0])
    y, still = body.placed(pose)[None], np.zeros((1, 3))
    tip = body.marker(body.points["tip"])
    on = np.array(force) @ tip.position_jacobian(y)[0] + moment * tip.spin_jacobian(y)[0, 0]
    seen = body.statics(y, still, still, [(tip, on[None])])
    assert seen.tip == pytest.approx(expected.tip, rel=2e-3)
    for own, other in ((seen.axial, expected.axial), (seen.slope[..., 0], expected.slope[..., 0])):
        found = np.interp(expected.places, seen.places, own[0])
        assert found == pytest.approx(other[0], abs=2e-3 * seen.steepness.max())
    if length:
        p = deck.section_properties("b")
        bent = -20.0 * (1.0 / (3.0 * p.bending_stiffness[1]) + 1.0 / p.shear_stiffness[0])
        assert seen.tip[0] == pytest.approx([bent + 5.0 / (2.0 * p.bending_stiffness[1])], rel=1e-3)
    vectors, _ = flexible.bodies["b"].deformed(pose, Twist(np.zeros(2), np.zeros(1)), seen)
    assert vectors == pytest.approx(x[0], abs=2e-3 * np.abs(x[0] - flexible.bodies["b"].placed(pose)).max())


def test_spinning_and_turning_faster_deform_as_their_inertia_forces():
    """Stretch by omega^2 and bending by alpha, of a free straight rigid beam turned anyhow."""
    scene = build(parsed(rotor()))
    body, omega, alpha, turn = scene.bodies["b1"], 7.0, 11.0, 0.4
    x, u, ax = (np.zeros((1, scene.system.n_x)) for _ in range(3))
    gravity, length, at = np.array([0.0, -9.81]), 1.2, body.columns
    d1 = np.array([np.cos(turn), np.sin(turn)])
    x[:, at.stop - 1], u[:, at.stop - 1], ax[:, at.stop - 1] = turn, omega, alpha
    centre = 0.5 * length * (alpha * np.array([-d1[1], d1[0]]) - omega**2 * d1)
    ax[0, at.start : at.start + 2] = gravity + centre
    p = scene.deck.section_properties("b1")
    seen, m = body.statics(x, u, ax, ()), p.mass_per_length
    assert seen.elongation[0] == pytest.approx(m * omega**2 * length**3 / (3.0 * p.axial_stiffness), rel=1e-3)
    bent = 11.0 * length**5 / 120.0 * m + p.rotary_inertia[1] * length**3 / 3.0
    sheared = m * length**3 / 3.0
    expected = -alpha * (bent / p.bending_stiffness[1] + sheared / p.shear_stiffness[0])
    assert seen.tip[0] == pytest.approx([expected], rel=1e-3)


@pytest.mark.parametrize("curve", CURVES)
def test_rigid_beams_have_the_inertia_of_their_sections(curve):
    energies, places = [], []
    for model in ("rigid", "exact"):
        scene = build(parsed(rotor(curve, model)))
        system = scene.system
        x, u = system.absolute(scene.q[None]), system.absolute_velocity(scene.q[None], scene.v[None])
        energies.append(system.kinetic_energy(x, u)[0] + system.potential_energy(np.zeros(1), x)[0])
        places.append(scene.marker("b1.tip").position(x)[0])
        outline = scene.bodies["b1"].outline(x)[0]
        assert outline[-1] == pytest.approx(places[-1], abs=1e-6)
    assert energies[0] == pytest.approx(energies[1], rel=1e-12)
    assert places[0] == pytest.approx(places[1], abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["rigid", "linear", "lowOrder"])
def test_posed_in_space_it_is_the_same(model):
    data = rotor("arc", model)
    data["initial"] = {"hub": {"angle": 0.2, "angular_velocity": 5.0}, "b1": {"angle": 0.5}}
    R, shift = rotation(np.array([0.7, -1.1, 0.4])), np.array([0.4, -2.0, 1.3])
    there = posed.in_space(data, R, shift)
    there["output"]["channels"].insert(2, "b1.tip.z")
    own, values = solved(data)[0][:, :2], solved(there)[0][:, :3]
    assert values == pytest.approx(own @ R[:, :2].T + shift, abs=1e-8)


@pytest.mark.parametrize("curve", CURVES)
def test_what_takes_over_goes_on_in_the_same_place_with_the_same_forces(curve):
    old = build(parsed(rotor(curve)))
    path = run_integration(old, old.deck.solve).trajectory
    x = old.system.absolute(path.q[None])
    seen = deformation_of(old, old.bodies["b1"], np.array([0.3]), path.q[None], path.v[None])
    size = np.linalg.norm(seen.sections[0, -1, :2])
    assert size > 1e-4
    for model in ("linear", "exact"):
        new, gained = hand_over(old, build(old.loaded, models={"b1": model}), path)
        y = new.system.absolute(new.q[None])
        assert np.abs(new.system.residual(np.array([0.3]), y)).max() < 1e-9
        moved = new.marker("b1.tip").position(y) - old.marker("b1.tip").position(x)
        assert np.linalg.norm(moved) == pytest.approx(size, rel=0.05)
        energy = new.system.kinetic_energy(y, new.system.absolute_velocity(new.q[None], new.v[None]))[0]
        assert abs(gained) < 2e-3 * energy


@pytest.mark.slow
def test_the_model_that_a_motion_needs_is_chosen():
    data = rotor(model="auto", gravity=[0.0, 0.0])
    data["loads"]["spin"]["law"] = {"type": "constant_rate", "rate": 300.0}
    chosen, told = solved(data)
    exact, _ = solved({**data, "solve": {**data["solve"], "model": "exact"}})
    assert told.statistics["auto"]["switches"]
    assert chosen[:, :2] == pytest.approx(exact[:, :2], abs=2e-2)
    stiff = rotor(model="auto", gravity=[0.0, 0.0])
    stiff["materials"]["stuff"]["youngs_modulus"] = 2e14
    assert not solved(stiff)[1].statistics["auto"]["switches"]


def test_a_rigid_beam_that_cannot_move_is_where_it_was():
    scene = build(parsed(rotor("arc")))
    x = scene.system.absolute(scene.q[None])
    root, tip = (scene.marker(f"b1.{end}").position(x)[0] for end in ("root", "tip"))
    still = scene.bodies["b1"].folded(Pose.planar(root, scene.start_angles["b1"]))
    assert still.marker(still.points["tip"]).position(np.zeros((1, 0)))[0] == pytest.approx(tip, abs=1e-14)


def test_internal_forces_are_refused_where_there_are_no_strains():
    data = rotor()
    data["output"]["channels"] = ["b1.at(0.5).moment"]
    with pytest.raises(DeckError):
        build(parsed(data))


def test_steps_of_linear_are_in_nodal_vectors_where_nodes_have_section_vectors():
    """They take less time there; the frame is for all other elements, or when it is asked for."""
    scene = build(parsed(rotor("straight", "linear")))
    assert not scene.system.charts
    data = rotor("straight", "linear")
    data["bodies"]["b1"]["element"] = "cable"
    assert build(parsed(data)).system.charts
    data = rotor("straight", "linear")
    data["solve"]["coordinates"] = "frame"
    assert build(parsed(data)).system.charts
