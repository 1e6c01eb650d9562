"""`hfsim stability`: farm, axes, classes, maps, bisection."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from itertools import combinations
from multiprocessing import connection
from pathlib import Path

import click
import numpy as np
import pytest
from called import call
from matplotlib.text import Text
from zoo import DEAD_CENTRE, WHIP

import hfsim
from hfsim.errors import ArgumentError, DeckError
from hfsim.marching.distance import ChannelScale
from hfsim.marching.integration import run_integration
from hfsim.marching.solution import Channel
from hfsim.output.stability import map_text
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import CASES
from hfsim.studies.axes import NAMED, AxisError, parse_values, point_overrides, vary
from hfsim.studies.farm import Farm, Here, JobLostError, Task
from hfsim.studies.stability.asked import Plan
from hfsim.studies.stability.mapper import Mapper
from hfsim.studies.stability.maps import stability_map
from hfsim.studies.stability.references import check_reference, solve_reference
from hfsim.studies.stability.trials import Job, solve_point
from hfsim.studies.stability.verdict import Bounds, Distance, Trial, Truth, classify, distance
from hfsim.trust import growth
from hfsim.trust.growth import UNSTABLE, growth_of

# --- the farm ------------------------------------------------------------------------------------


def double(number):
    return 2 * number


def die(_):
    os._exit(7)


def fail(_):
    raise ValueError("so it is")


def sleep(seconds):
    time.sleep(seconds)
    return seconds


def served(tasks, jobs=2, seconds=20.0):
    farm = Farm(jobs, time.perf_counter() + seconds)
    for task in tasks:
        farm.add(task)
    return {outcome.key: outcome for outcome in farm.outcomes()}, farm


def test_a_job_that_dies_or_fails_costs_only_itself():
    tasks = [
        Task("a", double, 1, 5.0),
        Task("b", die, 0, 5.0),
        Task("c", fail, 0, 5.0),
        Task("d", double, 2, 5.0),
    ]
    found, _ = served(tasks)
    assert (found["a"].value, found["d"].value) == (2, 4)
    assert "exit code 7" in found["b"].lost
    assert found["c"].lost == "ValueError: so it is"


def test_where_all_results_are_needed_a_lost_one_is_an_error():
    for executor in (Here(), Farm(2)):
        assert sorted(executor.results(double, [3, 4])) == [(0, 6), (1, 8)]
        with pytest.raises((JobLostError, ValueError), match="so it is"):
            list(executor.results(fail, [0]))


def test_a_job_that_hangs_is_ended(monkeypatch):
    monkeypatch.setattr("hfsim.studies.farm._GRACE", 0.1)
    start = time.perf_counter()
    found, _ = served([Task("slow", sleep, 30.0, 0.2), Task("quick", double, 1, 5.0)])
    assert time.perf_counter() - start < 5.0
    assert "no answer within 0.2 s" in found["slow"].lost
    assert found["quick"].value == 2


def test_the_deadline_ends_everything_and_tells_what_was_not_reached():
    start = time.perf_counter()
    found, farm = served([Task(k, sleep, 10.0, 60.0) for k in range(3)], seconds=0.3)
    assert time.perf_counter() - start < 3.0
    assert not found
    assert sorted(farm.unreached()) == [0, 1, 2]


def test_a_first_result_is_waited_for_if_asked_for():
    farm = Farm(1, time.perf_counter() - 1.0, patient=True)
    for k in range(3):
        farm.add(Task(k, double, k, 60.0))
    found = []

    def take(outcome):
        farm.patient = False
        found.append(outcome.value)

    farm.serve(take)
    assert found == [0] and sorted(farm.unreached()) == [1, 2]


def test_jobs_run_side_by_side():
    start = time.perf_counter()
    served([Task(k, sleep, 0.6, 60.0) for k in range(4)], jobs=4)
    assert time.perf_counter() - start < 1.8


STUDY = """
import os, sys
from hfsim.studies.farm import Farm, Task

def work(number):
    os.write(1, b"%d\\n" % os.getpid())
    while True:
        pass

