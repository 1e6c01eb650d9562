# ruff: noqa: E402
"""Measure hfsim, SciPy and Exudyn side by side: ``python tests/benchmarks/peers.py``.

CPU time of the solve call alone, one thread, median of repeats (a point of more than 1 s is measured once),
the least one of several rounds in which all codes take turns: the clock of a machine may change in between.
The error is the largest distance of the tip from the converged trajectory of the same discretisation, on the
output grid. That trajectory is hfsim's at a far tighter tolerance, for each element law; for Exudyn's law it
is compared with the trajectories of an independent code in ``tests/reference``, and the difference printed.

 - hfsim runs with its native kernel and in NumPy, in turns (``--kernel``), each time with a new scene, of
   which the kernel makes a recording within the time that is measured; and again with one that it has solved
   before, as studies of tolerances and error estimates do: then the solve alone is measured.
 - SciPy integrates hfsim's own equations of motion (model ancf) in first-order form, with hfsim's default
   law.
 - Exudyn runs in a Python of its own (``--exudyn``), and is compared with hfsim in Exudyn's law.

No test. Writes ``peers.csv`` and ``peers.png`` into the folder of ``-o``.
"""

from __future__ import annotations

import os  # first: the libraries read these names when they are imported

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import csv
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

import numpy as np
from scipy.integrate import solve_ivp

from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import samples_at
from hfsim.maths import kernel
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck, load_deck

LEVELS = tuple(10.0**-k for k in range(2, 11))
TOLERANCES = {
    "hfsim": tuple(10.0**-k for k in range(1, 11)),
    "SciPy": tuple(10.0**-k for k in range(3, 13)),
}
SCIPY_METHODS = ("BDF", "Radau", "DOP853", "LSODA")
SHARES = {"hfsim": 0.45, "SciPy": 0.25, "Exudyn": 0.30}
"""Of a scene's time, for each code."""

DEFAULT, EXUDYN = "green + linear", "engineering + exact"
LAWS = {
    DEFAULT: ("strain=green", "curvature=linear"),
    EXUDYN: ("strain=engineering", "curvature=exact", "quadrature={axial: 5, bending: 3}"),
}
AGAIN, NUMPY = "hfsim again", "hfsim in NumPy"
WAYS = {"hfsim": ("native", False), AGAIN: ("native", True), NUMPY: ("numpy", False)}
"""What hfsim is called with each kernel, and whether it has solved a scene before."""
NATIVE = {name: WAYS[name] for name in ("hfsim", AGAIN)}
CHOSEN = {"both": WAYS, "native": NATIVE, "numpy": {"hfsim": WAYS[NUMPY]}}
PEERS = {DEFAULT: "SciPy", EXUDYN: "Exudyn"}
LINES = [(code, law) for law, peer in PEERS.items() for code in (*WAYS, peer)]


@dataclass(frozen=True)
class Case:
    """A scene: its beams, its share of the time, the tolerance of its reference."""

    beams: tuple[str, ...]
    weight: float
    reference: float

    @property
    def tip(self) -> str:
        """The point that is followed."""
        return f"{self.beams[-1]}.tip"


CASES = {
    "pendulum": Case(("b1",), 1.0, 1e-12),
    "two_beams_relative": Case(("b1", "b2"), 3.0, 1e-11),
    "hub_beams": Case(("b1", "b2"), 4.0, 1e-11),
    "hub_beams_soft": Case(("b1", "b2"), 2.0, 1e-12),
}


@dataclass(frozen=True)
class Point:
    """One measurement."""

    scene: str
    code: str
    law: str
    method: str
    setting: float
    cpu: float
    error: float


@dataclass(frozen=True)
class Asked:
    """What is measured of all scenes: hfsim's models and kernels, and Exudyn if there is a Python with it."""

    models: list[str]
    ways: dict[str, tuple[str, bool]]
    exudyn: str | None
    limit: float
    repeats: int
    rounds: int


