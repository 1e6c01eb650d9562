"""Forces that are stiffness times strain, with the strains as variables of their own.

A stiff body answers a small error of its coordinates with a large force, which turns with it: with one
derivative for many states that force would push soft motions too, and Newton's iteration would fail at all
but the shortest steps.  With strains that are *expected*, those to which the last correction was to lead, the
force is one that the motion needs; what the coordinates miss of these strains is corrected like the gap of a
joint (mixed integration points; Magisano, Leonetti, Garcea, Computer Methods in Applied Mechanics and
Engineering 318, 2017).  Where the iteration ends both are the same, and so is the motion.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, is_sparse
from hfsim.mechanics.force import ForcePart

if TYPE_CHECKING:
    from hfsim.mechanics.system import System


@frozen
class Strains:
    """All strains of a system on which its forces depend through a stiffness.

    Attributes
    ----------
    system : System
        Whose state are coordinates with a constant mass matrix.
    parts : tuple of ForcePart
        Those of its forces that have strains.
    """

    system: System
    parts: tuple[ForcePart, ...]

    @classmethod
    def of(cls, system: System) -> Strains | None:
        """Return those of a system; None if there are none or its mass matrix changes."""
        parts = tuple(part for part in system.forces if part.strain_stiffness.size)
        return cls(system, parts) if parts and system.linearizes else None

    @cached_property
    def stiffness(self) -> Array:
        """What each strain is multiplied by, shape (n_strains,)."""
        return np.concatenate([part.strain_stiffness for part in self.parts])

    @property
    def count(self) -> int:
        """Number of strains."""
        return len(self.stiffness)

    def seen(self, q: Array) -> Array:
        """Return the strains of states (n_batch, n), shape (n_batch, n_strains)."""
        x = self.system.absolute(q)
        return np.concatenate([part.strain(x) for part in self.parts], axis=1)

    def slopes(self, q: Array) -> Matrix:
        """Return their derivative by the coordinates of one state (n,), shape (n_strains, n)."""
        x, first, found = self.system.absolute(q[None]), 0, list[Entries]()
        for part in self.parts:
            own = part.strain_slopes(x)
            found.append(own._replace(rows=own.rows + first))
            first += len(part.strain_stiffness)
        sparse = is_sparse(self.system.equations.constant_mass)
        return assemble(found, (self.count, x.shape[1]), sparse) @ self.system.reduction.basis

    def expected(self, strains: Array) -> System:
        """Return the system in which the forces are those of given strains, (n_batch or 1, n_strains)."""
        ends = np.cumsum([len(part.strain_stiffness) for part in self.parts])
        own = iter(np.split(strains, ends[:-1], axis=1))
        forces = (
            part.strained(next(own)) if part.strain_stiffness.size else part for part in self.system.forces
        )
        return replace(self.system, forces=tuple(forces))
