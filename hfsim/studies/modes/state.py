"""A scene linearised about a state, and how steady that is.

Rates of the state are seen from axes that turn with the scene, where it turns as a whole; in these a steady
rotation is an equilibrium.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np

from hfsim.errors import HfsimError
from hfsim.integrators import Trajectory
from hfsim.marching.integration import run_integration
from hfsim.marching.steps import State
from hfsim.marching.stop import Progress
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.mechanics.nearest_rates import NOISE
from hfsim.mechanics.small_motions import SmallMotions, small_motions
from hfsim.mechanics.system import System
from hfsim.mechanics.turning import Turning
from hfsim.scene.build import Scene
from hfsim.scene.equilibrium import standing
from hfsim.scene.rules import welded
from hfsim.scene.schema import SolveSpec

LASTING = ("equilibrium", "steady")
"""States that are to last, in which laws of joints stand."""
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
        ``start``, ``equilibrium``, ``steady``, ``time`` or ``periodic``.
    t : float
        Of loads and drivers [s].
    period : float or None
        Of the motion that begins in the state, if it is periodic [s].
    changed : float
        What acts after that, less what did before, over its size [-].
    ended : dict of str to float
        Rates at which bodies turned by themselves where this was sought, and do not in it [rad/s].
    moved : float
        How far it is from there, for the body that moves or turns most [rad].
    """

    scene: Scene
    state: str
    t: float
    motions: SmallMotions
    period: float | None = None
    changed: float = 0.0
    ended: dict[str, float] = field(default_factory=dict)
    moved: float = 0.0

    @cached_property
    def system(self) -> System:
        """The equations; in a state that is to last laws of joints stand, at rest those of servos too."""
        system = self.scene.system
        return standing(system, self.state == "steady") if self.state in LASTING else system

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

    def mean(self, rates: Array) -> float:
        """Return the root of the mean square of changes, rates or accelerations (n_x,), by mass."""
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
        return self.mean(self.motions.a - self._steady)

    @cached_property
    def speed(self) -> float:
        """How fast it moves, seen from the axes, likewise [m/s]."""
        x = self.motions.x
        steady = 0.0 if self.turning is None else self.turning.rates(x[None])[0]
        return self.mean(self.motions.u - steady)

    @property
    def own_turns_change(self) -> bool:
        """Whether what acts speeds up or slows down what turns by itself."""
        if self.turning is None or not self.turning.own:
            return False
        x, together = self.motions.x[None], self.turning.together(self.scene.bodies.values())
        own = (self.turning.rates(x) - together.rates(x))[0]
        beside = self.scene.system.equations.momentum(x, (self.motions.a - self._steady)[None])[0]
        return abs(float(own @ beside)) > self._least * self.mean(own) * self.mass

    @property
    def after_a_turn(self) -> tuple[Array, Array]:
        """The coordinates (1, n_x) after a turn by one radian, and their rates."""
        assert self.turning is not None
        seconds = 1.0 / self.turning.rate
        x = self.turning.turned(self.motions.x[None], seconds)
        return x + seconds * self.turning.travel, self.turning.rates(x)

    @cached_property
    def turned(self) -> SmallMotions:
        """The small motions after a turn by one radian."""
        x, u = self.after_a_turn
        return small_motions(self.system, self.t, x[0], u[0], self.turning)

    @cached_property
    def unevenness(self) -> float:
        """How much else accelerations are after a turn by one radian, over those of the rotation [-].

        Loads and drivers act as they do at the time of the state; of a periodic motion it is `changed`.
        """
        if self.period is not None:
            return self.changed
        if self.turning is None:
            return 0.0
        system, turning = self.system, self.turning
        x = self.after_a_turn[0]
        if not np.allclose(system.reduction.expand(system.reduction.free(x)), x, atol=1e-6 * self.size):
            return np.inf
        before = self.motions.a - turning.accelerations(self.motions.x[None])[0]
        after = self.turned.a - turning.accelerations(x - turning.travel / turning.rate)[0]
        size = self.mean(turning.accelerations(self.motions.x[None])[0]) or 1.0
        # in the axes, what there is of other accelerations turns with them
        change = abs(self.mean(after) - self.mean(before))
        # what lies along an axis of the ground has no digits to lose across it until it has turned
        rounding = max(self._rounding, NOISE * self.mean(self.turned.blur))
        return 0.0 if change <= rounding else change / size

    @property
    def _least(self) -> float:
        """Accelerations that are none, likewise [m/s^2]."""
        return max(_BALANCED * self.mean(self._steady), self._rounding)

    @property
    def _rounding(self) -> float:
        """Accelerations that are rounding, likewise [m/s^2]."""
        return NOISE * self.mean(self.motions.blur)

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
        return self.mean(self.motions.basis @ step)

    @property
    def lasting(self) -> bool:
        """Whether it is an equilibrium, a steady rotation or the start of a periodic motion, to `STEADY`."""
        if self.period is not None:
            return True
        moving = self.mean(self.motions.u)
        # where nothing brings motions back, rounding alone may seem to lead far away
        inertia = self.mean(self._steady)
        balanced = self.acceleration <= self._least
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
            "period": self.period,
            "spin": None if turning is None else np.atleast_1d(turning.spin).tolist(),
            "rotors": {} if turning is None else turning.own,
            "ended_rotors": self.ended,
            "moved": self.moved,
            "axis_through": None if turning is None else turning.centre.tolist(),
            "acceleration": self.acceleration,
            "speed": self.speed,
            "away_from_equilibrium": min(self.distance, _FAR * self.size),
        }


def after(
    scene: Scene, at: float, progress: Progress | None = None, solve: SolveSpec | None = None
) -> tuple[Array, Array]:
    """Return coordinates and rates (n,) to which a run leads until a time, moved onto the joints."""
    trajectory = run_until(scene, at, progress, solve=solve)
    q, v = scene.system.project(np.array([at]), trajectory.q[None], trajectory.v[None])
    return q[0], v[0]


def run_until(
    scene: Scene,
    at: float,
    progress: Progress | None = None,
    start: State | None = None,
    solve: SolveSpec | None = None,
) -> Trajectory:
    """Return a run until a time, from a state (t, q, v) or the scene's start.

    Raises
    ------
    ModesError
        If the run does not come so far, with its exit code.
    KeyboardInterrupt
        If a signal ends it.
    """
    done = run_integration(scene, solve or scene.deck.solve, progress, start)
    trajectory = done.trajectory
    if isinstance(done.stop, KeyboardInterrupt):
        raise done.stop
    if trajectory.t_end < at * (1.0 - 1e-9):
        early = ModesError(f"the run ends at {trajectory.t_end:.4g} s: {done.stop}")
        early.exit_code = getattr(done.stop, "exit_code", early.exit_code)
        raise early
    return trajectory


def linearised(
    scene: Scene, q: Array, v: Array, state: str, t: float = 0.0, turns: bool = True
) -> About:
    """Return a scene linearised about coordinates and rates (n,) of its state.

    Parameters
    ----------
    turns : bool
        Whether axes turn with it where it does.

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
    turning = _turning(scene, t, still) if turns else None
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
