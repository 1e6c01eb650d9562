"""`hfsim sweep`: values, plans, rows, folders that are gone on with, refusals."""

import csv
import json
import math
import multiprocessing
import os
import pickle
import random
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from wheel import WHEEL

import hfsim
from hfsim.cli import app
from hfsim.deck.ranges import RangeError, read_values
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate
from hfsim.studies.farm import _without_script
from hfsim.studies.sweep import plan as plans
from hfsim.studies.sweep.effects import main_effects
from hfsim.studies.sweep.result import Sweep
from hfsim.studies.sweep.sensitivity import Differences, _sensitivity

STIFF = "springs.coil.stiffness"


def call(*arguments):
    return CliRunner().invoke(app, ["sweep", *(str(argument) for argument in arguments)])


def rows_of(folder):
    with (Path(folder) / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def without_times(folder):
    return [{key: value for key, value in row.items() if key != "cpu_s"} for row in rows_of(folder)]


# --- values and plans ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "share", "value"),
    [
        ("uniform(2, 6)", 0.25, 3.0),
        ("loguniform(1, 100)", 0.5, 10.0),
        ("normal(3, 2)", 0.841344746069, 5.0),
        ("lognormal(2, 1)", 0.5, 2.0),
        ("triangular(0, 1, 2)", 0.5, 1.0),
        ("integers(2, 4)", 0.99, 4.0),
        ("linear, exact", 0.51, "exact"),
    ],
)
def test_values_below_which_a_share_of_all_is(text, share, value):
    assert read_values(text).at(share) == (pytest.approx(value, rel=1e-9) if value != "exact" else value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("normal(1, 0)", "above 0"),
        ("uniform(3, 1)", "below the second"),
        ("loguniform(-1, 1)", "above 0"),
        ("normal(1)", "takes 2 numbers"),
        ("norml(1, 2)", "did you mean 'normal'"),
        ("lin(1, 2, 2.5)", "whole number"),
        ("1,,2", "no list"),
        ("integers(0.5, 2)", "whole numbers"),
    ],
)
def test_wrong_values_are_refused(text, why):
    with pytest.raises(RangeError, match=why):
        read_values(text)


def test_a_grid_has_all_combinations_the_last_path_fastest():
    plan = plans.grid({"a": "1,2", "b": "x,y,z"})
    assert [plan.row(k) for k in range(plan.count)] == [(a, b) for a in (1.0, 2.0) for b in "xyz"]


def test_plans_are_pickled(tmp_path):
    (tmp_path / "runs.csv").write_text("bodies.hub.mass,solve.method\n1,gauss\n2,radau\n")
    every = (plans.grid({"a": "1,2"}), plans.sample({"a": "normal(1, 0.1)"}, 2),
             plans.table(tmp_path / "runs.csv"),
             plans.listed(("a",), [(1.0,), (2.0,)], {"kind": "sensitivity"}))  # fmt: skip
    for plan in every:
        assert pickle.loads(pickle.dumps(plan)).row(1) == plan.row(1)


@pytest.mark.parametrize("sampler", plans.SAMPLERS)
def test_samples_repeat_and_fill_what_they_are_of(sampler):
    vary = {"a": "uniform(0, 1)", "b": "normal(5, 1)"}
    one, again, other = (plans.sample(vary, 64, sampler, seed) for seed in (1, 1, 2))
    rows = np.array([one.row(k) for k in range(64)])
    assert (rows == np.array([again.row(k) for k in range(64)])).all()
    assert one.facts == again.facts != other.facts
    assert abs(rows.mean(axis=0) - [0.5, 5.0]).max() < (0.2 if sampler == "random" else 0.03)
    if sampler == "lhs":
        assert sorted(np.floor(rows[:, 0] * 64)) == list(range(64))


# --- rows ----------------------------------------------------------------------------------------


def test_rows_say_what_runs_of_their_own_say(wheel):
    told = call("wheel.yaml", "--vary", f"{STIFF}=lin(50,150,3)", "--jobs", 2, "--collect", "max(hub.angle)",
                "final(hub.rim.x)", "at(0.25, hub.angle)", "--no-plots")  # fmt: skip
    assert told.exit_code == 0, told.output
    for row, stiffness in zip(rows_of("wheel.sweep"), (50.0, 100.0, 150.0), strict=True):
        assert float(row[STIFF]) == stiffness and row["status"] == "done"
        run = simulate(parse_deck(WHEEL, "wheel.yaml", [f"{STIFF}={stiffness}"]))
        rate = np.sqrt(stiffness)
        assert float(row["final(hub.rim.x)"]) == run["hub.rim.x"][-1]
        assert float(row["max(hub.angle)"]) == pytest.approx(1.0 / rate, rel=1e-7)
        assert float(row["at(0.25, hub.angle)"]) == pytest.approx(np.sin(0.25 * rate) / rate, rel=1e-6)
        assert float(row["error_estimate"]) == run.statistics["error_estimate"]
        assert float(row["energy_drift"]) == run.statistics["energy_drift"]


def test_without_collect_last_values_and_extremes_of_all_channels(wheel):
    assert call("wheel.yaml", "--vary", "initial.hub.angular_velocity=1,2", "-q", "--no-plots").exit_code == 0
    names = [name for name in rows_of("wheel.sweep")[0] if "(" in name]
    assert names == [f"{what}({c})" for c in ("hub.angle", "hub.rim.x") for what in ("final", "min", "max")]


