"""Runs leave nothing behind that waits for Python's collector, which sees no recordings."""

import gc

import pytest

import hfsim

QUICK = {"error_estimate": False, "diagnosis": False}


@pytest.mark.parametrize(
    ("deck", "duration"), [("two_beams", 0.05), ("hub_beams", 0.05), ("door", 0.1), ("heavy_top", 0.02)]
)
def test_what_a_run_held_is_gone_with_it(deck, duration):
    loaded = hfsim.load(deck, {"solve.duration": duration})
    hfsim.run(loaded, **QUICK)
    gc.collect()
    gc.disable()
    try:
        hfsim.run(loaded, **QUICK)
        assert gc.collect() == 0
    finally:
        gc.enable()
