"""Memory of this process and what is left for it, where the system tells."""

from __future__ import annotations

import math
from pathlib import Path

_MEMINFO, _STATM = Path("/proc/meminfo"), Path("/proc/self/statm")
_LIMIT, _USED = (Path(f"/sys/fs/cgroup/memory.{name}") for name in ("max", "current"))


def resident() -> int:
    """Return the memory that this process holds [byte]; 0 where that is not known."""
    return _pages()[1]


def available() -> float:
    """Return the memory that this process may still take [byte]; infinity where that is not known."""
    return max(0.0, min(_of_machine(), _of_group(), _of_process()))


def in_bytes(number: float) -> str:
    """Return a number of bytes as people read it.

    Examples
    --------
    >>> in_bytes(4.3e9), in_bytes(2e6)
    ('4.3 GB', '2 MB')
    """
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{number / 1e3:.3g} kB"


def _of_machine() -> float:
    for line in _read(_MEMINFO).splitlines():
        if line.startswith("MemAvailable:"):
            return 1024.0 * float(line.split()[1])
    return math.inf


def _of_group() -> float:
    limit, used = _read(_LIMIT).strip(), _read(_USED).strip()
    return float(limit) - float(used) if limit.isdigit() and used.isdigit() else math.inf


def _of_process() -> float:
    try:
        import resource
    except ImportError:  # not a Unix
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return math.inf if limit == resource.RLIM_INFINITY else float(limit - _pages()[0])


def _pages() -> tuple[int, int]:
    """Return the address space and the resident memory of this process [byte]."""
    sizes = _read(_STATM).split()
    if len(sizes) < 2:
        return 0, 0
    import resource

    page = resource.getpagesize()
    return page * int(sizes[0]), page * int(sizes[1])


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii")
    except OSError:
        return ""