class OutOfTimeError(Exception):
    """A peer took longer than a point may."""


# ---------------------------------------------------------------------- scenes and references


def load(name: str, law: str, tolerance: float) -> LoadedDeck:
    """Return a deck of the project with an element law and a tolerance."""
    settings = [f"bodies.{beam}.{one}" for beam in CASES[name].beams for one in LAWS[law]]
    return load_deck(ROOT / "cases" / f"{name}.yaml", [*settings, f"solve.tolerance={tolerance:g}"])


def grid(scene: Scene) -> np.ndarray:
    """Return the output times."""
    return scene.deck.interval * np.arange(round(scene.deck.solve.duration / scene.deck.interval) + 1)


def solve_hfsim(
    name: str, law: str, model: str, tolerance: float, way: str = kernel.KERNEL, again: bool = False
) -> tuple[float, np.ndarray | None]:
    """Return CPU time of the solve call and path of the tip, None if the run fails.

    The scene is new, so that what the native kernel records is recorded within that time, unless it is to be
    solved again.
    """
    loaded = load(name, law, tolerance)
    scene = build(loaded, model)
    kernel.KERNEL = way
    if again:
        run_integration(scene, loaded.deck.solve)
    begin = time.process_time()
    done = run_integration(scene, loaded.deck.solve)
    cpu = time.process_time() - begin
    if done.stop is not None:
        return cpu, None
    samples = samples_at(scene, done.trajectory, np.minimum(grid(scene), done.trajectory.t_end))
    return cpu, np.asarray(scene.marker(CASES[name].tip).position(samples.x))


def solve_scipy(
    name: str, law: str, method: str, tolerance: float, limit: float
) -> tuple[float, np.ndarray | None]:
    """Return CPU time of SciPy's solve call and path of the tip, None if it fails or takes too long."""
    scene = build(load(name, law, tolerance), "ancf")
    n, acceleration = scene.system.n, scene.system.acceleration
    begin = time.process_time()

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        if time.process_time() - begin > limit:
            raise OutOfTimeError
        q, v = y[None, :n], y[None, n:]
        return np.concatenate([y[n:], acceleration(np.array([t]), q, v)[0]])

    start, times = np.concatenate([scene.q, scene.v]), grid(scene)
    try:
        with np.errstate(all="ignore"):
            done = solve_ivp(rates, (0.0, times[-1]), start, method, times, rtol=tolerance, atol=tolerance)
    except (OutOfTimeError, ValueError, np.linalg.LinAlgError):
        return time.process_time() - begin, None
    cpu = time.process_time() - begin
    if not done.success:
        return cpu, None
    x = scene.system.absolute(done.y[:n].T)
    return cpu, np.asarray(scene.marker(CASES[name].tip).position(x))


def distance(path: np.ndarray, reference: np.ndarray) -> float:
    """Return the largest distance of two paths."""
    return float(np.linalg.norm(path - reference, axis=1).max())


def independent_difference(name: str, times: np.ndarray, reference: np.ndarray) -> float:
    """Return how far a reference in Exudyn's law is from that of the independent code."""
    lines = (ROOT / "tests" / "reference" / f"{name}.csv").read_text().splitlines()
    rows = [line.split(",")[:3] for line in lines if not line.startswith(("#", "t"))]
    table = np.array(rows, dtype=float)
    at = np.searchsorted(times, table[:, 0] - 1e-9)
    return distance(reference[at], table[:, 1:])


# ---------------------------------------------------------------------- measuring


def repeated(
    solve: Callable[[], tuple[float, np.ndarray | None]], repeats: int
) -> tuple[float, np.ndarray | None]:
    """Return the median of the CPU times and the path; dear points are measured once."""
    cpu, path = solve()
    times = [cpu]
    while path is not None and len(times) < repeats and sum(times) < 1.0:
        times.append(solve()[0])
    return median(times), path


