"""Laws of time: what a driver imposes or a load is scaled with."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.piecewise import Piecewise

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Law(ABC):
    """A function of time with its first two derivatives; times of any shape give results of that shape.

    Between their breaks, all laws are twice continuously differentiable.
    """

    def period(self, begin: float, end: float, t_end: float) -> float:
        """Return the time of its quickest oscillation between two times [s]; infinite where it has none.

        It is looked at until ``t_end``.
        """
        return math.inf

    def breaks(self, order: int, t_end: float = math.inf) -> Array:
        """Return the times [s] at which integrators have to end a step, lest they miss a part of the law.

        Between two of them it is smooth, and its derivative of this order monotone: if it is the same at both
        ends, it has not changed in between.  A law that repeats itself has none.

        Parameters
        ----------
        order : int
            0 where the law acts by its value, as a load does, or 2 where it does by its accelerations.
        t_end : float
            End of the run [s]: what comes later need not be looked for.
        """
        return np.zeros(0)

    def value(self, t: ArrayLike) -> Array:
        """Return the value at times t [s]."""
        return self._at(t, 0)

    def rate(self, t: ArrayLike) -> Array:
        """Return the first time derivative at times t [s]."""
        return self._at(t, 1)

    def acceleration(self, t: ArrayLike) -> Array:
        """Return the second time derivative at times t [s]."""
        return self._at(t, 2)

    def _at(self, t: ArrayLike, order: int) -> Array:
        return self._derivative(np.asarray(t, dtype=float), order)

    @abstractmethod
    def _derivative(self, t: Array, order: int) -> Array:
        """Return the time derivative of order 0, 1 or 2."""


@dataclass(frozen=True)
class LinearLaw(Law):
    """start + slope t."""

    start: float
    slope: float = 0.0

    def _derivative(self, t: Array, order: int) -> Array:
        if order == 0:
            return self.start + self.slope * t
        return np.full_like(t, self.slope if order == 1 else 0.0)


@dataclass(frozen=True)
class SplineLaw(Law):
    """A curve through points: a cubic spline, or straight lines."""

    curve: Piecewise

    def breaks(self, order: int, t_end: float = math.inf) -> Array:
        """Return the points and, between them, where the value turns round."""
        points = self.curve.places
        return points if order else np.concatenate([points, self.curve.turns()])

    def _derivative(self, t: Array, order: int) -> Array:
        return self.curve(t, order)


@dataclass(frozen=True)
class PeriodicLaw(SplineLaw):
    """A curve through points, of which the last is the first again, repeated at all times."""

    def breaks(self, order: int, t_end: float = math.inf) -> Array:
        """Return those of one period, again and again until the end."""
        once, (first, length) = super().breaks(order), self._period
        if not math.isfinite(t_end):
            return once
        rounds = np.arange(math.floor(-first / length), math.ceil((t_end - first) / length))
        repeated: Array = once[once < first + length] + length * rounds[:, None]
        return repeated[(repeated > 0.0) & (repeated < t_end)]

    @property
    def _period(self) -> tuple[float, float]:
        """When the points begin, and how long they last."""
        first, last = self.curve.places[[0, -1]].tolist()
        return first, last - first

    def _derivative(self, t: Array, order: int) -> Array:
        first, length = self._period
        beyond = t - (first + 0.5 * length)  # np.floor is none of the kernel's operations
        return self.curve(t - length * np.rint(beyond / length), order)


@dataclass(frozen=True)
class StepLaw(Law):
    """From one value to another along 10 x^3 - 15 x^4 + 6 x^5, whose rate and acceleration end at zero."""

    low: float
    high: float
    start: float
    end: float

    def breaks(self, order: int, t_end: float = math.inf) -> Array:
        """Return start and end and, between them, where the acceleration turns round."""
        turn = math.sqrt(3.0) / 6.0
        shares = np.array([0.0, 0.5 - turn, 0.5 + turn, 1.0] if order else [0.0, 1.0])
        return self.start * (1.0 - shares) + self.end * shares

    def _derivative(self, t: Array, order: int) -> Array:
        duration = self.end - self.start
        x = np.minimum(np.maximum((t - self.start) / duration, 0.0), 1.0)
        rise = self.high - self.low
        if order == 0:
            return np.asarray(self.low + rise * x**3 * (10 - 15 * x + 6 * x**2))
        if order == 1:
            return np.asarray(rise / duration * 30 * (x * (1 - x)) ** 2)
        return np.asarray(rise / duration**2 * 60 * x * (1 - x) * (1 - 2 * x))


@dataclass(frozen=True)
class SpinUpLaw(Law):
    """From rest to a constant rate, as rotating beams are commonly spun up (Simo & Vu-Quoc 1986)."""

    final_rate: float
    time: float

    def breaks(self, order: int, t_end: float = math.inf) -> Array:
        """Return the end and, before it, where the acceleration turns round."""
        return np.array([0.5 * self.time, self.time] if order else [self.time])

    def _derivative(self, t: Array, order: int) -> Array:
        w = 2 * math.pi / self.time
        if order == 0:
            growing = t**2 / 2 + (np.cos(w * t) - 1) / w**2
            steady = self.final_rate * (t - self.time / 2)
        elif order == 1:
            growing = t - np.sin(w * t) / w
            steady = np.full_like(t, self.final_rate)
        else:
            growing = 1 - np.cos(w * t)
            steady = np.zeros_like(t)
        return np.where(t < self.time, self.final_rate / self.time * growing, steady)


@dataclass(frozen=True)
class SineLaw(Law):
    """offset + amplitude sin(w t + phase)."""

    amplitude: float
    w: float
    phase: float
    offset: float

    def period(self, begin: float, end: float, t_end: float) -> float:
        """Return the time of one oscillation [s]."""
        return 2.0 * math.pi / self.w if self.amplitude else math.inf

    def _derivative(self, t: Array, order: int) -> Array:
        # Each derivative turns the phase by a quarter and brings one factor w.
        oscillation = self.amplitude * self.w**order * np.sin(self.w * t + self.phase + order * math.pi / 2)
        return np.asarray(oscillation + (self.offset if order == 0 else 0.0))


@dataclass(frozen=True)
class ShiftedLaw(Law):
    """Another law from a time on; before, what that is at 0."""

    law: Law
    start: float

    def period(self, begin: float, end: float, t_end: float) -> float:
        """Return that of the other, once it has begun."""
        if end <= self.start:
            return math.inf
        return self.law.period(max(begin - self.start, 0.0), end - self.start, t_end - self.start)

    def breaks(self, order: int, t_end: float = math.inf) -> Array:
        """Return the start and the breaks of the other."""
        later = self.law.breaks(order, t_end - self.start)
        return np.concatenate([[self.start], self.start + later[later > 0.0]])

    def _derivative(self, t: Array, order: int) -> Array:
        begun = self.law._derivative(np.maximum(t - self.start, 0.0), order)
        return begun if order == 0 else np.where(t < self.start, 0.0, begun)


@dataclass(frozen=True)
class StandingLaw(Law):
    """A law that stands still wherever it has come to."""

    law: Law

    def _derivative(self, t: Array, order: int) -> Array:
        return self.law.value(t) if order == 0 else np.zeros_like(t)
