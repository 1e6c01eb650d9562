"""Strains of beams with a section vector in the plane, as polynomials of (r', d, d').

d is the second axis of the section, P d = (d_y, -d_x) its first: Gamma_1 = P d . r', Gamma_2 = d . r' and
kappa = - P d . d'.  They are those in space with a third axis that stays across the plane.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.elements.section_strains import SectionStrains

_BACK = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""P, a quarter turn back."""


def _back(a: Array) -> Array:
    """Return P a of vectors whose components are the first axis."""
    return np.stack([a[1], -a[0]])


def _product(a: Array, b: Array) -> Array:
    """Return a . b of the same."""
    return np.asarray(a[0] * b[0] + a[1] * b[1])


def strains(v: Array) -> Array:
    """Return Gamma_1, Gamma_2 and kappa, shape (3, ...), of vectors (r', d, d'), shape (3, 2, ...)."""
    slope, y, bent = v
    x = _back(y)
    return np.stack([_product(x, slope), _product(y, slope), -_product(x, bent)])


def pulled(v: Array, S: Array) -> Array:
    """Return the forces on the vectors, shape (3, 2, ...), that do the work of section forces (3, ...)."""
    slope, y, bent = v
    x = _back(y)
    return np.stack([S[0] * x + S[1] * y, S[1] * slope + _back(S[2] * bent - S[0] * slope), -S[2] * x])


def bent_by(V: Array, S: Array) -> Array:
    """Return the derivative of `pulled` by the vectors at constant S (3, ...), shape (..., 6, 6)."""
    S, one = S[..., None, None], np.eye(2)
    K = np.zeros((*V.shape[:-2], 3, 2, 3, 2))
    for (i, j), block in {(0, 1): S[0] * _BACK + S[1] * one, (1, 2): S[2] * _BACK}.items():
        K[..., i, :, j, :] = block
        K[..., j, :, i, :] = block.swapaxes(-1, -2)
    return K.reshape(*V.shape[:-2], 6, 6)


PLANAR = SectionStrains((0, 1, 5), strains, pulled, bent_by)
