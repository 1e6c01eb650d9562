"""`hfsim stability`: maps of where methods and models hold, for one scene over one or two axes."""

from __future__ import annotations

import sys
import textwrap
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands.decks import find_deck, load_decks, with_numbers
from hfsim.commands.options import (
    jobs_option,
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
    from hfsim.studies.axes import Axis
    from hfsim.studies.limits import Limit, Limits
    from hfsim.studies.stability import MapPoint, Plan, StabilityMap

MARKER = "stability.json"
"""File whose presence means that the results in a folder are whole."""
_DRAWING = (2.0, 0.1)
"""Time kept back for pictures: so many seconds, at most this part of the budget."""
_MOST_AXES = 2
_DEFAULT_MODELS = ("linear", "lowOrder", "exact")


@dataclass(frozen=True)
class Order:
    """What is to be mapped and where the results go."""

    argument: str
    deck: LoadedDeck
    plan: Plan
    bisect: float | None
    ending: str
    folder: RunFolder
    overrides: tuple[str, ...]
    plots: bool
    talk: Talk


def _named_axis(name: str, words: str) -> Callable[[Any], Any]:
    option = name if name in ("amplitude", "slenderness", "step", "elements") else f"scale-{name}"
    return click.option(f"--{option}", name, metavar="VALUES", help=words)


@click.command()
@click.argument("deck", metavar="DECK")
@click.option(
    "--vary",
    multiple=True,
    metavar="PATH=VALUES",
    help="An axis: any entry of the deck; VALUES as log(1e5,1e12,8), lin(0,1,5) or 1,2,5.",
)
@_named_axis("stiffness", "An axis: factor on all moduli and spring stiffnesses.")
@_named_axis("speed", "An axis: factor on initial velocities and on the rates of drivers.")
@_named_axis("amplitude", "An axis: factor on loads, initial angles and the amplitudes of drivers.")
@_named_axis("slenderness", "An axis: length over section height of every beam.")
@_named_axis("step", "An axis: fixed step [s].")
@_named_axis("elements", "An axis: elements of every beam.")
@click.option("--methods", metavar="A,B,...", help="Methods, auto among them; all without it.")
@click.option("--models", metavar="A,B,...", help="Models; linear, lowOrder and exact without it.")
@click.option(
    "--max-error",
    type=click.FloatRange(min=0.0, min_open=True),
    default=1e-2,
    show_default=True,
    help="Time or model error, over each channel's range, beyond which a point is wrong.",
)
@click.option(
    "--max-drift",
    type=click.FloatRange(min=0.0, min_open=True),
    default=1e-3,
    show_default=True,
    help="Energy drift beyond which a point is wrong.",
)
@click.option(
    "--bisect",
    type=click.FloatRange(min=1e-6, max=1.0),
    metavar="WIDTH",
    help="Locate along the one axis where a class ends, to this relative width.",
)
@click.option(
    "--ending",
    default="accurate",
    show_default=True,
    type=click.Choice(["accurate", "wrong", "numerical", "model", "physical"]),
    help="Class whose end --bisect locates.",
)
@click.option(
    "--limits",
    "measure",
    is_flag=True,
    help="Instead of a map: the longest stable step of each method, beside linear theory.",
)
@time_option("budget", "Time all may take, e.g. 90s or 2min.", "60s")
@time_option("limit", "Time one point may take; references three times as much.", "20s")
@jobs_option
@output_options
@setting_options()
@talk_options
def stability(
    deck: str,
    vary: tuple[str, ...],
    methods: str | None,
    models: str | None,
    max_error: float,
    max_drift: float,
    bisect: float | None,
    ending: str,
    measure: bool,
    budget: float,
    limit: float,
    jobs: int,
    to: Destination,
    overrides: tuple[str, ...],
    talk: Talk,
    **named: str | None,
) -> None:
    """Map where methods and models hold for the scene DECK, over one or two axes.

    Every point is put into a class: accurate; wrong (completed, but an error or the energy drift is beyond
    its bound); numerical, model, physical or deck (failed, and what makes it: the classes of 'hfsim run';
    physical also where the scene itself is unstable). The time error is the distance to the same model
    solved by gauss at tolerance 1e-8, the model error the distance of that solution to exact's. A failed
    point is a result (exit code 0). Results go to '<deck name>.stability' or to -o DIR.
    """  # fmt: skip
    started = time.perf_counter()
    loaded = with_numbers(load_decks([str(find_deck(deck, talk))], overrides, talk, lambda _: None)[0], talk)
    axes = read_axes(vary, named)
    drawing = 0.0 if not to.plots else min(_DRAWING[0], _DRAWING[1] * budget)
    spent = time.perf_counter() - started
    plan = make_plan(
        axes, names(methods), names(models), (max_error, max_drift), budget - drawing - spent, limit, jobs
    )
    refuse_bisection(bisect, axes)
    if measure and axes:
        raise click.UsageError("--limits takes no axis; change the deck with --set")
    folder = claim_study("stability", to, loaded.deck.name)
    order = Order(deck, loaded, plan, bisect, ending, folder, overrides, to.plots, talk)
    raise click.exceptions.Exit(do_limits(order, names(models)) if measure else do_map(order))


def read_axes(vary: Sequence[str], named: dict[str, str | None]) -> tuple[Axis, ...]:
    """Return the axes asked for.

    Raises
    ------
    click.UsageError
        If one cannot be read or there are more than two.
    """
    from hfsim.studies import axes

    try:
        found = [axes.vary(text) for text in vary]
        found += [axes.NAMED[name](text) for name, text in named.items() if text is not None]
    except axes.AxisError as error:
        raise click.UsageError(str(error)) from None
    if len(found) > _MOST_AXES:
        raise click.UsageError(f"{len(found)} axes; a map has one or two")
    if len({axis.name for axis in found}) < len(found):
        raise click.UsageError(f"two axes vary {found[0].name}")
    return tuple(found)


def make_plan(
    axes: tuple[Axis, ...],
    methods: tuple[str, ...],
    models: tuple[str, ...],
    bounds: tuple[float, float],
    seconds: float,
    limit: float,
    jobs: int,
) -> Plan:
    """Return what is mapped, with the defaults filled in.

    Raises
    ------
    click.UsageError
        If a name is unknown.
    """
    from hfsim.integrators import METHODS
    from hfsim.parts.bodies.models import MODELS
    from hfsim.studies.judge import Bounds
    from hfsim.studies.stability import Plan

    refuse_unknown("method", methods, [*METHODS, "auto"])
    refuse_unknown("model", models, MODELS)
    return Plan(
        axes=axes, methods=methods or tuple(METHODS), models=models or _DEFAULT_MODELS,
        bounds=Bounds(*bounds), seconds=max(seconds, 0.0), limit=limit, jobs=jobs,
    )  # fmt: skip


def refuse_bisection(width: float | None, axes: Sequence[Axis]) -> None:
    """Refuse to bisect along anything but one axis of several numbers.

    Raises
    ------
    click.UsageError
    """
    if width is None:
        return
    if len(axes) != 1 or not axes[0].numeric or len(axes[0].values) < 2:
        raise click.UsageError("--bisect needs one axis with two numbers or more")
    if axes[0].name == "elements":
        raise click.UsageError("--bisect needs an axis without gaps, not elements")


def do_map(order: Order) -> int:
    """Run the study, write and tell it, and return the exit code."""
    from hfsim.output.progress import Progress
    from hfsim.studies.axes import AxisError
    from hfsim.studies.stability import stability_map

    label = f"{order.deck.deck.name}, stability"
    with Progress(label, sys.stderr, order.talk.quiet) as progress:
        try:
            result = stability_map(order.deck, order.plan, order.bisect, progress, order.ending)
        except AxisError as error:
            raise click.UsageError(str(error)) from None
    order.talk.facts(save_map(order, result))
    order.talk.result(as_text(result, order.folder.path, order.talk.verbose, order.ending))
    if result.status == "interrupted":
        print_error("interrupted; what was computed until then is kept")
        return 130
    return 0


def save_map(order: Order, result: StabilityMap) -> dict[str, Any]:
    """Write stability.csv, the plots and, last, stability.json; return what is in the latter."""
    from hfsim.output.runfolder import disk
    from hfsim.output.writers import write_table
    from hfsim.studies.stability import as_facts, as_rows, csv_columns

    path = order.folder.path
    order.folder.prepare()
    with disk(path):
        write_table(path / "stability.csv", as_rows(result), csv_columns(result))
        files = ["stability.csv", MARKER, *_pictures(order, result)]
        return _write_facts(order, as_facts(result), files)


def _write_facts(order: Order, facts: dict[str, Any], files: list[str]) -> dict[str, Any]:
    """Write stability.json with where it comes from; return what is in it."""
    from hfsim.output.writers import json_ready, versions, write_json

    about = {
        "deck": order.argument,
        "deck_sha256": order.deck.deck_sha256,
        "overrides": list(order.overrides),
        "versions": versions(),
        "files": files,
    }
    plain, _ = json_ready({**facts, **about})
    write_json(order.folder.path / MARKER, plain)
    return dict(plain)


def _pictures(order: Order, result: StabilityMap) -> list[str]:
    if not order.plots or not result.axes:
        return []
    from hfsim.output.plots import draw_stability

    return [f"plots/{name}" for name in draw_stability(result, order.folder.path / "plots")]


# --- longest stable steps ------------------------------------------------------------------------


def do_limits(order: Order, models: tuple[str, ...]) -> int:
    """Measure the longest stable steps with the models named, or the deck's; write and tell them."""
    from hfsim.output.runfolder import disk
    from hfsim.output.writers import write_table
    from hfsim.studies.limits import LIMIT_COLUMNS, limits

    plan, deadline = order.plan, time.perf_counter() + order.plan.seconds
    results, wanted = [], models or (order.deck.deck.solve.model,)
    for k, model in enumerate(wanted):
        share = (deadline - time.perf_counter()) / (len(wanted) - k)
        results.append(limits(order.deck, model, plan.methods, share, plan.limit, plan.jobs))
    order.folder.prepare()
    with disk(order.folder.path):
        rows = [{"model": r.model, **one.facts()} for r in results for one in r.limits]
        write_table(order.folder.path / "limits.csv", rows, LIMIT_COLUMNS)
        facts = {"status": "done", "results": [r.facts() for r in results]}
        order.talk.facts(_write_facts(order, facts, ["limits.csv", MARKER]))
    for result in results:
        order.talk.result(limits_text(result))
    order.talk.result(f"\n  results: {order.folder.path}/")
    return 0


def limits_text(result: Limits) -> str:
    """Return frequencies, growing motions and the table of longest stable steps."""
    first = result.spectra[0]
    blocks = [
        f"{result.name}, {result.model}: fastest period {first.period:.4g} s, slowest frequency "
        f"{first.slowest:.4g} rad/s at the start",
        _growing(result),
    ]
    rows = [["method", "longest stable step", "theory", "off by", "what ends it"]]
    for one in result.limits:
        title = f"{one.method} {one.order}" if one.order else one.method
        title += f" ({one.stages} stages)" if one.stages else ""
        off = "-" if one.deviation is None else f"{100 * one.deviation:+.2g} %"
        predicted = "any" if one.predicted is None else f"{one.predicted:.4g} T"
        rows.append([title, _longest(one), predicted, off, one.reason[:60] or "-"])
    blocks.append("T: fastest period\n" + as_table(rows))
    said = [f"{one.method}: {one.words}" for one in result.limits]
    lost = [f"{name}: not measured: {why}" for name, why in result.lost.items()]
    blocks.append(
        "\n".join(
            textwrap.fill(line, 110, initial_indent="  ", subsequent_indent="    ") for line in said + lost
        )
    )
    return "\n".join(block for block in blocks if block)


def _longest(one: Limit) -> str:
    if one.longest is None:
        return f"below {one.beyond:.3g} T" if one.beyond else "no step tried to its end"
    if one.beyond is None:
        return f"above {one.longest:.3g} T"
    if one.beyond > 1.02 * one.longest:
        return f"{one.longest:.3g} to {one.beyond:.3g} T"
    return f"{one.longest:.4g} T"


def _growing(result: Limits) -> str:
    """Return whether the linearised scene has growing motions, and where along the motion."""
    growing = [s for s in result.spectra if s.growth > 0.0]
    count = len(result.spectra)
    if not growing:
        return f"  no growing motion in {count} states along the run"
    worst = max(growing, key=lambda s: s.growth)
    return (
        f"  linearised, motions grow in {len(growing)} of {count} states along the run, fastest by "
        f"{worst.growth:.3g}/s at {worst.time:.3g} s\n  (an instability where the state lasts; "
        "elsewhere a state passed through)"
    )


# --- text ----------------------------------------------------------------------------------------


def as_text(result: StabilityMap, folder: Path, verbose: bool = False, ending: str = "accurate") -> str:
    """Return the study as people read it: the classes over the axes, the ends of classes, the reasons."""
    from hfsim.studies.stability import summary

    head = f"{result.name}: {summary(result)}; {result.used:.3g} s used"
    bounds = f"  bounds: error {result.bounds.error:g}, energy drift {result.bounds.drift:g}"
    blocks = [f"{head}\n{bounds}", *_tables(result)]
    if result.boundaries:
        blocks.append(_boundaries(result, ending))
    blocks.append(_reasons(result, verbose))
    return "\n\n".join([*(block for block in blocks if block), f"  results: {folder}/"])


def _tables(result: StabilityMap) -> list[str]:
    if len(result.axes) == 2:
        return [_grid(result, model, method) for model, method in result.rows()]
    return [_list(result)]


def _list(result: StabilityMap) -> str:
    """Return one line for each point, errors beside the class."""
    labels = [name for name, _, _ in result.axes]
    rows = [["model", "method", *labels, "class", "time error", "model error", "drift", "steps", "CPU [s]"]]
    for p in result.points:
        v = p.verdict
        values = [_word(value) for value in p.values]
        found = [brief(number) for number in (v.time_error, v.model_error, v.energy_drift)]
        cost = [str(p.steps or "-"), f"{p.cpu:.2g}" if p.cpu else "-"]
        rows.append([p.model, p.method, *values, p.outcome, *found, *cost])
    return as_table(rows)


def _word(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _grid(result: StabilityMap, model: str, method: str) -> str:
    (down, rows, _), (across, columns, _) = result.axes
    points = result.points_of(model, method)
    head = [f"{down} \\ {across}", *(_word(c) for c in columns)]
    table = [[_word(r), *(points[r, c].outcome for c in columns)] for r in rows]
    return f"{model}, {method}\n" + as_table([head, *table])


def _boundaries(result: StabilityMap, ending: str) -> str:
    name = result.axes[0][0]
    rows = [["model", "method", f"{name}: last", "first", "class", "then"]]
    rows += [
        [b.model, b.method, f"{b.below:.5g}", f"{b.above:.5g}", b.class_below, b.class_above]
        for b in result.boundaries
    ]
    return f"where '{ending}' ends along {name}\n" + as_table(rows)


def _reasons(result: StabilityMap, verbose: bool) -> str:
    """Return why points are not accurate: of each class the first one of every model and method, or all."""
    told: dict[tuple[str, str, str], MapPoint] = {}
    lines = []
    for p in result.points:
        key = (p.model, p.method, p.outcome)
        if p.outcome == "accurate" or (key in told and not verbose):
            continue
        told[key] = p
        at = ", ".join(f"{n} {_word(v)}" for (n, _, _), v in zip(result.axes, p.values, strict=True))
        text = f"{p.model}, {p.method}{', ' + at if at else ''}: {p.outcome}: {p.verdict.reason}"
        lines.append(textwrap.fill(text, 110, initial_indent="  ", subsequent_indent="    "))
    return "\n".join(lines)
