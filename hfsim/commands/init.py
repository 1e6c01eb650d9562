"""`hfsim init`: a commented deck to start from."""

from __future__ import annotations

import os
import re
from pathlib import Path

import click

from hfsim.commands.options import PLACE


@click.command()
@click.argument("name", required=False)
@click.option("--list", "listing", is_flag=True, help="Tell what there is, and write nothing.")
@click.option("-o", "--output", type=PLACE, metavar="FILE", help="Where it goes.")
@click.option("--force", is_flag=True, help="Replace the file if it is there.")
def init(name: str | None, listing: bool, output: Path | None, force: bool) -> None:
    """Write a commented deck, NAME.yaml, to start from: a recipe of the manual or a shipped case.

    Without NAME it is 'swing', an arm that falls about a hinge. With -o - the deck goes to standard output.
    """
    from hfsim.deck.source import did_you_mean
    from hfsim.output.disk import disk, write_text
    from hfsim.output.runfolder import FolderError, refuse_unwritable
    from hfsim.output.talk import print_out
    from hfsim.output.text import listed

    decks = starters()
    if listing and (name or output):
        raise click.UsageError("--list writes nothing: it takes neither NAME nor -o")
    if listing:
        print_out(listed({one: _about(text) for one, text in decks.items()}))
        return
    name = name or "swing"
    if name not in decks:
        raise click.UsageError(f"there is no {name}: {did_you_mean(name, decks)} (--list tells them all)")
    if output == Path("-"):
        print_out(decks[name].rstrip("\n"))
        return
    path = output or Path(f"{name}.yaml")
    if os.path.lexists(path) and not force:
        raise FolderError(f"{path} is there already; use --force to replace it, or -o FILE")
    refuse_unwritable(path.parent)
    with disk(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, decks[name])
    print_out(f"{path}: {_about(decks[name])}\nnext: hfsim check {path}; hfsim run {path}")


def starters() -> dict[str, str]:
    """Return the decks of the manual's tutorial and recipes, then the shipped cases, by name."""
    from hfsim.output.manual import decks_in, topics
    from hfsim.scene.shipped import shipped_cases

    pages = topics()
    decks = {name: text for page in ("tutorial", "recipes") for name, text in decks_in(pages[page]).items()}
    cases = {name: path.read_text(encoding="utf-8") for name, path in shipped_cases().items()}
    return {**decks, **cases}


def _about(deck: str) -> str:
    """Return what the comment of a deck begins with."""
    return re.split(r"[:;(]|\.(?!\d)", deck.splitlines()[0].lstrip("# "))[0].strip()
