"""The judgement of `compare`, on synthetic runs whose differences are known."""

import csv
import json
import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import call

from hfsim.marching.distance import channel_errors
from hfsim.marching.solution import Channel, Run
from hfsim.output.comparison import COLUMNS, as_rows, as_text
from hfsim.output.plots.comparison import draw_comparison, overlay_limits
from hfsim.output.text import WIDTH
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import CASES
from hfsim.simulate import simulate
from hfsim.studies.compare.judge import compare
from hfsim.studies.compare.measurements import Measured, looser, measure, time_error
from hfsim.studies.compare.result import as_facts
from hfsim.studies.farm import Here


def make_run(model, error=0.0, cpu=1.0, end=1.0, deflection=None):
    """A tip on the unit circle, off by `error` from t = 0.5 s on; broken down if `end` is below 1 s."""
    t = np.linspace(0.0, 1.0, 101)
    t = t[t <= end + 1e-12]
    done = end >= 1.0
    channels = [
        Channel("b1.tip.x", "m", np.cos(math.pi * t) + error * (t >= 0.5)),
        Channel("constraint.position", "m", np.full_like(t, 1e-15 if model == "exact" else 1e-3)),
    ]
    if deflection is not None:
        channels.append(Channel("b1.tip.deflection", "m", deflection * np.sin(9.0 * t)))
    return Run(
        name="case",
        model=model,
        method="gauss",
        status="done" if done else "failed",
        reason="" if done else "the mass matrix became singular",
        t=t,
        channels=tuple(channels),
        outlines={"b1": np.zeros((len(t), 2, 2))},
        statistics={"cpu_s": {"build": 0.1, "solve": cpu}},
        failure=None if done else {"time": end},
        exit_code=0 if done else 3,
    )


def test_a_difference_is_measured_against_the_range_of_the_reference():
    result = compare([make_run("linear", 0.1), make_run("exact")], "exact", 0.01).result("linear")
    found = result.differences[0]
    assert found.max_abs == pytest.approx(0.1)
    assert found.max_relative == pytest.approx(0.05)
    assert found.rms == pytest.approx(0.1 * math.sqrt(51 / 101))
    assert found.first_exceeded == pytest.approx(0.5)
    assert not result.adequate


def test_the_cheapest_adequate_model_wins():
    runs = [make_run("linear", 0.1, cpu=0.1), make_run("lowOrder", 1e-3, cpu=0.5), make_run("exact", cpu=1.0)]
    comparison = compare(runs, "exact", 0.01)
    assert comparison.verdict == "lowOrder"
    assert comparison.sentence == (
        "verdict: lowOrder is the cheapest model within 1 % (worst channel b1.tip.x: 0.05 %)"
    )


def test_repeated_times_decide_by_their_median():
    runs = [make_run("ancf", cpu=9.0), make_run("exact", cpu=0.1)]
    times = Measured(times={"ancf": [1.3, 1.0, 1.1], "exact": [1.9, 2.0, 2.1]})
    comparison = compare(runs, "exact", 0.01, times)
    assert (comparison.verdict, comparison.ties) == ("ancf", ())
    found = comparison.result("ancf")
    assert (found.solve_cpu, found.solve_cpu_min, found.solve_cpu_max, found.repeats) == (1.1, 1.0, 1.3, 3)


@pytest.mark.parametrize("exact", [1.15, 0.9])
def test_times_that_cannot_be_told_apart_are_a_tie_and_the_whole_model_wins(exact):
    runs = [make_run("linear", 1e-3, cpu=1.0), make_run("ancf", cpu=1.05), make_run("exact", cpu=exact)]
    comparison = compare(runs, "exact", 0.01)
    assert (comparison.verdict, comparison.ties) == ("exact", ("linear", "ancf"))
    assert "ties with that of linear and ancf, and it leaves out least" in comparison.sentence
    assert compare([*runs[:2], make_run("exact", cpu=2.0)], "exact", 0.01).verdict == "ancf"


def test_a_wide_spread_makes_a_tie():
    runs = [make_run("linear", 1e-3), make_run("exact")]
    times = Measured(times={"linear": [1.0, 1.0, 1.8], "exact": [1.3, 1.4, 1.5]})
    assert compare(runs, "exact", 0.01, times).verdict == "exact"


# --- errors in time ------------------------------------------------------------------------------


def in_time(**errors):
    """Errors in time of the tip by model."""
    return Measured(errors={model: {"b1.tip.x": error} for model, error in errors.items()})


