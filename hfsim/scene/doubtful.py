"""What of angles at the start hardly can be meant: a zero that nothing says, springs wound up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array, magnitude
from hfsim.mechanics.directions import THIRD
from hfsim.parts.channels import kind_of
from hfsim.scene.assembly import orientation_of
from hfsim.scene.facing import axis_of
from hfsim.scene.initial import InitialSpec
from hfsim.scene.loops import GROUND, Loops, ends_of
from hfsim.scene.measured import Measured
from hfsim.scene.posed import left_free

OPPOSITE = 1e-6
"""Angle [rad] from opposite ways up to which no rotation that takes one axis to another is the smallest."""
WOUND = 0.5 * np.pi * (1.0 - 1e-9)
"""Angle [rad], from no turn and from where a spring is at rest, from which it starts wound up by mistake."""
UNMOVED = 1e-9
"""Part of the largest rate in a motion that counts as none."""
MOST_COORDINATES = 600
"""Coordinates of frames up to which it is asked what motions nothing states."""


def doubtful(scene: Measured) -> Iterator[tuple[str, str]]:
    """Yield, with the deck path it is about, what hardly can be meant."""
    deck = scene.deck
    turned: list[tuple[str, Any]]
    turned = [(f"springs.{name}", spring) for name, spring in deck.springs.items() if _turned(spring)]
    yield from _wound(scene, turned)
    if deck.dimension == 3:
        turned += [(f"joints.{name}", joint) for name, joint in deck.joints.items() if _turned(joint)]
        turned += [(f"springs.{name}", spring) for name, spring in deck.springs.items() if spring.about]
        yield from _without_zero(scene, turned)


def _turned(spec: Any) -> bool:
    """Tell whether a joint or a spring has an angle of two bodies."""
    having = (unit == "rad" and (not key or getattr(spec, key) is not None) for unit, key in spec.measures)
    return not getattr(spec, "on", None) and any(having)


# --- where an angle is zero -----------------------------------------------------------------------


def _without_zero(scene: Measured, entries: Sequence[tuple[str, Any]]) -> Iterator[tuple[str, str]]:
    """Yield angles in use whose axes in B start the opposite way from where they are at angle zero."""
    for path, spec in entries:
        a, b = (split_point(point)[0] for point in spec.between)
        lines = not all(scene.deck.bodies[name].sectioned for name in {a, b} - {"ground"})
        if lines or not _in_use(scene, path, spec):
            continue
        facing, zero = _frame(scene, a).T @ _frame(scene, b), _zero(spec)
        over = [name for name, e in _axes(spec) if np.linalg.norm((facing + zero).T @ e) < OPPOSITE]
        if over:
            message = f"nothing says where {_angles(over)} the opposite way in '{b}'"
            yield path, f"{message} ({_to_state(spec, facing)})"


def _axes(spec: Any) -> list[tuple[str, Array]]:
    """Return the axes (3,) of angles of a joint or a spring in A's frame, with their names, if any."""
    named = [(name, np.eye(3)["xyz".index(name)]) for name in getattr(spec, "about", ())]
    return named or [("", axis_of(spec))]


def _angles(names: Sequence[str]) -> str:
    """Return in words which angles are zero, and which axes point."""
    if len(names) > 1:
        return f"its angles about {' and '.join(names)} are zero: these axes point"
    return f"{f'its angle about {names[0]}' if names[0] else 'this angle'} is zero: its axis points"


def _to_state(spec: Any, facing: Array) -> str:
    """Return what says where an angle is zero: where B starts."""
    if "orientation" not in type(spec).model_fields:
        return "turn the frame of one of both bodies over"
    return f"'{orientation_of(facing)}' does, where it starts"


def _in_use(scene: Measured, path: str, spec: Any) -> bool:
    """Tell whether it matters where an angle is zero: it acts there, is stated, or a channel asks for it."""
    name, deck = path.partition(".")[2], scene.deck
    coupled = {key.partition(".")[0] for spring in deck.springs.values() for key in spring.on}
    if name in coupled or (path.startswith("springs.") and spec.acts):
        return True
    kinds = [kind_of(one, deck) for one in deck.channels if one.partition(".")[0] == name]
    entry = deck.initial.get(name)
    stated = isinstance(entry, InitialSpec) and entry.angle is not None
    return stated or any(kind.measured == "rad" and kind.of_turns for kind in kinds) or _acts_by_place(spec)


def _acts_by_place(spec: Any) -> bool:
    """Tell whether a joint drives its angle, or acts on it by what it is."""
    forces = [one for key, some in getattr(spec, "resisting", {}).items() if key != "sliding" for one in some]
    none, places = np.zeros(9), np.linspace(-3.0, 3.0, 9)
    driven = not forces and any(unit == "rad" and key for unit, key in spec.measures)
    return driven or any(one.event or one.edges or np.ptp(one.force(none, places, none)) for one in forces)


