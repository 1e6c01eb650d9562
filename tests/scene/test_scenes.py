# ruff: noqa: E501
"""Whole scenes with closed-form answers, invariances and balances; and the starting state."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from published import published
from scipy.linalg import null_space
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk

from hfsim.errors import DeckError
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

CASES = Path(__file__).parents[2] / "cases"
MODELS = ["linear", "lowOrder", "exact", "ancf"]


def scene(text, **changes):
    """Return the deck of a YAML text; changes are dotted keys with __ for the dots."""
    overrides = [f"{key.replace('__', '.')}={value}" for key, value in changes.items()]
    return parse_deck("hfsim: 1\n" + text, "scene.yaml", overrides)


def run(text, model=None, **changes):
    result = simulate(scene(text, **changes), model, error_estimate=False)
    assert result.status == "done", result.reason
    return result


def tip(result, body="b1"):
    return np.stack([result[f"{body}.tip.x"], result[f"{body}.tip.y"]], axis=1)


# rigid bodies ----------------------------------------------------------------------------------------

RIGID_PENDULUM = """
gravity: [0.0, -9.81]
bodies: {bob: {type: rigid, mass: 1.0, inertia: 0.25, points: {pivot: [-0.5, 0.0], end: [0.5, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, bob.pivot]}}
initial: {bob: {angle: 0.0, angular_velocity: 0.0}}
solve: {duration: 10.0, tolerance: 1.0e-11}
output: {interval: 0.25, channels: [bob.end.x, bob.end.y, bob.angle, pin.force_x, pin.force_y]}
"""


def test_rigid_pendulum_is_the_elliptic_function():
    """Benchmark R1: sin(phi/2) = k cd(w0 t | k^2), phi from the vertical; a rod of equivalent length 1 m."""
    result = run(RIGID_PENDULUM)
    _, cn, dn, _ = ellipj(np.sqrt(9.81) * result.t, 0.5)
    phi = 2.0 * np.arcsin(np.sqrt(0.5) * cn / dn)
    assert result["bob.end.x"] == pytest.approx(np.sin(phi), abs=3e-8)
    assert result["bob.end.y"] == pytest.approx(-np.cos(phi), abs=3e-8)
    row = list(result.t).index(1.0)
    assert result["bob.end.x"][row] == pytest.approx(-0.98629175113188, abs=1e-8)
    assert result["bob.end.y"][-1] == pytest.approx(-0.96141920509913, abs=3e-8)
    # what the joint must add to the weight for the centre of mass, half way out, to move like this
    along, across = 2.0 * 9.81 * np.cos(phi), 0.5 * 9.81 * np.sin(phi)
    assert result["pin.force_x"] == pytest.approx(
        across * np.cos(phi) - along * np.sin(phi), abs=1e-5
    )
    assert result["pin.force_y"] == pytest.approx(
        across * np.sin(phi) + along * np.cos(phi), abs=1e-5
    )


def test_period_of_the_rigid_pendulum():
    result = run(RIGID_PENDULUM, solve__duration=2.3678419475762374, output__interval=2.3678419475762374)
    assert 4.0 * ellipk(0.5) / np.sqrt(9.81) == pytest.approx(2.3678419475762374, abs=1e-13)
    assert result["bob.end.x"][-1] == pytest.approx(1.0, abs=1e-12)


SLIDER_CRANK = """
bodies:
  crank: {type: rigid, mass: 1.0, inertia: 0.1, points: {a: [-0.25, 0.0], b: [0.25, 0.0]}}
  rod: {type: rigid, mass: 2.0, inertia: 0.4, points: {b: [-0.5, 0.0], c: [0.5, 0.0]}}
  slider: {type: rigid, mass: 1.5, inertia: 0.1}
joints:
  shaft: {type: revolute, between: [ground, crank.a]}
  knee: {type: revolute, between: [crank.b, rod.b]}
  pin: {type: revolute, between: [rod.c, slider]}
  guide: {type: prismatic, between: [ground, slider]}
  motor: {type: driver, between: [ground, crank], angle: {type: constant_rate, rate: 5.0, start: 0.3}}
solve: {duration: 2.0, tolerance: 1.0e-9}
output:
  interval: 0.02
  channels: [slider.x, slider.y, slider.angle, slider.vx, rod.angle, crank.angle, motor.moment, energy.kinetic]
"""


def test_slider_crank_follows_its_kinematics():
    result = run(SLIDER_CRANK)
    phi = 0.3 + 5.0 * result.t
    beta = np.arcsin(0.5 * np.sin(phi))
    place = 0.5 * np.cos(phi) + np.cos(beta)
    speed = 5.0 * (-0.5 * np.sin(phi) - 0.25 * np.sin(phi) * np.cos(phi) / np.cos(beta))
    assert result["slider.x"] == pytest.approx(place, abs=1e-9)
    assert result["slider.vx"] == pytest.approx(speed, abs=1e-8)
    assert np.abs(result["slider.y"]).max() < 1e-10
    assert np.abs(result["slider.angle"]).max() < 1e-10
    assert result["rod.angle"] == pytest.approx(-beta, abs=1e-9)
    assert result["crank.angle"] == pytest.approx(phi, abs=1e-9)
    # what the motor puts in is what the bodies gain
    power = 5.0 * result["motor.moment"]
    rate = np.gradient(result["energy.kinetic"], result.t)
    assert power[2:-2] == pytest.approx(rate[2:-2], abs=0.02 * np.abs(power).max())
    assert result.statistics["energy_drift"] < 1e-8


@pytest.mark.parametrize(
    ("law", "value"),
    [
        (
            "{type: sine, amplitude: 0.4, frequency: 0.5, phase: 0.2, offset: 0.1}",
            lambda t: 0.1 + 0.4 * np.sin(np.pi * t + 0.2),
        ),
        ("{type: table, times: [0, 1, 2, 3], values: [0, 1, 8, 27]}", lambda t: t**3),
        ("{type: smooth_step, from: 0.0, to: 2.0, start: 0.5, end: 1.5}", None),
        ("{type: constant_rate, rate: -2.0}", lambda t: -2.0 * t),
    ],
    ids=["sine", "table", "smooth_step", "constant_rate"],
)
def test_drivers_impose_their_law(law, value):
    text = f"""
bodies: {{wheel: {{type: rigid, mass: 2.0, inertia: 3.0}}, car: {{type: rigid, mass: 1.5, inertia: 0.1}}}}
joints:
  axle: {{type: revolute, between: [ground, wheel]}}
  motor: {{type: driver, between: [ground, wheel], angle: {law}}}
  rail: {{type: prismatic, between: [ground, car], axis: [3.0, 4.0]}}
  pull: {{type: driver, between: [ground, car], axis: [3.0, 4.0], position: {law}}}
solve: {{duration: 2.0}}
output: {{interval: 0.05, channels: [wheel.angle, wheel.angular_velocity, car.x, car.y, motor.moment, pull.force_x, pull.force_y]}}
"""
    result = run(text)
    t = result.t
    if value is None:
        x = np.clip(t - 0.5, 0.0, 1.0)
        expected = 2.0 * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        acceleration = 2.0 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
    else:
        e = 1e-4
        expected = value(t)
        acceleration = (value(t + e) - 2.0 * value(t) + value(t - e)) / e**2
    assert result["wheel.angle"] == pytest.approx(expected, abs=1e-9)
    assert result["car.x"] == pytest.approx(0.6 * expected, abs=1e-9)
    assert result["car.y"] == pytest.approx(0.8 * expected, abs=1e-9)
    assert result["motor.moment"] == pytest.approx(3.0 * acceleration, abs=1e-5)
    assert result["pull.force_x"] == pytest.approx(1.5 * 0.6 * acceleration, abs=1e-5)
    assert result["pull.force_y"] == pytest.approx(1.5 * 0.8 * acceleration, abs=1e-5)


def test_a_bead_flies_out_along_a_turning_rod():
    text = """
bodies: {arm: {type: rigid, mass: 1.0, inertia: 2.0}, bead: {type: rigid, mass: 0.5, inertia: 0.1}}
joints:
  axle: {type: revolute, between: [ground, arm]}
  motor: {type: driver, between: [ground, arm], angle: {type: constant_rate, rate: 2.0}}
  rod: {type: prismatic, between: [arm, bead]}
initial: {bead: {position: [0.5, 0.0], velocity: [0.0, 1.0]}}
solve: {duration: 1.0}
output: {interval: 0.05, channels: [bead.x, bead.y, bead.angle]}
"""
    result = run(text)
    r = 0.5 * np.cosh(2.0 * result.t)
    assert result["bead.x"] == pytest.approx(r * np.cos(2.0 * result.t), abs=1e-8)
    assert result["bead.y"] == pytest.approx(r * np.sin(2.0 * result.t), abs=1e-8)
    assert result["bead.angle"] == pytest.approx(2.0 * result.t, abs=1e-9)
    assert result.statistics["energy_drift"] < 1e-8


def damped(t, m, c, k, x0):
    d, w = 0.5 * c / m, np.sqrt(k / m - 0.25 * (c / m) ** 2)
    return x0 * np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t))


def test_mass_on_a_spring_and_damper():
    text = """
ground: {points: {wall: [-2.0, 0.0]}}
bodies: {mass: {type: rigid, mass: 2.0, inertia: 1.0}}
joints: {rail: {type: prismatic, between: [ground, mass]}}
springs: {coil: {type: two_point, between: [ground.wall, mass], stiffness: 50.0, damping: 3.0, rest_length: 2.0}}
initial: {mass: {position: [0.3, 0.0]}}
solve: {duration: 3.0}
output: {interval: 0.05, channels: [mass.x, energy.total]}
"""
    result = run(text)
    assert result["mass.x"] == pytest.approx(damped(result.t, 2.0, 3.0, 50.0, 0.3), abs=1e-7)
    assert result["energy.total"][0] == pytest.approx(0.5 * 50.0 * 0.09)
    assert result.statistics["work_done"] < -1.0
    assert result.statistics["energy_drift"] < 1e-7


def test_wheel_on_a_rotational_spring_and_damper():
    text = """
bodies: {wheel: {type: rigid, mass: 2.0, inertia: 0.5}}
joints: {axle: {type: revolute, between: [ground, wheel]}}
springs: {coil: {type: rotational, between: [ground, wheel], stiffness: 8.0, damping: 0.4, rest_angle: 7.0}}
initial: {wheel: {angle: 8.0}}
solve: {duration: 5.0}
output: {interval: 0.05, channels: [wheel.angle]}
"""
    result = run(text)
    assert result["wheel.angle"] == pytest.approx(
        7.0 + damped(result.t, 0.5, 0.4, 8.0, 1.0), abs=1e-7
    )


# beams -----------------------------------------------------------------------------------------------


def spinning_rod(EA, rho_a, length, omega, strain):
    """Return the elongation of a rod that spins steadily about its root (benchmark S6)."""
    if strain == "engineering":
        k = omega * np.sqrt(rho_a / EA)
        return np.tan(k * length) / k - length

    def mismatch(r_tip):
        def stretch(r):
            energy = 0.125 * EA + 0.5 * rho_a * omega**2 * (r_tip**2 - r**2)
            return np.sqrt((0.25 + np.sqrt(0.0625 + 1.5 * energy / EA)) / 0.75)

        r, w = np.polynomial.legendre.leggauss(40)
        r = 0.5 * r_tip * (r + 1.0)
        return 0.5 * r_tip * (w @ (1.0 / stretch(r))) - length

    return brentq(mismatch, length, 1.1 * length, xtol=1e-15) - length


@pytest.mark.parametrize("strain", ["green", "engineering"])
def test_spinning_rod_lengthens(strain):
    """A heavily damped rod, driven at a steady rate, settles at the closed form."""
    text = f"""
materials: {{alloy: {{density: 3000.0, youngs_modulus: 7.0e10, axial_damping: 2.0e-3}}}}
sections: {{bar: {{area: 4.0e-4, second_moment: 2.0e-7}}}}
bodies: {{b1: {{type: beam, material: alloy, section: bar, length: 10.0, elements: 6, strain: {strain}}}}}
joints:
  pin: {{type: revolute, between: [ground, b1.root]}}
  motor: {{type: driver, between: [ground, b1.root], angle: {{type: constant_rate, rate: 6.0}}}}
initial: {{b1: {{angular_velocity: 6.0}}}}
solve: {{duration: 0.6, tolerance: 1.0e-9, method: radau}}
output: {{interval: 0.1, channels: [b1.tip.elongation, b1.tip.deflection]}}
"""
    EA, rho_a = 2.8e7, 1.2
    told = {"green": 5.14269846180301e-4, "engineering": 5.14317455043403e-4}[strain]
    assert spinning_rod(EA, rho_a, 10.0, 6.0, strain) == pytest.approx(told, rel=1e-9)
    result = run(text)
    assert result["b1.tip.elongation"][-1] == pytest.approx(told, rel=3e-4)


def cantilever(model, amplitude):
    """A cantilever let go: it is loaded for a moment by a half sine, then swings freely."""
    return f"""
materials: {{alloy: {{density: 2700.0, youngs_modulus: 7.0e10}}}}
sections: {{bar: {{area: 1.0e-4, second_moment: 1.0e-9}}}}
bodies: {{b1: {{type: beam, material: alloy, section: bar, length: 1.0, elements: 2}}}}
joints: {{clamp: {{type: fixed, between: [ground, b1.root]}}}}
loads:
  push:
    type: force
    at: b1.tip
    force: [0.0, {amplitude}]
    law: {{type: smooth_step, from: 0.0, to: 1.0, start: 0.0, end: 0.6}}
  let_go:
    type: force
    at: b1.tip
    force: [0.0, -{amplitude}]
    law: {{type: smooth_step, from: 0.0, to: 1.0, start: 0.6, end: 0.605}}
solve: {{duration: 1.6, model: {model}, tolerance: 1.0e-7}}
output: {{interval: 0.0005, channels: [b1.tip.deflection]}}
"""


@pytest.mark.parametrize("model", MODELS)
def test_cantilever_swings_at_its_frequency(model):
    """Static tip deflection F L^3/(3 EI), then (beta L)^2 sqrt(EI/(rho A L^4)) (benchmark S1)."""
    result = run(cantilever(model, 0.01))
    EI, rho_a = 70.0, 0.27
    w, t = result["b1.tip.deflection"], result.t
    assert w[t <= 0.6][-1] == pytest.approx(0.01 / (3.0 * EI), rel=2e-2)
    swing, times = w[t > 0.62], t[t > 0.62]
    spectrum = np.abs(np.fft.rfft(swing * np.hanning(len(swing)), 64 * len(swing)))
    rate = 2.0 * np.pi * np.fft.rfftfreq(64 * len(swing), times[1] - times[0])
    assert rate[np.argmax(spectrum)] == pytest.approx(3.51601526850015 * np.sqrt(EI / rho_a), rel=3e-3)


def test_roll_up_to_a_circle():
    """Benchmark S8: an end moment of 2 pi EI/L bends a cantilever to a full circle; damping lets it settle."""
    text = """
materials: {rubber: {density: 1000.0, youngs_modulus: 1.0e6, axial_damping: 0.05, bending_damping: 0.4}}
sections: {strip: {shape: rectangle, width: 0.1, height: 0.01}}
bodies: {b1: {type: beam, material: rubber, section: strip, length: 1.0, elements: 12, strain: engineering, curvature: exact}}
joints: {clamp: {type: fixed, between: [ground, b1.root]}}
loads:
  bend: {type: moment, at: b1.tip, moment: 0.05235987755982989, law: {type: smooth_step, from: 0, to: 1, start: 0, end: 6}}
solve: {duration: 60.0, tolerance: 1.0e-6, method: radau}
output: {interval: 1.0, channels: [b1.tip.x, b1.tip.y, energy.strain, energy.kinetic]}
"""
    result = run(text)
    EI = 1e6 * 0.1 * 0.01**3 / 12.0
    assert pytest.approx(2.0 * np.pi * EI) == 0.05235987755982989
    assert np.abs(tip(result)[-1]).max() < 1e-3
    assert result["energy.strain"][-1] == pytest.approx(0.5 * EI * (2.0 * np.pi) ** 2, rel=2e-3)
    # half way up the curve the beam is a wide arc, above the root
    assert tip(result)[3:10, 1].max() > 0.3


SPIN_UP = CASES / "verify" / "spin_up.yaml"


def test_spin_up_of_a_clamped_beam_begins():
    result = simulate(load_deck(SPIN_UP, ["solve.duration=2.5"]), error_estimate=False)
    _, name, value = published("verify/spin_up", 2.5)[0]
    assert result[name][-1] == pytest.approx(value, abs=1e-6)
    assert result["b1.tip.elongation"][-1] == pytest.approx(-1.3225e-3, abs=2e-6)


def test_linear_fails_on_the_spin_up_as_it_must():
    settings = ["solve.duration=9", "output.interval=0.5", "solve.tolerance=1e-6"]
    w = simulate(load_deck(SPIN_UP, settings), "linear", error_estimate=False)["b1.tip.deflection"]
    assert w[5] == pytest.approx(-0.15151, abs=5e-4)
    assert w[15] == pytest.approx(-1.46452, abs=5e-2)
    assert w[18] < -7.0


SAME_BEAM = """
gravity: [0.0, -9.81]
materials: {{rubber: {{density: 1000.0, youngs_modulus: 2.0e6}}}}
sections: {{strip: {{shape: rectangle, width: 0.1, height: 0.02}}}}
bodies: {bodies}
joints: {joints}
solve: {{duration: 0.3, tolerance: 1.0e-7}}
output: {{interval: 0.02, channels: [{end}.tip.x, {end}.tip.y, energy.total]}}
"""


@pytest.mark.parametrize("model", ["exact", "ancf"])
def test_two_halves_fixed_together_are_one_beam(model):
    """With the same elements; a fixed joint leaves the axial strain free to jump, so nearly."""
    half = "{type: beam, material: rubber, section: strip, length: 0.5, elements: 2}"
    whole = "{type: beam, material: rubber, section: strip, length: 1.0, elements: 4}"
    one = run(
        SAME_BEAM.format(
            bodies=f"{{a: {whole}}}", joints="{c: {type: fixed, between: [ground, a.root]}}", end="a"
        ),
        model,
    )
    joints = "{c: {type: fixed, between: [ground, a.root]}, d: {type: fixed, between: [a.tip, b.root]}}"
    two = run(SAME_BEAM.format(bodies=f"{{a: {half}, b: {half}}}", joints=joints, end="b"), model)
    drop = np.ptp(tip(one, "a")[:, 1])
    assert drop > 0.1
    assert np.abs(tip(one, "a") - tip(two, "b")).max() < 1e-3 * drop


def test_inertia_of_a_hub_with_a_beam():
    """A stiff beam on a hub on a spring swings with I = J + m ((R + L/2)^2 + L^2/12)."""
    text = """
materials: {steel: {density: 8000.0, youngs_modulus: 2.0e11}}
sections: {bar: {shape: rectangle, width: 0.05, height: 0.05}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 3.0, points: {rim: [0.5, 0.0]}}
  b1: {type: beam, material: steel, section: bar, length: 1.0, elements: 2}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, b1.root]}
