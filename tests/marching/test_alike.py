"""Turns whose numbers jump: errors are those of the turn, wherever the jump lies."""

import numpy as np
import pytest

from hfsim.marching.alike import alike, jumps
from hfsim.marching.distance import channel_errors
from hfsim.marching.solution import Channel
from hfsim.maths.rotations import quaternion, rotation, rotation_vector

T = np.linspace(0.0, 10.0, 2001)
AXIS = np.array([0.3, 0.9, -0.3]) / np.linalg.norm([0.3, 0.9, -0.3])
ROTATIONS, QUATERNIONS = [f"rotation_{one}" for one in "xyz"], [f"quaternion_{one}" for one in "wxyz"]


def turned(late=0.0, names=(*ROTATIONS, *QUATERNIONS)):
    """Channels of a body that turns by 3 rad/s about an axis that wanders, some angle late."""
    R = np.array([rotation(AXIS * (3.0 * t - late)) @ rotation(np.array([0.2 * t, 0.0, 0.0])) for t in T])
    values = dict(
        zip((*ROTATIONS, *QUATERNIONS), np.hstack([rotation_vector(R), quaternion(R)]).T, strict=True)
    )
    return tuple(Channel(f"top.{name}", "rad" if "r" in name[:2] else "-", values[name]) for name in names)


def test_an_error_in_time_is_small_in_all_numbers_of_a_turn():
    late = 0.02  # more than the turn between two rows: at some of them one has jumped and the other not
    absolute, relative = channel_errors(turned(late), turned())
    assert len(relative) == 7
    assert 0.4 * late < max(absolute.values()) < 3.0 * late and max(relative.values()) < late


@pytest.mark.parametrize("late", [0.3, -2.0])
def test_a_large_error_stays_large(late):
    """At most the other half of the numbers' range may be forgiven: a turn is known up to whole turns."""
    absolute, _ = channel_errors(turned(late), turned())
    largest = max(size for name, size in absolute.items() if "quaternion" in name)
    assert largest > 0.5 * abs(np.sin(0.5 * late))


def test_a_channel_alone_is_that_of_a_turn_about_its_axis():
    spins = [
        Channel("top.rotation_z", "rad", (2.0 * T + late + np.pi) % (2.0 * np.pi) - np.pi)
        for late in (0.0, 1e-4)
    ]
    absolute, _ = channel_errors(spins[:1], spins[1:])
    assert absolute["top.rotation_z"] == pytest.approx(1e-4)
    wrong = spins[0]._replace(values=-spins[0].values)
    assert channel_errors([wrong], spins[:1])[0]["top.rotation_z"] > 3.0


def test_curves_jump_where_the_numbers_do():
    found = jumps(turned())
    for names in (ROTATIONS, QUATERNIONS):
        values = np.array([one.values for one in turned(names=names)])
        steps = np.linalg.norm(np.diff(values, axis=1), axis=0)
        rows = 1 + np.flatnonzero(steps > 1.0)
        assert len(rows) >= 4 and all(found[f"top.{name}"].tolist() == rows.tolist() for name in names)


def test_other_channels_and_other_lengths_stay():
    place = Channel("top.x", "m", T)
    short = [one._replace(values=one.values[:100]) for one in turned()]
    first, *turns = alike([place, *turned(1e-3)], [place, *short])
    assert first is place
    assert all(len(one.values) == len(T) for one in turns)
    assert np.array_equal(turns[0].values[100:], turned(1e-3)[0].values[100:])
    lone = turned()
    assert all(one is other for one, other in zip(alike(lone, [place]), lone, strict=True))
    assert jumps([place]) == {}
