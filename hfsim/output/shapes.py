"""Points of all bodies over time as files: arrays for programs, a table for whoever wants one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hfsim.marching.solution import Run
from hfsim.output.writers import cell

NPZ, CSV = "shapes.npz", "shapes.csv"


def write_shapes(run: Run, table: bool, folder: Path) -> list[str]:
    """Write the outlines of a run.

    ``shapes.npz`` has the times ``t`` [s], shape (n_times,), and of each body ``points.BODY`` [m], shape
    (n_times, n_points, n_dim): absolute points of a beam from root to tip, or the polyline through the frame
    points of a rigid body. ``shapes.csv`` has a row for each: t, body, number of the point, coordinates.

    Parameters
    ----------
    run : Run
        With outlines.
    table : bool
        Whether ``shapes.csv`` is wanted too.
    folder : Path
        Where they go.

    Returns
    -------
    list of str
        Names of the files; none where the run has no outlines.
    """
    if run.outline_t is None or not len(run.outline_t):
        return []
    arrays: dict[str, Any] = {f"points.{body}": points for body, points in run.outlines.items()}
    np.savez(folder / NPZ, t=run.outline_t, **arrays)
    if not table:
        return [NPZ]
    with (folder / CSV).open("w", encoding="utf-8") as file:
        file.write(",".join(["t", "body", "point", *"xyz"[: run.dimension]]) + "\n")
        for k, t in enumerate(run.outline_t.tolist()):
            for body, points in run.outlines.items():
                rows = enumerate(points[k].tolist())
                file.writelines(f"{t!r},{cell(body)},{i},{','.join(map(repr, one))}\n" for i, one in rows)
    return [NPZ, CSV]
