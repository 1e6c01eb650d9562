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
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hfsim.constraints import Constraint
from hfsim.errors import SolverFailure
from hfsim.models.frame import FrameChart, Frames
from hfsim.parts import ForcePart

Array = NDArray[np.float64]


class VariableMass(Protocol):
    """A body whose mass matrix depends on its coordinates."""

    name: str
    model: str
    columns: slice

    def mass(self, x: Array) -> Array:
        """Return the mass matrix, shape (n_batch, n_columns, n_columns)."""

    def smallest_inertia(self, x: Array) -> float:
        """Return the smallest eigenvalue of the mass matrix relative to the undeformed body's."""


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
    """

    n: int
    charts: tuple[FrameChart, ...]
    constant_mass: Array
    variable_mass: tuple[VariableMass, ...]
    forces: tuple[ForcePart, ...]
    constraints: tuple[Constraint, ...]

    # ------------------------------------------------------------------ coordinates

    def frames(self, q: Array) -> list[Frames]:
        """Return the body frames of each chart; what the maps below have in common."""
        return [chart.frames(q) for chart in self.charts]

    def absolute(self, q: Array, frames: list[Frames] | None = None) -> Array:
        """Return the absolute coordinates x(q), shape (n_batch, n)."""
        if not self.charts:
            return q
        x = q.copy()
        for chart, frame in zip(self.charts, frames or self.frames(q), strict=True):
            chart.absolute(frame, q, x)
        return x

    def absolute_velocity(self, q: Array, v: Array, frames: list[Frames] | None = None) -> Array:
        """Return the rates of the absolute coordinates."""
        if not self.charts:
            return v
        u = v.copy()
        for chart, frame in zip(self.charts, frames or self.frames(q), strict=True):
            chart.absolute_velocity(frame, v, u)
        return u

    def state(self, x: Array, u: Array, near: Array) -> tuple[Array, Array]:
        """Return (q, v) of absolute coordinates and rates; frame angles are taken near those of ``near``."""
        if not self.charts:
            return x, u
        q, v = x.copy(), u.copy()
        for chart in self.charts:
            chart.hybrid(x, near, q)
        for chart, frame in zip(self.charts, self.frames(q), strict=True):
            chart.hybrid_velocity(frame, u, v)
        return q, v

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
        return tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True))

    @property
    def n_rows(self) -> int:
        """Number of constraint equations."""
        return sum(c.rows for c in self.constraints)

    @cached_property
    def _constraints_constant(self) -> bool:
        return all(c.constant for c in self.constraints)

    def residual(self, t: Array, x: Array) -> Array:
        """Return Phi, shape (n_batch, n_rows)."""
        return self._stack(len(x), lambda c: c.residual(t, x))

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
        Phi_x = np.zeros((1 if self._constraints_constant else len(x), self.n_rows, self.n))
        for constraint, rows in zip(self.constraints, self.rows, strict=True):
            first, second = constraint.jacobians(x)
            Phi_x[:, rows, constraint.first.columns] += first
            Phi_x[:, rows, constraint.second.columns] += second
        return Phi_x

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
        Phi_x = self.jacobian(np.zeros((1, self.n)))[0]
        Y = Phi_x @ self._inverse_mass
        return np.asarray(self._inverse_mass - Y.T @ np.linalg.solve(Y @ Phi_x.T, Y))

    def _divide_by_mass(self, x: Array, rows: Array) -> Array:
        """Return rows M^-1 for ``rows`` of shape (n_batch or 1, m, n)."""
        out = rows @ self._inverse_mass
        for body in self.variable_mass:
            if len(out) < len(x):
                out = np.repeat(out, len(x), axis=0)
            part = np.broadcast_to(rows[..., body.columns], (len(x), rows.shape[1], body.columns.stop - body.columns.start))
            out[..., body.columns] = np.linalg.solve(body.mass(x), part.swapaxes(1, 2)).swapaxes(1, 2)
        return np.asarray(out)

    def solve(self, t: Array, x: Array, u: Array, f: Array) -> tuple[Array, Array]:
        """Solve eq. (37).

        Returns
        -------
        accelerations : ndarray, shape (n_batch, n)
        multipliers : ndarray, shape (n_batch, n_rows)

        Raises
        ------
        numpy.linalg.LinAlgError
            If a mass matrix or the constraints are singular in this state.
        """
        free = self._divide_by_mass(x, f[:, None, :])[:, 0]
        if not self.constraints:
            return free, np.zeros((len(x), 0))
        Phi_x = self.jacobian(x)
        gamma = self._stack(len(x), lambda c: c.acceleration(t, x, u))
        Y = self._divide_by_mass(x, Phi_x)
        S = Y @ Phi_x.swapaxes(1, 2)
        gap = (Phi_x @ free[..., None])[..., 0] - gamma
        multipliers = np.linalg.solve(S, gap[..., None])[..., 0]
        return free - (multipliers[:, None, :] @ Y)[:, 0], multipliers

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
        if not self.charts:
            return ax
        a = ax.copy()
        for chart, frame in zip(self.charts, frames, strict=True):
            chart.relative_acceleration(frame, v, ax, a)
        return a

    # ------------------------------------------------------------------ trust in a state

    def verify(self, t: float, q: Array) -> None:
        """Check that a state can be trusted.

        Raises
        ------
        SolverFailure
            If a mass matrix is no longer positive definite.
        """
        for body in self.variable_mass:
            if body.smallest_inertia(q[None]) <= 0.0:
                raise self._broken_mass(body, t)

    def explained(self, failure: SolverFailure, q: Array) -> SolverFailure:
        """Return a failure with its cause, if the last good state shows one."""
        for body in self.variable_mass:
            if body.smallest_inertia(q[None]) < 1e-2:
                return self._broken_mass(body, failure.time)
        return failure

    def _broken_mass(self, body: VariableMass, t: float) -> SolverFailure:
        return SolverFailure(
            reason=f"the mass matrix of body '{body.name}' in model {body.model} stops being positive "
            f"definite at t = {t:.4g} s: the terms it leaves out are no longer small",
            time=t,
            item=f"bodies.{body.name}",
            kind="model",
        )

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
        x, u = self.absolute(q), self.absolute_velocity(q, v)
        moved = False
        for _ in range(8):
            gap = self.residual(t, x)
            if np.abs(gap).max(initial=0.0) <= tolerance * max(1.0, np.abs(x).max()):
                break
            x, moved = x - self._correction(x, gap), True
        drift = (self.jacobian(x) @ u[..., None])[..., 0] + self.constraint_rate(t)
        if np.abs(drift).max(initial=0.0) > tolerance * max(1.0, np.abs(u).max()):
            u, moved = u - self._correction(x, drift), True
        return self.state(x, u, q) if moved else (q, v)

    def _correction(self, x: Array, gap: Array) -> Array:
        """Return the smallest move, measured by the mass matrix, that changes Phi by ``gap``."""
        Phi_x = self.jacobian(x)
        Y = self._divide_by_mass(x, Phi_x)
        factor = np.linalg.solve(Y @ Phi_x.swapaxes(1, 2), gap[..., None])
        return np.asarray((Y.swapaxes(1, 2) @ factor)[..., 0])