def test_errors_in_time_are_taken_out_of_a_difference():
    runs = [make_run("linear", 0.03, cpu=0.1), make_run("exact")]
    assert not compare(runs, "exact", 0.01).result("linear").adequate
    found = compare(runs, "exact", 0.01, in_time(linear=0.01, exact=0.002)).result("linear")
    assert found.worst.max_relative == pytest.approx(0.015)
    assert found.worst.time_error == pytest.approx(0.012)
    assert found.worst.beyond == pytest.approx(0.009)
    assert found.adequate and not found.worst.equal and found.first_exceeded is None
    assert (found.time_error, found.time_error_channel) == (pytest.approx(0.005), "b1.tip.x")


def test_what_is_within_the_errors_in_time_is_equal():
    runs = [make_run("linear", 1e-3, cpu=0.1), make_run("exact")]
    comparison = compare(runs, "exact", 0.01, in_time(linear=6e-4, exact=6e-4))
    assert comparison.result("linear").worst.equal
    assert comparison.sentence.endswith("(equal within the time error)")
    unknown = compare(runs, "exact", 0.01, in_time(linear=6e-4)).result("linear").worst
    assert not unknown.equal and unknown.time_error is unknown.time_error_relative is None


def test_errors_in_time_beyond_the_bound_decide_nothing():
    """A motion that is not resolved differs from run to run: that is no agreement of models."""
    runs = [make_run("linear", 0.5, cpu=0.1), make_run("exact")]
    comparison = compare(runs, "exact", 0.01, in_time(linear=0.9, exact=1e-3))
    found = comparison.result("linear")
    assert not found.adequate and found.undecided.channel == "b1.tip.x"
    assert "of no other model it is sure that it stays within 1 %" in comparison.sentence
    text = as_text(comparison, Path("out"))
    assert "linear is not decided: errors in time, 45 % in b1.tip.x, are beyond the bound" in text
    assert compare(runs, "exact", 0.01, in_time(linear=0.9, exact=0.9)).result("exact").adequate


# --- which channels decide -----------------------------------------------------------------------


def with_rate(run, error=0.0):
    """Add an angular velocity whose range is next to nothing against its size."""
    rate = Channel("b1.angular_velocity", "rad/s", 4.0 + 5e-4 * np.sin(9.0 * run.t) + error)
    return replace(run, channels=(*run.channels, rate))


def test_rates_decide_only_if_they_are_named():
    runs = [with_rate(make_run("lowOrder", 1e-6, cpu=0.1), 1e-3), with_rate(make_run("exact"))]
    assert compare(runs, "exact", 0.01).verdict == "lowOrder"
    named = compare(runs, "exact", 0.01, channels=("b1.angular_velocity",))
    assert named.verdict == "exact"
    assert [s.channel for s in named.scales if s.judged] == ["b1.angular_velocity"]
    assert named.result("lowOrder").worst.max_relative == pytest.approx(0.25, rel=0.01)


def test_without_motion_the_rest_decides_and_that_is_said():
    runs = [with_rate(make_run("lowOrder", cpu=0.1), 1e-3), with_rate(make_run("exact"))]
    runs = [replace(run, channels=run.channels[1:]) for run in runs]
    comparison = compare(runs, "exact", 0.01)
    assert comparison.verdict == "exact"
    assert "the verdict rests on b1.angular_velocity" in as_text(comparison, Path("out"))


@pytest.mark.parametrize(("own", "told"), [("absolute", True), ("frame", False)])
def test_two_models_in_the_same_coordinates_check_nothing(own, told):
    runs = [make_run("ancf"), make_run("exact")]
    measured = Measured(coordinates={"exact": own, "ancf": "absolute"})
    text = as_text(compare(runs, "exact", 0.01, measured), Path("out"))
    assert ("that they agree checks nothing" in text) == told


@pytest.mark.parametrize(("exact", "frames", "told"), [
    (15.0, "frame", "ancf"), (0.1, "frame", "exact"), (15.0, "absolute", "ancf"), (15.0, "", "ancf"),
])  # fmt: skip
def test_a_verdict_for_exact_or_ancf_says_that_they_are_one_model(exact, frames, told):
    runs = [make_run("linear", 0.5), make_run("ancf", cpu=1.0), make_run("exact", cpu=exact)]
    measured = Measured(coordinates={"exact": frames, "ancf": frames and "absolute"})
    comparison = compare(runs, "exact", 0.01, measured)
    assert comparison.verdict == told
    words = "; exact and ancf are one model: in absolute coordinates exact makes the steps of ancf"
    assert comparison.sentence.endswith(words) == (frames == "frame")
    cheap = [replace(runs[0], channels=runs[1].channels, statistics={"cpu_s": {"solve": 0.01}}), *runs[1:]]
    assert words not in compare(cheap, "exact", 0.01, measured).sentence


