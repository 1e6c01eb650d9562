"""`hfsim run`: simulate decks and write their run folders."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands import (
    STARTED,
    Talk,
    as_table,
    assemble,
    brief,
    command_line,
    deck_options,
    keep_all_option,
    load_decks,
    model_option,
    names,
    output_options,
    print_error,
    provenance_of,
    report_error,
    talk_options,
    time_option,
    with_settings,
    worst,
)

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder
    from hfsim.run.solution import Run
    from hfsim.scene.loading import LoadedDeck


@dataclass(frozen=True)
class Job:
    """One deck and the folder its results go to."""

    argument: str
    loaded: LoadedDeck
    folder: RunFolder


@dataclass(frozen=True)
class Settings:
    """How all jobs of one call are done."""

    overrides: tuple[str, ...]
    plots: bool
    error_estimate: bool
    diagnosis: bool
    talk: Talk


@click.command()
@click.argument("decks", nargs=-1, required=True, metavar="DECK...")
@output_options
@deck_options
@model_option
@keep_all_option
@click.option(
    "--no-error-estimate", is_flag=True, help="Skip the second, coarser run that estimates the error."
)
@click.option(
    "--target-error",
    metavar="X",
    help="Choose elements, degrees, method and tolerance for this total error, e.g. 1e-3.",
)
@click.option(
    "--target-channels", metavar="A,B,...", help="Channels that must reach it; all that can without it."
)
@time_option("budget", "Time that this may take, e.g. 90s or 2min; 60s without it.")
@click.option(
    "--no-diagnosis",
    is_flag=True,
    help="Skip the short experiments that tell why a run fails or is suspicious.",
)
@talk_options
def run(
    decks: tuple[str, ...],
    output: Path | None,
    force: bool,
    no_plots: bool,
    overrides: tuple[str, ...],
    model: str | None,
    keep_all: bool,
    no_error_estimate: bool,
    target_error: str | None,
    target_channels: str | None,
    budget: float | None,
    no_diagnosis: bool,
    quiet: bool,
    verbose: bool,
    as_json: bool,
) -> None:
    """Simulate each DECK (a YAML file, or the name of a shipped case such as 'pendulum').

    Results go to '<deck name>.out' in the current folder, or to -o DIR; several decks get a folder each
    inside DIR. All decks are checked before the first one runs: if one is bad, nothing is run. After
    that no deck stops the others, and the exit code is the gravest of theirs (0 < 4 < 5 < 3 < 2 < 1 < 130 <
    143).

    With --target-error, each deck is refined by itself until the error of mesh and time together, largest
    over time in the worst channel and relative to its range, keeps the target; what was chosen is in
    resolved.yaml. With method: auto, methods are raced on the scene; one that the deck names is kept. A deck
    with beams of elements: auto has only these refined, to 1e-2 unless it states a target. Exit code 4: no
    refinement reaches it; 5: the budget does not suffice. The best result is kept then.
    """
    overrides = (
        *with_settings(overrides, model, keep_all),
        *_target(target_error, target_channels, budget),
    )
    settings = Settings(
        overrides,
        not no_plots,
        not no_error_estimate,
        not no_diagnosis,
        Talk(quiet, verbose, as_json),
    )
    jobs = plan_jobs(decks, settings, output, force)
    _refuse_blind(jobs, settings)
    codes: list[int] = []
    for number, job in enumerate(jobs):
        codes.append(_do_safely(job, settings, first=number == 0))
        if codes[-1] in (130, 143):
            break
    raise click.exceptions.Exit(worst(codes))


def _target(error: str | None, channels: str | None, budget: float | None) -> Iterator[str]:
    """Yield the overrides of the deck that options on the target error stand for."""
    if error is not None:
        yield f"solve.target_error={error}"
    if channels is not None:
        yield f"solve.target_channels=[{', '.join(names(channels))}]"
    if budget is not None:
        yield f"solve.budget={budget}"


def _refuse_blind(jobs: Sequence[Job], settings: Settings) -> None:
    for job in jobs:
        if not settings.error_estimate and has_target(job.loaded):
            raise click.UsageError(
                f"{job.argument}: a target error, or elements: auto, cannot go with --no-error-estimate"
            )


def has_target(loaded: LoadedDeck) -> bool:
    """Return whether a deck states the error that its run is to reach."""
    return "target_error" in loaded.deck.resolved()["solve"]


def plan_jobs(decks: Sequence[str], settings: Settings, output: Path | None, force: bool) -> list[Job]:
    """Load all decks and claim all folders; nothing is written yet.

    Raises
    ------
    click.exceptions.Exit
        With code 2 if a deck is bad.
    FolderError
        If a folder must not be written to, or two decks would share one.
    """
    from hfsim.output.runfolder import claim

    loaded = load_decks(decks, settings.overrides, settings.talk, assemble if len(decks) > 1 else _nothing)
    paths = _folders([deck.deck.name for deck in loaded], decks, output)
    jobs = [Job(a, d, claim(p, force)) for a, d, p in zip(decks, loaded, paths, strict=True)]
    for job in jobs:
        if job.folder.replaces:
            settings.talk.note(f"{job.folder.path}: replacing {job.folder.replaces}")
    return jobs


def _nothing(loaded: LoadedDeck) -> None:
    # a single deck is assembled by its simulation, which writes nothing if that fails
    return


def _folders(names: Sequence[str], decks: Sequence[str], output: Path | None) -> list[Path]:
    from hfsim.output.runfolder import FolderError, folder_name

    if output is not None and len(names) == 1:
        return [output]
    plain = [folder_name(name, "" if output else ".out") for name in names]
    for number, name in enumerate(plain):
        first = plain.index(name)
        if first != number:
            raise FolderError(
                f"{decks[first]} and {decks[number]} would both write to {name}: rename one deck"
            )
    return [(output or Path()) / name for name in plain]


def _do_safely(job: Job, settings: Settings, first: bool) -> int:
    try:
        return do_job(job, settings, first)
    except Exception as error:  # the other decks still have to run
        return report_error(error)


def do_job(job: Job, settings: Settings, first: bool) -> int:
    """Simulate one deck, write its folder, tell the results, and return its exit code.

    Raises
    ------
    HfsimError
        If the deck cannot be assembled or the disk refuses.
    """
    from hfsim.output.progress import Progress
    from hfsim.output.runfolder import RunLog, Stopwatch, save_run
    from hfsim.simulate import simulate

    # the first deck also pays for starting the program
    watch = Stopwatch(wall_start=STARTED) if first else Stopwatch(cpu_start=time.process_time())
    provenance = provenance_of(job.loaded, job.argument, settings.overrides)
    log = RunLog(settings.talk.detail)
    log.add(command_line())
    log.add(f"deck {job.argument}, sha256 {provenance.deck_sha256}")
    plots = settings.plots and job.loaded.deck.output.plots
    with Progress(job.loaded.deck.name, sys.stderr, settings.talk.quiet) as progress:
        if has_target(job.loaded):
            from hfsim.studies.refine import refine

            result, chosen = refine(job.loaded, progress=progress, diagnosis=settings.diagnosis)
            provenance = provenance._replace(resolved=chosen.deck.resolved())
        else:
            result = simulate(
                job.loaded,
                progress=progress,
                error_estimate=settings.error_estimate,
                diagnosis=settings.diagnosis,
                outlines=plots,
            )
    for line in method_lines(result.statistics.get("refinement")):
        log.add(line.strip())
    log.add(f"model {result.model}, method {result.method}")
    result, summary = save_run(job.folder, result, provenance, watch, log, plots)
    tell(result, summary, job.folder.path, settings.talk)
    return result.exit_code


def tell(run: Run, summary: Mapping[str, Any], folder: Path, talk: Talk) -> None:
    """Print the results of one run, and what the user should be warned of."""
    for warning in summary["warnings"]:
        talk.note(f"{run.name}: warning: {warning}")
    if run.status != "done":
        print_error(f"{run.name}: {run.status} at t = {run.stop_time:.6g} s: {run.reason}")
        if run.failure:
            print_error(findings(run.failure))
    elif run.exit_code:
        print_error(f"{run.name}: {run.reason}")
    if run.status == "done" and summary.get("suspicion"):
        doubt = summary["suspicion"]
        talk.note(f"{run.name}: suspicious: {doubt['reason']}\n{findings(doubt)}")
    talk.facts(summary)
    talk.result(f"{run.name}: {headline(run)}\n{as_text(run, summary, folder)}")


def headline(run: Run) -> str:
    """Return the status in a few words."""
    if run.status == "done":
        return f"done, {run.end_time:.6g} s simulated"
    return f"{run.status} at t = {run.stop_time:.6g} s: {run.reason}"


def as_text(run: Run, summary: Mapping[str, Any], folder: Path) -> str:
    """Return the table of results that people read."""
    facts = {
        "model, method": f"{run.model}, {run.method}",
        **_models(summary),
        "size": f"{number(summary['unknowns'])} unknowns, {number(summary['multipliers'])} multipliers",
        "steps": _steps(summary),
        "CPU time": _times(summary["cpu_s"]),
        "error estimate": number(summary["error_estimate"]),
        "energy drift": number(summary["energy_drift"]),
        "constraint drift": _drift(summary),
        "results": f"{folder}/",
    }
    width = max(map(len, facts))
    lines = [f"  {name.ljust(width)}  {text}" for name, text in facts.items()]
    levels = level_table(summary["refinement"]) if summary.get("refinement") else []
    return "\n".join([*lines, *levels, *_last_values(run)])


def level_table(found: Mapping[str, Any]) -> list[str]:
    """Return the levels of a refinement, a row each, and which was chosen and why."""
    head = ["refined", "method", "tolerance", "unknowns", "steps", "CPU [s]", "change", "error", "mesh"]
    rows = [["level", *head]]
    chosen = found["chosen"]
    for level in found["levels"]:
        mark = "*" if level["number"] == chosen["number"] else ""
        mesh = ", ".join(f"{body} {n['elements']} x {n['degree']}" for body, n in level["bodies"].items())
        change = brief(level["change"])
        if level["status"] != "done":
            change = level["status"]
        rows.append(
            [f"{level['number']}{mark}", level["refined"], level["method"], f"{level['tolerance']:.1e}",
             number(level["unknowns"]), number(level["steps"]), f"{level['cpu_s']:.3f}", change,
             brief(level["estimate"]), mesh if len(mesh) <= _WIDEST else f"{mesh[:_WIDEST]}..."]
        )  # fmt: skip
    where = f" in {chosen['channel']}" if chosen["channel"] else ""
    return [
        f"  target error {found['target']:g}: {found['status']}, estimate {brief(found['estimate'])}{where}; "
        f"{found['cpu_s']:.2f} s CPU in {len(found['levels'])} levels",
        as_table(rows, "    "),
        "    mesh: elements x degree; change: of the level refined, relative to the channel's range",
        f"    * {chosen['why']}",
        *method_lines(found),
        *_fixed_meshes(found["fixed_meshes"]),
    ]


def method_lines(found: Mapping[str, Any] | None) -> list[str]:
    """Return how the method of a refinement was chosen, and the races that this rests on."""
    if not found:
        return []
    lines = [f"    method {found['method_choice']}"]
    if not found["probes"]:
        return lines
    head = ["tolerance", "unknowns", "CPU [s]", "against", "CPU [s]", "done", "error in time", "outcome"]
    rows = [["race", *head]]
    for one in found["probes"]:
        cpu, to_beat = f"{one['cpu_s']:.3f}", f"{one['to_beat_s']:.3f}"
        came = [cpu, one["against"], to_beat, f"{one['share']:.0%}", brief(one["error"]), _outcome(one)]
        rows.append([one["method"], f"{one['tolerance']:.1e}", number(one["unknowns"]), *came])
    lines += as_table(rows, "    ").split("\n")
    share = found["probing_cpu_s"] / max(found["cpu_s"], 1e-9)
    return [*lines, f"    races took {found['probing_cpu_s']:.2f} s of CPU, {share:.0%} of the whole"]


def _outcome(race: Mapping[str, Any]) -> str:
    return f"{race['outcome']}: {race['reason']}" if race["reason"] else str(race["outcome"])


def _fixed_meshes(beams: Sequence[str]) -> list[str]:
    return (
        [f"    not counted: mesh errors of {', '.join(beams)}, whose elements the deck fixes"]
        if beams
        else []
    )


_WIDEST = 60
"""Characters of a mesh in a table."""


def _models(summary: Mapping[str, Any]) -> dict[str, str]:
    """Return the rows that say which beams spent how much of the time in which model, and the changes."""
    auto = summary.get("auto")
    if not auto:
        models = summary.get("models") or {}
        mixed = len(set(models.values())) > 1
        return {"models": ", ".join(f"{body} {model}" for body, model in models.items())} if mixed else {}
    spent = [
        f"{body} " + ", ".join(f"{model} {share:.0%}" for model, share in shares.items())
        for body, shares in auto["shares"].items()
    ]
    rows = {"share of time": "; ".join(spent)}
    for n, one in enumerate(auto["switches"], 1):
        rows[f"change {n}"] = (
            f"{one['time']:.4g} s: {one['body']} from {one['model']} to {one['next_model']}: "
            f"{one['reason']}; energy {one['energy_gained']:+.2g} J"
        )
    return rows


_CLASSES = {
    "numerical": "numerical: the method makes it, not the model or the mechanism",
    "model": "model: terms that it leaves out make it",
    "physical": "physical: the mechanism itself makes it",
    "deck": "deck: its numbers or joints make it",
}


def findings(facts: Mapping[str, Any]) -> str:
    """Return class, item, deck line, evidence and next command of a failure or suspicion, a line each."""
    line = f", line {facts['line']} of the deck" if facts.get("line") else ""
    evidence = facts.get("evidence") or {}
    kind = _CLASSES.get(str(facts.get("class")), str(facts.get("class")))
    rows = {
        "class": "undecided, taken as numerical" if "undecided" in evidence else kind,
        "item": f"{facts['item']}{line}" if facts.get("item") else "",
        "evidence": "\n            ".join(
            f"{key.replace('_', ' ')}: {number(value)}" for key, value in evidence.items()
        ),
        "try": str(facts.get("try") or ""),
    }
    return "\n".join(f"  {name.ljust(8)}  {text}" for name, text in rows.items() if text)


def number(value: object) -> str:
    """Return a number, or a group of them, as short text; a dash where there is none.

    Examples
    --------
    >>> number(None), number(40), number(1.23456e-9), number({"b1.tip.x": 1e-9})
    ('-', '40', '1.23e-09', 'b1.tip.x 1e-09')
    """
    if value is None:
        return "-"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {number(part)}" for key, part in value.items()) or "-"
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)


def _steps(summary: Mapping[str, Any]) -> str:
    keys = {"rejected": "rejected", "newton_iterations": "Newton iterations", "evaluations": "evaluations"}
    parts = [f"{number(summary[key])} {words}" for key, words in keys.items() if summary[key] is not None]
    return ", ".join([number(summary["steps"]), *parts])


def _times(times: Mapping[str, float]) -> str:
    order = [phase for phase in times if phase != "total"]
    parts = [f"{phase.replace('_', ' ')} {times[phase]:.3f}" for phase in order]
    return f"{times.get('total', 0.0):.3f} s ({', '.join(parts)})"


def _drift(summary: Mapping[str, Any]) -> str:
    position, velocity = (number(summary[f"constraint_{what}"]) for what in ("position", "velocity"))
    return f"position {position}, velocity {velocity}"


def _last_values(run: Run) -> list[str]:
    if not len(run.t):
        return ["  no output time was reached"]
    rows = [[f"  {channel.name}", f"{channel.values[-1]:.9g}", channel.unit] for channel in run.channels]
    if not rows:
        return []
    return [f"  at t = {run.end_time:.9g} s", as_table(rows)]
