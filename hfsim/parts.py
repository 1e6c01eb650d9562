"""What the parts of a system have in common: the page to read before adding one.

A system is a tuple of force parts, a mass matrix and constraints (`hfsim.constraints`), all written
in the *absolute* coordinates x of its bodies and their rates u, with a leading batch axis.  A part
holds numbers, arrays and slices only; the same (t, x, u) gives the same answer however often it is
asked.
"""

from __future__ import annotations

import numpy as np

from hfsim.arrays import Array


class ForcePart:
    """A source of generalised force together with the energy it stores and the power it puts in.

    Shapes: t (n_batch,), x and u (n_batch, n); energies [J] and powers [W] have shape (n_batch,).
    """

    @property
    def uses_rates(self) -> bool:
        """Whether the force depends on u."""
        return False

    @property
    def dissipates(self) -> bool:
        """Whether the force resists u by itself, so that stiff methods need its derivative by u."""
        return self.uses_rates

    @property
    def exchanges_power(self) -> bool:
        """Whether `power` can be other than zero."""
        return self.dissipates

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the generalised force to ``out``, shape (n_batch, n)."""
        raise NotImplementedError

    def strain_energy(self, x: Array) -> Array:
        """Return the energy stored in deformed bodies."""
        return np.zeros(len(x))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy stored by weight and springs."""
        return np.zeros(len(x))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of the part of the force that no stored energy accounts for."""
        return np.zeros(len(x))
