"""What is said of a run after it: errors in time and of the mesh, measured or not known, within a budget."""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from called import call

from hfsim.errors import SolverFailure, Terminated
from hfsim.marching.distance import channel_errors
from hfsim.marching.integration import Leg, run_integration
from hfsim.marching.record import Record
from hfsim.marching.stop import Budget, BudgetUsedError, nobody
from hfsim.output.report import errors
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate
from hfsim.trust import after, diagnosis, error, experiments, mesh
from hfsim.trust.after import Stages, Wish
from hfsim.trust.doubt import doubts
from hfsim.trust.error import time_error
from hfsim.trust.estimate import Compared, Estimate
from hfsim.trust.mesh import mesh_error

CASES = Path(__file__).parents[2] / "cases"
FALLING = """hfsim: 1
gravity: [0.0, -9.81]
bodies:
  stone: {type: rigid, mass: 1.0, inertia: 1.0}
solve: {duration: 1.0}
"""
STRIP = """hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 1.0e7}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
bodies: {b1: {type: beam, material: rubber, section: bar, length: 1.0, elements: 4}}
joints: {pin: {type: revolute, between: [ground, b1.root]}}
solve: {duration: 0.1}
"""


def pendulum(*overrides):
    return load_deck(CASES / "pendulum.yaml", overrides)


def compared(loaded):
    scene, record = build(loaded), Record()
    done = run_integration(scene, scene.deck.solve, record=record)
    return Compared([Leg(scene, done, record.legs[0])], record.channels())


def plenty(seconds=1e9):
    """Return a budget that is never used up."""
    return Budget(seconds, lambda: 0.0)


def true_error(run, better):
    """Return the error of a run against another one in the worst channel."""
    return max(channel_errors(run.channels, better.channels)[1].values())


@cache
def exact_motion():
    return compared(pendulum("solve.method=gauss", "solve.tolerance=1e-12", "solve.duration=0.5"))


# in time -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("enough", [True, False])
@pytest.mark.parametrize(
    "settings",
    [
        ("solve.method=generalized_alpha", "solve.step=2e-3"),
        ("solve.method=gear", "solve.step=1e-3"),
        ("solve.method=gear", "solve.tolerance=1e-5"),
        ("solve.method=explicit", "solve.tolerance=1e-5"),
        ("solve.method=radau", "solve.tolerance=1e-4"),
    ],
)
def test_the_time_error_is_measured_by_finer_steps_or_bounded_by_coarser_ones(settings, enough):
    run = compared(pendulum("solve.duration=0.5", *settings))
    found = time_error(run, plenty() if enough else plenty(1.0), 1.0)
    effectivity = found.error / true_error(run, exact_motion())
    (worst,) = (one for one in run.channels if one.name == found.channel)
    assert found.each[found.channel] == pytest.approx(found.error * np.ptp(worst.values), rel=0.1)
    # of an order as high as that of gear, coarser steps lose more than is taken for granted
    assert 0.3 < effectivity < (3.0 if enough else 20.0)


def test_a_second_run_costs_no_more_than_the_run_where_it_gets_no_more(monkeypatch):
    run, made = compared(pendulum("solve.method=generalized_alpha", "solve.step=2e-3")), []

    def watched(scene, solve, *others, **named):
        made.append(solve.step)
        return run_integration(scene, solve, *others, **named)

    monkeypatch.setattr(error, "run_integration", watched)
    time_error(run, plenty(1.0), 1.0)
    assert made == [4e-3]


def test_a_second_run_that_stops_early_gives_no_estimate(monkeypatch):
    def stopping(scene, solve, *others, **named):
        shorter = solve.model_copy(update={"duration": 0.5 * solve.duration})
        half = run_integration(scene, shorter, *others, **named)
        return half._replace(stop=SolverFailure("it breaks", 0.25))

    monkeypatch.setattr(error, "run_integration", stopping)
    found = simulate(pendulum("solve.duration=0.5"), after=60.0).statistics
    assert found["error_estimate"] is None
    assert found["error_estimate_until"] == pytest.approx(0.25)
    assert "stopped at 0.25 s: it breaks; until 0.25 s the error is" in found["error_estimate_reason"]