def test_frequencies_are_collected_with_runs_and_without(wheel):
    names = ("--collect", "frequency(1)", "final(hub.angle)")
    rest = ("--no-plots", "--set", "initial.hub.angular_velocity=0")
    for folder, some in (("both", names), ("alone", names[:2])):
        assert call("wheel.yaml", "--vary", f"{STIFF}=50,200", *some, *rest, "-o", folder).exit_code == 0
        for row in rows_of(folder):
            exact = np.sqrt(float(row[STIFF])) / (2.0 * np.pi)
            assert float(row["frequency(1)"]) == pytest.approx(exact, rel=1e-8) and row["status"] == "done"
    assert float(rows_of("both")[0]["final(hub.angle)"]) == 0.0
    assert rows_of("alone")[0]["error_estimate"] == ""


def test_critical_loads_are_collected(wheel):
    push = "loads: {push: {type: force, at: hub.rim, force: [-20.0, 0.0]}}\n"
    (wheel / "wheel.yaml").write_text(WHEEL + push)
    options = ("--vary", f"{STIFF}=50,200", "--collect", "critical(1)", "frequency(1)", "--no-plots")
    assert call("wheel.yaml", *options, "--set", "initial.hub.angular_velocity=0").exit_code == 0
    for row in rows_of("wheel.sweep"):
        assert float(row["critical(1)"]) == pytest.approx(float(row[STIFF]) / 20.0, rel=1e-9)
        assert row["status"] == "done" and row["frequency(1)"]


def test_a_number_that_there_is_not_is_told_in_a_row_that_is_done(wheel):
    """Alone as beside a run; where a study finds nothing at all, the row has failed."""
    options = ("--vary", f"{STIFF}=50", "--no-plots", "--set", "initial.hub.angular_velocity=0")
    for folder, some in (("alone", ()), ("both", ("final(hub.angle)",))):
        told = call("wheel.yaml", *options, "--collect", "frequency(1)", "frequency(2)", *some, "-o", folder)
        (row,) = rows_of(folder)
        assert told.exit_code == 0 and (row["status"], row["class"]) == ("done", "")
        assert row["frequency(1)"] and row["reason"] == "of 2 modes there are 1"
    push = "loads={push: {type: moment, at: hub, moment: 1.0}}"
    free = ("--vary", f"{STIFF}=0", "--set", "springs.coil.damping=1", "--set", push)
    assert call("wheel.yaml", *free, "--collect", "critical(1)", "--no-plots", "-o", "free").exit_code == 0
    (row,) = rows_of("free")
    assert row["status"] == "failed" and row["reason"].startswith("nothing holds what the loads push")


SHALLOW = """
hfsim: 1
name: shallow
bodies: {top: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {guide: {type: prismatic, between: [ground, top], axis: [0.0, 1.0]}}
springs: {a: {type: two_point, between: [ground.l, top], stiffness: 10.0, rest_length: 1.2}}
ground: {points: {l: [-1.0, 0.0]}}
initial: {top: {position: [0.0, 0.6633249580710799]}}
loads: {push: {type: force, at: top, force: [0.0, -0.2]}}
solve: {duration: 1.0}
"""


def test_load_factors_that_are_not_reached_are_no_critical_loads(wheel):
    (wheel / "shallow.yaml").write_text(SHALLOW)
    options = ("--vary", "solve.tolerance=1e-6", "--collect", "critical(1)", "--no-plots")
    assert call("shallow.yaml", *options).exit_code == 0
    (row,) = rows_of("shallow.sweep")
    assert row["critical(1)"] == "" and "not reached" in row["reason"]


def test_a_sweep_whose_first_middle_and_last_runs_are_refused_is_done(wheel):
    """One of six runs can be: it was given up as all of those tried before were refused."""
    two = ("--vary", "bodies.hub.mass=1,-2", "--vary", f"{STIFF}=-1,50,-2")
    told = call("wheel.yaml", *two, "--no-plots", "--set", "solve.duration=0.1")
    assert told.exit_code == 0, told.output
    statuses = [row["status"] for row in rows_of("wheel.sweep")]
    assert statuses == ["refused", "done", "refused", "refused", "refused", "refused"]


def test_all_that_keeps_runs_from_being_put_together_is_told(wheel):
    """Each of two runs has an error of its own, in an entry that is varied and in one that is not."""
    (wheel / "runs.csv").write_text("bodies.hub.mass,parameters.wide\n-1,1\n1,-1\n")
    text = WHEEL.replace("[1.0, 0.0]", '["${sqrt(wide)}", 0.0]')
    (wheel / "wheel.yaml").write_text(text + "parameters: {wide: 1}\n")
    told = call("wheel.yaml", "--table", "runs.csv", "--no-plots")
    assert told.exit_code == 2
    assert "--vary: error: bodies.hub.mass: must be greater than 0" in told.stderr
    assert "sqrt" in told.stderr and "2 errors" in told.stderr


def test_a_failed_run_is_a_row(wheel):
    two = ("--vary", "bodies.hub.mass=1,-1", "--vary", "solve.max_steps=1,1000")
    told = call("wheel.yaml", *two, "--no-plots", "--set", "solve.duration=20")
    assert told.exit_code == 0, told.output
    assert [row["status"] for row in rows_of("wheel.sweep")] == ["limit", "done", "refused", "refused"]
    assert "bodies.hub.mass=-1 is refused" in told.stderr
    assert "  run 1: limit" in told.stdout and "  run 3 and 1 more: refused" in told.stdout
    facts = json.loads((wheel / "wheel.sweep/sweep.json").read_text())
    assert facts["counts"] == {"limit": 1, "done": 1, "refused": 2} and facts["status"] == "done"


