"""Bodies: what each adds of its own to a scene, whatever its kind and model.

The page to read before adding one.  A body has a run of absolute coordinates x, in which its mass matrix,
its forces and its markers are written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.mechanics.chart import Chart
from hfsim.mechanics.equations import VariableMass
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.increments import BodyIncrements
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.pose import Pose, Twist

Place = tuple[float, float]
"""A point in the undeformed body frame [m]."""


def places(points: Mapping[str, Sequence[float]]) -> dict[str, Place]:
    """Return named points as places."""
    return {name: (point[0], point[1]) for name, point in points.items()}


@dataclass(frozen=True)
class Body:
    """A body of an assembled scene.

    Attributes
    ----------
    name : str
        Name in the deck.
    columns : slice
        Its coordinates in x.
    points : dict of str to Place
        Named points.
    """

    name: str
    columns: slice
    points: dict[str, Place]

    @property
    def banded(self) -> bool:
        """Whether large scenes with it may use sparse matrices."""
        return True

    @property
    def item(self) -> str:
        """Its deck path."""
        return f"bodies.{self.name}"

    @property
    def still(self) -> bool:
        """Whether it cannot move: it has no coordinates."""
        return bool(self.columns.start == self.columns.stop)

    @property
    def described(self) -> tuple[str, str]:
        """What its coordinates are, and why there are these, in the words of plans."""
        return "place and angle", "rigid: no elastic coordinates"

    def folded(self, pose: Pose) -> Body:
        """Return the same body held for ever at a pose.

        Raises
        ------
        NotImplementedError
            If it deforms.
        """
        raise NotImplementedError

    # ------------------------------------------------------------------ where it is

    @property
    def angle_column(self) -> int | None:
        """Column of `System.arranged` that is its frame angle with all turns; None where slopes give it."""
        return None

    @property
    def position_columns(self) -> IntArray:
        """Coordinates that are positions, shape (n, n_dim), that of the origin first; none in body frames."""
        return np.zeros((0, 2), dtype=np.intp)

    def marker(self, place: Place) -> Marker:
        """Return the marker of a material point."""
        raise NotImplementedError

    def placed(self, pose: Pose) -> Array:
        """Return the coordinates of the undeformed body, shape (n_columns,)."""
        raise NotImplementedError

    def moving(self, pose: Pose, twist: Twist) -> Array:
        """Return the rates of the undeformed body in rigid motion, shape (n_columns,)."""
        raise NotImplementedError

    def outline(self, x: Array) -> Array:
        """Return points along the body for pictures, shape (n_batch, n_points, n_dim): its named points."""
        places = [(0.0, 0.0), *self.points.values()]
        return np.stack([self.marker(place).position(x) for place in places], axis=1)

    # ------------------------------------------------------------------ its share in the equations

    def mass_entries(self) -> Entries:
        """Return the entries of its constant mass matrix, at the columns of x."""
        return NOTHING

    @property
    def variable_mass(self) -> VariableMass | None:
        """Its mass matrix, where that depends on its coordinates."""
        return None

    def forces(self, n: int) -> Iterator[ForcePart]:
        """Yield its own forces in a scene of n coordinates: weight, elastic forces, damping."""
        yield from ()

    def chart(self) -> Chart | None:
        """Return the map from the coordinates it is stepped in, where they are not x."""
        return None

    def increments(self) -> BodyIncrements | None:
        """Return coordinates for Newton corrections, where its own do not serve."""
        return None
