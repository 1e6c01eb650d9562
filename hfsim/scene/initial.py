"""What decks say of the start: places and rates of bodies, and which of them start from where they rest."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np

from hfsim.deck.complaints import Complaint, refusal, shown
from hfsim.deck.fields import (
    Angle,
    Flag,
    Length,
    LengthVector,
    Orientation,
    Spin,
    Velocity,
    VelocityVector,
)
from hfsim.deck.spec import Around, ReadBy, Spec
from hfsim.maths.arrays import Array

_FAST = 1000.0
"""Angular velocity of which one asks whether it is stated in radians per second [rad/s]."""


class InitialSpec(Spec):
    """Motion of one body at the start, absolute, or of what one joint leaves free, as its channels have it;
    what is not stated follows from the joints.
    """

    vectors = ("position", "velocity", "angular_velocity")
    spatial = ("orientation",)
    angles = ("angle",)

    angle: Angle | None = None
    """Angle of the body frame, in space about z; or that of a joint [rad]."""

    orientation: Orientation | None = None
    """Orientation of the body frame in space, against the ground's axes."""

    angular_velocity: Spin | None = None
    """Angular velocity of the body frame [rad/s]: a number, in space about z, or three in ground axes; or how
    fast the angle of a joint grows."""

    distance: Length | None = None
    """Distance that a joint leaves free [m]."""

    distance_rate: Velocity | None = None
    """Its rate [m/s]."""

    position: LengthVector | None = None
    """Position of the body's origin [m]."""

    velocity: VelocityVector | None = None
    """Velocity of the body's origin [m/s]."""

    exact: Flag = False
    """Whether these values must hold as they are; else they are guesses where joints miss them by little."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield an orientation that is stated twice."""
        if self.angle is not None and self.orientation is not None:
            yield Complaint(("angle",), "orientation says this already", "leave one of them out", True)

    def turn(self, n_dim: int) -> Array | None:
        """Return how the frame is turned: an angle (1,), in space a matrix (3, 3); None if that is open."""
        if n_dim == 3:
            from hfsim.deck.orientation import matrix_of

            return matrix_of(self)
        return None if self.angle is None else np.array([self.angle])

    @property
    def turns(self) -> Array | None:
        """Rotation vector of the frame in space (3,), with the full turns that are stated; None if open."""
        if self.orientation is not None:
            return np.asarray(self.orientation.turns)
        return None if self.angle is None else np.array([0.0, 0.0, self.angle])

    def spin(self, n_dim: int) -> Array | None:
        """Return the angular velocity, shape (n_spin,), in ground axes; None where it is not stated."""
        w = self.angular_velocity
        if w is None:
            return None
        if isinstance(w, tuple):
            return np.array(w)
        return np.array([w] if n_dim == 2 else [0.0, 0.0, w])

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an angle that looks like degrees, and a speed that looks like revolutions per minute."""
        yield from super().slips_in(around)
        spin = self.angular_velocity or 0.0
        w = spin if isinstance(spin, float) else max(spin, key=abs)
        if w and abs(w) >= _FAST and w % 10 == 0:
            message = f"{w:g} rad/s are {w * 30 / math.pi:.4g} revolutions per minute"
            yield Complaint(("angular_velocity",), message, f"'{w:g} rpm'?")


class EquilibriumSpec(Spec):
    """Bodies that start where they come to rest under what acts at t = 0; stated rates come on top."""

    bodies: tuple[str, ...] | Literal["all"] = "all"
    """Their names, or all; the others stay where they are put."""


class SteadySpec(Spec):
    """The scene turns steadily from the start on, with one body, and stands still as seen from that."""

    vectors = ("rate",)

    body: str
    """The body that turns; the axis is where its joints have it."""

    rate: Spin
    """Its angular velocity [rad/s]: a number, in space about z, or three in ground axes."""


STEADY = "steady"
AT_REST = "equilibrium"
"""Keys under ``initial`` that are no bodies."""


def _read_initial(value: object) -> Spec:
    if isinstance(value, Spec):
        return value
    if isinstance(value, bool):
        return EquilibriumSpec(bodies="all" if value else ())
    if isinstance(value, list) and all(isinstance(one, str) for one in value):
        return EquilibriumSpec(bodies=tuple(value))
    if isinstance(value, dict) and "bodies" in value:
        return EquilibriumSpec.model_validate(value)
    if isinstance(value, dict) and "body" in value:
        return SteadySpec.model_validate(value)
    if not isinstance(value, dict):
        raise refusal(f"must be a map, or of {AT_REST} true or a list of bodies, not {shown(value)}")
    return InitialSpec.model_validate(value)


AnyInitial = Annotated[
    InitialSpec | EquilibriumSpec | SteadySpec,
    ReadBy(
        _read_initial,
        entries=[InitialSpec, EquilibriumSpec, SteadySpec],
        others=[{"type": "boolean"}, {"type": "array", "items": {"type": "string"}}],
    ),
]
