"""The command line with a fake simulation: exit codes, folders, what goes to which stream."""

import json
import os
import re
import subprocess
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import call

import hfsim.output.api
import hfsim.output.extras

# what commands import later needs the real deck module, for which the tests put in another
import hfsim.output.plots
import hfsim.output.recording
import hfsim.studies.compare.choice
import hfsim.studies.compare.measurements
import hfsim.studies.compare.study
import hfsim.trust.validity
from hfsim.cli import COMMANDS, _end
from hfsim.errors import DeckError, DeckProblem
from hfsim.marching.solution import Channel, Run
from hfsim.output.progress import Progress
from hfsim.output.talk import Talk
from hfsim.scene.shipped import CASES
from hfsim.studies.compare.choice import usual_models

ROOT = Path(__file__).resolve().parents[2]


class FakeDeck:
    """A deck file of one line: its name. Overrides are kept as they are."""

    output = types.SimpleNamespace(plots=True, shapes=False)
    channels = ("b1.tip.x", "b1.tip.y", "constraint.position")
    bodies = types.MappingProxyType({})
    sweep = None

    def __init__(self, path, overrides):
        self.name = Path(path).read_text().strip()
        self.settings = dict(item.split("=", 1) for item in overrides)
        self.solve = types.SimpleNamespace(
            model=self.settings.get("solve.model", "exact"), budget=None, method="gauss", coordinates="auto",
            step=None, tolerance=1e-8,
        )  # fmt: skip

    def models(self, model):
        return {}

    def resolved(self):
        return {"name": self.name, "solve": {"model": self.settings.get("solve.model", "exact")}}


class FakeScene:
    """In place of `hfsim.scene.loading` and `hfsim.simulate`; `behaviour` says what a deck or model does."""

    def __init__(self):
        self.behaviour = {}
        self.calls = []

    def load_deck(self, path, overrides=()):
        deck = FakeDeck(path, overrides)
        if deck.name == "bad" or deck.settings.get("solve.model") == "nonsense":
            raise DeckError(str(path), [DeckProblem("bodies", "is missing")])
        loaded = types.SimpleNamespace(
            deck=deck, deck_sha256="f" * 64, auto_elements=(), warnings=(), has_target=False
        )
        loaded.source = types.SimpleNamespace(texts={}, known={}, is_overridden=lambda path: False)
        loaded.with_solve = lambda change: types.SimpleNamespace(**{**vars(loaded), "other": 1e-9})
        loaded.with_numbers = lambda note=None: loaded
        return loaded

    def check(self, loaded, model=None):
        if loaded.deck.name == "unbuildable":
            raise DeckError("case", [DeckProblem("joints", "cannot be closed")])
        return {"bodies": {"beam": 2, "rigid": 1}, "joints": 3, "unknowns": 40, "multipliers": 6}

    def simulate(self, loaded, model=None, progress=None, error_estimate=True, sink=None, **_):
        self.check(loaded)
        model = model or loaded.deck.resolved()["solve"]["model"]
        self.calls.append((loaded.deck.name, model, error_estimate))
        if progress:
            progress(0.5)
        what = self.behaviour.get(model) or self.behaviour.get(loaded.deck.name) or {}
        if "raise" in what:
            raise what["raise"]
        error = what.get("error", 0.0) + getattr(loaded, "other", 0.0)
        run = fake_run(loaded.deck.name, model, **{**what, "error": error})
        if sink is not None:
            sink.begin([channel.name for channel in run.channels])
            sink.rows(run.table)
            sink.solved(run)
        return run


