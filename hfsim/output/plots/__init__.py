"""Results to pictures (PNG); the only package that imports matplotlib."""

from __future__ import annotations

from hfsim.output.plots.bench import draw_bench
from hfsim.output.plots.comparison import draw_comparison, overlay_limits
from hfsim.output.plots.motion import animate
from hfsim.output.plots.run import draw_run
from hfsim.output.plots.separation import draw_separation
from hfsim.output.plots.stability import draw_stability

__all__ = [
    "animate",
    "draw_bench",
    "draw_comparison",
    "draw_run",
    "draw_separation",
    "draw_stability",
    "overlay_limits",
]
