# ruff: noqa: E501
# ruff: noqa: E402
"""Measure the speed goals in one run: ``python tests/benchmarks/speed.py``.

CPU time, median of five repeats, BLAS on one thread. Prints a table against the goals; no test. With
``--exudyn PYTHON_WITH_EXUDYN`` it measures whole processes alone, hfsim and a bare Exudyn script alternately.
Modules must have been compiled: ``python -m compileall -q hfsim``, where PYTHONDONTWRITEBYTECODE is set.
"""

from __future__ import annotations

import argparse
import os  # first: the libraries read these names when they are imported

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np

from hfsim.marching.solution import Run
from hfsim.scene.loading import load_deck
from hfsim.simulate import simulate

ROOT = Path(__file__).resolve().parent.parent.parent
REPEATS = 5
SCENES = {
    "pendulum": ("b1", 1.0, 1e-8, 0.040, (1e-4, 1e-6, 1e-7, 1e-8)),
    "two_beams_relative": ("b2", 2.0, 1e-6, 1.5, (1e-4, 1e-5, 3e-6, 1e-6, 1e-7)),
}
"""Case: body with the tip, duration [s], goal of the tip's error [m] and of the CPU time [s], tolerances."""
PROGRAMS = {
    ("--help",): 0.2,
    ("check", "cases/pendulum.yaml"): 0.5,
    ("run", "cases/pendulum.yaml", "--no-plots"): 1.0,
}
"""Arguments of hfsim: goal of the CPU time of the whole process [s]."""


def solve(case: str, duration: float, tolerance: float, coordinates: str = "frame") -> Run:
    """Simulate a case once."""
    settings = [f"solve.duration={duration}", f"solve.tolerance={tolerance}"]
    settings += [f"solve.coordinates={coordinates}"]
    return simulate(load_deck(ROOT / "cases" / f"{case}.yaml", settings), error_estimate=False)


def tip(run: Run, body: str) -> np.ndarray:
    """Return the path of a body's tip, shape (2, n_times)."""
    values = {channel.name: channel.values for channel in run.channels}
    return np.stack([values[f"{body}.tip.x"], values[f"{body}.tip.y"]])


def measure_scene(case: str) -> None:
    """Print solve times and errors of a case against its converged solution."""
    body, duration = SCENES[case][:2]
    reference = tip(solve(case, duration, 1e-12), body)
    doubt = np.abs(tip(solve(case, duration, 1e-11), body) - reference).max()
    for coordinates in ("frame", "absolute"):
        print(f"\n{case}, {duration:g} s, coordinates: {coordinates} (reference good to about {doubt:.1e} m)")
        measure_tolerances(case, coordinates, reference)


def measure_tolerances(case: str, coordinates: str, reference: np.ndarray) -> None:
    """Print the rows of one case in one kind of coordinates, and whether one of them meets both goals."""
    body, duration, error_goal, time_goal, tolerances = SCENES[case]
    print(f"  {'tolerance':>9}  {'solve CPU [s]':>13}  {'tip error [m]':>13}  {'steps':>6}")
    met = None
    for tolerance in tolerances:
        runs = [solve(case, duration, tolerance, coordinates) for _ in range(REPEATS)]
        cpu = median(run.phase_cpu("solve") for run in runs)
        error = np.abs(tip(runs[0], body) - reference).max()
        print(f"  {tolerance:9.0e}  {cpu:13.4f}  {error:13.2e}  {runs[0].statistics['steps']:6d}")
        if error < error_goal and (met is None or cpu < met):
            met = cpu
    verdict = (
        "no tolerance reaches the error"
        if met is None
        else f"{met:.3f} s: {'met' if met <= time_goal else 'MISSED'}"
    )
    print(f"  goal: error below {error_goal:g} m in at most {time_goal:g} s: {verdict}")


def process_cpu(*command: str) -> float:
    """Return the CPU time of a whole process, user and system [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def hfsim_cpu(arguments: tuple[str, ...]) -> float:
    """Return the CPU time of hfsim as a whole process [s]."""
    with tempfile.TemporaryDirectory() as folder:
        extra = ("-o", f"{folder}/out", "-q") if arguments[0] == "run" else ()
        return process_cpu(sys.executable, "-m", "hfsim", *arguments, *extra)


def measure_against_exudyn(python: str, repeats: int) -> None:
    """Print the CPU time of the pendulum as a whole process, hfsim and an Exudyn script alternately.

    The script runs RK67 at 2000 steps (error of the tip 2e-9 m) and writes the path of the tip; hfsim runs at its
    default tolerance (5e-12 m) and writes all its files but plots.
    """
    scenes = Path(__file__).with_name("exudyn_scenes.py")
    times: dict[str, list[float]] = {"hfsim": [], "Exudyn": []}
    for _ in range(repeats):
        times["hfsim"].append(hfsim_cpu(("run", "pendulum", "--no-plots", "--no-error-estimate")))
        with tempfile.TemporaryDirectory() as folder:
            script = ("-W", "ignore", str(scenes), "pendulum", "RK67", "2000", f"{folder}/tip.csv")
            times["Exudyn"].append(process_cpu(python, *script))
    print(f"\nwhole process, pendulum, alternately, median of {repeats}")
    for code, values in times.items():
        print(f"  {code:<8} {median(values):6.3f} s  (from {min(values):.3f} to {max(values):.3f})")
    ratio = median(times["hfsim"]) / median(times["Exudyn"])
    print(f"  ratio {ratio:.2f}  (goal 2: {'met' if ratio <= 2.0 else 'MISSED'})")


def measure_program(arguments: tuple[str, ...], goal: float) -> None:
    """Print the CPU time of a whole process."""
    times = [hfsim_cpu(arguments) for _ in range(REPEATS)]
    cpu = median(times)
    print(
        f"  hfsim {' '.join(arguments):<42} {cpu:6.3f} s  (goal {goal:g} s: {'met' if cpu <= goal else 'MISSED'})"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "--exudyn", metavar="PYTHON", help="measure start-up only, against this Python's Exudyn"
    )
    parser.add_argument("--repeats", type=int, default=15, help="of each, with --exudyn")
    chosen = parser.parse_args()
    if chosen.exudyn:
        measure_against_exudyn(chosen.exudyn, chosen.repeats)
        raise SystemExit
    print("CPU time, median of", REPEATS)
    for name in SCENES:
        measure_scene(name)
    print("\nwhole processes")
    for words, seconds in PROGRAMS.items():
        measure_program(words, seconds)
