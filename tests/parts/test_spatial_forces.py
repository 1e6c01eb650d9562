"""Springs and loads in space: power, tangents, frames and turns (more on springs: test_forces)."""

import numpy as np
import pytest
from analytical import jacobian
from spatial_zoo import BODY, LINE, MARKERS, OTHER, N, random_state, rigid_motion

from hfsim.deck.laws import LinearLaw
from hfsim.maths.matrices import assemble
from hfsim.maths.rotations import cross, rotation
from hfsim.mechanics.point_loads import PointForce, PointMoment
from hfsim.parts.forces.moment import MomentSpec
from hfsim.parts.forces.rotational import RotationalSpec
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

T, LAW = np.array([0.7]), LinearLaw(0.5, 2.0)
TIES = {"type": "rotational", "between": ("a", "b"), "stiffness": 30.0, "rest_angle": 0.3}
AXIS, START = (0.3, -1.0, 0.4), random_state(np.random.default_rng(3))


@pytest.fixture(params=["body", "line"])
def marker(request):
    return MARKERS[request.param]


def force_of(part, x, u=None):
    return forces_of(part, x[None], np.zeros((1, N)) if u is None else u[None])[0]


def forces_of(part, x, u):
    """Forces in a batch of states."""
    out = np.zeros_like(x)
    part.add_force(np.repeat(T, len(x)), x, u, out)
    return out


def test_the_tangent_of_an_angle_about_an_axis_is_exact(rng):
    part = RotationalSpec(**TIES, axis=AXIS).build(MARKERS["body"], MARKERS["other"], START)
    x = random_state(rng)
    found = assemble([part.tangent(T, x[None], x[None])], (N, N), False)
    slope = jacobian(lambda s: forces_of(part, s, s), x)
    assert found == pytest.approx(-slope, abs=1e-8 * np.abs(slope).max())
    assert found == pytest.approx(found.T, abs=1e-12 * np.abs(found).max())


def test_a_rotational_spring_needs_no_more_than_the_angle_about_its_axis():
    """Its moment is along the axis of its first body, k times the angle, and counts turns."""
    axis = np.array(AXIS) / np.linalg.norm(AXIS)
    body = MARKERS["body"]
    x = np.zeros(N)
    x[BODY], x[OTHER] = np.r_[np.zeros(3), np.eye(3).ravel()], np.r_[np.ones(3), np.eye(3).ravel()]
    part = RotationalSpec(**TIES, axis=AXIS).build(MARKERS["other"], body, x)
    for turns in (0, 3):
        part.counter.suppose(0.0, 0.5 + 2.0 * np.pi * turns)
        x[BODY] = np.r_[np.zeros(3), rotation(0.5 * axis).T.ravel()]
        spin = rigid_motion(x, np.zeros(3), axis)
        spin[OTHER] = 0.0
        assert force_of(part, x) @ spin == pytest.approx(-30.0 * (0.2 + 2.0 * np.pi * turns))
        across = rigid_motion(x, np.zeros(3), cross(axis, np.array([1.0, 0.0, 0.0])))
        across[OTHER] = 0.0
        assert force_of(part, x) @ across == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("follower", [False, True])
def test_load_power_is_force_times_the_velocity_of_the_point(marker, follower, rng):
    x, u = random_state(rng), rng.normal(size=N)
    f, m, scale = rng.normal(size=3), rng.normal(size=3), LAW.value(0.7)
    velocity, spin = marker.velocity(x[None], u[None])[0], marker.spin(x[None], u[None])[0]
    turn = marker.turned(x[None], np.eye(3))[0] if follower else np.eye(3)
    assert np.allclose(turn @ turn.T, np.eye(3), rtol=0.0, atol=1e-12)
    force, moment = PointForce(marker, LAW, f, follower), PointMoment(marker, LAW, m, follower)
    for part, rate, own in ((force, velocity, f), (moment, spin, m)):
        now = marker.turned(x[None], own)[0] if follower else own
        expected = scale * now @ rate
        assert part.power(T, x[None], u[None])[0] == pytest.approx(expected, rel=1e-12)
        assert force_of(part, x) @ u == pytest.approx(expected, rel=1e-12)
        tangent = assemble([part.tangent(T, x[None], u[None])], (N, N), False)
        slope = jacobian(lambda s, p=part: forces_of(p, s, s), x)
        assert tangent == pytest.approx(-slope, abs=1e-6 * max(1.0, np.abs(slope).max()))


