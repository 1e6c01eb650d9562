"""Resistances that tables tell: of the stretch of a spring, and of the rate of a damper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.piecewise import Piecewise
from hfsim.mechanics.resistances import Resistance

SHARP = 1.0
"""Change of the slope of a table by the jump of its second derivative, over an interval and relative to the
slope there, from which steps end at the point between."""
SEVERAL, BENT = 20, 0.5
"""Such points of a table from which they may be the noise of what was measured, and the same change of the
force, over its range, that then is none."""


@frozen
class Curve:
    """Cubics through points, monotone where these are (PCHIP, Fritsch and Butland), and straight on beyond.

    Attributes
    ----------
    integral : Piecewise
        Of the cubics.
    ends : tuple of float
        First and last place of the points.
    bends : tuple of float
        Places of points at which the curve bends sharply.
    """

    integral: Piecewise
    ends: tuple[float, float]
    bends: tuple[float, ...]

    @classmethod
    def through(cls, table: Sequence[Sequence[float]]) -> Curve:
        """Return that through rows (place, value)."""
        from scipy.interpolate import PchipInterpolator

        places, values = np.array(table).T
        curve = PchipInterpolator(places, values)
        ends = float(places[0]), float(places[-1])
        return cls(Piecewise.of(curve.antiderivative()), ends, _sharp_bends(curve))

    def stored(self, s: Array) -> Array:
        """Return the integral from the first point."""
        inside, beyond = self._places(s)
        straight = (self.integral(inside, 1) + 0.5 * self.integral(inside, 2) * beyond) * beyond
        return np.asarray(self.integral(inside) + straight)

    def value(self, s: Array) -> Array:
        """Return the value."""
        inside, beyond = self._places(s)
        return np.asarray(self.integral(inside, 1) + self.integral(inside, 2) * beyond)

    def slope(self, s: Array) -> Array:
        """Return its derivative."""
        return self.integral(self._places(s)[0], 2)

    def _places(self, s: Array) -> tuple[Array, Array]:
        """Return places kept within the points, and how far they are beyond."""
        inside = np.clip(s, *self.ends)
        return inside, s - inside


@dataclass(frozen=True)
class TableSpring(Resistance):
    """A force by the stretch from a rest.

    Attributes
    ----------
    curve : Curve
    rest : float
        Where the stretch is zero.
    """

    curve: Curve
    rest: float

    @classmethod
    def through(cls, table: Sequence[Sequence[float]], rest: float) -> TableSpring:
        """Return it through rows (stretch, force)."""
        return cls(Curve.through(table), rest)

    @property
    def edges(self) -> tuple[float, ...]:
        """Where it bends sharply: a step may come by what is between two of these."""
        return tuple(self.rest + at for at in self.curve.bends)

    def energy(self, t: Array, s: Array) -> Array:
        """Return the integral of the force from the rest."""
        return self.curve.stored(s - self.rest) - self.curve.stored(np.zeros(1))

    def elastic(self, t: Array, s: Array) -> Array:
        """Return the force."""
        return self.curve.value(s - self.rest)

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return that."""
        return self.elastic(t, s)

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return the derivative of the curve."""
        return self.curve.slope(s - self.rest), np.zeros_like(s)


@dataclass(frozen=True)
class TableDamper(Resistance):
    """A force by the rate, which resists it.

    Attributes
    ----------
    curve : Curve
        Zero at zero.
    """

    curve: Curve
    holds: ClassVar[bool] = False
    uses_rates: ClassVar[bool] = True

    @property
    def rate_edges(self) -> tuple[float, ...]:
        """Where it bends sharply."""
        return self.curve.bends

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return the value at the rate."""
        return self.curve.value(w)

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return zero, and the derivative of the curve."""
        return np.zeros_like(s), self.curve.slope(w)


def _sharp_bends(curve: Any) -> tuple[float, ...]:
    """Return the points of a `PchipInterpolator` at which a jump of the second derivative counts."""
    places, (cubic, square) = curve.x, curve.c[:2]
    lengths, secants = np.diff(places), np.abs(np.diff(curve(places)) / np.diff(places))
    before, after = np.append(0.0, 2.0 * square + 6.0 * cubic * lengths), np.append(2.0 * square, 0.0)
    shorter = np.minimum(np.append(np.inf, lengths), np.append(lengths, np.inf))
    steeper = np.maximum(np.append(0.0, secants), np.append(secants, 0.0))
    sharp = (change := np.abs(after - before) * shorter) > SHARP * steeper
    if sharp.sum() > SEVERAL:
        sharp &= change * shorter > BENT * np.ptp(curve(places))
    return tuple(places[sharp].tolist())
