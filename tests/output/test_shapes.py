"""Shapes of bodies over time as files, and snapshots: what is written is what the run has."""

import json

import numpy as np
import pytest
from called import call

import hfsim
from hfsim.output.plots.snapshots import snapshot_figures
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

DECK = """
hfsim: 1
name: whip
gravity: [0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e6}}
sections: {square: {shape: rectangle, width: 0.02, height: 0.02}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.1, points: {end: [0.3, 0.0]}}
  whip: {type: beam, material: rubber, section: square, length: 0.5, elements: 3}
joints:
  pin: {type: revolute, between: [ground, hub]}
  link: {type: revolute, between: [hub.end, whip.root]}
solve: {duration: 0.3, tolerance: 1.0e-5}
output: {interval: 0.05, snapshots: [0.25, 120 ms, 0.0, 0.25], channels: [CHANNELS]}
"""
PLANE = DECK.replace(
    "CHANNELS", "whip.tip.x, whip.tip.y, whip.tip.deflection, whip.root.axial_force, whip.root.bending_moment"
)
SPACE = (
    DECK.replace("-9.81]", "1.0, -9.81]")
    .replace("inertia: 0.1", "inertia: [0.1, 0.1, 0.1]")
    .replace("[0.3, 0.0]", "[0.3, 0.0, 0.0]")
    .replace("revolute", "spherical")
    .replace(
        "CHANNELS", "whip.tip.x, whip.tip.y, whip.tip.z, whip.tip.deflection_z, whip.root.bending_moment_y"
    )
)
SCENES = {"plane": PLANE, "space": SPACE}


def run(text, **options):
    return simulate(parse_deck(text, "whip.yaml"), error_estimate=False, **{"outlines": True, **options})


@pytest.mark.parametrize("scene", SCENES)
def test_shapes_are_written_where_the_deck_wants_them(scene, tmp_path):
    (tmp_path / "whip.yaml").write_text(SCENES[scene])
    order = ["run", str(tmp_path / "whip.yaml"), "--no-plots", "--no-error-estimate"]
    order += ["-o", str(tmp_path / "out"), "--set"]
    done = call(*order, "output.shapes=csv")
    assert done.exit_code == 0, done.output
    known = run(SCENES[scene])
    with np.load(tmp_path / "out/shapes.npz", allow_pickle=False) as arrays:
        assert set(arrays) == {"t", "points.hub", "points.whip"}
        assert arrays["t"] == pytest.approx(0.05 * np.arange(7))
        for body in ("hub", "whip"):
            assert arrays[f"points.{body}"].tobytes() == known.outlines[body].tobytes()
        tip = arrays["points.whip"][:, -1]
    head, *rows = (tmp_path / "out/shapes.csv").read_text().splitlines()
    assert head == ",".join(["t", "body", "point", *"xyz"[: known.dimension]])
    last = rows[-1].split(",")
    assert last[1] == "whip" and int(last[2]) == known.outlines["whip"].shape[1] - 1
    assert [float(one) for one in (last[0], *last[3:])] == pytest.approx([0.3, *tip[-1]], rel=1e-15)
    assert len(rows) == 7 * sum(points.shape[1] for points in known.outlines.values())
    history = np.loadtxt(tmp_path / "out/history.csv", delimiter=",", skiprows=1)
    assert history[:, 1 : 1 + known.dimension] == pytest.approx(tip, abs=1e-14)
    again = call(*order, "output.shapes=false", "--force")
    assert again.exit_code == 0 and not list((tmp_path / "out").glob("shapes.*"))
    assert "shapes.npz" not in json.loads((tmp_path / "out/summary.json").read_text())["files"]