def fake_run(name, model, status="done", code=0, error=0.0, cpu=0.5, end=1.0):
    t = np.linspace(0.0, 1.0, 11)
    t = t[t <= end + 1e-9]
    values = np.cos(3.0 * t) + error
    return Run(
        name=name,
        model=model,
        method="gauss",
        status=status,
        reason="" if status == "done" else "the mass matrix of b1 became singular",
        t=t,
        channels=(Channel("b1.tip.x", "m", values), Channel("b1.tip.y", "m", np.sin(3.0 * t))),
        outline_t=t,
        outlines={"b1": np.zeros((len(t), 3, 2))},
        statistics={"cpu_s": {"build": 0.01, "solve": cpu}, "wall_s": {}, "steps": 7, "unknowns": 40},
        failure=None if status == "done" else {"time": 0.4, "item": "b1", "kind": "model"},
        exit_code=code,
    )


@pytest.fixture
def scene(monkeypatch, tmp_path):
    """A fake scene, and an empty current folder with the decks case.yaml, other.yaml and bad.yaml."""
    fake = FakeScene()
    monkeypatch.setitem(sys.modules, "hfsim.scene.loading", types.SimpleNamespace(load_deck=fake.load_deck))
    module = types.SimpleNamespace(simulate=fake.simulate, check=fake.check)
    monkeypatch.setitem(sys.modules, "hfsim.simulate", module)
    monkeypatch.setattr(hfsim.output.api, "pipeline", module)
    monkeypatch.setattr(hfsim.studies.compare.measurements, "simulate", fake.simulate)
    monkeypatch.setattr(hfsim.studies.compare.study, "simulate", fake.simulate)
    monkeypatch.setattr(hfsim.studies.compare.choice, "check", fake.check)
    monkeypatch.chdir(tmp_path)
    for name in ("case", "other", "bad"):
        Path(f"{name}.yaml").write_text(name)
    return fake


def files(folder):
    return {str(path.relative_to(folder)) for path in Path(folder).rglob("*") if path.is_file()}


# --- run -----------------------------------------------------------------------------------------


def test_run_writes_the_folder_and_prints_the_results(scene):
    result = call("run", "case.yaml", "--no-plots")
    assert result.exit_code == 0, result.output
    assert files("case.out") == {"history.csv", "summary.json", "resolved.yaml", "run.log"}
    for words in ("case: done", "exact; method gauss", "40 unknowns", "b1.tip.x", "case.out/"):
        assert words in result.stdout


def test_plots_come_unless_they_are_refused(scene):
    call("run", "case.yaml")
    assert "plots/path.png" in files("case.out")


def test_quiet_prints_nothing_at_all(scene):
    result = call("run", "case.yaml", "--no-plots", "-q")
    assert (result.exit_code, result.output) == (0, "")


def test_json_is_the_summary_one_object_a_line(scene):
    result = call("run", "case.yaml", "other.yaml", "--no-plots", "--json")
    summaries = [json.loads(line) for line in result.stdout.splitlines()]
    assert [s["name"] for s in summaries] == ["case", "other"]
    assert summaries[0] == json.loads(Path("case.out/summary.json").read_text())


def test_options_reach_the_deck_and_the_simulation(scene):
    result = call(
        "run", "case.yaml", "--model", "linear", "--set", "a.b=1", "--no-error-estimate", "--no-plots"
    )
    assert result.exit_code == 0
    assert scene.calls == [("case", "linear", False)]
    summary = json.loads(Path("case.out/summary.json").read_text())
    assert summary["overrides"] == ["a.b=1", "solve.model=linear"]


def test_a_finished_run_is_only_replaced_by_force(scene):
    assert call("run", "case.yaml", "--no-plots").exit_code == 0
    refused = call("run", "case.yaml", "--no-plots")
    assert refused.exit_code == 2
    assert "--force" in refused.stderr
    assert len(scene.calls) == 1
    assert call("run", "case.yaml", "--no-plots", "--force").exit_code == 0


@pytest.mark.parametrize(("status", "code"), [("failed", 3), ("limit", 5), ("interrupted", 130)])
def test_an_early_end_keeps_the_results_and_sets_the_exit_code(scene, status, code):
    scene.behaviour["case"] = {"status": status, "code": code, "end": 0.4}
    result = call("run", "case.yaml", "--no-plots", "-q")
    assert result.exit_code == code
    assert "mass matrix of b1" in result.stderr
    assert len(Path("case.out/history.csv").read_text().splitlines()) == 6
    assert json.loads(Path("case.out/summary.json").read_text())["status"] == status


