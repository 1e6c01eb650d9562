"""Longest stable steps as files and as people read them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING

from hfsim.output.text import Column, table, wrapped

if TYPE_CHECKING:
    from hfsim.output.study import Study
    from hfsim.studies.limits import Limit, Limits

LIMIT_COLUMNS = (
    *("model", "method", "order", "stages", "longest", "beyond", "predicted", "deviation", "reason", "words"),
)
"""Columns of ``limits.csv``; steps in fastest periods."""

_REASON = 60
"""Characters of a reason in the table."""
_TEXT = (
    Column("method", lambda one: one.title + (f" ({one.stages} stages)" if one.stages else "")),
    Column("longest stable step", lambda one: _longest(one)),
    Column("theory", "predicted", lambda step: "any" if step is None else f"{step:.4g} T"),
    Column("off by", "deviation", lambda off: "-" if off is None else f"{100 * off:+.3g} %"),
    Column("what ends it", lambda one: shorten(one.reason, _REASON, placeholder="...") or None),
)


def publish_limits(results: Sequence[Limits], study: Study) -> str:
    """Write and tell what was found with each model; return ``done`` or ``interrupted``."""
    status = "interrupted" if results[-1].interrupted else "done"
    rows = [{"model": result.model, **one.facts()} for result in results for one in result.limits]
    study.publish(
        {"status": status, "results": [result.facts() for result in results]},
        {"limits": (LIMIT_COLUMNS, rows)},
        limits_text(results, study.path),
    )
    return status


def limits_text(results: Sequence[Limits], folder: Path) -> str:
    """Return what was found with each model, and where it was written."""
    return "\n".join([*map(_one_model, results), f"\n  results: {folder}/"])


def _one_model(result: Limits) -> str:
    """Return frequencies, growing motions and the table of longest stable steps."""
    first = result.spectra[0]
    said = [f"{one.method}: {one.words}" for one in result.limits]
    lost = [f"{name}: not measured: {why}" for name, why in result.lost.items()]
    blocks = [
        wrapped(
            f"{result.name}, {result.model}: fastest period {first.period:.4g} s, slowest frequency "
            f"{first.slowest:.4g} rad/s at the start",
            "",
            "  ",
        ),
        _growing(result),
        "T: fastest period\n" + table(_TEXT, result.limits, text_last=True),
        *map(wrapped, said + lost),
    ]
    return "\n".join(blocks)


def _longest(one: Limit) -> str:
    if one.longest is None:
        return f"below {one.beyond:.3g} T" if one.beyond else "no step tried to its end"
    if one.beyond is None:
        return f"above {one.longest:.3g} T"
    if one.beyond > 1.02 * one.longest:
        return f"{one.longest:.3g} to {one.beyond:.3g} T"
    return f"{one.longest:.4g} T"


def _growing(result: Limits) -> str:
    """Return whether the linearised scene has growing motions, and where along the motion."""
    growing = [s for s in result.spectra if s.growth > 0.0]
    count = len(result.spectra)
    if not growing:
        return f"  no growing motion in {count} states along the run"
    worst = max(growing, key=lambda s: s.growth)
    return wrapped(
        f"linearised, motions grow in {len(growing)} of {count} states along the run, fastest by "
        f"{worst.growth:.3g}/s at {worst.time:.3g} s (an instability where the state lasts; "
        "elsewhere a state passed through)"
    )
