"""Which joints the free coordinates fulfil by themselves: those of open chains, at nodes and mass centres.

A joint at which a position coordinate of one body coincides with one of another, or with a place on
the ground, is linear in absolute coordinates.  Bodies are taken in from the ground outwards, each by
the first such joint that leads to it; a joint between two bodies already taken in closes a loop and
keeps its multipliers.  So do joints whose equations are not linear: angles between moving bodies,
points between nodes or off the centre of mass, and all of bodies with coordinates in a body frame.
Guides on the ground leave of the place of a rigid body how far along it is, and nothing of its angle.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, IntArray
from hfsim.maths.frozen import frozen, mutable
from hfsim.maths.matrices import Entries, assemble
from hfsim.maths.rotations import rotate
from hfsim.mechanics.body import Body
from hfsim.mechanics.chart import side_by_side
from hfsim.mechanics.constraints import Along, Constraint
from hfsim.mechanics.increments import Mount, NaturalIncrements, Rail, Tie
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.reduction import Reduction

if TYPE_CHECKING:
    from hfsim.mechanics.carried import CarriedIncrements

GROUND = None
"""Owner of the points of the ground."""


@frozen
class FreeCoordinates:
    """What is left when joints have been eliminated.

    Attributes
    ----------
    ties : tuple of Tie
        Bodies whose place follows from others, from the ground outwards.
    natural_columns : ndarray of int, shape (n,)
        Columns of x whose natural increments are free.
    """

    reduction: Reduction
    ties: tuple[Tie, ...]
    natural_columns: IntArray

    def increments(self, bodies: Collection[Body]) -> NaturalIncrements | CarriedIncrements | None:
        """Return coordinates for Newton corrections; None where their own serve all bodies."""
        natural = side_by_side(body.increments() for body in bodies)
        if natural:
            return NaturalIncrements(natural, self.reduction, self.ties, self.natural_columns)
        carried = [found for body in bodies if (found := body.carried()) is not None]
        if not carried:
            return None
        from hfsim.mechanics.carried import CarriedIncrements

        return CarriedIncrements.of(carried, self.reduction)


def eliminate(
    bodies: Mapping[str, Body], constraints: tuple[Constraint, ...], sparse: bool, x: Array
) -> FreeCoordinates:
    """Return the free coordinates of a scene; bodies in body frames keep all of theirs.

    Parameters
    ----------
    sparse : bool
        Which kind of matrices to use.
    x : ndarray, shape (n,)
        A state that fulfils the joints, in which angles have their full turns.
    """
    n = max(body.columns.stop for body in bodies.values())
    work = _Elimination(n)
    owners = {body.columns.start: name for name, body in bodies.items()}
    linear = dict(_between_positions(bodies, constraints, owners))
    guided = dict[str, Body]()
    for k, body, along in _guides(bodies, constraints, owners):
        if body.name not in guided:
            work.guide(k, along)
            guided[body.name] = body
    for k, column, missed in _held_angles(guided.values(), constraints, x):
        if not work.dropped[column]:
            work.hold(k, column, float(x[column]) - missed)
    held = _slopes_by_bodies(linear.values())
    for k, child, parent in _tree(linear, owners, guided):
        body = bodies[str(_owner(child, owners))]
        if _at_coordinates(parent):
            work.attach(k, body, child, parent)
        else:
            work.mount(body, child, parent, _fixed_slope(child, parent, held))
    for k, constraint in linear.items():
        clamp = _clamp(constraint)
        if clamp is not None and not work.dropped[clamp[0]].any():
            work.clamp(k, *clamp)
    return work.result(sparse)


@mutable
class _Elimination:
    """Where each coordinate comes from, while joints are taken in."""

    n: int
    ties: list[Tie] = field(default_factory=list)
    eliminated: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.source: IntArray = np.arange(self.n)
        self.factor: Array = np.ones(self.n)
        self.offset: Array = np.zeros(self.n)
        self.dropped: BoolArray = np.zeros(self.n, dtype=bool)
        self.natural: BoolArray = np.ones(self.n, dtype=bool)
        self.clamped: list[int] = []

    def attach(self, k: int, body: Body, child: Marker, parent: Marker) -> None:
        """Let the place of a body follow from that of a point already taken in."""
        point, above = child.place_columns, parent.place_columns
        assert point is not None
        self.dropped[point] = True
        if above is None:
            self.factor[point], self.offset[point] = 0.0, parent.position(np.zeros((1, self.n)))[0]
        else:
            for kind in (self.source, self.factor, self.offset):
                kind[point] = kind[above]
        self.natural[body.position_columns[0]] = False
        self.ties.append(Tie(body.position_columns, point, above))
        self.eliminated.add(k)

    def guide(self, k: int, along: Guide) -> None:
        """Let a place be somewhere on a line of the ground."""
        tangent = np.array([-along.across[1], along.across[0]])
        kept, other = along.columns[np.argsort(-np.abs(tangent))]
        self.factor[along.columns] = tangent
        self.offset[along.columns] = -along.missed * along.across
        self.source[other] = kept
        self.dropped[other], self.natural[other] = True, False
        point = np.array([kept, other])
        self.ties.append(Rail(point[None], point, None, float(self.factor[other] / self.factor[kept])))
        self.eliminated.add(k)

    def hold(self, k: int, column: int, value: float) -> None:
        """Let a coordinate stay as it is."""
        self.factor[column], self.offset[column] = 0.0, value
        self.dropped[column], self.natural[column] = True, False
        self.eliminated.add(k)

    def mount(self, body: Body, child: Marker, parent: Marker, slope: int | None) -> None:
        """Let natural increments of a beam be relative to the rigid body that carries it, and a slope too."""
        assert child.place_columns is not None and parent.offset is not None
        self.ties.append(
            Mount(
                positions=body.position_columns,
                point=child.place_columns,
                parent=None,
                rigid=parent.support,
                arm=complex(*parent.offset),
                slope=slope,
            )
        )

    def clamp(self, k: int, slope: IntArray, direction: Array) -> None:
        """Let a slope vector keep its direction, (n_dim,)."""
        length, others = slope[0], slope[1:]
        self.factor[slope] = direction
        self.source[others] = length
        self.dropped[others] = True
        self.natural[others] = False
        self.clamped.append(int(length))
        self.eliminated.add(k)

    def result(self, sparse: bool) -> FreeCoordinates:
        kept = np.flatnonzero(~self.dropped)
        number = np.cumsum(~self.dropped) - 1
        used = self.factor != 0.0
        entries = Entries(np.flatnonzero(used), number[self.source[used]], self.factor[used])
        basis = assemble([entries], (self.n, len(kept)), sparse)
        return FreeCoordinates(
            reduction=Reduction(basis, self.offset, frozenset(self.eliminated), number[self.clamped], kept),
            ties=tuple(self.ties),
            natural_columns=np.flatnonzero(self.natural),
        )


class Guide(NamedTuple):
    """A line of the ground on which a place is: across . place + missed = 0.

    Attributes
    ----------
    columns : ndarray of int, shape (2,)
    across : ndarray, shape (2,)
        Of length one.
    missed : float
    """

    columns: IntArray
    across: Array
    missed: float


def _guides(
    bodies: Mapping[str, Body], constraints: tuple[Constraint, ...], owners: Mapping[int, str]
) -> Iterator[tuple[int, Body, Guide]]:
    """Yield, with its number, what guides the mass centre of a rigid body on the ground, in the plane."""
    start = np.zeros((1, max(body.columns.stop for body in bodies.values())))
    for k, c in enumerate(constraints):
        if not (isinstance(c, Along) and c.constant and c.second.place_columns is not None):
            continue
        body, columns = bodies[owners[c.second.columns.start]], c.second.place_columns
        if len(columns) == 2 and len(body.position_columns) == 1:
            across = c.first.axis(start, np.array(c.direction))[0]
            missed = float(c.residual(np.zeros(1), start)[0, 0])
            yield k, body, Guide(columns, across, missed)


def _held_angles(
    bodies: Iterable[Body], constraints: tuple[Constraint, ...], x: Array
) -> Iterator[tuple[int, int, float]]:
    """Yield, with its number, what holds the angle of some body against the ground, its column, the miss."""
    columns = {body.columns.start: body.angle_column for body in bodies}
    for k, c in enumerate(constraints):
        grounded = [marker.grounded for marker in c.ends]
        if not (c.holds_turn and c.constant) or sum(grounded) != 1:
            continue
        number = grounded.index(False)
        column = columns.get(c.ends[number].columns.start)
        if column is not None:
            missed = float(c.residual(np.zeros(1), x[None])[0, 0])
            yield k, column, missed if number else -missed


def _slopes_by_bodies(constraints: Iterable[Constraint]) -> set[tuple[tuple[int, ...], int]]:
    """Return the columns of slope vectors that joints fix to bodies, each with where these columns start."""
    held = _held_slopes(constraints)
    return {(tuple(map(int, slope)), other.columns.start) for slope, other, _ in held if not other.grounded}


def _fixed_slope(child: Marker, parent: Marker, held: Collection[tuple[tuple[int, ...], int]]) -> int | None:
    """Return the column that holds the angle of a beam's slope if a joint fixes it to a rigid body."""
    if child.slope_columns is None:
        return None
    slope = tuple(map(int, child.slope_columns))
    return slope[1] if (slope, parent.columns.start) in held else None


