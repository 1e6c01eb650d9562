"""`hfsim run`: simulate decks and write their run folders."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands import STARTED, import_libraries, report_error, worst
from hfsim.commands.decks import command_line, load_decks
from hfsim.commands.options import (
    count_option,
    names,
    not_both,
    output_options,
    parse_time,
    setting_options,
    talk_options,
    time_option,
)
from hfsim.errors import INTERRUPTIONS
from hfsim.marching.stop import nobody
from hfsim.maths.frozen import frozen
from hfsim.output.talk import Destination, Talk
from hfsim.output.text import for_a_file, plural

if TYPE_CHECKING:
    from hfsim.output.checkpoint import Checkpoint
    from hfsim.output.extras import Extras
    from hfsim.output.runfolder import RunFolder
    from hfsim.scene.loading import LoadedDeck


_GONE_WRONG = 1
"""Exit code of what ended for lack of memory or a mistake in hfsim, which says nothing of the deck."""


@frozen
class Job:
    """One deck and the folder its results go to, or what a run there has come to that is left as it is."""

    argument: str
    loaded: LoadedDeck
    folder: RunFolder
    checkpoint: Checkpoint | None = None
    ended: Mapping[str, Any] | None = None


@frozen
class Settings:
    """How all jobs of one call are done."""

    overrides: tuple[str, ...]
    wanted: Extras
    error_estimate: bool
    diagnosis: bool
    resume: bool
    talk: Talk
    report: bool = False


@click.command()
@click.argument("decks", nargs=-1, required=True, metavar="DECK...")
@output_options
@setting_options("model", "keep_all")
@click.option(
    "--no-error-estimate", is_flag=True, help="Skip the further runs that estimate errors of time and mesh."
)
@click.option(
    "--target-error",
    metavar="X",
    help="Choose elements, degrees, method and tolerance for this total error, e.g. 1e-3.",
)
@click.option(
    "--target-channels", metavar="A,B,...", help="Channels that must reach it; all that can without it."
)
@time_option("budget", "Time that a run may take, e.g. 90s or 2min; with --target-error 60s without it.")
@click.option("--resume", is_flag=True, help="Go on with what was interrupted; do only what is missing.")
@click.option(
    "--no-diagnosis",
    is_flag=True,
    help="Skip the short experiments that tell why a run fails or is suspicious.",
)
@click.option(
    "--after",
    metavar="TIME",
    callback=lambda _, __, text: None if text is None else 0.0 if text == "none" else parse_time(text),
    help="Time for estimates, diagnosis and pictures, e.g. 10s, or none; without it as much as the run for "
    "all but pictures, or 2s.",
)
@click.option("--animate", is_flag=True, help="Draw the motion as plots/motion.gif.")
@click.option("--vtk", is_flag=True, help="Write the motion for ParaView: <deck name>.pvd and vtk/*.vtu.")
@click.option("--report", is_flag=True, help="Write all of it as one page, report.html.")
@count_option("jobs", 1, "Processes at a time.")
@talk_options
def run(
    decks: tuple[str, ...],
    to: Destination,
    overrides: tuple[str, ...],
    no_error_estimate: bool,
    target_error: str | None,
    target_channels: str | None,
    budget: float | None,
    resume: bool,
    no_diagnosis: bool,
    after: float | None,
    animate: bool,
    vtk: bool,
    report: bool,
    jobs: int,
    talk: Talk,
) -> None:
    """Simulate each DECK (a YAML file, the name of a shipped case such as 'pendulum', - for standard input).

    Results go to '<deck name>.out' in the current folder, or to -o DIR; several decks get a folder each
    inside DIR. With -o - the history goes to standard output as CSV, all else to standard error, and nothing
    is written. With --jobs N, N decks run at a time; what they tell comes in the order of the decks.

    All decks are checked before the first one runs: if one is bad, nothing is run. After that no deck stops
    the others, and the exit code is the gravest of theirs (0 < 4 < 5 < 3 < 2 < 1 < 130 < 143).

    A run writes its rows as they come. What was interrupted, killed or stopped by a limit goes on with
    --resume, and its results are the same as without the interruption; what is finished is left alone.

    With --target-error, each deck is refined by itself until the error of mesh and time together, largest
    over time in the worst channel and relative to its range, keeps the target; what was chosen is in
    resolved.yaml. With method: auto, methods are raced on the scene; one that the deck names is kept. A deck
    with beams of elements: auto has only these refined, to 1e-2 unless it states a target. Exit code 4: no
    refinement reaches it; 5: the budget does not suffice. The best result is kept then.
    """
    import_libraries()
    from hfsim.output.extras import Extras

    not_both(resume, to.force)
    overrides = (*overrides, *_target(target_error, target_channels, budget))
    wanted = Extras(to.plots and after != 0.0, animate, vtk, after, to.format)
    settings = Settings(overrides, wanted, not no_error_estimate, not no_diagnosis, resume, talk, report)
    if to.output == Path("-"):
        raise click.exceptions.Exit(_run_to_stream(decks, settings))
    planned = plan_jobs(decks, settings, to)
    _refuse_blind(planned, settings)
    raise click.exceptions.Exit(worst([0, *_do_all(planned, settings, jobs)]))


def _do_all(jobs: Sequence[Job], settings: Settings, processes: int) -> list[int]:
    """Return the exit codes of all jobs that were begun: one after the other, or some at a time."""
    codes: list[int] = []
    if processes == 1 or len(jobs) < 2 or not hasattr(os, "fork"):
        for number, job in enumerate(jobs):
            codes.append(_do_safely(job, settings, first=number == 0))
            if codes[-1] in INTERRUPTIONS:
                break
        return codes
    from hfsim.commands.batch import run_batch
    from hfsim.output.progress import Progress

    def do(number: int, progress: Callable[[float], None]) -> int:
        return _do_safely(jobs[number], settings, first=False, progress=progress)

    with Progress(plural(len(jobs), "deck"), sys.stderr, settings.talk.quiet) as shown:
        return run_batch([job.argument for job in jobs], do, processes, shown, shown.close)


def _run_to_stream(decks: Sequence[str], settings: Settings) -> int:
    """Simulate one deck, write its history to standard output, and return its exit code."""
    from hfsim.output.api import carry_out
    from hfsim.output.progress import Progress
    from hfsim.output.report import tell
    from hfsim.output.runfolder import Stopwatch
    from hfsim.output.stream import Stream
    from hfsim.output.writers import Provenance, summary_of

    wanted, talk = settings.wanted, replace(settings.talk, aside=True)
    if settings.resume or settings.report:
        raise click.UsageError("--resume and --report need a folder, which -o - does not make")
    if len(decks) != 1:
        raise click.UsageError("-o - takes one deck")
    if talk.as_json or wanted.animation or wanted.vtk:
        raise click.UsageError("-o - writes the history alone, without --json, --animate, --vtk and --report")
    (loaded,) = load_decks(decks, settings.overrides, talk)
    watch = Stopwatch(wall_start=STARTED)
    stream = Stream(sys.stdout, Provenance.of(loaded, decks[0], settings.overrides))
    with Progress(loaded.deck.name, sys.stderr, talk.quiet or sys.stdout.isatty()) as progress:
        result = carry_out(
            loaded,
            progress,
            error_estimate=settings.error_estimate,
            diagnosis=settings.diagnosis,
            after=wanted.after,
            outlines=False,
            recording=stream,
        )
    result = watch.added_to(result)
    tell(result, summary_of(result, stream.provenance, ()), None, talk, loaded.warnings)
    return result.exit_code


def _target(error: str | None, channels: str | None, budget: float | None) -> Iterator[str]:
    """Yield the overrides of the deck that options on the target error stand for."""
    from hfsim.deck.source import Setting

    if error is not None:
        yield Setting.by("--target-error", f"solve.target_error={error}")
    if channels is not None:
        yield Setting.by("--target-channels", f"solve.target_channels={json.dumps(names(channels))}")
    if budget is not None:
        yield f"solve.budget={budget}"


def _refuse_blind(jobs: Sequence[Job], settings: Settings) -> None:
    for job in jobs:
        if not settings.error_estimate and job.loaded.has_target:
            raise click.UsageError(
                f"{job.argument}: a target error, or elements: auto, cannot go with --no-error-estimate"
            )


def plan_jobs(decks: Sequence[str], settings: Settings, to: Destination) -> list[Job]:
    """Load all decks and claim all folders; nothing is written yet.

    Raises
    ------
    click.exceptions.Exit
        With code 2 if a deck is bad.
    FolderError
        If a folder must not be written to, or two decks would share one.
    """
    from hfsim.simulate import check

    # a single deck is assembled by its simulation, which writes nothing if that fails
    loaded = load_decks(decks, settings.overrides, settings.talk, check if len(decks) > 1 else nobody)
    paths = _folders([deck.deck.name for deck in loaded], decks, to.output)
    every = zip(decks, loaded, paths, strict=True)
    job = _resumed if settings.resume else _begun
    return [job(argument, deck, path, settings, to.force) for argument, deck, path in every]


def _begun(argument: str, loaded: LoadedDeck, path: Path, settings: Settings, force: bool) -> Job:
    """Return the job of running a deck from its start."""
    from hfsim.output.runfolder import claim

    folder = claim(path, force)
    if folder.replaces:
        hint = "; --resume would go on with it" if (path / "checkpoint.npz").exists() else ""
        settings.talk.note(f"{path}: replacing {folder.replaces}{hint}")
    return Job(argument, loaded, folder)


def _resumed(argument: str, loaded: LoadedDeck, path: Path, settings: Settings, force: bool) -> Job:
    """Return the job of doing what is missing of a deck's run, which may be nothing.

    Raises
    ------
    FolderError
        If what stands there is of another deck or version.
    """
    from hfsim.output.checkpoint import CheckpointError, refuse_others, take_up
    from hfsim.output.runfolder import FolderError, RunFolder, claim, read_summary
    from hfsim.output.writers import Provenance

    summary = read_summary(path)
    if not summary.get("status"):
        return _begun(argument, loaded, path, settings, force)
    provenance = Provenance.of(loaded, argument, settings.overrides)
    try:
        refuse_others(path, summary, provenance)
        cut_off = (*INTERRUPTIONS, None if summary["status"] == "done" else _GONE_WRONG)
        if summary["status"] in ("done", "failed") and summary.get("exit_code") not in cut_off:
            return Job(argument, loaded, RunFolder(path), ended=summary)
        folder = claim(path, force=True)
        checkpoint = take_up(path, provenance)
    except CheckpointError as error:
        raise FolderError(f"{error}\nuse --force without --resume to begin anew") from error
    if checkpoint is not None:
        settings.talk.note(f"{path}: going on at row {len(checkpoint.memory['table'])}")
    elif loaded.has_target:
        settings.talk.note(f"{path}: begun anew, as is every search for a target error")
    else:
        settings.talk.note(f"{path}: begun anew, it had not come to its first checkpoint")
    return Job(argument, loaded, folder, checkpoint)


def _folders(names: Sequence[str], decks: Sequence[str], output: Path | None) -> list[Path]:
    from hfsim.output.runfolder import FolderError, folder_name

    if output is not None and len(names) == 1:
        return [output]
    plain = [folder_name(name, "" if output else ".out") for name in names]
    for number, name in enumerate(plain):
        first = plain.index(name)
        if first == number:
            continue
        one, other = decks[first], decks[number]
        if Path(one).resolve() == Path(other).resolve():
            raise FolderError(f"{one} is named twice")
        folder = (output or Path()) / name
        raise FolderError(
            f"{one} and {other} would both write to {folder}, after the 'name' in them: change one"
        )
    return [(output or Path()) / name for name in plain]


def _do_safely(
    job: Job, settings: Settings, first: bool, progress: Callable[[float], None] | None = None
) -> int:
    try:
        return do_job(job, settings, first, progress)
    except Exception as error:  # the other decks still have to run
        return report_error(error)


def do_job(
    job: Job, settings: Settings, first: bool, progress: Callable[[float], None] | None = None
) -> int:
    """Simulate one deck, write its folder, tell the results, and return its exit code.

    Parameters
    ----------
    first : bool
        Whether it also pays for starting the program.
    progress : callable, optional
        Told the share that is done, 0 to 1; without it that is shown on standard error.

    Raises
    ------
    HfsimError
        If the deck cannot be assembled or the disk refuses.
    """
    if job.ended is not None:
        settings.talk.note(f"{job.folder.path}: left as it is, {job.ended['status']}")
        settings.talk.facts(job.ended)
        return int(job.ended.get("exit_code") or 0)
    from hfsim.output.api import carry_out
    from hfsim.output.progress import Progress
    from hfsim.output.recording import Recording
    from hfsim.output.report import as_text, headline, method_lines, tell
    from hfsim.output.runfolder import RunLog, Stopwatch
    from hfsim.output.writers import Provenance

    watch = Stopwatch(wall_start=STARTED) if first else Stopwatch(cpu_start=time.process_time())
    loaded, deck = job.loaded, job.loaded.deck
    provenance = Provenance.of(loaded, job.argument, settings.overrides)
    log = RunLog(settings.talk.detail)
    log.add(command_line())
    log.add(f"deck {job.argument}, sha256 {provenance.deck_sha256}")
    recording = Recording(job.folder, deck.name, deck.solve.model, provenance, watch, log, job.checkpoint)
    wanted = settings.wanted.of(deck.output)
    with Progress(deck.name, sys.stderr, settings.talk.quiet or progress is not None) as shown:
        try:
            result = carry_out(
                loaded,
                progress or shown,
                error_estimate=settings.error_estimate,
                diagnosis=settings.diagnosis,
                after=wanted.after,
                outlines=wanted.any,
                recording=recording,
                memory=job.checkpoint.memory if job.checkpoint else None,
            )
        except BaseException as error:
            recording.abandon(error)
            raise
        with for_a_file():
            for line in method_lines(result.statistics.get("refinement")):
                log.add(line.strip())
        log.add(f"model {result.model}, method {result.method}")
        result, summary = recording.finish(result, wanted)
    if settings.report and summary["exit_code"] is not None:  # else it comes with what is missing
        from hfsim.output.page import add_page

        with for_a_file():
            text = f"{headline(result)}\n{as_text(result, summary, job.folder.path)}"
        summary = add_page(job.folder.path, summary, text, loaded.source.text)
    tell(result, summary, job.folder.path, settings.talk, job.loaded.warnings)
    return result.exit_code
