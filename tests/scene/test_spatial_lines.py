# ruff: noqa: E501
"""Beams without sections in space: what they cannot hold or bear is told, what has no meaning is refused."""

import numpy as np
import pytest
from called import call

from hfsim.errors import DeckError
from hfsim.maths.rotations import rotation, smallest_rotation
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

DECK = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {{steel: {{density: 7800.0, youngs_modulus: 2.1e9}}}}
sections: {{bar: {{area: 1.0e-4, second_moment: 1.0e-9}}}}
bodies:
  rod: {{type: beam, element: cable, material: steel, section: bar, length: 1.0, elements: 1}}
  bob: {{type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.01], points: {{top: [-0.1, 0.0, 0.0]}}}}
joints:
  clamp: {{{clamp}}}
  mount: {{{mount}}}
{more}
solve: {{duration: 0.01}}
output: {{channels: [bob.x]}}
"""
CLAMP = "type: fixed, between: [ground, rod.root]"
HINGE = "type: revolute, between: [ground, rod.root], axis: [0.0, 1.0, 0.0]"
WELD, BALL = "type: fixed, between: [rod.tip, bob.top]", "type: spherical, between: [rod.tip, bob.top]"
ACROSS = "type: revolute, between: [rod.tip, bob.top], axis: [0.0, 1.0, 0.0]"
ALONG = "type: revolute, between: [rod.tip, bob.top], axis: [1.0, 0.0, 0.0]"
CARDAN = "type: universal, between: [rod.tip, bob.top], axes: [[0, 1, 0], [0, 0, 1]]"


def deck(clamp=CLAMP, mount=WELD, more=""):
    return parse_deck(DECK.format(clamp=clamp, mount=mount, more=more), "rod.yaml")


@pytest.mark.parametrize(
    ("clamp", "mount", "free", "told"),
    [
        (CLAMP, WELD, 1, True),
        (HINGE, WELD, 2, True),
        (CLAMP, ACROSS, 2, True),
        (CLAMP, CARDAN, 3, True),
        (CLAMP, ALONG, 1, False),
        (CLAMP, BALL, 3, False),
        ("type: spherical, between: [ground, rod.root]", WELD, 3, False),
    ],
)
def test_torsion_that_joints_would_need_is_told(clamp, mount, free, told):
    """Of a body on a line, the turn about the line is free; where nothing would hold it, none is told."""
    built = build(deck(clamp, mount))
    assert sum(motion.number for motion in built.free_motions) == free
    (*_, warning) = built.warnings or [""]
    assert ("joints.mount (line 10): 'rod', a line without sections, bears no torsion" in warning) == told


def test_a_line_on_a_body_that_turns_needs_no_torsion():
    hinge, weld = HINGE.replace("rod.root", "bob"), "type: fixed, between: [bob.top, rod.root]"
    text = DECK.format(clamp=hinge, mount=weld, more="")
    assert build(parse_deck(text)).warnings == []


@pytest.mark.parametrize("command", ["check", "plan", "run"])
def test_commands_warn_of_what_a_line_does_not_bear(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    more = "loads: {twist: {type: moment, at: rod.tip, moment: [2.0, 0.0, 1.0]}}"
    (tmp_path / "rod.yaml").write_text(DECK.format(clamp=CLAMP, mount=WELD, more=more))
    done = call(command, "rod.yaml")
    assert done.exit_code == 0
    assert "joints.mount (line 10)" in done.stderr
    assert "loads.twist (line 11): 2 N m would twist 'rod', a line" in done.stderr
    assert "take element: cosserat" in done.stderr


@pytest.mark.parametrize("axis", ["[1.0, 1.0, 0.0]", "[1.0, 0.0, 1.0e-3]"])
def test_a_hinge_askew_to_a_line_is_refused(axis):
    with pytest.raises(DeckError, match="a line without sections has its tangent alone"):
        deck(HINGE.replace("[0.0, 1.0, 0.0]", axis))


def test_the_axis_of_a_hinge_is_seen_in_the_orientation_stated():
    turned = "initial: {rod: {orientation: {x: [0.0, 1.0, 0.0], y: [-1.0, 0.0, 0.0]}}}"
    with pytest.raises(DeckError, match="without sections"):
        deck(HINGE.replace("[0.0, 1.0, 0.0]", "[1.0, 1.0, 0.0]"), BALL, turned)
    build(deck(HINGE.replace("[0.0, 1.0, 0.0]", "[0.0, 1.0, 0.0]"), BALL, turned))


CHAIN = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {steel: {density: 7800.0, youngs_modulus: 2.0e8}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies:
  a: {type: beam, element: cable, material: steel, section: bar, length: 0.5, elements: 2}
  b: {type: beam, element: cable, material: steel, section: bar, length: 0.5, elements: 2}
joints:
  clamp: {type: fixed, between: [ground, a.root], orientation: {x: [1, 2, 0], y: [0, 0, 1]}}
  weld: {type: fixed, between: [a.tip, b.root]}
solve: {duration: 0.3, tolerance: 1.0e-8}
output:
  interval: 0.03
  channels: [b.tip.x, b.tip.z, weld.moment_x, weld.moment_y, weld.moment_z, constraint.position]
"""


