"""Explicit Runge-Kutta-Nystrom methods for q'' = a(t, q, q'): their tables and a step of theirs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from importlib.util import find_spec
from operator import itemgetter
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np

from hfsim.integrators._iteration import End, Place
from hfsim.integrators._problem import Problem
from hfsim.integrators._tableau import legendre
from hfsim.integrators._trajectory import two_point_series
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen

TINY = 1e-300
"""Keeps what is zero over zero from being asked for."""
KICKS = (0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879)
DRIFTS = (0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928)
"""Of the symmetric composition of order 6 with 11 stages of Blanes and Moan, J. Comput. Appl. Math. 142
(2002) 313: the first ones, from which the others follow."""


@frozen
class Nystrom:
    """A method whose stages follow from those before them, the first one at the start of the step.

    Attributes
    ----------
    order : int
    nodes : ndarray, shape (s,)
        Places of the stages within the step.
    A, A2 : ndarray, shape (s, s)
        From accelerations at the stages to rates and positions at the stages.
    b, b2 : ndarray, shape (s,)
        The same for the end of the step.
    end : int
        Number of the stage that is the end of the step; 0: none.
    errors, errors2 : ndarray, shape (1 or 2, s)
        The same for the errors of rates and positions: of an embedded method, or of two of them.
    to_series : ndarray, shape (m, s)
        From stage values to what `Segment` reads.
    """

    order: int
    nodes: Array
    A: Array
    A2: Array
    b: Array
    b2: Array
    end: int
    errors: Array
    errors2: Array
    to_series: Array

    @property
    def rows(self) -> Array:
        """What stages are made of, shape (s, 1 + 2 s): node, row of A2, row of A."""
        return np.concatenate([self.nodes[:, None], self.A2, self.A], axis=1)


class Step:
    """A step at work.

    Parameters
    ----------
    problem : Problem
    table : Nystrom
    place : Place
    """

    def __init__(self, problem: Problem, table: Nystrom, place: Place) -> None:
        self._problem, self._table, self._place = problem, table, place

    def stage(self, row: Array, a: Array) -> Array:
        """Return the accelerations at a stage (n,) that is made of some others (s, n)."""
        (t, q, v, h), s = self._place, len(a)
        there = t + row[0] * h, q + h * (row[0] * v + h * (row[1 : s + 1] @ a)), v + h * (row[s + 1 :] @ a)
        return self._problem.single(*there)

    def stages(self, a0: Array) -> Array:
        """Return the accelerations at all stages, shape (s, n)."""
        a = np.zeros((len(self._table.nodes), len(a0)))
        a[0] = a0
        for k, row in enumerate(self._table.rows[1:], start=1):
            a[k] = self.stage(row, a)
        return a

    def end(self, a: Array) -> End:
        """Return what accelerations at the stages lead to; errors of rates count over the step at least."""
        (_, q, v, h), table = self._place, self._table
        ends = q + h * (v + h * (table.b2 @ a)), v + h * (table.b @ a)
        scale = 1.0 + np.maximum(np.abs(q), np.abs(ends[0]))
        rates, positions = (
            _joined(np.abs(rows @ a / scale).max(axis=1)) for rows in (table.errors, table.errors2)
        )
        error = np.maximum(h * h * positions, np.minimum(h, 1.0) * h * rates)
        return End(*ends, table.to_series @ a, error, h * rates)


def _joined(errors: Array) -> Any:
    """Return one error for those of one embedded method, or of two (Hairer, Norsett and Wanner II.10)."""
    if len(errors) == 1:
        return errors[0]
    fifth, third = errors[0], errors[1]
    return fifth * fifth / np.sqrt(fifth * fifth + 0.01 * third * third + TINY)


@lru_cache(maxsize=1)
def order_8() -> Nystrom:
    """Return the pair of order 8 of Dormand and Prince, with its interpolant (ibid.), as SciPy has it."""
    nodes, A, fifth, third, D = (_alone() or _public)()
    b, errors = A[12], np.zeros((2, 16))
    errors[:, :13] = fifth, third
    return Nystrom(8, nodes, A, A @ A, b, b @ A, 13, errors, errors @ A, _interpolant(b, D))


def _alone() -> Callable[[], Sequence[Array]] | None:
    """Return what has the file with them, if there is one: what lies around it takes a third of a second."""
    scipy = find_spec("scipy")
    places = scipy.submodule_search_locations if scipy else None
    file = Path(*places or ("",), "integrate", "_ivp", "dop853_coefficients.py")
    return partial(itemgetter("C", "A", "E5", "E3", "D"), run_path(str(file))) if file.exists() else None


def _public() -> Sequence[Array]:
    """Return the coefficients from where SciPy has them for everybody."""
    from scipy.integrate import DOP853

    A = np.zeros((16, 16))
    A[:12, :12], A[12, :12], A[13:] = DOP853.A[:12, :12], DOP853.B, DOP853.A_EXTRA
    return np.array([*DOP853.C[:12], 1.0, *DOP853.C_EXTRA]), A, DOP853.E5, DOP853.E3, DOP853.D


def _interpolant(b: Array, D: Array) -> Array:
    """Return the map from accelerations at the stages to the Legendre series of the pair's interpolant.

    Parameters
    ----------
    b : ndarray, shape (16,)
        From them to the change of the velocities.
    D : ndarray, shape (4, 16)
        Its coefficients of higher order.
    """
    first, last = np.eye(16)[[0, 12]]
    F = np.stack([b, first - b, 2.0 * b - last - first, *D])
    theta = 0.5 * (1.0 - np.cos(np.pi * (np.arange(8) + 1.0) / 8.0))
    increments = np.zeros((8, 16))
    for i in range(6, -1, -1):
        increments = (increments + F[i]) * (theta if i % 2 == 0 else 1.0 - theta)[:, None]
    return np.asarray(np.linalg.pinv(legendre(theta, 7)[1]) @ increments)


@lru_cache(maxsize=1)
def order_6() -> Nystrom:
    """Return a composition of kicks and drifts, for accelerations that do not depend on the velocities.

    Its errors are those of its weights as a quadrature. Accelerations inside a step are of low order, so that
    only those at its ends go into the series.
    """
    b = np.array([*KICKS, 0.5 - sum(KICKS)])
    b, half = np.concatenate([b, b[::-1]]), np.array(DRIFTS)
    drifts = np.concatenate([half, [1.0 - 2.0 * half.sum()], half[::-1]])
    A, s = np.tril(np.tile(b, (len(b), 1)), -1), len(b)
    nodes, A2 = np.zeros(s), np.zeros((s, s))
    for k, drift in enumerate(drifts, start=1):
        nodes[k], A2[k] = nodes[k - 1] + drift, A2[k - 1] + drift * A[k]
    nodes[-1] = 1.0
    degrees = np.arange(6) + 1.0
    errors = b - _quadrature(nodes, 1.0 / degrees)
    errors2 = A2[-1] - _quadrature(nodes, 1.0 / (degrees * (degrees + 1.0)))
    first, last = np.eye(s)[[0, -1]]
    series = two_point_series(1.0, (A2[-1], b, last), (0.0 * b, 0.0 * b, first))
    return Nystrom(6, nodes, A, A2, b, A2[-1], s, errors[None], errors2[None], series)


def _quadrature(nodes: Array, moments: Array) -> Array:
    """Return the smallest weights with which a quadrature has such moments."""
    return np.asarray(np.linalg.pinv(np.vander(nodes, len(moments), increasing=True).T) @ moments)
