"""Words as outlines of letters that are loaded once: the library lays each word out anew, glyph by glyph.

For signs of ASCII and the minus sign, side by side as the font has them; others need the library's layout.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg, get_hinting_flag
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.path import Path

from hfsim.maths.arrays import Array

_MINUS = "\N{MINUS SIGN}"


class Letter(NamedTuple):
    """A sign of a font.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Of its outline, from where it begins on its line [pixels].
    codes : ndarray, shape (n,)
        What leads to each, as in the library's paths.
    advance : float
        From there to where the next begins [pixels].
    """

    points: Array
    codes: Array
    advance: float


@contextmanager
def unwarned() -> Iterator[None]:
    """Let the library be silent about signs that the font lacks: they are drawn as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        yield


def plain(text: str) -> bool:
    """Return whether letters side by side are the text."""
    return text.replace(_MINUS, "-").isascii() and text.isprintable()


@lru_cache(maxsize=2048)
def width(text: str, size: float, dpi: float) -> float:
    """Return the width of a line in letters of a size [points], so many pixels to the inch [pixels]."""
    if plain(text):
        return sum(_letter(one, size, dpi).advance for one in text)
    with unwarned():
        return float(_measure(dpi).get_text_width_height_descent(text, font(size), False)[0])


@lru_cache(maxsize=2048)
def outline(text: str, size: float, dpi: float) -> tuple[Array, Array]:
    """Return points, shape (n, 2) [pixels], and codes of the outline of a plain text."""
    letters = [_letter(one, size, dpi) for one in text]
    if not letters:
        return np.zeros((0, 2)), np.zeros(0, Path.code_type)
    begins = np.cumsum([0.0, *(one.advance for one in letters[:-1])]).round()
    # on whole pixels, as each was fitted to them
    points = [one.points + np.array([x, 0.0]) for one, x in zip(letters, begins, strict=True)]
    return np.concatenate(points), np.concatenate([one.codes for one in letters])


@cache
def heights(size: float, dpi: float) -> tuple[float, float]:
    """Return how far letters of a size [points] go above and below their line [pixels]."""
    points, _ = outline("lp", size, dpi)
    return float(points[:, 1].max()), float(-points[:, 1].min())


@cache
def font(size: float) -> FontProperties:
    """Return the font that is written in, in a size [points]."""
    return FontProperties(size=size)


@cache
def _measure(dpi: float) -> Any:
    renderer: Any = RendererAgg
    return renderer(8, 8, dpi)


@cache
def _letter(sign: str, size: float, dpi: float) -> Letter:
    loaded: Any = get_font(_file())
    flags: Any = get_hinting_flag
    loaded.set_size(size, dpi)
    glyph = loaded.load_char(ord(sign), flags=flags())
    points, codes = loaded.get_path()
    return Letter(np.asarray(points, dtype=float), np.asarray(codes), glyph.linearHoriAdvance / 65536.0)


@cache
def _file() -> str:
    return str(findfont(FontProperties()))
