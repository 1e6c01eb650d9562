"""Couplings: gears, belts, cables and screws between the angles and distances of any joints."""

import numpy as np
import pytest
from natively import native, runs_alike
from solved import parsed

import hfsim
from hfsim.errors import DeckError
from hfsim.scene.build import build

BELT = """
hfsim: 1
ground: {points: {p: [0.5, 0.0]}}
bodies: {a: {type: rigid, mass: 1.0, inertia: 0.4}, b: {type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  pa: {type: revolute, between: [ground, a]}
  pb: {type: revolute, between: [ground.p, b]}
springs: {belt: {type: coupling, of: {pa: 2, pb: 1}, stiffness: 1000, damping: 0.1}}
loads: {push: {type: moment, at: a, moment: 1.0}}
solve: {duration: 5, tolerance: 1.0e-8}
output: {interval: 0.25, channels: [pa.angle, pb.angle, belt.angle, belt.torque, energy.total]}
"""
BEVEL = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
ground: {points: {side: [0.2, 0.0, 0.1]}}
bodies:
  wheel: {type: rigid, mass: 1.0, inertia: [0.2, 0.3, 0.4]}
  pinion: {type: rigid, mass: 0.5, inertia: [0.02, 0.03, 0.04]}
  nut: {type: rigid, mass: 3.0, inertia: [0.1, 0.1, 0.1]}
joints:
  axle: {type: revolute, between: [ground, wheel], axis: [0, 0, 1]}
  shaft: {type: revolute, between: [ground.side, pinion], axis: [1, 0, 0]}
  rail: {type: cylindrical, between: [ground, nut], axis: [0, 1, 0]}
springs:
  teeth: {type: coupling, of: {axle: 3, shaft: -1}, stiffness: 200, damping: 0.05}
  screw: {type: coupling, of: {shaft: 1, rail.sliding: 40}, stiffness: 500, rest_angle: 0.1}
loads: {motor: {type: moment, at: wheel, moment: [0, 0, 4.0]}}
solve: {duration: 2.0, tolerance: 1.0e-8}
output:
  interval: 0.1
  channels: [axle.angle, shaft.angle, rail.distance, rail.angle, teeth.torque, screw.angle, energy.total]
