"""The equations of equilibrium: forces on the free coordinates, gaps of the joints, and their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, factorised, is_sparse, saddle_point
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.small_motions import resistance
from hfsim.mechanics.statics.gauge import Gauge, resisting
from hfsim.mechanics.statics.way import Way
from hfsim.mechanics.system import System
from hfsim.mechanics.turning import Turning

SLIGHT, FAINT = 1e-2, 1e-15
"""Of what holds: the most beside the square of a rate, and the least beside the stiffest of all."""


class Weighted(NamedTuple):
    """A force with a factor that grows with the load factor s: fixed + growing s.

    Attributes
    ----------
    part : ForcePart
    fixed, growing : float
    """

    part: ForcePart
    fixed: float
    growing: float

    def at(self, s: float) -> float:
        """Return the factor."""
        return self.fixed + self.growing * s


class Level(NamedTuple):
    """How much of what acts is put on.

    Attributes
    ----------
    load : float
        Factor of the loads that are varied.
    rest : float
        Share of what is out of balance without them at the start that is held by auxiliary forces, and of the
        time until which joints have not been led by their laws yet.
    """

    load: float = 1.0
    rest: float = 0.0


class State(NamedTuple):
    """A state of a system at rest.

    Attributes
    ----------
    z : ndarray, shape (1, n)
        Free coordinates.
    multipliers : ndarray, shape (1, n_rows)
    expected : list of ndarray or None
        Strains of each force to which the last correction was to lead; see `hfsim.mechanics.strained`.
    """

    z: Array
    multipliers: Array
    expected: list[Array | None] | None = None

    def by_itself(self) -> State:
        """Return it with the strains that it has, not others that were expected."""
        return self._replace(expected=None)


Watch = Callable[[float, State], None]

Correction = tuple[Array, Array]
"""Changes of the free coordinates (1, n) and of the multipliers (1, n_rows)."""
Solver = Callable[[Array, Array], Correction]
"""From forces (k, n) and gaps (k, n_rows) to the changes that answer and close them."""


class Tangent(NamedTuple):
    """Derivatives at a state.

    Attributes
    ----------
    stiffness : Matrix, shape (n, n)
    jacobian : Matrix, shape (n_rows, n)
    """

    stiffness: Matrix
    jacobian: Matrix

    def solved(self, force: Array, gap: Array) -> Correction:
        """Return changes (k, n) and multipliers (k, n_rows) that answer forces (k, n) and close gaps.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the matrix is singular.
        """
        return self.solver()(force, gap)

    def solver(self) -> Solver:
        """Return the same for several of them, with a sparse matrix factorised once."""
        held = np.asarray(abs(self.jacobian).sum(axis=1)).ravel() > 0.0  # in others nothing can move
        n, jacobian = self.stiffness.shape[0], self.jacobian if held.all() else self.jacobian[held]
        size = float(np.abs(self.stiffness.diagonal()).max(initial=0.0)) or 1.0
        solve = factorised(saddle_point(self.stiffness, size * jacobian) if held.any() else self.stiffness)

        def solved(force: Array, gap: Array) -> Correction:
            found = solve(np.concatenate([force, size * gap[:, held]], axis=1))
            if not np.isfinite(found).all():
                raise np.linalg.LinAlgError("singular")
            multipliers = np.zeros_like(gap)
            multipliers[:, held] = found[:, n:] * size
            return found[:, :n], multipliers

        return solved


@frozen
class Problem:
    """A system whose equilibrium is sought at a time at which all rates are zero.

    Attributes
    ----------
    system : System
    t : ndarray, shape (1,)
        [s]
    start : State
    forces : tuple of Weighted
    gauge : Gauge
    counted : list
        The angles whose turns are counted, where they were at the start.
    watch : callable
        Told the load factor and each state that is kept on the way; may raise `NotFoundError`.
    restart : callable
        Told that the way begins anew at the start.
    turning : Turning or None
        Steady rotation as seen from which the system is to stand still; its inertia grows with the load.
    hold : float
        What holds, in corrections alone, motions that nothing brings back: over the stiffest of all.
    free : ndarray, shape (k, n), or None
        Motions that nothing resists or pushes, which corrections leave out.
    least : float
        Load factor from which paths go on.
    """

    system: System
    t: Array
    start: State
    forces: tuple[Weighted, ...]
    gauge: Gauge
    counted: list[tuple[ForcePart, float]] = field(default_factory=list)
    watch: Watch = lambda load, state: None
    restart: Callable[[], None] = lambda: None
    turning: Turning | None = None
    hold: float = 0.0
    free: Array | None = None
    least: float = 0.0

    @classmethod
    def of(
        cls, system: System, t: float, z: Array, forces: Sequence[Weighted], gauge: Gauge, watch: Watch
    ) -> Problem:
        """Return the problem of a system that starts from free coordinates (1, n)."""
        time, x = np.array([t]), system.reduction.expand(z)
        every = [one.part for one in forces if one.part.counter is not None]
        angles = [float(part.counter.counted(time, part.angle(x))[0]) for part in every if part.counter]
        state = State(z, np.zeros((1, system.n_rows)))
        return cls(system, time, state, tuple(forces), gauge, list(zip(every, angles, strict=True)), watch)

    def begin(self) -> State:
        """Return the start, with all turns as they were there."""
        self._suppose(self.counted)
        self.restart()
        return self.start

    def _suppose(self, angles: Iterable[tuple[ForcePart, float]]) -> None:
        """Say where angles are."""
        for part, angle in angles:
            if part.counter is not None:
                part.counter.suppose(float(self.t[0]), angle)

    @contextmanager
    def apart(self) -> Iterator[Problem]:
        """For the time being, look at other states: nothing is told of them, and turns stay as they are."""
        counters = [part.counter for part, _ in self.counted if part.counter is not None]
        before = [(one.noted, one.now) for one in counters]
        try:
            yield replace(self, watch=lambda load, state: None, restart=lambda: None)
        finally:
            for one, known in zip(counters, before, strict=True):
                one.take(*known)

    def starting(self, state: State) -> Problem:
        """Return the problem of going on from a state, with the turns that have been counted so far."""
        return replace(self, start=state, counted=list(self._turned(state)))

    def _turned(self, state: State) -> Iterator[tuple[ForcePart, float]]:
        """Yield the angles whose turns are counted, where they are in a state."""
        x = self.expand(state.z)
        for part, _ in self.counted:
            if part.counter is not None:
                yield part, float(part.counter.counted(self.t, part.angle(x))[0])

    def note(self, load: float, state: State) -> None:
        """Keep a state: tell of it, and count the turns of angles."""
        self.watch(load, state)
        self._suppose(self._turned(state))

    def expand(self, z: Array) -> Array:
        """Return the coordinates of free ones (n_batch, n)."""
        return self.system.reduction.expand(z)

    def expand_rates(self, dz: Array) -> Array:
        """Return the changes of coordinates with those of free ones (n_batch, n)."""
        return self.system.reduction.expand_rates(dz)

    def moved(self, dz: Array) -> float:
        """Return how large changes (1, n) of free coordinates are; see `Gauge`."""
        return self.gauge.size(self.expand_rates(dz))

    # ------------------------------------------------------------------ forces

    def force(self, x: Array, load: float) -> Array:
        """Return the generalised force of all parts at rest, (n_batch, n_x)."""
        t, u, out = np.repeat(self.t, len(x)), self.rates(x, load), np.zeros_like(x)
        if self.turning is not None:
            out -= load * self.system.equations.momentum(x, self.turning.accelerations(x))
        for one in self.forces:
            factor = one.at(load)
            if factor == 1.0:
                one.part.add_force(t, x, u, out)
            elif factor:
                own = np.zeros_like(x)
                one.part.add_force(t, x, u, own)
                out += factor * own
        return out

    def rates(self, x: Array, load: float) -> Array:
        """Return the rates of the steady rotation, whose inertia forces grow with their square."""
        return np.zeros_like(x) if self.turning is None else load**0.5 * self.turning.rates(x)

    def load(self, z: Array) -> Array:
        """Return the derivative of the forces on free coordinates by the load factor, (1, n)."""
        x = self.expand(z)
        u, out = np.zeros_like(x), np.zeros_like(x)
        for one in self.forces:
            if one.growing:
                own = np.zeros_like(x)
                one.part.add_force(self.t, x, u, own)
                out += one.growing * own
        return self.system.reduction.free_force(out)

    def held(self, level: Level) -> tuple[Array, Array]:
        """Return the auxiliary forces (1, n) and gaps (1, n_rows) of a level."""
        if not level.rest:
            return np.zeros_like(self.start.z), np.zeros_like(self.start.multipliers)
        force, gap = self._held
        return level.rest * force, level.rest * gap

    @property
    def thrown(self) -> bool:
        """Whether anything is out of balance at the start without the loads, or moved by laws of time."""
        return any(one.any() for one in self._held) or self.way.moves

    @cached_property
    def way(self) -> Way:
        """That of the joints."""
        return Way.of(self.system, self.t)

    @cached_property
    def _held(self) -> tuple[Array, Array]:
        """What is missing at the start without the loads; angles are to be counted from there when asked."""
        return self._missing(self.start.z, self.start.multipliers, Level(0.0, 1.0))

    def missing(self, state: State, level: Level) -> tuple[Array, Array]:
        """Return forces (1, n) that are out of balance, and gaps (1, n_rows) of the joints."""
        held, gap = self.held(level)
        found, own = self._missing(state.z, state.multipliers, level)
        return found - held, own - gap

    def foreseen(self, state: State, level: Level) -> Array:
        """Return the forces (1, n) that are missing in a state with its expected strains."""
        return replace(self, forces=self._with_strains(state.expected)).missing(state, level)[0]

    def _missing(self, z: Array, multipliers: Array, level: Level) -> tuple[Array, Array]:
        """Return both in states (n_batch, n), without auxiliary forces."""
        x, equations = self.expand(z), self.system.equations
        force = self.system.reduction.free_force(self.force(x, level.load))
        if not equations.n_rows:
            return force, np.zeros((len(z), 0))
        if len(z) == 1:
            pull = np.asarray(multipliers @ equations.phi.jacobian_at(x))
        else:
            pull = (multipliers[:, None] @ equations.phi.jacobians(x))[:, 0]
        gap = equations.phi.residual(np.repeat(self.way.time(level.rest), len(z)), x)
        return force - self.system.reduction.free_force(pull), gap

    # ------------------------------------------------------------------ derivatives

    def tangent(self, state: State, load: float) -> Tangent:
        """Return the derivatives of what is missing, with the strains that are expected, and what holds."""
        found = self._tangent(state, load)
        if self.free is not None and len(self.free):
            found = found._replace(stiffness=found.stiffness + self._stiffest(found) * self._left_out)
        if not self.hold:
            return found
        stiffest = self._stiffest(found)
        # what inertia alone brings back, or leads away, is not to feel it
        slight = SLIGHT * load * self.turning.rate**2 if self.turning is not None else 0.0
        held = slight if FAINT * stiffest < slight < self.hold * stiffest else self.hold * stiffest
        return found._replace(stiffness=found.stiffness + held * self.metric)

    def _stiffest(self, tangent: Tangent) -> float:
        return float((np.abs(tangent.stiffness.diagonal()) / self.metric.diagonal()).max(initial=0.0)) or 1.0

    @cached_property
    def _left_out(self) -> Matrix:
        """What resists free motions, as much as the metric does, (n, n)."""
        assert self.free is not None
        return resisting(self.metric, self.free)

    @cached_property
    def metric(self) -> Matrix:
        """That of the gauge in free coordinates, (n, n)."""
        return self.system.reduction.reduced(self.gauge.whole)

    def jacobian(self, state: State) -> Matrix:
        """Return the derivative of the gaps by the free coordinates, (n_rows, n)."""
        return self.system.equations.phi.jacobian_at(self.expand(state.z)) @ self.system.reduction.basis

    def _tangent(self, state: State, load: float) -> Tangent:
        x, system = self.expand(state.z), self.system
        u, parts = self.rates(x, load), list[Entries]()
        for one in self._with_strains(state.expected):
            if factor := one.at(load):
                own = one.part.tangent(self.t, x, u)
                parts.append(own if factor == 1.0 else own._replace(values=factor * own.values))
        equations = system.equations
        if not equations.phi.constant:
            parts += equations.phi.stiffness(x, state.multipliers)
        if self.turning is not None:
            carried = load * self.turning.accelerations(x)
            parts += [body.inertia_slopes(x, carried) for body in equations.variable_mass]
        sparse = is_sparse(equations.constant_mass)
        whole = assemble(parts, (system.n_x, system.n_x), sparse)
        if self.turning is not None:
            W = self.turning.matrix
            whole = whole + load * (equations.mass_at(x) @ W @ W)
            whole = whole + load**0.5 * (resistance(system, self.t, x, u) @ W)
        return Tangent(system.reduction.reduced(whole), self.jacobian(state))

    def _with_strains(self, expected: list[Array | None] | None) -> tuple[Weighted, ...]:
        """Return all forces, with expected strains where there are such."""
        if expected is None:
            return self.forces
        return tuple(
            one if strains is None else one._replace(part=one.part.strained(strains))
            for one, strains in zip(self.forces, expected, strict=True)
        )

    def expecting(self, state: State, dz: Array) -> list[Array | None]:
        """Return the strains of each force to which changes (1, n) of a state are to lead."""
        x, dx = self.expand(state.z), self.expand_rates(dz)
        found: list[Array | None] = []
        for one in self.forces:
            if not one.part.strain_stiffness.size:
                found.append(None)
                continue
            rows, columns, slopes = one.part.strain_slopes(x)
            changes = np.bincount(rows, slopes * dx[0, columns], one.part.strain_stiffness.size)
            found.append(one.part.strain(x) + changes)
        return found
