"""`hfsim static`: where scenes come to rest, and how."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from hfsim.commands import STARTED, import_libraries, report_error, worst
from hfsim.commands.decks import command_line, load_numbered
from hfsim.commands.options import moment_option, names, output_options, setting_options, talk_options
from hfsim.output.talk import Destination, Talk

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder, Stopwatch
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.static import Wish


@click.command()
@click.argument("deck", metavar="DECK")
@output_options
@setting_options("model", "keep_all")
@moment_option("Time at which loads and drivers are taken [s].", "0")
@click.option("--path", is_flag=True, help="Follow the load by arc length, through limit points.")
@click.option("--buckling", is_flag=True, help="Find the load factors at which the scene gives way.")
@click.option(
    "--count", type=click.IntRange(1, 20), default=3, show_default=True, help="Critical load factors sought."
)
@click.option(
    "--vary", metavar="A,B,...",
    help="Loads, motors or 'gravity' that load factors are of; all of them without it.",
)
@click.option("--vtk", is_flag=True, help="Write start and equilibrium for ParaView.")
@talk_options
def static(
    deck: str,
    to: Destination,
    overrides: tuple[str, ...],
    at: float,
    path: bool,
    buckling: bool,
    count: int,
    vary: str | None,
    vtk: bool,
    talk: Talk,
) -> None:
    """Find where the scene of a DECK comes to rest, under the loads that act at t = 0 or --at T.

    Loads and weight are put on in steps, and a scene that nothing holds at first, such as a pendulum, is
    let down to where it hangs. Results are those of a run with one row, in '<deck name>.static' or -o DIR:
    history.csv, summary.json, pictures; --set output.shapes=true writes the shapes. Rates, dampers and
    friction count for nothing.

    With --path a row for each point of the path from where it begins to the whole load, which may turn
    round on the way; with --buckling the smallest load factors at which the scene gives way.

    With -o - the rows go to standard output as CSV, all else to standard error, and nothing is written.

    Exit code 3: there is no equilibrium, or none is found; what was reached is kept.
    """
    if to.output == Path("-") and (talk.as_json or vtk):
        raise click.UsageError("-o - writes the rows alone, without --json and --vtk")
    given = click.get_current_context().get_parameter_source("count")
    if given is not ParameterSource.DEFAULT and not buckling:
        raise click.UsageError("--count goes with --buckling only")
    if vary and not (path or buckling):
        raise click.UsageError("--vary goes with --path and --buckling only")
    import_libraries()
    from hfsim.output.runfolder import Stopwatch

    watch = Stopwatch(wall_start=STARTED)
    try:
        loaded = load_numbered(deck, overrides, talk)
        from hfsim.output.api import without_blind
        from hfsim.studies.static import Wish

        loaded = without_blind(loaded, (loaded.deck.solve.model,), talk.note)
        varied = names(vary) or None
        wish = Wish(at, path, count if buckling else 0, varied)
        code = _do(deck, loaded, to, overrides, wish, vtk, talk, watch)
    except Exception as error:
        code = report_error(error)
    raise click.exceptions.Exit(worst([code]))


def _do(
    argument: str,
    loaded: LoadedDeck,
    to: Destination,
    overrides: tuple[str, ...],
    wish: Wish,
    vtk: bool,
    talk: Talk,
    watch: Stopwatch,
) -> int:
    from hfsim.output.extras import Extras
    from hfsim.output.progress import Progress
    from hfsim.output.recording import save_run
    from hfsim.output.runfolder import RunLog, claim, folder_name
    from hfsim.output.static import tell
    from hfsim.output.stream import Stream
    from hfsim.output.writers import Provenance, summary_of
    from hfsim.studies.static import run_static

    name, provenance = loaded.deck.name, Provenance.of(loaded, argument, overrides)
    folder: RunFolder | None = None
    if to.output != Path("-"):
        folder = claim(to.output or Path(folder_name(name, ".static")), to.force)
        if folder.replaces:
            talk.note(f"{folder.path}: replacing {folder.replaces}")
    log = RunLog(talk.detail)
    log.add(command_line())
    with Progress(name, sys.stderr, talk.quiet) as shown:
        shown(0.0)
        found = run_static(loaded, wish)
    if folder is None:
        stream = Stream(sys.stdout, provenance)
        stream.begin(one.name for one in found.channels)
        stream.take(found, provenance)
        facts = summary_of(watch.added_to(found), provenance, ())
        tell(found, facts, None, replace(talk, aside=True), loaded.warnings)
        return found.exit_code
    wanted = Extras(to.plots, vtk=vtk, format=to.format).of(loaded.deck.output)
    run, summary = save_run(folder, found, provenance, watch, log, wanted)
    tell(run, summary, folder.path, talk, loaded.warnings)
    return run.exit_code