Series = tuple[str, str, Callable[[float], tuple[float, np.ndarray | None]]]


def sweep(
    series: list[Series], tolerances: tuple[float, ...], seconds: float, limit: float, repeats: int
) -> Iterator[tuple[Series, float, float, np.ndarray]]:
    """Tighten the tolerance of every series, the cheapest next, until limit or time are reached."""
    deadline = time.monotonic() + seconds
    done = dict.fromkeys(range(len(series)), 0)
    last = dict.fromkeys(done, 0.0)
    while done:
        k = min(done, key=lambda one: last[one])
        if time.monotonic() + last[k] > deadline:
            return
        tolerance, solve = tolerances[done[k]], series[k][2]
        last[k], path = repeated(lambda: solve(tolerance), repeats)  # noqa: B023
        if path is not None and np.isfinite(path).all():
            yield series[k], tolerance, last[k], path
        done[k] += 1
        if done[k] == len(tolerances) or last[k] > 0.8 * limit:
            del done[k]


def hfsim_series(name: str, asked: Asked, way: str, again: bool) -> list[Series]:
    """Return hfsim's models in both laws, in one way."""
    solve = partial(solve_hfsim, way=way, again=again)
    return [(law, model, partial(solve, name, law, model)) for law in LAWS for model in asked.models]


def scipy_series(name: str, limit: float) -> list[Series]:
    """Return SciPy's methods on hfsim's equations."""
    return [
        (
            DEFAULT,
            method,
            partial(solve_scipy, name, DEFAULT, method, limit=limit),
        )
        for method in SCIPY_METHODS
    ]


def exudyn_points(
    python: str, name: str, seconds: float, limit: float, repeats: int
) -> Iterator[tuple[str, float, float, np.ndarray]]:
    """Yield method, step, CPU time and path of each point that Exudyn's script measures."""
    script = Path(__file__).with_name("exudyn_scenes.py")
    command = [python, "-W", "ignore", str(script), name, str(seconds), str(limit), str(repeats)]
    output = subprocess.run(command, capture_output=True, text=True, check=False)
    if output.returncode:
        print(f"  Exudyn: stopped with code {output.returncode}: {output.stderr.strip()[-300:]}")
    for line in output.stdout.splitlines():
        if line.startswith("{"):
            found = json.loads(line)
            yield found["method"], found["step"], median(found["cpu"]), np.array(found["tip"])


def codes(
    name: str, asked: Asked, seconds: float
) -> Iterator[tuple[str, str, str, float, float, np.ndarray]]:
    """Yield code, law, method, tolerance or step, CPU time and path of each point, one code after another."""
    ways, limit = asked.ways, asked.limit
    patience = min(limit, SHARES["SciPy"] * seconds / len(SCIPY_METHODS))
    for code, kind, series, longest in (
        *((code, "hfsim", hfsim_series(name, asked, *way), limit) for code, way in ways.items()),
        ("SciPy", "SciPy", scipy_series(name, patience), patience),
    ):
        share = SHARES[kind] / (len(ways) if kind == "hfsim" else 1)
        measured = sweep(series, TOLERANCES[kind], share * seconds, longest, asked.repeats)
        yield from ((code, law, method, *found) for (law, method, _), *found in measured)
    if asked.exudyn:
        share = SHARES["Exudyn"]
        for found in exudyn_points(asked.exudyn, name, share * seconds, limit, asked.repeats):
            yield "Exudyn", EXUDYN, *found


def cheapest(points: list[Point]) -> list[Point]:
    """Return the point of the least CPU time of each code, law, method and setting."""
    best: dict[tuple[str, str, str, float], Point] = {}
    for p in points:
        key = p.code, p.law, p.method, p.setting
        if key not in best or p.cpu < best[key].cpu:
            best[key] = p
    return list(best.values())


