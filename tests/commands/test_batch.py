"""Decks from standard input, history to standard output, several decks at a time: as real processes."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from hfsim.cli import app
from hfsim.scene.shipped import CASES

ROOT = Path(__file__).resolve().parents[2]
SHORT = ("--set", "solve.duration=0.1", "--set", "output.interval=0.02", "--no-plots", "--no-diagnosis")


def start(*arguments, cwd, **options):
    command = [sys.executable, "-m", "hfsim", *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(command, cwd=cwd, text=True, env=environment, preexec_fn=_heed_signals, **pipes)


def _heed_signals():
    """Heed signals from the keyboard even where the tests run in the background and ignore them."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def call(*arguments, cwd, text=None):
    process = start(*arguments, cwd=cwd, stdin=subprocess.PIPE)
    out, errors = process.communicate(text, timeout=120)
    return process.returncode, out, errors


def test_a_deck_comes_in_and_its_history_goes_out(tmp_path):
    deck = (CASES / "pendulum.yaml").read_text()
    code, out, errors = call("run", "-", "-o", "-", *SHORT, cwd=tmp_path, text=deck)
    assert (code, list(tmp_path.iterdir())) == (0, [])
    assert call("run", "pendulum", "-o", "a", "-q", *SHORT, cwd=tmp_path)[0] == 0
    assert out == (tmp_path / "a/history.csv").read_text()
    assert "done, 0.1 s simulated" in errors
    assert "standard output" in errors
    quiet = call("run", "-", "-o", "-", "-q", *SHORT, cwd=tmp_path, text=deck)
    assert quiet == (0, out, "")


def test_a_refined_run_goes_out_too(tmp_path):
    options = ("--set", "solve.duration=0.1", "--set", "output.interval=0.05", "--target-error", "0.2")
    code, out, _ = call("run", "pendulum", "-o", "-", "--no-diagnosis", *options, cwd=tmp_path)
    assert code == 0
    assert [line.split(",")[0] for line in out.splitlines()] == ["t", "0.0", "0.05", "0.1"]


def test_a_map_is_made_of_standard_input(tmp_path):
    deck = (CASES / "pendulum.yaml").read_text()
    words = ("--set", "solve.duration=0.05", "--step", "0.01", "--methods", "gauss", "--models", "exact")
    assert call("stability", "-", *words, "--no-plots", "-o", "map", cwd=tmp_path, text=deck)[0] == 0


def test_tables_that_are_asked_for_are_told_quietly_too(tmp_path):
    words = ("modes", "pendulum", "--csv", "--no-plots", "--count", "2", "--force")
    told = call(*words, cwd=tmp_path)[1]
    assert len(told.splitlines()) == 3
    assert call(*words, "-q", cwd=tmp_path) == (0, told, "")


@pytest.mark.parametrize("command", ["check", "plan"])
def test_other_commands_read_standard_input(command, tmp_path):
    deck = (CASES / "pendulum.yaml").read_text()
    assert call(command, "-", cwd=tmp_path, text=deck)[0] == 0
    code, out, errors = call(command, "-", cwd=tmp_path, text="hfsim: 1\nbodys: 3\n")
    assert (code, out) == (2, "")
    assert "stdin:2:1: error: bodys" in errors


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "pendulum", "two_beams", "-o", "-"), ("run", "pendulum", "-o", "-", "--json"),
        ("run", "pendulum", "-o", "-", "--vtk"), ("run", "pendulum", "-o", "-", "--resume"),
        ("compare", "--case", "pendulum", "-o", "-"), ("bench", "pendulum", "-o", "-"),
    ],
)  # fmt: skip
def test_what_needs_a_folder_does_not_go_to_standard_output(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, arguments)
    assert (done.exit_code, done.stdout, list(tmp_path.iterdir())) == (2, "", [])


def test_decks_side_by_side_are_told_in_their_order(tmp_path):
    decks = ("two_beams", "pendulum", "governor")
    code, out, errors = call("run", "--jobs", "2", *decks, "-o", "b", "--json", *SHORT, cwd=tmp_path)
    found = [json.loads(line) for line in out.splitlines()]
    assert (code, [one["name"] for one in found]) == (0, list(decks))
    for one in found:
        assert 0.0 < one["cpu_s"]["solve"] < one["cpu_s"]["total"] < 20.0
        assert one["final"].keys() == one["extremes"].keys() == one["channels"].keys()
        assert json.loads((tmp_path / "b" / one["name"] / "summary.json").read_text()) == one
    assert "Traceback" not in errors


def test_a_deck_that_fails_beside_others_gives_the_gravest_code(tmp_path):
    limited = tmp_path / "limited.yaml"
    deck = (CASES / "pendulum.yaml").read_text().replace("name: pendulum", "name: limited")
    limited.write_text(deck.replace("solve:", "solve:\n  max_steps: 1"))
    code, out, errors = call("run", "--jobs", "2", limited, "pendulum", "-o", "b", *SHORT, cwd=tmp_path)
    assert code == 5
    assert out.index("limited: limit at") < out.index("pendulum: done")
    assert "limited: limit at" in errors


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interruption_keeps_what_all_have_computed(tmp_path, number, code):
    deck = (CASES / "two_beams.yaml").read_text()
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.yaml").write_text(deck.replace("name: two_beams", f"name: {name}"))
    process = start(
        "run", "--jobs", "2", "a.yaml", "b.yaml", "c.yaml", "--set", "solve.duration=500", "--no-plots",
        cwd=tmp_path,
    )  # fmt: skip
    rows = [tmp_path / f"{name}.out/history.csv" for name in "ab"]
    end = time.monotonic() + 60.0
    while not all(path.exists() and path.stat().st_size > 5000 for path in rows):
        assert time.monotonic() < end
        time.sleep(0.1)
    process.send_signal(number)
    out, errors = process.communicate(timeout=60)
    assert process.returncode == code
    for path in rows:
        summary = json.loads((path.parent / "summary.json").read_text())
        assert (summary["status"], summary["exit_code"]) == ("interrupted", code)
        assert (path.parent / "checkpoint.npz").exists()
    assert out.index("a: interrupted") < out.index("b: interrupted")
    assert not (tmp_path / "c.out").exists()
    assert "not begun: c.yaml" in errors
