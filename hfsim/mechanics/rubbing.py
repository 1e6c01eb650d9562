"""Contact with friction: a ball about one point that presses on a plane of another body, and rubs there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import dot, lever, turning
from hfsim.mechanics.constraints import Along
from hfsim.mechanics.force import difference
from hfsim.mechanics.friction import SLIDING
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import GapTie

AT_REST = 1e-6
"""Speed, in velocities of friction, that is added to each at a right angle: at rest it has a direction."""


@frozen
class RubbingTie(GapTie):
    """Resistances on a distance along a normal, with Coulomb friction of what they press with.

    The friction is coefficient N tanh(v / velocity) against the slip, of speed v: that of the second body at
    the place where a ball about its point touches the plane, against the first body there.

    Attributes
    ----------
    radius : float
        Of the ball [m].
    coefficient, velocity : float
        [-], [m/s]
    """

    measure: Along
    radius: float = 0.0
    coefficient: float = 0.0
    velocity: float = 1e-3
    told: ClassVar[str] = "contact with friction"
    uses_rates: ClassVar[bool] = True
    exchanges_power: ClassVar[bool] = True
    holds_together: ClassVar[bool] = False

    @classmethod
    def with_friction(cls, tie: GapTie, radius: float, coefficient: float, velocity: float) -> RubbingTie:
        """Return a tie on a distance along an axis with friction."""
        assert isinstance(tie.measure, Along)
        own = tie.first, tie.second, tie.resistances, tie.measure, tie.counter
        return cls(*own, radius, coefficient, velocity)

    @cached_property
    def _axis(self) -> Array:
        return np.array(self.measure.direction)

    def _touching(self, x: Array) -> tuple[Array, list[tuple[float, Marker, Array]]]:
        """Return the normal, (n_batch, n_dim), and of the moving ends sign, marker, Jacobian of the place."""
        up = self.first.turned(x, self._axis)
        down, found = -self.radius * up, list[tuple[float, Marker, Array]]()
        for k, marker in self._ends:
            J = marker.position_jacobian(x)
            if not k:
                there = self.second.position(x) + down - marker.position(x)
                J = J + turning(there) @ marker.spin_jacobian(x)
            elif self.radius:
                J = J + turning(down) @ marker.spin_jacobian(x)
            found.append((1.0 if k else -1.0, marker, J))
        return up, found

    def slip(self, t: Array, x: Array, u: Array) -> Array:
        """Return the velocity of the second body against the first in the plane [m/s], (n_batch, n_dim)."""
        return self._slipping(u, *self._touching(x))

    def _slipping(self, u: Array, up: Array, ends: list[tuple[float, Marker, Array]]) -> Array:
        own = [sign * (J @ u[:, end.columns, None])[..., 0] for sign, end, J in ends]
        v = sum(own, np.zeros((len(u), self.first.n_dim)))
        return np.asarray(v - dot(v, up) * up)

    def stuck(self, t: Array, x: Array, u: Array) -> float:
        """Return the slope of the friction where it sticks in one state."""
        v = self.slip(t, x, u)
        slides = np.sqrt(dot(v, v))[0, 0] >= SLIDING * self.velocity
        return 0.0 if slides else self.coefficient * float(self.effort(t, x, u)[0]) / self.velocity

    def friction(self, t: Array, x: Array, u: Array) -> Array:
        """Return the friction on the second body [N], (n_batch, n_dim)."""
        return self._against(t, x, u, self.slip(t, x, u))

    def _against(self, t: Array, x: Array, u: Array, v: Array) -> Array:
        speed = np.sqrt(dot(v, v) + (AT_REST * self.velocity) ** 2)
        size = self.coefficient * self.effort(t, x, u)[:, None] * np.tanh(speed / self.velocity)
        return np.asarray(-size / speed * v)

    def _rubbed(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield the ends that can move, with the friction there."""
        up, ends = self._touching(x)
        force = self._against(t, x, u, self._slipping(u, up, ends))
        for sign, marker, J in ends:
            yield marker, sign * (force[:, None] @ J)[:, 0]

    def on_points(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield the ends that can move, with all forces there."""
        for (marker, force), (_, own) in zip(super().on_points(t, x, u), self._rubbed(t, x, u), strict=True):
            yield marker, force + own

    def reaction(self, t: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """Return the force [N], (n_batch, n_dim), and moment [N m], (n_batch, n_spin), on the second body."""
        (force, moment), own = super().reaction(t, x, u), self.friction(t, x, u)
        return force + own, moment + lever(-self.radius * self.first.turned(x, self._axis), own)

    def _by(self, moved: Callable[[Array], tuple[Array, Array]], t: Array, at: Array) -> Entries:
        """Return minus the derivative of the friction by x or u, of which a function makes both."""

        def resistance(change: Array) -> Array:
            x, u = np.broadcast_arrays(*moved(change))
            out = np.zeros(x.shape)
            for marker, force in self._rubbed(np.repeat(t, len(x)), x, u):
                out[:, marker.columns] -= force
            return out

        return difference(resistance, at, self.support)

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of all forces by x in one state."""
        return Entries.joined([super().tangent(t, x, u), self._by(lambda moved: (moved, u), t, x)])

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of all forces by u in one state."""
        return Entries.joined([super().rate_tangent(t, x, u), self._by(lambda moved: (x, moved), t, u)])

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of what is not the slope of an energy."""
        return np.asarray(super().power(t, x, u) + self._rubbing_power(t, x, u))

    def delivered(self, t: Array, x: Array, u: Array) -> Array:
        """Return what all forces put into both bodies [W]."""
        return np.asarray(super().delivered(t, x, u) + self._rubbing_power(t, x, u))

    def _rubbing_power(self, t: Array, x: Array, u: Array) -> Array:
        return np.asarray(dot(self.friction(t, x, u), self.slip(t, x, u))[:, 0])
