"""The native kernel: whether it is there, and wanted.

It is built from ``_replay.c`` where a compiler is at hand when hfsim is installed; without it all is done in
NumPy, with the same results.  ``HFSIM_KERNEL=numpy`` does without it.
"""

from __future__ import annotations

import os
from types import ModuleType

replay: ModuleType | None = None
"""What repeats operations; None where it is not there, or not wanted."""

if os.environ.get("HFSIM_KERNEL", "native") != "numpy":
    try:
        from hfsim.maths import _replay  # type: ignore[attr-defined]
    except ImportError:  # no compiler was there
        pass
    else:
        replay = _replay

KERNEL = "numpy" if replay is None else "native"
"""What evaluates the equations."""