springs: {coil: {type: rotational, between: [ground, hub], stiffness: 100.0}}
initial: {hub: {angle: 0.1}}
solve: {duration: 4.0, tolerance: 1.0e-6}
output: {interval: 0.05, channels: [hub.angle]}
"""
    result = run(text)
    inertia = 3.0 + 20.0 * (1.0 + 1.0 / 12.0)
    expected = 0.1 * np.cos(np.sqrt(100.0 / inertia) * result.t)
    assert result["hub.angle"] == pytest.approx(expected, abs=2e-4)


# momentum, loads, power ------------------------------------------------------------------------------

FREE = """
materials: {rubber: {density: 1000.0, youngs_modulus: 1.0e6}}
sections: {strip: {shape: rectangle, width: 0.1, height: 0.02}}
bodies: {b1: {type: beam, material: rubber, section: strip, length: 1.0, elements: 4}}
initial: {b1: {angle: 0.4, angular_velocity: 6.0, position: [1.0, 2.0], velocity: [0.5, -1.0]}}
loads:
  kick: {type: moment, at: b1.tip, moment: 1.5, law: {type: table, times: [0, 0.05, 0.1, 0.15, 10], values: [0, 1, 0, 0, 0]}}
solve: {duration: 0.6, tolerance: 1.0e-10}
output: {interval: 0.01, channels: [energy.total, b1.tip.x, b1.tip.y]}
"""


@pytest.mark.parametrize("model", ["exact", "ancf"])
def test_momentum_of_a_flying_beam(model):
    built = build(
        scene(FREE.replace("loads:", "").replace(FREE.split("loads:\n")[1].split("\n")[0], "")), model
    )
    from hfsim.marching.integration import run_integration

    done = run_integration(built, built.deck.solve)
    assert done.stop is None
    system = built.system
    q, v = done.trajectory.at(np.linspace(0.0, 0.6, 30))
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    beam = built.bodies["b1"]
    momentum = (u @ system.equations.constant_mass).reshape(len(u), -1, 2)
    nodes = x.reshape(len(x), -1, 2)
    linear = np.einsum("a,baj->bj", beam.mesh.positions, momentum)
    angular = np.sum(nodes[:, :, 0] * momentum[:, :, 1] - nodes[:, :, 1] * momentum[:, :, 0], axis=1)
    mass = 2.0
    centre = np.array([1.0, 2.0]) + 0.5 * np.array([np.cos(0.4), np.sin(0.4)])
    velocity = np.array([0.5, -1.0]) + 3.0 * np.array([-np.sin(0.4), np.cos(0.4)])
    assert linear == pytest.approx(np.tile(mass * velocity, (30, 1)), abs=1e-9)
    spin = mass * (centre[0] * velocity[1] - centre[1] * velocity[0]) + mass / 12.0 * 6.0
    assert angular == pytest.approx(np.full(30, spin), rel=1e-9)


@pytest.mark.parametrize("follower", [False, True])
def test_a_force_on_a_rigid_body_stays_or_turns_with_it(follower):
    text = f"""
