# ruff: noqa: E402
"""Measure what sweeps cost beside solves: ``python tests/benchmarks/sweeps.py [--runs 300] [--jobs 1 2]``.

Pendulums of other lengths and angles, 0.2 s of motion, extremes and last values of six channels. The
solves of a run are building, integrating and estimating the error in time; overhead is all other CPU time
of parent and workers, by the difference of two sweeps. Wall times mean something on an idle machine. No test.
"""

from __future__ import annotations

import os  # first: the libraries read these names when they are imported

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import time
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

import hfsim
from hfsim import simulate as pipeline
from hfsim.studies.sweep import study
from hfsim.studies.sweep.work import solve_row
from hfsim.trust import error

FEW = 4
VARY = {"bodies.b1.length": "uniform(1, 1.4)", "initial.b1.angle": "uniform(-1, 1)"}
SPENT = {"": 0.0}


def timed(place, name):
    """Let the CPU time of a function be added up."""
    plain = getattr(place, name)

    def call(*given, **named):
        start = time.process_time()
        try:
            return plain(*given, **named)
        finally:
            SPENT[""] += time.process_time() - start

    setattr(place, name, call)


def solves_timed(*given):
    """Do a run of a sweep; its row tells the CPU time of its solves alone."""
    SPENT[""] = 0.0
    row, files = solve_row(*given)
    return {**row, "cpu_s": SPENT[""]}, files


def used(who):
    """Return the CPU time of this process or of those that have ended [s]."""
    found = getrusage(who)
    return found.ru_utime + found.ru_stime


def swept(runs, jobs):
    """Return CPU times of parent, workers and solves, and the wall time [s]."""
    before, start = [used(RUSAGE_SELF), used(RUSAGE_CHILDREN)], time.perf_counter()
    with TemporaryDirectory() as folder:
        changes = {"solve.duration": 0.2}
        done = hfsim.sweep("pendulum", VARY, (), changes, sample=runs, jobs=jobs, output=folder, plots=False)
    wall = time.perf_counter() - start
    own, workers = used(RUSAGE_SELF) - before[0], used(RUSAGE_CHILDREN) - before[1]
    return own, workers, float(done["cpu_s"].sum()), wall


def main(runs, jobs):
    """Print a line for each number of processes."""
    timed(pipeline, "build")
    timed(pipeline, "run_integration")
    timed(error, "time_error")
    study.solve_row = solves_timed
    swept(FEW, 1)
    for count in jobs:
        few, many = swept(FEW, count), swept(runs, count)
        parent, workers, solves, _ = (1e3 * (b - a) / (runs - FEW) for a, b in zip(few, many, strict=True))
        print(
            f"{count} processes: solves {solves:.2f} ms a run; beside them {workers - solves:.2f} in "
            f"workers, {parent:.2f} in the parent, {workers + parent - solves:.2f} in all; {many[3]:.1f} s"
        )


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--runs", type=int, default=300)
    asked.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    given = asked.parse_args()
    main(given.runs, given.jobs)
