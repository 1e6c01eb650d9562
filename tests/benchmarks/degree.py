"""Refinement by degree against refinement by elements: CPU time for a stated error in metres.

    python tests/benchmarks/degree.py [--model ancf] [--degrees 3,5,7,9] [--scenes pendulum,...] [--repeats 3]

For each scene a reference is converged in space and time: two fine meshes of different degree at a tight
tolerance, whose distance is told. The error of a run is the largest distance of the tip from the reference's
over all output times, so that it holds both the error of the mesh and that in time. For each degree, meshes
of more and more elements are run at tolerances from loose to tight; the cheapest run that reaches the target
counts, timed again (median). CPU seconds of the integration alone, one thread, estimates of the error off.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import sample
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck

CASES = Path(__file__).parents[2] / "cases"
TOLERANCES = (1e-3, 1e-4, 3e-5)


@dataclass(frozen=True)
class Task:
    """A scene with what is asked of it.

    Attributes
    ----------
    beams : tuple of str
    tip : str
        Point whose distance from the reference is the error.
    duration, target : float
        [s], [m].
    elements : dict of int to tuple of int
        Elements a beam to try, by degree.
    references : tuple of (elements, degree, tolerance)
        The first is the reference, the second tells how far it can be trusted.
    """

    beams: tuple[str, ...]
    tip: str
    duration: float
    target: float
    elements: dict[int, tuple[int, ...]]
    references: tuple[tuple[int, int, float], ...]


TASKS = {
    "pendulum": Task(
        beams=("b1",), tip="b1.tip", duration=0.7, target=1e-3,
        elements={3: (28, 32, 36), 5: (12, 14, 16), 7: (8, 9, 10), 9: (5, 6, 7)},
        references=((24, 7, 1e-7), (32, 5, 1e-7)),
    ),
    "two_beams_relative": Task(
        beams=("b1", "b2"), tip="b2.tip", duration=2.0, target=1e-4,
        elements={3: (28, 30, 32), 5: (7, 8), 7: (4,), 8: (3,), 9: (3,)},
        references=((5, 9, 1e-6), (6, 7, 1e-6)),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Result:
    """One run: CPU time [s], steps, unknowns and the path of the tip, shape (n_times, 2)."""

    cpu: float
    steps: int
    unknowns: int
    path: np.ndarray | None


def run(name: str, task: Task, model: str, elements: int, degree: int, tolerance: float) -> Result:
    """Integrate the scene on one mesh."""
    options = [f"solve.tolerance={tolerance}", f"solve.duration={task.duration}"]
    mesh = {"elements": elements, "degree": degree}
    options += [f"bodies.{beam}.{key}={n}" for beam in task.beams for key, n in mesh.items()]
    scene = build(load_deck(CASES / f"{name}.yaml", tuple(options)), model)
    start = time.process_time()
    done = run_integration(scene, scene.deck.solve)
    cpu = time.process_time() - start
    path = None if done.stop else scene.marker(task.tip).position(sample(scene, done.trajectory).x)
    return Result(cpu, done.problem.counts.steps, scene.system.n, path)


def distance(a: Result, b: Result) -> float:
    """Return the largest distance of two paths [m]."""
    if a.path is None or b.path is None:
        return np.inf
    return float(np.linalg.norm(a.path - b.path, axis=1).max())


def cheapest(name: str, task: Task, model: str, degree: int, truth: Result, repeats: int) -> str:
    """Return a row of the table: the cheapest run with elements of a degree that reaches the target."""
    best: tuple[float, int, float, Result, float] | None = None
    for elements in task.elements[degree]:
        for tolerance in TOLERANCES:
            found = run(name, task, model, elements, degree, tolerance)
            error = distance(found, truth)
            print(f"    {elements} x {degree}, {tolerance:.0e}: {error:.1e} m, {found.cpu:.3g} s", flush=True)
            if error <= task.target and (best is None or found.cpu < best[0]):
                best = (found.cpu, elements, tolerance, found, error)
            if error <= task.target or (best is not None and found.cpu > 2.0 * best[0]):
                break
    if best is None:
        return f"| {degree} | - | | | | |"
    _, elements, tolerance, found, error = best
    times = [run(name, task, model, elements, degree, tolerance).cpu for _ in range(repeats)]
    return (
        f"| {degree} | {elements} | {found.unknowns} | {tolerance:.0e} | {error:.1e} | "
        f"{found.steps} | {median([found.cpu, *times]):.3g} |"
    )


def measure(name: str, task: Task, model: str, degrees: tuple[int, ...], repeats: int) -> None:
    """Print the table of one scene."""
    truth, check = (run(name, task, model, *reference) for reference in task.references)
    print(f"{name}, {model}, {task.duration:g} s, target {task.target:g} m")
    words = (f"{n} elements of degree {p}, tolerance {tol:.0e}" for n, p, tol in task.references)
    print(
        f"reference: {' against '.join(words)}: {distance(truth, check):.1e} m, {truth.cpu:.3g} s", flush=True
    )
    rows = [cheapest(name, task, model, p, truth, repeats) for p in degrees if p in task.elements]
    print("\n| degree | elements a beam | unknowns | tolerance | error [m] | steps | CPU [s] |")
    print("|---|---|---|---|---|---|---|", *rows, "", sep="\n", flush=True)


def main() -> None:
    """Read the command line and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="ancf")
    parser.add_argument("--degrees", default="3,5,7,8,9")
    parser.add_argument("--scenes", default=",".join(TASKS))
    parser.add_argument("--repeats", type=int, default=2)
    given = parser.parse_args()
    degrees = tuple(int(p) for p in given.degrees.split(","))
    for name in given.scenes.split(","):
        measure(name, TASKS[name], given.model, degrees, given.repeats)


if __name__ == "__main__":
    main()
