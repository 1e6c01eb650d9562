"""What beams without sections cannot do in space: they are lines, whose points have a tangent and no more."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import split_point
from hfsim.maths.matrices import dense
from hfsim.maths.rank import null_space
from hfsim.maths.rotations import FIRST, smallest_rotation
from hfsim.parts.specs import JointSpec, LoadSpec
from hfsim.scene.assembly import Assembly
from hfsim.scene.closing import Linkage
from hfsim.scene.facing import Facings
from hfsim.scene.freedom import MOST_BODIES, NONE
from hfsim.scene.schema import Deck

SECTIONS = "take element: cosserat, which has sections"
"""What helps in every case."""
NOT_HELD = 1e-5
"""Gap of a joint, in its units, over a motion that opens it, from which it would resist the motion."""

NOT_ROLLED = 1e-6
"""Angle about the tangent that is rounding [rad]."""
_ACROSS = ("deflection_", "shear_force_", "bending_moment_")
"""How channels along an axis across a beam begin."""


# --- what has no meaning ---------------------------------------------------------------------------


def refusals(deck: Deck) -> Iterator[Complaint]:
    """Yield the joints, springs and loads of a spatial deck that need directions which a line has not."""
    lines = {name for name, body in deck.bodies.items() if not body.sectioned}
    if not lines:
        return
    facings = Facings(deck)
    for name, joint in deck.joints.items():
        first, second = (split_point(end)[0] in lines for end in joint.between)
        if not all(one.fits(first, second) for one in joint.held(*facings.of(joint))):
            own = " and ".join(f"'{end}'" for end in joint.between if split_point(end)[0] in lines)
            message = f"needs directions that {own} has not: a line without sections has its tangent alone"
            hint = f"turn its axis along or across the tangent, name the line second, or {SECTIONS}"
            yield Complaint(("joints", name), message, hint)
        yield from _unmeasured(name, joint, (first, second), facings)
    for name, spring in deck.springs.items():
        on = [end for end in spring.framed if split_point(end)[0] in lines]
        if on:
            message = f"'{on[0]}' has no section whose turn could be measured: it is on a line"
            hints = (SECTIONS, spring.frameless(on[0]))
            yield Complaint(("springs", name), message, ", or ".join(filter(None, hints)))
        for key, entry in spring.on.items():
            if isinstance(entry, JointSpec) and not _fits(entry, key.partition(".")[2], lines, facings):
                message = f"the angle of '{key}' is measured by the tangent alone: a line has no sections"
                yield Complaint(("springs", name, "of", key), message, SECTIONS)
    for name, load in deck.loads.items():
        if load.owner in lines and (complaint := _following(load)):
            yield complaint.inside("loads", name)


def _fits(joint: JointSpec, key: str, lines: Collection[str], facings: Facings) -> bool:
    """Tell whether a coordinate of a joint, or the only one it has, can be measured on lines."""
    ends = [split_point(end)[0] in lines for end in joint.between]
    own = (held for name, held in joint.coordinates(*facings.of(joint)) if not key or name == key)
    return any(held.fits(*ends) for held in own)


def _unmeasured(
    name: str, joint: JointSpec, lines: tuple[bool, bool], facings: Facings
) -> Iterator[Complaint]:
    """Yield what a joint resists where a line has no direction by which it could be measured."""
    for key, held, _ in joint.resisted(*facings.of(joint)):
        if not held.fits(*lines):
            message = "what resists this turn is measured by the tangent alone: a line has no sections"
            hint = f"turn its axis across the tangent, name the line second, or {SECTIONS}"
            yield Complaint(("joints", name, key) if key else ("joints", name), message, hint)


def _following(load: LoadSpec) -> Complaint | None:
    """Return why a load cannot turn with a line, if it is to."""
    amount = tuple(load.amount)
    if not load.follows or (load.carries and not any(amount[1:])):
        return None
    what = "a force" if load.carries else "a moment"
    hint = f"state it along the tangent, [F, 0, 0], or {SECTIONS}" if load.carries else SECTIONS
    message = f"{what} across a line without sections cannot turn with it: only its tangent is known"
    return Complaint(("follower",), message, hint)


# --- what is not held, and not borne ---------------------------------------------------------------


def untwisted(assembly: Assembly, held: Linkage, lines: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield the joints that would hold more if their lines could be twisted, with the lines.

    A motion that the joints leave is one of these if joints of beams with sections would resist it, however
    the beams roll as a whole.

    Parameters
    ----------
    assembly : Assembly
        With the linkage of joints that hold whole frames.
    held : Linkage
        The same of which joints hold no more than tangents of lines.
    """
    names, whole = list(assembly.poses), assembly.linkage
    if len(names) > MOST_BODIES:
        return
    rolls = assembly.rolls(lines)
    slopes = dense(held.slopes_by_rates(assembly.place))
    motions = null_space(np.concatenate([slopes, rolls]))
    every = dense(whole.slopes_by_rates(assembly.place))
    rows = [
        (c.item, k, [whole.owner(end) for end in c.ends])
        for c, own in zip(whole.constraints, whole.equations.rows, strict=True)
        for k in range(own.start, own.stop)
    ]
    for line, roll in zip(lines, rolls, strict=True):
        tied = [(item, k) for item, k, owners in rows if names.index(line) in owners]
        own = every[[k for _, k in tied]]
        resisted, by_roll = own @ motions, own @ roll
        if size := by_roll @ by_roll:
            resisted = resisted - np.outer(by_roll, by_roll @ resisted) / size
        much = np.abs(resisted).max(axis=1, initial=0.0) > NOT_HELD
        involved = list(dict.fromkeys(item for (item, _), one in zip(tied, much, strict=True) if one))
        if involved:
            told = " and ".join(f"'{item.removeprefix('joints.')}'" for item in involved)
            message = (
                f"'{line}', a line without sections, bears no torsion: what {told} would hold by it is free"
            )
            yield involved[-1], f"{message}; {SECTIONS}"


