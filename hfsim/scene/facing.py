"""How bodies face each other at the start of a spatial scene, by what the deck states of orientations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from copy import copy
from functools import cached_property
from heapq import heapify, heappop, heappush
from typing import Any, TypeAlias

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import rotation, smallest_rotation
from hfsim.mechanics.pose import Pose
from hfsim.parts.specs import JointSpec
from hfsim.scene.posed import started
from hfsim.scene.rules import parts_of
from hfsim.scene.schema import Deck

LEVEL = np.eye(3)
ROUNDING = 1e-9
"""Part of a unit vector that counts as none."""
Step: TypeAlias = "Callable[[JointSpec, Array, bool], Array | None]"
"""(joint, orientation of A, or of B if it goes back) -> that of the other, if the joint hands it on."""


class Facings:
    """Orientations that a deck states or that joints hand on from those; none in the plane."""

    def __init__(self, deck: Deck) -> None:
        self._deck = deck
        self._start, self._loose, self._by_own = dict[str, Pose](), list[JointSpec](), False

    @cached_property
    def _joints(self) -> dict[str, JointSpec]:
        """The joints, and drivers for what is stated of some at the start."""
        return started(self._deck)

    def at(self, start: Mapping[str, Pose]) -> Facings:
        """Return them with axes of drivers, servos and motors where they are at a start that is found."""
        found = copy(self)
        found._start = dict(start)
        return found

    def loosened(self, start: Mapping[str, Pose]) -> Facings:
        """Return them without the axes in B of drivers that a start has elsewhere; themselves if it has none.

        Without one, an angle is that of swing and twist between the frames: where B's axis comes to lie along
        A's it is the same with that axis.
        """
        found, moved = self.at(start), list[JointSpec]()
        for joint in self._joints.values() if self._deck.dimension == 3 else ():
            leads = joint.holds and joint.follows_start and not joint.turns and not joint.carries
            if leads and (found.of(joint)[0] != self.of(joint)[0]).any():
                moved.append(joint)
        if not moved:
            return self
        loose = copy(self)
        loose._loose = [*self._loose, *moved]
        return loose

    def by_own(self) -> Facings:
        """Return them with axes in B of hinges as they state them, where only guesses say how bodies face.

        Orientations that hinges hand on at angle zero are such, which a loop need not have.  They return
        themselves if that makes no difference.
        """
        found = copy(self)
        found._by_own = True
        hinges = (joint for joint in self._joints.values() if self._deck.dimension == 3 and joint.turns)
        moved = (np.linalg.norm((found.of(j)[0] - self.of(j)[0]).T @ axis_of(j)) > ROUNDING for j in hinges)
        return found if any(moved) else self

    @cached_property
    def _firm(self) -> set[str]:
        """Bodies whose turns are stated, or follow by what joints hold and by angles that are stated."""
        known = {"ground": LEVEL, **self._stated}
        return set(self._spread(known, ("ground",), by_holding, self._by_driver))

    @cached_property
    def _stated(self) -> dict[str, Array]:
        stated = {name: entry.turn(3) for name, entry in self._deck.motions.items()}
        return {name: R for name, R in stated.items() if R is not None}

    @cached_property
    def known(self) -> dict[str, Array]:
        """Orientations (3, 3) of the ground and of bodies, stated or handed on by joints.

        First by joints that fix them, then by drivers of hinges and by universal joints and hinges that state
        theirs, then by hinges alone: about the axis the other body is turned as little as can be against the
        ground.  Last by other universal joints: handed on through these before, the axis of a hinge would not
        be where it is stated.  Of bodies that are joined to none of these, the first one stands level.
        """
        known = {"ground": LEVEL, **self._stated}
        steps = (by_holding, self._by_driver, self._by_statement, self._by_hinge, _by_orientation)
        return self._spread(known, ("ground", *self._floating(known)), *steps)

    def _spread(self, known: dict[str, Array], names: Iterable[str], *steps: Step) -> dict[str, Array]:
        """Hand on orientations as far as steps lead, from what is known, then from one name after another.

        Of these those that are not known stand level.
        """
        waiting = [{k for name in known for k in self._numbers.get(name, ())} for _ in steps]
        for name in names:
            if name not in known:
                known[name] = LEVEL
                for one in waiting:
                    one.update(self._numbers.get(name, ()))
            while any(self._handed_on(known, *one, waiting) for one in zip(steps, waiting, strict=True)):
                pass
        return known

    def _floating(self, known: Collection[str]) -> Iterator[str]:
        """Yield the first body of each group that joints hold together, if none of it is known."""
        holding = (joint for joint in self._joints.values() if joint.holds)
        part = parts_of(("ground", *self._deck.bodies), map(_bodies, holding))
        reached = set().union(*(part[name] for name in known))
        for name in self._deck.bodies:
            if name not in reached:
                reached |= part[name]
                yield name

    @cached_property
    def _listed(self) -> list[tuple[JointSpec, str, str]]:
        """The joints with their bodies A and B."""
        pairs = ((joint, map(split_point, joint.between)) for joint in self._joints.values())
        return [(joint, a, b) for joint, ((a, _), (b, _)) in pairs]

    @cached_property
    def _numbers(self) -> dict[str, list[int]]:
        """For each body that joints are on, and the ground, their numbers."""
        found: dict[str, list[int]] = {}
        for k, (_, *ends) in enumerate(self._listed):
            for name in ends:
                found.setdefault(name, []).append(k)
        return found

    def _handed_on(
        self, known: dict[str, Array], step: Step, own: set[int], waiting: Collection[set[int]]
    ) -> bool:
        """Hand on orientations by one kind of joints, in one round of all; tell whether any was.

        Of all joints those are looked at that wait for it, as a body that they are on has become known.
        """
        before, left = len(known), list(own)
        heapify(left)
        own.clear()
        while left:
            k = heappop(left)
            joint, a, b = self._listed[k]
            if (a in known) == (b in known):
                continue
            here, there = (a, b) if a in known else (b, a)
            R = step(joint, known[here], here == b)
            if R is not None:
                known[there] = R
                for n in self._numbers[there]:
                    for one in waiting:
                        one.add(n)
                    if n > k:
                        own.discard(n)
                        heappush(left, n)
        return len(known) > before

    @cached_property
    def _led(self) -> set[frozenset[str]]:
        """Bodies of hinges whose angle is driven, or stated at the start: that hands them on, not a hinge."""
        turning = [joint for joint in self._joints.values() if joint.follows_start and joint.holds]
        joined = Counter(map(_bodies, turning))
        return {pair for joint in turning if _leads(joint) and joined[pair := _bodies(joint)] > 1}

    def _by_driver(self, joint: JointSpec, known: Array, back: bool) -> Array | None:
        """Return where a hinge that is driven holds the other body."""
        if not _leads(joint) or _bodies(joint) not in self._led:
            return None
        angle = float(joint.angle.build().value(np.zeros(1))[0])  # type: ignore[attr-defined]
        turn = rotation(angle * axis_of(joint)) @ _held(joint)
        return known @ (turn.T if back else turn)

    def _by_statement(self, joint: JointSpec, known: Array, back: bool) -> Array | None:
        """Return where a joint that leaves turns states that the other body is."""
        if not (joint.swings or joint.turns) or _bodies(joint) in self._led:
            return None
        from hfsim.deck.orientation import matrix_of

        stated = matrix_of(joint) if joint.swings else getattr(joint, "orientation", None)
        return None if stated is None else known @ (_held(joint).T if back else _held(joint))

    def _by_hinge(self, joint: JointSpec, known: Array, back: bool) -> Array | None:
        """Return the smallest rotation from the ground's axes that puts one body's axis on the other's."""
        if not joint.follows_start or not joint.turns or _oriented(joint) or _bodies(joint) in self._led:
            return None
        return smallest_rotation(axis_of(joint), known @ axis_of(joint))

    @cached_property
    def centres(self) -> Array | None:
        """Orientation of each body from which its own is sought, (n_bodies, 3, 3); None in the plane."""
        if self._deck.dimension == 2:
            return None
        found = self._spread(dict(self.known), self._deck.bodies, by_holding)
        return np.array([found[name] for name in self._deck.bodies])

    def of(self, joint: JointSpec) -> tuple[Array, ...]:
        """Return the matrix (3, 3) from B's frame to A's where a joint's angles are zero; () in a plane.

        A line without sections has an angle of its tangent, which no tilt at the start changes.  Hinges that
        state an orientation have their axis in B by that, whatever is said of where B starts.
        """
        if self._deck.dimension == 2:
            return ()
        oriented = joint.turns and _oriented(joint)
        if oriented or any(one is joint for one in self._loose) or (self._by_own and self._guessed(joint)):
            return (_held(joint),)
        a, b = (split_point(end)[0] for end in joint.between)
        stated = _held(joint)
        if joint.follows_start and a in self.known and b in self.known:
            stated = np.asarray(self.known[a].T @ self.known[b])
        line = b != "ground" and not self._deck.bodies[b].sectioned
        if not self._start or line or joint.turns or not joint.follows_start:
            return (stated,)
        A, B = (rotation(self._start[body].turn) if body in self._start else LEVEL for body in (a, b))
        moved = np.linalg.norm((A.T @ B - stated).T @ axis_of(joint)) > ROUNDING
        return (A.T @ B if moved else stated,)

    def _guessed(self, joint: JointSpec) -> bool:
        """Tell whether it is a hinge of which no stated angle and nothing firm says how its bodies face."""
        pair = _bodies(joint)
        return joint.follows_start and joint.turns and pair not in self._led and not pair <= self._firm


