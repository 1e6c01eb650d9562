"""Points as decks name them."""

from collections.abc import Mapping

from hfsim.deck.fields import split_point
from hfsim.mechanics.body import Body
from hfsim.mechanics.markers import GroundMarker, Marker
from hfsim.mechanics.pose import Pose
from hfsim.scene.schema import Deck


def find_marker(point: str, bodies: Mapping[str, Body], deck: Deck, held: bool = False) -> Marker:
    """Return the marker of a point as decks name it: ``BODY``, ``BODY.tip``, ``ground.name``; or its grip."""
    owner, name = split_point(point)
    if owner == "ground":
        return GroundMarker(Pose.level(deck.ground.points[name] if name else (0.0,) * deck.dimension))
    body = bodies[owner]
    place = body.points[name] if name else body.origin
    return body.grip(place) if held else body.marker(place)
