"""`hfsim help`: the manual."""

from __future__ import annotations

import sys
from typing import cast

import click


@click.command()
@click.argument("topic", required=False)
def help(topic: str | None) -> None:
    """Show a page of the manual, or what pages there are; of a command, its options; of a kind of joint,
    spring, load or law, or of a key of decks, what the manual has on it.
    """
    from hfsim.deck.source import did_you_mean
    from hfsim.output.manual import about, for_terminal, title_of, topics
    from hfsim.output.talk import print_out
    from hfsim.output.text import listed

    context, pages = click.get_current_context().find_root(), topics()
    program = cast(click.Group, context.command)
    commands = program.list_commands(context)
    if topic is None:
        lines = listed({name: title_of(page) for name, page in pages.items()}, "  ")
        print_out(f"Topics of the manual (hfsim help TOPIC):\n\n{lines}")
    elif command := program.get_command(context, topic) if topic not in pages else None:
        print_out(command.get_help(click.Context(command, context, topic)))
    elif page := pages[topic].read_text(encoding="utf-8") if topic in pages else about(topic):
        text = for_terminal(page)
        click.echo_via_pager(text) if sys.stdout.isatty() else print_out(click.unstyle(text))
    else:
        raise click.UsageError(f"no topic {topic}: {did_you_mean(topic, [*pages, *commands])}")
