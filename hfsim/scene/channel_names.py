"""Which channels a deck may ask for."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from hfsim.deck.complaints import Complaint, shown
from hfsim.deck.fields import split_point
from hfsim.deck.reader import Path
from hfsim.deck.source import did_you_mean
from hfsim.deck.spec import at
from hfsim.parts.channels import CHANNELS, OWNERS, ChannelKind, scene_words
from hfsim.parts.forces import SPRINGS
from hfsim.parts.joints import JOINTS
from hfsim.scene.declared import Declared


class ChannelNames:
    """The check of ``output.channels``, and of channels elsewhere in a deck.

    Attributes
    ----------
    declared : Declared
        Names of bodies, points and joints.
    dimension : int
        Of space; 0 where it could not be read.
    """

    def __init__(self, declared: Declared, dimension: int) -> None:
        self.declared, self.dimension = declared, dimension
        self._of_scene = scene_words()

    def complaints(self) -> Iterator[Complaint]:
        """Yield everything that is wrong."""
        output = self.declared.data.get("output")
        channels = output.get("channels") if isinstance(output, dict) else None
        seen: set[str] = set()
        for index, channel in enumerate(channels if isinstance(channels, list) else ()):
            path: Path = ("output", "channels", index)
            if not isinstance(channel, str):
                continue
            if channel in seen:
                yield Complaint(path, f"'{channel}' is listed twice", "remove one of the two")
            seen.add(channel)
            yield from self.channel_complaint(path, channel)

    def channel_complaint(self, path: Path, channel: str) -> Iterator[Complaint]:
        """Yield what is wrong with a channel that stands at a path."""
        owner, _, rest = channel.partition(".")
        points, known = self.declared.points, self._known_of(owner)
        others = {key: self.declared.names(key) for key in ("joints", "springs")}
        if known is not None:
            if rest not in known:
                yield _unknown_quantity(path, owner, rest, known)
            elif CHANNELS[rest][-1].subject == "tie" and all(owner in (one or ()) for one in others.values()):
                hint = "choose another name for one of them"
                yield Complaint(path, f"a joint and a spring are called '{owner}'", hint)
        elif owner == "ground":
            yield Complaint(path, "the ground does not move", "name a point of a body")
        elif points is None or None in others.values():
            return
        elif owner not in points:
            owners = [*points, *(name for names in others.values() for name in names or ()), *self._of_scene]
            hint = did_you_mean(owner, [name for name in owners if name != "ground"])
            yield Complaint(path, f"there is no body, joint or spring '{owner}'", hint)
        else:
            yield from self._motion_complaint(path, channel)

    def _known_of(self, owner: str) -> list[str] | None:
        """Return the quantities of a joint, of a spring or of the scene; None where it is none of these."""
        if owner in self._of_scene:
            return self._known(lambda kind: kind.subject == owner)
        if owner in (self.declared.names("bodies") or ()):
            return None
        for key, kinds in (("joint", JOINTS), ("spring", SPRINGS)):
            if owner in (self.declared.names(f"{key}s") or ()):
                entry = self.declared.map(f"{key}s", owner)
                units, reacts = (*measured(entry, kinds), ""), key == "joint" or _reacts(entry)
                subjects = [one for one in OWNERS[key] if one != "joint" or reacts]
                return self._known(lambda one: one.subject in subjects and one.measured in units)  # noqa: B023
        return None

    def _known(self, fits: Callable[[ChannelKind], bool]) -> list[str]:
        """Return the quantities that space has, of those kinds that fit."""
        space = self.dimension or 2
        fitting = ((name, filter(fits, kinds)) for name, kinds in CHANNELS.items())
        return [name for name, kinds in fitting if any(space in kind.dimensions for kind in kinds)]

    def _motion_complaint(self, path: Path, channel: str) -> Iterator[Complaint]:
        """Yield what is wrong with a channel of a body or of one of its points."""
        point, _, quantity = channel.rpartition(".")
        owner, name = split_point(point or channel)
        body = self.declared.map("bodies", owner)
        beam, points = body.get("type") == "beam", self.declared.points
        kinds = (kind for kind in CHANNELS.get(quantity, ()) if point and kind.subject in OWNERS["body"])
        kind = next(kinds, None)
        if kind is None:
            of = ("point",) if name else ("point", "body")
            known = self._known(lambda one: one.subject in of and (beam or not one.only_beams))
            yield _unknown_quantity(path, point or channel, quantity if point else "", known)
        elif kind.subject == "body" and name:
            yield Complaint(path, f"{quantity} belongs to a body, not to a point", f"'{owner}.{quantity}'")
        elif (self.dimension or 2) not in kind.dimensions:
            others = self._known(lambda one: (one.subject, one.plot) == (kind.subject, kind.plot))
            others = others or self._known(lambda one: (one.subject, one.unit) == (kind.subject, kind.unit))
            hint = " or ".join(f"'{point}.{other}'" for other in others)
            space = "spatial" if self.dimension == 3 else "planar"
            yield Complaint(path, f"a {space} scene has no {quantity}", hint)
        elif kind.only_beams and not beam and points and points[owner] is not None:
            yield Complaint(path, f"only a beam has {quantity}, '{owner}' is {shown(body.get('type'))}")
        elif kind.of_sections and body.get("element") == "cable":
            yield Complaint(path, f"a cable element has no {quantity}", "take element: cosserat")
        elif kind.of_shape and any("area" in one for one in self._sections(body)):
            message = f"the section of '{owner}' has no shape from which a {quantity} follows"
            yield Complaint(path, message, "take shape: rectangle, circle or tube")
        else:
            yield from self.declared.point_complaint(path, point)

    def _sections(self, body: dict[str, Any]) -> list[dict[str, Any]]:
        """Return the sections of a beam."""
        stations = body.get("stations")
        named = [one for one in stations if isinstance(one, dict)] if isinstance(stations, list) else [body]
        return [self.declared.map("sections", str(one.get("section"))) for one in named]


def no_channel(path: Path, channel: str) -> Iterator[Complaint]:
    """Yield that a name is that of a channel in no deck at all."""
    owner, _, quantity = channel.rpartition(".")
    if not owner or quantity not in CHANNELS:
        yield _unknown_quantity(path, owner or channel, quantity if owner else "", [*CHANNELS])


def measured(entry: Mapping[str, Any], kinds: Mapping[str, str]) -> tuple[str, ...]:
    """Return the units of what a joint or a spring measures."""
    spec = _spec(entry, kinds)
    return tuple(unit for unit, key in (spec.measures if spec else ()) if not key or key in entry)


def _reacts(spring: Mapping[str, Any]) -> bool:
    """Return whether a spring has the channels of a joint."""
    spec = _spec(spring, SPRINGS)
    return spec is not None and bool(spec.reacts)


def _spec(entry: Mapping[str, Any], kinds: Mapping[str, str]) -> Any:
    spec = kinds.get(str(entry.get("type")))
    return at(spec) if isinstance(spec, str) else spec


def _unknown_quantity(path: Path, owner: str, quantity: str, known: Sequence[str]) -> Complaint:
    hint = did_you_mean(quantity, known)
    if not quantity:
        return Complaint(path, f"'{owner}' is not a channel, a quantity is missing", hint)
    return Complaint(path, f"'{owner}' has no quantity '{quantity}'", hint)
