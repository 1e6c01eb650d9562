"""Laws of the forces on one coordinate: of springs, dampers, stops, motors and servos.

The coordinate s is a distance [m] or an angle [rad], w its rate; t, s and w have shape (n_batch,), so have
forces [N or N m] and energies [J].  A force counts as positive where it drives s back, towards less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from hfsim.maths.arrays import Array

if TYPE_CHECKING:
    from hfsim.deck.laws import Law
    from hfsim.mechanics.once import Event


class Resistance:
    """A force on a coordinate; a kind says what it stores, and what else it does."""

    @property
    def event(self) -> Event | None:
        """What changes it once along the motion."""
        return None

    @property
    def holds(self) -> bool:
        """Whether it resists what moves on evenly: servos need not, their laws may move along."""
        return True

    @property
    def uses_rates(self) -> bool:
        """Whether it depends on the rate."""
        return False

    @property
    def exchanges_power(self) -> bool:
        """Whether any of it is not the slope of its energy."""
        return self.uses_rates

    @property
    def quartic(self) -> bool:
        """Whether it is the slope of a polynomial of degree four at most."""
        return False

    @property
    def laws(self) -> tuple[Law, ...]:
        """Laws of time that it follows."""
        return ()

    @property
    def edges(self) -> tuple[float, ...]:
        """Values of s where it changes its form."""
        return ()

    @property
    def rate_edges(self) -> tuple[float, ...]:
        """Values of w where it does."""
        return ()

    def past_edges(self, t: Array, s: Array, w: Array) -> Array:
        """Return by how much s and w are beyond these values, shape (n_batch, n_edges)."""
        return np.concatenate([s[:, None] - self.edges, w[:, None] - self.rate_edges], axis=1)

    def beyond(self, s: float) -> float:
        """Return how far beyond a limit of its own the coordinate is; zero where there is none."""
        return 0.0

    def stuck(self, t: Array, w: Array) -> float:
        """Return the slope by w of friction that sticks at such a rate (1,); zero where it slides."""
        return 0.0

    def standing(self) -> Resistance:
        """Return it without the rate at which what it goes to moves on."""
        return self

    def energy(self, t: Array, s: Array) -> Array:
        """Return what it stores."""
        return np.zeros_like(s)

    def elastic(self, t: Array, s: Array) -> Array:
        """Return the slope of that."""
        return np.zeros_like(s)

    def fed(self, t: Array, s: Array) -> Array:
        """Return by what rate it stores more where s stands: the power of what moves it on by a law [W]."""
        return np.zeros_like(s)

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return the whole force; w is not asked for where it does not count."""
        raise NotImplementedError

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return the derivatives of the force by s and by w."""
        raise NotImplementedError


@dataclass(frozen=True)
class LinearSpring(Resistance):
    """Stiffness, damping and preload: p + k (s - rest) + d w.

    Attributes
    ----------
    stiffness, damping : float
        k and d, in newtons or newton metres per unit of s, and of its rate.
    rest : float
        Where the stiffness gives no force.
    preload : float
        p, the force there [N or N m].
    """

    stiffness: float
    damping: float = 0.0
    rest: float = 0.0
    preload: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether there is a stiffness."""
        return self.stiffness != 0.0

    @property
    def uses_rates(self) -> bool:
        """Whether there is a damper."""
        return self.damping > 0.0

    @property
    def quartic(self) -> bool:
        """Whether there is none."""
        return not self.damping

    def energy(self, t: Array, s: Array) -> Array:
        """Return (p + 1/2 k (s - rest)) (s - rest)."""
        stretch = s - self.rest
        return np.asarray((self.preload + 0.5 * self.stiffness * stretch) * stretch)

    def elastic(self, t: Array, s: Array) -> Array:
        """Return p + k (s - rest)."""
        force = self.stiffness * (s - self.rest if self.rest else s)
        return force + self.preload if self.preload else force

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return that and d w."""
        elastic = self.elastic(t, s)
        return elastic + self.damping * w if self.damping else elastic

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return k and d."""
        return np.full_like(s, self.stiffness), np.full_like(s, self.damping)


class Led(Resistance):
    """What a law of time leads: it holds nothing, and does work where the law moves on."""

    law: Law
    holds: ClassVar[bool] = False
    exchanges_power: ClassVar[bool] = True

    @property
    def laws(self) -> tuple[Law, ...]:
        """The law."""
        return (self.law,)

    def standing(self) -> Self:
        """Return it with its law standing still."""
        from hfsim.deck.laws import StandingLaw

        return replace(self, law=StandingLaw(self.law))  # type: ignore[type-var]


@dataclass(frozen=True)
class Wound(Led):
    """A spring, or a damper, whose rest follows a law of time, as a winch moves it: by s - law and w - law'.

    It stores what it would if that stood; what moves it does work against its force.

    Attributes
    ----------
    spring : Resistance
        One without force at rest at zero, but for a preload.
    """

    spring: Resistance
    law: Law

    @property
    def uses_rates(self) -> bool:
        """Whether the spring does."""
        return self.spring.uses_rates

    @property
    def edges(self) -> tuple[float, ...]:
        """Those of the spring, of s - law."""
        return self.spring.edges

    @property
    def rate_edges(self) -> tuple[float, ...]:
        """Those of the spring, of w - law'."""
        return self.spring.rate_edges

    def past_edges(self, t: Array, s: Array, w: Array) -> Array:
        """Return that of the spring."""
        return self.spring.past_edges(t, s - self.law.value(t), w - self.law.rate(t))

    def energy(self, t: Array, s: Array) -> Array:
        """Return that of the spring."""
        return self.spring.energy(t, s - self.law.value(t))

    def elastic(self, t: Array, s: Array) -> Array:
        """Return that of the spring."""
        return self.spring.elastic(t, s - self.law.value(t))

    def fed(self, t: Array, s: Array) -> Array:
        """Return minus that times the rate of the law."""
        return -self.elastic(t, s) * self.law.rate(t)

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return that of the spring."""
        return self.spring.force(t, s - self.law.value(t), w - self.law.rate(t) if self.uses_rates else w)

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return those of the spring."""
        return self.spring.slopes(t, s - self.law.value(t), w - self.law.rate(t))


