"""The states of a scene that can be asked for: its start, what is next to that and lasts, those of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hfsim.deck.source import did_you_mean
from hfsim.errors import ArgumentError
from hfsim.marching.stop import Progress
from hfsim.maths.arrays import Array
from hfsim.mechanics.small_motions import small_motions
from hfsim.mechanics.statics.equilibrium import STAYED
from hfsim.mechanics.turning import Turning
from hfsim.scene.assembly import few_of
from hfsim.scene.build import Scene, build
from hfsim.scene.equilibrium import standing
from hfsim.scene.gauging import gauge_of
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.nearby import nearby, resting
from hfsim.scene.resting import turning_with
from hfsim.studies.modes.state import LASTING, About, ModesError, after, linearised

STATES = ("start", *LASTING)
"""States that can be asked for, beside that of a run at a time."""


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
    check_state(state, at)
    scene = build(loaded.until(at) if at else loaded)
    if at is not None:
        q, v = after(scene, at, progress) if at else (scene.q, scene.v)
        return linearised(scene, q, v, "time", at)
    if state == "equilibrium":
        return _resting(scene)
    found = linearised(scene, scene.q, scene.v, state)
    return found if state != "steady" else turning_at(found, None)


def check_state(state: str, at: float | None, period: float | None = None) -> None:
    """Refuse what names no one state."""
    if state not in STATES:
        raise ArgumentError(f"there is no state '{state}': {did_you_mean(state, STATES)}")
    if at is not None and state != STATES[0]:
        raise ArgumentError(f"about {state} and at {at:g} s are two states; one of them can be told")
    if period is not None and state != STATES[0]:
        raise ArgumentError(f"about {state} and a period are two states; one of them can be told")
    if at is not None and not 0.0 <= at < np.inf:
        raise ArgumentError(f"at {at:g} s there is no state: a run begins at 0 s")


def seen_from(start: About, body: str) -> About:
    """Return a start as seen from axes that turn with one body, or at rest where nothing but rotors turns.

    Of rotors it is the one whose rate others are told as.

    Raises
    ------
    ModesError
        If there is no such body, or it does not turn and the joints leave no one axis.
    """
    scene = start.scene
    if body not in scene.bodies:
        raise ModesError(f"there is no body '{body}': {', '.join(scene.bodies)}")
    at = start.turning
    turning: Turning | None
    if at is not None and not start.axes_turn and body in at.own:
        turning = replace(at, lead=body)
        return replace(start, motions=replace(start.motions, turning=turning))
    turning = turning_with(scene, body)
    if turning is not None and not turning.rate:
        bodies = list(scene.bodies.values())
        turning = Turning.held_by_joints(bodies, scene.system.equations, start.motions.x)
    if turning is None:
        raise ModesError(f"'{body}' does not turn at the start, {_no_axis_of_all(scene)}")
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


def _no_axis_of_all(scene: Scene) -> str:
    """Return in words why joints leave no axis about which everything could turn as one."""
    moving = {name for one in scene.free_motions or () for name in (one.body, *one.takes_along)}
    held = [name for name, body in scene.bodies.items() if not body.still and name not in moving]
    if not moving or not held:
        return "nor do the joints leave one axis about which everything turns"
    return (
        f"and not everything can turn with it: joints hold {few_of(held)}; give it a rate with initial if it "
        "is round, as only such bodies turn steadily beside others, or see with --period what grows"
    )


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
    scene, t, x0 = start.scene, start.t, start.motions.x
    try:
        x = nearby(scene, t, x0, turning)
        if x is None or gauge_of(scene).size((x - x0)[None]) > STAYED:
            here = _steady(start, turning, x0)
            if here.lasting:  # whatever else was found is not what was asked for
                return here
            if x is None and here.own_turns_change and (together := _together(scene, turning)) is not None:
                x = nearby(scene, t, x0, together)
                if x is not None:
                    return replace(_steady(start, together, x), ended=turning.own)
        if x is None:
            raise ModesError(f"{_told(turning)}: no state that lasts was found next to it")
        return _steady(start, turning, x)
    except np.linalg.LinAlgError as error:
        raise ModesError(f"{_told(turning)}: {error}") from None


def _steady(start: About, turning: Turning, x: Array) -> About:
    """Return coordinates (n_x,) that turn, as seen from axes that do where anything does."""
    scene, t, axes = start.scene, start.t, turning if turning.rate else None
    motions = small_motions(standing(scene.system, moving=True), t, x, turning.rates(x[None])[0], axes)
    moved = gauge_of(scene).size((x - start.motions.x)[None])
    return About(scene, "steady", t, motions, moved=moved)


def _told(turning: Turning) -> str:
    """Return in words which steady rotation is looked for."""
    rounding = 1e-12 * turning.rate
    told = ", ".join(f"{one if abs(one) > rounding else 0.0:.4g}" for one in np.atleast_1d(turning.spin))
    own = "".join(f", {name} by itself at {one:.4g} rad/s" for name, one in turning.own.items() if one)
    return f"steady{f' at {told} rad/s{own}' if turning.rate else ''}"


def _together(scene: Scene, turning: Turning) -> Turning | None:
    """Return the turn of everything to which drag leads bodies that turn by themselves; None without."""
    if np.any(turning.spin):
        return turning.together(scene.bodies.values())
    fastest = max(turning.own, key=lambda name: abs(turning.own[name]))
    found: Turning | None = turning_with(scene, fastest)
    return None if found is None or not found.rate else found.at_rate(turning.rate)