def test_a_bad_deck_stops_all_before_anything_is_run(scene):
    result = call("run", "case.yaml", "bad.yaml", "missing.yaml")
    assert result.exit_code == 2
    assert scene.calls == []
    assert "bodies: is missing" in result.stderr
    assert "missing.yaml" in result.stderr
    assert "Traceback" not in result.output
    assert files(".") == {"case.yaml", "other.yaml", "bad.yaml"}


def test_a_deck_that_cannot_be_assembled_is_bad_too(scene):
    Path("other.yaml").write_text("unbuildable")
    for decks in (["other.yaml"], ["case.yaml", "other.yaml"]):
        assert call("run", *decks).exit_code == 2
    assert scene.calls == []
    assert not Path("case.out").exists()


def test_several_decks_all_run_and_the_gravest_exit_code_counts(scene):
    scene.behaviour["case"] = {"status": "failed", "code": 3, "end": 0.4}
    result = call("run", "case.yaml", "other.yaml", "-o", "all", "--no-plots")
    assert result.exit_code == 3
    assert {"case/summary.json", "other/summary.json"} <= files("all")


def test_an_internal_error_does_not_stop_the_other_decks(scene):
    scene.behaviour["case"] = {"raise": ZeroDivisionError("oh")}
    result = call("run", "case.yaml", "other.yaml", "--no-plots")
    assert result.exit_code == 1
    assert "internal error: ZeroDivisionError: oh" in result.stderr
    assert "Traceback" not in result.output
    assert Path("other.out/summary.json").exists()


def test_verbose_and_the_environment_show_the_traceback(scene, monkeypatch):
    scene.behaviour["case"] = {"raise": ZeroDivisionError("oh")}
    assert "Traceback" in call("run", "case.yaml", "-v").stderr
    monkeypatch.setenv("HFSIM_DEBUG", "1")
    assert "Traceback" in call("run", "case.yaml").stderr


def test_an_interruption_stops_the_batch(scene):
    scene.behaviour["case"] = {"status": "interrupted", "code": 130, "end": 0.4}
    assert call("run", "case.yaml", "other.yaml", "--no-plots").exit_code == 130
    assert [name for name, *_ in scene.calls] == ["case"]
    scene.behaviour["case"] = {"raise": KeyboardInterrupt()}
    assert call("run", "case.yaml", "--no-plots").exit_code == 130


def test_two_decks_cannot_share_a_folder(scene):
    Path("other.yaml").write_text("case")
    result = call("run", "case.yaml", "other.yaml")
    assert result.exit_code == 2
    assert "both write to case.out" in result.stderr


def test_a_shipped_case_is_found_by_its_name_and_hinted_at(scene, monkeypatch, tmp_path):
    (tmp_path / "shipped").mkdir()
    (tmp_path / "shipped/pendulum.yaml").write_text("pendulum")
    monkeypatch.setattr(hfsim.scene.shipped, "CASES", tmp_path / "shipped")
    result = call("run", "pendulum", "--no-plots")
    assert result.exit_code == 0
    assert "using the shipped case" in result.stderr
    assert "use 'pendulum'" in call("run", "pendulum.yaml").stderr
    assert "did you mean 'pendulum'?" in call("run", "pendulm").stderr
    assert "did you mean 'case.yaml'?" in call("run", "cas.yaml").stderr


# --- compare -------------------------------------------------------------------------------------


