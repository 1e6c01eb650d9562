"""Steps of beams of the model linear: in their frames while these have few coordinates, else not."""

import numpy as np
import pytest

import hfsim
from hfsim.marching.integration import run_integration
from hfsim.parts.bodies.linear import PlanarLinearBeam
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import CASES
from hfsim.scene.stepping import MANY

PAIR = """
hfsim: 1
materials: {rubber: {density: 5540.0, youngs_modulus: 1.0e6}}
sections: {strip: {shape: rectangle, width: 0.2, height: 0.02}}
bodies:
  a: {type: beam, material: rubber, section: strip, length: 0.6, elements: 9}
  b: {type: beam, material: rubber, section: strip, length: 0.7, elements: 9}
joints:
  one: {type: revolute, between: [ground, a.root]}
  other: {type: revolute, between: [ground, b.root]}
solve: {model: linear, duration: 0.3}
output: {channels: [a.tip.x, a.tip.y, b.tip.x, b.tip.y, a.angle, b.angle]}
"""
"""Beams that nothing connects: each takes steps of its own, in the coordinates of both together."""


def framed(deck, **models):
    scene = build(deck, models=models)
    return {name: body.framed for name, body in scene.bodies.items() if hasattr(body, "framed")}


def test_many_coordinates_are_stepped_in_absolute_ones():
    def pendulum(elements, *settings):
        more = ["solve.model=linear", f"bodies.b1.elements={elements}", *settings]
        return framed(load_deck(CASES / "pendulum.yaml", more))

    most = (MANY - 1) // 4 - 1  # elements: 4 coordinates at each node
    assert pendulum(most) == {"b1": True} and pendulum(most + 1) == {"b1": False}
    assert pendulum(most + 1, "solve.coordinates=frame") == {"b1": True}
    assert pendulum(most, "solve.coordinates=absolute") == {"b1": False}
    assert framed(parse_deck(PAIR)) == {"a": False, "b": False}
    assert framed(parse_deck(PAIR), b="exact") == {"a": True, "b": False}
    assert framed(parse_deck(PAIR), b="lowOrder") == {"a": True}


def test_parts_are_stepped_in_the_coordinates_of_the_whole():
    parts = [part.scene for part in build(parse_deck(PAIR)).parts]
    assert [body.framed for part in parts for body in part.bodies.values()] == [False, False]
    decks = {one: parse_deck(PAIR, overrides=[f"solve.coordinates={one}"]) for one in ("auto", "frame")}
    found = {one: hfsim.run(deck, error_estimate=False) for one, deck in decks.items()}
    for name in ("a.tip.x", "a.tip.y", "b.tip.x", "b.tip.y", "a.angle", "b.angle"):
        np.testing.assert_allclose(found["auto"][name], found["frame"][name], atol=2e-6)


@pytest.mark.parametrize(("name", "share"), [("hub_beams", 0.6), ("manipulator", 0.7)])
def test_steps_stay_long_where_beams_turn(name, share, monkeypatch):
    """Corrections go along with the root of each beam; the vectors themselves turn."""
    settings = ["model=linear", "coordinates=absolute", "tolerance=1e-4", "duration=0.3"]

    def steps():
        scene = build(load_deck(CASES / f"{name}.yaml", [f"solve.{one}" for one in settings]))
        return run_integration(scene, scene.deck.solve).problem.counts.steps

    found = steps()
    monkeypatch.setattr(PlanarLinearBeam, "increments", lambda self: None)
    assert found < share * steps()
