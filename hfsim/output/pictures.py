"""Pictures, and other files that show a run, on their way into a folder.

What goes wrong costs no results, and nobody else's files.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from pathlib import Path

from hfsim.marching.stop import SHIELD

FORMATS = ("png", "svg", "pdf")
"""Of pictures, the usual one first."""
_format = ContextVar("format", default=FORMATS[0])
_ASIDE = ".plots.part"
_TOLD = 10
"""Names of files in a message at most."""


def put_pictures(
    draw: Callable[[Path], Iterable[str]], folder: Path, kind: str = FORMATS[0], told_in: str = ""
) -> list[str]:
    """Draw pictures of a format aside and put them into ``plots`` of a folder; as `put_files`."""
    import logging

    # where it cannot keep its cache is nothing to tell of a scene
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    before = _format.set(kind)
    try:
        return put_files(draw, folder, lambda name: f"plots/{name}", told_in)
    finally:
        _format.reset(before)


def drawn_by(where: str, *shown: object) -> Callable[[Path], Iterable[str]]:
    """Return what draws something by a function of `hfsim.output.plots`, imported when it draws.

    ``where`` names it and its module: ``bench:draw_bench``.
    """

    def draw(folder: Path) -> Iterable[str]:
        from pkgutil import resolve_name

        names: Iterable[str] = resolve_name(f"hfsim.output.plots.{where}")(*shown, folder)
        return names

    return draw


def picture_format() -> str:
    """Return the format of the pictures that are drawn now."""
    return _format.get()


def put_files(
    make: Callable[[Path], Iterable[str]], folder: Path, place: Callable[[str], str], told_in: str = ""
) -> list[str]:
    """Make files aside and put them into a folder; return their names, relative to it.

    Parameters
    ----------
    make : callable
        Writes into a folder and returns names of files.
    folder : Path
        Of a run or a study; the files of an older one are gone.
    place : callable
        Returns where in that folder a file goes.
    told_in : str
        The file that tells of the run or study; it names these before they are there. Empty: that of a run.

    Raises
    ------
    OSError
        If the system refuses, or there are other files of these names; none is put there then.
    """
    import shutil

    from hfsim.output.runfolder import SUMMARY, announce  # NumPy, where only help is wanted

    aside = folder / _ASIDE
    shutil.rmtree(aside, ignore_errors=True)
    aside.mkdir()
    try:
        places = {name: folder / place(name) for name in make(aside)}
        for parent in {there.parent for there in places.values()}:
            parent.mkdir(exist_ok=True)
        taken = [there for there in places.values() if os.path.lexists(there)]
        if taken:
            names = ", ".join(there.name for there in taken[:_TOLD])
            raise FileExistsError(f"{taken[0].parent} has files that are not of hfsim: {names}")
        announce(folder, map(place, places), told_in or SUMMARY)
        try:
            for name, there in places.items():
                os.replace(aside / name, there)
        except BaseException:
            for there in places.values():
                there.unlink(missing_ok=True)
            raise
    except Exception as error:
        if SHIELD.taken is not None:  # libraries that a signal interrupts may say anything
            raise SHIELD.taken from error
        raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)
    return [place(name) for name in places]


def lost(error: BaseException, what: str = "the pictures were not drawn") -> str:
    """Return a warning that files were not made, and why."""
    if isinstance(error, KeyboardInterrupt):
        return f"{what}: interrupted"
    return f"{what}: {str(error).strip() or type(error).__name__}"
