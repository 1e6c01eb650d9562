"""Force all along a beam, or a part of it."""

from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Flag, ForcePerLengthVector, table_of
from hfsim.deck.law_specs import ScaleLaw
from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Body
from hfsim.mechanics.line_force import LineForce
from hfsim.mechanics.markers import Marker
from hfsim.parts.forces._along import ROUNDING, gauss_points, in_axes
from hfsim.parts.specs import LoadSpec

FOLLOWING = 2
"""Points more where the direction changes along an element."""


class DistributedSpec(LoadSpec):
    """Force per length along a beam, constant or by a factor along it, constant or scaled over time."""

    vectors = ("force",)
    carries = True

    type: Literal["distributed"]

    on: str
    """Beam it acts on."""

    force: ForcePerLengthVector
    """Force per undeformed length [N/m], in the ground frame; in the axes of the sections if it follows."""

    shape: Annotated[tuple[tuple[float, float], ...], table_of("length", "dimensionless")] | None = None
    """Rows [distance from the root, factor]: straight lines between them, nothing beyond [m, -]; without it
    the factor is 1 all along."""

    follower: Flag = False
    """Whether the force turns with the sections."""

    law: ScaleLaw | None = None
    """Factor over time [-]; 1 without it."""

    @property
    def owner(self) -> str:
        """The beam."""
        return self.on

    @property
    def amount(self) -> tuple[float, ...]:
        """The force per length."""
        return self.force

    def beyond(self, length: float) -> Iterator[Complaint]:
        """Yield rows of the shape beyond a beam of this length."""
        for index, (place, _) in enumerate(self.shape or ()):
            if not -ROUNDING * length <= place <= (1.0 + ROUNDING) * length:
                message = f"{place:g} m is not on '{self.on}', whose length is {length:g} m"
                yield Complaint(("shape", index), message)

    def build_on(self, marker: Callable[[str], Marker], body: Body, spec: Any) -> LineForce:
        """Return the force: at Gauss points whose work is that of the load along each element."""
        degree = spec.degree + 2 * FOLLOWING * self.follower
        edges, places, weights = gauss_points(spec.length, spec.elements, degree, self.shape)
        markers = tuple(body.grip((float(a), *(0.0,) * (body.n_dim - 1))) for a in places)
        law = self.law.build() if self.law else None
        return LineForce(markers, weights[:, None] * self._directed(spec, places), edges, self.follower, law)

    def _directed(self, spec: Any, places: Array) -> Array:
        """Return the force per length at places in the axes that markers turn, (n or 1, n_dim)."""
        return in_axes(spec, places, self.force) if self.follower else np.array([self.force])
