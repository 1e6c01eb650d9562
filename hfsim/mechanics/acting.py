"""What joints, springs and loads do to one body, point by point."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Acting, Load
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.line_force import LineLoad
from hfsim.mechanics.system import System


def acting_on(
    system: System, columns: slice, t: Array, x: Array, u: Array, multipliers: Array
) -> Acting:
    """Return all that others do to a body with some columns in x.

    Parameters
    ----------
    t : ndarray, shape (n_batch,)
    x, u : ndarray, shape (n_batch, n_x)
    multipliers : ndarray, shape (n_batch, n_rows)
        As `System.solved` returns them.
    """
    along = [part for part in system.forces if isinstance(part, LineLoad)]
    others = [part for part in system.forces if not isinstance(part, LineLoad)]
    return Acting(
        tuple(loads_on(system, columns, t, x, u, multipliers, others)),
        tuple((part, part.at_places(t, x, u)) for part in along if part.columns == columns),
    )


def loads_on(
    system: System,
    columns: slice,
    t: Array,
    x: Array,
    u: Array,
    multipliers: Array,
    parts: Iterable[ForcePart],
) -> Iterator[Load]:
    """Yield what joints, and these force parts, do at points of a body."""
    for constraint, rows in zip(system.constraints, system.unreduced.rows, strict=True):
        ends = [number for number, marker in enumerate(constraint.ends) if marker.columns == columns]
        for number in ends:
            J = constraint.jacobian(number, x)
            yield constraint.ends[number], -(multipliers[:, None, rows] @ J)[:, 0]
    for part in parts:
        if any(marker.columns == columns for marker in part.markers):
            yield from (load for load in part.on_points(t, x, u) if load[0].columns == columns)
