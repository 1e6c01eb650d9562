"""What is written along an axis of numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from matplotlib.ticker import MaxNLocator

from hfsim.maths.arrays import Array

_LEVEL = 1e-3
"""Range over the size of values from which down changes are shown alone."""
_ROUNDING = 1e-4
"""Part of a range that no number written along it is as small as."""
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


def with_unit(words: str, unit: str) -> str:
    """Return an axis label."""
    return f"{words} [{unit}]" if unit else words


class Scale(NamedTuple):
    """How numbers along an axis are told: ``(value - base) / factor``.

    Attributes
    ----------
    label : str
        With what was taken off the numbers.
    least : float
        What is nearer to zero than this is zero.
    """

    label: str
    base: float
    factor: float
    least: float

    @classmethod
    def of(cls, low: float, high: float, label: str) -> Self:
        """Return that of numbers between limits; large or small ones, and small changes, go into the label.

        Examples
        --------
        >>> Scale.of(-4.0, -4.0 + 1e-9, "energy [J]").label
        'energy + 3.999999999 J [1e-9 J]'
        >>> Scale.of(0.0, 3e7, "energy [J]")
        Scale(label='energy [1e6 J]', base=0.0, factor=1000000.0, least=0.003)
        """
        base, size = 0.0, max(abs(low), abs(high))
        if high - low < _LEVEL * size:
            digits = math.ceil(math.log10(size / (high - low))) if high > low else 6
            base = float(f"{0.5 * (low + high):.{max(0, digits - 1)}e}")
            size = max(abs(low - base), abs(high - base))
        power = 3 * math.floor(math.log10(size) / 3.0) if size > 0.0 else 0
        power = 0 if -3 <= math.log10(size or 1.0) < 5 else power
        found = re.fullmatch(r"(.*) \[(.*)\]", label)
        words, unit = (found[1], found[2]) if found else (label, "")
        if base:
            sign = "\N{MINUS SIGN}" if base > 0.0 else "+"
            words += f" {sign} {abs(base):.15g} {unit}".rstrip()
        unit = f"1e{power} {unit}".strip() if power else unit
        return cls(with_unit(words, unit), base, 10.0**power, _ROUNDING * (high - low) / 10.0**power)

    def word(self, value: float) -> str:
        """Return what is written for a number."""
        told = (value - self.base) / self.factor
        return f"{0.0 if abs(told) < self.least else told:.5g}".replace("-", "\N{MINUS SIGN}")


class Axis(NamedTuple):
    """One side of a panel.

    Attributes
    ----------
    low, high : float
        Its ends.
    ticks : ndarray
        Where numbers stand.
    words : tuple of str
        What is written there.
    """

    low: float
    high: float
    label: str = ""
    ticks: Array = np.zeros(0)
    words: tuple[str, ...] = ()

    def told(self, label: str, most: int, steps: Sequence[float] = _STEPS, least: int = 2) -> Self:
        """Return it with a label and ``most`` gaps between ticks at most, at steps times a power of ten."""
        low, high = sorted((self.low, self.high))
        places = ticks(low, high, most, steps, least)
        scale = Scale.of(low, high, label)
        return self._replace(label=scale.label, ticks=places, words=tuple(map(scale.word, places.tolist())))


def ticks(low: float, high: float, most: int, steps: Sequence[float] = _STEPS, least: int = 2) -> Array:
    """Return round numbers between limits, with ``most`` gaps between them at most."""
    places = np.asarray(MaxNLocator(most, steps=steps, min_n_ticks=least).tick_values(low, high))
    margin = 1e-9 * (high - low)
    return places[(places >= low - margin) & (places <= high + margin)]
