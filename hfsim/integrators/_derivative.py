"""What Newton corrections ask of a derivative of the accelerations, whatever its form."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from hfsim.integrators._problem import Increments, Problem
from hfsim.integrators._tableau import Collocation
from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Matrix
from hfsim.maths.replayed import arrays_in

Correction = Callable[[Array], tuple[Array, Array]]
"""From residuals at the stages (s, n_r) to corrections, as displacements, and the size of their consequence:
the displacement to which the change of the velocity at the end of the step leads, which is what an unfinished
iteration does to the steps that follow."""


class Start(NamedTuple):
    """The start of a step as natural increments have it."""

    at: Any
    """Geometry of the state, as a batch of one."""
    acceleration: Array
    """Of the state's own coordinates, (n,)."""
    first: Array
    """First time derivatives of the natural coordinates, (n,)."""
    second: Array
    convective: Array
    """What velocities alone make of the second ones, (n,)."""


class Strained(NamedTuple):
    """Strains of the stages."""

    seen: Array
    """Those of the states, (s, n_strains)."""
    expected: Array
    """Those to which the last correction was to lead."""


class Stages(NamedTuple):
    """The stages of a step as an iteration has them."""

    at: Any
    """Geometry of their states."""
    t: Array
    """Their times, (s,)."""
    q: Array
    """Their states, (s, n)."""
    v: Array
    a: Array
    strained: Strained | None = None

    @property
    def expected(self) -> Array | None:
        """Strains that are expected, if these are variables."""
        return None if self.strained is None else self.strained.expected


_Value = TypeVar("_Value")


class ByStep(Generic[_Value]):
    """What belongs to a step length, kept until another one is asked for."""

    def __init__(self) -> None:
        self._h: float | None = None

    def anew(self) -> ByStep[_Value]:
        """Return one that has kept nothing."""
        return ByStep()

    def of(self, h: float, make: Callable[[], _Value]) -> _Value:
        """Return what belongs to a step length; while that is recorded, it is made anew."""
        if isinstance(h, np.ndarray):
            return make()
        if h != self._h:
            self._value, self._h = make(), h
        return self._value


class Derivative:
    """Derivatives J_q and J_v of the accelerations at a state, in some coordinates for corrections.

    Attributes
    ----------
    increments : Increments
        The coordinates it is written in.
    taken : ndarray
        Where: t, q, v, expected strains, and the angles whose turns are counted.
    ways : tuple of str
        What was replayed then.
    """

    holds_arrays: ClassVar[bool] = True
    recordable: ClassVar[bool] = True
    """Whether steps with it can be recorded."""
    increments: Increments
    taken: Array
    ways: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """Number of coordinates."""
        raise NotImplementedError

    @cached_property
    def fastest(self) -> float:
        """Largest circular frequency in it [rad/s]."""
        return float(self.frequency())

    def frequency(self) -> Array:
        """Return the same, shape ()."""
        raise NotImplementedError

    def ringing(self) -> Array:
        """Return the circular frequencies of what is not damped well [rad/s], or a bound of them alone."""
        return np.array([self.fastest])

    def check(self) -> None:
        """Raise LinAlgError if it is of no use."""

    def know_strains(self, stiffness: Array, slopes: Matrix, q: Array) -> None:
        """Take note of the stiffness of strains and of their derivative (n_strains, n) by a state (n,)."""
        at = self.increments.geometry(q[None])
        self._stiffness, self._slopes = stiffness, self.increments.to_natural_forces(at, slopes)

    def strain_changes(self, y: Array) -> Array:
        """Return the changes of strains (s, n_strains) with small natural increments (s, n)."""
        return np.asarray(y @ self._slopes.T)

    def pull(self, strained: Strained) -> Array:
        """Return the forces on natural increments (s, n) that strains not expected resist with."""
        return np.asarray(((strained.seen - strained.expected) * self._stiffness) @ self._slopes)

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Return displacements at the stages, (s, n), in natural increments."""
        raise NotImplementedError

    def _linear_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Return such displacements as the method itself has them for the linearised equations."""
        tau = h * table.nodes[:, None]
        uniform = tau * start.first + h * h * table.A2.sum(axis=1)[:, None] * start.second
        return self.correction(table, h)(table.A2_inverse @ uniform / h**2)[0]

    def residual(self, problem: Problem, stages: Stages) -> Array:
        """Return by how much the accelerations fail the equations, (s, n_r), in columns of its own.

        They are missing accelerations in natural increments unless said otherwise.  Forces are those of
        expected strains if these are given; what is seen beyond them acts as it would where the derivative
        was taken.
        """
        at, t, q, v, a, _ = stages
        return self.increments.to_natural(at, problem.evaluate(t, q, v, stages.expected) - a)

    def reading(self, r: Array) -> Array:
        """Return accelerations that are missing, (s, n) in natural increments, in these columns."""
        return r

    def correction(self, table: Collocation, h: float) -> Correction:
        """Return the map from residuals at the stages to corrections."""
        raise NotImplementedError

    def solver(self, by_q: float, by_v: float) -> Callable[[Array], Array]:
        """Return the map r -> (I - by_q J_q - by_v J_v)^-1 r of single residuals (n,)."""
        inverse = self.inverse(by_q, by_v)
        return lambda r: np.asarray(inverse @ r)

    def inverse(self, by_q: float, by_v: float) -> Array:
        """Return the matrix of that map, shape (n, n), where matrices are dense."""
        raise NotImplementedError


def in_natural(natural: Increments, at: Any, *slopes: Array) -> list[Array]:
    """Return derivatives by state coordinates, n of them, as ones by natural coordinates."""
    n = len(slopes[0])
    unit = natural.from_natural(at, np.eye(n)).T
    rows = natural.to_natural(at, np.concatenate([(J @ unit).T for J in slopes]))
    return [rows[k : k + n].T for k in range(0, len(rows), n)]


def form(derivative: Derivative) -> str:
    """Return what derivatives must have in common to have the same memory, as a text."""
    arrays = (one for one in arrays_in(derivative) if one[0] != ".taken")
    shapes = [f"{name}{one.shape}{one.dtype.char}" for name, one in arrays]
    return " ".join([type(derivative).__name__, type(derivative.increments).__name__, *shapes])
