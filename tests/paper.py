"""Mass matrix and forces of one beam as the paper writes them, in hybrid coordinates.

Equations (9)-(14) and (31) of Liu, Hong & Cui (2007) for q = (r0, theta, p), evaluated from the
constant matrices int rho N^T N and int rho N of the mesh.  `hfsim.parts.bodies.planar_frame` reaches the same
accelerations by a change of variables; these are what tests and benchmarks hold it against.

In the plane s~' a is the number ``normal(s') . a``, and omega~' a the vector ``omega normal(a)``.
The text prints Q_2 of eq. (13) with a plus; virtual work (7) with (5) and (6) gives the minus used
here, without which a body that contracts would spin down.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hfsim.maths.rotations import normal, rotate
from hfsim.parts.bodies.mesh import BeamMesh

Array = NDArray[np.float64]


def turned(angle):
    """Return the matrices A(angle), shape (..., 2, 2), that turn body axes into inertial axes."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def elastic_columns(mesh: BeamMesh) -> NDArray[np.intp]:
    """Return which of all nodal components make up p: all but root position and transverse root slope."""
    return np.delete(np.arange(2 * mesh.n_vectors), [0, 1, 3])


def relative_vectors(mesh: BeamMesh, q: Array) -> Array:
    """Return all nodal vectors in the body frame, or their rates if ``q`` holds rates.

    Parameters
    ----------
    mesh : BeamMesh
    q : ndarray, shape (n_batch, n)
        (r0, theta, axial root slope, other nodal vectors).

    Returns
    -------
    ndarray, shape (n_batch, n_vectors, 2)
    """
    full = np.zeros((len(q), 2 * mesh.n_vectors))
    full[:, elastic_columns(mesh)] = q[:, 3:]
    return full.reshape(len(q), mesh.n_vectors, 2)


def first_moment(mesh: BeamMesh) -> Array:
    """Return int rho N dV of one vector component, shape (n_vectors,) [kg]: rigid shifts are in N."""
    return np.asarray(mesh.positions @ mesh.mass)


def mass_matrix(mesh: BeamMesh, q: Array) -> Array:
    """Return the generalised mass matrix M of eq. (9), by eq. (10)-(12).

    Parameters
    ----------
    mesh : BeamMesh
    q : ndarray, shape (n_batch, n)
        r0 [m], theta [rad], p (body frame).

    Returns
    -------
    ndarray, shape (n_batch, n, n)
    """
    s, N, keep = relative_vectors(mesh, q), first_moment(mesh), elastic_columns(mesh)
    weighted = mesh.mass @ s
    M = np.zeros((*q.shape, q.shape[1]))
    M[:, 0, 0] = M[:, 1, 1] = N @ mesh.positions
    M[:, :2, 2] = rotate(q[:, 2], normal(N @ s))
    M[:, :2, 3:] = turned(q[:, 2]) @ np.kron(N, np.eye(2))[:, keep]
    M[:, 2, 2] = np.sum(s * weighted, axis=(1, 2))
    M[:, 2, 3:] = normal(weighted).reshape(len(q), -1)[:, keep]
    M[:, 3:, 3:] = np.kron(mesh.mass, np.eye(2))[np.ix_(keep, keep)]
    M[:, 2, :2] = M[:, :2, 2]
    M[:, 3:, :3] = M[:, :3, 3:].swapaxes(1, 2)
    return M


def inertia_force(mesh: BeamMesh, q: Array, v: Array) -> Array:
    """Return the inertia force Q_i of eq. (9), by eq. (13)-(14).

    Parameters
    ----------
    mesh : BeamMesh
    q, v : ndarray, shape (n_batch, n)
        Hybrid coordinates and their rates.

    Returns
    -------
    ndarray, shape (n_batch, n)
    """
    s = relative_vectors(mesh, q)
    omega = v[:, 2, None, None]
    # omega~' omega~' s' + 2 omega~' N p' is N times these nodal vectors
    acceleration = -(omega**2) * s + 2.0 * omega * normal(relative_vectors(mesh, v))
    weighted = mesh.mass @ acceleration
    Q = np.zeros_like(q)
    Q[:, :2] = -rotate(q[:, 2], first_moment(mesh) @ acceleration)
    Q[:, 2] = -np.sum(normal(s) * weighted, axis=(1, 2))
    Q[:, 3:] = -weighted.reshape(len(q), -1)[:, elastic_columns(mesh)]
    return Q


def body_force(mesh: BeamMesh, q: Array, gravity: tuple[float, float] | Array) -> Array:
    """Return Q_f of eq. (31) for the body force f = rho g.

    Parameters
    ----------
    mesh : BeamMesh
    q : ndarray, shape (n_batch, n)
    gravity : array_like, shape (2,)
        g, body force per mass, in the inertial frame [m/s^2].

    Returns
    -------
    ndarray, shape (n_batch, n)
    """
    s, N = relative_vectors(mesh, q), first_moment(mesh)
    g = np.broadcast_to(np.asarray(gravity, dtype=float), (len(q), 2))
    local = rotate(-q[:, 2], g)
    Q = np.zeros_like(q)
    Q[:, :2] = (N @ mesh.positions) * g
    Q[:, 2] = np.sum(normal(N @ s) * local, axis=-1)
    Q[:, 3:] = (N[:, None] * local[:, None, :]).reshape(len(q), -1)[:, elastic_columns(mesh)]
    return Q
