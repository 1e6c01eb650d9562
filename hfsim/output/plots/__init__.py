"""Results to pictures; the only package that imports matplotlib. Each kind is imported where it is drawn.

Pictures of runs are drawn by `sheet` straight on the library's renderers; its figures and axes, which take
longer to import and several times as long to draw, serve studies (`figures`) and formats of vectors.
"""

from __future__ import annotations

from importlib import import_module

from matplotlib import artist


def import_library(name: str) -> None:
    """Import a part of the library without tables of properties in its help texts, which take long."""
    tables = artist.kwdoc
    artist.kwdoc = lambda artist: ""
    try:
        import_module(name)
    finally:
        artist.kwdoc = tables


import_library("matplotlib.backends.backend_agg")