bodies: {{disc: {{type: rigid, mass: 2.0, inertia: 1.0}}}}
loads: {{jet: {{type: force, at: disc, force: [4.0, 0.0], follower: {str(follower).lower()}}}}}
initial: {{disc: {{angle: 0.0, angular_velocity: 3.0, position: [0.0, 0.0], velocity: [0.0, 0.0]}}}}
solve: {{duration: 2.0}}
output: {{interval: 0.1, channels: [disc.x, disc.y]}}
"""
    result = run(text)
    t = result.t
    if follower:
        x, y = 2.0 / 9.0 * (1.0 - np.cos(3.0 * t)), 2.0 / 9.0 * (3.0 * t - np.sin(3.0 * t))
    else:
        x, y = t**2, 0.0 * t
    assert result["disc.x"] == pytest.approx(x, abs=1e-8)
    assert result["disc.y"] == pytest.approx(y, abs=1e-8)


BUSY = """
gravity: [0.5, -9.81]
materials: {soft: {density: 1500.0, youngs_modulus: 1.0e8, axial_damping: 1.0e-3, bending_damping: 5.0e-3}}
sections: {strip: {shape: rectangle, width: 0.05, height: 0.02}}
ground: {points: {hook: [0.4, -0.6]}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.5, points: {rim: [0.2, 0.0]}}
  b1: {type: beam, material: soft, section: strip, length: 1.0, elements: 2}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, b1.root]}
  motor: {type: driver, between: [ground, hub], angle: {type: sine, amplitude: 0.5, frequency: 1.0}}
