"""A channel takes one file and one name: all else that is known of it stands with it."""

import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner

from hfsim.cli import app
from hfsim.parts.channels import CHANNELS, ChannelKind, Plot, is_judged
from hfsim.scene.shipped import CASES


def _height(samples, point):
    return samples.scene.marker(point).position(samples.x)[:, 1] - samples.t


def _power(samples, subject):
    return samples.scene.system.power(samples.t, samples.x, samples.u)


@pytest.fixture
def deck(monkeypatch, tmp_path):
    monkeypatch.setitem(CHANNELS, "height", (ChannelKind("km", _height, "point", Plot("height", "height")),))
    monkeypatch.setitem(CHANNELS, "supplied", (ChannelKind("W", _power, "power", judged="never"),))
    monkeypatch.setitem(CHANNELS, "roll", (ChannelKind("rad", _height, "point", dimensions=(3,)),))
    monkeypatch.chdir(tmp_path)
    shutil.copy(CASES / "pendulum.yaml", "own.yaml")
    return "own.yaml"


def call(command, deck, channels):
    settings = (f"output.channels=[{channels}]", "solve.duration=0.05")
    options = [word for one in settings for word in ("--set", one)]
    return CliRunner().invoke(app, [command, deck, *options])


def test_a_new_channel_goes_from_the_check_to_the_pictures(deck, tmp_path):
    assert call("check", deck, "b1.tip.height, power.supplied").exit_code == 0
    done = call("run", deck, "b1.tip.y, b1.tip.height, power.supplied")
    assert done.exit_code == 0, done.output
    folder = next(tmp_path.glob("*.out"))
    head, *rows = (folder / "history.csv").read_text().splitlines()
    assert head == "t,b1.tip.y,b1.tip.height,power.supplied"
    t, y, height, _ = np.array([row.split(",") for row in rows], float).T
    assert height == pytest.approx(y - t, abs=1e-15)
    channels = json.loads((folder / "summary.json").read_text())["channels"]
    assert channels == {"b1.tip.y": "m", "b1.tip.height": "km", "power.supplied": "W"}
    assert {"height.png", "supplied.png", "position.png"} <= {p.name for p in (folder / "plots").iterdir()}
    assert is_judged("b1.tip.height") and not is_judged("power.supplied")


@pytest.mark.parametrize(
    ("channel", "words"),
    [
        ("b1.tip.roll", "a planar scene has no roll"),
        ("b1.tip.heigth", "did you mean 'height'?"),
        ("power.used", "'power' has no quantity 'used'"),
        ("b1.top.height", "'b1' has no point 'top'"),
    ],
)
def test_a_new_channel_is_checked_by_what_is_known_of_it(deck, channel, words):
    refused = call("check", deck, channel)
    assert refused.exit_code == 2
    assert words in refused.output


def test_a_word_for_the_scene_is_no_name_of_a_body(deck, tmp_path):
    text = (tmp_path / deck).read_text()
    (tmp_path / deck).write_text(text.replace("b1", "power"))
    assert "'power' is taken by the output's columns" in call("check", deck, "power.supplied").output
