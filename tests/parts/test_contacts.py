"""Contacts of points and balls with planes: bounces, slides, rolls, in the plane and in space."""

import math
from dataclasses import replace

import numpy as np
import pytest
from natively import native, runs_alike
from scipy.integrate import solve_ivp
from solved import parsed
from tangents import check_tangents

import hfsim
from hfsim.errors import DeckError
from hfsim.mechanics.contact import ContactTie
from hfsim.scene.build import build

RADIUS, MASS = 0.05, 0.4
INERTIA = 0.4 * MASS * RADIUS**2
TOUCH = {
    "type": "contact",
    "between": ["ground", "ball"],
    "radius": RADIUS,
    "stiffness": 1.0e5,
    "damping": 1.0,
    "friction": {"coefficient": 0.3, "velocity": 1e-4},
}


def resting(weight):
    """How deep a weight presses into the floor: within the transition of 1 mm."""
    y = np.roots([-0.5, 1.0, 0.0, 0.0, -weight / 100.0])
    (y,) = y[(abs(y.imag) < 1e-12) & (y.real > 0.0) & (y.real < 1.0)].real
    return 1e-3 * float(y)


def ball(n_dim, start, gravity, touch=(), more=None, **solve):
    """A ball on a floor through the origin, whose normal is the last axis."""
    inertia = INERTIA if n_dim == 2 else 3 * [INERTIA]
    deck = {
        "hfsim": 1,
        "gravity": gravity,
        "bodies": {"ball": {"type": "rigid", "mass": MASS, "inertia": inertia}},
        "springs": {"floor": TOUCH | dict(touch)},
        "initial": {"ball": start},
        "solve": {"duration": 0.5, "tolerance": 1e-6, **solve},
        "output": {"interval": 0.01, "channels": ["ball.x", "ball.vx", *MEASURED, *OF_BALL[n_dim]]},
    }
    return parsed(deck | (more or {}))


MEASURED = ("floor.distance", "floor.force", "floor.power", "energy.total")
OF_BALL = {
    2: ("ball.y", "ball.vy", "ball.angular_velocity", "floor.force_x", "floor.force_y", "floor.moment"),
    3: ("ball.y", "ball.vy", "ball.z", "ball.angular_velocity_x", "ball.angular_velocity_y"),
}


def run(deck, **settings):
    return hfsim.run(deck, settings, error_estimate=False, diagnosis=False)


def test_a_point_bounces_without_loss_and_goes_on_along_the_floor():
    start = {"position": [0.0, 0.2], "velocity": [0.7, 0.0], "angular_velocity": 5.0}
    found = run(ball(2, start, [0, -9.81], {"radius": 0.0, "damping": 0.0, "friction": None}, duration=1.2))
    np.testing.assert_allclose(found["energy.total"], found["energy.total"][0], rtol=1e-6)
    np.testing.assert_allclose(found["ball.x"], 0.7 * found.t, atol=1e-9)
    np.testing.assert_allclose(found["ball.angular_velocity"], 5.0)
    assert found["ball.y"].min() > -0.01 and found["ball.y"][found.t > 0.5].max() > 0.19
    np.testing.assert_allclose(found["floor.distance"], found["ball.y"], atol=1e-12)
    away = run(ball(2, start, [0, -9.81], duration=0.1))
    np.testing.assert_allclose(away["floor.distance"], away["ball.y"] - RADIUS, atol=1e-12)


def test_backspin_slides_until_it_rolls():
    """Its angular momentum about the floor stays: m R v - I w; rolling is v = -R w."""
    depth = resting(MASS * 9.81)
    start = {"position": [0.0, RADIUS - depth], "velocity": [1.0, 0.0], "angular_velocity": 30.0}
    found = run(ball(2, start, [0, -9.81]))
    slides = (1.0 + RADIUS * 30.0) / (0.3 * 9.81 * (1.0 + MASS * RADIUS**2 / INERTIA))
    sliding, rolling = found.t < 0.95 * slides, found.t > 1.1 * slides
    np.testing.assert_allclose(found["ball.vx"][sliding], 1.0 - 0.3 * 9.81 * found.t[sliding], rtol=1e-6)
    np.testing.assert_allclose(found["floor.force_x"][sliding], -0.3 * MASS * 9.81, rtol=1e-6)
    np.testing.assert_allclose(found["floor.force_y"], MASS * 9.81, rtol=1e-5)
    np.testing.assert_allclose(found["floor.force"], found["floor.force_y"])
    np.testing.assert_allclose(found["floor.moment"], RADIUS * found["floor.force_x"], atol=1e-12)
    v = (MASS * RADIUS * 1.0 - INERTIA * 30.0) / (MASS * RADIUS + INERTIA / RADIUS)
    np.testing.assert_allclose(found["ball.vx"][rolling], v, rtol=1e-6)
    np.testing.assert_allclose(found["ball.angular_velocity"][rolling], -v / RADIUS, rtol=1e-6)
    slip = found["ball.vx"] + RADIUS * found["ball.angular_velocity"]
    np.testing.assert_allclose(found["floor.power"], found["floor.force_x"] * slip, atol=1e-6)


