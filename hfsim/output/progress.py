"""How far a simulation has come: one redrawn line on a terminal, rare lines elsewhere."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import TextIO

from hfsim.output.text import printable

_REDRAW = 0.1
"""Shortest time between two drawings on a terminal [s]."""
_HEARTBEAT = 10.0
"""Shortest time between two lines elsewhere [s]."""
_FIRST, _LEAST = 2.0, 0.02
"""Time [s] and fraction from which the rest is forecast: starts are slower than what follows."""


class Progress:
    """Reports fractions of a job; made to be called at every step.

    Parameters
    ----------
    label : str
        What is being computed, e.g. ``two_beams, exact``.
    stream : TextIO
        Where to write (standard error).
    quiet : bool
        Write nothing at all.
    clock : callable
        Returns a time [s]; a test may put its own here.
    """

    def __init__(
        self,
        label: str,
        stream: TextIO,
        quiet: bool = False,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._label = printable(label)
        self._stream = stream
        self._quiet = quiet
        self._clock = clock
        self._redraws = stream.isatty()
        self._pause = _REDRAW if self._redraws else _HEARTBEAT
        self._start = clock()
        self._next = self._start + self._pause
        self._drawn = 0
        self._seen = deque([(self._start, 0.0)])

    def __call__(self, fraction: float) -> None:
        """Report that `fraction` (0..1) of the job is done."""
        if self._quiet:
            return
        now = self._clock()
        if now - self._seen[-1][0] >= _REDRAW:
            self._seen.append((now, fraction))
        if now < self._next:
            return
        self._next = now + self._pause
        self._write(describe(self._label, fraction, now - self._start, self._to_go(now, fraction)))

    def _to_go(self, now: float, fraction: float) -> float | None:
        """Return the time left at the pace of the latter half of the time so far; None without one."""
        while len(self._seen) > 1 and self._seen[1][0] <= 0.5 * (self._start + now):
            self._seen.popleft()
        since, before = self._seen[0]
        if now - self._start < _FIRST or fraction < _LEAST or fraction <= before:
            return None
        return (now - since) * (1.0 - fraction) / (fraction - before)

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Wipe the redrawn line, so that what follows starts on a clean one."""
        if self._drawn:
            self._put("\r" + " " * self._drawn + "\r")
            self._drawn = 0

    def _write(self, text: str) -> None:
        if not self._redraws:
            self._put(text + "\n")
            return
        self._put("\r" + text.ljust(self._drawn))
        self._drawn = max(self._drawn, len(text))

    def _put(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):  # nobody reads any more: no reason to stop computing
            self._quiet = True


def describe(label: str, fraction: float, elapsed: float, to_go: float | None = None) -> str:
    """Return the progress line after `elapsed` seconds, with the time left where it is known.

    Examples
    --------
    >>> describe("two_beams, exact", 0.25, 3.0, 9.0)
    'two_beams, exact:  25 %, 3 s, about 9 s to go'
    """
    line = f"{label}: {100 * fraction:3.0f} %, {_duration(elapsed)}"
    return line if to_go is None else f"{line}, about {_duration(to_go)} to go"


def _duration(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
