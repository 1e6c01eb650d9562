"""What README and the manual show works: their commands, run in empty folders, their decks and their Python.

Exit codes stand in the pages, as `# exit code 5` behind a command; without it the code is 0.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest
import yaml
from click.testing import CliRunner

from hfsim.cli import app
from hfsim.commands.init import starters
from hfsim.output import api
from hfsim.output.manual import topics
from hfsim.scene.loading import parse_deck

ROOT = Path(__file__).resolve().parents[1]
PAGES = {"README": ROOT / "README.md", **topics()}
SET_UP = re.compile(r"^(python|pip|git|\.ci|\.venv/bin/(?!hfsim\b))|-m venv")
"""Lines that set up or develop the program, or write of it outside its folder."""
SLOW = {
    "tutorial",
    *(f"recipes: {name}" for name in ("Spin-up", "Chain", "Manipulator", "Slider-crank", "Four-bar linkage")),
}
"""Pages and recipes whose commands take more than some seconds."""


def blocks(text, *kinds):
    """Kind and text of the blocks of code in a page, in their order."""
    found = re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [(kind, block) for kind, block in found if kind in kinds]


def units():
    """What is run in one empty folder: a page, or a recipe."""
    for name, page in PAGES.items():
        text = page.read_text(encoding="utf-8")
        parts = text.split("\n## ") if name == "recipes" else [text]
        for part in parts:
            if blocks(part, "sh", "python"):
                label = name if len(parts) == 1 else f"{name}: {part.splitlines()[0]}"
                marks = [pytest.mark.slow] if label in SLOW else []
                yield pytest.param(part, id=label, marks=marks)


def whole_decks():
    for name, page in PAGES.items():
        for number, (_, block) in enumerate(blocks(page.read_text(encoding="utf-8"), "yaml")):
            if re.search(r"^hfsim: *1", block, re.MULTILINE):
                yield pytest.param(block, id=f"{name}-{number}")


def mentions():
    """Every command that a page shows, in a block or within a line."""
    for name, page in PAGES.items():
        text = page.read_text(encoding="utf-8")
        spans = re.findall(r"`(hfsim [^`\n]+)`", text)
        lines = (line for _, block in blocks(text, "sh", "") for line in block.splitlines())
        lines = [line for line in (*spans, *lines) if re.match(r"(\.venv/bin/)?hfsim ", line)]
        if lines:
            yield pytest.param(lines, id=name)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))


def run_line(line):
    """Run a line as a shell would, in this process where it is a plain command; return code and output."""
    words = shlex.split(line, comments=True)
    if words[0].endswith("hfsim") and not re.search(r"[|<>;&$\n]", line):
        result = CliRunner().invoke(app, words[1:])
        return result.exit_code, result.output
    program = f'hfsim() {{ "{sys.executable}" -P -m hfsim "$@"; }}\nset -e\n'
    shell = ["bash", "-c", program + line.replace(".venv/bin/hfsim", "hfsim")]
    done = subprocess.run(shell, capture_output=True, text=True, timeout=120, check=False)
    return done.returncode, done.stdout + done.stderr


def run_block(block):
    """Run the lines of a block one by one, or all at once where it holds a file."""
    lines = re.split(r"\n| && ", block.replace("\\\n", " "))
    for line in [block] if "<<" in block else lines:
        if not shlex.split(line, comments=True) or SET_UP.search(line):
            continue
        stated = re.search(r"# exit code (\d+)", line)
        code, told = run_line(line)
        assert code == (int(stated[1]) if stated else 0), f"{line}\n{told}"
        assert "Traceback" not in told


@pytest.mark.parametrize("part", [*units()])
def test_commands_and_python_run_as_they_stand(part, capsys):
    if (ROOT / "cases").is_dir():
        os.symlink(ROOT / "cases", "cases")
    names = {"__name__": "page"}
    for kind, block in blocks(part, "sh", "python"):
        if kind == "sh":
            run_block(block)
        else:
            exec(compile(block, "a block of Python", "exec"), names)


@pytest.mark.parametrize("text", [*whole_decks()])
def test_decks_are_right_and_run(text):
    loaded = parse_deck(text)
    resolved = parse_deck(yaml.safe_dump(loaded.deck.resolved(), sort_keys=False))
    assert resolved.deck == loaded.deck.model_copy(update={"sweep": None, "parameters": {}})
    api.check(loaded)
    soon = loaded.deck.solve.duration / 50.0
    run = api.run(loaded, {"solve.duration": soon}, error_estimate=False, diagnosis=False)
    assert run.t[-1] == pytest.approx(soon)


@pytest.mark.parametrize("text", [*whole_decks()])
def test_decks_that_init_knows_say_the_same_on_every_page(text):
    name = re.search(r"^name: *(\S+)", text, re.MULTILINE)
    if name and name[1] in starters():
        assert parse_deck(text).deck == parse_deck(starters()[name[1]]).deck


@pytest.mark.parametrize(
    ("topic", "told"),
    [
        ("gear", ["joints: gear", "`ratio`", "More on the pages deck"]),
        ("friction", ["Damping, friction, stops, latches", "friction: of turns", "springs: two_point"]),
        ("periodic", ["law: table", "Whether the points are one period"]),
    ],
)
def test_kinds_and_keys_of_decks_are_found(topic, told):
    shown = CliRunner().invoke(app, ["help", topic])
    assert shown.exit_code == 0
    assert [one for one in told if one not in " ".join(shown.stdout.split())] == []


@pytest.mark.parametrize("topic", ["geer", "the", "in", "simulate"])
def test_other_words_are_no_topics(topic):
    shown = CliRunner().invoke(app, ["help", topic])
    assert shown.exit_code == 2 and f"no topic {topic}" in shown.stderr


@pytest.mark.parametrize("lines", [*mentions()])
def test_commands_and_options_are_known(lines):
    for line in lines:
        for part in re.split(r"\s*[;|]\s*", line.split(" #")[0]):
            words = part.removeprefix(".venv/bin/").split()
            if words[:1] != ["hfsim"] or words[1:2] == ["COMMAND"]:
                continue
            options = options_of(words[1], line)
            stated = {word.split("=")[0] for word in words[2:] if re.match(r"--?[a-z]", word)}
            assert stated <= options, f"{line}: {stated - options}"


def options_of(name, line):
    if name.startswith("-"):
        return {name}
    command = app.get_command(click.Context(app), name)
    assert command is not None, f"{line}: no command {name}"
    return {"-h", "--help"}.union(*(one.opts for one in command.params))
