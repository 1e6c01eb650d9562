"""Numbers out of all range: a run ends in a told failure, and nobody but hfsim speaks to the terminal."""

from pathlib import Path

import pytest

from hfsim.errors import DeckError
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

FOUR_BAR = Path(__file__).parents[2] / "cases" / "extreme" / "four_bar.yaml"
DAMPED = """
hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e5}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies:
  b: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}
  m: {type: rigid, mass: 1.0, inertia: 1.0}
joints:
  pin: {type: revolute, between: [ground, b.root]}
  end: {type: revolute, between: [b.tip, m]}
springs:
  k: {type: two_point, between: [ground, m], stiffness: 1.0e24, rest_length: 0.0, damping: 1.0}
solve: {duration: 0.05}
output: {interval: 0.01, channels: [b.tip.x, m.x]}
"""


@pytest.mark.parametrize("mass", ["1e15", "1e30"])
def test_singular_equations_end_in_a_told_failure(mass):
    deck = load_deck(FOUR_BAR, [f"bodies.crank.mass={mass}", "solve.duration=0.05"])
    run = simulate(deck, error_estimate=False, diagnosis=True)
    assert run.status == "failed"
    assert run.exit_code == 3
    assert run.reason


@pytest.mark.parametrize("method", ["auto", "gear", "generalized_alpha", "explicit"])
def test_lapack_has_no_say(method, capfd):
    deck = parse_deck(DAMPED, "deck", [f"solve.method={method}"])
    run = simulate(deck, error_estimate=False, diagnosis=True)
    assert run.status == "failed"
    seen = capfd.readouterr()
    assert not seen.out + seen.err


@pytest.mark.parametrize("tolerance", ["1e-300", "9e-15", "0"])
def test_a_tolerance_below_rounding_is_refused(tolerance):
    with pytest.raises(DeckError, match=r"solve\.tolerance: must be at least 1e-14"):
        parse_deck(DAMPED, "deck", [f"solve.tolerance={tolerance}"])
