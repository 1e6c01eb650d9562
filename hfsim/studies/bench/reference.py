"""References of a bench: two methods ever tighter until they agree, finer meshes, the exact model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from hfsim.errors import HfsimError
from hfsim.marching.alike import alike
from hfsim.marching.distance import group_of
from hfsim.marching.solution import Channel
from hfsim.marching.stop import Budget
from hfsim.parts.bodies import BeamSpec
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck
from hfsim.studies.agreement import ROUND_OFF, Agreement, agreements
from hfsim.studies.bench.advice import true_model
from hfsim.studies.bench.points import Cell, ChannelError, channel_error, groups_of, observed_order
from hfsim.studies.bench.sweep import Sweep, with_mesh

_ENOUGH = 1e-12
"""Agreement of the first group of channels at which the reference is refined no more."""
_ENOUGH_BESIDE = 1e-7
"""Agreement of the other groups: a tenth of the smallest error that anything is recommended for."""
_SHARE = 0.5
"""Part of the budget that all references may take."""
_IN_TIME_SHARE = 0.6
"""Part of that for the references of the meshes asked for; the rest is for the finer mesh."""


class Truth(Agreement):
    """A reference that two methods agree on, and the errors of other channels against it."""

    @property
    def group_floors(self) -> dict[str, float]:
        """The largest floor in each group of the channels that count [-], the motion first."""
        judged = [s for s in self.scales if s.judged]
        groups = groups_of([s.unit for s in judged])
        return {g: max(self.floors[s.channel] for s in judged if s.group == g) for g in groups}

    @property
    def floor(self) -> float:
        """That of the first group [-]."""
        return next(iter(self.group_floors.values()), ROUND_OFF)

    def worst(self, channels: Sequence[Channel]) -> dict[str, tuple[str, float]]:
        """Return for each group the channel that counts and is farthest from these, and how far it is [-]."""
        judged = [e for e in self.errors(channels) if e.judged]
        together = {g: [e for e in judged if group_of(e.unit) == g] for g in self.group_floors}
        found = {g: max(errors, key=lambda e: e.max_relative) for g, errors in together.items()}
        return {g: (one.channel, one.max_relative) for g, one in found.items()}

    def first_worst(self, channels: Sequence[Channel]) -> tuple[str, float | None]:
        """Return the same for the first group alone; no channel and None without any."""
        return next(iter(self.worst(channels).values()), ("", None))

    def errors(self, channels: Sequence[Channel]) -> tuple[ChannelError, ...]:
        """Return how far channels are from these."""
        together = zip(alike(channels, self.channels), self.channels, self.scales, strict=True)
        return tuple(channel_error(c.values, t.values, s, self.floors[s.channel]) for c, t, s in together)


@dataclass
class Work:
    """A cell while it is being worked on.

    Attributes
    ----------
    truth, fine, exact : Truth or None
        References: of the cell, on a finer mesh, of the model exact.
    """

    cell: Cell
    scene: Scene
    truth: Truth | None = None
    fine: Truth | None = None
    exact: Truth | None = None

    def note(self, **facts: object) -> None:
        """Note facts of the cell."""
        self.cell = replace(self.cell, **facts)  # type: ignore[arg-type]

    def take(self, found: Truth | HfsimError, cpu: float) -> bool:
        """Keep what was found if it is better than what is there; return whether going on may pay."""
        old = self.truth
        self.note(reference_cpu=self.cell.reference_cpu + cpu)
        if isinstance(found, HfsimError):
            if old is None:
                self.note(status="failed", reason=str(found))
            return False
        if old is None or found.floor < old.floor:
            self.truth = found
            self.note(status="done", reason="", reference=found.how, floor=found.floor, floors=found.floors)
            self.note(group_floors=found.group_floors)
        floors = found.group_floors.items()
        return any(_pays(floor, group, old, first=not k) for k, (group, floor) in enumerate(floors))


def _pays(floor: float, group: str, old: Truth | None, first: bool) -> bool:
    """Return whether a tighter reference may pay: the floor still falls, and is too high for advice."""
    falls = old is None or floor < old.group_floors[group] / 3.0
    return falls and floor >= (_ENOUGH if first else _ENOUGH_BESIDE)


def references(loaded: LoadedDeck, sweep: Sweep, works: list[Work], budget: Budget) -> None:
    """Compute the references of all cells, appended to `works`, and with several meshes finer ones."""
    wanted = [(model, mesh) for model in sweep.models for mesh in sweep.meshes]
    share = _SHARE * budget.left
    in_time = (_IN_TIME_SHARE if len(sweep.meshes) > 1 else 1.0) * share
    finer = share - in_time
    for i, (model, mesh) in enumerate(wanted):
        start = budget.used
        allowed = in_time / (len(wanted) - i)
        works.append(_cell_work(with_mesh(loaded, *mesh), model, budget, allowed, must=i == 0))
        in_time -= budget.used - start
    if len(sweep.meshes) > 1:
        _finer_truths(loaded, sweep, works, budget, finer)
    _compare_models(works)


def _cell_work(loaded: LoadedDeck, model: str, budget: Budget, allowed: float, must: bool = False) -> Work:
    """Build one cell and compute its reference within `allowed` seconds; if it must, one at any price."""
    scene = build(loaded, model)
    beams = [spec for spec in scene.deck.bodies.values() if isinstance(spec, BeamSpec)]
    elements, degree = max((b.elements for b in beams), default=0), max((b.degree for b in beams), default=3)
    cell = Cell(model, elements, scene.system.n, "over budget", "no time for a reference", degree)
    work = Work(cell, scene)
    for found, cpu in agreements(scene, budget, allowed, must):
        if not work.take(found if isinstance(found, HfsimError) else Truth(**vars(found)), cpu):
            break
    return work


# --- of finer meshes, and of the exact model ------------------------------------------------------


def _finer_truths(
    loaded: LoadedDeck, sweep: Sweep, works: Sequence[Work], budget: Budget, allowed: float
) -> None:
    """Give the cells of each model a mesh-converged reference, on `Sweep.fine_mesh` if time allows."""
    for i, model in enumerate(sweep.models):
        mine = [w for w in works if w.cell.model == model and w.truth is not None]
        if len(mine) < 2:
            continue
        start = budget.used
        share = allowed / (len(sweep.models) - i)
        fine = _cell_work(with_mesh(loaded, *sweep.fine_mesh), model, budget, share)
        allowed -= budget.used - start
        fine = fine if fine.truth is not None else max(mine, key=lambda w: w.cell.unknowns)
        _split(sorted(mine, key=lambda w: w.cell.place), fine)


def _split(works: Sequence[Work], fine: Work) -> None:
    """Note the mesh error of each cell and the order by which it falls."""
    assert fine.truth is not None
    for work in works:
        if work is fine or work.truth is None:
            continue
        work.fine = fine.truth
        apart = fine.truth.errors(work.truth.channels)
        errors = {one.channel: one.max_relative for one in apart if one.judged}
        worst, largest = fine.truth.first_worst(work.truth.channels)
        work.note(mesh_error=largest, mesh_channel=worst, mesh_errors=errors)
        work.note(mesh_reference=fine.cell.elements, mesh_reference_degree=fine.cell.degree)
    for coarse, finer in pairwise(works):
        finer.note(mesh_order=observed_order(coarse.cell, finer.cell))


def _compare_models(works: Sequence[Work]) -> None:
    """Note how far each model is from the exact one; nothing with a single model."""
    models = {w.cell.model for w in works}
    true = {w.cell.mesh: w for w in works if w.cell.model == true_model(models)}
    for work in works if len(models) > 1 else ():
        yardstick = true.get(work.cell.mesh)
        if yardstick is None or yardstick.truth is None:
            continue
        work.exact = yardstick.fine or yardstick.truth
        if work is not yardstick and work.truth is not None:
            worst, largest = yardstick.truth.first_worst(work.truth.channels)
            work.note(model_error=largest, model_channel=worst)
