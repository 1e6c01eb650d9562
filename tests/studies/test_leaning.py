"""Modes of leaning tops and wheels, which turn by themselves too, and of what turns far off."""

import numpy as np
import pytest

import hfsim
from hfsim.scene.loading import parse_deck

MASS, ARM, ACROSS, ALONG, WEIGHT = 2.0, 0.3, 0.05, 0.02, 2.0 * 9.81 * 0.3
INERTIA = ACROSS + MASS * ARM**2


def nutation_of(tilt, precession, own, along=ALONG, across=INERTIA, weight=WEIGHT):
    """Circular frequency of a top that turns by itself at a rate in all and precesses steadily.

    A th'' = A p^2 sin cos - C w p sin + W sin, with p as the momentum about the vertical keeps it.
    """
    sine, cosine = np.sin(tilt), np.cos(tilt)
    slope = (along * own - 2.0 * precession * across * cosine) / (across * sine)
    bent = across * precession**2 * (cosine**2 - sine**2) - (along * own * precession - weight) * cosine
    return np.sqrt(-(bent + slope * (2.0 * across * precession * cosine - along * own) * sine) / across)


def swings(found):
    return [2.0 * np.pi * mode.frequency for mode in found if mode.kind == "vibration"]


SPUN = """hfsim: 1
gravity: [0, 0, 0]
bodies: {b: {type: rigid, mass: 1.0, inertia: INERTIA}}
initial: {b: {position: [FAR, 0.0, 0.0], velocity: VELOCITY, angular_velocity: RATES}}
solve: {duration: 1.0}
"""


def spun(far, inertia, rates, velocity=(0.0, 0.0, 0.0)):
    text = SPUN.replace("FAR", repr(far)).replace("VELOCITY", str(list(velocity)))
    return hfsim.modes(parse_deck(text.replace("INERTIA", str(inertia)).replace("RATES", str(rates))))


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (50.0, 2.0, 3.0)])
@pytest.mark.parametrize("far", [0.0, 10.0, 2000.0, 1.0e6])
def test_modes_are_the_same_wherever_a_free_body_is_and_however_it_flies(far, velocity):
    """Next to a turn about a far origin, that of a small body was rounding: it grew, or was none."""
    found = spun(far, [0.002, 0.003, 0.004], [0.0, 0.0, 3.75], velocity)
    assert swings(found) == pytest.approx([3.75 * np.sqrt(2.0 * 1.0 / (2.0 * 3.0))], rel=1e-9)
    assert [mode.kind for mode in found].count("rigid") == 5 and found.steady
    nutating = spun(far, [0.003, 0.003, 0.004], [1.0, 0.0, 3.75], velocity)
    assert nutating.steady and nutating.about.turning.spin == pytest.approx([1.0, 0.0, 5.0], rel=1e-9)
    assert nutating.about.turning.own == {"b": pytest.approx(-1.25, rel=1e-9)}


@pytest.mark.parametrize("inertia", [1.0e-3, 1.0e-6, 1.0e-9])
def test_small_balls_on_strings_swing_as_conical_pendulums(inertia):
    """A ball is no round body with an axis, however little beside its arm rounding leaves of it."""
    rate, tilt = float(np.sqrt(9.81 / np.cos(0.8))), np.pi - 0.8
    text = f"""hfsim: 1
gravity: [0, 0, -9.81]
bodies: {{b: {{type: rigid, mass: 1.0, inertia: {[inertia] * 3}, points: {{t: [0, 0, 1.0]}}}}}}
joints: {{p: {{type: spherical, between: [ground, b.t]}}}}
initial: {{b: {{orientation: {{axis: [0, 1, 0], angle: -0.8}}, angular_velocity: [0, 0, {rate!r}]}}}}
solve: {{duration: 1.0}}
"""
    for state in ("start", "steady"):
        found = hfsim.modes(parse_deck(text), about=state)
        assert np.abs(found.about.turning.spin - [0.0, 0.0, rate]).max() < 1e-9 * rate
        (swing,) = swings(found)
        expected = nutation_of(tilt, rate, rate * np.cos(tilt), inertia, 1.0 + inertia, 9.81)
        assert swing == pytest.approx(expected, rel=1e-9 + 1e-15 / inertia)


def test_a_ball_that_is_tilted_while_it_spins_goes_on():
    """It was called a drift, which a damper would end."""
    kinds = [mode.kind for mode in spun(0.7, [0.001, 0.001, 0.001], [0.0, 0.0, 3.75])]
    assert kinds == ["rigid"] * len(kinds)
