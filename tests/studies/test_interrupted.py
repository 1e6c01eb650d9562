"""What a study has found when a signal ends it is written, marked, and told with the exit code."""

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from called import call

from hfsim.marching.runaway import Watches
from hfsim.studies.farm import Farm


def interrupt_at(monkeypatch, owner, name, count):
    """Let a function end in an interrupt at a call of it."""
    whole, calls = getattr(owner, name), []

    def cut(*arguments, **options):
        calls.append(name)
        if len(calls) == count:
            raise KeyboardInterrupt
        return whole(*arguments, **options)

    monkeypatch.setattr(owner, name, cut)


def test_a_map_keeps_the_points_that_were_there(wheel, monkeypatch):
    interrupt_at(monkeypatch, Farm, "_collect", 3)
    order = ("--methods", "gauss,explicit,gear", "--models", "exact", "--jobs", 1, "--no-plots")
    assert call("stability", "wheel.yaml", *order).exit_code == 130
    facts = json.loads((wheel / "wheel.stability/stability.json").read_text())
    assert facts["status"] == "interrupted"
    found = {point["method"]: (point["class"], point["reason"]) for point in facts["points"]}
    assert [one[0] for one in found.values()].count("accurate") == 1
    assert ("not computed", "interrupted") in found.values()


def test_limits_keep_what_was_measured(wheel, monkeypatch):
    monkeypatch.setattr("hfsim.studies.limits.STEPS", 20)
    interrupt_at(monkeypatch, Farm, "_collect", 3)
    order = ("--limits", "--methods", "explicit,generalized_alpha,gauss", "--jobs", 1, "--no-plots")
    assert call("stability", "wheel.yaml", *order).exit_code == 130
    facts = json.loads((wheel / "wheel.stability/stability.json").read_text())
    assert facts["status"] == "interrupted"
    (result,) = facts["results"]
    assert [one["method"] for one in result["limits"]] == ["explicit"]
    assert set(result["lost"].values()) == {"interrupted"}


def test_the_extreme_set_keeps_the_decks_that_ended(wheel, monkeypatch):
    interrupt_at(monkeypatch, Farm, "_collect", 2)
    order = ("free_fall", "settling", "--jobs", 1, "-o", wheel / "o")
    assert call("extreme", *order).exit_code == 130
    facts = json.loads((wheel / "o/extreme.json").read_text())
    assert facts["status"] == "interrupted"
    cases = {case["name"]: (case["class"], case["reason"]) for case in facts["cases"]}
    assert cases["free_fall"][0] == "accurate"
    assert cases["settling"] == ("not computed", "interrupted")


def command(*arguments):
    words = [sys.executable, "-m", "hfsim", *map(str, arguments)]
    own = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}  # else as of who calls
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **own)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_proof_ends_at_a_signal_and_tells_the_rules_so_far(number, code):
    with command("plan", "two_beams", "--proof", "--set", "solve.duration=1") as proof:
        proof.stderr.readline()  # which deck it is
        rule = proof.stderr.readline().split(":")[0].removeprefix("two_beams, ")
        time.sleep(0.3)
        proof.send_signal(number)
        told, _ = proof.communicate(timeout=20.0)
    assert proof.returncode == code
    assert rule in told and "fired in none" not in told


def test_a_measured_plan_keeps_what_it_has(wheel, monkeypatch):
    """A simulation that a signal ends says so in its run and raises nothing."""
    from hfsim.studies import plan

    whole, calls = plan.simulate, []

    def cut(*arguments, **options):
        calls.append(1)
        run = whole(*arguments, **options)
        return replace(run, status="interrupted", exit_code=130) if len(calls) > 10 else run

    monkeypatch.setattr(plan, "simulate", cut)
    result = call("plan", "pendulum", "--measure", "--repeats", 1, "--json", "--set", "solve.duration=0.01")
    assert result.exit_code == 130
    facts = json.loads(result.stdout)
    assert 0 < len(facts["measured"]) < len(facts["left_out"])
    assert len(calls) == 11


@pytest.mark.slow
def test_plan_tells_what_it_measured_without_warnings():


    told = call("plan", "two_beams", "--measure", "--repeats", "1")
    assert told.exit_code == 0
    assert "measured, CPU" in told.stdout


def test_the_run_to_the_state_of_modes_ends_them_as_it_would_end_itself(wheel, monkeypatch):
    modes = ("modes", "pendulum", "--at", 0.5, "--no-plots", "--set", "solve.method=gauss", "--set")
    failed, short = call(*modes, "solve.step=0.5"), call(*modes, "solve.max_steps=2")
    assert (failed.exit_code, short.exit_code) == (3, 5)
    assert "the run ends at 0 s: the equations of a step of 0.5 s could not be solved" in failed.stderr
    interrupt_at(monkeypatch, Watches, "__call__", 4)
    assert call(*modes, "solve.step=null").exit_code == 130
    assert not list(wheel.glob("*.modes"))
