# ruff: noqa: E501
"""Models of beams with sections: linear and rigid, steps in the frame of the root, and going over from one to another."""

from dataclasses import replace

import numpy as np
import posed
import pytest
import yaml
from analytical import jacobian
from beam_laws import (
    check_force_of_energy,
    check_inertia_of_rigid,
    check_rigid_motions,
    check_takeover,
    check_told_at_rest,
)
from blades import AT_REST, FLAP, GROWTH_LINEAR, LAG, frequencies, off, spectrum
from cantilevers import at_rest, cantilever, displacement, inside
from solved import parsed, solved

from hfsim.maths.rotations import rotation
from hfsim.parts.bodies.root_axes import SectionFrameChart
from hfsim.scene.build import build

CURVES = {"straight": "", "arc": ", axis: {arc: {radius: 2.0, angle: 0.6}}, twist: 0.4", "coupled": ""}
ROTOR = """
hfsim: 1
gravity: [0.0, 1.0, -9.81]
ground: {{points: {{origin: [0.0, 0.0, 0.0]}}}}
materials: {{stuff: {{density: 2700.0, youngs_modulus: {modulus}, poisson_ratio: 0.3, bending_damping: {damping}}}}}
sections: {{bar: {{shape: rectangle, width: 0.06, height: 0.03}}}}
bodies:
  hub: {{type: rigid, mass: 3.0, inertia: [0.1, 0.1, 0.15], points: {{rim: [0.2, 0.0, 0.0]}}}}
  b1: {{type: beam, material: stuff, section: bar, length: 1.2, elements: 2, degree: 2, section_angle: 0.3{curve}}}
joints:
  pin: {{type: revolute, between: [ground.origin, hub]}}
  clamp: {{type: fixed, between: [hub.rim, b1.root]}}
initial:
  hub: {{orientation: {{x: [1.0, 0.0, 0.0], y: [0.0, 1.0, 0.0]}}, angular_velocity: [0.0, 0.0, {rate}]}}
  b1: {{orientation: {{x: [1.0, 0.0, 0.0], y: [0.0, 1.0, 0.0]}}}}
solve: {{model: {model}, duration: {duration}, tolerance: {tolerance}, coordinates: {coordinates}}}
output: {{interval: 0.01, channels: [b1.tip.x, b1.tip.y, b1.tip.z, energy.total]}}
"""
PLANAR = """
hfsim: 1
materials: {{stuff: {{density: 2700.0, youngs_modulus: {modulus}, bending_damping: {damping}}}}}
sections: {{bar: {{shape: rectangle, width: 0.06, height: 0.03}}}}
bodies: {{b1: {{type: beam, material: stuff, section: bar, length: 1.2, elements: 2, degree: 2, element: cosserat}}}}
joints: {{pin: {{type: revolute, between: [ground, b1.root]}}}}
initial: {{b1: {{angle: 0.3, angular_velocity: {rate}}}}}
solve: {{model: {model}, duration: {duration}, tolerance: {tolerance}, coordinates: {coordinates}}}
output: {{channels: [b1.tip.x, b1.tip.y]}}
"""


def rotor(curve="straight", **changed):
    numbers = {"modulus": 7.0e8, "damping": 0.0, "rate": 3.0, "model": "linear", "duration": 0.015}
    numbers |= {"tolerance": 1.0e-10, "coordinates": "auto", **changed}
    data = yaml.safe_load((PLANAR if curve == "plane" else ROTOR).format(curve=CURVES.get(curve), **numbers))
    if curve == "arc":
        data["bodies"]["b1"].pop("length")
    if curve == "coupled":
        data["bodies"]["b1"].pop("material")
        data["sections"]["bar"] = laminate(numbers["modulus"], numbers["damping"])
    return data


def laminate(modulus, damping):
    """A section as heavy and about as stiff as the others, whose tension twists and whose bending shears."""
    area, I_y, I_z = 1.8e-3, 5.4e-7, 1.35e-7
    numbers = modulus * np.array([area, 0.3 * area, 0.3 * area, 0.3 * (I_y + I_z), I_y, I_z])
    i, j = [0, 1, 2, 3], [3, 5, 4, 4]
    C = np.diag(numbers)
    C[i, j] = C[j, i] = 0.3 * np.sqrt(numbers[i] * numbers[j])
    mass = {"mass_per_length": 2700.0 * area, "rotary_inertia": [2700.0 * one for one in (I_y + I_z, I_y, I_z)]}
    return mass | {"stiffness": C.tolist(), "bending_damping": damping}


