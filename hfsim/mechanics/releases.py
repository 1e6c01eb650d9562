"""Releases: what lets a spring go for good, as of a hold-down that opens or a fuse that breaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.traced import live
from hfsim.mechanics.once import Event
from hfsim.mechanics.resistances import Resistance

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


@dataclass(frozen=True)
class Release(Event):
    """A spring lets go at a time, or when its force or moment reaches a limit.

    Attributes
    ----------
    at : float
        The time [s].
    most : tuple of (str, float)
        Units of coordinates, and the largest force (m) or moment (rad) of all its ties together [N or N m].
    """

    told: ClassVar[str] = "releases"
    at: float = np.inf
    most: tuple[tuple[str, float], ...] = ()

    @property
    def time(self) -> float:
        """The time."""
        return self.at

    def item(self, ties: Sequence[Any]) -> str:
        """Return the deck path of the spring, whose ties have more words in theirs."""
        return ".".join(ties[0].item.split(".")[:2])

    def past(self, ties: Sequence[Any], t: Array, x: Array, u: Array) -> Array:
        """Return the least of the time that is left [s], and of the share of each limit that is."""
        left = [self.at - t] if np.isfinite(self.at) else []
        exerted = [tie.exerted(t, x, u) for tie in ties] if self.most else []
        for unit, most in self.most:
            first, *others = (one[unit] for one in exerted if unit in one)
            whole = sum(others, first)
            left.append(1.0 - np.sqrt((whole * whole).sum(axis=1)) / most)
        least = left[0]
        for one in left[1:]:
            least = np.minimum(least, one)
        return least

    def happens_at_start(self, t: float, past: float, size: float, moving: bool) -> bool:
        """Tell whether the time has come, or a limit is passed where a motion starts."""
        return self.at <= t or (moving and past <= 0.0)

    def side_before(self, past: float) -> float:
        """Return that something is left."""
        return 1.0


@dataclass(frozen=True)
class Released(Resistance):
    """A resistance that is there until a release.

    Attributes
    ----------
    inner : Resistance
    release : Release
        Maybe of several.
    """

    inner: Resistance
    release: Release

    @property
    def event(self) -> Event:
        """The release."""
        return self.release

    @property
    def holds(self) -> bool:
        """Whether the resistance does."""
        return self.inner.holds

    @property
    def uses_rates(self) -> bool:
        """Whether the resistance does."""
        return self.inner.uses_rates

    @property
    def exchanges_power(self) -> bool:
        """Whether the resistance does."""
        return self.inner.exchanges_power

    @property
    def laws(self) -> tuple[Law, ...]:
        """Those of the resistance."""
        return self.inner.laws

    @property
    def edges(self) -> tuple[float, ...]:
        """Those of the resistance."""
        return self.inner.edges

    @property
    def rate_edges(self) -> tuple[float, ...]:
        """Those of the resistance."""
        return self.inner.rate_edges

    def past_edges(self, t: Array, s: Array, w: Array) -> Array:
        """Return that of the resistance."""
        return self.inner.past_edges(t, s, w)

    def standing(self) -> Released:
        """Return it with the resistance at rest."""
        return replace(self, inner=self.inner.standing())

    def _until(self, t: Array, what: Array) -> Array:
        return np.where(t < live(self.release.since), what, 0.0)

    def energy(self, t: Array, s: Array) -> Array:
        """Return what it stores until then."""
        return self._until(t, self.inner.energy(t, s))

    def elastic(self, t: Array, s: Array) -> Array:
        """Return the slope of that."""
        return self._until(t, self.inner.elastic(t, s))

    def fed(self, t: Array, s: Array) -> Array:
        """Return by what rate it stores more until then."""
        return self._until(t, self.inner.fed(t, s))

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return the force until then."""
        return self._until(t, self.inner.force(t, s, w))

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return its slopes until then."""
        by_s, by_w = (self._until(t, one) for one in self.inner.slopes(t, s, w))
        return by_s, by_w
