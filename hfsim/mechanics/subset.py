"""Some rows of a constraint: where joints hold a motion more than once, the others are left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.products import Product


@frozen
class Subset(Constraint):
    """Rows of another constraint, maybe none.

    Attributes
    ----------
    kept : tuple of int
        Which of its rows, in order.
    """

    whole: Constraint
    kept: tuple[int, ...]
    why_kept: ClassVar[str] = "it closes a loop; what others hold already is left out"

    @classmethod
    def of(cls, whole: Constraint, kept: Sequence[int]) -> Subset:
        """Return some rows of a constraint."""
        law, item, against = whole.law, whole.item, whole.against
        return cls(whole.first, whole.second, whole, tuple(kept), law=law, item=item, against=against)

    @property
    def unit(self) -> str:  # type: ignore[override]
        """That of the whole."""
        return self.whole.unit

    @property
    def wraps(self) -> bool:  # type: ignore[override]
        """As the whole."""
        return self.whole.wraps

    @property
    def rows(self) -> int:
        """Number of rows kept."""
        return len(self.kept)

    @property
    def still(self) -> tuple[bool, ...]:
        """As the whole."""
        return self.whole.still

    @property
    def constant(self) -> bool:
        """As the whole, and where none are kept."""
        return not self.kept or self.whole.constant

    @property
    def products(self) -> tuple[Product, ...]:
        """Those of the whole that are kept."""
        return self._kept(self.whole.products)

    @property
    def crossed(self) -> tuple[Product, ...]:
        """Those of the whole that are kept."""
        return self._kept(self.whole.crossed)

    def _kept(self, every: tuple[Product, ...]) -> tuple[Product, ...]:
        return tuple(every[k] for k in self.kept) if every else ()

    def residual(self, t: Array, x: Array) -> Array:
        """Return the rows of Phi that are kept."""
        return self.whole.residual(t, x)[:, self.kept]

    def rate(self, t: Array) -> Array:
        """Return those of Phi_t."""
        return self.whole.rate(t)[:, self.kept]

    def acceleration(self, t: Array, x: Array, u: Array) -> Array:
        """Return what those of Phi_x x'' must be."""
        return self.whole.acceleration(t, x, u)[:, self.kept]

    def gap(self, x: Array) -> Array:
        """Return the gaps that are kept."""
        return self.whole.gap(x)[:, self.kept]

    def jacobian(self, end: int, x: Array) -> Array:
        """Return their Jacobian."""
        return self.whole.jacobian(end, x)[:, self.kept]

    def bias(self, x: Array, u: Array) -> Array:
        """Return their second time derivatives at zero accelerations."""
        return self.whole.bias(x, u)[:, self.kept]

    def _spread(self, multipliers: Array) -> Array:
        """Return multipliers of the whole, zero where rows are left out."""
        every = np.zeros((len(multipliers), self.whole.rows))
        every[:, self.kept] = multipliers
        return every

    def stiffness(self, x: Array, multipliers: Array) -> Entries:
        """Return that of the whole."""
        return self.whole.stiffness(x, self._spread(multipliers))

    def reaction(self, x: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return that of the whole."""
        return self.whole.reaction(x, self._spread(multipliers))


def parted(
    constraints: Sequence[Constraint], left_out: Mapping[int, Sequence[int]]
) -> tuple[tuple[Constraint, ...], tuple[Constraint, ...]]:
    """Return the same constraints with some rows left out, and what was left out.

    Parameters
    ----------
    left_out : mapping of int to sequence of int
        Rows by the number of their constraint.
    """
    kept = list(constraints)
    for k, rows in left_out.items():
        kept[k] = Subset.of(constraints[k], [row for row in range(constraints[k].rows) if row not in rows])
    return tuple(kept), tuple(Subset.of(constraints[k], sorted(rows)) for k, rows in left_out.items())
