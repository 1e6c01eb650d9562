"""`hfsim compare`: one scene with several models; differences, run times, verdict."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hfsim.commands import STARTED
from hfsim.commands.decks import (
    assemble,
    command_line,
    find_deck,
    load_decks,
    usual_models,
    with_numbers,
    without_blind_channels,
)
from hfsim.commands.options import (
    names,
    output_options,
    refuse_unknown,
    repeats_option,
    setting_options,
    talk_options,
    with_settings,
)
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk, print_error

if TYPE_CHECKING:
    from hfsim.marching.solution import Run
    from hfsim.output.runfolder import RunFolder
    from hfsim.scene.loading import LoadedDeck
    from hfsim.scene.schema import Deck
    from hfsim.studies.compare import Comparison, Measured

_MOST_IN_FRAMES = 400
"""Unknowns up to which steps are made in body frames for the sake of a check: they take dense matrices."""


@dataclass(frozen=True)
class Plan:
    """What is to be compared, how, and where the results go."""

    argument: str
    reference: str
    decks: dict[str, LoadedDeck]
    study: Study
    folders: dict[str, RunFolder]
    overrides: Mapping[str, tuple[str, ...]]
    channels: tuple[str, ...]
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
    "--channels",
    metavar="A,B,...",
    callback=lambda _, __, text: names(text),
    help="Channels that are judged; positions, angles, deflections and elongations without it.",
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
    channels: tuple[str, ...],
    require: tuple[str, ...],
    repeats: int,
    to: Destination,
    overrides: tuple[str, ...],
    error_estimate: bool,
    talk: Talk,
) -> None:
    """Run one scene with each MODEL (default: linear lowOrder exact) and say which one is good enough.

    The reference is run too if it is not named. The error in time of each model is measured by a looser run
    and taken out of the difference; CPU times that cannot be told apart are ties. Beside ancf, exact makes
    its steps in body frames, so that the two check one another. Results go to '<deck name>.compare' or to
    -o DIR, with a run folder for each model. A model that breaks down is a result (exit code 0); exit code 3
    means that the reference failed, 4 that a model under --require missed the bound.
    """
    case = case or default_case()
    if not models:
        models = usual_models(case, overrides, talk)
    chosen = choose_models(models, reference, require)
    plan = make_plan(
        case, reference, chosen, channels, overrides, to,
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
    named = tuple(dict.fromkeys(models))
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
    channels: tuple[str, ...],
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
    settings = {m: with_settings(overrides, m) for m in models}
    settings = {m: (*own, *without_blind_channels(deck, own, (m,), talk)) for m, own in settings.items()}
    decks = {m: load_decks([deck], settings[m], talk, assemble)[0] for m in models}
    refuse_unjudged(channels, decks[reference].deck)
    if {"exact", "ancf"} <= set(models) and frames_serve(decks["exact"], talk):
        settings["exact"] += ("solve.coordinates=frame",)
        decks["exact"] = load_decks([deck], settings["exact"], talk, assemble)[0]
    quiet = replace(talk, quiet=True)
    decks = {m: with_numbers(one, talk if m == reference else quiet) for m, one in decks.items()}
    kept = own_models(decks[reference].deck)
    if kept:
        talk.note(f"{kept} in every run: a body's own model is not replaced")
    path = to.output or Path(folder_name(decks[reference].deck.name, ".compare"))
    about = {"overrides": list(overrides), "deck": argument}
    own = claim(path, to.force, marker="compare.json")
    study = Study("compare", talk, own, to.plots, about)
    # where the comparison there may be replaced, so may its runs
    force = to.force or bool(own.replaces)
    folders = {model: claim(path / folder_name(model, ""), force) for model in models}
    return Plan(argument, reference, decks, study, folders, settings, channels, error_estimate, repeats)


def refuse_unjudged(channels: Sequence[str], deck: Deck) -> None:
    """Refuse to judge by channels that the deck does not have or that are residuals.

    Raises
    ------
    click.UsageError
    """
    from hfsim.parts.channels import is_judged

    if channels:
        refuse_unknown("channel", channels, deck.channels)
    for name in channels:
        if not is_judged(name, conserved=False):
            raise click.UsageError(f"--channels {name}: it has residuals of the joints, not results")


def frames_serve(loaded: LoadedDeck, talk: Talk) -> bool:
    """Return whether steps of exact can be made in body frames where the deck leaves that open."""
    from hfsim.integrators import steps_in_absolute_coordinates
    from hfsim.simulate import check

    solve = loaded.deck.solve
    if solve.coordinates != "auto" or steps_in_absolute_coordinates(solve.method):
        return False
    unknowns = check(loaded)["unknowns"]
    if unknowns > _MOST_IN_FRAMES:
        talk.note(f"exact makes no steps in body frames: {unknowns} unknowns are too many for dense matrices")
    return bool(unknowns <= _MOST_IN_FRAMES)


def own_models(deck: Deck) -> str:
    """Return which bodies have a model of their own, in words; empty if none has."""
    beams = deck.models("").items()
    return ", ".join(f"'{body}' is {model}" for body, model in beams if model)


def do_comparison(plan: Plan, max_error: float, require: Sequence[str]) -> int:
    """Run all models, write and tell the comparison, and return the exit code."""
    from hfsim.output.comparison import COLUMNS, as_rows, as_text
    from hfsim.studies.compare import Measured, as_facts
    from hfsim.studies.compare import compare as judge

    runs: list[Run] = []
    found = Measured()
    plan.study.begin()
    ended = _run_all(plan, runs, found)
    comparison = judge(runs, plan.reference, max_error, found, plan.channels, interrupted=not ended)
    tables = {"compare": (COLUMNS, as_rows(comparison))}
    text = as_text(comparison, plan.study.path)
    draw = partial(_draw, runs, comparison) if ended else None
    plan.study.publish(as_facts(comparison), tables, text, draw)
    return _exit_code(runs, comparison, require)


def _run_all(plan: Plan, runs: list[Run], found: Measured) -> bool:
    """Run and measure all models, adding to `runs` and `found`; return False if a signal ended it before."""
    from hfsim.output.progress import Progress
    from hfsim.studies.compare import measure
    from hfsim.studies.timing import uninterrupted

    name = plan.decks[plan.reference].deck.name
    try:
        for model in plan.decks:
            runs.append(run_model(plan, model, first=not runs))
            uninterrupted(runs[-1])
        with Progress(f"{name}, errors in time and repeats", sys.stderr, plan.study.talk.quiet) as progress:
            measure(plan.decks, runs, plan.repeats, found, progress)
    except KeyboardInterrupt:
        return False
    return True


def _draw(runs: Sequence[Run], comparison: Comparison, folder: Path) -> list[str]:
    from hfsim.output.plots import draw_comparison

    return draw_comparison(runs, comparison, folder)


def _exit_code(runs: Sequence[Run], comparison: Comparison, require: Sequence[str]) -> int:
    if comparison.interrupted:
        print_error("interrupted; what was computed until then is kept")
        return 130
    reference = next(run for run in runs if run.model == comparison.reference)
    if reference.status != "done":
        print_error(f"error: the reference {comparison.reference} did not reach the end: {reference.reason}")
        return reference.exit_code or 3
    missed = [model for model in require if not comparison.result(model).adequate]
    for model in missed:
        print_error(f"error: {model} was required and missed the bound")
    return 4 if missed else 0


def run_model(plan: Plan, model: str, first: bool) -> Run:
    """Run one model, write its folder, and return the run."""
    from hfsim.output.extras import Extras
    from hfsim.output.progress import Progress
    from hfsim.output.recording import save_run
    from hfsim.output.runfolder import RunLog, Stopwatch
    from hfsim.output.writers import Provenance
    from hfsim.simulate import simulate
    from hfsim.trust.validity import validity_warnings

    deck = plan.decks[model]
    watch = Stopwatch(wall_start=STARTED) if first else Stopwatch(cpu_start=time.process_time())
    provenance = Provenance.of(deck, plan.argument, plan.overrides[model])
    log = RunLog(plan.study.talk.detail)
    log.add(command_line())
    with Progress(f"{deck.deck.name}, {model}", sys.stderr, plan.study.talk.quiet) as progress:
        # the extent of the bodies is a scale of the comparison
        run = simulate(
            deck, model=model, progress=progress, error_estimate=plan.error_estimate, outlines=True
        )
    run, summary = save_run(plan.folders[model], run, provenance, watch, log, Extras(plan.study.plots))
    for warning in summary["warnings"]:
        told_with_differences = validity_warnings(summary.get("models") or {}, summary.get("validity") or {})
        if warning not in (*told_with_differences, *deck.warnings):
            plan.study.talk.note(f"{model}: warning: {warning}")
    if run.status not in ("done", "interrupted"):
        plan.study.talk.note(f"{model}: {run.status} at t = {run.stop_time:.6g} s: {run.reason}")
    return run
