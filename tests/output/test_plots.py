"""Pictures of runs in space: what is drawn is what was computed, to one scale in all views."""

import subprocess
import sys
import warnings
from dataclasses import replace
from itertools import pairwise
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.colors import to_rgb
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from hfsim.marching.solution import Channel
from hfsim.output.plots.figures import new_figure, set_title, set_title_above
from hfsim.output.plots.files import save
from hfsim.output.plots.history import time_figures
from hfsim.output.plots.ink import DPI, Ink, fitted, text_width
from hfsim.output.plots.letters import plain
from hfsim.output.plots.panel import Arrow, Curve, Note, Strokes
from hfsim.output.plots.run import draw_run
from hfsim.output.plots.space import oblique, oblique_shapes, shapes_figure, track_figure
from hfsim.output.plots.style import colour
from hfsim.output.plots.tracks import apart
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

DECK = """
hfsim: 1
name: top
gravity: [0.0, 0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e6}}
sections: {round: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies:
  hub:
    type: rigid
    mass: 1.0
    inertia: [0.1, 0.2, 0.25]
    points: {a: [0.4, 0, 0.1], b: [-0.2, 0.3, 0.1], c: [0, -0.3, 0]}
  whip: {type: beam, element: cable, material: rubber, section: round, length: 0.5, elements: 2}
joints:
  ball: {type: spherical, between: [hub.a, whip.root]}
initial:
  hub: {position: [0.0, 0.0, 0.0], velocity: [0.0, 1.0, 2.0], angular_velocity: [0.1, 12.0, 0.1]}
  whip: {orientation: {x: [0.0, 0.0, -1.0], y: [0.0, 1.0, 0.0]}}
solve: {duration: 0.4, tolerance: 1.0e-5}
output:
  channels: [hub.a.x, hub.a.y, hub.a.z, whip.tip.x, whip.tip.y, whip.tip.z, whip.tip.vx,
    whip.tip.vy, whip.tip.vz, hub.vx, hub.vy, hub.vz, hub.quaternion_w, hub.quaternion_x,
    hub.quaternion_y, hub.quaternion_z,
    hub.rotation_x, hub.rotation_y, hub.rotation_z, ball.force_x, ball.force_y, ball.force_z]
"""


@pytest.fixture(scope="module")
def run():
    return simulate(parse_deck(DECK, "top.yaml"), error_estimate=False, outlines=True)


def test_a_run_in_space_has_its_pictures(run, tmp_path):
    names = draw_run(run, tmp_path)
    assert {"path.png", "shapes.png", "oblique.png", "rotation.png", "quaternion.png"} <= set(names)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)


@pytest.mark.parametrize("draw", [track_figure, shapes_figure])
def test_views_share_one_scale_and_stand_in_line(run, draw):
    views = {(panel.across.label[0], panel.upward.label[0]): panel for panel in draw(run).panels}
    assert set(views) == {("x", "y"), ("x", "z"), ("y", "z")}
    metres = [panel.place(np.array([[0, 0], [1, 0], [0, 1]])) for panel in views.values()]
    sizes = [np.linalg.norm(ends[1:] - ends[0], axis=1) for ends in metres]
    assert np.array(sizes) == pytest.approx(np.full((3, 2), sizes[0][0]), rel=1e-3)
    above, front, right = (views[pair].frame for pair in (("x", "y"), ("x", "z"), ("y", "z")))
    assert above[0::2] == pytest.approx(front[0::2], abs=0.01)
    assert right[1::2] == pytest.approx(front[1::2], abs=0.01)
    assert above[1] > front[3] and right[0] > front[2]


def test_paths_are_the_channels(run):
    for panel in track_figure(run).panels:
        names = panel.across.label[0], panel.upward.label[0]
        curve = next(line for line in panel.curves if line.label == "whip.tip")
        track = np.array([run[f"whip.tip.{one}"] for one in names])
        assert pytest.approx(track) == curve.points.T


class Watched(RendererAgg):
    """Keeps where it drew what while a word was written."""

    def __init__(self, size):
        super().__init__(*(DPI * np.array(size)).round(), DPI)
        self.drawn = []

    def draw_path(self, gc, path, transform, rgbFace=None):
        self.drawn.append(path.get_extents(transform))
        super().draw_path(gc, path, transform, rgbFace)