def test_a_moment_of_one_number_is_about_the_third_axis():
    x = np.zeros((1, N))
    x[0, BODY] = np.r_[np.zeros(3), rotation(np.array([0.0, np.pi / 2, 0.0])).T.ravel()]
    for follower, expected in ((False, [0.0, 0.0, 4.0]), (True, [4.0, 0.0, 0.0])):
        spec = MomentSpec(type="moment", at="a", moment=4.0, follower=follower)
        assert spec.build(MARKERS["body"]).unscaled(x)[0][0] == pytest.approx(expected, abs=1e-12)


def test_a_following_force_along_the_tangent_of_a_line_turns_with_it(rng):
    x = random_state(rng)
    t = x[LINE][3:]
    force = PointForce(MARKERS["line"], None, (2.0, 0.0, 0.0), True).unscaled(x[None])[0][0]
    assert force == pytest.approx(2.0 * t / np.linalg.norm(t))


FLYWHEEL = """
hfsim: 1
bodies: {{wheel: {{type: rigid, mass: 1.0, inertia: [1.5, 1.0, 2.0]}}}}
joints: {{axle: {{type: revolute, between: [ground, wheel], axis: [0.2, 0.3, 1.0]}}}}
springs: {{coil: {{type: rotational, between: [ground, wheel], stiffness: 2.0, damping: {damping},
                  rest_angle: 0.4, axis: [0.2, 0.3, 1.0]}}}}
initial: {{wheel: {{angular_velocity: [6.0, 9.0, 30.0]}}}}
solve: {{duration: 4.0, tolerance: 1.0e-9}}
output: {{interval: 0.05, channels: [wheel.angular_velocity_z, energy.total, energy.potential]}}
"""


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_spring_about_an_axis_winds_up_over_many_turns(damping):
    """About one axis the motion is that of one oscillator; it swings through more than ten turns each way."""
    run = simulate(parse_deck(FLYWHEEL.format(damping=damping)), error_estimate=False)
    axis = np.array([0.2, 0.3, 1.0]) / np.linalg.norm([0.2, 0.3, 1.0])
    inertia = axis @ np.diag([1.5, 1.0, 2.0]) @ axis
    rate = np.linalg.norm([6.0, 9.0, 30.0])
    decay, t = 0.5 * damping / inertia, run.t
    omega = np.sqrt(2.0 / inertia - decay**2)
    wave = rate * np.cos(omega * t) - (decay * rate + 2.0 / inertia * -0.4) / omega * np.sin(omega * t)
    assert rate / omega > 20.0 * np.pi / 3.0
    assert run.channels[0].values == pytest.approx(axis[2] * np.exp(-decay * t) * wave, abs=2e-5)
    assert run.statistics["energy_drift"] < 1e-6


DRIVEN = """
hfsim: 1
bodies: {wheel: {type: rigid, mass: 1.0, inertia: [1.5, 1.0, 2.0]}}
joints:
  axle: {type: revolute, between: [ground, wheel], axis: [1.0, 2.0, 2.0]}
  motor: {type: driver, between: [ground, wheel], axis: [1.0, 2.0, 2.0],
          angle: {type: constant_rate, rate: 40.0, start: 0.5}}
initial: {wheel: {orientation: {axis: [1.0, 2.0, 2.0], angle: 0.5}}}
solve: {duration: 2.0, method: gauss, stages: 6, step: 0.02}
output: {interval: 0.02, channels: [wheel.quaternion_w, wheel.angular_velocity_x, constraint.position]}
"""


def test_a_driver_turns_many_turns_in_steps_of_an_eighth_of_one():
    run = simulate(parse_deck(DRIVEN), error_estimate=False)
    angle = 0.5 + 40.0 * run.t
    w, rate, gap = (channel.values for channel in run.channels)
    assert angle[-1] > 12.0 * 2.0 * np.pi
    assert w == pytest.approx(np.abs(np.cos(0.5 * angle)), abs=1e-9)
    assert rate == pytest.approx(np.full(len(rate), 40.0 / 3.0), abs=1e-9)
    assert np.abs(gap).max() < 1e-12
