"""Watches end runs whose energy comes out of nothing; rounding at rest is no energy."""

import numpy as np
import pytest

import hfsim
from hfsim.errors import SolverFailure
from hfsim.marching.runaway import EnergyWatch
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

FREE = """hfsim: 1
materials: {soft: {density: 1000.0, youngs_modulus: 5.0e6}}
sections: {bar: {shape: rectangle, width: 0.03, height: 0.03}}
bodies:
  b1: {type: beam, length: 1.06, model: lowOrder, material: soft, section: bar}
  b2: {type: beam, length: 0.98, model: MODEL, material: soft, section: bar}
solve: {duration: 0.1}
"""
HINGED = f"""{FREE}
joints:
  pin: {{type: revolute, between: [ground, b1.root]}}
  elbow: {{type: revolute, between: [b1.tip, b2.root]}}
initial: {{b1: {{angle: -0.16}}, b2: {{angle: -0.48}}}}
loads:
  push:
    type: force
    at: b2.tip
    force: [0, 1]
    law: {{type: smooth_step, from: 0, to: 1, start: 0.05, end: 0.2}}
"""


@pytest.mark.parametrize("model", ["exact", "linear", "lowOrder"])
@pytest.mark.parametrize("scene", [FREE, HINGED], ids=["free", "hinged"])
def test_rounding_at_rest_is_no_energy_out_of_nothing(scene, model):
    run = simulate(parse_deck(scene.replace("MODEL", model)), error_estimate=False)
    assert run.status == "done", run.reason


def test_energy_out_of_nothing_is_told_at_rest_too():
    """A body of 0.9 kg that begins to move at a millimetre a second: 5e-7 J, and nothing has pushed it."""
    scene = build(parse_deck(FREE.replace("MODEL", "exact")))
    watch = EnergyWatch(scene.system)
    watch(0.0, scene.q, scene.v)
    rates = scene.v.copy()
    rates[scene.bodies["b1"].columns.start] = 1e-3
    with pytest.raises(SolverFailure, match="feeds energy that nothing supplies"):
        watch(0.1, scene.q, rates)


def test_energy_that_a_load_supplies_is_not_out_of_nothing():
    """A body of 0.954 kg that 1 N pushes from rest, at 300 states: what has been supplied is m v^2 / 2."""
    push = "loads: {push: {type: force, at: b1.root, force: [1, 0]}}"
    scene, mass = build(parse_deck(FREE.replace("MODEL", "exact") + push)), 1000.0 * 0.03**2 * 1.06
    watch, along = EnergyWatch(scene.system), np.zeros_like(scene.q)
    along[scene.bodies["b1"].columns.start] = 1.0 / mass
    for t in np.linspace(0.0, 3.0, 300):
        watch(t, scene.q + 0.5 * t**2 * along, t * along)


WOUND = """hfsim: 1
gravity: GRAVITY
materials: {rubber: {density: 1100, youngs_modulus: 5 MPa, poisson_ratio: 0.45, bending_damping: 0.05}}
sections: {round: {shape: circle, diameter: 3 cm}}
bodies:
  rod: {type: beam, element: cosserat, material: rubber, section: round, length: 1.0, elements: 2, degree: 1}
joints: {clamp: {type: fixed, between: [ground, rod.root]}}
loads: {wind: {type: moment, at: rod.tip, moment: MOMENT, law: {expression: "t"}}}
solve: {duration: 5.0, tolerance: 1.0e-4}
output: {channels: [rod.tip.x]}
"""


@pytest.mark.parametrize(("gravity", "moment"), [("[0, 0, 0]", "[2, 0, 0]"), ("[0, 0]", "2")])
def test_a_rod_wound_up_further_than_its_elements_can_follow_ends_the_run(gravity, moment):
    """It went on to 69 m of a rod of 1 m, with next to no strain energy."""
    deck = parse_deck(WOUND.replace("GRAVITY", gravity).replace("MOMENT", moment))
    run = hfsim.run(deck, error_estimate=False, check=False)
    assert run.status == "failed" and "one node to the next" in run.reason
    assert (run.failure["class"], run.failure["item"]) == ("model", "bodies.rod")
    assert "bodies.rod.elements=4" in run.failure["try"]
    assert max(abs(run["rod.tip.x"])) < 3.0


def test_rates_whose_square_is_no_number_end_a_run_as_others_do():
    law = "{expression: '1e200 * t'}"
    deck = f"""hfsim: 1
bodies: {{b: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{a: [-0.5, 0.0]}}}}}}
joints:
  j: {{type: revolute, between: [ground, b.a]}}
  d: {{type: driver, between: [ground, b.a], angle: {law}}}
solve: {{duration: 0.3}}
"""
    run = simulate(parse_deck(deck), error_estimate=False)
    assert run.status == "failed" and "OverflowError" not in run.reason
