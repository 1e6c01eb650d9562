"""Markers and joints in space against differences; frames, reactions, redundancy of what they hold."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from hfsim.deck.orientation import OrientationSpec
from hfsim.maths.matrices import assemble
from hfsim.maths.rotations import (
    across,
    cross,
    quaternion,
    rotation,
    rotation_of_quaternion,
    rotation_rates,
    rotation_vector,
    skew,
)
from hfsim.mechanics.constraints import Shift, constraints_of
from hfsim.mechanics.directions import Facing, Parallel, Square
from hfsim.mechanics.gradient_markers import SECTIONAL, TANGENTIAL, GradientMarker
from hfsim.mechanics.joint_rows import JointRows
from hfsim.mechanics.markers import GroundMarker
from hfsim.mechanics.orthonormal import Orthonormal
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.resistances import Push
from hfsim.mechanics.section_markers import SectionMarker
from hfsim.mechanics.spatial_markers import FrameMarker, VectorMarker
from hfsim.mechanics.spatial_turns import About, TorqueAbout
from hfsim.mechanics.ties import tie_on
from hfsim.parts.joints.cylindrical import CylindricalSpec
from hfsim.parts.joints.driver import DriverSpec
from hfsim.parts.joints.fixed import FixedSpec
from hfsim.parts.joints.prismatic import PrismaticSpec
from hfsim.parts.joints.revolute import RevoluteSpec
from hfsim.parts.joints.spherical import SphericalSpec
from hfsim.parts.joints.universal import UniversalSpec
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

N = 12 + 12 + 6 + 6 + 18 + 12
BODY, OTHER, LINE, FRAME = slice(0, 12), slice(12, 24), slice(24, 30), slice(30, 36)
SECTION, BLOCK = slice(36, 54), slice(54, 66)
MARKERS = {
    "ground": GroundMarker(Pose(np.array([0.3, -0.2, 0.1]), np.array([0.4, -0.3, 0.8]))),
    "body": VectorMarker(BODY, np.array([1.0, 0.3, -0.2, 0.4]), np.eye(4)[1:]),
    "other": VectorMarker(OTHER, np.array([1.0, -0.1, 0.5, 0.2]), np.eye(4)[1:]),
    "line": VectorMarker(LINE, np.array([1.0, 0.0]), np.array([[0.0, 1.0]])),
    "section": SectionMarker(
        SECTION,
        np.array([0.4, 0.1, -0.1, 0.6, 0.15, -0.15]),
        np.kron([0.4, 0.6], np.eye(3)[1:]),
        rotation(np.array([0.5, -0.3, 0.2])),
    ),
    "gradient": GradientMarker(
        BLOCK,
        np.array([1.0, 0.2, 0.1, -0.3]),
        np.array([[0.0, 0.1, 0.0, 1.0], [0.0, 0.0, 1.0, 0.3]]),
        SECTIONAL,
    ),
    "turned": GradientMarker(
        BLOCK,
        np.array([1.0, 0.2, 0.1, -0.3]),
        np.array([[0.0, 0.1, 0.0, 1.0], [0.0, 0.0, 1.0, 0.3]]),
        SECTIONAL,
        rotation(np.array([0.4, -0.2, 0.7])),
    ),
    "tangential": GradientMarker(BLOCK, np.eye(4)[0], np.eye(4)[1:3], TANGENTIAL),
    "frame": FrameMarker(FRAME, (0.2, 0.1, -0.3), rotation(np.array([0.1, 0.9, -0.4]))),
}
TAPE = VectorMarker(slice(0, 6), np.array([1.0, 0.0]), np.array([[0.0, 1.0]]))
ENDS = ("ground", "ground")
SINE = {"type": "sine", "amplitude": 0.4, "frequency": 0.3, "phase": 0.2, "offset": 0.1}
JOINTS = {
    "revolute": (RevoluteSpec(type="revolute", between=ENDS, axis=(0.1, 1.0, 0.3)), 5),
    "hinge": (RevoluteSpec(type="revolute", between=ENDS), 5),
    "spherical": (SphericalSpec(type="spherical", between=ENDS), 3),
    "universal": (UniversalSpec(type="universal", between=ENDS), 4),
    "cylindrical": (CylindricalSpec(type="cylindrical", between=ENDS, axis=(0.0, 1.0, 2.0)), 4),
    "prismatic": (PrismaticSpec(type="prismatic", between=ENDS, axis=(1.0, 1.0, 0.0)), 5),
    "fixed": (FixedSpec(type="fixed", between=ENDS), 6),
    "driven angle": (DriverSpec(type="driver", between=ENDS, angle=SINE, axis=(0.0, 1.0, 0.0)), 1),
    "driven distance": (DriverSpec(type="driver", between=ENDS, position=SINE, axis=(0.0, 1.0, 0.0)), 1),
}
PAIRS = [
    *(("ground", "body"), ("body", "other"), ("other", "ground")),
    *(("section", "body"), ("ground", "section")),
    *(("gradient", "body"), ("ground", "gradient"), ("section", "gradient")),
    *(("turned", "body"), ("ground", "turned"), ("section", "turned")),
]
FACING = rotation(np.array([0.2, -0.5, 0.3]))


def rigid(rng):
    """Coordinates and rates of a rigid body somewhere."""
    R, spin = rotation(rng.normal(size=3)), rng.normal(size=3)
    return np.r_[rng.normal(size=3), R.T.ravel()], np.r_[rng.normal(size=3), cross(spin, R.T).ravel()], spin


def state(rng):
    """Coordinates of all bodies; axes of bodies are orthonormal."""
    x = rng.normal(size=N)
    x[BODY], x[OTHER] = rigid(rng)[0], rigid(rng)[0]
    x[FRAME][3:] *= 0.7
    x[SECTION] = np.concatenate([np.r_[rng.normal(size=3), rigid(rng)[0][6:]] for _ in range(2)])
    x[BLOCK] = rigid(rng)[0] + 0.15 * rng.normal(size=12)
    return x


def path(rng):
    x, u, a = state(rng), 0.3 * rng.normal(size=N), 0.3 * rng.normal(size=N)
    return (lambda s: x + np.outer(s, u) + 0.5 * np.outer(s * s, a)), x, u, a


def slope(f, step=1e-6):
    lower, upper = f(np.array([-step])), f(np.array([step]))
    return (upper - lower)[0] / (2.0 * step)


def second(f, step=1e-4):
    values = f(np.array([-step, 0.0, step]))
    return (values[0] - 2.0 * values[1] + values[2]) / step**2


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0], [0.3, -0.8, 2.0], [3.0, 0.5, -0.5]])
def test_rotations_and_their_rates(turn):
    turn = np.array(turn)
    R = rotation(turn)
    assert np.allclose(R @ R.T, np.eye(3), rtol=0.0, atol=1e-14)
    assert rotation(rotation_vector(R)) == pytest.approx(R, abs=1e-14)
    assert rotation_of_quaternion(quaternion(R)) == pytest.approx(R, abs=1e-14)
    rate = np.array([0.3, -0.2, 0.5])
    spin = slope(lambda s: (rotation(turn + s[:, None] * rate) @ R.T).reshape(1, 9)).reshape(3, 3)
    assert spin == pytest.approx(skew(rotation_rates(turn) @ rate), abs=1e-8)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.95, 0.1, -2.0)])
def test_two_directions_across_an_axis(axis):
    first, other = map(np.array, across(axis))
    frame = np.array([np.array(axis) / np.linalg.norm(axis), first, other])
    assert np.allclose(frame @ frame.T, np.eye(3), rtol=0.0, atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0)


@pytest.mark.parametrize("name", MARKERS)
def test_marker_against_differences(name, rng):
    marker, (at, x, u, a) = MARKERS[name], path(rng)
    ux = u[None, marker.columns, None]
    own = np.array([1.0, 0.0, 0.0]) if marker.n_axes == 1 else np.array([0.3, -0.5, 0.8])
    assert (marker.position_jacobian(x[None]) @ ux)[0, :, 0] == pytest.approx(
        slope(lambda s: marker.position(at(s))), abs=1e-8
    )
    assert (marker.axis_jacobian(x[None], own) @ ux)[0, :, 0] == pytest.approx(
        slope(lambda s: marker.axis(at(s), own)), abs=1e-8
    )
    if name != "frame":
        full = marker.axis_jacobian(x[None], own) @ a[None, marker.columns, None]
        found = full[0, :, 0] + marker.axis_bias(x[None], u[None], own)[0]
        assert found == pytest.approx(second(lambda s: marker.axis(at(s), own)), abs=1e-5)


@pytest.mark.parametrize("name", [name for name, marker in MARKERS.items() if marker.alike])
def test_axes_of_sums_are_sums_of_axes(name, rng):
    """Angles in space take two axes at once as a complex one."""
    marker, (_, x, u, _), own = MARKERS[name], path(rng), np.eye(3)
    kinds = [marker.axis, marker.axis_jacobian]
    kinds += [lambda x, own: marker.axis_bias(x, u[None], own)] * (name != "frame")
    for told in kinds:
        one, other = told(x[None], own[0]), told(x[None], own[1])
        assert told(x[None], own[0] - 2.0j * own[1]) == pytest.approx(one - 2.0j * other, abs=1e-13)


def test_an_angle_and_its_slopes_are_of_axes_that_are_looked_at_once(monkeypatch, rng):
    seen, axis = [], VectorMarker.axis
    monkeypatch.setattr(VectorMarker, "axis", lambda one, x, own: (seen.append(one), axis(one, x, own))[1])
    part = tie_on(About.of((0.6, 0.0, 0.8), FACING), MARKERS["body"], MARKERS["other"], (Push(2.5),))
    part.add_force(np.zeros(1), state(rng)[None], np.zeros((1, N)), np.zeros((1, N)))
    assert seen == [MARKERS["body"], MARKERS["other"]]


def test_spin_of_a_rigid_body_is_its_angular_velocity(rng):
    marker, x, u = MARKERS["body"], np.zeros((1, N)), np.zeros((1, N))
    x[0, BODY], u[0, BODY], spin = rigid(rng)
    assert marker.spin(x, u)[0] == pytest.approx(spin, abs=1e-14)
    assert marker.turned(x, np.eye(3)[1])[0] == pytest.approx(x[0, 6:9])


def test_spin_of_a_section_is_its_angular_velocity(rng):
    own, x, u = np.eye(2, 3, 1), np.zeros((1, N)), np.zeros((1, N))
    marker = SectionMarker(slice(36, 45), np.eye(3)[0], own, rotation(np.array([0.3, 0.0, 0.0])))
    R, spin = rotation(rng.normal(size=3)), rng.normal(size=3)
    x[0, 39:45], u[0, 39:45] = R.T[1:].ravel(), cross(spin, R.T[1:]).ravel()
    assert marker.spin(x, u)[0] == pytest.approx(spin, abs=1e-14)
    assert marker.frame(x)[0] == pytest.approx(R @ marker.body.T, abs=1e-14)
    a = rng.normal(size=3)
    assert marker.axis(x, a)[0] == pytest.approx(R @ marker.body.T @ a, abs=1e-14)
    bias = slope(lambda s: marker.spin(x + s[:, None] * u, np.repeat(u, len(s), axis=0)))
    assert marker.spin_bias(x, u)[0] == pytest.approx(bias, abs=1e-8)


@pytest.mark.parametrize("name", ["section", "gradient", "turned", "tangential", "frame"])
def test_spin_is_that_of_the_frame_whatever_the_axes(name, rng):
    """Between nodes, section vectors have neither unit length nor right angles."""
    marker, (at, x, u, a) = MARKERS[name], path(rng)
    frame = marker.frame(x[None])[0]
    assert np.allclose(frame.T @ frame, np.eye(3), rtol=0.0, atol=1e-14)
    changed = slope(lambda s: marker.frame(at(s)).reshape(len(s), 9)).reshape(3, 3)
    assert changed @ frame.T == pytest.approx(skew(marker.spin(x[None], u[None])[0]), abs=1e-8)
    for own in (np.eye(3)[1], rng.normal(size=3)):
        assert skew(marker.spin(x[None], u[None])[0]) @ marker.turned(x[None], own)[0] == pytest.approx(
            slope(lambda s, own=own: marker.turned(at(s), own)), abs=1e-8
        )
    if name != "frame":
        rates = slope(lambda s: marker.spin(at(s), u + np.outer(s, a)))
        assert marker.angular_acceleration(x[None], u[None], a[None])[0] == pytest.approx(rates, abs=1e-7)


def test_spin_of_a_strained_section_in_rigid_motion_is_the_angular_velocity(rng):
    """A moment on it then gives the body the angular momentum that it says."""
    marker, x, u = MARKERS["section"], state(rng)[None], np.zeros((1, N))
    spin = rng.normal(size=3)
    u[0, SECTION] = cross(spin, x[0, SECTION].reshape(-1, 3)).ravel()
    assert marker.spin(x, u)[0] == pytest.approx(spin, abs=1e-13)


def test_spin_of_gradient_vectors_is_that_of_their_frame(rng):
    """Stretch and shear of the section in its own plane, and any change of r_x, do not turn it."""
    marker, x, u = MARKERS["gradient"], state(rng)[None], np.zeros((1, N))
    frame, vectors = marker.frame(x)[0], x[0, BLOCK].reshape(4, 3)
    assert np.allclose(frame.T @ frame, np.eye(3), rtol=0.0, atol=1e-14)
    side_z, side_y = marker.axis_rows @ vectors
    assert frame[:, 2] @ side_z == pytest.approx(np.linalg.norm(side_z))
    assert abs(frame[:, 0] @ side_y) < 1e-15 < frame[:, 1] @ side_y
    assert np.linalg.det(frame) == pytest.approx(1.0)
    spin = rng.normal(size=3)
    u[0, BLOCK] = cross(spin, vectors).ravel()
    assert marker.spin(x, u)[0] == pytest.approx(spin, abs=1e-13)
    changed = rng.normal(size=(4, 3))
    rest = [0.3 * side_z, 0.7 * side_z - 0.2 * side_y] - marker.axis_rows[:, 1:2] * changed[1]
    changed[2:] = np.linalg.solve(marker.axis_rows[:, 2:], rest)
    u[0, BLOCK] += changed.ravel()
    assert marker.spin(x, u)[0] == pytest.approx(spin, abs=1e-13)
    along = MARKERS["tangential"].frame(x)[0]
    assert along[:, 0] @ vectors[1] == pytest.approx(np.linalg.norm(vectors[1]))
    assert abs(along[:, 2] @ vectors[2]) < 1e-15 < along[:, 1] @ vectors[2]
    u = 0.3 * rng.normal(size=(1, N))
    bias = slope(lambda s: marker.spin(x + s[:, None] * u, np.repeat(u, len(s), axis=0)))
    assert marker.spin_bias(x, u)[0] == pytest.approx(bias, abs=1e-8)


def test_a_line_does_not_roll(rng):
    marker, x = MARKERS["line"], state(rng)[None]
    t, u = x[0, 27:30], np.zeros((1, N))
    rate = cross(np.array([0.3, -1.0, 0.7]), t)
    u[0, 27:30] = rate + 0.2 * t
    spin = marker.spin(x, u)[0]
    assert spin @ t == pytest.approx(0.0, abs=1e-14)
    assert cross(spin, t) == pytest.approx(rate, abs=1e-14)
    assert marker.frame(x)[0][:, 0] == pytest.approx(t / np.linalg.norm(t))


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
@pytest.mark.parametrize("name", JOINTS)
def test_joint_against_differences(name, pair, rng):
    spec, rows = JOINTS[name]
    first, other = (MARKERS[one] for one in pair)
    found = constraints_of(spec.held(FACING), first, other)
    assert sum(c.rows for c in found) == rows
    at, x, u, a = path(rng)
    zero = np.zeros(1)
    for c in found:
        J = np.zeros((c.rows, N))
        for marker, block in zip(c.ends, c.jacobians(x[None]), strict=True):
            J[:, marker.columns] += block[0]
        c0 = c.standing() if c.law else c
        assert J @ u == pytest.approx(slope(lambda s, c=c: c.gap(at(s))), abs=1e-8)
        bias = c0.bias(x[None], u[None])[0]
        assert J @ a + bias == pytest.approx(second(lambda s, c=c: c.gap(at(s))), abs=2e-5)
        multipliers = rng.normal(size=(1, c.rows))
        entries = c.stiffness(x[None], multipliers)
        K = np.zeros((N, N))
        np.add.at(K, (entries.rows, entries.columns), entries.values)

        def pulled(s, c=c, multipliers=multipliers):
            out = np.zeros((len(s), N))
            for marker, block in zip(c.ends, c.jacobians(at(s)), strict=True):
                out[:, marker.columns] += (multipliers @ block)[:, 0]
            return out

        assert K @ u == pytest.approx(slope(pulled), abs=1e-5)
        force, moment = c.reaction(x[None], multipliers)
        assert force.shape == moment.shape == (1, 3)
        assert np.isfinite(c.residual(zero, x[None])).all()


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("name", [name for name, (_, rows) in JOINTS.items() if rows > 1])
def test_joints_hold_the_frame_of_gradient_vectors(name, end, rng):
    """However stretched and sheared the section is; and no motion but those of the joint's name."""
    spec, rows = JOINTS[name]
    other, x = MARKERS["gradient"], np.zeros((1, N))
    ground = GroundMarker(MARKERS["ground"].pose)
    held = spec.held(FACING if end else FACING.T)
    found = constraints_of(held, *((ground, other) if end else (other, ground)))
    assert sum(c.rows for c in found) == rows
    R = rotation(ground.pose.turn) @ FACING
    sections = R @ np.array([[0.0, 0.0, 1.2], [0.0, 0.8, -0.2], [1.3, 0.2, 0.1]]).T
    vectors = np.linalg.solve(np.vstack([other.axis_rows[:, 1:], [1.0, 0.0, 0.0]]), sections.T)
    x[0, BLOCK] = np.vstack([ground.pose.origin - other.place_row[1:] @ vectors, vectors]).ravel()
    assert other.frame(x)[0] == pytest.approx(R, abs=1e-14)
    assert max(np.abs(c.gap(x)).max() for c in found) < 1e-14
    J = np.concatenate([c.jacobian(end, x)[0] for c in found])
    arms = (x[0, BLOCK].reshape(4, 3) - np.outer([1, 0, 0, 0], ground.pose.origin)).copy()
    shifts = [np.outer([1, 0, 0, 0], axis) for axis in np.eye(3)]
    motions = np.array([*shifts, *(cross(axis, arms) for axis in np.eye(3))]).reshape(6, 12)
    assert np.linalg.matrix_rank(J @ motions.T, tol=1e-9) == rows
    kept = np.vstack([other.spin_jacobian(x)[0], other.position_jacobian(x)[0]])
    deforming = np.linalg.svd(kept)[2][6:]
    assert np.abs(J @ deforming.T).max() < 1e-13


