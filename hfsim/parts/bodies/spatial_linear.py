"""Beams of the model linear in space."""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from typing import Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import FIRST, cross, skew
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.spatial_markers import VectorMarker
from hfsim.parts.bodies.linear import LinearBeam, LinearElasticForce, StrainedLinearForce
from hfsim.parts.bodies.spatial_nodal import SpatialNodalBeam
from hfsim.parts.elements.forces import ROLL


@frozen
class SpatialLinearElasticForce(LinearElasticForce):
    """The force of a cable: axial and in two transverse directions, alike in both.

    The frame at the root has no roll of its own.  Stiffness does not depend on it, but rates in the frame
    do, and the damping of a line must vanish in its roll: of all rolls, that counts in which least is lost.

    Attributes
    ----------
    beside : tuple of ndarray, optional
        How vectors change with a roll, and their rates without one, in one state, (1, n) each: the share of
        the roll is linear in the changes of both from there.
    """

    beside: tuple[Array, Array] | None = field(default=None, kw_only=True)

    @cached_property
    def _root(self) -> VectorMarker:
        vectors = np.eye(len(self.positions))
        return VectorMarker(self.columns, vectors[0], vectors[1:2])

    def _relative(self, x: Array) -> tuple[Array, Array]:
        """Return the nodal vectors in the frame, (n_batch, n_vectors, 3), and its axes, (n_batch, 3, 3)."""
        vectors, frame = self._nodes(x), self._root.frame(x)
        return (vectors - self.positions[:, None] * vectors[:, :1]) @ frame, frame

    def _deformation(self, x: Array) -> tuple[Array, Array, Array]:
        """Return p - p0 flattened, (n_batch, n_vectors * n_dim), and `_relative`."""
        p, frame = self._relative(x)
        return (p - self.undeformed).reshape(len(x), -1), p, frame

    def near(self, x: Array, u: Array) -> Self:
        """Return it with a share of roll that is linear: of a line nearly straight it changes at once."""
        return replace(self, beside=self._rolling(x, u)) if self.uses_rates else self

    def rates(self, x: Array, u: Array) -> Array:
        """Return p', flattened likewise."""
        roll, rates = self._rolling(x, u)
        return np.asarray(rates - self._share(roll, rates)[:, None] * roll) if self.uses_rates else rates

    def _rolling(self, x: Array, u: Array) -> tuple[Array, Array]:
        """Return how p changes with a roll of the frame, and p' in a frame without one, both flattened."""
        p, frame = self._relative(x)
        vectors = self._nodes(u)
        rates = (vectors - self.positions[:, None] * vectors[:, :1]) @ frame
        spin = np.zeros((len(x), 3))
        spin[:, 1:] = np.stack([-rates[:, 1, 2], rates[:, 1, 1]], axis=-1) / p[:, 1, :1]
        return cross(FIRST, p).reshape(len(x), -1), (rates + p @ skew(spin)).reshape(len(x), -1)

    def _share(self, roll: Array, rates: Array) -> Array:
        """Return the roll in which least is lost [rad/s], negative, (n_batch,)."""
        at_roll, at_rates = (roll, rates) if self.beside is None else self.beside
        lost = at_roll @ self.damping
        size = np.sum(lost * at_roll, axis=-1) + self._least_roll
        share = np.sum(lost * at_rates, axis=-1) / size
        if self.beside is None:
            return np.asarray(share)
        changed, faster = roll - at_roll, rates - at_rates
        change = (changed @ self.damping) * at_rates + lost * (faster - 2.0 * share[:, None] * changed)
        return np.asarray(share + np.sum(change, axis=-1) / size)

    def in_strains(self) -> ForcePart:
        """Return it with strains along the first axis alone: others change with the roll of the frame."""
        along = np.zeros_like(self.stiffness)
        along[::3, ::3] = self.stiffness[::3, ::3]
        return StrainedLinearForce.of(self, along)

    @property
    def _least_roll(self) -> float:
        slopes = self.damping.diagonal().reshape(-1, 3)[:, 1:][self.positions == 0.0]
        return ROLL**2 * float(slopes.max())

    def _onto_nodes(self, local: Array, p: Array, frame: Array) -> Array:
        force = local.reshape(p.shape).copy()
        # what the frame coordinates do not feel is balanced at the root vectors
        force[:, 0] = 0.0
        force[:, 1, 1:] = 0.0
        moment = np.sum(cross(p, force), axis=1)
        force[:, 1, 1] = -moment[:, 2] / p[:, 1, 0]
        force[:, 1, 2] = moment[:, 1] / p[:, 1, 0]
        force[:, 0] = -np.einsum("bvi,v->bi", force, self.positions)
        return np.asarray((force @ frame.swapaxes(1, 2)).reshape(len(local), -1))


@frozen
class SpatialLinearBeam(LinearBeam, SpatialNodalBeam):
    """A cable whose elastic force is linearised about the undeformed state in the body frame."""

    _kind = SpatialLinearElasticForce

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of the body frame: those of the undeformed sections."""
        frame = self.marker(self.origin).frame(x)
        return np.repeat(frame[:, None], len(places), axis=1)