@pytest.mark.parametrize("scene", SCENES)
def test_snapshots_are_the_channels_at_their_times(scene):
    seen = run(SCENES[scene])
    assert [shot.t for shot in seen.snapshots] == [0.0, 0.12, 0.25], "in order, each once"
    fine = run(SCENES[scene].replace("interval: 0.05", "interval: 0.01"))
    deflection, bending = [name for name in seen.units if "deflection" in name or "bending" in name]
    for shot in seen.snapshots:
        k = int(np.argmin(np.abs(fine.t - shot.t)))
        own = shot.along["whip"]
        assert shot.places["whip"][[0, -1]].tolist() == [0.0, 0.5] and "hub" not in shot.along
        tip = [fine[f"whip.tip.{one}"][k] for one in "xyz"[: seen.dimension]]
        assert shot.points["whip"][-1] == pytest.approx(tip, abs=1e-9)
        assert own[deflection.split(".")[-1]][-1] == pytest.approx(fine[deflection][k], abs=1e-8)
        assert own[bending.split(".")[-1]][0] == pytest.approx(fine[bending][k], abs=1e-6)
    assert np.abs(seen.snapshots[-1].along["whip"]["stress"]).max() > 0.0


@pytest.mark.parametrize("scene", SCENES)
def test_snapshots_have_pictures(scene):
    seen = run(SCENES[scene])
    figures = dict(snapshot_figures(seen))
    assert set(figures) == {"snapshots", "along_whip"}
    shot = seen.snapshots[1]
    rows = figures["along_whip"].panels
    acting = {kind: one for kind, one in shot.along["whip"].items() if np.abs(one).max() > 1e-9}
    for panel, (kind, values) in zip(rows, acting.items(), strict=True):
        assert panel.upward.label.startswith(kind.split("_")[0])
        line = panel.curves[1]
        assert line.label == "t = 0.12 s"
        assert line.points[:, 0] == pytest.approx(shot.places["whip"])
        assert line.points[:, 1] == pytest.approx(values, abs=1e-11 * np.abs(values).max() + 1e-11)
    curves = figures["snapshots"].panels[0].curves
    assert curves[3].points == pytest.approx(shot.points["whip"][:, :2])
    assert not dict(
        snapshot_figures(run(SCENES[scene].replace("snapshots: [0.25, 120 ms, 0.0, 0.25], ", "")))
    )


TINY = """
hfsim: 1
name: tiny
materials: {silicon: {density: 2330.0, youngs_modulus: 160 GPa}}
sections: {square: {shape: rectangle, width: 5.0e-9, height: 5.0e-9}}
bodies: {b: {type: beam, material: silicon, section: square, length: 1.0e-7, elements: 3}}
joints: {wall: {type: fixed, between: [ground, b.root]}}
loads:
  push: {type: force, at: b.tip, force: [0.0, 1.0e-9], law: {type: sine, amplitude: 1.0, frequency: 3.0e8}}
solve: {duration: 1.0e-9}
output: {channels: [b.tip.y], snapshots: [TIMES]}
"""


def test_what_is_rounding_along_a_beam_is_not_drawn():
    """By the stiffness of the section: a force of 1e-22 N is none, one of 1e-15 N is one."""
    seen = run(TINY.replace("TIMES", "0.0"))
    (shot,) = seen.snapshots
    assert 0.0 < np.abs(shot.along["b"]["axial_force"]).max() < shot.rounding["b"]["axial_force"]
    assert shot.rounding["b"]["axial_force"] == pytest.approx(1e-14 * 160e9 * 25e-18)
    (panel,) = dict(snapshot_figures(seen))["along_b"].panels
    assert not panel.curves[0].points[:, 1].any()
    later = dict(snapshot_figures(run(TINY.replace("TIMES", "0.0, 2.0e-12"))))["along_b"].panels
    assert any(panel.upward.label.startswith("bending") for panel in later)
    assert not any(panel.curves[0].points[:, 1].any() for panel in later)


def test_python_has_snapshots():
    seen = hfsim.run(hfsim.load(parse_deck(PLANE, "whip.yaml")), error_estimate=False)
    assert [shot.t for shot in seen.snapshots] == [0.0, 0.12, 0.25]
    assert seen.snapshots[0].points["hub"].shape[1] == 2
