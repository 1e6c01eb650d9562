"""What a run remembers between two steps, as plain arrays that a file can hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array

Memory = dict[str, Array]
"""Arrays of numbers, truth values and texts by name; scalars have no axis."""


class Remembering:
    """Base of what goes on, from one step to the next, with some of its attributes alone.

    The arrays among them are replaced, never changed in place: memories share them.
    """

    remembers: ClassVar[tuple[str, ...]] = ()
    """Names of these attributes: numbers, truth values, texts and arrays."""

    def memory(self) -> dict[str, Any]:
        """Return all that the next step depends on, beside the state."""
        own = vars(self)
        return {name: own[name] for name in self.remembers}

    def kept(self) -> Callable[[], dict[str, Any]]:
        """Return what tells the memory of now, also when this has gone on."""
        return partial(_told, type(self), vars(self).copy())

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as the one did whose memory this is."""
        for name in self.remembers:
            setattr(self, name, memory[name])


def _told(kind: type[Remembering], own: dict[str, Any]) -> dict[str, Any]:
    """Return the memory of one that has such attributes."""
    twin = object.__new__(kind)
    vars(twin).update(own)
    return twin.memory()


def packed(memories: Mapping[str, Mapping[str, Any]]) -> Memory:
    """Return the memories of several things as one of arrays.

    Examples
    --------
    >>> packed({"pace": {"attempts": 3}, "state": {"t": 0.5}})
    {'pace.attempts': array(3), 'state.t': array(0.5)}
    """
    return {
        f"{owner}.{name}": np.asarray(value)
        for owner, memory in memories.items()
        for name, value in memory.items()
    }


def unpacked(memory: Mapping[str, Array], owner: str) -> dict[str, Any]:
    """Return what one thing remembers, scalars as Python's own.

    Examples
    --------
    >>> unpacked(packed({"pace": {"attempts": 3}, "state": {"t": 0.5}}), "state")
    {'t': 0.5}
    """
    return {name: value if value.ndim else value.item() for name, value in part_of(memory, owner).items()}


def part_of(memory: Mapping[str, Array], owner: str) -> Memory:
    """Return what one thing remembers, as arrays.

    Examples
    --------
    >>> part_of(packed({"pace": {"attempts": 3}, "state": {"t": 0.5}}), "pace")
    {'attempts': array(3)}
    """
    start = f"{owner}."
    return {name.removeprefix(start): one for name, one in memory.items() if name.startswith(start)}
