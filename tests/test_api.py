"""hfsim from Python: decks in all their forms, results by name, errors as exceptions, nothing printed."""

import inspect
import json
import pickle
import sys
import types

import numpy as np
import pytest
from called import call

import hfsim

DECK = {
    "hfsim": 1,
    "gravity": [0.0, -9.81],
    "materials": {"rubber": {"density": 1100.0, "youngs_modulus": "5 MPa"}},
    "sections": {"strip": {"shape": "rectangle", "width": 0.05, "height": 0.01}},
    "bodies": {"arm": {"type": "beam", "material": "rubber", "section": "strip", "length": np.float64(1.0)}},
    "joints": {"pin": {"type": "revolute", "between": ["ground", "arm.root"]}},
    "solve": {"duration": 0.1},
    "output": {"interval": 0.02, "channels": ["arm.tip.x", "arm.angle", "energy.total"]},
}
QUICK = {"error_estimate": False, "diagnosis": False}


def test_a_run_gives_arrays_by_name_and_prints_nothing(capfd):
    run = hfsim.run(DECK, **QUICK)
    assert run.t == pytest.approx([0.0, 0.02, 0.04, 0.06, 0.08, 0.1])
    assert run["arm.tip.x"][0] == 1.0
    assert repr(run).startswith("<Run deck: done, exact, ")
    assert run.units == {"arm.tip.x": "m", "arm.angle": "rad", "energy.total": "J"}
    assert run.final["arm.tip.x"] == run["arm.tip.x"][-1] < 1.0
    assert run.extremes["arm.tip.x"] == [run["arm.tip.x"].min(), 1.0]
    with pytest.raises(KeyError, match=r"did you mean 'arm\.tip\.x'"):
        run["arm.tip.c"]
    assert capfd.readouterr() == ("", "")


def test_a_deck_that_another_reader_has_spoilt_is_told_what_its_key_was():
    """YAML 1.1 takes 'on' for true."""
    import yaml

    drag = yaml.safe_load("{type: drag, on: arm, density: 1.2, coefficient: 1.1, width: 0.02}")
    assert True in drag
    with pytest.raises(hfsim.DeckError, match=r"did you mean 'on'\? YAML 1\.1") as refusal:
        hfsim.check({**DECK, "loads": {"air": drag}})
    (problem,) = refusal.value.problems
    assert (problem.path, problem.message) == ("loads.air.true", "unknown key")
    spoilt = {"loads": {"air": {"type": "moment", "at": "arm.tip", "moment": 1.0, True: 1}}}
    with pytest.raises(hfsim.DeckError, match=r"unknown key \(known: "):
        hfsim.check({**DECK, **spoilt})


def test_a_run_is_a_dictionary_of_its_columns():
    run = hfsim.run(DECK, **QUICK)
    names = ["t", "arm.tip.x", "arm.angle", "energy.total"]
    assert list(run) == list(run.keys()) == list(run.columns) == list(dict(run)) == names
    assert "arm.tip.x" in run and "arm.tip.c" not in run and 0 not in run
    assert run["t"] is run.t
    with pytest.raises(KeyError, match="no channel '0': known: t, arm"):
        run[0]


@pytest.mark.parametrize("changes", [{}, {"solve.target_error": 0.5, "solve.budget": 30.0}])
def test_progress_ends_at_one(changes):
    told = []
    hfsim.run(DECK, changes, progress=told.append)
    assert told[-1] == 1.0 and min(told) >= 0.0


def test_shapes_and_states_over_time():
    run = hfsim.run(DECK, **QUICK)
    arm = run.outlines["arm"]
    assert arm.shape[::2] == (6, 2)
    assert arm[:, -1, 0] == pytest.approx(run["arm.tip.x"], abs=1e-12)
    (states,) = run.states
    assert states.q.shape == states.v.shape == (6, run.statistics["unknowns"])
    assert states.t.tolist() == run.t.tolist()


def test_decks_by_name_file_data_and_from_another(tmp_path):
    file = tmp_path / "case.yaml"
    file.write_text(json.dumps({**DECK, "bodies": {"arm": {**DECK["bodies"]["arm"], "length": 2}}}))
    for deck, length in ((DECK, 1.0), (file, 2.0), (str(file), 2.0), ("pendulum", 1.2)):
        loaded = hfsim.load(deck)
        assert isinstance(loaded, hfsim.Deck)
        (body,) = loaded.deck.bodies.values()
        assert body.length == length
    changed = hfsim.load(hfsim.load(file, {"solve.tolerance": 1e-3}), {"bodies.arm.length": np.float64(3.0)})
    assert (changed.deck.solve.tolerance, changed.deck.bodies["arm"].length) == (1e-3, 3.0)
    assert hfsim.run(changed, **QUICK)["arm.tip.x"][0] == 3.0


