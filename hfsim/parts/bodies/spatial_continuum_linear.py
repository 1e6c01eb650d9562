"""Fully parameterised beams in space of the model linear."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import cross
from hfsim.mechanics.gradient_markers import TANGENTIAL, GradientMarker
from hfsim.parts.bodies.linear import LinearBeam, LinearElasticForce
from hfsim.parts.bodies.spatial_continuum import SpatialContinuumBeam


@frozen
class LinearContinuumForce(LinearElasticForce):
    """A force with r_x and r_y of the root for body frame, which may turn by any amount."""

    @cached_property
    def _root(self) -> GradientMarker:
        own = np.eye(len(self.positions))
        root = GradientMarker(self.columns, own[0], own[1:3], TANGENTIAL)
        return root.level_in(self.undeformed)

    def _from_root(self, vectors: Array) -> Array:
        return np.asarray(vectors - self.positions[:, None] * vectors[:, :1])

    def _deformation(self, x: Array) -> tuple[Array, Array, Array]:
        """Return p - p0 flattened, (n_batch, n_vectors * n_dim), arms from the root, and x."""
        arms = self._from_root(self._nodes(x))
        return (arms @ self._root.frame(x) - self.undeformed).reshape(len(x), -1), arms, x

    def rates(self, x: Array, u: Array) -> Array:
        """Return p', flattened likewise."""
        turning = cross(self._root.spin(x, u)[:, None], self._from_root(self._nodes(x)))
        local = (self._from_root(self._nodes(u)) - turning) @ self._root.frame(x)
        return np.asarray(local.reshape(len(x), -1))

    def _onto_nodes(self, local: Array, arms: Array, x: Array) -> Array:
        """Return it with what the frame feels of it on the vectors that it turns with."""
        force = local.reshape(arms.shape) @ self._root.frame(x).swapaxes(1, 2)
        moment = cross(arms, force).sum(axis=1)
        force[:, 0] -= np.einsum("bvi,v->bi", force, self.positions)
        on_frame = moment[:, None] @ self._root.spin_jacobian(x)
        return np.asarray(force.reshape(len(x), -1) - on_frame[:, 0])


@frozen
class LinearContinuumBeam(LinearBeam, SpatialContinuumBeam):
    """A fully parameterised beam whose elastic force is linearised about the undeformed state."""

    _kind = LinearContinuumForce

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of undeformed sections, carried along by the body frame."""
        frame = self.marker(self.origin).frame(x)
        return np.asarray(frame[:, None] @ self._undeformed_axes(places))
