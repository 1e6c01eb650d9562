"""Numbers and ends of runs in words."""

from __future__ import annotations

_ENDS = {"failed": "broke down", "limit": "reached a limit", "interrupted": "was interrupted"}


def ending(status: str, time: float) -> str:
    """Return how and when [s] a run or a model ended early."""
    return f"{_ENDS.get(status, 'stopped')} at {time:.3g} s"


def percent(fraction: float) -> str:
    """Return a fraction in per cent with two digits, however large or small.

    Examples
    --------
    >>> percent(0.000312), percent(83.0), percent(0.0), percent(1e-15), percent(5e-6)
    ('0.031 %', '8300 %', '0 %', '1e-13 %', '5e-4 %')
    """
    value = 100.0 * fraction
    if value == 0.0:
        return "0 %"
    if 1e-3 <= abs(value) < 1e5:
        return f"{float(f'{value:.2g}'):.10g} %"
    return f"{value:.0e} %".replace("e-0", "e-")
