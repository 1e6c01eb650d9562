"""Damped, spinning beams: corrections go along with their axes, and steps follow the motion."""

from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

ROTOR = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {alu: {density: 2700, youngs_modulus: 70 GPa, axial_damping: 1.0e-3}}
sections: {strip: {shape: rectangle, width: 5 cm, height: 2 mm}}
bodies: {arm: {type: beam, material: alu, section: strip, length: 1.0, elements: 2, degree: 5}}
joints: {axle: {type: revolute, between: [ground, arm.root]}}
initial: {arm: {angular_velocity: 15.0}}
solve: {duration: 0.3, method: radau}
output: {plots: false, channels: [arm.tip.x, arm.tip.y]}
"""


def test_stiff_damping_along_a_turning_beam_costs_no_steps():
    """What the turn makes of the damping's derivative is no change in axes that turn along."""
    run = simulate(parse_deck(ROTOR), error_estimate=False)
    assert run.status == "done"
    assert run.statistics["newton_iterations"] < 250
