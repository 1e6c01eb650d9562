"""Force all along a beam, or a part of it."""

from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal

import numpy as np

from hfsim.deck.fields import Flag, ForcePerLengthVector, table_of
from hfsim.deck.law_specs import ScaleLaw
from hfsim.deck.spec import Complaint
from hfsim.maths.arrays import Array
from hfsim.maths.shapes import gauss_legendre
from hfsim.mechanics.body import Body
from hfsim.mechanics.line_force import LineForce
from hfsim.mechanics.markers import Marker
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
            if not -_ROUNDING * length <= place <= (1.0 + _ROUNDING) * length:
                message = f"{place:g} m is not on '{self.on}', whose length is {length:g} m"
                yield Complaint(("shape", index), message)

    def build_on(self, marker: Callable[[str], Marker], body: Body, spec: Any) -> LineForce:
        """Return the force: at Gauss points whose work is that of the load along each element."""
        degree = spec.degree + 2 * FOLLOWING * self.follower
        edges, places, weights = self._points(spec.length, spec.elements, degree)
        markers = tuple(body.grip((float(a), *(0.0,) * (body.n_dim - 1))) for a in places)
        law = self.law.build() if self.law else None
        return LineForce(markers, weights[:, None] * self._directed(spec, places), edges, self.follower, law)

    def _directed(self, spec: Any, places: Array) -> Array:
        """Return the force per length at places in the axes that markers turn, (n or 1, n_dim)."""
        if not self.follower:
            return np.array([self.force])
        from hfsim.parts.bodies.beam_axis import Axis

        return np.asarray(Axis.of(spec, len(self.force)).sections(places)[1] @ self.force)

    def _points(self, length: float, elements: int, degree: int) -> tuple[Array, Array, Array]:
        """Return cells, and places there with weights, the factor included, exact for shapes of a degree."""
        ends = np.linspace(0.0, length, elements + 1)
        rows = np.array(self.shape or ((0.0, 1.0), (length, 1.0)))
        kinks = np.clip(rows[:, 0], 0.0, length)
        inside = ends[(ends > kinks[0]) & (ends < kinks[-1])]
        near = np.abs(inside[:, None] - kinks).min(axis=1, initial=length) <= _ROUNDING * length
        grid = np.sort(np.concatenate([inside[~near], kinks]))
        xi, w = gauss_legendre((degree + 3) // 2)
        steps = np.diff(grid)
        places = (grid[:-1, None] + steps[:, None] * xi).ravel()
        return grid, places, (steps[:, None] * w).ravel() * np.interp(places, kinks, rows[:, 1])


_ROUNDING = 1e-9
"""Distance, over the length of a beam, that counts as none."""
