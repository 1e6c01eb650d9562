"""The native kernel: whether it is there, and wanted.

It is built from the C files beside this one where a compiler is at hand when hfsim is installed; without
it all is done in NumPy, with the same results.  ``HFSIM_KERNEL=numpy`` does without it; ``native`` insists.
"""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from types import ModuleType

from hfsim.errors import KernelError

VARIABLE = "HFSIM_KERNEL"
"""Of the environment: what is wanted."""
SOURCES = Path(__file__).parent
"""Where its sources stand in an editable install."""


def _found() -> tuple[ModuleType | None, str]:
    """Return what repeats operations, or why there is none."""
    try:
        found = import_module("hfsim.maths._replay")
    except ModuleNotFoundError:
        return None, "it was not built, for want of a C compiler when hfsim was installed"
    except ImportError as why:
        return None, f"it cannot be loaded: {why}"
    sources = sorted(SOURCES.glob("_re*.[ch]")) if found.SOURCE else []
    if sources:  # they may have changed since
        from zlib import crc32

        if crc32(b"".join(one.read_bytes() for one in sources)) & 0x7FFFFFFF != found.SOURCE:
            return None, "it was built from other sources: install hfsim again"
    return found, ""


def chosen() -> tuple[ModuleType | None, str]:
    """Return what repeats operations, and why there is none although it is wanted.

    Raises
    ------
    KernelError
        If what is wanted is not there, or nothing that could be.
    """
    wanted = os.environ.get(VARIABLE, "")
    if wanted not in ("", "native", "numpy"):
        raise KernelError(f"{VARIABLE}={wanted}: no such kernel; it is native or numpy")
    if wanted == "numpy":
        return None, ""
    found, why = _found()
    if wanted and why:
        raise KernelError(f"{VARIABLE}=native: there is no native kernel: {why}")
    return found, why


replay, MISSING = chosen()
"""What repeats operations, None where it is not there or not wanted; and why it is not there."""
KERNEL = "numpy" if replay is None else "native"
"""What evaluates the equations."""