# --- early ends ----------------------------------------------------------------------------------


def test_what_a_signal_left_is_told_without_a_verdict():
    runs = [make_run("linear"), make_run("exact")]
    whole, cut = (compare(runs[:n], "exact", 0.01, interrupted=True) for n in (2, 1))
    assert whole.result("linear").worst is not None and cut.result("linear").worst is None
    for comparison in (whole, cut, compare([], "exact", 0.01, interrupted=True)):
        assert (comparison.status, comparison.verdict) == ("interrupted", None)
        assert "interrupted" in as_text(comparison, Path("out"))
    counted = [as_text(one, Path("out")).split(": ")[1] for one in (whole, cut)]
    assert [one.partition(" over")[0] for one in counted] == ["2 models", "1 model"]


def test_beside_a_reference_that_failed_no_model_is_adequate():
    comparison = compare([make_run("linear", cpu=0.1), make_run("exact", end=0.4)], "exact", 0.01)
    assert comparison.result("linear").worst.max_abs == 0.0
    assert not comparison.result("linear").adequate and comparison.verdict is None
    assert comparison.sentence.startswith("verdict: none, because the reference exact broke down at 0.4 s")


def test_where_nothing_can_be_judged_nothing_is_adequate():
    runs = [make_run("linear", cpu=0.1), make_run("exact")]
    comparison = compare([replace(run, channels=run.channels[1:]) for run in runs], "exact", 0.01)
    assert not any(one.adequate for one in comparison.models)
    assert comparison.sentence == "verdict: none, because no channel can be judged"
    assert comparison.sentence in as_text(comparison, Path("out"))


def test_without_an_adequate_model_the_reference_is_the_verdict():
    comparison = compare([make_run("linear", 0.5, cpu=0.1), make_run("exact")], "exact", 0.01)
    assert comparison.verdict == "exact"
    assert "no other model stays within 1 %" in comparison.sentence


def test_a_cheap_reference_is_its_own_verdict():
    comparison = compare([make_run("ancf", cpu=2.0), make_run("exact")], "exact", 0.01)
    assert comparison.sentence == "verdict: exact, the reference, is itself the cheapest model within 1 %"


def test_a_model_that_broke_down_is_compared_until_then_and_never_adequate():
    comparison = compare([make_run("lowOrder", cpu=0.1, end=0.4), make_run("exact")], "exact", 0.01)
    result = comparison.result("lowOrder")
    assert result.broke_down
    assert result.worst.max_relative == 0.0
    assert not result.adequate
    assert comparison.verdict == "exact"


def test_a_model_that_never_started_still_has_its_rows():
    comparison = compare([make_run("lowOrder", end=-1.0), make_run("exact")], "exact", 0.01)
    assert comparison.result("lowOrder").differences == ()
    rows = [{column.name: column.value(row) for column in COLUMNS} for row in as_rows(comparison)]
    assert [row["model"] for row in rows] == ["lowOrder"] * 2 + ["exact"] * 2
    assert rows[0]["max_abs"] is None and rows[0]["channel"] == "b1.tip.x"


def test_without_a_reference_there_is_no_verdict():
    comparison = compare([make_run("linear"), make_run("exact", end=0.3)], "exact", 0.01)
    assert comparison.verdict is None
    assert comparison.sentence.startswith("verdict: none, because the reference exact broke down at 0.3 s")
    assert as_facts(comparison)["status"] == "failed"


def test_the_reference_must_be_there():
    with pytest.raises(ValueError, match="ancf"):
        compare([make_run("exact")], "ancf", 0.01)


def test_a_tiny_deflection_is_judged_by_the_size_of_the_scene():
    runs = [
        make_run("linear", cpu=0.1, deflection=0.1),
        make_run("lowOrder", cpu=0.2, deflection=9e-6),
        make_run("exact", deflection=6.7e-6),
    ]
    comparison = compare(runs, "exact", 0.01)
    scale = next(s for s in comparison.scales if s.channel == "b1.tip.deflection")
    assert scale.small
    assert scale.scale == pytest.approx(2e-3)
    assert comparison.result("linear").worst.max_relative > 10.0
    assert comparison.verdict == "lowOrder"
    told = next(line for line in as_text(comparison, Path("out")).splitlines() if "linear" in line)
    assert told.endswith("b1.tip.deflection *")