springs:
  rope: {type: two_point, between: [ground.hook, b1.tip], stiffness: 200.0, damping: 2.0}
loads:
  jet: {type: force, at: b1.tip, force: [0.5, 3.0], follower: true, law: {type: sine, amplitude: 1.0, frequency: 1.0}}
  twist: {type: moment, at: b1.tip, moment: 0.5}
solve: {duration: 0.5, tolerance: 1.0e-8}
output: {interval: 0.05, channels: [energy.total, b1.tip.x, b1.tip.y]}
"""


@pytest.mark.parametrize("model", ["linear", "exact", "ancf"])
def test_energy_balance_with_loads_dampers_and_drivers(model):
    result = run(BUSY, model)
    facts = result.statistics
    assert abs(facts["work_done"]) > 0.1
    gained = facts["energy_final"] - facts["energy_initial"]
    assert gained == pytest.approx(facts["work_done"], abs=1e-6 * max(1.0, abs(facts["work_done"])))
    assert facts["energy_drift"] < 1e-6


def test_energy_balance_of_low_order_with_whole_inertia():
    result = run(BUSY, "lowOrder", bodies__b1__truncation="none")
    assert result.statistics["energy_drift"] < 1e-6


@pytest.mark.parametrize("name", ["pendulum", "hub_beams_soft"])
def test_states_make_sense_where_all_motions_that_joints_allow_have_inertia(name):
    """Whether or not others have it, which joints forbid."""
    scene = build(load_deck(CASES / f"{name}.yaml", ["solve.model=lowOrder"]))
    system, rng, seen = scene.system, np.random.default_rng(4), set()
    for _ in range(40):
        q = scene.q + rng.uniform(0.0, 0.3) * rng.normal(size=len(scene.q))
        x = system.absolute(q[None])
        M, rows = system.unreduced.mass(x)[0], system.unreduced.phi.jacobians(x)[0]
        Z = null_space(rows)
        whole, allowed = (np.linalg.eigvalsh(one)[0] > 0.0 for one in (M, Z.T @ M @ Z))
        assert system.admissible(q) == allowed
        seen.add((bool(whole), bool(allowed)))
    assert seen == {(True, True), (False, True), (False, False)}


@pytest.mark.parametrize("model", ["exact", "ancf"])
def test_continuum_tends_to_the_cable_for_thin_sections(model):
    text = """