def written(figure):
    """Return the words of a picture, each with the box around its letters [pixels]."""
    renderer, found, write = Watched(figure.size), [], Ink.words

    def words(ink, text, *where, **how):
        renderer.drawn.clear()
        write(ink, text, *where, **how)
        found.append((text, Bbox.union(renderer.drawn)))

    with patch.object(Ink, "words", words):
        figure.draw(renderer)
    return found


def strokes(panel):
    return [one for one in panel.things if isinstance(one, Strokes)]


def words(panel):
    return [one.text for one in panel.things if isinstance(one, Note)]


def test_shapes_are_the_outlines_of_first_to_last(run):
    figure = shapes_figure(run)
    for panel in figure.panels:
        pair = ["xyz".index(one[0]) for one in (panel.across.label, panel.upward.label)]
        segments = [one for thing in strokes(panel) for one in thing.every]
        for k, at in ((0, 0), (-2, -1)):
            assert segments[k] == pytest.approx(run.outlines["hub"][at][:, pair])
            assert segments[k + 1] == pytest.approx(run.outlines["whip"][at][:, pair])
        low, high = panel.across.low, panel.across.high
        assert all(low < one[:, 0].min() and one[:, 0].max() < high for one in segments)


def test_the_oblique_picture_is_seen_from_above_in_front(run):
    plotted = oblique(np.eye(3))
    assert plotted.T @ plotted == pytest.approx(np.eye(2), abs=1e-15)
    assert plotted[0, 0] > plotted[1, 0] > 0.0 and plotted[1, 1] > 0.0 > plotted[0, 1]
    assert plotted[2] == pytest.approx([0.0, plotted[2, 1]]) and plotted[2, 1] > 0.0
    (panel,) = oblique_shapes(run).panels
    floor, shadows, shapes, *_ = strokes(panel)
    assert shapes.every[0] == pytest.approx(oblique(run.outlines["hub"][0]))
    under = run.outlines["hub"][0].copy()
    under[:, 2] = shadows.every[0][0, 1]  # any height: below means straight below
    assert shadows.every[0][:, 0] == pytest.approx(oblique(under)[:, 0])
    assert floor.every[0].shape == (2, 2)
    arrows = [one for one in panel.things if isinstance(one, Arrow)]
    along = np.array([one.end - one.begin for one in arrows])
    size = np.linalg.norm(plotted[2]) / np.linalg.norm(along[2])
    assert size * along == pytest.approx(plotted), "x, y and z of the ground"


@pytest.mark.parametrize(("name", "jump"), [("rotation", np.pi), ("quaternion", 1.0)])
def test_where_a_turn_has_several_values_its_curve_is_broken(run, name, jump):
    (panel,) = time_figures(run)[name].panels
    curves = np.array([line.points[:, 1] for line in panel.curves])
    assert np.isnan(curves).any(axis=0).sum() == np.isnan(curves).all(axis=0).sum() > 0
    steps = np.linalg.norm(np.diff(curves, axis=1), axis=0)
    assert np.nanmax(steps) < 0.5 * jump
    shown = curves[:, ~np.isnan(curves[0])]
    assert shown == pytest.approx(np.array([c.values for c in run.channels if f".{name}_" in c.name]))


def test_vectors_of_several_subjects_have_a_row_for_each_component(run):
    figures = time_figures(run)
    rows = figures["velocity"].panels
    assert [row.upward.label for row in rows] == [f"{name} [m/s]" for name in ("vx", "vy", "vz")]
    assert all([line.label for line in row.curves] == ["whip.tip", "hub"] for row in rows)
    (row,) = figures["joint_force"].panels
    assert [line.label for line in row.curves] == [f"ball.force_{one}" for one in "xyz"]


