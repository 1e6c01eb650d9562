"""The animation: bounded, of the whole motion, and listed."""

import json
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from called import call
from PIL import Image

from hfsim.output.plots import motion
from hfsim.output.plots.motion import Tempo

DECK = """
hfsim: 1
name: swing
gravity: {gravity}
bodies: {{bar: {{type: rigid, mass: 1.0, inertia: {inertia}, points: {{end: {place}}}}}}}
joints: {{pin: {{type: revolute, between: [ground, bar]}}}}
initial: {{bar: {{angular_velocity: 3}}}}
solve: {{duration: 2.5, tolerance: 1.0e-5}}
output: {{interval: 0.01, channels: [bar.end.x, bar.end.y]}}
"""
SCENES = {
    "plane": {"gravity": "[0.0, 0.0]", "inertia": "1.0", "place": "[0.5, 0.0]"},
    "space": {"gravity": "[0.0, 0.0, 0.0]", "inertia": "[1.0, 1.0, 1.0]", "place": "[0.5, 0.0, 0.0]"},
}


def animated(scene, tmp_path, monkeypatch, *options):
    monkeypatch.chdir(tmp_path)
    Path("deck.yaml").write_text(DECK.format(**SCENES[scene]))
    done = call("run", "deck.yaml", "--animate", "--no-plots", "-o", "out", *options)
    assert done.exit_code == 0, done.output
    assert "plots/motion.gif" in json.loads(Path("out/summary.json").read_text())["files"]
    return Image.open(BytesIO(Path("out/plots/motion.gif").read_bytes()))


def body(image):
    """Return where the bar's colour is, shape (n, 2): row and column of pixels; not in the legend."""
    near = np.abs(np.asarray(image.convert("RGB")).astype(int) - [0x00, 0x72, 0xB2]).max(axis=2) < 40
    return np.argwhere(near)


@pytest.mark.parametrize("scene", SCENES)
def test_the_motion_is_shown_in_real_time_on_white(scene, tmp_path, monkeypatch):
    image = animated(scene, tmp_path, monkeypatch)
    assert max(image.size) == 720 and image.n_frames == 50
    assert image.info["duration"] == 50 and image.info["loop"] == 0
    middles = []
    for frame in range(image.n_frames):
        image.seek(frame)
        assert image.convert("RGB").getpixel((1, image.height - 2)) == (255, 255, 255)
        middles.append(body(image).mean(axis=0))
    turns = np.array(middles)
    # the bar turns by 7.5 rad: from the right, up at a quarter of a turn, more than a turn in all
    right, up, left = (turns[round(20 * angle / 3.0)] for angle in (0.0, 0.5 * np.pi, np.pi))
    assert up[0] < right[0] - 20 and left[1] < right[1] - 50
    assert np.linalg.norm(turns[round(20 * 2.0 * np.pi / 3.0)] - right) < 20


@pytest.mark.parametrize("scene", ["space"])
def test_frames_are_bounded(scene, tmp_path, monkeypatch):
    image = animated(
        scene, tmp_path, monkeypatch, "--set", "solve.duration=60", "--set", "output.interval=0.02"
    )
    assert image.n_frames == 120 <= motion._FRAMES
    assert image.n_frames * image.info["duration"] == pytest.approx(6000)


@pytest.mark.parametrize("duration", [1e-9, 0.3, 2.5, 3.0, 7.5, 8.0, 100.0, 1e12])
def test_no_motion_plays_too_short_or_too_long(duration):
    tempo = Tempo.of(duration)
    assert 2.5 <= tempo.lasts <= 7.5
    assert bool(tempo.words) == (not 2.5 <= duration <= 7.5)


def test_a_run_of_one_row_has_one_frame(tmp_path, monkeypatch):
    assert Tempo.of(0.0).lasts == 0.0
    image = animated(
        "plane", tmp_path, monkeypatch, "--set", "solve.duration=1e-3", "--set", "output.interval=1.0"
    )
    assert image.n_frames == 2