gravity: [0.0, -9.81]
materials: {{soft: {{density: 1000.0, youngs_modulus: {modulus}}}}}
sections: {{strip: {{shape: rectangle, width: 0.1, height: {height}}}}}
bodies: {{b1: {{type: beam, material: soft, section: strip, length: 1.0, elements: 2, element: {element}}}}}
joints: {{pin: {{type: revolute, between: [ground, b1.root]}}}}
solve: {{duration: 0.1, tolerance: 1.0e-7}}
output: {{interval: 0.02, channels: [b1.tip.x, b1.tip.y, energy.total]}}
"""

    def gap(height, modulus):
        cable, continuum = (
            run(text.format(height=height, modulus=modulus, element=e), model) for e in ("cable", "continuum")
        )
        assert continuum.statistics["energy_drift"] < 1e-6
        return np.abs(tip(cable) - tip(continuum)).max()

    # so stiff that bending plays no part (coarse continuum elements lock in it), the difference is the rotary
    # inertia of the sections, which the cable leaves out: of order height^2
    assert gap(0.025, 4e11) < 1.5e-5
    assert gap(0.05, 1e11) == pytest.approx(4.0 * gap(0.025, 4e11), rel=0.25)


# frame invariance ------------------------------------------------------------------------------------

TURN, SHIFT = 0.7, np.array([3.0, -2.0])
FIXED_STEPS = ("solve.method=gauss", "solve.stages=3")
"""The same steps in both frames, so that what differs is the frame alone."""
POINT = re.compile(r"^(.*)\.([xy])$")


def moved(name, model, duration):
    """Return a case's scene rotated and shifted, through an anchor point that replaces the ground's origin."""
    data = yaml.safe_load((CASES / f"{name}.yaml").read_text())
    R = np.array([[np.cos(TURN), -np.sin(TURN)], [np.sin(TURN), np.cos(TURN)]])
    data["gravity"] = [float(g) for g in R @ np.array(data["gravity"])]
    data["ground"] = {"points": {"anchor": [float(s) for s in SHIFT]}}
    for joint in data["joints"].values():
        joint["between"] = ["ground.anchor" if p == "ground" else p for p in joint["between"]]
    for spring in data.get("springs", {}).values():
        spring["rest_angle"] = spring.get("rest_angle", 0.0) + TURN
    for motion in data["initial"].values():
        motion["angle"] = motion.get("angle", 0.0) + TURN
    return parse_deck(yaml.safe_dump(data), "moved.yaml", settings(model, duration)), R


def settings(model, duration):
    # safe_load reads 7.0e10 as text, but so does no test compare: hfsim's own loader reads it again as a number
    interval = f"output.interval={duration / 5}"
    return [
        f"solve.model={model}",
        f"solve.duration={duration}",
        "solve.tolerance=1e-9",
        interval,
        *FIXED_STEPS,
        f"solve.step={duration / 40}",
    ]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("case", "duration"),
    [
        ("pendulum", 0.025),
        ("two_beams", 0.004),
        ("two_beams_relative", 0.004),
        ("hub_beams", 0.004),
        ("hub_beams_soft", 0.04),
    ],
)
def test_turned_and_shifted_scene_gives_the_same_answer(case, duration, model):
    here = simulate(
        parse_deck((CASES / f"{case}.yaml").read_text(), "here.yaml", settings(model, duration)),
        error_estimate=False,
    )
    deck, R = moved(case, model, duration)
    there = simulate(deck, error_estimate=False)
    assert here.status == there.status == "done"
    for c in here.channels:
        values, point = there[c.name], POINT.match(c.name)
        if point:
            body = point.group(1)
            both = np.stack([here[f"{body}.x"], here[f"{body}.y"]])
            expected = (R @ both + SHIFT[:, None])["xy".index(point.group(2))]
        else:
            expected = c.values + (TURN if c.name.endswith(".angle") else 0.0)
        if c.name == "energy.total" and here.name == "pendulum":
            expected = expected - expected[0] + values[0]
        scale = 1e-9 if c.unit == "m" else 1e-7 * max(1.0, np.abs(expected).max())
        assert values == pytest.approx(expected, abs=10.0 * scale), c.name


# starting state --------------------------------------------------------------------------------------

CHAIN = """
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
ground: {points: {left: [1.0, 0.5], right: [3.0, 0.5]}}
bodies:
  a: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}
  b: {type: beam, material: alloy, section: bar, length: 2.0, elements: 2}
  c: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}
