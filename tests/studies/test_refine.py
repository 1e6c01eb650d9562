"""`run --target-error`: targets are truly reached, what cannot be reached says so, the budget is kept."""

import json
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
import yaml
from called import call

from hfsim.errors import DeckError, Terminated
from hfsim.integrators import _loop
from hfsim.marching.distance import channel_errors
from hfsim.parts.channels import is_judged
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import CASES
from hfsim.simulate import simulate
from hfsim.studies.methods import Entry, Probe
from hfsim.studies.refine.part import Part
from hfsim.studies.refine.races import Pair, Races
from hfsim.studies.refine.search import Search
from hfsim.studies.refine.setting import Setting, refined
from hfsim.studies.refine.study import refine

TIPS = "solve.target_channels=[b1.tip.x, b1.tip.y]"


def pendulum(target, *overrides):
    return load_deck(
        CASES / "pendulum.yaml", ("solve.duration=0.2", f"solve.target_error={target}", *overrides)
    )


FALL = """
hfsim: 1
gravity: [0, -9.81]
bodies: {stone: {type: rigid, mass: 1, inertia: 0.1, points: {hook: [0.1, 0.2]}}}
joints: {pin: {type: revolute, between: [ground, stone.hook]}}
solve: {duration: 0.3}
output: {channels: [stone.x]}
"""


def unlike(loaded, elements, degree, tolerance):
    """Return a much finer run by another method and model than refinements use."""
    deck = loaded.deck
    beams = {name: body for name, body in deck.bodies.items() if body.type == "beam"}
    mesh = {"elements": elements, "degree": degree}
    bodies = {**deck.bodies, **{name: body.model_copy(update=mesh) for name, body in beams.items()}}
    solve = deck.solve.model_copy(update={"tolerance": tolerance, "method": "radau", "target_error": None})
    finer = replace(loaded, deck=deck.model_copy(update={"bodies": bodies, "solve": solve}))
    return simulate(finer, "ancf", error_estimate=False).channels


def true_error(run, truth, counted):
    relative = channel_errors(run.channels, truth)[1]
    return max(relative[name] for name in counted)


def test_a_level_with_finer_ones_is_not_called_the_finest():
    """One run with a tighter tolerance tells how little that changes."""
    run, _ = refine(parse_deck(FALL, overrides=["solve.target_error=0.1"]))
    found = run.statistics["refinement"]
    assert found["chosen"]["number"] == 0 and len(found["levels"]) > 1
    assert found["chosen"]["why"].startswith("the level that finer ones were held against; its error is")


# --- targets are reached -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fine_pendulum():
    return unlike(pendulum(0.1), 16, 5, 1e-6)


