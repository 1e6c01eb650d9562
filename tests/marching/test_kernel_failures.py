"""What is out of range, not finite or breaks down ends in the same words with the kernel as in NumPy."""

from pathlib import Path

import pytest
from natively import both, native
from zoo import DEAD_CENTRE

from hfsim.deck import units
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

pytestmark = native
CASES = Path(__file__).parents[2] / "cases"
ARM = """
hfsim: 1
materials: {soft: {density: 1000.0, youngs_modulus: 5.0e7}}
sections: {bar: {shape: rectangle, width: 2.0e-2, height: 2.0e-2}}
bodies:
  arm: {type: beam, material: soft, section: bar, length: 0.4, elements: 2}
  bob: {type: rigid, mass: 0.02, inertia: 1.0e-4}
joints:
  axle: {type: revolute, between: [ground, arm.root]}
  end: {type: revolute, between: [arm.tip, bob]}
springs:
  coil: {type: rotational, between: [ground, arm.root], stiffness: 5.0, damping: 0.05}
  band: {type: two_point, between: [ground, bob], stiffness: 10.0, rest_length: 0.1, damping: 0.1}
loads:
  pull: {type: force, at: arm.tip, force: [1.0, 0.5]}
  twist: {type: moment, at: arm.tip, moment: 0.1}
solve: {duration: 0.1, tolerance: 1.0e-6}
"""
BOB = """
hfsim: 1
bodies: {bob: {type: rigid, mass: 1.0, inertia: 0.25, points: {pivot: [-0.5, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, bob.pivot]}}
loads: {twist: {type: moment, at: bob, moment: 1.0e300,
                law: {type: smooth_step, from: 0, to: 1.0e10, start: 0.5, end: 0.6}}}
solve: {duration: 1.0}
"""
TEXTS = {"arm": ARM, "bob": BOB, "dead centre": DEAD_CENTRE}
GROWS = 'loads.twist.law={expression: "exp(1000 * t)"}'
LEAPS = "loads.twist.law={type: table, times: [0.0, 0.05, 0.06, 1.0], values: [0.0, 0.1, 1e20, 1e20]}"


def slow(*given):
    return pytest.param(*given, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    "name, settings, words",
    [
        ("extreme/four_bar", ["bodies.crank.mass=1e30", "solve.duration=0.05"], "the step length fell"),
        ("pendulum", ["solve.model=lowOrder", "solve.duration=0.1"], "stops being positive definite"),
        ("pendulum", ["solve.model=linear", "gravity=[0, -1e5]"], "deflects by"),
        *(("bob", [f"solve.method={one}", "solve.step=0.01"], "not finite") for one in ("radau", "explicit")),
        *(("bob", [f"solve.method={one}"], "not finite") for one in ("gear", "generalized_alpha")),
        ("arm", [GROWS, "solve.method=explicit", "solve.step=1e-4"], "cannot be counted"),
        slow("arm", [GROWS, "solve.method=gear", "solve.step=1e-4"], "cannot be counted"),
        slow("arm", [GROWS, "solve.method=energy", "solve.step=1e-3"], "cannot be counted"),
        slow("arm", [GROWS], "the step length fell"),
        slow("arm", [GROWS, "solve.coordinates=frame"], "the step length fell"),
        slow("arm", [LEAPS], "crawl"),
        slow("arm", ["loads.pull.force=[-1e5, 0]"], "the step length fell"),
        slow("arm", ["loads.pull.force=[1e12, 0]"], "the step length fell"),
        slow("arm", ["loads.twist.moment=1e12"], "crawl"),
        slow("arm", ["initial.arm.angular_velocity=1e9"], "crawl"),
        slow("arm", ["gravity=[0, -1e15]"], "crawl"),
        slow("joints", ["gravity=[0, 0, -1e15]"], "crawl"),
        slow("pendulum_3d", ["solve.model=lowOrder", "bodies.b1.elements=3"], "stops being positive"),
        slow("dead centre", [], "the step length fell"),
    ],
)
def test_failures_are_those_of_numpy(name, settings, words, monkeypatch):
    """After recordings were made: the same end, at the same time, within 3000 attempts."""
    for dimension in units.RANGES:
        monkeypatch.setitem(units.RANGES, dimension, (0.0, 1e308))

    def run():
        text = TEXTS.get(name)
        deck = parse_deck(text, name, settings) if text else load_deck(CASES / f"{name}.yaml", settings)
        return simulate(deck, error_estimate=False)

    one, other = both(monkeypatch, run)
    assert (one.statistics["kernel"], other.statistics["kernel"]) == ("native", "numpy")
    assert one.status == other.status == "failed" and words in other.reason
    assert (one.exit_code, one.reason) == (other.exit_code, other.reason)
    assert [one.failure[key] for key in ("class", "item")] == [
        other.failure[key] for key in ("class", "item")
    ]
    assert one.stop_time == pytest.approx(other.stop_time, rel=1e-6, abs=1e-8)
    assert max(run.statistics["steps"] + run.statistics["rejected"] for run in (one, other)) <= 3000
