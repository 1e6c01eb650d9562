"""What a scene does not need is left out: all rules on one page.

Each rule is one entry of `RULES`.  It looks at the deck and at how the model steps, and names what can
be left out; `hfsim.scene.build` asks the rules once, between deck and system, and builds the rest.  A rule
drops what is exactly zero, or writes the same equations with fewer unknowns, so that the results with and
without it agree to round-off.  ``solve.keep: [RULE, ...]`` switches rules off, ``solve.keep_all`` all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias

if TYPE_CHECKING:
    from hfsim.mechanics.system import System
    from hfsim.parts.bodies.models import Model
    from hfsim.scene.schema import Deck

Models: TypeAlias = "Mapping[str, Model]"
"""Model of each beam, as it is stepped."""
Items = tuple[str, ...]
"""Deck paths (``springs.coil``) or plain words for what is left out; empty if the rule does not fire."""
Sizes = dict[str, int]
"""Counts of what a scene consists of, or of what a rule saves of it."""


class Assembled(Protocol):
    """What savings are read from."""

    @property
    def system(self) -> System:
        """The system."""

    @property
    def joints(self) -> Mapping[str, tuple[int, ...]]:
        """Which constraints of the system each joint is made of."""


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
    leaves_out : str
    when : str
        The condition, in words.
    because : str
        Why results do not change.
    find : callable
        (deck, models of the beams) -> what can be left out.
    saved : callable
        (assembled scene, what was found) -> what really was left out, and the counts it saves.
    """

    name: str
    leaves_out: str
    when: str
    because: str
    find: Callable[[Deck, Models], Items]
    saved: Callable[[Assembled, Items], tuple[Items, Sizes]]


@dataclass(frozen=True)
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
    kept = deck.solve.keep_all or name in deck.solve.keep
    return () if kept else RULES[name].find(deck, models)


# --- conditions ----------------------------------------------------------------------------------


def _weight(deck: Deck, models: Models) -> Items:
    return () if any(deck.gravity) else tuple(f"weight of bodies.{name}" for name in deck.bodies)


def _springs(deck: Deck, models: Models) -> Items:
    idle = (name for name, spring in deck.springs.items() if not spring.stiffness and not spring.damping)
    return tuple(f"springs.{name}" for name in idle)


def _loads(deck: Deck, models: Models) -> Items:
    return tuple(f"loads.{name}" for name, load in deck.loads.items() if _is_zero(load))


def _is_zero(load: Any) -> bool:
    size = load.force if load.type == "force" else (load.moment,)
    return not any(size) or (load.law is not None and load.law.type == "constant" and not load.law.value)


def _damping(deck: Deck, models: Models) -> Items:
    # in other models it is of one piece with the elastic force
    nodal = (name for name, _ in _beams(deck) if models[name].strain == "exact")
    idle = (name for name in nodal if not deck.properties(name).damped)
    return tuple(f"damping of bodies.{name}" for name in idle)


def _beams(deck: Deck) -> Iterator[tuple[str, Any]]:
    return ((name, spec) for name, spec in deck.bodies.items() if spec.type == "beam")


def _standing_drivers(deck: Deck, models: Models) -> Items:
    return tuple(f"joints.{name}" for name, joint in deck.joints.items() if _stands(joint))


def _stands(joint: Any) -> bool:
    if joint.type != "driver":
        return False
    law = joint.angle or joint.position
    if law.type == "constant_rate":
        still, value = law.rate == 0.0, law.start
    else:
        still, value = law.type == "constant", getattr(law, "value", 0.0)
    return still and (joint.position is None or value == 0.0)


def _fixed_bodies(deck: Deck, models: Models) -> Items:
    """Return the rigid bodies that undriven fixed joints weld to the ground, unless none would be left."""
    standing = {"ground"}
    for _ in deck.joints:
        for name, joint in deck.joints.items():
            sides = [point.split(".")[0] for point in joint.between]
            fresh = [side for side in sides if side not in standing]
            if joint.type == "fixed" and len(fresh) == 1 and _may_stand(deck, name, fresh[0]):
                standing.add(fresh[0])
    folded = tuple(name for name in deck.bodies if name in standing)
    return tuple(f"bodies.{name}" for name in folded) if len(folded) < len(deck.bodies) else ()


def _may_stand(deck: Deck, joint: str, body: str) -> bool:
    """Whether a body is rigid and nobody asks for what holds it."""
    return deck.bodies[body].type == "rigid" and not any(
        channel.rpartition(".")[0] == joint for channel in deck.channels
    )


