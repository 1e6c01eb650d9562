"""Shipped cases in space: at rest, in motion, and turning; `hfsim verify` has their published values."""

from pathlib import Path

import numpy as np
import pytest
from cantilevers import at_rest
from scipy.integrate import solve_ivp
from turning import Turning

from hfsim.marching.integration import run_integration
from hfsim.maths.rotations import rotation
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck
from hfsim.simulate import simulate

CASES = Path(__file__).parents[2] / "cases"


def scene_of(case, *settings):
    return build(load_deck(CASES / f"{case}.yaml", list(settings)))


def run(case, *settings):
    found = simulate(load_deck(CASES / f"{case}.yaml", list(settings)), error_estimate=False)
    return found, {channel.name: channel.values for channel in found.channels}


# --- at rest -------------------------------------------------------------------------------------


def test_45_degree_bend_of_fully_parameterised_elements():
    """Beside a geometrically exact beam with plane sections: 1.3e-4 of the chord; at rest all along."""
    scene = scene_of("bend_45_continuum")
    tip = scene.marker("bend.tip").position(at_rest(scene, 1.0))[0]
    assert np.linalg.norm(tip - [15.6848005, 47.1504386, 53.4748588]) == pytest.approx(0.0102, abs=2e-4)
    _, values = run("bend_45_continuum")
    assert [values[f"bend.tip.{axis}"][-1] for axis in "xyz"] == pytest.approx(tip, abs=2e-6)


@pytest.mark.parametrize(
    ("case", "point", "within"),
    [
        ("bend_45", "bend.tip", 1.5e-3),
        ("torsion", "beam.tip", 1e-6),
        pytest.param("princeton", "beam.tip", 1e-8, marks=pytest.mark.slow),
    ],
)
def test_damped_runs_end_where_their_scenes_rest(case, point, within):
    scene = scene_of(case)
    expected = scene.marker(point).position(at_rest(scene, 1.0))[0]
    found, values = run(case)
    assert [values[f"{point}.{axis}"][-1] for axis in "xyz"] == pytest.approx(expected, abs=within)
    assert found.status == "done"


def test_section_forces_of_torsion_are_the_moments_put_on():
    _, values = run("torsion", "output.channels=[beam.root.torsion_moment, beam.root.bending_moment_y]")
    ends = [one[-1] for one in values.values()]
    assert ends == pytest.approx([0.5e6, 2e6], rel=1e-6)


@pytest.mark.parametrize("case", ["torsion", "princeton", "bend_45", "right_angle"])
def test_section_vectors_stay_square_in_every_step(case):
    """To 1e-12 in scenes of a few metres: joints hold to a part of the largest coordinate."""
    settings = ["solve.duration=2"] if case == "right_angle" else []
    scene = scene_of(case, *settings)
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    x = scene.system.absolute(np.array([one.q for one in done.trajectory.segments]))
    for body in scene.bodies.values():
        d = body.vectors(x).reshape(len(x), -1, 3, 3)[:, :, 1:]
        assert np.abs(d @ d.swapaxes(-1, -2) - np.eye(2)).max() < 2e-13 * max(1.0, np.abs(x).max())


# --- pendulum ------------------------------------------------------------------------------------


def test_flexible_pendulum_in_space():
    times = np.array([0.25, 0.5, 0.75, 1.0])
    found, values = run("pendulum_3d")
    tip = np.stack([values[f"b1.tip.{axis}"] for axis in "xyz"], axis=1)
    rows = np.searchsorted(found.t, times - 1e-9)
    assert tip[rows] == pytest.approx(cable_pendulum(times), abs=1e-6)
    assert tip[rows[1]] == pytest.approx((-0.26683389, 0.64647064, -1.15446897), abs=1e-6)
    assert tip[rows[3]] == pytest.approx((-0.39003196, -1.13107237, -0.06289325), abs=1e-6)


