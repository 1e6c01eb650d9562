"""Results to pictures; the only package that imports matplotlib. Each kind is imported where it is drawn.

Pictures of runs are drawn by `sheet` straight on the library's renderers; its figures and axes, which take
longer to import and several times as long to draw, serve studies (`figures`) and formats of vectors.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module


@contextmanager
def _whatever_shows() -> Iterator[None]:
    """Let the library be imported whatever ``MPLBACKEND`` names to show its pictures.

    Nothing shows any here, and notebooks name what may not be installed for all that they start.  Who draws
    with the library in this process gets what was named.
    """
    named = None if "matplotlib" in sys.modules else os.environ.pop("MPLBACKEND", None)
    try:
        yield
    finally:
        if named is not None:
            os.environ["MPLBACKEND"] = named
    if named:
        with suppress(ValueError):
            import_module("matplotlib").rcParams["backend"] = named


with _whatever_shows():
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
