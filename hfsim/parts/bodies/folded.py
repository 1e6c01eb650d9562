"""Bodies that cannot move, in plane and space."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.mechanics.body import Body, Place
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.markers import GroundMarker, Marker
from hfsim.mechanics.pose import Pose, Twist


@frozen
class FoldedBody(Body):
    """A body that cannot move: it has no coordinates, and its points are points of the ground.

    Attributes
    ----------
    weight : ndarray, shape (n_dim,)
        [N].
    """

    pose: Pose
    weight: Array

    @property
    def n_dim(self) -> int:  # type: ignore[override]
        """Of the space it is in."""
        return len(self.weight)

    @property
    def described(self) -> tuple[str, str]:
        """What is left of it."""
        return "points of the ground", "cannot move"

    def marker(self, place: Place) -> Marker:
        """Return a point of the ground."""
        return GroundMarker(self.pose._replace(origin=self.pose.placed(np.array(place, dtype=float))))

    def placed(self, pose: Pose) -> Array:
        """Return no coordinates."""
        return np.zeros(0)

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return no rates."""
        return np.zeros(0)

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield the weight, which does no work: only its energy counts."""
        energy = -float(self.weight @ self.pose.origin)
        yield ConstantForce(n, np.zeros(0, dtype=np.intp), np.zeros(0), energy, item=self.item)
