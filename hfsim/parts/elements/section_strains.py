"""Strains of beams with section vectors as functions of vectors: what a space, and what sections say."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen


class SectionStrains(NamedTuple):
    """Strains of a section, and their derivatives by the vectors (r', d.., d'..) at a place of the beam.

    Attributes
    ----------
    which : tuple of int
        Which of stretch, shears along y and z, twist, curvatures about y and z there are.
    of : callable
        From vectors (n_vectors, n_dim, ...) to the strains, shape (n_strains, ...).
    pulled : callable
        From vectors and section forces (n_strains, ...) to the forces on the vectors that do their work.
    bent_by : callable
        The derivative of that by the vectors, of vectors (..., n_vectors, n_dim): (..., m, m), m all numbers.
    """

    which: tuple[int, ...]
    of: Callable[[Array], Array]
    pulled: Callable[[Array, Array], Array]
    bent_by: Callable[[Array, Array], Array]


@frozen
class PointStrains:
    """Strains at points of beams that sections resist one by one: sums of those of the space.

    With the stiffness C = T^T D T, T upper triangular with ones on its diagonal, the energy
    1/2 e^T C e is 1/2 sum D_k (T e)_k^2: the strains here are T e, and only the first has the stretch.

    Attributes
    ----------
    space : SectionStrains
        Those of its space.
    mixing : ndarray, shape (n_strains, n_strains, n_points), optional
        T at each point; without it sections resist the strains of the space singly.
    """

    space: SectionStrains
    mixing: Array | None = None

    @property
    def count(self) -> int:
        """Number of strains at a point."""
        return len(self.space.which)

    def joined(self, other: PointStrains) -> PointStrains:
        """Return those at these points followed by the other's, both with T or without."""
        if self.mixing is None or other.mixing is None:
            return self
        return PointStrains(self.space, np.concatenate([self.mixing, other.mixing], axis=2))

    def of(self, V: Array) -> Array:
        """Return the strains (n_strains, ..., n_points) of vectors (..., n_points, n_vectors, n_dim)."""
        return self.mixed(self.space.of(np.moveaxis(V, (-2, -1), (0, 1))))

    def mixed(self, e: Array) -> Array:
        """Return T e of strains of the space, (n_strains, ..., n_points) both."""
        return e if self.mixing is None else np.asarray(np.sum(self._spread(e) * e, axis=1))

    def unmixed(self, S: Array) -> Array:
        """Return the section forces T^T S, (n_strains, ..., n_points), of those on these strains."""
        return S if self.mixing is None else np.asarray(np.sum(self._spread(S) * S[:, None], axis=0))

    def slopes(self, V: Array) -> Array:
        """Return their derivative by all m numbers of the vectors, shape (..., n_points, n_strains, m)."""
        v = np.moveaxis(V, (-2, -1), (0, 1))
        forces = (np.moveaxis(self.space.pulled(v, unit), (0, 1), (-2, -1)) for unit in self.units(V))
        slopes = np.stack([one.reshape(*V.shape[:-2], -1) for one in forces], axis=-2)
        return slopes if self.mixing is None else np.asarray(np.moveaxis(self.mixing, 2, 0) @ slopes)

    def bent_by(self, V: Array, S: Array) -> Array:
        """Return what forces S on the strains give the vectors, by these: (..., n_points, m, m)."""
        return self.space.bent_by(V, self.unmixed(S))

    def units(self, V: Array) -> Array:
        """Return each section force by itself, for a batch of vectors."""
        return np.eye(self.count).reshape(self.count, self.count, *(1,) * (V.ndim - 2))

    def _spread(self, e: Array) -> Array:
        assert self.mixing is not None
        return self.mixing.reshape(*self.mixing.shape[:2], *(1,) * (e.ndim - 2), -1)
