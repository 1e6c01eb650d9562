"""The energy drift of runs that end their steps at rest, do not move at all, or lose energy."""

import pytest

from hfsim.run.balance import balance, step_samples
from hfsim.run.integration import run_integration
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

ROTOR = """
hfsim: 1
bodies: {rotor: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {axle: {type: revolute, between: [ground, rotor]}}
springs: {coil: {type: rotational, between: [ground, rotor], stiffness: 39.47841760435743}}
initial: {rotor: {angle: 0.5}}
solve: {duration: 1.0, method: gauss, step: 0.5, stages: 16}
"""
RESTING = """
hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 4}}
joints: {pin: {type: revolute, between: [ground, b1.root]}}
initial: {b1: {angle: 0.7}}
solve: {duration: 1.0}
"""


def drift(deck, *overrides):
    scene = build(parse_deck(deck, "deck", overrides))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    return balance(scene.system, step_samples(done.trajectory))["energy_drift"]


def test_a_swing_whose_steps_end_at_rest_has_the_energy_of_its_middle():
    """Two steps of half a period: at all their ends the kinetic energy is zero, the spring fully wound."""
    assert drift(ROTOR) < 1e-13


@pytest.mark.parametrize("elements", [1, 4, 16])
@pytest.mark.parametrize("model", ["exact", "ancf", "linear"])
def test_a_scene_at_rest_does_not_drift(elements, model):
    assert drift(RESTING, f"bodies.b1.elements={elements}", f"solve.model={model}") < 1e-4


@pytest.mark.parametrize("angle", [0.5, 1e-6])
def test_energy_that_is_lost_is_told_however_small_the_motion(angle):
    lossy = ["solve.method=radau", "solve.stages=1", "solve.step=0.01"]
    assert drift(ROTOR, f"initial.rotor.angle={angle}", *lossy) > 0.1
