"""`hfsim bench`: reference and floor, budget, failed points, tables, advice."""

import csv
import json
import os
import time
import types
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import call

from hfsim.commands.options import parse_budget
from hfsim.marching.distance import ChannelScale, channel_errors
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Budget, TimeUp
from hfsim.output.bench import COLUMNS, as_rows
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck
from hfsim.scene.shipped import CASES
from hfsim.studies.bench.advice import advice, model_advice, pareto, recommend, recommendations
from hfsim.studies.bench.points import Cell, GroupError, Point, channel_error
from hfsim.studies.bench.result import Bench, as_facts
from hfsim.studies.bench.study import bench
from hfsim.studies.bench.sweep import Sweep
from hfsim.studies.farm import Farm, Here


def pendulum(*overrides):
    return load_deck(CASES / "pendulum.yaml", ("solve.duration=0.1", *overrides))


def sweep(**changes):
    few = Sweep(methods=("gauss", "gear"), models=("exact",), tolerances=(1e-3, 1e-6), repeats=2)
    return replace(few, **changes)


AMPLE = 3000.0
"""A budget of which no point takes the fiftieth part, which ends repeats, on however slow a machine [s]."""


@pytest.fixture(scope="module")
def small():
    return bench(pendulum(), sweep(), Budget(AMPLE), Here())


def point(cpu, error, method="gauss", tolerance=1e-4, **facts):
    return Point("exact", 4, method, tolerance, None, "done", cpu=cpu, error=error, **facts)


# --- the study -----------------------------------------------------------------------------------


def test_every_point_has_cost_and_error(small):
    assert small.status == "done"
    assert [(p.method, p.tolerance) for p in small.points] == [
        ("gauss", 1e-3), ("gauss", 1e-6), ("gear", 1e-3), ("gear", 1e-6),
    ]  # fmt: skip
    for p in small.points:
        assert p.status == "done"
        assert p.repeats == 2
        assert 0.0 < p.cpu_min <= p.cpu <= p.cpu_max
        assert p.rms_error <= p.error
        assert p.steps > 0 and p.evaluations > 0 and p.newton_iterations > 0
        assert {e.channel for e in p.channels} == set(pendulum().deck.channels)
    gear = [p for p in small.points if p.method == "gear"]
    assert gear[1].error < 0.1 * gear[0].error


def test_the_reference_is_two_methods_that_agree(small):
    (cell,) = small.cells
    assert "gauss" in cell.reference and "radau" in cell.reference
    assert 0.0 < cell.floor < 1e-9
    assert cell.floor >= max(f for name, f in cell.floors.items() if name != "energy.total")


def test_an_independent_run_confirms_the_error(small):
    """The error of a point against another code path: the distance of a plain run to a tight one."""
    from hfsim.simulate import simulate

    settings = ("solve.method=gear", "solve.tolerance=1e-3"), ("solve.method=gauss", "solve.tolerance=1e-11")
    run, truth = (simulate(pendulum(*one), error_estimate=False).channels for one in settings)
    (gear,) = (p for p in small.points if p.method == "gear" and p.tolerance == 1e-3)
    found = {e.channel: e.max_abs for e in gear.channels}
    for name, error in channel_errors(run, truth)[0].items():
        if name != "energy.total":
            assert found[name] == pytest.approx(error, rel=1e-3), name


def test_no_error_below_the_floor_is_a_number():
    scale = ChannelScale("x", "m", 2.0, 2.0, False, True)
    truth = np.zeros(3)
    below = channel_error(np.array([0.0, 1e-9, -1e-9]), truth, scale, 1e-8)
    assert (below.below_floor, below.max_relative, below.rms_relative) == (True, 1e-8, 1e-8)
    assert below.max_abs == pytest.approx(2e-8)
    above = channel_error(np.array([0.0, 0.2, 0.0]), truth, scale, 1e-8)
    assert (above.below_floor, above.max_relative) == (False, pytest.approx(0.1))
    assert above.rms_relative == pytest.approx(0.1 / np.sqrt(3.0))