@dataclass(frozen=True)
class Stop(Resistance):
    """A stiff spring beyond a limit, with damping as Hunt and Crossley (1975) have it; it only ever pushes.

    Its force is f(d) (c d' + sqrt(1 + (c d')^2)) with the depth d: for small rates f (1 + c d'), and never
    the other way.  The stiffness f' rises from zero to its full size by 3 y^2 - 2 y^3, y = d / transition.

    Attributes
    ----------
    limit, side : float
        Where it begins; 1 where it holds s below, -1 where it holds it above.
    stiffness, damping : float
        Full size of f', and c in inverse units of w.
    transition : float
        Depth from which the stiffness has its full size.
    """

    limit: float
    side: float
    stiffness: float
    damping: float
    transition: float

    @property
    def uses_rates(self) -> bool:
        """Whether it is damped."""
        return self.damping > 0.0

    @property
    def edges(self) -> tuple[float, ...]:
        """Where it begins, and where it has its full stiffness."""
        return self.limit, self.limit + self.side * self.transition

    def beyond(self, s: float) -> float:
        """Return the depth, where the stiffness has its full size."""
        depth = self.side * (s - self.limit)
        return depth if depth > self.transition else 0.0

    def _depth(self, s: Array) -> tuple[Array, Array]:
        """Return the depth in transitions, zero before the limit, and the same cut off at one."""
        deep = np.maximum(self.side * (s - self.limit) / self.transition, 0.0)
        return deep, np.minimum(deep, 1.0)

    def energy(self, t: Array, s: Array) -> Array:
        """Return the integral of f over the depth."""
        deep, y = self._depth(s)
        first, rest = y**4 * (0.25 - 0.1 * y), deep - y
        return np.asarray(self.stiffness * self.transition**2 * (first + 0.5 * rest * (deep + y - 1.0)))

    def _push(self, s: Array) -> Array:
        """Return f."""
        deep, y = self._depth(s)
        return np.asarray(self.stiffness * self.transition * (y**3 * (1.0 - 0.5 * y) + deep - y))

    def elastic(self, t: Array, s: Array) -> Array:
        """Return f, by its side."""
        return self.side * self._push(s)

    def _damped(self, w: Array) -> tuple[Array, Array]:
        """Return the factor of the damping, and its root."""
        rate = self.side * self.damping * w
        root = np.sqrt(1.0 + rate * rate)
        # the same as rate + root, without cancellation where it is small
        return np.where(rate < 0.0, 1.0 / (root - np.minimum(rate, 0.0)), root + rate), root

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return f with its damping."""
        return self.elastic(t, s) * self._damped(w)[0] if self.damping else self.elastic(t, s)

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return what stiffness and damping make of it."""
        y = self._depth(s)[1]
        stiff = self.stiffness * y * y * (3.0 - 2.0 * y)
        if not self.damping:
            return stiff, np.zeros_like(s)
        factor, root = self._damped(w)
        return stiff * factor, self._push(s) * self.damping * factor / root


@dataclass(frozen=True)
class Push(Resistance):
    """What a motor does: a force or torque towards more, scaled over time.

    Attributes
    ----------
    size : float
        [N or N m]
    law : Law, or None
        Factor over time; 1 without it.
    """

    size: float
    law: Law | None = None
    holds: ClassVar[bool] = False
    exchanges_power: ClassVar[bool] = True

    @property
    def laws(self) -> tuple[Law, ...]:
        """Its factor over time."""
        return () if self.law is None else (self.law,)

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return minus its size."""
        return -self.size * (np.ones_like(s) if self.law is None else self.law.value(t))

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return zeros."""
        return np.zeros_like(s), np.zeros_like(s)


@dataclass(frozen=True)
class Control(Led):
    """What a servo does: it drives s back to a law of time, by k (s - law) + d (w - law').

    All of it is power exchanged: what it stored would depend on the time.

    Attributes
    ----------
    stiffness, damping : float
        k and d.
    limit : float, or None
        The force F becomes limit tanh(F / limit).
    """

    law: Law
    stiffness: float
    damping: float
    limit: float | None

    @property
    def uses_rates(self) -> bool:
        """Whether it is damped."""
        return self.damping > 0.0

    def _asked(self, t: Array, s: Array, w: Array) -> Array:
        """Return what the gains ask for."""
        asked = self.stiffness * (s - self.law.value(t))
        return np.asarray(asked + self.damping * (w - self.law.rate(t)) if self.damping else asked)

    def force(self, t: Array, s: Array, w: Array) -> Array:
        """Return that, or what the limit leaves of it."""
        asked = self._asked(t, s, w)
        return asked if self.limit is None else self.limit * np.tanh(asked / self.limit)

    def slopes(self, t: Array, s: Array, w: Array) -> tuple[Array, Array]:
        """Return what is left of stiffness and damping."""
        left = np.ones_like(s)
        if self.limit is not None:
            left -= np.tanh(self._asked(t, s, w) / self.limit) ** 2
        return self.stiffness * left, self.damping * left