def test_a_second_run_that_comes_further_than_one_that_failed_is_compared_as_long_as_both_last():
    settings = ("solve.step=0.05", "solve.method=explicit", "solve.duration=0.1")
    run = simulate(pendulum(*settings), "linear", diagnosis=True, after=60.0)
    assert (run.status, run.exit_code, run.failure["class"]) == ("failed", 3, "numerical")
    assert "error_estimate" in run.statistics


def test_a_second_run_that_is_cut_gives_no_estimate():
    found = simulate(pendulum(), mesh_estimate=True, after=1e-9).statistics
    assert (found["error_estimate"], found["mesh_error_estimate"], found["limiting_channel"]) == (None,) * 3
    assert "time" in found["error_estimate_reason"] and "--after" in found["error_estimate_reason"]
    assert "--after" in found["mesh_error_estimate_reason"]


def test_one_row_of_output_has_no_error():
    run, record = compared(pendulum("solve.duration=0.1", "output.interval=1.0")), Record()
    scene = run.legs[0].scene
    run_integration(scene, scene.deck.solve.model_copy(update={"duration": 0.05}), record=record)
    found = run.distance(record)
    assert found.error is None and "nothing to compare" in found.reason
    assert time_error(run, plenty(), 1.0).error > 0.0


def test_steps_as_long_as_the_run_are_compared_to_others():
    """At any tolerance a falling stone makes the same steps: equal to themselves in all digits."""
    found = simulate(parse_deck(FALLING, "falling.yaml", ["solve.method=gauss"]), after=60.0).statistics
    assert found["steps"] < 3 and "steps of" in found["error_estimate_by"]
    assert found["error_estimate"] < 1e-12


@pytest.mark.parametrize("seconds", [1e9, 1.0])
def test_a_second_run_that_takes_the_same_steps_tells_nothing_and_others_are_made(monkeypatch, seconds):
    """What bounds steps may be what can be solved: the tolerance makes no other ones then."""
    run = compared(pendulum("solve.method=energy", "solve.tolerance=1e-5", "solve.duration=0.5"))

    def bounded(scene, solve, *others, **named):
        same = solve if solve.step is not None else solve.model_copy(update={"tolerance": 1.00001e-5})
        return run_integration(scene, same, *others, **named)

    monkeypatch.setattr(error, "run_integration", bounded)
    found = time_error(run, plenty(seconds), 1.0)
    assert found.by.startswith("distance to a run with steps of")
    assert 0.3 < found.error / true_error(run, exact_motion()) < 10.0


def test_an_error_that_no_run_with_other_steps_tells_of_is_not_known(monkeypatch):
    run = compared(pendulum("solve.method=energy", "solve.tolerance=1e-5", "solve.duration=0.5"))

    def bounded(scene, solve, *others, **named):
        same = run_integration(scene, solve.model_copy(update={"tolerance": 1e-5}), *others, **named)
        return same if solve.step is None else same._replace(stop=SolverFailure("it breaks", 0.1))

    monkeypatch.setattr(error, "run_integration", bounded)
    found = time_error(run, plenty(), 1.0)
    assert found.error is None and "took the same steps" in found.reason and "it breaks" in found.reason


def test_a_large_time_error_warns():
    run = simulate(pendulum("solve.method=generalized_alpha", "solve.step=5e-3", "solve.duration=0.5"))
    assert run.statistics["error_estimate"] > 1e-2
    (warning,) = (one for one in run.statistics["warnings"] if "time error" in one)
    assert run.statistics["error_estimate_channel"] in warning


def test_a_large_mesh_error_warns_as_a_large_time_error_does():
    """A rope of one element is far from one of two, however fine the steps are."""
    shown = "output.channels=[b1.tip.x, b1.root.axial_force]"
    rope = pendulum("solve.duration=0.3", "bodies.b1.elements=1", shown)
    run = simulate(rope, mesh_estimate=True, after=30.0)
    found = run.statistics
    (warning,) = found["warnings"]
    assert found["error_estimate"] < 1e-3 < 1e-2 < found["mesh_error_estimate"]
    assert "mesh error" in warning and found["mesh_error_estimate_channel"] in warning
    assert "--set bodies.b1.elements=2" in warning


