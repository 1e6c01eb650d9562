"""What an integrator is: the page to read before adding one.

A method makes one step at a time; the loop around the steps is shared (`hfsim.integrators._loop`).  Whatever
else must be known of a method stands in its `Integrator`, and that in `hfsim.integrators.METHODS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from hfsim.integrators._memory import Remembering
from hfsim.integrators._ordinary import Ahead
from hfsim.integrators._problem import Problem
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen


class Options(Protocol):
    """What methods read of how a scene is to be solved; a deck's ``solve`` has it all."""

    method: str
    """Name in `METHODS`, or ``auto``."""

    tolerance: float
    """Local error per step: metre, radian or slope, relative above 1."""

    step: float | None
    """Fixed step length [s]."""

    order: int | None
    """Order, where a method has several."""

    stages: int | None
    """Stages of a collocation method."""

    rho_inf: float
    """Spectral radius at infinite frequency."""


class Limits(NamedTuple):
    """When a run ends early.

    Attributes
    ----------
    step : float or None
        Fixed step length [s].
    max_steps : int or None
    """

    step: float | None = None
    max_steps: int | None = None


SPAN, SPAN_OF_POINTS = 0.25, 0.1
"""Oscillations of a law that a step may span for each stage of collocation, or place that others look at."""


class Attempt(NamedTuple):
    """The outcome of trying one step.

    Attributes
    ----------
    error : float
        Estimated local error relative to the tolerance; with a free step length the step is kept
        if it is at most 1.  Infinite where the nonlinear equations were not solved.
    growth : float
        Factor by which the method would change the step.
    q, v : ndarray, shape (n,)
        State at the end of the step.
    series : ndarray, shape (m, n)
        For `Segment`.
    closed : bool
        Whether the end was moved onto the constraints.
    seen : ndarray, optional
        What `Turns.looked` returns of the step, where that is known.
    """

    error: float
    growth: float
    q: Array
    v: Array
    series: Array
    closed: bool = False
    seen: Array | None = None

    @property
    def solved(self) -> bool:
        """Whether the equations of the step were solved."""
        return math.isfinite(self.error)


def unsolved(growth: float = 0.5) -> Attempt:
    """Return the outcome of a step whose equations could not be solved."""
    nothing = np.zeros(0)
    return Attempt(np.inf, growth, nothing, nothing, nothing)


class Stepper(Remembering):
    """A method at work on a problem; what it remembers between steps is its own.

    A run can be put down after any step and taken up again in another process: by a stepper that was
    started anew in the state reached there and then told to `recall`.  The attributes that it recalls are
    named in ``remembers``; derivatives are not kept but taken again where they were
    (`hfsim.integrators.derivative.taken_again`).

    Steps end where a law of time has a break.  A method that looks back is started anew there if its first
    step behind it fails or ``reach`` comes or goes, and always where steps are of fixed length.
    """

    looks_back: ClassVar[bool] = False
    """Whether a step depends on more than the state in which it begins."""

    reach: float = 0.0
    """Time over which errors of velocities count where breaks make steps short [s]: a push may be over soon,
    but what it did to the velocities goes on."""

    period: float = math.inf
    """Of the quickest oscillation of a law until the next break [s]."""

    spans: float = SPAN_OF_POINTS
    """Oscillations that a step may span."""

    name: str
    """What it makes its steps with now."""

    first: float
    """First step length to try [s]."""

    def kept(self) -> Callable[[], dict[str, Any]]:
        """Return what tells the memory of now: it may be that of others too, which change in place."""
        memory = self.memory()
        return lambda: memory

    @property
    def label(self) -> str:
        """Its name and, after a colon, the number of stages or the order where a method has several."""
        return self.name

    @property
    def longest(self) -> float:
        """Longest step [s]: in longer ones laws of time that oscillate would look like slower ones."""
        return self.spans * self.period

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Try a step of length h."""
        raise NotImplementedError

    def ahead(self, t: float, q: Array, v: Array, h: float, end: float, room: int) -> Ahead | None:
        """Make ordinary steps at once, and accept them; None where none can be made so.

        Parameters
        ----------
        h : float
            Length of the first one, as far as the end leaves room for it.
        end : float
            Time which they may meet, but not leave behind.
        room : int
            Number of steps at most.
        """
        return None

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Take note that the step was kept and, after projection, ended in this state."""

    def cross(self) -> None:
        """Take note that there is a break where the next step begins."""


class Method(Protocol):
    """An integrator with its options, before it has seen a problem."""

    @property
    def name(self) -> str:
        """As in `METHODS`."""

    @property
    def stages(self) -> int | None:
        """Stages of its steps, if their number can be chosen."""

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> Stepper:
        """Return what makes the steps from an initial state."""


class Stability(NamedTuple):
    """Linear theory of a method: the test equation y'' = -w^2 y, solved with steps h.

    Attributes
    ----------
    words : str
    growth : callable, optional
        (w h, shape (n,), order or None) -> the factors by which the amplitude grows per step at most.
        Without it any step is stable.
    """

    words: str
    growth: Callable[[Array, int | None], Array] | None = None


@frozen
class Integrator:
    """A method and all that is known of it beside its steps.

    Attributes
    ----------
    make : callable
        Options -> method.
    stability : Stability
    reads : tuple of str
        What it reads of `Options` that some methods alone do.
    orders : tuple of int
        What ``order`` may be asked to be, where it can be.
    constant_mass : bool
        Whether it steps in coordinates with a constant mass matrix only: in absolute ones.
    rank : float
        Place in a race: what was seen to win comes first, as it makes the others short.
    rescue : float
        Place among the methods that are tried where another one failed; infinite: it is not.
    """

    make: Callable[[Options], Method]
    stability: Stability
    reads: tuple[str, ...] = ()
    orders: tuple[int, ...] = ()
    constant_mass: bool = False
    rank: float = np.inf
    rescue: float = np.inf


def relative(change: Array, q: Array, tolerance: float) -> float:
    """Return the largest change (n,) of a state, over the tolerance."""
    return float((np.abs(change) / (tolerance * (1.0 + np.abs(q)))).max())


def aimed(error: float, power: float) -> float:
    """Return the factor on a step whose error, which grows with a power of it, is to meet the tolerance."""
    return float(0.9 * max(error, 1e-10) ** (-1.0 / power))


def cautious_step(a: Array, q: Array, tolerance: float) -> float:
    """Return a first step for methods of low order from the accelerations at the start."""
    return float(0.5 / np.sqrt(max(relative(a, q, tolerance), 1e-6)))