def test_points_of_the_reference_accuracy_are_flagged():
    result = bench(pendulum(), sweep(methods=("gauss",), tolerances=(1e-13,)), Budget(30.0), Here())
    (p,), (cell,) = result.points, result.cells
    if p.below_floor:
        assert p.error == cell.floor
    assert p.error >= cell.floor


def test_fixed_steps():
    result = bench(pendulum(), sweep(methods=("gauss",), steps=(0.01, 0.02)), Budget(30.0), Here())
    assert [(p.step, p.tolerance, p.steps) for p in result.points] == [(0.02, None, 5), (0.01, None, 10)]


def test_failed_points_are_data():
    """No explicit method stands steps of 10 ms in a pendulum a hundred times stiffer."""
    deck = pendulum("materials.rubber.youngs_modulus=7e7")
    result = bench(deck, sweep(methods=("explicit",), steps=(0.01, 0.0002)), Budget(30.0), Here())
    failed = [p for p in result.points if p.status == "failed"]
    assert failed, [(p.method, p.step, p.status) for p in result.points]
    for p in failed:
        assert p.reason and p.error is None
    assert any(p.status == "done" for p in result.points)
    assert result.status == "done"


def test_a_model_that_breaks_down_has_no_reference():
    result = bench(pendulum(), sweep(models=("lowOrder",), tolerances=(1e-3,)), Budget(30.0), Here())
    assert result.status == "failed"
    assert result.cells[0].status == "failed"
    assert "mass matrix" in result.cells[0].reason
    assert {p.status for p in result.points} == {"failed"}


class Clock:
    """A clock that moves by a tick at every look."""

    def __init__(self, tick):
        self.now, self.tick = 0.0, tick

    def __call__(self):
        self.now += self.tick
        return self.now


def test_the_budget_is_kept_and_what_was_not_run_is_told():
    wanted = sweep(tolerances=(1e-3, 1e-6, 1e-9))
    whole = Clock(1e-3)
    bench(pendulum(), wanted, Budget(1e6, whole), Here())
    clock, shares = Clock(1e-3), []
    budget = Budget(0.5 * whole.now, clock, report=shares.append)
    result = bench(pendulum(), wanted, budget, Here())
    assert clock.now < 1.05 * budget.seconds
    statuses = {p.status for p in result.points}
    assert statuses <= {"done", "over budget", "skipped"}
    assert statuses & {"over budget", "skipped"}
    assert len(result.points) == 6
    assert all(p.reason for p in result.points if p.status != "done")
    assert 0.0 < max(shares) <= 1.0


def test_a_slow_point_is_cut_off_and_says_how_far_it_came():
    """Clock ticks are steps: steps of 10 us are 10 000 of them, with no cheaper point to judge by."""
    clock = Clock(1e-3)
    result = bench(pendulum(), sweep(methods=("explicit",), steps=(1e-5,)), Budget(3.0, clock), Here())
    assert clock.now < 3.3
    (p,) = result.points
    assert p.status == "over budget"
    assert "cut off at" in p.reason and "of the duration" in p.reason


def paced(monkeypatch, runs):
    """Let each tolerance take the times [s] at which shares of its run are done; return a budget of 20 s."""
    clock, deck = types.SimpleNamespace(now=0.0), pendulum().deck
    quick = deck.solve.model_copy(update={"tolerance": 1e-3})
    done = run_integration(build(pendulum()), quick)

    def solve_at_a_pace(scene, solve, guard=None):
        start = clock.now
        try:
            for seconds, share in runs[solve.tolerance] if solve.duration == quick.duration else ():
                clock.now = start + seconds
                guard(share)
        except TimeUp as stop:
            return types.SimpleNamespace(stop=stop), clock.now - start
        return done, clock.now - start

    monkeypatch.setattr("hfsim.studies.bench.study.solved", solve_at_a_pace)
    return Budget(20.0, lambda: clock.now)


