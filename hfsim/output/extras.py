"""What shows a run beside its numbers: pictures, animation, files for ParaView. None of it costs results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hfsim.errors import interruption_code
from hfsim.marching.solution import Run
from hfsim.marching.stop import Budget
from hfsim.output.disk import WriteError, is_full
from hfsim.output.runfolder import Stopwatch, folder_name
from hfsim.output.text import plural
from hfsim.output.writers import warnings_of
from hfsim.simulate import AFTER_ITS_END
from hfsim.trust.after import AFTER

if TYPE_CHECKING:
    from hfsim.scene.schema import OutputSpec


_FULL = "the disk was full after its end: what was to be done after it is missing"


class Extras(NamedTuple):
    """What is wanted beside the numbers of a run.

    Attributes
    ----------
    pictures, animation, vtk : bool
        Plots, a GIF of the motion, files for ParaView.
    after : float or None
        Time for all work after the run [s]: plots get what is left of it.
    format : str
        Of plots.
    shapes : bool or str
        As in the deck: whether points of bodies are written, ``"csv"`` as text too.
    """

    pictures: bool = False
    animation: bool = False
    vtk: bool = False
    after: float | None = None
    format: str = "png"
    shapes: bool | str = False

    def of(self, output: OutputSpec) -> Extras:
        """Return what is wanted of a run whose deck has a say in it too."""
        return self._replace(pictures=self.pictures and output.plots, shapes=output.shapes)

    @property
    def any(self) -> bool:
        """Whether outlines of the bodies are needed."""
        return self.pictures or self.animation or self.vtk or bool(self.shapes)


def add_extras(run: Run, wanted: Extras, folder: Path, watch: Stopwatch) -> tuple[Run, list[str]]:
    """Make what is wanted; return the run with warnings of what was lost, and the names of the files.

    A signal and a full disk end it: the exit code tells.
    """
    if not wanted.any:
        return run, []
    from hfsim.output.pictures import lost

    files: list[str] = []
    for words, make in _steps(run, wanted, folder):
        try:
            with watch.phase("plots"):
                names, warning = make()
        except KeyboardInterrupt as stop:
            run = replace(run, exit_code=interruption_code(stop), reason=run.reason or AFTER_ITS_END)
            return warned(run, lost(stop, words)), files
        except Exception as error:  # whatever it is, it must not cost the results
            if is_full(error):
                run = replace(run, exit_code=WriteError.exit_code, reason=run.reason or _FULL)
                return warned(run, lost(error, words)), files
            names, warning = [], lost(error, words)
        files += names
        run = warned(run, warning) if warning else run
    return run, files


Made = tuple[list[str], str]
"""Names of files, and what is to be warned of."""


def _steps(run: Run, wanted: Extras, folder: Path) -> Iterator[tuple[str, Callable[[], Made]]]:
    """Yield what to say where it fails, and what makes it."""
    if wanted.shapes:
        yield "the shapes of the bodies were not written", partial(_shapes, run, wanted.shapes, folder)
    if wanted.pictures:
        yield "the pictures were not drawn", partial(_pictures, run, wanted, folder)
    if wanted.animation:
        yield "the animation was not made", partial(_animation, run, folder)
    if wanted.vtk:
        yield "the files for ParaView were not written", partial(_series, run, folder)


def _pictures(run: Run, wanted: Extras, folder: Path) -> Made:
    from hfsim.output.pictures import put_pictures

    budget, cpu = None, run.statistics.get("cpu_s") or {}
    if wanted.after is not None:
        spent = sum(cpu.get(name, 0.0) for name in AFTER)  # of the time for all work after the run
        budget = Budget(wanted.after - spent, time.process_time)
    names = put_pictures(partial(_draw, run, budget), folder, wanted.format)
    if budget is not None and budget.left <= 0.0:
        return names, f"{plural(len(names), 'picture')} drawn until time was up; allow more with --after"
    return names, ""


def _draw(run: Run, budget: Budget | None, folder: Path) -> Iterable[str]:
    if budget is not None and budget.left <= 0.0:
        return []
    from hfsim.output.plots.run import draw_run  # half a second of matplotlib, for those who want pictures

    return draw_run(run, folder, budget)


def _animation(run: Run, folder: Path) -> Made:
    from hfsim.output.pictures import put_pictures
    from hfsim.output.plots.motion import animate

    return _told(put_pictures(partial(animate, run), folder), "an animation")


def _series(run: Run, folder: Path) -> Made:
    from hfsim.output.paraview import write_series
    from hfsim.output.pictures import put_files

    def place(name: str) -> str:
        return name if name.endswith(".pvd") else f"vtk/{name}"

    stem = folder_name(run.name, "")
    return _told(put_files(partial(write_series, run, stem), folder, place), "files for ParaView")


def _shapes(run: Run, kind: bool | str, folder: Path) -> Made:
    from hfsim.output.pictures import put_files
    from hfsim.output.shapes import write_shapes

    return _told(put_files(partial(write_shapes, run, kind == "csv"), folder, str), "shapes.npz")


def _told(names: list[str], what: str) -> Made:
    return names, "" if names else f"no motion is known for {what}"


def warned(run: Run, warning: str) -> Run:
    """Return a run with one more warning."""
    return replace(run, statistics={**run.statistics, "warnings": [*warnings_of(run), warning]})
