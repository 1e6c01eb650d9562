"""A force along a body, by what it does at places there."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.maths.shapes import gauss_legendre, shares_beyond
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import LinearMarker, Marker, joint_support
from hfsim.mechanics.point_loads import Load, force_slopes

if TYPE_CHECKING:
    from hfsim.deck.laws import Law


class LineLoad(ForcePart):
    """What acts all along a beam, by what it does at places there.

    Attributes
    ----------
    places : tuple of Marker
    cells : ndarray, shape (n_cells + 1,)
        Distances from the root [m] between which places are Gauss points, as many in each cell.
    """

    places: tuple[Marker, ...]
    cells: Array

    def at_places(self, t: Array, x: Array, u: Array) -> list[Array]:
        """Return its force at each place [N], (n_batch, n_dim)."""
        raise NotImplementedError

    def on_points(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield its places, with its force there on the coordinates of the body."""
        for marker, force in zip(self.places, self.at_places(t, x, u), strict=True):
            yield marker, (force[:, None] @ marker.position_jacobian(x))[:, 0]

    def beyond(self, places: Array) -> Array:
        """Return the share of each of its own places beyond distances from the root, (n, n_places)."""
        rule = gauss_legendre(len(self.places) // (len(self.cells) - 1))
        return shares_beyond(self.cells, *rule, places)

    @cached_property
    def support(self) -> IntArray:
        """Coordinates that any place depends on."""
        return joint_support(*self.places)

    @property
    def columns(self) -> slice:
        """Coordinates of the body."""
        return self.places[0].columns


@frozen
class LineForce(LineLoad, Load):
    """Forces at places of one body, fixed in direction or turning with it; their work is power put in.

    Attributes
    ----------
    forces : ndarray, shape (n_places, n_dim)
        [N]
    """

    places: tuple[Marker, ...]
    forces: Array
    cells: Array
    follower: bool
    law: Law | None
    told: ClassVar[str] = "force along a beam"

    def at_places(self, t: Array, x: Array, u: Array) -> list[Array]:
        """Return its force at each place [N], (n_batch, n_dim)."""
        factor = np.ones((len(x), 1)) if self.law is None else self.law.value(t)[:, None]
        return [factor * force for force in self._turned(x)]

    @cached_property
    def _rows(self) -> Array | None:
        """Shape rows of all places, (n_places, n_vectors), where these are linear in the coordinates."""
        if not all(isinstance(marker, LinearMarker) for marker in self.places):
            return None
        return np.array([marker.place_row for marker in self.places])  # type: ignore[attr-defined]

    @cached_property
    def _constant(self) -> Array | None:
        """The generalised force at a factor of 1, (1, n_columns), where no state changes it."""
        if self.follower or self._rows is None:
            return None
        return (self._rows.T @ self.forces).reshape(1, -1)

    def generalised(self, t: Array, x: Array) -> Array:
        """Return the generalised force."""
        whole = self._unscaled(x) if self._constant is None else self._constant
        return whole if self.law is None else whole * self.law.value(t)[:, None]

    def _unscaled(self, x: Array) -> Array:
        turned = self._turned(x)
        if self._rows is not None:
            return np.asarray(self._rows.T @ np.stack(turned, axis=1)).reshape(len(x), -1)
        parts = (
            (force[:, None] @ marker.position_jacobian(x))[:, 0]
            for marker, force in zip(self.places, turned, strict=True)
        )
        return np.asarray(sum(parts))

    def _turned(self, x: Array) -> list[Array]:
        """Return the force at each place without its law, in ground axes, (n_batch or 1, n_dim)."""
        pairs = zip(self.places, self.forces, strict=True)
        return [marker.turned(x, force) if self.follower else force[None] for marker, force in pairs]

    def slopes(self, x: Array) -> Iterator[Entries]:
        """Yield those of the force at each place; nothing where it does not change."""
        if self._constant is None:
            for marker, force in zip(self.places, self.forces, strict=True):
                yield from force_slopes(marker, x, force, self.follower)
