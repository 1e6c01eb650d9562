"""Modes and Campbell diagrams as people read them, and the columns of their tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.output.text import Column, digits_left, plural, table, wrapped

if TYPE_CHECKING:
    from hfsim.studies.modes import Campbell, Mode, Modes
    from hfsim.studies.modes.state import About
    from hfsim.studies.modes.sticking import Sticking

MODE_COLUMNS = (
    *("mode", "frequency", "damping_ratio", "kind", "natural_frequency", "growth_rate", "uncertainty"),
    Column("bodies", lambda row: " ".join(f"{name}:{share:.4f}" for name, share in row["bodies"].items())),
)
"""Columns of ``modes.csv``: frequencies in Hz, rates in 1/s."""
PERIODIC_COLUMNS = (
    *("mode", "frequency", "growth_rate", "uncertainty", "kind"),
    Column("multiplier_real", lambda row: row["multiplier"][0]),
    Column("multiplier_imag", lambda row: row["multiplier"][1]),
    MODE_COLUMNS[-1],
)
"""The same of modes about a periodic motion."""
CAMPBELL_COLUMNS = ("rate", *MODE_COLUMNS)
"""Columns of ``campbell.csv``; the rate in rad/s."""
_TEXT = (
    Column("mode", "number", "d"),
    Column("frequency [Hz]", "frequency", lambda value: f"{value:.7g}"),
    Column("damping ratio", lambda mode: mode, lambda mode: _ratio(mode)),
    Column("growth [1/s]", "growth", lambda value: f"{value:.4g}" if value else "-", 1),
    Column("kind"),
    Column("moves", "mostly"),
)
_OF_PERIOD = (
    _TEXT[0],
    Column("frequency [Hz]", lambda one: _certain(one.frequency, one.uncertainty / (2.0 * np.pi), 7)),
    Column("multiplier", lambda one: _certain(abs(one.multiplier), _off(one), 7)),
    Column("growth [1/s]", lambda one: _growth(one), spare=1),
    *_TEXT[4:],
)
_MOST_TOLD = 6
_FAR = 1.0
"""Way to a steady rotation that is told [rad]."""
_STILL = 1e-9
"""Speed over the size [1/s] that is none."""


def _ratio(mode: Mode) -> str:
    return f"{mode.damping_ratio:.4g}" if mode.value.imag and mode.value.real else "-"


def _off(mode: Mode) -> float:
    """Return how far off a multiplier may be."""
    assert mode.multiplier is not None and mode.about.period is not None
    return abs(mode.multiplier) * mode.about.period * mode.uncertainty


def _certain(value: float, off: float, most: int) -> str:
    """Return a value with the digits, most of all, that are certain where it may be off by so much.

    Examples
    --------
    >>> _certain(0.0913029, 1e-5, 7), _certain(0.0913029, 1e-9, 7), _certain(2.0, 3.0, 7)
    ('0.0913', '0.0913029', '2')
    """
    return f"{value:.{digits_left(value, off, 1, most)}g}"


def _growth(mode: Mode) -> str:
    return _certain(mode.growth, mode.uncertainty, 4) if mode.growth else "-"


def modes_text(found: Modes, place: str) -> str:
    """Return the modes of one state, and where they were written."""
    motions, scene = found.about.motions, found.about.scene
    size = f"{plural(motions.mass.shape[0], 'unknown')}, {plural(motions.jacobian.shape[0], 'multiplier')}"
    lines = [f"{scene.deck.name}, {scene.model}: modes about {_state(found)}; {size}"]
    lines += [wrapped(one) for one in state_warnings(found)]
    lines.append(table(_TEXT if found.about.period is None else _OF_PERIOD, found.modes))
    lines += [wrapped(one) for one in _verdict(found)]
    return "\n".join([*lines, f"  results: {place}"] if place else lines)


def _state(found: Modes) -> str:
    facts = found.about.facts()
    words = {"start": "the start", "equilibrium": "the equilibrium", "steady": "a steady rotation"}
    if facts["period"] is not None:
        return f"the motion of period {facts['period']:.6g} s from {facts['time']:.6g} s on"
    told = words.get(facts["state"], f"the state of the run at {facts['time']:.6g} s")
    if facts["spin"] is not None:
        rate = float(np.linalg.norm(facts["spin"]))
        told += f", seen from axes that turn at {rate:.6g} rad/s" if rate else ""
    if facts["rotors"]:
        own = ", ".join(f"{name} at {one:.6g} rad/s" for name, one in facts["rotors"].items() if one)
        told += f"; by themselves turn {own}"
    return told


def state_warnings(found: Modes) -> Iterator[str]:
    """Yield what keeps the frequencies from being those of a lasting state."""
    facts = found.about.facts()
    if not found.about.lasting:
        away = facts["away_from_equilibrium"]
        far = f", which is about {away:.2g} m away" if away < found.about.size else ""
        fast = facts["speed"] > _STILL * found.about.size
        moving = f" and move at {facts['speed']:.3g} m/s" if fast else ""
        yield (
            f"no equilibrium{far}: bodies accelerate by {facts['acceleration']:.3g} m/s2{moving} (mean "
            "square by mass); modes are those of the moment: --about equilibrium, or steady, looks for a "
            "state that lasts"
        )
    free, scene = [mode.change.real for mode in found.modes if mode.free], found.about.scene
    if found.about.state == "equilibrium":
        from hfsim.scene.equilibrium import one_of_many, passed

        yield from passed(scene, found.about.motions.x[None], found.about.t)
        if free:
            yield one_of_many(scene, scene.system.reduction.free_rates(np.array(free)))
    if found.uneven and facts["period"] is not None:
        yield (
            "what acts is other a period later: modes are those of a motion that goes on as in this period; "
            "say the period of all laws and drivers"
        )
    elif found.uneven:
        yield (
            "no steady rotation: what acts or holds, such as weight across the axis or a bearing that is not "
            "alike all around, is other after a part of a turn; modes are those at this angle"
        )
    yield from _of_search(found.about, "in this state")
    yield from _of_friction(found.sticking)


def _of_search(about: About, where: str) -> Iterator[str]:
    """Yield what sets a steady rotation apart from the state next to which it was sought."""
    if about.ended:
        own = ", ".join(f"{name} at {rate:.6g} rad/s" for name, rate in about.ended.items() if rate)
        yield (
            f"turning by themselves where it was sought: {own}; what acts on them ends that, and {where} "
            "they turn with everything else"
        )
    if about.moved > _FAR:
        yield (
            f"{where} the steady rotation is {about.moved:.2g} rad away from where it was sought: none was "
            "found nearer"
        )


def _of_friction(sticking: Sequence[Sticking]) -> Iterator[str]:
    """Yield what friction near rest makes of modes."""
    for one in sticking[:_MOST_TOLD]:
        yield (
            f"{one.place} sticks in this state and counts as a damper of {one.damping:.4g} {one.unit}, its "
            f"level over its velocity: --set {one.place}=null has the modes without it"
        )
    if len(sticking) > _MOST_TOLD:
        yield f"so does {plural(len(sticking) - _MOST_TOLD, 'more friction')}"


def _verdict(found: Modes) -> Iterator[str]:
    """Yield what grows, what nothing holds, and whether any mode may be missing."""
    for mode in found.unstable[:_MOST_TOLD]:
        how = "swings more and more" if mode.kind == "flutter" else "goes away"
        yield f"unstable: mode {mode.number}, {mode.kind}: it {how}, by exp({mode.growth:.4g} t)"
    if len(found.unstable) > _MOST_TOLD:
        yield f"and {plural(len(found.unstable) - _MOST_TOLD, 'more unstable mode')}"
    if found.unstable and found.about.state == "equilibrium":
        yield "this equilibrium is not stable: hfsim static tells where the scene comes to rest"
    free = [mode.number for mode in found.modes if mode.free]
    if free:
        yield f"free: nothing brings back {plural(len(free), 'mode')} ({_listed(free)}), of frequency zero"
    if not found.unstable:
        looked = "looked at" if found.about.period else "next to rest"
        yield "none is unstable" + ("" if found.whole else f" among those {looked}")
    if found.about.period:
        often = f"{1.0 / found.about.period:.6g} Hz"
        yield f"frequencies are known but for multiples of {often}; what fades in a period is left out"
    if not found.complete:
        yield "whether one is missing between them could not be checked: try another --count"


def _listed(numbers: Sequence[int | str]) -> str:
    shown = ", ".join(map(str, numbers[:_MOST_TOLD]))
    return shown + (", ..." if len(numbers) > _MOST_TOLD else "")


def campbell_text(result: Campbell, place: str) -> str:
    """Return frequencies against rates, crossings and what is unstable."""
    scene = result.founds[0].about.scene
    names = [Column("rate [rad/s]", "rate", ".5g")]
    names += [
        Column(f"mode {k}", f"mode {k}", lambda one: "-" if one is None else one, k)
        for k in range(1, len(result.tracks) + 1)
    ]
    rows = [
        {"rate": rate, **{f"mode {k}": _cell(track[j]) for k, track in enumerate(result.tracks, 1)}}
        for j, rate in enumerate(result.rates.tolist())
    ]
    lines = [f"{scene.deck.name}, {scene.model}: frequencies [Hz] in steady rotation, {result.view}"]
    if result.unsteady:
        rates = _listed([f"{rate:.4g}" for rate in result.unsteady])
        told = f"no steady rotation at {rates} rad/s: neither frequencies nor crossings"
        lines.append(wrapped(told))
    lines += [wrapped(one) for one in _of_missed(result.missed)]
    for rate, found in zip(result.rates, result.founds, strict=True):
        lines += [wrapped(one) for one in _of_search(found.about, f"at {rate:.6g} rad/s")]
    lines.append(table(names, rows))
    lines += [wrapped(one) for one in _of_guesses(result.guessed)]
    stuck = {one.place: one for found in result.founds for one in found.sticking}
    lines += [wrapped(one) for one in _of_friction(list(stuck.values()))]
    facts = result.facts()
    for one in facts["crossings"]:
        often = "once" if one["order"] == 1 else f"{one['order']} times"
        what = f"excited {often} a revolution" if one["order"] else "no frequency left: critical"
        lines.append(f"  mode {one['mode']} at {one['rate']:.6g} rad/s, {one['frequency']:.6g} Hz: {what}")
    for one in facts["onsets"]:
        where = f"at {one['rate']:.6g} rad/s, {one['frequency']:.6g} Hz"
        lines.append(f"  mode {one['mode']} {where}: unstable {one['grows']}")
    for one in facts["unstable"][:_MOST_TOLD]:
        told = f"by exp({one['growth_rate']:.4g} t)"
        lines.append(f"  unstable: mode {one['mode']} at {one['rate']:.6g} rad/s, {one['kind']}, {told}")
    if len(facts["unstable"]) > _MOST_TOLD:
        lines.append(f"  and {len(facts['unstable']) - _MOST_TOLD} more, see campbell.csv")
    return "\n".join([*lines, f"  results: {place}"] if place else lines)


def _of_missed(missed: dict[float, str]) -> Iterator[str]:
    """Yield at which rates no modes were found, and what may be unknown for it."""
    if missed:
        why = next(iter(missed.values()))
        rates = _listed([f"{rate:.4g}" for rate in missed])
        yield (
            f"left out, as no steady rotation was found there: {rates} rad/s ({why}); between "
            "the rates beside these what is critical, excited or grows may be missing or told less exactly"
        )


def _of_guesses(guessed: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield which modes could not be followed for sure."""
    for one in guessed[:_MOST_TOLD]:
        where = f"mode {one['mode']} between {one['from']:.4g} and {one['to']:.4g} rad/s"
        if one["lost"]:
            yield f"{where} is lost: none beyond, of those looked at, has its shape; a larger --count may"
        else:
            yield f"{where} may have become another than told: shapes change too fast there to be followed"
    if len(guessed) > _MOST_TOLD:
        yield f"and {len(guessed) - _MOST_TOLD} more, see modes.json"


def _cell(mode: Mode | None) -> str | None:
    if mode is None:
        return None
    return f"{mode.frequency:.6g}" + ("*" if mode.unstable else "")


def columns_of(found: Modes) -> Sequence[Any]:
    """Return the columns of ``modes.csv``."""
    return MODE_COLUMNS if found.about.period is None else PERIODIC_COLUMNS


def mode_rows(found: Modes) -> list[dict[str, Any]]:
    """Return the rows of ``modes.csv``."""
    return [mode.facts() for mode in found.modes]
