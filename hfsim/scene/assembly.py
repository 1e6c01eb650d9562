"""How the bodies of a scene were put together at the start, and what that changed of what the deck states."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import rotation, rotation_vector
from hfsim.mechanics.pose import Pose, Twist
from hfsim.scene.closing import Linkage

TOLD = 8
"""Angles of bodies that are told in a line."""
NO_TURN = 1e-10
"""Angle that is rounding [rad]."""
DECIMALS = 6
"""Of an axis that is told."""
WORTH_A_WARNING = 0.02
"""Part of what may be a guess from which a change is warned of; below, it is only noted."""
UNITS = {
    **{"angle": "rad", "orientation": "rad", "position": "m"},
    **{"angular_velocity": "rad/s", "velocity": "m/s", "distance_rate": "m/s"},
}
"""What is stated under ``initial``, and its units; orientations are told as rotation vectors."""
Turn: TypeAlias = "float | tuple[float, ...]"
Branches: TypeAlias = "Callable[[], list[dict[str, Turn]]]"


class Change(NamedTuple):
    """A stated value that the joints, or a steady rotation, do not allow, and what they allow.

    Attributes
    ----------
    body, quantity : str
        As in ``initial``.
    stated, taken : tuple of float
        What the deck says, and what the run starts from.
    rough : float
        How far these are apart, relative to what may be a guess.
    by : str
        What allows no other.
    """

    body: str
    quantity: str
    stated: tuple[float, ...]
    taken: tuple[float, ...]
    rough: float
    by: str = "the joints allow"

    def __str__(self) -> str:
        unit = UNITS[self.quantity]
        off = float(np.linalg.norm(np.subtract(self.taken, self.stated)))
        if self.quantity == "orientation":
            taken, stated = (rotation(np.array(turn)) for turn in (self.taken, self.stated))
            off = float(np.linalg.norm(rotation_vector(taken @ stated.T)))
        return (
            f"initial.{self.body}.{self.quantity}: {listed(self.stated)} {unit} is taken as a guess: "
            f"{self.by} {listed(self.taken)} {unit}, {off:.3g} {unit} off"
        )


def listed(values: tuple[float, ...]) -> str:
    """Return one number or a vector as text."""
    text = ", ".join(f"{value:.9g}" for value in values)
    return text if len(values) == 1 else f"[{text}]"


def orientation_of(R: Array) -> str:
    """Return what states a rotation (3, 3) in a deck.

    Examples
    --------
    >>> orientation_of(np.diag([-1.0, 1.0, -1.0]))
    'orientation: {axis: [0, 1, 0], angle: 180 deg}'
    """
    turn = rotation_vector(R)
    angle = float(np.linalg.norm(turn))
    axis = turn / angle if angle > NO_TURN else np.eye(3)[2]
    return f"orientation: {{axis: {listed(tuple(axis.round(9) + 0.0))}, angle: {np.degrees(angle):.9g} deg}}"


class Placed(NamedTuple):
    """Where the bodies of a scene are put together; see `Assembly`."""

    place: Array
    poses: dict[str, Pose]
    changes: tuple[Change, ...]
    closed: dict[str, Turn]
    branches: Branches
    loose: Callable[[], Array]


@frozen
class Assembly:
    """How the bodies of a scene were put together.

    Attributes
    ----------
    linkage : Linkage
        Of the frames of the bodies.
    place : ndarray, shape (n,)
        Where these are.
    poses : dict of str to Pose
        The same by body, with full turns.
    changes : tuple of Change
        Stated values that were taken as guesses.
    closed : dict of str to Turn
        Angles of bodies that the deck does not state, as loops close; in space rotation vectors [rad].
    branches : callable
        () -> the same angles in each of the other ways to close that are found; the search takes a while.
    loose : callable
        () -> rates (k, n) of the frames, in each motion that joints and what is stated leave free.
    """

    linkage: Linkage
    place: Array
    poses: dict[str, Pose]
    twists: dict[str, Twist]
    changes: tuple[Change, ...]
    closed: dict[str, Turn]
    branches: Branches
    loose: Callable[[], Array]

    def tangent(self, body: str) -> Array:
        """Return the first axis of a body, shape (3,), in space."""
        return self.poses[body].turned(np.eye(3)[0])

    def rolls(self, bodies: Collection[str]) -> Array:
        """Return the motions (n_bodies, n) of the frames in which each body turns about its first axis."""
        names, motions = list(self.poses), np.zeros((len(bodies), self.linkage.n))
        for motion, body in zip(motions, bodies, strict=True):
            motion[self.linkage.columns_of(names.index(body))[3:]] = self.tangent(body)
        return motions

    def warnings(self) -> list[str]:
        """Return in words which stated values were changed by much."""
        return [str(change) for change in self.changes if change.rough > WORTH_A_WARNING]

    def notes(self) -> list[str]:
        """Return in words how loops were closed, and which stated values were changed by little."""
        closed = [f"the joints close with {angles_of(self.closed)}"] if self.closed else []
        return [*closed, *(str(change) for change in self.changes if change.rough <= WORTH_A_WARNING)]

    def facts(self) -> dict[str, Any]:
        """Return what summaries say of it."""
        changed = [{key: getattr(one, key) for key in Change._fields[:4]} for one in self.changes]
        return {"closed": self.closed, "changed": changed, "notes": self.notes()}


def angles_of(closed: Mapping[str, Turn]) -> str:
    """Return angles or rotation vectors of bodies in words, of a few where there are many."""
    return few_of([f"{name} {_in_degrees(turn)}" for name, turn in closed.items()])


def few_of(told: Sequence[str], between: str = ", ") -> str:
    """Return a list in words, cut short where it is long."""
    return between.join(told if len(told) <= TOLD else [*told[:TOLD], f"and {len(told) - TOLD} more"])


def _in_degrees(turn: Turn) -> str:
    """Return an angle in degrees, or a rotation vector as its angle about its axis."""
    if isinstance(turn, float):
        return f"{np.degrees(turn if abs(turn) >= NO_TURN else 0.0):.4g} deg"
    angle = float(np.linalg.norm(turn))
    if angle < NO_TURN:
        return "0 deg"
    axis = ", ".join(f"{round(part / angle, DECIMALS) + 0.0:.4g}" for part in turn)
    return f"{np.degrees(angle):.4g} deg about [{axis}]"