def _bodies(joint: JointSpec) -> frozenset[str]:
    return frozenset(split_point(end)[0] for end in joint.between)


def _leads(joint: JointSpec) -> bool:
    """Tell whether it is a driver that holds an angle, or what is stated of one."""
    return joint.follows_start and joint.holds and getattr(joint, "angle", None) is not None


def _oriented(joint: JointSpec) -> bool:
    """Tell whether a joint states how its bodies face each other where its angle is zero."""
    return getattr(joint, "orientation", None) is not None


def by_holding(joint: JointSpec, known: Array, back: bool) -> Array | None:
    """Return where a joint that leaves no turn holds the other body."""
    return None if joint.swings else _by_orientation(joint, known, back)


def _by_orientation(joint: JointSpec, known: Array, back: bool) -> Array | None:
    """Return where the other body is before a joint with an orientation turns."""
    if joint.follows_start or not hasattr(joint, "orientation"):
        return None
    return known @ (_held(joint).T if back else _held(joint))


def axis_of(joint: Any) -> Array:
    """Return the axis of a joint or a spring in A's frame, (3,), of unit length."""
    axis = np.asarray(getattr(joint, "axis", None) or (0.0, 0.0, 1.0), dtype=float)
    return np.asarray(axis / np.linalg.norm(axis))


def _held(joint: JointSpec) -> Array:
    """Return how B's frame is turned against A's by what a joint states; not at all without."""
    if joint.follows_start:
        stated = getattr(joint, "orientation", None)
        return LEVEL if stated is None else np.asarray(stated.matrix)
    from hfsim.deck.orientation import matrix_of

    R = matrix_of(joint) if hasattr(joint, "orientation") else None
    return LEVEL if R is None else R
