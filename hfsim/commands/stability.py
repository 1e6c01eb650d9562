"""`hfsim stability`: maps of where methods and models hold, for one scene over one or two axes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands import interrupted
from hfsim.commands.decks import load_decks
from hfsim.commands.options import (
    POSITIVE,
    Finite,
    as_usage,
    names,
    output_options,
    setting_options,
    talk_options,
    time_option,
    workers_options,
)
from hfsim.output.study import Study, time_to_draw
from hfsim.output.talk import Destination, Talk

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.axes import Axis
    from hfsim.studies.cluster import Workers
    from hfsim.studies.farm import Executor
    from hfsim.studies.stability.asked import Plan

def _option(name: str) -> str:
    return f"--scale-{name}" if name in ("stiffness", "speed") else f"--{name}"


def _named_axis(name: str, words: str) -> Callable[[Any], Any]:
    return click.option(_option(name), name, metavar="VALUES", help=words)


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
@_named_axis("stiffness", "An axis: factor on moduli, and stiffness of sections, springs and stops.")
@_named_axis("speed", "An axis: factor on initial velocities and on the rates of drivers.")
@_named_axis("amplitude", "An axis: factor on loads, initial angles and how far drivers go.")
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
    solved by gauss at tolerance 1e-8, the model error the distance of that solution to exact's. Where points
    are far off, these references are checked by a second solution, or tightened. A failed
    point is a result (exit code 0). Results go to '<deck name>.stability' or to -o DIR.
    """  # fmt: skip
    from hfsim.output.api import without_blind
    from hfsim.output.writers import Provenance
    from hfsim.studies.compare.choice import usual_models
    from hfsim.studies.stability.asked import Plan
    from hfsim.studies.stability.verdict import Bounds

    started = time.perf_counter()
    seen = without_blind(load_decks([deck], overrides, talk)[0], names(models), talk.note)
    loaded = seen.with_numbers(talk.note)
    with as_usage():
        plan = Plan(
            read_axes(vary, named), names(methods), names(models), Bounds(max_error, max_drift),
            budget, limit, bisect=bisect, ending=ending,
        )  # fmt: skip
        if measure and plan.axes:
            raise click.UsageError("--limits takes no axis; change the deck with --set")
        usual = plan.models or (loaded.deck.solve.model,)
        if not (measure or plan.models):
            usual = usual_models(loaded.changed, talk.note)
        plan = plan.completed(usual, time.perf_counter() - started + time_to_draw(to.plots, budget))
    about = Provenance.of(loaded, deck, seen.overrides).facts()
    study = Study.claim("stability", to, loaded.deck.name, talk, about)
    with workers.executor(loaded.source.texts) as executor:
        do = do_limits if measure else do_map
        raise click.exceptions.Exit(do(loaded, plan, study, executor))


def read_axes(vary: Sequence[str], named: Mapping[str, str | None]) -> tuple[Axis, ...]:
    """Return the axes asked for."""
    from hfsim.studies import axes
    from hfsim.studies.stability.asked import axes_of

    said: list[tuple[str, Callable[[str], Axis], str]] = [("--vary", axes.vary, text) for text in vary]
    said += [(_option(name), axes.NAMED[name], text) for name, text in named.items() if text is not None]
    return axes_of(said)


def do_map(loaded: LoadedDeck, plan: Plan, study: Study, executor: Executor) -> int:
    """Run the study, write and tell it, and return the exit code."""
    from hfsim.output.progress import Progress
    from hfsim.output.stability import publish_map
    from hfsim.studies.stability.maps import stability_map

    with as_usage(), Progress(f"{loaded.deck.name}, stability", sys.stderr, study.talk.quiet) as progress:
        result = stability_map(loaded, plan, executor, progress)
    publish_map(result, study, plan.ending)
    return interrupted() if result.status == "interrupted" else 0


def do_limits(loaded: LoadedDeck, plan: Plan, study: Study, executor: Executor) -> int:
    """Measure the longest stable steps; return the exit code."""
    from hfsim.output.limits import publish_limits
    from hfsim.studies.limits import limits_of_models

    results = limits_of_models(loaded, plan, executor)
    return interrupted() if publish_limits(results, study) == "interrupted" else 0