def test_bad_decks_tell_all_that_is_wrong():
    with pytest.raises(hfsim.DeckError) as error:
        hfsim.load(DECK, {"bodies.arm.lenght": 1.0, "solve.model": "exakt"})
    assert len(error.value.problems) == 2
    with pytest.raises(hfsim.HfsimError, match="there is no deck nix"):
        hfsim.run("nix.yaml")


def test_a_run_that_fails_is_an_exception_that_keeps_what_there_is():
    changes = {"solve.max_steps": 1, "solve.step": 0.02}
    with pytest.raises(hfsim.UnfinishedRunError, match="limit at t = 0") as error:
        hfsim.run(DECK, changes, **QUICK)
    assert len(error.value.run["arm.tip.x"]) == 2
    assert error.value.exit_code == 5
    assert hfsim.run(DECK, changes, check=False, **QUICK).status == "limit"


def interruption(share):
    """Return what interrupts a call once, beyond a share of its work."""
    waiting = [KeyboardInterrupt()]

    def told(done):
        if done > share and waiting:
            raise waiting.pop()

    return told


@pytest.mark.parametrize("check", [True, False])
@pytest.mark.parametrize("done", [False, True])
def test_an_interruption_ends_a_call_and_keeps_what_there_is(check, done, monkeypatch):
    """Also after the end of a run, while errors are estimated, and where runs that fail are no errors."""
    told = interruption(0.3)
    if done:
        monkeypatch.setattr("hfsim.trust.error.time_error", lambda *given: told(1.0))
    with pytest.raises(KeyboardInterrupt, match="interrupted") as stop:
        hfsim.run(DECK, progress=None if done else told, check=check, after=float(done))
    found = stop.value.found
    assert (found.status, found.exit_code) == ("done" if done else "interrupted", 130)
    assert len(found.t) == 6 if done else 0 < len(found.t) < 6
    assert isinstance(stop.value, hfsim.Interrupted)
    again = pickle.loads(pickle.dumps(hfsim.Interrupted("words", 3)))
    assert (str(again), again.found) == ("words", 3)


def test_what_a_study_has_found_before_an_interruption_is_kept():
    with pytest.raises(hfsim.Interrupted) as stop:
        hfsim.compare(DECK, ["linear", "exact"], repeats=1, progress=interruption(0.4))
    assert stop.value.found.interrupted and stop.value.found.runs


@pytest.mark.parametrize("elements", [2, 30])
def test_results_go_from_process_to_process(elements):
    """Those of large scenes too, whose matrices are sparse: with all that was solved for channels."""
    beam = {"type": "beam", "element": "cosserat", "material": "rubber", "section": "rod", "length": 1.0}
    deck = DECK | {
        "gravity": [0.0, 0.0, -9.81],
        "sections": {"rod": {"shape": "circle", "diameter": 0.01}},
        "bodies": {"b": beam | {"elements": elements}},
        "joints": {"root": {"type": "fixed", "between": ["ground", "b.root"]}},
        "solve": {"duration": 0.01, "tolerance": 1e-3},
        "output": {"interval": 0.001, "channels": ["b.tip.z", "root.force_z", "b.root.bending_moment_y"]},
    }
    run = hfsim.run(deck, **QUICK)
    again = pickle.loads(pickle.dumps(run))
    for name in run.units:
        assert np.array_equal(again[name], run[name])


def test_results_go_to_a_folder_as_from_the_command_line(tmp_path):


    run = hfsim.run("pendulum", {"solve.duration": 0.05}, output=tmp_path / "a", plots=False, **QUICK)
    options = ["--set", "solve.duration=0.05", "--no-plots", "--no-error-estimate", "-q"]
    call("run", "pendulum", "-o", str(tmp_path / "b"), *options)
    assert (tmp_path / "a/history.csv").read_bytes() == (tmp_path / "b/history.csv").read_bytes()
    summary = json.loads((tmp_path / "a/summary.json").read_text())
    assert summary["final"] == run.final
    assert summary["deck_sha256"] == json.loads((tmp_path / "b/summary.json").read_text())["deck_sha256"]
    with pytest.raises(hfsim.HfsimError, match="finished run"):
        hfsim.run("pendulum", output=tmp_path / "a", **QUICK)


def test_a_stated_target_error_is_reached():
    run = hfsim.run(DECK, {"solve.target_error": 0.05, "bodies.arm.elements": "auto"}, diagnosis=False)
    assert run.statistics["refinement"]["status"] == "reached"


def test_a_dataframe_where_pandas_is_there(monkeypatch):
    made = types.SimpleNamespace(
        DataFrame=lambda columns, index: (columns, index), Index=lambda t, name: (name, t)
    )
    monkeypatch.setitem(sys.modules, "pandas", made)
    run = hfsim.run(DECK, **QUICK)
    columns, index = run.to_dataframe()
    assert list(columns) == list(run.units)
    assert index[0] == "t"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError):
        run.to_dataframe()


