"""The state about which a scene is linearised, and how steady it is.

Rates of the state are seen from axes that turn with the scene, where it turns as a whole; in these a steady
rotation is an equilibrium.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from hfsim.deck.source import did_you_mean
from hfsim.errors import ArgumentError, HfsimError
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Progress
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import is_sparse
from hfsim.mechanics.small_motions import SmallMotions, small_motions
from hfsim.mechanics.system import System
from hfsim.mechanics.turning import NOISE, Turning
from hfsim.scene.build import Scene, build
from hfsim.scene.equilibrium import standing
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.nearby import nearby, resting
from hfsim.scene.resting import turning_with
from hfsim.scene.rules import welded

STATES = ("start", "equilibrium", "steady")
"""States that can be asked for, beside that of a run at a time."""
STEADY = 1e-6
"""Distance from the equilibrium over the size of the scene that counts as none."""
_BALANCED = 1e-9
"""Acceleration, over that of the axes, that is rounding."""
_BORNE = 1e-3
"""Likewise, up to which the forces of inertia are borne."""
_HELD = 1e-12
"""What holds motions that nothing brings back, over the square of the fastest frequency."""
_FAR = 1e3
"""Distance, over the size, beyond which it is not told."""
EVEN = 1e-6
"""The same for accelerations after a turn, over those of the rotation, and for what small motions meet."""


class ModesError(HfsimError):
    """The scene cannot be linearised where it was asked for."""

    exit_code = 2


@frozen
class About:
    """A scene linearised about a state.

    Attributes
    ----------
    state : str
        ``start``, ``equilibrium``, ``steady`` or ``time``.
    t : float
        Of loads and drivers [s].
    """

    scene: Scene
    state: str
    t: float
    motions: SmallMotions

    @cached_property
    def system(self) -> System:
        """The equations; in a state that is to last laws of joints stand, at rest those of servos too."""
        system = self.scene.system
        return standing(system, self.state == "steady") if self.state in STATES[1:] else system

    @property
    def turning(self) -> Turning | None:
        """The axes that the small motions are seen from, where these turn."""
        return self.motions.turning

    @property
    def axes_turn(self) -> bool:
        """Whether these axes turn, and not only bodies in them by themselves."""
        return self.turning is not None and bool(np.any(self.turning.spin))

    def from_axes_at_rest(self) -> About | None:
        """Return the same state where nothing turns but round bodies by themselves; None where more does."""
        if not self.axes_turn:
            return None
        at = self.motions
        turning = _turning(self.scene, self.t, at, alone=True)
        if turning is None or turning.spin.any():
            return None
        return replace(self, motions=small_motions(self.system, self.t, at.x, at.u, turning))

    @cached_property
    def mass(self) -> float:
        """Of all that moves [kg]."""
        scene = self.scene
        shift = Turning.units(scene.bodies.values(), scene.deck.dimension)[0]
        return 2.0 * float(scene.system.kinetic_energy(self.motions.x[None], shift.travel[None])[0])

    @cached_property
    def size(self) -> float:
        """Largest distance of points of the bodies along an axis [m]."""
        outlines = [
            body.extent(self.motions.x[None])[0] for body in self.scene.bodies.values() if not body.still
        ]
        return float(np.ptp(np.concatenate(outlines), axis=0).max()) or 1.0

    def _mean(self, rates: Array) -> float:
        """Return the root of the mean square of rates or accelerations (n_x,), by mass."""
        energy = float(self.scene.system.kinetic_energy(self.motions.x[None], rates[None])[0])
        return float(np.sqrt(max(0.0, 2.0 * energy) / self.mass)) if self.mass > 0.0 else 0.0

    @property
    def _steady(self) -> Array:
        """Accelerations (n_x,) of the axes where the bodies are."""
        x = self.motions.x
        return 0.0 * x if self.turning is None else self.turning.accelerations(x[None])[0]

    @cached_property
    def acceleration(self) -> float:
        """What the state accelerates by, seen from the axes, root of mean square by mass [m/s^2]."""
        return self._mean(self.motions.a - self._steady)

    @cached_property
    def speed(self) -> float:
        """How fast it moves, seen from the axes, likewise [m/s]."""
        x = self.motions.x
        steady = 0.0 if self.turning is None else self.turning.rates(x[None])[0]
        return self._mean(self.motions.u - steady)

    @property
    def after_a_turn(self) -> tuple[Array, Array]:
        """The coordinates (1, n_x) after a turn by one radian, and their rates."""
        assert self.turning is not None
        seconds = 1.0 / self.turning.rate
        x = self.turning.turned(self.motions.x[None], seconds)
        return x + seconds * self.turning.travel, self.turning.rates(x)

    @cached_property
    def unevenness(self) -> float:
        """How much else accelerations are after a turn by one radian, over those of the rotation [-].

        Loads and drivers act as they do at the time of the state.
        """
        if self.turning is None:
            return 0.0
        system, turning = self.system, self.turning
        x, u = self.after_a_turn
        if not np.allclose(system.reduction.expand(system.reduction.free(x)), x, atol=1e-6 * self.size):
            return np.inf
        t = np.array([self.t])
        found = system.reduction.expand_rates(system.equations.solve(t, x, u, system.force(t, x, u))[0])
        before = self.motions.a - turning.accelerations(self.motions.x[None])[0]
        after = found[0] - turning.accelerations(x - turning.travel / turning.rate)[0]
        size = self._mean(turning.accelerations(self.motions.x[None])[0]) or 1.0
        # in the axes, what there is of other accelerations turns with them
        change = abs(self._mean(after) - self._mean(before))
        return 0.0 if change <= self._rounding else change / size

    @property
    def _rounding(self) -> float:
        """Accelerations that are rounding, likewise [m/s^2]."""
        return NOISE * self._mean(self.motions.blur)

    @cached_property
    def distance(self) -> float:
        """How far the equilibrium is by the stiffness of the state, mean square by mass [m]."""
        x, pencil = self.motions.x, self.motions.pencil
        force = self.scene.system.equations.momentum(x[None], (self.motions.a - self._steady)[None])
        M, _, K, _ = pencil.matrices
        free = self.scene.system.reduction.free_force(force)[0]
        gap = np.zeros(pencil.jacobian.shape[0])
        try:
            step, _ = pencil.answer(K + _HELD * pencil.fastest * M, free, gap)
        except np.linalg.LinAlgError:
            return np.inf
        return self._mean(self.motions.basis @ step)

    @property
    def lasting(self) -> bool:
        """Whether it is an equilibrium or a steady rotation, to `STEADY`."""
        moving = self._mean(self.motions.u)
        # where nothing brings motions back, rounding alone may seem to lead far away
        inertia = self._mean(self._steady)
        balanced = self.acceleration <= max(_BALANCED * inertia, self._rounding)
        # what is stiff along itself is near to where centrifugal forces stretch it, but they are not borne
        borne = not inertia or self.acceleration <= _BORNE * inertia
        near = borne and self.distance <= STEADY * self.size
        return (balanced or near) and self.speed <= STEADY * max(self.size, moving)

    def facts(self) -> dict[str, Any]:
        """Return what is known of the state."""
        turning = self.turning
        return {
            "state": self.state,
            "time": self.t,
            "spin": None if turning is None else np.atleast_1d(turning.spin).tolist(),
            "rotors": {} if turning is None else turning.own,
            "axis_through": None if turning is None else turning.centre.tolist(),
            "acceleration": self.acceleration,
            "speed": self.speed,
            "away_from_equilibrium": min(self.distance, _FAR * self.size),
        }


def about(
    loaded: LoadedDeck, state: str = "start", at: float | None = None, progress: Progress | None = None
) -> About:
    """Return a scene linearised about a state.

    Parameters
    ----------
    state : str
        One of `STATES`, with which the scene starts.
    at : float, optional
        Instead: the time of a run from there [s].

    Raises
    ------
    ArgumentError
        If there is no such state, or there are two.
    DeckError
        If the scene cannot be assembled, or a law has no value somewhere until the time.
    ModesError
        If the run does not come so far, with its exit code, or the equations are singular in the state.
    KeyboardInterrupt
        If a signal ends the run.
    """
    _checked(state, at)
    scene = build(loaded.until(at) if at else loaded)
    if at is not None:
        q, v = _after(scene, at, progress)
        return linearised(scene, q, v, "time", at)
    if state == "equilibrium":
        return _resting(scene)
    found = linearised(scene, scene.q, scene.v, state)
    return found if state != "steady" else turning_at(found, None)


def _checked(state: str, at: float | None) -> None:
    """Refuse what names no one state."""
    if state not in STATES:
        raise ArgumentError(f"there is no state '{state}': {did_you_mean(state, STATES)}")
    if at is not None and state != STATES[0]:
        raise ArgumentError(f"about {state} and at {at:g} s are two states; one of them can be told")
    if at is not None and not 0.0 <= at < np.inf:
        raise ArgumentError(f"at {at:g} s there is no state: a run begins at 0 s")


def seen_from(start: About, body: str) -> About:
    """Return a start as seen from axes that turn with one body, or at rest where nothing but rotors turns.

    Raises
    ------
    ModesError
        If there is no such body, or it does not turn and the joints leave no one axis.
    """
    scene = start.scene
    if body not in scene.bodies:
        raise ModesError(f"there is no body '{body}': {', '.join(scene.bodies)}")
    at = start.turning
    if at is not None and not start.axes_turn and np.isclose(abs(at.own.get(body, 0.0)), at.rate):
        return start
    turning: Turning | None = turning_with(scene, body)
    if turning is not None and not turning.rate:
        bodies = list(scene.bodies.values())
        turning = Turning.held_by_joints(bodies, scene.system.equations, start.motions.x)
    if turning is None:
        raise ModesError(f"'{body}' does not turn at the start, nor do the joints leave one axis")
    return replace(start, motions=replace(start.motions, turning=turning))


def turning_about(start: About) -> About:
    """Return a start as seen from axes that turn as it does or, where it does not turn, as its joints allow.

    Raises
    ------
    ModesError
        If nothing turns, and the joints leave no one axis.
    """
    if start.turning is not None:
        return start
    bodies, equations = list(start.scene.bodies.values()), start.scene.system.equations
    turning = Turning.held_by_joints(bodies, equations, start.motions.x)
    if turning is None:
        raise _no_one_axis(start, "say with --spin-body NAME about whose axis")
    return replace(start, motions=replace(start.motions, turning=turning))


def _no_one_axis(start: About, remedy: str) -> ModesError:
    """Return what keeps a start from telling an axis: bodies that move each by itself, or none that does."""
    if start.motions.u.any():
        return ModesError(f"bodies turn differently at the start, or none does, though they move: {remedy}")
    told = "give bodies rates with initial, such as angular_velocity"
    return ModesError(f"nothing turns at the start: {told}, or {remedy}")


def _resting(scene: Scene) -> About:
    """Return the equilibrium next to the start or, with none so near, where the scene comes to rest."""
    x = resting(scene)
    try:
        motions = small_motions(standing(scene.system), 0.0, x, 0.0 * x)
    except np.linalg.LinAlgError as error:
        raise ModesError(f"the equations of motion are singular at rest: {error}") from None
    return About(scene, "equilibrium", 0.0, motions)


def turning_at(start: About, rate: float | None) -> About:
    """Return the steady rotation next to a state that turns, at its rate or another [rad/s].

    Raises
    ------
    ModesError
        If nothing turns in the state, or there is no steady rotation next to it.
    """
    turning = start.turning
    if turning is None:
        raise _no_one_axis(start, "--spin RATES with --spin-body NAME looks about the axis of one")
    return _settled(start, turning if rate is None else turning.at_rate(rate))


def _settled(start: About, turning: Turning) -> About:
    scene, t = start.scene, start.t
    told = ", ".join(f"{one:.4g}" for one in np.atleast_1d(turning.spin))
    told = f"steady{f' at {told} rad/s' if turning.rate else ''}"
    try:
        x = nearby(scene, t, start.motions.x, turning)
        if x is None and (together := _together(scene, turning)) is not None:
            turning = together
            x = nearby(scene, t, start.motions.x, turning)
        if x is None:
            raise ModesError(f"{told}: no state that lasts was found next to it")
        axes, system = turning if turning.rate else None, standing(scene.system, moving=True)
        return About(scene, "steady", t, small_motions(system, t, x, turning.rates(x[None])[0], axes))
    except np.linalg.LinAlgError as error:
        raise ModesError(f"{told}: {error}") from None


def _together(scene: Scene, turning: Turning) -> Turning | None:
    """Return the turn of everything to which drag leads bodies that turn by themselves; None without."""
    if not turning.own:
        return None
    if np.any(turning.spin):
        shared = turning.spin, turning.centre, is_sparse(turning.matrix), turning.velocity
        return Turning.of(scene.bodies.values(), *shared)
    fastest = max(turning.own, key=lambda name: abs(turning.own[name]))
    found: Turning | None = turning_with(scene, fastest)
    return None if found is None or not found.rate else found.at_rate(turning.rate)


def _after(scene: Scene, at: float, progress: Progress | None) -> tuple[Array, Array]:
    if not at:
        return scene.q, scene.v
    done = run_integration(scene, scene.deck.solve, progress)
    trajectory = done.trajectory
    if isinstance(done.stop, KeyboardInterrupt):
        raise done.stop
    if trajectory.t_end < at * (1.0 - 1e-9):
        early = ModesError(f"the run ends at {trajectory.t_end:.4g} s: {done.stop}")
        early.exit_code = getattr(done.stop, "exit_code", early.exit_code)
        raise early
    q, v = scene.system.project(np.array([at]), trajectory.q[None], trajectory.v[None])
    return q[0], v[0]


def linearised(scene: Scene, q: Array, v: Array, state: str, t: float = 0.0) -> About:
    """Return a scene linearised about coordinates and rates (n,) of its state.

    Raises
    ------
    ModesError
        If its equations are singular there.
    """
    system = scene.system
    x, u = system.absolute(q[None])[0], system.absolute_velocity(q[None], v[None])[0]
    try:
        still = small_motions(system, t, x, u)
    except np.linalg.LinAlgError as error:
        raise ModesError(f"the equations of motion are singular in this state: {error}") from None
    turning = _turning(scene, t, still)
    if turning is not None and state == "time" and turning.rate * max(t, 1.0) <= scene.deck.solve.tolerance:
        turning = None  # a run that comes to rest leaves as much
    motions = still if turning is None else small_motions(system, t, x, u, turning)
    return About(scene, state, t, motions)


def _turning(scene: Scene, t: float, at: SmallMotions, alone: bool = False) -> Turning | None:
    bodies, equations = list(scene.bodies.values()), scene.system.equations
    specs, models = scene.deck.bodies, scene.models
    rigid = [one.name for one in bodies if specs[one.name].rigid or models.get(one.name) == "rigid"]
    sets = welded(scene.deck, [one for one in rigid if not scene.bodies[one].still])
    return Turning.fitting(bodies, equations, t, at.x, at.u, at.a, at.blur, alone, sets)
