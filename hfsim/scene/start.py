"""The starting state: what the deck says of each body, completed through the joints.

Bodies start undeformed, so each has the freedom of a rigid body.  What is not stated follows from
the joints: angles along joints that fix them, positions and velocities so that all joints hold, and
in closed loops the unstated angles too.  What is stated is never changed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import Array, BoolArray
from hfsim.maths.rotations import freedoms
from hfsim.mechanics.body import Body
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.pose import Pose, Twist
from hfsim.scene.schema import InitialSpec

TOLERANCE = 1e-9
"""Violation of a joint, in metres or radians and per second, that counts as a contradiction."""


GROUND = None
AT_START = np.zeros(1)

_Frame = TypeVar("_Frame", Pose, Twist)


@dataclass(frozen=True, eq=False)
class Start:
    """What the starting state is found from.

    Attributes
    ----------
    bodies : dict of str to Body
    initial : mapping of str to InitialSpec
    constraints : tuple of Constraint
    n_dim : int
    refuse : callable
        (deck path, message, hint) -> DeckError.
    """

    bodies: Mapping[str, Body]
    initial: Mapping[str, InitialSpec]
    constraints: tuple[Constraint, ...]
    n_dim: int
    refuse: Callable[[str, str, str], DeckError]

    @cached_property
    def _numbers(self) -> dict[int, int]:
        return {body.columns.start: k for k, body in enumerate(self.bodies.values())}

    def owner(self, marker: Marker) -> int | None:
        """Return the number of the body that a marker is on; None for the ground."""
        return GROUND if marker.grounded else self._numbers[marker.columns.start]

    def stated(self, origin: str, turn: str) -> _Rigid:
        """Return the stated values of two quantities of each body, zero for the rest."""
        values = np.zeros((len(self.bodies), freedoms(self.n_dim)))
        rigid = _Rigid(values, np.zeros(values.shape, dtype=bool), self.n_dim)
        for k, name in enumerate(self.bodies):
            for quantity, part in ((origin, slice(self.n_dim)), (turn, slice(self.n_dim, None))):
                value = getattr(self.initial.get(name), quantity, None)
                if value is not None:
                    rigid.values[k, part], rigid.stated[k, part] = value, True
        return rigid

    def gap(self, x: Array) -> Array:
        """Return the residual of all joints at coordinates (n,)."""
        gaps = (c.residual(AT_START, x[None])[0] for c in self.constraints)
        return np.concatenate([np.zeros(0), *gaps])


@dataclass(eq=False)
class _Rigid:
    """Poses or twists of all bodies as rows (n_bodies, n_freedoms), and what of them is stated."""

    values: Array
    stated: BoolArray
    n_dim: int

    @property
    def turns(self) -> Array:
        return self.values[:, self.n_dim :]

    def frames(self, kind: type[_Frame]) -> list[_Frame]:
        return [kind(row[: self.n_dim], row[self.n_dim :]) for row in self.values]

    def free(self, with_turns: bool) -> BoolArray:
        """Return which values may change."""
        free = ~self.stated
        free[:, self.n_dim :] &= with_turns
        return free


def starting_state(start: Start) -> tuple[Array, Array, dict[str, Pose]]:
    """Return absolute coordinates, their rates, and the pose of each body with its full turns.

    Returns
    -------
    x, u : ndarray, shape (n,)
    poses : dict of str to Pose

    Raises
    ------
    DeckError
        Naming the joint that the stated angles, positions or velocities contradict, and by how much.
    """
    place = start.stated("position", "angle")
    _hand_on(start, place, lambda tie: tie.target(AT_START))
    _settle(start, place)
    rates = start.stated("velocity", "angular_velocity")
    _hand_on(start, rates, lambda tie: -tie.rate(AT_START)[0])
    x = _coordinates(start, place)
    _settle_rates(start, _jacobian(start, x, place), rates)
    poses = place.frames(Pose)
    parts = zip(start.bodies.values(), poses, rates.frames(Twist), strict=True)
    u = np.concatenate([body.moving(pose, twist) for body, pose, twist in parts])
    return x, u, dict(zip(start.bodies, poses, strict=True))


def _hand_on(start: Start, rigid: _Rigid, step: Callable[[Constraint], Array]) -> None:
    """Take turns that are not stated from other bodies, along the constraints that fix them."""
    known: dict[int | None, Array] = {GROUND: np.zeros(rigid.turns.shape[1])}
    known |= {k: rigid.turns[k] for k, stated in enumerate(rigid.stated[:, -1]) if stated}
    ties = [c for c in start.constraints if c.holds_turn]
    for _ in ties:
        for tie in ties:
            a, b = (start.owner(marker) for marker in tie.ends)
            if a in known and b not in known:
                known[b] = known[a] + step(tie)
            elif b in known and a not in known:
                known[a] = known[b] - step(tie)
    for k, turn in known.items():
        if k is not GROUND:
            rigid.turns[k] = turn


def _coordinates(start: Start, place: _Rigid) -> Array:
    poses = zip(start.bodies.values(), place.frames(Pose), strict=True)
    return np.concatenate([body.placed(pose) for body, pose in poses])


def _jacobian(start: Start, x: Array, place: _Rigid) -> Array:
    """Return the derivative of all constraints by the rigid freedoms, shape (rows, n_bodies, n_freedoms)."""
    motions = [
        np.stack([body.moving(pose, twist) for twist in Twist.units(start.n_dim)], axis=1)
        for body, pose in zip(start.bodies.values(), place.frames(Pose), strict=True)
    ]
    blocks = [np.zeros((0, *place.values.shape))]
    for c in start.constraints:
        block = np.zeros((c.rows, *place.values.shape))
        for marker, J in zip(c.ends, c.jacobians(x[None]), strict=True):
            k = start.owner(marker)
            if k is not GROUND:
                block[:, k] += J[0] @ motions[k]
        blocks.append(block)
    return np.concatenate(blocks)


def _settle(start: Start, place: _Rigid) -> None:
    """Move what is not stated until the joints hold: origins first, unstated turns if need be."""
    for with_turns in (False, True):
        free = place.free(with_turns)
        for _ in range(30):
            x = _coordinates(start, place)
            gap = start.gap(x)
            if _largest(gap) < 1e-14 * max(1.0, _largest(x)):
                return
            place.values[free] -= np.linalg.lstsq(_jacobian(start, x, place)[:, free], gap, rcond=1e-10)[0]
        gap = start.gap(_coordinates(start, place))
        if _largest(gap) < TOLERANCE:
            return
    _refuse(start, gap, "initial positions and angles", "")


def _settle_rates(start: Start, J: Array, rates: _Rigid) -> None:
    """Change what is not stated until the joints hold, as `_settle`."""
    explicit = np.concatenate([np.zeros(0), *(c.rate(AT_START)[0] for c in start.constraints)])
    for with_turns in (False, True):
        free = rates.free(with_turns)
        gap = np.einsum("rkf,kf->r", J, rates.values) + explicit
        rates.values[free] -= np.linalg.lstsq(J[:, free], gap, rcond=1e-10)[0]
        gap = np.einsum("rkf,kf->r", J, rates.values) + explicit
        if _largest(gap) < TOLERANCE:
            return
    _refuse(start, gap, "initial velocities", "/s")


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _refuse(start: Start, gap: Array, what: str, per: str) -> None:
    """Raise the error that names the joint with the largest violation."""
    ends = np.cumsum([0] + [c.rows for c in start.constraints])
    sizes = [float(np.abs(gap[a:b]).max()) for a, b in pairwise(ends)]
    worst = int(np.argmax(sizes))
    constraint = start.constraints[worst]
    raise start.refuse(
        constraint.item,
        f"the {what} contradict this joint by {sizes[worst]:.6g} {constraint.unit}{per}",
        "change what is stated under 'initial', or leave it out to let it follow from the joints",
    )
