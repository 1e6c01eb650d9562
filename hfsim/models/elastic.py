"""Elastic, damping and weight forces of beams in absolute nodal coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hfsim.arrays import Array, ComplexArray
from hfsim.elements import ElasticLaw
from hfsim.elements.cable import exact_points, gauss_rows
from hfsim.models.frame import relative_nodes
from hfsim.parts import ForcePart
from hfsim.rotations import as_complex, as_vectors


@dataclass(frozen=True)
class ElasticForce(ForcePart):
    """Elastic force of all elements that share a law, of one or several beams.

    The energy does not change with a rotation, so it is evaluated on absolute nodal vectors; in the
    body frame the same numbers would come out.

    Attributes
    ----------
    gather : ndarray, shape (n, n_elements * n_vectors * 2)
        From coordinates to difference vectors, ``x @ gather``.
    law : ElasticLaw
    shape : tuple of int
        (n_elements, n_vectors, 2), with the difference vectors of each element.
    """

    gather: Array
    scatter: Array
    law: ElasticLaw
    shape: tuple[int, int, int]

    def _vectors(self, x: Array) -> Array:
        return (x @ self.gather).reshape(len(x), *self.shape)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add minus the derivative of the strain energy, eq. (24)."""
        out -= self.law.gradient(self._vectors(x)).reshape(len(x), -1) @ self.scatter

    def strain_energy(self, x: Array) -> Array:
        """Return the strain energy of all elements."""
        return np.asarray(self.law.energy(self._vectors(x)).sum(axis=-1))

    def tangent(self, x: Array) -> Array:
        """Return minus the derivative of the force, shape (n_batch, n, n)."""
        H = self.law.hessian(self._vectors(x))
        count, k = self.shape[0], self.shape[1] * self.shape[2]
        G = self.gather.reshape(len(self.gather), count, k)
        return np.asarray(np.einsum("iea,beac,jec->bij", G, H, G, optimize=True))


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
    gather, scatter, shape
        As in `ElasticForce`.
    slope, bend : ndarray, shape (n_points, n_vectors)
        Rows of r' and r'' (times le) at the Gauss points of an element.
    axial, bending : ndarray, shape (n_elements, n_points)
        EA le tau_a w and EI / le tau_b w [J s].
    """

    gather: Array
    scatter: Array
    shape: tuple[int, int, int]
    slope: Array
    bend: Array
    axial: Array
    bending: Array

    @property
    def uses_rates(self) -> bool:
        """Return True."""
        return True

    @classmethod
    def of(cls, gather: Array, count: int, degree: int, axial: float, bending: float) -> KelvinVoigtForce:
        """Return the force of ``count`` equal elements from EA le tau_a and EI / le tau_b [J s]."""
        w, slope, bend = gauss_rows(exact_points(degree), degree)
        return cls(
            gather=gather,
            scatter=np.ascontiguousarray(gather.T),
            shape=(count, degree, 2),
            slope=slope,
            bend=bend,
            axial=np.tile(axial * w, (count, 1)),
            bending=np.tile(bending * w, (count, 1)),
        )

    def _measures(self, x: Array, u: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        V = (x @ self.gather).reshape(len(x), *self.shape)
        dV = (u @ self.gather).reshape(len(x), *self.shape)
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
        s, by_s, by_c, strain_rate, curvature_rate, _ = self._measures(x, u)
        moment = (self.bending * curvature_rate)[..., None]
        tension = (self.axial * strain_rate)[..., None]
        F = self.slope.T @ (tension * s + moment * by_s) + self.bend.T @ (moment * by_c)
        out -= F.reshape(len(x), -1) @ self.scatter

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the dissipated power."""
        _, _, _, strain_rate, curvature_rate, _ = self._measures(x, u)
        lost = self.axial * strain_rate**2 + self.bending * curvature_rate**2
        return np.asarray(-lost.sum(axis=(-1, -2)))


@dataclass(frozen=True)
class ConstantForce(ForcePart):
    """Weight of bodies whose mass matrix is constant: one vector for all states (eq. 31)."""

    force: Array

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the constant vector."""
        out += self.force

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return minus the work of the force from the origin."""
        return np.asarray(-(x @ self.force))