"""


def test_a_belt_holds_two_wheels_in_its_ratio_for_many_turns():
    run = hfsim.run(parsed(BELT), error_estimate=False)
    inertia = 0.4 + 2.0**2 * 0.1
    np.testing.assert_allclose(run["pa.angle"], 0.5 / inertia * run.t**2, atol=2e-4)
    np.testing.assert_allclose(run["belt.angle"], 2.0 * run["pa.angle"] + run["pb.angle"], atol=1e-12)
    assert run["pa.angle"][-1] > 4.0 * np.pi
    assert run["belt.torque"][-1] == pytest.approx(-0.25, rel=0.01)
    assert run.statistics["energy_drift"] < 1e-6


def test_its_vibration_and_what_is_free_are_those_of_the_ratio():
    found = hfsim.modes(parsed(BELT), {"springs.belt.damping": 0.0, "loads": None})
    rate = np.sqrt(1000.0 * (2.0**2 / 0.4 + 1.0 / 0.1))
    assert found.frequencies == pytest.approx([0.0, rate / (2.0 * np.pi)])


def test_bevel_gears_and_a_screw_in_space_share_the_moment():
    run = hfsim.run(parsed(BEVEL), error_estimate=False)
    t, axle, shaft, distance = run.t, run["axle.angle"], run["shaft.angle"], run["rail.distance"]
    np.testing.assert_allclose(shaft, 3.0 * axle, atol=0.05)
    np.testing.assert_allclose(run["screw.angle"], shaft + 40.0 * distance, atol=1e-9)
    np.testing.assert_allclose(distance, (0.1 - shaft) / 40.0, atol=3e-3)
    inertia = 0.4 + 9.0 * (0.02 + 3.0 / 40.0**2)
    np.testing.assert_allclose(axle, 2.0 / inertia * t**2, atol=0.03)
    assert axle[-1] > 2.0 * np.pi
    assert run.statistics["energy_drift"] < 1e-6
    np.testing.assert_allclose(run["rail.angle"], 0.0, atol=1e-9)


def test_a_coupling_acts_as_a_gear_does_where_it_is_stiff():
    gear = "".join(line for line in BELT.splitlines(keepends=True) if not line.startswith("springs"))
    gear = gear.replace("joints:", "joints:\n  mesh: {type: gear, between: [a, b], ratio: -2}")
    gear = gear.replace(", belt.angle, belt.torque", "")
    stiff = hfsim.run(parsed(BELT), {"springs.belt.stiffness": 1e9, "springs.belt.damping": 1e3})
    exact = hfsim.run(parsed(gear))
    np.testing.assert_allclose(stiff["pb.angle"], exact["pb.angle"], atol=1e-6)


@native
@pytest.mark.parametrize("deck", [BELT, BEVEL])
def test_couplings_are_recorded(deck, monkeypatch):
    runs_alike(parsed(deck.replace("duration: 2.0", "duration: 0.6")), monkeypatch, 4e-9)


def test_what_a_coupling_ties_is_one_part_and_its_slope_is_that_of_its_force():
    scene = build(parsed(BEVEL.replace("200, damping: 0.05", "200")))
    system, rng = scene.system, np.random.default_rng(2)
    (part,) = (one for one in system.forces if one.item == "springs.teeth")
    x = system.absolute(scene.q[None]) + 1e-3 * rng.standard_normal((1, system.n_x))
    t, u, step = np.zeros(1), np.zeros_like(x), 1e-6 * rng.standard_normal(x.shape)

    def force(x):
        out = np.zeros_like(x)
        part.add_force(t, x, u, out)
        return out

    ahead, back = part.potential_energy(t, x + step)[0], part.potential_energy(t, x - step)[0]
    assert float((force(x) @ step.T)[0, 0]) == pytest.approx(0.5 * (back - ahead), rel=1e-4)
    rows, columns, values = part.tangent(t, x, u)
    slope = np.bincount(rows, values * step[0, columns], x.shape[1])
    assert slope == pytest.approx(0.5 * (force(x - step) - force(x + step))[0], abs=1e-9)


def test_full_turns_at_the_start_and_distances_count():
    run = hfsim.run(parsed(BELT), {"initial": {"pa": {"angle": "370 deg"}}, "springs.belt.rest_angle": 1.0})
    assert run["belt.angle"][0] == pytest.approx(2.0 * np.radians(370.0))
    assert run["belt.torque"][0] == pytest.approx(-1000.0 * (2.0 * np.radians(370.0) - 1.0))
    turned = {"axle": {"angle": "370 deg"}, "shaft": {"angle": "-200 deg"}}
    rest = hfsim.run(parsed(BEVEL), {"initial": turned})
    assert rest["teeth.torque"][0] == 0.0 and rest["shaft.angle"][0] == pytest.approx(np.radians(-200))


AUTO = """
hfsim: 1
materials: {steel: {density: 7800, youngs_modulus: 2.0e11, bending_damping: 1.0e-4}}
sections: {square: {shape: rectangle, width: 2 cm, height: 2 cm}}
bodies:
  hub: {type: rigid, mass: 2, inertia: 1.0, points: {rim: [0.2, 0]}}
  arm: {type: beam, material: steel, section: square, length: 1, elements: 3}
joints:
  axle: {type: revolute, between: [ground, hub]}
  flap: {type: revolute, between: [hub.rim, arm.root], latch: {angle: 10 deg, stiffness: 2000, damping: 1}}
