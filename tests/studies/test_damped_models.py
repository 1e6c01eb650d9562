"""Growth rates of damped beams in all models: those of the material, at every angle of a scene."""

import numpy as np
import pytest
import yaml

import hfsim
from hfsim.mechanics.small_motions import resistance
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

TAU = 1e-4
"""Retardation time of stretch and bending [s]: a vibration of the frequency w decays at TAU w^2 / 2."""
STRIP = yaml.safe_load("""
hfsim: 1
gravity: [0, 0, -9.81]
materials:
  alu: {density: 2700, youngs_modulus: 7.0e10, axial_damping: 1.0e-4, bending_damping: 1.0e-4}
sections: {flat: {shape: rectangle, width: 2 mm, height: 20 mm}, round: {area: 4.0e-5, second_moment: 1.3e-9}}
bodies:
  h: {type: rigid, mass: 1.0, inertia: [0.02, 0.03, 0.04], points: {p: [0.1, 0.02, 0.03]}}
  b: {type: beam, material: alu, section: flat, length: 0.7, elements: 3, degree: 3}
joints:
  a: {type: fixed, between: [ground, h]}
  w: {type: fixed, between: [h.p, b.root]}
solve: {model: linear, duration: 1.0}
""")
BLADE = {
    "gravity": [0.0, 0.0, 0.0],
    "joints.a": {"type": "revolute", "between": ["ground", "h"]},
    "joints.w.orientation": {"rotation_vector": [0.0, -0.6, 0.5]},
    "initial.steady": {"body": "h", "rate": 9.6},
}
PLANAR = {
    "bodies.h.inertia": 0.04,
    "bodies.h.points": {"p": [0.1, 0.02]},
    "sections.flat": {"shape": "rectangle", "width": "20 mm", "height": "2 mm"},
    "joints.w.orientation": None,
    "joints.w.angle": 0.6,
}
CABLE = {"bodies.b.element": "cable"}


def turned(angle, about, model, changes):
    """The modes of a copy of a scene that stands at an angle."""
    where = {"initial.h.angle": angle} if about == "steady" else {"joints.a.angle": angle}
    return hfsim.modes(STRIP, {**changes, **where, "solve.model": model}, about=about, count=4)


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
@pytest.mark.parametrize("plane", [False, True])
def test_a_sagging_strip_is_damped_as_its_material_is(plane, model):
    changes = {**PLANAR, "gravity": [0.0, -1.0], "joints.w.angle": 0.0} if plane else {}
    for angle in (0.0, 0.5):
        slow = turned(angle, "equilibrium", model, changes)[1]
        assert slow.growth == pytest.approx(-0.5 * TAU * abs(slow.value) ** 2, rel=5e-3)


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
@pytest.mark.parametrize(
    "changes",
    [{}, {**PLANAR, "gravity": [0.0, 0.0]}, {**CABLE, "bodies.b.section": "round"}],
    ids=["space", "plane", "cable"],
)
def test_a_damped_blade_has_one_growth_rate_at_all_angles_of_its_hub(changes, model):
    copies = [turned(angle, "steady", model, {**BLADE, **changes}) for angle in (0.0, 1e-9, 0.5)]
    values = np.array([[mode.value for mode in copy.modes[:3]] for copy in copies])
    assert np.ptp(values.real, axis=0) == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(values.imag, axis=0) == pytest.approx(0.0, abs=1e-6)
    assert not any(copy.uneven or copy.unstable for copy in copies)


def test_the_resistance_of_a_cable_of_variable_mass_is_no_other_at_rates_next_to_none(rng):
    """Steps of rates do not become as short as the rates."""
    changes = ["bodies.b.element=cable", "bodies.b.section=round", "solve.model=lowOrder"]
    deck = parse_deck(yaml.safe_dump(STRIP), overrides=changes)
    system, t = (scene := build(deck)).system, np.zeros(1)
    x = system.absolute(scene.q[None]) + 1e-2 * rng.normal(size=(1, system.n_x))
    still, slow = (resistance(system, t, x, rate * rng.normal(size=x.shape)) for rate in (0.0, 1e-9))
    assert slow == pytest.approx(still, abs=1e-8 * np.abs(still).max())


def test_a_cable_is_known_as_well_in_the_model_linear_as_in_exact():
    """Stiff parts of its force leave no trace in differences of others."""
    changes = {**BLADE, **CABLE, "bodies.b.section": "round"}
    linear, exact = (turned(0.5, "steady", model, changes)[2] for model in ("linear", "exact"))
    assert linear.uncertainty < 3.0 * exact.uncertainty
