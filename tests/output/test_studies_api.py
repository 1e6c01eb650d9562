# ruff: noqa: E501
"""Studies from Python: maps of stability, longest steps, error against run time; as the commands have them."""

import csv
import json

import numpy as np
import pytest
from called import call
from wheel import WHEEL

import hfsim

SHORT = {"solve.duration": 0.1}
SET = ("--set", "solve.duration=0.1")
STIFF = "springs.coil.stiffness"


@pytest.fixture
def deck(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "wheel.yaml"
    file.write_text(WHEEL)
    return file


def rows(file):
    with file.open() as text:
        return list(csv.DictReader(text))


def test_a_map_from_python_is_that_of_the_command(deck, tmp_path, capfd):
    told = []
    steps = {"methods": ["gauss", "explicit"], "step": [1e-3, 0.1], "jobs": 1}
    found = hfsim.stability(
        deck, {STIFF: np.array([10.0, 1000.0])}, SHORT, **steps, output=tmp_path / "p", plots=False,
        progress=told.append,
    )  # fmt: skip
    assert capfd.readouterr() == ("", "")
    assert isinstance(found, hfsim.StabilityMap)
    assert repr(found).startswith(f"<StabilityMap wheel: done, {STIFF} (2) x step (2); 8 points: ")
    assert max(told) == 1.0
    options = ("--vary", f"{STIFF}=10,1000", "--step", "1e-3,0.1", "--methods", "gauss,explicit", "--jobs", "1")
    assert call("stability", "wheel.yaml", *options, *SET, "-o", "c", "--no-plots", "-q").exit_code == 0
    mine, theirs = (rows(tmp_path / folder / "stability.csv") for folder in "pc")
    assert list(mine[0]) == list(theirs[0]) == list(found.columns)
    for name in (STIFF, "step", "model", "method", "class", "time_error", "overrides"):
        assert [row[name] for row in mine] == [row[name] for row in theirs]
    assert found["class"].tolist() == [row["class"] for row in mine]
    assert found["time_error"].tolist() == [float(row["time_error"]) for row in mine]
    assert found.grid("exact", "explicit").tolist() == [["accurate", "accurate"], ["accurate", "wrong"]]
    assert found.grid("exact", "explicit", "time_error")[1, 1] == found["time_error"].max() > 0.01
    with pytest.raises(KeyError, match="no exact with gear; there are exact with gauss"):
        found.grid("exact", "gear")
    with pytest.raises(KeyError, match="did you mean 'time_error'"):
        found["time_eror"]


def test_where_a_class_ends_is_located(deck, tmp_path):
    stiff = {**SHORT, STIFF: 1000.0}
    found = hfsim.stability(
        deck, None, stiff, step="log(1e-3, 0.1, 2)", methods="explicit", models="exact", bisect=0.2, jobs=1
    )
    (edge,) = found.boundaries
    assert 1e-3 < edge.below < edge.above <= 0.1 and edge.width <= 0.2
    assert not list(tmp_path.glob("wheel.*/"))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"methods": "gaus"}, "there is no method 'gaus' (did you mean 'gauss'?)"),
        ({"models": ["exakt"]}, "there is no model 'exakt'"),
        ({"step": [-1.0]}, "step: '-1': values of step are positive"),
        ({"scale_speed": ["x"]}, "scale_speed: 'x': values of speed"),
        ({"vary": {STIFF: "lin(1, 2)"}}, f"vary: {STIFF}: 'lin(1, 2)': lin takes 3 numbers"),
        ({"vary": {"springs.coil.stifness": [1.0]}}, "vary: error: springs.coil.stifness: unknown key"),
        ({"vary": {"a": [1.0]}, "step": [1.0], "elements": [2]}, "3 axes; a map has one or two"),
        ({"bisect": 0.01}, "bisect needs one axis"),
        ({"ending": "x"}, "ending is 'x': known: accurate"),
        ({"budget": -1.0}, "budget: -1.0 is no positive number"),
        ({"max_error": "1 %"}, "max_error: 1 % is no positive number"),
        ({"jobs": -1}, "jobs is -1"),
        ({"force": True}, "force=True is of results in a folder"),
    ],
)
def test_what_no_map_can_be_of_is_told_by_its_argument(options, told, deck):
    with pytest.raises(hfsim.HfsimError) as error:
        hfsim.stability(deck, **options)
    assert str(error.value).startswith(told)