joints:
  p: {type: revolute, between: [ground.left, a.root]}
  q: {type: revolute, between: [a.tip, b.root]}
"""
TAIL = """
solve: {duration: 0.1}
output: {channels: [b.tip.x, b.tip.y, b.tip.vx, b.tip.vy, c.root.x, c.root.y, c.angle, c.angular_velocity]}
"""


def start(text, model="exact"):
    """Return the values of the channels at the start."""
    built = build(scene(text), model)
    from hfsim.marching.sampling import SceneSamples, compute_channels

    turns = {name: np.array([angle]) for name, angle in built.start_angles.items()}
    samples = SceneSamples(built, np.zeros(1), built.q[None], built.v[None], turns)
    x, u = samples.x, samples.u
    if built.system.unreduced.n_rows:
        assert np.abs(built.system.residual(np.zeros(1), x)).max() < 1e-13
        rate = (built.system.unreduced.phi.jacobians(x) @ u[..., None])[..., 0] + built.system.unreduced.phi.rate(np.zeros(1))
        assert np.abs(rate).max() < 1e-12
    return {c.name: c.values[0] for c in compute_channels(samples)}


@pytest.mark.parametrize("model", MODELS)
def test_positions_and_velocities_follow_along_the_chain(model):
    text = CHAIN + "  f: {type: fixed, between: [b.tip, c.root], angle: -0.5}\n"
    text += (
        "initial: {a: {angle: 0.3, angular_velocity: 2.0}, b: {angle: -0.2, angular_velocity: -1.0}}\n" + TAIL
    )
    found = start(text, model)
    ea, eb = (np.array([np.cos(w), np.sin(w)]) for w in (0.3, -0.2))
    place = np.array([1.0, 0.5]) + ea + 2.0 * eb
    velocity = 2.0 * np.array([-ea[1], ea[0]]) - 2.0 * np.array([-eb[1], eb[0]])
    assert [found["b.tip.x"], found["b.tip.y"]] == pytest.approx(place, abs=1e-12)
    assert [found["b.tip.vx"], found["b.tip.vy"]] == pytest.approx(velocity, abs=1e-12)
    assert [found["c.root.x"], found["c.root.y"]] == pytest.approx(place, abs=1e-12)
    assert found["c.angle"] == pytest.approx(-0.7, abs=1e-12)
    assert found["c.angular_velocity"] == pytest.approx(-1.0, abs=1e-11)


LOOP = (
    CHAIN
    + """
  r: {type: revolute, between: [b.tip, c.root]}
  s: {type: revolute, between: [c.tip, ground.right]}