def test_constraint_drift_is_shown_and_not_judged():
    comparison = compare([make_run("ancf", cpu=0.5), make_run("exact")], "exact", 0.01)
    result = comparison.result("ancf")
    assert [d.channel for d in result.differences] == ["b1.tip.x", "constraint.position"]
    assert result.worst.channel == "b1.tip.x"
    assert result.first_exceeded is None
    assert result.adequate


def test_a_diverged_model_gives_finite_numbers():
    comparison = compare([make_run("linear", 1e200), make_run("exact")], "exact", 0.01)
    found = comparison.result("linear").differences[0]
    assert math.isfinite(found.rms)
    assert math.isfinite(found.max_relative)


def test_overlay_axis_follows_the_reference_when_a_model_diverges():
    reference = np.array([-1.0, 1.0])
    assert overlay_limits(reference, [np.array([-1.2, 1.1])])[2] is False
    small = overlay_limits(1e-18 * reference, [np.array([-1.2e-18, 1.1e-18])])
    assert np.array(small[:2]) == pytest.approx(1e-18 * np.array(overlay_limits(reference, [])[:2]), rel=0.2)
    low, high, clipped = overlay_limits(reference, [np.array([-1e200, 1e200])])
    assert (low, high, clipped) == (-3.0, 3.0, True)


def test_overlays_of_a_diverged_a_broken_and_an_empty_model_can_be_drawn(tmp_path):
    runs = [
        make_run("linear", 1e200),
        make_run("lowOrder", end=0.4),
        make_run("ancf", end=-1.0),
        make_run("exact"),
    ]
    names = draw_comparison(runs, compare(runs, "exact", 0.01), tmp_path / "plots")
    assert set(names) == {"b1.tip.x.png", "constraint.position.png", "error_against_cost.png"}
    assert all((tmp_path / "plots" / name).stat().st_size > 1000 for name in names)


# --- real scenes ---------------------------------------------------------------------------------


def held(case, models, *overrides, max_error=0.01, channels=()):
    """Run a shipped case with several models and compare them."""
    decks = {}
    for model, settings in models.items():
        decks[model] = load_deck(CASES / f"{case}.yaml", (*overrides, f"solve.model={model}", *settings))
    runs = [simulate(deck, error_estimate=False, outlines=True) for deck in decks.values()]
    found = Measured()
    measure(decks, runs, 1, found, Here())
    return compare(runs, "exact", max_error, found, channels)


def test_the_verdict_is_not_the_tolerance_s():
    """Angular velocities differ by 0.1 % of next to nothing at the looser tolerance, 0.006 % at the other."""
    coarse = ("solve.duration=0.1", "bodies.b1.elements=2", "bodies.b2.elements=2")
    for tolerance, differ in ((5e-6, True), (1e-8, False)):
        found = held("two_beams", {"lowOrder": (), "exact": ()}, *coarse, f"solve.tolerance={tolerance}",
                     max_error=5e-4)  # fmt: skip
        low = found.result("lowOrder")
        assert low.adequate
        assert (low.difference("b1.angular_velocity").max_relative > 5e-4) == differ
        assert not low.difference("b1.angular_velocity").beyond > 5e-4


def test_exact_and_ancf_check_one_another_in_different_coordinates():
    models = {"exact": ("solve.coordinates=frame",), "ancf": ()}
    found = held("pendulum", models, "solve.duration=0.2", "solve.tolerance=1e-6")
    ancf = found.result("ancf")
    assert [model.coordinates for model in found.models] == ["frame", "absolute"]
    assert ancf.worst.equal and 0.0 < ancf.worst.max_abs < ancf.worst.time_error < 1e-4


def test_the_error_in_time_is_not_understated():
    deck = load_deck(CASES / "hub_beams.yaml", ("solve.duration=0.1", "solve.tolerance=1e-5"))
    tight = deck.with_solve({"tolerance": 1e-10, "method": "gauss"})
    run, truth = (simulate(one, error_estimate=False) for one in (deck, tight))
    estimated, true = time_error(deck, run), channel_errors(run.channels, truth.channels)[0]
    for name in ("b1.tip.x", "b1.tip.y", "b2.tip.x", "b2.tip.y"):
        assert 0.5 * true[name] < estimated[name] < 300.0 * true[name], name


SWING = """
hfsim: 1
bodies: {mass: {type: rigid, mass: 2.0, inertia: 1.0}}
joints: {rail: {type: prismatic, between: [ground, mass]}}
springs: {coil: {type: two_point, between: [ground, mass], stiffness: 18.0, rest_length: 0.0}}
initial: {mass: {position: [0.5, 0.0]}}
solve: {duration: 2.5, method: gauss, stages: 10, tolerance: 1.0e-2}
output: {interval: 0.5, channels: [mass.x]}
"""


