"""What the parts of a system have in common: the page to read before adding one.

A system is a tuple of force parts, a mass matrix and constraints (`hfsim.mechanics.constraints`), all written
in the *absolute* coordinates x of its bodies and their rates u, with a leading batch axis.  A part
holds numbers, arrays and slices only; the same (t, x, u) gives the same answer however often it is
asked.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.differences import FINE, fine_derivative
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import NOTHING, Entries
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.turns import TurnCount

if TYPE_CHECKING:
    from hfsim.deck.laws import Law
    from hfsim.mechanics.once import Event

def difference(values: Callable[[Array], Array], at: Array, columns: IntArray, units: Array) -> Entries:
    """Return the derivative of some entries of a vector by the same entries of its argument.

    By differences of fourth order, which are exact for forces of degree four.

    Parameters
    ----------
    values : callable
        (n_batch, n) -> (n_batch, n).
    at : ndarray, shape (1, n)
    columns : ndarray of int, shape (k,)
        The entries.
    units : ndarray, shape (k,)
        By what these change at large, where they are not larger.
    """
    steps = FINE * np.maximum(units, np.abs(at[0, columns]))
    slopes = fine_derivative(lambda moved: values(moved)[:, columns], at[0], columns, steps)
    return Entries.of_block(columns, columns, slopes)


@frozen
class ForcePart:
    """A source of generalised force together with the energy it stores and the power it puts in.

    Shapes: t (n_batch,), x and u (n_batch, n); energies [J] and powers [W] have shape (n_batch,).

    Attributes
    ----------
    item : str
        Deck path of what exerts it, such as ``springs.coil``; empty where that is several.
    """

    item: str = field(default="", kw_only=True)
    rule: ClassVar[str] = ""
    """The rule that may leave it out where it is `idle`."""
    told: ClassVar[str] = "force"
    """What it is, in the words of plans."""
    why: ClassVar[str] = "it acts"
    """Why it is there where it is not idle, in the words of plans."""

    of_strain_rates: ClassVar[bool] = False
    """Whether it resists rates of strains alone.  Its derivative by x is then that of axes which turn with
    the body; where forces are linearised for corrections it is left out, as these go along with such axes."""

    @property
    def idle(self) -> bool:
        """Whether it is zero in every state."""
        return False

    @property
    def counts(self) -> dict[str, int | str]:
        """What it consists of, as plans tell it."""
        return {}

    @property
    def shared(self) -> Hashable:
        """What must be equal for two parts to be `joined`; None where it stands by itself."""
        return None

    @property
    def markers(self) -> tuple[Marker, ...]:
        """Points that it acts on; none where it acts all along a body."""
        return ()

    @property
    def counter(self) -> TurnCount | None:
        """What counts the turns of its `angle`, where the coordinates give that modulo a turn only."""
        return None

    counts_for_others: ClassVar[bool] = False
    """Whether it is there to count turns alone, for another force."""

    @property
    def angles(self) -> tuple[ForcePart, ...]:
        """Itself, or the parts whose angles, and distances, it adds up."""
        return (self,)

    def angle(self, x: Array) -> Array:
        """Return the angle that it depends on, maybe without its turns [rad], shape (n_batch,)."""
        raise NotImplementedError

    def spin(self, x: Array, u: Array) -> Array:
        """Return the rate of that angle [rad/s], shape (n_batch,)."""
        raise NotImplementedError

    @property
    def laws(self) -> tuple[Law, ...]:
        """Laws of time that it follows."""
        return ()

    def joined(self, other: Self) -> Self:
        """Return one part that does what this one and another do."""
        raise NotImplementedError

    @property
    def has_edges(self) -> bool:
        """Whether there are `edges`."""
        return False

    def edges(self, t: Array, x: Array, u: Array) -> Array:
        """Return what changes its sign where the force changes its form, shape (n_batch, n_edges)."""
        raise NotImplementedError

    @property
    def events(self) -> tuple[Event, ...]:
        """What happens once along the motion."""
        return ()

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

    @property
    def quartic(self) -> bool:
        """Whether the energy it stores is a polynomial of degree four at most in x."""
        return False

    def undirected(self, t: Array, x: Array) -> float:
        """Return the size of a force [N] that has no direction in one state; zero of one that has."""
        return 0.0

    @property
    def runs_away(self) -> bool:
        """Whether `runaway` can find anything."""
        return False

    def runaway(self, t: float, x: Array) -> SolverFailure | None:
        """Return why a state (1, n) is out of all proportion for the model of the force, if it is."""
        return None

    @property
    def support(self) -> IntArray:
        """Coordinates in x that the force depends on or acts on."""
        raise NotImplementedError

    @property
    def units(self) -> Array:
        """By what these change at large in differences, (n_support,): one where no size is known."""
        return np.ones(len(self.support))

    @property
    def strain_stiffness(self) -> Array:
        """What strains are multiplied by, (n_strains,), where the force is a stiffness times strains.

        Empty elsewhere; see `hfsim.mechanics.strained`.
        """
        return np.zeros(0)

    def strain(self, x: Array) -> Array:
        """Return these strains, shape (n_batch, n_strains)."""
        raise NotImplementedError

    def strain_slopes(self, x: Array) -> Entries:
        """Return their derivative by x in one state."""
        raise NotImplementedError

    def in_strains(self) -> ForcePart:
        """Return the same force as stiffness times strains where it can be; itself elsewhere.

        Runs take such forms where these pay; a search for rest, whose steps are far longer, always does.
        """
        return self

    def strained(self, strains: Array) -> ForcePart:
        """Return the force with given strains (n_batch or 1, n_strains), not those of the coordinates."""
        raise NotImplementedError

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the generalised force to ``out``, shape (n_batch, n)."""
        raise NotImplementedError

    def on_points(self, t: Array, x: Array, u: Array) -> Iterator[tuple[Marker, Array]]:
        """Yield its points, with its force there on the coordinates of their bodies, (n_batch, n_columns).

        In the base for one point; nothing where it acts all along a body.
        """
        for marker in self.markers:
            whole = np.zeros_like(x)
            self.add_force(t, x, u, whole)
            yield marker, whole[:, marker.columns]

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by x in one state, (1,) and (1, n); by differences."""
        return difference(lambda moved: self._resistance(t, moved, u), x, self.support, self.units)

    def rate_tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return minus the derivative of the force by u in one state."""
        if not self.uses_rates:
            return NOTHING
        return difference(lambda moved: self._resistance(t, x, moved), u, self.support, self.units)

    def _resistance(self, t: Array, x: Array, u: Array) -> Array:
        """Return minus the force, with one state of x or u repeated for a batch of the other."""
        x, u = np.broadcast_arrays(x, u)
        out = np.zeros(x.shape)
        self.add_force(np.repeat(t, len(x)), x, u, out)
        return -out

    def strain_energy(self, x: Array) -> Array:
        """Return the energy stored in deformed bodies."""
        return np.zeros(len(x))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy stored by weight and springs."""
        return np.zeros(len(x))

    def power(self, t: Array, x: Array, u: Array) -> Array:
        """Return the power of the part of the force that no stored energy accounts for."""
        return np.zeros(len(x))


@frozen
class ConstantForce(ForcePart):
    """Weight of bodies whose mass matrix is constant: one vector for all states (eq. 31).

    Attributes
    ----------
    n : int
        Number of coordinates of the scene.
    columns : ndarray of int, shape (k,)
        Coordinates that it acts on.
    values : ndarray, shape (k,)
        Its components there.
    energy : float
        Energy of bodies that cannot move [J].
    """

    n: int
    columns: IntArray
    values: Array
    energy: float = 0.0
    rule: ClassVar[str] = "weight"
    told: ClassVar[str] = "weight, the same force in every state"
    why: ClassVar[str] = "gravity acts"
    quartic: ClassVar[bool] = True

    @cached_property
    def force(self) -> Array:
        """The whole vector, (n,)."""
        return np.asarray(np.bincount(self.columns, self.values, self.n), dtype=float)

    @property
    def idle(self) -> bool:
        """Whether there is no weight."""
        return not self.values.any() and not self.energy

    @property
    def shared(self) -> Hashable:
        """Weights add up."""
        return ConstantForce

    def joined(self, other: ConstantForce) -> ConstantForce:
        """Return the sum."""
        columns = np.concatenate([self.columns, other.columns])
        values = np.concatenate([self.values, other.values])
        return ConstantForce(self.n, columns, values, self.energy + other.energy)

    def add_force(self, t: Array, x: Array, u: Array, out: Array) -> None:
        """Add the constant vector."""
        out += self.force

    def tangent(self, t: Array, x: Array, u: Array) -> Entries:
        """Return nothing: the force does not change."""
        return NOTHING

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return minus the work of the force from the origin."""
        return np.asarray(self.energy - x @ self.force)


def merged(parts: Iterable[ForcePart]) -> tuple[ForcePart, ...]:
    """Return the parts with those joined that can be: one call then serves them all."""
    found: dict[Hashable, list[tuple[int, ForcePart]]] = {}
    for part in parts:
        key = len(found) if part.shared is None else (type(part), part.shared)
        joined = found.setdefault(key, [])
        joined.append((1, part))
        # equal numbers only, so that nothing is copied as often as there are parts
        while len(joined) > 1 and joined[-2][0] == joined[-1][0]:
            _join_last(joined)
    for joined in found.values():
        while len(joined) > 1:
            _join_last(joined)
    return tuple(joined[0][1] for joined in found.values())


def _join_last(parts: list[tuple[int, ForcePart]]) -> None:
    (first, one), (second, other) = parts[-2:]
    parts[-2:] = [(first + second, one.joined(other))]