"""
)


@pytest.mark.parametrize("model", MODELS)
def test_a_closed_loop_closes_from_one_angle(model):
    """A parallelogram: c points down where a points up."""
    found = start(
        LOOP + "initial: {a: {angle: 1.2, angular_velocity: 3.0}, c: {angle: -1.9415926535897931}}\n" + TAIL,
        model,
    )
    assert found["c.angle"] == pytest.approx(1.2 - np.pi, abs=1e-12)
    assert found["c.angular_velocity"] == pytest.approx(3.0, abs=1e-11)
    assert [found["b.tip.x"], found["b.tip.y"]] == pytest.approx(
        [3.0 + np.cos(1.2), 0.5 + np.sin(1.2)], abs=1e-12
    )
    velocity = 3.0 * np.array([-np.sin(1.2), np.cos(1.2)])
    assert [found["b.tip.vx"], found["b.tip.vy"]] == pytest.approx(velocity, abs=1e-11)


def test_unstated_angles_follow_in_a_parallelogram():
    found = start(LOOP + "initial: {a: {angle: 1.2, angular_velocity: 3.0}}\n" + TAIL)
    elbow = np.array([1.0 + np.cos(1.2), 0.5 + np.sin(1.2)])
    place = np.array([found["b.tip.x"], found["b.tip.y"]])
    assert np.linalg.norm(place - elbow) == pytest.approx(2.0, abs=1e-12)
    assert np.linalg.norm(place - [3.0, 0.5]) == pytest.approx(1.0, abs=1e-12)


def refused(text, model="exact"):
    with pytest.raises(DeckError) as caught:
        build(scene(text), model)
    assert caught.value.exit_code == 2
    (problem,) = caught.value.problems
    assert problem.line > 0
    return problem


def test_angles_that_a_fixed_joint_contradicts():
    text = (
        CHAIN
        + "  f: {type: fixed, between: [b.tip, c.root]}\ninitial: {b: {angle: 0.2}, c: {angle: 0.5}}\n"
        + TAIL
    )
    problem = refused(text)
    assert problem.path == "joints.f"
    assert "0.3 rad" in problem.message


def test_positions_that_a_joint_contradicts():
    text = CHAIN + "initial: {a: {position: [1.0, 0.25]}}\n" + TAIL
    problem = refused(text)
    assert problem.path == "joints.p"
    assert "0.25 m" in problem.message


def test_angles_that_no_loop_can_have():
    problem = refused(LOOP + "initial: {a: {angle: 3.0}, b: {angle: 3.0}, c: {angle: 0.0}}\n" + TAIL)
    assert re.match(r"joints\.[pqrs]$", problem.path)
    assert re.search(r"by [0-9.]+ m\b", problem.message)


def test_velocities_that_a_joint_contradicts():
    text = CHAIN + "  f: {type: fixed, between: [b.tip, c.root]}\n"
    problem = refused(text + "initial: {b: {angular_velocity: 2.0}, c: {angular_velocity: 0.5}}\n" + TAIL)
    assert problem.path == "joints.f"
    assert "1.5 rad/s" in problem.message
    problem = refused(CHAIN + "initial: {a: {velocity: [0.0, 0.75]}}\n" + TAIL)
    assert problem.path == "joints.p"
    assert "0.75 m/s" in problem.message


def test_a_driver_that_the_stated_rate_contradicts():
    text = CHAIN + "  d: {type: driver, between: [ground, a], angle: {type: constant_rate, rate: 2.0}}\n"
    problem = refused(text + "initial: {a: {angular_velocity: 0.5}}\n" + TAIL)
    assert problem.path == "joints.d"
    assert "1.5 rad/s" in problem.message


@pytest.mark.parametrize("model", MODELS)
def test_redundant_joints_are_named(model):
    text = CHAIN + "  again: {type: revolute, between: [a.tip, b.root]}\n" + TAIL
    problem = refused(text, model)
    assert problem.path == "joints.again"
    assert "'q'" in problem.message
    assert "redundant" in problem.message
    assert "2 of 6" in problem.message


def test_full_turns_of_a_stated_angle_are_kept():
    text = CHAIN + f"initial: {{c: {{angle: {4 * np.pi + 0.3}}}}}\n" + TAIL
    for model in MODELS:
        assert start(text, model)["c.angle"] == pytest.approx(4 * np.pi + 0.3, abs=1e-12)


@pytest.mark.parametrize("ends", ["ground, c", "c, ground"])
def test_full_turns_of_a_driver_are_handed_on_in_either_direction(ends):
    turn = 4 * np.pi + 0.3
    law = f"{{type: constant_rate, rate: 2.0, start: {turn}}}"
    found = start(CHAIN + f"  d: {{type: driver, between: [{ends}], angle: {law}}}\n" + TAIL, "exact")
    sign = 1.0 if ends == "ground, c" else -1.0
    assert found["c.angle"] == pytest.approx(sign * turn, abs=1e-12)


def test_a_driven_body_drags_others_along_without_turning_them():
    text = CHAIN + """  r: {type: revolute, between: [b.tip, c.tip]}
  d: {type: driver, between: [ground, a], angle: {type: constant_rate, rate: 2.0}}
