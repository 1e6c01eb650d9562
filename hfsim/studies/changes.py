"""What the named axes of studies change in a deck: stiffness, speed, amplitude, slenderness, mesh, step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, TypeAlias

from hfsim.deck.overrides import unit_of
from hfsim.deck.section_stiffness import dimension_of
from hfsim.deck.spec import Spec
from hfsim.deck.units import SI_UNITS
from hfsim.parts.bodies.beam import BeamSpec
from hfsim.scene.schema import Deck

Changes: TypeAlias = Callable[[Deck, float], Iterator[tuple[str, object]]]
"""(deck, value) -> entries of the deck and what each becomes."""


def _at(entry: Any, key: str) -> Any:
    """Return what an entry of a deck has at a dotted key; None where it has no such field."""
    for step in key.split("."):
        fields = entry.fields_by_key() if isinstance(entry, Spec) else {}
        entry = getattr(entry, fields[step], None) if step in fields else None
    return entry


def _times(factor: float, value: Any) -> Any:
    """Return numbers, or lists of them, times a factor."""
    return [_times(factor, one) for one in value] if isinstance(value, tuple) else factor * value


def _changes_something(value: Any) -> bool:
    """Tell whether a factor changes numbers, or lists of them: there are some, and not all are zero."""
    if isinstance(value, tuple):
        return any(map(_changes_something, value))
    return value is not None and value != 0.0


def _scaled(**fields: tuple[str, ...]) -> Changes:
    """Return changes that multiply those of the given keys, by part of the deck, which entries have."""

    def changes(deck: Deck, factor: float) -> Iterator[tuple[str, object]]:
        for part, keys in fields.items():
            for (name, entry), key in product(getattr(deck, part).items(), keys):
                if _changes_something(value := _at(entry, key)):
                    yield f"{part}.{name}.{key}", _times(factor, value)

    return changes


def _together(*some: Changes) -> Changes:
    def changes(deck: Deck, value: float) -> Iterator[tuple[str, object]]:
        for one in some:
            yield from one(deck, value)

    return changes


# --- stiffness ------------------------------------------------------------------------------------

_HELD_BY = ("stops.stiffness", "latch.stiffness")
"""What holds a joint or spring beyond a place, or at one."""


def _tables(deck: Deck, factor: float) -> Iterator[tuple[str, object]]:
    """Multiply the forces of springs that have a table."""
    for name, spring in deck.springs.items():
        if rows := _at(spring, "table"):
            yield f"springs.{name}.table", [[place, factor * force] for place, force in rows]


_stiffness = _together(
    _scaled(
        materials=("youngs_modulus",),
        sections=("stiffness", *(f"{of}_stiffness" for of in ("axial", "shear", "torsion", "bending"))),
        springs=("stiffness", "rotational_stiffness", *_HELD_BY),
        joints=(*_HELD_BY, *(f"{how}.{what}" for how in ("turning", "sliding") for what in _HELD_BY)),
    ),
    _tables,
)

# --- motion ---------------------------------------------------------------------------------------

_LAWS = ("angle", "position", "x", "y", "z", "turn")
"""Fields of joints that may be laws of time of where something is."""

_speed = _scaled(
    initial=("angular_velocity", "velocity", "distance_rate"), joints=tuple(f"{law}.rate" for law in _LAWS)
)


def _driven(deck: Deck, factor: float) -> Iterator[tuple[str, object]]:
    """Let joints move so much farther from where their laws begin; sines from their mean."""
    for (name, joint), key in product(deck.joints.items(), _LAWS):
        law, path = _at(joint, key), f"joints.{name}.{key}"
        kind = getattr(law, "type", "")
        if kind == "sine":
            yield f"{path}.amplitude", factor * law.amplitude
        elif kind == "smooth_step":
            yield f"{path}.to", _farther(law.from_, law.to, factor)
        elif kind == "table":
            values = [_farther(law.values[0], value, factor) for value in law.values]
            kept = {one: getattr(law, one) for one in ("interpolation", "periodic", "start")}
            told = {one: value for one, value in kept.items() if one in law.model_fields_set}
            yield path, {"type": "table", "times": list(law.times), "values": values, **told}
        elif kind == "expression":
            yield f"{path}.expression", f"{factor!r} * ({law.expression})"


def _farther(begin: float, value: float, factor: float) -> float:
    return begin + factor * (value - begin)


_amplitude = _together(
    _scaled(
        initial=("angle", "orientation.angle", "orientation.rotation_vector", "distance"),
        loads=("force", "moment"),
        joints=("torque", "force"),
    ),
    _driven,
)

# --- shape, mesh and step -------------------------------------------------------------------------

_POWERS = {"m": 1, "m^2": 2, "m^4": 4, "kg/m": 2, "kg m": 4, "N": 2, "N m": 3, "N m^2": 4}
"""Powers of its size with which numbers of a section grow by their units, the material being the same."""


def _slenderness(deck: Deck, ratio: float) -> Iterator[tuple[str, object]]:
    """Give each beam sections of its own, alike in shape, the root's as high as its length over `ratio`."""
    for name, body in deck.bodies.items():
        if not isinstance(body, BeamSpec):
            continue
        length = body.length or (body.axis.length if body.axis else 0.0)
        factor = length / ratio / _height(deck.sections[body.made_of[0][-1]])
        for path, _, _, section in body.made_of:
            own = f"{section}_of_{name}"
            yield f"sections.{own}", _resized(deck.sections[section], factor)
            yield ".".join(map(str, ("bodies", name, *path, "section"))), own


def _height(section: Any) -> float:
    """Return how high a section is; without a shape, the equivalent rectangle [m]."""
    radius: float | None = getattr(section, "outer_radius", None)
    return float(section.height) if radius is None else 2.0 * radius


def _resized(section: Any, factor: float) -> dict[str, object]:
    """Return a section with all its lengths times a factor, as a deck states it."""

    def grown(value: Any, unit: str) -> Any:
        return _times(factor ** _POWERS[unit], value) if unit in _POWERS else value

    made: dict[str, object] = {}
    for key in sorted(section.model_fields_set):
        value = getattr(section, key)
        if key == "stiffness":
            count = len(value)
            made[key] = [
                [grown(one, SI_UNITS[dimension_of(count, i, j)]) for j, one in enumerate(row)]
                for i, row in enumerate(value)
            ]
        else:
            made[key] = grown(value, unit_of({"": section}, ("", key)))
    return made


def _step(deck: Deck, step: float) -> Iterator[tuple[str, object]]:
    yield "solve.step", step


def _elements(deck: Deck, count: float) -> Iterator[tuple[str, object]]:
    for name, body in deck.bodies.items():
        if isinstance(body, BeamSpec):
            yield f"bodies.{name}.elements", int(count) if float(count).is_integer() else count


CHANGES: dict[str, Changes] = {
    "stiffness": _stiffness,
    "speed": _speed,
    "amplitude": _amplitude,
    "slenderness": _slenderness,
    "step": _step,
    "elements": _elements,
}
"""By the name of the axis: factors on stiffness, on speeds, on loads and how far all moves; length over
section height of all beams; fixed step [s]; elements of all beams."""
