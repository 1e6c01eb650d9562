"""What of angles at the start hardly can be meant: a zero that nothing says, springs wound up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array, magnitude
from hfsim.maths.rotations import rotation_vector
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
APART = 1e-3
"""Angle [rad], or part of the size of a scene, by which bushings that place a body may disagree."""
UNMOVED = 1e-9
"""Part of the largest rate in a motion that counts as none."""
MOST_COORDINATES = 600
"""Coordinates of frames up to which it is asked what motions nothing states."""


def doubtful(scene: Measured) -> Iterator[tuple[str, str]]:
    """Yield, with the deck path it is about, what hardly can be meant."""
    deck = scene.deck
    springs = ((f"springs.{name}", spring) for name, spring in deck.springs.items())
    turned: list[tuple[str, Any]] = [(path, one) for path, one in springs if _turned(one) or one.about]
    yield from _wound(scene, turned)
    yield from _torn(scene)
    if deck.dimension == 3:
        turned += [(f"joints.{name}", joint) for name, joint in deck.joints.items() if _turned(joint)]
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
    for path, spring in springs if start.linkage.n <= MOST_COORDINATES else ():
        bodies = tuple(split_point(point)[0] for point in spring.between)
        for e, off, moment in _far_from_rest(scene, path, spring) if not resting & set(bodies) else ():
            if not _outer_open(scene, bodies):
                break
            loose, axis = start.loose() if loose is None else loose, _in_ground(scene, bodies[0], e)
            if _turns(scene, bodies, axis, loose):
                message = f"starts wound up by {abs(off):.4g} rad ({moment:.4g} N m)"
                yield path, f"{message}, though nothing states that: {_unwound(scene, bodies, axis, off)}"
                break


def _torn(scene: Measured) -> Iterator[tuple[str, str]]:
    """Yield bushings that start under force because others, which hold as much, say where bodies start."""
    from hfsim.scene.mounts import overruled

    t, x, resting = np.zeros(1), scene.system.absolute(scene.q[None]), set(scene.deck.resting)
    for name in overruled(scene.deck):
        spring, off, acting = scene.deck.springs[name], {"m": 0.0, "rad": 0.0}, {"m": 0.0, "rad": 0.0}
        for tie in scene.ties(name):
            rests = (one.rest for one in tie.resistances)
            off[tie.unit] = np.hypot(off[tie.unit], float(tie.measured(t, x)[0][0]) - sum(rests))
            acting[tie.unit] = np.hypot(acting[tie.unit], float(tie.effort(t, x, 0.0 * x)[0]))
        far = max(off["m"] / scene.assembly.linkage.size, off["rad"]) > APART
        if far and not resting & {split_point(point)[0] for point in spring.between}:
            yield f"springs.{name}", (
                f"starts under force ({acting['m']:.4g} N, {acting['rad']:.4g} N m), {off['m']:.4g} m and "
                f"{off['rad']:.4g} rad from its rest: other bushings say where its bodies start; "
                "if that is meant, state it under 'initial'"
            )


def _far_from_rest(scene: Measured, path: str, spring: Any) -> Iterator[tuple[Array, float, float]]:
    """Yield axes (3,) in A's frame about which a spring is wound up far, by how much [rad, N m].

    In space angles of one that acts about several axes count from where it is at rest.
    """
    t, x = np.zeros(1), scene.system.absolute(scene.q[None])
    ties = (tie for tie in scene.ties(path.partition(".")[2]) if tie.unit == "rad" and tie.measures)
    for (_, e), tie in zip(_axes(spring), ties, strict=False):
        angle, moment = float(tie.measured(t, x)[0][0]), abs(float(tie.effort(t, x, 0.0 * x)[0]))
        counted = scene.deck.dimension == 3 and bool(spring.about)
        off, turn = (angle, _apart(scene, spring)) if counted else (angle - spring.rest_turn, angle)
        if moment and min(abs(turn), abs(off)) >= WOUND:
            yield e, off, moment


def _apart(scene: Measured, spring: Any) -> float:
    """Return the angle of the rotation that takes the axes of A to those of B [rad]."""
    A, B = (_frame(scene, split_point(point)[0]) for point in spring.between)
    return float(np.linalg.norm(rotation_vector(A.T @ B)))


def _outer_open(scene: Measured, bodies: Sequence[str]) -> bool:
    """Tell whether nothing states how that of two bodies is turned which is farther from the ground."""
    link, names = scene.assembly.linkage, list(scene.assembly.poses)
    depth = Loops.of(len(names), ends_of(link)).depth
    (inner, _), (outer, name) = sorted(
        (depth[names.index(one) if one in names else GROUND], one) for one in bodies
    )
    stated = scene.deck.motions.get(name)
    return inner < outer and (stated is None or stated.turn(scene.deck.dimension) is None)


def _turns(scene: Measured, bodies: Sequence[str], axis: Array, motions: Array) -> bool:
    """Tell whether any of some motions (k, n) of the frames turns B against A about an axis (3,)."""
    link, names, n_dim = scene.assembly.linkage, list(scene.assembly.poses), scene.deck.dimension
    columns = [link.columns_of(names.index(one))[n_dim:] if one in names else None for one in bodies]
    a, b = (np.zeros((len(motions), 1)) if one is None else motions[:, one] for one in columns)
    rates = b - a if n_dim == 2 else (b - a) @ axis
    return magnitude(rates) > UNMOVED * magnitude(motions / link.units)


def _unwound(scene: Measured, bodies: Sequence[str], axis: Array, off: float) -> str:
    """Return what would state the angle about an axis (3,) of a spring that is so much off its rest."""
    for name, joint in scene.deck.joints.items():
        pair = tuple(split_point(point)[0] for point in joint.between)
        if set(pair) != set(bodies) or "rad" not in left_free(joint):
            continue
        along = float(axis @ _in_ground(scene, pair[0], axis_of(joint)))
        if abs(along) > 1.0 - OPPOSITE and (tie := scene.coordinate(name, "rad")):
            now = tie.measured(np.zeros(1), scene.system.absolute(scene.q[None]))[0][0]
            sign = np.sign(along) if pair == bodies else -np.sign(along)
            to = round(float(np.degrees(now - sign * off)), 9) + 0.0
            return f"'initial: {{{name}: {{angle: {to:.9g} deg}}}}' starts it at rest"
    return f"state how '{next(one for one in bodies[::-1] if one != 'ground')}' is turned under 'initial'"


def _in_ground(scene: Measured, body: str, e: Array) -> Array:
    """Return an axis (3,) of a body at the start in ground axes; in the plane all angles are about one."""
    return np.asarray(_frame(scene, body) @ e if scene.deck.dimension == 3 else THIRD)
