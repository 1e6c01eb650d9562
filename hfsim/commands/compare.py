"""`hfsim compare`: one scene with several models; differences, run times, verdict."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.commands import interrupted
from hfsim.commands.decks import command_line, loader
from hfsim.commands.options import (
    POSITIVE,
    count_option,
    names,
    output_options,
    refuse_unknown,
    setting_options,
    talk_options,
    timing_workers_options,
)
from hfsim.output.pictures import drawn_by
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.marching.solution import Run
    from hfsim.output.runfolder import RunFolder
    from hfsim.studies.cluster import Workers
    from hfsim.studies.compare.choice import Prepared
    from hfsim.studies.compare.result import Comparison


@dataclass(frozen=True)
class Plan:
    """What is to be compared, and where the results go."""

    argument: str
    overrides: tuple[str, ...]
    prepared: Prepared
    study: Study
    folders: dict[str, RunFolder]


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
    type=POSITIVE,
    default=0.01,
    show_default=True,
    help="Largest difference of an adequate model, relative to each channel's range.",
)
@click.option(
    "--channels",
    metavar="A,B,...",
    callback=lambda _, __, text: names(text),
    help="Channels that are judged; positions, angles, deflections and elongations without it.",
)
@click.option(
    "--require", multiple=True, metavar="MODEL", help="Exit with 4 if this model misses --max-error."
)
@count_option("repeats", 3, "Time short solves so often and take the median.")
@timing_workers_options
@output_options
@setting_options("keep_all")
@click.option(
    "--error-estimate", is_flag=True, help="Let each model estimate its own time integration error too."
)
@click.option("--report", is_flag=True, help="Write all of it as one page, report.html.")
@talk_options
def compare(
    models: tuple[str, ...],
    case: str | None,
    reference: str,
    max_error: float,
    channels: tuple[str, ...],
    require: tuple[str, ...],
    repeats: int,
    workers: Workers,
    to: Destination,
    overrides: tuple[str, ...],
    error_estimate: bool,
    report: bool,
    talk: Talk,
) -> None:
    """Run one scene with each MODEL (default: linear lowOrder exact) and say which one is good enough.

    The reference is run too if it is not named. The error in time of each model is measured by a looser run
    and taken out of the difference; CPU times that cannot be told apart are ties. Beside ancf, exact makes
    its steps in body frames, so that the two check one another. Results go to '<deck name>.compare' or to
    -o DIR, with a run folder for each model. A model that breaks down is a result (exit code 0); exit code 3
    means that the reference failed, 4 that a model under --require missed the bound.
    """
    case = case or ("case.yaml" if Path("case.yaml").is_file() else "two_beams")
    plan = make_plan(case, models, reference, channels, require, overrides, to, talk)
    code = do_comparison(plan, workers, max_error, repeats, error_estimate, require, report)
    raise click.exceptions.Exit(code)


def make_plan(
    argument: str,
    models: Sequence[str],
    reference: str,
    channels: Sequence[str],
    require: Sequence[str],
    overrides: Sequence[str],
    to: Destination,
    talk: Talk,
) -> Plan:
    """Load the deck with every model and claim all folders; nothing is written yet.

    Raises
    ------
    DeckError, ChoiceError
        If the deck is bad, or a model or channel unknown.
    FolderError
        If a folder must not be written to.
    """
    from hfsim.output.runfolder import COMPARISON, claim, folder_name
    from hfsim.output.writers import Provenance
    from hfsim.parts.bodies.models import MODELS
    from hfsim.studies.compare.choice import chosen_models, prepare, usual_models

    load = loader(argument, overrides, talk)
    chosen = chosen_models(models or usual_models(load, talk.note), reference)
    refuse_unknown("model", chosen, MODELS, "; a deck goes with --case")
    for model in require:
        if model not in chosen:
            raise click.UsageError(f"--require {model}: this model is not compared")
    prepared = prepare(load, chosen, reference, channels, talk.note)
    path = to.output or Path(folder_name(prepared.decks[reference].deck.name, ".compare"))
    about = Provenance.of(prepared.decks[reference], argument, overrides).facts()
    own = claim(path, to.force, COMPARISON)
    # where the comparison there may be replaced, so may its runs
    force = to.force or bool(own.replaces)
    folders = {model: claim(path / folder_name(model, ""), force) for model in prepared.decks}
    study = Study("compare", talk, own, to.plots, about, to.format)
    return Plan(argument, tuple(overrides), prepared, study, folders)


def do_comparison(
    plan: Plan,
    workers: Workers,
    max_error: float,
    repeats: int,
    error_estimate: bool,
    require: Sequence[str],
    report: bool,
) -> int:
    """Run all models, write and tell the comparison, and return the exit code."""
    from hfsim.output.comparison import COLUMNS, as_rows, as_text, comparison_page
    from hfsim.output.progress import Progress
    from hfsim.studies.compare.result import as_facts
    from hfsim.studies.compare.study import carry_out

    plan.study.begin()
    loaded = plan.prepared.decks[plan.prepared.reference]
    with (
        workers.executor(loaded.source.texts, timing=True) as executor,
        Progress(loaded.deck.name, sys.stderr, plan.study.talk.quiet) as progress,
    ):
        take = partial(save_model, plan, progress.close)
        comparison = carry_out(plan.prepared, max_error, repeats, executor, progress, error_estimate, take)
    runs = list(comparison.runs.values())
    tables = {"compare": (COLUMNS, as_rows(comparison))}
    text = as_text(comparison, plan.study.path)
    draw = None if comparison.interrupted else drawn_by("comparison:draw_comparison", runs, comparison)
    page = partial(comparison_page, comparison, loaded.source.text) if report else None
    plan.study.publish(as_facts(comparison), tables, text, draw, page)
    return _exit_code(comparison, require)


def _exit_code(comparison: Comparison, require: Sequence[str]) -> int:
    if comparison.interrupted:
        return interrupted()
    reference = comparison.runs[comparison.reference]
    if reference.status != "done":
        print_error(f"error: the reference {comparison.reference} did not reach the end: {reference.reason}")
        return reference.exit_code or 3
    missed = [model for model in require if not comparison.result(model).adequate]
    for model in missed:
        print_error(f"error: {model} was required and missed the bound")
    lost = max(run.exit_code for run in comparison.runs.values() if run.status == "done")
    return lost or (4 if missed else 0)


def save_model(plan: Plan, wipe: Callable[[], None], model: str, run: Run) -> Run:
    """Write the folder of a run, and return the run; `wipe` clears the line for what is told."""
    from hfsim.output.extras import Extras
    from hfsim.output.recording import save_run
    from hfsim.output.runfolder import RunLog, Stopwatch
    from hfsim.output.writers import Provenance
    from hfsim.trust.validity import validity_warnings

    deck, talk = plan.prepared.decks[model], plan.study.talk
    cpu, wall = (sum((run.statistics.get(key) or {}).values()) for key in ("cpu_s", "wall_s"))
    watch = Stopwatch(cpu_start=time.process_time() - cpu, wall_start=time.perf_counter() - wall)
    provenance = Provenance.of(deck, plan.argument, (*plan.overrides, *plan.prepared.overrides[model]))
    log = RunLog(talk.detail)
    log.add(command_line())
    wanted = Extras(plan.study.plots, format=plan.study.format)
    run, summary = save_run(plan.folders[model], run, provenance, watch, log, wanted)
    wipe()
    for warning in summary["warnings"]:
        told_with_differences = validity_warnings(summary.get("models") or {}, summary.get("validity") or {})
        if warning not in (*told_with_differences, *deck.warnings):
            talk.note(f"{model}: warning: {warning}")
    if run.status not in ("done", "interrupted"):
        talk.note(f"{model}: {run.status} at t = {run.stop_time:.6g} s: {run.reason}")
    return run
