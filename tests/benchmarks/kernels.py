# ruff: noqa: E402
"""Hold the native kernel against NumPy: ``python tests/benchmarks/kernels.py [CASE ...]``.

Cases are shipped ones, or decks beside this file, as `rotor`. CPU time of the solve call alone, one thread,
both kernels in turns at equal tolerances, median of repeats; the native one with a new scene, so that it
records within that time, and again with the recordings that this run has left. Difference: the largest of
all coordinates at the end. No test.
"""

from __future__ import annotations

import os  # first: the libraries read these names when they are imported

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import time
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(ROOT))

import numpy as np

from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import load_deck


def solved(scene: Scene, way: str) -> tuple[float, np.ndarray, int, int]:
    """Return CPU time, state at the end, steps, and how many of them the kernel made."""
    kernel.KERNEL = way
    begin = time.process_time()
    done = run_integration(scene, scene.deck.solve)
    cpu = time.process_time() - begin
    if done.stop is not None:
        raise SystemExit(f"the run failed: {done.stop}")
    return cpu, done.trajectory.q, done.problem.counts.steps, done.problem.counts.native


def main() -> None:
    """Read the command line, measure, report."""
    parser = argparse.ArgumentParser(description="the native kernel and NumPy at equal tolerances")
    parser.add_argument("cases", nargs="*", default=["manipulator"])
    parser.add_argument("--tolerances", default="1e-4,1e-6,1e-8,1e-10", help="with commas between")
    parser.add_argument("--set", action="append", default=[], help="an entry of the decks, KEY=VALUE")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    if kernel.KERNEL == "numpy":
        parser.error("there is no native kernel: see hfsim --version")
    heads = ("case", "tolerance", "steps, native", "NumPy [s]", "native [s]", "ratio", "again [s]", "ratio")
    head = " | ".join(("|", *heads, "difference |")).removeprefix("| ")
    print(f"{head}\n{'|---' * 9}|")
    for name in options.cases:
        for tolerance in options.tolerances.split(","):
            own = HERE / "decks" / f"{name}.yaml"
            deck = own if own.exists() else ROOT / "cases" / own.name
            loaded = load_deck(deck, [*options.set, f"solve.tolerance={tolerance}"])
            times: dict[str, list[float]] = {"numpy": [], "native": [], "again": []}
            for _ in range(options.repeats):
                scene = build(loaded)
                cpu, expected, _, _ = solved(build(loaded), "numpy")
                times["numpy"].append(cpu)
                cpu, found, steps, native = solved(scene, "native")
                times["native"].append(cpu)
                times["again"].append(solved(scene, "native")[0])
            a, b, c = (median(one) for one in times.values())
            apart = float(np.abs(found - expected).max())
            ratios = f"{a:.3g} | {b:.3g} | {a / b:.2f} | {c:.3g} | {a / c:.2f}"
            print(f"| {name} | {tolerance} | {steps}, {native} | {ratios} | {apart:.1e} |", flush=True)


if __name__ == "__main__":
    main()
