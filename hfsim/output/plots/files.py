"""Pictures to files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg

from hfsim.marching.stop import Budget
from hfsim.output.pictures import picture_format
from hfsim.output.plots.ink import DPI
from hfsim.output.plots.letters import unwarned
from hfsim.output.plots.png import write_png
from hfsim.output.plots.sheet import Sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RENDERER: Any = RendererAgg


def save(
    pictures: Mapping[str, Sheet | Figure | None], folder: Path, budget: Budget | None = None
) -> list[str]:
    """Write pictures into a folder, made if need be, while a budget lasts; return the names of the files.

    They are of the format that `hfsim.output.pictures.picture_format` tells.
    Names of decks, bodies and channels are drawn as they are, signs that the font lacks as boxes.
    """
    kind = picture_format()
    drawn = {f"{name}.{kind}": picture for name, picture in pictures.items() if picture is not None}
    if drawn:
        folder.mkdir(parents=True, exist_ok=True)
    for name, picture in list(drawn.items()):
        if budget is not None and budget.left <= 0.0:
            del drawn[name]
        else:
            _write(picture, folder / name, kind)
    return list(drawn)


def _write(picture: Sheet | Figure, path: Path, kind: str) -> None:
    if isinstance(picture, Sheet) and kind == "png":
        write_png(path, np.asarray(renderer_of(picture).buffer_rgba()), DPI)
        return
    from hfsim.output.plots.figures import as_figure, write_figure

    write_figure(as_figure(picture) if isinstance(picture, Sheet) else picture, path, kind)


def renderer_of(sheet: Sheet, dpi: float = DPI) -> Any:
    """Return a renderer of pixels, so many to the inch, on which a picture is drawn."""
    width, height = (round(dpi * one) for one in sheet.size)
    renderer: Any = _RENDERER(width, height, dpi)
    with unwarned():
        sheet.draw(renderer)
    return renderer
