"""Full turns of angles that the coordinates give modulo a turn only, counted along a motion."""

from __future__ import annotations

from dataclasses import field
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import mutable
from hfsim.maths.traced import live

NEAR = 0.5 * np.pi
"""How far an angle may leave what was expected of it within a step [rad]; by half a turn it is ambiguous."""


class Turning(NamedTuple):
    """An angle with all its turns [rad] at a time [s], and its rate [rad/s]."""

    t: float
    angle: float
    rate: float

    def at(self, t: Array) -> Array:
        """Return the angle at times at which it has gone on like that."""
        return self.angle + self.rate * (t - self.t)


@mutable
class TurnCount:
    """The full turns of one angle: of all that differ by turns the one nearest to what is expected is meant.

    Expected is that it goes on as it did when it was last noted.  Along a motion that is at the last kept
    step; of what was noted before, as much is kept as it takes to count the turns of any earlier time.

    Attributes
    ----------
    noted : list of Turning
        In order of time.
    now : Turning, or None
        At the last kept step of a motion that is under way.
    """

    noted: list[Turning] = field(default_factory=lambda: [Turning(0.0, 0.0, 0.0)])
    now: Turning | None = None

    def __post_init__(self) -> None:
        self._last, self._noted = np.zeros(3), np.zeros(3)
        self.take(self.noted, self.now)

    @property
    def memory(self) -> tuple[list[Turning], Turning | None]:
        """What is known of the angle."""
        return self.noted, self.now

    def take(self, noted: list[Turning], now: Turning | None) -> None:
        """Take this for what is known of the angle."""
        self.noted, self.now = noted, now
        self._last[:], self._noted[:] = now or noted[-1], noted[-1]

    def suppose(self, t: float, angle: float) -> None:
        """Say about what the angle is [rad] where a motion is to begin."""
        self.take([Turning(t, angle, 0.0)], None)

    def expected(self, t: Array) -> Array:
        """Return about what the angle is at times (n_batch,)."""
        last = live(self._last)
        if last is not self._last:  # a tape is for steps, which all begin at the last kept one
            return np.asarray(last[1] + last[2] * (t - last[0]))
        if self.now is not None and (t >= self.now.t).all():
            return self.now.at(t)
        known = self.noted if self.now is None else [*self.noted, self.now]
        times, angles, rates = np.array(known).T
        k = np.maximum(np.searchsorted(times, t, side="right") - 1, 0)
        return np.asarray(angles[k] + rates[k] * (t - times[k]))

    def left(self, t: Array, angle: Array) -> Array:
        """Return by how much angles (n_batch,) leave what is expected, and what was noted, at most."""
        noted = Turning(*live(self._noted)).at(t)
        return np.stack([np.abs(angle - one).max() for one in (self.expected(t), noted)])

    def counted(self, t: Array, angle: Array) -> Array:
        """Return angles (n_batch,), given modulo a turn, with all their turns."""
        return np.asarray(angle + 2.0 * np.pi * np.rint((self.expected(t) - angle) / (2.0 * np.pi)))

    def start(self, here: Turning) -> None:
        """Begin to follow a motion; what was noted of later times belonged to another one."""
        self.take([*(one for one in self.noted if one.t < here.t), here], here)

    def keep(self, here: Turning, left: float) -> None:
        """Go on to the end of a step, in which the angle left what was noted by so much."""
        assert self.now is not None
        if left > NEAR:
            self.take([*self.noted, self.now], here)
        else:
            self.reach(here)

    def reach(self, here: Turning) -> None:
        """Go on to a state in which the angle is still near what was noted."""
        self.now, self._last[:] = here, here

    def known(self) -> Array:
        """Return time, angle and rate at the last kept step, (3,); on a tape, where it has them."""
        return live(self._last)

    def end(self) -> None:
        """End the motion."""
        self.take(self.noted if self.now is None else [*self.noted, self.now], None)
