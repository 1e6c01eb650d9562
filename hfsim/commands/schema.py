"""`hfsim schema`: what decks may say, as a JSON schema for editors."""

from __future__ import annotations

import json

import click

from hfsim.output.talk import print_out


@click.command()
def schema() -> None:
    """Print the JSON schema of decks, with which editors check and complete them.

    In an editor that speaks the YAML language server: 'hfsim schema > hfsim.schema.json', and as the first
    line of a deck '# yaml-language-server: $schema=hfsim.schema.json'.
    """
    from hfsim.deck.json_schema import json_schema
    from hfsim.scene.schema import Deck

    print_out(json.dumps(json_schema(Deck), indent=1, ensure_ascii=False))
