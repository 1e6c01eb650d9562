"""Elastic, damping and weight forces of beams in absolute nodal coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray, IntArray
from hfsim.maths.matrices import NOTHING, Entries, Matrix, assemble, is_sparse
from hfsim.maths.rotations import as_complex, as_vectors
from hfsim.mechanics.force import DIFFERENCE, ForcePart
from hfsim.parts.bodies.frame import relative_nodes
from hfsim.parts.elements import ElasticLaw
from hfsim.parts.elements._base import component_rows
from hfsim.parts.elements.cable import exact_points, gauss_rows

AT_ONCE = 1024
"""Elements, counted once for each state, whose forces are computed together: what they take stays in the
processor's cache."""


@dataclass(frozen=True)
class Connectivity:
    """How the difference vectors of elements follow from the coordinates of a scene.

    Attributes
    ----------
    n : int
        Number of coordinates.
    columns : ndarray of int, shape (n_elements, k)
        Coordinates of each element.
    local : ndarray, shape (n_elements, n_vectors * 2, k)
        From them to its difference vectors.
    """

    n: int
    columns: IntArray
    local: Array

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of elements, of difference vectors of each, and of their components."""
        return len(self.columns), self.local.shape[1] // 2, 2

    @cached_property
    def gather(self) -> Matrix:
        """From coordinates to the difference vectors, component by component: ``gather @ x.T``."""
        count, m, _ = self.local.shape
        vectors = np.arange(count * m).reshape(m, count).T
        entries = Entries.of_block(vectors, self.columns, self.local)
        kept = entries.values != 0.0
        return assemble([Entries(*(kind[kept] for kind in entries))], (count * m, self.n))

    @cached_property
    def scatter(self) -> Matrix:
        """From derivatives by difference vectors to those by coordinates, their transpose."""
        return self.gather.T.tocsr() if is_sparse(self.gather) else np.ascontiguousarray(self.gather.T)

    def rows(self, x: Array) -> Array:
        """Return the difference vectors as rows of equal components, (n_vectors, 2, n_elements * n_batch)."""
        return np.asarray(self.gather.dot(x.T)).reshape(self._kinds)

    def push(self, rows: Array, n_batch: int) -> Array:
        """Return derivatives by the coordinates, shape (n_batch, n), from those by rows of vectors."""
        return np.asarray(self.scatter.dot(rows.reshape(-1, n_batch))).T

    @cached_property
    def _kinds(self) -> tuple[int, int, int]:
        return self.shape[1], self.shape[2], -1

    def vectors(self, x: Array) -> Array:
        """Return the difference vectors, shape (n_batch, n_elements, n_vectors, 2)."""
        rows = self.rows(x).reshape(*self.shape[1:], self.shape[0], len(x))
        return np.ascontiguousarray(rows.transpose(3, 2, 0, 1))

    def force(self, gradient: Array) -> Array:
        """Return derivatives by the coordinates, shape (n_batch, n), from those by difference vectors."""
        return self.push(component_rows(gradient), len(gradient))

    def entries(self, blocks: Array) -> Entries:
        """Return second derivatives by the coordinates from those by the vectors, (n_elements, m, m)."""
        return Entries(*self._places, (self._local_transposed @ blocks @ self.local).ravel())

    @cached_property
    def _local_transposed(self) -> Array:
        return np.ascontiguousarray(self.local.swapaxes(1, 2))

    @cached_property
    def _places(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of all entries of the elements' matrices."""
        k = self.columns.shape[1]
        nothing = Entries.of_block(self.columns, self.columns, np.zeros((len(self.columns), k, k)))
        return nothing.rows, nothing.columns

    def joined(self, other: Connectivity) -> Connectivity:
        """Return the connectivity of these elements followed by others of the same kind."""
        columns = np.concatenate([self.columns, other.columns])
        return Connectivity(self.n, columns, np.concatenate([self.local, other.local]))


