"""The validity monitor warns before 1 % of error and is silent below 0.1 %."""

import json

import pytest
from click.testing import CliRunner
from validity_study import FAST, HELD_BACK, SLOW, as_text, measure

from hfsim.cli import app

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
    done = CliRunner().invoke(app, ["compare", "linear", "exact", "--case", "pendulum", *softer])
    assert done.exit_code == 0
    facts = json.loads((tmp_path / "out" / "compare.json").read_text())["models"]
    left_at = facts["linear"]["validity"]["b1"]["left_at"]
    assert f"linear leaves its range at {left_at:.4g} s, in b1" in done.stdout
    assert facts["exact"]["validity"] == {}
