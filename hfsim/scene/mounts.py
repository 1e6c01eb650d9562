"""Which bushings say where bodies start: where these are without force, if nothing else says it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from hfsim.deck.fields import split_point
from hfsim.parts.specs import JointSpec
from hfsim.scene.rules import connect, owners, parts_of
from hfsim.scene.schema import Deck

_PLACES, _RATES = ("position", "angle", "orientation"), ("velocity", "angular_velocity")


def mounts(deck: Deck, rates: bool = False) -> dict[str, JointSpec]:
    """Return the joints of bushings that hold bodies at the start, or have them move along, by deck path.

    They hold what joints do not connect with the ground and of which no place or turn is stated, or no rate;
    and the place alone of what has none but by joints of turns, such as drivers of angles.
    """
    every = {name: mount for name, spring in deck.springs.items() if (mount := spring.mount) is not None}
    if not every:
        return {}
    joints = [one for one in deck.joints.values() if one.holds]
    whole = _holding(every, deck, joints, _RATES if rates else _PLACES)
    found = {f"springs.{name}": every[name] for name in whole}
    if not rates:
        held = [*(one for one in joints if one.carries), *(every[name] for name in whole)]
        for name in _holding(every, deck, held, _PLACES[:1]):
            found[f"springs.{name}"] = every[name].model_copy(update={"faces": False})
    return found


def _holding(
    every: Mapping[str, JointSpec], deck: Deck, joints: Iterable[JointSpec], keys: Sequence[str]
) -> list[str]:
    """Return the mounts that hold what some joints do not connect with the ground or with what is stated."""
    part, found = parts_of(("ground", *deck.bodies), map(owners, joints)), list[str]()
    known = {k for k, one in deck.motions.items() if any(getattr(one, key) is not None for key in keys)}

    def joins(mount: JointSpec, of_known: int) -> bool:
        a, b = (part[split_point(end)[0]] for end in mount.between)
        return a is not b and sum(not one.isdisjoint({"ground", *known}) for one in (a, b)) == of_known

    # those between bodies of which neither is known come last
    while name := next((k for count in (1, 0) for k, one in every.items() if joins(one, count)), ""):
        found.append(name)
        connect(part, owners(every[name]))
    return found
