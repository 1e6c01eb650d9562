"""Models of beams with sections in the plane: rigid, what takes over from it, and the choice in a run."""

from functools import partial

import numpy as np
import posed
import pytest
import yaml
from beam_laws import check_inertia_of_rigid, check_takeover, check_told_at_rest
from cantilevers import cantilever
from solved import parsed, solved

from hfsim.errors import DeckError
from hfsim.maths.rotations import rotation
from hfsim.scene.build import build

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
    scene = cantilever(section, length, force, moment, material=material, more=more or "model: linear")
    seen, _ = check_told_at_rest(scene, force, moment)
    if length:
        p = scene.deck.section_properties("b")
        bent = -20.0 * (1.0 / (3.0 * p.bending_stiffness[1]) + 1.0 / p.shear_stiffness[0])
        assert seen.tip[0] == pytest.approx([bent + 5.0 / (2.0 * p.bending_stiffness[1])], rel=1e-3)


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
    check_inertia_of_rigid(partial(rotor, curve))


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
    check_takeover(rotor(curve))


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
