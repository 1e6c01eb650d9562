"""Angles and distances of joints and springs, what these exert there on the second body, and their power."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.rotations import wrap
from hfsim.parts.channels._base import OF_ANGLES, OF_SPINS, ChannelKind, Plot, Samples
from hfsim.parts.channels._reaction import held_effort, joint_multipliers


def _value(unit: str) -> Callable[[Samples, str], Array]:
    def value(samples: Samples, name: str) -> Array:
        measured = samples.scene.coordinate(name, unit).measured(samples.t, samples.x)[0]
        near = samples.turns.get(name) if unit == "rad" else None
        return measured if near is None else np.asarray(near + wrap(measured - near))

    return value


def _rate(unit: str) -> Callable[[Samples, str], Array]:
    return lambda samples, name: samples.scene.coordinate(name, unit).rate(samples.t, samples.x, samples.u)


def _effort(unit: str) -> Callable[[Samples, str], Array]:
    """Return what gives the force, or the torque, of all that a joint or a spring exerts."""

    def effort(samples: Samples, name: str) -> Array:
        scene = samples.scene
        parts = [tie.effort(*samples.state) for tie in scene.ties(name) if tie.unit == unit]
        if name in scene.joints:
            per_unit = scene.coordinate(name, unit).unit_effort(samples.x)
            parts += held_effort(samples, name, per_unit, int(unit == "rad"))
        return _sum(samples, parts)

    return effort


def _power(samples: Samples, name: str) -> Array:
    """Return what ties do at the rates of their coordinates, and what drivers do."""
    scene, state = samples.scene, samples.state
    parts = [tie.delivered(*state) for tie in scene.ties(name)]
    if name in scene.joints:
        driven = joint_multipliers(samples, name)
        parts += [np.sum(own * one.rate(samples.t), axis=-1) for one, own in driven if one.driven]
    return _sum(samples, parts)


def _sum(samples: Samples, parts: list[Array]) -> Array:
    return sum(parts, np.zeros(len(samples.t)))


TIE_ANGLE = ChannelKind("rad", _value("rad"), "tie", OF_ANGLES, measured="rad", of_turns=True)
"""Of B's frame against A's, all full turns counted."""
TIE_RATE = ChannelKind("rad/s", _rate("rad"), "tie", OF_SPINS, measured="rad")
"""Rate of that."""
TORQUE = ChannelKind("N m", _effort("rad"), "tie", Plot("torque", "torque"), measured="rad", solves=True)
"""What turns B on along the angle."""
DISTANCE = ChannelKind("m", _value("m"), "tie", Plot("distance", "distance"), measured="m")
"""Of B from A, along the axis of a joint."""
DISTANCE_RATE = ChannelKind("m/s", _rate("m"), "tie", Plot("distance rate", "distance_rate"), measured="m")
FORCE = ChannelKind("N", _effort("m"), "tie", Plot("force", "force"), measured="m", solves=True)
"""What pushes B away from A along that."""
POWER = ChannelKind("W", _power, "tie", Plot("power", "power"), solves=True)
"""What joint or spring does to both bodies."""
