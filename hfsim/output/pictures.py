"""Pictures on their way into a folder: what goes wrong costs no results, and nobody else's files."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

_ASIDE = ".plots.part"


def put_pictures(draw: Callable[[Path], Iterable[str]], folder: Path) -> list[str]:
    """Draw pictures aside and put them into ``plots`` of a folder; return their names, relative to it.

    Parameters
    ----------
    draw : callable
        Draws into a folder and returns names of files.
    folder : Path
        Of a run or a study; the pictures of an older one are gone.

    Raises
    ------
    OSError
        If the system refuses, or ``plots`` has other files of these names; none is put there then.
    """
    # where it cannot keep its cache is nothing to tell of a scene
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    aside, there = folder / _ASIDE, folder / "plots"
    shutil.rmtree(aside, ignore_errors=True)
    aside.mkdir()
    try:
        names = list(draw(aside))
        if names:
            there.mkdir(exist_ok=True)
        taken = [name for name in names if os.path.lexists(there / name)]
        if taken:
            raise FileExistsError(f"{there} has files that are not of hfsim: {', '.join(taken)}")
        for name in names:
            os.replace(aside / name, there / name)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
    return [f"plots/{name}" for name in names]


def lost(error: BaseException) -> str:
    """Return a warning that pictures were not drawn, and why."""
    if isinstance(error, KeyboardInterrupt):
        return "the pictures were not drawn: interrupted"
    return f"the pictures were not drawn: {str(error).strip() or type(error).__name__}"
