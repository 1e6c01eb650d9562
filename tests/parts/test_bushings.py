"""Bushings: fixed joints that give, in the plane and in space, and where they let bodies start."""

from itertools import permutations

import numpy as np
import pytest
from natively import native, runs_alike
from solved import parsed

import hfsim
from hfsim.errors import DeckError
from hfsim.scene.build import build
from hfsim.studies.axes import NAMED

STIFF, TURN, OF_MOUNT = 4.0e4, 900.0, ("mount.force_y", "mount.moment")
PLANE = """
hfsim: 1
gravity: [0.0, -9.81]
ground: {points: {wall: [1.0, 0.5]}}
materials: {steel: {density: 7800, youngs_modulus: 210 GPa}}
sections: {strip: {shape: rectangle, width: 10 mm, height: 10 mm}}
bodies:
  arm: {type: beam, material: steel, section: strip, length: 1.0, elements: 2}
springs:
  foot:
    type: bushing
    between: [ground.wall, arm.root]
    stiffness: 1.0e9
    rotational_stiffness: 1.0e8
    angle: 30 deg
solve: {duration: 0.2, tolerance: 1.0e-7}
output: {interval: 0.01, channels: [arm.tip.x, arm.tip.y, arm.angle, foot.force_x, foot.force_y, foot.moment]}
"""
SPACE = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
ground: {points: {wall: [1.0, 0.5, 0.2]}}
materials: {steel: {density: 7800, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}
sections: {strip: {shape: rectangle, width: 20 mm, height: 10 mm}}
bodies:
  base: {type: rigid, mass: 5, inertia: [0.1, 0.2, 0.3], points: {rim: [0.1, 0.2, 0.3]}}
  arm: {type: beam, material: steel, section: strip, length: 0.5, elements: 1}
springs:
  foot:
    type: bushing
    between: [ground.wall, base]
    stiffness: 1.0e9
    rotational_stiffness: 1.0e8
    orientation: {axis: [1, 1, 0], angle: 40 deg}
  clamp:
    type: bushing
    between: [base.rim, arm.root]
    stiffness: [1.0e9, 2.0e9, 1.0e9]
    rotational_stiffness: [1.0e8, 1.0e8, 2.0e8]
    place: [0.01, 0.02, 0.03]
    orientation: {axis: [0, 1, 1], angle: 70 deg}
solve: {duration: 0.2, tolerance: 1.0e-6}
output: {interval: 0.02, channels: [arm.tip.x, arm.tip.z, clamp.force_z, clamp.moment_x, clamp.moment_y]}
"""
RIGID = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies: {block: {type: rigid, mass: 2.0, inertia: [0.3, 0.4, 0.5], points: {lug: [0.1, -0.2, 0.05]}}}
springs:
  mount:
    type: bushing
    between: [ground, block.lug]
    stiffness: [4.0e3, 5.0e3, 6.0e3]
    damping: 3.0
    rotational_stiffness: [90, 80, 70]
    rotational_damping: [0.2, 0.1, 0.3]
    place: [0.1, 0, 0]
initial:
  block: {position: [0.02, 0.25, -0.1], orientation: {rotation_vector: [0.2, -0.1, 0.3]}, velocity: [1, 0, 0]}
solve: {duration: 0.5, tolerance: 1.0e-8}
output: {interval: 0.05, channels: [block.x, block.y, block.rotation_z, mount.power, energy.total]}
"""


def as_fixed(text):
    """A deck with fixed joints in place of its bushings."""
    lines = [line for line in text.splitlines() if "stiffness" not in line or "bushing" in line]
    text = "\n".join(line for line in lines if "place" not in line).replace("springs:", "joints:")
    text = text.replace("stiffness: 1.0e9, rotational_stiffness: 1.0e8, ", "").replace("bushing", "fixed")
    return text.replace("rim: [0.1, 0.2, 0.3]", "rim: [0.11, 0.22, 0.33]")


@pytest.mark.parametrize("text", [PLANE, SPACE])
def test_a_stiff_one_starts_rests_and_vibrates_as_a_fixed_joint(text):
    gives, fixed = parsed(text), parsed(as_fixed(text))
    for one, other in zip(*(build(deck).assembly.poses.values() for deck in (gives, fixed)), strict=True):
        np.testing.assert_allclose(one.origin, other.origin, atol=1e-12)
        np.testing.assert_allclose(one.turn, other.turn, atol=1e-12)
    rests = [hfsim.static(deck) for deck in (gives, fixed)]
    for name in rests[0].final:
        assert rests[0].final[name] == pytest.approx(rests[1].final[name], abs=2e-6)
    stiffer = parsed(text.replace("0e9", "0e12").replace("0e8", "0e11"))
    first, second = (hfsim.modes(deck).frequencies[:4] for deck in (stiffer, fixed))
    np.testing.assert_allclose(first, second, rtol=1e-4)


@pytest.mark.parametrize("text", [PLANE, SPACE])
def test_at_rest_it_bears_the_weight_and_its_moment(text):
    soft = parsed(text.replace("1.0e9", "1.0e6").replace("1.0e8", "1.0e5"))
    found, scene = hfsim.static(soft).final, build(soft)
    n_dim = soft.deck.dimension
    name, axis = ("foot.force_y", "") if n_dim == 2 else ("clamp.force_z", "_x")
    weight = 7800 * 1e-4 * 9.81
    assert found[name] == pytest.approx(weight, rel=1e-6)
    assert abs(found[f"{name.partition('.')[0]}.moment{axis}"]) > 0.5
    assert scene.joints == {}


def test_motion_in_the_plane_is_that_of_oscillators():
    deck = {
        "hfsim": 1,
        "bodies": {"block": {"type": "rigid", "mass": 2.0, "inertia": 0.5}},
        "springs": {"mount": {
            "type": "bushing", "between": ["ground", "block"], "stiffness": [STIFF, 9 * STIFF],
            "rotational_stiffness": TURN, "place": [0.3, 0.1], "angle": 1.0,
        }},
        "initial": {"block": {"position": [0.31, 0.08], "angle": 1.1}},
        "solve": {"duration": 0.2, "tolerance": 1e-9},
        "output": {"interval": 0.01, "channels": ["block.x", "block.y", "block.angle", *OF_MOUNT]},
    }  # fmt: skip
    run = hfsim.run(parsed(deck), error_estimate=False)
    fast, faster, turn = np.sqrt(STIFF / 2.0), np.sqrt(9 * STIFF / 2.0), np.sqrt(TURN / 0.5)
    np.testing.assert_allclose(run["block.x"], 0.3 + 0.01 * np.cos(fast * run.t), atol=1e-8)
    np.testing.assert_allclose(run["block.y"], 0.1 - 0.02 * np.cos(faster * run.t), atol=1e-8)
    np.testing.assert_allclose(run["block.angle"], 1.0 + 0.1 * np.cos(turn * run.t), atol=1e-8)
    np.testing.assert_allclose(run["mount.force_y"], 9 * STIFF * 0.02 * np.cos(faster * run.t), atol=1e-3)
    np.testing.assert_allclose(run["mount.moment"], -TURN * 0.1 * np.cos(turn * run.t), atol=1e-5)


@native
@pytest.mark.parametrize("text", [PLANE, RIGID])
def test_they_are_recorded(text, monkeypatch):
    assert runs_alike(parsed(text), monkeypatch, 1e-6).statistics["energy_drift"] < 1e-5


def test_force_and_moment_are_the_slope_of_the_energy():
    text = RIGID.replace("damping: 3.0", "").replace("rotational_damping: [0.2, 0.1, 0.3]", "")
    scene, rng = build(parsed(text)), np.random.default_rng(4)
    system = scene.system
    x = system.absolute(scene.q[None])
    t, u = np.zeros(1), np.zeros_like(x)
    for part in system.forces:
        step = 1e-6 * rng.standard_normal(x.shape)
        ahead, back = part.potential_energy(t, x + step)[0], part.potential_energy(t, x - step)[0]
        force = np.zeros_like(x)
        part.add_force(t, x, u, force)
        assert float((force @ step.T)[0, 0]) == pytest.approx(0.5 * (back - ahead), rel=1e-4, abs=1e-9)
    names = ("x", "y", "z", "about_x", "about_y", "about_z")
    assert {part.item for part in system.forces} == {f"springs.mount.{name}" for name in names}


def test_angles_go_on_over_full_turns_as_they_are_stated():
    text = RIGID.replace("rotation_vector: [0.2, -0.1, 0.3]", "rotation_vector: [0, 0, 6.383185307179586]")
    scene = build(parsed(text))
    t, x = np.zeros(1), scene.system.absolute(scene.q[None])
    energy = {part.item: part.potential_energy(t, x)[0] for part in scene.system.forces}
    assert energy["springs.mount.about_z"] == pytest.approx(35 * 6.383185307179586**2)
    assert energy["springs.mount.about_x"] == pytest.approx(0.0, abs=1e-12)


CHAIN = """
hfsim: 1
ground: {points: {p: [0.5, 0.0]}}
bodies:
  a: {type: rigid, mass: 1, inertia: 0.1, points: {out: [0.3, 0]}}
  b: {type: rigid, mass: 1, inertia: 0.1, points: {in: [-0.2, 0]}}
  c: {type: rigid, mass: 1, inertia: 0.1, points: {in: [-0.1, 0], out: [0.1, 0]}}
springs:
  bc: {type: bushing, between: [b, c.in], stiffness: 1000, rotational_stiffness: 10}
  ab: {type: bushing, between: [a.out, b.in], stiffness: 1000, rotational_stiffness: 10, angle: 90 deg}
solve: {duration: 0.1}
output: {channels: [a.x, b.x, b.y, c.x, c.y, c.angle, c.vx, c.vy]}
"""


def starts(text, **changes):
    run = hfsim.run(parsed(text), {"solve.duration": 1e-3, **changes}, error_estimate=False)
    return {name: round(float(run[name][0]), 9) for name in run.units}


def test_what_hangs_on_them_starts_without_force_wherever_the_first_body_is():
    at_rest = starts(CHAIN)
    fixed = CHAIN.replace("springs:", "joints:").replace("bushing", "fixed")
    joined = starts(fixed.replace(", stiffness: 1000, rotational_stiffness: 10", ""))
    assert at_rest == joined and round(joined["c.y"] - joined["b.y"], 9) == 0.1
    turning = {"position": [1, 0], "angle": "90 deg", "angular_velocity": 2, "velocity": [0, 0]}
    moved = starts(CHAIN, **{"initial": {"a": turning}})
    assert (moved["b.x"], moved["b.y"], moved["c.angle"]) == (0.8, 0.3, 3.141592654)
    assert (moved["c.vx"], moved["c.vy"]) == (-0.6, -0.6)


def test_what_is_stated_of_a_body_comes_before_its_bushing():
    stated = starts(CHAIN, **{"initial": {"b": {"position": [7, 0]}}})
    assert (stated["a.x"], stated["b.x"], stated["c.x"]) == (6.8, 7.0, 7.1)
    both_stated = starts(CHAIN, **{"initial": {"a": {"position": [0, 0]}, "b": {"position": [7, 0]}}})
    assert (both_stated["a.x"], both_stated["b.x"], both_stated["c.x"]) == (0.0, 7.0, 7.1)
    held = CHAIN.replace("springs:", "joints: {pin: {type: revolute, between: [ground.p, c.out]}}\nsprings:")
    assert starts(held)["c.x"] == 0.4


DRIVEN = """
hfsim: 1
gravity: [0, 0]
ground: {points: {foot: [1, 2]}}
bodies: {hub: {type: rigid, mass: 1, inertia: 1, points: {p: [0.3, 0]}}}
joints: {turn: {type: driver, between: [ground, hub], angle: {type: constant, value: 0.5}}}
springs: {mount: {type: bushing, between: [ground.foot, hub.p], stiffness: 1000, place: [0.1, 0]}}
solve: {duration: 0.1}
output: {channels: [hub.x, hub.y, hub.angle, energy.total]}
"""


def test_their_place_is_where_a_body_starts_that_only_turns_are_said_of():
    place = {"hub.x": 1.1 - 0.3 * np.cos(0.5), "hub.y": 2.0 - 0.3 * np.sin(0.5), "hub.angle": 0.5}
    driven = starts(DRIVEN)
    assert driven == pytest.approx(place | {"energy.total": 0.0}, abs=1e-8)
    stated = starts(DRIVEN, **{"joints": {}, "initial.hub.angle": 0.5})
    assert stated == pytest.approx(driven, abs=1e-8)
    assert starts(DRIVEN, **{"initial.hub.position": [0, 0]})["hub.x"] == 0.0
    held = DRIVEN.replace("joints: {", "joints: {pin: {type: revolute, between: [ground, hub]}, ")
    assert starts(held)["hub.x"] == 0.0


def bushing(first, second, stiffness=200.0, turning=2.0, **more):
    own = {"rotational_stiffness": turning} if turning else {}
    return {"type": "bushing", "between": [first, second], "stiffness": stiffness, **own, **more}


@pytest.mark.parametrize(
    ("last", "place", "told"),
    [
        (bushing("ground.c", "b", 3e4, None), [0.3, 0.0], None),  # what holds place and turn comes first
        (bushing("ground.c", "b", 100.0), [0.8, 0.4], "link"),  # what is nearer to the ground
        (bushing("a", "b", 300.0, place=[0.1, 0.2]), [0.1, 0.2], "link"),  # what is stiffer
        (bushing("a", "b", 100.0, 3.0, place=[0.1, 0.2]), [0.3, 0.0], "last"),  # along, before about
        (bushing("ground.c", "b", place=[-0.5, -0.4]), [0.3, 0.0], None),  # both say the same
    ],
)
def test_where_several_let_a_body_start_does_not_depend_on_their_order(last, place, told):
    springs = {"mount": bushing("ground", "a"), "link": bushing("a", "b", place=[0.3, 0.0]), "last": last}
    for order in permutations(springs):
        deck = {
            "hfsim": 1, "gravity": [0.0, 0.0], "ground": {"points": {"c": [0.8, 0.4]}},
            "bodies": {name: {"type": "rigid", "mass": 1.0, "inertia": 0.02} for name in "ab"},
            "springs": {name: springs[name] for name in order},
            "solve": {"duration": 0.1},
        }  # fmt: skip
        scene = build(parsed(deck))
        assert scene.assembly.poses["b"].origin == pytest.approx(place, abs=1e-12)
        assert [one.split(" ")[0] for one in scene.warnings] == ([f"springs.{told}"] if told else [])
        assert all("starts under force" in one and "state it" in one for one in scene.warnings)
        stated = {"a": {"position": [0, 0]}, "b": {"position": place}}
        for meant in (stated, {"equilibrium": True}):
            assert not build(parsed({**deck, "initial": meant})).warnings


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("place: [0, 0]", "springs.foot.stiffness: missing key"),
        ("stiffness: -1", "must be at least 0"),
        ("stiffness: [1, 2, 3]", "this scene is spatial: springs.foot.stiffness has three"),
        ("stiffness: 1; rotational_stiffness: [1, 2, 3]", "in the plane there is one angle"),
        ("stiffness: 1; angle: 30", "30 rad are 4.77 turns"),
        ("stiffness: 1; orientation: {x: [0, 1, 0], y: [1, 0, 0]}", "only space has springs.foot.orient"),
        ("stiffness: 1; latch: {angle: 0}", "unknown key"),
    ],
)
def test_what_is_wrong_is_told(entry, told):
    begin, end = PLANE.index("    stiffness: 1.0e9"), PLANE.index("solve")
    own = "".join(f"    {line}\n" for line in entry.split("; "))
    text = PLANE[:begin] + own + PLANE[end:]
    try:
        found = "".join(build(parsed(text)).warnings)
    except DeckError as error:
        found = str(error)
    assert told in found


