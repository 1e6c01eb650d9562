"""Refinement to a target error, held against references that it does not know.

    python tests/benchmarks/target_error.py [--scenes pendulum,...] [--targets 1e-1,1e-2] [--channels all]
    python tests/benchmarks/target_error.py --effectivity [--scenes pendulum,...] [--meshes 4x3,8x3,4x5]

For each scene and target, what `hfsim run --target-error` chooses, its estimate, and the true error: the
distance to a run on a much finer mesh with a much tighter tolerance, largest over time in the worst channel,
relative to its range.  How far the reference itself can be trusted is told by a second one of other elements
and degree.  Effectivity: estimate over true error; 1 or above is honest, much above 1 is wasteful.  A row
whose true error does not exceed three times that trust is marked '~'.  CPU seconds: of the whole refinement,
and of the chosen level alone; races: part of the former that comparing methods took.

With --effectivity, what plain runs on some meshes (elements x degree; the deck's own first) say of their
errors in all channels that are judged: of time, against a run at a tolerance of 1e-12 on the same mesh, and
of the mesh, against the finest reference.  The CPU time of both estimates is given over that of the run.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hfsim.marching.distance import channel_errors
from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import compute_channels, sample
from hfsim.marching.solution import Channel
from hfsim.parts.channels import is_judged
from hfsim.scene.build import build
from hfsim.scene.loading import LoadedDeck, load_deck
from hfsim.simulate import simulate
from hfsim.studies.refine.study import refine

CASES = Path(__file__).parents[2] / "cases"


@dataclass(frozen=True)
class Task:
    """A scene: span [s], output interval [s], beams, and two references (elements, degree, tolerance).

    Besides: the channels that count unless all do, those of tips without them; the method of the references,
    the default one without it; and the folder of its deck.
    """

    duration: float
    interval: float
    beams: tuple[str, ...]
    references: tuple[tuple[int, int, float], ...]
    counted: tuple[str, ...] = ()
    method: str = "auto"
    folder: Path = CASES


TASKS = {
    "pendulum": Task(0.7, 0.01, ("b1",), ((28, 7, 1e-6), (36, 5, 1e-6))),
    "two_beams_relative": Task(0.5, 0.01, ("b1", "b2"), ((6, 9, 1e-6), (8, 7, 1e-6))),
    "hub_beams": Task(0.5, 0.02, ("b1", "b2"), ((6, 9, 1e-6), (8, 7, 1e-6))),
    "light_link": Task(
        0.25, 0.0025, ("b1",), ((1, 7, 1e-5), (2, 5, 1e-5)), ("load.y",), "radau", CASES / "extreme"
    ),
    "hub_beams_soft": Task(0.5, 0.02, ("b1", "b2"), ((12, 9, 1e-5), (16, 7, 1e-5))),
}


def deck(name: str, *overrides: str) -> LoadedDeck:
    """Return a shipped scene over the span of its task."""
    task = TASKS[name]
    span = (f"solve.duration={task.duration}", f"output.interval={task.interval}")
    return load_deck(task.folder / f"{name}.yaml", (*span, *overrides))


def reference(name: str, elements: int, degree: int, tolerance: float) -> tuple[Channel, ...]:
    """Return the channels of a run on a given mesh."""
    mesh = {"elements": elements, "degree": degree}
    options = [f"bodies.{beam}.{key}={n}" for beam in TASKS[name].beams for key, n in mesh.items()]
    # the stepping that costs less on fine meshes
    scene = build(deck(name, *options, f"solve.tolerance={tolerance}", "solve.coordinates=frame",
                       f"solve.method={TASKS[name].method}"))  # fmt: skip
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None, done.stop
    return compute_channels(sample(scene, done.trajectory))


def error(channels: tuple[Channel, ...], truth: tuple[Channel, ...], counted: list[str]) -> float:
    """Return the error in the worst channel that counts [-]."""
    relative = channel_errors(channels, truth)[1]
    return max(relative[name] for name in counted)


def measure(name: str, targets: list[str], which: str, budget: float, method: str) -> None:
    """Print the rows of one scene."""
    start = time.process_time()
    truth, check = (reference(name, *setting) for setting in TASKS[name].references)
    channels = [c for c in deck(name).deck.channels if is_judged(c)]
    tips = list(TASKS[name].counted) or [c for c in channels if c.endswith((".tip.x", ".tip.y"))]
    counted = tips if which == "tips" else channels
    trust = error(check, truth, counted)
    print(f"# {name}: references {TASKS[name].references}, {trust:.1e} apart, "
          f"{time.process_time() - start:.0f} s", flush=True)  # fmt: skip
    for target in targets:
        options = (f"solve.target_error={target}", f"solve.target_channels=[{', '.join(counted)}]")
        run, _ = refine(deck(name, *options, f"solve.budget={budget}", f"solve.method={method}"))
        found = run.statistics["refinement"]
        chosen = found["chosen"]
        true = error(run.channels, truth, counted)
        estimate = found["estimate"]
        effect = f"{estimate / true:.2g}" if estimate else "-"
        mesh = ", ".join(f"{n['elements']} x {n['degree']}" for n in chosen["bodies"].values())
        races = found["probing_cpu_s"] / found["cpu_s"]
        doubt = "~" if true < 3.0 * trust else ""
        print(f"| `{name}`, {which} | {target} | {found['status']} | {estimate or 0:.1e} | "
              f"{doubt}{true:.1e} | {effect} | {found['cpu_s']:.2f} | {chosen['cpu_s']:.2f} | {mesh} | "
              f"{chosen['method']} | {chosen['tolerance']:.0e} | {races:.0%} | "
              f"{found['limiting_channel']} |", flush=True)  # fmt: skip


def effectivity(name: str, meshes: list[str]) -> None:
    """Print what runs of one scene on some meshes say of their errors, and the true ones."""
    truth = reference(name, *TASKS[name].references[0])
    for mesh in ["", *meshes]:
        sizes = zip(("elements", "degree"), mesh.split("x"), strict=True) if mesh else ()
        options = [f"bodies.{beam}.{key}={n}" for key, n in sizes for beam in TASKS[name].beams]
        run = simulate(deck(name, *options), mesh_estimate=True, after=300.0)
        options += ["solve.tolerance=1e-12", "solve.method=gauss"]
        tight = simulate(deck(name, *options), error_estimate=False)
        said, cpu = run.statistics, run.statistics["cpu_s"]
        row = [f"`{name}`", mesh or "the deck's"]
        for key, true in (("error", tight.channels), ("mesh_error", truth)):
            estimate, error = said[f"{key}_estimate"], max(channel_errors(run.channels, true)[1].values())
            known = ("-", "-") if estimate is None else (f"{estimate:.1e}", f"{estimate / error:.2g}")
            row += [known[0], f"{error:.1e}", known[1], f"{cpu[f'{key}_estimate'] / cpu['solve']:.2g}"]
        print(f"| {' | '.join([*row, str(said['limiting_channel'])])} |", flush=True)


def main() -> None:
    """Read the command line and measure."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--scenes", default=",".join(TASKS))
    parser.add_argument("--targets", default="1e-1,1e-2,1e-3,1e-4")
    parser.add_argument("--channels", default="tips", choices=("tips", "all"))
    parser.add_argument("--method", default="auto", help="keep one method, to see what the choice gains")
    parser.add_argument("--effectivity", action="store_true", help="of what plain runs say of their errors")
    parser.add_argument("--meshes", default="8x3,16x3,2x5,4x5", help="besides the deck's own")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds for each target")
    given = parser.parse_args()
    if given.effectivity:
        columns = "estimate | true | ratio | CPU"
        print(f"| scene | mesh | time error: {columns} | mesh error: {columns} | limiting channel |")
        print("|" + "---|" * 11)
        for name in given.scenes.split(","):
            effectivity(name, given.meshes.split(","))
        return
    print("| scene, channels | target | status | estimate | true error | effectivity | CPU [s] "
          "| chosen alone [s] | mesh | method | tolerance | races | worst channel |")  # fmt: skip
    print("|" + "---|" * 13)
    for name in given.scenes.split(","):
        measure(name, given.targets.split(","), given.channels, given.budget, given.method)


if __name__ == "__main__":
    main()
