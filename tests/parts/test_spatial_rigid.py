"""Rigid bodies in space against closed forms: tumbling, many turns, a heavy top; the order of each method."""

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from published import published
from scipy.integrate import quad
from scipy.special import ellipj

from hfsim.marching.integration import run_integration
from hfsim.maths.rotations import rotation
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

CASES = Path(__file__).parents[2] / "cases"
J = np.array([1.0, 2.0, 2.5])
SPIN = np.array([0.5, 0.0, 8.0])
"""Moments of inertia [kg m^2] and angular velocity at the start [rad/s], both in body axes."""
BODY = """hfsim: 1
bodies: {box: {type: rigid, mass: 2.0, inertia: %s}}
initial: {box: {angular_velocity: %s}}
solve: {duration: %r, tolerance: %r, %s}
"""


def moved(text):
    """Return axes as rows and angular velocity of the box at the end of a run, and its trajectory."""
    scene = build(parse_deck(text))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    q, v = (one[None] for one in (done.trajectory.q, done.trajectory.v))
    marker = scene.marker("box")
    return marker.axes(q)[0], marker.spin(q, v)[0], done.trajectory


def body(duration, tolerance=1e-12, how="method: gauss", inertia=J, spin=SPIN):
    return moved(BODY % (list(map(float, inertia)), list(map(float, spin)), duration, tolerance, how))


def tumbling(t):
    """Angular velocity in body axes (Jacobi), where the second one is zero at the start."""
    (a, _, c), (j1, j2, j3) = SPIN, J
    b = a * np.sqrt(j1 * (j3 - j1) / (j2 * (j3 - j2)))
    n = c * np.sqrt((j3 - j1) * (j3 - j2) / (j1 * j2))
    sn, cn, dn, _ = ellipj(n * t, (j2 - j1) * a * b / (c * n * j3))
    return np.array([a * cn, b * sn, c * dn])


def azimuth(t):
    """How far the third axis has gone about the angular momentum [rad], from the exact rates."""
    size = np.linalg.norm(J * SPIN)

    def rate(s):
        w = tumbling(s)[:2]
        return size * np.sum(J[:2] * w**2) / np.sum((J[:2] * w) ** 2)

    pieces = np.linspace(0.0, t, 401)
    return sum(quad(rate, *ends, epsabs=1e-14, epsrel=1e-13)[0] for ends in pairwise(pieces))


@pytest.mark.slow
def test_a_tumbling_body_is_exact_after_a_hundred_turns():
    duration = 100.0 * 2.0 * np.pi / 8.0
    axes, spin, path = body(duration)
    assert axes @ spin == pytest.approx(tumbling(duration), abs=8e-9)
    momentum = J * SPIN
    assert (J * (axes @ spin)) @ axes == pytest.approx(momentum, abs=2e-8)
    along = momentum / np.linalg.norm(momentum)
    aside = np.array([0.0, 1.0, 0.0])
    ahead = np.cross(aside, along)
    before, after = (np.arctan2(one @ aside, one @ ahead) for one in (np.eye(3)[2], axes[2]))
    off = after - before - azimuth(duration)
    assert off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)) == pytest.approx(0.0, abs=1e-7)
    ends = np.array([one.q[3:] for one in path.segments]).reshape(-1, 3, 3)
    assert np.abs(ends @ ends.swapaxes(1, 2) - np.eye(3)).max() < 1e-12


@pytest.mark.parametrize(
    ("turns", "axis"),
    [
        (50, (0.0, 0.0, 1.0)),
        (50, (1.0, 2.0, -2.0)),
        pytest.param(1000, (1.0, 2.0, -2.0), marks=pytest.mark.slow),
        pytest.param(1000, (1.0, 0.0, 0.0), marks=pytest.mark.slow),
    ],
)
def test_many_turns_about_any_axis(turns, axis):
    """A ball turns about any axis for ever; through every orientation there is."""
    unit, angle = np.array(axis) / np.linalg.norm(axis), 2.0 * np.pi * (turns + 0.125)
    axes, spin, _ = body(1.0, 1e-10, spin=angle * unit, inertia=(1.0, 1.0, 1.0))
    assert spin == pytest.approx(angle * unit, rel=1e-10, abs=1e-7)
    assert pytest.approx(rotation(0.25 * np.pi * unit), abs=1e-9 * turns) == axes.T


ORDERS = {
    "gauss, stages: 1": (2, 200),
    "gauss, stages: 2": (4, 80),
    "gauss, stages: 3": (6, 40),
    "gauss, stages: 4": (8, 11),
    "radau, stages: 2": (3, 160),
    "radau, stages: 3": (5, 80),
    "energy, stages: 1": (2, 250),
    "energy, stages: 2": (4, 80),
    "gear, order: 2": (2, 1000),
    "gear, order: 3": (3, 800),
    "gear, order: 4": (4, 800),
    "gear, order: 5": (5, 400),
    "generalized_alpha, rho_inf: 0.8": (2, 300),
    "explicit": (8, 13),
}