def test_labels_of_a_narrow_view_do_not_touch(run):
    """A point that goes round in a plane."""
    angle = np.linspace(0.0, 6.0, len(run.t))
    circle = (0.0 * angle, 0.1 + 0.08 * np.sin(angle), 0.12 + 0.08 * np.cos(angle))
    channels = tuple(Channel(f"whip.tip.{k}", "m", one) for k, one in zip("xyz", circle, strict=True))
    figure = track_figure(replace(run, channels=channels))
    for panel in figure.panels:
        left, bottom, right, _ = DPI * np.array(panel.frame)
        below = [box for text, box in written(figure) if text in panel.across.words]
        row = [box for box in below if bottom - 25 < box.y0 < bottom and left < box.x1 and box.x0 < right]
        assert len(row) == len(panel.across.words) > 0
        assert all(left.x1 < right.x0 for left, right in pairwise(row)), panel.across.label


def test_what_is_zero_but_for_rounding_is_drawn_as_zero(run):
    """Spikes of 1e-29 N are no result, and no small force beside a large one either; residuals are left."""
    noise = np.sin(np.arange(len(run.t)))
    channels = (
        Channel("ball.force_y", "N", 1e-29 * noise),
        Channel("hub.vx", "m/s", 1e-16 * noise),
        Channel("hub.vy", "m/s", 2.0 + 1e-15 * noise),
        Channel("whip.tip.deflection_y", "m", 1e-9 * noise),
        Channel("hub.x", "m", noise),
        Channel("constraint.position", "m", 1e-16 * noise),
    )
    figures = time_figures(replace(run, channels=channels))
    (force,) = figures["joint_force"].panels
    assert not force.curves[0].points[:, 1].any() and force.upward[:2] == (-1.0, 1.0)
    assert "zero" in words(force)
    (panel,) = figures["velocity"].panels
    across, along = (line.points[:, 1] for line in panel.curves)
    assert not across.any() and np.ptp(along) == 0.0 and along[0] == pytest.approx(2.0)
    for name, size in (("deflection", 1e-9), ("constraint", 1e-16)):
        (panel,) = figures[name].panels
        assert panel.curves[0].points[:, 1] == pytest.approx(size * noise) and not words(panel)


def drawn(run, **channels):
    """Return what is drawn of a run with other channels: name to values."""
    own = tuple(Channel(name.replace("__", "."), unit, values) for name, (unit, values) in channels.items())
    return time_figures(replace(run, channels=own))


def test_a_small_change_of_a_large_value_is_told_in_its_label(run):
    change = 6e-9 * np.sin(np.arange(len(run.t)))
    (panel,) = drawn(run, energy__total=("J", 11.25 + change))["energy"].panels
    assert panel.upward.label == "energy \N{MINUS SIGN} 11.25 J [1e-9 J]"
    assert {"0", "5", "\N{MINUS SIGN}5"} & set(panel.upward.words)
    assert panel.curves[0].points[:, 1] == pytest.approx(11.25 + change, rel=1e-15)
    (panel,) = drawn(run, energy__total=("J", 3e7 * change / 6e-9))["energy"].panels
    assert panel.upward.label == "energy [1e6 J]"
    k = panel.upward.words.index("20")
    assert panel.upward.ticks[k] == pytest.approx(2e7)


def test_curves_that_coincide_are_dashed_and_others_are_not(run):
    wave = np.sin(6.0 * run.t)
    figures = drawn(
        run,
        hub__x=("m", wave),
        hub__y=("m", 0 * wave),
        whip__tip__x=("m", wave + 1e-6),
        whip__tip__y=("m", wave),
    )
    rows = figures["position"].panels
    assert [[bool(line.pen.dashes) for line in row.curves] for row in rows] == [[False, True], [False] * 2]
    assert rows[0].curves[1].points[:, 1] == pytest.approx(wave + 1e-6)


def test_what_a_failed_run_ends_in_is_marked_as_off_scale(run):
    calm = np.sin(20.0 * run.t)
    wild = calm.copy()
    wild[-3:] = 1e3, 1e6, 1e9
    failed = replace(run, status="failed", failure={"time": float(run.t[-1])})
    figures = drawn(failed, whip__tip__deflection=("m", wild), hub__deflection=("m", calm))
    (panel,) = figures["deflection"].panels
    low, high, *_ = panel.upward
    assert -4.0 < low < high < 4.0
    assert words(panel) == ["off scale"]
    (mark,) = (one for one in panel.things if isinstance(one, Curve) and one.mark)
    assert mark.mark.shape == "^" and not mark.clipped
    assert mark.points.tolist() == [[run.t[-1], high]]
    (panel,) = drawn(run, whip__tip__deflection=("m", wild))["deflection"].panels
    assert panel.upward.high > 1e9 and not words(panel), "a run that is done has no bounds"