def measure(name: str, asked: Asked, seconds: float) -> tuple[list[Point], dict[str, float], float]:
    """Return the points of a scene, how far each law's reference can be trusted [m], and the time spent."""
    case, references = CASES[name], {}
    for law in LAWS:
        path = solve_hfsim(name, law, "ancf", case.reference)[1]
        if path is None:
            raise SystemExit(f"{name}: the reference run failed")
        references[law] = path
    times = grid(build(load(name, EXUDYN, 1e-6), "ancf"))
    floors = {EXUDYN: independent_difference(name, times, references[EXUDYN])}
    begin = time.monotonic()
    rounded = [
        Point(name, code, law, method, setting, cpu, distance(path, references[law]))
        for _ in range(asked.rounds)
        for code, law, method, setting, cpu, path in codes(name, asked, seconds / asked.rounds)
    ]
    points = cheapest(rounded)
    floors[DEFAULT] = min(p.error for p in points if p.law == DEFAULT)
    return points, floors, time.monotonic() - begin


# ---------------------------------------------------------------------- results


def front(points: list[Point], code: str, law: str) -> list[Point]:
    """Return the points of a code that no other beats in both error and time, largest error first."""
    best: list[Point] = []
    for p in sorted((p for p in points if (p.code, p.law) == (code, law)), key=lambda p: (p.error, p.cpu)):
        if not best or p.cpu < best[-1].cpu:
            best.append(p)
    return best[::-1]


def least_cpu(best: list[Point], level: float) -> tuple[float, bool] | None:
    """Return the least CPU time for an error, and whether it is interpolated between points."""
    below = next((k for k, p in enumerate(best) if p.error <= level), None)
    if below is None:
        return None
    if below == 0:
        return best[0].cpu, False
    a, b = best[below - 1], best[below]
    share = np.log(level / a.error) / np.log(b.error / a.error)
    return float(a.cpu * (b.cpu / a.cpu) ** share), True


def cell(value: tuple[float, bool] | None) -> str:
    """Return a time for the table; a star marks a measured point below the error, not interpolated."""
    return "-" if value is None else f"{value[0]:.3g}{'' if value[1] else '*'}"


def ratio(peer: tuple[float, bool] | None, own: tuple[float, bool] | None) -> str:
    """Return how many times longer a peer takes."""
    return "-" if peer is None or own is None else f"{peer[0] / own[0]:.2g}"


def table(points: list[Point]) -> Iterator[str]:
    """Yield the lines of a scene's table; ways of hfsim that were measured share a cell."""
    codes, heads = {p.code for p in points}, {"hfsim": "hfsim", AGAIN: "again", NUMPY: "in NumPy"}
    ways = {name: head for name, head in heads.items() if name in codes}
    told = [name for name in ways if name != NUMPY]
    mine = ", ".join(ways.values())
    ratios = "ratio" if len(told) == 1 else "ratios"
    head = ["error [m]", f"{mine} [s]", "SciPy [s]", ratios]
    head += [f"{mine}, Exudyn's element [s]", "Exudyn [s]", ratios]
    rows = []
    for level in LEVELS:
        words = [f"{level:.0e}"]
        for law, peer in PEERS.items():
            own = {code: least_cpu(front(points, code, law), level) for code in ways}
            theirs = least_cpu(front(points, peer, law), level)
            words += [", ".join(map(cell, own.values())), cell(theirs)]
            words += [", ".join(ratio(theirs, own[code]) for code in told) if theirs else "-"]
        rows.append(words)
    for words in (head, ["---"] * len(head), *rows):
        yield "| " + " | ".join(words) + " |"