@pytest.mark.parametrize("n_dim", [2, 3])
@pytest.mark.parametrize("slope", [0.2, 1.0])
def test_down_a_slope_it_rolls_or_slides(n_dim, slope):
    """5/7 g sin rolling, up to a slope of 7/2 of the friction; g (sin - mu cos) beyond."""
    pull, press = 9.81 * math.sin(slope), 9.81 * math.cos(slope)
    gravity = [pull, *(n_dim - 2) * [0.0], -press]
    start = {"position": [*(n_dim - 1) * [0.0], RADIUS - resting(MASS * press)]}
    found = run(ball(n_dim, start, gravity, tolerance=1e-5))
    rolls = np.tan(slope) < 3.5 * 0.3
    expected = pull * 5.0 / 7.0 if rolls else pull - 0.3 * press
    np.testing.assert_allclose(found["ball.vx"], expected * found.t, atol=2e-4)
    turned = found["ball.angular_velocity"] if n_dim == 2 else -found["ball.angular_velocity_y"]
    at_rim = expected if rolls else 2.5 * 0.3 * press
    np.testing.assert_allclose(-RADIUS * turned, at_rim * found.t, atol=5e-4)


def turntable(rate):
    return {
        "bodies": {
            "ball": {"type": "rigid", "mass": MASS, "inertia": 3 * [INERTIA]},
            "table": {"type": "rigid", "mass": 1.0, "inertia": [1, 1, 1]},
        },
        "joints": {
            "axle": {"type": "revolute", "between": ["ground", "table"]},
            "motor": {
                "type": "driver",
                "between": ["ground", "table"],
                "angle": {"type": "constant_rate", "rate": rate},
            },
        },
    }


def test_on_a_turntable_it_circles_with_two_sevenths_of_its_rate():
    """What starts without slip at a velocity v keeps its size."""
    rate, at, v = 3.0, 0.3, 0.2
    spin = [(rate * at - v) / RADIUS, 0.0, 0.0]
    start = {"position": [at, 0.0, RADIUS - resting(MASS * 9.81)], "velocity": [0.0, v, 0.0]}
    start["angular_velocity"] = spin
    touch = {"between": ["table", "ball"], "friction": {"coefficient": 0.8, "velocity": 1e-3}}
    found = run(ball(3, start, [0, 0, -9.81], touch, turntable(rate), tolerance=1e-4))
    turn = np.exp(2j / 7.0 * rate * found.t)
    np.testing.assert_allclose(found["ball.vx"] + 1j * found["ball.vy"], 1j * v * turn, atol=1e-3)


def test_what_rests_beside_a_turning_table_does_not_shorten_its_steps():
    start = {"position": [0.5, 0.0, RADIUS - resting(MASS * 9.81)]}
    found = run(ball(3, start, [0, 0, -9.81], {}, turntable(7.0), tolerance=1e-5))
    assert found.statistics["steps"] < 100
    np.testing.assert_allclose(found["ball.x"], 0.5, atol=1e-9)


def test_what_rolls_evenly_in_space_takes_long_steps():
    start = {"position": [0.0, 0.0, RADIUS - resting(MASS * 9.81)], "velocity": [0.5, 0.0, 0.0]}
    start["angular_velocity"] = [0.0, 0.5 / RADIUS, 0.0]
    found = run(ball(3, start, [0, 0, -9.81], tolerance=1e-5))
    assert found.statistics["steps"] < 100
    np.testing.assert_allclose(found["ball.x"], 0.5 * found.t, atol=1e-5)


def test_what_rolls_ever_faster_takes_long_steps_too():
    """Its slip stays while its speed grows: a guess that lets it die out is off by many velocities."""
    pull, press = 9.81 * math.sin(0.2), 9.81 * math.cos(0.2)
    start = {"position": [0.0, 0.0, RADIUS - resting(MASS * press)]}
    found = run(ball(3, start, [pull, 0.0, -press], tolerance=1e-5))
    assert found.statistics["steps"] < 400


