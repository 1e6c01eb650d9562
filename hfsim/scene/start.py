"""The starting state: what the deck says of each body, completed through the joints.

What is not stated follows from the joints: angles along joints that fix them, positions and velocities so
that all joints hold, and in closed loops the unstated angles too.  What is stated stays as it is where the
joints allow it.  Where they miss it by little, it is a guess, unless the deck calls it exact: the nearest
start that fulfils the joints is taken, and what that changes is told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from hfsim.errors import DeckError
from hfsim.maths.arrays import Array, BoolArray, IntArray, magnitude
from hfsim.maths.matrices import Matrix, dense, smallest_step
from hfsim.maths.rank import null_space
from hfsim.maths.rotations import freedoms, rotation, rotation_vector, wrap
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.pose import Twist
from hfsim.scene.assembly import Assembly, Branches, Change, Placed, Turn
from hfsim.scene.closing import CLOSED, MOST_ROWS, Linkage
from hfsim.scene.contradicted import cannot_close, contradicted, misfaced
from hfsim.scene.handed_on import hand_on, hand_on_faces, hand_on_known_faces
from hfsim.scene.least_rates import follow_rates, least_turning, left_over, opened
from hfsim.scene.stated import AT_START, Start, Stated

TURN = 2.0 * np.pi
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
ROUGH_RATE = 0.05
"""The same of stated velocities, relative to the largest of their kind."""
APPROACH = 20
"""Steps towards the places that are nearest to what is stated."""


def placed(start: Start) -> Placed:
    """Return where the bodies of a scene are, with what is stated of angles and distances of its joints.

    Raises
    ------
    DeckError
        Naming the joint that the stated angles or positions contradict or that cannot close, and by how much.
    """
    place = start.stated("position", "angle")
    hand_on(start, place, lambda tie: tie.target(AT_START))
    hand_on_known_faces(start, place)
    _refuse_twists(start, place)
    closed, branches = _settle(start, place)
    # of what is stated to so many digits, the rest would bend bodies
    start.linkage.close(place.values, ~place.exact)
    _count_on(start, place)
    poses = dict(zip(start.names, start.linkage.poses(place.values), strict=True))
    changes = _changes(start, place, place.values)
    return Placed(place.values, poses, changes, closed, branches, partial(_loose, start, place))


def assembled(joined: Start, moving: Start, at: Placed) -> Assembly:
    """Return how the bodies of a scene are put together, and how they move.

    Parameters
    ----------
    joined, moving : Start
        With the joints alone, and with what is stated of rates of their angles and distances.
    at : Placed
        Where the bodies are.

    Raises
    ------
    DeckError
        Naming the joint that the stated velocities contradict, and by how much.
    """
    rates = moving.stated("velocity", "angular_velocity")
    hand_on(moving, rates, lambda tie: -tie.rate(AT_START)[0])
    _settle_rates(moving, moving.linkage.slopes_by_rates(at.place), rates)
    return Assembly(
        linkage=joined.linkage,
        place=at.place,
        poses=at.poses,
        twists={name: Twist(*parts) for name, parts in joined.frames(rates)},
        changes=(*at.changes, *_changes(joined, rates, rates.values)),
        closed=at.closed,
        branches=at.branches,
        loose=at.loose,
    )


def _loose(start: Start, place: Stated) -> Array:
    """Return the motions (k, n) that joints and what is stated leave free."""
    link, free = start.linkage, ~place.stated
    rows = link.slopes_by_rates(place.values)
    motions = np.zeros((len(free), len(free)))
    allowed = null_space(dense(rows[:, free]))
    motions[: allowed.shape[1], free] = allowed.T
    return motions[: allowed.shape[1]] * link.units


def _refuse_twists(start: Start, place: Stated) -> None:
    """Refuse angles that a joint fixes outright and that miss it by far: no loop makes such guesses."""
    unknown = place.open & start.linkage.turns
    for tie in start.ties:
        off = magnitude(tie.residual(AT_START, place.values[None]))
        if off > ROUGH_TURN and not any(unknown[marker.columns].any() for marker in tie.ends):
            raise contradicted(start, place, tie, off)
    _refuse_faces(start, place.values, lambda ends: not any(unknown[m.columns].any() for m in ends))


def _refuse_faces(start: Start, x: Array, meant: Callable[[tuple[Marker, Marker]], bool]) -> None:
    """Refuse orientations at places (n,) that joints which hold three axes miss by far, if they are meant."""
    wrong = []
    for item, ends, held, faced in start.linkage.faced(x):
        off = float(np.linalg.norm(rotation_vector(held.T @ faced)))
        if off > ROUGH_ANGLE and meant(ends):
            wrong.append(misfaced(start, item, off, faced))
    if wrong:
        problems = [problem for error in wrong for problem in error.problems]
        raise DeckError(wrong[0].file, problems, wrong[0].text, wrong[0].others)


def _settle(start: Start, place: Stated) -> tuple[dict[str, Turn], Branches]:
    """Move what is not stated until the joints hold: origins first, then unstated turns, then guesses.

    Returns
    -------
    closed, branches
        As in `Assembly`.
    """
    link, x, free = start.linkage, place.values, ~place.stated
    shifts, counted = free & ~link.turns, place.geared
    if not (closes := link.closes(x, shifts)):
        from hfsim.scene.beside import by_itself

        alone, counted = by_itself(start, place, x), counted | (place.open & link.turns & ~link.turning)
        if closes := link.closes(alone, shifts):
            x[:] = alone
    if closes:
        follow = _following(start, counted, np.abs(x) > CLOSED)
        return _turned(start, x, follow), partial(_told_ways, start, place, free, follow)
    from hfsim.scene.beside import taken_back

    begin, unknown = x.copy(), start.turns_of(place.open).any(axis=1)
    starts = link.starts(begin, place.open & link.turns)
    if not (found := link.search(starts[:1], free)):
        for one in starts[1:]:
            hand_on_faces(start, one, np.flatnonzero(~unknown), np.flatnonzero(unknown).tolist())
        found = link.search(starts[1:], free)
    guessed = not found
    if guessed:
        found, free = _guesses(start, place, starts), ~place.exact
    x[:] = taken_back(start, place, _near(link, found[0], begin))
    moved = np.abs(x - np.where(place.geared, 0.0, begin)) > CLOSED
    follow = _following(start, place.geared | (place.open & link.turns), moved)
    return _turned(start, x, follow), partial(_branches, start, place, free, begin, starts, follow, guessed)


def _count_on(start: Start, place: Stated) -> None:
    """Add full turns to angles in the plane where joints and drivers fix so many: where they are not stated,
    or those of joints are, beside which bodies are guesses.
    """
    turns = start.turns_of(place.values)
    free = start.turns_of(place.open & start.linkage.turning)[:, -1]
    owner, ties = start.linkage.owner, start.ties if start.n_dim == 2 else ()
    for _ in ties:
        before = turns.copy()
        for tie in ties:
            a, b = map(owner, tie.ends)
            more = np.round((tie.target(AT_START) - tie.gap(place.values[None])[0]) / TURN) * TURN
            ends = [(k, sign) for k, sign in ((b, 1.0), (a, -1.0)) if k is not None]
            able = [end for end in ends if free[end[0]]] or (ends if tie.item.startswith("initial.") else [])
            for k, sign in able[:1]:
                turns[k] += sign * more
        if (turns == before).all():
            break


def _turned(start: Start, x: Array, follow: IntArray) -> dict[str, Turn]:
    """Return the turns of the bodies that some columns are of."""
    numbers = dict.fromkeys(int(k) // freedoms(start.n_dim) for k in follow)
    turns = {k: tuple(map(float, start.linkage.poses(x)[k].turn)) for k in numbers}
    return {start.names[k]: turn if len(turn) > 1 else turn[0] for k, turn in turns.items()}


def _branches(
    start: Start, place: Stated, free: BoolArray, begin: Array, starts: Array, moved: IntArray, guessed: bool
) -> list[dict[str, Turn]]:
    """Return the other ways to close the loops, from where that which was taken was looked for.

    Where no open turn has moved, all others are of what the deck states otherwise.
    """
    link, ways = start.linkage, [place.values]
    if link.moves(place.values, free):
        return []
    for one in link.search(starts, free):
        if all(link.apart(one, way) > APART for way in ways):
            ways.append(_near(link, one, begin))
    own = ways[1:] if len(moved) and not guessed else []
    others = _told_ways(start, place, ~place.stated, moved, own)
    if len(moved) and not others:
        own = ways[1:]
    return [*(_turned(start, way, moved) for way in own), *others]


def _told_ways(
    start: Start,
    place: Stated,
    free: BoolArray,
    follow: Sequence[int] | IntArray = (),
    known: Sequence[Array] = (),
) -> list[dict[str, Turn]]:
    """Return the angle of the body to be stated otherwise, if one is, then those that follow, in each way.

    Those known are left out.
    """
    found: list[dict[str, Turn]] = []
    for k, x in _otherwise(start, place, free, known):
        parts = (np.where(start.linkage.turning, wrap(one), one) for one in (x, x - place.values))
        turns, off = (start.turns_of(part)[:, 0] for part in parts)  # gears count full ones
        changed = np.flatnonzero(np.abs(off) > APART).tolist()
        others = (int(column) // freedoms(start.n_dim) for column in follow)
        numbers = dict.fromkeys([*([k] if k in changed else []), *others]) or changed
        found.append({start.names[n]: float(turns[n]) for n in numbers})
    return found


def _otherwise(
    start: Start, place: Stated, free: BoolArray, known: Sequence[Array]
) -> Iterator[tuple[int, Array]]:
    """Yield the ways, beside those known, in which planar loops close with one angle stated otherwise, and of
    which body.
    """
    link, x = start.linkage, place.values
    if start.n_dim != 2 or len(start.names) > MOST_STATED:
        return
    turns = (place.stated & ~place.exact & link.turns).reshape(len(start.names), -1)
    ways = [x, *known]
    for k in np.flatnonzero(turns.any(axis=1)):
        mine = np.zeros(turns.shape, dtype=bool)
        mine[k] = turns[k]
        freed = free | mine.ravel()
        if link.moves(x, freed):
            continue
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


def _guesses(start: Start, place: Stated, starts: Array) -> list[Array]:
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
        opened, size = link.cut(ends, ~place.exact)
        if size < CLOSED:  # the other way round, all would
            turned = place.stated & link.turns
            _refuse_faces(start, best, lambda ends: any(turned[m.columns].any() for m in ends))
            if place.stated.any() or start.posed():
                unturned = link.descend(x[None], ~place.stated & ~link.turns)[0]
                raise contradicted(start, place, *link.worst(unturned))
            over = next(iter(link.turned_over(best)), opened.item)
            opened = next(c for c in link.constraints if c.item == over)
        raise cannot_close(start, place, opened, size, link.gaps(best[None])[0])
    near = min((_near(link, one, x) for one in found), key=partial(_off, link, place))
    near = _nearest(link, place, near)
    allowed = _changes(start, place, near)
    if any(change.rough > 1.0 for change in allowed):
        raise contradicted(start, place, *link.worst(best), allowed)
    return [near]


def _off(link: Linkage, place: Stated, x: Array) -> float:
    """Return by how much places (n,) are off what is stated, the largest of it, in units."""
    return magnitude(((x - place.values) / link.units)[place.stated])


def _nearest(link: Linkage, place: Stated, x: Array) -> Array:
    """Return places (n,) in which joints hold, next to x, with the smallest change of what is stated.

    What is not stated follows, by however much.
    """
    guesses, others, units = place.stated & ~place.exact, ~place.stated, link.units
    begin, one = place.values, x.copy()
    for _ in range(APPROACH if len(link.scales) <= MOST_ROWS else 0):
        J, gap = link.slopes_at(one, np.ones(len(x), dtype=bool)), link.gaps(one[None])[0]
        back = ((begin - one) / units)[guesses]
        left, rows = left_over(J, others)
        step = np.zeros(len(x))
        step[guesses] = back - smallest_step(rows[:, guesses], rows[:, guesses] @ back + left @ gap)
        step[others] = -smallest_step(J[:, others], gap + J @ step)
        one += units * step
        if magnitude(step) < CLOSED:
            break
    before, after = (np.linalg.norm(((way - begin) / units)[guesses]) for way in (x, one))
    return one if after < before and link.closes(one, ~place.exact) else x


def _near(link: Linkage, x: Array, begin: Array) -> Array:
    """Return places with turns within half a turn of those at the beginning; in space of none."""
    if link.centres is not None:
        rows = x.reshape(-1, 6).copy()
        far = np.linalg.norm(rows[:, 3:], axis=1) > np.pi
        rows[far, 3:] = rotation_vector(rotation(rows[far, 3:]))
        return np.asarray(rows.ravel())
    return np.where(link.turning, begin + wrap(x - begin), x)


def _settle_rates(start: Start, J: Matrix, rates: Stated) -> None:
    """Change what is not stated until the joints hold, then guesses, as `_settle`."""
    link, values = start.linkage, rates.values
    none = CLOSED * max(1.0, magnitude(values / link.units))
    before = follow_rates(link, J, rates, none)
    missed, allowed = before, tuple[Change, ...]()
    if magnitude(missed) >= none:
        guesses, others = rates.stated & ~rates.exact, ~rates.stated
        if J.shape[0] <= MOST_ROWS:
            left, rows = left_over(J, others)
            values -= link.units * least_turning(link, rows, guesses, left @ before)
            values[others] = 0.0
        else:
            values -= link.units * least_turning(link, J, guesses | others, before)
        missed = follow_rates(link, J, rates, none)
        allowed = _changes(start, rates, values)
    if magnitude(missed) >= none or any(change.rough > 1.0 for change in allowed):
        joint, size = link.largest_of(before)
        if J.shape[0] <= MOST_ROWS:
            size = opened(link, J, ~rates.stated, before, joint)
        raise contradicted(start, rates, joint, size, allowed, before)


def _changes(start: Start, given: Stated, values: Array) -> tuple[Change, ...]:
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
    of_spins, of_speeds = magnitude(values[link.turns]), magnitude(values[~link.turns])
    # where nothing else moves, no stated rate is a guess
    return ROUGH_RATE * max(of_spins if quantity == "angular_velocity" else of_speeds, 1e-300)
