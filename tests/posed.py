# ruff: noqa: E501
"""Decks turned and shifted as a whole, and planar decks posed in a plane of space."""

from copy import deepcopy

import numpy as np

from hfsim.maths.rotations import rotation


def plain(vector):
    return [float(part) for part in vector]


def axes(R):
    """An orientation as decks have it."""
    return {"x": plain(R[:, 0]), "y": plain(R[:, 1])}


def matrix(entry):
    """The orientation (3, 3) that an entry states by x and y or a rotation vector, or none."""
    stated = entry.get("orientation", {"rotation_vector": [0.0, 0.0, 0.0]})
    if "rotation_vector" in stated:
        return rotation(np.array(stated["rotation_vector"]))
    x, y = np.array(stated["x"]), np.array(stated["y"])
    return np.column_stack([x, y, np.cross(x, y)])


def moved(deck, R, shift):
    """A spatial deck turned by a matrix and then shifted, whose bodies all state their orientation as `matrix` reads it.

    It may name no point of the ground but those declared.
    """
    deck = deepcopy(deck)
    deck["gravity"] = plain(R @ deck["gravity"])
    points = deck["ground"]["points"]
    deck["ground"]["points"] = {name: plain(R @ np.array(point) + shift) for name, point in points.items()}
    for entry in (*deck.get("joints", {}).values(), *deck.get("springs", {}).values()):
        if entry["between"][0].startswith("ground"):
            _turn_tie(entry, R)
    for entry in deck.get("loads", {}).values():
        for key in ("force", "moment"):
            if key in entry and not entry.get("follower"):
                entry[key] = plain(R @ entry[key])
    for entry in deck["initial"].values():
        entry["orientation"] = axes(R @ matrix(entry))
        for key in ("velocity", "angular_velocity"):
            if key in entry:
                entry[key] = plain(R @ entry[key])
        if "position" in entry:
            entry["position"] = plain(R @ entry["position"] + shift)
    return deck


def _turn_tie(entry, R):
    if entry["type"] == "universal":
        entry["axes"] = [plain(R @ axis) for axis in entry.get("axes", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])]
    if "angle" in entry or entry["type"] == "rotational":
        entry["orientation"] = axes(R @ matrix(entry))
    if entry["type"] not in ("spherical", "fixed", "two_point", "universal"):
        entry["axis"] = plain(R @ entry.get("axis", [0.0, 0.0, 1.0]))
    if entry["type"] in ("fixed", "prismatic", "universal"):
        entry["orientation"] = axes(R @ matrix(entry))


def in_space(deck, R, shift):
    """A planar deck in the plane of the first two columns of R; its bodies all state their angles."""
    deck = deepcopy(deck)
    deck["gravity"] = [*deck["gravity"], 0.0]
    deck["ground"] = {"points": {"origin": [0.0, 0.0, 0.0], **_raised(deck.get("ground", {}).get("points", {}))}}
    for body in deck["bodies"].values():
        body["points"] = _raised(body.get("points", {}))
        if body["type"] == "rigid":
            body["inertia"] = [0.5 * body["inertia"], 0.5 * body["inertia"], body["inertia"]]
        else:
            body.setdefault("element", "cable")
    for entry in (*deck["joints"].values(), *deck.get("springs", {}).values()):
        entry["between"] = ["ground.origin" if end == "ground" else end for end in entry["between"]]
        if entry["type"] == "prismatic" or "position" in entry:
            entry["axis"] = [*entry.get("axis", [1.0, 0.0]), 0.0]
        if "angle" in entry and entry["type"] == "fixed":
            entry["orientation"] = axes(rotation(np.array([0.0, 0.0, entry.pop("angle")])))
    for entry in deck.get("loads", {}).values():
        if "force" in entry:
            entry["force"] = [*entry["force"], 0.0]
        else:
            entry["moment"] = [0.0, 0.0, entry["moment"]]
    for entry in deck["initial"].values():
        entry["orientation"] = axes(rotation(np.array([0.0, 0.0, entry.pop("angle", 0.0)])))
        if "angular_velocity" in entry:
            entry["angular_velocity"] = [0.0, 0.0, entry["angular_velocity"]]
        for key in ("position", "velocity"):
            if key in entry:
                entry[key] = [*entry[key], 0.0]
    return moved(deck, R, shift)


def _raised(points):
    return {name: [*point, 0.0] for name, point in points.items()}