def test_the_axes_of_a_rigid_body_against_differences(rng):
    c = Orthonormal(MARKERS["ground"], MARKERS["body"])
    at, x, u, a = path(rng)
    J = c.jacobian(1, x[None])[0]
    assert J @ u[BODY] == pytest.approx(slope(lambda s: c.gap(at(s))), abs=1e-8)
    bias = c.bias(x[None], u[None])[0]
    assert J @ a[BODY] + bias == pytest.approx(second(lambda s: c.gap(at(s))), abs=1e-5)
    multipliers = rng.normal(size=(1, 6))
    entries = c.stiffness(x[None], multipliers)
    K = np.zeros((N, N))
    np.add.at(K, (entries.rows, entries.columns), entries.values)
    pulled = slope(lambda s: (multipliers @ c.jacobian(1, at(s)))[:, 0])
    assert K[BODY, BODY] @ u[BODY] == pytest.approx(pulled, abs=1e-8)


@pytest.mark.parametrize(
    ("name", "free"), [("revolute", 1), ("universal", 2), ("cylindrical", 2), ("fixed", 0)]
)
def test_a_joint_leaves_the_motions_of_its_name(name, free, rng):
    """Of the six motions of a rigid body, where the joint holds."""
    spec, _ = JOINTS[name]
    first, other = MARKERS["ground"], MARKERS["body"]
    x = np.zeros((1, N))
    R = rotation(first.pose.turn) @ FACING
    place = R @ other.place_row[1:]
    x[0, BODY] = np.r_[first.pose.origin - place, R.T.ravel()]
    found = constraints_of(spec.held(FACING), first, other)
    assert max(np.abs(c.gap(x)).max() for c in found) < 1e-14
    J = np.concatenate([c.jacobian(1, x)[0] for c in found])
    motions = np.zeros((6, 12))
    motions[:3, :3] = np.eye(3)
    motions[3:] = [np.r_[np.zeros(3), cross(axis, R.T).ravel()] for axis in np.eye(3)]
    assert 6 - np.linalg.matrix_rank(J @ motions.T) == free