def spinning(*channels):
    text = STRIP.replace("gravity: [0.0, -9.81]", "").replace("1.0e7", "2.1e11").replace("0.1}", "1.0}")
    shown = f"output: {{channels: [{', '.join(channels)}]}}\n"
    return parse_deck(f"{text}initial: {{steady: {{body: b1, rate: 30.0}}}}\n{shown}")


def test_what_stands_still_has_no_errors_to_speak_of():
    """A beam that turns steadily is bent by rounding alone, which finer steps or meshes do not share."""
    found = simulate(spinning("b1.tip.deflection"), mesh_estimate=True, after=60.0).statistics
    assert found["warnings"] == []
    assert max(found["error_estimate"], found["mesh_error_estimate"]) < 1e-3
    assert found["error_estimate_relative_to"] == "0.001 m"


def test_the_mesh_error_of_a_beam_at_rest_is_told_by_the_size_of_the_scene(monkeypatch):
    held = STRIP.replace("pin: {type: revolute", "clamp: {type: fixed").replace("1.0e7", "2.1e11")
    loaded = parse_deck(f"{held}initial: {{equilibrium: true}}\n")
    monkeypatch.setattr(after, "LARGE", 0.0)
    run = simulate(loaded, mesh_estimate=True, after=60.0)
    warning = run.statistics["warnings"][-1]
    assert "of 0.001 m, for the range of b1.tip" in warning and "is too small to judge by" in warning
    assert run.statistics["mesh_error_estimate"] < 1.0


# of the mesh -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "case, settings, finer",
    [
        ("pendulum", ("solve.duration=0.7",), ("bodies.b1.elements=12", "bodies.b1.degree=5")),
        (
            "extreme/light_link",
            ("solve.duration=0.25",),
            ("bodies.b1.elements=2", "bodies.b1.degree=7"),
        ),
        (
            "hub_beams",
            ("solve.duration=0.5",),
            (
                *("bodies.b1.elements=6", "bodies.b1.degree=7", "bodies.b2.elements=6", "bodies.b2.degree=7"),
                *("solve.coordinates=frame", "solve.tolerance=1e-5"),
            ),
        ),
    ],
)
def test_the_mesh_error_is_about_the_true_one(case, settings, finer):
    loose = (*settings, "solve.tolerance=1e-6")
    run = compared(load_deck(CASES / f"{case}.yaml", loose))
    truth = compared(load_deck(CASES / f"{case}.yaml", (*loose, *finer)))
    assert 0.3 < mesh_error(run, plenty(), 1.0).error / true_error(run, truth) < 10.0


def test_a_fine_mesh_has_a_small_error():
    """A coarser mesh is far off and cheap; it must not pass for the error of one that is fine."""
    settings = ("bodies.b1.degree=5", "bodies.b1.elements=2", "solve.duration=0.25")
    run = compared(load_deck(CASES / "extreme/light_link.yaml", settings))
    assert 0.0 < mesh_error(run, plenty(), 1.0).error < 1e-6


def test_an_error_in_time_at_a_loose_tolerance_is_none_of_the_mesh():
    """On the richer mesh the moment at the root is off by a twentieth at 1e-4, and by 3e-4 at 1e-6."""
    run = compared(load_deck(CASES / "door.yaml", ("bodies.rail.length=0.3",)))
    assert 0.0 < mesh_error(run, plenty(), 1.0).error < 1e-3


def test_without_time_for_a_richer_mesh_a_part_of_the_distance_to_a_coarser_one_is_told(monkeypatch):
    settings = ("solve.duration=0.25", "bodies.b1.elements=2")
    run = compared(load_deck(CASES / "extreme/light_link.yaml", settings))
    whole = mesh_error(run, plenty(), 1.0)
    monkeypatch.setattr(mesh, "_on_richer", lambda *_: Estimate(None, "no time"))
    found = mesh_error(run, plenty(), 1.0)
    assert "of the distance to a mesh of 1 element a beam" in found.by
    assert 0.3 < found.error / whole.error < 10.0