def test_each_of_several_bodies_has_its_colour_paler_the_earlier(run):
    figure = shapes_figure(run)
    colours = np.array([one.pen.colour for one in strokes(figure.panels[0])])
    hub, whip = colours[0::2], colours[1::2]
    assert hub[-1][:3] == pytest.approx(to_rgb(colour(0))) and whip[-1][:3] == pytest.approx(
        to_rgb(colour(1))
    )
    assert (np.diff(hub[:, :3].sum(axis=1)) < 0.0).all() and (np.diff(whip[:, :3].sum(axis=1)) < 0.0).all()
    assert {name: own.pen.colour for name, own in figure.legend.items()} == {
        "hub": tuple(hub[-1]),
        "whip": tuple(whip[-1]),
    }
    alone = replace(run, outlines={"hub": run.outlines["hub"]})
    assert not shapes_figure(alone).legend


def test_shapes_do_not_pile_up():
    """A rod that hardly moves, then turns, then comes back to where it was."""
    angle = np.concatenate(
        [np.linspace(0.0, 0.01, 100), np.linspace(0.01, 3.0, 50), np.linspace(3.0, 0.02, 50)]
    )
    ends = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.stack([0.0 * ends, ends], axis=1)
    frames = apart(points, 20)
    assert frames[0] == 0 and frames[-1] == len(angle) - 1 and 8 <= len(frames) <= 20
    assert np.sum(frames < 100) == 1, "what hardly moves is drawn once"
    inner = points[frames[:-1], 1]
    gaps = np.linalg.norm(inner[:, None] - inner, axis=-1)[np.triu_indices(len(inner), 1)]
    assert gaps.min() > 0.03 * 2.0
    assert apart(np.repeat(points[:1], 5, axis=0), 20).tolist() == [0, 4]


