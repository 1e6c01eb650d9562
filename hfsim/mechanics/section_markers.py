"""Markers of beams with section vectors in space: two axes are coordinates, the first their product."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array, magnitude
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.rotations import cross, dot, skew
from hfsim.mechanics.crossed import CrossedVector
from hfsim.mechanics.markers import ROUNDING, Marker
from hfsim.mechanics.products import LinearVector
from hfsim.mechanics.spatial_markers import SquareMarker, VectorMarker

HALF = np.sqrt(0.5)
"""Sine and cosine of half a right angle."""


@frozen
class SectionMarker(VectorMarker):
    """A material point of a beam whose coordinates are positions and section vectors d2, d3.

    ``axis_rows`` are those of d2 and d3; d1 = d2 x d3.  At nodes they are of unit length and at right angles,
    between nodes nearly so.

    Attributes
    ----------
    body : ndarray, shape (3, 3)
        From d1, d2, d3 to the marker's own axes, as rows: those of the body frame, carried along.
    level : ndarray, shape (3, 3), optional
        The same from axes of unit length and at right angles next to these, where it differs.
    """

    body: Array
    level: Array | None = None
    n_axes: ClassVar[int] = 3

    def level_in(self, vectors: Array) -> SectionMarker:
        """Return the marker whose axes are those of the ground where its body has nodal vectors (n, 3)."""
        alone, x = replace(self, columns=slice(0, vectors.size)), vectors.reshape(1, -1)
        if magnitude(alone.axes(x)[0] - np.eye(3)) <= ROUNDING:
            return self
        return replace(self, body=np.linalg.inv(alone._triad(x)[0]), level=alone._square(x)[0].T)

    def _triad(self, x: Array) -> Array:
        """Return d1, d2, d3, shape (n_batch, 3, 3)."""
        d = self._combined(x, self.axis_rows)
        return np.concatenate([cross(d[:, :1], d[:, 1:]), d], axis=1)

    def axes(self, x: Array) -> Array:
        """Return its own axes, shape (n_batch, 3, 3)."""
        return np.asarray(self.body @ self._triad(x))

    def frame(self, x: Array) -> Array:
        """Return three axes of unit length and at right angles, as columns, shape (n_batch, 3, 3)."""
        level = self.body if self.level is None else self.level
        return np.asarray((level @ self._square(x)).swapaxes(1, 2))

    def _square(self, x: Array) -> Array:
        """Return axes of unit length and at right angles next to d1, d2, d3, shape (n_batch, 3, 3).

        From each section vector, half of what is missing of a right angle between them.
        """
        d = self._triad(x)
        d = d / np.linalg.norm(d, axis=-1, keepdims=True)
        # the sum and the difference of two unit vectors are at right angles
        between, across = d[:, 1] + d[:, 2], d[:, 1] - d[:, 2]
        between, across = (HALF / np.sqrt(dot(one, one)) * one for one in (between, across))
        return np.stack([d[:, 0], between + across, between - across], axis=1)

    @cached_property
    def square(self) -> Marker:
        """Return itself at a node, whose section vectors are kept square."""
        nodal = all(self._vector_columns(row) is not None for row in self.axis_rows)
        return self if nodal else SquareMarker(self)

    def linear_axis(self, a: Array) -> LinearVector | None:
        """Return combinations of d2 and d3; None of d1."""
        c = np.asarray(a) @ self.body
        return None if abs(c[0]) > ROUNDING else self._linear(c[1:] @ self.axis_rows)

    def crossed_axis(self, a: Array) -> CrossedVector:
        """Return combinations of d2, d3 and their product."""
        c, (second, third) = np.asarray(a) @ self.body, map(self._linear, self.axis_rows)
        return CrossedVector(self._linear(c[1:] @ self.axis_rows), second, third, float(c[0]))

    def _slopes(self, x: Array, a: Array) -> Array:
        """Return the derivatives of a combination of its own axes by d2 and d3, (n_batch, 2, 3, 3)."""
        c, d = np.asarray(a) @ self.body, self._combined(x, self.axis_rows)
        by = skew(d[:, ::-1]) * np.array([-c[0], c[0]])[:, None, None]
        return np.asarray(by + c[1:, None, None] * np.eye(3))

    def _by_vectors(self, blocks: Array) -> Array:
        """Return derivatives by the coordinates from those by d2 and d3, (n_batch, 2, 3, 3)."""
        J = self.axis_rows.T @ blocks.swapaxes(1, 2)
        return np.asarray(J.reshape(len(J), 3, -1))

    def turned_jacobian(self, x: Array, a: Array) -> Array:
        """Return that of `frame`, by how it turns."""
        return Marker.turned_jacobian(self, x, a)

    def axis_jacobian(self, x: Array, a: Array) -> Array:
        """Return the derivative of `axis` by the coordinates, shape (n_batch, 3, n_columns)."""
        return self._by_vectors(self._slopes(x, a))

    def axis_bias(self, x: Array, u: Array, a: Array) -> Array:
        """Return its second time derivative at zero accelerations, shape (n_batch, 3)."""
        rate = self._combined(u, self.axis_rows)
        return np.asarray(2.0 * (np.asarray(a) @ self.body)[0] * cross(rate[:, 0], rate[:, 1]))

    def axis_stiffness(self, x: Array, a: Array, force: Array) -> Entries:
        """Return the second derivative of force . axis, that of c1 d2 x d3."""
        vectors = np.flatnonzero(self._involved)
        y, z = self.axis_rows[:, vectors]
        one = np.kron(np.outer(y, z), -(np.asarray(a) @ self.body)[0] * skew(force))
        return Entries.of_block(self.support, self.support, one + one.T)

    def spin_jacobian(self, x: Array) -> Array:
        """Return the derivative of the turn of `frame`, of any d2 and d3.

        It tilts with the plane of both, and turns about d1 as they do on average.
        """
        d = self._triad(x)
        n, y, z = d[:, :1], d[:, 1:2], d[:, 2:]
        area = np.sqrt(dot(n, n))
        e = n / area
        tilts = np.concatenate([-z, y], axis=1) / area
        turns = 0.5 * np.concatenate([cross(e, y) / dot(y, y), cross(e, z) / dot(z, z)], axis=1)
        return self._by_vectors(tilts[..., None] * e[:, :, None] + e[..., None] * turns[:, :, None])

    def spin_bias(self, x: Array, u: Array) -> Array:
        """Return what of its angular acceleration does not come from those of d2 and d3."""
        d, rate = self._triad(x), self._combined(u, self.axis_rows)
        n, y, z = d[:, 0], d[:, 1], d[:, 2]
        area = np.sqrt(dot(n, n))
        e, changed = n / area, cross(rate[:, 0], z) + cross(y, rate[:, 1])
        growth = dot(e, changed) / area
        swung = changed / area - growth * e

        def tilted(y: Array, z: Array, e: Array) -> Array:
            return np.asarray((y * dot(e, rate[:, 1]) - z * dot(e, rate[:, 0])) / area)

        turn, more = np.zeros_like(area), np.zeros_like(area)
        for one, moved in ((y, rate[:, 0]), (z, rate[:, 1])):
            size, about = dot(one, one), cross(one, moved)
            own = 0.5 * dot(e, about) / size
            turn = turn + own
            more = more + 0.5 * dot(swung, about) / size - 2.0 * own * dot(one, moved) / size
        tilting = tilted(rate[:, 0], rate[:, 1], e) + tilted(y, z, swung) - growth * tilted(y, z, e)
        return np.asarray(tilting + more * e + turn * swung)
