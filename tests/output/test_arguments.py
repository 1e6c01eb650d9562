# ruff: noqa: E501
"""Arguments of calls from Python: what is no deck, no map, no name is told by the name of its argument."""

from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from wheel import WHEEL

import hfsim

SHORT = {"solve.duration": 0.02}
VARY = {"bodies.hub.mass": [1.0, 2.0]}


@pytest.fixture
def deck(tmp_path):
    file = tmp_path / "wheel.yaml"
    file.write_text(WHEEL)
    return file


@pytest.mark.parametrize("study", [hfsim.load, hfsim.run, hfsim.check, hfsim.static, hfsim.modes, hfsim.verify])
@pytest.mark.parametrize(("wrong", "told"), [(3, "type int"), (None, "None"), (b"wheel", "type bytes")])
def test_what_is_no_deck_is_told_with_what_may_be_given(study, wrong, told):
    with pytest.raises(hfsim.HfsimError, match=rf"^deck is (of )?{told}: give a file, the name of a shipped"):
        study(wrong)


def test_a_list_is_no_deck():
    with pytest.raises(hfsim.HfsimError, match=r"^deck is of type list: give a file"):
        hfsim.run(["pendulum"])


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ("solve.duration=1", "changes is of type str: it maps entries to values"),
        ([("solve.duration", 1.0)], "changes is of type list"),
        ({"solve.duration": {1.0}}, "changes: solve.duration is of type set: a deck has numbers"),
        ({"bodies.hub": {"mass": 1j}}, "changes: bodies.hub is of type complex"),
    ],
)
def test_changes_that_are_none_are_told(changes, told, deck):
    with pytest.raises(hfsim.HfsimError) as error:
        hfsim.run(deck, changes)
    assert str(error.value).startswith(told)


CYCLE: list[object] = []
CYCLE.append(CYCLE)


@pytest.mark.parametrize("value", [CYCLE, {(1, 2): 3.0}, np.clongdouble(1.0), Decimal("0.05"), b"0.05", Path("a")])
def test_changes_that_are_no_data_are_told(value, deck):
    with pytest.raises(hfsim.HfsimError, match=r"^changes: solve\.duration "):
        hfsim.load(deck, {"solve.duration": value})


@pytest.mark.parametrize(
    "value",
    [*(kind(0.5) for kind in (np.longdouble, np.float16, np.float32, np.array)), np.array(np.longdouble(0.5)), Fraction(1, 2)],
)
def test_numbers_of_any_kind_are_read(value, deck):
    assert hfsim.load(deck, {"solve.duration": value}).deck.solve.duration == 0.5
    vary = hfsim.sweep(deck, {"bodies.hub.mass": [value]}, jobs=1)
    assert vary["bodies.hub.mass"].tolist() == [0.5]


def test_entries_that_decks_cannot_have_are_told():
    with pytest.raises(hfsim.HfsimError, match=r"^an entry of deck is of type PosixPath"):
        hfsim.load({"hfsim": 1, "include": Path("other.yaml")})


@pytest.mark.parametrize(
    ("study", "options", "told"),
    [
        (hfsim.run, {"force": True}, "force=True"),
        (hfsim.static, {"force": True}, "force=True"),
        (hfsim.sweep, {"vary": VARY, "resume": True}, "resume=True"),
        (hfsim.sweep, {"vary": VARY, "force": True}, "force=True"),
        (hfsim.sweep, {"vary": VARY, "keep": "folders"}, "keep='folders'"),
        (hfsim.sensitivity, {"vary": ["bodies.hub.mass"], "collect": ["max(hub.x)"], "resume": True}, "resume"),
    ],
)
def test_what_is_said_of_a_folder_needs_one(study, options, told, deck):
    with pytest.raises(hfsim.HfsimError, match=rf"^{told}.* is of results in a folder: name it, output="):
        study(deck, **options)


def test_a_text_is_one_name(deck):
    found = hfsim.sweep(deck, VARY, "final(hub.angle)", SHORT, error_estimate=False, jobs=1)
    assert found.collected == ("final(hub.angle)",)
    assert list(hfsim.compare(deck, "rigid", SHORT, reference="rigid", channels="hub.angle", repeats=1).runs) == ["rigid"]
    with pytest.raises(hfsim.HfsimError, match=r"^there is no model 'exakt' "):
        hfsim.compare(deck, "exakt")
    with pytest.raises(hfsim.HfsimError, match="models is of type int"):
        hfsim.compare(deck, 3)
    with pytest.raises(hfsim.HfsimError, match=r"collect has an entry of type int"):
        hfsim.sweep(deck, VARY, [3])


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"vary": {"bodies.hub.mas": [1.0]}}, "vary: error: bodies.hub.mas: unknown key"),
        ({"vary": {"bodies.hub.mass": []}}, "vary: error: bodies.hub.mass: no values are said (write lin(first"),
        ({"vary": {"bodies.hub.mass": "normal(1, 0.1)"}}, "vary: error: bodies.hub.mass: normal(1, 0.1) is random"),
        ({"vary": {"bodies.hub.mass": [-1.0]}}, "vary: error: bodies.hub.mass: must be greater than 0"),
        ({"vary": {"bodies.hub.mass": [float("nan")]}}, "vary: error: bodies.hub.mass: 'NaN': values are finite"),
        ({}, "vary: error: nothing is varied"),
        ({"vary": ["bodies.hub.mass"]}, "vary is of type list: it maps entries to values"),
        ({"vary": VARY, "collect": ["max(hub.q)"]}, "collect: error: max(hub.q)"),
        ({"vary": VARY, "sample": 0}, "sample: error: "),
        ({"vary": VARY, "sample": 2, "sampler": "x"}, "sampler: error: "),
        ({"vary": VARY, "table": "runs.csv"}, "table: error: is all: nothing is varied"),
        ({"vary": VARY, "keep": "folder"}, "keep is 'folder': did you mean 'folders'?"),
        ({"vary": VARY, "limit": -1.0}, "limit: -1.0 is no positive number"),
    ],
)
def test_what_is_wrong_with_a_sweep_is_told_by_its_argument(options, told, deck):
    with pytest.raises(hfsim.HfsimError) as error:
        hfsim.sweep(deck, **options)
    assert str(error.value).startswith(told)
    assert "--" not in str(error.value)