@pytest.mark.parametrize(
    ("held", "rows"),
    [
        (Facing.of(np.eye(3)), 2),
        (Parallel((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), 2),
        (Parallel((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), 1),
        (Parallel((0.0, 0.6, 0.8), (0.6, 0.0, 0.8)), 0),
        (Square((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)), 1),
        (Square((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), 0),
    ],
)
def test_what_can_be_held_of_a_line(held, rows):
    """A hinge across a line holds one direction, one along it two; what needs a section is not held."""
    assert len(held.between(MARKERS["body"], MARKERS["line"])) == rows


@pytest.mark.parametrize(
    ("held", "ends", "rows"),
    [
        (Facing.of(np.eye(3)), ("line", "body"), 2),
        (Facing.of(np.eye(3)), ("line", "tape"), 2),
        (Facing.of(rotation(np.array([0.0, 0.0, np.pi / 2]))), ("line", "tape"), 1),
        (Parallel((1.0, 0.0, 0.0), (0.0, 0.6, 0.8)), ("line", "body"), 2),
        (Parallel((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), ("line", "body"), 1),
        (Parallel((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), ("line", "tape"), 1),
        (Parallel((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), ("line", "tape"), 0),
    ],
)
def test_what_can_be_held_from_a_line(held, ends, rows):
    first, second = (MARKERS.get(name, TAPE) for name in ends)
    assert sum(c.rows for c in held.between(first, second)) == rows
    assert held.fits(True, ends[1] == "tape")


def test_tangents_of_two_lines_have_one_direction(rng):
    """Jacobian and bias hold where the gaps are zero: along a motion in which both lines turn and stretch."""
    (c,) = Facing.of(np.eye(3)).between(MARKERS["line"], TAPE)
    turn, spin, swing = 0.4 * rng.normal(size=(3, 3))
    ratio, x = np.array([1.3, 0.2, -0.5]), np.zeros((1, N))

    def at(s):
        R = rotation(turn + s[:, None] * spin + 0.5 * s[:, None] ** 2 * swing)
        t = (1.0 + 0.3 * s[:, None]) * R[:, :, 0]
        found = np.repeat(x, len(s), axis=0)
        found[:, 27:30], found[:, 3:6] = t, (ratio[0] + ratio[1] * s + ratio[2] * s**2)[:, None] * t
        return found

    x0, u, a = at(np.zeros(1)), slope(at), second(at)
    assert c.gap(x0) == pytest.approx(np.zeros((1, 2)), abs=1e-14)
    J = np.zeros((2, N))
    for marker, block in zip(c.ends, c.jacobians(x0), strict=True):
        J[:, marker.columns] += block[0]
    for k in (*range(3, 6), *range(27, 30)):
        moved = np.array([np.eye(N)[k] * s for s in (-1e-6, 1e-6)]) + x0
        assert J[:, k] == pytest.approx((c.gap(moved)[1] - c.gap(moved)[0]) / 2e-6, abs=1e-8)
    assert J @ u == pytest.approx(np.zeros(2), abs=1e-8)
    assert np.abs(J @ a).max() > 0.05
    assert J @ a + c.bias(x0, u[None])[0] == pytest.approx(np.zeros(2), abs=1e-6)
    force, moment = c.reaction(x0, np.array([[2.0, -1.0]]))
    assert np.abs(moment).max() > 1.0
    assert moment[0] @ x0[0, 27:30] == pytest.approx(0.0, abs=1e-12)
    assert not force.any()


@pytest.mark.parametrize("tilt", [[0.0, 0.0, 0.0], [0.4, -0.8, 0.0], [np.pi, 0.0, 0.0]])
def test_an_angle_about_an_axis_counts_from_the_smallest_rotation(tilt):
    """Wherever on its way the scene is assembled: the tilt has no part about the axis."""
    tilt = rotation(np.array(tilt))
    about = About.of((0.0, 0.0, 1.0), rotation(np.array([0.0, 0.0, 0.5])) @ tilt)
    (c,) = about.between(MARKERS["ground"], MARKERS["body"])
    x = np.zeros((1, N))
    for angle in (0.0, 0.7, -2.0):
        R = rotation(MARKERS["ground"].pose.turn) @ rotation(np.array([0.0, 0.0, angle])) @ tilt
        x[0, BODY] = np.r_[np.zeros(3), R.T.ravel()]
        assert c.gap(x)[0, 0] == pytest.approx(angle, abs=1e-14)


@pytest.mark.parametrize("name", ["section", "gradient", "turned", "tangential", "line"])
def test_a_distance_along_an_axis_is_that_of_its_frame(name, rng):
    """However long its own axes are: 0.7 m are 0.7 m, and a force is as large as it says."""
    x, axes = state(rng), (np.eye(3) if name != "line" else np.eye(1, 3))
    first, second = MARKERS[name], MARKERS["body"]
    frame = first.frame(x[None])[0]
    x[BODY][:3] += first.position(x[None])[0] + frame @ [0.7, -0.4, 0.2] - second.position(x[None])[0]
    for axis, distance in zip(axes, (0.7, -0.4, 0.2), strict=False):
        (c,) = Shift(tuple(axis)).between(first, second)
        assert c.gap(x[None])[0, 0] == pytest.approx(distance, abs=1e-14)
        assert c.reaction(x[None], np.array([[-2.0]]))[0][0] == pytest.approx(2.0 * frame @ axis, abs=1e-14)


def test_a_distance_along_the_tangent_of_a_line_against_differences(rng):
    (c,) = Shift((2.0, 0.0, 0.0)).between(MARKERS["line"], MARKERS["body"])
    at, x, u, a = path(rng)

    def rate(moved, rates):
        J = c.jacobians(moved)
        return sum((one @ rates[m.columns])[:, 0] for m, one in zip(c.ends, J, strict=True))

    assert rate(x[None], u)[0] == pytest.approx(slope(lambda s: c.gap(at(s)))[0], abs=1e-8)
    bias = c.bias(x[None], u[None])[0, 0]
    assert rate(x[None], a)[0] + bias == pytest.approx(second(lambda s: c.gap(at(s)))[0], abs=2e-5)


def test_axes_of_a_node_are_square_themselves():
    """Nothing but vectors of the state is evaluated of them."""
    node = replace(MARKERS["section"], axis_rows=np.eye(6)[1:3])
    assert node.square is node
    assert MARKERS["body"].square is MARKERS["body"]
    assert MARKERS["section"].square is not MARKERS["section"]


@pytest.mark.parametrize("swing", [[0.0, 0.0, 0.0], [0.0, 1.7, 0.0], [-2.0, 2.2, 0.0]])
def test_an_angle_about_an_axis_is_that_of_twist_whatever_the_swing(swing):
    """Also beyond a right angle, and its multiplier is the moment that does its work."""
    (c,) = About.of((0.0, 0.0, 1.0), np.eye(3)).between(MARKERS["ground"], MARKERS["body"])
    x, level = np.zeros((1, N)), rotation(MARKERS["ground"].pose.turn)
    for angle in (0.0, 0.7, -2.0):
        R = level @ rotation(np.array([0.0, 0.0, angle])) @ rotation(np.array(swing))
        x[0, BODY] = np.r_[np.zeros(3), R.T.ravel()]
        assert c.gap(x)[0, 0] == pytest.approx(angle, abs=1e-12)
        moment = c.reaction(x, np.array([[-1.0]]))[1][0]
        for spin in np.eye(3):
            rates = np.r_[np.zeros(3), np.cross(spin, R.T).ravel()]
            assert (c.jacobian(1, x)[0] @ rates)[0] == pytest.approx(moment @ spin, abs=1e-11)


@pytest.mark.parametrize("tilt", [np.pi, np.pi - 1e-9, np.pi - 1e-5])
def test_an_angle_about_an_axis_that_points_the_other_way_has_finite_slopes(tilt):
    """It is not known there, but iterations go on from such places."""
    (c,) = About.of((0.0, 0.0, 1.0), np.eye(3)).between(GroundMarker(Pose.level((0.0,) * 3)), MARKERS["body"])
    x, u = np.zeros((1, N)), np.ones((1, N))
    R = rotation(np.array([tilt, 0.0, 0.0])) if tilt < np.pi else np.diag([1.0, -1.0, -1.0])
    x[0, BODY] = np.r_[np.zeros(3), R.T.ravel()]
    with np.errstate(all="raise"):
        found = c.gap(x), c.jacobian(1, x), c.bias(x, u), c.stiffness(x, np.ones((1, 1))).values
    for values in found:
        assert np.isfinite(values).all() and np.abs(values).max() < 1e17


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_a_torque_about_an_axis_does_the_work_of_the_spin_about_it(first, second, rng):
    """On points of rigid and flexible bodies; the tangent is the slope of the force."""
    a, b, axis, t = MARKERS[first], MARKERS[second], np.array([0.6, 0.0, 0.8]), np.zeros(1)
    held = TorqueAbout(About.of(tuple(axis), FACING))
    part = tie_on(held, a, b, (Push(2.5),))
    x, u = state(rng)[None], rng.normal(size=(1, N))
    carried = a.turned(x, axis)[0]
    power = 2.5 * carried @ (b.spin(x, u) - a.spin(x, u))[0]
    force = np.zeros((1, N))
    part.add_force(t, x, u, force)
    assert (force @ u[0])[0] == pytest.approx(power, rel=1e-12)
    assert part.power(t, x, u)[0] == pytest.approx(power, rel=1e-12)
    assert part.reaction(t, x, u)[1][0] == pytest.approx(2.5 * carried, rel=1e-12)
    assert part.counter is None and not part.potential_energy(t, x).any()

    def forces(steps):
        out = np.zeros((len(steps), N))
        part.add_force(np.zeros(len(steps)), x + np.outer(steps, u[0]), np.zeros((len(steps), N)), out)
        return out

    tangent = assemble([part.tangent(t, x, u)], (N, N), False)
    expected = slope(forces)
    assert -tangent @ u[0] == pytest.approx(expected, abs=1e-5 * max(1.0, np.abs(expected).max()))


def test_a_torque_about_the_axis_of_a_line_is_that_of_its_tangent(rng):
    held = TorqueAbout(About.of((0.0, 0.0, 1.0), np.eye(3)))
    of_angle = tie_on(held.angle, MARKERS["body"], MARKERS["line"], (Push(2.5),))
    part = tie_on(held, MARKERS["body"], MARKERS["line"], (Push(2.5),))
    assert held.fits(False, True) and not held.fits(True, False)
    assert held.between(MARKERS["line"], MARKERS["body"]) == ()
    x, t, one, other = state(rng)[None], np.zeros(1), np.zeros((1, N)), np.zeros((1, N))
    of_angle.add_force(t, x, x, one)
    part.add_force(t, x, x, other)
    assert np.array_equal(one, other) and one.any()


@pytest.mark.parametrize("sparse", [False, True])
def test_products_of_a_whole_scene_are_those_of_each_joint(sparse, rng):
    found = [
        Orthonormal(MARKERS["ground"], MARKERS["body"]),
        Orthonormal(MARKERS["ground"], MARKERS["other"]),
    ]
    for k, (spec, _) in enumerate(JOINTS.values()):
        found += constraints_of(spec.held(FACING), *(MARKERS[one] for one in PAIRS[k % 3]))
    found += Facing.of(FACING).between(MARKERS["body"], MARKERS["line"])
    phi = JointRows(tuple(found), N, sparse)
    assert sum(len(c.products) for c in found) > 20
    x, u, t = np.array([state(rng), state(rng)]), rng.normal(size=(2, N)), np.array([0.1, 0.3])
    J, multipliers = np.zeros((2, phi.n_rows, N)), rng.normal(size=(1, phi.n_rows))
    stiff = []
    for c, rows in zip(found, phi.rows, strict=True):
        for marker, block in zip(c.ends, c.jacobians(x), strict=True):
            J[:, rows, marker.columns] += block
        stiff.append(c.stiffness(x[:1], multipliers[:, rows]))
    each = [
        np.concatenate(parts, axis=1)
        for parts in zip(*((c.residual(t, x), c.acceleration(t, x, u)) for c in found), strict=True)
    ]
    assert phi.residual(t, x) == pytest.approx(each[0], abs=1e-13)
    assert phi.curvature(t, x, u) == pytest.approx(each[1], abs=1e-12)
    assert phi.drift(t, x, u) == pytest.approx((J @ u[..., None])[..., 0] + phi.rate(t), abs=1e-13)
    assert np.allclose(phi.jacobians(x), J, rtol=0.0, atol=1e-14)
    one = phi.jacobian_at(x[:1])
    assert np.allclose(one.toarray() if sparse else one, J[0], rtol=0.0, atol=1e-14)
    mine, theirs = (assemble(parts, (N, N), False) for parts in (phi.stiffness(x[:1], multipliers), stiff))
    assert np.allclose(mine, theirs, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("ends", [*permutations(("ground", "line")), *permutations(("body", "line"))])
def test_a_line_hinged_to_the_ground_has_linear_equations(ends, sparse, rng):
    found = constraints_of(JOINTS["hinge"][0].held(np.eye(3)), *(MARKERS[one] for one in ends))
    phi = JointRows(found, N, sparse)
    assert phi.n_rows == 4
    assert phi.constant == ("ground" in ends)
    x, u, t = np.array([state(rng), state(rng)]), rng.normal(size=(2, N)), np.zeros(2)
    gaps = np.concatenate([c.gap(x) for c in found], axis=1)
    assert phi.residual(t, x) == pytest.approx(gaps, abs=1e-14)
    J = np.broadcast_to(phi.jacobians(x), (2, phi.n_rows, N))
    assert phi.drift(t, x, u) == pytest.approx((J @ u[..., None])[..., 0], abs=1e-13)
    assert phi.curvature(t, x, u) == pytest.approx(-np.hstack([c.bias(x, u) for c in found]), abs=1e-12)


def test_axes_are_kept_as_square_far_away_as_near():
    """What counts as closed goes with the size of the scene for places alone."""
    text = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies: {box: {type: rigid, mass: 1.0, inertia: [1.0, 2.0, 2.5]}}
initial: {box: {position: [1000.0, 0.0, 0.0]}}
solve: {duration: 1.0}
"""
    system = (built := build(parse_deck(text))).system
    off = built.q + 5e-12 * np.sin(np.arange(1.0, system.n + 1.0))
    q, _ = system.project(np.zeros(1), off[None], built.v[None])
    assert np.abs(system.residual(np.zeros(1), system.absolute(off[None]))).max() > 1e-12
    assert np.abs(system.residual(np.zeros(1), system.absolute(q))).max() < 1e-13


@pytest.mark.parametrize("tilt", [[0.0, 0.0, 0.0], [0.4, -0.8, 0.0]])
def test_an_angle_from_an_orientation_is_the_twist_from_there_about_the_axis_at_the_start(tilt):
    """Of a body that starts tilted against the stated orientation the axis is what lies along A's then."""
    zero = rotation(np.array([0.0, 0.0, 0.3]))
    facing = rotation(np.array(tilt)) @ rotation(np.array([0.0, 0.0, 0.5])) @ zero
    stated = OrientationSpec(rotation_vector=(0.0, 0.0, 0.3))
    (c,) = About.of((0.0, 0.0, 1.0), facing, zero=stated).between(MARKERS["ground"], MARKERS["body"])
    x, level = np.zeros((1, N)), rotation(MARKERS["ground"].pose.turn)

    def angle(R):
        x[0, BODY] = np.r_[np.zeros(3), (level @ R).T.ravel()]
        return c.gap(x)[0, 0]

    assert angle(zero) == pytest.approx(0.0, abs=1e-14)
    for turn in (0.0, 0.7, -2.0):
        assert angle(rotation(np.array([0.0, 0.0, turn])) @ facing) == pytest.approx(0.5 + turn, abs=1e-14)
