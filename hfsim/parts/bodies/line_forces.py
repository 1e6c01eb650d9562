"""Internal forces of beams that are centre lines, from the derivatives of an element's energy.

An element's force F is the polynomial that does their work on its chord and interior vectors, its moment at
the first node that of the gradients there; along the line M' = - r' x F.  Where nothing acts between nodes
these balance what acts at the ends, whatever the measures of strain and curvature.  EA times the strain at a
point, and the third derivative, do not: the axial strain of a slender element oscillates about its mean.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import cross, normal, skew
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.bodies.blueprint import Blueprint
from hfsim.parts.elements.polynomial import difference_rows


def line_forces(beam: Blueprint, V: Array, dU: Array, places: Array) -> tuple[Array, Array]:
    """Return force and moment at places along a beam.

    Parameters
    ----------
    beam : Blueprint
    V : ndarray, shape (n_batch, n_elements, n_vectors, n_dim)
        Difference vectors, in the state in which there is balance.
    dU : ndarray, same shape
        Derivative of the energy by them, with what damping adds [J].
    places : ndarray, shape (n_places,)
        Distances from the root [m]; of a node, the element beyond it counts.

    Returns
    -------
    ndarray, shape (n_batch, n_places, 3)
        What the part beyond does to the part before: force [N], in the axes of the vectors.
    ndarray, same shape
        Moment [N m].
    """
    element = beam.mesh.element
    degree, length = element.degree, element.length
    e = np.minimum((places / length).astype(int), beam.mesh.count - 1)
    xi = places / length - e
    V, dU = (np.pad(a[:, e], [(0, 0)] * 3 + [(0, 3 - a.shape[-1])]) for a in (V, dU))
    basis, solved, on_slope = _tables(degree)
    F = solved @ dU[:, :, [0, *range(2, degree - 1)]] / length
    first = [1, *range(degree, V.shape[2], max(1, (V.shape[2] - degree) // (beam.n_dim - 1)))]
    left = -dU[:, :, first]
    left[:, :, :1] += length * (on_slope @ F)
    moment = np.sum(cross(V[:, :, first], left), axis=2)
    g, w = gauss_legendre(degree)
    inner = xi[:, None] * g
    slopes = difference_rows(inner.ravel(), 1, degree).reshape(len(xi), len(g), degree) @ V[:, :, :degree]
    twisting = cross(slopes, _legendre(inner, basis) @ F)
    moment -= length * xi[:, None] * np.sum(w[:, None] * twisting, axis=2)
    return (_legendre(xi[:, None], basis) @ F)[:, :, 0], moment


def _legendre(xi: Array, count: int) -> Array:
    """Return the first Legendre polynomials of the unit interval, shape (..., count)."""
    return np.asarray(np.polynomial.legendre.legvander(2.0 * xi - 1.0, count - 1))


@lru_cache(maxsize=16)
def _tables(degree: int) -> tuple[int, Array, Array]:
    """Return the number of polynomials of F, their factors from dU / length, and their work on r1'."""
    count, (g, w) = degree - 2, gauss_legendre(degree)
    rows, P = difference_rows(g, 1, degree), _legendre(g, count)
    work = (rows.T * w) @ P
    return count, np.linalg.inv(work[[0, *range(2, degree - 1)]]), work[1:2]


def small_forces(
    beam: Blueprint, curvature: str, moved: Array, rates: Array, places: Array
) -> Array:
    """Return what the linear law gives, in the axes of the undeformed beam, (n_batch, n_places, 6).

    Parameters
    ----------
    beam : Blueprint
    curvature : str
        Measure whose linear part counts.
    moved, rates : ndarray, shape (n_batch, n_nodal_vectors, n_dim)
        Displacements of nodal vectors in the body frame, and their rates.
    places : ndarray, shape (n_places,)
    """
    straight = beam.difference_vectors(np.broadcast_to(beam.undeformed, moved.shape))
    stiffness, damping = beam.element_matrices(curvature)
    change, changing = beam.difference_vectors(moved), beam.difference_vectors(rates)
    flat = (*change.shape[:2], -1, 1)
    dU = stiffness @ change.reshape(flat) + damping @ changing.reshape(flat)
    parts = line_forces(beam, straight, dU.reshape(change.shape), places)
    return np.asarray(np.concatenate(parts, axis=-1))


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
