"""Run tests with the kernel built to notice what it must not do: ``python tests/sanitize.py [PATH ...]``.

The kernel is built with ``-fsanitize=address,undefined`` in a copy of the project, and pytest runs there with
the sanitizer's library loaded first. It notices memory that is read or written outside of its bounds or after
its end, addresses that do not fit, whole numbers that overflow; what Python keeps until it ends is no fault.
Without paths the tests of the kernel run and those of what it replays (13 minutes on two busy cores);
``--short`` runs the first alone. It needs GCC on Linux, and as much address space as it wants (``ulimit -v
unlimited``).
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FLAGS = ("-O1", "-g", "-fno-omit-frame-pointer", "-fsanitize=address,undefined", "-fno-sanitize-recover")
LIBRARIES = ("libasan.so", "libstdc++.so")
"""Loaded first; without the second one an exception of C++ in any other package ends the process."""
KERNEL = ("tests/maths", *sorted(str(one.relative_to(ROOT)) for one in ROOT.glob("tests/*/test_kernel*.py")))
LIMITED = "tests/scene/test_memory.py"
"""Holds limits of memory, of which the sanitizer takes more."""
REST = ("tests/marching", "tests/integrators", "tests/parts", "tests/scene", "tests/studies")


def built(folder: Path) -> None:
    """Copy what tests need into a folder and build the kernel in it.

    Raises
    ------
    SystemExit
        If the compiler does not succeed.
    """
    for name in ("hfsim", "tests", "cases"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    for name in ("pyproject.toml", "README.md", ".ci"):
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, folder / name)
    maths = folder / "hfsim" / "maths"
    sources = map(str, maths.glob("_re*.c"))
    include = f"-I{sysconfig.get_path('include')}"
    made = ("-o", str(maths / "_replay.abi3.so"))
    command = [compiler(), *FLAGS, "-shared", "-fPIC", include, *sources, *made, "-lm"]
    if subprocess.run(command, check=False).returncode:
        raise SystemExit("the kernel could not be built")


def compiler() -> str:
    """Return the C compiler."""
    return os.environ.get("CC", "gcc")


def library(name: str) -> str:
    """Return a library of the compiler that has to be loaded before all others.

    Raises
    ------
    SystemExit
        If the compiler has none.
    """
    asked = [compiler(), f"-print-file-name={name}"]
    found = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    if not Path(found).is_absolute():
        raise SystemExit(f"{compiler()} has no {name}")
    return found


def main() -> int:
    """Build, test, and return 0 if nothing was noticed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("paths", nargs="*", help="tests, from the project's folder")
    parser.add_argument("--short", action="store_true", help="the tests of the kernel alone")
    parser.add_argument("--jobs", default="2", help="processes, for pytest -n")
    options = parser.parse_args()
    paths = options.paths or [*KERNEL, *(() if options.short else REST)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        built(folder)
        (folder / "logs").mkdir()
        environment = {
            **os.environ,
            "HFSIM_KERNEL": "native",
            "LD_PRELOAD": " ".join(map(library, LIBRARIES)),
            "ASAN_OPTIONS": f"detect_leaks=0:log_path={folder}/logs/address",
            "UBSAN_OPTIONS": f"print_stacktrace=1:log_path={folder}/logs/undefined",
            "PYTHONMALLOC": "malloc",
            "PYTHONPATH": str(folder),
        }
        chosen = ("-m", "not slow and not timed", f"--ignore={LIMITED}", "-n", options.jobs)
        command = [sys.executable, "-m", "pytest", *chosen, *paths]
        done = subprocess.run(command, cwd=folder, env=environment, check=False)
        found = [one.read_text(errors="replace") for one in sorted((folder / "logs").iterdir())]
    for text in found:
        print(text[:4000])
    print(f"{len(found)} reports of the sanitizer")
    return 1 if found or done.returncode else 0


if __name__ == "__main__":
    sys.exit(main())
