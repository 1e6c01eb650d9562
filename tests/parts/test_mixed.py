"""Scenes whose beams have different models: each with its own coordinates, all in one system."""

import functools
import itertools
import json

import numpy as np
import pytest
from called import call

from hfsim.errors import DeckError
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.models import MODELS
from hfsim.parts.bodies.planar_frame import FrameChart
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

PAIRS = list(itertools.product(MODELS, MODELS))
MATERIAL = """
materials: {{alloy: {{density: 2700.0, youngs_modulus: {E}}}}}
sections: {{bar: {{shape: rectangle, width: 0.02, height: 0.02}}}}
"""
CHAIN = """hfsim: 1
bodies:
  b1: {{type: beam, material: alloy, section: bar, length: 1.0, elements: 2, model: {one}}}
  b2: {{type: beam, material: alloy, section: bar, length: 0.8, elements: 2, model: {other}}}
joints:
  pin: {{type: revolute, between: [ground, b1.root]}}
  elbow: {{type: revolute, between: [b1.tip, b2.root]}}
springs: {{coil: {{type: rotational, between: [ground, b1], stiffness: 20.0, rest_angle: 0.2999}}}}
initial:
  b1: {{angle: 0.3}}
  b2: {{angle: -0.4}}
solve: {{duration: 0.1, tolerance: 1.0e-9}}
output:
  interval: 0.02
  channels: [b1.tip.x, b2.tip.x, b2.tip.y, b1.tip.deflection, b2.tip.deflection, b1.angle, b2.angle,
             elbow.force_x, elbow.force_y, pin.force_y, energy.total]
"""
HUB = """hfsim: 1
bodies:
  hub: {{type: rigid, mass: 1.0, inertia: 0.5, points: {{rim: [0.2, 0.0]}}}}
  b1: {{type: beam, material: alloy, section: bar, length: 1.0, elements: 2, model: {one}}}
  b2: {{type: beam, material: alloy, section: bar, length: 0.8, elements: 2, model: {other}}}
joints:
  axle: {{type: revolute, between: [ground, hub]}}
  mount: {{type: fixed, between: [hub.rim, b1.root]}}
  weld: {{type: fixed, between: [b1.tip, b2.root]}}
springs: {{coil: {{type: rotational, between: [ground, hub], stiffness: 20.0}}}}
initial: {{hub: {{angle: 0.0001}}}}
solve: {{duration: 0.1, tolerance: 1.0e-9}}
output:
  interval: 0.02
  channels: [hub.angle, b1.tip.y, b2.tip.y, b1.tip.deflection, b2.angle, mount.moment, weld.force_y,
             b2.tip.deflection, energy.total]
"""


def loaded(base, one, other, E="7.0e8", *overrides):
    return parse_deck((base + MATERIAL).format(one=one, other=other, E=E), "scene.yaml", overrides)


def values(deck):
    run = simulate(deck, error_estimate=False)
    assert run.status == "done"
    return {c.name: c.values for c in run.channels}, run


@functools.cache
def truth_of(base, one, other):
    """The channels of two models, computed once."""
    return values(loaded(base, one, other))[0]


def assert_close(found, expected, tolerance, skip=()):
    """Compare channels, relative to the largest value among those with the same last word."""
    for name in expected:
        kind = name.rpartition(".")[2]
        if kind not in skip:
            scale = max(1e-12, *(np.abs(v).max() for n, v in expected.items() if n.endswith(kind)))
            assert np.abs(found[name] - expected[name]).max() <= tolerance * scale, name


@pytest.mark.parametrize(("one", "other"), PAIRS)
@pytest.mark.parametrize("base", [CHAIN, HUB], ids=["chain", "hub"])
def test_small_motion_is_the_same_to_first_order(base, one, other):
    """Angles, deflections and reactions of any two flexible models are those of exact; energy is kept.

    In the chain the stretch by the slope, a term of second order, is 3 % of the forces along the beams.
    """
    like = [m if m == "rigid" else "exact" for m in (one, other)]
    truth = truth_of(base, *like)
    found, run = values(loaded(base, one, other))
    assert run.statistics["models"] == {"b1": one, "b2": other}
    assert_close(found, truth, 5e-3, skip=("force_x", "force_y") if base is CHAIN else ())
    assert one == "rigid" or np.abs(truth["b1.tip.deflection"]).max() > 1e-6
    assert run.statistics["energy_drift"] < 1e-5
    assert run.statistics["constraint_position"] < 1e-12


@pytest.mark.parametrize("base", [CHAIN, HUB], ids=["chain", "hub"])
@pytest.mark.parametrize("coordinates", ["auto", "frame"])
def test_exact_and_ancf_mixed_move_as_ancf_far_from_straight(base, coordinates):
    swing = [
        "gravity=[0.0,-9.81]",
        "solve.tolerance=1e-10",
        "solve.duration=0.25",
        f"solve.coordinates={coordinates}",
    ]
    truth, _ = values(loaded(base, "ancf", "ancf", "7.0e7", *swing))
    assert np.abs(truth["b2.tip.deflection"]).max() > 0.02
    for pair in (("exact", "ancf"), ("ancf", "exact")):
        found, _ = values(loaded(base, *pair, "7.0e7", *swing))
        assert_close(found, truth, 1e-9, skip=("force_x", "force_y", "moment", "total"))
        assert_close(found, truth, 1e-6)


