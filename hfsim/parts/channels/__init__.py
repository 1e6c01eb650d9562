"""Output channels: functions of the samples of a solution, one column each.

`CHANNELS` maps the last word of a channel's name to what computes it.
"""

from __future__ import annotations

from hfsim.parts.channels._base import ChannelKind, Samples
from hfsim.parts.channels.deformation import deflection, elongation
from hfsim.parts.channels.energy import energy
from hfsim.parts.channels.motion import angle, angular_velocity, speed, vx, vy, x, y
from hfsim.parts.channels.reactions import force_x, force_y, moment
from hfsim.parts.channels.violation import violation

CHANNELS: dict[str, ChannelKind] = {
    "x": ChannelKind("m", x),
    "y": ChannelKind("m", y),
    "vx": ChannelKind("m/s", vx),
    "vy": ChannelKind("m/s", vy),
    "speed": ChannelKind("m/s", speed),
    "deflection": ChannelKind("m", deflection),
    "elongation": ChannelKind("m", elongation),
    "angle": ChannelKind("rad", angle),
    "angular_velocity": ChannelKind("rad/s", angular_velocity),
    "kinetic": ChannelKind("J", energy),
    "strain": ChannelKind("J", energy),
    "potential": ChannelKind("J", energy),
    "total": ChannelKind("J", energy),
    "position": ChannelKind("m", violation),
    "velocity": ChannelKind("m/s", violation),
    "force_x": ChannelKind("N", force_x),
    "force_y": ChannelKind("N", force_y),
    "moment": ChannelKind("N m", moment),
}

__all__ = ["CHANNELS", "ChannelKind", "Samples"]