"""
    found = start(text + TAIL)
    assert found["c.angular_velocity"] == pytest.approx(0.0, abs=1e-12)
    assert (found["b.tip.vx"], found["b.tip.vy"]) == pytest.approx((0.0, 2.0), abs=1e-12)


def test_a_run_that_loses_its_energy_says_so():
    coarse = simulate(load_deck(CASES / "pendulum.yaml", ("solve.method=gear", "solve.tolerance=1e-3")))
    assert coarse.statistics["energy_drift"] > 1e-3
    assert "energy balance" in coarse.statistics["warnings"][0]
    fine = simulate(load_deck(CASES / "pendulum.yaml", ("solve.tolerance=1e-6",)), error_estimate=False)
    assert fine.statistics["warnings"] == []


BLADE = """
name: blade
materials: {alu: {density: 1200, youngs_modulus: 2.8e9}}
sections: {s: {shape: rectangle, width: 0.05, height: 0.02}}
bodies: {blade: {type: beam, material: alu, section: s, length: 2.0, elements: 4}}
joints:
  mount: {type: revolute, between: [ground, blade.root]}
  motor: {type: driver, between: [ground, blade.root], angle: {type: spin_up, rate: "120 rpm", time: 1}}
solve: {duration: 4, tolerance: 1e-4}
"""


def test_linear_above_the_critical_speed_ends_with_the_body_and_the_reason():
    fast = simulate(scene(BLADE), "linear", error_estimate=False)
    assert (fast.status, fast.exit_code) == ("failed", 3)
    assert fast.failure["class"] == "model" and fast.failure["item"] == "bodies.blade"
    assert "times its length" in fast.reason
    assert simulate(scene(BLADE), "exact", error_estimate=False).status == "done"


UNCONNECTED = """
gravity: [0, -9.81]
materials: {rubber: {density: 1100, youngs_modulus: 5.0e6}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
ground: {points: {rail: [3, 0]}}
bodies:
  hung: &arm {type: beam, material: rubber, section: bar, length: 1, elements: 10}
  slid: {<<: *arm, model: MODEL}
joints:
  pin: {type: revolute, between: [ground, hung.root]}
  rail: {type: JOINT, between: [ground.rail, slid.root]}
solve: {duration: 0.02}
"""


@pytest.mark.parametrize("joint", ["prismatic", "revolute", "fixed"])
@pytest.mark.parametrize("model", ["exact", "linear"])
def test_parts_that_nothing_connects_have_the_coordinates_of_the_whole(joint, model):
    loaded = scene(UNCONNECTED.replace("JOINT", joint).replace("MODEL", model))
    whole = build(loaded)
    columns = np.concatenate([part.columns for part in whole.parts])
    assert len(whole.parts) == 2 and sorted(columns) == list(range(whole.system.n))
    assert simulate(loaded, error_estimate=False).status == "done"
