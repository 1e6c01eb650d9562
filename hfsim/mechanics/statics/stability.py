"""Whether a scene at rest would stay where it is: the slowest motions, and those that nothing holds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, random_signs
from hfsim.maths.eigenpairs import eigenpairs
from hfsim.maths.matrices import Matrix, assemble, complement, dense, is_sparse, positive, skewness
from hfsim.maths.pencils import EPS, Pencil
from hfsim.maths.rank import null_space
from hfsim.maths.squares import slowest_squares
from hfsim.mechanics.small_motions import BY_DIFFERENCES, blurs_of_forces, rounding_of_joints
from hfsim.mechanics.statics.problem import Level, Problem, State, Tangent

NONE = 1e-12
"""Stiffness along a motion, relative to all that adds up to it, that is rounding."""
PUSHED = 1e-9
"""Work on a motion, over that which all forces would do along it, up to which they do not push it."""
ASKEW = 1e-9
"""Part of a matrix that may be skew by rounding."""
NEAREST = 6
"""Eigenvalues of a large scene that are looked at, at least: the smallest."""


class Lowest(NamedTuple):
    """The smallest stiffnesses over masses on allowed motions.

    Attributes
    ----------
    values : ndarray, shape (k,)
        [1/s^2], ascending.
    motions : ndarray, shape (k, n)
    complete : bool or None
        Whether none smaller is missing; None where that is not known.
    """

    values: Array
    motions: Array
    complete: bool | None


@dataclass(eq=False)
class Signs:
    """How many motions are unstable along a path of the load.

    Attributes
    ----------
    problem : Problem
    crossed : float or None
        Share of the loads from which on there are more of them than before, the first such.
    """

    problem: Problem
    crossed: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._before: int | None = None
        self._seen: tuple[State, float, Lowest] | None = None

    def lowest(self, state: State, load: float) -> Lowest:
        """Return what `lowest` does, once for each state."""
        if self._seen is None or self._seen[0] is not state or self._seen[1] != load:
            self._seen = state, load, lowest(self.problem, state, load)
        return self._seen[2]

    def more(self, state: State, load: float) -> bool:
        """Return whether there are, for the first time, more than in the state that was noted last."""
        if self.crossed is not None:
            return False
        now = self._number(state, load)
        if now and self._before is None:
            here = self._seen
            self._before = self._number(self.problem.start, 0.0)
            self._seen = here
        return now > (self._before or 0)

    def note(self, share: float) -> None:
        """Go on to the state that was looked at last, which follows one at a share of the loads."""
        if self._seen is None or self.crossed is not None:
            return
        now = self._number(*self._seen[:2])
        if now > (self._before or 0):
            self.crossed = share
        self._before = now

    def _number(self, state: State, load: float) -> int:
        return int(np.sum(self.lowest(state, load)[0] < 0.0))


def neutral(problem: Problem, state: State, load: float, rigid: Array) -> Array:
    """Return the motions of rigid bodies that joints allow and nothing resists.

    Parameters
    ----------
    problem : Problem
    state : State
    load : float
    rigid : ndarray, shape (n_motions, n_x)
        Motions of each body by itself.

    Returns
    -------
    ndarray, shape (k, n)
        Of the free coordinates.
    """
    sizes = np.array([problem.gauge.size(row[None]) for row in rigid])
    there = sizes > NONE * sizes.max(initial=0.0)
    rigid = rigid[there] / sizes[there, None]
    rows = problem.system.unreduced.phi.jacobian_at(problem.expand(state.z))
    if not len(rigid):
        return np.zeros((0, state.z.shape[1]))
    gaps = np.asarray(rows @ rigid.T) if rows.shape[0] else np.zeros((0, len(rigid)))
    most = np.linalg.norm(np.asarray(abs(rows) @ np.abs(rigid.T)), axis=1) if len(gaps) else np.zeros(0)
    felt = np.linalg.norm(gaps, axis=1) > NONE * most
    gaps = gaps[felt] / most[felt, None]
    allowed = null_space(gaps).T @ rigid if len(gaps) else rigid
    motions = problem.system.reduction.free_rates(allowed)
    if not len(motions):
        return motions
    K, every = problem.tangent(state, load).stiffness, motions
    if is_sparse(K):
        from scipy.sparse import csr_array

        every = csr_array(motions)
    adding = abs(K) + _rounding_of_joints(problem, state, load) / EPS
    size = dense(abs(every) @ (adding @ abs(every).T))
    alone, mixed = _unresisted(dense(every @ (K @ every.T)), size)
    return np.vstack([motions[alone], mixed @ motions[~alone]])


def _unresisted(stiffness: Array, size: Array) -> tuple[BoolArray, Array]:
    """Return which of n motions, and which combinations (k, m) of the m others, a stiffness does not resist.

    Parameters
    ----------
    stiffness, size : ndarray, shape (n, n)
        Of the motions, maybe not symmetric, and what adds up to it.
    """
    least = NONE * size.diagonal().max()
    felt = np.abs(stiffness) > least
    alone = ~(felt.any(axis=0) | felt.any(axis=1))
    own, size = (one[np.ix_(~alone, ~alone)] for one in (stiffness, size))
    surely = NONE * size.sum(axis=1).max(initial=0.0)
    if positive(0.5 * (own + own.T) - surely * np.eye(len(own))):
        return alone, np.zeros((0, len(own)))
    # of loads that turn with bodies it is not symmetric, and only what no force at all answers is free
    _, values, mixed = np.linalg.svd(own)
    return alone, mixed[values <= NONE * np.diag(mixed @ size @ mixed.T).clip(min=least / NONE)]


def are_pushed(problem: Problem, state: State, motions: Array) -> bool:
    """Tell whether the loads push any of some motions (k, n)."""
    unit, force = problem.gauge.unit, problem.missing(state, Level(1.0))[0][0]
    every = np.linalg.norm(unit * problem.force(problem.expand(state.z), 1.0))
    ways = np.linalg.norm(problem.system.reduction.expand_rates(motions) / unit, axis=1)
    return bool((np.abs(motions @ force) > PUSHED * every * ways).any())


def lowest(problem: Problem, state: State, load: float) -> Lowest:
    """Return the smallest stiffnesses over masses on allowed motions.

    Those are squares of natural frequencies; a negative one is of a motion that grows by itself.  Of one that
    swings and grows, with what resists it, it is minus the square of the growth.
    """
    here, system = state.by_itself(), problem.system
    K, J = problem.tangent(here, load)
    K = _symmetric(K, bool(system.variable_mass))
    J = J[np.flatnonzero(np.asarray(abs(J).sum(axis=1)).ravel())]  # of the others nothing can move
    M, precision, blur = system.equations.free_mass_at(problem.expand(here.z)), EPS, None
    if system.variable_mass:
        precision = BY_DIFFERENCES
        if not _positive(M, J):  # far from straight there are models without a mass matrix
            M = system.reduction.reduced(problem.gauge.metric)
    else:
        beside = here._replace(z=here.z * (1.0 + EPS * random_signs(here.z.shape)))
        blur = abs(_symmetric(problem.tangent(beside, load).stiffness, False) - K)
        blur = blur + _rounding_of_joints(problem, here, load)
    pencil = Pencil(M, 0.0 * M, K, J, precision, 0.0, blur)
    resisting = None if is_symmetric(K, bool(system.variable_mass)) else _resistance(problem, here, load)
    values, motions, complete = _resisted(pencil, resisting)
    order = np.argsort(values)
    return Lowest(values[order], motions.T[order], complete)


def _rounding_of_joints(problem: Problem, state: State, load: float) -> Matrix:
    """Return what rounding leaves of the stiffness of joint forces, (n, n)."""
    system, x = problem.system, problem.expand(state.z)
    blurs: Array = np.zeros((0, system.n_rows))
    if not system.equations.phi.constant:  # else multipliers make no stiffness
        forces = blurs_of_forces(system, x, state.multipliers, problem.force(x, load))
        try:
            still = np.zeros((len(forces), system.n_rows))
            blurs = Tangent(problem.metric, problem.jacobian(state)).solved(forces, still)[1]
        except np.linalg.LinAlgError:  # what joints hold more than once has no multipliers of its own
            pass
    return rounding_of_joints(system, x, state.multipliers, blurs)


def _resisted(pencil: Pencil, resisting: Matrix | None) -> Lowest:
    """Return what `lowest` does, in any order and with motions (n, k); some matrix may resist them."""
    squares, motions, complete = slowest_squares(pencil, NEAREST)
    if resisting is None:
        values = np.where(squares.imag == 0.0, squares.real, -(np.sqrt(squares).imag ** 2))
        return Lowest(values, motions, complete)
    # it may end what swings and grows, and may let grow what would not
    found = eigenpairs(replace(pencil, velocity=resisting), NEAREST)
    kept = (squares.imag != 0.0) | (squares.real >= 0.0)
    grows = (found.values.imag >= 0.0) & (found.values.real > found.uncertainty)
    times = np.where(found.values.imag > 0.0, 2, 1)[grows]
    values = np.concatenate([np.abs(squares[kept]), np.repeat(-(found.values.real[grows] ** 2), times)])
    motions = np.hstack([motions[:, kept], np.repeat(found.vectors.real[:, grows], times, axis=1)])
    return Lowest(values, motions, complete and found.complete)


def _resistance(problem: Problem, state: State, load: float) -> Matrix | None:
    """Return minus the derivative of the forces by the rates at rest, (n, n); None where nothing resists."""
    system, x = problem.system, problem.expand(state.z)
    if problem.turning is not None:
        return None
    parts = [
        own._replace(values=one.at(load) * own.values)
        for one in problem.forces
        if one.part.uses_rates
        for own in [one.part.rate_tangent(problem.t, x, problem.rates(x, load))]
    ]
    if not any(one.values.any() for one in parts):
        return None
    shape = system.n_x, system.n_x
    return system.reduction.reduced(assemble(parts, shape, is_sparse(system.equations.constant_mass)))


def _symmetric(K: Matrix, by_differences: bool) -> Matrix:
    """Return a stiffness without what is skew by rounding."""
    return 0.5 * (K + K.T) if is_symmetric(K, by_differences) else K


def is_symmetric(K: Matrix, by_differences: bool) -> bool:
    """Tell whether a stiffness is, but for rounding; that of differences is one of the largest entry."""
    if by_differences:
        return bool(abs(K - K.T).max() <= ASKEW * abs(K).max())
    return skewness(K) <= ASKEW


def _positive(M: Matrix, J: Matrix) -> bool:
    """Tell whether all motions that rows allow have mass."""
    allowed = complement(dense(J))
    return positive(allowed.T @ dense(M) @ allowed)