def test_a_table_has_a_run_a_row(wheel):
    (wheel / "runs.csv").write_text(f"{STIFF}, solve.method\n100, gauss\n\n200, radau\n")
    assert call("wheel.yaml", "--table", "runs.csv", "--no-plots", "--keep", "histories").exit_code == 0
    assert [row["solve.method"] for row in rows_of("wheel.sweep")] == ["gauss", "radau"]
    history = (wheel / "wheel.sweep/histories/000002.csv").read_text().splitlines()
    assert history[0] == "t,hub.angle,hub.rim.x" and len(history) > 10


def test_parameters_are_varied_and_folders_kept(wheel):
    (wheel / "wheel.yaml").write_text(
        WHEEL.replace("stiffness: 100.0", "stiffness: '${10*k}'") + "parameters: {k: 10}\n"
    )
    kept = ("--keep", "folders", "--no-plots")
    assert call("wheel.yaml", "--vary", "parameters.k=10,20", *kept).exit_code == 0
    for number, stiffness in (("000001", 100.0), ("000002", 200.0)):
        text = (wheel / f"wheel.sweep/runs/{number}/resolved.yaml").read_text()
        assert f"stiffness: {stiffness}" in text
    assert call("wheel.yaml", "--vary", "parameters.k=10", "--force", "--no-plots").exit_code == 0
    assert not list((wheel / "wheel.sweep").glob("runs/*"))


@pytest.mark.parametrize("kept", ["folders", "histories"])
def test_another_command_replaces_a_sweep_with_what_it_kept(wheel, kept):
    assert call("wheel.yaml", "--vary", f"{STIFF}=50,100", "--keep", kept).exit_code == 0
    (mine := next(wheel.glob("wheel.sweep/*/000002*")).parent / "notes.txt").write_text("mine")
    run = ["run", "wheel.yaml", "--no-plots", "-o", "wheel.sweep", "--force"]
    assert CliRunner().invoke(app, run).exit_code == 0
    left = {path.name for path in (wheel / "wheel.sweep").rglob("*")}
    files = {"history.csv", "resolved.yaml", "run.log", "summary.json"}
    assert left == {*files, mine.parent.name, mine.name}


def test_pictures(wheel):
    most = ("--collect", "max(hub.angle)", "--no-error-estimate")
    call("wheel.yaml", "--vary", f"{STIFF}=lin(50,150,3)", "-o", "one", *most)
    steps = ("--vary", "solve.step=lin(1e-2,2e-2,3)")
    call("wheel.yaml", "--vary", f"{STIFF}=lin(50,150,3)", *steps, "-o", "two", *most)
    call("wheel.yaml", "--vary", f"{STIFF}=normal(100,5)", "--vary", "bodies.hub.inertia=1,2", "--sample", 20,
         "-o", "many", *most)  # fmt: skip
    assert [path.name for path in (wheel / "one/plots").iterdir()] == ["response_max_hub.angle.png"]
    assert [path.name for path in (wheel / "two/plots").iterdir()] == ["map_max_hub.angle.png"]
    assert {path.name for path in (wheel / "many/plots").iterdir()} == {"scatter.png", "effects.png"}
    effects = json.loads((wheel / "many/sweep.json").read_text())["main_effects"]["max(hub.angle)"]
    assert effects["bodies.hub.inertia"] > 0.9 > 0.2 > effects[STIFF]


@pytest.mark.parametrize(
    ("x", "v", "share"),
    [("0, 1", "0, 1", 0.5), ("0, 1, 2", "0, 1", 8.0 / 11.0), ("lin(0, 1, 21)", "5, 7", 11.0 / 131.0)],
)
def test_main_effects_of_a_sum_over_a_grid_are_the_variances_of_its_parts(x, v, share):
    plan = plans.grid({"x": x, "v": v})
    rows = np.array([plan.row(k) for k in range(plan.count)])
    columns = {"x": rows[:, 0], "v": rows[:, 1], "sum": rows.sum(axis=1)}
    effects = main_effects(Sweep("sum", "done", plan, columns, ("sum",)))
    assert effects["sum"] == pytest.approx({"x": share, "v": 1.0 - share}, abs=1e-9)


def test_a_grid_with_a_hole_is_none_of_main_effects():
    """What as many groups at random would explain is taken off: 7/5 of what the means leave, 3/5 of all."""
    plan = plans.grid({"x": "0, 1, 2", "v": "0, 1, 2"})
    rows = np.array([plan.row(k) for k in range(plan.count)])
    total = rows.sum(axis=1)
    total[0] = np.nan
    columns = {"x": rows[:, 0], "v": rows[:, 1], "sum": total}
    effects = main_effects(Sweep("sum", "done", plan, columns, ("sum",)))
    assert effects["sum"] == pytest.approx({"x": 0.16, "v": 0.16})


QUICK = ("--no-plots", "--jobs", 1)