@pytest.mark.parametrize(
    ("vary", "collect", "told"),
    [
        ([], ["max(hub.x)"], "vary: error: nothing is varied"),
        (["bodies.hub.mass"], [], "collect: error: nothing is collected"),
        (["solve.model"], ["max(hub.x)"], "vary: error: solve.model: the deck has no number there"),
        (["bodies.hub.mass"], ["frequency(1)"], "collect: error: frequency(1): derivatives are of numbers of runs"),
        ({"bodies.hub.mass": "1 m"}, ["max(hub.x)"], "vary: error: bodies.hub.mass: '1 m' is not one number in kg"),
        ({"bodies.hub.mass": -1.0}, ["max(hub.x)"], "vary: error: bodies.hub.mass: must be greater than 0"),
    ],
)
def test_what_is_wrong_with_derivatives_is_told_by_its_argument(vary, collect, told, deck):
    with pytest.raises(hfsim.HfsimError) as error:
        hfsim.sensitivity(deck, vary, collect)
    assert str(error.value).startswith(told)
    assert "--" not in str(error.value)


def test_values_of_all_kinds_are_varied(deck):
    quick = {"error_estimate": False, "jobs": 1}
    found = hfsim.sweep(deck, {"solve.keep_all": [True, False]}, ["final(hub.angle)"], SHORT, **quick)
    assert found["status"].tolist() == ["done", "done"]
    found = hfsim.sweep(deck, {"gravity": [[0.0, -1.0]]}, ["final(hub.angle)"], SHORT, **quick)
    assert found["status"].tolist() == ["done"]
    masses = hfsim.sweep(deck, {"bodies.hub.mass": (m for m in np.float32([1, 2]))}, "final(hub.angle)", SHORT, **quick)
    assert masses["bodies.hub.mass"].tolist() == [1.0, 2.0]


def test_pictures_of_a_sweep_have_the_format_asked_for(deck, tmp_path):
    hfsim.sweep(deck, VARY, "final(hub.angle)", SHORT, error_estimate=False, jobs=1, output=tmp_path / "s", plots="svg")
    assert {file.suffix for file in (tmp_path / "s/plots").iterdir()} == {".svg"}


def test_what_can_be_done_about_a_folder_is_said_by_arguments(deck, tmp_path):
    quick = {"error_estimate": False, "plots": False}
    sweep = {"vary": VARY, "collect": "final(hub.angle)", "changes": SHORT, "jobs": 1, **quick, "output": tmp_path / "s"}
    hfsim.sweep(deck, **sweep)
    with pytest.raises(hfsim.HfsimError, match=r"sweep: resume=True does what is missing of it, force=True replaces it"):
        hfsim.sweep(deck, **sweep)
    with pytest.raises(hfsim.HfsimError, match="resume and force are one or the other"):
        hfsim.sweep(deck, **sweep, resume=True, force=True)
    with pytest.raises(hfsim.HfsimError, match="use force=True without resume=True to begin anew"):
        hfsim.sweep(deck, **{**sweep, "vary": {"bodies.hub.mass": [1.0, 3.0]}}, resume=True)
    assert hfsim.sweep(deck, **sweep, resume=True)["status"].tolist() == ["done", "done"]
    hfsim.run(deck, SHORT, **quick, output=tmp_path / "r")
    with pytest.raises(hfsim.HfsimError, match="finished run; use force=True to replace it, or another output to go"):
        hfsim.run(deck, SHORT, **quick, output=tmp_path / "r")
    with pytest.raises(hfsim.HfsimError, match="finished run; use force=True"):
        hfsim.static(deck, output=tmp_path / "r")
    with pytest.raises(hfsim.HfsimError, match="name a folder as output"):
        hfsim.run(deck, SHORT, **quick, output="-")
    steps = {"step": [1e-2], "methods": "gauss", "models": "exact", "jobs": 1, "plots": False, "output": tmp_path / "m"}
    hfsim.stability(deck, None, SHORT, **steps)
    with pytest.raises(hfsim.HfsimError, match="already holds a study; use force=True to replace it, or another output"):
        hfsim.stability(deck, None, SHORT, **steps)
    assert hfsim.stability(deck, None, SHORT, **steps, force=True).status == "done"
