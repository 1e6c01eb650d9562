"""What a scene does not need is left out: all rules on one page.

Each rule is one entry of `RULES`.  It looks at the deck and at how the model steps, and names what can
be left out; `hfsim.scene.build` asks the rules once, between deck and system, and builds the rest.  A rule
drops what is exactly zero, or writes the same equations with fewer unknowns, so that the results with and
without it agree to round-off.  ``solve.keep: [RULE, ...]`` switches rules off, ``solve.keep_all`` all.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias

from hfsim.deck.fields import split_point
from hfsim.maths.frozen import frozen
from hfsim.parts.channels import kind_of

if TYPE_CHECKING:
    from hfsim.mechanics.system import System
    from hfsim.parts.bodies.models import Model
    from hfsim.parts.specs import JointSpec, SpringSpec
    from hfsim.scene.schema import Deck, SolveSpec

Models: TypeAlias = "Mapping[str, Model]"
"""Model of each beam, as it is stepped."""
Items = tuple[str, ...]
"""Deck paths (``springs.coil``) or plain words for what is left out; empty if the rule does not fire."""
Sizes = dict[str, int]
"""Counts of what a scene consists of, or of what a rule saves of it."""
Finding: TypeAlias = "Callable[[Deck, Models], Items]"
Settling: TypeAlias = "Callable[[Assembled, Items], tuple[Items, Sizes]]"


class Assembled(Protocol):
    """What is asked of an assembled scene."""

    @property
    def deck(self) -> Deck:
        """The deck."""

    @property
    def system(self) -> System:
        """The system."""

    @property
    def left_out(self) -> LeftOut:
        """What the rules found."""


PARTS_FROM = 64
"""Coordinates of all bodies from which parts are integrated apart; below, calls cost, not what is in them.

