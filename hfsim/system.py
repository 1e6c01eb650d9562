"""The system: parts, mass and constraints put together (paper, section 4).

Two sets of coordinates, equal in number.  The *state* q, v = q' is what is integrated and reported:
hybrid coordinates for the models with a body frame.  The *absolute* coordinates x(q) are what the
parts are written in; there the mass matrix of most bodies is constant, so that

    M x'' + Phi_x^T lambda = f,   Phi_x x'' = gamma        (eq. 37)

costs a few products with matrices factorised once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from hfsim.arrays import Array
from hfsim.constraints import Constraint
from hfsim.errors import SolverFailure
from hfsim.models.frame import FrameChart, Frames
from hfsim.models.natural import NaturalIncrements
from hfsim.parts import ForcePart

NEARLY_SINGULAR = 0.2
"""Smallest eigenvalue of the mass matrix, relative to the undeformed scene's, below which a failure is put
down to it."""


class VariableMass(Protocol):
    """A body whose mass matrix depends on its coordinates."""

    @property
    def name(self) -> str:
        """Name in the deck."""

    @property
    def model(self) -> str:
        """Name of its model."""

    @property
    def columns(self) -> slice:
        """Its coordinates in x."""

    @property
    def truncated(self) -> bool:
        """Whether its inertia force leaves out terms, so that it does not keep the energy."""

    def mass(self, x: Array) -> Array:
        """Return the mass matrix, shape (n_batch, n_columns, n_columns)."""


@dataclass(frozen=True)
class System:
    """Everything that the equations of motion of a scene are made of.

    Attributes
    ----------
    n : int
        Number of coordinates.
    charts : tuple of FrameChart
        Where state and absolute coordinates differ.
    constant_mass : ndarray, shape (n, n)
        Zero in the rows of bodies with a variable mass matrix.
    variable_mass : tuple of VariableMass
    forces : tuple of ForcePart
    constraints : tuple of Constraint
    natural : NaturalIncrements
        Coordinates for Newton corrections of the state.
    """

    n: int
    charts: tuple[FrameChart, ...]
    constant_mass: Array
    variable_mass: tuple[VariableMass, ...]
    forces: tuple[ForcePart, ...]
    constraints: tuple[Constraint, ...]
    natural: NaturalIncrements

    # ------------------------------------------------------------------ coordinates

    def frames(self, q: Array) -> list[Frames]:
        """Return the body frames of each chart; what the maps below have in common."""
        return [chart.frames(q) for chart in self.charts]

    def absolute(self, q: Array, frames: list[Frames] | None = None) -> Array:
        """Return the absolute coordinates x(q), shape (n_batch, n)."""
        frames = self.frames(q) if frames is None else frames
        return self._charted(q, [c.absolute(f) for c, f in zip(self.charts, frames, strict=True)])

    def absolute_velocity(self, q: Array, v: Array, frames: list[Frames] | None = None) -> Array:
        """Return the rates of the absolute coordinates."""
        frames = self.frames(q) if frames is None else frames
        return self._charted(v, [c.absolute_velocity(f, v) for c, f in zip(self.charts, frames, strict=True)])

    def relative_acceleration(self, frames: list[Frames], v: Array, ax: Array) -> Array:
        """Return q'' that belongs to absolute accelerations."""
        parts = zip(self.charts, frames, strict=True)
        return self._charted(ax, [c.relative_acceleration(f, v, ax) for c, f in parts])

    def state(self, x: Array, u: Array, near: Array) -> tuple[Array, Array]:
        """Return (q, v) of absolute coordinates and rates; frame angles are taken near those of ``near``."""
        q = self._charted(x, [chart.hybrid(x, near) for chart in self.charts])
        frames = self.frames(q)
        v = self._charted(u, [c.hybrid_velocity(f, u) for c, f in zip(self.charts, frames, strict=True)])
        return q, v

    def _charted(self, given: Array, blocks: list[Array]) -> Array:
        """Return ``given`` with the columns of the charts replaced."""
        if not blocks:
            return given
        if blocks[0].shape == given.shape:
            return blocks[0]
        out = given.copy()
        for chart, block in zip(self.charts, blocks, strict=True):
            out[:, chart.columns] = block
        return out

    # ------------------------------------------------------------------ forces and energies

    @cached_property
    def uses_rates(self) -> bool:
        """Whether forces or constraints need the rates u."""
        return any(f.uses_rates for f in self.forces) or not self._constraints_constant

    @cached_property
    def dissipates(self) -> bool:
        """Whether stiff methods need the derivative of the forces by the rates."""
        return any(f.dissipates for f in self.forces)

    @cached_property
    def exchanges_power(self) -> bool:
        """Whether energy can enter or leave: loads, dampers, drivers."""
        return any(f.exchanges_power for f in self.forces) or any(c.driven for c in self.constraints)

    def force(self, t: Array, x: Array, u: Array) -> Array:
        """Return the generalised force of all parts, shape (n_batch, n)."""
        f = np.zeros_like(x)
        for part in self.forces:
            part.add_force(t, x, u, f)
        return f

    def kinetic_energy(self, x: Array, u: Array) -> Array:
        """Return the kinetic energy [J], shape (n_batch,)."""
        energy = 0.5 * np.sum((u @ self.constant_mass) * u, axis=-1)
        for body in self.variable_mass:
            w = u[:, body.columns]
            energy += 0.5 * np.einsum("bi,bij,bj->b", w, body.mass(x), w)
        return np.asarray(energy)

    def strain_energy(self, x: Array) -> Array:
        """Return the strain energy of all bodies [J], shape (n_batch,)."""
        return np.asarray(sum((f.strain_energy(x) for f in self.forces), np.zeros(len(x))))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy of weight and springs [J], shape (n_batch,)."""
        return np.asarray(sum((f.potential_energy(t, x) for f in self.forces), np.zeros(len(x))))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power put in by loads, dampers and drivers [W], shape (n_batch,)."""
        power = np.asarray(sum((f.power(t, x, u) for f in self.forces), np.zeros(len(x))))
        if not any(c.driven for c in self.constraints):
            return power
        rate = self.constraint_rate(t)
        _, multipliers = self.solve(t, x, u, self.force(t, x, u))
        return np.asarray(power + np.sum(multipliers * rate, axis=-1))

    # ------------------------------------------------------------------ constraints

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Rows of each constraint in Phi."""
        ends = np.cumsum([0] + [c.rows for c in self.constraints])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def n_rows(self) -> int:
        """Number of constraint equations."""
        return sum(c.rows for c in self.constraints)

    @cached_property
    def _constraints_constant(self) -> bool:
        return all(c.constant for c in self.constraints)

    def residual(self, t: Array, x: Array) -> Array:
        """Return Phi, shape (n_batch, n_rows)."""
        if self._constraints_constant:
            return np.asarray(x @ self._constant_jacobian[0].T + self._offset)
        return self._stack(len(x), lambda c: c.residual(t, x))

    @cached_property
    def _offset(self) -> Array:
        """Residual of linear constraints at the origin of the coordinates."""
        return self._stack(1, lambda c: c.residual(np.zeros(1), np.zeros((1, self.n))))

    def drift(self, t: Array, x: Array, u: Array) -> Array:
        """Return Phi' = Phi_x u + Phi_t, shape (n_batch, n_rows)."""
        if self._constraints_constant:
            return np.asarray(u @ self._constant_jacobian[0].T)
        return np.asarray((self.jacobian(x) @ u[..., None])[..., 0] + self.constraint_rate(t))

    def constraint_rate(self, t: Array) -> Array:
        """Return Phi_t, shape (n_batch, n_rows)."""
        return self._stack(len(t), lambda c: c.rate(t))

    def _stack(self, n_batch: int, rows_of: Callable[[Constraint], Array]) -> Array:
        out = np.zeros((n_batch, self.n_rows))
        for constraint, rows in zip(self.constraints, self.rows, strict=True):
            out[:, rows] = rows_of(constraint)
        return out

    def jacobian(self, x: Array) -> Array:
        """Return Phi_x, shape (n_batch, n_rows, n); one matrix where it is the same for all states."""
        return self._constant_jacobian if self._constraints_constant else self._assembled_jacobian(x)

    @cached_property
    def _constant_jacobian(self) -> Array:
        return self._assembled_jacobian(np.zeros((1, self.n)))

    def _assembled_jacobian(self, x: Array) -> Array:
        Phi_x = np.repeat(self._constant_rows, len(x), axis=0)
        for constraint, rows in self._changing:
            self._add_rows(constraint, rows, x, Phi_x)
        return Phi_x

    @cached_property
    def _changing(self) -> tuple[tuple[Constraint, slice], ...]:
        """Constraints whose Jacobian depends on the state, with their rows."""
        pairs = zip(self.constraints, self.rows, strict=True)
        return tuple((c, rows) for c, rows in pairs if not c.constant)

    @cached_property
    def _constant_rows(self) -> Array:
        Phi_x = np.zeros((1, self.n_rows, self.n))
        for constraint, rows in zip(self.constraints, self.rows, strict=True):
            if constraint.constant:
                self._add_rows(constraint, rows, np.zeros((1, self.n)), Phi_x)
        return Phi_x

    def _add_rows(self, constraint: Constraint, rows: slice, x: Array, Phi_x: Array) -> None:
        first, second = constraint.jacobians(x)
        Phi_x[:, rows, constraint.first.columns] += first
        Phi_x[:, rows, constraint.second.columns] += second

    # ------------------------------------------------------------------ equations of motion

    @cached_property
    def _inverse_mass(self) -> Array:
        """Inverse of the constant mass blocks; zero in the rows of variable bodies."""
        free = self.constant_mass.any(axis=1)
        inverse = np.zeros_like(self.constant_mass)
        inverse[np.ix_(free, free)] = np.linalg.inv(self.constant_mass[np.ix_(free, free)])
        return inverse

    @cached_property
    def _constant_solution(self) -> Array | None:
        """Matrix W with x'' = f W, if neither the mass nor the constraint Jacobian ever changes."""
        if self.variable_mass or not self._constraints_constant:
            return None
        Phi_x = self._constant_jacobian[0]
        Y = Phi_x @ self._inverse_mass
        return np.asarray(self._inverse_mass - Y.T @ np.linalg.solve(Y @ Phi_x.T, Y))

    def mass(self, x: Array) -> Array:
        """Return the mass matrix M_g of eq. (38), shape (n_batch, n, n)."""
        M = np.repeat(self.constant_mass[None], len(x), axis=0)
        for body in self.variable_mass:
            M[:, body.columns, body.columns] = body.mass(x)
        return M

    def solve(self, t: Array, x: Array, u: Array, f: Array) -> tuple[Array, Array]:
        """Solve eq. (37).

        Returns
        -------
        accelerations : ndarray, shape (n_batch, n)
        multipliers : ndarray, shape (n_batch, n_rows)

        Raises
        ------
        numpy.linalg.LinAlgError
            If the equations are singular in this state.
        """
        gamma = np.zeros((len(x), self.n_rows))
        for constraint, rows in self._changing:
            gamma[:, rows] = constraint.acceleration(t, x, u)
        return self._constrained(x, self.jacobian(x), f, gamma)

    def _constrained(self, x: Array, Phi_x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Solve M a + Phi_x^T lambda = f, Phi_x a = gamma."""
        if self.variable_mass:
            return self._solve_whole(x, Phi_x, f, gamma)
        free = f @ self._inverse_mass
        if not self.constraints:
            return free, gamma
        Y = Phi_x @ self._inverse_mass
        gap = (Phi_x @ free[..., None])[..., 0] - gamma
        multipliers = np.linalg.solve(Y @ Phi_x.swapaxes(1, 2), gap[..., None])[..., 0]
        return free - (multipliers[:, None, :] @ Y)[:, 0], multipliers

    def _solve_whole(self, x: Array, Phi_x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Solve with the whole matrix of eq. (37): a mass matrix may be indefinite where joints hold it."""
        n, m = self.n, self.n_rows
        matrix = np.zeros((len(x), n + m, n + m))
        matrix[:, :n, :n] = self.mass(x)
        matrix[:, n:, :n] = Phi_x
        matrix[:, :n, n:] = Phi_x.swapaxes(1, 2)
        solution = np.linalg.solve(matrix, np.concatenate([f, gamma], axis=1)[..., None])[..., 0]
        return solution[:, :n], solution[:, n:]

    def acceleration(self, t: Array, q: Array, v: Array) -> Array:
        """Return q'' for a batch of states: the one operation that carries every integrator.

        Parameters
        ----------
        t : ndarray, shape (n_batch,)
        q, v : ndarray, shape (n_batch, n)

        Returns
        -------
        ndarray, shape (n_batch, n)
        """
        frames = self.frames(q)
        x = self.absolute(q, frames)
        u = self.absolute_velocity(q, v, frames) if self.uses_rates else v
        f = self.force(t, x, u)
        constant = self._constant_solution
        ax = f @ constant if constant is not None else self.solve(t, x, u, f)[0]
        return self.relative_acceleration(frames, v, ax)

    # ------------------------------------------------------------------ trust in a state

    def admissible(self, q: Array) -> bool:
        """Whether the mass matrix is positive definite for all motions that the joints allow, in q (n,)."""
        return not self.variable_mass or self._smallest_inertia(q)[0] > 0.0

    def breakdown(self, t: float, q: Array) -> SolverFailure | None:
        """Return why no step leads on from a state (n,), if the mass matrix has become nearly singular."""
        if not self.variable_mass:
            return None
        size, motion = self._smallest_inertia(q)
        if size > NEARLY_SINGULAR * self._smallest_inertia(np.zeros_like(q))[0]:
            return None
        body = max(self.variable_mass, key=lambda one: float(np.sum(motion[one.columns] ** 2)))
        return SolverFailure(
            reason=f"the mass matrix of body '{body.name}' in model {body.model} stops being positive "
            f"definite at t = {t:.4g} s: the terms the model leaves out are no longer small",
            time=t,
            item=f"bodies.{body.name}",
            kind="model",
            evidence={"smallest_eigenvalue": size},
        )

    def _smallest_inertia(self, q: Array) -> tuple[float, Array]:
        """Return the smallest eigenvalue of the mass matrix among allowed motions, and that motion.

        Coordinates are scaled so that the undeformed mass matrix has a unit diagonal.
        """
        x = self.absolute(q[None])
        scale = 1.0 / np.sqrt(np.diag(self.mass(np.zeros_like(x))[0]))
        M = self.mass(x)[0] * np.outer(scale, scale)
        Z = np.eye(self.n)
        if self.constraints:
            Z = np.linalg.qr((self.jacobian(x)[0] * scale).T, mode="complete")[0][:, self.n_rows :]
        sizes, motions = np.linalg.eigh(Z.T @ M @ Z)
        return float(sizes[0]), Z @ motions[:, 0]

    # ------------------------------------------------------------------ projection

    def project(self, t: Array, q: Array, v: Array, tolerance: float = 1e-13) -> tuple[Array, Array]:
        """Move states onto the constraints, at position and velocity level, in the metric of the mass.

        Parameters
        ----------
        t : ndarray, shape (n_batch,)
        q, v : ndarray, shape (n_batch, n)
        tolerance : float
            Largest violation left, relative to the largest coordinate (or 1).
        """
        if not self.constraints:
            return q, v
        frames = self.frames(q)
        x, u = self.absolute(q, frames), self.absolute_velocity(q, v, frames)
        moved = False
        for _ in range(8):
            gap = self.residual(t, x)
            if _largest(gap) <= tolerance * max(1.0, _largest(x)):
                break
            x, moved = x - self._correction(x, gap), True
        drift = self.drift(t, x, u)
        if _largest(drift) > tolerance * max(1.0, _largest(u)):
            u, moved = u - self._correction(x, drift), True
        return self.state(x, u, q) if moved else (q, v)

    def _correction(self, x: Array, gap: Array) -> Array:
        """Return the smallest move, measured by the mass matrix, that changes Phi by ``gap``."""
        return self._constrained(x, self.jacobian(x), np.zeros_like(x), gap)[0]


def _largest(a: Array) -> float:
    return float(np.abs(a).max(initial=0.0))