def evenly(seconds, start=(0.0, 0.0), steps=1000):
    """Return how a run goes on from a time [s] and a share to its end."""
    return np.linspace(start, (seconds, 1.0), steps + 1)[1:].tolist()


def statuses(budget, *tolerances):
    wanted = sweep(methods=("gauss",), tolerances=tolerances, repeats=1)
    return [p.status for p in bench(pendulum(), wanted, budget, Here()).points]


def test_a_point_that_is_slow_at_its_start_alone_is_measured(monkeypatch):
    """Steps double from 1e-6 of the duration on: a trial of 0.4 s forecast 27 000 s of the 4 s it takes."""
    start = [(0.1 * k, 1e-6 * 2.0**k) for k in range(13)]
    assert statuses(paced(monkeypatch, {1e-3: [*start, *evenly(4.0, start[-1])]}), 1e-3) == ["done"]


def test_a_point_at_a_steady_pace_beyond_the_budget_is_tried_once(monkeypatch):
    budget = paced(monkeypatch, {1e-3: evenly(100.0)})
    assert statuses(budget, 1e-3) == ["over budget"]
    assert budget.used < 0.6


def test_a_cost_that_grows_once_is_not_taken_to_grow_for_ever(monkeypatch):
    budget = paced(monkeypatch, {1e-3: evenly(0.3), 1e-4: evenly(3.0), 1e-5: evenly(3.3)})
    assert statuses(budget, 1e-3, 1e-4, 1e-5) == ["done", "done", "done"]
    assert budget.used < 7.5


def test_one_reference_is_made_at_any_price():
    result = bench(pendulum(), sweep(), Budget(1e-6), Here())
    assert result.cells[0].status == "done"
    assert {p.status for p in result.points} == {"skipped"} and result.status == "limit"
    assert {p.reason for p in result.points} == {"the budget was used up"}


def test_an_interrupt_keeps_what_was_measured():
    def stop(share, seen=[]):  # noqa: B006
        seen.append(share)
        if len(seen) > 300:
            raise KeyboardInterrupt

    result = bench(pendulum(), sweep(tolerances=(1e-3, 1e-9)), Budget(30.0, report=stop), Here())
    assert result.status == "interrupted"
    assert result.cells


def test_points_side_by_side_are_the_same_but_for_times(small):
    def told(result):
        return [replace(p, cpu=None, cpu_min=None, cpu_max=None) for p in result.points]

    budget = Budget(AMPLE, time.process_time)
    beside = bench(pendulum(), sweep(), budget, Farm(2))
    assert told(beside) == told(small)
    assert budget.used > sum(p.cpu * p.repeats for p in beside.points), "what others use counts"


def lost(_):
    os._exit(7)


def test_a_point_whose_process_dies_has_failed(monkeypatch):
    monkeypatch.setattr("hfsim.studies.bench.study._try", lost)
    result = bench(pendulum(), sweep(), Budget(30.0), Farm(2))
    assert {(p.status, p.reason) for p in result.points} == {
        ("failed", "the worker ended without an answer (exit code 7)")
    }


def test_mesh_and_time_errors_are_told_apart():
    deck = pendulum("output.channels=[b1.tip.y]", "solve.duration=0.3")
    meshes = sweep(methods=("gauss",), tolerances=(1e-2, 1e-6), elements=(2, 4))
    result = bench(deck, meshes, Budget(60.0), Here())
    coarse, fine = result.cells
    assert (coarse.mesh_reference, fine.mesh_reference) == (8, 8)
    assert coarse.mesh_error > fine.mesh_error > fine.floor
    assert fine.mesh_order == pytest.approx(np.log2(coarse.mesh_error / fine.mesh_error))
    for p in result.points:
        cell = coarse if p.elements == 2 else fine
        assert abs(p.total_error - cell.mesh_error) < 2.0 * p.error + 0.01 * cell.mesh_error
    *advised, scope = result.recommendations
    assert all("elements, gauss" in line or "nothing" in line for line in advised)
    assert "of time and mesh together" in scope and "2 elements: " in scope


