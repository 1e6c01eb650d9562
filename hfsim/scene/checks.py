"""The checks of a deck that concern more than one entry.

Names are looked up in the plain data and everything else in the entries that could be read.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import split_point
from hfsim.deck.reader import Path
from hfsim.deck.source import did_you_mean, entry_at
from hfsim.deck.spec import Around, at
from hfsim.parts.channels import scene_words
from hfsim.parts.forces import SPRINGS
from hfsim.parts.joints import JOINTS
from hfsim.scene.channel_names import ChannelNames, measured
from hfsim.scene.declared import Declared
from hfsim.scene.initial import AT_REST, STEADY, InitialSpec
from hfsim.scene.posed import COORDINATES, left_free
from hfsim.scene.rules import RULES
from hfsim.scene.schema import space_of, specs_in


def complaints_of(data: dict[str, Any], entries: dict[str, Any]) -> Iterator[Complaint]:
    """Yield everything that is wrong between entries.

    Parameters
    ----------
    data : dict
        Plain data of the deck.
    entries : dict
        Of each top-level key what could be read.
    """
    declared, (n_dim, where) = Declared(data), space_said(data, entries)
    for check in (_names, _references, _connections, _initial_names, _rules):
        yield from check(declared)
    yield from ChannelNames(declared, n_dim).complaints()
    why = _space_said_by(data, where) if where else ""
    if n_dim == 3 and "gravity" in data and len(entries.get("gravity") or ()) == 2:
        yield Complaint(("gravity",), f"must be a list of 3 numbers: this scene is spatial: {why}")
    around = _around(entries, n_dim, why)
    for path, entry in specs_in(entries):
        yield from (one.inside(*path) for one in entry.complaints_in(around))


def space_said(data: Mapping[str, Any], entries: Mapping[str, Any]) -> tuple[int, Path]:
    """Return how many dimensions a deck has, and what says so; the default of gravity says nothing."""
    return space_of(entries if "gravity" in data else {**entries, "gravity": ()})


def _space_said_by(data: dict[str, Any], path: Path) -> str:
    value, name = entry_at(data, path), ".".join(map(str, path))
    if isinstance(value, list):
        return f"{name} has three"
    if isinstance(value, dict) and "type" in value:
        return f"{name} is {value['type']}, which only space has"
    return f"only space has {name}"


def slips_of(data: dict[str, Any], entries: dict[str, Any]) -> Iterator[Complaint]:
    """Yield what looks like slips of units in a deck that can be run; see `complaints_of`."""
    around = _around(entries, len(entries["gravity"]))
    found = [one.inside(*path) for path, entry in specs_in(entries) for one in entry.slips_in(around)]
    for slip in (*_gravity_slips(entries["gravity"]), *found):
        alone = isinstance(entry_at(data, slip.path[:-1]), str | int | float)  # one stands for a whole law
        path = slip.path[: -1 if alone else None]
        units = entry_at(data, path), entry_at(data, (*path[:-2], "unit"))
        if not any(isinstance(one, str) for one in units):
            yield slip._replace(path=path)


def laws_until(entries: dict[str, Any], t: float) -> Iterator[Complaint]:
    """Yield the laws of time in a deck that can be run that have no value somewhere until a time [s]."""
    around = _around(entries, len(entries["gravity"]))._replace(duration=t)
    for path, entry in specs_in({**entries, "output": None}):  # nothing is written until then
        yield from (one.inside(*path) for one in entry.complaints_in(around))


def _gravity_slips(gravity: tuple[float, ...]) -> Iterator[Complaint]:
    up, path = gravity[-1], ("gravity", len(gravity) - 1)
    if 9.0 < up < 11.0:
        yield Complaint(path, f"gravity of {up:g} m/s^2 points up", f"{-up:g}?")
    elif 9e3 < abs(up) < 11e3:
        yield Complaint(path, f"{up:g} m/s^2 is a thousand times the Earth's", f"'{up:g} mm/s2'?")


def _around(entries: dict[str, Any], n_dim: int, why: str = "") -> Around:
    solve, output = entries["solve"], entries["output"]
    return Around(
        n_dim=n_dim,
        why=why,
        duration=getattr(solve, "duration", None),
        model=getattr(solve, "model", None),
        elastic_form=getattr(solve, "elastic_form", None),
        sections=entries["sections"],
        channels=getattr(output, "channels", None),
    )


def _names(declared: Declared) -> Iterator[Complaint]:
    bodies = declared.names("bodies")
    if bodies is not None and not bodies and "bodies" in declared.data:
        yield Complaint(("bodies",), "a scene needs at least one body", "", True)
    taken = ("t", *scene_words())
    for key in ("bodies", "joints"):
        for name in declared.names(key) or ():
            if name in taken:
                message = f"'{name}' is taken by the output's columns"
                yield Complaint((key, name), message, "choose another name", True)
    for name in declared.names("joints") or ():
        if name in (bodies or ()):
            message = f"a body is called '{name}' too, so channels could not tell them apart"
            yield Complaint(("joints", name), message, "choose another name", True)


def _references(declared: Declared) -> Iterator[Complaint]:
    for name, body in declared.maps("bodies").items():
        yield from (one.inside("bodies", name) for one in _made_of(declared, body))
        stations = body.get("stations")
        for index, station in enumerate(stations if isinstance(stations, list) else ()):
            if isinstance(station, dict):
                found = _made_of(declared, station)
                yield from (one.inside("bodies", name, "stations", index) for one in found)


def _made_of(declared: Declared, entry: dict[str, Any]) -> Iterator[Complaint]:
    """Yield materials and sections that there are not."""
    for key, kind in (("material", "materials"), ("section", "sections")):
        wanted, known = entry.get(key), declared.names(kind)
        if isinstance(wanted, str) and known is not None and wanted not in known:
            hint = did_you_mean(wanted, known) or f"declare it under {kind}"
            yield Complaint((key,), f"there is no {key} '{wanted}'", hint)


def _connections(declared: Declared) -> Iterator[Complaint]:
    for kind in ("joints", "springs"):
        for name, entry in declared.maps(kind).items():
            yield from _ends(declared, (kind, name, "between"), entry.get("between"))
            yield from _geared(declared, (kind, name), entry) if entry.get("type") == "gear" else ()
            yield from _coupled(declared, (kind, name, "of"), entry.get("of"))
    for name, load in declared.maps("loads").items():
        yield from _beam_under(declared, name, load.get("on"))
        point, path = load.get("at"), ("loads", name, "at")
        if isinstance(point, str) and split_point(point)[0] == "ground":
            yield Complaint(path, "a load on the ground moves nothing", "name a point of a body")
        elif isinstance(point, str):
            yield from declared.point_complaint(path, point)


def _geared(declared: Declared, path: Path, entry: dict[str, Any]) -> Iterator[Complaint]:
    """Yield what a gear cannot be on: its own carrier, and bodies whose turns are not counted."""
    carrier, ends = entry.get("carrier", "ground"), entry.get("between")
    if not isinstance(ends, list) or [type(one) for one in (carrier, *ends)] != [str] * 3:
        return
    yield from declared.point_complaint((*path, "carrier"), carrier)
    owner, known = split_point(carrier)[0], declared.maps("bodies")
    places: tuple[Path, ...] = (("between", 0), ("between", 1), ("carrier",))
    for place, end in zip(places, (*ends, carrier), strict=True):
        name = split_point(end)[0]
        if known.get(name, {}).get("type", "rigid") != "rigid":
            why = f"'{name}' is no rigid body: its turns are not counted"
            yield Complaint((*path, *place), why, "fix a rigid body to it, and name that")
        elif place != ("carrier",) and name == owner:
            why = f"'{name}' is the carrier itself"
            yield Complaint((*path, *place), why, "name that on which both turn")


def _coupled(declared: Declared, path: Path, of: Any) -> Iterator[Complaint]:
    """Yield what a coupling names that is no joint or spring, has no coordinate, or several."""
    if not isinstance(of, dict) or None in (declared.names("joints"), declared.names("springs")):
        return
    kinds = {name: (entry, JOINTS) for name, entry in declared.maps("joints").items()}
    every = {name: (entry, SPRINGS) for name, entry in declared.maps("springs").items()} | kinds
    for key in of:
        name, _, coordinate = str(key).partition(".")
        if name not in every:
            own = (one for one, (entry, _) in every.items() if entry.get("type") != "coupling")
            others = [one for one in own if measured(*every[one])]
            yield Complaint((*path, key), f"there is no joint or spring '{name}'", did_you_mean(name, others))
            continue
        units = measured(*every[name])
        known = ("turning", "sliding") if len(units) > 1 else ()
        if not units or every[name][0].get("type") == "coupling":
            yield Complaint((*path, key), f"'{name}' has no angle or distance of its own")
        elif known and coordinate not in known:
            both = " or ".join(f"'{name}.{one}'" for one in known)
            yield Complaint((*path, key), f"'{name}' has two coordinates", both)
        elif coordinate and not known:
            yield Complaint((*path, key), f"'{name}' has one coordinate", f"'{name}'")


def _beam_under(declared: Declared, load: str, beam: Any) -> Iterator[Complaint]:
    """Yield a load along what is no beam."""
    bodies, path = declared.names("bodies"), ("loads", load, "on")
    if not isinstance(beam, str) or not bodies:
        return
    if beam not in bodies:
        yield Complaint(path, f"there is no body '{beam}'", did_you_mean(beam, bodies))
    elif declared.map("bodies", beam).get("type", "beam") != "beam":
        yield Complaint(path, f"'{beam}' has no length along which a load could act", "name a beam")


def _ends(declared: Declared, path: Path, ends: Any) -> Iterator[Complaint]:
    if not isinstance(ends, list) or len(ends) != 2 or not all(isinstance(end, str) for end in ends):
        return
    check = declared.point_complaint
    found = [one for index, end in enumerate(ends) for one in check((*path, index), end)]
    yield from found
    first, second = (split_point(end)[0] for end in ends)
    if first == second and not found:
        yield Complaint(path, f"connects '{first}' with itself", "name points of two different bodies")


def _initial_names(declared: Declared) -> Iterator[Complaint]:
    bodies = declared.names("bodies")
    entries = declared.data.get("initial")
    for name in declared.names("initial") or ():
        entry = entries.get(name) if isinstance(entries, dict) else None
        if name == AT_REST and name not in (bodies or ()):
            yield from _resting(entry, bodies or ())
        elif name == STEADY and name not in (bodies or ()):
            body = entry.get("body") if isinstance(entry, dict) else None
            if not isinstance(body, str):
                yield Complaint(("initial", name), "needs a body and its rate", "{body: hub, rate: 6.0}")
            elif bodies and body not in bodies:
                path = ("initial", name, "body")
                yield Complaint(path, f"there is no body '{body}'", did_you_mean(body, bodies))
            yield from _overruled(entries, str(body), bodies or ())
        elif bodies and name in (declared.names("joints") or ()):
            yield from _of_joint(declared.map("joints", name).get("type"), entry, ("initial", name))
        elif bodies and name not in bodies and name != "ground":
            hint = did_you_mean(name, [*bodies, *(declared.names("joints") or ())])
            yield Complaint(("initial", name), f"there is no body or joint '{name}'", hint, True)
        elif isinstance(entry, bool | list) or (isinstance(entry, dict) and _OF_ALL & entry.keys()):
            why = "must be a map of what is stated of a body"
            yield Complaint(("initial", name), why, f"{AT_REST}: [{name}]?")
        elif isinstance(entry, dict):
            for key in (key for key in COORDINATES["m"] if key in entry):
                yield Complaint(("initial", name, key), "is of joints, not of bodies", "position?", True)


_OF_ALL = {"bodies", "body"}
"""What tells an entry of no single body."""


def _of_joint(kind: Any, entry: Any, path: Path) -> Iterator[Complaint]:
    """Yield what is stated of a joint and is not of what it leaves free."""
    spec = JOINTS.get(str(kind))
    known = [key for unit in left_free(at(spec) if spec else None) for key in COORDINATES[unit]]
    if spec and not known:
        why = f"a {kind} joint leaves no angle or distance free that could be stated"
        yield Complaint(path, why, "state those of bodies", True)
    elif not isinstance(entry, dict):
        yield Complaint(path, "must be a map of what is stated of a joint", f"{{{known[0]}: ...}}")
    elif spec:
        hint = f"it has {' and '.join(known)}"
        for key in (key for key in InitialSpec.model_fields if key in entry and key not in known):
            yield Complaint((*path, key), f"a {kind} joint has no {key}", hint, True)
        if isinstance(entry.get("angular_velocity"), list):
            yield Complaint((*path, "angular_velocity"), "must be a number: it is about the joint's axis")


def _overruled(entries: Any, body: str, bodies: Collection[str]) -> Iterator[Complaint]:
    """Yield what is stated of the start beside a steady rotation, which decides it."""
    if entries.get(AT_REST) and AT_REST not in bodies:
        why = "a scene starts in steady rotation or from where it rests"
        yield Complaint(("initial", AT_REST), why, f"leave out this or {STEADY}", True)
    own = entries.get(body)
    if body in bodies and isinstance(own, dict) and own.get("angular_velocity") is not None:
        why = f"is that of the steady rotation: initial.{STEADY} says it"
        yield Complaint(("initial", body, "angular_velocity"), why, "leave it out", True)


def _resting(entry: Any, bodies: Collection[str]) -> Iterator[Complaint]:
    """Yield what cannot start in equilibrium."""
    path: Path = ("initial", AT_REST)
    if isinstance(entry, dict):
        if "bodies" not in entry:
            yield Complaint(path, "needs the bodies that rest", "true, or a list of their names", True)
        path, entry = (*path, "bodies"), entry.get("bodies")
    for index, name in enumerate(entry if isinstance(entry, list) else ()):
        if isinstance(name, str) and bodies and name not in bodies:
            yield Complaint((*path, index), f"there is no body '{name}'", did_you_mean(name, bodies))


def _rules(declared: Declared) -> Iterator[Complaint]:
    solve = declared.data.get("solve")
    kept = solve.get("keep") if isinstance(solve, dict) else None
    for index, rule in enumerate(kept if isinstance(kept, list) else ()):
        if isinstance(rule, str) and rule not in RULES:
            hint = did_you_mean(rule, RULES)
            yield Complaint(("solve", "keep", index), f"there is no rule '{rule}'", hint)