def test_the_error_in_time_is_found_too_where_the_tolerance_is_not_what_bounds_the_steps():
    """One step as long as the run, whatever the tolerance."""
    deck = parse_deck(SWING, "swing.yaml")
    run = simulate(deck, error_estimate=False)
    assert run.statistics["steps"] == 1
    true = np.abs(run["mass.x"] - 0.5 * np.cos(3.0 * run.t)).max()
    assert time_error(deck, run)["mass.x"] == pytest.approx(true, rel=0.1)
    assert true > 1e-6


def test_fixed_steps_are_doubled():
    solve = load_deck(CASES / "pendulum.yaml", ("solve.step=0.01",)).deck.solve
    assert looser(solve) == ({"step": 0.02}, 1.0)


FORCES = "output.channels=[b1.tip.x, b1.root.axial_force]"


def called(*arguments):
    short = ("--no-plots", "--set", FORCES, "--set", "solve.duration=0.05")
    return call(*arguments, *short)


def test_models_side_by_side_give_the_same_but_for_times(tmp_path):
    tables = []
    for jobs in ("1", "2"):
        folder = tmp_path / jobs
        asked = ["compare", "linear", "--case", "pendulum", "--set", "solve.duration=0.02", "--no-plots"]
        told = call(*asked, "--jobs", jobs, "-o", str(folder))
        assert told.exit_code == 0, told.output
        rows = csv.DictReader((folder / "compare.csv").read_text().splitlines())
        tables.append([{key: value for key, value in row.items() if "cpu" not in key} for row in rows])
        histories = [(folder / model / "history.csv").read_bytes() for model in ("linear", "exact")]
        tables[-1] += histories
    assert tables[0] == tables[1]


def test_a_run_goes_along_into_other_processes_as_it_is():
    """Steps, laws that are expressions, other ways to close its loops, and what it has recorded left out."""
    for case in ("door", "hub_beams"):
        deck = load_deck(CASES / f"{case}.yaml", ("solve.duration=0.01", "output.interval=0.005"))
        run = simulate(deck, error_estimate=False)
        sent = pickle.loads(pickle.dumps(run))
        assert all(np.array_equal(sent.drawn[c.name], c.values) for c in run.drawn.channels)
        scenes = [one.states[0].scene for one in (run, sent)]
        assert scenes[0].assembly.branches() == scenes[1].assembly.branches()
        assert not scenes[1].recordings


def test_a_rigid_model_leaves_out_the_internal_forces_that_a_deck_asks_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = called("compare", "rigid", "exact", "--case", "pendulum")
    assert found.exit_code == 0, found.output
    assert found.stderr.count("b1.root.axial_force") == 1
    facts = json.loads(Path("pendulum.compare/compare.json").read_text())
    told = {name: [one["channel"] for one in model["differences"]] for name, model in facts["models"].items()}
    assert told == {"rigid": ["b1.tip.x"], "exact": ["b1.tip.x", "b1.root.axial_force"]}
    (row,) = (line for line in found.stdout.splitlines() if "b1.root.axial_force" in line)
    assert row.split()[-1] == "-"


def test_where_internal_forces_are_all_that_is_asked_for_a_rigid_model_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    only = ("--set", "output.channels=[b1.root.axial_force]")
    found = call("compare", "rigid", "exact", "--case", "pendulum", *only)
    assert found.exit_code == 2 and "without strains" in found.stderr


@pytest.mark.parametrize("study", [("bench", "--methods", "gauss"), ("stability", "--step", "0.05")])
def test_studies_with_a_rigid_model_leave_them_out_for_all_models(study, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command, *options = study
    found = called(command, "pendulum", *options, "--models", "rigid,exact", "--budget", "5s")
    assert found.exit_code == 0, found.output
    assert found.stderr.count("b1.root.axial_force") == 1


def test_many_models_and_long_names_keep_to_the_width():
    def renamed(run):
        names = (f"the_long_blade_{n}.tip_of_it.x" for n in range(9))
        channels = tuple(one._replace(name=name) for one, name in zip(run.channels, names, strict=False))
        return replace(run, channels=channels)

    models = ("linear", "lowOrder", "ancf", "rigid")
    runs = [renamed(make_run(model, 0.123456 * n, deflection=0.1)) for n, model in enumerate(models)]
    found = compare([*runs, renamed(make_run("exact", deflection=0.1))], "exact", 0.01)
    text = as_text(found, Path("a.compare"))
    assert max(map(len, text.split("\n"))) <= WIDTH
    assert all(text.count(model) >= 3 for model in models)
