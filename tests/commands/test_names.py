"""What names on the command line may be: empty, no text, pipes."""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from called import call

import hfsim
from hfsim.scene.shipped import CASES

DECK = (CASES / "pendulum.yaml").read_text()


@pytest.mark.parametrize("command", [("run", "pendulum"), ("sweep", "pendulum"), ("init",), ("verify",)])
def test_an_empty_name_is_not_the_current_folder(here, command):
    refused = call(*command, "-o", "")
    assert refused.exit_code == 2 and "the name is empty" in refused.stderr
    assert not list(here.iterdir())


def test_an_empty_name_is_no_deck(here):
    refused = call("run", "")
    assert refused.exit_code == 2 and "the name of a deck is empty" in refused.stderr


@pytest.mark.parametrize("command", ["run", "check"])
def test_what_is_not_utf8_is_refused(here, command):
    name = os.fsdecode(b"\xff.yaml")
    (here / name).write_text(DECK)
    refused = call(command, name)
    assert refused.exit_code == 2 and "the name of this deck is not UTF-8" in refused.stderr
    refused = call(command, "pendulum", "--set", os.fsdecode(b"name=\xff"))
    assert refused.exit_code == 2 and "--set: error: name: is not UTF-8 text" in refused.stderr


def test_what_is_utf8_where_the_locale_is_not_is_told_as_that():
    word = "\u00f6".encode().decode("ascii", "surrogateescape")  # as Python reads it there
    refused = call("check", f"{word}.yaml")
    assert refused.exit_code == 2 and "the name of this deck is UTF-8 text, but" in refused.stderr
    refused = call("check", "pendulum", "--set", f"name={word}")
    assert refused.exit_code == 2 and "--set: error: name: is UTF-8 text" in refused.stderr
    assert "PYTHONUTF8=1" in refused.stderr


@pytest.mark.parametrize("command", [("check",), ("compare", "rigid", "linear", "--no-plots", "--case")])
def test_a_deck_is_read_from_a_pipe_once(here, command):
    os.mkfifo("pipe")
    writer = threading.Thread(target=(here / "pipe").write_text, args=(DECK,), daemon=True)
    writer.start()
    short = ("--set", "solve.duration=0.05") if command[0] == "compare" else ()
    done = call(*command, "pipe", *((*short, "--reference", "linear") if short else ()))
    writer.join(2)
    assert done.exit_code == 0, done.output


def test_init_makes_a_folder_or_refuses_it(here, monkeypatch):
    assert call("init", "-o", "new/swing.yaml").exit_code == 0 and (here / "new/swing.yaml").exists()
    assert call("init", "--list", "rod").exit_code == 2
    monkeypatch.setattr(os, "access", lambda *_: False)
    refused = call("init", "-o", "new/other.yaml")
    assert refused.exit_code == 2 and "no permission in" in refused.stderr


@pytest.mark.parametrize("option", [("--model", "foo"), ("--target-error", "0"), ("--target-channels", "x")])
def test_a_bad_value_is_told_by_the_option_it_came_with(here, option):
    refused = call("run", "pendulum", *option)
    assert refused.exit_code == 2
    assert f"{option[0]}: error: solve." in refused.stderr and "--set" not in refused.stderr


def test_a_deck_in_the_place_of_a_model_is_told_where_it_goes(here):
    refused = call("compare", "hub_beams_soft")
    assert refused.exit_code == 2 and "no model 'hub_beams_soft'" in refused.stderr
    assert "a deck goes with --case" in refused.stderr


@pytest.mark.parametrize("command", ["static", "modes"])
def test_a_time_may_have_its_unit(here, command):
    assert call(command, "pendulum", "--at", "10 ms", "-o", "unit", "--no-plots").exit_code == 0
    assert call(command, "pendulum", "--at", "0.01", "-o", "none", "--no-plots").exit_code == 0
    found = [next(Path(name).glob("*.csv")).read_text() for name in ("unit", "none")]
    assert found[0] == found[1]
    for wrong in ("-1", "1 kg", "nan"):
        refused = call(command, "pendulum", "--at", wrong, "-o", "other")
        assert refused.exit_code == 2 and "is no time" in refused.stderr


