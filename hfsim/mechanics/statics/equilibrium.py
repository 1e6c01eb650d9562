"""Where a scene comes to rest: loads put on step by step, or relaxation where nothing holds it at first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.mechanics.reduction import Reduction
from hfsim.mechanics.statics.beginning import begun, let_go
from hfsim.mechanics.statics.newton import HOLD, Effort, NotFoundError, stepped
from hfsim.mechanics.statics.problem import Level, Problem, State
from hfsim.mechanics.statics.relaxation import relaxed
from hfsim.mechanics.statics.stability import Signs, are_pushed, lowest, neutral

KICK = 0.02
"""Size of a push out of a place of rest that is not stable [rad]."""
KICKS = 8
"""Of them, at most."""
STAYED = 0.05
"""Way from the start up to which a place of rest is where the scene was put [rad]."""

Rigid = Callable[[Array], Array]
"""From coordinates (1, n_x) to the rigid motions of each body by itself, (n_motions, n_x)."""


@frozen
class Equilibrium:
    """A place of rest, or what was reached on the way to it.

    Attributes
    ----------
    state : State
    share : float
        Of the loads that is on: 1 at a place of rest.
    values, motions : ndarray, shape (k,) and (k, n)
        Smallest stiffnesses over masses [1/s^2], and motions, that joints allow and something resists.
    neutral : ndarray, shape (k, n)
        Motions that nothing resists; without a place of rest those of them that are pushed, or that it goes
        on in.
    relaxed : bool
        Whether it was found by relaxation.
    limit : float or None
        Share of the loads beyond which there is no rest near by: what was found lies beyond a snap.
    effort : Effort
    reason : str
        Why there is none; empty where there is.
    lost : State or None
        Where the search was then.
    crossed : float or None
        Share of the loads from which on there are places of rest on the way that are not stable.
    others : bool
        Whether loads that are put on from a rest without them are known to lead to another place of rest.
    complete : bool or None
        Whether no smaller stiffness is missing; None where that is not known.
    led : bool
        Whether joints went along their laws on the way, with all full turns.
    """

    state: State
    share: float
    values: Array
    motions: Array
    neutral: Array
    relaxed: bool
    limit: float | None
    effort: Effort
    reason: str = ""
    lost: State | None = None
    crossed: float | None = None
    others: bool = False
    complete: bool | None = True
    led: bool = True

    @property
    def stable(self) -> bool:
        """Whether small pushes along all that something resists come to nothing."""
        return not len(self.values) or bool(self.values[0] >= 0.0)

    def of_whole(self, problem: Problem, whole: Reduction) -> Equilibrium:
        """Return it in the free coordinates of a whole of which only a part could move in the problem."""

        def state(own: State) -> State:
            return own._replace(z=whole.free(problem.expand(own.z)))

        def rates(own: Array) -> Array:
            return whole.free_rates(problem.expand_rates(own))

        lost = None if self.lost is None else state(self.lost)
        motions, neutral_ = rates(self.motions), rates(self.neutral)
        return replace(self, state=state(self.state), motions=motions, neutral=neutral_, lost=lost)


@dataclass(eq=False)
class Search:
    """The search for a place of rest.

    Attributes
    ----------
    problem : Problem
    rigid : Rigid
    effort : Effort
    """

    problem: Problem
    rigid: Rigid
    effort: Effort = field(default_factory=Effort)

    def __post_init__(self) -> None:
        self._signs = Signs(self.problem)

    def found(self) -> Equilibrium:
        """Return the place of rest, or what was reached."""
        found = self._sought()
        told = found.limit is not None or found.crossed is not None
        if found.reason or not told or self.problem.turning is not None or not self.problem.thrown:
            return found
        return self._of_loads(found)

    def _of_loads(self, found: Equilibrium) -> Equilibrium:
        """Return it with limit and crossing only as far as the loads lead to them.

        What is out of balance without them is let go on the way too, and held back by forces that bodies turn
        away from: these have limits of their own.  So loads are put on once more, from a rest without them.
        """
        with self.problem.apart() as problem:
            try:
                problem, state = begun(problem, Effort())
            except NotFoundError:
                return found
            least, problem = problem.least, problem.starting(state)
            signs = Signs(problem)
            share, end = stepped(problem, Effort(), lambda part: Level(least + part * (1.0 - least)), signs)
        if share < 1.0:
            return found if found.limit is None else replace(found, limit=least + share * (1.0 - least))
        if self.problem.moved(end.z - found.state.z) > STAYED:
            return replace(found, limit=None, crossed=None, others=True)
        return replace(found, limit=None, crossed=signs.crossed)

    def _sought(self) -> Equilibrium:
        start = self.problem.begin()
        if self.problem.turning is not None:
            # beyond a critical speed too, where stiffness alone holds nothing, and whatever turns freely
            share, state = stepped(replace(self.problem, hold=HOLD), self.effort)
            if share == 1.0:
                return self._judged(state, False, None)
        if len(self._neutral(start, 0.0)):
            return self._downhill(start, None)
        share, state = stepped(self.problem, self.effort, signs=self._signs)
        if share < 1.0:
            return self._downhill(state, share)
        found = self._judged(state, False, None)
        return found if found.stable or self.problem.turning is not None else self._let_go(found)

    def _let_go(self, found: Equilibrium) -> Equilibrium:
        """Return what a scene comes to that gives way without the loads, for a place that is not stable.

        Held back by forces that fade, it is led uphill, to an edge from which ways downhill part.  Where no
        stable rest is found downhill, that is what there is.
        """
        at_start, at_rest = self._holds()
        if at_rest:
            return found
        search = Search(self.problem, self.rigid, self.effort)
        below = search._downhill(self.problem.begin(), 0.0, stays=not at_start)
        if not below.reason and below.stable:
            return below
        stepped(self.problem, self.effort, signs=Signs(self.problem))  # turns are those on the way there
        return found

    def _holds(self) -> tuple[bool, bool]:
        """Return whether it holds without the loads at its start, and if so where that lets go to too."""
        with self.problem.apart() as problem:

            def holds(state: State) -> bool:
                return bool((lowest(problem, state, 0.0)[0] >= 0.0).all())

            at_start = holds(problem.begin())
            stays = at_start and not problem.thrown
            return at_start, stays or (at_start and holds(stepped(problem, Effort(), let_go)[1]))

    def _neutral(self, state: State, load: float) -> Array:
        return neutral(self.problem, state, load, self.rigid(self.problem.expand(state.z)))

    def _pushed(self, state: State) -> Array:
        """Return the motions that nothing resists, if the loads push any of them; else none."""
        free = self._neutral(state, 1.0)
        return free if are_pushed(self.problem, state, free) else free[:0]

    def _downhill(self, begin: State, limit: float | None, stays: bool = True) -> Equilibrium:
        """Return the place of rest that relaxation leads to; if it stays, next to its begin stable or not."""
        state = begin
        for _ in range(KICKS):
            try:
                state = relaxed(self.problem, state, self.effort)
            except NotFoundError as error:
                share = 0.0 if limit is None else limit
                held = nothing = np.zeros((0, state.z.shape[1]))
                if self.problem.turning is None:  # else nothing resists the turn itself, which is no reason
                    held = self._pushed(error.state)
                held = held if len(held) or error.motion is None else error.motion
                args = (begin, share, np.zeros(0), nothing, held, True, limit, self.effort)
                return Equilibrium(*args, reason=str(error), lost=error.state)
            found = self._judged(state, True, limit)
            if found.stable or self.problem.turning is not None:
                return found
            if stays and self.problem.moved(state.z - begin.z) < STAYED:
                return found
            push = found.motions[:1]
            state = state._replace(z=state.z + push * (KICK / self.problem.moved(push)))
        return found

    def _judged(self, state: State, relaxed_: bool, limit: float | None) -> Equilibrium:
        free = self._neutral(state, 1.0)
        values, motions, complete = self._signs.lowest(state, 1.0)
        zero = values == 0.0
        if zero.sum() > len(free):  # bodies may turn in themselves too, as a bent round shaft about its axis
            free, values, motions = motions[zero], values[~zero], motions[~zero]
        elif len(free):
            kept = np.sort(np.argsort(np.abs(values))[len(free) :])
            values, motions = values[kept], motions[kept]
        crossed = None if relaxed_ and limit is None else self._signs.crossed
        args = state, 1.0, values, motions, free, relaxed_, limit, self.effort
        led = self.problem.way.followed and not relaxed_
        return Equilibrium(*args, crossed=crossed, complete=complete, led=led)

