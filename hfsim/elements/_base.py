"""What every element has: shapes, mass, and an elastic law on its difference vectors.

The state of an element enters its energy through a few *difference vectors* V: the chord and the
slope vectors, all divided by the element length, so that they carry no unit and do not change when
the element is shifted.  Where the energy is a polynomial it depends on V only through the products
G = V V^T (design, section 3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, Protocol, Self

import numpy as np

from hfsim.arrays import Array


@dataclass(frozen=True)
class Stiffness:
    """Numbers of material and section that an elastic law needs.

    Attributes
    ----------
    axial : float
        EA [N].
    bending : float
        EI [N m^2].
    lame_lambda, lame_mu : float
        Lame constants [Pa].
    height, width : float
        Of the (equivalent) rectangular section [m]; the height lies in the bending plane.
    """

    axial: float
    bending: float
    lame_lambda: float
    lame_mu: float
    height: float
    width: float

    def without_bending(self) -> Stiffness:
        """Return the same with EI = 0."""
        return replace(self, bending=0.0)


@dataclass(frozen=True)
class Inertia:
    """Mass data of a beam: mass per length [kg/m], rotary inertia per length [kg m], section height [m]."""

    per_length: float
    rotary: float
    height: float


@dataclass(frozen=True)
class Measures:
    """Which strain and curvature a cable element has, and how its integrals are done.

    Attributes
    ----------
    strain : str
        ``green`` or ``engineering``.
    curvature : str
        ``linear`` (r'') or ``exact``.
    axial_points, bending_points : int or None
        Gauss points an element where the energy is no polynomial; as many as the degree of the
        element asks for without a number.
    """

    strain: str = "green"
    curvature: str = "linear"
    axial_points: int | None = None
    bending_points: int | None = None


USUAL = Measures()


class ElasticLaw(Protocol):
    """Elastic energy of many elements as a function of their difference vectors.

    V has shape (..., n_elements, n_vectors, n_dim); energies are in joule.
    """

    def energy(self, V: Array) -> Array:
        """Return the stored energy of each element, shape (..., n_elements)."""

    def gradient(self, V: Array) -> Array:
        """Return the derivative of the energy with respect to V, same shape as V."""

    def hessian(self, V: Array) -> Array:
        """Return the second derivative, shape (..., n_elements, n_vectors * n_dim, n_vectors * n_dim)."""

    def joined(self, other: Self) -> Self:
        """Return one law for the elements of this one followed by those of another of the same kind."""


class Element(Protocol):
    """An element between two nodes with some vectors at each: a position and gradients.

    Its vectors are those of the first node, interior ones if it has any, and those of the last node:
    ``stride + per_node`` together.
    """

    def __init__(self, length: float) -> None: ...

    @property
    def per_node(self) -> int:
        """Number of vectors at each node."""

    @property
    def degree(self) -> int:
        """Degree of the shapes along the axis."""

    @property
    def stride(self) -> int:
        """Number of vectors from one node to the next: those of a node and the interior ones."""

    @property
    def length(self) -> float:
        """Undeformed length [m]."""

    def differences(self) -> Array:
        """Return the matrix from the element's vectors to difference vectors, shape (n_differences, n)."""

    def shape(self, xi: float, eta: float = 0.0, derivative: tuple[int, int] = (0, 0)) -> Array:
        """Return the shape row, shape (n,), or a derivative of it with respect to (x, y)."""

    def mass(self, inertia: Inertia) -> Array:
        """Return the mass matrix of one vector component, shape (n, n) [kg]."""

    def law(self, stiffness: Stiffness, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the elastic law of ``count`` equal elements."""


@dataclass(frozen=True)
class GramLaw:
    """An energy that is quadratic in the products of difference vectors.

    U = scale (1/2 d^T C d + c^T d) with d = g - g0, g the entries of G = V V^T and g0 those of the
    undeformed element.  The energy is summed from d: g itself is so close to g0 in stiff bodies that
    nothing but rounding would be left of its differences.

    Attributes
    ----------
    quadratic : ndarray, shape (n_vectors**2, n_vectors**2)
        C, symmetric, also under exchange of the two vectors of each product.
    linear : ndarray, shape (n_elements, n_vectors**2)
        c of each element.
    reference : ndarray, shape (n_vectors**2,)
        g0.
    scale : ndarray, shape (n_elements,)
        [J].
    """

    quadratic: Array
    linear: Array
    reference: Array
    scale: Array

    def joined(self, other: GramLaw) -> GramLaw:
        """Return the law of this one's elements followed by the other's."""
        return GramLaw(
            quadratic=self.quadratic,
            linear=np.concatenate([self.linear, other.linear]),
            reference=self.reference,
            scale=np.concatenate([self.scale, other.scale]),
        )

    @cached_property
    def linear_at_zero(self) -> Array:
        """The linear term where g, not d, multiplies C."""
        return self.linear - self.reference @ self.quadratic

    @cached_property
    def _twice(self) -> Array:
        return 2.0 * self.scale[:, None]

    def _products(self, V: Array) -> Array:
        G = V @ V.swapaxes(-1, -2)
        return G.reshape(*G.shape[:-2], -1)

    def _coefficients(self, V: Array) -> Array:
        """Return 2 dU/dG [J], shape (..., n_elements, n_vectors, n_vectors)."""
        H = self._products(V) @ self.quadratic
        H += self.linear_at_zero
        H *= self._twice
        return H.reshape(*V.shape[:-1], V.shape[-2])

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_elements)."""
        d = self._products(V) - self.reference
        return np.asarray(self.scale * np.sum((0.5 * (d @ self.quadratic) + self.linear) * d, axis=-1))

    def gradient(self, V: Array) -> Array:
        """Return dU/dV [J], same shape as V."""
        return np.asarray(self._coefficients(V) @ V)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J]: the products' own change and the change of the vectors they multiply."""
        n, d = V.shape[-2:]
        H = self._coefficients(V)
        C = self.quadratic.reshape(n, n, n, n)
        change = 2.0 * np.einsum("abcd,...bi,...dj->...aicj", C, V, V, optimize=True)
        change *= self._twice[..., None, None, None]
        geometric = H[..., :, None, :, None] * np.eye(d)[:, None, :]
        return np.asarray((change + geometric).reshape(*V.shape[:-2], n * d, n * d))


def join_laws(laws: list[Any]) -> ElasticLaw:
    """Return one law for the elements of several of the same kind, in their order."""
    joined: ElasticLaw = reduce(lambda a, b: a.joined(b), laws)
    return joined
