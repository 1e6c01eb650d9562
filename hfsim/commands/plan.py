"""`hfsim plan`: what is built of a scene, what is left out, why, and what that saves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING, Any

import click

from hfsim.commands.check import free_motions
from hfsim.commands.decks import load_numbered
from hfsim.commands.options import count_option, setting_options, talk_options
from hfsim.output.talk import Talk
from hfsim.output.text import Column, plural, table, wrapped

if TYPE_CHECKING:
    from hfsim.scene.loading import LoadedDeck
    from hfsim.studies.plan import RuleCost

_TOLD = ("coordinates", "unknowns", "multipliers", "elements", "joint equations", "driven equations")
"""Counts that say something to all; kernels and terms are told to those who ask for more."""
_SHOWN = 8
"""Names in a list that are told to all."""
_PROOF_SHARE = 0.1
"""Part of the duration for which single rules are timed in the proof."""


@click.command()
@click.argument("decks", nargs=-1, metavar="[DECK]...")
@setting_options("model", "keep_all")
@click.option("--measure", is_flag=True, help="Run with and without each rule, in turns, and tell the times.")
@click.option(
    "--proof", is_flag=True, help="Only the table of all rules: sizes, times, differences; all shipped cases."
)
@count_option("repeats", 5, "Runs of which the median counts.")
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
        from hfsim.scene.shipped import CASES, shipped_cases

        names = decks or (*shipped_cases(), *(str(path) for path in sorted((CASES / "rules").glob("*.yaml"))))
        _prove([load_numbered(name, overrides, talk) for name in names], repeats, talk)
        return
    from hfsim.output.api import readable

    for name in decks:
        _tell(readable(load_numbered(name, overrides, talk), talk.note), measure, repeats, talk)


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
        talk.result(as_text(loaded.deck.name, facts, talk.verbose))
        talk.warn(loaded.deck.name, scene.warnings, loaded.warnings)
        if costs:
            talk.result(f"\nmeasured, CPU, medians of {repeats}:\n{table(_COSTS, costs)}")


def as_text(name: str, facts: Mapping[str, Any], verbose: bool = False) -> str:
    """Return a plan as people read it; verbose with each output column and the rules that do not fit."""
    sizes, every = facts["sizes"], facts["keep_all"]["sizes"]
    columns = [entry for entry in facts["kept"] if "columns" in entry]
    lines = [
        wrapped(
            f"model {facts['model']}, {plural(sizes['unknowns'], 'unknown')}, "
            f"{plural(sizes['multipliers'], 'multiplier')} "
            f"(with --keep-all: {every['unknowns']}, {every['multipliers']})",
            f"{name}: ",
        ),
        wrapped(
            "unknowns: coordinates that steps solve for; multipliers: unknown forces and moments in joints"
        ),
        "\n" + "\n".join(free_motions(facts)),
        "\ncomputed in every step",
        *(_kept_line(entry, verbose) for entry in facts["kept"] if entry not in columns),
        "\noutput columns: asked for, and what each needs",
        *(_column_lines(columns, verbose)),
        "\nleft out: results are the same without",
        *(line for entry in facts["left_out"] for line in _left_lines(entry, verbose)),
        *([] if facts["left_out"] else ["  nothing"]),
        *_rules_that_do_not_fit(facts["not_left_out"], verbose),
        "\n" + wrapped(f"algebra: {facts['algebra']}", ""),
    ]
    return "\n".join(lines)


def _kept_line(entry: Mapping[str, Any], verbose: bool) -> str:
    counts = _counts({k: v for k, v in entry.items() if k not in ("item", "what", "reason")}, verbose)
    return wrapped(f"{entry['item']}: {entry['what']}{counts}: {entry['reason']}")


def _column_lines(columns: Sequence[Mapping[str, Any]], verbose: bool) -> Iterable[str]:
    needs: dict[str, list[str]] = {}
    for entry in columns:
        needs.setdefault(entry["reason"].removeprefix("asked for; "), []).append(entry["item"])
    for need, items in needs.items():
        yield wrapped(f"{need}: {_some(items, verbose)}")


def _left_lines(entry: Mapping[str, Any], verbose: bool) -> Iterable[str]:
    counts = _counts(entry["saves"], verbose)
    yield wrapped(f"{entry['rule']}: {entry['leaves_out']}{counts}: {entry['reason']}")
    yield wrapped(_some(entry["items"], verbose), "    ")


def _some(names: Sequence[str], verbose: bool) -> str:
    """Return names, of many the first and how many more there are unless verbose."""
    shown = names if verbose else names[:_SHOWN]
    more = f" and {len(names) - len(shown)} more" if len(shown) < len(names) else ""
    return f"{', '.join(shown)}{more}"


def _rules_that_do_not_fit(rules: Sequence[Mapping[str, Any]], verbose: bool) -> Iterable[str]:
    if not verbose:
        kept = [one["rule"] for one in rules if not one["reason"].startswith("only when")]
        return [wrapped(f"kept by wish: {', '.join(kept)}")] if kept else []
    lines = (wrapped(f"{one['rule']}: {one['leaves_out']}: {one['reason']}") for one in rules)
    return ["\nnot left out: the scene needs them", *lines]


def _counts(counts: Mapping[str, Any], verbose: bool) -> str:
    """Return what is counted in words: unknowns and equations, and all else if verbose."""
    named = {key.replace("_", " "): value for key, value in counts.items()}
    numbers = {key: n for key, n in named.items() if isinstance(n, int) and n and (verbose or key in _TOLD)}
    parts = [f"{n} {key.removesuffix('s') if n == 1 and key in _TOLD else key}" for key, n in numbers.items()]
    parts += [value for value in named.values() if isinstance(value, str) and verbose]
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
