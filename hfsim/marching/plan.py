"""What was built of a scene and what was left out, with reasons and savings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hfsim.maths.matrices import dense_up_to, is_sparse
from hfsim.mechanics.force import ForcePart
from hfsim.parts.channels import kind_of
from hfsim.scene.build import Scene
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.rules import RULES

WISHED = "kept by wish, though it is zero"
"""Why a force is there that a rule would have left out."""


def plan_of(scene: Scene) -> dict[str, Any]:
    """Return the plan of a scene, JSON-ready: what is kept and what is left out.

    Parameters
    ----------
    scene : Scene
        An assembled scene.

    Returns
    -------
    dict
        ``sizes``; ``kept``, a list of what with counts; ``left_out`` and ``not_left_out``, lists of rules
        with items, reasons and savings; ``algebra``.
    """
    told = [rule.told(scene) for rule in RULES.values()]
    return {
        "model": scene.model,
        "sizes": sizes(scene),
        "free_motions": motions_of(scene),
        "kept": [*_kept(scene)],
        "left_out": [one for one in told if "items" in one],
        "not_left_out": [one for one in told if "items" not in one],
        "algebra": algebra(scene),
    }


def motions_of(scene: Scene) -> list[dict[str, Any]] | None:
    """Return the free motions of a scene with their text; None where they are not told apart."""
    motions = scene.free_motions
    return None if motions is None else [{**one._asdict(), "text": str(one)} for one in motions]


def sizes(scene: Scene) -> dict[str, int]:
    """Return the counts of an assembled scene."""
    system = scene.system
    return {
        "coordinates": system.n_x,
        "unknowns": system.n,
        "multipliers": system.n_rows,
        "terms of M": len(system.variable_mass) + bool(system.n_x > _variable(scene)),
        "terms of Q": len(system.forces),
        "parts": max(1, len(scene.parts)),
        "output columns": len(scene.deck.channels),
    }


def _variable(scene: Scene) -> int:
    return sum(body.columns.stop - body.columns.start for body in scene.system.variable_mass)


def algebra(scene: Scene) -> str:
    """Return which matrices are used, and how their cost grows."""
    system, plane = scene.system, scene.deck.dimension == 2
    constraints = system.equations.constraints if plane else system.constraints
    n, unit = (system.n, "unknowns") if plane else (system.n_x, "coordinates")
    most = dense_up_to(n, sum(one.rows for one in constraints), scene.deck.dimension)
    if is_sparse(system.equations.constant_mass):
        return f"sparse, from {most + 1} {unit} on: cost grows with the number of elements"
    grows = "cost grows with the square of the unknowns, that of a derivative with the cube"
    if scene.system.variable_mass:
        return (
            "dense at any size, because the mass matrix of lowOrder is full and changes: cost of a call "
            "grows with the unknowns, that of a derivative with their cube"
        )
    if scene.system.charts:
        return f"dense at any size, because the steps are made in body frames: {grows}"
    return f"dense: {grows}; sparse from {most + 1} {unit} on (not for lowOrder or body frames)"


# --- what is kept --------------------------------------------------------------------------------


def _kept(scene: Scene) -> Iterator[dict[str, Any]]:
    yield from _kept_bodies(scene)
    yield from _kept_joints(scene)
    for part in scene.system.forces:
        reason = WISHED if _idle(scene, part) else part.why
        yield {
            "item": part.item or "all bodies",
            "what": part.told,
            "reason": reason,
            "terms_of_Q": 1,
        } | part.counts
    for channel in scene.deck.channels:
        yield {"item": channel, "what": "output column", "reason": _needs(scene, channel), "columns": 1}
    yield {
        "item": "checks",
        "what": "energies and violations of the joints at the ends of all steps",
        "reason": "energy_drift, constraint_position and constraint_velocity of every summary",
    }


def _kept_bodies(scene: Scene) -> Iterator[dict[str, Any]]:
    for body in scene.bodies.values():
        what, reason = body.described
        count = body.columns.stop - body.columns.start
        yield {
            "item": body.item,
            "coordinates": count,
            "terms_of_M": int(count > 0),
            "what": what,
            "reason": reason,
        }


def _kept_joints(scene: Scene) -> Iterator[dict[str, Any]]:
    gone = scene.system.reduction.eliminated
    for name, members in scene.joints.items():
        left = [scene.system.constraints[k] for k in members if k not in gone]
        if left:
            solve = scene.deck.solve
            reasons = [one.why_kept for one in left]
            if solve.keep_all or "tree_joints" in solve.keep:
                reasons = [RULES["tree_joints"].kept_because(solve)]
            if name in scene.redundancy.joints:
                reasons.append("redundant equations of its loop have none")
            yield {
                "item": f"joints.{name}",
                "what": "equations, each with an unknown force or moment",
                "reason": "; ".join(dict.fromkeys(reasons)),
                "multipliers": sum(one.rows for one in left),
            }
    if rows := sum(one.rows for one in scene.system.constraints if not one.item.startswith("joints.")):
        yield {
            "item": "axes of bodies and sections",
            "what": "equations that keep them square and of their length",
            "reason": "in space they are coordinates",
            "multipliers": rows,
        }


def _idle(scene: Scene, part: ForcePart) -> bool:
    """Whether a force is zero in every state, and was not left out all the same."""
    kind, _, name = part.item.partition(".")
    entries: dict[str, Any] = getattr(scene.deck, kind) if kind in ("springs", "loads") else {}
    return part.idle or (name in entries and not entries[name].acts)


def _needs(scene: Scene, channel: str) -> str:
    kind = kind_of(channel, scene.deck)
    if kind.solves and channel.partition(".")[0] not in scene.deck.springs:
        return "asked for; needs all multipliers at output times"
    if kind.of_strains:
        return "asked for; needs the strains of the beam at output times"
    if kind.of_turns:
        return "asked for; needs full turns"
    if kind.of_scene:
        return "asked for; needs sums over the scene at output times"
    return "asked for; read at output times"


def keeping(loaded: LoadedDeck, rule: str) -> LoadedDeck:
    """Return the deck with a rule switched off, or with all of them (``all``)."""
    kept = {"keep_all": True} if rule == "all" else {"keep": (*loaded.deck.solve.keep, rule)}
    return loaded.with_solve(kept)