def test_runs_that_end_at_other_times_have_what_they_reach(wheel):
    """The deck's own run ends at 0.5 s."""
    late = ("--collect", "at(0.7, hub.angle)", "final(hub.angle)", "-o", "late", "--force", *QUICK)
    timed = WHEEL.replace("duration: 0.5", "duration: '${T}'") + "parameters: {T: 0.5}\n"
    (wheel / "wheel.yaml").write_text(timed)
    for path in ("solve.duration", "parameters.T"):
        told = call("wheel.yaml", "--vary", f"{path}=0.6,0.7,0.8", *late)
        assert told.exit_code == 0, told.stderr
        rows = rows_of("late")
        assert [bool(row["at(0.7, hub.angle)"]) for row in rows] == [False, True, True]
        assert [row["reason"] for row in rows] == ["at(0.7, hub.angle): the run ends at t = 0.6 s", "", ""]
        assert all(row["final(hub.angle)"] for row in rows)
    assert call("wheel.yaml", "--sensitivity", "--vary", "solve.duration=0.8", *late).exit_code == 0
    (wheel / "own.yaml").write_text(
        WHEEL + "sweep: {vary: {solve.duration: [0.7, 0.8]}, collect: ['at(0.7, hub.angle)']}\n"
    )
    assert call("own.yaml", *QUICK).exit_code == 0


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ((), "nothing is varied"),
        (("--vary", "springs.coil.stifness=1,2"), "stifness.*did you mean 'stiffness'"),
        (("--vary", "sprongs.coil.stiffness=1,2"), "there is no sprongs"),
        (("--vary", f"{STIFF}=-1,-2"), "--vary: error: springs.coil.stiffness"),
        (("--vary", f"{STIFF}=normal(1,2)"), "--sample N"),
        (("--vary", f"{STIFF}=normal(1,-2)", "--sample", 5), "standard deviation"),
        (("--vary", f"{STIFF}=1", "--vary", f"{STIFF}=2"), "twice"),
        (("--vary", STIFF), "write lin"),
        (("--vary", "parameters.k=1,2"), "there is no parameters"),
        (("--vary", f"{STIFF}=1,2", "--collect", "peak(hub.angle)"), "there is no quantity 'peak'"),
        (("--vary", f"{STIFF}=1,2", "--collect", "max(hub.angel)"), "angel"),
        (("--vary", f"{STIFF}=1,2", "--collect", "at(0.6, hub.angle)"), "ends at 0.5 s"),
        (("--vary", f"{STIFF}=1,2", "--collect", "max(hub.angle, 0.2..0.6)"), "nothing at 0.6 s"),
        (("--vary", f"{STIFF}=1,2", "--collect", "frequency(0)"), "counts from 1"),
        (("--vary", f"{STIFF}=lin(1,2,1001)", "--vary", "bodies.hub.mass=lin(1,2,1000)"), "say --yes"),
        ((*(f"--vary={a}=lin(1,2,9000)" for a in (STIFF, "bodies.hub.mass")), "--yes"), "at most"),
        (("--vary", f"{STIFF}=1,2", "--sample", 5, "--sampler", "halton"), "there is no sampler"),
        (("--table", "none.csv"), "none.csv cannot be read"),
        (("--table", "bad.csv"), r"bad.csv:3:1: error: 1 values for 2 columns"),
        (("--table", "empty.csv"), "no rows"),
        (("--table", "hole.csv"), "hole.csv:2:1: error: a: the value is missing"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_before_anything_runs(wheel, options, why):
    (wheel / "bad.csv").write_text("a,b\n1,2\n3\n")
    (wheel / "empty.csv").write_text("a,b\n")
    (wheel / "hole.csv").write_text("a,b\n,2\n")
    told = call("wheel.yaml", *options)
    assert told.exit_code == 2, told.output
    assert re.search(why, " ".join(told.stderr.split())), told.stderr
    assert not (wheel / "wheel.sweep").exists()


def test_all_that_is_wrong_is_told_at_once(wheel):
    vary = ("springs.coil.stifness=1,2", f"{STIFF}=lin(1,2)", "bodies.hub.mass=normal(1,2)")
    collect = ("peak(hub.angle)", "max(hub.angel)", "max(hub.angle)", "at(0.6, hub.angle)")
    told = call("wheel.yaml", *(f"--vary={one}" for one in vary), "--collect", *collect)
    assert told.exit_code == 2
    places = [line.split(": ")[:3] for line in told.stderr.splitlines() if ": error: " in line]
    assert {(option, entry) for option, _, entry in places} == {
        ("--vary", "springs.coil.stifness"),
        ("--vary", STIFF),
        ("--vary", "bodies.hub.mass"),
        ("--collect", collect[0]),
        ("--collect", collect[1]),
        ("--collect", collect[3]),
    }
    told = call("wheel.yaml", "--sensitivity", *(f"--vary={one}" for one in vary), "--collect", *collect)
    assert told.exit_code == 2 and "6 errors. Nothing was run." in told.stderr
    (wheel / "two.csv").write_text(f"{STIFF},springs.coil.stifness\n1,2\n3\n,inf\n")
    told = call("wheel.yaml", "--table", "two.csv", "--collect", "peak(hub.angle)")
    assert [f"two.csv:{line}:1" in told.stderr for line in (2, 3, 4)] == [False, True, True]
    assert told.stderr.count("two.csv:4:1") == 2 and "--collect: error: peak" in told.stderr
    assert not (wheel / "wheel.sweep").exists()


# --- going on ------------------------------------------------------------------------------------

GRID = ("--vary", f"{STIFF}=lin(50,150,6)", "--vary", "solve.method=gauss,radau", "--no-plots")


def test_a_sweep_goes_on_and_its_table_is_the_same(wheel):
    assert call("wheel.yaml", *GRID, "-o", "whole").exit_code == 0
    assert call("wheel.yaml", *GRID, "-o", "cut").exit_code == 0
    lines = (wheel / "cut/runs.jsonl").read_text().splitlines(keepends=True)
    (wheel / "cut/runs.jsonl").write_text("".join(lines[:5]) + lines[5][:20])
    (wheel / "cut/sweep.csv").unlink()
    told = call("wheel.yaml", *GRID, "-o", "cut", "--resume")
    assert told.exit_code == 0 and "5 of 12 runs are there" in told.stderr
    assert without_times("cut") == without_times("whole")
    assert (wheel / "cut/runs.jsonl").read_text().startswith("".join(lines[:5]))
    assert call("wheel.yaml", *GRID, "-o", "cut").exit_code == 2
    assert "12 of 12 runs are there" in call("wheel.yaml", *GRID, "-o", "cut", "--resume").stderr


@pytest.mark.parametrize(
    ("options", "difference"),
    [
        (("--set", "bodies.hub.mass=2"), "resolved.bodies.hub.mass: 1.0 then, 2.0 now"),
        (("--collect", "max(hub.angle)"), "collect"),
        (("--vary", "solve.duration=1,2"), "count: 12 then, 24 now"),
        (("--no-error-estimate",), "setting.error_estimate: true then, false now"),
    ],
)
def test_a_changed_deck_or_plan_is_refused_with_the_difference(wheel, options, difference):
    assert call("wheel.yaml", *GRID).exit_code == 0
    before = (wheel / "wheel.sweep/runs.jsonl").read_bytes()
    told = call("wheel.yaml", *GRID, *options, "--resume")
    assert told.exit_code == 2
    assert difference in told.stderr
    assert (wheel / "wheel.sweep/runs.jsonl").read_bytes() == before


def start(*arguments):
    words = [sys.executable, "-m", "hfsim", "sweep", *map(str, arguments)]
    own = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}  # else as of who calls
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **own)


