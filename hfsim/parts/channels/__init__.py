"""Output channels: functions of the samples of a solution, one column each.

`CHANNELS` maps the last word of a channel's name to all that is known of it: unit, subject, picture and what
computes it.  Some words are of bodies and of joints: unit and picture are the same then, and the rest follows
from the subject.  A new one takes a file here and its name in that table.
"""

from __future__ import annotations

from collections.abc import Container
from itertools import chain
from typing import Protocol

from hfsim.parts.channels import (
    deformation,
    energy,
    momentum,
    motion,
    reactions,
    section_forces,
    ties,
    violation,
)
from hfsim.parts.channels._base import OWNERS, ChannelKind, Plot, Sampled, Samples
from hfsim.parts.channels.section_forces import force_columns


def _along(axes: str, stem: str, kinds: tuple[ChannelKind, ...]) -> dict[str, ChannelKind]:
    """Return kinds by stem and axis."""
    return {f"{stem}_{axis}": kind for axis, kind in zip(axes, kinds, strict=True)}


_OF_BODIES: dict[str, ChannelKind] = {
    "x": motion.X,
    "y": motion.Y,
    "z": motion.Z,
    "vx": motion.VX,
    "vy": motion.VY,
    "vz": motion.VZ,
    "speed": motion.SPEED,
    "ax": motion.AX,
    "ay": motion.AY,
    "az": motion.AZ,
    "acceleration": motion.ACCELERATION,
    "deflection": deformation.DEFLECTION,
    **_along("yz", "deflection", deformation.DEFLECTIONS),
    "elongation": deformation.ELONGATION,
    "twist": deformation.TWIST,
    **section_forces.SECTION_FORCES,
    "angle": motion.ANGLE,
    "angular_velocity": motion.ANGULAR_VELOCITY,
    "angular_acceleration": motion.ANGULAR_ACCELERATION,
    **_along("xyz", "rotation", motion.ROTATIONS),
    **_along("wxyz", "quaternion", motion.QUATERNIONS),
    **_along("xyz", "angular_velocity", motion.SPINS),
    **_along("xyz", "angular_acceleration", motion.ANGULAR_ACCELERATIONS),
}
_OF_JOINTS: dict[str, ChannelKind] = {
    "force_x": reactions.FORCE_X,
    "force_y": reactions.FORCE_Y,
    "force_z": reactions.FORCE_Z,
    "moment": reactions.MOMENT,
    **_along("xyz", "moment", reactions.MOMENTS),
    "angle": ties.TIE_ANGLE,
    "angular_velocity": ties.TIE_RATE,
    "torque": ties.TORQUE,
    "distance": ties.DISTANCE,
    "distance_rate": ties.DISTANCE_RATE,
    "force": ties.FORCE,
    "power": ties.POWER,
}
_OF_THE_SCENE: dict[str, ChannelKind] = {
    "kinetic": energy.KINETIC,
    "strain": energy.STRAIN,
    "potential": energy.POTENTIAL,
    "total": energy.TOTAL,
    **_along("xyz", "linear", momentum.LINEAR),
    "angular": momentum.ANGULAR,
    **_along("xyz", "angular", momentum.ANGULARS),
    **dict(zip("xyz", momentum.CENTRE, strict=True)),
    "position": violation.POSITION,
    "velocity": violation.VELOCITY,
}
_TABLES = (_OF_BODIES, _OF_JOINTS, _OF_THE_SCENE)
CHANNELS: dict[str, tuple[ChannelKind, ...]] = {
    word: tuple(table[word] for table in _TABLES if word in table) for every in _TABLES for word in every
}


class Named(Protocol):
    """A deck, as far as channels need its names."""

    @property
    def bodies(self) -> Container[str]:
        """Names of bodies."""


def kind_of(name: str, of: Named | None = None) -> ChannelKind:
    """Return what is known of a channel; where it matters whether it is of a body, of the deck it is in.

    Examples
    --------
    >>> kind_of("b1.tip.vx").unit
    'm/s'
    """
    owner, kinds = name.partition(".")[0], CHANNELS[name.rpartition(".")[2]]
    return kinds[-1] if of is not None and owner not in of.bodies else kinds[0]


def is_judged(name: str, conserved: bool = True) -> bool:
    """Return whether errors of a channel count: not those of residuals, nor of a conserved energy."""
    kinds = CHANNELS.get(name.rpartition(".")[2])  # a deck that is being checked may name unknown ones
    judged = kinds[0].judged if kinds else "always"
    return judged == "always" or (judged == "unless conserved" and not conserved)


def scene_words() -> tuple[str, ...]:
    """Return the words that stand for the whole scene in names of channels."""
    return tuple(dict.fromkeys(kind.subject for kind in chain(*CHANNELS.values()) if kind.of_scene))


__all__ = [
    "CHANNELS",
    "OWNERS",
    "ChannelKind",
    "Named",
    "Plot",
    "Sampled",
    "Samples",
    "force_columns",
    "is_judged",
    "kind_of",
    "scene_words",
]