def test_a_mesh_without_nodes_at_joints_is_no_coarser_one(monkeypatch):
    """A beam propped in its middle bends there as no element does inside."""
    prop = "  prop: {type: revolute, between: [ground.under, b1.middle]}"
    propped = STRIP.replace("elements: 4", "elements: 2, points: {middle: [0.5, 0]}")
    propped = propped.replace("{pin:", "\n  pin:").replace("b1.root]}}", f"b1.root]}}\n{prop}")
    propped = propped.replace("bodies:", "ground: {points: {under: [0.5, 0]}}\nbodies:")
    run = compared(parse_deck(propped))
    monkeypatch.setattr(mesh, "_on_richer", lambda *_: Estimate(None, "no time"))
    assert mesh_error(run, plenty(), 1.0) == Estimate(None, "no time")
    run = compared(parse_deck(propped.replace("elements: 2", "elements: 4")))
    assert mesh_error(run, plenty(), 1.0).error


def test_scenes_without_a_mesh_say_so():
    found = simulate(parse_deck(FALLING), mesh_estimate=True).statistics
    assert (found["mesh_error_estimate"], found["mesh_error_estimate_reason"]) == (0.0, "no flexible beams")
    rigid = simulate(parse_deck(STRIP), "rigid", mesh_estimate=True).statistics
    assert rigid["mesh_error_estimate_reason"] == "no flexible beams"


@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact", "ancf"])
def test_every_model_has_a_mesh_error(model):
    found = simulate(parse_deck(STRIP), model, mesh_estimate=True, after=60.0).statistics
    assert found["mesh_error_estimate"] > 0.0


