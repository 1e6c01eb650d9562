"""Which bodies joints close to loops with each other: the blocks of the graph of bodies and joints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations

from hfsim.maths.frozen import frozen
from hfsim.scene.closing import Linkage

GROUND = -1


def ends_of(linkage: Linkage) -> list[list[int]]:
    """Return which bodies, or the ground, each constraint is between."""
    owners = ([linkage.owner(marker) for marker in c.ends] for c in linkage.constraints)
    return [[GROUND if k is None else k for k in ends] for ends in owners]


@frozen
class Loops:
    """Bodies by number, the ground as `GROUND`, and the loops that joints make of them.

    Two loops that share no more than one body, or the ground, are two.  A joint is known by the outer one of
    its bodies, a loop by the innermost of its joints; a joint in no loop is one of its own.

    Attributes
    ----------
    inner : dict of int to int
        Of each body the next one towards the ground, those nearest to it first; of the first one of a group
        that floats, the ground too.
    depth : dict of int to int
        How many joints are between a body and the ground.
    """

    inner: dict[int, int]
    depth: dict[int, int]
    _known_by: dict[int, int]

    @classmethod
    def of(cls, count: int, joints: Iterable[Sequence[int]]) -> Loops:
        """Return the loops of so many bodies, by which of them, and the ground, each joint ties."""
        pairs = dict.fromkeys(pair for ends in joints for pair in combinations(sorted(set(ends)), 2))
        near: dict[int, list[int]] = {k: [] for k in range(GROUND, count)}
        for a, b in pairs:
            near[a].append(b)
            near[b].append(a)
        inner, depth = dict[int, int](), {GROUND: 0}
        for first in range(GROUND, count):
            new = first not in depth
            if new:
                inner[first], depth[first] = GROUND, 1
            group = [first] if new or first == GROUND else []
            for body in group:
                for other in near[body]:
                    if other not in depth:
                        inner[other], depth[other] = body, depth[body] + 1
                        group.append(other)
        loops = cls(inner, depth, {body: body for body in depth})
        for pair in pairs:
            loops._close(*pair)
        return loops

    def loop_of(self, ends: Iterable[int]) -> int:
        """Return the loop of the joint of some bodies."""
        return self._find(max(ends, key=self.depth.__getitem__))

    def bodies(self, loops: Iterable[int]) -> Iterator[int]:
        """Yield the bodies of some loops, more than once those in several, and the ground."""
        wanted = set(loops)
        for outer, inner in self.inner.items():
            if self._find(outer) in wanted:
                yield from (outer, inner)

    def _close(self, a: int, b: int) -> None:
        """Make one loop of a joint of two bodies and of all joints on the ways from these to where they meet.

        It goes from loop to loop: where these are left above the meeting point, that is in them.
        """
        if self.inner.get(a) == b or self.inner.get(b) == a:
            return
        last = None
        while a != b:
            a, b = sorted((a, b), key=self.depth.__getitem__)
            loop = self._find(b)
            b = self.inner[loop]
            if last is not None:
                loop, outer = sorted((loop, last), key=self.depth.__getitem__)
                self._known_by[outer] = loop
            last = loop

    def _find(self, outer: int) -> int:
        while (known := self._known_by[outer]) != outer:
            self._known_by[outer] = self._known_by[known]
            outer = known
        return outer
