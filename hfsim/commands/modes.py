"""`hfsim modes`: frequencies, damping ratios and shapes of small motions."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands import import_libraries
from hfsim.commands.decks import load_numbered
from hfsim.commands.options import (
    Place,
    moment_option,
    output_options,
    period_option,
    setting_options,
    talk_options,
)
from hfsim.output.pictures import drawn_by
from hfsim.output.study import Study
from hfsim.output.talk import Destination, Talk

if TYPE_CHECKING:
    from hfsim.studies.modes import Campbell, Modes

_COUNT = 12


@click.command()
@click.argument("deck", metavar="DECK")
@click.option(
    "--about",
    "state",
    type=click.Choice(["start", "equilibrium", "steady"]),
    default="start",
    show_default=True,
    help="State: the deck's start, the equilibrium next to it, or the steady rotation at its rates.",
)
@moment_option("Instead: the state of a run at this time [s].")
@period_option("About the periodic motion next to the start, or next to the run at --at; see modes.md.")
@click.option(
    "--count", type=click.IntRange(min=1, max=2000), default=_COUNT, show_default=True, help="Modes told."
)
@click.option(
    "--spin",
    metavar="RATES",
    help="Campbell diagram over these rates [rad/s], lin(0,30,16) or 0,5,10, about the axis of the "
    "start's rates (initial.steady) or, at rest, that of the joints.",
)
@click.option(
    "--spin-body",
    metavar="NAME",
    help="With --spin: the body about whose axis, where bodies turn differently at the start.",
)
@click.option("--csv", "as_csv", is_flag=True, help="Print the table as CSV.")
@click.option(
    "--matrices",
    type=Place(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write M, C, G, K, joints and a reduced state space to this .npz file.",
)
@output_options
@setting_options("model")
@talk_options
def modes(
    deck: str,
    state: str,
    at: float | None,
    period: float | None,
    count: int,
    spin: str | None,
    spin_body: str | None,
    as_csv: bool,
    matrices: Path | None,
    to: Destination,
    overrides: tuple[str, ...],
    talk: Talk,
) -> None:
    """Tell frequencies, damping and shapes of the small motions of the scene DECK.

    It is linearised about its start, an equilibrium, a steady rotation, the state of a run or a periodic
    motion, with joints, dampers, follower loads, servos and gyroscopic terms. Motions that nothing brings
    back are called rigid, or drift where dampers end them; unstable ones flutter or divergence (the exit
    code is 0 all the same). Results go to '<deck name>.modes' or to -o DIR.
    """
    import_libraries()
    values = read_rates(spin)
    if values and (at is not None or matrices is not None):
        raise click.UsageError("--spin takes neither --at nor --matrices")
    if at is not None and state != "start":
        raise click.UsageError("--about and --at are two states; say one of them")
    if period is not None and (state != "start" or values or matrices is not None):
        raise click.UsageError("--period takes neither --about nor --spin nor --matrices")
    if spin_body is not None and not values:
        raise click.UsageError("--spin-body goes with --spin")
    loaded = load_numbered(deck, overrides, talk)
    from hfsim.output.progress import Progress
    from hfsim.output.writers import Provenance
    from hfsim.scene.measured import without_refused_channels
    from hfsim.studies.modes import campbell, modes_of, periodic
    from hfsim.studies.modes.about import about, seen_from

    facts = Provenance.of(loaded, deck, overrides).facts()
    study = Study.claim("modes", to, loaded.deck.name, talk, facts)
    with Progress(f"{loaded.deck.name}, modes", sys.stderr, talk.quiet) as progress:
        loaded = without_refused_channels(loaded)
        if period is not None:
            found = periodic(loaded, period, count, at, progress)
        else:
            place = about(loaded, state, at, progress if at else None)
            place = place if spin_body is None else seen_from(place, spin_body)
            if values:
                result = campbell(place, values, count, progress)
            else:
                found = modes_of(place, count)
    if values:
        publish_campbell(result, study, as_csv)
    else:
        publish_modes(found, study, as_csv, matrices)


def read_rates(text: str | None) -> tuple[float, ...]:
    """Return the rates that a text means, none without one.

    Raises
    ------
    click.UsageError
        If they are no numbers.
    """
    from hfsim.studies.axes import AxisError, parse_values

    if text is None:
        return ()
    try:
        values = parse_values(text, "rad/s")[0]
    except AxisError as error:
        raise click.UsageError(f"--spin: {error}") from None
    rates = tuple(value for value in values if isinstance(value, float))
    if len(rates) < 2 or len(rates) < len(values):
        raise click.UsageError(f"--spin: '{text}' is not two rates or more; write lin(0,30,16) or 0,5,10")
    return tuple(sorted(rates))


def publish_modes(found: Modes, study: Study, as_csv: bool, matrices: Path | None) -> None:
    """Write and tell the modes of one state."""
    from hfsim.output import modes as report

    if matrices is not None:
        write_matrices(found, matrices)
    table = report.columns_of(found), report.mode_rows(found)
    text = _csv(*table) if as_csv else report.modes_text(found, f"{study.path}/")
    study.publish(found.facts(), {"modes": table}, text, drawn_by("modes:draw_modes", found), asked=as_csv)


def publish_campbell(result: Campbell, study: Study, as_csv: bool) -> None:
    """Write and tell the modes at several rates."""
    from hfsim.output import modes as report

    table = report.CAMPBELL_COLUMNS, result.rows()
    text = _csv(*table) if as_csv else report.campbell_text(result, f"{study.path}/")
    draw = drawn_by("campbell:draw_campbell", result)
    study.publish(result.facts(), {"campbell": table}, text, draw, asked=as_csv)


def _csv(columns: Sequence[Any], rows: Sequence[Any]) -> str:
    from hfsim.output.writers import table_text

    return table_text(rows, columns).rstrip("\n")


def write_matrices(found: Modes, path: Path) -> None:
    """Write the matrices of small motions.

    Raises
    ------
    WriteError
        If the disk refuses.
    """
    import numpy as np

    from hfsim.output.disk import disk
    from hfsim.studies.modes.matrices import matrices_of

    with disk(path), path.open("wb") as file:
        np.savez(file, **matrices_of(found))
