"""Channels that have several values for one motion: which of them is meant."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from hfsim.marching.solution import Channel
from hfsim.maths.arrays import Array, IntArray
from hfsim.parts.channels import kind_of


def alike(channels: Sequence[Channel], truth: Sequence[Channel]) -> tuple[Channel, ...]:
    """Return channels with, of several values that mean the same, those that are nearest to a reference.

    Parameters
    ----------
    channels, truth : sequence of Channel
        At the same times; one of them may end earlier.

    Examples
    --------
    >>> half = Channel("top.rotation_z", "rad", np.array([3.0, -3.1]))
    >>> alike((half,), (half._replace(values=np.array([3.1, 3.15])),))[0].values.round(3).tolist()
    [3.0, 3.183]
    """
    found, known = list(channels), {channel.name: channel.values for channel in truth}
    for places, others in _families(channels):
        if not all(channels[k].name in known for k in places):
            continue
        mine = np.column_stack([channels[k].values for k in places])
        theirs = np.column_stack([known[channels[k].name] for k in places])
        n = min(len(mine), len(theirs))
        nearest = mine.copy()
        nearest[:n] = _nearest(mine[:n], others(mine[:n]), theirs[:n])
        for k, values in zip(places, nearest.T, strict=True):
            found[k] = channels[k]._replace(values=np.ascontiguousarray(values))
    return tuple(found)


def jumps(channels: Sequence[Channel]) -> dict[str, IntArray]:
    """Return, for channels that have several values, the rows before which they go over to another one."""
    found = dict[str, IntArray]()
    for places, others in _families(channels):
        values = np.column_stack([channels[k].values for k in places])
        kept = _nearest(values[1:], others(values[1:]), values[:-1])
        rows = 1 + np.flatnonzero((kept != values[1:]).any(axis=1))
        found.update({channels[k].name: rows for k in places})
    return found


def _families(channels: Sequence[Channel]) -> Iterator[tuple[list[int], Callable[[Array], Array]]]:
    """Yield the places of channels that have several values together, and what gives the others."""
    families: dict[tuple[str, Callable[[Array], Array]], list[int]] = {}
    for k, channel in enumerate(channels):
        subject, others = channel.name.rpartition(".")[0], kind_of(channel.name).others
        if others is not None and len(channel.values):
            families.setdefault((subject, others), []).append(k)
    yield from ((places, others) for (_, others), places in families.items())


def _nearest(values: Array, others: Array, near: Array) -> Array:
    """Return for each row of shape (n_times, n) that of the two that is nearer."""
    own, other = (np.linalg.norm(one - near, axis=1) for one in (values, others))
    return np.where((other < own)[:, None], others, values)
