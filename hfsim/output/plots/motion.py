"""The motion of one run as a GIF that browsers play."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from hfsim.marching.solution import Run
from hfsim.maths.arrays import Array, BoolArray
from hfsim.output.plots.files import renderer_of
from hfsim.output.plots.ink import DPI, Ink, Mark, Pen
from hfsim.output.plots.panel import Curve, Note, Panel, key
from hfsim.output.plots.sheet import Sheet
from hfsim.output.plots.space import SHADOW, Floor, oblique, oblique_axes
from hfsim.output.plots.style import COLOURS, colour, headline
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
    if run.outlined is None:
        return []
    times, outlines = run.outlined
    tempo = Tempo.of(float(times[-1] - times[0]))
    count = min(len(times), max(2, round(tempo.lasts * _RATE)))
    wanted = np.linspace(times[0], times[-1], count)
    frames = np.unique(np.abs(times[:, None] - wanted).argmin(axis=0))
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
    """A picture and what moves in it.

    Attributes
    ----------
    curves : list of (Pen, ndarray)
        Lines, and the points (n_outlines, n_points, 2) they are drawn through [m].
    trails : list of ndarray
        Points (n_times, 2) that lines have been through by the end [m].
    digits : int
        Of times.
    """

    sheet: Sheet
    panel: Panel
    curves: list[tuple[Pen, Array]]
    trails: list[Array]
    digits: int

    @classmethod
    def of(cls, run: Run, outlines: Mapping[str, Array]) -> Stage:
        """Return that of a run, with nothing on it yet."""
        every = np.vstack([points.reshape(-1, run.dimension) for points in outlines.values()])
        floor: Floor | None = None
        if run.dimension == 3:
            sheet, panel, floor = oblique_axes(every)
        else:
            sheet, panel = equal_axes(every)
            panel.dress("x [m]", "y [m]")
        curves: list[tuple[Pen, Array]] = []
        if floor is not None:
            curves += [(Pen(SHADOW, 1.2), oblique(floor.below(points))) for points in outlines.values()]
        flat = oblique if floor is not None else np.asarray
        for i, (body, points) in enumerate(outlines.items()):
            pen = Pen(colour(i), 2.2)
            curves.append((pen, flat(points)))
            panel.things.append(key(body, pen, _dot(pen)))
        sheet.finish(headline(run, "motion"), [panel] if len(outlines) <= len(COLOURS) else [])
        digits = max(0, 3 - math.floor(math.log10(run.end_time or 1.0)))
        return cls(sheet, panel, curves, [flat(track) for track in tracks_of(run).values()], digits)

    def draw(self, ink: Ink, past: BoolArray, frame: int, words: str) -> None:
        """Draw a frame with a word on it and, of the trails, those rows that are past."""
        things: list[Curve | Note] = [Curve(track[past], Pen("0.75", 0.8)) for track in self.trails]
        things += [Curve(points[frame], pen, "", _dot(pen), ends=True) for pen, points in self.curves]
        above = Note(words, 1.0, 1.0, colour="black", across="right", up="bottom", inside=True)
        for thing in (*things, above):
            thing.draw(ink, self.panel)


def _dot(pen: Pen) -> Mark:
    return Mark("o", 1.2 * pen.width, pen.colour, pen.colour)


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
    dpi = min(DPI, _PIXELS / max(stage.sheet.size))
    renderer = renderer_of(stage.sheet, dpi)
    still = renderer.copy_from_bbox(renderer.bbox)
    ink = Ink(renderer)
    told = f" ({tempo.words})" if tempo.words else ""
    for frame in frames:
        now = float(run.outline_t[frame])
        renderer.restore_region(still)
        stage.draw(ink, run.t <= now, frame, f"t = {now:.{stage.digits}f} s{told}")
        pixels = np.asarray(renderer.buffer_rgba())[..., :3]
        yield Image.fromarray(np.ascontiguousarray(pixels))
