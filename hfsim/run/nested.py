"""Memories: plain arrays by name, all that something must know to go on where it was put down."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from hfsim.maths.arrays import Array

Memory: TypeAlias = dict[str, Array]


def named(name: str, memory: Mapping[str, Array]) -> Memory:
    """Return a memory under a name in a larger one."""
    return {f"{name}.{key}": one for key, one in memory.items()}


def part_of(memory: Mapping[str, Array], name: str) -> Memory:
    """Return what a memory has under a name.

    Examples
    --------
    >>> part_of(named("steps", {"t": 1.0}) | {"other.t": 2.0}, "steps")
    {'t': 1.0}
    """
    return {key[len(name) + 1 :]: one for key, one in memory.items() if key.startswith(f"{name}.")}
