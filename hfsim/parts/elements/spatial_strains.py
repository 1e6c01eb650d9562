"""Strains of beams with two section vectors in space, as functions of (r', d2, d3, d2', d3').

With d1 = d2 x d3 they are Gamma_1 = d1 . r' / |d1|, Gamma_2 = d2 . r', Gamma_3 = d3 . r' and
kappa_1 = (d3 . d2' - d2 . d3') / 2, kappa_2 = d1 . d3', kappa_3 = - d1 . d2'.  Between nodes whose sections
are turned against one another vectors are shorter than one: if Gamma_1 depended on that length, tension
would turn thin sections to and fro, as their centre line could then grow longer without stretch.
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
    stretch = _product(x, slope) / np.sqrt(_product(x, x))
    twist = 0.5 * (_product(z, bent_y) - _product(y, bent_z))
    shears = _product(y, slope), _product(z, slope)
    return np.stack([stretch, *shears, twist, _product(x, bent_z), -_product(x, bent_y)])


def pulled(v: Array, S: Array) -> Array:
    """Return the forces on the vectors, shape (5, 3, ...), that do the work of section forces (6, ...)."""
    slope, y, z, bent_y, bent_z = v
    x, half = _cross(y, z), 0.5 * S[3]
    square = _product(x, x)
    along, across = S[0] / np.sqrt(square), slope - _product(x, slope) / square * x
    on_x = along * across + S[4] * bent_z - S[5] * bent_y
    return np.stack(
        [
            along * x + S[1] * y + S[2] * z,
            S[1] * slope - half * bent_z + _cross(z, on_x),
            S[2] * slope + half * bent_y + _cross(on_x, y),
            half * z - S[5] * x,
            S[4] * x - half * y,
        ]
    )


def bent_by(V: Array, S: Array) -> Array:
    """Return the derivative of `pulled` by the vectors at constant S (6, ...), shape (..., 15, 15)."""
    slope, y, z, bent_y, bent_z = np.moveaxis(V, -2, 0)
    x, S = cross(y, z), S[..., None]
    length = np.linalg.norm(x, axis=-1, keepdims=True)
    x, along = x / length, S[0] / length
    stretch = np.sum(x * slope, axis=-1, keepdims=True)
    on_x = along * (slope - stretch * x) + S[4] * bent_z - S[5] * bent_y
    S, along, one, Y, Z = S[..., None], along[..., None], np.eye(3), skew(y), skew(z)
    square, both = (x[..., None] * a[..., None, :] for a in (x, slope))
    across = along * (one - square)
    turning = both + both.swapaxes(-1, -2) + stretch[..., None] * (one - 3.0 * square)
    bent = along / length[..., None] * turning
    K = np.zeros((*V.shape[:-2], 5, 3, 5, 3))
    blocks = {
        (0, 1): S[1] * one - across @ Z,
        (0, 2): S[2] * one + across @ Y,
        (1, 1): Z @ bent @ Z,
        (1, 2): -Z @ bent @ Y - skew(on_x),
        (2, 2): Y @ bent @ Y,
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
