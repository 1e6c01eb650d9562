"""The motion of one run as a GIF that browsers play."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array, BoolArray
from hfsim.output.plots.space import SHADOW, Floor, oblique, oblique_axes
from hfsim.output.plots.style import COLOURS, as_they_are, colour, dress, headline
from hfsim.output.plots.tracks import equal_axes, tracks_of

_FRAMES, _PIXELS, _RATE = 150, 720, 20
"""Frames at most, longest side of them at most, and frames a second."""
_NEARLY_WHITE = 244
_SHORTEST, _LONGEST = 2.5, _FRAMES / _RATE
"""How long it may play [s]; in real time, where that is between them."""


def animate(run: Run, folder: Path) -> list[str]:
    """Draw the bodies as they move, in space as seen from above in front, with the paths of points.

    Parameters
    ----------
    run : Run
        With outlines.
    folder : Path
        Where ``motion.gif`` goes.

    Returns
    -------
    list of str
        Its name; nothing where the run has no outlines.
    """
    outlines = {body: points for body, points in run.outlines.items() if points.size}
    if run.outline_t is None or not len(run.outline_t) or not outlines:
        return []
    tempo = Tempo.of(float(run.outline_t[-1] - run.outline_t[0]))
    count = min(len(run.outline_t), max(2, round(tempo.lasts * _RATE)))
    wanted = np.linspace(run.outline_t[0], run.outline_t[-1], count)
    frames = np.unique(np.abs(run.outline_t[:, None] - wanted).argmin(axis=0))
    images = list(_images(run, outlines, frames.tolist(), tempo))
    palette = _palette(images[-1])
    few = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    pause = max(20, round(1e3 * tempo.lasts / len(few)))
    few[0].save(folder / "motion.gif", save_all=True, append_images=few[1:], duration=pause, loop=0)
    return ["motion.gif"]


def _palette(image: Image.Image) -> Image.Image:
    """Return an image with the colours that frames are drawn in, a clear white among them."""
    few = image.quantize(64)
    colours = np.array(few.getpalette(), dtype=np.uint8).reshape(-1, 3)
    colours[colours.min(axis=1) > _NEARLY_WHITE] = 255  # the nearest colour is found roughly only
    few.putpalette(colours.tobytes())
    return few


class Stage(NamedTuple):
    """A figure and what moves in it.

    Attributes
    ----------
    figure : Figure
    axes : Axes
    curves : list of (Line2D, ndarray)
        Lines, and the points (n_outlines, n_points, 2) they are drawn through [m].
    trails : list of (Line2D, ndarray)
        Lines, and the points (n_times, 2) they have been through by the end [m].
    digits : int
        Of times.
    """

    figure: Figure
    axes: Axes
    curves: list[tuple[Line2D, Array]]
    trails: list[tuple[Line2D, Array]]
    digits: int

    @classmethod
    def of(cls, run: Run, outlines: Mapping[str, Array]) -> Stage:
        """Return that of a run, with nothing on it yet."""
        every = np.vstack([points.reshape(-1, run.dimension) for points in outlines.values()])
        floor: Floor | None = None
        if run.dimension == 3:
            sheet, axes, floor = oblique_axes(every)
        else:
            sheet, axes = equal_axes(every)
            dress(axes, "x [m]", "y [m]")
        stage = cls(sheet.figure, axes, [], [], max(0, 3 - math.floor(math.log10(run.end_time or 1.0))))
        if floor is not None:
            for points in outlines.values():
                stage.curves.append((_line(axes, SHADOW, 1.2), oblique(floor.below(points))))
        flat = oblique if floor is not None else np.asarray
        for track in tracks_of(run).values():
            stage.trails.append((_line(axes, "0.75", 0.8), flat(track)))
        for i, (body, points) in enumerate(outlines.items()):
            stage.curves.append((_line(axes, colour(i), 2.2, body), flat(points)))
        sheet.finish(headline(run, "motion"), [axes] if len(outlines) <= len(COLOURS) else [])
        return stage

    @property
    def artists(self) -> list[Line2D]:
        """All that moves, in the order it is drawn in."""
        return [line for line, _ in (*self.trails, *self.curves)]

    def move(self, past: BoolArray, frame: int) -> None:
        """Show a frame and, of the trails, those rows that are past."""
        for line, points in self.curves:
            line.set_data(*points[frame].T)
        for line, points in self.trails:
            line.set_data(*points[past].T)


def _line(axes: Axes, own: str, width: float, label: str = "_nolegend_") -> Line2D:
    marks: dict[str, Any] = {"marker": "o", "markersize": 1.2 * width, "markevery": [0, -1]}
    line = Line2D(
        [], [], color=own, linewidth=width, label=label, animated=True, solid_capstyle="round", **marks
    )
    axes.add_line(line)
    return line


class Tempo(NamedTuple):
    """How fast a motion is shown.

    Attributes
    ----------
    lasts : float
        How long it plays [s].
    words : str
        How fast that is, if not in real time.
    """

    lasts: float
    words: str = ""

    @classmethod
    def of(cls, duration: float) -> Tempo:
        """Return that of a motion that lasts some time [s].

        Examples
        --------
        >>> Tempo.of(5.0), Tempo.of(0.1)
        (Tempo(lasts=5.0, words=''), Tempo(lasts=5.0, words='slowed 50 times'))
        >>> Tempo.of(3600.0).words
        '500 times as fast'
        """
        if duration <= 0.0 or _SHORTEST <= duration <= _LONGEST:
            return cls(duration)
        least = duration / _LONGEST
        decade = 10.0 ** math.floor(math.log10(least))
        factor = next(k * decade for k in (1, 2, 5, 10) if k * decade >= least)
        words = f"{factor:g} times as fast" if factor > 1.0 else f"slowed {1.0 / factor:g} times"
        return cls(duration / factor, words)


def _images(
    run: Run, outlines: Mapping[str, Array], frames: list[int], tempo: Tempo
) -> Iterator[Image.Image]:
    """Yield the frames; what does not move is drawn once."""
    run = run.drawn
    assert run.outline_t is not None
    stage = Stage.of(run, outlines)
    clock = stage.axes.text(
        1.0, 1.0, "", transform=stage.axes.transAxes, ha="right", va="bottom", animated=True
    )
    size = stage.figure.get_size_inches()
    stage.figure.set_dpi(min(stage.figure.dpi, _PIXELS / max(size)))
    canvas: Any = FigureCanvasAgg(stage.figure)
    with as_they_are(stage.figure):
        canvas.draw()
    still = canvas.copy_from_bbox(stage.figure.bbox)
    words = f" ({tempo.words})" if tempo.words else ""
    for frame in frames:
        now = float(run.outline_t[frame])
        stage.move(run.t <= now, frame)
        clock.set_text(f"t = {now:.{stage.digits}f} s{words}")
        canvas.restore_region(still)
        for artist in (*stage.artists, clock):
            stage.axes.draw_artist(artist)
        pixels = np.asarray(canvas.buffer_rgba())[..., :3]
        yield Image.fromarray(np.ascontiguousarray(pixels))