def test_models_are_compared_and_nothing_is_printed(capfd):
    shares = []
    found = hfsim.compare(DECK, ["linear"], {"solve.duration": 0.4}, repeats=2, progress=shares.append)
    assert isinstance(found, hfsim.Comparison)
    assert list(found.runs) == [model.model for model in found.models] == ["linear", "exact"]
    linear = found.result("linear")
    apart = np.abs(found.runs["linear"]["arm.tip.x"] - found.runs["exact"]["arm.tip.x"]).max()
    assert linear.difference("arm.tip.x").max_abs == apart > 0.0
    assert not linear.adequate
    assert linear.repeats == 2
    assert linear.solve_cpu > 0.0
    assert found.verdict == "exact" in found.sentence
    assert shares == sorted(shares)
    assert shares[-1] > 0.9
    assert capfd.readouterr() == ("", "")


def test_the_command_finds_what_python_finds(tmp_path):


    found = hfsim.compare("pendulum", None, {"solve.duration": 0.3}, channels=["b1.tip.x"], repeats=1)
    options = ["--set", "solve.duration=0.3", "--channels", "b1.tip.x", "--no-plots", "-q", "--repeats", "1"]
    result = call("compare", "--case", "pendulum", "-o", str(tmp_path / "c"), *options)
    assert result.exit_code == 0
    facts = json.loads((tmp_path / "c/compare.json").read_text())
    assert list(facts["models"]) == list(found.runs) == ["linear", "lowOrder", "exact"]
    for name, model in facts["models"].items():
        assert model["worst"]["max_abs"] == found.result(name).worst.max_abs
    assert "runs" not in facts


def test_a_reference_that_fails_makes_no_verdict():
    found = hfsim.compare(DECK, [], {"solve.max_steps": 1, "solve.step": 0.02}, repeats=1)
    assert (found.verdict, found.status) == (None, "limit")


@pytest.mark.parametrize(
    ("models", "options", "why"),
    [
        (["auto"], {}, "no model of its own"),
        (["exact"], {"channels": ["arm.tip.xx"]}, r"did you mean 'arm\.tip\.x'"),
        (["exakt"], {}, "exakt"),
    ],
)
def test_what_cannot_be_compared_is_refused(models, options, why):
    with pytest.raises(hfsim.HfsimError, match=why):
        hfsim.compare(DECK, models, **options)


@pytest.mark.parametrize(
    ("study", "options", "why"),
    [
        (hfsim.modes, {"about": "equilibrum"}, "did you mean 'equilibrium'"),
        (hfsim.modes, {"about": "rest"}, "known: start, equilibrium, steady"),
        (hfsim.modes, {"about": "steady", "at": 0.1}, "two states"),
        (hfsim.modes, {"at": -0.5}, "begins at 0 s"),
        (hfsim.modes, {"at": float("nan")}, "begins at 0 s"),
        (hfsim.modes, {"count": -1}, "count is -1"),
        (hfsim.static, {"at": -1.0}, "begins at 0 s"),
        (hfsim.static, {"buckling": -1}, "buckling is -1"),
        (hfsim.static, {"plots": "jpg"}, "there are png, svg, pdf"),
        (hfsim.run, {"plots": "jpg"}, "there are png, svg, pdf"),
        (hfsim.run, {"after": -1.0}, "no less than 0 s"),
        (hfsim.run, {"after": float("nan")}, "no less than 0 s"),
        (hfsim.run, {"output": ""}, "output is empty"),
        (hfsim.static, {"output": ""}, "output is empty"),
        (hfsim.compare, {"max_error": float("nan")}, "positive number"),
        (hfsim.compare, {"max_error": -0.01}, "positive number"),
        (hfsim.compare, {"repeats": 0}, "timed once at least"),
        (hfsim.compare, {"repeats": 1.5}, r"repeats is 1\.5: it is a whole number"),
        (hfsim.compare, {"max_error": "1 %"}, "max_error is of type str: it is a number"),
        (hfsim.run, {"after": "1 s"}, "after is of type str"),
        (hfsim.static, {"at": "100 ms"}, "at is of type str"),
        (hfsim.static, {"buckling": "x"}, "buckling is of type str"),
        (hfsim.static, {"vary": ["gravity"]}, "vary goes with path and buckling only"),
        (hfsim.modes, {"at": "x"}, "at is of type str"),
        (hfsim.modes, {"count": 1.5}, r"count is 1\.5: it is a whole number"),
        (hfsim.bench, {"repeats": "a"}, "repeats is of type str"),
        (hfsim.campbell, {"rates": ["x"]}, "rates: 'x' is no number"),
        (hfsim.sweep, {"vary": {"gravity.1": [1.0]}, "sample": "x"}, "sample is of type str"),
        (hfsim.sweep, {"vary": {"gravity.1": [1.0]}, "sample": 2, "seed": -1}, "seed: error: must not be"),
        (hfsim.sweep, {"vary": {"gravity.1": [1.0]}, "seed": 2}, "seed: error: only samples have one"),
        (hfsim.stability, {"ending": "wrong"}, "ending goes with bisect only"),
        (hfsim.sweep, {"vary": {"gravity.1": [1.0]}, "collect": ["max(hub.x)"], "jobs": -1}, "jobs is -1"),
    ],
)
def test_arguments_that_cannot_be_meant_are_refused(study, options, why):
    with pytest.raises(hfsim.HfsimError, match=why):
        study(DECK, **options)