def two_bodies(n_dim):
    """A ball that presses and rubs on a plate, both free and turning."""
    axes, inertias = n_dim - 1, (INERTIA, 0.01) if n_dim == 2 else (3 * [INERTIA], [0.01, 0.02, 0.03])
    return ball(
        n_dim,
        {"position": [0.1, *(axes - 1) * [0.05], 0.045], "velocity": [0.5, *(axes - 1) * [0.2], -0.3]},
        n_dim * [0.0],
        {"between": ["plate", "ball"], "friction": {"coefficient": 0.5, "velocity": 1e-2}},
        {
            "bodies": {
                "ball": {"type": "rigid", "mass": MASS, "inertia": inertias[0]},
                "plate": {"type": "rigid", "mass": 0.7, "inertia": inertias[1]},
            },
            "initial": {
                "ball": {
                    "position": [0.1, *(axes - 1) * [0.05], 0.045],
                    "velocity": [0.5, *(axes - 1) * [0.2], -0.3],
                    "angular_velocity": 4.0 if n_dim == 2 else [4.0, -3.0, 2.0],
                },
                "plate": {
                    "velocity": [*axes * [0.0], 0.2],
                    "angular_velocity": 0.5 if n_dim == 2 else [0.5, 0.2, 1.0],
                },
            },
            "output": {"interval": 0.002, "channels": [*MOMENTA[n_dim], *MEASURED]},
        },
        duration=0.1,
    )


LINEAR = ("momentum.linear_x", "momentum.linear_y")
MOMENTA = {
    2: (*LINEAR, "momentum.angular"),
    3: (*LINEAR, "momentum.linear_z", *(f"momentum.angular_{axis}" for axis in "xyz")),
}


@pytest.mark.parametrize("n_dim", [2, 3])
def test_between_free_bodies_momenta_stay_and_power_is_what_energy_loses(n_dim):
    found = run(two_bodies(n_dim))
    for name in MOMENTA[n_dim]:
        np.testing.assert_allclose(found[name], found[name][0], atol=1e-8)
    assert found["floor.force"].max() > 1.0 and found["floor.force"][-1] == 0.0
    assert found["energy.total"][-1] < found["energy.total"][0] - 1e-3
    assert found.statistics["energy_drift"] < 1e-6


@native
@pytest.mark.parametrize("n_dim", [2, 3])
def test_they_are_recorded(n_dim, monkeypatch):
    runs_alike(two_bodies(n_dim), monkeypatch, 1e-6)


@pytest.mark.parametrize("n_dim", [2, 3])
@pytest.mark.parametrize("slip", [0.0, 1.0])
def test_tangents_are_derivatives(n_dim, slip):
    scene = build(two_bodies(n_dim))
    system = scene.system
    (part,) = (one for one in system.forces if isinstance(one, ContactTie))
    x, u = system.absolute(scene.q[None]), slip * system.absolute_velocity(scene.q[None], scene.v[None])
    check_tangents(part, x, u, 1e-7, 2e-4)


def carried(**touch):
    """A ball that strikes a plane that a free beam in space carries between two nodes, or a wheel there."""
    return parsed({
        "hfsim": 1,
        "gravity": 3 * [0.0],
        "materials": {"nylon": {"density": 1150, "youngs_modulus": 1e8, "poisson_ratio": 0.0}},
        "sections": {"bar": {"shape": "rectangle", "width": 0.02, "height": 0.02}},
        "bodies": {
            "bar": {"type": "beam", "material": "nylon", "section": "bar", "length": 1.0, "elements": 1,
                    "points": {"m": [0.7, 0.0, 0.0]}},
            "ball": {"type": "rigid", "mass": 0.3, "inertia": 3 * [1e-4]},
        },
        "springs": {"floor": {"type": "contact", "between": ["bar.m", "ball"], "normal": [0.1, 1.0, 0.1],
                              "radius": 0.05, "stiffness": 2e4, **touch}},
        "initial": {
            "bar": {"position": 3 * [0.0]},
            "ball": {"position": [0.75, 0.1, 0.02], "velocity": [0.5, -3.0, 0.3],
                     "angular_velocity": [5.0, 10.0, -20.0]},
        },
        "solve": {"duration": 0.06, "tolerance": 1e-8},
        "output": {"interval": 0.002, "channels": [*MOMENTA[3], *MEASURED]},
    })  # fmt: skip