def write_csv(points: list[Point], path: Path) -> None:
    """Write every measured point."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["scene", "code", "law", "method", "tolerance_or_step", "cpu_s", "error_m"])
        writer.writerows(vars(p).values() for p in points)


def draw(points: list[Point], names: list[str], path: Path) -> None:
    """Draw the front of each code, error against CPU time, with one legend: small enough for a page."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    columns = min(2, len(names))
    rows = -(-len(names) // columns)
    size = (4.0 * columns, 2.7 * rows + 0.7)
    figure, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    lines = {}
    for name, axis in zip(names, axes.flat, strict=False):
        for k, (code, law) in enumerate(LINES):
            best = front([p for p in points if p.scene == name], code, law)
            if best:
                first = law == DEFAULT
                style = {"color": f"C{k % 4}", "ls": "-" if first else "--", "ms": 3, "lw": 1.2}
                style["color"] = "k" if code == "Exudyn" else style["color"]
                cpu, error = [p.cpu for p in best], [p.error for p in best]
                (lines[f"{code}, {law}"],) = axis.plot(cpu, error, "o" if first else "s", **style)
        axis.set(xscale="log", yscale="log", title=name, ylabel="error of the tip [m]")
        axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("CPU time of the solve [s]")
    figure.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=2, fontsize=7)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def main() -> None:
    """Read the command line, measure, report."""
    parser = argparse.ArgumentParser(description="hfsim, SciPy and Exudyn side by side")
    parser.add_argument("--scenes", default=",".join(CASES), help="names with commas between")
    parser.add_argument("--models", default="exact,ancf", help="of hfsim, with commas between")
    parser.add_argument(
        "--kernel",
        choices=tuple(CHOSEN),
        default="both" if kernel.KERNEL == "native" else "numpy",
        help="of hfsim; what it is with both is the native one",
    )
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--rounds", type=int, default=3, help="in which the codes take turns")
    parser.add_argument(
        "--budget", type=float, default=300.0, help="time for all points [s], references apart"
    )
    parser.add_argument("--limit", type=float, default=10.0, help="CPU time that a point may take [s]")
    parser.add_argument("--exudyn", help="a Python that has Exudyn")
    parser.add_argument("-o", dest="folder", type=Path, default=Path("peers"))
    options = parser.parse_args()
    names = options.scenes.split(",")
    if options.kernel != "numpy" and kernel.KERNEL == "numpy":
        parser.error("there is no native kernel: see hfsim --version")
    if unknown := [name for name in names if name not in CASES]:
        parser.error(f"no such scene: {', '.join(unknown)}; there are {', '.join(CASES)}")
    exudyn = options.exudyn
    if not exudyn:
        print(
            "Exudyn left out: give --exudyn PYTHON (pip install exudyn in a virtual environment of its own)"
        )
    elif subprocess.run([exudyn, "-c", "import exudyn"], capture_output=True, check=False).returncode:
        print(f"Exudyn left out: {exudyn} cannot import it")
        exudyn = None
    print("CPU time of the solve call; ratio: peer / hfsim in the same law. again: of a scene solved before.")
    print("Log-log between points;", end=" ")
    print("*: the cheapest point measured, whose error is already below; -: not reached within the limits.")
    options.folder.mkdir(parents=True, exist_ok=True)
    points: list[Point] = []
    models, left = options.models.split(","), options.budget
    asked = Asked(models, CHOSEN[options.kernel], exudyn, options.limit, options.repeats, options.rounds)
    for k, name in enumerate(names):
        seconds = left * CASES[name].weight / sum(CASES[one].weight for one in names[k:])
        found, floors, spent = measure(name, asked, seconds)
        left = max(left - spent, 0.0)
        points += found
        print(f"\n### {name}\n")
        print("\n".join(table(found)))
        print(
            f"\nConverged: Exudyn's element within {floors[EXUDYN]:.1e} m of an independent code's;",
            end=" ",
        )
        print(f"hfsim's default: the closest run is {floors[DEFAULT]:.1e} m away.", flush=True)
        write_csv(points, options.folder / "peers.csv")
    draw(points, names, options.folder / "peers.png")
    print(f"\n{options.folder}/peers.csv, {options.folder}/peers.png")


if __name__ == "__main__":
    main()
