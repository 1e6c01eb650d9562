"""What holds joint equations that others make superfluous, in the search for a place of rest alone."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, is_sparse
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.joint_rows import JointRows
from hfsim.mechanics.system import System

FIRM = 1e9
"""Its stiffness, in the units of a gauge, over the largest force at the start."""


@frozen
class Closing(ForcePart):
    """Springs in place of equations that are left out.

    On the way of the joints they stay as they are.  Where a rest lies just where the joints lose their rank,
    the equations that are left out count, and no others keep the joints together.

    Attributes
    ----------
    phi : JointRows
    stiffness : ndarray, shape (n_rows,)
    """

    phi: JointRows
    stiffness: Array

    @classmethod
    def of(cls, system: System, t: Array, x: Array, unit: Array) -> Closing | None:
        """Return what holds redundant equations of a system, firm against forces in a state (1, n_x).

        ``unit`` is that of a `Gauge`, (n_x,).
        """
        if not system.redundant:
            return None
        phi = JointRows(system.redundant, system.n_x, is_sparse(system.equations.constant_mass))
        push = float(np.abs(unit * system.force(t, x, np.zeros_like(x))).max())
        opened = np.abs(phi.at_joints(x)[0] * unit[phi.support]).max(axis=1)
        return cls(phi, FIRM * (push or 1.0) / opened**2)

    @property
    def support(self) -> IntArray:
        """Coordinates at these joints."""
        return self.phi.support

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add what closes the gaps."""
        gap = self.phi.residual(t, x)
        out[:, self.support] -= ((self.stiffness * gap)[:, None] @ self.phi.at_joints(x))[:, 0]

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of that."""
        pull, J = self.stiffness * self.phi.residual(t, x), self.phi.at_joints(x)[0]
        along = Entries.of_block(self.support, self.support, J.T * self.stiffness @ J)
        return Entries.joined([along, *self.phi.stiffness(x, pull)])
