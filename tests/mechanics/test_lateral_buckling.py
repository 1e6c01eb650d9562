"""A plate on edge that a crank pushes beyond where it gives way sideways (Bauchau and others 2016)."""

import numpy as np
import pytest

from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

PLATE = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
parameters: {aside: 0.1 mm}
ground: {points: {axle: [0.95, -0.25, "${aside}"]}}
materials: {alu: {density: 2700.0, youngs_modulus: 73 GPa, poisson_ratio: 0.3}}
sections:
  deep: {shape: rectangle, height: 0.1, width: 0.01}
  link: {shape: circle, diameter: 0.024}
  crank: {shape: circle, diameter: 0.048}
bodies:
  plate: {type: beam, material: alu, section: deep, length: 1.0, elements: 2, degree: 6,
          points: {mid: [0.5, 0, 0], aside: [1.0, 0, "${aside}"]}}
  link: {type: beam, material: alu, section: link, length: 0.25, elements: 1, degree: 4}
  crank: {type: beam, material: alu, section: crank, length: 0.05, elements: 1, degree: 3}
joints:
  clamp: {type: fixed, between: [ground, plate.root]}
  ball: {type: spherical, between: [plate.aside, link.root]}
  pin: {type: revolute, between: [link.tip, crank.tip]}
  axle: {type: revolute, between: [ground.axle, crank.root]}
  motor: {type: driver, between: [ground.axle, crank.root],
          angle: {expression: "-pi * (1 - cos(pi * t / 0.4)) / 2"}}
initial: {link: {angle: -90 deg}, crank: {angle: 0.0}}
solve: {duration: 0.3, tolerance: 1.0e-6}
output: {interval: 0.01, channels: [plate.mid.z, plate.tip.y]}
"""


def aside(*settings):
    run = simulate(parse_deck(PLATE, "plate.yaml", settings), error_estimate=False)
    assert run.status == "done" and run.statistics["energy_drift"] < 1e-6
    return run["plate.mid.z"]


@pytest.mark.slow
def test_a_plate_snaps_aside_where_its_load_leans_whatever_the_mesh():
    """Published are curves alone. It is straight to 0.1 s, and 55 mm aside at 0.2 s."""
    here = aside()
    assert np.abs(here[:11]).max() < 2e-4 and here.min() == pytest.approx(-0.0546, abs=2e-4)
    assert aside("bodies.plate.elements=4", "bodies.plate.degree=4") == pytest.approx(here, abs=1e-5)
    assert aside("parameters.aside=-1e-4") == pytest.approx(-here, abs=1e-5)
