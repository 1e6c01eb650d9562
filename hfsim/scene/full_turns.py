"""Full turns that a deck states of bodies: what angles between them are counted from at the start.

In space a turn about an axis is an array (2,): what is stated with its full turns, and what is known but for
those, as by a quaternion or by ``x`` and ``y``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import rotation_vector, wrap
from hfsim.mechanics.directions import THIRD, Direction, along, unit
from hfsim.scene.facing import Facings, by_holding
from hfsim.scene.posed import posed, started
from hfsim.scene.schema import Deck

TURN = 2.0 * np.pi
ROUNDING = 1e-9
"""Angle that counts as none [rad]."""


class FullTurns:
    """Turns of bodies, full ones included, that a deck states or that joints hand on."""

    def __init__(self, deck: Deck) -> None:
        self._deck, self._facings, self._about = deck, Facings(deck), dict[Direction, TurnsAbout]()

    def between(self, tied: Any, measured: Any, x: Array, angles: Mapping[str, float]) -> float:
        """Return about which angle B is turned against A at the start, its full turns counted.

        Where something that is known but for full turns comes in, only those count that are stated in full:
        the rest is half a turn at most.

        Parameters
        ----------
        tied : JointSpec or SpringSpec
            Whose angle it is.
        measured : GapTie
            What measures it, up to full turns.
        x : ndarray, shape (1, n)
            Coordinates at the start.
        angles : mapping of str to float
            Angles of the bodies in the plane, with the turns that the deck states [rad].
        """
        pair, angle = _bodies(tied), float(measured.angle(x)[0])
        if self._deck.dimension == 2:
            a, b = (angles.get(body, 0.0) for body in pair)
            return b - a
        axis = measured.measure.axis
        turns = self._about.setdefault(axis, TurnsAbout(self._deck, np.array(axis), self._facings))
        if (turn := turns.of(pair)) is None:
            return angle
        stated, loose = map(float, turn - _zero(tied, turns.axis))
        if abs(loose) < ROUNDING:
            return stated + float(wrap(np.array(angle - stated)))
        return float(wrap(np.array(angle)) + TURN * np.fix(stated / TURN + np.copysign(ROUNDING, stated)))


class TurnsAbout:
    """The same in space, about one axis."""

    def __init__(self, deck: Deck, axis: Array, facings: Facings) -> None:
        self.axis, self._deck, self._facings = axis, deck, facings

    def of(self, pair: tuple[str, ...]) -> Array | None:
        """Return by how much B is turned against A, as is stated of it or of both, or as a driver begins.

        Last comes how bodies stand of which nothing is stated: turned by half a turn at most.
        """
        if (turn := _of_joint(self._posed, pair)) is None:
            turn = _of_both(self._stated, pair)
        if turn is None:
            turn = _of_joint(self._led, pair)
        return _of_both(self._every, pair) if turn is None else turn

    @cached_property
    def _posed(self) -> dict[tuple[str, ...], Array]:
        """Turns of B against A that are stated of joints, by both bodies."""
        return dict(self._of_drivers(posed(self._deck)))

    @cached_property
    def _led(self) -> dict[tuple[str, ...], Array]:
        """The same that drivers begin with."""
        return dict(self._of_drivers(self._deck.joints))

    def _of_drivers(self, joints: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], Array]]:
        from hfsim.parts.joints.driver import DriverSpec

        for joint in joints.values():
            driven = isinstance(joint, DriverSpec) and joint.angle is not None
            if driven and (turn := self._by_law(joint.angle, joint)) is not None:
                yield _bodies(joint), turn + _zero(joint, self.axis)

    def _by_law(self, law: Any, joint: Any) -> Array | None:
        """Return the turn that a law begins with; None if it is about another axis."""
        own = np.asarray(unit(joint.axis or THIRD))
        if not _along(own, self.axis):
            return None
        return np.array([float(law.build().value(np.zeros(1))[0]) * (own @ self.axis), 0.0])

    @cached_property
    def _steps(self) -> dict[tuple[str, ...], Array]:
        """Turns of B against A that joints fix, by both bodies; first comes what is stated of joints."""
        steps = self._posed | {pair: turn for pair, turn in self._led.items() if pair not in self._posed}
        for joint in started(self._deck).values():
            if by_holding(joint, np.eye(3), False) is not None and (turn := self._held(joint)) is not None:
                steps.setdefault(_bodies(joint), turn)
        return steps

    def _held(self, joint: Any) -> Array | None:
        """Return by how much a joint without free turns has B turned; None where a law tilts it.

        An orientation that is no turn about the axis counts as none.
        """
        turn = _turned(joint, self.axis)
        turn = np.zeros(2) if turn is None else turn
        if (law := getattr(joint, "turn", None)) is None:
            return turn
        return None if (more := self._by_law(law, joint)) is None else turn + more

    @cached_property
    def _stated(self) -> dict[str, Array]:
        """Turns against the ground that are stated, or handed on by joints.

        What is stated of a joint comes before what is of its second body.
        """
        known: dict[str, Array] = {"ground": np.zeros(2)}
        last = {b if b != "ground" else a for a, b in self._posed}
        for late in (False, True):
            for name, turn in self._of_bodies.items():
                if turn is not None and (name in last) == late:
                    known.setdefault(name, turn)
            self._hand_on(known)
        return known

    @cached_property
    def _of_bodies(self) -> dict[str, Array | None]:
        """Turns of bodies whose orientations are stated; None where that is about another axis."""
        motions = self._deck.motions.items()
        stated = {name: one for name, one in motions if (one.orientation, one.angle) != (None, None)}
        return {name: _turned(one, self.axis) for name, one in stated.items()}

    @cached_property
    def _every(self) -> dict[str, Array]:
        """The same, and of bodies of which nothing is stated, one after the other."""
        known = dict(self._stated)
        for name, R in self._facings.known.items():
            vector = rotation_vector(R)
            if name not in known and name not in self._of_bodies and _along(vector, self.axis):
                known[name] = np.array([vector @ self.axis, 0.0])
                self._hand_on(known)
        return known

    def _hand_on(self, known: dict[str, Array]) -> None:
        """Take turns of bodies of which none are stated from those of others, along joints."""
        tilted = {name for name, turn in self._of_bodies.items() if turn is None}
        count = 0
        while count < len(known):
            count = len(known)
            for (a, b), step in self._steps.items():
                if a in known and b not in known and b not in tilted:
                    known[b] = known[a] + step
                elif b in known and a not in known and a not in tilted:
                    known[a] = known[b] - step


def _turned(entry: Any, axis: Array) -> Array | None:
    """Return the turn that an entry states by ``orientation`` or by ``angle``; None if about another axis."""
    own = entry.orientation
    vector = np.array([0.0, 0.0, entry.angle or 0.0]) if own is None else own.turns
    if not _along(vector, axis):
        return None
    turn = float(vector @ axis)
    return np.array([turn, 0.0] if own is None or own.states_turns else [0.0, turn])


def _zero(tied: Any, axis: Array) -> Array:
    """Return the turn that is stated of where an angle is zero; none where that is tilted."""
    own = getattr(tied, "orientation", None)
    if own is None or not _along(own.turns, axis):
        return np.zeros(2)
    turn = float(own.turns @ axis)
    return np.array([turn, 0.0] if own.states_turns else [0.0, turn])


def _of_joint(between: Mapping[tuple[str, ...], Array], pair: tuple[str, ...]) -> Array | None:
    """Return the turn of B against A from those by pairs of bodies, one way or the other."""
    back = between.get(pair[::-1])
    return between.get(pair) if back is None else -back


def _of_both(known: Mapping[str, Array], pair: tuple[str, ...]) -> Array | None:
    """Return the same from turns of bodies."""
    a, b = map(known.get, pair)
    return None if a is None or b is None else b - a


def _bodies(tied: Any) -> tuple[str, ...]:
    return tuple(split_point(end)[0] for end in tied.between)


def _along(vector: Array, other: Array) -> bool:
    """Return whether a vector is along another one, or zero."""
    return not np.linalg.norm(vector) or along(unit(tuple(vector)), unit(tuple(other)))