def cable_pendulum(times, n=4, length=1.2):
    """Tip positions of the same mesh by its own assembly: six Gauss points an element, DOP853."""
    rho, E, A, second, le = 5540.0, 7e5, 0.0018, 1.215e-8, length / n
    g, w = np.polynomial.legendre.leggauss(6)
    g, w = 0.5 * g + 0.5, 0.5 * w * le
    a, b = g**2, g**3
    N = np.array([1 - 3 * a + 2 * b, le * (g - 2 * a + b), 3 * a - 2 * b, le * (b - a)])
    slope = np.array([-6 * g + 6 * a, le * (1 - 4 * g + 3 * a), 6 * g - 6 * a, le * (3 * a - 2 * g)])
    bend = np.array([-6 + 12 * g, le * (-4 + 6 * g), 6 - 12 * g, le * (6 * g - 2)]) / le**2
    mass, weight = np.zeros((2 * n + 2, 2 * n + 2)), np.zeros((2 * n + 2, 3))
    own = [slice(2 * e, 2 * e + 4) for e in range(n)]
    for k in own:
        mass[k, k] += rho * A * (N * w) @ N.T
        weight[k, 2] -= 9.81 * rho * A * N @ w
    inverse = np.linalg.inv(mass[1:, 1:])

    def rates(t, y):
        r, v = np.split(y, 2)
        r, force = np.vstack([np.zeros(3), r.reshape(-1, 3)]), weight.copy()
        for k in own:
            s, c = slope.T @ r[k] / le, bend.T @ r[k]
            strain = 0.5 * (np.sum(s * s, axis=1) - 1.0)
            force[k] -= E * ((slope / le * (w * A * strain)) @ s + (bend * (w * second)) @ c)
        return np.r_[v, (inverse @ force[1:]).ravel()]

    r = np.zeros((2 * n + 2, 3))
    r[::2, 0], r[1::2, 0] = le * np.arange(n + 1), 1.0
    start = np.r_[r[1:].ravel(), np.cross([0.0, 0.0, 3.0], r)[1:].ravel()]
    found = solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-10, atol=1e-10)
    return found.y.T[:, : len(start) // 2].reshape(len(times), -1, 3)[:, -2]


# --- rotating blade ------------------------------------------------------------------------------

E, RHO, LENGTH = 20e6, 1100.0, 0.5


FLAP = (6.74142013673656, 25.8654764743703, 65.6776685822346)
"""With a hub of a tenth of its length, at a speed of 5; Wright, Smith, Thresher and Wang."""


def blade(degree, elements=3, radius=0.1, speed=5.0, diameter=1e-4):
    """Relative errors of the three flaps: nearest frequencies of a thin blade that turns."""
    unit = float(np.sqrt(RHO * 16.0 / (E * diameter**2)) * LENGTH**2)
    scene = scene_of(
        "blade",
        f"joints.motor.angle={{type: constant_rate, rate: {speed / unit!r}}}",
        f"sections.rod.diameter={diameter!r}",
        f"bodies.blade.elements={elements}",
        f"bodies.blade.degree={degree}",
        f"bodies.hub.points.rim=[{radius * LENGTH!r}, 0.0, 0.0]",
    )
    turning = Turning(scene, (0.0, 0.0, speed / unit))
    return np.array([nearest(turning, one / unit) * unit / one - 1.0 for one in FLAP])


def nearest(turning, frequency):
    found = turning.frequencies(frequency)[:4]
    return found[np.argmin(np.abs(found - frequency))]


def test_frequencies_converge_with_the_degree():
    """The table in the header of the case."""
    errors = np.array([blade(degree) for degree in (3, 4, 5, 6)])
    told = [[4e-4, 3e-3, 9.5e-3], [6e-6, 8.2e-5, 1.1e-3], [5e-8, 8e-7, 2e-5], [2e-8, 2e-8, 1e-6]]
    assert np.all(np.abs(errors) < told)
    assert np.all(np.abs(errors[:3]) > np.array(told[:3]) / 2)


def test_the_model_linear_breaks_down_in_the_blade():
    found, values = run("blade", "solve.model=linear")
    assert "deflects by 10" in found.reason and "times its length" in found.reason
    assert np.abs(values["blade.tip.deflection_y"]).max() > 9.0 * LENGTH
    assert any("left the range of linear" in one for one in found.statistics["warnings"])


# --- Bricard's loop ------------------------------------------------------------------------------


def test_bricard():
    """One equation for the first angle, by its closing condition, against the loop of rigid bodies."""
    found, values = run("bricard", "solve.duration=0.5")
    centre = [values[f"l1.{axis}"][-1] for axis in "xyz"]
    assert centre == pytest.approx(placed(moved(0.0, [ANGLE, 3.0], 0.5)[0])[1][0], abs=3e-7)
    assert centre == pytest.approx((0.28997405, -0.08450947, 0.1743657), abs=3e-7)
    assert (found.status, found.statistics["constraint_position"]) == ("done", pytest.approx(0.0, abs=1e-9))


def test_bricard_s_loop_moves_on_from_where_it_lies_flat():
    """After 0.841 s the second angle goes through zero, and the first one turns back."""
    angle, rate = moved(0.0, [ANGLE, 3.0], 0.7)
    slope = (closing(angle + 1e-5) - closing(angle - 1e-5)) / 2e-5
    other, _ = moved(0.7, [closing(angle), slope * rate], 1.0, by_second)
    assert other < -1.0
    for steps in (["solve.tolerance=1e-5"], ["solve.step=0.02", "solve.method=gauss"]):
        _, values = run("bricard", "solve.duration=1.0", *steps)
        centre = [values[f"l1.{axis}"][-1] for axis in "xyz"]
        assert centre == pytest.approx(placed(other, by_second)[1][0], abs=3e-6)


@pytest.mark.parametrize("tolerance", ["1e-8", "1e-9", "1e-10"])
def test_bricard_s_loop_leaves_out_what_stays_superfluous(tolerance):
    """Without some rows the others come to depend on one another, where explicit steps fail or drift."""
    found, _ = run("bricard", "solve.method=explicit", f"solve.tolerance={tolerance}")
    assert (found.status, found.statistics["constraint_velocity"]) == ("done", pytest.approx(0.0, abs=1e-10))


def closing(angle):
    """Either angle by the other one."""
    return np.arccos(-np.cos(angle) / (1.0 + np.cos(angle)))


def by_first(angle):
    """Angles of the first two hinges."""
    return angle, closing(angle)


def by_second(angle):
    """The same after the first one has gone through zero."""
    return -closing(angle), angle


ANGLE, LINK = 0.6, 0.4
OWN = [rotation(np.array([0.1 * k, 0.2, 0.3 * k])) for k in range(5)]
"""How the bodies' frames are turned at the start."""


def links(angles):
    """Frames of the five moving links: origin at a hinge, first axis along the link."""
    at, found = np.eye(4), []
    for k in range(5):
        turn, step = np.eye(4), np.eye(4)
        turn[:3, :3] = rotation(np.array([0.0, 0.0, angles[k % 2]]))
        step[:3, :3], step[0, 3] = rotation(np.array([(0.5 - k % 2) * np.pi, 0.0, 0.0])), LINK
        found.append(at @ turn)
        at = found[-1] @ step
    return found


def placed(angle, by=by_first):
    """Centres and orientations of the bodies."""
    found = []
    for now, start, own in zip(links(by(angle)), links(by_first(ANGLE)), OWN, strict=True):
        centre = now[:3, 3] + 0.5 * LINK * now[:3, 0]
        found.append((centre, now[:3, :3] @ start[:3, :3].T @ own))
    return found


def energies(angle, by, h=1e-4):
    """Kinetic energy at a rate of sqrt(2), twice that at 1, and weight."""
    kinetic = potential = 0.0
    for (r, R), (ahead, A), (behind, B) in zip(*(placed(angle + k * h, by) for k in (0, 1, -1)), strict=True):
        v, S = (ahead - behind) / (2.0 * h), R.T @ (A - B) / (2.0 * h)
        w = 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])
        kinetic += v @ v + w @ (w * [0.02, 0.03, 0.04])
        potential += 9.81 * r[1]
    return np.array([kinetic, potential])


def angle_rates(t, y, by, h=1e-3):
    slopes = (energies(y[0] + h, by) - energies(y[0] - h, by)) / (2.0 * h)
    return [y[1], -(0.5 * slopes[0] * y[1] ** 2 + slopes[1]) / energies(y[0], by)[0]]


def moved(begin, y, end, by=by_first):
    """Return the angle and its rate at a time."""
    return solve_ivp(angle_rates, (begin, end), y, "DOP853", args=(by,), rtol=1e-9, atol=1e-9).y[:, -1]
