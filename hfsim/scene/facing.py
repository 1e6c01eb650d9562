"""How bodies face each other at the start of a spatial scene, by what the deck states of orientations."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.deck.orientation import matrix_of
from hfsim.maths.arrays import Array
from hfsim.parts.specs import JointSpec
from hfsim.scene.schema import Deck

LEVEL = np.eye(3)


class Facings:
    """Orientations that a deck states or that joints hand on from those; none in the plane."""

    def __init__(self, deck: Deck) -> None:
        self._deck = deck

    @cached_property
    def known(self) -> dict[str, Array]:
        """Orientations (3, 3) of the ground and of bodies, stated or handed on by joints that fix them."""
        deck = self._deck
        stated = {name: entry.turn(3) for name, entry in deck.initial.items()}
        known = {"ground": LEVEL} | {name: R for name, R in stated.items() if R is not None}
        before = 0
        while before < len(known):
            before = len(known)
            for joint in deck.joints.values():
                a, b = (split_point(end)[0] for end in joint.between)
                if joint.follows_start or not hasattr(joint, "orientation"):
                    continue
                if a in known and b not in known:
                    known[b] = known[a] @ _held(joint)
                elif b in known and a not in known:
                    known[a] = known[b] @ _held(joint).T
        return known

    @cached_property
    def centres(self) -> Array | None:
        """Orientation of each body from which its own is sought, (n_bodies, 3, 3); None in the plane."""
        if self._deck.dimension == 2:
            return None
        return np.array([self.known.get(name, LEVEL) for name in self._deck.bodies])

    def of(self, joint: JointSpec) -> tuple[Array, ...]:
        """Return the matrix (3, 3) from B's frame to A's where a joint's angles are zero; () in a plane."""
        if self._deck.dimension == 2:
            return ()
        a, b = (split_point(end)[0] for end in joint.between)
        if joint.follows_start and a in self.known and b in self.known:
            return (np.asarray(self.known[a].T @ self.known[b]),)
        return (_held(joint),)


def _held(joint: JointSpec) -> Array:
    """Return how B's frame is turned against A's by what a joint states; not at all without."""
    R = matrix_of(joint) if hasattr(joint, "orientation") else None
    return LEVEL if R is None else R
