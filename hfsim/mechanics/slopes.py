"""Derivatives of the accelerations by positions and velocities, of many states at once.

Joints whose rows are products, Phi_x = C + H x with H constant, give them in closed form,

    M da + Phi_x^T dl = df - (l H) dx ,   Phi_x da = -H(a) dx - 2 H(v) dv ,

the inertia forces of spinning bodies included.  The mass alone may be singular.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, assemble, is_sparse
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.linearized import Linearized

if TYPE_CHECKING:
    from hfsim.mechanics.system import System

_Tangent = Callable[[Array, Array, Array], Entries]

MOST = 80
"""Coordinates up to which they are computed: dense matrices serve up to here."""


FEW = 24
"""Coordinates up to which they may pay at every stage of every step."""


@frozen
class Slopes:
    """Derivatives of the accelerations of a system whose state are coordinates of vectors.

    Attributes
    ----------
    start : (q, v)
        The state (n,) that tells whether bodies spin.
    """

    system: System
    start: tuple[Array, Array]

    @classmethod
    def of(cls, system: System, start: tuple[Array, Array]) -> Slopes | None:
        """Return them where joints are products and matrices dense; None elsewhere."""
        equations = system.equations
        if system.charts or system.variable_mass or is_sparse(equations.constant_mass) or system.n > MOST:
            return None
        if equations.phi.constant or not equations.phi.are_products:
            return None
        return cls(system, start)

    @cached_property
    def rows(self) -> Array:
        """Return Phi_z where the free coordinates are zero, shape (n_rows, n)."""
        reduction = self.system.reduction
        return np.asarray(self.system.equations.phi.jacobians(reduction.offset[None])[0] @ reduction.basis)

    @cached_property
    def bend(self) -> Array:
        """Return the derivative of Phi_z, the same in every state, shape (n_rows, n, n)."""
        B = self.system.reduction.basis
        return np.asarray(B.T @ self.system.equations.phi.bend() @ B)

    @cached_property
    def pays(self) -> bool:
        """Whether they pay: few coordinates, forces that do not change, and bodies that spin at the start."""
        if self.system.n > FEW:
            return False
        state = np.zeros(1), np.zeros((1, self.system.n_x)), np.zeros((1, self.system.n_x))
        if any(part.uses_rates or part.tangent(*state).values.size for part in self.system.together):
            return False
        _, by_q, by_v = self(np.zeros(1), *(one[None] for one in self.start))
        # a spin w makes them w^2 and 2 w, what swings by its weight less of the second
        return float(np.abs(by_v).max()) ** 2 > float(np.abs(by_q).max())

    def __call__(self, t: Array, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return the accelerations and their derivatives by q and v.

        Parameters
        ----------
        t : ndarray, shape (n_batch,)
        q, v : ndarray, shape (n_batch, n)

        Returns
        -------
        a : ndarray, shape (n_batch, n)
        by_q, by_v : ndarray, shape (n_batch, n, n)
        """
        system, (m, n, _) = self.system, self.bend.shape
        equations, x, u = system.equations, system.absolute(q), system.absolute_velocity(q, v)
        a, multipliers = equations.solve(t, x, u, system.force(t, x, u))
        bent = (np.concatenate([q, a, v]) @ self.bend.reshape(m * n, n).T).reshape(3, len(q), m, n)
        matrix = np.zeros((len(q), n + m, n + m))
        matrix[:, :n, :n] = equations.free_mass
        matrix[:, n:, :n] = self.rows + bent[0]
        matrix[:, :n, n:] = matrix[:, n:, :n].swapaxes(1, 2)
        sides = np.zeros((len(q), n + m, 2 * n))
        sides[:, :n, :n] = -(multipliers @ self.bend.reshape(m, n * n)).reshape(-1, n, n)
        sides[:, :n, :n] -= self._stiffness(t, x, u, lambda part: part.tangent)
        if system.uses_rates and any(part.uses_rates for part in system.together):
            sides[:, :n, n:] = -self._stiffness(t, x, u, lambda part: part.rate_tangent)
        sides[:, n:, :n], sides[:, n:, n:] = -bent[1], -2.0 * bent[2]
        slopes = np.linalg.solve(matrix, sides)[:, :n]
        return a, slopes[..., :n], slopes[..., n:]

    def linearized(self, t: float, q: Array, v: Array) -> Linearized:
        """Return the equations, solved for the accelerations, linearised at a state (n,)."""
        _, by_q, by_v = self(np.array([t]), q[None], v[None])
        unit = np.eye(len(q))
        return Linearized(unit, -by_q[0], -by_v[0], None, None, unit)

    def _stiffness(self, t: Array, x: Array, u: Array, of: Callable[[ForcePart], _Tangent]) -> Array:
        """Return what forces lose with the free coordinates or their rates, (n_batch or 1, n, n)."""
        states = [(t[k : k + 1], x[k : k + 1], u[k : k + 1]) for k in range(len(t))]
        if not any(of(part)(*states[0]).values.size for part in self.system.together):
            return np.zeros((1, *self.bend.shape[1:]))
        parts = ([of(part)(*one) for part in self.system.together] for one in states)
        whole = (assemble(some, (x.shape[1], x.shape[1]), False) for some in parts)
        return np.array([self.system.reduction.reduced(one) for one in whole])
