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