# --- advice on made-up points --------------------------------------------------------------------

POINTS = [
    point(0.01, 3e-2, tolerance=1e-3),
    point(0.06, 5e-5, tolerance=1e-5),
    point(0.05, 4e-3, method="radau"),
    point(0.20, 4e-5, method="radau", tolerance=1e-6),
    point(0.90, 1e-8, tolerance=1e-9),
    Point("exact", 4, "gear", 1e-3, None, "failed", "diverged"),
]


def test_the_front_holds_what_nothing_cheaper_comes_near():
    assert [p.cpu for p in pareto(POINTS)] == [0.01, 0.05, 0.06, 0.90]


@pytest.mark.parametrize(("target", "cpu"), [(1.0, 0.01), (1e-2, 0.05), (1e-4, 0.06), (1e-6, 0.90)])
def test_the_cheapest_point_within_the_target_is_recommended(target, cpu):
    assert recommend(POINTS, target).cpu == cpu


def test_advice_in_words():
    assert advice(POINTS, "0.01 %", 1e-4) == "for 0.01 %: gauss, tolerance 1e-5: 0.06 s"
    assert "nothing tried reaches it; best 1.0e-08" in advice(POINTS, "1e-9", 1e-9)
    assert advice([], "1 %", 1e-2) == "for 1 %: nothing was measured"
    floor = [point(0.1, 1e-7, below_floor=True)]
    assert "the reference is not known better" in advice(floor, "1e-9", 1e-9)


def test_no_method_is_blamed_for_a_reference_that_is_not_known_better():
    """Of a chaotic motion every point is off by more than the reference, none below its floor."""
    rough = {"floor": 0.8, "group_floors": {"motion": 0.8, "rates": 1e-5}}
    cells = [Cell(model, 4, 10, "done", model_error=0.9, **rough) for model in ("exact", "linear")]
    groups = {"motion": GroupError(0.9, 0.1, "x", False), "rates": GroupError(0.02, 0.1, "x", False)}
    told = recommendations(cells, [point(0.1, 0.9, groups=groups, exact_error=0.9)])
    unknown = "the reference is not known better"
    assert any(line.startswith(f"exact: motion: for 1 %: {unknown}; best 9.0e-01 with") for line in told)
    assert any("for 1 % or less: nothing tried reaches it; best 2.0e-02" in line for line in told)
    assert f"for 1 % of exact: {unknown}" in told


def test_the_error_of_the_mesh_counts():
    points = [replace(POINTS[1], total_error=2e-2), replace(POINTS[4], elements=8, total_error=5e-3)]
    assert recommend(points, 1e-2).elements == 8


def test_tables_hold_every_point():
    cell = Cell("exact", 4, 20, "done", floor=1e-10)
    result = Bench("deck", "done", 1.0, 60.0, 2.0, (cell,), tuple(POINTS))
    rows = list(as_rows(result))
    assert [row.point for row in rows] == POINTS
    assert all(column.value(row) is None for row in rows for column in COLUMNS if "channel_" in column.name)
    assert len(as_facts(result)["pareto"][0]) == 4
    assert len(as_facts(result)["recommendations"]) == 3


# --- groups of channels --------------------------------------------------------------------------


REACTIONS = "output.channels=[b1.tip.x, b1.tip.y, b1.angular_velocity, pin.force_x, energy.kinetic]"


@pytest.fixture(scope="module")
def stiff():
    """Two stiff beams: reactions carry fast modes, which no tolerance that serves the motion resolves."""
    deck = load_deck(CASES / "two_beams.yaml", ("solve.duration=0.05", REACTIONS))
    few = sweep(methods=("gauss", "radau"), tolerances=(1e-3, 1e-5), repeats=1)
    return bench(deck, few, Budget(30.0), Here())