WHEEL = {"between": ["ball", "bar.m"], "normal": [0.1, -1.0, 0.1], "axis": [0.1, 0.2, 1.0]}


@pytest.mark.parametrize("touch", [{}, WHEEL], ids=["ball", "wheel"])
def test_on_beams_between_nodes_no_energy_is_lost_and_momenta_stay(touch):
    """The height's derivatives are true there, where section vectors have no right angles."""
    found = run(carried(**touch))
    assert found["floor.force"].max() > 10.0 and found["floor.force"][-1] == 0.0
    np.testing.assert_allclose(found["energy.total"], found["energy.total"][0], rtol=1e-8)
    for name in MOMENTA[3]:
        np.testing.assert_allclose(found[name], found[name][0], atol=1e-9)


def test_friction_on_beams_between_nodes_leaves_the_momenta():
    found = run(carried(friction={"coefficient": 0.4, "velocity": 0.02}))
    assert found["energy.total"][-1] < found["energy.total"][0] - 1e-3
    for name in MOMENTA[3]:
        np.testing.assert_allclose(found[name], found[name][0], atol=1e-9)


@pytest.mark.parametrize("touch", [{}, WHEEL], ids=["ball", "wheel"])
def test_rows_are_derivatives_of_the_height_where_the_beam_is_strained(touch, rng):
    scene = build(carried(**touch))
    (part,) = (one for one in scene.system.forces if isinstance(one, ContactTie))
    x = scene.system.absolute(scene.q[None])
    own = scene.bodies["bar"].columns
    x[:, own] += 0.05 * rng.normal(size=x[:, own].shape)
    ((row,),) = (row for (_, end), row in zip(part._ends, part.measured(np.zeros(1), x)[1], strict=True)
                 if end.columns == own)  # fmt: skip
    moved = 1e-6 * np.eye(x.shape[1])[own]
    ahead, behind = (part.measured(np.zeros(len(moved)), x + sign * moved)[0] for sign in (1.0, -1.0))
    assert row == pytest.approx((ahead - behind) / 2e-6, abs=1e-8)


def test_a_floor_may_open_and_what_starts_in_it_is_told():
    start = {"position": [0.0, RADIUS - resting(MASS * 9.81)]}
    found = run(ball(2, start, [0, -9.81], {"release": {"time": 0.2}}))
    falls = np.maximum(found.t - 0.2, 0.0)
    np.testing.assert_allclose(found["ball.y"], start["position"][1] - 0.5 * 9.81 * falls**2, atol=1e-6)
    assert found.statistics["releases"] == {"springs.floor": pytest.approx(0.2)}
    slides, weight = start | {"velocity": [1.0, 0.0]}, MASS * 9.81
    for share, opens in ((1.02, True), (1.05, False)):  # it bears sqrt(1 + 0.3^2) of the weight
        found = run(ball(2, slides, [0, -9.81], {"release": {"force": share * weight}}, duration=0.05))
        assert (found.statistics["releases"]["springs.floor"] is not None) == opens
    deep = run(ball(2, {"position": [0.0, 0.04]}, [0, -9.81], duration=0.01))
    assert any("springs.floor" in one and "0.01 m beyond" in one for one in deep.statistics["warnings"])


def test_modes_tell_that_it_sticks():
    more = {"springs": {
        "floor": TOUCH | {"friction": {"coefficient": 0.3}},
        "leash": {"type": "bushing", "between": ["ground", "ball"], "stiffness": [100.0, 0.0],
                  "rotational_stiffness": 1.0},
    }}  # fmt: skip
    start = {"position": [0.0, RADIUS - resting(MASS * 9.81)]}
    found = hfsim.modes(ball(2, start, [0, -9.81], more=more))
    assert found.facts()["sticking"] == {"springs.floor.friction": pytest.approx(300.0 * MASS * 9.81)}


@pytest.mark.parametrize("n_dim", [2, 3])
@pytest.mark.parametrize("velocity", [1e-2, 1e-6, 1e-9])
def test_friction_is_linearised_at_any_velocity(n_dim, velocity, rng):
    """Steps of 1e-7 m/s once went past all of its slope."""
    scene = build(two_bodies(n_dim))
    system = scene.system
    (part,) = (one for one in system.forces if isinstance(one, ContactTie))
    part, x = replace(part, velocity=velocity), system.absolute(scene.q[None])
    for slip in (0.1, 1.0, 3.0):
        u = slip * velocity * rng.normal(size=x.shape)
        check_tangents(part, x, u, 1e-6, 2e-4, 1e-4 * velocity)


