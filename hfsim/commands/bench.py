"""`hfsim bench`: error against run time, for methods, tolerances, models and meshes of one scene."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from hfsim.commands import bench_separation
from hfsim.commands.decks import assemble, load_numbered, provenance_of
from hfsim.commands.options import (
    names,
    output_options,
    refuse_unknown,
    setting_options,
    talk_options,
    time_option,
)
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.bench import Bench, Sweep

_DRAWING = (2.0, 0.1)
"""Time kept back for pictures: so many seconds, at most this part of the budget."""
_Number = TypeVar("_Number", int, float)


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
            repeats=repeats, seconds=budget, started=started,
            study=Study.claim("bench", to, "separation", talk),
        )  # fmt: skip
        raise click.exceptions.Exit(bench_separation.do_separation(plan))
    _refuse_given({"--element": element, "--states": states}, "goes with --separation only")
    if deck is None:
        raise click.UsageError("Missing argument 'DECK' (or --separation)")
    if tolerances and steps:
        raise click.UsageError("give --tolerances or --steps, not both")
    loaded = load_numbered(deck, overrides, talk)
    assemble(loaded)
    levels = (tolerances, steps)
    sweep = make_sweep(loaded, names(methods), levels, names(models), (elements, degrees), repeats)
    about = provenance_of(loaded, deck, overrides).facts()
    study = Study.claim("bench", to, loaded.deck.name, talk, about)
    raise click.exceptions.Exit(do_bench(loaded, sweep, budget, started, study))


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


def do_bench(loaded: LoadedDeck, sweep: Sweep, seconds: float, started: float, study: Study) -> int:
    """Run the study, write and tell it, and return the exit code."""
    from hfsim.output.bench import COLUMNS, as_rows, as_text
    from hfsim.output.progress import Progress
    from hfsim.run.stop import Budget
    from hfsim.studies.bench import as_facts
    from hfsim.studies.bench import bench as measure

    study.begin()
    drawing = min(_DRAWING[0], _DRAWING[1] * seconds) if study.plots else 0.0
    with Progress(f"{loaded.deck.name}, bench", sys.stderr, study.talk.quiet) as progress:
        result = measure(loaded, sweep, Budget(seconds - drawing, start=started, report=progress))
    tables = {"bench": (COLUMNS, as_rows(result))}
    study.publish(as_facts(result), tables, as_text(result, study.path), lambda to: _draw(result, to))
    return _exit_code(result)


def _draw(result: Bench, folder: Path) -> list[str]:
    from hfsim.output.plots import draw_bench

    return draw_bench(result, folder)


def _exit_code(result: Bench) -> int:
    if result.status == "interrupted":
        print_error("interrupted; what was measured until then is kept")
        return 130
    for cell in result.cells:
        if cell.status != "done":
            print_error(f"{cell.model}, {cell.mesh}: no reference: {cell.reason}")
    return 3 if result.status == "failed" else 0
