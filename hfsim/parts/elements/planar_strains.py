"""Strains of beams with a section vector in the plane, as functions of (r', d, d').

d is the second axis of the section, P d = (d_y, -d_x) its first: Gamma_1 = P d . r' / |d|, Gamma_2 = d . r'
and kappa = - P d . d'.  They are those in space with a third axis across the plane.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.elements.section_strains import SectionStrains

_BACK = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""P, a quarter turn back."""


def strains(v: Array) -> Array:
    """Return Gamma_1, Gamma_2 and kappa, shape (3, ...), of vectors (r', d, d'), shape (3, 2, ...)."""
    (slope_x, slope_y), (x, y), (bent_x, bent_y) = v
    e = np.empty((3, *v.shape[2:]))
    e[0] = (y * slope_x - x * slope_y) / np.sqrt(x * x + y * y)
    e[1] = x * slope_x + y * slope_y
    e[2] = x * bent_y - y * bent_x
    return e


def pulled(v: Array, S: Array) -> Array:
    """Return the forces on the vectors, shape (3, 2, ...), that do the work of section forces (3, ...)."""
    (slope_x, slope_y), (x, y), (bent_x, bent_y) = v
    axial, shear, moment = S
    square = x * x + y * y
    along = axial / np.sqrt(square)
    turning = along * (x * slope_x + y * slope_y) / square
    f = np.empty(v.shape)
    f[0, 0] = along * y + shear * x
    f[0, 1] = shear * y - along * x
    f[1, 0] = shear * slope_x - turning * y + moment * bent_y
    f[1, 1] = shear * slope_y + turning * x - moment * bent_x
    f[2, 0] = -moment * y
    f[2, 1] = moment * x
    return f


def bent_by(V: Array, S: Array) -> Array:
    """Return the derivative of `pulled` by the vectors at constant S (3, ...), shape (..., 6, 6)."""
    (slope, d), S, one = np.moveaxis(V[..., :2, :], -2, 0)[..., None], S[..., None, None], np.eye(2)
    first, square = _BACK @ d, d.swapaxes(-1, -2) @ d
    both, turning = d @ first.swapaxes(-1, -2), first @ first.swapaxes(-1, -2)
    stretch, shear = (a.swapaxes(-1, -2) @ slope / square for a in (first, d))
    along = S[0] / square**1.5
    turned = along * (shear * (both + both.swapaxes(-1, -2)) - stretch * turning)
    K = np.zeros((*V.shape[:-2], 3, 2, 3, 2))
    blocks = {(0, 1): S[1] * one - along * both, (1, 1): turned, (1, 2): S[2] * _BACK}
    for (i, j), block in blocks.items():
        K[..., i, :, j, :] = block
        K[..., j, :, i, :] = block.swapaxes(-1, -2)
    return K.reshape(*V.shape[:-2], 6, 6)


PLANAR = SectionStrains((0, 1, 5), strains, pulled, bent_by)
