"""Output channels: functions of the samples of a solution, one column each.

`CHANNELS` maps the last word of a channel's name to all that is known of it: unit, subject, picture and
what computes it. A new one takes a file here and its name in that table.
"""

from __future__ import annotations

from hfsim.parts.channels._base import ChannelKind, Plot, Sampled, Samples
from hfsim.parts.channels.deformation import DEFLECTION, DEFLECTIONS, ELONGATION, TWIST
from hfsim.parts.channels.energy import KINETIC, POTENTIAL, STRAIN, TOTAL
from hfsim.parts.channels.motion import (
    ANGLE,
    ANGULAR_VELOCITY,
    QUATERNIONS,
    ROTATIONS,
    SPEED,
    SPINS,
    VX,
    VY,
    VZ,
    X,
    Y,
    Z,
)
from hfsim.parts.channels.reactions import FORCE_X, FORCE_Y, FORCE_Z, MOMENT, MOMENTS
from hfsim.parts.channels.section_forces import SECTION_FORCES, force_columns
from hfsim.parts.channels.violation import POSITION, VELOCITY

CHANNELS: dict[str, ChannelKind] = {
    "x": X,
    "y": Y,
    "z": Z,
    "vx": VX,
    "vy": VY,
    "vz": VZ,
    "speed": SPEED,
    "deflection": DEFLECTION,
    **{f"deflection_{axis}": kind for axis, kind in zip("yz", DEFLECTIONS, strict=True)},
    "elongation": ELONGATION,
    "twist": TWIST,
    **SECTION_FORCES,
    "angle": ANGLE,
    "angular_velocity": ANGULAR_VELOCITY,
    **{f"rotation_{axis}": kind for axis, kind in zip("xyz", ROTATIONS, strict=True)},
    **{f"quaternion_{part}": kind for part, kind in zip("wxyz", QUATERNIONS, strict=True)},
    **{f"angular_velocity_{axis}": kind for axis, kind in zip("xyz", SPINS, strict=True)},
    "kinetic": KINETIC,
    "strain": STRAIN,
    "potential": POTENTIAL,
    "total": TOTAL,
    "position": POSITION,
    "velocity": VELOCITY,
    "force_x": FORCE_X,
    "force_y": FORCE_Y,
    "force_z": FORCE_Z,
    "moment": MOMENT,
    **{f"moment_{axis}": kind for axis, kind in zip("xyz", MOMENTS, strict=True)},
}


def kind_of(name: str) -> ChannelKind:
    """Return what is known of a channel.

    Examples
    --------
    >>> kind_of("b1.tip.vx").unit
    'm/s'
    """
    return CHANNELS[name.rpartition(".")[2]]


def is_judged(name: str, conserved: bool = True) -> bool:
    """Return whether errors of a channel count: not those of residuals, nor of a conserved energy."""
    kind = CHANNELS.get(name.rpartition(".")[2])  # a deck that is being checked may name unknown ones
    judged = kind.judged if kind else "always"
    return judged == "always" or (judged == "unless conserved" and not conserved)


def scene_words() -> tuple[str, ...]:
    """Return the words that stand for the whole scene in names of channels."""
    return tuple(dict.fromkeys(kind.subject for kind in CHANNELS.values() if kind.of_scene))


__all__ = [
    "CHANNELS",
    "ChannelKind",
    "Plot",
    "Sampled",
    "Samples",
    "force_columns",
    "is_judged",
    "kind_of",
    "scene_words",
]