@pytest.mark.parametrize("target", [1e-1, 1e-2, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_the_error_of_a_beam_is_below_the_target_and_the_estimate(fine_pendulum, target):
    run, _ = refine(pendulum(target, TIPS))
    found = run.statistics["refinement"]
    assert (run.status, run.exit_code, found["status"]) == ("done", 0, "reached")
    true = true_error(run, fine_pendulum, ("b1.tip.x", "b1.tip.y"))
    assert true <= found["estimate"] <= target
    assert run.statistics["error_estimate"] == found["estimate"]
    assert found["limiting_channel"] in ("b1.tip.x", "b1.tip.y")


def test_only_the_body_that_matters_is_refined():
    """Two pendulums side by side, one soft, one stiffer."""
    firm = {"type": "beam", "material": "firm", "section": "strip", "length": 0.4, "elements": 4}
    deck = pendulum(
        1e-2, "materials.firm={density: 5540.0, youngs_modulus: 7.0e8}", f"bodies.b2={json.dumps(firm)}",
        "joints.other={type: revolute, between: [ground, b2.root]}", "initial.b2={angle: 0.0}",
        "output.channels=[b1.tip.y, b2.tip.y]", "solve.duration=0.12",
    )  # fmt: skip
    run, _ = refine(deck)
    assert run.exit_code == 0, run.reason
    bodies = run.statistics["refinement"]["chosen"]["bodies"]
    soft, firm = (bodies[name]["elements"] * (bodies[name]["degree"] - 1) for name in ("b1", "b2"))
    # one finer mesh of the firm one is tried, and kept if it costs nothing
    assert firm <= 8 and soft >= 16
    assert true_error(run, unlike(deck, 10, 5, 1e-6), deck.deck.channels) <= 1e-2


def auto_and_fixed(*overrides):
    """Return two pendulums side by side, the mesh of the second left open."""
    other = {"type": "beam", "material": "firm", "section": "strip", "length": 0.4, "elements": "auto"}
    return (
        "materials.firm={density: 5540.0, youngs_modulus: 7.0e8}", f"bodies.b2={json.dumps(other)}",
        "joints.other={type: revolute, between: [ground, b2.root]}", "initial.b2={angle: 0.0}",
        "bodies.b1.elements=3", "output.channels=[b2.tip.x, b2.tip.y]", "solve.duration=0.12", *overrides,
    )  # fmt: skip


def test_only_beams_with_auto_elements_are_refined(tmp_path):
    sets = [word for change in auto_and_fixed() for word in ("--set", change)]
    result = call("run", "pendulum", "--no-plots", "-o", tmp_path / "out", *sets)
    assert result.exit_code == 0, result.output
    assert "not counted: mesh errors of b1" in result.stdout
    found = json.loads((tmp_path / "out" / "summary.json").read_text())["refinement"]
    assert (found["status"], found["target"], found["fixed_meshes"]) == ("reached", 1e-2, ["b1"])
    assert all(level["bodies"]["b1"] == {"elements": 3, "degree": 3} for level in found["levels"])
    assert found["levels"][0]["bodies"]["b2"] == {"elements": 2, "degree": 3}
    assert any(level["refined"].endswith("of b2") for level in found["levels"])
    deck = load_deck(tmp_path / "out" / "resolved.yaml")
    chosen = found["chosen"]["bodies"]["b2"]
    assert (deck.deck.bodies["b2"].elements, deck.deck.bodies["b2"].degree) == tuple(chosen.values())
    assert deck.auto_elements == () and deck.deck.solve.target_error is None
    finer = deck.deck.bodies["b2"].model_copy(update={"elements": 8, "degree": 5})
    solve = deck.deck.solve.model_copy(update={"tolerance": 1e-7})
    bodies = {**deck.deck.bodies, "b2": finer}
    truth = replace(deck, deck=deck.deck.model_copy(update={"bodies": bodies, "solve": solve}))
    run, fine = (simulate(one, error_estimate=False) for one in (deck, truth))
    assert true_error(run, fine.channels, deck.deck.channels) <= found["estimate"] <= 1e-2


def test_other_commands_take_auto_elements_as_four(tmp_path):
    given = load_deck(CASES / "pendulum.yaml", auto_and_fixed())
    assert (given.auto_elements, given.deck.solve.target_error) == (("b2",), 1e-2)
    four = load_deck(CASES / "pendulum.yaml", auto_and_fixed("bodies.b2.elements=4"))
    assert given.with_numbers().deck == four.deck
    assert given.deck_sha256 != given.with_numbers().deck_sha256 == four.deck_sha256
    hurried = load_deck(CASES / "pendulum.yaml", auto_and_fixed("solve.budget=3"))
    assert hurried.with_numbers().deck == four.deck

    def told(command, *arguments):
        sets = [word for change in auto_and_fixed("solve.duration=0.01") for word in ("--set", change)]
        result = call(command, *arguments, *sets)
        assert result.exit_code == 0, result.output
        assert result.stderr.count("elements: auto of b2 taken as 4") == 1
        return result.stdout

    assert json.loads(told("check", "pendulum", "--json"))["unknowns"] == build(four).system.n
    told("compare", "exact", "linear", "--case", "pendulum", "--no-plots", "-o", tmp_path / "compared")
    for path in (tmp_path / "compared").rglob("resolved.yaml"):
        deck = yaml.safe_load(path.read_text())
        assert deck["bodies"]["b2"]["elements"] == 4 and "target_error" not in deck["solve"]


def test_auto_elements_in_deck_words():
    for change, words in {
        "bodies.b1.elements=many": "must be a whole number or auto, not 'many'",
        "solve.step=1e-3": "target_error and elements: auto choose the steps",
        "bodies.b1.elements=0": "must be at least 1",
    }.items():
        with pytest.raises(DeckError, match=words):
            load_deck(CASES / "pendulum.yaml", auto_and_fixed(change))


DOUBLE_PENDULUM = """
hfsim: 1
gravity: [0.0, -9.81]
bodies:
  a: {type: rigid, mass: 1.0, inertia: 0.02, points: {top: [-0.25, 0.0], end: [0.25, 0.0]}}
  b: {type: rigid, mass: 1.0, inertia: 0.02, points: {top: [-0.25, 0.0]}}
joints:
  pin: {type: revolute, between: [ground, a.top]}
  elbow: {type: revolute, between: [a.end, b.top]}
initial: {a: {angle: "80 deg"}, b: {angle: "100 deg"}}
solve: {duration: 0.5, target_error: 1.0e-6}
output: {interval: 0.05, channels: [a.angle, b.x, b.y]}
"""


def test_without_beams_only_the_tolerance_is_chosen():
    deck = parse_deck(DOUBLE_PENDULUM)
    run, _ = refine(deck)
    found = run.statistics["refinement"]
    assert found["status"] == "reached"
    assert {level["refined"] for level in found["levels"]} == {"", "tolerance"}
    assert true_error(run, unlike(deck, 1, 3, 1e-11), deck.deck.channels) <= found["estimate"] <= 1e-6


# --- and what cannot be reached says so ----------------------------------------------------------


def test_changes_that_do_not_shrink_end_the_search(monkeypatch):
    monkeypatch.setattr(Search, "distance", lambda self, level, finer: (0.3, "b1.tip.y"))
    run, _ = refine(pendulum(1e-2, "solve.duration=0.02"))
    assert (run.status, run.exit_code) == ("done", 4)
    assert "finer meshes of b1 do not bring b1.tip.y closer: the last changes are 3e-1" in run.reason
    assert run.statistics["error_estimate"] >= 0.3


@pytest.mark.slow
def test_a_kink_is_told_and_the_channel_named():
    """The root of the falling beam snaps round: its angular velocity needs meshes beyond reason."""
    run, _ = refine(pendulum(1e-1, "solve.duration=0.7"))
    found = run.statistics["refinement"]
    assert (run.status, run.exit_code) == ("done", 4)
    assert "finer meshes of b1 do not bring b1.angular_velocity closer" in run.reason
    assert found["used_s"] < 0.5 * found["budget_s"]


@pytest.mark.slow
def test_a_chaotic_motion_is_told_from_one_that_converges():
    """Errors of a double pendulum grow until no tolerance helps; it must not cost the budget to find out."""
    deck = parse_deck(DOUBLE_PENDULUM, overrides=("solve.duration=20", "solve.target_error=1e-4"))
    run, _ = refine(deck)
    found = run.statistics["refinement"]
    assert (run.status, run.exit_code, found["status"]) == ("done", 4, "missed")
    assert "do not bring" in run.reason and found["limiting_channel"] in run.reason
    assert found["estimate"] > 0.1
    assert len(found["levels"]) <= 6 and found["used_s"] < 0.5 * found["budget_s"]
    assert run.end_time == 20.0


def test_a_model_that_breaks_down_fails_as_in_a_plain_run():
    run, _ = refine(pendulum(1e-2, "solve.model=lowOrder"))
    assert (run.status, run.exit_code) == ("failed", 3)
    assert run.failure is not None and run.statistics["error_estimate"] is None
    assert {level["status"] for level in run.statistics["refinement"]["levels"]} == {"failed"}


def test_finer_levels_that_fail_end_the_search(monkeypatch):
    integrate = Search._integrate

    def fragile(self, level):
        integrate(self, level)
        if level.unknowns > 10:
            level.status, level.reason, level.channels = "failed", "it broke", ()

    monkeypatch.setattr(Search, "_integrate", fragile)
    run, _ = refine(pendulum(1e-2, TIPS))
    assert run.exit_code == 4 and "finer levels fail: it broke" in run.reason
    assert run.statistics["error_estimate"] is None
    assert run.statistics["unknowns"] == 10


def test_the_budget_is_kept():
    start = time.process_time()  # however busy the machine is
    run, _ = refine(pendulum(1e-9, "solve.budget=1.0"))
    used = time.process_time() - start
    found = run.statistics["refinement"]
    assert (run.status, run.exit_code, found["status"]) == ("limit", 5, "limit")
    assert used < 1.6
    assert run.end_time == 0.2, "the best level is whole"
    assert found["estimate"] is None or found["estimate"] > 1e-9


def test_a_budget_below_one_level_keeps_what_was_computed(monkeypatch):
    monkeypatch.setattr(_loop, "AT_ONCE", 1)
    run, _ = refine(pendulum(1e-2, "solve.budget=1e-6", "solve.duration=0.7"))
    assert (run.status, run.exit_code) == ("limit", 5)
    assert "budget" in run.reason and run.end_time < 0.7


def test_a_level_that_would_not_fit_is_not_begun(monkeypatch):
    """The coarse mesh fails; the deck's own would need 512 matrices of 1024 x 1024 and minutes."""
    deck = ("solve.model=lowOrder", "bodies.b1.elements=512")
    start = time.process_time()
    run, _ = refine(pendulum(1e-3, *deck, "solve.budget=5.0"))
    assert time.process_time() - start < 4.0
    assert (run.status, run.exit_code) == ("limit", 5)
    assert "mass matrix" in run.reason and "the next level would take about" in run.reason
    monkeypatch.setattr("hfsim.scene.memory.available", lambda: 2e8)
    run, _ = refine(pendulum(1e-3, *deck, "solve.budget=1e6"))
    assert (run.status, run.exit_code) == ("limit", 5)
    assert "GB of memory, of which there are 200 MB" in run.reason
    monkeypatch.setattr("hfsim.studies.refine.search.available", lambda: -1.0)
    run, _ = refine(pendulum(1e-3))
    assert (run.status, run.exit_code) == ("limit", 5) and "of memory, of which there are" in run.reason
    assert run.end_time == 0.2, "the first level is kept"


def stopped_at(monkeypatch, count, stop):
    """Let a level end in an exception, after some whole ones."""
    integrate, calls = Search._integrate, []

    def fragile(self, level):
        calls.append(level)
        if len(calls) == count:
            raise stop
        integrate(self, level)

    monkeypatch.setattr(Search, "_integrate", fragile)


def test_a_lack_of_memory_keeps_the_best_level(monkeypatch):
    stopped_at(monkeypatch, 4, MemoryError())
    run, _ = refine(pendulum(1e-3, TIPS))
    assert (run.status, run.exit_code, run.end_time) == ("limit", 5, 0.2)
    assert "memory" in run.reason and run.statistics["error_estimate"] > 1e-3
    assert run.statistics["refinement"]["levels"][-1]["reason"] == "not enough memory"


@pytest.mark.parametrize(
    ("stop", "code", "words"),
    [(Terminated(), 143, "SIGTERM"), (KeyboardInterrupt(), 130, "from the keyboard")],
)
def test_a_signal_keeps_the_best_level_and_says_which_it_was(monkeypatch, stop, code, words):
    stopped_at(monkeypatch, 3, stop)
    run, _ = refine(pendulum(1e-3, TIPS))
    assert (run.status, run.exit_code, run.end_time) == ("interrupted", code, 0.2)
    assert words in run.reason
    stopped_at(monkeypatch, 1, stop)
    with pytest.raises(type(stop)):
        refine(pendulum(1e-3, TIPS))


# --- pieces --------------------------------------------------------------------------------------


def part(*changes):
    one = Part(("degree", "elements"), ("b1",))
    before, after = (SimpleNamespace(work=work, unknowns=10) for work in (1.0, 2.0))
    for change in changes:
        one.note(change, "degree", before, after, 0.0)
    return one


def test_what_is_left_is_that_of_a_geometric_series():
    assert part(0.6, 0.2).left == pytest.approx(0.1)
    assert part(0.8, 0.4).left == pytest.approx(0.4)
    assert part(0.5).left == pytest.approx(0.5)
    assert part(1.0, 1e-6).left == pytest.approx(1e-6 / 2), "a sudden drop may be luck"
    assert part().left == float("inf")
    assert not part(1.0, 0.5, 0.25, 0.12, 0.06).stalled
    assert part(1.0, 0.9, 1.2, 0.9, 1.1).stalled
    assert part(0.6, 1.0, 0.6, 0.7, 0.7).stalled
    assert not part(2.4, 0.4, 1.2, 1.5, 0.3).stalled, "0.4 was luck"


def test_moves():
    setting = Setting((("a", 2, 3), ("b", 2, 9)), 1e-3)
    assert refined(setting, "elements", ("a",)).mesh == (("a", 4, 3), ("b", 2, 9))
    assert refined(setting, "degree", ("a", "b")).mesh == (("a", 2, 5), ("b", 2, 9))
    assert refined(setting, "degree", ("b",)) is None
    assert refined(setting, "tolerance", ()).tolerance == pytest.approx(3.3e-5)
    assert refined(replace(setting, tolerance=1e-12), "tolerance", ()) is None


def test_the_deck_refuses_what_does_not_go_together():
    with pytest.raises(DeckError) as caught:
        load_deck(CASES / "pendulum.yaml", ("solve.budget=3", "solve.target_channels=[b1.tip.x]"))
    assert str(caught.value).count("goes with target_error or elements: auto only") == 1
    with pytest.raises(DeckError, match="choose the steps"):
        pendulum(1e-3, "solve.step=1e-3")
    with pytest.raises(DeckError, match=r"'b1.tip.z' is not among output.channels \(did you mean"):
        pendulum(1e-3, "solve.target_channels=[b1.tip.z]")
    with pytest.raises(DeckError, match="has no range"):
        pendulum(1e-3, "solve.target_channels=[energy.total]")
    assert not is_judged("constraint.position")


# --- the command ---------------------------------------------------------------------------------


def run_pendulum(folder, *arguments):
    target = ("--target-error", "2e-2", "--target-channels", "b1.tip.x,b1.tip.y", "--budget", "30s")
    short = ("--set", "solve.duration=0.1", "--no-plots", "-o", folder)
    return call("run", "pendulum", *target, *short, *arguments)


def test_resolved_yaml_repeats_the_chosen_run(tmp_path):
    result = run_pendulum(tmp_path / "first")
    assert result.exit_code == 0, result.output
    for words in ("target error 0.02: reached", "level", "tolerance", "degree of b1", "*"):
        assert words in result.stdout
    summary = json.loads((tmp_path / "first" / "summary.json").read_text())
    found = summary["refinement"]
    deck = yaml.safe_load((tmp_path / "first" / "resolved.yaml").read_text())
    assert not {"target_error", "target_channels", "budget"} & deck["solve"].keys()
    assert deck["solve"]["tolerance"] == found["chosen"]["tolerance"]
    assert deck["bodies"]["b1"]["elements"] == found["chosen"]["bodies"]["b1"]["elements"]
    assert summary["cpu_s"]["solve"] < found["cpu_s"] <= summary["cpu_s"]["total"]
    again = call("run", tmp_path / "first" / "resolved.yaml", "--no-plots", "-o", tmp_path / "second")
    assert again.exit_code == 0, again.output
    first, second = ((tmp_path / name / "history.csv").read_bytes() for name in ("first", "second"))
    assert first == second


def test_json_and_quiet(tmp_path):
    result = run_pendulum(tmp_path / "a", "--json", "-q")
    facts = json.loads(result.stdout)
    assert facts["refinement"]["status"] == "reached"
    assert facts["refinement"]["target"] == 0.02
    assert run_pendulum(tmp_path / "b", "-q").output == ""


def test_a_target_is_refined_by_estimates(tmp_path):
    result = run_pendulum(tmp_path / "a", "--no-error-estimate")
    assert result.exit_code == 2 and "--no-error-estimate" in result.output
    assert not (tmp_path / "a").exists()


def test_each_deck_has_its_own_target(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    decks = {
        "plain": DOUBLE_PENDULUM.replace(", target_error: 1.0e-6", ""),
        "easy": DOUBLE_PENDULUM,
        "hurried": DOUBLE_PENDULUM.replace("1.0e-6", "1.0e-6, budget: 1.0e-6"),
    }
    for name, text in decks.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    result = call("run", "plain.yaml", "hurried.yaml", "easy.yaml", "--no-plots")
    assert result.exit_code == 5, result.output
    assert "hurried: limit" in result.stderr
    summaries = {name: json.loads((tmp_path / f"{name}.out/summary.json").read_text()) for name in decks}
    assert "refinement" not in summaries["plain"]
    assert summaries["easy"]["refinement"]["status"] == "reached"
    assert [summaries[n]["exit_code"] for n in decks] == [0, 0, 5]


def test_a_method_that_won_on_a_coarser_mesh_alone_is_not_told_as_slower():
    """The table had it reach the error, timed again, while the sentence had it among those that do not."""
    level, finer = SimpleNamespace(method="gauss", unknowns=10), SimpleNamespace(method="radau", unknowns=20)
    search = SimpleNamespace(
        loaded=SimpleNamespace(deck=SimpleNamespace(solve=SimpleNamespace(method="auto"))),
        current=finer, levels=[level, finer],
    )  # fmt: skip
    races = Races(search)
    races.pair = Pair(level, level, 0.0, 2.0e-5)
    races.probes = [
        Probe(method, 1.0e-5, outcome, "", "gauss", 10, 1.0, 4.5, 1.0)
        for method, outcome in (("gear", "outrun"), ("gauss", "outrun"), ("explicit", "reached"))
    ]
    races.ahead = Entry("explicit", 1.0e-5, None, None, 1.0, 1.0e-6, 4.5)
    assert "none of gear reaches" in races.words
    assert "explicit was 4.5 times sooner with 10 unknowns, and not timed with 20" in races.words
    races.ahead = None
    assert races.words.startswith("auto, the default: none of gear, explicit reaches")
    assert "unknowns" not in races.words
