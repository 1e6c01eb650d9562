"""What the equations of motion ask of a body whose mass matrix depends on its coordinates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array, BoolArray
from hfsim.maths.matrices import Entries


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

    def momenta(self, x: Array, rates: Array) -> Array:
        """Return the mass matrix times rates, both (n_batch, m, n_columns)."""

    @property
    def lengths(self) -> BoolArray:
        """Which of its coordinates are lengths, not angles or slopes, shape (n_columns,)."""

    def inertia_slopes(self, x: Array, a: Array) -> Entries:
        """Return the derivative of M(x) a by x in one state, for accelerations (1, n_x)."""

    @property
    def inner(self) -> int:
        """Which of its columns is the first of those that its root holds, and no joint ties to others."""

    def condensed(self, x: Array) -> tuple[Array, Callable[[Array], Array]]:
        """Return rows of the mass matrix, of the columns before these, (n_batch, inner, n_columns).

        Then what gives accelerations of these from forces, both (n_batch, m, n_columns - inner).
        """

    def straightened(self, q: Array) -> Array:
        """Return its coordinates (n_columns,) without deformation."""

    def breakdown(self, t: float, inertia: float, straight: float) -> SolverFailure | None:
        """Return why no step leads on, where the smallest inertia is too far below that when straight."""
