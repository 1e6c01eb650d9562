"""Gauss and Radau IIA collocation with all stages in one call.

The unknowns are the accelerations a at the stages; stage states follow as

    v_i = v + h sum_j A_ij a_j,   q_i = q + c_i h v + h^2 sum_j (A A)_ij a_j .

They are found by simplified Newton iteration with one derivative J of the accelerations for all
stages, in coordinates where it changes little (`Increments`); what is left of the equations is read in
each stage's own geometry.  J is taken apart into modes once and kept for some steps; with A turned into
complex pairs (Butcher's transformation), a correction is then a few products and one division per mode
and stage, for any step length.  The first guess lets every mode swing from the initial state as it would
alone: extrapolated stages would put the fast modes anywhere, and the iteration would not converge at
large steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite
from pkgutil import resolve_name
from typing import Any, ClassVar

import numpy as np

from hfsim.integrators._base import SPAN, Attempt, Integrator, Options, Stability, Stepper, unsolved
from hfsim.integrators._derivative import Derivative
from hfsim.integrators._ending import MAX_ITERATIONS, Ending, limits
from hfsim.integrators._iteration import LINEAR, End, Iteration, Kind, Place
from hfsim.integrators._lengths import FAINT, GROWTH, REGROWTH, RUNGS, SHRUNK, TARGET, factor, fitted
from hfsim.integrators._memory import Remembering
from hfsim.integrators._often import LARGE
from hfsim.integrators._ordinary import END, LONGEST, REACH, Ahead, Rule, State
from hfsim.integrators._problem import PlainIncrements, Problem
from hfsim.integrators._replayed import Held, Replay, Replays
from hfsim.integrators._tableau import Collocation, gauss, lasting, radau
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.mechanics.projection import MOST, ROUNDING
from hfsim.mechanics.turns import NEAR

STAGEWISE = "hfsim.integrators._stagewise.StagewiseStepper"
"""What makes the steps where slopes pay: imported, only then, from what it is built on."""
SERVES_WELL = 5
"""Iterations in a step up to which its derivative is kept for one more."""
SERVES = 2
"""Steps for which a derivative is kept at most."""
STIFF = 2.0
"""Angle by which the fastest mode turns from stage to stage from which natural coordinates pay; where `auto`
makes do with fewer stages, in steps as long as with all of them."""
RELUCTANT = 1.25
"""How far beyond it steps in the state's coordinates may go then: few others do not pay for a recording."""
COSTLY = 400
"""Coordinates from which derivatives cost so much that the one of the start serves the first step."""
LASTING = 2
"""Steps to come, at the length of now, from which those of many coordinates are replayed."""
FAR = 200
"""Steps to come in which the fastest mode turns by one radian a stage, from which the first one is stiff."""
UNKNOWN: tuple[float, Array] = (np.nan, np.zeros(0))
"""When, and which, accelerations at the start of a step are known if none are."""
NAMES = {stiff: f"steps, stiff: {stiff}" for stiff in (False, True)}
"""By what steps of a kind are told from others where functions are chosen that are replayed."""


@frozen
class CollocationMethod:
    """A collocation method whose steps follow the decay of the Legendre series of the positions.

    Attributes
    ----------
    tolerance : float
        Local error per step: metre, radian or slope, relative above 1.
    damping : callable, optional
        Gives the table of radau taken instead in natural coordinates, where steps do not resolve the fastest
        modes: what they make of these would stay for ever in a method that keeps the energy.
    stagewise : callable, optional
        Gives the table taken instead where slopes pay at every stage.
    """

    name: str
    table: Collocation
    tolerance: float
    damping: Callable[[], Collocation] | None = None
    stagewise: Callable[[], Collocation] | None = None

    @property
    def stages(self) -> int:
        """Number of stages."""
        return self.table.stages

    def start(self, problem: Problem, t: float, q: Array, v: Array) -> CollocationStepper:
        """Return what makes the steps from an initial state."""
        if problem.slopes is not None and problem.slopes.pays:
            stepper: CollocationStepper = resolve_name(STAGEWISE)(self, problem, t, q, v)
            return stepper
        return CollocationStepper(self, problem, t, q, v)


