"""Charts: where the coordinates that are stepped in differ from those in which mass is constant."""

from __future__ import annotations

from typing import Any, Protocol

from hfsim.maths.arrays import Array


class Chart(Protocol):
    """A map between coordinates of the state and free coordinates that stand in the same columns.

    Frames are whatever the maps need of a batch of states (n_batch, n); blocks have shape
    (n_batch, n_columns).
    """

    @property
    def columns(self) -> slice:
        """Where its coordinates stand, in the state and among the free coordinates alike."""

    def frames(self, q: Array) -> Any:
        """Return what the maps below need of a batch of states."""

    def absolute(self, frames: Any) -> Array:
        """Return the block of free coordinates."""

    def absolute_velocity(self, frames: Any, v: Array) -> Array:
        """Return the block of their rates."""

    def relative_acceleration(self, frames: Any, v: Array, ax: Array) -> Array:
        """Return the block of q'' from accelerations of the free coordinates."""

    def hybrid(self, x: Array, near: Array) -> Array:
        """Return the block of the state; of all full turns, angles near those of ``near`` are taken."""

    def hybrid_velocity(self, frames: Any, u: Array) -> Array:
        """Return the block of the state's rates from those of the free coordinates."""
