"""Options of methods that the method of a deck does not read."""

import re
from pathlib import Path

import pytest

import hfsim
from hfsim.integrators import METHODS, integrator
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

DECK = """hfsim: 1
bodies: {wheel: {type: rigid, mass: 1, inertia: 1}}
joints: {axle: {type: revolute, between: [ground, wheel]}}
initial: {wheel: {angular_velocity: 1}}
solve: {duration: 1.0, SOLVE}
"""
MANUAL = (Path(hfsim.__file__).parent / "manual/methods.md").read_text(encoding="utf-8")


def warnings(solve, *settings):
    return build(parse_deck(DECK.replace("SOLVE", solve), "deck.yaml", settings)).warnings


@pytest.mark.parametrize(
    ("solve", "told"),
    [
        ("method: gear, stages: 3", "(line 5): method gear does not read stages (of gauss, radau, energy)"),
        ("order: 2", "order (line 5): method auto does not read order (of gear)"),
        ("method: gauss, rho_inf: 0.1", "method gauss does not read rho_inf (of generalized_alpha)"),
        ("method: explicit, stages: 3, order: 2", "read order (of gear), stages (of gauss, radau, energy)"),
    ],
)
def test_options_of_other_methods_are_warned_of_once(solve, told):
    (warning,) = warnings(solve)
    assert warning.startswith("solve.") and warning.endswith(told)


@pytest.mark.parametrize(
    "solve",
    [
        "stages: 3",
        "method: gear, order: 2",
        "method: energy, stages: 2",
        "method: gauss, order: null",
        "method: generalized_alpha, rho_inf: 0.1",
        "method: gauss, rho_inf: 0.8",
    ],
)
def test_options_that_are_read_or_say_nothing_are_not_warned_of(solve):
    assert warnings(solve) == []


def test_a_deck_may_be_shared_by_methods_that_overrides_choose():
    shared = "method: gear, order: 2, stages: 3"
    assert len(warnings(shared)) == 1
    assert warnings(shared, "solve.method=gauss") == []
    (told,) = warnings(shared, "solve.method=gauss", "solve.order=3")
    assert told == "solve.order: method gauss does not read order (of gear)"
    assert len(warnings("method: gear", "solve.stages=3")) == 1


def test_the_manual_names_the_options_that_methods_read():
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]*) ?\|$", MANUAL, re.MULTILINE)[: len(METHODS) + 1])
    assert {name: tuple(re.findall(r"`(\w+)`", rows[name])) for name in METHODS} == {
        name: integrator(name).reads for name in METHODS
    }
    assert rows["auto"].strip() == "`stages`"