@dataclass(frozen=True)
class ElasticForce(ForcePart):
    """Elastic force of all elements that share a law, of one or several beams.

    The energy does not change with a rotation, so it is evaluated on absolute nodal vectors; in the
    body frame the same numbers would come out.
    """

    elements: Connectivity
    law: ElasticLaw

    @property
    def quartic(self) -> bool:
        """Return what the law says."""
        return self.law.quartic

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus the derivative of the strain energy, eq. (24)."""
        elements, states = self.elements, max(1, AT_ONCE // len(self.elements.columns))
        if len(x) <= states:
            out -= elements.push(self.law.pull(elements.rows(x)), len(x))
            return
        for first in range(0, len(x), states):
            some = x[first : first + states]
            out[first : first + states] -= elements.push(self.law.pull(elements.rows(some)), len(some))

    def strain_energy(self, x: Array) -> Array:
        """Return the strain energy of all elements."""
        return np.asarray(self.law.energy(self.elements.vectors(x)).sum(axis=-1))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return the second derivative of the strain energy in one state."""
        return self.elements.entries(self.law.hessian(self.elements.vectors(x))[0])


@dataclass(frozen=True)
class LinearElasticForce(ForcePart):
    """Elastic force of one beam linearised about its undeformed state in the body frame (eq. 42-43).

    Attributes
    ----------
    name : str
        Of the beam.
    columns : slice
    stiffness, damping : ndarray, shape (n_vectors * 2, n_vectors * 2)
        Over all relative nodal coordinates [N/m and the like]; damping multiplies their rates.
    undeformed : ndarray, shape (n_vectors, 2)
    positions : ndarray, shape (n_vectors,)
        One for nodal positions, zero for gradients.
    """

    name: str
    columns: slice
    stiffness: Array
    damping: Array
    undeformed: Array
    positions: Array

    @property
    def uses_rates(self) -> bool:
        """Whether there is damping."""
        return bool(self.damping.any())

    @property
    def support(self) -> IntArray:
        """All coordinates of the beam."""
        return np.arange(self.columns.start, self.columns.stop)

    def _nodes(self, x: Array) -> Array:
        return x[:, self.columns].reshape(len(x), -1, 2)

    def _deformation(self, x: Array) -> tuple[Array, ComplexArray, ComplexArray]:
        """Return p - p0 flattened, the relative vectors and the frame's first axis as complex."""
        origin, tangent, z = relative_nodes(self._nodes(x))
        p = (z - self.positions * origin) * tangent.conj()
        flat = (as_vectors(p) - self.undeformed).reshape(len(x), -1)
        return flat, p, tangent

    def _rates(self, x: Array, u: Array, p: ComplexArray, tangent: ComplexArray) -> Array:
        w = as_complex(self._nodes(u))
        local = (w - self.positions * w[:, :1]) * tangent.conj()
        omega = local[:, 1:2].imag / p[:, 1:2].real
        return as_vectors(local - 1j * omega * p).reshape(len(x), -1)

    def displacement(self, x: Array) -> float:
        """Return the largest nodal displacement in the body frame over the length of the beam."""
        moved = np.abs(self._deformation(x)[0].reshape(-1, 2)) * np.tile(self.positions, len(x))[:, None]
        return float(moved.max() / self.undeformed[:, 0].max())

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add -K (p - p0) - D p', with no force on the frame coordinates."""
        flat, p, tangent = self._deformation(x)
        local = flat @ -self.stiffness
        if self.uses_rates:
            local -= self._rates(x, u, p, tangent) @ self.damping
        force = as_complex(local.reshape(len(x), -1, 2)).copy()
        # what the frame coordinates do not feel is balanced at the root vectors
        force[:, 0] = 0.0
        force[:, 1] = force[:, 1].real
        force[:, 0] = -(force @ self.positions)
        force[:, 1] -= 1j * np.sum((p.conj() * force).imag, axis=-1) / p[:, 1].real
        out[:, self.columns] += as_vectors(force * tangent).reshape(len(x), -1)

    def strain_energy(self, x: Array) -> Array:
        """Return 1/2 (p - p0)^T K (p - p0)."""
        flat = self._deformation(x)[0]
        return np.asarray(0.5 * np.sum((flat @ self.stiffness) * flat, axis=-1))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of the damping."""
        _, p, tangent = self._deformation(x)
        rates = self._rates(x, u, p, tangent)
        return np.asarray(-np.sum((rates @ self.damping) * rates, axis=-1))


@dataclass(frozen=True)
class KelvinVoigtForce(ForcePart):
    """Damping proportional to the rates of axial strain and curvature, of cable elements.

    Dissipated per length: EA tau_a strain'^2 + EI tau_b curvature'^2 with the Green strain and the
    curvature (r' x r'')/|r'|^2, whose rates vanish in every rigid motion.

    Attributes
    ----------
    elements : Connectivity
    slope, bend : ndarray, shape (n_points, n_vectors)
        Rows of r' and r'' (times le) at the Gauss points of an element.
    axial, bending : ndarray, shape (n_elements, n_points)
        EA le tau_a w and EI / le tau_b w [J s].
    """

    elements: Connectivity
    slope: Array
    bend: Array
    axial: Array
    bending: Array

    @property
    def uses_rates(self) -> bool:
        """Return True."""
        return True

    @property
    def dissipates(self) -> bool:
        """Whether there is any damping."""
        return bool(self.axial.any() or self.bending.any())

    @classmethod
    def of(cls, elements: Connectivity, degree: int, axial: float, bending: float) -> KelvinVoigtForce:
        """Return the force of equal elements from EA le tau_a and EI / le tau_b [J s]."""
        w, slope, bend = gauss_rows(exact_points(degree), degree)
        count = len(elements.columns)
        return cls(
            elements=elements,
            slope=slope,
            bend=bend,
            axial=np.tile(axial * w, (count, 1)),
            bending=np.tile(bending * w, (count, 1)),
        )

    def _measures(self, V: Array, dV: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        s, c = self.slope @ V, self.bend @ V
        ds, dc = self.slope @ dV, self.bend @ dV
        square = np.sum(s * s, axis=-1, keepdims=True)
        kappa = (s[..., :1] * c[..., 1:] - s[..., 1:] * c[..., :1]) / square
        by_c = np.stack([-s[..., 1], s[..., 0]], axis=-1) / square
        by_s = np.stack([c[..., 1], -c[..., 0]], axis=-1) / square - 2.0 * kappa / square * s
        strain_rate = np.sum(s * ds, axis=-1)
        curvature_rate = np.sum(by_s * ds + by_c * dc, axis=-1)
        return s, by_s, by_c, strain_rate, curvature_rate, square

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the damping force."""
        out -= self.elements.force(self._gradient(self.elements.vectors(x), self.elements.vectors(u)))

    def _gradient(self, V: Array, dV: Array) -> Array:
        s, by_s, by_c, strain_rate, curvature_rate, _ = self._measures(V, dV)
        moment = (self.bending * curvature_rate)[..., None]
        tension = (self.axial * strain_rate)[..., None]
        return np.asarray(self.slope.T @ (tension * s + moment * by_s) + self.bend.T @ (moment * by_c))

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state; by differences, element by element."""
        V, dV = self.elements.vectors(x), self.elements.vectors(u)
        change = self._gradient(V + DIFFERENCE * self._units, dV) - self._gradient(V, dV)
        return self._entries(change / DIFFERENCE)

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state: the force is linear in u."""
        return self._entries(self._gradient(self.elements.vectors(x), self._units))

    @cached_property
    def _units(self) -> Array:
        """Each component of the difference vectors by itself, in all elements at once, as a batch."""
        count, n_vectors, n_dim = self.elements.shape
        m = n_vectors * n_dim
        units = np.broadcast_to(np.eye(m)[:, None], (m, count, m))
        return units.reshape(m, count, n_vectors, n_dim)

    def _entries(self, columns: Array) -> Entries:
        """Return the entries of a matrix whose blocks are given column by column."""
        m, count = columns.shape[:2]
        return self.elements.entries(columns.reshape(m, count, m).transpose(1, 2, 0))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the dissipated power."""
        V, dV = self.elements.vectors(x), self.elements.vectors(u)
        _, _, _, strain_rate, curvature_rate, _ = self._measures(V, dV)
        lost = self.axial * strain_rate**2 + self.bending * curvature_rate**2
        return np.asarray(-lost.sum(axis=(-1, -2)))


@dataclass(frozen=True)
class ConstantForce(ForcePart):
    """Weight of bodies whose mass matrix is constant: one vector for all states (eq. 31).

    Attributes
    ----------
    force : ndarray, shape (n,)
    energy : float
        Energy of bodies that cannot move [J].
    """

    force: Array
    energy: float = 0.0

    @property
    def quartic(self) -> bool:
        """Return True: the energy is linear."""
        return True

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the constant vector."""
        out += self.force

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return nothing: the force does not change."""
        return NOTHING

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return minus the work of the force from the origin."""
        return np.asarray(self.energy - x @ self.force)
