"""Internal forces with closed forms of motion: a rod that spins steadily, and the root of a pendulum."""

import numpy as np
import pytest
from turning import Turning

from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

ROD = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {{stuff: {{density: 1000.0, youngs_modulus: 1.0e6, poisson_ratio: 0.3}}}}
sections: {{bar: {{shape: circle, radius: 0.02}}}}
bodies: {{b: {{type: beam, material: stuff, section: bar, length: 1.0, elements: {elements}, degree: {degree}, {more}}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
solve: {{duration: 1.0, model: ancf}}
"""  # noqa: E501
SPIN, PLACES = 20.0, np.linspace(0.0, 1.0, 21)


def tension_error(elements, degree, more):
    """The largest error of the tension over that at the root.

    Of a rod whose stress is linear in its stretch: E A X'' + rho A w^2 X = 0, X(0) = 0, X'(L) = 1 at the free
    end, so N = E A (cos(k x) / cos(k L) - 1) with k^2 = rho w^2 / E.
    """
    scene = build(parse_deck(ROD.format(elements=elements, degree=degree, more=more)))
    body, x = scene.bodies["b"], Turning(scene, (0.0, 0.0, SPIN)).x
    found = body.section_forces(x, 0.0 * x, PLACES)[0]
    k, EA = SPIN * np.sqrt(1000.0 / 1e6), 1e6 * np.pi * 0.02**2
    expected = EA * (np.cos(k * PLACES) / np.cos(k) - 1.0)
    assert found[:, 1:] == pytest.approx(0.0, abs=1e-8 * expected[0])
    return np.abs(found[:, 0] - expected).max() / expected[0]


LINE = "element: cable, strain: engineering, curvature: exact"


@pytest.mark.parametrize(
    ("more", "degree", "order"),
    [*((LINE, p, p - 2) for p in (3, 4, 5)), *(("element: cosserat", p, p) for p in (2, 3))],
)
def test_the_tension_of_a_spinning_rod_converges(more, degree, order):
    """With the power degree - 2 of the length of cable elements, and degree of those with sections."""
    errors = [tension_error(n, degree, more) for n in (2, 4, 8)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize(("more", "elements"), [(LINE, 8), ("element: cosserat", 2)])
def test_the_tension_of_a_spinning_rod_is_that_of_the_closed_form(more, elements):
    assert tension_error(elements, 6, more) < 1e-6


PENDULUM = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {{stuff: {{density: 1100.0, youngs_modulus: 5.0e7, axial_damping: 0.01, bending_damping: 0.01}}}}
sections: {{strip: {{shape: rectangle, width: 0.05, height: 0.02}}}}
bodies: {{b: {{type: beam, material: stuff, section: strip, length: 1.0, elements: {elements}, {more}}}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
solve: {{duration: 0.2, tolerance: 1.0e-9}}
output:
  interval: 0.02
  channels: [pin.force_x, pin.force_y, b.angle, b.root.axial_force, b.root.shear_force]
"""


def root_error(elements, more):
    """How far the forces in the root are from what the joint exerts there, over its size."""
    run = simulate(parse_deck(PENDULUM.format(elements=elements, more=more)), error_estimate=False)
    fx, fy, angle, axial, shear = (channel.values for channel in run.channels)
    along = -(fx * np.cos(angle) + fy * np.sin(angle))
    across = fx * np.sin(angle) - fy * np.cos(angle)
    gap = np.hypot(axial - along, shear - across)
    return gap[6:].max() / np.hypot(fx, fy).max()


@pytest.mark.parametrize(
    ("more", "order"), [("degree: 3", 1), ("degree: 5", 4), ("element: cosserat, degree: 3", 4)]
)
def test_what_the_root_of_a_pendulum_bears_converges_to_its_reaction(more, order):
    errors = [root_error(n, more) for n in (2, 4, 8)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(order, abs=0.3)


def test_what_the_root_of_a_pendulum_bears_is_its_reaction():
    assert root_error(4, "element: cosserat, degree: 6") < 1e-6
