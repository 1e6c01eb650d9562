"""What follows from the points of a bench: the Pareto front, and which one is recommended."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from hfsim.parts.bodies.models import MODELS
from hfsim.studies.agreement import tidy
from hfsim.studies.bench.points import Cell, Point

TARGETS = {"1 %": 1e-2, "0.01 %": 1e-4, "1e-6": 1e-6}
"""Errors, relative to the range of the channel, for which a method is recommended."""

_UNKNOWN = "the reference is not known better"
_BETTER = 0.8
"""Factor by which an error must fall to be worth more time."""


def pareto(points: Sequence[Point], total: bool = False) -> list[Point]:
    """Return the points whose error no cheaper one comes near (within a fifth), cheapest first.

    The error is that in time or, if asked for, the total one.
    """
    judged = [(p.cpu, p.total_error if total else p.error, p) for p in points]
    known = [(cpu, error, p) for cpu, error, p in judged if cpu is not None and error is not None]
    front: list[Point] = []
    least = np.inf
    for _, error, point in sorted(known, key=lambda item: item[:2]):
        if error < _BETTER * least:
            front.append(point)
            least = error
    return front


def recommend(points: Sequence[Point], target: float) -> Point | None:
    """Return the cheapest point whose error is at most `target` [-]; None if there is none.

    An error below the floor counts as the floor; where the error of the mesh is known, it counts too.
    """
    known = [(p.cpu, p.judged_error, p) for p in points if p.cpu is not None]
    good = [(cpu, p) for cpu, error, p in known if error is not None and error <= target]
    return min(good, key=lambda item: item[0])[1] if good else None


def true_model(models: Collection[str]) -> str:
    """Return the model that the others are held against; exact and ancf are the same up to coordinates."""
    return next((name for name in ("exact", "ancf") if name in models), "")


def recommendations(cells: Sequence[Cell], points: Sequence[Point]) -> list[str]:
    """Return in sentences what is recommended for each model, then those on models.

    There is one for each of `TARGETS` in the first group of channels, the motion where there is any, one on
    what these errors are of, and one for each other group.
    """
    models = dict.fromkeys(cell.model for cell in cells)
    lines = []
    for model in models:
        mine = [cell for cell in cells if cell.model == model]
        prefix = f"{model}: " if len(models) > 1 else ""
        lines += [prefix + line for line in _of_model(mine, [p for p in points if p.model == model])]
    others = [cell for cell in cells if cell.model_error is not None]
    true = true_model(models)
    off, floor = f"off {true} by", min((c.floor for c in cells if c.model == true and c.floor), default=0.0)
    lines += [f"{c.model}, {c.mesh}: {off} {c.model_error:.1e} in {c.model_channel}" for c in others]
    judged = [replace(p, error=None, total_error=p.exact_error) for p in points]
    targets = TARGETS.items() if others else ()
    return lines + [model_advice(judged, words, target, _meshes(judged), floor) for words, target in targets]


def _of_model(cells: Sequence[Cell], points: Sequence[Point]) -> Iterator[str]:
    """Yield what is recommended for one model."""
    groups = next((cell.groups for cell in cells if cell.groups), ())
    mine, prefix = _comparable(points), f"{groups[0]}: " if len(groups) > 1 else ""
    for words, target in TARGETS.items():
        yield prefix + advice(mine, words, target, _meshes(mine), _floors(cells, groups[:1])[0])
    if groups:
        yield from _scope(cells)
    for group in groups[1:]:
        least, most = _floors(cells, (group,))
        told = "; ".join(_briefly(_comparable([p.of_group(group) for p in points]), least))
        yield f"{group}, error floor {tidy(most)}: {told}"


def _floors(cells: Sequence[Cell], group: Collection[str]) -> tuple[float, float]:
    """Return the least and the largest floor of a group, 0 without one."""
    floors = [cell.group_floors[one] for cell in cells for one in group if one in cell.group_floors]
    return min(floors, default=0.0), max(floors, default=0.0)


def _briefly(points: Sequence[Point], floor: float) -> Iterator[str]:
    """Yield what is recommended for each target until one is not reached."""
    for number, (words, target) in enumerate(TARGETS.items()):
        reached = recommend(points, target) is not None
        less = "" if reached or number == len(TARGETS) - 1 else " or less"
        yield advice(points, words + less, target, _meshes(points), floor)
        if not reached:
            return


def _comparable(points: Sequence[Point]) -> list[Point]:
    # where some meshes are known to be wrong by so much, one of unknown error must not win
    return [p for p in points if p.total_error is not None] or list(points)


def _scope(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield what the errors are of that settings are recommended for: of time alone, or of the mesh too."""
    meshed = [cell for cell in cells if cell.mesh_error is not None]
    if meshed:
        known = ", ".join(f"{cell.mesh}: {cell.mesh_error:.1e} in {cell.mesh_channel}" for cell in meshed)
        yield f"errors of time and mesh together; that of the mesh alone, {known}"
    elif any(cell.elements for cell in cells) and MODELS[cells[0].model].flexible:
        yield f"errors in time only, without that of the mesh ({cells[-1].mesh}): --elements N,M measures it"


def _meshes(points: Sequence[Point]) -> bool:
    """Whether there are several, so that words must name them."""
    return len({p.mesh for p in points}) > 1


def advice(
    points: Sequence[Point], words: str, target: float, meshes: bool = False, floor: float = 0.0
) -> str:
    """Return the recommendation for one target in a sentence.

    Parameters
    ----------
    words : str
        The target in words.
    meshes : bool
        Whether meshes are to be named.
    floor : float
        Error of the reference that is known best [-]: no point is to blame for missing a target below it.
    """
    best = recommend(points, target)
    if best is not None:
        return f"for {words}: {_setting(best, meshes)}"
    known = [(p.judged_error, p) for p in points if p.judged_error is not None]
    if not known:
        return f"for {words}: nothing was measured"
    error, most = min(known, key=lambda item: item[0])
    why = _UNKNOWN if most.below_floor or floor > target else "nothing tried reaches it"
    return f"for {words}: {why}; best {error:.1e} with {_setting(most, meshes)}"


def model_advice(
    points: Sequence[Point], words: str, target: float, meshes: bool = False, floor: float = 0.0
) -> str:
    """Return in a sentence the cheapest model for one target, beside the exact one; see `advice`.

    Parameters
    ----------
    points : sequence of Point
        With the error against the exact model as their total one.
    """
    true = true_model({p.model for p in points})
    best, plain = recommend(points, target), recommend([p for p in points if p.model == true], target)
    head = f"for {words} of {true}:"
    if best is None:
        return f"{head} {_UNKNOWN if floor > target else 'no model that was tried reaches it'}"
    if best.model == true:
        rest = sorted({p.model for p in points if recommend([p], target)} - {true})
        also = f" ({', '.join(rest)} would do too)" if rest else ", no other model suffices"
        return f"{head} {true}{also}: {_setting(best, meshes)}"
    beside = f"; {true}: {plain.cpu:.2g} s" if plain else ""
    return f"{head} {best.model} suffices: {_setting(best, meshes)}{beside}"


def _setting(point: Point, meshes: bool) -> str:
    """Return what a point is set to and costs, in words."""
    return f"{f'{point.mesh}, ' if meshes else ''}{point.method}, {point.level}: {point.cpu:.2g} s"
