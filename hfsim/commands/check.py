"""`hfsim check`: validate and assemble decks; run nothing, write nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import click

from hfsim.commands import import_libraries, report_error, worst
from hfsim.commands.decks import load_numbered
from hfsim.commands.options import setting_options, talk_options
from hfsim.errors import HfsimError
from hfsim.output.talk import Talk
from hfsim.output.text import at_terminal, plural, wrapped

_NOUNS = ("joint", "spring", "load", "unknown", "multiplier")
"""Of what an assembled scene has, in the order it is told."""
_ALWAYS = ("unknown", "multiplier")
"""What is told even when there is none."""
_MOST = 4
"""Other ways to close the joints that are told."""
_MOST_MOTIONS = 12
"""Bodies whose free motions are told."""


@click.command()
@click.argument("decks", nargs=-1, required=True, metavar="DECK...")
@setting_options("model")
@talk_options
def check(decks: tuple[str, ...], overrides: tuple[str, ...], talk: Talk) -> None:
    """Validate and assemble each DECK; every one is looked at, exit code 2 if any is bad."""
    import_libraries()
    raise click.exceptions.Exit(worst([_check_one(argument, overrides, talk) for argument in decks]))


def _check_one(argument: str, overrides: tuple[str, ...], talk: Talk) -> int:
    from hfsim.output.api import checked, readable

    try:
        loaded = readable(load_numbered(argument, overrides, talk), talk.note)
        facts = checked(loaded)
    except HfsimError as error:
        code = report_error(error)
        talk.facts({"deck": argument, "ok": False, "error": str(error)})
        return code
    talk.facts({"deck": argument, "ok": True, **facts})
    lines = [*_assembled(facts.get("assembly") or {}), *free_motions(facts)]
    every = [(f"{argument}: ", f"ok: {describe(facts)}"), *(("  ", line) for line in lines)]
    fit = at_terminal()
    talk.result("\n".join(wrapped(line, head, "    ") if fit else head + line for head, line in every))
    talk.warn(argument, facts.get("warnings", ()), loaded.warnings)
    for key, value in facts.items():
        talk.detail(f"  {key}: {value}")
    return 0


def _assembled(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the joints were closed, and how else they could be."""
    from hfsim.scene.assembly import angles_of

    yield from facts.get("notes", ())
    branches = facts.get("branches", ())
    for branch in branches[:_MOST]:
        others = [facts["closed"], *(one for one in branches if one is not branch)]
        yield f"or with {angles_of(branch)}: {_taking(branch, others)} takes this one"
    if len(branches) > _MOST:
        yield f"or in {len(branches) - _MOST} other ways (--json lists them)"


def _taking(branch: Mapping[str, Any], others: Sequence[Mapping[str, Any]]) -> str:
    """Return what in a deck takes a way to close and none of the others, the first of which is taken now.

    Those angles that set it apart from most come first.  One that another way does not have is stated now.
    """
    from hfsim.scene.start import APART

    if not all(isinstance(turn, float) for turn in branch.values()):
        return "a rough angle or orientation under 'initial'"

    def off(body: str, other: Mapping[str, Any]) -> float:
        if body not in other:
            return math.inf
        return round(abs(math.remainder(branch[body] - other[body], math.tau)), 6)

    chosen, left = list[str](), list(others)
    while left and len(chosen) < len(branch):
        free = (one for one in branch if one not in chosen)
        sizes = {one: (sum(off(one, way) > APART for way in left), off(one, others[0])) for one in free}
        body = max(sizes, key=sizes.__getitem__)
        if chosen and not sizes[body][0]:
            break
        chosen, left = [*chosen, body], [way for way in left if off(body, way) <= APART]
    angles = (f"{body}: {{angle: {math.degrees(branch[body]):.4g} deg}}" for body in chosen)
    return f"'initial: {{{', '.join(angles)}}}'"


def free_motions(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield what the joints leave free at the start, a line each."""
    if "free_motions" not in facts:
        return
    motions = facts["free_motions"]
    if motions is None:
        yield "free motions: not told apart in mechanisms of so many bodies"
        return
    count = sum(motion["number"] for motion in motions)
    yield f"free motions, bodies taken as rigid: {count or 'none'}"
    yield from (f"  {motion['text']}" for motion in motions[:_MOST_MOTIONS])
    if len(motions) > _MOST_MOTIONS:
        yield f"  and of {len(motions) - _MOST_MOTIONS} other bodies (--json lists them)"


def describe(facts: Mapping[str, Any]) -> str:
    """Return the facts of an assembled scene in one line.

    Examples
    --------
    >>> describe({"bodies": {"beam": 2, "rigid": 1}, "joints": 3, "unknowns": 40, "multipliers": 6})
    '2 beams, 1 rigid body, 3 joints, 40 unknowns, 6 multipliers'
    """
    from hfsim.parts.bodies import BODIES

    parts = [plural(count, BODIES[kind].noun) for kind, count in facts["bodies"].items()]
    parts += [plural(facts[f"{one}s"], one) for one in _NOUNS if facts.get(f"{one}s") or one in _ALWAYS]
    if count := facts.get("degrees_of_freedom"):
        parts.append(f"{plural(count, 'degree')} of freedom")
    return ", ".join(parts)
