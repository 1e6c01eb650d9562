"""hfsim init, schema and help: what people do before a run."""

import json
from pathlib import Path

import click
import pytest
from called import call

from hfsim.cli import COMMANDS
from hfsim.commands.init import starters
from hfsim.output.manual import for_terminal, topics
from hfsim.scene.loading import parse_deck


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_three_commands_from_an_empty_folder_to_a_picture():
    assert call("init").exit_code == 0
    assert "1 beam" in call("check", "swing.yaml").stdout
    assert call("run", "swing.yaml").exit_code == 0
    assert list(Path("swing.out/plots").glob("*.png"))


@pytest.mark.parametrize("name", starters())
def test_every_deck_that_init_knows_is_right_and_told(name):
    assert call("init", name).exit_code == 0
    text = Path(f"{name}.yaml").read_text()
    assert parse_deck(text).deck.name == name
    listed = dict(line.split("  ", 1) for line in call("init", "--list").stdout.splitlines())
    assert 5 < len(listed[name].strip()) < 100
    assert text.startswith("# ")


def test_decks_are_told_apart():
    lines = call("init", "--list").stdout.splitlines()
    listed = dict(line.split(maxsplit=1) for line in lines)
    assert len(set(listed.values())) == len(listed)
    assert listed["pendulum_3d"].endswith("section 7.1 in space")


def test_a_deck_that_is_there_is_not_replaced():
    Path("swing.yaml").write_text("mine")
    refused = call("init", "swing")
    assert (refused.exit_code, Path("swing.yaml").read_text()) == (2, "mine")
    assert "--force" in refused.stderr
    assert call("init", "swing", "-o", "other.yaml").exit_code == 0
    assert call("init", "swing", "--force").exit_code == 0
    Path("link.yaml").symlink_to("nowhere")
    assert call("init", "swing", "-o", "link.yaml").exit_code == 2 and Path("link.yaml").is_symlink()
    assert Path("swing.yaml").read_text() == Path("other.yaml").read_text()
    told = call("init", "swing", "-o", "-")
    assert told.stdout == Path("swing.yaml").read_text() and not Path("-").exists()
    misspelt = call("init", "swnig")
    assert misspelt.exit_code == 2
    assert "did you mean 'swing'" in misspelt.stderr


@pytest.mark.parametrize("command", ["init", "run pendulum", "sweep pendulum --vary bodies.b1.length=1,2"])
def test_a_folder_that_was_deleted_is_told(tmp_path, monkeypatch, command):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    refused = call(*command.split())
    assert refused.exit_code == 2 and "error: cannot write to" in refused.stderr
    assert "No such file or directory" in refused.stderr and "internal" not in refused.stderr


def test_the_schema_is_json():
    solve = json.loads(call("schema").stdout)["properties"]["solve"]["properties"]
    assert solve["duration"]["description"].startswith("Time to simulate")


def test_help_shows_the_manual_and_what_commands_take():
    listed = call("help").stdout
    for topic, page in topics().items():
        assert topic in listed
        shown = call("help", topic).stdout
        words = [word for word in page.read_text().split() if word.isalpha()]
        assert not [word for word in words if word not in shown]
    assert "--resume" in call("help", "run").stdout
    misspelt = call("help", "tutorail")
    assert misspelt.exit_code == 2
    assert "did you mean 'tutorial'" in misspelt.stderr


@pytest.mark.parametrize("width", [40, 80, 110])
def test_pages_keep_to_the_width_but_for_code(width):
    for page in topics().values():
        for line in click.unstyle(for_terminal(page.read_text(), width)).splitlines():
            assert len(line) <= width or line.startswith("    "), line


def test_all_commands_are_listed():
    listed = call("--help").stdout
    for name in COMMANDS:
        assert f"  {name} " in listed