@cache
def tumbled(how):
    """Axes of a tumbling body after a second."""
    return np.array(body(1.0, 1e-9, f"method: {how}", spin=np.array([0.5, 8.0, 0.2]))[0])


@pytest.mark.parametrize(
    "how", [pytest.param(one, marks=pytest.mark.slow) if "gear" in one else one for one in ORDERS]
)
def test_every_method_keeps_its_order_on_a_tumbling_body(how):
    order, count = ORDERS[how]
    exact = tumbled("gauss, stages: 12, step: 0.005")
    found = [tumbled(f"{how}, step: {h!r}") for h in (1.0 / count, 0.5 / count)]
    errors = [np.abs(one - exact).max() for one in found]
    assert errors[1] > 2e-11, "the error is round-off: nothing is measured"
    # the last coefficients of the explicit method nearly cancel here: 8.3 to 8.4
    assert order - 0.2 < np.log2(errors[0] / errors[1]) < order + (0.45 if how == "explicit" else 0.2)


def test_a_flat_heavy_top_is_where_the_published_one_is():
    """Its moments touch the triangle inequality: the mass matrix of its axes is singular."""
    scene = build(load_deck(CASES / "heavy_top.yaml", ["solve.tolerance=1e-9"]))
    assert scene.system.equations.ballast is not None
    done = run_integration(scene, scene.deck.solve)
    for t, name, value in published("heavy_top"):
        place = done.trajectory.at(np.array([t]))[0][0, "xyz".index(name[-1])]
        assert place == pytest.approx(value, abs=1e-10)


def test_products_of_inertia_are_those_of_turned_axes():
    """The same body with its matrix in other body axes moves the same."""
    R = np.linalg.qr(np.array([[1.0, 2.0, 0.3], [0.1, 1.0, -1.0], [0.4, 0.2, 1.0]]))[0]
    R *= np.linalg.det(R)
    matrix = [list(map(float, row)) for row in R @ np.diag(J) @ R.T]
    spin = R @ np.array([0.5, 8.0, 0.2])
    text = BODY % (matrix, list(map(float, spin)), 1.0, 1e-11, "method: gauss")
    axes, _, _ = moved(text)
    plain, _, _ = body(1.0, 1e-11, spin=np.array([0.5, 8.0, 0.2]))
    # columns of axes^T are body axes: A' = R A R^T
    assert pytest.approx(R @ plain.T @ R.T, abs=1e-8) == axes.T


def test_the_slider_of_a_stiff_governor_is_where_minimal_coordinates_put_it():
    """Four bodies on hinges and a guide, springs of 8e5 N/m and dampers of 4e4 N s/m."""
    scene = build(load_deck(CASES / "governor.yaml", ["solve.duration=2", "solve.tolerance=1e-7"]))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    slider = scene.marker("slider")
    for t, _, height in published("governor", 2.0):
        assert slider.position(done.trajectory.at(np.array([t]))[0])[0, 2] == pytest.approx(height, abs=2e-9)


DISC = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies:
  disc:
    type: rigid
    mass: 2.0
    inertia: %s
    points: {rim: %s, other: %s, top: %s}
  bar: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.2], points: {end: [0.5, 0.0, 0.0]}}
joints:
  hold: {type: spherical, between: [ground, disc.rim]}
  link: {type: %s, between: [disc.other, bar.end]}
springs: {coil: {type: two_point, between: [ground, bar], stiffness: 3.0, damping: 0.2}}
initial: {disc: {orientation: {rotation_vector: [0.4, -0.8, 0.2]}, angular_velocity: [1.0, 2.0, -3.0]}}
solve: {duration: 0.5, tolerance: 1.0e-11}
"""


@pytest.mark.parametrize("joint", ["revolute", "fixed", "universal", "cylindrical", "spherical"])
@pytest.mark.parametrize("tilt", [[0.0, 0.0, 0.0], [0.3, 1.2, -0.2]])
def test_a_flat_body_moves_the_same_with_two_axes_as_with_three(joint, tilt):
    """A point beside its plane needs all three; the third has no mass then, and no inverse."""
    R = rotation(np.array(tilt))
    E = R @ np.diag([0.05, 0.08, 0.0]) @ R.T
    inertia = (np.trace(E) * np.eye(3) - E).tolist()

    def end(beside):
        points = [(R @ one).tolist() for one in ([0.3, -0.1, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, beside])]
        scene = build(parse_deck(DISC % (inertia, *points, joint)))
        done = run_integration(scene, scene.deck.solve)
        assert done.stop is None
        x = scene.system.absolute(done.trajectory.q[None])
        turned = scene.marker("disc").turned(x, np.eye(3))
        place = np.concatenate([scene.marker("bar").position(x)[0], turned.ravel()])
        return place, scene.system.equations.ballast is None

    (flat, inverse), (whole, none) = end(0.0), end(0.2)
    assert (inverse, none) == (True, False)
    assert flat == pytest.approx(whole, abs=1e-9)
