"""What integrators see of a scene: functions of (t, q, v)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators._memory import Remembering
from hfsim.integrators._often import Often, Recordings
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen, mutable
from hfsim.maths.matrices import Matrix
from hfsim.mechanics.counting import Past, Turns
from hfsim.mechanics.edges import Edges
from hfsim.mechanics.linearized import Linearized, by_differences
from hfsim.mechanics.strained import Strains

if TYPE_CHECKING:
    from hfsim.mechanics.carrying import Carrying, CarryingApart
    from hfsim.mechanics.slopes import Slopes


@mutable
class Counts(Remembering):
    """What a run cost, in calls."""

    steps: int = 0
    rejected: int = 0
    iterations: int = 0
    evaluations: int = 0
    """States at which accelerations were computed."""
    calls: int = 0
    """Batches in which they were."""
    factorisations: int = 0
    native: int = 0
    """Steps that were made by the native kernel."""
    remembers = ("steps", "rejected", "iterations", "evaluations", "calls", "factorisations", "native")

    def add(self, other: Counts) -> None:
        """Add what another run cost."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)


Project = Callable[[Array, Array, Array], tuple[Array, Array]]
"""(t, q, v) -> (q, v) moved onto the constraints; batch axis on all of them."""


class Increments(Protocol):
    """Coordinates for Newton corrections in which the derivative of the accelerations changes little.

    ``geometry`` gives what the other maps need of a batch of states; all arrays are (n_batch, n).
    """

    def from_state(self, q: Array) -> Increments:
        """Return the same for derivatives that are taken in a state (n,)."""

    def geometry(self, q: Array) -> Any:
        """Return what belongs to these states."""

    def to_natural(self, at: Any, dq: Array) -> Array:
        """Return small changes of the states in natural coordinates."""

    def from_natural(self, at: Any, y: Array) -> Array:
        """Return small natural increments as changes of the states."""

    def to_natural_forces(self, at: Any, f: Array) -> Array:
        """Return forces on the states as forces on natural increments."""

    def advance(self, at: Any, y: Array) -> Array:
        """Return finite natural increments as changes of the states."""

    def rates(self, at: Any, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return the first and second time derivatives of the natural coordinates in one state.

        Third comes the part of the second ones that velocities alone cause.
        """

    def turning(self, at: Any, v: Array) -> Matrix | None:
        """Return the matrix W (n, n) with which changes of the state turn where increments stand still.

        Their rates are then W dq, their second derivatives W W dq; None where nothing turns.
        """


@frozen
class PlainIncrements:
    """The state coordinates themselves."""

    def from_state(self, q: Array) -> PlainIncrements:
        """Return the same."""
        return self

    def geometry(self, q: Array) -> None:
        """Return nothing."""

    def to_natural(self, at: None, dq: Array) -> Array:
        """Return ``dq``."""
        return dq

    def from_natural(self, at: None, y: Array) -> Array:
        """Return ``y``."""
        return y

    advance = from_natural

    def to_natural_forces(self, at: None, f: Array) -> Array:
        """Return ``f``."""
        return f

    def rates(self, at: None, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return ``v``, ``a`` and zero."""
        return v, a, np.zeros_like(a)

    def turning(self, at: None, v: Array) -> None:
        """Return None."""


@mutable
class Problem:
    """Equations of motion q'' = a(t, q, v) with the manifold their solutions stay on.

    Attributes
    ----------
    acceleration : callable
        (t, q, v) -> q'' with a leading batch axis on all of them.
    project : callable or None
        What moves states onto the constraints, if there are any.
    dissipates : bool
        Whether stiff methods need the derivative of the accelerations by v.
    admissible : callable
        q, shape (n,) -> whether the equations make sense there; no step ends where they do not.
    positive : ndarray of int, or None
        Coordinates that have to be positive for that, if nothing else is asked for.
    breakdown : callable
        (t, q) -> the failure that explains why steps get ever shorter near this state, or None.
    linearized : callable or None
        (t, q, v) -> the equations linearised at a state; without it derivatives come from differences.
    slopes : Slopes or None
        Derivatives of the accelerations with all inertia forces, where these are at hand in closed form.
    culprit : callable
        (t, q, v) -> the failure that names what is not finite in this state, or None.
    increments : Increments
        Coordinates for Newton corrections.
    carrying : callable
        () -> the rigid motions of everything along which steps are guessed, None where increments turn by
        themselves.
    imbalance : callable or None
        (t, q, v, a) -> the forces (n_batch, n) and joint accelerations (n_batch, n_rows) by which
        accelerations fail the equations of motion.
    strains : Strains or None
        What stiff forces depend on, where a Newton iteration can have it as variables of its own.
    constant_mass : bool
        Whether the state are coordinates with a constant mass matrix.
    quartic : bool
        Whether, besides, joints are linear in them and the potential is a polynomial of degree four at most.
    rigid, loops : bool
        Whether all bodies are; whether joints close loops, whose equations may lose their rank.
    spatial : bool
        Whether bodies move in space.
    many_forces : bool
        Whether forces are so many that calls of Python take most of the time.
    breaks : ndarray
        Times at which a step has to end, sorted [s]: between them no law of time hides anything from a method
        that looks at the ends of its steps alone, save those that repeat themselves.
    period : callable
        (begin, end) -> the shortest oscillation of a law between these times [s].
    turns : Turns
        What counts the turns of angles along the steps.
    edges : Edges
        Where steps have to end.
    recharted : callable or None
        (q, v), shape (n,) each -> the same state in the coordinates to go on in, None if those are its own;
        None where all states have the same.
    units : callable
        () -> by what coordinates change at large, (n,): lengths by the size of bodies, others by one.
    recordings : Recordings
        What is replayed of the same equations.
    often : Often
        Which functions are replayed in a run.
    """

    acceleration: Callable[[Array, Array, Array], Array]
    project: Project | None
    dissipates: bool
    admissible: Callable[[Array], bool] = lambda q: True
    positive: IntArray | None = None
    breakdown: Callable[[float, Array], SolverFailure | None] = lambda t, q: None
    linearized: Callable[[float, Array, Array], Linearized] | None = None
    culprit: Callable[[float, Array, Array], SolverFailure | None] = lambda t, q, v: None
    increments: Increments = field(default_factory=PlainIncrements)
    slopes: Slopes | None = None
    carrying: Callable[[], Carrying | CarryingApart | None] = lambda: None
    imbalance: Callable[[Array, Array, Array, Array], tuple[Array, Array]] | None = None
    strains: Strains | None = None
    constant_mass: bool = True
    quartic: bool = False
    rigid: bool = False
    loops: bool = True
    spatial: bool = False
    many_forces: bool = False
    breaks: Array = field(default_factory=lambda: np.zeros(0))
    period: Callable[[float, float], float] = lambda begin, end: np.inf
    turns: Turns = field(default_factory=Turns)
    edges: Edges = field(default_factory=Edges)
    recharted: Callable[[Array, Array], tuple[Array, Array] | None] | None = None
    units: Callable[[], Array | float] = lambda: 1.0
    counts: Counts = field(default_factory=Counts)
    recordings: Recordings = field(default_factory=Recordings)
    often: Often = field(default_factory=Often)

    @property
    def plain(self) -> bool:
        """Whether all states have the same coordinates, and it is plain which of them are admissible."""
        return self.recharted is None and self.positive is not None

    @property
    def positional(self) -> bool:
        """Whether accelerations depend on time and positions alone."""
        return self.constant_mass and not self.dissipates and self.project is None

    @property
    def by_differences(self) -> bool:
        """Whether derivatives of the accelerations come from differences."""
        return self.linearized is None and self.slopes is None

    def count_on(self, n: int, start: float, end: float) -> None:
        """Begin to count, in a run of n coordinates between these times, what is called often."""
        self.often = Often(self.recordings, start, end, n, self.many_forces)

    def past(self) -> Past:
        """Return what forces remember of the motion that was followed last."""
        return Past.of([*self.turns.counts, *self.edges.once])

    def apart(self) -> Problem:
        """Return the same equations, evaluated in NumPy alone, with counts of their own."""
        return replace(self, counts=Counts(), often=Often())

    def at_start(self, name: str, begun: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """Return what is found out where a run begins, which another one from there finds as it is.

        Both count what that takes.
        """
        kept, own = self.recordings.mine, self.counts
        if name in kept and kept[name][0] == begun:
            own.add(kept[name][2])
            return kept[name][1]
        self.counts = spent = Counts()
        try:
            kept[name] = begun, make(), spent
        finally:
            own.add(spent)
            self.counts = own
        return kept[name][1]

    def through(self, name: str, function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
        """Call a function of arrays, of the same shapes in all runs of a scene; replay it if it pays."""
        return self.often.call(name, function, given)

    def evaluate(self, t: Array, q: Array, v: Array, strains: Array | None = None) -> Array:
        """Return accelerations of a batch, with strains that are expected if given, and count the call."""
        self.count(q)
        if strains is None or self.strains is None:
            return self.often.call(f"acceleration {len(q)}", self.acceleration, (t, q, v))
        return self.often.call(f"acceleration by strains {len(q)}", self._strained, (t, q, v, strains))

    def _strained(self, t: Array, q: Array, v: Array, strains: Array) -> Array:
        assert self.strains is not None
        return np.asarray(self.strains.expected(strains).acceleration(t, q, v))

    def at(self, t: float, q: Array, v: Array) -> Array:
        """Return the accelerations of one state, shape (n,); who asks for them counts them."""
        return np.asarray(self.acceleration(np.array([t]), q[None], v[None])[0])

    def unbalanced(
        self, t: Array, q: Array, v: Array, a: Array, strains: Array | None = None
    ) -> tuple[Array, Array]:
        """Return by how much accelerations of a batch fail the equations, strains as in `evaluate`."""
        assert self.imbalance is not None
        self.count(q)
        if strains is None or self.strains is None:
            return self.imbalance(t, q, v, a)
        return self.strains.expected(strains).imbalance(t, q, v, a)

    def count(self, q: Array) -> None:
        """Count the evaluation of a batch."""
        self.counts.calls += 1
        self.counts.evaluations += len(q)

    def single(self, t: float, q: Array, v: Array) -> Array:
        """Return the accelerations of one state, shape (n,)."""
        return np.asarray(self.evaluate(np.array([t]), q[None], v[None])[0])

    def near(self, t: float, q: Array, v: Array, strains: Array | None = None) -> Linearized:
        """Return the equations linearised at a state (n,), by differences where nothing else is at hand.

        Stresses are those of the strains that are expected there, (n_strains,), if given.
        """
        if strains is not None and self.strains is not None:
            return self.strains.expected(strains[None]).linearized(t, q, v)
        if self.linearized is not None:
            return self.linearized(t, q, v)
        if self.slopes is not None:
            return self.slopes.linearized(t, q, v)
        return by_differences(self.evaluate, t, q, v, self.dissipates, self.units())
