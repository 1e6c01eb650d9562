"""Scenes that start from equilibrium: they stay there, take stated rates, and tell where there is none."""

import numpy as np
import pytest

import hfsim
from hfsim.errors import DeckError
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import find_deck
from hfsim.simulate import simulate

ARM = """
hfsim: 1
name: arm
gravity: [0.0, -9.81]
materials: {m: {density: 2700.0, youngs_modulus: 7.0e9}}
sections: {s: {shape: rectangle, width: 0.02, height: 0.01}}
bodies:
  b: {type: beam, material: m, section: s, length: 1.0, elements: 2}
  c: {type: beam, material: m, section: s, length: 0.8, elements: 2}
joints:
  pin: {type: revolute, between: [ground, b.root]}
  hinge: {type: revolute, between: [b.tip, c.root]}
springs:
  k: {type: rotational, between: [ground, b], stiffness: 50.0}
  l: {type: rotational, between: [b, c], stiffness: 20.0}
initial: {equilibrium: true, b: {angle: 0.3}, c: {angle: 0.1}}
solve: {duration: 10.0, tolerance: 1.0e-8}
output: {channels: [b.tip.x, b.tip.y, c.tip.y, c.angle], plots: false, interval: 0.5}
"""
METHODS = ["gauss", "radau", "gear", "generalized_alpha", "energy"]


def swung(result):
    return max(float(np.abs(one.values - one.values[0]).max()) for one in result.channels)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", ["exact", pytest.param("lowOrder", marks=pytest.mark.slow)])
def test_it_stays_there(model, method):
    if (model, method) == ("lowOrder", "energy"):
        pytest.skip("the method needs a constant mass matrix")
    loaded = parse_deck(ARM, overrides=[f"solve.method={method}", f"solve.model={model}"])
    result = simulate(loaded, error_estimate=False)
    assert result.status == "done" and swung(result) < 1e-9
    assert result["b.tip.y"][0] < np.sin(0.3) - 0.1


@pytest.mark.slow
def test_it_stays_there_with_explicit_steps():
    changes = ["solve.method=explicit", "solve.duration=10.0", "solve.tolerance=1e-10"]
    changes += ["initial.equilibrium=true", "bodies.b1.elements=2"]
    assert swung(simulate(load_deck(find_deck("pendulum"), changes), error_estimate=False)) < 1e-9


def test_a_pendulum_in_space_stays_there():
    changes = ["initial.equilibrium=true", "initial.b1.angular_velocity=0.0", "solve.tolerance=1e-8"]
    result = simulate(load_deck(find_deck("pendulum_3d"), changes), error_estimate=False)
    assert result["b1.tip.z"] == pytest.approx(result["b1.tip.z"][0], abs=1e-9)
    assert result["b1.tip.z"][0] == pytest.approx(-1.25147689, abs=1e-7)


def test_stated_rates_come_on_top():
    rest = build(parse_deck(ARM))
    assert not rest.v.any()
    scene = build(
        parse_deck(ARM, overrides=["initial.b.angular_velocity=2.0", "initial.c.angular_velocity=2.0"])
    )
    assert scene.q == pytest.approx(rest.q, abs=1e-12)
    x, u = scene.system.absolute(scene.q[None]), scene.system.absolute_velocity(scene.q[None], scene.v[None])
    for point in ("b.tip", "c.tip"):
        place, rate = scene.marker(point).position(x)[0], scene.marker(point).velocity(x, u)[0]
        assert rate == pytest.approx((-2.0 * place[1], 2.0 * place[0]), abs=1e-9)


def test_some_bodies_rest_and_the_others_stay_where_they_are():
    scene = build(parse_deck(ARM, overrides=["initial.equilibrium=[c]"]))
    x = scene.system.absolute(scene.q[None])
    assert scene.marker("b.tip").position(x)[0] == pytest.approx((np.cos(0.3), np.sin(0.3)), abs=1e-12)
    before = build(parse_deck(ARM, overrides=["initial.equilibrium=false"]))
    fallen = scene.marker("c.tip").position(x) - before.marker("c.tip").position(
        before.system.absolute(before.q[None])
    )
    assert abs(fallen[0, 1]) > 0.05
    force = scene.system.force(np.zeros(1), x, np.zeros_like(x))
    own = scene.system.reduction.rows >= scene.bodies["c"].columns.start
    left = scene.system.reduction.free_force(force)[0, own]
    assert np.abs(left).max() < 1e-6


def without(*lines):
    return "\n".join(line for line in ARM.splitlines() if not any(word in line for word in lines))


def test_what_cannot_rest_is_refused_at_its_place():
    why = r"initial\.equilibrium: there is none: nothing holds what the loads push"
    with pytest.raises(DeckError, match=why) as told:
        build(parse_deck(without("pin:", "  k:")))
    assert told.value.exit_code == 2
    upright = [f"initial.{body}.angle=1.5707963267948966" for body in "bc"]
    scene = build(parse_deck(without("springs", "  k:", "  l:"), overrides=upright))
    assert any("not stable" in one for one in scene.warnings)


@pytest.mark.parametrize(
    ("entry", "message"),
    [("[b, d]", "there is no body 'd'"), ("{bodies: [d]}", "there is no body 'd'"), ("3", "must be a map")],
)
def test_slips_in_it_are_told(entry, message):
    with pytest.raises(DeckError, match=message):
        parse_deck(ARM, overrides=[f"initial.equilibrium={entry}"])
    with pytest.raises(DeckError, match=r"must be a map of what is stated of a body"):
        parse_deck(ARM, overrides=["initial.b=true"])


@pytest.mark.parametrize("entry", ["true", "false", "[c]"])
def test_a_resolved_deck_says_the_same(entry):
    deck = parse_deck(ARM, overrides=[f"initial.equilibrium={entry}"]).deck
    again = hfsim.load(deck.resolved()).deck
    assert again.resting == deck.resting and again.motions == deck.motions


def test_the_manipulator_takes_few_steps_for_many_digits():
    steps = []
    for tolerance in (1e-6, 1e-8):
        changes = [f"solve.tolerance={tolerance}", "output.plots=false"]
        result = simulate(load_deck(find_deck("manipulator"), changes), error_estimate=False)
        steps.append(result.statistics["steps"])
        assert result["shoulder.force_y"][0] == pytest.approx(74.71296, abs=1e-4)
    assert steps[1] <= 3 * steps[0]
