"""The error of a mesh, measured by a run on another one.

First on a coarser one, which is cheap, then on a richer one, whose distance is the error.  Without the time
for that a part of the distance to the coarser one is taken, all of it where that is far away: no order is
seen there.  Tolerances are loose at first; they are tightened until the distance no longer hangs on them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from hfsim.errors import HfsimError
from hfsim.marching.integration import run_integration
from hfsim.marching.record import Record
from hfsim.marching.stop import Budget
from hfsim.parts.bodies import BeamSpec
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.build import Scene, build
from hfsim.scene.points import find_marker
from hfsim.scene.schema import SolveSpec
from hfsim.trust.estimate import Compared, Estimate, no_time, why_not

UNRESOLVED = 0.05
"""Distance to a coarser mesh from which all of it is the estimate, without the time for a richer one: 0.24 to
6.7 times the true error was seen, and up to 110 times where meshes had an order already."""
LOOSE = 1e-4
"""Tolerance to begin with."""
TIGHTER = 100.0
"""Factor by which it is tightened."""
PART = {"elements": 1.0 / 6.0, "degree": 0.5}
"""Part of the distance to a mesh with half the elements, or a degree less, that is the error: 1/41 to 1/2.6
of it was seen, and 1/2.8 to 1.4 but for errors of 1e-8..."""
TOLD = 1e-3
"""...and the distance from which what a loose tolerance adds does not matter."""
ALIKE = 2.0
"""Ratio of two estimates up to which a tighter tolerance has changed nothing."""
MOST_NAMED = 3
"""Beams up to which an advice names each."""
_MOST_DEGREE = 10

Mesh = dict[str, dict[str, int]]
"""Entries of beams that make another mesh, by body."""


def mesh_error(run: Compared, budget: Budget, seconds: float) -> Estimate:
    """Run again on other meshes and return the error of the mesh.

    Parameters
    ----------
    seconds : float
        CPU time of the run [s].

    Raises
    ------
    KeyboardInterrupt
        If that ended a second run.
    """
    scene = run.legs[-1].scene
    if not meshed(scene):
        return Estimate(0.0, "no flexible beams")
    if len(run.legs) > 1:
        return Estimate(None, "models change in the run")
    if run.legs[0].done.stop is not None:
        return Estimate(None, "the run did not reach its end")
    found = Estimate(None, "")
    loose = next(_tolerances(scene.deck.solve))
    coarser = _other_mesh(scene, _coarser)
    if coarser:
        found = _measured(run, coarser, loose, budget, seconds)
        if found.error is None and budget.left <= 0.0:
            return found
    richer = _on_richer(run, budget, seconds)
    if richer.error is not None or found.error is None:
        return richer
    if found.error >= UNRESOLVED:
        return found
    if found.error < TOLD:
        return richer._replace(reason=f"{richer.reason}; {found.by} differs by {found.error:.2g}")
    part = max(PART[key] for entries in coarser.values() for key in entries)
    each = {name: part * value for name, value in found.each.items()}
    by = f"{part:.2g} of the distance to {found.by}, without the time for a richer one"
    return found._replace(error=part * found.error, each=each, by=by)


def meshed(scene: Scene) -> dict[str, BeamSpec]:
    """Return the beams of a scene that have a mesh, by name."""
    specs = {name: scene.deck.bodies[name] for name, model in scene.models.items() if MODELS[model].flexible}
    return {name: spec for name, spec in specs.items() if isinstance(spec, BeamSpec)}


def _richer(spec: BeamSpec) -> dict[str, int]:
    """Return the entries of a beam with a mesh one step richer."""
    return {"degree": spec.degree + 1} if _takes_degrees(spec) else {"elements": 2 * spec.elements}


def _takes_degrees(spec: BeamSpec) -> bool:
    return spec.takes_degrees and spec.degree < _MOST_DEGREE


def _coarser(spec: BeamSpec) -> dict[str, int]:
    if spec.degree > 3 and spec.section_degree == 1:
        return {"degree": spec.degree - 1}
    half = spec.elements // 2
    return {"elements": half} if half >= spec.fewest_elements and half % spec.equal_parts == 0 else {}


def _other_mesh(scene: Scene, change: Callable[[BeamSpec], dict[str, int]]) -> Mesh:
    changes = {name: change(spec) for name, spec in meshed(scene).items()}
    return {name: entries for name, entries in changes.items() if entries}


def _tolerances(solve: SolveSpec) -> Iterator[dict[str, Any]]:
    """Yield updates of ``solve``: tolerances from a loose one down to the run's, or none for a fixed step."""
    tolerance = max(LOOSE, solve.tolerance)
    while solve.step is None and tolerance > 1.001 * solve.tolerance:
        yield {"tolerance": tolerance}
        tolerance /= TIGHTER
    yield {}


