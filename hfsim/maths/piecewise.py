"""Functions that are a polynomial from place to place."""

from __future__ import annotations

from functools import cached_property, reduce
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.traced import Traced, outside

FEW = 32
"""Pieces up to which all are evaluated and one is taken, which a tape can write down."""
FEW_NATIVELY = 3000
"""The same where that is replayed, times places looked up at once: a call of Python takes as long."""


@frozen
class Piecewise:
    """A polynomial in each piece between places; those of the first and the last piece go on beyond.

    Attributes
    ----------
    places : ndarray, shape (n + 1,)
        Rising.
    factors : ndarray, shape (degree + 1, n)
        Of the powers of the distance from where a piece begins, the highest one first, as in SciPy's PPoly.
    """

    places: Array
    factors: Array

    @classmethod
    def of(cls, curve: Any) -> Piecewise:
        """Return a PPoly of SciPy, such as a CubicSpline, as one."""
        return cls(np.asarray(curve.x), np.asarray(curve.c))

    @classmethod
    def joining(cls, places: Array, values: Array) -> Piecewise:
        """Return straight lines from point to point."""
        return cls(places, np.stack([np.diff(values) / np.diff(places), values[:-1]]))

    def __call__(self, x: Array, order: int = 0) -> Array:
        """Return the derivative of an order at places of any shape."""
        if order:
            return self.slope(x, order - 1)
        many = FEW_NATIVELY // max(1, x.size) if isinstance(x, Traced) else 0
        if len(self.places) > max(FEW, many) + 1:
            return outside(_in_pieces, self.factors, self.places, x)
        x = np.asarray(x)[..., None]
        before, behind = self._ends
        values = _powers(self.factors, x - self.places[:-1])
        return np.asarray(np.where(x < before, 0.0, np.where(x >= behind, 0.0, values)).sum(axis=-1))

    def turns(self) -> Array:
        """Return where, inside pieces, values turn round."""
        if len(self.factors) < 3:
            return np.zeros(0)
        from scipy.interpolate import PPoly

        found: Array = np.asarray(PPoly(self.slope.factors, self.places).roots(extrapolate=False))
        return found[np.isfinite(found)]

    @cached_property
    def slope(self) -> Piecewise:
        """The derivative, zero where nothing is left."""
        powers = np.arange(len(self.factors) - 1, 0, -1)
        factors = self.factors[:-1] * powers[:, None] if len(powers) else 0.0 * self.factors
        return Piecewise(self.places, factors)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Where pieces begin and end, (n,); what is compared with no number is never beyond it."""
        nowhere, inner = np.array([np.nan]), self.places[1:-1]
        return np.concatenate([nowhere, inner]), np.concatenate([inner, nowhere])


def _in_pieces(factors: Array, places: Array, x: Array) -> Array:
    """Return values where pieces are looked up."""
    k: IntArray = np.searchsorted(places[1:-1], x, side="right")
    return _powers(factors[:, k], x - places[k])


def _powers(factors: Array, x: Array) -> Array:
    """Return a sum of factors times powers, by Horner's rule."""
    return np.asarray(reduce(lambda found, factor: found * x + factor, factors[1:], factors[0]))
