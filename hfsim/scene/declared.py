"""The names that a deck declares, looked up in its plain data: bad entries have names too."""

from collections.abc import Collection, Iterator, KeysView
from functools import cached_property
from typing import Any, TypeAlias

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import split_point
from hfsim.deck.reader import Path
from hfsim.deck.source import did_you_mean, nearest
from hfsim.parts.bodies import BODIES
from hfsim.scene.schema import Deck

Names: TypeAlias = KeysView[str]
"""Names in the order of the deck."""
_NONE: Names = dict[str, None]().keys()


class Declared:
    """Names of bodies, joints, points and the like.

    A name that some other, already reported mistake may have hidden is not complained about.

    Attributes
    ----------
    data : dict
        Plain data of a deck.
    """

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        self._names: dict[str, Names | None] = {}

    def map(self, key: str, name: str) -> dict[str, Any]:
        """Return the entry of a name under a top-level key, empty if it is no map."""
        value = self.data.get(key)
        entry = value.get(name) if isinstance(value, dict) else None
        return entry if isinstance(entry, dict) else {}

    def maps(self, key: str) -> dict[str, dict[str, Any]]:
        """Return those entries of a top-level key that are maps."""
        value = self.data.get(key)
        pairs = value.items() if isinstance(value, dict) else ()
        return {name: entry for name, entry in pairs if isinstance(entry, dict)}

    def names(self, key: str) -> Names | None:
        """Return the names under a top-level key, None where they cannot be known."""
        if key not in self._names:
            self._names[key] = _names_in(self.data, key, Deck.keys())
        return self._names[key]

    @cached_property
    def points(self) -> dict[str, Names | None] | None:
        """The points of ground and of each body; None where they cannot be known."""
        bodies = self.names("bodies")
        ground = self.data.get("ground", {})
        if bodies is None or not bodies:
            return None
        known = _names_in(ground, "points", ["points"]) if isinstance(ground, dict) else None
        return {"ground": known, **{name: _points_of(self.data["bodies"][name]) for name in bodies}}

    def point_complaint(self, path: Path, reference: str) -> Iterator[Complaint]:
        """Yield a point that does not exist."""
        if self.points is None:
            return
        owner, point = split_point(reference)
        if owner not in self.points:
            yield Complaint(path, f"there is no body '{owner}'", did_you_mean(owner, self.points))
            return
        known = self.points[owner]
        if known is None or not point or point in known:
            return
        having = [f"{spec.noun}s" for spec in BODIES.values() if point in spec.own_points]
        what = f"{point}, only {' and '.join(having)} have" if having else f"point '{point}'"
        yield Complaint(path, f"'{owner}' has no {what}", _points_hint(owner, point, known))


def _names_in(data: dict[str, Any], key: str, known_keys: Collection[str]) -> Names | None:
    """Return the keys of a map inside a map, none if it is absent, None if it is malformed or misspelt."""
    if key not in data:
        others = [other for other in data if other not in known_keys]
        return None if others and nearest(key, others) else _NONE
    value = data[key]
    if value is None:
        return _NONE
    return value.keys() if isinstance(value, dict) else None


def _points_of(body: Any) -> Names | None:
    """Return the points that a body's plain data declare, None where they cannot be known."""
    spec = BODIES.get(str(body.get("type"))) if isinstance(body, dict) else None
    points = None if spec is None else _names_in(body, "points", spec.keys())
    return None if spec is None or points is None else dict.fromkeys([*spec.own_points, *points]).keys()


def _points_hint(owner: str, point: str, known: Names) -> str:
    if not known:
        return f"declare it under {'ground.points' if owner == 'ground' else f'bodies.{owner}.points'}"
    return did_you_mean(point, known)