if __name__ == "__main__":
    farm = Farm(2)
    for number in range(2):
        farm.add(Task(number, work, number, 60.0))
    farm.serve(print)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_no_worker_outlives_its_study(tmp_path, number):
    script = tmp_path / "study.py"
    script.write_text(STUDY)
    ends = (signal.SIGINT, signal.SIGHUP)
    own = {"preexec_fn": lambda: [signal.signal(one, signal.SIG_DFL) for one in ends]}  # else as of who calls
    study = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True, **own)
    workers = [int(study.stdout.readline()) for _ in range(2)]
    study.send_signal(number)
    try:
        study.communicate(timeout=20.0)  # as long as a worker lives, it holds the other end
    except subprocess.TimeoutExpired:
        for worker in workers:
            os.kill(worker, signal.SIGKILL)
        pytest.fail("workers are left")


def test_a_signal_just_before_the_wait_for_workers_ends_a_study(monkeypatch):
    wait = connection.wait

    def heedless(pipes, timeout):
        monkeypatch.setattr(connection, "wait", wait)
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # others do not block it
            return wait(pipes, timeout)
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])

    monkeypatch.setattr(connection, "wait", heedless)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    start = time.perf_counter()
    try:
        farm = Farm(1)
        farm.add(Task(0, sleep, 20.0))
        farm.serve(print)
    finally:
        signal.signal(signal.SIGINT, before)
    assert farm.interrupted and time.perf_counter() - start < 10.0


# --- axes ----------------------------------------------------------------------------------------


def test_values_are_spaced_as_asked():
    values, logarithmic, _ = parse_values("log(1e5, 1e12, 8)")
    assert values == pytest.approx([10.0**k for k in range(5, 13)]) and logarithmic
    assert parse_values("lin(0,1,3)") == ((0.0, 0.5, 1.0), False, "")
    assert parse_values("[2, 4]") == ((2.0, 4.0), False, "")


@pytest.mark.parametrize("text", ["", "1,,2", "log(0,1,3)", "log(1,2,x)", "lin(1,2,0)", "nan", "inf,1"])
def test_values_that_are_none(text):
    with pytest.raises(AxisError):
        parse_values(text)


def changed(axis, value, case="hub_beams"):
    loaded = load_deck(CASES / f"{case}.yaml")
    overrides = point_overrides(loaded, [axis], [value])
    return loaded.deck, parse_deck(loaded.source.text, loaded.source.file, overrides).deck


def test_what_the_named_axes_change():
    old, new = changed(NAMED["stiffness"]("10"), 10.0)
    assert new.materials["soft"].youngs_modulus == 10.0 * old.materials["soft"].youngs_modulus
    assert new.springs["coil"].stiffness == 10.0 * old.springs["coil"].stiffness
    old, new = changed(NAMED["amplitude"]("2"), 2.0)
    assert new.initial["b2"].angle == pytest.approx(0.3)
    _, new = changed(NAMED["speed"]("2"), 2.0, "two_beams_relative")
    assert [new.initial[b].angular_velocity for b in ("b1", "b2")] == [8.0, 16.0]
    old, new = changed(NAMED["slenderness"]("1000"), 1000.0)
    section = new.sections[new.bodies["b1"].section]
    assert new.bodies["b1"].length / section.height == pytest.approx(1000.0)
    assert section.height / section.width == pytest.approx(
        old.sections["strip"].height / old.sections["strip"].width
    )
    with pytest.raises(DeckError, match=r"must be a whole number, not 2\.5"):
        changed(NAMED["elements"]("2.5"), 2.5)
    _, new = changed(NAMED["elements"]("7"), 7.0)
    assert {new.bodies[b].elements for b in ("b1", "b2")} == {7}
    _, new = changed(vary("solve.rho_inf=0.5"), 0.5)
    assert new.solve.rho_inf == 0.5


def test_models_and_methods_are_rows_and_no_axes():
    """Every point has those of its row: along such an axis all would be the same."""
    with pytest.raises(AxisError, match=r"solve\.model is no axis.* with --models"):
        vary("solve.model=linear,exact")
    with pytest.raises(ArgumentError, match=r"solve\.method is no axis.* with methods"):
        hfsim.stability(WHEEL, {"solve.method": ["gauss", "radau"]})


def test_settings_of_the_solver_but_for_the_duration_are_no_matter_of_the_scene():
    found = [vary(f"solve.{key}=1,2").solver_only for key in ("step", "tolerance", "duration")]
    assert found == [True, True, False]


