"""Internal forces of beams with section vectors in space, carried from the Gauss points to any place.

At the Gauss points the force of the strains does the work of the loads, which between them interpolated
section vectors do not let it do.  Force, and moment about the origin, change along a beam by loads alone; so
these two are what is interpolated, by the polynomial through the points of an element.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import cross
from hfsim.maths.shapes import gauss_legendre, lagrange
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.elements.cosserat import pulled, strain_slopes, strains


def frame_forces(mesh: SectionMesh, vectors: Array, rates: Array, places: Array) -> tuple[Array, Array]:
    """Return force [N] and moment [N m] in ground axes, (n_batch, n_places, 3) each.

    Parameters
    ----------
    mesh : SectionMesh
    vectors, rates : ndarray, shape (n_batch, 3 n_nodes, 3)
        Nodal vectors, and their rates.
    places : ndarray, shape (n_places,)
        Distances from the root [m]; of an element's end, the element beyond it counts.
    """
    own, rows = mesh.point_vectors
    V, dV = (rows @ nodal[:, own] for nodal in (vectors, rates))
    undeformed = strains(np.moveaxis(rows @ mesh.undeformed[own], (-2, -1), (0, 1)))
    change = strains(np.moveaxis(V, (-2, -1), (0, 1))) - undeformed[:, None]
    changing = (strain_slopes(V) @ dV.reshape(*V.shape[:2], -1, 1))[..., 0]
    stiffness, damping = np.array([mesh.properties.stiffness, mesh.properties.damping])
    S = stiffness[:, None, None] * change + np.moveaxis(damping * changing, -1, 0)
    force, _, _, on_y, on_z = np.moveaxis(pulled(np.moveaxis(V, (-2, -1), (0, 1)), S), 1, -1)
    moment = cross(V[:, :, 1], on_y) + cross(V[:, :, 2], on_z)
    about_origin = moment + cross(_positions(mesh, mesh.points[0], vectors), force)
    carried = _carried(mesh, force, places)
    arms = _positions(mesh, places, vectors)
    return carried, _carried(mesh, about_origin, places) - cross(arms, carried)


def section_axes(mesh: SectionMesh, vectors: Array, places: Array) -> Array:
    """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns; they are square."""
    y, z = (np.array([mesh.shape(float(a))[1][k] for a in places]) @ vectors for k in (0, 1))
    x = cross(y, z)
    x, between = _unit(x), _unit(_unit(y) + _unit(z))
    across = cross(x, between)
    return np.asarray(np.stack([x, (between - across) / 2**0.5, (between + across) / 2**0.5], axis=-1))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _positions(mesh: SectionMesh, places: Array, vectors: Array) -> Array:
    return np.asarray(np.array([mesh.shape(float(a))[0] for a in places]) @ vectors)


def _carried(mesh: SectionMesh, values: Array, places: Array) -> Array:
    """Return values (n_batch, n_points, 3) at Gauss points by the polynomials through those of elements."""
    where = places / mesh.axis.length * mesh.count
    e = np.minimum(where.astype(int), mesh.count - 1)
    rows = lagrange(where - e, gauss_legendre(mesh.degree)[0])
    own = values.reshape(len(values), mesh.count, mesh.degree, 3)[:, e]
    return np.asarray(np.einsum("pk,bpki->bpi", rows, own))
