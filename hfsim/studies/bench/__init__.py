"""Error against run time: one scene with many methods, tolerances, models and meshes.

The truth is computed, not assumed.  For each model and mesh (a `Cell`) the same equations are solved by
two methods, ever tighter, until they agree; what is left between them is the error floor, below which no
error is a number.  With several meshes a second truth, on a mesh twice as fine as the finest, splits the
error of each point into that of time and that of the mesh.

Nothing is printed or written here.
"""

from hfsim.studies.agreement import tidy
from hfsim.studies.bench.advice import advice, model_advice, pareto, recommend, recommendations
from hfsim.studies.bench.points import Cell, Point, channel_error, mesh_words, observed_order
from hfsim.studies.bench.result import Bench, as_facts
from hfsim.studies.bench.study import bench
from hfsim.studies.bench.sweep import Sweep

__all__ = [
    "Bench", "Cell", "Point", "Sweep", "advice", "as_facts", "bench", "channel_error", "mesh_words",
    "model_advice", "observed_order", "pareto", "recommend", "recommendations",
    "tidy",
]  # fmt: skip
