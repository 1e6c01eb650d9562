"""Refusals of starts that the joints do not allow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import freedoms
from hfsim.mechanics.constraints import Constraint
from hfsim.scene.assembly import UNITS, Change, listed, orientation_of
from hfsim.scene.closing import CLOSED
from hfsim.scene.stated import Start, Stated

MOST_NAMED = 5
"""Bodies that a message names one by one."""


def contradicted(
    start: Start,
    given: Stated,
    joint: Constraint,
    size: float,
    allowed: Sequence[Change] = (),
    gaps: Array | None = None,
) -> DeckError:
    """Return the refusal of what is stated, or of joints that contradict each other whatever is stated.

    Parameters
    ----------
    gaps : ndarray, shape (n_rows,), optional
        The least that is left, in units, if that is known: where it is not zero, joints contradict.
    """
    rates = "velocity" in given.parts
    unit = f"{joint.unit}/s" if rates else joint.unit
    if not given.stated.any():
        hint = "the start or the rate of a driver, or an angle of a joint, must be another"
        if posed := start.posed(gaps):
            hint = f"correct or leave out {posed}; or {hint}"
        return start.refuse(
            joint.item, f"other joints and drivers contradict this one by {size:.6g} {unit}", hint
        )
    what = "velocities" if rates else "positions and angles"
    nearest = [f"{c.body}.{c.quantity} {listed(c.taken)} {UNITS[c.quantity]}" for c in allowed]
    hint = f"nearest that the joints allow: {', '.join(nearest)}; " if nearest else ""
    hint += "correct what is stated under 'initial', or leave it out to let it follow from the joints"
    return start.refuse(joint.item, f"the initial {what} contradict this joint by {size:.6g} {unit}", hint)


def misfaced(start: Start, item: str, off: float, faced: Array) -> DeckError:
    """Return the refusal of stated orientations that a joint does not have, B's axes in A's being `faced`."""
    message = f"the initial orientations contradict this joint by {off:.6g} rad"
    hint = f"give the joint '{orientation_of(faced)}', which is how they turn B against A"
    rest = "or correct what is stated under 'initial', or leave it out to let it follow"
    return start.refuse(item, message, f"{hint}, {rest}")


def cannot_close(start: Start, place: Stated, joint: Constraint, size: float, gaps: Array) -> DeckError:
    """Return the refusal of joints that close at no angles, of which gaps (n_rows,) are the least."""
    left = f"where the others close, {size:.6g} {joint.unit} are left"
    held = {start.names[k // freedoms(start.n_dim)] for k in np.flatnonzero(place.exact)}
    if held:
        message = f"cannot be closed with what is exact: {left}"
        hint = f"leave out 'exact' of {', '.join(sorted(held))}, or correct what is stated there"
    else:
        told = f"{left}, whatever the angles"
        told = told if size >= CLOSED else "only with axes turned over that it is to hold the same way"
        message = f"cannot be closed: {told}"
        hint = "make a link longer or shorter, move a point, or let a driver start elsewhere"
        if posed := start.posed(gaps):
            message = f"cannot be closed with what is stated of joints: {left}"
            return start.refuse(joint.item, message, f"correct or leave out {posed}")
        if (slack := _slack(start, joint)) is not None:
            return start.refuse(joint.item, *slack)
        if unknown := _unfaced(start, place):
            message += f", with hinges in {unknown} as they are without a stated orientation"
            hint = f"state orientations: they say where in a body the axis of a hinge is; or {hint}"
    return start.refuse(joint.item, message, hint)


def _slack(start: Start, joint: Constraint) -> tuple[str, str] | None:
    """Return what to say of a beam that hangs between two points of the ground which it is too long for."""
    link, numbers = start.linkage, [start.linkage.owner(marker) for marker in joint.ends]
    number = next((k for k in numbers if k is not None), None)
    name = "" if number is None else start.names[number]
    length, origin = start.straight.get(name), np.zeros((1, link.n))
    points = list[tuple[Array, Array]]()
    for c in link.constraints:
        owners = [link.owner(marker) for marker in c.ends]
        if number not in owners:
            continue
        if None not in owners or c.holds_turn:
            return None
        if c.unit == "m":
            own, ground = sorted(c.ends, key=lambda marker: marker.grounded)
            points.append((own.position(origin)[0], ground.position(origin)[0]))
    if length is None or len(points) != 2:
        return None
    span, along = (float(np.linalg.norm(points[1][k] - points[0][k])) for k in (1, 0))
    if not CLOSED * length < span < along or along < (1.0 - CLOSED) * length:
        return None
    angle = arc_angle(span / length)
    message = (
        f"cannot be closed: '{name}' starts straight, {length:.6g} m long between points {span:.6g} m apart"
    )
    arc = f"axis: {{arc: {{radius: {length / angle:.12g}, angle: {angle:.12g} rad}}}}"
    hint = f"for a beam that sags, '{arc}' in place of its length, with element: cosserat"
    return message, f"{hint}; or two beams with a joint between them, and the angle of one under 'initial'"


def arc_angle(chord: float) -> float:
    """Return the angle of an arc of length one whose ends are a chord apart, 0 < chord < 1 [rad]."""
    low, high = 0.0, 2.0 * np.pi
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.sin(0.5 * middle) > 0.5 * middle * chord else (low, middle)
    return 0.5 * (low + high)


def _unfaced(start: Start, place: Stated) -> str:
    """Return in words which bodies with axes that joints hold have no stated orientation; '' for none."""
    axes = {start.linkage.owner(end) for _, *ends, _, _ in start.linkage.senses for end in ends}
    unknown = np.flatnonzero(start.turns_of(place.open).any(axis=1))
    names = [start.names[k] for k in unknown if k in axes]
    return ", ".join(names) if len(names) <= MOST_NAMED else f"{len(names)} bodies"
