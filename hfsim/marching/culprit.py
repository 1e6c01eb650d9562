"""Who is to blame: which part of a scene makes a number that is not finite."""

from __future__ import annotations

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.marching.runaway import FASTEST
from hfsim.maths.arrays import Array, BoolArray
from hfsim.scene.build import Scene

HUGE = 1e100
"""Size in SI units from which a force counts as not finite: what follows from it soon is not."""


def non_finite(scene: Scene, t: float, q: Array, v: Array) -> SolverFailure | None:
    """Return the failure that names what is not finite in a state, or None.

    Parameters
    ----------
    q, v : ndarray, shape (n,)
        A state beyond all scale, or not finite itself, is what steps have made of the motion, not the deck:
        the one at the start is looked at in its place, which laws of time alone can spoil.
    """
    if not (in_scale(q, scene.q) and in_scale(v, scene.v)):
        q, v = scene.q, scene.v
    with np.errstate(all="ignore"):
        item, what = _offender(scene, t, q, v)
    if not item:
        return None
    return SolverFailure(
        reason=f"{what} of {item} is not finite, or beyond {HUGE:g}, at t = {t:.6g} s",
        time=t,
        item=item,
        kind="deck",
        evidence={"not_finite": what},
        remedy=f"correct the numbers of {item}",
    )


def _offender(scene: Scene, t: float, q: Array, v: Array) -> tuple[str, str]:
    """Return deck path and quantity of the first thing that is not finite; empty if all is."""
    system, time = scene.system, np.array([t])
    x, u = system.absolute(q[None]), system.absolute_velocity(q[None], v[None])
    for part in system.forces:
        force = np.zeros_like(x)
        part.add_force(time, x, u, force)
        if not _usable(force):
            return part.item or body_of(scene, ~_usable_each(force[0])), "the force"
    for row in system.constraints:
        if not (_usable(row.residual(time, x)) and _usable(row.acceleration(time, x, u))):
            return row.item, "the law"
    try:
        a = system.acceleration(time, q[None], v[None])[0]
    except np.linalg.LinAlgError:
        return "", ""
    return ("", "") if _usable(a) else (body_of(scene, ~_usable_each(a)), "the acceleration")


def in_scale(state: Array, start: Array) -> bool:
    """Tell whether a state is finite, and not beyond all scale of another."""
    return bool((np.abs(state) < FASTEST * max(1.0, float(np.abs(start).max(initial=0.0)))).all())


def _usable_each(values: Array) -> BoolArray:
    return np.isfinite(values) & (np.abs(values) < HUGE)


def _usable(values: Array) -> bool:
    return bool(_usable_each(values).all())


def body_of(scene: Scene, weight: Array | BoolArray) -> str:
    """Return the deck path of the body whose coordinates have the largest weight, (n,) or (n_x,)."""
    system = scene.system
    if len(weight) != system.n_x:
        weight = system.reduction.expand_rates(np.abs(weight)[None].astype(float))[0]
    body = max(scene.bodies.values(), key=lambda one: float(np.abs(weight[one.columns]).max(initial=0.0)))
    return f"bodies.{body.name}"