def test_two_lines_welded_in_line_bend_as_one():
    """In space as in the plane; nothing but their direction goes on, not the stretch of their slopes."""
    run = simulate(parse_deck(CHAIN), error_estimate=False)
    plane = CHAIN.replace("[0.0, 0.0, -9.81]", "[0.0, -9.81]")
    plane = plane.replace(", orientation: {x: [1, 2, 0], y: [0, 0, 1]}", "")
    plane = plane.replace("tip.z", "tip.y").replace("moment_x, weld.moment_y, weld.moment_z", "moment")
    other = simulate(parse_deck(plane), error_estimate=False)
    x, z, mx, my, mz, gap = (channel.values for channel in run.channels)
    px, pz, moment, _ = (channel.values for channel in other.channels)
    scale = np.abs(px).max()
    assert z.min() < -0.3
    assert x * np.sqrt(5.0) == pytest.approx(px, abs=2e-7 * scale)
    assert z == pytest.approx(pz, abs=2e-7 * scale)
    assert (mx * 2.0 - my) / np.sqrt(5.0) == pytest.approx(moment, abs=2e-5 * np.abs(moment).max())
    assert mz == pytest.approx(0.0 * mz, abs=1e-9)
    assert np.abs(gap).max() < 1e-12
    assert run.statistics["energy_drift"] < 1e-9


ROLLED = "orientation: {rotation_vector: [0.4, 0.5, 0.6]}"


@pytest.mark.parametrize(("clamp", "more", "path"), [
    (f"{CLAMP}, {ROLLED}", "", "joints.clamp.orientation"),
    (BALL.replace("rod.tip, bob.top", "ground, rod.root"), f"initial: {{rod: {{{ROLLED}}}}}", "initial.rod.orientation"),
])  # fmt: skip
def test_a_stated_roll_of_a_line_is_told_where_a_channel_would_show_it(clamp, more, path):
    """Channels have the ground's y and z, as the smallest rotation to the tangent takes them along."""
    text = DECK.format(clamp=clamp, mount=WELD, more=more)
    asked = text.replace("channels: [bob.x]", "channels: [rod.tip.deflection_y, rod.root.shear_force_z]")
    (told,) = (one for one in build(parse_deck(asked, "rod.yaml")).warnings if "rolls" in one)
    assert told.startswith(path) and "'rod.tip.deflection_y'" in told
    axes = rotation(np.array([0.4, 0.5, 0.6]))
    own = smallest_rotation(np.eye(3)[0], axes[:, 0])
    degrees = float(told.split(" by ")[1].split(" deg")[0])
    assert degrees == pytest.approx(np.degrees(np.arccos(own[:, 1] @ axes[:, 1])), abs=1e-2)
    for silent in (text, asked.replace(ROLLED, "orientation: {axis: [0, 1, 1], angle: 0.7}")):
        assert not any("rolls" in one for one in build(parse_deck(silent, "rod.yaml")).warnings)


@pytest.mark.parametrize("model", ["exact", "ancf", "lowOrder", "linear"])
def test_channels_across_a_line_have_the_axes_that_the_manual_states(model):
    axes = rotation(np.array([0.4, 0.5, 0.6]))
    own = smallest_rotation(np.eye(3)[0], axes[:, 0])
    force = 1e-3 * axes[:, 1]
    load = f"loads: {{push: {{type: force, at: rod.tip, force: {force.tolist()}}}}}\ninitial: {{equilibrium: true}}"
    channels = [f"rod.root.{kind}_{axis}" for kind in ("shear_force", "bending_moment") for axis in "yz"]
    text = DECK.format(clamp=f"{CLAMP}, {ROLLED}", mount=WELD, more=load).replace("-9.81", "0.0").replace("elements: 1", f"elements: 2, model: {model}")
    lines = [line for line in text.splitlines() if not line.startswith(("  bob", "  mount"))]
    deck = "\n".join(lines).replace("[bob.x]", f"[{', '.join(channels)}]")
    found = [channel.values[0] for channel in simulate(parse_deck(deck, "rod.yaml")).channels]
    across = force @ own
    assert found == pytest.approx([across[1], across[2], -across[2], across[1]], abs=1e-8)
