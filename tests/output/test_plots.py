"""Pictures of runs in space: what is drawn is what was computed, to one scale in all views."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb

from hfsim.marching.solution import Channel
from hfsim.output.plots.history import time_figures
from hfsim.output.plots.run import draw_run
from hfsim.output.plots.sheet import tick_words
from hfsim.output.plots.space import oblique, oblique_shapes, spatial_path, spatial_shapes
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


@pytest.mark.parametrize("draw", [spatial_path, spatial_shapes])
def test_views_share_one_scale_and_stand_in_line(run, draw):
    figure = draw(run)
    FigureCanvasAgg(figure).draw()
    views = {(axes.get_xlabel()[0], axes.get_ylabel()[0]): axes for axes in figure.axes[:3]}
    assert set(views) == {("x", "y"), ("x", "z"), ("y", "z")}
    metres = [axes.transData.transform([[0, 0], [1, 0], [0, 1]]) for axes in views.values()]
    sizes = [np.linalg.norm(ends[1:] - ends[0], axis=1) for ends in metres]
    assert np.array(sizes) == pytest.approx(np.full((3, 2), sizes[0][0]), rel=1e-3)
    above, front, right = (views[pair].get_window_extent() for pair in (("x", "y"), ("x", "z"), ("y", "z")))
    assert (above.x0, above.x1) == pytest.approx((front.x0, front.x1), abs=1.0)
    assert (right.y0, right.y1) == pytest.approx((front.y0, front.y1), abs=1.0)
    assert above.y0 > front.y1 and right.x0 > front.x1


def test_paths_are_the_channels(run):
    columns = {channel.name: channel.values for channel in run.channels}
    for axes in spatial_path(run).axes:
        names = axes.get_xlabel()[0], axes.get_ylabel()[0]
        curve = next(line for line in axes.lines if line.get_label() == "whip.tip")
        track = np.array([columns[f"whip.tip.{one}"] for one in names])
        x, y = curve.get_data()
        assert np.array([x, y]) == pytest.approx(track)


def collections(axes):
    return [one for one in axes.collections if isinstance(one, LineCollection)]


def test_shapes_are_the_outlines_of_first_to_last(run):
    figure = spatial_shapes(run)
    for axes in figure.axes[:3]:
        pair = ["xyz".index(one[0]) for one in (axes.get_xlabel(), axes.get_ylabel())]
        (lines,) = collections(axes)
        segments = lines.get_segments()
        for k, at in ((0, 0), (-2, -1)):
            assert segments[k] == pytest.approx(run.outlines["hub"][at][:, pair])
            assert segments[k + 1] == pytest.approx(run.outlines["whip"][at][:, pair])
        low, high = axes.get_xlim()
        assert all(low < one[:, 0].min() and one[:, 0].max() < high for one in segments)


def test_the_oblique_picture_is_seen_from_above_in_front(run):
    plotted = oblique(np.eye(3))
    assert plotted.T @ plotted == pytest.approx(np.eye(2), abs=1e-15)
    assert plotted[0, 0] > plotted[1, 0] > 0.0 and plotted[1, 1] > 0.0 > plotted[0, 1]
    assert plotted[2] == pytest.approx([0.0, plotted[2, 1]]) and plotted[2, 1] > 0.0
    floor, *shadows, shapes = collections(oblique_shapes(run).axes[0])
    assert shapes.get_segments()[0] == pytest.approx(oblique(run.outlines["hub"][0]))
    under = run.outlines["hub"][0].copy()
    under[:, 2] = shadows[0].get_segments()[0][0, 1]  # any height: below means straight below
    assert shadows[0].get_segments()[0][:, 0] == pytest.approx(oblique(under)[:, 0])
    assert floor.get_segments()[0].shape == (2, 2)


@pytest.mark.parametrize(("name", "jump"), [("rotation", np.pi), ("quaternion", 1.0)])
def test_where_a_turn_has_several_values_its_curve_is_broken(run, name, jump):
    (axes,) = time_figures(run)[name].axes
    curves = np.array([line.get_ydata() for line in axes.lines])
    assert np.isnan(curves).any(axis=0).sum() == np.isnan(curves).all(axis=0).sum() > 0
    steps = np.linalg.norm(np.diff(curves, axis=1), axis=0)
    assert np.nanmax(steps) < 0.5 * jump
    shown = curves[:, ~np.isnan(curves[0])]
    assert shown == pytest.approx(np.array([c.values for c in run.channels if f".{name}_" in c.name]))


def test_vectors_of_several_subjects_have_a_row_for_each_component(run):
    figures = time_figures(run)
    rows = figures["velocity"].axes
    assert [axes.get_ylabel() for axes in rows] == [f"{name} [m/s]" for name in ("vx", "vy", "vz")]
    assert all([line.get_label() for line in axes.lines] == ["whip.tip", "hub"] for axes in rows)
    (axes,) = figures["joint_force"].axes
    assert [line.get_label() for line in axes.lines] == [f"ball.force_{one}" for one in "xyz"]


def test_labels_of_a_narrow_view_do_not_touch(run):
    """A point that goes round in a plane."""
    angle = np.linspace(0.0, 6.0, len(run.t))
    circle = (0.0 * angle, 0.1 + 0.08 * np.sin(angle), 0.12 + 0.08 * np.cos(angle))
    channels = tuple(Channel(f"whip.tip.{k}", "m", one) for k, one in zip("xyz", circle, strict=True))
    figure = spatial_path(replace(run, channels=channels))
    FigureCanvasAgg(figure).draw()
    for axes in figure.axes[:3]:
        boxes = [label.get_window_extent() for label in axes.get_xticklabels() if label.get_text()]
        assert all(left.x1 < right.x0 for left, right in pairwise(boxes)), axes.get_xlabel()


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
    (force,) = figures["joint_force"].axes
    assert not force.lines[0].get_ydata().any() and force.get_ylim() == (-1.0, 1.0)
    assert "zero" in [text.get_text() for text in force.texts]
    (axes,) = figures["velocity"].axes
    across, along = (line.get_ydata() for line in axes.lines)
    assert not across.any() and np.ptp(along) == 0.0 and along[0] == pytest.approx(2.0)
    for name, size in (("deflection", 1e-9), ("constraint", 1e-16)):
        (axes,) = figures[name].axes
        assert axes.lines[0].get_ydata() == pytest.approx(size * noise) and not axes.texts


def drawn(run, **channels):
    """Return what is drawn of a run with other channels: name to values."""
    own = tuple(Channel(name.replace("__", "."), unit, values) for name, (unit, values) in channels.items())
    return time_figures(replace(run, channels=own))


def test_a_small_change_of_a_large_value_is_told_in_its_label(run):
    change = 6e-9 * np.sin(np.arange(len(run.t)))
    (axes,) = drawn(run, energy__total=("J", 11.25 + change))["energy"].axes
    assert axes.get_ylabel() == "energy \N{MINUS SIGN} 11.25 J [1e-9 J]"
    assert {"0", "5", "\N{MINUS SIGN}5"} & set(tick_words(axes.yaxis))
    assert axes.lines[0].get_ydata() == pytest.approx(11.25 + change, rel=1e-15)
    (axes,) = drawn(run, energy__total=("J", 3e7 * change / 6e-9))["energy"].axes
    assert axes.get_ylabel() == "energy [1e6 J]"
    assert "20" in tick_words(axes.yaxis)
    FigureCanvasAgg(axes.figure).draw()
    assert not axes.yaxis.get_offset_text().get_text()


def test_curves_that_coincide_are_dashed_and_others_are_not(run):
    wave = np.sin(6.0 * run.t)
    figures = drawn(
        run,
        hub__x=("m", wave),
        hub__y=("m", 0 * wave),
        whip__tip__x=("m", wave + 1e-6),
        whip__tip__y=("m", wave),
    )
    rows = figures["position"].axes
    assert [[line.get_linestyle() for line in axes.lines] for axes in rows] == [["-", "--"], ["-", "-"]]
    assert rows[0].lines[1].get_ydata() == pytest.approx(wave + 1e-6)


def test_what_a_failed_run_ends_in_is_marked_as_off_scale(run):
    calm = np.sin(20.0 * run.t)
    wild = calm.copy()
    wild[-3:] = 1e3, 1e6, 1e9
    failed = replace(run, status="failed", failure={"time": float(run.t[-1])})
    (axes,) = drawn(failed, whip__tip__deflection=("m", wild), hub__deflection=("m", calm))["deflection"].axes
    low, high = axes.get_ylim()
    assert -4.0 < low < high < 4.0
    assert [text.get_text() for text in axes.texts] == ["off scale"]
    mark = next(line for line in axes.lines if line.get_marker() == "^")
    assert mark.get_xdata()[0] == run.t[-1] and mark.get_ydata()[0] == high
    (axes,) = drawn(run, whip__tip__deflection=("m", wild))["deflection"].axes
    assert axes.get_ylim()[1] > 1e9 and not axes.texts, "a run that is done has no bounds"


def test_each_of_several_bodies_has_its_colour_paler_the_earlier(run):
    (lines,) = collections(spatial_shapes(run).axes[0])
    hub, whip = lines.get_colors()[0::2], lines.get_colors()[1::2]
    assert hub[-1][:3] == pytest.approx(to_rgb(colour(0))) and whip[-1][:3] == pytest.approx(
        to_rgb(colour(1))
    )
    assert (np.diff(hub[:, :3].sum(axis=1)) < 0.0).all() and (np.diff(whip[:, :3].sum(axis=1)) < 0.0).all()
    names = [text.get_text() for text in spatial_shapes(run).legends[0].get_texts()]
    assert names == ["hub", "whip"]
    alone = replace(run, outlines={"hub": run.outlines["hub"]})
    assert not spatial_shapes(alone).legends


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


@pytest.mark.parametrize("size", [1, 60])
def test_titles_legends_and_labels_stay_apart(run, size):
    name = "pendulum_of_a_long_name " * (1 + size // 12)
    body = "b" * size
    channels = tuple(c._replace(name=c.name.replace("whip", body)) for c in run.channels)
    other = replace(run, name=name, channels=channels)
    figures = [
        *time_figures(other).values(),
        spatial_path(other),
        spatial_shapes(other),
        oblique_shapes(other),
    ]
    for figure in figures:
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        (title,) = (text for text in figure.texts if text.get_text().startswith("pendulum"))
        boxes = [title.get_window_extent(), *(axes.get_tightbbox() for axes in figure.axes)]
        boxes += [legend.get_window_extent() for legend in figure.legends]
        whole = figure.bbox
        for k, box in enumerate(boxes):
            assert box.x0 >= whole.x0 - 1 and box.x1 <= whole.x1 + 1, "nothing is cut off"
            assert box.y0 >= whole.y0 - 1 and box.y1 <= whole.y1 + 1
            for one in boxes[k + 1 :]:
                wide = min(box.x1, one.x1) - max(box.x0, one.x0)
                high = min(box.y1, one.y1) - max(box.y0, one.y0)
                assert min(wide, high) <= 1.0, title.get_text()