def test_compare_runs_each_model_and_names_the_cheapest_adequate_one(scene):
    scene.behaviour = {"linear": {"error": 0.5, "cpu": 0.1}, "lowOrder": {"error": 1e-4, "cpu": 0.2}}
    result = call("compare", "linear", "lowOrder", "--no-plots", "--repeats", "1")
    assert result.exit_code == 0, result.output
    assert [model for _, model, _ in scene.calls] == ["linear", "lowOrder", "exact"] * 2
    assert result.stdout.splitlines()[-1].startswith("verdict: lowOrder is the cheapest model within 1 %")
    assert {f"{m}/summary.json" for m in ("linear", "lowOrder", "exact")} <= files("case.compare")
    facts = json.loads(Path("case.compare/compare.json").read_text())
    assert facts["verdict"] == "lowOrder"
    assert len(Path("case.compare/compare.csv").read_text().splitlines()) == 7


def test_what_all_models_are_warned_of_is_told_once(scene):
    warned = dict.fromkeys(("linear", "lowOrder", "exact"), ("case.yaml:3: warning: that is a lot",))
    load = scene.load_deck

    def load_deck(path, overrides=()):
        loaded = load(path, overrides)
        loaded.warnings = warned[loaded.deck.solve.model]
        return loaded

    sys.modules["hfsim.scene.loading"].load_deck = load_deck
    assert call("compare", "linear", "lowOrder", "--no-plots").stderr.count("that is a lot") == 1


def test_compare_times_short_solves_repeatedly_and_long_ones_once(scene):
    scene.behaviour = {"exact": {"cpu": 5.0}}
    call("compare", "linear", "exact", "--no-plots", "--repeats", "4")
    assert [model for _, model, _ in scene.calls][4:] == ["linear"] * 3


def test_compare_judges_by_the_channels_named(scene):
    call("compare", "linear", "--no-plots", "--channels", "b1.tip.y")
    scales = json.loads(Path("case.compare/compare.json").read_text())["scales"]
    assert [scales[name]["judged"] for name in ("b1.tip.x", "b1.tip.y")] == [False, True]
    for wrong, words in (("b1.tip.z", "there is no channel"), ("constraint.position", "residuals")):
        refused = call("compare", "linear", "--force", "--channels", wrong)
        assert refused.exit_code == 2 and words in refused.stderr


def test_exact_makes_its_steps_in_body_frames_beside_ancf(scene):
    result = call("compare", "ancf", "exact", "--no-plots")
    overrides = json.loads(Path("case.compare/exact/summary.json").read_text())["overrides"]
    assert overrides == ["solve.model=exact", "solve.coordinates=frame"], result.output
    call("compare", "linear", "exact", "--no-plots", "--force")
    overrides = json.loads(Path("case.compare/exact/summary.json").read_text())["overrides"]
    assert overrides == ["solve.model=exact"]


def test_compare_reports_a_breakdown_as_a_result(scene):
    scene.behaviour = {"lowOrder": {"status": "failed", "code": 3, "end": 0.4}}
    result = call("compare", "lowOrder", "--no-plots")
    assert result.exit_code == 0
    assert "lowOrder broke down at 0.4 s: the mass matrix of b1 became singular" in result.stdout
    assert "verdict: exact, the reference: no other model stays within 1 %" in result.stdout


def test_compare_fails_with_its_reference(scene):
    scene.behaviour = {"exact": {"status": "failed", "code": 3, "end": 0.4}}
    result = call("compare", "linear", "--no-plots")
    assert result.exit_code == 3
    assert "verdict: none" in result.stdout


def test_only_a_required_model_that_misses_the_bound_gives_exit_code_4(scene):
    scene.behaviour = {"linear": {"error": 0.5}}
    common = ("compare", "linear", "ancf", "--no-plots", "--force", "--max-error", "0.02")
    assert call(*common).exit_code == 0
    assert call(*common, "--require", "ancf").exit_code == 0
    missed = call(*common, "--require", "linear")
    assert missed.exit_code == 4
    assert "linear was required" in missed.stderr
    assert call(*common, "--require", "lowOrder").exit_code == 2


def test_compare_protects_its_folder_and_refuses_bad_models(scene):
    assert call("compare", "linear", "--no-plots").exit_code == 0
    assert call("compare", "linear", "--no-plots").exit_code == 2
    count = len(scene.calls)
    assert call("compare", "auto", "-o", "new").exit_code == 2
    assert call("compare", "nonsense", "-o", "new").exit_code == 2
    assert (len(scene.calls), Path("new").exists()) == (count, False)


