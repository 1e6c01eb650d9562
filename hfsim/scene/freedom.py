"""What the joints leave free at the start, all bodies taken as rigid, and what of that looks like a slip."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Matrix, is_sparse
from hfsim.maths.rank import null_space
from hfsim.maths.rotations import cross, normal
from hfsim.parts.specs import JointSpec, SpringSpec
from hfsim.scene.assembly import Assembly
from hfsim.scene.closing import Linkage
from hfsim.scene.rules import owners
from hfsim.scene.schema import Deck

MOST_BODIES = 100
"""Bodies of one mechanism up to which its free motions are told apart."""
NONE = 1e-9
"""Part of the largest motion that counts as none."""
NO_MASS = 1e-12
"""Inertia of a motion, as `FreeMotion` says, below which hardly any mass resists it."""
CLOSE = 1e-6
"""Distance from a joint, relative to the size, up to which a body turns about it."""
AXES = "xyz"


class FreeMotion(NamedTuple):
    """Motions that the joints leave a body while those nearer to the ground stand still.

    Attributes
    ----------
    number : int
        How many, independent of each other.
    kind : str
        ``turns``, ``slides``, ``floats`` (two shifts or more) or ``turns and slides``.
    about : str
        Joint or place that it turns about, axis that it slides along, or the freedoms of one that floats.
    takes_along : tuple of str
        Bodies that must follow.
    inertia : float
        Kinetic energy of the motion over that of a shift of all bodies as fast as its largest part.
    """

    body: str
    number: int
    kind: str
    about: str
    takes_along: tuple[str, ...]
    inertia: float

    def __str__(self) -> str:
        others = f", with {', '.join(self.takes_along)}" if self.takes_along else ""
        link = {"turns": " about", "slides": " along", "floats": ":"}.get(self.kind, ":")
        return f"{self.body}: {self.kind}{link} {self.about}{others}"


def free_motions(
    assembly: Assembly, energy: Callable[[Array], float], lines: Collection[str] = ()
) -> list[FreeMotion] | None:
    """Return the rigid motions that are left at the start, body by body from the ground outwards.

    None if a mechanism has so many bodies that they are not told apart.

    Parameters
    ----------
    energy : callable
        Rates of the frames (n,) -> kinetic energy of the scene [J].
    lines : collection of str
        Bodies in space that are lines without sections: that they roll is no motion.
    """
    names = tuple(assembly.poses)
    groups = _mechanisms(assembly.linkage, len(names))
    if max(map(len, groups)) > MOST_BODIES:
        return None
    link = assembly.linkage
    mass = energy(np.where(link.turns, 0.0, link.units)) / link.n_dim
    slopes = link.slopes_by_rates(assembly.place)
    slopes = slopes.tocsc() if is_sparse(slopes) else slopes
    every, found = (assembly, energy, mass, slopes), list[FreeMotion]()
    for group in groups:
        own = {names[k] for k in group}
        found += _motions_of(group, *every, [line for line in lines if line in own])
    return found


def _mechanisms(link: Linkage, count: int) -> list[list[int]]:
    """Return the numbers of bodies that joints connect, each group from the ground outwards."""
    near: dict[int | None, list[int]] = {}
    for c in link.constraints:
        for here, there in permutations(map(link.owner, c.ends), 2):
            if there is not None and there != here:
                near.setdefault(here, []).append(there)
    groups: list[list[int]] = []
    depth: dict[int, int] = {}
    for first in dict.fromkeys([*near.get(None, ()), *range(count)]):
        if first in depth:
            continue
        group, depth[first] = [first], 0 if first in near.get(None, ()) else 1
        for body in group:
            for other in near.get(body, ()):
                if other not in depth:
                    depth[other] = 0 if other in near.get(None, ()) else depth[body] + 1
                    group.append(other)
        groups.append(sorted(group, key=lambda body: depth[body]))
    return groups


def _motions_of(
    group: Sequence[int],
    assembly: Assembly,
    energy: Callable[[Array], float],
    whole_mass: float,
    slopes: Matrix,
    lines: Sequence[str],
) -> Iterator[FreeMotion]:
    link, names = assembly.linkage, tuple(assembly.poses)
    joined = np.concatenate([link.columns_of(body) for body in group])
    touched = np.concatenate([_touching(slopes[:, joined]), assembly.rolls(lines)[:, joined]])
    order = np.argsort(joined)
    motions, units, found = null_space(touched[touched.any(axis=1)])[order], link.units[joined[order]], []
    rows = {body: np.searchsorted(joined[order], link.columns_of(body)) for body in group}

    def energy_of(motion: Array) -> float:
        rates = np.zeros(link.n)
        rates[joined[order]] = units * motion
        return energy(rates)

    for body in group:
        own, sizes, mixed = np.linalg.svd(motions[rows[body]], full_matrices=True)
        rank = int(np.sum(sizes > NONE))
        found.append((body, own[:, :rank], motions @ mixed[:rank].T))
        motions = motions @ mixed[rank:].T
    held = {body for body, own, _ in found if not own.shape[1]}
    for body, own, whole in found:
        if own.shape[1]:
            along = [n for n in group if n in held and np.abs(whole[rows[n]]).max() > NONE]
            held -= set(along)
            kind, about = _described(own * units[rows[body]][:, None], body, assembly)
            least = min(energy_of(one) / np.abs(one).max() ** 2 for one in whole.T)
            follow = tuple(names[n] for n in along)
            yield FreeMotion(names[body], own.shape[1], kind, about, follow, least / whole_mass)


def _touching(slopes: Matrix) -> Array:
    """Return slopes as dense ones, of sparse ones (by columns) only the rows that are not zero."""
    if not is_sparse(slopes):
        return np.asarray(slopes)
    return np.asarray(slopes[np.unique(slopes.indices)].toarray())


def _described(own: Array, body: int, assembly: Assembly) -> tuple[str, str]:
    """Return kind and place of the motions (n_freedoms, k) of a body."""
    n_dim = assembly.linkage.n_dim
    if n_dim == 3:
        return _described_in_space(own, body, assembly)
    shifts = own @ null_space(own[n_dim:], 1.0)
    if shifts.shape[1] == n_dim:
        return "floats", ", ".join([*AXES[:n_dim], "turn"][: own.shape[1]])
    if own.shape[1] > 1:
        return "turns and slides", f"along {_axis(shifts[:n_dim, 0])}"
    return (
        ("slides", _axis(shifts[:n_dim, 0])) if shifts.size else ("turns", _pole(own[:, 0], body, assembly))
    )


def _described_in_space(own: Array, body: int, assembly: Assembly) -> tuple[str, str]:
    shifts, turns = own @ null_space(own[3:], 1.0), own[3:]
    axes, sizes, _ = np.linalg.svd(turns)
    n_turns, n_shifts = int(np.sum(sizes > NONE)), shifts.shape[1]
    if n_shifts >= 2:
        names = ["x", "y", "z"] if n_shifts == 3 else [f"{n_shifts} shifts"]
        return "floats", ", ".join([*names, *([f"{n_turns} turns"] if n_turns else [])])
    if not n_turns:
        return "slides", _axis(shifts[:3, 0])
    about = f"axis {_axis(axes[:, 0])}" if n_turns == 1 else f"{n_turns} axes"
    along = f", along {_axis(shifts[:3, 0])}" if n_shifts else ""
    joint = _turned_about(own, axes[:, :n_turns], body, assembly)
    if along:
        return "turns and slides", f"{joint or about}{along}"
    return "turns", f"{joint}, {about}" if joint else about


def _turned_about(own: Array, axes: Array, body: int, assembly: Assembly) -> str:
    """Return the joint whose place motions (6, k) of a body leave, or move along their one axis, or ''."""
    link, x = assembly.linkage, assembly.place
    origin = x[link.columns_of(body)][:3]
    for c, marker in link.ends_on.get(body, ()):
        if c.item.startswith("joints."):
            arm = marker.position(x[None])[0] - origin
            moved = own[:3] + cross(own[3:].T, arm).T
            if axes.shape[1] == 1:
                moved = moved - axes @ (axes.T @ moved)
            if np.abs(moved).max() < CLOSE * link.size:
                return c.item.removeprefix("joints.")
    return ""


def _axis(direction: Array) -> str:
    unit = direction / np.linalg.norm(direction)
    unit = unit if unit[np.argmax(np.abs(unit))] > 0.0 else -unit
    return _place(np.where(np.abs(unit) < NONE, 0.0, unit))


def _place(numbers: Array) -> str:
    return f"[{', '.join(f'{number:.4g}' for number in numbers + 0.0)}]"


def _pole(twist: Array, body: int, assembly: Assembly) -> str:
    """Return about which joint or place a body turns, in the plane."""
    link, x = assembly.linkage, assembly.place
    n_dim = link.n_dim
    pole = x[link.columns_of(body)][:n_dim] + normal(twist[:n_dim]) / twist[n_dim]
    for c, marker in link.ends_on.get(body, ()):
        if c.holds_place and np.abs(marker.position(x[None])[0] - pole).max() < CLOSE * link.size:
            return c.item.removeprefix("joints.")
    return _place(np.where(np.abs(pole) < CLOSE * link.size, 0.0, pole))


# --- what looks like a slip -----------------------------------------------------------------------


def slips(deck: Deck, assembly: Assembly, motions: Sequence[FreeMotion]) -> Iterator[tuple[str, str]]:
    """Yield, with the deck path it is about, what the joints leave free though it hardly can be meant."""
    groups, joined, ties = _groups(assembly), _joined(assembly), _ties_of(deck)
    afloat = {motion.body: groups[motion.body] for motion in motions if motion.kind == "floats"}
    others_stand = len(set().union(*afloat.values())) < len(deck.bodies)
    for motion in motions:
        if motion.body in afloat:
            members = _floating_with(joined, motion, afloat[motion.body])
            own = {tie.number: tie for one in members for tie in ties.get(one, ())}
            yield from _floating(deck, motion.body, members, [own[k] for k in sorted(own)], others_stand)
        if motion.inertia < NO_MASS:
            message = f"hardly any mass resists this free motion: {motion}"
            yield f"bodies.{motion.body}", message
    for name in {c.item.removeprefix("joints."): None for c in assembly.linkage.constraints if c.driven}:
        yield from _idle_driver(deck, name, groups)
        yield from _loose_driver(deck, name, motions)


def _groups(assembly: Assembly) -> dict[str, set[str]]:
    """Return for each body the bodies that joints connect it with, itself among them."""
    names = tuple(assembly.poses)
    groups = _mechanisms(assembly.linkage, len(names))
    return {name: own for group in groups for own in [{names[k] for k in group}] for name in own}


def _joined(assembly: Assembly) -> dict[str, list[set[str]]]:
    """Return for each body what its constraints connect, the ground among it."""
    link, names = assembly.linkage, (*assembly.poses, "ground")
    pairs: dict[str, list[set[str]]] = {name: [] for name in names}
    for c in link.constraints:
        pair = {names[-1 if n is None else n] for n in map(link.owner, c.ends)}
        for name in pair:
            pairs[name].append(pair)
    return pairs


class _Tie(NamedTuple):
    """A joint or a spring, by its number among all of them, with its ends."""

    number: int
    name: str
    spec: JointSpec | SpringSpec
    ends: frozenset[str]


def _ties_of(deck: Deck) -> dict[str, list[_Tie]]:
    """Return the joints and springs on each body, and on the ground."""
    found: dict[str, list[_Tie]] = {}
    for number, (name, spec) in enumerate((*deck.joints.items(), *deck.springs.items())):
        tie = _Tie(number, name, spec, frozenset(owners(spec)))
        for body in tie.ends:
            found.setdefault(body, []).append(tie)
    return found


def _floating(
    deck: Deck, body: str, members: set[str], ties: Sequence[_Tie], others_stand: bool
) -> Iterator[tuple[str, str]]:
    """Yield why a body that floats, the nearest to the ground of its mechanism, looks as if it should not.

    Parameters
    ----------
    members : set of str
        Bodies that float with it.
    ties : sequence of _Tie
        What is on these.
    """
    outer = [(tie.name, tie.spec) for tie in ties if tie.ends - members]
    if any(tie.carries and tie.steadies for _, tie in outer) or any(_placed(deck, one) for one in members):
        return
    stated = "state a position or velocity under 'initial' if that is meant"
    *others, last = [f"'{name}'" for name, tie in outer if not tie.carries] or [""]
    turning = f"{', '.join(others)} and {last} turn" if others else f"{last} turns"
    if last:
        yield f"bodies.{body}", f"floats, though {turning} it: no joint holds it in place; {stated}"
    elif any(deck.gravity) or others_stand:
        names = ", ".join(f"'{one}'" for one in deck.bodies if one in members)
        yield f"bodies.{body}", f"nothing connects {names} to the ground; {stated}"


def _floating_with(
    joined: Mapping[str, Sequence[set[str]]], motion: FreeMotion, group: set[str]
) -> set[str]:
    """Return the bodies that joints connect with the ground by way of one that floats, if at all."""
    ends = [pair for name in group for pair in joined[name]]
    held, floating = {"ground"}, {motion.body, *motion.takes_along}
    while more := {one for pair in ends if pair & held and not pair & floating for one in pair} - held:
        held |= more
    return group - held


def _placed(deck: Deck, name: str) -> bool:
    """Whether the deck says where a body is or flies at the start."""
    entry = deck.motions.get(name)
    return entry is not None and not (entry.position is None and entry.velocity is None)


def _idle_driver(deck: Deck, name: str, groups: Mapping[str, set[str]]) -> Iterator[tuple[str, str]]:
    """Yield a driver that moves a rigid body alone, on which nothing acts, where there are others."""
    driver = deck.joints[name]
    resisting = (joint for joint in deck.joints.values() if any(joint.resisting.values()))
    acted = set().union(*map(owners, (*deck.springs.values(), *resisting)))
    acted |= {load.owner for load in deck.loads.values()}
    for body in owners(driver) - {"ground"} - acted:
        alone = groups[body] == {body} and deck.bodies[body].rigid
        if alone and len(deck.bodies) > 1 and not driver.stands:
            yield f"joints.{name}", f"moves '{body}' alone: nothing joins it to other bodies or resists it"


def _loose_driver(deck: Deck, name: str, motions: Sequence[FreeMotion]) -> Iterator[tuple[str, str]]:
    """Yield a driver of an angle between bodies of which one slides, as no joint holds both together."""
    ends = owners(deck.joints[name])
    held = any(joint.carries and owners(joint) == ends for joint in deck.joints.values())
    for motion in motions:
        slides = motion.kind not in ("floats", "turns") and motion.body in ends
        if slides and not held and not deck.joints[name].carries:
            both = " and ".join(f"'{one}'" for one in sorted(ends))
            message = f"turns '{motion.body}', which {motion.kind}: no joint holds {both} together"
            yield f"joints.{name}", message