def test_signs_that_the_font_lacks_are_drawn_without_a_word(run, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert save(time_figures(replace(run, name="\N{CJK UNIFIED IDEOGRAPH-6F22}")), tmp_path)


@pytest.mark.parametrize("size", [1, 60])
def test_titles_legends_and_labels_stay_apart(run, size):
    name = "pendulum_of_a_long_name " * (1 + size // 12)
    body = "b" * size
    channels = tuple(c._replace(name=c.name.replace("whip", body)) for c in run.channels)
    other = replace(run, name=name, channels=channels)
    figures = [
        *time_figures(other).values(),
        track_figure(other),
        shapes_figure(other),
        oblique_shapes(other),
    ]
    for figure in figures:
        assert_apart(figure)


def assert_apart(figure):
    """Assert that all words of a picture are there, and lie neither outside nor on one another."""
    found = written(figure)
    assert {*figure.title, *figure.legend} <= {text for text, _ in found}
    boxes = [box.padded(1.0) for _, box in found]
    boxes += [Bbox.from_extents(*(DPI * np.array(one.frame))) for one in figure.panels if one.framed]
    width, height = DPI * np.array(figure.size)
    for k, box in enumerate(boxes):
        assert 0.0 <= box.x0 < box.x1 <= width and 0.0 <= box.y0 < box.y1 <= height, "nothing is cut off"
        over = [one for one in boxes[k + 1 :] if box.overlaps(one)]
        assert not over, (found[k][0], figure.title)


def test_every_curve_of_very_many_can_be_told_apart(run):
    """Thirty, five times as many as there are colours, of which some coincide."""
    wave = np.sin(6.0 * run.t)
    figure = drawn(run, **{f"link{k}__speed": ("m/s", wave * (k // 2)) for k in range(30)})["velocity"]
    assert len({(one.pen.colour, one.pen.dashes) for one in figure.legend.values()}) == 30
    assert_apart(figure)
    points = {f"link{k}__{axis}": ("m", wave + k) for k in range(10) for axis in "xyz"}
    channels = tuple(Channel(name.replace("__", "."), *one) for name, one in points.items())
    figure = track_figure(replace(run, channels=channels))
    pens = [one.pen for label, one in figure.legend.items() if label not in ("start", "end")]
    assert len(set(pens)) == 10 and [bool(pen.dashes) for pen in pens] == [False] * 6 + [True] * 4


def test_channels_of_several_units_share_no_colour(run):
    wave = np.sin(6.0 * run.t)
    figure = drawn(run, constraint__position=("m", wave), constraint__velocity=("m/s", wave))["constraint"]
    assert len(figure.panels) == 2 and len({one.pen.colour for one in figure.legend.values()}) == 2


def test_labels_longer_than_their_axes_are_broken(run):
    wave = np.sin(6.0 * run.t)
    names = [f"{body}__angular_velocity_{axis}" for body in ("hub", "whip") for axis in "xyz"]
    figure = drawn(run, **{name: ("rad/s", 1e-6 * wave) for name in names})["angular_velocity"]
    assert_apart(figure)
    assert [text for text, _ in written(figure)].count("[1e-6 rad/s]") == 3


def test_text_is_broken_into_what_fits():
    label = "max(bob_of_a_long_name.angular_velocity) [1e-6 rad/s]"
    for wide in (6.0, 2.0, 1.5):
        lines, size = fitted(label, wide)
        assert "".join(lines).replace(" ", "") == label.replace(" ", "") and size == 10.0
        assert max(text_width(line) for line in lines) <= wide
        assert any("[1e-6 rad/s]" in line for line in lines)
    lines, size = fitted("w" * 50, 2.0)
    assert lines == ["w" * 50] and text_width(lines[0], size) == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("write", [set_title, set_title_above])
def test_titles_of_figures_are_as_wide_as_these(write):
    figure = new_figure((6.0, 3.0))
    figure.subplots()
    write(figure, "a_deck_of_a_name_that_somebody_thought_would_be_fine_for_a_tether, exact: some modes")
    FigureCanvasAgg(figure).draw()
    (title,) = (one for one in figure.findobj(Text) if "deck" in one.get_text())
    box = title.get_window_extent()
    assert 0.0 <= box.x0 < box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1


def test_a_single_row_has_no_pictures_against_time(run, tmp_path):
    first = replace(
        run,
        t=run.t[:1],
        channels=tuple(one._replace(values=one.values[:1]) for one in run.channels),
        outline_t=run.outline_t[:1],
        outlines={body: points[:1] for body, points in run.outlines.items()},
        fine=None,
    )
    assert draw_run(first, tmp_path) == ["shapes.png", "oblique.png"]
    assert shapes_figure(first).bar is None and shapes_figure(run).bar is not None


def test_words_are_drawn_letter_by_letter_as_the_library_lays_them_out():
    """The same letters, about as wide; others than plain ones go to the library whole."""
    for text in ("energy \N{MINUS SIGN} 11.25 J [1e-9 J]", "hub.angular_velocity", "0.25"):
        ours, theirs = RendererAgg(400, 40, DPI), RendererAgg(400, 40, DPI)
        Ink(ours).words(text, 0.1, 0.1)
        theirs.draw_text(theirs.new_gc(), 11, 29, text, FontProperties(size=10.0), 0.0)
        wide, _, _ = theirs.get_text_width_height_descent(text, FontProperties(size=10.0), False)
        assert text_width(text) * DPI == pytest.approx(wide, abs=3.0)
        dark = [255.0 - np.asarray(one.buffer_rgba())[..., 3].astype(float) for one in (ours, theirs)]
        rows = [255.0 - one.mean(axis=1) for one in dark]
        assert rows[0] == pytest.approx(rows[1], abs=0.1 * rows[1].max()), text
    assert not plain("\u4e2d") and not plain("a\tb") and plain("100 % $x_$")


def test_pictures_of_a_run_need_no_figures_of_the_library():
    """They take longer to import, and several times as long to draw."""
    code = "import sys, hfsim.output.plots.run\nprint('matplotlib.figure' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "False\n"