def test_a_line_without_sections_has_no_frame_to_hold():
    text = SPACE.replace("elements: 1}", "elements: 1, element: cable}")
    text = text.replace("shape: rectangle, width: 20 mm, height: 10 mm", "shape: circle, diameter: 10 mm")
    with pytest.raises(DeckError, match=r"springs.clamp: 'arm.root' has no section"):
        build(parsed(text))


def test_springs_have_the_channels_of_joints_but_for_couplings():
    cord = "springs:\n  cord: {type: two_point, between: [ground.p, c.out], stiffness: 100, preload: 3}"
    asked = ["c.out.x", "c.out.y", "cord.force", "cord.force_x", "cord.force_y", "cord.moment", "bc.force_x"]
    text = CHAIN.replace("springs:", cord)
    run = hfsim.run(parsed(text), {"output.channels": asked}, error_estimate=False)
    line = np.stack([run["c.out.x"] - 0.5, run["c.out.y"]])
    pull = run["cord.force"] * line / np.linalg.norm(line, axis=0)
    np.testing.assert_allclose([run["cord.force_x"], run["cord.force_y"]], pull, atol=1e-9)
    assert run["cord.force"][0] == pytest.approx(-3.0) and not run["cord.moment"].any()
    assert np.abs(run["bc.force_x"]).max() > 0.1
    with pytest.raises(DeckError, match="'loop' has no quantity 'force_x'"):
        loop = "springs:\n  loop: {type: coupling, of: {cord: 1}, stiffness: 1}"
        build(parsed(text.replace("springs:", loop).replace("c.vx", "loop.force_x")))


def test_the_stability_axis_stiffness_scales_both_stiffnesses():
    changes = NAMED["stiffness"]("10").overrides(parsed(SPACE).deck, 10.0)
    assert "springs.clamp.stiffness=[10000000000.0, 20000000000.0, 10000000000.0]" in changes
    assert "springs.foot.rotational_stiffness=1000000000.0" in changes