def test_an_axis_that_changes_nothing_is_refused():
    loaded = parse_deck(WHEEL)
    with pytest.raises(AxisError, match="speed"):
        point_overrides(loaded, [NAMED["speed"]("2")], [2.0])
    with pytest.raises(DeckError):
        point_overrides(loaded, [vary("bodies.rotor.mass=2")], [2.0])


def test_axes_act_one_after_the_other():
    axes = [vary("springs.coil.stiffness=5"), NAMED["stiffness"]("3")]
    loaded = parse_deck(WHEEL)
    overrides = point_overrides(loaded, axes, [5.0, 3.0])
    assert parse_deck(WHEEL, "deck", overrides).deck.springs["coil"].stiffness == 15.0


# --- classes -------------------------------------------------------------------------------------

DONE, FAILED, LOST = (
    Truth("done", growth=2.0),
    Truth("failed", "model", "it breaks", 0.5),
    Truth("lost", reason="late"),
)
WILD = Truth("done", "physical", "it grows", item="loads.push", growth=1e4)
DEAD = Truth("failed", "physical", "a dead centre", 0.5, "joints.push")
GOOD = Trial("done", distance=Distance(1e-5, "x", (1e-5, 1e-5)), drift=1e-6)
FAR = replace(GOOD, distance=Distance(0.5, "x", (0.5, 0.5)))


@pytest.mark.parametrize(
    ("trial", "truth", "exact", "outcome"),
    [
        (GOOD, DONE, DONE, "accurate"),
        (FAR, DONE, DONE, "wrong"),
        (replace(GOOD, drift=0.5), DONE, DONE, "wrong"),
        (GOOD, FAILED, DONE, "wrong"),
        (GOOD, WILD, WILD, "physical"),
        (replace(GOOD, drift=0.5), WILD, WILD, "wrong"),
        (Trial("failed", "", "no"), DONE, DONE, "numerical"),
        (Trial("failed", "model", "no"), DONE, DONE, "numerical"),
        (Trial("failed", "deck", "no"), FAILED, FAILED, "deck"),
        (Trial("failed", "model", "no"), FAILED, DONE, "model"),
        (Trial("failed", "", "no"), FAILED, DEAD, "physical"),
        (Trial("failed", "", "no"), FAILED, replace(FAILED, kind=""), "numerical"),
        (Trial("failed", "", "no"), LOST, DONE, "no result"),
        (Trial("failed", "model", "no"), LOST, DONE, "model"),
        (Trial("lost", reason="the deck is refused: no"), LOST, LOST, "deck"),
        (replace(GOOD, kind="physical", reason="no"), DONE, DONE, "physical"),
        (Trial("lost", reason="crash"), DONE, DONE, "no result"),
        (GOOD, LOST, DONE, "no result"),
        (GOOD, DONE, LOST, "no result"),
    ],
)
def test_classes(trial, truth, exact, outcome):
    verdict = classify(trial, truth, exact, Bounds())
    assert verdict.outcome == outcome
    assert verdict.reason or outcome == "accurate"
    assert verdict.cause == outcome or outcome in ("accurate", "wrong", "no result")


def test_when_a_point_fails_is_told_once():
    reasons = "it is not solved", "it grows beyond all scale at t = 0.4 s, fast"
    told = [classify(Trial("failed", "", one, 0.4), DONE, DONE, Bounds()).reason for one in reasons]
    assert [one.count("t = 0.4 s") for one in told] == [1, 1]


def test_what_is_wrong_has_its_cause():
    """With a small time error it is the model that leaves the truth or loses energy; exact cannot."""
    found = {
        "time": classify(FAR, DONE, DONE, Bounds()),
        "drift": classify(replace(GOOD, drift=0.5), DONE, DONE, Bounds()),
        "truncated": classify(replace(GOOD, drift=0.5), DONE, replace(DONE), Bounds()),
        "beyond": classify(GOOD, FAILED, DONE, Bounds()),
    }
    causes = {"time": "numerical", "drift": "numerical", "truncated": "model", "beyond": "model"}
    assert {name: verdict.cause for name, verdict in found.items()} == causes


def test_failures_without_a_reference_get_the_class_of_run():
    """A driver into a dead centre: the map blames the joint that `hfsim run` blames."""
    job = Job(DEAD_CENTRE, "dead.yaml", (), "exact", 20.0, method="auto")
    trial = solve_point(job)
    truth = solve_reference(replace(job, disturbed=True))
    for found in (trial, truth):
        assert (found.status, found.kind, found.item) == ("failed", "physical", "joints.push")
    verdict = classify(trial, truth, truth, Bounds())
    assert (verdict.outcome, verdict.item) == ("physical", "joints.push")