def welds(deck: Deck, bodies: Iterable[str]) -> frozenset[str]:
    """Return the joints that hold folded bodies, one for each: the first that fixes it to what stands."""
    left, found = set(bodies), set()
    while left:
        for name, joint in deck.joints.items():
            moving = {point.split(".")[0] for point in joint.between} & left
            others = {point.split(".")[0] for point in joint.between} - left
            if joint.type == "fixed" and len(moving) == 1 and others <= {"ground", *bodies}:
                found.add(name)
                left -= moving
                break
    return frozenset(found)


def _tree_joints(deck: Deck, models: Models) -> Items:
    linear = (
        name
        for name, joint in deck.joints.items()
        if joint.type in ("revolute", "fixed") and all(_is_linear(deck, models, p) for p in joint.between)
    )
    return tuple(f"joints.{name}" for name in linear)


def _is_linear(deck: Deck, models: Models, point: str) -> bool:
    """Whether the position of a point is linear: not in body frames, nor off the centre of a rigid body."""
    owner, _, place = point.partition(".")
    if owner in models:
        return not models[owner].frame and models[owner].strain == "exact"
    return owner == "ground" or not place


def _constant_mass(deck: Deck, models: Models) -> Items:
    return () if _varying(models) else ("factors of the mass matrix",)


def _varying(models: Models) -> bool:
    """Whether a mass matrix changes with the motion."""
    return any(model.strain == "low_order" for model in models.values())


def _rates(deck: Deck, models: Models) -> Items:
    if _varying(models) or any(s.damping for s in deck.springs.values()):
        return ()
    return () if any(deck.properties(name).damped for name, _ in _beams(deck)) else ("rates of all points",)


def _work(deck: Deck, models: Models) -> Items:
    damped = any(s.damping for s in deck.springs.values())
    damped = damped or any(deck.properties(name).damped for name, _ in _beams(deck))
    acting = any(not _is_zero(load) for load in deck.loads.values())
    driven = any(j.type == "driver" and not _stands(j) for j in deck.joints.values())
    return () if damped or acting or driven else ("work put in",)


def _parts(deck: Deck, models: Models) -> Items:
    """Return groups of bodies that no joint or spring connects, the ground apart; none if all are one."""
    if deck.solve.step is not None or _coordinates(deck) < PARTS_FROM:
        return ()
    groups = connected(deck, still_bodies(deck, models))
    return tuple(", ".join(group) for group in groups) if len(groups) > 1 else ()


def _coordinates(deck: Deck) -> int:
    """Return the number of absolute coordinates of all bodies, near enough."""
    beams = (4 * (spec.elements + 1) + 2 * (spec.degree - 3) * spec.elements for _, spec in _beams(deck))
    return int(sum(beams)) + 3 * sum(spec.type == "rigid" for spec in deck.bodies.values())


def still_bodies(deck: Deck, models: Models) -> tuple[str, ...]:
    """Return the bodies that are folded into the ground."""
    found = apply_rule("fixed_bodies", deck, models)
    return tuple(item.removeprefix("bodies.") for item in found)


def connected(deck: Deck, still: Iterable[str]) -> list[tuple[str, ...]]:
    """Return the moving bodies of each connected part of a scene, in the deck's order.

    Ground and still bodies connect nothing: they do not move.
    """
    fixed = {"ground", *still}
    part = {name: {name} for name in deck.bodies if name not in fixed}
    for tie in (*deck.joints.values(), *deck.springs.values()):
        ends = {point.split(".")[0] for point in tie.between} - fixed
        merged = set().union(*(part[end] for end in ends))
        part.update({name: merged for name in merged})
    return list(dict.fromkeys(tuple(n for n in part if n in part[name]) for name in part))


def _turns(deck: Deck, models: Models) -> Items:
    asked = {channel.split(".")[0] for channel in deck.channels if channel.rpartition(".")[2] in _NEED_ANGLE}
    # elsewhere the angle is a coordinate
    nodal = (name for name, model in models.items() if model.strain == "exact" and not model.frame)
    return tuple(f"turns of bodies.{name}" for name in nodal if name not in asked)


_NEED_ANGLE = ("angle", "deflection", "elongation")
"""Channels that are measured in a body's frame."""


def _plots(deck: Deck, models: Models) -> Items:
    return () if deck.output.plots else ("plots and outlines",)


