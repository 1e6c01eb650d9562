"""Drag of a medium on a beam, or on a point."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Literal

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import (
    PositiveArea,
    PositiveDensity,
    PositiveLength,
    PositiveNumber,
    VelocityVector,
)
from hfsim.deck.law_specs import ScaleLaw
from hfsim.mechanics.body import Body
from hfsim.mechanics.drag import Drag, LineDrag, PointDrag
from hfsim.mechanics.markers import Marker
from hfsim.parts.forces._along import gauss_points, in_axes
from hfsim.parts.specs import LoadSpec


class DragSpec(LoadSpec):
    """Drag of air or water, at rest or in flow: at a point 1/2 density * coefficient * area * speed^2; on a
    beam the same per length, with its width, against its velocity across its axis.
    """

    vectors = ("flow",)
    carries = True

    type: Literal["drag"]

    on: str | None = None
    """Beam it acts on, all along; or `at`."""

    at: str | None = None
    """Point it acts on; or `on`."""

    density: PositiveDensity
    """Of the medium [kg/m^3]."""

    coefficient: PositiveNumber
    """Drag coefficient [-]; of beams that across the axis."""

    width: PositiveLength | None = None
    """Of a beam, as the flow sees it [m]."""

    area: PositiveArea | None = None
    """Of what is at a point, as the flow sees it [m^2]."""

    along: PositiveNumber | None = None
    """Coefficient for the velocity along a beam, over the same width [-]; zero without it."""

    flow: VelocityVector | None = None
    """Velocity of the medium, in the ground frame [m/s]; at rest without it."""

    law: ScaleLaw | None = None
    """Factor on the flow over time [-]; 1 without it."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield drag on nothing, on both, or of no size."""
        if (self.on is None) == (self.at is None):
            yield Complaint((), "drag acts on a beam or at a point", "give either on or at")
            return
        size, other = ("width", "area") if self.at is None else ("area", "width")
        if getattr(self, size) is None:
            yield Complaint((size,), "missing key", on_key=True)
        for key in (other, *(() if self.at is None else ("along",))):
            if getattr(self, key) is not None:
                where = "along a beam" if self.at is None else "at a point"
                yield Complaint((key,), f"has no meaning {where}", "remove this key", True)
        if self.law is not None and self.flow is None:
            yield Complaint(("law",), "there is no flow that it could scale", "remove this key", True)

    @property
    def owner(self) -> str:
        """The beam, or the body of the point."""
        return super().owner if self.on is None else self.on

    @property
    def acts(self) -> bool:
        """It does: what it acts on may move."""
        return True

    def build_on(self, marker: Callable[[str], Marker], body: Body, spec: Any) -> Drag:
        """Return the forces: at one point, or at Gauss points."""
        n_dim = body.n_dim
        flow, law = self.flow or (0.0,) * n_dim, self.law.build() if self.law else None
        pressure = 0.5 * self.density
        if self.at is not None:
            assert self.area is not None
            return PointDrag(marker(self.at), pressure * self.coefficient * self.area, flow, law)
        assert self.width is not None
        grid, places, weights = gauss_points(spec.length, spec.elements, 2 * spec.degree)
        markers = tuple(body.grip((float(a), *(0.0,) * (n_dim - 1))) for a in places)
        tangents = in_axes(spec, places, np.eye(n_dim)[0])
        sizes = pressure * self.width * weights
        across, along = self.coefficient * sizes, (self.along or 0.0) * sizes
        return LineDrag(markers, grid, tangents, across, along, flow, law)