def moved_scene(rng, curve, **changed):
    scene = build(parsed(rotor(curve, **changed)))
    x = scene.system.absolute(scene.q[None])[0]
    return scene, scene.bodies["b1"], x + 0.05 * rng.normal(size=x.shape)


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
@pytest.mark.parametrize("curve", [*CURVES, "plane"])
def test_force_is_the_derivative_of_its_energy(rng, curve, model):
    _, body, x = moved_scene(rng, curve, model=model, damping=0.01)
    check_force_of_energy(body.elastic, x, rng)


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
@pytest.mark.parametrize("curve", [*CURVES, "plane"])
def test_force_is_that_of_its_strains(rng, curve, model):
    """With given strains, too, and its tangent is the derivative of the force with its rates."""
    _, body, x = moved_scene(rng, curve, model=model, damping=0.01)
    force, t, u = body.elastic, np.zeros(1), rng.normal(size=(1, len(x)))
    e, C = force.strain(x[None]), force.strain_stiffness
    assert 0.5 * e**2 @ C == pytest.approx(force.strain_energy(x[None]), rel=1e-9)
    at = force.strain_slopes(x[None])
    slopes = np.zeros((len(C), len(x)))
    np.add.at(slopes, (at.rows, at.columns), at.values)
    assert slopes == pytest.approx(jacobian(force.strain, x), abs=1e-7 * np.abs(slopes).max())
    plain, given = (np.zeros((1, len(x))) for _ in range(2))
    force.add_force(t, x[None], u, plain)
    other = e + rng.normal(size=e.shape) * np.abs(e).max()
    force.strained(other).add_force(t, x[None], u, given)
    assert plain - given == pytest.approx(((other - e) * C) @ slopes, abs=1e-9 * np.abs(given).max())

    def pushed(y):
        out = np.zeros_like(y)
        force.add_force(np.zeros(len(y)), y, np.repeat(u, len(y), axis=0), out)
        return out

    own = np.zeros((len(x), len(x)))
    found = force.tangent(t, x[None], u)
    np.add.at(own, (found.rows, found.columns), found.values)
    assert own == pytest.approx(-jacobian(pushed, x), abs=1e-6 * np.abs(own).max())


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
@pytest.mark.parametrize("curve", [*CURVES, "plane"])
def test_no_rigid_motion_is_resisted_nor_caused(rng, curve, model):
    scene, body, _ = moved_scene(rng, curve, model=model, damping=0.01)
    check_rigid_motions(body, body.elastic, scene.system.absolute(scene.q[None])[0], rng)


@pytest.mark.parametrize("model", ["exact", "linear", "lowOrder"])
@pytest.mark.parametrize("curve", [*CURVES, "plane"])
def test_steps_in_the_frame_of_the_root_give_those_in_nodal_vectors(model, curve):
    frame, absolute = (solved(rotor(curve, model=model, coordinates=one))[0] for one in ("frame", "absolute"))
    assert frame == pytest.approx(absolute, abs=1e-9 * np.abs(absolute).max())


@pytest.mark.parametrize("n_dim", [2, 3])
def test_chart_of_the_root_against_differences(rng, n_dim):
    chart, h = SectionFrameChart(slice(0, 6 * n_dim * n_dim), 2, n_dim), 1e-4
    q, v, a = rng.normal(size=(3, 1, 6 * n_dim * n_dim))
    frames = chart.frames(q)
    x, u = chart.absolute(frames), chart.absolute_velocity(frames, v)
    at = lambda t: chart.absolute(chart.frames(q + t * v + 0.5 * t * t * a))  # noqa: E731
    assert u == pytest.approx((at(h) - at(-h)) / (2.0 * h), abs=1e-6)
    second = (at(h) - 2.0 * at(0.0) + at(-h)) / h**2
    assert chart.relative_acceleration(frames, v, second) == pytest.approx(a, abs=1e-5)
    assert chart.hybrid(x, q) == pytest.approx(q, abs=1e-11)
    assert chart.hybrid_velocity(frames, u) == pytest.approx(v, abs=1e-11)



@pytest.mark.parametrize("model", ["linear", "lowOrder"])
def test_turning_and_shifting_a_scene_changes_nothing(model):
    R, shift = rotation(np.array([0.7, -1.1, 0.4])), np.array([0.4, -2.0, 1.3])
    here = rotor("arc", model=model)
    own, turned = (solved(data)[0][:, :3] for data in (here, posed.moved(here, R, shift)))
    assert turned == pytest.approx(own @ R.T + shift, abs=1e-9)


@pytest.mark.parametrize("curve", CURVES)
def test_small_motions_are_those_of_exact(curve):
    """Without turning, the difference falls with the square of the load."""
    missed = []
    for load in (1.0, 0.5):
        ends = {}
        for model in ("exact", "linear"):
            data = rotor(curve, model=model, rate=0.0, modulus=7.0e9)
            data["gravity"] = [0.0, 20.0 * load, -90.0 * load]
            data["joints"]["pin"]["type"] = "fixed"
            ends[model] = solved(data)[0][-1, :3]
        missed.append(np.abs(ends["linear"] - ends["exact"]).max())
    assert missed[0] > 1e-9
    assert missed[0] / missed[1] > 3.5


NOTHING = [0.0, 0.0, 0.0]
FORCE, MOMENT = (30.0, 20.0, 10.0), (0.5, 0.0, 0.0)


