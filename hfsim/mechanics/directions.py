"""What joints in space hold of directions, and the equations of that: products of axes of two bodies.

An axis is given in the frame of the point it belongs to.  A line without sections has its tangent for its
only axis: what would need another one is not held.
"""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.differences import FINE, fine_derivative
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import across, cross, dot, lever, smallest_rotation
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.products import Product

Direction: TypeAlias = tuple[float, ...]
TANGENT = (1.0, 0.0, 0.0)
"""The one axis of a line."""
THIRD = (0.0, 0.0, 1.0)
"""Axis of a joint that states none."""
ALONG = 1e-9
"""Part of a unit vector that counts as none."""
_OBLIQUE = ((0, 2), (1, 2), (0, 1))
"""Axes at right angles, the second of a section whose vectors are oblique: the first is never of these."""


class Parallel(NamedTuple):
    """A joint keeps an axis of A and one of B parallel.

    Attributes
    ----------
    first, second : tuple of float
        Unit vectors in A's and in B's frame.
    """

    first: Direction
    second: Direction

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return two equations; on a line one or none where its axis is not the tangent."""
        tangents = along(self.first, TANGENT), along(self.second, TANGENT)
        on_lines = first.n_axes == 1, second.n_axes == 1
        if all(tangents) and all(on_lines):
            return (Tangential(first, second),)
        if on_lines[0] and not tangents[0]:
            sides = [(side, self.second) for side in _sides(self.first)]
        elif on_lines[1] and not tangents[1]:
            sides = [(self.first, side) for side in _sides(self.second)]
        elif _flat(second, self.second):
            second, sides = second.oblique, [(self.first, _section(second, k)) for k in (1, 2)]
        elif _flat(first, self.first):
            first, sides = first.oblique, [(_section(first, k), self.second) for k in (1, 2)]
        elif on_lines[0] or _upright(first, self.first) or _unlike_vectors(second, self.second):
            sides = [(self.first, side) for side in across(self.second)]
        else:
            sides = [(side, self.second) for side in across(self.first)]
        return tuple(Perpendicular(first, second, *pair) for pair in sides if _known(first, second, *pair))

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether the axis is along or across the tangent of each line."""
        return _straight(self, first, second)

    @property
    def senses(self) -> tuple[tuple[Direction, Direction], ...]:
        """The axes, which are to point the same way."""
        return ((self.first, self.second),)


class Square(NamedTuple):
    """A joint keeps an axis of A and one of B at right angles.

    Attributes
    ----------
    first, second : tuple of float
        Unit vectors in A's and in B's frame.
    """

    first: Direction
    second: Direction

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return one equation; none on a line whose axis is not the tangent."""
        known = _known(first, second, self.first, self.second)
        return (Perpendicular(first, second, self.first, self.second),) if known else ()

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether the axes are along or across the tangent of each line."""
        return _straight(self, first, second)


class Facing(NamedTuple):
    """A joint keeps B's frame turned against A's by a rotation.

    Attributes
    ----------
    turn : tuple of tuple of float
        Rows of the matrix that takes vectors in B's frame to A's.
    """

    turn: tuple[Direction, ...]

    @classmethod
    def of(cls, facing: Array) -> Facing:
        """Return it for a matrix (3, 3)."""
        return cls(tuple(direction(row) for row in facing))

    def between(self, first: Marker, second: Marker) -> tuple[Constraint, ...]:
        """Return three equations; two on a line."""
        R, own = np.array(self.turn), np.eye(3)
        if second.n_axes == 1:
            return Parallel(direction(R @ TANGENT), TANGENT).between(first, second)
        if first.n_axes == 1:
            return Parallel(TANGENT, direction(R.T @ TANGENT)).between(first, second)
        if _oblique(second):
            axes = second.section.T
            pairs = [(direction(R @ axes[j]), direction(axes[k])) for j, k in _OBLIQUE]
            return tuple(Perpendicular(first, second.oblique, *pair) for pair in pairs)
        if _oblique(first):
            axes = first.section.T
            pairs = [(direction(axes[k]), direction(R.T @ axes[j])) for j, k in _OBLIQUE]
            return tuple(Perpendicular(first.oblique, second, *pair) for pair in pairs)
        # the last two axes of B, or of A: where one axis of a body is no vector of the state, it is the first
        units = [(own[j], own[k]) for j, k in ((0, 1), (0, 2), (1, 2))]
        of_b = tuple(Perpendicular(first, second, direction(R @ a), direction(b)) for a, b in units)
        of_a = tuple(Perpendicular(first, second, direction(b), direction(R.T @ a)) for a, b in units)
        return max(of_b, of_a, key=lambda rows: sum(len(row.products) for row in rows))

    def fits(self, first: bool, second: bool) -> bool:
        """Tell whether tangents of two lines are along or across each other."""
        own = direction(np.array(self.turn) @ TANGENT)
        return not (first and second) or along(own, TANGENT) or abs(own[0]) < ALONG

    @property
    def senses(self) -> tuple[tuple[Direction, Direction], ...]:
        """All three axes, which are to point the same way."""
        R, own = np.array(self.turn), np.eye(3)
        return tuple((direction(R @ axis), direction(axis)) for axis in own)


