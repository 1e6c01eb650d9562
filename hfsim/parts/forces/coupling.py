"""Coupling: angles and distances of several joints in a ratio, as by gears, belts, cables and screws."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Angle, Number, PositiveRotationalStiffness, RotationalDamping
from hfsim.maths.arrays import Array
from hfsim.mechanics.coupled import CoupledTie
from hfsim.mechanics.resistances import LinearSpring
from hfsim.mechanics.ties import Tie
from hfsim.parts.specs import SpringSpec


class CouplingSpec(SpringSpec):
    """Spring and damper on a sum of angles and distances of joints and springs, each times a factor: gears,
    belts, cables and screws that give a little, in the plane and in space, between bodies of all kinds.
    """

    angles = ("rest_angle",)
    measures = (("rad", ""),)
    reacts = False
    limits = ("moment",)

    type: Literal["coupling"]
    """Kind of spring."""

    of: Annotated[dict[str, Number], Field(min_length=1)]
    """Factors of the joints, or springs, whose angles [-] or distances [rad/m] are added, by name; of a
    cylindrical joint, `name.turning` or `name.sliding`."""

    stiffness: PositiveRotationalStiffness
    """Stiffness of the sum [N m/rad]."""

    damping: RotationalDamping = 0.0
    """Damping of the sum [N m s/rad]."""

    rest_angle: Angle | None = None
    """Sum without moment [rad]; without it, that at the start."""

    _on: dict[str, Any] = PrivateAttr(default_factory=dict)

    def complaints(self) -> Iterator[Complaint]:
        """Yield factors that are zero."""
        for name, factor in self.of.items():
            if not factor:
                yield Complaint(("of", name), "must not be zero")

    def bind(self, *known: Mapping[str, Any]) -> None:
        """Take note of the joints and springs that it is on, of those that there are."""
        every = {name: one for entries in known for name, one in entries.items()}
        owners = {key: key.partition(".")[0] for key in self.of}
        self._on.update({key: every[name] for key, name in owners.items() if name in every})

    @property
    def on(self) -> dict[str, Any]:
        """The joints and springs that it is on, by what names their coordinate."""
        return self._on

    def coupling(self, parts: Sequence[Tie], start: Array) -> CoupledTie:
        """Return the force on what parts measure; the angles count full turns."""
        loose = CoupledTie(parts[0].first, parts[0].second, (), tuple(parts), tuple(self.of.values()))
        rest = self.rest_angle
        if rest is None:
            rest = float(loose.measured(np.zeros(1), start[None])[0][0])
        return replace(loose, resistances=(LinearSpring(self.stiffness, self.damping, rest),))

    @property
    def points(self) -> tuple[str, ...]:
        """The points that these tie."""
        return tuple(point for one in self._on.values() for point in one.between)