def test_a_reference_is_another_discretisation():
    """Even one step of both: a run is not held against itself."""
    text = WHEEL.replace("duration: 20.0", "duration: 6.0")
    job = Job(text, "wheel.yaml", (), "exact", 20.0, method="gauss")
    truth = solve_reference(job)
    trial = solve_point(replace(job, truth=truth)).against(truth)
    assert trial.steps == 1 and 0.0 < trial.distance.error < 1e-10


def test_a_point_is_not_wrong_because_its_reference_is():
    (point,) = mapped(parse_deck(WHIP), plan(methods=("radau",))).points
    assert point.outcome == "accurate", point
    assert point.verdict.time_error < 1e-3 and point.verdict.reference_floor < 1e-3


def lone(values, truth=None):
    """Return a channel, or a reference of it that is off as told."""
    values = np.asarray(values, dtype=float)
    scale = ChannelScale("x", "m", np.ptp(values), np.ptp(values), False, True)
    return Truth("done", "", "", 1.0, "", (Channel("x", "m", values),), (scale,), **truth or {})


@pytest.mark.parametrize(
    ("off", "floors", "within", "outcome"),
    [
        (0.004, None, (0.0, 0.008), "accurate"),
        (0.008, None, (0.0, 0.016), "no result"),
        (0.5, None, (0.0, 1.0), "no result"),
        (0.5, {"x": 0.02}, (0.48, 0.52), "wrong"),
        (0.02, {"x": 0.015}, (0.005, 0.035), "no result"),
        (0.008, {"x": 0.001}, (0.007, 0.009), "accurate"),
    ],
)
def test_a_reference_judges_as_well_as_it_is_known(off, floors, within, outcome):
    """What nothing has borne out may be as far off as the point is from it."""
    truth = lone([0.0, 1.0], {"floors": floors})
    trial = Trial("done", drift=0.0, channels=lone([0.0, 1.0 + off]).channels).against(truth)
    assert trial.distance.within == pytest.approx(within)
    verdict = classify(trial, truth, truth, Bounds())
    assert verdict.outcome == outcome
    assert verdict.references("exact") == (("exact",) if outcome == "no result" else ())
    assert ("reference" in verdict.reason) == (outcome == "no result")


def test_models_are_as_far_apart_as_both_references_tell():
    own, exact = lone([0.0, 2.0], {"floors": {"x": 0.1}}), lone([0.0, 1.0], {"floors": {"x": 0.3}})
    assert distance(own.channels, exact, own).within == pytest.approx((0.5, 1.5))
    trial = Trial("done", drift=0.0, channels=own.channels).against(own)
    found = classify(trial, own, replace(exact, floors=None), Bounds())
    assert found.outcome == "no result" and set(found.references("linear")) == {"linear", "exact"}


def test_a_reference_is_solved_again_and_tighter_until_it_tells():
    job = Job(WHEEL.replace("duration: 20.0", "duration: 2.0"), "wheel.yaml", (), "exact", 20.0)
    sound = solve_reference(job)
    checked = check_reference(replace(job, truth=sound))
    assert checked.channels is sound.channels and 0.0 < checked.floor < 1e-6
    assert checked.how.startswith("gauss (14 stages, tolerance 1e-8) against radau")
    (angle,) = sound.channels
    spoilt = replace(sound, channels=(angle._replace(values=1.02 * angle.values),))
    better = check_reference(replace(job, truth=spoilt))
    assert better.floor < 1e-6 and better.how.startswith("gauss (16 stages, tolerance 1e-9) against radau")
    assert better.channels[0].values == pytest.approx(angle.values, rel=1e-6)
    late = check_reference(replace(job, truth=sound, limit=0.0))
    assert late.checked and late.floor is None and "after 0 s" in late.doubt


