"""The validity monitor warns before 1 % of error and is silent below 0.1 %."""

import json

import pytest
from called import call
from validity_study import FAST, HELD_BACK, SLOW, as_text, measure

import hfsim

ALL = [
    *FAST.items(),
    *(pytest.param(*item, marks=pytest.mark.slow) for item in {**SLOW, **HELD_BACK}.items()),
]


@pytest.mark.parametrize(("label", "scene"), ALL)
def test_the_monitor_warns_in_time_and_only_then(label, scene):
    rows = measure(label, scene())
    assert not [as_text(row) for row in rows if not row.right]


def test_the_scenes_hold_both_kinds():
    """Silence and warnings are both put to the test by the fast scenes."""
    rows = [
        row for label in ("cantilever, 0.01 N", "cantilever, 3 N") for row in measure(label, FAST[label]())
    ]
    assert {row.left_at is None for row in rows} == {True, False}


def test_compare_says_when_and_where_a_model_left_its_range(tmp_path):
    out = str(tmp_path / "out")
    softer = ["--set", "materials.rubber.youngs_modulus=7e9", "--no-plots", "--repeats", "1", "-o", out]
    done = call("compare", "linear", "exact", "--case", "pendulum", *softer)
    assert done.exit_code == 0
    facts = json.loads((tmp_path / "out" / "compare.json").read_text())["models"]
    left_at = facts["linear"]["validity"]["b1"]["left_at"]
    assert f"linear leaves its range at {left_at:.4g} s, in b1" in done.stdout
    assert facts["exact"]["validity"] == {}


ROTOR = {
    "hfsim": 1,
    "gravity": [0.0, 0.0, -9.81],
    "materials": {"glass": {"density": 1900.0, "youngs_modulus": "30 GPa", "poisson_ratio": 0.3}},
    "sections": {"spar": {"shape": "rectangle", "width": "60 mm", "height": "8 mm"}},
    "bodies": {
        "hub": {"type": "rigid", "mass": 2.0, "inertia": [0.01, 0.01, 0.02], "points": {"rim": [0.1, 0, 0]}},
        "blade": {
            "type": "beam", "element": "cosserat", "material": "glass", "section": "spar", "length": 2.0,
            "elements": 4,
        },
    },
    "joints": {
        "mast": {"type": "revolute", "between": ["ground", "hub"], "axis": [0, 0, 1]},
        "flap": {"type": "revolute", "between": ["hub.rim", "blade.root"], "axis": [0, 1, 0]},
    },
    "solve": {"duration": 0.04, "model": "linear", "tolerance": 1e-6},
    "output": {"interval": 0.005, "channels": ["blade.tip.deflection_y"]},
}  # fmt: skip


@pytest.mark.parametrize(("spin", "warned"), [(20.0, True), (2.0, False)])
def test_a_rotor_that_nothing_stiffens_is_told_before_it_has_gone_astray(spin, warned):
    deck = {**ROTOR, "initial": {"hub": {"angular_velocity": [0, 0, spin]}}}
    run = hfsim.run(deck, error_estimate=False, diagnosis=False)
    facts = run.statistics["validity"]["blade"]
    assert facts["largest"]["estimated_error"] < 5e-3, "small beside the way of the tip"
    assert (facts["left_at"] is not None) == warned
    assert ("faster than it bends: errors grow" in facts["reason"]) == warned
    # with the stiffening of exact it is 2.3e-5 m
    assert (abs(run["blade.tip.deflection_y"][-1]) > 1e-3) == warned


def test_a_scene_that_rests_where_it_hangs_is_judged_by_how_far_it_hangs():
    """Its range is rounding: errors relative to that were 1e5 per cent."""
    cantilever = {
        "hfsim": 1,
        "gravity": [0.0, -9.81],
        "materials": {"steel": {"density": 7800.0, "youngs_modulus": 2.1e11}},
        "sections": {"rod": {"shape": "circle", "diameter": 0.02}},
        "bodies": {"b": {"type": "beam", "material": "steel", "section": "rod", "length": 1.0}},
        "joints": {"clamp": {"type": "fixed", "between": ["ground", "b.root"]}},
        "initial": {"equilibrium": True},
        "solve": {"duration": 0.1, "model": "linear"},
        "output": {"interval": 0.05, "channels": ["b.tip.y"]},
    }
    assert not hfsim.run(cantilever, plots=False).statistics["warnings"]
    told = hfsim.run(cantilever, {"sections.rod.diameter": 0.001}, plots=False).statistics["warnings"]
    assert any("left the range of linear" in one for one in told)