springs: {belt: {type: coupling, of: {axle: 1, flap: 0.5}, stiffness: 0.01}}
initial: {flap: {angle: 0, angular_velocity: 0.5}, hub: {angle: 0}}
loads:
  push: {type: moment, at: hub.rim, moment: 600, law: {type: smooth_step, from: 0, to: 1, start: 1, end: 1.2}}
solve: {duration: 1.6, model: auto}
output: {channels: [axle.angle, flap.angle, belt.angle]}
"""
ON_LINES = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {rubber: {density: 1100, youngs_modulus: 5 MPa}}
sections: {round: {shape: circle, diameter: 3 cm}}
ground: {points: {far: [2.0, 0.5, 0.0]}}
bodies:
  rod: {type: beam, element: cable, material: rubber, section: round, length: 1.0, elements: 2}
  wheel: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}
joints:
  hook: {type: spherical, between: [ground, rod.root]}
  axle: {type: revolute, between: [ground.far, wheel]}
springs:
  rope: {type: two_point, between: [rod.tip, ground.far], stiffness: 1.0}
  winch: {type: coupling, of: {rope: 5, axle: 1}, stiffness: 20}
solve: {duration: 0.2}
output: {channels: [rope.distance, axle.angle, winch.angle, energy.total]}
"""


def test_turns_that_only_a_later_model_needs_counted_are_handed_on():
    auto = hfsim.run(parsed(AUTO), error_estimate=False)
    exact = hfsim.run(parsed(AUTO), {"solve.model": "exact"}, error_estimate=False)
    assert auto.statistics["auto"]["switches"] and auto["axle.angle"][-1] > 6.0 * np.pi
    for name in ("axle.angle", "belt.angle"):
        assert auto[name][-1] == pytest.approx(exact[name][-1], rel=1e-3)


def test_distances_to_lines_are_coupled_and_angles_about_their_tangent_are_not():
    run = hfsim.run(parsed(ON_LINES), error_estimate=False)
    moved = 5.0 * run["rope.distance"] + run["axle.angle"]
    np.testing.assert_allclose(run["winch.angle"], moved, atol=1e-9)
    assert run.statistics["energy_drift"] < 1e-6
    along = ON_LINES.replace("{type: spherical,", "{type: revolute, axis: [1, 0, 0],")
    with pytest.raises(DeckError) as caught:
        build(parsed(along.replace("rope: 5", "hook: 5")))
    assert "springs.winch.of.hook: the angle of 'hook' is measured by the tangent alone" in str(caught.value)


def test_a_distance_without_direction_is_warned_of():
    text = ON_LINES.replace("far: [2.0, 0.5, 0.0]", "far: [1.0, 0.0, 0.0]")
    text = text.replace("stiffness: 20", "stiffness: 20, rest_angle: 1")
    assert any("springs.winch" in one and "no direction" in one for one in build(parsed(text)).warnings)


@pytest.mark.parametrize(
    ("of", "told"),
    [
        ("{pa: 2, pc: 1}", "of.pc: there is no joint or spring 'pc'"),
        ("{pa: 2, rod: 1}", "of.rod: 'rod' has no angle or distance of its own"),
        ("{pa: 2, belt: 1}", "of.belt: 'belt' has no angle or distance of its own"),
        ("{pa: 2, pb.turning: 1}", "of.pb.turning: 'pb' has one coordinate ('pb')"),
        ("{pa: 0}", "of.pa: must not be zero"),
        ("{}", "of: "),
        ("{pa: x}", "of.pa: must be a number"),
    ],
)
def test_what_is_wrong_of_a_coupling_is_told(of, told):
    text = BELT.replace("{pa: 2, pb: 1}", of)
    text = text.replace("joints:", "joints:\n  rod: {type: fixed, between: [a, c]}")
    text = text.replace("bodies: {", "bodies: {c: {type: rigid, mass: 1, inertia: 1}, ")
    with pytest.raises(DeckError) as caught:
        parsed(text)
    assert f"springs.belt.{told}" in str(caught.value)