@pytest.mark.parametrize("velocity", [1e-3, 1e-5, 1e-7, 1e-9])
def test_what_sticks_comes_to_rest_as_its_slope_says(velocity):
    """Between a spring k and friction of slope mu N / v: s^2 m + s mu N / v + k = 0."""
    anchor = {"ground": {"points": {"wall": [-1.0, 0.0]}}}
    held = {"type": "two_point", "between": ["ground.wall", "ball"], "stiffness": 100.0, "rest_length": 1.0}
    coil = {"type": "rotational", "between": ["ground", "ball"], "stiffness": 10.0}
    floor = TOUCH | {"radius": 0.0, "friction": {"coefficient": 0.3, "velocity": velocity}}
    more = anchor | {"springs": {"floor": floor, "leash": held, "coil": coil}}
    found = hfsim.modes(ball(2, {}, [0, -9.81], more=more), about="equilibrium")
    grip = 0.3 * MASS * 9.81 / velocity
    slow, fast = np.sort_complex(np.roots([MASS, grip, 100.0]))[::-1]
    decays = sorted(mode.value.real for mode in found if mode.kind == "decay")
    assert decays[0] == pytest.approx(fast, rel=1e-9)
    if velocity >= 1e-5:
        assert decays[-1] == pytest.approx(slow, rel=1e-6)  # it sinks in by 0.3 mm, and the spring leans


CABLE = """
hfsim: 1
gravity: [0, 0, -9.81]
materials: {rubber: {density: 1100, youngs_modulus: 10 MPa}}
sections: {rod: {shape: circle, diameter: 10 mm}}
bodies:
  rope: {type: beam, element: cable, material: rubber, section: rod, length: 0.5, elements: 2}
springs:
  floor{k=0..1}:
    type: contact
    between: [ground, "rope.${'root' if k == 0 else 'tip'}"]
    radius: 5 mm
    stiffness: 1.0e4
    damping: 1.0
initial: {rope: {position: [0, 0, 0.1]}}
solve: {duration: 0.5, tolerance: 1.0e-4}
output: {channels: [rope.tip.z]}
"""


def test_lines_in_space_touch_a_floor_but_do_not_rub_as_balls():
    deck = CABLE.replace("{k=0..1}", "").replace("\"rope.${'root' if k == 0 else 'tip'}\"", "rope.tip")
    found = run(parsed(deck))
    assert found["rope.tip.z"].min() > 0.003
    with pytest.raises(DeckError, match=r"springs.floor: 'rope.tip' has no section"):
        build(parsed(deck.replace("[ground, rope.tip]", "[rope.tip, ground]")))
    rubs = deck.replace("damping: 1.0", "damping: 1.0\n    friction: {coefficient: 0.3}")
    with pytest.raises(DeckError, match=r"springs.floor: 'rope.tip' has no section") as refused:
        build(parsed(rubs))
    assert "or radius: 0" in str(refused.value) and "two_point" not in str(refused.value)
    build(parsed(rubs.replace("radius: 5 mm", "radius: 0")))


def rolling_disc(tilt, spin, times):
    """Tilt of the axis of a thin disc that rolls without slip, and its spin, along axes that do not roll.

    These are along the track, up the disc and along its axis.  There v = w x R e2, and the force at the place
    where it touches turns it by -R e2 x F.
    """
    A, C = 0.25 * MASS * RADIUS**2, 0.5 * MASS * RADIUS**2
    up, inertia, arm = np.array([0.0, RADIUS, 0.0]), np.diag([A, A, C]), np.array([0.0, -RADIUS, 0.0])

    def rates(t, y):
        theta, w = y[0], y[1:]
        frame = np.array([w[0], w[1], w[1] / math.tan(theta)])
        k = np.array([0.0, math.sin(theta), math.cos(theta)])
        turning = np.cross(frame, np.cross(w, up))
        weight = np.cross(arm, MASS * (turning + 9.81 * k)) - np.cross(frame, inertia @ w)
        moved = np.array([np.cross(arm, MASS * np.cross(one, up)) for one in np.eye(3)]).T
        return [w[0], *np.linalg.solve(inertia - moved, weight)]

    return solve_ivp(rates, (0.0, times[-1]), [tilt, *spin], "DOP853", times, rtol=1e-10, atol=1e-12).y