@pytest.mark.slow
def test_longest_steps_from_python(deck, tmp_path):
    (found,) = hfsim.limits(deck, methods=["explicit"], jobs=1, output=tmp_path / "l")
    assert repr(found) == "<Limits wheel, exact: explicit>"
    assert found["longest"][0] == pytest.approx(found["predicted"][0], rel=0.02)
    facts = json.loads((tmp_path / "l/stability.json").read_text())
    assert facts["results"][0]["limits"][0]["longest"] == found["longest"][0]


def test_a_bench_from_python_is_that_of_the_command(deck, tmp_path, capfd):
    told = []
    found = hfsim.bench(
        deck, SHORT, methods=["gauss", "radau"], tolerances=(1e-3, 1e-5), repeats=1, output="p", plots=False,
        progress=told.append,
    )  # fmt: skip
    assert capfd.readouterr() == ("", "")
    assert isinstance(found, hfsim.Bench) and found.status == "done" and told
    assert repr(found).startswith("<Bench wheel: done, 4 of 4 points; for 1 %: ")
    assert found["method"].tolist() == ["gauss", "gauss", "radau", "radau"]
    assert np.isnan(found["step"]).all() and (found["cpu"] > 0.0).all()
    options = ("--methods", "gauss,radau", "--tolerances", "1e-3,1e-5", "--repeats", "1")
    assert call("bench", "wheel.yaml", *options, *SET, "-o", "c", "--no-plots", "-q").exit_code == 0
    mine, theirs = (json.loads((tmp_path / folder / "bench.json").read_text()) for folder in "pc")
    assert list(mine) == list(theirs)
    assert [point["error"] for point in mine["points"]] == found["error"].tolist()
    assert [point["error"] for point in theirs["points"]] == found["error"].tolist()


def test_a_bench_that_is_written_nowhere(deck, tmp_path):
    hfsim.bench(deck, SHORT, methods="gauss", tolerances=1e-3, repeats=1)
    assert [file.name for file in tmp_path.iterdir()] == ["wheel.yaml"]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"methods": "gaus"}, "there is no method 'gaus'"),
        ({"tolerances": [1e-3], "steps": [1e-2]}, "tolerances or steps are varied, not both"),
        ({"tolerances": [1.0]}, "a tolerance above 0.1 says nothing"),
        ({"tolerances": "1e-3"}, "tolerances: '1e-3' is no positive number"),
        ({"steps": [10.0]}, "a step is longer than the run"),
        ({"elements": [1.5]}, "elements: 1.5 is no whole number above 0"),
        ({"degrees": [2]}, "degrees go from 3 to 12"),
        ({"repeats": 0}, "repeats is 0"),
        ({"budget": 0.0}, "budget: 0.0 is no positive number"),
        ({"force": True}, "force=True is of results in a folder"),
    ],
)
def test_what_cannot_be_measured_is_told_by_its_argument(options, told, deck):
    with pytest.raises(hfsim.HfsimError) as error:
        hfsim.bench(deck, **options)
    assert str(error.value).startswith(told)


def test_forms_of_the_elastic_force_from_python(tmp_path):
    found = hfsim.separation(elements=[1], element="cable", states=1, repeats=1, output=tmp_path / "s", plots=False)
    assert repr(found).startswith("<SeparationBench: done, 1 cells; separated: ")
    assert found["form"][0] == "direct" and found["run_ratio"][0] == 1.0
    assert len(rows(tmp_path / "s/bench.csv")) == len(found["form"])
    with pytest.raises(hfsim.HfsimError, match="no element 'cabel'"):
        hfsim.separation(element="cabel")
