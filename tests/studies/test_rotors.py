"""Rotors on bearings: modes against matrices put together here, and bearings not alike all around."""

import numpy as np
import pytest

import hfsim
from hfsim.output.modes import campbell_text, state_warnings
from hfsim.scene.loading import parse_deck

ROTOR = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {pxa: [1, 0, 0.3], pya: [0, 1, 0.3], pxb: [1, 0, -0.5], pyb: [0, 1, -0.5], pz: [0, 0, 1.3]}}
bodies:
  rotor: {type: rigid, mass: 10, inertia: [0.1, 0.1, 0.18], points: {a: [0, 0, 0.3], b: [0, 0, -0.5]}}
  ring_a: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.02]}
  ring_b: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.02]}
joints:
  a: {type: revolute, between: [rotor.a, ring_a]}
  b: {type: revolute, between: [rotor.b, ring_b]}
springs:
  xa: {type: two_point, between: [ground.pxa, ring_a], stiffness: 1.0e5}
  ya: {type: two_point, between: [ground.pya, ring_a], stiffness: ACROSS}
  xb: {type: two_point, between: [ground.pxb, ring_b], stiffness: 1.0e5}
  yb: {type: two_point, between: [ground.pyb, ring_b], stiffness: ACROSS}
  z: {type: two_point, between: [ground.pz, ring_a], stiffness: 1.0e7}
initial:
  rotor: {position: [0, 0, 0], angular_velocity: [0, 0, 10]}
  ring_a: {position: [0, 0, 0.3], angular_velocity: [0, 0, 0]}
  ring_b: {position: [0, 0, -0.5], angular_velocity: [0, 0, 0]}
solve: {duration: 1.0}
"""


def whirls(across, rate):
    """Frequencies [Hz] of a stiff rotor whose bearing rings do not turn, from slow to fast."""
    mass, stiffness = np.diag([10.0, 10.0, 0.1, 0.1]), np.zeros((4, 4))
    for place in (0.3, -0.5):  # shifts x and y and tilts about x and y make displacements of a ring
        x, y = np.array([1.0, 0.0, 0.0, place]), np.array([0.0, 1.0, -place, 0.0])
        mass += np.outer(x, x) + np.outer(y, y) + np.diag([0.0, 0.0, 0.01, 0.01])
        stiffness += 1.0e5 * np.outer(x, x) + across * np.outer(y, y)
    gyroscopic = np.zeros((4, 4))
    gyroscopic[2, 3], gyroscopic[3, 2] = 0.18 * rate, -0.18 * rate
    parts = [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, gyroscopic)]
    values = np.linalg.eigvals(np.block([[np.zeros((4, 4)), np.eye(4)], parts]))
    return np.sort(values.imag[values.imag > 0.0]) / (2.0 * np.pi)


@pytest.mark.parametrize("across", [1.0e5, 2.0e4])
def test_rotors_in_rings_that_do_not_turn_whirl_as_their_matrices_say(across):
    rates = [10.0, 100.0, 400.0]
    found = hfsim.campbell(parse_deck(ROTOR.replace("ACROSS", str(across))), rates, count=7)
    for rate, modes in zip(rates, found.founds, strict=True):
        seen = [mode.frequency for mode in modes if mode.kind == "vibration" and mode.frequency < 100.0]
        assert np.sort(seen) == pytest.approx(whirls(across, rate), rel=1e-9)
    assert not found.facts()["unsteady_rates"]
    assert "seen from axes at rest" in campbell_text(found, "")


PLATE = """hfsim: 1
gravity: [0, 0]
ground: {points: {px: [1, 0], py: [0, 1]}}
bodies: {plate: {type: rigid, mass: 2.0, inertia: 0.3}}
springs:
  x: {type: two_point, between: [ground.px, plate], stiffness: 800.0, damping: 3.0}
  y: {type: two_point, between: [ground.py, plate], stiffness: 800.0, damping: 3.0}
initial: {plate: {position: [0, 0], angular_velocity: 5.0}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("", ""),
        ("py, plate], stiffness: 800.0", "py, plate], stiffness: 799.0"),
        ("py, plate], stiffness: 800.0, damping: 3.0", "py, plate], stiffness: 800.0, damping: 3.1"),
    ],
    ids=["even", "stiffness", "damping"],
)
def test_bearings_that_are_not_alike_all_around_are_told(old, new):
    """The coefficients in axes that turn change with time: there are no frequencies there."""
    found = hfsim.modes(parse_deck(PLATE.replace(old, new)))
    assert found.about.lasting and found.about.axes_turn
    assert found.uneven is bool(new) and found.facts()["about"]["steady"] is not bool(new)
    assert any("not alike all around" in " ".join(one.split()) for one in state_warnings(found)) is bool(new)
    if not new:
        # in axes at rest both are 2 s^2 + 3 s + 800
        s = -0.75 + 1j * np.sqrt(400.0 - 0.75**2)
        seen = [mode.value for mode in found if mode.kind == "vibration"]
        assert np.sort(np.imag(seen)) == pytest.approx(np.imag([s - 5j, s + 5j]), rel=1e-9)
        assert np.real(seen) == pytest.approx(-0.75, rel=1e-9)


GUIDED = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {there: [1, 0, 0]}}
materials: {steel: {density: 7800, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}
sections: {round: {shape: circle, diameter: 0.02}}
bodies:
  shaft: {type: beam, material: steel, section: round, length: 1.0, elements: 2}
  ring: {type: rigid, mass: 0.2, inertia: [2.0e-4, 1.0e-4, 1.0e-4]}
joints:
  left: {type: spherical, between: [ground, shaft.root]}
  right: {type: spherical, between: [shaft.tip, ring]}
  guide: {type: prismatic, between: [ground.there, ring], axis: [1, 0, 0]}
initial: {shaft: {angular_velocity: [10, 0, 0]}, ring: {angular_velocity: [0, 0, 0]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("across", [False, True])
def test_guides_across_a_shaft_that_turns_are_told(across):
    """A joint along the axis holds the same at every angle; one across it lets go of another direction."""
    axis = "axis: [0, 1, 0]}" if across else "axis: [1, 0, 0]}"
    found = hfsim.modes(parse_deck(GUIDED.replace("axis: [1, 0, 0]}", axis)), count=5)
    assert found.about.axes_turn and found.about.lasting
    assert found.about.unevenness == 0.0 and found.uneven is across