def wheel(tilt, spin, friction):
    """The same disc with its axis tilted from the vertical about x, which is along its track."""
    e2, e3 = np.array([0.0, math.cos(tilt), math.sin(tilt)]), np.array([0.0, -math.sin(tilt), math.cos(tilt)])
    w, half = np.array([spin[0], *(spin[1] * e2 + spin[2] * e3)[1:]]), 0.25 * MASS * RADIUS**2
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0, -9.81],
        "bodies": {"ball": {"type": "rigid", "mass": MASS,
                            "inertia": [half, half, 2.0 * half]}},
        "springs": {"floor": TOUCH | {"axis": [0, 0, 1], "stiffness": 1.0e6, "transition": 1e-4,
                                      "damping": 10.0 if friction else 0.0, "friction": friction}},
        "initial": {"ball": {
            "position": (RADIUS * e2).tolist(), "velocity": np.cross(w, RADIUS * e2).tolist(),
            "angular_velocity": w.tolist(), "orientation": {"axis": [1, 0, 0], "angle": tilt},
        }},
        "solve": {"duration": 0.4, "tolerance": 1e-5},
        "output": {"interval": 0.02, "channels": ["ball.x", "ball.z", "ball.angular_velocity_z", *MEASURED]},
    }  # fmt: skip
    return parsed(deck)


@pytest.mark.parametrize(("tilt", "spin"), [(1.1, (0.0, 6.0, -9.0)), (0.5, (0.3, 9.0, 1.0))])
def test_a_wheel_rolls_as_a_disc_without_slip(tilt, spin):
    found = run(wheel(tilt, spin, {"coefficient": 2.0, "velocity": 1e-4}))
    theta, _, around, rolling = rolling_disc(tilt, spin, found.t)
    np.testing.assert_allclose(found["ball.z"], RADIUS * np.sin(theta), atol=2e-4)
    about_z = around * np.sin(theta) + rolling * np.cos(theta)
    np.testing.assert_allclose(found["ball.angular_velocity_z"], about_z, atol=0.02 * np.abs(about_z).max())
    assert np.abs(found["floor.distance"]).max() < 1e-4


def test_a_wheel_on_ice_falls_without_loss():
    """Its centre goes straight down, z = R sin(tilt), with the energies of both motions."""
    found = run(wheel(1.2, (0.0, 0.0, 0.0), None))
    lies = int(np.argmax(found["ball.z"] < 0.2 * RADIUS))
    assert lies > 3
    np.testing.assert_allclose(found["energy.total"][:lies], found["energy.total"][0], rtol=1e-5)
    np.testing.assert_allclose(found["ball.x"], 0.0, atol=1e-9)


def test_wheels_have_a_size_and_are_in_space():
    with pytest.raises(DeckError, match=r"springs.floor.radius: missing key"):
        ball(3, {}, [0, 0, 0], {"axis": [0, 0, 1], "radius": 0.0})
    with pytest.raises(DeckError, match=r"springs.floor.axis"):
        ball(2, {}, [0, 0], {"axis": [0, 1]})


def test_a_model_with_a_varying_mass_is_linearised_without_steps_past_the_depth():
    """A stiff rod on a pin with its end on a floor: by differences it was 0.24 % off, its stiffness 1.2 %."""
    more = {
        "materials": {"stiff": {"density": 2700.0, "youngs_modulus": 7e12, "poisson_ratio": 0.3}},
        "sections": {"round": {"shape": "circle", "diameter": 0.02}},
        "bodies": {"rod": {"type": "beam", "material": "stiff", "section": "round", "length": 1.0,
                           "elements": 2}},
        "ground": {"points": {"pin": [-1.0, 0.1]}},
        "joints": {"pin": {"type": "revolute", "between": ["ground.pin", "rod.root"]}},
        "springs": {"floor": TOUCH | {"between": ["ground", "rod.tip"], "radius": 0.1}},
        "initial": {},
        "output": {"channels": ["rod.tip.y"]},
    }  # fmt: skip
    exact, low = (ball(2, {}, [0, -9.81], more=more, model=model) for model in ("exact", "lowOrder"))
    one, other = (hfsim.modes(deck, about="equilibrium", count=2) for deck in (exact, low))
    np.testing.assert_allclose(other.frequencies, one.frequencies, rtol=1e-7)
    one, other = (hfsim.static(deck).statistics["smallest_eigenvalue"] for deck in (exact, low))
    assert other == pytest.approx(one, rel=1e-7)
