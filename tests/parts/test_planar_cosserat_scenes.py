# ruff: noqa: E501
"""Scenes in the plane with beams of the element cosserat: joints, channels, models, what is refused."""

from pathlib import Path

import numpy as np
import pytest
from published import misses
from solved import solved

from hfsim.marching.integration import run_integration
from hfsim.maths.matrices import is_sparse
from hfsim.maths.rotations import lever
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

DECK = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {{soft: {{density: 1000.0, youngs_modulus: 1.0e7, poisson_ratio: 0.3}}}}
sections:
  blade: {{shape: rectangle, width: 0.06, height: 0.03}}
  stiff: {{mass_per_length: 1.8, rotary_inertia: 1.4e-4, axial_stiffness: 1.8e4, shear_stiffness: 5.8e3,
           bending_stiffness: 1.35}}
bodies:
  b: {{type: beam, element: cosserat, material: soft, section: blade, elements: 1, points: {{side: [0.4, 0.1]}},
       axis: {{arc: {{radius: 1.0, angle: 0.8}}}}}}
  c: {{type: beam, element: cosserat, section: stiff, length: 0.5, elements: 1, degree: 2}}
  rope: {{type: beam, element: cable, material: soft, section: blade, length: 0.4, elements: 1}}
  top: {{type: rigid, mass: 0.5, inertia: 0.002, points: {{rim: [0.1, 0.0]}}}}
joints:
  hinge: {{type: revolute, between: [ground, b.root]}}
  elbow: {{type: revolute, between: [b.tip, c.root]}}
  hook: {{type: fixed, between: [c.tip, rope.root], angle: 0.3}}
  ball: {{type: fixed, between: [b.side, top.rim], angle: -0.5}}
initial:
  b: {{angle: 6.2, angular_velocity: 4.0}}
  c: {{angle: 6.0, angular_velocity: 4.0}}
solve: {{duration: 0.1, tolerance: 1.0e-9, model: {model}}}
output:
  interval: 0.02
  channels: [c.tip.x, c.tip.y, top.x, rope.tip.x, rope.tip.y, b.tip.deflection, b.angle, top.angle, energy.total]
"""


def run(model="exact"):
    return solved(DECK.format(model=model))[1]


@pytest.fixture(scope="module")
def here():
    return run()


def test_energy_and_joints_hold(here):
    assert np.ptp(here["energy.total"]) < 1e-7
    assert here.statistics["constraint_position"] < 1e-12


def test_angles_go_on_over_full_turns(here):
    """The clamped body is turned against the beam's frame, carried along, as the joint says."""
    assert here["b.angle"][0] == pytest.approx(6.2)
    assert here["b.angle"].max() > 2.0 * np.pi
    assert here["top.angle"] - here["b.angle"] == pytest.approx(np.full(6, -0.5), abs=0.2)


def test_exact_and_ancf_are_one(here):
    ancf = run("ancf")
    for channel in here.channels:
        assert ancf[channel.name] == pytest.approx(channel.values, abs=1e-12)


def test_low_order_is_nearer_to_exact_than_linear_and_tells_where_it_is_off(here):
    """All joints and channels are there for both; the first beam is too soft for them."""
    linear, low_order = run("linear"), run("lowOrder")
    for channel in here.channels[:-1]:
        missed = [np.abs(found[channel.name] - channel.values).max() for found in (linear, low_order)]
        assert missed[1] < 0.25 * missed[0]
    left = {name: facts["left_at"] for name, facts in low_order.statistics["validity"].items()}
    assert left["b"] is not None
    assert left["c"] is None