def _held_slopes(constraints: Iterable[Constraint]) -> Iterator[tuple[IntArray, Marker, float]]:
    """Yield (columns of a slope vector, marker it does not turn against, angle that is held)."""
    for c in constraints:
        if c.holds_turn and not c.driven:
            for beam, other, angle in ((c.first, c.second, -c.offset), (c.second, c.first, c.offset)):
                if beam.slope_columns is not None:
                    yield beam.slope_columns, other, angle + beam.lead


def _between_positions(
    bodies: Mapping[str, Body], constraints: tuple[Constraint, ...], owners: Mapping[int, str]
) -> Iterator[tuple[int, Constraint]]:
    """Yield, with their numbers, what joints hold between bodies whose coordinates are absolute."""
    for k, c in enumerate(constraints):
        if not (c.holds_place or c.holds_turn):
            continue
        ends = (_owner(marker, owners) for marker in (c.first, c.second))
        if all(name is None or len(bodies[name].position_columns) for name in ends):
            yield k, c


def _tree(
    constraints: Mapping[int, Constraint], owners: Mapping[int, str], guided: Collection[str]
) -> Iterator[tuple[int, Marker, Marker]]:
    """Yield (constraint, marker of the body taken in, marker it is attached to), from the ground outwards.

    Bodies that are guided on the ground are taken in already.
    """
    meeting: dict[str | None, list[tuple[int, Marker, Marker]]] = {}
    for k, c in constraints.items():
        if c.holds_place:
            for child, parent in ((c.first, c.second), (c.second, c.first)):
                if child.place_columns is not None and _carries(parent, child):
                    meeting.setdefault(_owner(parent, owners), []).append((k, child, parent))
    known = set[str | None]()
    for start in (GROUND, *owners.values()):
        if start in known:
            continue
        front: list[str | None] = [start] if start is not GROUND else [GROUND, *guided]
        known.update(front)
        while front:
            for k, child, parent in meeting.get(front.pop(0), []):
                name = _owner(child, owners)
                if name not in known:
                    known.add(name)
                    front.append(name)
                    yield k, child, parent


def _owner(marker: Marker, owners: Mapping[int, str]) -> str | None:
    return GROUND if marker.grounded else owners[marker.columns.start]


def _at_coordinates(marker: Marker) -> bool:
    return marker.grounded or marker.place_columns is not None


def _carries(parent: Marker, child: Marker) -> bool:
    """Whether a body can be taken in at a point: at coordinates, or a beam on a point of a rigid body."""
    return _at_coordinates(parent) or (parent.offset is not None and child.nodal)


def _clamp(constraint: Constraint) -> tuple[IntArray, Array] | None:
    """Return the slope vector that a constraint holds in a direction of the ground, and that direction."""
    for slope, other, angle in _held_slopes([constraint]):
        if other.grounded:
            along = rotate(np.array([angle]), np.eye(len(slope))[0])
            return slope, other.turned(np.zeros((1, 0)), along)[0]
    return None
