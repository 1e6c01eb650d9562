"""What the starting state is found from: what the deck states of bodies, and the linkage of their joints."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import TypeVar

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import Array, BoolArray, IntArray
from hfsim.maths.frozen import frozen, mutable
from hfsim.maths.rotations import freedoms, rotation, rotation_vector
from hfsim.mechanics.constraints import Constraint
from hfsim.scene.closing import BESIDE, CLOSED, Linkage
from hfsim.scene.initial import InitialSpec

AT_START = np.zeros(1)
_Values = TypeVar("_Values", Array, BoolArray)


@frozen
class Start:
    """What the starting state is found from.

    Attributes
    ----------
    names : tuple of str
        Of the bodies.
    linkage : Linkage
        Of the frames of the bodies, in this order.
    straight : dict of str to float
        Lengths of beams that start straight [m].
    refuse : callable
        (deck path, message, hint) -> DeckError.
    """

    names: tuple[str, ...]
    initial: Mapping[str, InitialSpec]
    linkage: Linkage
    straight: Mapping[str, float]
    refuse: Callable[[str, str, str], DeckError]

    @cached_property
    def n_dim(self) -> int:
        """Number of space dimensions."""
        return self.linkage.n_dim

    @cached_property
    def ties(self) -> tuple[Constraint, ...]:
        """The constraints that hold whole turns."""
        return tuple(c for c in self.linkage.constraints if c.holds_turn)

    @cached_property
    def gears(self) -> tuple[Constraint, ...]:
        """The constraints that hold turns against each other, full ones counted."""
        return tuple(c for c in self.linkage.constraints if c.against and c.unit == "rad")

    def posed(self, gaps: Array | None = None) -> str:
        """Return deck paths of what is stated of joints, of all or of those with gaps (n_rows,), in words."""
        link = self.linkage
        part = np.ones(len(link.scales)) if gaps is None else np.abs(gaps)
        rows = zip(link.constraints, link.equations.rows, strict=True)
        open_ones = (c.item for c, own in rows if part[own].max(initial=0.0) > BESIDE * part.max())
        return ", ".join(dict.fromkeys(item for item in open_ones if item.startswith("initial.")))

    def turns_of(self, values: _Values) -> _Values:
        """Return those of values (n,) of all frames that are of turns, (n_bodies, n_spin): a view."""
        return values.reshape(len(self.names), -1)[:, self.n_dim :]

    def stated(self, origin: str, turn: str) -> Stated:
        """Return the stated values of two quantities of each body, zero for the rest."""
        values = np.zeros((len(self.names), freedoms(self.n_dim)))
        stated, exact = np.zeros(values.shape, dtype=bool), np.zeros(values.shape, dtype=bool)
        parts = {origin: slice(self.n_dim), turn: slice(self.n_dim, None)}
        for k, name in enumerate(self.names):
            for quantity, part in parts.items():
                value = self._value(name, quantity)
                if value is not None:
                    values[k, part], stated[k, part], exact[k, part] = value, True, self.initial[name].exact
        return Stated(parts, values.ravel(), stated.ravel(), exact.ravel())

    def _value(self, name: str, quantity: str) -> Array | tuple[float, ...] | None:
        initial = self.initial.get(name)
        if initial is None:
            return None
        if quantity == "angular_velocity":
            return initial.spin(self.n_dim)
        if quantity == "angle" and (turn := initial.turn(self.n_dim)) is not None:
            # in space it counts from the centre, which is the orientation stated
            return turn if self.n_dim == 2 else np.zeros(3)
        return None if quantity == "angle" else getattr(initial, quantity)

    def told(self, quantity: str, where: IntArray, values: Array) -> tuple[float, ...]:
        """Return places or rates of a frame as messages have them: in space its turn against the ground."""
        own, body = values[where], int(where[0]) // freedoms(self.n_dim)
        if quantity == "angle" and self.linkage.centres is not None:
            own = rotation_vector(rotation(own) @ self.linkage.centres[body])
        none = CLOSED * self.linkage.units[where]
        return tuple(map(float, np.where(np.abs(own) < none, 0.0, own)))

    def frames(self, given: Stated) -> Iterator[tuple[str, tuple[Array, Array]]]:
        """Yield names of bodies with the values of both quantities."""
        for name, row in zip(self.names, given.values.reshape(len(self.names), -1), strict=True):
            yield name, (row[: self.n_dim], row[self.n_dim :])


@mutable
class Stated:
    """Places or rates of all frames, (n,), what of them the deck states, and what of that is exact.

    Attributes
    ----------
    parts : dict of str to slice
        Where each quantity stands among the values of a frame.
    values : ndarray, shape (n,)
    stated, exact : ndarray of bool, shape (n,)
    open : ndarray of bool, shape (n,)
        What neither the deck states nor joints hand on.
    geared : ndarray of bool, shape (n,)
        What gears hand on.
    """

    parts: dict[str, slice]
    values: Array
    stated: BoolArray
    exact: BoolArray

    def __post_init__(self) -> None:
        self.given = self.values.copy()
        self.open = ~self.stated
        self.geared = np.zeros_like(self.stated)
