"""What estimated errors are relative to: ranges of channels however small, but those of rounding."""

import numpy as np

import hfsim
from hfsim.scene.loading import parse_deck

STIFF = """hfsim: 1
gravity: [0.0, {gravity}]
materials: {{steel: {{density: 7800.0, youngs_modulus: 2.1e11}}}}
sections: {{s: {{shape: rectangle, width: 50 mm, height: 50 mm}}}}
bodies: {{b: {{type: beam, material: steel, section: s, length: 0.5, elements: 2}}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
solve: {{duration: 0.5, tolerance: 1.0e-2}}
output: {{channels: [b.tip.x, {channel}]}}
"""


def test_small_ranges_count_beside_large_ones():
    """A deflection of micrometres is as wrong beside metres as it is alone."""
    deck = STIFF.format(gravity=-9.81, channel="b.tip.deflection")
    run, fine = (hfsim.run(parse_deck(deck), {"solve.tolerance": tolerance}) for tolerance in (1e-2, 1e-8))
    true = np.abs(run["b.tip.deflection"] - fine["b.tip.deflection"]).max() / np.ptp(fine["b.tip.deflection"])
    assert 0.05 < true < 5.0 * run.statistics["error_estimate"]


def test_forces_that_are_rounding_are_no_errors():
    run = hfsim.run(parse_deck(STIFF.format(gravity=0.0, channel="b.root.axial_force")))
    assert run.statistics["error_estimate"] < 1e-6 and not run.statistics["warnings"]


SLIDING = """hfsim: 1
gravity: [0.0, -9.81]
materials: {soft: {density: 1200, youngs_modulus: 1.0e8, axial_damping: 5.0e-4, bending_damping: 1.0e-3}}
sections: {round: {shape: circle, diameter: 2.5 cm}}
bodies:
  arm: {type: beam, material: soft, section: round, length: 0.6, elements: 2, element: cosserat, degree: 2}
joints: {hold: {type: prismatic, between: [ground, arm.root], axis: [-0.98, 0.2], angle: -0.7}}
solve: {duration: 0.25, model: linear}
output: {channels: [arm.tip.y, arm.angular_acceleration]}
"""


def test_accelerations_that_are_rounding_are_no_errors():
    """A slider does not turn; a stiff bar that a servo holds up neither, nor does it shift."""
    sliding = hfsim.run(parse_deck(SLIDING)).statistics
    assert sliding["error_estimate"] < 1e-6 and sliding["mesh_error_estimate_channel"] == "arm.tip.y"
    holding = [
        "joints.hold={type: servo, between: [ground, b.root], angle: 0.3, stiffness: 1.0e6, damping: 1.0e4}",
        "initial={equilibrium: true}",
    ]
    standing = STIFF.format(gravity=-9.81, channel="b.angular_acceleration, b.tip.ay")
    found = hfsim.run(parse_deck(standing, overrides=holding), {"solve.tolerance": 1e-4}).statistics
    assert max(found["error_estimate"], found["mesh_error_estimate"]) < 1e-4 and not found["warnings"]
