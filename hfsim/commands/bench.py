"""`hfsim bench`: error against run time, for methods, tolerances, models and meshes of one scene."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from hfsim.commands import bench_separation
from hfsim.commands.decks import assemble, find_deck, load_decks, with_numbers
from hfsim.commands.options import (
    names,
    output_options,
    refuse_unknown,
    setting_options,
    talk_options,
    time_option,
)
from hfsim.output.study import claim_study
from hfsim.output.talk import Destination, Talk, print_error
from hfsim.output.text import as_table, brief

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.bench import Bench, Cell, Point, Sweep

MARKER = bench_separation.MARKER
_NO_ORDER = 0.5
"""Order, from the coarsest to the finest mesh, below which a channel does not converge."""
_DRAWING = (2.0, 0.1)
"""Time kept back for pictures: so many seconds, at most this part of the budget."""
_Number = TypeVar("_Number", int, float)


@dataclass(frozen=True)
class Plan:
    """What is to be measured and where the results go."""

    argument: str
    deck: LoadedDeck
    sweep: Sweep
    seconds: float
    started: float
    folder: RunFolder
    overrides: tuple[str, ...]
    plots: bool
    talk: Talk


def _listed(kind: Callable[[str], _Number], what: str) -> Callable[..., tuple[_Number, ...]]:
    """Return a click callback that reads positive numbers separated by commas."""

    def read(_: click.Context, __: click.Parameter, text: str | None) -> tuple[_Number, ...]:
        try:
            numbers = tuple(dict.fromkeys(kind(part) for part in names(text)))
        except ValueError:
            raise click.BadParameter(f"'{text}' is no list of {what}") from None
        if not all(0 < number < float("inf") for number in numbers):
            raise click.BadParameter(f"'{text}': {what} are positive")
        return numbers

    return read


@click.command()
@click.argument("deck", metavar="[DECK]", required=False)
@click.option("--methods", metavar="A,B,...", help="Methods; all without it.")
@click.option(
    "--tolerances",
    metavar="X,Y,...",
    callback=_listed(float, "tolerances"),
    help="Tolerances; 1e-3 to 1e-10 by decades without it.",
)
@click.option(
    "--steps", metavar="X,Y,...", callback=_listed(float, "steps"), help="Fixed steps [s] in their place."
)
@click.option("--models", metavar="A,B,...", help="Models; the deck's without it.")
@click.option(
    "--elements",
    metavar="N,M,...",
    callback=_listed(int, "element counts"),
    help="Elements of each beam; the deck's without it. Several: mesh errors too.",
)
@click.option(
    "--separation",
    is_flag=True,
    help="Time the ways to the elastic force (the paper's Table 1) instead; takes no DECK.",
)
@click.option("--element", metavar="A,B,...", help="With --separation: kinds of element; all without it.")
@click.option(
    "--states",
    metavar="N,M,...",
    callback=_listed(int, "states"),
    help="With --separation: beams that move at once; 1 and 64 without it.",
)
@click.option(
    "--degrees",
    metavar="P,Q,...",
    callback=_listed(int, "degrees"),
    help="Degrees of the cable elements, 3 to 12; the deck's without it. Beside --elements, meshes finer "
    "than the finest of the lowest degree are left out.",
)
@time_option("budget", "Time all may take, e.g. 90s or 2min.", "60s")
@click.option(
    "--repeats",
    type=click.IntRange(min=1),
    default=3,
    show_default=True,
    help="Time short points so often and take the median.",
)
@output_options
@setting_options()
@talk_options
def bench(
    deck: str | None,
    methods: str | None,
    tolerances: tuple[float, ...],
    steps: tuple[float, ...],
    models: str | None,
    elements: tuple[int, ...],
    separation: bool,
    element: str | None,
    states: tuple[int, ...],
    degrees: tuple[int, ...],
    budget: float,
    repeats: int,
    to: Destination,
    overrides: tuple[str, ...],
    talk: Talk,
) -> None:
    """Measure error against run time for the scene DECK and recommend a method and a tolerance.

    Errors are the largest over time in the worst channel, relative to the channel's range, against a
    reference made by two methods that agree; energy.total of a conservative scene is told as drift only.
    CPU times are those of the integration alone. Results go to '<deck name>.bench' or to -o DIR.
    Points that fail are results (exit code 0); exit code 3 means that there is no reference.

    With --separation, the forms of the elastic force (solve.elastic_form in decks) are timed,
    each evaluation and a whole run; results go to 'separation.bench'. Exit code 4: the forms disagree.
    """  # fmt: skip
    started = time.perf_counter()
    if separation:
        unfit = {"DECK": deck, "--methods": methods, "--tolerances": tolerances, "--steps": steps,
                 "--models": models, "--set": overrides}  # fmt: skip
        _refuse_given(unfit, "does not go with --separation")
        plan = bench_separation.Plan(
            elements=elements or bench_separation.ELEMENTS,
            states=states or bench_separation.STATES,
            kinds=bench_separation.known_kinds(names(element)),
            repeats=repeats, seconds=budget, started=started, plots=to.plots, talk=talk,
            folder=claim_study("bench", to, "separation"),
        )  # fmt: skip
        raise click.exceptions.Exit(bench_separation.do_separation(plan))
    _refuse_given({"--element": element, "--states": states}, "goes with --separation only")
    if deck is None:
        raise click.UsageError("Missing argument 'DECK' (or --separation)")
    if tolerances and steps:
        raise click.UsageError("give --tolerances or --steps, not both")
    loaded = with_numbers(load_decks([str(find_deck(deck, talk))], overrides, talk, assemble)[0], talk)
    levels = (tolerances, steps)
    sweep = make_sweep(loaded, names(methods), levels, names(models), (elements, degrees), repeats)
    scene_plan = Plan(
        argument=deck, deck=loaded, sweep=sweep, seconds=budget, started=started, overrides=overrides,
        talk=talk, folder=claim_study("bench", to, loaded.deck.name), plots=to.plots,
    )  # fmt: skip
    raise click.exceptions.Exit(do_bench(scene_plan))


def _refuse_given(options: Mapping[str, object], why: str) -> None:
    for name, value in options.items():
        if value:
            raise click.UsageError(f"{name} {why}")


def make_sweep(
    loaded: LoadedDeck,
    methods: tuple[str, ...],
    levels: tuple[tuple[float, ...], tuple[float, ...]],
    models: tuple[str, ...],
    meshes: tuple[tuple[int, ...], tuple[int, ...]],
    repeats: int,
) -> Sweep:
    """Return what is varied, with the defaults filled in.

    Levels are tolerances and steps; meshes are elements and degrees.

    Raises
    ------
    click.UsageError
        If a name is unknown or a number out of range.
    """
    from hfsim.integrators import METHODS
    from hfsim.parts.bodies.models import MODELS
    from hfsim.studies.bench import Sweep

    (tolerances, steps), (elements, degrees) = levels, meshes
    refuse_unknown("method", methods, METHODS)
    refuse_unknown("model", models, MODELS)
    solve = loaded.deck.solve
    if any(tolerance > 0.1 for tolerance in tolerances):
        raise click.UsageError("a tolerance above 0.1 says nothing")
    if any(not 3 <= degree <= 12 for degree in degrees):
        raise click.UsageError("degrees go from 3 to 12")
    if any(step > solve.duration for step in steps):
        raise click.UsageError(f"a step is longer than the run, {solve.duration:g} s")
    return Sweep(
        methods=methods or tuple(METHODS),
        models=models or (solve.model,),
        steps=steps,
        elements=tuple(sorted(elements)),
        degrees=tuple(sorted(degrees)),
        repeats=repeats,
        **({"tolerances": tolerances} if tolerances else {}),
    )


def do_bench(plan: Plan) -> int:
    """Run the study, write and tell it, and return the exit code."""
    from hfsim.output.progress import Progress
    from hfsim.run.stop import Budget
    from hfsim.studies.bench import bench as measure

    plan.folder.prepare()
    (plan.folder.path / MARKER).unlink(missing_ok=True)
    drawing = min(_DRAWING[0], _DRAWING[1] * plan.seconds) if plan.plots else 0.0
    with Progress(f"{plan.deck.deck.name}, bench", sys.stderr, plan.talk.quiet) as progress:
        budget = Budget(plan.seconds - drawing, start=plan.started, report=progress)
        result = measure(plan.deck, plan.sweep, budget)
    facts = save_bench(plan, result)
    plan.talk.facts(facts)
    plan.talk.result(as_text(result, plan.folder.path))
    return _exit_code(result)


def _exit_code(result: Bench) -> int:
    if result.status == "interrupted":
        print_error("interrupted; what was measured until then is kept")
        return 130
    for cell in result.cells:
        if cell.status != "done":
            print_error(f"{cell.model}, {cell.mesh}: no reference: {cell.reason}")
    return 3 if result.status == "failed" else 0


def save_bench(plan: Plan, result: Bench) -> dict[str, object]:
    """Write bench.csv, the plots and, last, bench.json; return what is in the latter."""
    from hfsim.output.runfolder import disk
    from hfsim.output.writers import json_ready, versions, write_json, write_table
    from hfsim.studies.bench import CSV_COLUMNS, as_facts, as_rows

    path = plan.folder.path
    with disk(path):
        write_table(path / "bench.csv", as_rows(result), CSV_COLUMNS)
        about = {
            "deck": plan.argument,
            "deck_sha256": plan.deck.deck_sha256,
            "overrides": list(plan.overrides),
            "versions": versions(),
            "files": ["bench.csv", MARKER, *_pictures(plan, result)],
        }
        facts, _ = json_ready({**as_facts(result), **about})
        write_json(path / MARKER, facts)
    return dict(facts)


def _pictures(plan: Plan, result: Bench) -> list[str]:
    if not plan.plots:
        return []
    from hfsim.output.plots import draw_bench

    return [f"plots/{name}" for name in draw_bench(result, plan.folder.path / "plots")]


# --- text ----------------------------------------------------------------------------------------


def as_text(result: Bench, folder: Path) -> str:
    """Return the study as people read it: a table for each model and mesh, the mesh errors, the advice."""
    blocks = [f"{result.name}: error against CPU time over {result.duration:.6g} s, {result.used:.3g} s used"]
    blocks += [_cell_text(cell, result.points_of(cell)) for cell in result.cells]
    blocks += [_mesh_tables(result)] if any(c.mesh_error is not None for c in result.cells) else []
    return "\n\n".join([*blocks, "\n".join([f"  results: {folder}/", *result.recommendations])])


def _cell_text(cell: Cell, points: Sequence[Point]) -> str:
    from hfsim.studies.bench import tidy

    head = f"{cell.model}, {cell.mesh}, {cell.unknowns} unknowns"
    if cell.floor is None:
        lines = [f"{head}: no reference: {cell.reason}"]
    else:
        lines = [f"{head}; reference: {cell.reference},", f"  error floor {tidy(cell.floor)}, "
                 f"{cell.reference_cpu:.2g} s CPU"]  # fmt: skip
    table = _point_table(points)
    return "\n".join([*lines, *([table] if table else []), *_remarks(points)])


def _point_table(points: Sequence[Point]) -> str:
    from hfsim.studies.bench import pareto

    shown = [p for p in points if p.cpu is not None]
    if not shown:
        return ""
    front, totals = pareto(points), any(p.total_error is not None for p in shown)
    head = ["method", "at", "CPU [s]", "spread", "error", *(["with mesh"] if totals else []), "rms",
            "worst channel", "drift", "steps", "rejected", "Newton", "evaluations"]  # fmt: skip
    rows = [head]
    for p in shown:
        mark = " *" if p in front else ""
        at = p.level.replace("tolerance ", "").replace("step ", "")
        errors = [_error(p), *([brief(p.total_error)] if totals else []), _rms(p)]
        counts = [str(n) for n in (p.steps, p.rejected, p.newton_iterations, p.evaluations)]
        rows.append([p.method + mark, at, f"{p.cpu:.3g}", _spread(p), *errors, p.worst_channel or p.status,
                     brief(p.energy_drift), *counts])  # fmt: skip
    return as_table(rows) + "\n  * nothing cheaper comes near its error"


def _error(point: Point) -> str:
    return ("< " if point.below_floor else "") + brief(point.error)


def _rms(point: Point) -> str:
    return "-" if point.below_floor else brief(point.rms_error)


def _spread(point: Point) -> str:
    if point.repeats < 2 or not point.cpu:
        return "-"
    half = 50.0 * ((point.cpu_max or 0.0) - (point.cpu_min or 0.0)) / point.cpu
    return f"+-{half:.0f} %"


def _remarks(points: Sequence[Point]) -> list[str]:
    """Return lines on what failed, was cut off or was never run."""
    lines = [f"  {p.method}, {p.level}: {p.status}: {p.reason}" for p in points
             if p.status in ("failed", "limit", "over budget")]  # fmt: skip
    for method in dict.fromkeys(p.method for p in points):
        left = [p for p in points if p.method == method and p.status == "skipped"]
        if left:
            until = "" if len(left) == 1 else f" and {len(left) - 1} tighter"
            lines.append(f"  {method}, {left[0].level}{until}: skipped: {left[0].reason}")
    return lines


def _mesh_tables(result: Bench) -> str:
    """Return the mesh errors: the worst of each mesh with what suffices for it, and each channel's."""
    rows = [
        ["model", "elements", "degree", "unknowns", "mesh error", "in", "order", "reached within a tenth by"]
    ]
    meshed = [cell for cell in result.cells if cell.mesh_error is not None]
    for cell in meshed:
        order = "-" if cell.mesh_order is None else f"{cell.mesh_order:.1f}"
        counts = [str(n) for n in (cell.elements, cell.degree, cell.unknowns)]
        rows.append([cell.model, *counts, brief(cell.mesh_error), cell.mesh_channel, order,
                     _enough(cell, result)])  # fmt: skip
    finest = dict.fromkeys(f"{c.mesh_reference_words} ({c.model})" for c in meshed)
    head = f"mesh errors, against {', '.join(finest)}; tighter tolerances than the last column's"
    blocks = [f"{head} are wasted", as_table(rows)]
    for model in dict.fromkeys(cell.model for cell in meshed):
        for degree in result.degrees(model):
            cells = [c for c in meshed if (c.model, c.degree) == (model, degree)]
            blocks += ["", as_table(_channel_rows(cells)), *_stubborn(cells)] if cells else []
        blocks += _degree_table(result, model)
    return "\n".join(blocks)


