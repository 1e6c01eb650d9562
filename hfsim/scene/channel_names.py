"""Which channels a deck may ask for."""

from collections.abc import Iterator, Sequence

from hfsim.deck.fields import split_point
from hfsim.deck.source import Path, did_you_mean
from hfsim.deck.spec import Complaint, shown
from hfsim.scene.declared import Declared

_ENERGIES = ("kinetic", "strain", "potential", "total")
_RESIDUALS = ("position", "velocity")
_POINT_QUANTITIES = ("x", "y", "vx", "vy", "speed")
_BEAM_QUANTITIES = ("deflection", "elongation")
_BODY_QUANTITIES = ("angle", "angular_velocity")
_REACTIONS = ("force_x", "force_y", "moment")


class ChannelNames:
    """The check of ``output.channels``.

    Attributes
    ----------
    declared : Declared
        Names of bodies, points and joints.
    dimension : int
        Of space; 0 where it could not be read.
    """

    def __init__(self, declared: Declared, dimension: int) -> None:
        self.declared, self.dimension = declared, dimension

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
            yield from self._channel_complaint(path, channel)

    def _channel_complaint(self, path: Path, channel: str) -> Iterator[Complaint]:
        owner, _, rest = channel.partition(".")
        fixed = {"energy": _ENERGIES, "constraint": _RESIDUALS}.get(owner)
        joints, bodies = self.declared.names("joints"), self.declared.names("bodies")
        if fixed is None and owner in (joints or ()) and owner not in (bodies or ()):
            fixed = _REACTIONS
        if fixed is not None:
            if rest not in fixed:
                yield _unknown_quantity(path, owner, rest, fixed)
        elif owner == "ground":
            yield Complaint(path, "the ground does not move", "name a point of a body")
        elif self.declared.points is not None and joints is not None and owner not in self.declared.points:
            known = [*self.declared.points, *joints, "energy", "constraint"]
            known.remove("ground")
            yield Complaint(path, f"there is no body or joint '{owner}'", did_you_mean(owner, known))
        elif self.declared.points is not None and joints is not None:
            yield from self._motion_complaint(path, channel)

    def _motion_complaint(self, path: Path, channel: str) -> Iterator[Complaint]:
        """Yield what is wrong with a channel of a body or of one of its points."""
        point, _, quantity = channel.rpartition(".")
        owner, name = split_point(point or channel)
        if not point:
            quantity = ""
        body = self.declared.maps("bodies").get(owner, {})
        beam, points = body.get("type") == "beam", self.declared.points
        if quantity in _BODY_QUANTITIES and name:
            yield Complaint(path, f"{quantity} belongs to a body, not to a point", f"'{owner}.{quantity}'")
        elif quantity == "z" and self.dimension != 3:
            yield Complaint(path, "a planar scene has no z", f"'{point}.x' or '{point}.y'")
        elif quantity in _BEAM_QUANTITIES and not beam and points and points[owner] is not None:
            yield Complaint(path, f"only a beam has {quantity}, '{owner}' is {shown(body.get('type'))}")
        elif quantity in (*_POINT_QUANTITIES, *_BEAM_QUANTITIES, *_BODY_QUANTITIES, "z"):
            yield from self.declared.point_complaint(path, point)
        else:
            known = (
                _POINT_QUANTITIES + (_BEAM_QUANTITIES if beam else ()) + (() if name else _BODY_QUANTITIES)
            )
            yield _unknown_quantity(path, point or channel, quantity, known)


def _unknown_quantity(path: Path, owner: str, quantity: str, known: Sequence[str]) -> Complaint:
    hint = did_you_mean(quantity, known)
    if not quantity:
        return Complaint(path, f"'{owner}' is not a channel, a quantity is missing", hint)
    return Complaint(path, f"'{owner}' has no quantity '{quantity}'", hint)
