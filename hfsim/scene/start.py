"""The starting state: what the deck says of each body, completed through the joints.

Bodies start undeformed, so each has the freedom of a rigid body.  What is not stated follows from
the joints: angles along joints that fix them, positions and velocities so that all joints hold, and
in closed loops the unstated angles too.  What is stated is never changed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import Array, BoolArray
from hfsim.mechanics.body import Body
from hfsim.mechanics.constraints import Constraint, RelativeAngle
from hfsim.mechanics.pose import Pose, Twist
from hfsim.scene.schema import InitialSpec

TOLERANCE = 1e-9
"""Violation of a joint, in metres or radians and per second, that counts as a contradiction."""


class Start(NamedTuple):
    """What the starting state is found from.

    Attributes
    ----------
    bodies : dict of str to Body
    initial : mapping of str to InitialSpec
    constraints : tuple of Constraint
    joints : dict of str to tuple of int
        Which constraints each joint is made of.
    refuse : callable
        (deck path, message, hint) -> DeckError.
    """

    bodies: Mapping[str, Body]
    initial: Mapping[str, InitialSpec]
    constraints: tuple[Constraint, ...]
    joints: Mapping[str, tuple[int, ...]]
    refuse: Callable[[str, str, str], DeckError]

    def stated(self, quantity: str) -> dict[int, float]:
        """Return stated values of a quantity by index of the body."""
        values = {}
        for index, name in enumerate(self.bodies):
            value = getattr(self.initial.get(name), quantity, None)
            if value is not None:
                values[index] = value
        return values


@dataclass
class _Rigid:
    """Origins (n, 2) and angles (n,) of all bodies, or their rates, with what of them is stated."""

    origins: Array
    angles: Array
    free_origins: BoolArray
    free_angles: BoolArray

    def poses(self) -> list[Pose]:
        return [Pose.planar(*one) for one in zip(self.origins, map(float, self.angles), strict=True)]

    def twists(self) -> list[Twist]:
        return [Twist.planar(*one) for one in zip(self.origins, map(float, self.angles), strict=True)]

    def add(self, step: Array, columns: BoolArray) -> None:
        full = np.zeros(columns.shape)
        full[columns] = step
        self.origins += full[:, :2]
        self.angles += full[:, 2]

    def columns(self, angles: bool) -> BoolArray:
        """Return which of (origin x, origin y, angle) of each body may move, shape (n, 3)."""
        free = np.repeat(self.free_origins[:, None], 3, axis=1)
        free[:, 2] = self.free_angles & angles
        return free


def starting_state(start: Start) -> tuple[Array, Array, dict[str, float]]:
    """Return absolute coordinates, their rates, and the angle of each body with its full turns.

    Returns
    -------
    x, u : ndarray, shape (n,)
    angles : dict of str to float

    Raises
    ------
    DeckError
        Naming the joint that the stated angles, positions or velocities contradict, and by how much.
    """
    place = _first_guess(start, "angle", "position", lambda c: c.offset + _law(c, 0))
    _settle(start, place)
    rates = _first_guess(start, "angular_velocity", "velocity", lambda c: _law(c, 1))
    x = _coordinates(start, place)
    _settle_rates(start, place, rates, x)
    angles = dict(zip(start.bodies, map(float, place.angles), strict=True))
    return x, _rate_coordinates(start, place, rates), angles


def _law(constraint: RelativeAngle, order: int) -> float:
    if constraint.law is None:
        return 0.0
    zero = np.zeros(1)
    return float((constraint.law.value(zero) if order == 0 else constraint.law.rate(zero))[0])


def _first_guess(start: Start, angle: str, origin: str, step: Callable[[RelativeAngle], float]) -> _Rigid:
    """Take stated values; hand angles on along the constraints that fix them; zero for the rest."""
    n = len(start.bodies)
    angles, origins = start.stated(angle), start.stated(origin)
    owner = {body.columns.start: k for k, body in enumerate(start.bodies.values())}
    known: dict[int | None, float] = {None: 0.0}
    for k, value in angles.items():
        known[k] = value
    ties = [c for c in start.constraints if isinstance(c, RelativeAngle)]
    for _ in ties:
        for tie in ties:
            a, b = _owner(owner, tie.first.columns), _owner(owner, tie.second.columns)
            if a in known and b not in known:
                known[b] = known[a] + step(tie)
            elif b in known and a not in known:
                known[a] = known[b] - step(tie)
    guess = _Rigid(np.zeros((n, 2)), np.zeros(n), np.ones(n, dtype=bool), np.ones(n, dtype=bool))
    for k in range(n):
        guess.angles[k] = known.get(k, 0.0)
        guess.free_angles[k] = k not in angles
        if k in origins:
            guess.origins[k], guess.free_origins[k] = np.array(origins[k]), False
    return guess


def _owner(owner: Mapping[int, int], columns: slice) -> int | None:
    return None if columns.stop == columns.start else owner[columns.start]


def _coordinates(start: Start, place: _Rigid) -> Array:
    poses = zip(start.bodies.values(), place.poses(), strict=True)
    return np.concatenate([body.placed(pose) for body, pose in poses])


def _rate_coordinates(start: Start, place: _Rigid, rates: _Rigid) -> Array:
    parts = zip(start.bodies.values(), place.poses(), rates.twists(), strict=True)
    return np.concatenate([body.moving(pose, twist) for body, pose, twist in parts])


def _motions(start: Start, place: _Rigid) -> list[Array]:
    """Return the change of each body's coordinates with its rigid freedoms, shape (n_columns, 3) each."""
    n_dim = place.origins.shape[1]
    return [
        np.stack([body.moving(pose, twist) for twist in Twist.units(n_dim)], axis=1)
        for body, pose in zip(start.bodies.values(), place.poses(), strict=True)
    ]


