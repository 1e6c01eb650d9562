"""What tests of the native kernel share: recordings made at once, and runs of both kernels."""

import pytest

from hfsim.integrators import _often
from hfsim.maths import kernel

native = pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")


def at_once(monkeypatch):
    """Let all be recorded when it comes for the second time."""
    for name in ("EARLY", "SEEN", "MANY"):
        monkeypatch.setattr(_often, name, 0)


def both(monkeypatch, call):
    """Return what a call returns with the kernel, and what in NumPy."""
    at_once(monkeypatch)
    found = []
    for way in ("native", "numpy"):
        monkeypatch.setattr(kernel, "KERNEL", way)
        found.append(call())
    return found
