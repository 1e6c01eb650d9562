"""Numbers and ends of runs in words."""

from __future__ import annotations

from typing import Protocol


class Ended(Protocol):
    """What is told of the end of a model: see `hfsim.studies.compare.result.ModelResult`."""

    @property
    def status(self) -> str:
        """How it ended."""

    @property
    def reason(self) -> str:
        """Why it ended early."""

    @property
    def stop_time(self) -> float:
        """When its computation stopped [s]."""


def how_it_ended(result: Ended) -> str:
    """Return how a model that did not reach the end stopped, with the time and the reason."""
    reason = f": {result.reason}" if result.reason else ""
    return f"{ending(result.status)} at {result.stop_time:.3g} s{reason}"


def ending(status: str) -> str:
    """Return the verb for an early end."""
    return {"failed": "broke down", "limit": "reached a limit", "interrupted": "was interrupted"}.get(
        status, "stopped"
    )


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
