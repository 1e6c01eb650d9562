"""Models rigid, linear and auto of fully parameterised beams in space, and what damps the model linear."""

import numpy as np
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
from cantilevers import at_rest, cantilever, inside
from solved import parsed, solved

from hfsim.parts.elements.forces import MaterialDamping
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

ROTOR = """
hfsim: 1
gravity: [0.0, 1.0, -9.81]
materials:
  stuff:
    {density: 2700.0, youngs_modulus: 7.0e+9, poisson_ratio: 0.3, axial_damping: 0.0001,
     bending_damping: 0.0003}
sections: {bar: {shape: rectangle, width: 0.06, height: 0.03}}
bodies:
  hub: {type: rigid, mass: 3.0, inertia: [0.1, 0.1, 0.15], points: {rim: [0.2, 0.0, 0.0]}}
  b1: {type: beam, element: continuum, section_degree: 2, material: stuff, section: bar,
       length: 1.2, elements: 2}
joints:
  pin: {type: revolute, between: [ground, hub]}
  clamp: {type: fixed, between: [hub.rim, b1.root]}
initial: {hub: {angular_velocity: [0.0, 0.0, 3.0]}}
solve: {model: linear, duration: 0.1, tolerance: 1.0e-8}
output: {interval: 0.02, channels: [b1.tip.x, b1.tip.y, b1.tip.z]}
"""
PLANAR = """
hfsim: 1
materials: {stuff: {density: 2700.0, youngs_modulus: 7.0e+9, axial_damping: 1.0e-4, bending_damping: 3.0e-4}}
sections: {bar: {shape: rectangle, width: 0.06, height: 0.03}}
bodies: {b1: {type: beam, element: ELEMENT, material: stuff, section: bar, length: 1.2, elements: 2}}
solve: {model: linear, duration: 0.1}
"""


def rotor(model="linear", **keys):
    data = yaml.safe_load(ROTOR)
    data["solve"]["model"] = model
    return {**data, **keys}


def elastic(scene):
    return next(part for part in scene.system.forces if hasattr(part, "stiffness"))


def test_force_is_the_derivative_of_its_energy(rng):
    scene = build(parsed(rotor()))
    x = scene.system.absolute(scene.q[None])[0]
    check_force_of_energy(elastic(scene), x + 0.05 * rng.normal(size=x.shape), rng)


def test_no_rigid_motion_is_resisted_nor_caused(rng):
    scene = build(parsed(rotor()))
    check_rigid_motions(scene.bodies["b1"], elastic(scene), scene.system.absolute(scene.q[None])[0], rng)


@pytest.mark.parametrize("element", ["cable", "continuum", "spatial"])
def test_damping_of_the_undeformed_beam_is_that_of_exact(rng, element):
    """Of axial strain and of bending, whatever the element."""
    text = yaml.safe_dump(rotor()) if element == "spatial" else PLANAR.replace("ELEMENT", element)
    scenes = [build(parse_deck(text), models={"b1": model}) for model in ("linear", "ancf")]
    x = scenes[0].system.absolute(scenes[0].q[None])
    u, out = rng.normal(size=x.shape), np.zeros((2, *x.shape))
    elastic(scenes[0]).add_force(np.zeros(1), x, u, out[0])
    own = next(part for part in scenes[1].system.forces if isinstance(part, MaterialDamping))
    own.add_force(np.zeros(1), x, u, out[1])
    assert own.power(np.zeros(1), x, u)[0] < 0.0
    assert out[0] == pytest.approx(out[1], abs=1e-8 * np.abs(out[1]).max())


def bar(model, force=FORCE, moment=MOMENT):
    more = f"element: continuum, section_degree: 3, model: {model}"
    material = "youngs_modulus: 7.0e+9, poisson_ratio: 0.0"
    section = "{shape: rectangle, width: 0.2, height: 0.1}"
    return cantilever(section, 1.0, force, moment, 3, 4, material, more)


def test_static_deflections_of_small_loads_are_those_of_exact():
    """The difference falls with the square of the load."""
    check_small_loads(bar, 400.0)


def test_internal_forces_are_those_of_the_load():
    scene = bar("linear", moment=(0.5, 0.0, 0.0))
    x = at_rest(scene, 1.0)
    found = inside(scene, x, [0.0, 0.5])
    assert found[0] == pytest.approx([30.0, 20.0, 10.0, 0.5, -10.0, 20.0], rel=2e-3)
    assert found[1] == pytest.approx([30.0, 20.0, 10.0, 0.5, -5.0, 10.0], rel=2e-3)
    arm = np.subtract(*(scene.marker(point).position(x)[0] for point in ("b.tip", "b.root")))
    assert found[0, 3:] == pytest.approx(np.add(np.cross(arm, [30.0, 20.0, 10.0]), [0.5, 0.0, 0.0]), rel=1e-6)


def test_rigid_beams_tell_how_their_forces_would_deform_them():
    """At rest it is what linear says, stretch, bending, shear and torsion: tip, and shape to go over to."""
    seen, expected = check_told_at_rest(bar("linear"), FORCE, MOMENT, 0.02)
    shear_modulus, polar = 3.5e9, 0.2 * 0.1 * (0.2**2 + 0.1**2) / 12.0
    assert seen.sections[0, -1, 3] == pytest.approx(0.5 / (shear_modulus * polar), rel=1e-9)
    assert seen.elongation == pytest.approx(expected.elongation, rel=2e-3)


def test_rigid_beams_have_the_inertia_of_their_material():
    check_inertia_of_rigid(rotor)


def test_what_takes_over_goes_on_with_the_same_forces():
    spin = {"type": "moment", "at": "hub", "moment": [0.0, 0.0, 9.0]}
    check_takeover(rotor("rigid", loads={"spin": spin}))


def test_the_model_that_a_motion_needs_is_chosen():
    chosen, told = solved(rotor("auto"))
    exact = solved(rotor("exact"))[0]
    assert told.statistics["auto"]["switches"]
    assert chosen == pytest.approx(exact, abs=2e-3)
    stiff = rotor("auto")
    stiff["materials"]["stuff"] |= {"youngs_modulus": 7.0e13}
    assert not solved(stiff)[1].statistics["auto"]["switches"]