def _degree_table(result: Bench, model: str) -> list[str]:
    """Return the cheapest way to each total error by elements of each degree; nothing with one degree."""
    from hfsim.studies.bench import mesh_words, recommend

    degrees = result.degrees(model)
    if len(degrees) < 2:
        return []
    rows = [["total error", *(f"degree {degree}: CPU [s]" for degree in degrees)]]
    for exponent in range(1, 9):
        target = 10.0**-exponent
        found = [recommend(result.points_of_degree(model, degree), target) for degree in degrees]
        if not any(found):
            break
        texts = ["-" if p is None else f"{p.cpu:.3g} ({mesh_words(p.elements, 3)}, {p.level})" for p in found]
        rows.append([f"{target:.0e}", *texts])
    head = f"{model}: cheapest setting of each degree for an error, that of the mesh included"
    return ["", head, as_table(rows)] if len(rows) > 1 else []


def _stubborn(cells: Sequence[Cell]) -> list[str]:
    """Return a remark on channels that finer meshes do not mend: they rule every recommendation out."""
    from hfsim.studies.bench import observed_order

    if len(cells) < 2:
        return []
    orders = {name: observed_order(cells[0], cells[-1], name) for name in cells[0].mesh_errors}
    names = [name for name, order in orders.items() if order is not None and order < _NO_ORDER]
    if not names:
        return []
    what = f"the mesh error of {', '.join(names)} hardly falls from mesh to mesh"
    return [f"  {what}; to judge by the others: --set output.channels=[...]"]


def _channel_rows(cells: Sequence[Cell]) -> list[list[str]]:
    from hfsim.studies.bench import observed_order

    rows = [[f"{cells[0].model}: mesh error (order)", *(cell.mesh for cell in cells)]]
    for name in cells[0].mesh_errors:
        texts = [brief(cells[0].mesh_errors[name])]
        for coarse, fine in pairwise(cells):
            order = observed_order(coarse, fine, name)
            texts.append(brief(fine.mesh_errors[name]) + (f" ({order:.1f})" if order is not None else ""))
        rows.append([name, *texts])
    return rows


def _enough(cell: Cell, result: Bench) -> str:
    from hfsim.studies.bench import recommend

    if not cell.mesh_error:
        return "-"
    best = recommend(result.points_of(cell), 1.1 * cell.mesh_error)
    return "-" if best is None else f"{best.method}, {best.level}: {best.cpu:.3g} s"