def test_compare_leaves_no_run_of_a_model_that_is_compared_no_more(scene):
    call("compare", "linear", "ancf")
    assert call("compare", "linear", "--no-plots").exit_code == 2 and Path("case.compare/ancf/plots").exists()
    Path("case.compare/lowOrder").mkdir()
    Path("case.compare/linear/notes.txt").write_text("mine")
    scene.behaviour = {"exact": {"raise": KeyboardInterrupt()}}
    assert call("compare", "lowOrder", "exact", "--force").exit_code == 130
    left = {name.split("/")[0] for name in files("case.compare")} - {"compare.json", "compare.csv"}
    assert left == {"lowOrder", "linear"} and files("case.compare/linear") == {"notes.txt"}
    assert not Path("case.compare/ancf").exists() and not Path("case.compare/exact").exists()


def test_another_command_replaces_a_comparison_with_the_runs_inside(scene):
    call("compare", "linear", "exact", "-o", "there")
    Path("there/linear/notes.txt").write_text("mine")
    Path("there/plots/own.png").write_bytes(b"mine")
    assert call("run", "case.yaml", "--no-plots", "-o", "there").exit_code == 2
    assert Path("there/exact/plots").exists(), "nothing goes before it may"
    assert call("run", "case.yaml", "--no-plots", "-o", "there", "--force").exit_code == 0
    run = {"history.csv", "resolved.yaml", "run.log", "summary.json"}
    assert files("there") == {*run, "linear/notes.txt", "plots/own.png"}
    assert not Path("there/exact").exists() and not Path("there/linear/plots").exists()


def test_compare_leaves_what_a_link_leads_to(scene):
    call("compare", "linear", "ancf", "--no-plots")
    moved = Path("case.compare/ancf").rename("elsewhere")
    Path("case.compare/ancf").symlink_to(moved.absolute())
    before = files("elsewhere")
    assert call("compare", "linear", "--force", "--no-plots").exit_code == 0
    assert before and files("elsewhere") == before


def test_compare_takes_the_shipped_scene_where_no_case_is(scene, monkeypatch, tmp_path):
    (tmp_path / "shipped").mkdir()
    (tmp_path / "shipped/two_beams.yaml").write_text("two_beams")
    monkeypatch.setattr(hfsim.scene.shipped, "CASES", tmp_path / "shipped")
    Path("case.yaml").unlink()
    result = call("compare", "linear", "--no-plots", "--json")
    assert json.loads(result.stdout)["name"] == "two_beams"
    assert result.stderr.count("using the shipped case") == 1


def test_compare_interrupted_keeps_what_there_is_and_makes_no_verdict(scene):
    scene.behaviour = {"exact": {"status": "interrupted", "code": 130, "end": 0.4}}
    assert call("compare", "linear", "exact", "--no-plots").exit_code == 130
    facts = json.loads(Path("case.compare/compare.json").read_text())
    assert (facts["status"], facts["verdict"]) == ("interrupted", None)
    ended = {name: model["status"] for name, model in facts["models"].items()}
    assert ended == {"linear": "done", "exact": "interrupted"}
    assert call("compare", "linear", "exact", "--no-plots").exit_code == 130, "what is not whole is replaced"


def test_compare_can_be_interrupted_while_it_repeats(scene):
    simulate = scene.simulate

    def interrupted_later(loaded, **options):
        run = simulate(loaded, **options)
        return run if len(scene.calls) < 3 else replace(run, status="interrupted", exit_code=130)

    hfsim.studies.compare.measurements.simulate = interrupted_later
    assert call("compare", "linear", "exact", "--no-plots").exit_code == 130
    assert len(scene.calls) == 3
    facts = json.loads(Path("case.compare/compare.json").read_text())
    assert facts["status"] == "interrupted" and facts["models"]["linear"]["worst"]["max_abs"] == 0.0