def _on_richer(run: Compared, budget: Budget, seconds: float) -> Estimate:
    """Return the distance to a richer mesh, at tolerances ever tighter until it stays."""
    scene = run.legs[0].scene
    mesh = _other_mesh(scene, _richer)
    found = Estimate(None, "")
    for update in _tolerances(scene.deck.solve):
        latest = _measured(run, mesh, update, budget, seconds)
        if latest.error is None:
            loosely = found.error is not None and found.error >= TOLD
            return found._replace(by=f"{found.by} at a loose tolerance") if loosely else latest
        looser, found = found.error or 0.0, latest
        less, more = sorted((looser, latest.error))
        if less >= UNRESOLVED or more <= ALIKE * less:
            break
    return found


def _measured(run: Compared, mesh: Mesh, update: dict[str, Any], budget: Budget, seconds: float) -> Estimate:
    """Run on another mesh and return the distance."""
    words = _words(mesh)
    if budget.left <= 0.0:
        return Estimate(None, no_time(f"a second run with {words}", seconds, budget))
    leg = run.legs[0]
    try:
        scene = remeshed(leg.scene, mesh)
    except (HfsimError, MemoryError) as refused:
        why = str(refused).split("\n")[0] or "it does not fit into memory"
        return Estimate(None, f"{words} could not be built: {why}")
    if not _at_nodes(leg.scene) <= _at_nodes(scene):  # inside an element nothing bends by what they exert
        return Estimate(None, f"{words} has no nodes where joints are")
    solve = scene.deck.solve.model_copy(update={"max_steps": None, **update})
    record = Record(balanced=False)
    reason = why_not(run_integration(scene, solve, budget.guard(), record=record), words, seconds)
    return Estimate(None, reason) if reason else run.distance(record)._replace(by=words)


def mesh_advice(scene: Scene) -> str:
    """Return what would make the mesh error of a run smaller, as options of `hfsim run`."""
    beams, options = meshed(scene), ["--target-error 1e-2"]
    if len(beams) <= MOST_NAMED:
        if all(map(_takes_degrees, beams.values())):
            options.insert(0, _options({name: {"degree": spec.degree + 2} for name, spec in beams.items()}))
        options.insert(0, _options({name: {"elements": 2 * spec.elements} for name, spec in beams.items()}))
    return ", or ".join(options)


def _options(mesh: Mesh) -> str:
    return " ".join(f"--set bodies.{name}.{key}={n}" for name, one in mesh.items() for key, n in one.items())


def remeshed(scene: Scene, mesh: Mesh) -> Scene:
    """Return a scene with other meshes of some beams, from its start."""
    bodies = dict(scene.deck.bodies)
    for name, entries in mesh.items():
        bodies[name] = bodies[name].model_copy(update=entries)
    loaded = replace(scene.loaded, deck=scene.deck.model_copy(update={"bodies": bodies}))
    return build(loaded, scene.model, scene.models)


def _at_nodes(scene: Scene) -> set[str]:
    """Return the points of joints whose places are coordinates: those at nodes of beams."""
    points = {point for joint in scene.deck.joints.values() for point in joint.points}
    markers = {point: find_marker(point, scene.bodies, scene.deck) for point in points}
    return {point for point, marker in markers.items() if marker.place_columns is not None}


def _words(mesh: Mesh) -> str:
    kinds = dict.fromkeys(_shown(*entry) for entries in mesh.values() for entry in entries.items())
    return f"a mesh of {' and '.join(kinds)}"


def _shown(key: str, n: int) -> str:
    return f"{n} element{'s' * (n > 1)} a beam" if key == "elements" else f"{key} {n}"
