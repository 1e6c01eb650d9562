"""The starting state: what the deck says of each body, completed through the joints.

What is not stated follows from the joints: angles along joints that fix them, positions and velocities so
that all joints hold, and in closed loops the unstated angles too.  What is stated stays as it is where the
joints allow it.  Where they miss it by little, it is a guess, unless the deck calls it exact: the nearest
start that fulfils the joints is taken, and what that changes is told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import Array, BoolArray, IntArray
from hfsim.maths.frozen import frozen, mutable
from hfsim.maths.matrices import smallest_step
from hfsim.maths.rotations import freedoms, rotation, rotation_vector, wrap
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.pose import Twist
from hfsim.scene.assembly import UNITS, Assembly, Branches, Change, Turn, listed
from hfsim.scene.closing import CLOSED, Linkage, largest
from hfsim.scene.initial import InitialSpec

GROUND = None
AT_START = np.zeros(1)
MOST_STATED = 50
"""Bodies in scenes of which it is looked for what other stated angles would do."""
APART = 1e-3
"""Difference of an angle from which two ways to close loops are different ones [rad]."""
ROUGH_ANGLE = 1.0
"""Change of a stated angle up to which it is a guess of where a loop closes [rad]."""
ROUGH_TURN = 0.2
"""The same where a joint or driver fixes the angle outright [rad]."""
ROUGH_PLACE = 0.05
"""The same of a stated position, relative to the largest distance of a joint from what it is on."""
MOST_ROWS = 1500
"""Joint equations up to which spins are told from velocities that follow from them."""
ROUGH_RATE = 0.05
"""The same of stated velocities, relative to the largest of their kind."""


@frozen
class Start:
    """What the starting state is found from.

    Attributes
    ----------
    names : tuple of str
        Of the bodies.
    initial : mapping of str to InitialSpec
    linkage : Linkage
        Of the frames of the bodies, in this order.
    refuse : callable
        (deck path, message, hint) -> DeckError.
    """

    names: tuple[str, ...]
    initial: Mapping[str, InitialSpec]
    linkage: Linkage
    refuse: Callable[[str, str, str], DeckError]

    @cached_property
    def n_dim(self) -> int:
        """Number of space dimensions."""
        return self.linkage.n_dim

    @cached_property
    def ties(self) -> tuple[Constraint, ...]:
        """The constraints that hold whole turns."""
        return tuple(c for c in self.linkage.constraints if c.holds_turn)

    def stated(self, origin: str, turn: str) -> _Stated:
        """Return the stated values of two quantities of each body, zero for the rest."""
        values = np.zeros((len(self.names), freedoms(self.n_dim)))
        stated, exact = np.zeros(values.shape, dtype=bool), np.zeros(values.shape, dtype=bool)
        parts = {origin: slice(self.n_dim), turn: slice(self.n_dim, None)}
        for k, name in enumerate(self.names):
            for quantity, part in parts.items():
                value = self._value(name, quantity)
                if value is not None:
                    values[k, part], stated[k, part], exact[k, part] = value, True, self.initial[name].exact
        return _Stated(parts, values.ravel(), stated.ravel(), exact.ravel())

    def _value(self, name: str, quantity: str) -> Array | tuple[float, ...] | None:
        initial = self.initial.get(name)
        if initial is None:
            return None
        if quantity == "angular_velocity":
            return initial.spin(self.n_dim)
        if quantity == "angle" and (turn := initial.turn(self.n_dim)) is not None:
            # in space it counts from the centre, which is the orientation stated
            return turn if self.n_dim == 2 else np.zeros(3)
        return None if quantity == "angle" else getattr(initial, quantity)

    def told(self, quantity: str, where: IntArray, values: Array) -> tuple[float, ...]:
        """Return places or rates of a frame as messages have them: in space its turn against the ground."""
        own, body = values[where], int(where[0]) // freedoms(self.n_dim)
        if quantity == "angle" and self.linkage.centres is not None:
            own = rotation_vector(rotation(own) @ self.linkage.centres[body])
            own = np.where(np.abs(own) < CLOSED, 0.0, own)
        return tuple(map(float, own))

    def frames(self, given: _Stated) -> Iterator[tuple[str, tuple[Array, Array]]]:
        """Yield names of bodies with the values of both quantities."""
        for name, row in zip(self.names, given.values.reshape(len(self.names), -1), strict=True):
            yield name, (row[: self.n_dim], row[self.n_dim :])


@mutable
class _Stated:
    """Places or rates of all frames, (n,), what of them the deck states, and what of that is exact.

    Attributes
    ----------
    parts : dict of str to slice
        Where each quantity stands among the values of a frame.
    values : ndarray, shape (n,)
    stated, exact : ndarray of bool, shape (n,)
    open : ndarray of bool, shape (n,)
        What neither the deck states nor joints hand on.
    """

    parts: dict[str, slice]
    values: Array
    stated: BoolArray
    exact: BoolArray

    def __post_init__(self) -> None:
        self.given = self.values.copy()
        self.open = ~self.stated


def assembled(start: Start) -> Assembly:
    """Return where the bodies of a scene are at the start, and how they move.

    Raises
    ------
    DeckError
        Naming the joint that the stated angles, positions or velocities contradict or that cannot close, and
        by how much.
    """
    place = start.stated("position", "angle")
    _hand_on(start, place, lambda tie: tie.target(AT_START))
    _refuse_twists(start, place)
    closed, branches = _settle(start, place)
    rates = start.stated("velocity", "angular_velocity")
    _hand_on(start, rates, lambda tie: -tie.rate(AT_START)[0])
    _settle_rates(start, start.linkage.slopes_by_rates(place.values), rates)
    return Assembly(
        linkage=start.linkage,
        place=place.values,
        poses=dict(zip(start.names, start.linkage.poses(place.values), strict=True)),
        twists={name: Twist(*parts) for name, parts in start.frames(rates)},
        changes=(*_changes(start, place, place.values), *_changes(start, rates, rates.values)),
        closed=closed,
        branches=branches,
    )


def _hand_on(start: Start, given: _Stated, step: Callable[[Constraint], Array]) -> None:
    """Take turns that are not stated from other bodies, along the constraints that fix them."""
    turns, stated, unknown = (
        kind.reshape(len(start.names), -1)[:, start.n_dim :]
        for kind in (given.values, given.stated, given.open)
    )
    known: dict[int | None, Array] = {GROUND: np.zeros(turns.shape[1])}
    known |= {int(k): turns[k] for k in np.flatnonzero(stated[:, -1])}
    owner = start.linkage.owner
    ties = [(tie, owner(tie.ends[0]), owner(tie.ends[1])) for tie in start.ties]
    before = -1
    while before < len(known):
        before = len(known)
        for tie, a, b in ties:
            if a in known and b not in known:
                known[b] = known[a] + step(tie)
            elif b in known and a not in known:
                known[a] = known[b] - step(tie)
    for k, turn in known.items():
        if k is not GROUND:
            turns[k], unknown[k] = turn, False


def _refuse_twists(start: Start, place: _Stated) -> None:
    """Refuse angles that a joint fixes outright and that miss it by far: no loop makes such guesses."""
    for tie in start.ties:
        off = largest(tie.residual(AT_START, place.values[None]))
        known = not any((place.open & start.linkage.turns)[marker.columns].any() for marker in tie.ends)
        if known and off > ROUGH_TURN:
            raise _contradicted(start, place, tie, off)


def _settle(start: Start, place: _Stated) -> tuple[dict[str, Turn], Branches]:
    """Move what is not stated until the joints hold: origins first, then unstated turns, then guesses.

    Returns
    -------
    closed, branches
        As in `Assembly`.
    """
    link, x, free = start.linkage, place.values, ~place.stated
    if link.close(x, free & ~link.turns) < CLOSED:
        return {}, partial(_told_ways, start, place, free)
    begin = x.copy()
    starts = link.starts(begin, place.open & link.turns)
    found = link.search(starts[:1], free) or link.search(starts[1:], free)
    guessed = not found
    if guessed:
        found, free = _guesses(start, place, starts), ~place.exact
    x[:] = _near(link, found[0], begin)
    follow = _following(start, place.open & link.turns, np.abs(x - begin) > CLOSED)
    return _turned(start, x, follow), partial(_branches, start, place, free, begin, starts, follow, guessed)


def _turned(start: Start, x: Array, follow: IntArray) -> dict[str, Turn]:
    """Return the turns of the bodies that some columns are of."""
    numbers = dict.fromkeys(int(k) // freedoms(start.n_dim) for k in follow)
    turns = {k: tuple(map(float, start.linkage.poses(x)[k].turn)) for k in numbers}
    return {start.names[k]: turn if len(turn) > 1 else turn[0] for k, turn in turns.items()}


def _branches(
    start: Start, place: _Stated, free: BoolArray, begin: Array, starts: Array, moved: IntArray, guessed: bool
) -> list[dict[str, Turn]]:
    """Return the other ways to close the loops, from where that which was taken was looked for."""
    link, ways = start.linkage, [place.values]
    if link.moves(place.values, free):
        return []
    for one in link.search(starts, free):
        if all(link.apart(one, way) > APART for way in ways):
            ways.append(_near(link, one, begin))
    others = _told_ways(start, place, ~place.stated, moved)
    return others if guessed and others else [*(_turned(start, way, moved) for way in ways[1:]), *others]


def _told_ways(
    start: Start, place: _Stated, free: BoolArray, follow: Sequence[int] | IntArray = ()
) -> list[dict[str, Turn]]:
    """Return the angle of the body that would be stated otherwise, then those that follow, in each way."""
    found: list[dict[str, Turn]] = []
    for k, x in _otherwise(start, place, free):
        numbers = dict.fromkeys([k, *(int(column) // freedoms(start.n_dim) for column in follow)])
        turns = {start.names[n]: float(start.linkage.poses(x)[n].turn[0]) for n in numbers}
        found.append({name: float(wrap(np.array(turn))) for name, turn in turns.items()})
    return found


def _otherwise(start: Start, place: _Stated, free: BoolArray) -> Iterator[tuple[int, Array]]:
    """Yield the other ways in which planar loops close with one angle stated otherwise, and of which body."""
    link, x = start.linkage, place.values
    if start.n_dim != 2 or len(start.names) > MOST_STATED:
        return
    turns = (place.stated & ~place.exact & link.turns).reshape(len(start.names), -1)
    for k in np.flatnonzero(turns.any(axis=1)):
        mine = np.zeros(turns.shape, dtype=bool)
        mine[k] = turns[k]
        freed = free | mine.ravel()
        if link.moves(x, freed):
            continue
        ways = [x]
        for one in link.search(link.starts(x, (place.open & link.turns) | mine.ravel()), freed):
            if all(link.apart(one, way) > APART for way in ways):
                ways.append(_near(link, one, x))
                yield int(k), ways[-1]


def _following(start: Start, free: BoolArray, moved: BoolArray) -> IntArray:
    """Return the free turns, as columns, of bodies that have moved to close joints or are joined to such."""
    reached = free & moved
    for c in start.linkage.constraints:
        both = [marker.columns for marker in c.ends]
        if any((free & moved)[columns].any() for columns in both):
            for columns in both:
                reached[columns] = free[columns]
    return np.flatnonzero(reached)


def _guesses(start: Start, place: _Stated, starts: Array) -> list[Array]:
    """Return the places nearest to stated guesses in which the joints hold.

    Raises
    ------
    DeckError
        If there are none, or none that are near enough to be meant.
    """
    link, x = start.linkage, place.values
    ends = link.descend(starts, ~place.stated)
    best = link.nearest(ends)
    found = link.search(best[None], ~place.exact) or link.search(ends, ~place.exact)
    if not found:
        raise _open(start, place, *link.cut(ends, ~place.exact))
    near = min(
        (_near(link, one, x) for one in found),
        key=lambda one: largest(((one - x) / link.units)[place.stated]),
    )
    allowed = _changes(start, place, near)
    if any(change.rough > 1.0 for change in allowed):
        raise _contradicted(start, place, *link.worst(best), allowed)
    return [near]


def _near(link: Linkage, x: Array, begin: Array) -> Array:
    """Return places with turns within half a turn of those at the beginning; in space as they are."""
    if link.centres is not None:
        return x
    return np.where(link.turns, begin + wrap(x - begin), x)


def _settle_rates(start: Start, J: Array, rates: _Stated) -> None:
    """Change what is not stated until the joints hold, then guesses, as `_settle`."""
    link, values = start.linkage, rates.values
    none = CLOSED * max(1.0, largest(values / link.units))
    gap = J @ values + link.drift
    for free in (~rates.stated & ~link.turns, ~rates.stated, ~rates.exact):
        before = gap
        values[free] -= _least_turning(link, J, free, gap)[free]
        gap = J @ values + link.drift
        if largest(gap / link.scales) < none:
            break
    allowed = _changes(start, rates, values)
    if largest(gap / link.scales) >= none or any(change.rough > 1.0 for change in allowed):
        raise _contradicted(start, rates, *link.largest_of(before / link.scales), allowed)


def _least_turning(link: Linkage, J: Array, free: BoolArray, gap: Array) -> Array:
    """Return rates (n,), zero where not free, that close gaps of rates; in space with the smallest spins."""
    step, shifts, spins = np.zeros(len(free)), free & ~link.turns, free & link.turns
    if link.centres is None or not spins.any() or len(J) > MOST_ROWS:
        step[free] = smallest_step(J[:, free], gap)
        return step
    sides, sizes, _ = np.linalg.svd(J[:, shifts])
    left = sides[:, int(np.sum(sizes > CLOSED * sizes.max(initial=0.0))) :].T
    step[spins] = smallest_step(left @ J[:, spins], left @ gap)
    step[shifts] = smallest_step(J[:, shifts], gap - J @ step)
    return step


def _changes(start: Start, given: _Stated, values: Array) -> tuple[Change, ...]:
    """Return which stated values are changed by more than round-off."""
    found = []
    for name, own in zip(start.names, np.arange(len(values)).reshape(len(start.names), -1), strict=True):
        for quantity, part in given.parts.items():
            where = own[part]
            off = float(np.linalg.norm((values - given.given)[where]))
            if given.stated[where].all() and off > CLOSED * start.linkage.units[where[0]]:
                before, after = (start.told(quantity, where, kind) for kind in (given.given, values))
                what = "orientation" if quantity == "angle" and start.n_dim == 3 else quantity
                found.append(Change(name, what, before, after, off / _guess(start, quantity, values)))
    return tuple(found)


def _guess(start: Start, quantity: str, values: Array) -> float:
    """Return by how much a stated value may be changed as a guess."""
    link = start.linkage
    if quantity == "angle":
        return ROUGH_ANGLE
    if quantity == "position":
        return ROUGH_PLACE * link.size
    of_spins, of_speeds = largest(values[link.turns]), largest(values[~link.turns])
    # where nothing else moves, no stated rate is a guess
    return ROUGH_RATE * max(of_spins if quantity == "angular_velocity" else of_speeds, 1e-300)


def _contradicted(
    start: Start, given: _Stated, joint: Constraint, size: float, allowed: Sequence[Change] = ()
) -> DeckError:
    """Return the refusal of what is stated, or of joints that contradict each other whatever is stated."""
    rates = "velocity" in given.parts
    unit = f"{joint.unit}/s" if rates else joint.unit
    if not given.stated.any():
        hint = "the start or the rate of a driver, or an angle of a joint, must be another"
        return start.refuse(
            joint.item, f"other joints and drivers contradict this one by {size:.6g} {unit}", hint
        )
    what = "velocities" if rates else "positions and angles"
    nearest = [f"{c.body}.{c.quantity} {listed(c.taken)} {UNITS[c.quantity]}" for c in allowed]
    hint = f"nearest that the joints allow: {', '.join(nearest)}; " if nearest else ""
    hint += "correct what is stated under 'initial', or leave it out to let it follow from the joints"
    return start.refuse(joint.item, f"the initial {what} contradict this joint by {size:.6g} {unit}", hint)


def _open(start: Start, place: _Stated, joint: Constraint, size: float) -> DeckError:
    """Return the refusal of joints that close at no angles."""
    held = {start.names[k // freedoms(start.n_dim)] for k in np.flatnonzero(place.exact)}
    if held:
        message = f"cannot be closed with what is exact: at least {size:.6g} {joint.unit} are left"
        hint = f"leave out 'exact' of {', '.join(sorted(held))}, or correct what is stated there"
    else:
        message = f"cannot be closed: at least {size:.6g} {joint.unit} are left, whatever the angles"
        hint = "make a link longer, move a point, or let a driver start elsewhere"
        if start.n_dim == 3 and (place.open & start.linkage.turns).any():
            hint += "; or state orientations: they say where in the second body the axis of a hinge is"
    return start.refuse(joint.item, message, hint)
