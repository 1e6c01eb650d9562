"""`hfsim check` tells what `hfsim sweep` would refuse of a deck's own sweep, at its place in the deck."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from wheel import WHEEL

import hfsim
from hfsim.cli import app


@pytest.fixture
def deck(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(**said):
        Path("tuned.yaml").write_text(f"{WHEEL}\nsweep: {json.dumps(said)}\n")
        return "tuned.yaml"

    return write


def call(*arguments):
    return CliRunner().invoke(app, arguments)


REFUSED = {
    "a key": ({"vary": {"springs.coil.stifness": [1, 2]}}, "unknown key (did you mean 'stiffness'?)"),
    "bounds": ({"vary": {"springs.coil.damping": [-1, -2]}}, "must be at least 0"),
    "units": ({"vary": {"springs.coil.damping": ["1 kg", "2 cm"]}}, "is a unit of mass"),
    "no table": ({"runs": "gone.csv"}, "cannot be read"),
    "a table of unknown keys": ({"runs": "runs.csv"}, "unknown key"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_check_refuses_what_sweep_would(deck, what):
    said, why = REFUSED[what]
    Path("runs.csv").write_text("springs.coil.stifness\n1\n2\n")
    checked, swept = call("check", deck(**said)), call("sweep", deck(**said))
    assert checked.exit_code == swept.exit_code == 2
    assert checked.stderr == swept.stderr and why in checked.stderr
    assert "error: sweep." in checked.stderr and "--" not in checked.stderr
    assert checked.stderr.startswith("tuned.yaml:")
    assert not Path("tuned.sweep").exists()
    with pytest.raises(hfsim.DeckError, match="sweep"):
        hfsim.check("tuned.yaml")


def test_all_that_is_wrong_is_told_at_once(deck):
    said = {"vary": {"springs.coil.stifness": [1, 2], "springs.coil.damping": [-1]}}
    checked = call("check", deck(**said))
    assert "2 errors" in checked.stderr
    assert checked.stderr.count("tuned.yaml:") == 2


def test_values_that_alone_are_refused_are_told_and_sound_sweeps_pass(deck):
    checked = call("check", deck(vary={"springs.coil.damping": [-1, 1]}))
    assert checked.exit_code == 0 and "damping=-1 is refused" in checked.stderr
    assert call("check", deck(vary={"springs.coil.damping": [1, 2]})).stderr == ""


def test_options_are_refused_as_options(deck):
    swept = call("sweep", deck(vary={"springs.coil.damping": [1, 2]}), "--vary", "springs.coil.stifness=1,2")
    assert swept.stderr.startswith("--vary: error: springs.coil.stifness: unknown key")