class CollocationStepper(Stepper):
    """Collocation at work.

    Attributes
    ----------
    name : str
        Of the method of the steps, that for damping included.
    table : Collocation
        Of the same.
    growths : tuple of (int, float)
        Iterations in a step, and how much longer the next one may then be.
    first : float
        The time in which the fastest mode turns by one radian a stage.
    """

    @property
    def label(self) -> str:
        """Name and number of stages of its steps now."""
        return self._label

    growths: ClassVar[tuple[tuple[int, float], ...]] = GROWTH
    replays: ClassVar[bool] = True
    """Whether steps are replayed natively where they can be."""
    remembers: ClassVar[tuple[str, ...]] = ("_stiff", "_old", "_served", "_cap", "_known_at", "_known", "_h")

    def __init__(self, method: CollocationMethod, problem: Problem, t: float, q: Array, v: Array) -> None:
        self._method, self._problem, self._tolerance = method, problem, method.tolerance
        self._usual = method.table
        self._choose(False)
        self._replays = Replays(problem)
        self._derivative: Derivative | Held = self._replays.beginning(self._kind, Place(t, q, v, 0.0))
        self._old, self._served, self._iterations = len(q) <= COSTLY, 0, 0
        self._cap = np.inf
        (self._known_at, self._known), self._h, self._made_natively = UNKNOWN, 0.0, False
        self._tried: tuple[Replay, Ahead] | None = None
        """What has been found of the next attempt."""
        self.first = min(self.table.stages / max(self._derivative.fastest, 1e-3), 1e3)
        if self.replays and problem.often.rest(t) > FAR * self.first:
            self.first *= 2.0 * self._resolved / self.table.stages

    def attempt(self, t: float, q: Array, v: Array, h: float) -> Attempt:
        """Solve the stage equations for one step and estimate its error."""
        self._h, place = h, Place(t, q, v, h)
        if self._tried is None and self._old:
            self._prepare(place)
        step = self._solve(place)
        self._made_natively = isinstance(step, Replay)
        end = None if step is None else step.end()
        if step is None or end is None or not isfinite(end.error):
            self._old, self._cap = bool(self._steady and h < self._cap), SHRUNK * h
            if not self._old:
                self._renew(t, q, v, None, self._cap)
            return unsolved(SHRUNK)
        if self._at_end:
            self._last = step.a[-1].copy()
        error = self._error(place, end)
        return Attempt(error, self._growth(error, h), *end[:3], end.closed, end.seen)

    def _prepare(self, place: Place) -> None:
        """Choose how steps are made from now on."""
        often, stiff = self._problem.often, self._is_stiff(place.h)
        if self.replays and self._derivative.recordable and NAMES[stiff] not in often.chosen:
            lasting = LASTING * (len(place.q) / LARGE) ** 2 if len(place.q) > LARGE else 0.0
            if often.rest(place.t) > lasting * place.h:
                often.take(NAMES[stiff])
        if stiff != self._stiff:
            self._renew(*self._guess(place).middle(), place.h)

    def accept(self, t: float, q: Array, v: Array) -> None:
        """Ask for a new derivative every other step, or at once if it served badly.

        A step length that once failed comes back slowly.
        """
        self._problem.counts.native += self._made_natively
        self._served += 1
        self._old = self._served >= SERVES or self._iterations > SERVES_WELL
        self._cap *= REGROWTH
        self._known_at, self._known = (t, self._last) if self._at_end else UNKNOWN

    def cross(self) -> None:
        """Find the accelerations behind a break anew: they may have jumped."""
        self._known_at, self._known = UNKNOWN

    def memory(self) -> dict[str, Any]:
        """Return where the derivative was taken, how it serves, and the accelerations known at the end."""
        return super().memory() | {"taken": self._derivative.taken, "ways": self._derivative.ways}

    kept = Remembering.kept

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Take the same derivative again."""
        super().recall(memory)
        self._choose(self._stiff)
        with self._problem.often.supposed(memory["ways"]):
            again = self._replays.taken_again
            self._derivative = again(self._kind, memory["taken"], self._h, self._native)

    def _error(self, place: Place, end: End) -> float:
        """Return the error over the tolerance; that of velocities counts where it reaches farther."""
        return max(float(end.error), self.reach * float(end.rate_error)) / self._tolerance

    def _growth(self, error: float, h: float) -> float:
        """Return the factor on the step: long steps with some more iterations cost less."""
        most = next(most for count, most in self.growths if self._iterations <= count)
        return factor(error, self.table.stages, np.inf if error > 1.0 else min(most, self._cap / h))

    def ahead(self, t: float, q: Array, v: Array, h: float, end: float, room: int) -> Ahead | None:
        """Make ordinary steps natively, and one more attempt, of which `attempt` then tells."""
        problem, place = self._problem, Place(t, q, v, fitted(h, end - t))
        if self._old:
            self._prepare(place)
        replay = self._replay(place)
        if replay is None or not replay.whole:
            return None
        ahead = self._march(replay, place, wish=h, end=end, room=room)
        if len(ahead.rows) or ahead.state.rejected:
            self._derivative = replay.before(problem, ahead)
            self._take(ahead.state)
        if len(ahead.rows):
            replay.recorded.tell(problem.turns)
            self._h = float(ahead.rows[-1, 2])
            self._known_at, self._known = (ahead.t, replay.started()) if self._at_end else UNKNOWN
        self._tried = (replay, ahead) if ahead.tried else None
        return ahead

    def _march(
        self, replay: Replay, place: Place, guess: Array | None = None, wish: float | None = None,
        end: float = np.inf, room: int = 0,
    ) -> Ahead:  # fmt: skip
        rule = self._rule
        rule[REACH], rule[END], rule[LONGEST] = self.reach, end, self.longest
        state = State(0.0, self._old, self._served, self._cap, wish or place.h)
        return replay.march(self._problem, place, rule, state, self._known_at_start(place), guess, room)

    def _solve(self, place: Place) -> Iteration | Replay | None:
        """Return a step that has converged, if need be with a derivative of its own, or without any."""
        step = self._iterated(place)
        if step is None and self._served:
            self._old = True
            self._prepare(place)
            step = self._iterated(place)
        failed_before = place.h >= self._cap
        return self._settled(place) if step is None and failed_before else step

    def _settled(self, place: Place) -> Iteration | None:
        """Return a step for which no derivative is needed, where there are joints and nothing is stiff."""
        if self._stiff or self._problem.project is None:
            return None
        step = Iteration(self._problem, self._own_derivative(), self.table, place)
        a0, ending = self._start_acceleration(place), Ending(place.q, self._tolerance)
        converged, self._iterations = step.settle(self._problem.project, a0, ending)
        return step if converged else None

    def _iterated(self, place: Place) -> Iteration | Replay | None:
        """Iterate; return a step that has converged."""
        if self._tried is None:
            replay, guess = self._replay(place), None
            if replay is not None and self._old and not replay.derives:
                middle = replay.middle(self._problem, place, self._known_at_start(place))
                guess, self._known_at, self._known = replay.a.copy(), place.t, replay.started()
                self._renew(*middle, place.h)
                replay = self._replay(place)
            if replay is None:
                step = self._begun(place)
                step.a = step.a if guess is None else guess
                converged, self._iterations = step.solve(Ending(place.q, self._tolerance))
                return step if converged else None
            self._tried = replay, self._march(replay, place, guess)
        (replay, ahead), self._tried = self._tried, None
        tried = ahead.tried
        assert tried is not None and replay.held is not None
        self._derivative = replay.held
        self._take(tried)
        self._known_at, self._known = place.t, replay.started()
        return replay if tried.converged else None

    def _take(self, state: State) -> None:
        """Go on from where native steps have come."""
        self._old, self._served, self._cap = bool(state.old), int(state.served), state.cap
        self._iterations = int(state.iterations)

    def _replay(self, place: Place) -> Replay | None:
        """Return what replays a step with the derivative of now, if anything does."""
        return self._replays.of(self._kind, place, self._derivative) if self._native else None

    def _begun(self, place: Place) -> Iteration:
        """Return a step with its first guess and, if it is time for one, a derivative in its middle."""
        step = self._guess(place)
        if self._old:
            self._renew(*step.middle(), place.h)
            step.derivative = self._own_derivative()
        return step

    def _guess(self, place: Place) -> Iteration:
        """Return a step that begins with modes that swing freely from its start."""
        step = Iteration(self._problem, self._own_derivative(), self.table, place, self._kind.strained)
        step.guess(self._start_acceleration(place))
        return step

    def _start_acceleration(self, place: Place) -> Array:
        """Return the accelerations at the start of a step."""
        if self._known_at != place.t:
            self._known_at, self._known = place.t, self._problem.single(*place[:3])
        return self._known

    def _known_at_start(self, place: Place) -> Array | None:
        """Return the same if they are known: if the last step had a stage at its end."""
        return self._known if self._known_at == place.t else None

    def _own_derivative(self) -> Derivative:
        """Return the derivative in memory of its own."""
        if isinstance(self._derivative, Held):
            self._derivative = self._derivative.apart(self._problem)
        return self._derivative

    @property
    def _native(self) -> bool:
        """Whether steps of the kind of now are replayed."""
        return NAMES[self._stiff] in self._problem.often.chosen

    def _is_stiff(self, h: float) -> bool:
        """Tell whether a step is long for the fastest mode."""
        return bool(h * self._derivative.fastest > self._resolved)

    def _renew(self, t: Any, q: Array, v: Array, expected: Array | None, h: float) -> None:
        """Compute the derivative anew, in natural coordinates if the step is long for its fastest mode."""
        self._choose(self._is_stiff(h))
        place = Place(float(t), q, v, h)
        self._derivative = self._replays.derivative(self._kind, place, expected, self._native)
        self._old, self._served = False, 0

    def _choose(self, stiff: bool) -> None:
        """Take the method for damping in stiff steps and the other one else."""
        damping = self._method.damping if stiff else None
        self.name, self._stiff = "radau" if damping else self._method.name, stiff
        self.table = lasting(damping() if damping else self._usual, self._problem.often.duration)
        self._label, self.spans = f"{self.name}:{self.table.stages}", SPAN * self.table.stages
        self._at_end = bool(self.table.nodes[-1] == 1.0)
        """Whether the last stage is the end of the step."""
        few = self._method.damping is not None and self._usual.stages < GAUSS_STAGES
        stages = max(self.table.stages, GAUSS_STAGES) if few else self.table.stages
        self._resolved = STIFF * stages * (RELUCTANT if few and not stiff else 1.0)
        natural = stiff and not isinstance(self._problem.increments, PlainIncrements)
        self._kind = Kind(self.table, natural, stiff and self._problem.strains is not None)
        self._steady = not stiff and self._problem.constant_mass
        """Whether it is likely that a shorter step can be guessed with a derivative that did not serve."""
        self._rule = self._ruled()

    def _ruled(self) -> Array:
        """Return what ordinary steps follow."""
        stages, closings = self.table.stages, 0 if self._problem.project is None else MOST
        iterations = (*limits(self._tolerance), LINEAR, MAX_ITERATIONS, self._tolerance, self.reach)
        lengths = (TARGET, 1.0 / (stages + 1), FAINT, RUNGS, np.inf, self._resolved, self._stiff)
        serving = (SERVES, SERVES_WELL, SHRUNK, self._steady, REGROWTH)
        ending = (self._at_end * stages, ROUNDING, closings, NEAR, 0.0)
        return Rule(*iterations, *lengths, *serving, *ending, np.ravel(self.growths)).told()


GAUSS_STAGES = 20
"""Stages of `gauss` by default: fewer make steps shorter and save no iterations."""
RESOLVING = ((5e-4, 10), (3e-5, 12), (5e-7, 16))
"""Tolerances above which `auto` makes do with fewer, and with how many."""
STAGEWISE_STAGES = 10
"""Stages of `gauss` by default where each has its own derivative: the matrix of a step grows with them."""
LOOSE = 3e-4
"""Tolerance above which radau makes do with fewer stages."""


def unresolving_stages(tolerance: float) -> int:
    """Return the number of stages for steps that do not resolve the fastest modes.

    Examples
    --------
    >>> [unresolving_stages(tolerance) for tolerance in (1e-3, 1e-4, 1e-8)]
    [16, 20, 24]
    """
    return 16 if tolerance > LOOSE else 20 if tolerance > 1e-5 else 24


def _gauss(
    solve: Options, damping: Callable[[], Collocation] | None = None, stages: int = GAUSS_STAGES
) -> CollocationMethod:
    few = None if solve.stages else partial(gauss, STAGEWISE_STAGES)
    return CollocationMethod("gauss", gauss(solve.stages or stages), solve.tolerance, damping, few)


def _radau(solve: Options) -> CollocationMethod:
    stages = solve.stages or (6 if solve.tolerance > LOOSE else 10)
    return CollocationMethod("radau", radau(stages), solve.tolerance)


def automatic(solve: Options, dissipates: bool) -> CollocationMethod:
    """Return what stands for ``auto``; see `hfsim.integrators.choose`."""
    if dissipates:
        return _radau(solve)
    damping = partial(radau, solve.stages or unresolving_stages(solve.tolerance))
    fewer = (few for above, few in RESOLVING if solve.tolerance > above)
    return _gauss(solve, damping, next(fewer, GAUSS_STAGES))


GAUSS = Integrator(_gauss, Stability("A-stable, |R(iwh)| = 1"), ("stages",), rank=4, rescue=2)
RADAU = Integrator(_radau, Stability("L-stable, |R(iwh)| < 1"), ("stages",), rank=3, rescue=1)
