"""The validity monitor warns before 1 % of error and is silent below 0.1 %."""

import pytest
from validity_study import FAST, SLOW, as_text, measure

ALL = [*FAST.items(), *(pytest.param(*item, marks=pytest.mark.slow) for item in SLOW.items())]


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
