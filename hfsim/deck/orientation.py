"""How decks state the orientation of a frame in space, in four forms."""

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Angle, Axis, Number, SpatialAngle, entries, shortest
from hfsim.deck.spec import Before, Spec
from hfsim.maths.arrays import Array

FORMS = "{axis, angle}, {rotation_vector}, {quaternion: [w, x, y, z]} or {x, y}"
"""The forms, as hints show them."""
_PARALLEL = 1e-6
"""Sine of the angle between x and y below which they tell no plane."""
_SQUARE = 1e-3
"""Cosine of that angle from which they are not at right angles."""


def _checked(q: tuple[float, ...]) -> tuple[float, ...]:
    return shortest(q, "a quaternion")


Quaternion = Annotated[
    tuple[Number, ...],
    Before(lambda value: entries(value, (4,), "numbers")),
    AfterValidator(_checked),
]


class OrientationSpec(Spec):
    """Orientation of a frame in space."""

    vectors = ("axis", "rotation_vector", "x", "y")
    spatial = True

    axis: Axis | None = None
    """Axis of the rotation from the ground's axes, with the angle [-]."""

    angle: Angle | None = None
    """Angle about the axis [rad]."""

    rotation_vector: SpatialAngle | None = None
    """Axis of the rotation times its angle [rad]."""

    quaternion: Quaternion | None = None
    """Unit quaternion [w, x, y, z] of the rotation [-]; its length does not matter."""

    x: Axis | None = None
    """Where the first axis of the frame points [-]; with y."""

    y: Axis | None = None
    """Where the second axis points [-]; at right angles to x."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield an orientation in none of the four forms, or axes that are not at right angles."""
        stated = {key for key in type(self).model_fields if getattr(self, key) is not None}
        if stated not in ({"axis", "angle"}, {"rotation_vector"}, {"quaternion"}, {"x", "y"}):
            told = " and ".join(sorted(stated)) + (" alone is" if len(stated) == 1 else " together are")
            yield Complaint((), f"{told if stated else 'is'} none of its forms", f"give one of {FORMS}")
        elif self.x is not None and self.y is not None and len(self.x) == len(self.y) == 3:
            x, y = (np.asarray(one) / np.linalg.norm(one) for one in (self.x, self.y))
            if np.linalg.norm(np.cross(x, y)) < _PARALLEL:
                yield Complaint(("y",), "points along x", "give the direction of the second axis")
            elif abs(x @ y) > _SQUARE:
                degrees = np.degrees(np.arccos(x @ y))
                near = ", ".join(f"{part:.6g}" for part in y - (x @ y) * x)
                message = f"is at {degrees:.4g} degrees to x, not at right angles"
                yield Complaint(("y",), message, f"[{near}] is the nearest that is")

    @property
    def matrix(self) -> Array:
        """The rotation as a matrix (3, 3): its columns are the axes of the frame, in ground axes."""
        from hfsim.maths.rotations import rotation, rotation_of_quaternion

        if self.quaternion is not None:
            return rotation_of_quaternion(np.array(self.quaternion))
        if (vector := self._vector) is not None:
            return rotation(vector)
        x = np.asarray(self.x) / np.linalg.norm(np.asarray(self.x))
        y = np.asarray(self.y) - (np.asarray(self.y) @ x) * x
        y /= np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])

    @property
    def turns(self) -> Array:
        """Its rotation vector (3,), with the full turns that are stated [rad]."""
        from hfsim.maths.rotations import rotation_vector

        return rotation_vector(self.matrix) if (vector := self._vector) is None else vector

    @property
    def states_turns(self) -> bool:
        """Whether it states full turns: by an angle or a rotation vector."""
        return self._vector is not None

    @property
    def _vector(self) -> Array | None:
        """The rotation vector (3,) of the first two forms."""
        if self.rotation_vector is not None:
            return np.array(self.rotation_vector)
        if self.axis is not None:
            return np.asarray((self.angle or 0.0) * np.asarray(self.axis) / np.linalg.norm(self.axis))
        return None


def about_z(angle: float) -> Array:
    """Return the matrix (3, 3) of a rotation about the third axis."""
    from hfsim.maths.rotations import rotation

    return rotation(np.array([0.0, 0.0, angle]))


def matrix_of(entry: Any) -> Array | None:
    """Return the rotation that an entry states by ``orientation`` or by ``angle`` about z; None without."""
    if entry is None:
        return None
    if entry.orientation is not None:
        return np.asarray(entry.orientation.matrix)
    return None if entry.angle is None else about_z(entry.angle)