# --- savings -------------------------------------------------------------------------------------


def _each(size: str) -> Callable[[Assembled, Items], tuple[Items, Sizes]]:
    """Return the saving of a rule that spares one of something for each item."""
    return lambda scene, items: (items, {size: len(items)} if items else {})


def _saved_weight(scene: Assembled, items: Items) -> tuple[Items, Sizes]:
    return items, {"terms of Q": 1, "body-force integrals": len(items)} if items else {}


def _saved_joints(scene: Assembled, items: Items) -> tuple[Items, Sizes]:
    system = scene.system
    gone = {k: name for name, members in scene.joints.items() for k in members}
    joints = dict.fromkeys(f"joints.{gone[k]}" for k in sorted(system.reduction.eliminated))
    counts = {"unknowns": system.n_x - system.n, "multipliers": system.unreduced.n_rows - system.n_rows}
    return tuple(joints), counts if joints else {}


def _saved_bodies(scene: Assembled, items: Items) -> tuple[Items, Sizes]:
    return items, {"coordinates": 3 * len(items), "joint equations": 3 * len(items)} if items else {}


def _saved_rates(scene: Assembled, items: Items) -> tuple[Items, Sizes]:
    return (items, {"maps of rates": 1}) if items and not scene.system.uses_rates else ((), {})


def _saved_parts(scene: Assembled, items: Items) -> tuple[Items, Sizes]:
    return items, {"common steps": 1} if items else {}


_RULES = (
    Rule(
        "weight",
        "body-force integrals",
        "gravity is zero",
        "their force is zero",
        _weight,
        _saved_weight,
    ),
    Rule(
        "springs",
        "springs and dampers",
        "stiffness and damping are zero",
        "their force and energy are zero",
        _springs,
        _each("terms of Q"),
    ),
    Rule(
        "loads",
        "forces and moments",
        "their size, or a constant law, is zero",
        "they do nothing",
        _loads,
        _each("terms of Q"),
    ),
    Rule(
        "damping",
        "Kelvin-Voigt damping of beams",
        "both retardation times of the material are zero",
        "its force is zero",
        _damping,
        _each("terms of Q"),
    ),
    Rule(
        "standing_drivers",
        "time in drivers",
        "the law is a constant angle, or the position zero",
        "the driver does no work and its equation is that of a joint",
        _standing_drivers,
        _each("driven equations"),
    ),
    Rule(
        "fixed_bodies",
        "rigid bodies that cannot move",
        "undriven fixed joints weld them to the ground, and no reaction of these joints is asked for",
        "their points are points of the ground",
        _fixed_bodies,
        _saved_bodies,
    ),
    Rule(
        "tree_joints",
        "multipliers and dependent coordinates of open chains",
        "a joint is linear in nodal coordinates (at nodes or centres of mass) and closes no loop",
        "what is left fulfils the joint for all values: a pinned or clamped root has no place of its own, a "
        "clamp keeps only the stretch of its slope",
        _tree_joints,
        _saved_joints,
    ),
    Rule(
        "constant_mass",
        "the factorisation of the mass matrix in every state",
        "no beam is of the model lowOrder: all mass matrices are constant in nodal coordinates",
        "one factorisation serves for all states",
        _constant_mass,
        _each("factorisations a state"),
    ),
    Rule(
        "rates",
        "rates of absolute coordinates in accelerations",
        "no force depends on rates and all joints that need multipliers are linear",
        "nothing would read them",
        _rates,
        _saved_rates,
    ),
    Rule(
        "work",
        "the integral of the power put in",
        "no damper, no load that acts and no driver that moves",
        "the power is zero",
        _work,
        _each("integrals over time"),
    ),
    Rule(
        "parts",
        "common steps of parts that nothing connects",
        f"no joint or spring connects them, save through the ground, the scene has {PARTS_FROM} coordinates "
        "or more, and the step is not fixed",
        "their motions do not depend on one another; each part takes steps of its own",
        _parts,
        _saved_parts,
    ),
    Rule(
        "turns",
        "counting of full turns along all steps",
        "no channel is measured in the body's frame",
        "nothing would read it",
        _turns,
        _each("passes over all steps"),
    ),
    Rule(
        "plots",
        "outlines of the bodies and pictures",
        "output.plots is false",
        "nothing would read them",
        _plots,
        _each("outlines"),
    ),
)
RULES: dict[str, Rule] = {rule.name: rule for rule in _RULES}
"""All rules by name, in the order they are told."""
