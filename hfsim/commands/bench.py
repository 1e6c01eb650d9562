"""`hfsim bench`: error against run time, for methods, tolerances, models and meshes of one scene."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands import interrupted
from hfsim.commands.decks import loader
from hfsim.commands.options import (
    as_usage,
    count_option,
    names,
    output_options,
    seconds,
    setting_options,
    talk_options,
    time_option,
    timing_workers_options,
)
from hfsim.output.study import Study, time_to_draw
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.bench.sweep import Sweep
    from hfsim.studies.cluster import Workers


def _words(name: str, words: str) -> Callable[[Any], Any]:
    """Return an option that takes names separated by commas."""
    return click.option(f"--{name}", metavar="A,B,...", callback=lambda _, __, text: names(text), help=words)


def _numbers(
    name: str, kind: Callable[[str], float], metavar: str, words: str, what: str = ""
) -> Callable[[Any], Any]:
    """Return an option that takes positive numbers separated by commas."""

    def read(_: click.Context, __: click.Parameter, text: str | None) -> tuple[float, ...]:
        try:
            numbers = tuple(dict.fromkeys(kind(part) for part in names(text)))
        except ValueError:
            raise click.BadParameter(f"'{text}' is no list of {what or name}") from None
        if not all(0 < number < float("inf") for number in numbers):
            raise click.BadParameter(f"'{text}': {what or name} are positive")
        return numbers

    return click.option(f"--{name}", metavar=metavar, callback=read, help=words)


_ELEMENTS = "Elements of each beam; the deck's without it. Several: mesh errors too."
_SEPARATION = "Time the ways to the elastic force (the paper's Table 1) instead; takes no DECK."
_DEGREES = (
    "Degrees of the cable elements, 3 to 12; the deck's without it. Beside --elements, meshes finer "
    "than the finest of the lowest degree are left out."
)


@click.command()
@click.argument("deck", metavar="[DECK]", required=False)
@_words("methods", "Methods; all without it.")
@_numbers("tolerances", float, "X,Y,...", "Tolerances; 1e-3 to 1e-10 by decades without it.")
@_numbers("steps", seconds, "X,Y,...", "Fixed steps [s] in their place.")
@_words("models", "Models; the deck's without it.")
@_numbers("elements", int, "N,M,...", _ELEMENTS, "element counts")
@click.option("--separation", is_flag=True, help=_SEPARATION)
@_words("element", "With --separation: kinds of element; all without it.")
@_numbers("states", int, "N,M,...", "With --separation: beams that move at once; 1 and 64 without it.")
@_numbers("degrees", int, "P,Q,...", _DEGREES)
@time_option("budget", "CPU time all may take, e.g. 90s or 2min.", "60s")
@count_option("repeats", 3, "Time short points so often and take the median.")
@timing_workers_options
@output_options
@setting_options()
@talk_options
def bench(
    deck: str | None,
    methods: tuple[str, ...],
    tolerances: tuple[float, ...],
    steps: tuple[float, ...],
    models: tuple[str, ...],
    elements: tuple[int, ...],
    separation: bool,
    element: tuple[str, ...],
    states: tuple[int, ...],
    degrees: tuple[int, ...],
    budget: float,
    repeats: int,
    workers: Workers,
    to: Destination,
    overrides: tuple[str, ...],
    talk: Talk,
) -> None:
    """Measure error against run time for the scene DECK and recommend a method and a tolerance.

    Errors are the largest over time in the worst channel, relative to the channel's range, against a
    reference made by two methods that agree; energy.total of a conservative scene is told as drift only.
    Motion, rates, forces and energies are judged apart, and the motion comes first. Errors are of time only
    unless several --elements or --degrees are given. CPU times are those of the integration alone. Results
    go to '<deck name>.bench' or to -o DIR.
    Points that fail are results (exit code 0); exit code 3 means that there is no reference, 5 that the
    budget did not suffice for a single point.

    With --separation, the forms of the elastic force (solve.elastic_form in decks) are timed,
    each evaluation and a whole run; results go to 'separation.bench'. Exit code 4: the forms disagree.
    """  # fmt: skip
    started = time.process_time()
    if separation:
        unfit = {"DECK": deck, "--methods": methods, "--tolerances": tolerances, "--steps": steps,
                 "--models": models, "--set": overrides, "--jobs": workers.jobs > 1,
                 "--dask": workers.dask or workers.config}  # fmt: skip
        _refuse_given(unfit, "does not go with --separation")
        study = Study.claim("bench", to, "separation", talk)
        raise click.exceptions.Exit(
            do_separation(elements, element, states, repeats, budget, started, study)
        )
    _refuse_given({"--element": element, "--states": states}, "goes with --separation only")
    if deck is None:
        raise click.UsageError("Missing argument 'DECK' (or --separation)")
    from hfsim.output.api import without_blind
    from hfsim.output.writers import Provenance
    from hfsim.simulate import check
    from hfsim.studies.bench.sweep import Sweep

    seen = without_blind(loader(deck, overrides, talk)(()), models, talk.note)
    loaded = seen.with_numbers(talk.note)
    check(loaded)
    with as_usage():
        sweep = Sweep(methods, models, tolerances, steps, elements, degrees, repeats).completed(loaded)
    about = Provenance.of(loaded, deck, seen.overrides).facts()
    study = Study.claim("bench", to, loaded.deck.name, talk, about)
    raise click.exceptions.Exit(do_bench(loaded, sweep, workers, budget, started, study))


def _refuse_given(options: Mapping[str, object], why: str) -> None:
    for name, value in options.items():
        if value:
            raise click.UsageError(f"{name} {why}")


def do_bench(
    loaded: LoadedDeck, sweep: Sweep, workers: Workers, seconds: float, started: float, study: Study
) -> int:
    """Run the study, write and tell it, and return the exit code."""
    from hfsim.marching.stop import Budget
    from hfsim.output.bench import publish_bench
    from hfsim.output.progress import Progress
    from hfsim.studies.bench.study import bench as measure

    study.begin()
    drawing = time_to_draw(study.plots, seconds)
    with (
        workers.executor(loaded.source.texts, timing=True) as executor,
        Progress(f"{loaded.deck.name}, bench", sys.stderr, study.talk.quiet) as progress,
    ):
        budget = Budget(seconds - drawing, time.process_time, started, progress)
        result = measure(loaded, sweep, budget, executor, drawing)
    publish_bench(result, study)
    if result.status == "interrupted":
        return interrupted()
    for cell in result.cells:
        if cell.status != "done":
            print_error(f"{cell.model}, {cell.mesh}: no reference: {cell.reason}")
    if result.status == "limit":
        print_error(f"error: the budget of {result.budget:g} s did not suffice for a single point")
    return {"done": 0, "failed": 3, "limit": 5}[result.status]


def do_separation(
    elements: Sequence[int],
    named: Sequence[str],
    states: Sequence[int],
    repeats: int,
    seconds: float,
    started: float,
    study: Study,
) -> int:
    """Time the forms of the elastic force, write and tell that, and return the exit code."""
    from hfsim.marching.stop import Budget
    from hfsim.output.progress import Progress
    from hfsim.output.separation import publish_separation
    from hfsim.studies.separation.measure import known_kinds, measure

    with as_usage():
        kinds = known_kinds(named)
    study.begin()
    with Progress("matrix separation", sys.stderr, study.talk.quiet) as progress:
        budget = Budget(seconds, time.process_time, started, progress)
        result = measure(elements, kinds, repeats, budget, states)
    publish_separation(result, study)
    for sentence in result.disagreements:
        print_error(sentence)
    if result.status == "interrupted":
        return interrupted()
    return {"done": 0, "wrong": 4}[result.status]
