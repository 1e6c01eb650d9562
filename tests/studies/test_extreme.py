"""`hfsim extreme`: expectations, what counts as missed, the command; the whole set as a slow test."""

import json
from dataclasses import replace

import pytest
from called import call
from zoo import WHIP

from hfsim.commands.extreme import FOLDER
from hfsim.scene.loading import load_deck
from hfsim.studies.extreme import (
    Case,
    Expectation,
    ExpectationError,
    Found,
    examine,
    extreme_set,
    read_expectations,
)
from hfsim.studies.farm import Farm
from hfsim.studies.stability.trials import Job
from hfsim.studies.stability.verdict import Trial, Verdict


def test_every_deck_of_the_set_loads_and_has_its_expectation():
    for one in read_expectations(FOLDER):
        loaded = load_deck(FOLDER / f"{one.name}.yaml")
        assert loaded.deck.name == one.name
        text = (FOLDER / f"{one.name}.yaml").read_text()
        assert "# Extreme:" in text and "# Expect:" in text, one.name
        for value in one.values:
            assert value.channel in loaded.deck.channels
            assert value.time <= loaded.deck.solve.duration * (1.0 + 1e-12)


WANTED = Expectation("x", "accurate", error=1e-3, drift=1e-6)
GOOD = Case(WANTED, Verdict("accurate", time_error=1e-4, energy_drift=1e-7), Trial("done"))


@pytest.mark.parametrize(
    ("case", "words"),
    [
        (GOOD, ""),
        (replace(GOOD, verdict=Verdict("wrong", "far off")), "wrong where accurate"),
        (replace(GOOD, verdict=Verdict("accurate", time_error=1e-2, energy_drift=0.0)), "error 0.01 above"),
        (replace(GOOD, verdict=Verdict("accurate", time_error=0.0)), "energy drift None"),
        (replace(GOOD, expectation=replace(WANTED, item="joints.shake")), "nothing is blamed where"),
        (replace(GOOD, found=(Found("y", "theory", 1.0, 1.1, 0.05),)), "expected 1 within 0.05 (theory)"),
        (replace(GOOD, found=(Found("y", "theory", 1.0, 1.01, 0.05),)), ""),
    ],
)
def test_what_counts_as_missed(case, words):
    assert words in " ".join(case.misses)
    assert bool(case.misses) == bool(words)


@pytest.mark.parametrize(("error", "bound"), [(1e-3, 1e-3), (0.5, 1e-2), (None, 1e-2)])
def test_a_reference_is_told_from_no_more_than_the_usual_error(error, bound):
    assert Expectation("x", "accurate", error=error).bounds.error == bound


def test_a_deck_is_not_missed_because_its_reference_is_off():
    """The same bound is told from a reference that is far off, and from one that is known better."""
    job = Job(WHIP, "whip.yaml", (), "exact", 20.0, tolerance=1e-8)
    assert examine((job, Expectation("whip", "accurate", 1e-3))).misses == []
    far = Verdict("accurate", time_error=5e-3, energy_drift=0.0, time_within=(0.0, 1e-2))
    told = "error 0.005 above 0.001 against a reference "
    assert replace(GOOD, verdict=far).misses == [f"{told}that nothing bears out"]
    far = replace(far, reference_floor=4.5e-3)
    assert replace(GOOD, verdict=far).misses == [f"{told}itself known to 0.0045"]


def write(folder, expectation):
    folder.mkdir(exist_ok=True)
    (folder / "wheel.yaml").write_text("""
hfsim: 1
bodies: {wheel: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {axle: {type: revolute, between: [ground, wheel]}}
springs: {coil: {type: rotational, between: [ground, wheel], stiffness: 1.0}}
initial: {wheel: {angle: 0.5}}
solve: {duration: 5.0}
output: {channels: [wheel.angle]}
""")
    (folder / "expected.yaml").write_text(expectation)
    return folder


HOLDS = """
wheel:
  class: accurate
  error: 1.0e-6
  values: [{channel: wheel.angle, time: 5.0, value: 0.14183109, within: 1.0e-6, from: 0.5 cos t}]
"""


def test_the_command_tells_what_holds_and_what_does_not(tmp_path):
    folder = write(tmp_path / "set", HOLDS)
    result = call("extreme", "--decks", folder, "-o", tmp_path / "o")
    assert result.exit_code == 0, result.output
    assert "1 of 1 deck as expected" in result.stdout and "1/1" in result.stdout
    facts = json.loads((tmp_path / "o/extreme.json").read_text())
    assert facts["cases"][0]["holds"] and facts["sound_completed"] == 1
    write(folder, HOLDS.replace("value: 0.14183109", "value: 0.6"))
    result = call("extreme", "wheel", "--decks", folder, "--json")
    assert result.exit_code == 4
    told = json.loads(result.stdout)
    assert "expected 0.6 within" in told["cases"][0]["misses"][0]
    assert told["files"] == []  # nothing is written without -o


@pytest.mark.parametrize(
    "bad",
    [
        "wheel: {class: fine}",
        "wheel: {class: accurate, colour: red}",
        "other: {class: accurate}",
        "[]",
        "a: [",
    ],
)
def test_expectations_that_cannot_be_used(tmp_path, bad):
    folder = write(tmp_path / "set", bad)
    with pytest.raises(ExpectationError):
        read_expectations(folder)
    assert call("extreme", "--decks", folder).exit_code == 2


def test_small_decks_of_the_set_hold():
    names = ("free_fall", "springs_apart", "mass_ratio")
    chosen = [one for one in read_expectations(FOLDER) if one.name in names]
    result = extreme_set(FOLDER, chosen, 60.0, 30.0, Farm(2))
    assert not {case.name: case.misses for case in result.cases if case.misses}


@pytest.mark.slow
def test_the_whole_set_holds():
    """All are as expected, and nine tenths of the sound scenes complete."""
    result = extreme_set(FOLDER, read_expectations(FOLDER), 300.0, 100.0, Farm(2))
    assert not {case.name: case.misses for case in result.cases if case.misses}
    completed, sound = result.sound
    assert completed >= 0.9 * sound