Two pendulums of 4, 6, 8 and 12 elements took 1.8, 1.5, 1.3 and 0.3 times as long apart as together, a soft
and a stiff one 1.0, 0.9, 0.8 and 0.3 times.
"""


class Rule(NamedTuple):
    """One thing that scenes may not need.

    Attributes
    ----------
    name : str
        As in ``solve.keep``.
    when : str
        The condition, in words.
    because : str
        Why results do not change.
    find : callable
        (deck, models of the beams) -> what can be left out.
    spares : mapping of str to int
        Counts that each item found saves.
    settled : callable
        (assembled scene, what was found) -> what really was left out, and the counts it saves; if it is not
        what was found.
    """

    name: str
    leaves_out: str
    when: str
    because: str
    find: Finding
    spares: Sizes
    settled: Settling | None

    def kept_because(self, solve: SolveSpec) -> str:
        """Return why it leaves nothing out."""
        if solve.keep_all:
            return "solve.keep_all"
        return "named in solve.keep" if self.name in solve.keep else f"only when {self.when}"

    def told(self, scene: Assembled) -> dict[str, Any]:
        """Return what was left out of a scene, why, and what that saves; without ``items`` if nothing was."""
        items = scene.left_out[self.name]
        saves = {size: count * len(items) for size, count in self.spares.items()}
        if self.settled is not None:
            items, saves = self.settled(scene, items)
        facts: dict[str, Any] = {"rule": self.name, "leaves_out": self.leaves_out}
        if not items:
            return facts | {"reason": self.kept_because(scene.deck.solve)}
        return facts | {"reason": f"{self.when}; {self.because}", "items": list(items), "saves": saves}


@frozen
class LeftOut:
    """What the rules found in one scene.

    Attributes
    ----------
    found : mapping of str to tuple of str
        By rule.
    """

    found: Mapping[str, Items]

    def __getitem__(self, rule: str) -> Items:
        """Return what a rule found."""
        return self.found[rule]

    def fires(self, rule: str) -> bool:
        """Whether a rule found anything."""
        return bool(self.found[rule])


def apply_rules(deck: Deck, models: Models) -> LeftOut:
    """Ask every rule."""
    return LeftOut({name: apply_rule(name, deck, models) for name in RULES})


def apply_rule(name: str, deck: Deck, models: Models) -> Items:
    """Ask one rule; it finds nothing if the deck switches it off."""
    return () if keeps(deck, name) else RULES[name].find(deck, models)


def keeps(deck: Deck, name: str) -> bool:
    """Tell whether a deck switches a rule off."""
    return deck.solve.keep_all or name in deck.solve.keep


RULES: dict[str, Rule] = {}
"""All rules by name, in the order they are told."""


def _rule(
    leaves_out: str, when: str, because: str, settled: Settling | None = None, **spares: int
) -> Callable[[Finding], Finding]:
    """Make a rule of the function that finds what can be left out; see `Rule`."""

    def register(find: Finding) -> Finding:
        name = find.__name__.strip("_")
        counts = {size.replace("_", " "): count for size, count in spares.items()}
        RULES[name] = Rule(name, leaves_out, when, because, find, counts, settled)
        return find

    return register


def _unless(fact: str, size: str) -> Settling:
    """Return what settles a rule that drops what the system does not need."""
    return lambda scene, items: (() if getattr(scene.system, fact) else items, {size: 1})


def _settled_joints(scene: Assembled, items: Items) -> tuple[Items, Sizes]:
    system = scene.system
    joints = dict.fromkeys(system.constraints[k].item for k in sorted(system.reduction.eliminated))
    multipliers = system.unreduced.n_rows - system.n_rows
    return tuple(joints), {"unknowns": system.n_x - system.n, "multipliers": multipliers}


# --- the rules -----------------------------------------------------------------------------------


@_rule(
    "body-force integrals",
    "gravity is zero",
    "their force is zero",
    lambda scene, items: (items, {"terms of Q": 1, "body-force integrals": len(items)}),
)
def _weight(deck: Deck, models: Models) -> Items:
    return () if any(deck.gravity) else tuple(f"weight of bodies.{name}" for name in deck.bodies)


@_rule(
    "springs and dampers", "stiffness and damping are zero", "their force and energy are zero", terms_of_Q=1
)
def _springs(deck: Deck, models: Models) -> Items:
    return tuple(f"springs.{name}" for name, spring in deck.springs.items() if not spring.acts)


@_rule("forces and moments", "their size, or a constant law, is zero", "they do nothing", terms_of_Q=1)
def _loads(deck: Deck, models: Models) -> Items:
    return tuple(f"loads.{name}" for name, load in deck.loads.items() if not load.acts)


@_rule(
    "Kelvin-Voigt damping of beams",
    "both retardation times of the material are zero",
    "its force is zero",
    terms_of_Q=1,
)
def _damping(deck: Deck, models: Models) -> Items:
    # in other models it is of one piece with the elastic force
    nodal = (name for name, model in models.items() if model.strain == "exact")
    return tuple(f"damping of bodies.{name}" for name in nodal if not deck.properties(name).damped)


@_rule(
    "time in drivers",
    "the law is a constant angle, or the position zero",
    "the driver does no work and its equation is that of a joint",
    driven_equations=1,
)
def _standing_drivers(deck: Deck, models: Models) -> Items:
    return tuple(f"joints.{name}" for name, joint in deck.joints.items() if joint.stands)


@_rule(
    "rigid bodies that cannot move",
    "undriven fixed joints weld them to the ground; no channel is a reaction of these or the centre of mass",
    "their points are points of the ground",
    coordinates=3,
    joint_equations=3,
)
def _fixed_bodies(deck: Deck, models: Models) -> Items:
    """Return the rigid bodies that undriven fixed joints weld to the ground, unless none would be left."""
    standing, before = {"ground"}, 0
    welding = [(name, owners(joint)) for name, joint in deck.joints.items() if joint.welds]
    while before < len(standing):
        before = len(standing)
        for name, ends in welding:
            fresh = ends - standing
            if len(fresh) == 1 and _may_stand(deck, name, *fresh):
                standing |= fresh
    folded = tuple(name for name in deck.bodies if name in standing)
    return tuple(f"bodies.{name}" for name in folded) if len(folded) < len(deck.bodies) else ()


def owners(tie: JointSpec | SpringSpec) -> set[str]:
    """Return the bodies, or the ground, that a joint or a spring connects."""
    return {split_point(point)[0] for point in tie.points}


def _may_stand(deck: Deck, joint: str, body: str) -> bool:
    """Whether a body is rigid and nobody asks for what holds it, or for the centre of mass."""
    asked = {channel.rpartition(".")[0] for channel in deck.channels}
    return deck.bodies[body].rigid and asked.isdisjoint((joint, "centre_of_mass"))


def welds(deck: Deck, bodies: Iterable[str]) -> frozenset[str]:
    """Return the joints that hold folded bodies, one for each: the first that fixes it to what stands."""
    left, found = set(bodies), set()
    still = {"ground", *left}
    while left:
        for name, joint in deck.joints.items():
            ends = owners(joint)
            if joint.welds and len(ends & left) == 1 and ends - left <= still:
                found.add(name)
                left -= ends
                break
    return frozenset(found)


@_rule(
    "multipliers and dependent coordinates of open chains",
    "a joint holds points at nodes or centres of mass, or guides one of these, and closes no loop",
    "what is left fulfils the joint for all values: a pinned root has no place of its own",
    _settled_joints,
)
def _tree_joints(deck: Deck, models: Models) -> Items:
    linear = (
        name
        for name, joint in deck.joints.items()
        if joint.meets and all(_is_linear(deck, models, point) for point in joint.between)
    )
    return tuple(f"joints.{name}" for name in linear)


def _is_linear(deck: Deck, models: Models, point: str) -> bool:
    """Whether the position of a point is linear: not in body frames, nor off the centre of a rigid body."""
    owner, place = split_point(point)
    if owner in models:
        # a rigid line in space has the positions of both its ends for coordinates
        linear = ("exact", "none") if deck.dimension == 3 else ("exact",)
        return not models[owner].frame and models[owner].strain in linear
    return owner == "ground" or not place


@_rule(
    "the factorisation of the mass matrix in every state",
    "no beam without sections is of the model lowOrder: mass matrices do not change",
    "one factorisation serves for all states",
    factorisations_a_state=1,
)
def _constant_mass(deck: Deck, models: Models) -> Items:
    varying = any(model.varying_mass for model in models.values())
    return () if varying else ("factors of the mass matrix",)


@_rule(
    "velocities of points in every state",
    "no force depends on them, nor does a joint that turns",
    "nothing would read them",
    _unless("uses_rates", "maps of rates"),
)
def _rates(deck: Deck, models: Models) -> Items:
    return ("rates of all points",)


@_rule(
    "the integral of the power put in",
    "no damper, no load that acts and no driver that moves",
    "the power is zero",
    _unless("exchanges_power", "integrals over time"),
)
def _work(deck: Deck, models: Models) -> Items:
    return ("work put in",)


@_rule(
    "common steps of parts that nothing connects",
    f"no joint or spring connects them, save through the ground, the scene has {PARTS_FROM} coordinates "
    "or more, and the step is not fixed",
    "their motions do not depend on one another; each part takes steps of its own",
    lambda scene, items: (items, {"common steps": 1}),
)
def _parts(deck: Deck, models: Models) -> Items:
    """Return groups of bodies that no joint or spring connects, the ground apart; none if all are one."""
    if deck.solve.step is not None or sum(b.size(deck.dimension) for b in deck.bodies.values()) < PARTS_FROM:
        return ()
    groups = connected(deck, still_bodies(deck, models))
    return tuple(", ".join(group) for group in groups) if len(groups) > 1 else ()


def still_bodies(deck: Deck, models: Models) -> tuple[str, ...]:
    """Return the bodies that are folded into the ground."""
    return tuple(item.removeprefix("bodies.") for item in apply_rule("fixed_bodies", deck, models))


def connected(deck: Deck, still: Iterable[str], without: str = "") -> list[tuple[str, ...]]:
    """Return the moving bodies of each connected part of a scene, in the deck's order.

    Ground and still bodies connect nothing: they do not move.  Nor do springs of one kind, if told so.
    """
    fixed = {"ground", *still}
    ties = (*deck.joints.values(), *(one for one in deck.springs.values() if one.type != without))
    moving = [name for name in deck.bodies if name not in fixed]
    return _groups(parts_of(moving, (owners(tie) - fixed for tie in ties)))


def closes_loops(deck: Deck) -> bool:
    """Tell whether any two bodies that a joint connects are connected another way too."""
    pairs = {frozenset(owners(joint)) for joint in deck.joints.values()}
    part = parts_of(("ground", *deck.bodies), pairs)
    return len(part) - len(pairs) != len({id(one) for one in part.values()})


def welded(deck: Deck, rigid: Collection[str]) -> list[tuple[str, ...]]:
    """Return the sets of some bodies that fixed joints hold together, also of one body."""
    ties = (owners(joint) for joint in deck.joints.values() if joint.welds)
    return _groups(parts_of(rigid, filter({*rigid}.issuperset, ties)))


def _groups(part: Mapping[str, set[str]]) -> list[tuple[str, ...]]:
    order, parts = {name: k for k, name in enumerate(part)}, {id(one): one for one in part.values()}
    return [tuple(sorted(one, key=order.__getitem__)) for one in parts.values()]


def parts_of(names: Iterable[str], ties: Iterable[Collection[str]]) -> dict[str, set[str]]:
    """Return for each name those that it is connected with, itself among them: one set for all of these."""
    part = {name: {name} for name in names}
    for ends in ties:
        connect(part, ends)
    return part


def connect(part: dict[str, set[str]], ends: Collection[str]) -> None:
    """Take note that some names are connected, among those that each is connected with, in place."""
    whole = max((part[end] for end in ends), key=len, default=set())
    for one in {id(part[end]): part[end] for end in ends if part[end] is not whole}.values():
        whole |= one
        part.update(dict.fromkeys(one, whole))


@_rule(
    "counting of full turns along all steps",
    "no channel is measured in the body's frame",
    "nothing would read it",
    passes_over_all_steps=1,
)
def _turns(deck: Deck, models: Models) -> Items:
    asked = {channel.split(".")[0] for channel in deck.channels if kind_of(channel).of_turns}
    # elsewhere the angle is a coordinate
    nodal = (name for name, model in models.items() if model.strain == "exact" and not model.frame)
    return tuple(f"turns of bodies.{name}" for name in nodal if name not in asked)


@_rule("outlines of the bodies and pictures", "output asks for none", "nothing would read them", outlines=1)
def _plots(deck: Deck, models: Models) -> Items:
    output = deck.output
    return () if output.plots or output.shapes or output.snapshots else ("plots and outlines",)
