"""What people read of an equilibrium."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hfsim.output.report import fact_lines, findings, last_values, sizes, tell_doubts
from hfsim.output.talk import Talk, print_error
from hfsim.output.text import plural

if TYPE_CHECKING:
    from hfsim.marching.solution import Run


def tell(
    run: Run, summary: Mapping[str, Any], folder: Path | None, talk: Talk, told: Container[str] = ()
) -> None:
    """Print an equilibrium, and what the user should be warned of, save what was told before."""
    tell_doubts(run, summary, talk, told)
    if run.status != "done":
        print_error(f"{run.name}: no equilibrium: {run.reason}")
        print_error(findings(run.failure or {}))
    elif run.reason:
        print_error(f"{run.name}: {run.reason}")
    talk.facts(summary)
    talk.result(f"{run.name}: {_headline(run, summary)}\n{as_text(run, summary, folder)}")


def _headline(run: Run, summary: Mapping[str, Any]) -> str:
    if run.status != "done":
        return f"no equilibrium; reached with {summary['load']:.4g} of the loads"
    stable = {None: "not known whether stable", True: "stable", False: "not stable"}
    return f"equilibrium, {stable[summary['stable']]}"


def as_text(run: Run, summary: Mapping[str, Any], folder: Path | None) -> str:
    """Return the table of results that people read."""
    steps, how = summary["steps"], "relaxation step" if summary["relaxed"] else "load step"
    facts = {
        "model": run.model,
        "size": sizes(summary),
        "found by": f"{plural(steps, how)}, {plural(summary['newton_iterations'], 'iteration')}",
        "slowest motion": _slowest(summary["smallest_eigenvalue"]),
        "critical": _critical(summary),
        "path": _path(summary),
    }
    return "\n".join([*fact_lines(facts, folder), *last_values(run, {**summary, "error_estimate": 0.0})])


def _slowest(eigenvalue: float | None) -> str:
    """Return a stiffness over a mass [1/s^2] as a frequency or a time of growth."""
    if eigenvalue is None:
        return ""
    if eigenvalue < 0.0:
        return f"grows e-fold in {1.0 / math.sqrt(-eigenvalue):.4g} s"
    return f"{math.sqrt(eigenvalue) / (2.0 * math.pi):.4g} Hz, without damping"


def _critical(summary: Mapping[str, Any]) -> str:
    """Return the critical load factors in words."""
    if "critical" not in summary:
        return ""
    pairs = zip(summary["critical"], summary["critical_reached"], strict=True)
    told = [f"{one:.9g}" if reached else f"about {one:.4g} (not reached)" for one, reached in pairs]
    return f"load factors {', '.join(told)}" if told else f"none: {summary['critical_reason']}"


def _path(summary: Mapping[str, Any]) -> str:
    """Return what the path crosses in words."""
    if "points" not in summary:
        return ""
    told = [plural(summary["points"], "point")]
    for kind, words in (("limits", "limit point"), ("branches", "branch")):
        told += [f"{words} at a load factor of {one:.9g}" for one in summary[kind]]
    return ", ".join(told)
