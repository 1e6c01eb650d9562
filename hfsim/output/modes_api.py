"""Modes and Campbell diagrams from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hfsim.marching.stop import Progress, nobody
from hfsim.output.api import load
from hfsim.output.arguments import AnyDeck, callback, integral, real, reals

if TYPE_CHECKING:
    from hfsim.studies.modes import Campbell, Modes


def modes(
    deck: AnyDeck,
    changes: Mapping[str, Any] | None = None,
    *,
    about: str = "start",
    at: float | None = None,
    period: float | None = None,
    count: int = 12,
    progress: Progress | None = None,
) -> Modes:
    """Find frequencies, damping and shapes of small motions; what ``hfsim modes`` does.

    Parameters
    ----------
    deck, changes
        As in `load`.
    about : str
        ``"start"``, ``"equilibrium"`` next to it, or ``"steady"``, the rotation at its rates.
    at : float, optional
        Instead: the state of a run at this time [s].
    period : float, optional
        Of the periodic motion next to the start, or next to the run at that time, about which they are [s];
        then ``found[1].multiplier``.
    count : int
        Modes wanted, from slow to fast.
    progress : callable, optional
        Called with the share of the runs that is done, 0 to 1.

    Returns
    -------
    Modes
        ``found.frequencies`` [Hz], ``found.damping_ratios``, ``found[2]`` with ``frequency``, ``kind``,
        ``value`` [1/s] and ``shapes`` by body; ``found.about.motions`` with the matrices.

    Raises
    ------
    DeckError, DeckNotFoundError
        If the deck is bad, or a law of it has no value somewhere until the time.
    ArgumentError
        If there is no such state, there are two, or no mode is wanted.
    HfsimError
        If the scene cannot be linearised there.
    """
    from hfsim.scene.measured import without_refused_channels
    from hfsim.studies.modes import modes_of, periodic
    from hfsim.studies.modes.about import about as state_of
    from hfsim.studies.modes.about import check_state

    real(at=at, period=period)
    integral(count=count)
    callback(progress=progress)
    loaded = without_refused_channels(load(deck, changes).with_numbers())
    if period is not None:
        check_state(about, at, period)
        return periodic(loaded, period, count, at, progress)
    return modes_of(state_of(loaded, about, at, progress), count)


def campbell(
    deck: AnyDeck,
    rates: Sequence[float],
    changes: Mapping[str, Any] | None = None,
    *,
    count: int = 12,
    body: str | None = None,
    progress: Progress | None = None,
) -> Campbell:
    """Find the modes about steady rotations at several rates; what ``hfsim modes --spin`` does.

    Parameters
    ----------
    deck, changes
        As in `load`; the scene turns about the axis at the start.
    rates : sequence of float
        [rad/s].
    count, progress
        As of `modes`.
    body : str, optional
        The body about whose axis, where bodies turn differently at the start.

    Returns
    -------
    Campbell
        ``found.rates``, ``found.frequencies(1)`` [Hz] of a mode at all rates, NaN at those of
        ``found.unsteady``, ``found.crossings``, and ``found.onsets`` of growth.

    Raises
    ------
    ArgumentError
        If no mode or rate is wanted, or one is no number.
    """
    from hfsim.scene.measured import without_refused_channels
    from hfsim.studies.modes import campbell as study
    from hfsim.studies.modes.about import about, seen_from

    wanted = reals("rates", rates)
    integral(count=count)
    callback(progress=progress)
    start = about(without_refused_channels(load(deck, changes).with_numbers()))
    if body is not None:
        start = seen_from(start, body)
    return study(start, wanted, count, progress or nobody)
