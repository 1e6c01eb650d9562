"""Vibrations that ask for steps and show nowhere are named, with what a looser tolerance saves."""

import math

import pytest

from hfsim.output.report import ringing_words
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

HUMMING = """hfsim: 1
ground: {points: {far: [2.0, 0.0]}}
bodies:
  slow: {type: rigid, mass: 1.0, inertia: 1.0}
  fast: {type: rigid, mass: 0.01, inertia: 1.0}
springs:
  soft: {type: two_point, between: [ground, slow], stiffness: 40.0, rest_length: 0.9}
  weak: {type: two_point, between: [slow, fast], stiffness: 1.0, rest_length: 0.5}
  hard: {type: two_point, between: [fast, ground.far], stiffness: 1.0e5, rest_length: 0.5}
initial:
  slow: {position: [1.0, 0.0]}
  fast: {position: [1.50001, 0.0]}
solve: {duration: 1.0, method: gauss, stages: 8}
output: {channels: [slow.x, slow.vx]}
"""


def test_a_vibration_that_no_output_shows_is_named():
    found = simulate(parse_deck(HUMMING), error_estimate=False, diagnosis=True).statistics["ringing"]
    assert found["frequency"] == pytest.approx(math.sqrt(1.0e5 / 0.01) / (2.0 * math.pi), rel=1e-3)
    assert found["item"] == "bodies.fast"
    assert found["fewer_steps"] > 3.0
    assert found["change"] < 1e-3
    words = ringing_words(found)
    assert "503 Hz" in words and "solve.tolerance=0.0001" in words and "bodies.fast" in words


def test_without_output_of_motions_the_change_is_that_of_what_there_is():
    rate = parse_deck(HUMMING, "deck", ["output.channels=[slow.vx]"])
    found = simulate(rate, error_estimate=False, diagnosis=True).statistics["ringing"]
    assert found["channel"] == "slow.vx"


def test_a_vibration_that_an_output_shows_is_not():
    shown = ["output.channels=[fast.x]", "springs.hard.rest_length=0.45", "solve.duration=0.4"]
    deck = parse_deck(HUMMING, "deck", shown)
    assert simulate(deck, error_estimate=False, diagnosis=True).statistics.get("ringing") is None


DRIVEN = """hfsim: 1
bodies: {b: {type: rigid, mass: 2.0, inertia: 0.3, points: {p: [-0.4, 0.0]}}}
joints:
  h: {type: revolute, between: [ground, b.p]}
  d: {type: driver, between: [ground, b.p], angle: {type: sine, amplitude: 0.5, frequency: 1.5}}
solve: {duration: 1.0, method: generalized_alpha}
"""


def test_nothing_vibrates_where_nothing_is_free():
    found = simulate(parse_deck(DRIVEN), error_estimate=False, diagnosis=True)
    assert found.status == "done" and found.statistics.get("ringing") is None
