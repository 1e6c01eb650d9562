"""Runs leave nothing behind that waits for Python's collector, which sees no recordings."""

import gc
from pathlib import Path

import pytest

import hfsim

SPARE = Path(__file__).parents[2] / "cases/rules/spare.yaml"
QUICK = {"error_estimate": False, "diagnosis": False}


@pytest.mark.parametrize(
    ("deck", "duration"),
    [("two_beams", 0.05), ("hub_beams", 0.05), ("door", 0.1), ("heavy_top", 0.02), (SPARE, 0.1)],
)
def test_what_a_run_held_is_gone_with_it(deck, duration):
    loaded = hfsim.load(deck, {"solve.duration": duration})
    told = {"progress": lambda share: None}
    hfsim.run(loaded, **QUICK, **told)
    gc.collect()
    gc.disable()
    try:
        hfsim.run(loaded, **QUICK, **told)
        assert gc.collect() == 0
    finally:
        gc.enable()