def test_drifting_apart_is_no_instability():
    t = np.linspace(0.0, 1.0, 201)
    assert growth_of(t, t**2).factor == pytest.approx(4.0, rel=0.05)
    assert growth_of(t, np.abs(np.sin(40.0 * t)) * t).factor < 3.0
    assert growth_of(t, np.where(t < 0.4, 1e-3, 1e-3 + 10.0 * (t - 0.4))).factor < UNSTABLE  # one impact
    growing = growth_of(t, np.sinh(15.0 * t))
    assert growing.unstable and growing.factor > UNSTABLE
    assert growing.rate == pytest.approx(15.0, rel=0.1)


# --- maps ----------------------------------------------------------------------------------------

WHEEL = """
hfsim: 1
name: wheel
bodies: {wheel: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {axle: {type: revolute, between: [ground, wheel]}}
springs: {coil: {type: rotational, between: [ground, wheel], stiffness: 1.0}}
initial: {wheel: {angle: 0.5}}
solve: {duration: 20.0}
output: {channels: [wheel.angle]}
"""


def plan(*axes, **changes):
    usual = {"methods": ("gauss", "explicit"), "models": ("exact",), "seconds": 60.0, "limit": 20.0}
    return Plan(axes=axes, **{**usual, **changes})


def mapped(loaded, plan):
    return stability_map(loaded, plan, Farm(2))


def test_a_map_puts_every_point_into_a_class():
    """An explicit step beyond 5.96 over the frequency blows up or fails; Gauss goes on."""
    axes = NAMED["stiffness"]("1,100"), NAMED["step"]("0.05,1")
    result = mapped(parse_deck(WHEEL), plan(*axes))
    assert result.status == "done"
    assert len(result.points) == 8
    found = {(p.method, *p.values): p.outcome for p in result.points}
    assert found["gauss", 1.0, 1.0] == found["gauss", 100.0, 0.05] == "accurate"
    assert found["explicit", 1.0, 0.05] == "accurate"
    assert found["explicit", 100.0, 1.0] in ("wrong", "numerical")
    for p in result.points:
        if p.outcome == "accurate":
            assert p.verdict.time_error < 1e-2 and p.verdict.model_error == 0.0
    assert result.points[-1].overrides[-1] == "solve.step=1.0"


def test_axes_have_their_units_in_tables_and_pictures():
    from hfsim.output.plots.stability import _map_figure, _strips_figure

    axes = vary("springs.coil.stiffness=50 N m/rad,0.1 kN m/rad"), NAMED["step"]("50 ms, 0.1")
    found = mapped(parse_deck(WHEEL), plan(*axes, methods=("gauss",)))
    assert [axis.values for axis in found.axes] == [(50.0, 100.0), (0.05, 0.1)]
    labels = ["springs.coil.stiffness [N m/rad]", "step [s]"]
    text = map_text(found, Path("out"))
    assert f"{labels[0]} \\ {labels[1]}" in text
    picture = _map_figure(found)
    assert [picture.get_supylabel(), picture.get_supxlabel()] == labels
    strip = mapped(parse_deck(WHEEL), plan(vary("solve.duration=0.1,0.2"), methods=("gauss",)))
    assert _strips_figure(strip).axes[0].get_xlabel() == "solve.duration [s]"
    assert "solve.duration [s]" in map_text(strip, Path("out"))
    (scaled,) = mapped(parse_deck(WHEEL), plan(NAMED["stiffness"]("1,2"), methods=("gauss",))).axes
    assert scaled.label == "stiffness [-]", "a factor"
    axis = vary("solve.coordinates=auto,absolute")
    (words,) = mapped(parse_deck(WHEEL), plan(axis, methods=("gauss",))).axes
    assert (words.values, words.label) == (("auto", "absolute"), "solve.coordinates")


def test_long_names_of_axes_are_not_drawn_over_one_another():
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from hfsim.output.plots.stability import _map_figure

    deck = parse_deck(WHEEL.replace("coil", "coil_between_the_hub_and_the_ground"))
    axes = vary("springs.coil_between_the_hub_and_the_ground.stiffness=50,100"), NAMED["step"]("0.05,0.1")
    models = ("linear", "exact")
    figure = _map_figure(mapped(deck, plan(*axes, methods=("gauss",), models=models)))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    upright = [one for one in figure.findobj(Text) if one.get_text() and one.get_rotation() == 90.0]
    boxes = [one.get_window_extent() for one in upright]
    assert boxes and all(one.y0 >= 0.0 and one.y1 <= canvas.get_width_height()[1] for one in boxes)
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