def interrupted(*_):
    raise KeyboardInterrupt


@pytest.mark.parametrize(("where", "code"), [("_draw", 130), ("add_extras", None)])
def test_compare_ends_with_the_model_whose_pictures_a_signal_cuts_off(scene, monkeypatch, where, code):
    module = hfsim.output.extras if where == "_draw" else hfsim.output.recording
    monkeypatch.setattr(module, where, interrupted)
    assert call("compare", "linear", "exact").exit_code == 130
    assert [model for _, model, _ in scene.calls] == ["linear"]
    facts = json.loads(Path("case.compare/compare.json").read_text())
    assert (facts["status"], facts["verdict"], list(facts["models"])) == ("interrupted", None, ["linear"])
    summary = json.loads(Path("case.compare/linear/summary.json").read_text())
    assert (summary["status"], summary["exit_code"]) == ("done", code)
    assert "what was to be done after it is missing" in summary["reason"]
    assert len(Path("case.compare/linear/history.csv").read_text().splitlines()) == 12


def test_a_run_that_was_interrupted_costs_no_time_for_pictures(scene):
    scene.behaviour = {"exact": {"status": "interrupted", "code": 130, "end": 0.4}}
    assert call("compare", "linear", "exact").exit_code == 130
    assert Path("case.compare/linear/plots").exists() and not Path("case.compare/exact/plots").exists()


# --- check ---------------------------------------------------------------------------------------


def test_check_tells_what_it_built_and_writes_nothing(scene):
    before = files(".")
    result = call("check", "case.yaml", "bad.yaml", "other.yaml")
    assert result.exit_code == 2
    assert result.stdout.splitlines() == [
        "case.yaml: ok: 2 beams, 1 rigid body, 3 joints, 40 unknowns, 6 multipliers",
        "other.yaml: ok: 2 beams, 1 rigid body, 3 joints, 40 unknowns, 6 multipliers",
    ]
    assert "bodies: is missing" in result.stderr
    assert (files("."), scene.calls) == (before, [])


def test_check_json_has_one_object_for_each_deck(scene):
    lines = [
        json.loads(line) for line in call("check", "case.yaml", "bad.yaml", "--json").stdout.splitlines()
    ]
    assert [line["ok"] for line in lines] == [True, False]
    assert lines[0]["unknowns"] == 40


# --- the program ---------------------------------------------------------------------------------


def test_every_command_exists_and_has_help(scene):
    for name in COMMANDS:
        result = call(name, "--help")
        assert result.exit_code == 0
        assert name in result.stdout


@pytest.mark.parametrize("arguments", [["fly"], ["run"], ["run", "case.yaml", "--nonsense"]])
def test_a_bad_command_line_gives_2(scene, arguments):
    assert call(*arguments).exit_code == 2


@pytest.mark.parametrize(
    "arguments",
    [
        ["compare", "linear", "--case", "case.yaml", "--max-error", "nan"],
        ["stability", "case.yaml", "--max-drift", "inf"],
    ],
)
def test_numbers_that_are_not_finite_are_refused(scene, arguments):
    """A comparison by a bound that is no number told that its reference had stopped."""
    done = call(*arguments)
    assert done.exit_code == 2 and "is not finite" in done.output


@pytest.mark.parametrize("moment", ["inf", "nan", "-1", "soon", "2 m"])
@pytest.mark.parametrize("command", ["modes", "static"])
def test_moments_that_are_no_time_are_refused(scene, command, moment):
    done = call(command, "case.yaml", "--at", moment)
    assert done.exit_code == 2 and f"'{moment}' is no time from 0 on" in done.output


def python(*arguments):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60, check=False)