def twisting(deck: Deck, assembly: Assembly, lines: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield the moments that would twist a line at the start."""
    for name, load in deck.loads.items():
        line = load.owner
        if load.carries or line not in lines:
            continue
        moment = np.array([0.0] * (3 - len(tuple(load.amount))) + list(load.amount))
        part = float(moment @ assembly.tangent(line))
        if abs(part) > NONE * np.linalg.norm(moment):
            message = f"{abs(part):.4g} N m would twist '{line}', a line without sections: these do nothing"
            yield f"loads.{name}", f"{message}; {SECTIONS}"


# --- what is not known of them ---------------------------------------------------------------------


def rolled(deck: Deck, assembly: Assembly, lines: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield the stated orientations that would roll a line of which channels across it are asked for."""
    for line in lines:
        asked = [name for name in deck.output.channels or () if _is_across(name, line)]
        path = _stating(deck, line) if asked else ""
        if path and (roll := _roll(assembly, line)) > NOT_ROLLED:
            message = (
                f"rolls '{line}', a line without sections, by {np.degrees(roll):.4g} deg, which is ignored: "
                f"y and z of '{asked[0]}' are the ground's, turned with the tangent by the smallest rotation"
            )
            yield path, f"{message}; {SECTIONS}"


def _is_across(channel: str, line: str) -> bool:
    """Tell whether a channel is of a line, and along an axis across it."""
    return channel.startswith(f"{line}.") and channel.rpartition(".")[2].startswith(_ACROSS)


def _stating(deck: Deck, line: str) -> str:
    """Return where a deck states the orientation of a line; empty if it does not."""
    entry = deck.motions.get(line)
    if entry is not None:
        return f"initial.{line}.orientation" if entry.orientation is not None else ""
    for name, joint in deck.joints.items():
        on = line in {split_point(end)[0] for end in joint.between}
        if on and joint.welds and getattr(joint, "orientation", None) is not None:
            return f"joints.{name}.orientation"
    return ""


def _roll(assembly: Assembly, line: str) -> float:
    """Return by what angle the frame of a line is turned about its tangent at the start [rad]."""
    y = smallest_rotation(FIRST, assembly.tangent(line))[:, 1]
    return float(np.arccos(np.clip(y @ assembly.poses[line].turned(np.eye(3)[1]), -1.0, 1.0)))
