"""Output channels: functions of the samples of a solution, one column each.

`CHANNELS` maps the last word of a channel's name to all that is known of it: unit, subject, picture and
what computes it. A new one takes a file here and its name in that table.
"""

from __future__ import annotations

from hfsim.parts.channels._base import ChannelKind, Plot, Sampled, Samples
from hfsim.parts.channels.deformation import DEFLECTION, ELONGATION
from hfsim.parts.channels.energy import KINETIC, POTENTIAL, STRAIN, TOTAL
from hfsim.parts.channels.motion import ANGLE, ANGULAR_VELOCITY, SPEED, VX, VY, X, Y, Z
from hfsim.parts.channels.reactions import FORCE_X, FORCE_Y, MOMENT
from hfsim.parts.channels.violation import POSITION, VELOCITY

CHANNELS: dict[str, ChannelKind] = {
    "x": X,
    "y": Y,
    "z": Z,
    "vx": VX,
    "vy": VY,
    "speed": SPEED,
    "deflection": DEFLECTION,
    "elongation": ELONGATION,
    "angle": ANGLE,
    "angular_velocity": ANGULAR_VELOCITY,
    "kinetic": KINETIC,
    "strain": STRAIN,
    "potential": POTENTIAL,
    "total": TOTAL,
    "position": POSITION,
    "velocity": VELOCITY,
    "force_x": FORCE_X,
    "force_y": FORCE_Y,
    "moment": MOMENT,
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


__all__ = ["CHANNELS", "ChannelKind", "Plot", "Sampled", "Samples", "is_judged", "kind_of", "scene_words"]
