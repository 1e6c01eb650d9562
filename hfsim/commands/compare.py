"""`hfsim compare`: one scene with several models; differences, run times, verdict."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.commands import STARTED
from hfsim.commands.decks import assemble, command_line, find_deck, load_decks, provenance_of, with_numbers
from hfsim.commands.options import (
    output_options,
    repeats_option,
    setting_options,
    talk_options,
    with_settings,
)
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder
    from hfsim.run.solution import Run
    from hfsim.scene.loading import LoadedDeck
    from hfsim.scene.schema import Deck
    from hfsim.studies.compare import Comparison

_REPEAT_BELOW = 1.0
"""Solves longer than this [s of CPU] are timed once: their scatter is small and waiting is long."""


@dataclass(frozen=True)
class Plan:
    """What is to be compared, how, and where the results go."""

    argument: str
    reference: str
    decks: dict[str, LoadedDeck]
    study: Study
    folders: dict[str, RunFolder]
    overrides: tuple[str, ...]
    error_estimate: bool
    repeats: int


@click.command()
@click.argument("models", nargs=-1, metavar="[MODEL]...")
@click.option(
    "--case", metavar="DECK", help="Deck; else case.yaml here if there, else the shipped 'two_beams'."
)
@click.option(
    "--reference", default="exact", show_default=True, metavar="MODEL", help="Model that counts as true."
)
@click.option(
    "--max-error",
    type=click.FloatRange(min=0.0, min_open=True),
    default=0.01,
    show_default=True,
    help="Largest difference of an adequate model, relative to each channel's range.",
)
@click.option(
    "--require", multiple=True, metavar="MODEL", help="Exit with 4 if this model misses --max-error."
)
@repeats_option("Time short solves so often and take the median.")
@output_options
@setting_options("keep_all")
@click.option(
    "--error-estimate", is_flag=True, help="Let each model estimate its own time integration error too."
)
@talk_options
def compare(
    models: tuple[str, ...],
    case: str | None,
    reference: str,
    max_error: float,
    require: tuple[str, ...],
    repeats: int,
    to: Destination,
    overrides: tuple[str, ...],
    error_estimate: bool,
    talk: Talk,
) -> None:
    """Run one scene with each MODEL (default: linear lowOrder exact) and say which one is good enough.

    The reference is run too if it is not named. Results go to '<deck name>.compare' or to -o DIR, with
    a run folder for each model. A model that breaks down is a result (exit code 0); exit code 3 means
    that the reference failed, 4 that a model under --require missed the bound.
    """
    chosen = choose_models(models, reference, require)
    plan = make_plan(
        case or default_case(), reference, chosen, overrides, to,
        error_estimate=error_estimate, repeats=repeats, talk=talk,
    )  # fmt: skip
    raise click.exceptions.Exit(do_comparison(plan, max_error, require))


def default_case() -> str:
    """Return the deck to compare with when none is named."""
    return "case.yaml" if Path("case.yaml").is_file() else "two_beams"


def choose_models(models: Sequence[str], reference: str, require: Sequence[str]) -> tuple[str, ...]:
    """Return the models to run, each once, the reference among them.

    Raises
    ------
    click.UsageError
        If ``auto`` is named, or a required model is not to be run.
    """
    named = tuple(dict.fromkeys(models or ("linear", "lowOrder", "exact")))
    chosen = named if reference in named else (*named, reference)
    if "auto" in chosen:
        raise click.UsageError("'auto' is no model of its own; name the models to compare")
    for model in require:
        if model not in chosen:
            raise click.UsageError(f"--require {model}: this model is not compared")
    return chosen


def make_plan(
    argument: str,
    reference: str,
    models: tuple[str, ...],
    overrides: Sequence[str],
    to: Destination,
    *,
    error_estimate: bool,
    repeats: int,
    talk: Talk,
) -> Plan:
    """Load the deck with every model and claim all folders; nothing is written yet.

    Raises
    ------
    click.exceptions.Exit
        With code 2 if the deck is bad or a model unknown.
    FolderError
        If a folder must not be written to.
    """
    from hfsim.output.runfolder import claim, folder_name

    deck = str(find_deck(argument, talk))
    decks = {m: load_decks([deck], with_settings(overrides, m), talk, assemble)[0] for m in models}
    quiet = replace(talk, quiet=True)
    decks = {m: with_numbers(one, talk if m == reference else quiet) for m, one in decks.items()}
    own = own_models(decks[reference].deck)
    if own:
        talk.note(f"{own} in every run: a body's own model is not replaced")
    path = to.output or Path(folder_name(decks[reference].deck.name, ".compare"))
    about = {"overrides": list(overrides), "deck": argument}
    study = Study("compare", talk, claim(path, to.force, marker="compare.json"), to.plots, about)
    folders = {model: claim(path / folder_name(model, ""), to.force) for model in models}
    return Plan(argument, reference, decks, study, folders, tuple(overrides), error_estimate, repeats)


def own_models(deck: Deck) -> str:
    """Return which bodies have a model of their own, in words; empty if none has."""
    beams = deck.models("").items()
    return ", ".join(f"'{body}' is {model}" for body, model in beams if model)


def do_comparison(plan: Plan, max_error: float, require: Sequence[str]) -> int:
    """Run all models, write and tell the comparison, and return the exit code."""
    from hfsim.output.comparison import COLUMNS, as_rows, as_text
    from hfsim.studies.compare import as_facts
    from hfsim.studies.compare import compare as judge

    runs: list[Run] = []
    times: dict[str, list[float]] = {}
    plan.study.begin()
    for model in plan.decks:
        run, times[model] = run_model(plan, model, first=not runs)
        runs.append(run)
        if run.status == "interrupted":
            print_error(f"interrupted while {model} ran; no comparison was made")
            return 130
    comparison = judge(runs, plan.reference, max_error, times)
    tables = {"compare": (COLUMNS, as_rows(comparison))}
    text = as_text(comparison, plan.study.path)
    plan.study.publish(as_facts(comparison), tables, text, lambda to: _draw(runs, comparison, to))
    return _exit_code(runs, comparison, require)


def _draw(runs: Sequence[Run], comparison: Comparison, folder: Path) -> list[str]:
    from hfsim.output.plots import draw_comparison

    return draw_comparison(runs, comparison, folder)


def _exit_code(runs: Sequence[Run], comparison: Comparison, require: Sequence[str]) -> int:
    reference = next(run for run in runs if run.model == comparison.reference)
    if reference.status != "done":
        print_error(f"error: the reference {comparison.reference} did not reach the end: {reference.reason}")
        return reference.exit_code or 3
    missed = [model for model in require if not comparison.result(model).adequate]
    for model in missed:
        print_error(f"error: {model} was required and missed the bound")
    return 4 if missed else 0


def run_model(plan: Plan, model: str, first: bool) -> tuple[Run, list[float]]:
    """Run one model, write its folder, and return the run and the CPU times of its solves [s]."""
    from hfsim.output.progress import Progress
    from hfsim.output.recording import save_run
    from hfsim.output.runfolder import RunLog, Stopwatch
    from hfsim.simulate import simulate
    from hfsim.trust.validity import validity_warnings

    deck = plan.decks[model]
    watch = Stopwatch(wall_start=STARTED) if first else Stopwatch(cpu_start=time.process_time())
    provenance = provenance_of(deck, plan.argument, with_settings(plan.overrides, model))
    log = RunLog(plan.study.talk.detail)
    log.add(command_line())
    with Progress(f"{deck.deck.name}, {model}", sys.stderr, plan.study.talk.quiet) as progress:
        # the extent of the bodies is a scale of the comparison
        run = simulate(
            deck, model=model, progress=progress, error_estimate=plan.error_estimate, outlines=True
        )
        solves = [run.phase_cpu("solve"), *_repeated(plan, model, run)]
    run, summary = save_run(plan.folders[model], run, provenance, watch, log, plan.study.plots)
    for warning in summary["warnings"]:
        told_with_differences = validity_warnings(summary.get("models") or {}, summary.get("validity") or {})
        if warning not in (*told_with_differences, *deck.warnings):
            plan.study.talk.note(f"{model}: warning: {warning}")
    if run.status not in ("done", "interrupted"):
        plan.study.talk.note(f"{model}: {run.status} at t = {run.stop_time:.6g} s: {run.reason}")
    return run, solves


def _repeated(plan: Plan, model: str, run: Run) -> list[float]:
    from hfsim.simulate import simulate

    if run.status != "done" or run.phase_cpu("solve") > _REPEAT_BELOW:
        return []
    again = (simulate(plan.decks[model], model=model, error_estimate=False) for _ in range(plan.repeats - 1))
    return [_solve_cpu(other) for other in again]


def _solve_cpu(run: Run) -> float:
    if run.status == "interrupted":
        raise KeyboardInterrupt  # `simulate` keeps what it has; a repeat is worth nothing to keep
    return run.phase_cpu("solve")