def _jacobian(start: Start, x: Array, motions: list[Array]) -> Array:
    """Return the derivative of all constraints by the rigid freedoms, shape (rows, n_bodies, 3)."""
    owner = {body.columns.start: k for k, body in enumerate(start.bodies.values())}
    rows = []
    for c in start.constraints:
        block = np.zeros((c.rows, len(motions), 3))
        for marker, J in zip((c.first, c.second), c.jacobians(x[None]), strict=True):
            k = _owner(owner, marker.columns)
            if k is not None:
                block[:, k] += J[0] @ motions[k]
        rows.append(block)
    return np.concatenate(rows)


def _settle(start: Start, place: _Rigid) -> None:
    """Move what is not stated until the joints hold: origins first, unstated angles if need be."""
    if not start.constraints:
        return
    t = np.zeros(1)
    for with_angles in (False, True):
        for _ in range(30):
            x = _coordinates(start, place)
            gap = np.concatenate([c.residual(t, x[None])[0] for c in start.constraints])
            if np.abs(gap).max() < 1e-14 * max(1.0, np.abs(x).max()):
                return
            free = place.columns(with_angles)
            J = _jacobian(start, x, _motions(start, place))[:, free]
            place.add(np.linalg.lstsq(J, -gap, rcond=1e-10)[0], free)
        x = _coordinates(start, place)
        gap = np.concatenate([c.residual(t, x[None])[0] for c in start.constraints])
        if np.abs(gap).max() < TOLERANCE:
            return
    _refuse(start, gap, "initial positions and angles", ("m", "rad"))


def _settle_rates(start: Start, place: _Rigid, rates: _Rigid, x: Array) -> None:
    if not start.constraints:
        return
    t = np.zeros(1)
    J = _jacobian(start, x, _motions(start, place))
    explicit = np.concatenate([c.rate(t)[0] for c in start.constraints])

    def gap() -> Array:
        motion = np.concatenate([rates.origins, rates.angles[:, None]], axis=1)
        return np.asarray(np.einsum("rkf,kf->r", J, motion) + explicit)

    for with_angles in (False, True):
        free = rates.columns(with_angles)
        rates.add(np.linalg.lstsq(J[:, free], -gap(), rcond=1e-10)[0], free)
        if np.abs(gap()).max() < TOLERANCE:
            return
    _refuse(start, gap(), "initial velocities", ("m/s", "rad/s"))


def _refuse(start: Start, gap: Array, what: str, units: tuple[str, str]) -> None:
    """Raise the error that names the joint with the largest violation."""
    ends = np.cumsum([0] + [c.rows for c in start.constraints])
    sizes = [float(np.abs(gap[a:b]).max()) for a, b in pairwise(ends)]
    worst = int(np.argmax(sizes))
    name = next(name for name, members in start.joints.items() if worst in members)
    unit = units[1] if isinstance(start.constraints[worst], RelativeAngle) else units[0]
    raise start.refuse(
        f"joints.{name}",
        f"the {what} contradict this joint by {sizes[worst]:.6g} {unit}",
        "change what is stated under 'initial', or leave it out to let it follow from the joints",
    )