def flags_and_callbacks():
    """Yield each public function with each of its arguments that is true or false, or is called."""
    wrong = {"bool": "no", "bool | str": 3, "Progress | None": 3}
    for name in (one for one in sorted(hfsim.__all__) if inspect.isfunction(getattr(hfsim, one))):
        for argument in inspect.signature(getattr(hfsim, name)).parameters.values():
            if argument.annotation in wrong:
                yield name, argument.name, wrong[argument.annotation]


@pytest.mark.parametrize(("name", "argument", "value"), [*flags_and_callbacks()])
def test_what_is_no_flag_or_cannot_be_called_is_refused_by_its_name(tmp_path, name, argument, value):
    turning, vary = {"initial": {"arm": {"angular_velocity": 1.0}}}, {"gravity.1": [1.0]}
    own = {"separation": (), "campbell": (DECK, [1.0], turning), "sweep": (DECK, vary)}
    given = {**own, "sensitivity": (DECK, vary, ["max(arm.angle)"]), "verify": ()}.get(name, (DECK,))
    folder = {"output": tmp_path / "out"} if argument == "resume" else {}
    with pytest.raises(hfsim.HfsimError, match=f"^{argument} is {value!r}: it is (True or|a function)"):
        getattr(hfsim, name)(*given, **folder, **{argument: value})


@pytest.mark.parametrize("value", [0, 1, np.True_, np.bool_(False)])
def test_numbers_of_flags_are_flags(value):
    assert hfsim.run(DECK, {"solve.duration": 0.02}, check=value, **QUICK).status == "done"


def test_a_campbell_diagram_of_no_modes_is_refused():
    with pytest.raises(hfsim.HfsimError, match="count is 0"):
        hfsim.campbell(DECK, [1.0], {"initial": {"arm": {"angular_velocity": 1.0}}}, count=0)


@pytest.mark.parametrize("rates", [[], [1.0, float("nan")]])
def test_a_campbell_diagram_at_no_rate_is_refused(rates):
    with pytest.raises(hfsim.HfsimError, match="rates are"):
        hfsim.campbell(DECK, rates, {"initial": {"arm": {"angular_velocity": 1.0}}})


def test_modes_of_a_campbell_diagram_are_numbered_from_one():
    turning = {"gravity": [0.0, 0.0], "initial": {"arm": {"angular_velocity": 1.0}}}
    found = hfsim.campbell(DECK, [1.0], turning, count=2)
    for number in (0, 3):
        with pytest.raises(hfsim.HfsimError, match=f"no mode {number}"):
            found.frequencies(number)


def test_check_tells_sizes():
    assert hfsim.check(DECK)["bodies"] == {"beam": 1}


def test_unknown_names_are_no_attributes():
    with pytest.raises(AttributeError, match="hfsim"):
        hfsim.nothing  # noqa: B018


def test_what_comes_back_is_told_in_a_line():
    deck = hfsim.load("pendulum", {"solve.duration": 0.02})
    assert repr(deck) == "<Deck pendulum: bodies b1; model exact>"
    found = hfsim.compare(deck, ["linear"], repeats=1)
    assert repr(found) == f"<Comparison pendulum: linear, exact; verdict {found.verdict}>"
    assert repr(hfsim.verify("heavy_top")).startswith("<Verification heavy_top: ")
    assert "1 time," in repr(hfsim.static(deck))


def test_names_are_listed_for_who_completes_them():
    assert set(hfsim.__all__) <= set(dir(hfsim))


@pytest.mark.parametrize(
    ("more", "told"), [({"changes": {"solve.duraton": 1}}, "changes"), ({"model": "x"}, "model")]
)
def test_a_bad_argument_is_told_by_its_name(more, told):
    with pytest.raises(hfsim.DeckError) as refused:
        hfsim.run("pendulum", **more)
    assert str(refused.value).startswith(f"{told}: error: solve.")
