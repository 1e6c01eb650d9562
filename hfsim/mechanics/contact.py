"""Contact of a point, a ball or the rim of a wheel of one body with a plane of another, with friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import dot, lever, turning
from hfsim.mechanics.friction import SLIDING
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.ties import Tie

DIFFERENCE = 1e-7
"""Step of one-sided differences, relative to coordinates larger than 1."""
AT_REST = 1e-6
"""Speed, in velocities of friction, that is added to each at a right angle: at rest it has a direction."""
FLAT = 1e-9
"""The same of a wheel that lies on the plane, in its radii: where it touches is then anywhere."""


@frozen
class ContactTie(Tie):
    """Resistances on how far what touches is above a plane, with Coulomb friction of what they press with.

    The friction is coefficient N tanh(v / velocity) against the slip, of speed v: that of the second body at
    the place where it touches, or would, against the first body there.

    Attributes
    ----------
    normal : tuple of float
        Of the plane through the first point, a unit vector in the frame there.
    radius : float
        Of a ball about the second point, or of a wheel [m].
    axis : tuple of float, or None
        Of the wheel, a unit vector in the frame of the second point; None of a ball.
    coefficient, velocity : float
        Of friction [-], [m/s]; no coefficient where there is none.
    """

    normal: tuple[float, ...]
    radius: float = 0.0
    axis: tuple[float, ...] | None = None
    coefficient: float = 0.0
    velocity: float = 1e-3
    told: ClassVar[str] = "what keeps a point, a ball or a wheel on one side of a plane"
    unit: ClassVar[str] = "m"
    holds_together: ClassVar[bool] = False

    @property
    def rubs(self) -> bool:
        """Whether there is friction."""
        return self.coefficient > 0.0

    @cached_property
    def uses_rates(self) -> bool:
        """Whether it rubs, or is damped."""
        return self.rubs or any(one.uses_rates for one in self.resistances)

    @cached_property
    def exchanges_power(self) -> bool:
        """Whether it does."""
        return self.uses_rates

    def _directions(self, x: Array) -> tuple[Array, Array]:
        """Return the normal, and the way from the second point to where it touches, (n_batch, n_dim)."""
        up = self.first.turned(x, np.array(self.normal))
        if self.axis is None:
            return up, -self.radius * up
        axis = self.second.turned(x, np.array(self.axis))
        across = up - dot(up, axis) * axis
        return up, -self.radius / np.sqrt(dot(across, across) + FLAT**2) * across

    def _touching(self, x: Array) -> tuple[Array, Array, list[tuple[float, Marker, Array]]]:
        """Return these, and of the moving ends sign, marker and the Jacobian of the place of contact."""
        up, down = self._directions(x)
        found = list[tuple[float, Marker, Array]]()
        for k, marker in self._ends:
            J = marker.position_jacobian(x)
            if not k:
                there = self.second.position(x) + down - marker.position(x)
                J = J + turning(there) @ marker.spin_jacobian(x)
            elif self.radius:
                J = J + turning(down) @ marker.spin_jacobian(x)
            found.append((1.0 if k else -1.0, marker, J))
        return up, down, found

    def measured(self, t: Array, x: Array) -> tuple[Array, list[Array]]:
        """Return the height; what touches changes along the plane alone, so that it counts as fixed."""
        up, down, ends = self._touching(x)
        height = dot(up, self.second.position(x) + down - self.first.position(x))[:, 0]
        return height, [sign * (up[:, None] @ J)[:, 0] for sign, _, J in ends]

    def _curved(self, x: Array, force: Array, slope: Array) -> Entries:
        """Return the force times the second derivative of the height, by differences."""

        def pushed(moved: Array) -> Array:
            out = np.zeros(moved.shape)
            for (_, marker), row in zip(self._ends, self.measured(np.zeros(1), moved)[1], strict=True):
                out[:, marker.columns] += force[:, None] * row
            return out

        return self._difference(pushed, x)

    def _difference(self, values: Callable[[Array], Array], x: Array) -> Entries:
        """Return the derivative of forces (n_batch, n_x), linear in places, by x in one state: one-sided."""
        columns = self.support
        steps, moved = DIFFERENCE * np.maximum(1.0, np.abs(x[0, columns])), np.repeat(x, len(columns) + 1, 0)
        moved[np.arange(len(columns)), columns] += steps
        found = values(moved)[:, columns]
        return Entries.of_block(columns, columns, ((found[:-1] - found[-1]) / steps[:, None]).T)

    # ------------------------------------------------------------------ friction

    def slip(self, t: Array, x: Array, u: Array) -> Array:
        """Return the velocity of the second body against the first in the plane [m/s], (n_batch, n_dim)."""
        up, _, ends = self._touching(x)
        return self._slipping(u, up, ends)

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
        return self.effort(t, x, u)[:, None] * self._grip(v)

    def _grip(self, v: Array) -> Array:
        """Return the friction over what presses, by slips (n_batch, n_dim)."""
        speed, share = self._gripping(v)
        return np.asarray(-self.coefficient * share / speed * v)

    def _gripping(self, v: Array) -> tuple[Array, Array]:
        """Return the speed, never quite zero, and the part of friction that is there, (n_batch, 1)."""
        speed = np.sqrt(dot(v, v) + (AT_REST * self.velocity) ** 2)
        return speed, np.tanh(speed / self.velocity)

    def _grip_slope(self, v: Array) -> Array:
        """Return the derivative of that by the slip of one state, (n_dim, n_dim)."""
        speed, share = self._gripping(v)
        along, across = (1.0 - share**2) / self.velocity, share / speed
        way = v / speed
        return np.asarray(-self.coefficient * (across * np.eye(v.shape[1]) + (along - across) * way.T @ way))

    def _rubbed(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield the ends that can move, with the friction there."""
        up, _, ends = self._touching(x)
        force = self._against(t, x, u, self._slipping(u, up, ends))
        for sign, marker, J in ends:
            yield marker, sign * (force[:, None] @ J)[:, 0]

    # ------------------------------------------------------------------ all of it

    def on_points(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield the ends that can move, with all forces there."""
        pushes = super().on_points(t, x, u)
        if not self.rubs:
            yield from pushes
            return
        for (marker, force), (_, own) in zip(pushes, self._rubbed(t, x, u), strict=True):
            yield marker, force + own

    def reaction(self, t: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """Return the force [N], (n_batch, n_dim), and moment [N m], (n_batch, n_spin), on the second body."""
        up, down = self._directions(x)
        force = self.effort(t, x, u)[:, None] * up + self.friction(t, x, u)
        return force, lever(down, force)

    def exerted(self, t: Array, x: Array, u: Array) -> dict[str, Array]:
        """Return the whole force."""
        return {self.unit: self.reaction(t, x, u)[0]}

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of all forces by x in one state."""
        pushed = super().tangent(t, x, u)
        if not self.rubs or not self._ends:
            return pushed
        s, w, rows = self._all(t, x, u)
        _, v, relative = self._rubbing(x, u)
        pressed = self._by_place(x, u, rows, *self._slopes(t, s, w))
        rubbed = (self._grip(v) @ relative).T * pressed
        pressing = Entries.of_block(self.support, self.support, rubbed)
        return Entries.joined([pushed, pressing, self._slid(x, u, v, -self._sum(t, s, w))])

    def _slid(self, x: Array, u: Array, v: Array, pressing: Array) -> Entries:
        """Return minus the derivative of the friction by x where what presses stays, by differences.

        Of the slip v, which changes as smoothly as places do: the friction may turn round within a step.
        """
        slope = pressing * self._grip_slope(v)

        def resisted(moved: Array) -> Array:
            up, _, ends = self._touching(moved)
            slip = self._slipping(np.repeat(u, len(moved), axis=0), up, ends)
            force = pressing * self._grip(v) + (slip - v) @ slope
            out = np.zeros(moved.shape)
            for sign, marker, J in ends:
                out[:, marker.columns] -= sign * (force[:, None] @ J)[:, 0]
            return out

        return self._difference(resisted, x)

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of all forces by u in one state."""
        pushed = super().rate_tangent(t, x, u)
        if not self.rubs or not self._ends:
            return pushed
        s, w, rows = self._all(t, x, u)
        up, v, relative = self._rubbing(x, u)
        sliding = relative - up.T @ (up @ relative)
        rubbed = sliding.T @ (self._sum(t, s, w) * self._grip_slope(v)) @ sliding
        pressed = self._slopes(t, s, w)[1] * self._whole(rows)
        rubbed = rubbed + (self._grip(v) @ relative).T * pressed
        return Entries.joined([pushed, Entries.of_block(self.support, self.support, rubbed)])

    def _rubbing(self, x: Array, u: Array) -> tuple[Array, Array, Array]:
        """Return normal, slip, both (1, n_dim), and Jacobian of the slip, (n_dim, n_support), in one state.

        The last is with what is along the normal.
        """
        up, _, ends = self._touching(x)
        return up, self._slipping(u, up, ends), self._whole([sign * J for sign, _, J in ends])

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of what is not the slope of an energy."""
        return np.asarray(super().power(t, x, u) + self._rubbing_power(t, x, u))

    def delivered(self, t: Array, x: Array, u: Array) -> Array:
        """Return what all forces put into both bodies [W]."""
        return np.asarray(super().delivered(t, x, u) + self._rubbing_power(t, x, u))

    def _rubbing_power(self, t: Array, x: Array, u: Array) -> Array:
        v = self.slip(t, x, u)
        return np.asarray(dot(self._against(t, x, u, v), v)[:, 0])
