"""Full turns that a deck states of bodies: what angles between them are counted from at the start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import rotation_vector, wrap
from hfsim.mechanics.directions import THIRD, along, unit
from hfsim.parts.specs import JointSpec
from hfsim.scene.facing import Facings, by_holding
from hfsim.scene.posed import started
from hfsim.scene.schema import Deck


class FullTurns:
    """Turns of bodies, full ones included, that a deck states or that joints hand on."""

    def __init__(self, deck: Deck) -> None:
        self._deck, self._joints = deck, started(deck)

    def between(
        self, ends: Sequence[str], axis: Sequence[float] | None, angle: float, angles: Mapping[str, float]
    ) -> float:
        """Return about which angle B is turned against A at the start, its full turns counted.

        Parameters
        ----------
        ends : sequence of str
            Points on the bodies A and B.
        axis : sequence of float, optional
            In A's frame, in space; the third one without it.
        angle : float
            What is measured, up to full turns [rad].
        angles : mapping of str to float
            Angles of the bodies in the plane, with the turns that the deck states [rad].
        """
        if self._deck.dimension == 2:
            a, b = (angles.get(split_point(point)[0], 0.0) for point in ends)
            return b - a
        stated = self._stated(tuple(split_point(end)[0] for end in ends), _unit(axis))
        return angle if stated is None else stated + float(wrap(np.array(angle - stated)))

    def _stated(self, bodies: tuple[str, ...], axis: Array) -> float | None:
        """Return what is stated of an angle about an axis, if that is a turn about it."""
        for pair, vector in self._driven.items():
            if set(pair) == set(bodies) and _along(vector, axis):
                return float(vector @ axis) if pair == bodies else -float(vector @ axis)
        a, b = map(self._known.get, bodies)
        if a is None or b is None or not (_along(a, axis) and _along(b, axis)):
            return None
        return float((b - a) @ axis)

    @cached_property
    def _driven(self) -> Mapping[tuple[str, ...], Array]:
        """Turns of B against A that drivers begin with, or that are stated of joints, by both bodies."""
        from hfsim.parts.joints.driver import DriverSpec

        return {
            _bodies(joint): float(joint.angle.build().value(np.zeros(1))[0]) * _unit(joint.axis)
            for joint in self._joints.values()
            if isinstance(joint, DriverSpec) and joint.angle is not None
        }

    @cached_property
    def _known(self) -> Mapping[str, Array]:
        """Rotation vectors against the ground (3,), of half a turn at most but for turns stated."""
        stated = {name: entry.turns for name, entry in self._deck.motions.items()}
        known = {"ground": np.zeros(3)} | {name: one for name, one in stated.items() if one is not None}
        steps = dict(self._driven)
        for joint in self._joints.values():
            if by_holding(joint, np.eye(3), False) is not None:
                steps.setdefault(_bodies(joint), np.zeros(3))
        count = 0
        while count < len(known):
            count = len(known)
            for (a, b), step in steps.items():
                _hand_on(known, a, b, step)
                _hand_on(known, b, a, -step)
        return {name: rotation_vector(R) for name, R in Facings(self._deck).known.items()} | known


def _hand_on(known: dict[str, Array], a: str, b: str, step: Array) -> None:
    """Take the turns of B from those of A where they are about the same axis as what is between them."""
    if a in known and b not in known and (not known[a].any() or _along(step, known[a])):
        known[b] = known[a] + step


def _bodies(joint: JointSpec) -> tuple[str, ...]:
    return tuple(split_point(end)[0] for end in joint.between)


def _unit(axis: Sequence[float] | None) -> Array:
    return np.asarray(unit(tuple(axis or THIRD)))


def _along(vector: Array, other: Array) -> bool:
    """Return whether a vector is along another one, or zero."""
    return not np.linalg.norm(vector) or along(unit(tuple(vector)), unit(tuple(other)))
