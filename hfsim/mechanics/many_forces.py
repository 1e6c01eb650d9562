"""Slopes of forces of which there are many: natively their values alone, at places that do not change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import Entries
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.projection import Through, directly

MANY = 16
"""Forces from which calls of Python take longer than what they compute."""
SLOPES = "slopes of forces"
"""How names begin of what is called through something."""
BY_RATES = f"{SLOPES} by rates"


class ManyForces:
    """The slopes of some forces in one state.

    Parameters
    ----------
    parts : sequence of ForcePart
        Their entries have the same places in every state.
    """

    def __init__(self, parts: Sequence[ForcePart]) -> None:
        self._parts = tuple(parts)
        self._places: dict[str, tuple[IntArray, IntArray]] = {}

    def tangents(self, t: Array, x: Array, u: Array, through: Through = directly) -> list[Entries]:
        """Return minus the derivatives by x, called through what may replay them."""
        if len(self._parts) < MANY:
            return [part.tangent(t, x, u) for part in self._parts]
        return [self._joined(SLOPES, self._by_place, (t, x, u), through)]

    def rate_tangents(self, t: Array, x: Array, u: Array, through: Through = directly) -> list[Entries]:
        """Return minus the derivatives by u, likewise."""
        if len(self._parts) < MANY:
            return [part.rate_tangent(t, x, u) for part in self._parts]
        return [self._joined(BY_RATES, self._by_rate, (t, x, u), through)]

    def _joined(self, name: str, function: Any, given: tuple[Array, ...], through: Through) -> Entries:
        values = through(name, function, given)
        if name not in self._places:  # replayed from a recording that another run of the scene has made
            function(*given)
        return Entries(*self._places[name], values)

    def _by_place(self, t: Array, x: Array, u: Array) -> Array:
        return self._values(SLOPES, [part.tangent(t, x, u) for part in self._parts])

    def _by_rate(self, t: Array, x: Array, u: Array) -> Array:
        found = [part.rate_tangent(t, x, u) for part in self._parts]
        return self._values(BY_RATES, found)

    def _values(self, name: str, found: list[Entries]) -> Array:
        rows, columns = (np.concatenate([one[k] for one in found]) for k in range(2))
        self._places[name] = rows, columns
        return np.concatenate([one.values for one in found])
