"""Charts: where the coordinates that are stepped in differ from those in which mass is constant."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace
from typing import Any, ClassVar, Self, TypeVar

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen


@frozen
class AlikeBodies:
    """Base of what serves alike bodies together that stand side by side.

    Attributes
    ----------
    columns : slice
        Where the coordinates of these bodies stand.
    bodies : int
        How many there are.
    """

    columns: slice
    bodies: int

    def at(self, columns: slice) -> Self:
        """Return the same for coordinates that stand elsewhere."""
        return replace(self, columns=columns)

    def joined(self, other: AlikeBodies) -> Self | None:
        """Return one for these bodies and those of another; None unless they are alike and side by side."""
        sizes = {(one.columns.stop - one.columns.start) / one.bodies for one in (self, other)}
        alike = self._each() == other._each() and len(sizes) == 1
        if not alike or self.columns.stop != other.columns.start:
            return None
        columns = slice(self.columns.start, other.columns.stop)
        return replace(self, columns=columns, bodies=self.bodies + other.bodies)

    def _each(self) -> tuple[Any, ...]:
        """Return what each of the bodies is like."""
        names = (one.name for one in fields(self) if one.name not in ("columns", "bodies"))
        return type(self), *(getattr(self, name) for name in names)


class Chart(AlikeBodies):
    """A map between coordinates of the state and free coordinates that stand in the same columns.

    Frames are whatever the maps need of a batch of states (n_batch, n); blocks have shape
    (n_batch, n_columns).

    Attributes
    ----------
    several : bool
        Whether it is of several charts, none of which serves all states.
    """

    several: ClassVar[bool] = False

    def frames(self, q: Array) -> Any:
        """Return what the maps below need of a batch of states."""
        raise NotImplementedError

    def absolute(self, frames: Any) -> Array:
        """Return the block of free coordinates."""
        raise NotImplementedError

    def absolute_velocity(self, frames: Any, v: Array) -> Array:
        """Return the block of their rates."""
        raise NotImplementedError

    def relative_acceleration(self, frames: Any, v: Array, ax: Array) -> Array:
        """Return the block of q'' from accelerations of the free coordinates."""
        raise NotImplementedError

    def hybrid(self, x: Array, near: Array) -> Array:
        """Return the block of the state; of all full turns, angles near those of ``near`` are taken."""
        raise NotImplementedError

    def hybrid_velocity(self, frames: Any, u: Array) -> Array:
        """Return the block of the state's rates from those of the free coordinates."""
        raise NotImplementedError

    def better(self, q: Array) -> Array:
        """Return a block that says, as ``near`` of `hybrid`, in which of several charts to go on."""
        return q[:, self.columns]


_Alike = TypeVar("_Alike", bound=AlikeBodies)


def side_by_side(parts: Iterable[_Alike | None]) -> tuple[_Alike, ...]:
    """Return the parts there are, each joined with the one before where that can be."""
    found: list[_Alike] = []
    for part in parts:
        both = found[-1].joined(part) if found and part is not None else None
        if both is not None:
            found[-1] = both
        elif part is not None:
            found.append(part)
    return tuple(found)