@pytest.mark.parametrize("name", ["wheel", "a wheel with a much longer name than others"])
@pytest.mark.parametrize("axes", [("stiffness",), ("stiffness", "step")])
def test_the_title_stands_beside_the_legend(name, axes):
    """With few rows and columns the picture is small."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from hfsim.output.plots.stability import _map_figure, _strips_figure

    deck = parse_deck(WHEEL.replace("name: wheel", f"name: {name}").replace("20.0", "0.2"))
    found = mapped(deck, plan(*(NAMED[one]("0.1,0.2") for one in axes), methods=("gauss",)))
    figure = (_map_figure if len(axes) > 1 else _strips_figure)(found)
    FigureCanvasAgg(figure).draw()
    title = next(one for one in figure.findobj(Text) if "hold" in one.get_text())
    assert not title.get_window_extent().overlaps(figure.legends[0].get_window_extent())


@pytest.mark.parametrize(("axis", "text"), [("step", "1 kg, 2 kg"), ("stiffness", "1 m, 2 m")])
def test_values_of_another_unit_are_no_values_of_an_axis(axis, text):
    with pytest.raises(AxisError, match="values are"):
        NAMED[axis](text)


@pytest.mark.parametrize("values", ["1 kg, 2 kg", "1 s, 2 kg"])
def test_values_of_another_unit_are_refused_by_the_deck(values):
    with pytest.raises((DeckError, AxisError), match=r"is a unit of mass|several units"):
        mapped(parse_deck(WHEEL), plan(vary(f"solve.duration={values}")))


def test_rates_may_have_units():
    from hfsim.commands.modes import read_rates

    assert read_rates("60 rpm, 30 rpm") == pytest.approx((np.pi, 2 * np.pi))
    with pytest.raises(click.UsageError, match="in rad/s"):
        read_rates("1 kg, 2 kg")


def test_a_map_that_is_not_finished_has_points_of_all_models(monkeypatch):
    """Models come before methods: what there is time for is told of each."""
    asked = []
    monkeypatch.setattr(Mapper, "compute", lambda self, wanted: asked.extend(wanted) or {})
    mapped(parse_deck(WHEEL), plan(methods=("gauss", "gear"), models=("linear", "exact")))
    rows = [("linear", "gauss"), ("exact", "gauss"), ("linear", "gear"), ("exact", "gear")]
    assert [(model, method) for _, model, method in asked] == rows


def test_a_refused_value_is_a_point_and_a_hopeless_map_is_refused():
    result = mapped(parse_deck(WHEEL), plan(vary("springs.coil.stiffness=-1,1"), methods=("gauss",)))
    assert [p.outcome for p in result.points] == ["deck", "accurate"]
    assert "refused" in result.points[0].verdict.reason
    with pytest.raises(DeckError):
        mapped(parse_deck(WHEEL), plan(vary("springs.wire.stiffness=1,2")))


def test_a_first_point_is_computed_and_what_the_budget_does_not_reach_is_told():
    result = mapped(parse_deck(WHEEL), plan(NAMED["stiffness"]("1,2,3"), seconds=0.0))
    assert result.status == "over budget"
    left = sum(p.outcome == "not computed" for p in result.points)
    assert len(result.points) == 6 and 4 <= left <= 5, "what two workers had in hand"
    told = [line for line in map_text(result, Path("out")).split("\n") if "not computed" in line]
    assert len(told) == 2 and f"{left} points not computed: the budget" in told[1]


def test_an_unstable_scene_is_told_from_an_unstable_method():
    """A rigid pendulum that stands nearly upright: the disturbance grows like exp(t sqrt(g m l / J))."""
    text = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {rod: {type: rigid, mass: 1.0, inertia: 0.1, points: {top: [0.5, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, rod.top]}}
initial: {rod: {angle: 90 deg}}
solve: {duration: 3.0}
output: {channels: [rod.angle]}
"""
    for angle, outcome in (("-90 deg", "physical"), ("100 deg", "accurate")):
        deck = parse_deck(text.replace("90 deg", f'"{angle}"'))
        (point,) = mapped(deck, plan(methods=("gauss",))).points
        assert point.outcome == outcome, point


AT_REST = """
hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}}
joints: {clamp: {type: fixed, between: [ground, b1.root]}}
solve: {duration: 0.1}
"""


