"""Sub-commands, one file each, and what they share: exit codes, `options`, `decks`.

Nothing but click and the standard library is imported at the top of any of these files.
"""

from __future__ import annotations

import gc
import os
import re
import time
import typing
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType

import click

from hfsim.errors import INTERRUPTIONS, DeckError, HfsimError
from hfsim.marching.stop import SHIELD
from hfsim.output.talk import print_error

STARTED = time.perf_counter()
"""When the program started, near enough [s]."""

_SEVERITY = (0, 4, 5, 3, 2, 1, 130, 143)
"""Exit codes from harmless to grave."""


class _Later:
    """A regular expression that is compiled when it is first used: few of a library's are."""

    def __init__(self, *pattern: typing.Any, compile: typing.Any = re.compile) -> None:
        self._compiled = cache(lambda: compile(*pattern))

    def __getattr__(self, name: str) -> typing.Any:
        return getattr(self._compiled(), name)


class _Keys(dict[str, typing.Any]):
    """Stands for `TypedDict`, whose keys people and type checkers alone need to know."""

    def __init_subclass__(cls, total: bool = True) -> None:
        pass


@contextmanager
def _stands_in(module: ModuleType, name: str, other: object) -> Iterator[None]:
    """Let something else go by a name for a while."""
    kept = getattr(module, name)
    setattr(module, name, other)
    try:
        yield
    finally:
        setattr(module, name, kept)


@cache
def import_libraries() -> None:
    """Import the large libraries from near the bottom of the stack, and all that simulates.

    From deep in a chain of imports their classes take longer: whenever a call crosses the end of a chunk of
    its stack, CPython 3.11 maps another and lets it go again.  What is imported is there to stay: that Python
    never looks for cycles in it, neither on the way nor later, saves a twentieth of a short run.  Another
    twentieth goes into regular expressions and typed dictionaries of libraries, which hardly any run uses.
    """
    gc.disable()
    import numpy  # noqa: F401
    import typing_extensions

    with (
        _stands_in(re, "compile", _Later),
        _stands_in(typing, "TypedDict", _Keys),
        _stands_in(typing_extensions, "TypedDict", _Keys),
    ):
        import pydantic_core  # noqa: F401
        import yaml  # noqa: F401
    from pydantic import BaseModel  # noqa: F401

    import hfsim.output.api  # noqa: F401

    gc.freeze()
    gc.enable()


def worst(codes: Iterable[int]) -> int:
    """Return the gravest of several exit codes: 0 < 4 < 5 < 3 < 2 < 1 < 130 < 143; others count as 1.

    Examples
    --------
    >>> worst([0, 3, 5, 4])
    3
    """
    known = (code if code in _SEVERITY else 1 for code in codes)
    return max(known, key=_SEVERITY.index, default=0)


def interrupted() -> int:
    """Tell that a study ended early with what it has; return the exit code."""
    print_error("interrupted; what was computed until then is kept")
    return INTERRUPTIONS[0]


def report_error(error: Exception) -> int:
    """Tell what went wrong and return the exit code; a traceback only under ``-v`` or HFSIM_DEBUG.

    Raises
    ------
    KeyboardInterrupt
        If a signal has come: libraries that it interrupts may say anything.
    """
    if SHIELD.taken is not None and not isinstance(error, HfsimError):
        raise SHIELD.taken from error
    if isinstance(error, DeckError):
        print_error(str(error))
    elif isinstance(error, HfsimError):
        print_error(f"error: {error}")
    elif isinstance(error, MemoryError):
        print_error("error: memory did not suffice; fewer elements or a longer output.interval help")
        return 1
    else:
        print_error(f"internal error: {type(error).__name__}: {error}")
    _show_traceback(error)
    return error.exit_code if isinstance(error, HfsimError) else 1


def _show_traceback(error: Exception) -> None:
    context = click.get_current_context(silent=True)
    verbose = context is not None and context.find_root().meta.get("verbose", False)
    if verbose or os.environ.get("HFSIM_DEBUG"):
        import traceback

        print_error("".join(traceback.format_exception(error)))
    elif not isinstance(error, HfsimError):
        print_error("This is a mistake in hfsim, not in your deck; HFSIM_DEBUG=1 shows where it happened.")
