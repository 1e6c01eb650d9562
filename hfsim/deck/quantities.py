"""Quantities that studies collect: a number of each run, as ``final(arm.tip.x)`` or ``frequency(2)``.

It is one small grammar for all that names numbers of runs: published values in decks, columns of sweeps.
"""

from __future__ import annotations

import re
from math import inf
from typing import NamedTuple

from hfsim.deck.source import did_you_mean
from hfsim.deck.units import UnitError, parse_quantity

FORMS = {
    "final": ("final(CHANNEL)", ("run", "static")),
    "at": ("at(TIME, CHANNEL)", ("run", "static")),
    "max": ("max(CHANNEL)", ("run",)),
    "min": ("min(CHANNEL)", ("run",)),
    "mean": ("mean(CHANNEL)", ("run",)),
    "rms": ("rms(CHANNEL)", ("run",)),
    "frequency": ("frequency(NUMBER)", ("modes",)),
    "damping": ("damping(NUMBER)", ("modes",)),
    "critical": ("critical(NUMBER)", ("static",)),
}
"""How each quantity is written, and the studies that have it, the usual one first.

Of a run: value at its end, at a time, largest, smallest, mean and root of the mean square over time; at rest:
value, and that under the loads at a time; factors of the loads at which it gives way, from the smallest.  Of
modes, counted from the lowest: frequency [Hz], damping ratio [-].
"""

ALONG = ("max", "min", "mean", "rms")
"""Those of all times of a run, or of a window: ``max(CHANNEL, FROM..TO)``, ``max(CHANNEL, FROM..)``."""

_WRITTEN = re.compile(r"\s*([A-Za-z_]\w*)\s*\(([^()]*)\)\s*")
_NUMBER = re.compile(r"[1-9][0-9]{0,4}")
_SECONDS = re.compile(r"-?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]{1,2})?")


class QuantityError(ValueError):
    """A text names no quantity; `hint` says what would be right."""

    def __init__(self, message: str, hint: str = "") -> None:
        self.hint = hint
        super().__init__(message)


class Quantity(NamedTuple):
    """One number of a study.

    Attributes
    ----------
    kind : str
        A key of `FORMS`.
    channel : str
        Of which; empty for those of modes and of critical loads.
    time : float or None
        When [s], for ``at``.
    number : int
        Of the mode or the critical load, from 1; 0 for those of channels.
    window : tuple of float, optional
        Between which times [s], for those in `ALONG`; the last is infinite where it is the run's end.
    """

    kind: str
    channel: str = ""
    time: float | None = None
    number: int = 0
    window: tuple[float, float] | None = None

    def __str__(self) -> str:
        """Return it as it is written."""
        time = "" if self.time is None else f"{self.time:.12g}, "
        ends = ("" if end == inf else f"{end:.12g}" for end in self.window or ())
        window = ", " + "..".join(ends) if self.window else ""
        return f"{self.kind}({time}{self.channel or self.number}{window})"

    def beyond(self, end: float) -> str:
        """Return that a run which ends so early does not have it [s]; empty if it may."""
        begin, last = self.window or (0.0, self.time or 0.0)
        if end < last < inf:
            return f"there is nothing at {last:g} s: the run ends at {end:g} s"
        return f"there is nothing after {begin:g} s: the run ends at {end:g} s" if end <= begin > 0.0 else ""

    @property
    def studies(self) -> tuple[str, ...]:
        """Studies that have it, the usual one first."""
        return FORMS[self.kind][1]


def read_quantity(text: str) -> Quantity:
    """Return what a text names, or raise `QuantityError`.

    Examples
    --------
    >>> read_quantity("at(500 ms, b1.tip.x)")
    Quantity(kind='at', channel='b1.tip.x', time=0.5, number=0, window=None)
    >>> str(read_quantity(" frequency( 2 )")), str(read_quantity("max(b1.tip.x, 500 ms..2 s)"))
    ('frequency(2)', 'max(b1.tip.x, 0.5..2)')
    """
    found = _WRITTEN.fullmatch(text)
    if found is None:
        raise QuantityError("is no quantity", f"one of {', '.join(form for form, _ in FORMS.values())}")
    word, inside = found[1], [part.strip() for part in found[2].split(",")]
    if word not in FORMS:
        raise QuantityError(f"there is no quantity '{word}'", did_you_mean(word, FORMS))
    form = FORMS[word][0]
    if word in ALONG and len(inside) == 2 and inside[0]:
        return Quantity(word, inside[0], window=_window(inside[1]))
    if len(inside) != 1 + form.count(",") or not all(inside):
        raise QuantityError(f"is not all that '{word}' needs", f"write {form}")
    if "NUMBER" in form:
        if not _NUMBER.fullmatch(inside[0]):
            raise QuantityError(f"'{word}' counts from 1, '{inside[0]}' is no such number", f"{word}(1)")
        return Quantity(word, number=int(inside[0]))
    return Quantity(word, inside[-1], _time(inside[0]) if len(inside) > 1 else None)


def _window(text: str) -> tuple[float, float]:
    first, dots, last = (part.strip() for part in text.partition(".."))
    if not dots or not first:
        raise QuantityError(f"'{text}' is no window of time", "write 0.5 s..2 s, or 0.5 s.. up to its end")
    begin, end = _time(first), _time(last) if last else inf
    if begin and last and bool(_SECONDS.fullmatch(first)) != bool(_SECONDS.fullmatch(last)):
        raise QuantityError(f"'{text}' has one unit for two times", "give both of them their unit")
    if begin >= end:
        raise QuantityError(f"the window {text} has no length", f"for one time write at({first}, CHANNEL)")
    return begin, end


def _time(text: str) -> float:
    try:
        time = float(text) if _SECONDS.fullmatch(text) else parse_quantity(text, "time")
    except UnitError as error:
        raise QuantityError(f"the time {error}", error.hint) from None
    if time < 0.0:
        raise QuantityError(f"there is nothing at {text}", "times count from the start")
    return time