def shared_axis(axis: Direction | None, facing: Array) -> Parallel:
    """Return what holds an axis, given in A's frame, in both bodies; `facing` goes from B's frame to A's."""
    own = unit(axis or THIRD)
    return Parallel(own, direction(facing.T @ own))


def direction(a: Array) -> Direction:
    """Return a vector as plain numbers."""
    return tuple(map(float, a))


def unit(axis: Direction) -> Direction:
    """Return a vector of length one along another."""
    return direction(np.asarray(axis) / np.linalg.norm(axis))


def along(a: Direction, b: Direction) -> bool:
    """Tell whether two unit vectors are parallel."""
    return bool(np.linalg.norm(cross(np.asarray(a), np.asarray(b))) < ALONG)


def _straight(held: Parallel | Square, first: bool, second: bool) -> bool:
    """Tell whether the axes of those ends that are on lines are along or across the tangent."""
    axes = [axis for axis, on_line in ((held.first, first), (held.second, second)) if on_line]
    return all(along(axis, TANGENT) or abs(axis[0]) < ALONG for axis in axes)


def _sides(axis: Direction) -> tuple[Direction, ...]:
    """Return two directions across an axis, of which only one has a part along the tangent of a line."""
    across_tangent = cross(np.asarray(axis), np.asarray(TANGENT))
    last = unit(direction(across_tangent))
    return direction(cross(np.asarray(last), np.asarray(axis))), last


def _oblique(marker: Marker) -> bool:
    """Tell whether the axes of a point's section are not vectors of the state, but lie in their plane."""
    return marker.oblique is not marker


def _section(marker: Marker, k: int) -> Direction:
    """Return one of the axes of a point's section, in the point's frame."""
    return direction(marker.section[:, k])


def _flat(marker: Marker, axis: Direction) -> bool:
    """Tell whether an axis of such a point is across its section: at right angles to both vectors."""
    return _oblique(marker) and along(axis, _section(marker, 0))


def _upright(marker: Marker, axis: Direction) -> bool:
    """Tell whether an axis of such a point is a vector of the state."""
    return _oblique(marker) and along(axis, _section(marker, 2))


def _unlike_vectors(marker: Marker, axis: Direction) -> bool:
    """Tell whether an axis of a section, or of a flat body, is no vector of the state."""
    if _oblique(marker):
        return not along(axis, _section(marker, 2))
    return marker.nodal and marker.n_axes > 1 and marker.linear_axis(np.array(axis)) is None


def _known(first: Marker, second: Marker, a: Direction, b: Direction) -> bool:
    """Tell whether both points have the axes a and b."""
    pairs = ((first, a), (second, b))
    return all(marker.n_axes > 1 or along(one, TANGENT) for marker, one in pairs)


class OfAxes(Constraint):
    """A gap that depends on axes only."""

    unit: ClassVar[str] = "rad"
    why_kept: ClassVar[str] = "its axes turn with the bodies"


@frozen
class Perpendicular(OfAxes):
    """Axes of two bodies are at right angles: their product is zero."""

    axes: Direction
    others: Direction

    @cached_property
    def products(self) -> tuple[Product, ...]:
        """The product itself, where both axes are linear in the coordinates."""
        a, b = self.first.linear_axis(np.array(self.axes)), self.second.linear_axis(np.array(self.others))
        return () if a is None or b is None else (Product(a, b, constant=self.offset),)

    @property
    def crossed(self) -> tuple[Product, ...]:
        """The product itself, where an axis is across a section."""
        a, b = self.first.crossed_axis(np.array(self.axes)), self.second.crossed_axis(np.array(self.others))
        return () if self.products or a is None or b is None else (Product(a, b, constant=self.offset),)

    @cached_property
    def constant(self) -> bool:
        """Whether one of the axes is fixed to the ground, the other linear in the coordinates."""
        return bool(self.products) and any(marker.grounded for marker in self.ends) and not self.driven

    @property
    def still(self) -> tuple[bool, bool]:
        """Whether the Jacobian never changes."""
        return self.constant, self.constant

    def _both(self, x: Array) -> tuple[Array, Array]:
        return self.first.axis(x, np.array(self.axes)), self.second.axis(x, np.array(self.others))

    def _jacobians(self, x: Array) -> tuple[Array, Array]:
        a = self.first.axis_jacobian(x, np.array(self.axes))
        return a, self.second.axis_jacobian(x, np.array(self.others))

    def gap(self, x: Array) -> Array:
        """Return the product of both axes."""
        return dot(*self._both(x))

    def jacobian(self, end: int, x: Array) -> Array:
        """Return the other axis times the derivative of one."""
        ends = (self.first, np.array(self.axes)), (self.second, np.array(self.others))
        (marker, own), (other, axis) = ends[end], ends[1 - end]
        return np.asarray(other.axis(x, axis)[:, None] @ marker.axis_jacobian(x, own))

    def bias(self, x: Array, u: Array) -> Array:
        """Return the terms of the product's second derivative without accelerations."""
        (a, b), rates = self._both(x), self._rates(x, u)
        parts = 2.0 * rates[0] * rates[1]
        parts += self.first.axis_bias(x, u, np.array(self.axes)) * b
        parts += self.second.axis_bias(x, u, np.array(self.others)) * a
        return np.asarray(np.sum(parts, axis=-1, keepdims=True))

    def _rates(self, x: Array, u: Array) -> tuple[Array, Array]:
        pairs = zip(self.ends, self._jacobians(x), strict=True)
        a, b = ((J @ u[:, marker.columns, None])[..., 0] for marker, J in pairs)
        return a, b

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return the multiplier times both derivatives, and times each axis and what bends the other."""
        (Ja, Jb), (first, second) = self._jacobians(x), self.ends
        rows, columns = first.support, second.support
        Ja, Jb = first.of_support(Ja), second.of_support(Jb)
        block = multipliers[0, 0] * (Ja.T @ Jb)
        parts = [Entries.of_block(rows, columns, block), Entries.of_block(columns, rows, block.T)]
        a, b = (multipliers[0, 0] * axis[0] for axis in self._both(x))
        parts.append(first.axis_stiffness(x, np.array(self.axes), b))
        parts.append(second.axis_stiffness(x, np.array(self.others), a))
        return Entries.joined(parts)

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return a moment across both axes."""
        a, b = self._both(x)
        return np.zeros((len(x), 3)), multipliers * lever(a, b)