def test_each_group_has_its_own_floor_and_error(stiff):
    (cell,) = stiff.cells
    assert cell.groups == ("motion", "rates", "forces", "energies")
    assert cell.floor == cell.group_floors["motion"] < 1e-9 < 1e2 * cell.group_floors["forces"]
    for p in stiff.points:
        assert set(p.groups) == set(cell.groups)
        assert p.error == p.groups["motion"].error and p.worst_channel.startswith("b1.tip")
        assert p.groups["forces"].worst_channel == "pin.force_x"
        assert p.of_group("forces").error == p.groups["forces"].error > 10.0 * p.error


def test_one_channel_does_not_hide_all_others(stiff):
    first, second, third, scope, *others = stiff.recommendations
    for line, words in zip((first, second), ("1 %", "0.01 %"), strict=True):
        assert line.startswith(f"motion: for {words}: ") and "tolerance" in line and "nothing" not in line
    assert third.startswith("motion: for 1e-6: ")
    assert scope.startswith("errors in time only, without that of the mesh (4 elements)")
    assert [line.split(",")[0] for line in others] == ["rates", "forces", "energies"]
    assert "error floor" in others[1] and "nothing tried reaches it" in others[1]
    assert others[1].count("best") == 1
    facts = as_facts(stiff)
    assert facts["groups"] == ("motion", "rates", "forces", "energies")
    assert facts["points"][0]["groups"]["forces"]["worst_channel"] == "pin.force_x"
    assert facts["cells"][0]["group_floors"]["rates"] > 0.0


def test_without_motion_another_group_comes_first():
    deck = pendulum("output.channels=[pin.force_x, b1.angular_velocity, constraint.position]")
    result = bench(deck, sweep(methods=("gauss",), tolerances=(1e-4,), repeats=1), Budget(30.0), Here())
    assert result.cells[0].groups == ("rates", "forces")
    assert result.points[0].worst_channel == "b1.angular_velocity"
    assert result.recommendations[0].startswith("rates: for 1 %")


def test_recommendations_say_what_errors_they_are_of():
    points = [point(0.1, 1e-3, total_error=2e-3), replace(point(0.2, 1e-5, total_error=1e-3), elements=8)]
    cells = [
        Cell("exact", n, 4 * n, "done", floor=1e-10, group_floors={"motion": 1e-10}, **mesh)
        for n, mesh in ((4, {}), (8, {"mesh_error": 1e-3, "mesh_channel": "b1.tip.y"}))
    ]
    (time_only,) = (line for line in recommendations(cells[:1], POINTS) if line.startswith("errors"))
    assert time_only.startswith("errors in time only, without that of the mesh (4 elements): --elements N,M")
    (both,) = (line for line in recommendations(cells, points) if line.startswith("errors"))
    assert both == "errors of time and mesh together; that of the mesh alone, 8 elements: 1.0e-03 in b1.tip.y"
    rigid = replace(cells[0], model="rigid")
    assert not any(line.startswith("errors") for line in recommendations([rigid], POINTS))


# --- the command ---------------------------------------------------------------------------------


def test_elements_are_those_of_each_beam_as_they_are_asked_for():
    deck = load_deck(CASES / "hub_beams.yaml", ["solve.duration=1e-3"])
    result = bench(deck, sweep(methods=("gauss",), tolerances=(1e-4,), elements=(1, 2)), Budget(30.0), Here())
    assert [cell.elements for cell in result.cells] == [1, 2] == [p.elements for p in result.points]
    assert {cell.mesh_reference for cell in result.cells} == {4}


