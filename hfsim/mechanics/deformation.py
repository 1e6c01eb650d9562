"""How a slender body is deformed, seen from its body frame: the same words for every model and dimension."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array


class Deformation(NamedTuple):
    """A slender body in its body frame, in a batch of states, at places along its axis.

    Attributes
    ----------
    places, weights : ndarray, shape (n_points,)
        Distances from the root and weights of integrals over the length [m].
    axial : ndarray, shape (n_batch, n_points)
        Stretch u1' [-].
    slope, curvature : ndarray, shape (n_batch, n_points, n_dim - 1)
        Derivatives v' [-] and v'' [1/m] of the deflections.
    tip : ndarray, shape (n_batch, n_dim - 1)
        Deflections of the tip [m].
    spin : ndarray, shape (n_batch, n_spin)
        Angular velocity of the body frame [rad/s].
    sections : ndarray, shape (n_batch, n_points, n_dim + n_spin), or None
        Displacements of the line [m] and small turns of sections [rad] in the body frame, where a beam has
        sections and these are all that is known of it.
    twist : ndarray, shape (n_batch, n_points), or None
        By how much sections turn about the line [rad], where they can.
    """

    places: Array
    weights: Array
    axial: Array
    slope: Array
    curvature: Array
    tip: Array
    spin: Array
    sections: Array | None = None
    twist: Array | None = None

    @property
    def steepness(self) -> Array:
        """Size of the slope [-], shape (n_batch, n_points)."""
        return size(self.slope)

    @property
    def shortening(self) -> Array:
        """1/2 int v'.v' dx [m], shape (n_batch,)."""
        return np.asarray(0.5 * self.steepness**2 @ self.weights)

    @property
    def elongation(self) -> Array:
        """Integral of the stretch [m], shape (n_batch,)."""
        return np.asarray(self.axial @ self.weights)

    def bent(self, factor: float) -> Deformation:
        """Return the same with all deflections multiplied."""
        slope, curvature, tip = (factor * a for a in (self.slope, self.curvature, self.tip))
        return self._replace(slope=slope, curvature=curvature, tip=tip)


def size(vectors: Array) -> Array:
    """Return the lengths of vectors along the last axis; of single numbers, their sizes."""
    if vectors.shape[-1] == 1:
        return np.abs(vectors[..., 0])
    return np.asarray(np.linalg.norm(vectors, axis=-1))
