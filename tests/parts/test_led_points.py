"""Motions: points that laws of time lead, against carriages that drivers move and against closed forms."""

import numpy as np
import pytest
from solved import solved

X = {"type": "sine", "amplitude": 0.05, "frequency": 2.0}
Y = {"type": "smooth_step", "from": 0.0, "to": 0.1, "start": 0.1, "end": 0.3}
TURN = {"type": "sine", "amplitude": 0.5, "frequency": 1.5}
BEAM = {"type": "beam", "material": "rubber", "section": "rod", "length": 0.5, "elements": 2}


def scene(spatial, bodies, joints, channels):
    """A rubber beam in the plane or in space, and what moves its root."""
    gravity = [0.0, 0.0, -9.81] if spatial else [0.0, -9.81]
    return {
        "hfsim": 1,
        "gravity": gravity,
        "materials": {"rubber": {"density": 1100.0, "youngs_modulus": 2.0e7}},
        "sections": {"rod": {"shape": "circle", "diameter": 0.012}},
        "bodies": {**bodies, "b": BEAM},
        "joints": joints,
        "solve": {"duration": 0.3, "tolerance": 1e-10},
        "output": {"interval": 0.02, "channels": channels},
    }


def test_a_clamped_root_that_is_led_moves_as_on_a_carriage():
    """A slide on a slide, a turning table on that, and the beam; or one entry."""
    channels = ["b.tip.x", "b.tip.y", "b.root.bending_moment", "b.root.axial_force", "b.angle"]
    shake = {"type": "motion", "between": ["ground", "b.root"], "x": X, "y": Y, "turn": TURN, "angle": 0.3}
    led, done = solved(scene(False, {}, {"shake": shake}, [*channels, "energy.total"]))
    carriage = {"type": "rigid", "mass": 1.0, "inertia": 0.1}
    joints = {
        "along": {"type": "prismatic", "between": ["ground", "one"], "axis": [1.0, 0.0]},
        "x": {"type": "driver", "between": ["ground", "one"], "axis": [1.0, 0.0], "position": X},
        "across": {"type": "prismatic", "between": ["one", "two"], "axis": [0.0, 1.0]},
        "y": {"type": "driver", "between": ["one", "two"], "axis": [0.0, 1.0], "position": Y},
        "pin": {"type": "revolute", "between": ["two", "three"]},
        "turn": {"type": "driver", "between": ["two", "three"], "angle": TURN},
        "clamp": {"type": "fixed", "between": ["three", "b.root"], "angle": 0.3},
    }
    carried, _ = solved(scene(False, dict.fromkeys(("one", "two", "three"), carriage), joints, channels))
    assert led[:, :5] == pytest.approx(carried, rel=1e-7, abs=1e-9)
    assert np.ptp(led[:, 1]) > 0.1
    assert done.statistics["energy_drift"] < 1e-8


@pytest.mark.parametrize("shape", ["cable", "cosserat"])
def test_in_space_a_motion_is_that_of_a_carriage(shape):
    axis = [0.0, 1.0, 0.0]
    bodies = {"table": {"type": "rigid", "mass": 1.0, "inertia": [0.1, 0.1, 0.1]}}
    channels = ["b.tip.x", "b.tip.y", "b.tip.z"]
    shake = {"type": "motion", "between": ["ground", "b.root"], "z": X, "turn": TURN, "axis": axis}
    for law in (TURN, TURN | {"phase": 1.0}):
        led = scene(True, {}, {"shake": shake | {"turn": law}}, channels)
        joints = {
            "lift": {"type": "prismatic", "between": ["ground", "table"], "axis": [0.0, 0.0, 1.0]},
            "z": {"type": "driver", "between": ["ground", "table"], "axis": [0.0, 0.0, 1.0], "position": X},
            "hinge": {"type": "revolute", "between": ["table", "b.root"], "axis": axis},
            "turn": {"type": "driver", "between": ["table", "b.root"], "axis": axis, "angle": law},
        }
        carried = scene(True, bodies, joints, channels)
        for deck in (led, carried):
            deck["bodies"] = deck["bodies"] | {"b": BEAM | {"element": shape, "elements": 1}}
            deck["solve"] = {"duration": 0.04, "tolerance": 1e-8}
            deck["output"] = deck["output"] | {"interval": 0.01}
        values, done = solved(led)
        assert values == pytest.approx(solved(carried)[0], abs=1e-7)
        assert np.ptp(values[:, 2]) > 0.01
        assert done.statistics["energy_drift"] < 1e-8


def test_a_rigid_bar_on_a_hinge_that_shakes_obeys_its_equation_of_motion():
    """(m l^2 / 3) theta'' = -(m l / 2) (g + y'') cos(theta), and the reaction is m (g + y_c'')."""
    from scipy.integrate import solve_ivp

    shake = {"type": "motion", "between": ["ground", "b.root"], "y": X, "hinged": True}
    deck = scene(False, {}, {"shake": shake}, ["b.angle", "shake.force_x", "shake.force_y"])
    deck["bodies"] = {"b": BEAM | {"model": "rigid"}}
    found, run = solved(deck)
    rate = 2.0 * np.pi * X["frequency"]

    def lifting(t):
        return 9.81 - X["amplitude"] * rate**2 * np.sin(rate * t)

    def motion(t, y):
        return [y[1], -1.5 / 0.5 * lifting(t) * np.cos(y[0])]

    ours = solve_ivp(motion, (0.0, 0.4), [0.0, 0.0], t_eval=run.t, rtol=1e-11, atol=1e-12).y
    assert found[:, 0] == pytest.approx(ours[0], abs=1e-8)
    spin = np.array([motion(t, y) for t, y in zip(run.t, ours.T, strict=True)])[:, 1]
    mass = 1100.0 * np.pi * 0.006**2 * 0.5
    lift = mass * (lifting(run.t) + 0.25 * (spin * np.cos(ours[0]) - ours[1] ** 2 * np.sin(ours[0])))
    assert found[:, 2] == pytest.approx(lift, abs=1e-6)
