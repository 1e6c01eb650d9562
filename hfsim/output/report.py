"""What people read of one run: its table of results, what is doubtful, how it was refined."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hfsim.errors import INTERRUPTIONS
from hfsim.marching.rounding import LEAST, ROUNDING, sizes_of
from hfsim.maths.kernel import MISSING
from hfsim.output.talk import Talk, print_error
from hfsim.output.text import Column, as_table, brief, digits_left, number, plural, table, wrapped
from hfsim.parts.channels import is_judged

if TYPE_CHECKING:
    from hfsim.marching.solution import Channel, Run


def tell(
    run: Run, summary: Mapping[str, Any], folder: Path | None, talk: Talk, told: Container[str] = ()
) -> None:
    """Print the results of one run, and what the user should be warned of, save what was told before."""
    tell_doubts(run, summary, talk, told)
    cut_short = run.status == "limit" or summary["exit_code"] in (None, *INTERRUPTIONS)
    hint = "; --resume goes on" if cut_short and folder and not summary.get("refinement") else ""
    if run.status != "done":
        print_error(f"{run.name}: {run.status} at t = {run.stop_time:.6g} s: {run.reason}{hint}")
        if run.failure:
            print_error(findings(run.failure))
    elif run.exit_code:
        print_error(f"{run.name}: {run.reason}{hint}")
    if run.status == "done" and summary.get("suspicion"):
        doubt = summary["suspicion"]
        talk.note(f"{run.name}: suspicious: {doubt['reason']}\n{findings(doubt)}")
    if summary.get("ringing"):
        talk.note(f"{run.name}: {ringing_words(summary['ringing'])}")
    advice = summary.get("mesh_advice")
    if advice and not any(advice in one for one in summary["warnings"]):
        what, where = summary["mesh_error_estimate"], summary["mesh_error_estimate_channel"]
        words = f"the mesh error, about {what:.2g} in {where}, is far above the time error"
        talk.note(f"{run.name}: {words}; what helps: {advice}")
    talk.facts(summary)
    talk.result(f"{run.name}: {headline(run)}\n{as_text(run, summary, folder)}")


def tell_doubts(run: Run, summary: Mapping[str, Any], talk: Talk, told: Container[str]) -> None:
    """Print how the scene was put together and what is doubtful, save what was told before."""
    for note in (summary.get("assembly") or {}).get("notes", ()):
        talk.note(f"{run.name}: {note}")
    talk.warn(run.name, summary["warnings"], told)


def ringing_words(found: Mapping[str, Any]) -> str:
    """Return in a sentence which vibration costs steps for nothing, and what would save them."""
    what = "a vibration that no output shows"
    if found["frequency"] is not None:
        what = f"a vibration of {found['item']} at {found['frequency']:.3g} Hz that no output shows"
    return (
        f"the steps follow {what}: with --set solve.tolerance={found['tolerance']:g} they are "
        f"{found['fewer_steps']:.2g} times fewer, and {found['channel']} changes most, by "
        f"{found['change']:.1g} of its range; so would damping or a start from equilibrium save them"
    )


def headline(run: Run) -> str:
    """Return the status in a few words."""
    if run.status == "done":
        return f"done, {run.end_time:.6g} s simulated"
    return f"{run.status} at t = {run.stop_time:.6g} s"


def as_text(run: Run, summary: Mapping[str, Any], folder: Path | None) -> str:
    """Return the table of results that people read; without a folder they went to standard output."""
    facts = {
        "model": f"{run.model}; {'methods' if ',' in run.method else 'method'} {_method(run, summary)}",
        **_models(summary),
        "size": sizes(summary),
        "steps": _steps(summary),
        "CPU time": _times(summary["cpu_s"]),
        **({"kernel": f"numpy: {MISSING}"} if MISSING else {}),
        "error estimate": errors(summary),
        "latches": _happened(summary.get("latches", {}), "is open"),
        "releases": _happened(summary.get("releases", {}), "holds"),
        "energy drift": number(summary["energy_drift"]),
        **({"constraint drift": _drift(summary)} if summary["multipliers"] else {}),
    }
    lines = fact_lines(facts, folder)
    levels = level_table(summary["refinement"]) if summary.get("refinement") else []
    return "\n".join([*lines, *levels, *last_values(run, summary)])


def _happened(events: Mapping[str, float | None], else_: str) -> str:
    """Return when latches caught or springs let go, and what those do that have not.

    Examples
    --------
    >>> _happened({"joints.left": 3.25, "joints.right": None}, "is open")
    'left at 3.25 s, right is open'
    """
    names = {item.partition(".")[2]: t for item, t in events.items()}
    return ", ".join(f"{one} {else_}" if t is None else f"{one} at {t:.6g} s" for one, t in names.items())


def sizes(facts: Mapping[str, Any]) -> str:
    """Return how many unknowns and multipliers a scene has.

    Examples
    --------
    >>> sizes({"unknowns": 1, "multipliers": 0})
    '1 unknown, 0 multipliers'
    """
    return ", ".join(plural(facts[f"{one}s"], one) for one in ("unknown", "multiplier"))


def fact_lines(facts: Mapping[str, str], folder: Path | None) -> list[str]:
    """Return facts by their names, those without text left out, and where the results went."""
    facts = {**facts, "results": f"{folder}/" if folder else "standard output"}
    width = max(map(len, facts))
    return [
        wrapped(text, f"  {name.ljust(width)}  ", " " * (width + 6)) for name, text in facts.items() if text
    ]


def _method(run: Run, summary: Mapping[str, Any]) -> str:
    """Return the methods of a run, each with its stages or its order."""
    told = {name: f"{name} ({n} stages)" for name, n in (summary.get("stages") or {}).items()}
    told |= {name: f"{name} (order {n})" for name, n in (summary.get("order") or {}).items()}
    return ", ".join(told.get(name, name) for name in run.method.split(", "))


def error_of(channel: Channel, summary: Mapping[str, Any]) -> float | None:
    """Return the error of a channel in its unit: its own where it is known, else what the worst one tells."""
    each = (summary.get(f"{name}_by_channel") or {} for name in ("error", "mesh_error"))
    own = [float(errors[channel.name]) for errors in each if channel.name in errors]
    if own:
        return max(own)
    worst = [summary[name] for name in ("error_estimate", "mesh_error_estimate") if summary[name] is not None]
    return max(worst) * float(channel.values.max() - channel.values.min()) if worst else None


def errors(summary: Mapping[str, Any]) -> str:
    """Return the estimates of both errors, each with its worst channel, or why they are not known."""
    time, mesh = (_error(summary, name) for name in ("error_estimate", "mesh_error_estimate"))
    if summary.get("refinement"):
        return f"of mesh and time {time}"
    if summary["error_estimate_reason"] == summary["mesh_error_estimate_reason"] != "":
        return str(summary["error_estimate_reason"])
    told, worst = f"time error {time}", f" ({summary.get('error_estimate_channel')})"
    if summary.get("mesh_error_estimate_channel") == summary.get("error_estimate_channel"):
        told = told.removesuffix(worst)
    return f"{told}, mesh error {'about ' * bool(summary['mesh_error_estimate'])}{mesh}"


def _error(summary: Mapping[str, Any], name: str) -> str:
    error, reason, channel = summary[name], summary[f"{name}_reason"], summary.get(f"{name}_channel")
    if error is None:
        return f"not known: {reason}"
    return f"{error:.2g}" + (f" ({channel or reason})" if channel or reason else "")


_LEVELS = (
    Column("refined"),
    Column("method"),
    Column("tolerance", form=".1e", spare=2),
    Column("unknowns", form=number),
    Column("steps", form=number, spare=1),
    Column("CPU [s]", "cpu_s", ".3f"),
    Column("change", lambda level: brief(level["change"]) if level["status"] == "done" else level["status"]),
    Column("error", "estimate", brief),
    Column("mesh", lambda level: _mesh(level["bodies"])),
)


def level_table(found: Mapping[str, Any]) -> list[str]:
    """Return the levels of a refinement, a row each, and which was chosen and why."""
    chosen = found["chosen"]
    level = Column("level", lambda one: f"{one['number']}{'*' * (one['number'] == chosen['number'])}")
    where = f" in {chosen['channel']}" if chosen["channel"] else ""
    came = f"target error {found['target']:g}: {found['status']}, estimate {brief(found['estimate'])}{where}"
    fixed = ", ".join(found["fixed_meshes"])
    marks = "mesh: elements x degree; change: of the level refined, relative to the channel's range"
    return [
        wrapped(f"{came}; {found['cpu_s']:.2f} s CPU in {len(found['levels'])} levels"),
        table([level, *_LEVELS], found["levels"], "    "),
        wrapped(marks, "    "),
        wrapped(f"* {chosen['why']}", "    "),
        *(one if "  " in one.lstrip() else wrapped(one.lstrip(), "    ") for one in method_lines(found)),
        *([f"    not counted: mesh errors of {fixed}, whose elements the deck fixes"] if fixed else []),
    ]


def _mesh(bodies: Mapping[str, Mapping[str, int]]) -> str:
    mesh = ", ".join(f"{body} {n['elements']} x {n['degree']}" for body, n in bodies.items())
    return mesh if len(mesh) <= _WIDEST else f"{mesh[:_WIDEST]}..."


_RACES = (
    Column("race", "method"),
    Column("tolerance", form=".1e", spare=1),
    Column("unknowns", form=number, spare=2),
    Column("CPU [s]", "cpu_s", ".3f"),
    Column("against"),
    Column("CPU [s]", "to_beat_s", ".3f", 3),
    Column("done", "share", ".0%", 4),
    Column("error in time", "error", brief),
    Column("outcome", lambda race: ": ".join(filter(None, (race["outcome"], race["reason"])))),
)


def method_lines(found: Mapping[str, Any] | None) -> list[str]:
    """Return how the method of a refinement was chosen, and the races that this rests on."""
    if not found:
        return []
    lines = [f"    method {found['method_choice']}"]
    if not found["probes"]:
        return lines
    lines += table(_RACES, found["probes"], "    ").split("\n")
    share = found["probing_cpu_s"] / max(found["cpu_s"], 1e-9)
    return [*lines, f"    races took {found['probing_cpu_s']:.2f} s of CPU, {share:.0%} of the whole"]


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
    if auto.get("not_rigid"):
        spent.append(f"not rigid: {auto['not_rigid']}")
    rows = {"share of time": "; ".join(spent)}
    for n, one in enumerate(auto["switches"], 1):
        rows[f"change {n}"] = (
            f"{one['time']:.4g} s: {one['body']} from {one['model']} to {one['next_model']}: "
            f"{one['reason']}; energy {_gained(one['energy_gained'])}"
        )
    return rows


def _gained(energy: float | None) -> str:
    return "beyond all numbers" if energy is None else f"{energy:+.2g} J"


_CLASSES = {
    "numerical": "numerical: the method makes it, not the model or the mechanism",
    "model": "model: what it, or its mesh, leaves out makes it",
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


def _steps(summary: Mapping[str, Any]) -> str:
    keys = {"rejected": "rejected", "newton_iterations": "Newton iterations", "evaluations": "evaluations"}
    parts = [f"{number(summary[key])} {words}" for key, words in keys.items() if summary[key] is not None]
    return ", ".join([number(summary["steps"]), *parts])


def _times(times: Mapping[str, float]) -> str:
    parts = {phase: time for phase, time in times.items() if phase != "total"}
    parts["other"] = times.get("total", 0.0) - sum(parts.values())
    told = [f"{phase.replace('_', ' ')} {time:.3f}" for phase, time in parts.items() if time >= _LEAST_TIME]
    return f"{times.get('total', 0.0):.3f} s ({', '.join(told)})"


def _drift(summary: Mapping[str, Any]) -> str:
    position, velocity = (number(summary[f"constraint_{what}"]) for what in ("position", "velocity"))
    return f"position {position}, velocity {velocity}"


_LEAST_TIME = 5e-4
"""Phases that take less are not told [s]."""


def last_values(run: Run, summary: Mapping[str, Any]) -> list[str]:
    """Return the last value of each channel, a line each, with the digits that its error leaves."""
    if not len(run.t):
        return ["  no output time was reached"]
    sizes = sizes_of(run.channels, run.outlines)
    rows = [
        [f"  {one.name}", _last(one, sizes.get(one.unit, 0.0), error_of(one, summary)), one.unit]
        for one in run.channels
    ]
    if not rows:
        return []
    return [f"  at t = {run.end_time:.9g} s", as_table(rows)]


def _last(channel: Channel, size: float, error: float | None) -> str:
    """Return the last value of a channel; zero where it is rounding, but not of a residual."""
    value = float(channel.values[-1])
    rounded = is_judged(channel.name) and abs(value) <= max(ROUNDING * size, LEAST)
    return "0" if rounded else sensible(value, error)


_UNKNOWN_DIGITS, _MOST_DIGITS, _LEAST_DIGITS = 6, 9, 4


def sensible(value: float, error: float | None) -> str:
    """Return a number with the digits that its error leaves, and one more.

    Examples
    --------
    >>> sensible(1.23456789, 1e-4), sensible(1.23456789, None), sensible(1.23456789, 0.0), sensible(1.5, 9.0)
    ('1.23457', '1.23457', '1.23456789', '1.5')
    """
    beyond = 1 + digits_left(value, error or 0.0, _LEAST_DIGITS - 1, _MOST_DIGITS - 1)
    return f"{value:.{_UNKNOWN_DIGITS if error is None else beyond}g}"
