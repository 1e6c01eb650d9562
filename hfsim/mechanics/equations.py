"""Equations of motion with multipliers: M x'' + Phi_x^T lambda = f, Phi_x x'' = gamma (eq. 37).

Masses, constraints and forces are those of the coordinates x; solved are the free coordinates z of a
`Reduction`, so that only the constraints it has not taken care of need multipliers.  Small scenes are
solved with dense matrices for all states at once, large ones with sparse factors; state by state only where
the matrix depends on the state and joints depend on many coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array, slices
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import AT_ONCE, Matrix, SaddlePoints, dense, factorised, is_sparse, saddle_point
from hfsim.maths.traced import aside, outside
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.joint_rows import JointRows
from hfsim.mechanics.linearized import rows_of
from hfsim.mechanics.reduction import Reduction
from hfsim.mechanics.variable_mass import VariableMass

if TYPE_CHECKING:
    from hfsim.mechanics.condensed import Condensed
    from hfsim.mechanics.node_joints import NodeJoints
    from hfsim.mechanics.node_solution import NodeSolution

FEW = 60
"""Coordinates at joints up to which large scenes are solved by these; beyond, with the whole matrix."""
FEW_DENSE = 150
"""The same in small scenes, of several states, that are solved node by node; single ones always are."""
SEVERAL = 8
"""States from which on matrices of many joints are sparse also in small scenes."""
FEW_UNKNOWNS = 30
"""Unknowns up to which the whole matrix takes less time than one without what roots hold."""


class _Unconstrained:
    """Gives M^-1 f for forces (n_batch, n) and a constant mass matrix, with ballast.

    It holds no equations, since their solution by nodes holds it: memory would wait for the collector.
    """

    def __init__(self, mass: Matrix) -> None:
        self._mass = mass

    def __call__(self, f: Array) -> Array:
        """Return M^-1 f."""
        return outside(self._factor, f) if is_sparse(self._mass) else np.asarray(f @ self.inverse)

    @cached_property
    def _factor(self) -> Callable[[Array], Array]:
        return factorised(self._mass)

    @cached_property
    def inverse(self) -> Array:
        """Inverse of the constant blocks; zero in the rows of variable bodies."""
        constant = self._mass.any(axis=1)
        if constant.all():
            return np.asarray(np.linalg.inv(self._mass))
        inverse = np.zeros_like(self._mass)
        inverse[np.ix_(constant, constant)] = np.linalg.inv(self._mass[np.ix_(constant, constant)])
        return np.asarray(inverse)


@frozen
class Equations:
    """Mass and constraints of a scene, with a choice of free coordinates.

    Attributes
    ----------
    constant_mass : Matrix, shape (n_x, n_x)
        Zero in the rows of bodies with a variable mass matrix.
    reduction : Reduction
        Which of the constraints it eliminates is left out here.
    once : bool
        Factorise matrices that never change once; otherwise in every state, as if they did.
    ballast : Matrix, shape (n_x, n_x), or None
        What flat and slender bodies lack of a constant mass matrix with an inverse, on the diagonal of axes
        that they keep orthonormal.
    """

    constant_mass: Matrix
    variable_mass: tuple[VariableMass, ...]
    all_constraints: tuple[Constraint, ...]
    reduction: Reduction
    once: bool = True
    ballast: Matrix | None = None

    @cached_property
    def n(self) -> int:
        """Number of free coordinates."""
        return int(self.reduction.basis.shape[1])

    @cached_property
    def constraints(self) -> tuple[Constraint, ...]:
        """The constraints that need multipliers."""
        gone = self.reduction.eliminated
        return tuple(c for k, c in enumerate(self.all_constraints) if k not in gone)

    @cached_property
    def phi(self) -> JointRows:
        """Their equations."""
        return JointRows(self.constraints, len(self.reduction.offset), is_sparse(self.constant_mass))

    @property
    def rows(self) -> tuple[slice, ...]:
        """Rows of each constraint in Phi."""
        return self.phi.rows

    @property
    def n_rows(self) -> int:
        """Number of constraint equations."""
        return self.phi.n_rows

    # ------------------------------------------------------------------ mass

    @cached_property
    def free_mass(self) -> Matrix:
        """The constant mass matrix of the free coordinates."""
        return self.reduction.reduced(self.constant_mass)

    @cached_property
    def _weighted_mass(self) -> Matrix:
        """The same with ballast."""
        ballast = self.ballast
        return self.free_mass if ballast is None else self.free_mass + self.reduction.reduced(ballast)

    def metric(self, jacobian: Matrix | None) -> tuple[Matrix, Array | None]:
        """Return a matrix with an inverse that is the constant mass matrix on all that joints allow.

        Then motions of the free coordinates as rows, orthonormal in it; None if it is sparse.  ``jacobian``
        is Phi_z (n_rows, n) in some state: where mass is lacking, rows that keep axes stand in.
        """
        if self.ballast is None or jacobian is None:
            return self.free_mass, None if is_sparse(self.free_mass) else self._root
        metric = self.free_mass + (jacobian.T * self._stand_ins) @ jacobian
        return metric, None if is_sparse(metric) else rows_of(metric)

    @cached_property
    def _stand_ins(self) -> Array:
        """Mass that each row of Phi stands in for, shape (n_rows,)."""
        from hfsim.mechanics.orthonormal import Orthonormal

        assert self.ballast is not None
        found, lacking = np.zeros(self.n_rows), self.ballast.diagonal()
        for c, rows in zip(self.constraints, self.rows, strict=True):
            if isinstance(c, Orthonormal):
                found[rows] = lacking[c.axis_columns[0]]
        return found

    @cached_property
    def _root(self) -> Array:
        return rows_of(self.free_mass)

    def mass(self, x: Array) -> Array:
        """Return the mass matrix M_g of eq. (38), dense, shape (n_batch, n_x, n_x)."""
        constant = self.constant_mass.toarray() if is_sparse(self.constant_mass) else self.constant_mass
        M = np.repeat(constant[None], len(x), axis=0)
        for body in self.variable_mass:
            M[:, body.columns, body.columns] = body.mass(x)
        return M

    def mass_at(self, x: Array) -> Matrix:
        """Return the mass matrix in one state, sparse where matrices are, shape (n_x, n_x)."""
        return self.mass(x)[0] if self.variable_mass else self.constant_mass

    def free_mass_at(self, x: Array) -> Matrix:
        """Return that of the free coordinates, (n, n)."""
        return self.reduction.reduced(self.mass_at(x)) if self.variable_mass else self.free_mass

    def momentum(self, x: Array, u: Array) -> Array:
        """Return M_g u, shape (n_batch, n_x); one state may serve all rates."""
        p = np.asarray(u @ self.constant_mass)
        for body in self.variable_mass:
            own = u[:, body.columns]
            moved = body.momenta(x, own[None])[0] if len(x) == 1 else body.momenta(x, own[:, None])[:, 0]
            p[:, body.columns] += moved
        return p

    def kinetic_energy(self, x: Array, u: Array) -> Array:
        """Return the kinetic energy [J], shape (n_batch,)."""
        return np.asarray(0.5 * np.sum(self.momentum(x, u) * u, axis=-1))

    # ------------------------------------------------------------------ solution

    @property
    def _changes(self) -> bool:
        """Whether the mass matrix is treated as one that depends on the state."""
        return bool(self.variable_mass) or not self.once

    @cached_property
    def solution(self) -> Array | None:
        """Matrix W, shape (n_x, n), with z'' = f W, in small scenes whose matrices never change."""
        if self._changes or not self.phi.constant or is_sparse(self.constant_mass):
            return None
        inverse = self._unconstrained.inverse
        if self.constraints:
            rows = self.phi.at_joints(np.zeros((1, self.phi.n_x)))[0]
            Phi_z = rows @ self.reduction.basis[self.phi.support]
            Y = Phi_z @ inverse
            inverse = inverse - Y.T @ np.linalg.solve(Y @ Phi_z.T, Y)
        return np.asarray(self.reduction.basis @ inverse)

    def accelerations(self, t: Array, x: Array, u: Array, f: Array) -> Array:
        """Return z'' for forces f on x, shape (n_batch, n)."""
        if self.solution is not None:
            return np.asarray(f @ self.solution)
        return self.solve(t, x, u, f)[0]

    @property
    def balances(self) -> bool:
        """Whether `imbalance` is at hand: small scenes with a constant mass matrix."""
        return not self._changes and not is_sparse(self.constant_mass)

    def imbalance(self, t: Array, x: Array, u: Array, f: Array, az: Array) -> tuple[Array, Array]:
        """Return by how much accelerations (n_batch, n) of the free coordinates fail eq. (37).

        Returns
        -------
        forces : ndarray, shape (n_batch, n)
            f - M a - Phi_z^T lambda with the multipliers of the solution.
        gaps : ndarray, shape (n_batch, n_rows)
            gamma - Phi_z a.
        """
        forces = self.reduction.free_force(f) - az @ self.free_mass
        if not self.constraints:
            return forces, np.zeros((len(x), 0))
        if (nodes := self.by_nodes(len(x))) is not None:
            free = self.reduction.free_force(f)
            missing, gaps = nodes.missing(x, free, self.phi.curvature(t, x, u), az)
            return missing @ self.free_mass, gaps
        reading, mobility, spreading = self._at_joints
        J = self.phi.at_joints(x)
        gaps = self.phi.curvature(t, x, u) - (J @ (az @ reading)[..., None])[..., 0]
        free = (J @ (forces @ spreading.T)[..., None])[..., 0]
        multipliers = np.linalg.solve(J @ mobility @ J.swapaxes(1, 2), (free - gaps)[..., None])
        return forces - (multipliers.swapaxes(1, 2) @ J)[:, 0] @ reading.T, gaps

    def solve(self, t: Array, x: Array, u: Array, f: Array) -> tuple[Array, Array]:
        """Solve eq. (37).

        Returns
        -------
        accelerations : ndarray, shape (n_batch, n)
            Of the free coordinates.
        multipliers : ndarray, shape (n_batch, n_rows)

        Raises
        ------
        numpy.linalg.LinAlgError
            If the equations are singular in this state.
        """
        return self.constrained(x, self.reduction.free_force(f), self.phi.curvature(t, x, u))

    def constrained(self, x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Solve M a + Phi_z^T lambda = f, Phi_z a = gamma for the free coordinates, f (n_batch, n)."""
        if (nodes := self.by_nodes(len(x))) is not None:
            return nodes.solve(x, f, gamma)
        if is_sparse(self.constant_mass) and not self._few_joint_coordinates:
            return self._solve_sparse(x, f, gamma)
        if self._condensed is not None:
            return self._condensed.solve(x, f, gamma, self.phi.jacobians(x))
        if self._changes:
            return self._solve_whole(x, f, gamma)
        free = self._unconstrained(f)
        if not self.constraints:
            return free, gamma
        reading, mobility, spreading = self._at_joints
        J = self.phi.at_joints(x)
        gap = (J @ (free @ reading)[..., None])[..., 0] - gamma
        multipliers = np.linalg.solve(J @ mobility @ J.swapaxes(1, 2), gap[..., None])[..., 0]
        return free - (multipliers[:, None, :] @ J)[:, 0] @ spreading, multipliers

    def constrained_at(self, x: Array) -> Callable[[Array, Array], tuple[Array, Array]] | None:
        """Return `constrained` in states (n_batch, n_x), if for several forces and gammas that takes less."""
        nodes = self.by_nodes(len(x))
        return None if nodes is None else nodes.at(x)

    def by_nodes(self, count: int) -> NodeSolution | NodeJoints | None:
        """Return the solution node by node, where axes are kept orthonormal, for so many states."""
        several = count >= SEVERAL or is_sparse(self.constant_mass)
        return self._node_joints if several and self._node_joints is not None else self._node_solution

    @cached_property
    def _node_solution(self) -> NodeSolution | None:
        """The one with dense matrices of all joints."""
        found = self._nodes
        many = found is not None and len(found.joints.support) > FEW
        return None if many and is_sparse(self.constant_mass) else found

    @cached_property
    def _node_joints(self) -> NodeJoints | None:
        """The one with sparse matrices of joints, where they depend on many coordinates."""
        found, few = self._nodes, FEW if is_sparse(self.constant_mass) else FEW_DENSE
        if found is None or len(found.joints.support) <= few:
            return None
        from hfsim.mechanics.node_joints import NodeJoints

        return NodeJoints.of(found, self._weighted_mass)

    @cached_property
    def _nodes(self) -> NodeSolution | None:
        if self.phi.constant or self._changes:
            return None
        from hfsim.mechanics.node_solution import NodeSolution

        masses = self.constant_mass, self.ballast
        return NodeSolution.of(self.phi, *masses, self.reduction, self._unconstrained)

    @cached_property
    def _condensed(self) -> Condensed | None:
        """The solution without what roots hold, where mass matrices depend on the state."""
        if not self.variable_mass or self.n + self.n_rows <= FEW_UNKNOWNS:
            return None
        from hfsim.mechanics.condensed import Condensed

        return Condensed.of(self.variable_mass, self.phi, self.constant_mass, self.reduction)

    @cached_property
    def _few_joint_coordinates(self) -> bool:
        """Whether joints are best solved with the few coordinates they depend on, in a large scene."""
        return self.once and len(self.phi.support) <= FEW

    @cached_property
    def _unconstrained(self) -> _Unconstrained:
        return _Unconstrained(self._weighted_mass)

    @cached_property
    def _at_joints(self) -> tuple[Array, Array, Array]:
        """Constant matrices between the free coordinates and those at the joints.

        From free coordinates to those at the joints (n, k); what unit forces there accelerate there
        (k, k), and everywhere (k, n).
        """
        rows = dense(self.reduction.basis[self.phi.support])
        spreading = self._unconstrained(rows)
        return np.ascontiguousarray(rows.T), spreading @ rows.T, spreading

    def _solve_whole(self, x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        """Solve with the whole matrix of eq. (37): a mass matrix may be indefinite where joints hold it."""
        n, m, B = self.n, self.n_rows, self.reduction.basis
        M, Phi_z = self.mass(x), self.phi.jacobians(x)
        if not self.reduction.identity:
            M, Phi_z = B.T @ M @ B, Phi_z @ B
        matrix = np.zeros((len(x), n + m, n + m))
        matrix[:, :n, :n] = M
        matrix[:, n:, :n] = Phi_z
        matrix[:, :n, n:] = Phi_z.swapaxes(1, 2)
        solution = np.linalg.solve(matrix, np.concatenate([f, gamma], axis=1)[..., None])[..., 0]
        return solution[:, :n], solution[:, n:]

    @cached_property
    def _constant_factor(self) -> Callable[[Array], Array]:
        """Factor of the whole matrix where it never changes."""
        return self._factor_at(np.zeros((1, self.phi.n_x)))

    def _solve_sparse(self, x: Array, f: Array, gamma: Array) -> tuple[Array, Array]:
        rhs = np.concatenate([f, gamma], axis=1)
        if self.phi.constant and self.once:
            solution = outside(self._constant_factor, rhs)
        else:
            parts = slices(len(x), AT_ONCE // rhs.shape[1])
            solution = np.concatenate([self._together(x[some], rhs[some]) for some in parts])
        return solution[:, : self.n], solution[:, self.n :]

    def _together(self, x: Array, rhs: Array) -> Array:
        """Return the solutions of several states by one factorisation."""
        border = self.reduction.free_entries(self.phi.entries(x))
        if "_saddle_points" not in self.__dict__:  # entries have the same places in every state
            self.__dict__["_saddle_points"] = SaddlePoints(self.free_mass, border, self.n_rows)
        points: SaddlePoints = self.__dict__["_saddle_points"]
        solution = np.zeros_like(rhs)
        aside(points.solve, border.values, rhs, solution)
        return solution

    def _factor_at(self, x: Array) -> Callable[[Array], Array]:
        """Factor of the whole matrix in one state (1, n_x)."""
        if not self.constraints:
            return factorised(self.free_mass)
        return factorised(saddle_point(self.free_mass, self.phi.jacobian_at(x) @ self.reduction.basis))
