"""Internal forces of beams with section vectors, carried from the Gauss points to any place.

At the Gauss points the force of the strains does the work of the loads, which between them interpolated
section vectors do not let it do.  Force, and moment about the origin, change along a beam by loads alone; so
these two are what is interpolated, by the polynomial through the points of an element.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import cross, lever, normal
from hfsim.maths.shapes import gauss_legendre, lagrange
from hfsim.parts.bodies.line_forces import in_the_plane
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.elements.cosserat import strain_slopes


def frame_forces(mesh: SectionMesh, vectors: Array, rates: Array, places: Array) -> tuple[Array, Array]:
    """Return force [N] and moment [N m] in ground axes and the one across the plane, (n_batch, n_places, 3).

    Parameters
    ----------
    mesh : SectionMesh
    vectors, rates : ndarray, shape (n_batch, n_dim n_nodes, n_dim)
        Nodal vectors, and their rates.
    places : ndarray, shape (n_places,)
        Distances from the root [m]; of an element's end, the element beyond it counts.
    """
    (own, rows), strains = mesh.point_vectors, mesh.strains
    V, dV = (rows @ nodal[:, own] for nodal in (vectors, rates))
    undeformed = strains.of(np.moveaxis(rows @ mesh.undeformed[own], (-2, -1), (0, 1)))
    change = strains.of(np.moveaxis(V, (-2, -1), (0, 1))) - undeformed[:, None]
    changing = (strain_slopes(strains, V) @ dV.reshape(*V.shape[:2], -1, 1))[..., 0]
    stiffness, damping = mesh.resisting[:, :, None]
    S = stiffness * change + damping * np.moveaxis(changing, -1, 0)
    return balanced_forces(mesh, vectors, S, places)


def balanced_forces(mesh: SectionMesh, vectors: Array, S: Array, places: Array) -> tuple[Array, Array]:
    """Return the same of section forces (n_strains, n_batch, n_points) at the Gauss points."""
    (own, rows), strains = mesh.point_vectors, mesh.strains
    V = rows @ vectors[:, own]
    on_vectors = np.moveaxis(strains.pulled(np.moveaxis(V, (-2, -1), (0, 1)), S), 1, -1)
    force, on_bent = on_vectors[0], on_vectors[mesh.n_dim :]
    moment = sum(lever(V[:, :, k], on) for k, on in enumerate(on_bent, 1))
    about_origin = moment + lever(_positions(mesh, mesh.points[0], vectors), force)
    carried = _carried(mesh, force, places)
    about_place = _carried(mesh, about_origin, places) - lever(_positions(mesh, places, vectors), carried)
    return _padded(carried, after=True), _padded(about_place, after=False)


def _padded(numbers: Array, after: bool) -> Array:
    """Return vectors (..., n) of three numbers: those that the plane has not are zero."""
    missing = 3 - numbers.shape[-1]
    return np.pad(numbers, ((0, 0), (0, 0), (0, missing) if after else (missing, 0)))


def section_axes(mesh: SectionMesh, vectors: Array, places: Array) -> Array:
    """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns; they are square."""
    sections = np.array([mesh.shape(float(a))[1] for a in places]).swapaxes(0, 1)
    if mesh.n_dim == 2:
        return in_the_plane(-normal(sections[0] @ vectors))
    y, z = (rows @ vectors for rows in sections)
    x = cross(y, z)
    x, between = _unit(x), _unit(_unit(y) + _unit(z))
    across = cross(x, between)
    return np.asarray(np.stack([x, (between - across) / 2**0.5, (between + across) / 2**0.5], axis=-1))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _positions(mesh: SectionMesh, places: Array, vectors: Array) -> Array:
    return np.asarray(np.array([mesh.shape(float(a))[0] for a in places]) @ vectors)


def _carried(mesh: SectionMesh, values: Array, places: Array) -> Array:
    """Return values (n_batch, n_points, k) at Gauss points by the polynomials through those of elements."""
    where = places / mesh.axis.length * mesh.count
    e = np.minimum(where.astype(int), mesh.count - 1)
    rows = lagrange(where - e, gauss_legendre(mesh.degree)[0])
    own = values.reshape(len(values), mesh.count, mesh.degree, -1)[:, e]
    return np.asarray(np.einsum("pk,bpki->bpi", rows, own))
