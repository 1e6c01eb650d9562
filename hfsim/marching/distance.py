"""How far apart the channels of two runs are, and which of them count.

A distance is judged relative to the reference channel's own range.  A range that is tiny against the scene
(a deflection of micrometres on a beam of metres) tells models apart that differ in nothing of use, so what
distances are divided by never falls below `SMALL` times the size of all channels with its unit.  Errors are
relative to ranges however small, but for what stands still.

Nothing is solved here.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hfsim.marching.alike import alike
from hfsim.marching.solution import Channel
from hfsim.maths.arrays import Array, magnitude
from hfsim.parts.channels import CHANNELS, Samples, is_judged
from hfsim.scene.build import Scene

SMALL = 1e-3
"""Range of a channel, relative to the size of its unit, below which it is too small to be judged by."""

STILL = 1e-8
"""Range of a channel, relative to the size of its unit in the scene, from which it stands still."""

STRETCHED = 1e-4
"""Strain of a beam by which forces in it are measured."""
_ALONG = np.linspace(0.0, 1.0, 9)

_TINY = 1e-12
"""Smallest scale of any channel, in its unit: nothing is divided by zero."""

MOMENTS = {"N m": "N"}
"""Units of which one is a length times the other: a force with an arm is a moment."""

_NATURAL = {"rad": 1.0, "-": 1.0}
"""Units with a size of their own, whatever the scene."""

_FROM_ZERO = ("m/s^2", "rad/s^2", "W", "energy.kinetic", "energy.strain")
"""Other units, and channels, in which zero means something."""

GROUPS = {
    "motion": ("m", "rad", "-"),
    "rates": ("m/s", "rad/s"),
    "forces": ("N", "N m", "Pa"),
    "energies": ("J",),
}
"""Kinds of channels by their units: what is good enough for one kind need not be for the next."""


def group_of(unit: str) -> str:
    """Return the group of channels with a unit.

    Examples
    --------
    >>> group_of("rad/s"), group_of("W")
    ('rates', 'others')
    """
    return next((group for group, units in GROUPS.items() if unit in units), "others")


# --- sizes ---------------------------------------------------------------------------------------


def span(values: Array) -> float:
    """Return the largest minus the smallest value; 0 where there is none."""
    return float(np.ptp(values)) if len(values) else 0.0


def unit_sizes(channels: Iterable[Channel], size: Callable[[Array], float]) -> dict[str, float]:
    """Return by unit the largest size of any channel with it.

    Examples
    --------
    >>> x, y = Channel("x", "m", np.array([1.0, 2.0])), Channel("y", "m", np.array([-3.0, -3.0]))
    >>> unit_sizes((x, y), span), unit_sizes((x, y), magnitude)
    ({'m': 1.0}, {'m': 3.0})
    """
    largest: dict[str, float] = {}
    for channel in channels:
        largest[channel.unit] = max(largest.get(channel.unit, 0.0), size(channel.values))
    return largest


def related(sizes: Mapping[str, float], length: float, pairs: Mapping[str, str]) -> dict[str, float]:
    """Return sizes of units of which some are a length times others: none is small where the other is large.

    Examples
    --------
    >>> related({"N": 100.0, "N m": 1e-6}, 0.5, MOMENTS)
    {'N': 100.0, 'N m': 50.0}
    """
    found = dict(sizes)
    for larger, smaller in pairs.items():
        whole, part = sizes.get(larger, 0.0), sizes.get(smaller, 0.0)
        found[larger] = max(whole, part * length)
        found[smaller] = max(part, whole / length) if length > 0.0 else part
    return found


def _length(values: Array) -> float:
    return max(span(values), SMALL * magnitude(values))


class ChannelScale(NamedTuple):
    """What distances in one channel are divided by.

    Attributes
    ----------
    channel, unit : str
        Name and SI unit.
    reference_range : float
        Largest minus smallest value of the reference over its whole span, in `unit`.
    scale : float
        Divisor, in `unit`: the range, or more where that is too small to judge by.
    small : bool
        Whether the range was too small to judge by.
    judged : bool
        Whether the channel counts for a verdict.
    """

    channel: str
    unit: str
    reference_range: float
    scale: float
    small: bool
    judged: bool

    @property
    def group(self) -> str:
        """The group of its unit."""
        return group_of(self.unit)


def decisive(scales: Sequence[ChannelScale], named: Collection[str] = ()) -> tuple[ChannelScale, ...]:
    """Return scales of which those alone are judged that a verdict on models is to rest on.

    Those are the channels named or, without names, the motion: rates, forces and energies carry the fast
    modes, which hide all else.  Where there is no motion among the channels, all that can be are judged.

    Examples
    --------
    >>> x = ChannelScale("b1.tip.x", "m", 2.0, 2.0, False, True)
    >>> rate = ChannelScale("b1.angular_velocity", "rad/s", 1.0, 1.0, False, True)
    >>> [[one.judged for one in decisive((x, rate), named)] for named in ((), ("b1.angular_velocity",))]
    [[True, False], [False, True]]
    >>> decisive((rate,))[0].judged
    True
    """
    motion = {one.channel for one in scales if one.judged and one.group == "motion"}
    chosen = named or motion or {one.channel for one in scales}
    return tuple(one._replace(judged=one.judged and one.channel in chosen) for one in scales)


def channel_scales(
    channels: Sequence[Channel],
    outlines: Mapping[str, Array] | None = None,
    conserved: bool = False,
    small: float = SMALL,
) -> tuple[ChannelScale, ...]:
    """Return what distances from each channel of a reference are judged against.

    Parameters
    ----------
    channels : sequence of Channel
        Of the reference, with at least one value.
    outlines : mapping of str to ndarray, shape (n_times, n_points, n_dim), optional
        Of its bodies [m]; without it, the channels alone tell how large things are.
    conserved : bool
        Whether the total energy is conserved: it has no range to be judged by then.
    small : float
        Range, relative to the size of its unit, below which a channel is judged by `SMALL` times that size.

    Returns
    -------
    tuple of ChannelScale
        The size of a unit is the largest magnitude in any channel with it; for lengths, the largest
        range of any channel (or a thousandth of its magnitude: what does not change but for round-off)
        or extent of the bodies, as where the origin lies must not matter; for moments, at least that of
        forces times lengths, and the other way round; for angles, beside bodies, at least one radian.
    """
    moving = [c for c in channels if is_judged(c.name, conserved=False)]
    sizes = {**unit_sizes(moving, magnitude), "m": unit_sizes(moving, _length).get("m", 0.0)}
    extents = (float(np.ptp(points[0], axis=0).max()) for points in (outlines or {}).values() if points.size)
    sizes["m"] = max([sizes["m"], *extents])
    sizes = related(sizes, sizes["m"], MOMENTS)
    natural = {} if outlines is None else _NATURAL

    def scale_of(channel: Channel) -> ChannelScale:
        unit, own = channel.unit, span(channel.values)
        size = max(sizes.get(unit, 0.0), natural.get(unit, 0.0))
        too_small = own < max(small * size, _TINY)
        scale = max(own, SMALL * size, _TINY) if too_small else own
        return ChannelScale(channel.name, unit, own, scale, too_small, is_judged(channel.name, conserved))

    return tuple(map(scale_of, channels))


def reference_scales(samples: Samples, channels: Sequence[Channel]) -> tuple[ChannelScale, ...]:
    """Return the `channel_scales` of a reference, from the samples that its channels were computed of."""
    scene = samples.scene
    outlines = {name: body.extent(samples.x) for name, body in scene.bodies.items()}
    # a conserved energy has no range to be measured by; the energy drift tells of it
    return channel_scales(channels, outlines, conserved=not scene.system.exchanges_power)


def scene_sizes(scene: Scene) -> dict[str, float]:
    """Return by unit how large motions in a scene are, by its bodies at the start and its duration.

    Forces are measured by what stretches a beam by `STRETCHED`, and accelerations by what that gives it: much
    smaller ones are its rounding.
    """
    x = scene.system.absolute(scene.q[None])
    points = [extent[0] for body in scene.bodies.values() if (extent := body.extent(x)).size]
    length = max((float(np.ptp(one, axis=0).max()) for one in points), default=0.0)
    if not length and points:  # of places alone, and the origin
        length = float(np.ptp(np.vstack([*points, 0.0 * points[0]]), axis=0).max())
    rate = 1.0 / scene.deck.solve.duration
    force = gained = 0.0
    for name, beam in ((name, one) for name, one in scene.deck.bodies.items() if one.type == "beam"):
        along = scene.deck.section_properties(name).at(_ALONG)
        own = STRETCHED * float(np.max(along.axial_stiffness))
        mass = float(np.mean(along.mass_per_length)) * beam.length
        force, gained = max(force, own), max(gained, own / mass)
    return {
        **_NATURAL,
        **{"m": length, "m/s": length * rate, "m/s^2": max(length * rate**2, gained)},
        **{"rad/s": rate, "rad/s^2": max(rate**2, gained / length if length else 0.0)},
        **{"N": force, "N m": force * length},
    }


def error_scales(
    channels: Sequence[Channel], reference: Sequence[Channel], sizes: Mapping[str, float] | None = None
) -> tuple[ChannelScale, ...]:
    """Return what errors are divided by: ranges however small, but for what stands still in either run.

    What counts from zero and stays within `SMALL` of its own size, as the tension of what turns steadily, has
    a range of errors alone: it is judged by that size.  Parameters are those of `channel_errors`.

    Examples
    --------
    >>> y = Channel("b1.tip.y", "m", np.array([0.0, 1.0]))
    >>> x = Channel("b1.tip.x", "m", np.array([0.0, 1e-9]))
    >>> [error_scales((x,), (x,), sizes)[0].scale for sizes in ({}, {"m": 2.0})]
    [1e-09, 0.002]
    >>> [one.scale for one in error_scales((x, y), (x, y))]
    [0.001, 1.0]
    """
    mine, truth, known = _shared(channels, reference), _shared(reference, channels), sizes or {}

    def judged(one: ChannelScale, channel: Channel, better: Channel) -> ChannelScale:
        size, level = known.get(one.unit, 0.0), magnitude(better.values)
        least = min(one.reference_range, span(channel.values))
        if counts_from_zero(better) and least < SMALL * level:
            one = one._replace(scale=max(one.scale, level), small=True)
        if least >= STILL * size:
            return one
        return one._replace(scale=max(one.scale, SMALL * size), small=True)

    return tuple(map(judged, channel_scales(truth, conserved=True, small=STILL), mine, truth))


def counts_from_zero(channel: Channel) -> bool:
    """Return whether zero means something in a channel, as of forces, rates and deformations of beams.

    Examples
    --------
    >>> [counts_from_zero(Channel(*one, np.zeros(1))) for one in (("b.tip.x", "m"), ("b.tip.vx", "m/s"))]
    [False, True]
    """
    kinds = CHANNELS.get(channel.name.rpartition(".")[2], ())
    counted = group_of(channel.unit) in ("forces", "rates") or channel.unit in _FROM_ZERO
    return counted or channel.name in _FROM_ZERO or any(one.only_beams for one in kinds)


# --- distances -----------------------------------------------------------------------------------


class Gap(NamedTuple):
    """Distance of one channel from another over time: largest and root mean square, in its unit; where."""

    largest: float
    rms: float
    at: int


def gap(values: Array, truth: Array) -> Gap:
    """Return how far values are from others at the same times, shape (n_times,); zeros where there are none.

    Examples
    --------
    >>> gap(np.array([1.0, 3.0]), np.array([1.0, 1.0]))
    Gap(largest=2.0, rms=1.4142135623730951, at=1)
    """
    distance = np.abs(values - truth)
    largest = float(distance.max(initial=0.0))
    if largest == 0.0:
        return Gap(0.0, 0.0, 0)
    # a diverged run must not overflow
    rms = largest * float(np.sqrt(np.mean((distance / largest) ** 2)))
    return Gap(largest, rms, int(distance.argmax()))


def channel_errors(
    channels: Sequence[Channel], reference: Sequence[Channel], sizes: Mapping[str, float] | None = None
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the largest distance of each channel from that of a reference, as long as both last.

    Parameters
    ----------
    channels, reference : sequence of Channel
        The same ones, at the same times; one of them may end earlier.
    sizes : mapping of str to float, optional
        The `scene_sizes`: what stands still is judged by them.

    Returns
    -------
    absolute : dict of str to float
        In the unit of the channel; without residuals of the joints.
    relative : dict of str to float
        Over its `error_scales` in the reference for that long [-]; without ``energy.total``, which has no
        range to be measured by where it is conserved, and without units in which nothing is but round-off.
    """
    absolute: dict[str, float] = {}
    relative: dict[str, float] = {}
    scales = error_scales(channels, reference, sizes)
    channels, reference = _shared(channels, reference), _shared(reference, channels)
    for channel, better, scale in zip(alike(channels, reference), reference, scales, strict=True):
        name = channel.name
        if not len(better.values) or not is_judged(name, conserved=False):
            continue
        absolute[name] = gap(channel.values, better.values).largest
        if scale.judged and scale.scale > _TINY:
            relative[name] = absolute[name] / scale.scale
    return absolute, relative


def _shared(channels: Sequence[Channel], others: Sequence[Channel]) -> tuple[Channel, ...]:
    """Return channels up to where others end."""
    pairs = zip(channels, others, strict=True)
    return tuple(one._replace(values=one.values[: len(other.values)]) for one, other in pairs)


def farthest(errors: Mapping[str, float]) -> tuple[str, float | None]:
    """Return the channel with the largest error, and that; no channel and None without any.

    Examples
    --------
    >>> farthest({"x": 0.1, "y": 0.3}), farthest({})
    (('y', 0.3), ('', None))
    """
    worst = max(errors, key=lambda name: errors[name], default="")
    return worst, errors.get(worst)
