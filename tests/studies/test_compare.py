"""The judgement of `compare`, on synthetic runs whose differences are known."""

import math

import numpy as np
import pytest

from hfsim.output.comparison import COLUMNS, as_rows
from hfsim.output.plots import draw_comparison, overlay_limits
from hfsim.run.solution import Channel, Run
from hfsim.studies.compare import as_facts, compare


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
    comparison = compare(runs, "exact", 0.01, {"ancf": [9.0, 1.0, 1.1], "exact": [0.1, 2.0, 2.0]})
    assert comparison.verdict == "ancf"
    assert comparison.result("ancf").solve_cpu == 1.1


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