def wait_for_lines(path, count):
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        if path.exists() and path.read_bytes().count(b"\n") >= count:
            return
        time.sleep(0.005)
    pytest.fail("no runs came")


def test_an_interrupt_keeps_what_is_there(wheel):
    many = (*GRID, "--vary", "bodies.hub.inertia=lin(1,2,400)", "-o", "many")
    with start("wheel.yaml", *many) as sweep:
        wait_for_lines(wheel / "many/runs.jsonl", 20)
        sweep.send_signal(signal.SIGINT)
        _, told = sweep.communicate(timeout=60.0)
    assert sweep.returncode == 130 and "--resume" in told
    facts = json.loads((wheel / "many/sweep.json").read_text())
    assert facts["status"] == "interrupted"
    assert 20 <= len(rows_of("many")) == facts["runs"] - facts["missing"]


@pytest.mark.slow
def test_kills_at_random_moments_lose_nothing(wheel):
    many = (*GRID, "--vary", "bodies.hub.inertia=lin(1,2,30)", "--jobs", 2)
    assert call("wheel.yaml", *many, "-o", "whole").exit_code == 0
    done, moments = 0, random.Random(1)
    for _ in range(20):
        with start("wheel.yaml", *many, "-o", "killed", "--resume") as sweep:
            time.sleep(moments.uniform(0.3, 1.2))
            sweep.kill()
            sweep.communicate(timeout=30.0)
        path = wheel / "killed/runs.jsonl"
        now = path.read_bytes().count(b"\n") if path.exists() else 0
        assert now >= done
        done = now
    assert call("wheel.yaml", *many, "-o", "killed", "--resume").exit_code == 0
    assert without_times("killed") == without_times("whole")
    assert (wheel / "killed/runs.jsonl").read_bytes().count(b"\n") == 360


def die_once(path):
    if not os.path.exists(path):
        Path(path).touch()
        os._exit(9)
    return "there"


def test_a_run_whose_worker_dies_is_done_again(tmp_path):
    from hfsim.studies.farm import Farm, Task

    farm = Farm(1)
    farm.add(Task("a", die_once, str(tmp_path / "mark"), tries=2))
    (outcome,) = farm.outcomes()
    assert outcome.value == "there"


# --- decks and Python ----------------------------------------------------------------------------

IN_DECK = f"sweep: {{vary: {{{STIFF}: [50, 100]}}, collect: [max(hub.angle)], seed: 3}}\n"


def test_a_deck_says_its_own_sweep_and_options_win(wheel):
    (wheel / "wheel.yaml").write_text(WHEEL + IN_DECK)
    assert call("wheel.yaml", "--no-plots").exit_code == 0
    assert [float(row[STIFF]) for row in rows_of("wheel.sweep")] == [50.0, 100.0]
    assert "max(hub.angle)" in rows_of("wheel.sweep")[0]
    options = ("--vary", "bodies.hub.inertia=1,2,3", "--collect", "final(hub.angle)", "-o", "other")
    assert call("wheel.yaml", "--no-plots", *options).exit_code == 0
    assert [row["bodies.hub.inertia"] for row in rows_of("other")] == ["1", "2", "3"]
    assert not any(name in rows_of("other")[0] for name in (STIFF, "max(hub.angle)"))
    (wheel / "runs.csv").write_text("bodies.hub.mass\n1\n2\n")
    (wheel / "wheel.yaml").write_text(WHEEL + "sweep: {runs: runs.csv}\n")
    assert call("wheel.yaml", "--no-plots", "-o", "tabled").exit_code == 0
    assert len(rows_of("tabled")) == 2


