"""Which bushings say where bodies start: where these are without force, if nothing else says it."""

from __future__ import annotations

from hfsim.deck.fields import split_point
from hfsim.parts.specs import JointSpec
from hfsim.scene.rules import connect, owners, parts_of
from hfsim.scene.schema import Deck

_PLACES, _RATES = ("position", "angle", "orientation"), ("velocity", "angular_velocity")


def mounts(deck: Deck, rates: bool = False) -> dict[str, JointSpec]:
    """Return the joints of bushings that hold bodies at the start, or have them move along, by deck path.

    They hold what joints do not connect with the ground and of which no place or turn is stated, or no rate.
    """
    every = {name: mount for name, spring in deck.springs.items() if (mount := spring.mount) is not None}
    found: dict[str, JointSpec] = {}
    if not every:
        return found
    part = parts_of(("ground", *deck.bodies), (owners(one) for one in deck.joints.values() if one.holds))
    keys = _RATES if rates else _PLACES
    known = {k for k, one in deck.motions.items() if any(getattr(one, key) is not None for key in keys)}

    def joins(mount: JointSpec, of_known: int) -> bool:
        a, b = (part[split_point(end)[0]] for end in mount.between)
        return a is not b and sum(not one.isdisjoint({"ground", *known}) for one in (a, b)) == of_known

    # those between bodies of which neither is known come last
    while name := next((k for count in (1, 0) for k, one in every.items() if joins(one, count)), ""):
        found[f"springs.{name}"] = every[name]
        connect(part, owners(every[name]))
    return found