def test_steps_may_have_their_unit(here):
    short = ("--set", "solve.duration=0.01", "--methods", "gauss", "--no-plots", "-o", "out", "--json")
    told = call("bench", "pendulum", "--steps", "1 ms,0.002", *short)
    assert told.exit_code == 0
    assert {point["step"] for point in json.loads(told.stdout)["points"]} == {0.001, 0.002}


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("rum", "pendulum"), "run"),
        (("compare", "linar", "--case", "pendulum"), "linear"),
        (("bench", "pendulum", "--methods", "gaus"), "gauss"),
        (("extreme", "roll_u"), "roll_up"),
    ],
)
def test_of_an_unknown_name_the_nearest_is_told(here, words, meant):
    refused = call(*words)
    assert refused.exit_code == 2 and f"(did you mean '{meant}'?)" in refused.stderr


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("parts/rotr.yaml", " (did you mean 'parts/rotor.yaml'?)"),
        ("rotor.yaml", ""),  # like others by its ending alone
        ("casse.yml", " (did you mean 'case.yaml'?)"),
        ("nowhere/case.yaml", " (did you mean 'case.yaml'?)"),
        ("pendulm.yaml", " (did you mean 'pendulum'?)"),
    ],
)
def test_of_a_missing_deck_the_nearest_is_told_with_its_folder(here, word, meant):
    (here / "parts").mkdir()
    for name in ("case.yaml", "tb_short.yaml", "parts/rotor.yaml"):
        (here / name).write_text(DECK)
    assert call("check", word).stderr == f"error: there is no deck {word}{meant}. Nothing was run.\n"


@pytest.mark.parametrize("deck", ["case.yaml", "gone.yml", "pendulum"])
def test_a_deck_in_the_place_of_a_command_is_told_what_runs_it(here, deck):
    (here / "case.yaml").write_text(DECK)
    refused = call(deck)
    assert refused.exit_code == 2 and f"(did you mean 'hfsim run {deck}'?)" in refused.stderr


def test_a_deck_named_twice_is_told_as_that(here):
    (here / "a.yaml").write_text(DECK)
    (here / "b.yaml").write_text(DECK)
    twice = call("run", "a.yaml", "./a.yaml")
    assert twice.exit_code == 2 and "a.yaml is named twice" in twice.stderr
    alike = call("run", "a.yaml", "b.yaml")
    assert alike.exit_code == 2
    assert "would both write to pendulum.out, after the 'name' in them" in alike.stderr


def heed_interruptions():
    """Whoever has started the tests in the background may have them ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_an_interruption_while_the_program_is_imported_leaves_no_traceback(here):
    (here / "click.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    path = os.pathsep.join([str(here), str(Path(hfsim.__file__).parents[1])])
    words = [sys.executable, "-m", "hfsim", "check", "pendulum"]
    environment = {**os.environ, "PYTHONPATH": path}
    ended = subprocess.run(
        words, capture_output=True, text=True, env=environment, preexec_fn=heed_interruptions
    )
    assert ended.returncode == 130 and ended.stderr == "interrupted\n"


STRUCK = """
import os, signal, sys
wanted = sys.argv[1]
class Strike:
    def find_spec(self, name, path, target=None):
        if name == wanted:
            os.kill(os.getpid(), signal.SIGTERM)
sys.meta_path.insert(0, Strike())
from hfsim.cli import main
sys.argv[1:] = ["check", "pendulum"]
main()
"""


@pytest.mark.parametrize("module", ["hfsim.errors", "hfsim.marching.stop", "hfsim.maths.frozen", "pydantic"])
def test_a_signal_while_modules_are_imported_ends_the_program_as_any_other(here, module):
    struck = subprocess.run([sys.executable, "-c", STRUCK, module], capture_output=True, text=True)
    assert struck.returncode == 143
    assert "internal error" not in struck.stderr and "Traceback" not in struck.stderr
