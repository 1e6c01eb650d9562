"""What a stability map finds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from hfsim.deck.ranges import Value
from hfsim.marching.columns import Columns, as_columns
from hfsim.maths.arrays import Array
from hfsim.studies.stability.verdict import CLASSES, NO_TRIAL, Bounds, Trial, Verdict

Wanted: TypeAlias = "tuple[tuple[Value, ...], str, str]"
"""Values on the axes, model, method."""


@dataclass(frozen=True)
class MapPoint:
    """One point of a map.

    Attributes
    ----------
    values : tuple of float or str
        On the axes.
    trial : Trial
        How its run ended.
    overrides : tuple of str
        What makes this deck of the one mapped.
    """

    values: tuple[Value, ...]
    model: str
    method: str
    verdict: Verdict
    trial: Trial = NO_TRIAL
    overrides: tuple[str, ...] = ()

    @property
    def outcome(self) -> str:
        """Its class."""
        return self.verdict.outcome

    def facts(self) -> dict[str, Any]:
        """Return what tables and files have of it, but for its place."""
        trial, verdict = self.trial, self.verdict
        return {
            "model": self.model,
            "method": self.method,
            "class": self.outcome,
            **{key: getattr(trial, key) for key in ("status", "end", "steps", "cpu")},
            **{key: getattr(verdict, key) for key in _OF_VERDICT},
        }


_OF_VERDICT = (
    "time_error", "model_error", "energy_drift", "growth", "reference_floor", "channel", "cause", "item",
    "reason",
)  # fmt: skip


@dataclass(frozen=True)
class Boundary:
    """Where a class ends along an axis.

    Attributes
    ----------
    below, above : float
        The last value of one class and the first of the other, as near as was asked for.
    reason : str
        What is wrong on the side that is not accurate.
    """

    model: str
    method: str
    below: float
    above: float
    class_below: str
    class_above: str
    reason: str

    @property
    def width(self) -> float:
        """Distance of the two over the larger one [-]."""
        return abs(self.above - self.below) / max(abs(self.above), abs(self.below))


@dataclass(frozen=True)
class MapAxis:
    """An axis of a map that was made.

    Attributes
    ----------
    name : str
        Key of the deck, or the name of a scaling.
    values : tuple of float or str
    logarithmic : bool
    unit : str
        SI unit of the values; empty where there is none.
    """

    name: str
    values: tuple[Value, ...]
    logarithmic: bool = False
    unit: str = ""

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True)
class StabilityMap(Columns):
    """Everything a study found; ``found["class"]`` is a column of its points, ``found.grid`` the map.

    Attributes
    ----------
    name : str
        Name of the deck.
    status : str
        ``done``, ``over budget`` or ``interrupted``.
    seconds, used : float
        Wall time allowed and used [s].
    points : tuple of MapPoint
        In the order of models, methods and axes.
    """

    name: str
    status: str
    axes: tuple[MapAxis, ...]
    bounds: Bounds
    seconds: float
    used: float
    points: tuple[MapPoint, ...]
    boundaries: tuple[Boundary, ...] = ()

    def __repr__(self) -> str:
        """Return what it is in a line: its points would fill the screen."""
        axes = " x ".join(f"{axis.name} ({len(axis.values)})" for axis in self.axes)
        return f"<StabilityMap {self.name}: {self.status}, {axes or 'no axis'}; {self.summary}>"

    def table(self) -> list[dict[str, Any]]:
        """Return a row for each point: values on the axes, then `MapPoint.facts`, then its overrides."""
        names = [axis.name for axis in self.axes]
        return [
            {**dict(zip(names, p.values, strict=True)), **p.facts(), "overrides": " ".join(p.overrides)}
            for p in self.points
        ]

    @cached_property
    def columns(self) -> dict[str, Array]:  # type: ignore[override]
        """The same as columns, an array each by name."""
        return as_columns(self.table())

    def grid(self, model: str, method: str, name: str = "class") -> Array:
        """Return what the points of a model and method have, an axis of the array for each of the map.

        Raises
        ------
        KeyError
            If there is no such model, method or column.
        """
        if (model, method) not in self.rows():
            there = ", ".join(" with ".join(row) for row in self.rows())
            raise KeyError(f"no {model} with {method}; there are {there}")
        mine = (self["model"] == model) & (self["method"] == method)
        found, values = self.points_of(model, method), self[name][mine]
        made = np.full([len(axis.values) for axis in self.axes], None, dtype=object)
        for place, value in zip(found, values, strict=True):
            made[tuple(axis.values.index(one) for axis, one in zip(self.axes, place, strict=True))] = value
        return made if values.dtype == object else made.astype(float)

    def rows(self) -> list[tuple[str, str]]:
        """Return the pairs (model, method)."""
        return list(dict.fromkeys((p.model, p.method) for p in self.points))

    def points_of(self, model: str, method: str) -> dict[tuple[Value, ...], MapPoint]:
        """Return the points of one model and method by their values."""
        return {p.values: p for p in self.points if (p.model, p.method) == (model, method)}

    def counts(self) -> dict[str, int]:
        """Return how many points each class has."""
        found = [p.outcome for p in self.points]
        return {name: found.count(name) for name in CLASSES if name in found}

    @property
    def summary(self) -> str:
        """How many points each class has, in words."""
        counts = ", ".join(f"{count} {name}" for name, count in self.counts().items())
        return f"{len(self.points)} points" + (f": {counts}" if counts else "")