def _frame(scene: Measured, body: str) -> Array:
    """Return the axes of a body, or the ground, at the start as columns (3, 3)."""
    pose = scene.assembly.poses.get(body)
    return np.eye(3) if pose is None else np.stack([pose.turned(e) for e in np.eye(3)], axis=1)


def _zero(spec: Any) -> Array:
    if getattr(spec, "about", ()):
        from hfsim.deck.orientation import matrix_of

        stated = matrix_of(spec)
        return np.eye(3) if stated is None else stated
    stated = getattr(spec, "orientation", None)
    return np.eye(3) if stated is None else np.asarray(stated.matrix)


# --- springs wound up -----------------------------------------------------------------------------


def _wound(scene: Measured, springs: Sequence[tuple[str, Any]]) -> Iterator[tuple[str, str]]:
    """Yield springs that start a quarter of a turn or more from rest and from no turn, if nothing states it.

    One that is at rest elsewhere, as what winds up a clock is, starts at no turn; and where the outer body is
    stated to be turned, that is meant.
    """
    start, resting, loose = scene.assembly, set(scene.deck.resting), None
    t, x = np.zeros(1), scene.system.absolute(scene.q[None])
    for path, spring in springs if start.linkage.n <= MOST_COORDINATES else ():
        bodies = tuple(split_point(point)[0] for point in spring.between)
        if not spring.acts or resting & set(bodies):
            continue
        tie = scene.coordinate(path.partition(".")[2], "rad")
        angle = float(tie.measured(t, x)[0][0])
        off = angle - spring.rest_angle
        if min(abs(angle), abs(off)) < WOUND or not _outer_open(scene, bodies):
            continue
        loose = start.loose() if loose is None else loose
        if _turns(scene, bodies, spring, loose):
            moment = abs(float(tie.effort(t, x, 0.0 * x)[0]))
            message = f"starts wound up by {abs(off):.4g} rad ({moment:.4g} N m), though nothing states that"
            yield path, f"{message}: {_unwound(scene, bodies, spring, off)}"


def _outer_open(scene: Measured, bodies: Sequence[str]) -> bool:
    """Tell whether nothing states how that of two bodies is turned which is farther from the ground."""
    link, names = scene.assembly.linkage, list(scene.assembly.poses)
    depth = Loops.of(len(names), ends_of(link)).depth
    (inner, _), (outer, name) = sorted(
        (depth[names.index(one) if one in names else GROUND], one) for one in bodies
    )
    stated = scene.deck.motions.get(name)
    return inner < outer and (stated is None or stated.turn(scene.deck.dimension) is None)


def _turns(scene: Measured, bodies: Sequence[str], tie: Any, motions: Array) -> bool:
    """Tell whether any of some motions (k, n) of the frames turns B against A about an axis of A."""
    link, names, n_dim = scene.assembly.linkage, list(scene.assembly.poses), scene.deck.dimension
    columns = [link.columns_of(names.index(one))[n_dim:] if one in names else None for one in bodies]
    a, b = (np.zeros((len(motions), 1)) if one is None else motions[:, one] for one in columns)
    rates = b - a if n_dim == 2 else (b - a) @ _about(scene, bodies, tie)
    return magnitude(rates) > UNMOVED * magnitude(motions / link.units)


def _unwound(scene: Measured, bodies: Sequence[str], spring: Any, off: float) -> str:
    """Return what would state the angle of a spring that starts by so much off its rest."""
    for name, joint in scene.deck.joints.items():
        pair = tuple(split_point(point)[0] for point in joint.between)
        if set(pair) != set(bodies) or "rad" not in left_free(joint):
            continue
        along = float(_about(scene, bodies, spring) @ _about(scene, pair, joint))
        if abs(along) > 1.0 - OPPOSITE and (tie := scene.coordinate(name, "rad")):
            now = tie.measured(np.zeros(1), scene.system.absolute(scene.q[None]))[0][0]
            sign = np.sign(along) if pair == bodies else -np.sign(along)
            to = round(float(np.degrees(now - sign * off)), 9) + 0.0
            return f"'initial: {{{name}: {{angle: {to:.9g} deg}}}}' starts it at rest"
    return f"state how '{next(one for one in bodies[::-1] if one != 'ground')}' is turned under 'initial'"


def _about(scene: Measured, bodies: Sequence[str], tie: Any) -> Array:
    """Return the axis (3,) of an angle at the start, in ground axes."""
    if scene.deck.dimension == 2:
        return np.asarray(THIRD)
    return np.asarray(_frame(scene, bodies[0]) @ axis_of(tie))
