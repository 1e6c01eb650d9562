"""Markers of beams in space with gradient vectors: two of these, of any length and angle, make a frame."""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, on_components
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.maths.rotations import cross
from hfsim.mechanics.markers import ROUNDING, Marker
from hfsim.mechanics.products import LinearVector
from hfsim.mechanics.spatial_markers import SquareMarker, VectorMarker

TANGENTIAL = np.eye(3)
"""From t1, t2, t3 to the marker's axes, as rows, where the vectors are r_x and r_y."""
SECTIONAL = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""The same where they are r_z and r_y."""


class _Gradients(NamedTuple):
    """Axes t1, t2, t3, (n_batch, 3) each; first = length t1, second = along t1 + beside t2, (n_batch, 1)."""

    axes: tuple[Array, Array, Array]
    length: Array
    along: Array
    beside: Array


@frozen
class GradientMarker(VectorMarker):
    """A material point of a fully parameterised beam; ``axis_rows`` are those of two gradient vectors there.

    t1 is along the first of them, t2 in the plane of both, t3 across it.

    Attributes
    ----------
    order : ndarray, shape (3, 3)
        `TANGENTIAL` or `SECTIONAL`.
    own : ndarray, shape (3, 3)
        Axes of the undeformed section in the marker's own frame, as columns.
    """

    order: Array
    own: Array = field(default_factory=lambda: np.eye(3))
    n_axes: ClassVar[int] = 3
    alike: ClassVar[bool] = False

    @property
    def section(self) -> Array:
        """Its own."""
        return self.own

    @cached_property
    def _from_vectors(self) -> Array:
        """From t1, t2, t3 to the marker's axes, as rows."""
        return np.asarray(self.own @ self.order)

    @property
    def oblique(self) -> VectorMarker:
        """The same point with both vectors themselves for axes, and none across them."""
        return VectorMarker(self.columns, self.place_row, self._from_vectors[:, :2] @ self.axis_rows)

    def level_in(self, vectors: Array) -> GradientMarker:
        """Return the marker whose frame is the ground's where its body has nodal vectors (n, 3)."""
        alone = replace(self, columns=slice(0, vectors.size), own=np.eye(3))
        return replace(self, own=alone.frame(vectors.reshape(1, -1))[0])

    def _gradients(self, x: Array) -> _Gradients:
        g = self._combined(x, self.axis_rows)
        length = np.linalg.norm(g[:, 0], axis=-1, keepdims=True)
        t1 = g[:, 0] / length
        along = np.sum(g[:, 1] * t1, axis=-1, keepdims=True)
        t2 = g[:, 1] - along * t1
        beside = np.linalg.norm(t2, axis=-1, keepdims=True)
        t2 = t2 / beside
        return _Gradients((t1, t2, cross(t1, t2)), length, along, beside)

    def axes(self, x: Array) -> Array:
        """Return its axes, of unit length and at right angles, shape (n_batch, 3, 3)."""
        return np.asarray(self._from_vectors @ np.stack(self._gradients(x).axes, axis=1))

    def frame(self, x: Array) -> Array:
        """Return the same as columns, shape (n_batch, 3, 3)."""
        return self.axes(x).swapaxes(1, 2)

    def _slope(self, a: Array) -> Array | None:
        """Return the row of the first vector times its part of a direction along t1; None of any other."""
        c = np.asarray(a) @ self._from_vectors
        return c[0] * self.axis_rows[0] if np.abs(c[1:]).max() <= ROUNDING else None

    def axis(self, x: Array, a: Array) -> Array:
        """Return the first vector itself, which is linear in the coordinates; others of unit length."""
        slope = self._slope(a)
        return self.turned(x, np.asarray(a)) if slope is None else self._combined(x, slope)

    def linear_axis(self, a: Array) -> LinearVector | None:
        """Return the first vector; None of any other."""
        slope = self._slope(a)
        return None if slope is None else self._linear(slope)

    def turned_jacobian(self, x: Array, a: Array) -> Array:
        """Return that of `frame`, by how it turns."""
        return Marker.turned_jacobian(self, x, a)

    def axis_jacobian(self, x: Array, a: Array) -> Array:
        """Return the derivative of `axis` by the coordinates, shape (n_batch or 1, 3, n_columns)."""
        slope = self._slope(a)
        return Marker.axis_jacobian(self, x, a) if slope is None else on_components(slope, 3)[None]

    def axis_bias(self, x: Array, u: Array, a: Array) -> Array:
        """Return its second time derivative at zero accelerations, shape (n_batch, 3)."""
        return np.zeros((len(x), 3)) if self._slope(a) is not None else Marker.axis_bias(self, x, u, a)

    def axis_stiffness(self, x: Array, a: Array, force: Array) -> Entries:
        """Return the second derivative of force . axis in one state: nothing of the first vector."""
        return NOTHING if self._slope(a) is not None else Marker.axis_stiffness(self, x, a, force)

    @cached_property
    def square(self) -> SquareMarker:
        """Return it with axes of unit length alone."""
        return SquareMarker(self)

    def spin_jacobian(self, x: Array) -> Array:
        """Return the derivative of its turn: the first vector turns t1, the second the frame about t1."""
        (t1, t2, t3), length, along, beside = self._gradients(x)
        tilt = (-t2 - along / beside * t1) / length
        by_slope = tilt[:, :, None] * t3[:, None] + (t3 / length)[:, :, None] * t2[:, None]
        by_side = (t1 / beside)[:, :, None] * t3[:, None]
        blocks = np.stack([by_slope, by_side], axis=1)
        J = self.axis_rows.T @ blocks.swapaxes(1, 2)
        return np.asarray(J.reshape(len(x), 3, -1))

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return its angular acceleration where both vectors have none, shape (n_batch, 3)."""
        axes, length, along, beside = self._gradients(x)
        slope, side = np.moveaxis(self._combined(u, self.axis_rows), 1, 0)

        def part(a: Array, k: int) -> Array:
            return np.asarray(np.sum(a * axes[k], axis=-1, keepdims=True))

        growth = part(slope, 0) / length
        w2, w3 = -part(slope, 2) / length, part(slope, 1) / length
        w1 = (part(side, 2) + along * w2) / beside
        a2, a3 = w1 * w3 - 2.0 * growth * w2, -w1 * w2 - 2.0 * growth * w3
        shear = part(side, 0) + beside * w3
        widening = part(side, 1) - along * w3
        turned = w2 * part(side, 0) - w1 * part(side, 1)
        a1 = (turned + shear * w2 + along * a2 - w1 * widening) / beside
        return np.asarray(a1 * axes[0] + a2 * axes[1] + a3 * axes[2])
