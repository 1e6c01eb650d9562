"""The stiffness by quadrature at every call, as eq. (25) and (27) say."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.parts.elements import Element
from hfsim.studies.separation._base import StiffnessForm, StrainTable, times


@dataclass(frozen=True)
class DirectStiffness(StiffnessForm):
    r"""K(p) as eq. (25)/(27) says: every entry by quadrature at every call.

    With :math:`A_r = S_{ii}, S_{ik(i)} + S_{k(i)i}` and the elastic coefficients E_rs of eq. (22), the
    integrand is :math:`\frac12 (p^T A_r p - 1_r) E_{rs} A_s`.  Shape rows are looked
    up; the matrices S_ij, the strains and the entries are computed each time, for all elements together.
    """

    table: StrainTable

    @classmethod
    def of(cls, element: Element, properties: BeamProperties, n_dim: int = 2) -> Self:
        """Return the form of an element in plane or space."""
        return cls(StrainTable.of(element, properties, n_dim))

    def _matrices(self) -> Array:
        """Return A_r at each point, shape (n_strains * n_points, n, n)."""
        return self.table.strains().reshape(-1, *self.table.constant.shape)

    def _weighted(self, squares: Array) -> Array:
        """Return the factor of each A_r in K from p^T A_r p, shape (n_strains * n_points, n_columns)."""
        table = self.table
        strain = 0.5 * (squares - np.repeat(table.unit, len(table.weights))[:, None])
        stress = table.elasticity @ strain.reshape(len(table.unit), -1)
        stress = stress.reshape(len(table.unit), len(table.weights), -1)
        stress *= table.weights[:, None]
        return np.asarray(stress.reshape(squares.shape))

    def _evaluate(self, p: Array) -> tuple[Array, Array]:
        """Return K and A_r p, shape (n_columns, n_strains * n_points, n), for p of shape (n_columns, n)."""
        A, n = self._matrices(), p.shape[-1]
        Ap = (p @ A.reshape(-1, n).T).reshape(*p.shape[:-1], len(A), n)
        K = self._weighted(times(Ap, p).T).T @ A.reshape(len(A), n * n)
        K += self.table.constant.ravel()
        return K.reshape(*p.shape, n), Ap

    def stiffness(self, p: Array) -> Array:
        """Return K, shape (n_columns, n, n)."""
        return self._evaluate(np.ascontiguousarray(p.T))[0]

    def force(self, p: Array) -> Array:
        """Return K p, shape (n, n_columns)."""
        A, n = self._matrices(), len(p)
        Ap = (A.reshape(-1, n) @ p).reshape(len(A), *p.shape)
        K = A.reshape(len(A), n * n).T @ self._weighted(np.einsum("ran,an->rn", Ap, p))
        K += self.table.constant.reshape(-1, 1)
        return np.asarray(np.einsum("abn,bn->an", K.reshape(n, *p.shape), p))

    def force_and_tangent(self, p: Array) -> tuple[Array, Array]:
        """Return force and tangent, which is K plus E_rs (A_r p)(A_s p)^T."""
        table, p = self.table, np.ascontiguousarray(p.T)
        K, Ap = self._evaluate(p)
        stressed = (table.elasticity @ Ap.reshape(*p.shape[:-1], len(table.unit), -1)).reshape(Ap.shape)
        stressed *= np.tile(table.weights, len(table.unit))[:, None]
        return times(K, p).T, K + Ap.swapaxes(-1, -2) @ stressed


@dataclass(frozen=True)
class TabulatedStiffness(DirectStiffness):
    """The same quadrature with the matrices S_ij kept at every point: all that can be, without (39)-(41)."""

    @cached_property
    def _kept(self) -> Array:
        return super()._matrices()

    def _matrices(self) -> Array:
        return self._kept