def test_derivatives_and_how_sure_they_are(wheel):
    paths = (STIFF, "initial.hub.angular_velocity", "bodies.hub.inertia")
    told = call("wheel.yaml", "--sensitivity", *(f"--vary={path}" for path in paths), "--collect",
                "max(hub.angle)", "final(hub.angle)", "-o", "s")  # fmt: skip
    assert told.exit_code == 0, told.output
    with (wheel / "s/sensitivity.csv").open(newline="") as file:
        found = {(row["quantity"], row["path"]): row for row in csv.DictReader(file)}
    for path, elasticity in zip(paths, (-0.5, 1.0, 0.5), strict=True):
        row = found["max(hub.angle)", path]
        assert float(row["elasticity"]) == pytest.approx(elasticity, rel=1e-5) and row["sure"] == "yes"
    row = found["final(hub.angle)", STIFF]
    rate, t = 10.0, 0.5
    exact = (t * np.cos(rate * t) / rate - np.sin(rate * t) / rate**2) / (2.0 * rate)
    assert abs(float(row["derivative"]) - exact) < float(row["error"]) < 1e-4 * abs(exact)
    assert (wheel / "s/plots/sensitivity.png").exists()


def test_a_derivative_at_a_limit_of_an_entry_is_of_one_side(wheel):
    damping, rate, c = "springs.coil.damping", 10.0, 1.0
    (found,) = hfsim.sensitivity("wheel.yaml", [damping], ["final(hub.angle)"])
    t = 0.5  # of exp(-c t / 2) sin(w t) / w, whose w changes with the square of c
    assert found.derivative == pytest.approx(-0.5 * c * t * np.sin(rate * t) / rate, rel=1e-4)
    assert found.side == "up" and found.sure and found.elasticity is None


def test_a_derivative_at_an_upper_limit_is_that_from_below():
    """2 + 3 (p - 1), which is nothing above p = 1."""
    made = Differences({"p": 1.0}, {"p": 0.1}, (0.0,))
    found = _sensitivity([2.0, np.nan, 1.7, np.nan, 1.85], 0, "q", "p", 0.0, made)
    assert (found.side, found.derivative) == ("down", pytest.approx(3.0))


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--vary", STIFF), "--collect: error: nothing is collected"),
        (("--vary", STIFF, "--collect", "max(hub.angle)", "--sample", 3), "derivatives have runs"),
        (("--vary", "solve.method", "--collect", "max(hub.angle)"), "no number there"),
        (("--vary", "springs.coil.stifness", "--collect", "max(hub.angle)"), "stifness"),
        (("--vary", f"{STIFF}=1,2", "--collect", "max(hub.angle)"), "not one number"),
        (("--vary", STIFF, "--collect", "frequency(1)"), "numbers of runs alone"),
    ],
)
def test_derivatives_that_cannot_be_are_refused(wheel, options, why):
    told = call("wheel.yaml", "--sensitivity", *options)
    assert told.exit_code == 2 and why in " ".join(told.stderr.split()), told.output


def test_derivatives_from_python(wheel):
    spin = "initial.hub.angular_velocity"
    found = hfsim.sensitivity("wheel.yaml", [STIFF, spin], ["max(hub.angle)"], output="s", plots=False)
    assert [one.elasticity for one in found] == pytest.approx([-0.5, 1.0], rel=1e-5)
    assert all(one.sure for one in found) and (wheel / "s/sensitivity.csv").exists()
    other = hfsim.sensitivity("wheel.yaml", {spin: 2.0, STIFF: None}, ["max(hub.angle)"], jobs=1)
    assert [one.at for one in other] == [2.0, 100.0] and other[0].value == pytest.approx(0.2, rel=1e-6)
    with pytest.raises(hfsim.DeckError, match="stifness"):
        hfsim.sensitivity("wheel.yaml", ["springs.coil.stifness"], ["max(hub.angle)"])


def test_from_python(wheel):
    found = hfsim.sweep("wheel.yaml", {STIFF: np.array([50.0, 100.0]), "solve.method": ["gauss", "radau"]},
                        ["max(hub.angle)"], {"bodies.hub.mass": 2.0}, jobs=2)  # fmt: skip
    assert found.counts == {"done": 4} and len(found) == 4
    assert found[STIFF].tolist() == [50.0, 50.0, 100.0, 100.0]
    assert found["max(hub.angle)"] == pytest.approx(1.0 / np.sqrt(found[STIFF]), rel=1e-7)
    with pytest.raises(KeyError, match="max"):
        found["max(hub.angel)"]
    with pytest.raises(hfsim.HfsimError, match="random"):
        hfsim.sweep("wheel.yaml", {STIFF: "normal(1, 1)"})
    again = pickle.loads(pickle.dumps(found))
    assert again[STIFF].tolist() == found[STIFF].tolist() and again.plan.row(1) == found.plan.row(1)
    told = hfsim.sweep("wheel.yaml", {STIFF: "lin(50, 60, 2)"}, output="written", plots=False)
    assert told["cpu_s"].sum() > 0.0 and len(rows_of("written")) == 2


