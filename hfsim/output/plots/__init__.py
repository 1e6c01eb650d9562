"""Results to pictures; the only package that imports matplotlib. Each kind is imported where it is drawn."""

from __future__ import annotations

from importlib import import_module

from matplotlib import artist


def _import_library() -> None:
    """Import the library without tables of properties in its help texts: a quarter of the time it takes."""
    tables = artist.kwdoc
    artist.kwdoc = lambda artist: ""
    try:
        import_module("matplotlib.figure")
    finally:
        artist.kwdoc = tables


_import_library()