def test_help_imports_nothing_heavy():
    result = python("-X", "importtime", "-m", "hfsim", "--help")
    assert result.returncode == 0
    assert "compare" in result.stdout
    imported = {line.split("|")[-1].strip().split(".")[0] for line in result.stderr.splitlines()}
    assert "click" in imported
    assert not imported & {"numpy", "pydantic", "scipy", "matplotlib", "yaml"}


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
@pytest.mark.parametrize("arguments", [["help", "keys"], ["--help"], ["--version"], ["check", "pendulum"]])
def test_a_full_standard_output_is_told_as_that(arguments):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "hfsim", *arguments]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=environment)
        silent = subprocess.run([*command[:3], "check", "nowhere"], stderr=full, env=environment)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "error: standard output takes no more: No space left on device"
    assert silent.returncode == 2


def test_a_reader_that_went_away_is_no_error():
    script = "from hfsim.output.talk import print_out\nfor _ in range(9999): print_out('x' * 99)"
    command = f'"{sys.executable}" -c "{script}" | head -n 1; echo ${{PIPESTATUS[0]}}'
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, env=environment, timeout=60, check=False
    )
    assert result.stdout.splitlines() == ["x" * 99, "0"]
    assert result.stderr == ""


class Stream:
    """A stream that remembers, on a terminal or not."""

    def __init__(self, terminal):
        self.terminal = terminal
        self.text = ""

    def isatty(self):
        return self.terminal

    def write(self, text):
        self.text += text

    def flush(self):
        pass


def run_clock(progress, clock, seconds):
    for second in range(seconds):
        clock[0] = float(second)
        progress(second / seconds)
    progress.close()


def test_progress_is_rare_off_a_terminal():
    clock, stream = [0.0], Stream(False)
    run_clock(Progress("case", stream, clock=lambda: clock[0]), clock, 35)
    assert stream.text.count("\n") == 3


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_is_silent_when_quiet(terminal):
    clock, stream = [0.0], Stream(terminal)
    run_clock(Progress("case", stream, True, clock=lambda: clock[0]), clock, 35)
    assert stream.text == ""


def test_progress_redraws_one_line_on_a_terminal_and_wipes_it():
    clock, stream = [0.0], Stream(True)
    run_clock(Progress("case", stream, clock=lambda: clock[0]), clock, 35)
    assert "\n" not in stream.text
    assert stream.text.endswith(" \r")
    assert "case:  46 %, 16 s, about 19 s to go" in stream.text


def test_progress_forecasts_from_the_pace_it_has_come_to():
    """The first tenth takes as long as the rest of the job; before there is a pace, nothing is forecast."""
    clock, stream = [0.0], Stream(True)
    progress = Progress("case", stream, clock=lambda: clock[0])
    told = []
    for tick in range(1, 400):
        clock[0] = 0.1 * tick
        progress(0.1 * clock[0] / 20.0 if clock[0] < 20.0 else 0.1 + 0.9 * (clock[0] - 20.0) / 20.0)
        told.append(stream.text.rpartition("\r")[2])
    assert not any("to go" in line for line in told[:20]) and "  0 %, 1 s" in told[9]
    seconds = {k: float(told[k].partition("about ")[2].split()[0]) for k in (299, 349, 389)}
    assert seconds == pytest.approx({299: 10.0, 349: 5.0, 389: 1.0}, rel=0.5)


TERMINATED = """
import os, signal
import hfsim.marching.runaway

def watch(self, t, q, v):
    if t > 0.05:
        os.kill(os.getpid(), signal.SIGTERM)

hfsim.marching.runaway.RateWatch.__call__ = watch
from hfsim.cli import main
main()
"""


def test_sigterm_ends_a_run_as_an_interruption_does(tmp_path):
    """What was computed is kept, and said to be unfinished."""
    command = ["run", "pendulum", "--no-plots", "-o", str(tmp_path / "o")]
    done = subprocess.run([sys.executable, "-c", TERMINATED, *command], capture_output=True, timeout=60)
    assert done.returncode == 143
    assert b"Traceback" not in done.stderr
    summary = json.loads((tmp_path / "o" / "summary.json").read_text())
    assert (summary["status"], summary["exit_code"]) == ("interrupted", 143)
    assert "SIGTERM" in summary["reason"]
    assert len((tmp_path / "o" / "history.csv").read_text().splitlines()) > 5


