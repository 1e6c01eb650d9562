"""What was built of a scene and what was left out, with reasons and savings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from hfsim.maths.matrices import DENSE_UP_TO, is_sparse
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.parts.bodies.linear import LinearElasticForce
from hfsim.parts.bodies.low_order import LowOrderBeam
from hfsim.parts.bodies.low_order_body import LowOrderBody
from hfsim.parts.bodies.nodal import NodalBeam
from hfsim.parts.bodies.rigid import FoldedBody
from hfsim.parts.elements.forces import ElasticForce, KelvinVoigtForce
from hfsim.scene.build import Scene
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.rules import RULES

NOT_LINEAR = "not linear in the coordinates"
"""Why a constraint that does not say it needs multipliers."""


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
        "kept": [*_kept(scene)],
        "left_out": [one for one in told if "items" in one],
        "not_left_out": [one for one in told if "items" not in one],
        "algebra": algebra(scene),
    }


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
    if is_sparse(scene.system.equations.constant_mass):
        return f"sparse, from {DENSE_UP_TO + 1} coordinates on: cost grows with the number of elements"
    grows = "cost grows with the square of the unknowns, that of a derivative with the cube"
    if scene.system.variable_mass:
        return (
            "dense at any size, because the mass matrix of lowOrder is full and changes: cost of every call "
            "grows with the cube of the unknowns"
        )
    if scene.system.charts:
        return f"dense at any size, because the steps are made in body frames: {grows}"
    return f"dense: {grows}; sparse from {DENSE_UP_TO + 1} coordinates on (not for lowOrder or body frames)"


# --- what is kept --------------------------------------------------------------------------------


def _kept(scene: Scene) -> Iterator[dict[str, Any]]:
    yield from _kept_bodies(scene)
    yield from _kept_joints(scene)
    for part in scene.system.forces:
        yield {
            "item": part.item or "all bodies",
            "what": _words(part),
            "reason": _why_force(part),
        } | _kernel(part)
    for channel in scene.deck.channels:
        yield {"item": channel, "what": "output column", "reason": _needs(channel), "columns": 1}
    yield {
        "item": "checks",
        "what": "energies and violations of the joints at the ends of all steps",
        "reason": "energy_drift, constraint_position and constraint_velocity of every summary",
    }


def _kept_bodies(scene: Scene) -> Iterator[dict[str, Any]]:
    for name, body in scene.bodies.items():
        count = body.columns.stop - body.columns.start
        fact = {"item": f"bodies.{name}", "coordinates": count, "terms_of_M": int(count > 0)}
        if isinstance(body, FoldedBody):
            yield fact | {"what": "points of the ground", "reason": "cannot move"}
        elif isinstance(body, LowOrderBody):
            yield fact | {
                "what": "frame, axial and transverse coordinates",
                "reason": f"beam of model {scene.model}, mass matrix anew in every state",
            }
        elif isinstance(body, NodalBeam):
            elements = body.mesh.count
            yield fact | {"what": f"positions and slopes of {elements} elements", "reason": "flexible"}
        else:
            yield fact | {"what": "place and angle", "reason": "rigid: no elastic coordinates"}


def _kept_joints(scene: Scene) -> Iterator[dict[str, Any]]:
    gone = scene.system.reduction.eliminated
    for name, members in scene.joints.items():
        left = [scene.system.constraints[k] for k in members if k not in gone]
        if left:
            reasons = [getattr(one, "why_kept", NOT_LINEAR) for one in left]
            if not scene.left_out["tree_joints"]:
                reasons = [RULES["tree_joints"].kept_because(scene.deck.solve)]
            yield {
                "item": f"joints.{name}",
                "what": "multipliers",
                "reason": "; ".join(dict.fromkeys(reasons)),
                "multipliers": sum(one.rows for one in left),
            }


def _words(part: ForcePart) -> str:
    doc = (type(part).__doc__ or "").strip().split("\n")[0]
    return doc.rstrip(".")


def _why_force(part: ForcePart) -> str:
    """Return why a force is there; what is zero and was not left out is there by wish."""
    wished = "kept by wish, though it is zero"
    if isinstance(part, ConstantForce):
        return "gravity" if part.force.any() else wished
    if isinstance(part, KelvinVoigtForce):
        return "damped material" if part.dissipates else wished
    if isinstance(part, ElasticForce | LinearElasticForce | LowOrderBeam):
        return "flexible"
    idle = not any(np.any(getattr(part, size, 0.0)) for size in ("stiffness", "damping", "force", "moment"))
    return wished if idle else "not zero"


def _kernel(part: ForcePart) -> dict[str, Any]:
    """Return the counts of a force: one kernel serves all its elements in one call."""
    facts: dict[str, Any] = {"terms_of_Q": 1}
    if isinstance(part, ElasticForce):
        facts |= {"kernels": 1, "elements": len(part.elements.columns), "integrals": _integrals(part.law)}
    elif isinstance(part, KelvinVoigtForce):
        points = part.axial.shape[1]
        facts |= {"kernels": 1, "elements": len(part.axial), "integrals": f"{points} Gauss points an element"}
    return facts


def _integrals(law: object) -> str:
    axial, bending = getattr(law, "axial_points", 0), getattr(law, "bending_points", 0)
    if axial:
        return f"{axial} Gauss points an element for the axial energy, {bending} for bending"
    return "exact, done beforehand"


def _needs(channel: str) -> str:
    quantity = channel.rpartition(".")[2]
    if quantity in ("force_x", "force_y", "moment"):
        return "asked for; needs all multipliers at output times"
    if quantity in ("angle", "deflection", "elongation"):
        return "asked for; needs the full turns of the body frame"
    if channel.startswith("energy."):
        return "asked for; needs the energies at output times"
    return "asked for; read at output times"


def keeping(loaded: LoadedDeck, rule: str) -> LoadedDeck:
    """Return the deck with a rule switched off, or with all of them (``all``)."""
    solve = loaded.deck.solve
    update = {"keep_all": True} if rule == "all" else {"keep": (*solve.keep, rule)}
    deck = loaded.deck.model_copy(update={"solve": solve.model_copy(update=update)})
    return replace(loaded, deck=deck)
