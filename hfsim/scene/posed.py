"""Angles and distances of joints that a deck states of the start: they hold there as those of drivers do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from hfsim.mechanics.constraints import RelativeAngle
from hfsim.parts.specs import JointSpec
from hfsim.scene.initial import InitialSpec
from hfsim.scene.schema import Deck

if TYPE_CHECKING:
    from hfsim.scene.closing import Linkage
    from hfsim.scene.stated import Start

COORDINATES = {"rad": ("angle", "angular_velocity"), "m": ("distance", "distance_rate")}
"""What is stated of what joints leave free, and of its rate, by its unit: as channels have it."""


def left_free(joint: type[JointSpec] | JointSpec | None) -> tuple[str, ...]:
    """Return the units of what a joint leaves free, not of what it drives or acts on."""
    return tuple(unit for unit, key in joint.measures if not key) if joint else ()


def stated_of_joints(deck: Deck, rates: bool = False) -> Iterator[tuple[str, str, str, float]]:
    """Yield joints, units, keys and values of what is stated at the start, or of its rates."""
    for name, entry in deck.initial.items():
        for unit in left_free(deck.joints.get(name)) if isinstance(entry, InitialSpec) else ():
            key = COORDINATES[unit][rates]
            if (value := getattr(entry, key)) is not None:
                yield name, unit, key, value


def posed(deck: Deck, rates: bool = False) -> dict[str, JointSpec]:
    """Return drivers of this, and the joints of bushings that hold bodies at the start, by deck path."""
    drivers = {
        f"initial.{name}.{key}": _driver(deck.joints[name], unit, value, rates)
        for name, unit, key, value in stated_of_joints(deck, rates)
    }
    if not deck.springs:
        return drivers
    from hfsim.scene.mounts import mounts

    return {**drivers, **mounts(deck, rates)}


def started(deck: Deck) -> dict[str, JointSpec]:
    """Return the joints of a deck, and those for what is stated of some at the start."""
    return {**deck.joints, **posed(deck)}


def posing(start: Start, deck: Deck, linkage: Callable[[Deck], Linkage], rates: bool) -> Start:
    """Return a start whose linkage holds what is stated of joints, or of its rates, too."""
    drivers = posed(deck, rates)
    if not drivers:
        return start
    link = linkage(deck.model_copy(update={"joints": {**deck.joints, **drivers}}))
    geared, rows = any(row.against for row in link.constraints), list(link.constraints)
    for k, row in enumerate(rows):
        if (path := row.item.removeprefix("joints.")) in drivers:
            own = replace(row, item=path)
            rows[k] = replace(own, counted=True) if geared and isinstance(own, RelativeAngle) else own
    return replace(start, linkage=replace(link, constraints=tuple(rows)))


def _driver(joint: JointSpec, unit: str, value: float, rates: bool) -> JointSpec:
    from hfsim.deck.law_specs import ConstantRateSpec
    from hfsim.parts.joints.driver import DriverSpec, PacerSpec

    start, rate = (0.0, value) if rates else (value, 0.0)
    law = ConstantRateSpec(type="constant_rate", start=start, rate=rate)
    angle, position = (law, None) if unit == "rad" else (None, law)
    axis, kind = getattr(joint, "axis", None), PacerSpec if rates else DriverSpec
    zero = getattr(joint, "orientation", None) if unit == "rad" else None
    return kind(
        type="driver", between=joint.between, axis=axis, angle=angle, position=position, orientation=zero
    )