def test_a_mesh_that_is_too_coarse_is_told_with_what_helps(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = call("run", "pendulum", "--no-plots")
    summary = json.loads(Path("pendulum.out/summary.json").read_text())
    assert 0.3 < summary["mesh_error_estimate"] < 3.0 and summary["error_estimate"] < 1e-8
    assert summary["limiting_channel"] == summary["mesh_error_estimate_channel"]
    told = f"time error {summary['error_estimate']:.2g}, mesh error about 0.67 (b1.angular_velocity)"
    assert told in result.stdout
    for option in ("bodies.b1.elements=8", "bodies.b1.degree=5", "--target-error"):
        assert option in result.stderr


# signals -----------------------------------------------------------------------------------------


def test_a_signal_in_an_estimate_ends_it_and_leaves_the_run(monkeypatch):
    def struck(self, share):
        raise Terminated

    monkeypatch.setattr(Stages, "after", struck)
    run = simulate(pendulum(), mesh_estimate=True, diagnosis=True)
    assert (run.status, run.exit_code, len(run.t)) == ("done", 143, 101)
    for key in ("error_estimate", "mesh_error_estimate"):
        assert (run.statistics[key], run.statistics[f"{key}_reason"]) == (None, "interrupted")
    assert run.statistics["diagnosis_reason"] == "interrupted"


def test_a_signal_in_the_mesh_estimate_keeps_the_time_error(monkeypatch):
    def struck(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(mesh, "remeshed", struck)
    run = simulate(pendulum(), mesh_estimate=True)
    assert (run.exit_code, run.statistics["mesh_error_estimate_reason"]) == (130, "interrupted")
    assert 0.0 < run.statistics["error_estimate"] < 1e-8


def test_a_signal_in_the_diagnosis_makes_no_class(monkeypatch):
    """Experiments that a signal ends have not failed: what they would have shown is not known."""

    def struck(scene, solve, progress=None, start=None):
        return run_integration(scene, solve, raising, start)

    def raising(share):
        raise Terminated

    settings = ("solve.method=generalized_alpha", "solve.step=5e-2", "solve.duration=2.0")
    whole = simulate(pendulum(*settings), error_estimate=False, diagnosis=True)
    assert (whole.status, whole.failure["class"]) == ("failed", "numerical")
    monkeypatch.setattr(experiments, "run_integration", struck)
    run = simulate(pendulum(*settings), diagnosis=True)
    assert (run.status, run.exit_code) == ("failed", 143)
    assert run.failure["class"] == "numerical" and run.statistics["diagnosis_reason"] == "interrupted"
    assert run.statistics["error_estimate_reason"] == "interrupted"


def test_an_interrupted_run_is_told_as_done_with_what_is_missing(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def struck(self, share):
        raise KeyboardInterrupt

    monkeypatch.setattr(Stages, "after", struck)
    result = call("run", "pendulum", "two_beams")
    assert result.exit_code == 130 and "done, 1 s simulated" in result.stdout
    summary = json.loads(Path("pendulum.out/summary.json").read_text())
    assert (summary["status"], summary["exit_code"]) == ("done", 130)
    assert "what was to be done after it" in summary["reason"]
    assert not Path("two_beams.out").exists() and not Path("pendulum.out/plots").exists()


@pytest.mark.parametrize(
    ("settings", "remedy"),
    [
        (("solve.method=gauss", "solve.step=0.01"), "shorten the step"),
        (("solve.method=radau", "solve.step=0.01"), "shorten the step or take gauss"),
        (("solve.method=gauss",), "lower the tolerance"),
        (("solve.method=gear",), "lower the tolerance or take gauss"),
    ],
)
def test_what_helps_against_a_drift_is_not_there_yet(settings, remedy):
    leg = compared(pendulum("solve.duration=0.02", *settings)).legs[0]
    (warning,) = doubts(leg, 0.1)["warnings"]
    assert warning.endswith(f"does not resolve the motion; {remedy}")


# budget ------------------------------------------------------------------------------------------


def test_large_scenes_are_not_taken_apart_by_dense_algebra(monkeypatch):
    def dense(*_):
        raise AssertionError("dense algebra")

    loaded = pendulum("bodies.b1.elements=128", "solve.duration=0.01")
    scene = build(loaded)
    done = run_integration(scene, scene.deck.solve.model_copy(update={"duration": 0.001}))
    assert scene.system.n > experiments.DENSE
    failed = done._replace(stop=SolverFailure("made to fail", 0.001))
    monkeypatch.setattr(diagnosis, "linearised", dense)
    monkeypatch.setattr(experiments.Experiments, "passes", lambda *_: False)
    found = diagnosis.diagnose(scene, failed, Budget(1.0))
    assert found.remedy and "growth_rate" not in found.evidence


def test_fixed_steps_that_fail_at_any_length_are_no_physics_before_free_ones_have_told():
    scene = build(pendulum("solve.step=1e-3"))
    done = run_integration(scene, scene.deck.solve.model_copy(update={"duration": 1e-3}))
    stop = SolverFailure("made to fail", 1e-3)
    trial = experiments.Experiments(scene, done._replace(stop=stop), plenty())
    trial.outcomes = {"half the step": "fails at 0.1 s", "an eighth of the step": "fails at 0.1 s"}
    trial.outcomes["steps by tolerance"] = "not finished, 0.05 s was reached"
    found = diagnosis._stays(stop, trial)
    assert found.kind == "numerical" and "undecided" in found.evidence and "solve.step=null" in found.remedy
    trial.outcomes["steps by tolerance"] = "fails at 0.1 s"
    assert diagnosis._stays(stop, trial).kind == "physical"


@pytest.mark.parametrize("none", ["none", "0s"])
def test_nothing_is_done_where_no_time_is_allowed(monkeypatch, tmp_path, none):
    monkeypatch.chdir(tmp_path)
    result = call("run", "pendulum", "--after", none)
    assert result.exit_code == 0, result.stderr
    summary = json.loads(Path("pendulum.out/summary.json").read_text())
    assert summary["error_estimate_reason"] == summary["diagnosis_reason"] == "no time was allowed for it"
    assert not {"error_estimate", "mesh_error_estimate", "diagnosis"} & set(summary["cpu_s"])
    assert not Path("pendulum.out/plots").exists()


@pytest.mark.parametrize(("option", "text"), [("--after", "nine"), ("--after", "-1s"), ("--budget", "0")])
def test_a_bad_time_is_refused(option, text):
    assert call("run", "pendulum", option, text).exit_code == 2


def test_progress_covers_all_of_the_work():
    told = []
    simulate(pendulum(), progress=told.append, mesh_estimate=True, diagnosis=True)
    stages = Stages(told.append, Wish())
    assert told == sorted(told) and told[-1] == 1.0
    stages.solving(1.0)
    assert told[-1] < 0.1  # two seconds follow
    stages.after(1.0)
    assert told[-1] == pytest.approx(1.0)


# words -------------------------------------------------------------------------------------------


def said(time=None, mesh=None, time_reason="", mesh_reason="", channels=("x", "x")):
    facts = {"error_estimate": time, "error_estimate_reason": time_reason, "mesh_error_estimate": mesh}
    facts |= {"mesh_error_estimate_reason": mesh_reason, "refinement": None}
    facts |= {"error_estimate_channel": channels[0], "mesh_error_estimate_channel": channels[1]}
    return errors(facts)


def test_errors_are_told_with_their_channels():
    assert said(3e-10, 0.3) == "time error 3e-10, mesh error about 0.3 (x)"
    assert said(3e-10, 0.3, channels="xy") == "time error 3e-10 (x), mesh error about 0.3 (y)"
    assert said(None, 0.3, "why", channels=("", "y")) == "time error not known: why, mesh error about 0.3 (y)"
    assert said(3e-10, 0.0, "", "no flexible beams", ("x", "")) == (
        "time error 3e-10 (x), mesh error 0 (no flexible beams)"
    )
    assert said(None, None, "not asked for", "not asked for", ("", "")) == "not asked for"


def test_summaries_have_last_values_and_extremes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("run", "pendulum", "--no-plots", "--after", "none").exit_code == 0
    summary = json.loads(Path("pendulum.out/summary.json").read_text())
    with Path("pendulum.out/history.csv").open() as file:
        names = file.readline().strip().split(",")[1:]
        rows = np.loadtxt(file, delimiter=",")[:, 1:]
    assert [*summary["final"]] == [*summary["extremes"]] == names == [*summary["channels"]]
    assert [*summary["final"].values()] == rows[-1].tolist()
    assert [*summary["extremes"].values()] == np.stack([rows.min(0), rows.max(0)], axis=1).tolist()
    assert all(map(math.isfinite, summary["final"].values()))


class Seconds:
    """A clock on which a second passes each time it is read, until it stops."""

    def __init__(self, until=math.inf):
        self.now, self.until = 0.0, until

    def __call__(self):
        self.now = min(self.now + 1.0, self.until)
        return self.now


@pytest.mark.parametrize("changes", [(), ("solve.step=1e-3", "solve.method=gear")])
def test_a_used_budget_tells_the_share_of_the_duration_and_starts_no_second_run(changes, monkeypatch):
    begun = []
    monkeypatch.setattr(error, "_again", lambda *args: begun.append(args))
    found = simulate(
        pendulum("solve.duration=1.0", *changes),
        progress=Budget(20.0, Seconds()).limiting(nobody),
        mesh_estimate=True,
        diagnosis=True,
        after=100.0,
    )
    share = f"{100.0 * found.reached:.2g} %"
    assert found.status == "limit" and 0.0 < found.reached < 1.0
    assert found.reason == f"the budget of 20 s was used up at {share} of the duration"
    why = found.statistics["error_estimate_reason"]
    assert "used up before a second run could tell the error" in why and "--budget" in why
    assert not begun and "--after" not in why


def test_a_budget_used_up_in_a_second_run_ends_all_further_work(monkeypatch):
    begun = []

    def again(*args, **named):
        begun.append(args)
        return run_integration(*args, **named)

    def report(share):
        if begun:
            raise BudgetUsedError(3.0, share)

    for one in (error, mesh):
        monkeypatch.setattr(one, "run_integration", again)
    wish = {"mesh_estimate": True, "diagnosis": True, "after": 1e3}
    found = simulate(pendulum("solve.duration=0.2"), progress=report, **wish)
    facts = found.statistics
    assert found.status == "done" and len(begun) == 1
    assert facts["error_estimate_reason"].startswith("the budget of the run was used up in a second run")
    assert "used up before a second run" in facts["mesh_error_estimate_reason"]
    assert "used up" in facts["diagnosis_reason"]
    assert not any("--after" in facts[f"{one}_reason"] for one in after.AFTER)
