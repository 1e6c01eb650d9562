"""Joints hold curved and twisted beams between nodes as they are undeformed: interpolated."""

import numpy as np
import pytest
import yaml

import hfsim
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

ARC = yaml.safe_load("""
hfsim: 1
gravity: [0, 0, 0]
sections:
  s: {mass_per_length: 1.0, rotary_inertia: [2.0e-4, 1.0e-4, 1.0e-4], axial_stiffness: 1.0e5,
      shear_stiffness: [3.0e4, 3.0e4], torsion_stiffness: 10, bending_stiffness: [12, 12]}
bodies:
  beam: {type: beam, section: s, degree: 2, elements: 1, element: cosserat, points: {mid: [0.25, 0.01, 0.02]}}
  load: {type: rigid, mass: 0.2, inertia: [0.01, 0.01, 0.01]}
joints:
  c: {type: fixed, between: [ground, beam.root]}
  w: {type: fixed, between: [beam.mid, load]}
solve: {duration: 0.1}
""")
LINES = {
    "arc": {"axis": {"arc": {"radius": 1.0, "angle": 0.7}}},
    "twisted": {"length": 0.7, "twist": 0.9},
    "spatial": {
        "axis": {"points": [[0, 0, 0], [0.2, 0.1, 0.05], [0.4, 0.15, 0.2], [0.5, 0.1, 0.4]]},
        "twist": 0.5,
    },
}
TILTED = {"type": "revolute", "axis": [0.3, 0.5, 1.0]}
PLANAR_SECTION = {
    "mass_per_length": 1.0, "rotary_inertia": 2.0e-4,
    "axial_stiffness": 1.0e5, "shear_stiffness": 3.0e4, "bending_stiffness": 12,
}  # fmt: skip


def built(line, joint=None, model="exact", plane=False):
    """The scene of a beam that is held at its root and carries a load between nodes."""
    deck = {**ARC, "bodies": {**ARC["bodies"]}, "joints": {**ARC["joints"]}}
    beam = deck["bodies"]["beam"] = {**deck["bodies"]["beam"], **line, "model": model}
    deck["joints"]["w"] = {**deck["joints"]["w"], **(joint or {})}
    if plane:
        beam["points"] = {"mid": [0.25, 0.01]}
        deck["bodies"]["load"] = {**deck["bodies"]["load"], "inertia": 0.01}
        deck |= {"gravity": [0, 0], "sections": {"s": PLANAR_SECTION}}
    return build(parse_deck(yaml.safe_dump(deck)))


def check_undeformed(scene):
    """Hold the start of a scene against that of the beam alone."""
    x = scene.system.absolute(scene.q[None])
    assert scene.system.strain_energy(x)[0] < 1e-20
    assert not scene.assembly.changes


@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact"])
@pytest.mark.parametrize("joint", [None, TILTED], ids=["fixed", "tilted"])
@pytest.mark.parametrize("line", LINES.values(), ids=LINES.keys())
def test_a_start_between_nodes_of_a_curved_beam_is_undeformed(line, joint, model):
    check_undeformed(built(line, joint, model))


def test_a_start_between_nodes_of_an_arc_in_the_plane_is_undeformed():
    check_undeformed(scene := built(LINES["arc"], plane=True))
    assert scene.assembly.poses["load"].turn == pytest.approx(0.0, abs=1e-14)


def test_points_of_straight_beams_keep_the_axes_of_their_sections():
    beam = built({"length": 0.7, "elements": 3}).bodies["beam"]
    marker = beam.marker((0.25, 0.01, 0.02))
    assert marker.level is None
    assert np.array_equal(marker.body, np.eye(3))


@pytest.mark.parametrize("line", LINES.values(), ids=LINES.keys())
def test_points_of_undeformed_beams_are_turned_as_the_body_frame_is(line):
    scene = built(line)
    x = scene.system.absolute(scene.q[None])
    for place in ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.25, 0.01, 0.02)):
        marker = scene.bodies["beam"].marker(place)
        assert marker.axes(x)[0] == pytest.approx(np.eye(3), abs=1e-13)
        assert marker.frame(x)[0] == pytest.approx(np.eye(3), abs=1e-13)


@pytest.mark.parametrize("element", ["cosserat", "cable"])
def test_distances_and_forces_along_an_axis_are_as_large_as_stated(element):
    """Of a beam that is bent, or stretched by a third: whatever its own vectors become in between."""
    beam = {"type": "beam", "element": element, "length": 0.5, "elements": 2, "points": {"mid": [0.2, 0, 0]}}
    axis, modulus = ([1.0, 0.0, 0.0], 1.0e5) if element == "cable" else ([0.6, 0.8, 0.0], 2.0e7)
    deck = {
        "hfsim": 1, "gravity": [0, 0, 0],
        "materials": {"rubber": {"density": 1000.0, "youngs_modulus": modulus}},
        "sections": {"s": {"shape": "circle", "radius": 0.012}},
        "bodies": {
            "b": {**beam, "material": "rubber", "section": "s"},
            "r": {"type": "rigid", "mass": 0.1, "inertia": [1e-3] * 3},
        },
        "joints": {
            "c": {"type": "fixed", "between": ["ground", "b.root"]},
            "led": {"type": "driver", "between": ["b.mid", "r"], "axis": axis, "position": 0.2},
            "push": {"type": "motor", "between": ["b.mid", "r"], "axis": axis, "force": 0.5},
        },
        "springs": {
            "held": {
                "type": "bushing", "between": ["b.mid", "r"], "place": [0.2 * a for a in axis],
                "stiffness": 1.0, "rotational_stiffness": 1.0,
            }
        },
        "loads": {"f": {"type": "force", "at": "b.tip", "force": [15.0, 2.0, 3.0]}},
        "solve": {"duration": 0.1},
        "output": {
            "channels": [f"{p}.{a}" for p in ("b.mid", "r") for a in "xyz"]
            + ["led.distance", *(f"push.force_{a}" for a in "xyz")]
        },
    }  # fmt: skip
    if element == "cable":  # a line has its tangent alone
        deck["springs"]["held"]["between"] = ["ground", "r"]
        deck["springs"]["held"]["place"] = [0.5, 0.0, 0.0]
    found = hfsim.static(deck).final
    force = np.array([found[f"push.force_{a}"] for a in "xyz"])
    gap = np.array([found[f"r.{a}"] - found[f"b.mid.{a}"] for a in "xyz"])
    assert np.linalg.norm(force) == pytest.approx(0.5, rel=1e-12)
    assert gap @ force / 0.5 == pytest.approx(0.2, rel=1e-9)
    assert found["led.distance"] == pytest.approx(0.2, rel=1e-9)