def clamped(model="linear", force=FORCE, moment=MOMENT, more="", length=1.0, **keys):
    section, material = "{shape: rectangle, width: 0.2, height: 0.1}", "youngs_modulus: 7.0e+9, poisson_ratio: 0.3"
    return cantilever(section, length, force, moment, material=material, more=f"model: {model}{more}", **keys)


def test_static_deflections_are_those_of_timoshenko():
    """Bending with shear about both axes, stretch and torsion."""
    scene = clamped()
    p = scene.deck.section_properties("b")
    x = at_rest(scene, 1.0)
    (k_y, k_z), (I_y, I_z) = p.shear_stiffness, p.bending_stiffness
    expected = [30.0 / p.axial_stiffness, 20.0 * (1 / (3 * I_z) + 1 / k_y), 10.0 * (1 / (3 * I_y) + 1 / k_z)]
    assert displacement(scene, x) == pytest.approx(expected, rel=1e-5)
    d3 = scene.marker("b.tip").axes(x)[0, 2]
    assert -d3[1] == pytest.approx(0.5 / p.torsion_stiffness, rel=1e-3)


@pytest.mark.parametrize("more", ["", ", axis: {arc: {radius: 1.0, angle: 1.2}}, twist: 0.5"])
def test_rigid_beams_tell_how_their_forces_would_deform_them(more):
    """Under weight and loads, at rest, it is what linear says: tip, and shape to go over to."""
    force, moment = (30.0, -20.0, 10.0), (3.0, 5.0, -2.0)
    length = None if more else 1.0
    scene = clamped("linear", force, moment, more, length, gravity=[0.2, 0.4, -0.3])
    check_told_at_rest(scene, force, moment)


@pytest.mark.parametrize("curve", CURVES)
def test_rigid_beams_have_the_inertia_of_their_sections(curve):
    """The same energies as the flexible beam's nodes have when that moves as a rigid body."""
    check_inertia_of_rigid(lambda model: rotor(curve, model=model))


@pytest.mark.parametrize("gamma", [pytest.param(1, marks=pytest.mark.slow), 5])
def test_frequencies_of_a_rotating_blade(gamma):
    """Cases S3 to S5: exact follows the stiffening, linear loses it."""
    exact = frequencies(spectrum("exact", gamma, 700.0, loaded=True, element="cosserat"))
    assert off(exact, FLAP[gamma]) < 2e-4
    assert off(exact, LAG[gamma]) < 2e-4
    linear = spectrum("linear", gamma, 70.0, element="cosserat")
    assert off(frequencies(linear), AT_REST) < 2e-4
    if gamma in GROWTH_LINEAR:
        assert off(linear.real[np.abs(linear.imag) < 1e-6], GROWTH_LINEAR[gamma]) < 5e-3


def test_the_model_that_a_motion_needs_is_chosen():
    data = rotor(model="auto", modulus=2.0e10, rate=5.0, duration=0.3, tolerance=1.0e-7)
    data["gravity"] = NOTHING
    data["loads"] = {"spin": {"type": "moment", "at": "hub", "moment": [0.0, 0.0, 60.0]}}
    chosen, told = solved(data)
    exact, _ = solved({**data, "solve": {**data["solve"], "model": "exact"}})
    assert told.statistics["auto"]["switches"]
    assert chosen[:, :3] == pytest.approx(exact[:, :3], abs=5e-3)


@pytest.mark.parametrize("curve", CURVES)
def test_what_takes_over_goes_on_in_the_same_place_with_the_same_forces(curve):
    data = rotor(curve, model="rigid", modulus=2.0e10, rate=5.0, duration=0.3)
    data["loads"] = {"spin": {"type": "moment", "at": "hub", "moment": [3.0, 1.0, 10.0]}}
    check_takeover(data)


def test_internal_forces_of_linear_hold_the_load_where_it_is():
    """Of a static load at the tip, in the axes of the undeformed sections: what the clamp bears too."""
    scene = clamped(moment=(5.0, 0.0, 0.0))
    x, force, places = at_rest(scene, 1.0), np.array([30.0, 20.0, 10.0]), [0.0, 0.5]
    found = inside(scene, x, places)
    for place, row in zip(places, found, strict=True):
        points = [scene.bodies["b"].marker((a, 0.0, 0.0)).position(x)[0] for a in (1.0, place)]
        moment = np.add(np.cross(points[0] - points[1], force), [5.0, 0.0, 0.0])
        assert row == pytest.approx([*force, *moment], rel=1e-7)
    assert found[0] == pytest.approx([30.0, 20.0, 10.0, 5.0, -10.0, 20.0], rel=1e-3)


def test_replaced_axes_matter(rng):
    """Were the root's axes forgotten, the force would not be that of the energy: see the first test."""
    _, body, x = moved_scene(rng, "straight")
    wrong = replace(body.elastic, axes=np.eye(3))
    assert np.abs(wrong.displacements(x[None]) - body.elastic.displacements(x[None])).max() > 0.1