def test_workers_begin_anew_where_other_threads_are_at_work(wheel, monkeypatch):
    """A fork would keep the locks that these hold closed for ever, as those of modules being imported."""
    begun, go, kinds, context = threading.Event(), threading.Event(), [], multiprocessing.get_context

    def hold(share):
        begun.set()
        go.wait(60.0)

    monkeypatch.setattr(multiprocessing, "get_context", lambda kind: kinds.append(kind) or context(kind))
    other = threading.Thread(target=hfsim.run, args=("wheel.yaml",), kwargs={"progress": hold})
    other.start()
    assert begun.wait(60.0)
    found = hfsim.sweep("wheel.yaml", {STIFF: [50.0, 100.0]}, ["max(hub.angle)"], jobs=2)
    go.set()
    other.join()
    again = hfsim.sweep("wheel.yaml", {STIFF: [50.0, 100.0]}, ["max(hub.angle)"], jobs=2)
    assert kinds == ["spawn", "spawn", "fork", "fork"]
    assert found["max(hub.angle)"].tolist() == again["max(hub.angle)"].tolist()


def test_the_script_is_there_again_when_several_threads_have_begun_workers():
    script, inside = sys.modules["__main__"], []

    def begin():
        with _without_script():
            inside.append(sys.modules["__main__"])
            time.sleep(0.2 * len(inside))  # the first to come is the first to leave

    try:
        threads = [threading.Thread(target=begin) for _ in range(2)]
        for one in threads:
            one.start()
        for one in threads:
            one.join()
        assert sys.modules["__main__"] is script and script not in inside
    finally:
        sys.modules["__main__"] = script


def test_ranges_are_told_of_what_has_one(wheel, monkeypatch):
    monkeypatch.setattr("hfsim.output.sweep._TOLD", 1)
    more = "more (sweep.json has their ranges)"
    fails = ("--set", "solve.method=gauss", "--set", "solve.duration=2", "--vary", "solve.step=0.5,0.6")
    told = call("pendulum", *fails, "--no-plots", "-o", "failed").stdout
    assert "2 failed" in told and more not in told
    told = call("wheel.yaml", "--vary", f"{STIFF}=200,200.00001", "--no-plots", "-o", "near").stdout
    assert more in told and "2 values about 200 N m/rad, at most 1e-05 apart" in told


def test_what_is_varied_is_drawn_with_its_unit():
    from hfsim.output.plots.sweep import _over_two

    vary = {"bodies.hub.mass": "lin(1, 2, 7)", STIFF: "lin(50, 100, 7)"}
    found = hfsim.sweep(parse_deck(WHEEL), vary, ["frequency(1)"])
    assert found.units == {"bodies.hub.mass": "kg", STIFF: "N m/rad", "frequency(1)": "Hz"}
    axes = _over_two(found, list(vary), "frequency(1)").axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("bodies.hub.mass [kg]", f"{STIFF} [N m/rad]")
    words = hfsim.sweep(parse_deck(WHEEL), {"solve.model": "exact, linear"}, ["frequency(1)"])
    assert words.units == {"solve.model": "", "frequency(1)": "Hz"}


def test_texts_with_units_are_numbers_in_si(wheel):
    texts = {"bodies.hub.mass": ["500 g", "2 kg", 1.5], "parameters.rate": ["180 deg/s", "1 rad/s"]}
    deck = WHEEL.replace("angular_velocity: 1.0", 'angular_velocity: "${rate}"') + "parameters: {rate: 1}\n"
    (wheel / "wheel.yaml").write_text(deck)
    found = hfsim.sweep("wheel.yaml", texts, ["max(hub.angle)"], output="written")
    assert found["bodies.hub.mass"].tolist() == [0.5, 0.5, 2.0, 2.0, 1.5, 1.5]
    assert found["parameters.rate"][:2] == pytest.approx([math.pi, 1.0], rel=1e-15)
    assert found["max(hub.angle)"][:2] == pytest.approx([math.pi / 10, 0.1], rel=1e-6)
    assert found.units == {"bodies.hub.mass": "kg", "parameters.rate": "rad/s", "max(hub.angle)": "rad"}
    assert [float(row["bodies.hub.mass"]) for row in rows_of("written")] == [0.5, 0.5, 2.0, 2.0, 1.5, 1.5]
    mixed = hfsim.sweep("wheel.yaml", {"solve.coordinates": ["auto", "absolute"]}, ["max(hub.angle)"])
    assert mixed["solve.coordinates"].tolist() == ["auto", "absolute"]


@pytest.mark.parametrize(
    ("text", "share", "value"),
    [
        ("lin(80 cm, 1.6 m, 3)", 0.5, 1.2),
        ("log(1 GPa, 100 GPa, 3)", 0.5, 1e10),
        ("uniform(-90 deg, 90 deg)", 0.75, math.pi / 4),
        ("normal(1 m, 2 cm)", 0.5, 1.0),
        ("lognormal(7 MPa, 0.2)", 0.5, 7e6),
        ("lin(5 %, 15 %, 3)", 0.5, 0.1),
        ("lin(0, 90 deg, 3)", 0.5, math.pi / 4),
    ],
)
def test_ranges_may_have_units(text, share, value):
    found = read_values(text)
    assert found.in_si(found.at(share)) == pytest.approx(value, rel=1e-11)
    assert all(isinstance(found.in_si(one), float) for one in found.listed)


@pytest.mark.parametrize(
    "text",
    [
        "lin(1 m, 2 kg, 3)", "lin(1 m, 2, 3)", "lin(1 m, 2 m, 3 m)", "lin(1 qq, 2 qq, 3)",
        "lognormal(1, 2 m)", "integers(1 m, 2 m)",
    ],
)  # fmt: skip
def test_ranges_have_one_unit_where_one_is_meant(text):
    with pytest.raises(RangeError):
        read_values(text)


