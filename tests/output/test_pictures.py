"""Pictures: names as they are, no results lost, nobody's files touched."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from called import call

import hfsim
from hfsim.output.pictures import FORMATS, put_pictures
from hfsim.output.plots.figures import finished, new_figure
from hfsim.output.plots.files import save
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk

NAMES = ("$x_$", "$\\frac{$", "a\\b", "100 %", "_hidden", "\u4e2d")


def texts(figure):
    """Return what a figure shows, once it is drawn."""
    from matplotlib.text import Text

    return [text for text in figure.findobj(Text) if text.get_text()]


@pytest.mark.parametrize("name", NAMES)
def test_names_are_drawn_as_they_are(tmp_path, recwarn, name):
    figure = new_figure()
    axes = figure.subplots()
    axes.plot([0.0, 1.0], label=name)
    axes.plot([1.0, 0.0], label="other")
    axes.set(xlabel=name, yscale="log")
    axes.set_xticks([0.0, 1.0], [name, "end"])
    save({"one": finished(figure, name, [axes])}, tmp_path)
    assert (tmp_path / "one.png").stat().st_size > 2000
    shown = [text for text in texts(figure) if text.get_text() == name]
    assert len(shown) >= 4, "title, label, legend and tick"
    assert {text._preprocess_math(name) for text in shown} == {(name, False)}
    assert name in [text.get_text() for text in figure.legends[0].get_texts()]
    decades = [text.get_text() for text in axes.get_yticklabels()]
    assert any("10^{-1}" in words for words in decades), "powers of ten stay formulae"
    assert not [str(one.message) for one in recwarn.list]


def drawing(*names, fail=None):
    def draw(folder):
        for name in names:
            (folder / name).write_bytes(b"picture")
        if fail:
            raise fail
        return names

    return draw


def test_pictures_leave_files_of_others_alone(tmp_path):
    assert put_pictures(drawing("a.png"), tmp_path) == ["plots/a.png"]
    (tmp_path / "plots/b.png").write_bytes(b"mine")
    with pytest.raises(FileExistsError, match=r"b\.png"):
        put_pictures(drawing("b.png", "c.png"), tmp_path)
    assert (tmp_path / "plots/b.png").read_bytes() == b"mine"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a.png", "b.png", "plots"]


def study(folder, force=False):
    return Study.claim("race", Destination(folder, force), "race", Talk(quiet=True))


@pytest.mark.parametrize("fail", [ValueError("no font"), OSError(28, "No space left"), MemoryError()])
def test_a_picture_that_fails_costs_no_results(tmp_path, fail):
    rows = {"race": (["a"], [{"a": 1}])}
    facts = study(tmp_path).publish({"status": "done"}, rows, "", drawing("a.png", fail=fail))
    assert facts == json.loads((tmp_path / "race.json").read_text())
    assert facts["files"] == ["race.csv", "race.json"]
    (warning,) = facts["warnings"]
    assert warning.startswith("the pictures were not drawn: ") and not warning.endswith(": ")
    assert (tmp_path / "race.csv").read_text() == "a\n1\n"


def test_plots_may_be_a_file(tmp_path):
    (tmp_path / "plots").write_text("mine")
    facts = study(tmp_path).publish({"status": "done"}, {}, "", drawing("a.png"))
    assert "plots" in facts["warnings"][0] and (tmp_path / "plots").read_text() == "mine"


def test_a_signal_while_pictures_are_drawn_costs_no_results(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        study(tmp_path).publish({"status": "done"}, {}, "", drawing("a.png", fail=KeyboardInterrupt()))
    facts = json.loads((tmp_path / "race.json").read_text())
    assert facts["files"] == ["race.json"]
    assert facts["warnings"] == ["the pictures were not drawn: interrupted"]
    assert [path.name for path in tmp_path.iterdir()] == ["race.json"]


def test_pictures_of_a_study_that_is_replaced_go_and_others_stay(tmp_path):
    study(tmp_path).publish({"status": "done"}, {}, "", drawing("a.png"))
    (tmp_path / "plots/own.png").write_bytes(b"mine")
    study(tmp_path, force=True).publish({"status": "done"}, {}, "")
    assert [path.name for path in (tmp_path / "plots").iterdir()] == ["own.png"]


def test_pictures_of_a_study_that_was_killed_before_it_told_of_them_are_its_own(tmp_path, monkeypatch):
    """Nothing is written once they are in their places."""
    put = os.replace

    def killed(*_):
        raise SystemExit

    def replace(draft, there):
        put(draft, there)
        if Path(there).suffix == ".png":
            monkeypatch.setattr("hfsim.output.disk.write_text", killed)

    monkeypatch.setattr(os, "replace", replace)
    first = study(tmp_path)
    with pytest.raises(SystemExit):
        first.publish({"status": "done"}, {}, "", drawing("a.png"))
    first.folder.release()  # as the end of its process does
    monkeypatch.undo()
    assert (tmp_path / "plots/a.png").exists()
    study(tmp_path, force=True).publish({"status": "done"}, {}, "")
    assert [path.name for path in tmp_path.iterdir()] == ["race.json"]


def test_pictures_are_put_all_or_none(tmp_path, monkeypatch):
    put = os.replace

    def replace(draft, there):
        if Path(there).name == "b.png":
            raise OSError(28, "No space left")
        put(draft, there)

    monkeypatch.setattr(os, "replace", replace)
    facts = study(tmp_path).publish({"status": "done"}, {}, "", drawing("a.png", "b.png"))
    assert facts["files"] == ["race.json"] and "No space" in facts["warnings"][0]
    assert not [*tmp_path.rglob("*.png")]


DECK = """
hfsim: 1
name: "$x_$ 100 %"
bodies: {_hub: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {pin: {type: revolute, between: [ground, _hub]}}
initial: {_hub: {angular_velocity: 1.0}}
solve: {duration: 0.1, tolerance: 1.0e-6}
output: {channels: [_hub.angle]}
"""


MAGIC = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


SLOWER = [pytest.param(one, marks=pytest.mark.slow) for one in FORMATS[1:]]


@pytest.mark.parametrize("kind", [FORMATS[0], *SLOWER])
def test_all_commands_draw_a_scene_with_any_name_in_any_format(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    Path("deck.yaml").write_text(DECK)
    orders = (
        ("run", "deck.yaml", "-o", "a"),
        ("compare", "linear", "exact", "--case", "deck.yaml", "-o", "b"),
        ("bench", "deck.yaml", "--methods", "gauss", "--tolerances", "1e-3,1e-5", "-o", "c"),
        ("stability", "deck.yaml", "--methods", "gauss", "--vary", "name=$a_$,$b_$", "-o", "d"),
    )
    for order in orders:
        result = call(*order, "--format", kind)
        assert result.exit_code == 0, result.output
        files = list(Path(order[-1]).rglob("plots/*"))
        assert files and {file.suffix for file in files} == {f".{kind}"}, order
        assert all(file.read_bytes().startswith(MAGIC[kind]) for file in files)
        assert "warning" not in result.stderr


def test_pictures_of_another_format_go_when_their_run_is_replaced(tmp_path):
    (tmp_path / "deck.yaml").write_text(DECK)
    wish = {"error_estimate": False, "diagnosis": False, "output": tmp_path / "out"}
    hfsim.run(tmp_path / "deck.yaml", plots="svg", **wish)
    assert (tmp_path / "out/plots/angle.svg").exists()
    first = (tmp_path / "out/plots/angle.svg").read_bytes()
    hfsim.run(tmp_path / "deck.yaml", plots="svg", force=True, **wish)
    assert (tmp_path / "out/plots/angle.svg").read_bytes() == first, "no dates and no random names"
    hfsim.run(tmp_path / "deck.yaml", force=True, **wish)
    assert {file.suffix for file in (tmp_path / "out/plots").iterdir()} == {".png"}


def test_nothing_is_printed_where_there_is_no_home_and_nothing_to_show_pictures(tmp_path):
    (tmp_path / "deck.yaml").write_text(DECK)
    nowhere = {"HOME": "/nonexistent", "MPLCONFIGDIR": "/proc/none", "XDG_CACHE_HOME": "/proc/none"}
    nowhere["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"  # as notebooks do
    words = [sys.executable, "-m", "hfsim", "bench", "deck.yaml", "--methods", "gauss"]
    env = {**os.environ, **nowhere}
    done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert list(tmp_path.glob("*.bench/plots/*.png"))


def test_the_drawing_library_is_left_as_it_was():
    from matplotlib.artist import kwdoc
    from matplotlib.lines import Line2D

    assert "linewidth" in kwdoc(Line2D)
    code = "import os, hfsim.output.plots, matplotlib as m; "
    code += "print(m.rcParams['backend'], os.environ['MPLBACKEND'])"
    env = {**os.environ, "MPLBACKEND": "svg"}
    told = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert told.stdout.split() == ["svg", "svg"]
