"""Internal forces of beams by balance.

The part of a beam beyond a section moves by what acts on it, and by what the part before the section does.
So the section bears loads, joints and weight beyond it less the inertia there, whatever the measures of
strain are: these are the sums that the equations of motion hold to rounding, for the whole beam and element
by element, and inside an element integrals of its own shapes.  What strains give instead is as smooth as
the shapes' highest derivatives are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from hfsim.maths.arrays import Array, IntArray, distinct
from hfsim.maths.rotations import lever
from hfsim.maths.shapes import shares_beyond
from hfsim.mechanics.body import Acting, VectorBody
from hfsim.mechanics.markers import LinearMarker, Marker
from hfsim.parts.bodies.section_axes import in_axes

if TYPE_CHECKING:
    from hfsim.parts.bodies.foreshortened import ForeshortenedBeam
    from hfsim.parts.bodies.mesh import BeamMesh
    from hfsim.parts.bodies.section_mesh import SectionMesh

ROUNDING = 1e-9
"""Distance, over the length of a beam, that counts as none."""
Pair = tuple[Array, Array]
"""Forces [N], (n_batch, n_places, n_dim), and moments [N m], (n_batch, n_places, n_spin), about the root."""


class Borne(Protocol):
    """What a beam tells of itself for the balance."""

    @property
    def length(self) -> float:
        """Undeformed [m]."""

    def along(self, marker: Marker) -> float:
        """Return how far from the root the section of one of its points is [m]."""

    def line(self, x: Array, places: Array) -> Array:
        """Return points of its line, (n_batch, n_places, n_dim)."""

    def resultant(self, x: Array, force: Array) -> Pair:
        """Return force and moment about its root of a generalised force (n_batch, n_columns)."""

    def carried_beyond(self, x: Array, u: Array, a: Array, places: Array) -> Pair:
        """Return weight less inertia of its parts beyond places."""

    def section_axes(self, x: Array, places: Array) -> Array:
        """Return the axes of sections at places, (n_batch, n_places, 3, 3), as columns."""


def balanced(body: Borne, x: Array, u: Array, a: Array, acting: Acting, places: Array) -> Array:
    """Return what `Body.section_forces` of a beam returns."""
    force, moment = body.carried_beyond(x, u, a, places)
    sections = places - ROUNDING * body.length * (places > (1.0 - ROUNDING) * body.length)
    for marker, load in acting.points:
        beyond = (body.along(marker) > sections + 0.5 * ROUNDING * body.length).astype(float)[:, None]
        own, about = body.resultant(x, load)
        force, moment = force + beyond * own[:, None], moment + beyond * about[:, None]
    points = body.line(x, np.append(0.0, places))
    for line, forces in acting.lines:
        shares, own = line.beyond(places), np.stack(forces, axis=1)
        arms = np.stack([marker.position(x) for marker in line.places], axis=1) - points[:, :1]
        force, moment = force + shares @ own, moment + shares @ lever(arms, own)
    moment = moment - lever(points[:, 1:] - points[:, :1], force)
    axes = body.section_axes(x, places)
    return in_axes(axes, _padded(force, after=True), _padded(moment, after=False))


def _padded(numbers: Array, after: bool) -> Array:
    """Return vectors (..., n) of three numbers: those that the plane has not are zero."""
    missing = 3 - numbers.shape[-1]
    return np.pad(numbers, ((0, 0), (0, 0), (0, missing) if after else (missing, 0)))


def along_vectors(mesh: BeamMesh | SectionMesh, marker: Marker) -> float:
    """Return how far from the root a marker on a beam with nodal vectors is [m]."""
    assert isinstance(marker, LinearMarker)
    return float(marker.place_row @ mesh.distances)


def carried_by_vectors(
    body: VectorBody, mesh: BeamMesh | SectionMesh, gravity: Array, x: Array, a: Array, places: Array
) -> Pair:
    """Return weight less inertia beyond places of a beam with nodal vectors and a constant mass matrix."""
    spans, length = mesh.spans, mesh.length / mesh.count
    positions = body.positions[spans]
    arms, pulls = body.arms(x), body.positions[:, None] * gravity - body.vectors(a)

    def summed(start: float, e: IntArray) -> Array:
        """Return force and moment, side by side, of the parts of elements beyond a share of their length."""
        masses = mesh.masses_from(start)
        own = (masses if len(masses) == 1 else masses[e]) @ pulls[:, spans[e]]
        force = np.sum(positions[e][..., None] * own, axis=2)
        return np.concatenate([force, lever(arms[:, spans[e]], own).sum(axis=2)], axis=-1)

    whole = summed(0.0, np.arange(mesh.count))
    beyond = np.zeros_like(whole)
    beyond[:, :-1] = np.cumsum(whole[:, :0:-1], axis=1)[:, ::-1]
    e = np.minimum((places / length + ROUNDING).astype(int), mesh.count - 1)
    starts = np.clip(np.round(places / length - e, 9), 0.0, 1.0)
    found = beyond[:, e]
    for start in distinct(starts):
        some = starts == start
        found[:, some] += summed(float(start), e[some])
    return found[..., : body.n_dim], found[..., body.n_dim :]


def carried_by_points(
    beam: ForeshortenedBeam, markers: list[Marker], x: Array, u: Array, a: Array, places: Array
) -> Pair:
    """Return the same of a beam whose mass is at quadrature points, each with a marker."""
    masses, shares = beam.points[1], shares_beyond(beam.pieces, *beam.gauss, places)
    root = markers[0].position(x)
    forces, arms = [], []
    for marker, mass in zip(markers[1:], masses, strict=True):
        moving = (marker.position_jacobian(x) @ a[:, beam.columns, None])[..., 0]
        forces.append(mass * (np.array(beam.gravity) - moving - marker.position_bias(x, u)))
        arms.append(marker.position(x) - root)
    own = np.stack(forces, axis=1)
    return shares @ own, shares @ lever(np.stack(arms, axis=1), own)