DRAWN = """
import os, signal
import hfsim.output.extras

def draw(*_):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    except KeyboardInterrupt:
        raise ImportError("initialization failed")  # as a library may take it

hfsim.output.extras._draw = draw
from hfsim.cli import main
main()
"""


def test_sigterm_while_pictures_are_drawn_ends_a_comparison(tmp_path):
    command = ["compare", "rigid", "exact", "--case", "pendulum", "-o", str(tmp_path / "o")]
    done = subprocess.run([sys.executable, "-c", DRAWN, *command], capture_output=True, timeout=60)
    assert done.returncode == 143
    assert json.loads((tmp_path / "o/compare.json").read_text())["status"] == "interrupted"
    assert json.loads((tmp_path / "o/rigid/summary.json").read_text())["exit_code"] == 143
    assert not (tmp_path / "o/exact").exists()


def test_studies_leave_out_models_that_a_scene_has_not(tmp_path, capsys):
    def told(path):
        load = hfsim.output.api.load(path).changed
        return usual_models(load, Talk(False, False, False).note), capsys.readouterr().err

    assert told(CASES / "two_beams.yaml") == (("linear", "lowOrder", "exact"), "")
    assert told(CASES / "governor.yaml") == (("exact",), "governor: without beams all models are one\n")
    text = (CASES / "two_beams.yaml").read_text()
    thick = tmp_path / "thick.yaml"
    thick.write_text(text.replace("type: beam,", "type: beam, element: continuum,"))
    models, notes = told(thick)
    assert models == ("linear", "exact")
    assert "not with lowOrder: a continuum element has no model lowOrder" in notes


def test_the_table_of_a_run_fits_and_tells_an_end_once(tmp_path, monkeypatch):
    """A run that a limit of steps ends; two streams make one screen."""
    monkeypatch.chdir(tmp_path)
    ended = call("run", "pendulum", "--no-plots", "--set", "solve.max_steps=3")
    assert ended.exit_code == 5
    screen = ended.stderr + ended.stdout
    assert screen.count("3 steps were made") == 1
    done = call("run", "blade", "--no-plots", "--set", "solve.duration=0.02", "--force")
    assert done.exit_code == 0
    assert max(map(len, (ended.stdout + done.stdout).split("\n"))) <= 110


def test_parts_of_the_time_add_up_and_nothing_empty_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = call("run", "pendulum", "--no-plots", "--set", "solve.duration=0.05")
    (told,) = re.findall(r"CPU time +([\d.]+) s \(([^)]*)\)", done.stdout)
    parts = [float(part.split()[-1]) for part in told[1].split(",")]
    assert sum(parts) == pytest.approx(float(told[0]), abs=5e-4 * (len(parts) + 3))
    assert "start up" in " ".join(told[1].split())
    assert "constraint drift" not in done.stdout, "it has no multipliers"
    assert "model           exact; method gauss" in done.stdout


class Broken:
    def flush(self):
        raise BrokenPipeError


@pytest.mark.parametrize(
    ("name", "found", "ended"),
    [
        ("threading.active_count", lambda: 1, [0]),
        ("threading.active_count", lambda: 2, []),
        ("sys.getprofile", lambda: print, []),
        ("sys.gettrace", lambda: print, []),
        ("sys.stdout", Broken(), []),
    ],
)
def test_a_process_ends_at_once_unless_watched_at_work_or_not_heard(monkeypatch, name, found, ended):
    calls = []
    with monkeypatch.context() as change:
        change.setattr("threading.active_count", lambda: 1)
        for one in ("sys.getprofile", "sys.gettrace", "atexit._run_exitfuncs"):
            change.setattr(one, lambda: None)
        change.setattr("os._exit", calls.append)
        change.setattr(name, found)
        _end()
    assert calls == ended
