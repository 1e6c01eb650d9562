"""The method that `run --target-error` chooses: raced at equal error, cheaply, with a margin, or kept."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest
import yaml
from click.testing import CliRunner

from hfsim.cli import app
from hfsim.errors import LimitReached
from hfsim.integrators import METHODS, _automatic
from hfsim.integrators._tableau import gauss
from hfsim.integrators.collocation import CollocationMethod
from hfsim.marching.distance import channel_errors
from hfsim.marching.integration import run_integration
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck
from hfsim.scene.shipped import CASES
from hfsim.simulate import simulate
from hfsim.studies import methods, timing
from hfsim.studies.methods import Contest, Entry, Turn, candidates
from hfsim.studies.refine import races as module
from hfsim.studies.refine.study import refine

LINK = CASES / "extreme" / "light_link.yaml"
SHORT = "solve.duration=0.1"


def link(target, *overrides):
    return load_deck(LINK, (SHORT, f"solve.target_error={target}", *overrides))


def pendulum(*overrides):
    tips = "solve.target_channels=[b1.tip.x, b1.tip.y]"
    return load_deck(
        CASES / "pendulum.yaml", ("solve.duration=0.2", "solve.target_error=1e-2", tips, *overrides)
    )


# --- on scenes -----------------------------------------------------------------------------------


@pytest.fixture
def handicapped(monkeypatch):
    """Let `auto` be gauss with two stages and more steps than it needs: radau wins, and races have time."""

    def slow(solve, dissipates):
        return CollocationMethod("slow gauss", gauss(2), 1e-2 * solve.tolerance)

    monkeypatch.setattr(_automatic, "chosen", slow)
    monkeypatch.setattr(module, "PROBING", 0.5)
    monkeypatch.setattr(module, "candidates", lambda but: [name for name in ("radau", "gear") if name != but])


FINE = ("solve.target_error=1e-3", "solve.duration=0.2")


@pytest.mark.slow
@pytest.mark.usefixtures("handicapped")
def test_another_method_is_taken_where_it_is_much_sooner():
    run, chosen = refine(pendulum(*FINE))
    found = run.statistics["refinement"]
    assert found["status"] == "reached"
    assert found["chosen"]["method"] == chosen.deck.solve.method == run.method
    assert run.method == "radau"
    words = found["method_choice"]
    assert words.startswith("radau: ") and "times sooner than slow gauss" in words
    won = [probe for probe in found["probes"] if probe["outcome"] == "reached"]
    assert won and won[-1]["error"] <= 2e-4 and won[-1]["cpu_s"] * methods.MARGIN <= won[-1]["to_beat_s"]
    assert found["probing_cpu_s"] <= 1.1 * module.PROBING * found["cpu_s"]
    finer = ("bodies.b1.elements=16", "bodies.b1.degree=9", "solve.tolerance=1e-7", "solve.method=gauss")
    other = (*FINE[1:], *finer)
    truth = simulate(load_deck(CASES / "pendulum.yaml", other), error_estimate=False).channels
    errors = channel_errors(run.channels, truth)[1]
    assert max(errors["b1.tip.x"], errors["b1.tip.y"]) <= found["estimate"] <= 1e-3


@pytest.mark.slow
@pytest.mark.usefixtures("handicapped")
def test_a_late_winner_is_raced_on_the_finer_mesh_too(monkeypatch):
    hold = module.Races.hold
    monkeypatch.setattr(
        module.Races, "hold", lambda self: hold(self) if len(self.search.levels) > 3 else None
    )
    run, _ = refine(pendulum(*FINE))
    found = run.statistics["refinement"]
    levels = found["levels"]
    taken = [k for k, level in enumerate(levels) if level["refined"] == "method"]
    assert taken and taken[0] > 2 and run.method == levels[taken[0]]["method"] != "slow gauss"
    assert levels[taken[0]]["unknowns"] > levels[1]["unknowns"]
    won = [probe["unknowns"] for probe in found["probes"] if probe["outcome"] == "reached"]
    assert won[0] == levels[1]["unknowns"] and won[-1] == levels[taken[0]]["unknowns"]
    assert found["estimate"] <= 1e-3


def test_the_default_damps_by_itself_what_no_step_resolves():
    """A link with frequencies thousands of times that of its motion: nothing is much sooner."""
    run, chosen = refine(link(1e-2))
    found = run.statistics["refinement"]
    assert (found["status"], run.method, chosen.deck.solve.method) == ("reached", "radau", "auto")
    assert found["method_choice"].startswith("auto, the default")


@pytest.mark.slow
@pytest.mark.usefixtures("handicapped")
def test_the_choice_is_told_and_repeated_by_resolved_yaml(tmp_path):
    def call(*arguments):
        return CliRunner().invoke(app, [str(word) for word in ("run", *arguments, "--no-plots")])

    tips, target = "b1.tip.x,b1.tip.y", ("--target-error", "1e-3")
    short = ("--set", "solve.duration=0.2", "--target-channels", tips)
    result = call("pendulum", *short, *target, "-o", tmp_path / "first")
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "first" / "summary.json").read_text())["refinement"]
    method = found["chosen"]["method"]
    assert method == "radau" and method in {probe["method"] for probe in found["probes"]}
    assert f"method {method}: " in result.stdout and "races took" in result.stdout
    assert f"method {method}: " in (tmp_path / "first" / "run.log").read_text()
    deck = yaml.safe_load((tmp_path / "first" / "resolved.yaml").read_text())
    assert deck["solve"]["method"] == method
    again = call(tmp_path / "first" / "resolved.yaml", "-o", tmp_path / "second")
    assert again.exit_code == 0, again.output
    first, second = ((tmp_path / name / "history.csv").read_bytes() for name in ("first", "second"))
    assert first == second


@pytest.mark.timed
def test_the_default_is_kept_where_nothing_is_much_sooner():
    run, chosen = refine(pendulum())
    found = run.statistics["refinement"]
    assert chosen.deck.solve.method == "auto"
    assert found["method_choice"].startswith("auto, the default: none of gear")
    assert {level["method"] for level in found["levels"]} == {"explicit", "gauss", "gauss, radau"}
    assert any(probe["outcome"] == "outrun" for probe in found["probes"])
    assert found["probing_cpu_s"] <= 1.1 * module.PROBING * found["cpu_s"]


@pytest.mark.parametrize("case", ["heavy_top", "pendulum"])
def test_a_default_that_is_kept_makes_the_same_steps_again(case):
    """It may be more than its name says: explicit steps are sharper, few stages are for loose tolerances."""
    top = CASES / "heavy_top.yaml", ("solve.duration=0.1", "solve.target_error=1e-3")
    run, chosen = refine(pendulum() if case == "pendulum" else load_deck(*top))
    again = simulate(chosen, error_estimate=False)
    assert again.statistics["steps"] == run.statistics["steps"]
    for one, other in zip(again.channels, run.channels, strict=True):
        assert one.values == pytest.approx(other.values, abs=1e-13, rel=1e-13)


def test_a_named_method_is_kept():
    run, chosen = refine(pendulum("solve.method=radau"))
    found = run.statistics["refinement"]
    assert (run.method, chosen.deck.solve.method, found["probes"]) == ("radau", "radau", [])
    assert found["method_choice"] == "radau, kept: the deck names it"


def test_no_time_for_races_leaves_the_default(monkeypatch):
    monkeypatch.setattr(module, "PROBING", 0.0)
    found = refine(pendulum())[0].statistics["refinement"]
    assert found["probes"] == []
    others = "gear, generalized_alpha, radau, gauss, energy"
    assert found["method_choice"] == f"auto, the default; not judged for lack of time: {others}"


# --- races, with a clock that the test keeps -----------------------------------------------------


@pytest.fixture
def held(monkeypatch):
    """Return a function that holds a contest in which integrations cost what the test says."""
    loaded = load_deck(CASES / "pendulum.yaml", ("solve.duration=0.02", "solve.tolerance=1e-3"))
    scene = build(loaded)
    done, clock = run_integration(scene, scene.deck.solve), [0.0]

    def hold(costs, error=lambda method, tolerance: 1e-4, time=100.0, scene_for=None):
        def integrate(scene, solve, check=lambda share: None):
            if solve.max_steps == 1:
                return done
            try:
                for k in range(100):
                    clock[0] += costs.get(solve.method, 5.0) / 100
                    check((k + 1) / 100)
            except LimitReached as stop:
                return done._replace(stop=stop)
            return done

        def changed(method, tolerance):
            solve = {"method": method, "tolerance": tolerance}
            return replace(scene, loaded=loaded.with_solve(solve))

        monkeypatch.setattr(timing, "run_integration", integrate)
        for one in (timing, methods):
            monkeypatch.setattr(one, "time", SimpleNamespace(process_time=lambda: clock[0]))
        start, mark = clock[0], Entry("gauss", 1e-3, scene, done, costs["gauss"])
        open_methods = {name: Turn(1e-3) for name in candidates("gauss")}
        contest = Contest(
            mark, 1e-3, scene_for or changed, lambda s, _: error(s.deck.solve.method, s.deck.solve.tolerance),
            lambda: time - (clock[0] - start), lambda share: None, open_methods, [],
        )  # fmt: skip
        return contest.hold(), contest

    return hold


def outcomes(contest):
    return [(probe.method, probe.outcome) for probe in contest.probes]


def test_all_methods_have_a_turn():
    assert sorted([*candidates("gauss"), "gauss"]) == sorted(METHODS)


@pytest.mark.parametrize(
    ("cost", "winner"), [(0.2, "radau"), (0.6, "radau"), (0.7, None), (0.9, None), (3.0, None)]
)
def test_only_what_is_sooner_by_the_margin_wins(held, cost, winner):
    won, contest = held({"gauss": 1.0, "radau": cost})
    assert (won and won.method) == winner
    assert not contest.open
    spent = sum(probe.cpu for probe in contest.probes if probe.method != "radau")
    assert spent < 0.6, "what loses is stopped early"


def test_of_two_the_sooner_one_wins(held):
    won, _ = held({"gauss": 1.0, "gear": 0.3, "radau": 0.1})
    assert won.method == "radau"


def test_methods_are_compared_at_equal_error(held):
    won, contest = held({"gauss": 1.0, "gear": 0.1}, error=lambda method, tolerance: 20.0 * tolerance)
    assert won.method == "gear" and won.tolerance < 1e-3 / 20.0 and won.error <= 1e-3
    assert outcomes(contest)[:2] == [("gear", "inaccurate"), ("gear", "reached")]
    won, contest = held({"gauss": 1.0, "gear": 0.1}, error=lambda method, tolerance: 0.01)
    assert won is None and outcomes(contest)[: methods.TRIES] == [("gear", "inaccurate")] * methods.TRIES


def test_a_narrow_win_is_timed_again(held):
    _, contest = held({"gauss": 1.0, "radau": 0.5})
    assert "timed again, 2 times sooner" in next(p for p in contest.probes if p.method == "radau").reason
    _, contest = held({"gauss": 1.0, "radau": 0.1})
    assert next(p for p in contest.probes if p.method == "radau").reason == ""


def test_so_is_any_win_over_a_short_first_run(held):
    """That has imported and recorded what the others find."""
    _, contest = held({"gauss": 0.5, "radau": 0.05})
    assert "timed again, 10 times sooner" in next(p for p in contest.probes if p.method == "radau").reason


def test_races_end_with_their_time(held):
    won, contest = held({"gauss": 1.0}, time=0.05)
    assert won is None and not contest.probes and len(contest.open) == 5
    won, contest = held({"gauss": 1.0, "gear": 0.5}, time=0.4)
    assert outcomes(contest)[0] == ("gear", "put off")
    assert contest.open["gear"].needs > 0.4 and sum(probe.cpu for probe in contest.probes) < 0.42


def test_what_the_scene_refuses_is_told(monkeypatch):
    monkeypatch.setattr("hfsim.studies.refine.races.PROBING", 0.99)  # time enough for all methods
    run, _ = refine(pendulum("solve.coordinates=frame"))
    for probe in run.statistics["refinement"]["probes"]:
        if probe["method"] == "energy":
            assert (probe["outcome"], probe["cpu_s"]) == ("refused", 0.0)
            assert "absolute coordinates" in probe["reason"]
            break
    else:
        pytest.fail("energy was not considered")
