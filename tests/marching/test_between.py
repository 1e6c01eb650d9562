"""Curves between the output times: what the steps say, whatever the interval, models, memories, ends."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from test_record import TURNING, Notes

import hfsim.marching.record
from hfsim.integrators import Segment, Trajectory, _loop
from hfsim.marching import between
from hfsim.marching.between import bends, times_between
from hfsim.mechanics.system import System
from hfsim.output.api import carry_out
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

CASES = Path(__file__).parents[2] / "cases"


def run(loaded, **options):
    return simulate(loaded, error_estimate=False, **{"outlines": True, **options})


def far(one, other):
    """Return the largest distance of polylines, by channel, relative to its range."""
    apart = {}
    for mine, theirs in zip(one.channels, other.channels, strict=True):
        near = np.interp(other.t, one.t, mine.values)
        apart[mine.name] = np.abs(near - theirs.values).max() / (np.ptp(theirs.values) or 1.0)
    return max(apart.values())


MOTION = "output.channels=[b1.tip.x, b1.tip.vy, b1.angle, b1.tip.deflection, energy.kinetic]"
SCENES = {
    "frame": ("pendulum.yaml", "output.interval=0.02"),
    "slopes": ("pendulum.yaml", "output.interval=0.02", "solve.model=ancf", "initial.b1.angular_velocity=40"),
    "gear": ("pendulum.yaml", "output.interval=0.02", "solve.method=gear", "solve.tolerance=1e-5"),
}


@pytest.mark.parametrize("deck, overrides", [(d, o) for d, *o in SCENES.values()], ids=SCENES)
def test_curves_are_those_of_a_fine_output(deck, overrides):
    coarse = run(load_deck(CASES / deck, [*overrides, MOTION]))
    real = run(load_deck(CASES / deck, [*overrides, MOTION, "output.interval=5e-4"]))
    drawn = coarse.drawn
    assert far(coarse, real) > 0.02, "rows alone have kinks"
    assert far(drawn, real) < 5e-3
    at = np.searchsorted(drawn.t, coarse.t)
    assert drawn.t[at].tobytes() == coarse.t.tobytes()
    for mine, row in zip(drawn.channels, coarse.channels, strict=True):
        assert mine.values[at].tobytes() == row.values.tobytes(), "rows are in the curve as they are"


def test_smooth_parts_of_curves_have_fewer_times_unseen(monkeypatch):
    path = ["output.interval=0.05", "output.channels=[b1.tip.x, b1.tip.y]"]
    whip = load_deck(CASES / "pendulum.yaml", path)
    few = run(whip).drawn
    monkeypatch.setattr(between, "bends", lambda table, units: np.ones(len(table) - 1, dtype=bool))
    every = run(whip).drawn
    assert len(few.t) < 0.7 * len(every.t) and np.isin(few.t, every.t).all()
    assert far(few, every) < 2.0 * between.VISIBLE


def test_straight_lines_may_be_seen_to_miss_bends_but_not_rounding():
    t = np.linspace(0.0, 1.0, 101)
    noise = np.cos(1e3 * t)
    rows = {
        "kink": (np.abs(t - 0.5), [49, 50]),
        "line": (3.0 * t, []),
        "arc": (np.sin(t), []),
        "waves": (np.sin(60.0 * t), None),
        "rounding": (7.0 + 1e-9 * noise, []),
    }
    for name, (values, where) in rows.items():
        bent = bends(np.column_stack([t, values]), ["m"])
        assert len(bent) == 100
        assert np.flatnonzero(bent).tolist() == where if where is not None else bent.mean() > 0.9, name
    both = np.column_stack([t, 1e-9 * noise, t])
    assert not bends(both, ["N", "N"]).any(), "a force that is none beside another"
    assert bends(both, ["N", "m"]).mean() > 0.9


def test_curves_go_through_a_change_of_models():
    output = "output: {channels: [b1.tip.x, b1.angle, b1.tip.deflection, pin.force_x, energy.total]}"
    whole = run(parse_deck(TURNING + output, "deck", []))
    curves = whole.drawn
    assert len(whole.statistics["auto"]["switches"]) >= 2
    assert len(curves.t) > 1.5 * len(whole.t) and np.isin(whole.t, curves.t).all()
    assert np.diff(curves.t).min() > 0.0 and curves.t[-1] == whole.t[-1]
    assert far(curves, whole) == 0.0
    assert np.abs(np.diff(curves["b1.angle"])).max() < 0.1, "full turns are counted on"


def test_what_was_put_down_has_its_rows_and_then_curves(monkeypatch):
    monkeypatch.setattr(hfsim.marching.record, "BLOCK", 0.01)
    monkeypatch.setattr(_loop, "AT_ONCE", 4)
    spin = [MOTION, "solve.model=ancf", "initial.b1.angular_velocity=40"]
    loaded = load_deck(CASES / "pendulum.yaml", spin)
    notes, curves = Notes(most=3), run(loaded).drawn
    assert run(loaded, sink=notes).status == "limit"
    memory = notes.put_down()
    later = run(loaded, memory=memory)
    drawn, since = later.drawn, memory["table"][-1, 0]
    extra = drawn.t[~np.isin(drawn.t, later.t)]
    assert 0.1 < since < extra.min(), "the steps before are gone, their rows stand"
    assert len(extra) > 100 and np.isin(later.t, drawn.t).all()
    assert far(drawn, later) == 0.0
    after = drawn.t > since
    for mine, theirs in zip(drawn.channels, curves.channels, strict=True):
        near = np.interp(drawn.t[after], curves.t, theirs.values)
        assert np.abs(mine.values[after] - near).max() < 0.01 * np.ptp(near), mine.name


@pytest.mark.slow
def test_refined_runs_have_curves():
    short = ["solve.duration=0.3", "output.interval=0.03"]
    loaded = load_deck(CASES / "pendulum.yaml", [*short, "solve.target_error=1e-1", "solve.budget=30"])
    wish = {"error_estimate": True, "diagnosis": False, "after": None, "outlines": True}
    result = carry_out(loaded, None, **wish)
    assert len(result.drawn.t) > 1.5 * len(result.t)


def test_runs_without_outlines_have_curves_too_and_what_is_not_finite_is_left_out(monkeypatch):
    loaded = load_deck(CASES / "pendulum.yaml", ["solve.tolerance=1e-4"])
    done = run(loaded, outlines=False)
    assert len(run(loaded, outlines=False).drawn.t) > len(done.t)
    monkeypatch.setattr(System, "project", lambda self, t, q, v: (q * np.nan, v * np.nan))
    assert done.drawn.t.tobytes() == done.t.tobytes()


@pytest.mark.parametrize(
    "steps, rows, condensed, most, least",
    [
        (10, 20, False, 160, 130),
        (3000, 20, False, 4000, 2900),
        (50000, 20, False, 4000, 3990),
        (100, 20, True, 100, 90),
        (10, 5000, False, 0, 0),
    ],
)
def test_there_are_enough_times_and_not_too_many(steps, rows, condensed, most, least):
    ends = np.linspace(0.0, 1.0, steps + 1)
    none = np.zeros(1)
    made = [Segment(t, 1.0 / steps, none, none, np.zeros((2, 1))) for t in ends[:-1]]
    path = Trajectory(0.0, 1.0, none, none, made, condensed=condensed)
    times = times_between(path, np.linspace(0.0, 1.0, rows), 4000)
    assert least <= len(times) <= most
    assert (np.diff(times) > 0.0).all() and (times <= 1.0).all()


def test_long_steps_that_turn_often_inside_have_more_times_than_short_ones():
    none, ends = np.zeros(1), np.append([0.0, 0.5], np.linspace(0.5, 1.0, 301)[1:])
    made = [Segment(a, b - a, none, none, np.zeros((20, 1))) for a, b in pairwise(ends)]
    times = times_between(Trajectory(0.0, 1.0, none, none, made), np.array([0.0, 1.0]), 4000)
    inside = np.diff(times[times < 0.5])
    assert len(inside) > 30 and inside.max() == pytest.approx(inside.min())
    assert np.diff(times).max() < 0.5 / 38


def test_snapshots_survive_being_put_down(monkeypatch):
    monkeypatch.setattr(hfsim.marching.record, "BLOCK", 0.01)
    monkeypatch.setattr(_loop, "AT_ONCE", 4)
    loaded = load_deck(CASES / "pendulum.yaml", ["output.snapshots=[0.99, 0.01, 0.0]"])
    whole, notes = run(loaded), Notes(most=3)
    assert run(loaded, sink=notes).status == "limit"
    memory = notes.put_down()
    assert len(memory["record.shots"]) == 2
    later = run(loaded, memory=memory)
    assert [shot.t for shot in later.snapshots] == [0.0, 0.01, 0.99]
    for mine, theirs in zip(later.snapshots, whole.snapshots, strict=True):
        assert mine.points["b1"].tobytes() == theirs.points["b1"].tobytes()


def test_snapshots_go_through_a_change_of_models():
    output = "output: {snapshots: [0.1, 0.5, 0.8], interval: 0.1}"
    whole = run(parse_deck(TURNING + output, "deck", []))
    assert [shot.t for shot in whole.snapshots] == [0.1, 0.5, 0.8]
    for shot in whole.snapshots:
        row = int(np.argmin(np.abs(whole.t - shot.t)))
        assert shot.points["b1"][-1] == pytest.approx(whole.outlines["b1"][row, -1], abs=1e-12)
