"""Strains of beams with two section vectors in space, as polynomials of (r', d2, d3, d2', d3').

With d1 = d2 x d3 they are Gamma_1 = d1 . r' + (1 - d1 . d1) / 2, Gamma_2 = d2 . r', Gamma_3 = d3 . r' and
kappa_1 = (d3 . d2' - d2 . d3') / 2, kappa_2 = d1 . d3', kappa_3 = - d1 . d2'.  Between nodes whose sections
are turned against one another vectors are shorter than one: with d1 . r' alone, which is the same for unit
vectors, tension would turn thin sections so, as their centre line could then grow longer without stretch.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import cross, skew
from hfsim.parts.elements.section_strains import SectionStrains


def _product(a: Array, b: Array) -> Array:
    """Return a . b of vectors whose components are the first axis."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Array, b: Array) -> Array:
    """Return a x b of the same."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def strains(v: Array) -> Array:
    """Return Gamma and kappa, shape (6, ...), of vectors (r', d2, d3, d2', d3'), shape (5, 3, ...)."""
    slope, y, z, bent_y, bent_z = v
    x = _cross(y, z)
    stretch = _product(x, slope - 0.5 * x) + 0.5
    twist = 0.5 * (_product(z, bent_y) - _product(y, bent_z))
    shears = _product(y, slope), _product(z, slope)
    return np.stack([stretch, *shears, twist, _product(x, bent_z), -_product(x, bent_y)])


def pulled(v: Array, S: Array) -> Array:
    """Return the forces on the vectors, shape (5, 3, ...), that do the work of section forces (6, ...)."""
    slope, y, z, bent_y, bent_z = v
    x, half = _cross(y, z), 0.5 * S[3]
    on_x = S[0] * (slope - x) + S[4] * bent_z - S[5] * bent_y
    return np.stack(
        [
            S[0] * x + S[1] * y + S[2] * z,
            S[1] * slope - half * bent_z + _cross(z, on_x),
            S[2] * slope + half * bent_y + _cross(on_x, y),
            half * z - S[5] * x,
            S[4] * x - half * y,
        ]
    )


def bent_by(V: Array, S: Array) -> Array:
    """Return the derivative of `pulled` by the vectors at constant S (6, ...), shape (..., 15, 15)."""
    slope, y, z, bent_y, bent_z = np.moveaxis(V, -2, 0)
    S = S[..., None]
    on_x = S[0] * (slope - cross(y, z)) + S[4] * bent_z - S[5] * bent_y
    S, one, Y, Z = S[..., None], np.eye(3), skew(y), skew(z)
    K = np.zeros((*V.shape[:-2], 5, 3, 5, 3))
    blocks = {
        (0, 1): S[1] * one - S[0] * Z,
        (0, 2): S[2] * one + S[0] * Y,
        (1, 1): S[0] * (Z @ Z),
        (1, 2): -S[0] * (Z @ Y) - skew(on_x),
        (2, 2): S[0] * (Y @ Y),
        (1, 3): -S[5] * Z,
        (1, 4): S[4] * Z - 0.5 * S[3] * one,
        (2, 3): S[5] * Y + 0.5 * S[3] * one,
        (2, 4): -S[4] * Y,
    }
    for (i, j), block in blocks.items():
        K[..., i, :, j, :] = block
        K[..., j, :, i, :] = block.swapaxes(-1, -2)
    return K.reshape(*V.shape[:-2], 15, 15)


SPATIAL = SectionStrains((0, 1, 2, 3, 4, 5), strains, pulled, bent_by)