def test_tables_read_numbers_as_decks_do(tmp_path):
    (tmp_path / "runs.csv").write_text("solve.method,bodies.hub.mass\n1_0,1e1\n")
    assert plans.table(tmp_path / "runs.csv").row(0) == ("1_0", 10.0)


def test_no_samples_are_refused_and_not_taken_from_the_deck():
    deck = parse_deck(f"{WHEEL}\nsweep: {{vary: {{bodies.hub.mass: 'normal(1, 0.1)'}}, sample: 3}}\n")
    assert len(hfsim.sweep(deck, collect=["max(hub.angle)"])["max(hub.angle)"]) == 3
    with pytest.raises(hfsim.DeckError, match="one run at least"):
        hfsim.sweep(deck, collect=["max(hub.angle)"], sample=0)


def test_a_range_with_units_is_swept_and_checked(wheel):
    path = "initial.hub.angular_velocity"
    found = hfsim.sweep("wheel.yaml", {path: "lin(60 rpm, 120 rpm, 2)"}, ["max(hub.angle)"])
    assert found[path] == pytest.approx([2 * math.pi, 4 * math.pi]) and found.units[path] == "rad/s"
    assert found["max(hub.angle)"] == pytest.approx([math.pi / 5, 2 * math.pi / 5], rel=1e-6)
    drawn = hfsim.sweep("wheel.yaml", {path: "normal(60 rpm, 3 rpm)"}, ["max(hub.angle)"], sample=3)
    assert drawn[path].dtype == float and abs(drawn[path] - 2 * math.pi).max() < 2.0
    with pytest.raises(hfsim.DeckError, match="is a unit of mass"):
        hfsim.sweep("wheel.yaml", {path: "lin(1 kg, 2 kg, 2)"}, ["max(hub.angle)"])


def test_texts_with_units_are_drawn_on_an_axis_of_numbers():
    from hfsim.output.plots.sweep import _response

    found = hfsim.sweep(parse_deck(WHEEL), {"bodies.hub.mass": "2 kg, 500 g"}, ["max(hub.angle)"])
    axes = _response(found, "bodies.hub.mass", "max(hub.angle)").axes[0]
    assert axes.get_xlabel() == "bodies.hub.mass [kg]"
    assert axes.lines[0].get_xdata().tolist() == [0.5, 2.0]


def test_curves_of_a_map_that_cover_one_another_are_dashed_and_runs_without_a_value_are_crosses():
    from hfsim.output.plots.sweep import _over_two

    vary = {"bodies.hub.points.rim": "[1, 0],[2, 0],[3, 0]", "bodies.hub.mass": "lin(-1, 2, 3)"}
    found = hfsim.sweep(parse_deck(WHEEL), vary, ["max(hub.angle)"])
    figure = _over_two(found, found.paths, "max(hub.angle)")
    curves = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert [line.get_xdata().tolist() for line in curves] == [[0.5, 2.0]] * 3
    assert [line.is_dashed() for line in curves] == [False, True, True]
    assert len({line.get_markersize() for line in curves}) == 3
    crosses = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert [line.get_xdata().tolist() for line in crosses[:3]] == [[-1.0]] * 3
    assert [line.get_color() for line in crosses[:3]] == [line.get_color() for line in curves]
    assert len({float(line.get_ydata()[0]) for line in crosses[:3]}) == 3
    told = [text.get_text() for text in figure.legends[0].texts]
    assert told == ["[1, 0]", "[2, 0]", "[3, 0]", "no value"]


def test_a_derivative_is_taken_at_a_text_with_a_unit(wheel):
    path = "initial.hub.angular_velocity"
    told = call("wheel.yaml", "--sensitivity", f"--vary={path}=180 deg/s", "--collect", "max(hub.angle)")
    assert told.exit_code == 0
    facts = json.loads((wheel / "wheel.sweep/sweep.json").read_text())
    assert facts["plan"]["values"][path] == pytest.approx(math.pi)
    asked = ("--sensitivity", f"--vary={path}=2 kg", "--collect", "max(hub.angle)", "-o", "other")
    refused = call("wheel.yaml", *asked)
    assert refused.exit_code == 2 and "'2 kg' is not one number in rad/s" in refused.stderr


def test_ranges_are_told_with_units(wheel):
    told = call("wheel.yaml", "--vary", "bodies.hub.mass=500 g,2 kg", "--no-plots").stdout
    assert "bodies.hub.mass: 2 values from 0.5 to 2 kg" in told
    assert "  max(hub.angle) [rad]  " in told and "  final(hub.rim.x) [m]  " in told


def test_titles_of_pictures_are_not_cut_off(wheel):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from hfsim.output.plots.sweep import _effects, _matrix

    vary = {"bodies.hub.mass": "lin(1, 2, 2)", STIFF: "lin(50, 100, 2)"}
    found = hfsim.sweep(parse_deck(WHEEL), vary, ["max(hub.angle)"])
    for draw in (_effects, _matrix):
        figure = draw(found, list(vary), ["max(hub.angle)"])
        FigureCanvasAgg(figure).draw()
        title = figure.texts[0].get_window_extent()
        assert title.x0 >= 0.0 and title.x1 <= figure.bbox.width
