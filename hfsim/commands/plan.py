"""`hfsim plan`: what is built of a scene, what is left out, why, and what that saves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands.check import free_motions
from hfsim.commands.decks import CASES, load_numbered, shipped_cases
from hfsim.commands.options import repeats_option, setting_options, talk_options
from hfsim.output.talk import Talk
from hfsim.output.text import Column, table

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.plan import RuleCost

_PROOF_SHARE = 0.1
"""Part of the duration for which single rules are timed in the proof."""


@click.command()
@click.argument("decks", nargs=-1, metavar="[DECK]...")
@setting_options("model", "keep_all")
@click.option("--measure", is_flag=True, help="Run with and without each rule, in turns, and tell the times.")
@click.option(
    "--proof", is_flag=True, help="Only the table of all rules: sizes, times, differences; all shipped cases."
)
@repeats_option("Runs of which the median counts.", 5)
@talk_options
def plan(
    decks: tuple[str, ...],
    overrides: tuple[str, ...],
    measure: bool,
    proof: bool,
    repeats: int,
    talk: Talk,
) -> None:
    """Tell what is built of each DECK and what is left out, with reasons and savings; nothing is written."""
    if not decks and not proof:
        raise click.UsageError("name a deck, or --proof for all shipped cases")
    if proof:
        names = decks or (*shipped_cases(), *(str(path) for path in sorted((CASES / "rules").glob("*.yaml"))))
        _prove([load_numbered(name, overrides, talk) for name in names], repeats, talk)
        return
    for name in decks:
        _tell(load_numbered(name, overrides, talk), measure, repeats, talk)


def _tell(loaded: LoadedDeck, measured: bool, repeats: int, talk: Talk) -> None:
    from hfsim.marching.plan import keeping, plan_of, sizes
    from hfsim.scene.build import build

    scene = build(loaded)
    facts = plan_of(scene)
    facts["keep_all"] = {"sizes": sizes(build(keeping(loaded, "all")))}
    costs: list[RuleCost] = []
    try:
        if measured:
            from hfsim.studies.plan import measure

            costs.extend(measure(loaded, repeats))
    finally:  # what is known when a signal comes is told
        if measured:
            facts["measured"] = [cost.facts() for cost in costs]
        talk.facts({"name": loaded.deck.name, **facts})
        talk.result(as_text(loaded.deck.name, facts))
        talk.warn(loaded.deck.name, scene.warnings)
        if costs:
            talk.result(f"\nmeasured, CPU, medians of {repeats}:\n{table(_COSTS, costs)}")


def as_text(name: str, facts: Mapping[str, Any]) -> str:
    """Return a plan as people read it."""
    sizes, every = facts["sizes"], facts["keep_all"]["sizes"]
    lines = [
        f"{name}: model {facts['model']}, {sizes['unknowns']} unknowns, {sizes['multipliers']} multipliers "
        f"(with --keep-all: {every['unknowns']}, {every['multipliers']})",
        "\n" + "\n".join(free_motions(facts)),
        "\nkept",
        *(_kept_line(entry) for entry in facts["kept"]),
        "\nleft out",
        *(line for entry in facts["left_out"] for line in _left_lines(entry)),
        "\nnothing to leave out",
        *(f"  {entry['rule']}: {entry['leaves_out']}: {entry['reason']}" for entry in facts["not_left_out"]),
        f"\nalgebra: {facts['algebra']}",
    ]
    return "\n".join(lines)


def _kept_line(entry: Mapping[str, Any]) -> str:
    counts = _counts({k: v for k, v in entry.items() if k not in ("item", "what", "reason")})
    return f"  {entry['item']}: {entry['what']}{counts}: {entry['reason']}"


def _left_lines(entry: Mapping[str, Any]) -> Iterable[str]:
    yield f"  {entry['rule']}: {entry['leaves_out']}{_counts(entry['saves'])}: {entry['reason']}"
    yield f"    {', '.join(entry['items'])}"


def _counts(counts: Mapping[str, Any]) -> str:
    parts = [
        f"{key.replace('_', ' ')} {value}"
        for key, value in counts.items()
        if isinstance(value, int) and value
    ]
    parts += [str(value) for value in counts.values() if isinstance(value, str)]
    return f" [{', '.join(parts)}]" if parts else ""


def _pair(form: str) -> Callable[[tuple[float, float]], str]:
    return lambda values: " / ".join(format(value, form) for value in values)


_COSTS = (
    Column("rule"),
    Column("scene"),
    Column("unknowns", form=_pair("d")),
    Column("multipliers", form=_pair("d")),
    Column("call [us]", "call_us", _pair(".0f")),
    Column("run [s]", "run_s", _pair(".3f")),
    Column("ratio", lambda cost: cost.run_s[0] / cost.run_s[1], ".2f"),
    Column("m, rad", "difference", ".0e"),
    Column("other", "difference_of_rest", ".0e"),
)
"""The table of rules: sizes, times and differences; pairs are without / with the rule."""


def _prove(decks: Sequence[LoadedDeck], repeats: int, talk: Talk) -> None:
    from hfsim.studies.plan import measure

    costs: list[RuleCost] = []
    try:
        for loaded in decks:
            for cost in measure(loaded, repeats, _PROOF_SHARE):
                costs.append(cost)
                ratio = cost.run_s[0] / cost.run_s[1]
                talk.note(f"{cost.scene}, {cost.rule}: {ratio:.2f}, {cost.difference:.0e}")
    finally:
        _tell_proof(costs, len(decks), repeats, talk)


def _tell_proof(costs: list[RuleCost], scenes: int, repeats: int, talk: Talk) -> None:
    from hfsim.scene.rules import RULES
    from hfsim.studies.plan import ALL

    order = [*RULES, ALL]
    costs.sort(key=lambda cost: order.index(cost.rule))
    whole = {cost.scene: cost.run_s[0] / cost.run_s[1] for cost in costs if cost.rule == ALL}
    silent = [name for name in RULES if name not in {cost.rule for cost in costs}]
    talk.facts({"proof": [cost.facts() for cost in costs], "ratios": whole, "never_fired": silent})
    talk.result(f"without / with each rule, CPU, medians of {repeats} taken in turns\n{table(_COSTS, costs)}")
    if whole:
        factor = median(whole.values())
        talk.result(f"all rules together: {factor:.2f} times less CPU, median of {len(whole)} scenes")
    if len(whole) == scenes:
        talk.result(f"fired in none of them: {', '.join(silent) or 'none'}")
