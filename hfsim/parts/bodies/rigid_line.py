"""How forces would deform a rigid beam without sections, in plane and space: stretch and bending, M / EI."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hfsim.maths.arrays import Array, cumulative
from hfsim.mechanics.deformation import Deformation
from hfsim.parts.bodies.mesh import BeamMesh

POINTS = 33
"""Equidistant places along the beam at which it would be bent."""


def strained(
    mesh: BeamMesh, root: Array, slope: Array, loads: Iterable[tuple[float, Array, Array]], spin: Array
) -> Deformation:
    """Return stretch and bending of a straight line by inertia, weight and loads: N / EA and M / EI.

    N and, across, M are resultants of everything beyond a place:

        M(x) = sum m_p + (x_p - x) F_p + int_x^L f(s) (s - x) ds        f = rho A (root + slope s)

    Parameters
    ----------
    root, slope : ndarray, shape (n_batch, n_dim)
        Weight less inertia per mass at the root [m/s^2], and by how much it grows along the line [1/s^2].
    loads : iterable of (float, ndarray, ndarray)
        Distance from the root [m], force (n_batch, n_dim) and what bends (n_batch, n_dim - 1), in body axes.
    spin : ndarray, shape (n_batch, n_spin)
        Of the body frame [rad/s].
    """
    places = np.linspace(0.0, mesh.length, POINTS)
    # integrals over the rest of the beam of rho A (root + slope s), and of that times s - x
    m0, m1, m2 = mesh.masses_beyond(places)
    N = np.outer(root[:, 0], m0) + np.outer(slope[:, 0], places * m0 + m1)
    M = m1[:, None] * root[:, None, 1:] + (places * m1 + m2)[:, None] * slope[:, None, 1:]
    for at, force, moment in loads:
        beyond = at > places
        N += force[:, :1] * beyond
        M += (moment[:, None] + (at - places)[:, None] * force[:, None, 1:]) * beyond[:, None]
    weights = np.full(POINTS, mesh.length / (POINTS - 1))
    weights[[0, -1]] *= 0.5
    section = mesh.at(places)
    curvature = M / np.asarray(section.bending_stiffness)[..., None]
    bent = cumulative(curvature.swapaxes(0, 1), places).swapaxes(0, 1)
    tip = np.einsum("bxd,x->bd", bent, weights)
    return Deformation(places, weights, N / section.axial_stiffness, bent, curvature, tip, spin)