def test_a_scene_at_rest_has_no_energy_to_lose():
    """A beam without a load: its energies are round-off, and their drift would be anything."""
    result = mapped(parse_deck(AT_REST), plan(methods=("auto",), models=("linear", "exact")))
    assert [p.outcome for p in result.points] == ["accurate", "accurate"]


def test_a_scene_at_rest_is_disturbed_by_more_than_round_off(monkeypatch):
    """By a share of its largest speed, 1e-10 m/s of round-off, positions change in the last digit at most."""
    scene = build(parse_deck(AT_REST))
    done, started = run_integration(scene, scene.deck.solve), []
    monkeypatch.setattr(growth, "run_integration", lambda *given: started.append(given[3]) or done)
    assert growth.disturbed_growth(scene, done, scene.deck.solve, lambda share: None).factor == 1.0
    assert 0.0 < np.abs(done.trajectory.at(np.linspace(0.0, 0.1, 50))[1]).max() < 1e-8
    assert np.abs(started[0][2]).max() > 1e-6


def test_the_end_of_a_class_is_located():
    """Explicit steps hold the wheel up to less than 5.96 over its frequency of 1 rad/s."""
    axis = NAMED["step"]("log(0.5,50,3)")
    result = mapped(parse_deck(WHEEL), plan(axis, methods=("explicit",), bisect=0.02))
    (end,) = result.boundaries
    assert end.class_below == "accurate" and end.class_above != "accurate"
    assert end.width <= 0.02
    assert 0.5 < end.below < end.above < 6.5
    values = [p.values[0] for p in result.points]
    assert values == sorted(values) and end.below in values and end.above in values


def test_the_end_of_another_class_is_located():
    axis = NAMED["step"]("1,3,5,50")
    result = mapped(parse_deck(WHEEL), plan(axis, methods=("explicit",), bisect=0.05, ending="wrong"))
    assert result.boundaries
    for end in result.boundaries:
        assert (end.class_below == "wrong") != (end.class_above == "wrong")


# --- the command ---------------------------------------------------------------------------------


def test_the_command_writes_tables_and_a_picture(tmp_path):
    deck = tmp_path / "wheel.yaml"
    deck.write_text(WHEEL)
    out = tmp_path / "o"
    order = ("stability", deck, "--scale-stiffness", "log(1,100,2)", "--step", "0.05,1", "--methods",
             "gauss,explicit", "--models", "exact", "-o", out)  # fmt: skip
    result = call(*order)
    assert result.exit_code == 0, result.output
    for words in ("exact, explicit", "stiffness [-] \\ step [s]", "accurate", "bounds: error 0.01"):
        assert words in result.stdout
    assert (out / "plots/stability.png").stat().st_size > 5000
    facts = json.loads((out / "stability.json").read_text())
    assert facts["status"] == "done" and len(facts["points"]) == 8
    assert facts["files"] == ["stability.csv", "stability.json", "plots/stability.png"]
    head, *rows = (out / "stability.csv").read_text().splitlines()
    assert head.startswith("stiffness,step,model,method,class,") and head.endswith(",reason,overrides")
    assert len(rows) == 8 and "solve.step=1" in rows[-1]
    assert call(*order).exit_code == 2
    one = ("stability", deck, "--step", "0.05", "--methods", "gauss", "--models", "exact", "-o", out)
    again = call(*one, "--force", "--json", "--no-plots")
    assert json.loads(again.stdout)["counts"] == {"accurate": 1}


@pytest.mark.parametrize(
    "wrong",
    [
        ("--methods", "gaus"),
        ("--models", "auto"),
        ("--vary", "solve.step"),
        ("--vary", "solve.model=linear,exact"),
        ("--vary", "solve.method=gauss,radau"),
        ("--vary", "solve.step=log(0,1,2)"),
        ("--step", "-1"),
        ("--scale-speed", "1,2"),
        ("--step", "0.1", "--elements", "2", "--scale-stiffness", "2"),
        ("--bisect", "0.1"),
        ("--vary", "springs.wire.stiffness=1,2"),
    ],
)
def test_a_bad_command_line_ends_with_2(tmp_path, wrong):
    deck = tmp_path / "wheel.yaml"
    deck.write_text(WHEEL)
    assert call("stability", deck, "-o", tmp_path / "o", *wrong).exit_code == 2
    assert not (tmp_path / "o").exists()