@frozen
class Tangential(OfAxes):
    """The tangents of two lines have one direction: that of the second has no parts across that of the first.

    Across are two axes f of a frame on the first tangent e.  Their roll about it changes gaps by parts of the
    gaps themselves: Jacobian and bias hold where the gaps are zero, for f' = - e (f . e').
    """

    rows: ClassVar[int] = 2
    """One for each direction across."""

    def _tangents(self, x: Array) -> tuple[Array, Array]:
        return self.first.axis(x, np.array(TANGENT)), self.second.axis(x, np.array(TANGENT))

    def _frame(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the length of the first tangent (n_batch, 1), its direction, both axes across it as rows."""
        size = np.linalg.norm(t, axis=-1, keepdims=True)
        return size, t / size, smallest_rotation(np.array(TANGENT), t / size)[:, :, 1:].swapaxes(1, 2)

    def gap(self, x: Array) -> Array:
        """Return the products of the second tangent with the axes across the first."""
        first, second = self._tangents(x)
        return np.asarray((self._frame(first)[2] @ second[..., None])[..., 0])

    def jacobian(self, end: int, x: Array) -> Array:
        """Return f for the second tangent, and - f times the ratio of the lengths for the first."""
        by_tangent = self._by_tangents(*self._tangents(x))[end]
        return np.asarray(by_tangent @ self.ends[end].axis_jacobian(x, np.array(TANGENT)))

    def _by_tangents(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Return both factors, (n_batch, 2, 3)."""
        size, e, across_it = self._frame(first)
        ratio = np.sum(e * second, axis=-1, keepdims=True) / size
        return -ratio[..., None] * across_it, across_it

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return what bends the tangents, and how they change the factors, by differences of tangents."""

        def pull(moved: Array) -> Array:
            factors = np.concatenate(self._by_tangents(moved[:, :3], moved[:, 3:]), axis=2)
            return np.asarray((multipliers @ factors)[:, 0])

        at, own = np.concatenate(self._tangents(x), axis=1), np.array(TANGENT)
        rows = [marker.of_support(marker.axis_jacobian(x, own)) for marker in self.ends]
        slopes = fine_derivative(pull, at[0], np.arange(6), np.full(6, FINE)).reshape(2, 3, 2, 3)
        pulls = zip(self.ends, np.split(pull(at)[0], 2), strict=True)
        parts = [marker.axis_stiffness(x, own, force) for marker, force in pulls]
        for i, first in enumerate(self.ends):
            for j, second in enumerate(self.ends):
                block = rows[i].T @ slopes[i, :, j] @ rows[j]
                parts.append(Entries.of_block(first.support, second.support, block))
        return Entries.joined(parts)

    def bias(self, x: Array, u: Array) -> Array:
        """Return 2 (f . e') (r l' / l - r') with the lengths l and r of both tangents."""
        (tangent, other), own = self._tangents(x), np.array(TANGENT)
        size, e, across_it = self._frame(tangent)
        first, second = (
            (marker.axis_jacobian(x, own) @ u[:, marker.columns, None])[..., 0] for marker in self.ends
        )
        growth = np.sum(e * other, axis=-1) * np.sum(e * first, axis=-1) / size[:, 0] - np.sum(
            e * second, axis=-1
        )
        turning = (across_it @ (first / size)[..., None])[..., 0]
        return np.asarray(2.0 * turning * growth[:, None])

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return a moment across the tangents."""
        first, second = self._tangents(x)
        force = -(multipliers[:, None] @ self._frame(first)[2])[:, 0]
        return np.zeros((len(x), 3)), lever(second, force)
