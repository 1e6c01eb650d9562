"""Forces and moments in joints: what the first body does to the second."""

from __future__ import annotations

from collections.abc import Callable

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import ChannelKind, Plot, Samples
from hfsim.parts.channels._reaction import reaction


def _component(which: int, axis: int) -> Callable[[Samples, str], Array]:
    return lambda samples, joint: reaction(samples, joint)[which][:, axis]


_FORCE, _MOMENT = Plot("joint force", "joint_force"), Plot("joint moment", "joint_moment")
FORCE_X, FORCE_Y = (ChannelKind("N", _component(0, axis), "joint", _FORCE, solves=True) for axis in range(2))
FORCE_Z = ChannelKind("N", _component(0, 2), "joint", _FORCE, solves=True, dimensions=(3,))
MOMENT, *_IN_SPACE = (
    ChannelKind("N m", _component(1, axis), "joint", _MOMENT, dimensions=(n_dim,), solves=True)
    for n_dim, axis in ((2, 0), (3, 0), (3, 1), (3, 2))
)
MOMENTS = tuple(_IN_SPACE)
