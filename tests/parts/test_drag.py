"""Drag of a medium: terminal speeds, flows, power, bending, in the plane and in space."""

import numpy as np
import pytest
from natively import evaluates_alike, native
from solved import parsed
from tangents import check_tangents, forces

import hfsim
from hfsim.errors import DeckError
from hfsim.mechanics.drag import Drag
from hfsim.scene.build import build

DENSITY, AREA, LENGTH, WIDTH = 1150.0, np.pi * 0.005**2, 0.8, 0.02
WATER = {"type": "drag", "density": 1000.0, "coefficient": 1.2}
ON_ROD = WATER | {"on": "rod", "width": WIDTH}
PER_LENGTH = 0.5 * 1000.0 * 1.2 * WIDTH


def rod(n_dim, load, start, gravity=0.0, element="cable", **more):
    """A rod of nylon, and a gravity along y."""
    deck = {
        "hfsim": 1,
        "gravity": [0.0, -gravity, *(n_dim - 2) * [0.0]],
        "materials": {"nylon": {"density": DENSITY, "youngs_modulus": 2.5e9, "poisson_ratio": 0.4}},
        "sections": {"round": {"shape": "circle", "diameter": 0.01}},
        "bodies": {"rod": {"type": "beam", "material": "nylon", "section": "round", "length": LENGTH,
                           "elements": 2, "element": element}},
        "loads": {"water": load},
        "initial": {"rod": start},
        "solve": {"duration": 1.0, "tolerance": 1e-8},
        "output": {"interval": 0.05, "channels": ["rod.root.vx", "rod.tip.vy", "energy.total"]},
    }  # fmt: skip
    return parsed(deck | more)


def ball_in(n_dim, load, side=0.0):
    """A ball in a stream that acts at a point beside its centre."""
    return {
        "hfsim": 1,
        "gravity": n_dim * [0.0],
        "bodies": {"ball": {"type": "rigid", "mass": 3.0, "inertia": 0.1 if n_dim == 2 else 3 * [0.1],
                            "points": {"side": n_dim * [side]}}},
        "loads": {"stream": load},
        "solve": {"duration": 2.0, "tolerance": 1e-9},
        "output": {"interval": 0.1, "channels": ["ball.vx", "ball.vy", "energy.total"]},
    }  # fmt: skip


def run(deck):
    return hfsim.run(deck, error_estimate=False, diagnosis=False)


@pytest.mark.parametrize(("n_dim", "element"), [(2, "cable"), (3, "cable"), (3, "cosserat")])
def test_what_sinks_across_its_axis_comes_to_its_terminal_speed(n_dim, element):
    weight = DENSITY * AREA * 9.81
    found = run(rod(n_dim, ON_ROD, {"velocity": n_dim * [0.0]}, 9.81, element))
    terminal = np.sqrt(weight / PER_LENGTH)
    np.testing.assert_allclose(found["rod.tip.vy"], -terminal * np.tanh(9.81 * found.t / terminal), atol=1e-6)
    assert found.statistics["energy_drift"] < 1e-6


def test_along_its_axis_it_slips_by_the_other_coefficient():
    start = {"velocity": [2.0, 0.0]}
    np.testing.assert_allclose(run(rod(2, ON_ROD, start))["rod.root.vx"], 2.0, rtol=1e-9)
    found = run(rod(2, ON_ROD | {"along": 0.03}, start))
    rate = PER_LENGTH * 0.03 / 1.2 / (DENSITY * AREA)
    np.testing.assert_allclose(found["rod.root.vx"], 2.0 / (1.0 + 2.0 * rate * found.t), rtol=1e-5)


@pytest.mark.parametrize("n_dim", [2, 3])
def test_a_flow_carries_along(n_dim):
    """One that grows with time, on a ball: w = flow - v obeys w' = flow' - k w |w|."""
    flow = [0.3, 0.4, *(n_dim - 2) * [1.2]]
    law = {"type": "constant_rate", "rate": 2.0}
    load = WATER | {"at": "ball.side", "area": 0.01, "flow": flow, "law": law}
    found = run(parsed(ball_in(n_dim, load)))
    size = np.linalg.norm(flow)
    k, grows = 0.5 * 1000.0 * 1.2 * 0.01 / 3.0, 2.0 * size
    behind = np.sqrt(grows / k) * np.tanh(np.sqrt(grows * k) * found.t)
    np.testing.assert_allclose(found["ball.vx"], flow[0] / size * (grows * found.t - behind), atol=1e-6)
    assert found.statistics["energy_drift"] < 1e-6


