"""Elements that are not equal, each with a form of its stiffness of its own."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.elements import ElasticLaw


@dataclass(frozen=True)
class UnlikeLaw:
    """The laws of elements one by one.

    Attributes
    ----------
    laws : tuple of ElasticLaw
        Of one element each.
    """

    laws: tuple[ElasticLaw, ...]

    @property
    def quartic(self) -> bool:
        """Return what they say."""
        return all(law.quartic for law in self.laws)

    @property
    def shared(self) -> Hashable:
        """Nothing but the kind."""
        return UnlikeLaw

    def joined(self, other: UnlikeLaw) -> UnlikeLaw:
        """Return the law of this one's elements followed by the other's."""
        return UnlikeLaw(self.laws + other.laws)

    def energy(self, V: Array) -> Array:
        """Return the stored energy of each element [J], shape (..., n_elements)."""
        each = [law.energy(V[..., e : e + 1, :, :]) for e, law in enumerate(self.laws)]
        return np.concatenate(each, axis=-1)

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] in rows."""
        states = v.shape[-1] // len(self.laws)
        parts = (v[..., e * states : (e + 1) * states] for e in range(len(self.laws)))
        pulled = [law.pull(np.ascontiguousarray(p)) for law, p in zip(self.laws, parts, strict=True)]
        return np.concatenate(pulled, axis=-1)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors * n_dim, n_vectors * n_dim)."""
        each = [law.hessian(V[..., e : e + 1, :, :]) for e, law in enumerate(self.laws)]
        return np.concatenate(each, axis=-3)
