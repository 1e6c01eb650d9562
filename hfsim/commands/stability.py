"""`hfsim stability`: maps of where methods and models hold, for one scene over one or two axes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands.decks import (
    find_deck,
    load_decks,
    usual_models,
    with_numbers,
    without_blind_channels,
)
from hfsim.commands.options import (
    POSITIVE,
    Finite,
    names,
    output_options,
    refuse_unknown,
    setting_options,
    talk_options,
    time_option,
    workers_options,
)
from hfsim.output.pictures import drawn_by
from hfsim.output.study import Study, time_to_draw
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.axes import Axis
    from hfsim.studies.cluster import Workers
    from hfsim.studies.farm import Executor
    from hfsim.studies.stability.results import Plan

_MOST_AXES = 2


def _named_axis(name: str, words: str) -> Callable[[Any], Any]:
    option = name if name in ("amplitude", "slenderness", "step", "elements") else f"scale-{name}"
    return click.option(f"--{option}", name, metavar="VALUES", help=words)


def _bound(name: str, default: float, words: str) -> Callable[[Any], Any]:
    return click.option(f"--{name}", type=POSITIVE, default=default, show_default=True, help=words)


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
@_bound("max-error", 1e-2, "Time or model error, over each channel's range, beyond which a point is wrong.")
@_bound("max-drift", 1e-3, "Energy drift beyond which a point is wrong.")
@click.option(
    "--bisect",
    type=Finite(min=1e-6, max=1.0),
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
@time_option(
    "budget", "Time all may take, e.g. 90s or 2min; a first point is computed however long it takes.", "60s"
)
@time_option("limit", "Time one point may take; references three times as much.", "20s")
@workers_options
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
    workers: Workers,
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
    overrides = (*overrides, *without_blind_channels(deck, overrides, names(models), talk))
    loaded = with_numbers(load_decks([str(find_deck(deck, talk))], overrides, talk, lambda _: None)[0], talk)
    axes = read_axes(vary, named)
    drawing = time_to_draw(to.plots, budget)
    spent = time.perf_counter() - started
    chosen = names(models) or (() if measure else usual_models(deck, overrides, talk))
    plan = make_plan(
        axes, names(methods), chosen, (max_error, max_drift), budget - drawing - spent, limit, workers.jobs
    )
    refuse_bisection(bisect, axes)
    if measure and axes:
        raise click.UsageError("--limits takes no axis; change the deck with --set")
    from hfsim.output.writers import Provenance

    about = Provenance.of(loaded, deck, overrides).facts()
    study = Study.claim("stability", to, loaded.deck.name, talk, about)
    with workers.executor(loaded.source.texts) as executor:
        if measure:
            raise click.exceptions.Exit(do_limits(loaded, plan, study, names(models), executor))
        raise click.exceptions.Exit(do_map(loaded, plan, study, bisect, ending, executor))


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
    from hfsim.studies.stability.results import Plan
    from hfsim.studies.stability.verdict import Bounds

    refuse_unknown("method", methods, [*METHODS, "auto"])
    refuse_unknown("model", models, MODELS)
    return Plan(
        axes=axes, methods=methods or tuple(METHODS), models=models,
        bounds=Bounds(*bounds), seconds=max(seconds, 0.0), limit=limit, jobs=jobs,
    )  # fmt: skip


def refuse_bisection(width: float | None, axes: Sequence[Axis]) -> None:
    """Refuse to bisect along anything but one axis of several numbers: raise `click.UsageError`."""
    if width is None:
        return
    if len(axes) != 1 or not axes[0].numeric or len(axes[0].values) < 2:
        raise click.UsageError("--bisect needs one axis with two numbers or more")
    if axes[0].name == "elements":
        raise click.UsageError("--bisect needs an axis without gaps, not elements")


def do_map(
    loaded: LoadedDeck, plan: Plan, study: Study, bisect: float | None, ending: str, executor: Executor
) -> int:
    """Run the study, write and tell it, and return the exit code."""
    from hfsim.output import stability as report
    from hfsim.output.progress import Progress
    from hfsim.studies.axes import AxisError
    from hfsim.studies.stability.maps import stability_map

    with Progress(f"{loaded.deck.name}, stability", sys.stderr, study.talk.quiet) as progress:
        try:
            result = stability_map(loaded, plan, bisect, progress, ending, executor)
        except AxisError as error:
            raise click.UsageError(str(error)) from None
    study.publish(
        report.map_facts(result),
        {"stability": (report.map_columns(result), result.points)},
        report.map_text(result, study.path, study.talk.verbose, ending),
        drawn_by("stability:draw_stability", result),
    )
    return _exit_code(result.status)


def _exit_code(status: str) -> int:
    if status == "interrupted":
        print_error("interrupted; what was computed until then is kept")
        return 130
    return 0


def do_limits(
    loaded: LoadedDeck, plan: Plan, study: Study, models: tuple[str, ...], executor: Executor
) -> int:
    """Measure the longest stable steps with the models named, or the deck's; return the exit code."""
    from hfsim.output import limits as report
    from hfsim.studies.limits import limits

    deadline = time.perf_counter() + plan.seconds
    results, wanted = [], models or (loaded.deck.solve.model,)
    for k, model in enumerate(wanted):
        share = (deadline - time.perf_counter()) / (len(wanted) - k)
        results.append(limits(loaded, model, plan.methods, share, plan.limit, plan.jobs, executor))
        if results[-1].interrupted:
            break
    status = "interrupted" if results[-1].interrupted else "done"
    rows = [{"model": result.model, **one.facts()} for result in results for one in result.limits]
    study.publish(
        {"status": status, "results": [result.facts() for result in results]},
        {"limits": (report.LIMIT_COLUMNS, rows)},
        report.limits_text(results, study.path),
    )
    return _exit_code(status)
