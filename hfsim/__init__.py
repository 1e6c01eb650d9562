"""hfsim: flexible multibody dynamics with five models of one scene.

>>> import hfsim
>>> run = hfsim.run("pendulum", {"solve.duration": 0.1, "output.interval": 0.05})
>>> run.t.tolist(), run.status
([0.0, 0.05, 0.1], 'done')

What it has is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hfsim.errors import DeckError, HfsimError, Interrupted, UnfinishedRunError
    from hfsim.marching.solution import Run
    from hfsim.output.api import Deck, check, compare, load, run, verify
    from hfsim.output.bench_api import bench, separation
    from hfsim.output.modes_api import campbell, modes
    from hfsim.output.stability_api import limits, stability
    from hfsim.output.static_api import static
    from hfsim.output.sweep_api import sensitivity, sweep
    from hfsim.studies.bench.result import Bench
    from hfsim.studies.compare.result import Comparison
    from hfsim.studies.limits import Limits
    from hfsim.studies.stability.results import StabilityMap
    from hfsim.studies.sweep.result import Sweep
    from hfsim.studies.verify.result import Verification

__version__ = "0.1.0"

_PLACES = {
    **dict.fromkeys(("Deck", "check", "compare", "load", "run", "verify"), "hfsim.output.api"),
    **dict.fromkeys(("DeckError", "HfsimError", "Interrupted", "UnfinishedRunError"), "hfsim.errors"),
    **dict.fromkeys(("campbell", "modes"), "hfsim.output.modes_api"),
    "Run": "hfsim.marching.solution",
    "Bench": "hfsim.studies.bench.result",
    "Comparison": "hfsim.studies.compare.result",
    "Limits": "hfsim.studies.limits",
    "StabilityMap": "hfsim.studies.stability.results",
    "Sweep": "hfsim.studies.sweep.result",
    "Verification": "hfsim.studies.verify.result",
    **dict.fromkeys(("bench", "separation"), "hfsim.output.bench_api"),
    **dict.fromkeys(("limits", "stability"), "hfsim.output.stability_api"),
    "static": "hfsim.output.static_api",
    **dict.fromkeys(("sensitivity", "sweep"), "hfsim.output.sweep_api"),
}
"""Where each public name stands."""

__all__ = [
    "Bench", "Comparison", "Deck", "DeckError", "HfsimError", "Interrupted", "Limits", "Run", "StabilityMap",
    "Sweep", "UnfinishedRunError", "Verification",
    "bench", "campbell", "check", "compare", "limits", "load", "modes", "run", "sensitivity", "separation",
    "stability", "static", "sweep", "verify",
]  # fmt: skip


def __dir__() -> list[str]:
    """Return what there is, also what is not yet imported."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Import a public name."""
    if name not in _PLACES:
        raise AttributeError(f"module 'hfsim' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_PLACES[name]), name)