@pytest.mark.parametrize(
    ("n_dim", "shear", "bending"),
    [(2, "shear_force", "bending_moment"), (3, "shear_force_z", "bending_moment_y")],
)
def test_a_clamped_rod_bears_a_stream(n_dim, shear, bending):
    load = ON_ROD | {"flow": [0.0, *(n_dim - 2) * [0.0], 0.3]}
    clamp = {"clamp": {"type": "fixed", "between": ["ground", "rod.root"]}}
    wanted = [f"rod.root.{shear}", f"rod.root.{bending}"]
    deck = rod(n_dim, load, {}, element="cosserat" if n_dim == 3 else "cable", joints=clamp,
               output={"interval": 1.0, "channels": wanted})  # fmt: skip
    found = hfsim.static(deck).final
    whole = PER_LENGTH * 0.3**2 * LENGTH
    assert abs(found[wanted[0]]) == pytest.approx(whole, rel=2e-2)
    assert abs(found[wanted[1]]) == pytest.approx(whole * LENGTH / 2.0, rel=2e-2)


def drag_of(scene):
    (part,) = (one for one in scene.system.forces if isinstance(one, Drag))
    return part


def held_at(scene, flow, rng):
    """Hold the derivatives of the drag of a scene where bodies are as fast as the flow is."""
    part, system, speed = drag_of(scene), scene.system, np.linalg.norm(flow)
    x = system.absolute(scene.q[None])
    x, u = x + 0.01 * rng.normal(size=x.shape), speed * rng.normal(size=x.shape)
    check_tangents(part, x, u, 1e-6, 1e-8, 1e-5 * speed)
    assert part.power(np.zeros(1), x, u) == pytest.approx(forces(part, x, u)[0] @ u[0])


@native
@pytest.mark.parametrize(("n_dim", "element"), [
    (2, "cable"), (2, "cosserat"), (3, "cable"), (3, "cosserat"), (3, "continuum"),
])  # fmt: skip
@pytest.mark.parametrize("speed", [1e-5, 1.0, 1e3])
def test_its_tangents_are_derivatives_and_it_is_recorded(n_dim, element, speed, rng):
    flow = (speed * np.array([0.5, -0.2, 0.1])[:n_dim]).tolist()
    start = {"velocity": [1.0, 0.7, 0.3][:n_dim]}
    scene = build(rod(n_dim, ON_ROD | {"along": 0.05, "flow": flow}, start, element=element))
    evaluates_alike(scene)
    held_at(scene, flow, rng)


@pytest.mark.parametrize("n_dim", [2, 3])
def test_tangents_on_a_turning_point_are_derivatives(n_dim, rng):
    flow = [0.5, -0.2, 0.1][:n_dim]
    load = WATER | {"at": "ball.side", "area": 0.01, "flow": flow}
    held_at(build(parsed(ball_in(n_dim, load, side=0.3))), flow, rng)


@pytest.mark.parametrize("element", ["cable", "cosserat", "continuum"])
def test_what_it_does_not_resist_does_not_grow(element):
    """A hinged rod that hangs in a stream: along it nothing is lost, and differences made flutter of that."""
    hinge = {"pin": {"type": "revolute", "between": ["ground", "rod.root"]}}
    soft = {"nylon": {"density": 3000.0, "youngs_modulus": 1e8, "poisson_ratio": 0.0}}
    start = {"angle": -np.pi / 2.0}
    deck = rod(2, ON_ROD | {"flow": [1.0, 0.0]}, start, 9.81, element, joints=hinge, materials=soft)
    found = hfsim.modes(deck, about="equilibrium", count=30)
    assert not found.unstable
    assert sum(mode.kind == "vibration" and mode.growth == 0.0 for mode in found) >= 3


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (WATER, "drag acts on a beam or at a point"),
        (WATER | {"on": "rod"}, "loads.water.width: missing key"),
        (WATER | {"at": "rod.tip"}, "loads.water.area: missing key"),
        (ON_ROD | {"area": 1.0}, "loads.water.area: has no meaning along a beam"),
        (ON_ROD | {"law": 2.0}, "there is no flow that it could scale"),
        (WATER | {"on": "rood", "width": 1.0}, "there is no body 'rood'"),
    ],
)
def test_what_is_wrong_is_told(load, message):
    with pytest.raises(DeckError, match=message):
        rod(2, load, {})
