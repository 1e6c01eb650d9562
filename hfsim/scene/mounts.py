"""Which bushings say where bodies start: where these are without force, if nothing else says it.

Of several that could, the one comes first that holds more shifts and turns, then the one nearer to the
ground, or to what is stated, then the stiffer one: not the one that comes first in the deck.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

from hfsim.deck.fields import split_point
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import freedoms
from hfsim.parts.specs import JointSpec
from hfsim.scene.rules import connect, owners, parts_of
from hfsim.scene.schema import Deck

_PLACES, _RATES = ("position", "angle", "orientation"), ("velocity", "angular_velocity")


def mounts(deck: Deck, rates: bool = False) -> dict[str, JointSpec]:
    """Return the joints of bushings that hold bodies at the start, or have them move along, by deck path.

    They hold what joints do not connect with the ground and of which no place or turn is stated, or no rate;
    and the place alone of what has none but by joints of turns, such as drivers of angles.
    """
    every = _mounts_of(deck)
    if not every:
        return {}
    joints = _joints_of(deck)
    whole = _holding(every, deck, joints, _RATES if rates else _PLACES)
    found = {f"springs.{name}": every[name] for name in whole}
    if not rates:
        held = [*(one for one in joints if one.carries), *(every[name] for name in whole)]
        for name in _holding(every, deck, held, _PLACES[:1]):
            found[f"springs.{name}"] = every[name].model_copy(update={"faces": False})
    return found


def overruled(deck: Deck) -> list[str]:
    """Return bushings that hold both place and turn, of what starts where others say."""
    every, n_dim, joints = _mounts_of(deck), deck.dimension, _joints_of(deck)
    full = [name for name in every if deck.springs[name].firmness(n_dim)[0] == freedoms(n_dim)]
    if len(full) < 2:
        return []
    heeded, apart = _holding(every, deck, joints, _PLACES), _Placing.of(deck, joints, _PLACES)
    return [name for name in full if name not in heeded and apart.joins(every[name]) in (0, 1)]


def _mounts_of(deck: Deck) -> dict[str, JointSpec]:
    return {name: mount for name, spring in deck.springs.items() if (mount := spring.mount) is not None}


def _joints_of(deck: Deck) -> list[JointSpec]:
    return [one for one in deck.joints.values() if one.holds]


@frozen
class _Placing:
    """What is connected so far, and what is known of it.

    Attributes
    ----------
    part : dict of str to set of str
        Of each body, and the ground, those that it is connected with.
    known : set of str
        The ground, and bodies of which something is stated.
    """

    part: dict[str, set[str]]
    known: set[str]

    @classmethod
    def of(cls, deck: Deck, joints: Iterable[JointSpec], keys: Sequence[str]) -> _Placing:
        """Return what some joints connect, and where any of some values is stated."""
        stated = {k for k, one in deck.motions.items() if any(getattr(one, key) is not None for key in keys)}
        return cls(parts_of(("ground", *deck.bodies), map(owners, joints)), {"ground", *stated})

    def joins(self, mount: JointSpec) -> int | None:
        """Return how many of the parts that it connects are known; None if they are one."""
        a, b = (self.part[split_point(end)[0]] for end in mount.between)
        return None if a is b else sum(not one.isdisjoint(self.known) for one in (a, b))

    def spread(self, some: Sequence[tuple[str, JointSpec]], found: list[str]) -> None:
        """Connect what some mounts join, in each round what is next to the known; add their names to a list.

        Those between bodies of which neither is known come last.
        """
        of, waiting = dict[str, list[int]](), list(range(len(some)))
        for k, (_, mount) in enumerate(some):
            for body in owners(mount):
                of.setdefault(body, []).append(k)
        while waiting:
            reached = set[str]()
            for name, mount in [some[k] for k in waiting if self.joins(some[k][1]) == 1]:
                if self.joins(mount) == 1:
                    found.append(name)
                    reached |= self._connect(mount)
            waiting = sorted({k for body in reached for k in of.get(body, ())})
        for name, mount in some:
            if self.joins(mount) == 0:
                found.append(name)
                self._connect(mount)

    def _connect(self, mount: JointSpec) -> set[str]:
        """Connect what a mount joins; return what had nothing known about it before."""
        parts = (self.part[body] for body in owners(mount))
        unknown = {body for part in parts if part.isdisjoint(self.known) for body in part}
        connect(self.part, owners(mount))
        return unknown


def _holding(
    every: Mapping[str, JointSpec], deck: Deck, joints: Iterable[JointSpec], keys: Sequence[str]
) -> list[str]:
    """Return the mounts that hold what some joints do not connect with the ground or with what is stated."""
    placing, found = _Placing.of(deck, joints, keys), list[str]()
    firmness = {name: deck.springs[name].firmness(deck.dimension) for name in every}
    ranked = sorted(every, key=lambda name: (*(-one for one in firmness[name]), name))
    for _, alike in groupby(ranked, lambda name: firmness[name][:2]):
        placing.spread([(name, every[name]) for name in alike], found)
    return found
