"""Axes of the sections of beams, and vectors in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import cross, normal, skew

if TYPE_CHECKING:
    from hfsim.parts.bodies.section_mesh import SectionMesh


def in_axes(axes: Array, force: Array, moment: Array) -> Array:
    """Return force and moment (n_batch, n_places, 3) in axes (..., 3, 3), columns, side by side."""
    both = (vectors[..., None, :] @ axes for vectors in (force, moment))
    return np.concatenate(list(both), axis=-1)[..., 0, :]


def in_the_plane(slopes: Array) -> Array:
    """Return tangent, normal and the axis across the plane, as columns, of slopes (n_batch, n_places, 2)."""
    axes = np.zeros((*slopes.shape[:-1], 3, 3))
    axes[..., :2, 0] = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    axes[..., :2, 1] = normal(axes[..., :2, 0])
    axes[..., 2, 2] = 1.0
    return axes


def along_the_line(frame: Array, slopes: Array) -> Array:
    """Return the axes of the root carried along a line without turning about it, as columns.

    From one place to the next they turn by the smallest rotation of the tangent; so a line that bears no
    torsion carries its sections.

    Parameters
    ----------
    frame : ndarray, shape (n_batch, 3, 3)
        Of the root, first axis along the line.
    slopes : ndarray, shape (n_batch, n_places, 3)
        r' from the root on, at places that are close to one another.

    Returns
    -------
    ndarray, shape (n_batch, n_places, 3, 3)
    """
    tangents = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    before = np.concatenate([frame[:, None, :, 0], tangents[:, :-1]], axis=1)
    about = skew(cross(before, tangents))
    cosine = np.sum(before * tangents, axis=-1)[..., None, None]
    turns = np.eye(3) + about + about @ about / (1.0 + cosine)
    axes = np.empty(turns.shape)
    for k in range(turns.shape[1]):
        frame = axes[:, k] = turns[:, k] @ frame
    return axes


def square_axes(mesh: SectionMesh, vectors: Array, places: Array) -> Array:
    """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns; they are square."""
    sections = mesh.shape(places)[1].swapaxes(0, 1)
    if mesh.n_dim == 2:
        return in_the_plane(-normal(sections[0] @ vectors))
    y, z = (rows @ vectors for rows in sections)
    x = cross(y, z)
    x, between = _unit(x), _unit(_unit(y) + _unit(z))
    across = cross(x, between)
    return np.asarray(np.stack([x, (between - across) / 2**0.5, (between + across) / 2**0.5], axis=-1))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