def test_two_rigid_beams_are_two_rigid_bodies():
    """A double pendulum with beams of the model rigid, and with rigid bodies of their mass and inertia."""
    moving = ["gravity=[0.0,-9.81]", "initial.b1.angular_velocity=3.0"]
    channels = "output.channels=[b2.tip.x,b2.tip.y,b1.angle,b2.angle,elbow.force_x,pin.force_y,energy.total]"
    found, run = values(loaded(CHAIN, "rigid", "rigid", "7.0e8", *moving, channels))
    text = CHAIN
    for name, length in (("b1", 1.0), ("b2", 0.8)):
        old = f"{{{{type: beam, material: alloy, section: bar, length: {length}, elements: 2, model: "
        mass = 2700.0 * 4e-4 * length
        half = length / 2
        new = f"{{{{type: rigid, mass: {mass}, inertia: {mass * length**2 / 12}, "
        new += f"points: {{{{root: [{-half}, 0.0], tip: [{half}, 0.0]}}}}"
        text = text.replace(old + {"b1": "{one}", "b2": "{other}"}[name], new)
    bodies, _ = values(loaded(text, "", "", "7.0e8", *moving, channels))
    assert_close(found, bodies, 1e-9)
    assert run.statistics["unknowns"] == 6


def test_a_rigid_beam_has_the_mass_and_inertia_of_its_mesh():
    for options in ("", ", rotary_inertia: true", ", element: continuum", ", degree: 5"):
        text = CHAIN.replace("model: {one}", "model: {one}" + options)
        rigid, flexible = (build(loaded(text, model, "exact")) for model in ("rigid", "exact"))
        energy = []
        for scene in (rigid, flexible):
            body = scene.bodies["b1"]
            x, u = (np.zeros((1, scene.system.n_x)) for _ in range(2))
            x[0, body.columns] = body.placed(Pose.planar((0.2, -0.1), 0.7))
            twist = Twist(np.array([0.3, 0.5]), np.array([2.0]))
            u[0, body.columns] = body.moving(Pose.planar((0.0, 0.0), 0.7), twist)
            energy.append(scene.system.kinetic_energy(x, u)[0])
            assert scene.marker("b1").position(x)[0] == pytest.approx([0.2, -0.1], abs=1e-15)
        assert energy[0] == pytest.approx(energy[1], rel=1e-13)


def test_a_rigid_beam_counts_turns_and_never_bends():
    spin = ["initial.b1.angular_velocity=25.0", "solve.duration=0.3", "solve.tolerance=1e-6"]
    deck = loaded(CHAIN, "rigid", "exact", "7.0e8", *spin)
    found, _ = values(deck)
    assert found["b1.angle"][-1] > np.pi
    assert np.abs(found["b1.tip.deflection"]).max() < 1e-12


def test_each_beam_has_coordinates_of_its_own():
    system = build(loaded(CHAIN, "exact", "linear")).system
    assert [type(chart) for chart in system.charts] == [FrameChart]
    # the pin is eliminated on the exact beam, the elbow on the linear one keeps its multipliers
    assert (system.n, system.n_rows) == (10 + 12, 2)
    assert system.natural is not None and not system.linearizes
    assert build(loaded(CHAIN, "exact", "rigid")).system.linearizes
    assert build(loaded(CHAIN, "rigid", "linear")).system.natural is None


def test_the_command_line_and_compare_replace_only_what_solve_says(tmp_path):
    text = (CHAIN + MATERIAL).format(one="exact", other="rigid", E="7.0e8").replace(", model: exact", "")
    deck = tmp_path / "case.yaml"
    deck.write_text(text)
    out = str(tmp_path / "out")
    plain = ["--no-plots", "-o", out]
    assert call("run", str(deck), "--model", "linear", *plain).exit_code == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["model"], summary["models"]) == ("linear", {"b1": "linear", "b2": "rigid"})
    done = call("compare", "linear", "exact", "--case", str(deck), *plain, "--force")
    assert done.exit_code == 0
    assert "'b2' is rigid in every run" in done.stderr


def test_a_body_whose_own_model_cannot_be_is_refused():
    continuum = CHAIN.replace("model: {one}", "model: {one}, element: continuum")
    with pytest.raises(DeckError, match="a continuum element has no model lowOrder in the plane"):
        loaded(continuum, "lowOrder", "exact")
    loaded(continuum, "exact", "exact", "7e8", "solve.model=lowOrder")


def test_a_beam_welded_to_the_ground_may_be_rigid():
    welded = CHAIN.replace("revolute, between: [ground", "fixed, between: [ground")
    deck = loaded(welded, "rigid", "rigid", "7e8", "initial.b1.angle=0.0", "initial.b2.angular_velocity=1.0")
    found, _ = values(deck)
    assert np.abs(found["b1.angle"]).max() < 1e-12