def test_points_of_a_curved_beam():
    scene = build(parse_deck(DECK.format(model="exact")))
    x, s = scene.system.absolute(scene.q[None]), 0.4
    c, n = np.array([np.sin(s), 1.0 - np.cos(s)]), np.array([-np.sin(s), np.cos(s)])
    turn = np.array([[np.cos(6.2), -np.sin(6.2)], [np.sin(6.2), np.cos(6.2)]])
    assert scene.marker("b.side").position(x)[0] == pytest.approx(turn @ (c + 0.1 * n), abs=1e-3)
    assert scene.marker("b.side").angle(x)[0] == pytest.approx(6.2 - 2.0 * np.pi, abs=1e-3)
    assert scene.bodies["b"].reference((s, 0.1)) == pytest.approx(c + 0.1 * n, abs=1e-3)


FREE = """
hfsim: 1
gravity: [0.0, 0.0]
sections: {{bar: {{mass_per_length: 1.0, rotary_inertia: 0.1, axial_stiffness: 1.0e3, shear_stiffness: 1.0e3,
                   bending_stiffness: 10.0}}}}
bodies: {{b: {{type: beam, element: cosserat, section: bar, length: 1.0, elements: {elements}, degree: 2}}}}
loads: {{push: {{type: force, at: b.tip, force: [0.0, 5.0]}}, turn: {{type: moment, at: b.root, moment: 2.0}}}}
solve: {{duration: 0.02, tolerance: 1.0e-8}}
output: {{interval: 0.01, channels: [b.tip.x, b.tip.y, b.tip.deflection, b.tip.elongation, b.angular_velocity]}}
"""


@pytest.mark.parametrize("elements", [4, 40])
def test_small_and_large_scenes_move_alike(elements):
    """Dense and sparse equations: nodes far from the loads have not been reached."""
    deck = parse_deck(FREE.format(elements=elements))
    assert is_sparse(build(deck).system.equations.constant_mass) == (elements == 40)
    found = solved(FREE.format(elements=elements))[1]
    momentum = 0.02 * 5.0
    scene = build(deck)
    assert found["b.tip.y"][-1] > 0.5 * momentum * 0.02
    assert scene.system.n_x == 4 * (2 * elements + 1)


CASE = Path(__file__).parent.parent.parent / "cases" / "flying_spaghetti.yaml"


@pytest.mark.slow
def test_flying_spaghetti():
    """On the shipped mesh, which is 1.6e-3 m from finer ones; energy and momenta as they must be."""
    result = simulate(load_deck(CASE), error_estimate=False)
    assert np.abs(misses(result, "flying_spaghetti")).max() < 1.7e-3
    energy = result.channels[-1].values[result.t > 2.55]
    assert np.ptp(energy) < 1e-4
    assert energy[0] == pytest.approx(90.3, rel=0.03)


def test_flying_spaghetti_keeps_its_momenta():
    """Centre of mass at (3 + 0.4 t^2, 4), then at 2 m/s; momenta are kept without loads."""
    scene = build(load_deck(CASE, ["solve.duration=5", "solve.tolerance=1e-9"]))
    done = run_integration(scene, scene.deck.solve)
    t = np.linspace(0.0, 5.0, 21)
    q, v = done.trajectory.at(t)
    x, u = scene.system.absolute(q), scene.system.absolute_velocity(q, v)
    body = scene.bodies["noodle"]
    masses, shifts = body.mesh.masses, body.positions
    centre = (masses * shifts) @ body.vectors(x) / 10.0
    pushed = np.minimum(t, 2.5)
    expected = 3.0 + 0.4 * pushed**2 + 2.0 * (t - pushed)
    assert centre == pytest.approx(np.stack([expected, np.full(len(t), 4.0)], axis=1), abs=2e-7)
    momentum = masses[:, None] * body.vectors(u)
    assert momentum[t > 2.6][:, shifts > 0].sum(axis=1) == pytest.approx(np.array([[20.0, 0.0]] * 10), abs=1e-7)
    about = np.sum(lever(body.vectors(x), momentum), axis=(1, 2))
    assert np.ptp(about[t > 2.6]) < 1e-6 * np.abs(about[-1])
