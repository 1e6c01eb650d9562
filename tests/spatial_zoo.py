"""Coordinates of some bodies in space, and markers on them."""

import numpy as np

from hfsim.maths.rotations import cross, rotation
from hfsim.mechanics.markers import GroundMarker
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.spatial_markers import VectorMarker

BODY, OTHER, LINE = slice(0, 12), slice(12, 24), slice(24, 30)
N = LINE.stop
MARKERS = {
    "ground": GroundMarker(Pose(np.array([0.3, -0.2, 0.1]), np.array([0.4, -0.3, 0.8]))),
    "body": VectorMarker(BODY, np.array([1.0, 0.3, -0.2, 0.4]), np.eye(4)[1:]),
    "other": VectorMarker(OTHER, np.array([1.0, -0.1, 0.5, 0.2]), np.eye(4)[1:]),
    "line": VectorMarker(LINE, np.array([1.0, 0.0]), np.array([[0.0, 1.0]])),
}
PAIRS = [("ground", "body"), ("body", "ground"), ("body", "other"), ("other", "line"), ("line", "body")]
"""First and second marker."""


def rigid(rng):
    """Coordinates of a rigid body somewhere."""
    return np.r_[rng.normal(size=3), rotation(rng.normal(size=3)).T.ravel()]


def random_state(rng):
    """Coordinates (N,) of all bodies; the axes of rigid ones are orthonormal."""
    return np.r_[rigid(rng), rigid(rng), rng.normal(size=6)]


def rigid_motions(x):
    """Rates of all bodies in each common shift along an axis and turn about one, shape (6, N)."""
    return np.array([rigid_motion(x, one[:3], one[3:]) for one in np.eye(6)])


def rigid_motion(x, velocity, spin):
    """Rates (N,) of all bodies in one common rigid motion about the ground's origin."""
    vectors = cross(np.asarray(spin), x.reshape(-1, 3))
    vectors[[BODY.start // 3, OTHER.start // 3, LINE.start // 3]] += velocity
    return vectors.ravel()