def test_a_picture_of_one_point_shows_it_and_the_mesh_error(tmp_path, monkeypatch):
    """The library warned of axes without extent, and the mesh error lay outside."""
    monkeypatch.chdir(tmp_path)
    drawn = []
    monkeypatch.setattr("hfsim.output.plots.bench.save", lambda figures, folder: drawn.append(figures) or [])
    one = ("--tolerances", "1e-4", "--elements", "2,4", "--repeats", "1", "--set", "solve.duration=0.05")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert call("bench", "pendulum", "--methods", "gauss", *one).exit_code == 0
        figure = drawn[0]["work_precision_exact_2"]
        figure.canvas.draw()
    (axes,) = figure.axes
    (least, most), lines = axes.get_ylim(), [line.get_ydata() for line in axes.lines]
    seen = np.concatenate([np.asarray(values) for values in lines if len(values)])
    assert least < seen.min() and seen.max() < most and len({*seen}) == 2


FEW = ("bench", "pendulum", "--set", "solve.duration=0.05", "--methods", "gauss", "--tolerances", "1e-3,1e-5")


def test_the_command_writes_tables_and_pictures(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = call(*FEW)
    assert result.exit_code == 0, result.output
    for words in ("error floor", "for 1 %: gauss, tolerance", "pendulum.bench/"):
        assert words in result.stdout
    assert Path("pendulum.bench/plots/work_precision.png").stat().st_size > 5000
    facts = json.loads(Path("pendulum.bench/bench.json").read_text())
    assert facts["status"] == "done"
    assert facts["files"] == ["bench.csv", "bench.json", "plots/work_precision.png"]
    with Path("pendulum.bench/bench.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 6
    assert {row["channel_group"] for row in rows} == {"motion", "rates", "energies"}
    assert {row["below_floor"] for row in rows} <= {"True", "False"}
    assert all(float(row["channel_max_relative"]) >= float(row["channel_floor"]) for row in rows)
    assert call(*FEW).exit_code == 2
    again = call(*FEW, "--force", "--json", "--no-plots")
    assert again.exit_code == 0
    assert len(json.loads(again.stdout)["points"]) == 2


@pytest.mark.parametrize(
    "wrong",
    [
        ("--methods", "gaus"),
        ("--models", "auto"),
        ("--tolerances", "1e-3,x"),
        ("--tolerances", "-1"),
        ("--steps", "1e-3"),
        ("--elements", "2.5"),
        ("--budget", "soon"),
    ],
)
def test_a_bad_command_line_ends_with_2(tmp_path, monkeypatch, wrong):
    monkeypatch.chdir(tmp_path)
    assert call(*FEW, *wrong).exit_code == 2
    assert not list(tmp_path.iterdir())


def test_exit_code_3_without_a_reference(tmp_path):
    result = call("bench", "pendulum", "--models", "lowOrder", "--methods", "gauss", "--tolerances", "1e-3",
                  "--set", "solve.duration=0.05", "-o", tmp_path / "o", "--no-plots")  # fmt: skip
    assert result.exit_code == 3
    assert "mass matrix" in result.stdout


def test_exit_code_5_where_nothing_was_measured(tmp_path):
    result = call("bench", "pendulum", "--methods", "gauss", "--budget", "1ms", "-o", tmp_path / "o")
    assert result.exit_code == 5
    assert "the budget of 0.001 s did not suffice for a single point" in result.stderr
    facts = json.loads((tmp_path / "o/bench.json").read_text())
    assert (facts["status"], facts["budget"]) == ("limit", 1e-3)


def test_budgets():
    assert [parse_budget(text) for text in ("500ms", "1.5 min", "1h")] == [0.5, 90.0, 3600.0]


# --- degrees -------------------------------------------------------------------------------------


def test_meshes_of_higher_degree_are_no_finer_than_the_finest_of_the_lowest():
    meshes = sweep(elements=(1, 4, 8), degrees=(3, 5, 7)).meshes
    assert meshes == [(1, 3), (4, 3), (8, 3), (1, 5), (4, 5), (1, 7)]
    assert sweep(elements=(1, 4, 8), degrees=(3, 5, 7)).fine_mesh == (6, 7, 1)
    assert sweep(elements=(2, 4)).fine_mesh == (4, None, 2)
    assert sweep(degrees=(3, 5)).fine_mesh == (None, 5, 2)
    assert sweep(degrees=(3, 5)).meshes == [(None, 3), (None, 5)]


@pytest.mark.slow
def test_the_command_compares_degrees(tmp_path):
    result = call(
        "bench", "pendulum", "--methods", "gauss", "--tolerances", "1e-3,1e-5", "--elements", "1,2,4",
        "--degrees", "3,5", "--set", "solve.duration=0.1", "--set", "output.channels=[b1.tip.x, b1.tip.y]",
        "--set", "materials.rubber.youngs_modulus=2e6", "--repeats", 1, "-o", tmp_path / "o",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    for words in ("exact, 2 elements of degree 5", "against 4 elements of degree 5", "degree 5: CPU [s]"):
        assert words in result.stdout
    assert (tmp_path / "o" / "plots" / "total_error_exact.png").stat().st_size > 5000
    facts = json.loads((tmp_path / "o" / "bench.json").read_text())
    assert [(c["elements"], c["degree"]) for c in facts["cells"]] == [(1, 3), (2, 3), (4, 3), (1, 5), (2, 5)]
    errors = {(c["elements"], c["degree"]): c["mesh_error"] for c in facts["cells"]}
    assert errors[2, 5] < errors[1, 5] < errors[1, 3]
    with (tmp_path / "o" / "bench.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {(row["degree"], row["unknowns"]) for row in rows} >= {("3", "10"), ("5", "18")}
    assert call("bench", "pendulum", "--degrees", "2,5").exit_code == 2


# --- models against the exact one ----------------------------------------------------------------


def test_models_are_held_against_the_exact_one():
    """A stiff beam begins to fall: linear suffices for 1 %, but not for 0.01 %."""
    stiff = pendulum("materials.rubber.youngs_modulus=7e8", "output.channels=[b1.tip.y]")
    models = sweep(methods=("gauss",), models=("linear", "exact"), repeats=1)
    found = bench(stiff, models, Budget(60.0), Here())
    linear, exact = found.cells
    assert exact.model_error is None and 1e-4 < linear.model_error < 1e-2
    assert linear.model_channel == "b1.tip.y"
    tight = {p.model: p for p in found.points if p.tolerance == 1e-6}
    assert tight["exact"].exact_error == pytest.approx(tight["exact"].error)
    assert tight["linear"].error < 1e-5 < 0.9 * linear.model_error < tight["linear"].exact_error
    assert tight["linear"].exact_error == pytest.approx(linear.model_error, rel=1e-2)
    advice_lines = found.recommendations
    assert any(line.startswith("linear, 4 elements: off exact by") for line in advice_lines)
    (one_percent,) = (line for line in advice_lines if line.startswith("for 1 % of exact: "))
    assert "linear suffices" in one_percent or "linear would do too" in one_percent
    assert any("for 0.01 % of exact: exact, no other model suffices" in line for line in advice_lines)


def test_advice_on_models():
    points = [
        replace(point(0.02, None), model="linear", total_error=3e-3),
        replace(point(0.09, None), model="exact", total_error=1e-5),
    ]
    assert model_advice(points, "1 %", 1e-2) == (
        "for 1 % of exact: linear suffices: gauss, tolerance 1e-4: 0.02 s; exact: 0.09 s"
    )
    assert model_advice(points, "0.01 %", 1e-4) == (
        "for 0.01 % of exact: exact, no other model suffices: gauss, tolerance 1e-4: 0.09 s"
    )
    assert "no model that was tried" in model_advice(points, "1e-6", 1e-6)


def test_one_model_has_nothing_to_be_held_against(small):
    assert all(p.exact_error is None for p in small.points)
    assert not any("of exact" in line for line in small.recommendations)
