"""What every element has: shapes, mass, and an elastic law on its difference vectors.

The state of an element enters its energy through a few *difference vectors* V: the chord and the
slope vectors, all divided by the element length, so that they carry no unit and do not change when
the element is shifted.  Where the energy is a polynomial it depends on V only through the products
G = V V^T (design, section 3).
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import replace
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.traced import row_products
from hfsim.parts.elements._products import by_pairs, curvature, factors, packed, pairs, symmetric

if TYPE_CHECKING:
    from hfsim.deck.materials import BeamProperties
    from hfsim.deck.stations import BeamAlong


class Measures(NamedTuple):
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
    n_dim : int
        Of space.
    """

    strain: str = "green"
    curvature: str = "linear"
    axial_points: int | None = None
    bending_points: int | None = None
    n_dim: int = 2


USUAL = Measures()


class ElasticLaw(Protocol):
    """Elastic energy of many elements as a function of their difference vectors.

    V has shape (..., n_elements, n_vectors, n_dim); energies are in joule.
    """

    @property
    def quartic(self) -> bool:
        """Whether the energy is a polynomial of degree four in V."""

    @property
    def shared(self) -> Hashable:
        """What must be equal for two laws to be `joined`."""

    def energy(self, V: Array) -> Array:
        """Return the stored energy of each element, shape (..., n_elements)."""

    def pull(self, v: Array) -> Array:
        """Return dU/dV from and as `component_rows`: each operation runs along whole rows of memory."""

    def hessian(self, V: Array) -> Array:
        """Return the second derivative, shape (..., n_elements, n_vectors * n_dim, n_vectors * n_dim)."""

    def joined(self, other: Self) -> Self:
        """Return one law for the elements of this one followed by those of another of the same kind."""


class Element(Protocol):
    """An element between two nodes with some vectors at each: a position and gradients.

    Its vectors are those of the first node, interior ones if it has any, and those of the last node:
    ``stride + per_node`` together.
    """

    @classmethod
    def of(cls, length: float, degree: int, section_degree: int = 1, n_dim: int = 2) -> Self:
        """Return the element of a length [m] and degrees, of the line and of sections, in plane or space."""

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

    def shape(
        self, xi: Array | float, eta: float = 0.0, derivative: tuple[int, ...] = (0, 0), zeta: float = 0.0
    ) -> Array:
        """Return shape rows at x = xi le, (eta, zeta) [m], or derivatives of them by (x, y[, z]).

        Shape (*xi.shape, n) for places (n_places,) or a single one.
        """

    def mass(self, properties: BeamAlong, count: int = 1, start: float = 0.0) -> Array:
        """Return the mass matrix of one vector component [kg], (n, n), or that of each of some elements.

        Of the part beyond ``start``, a share of the length.
        """

    def law(self, properties: BeamAlong, count: int, measures: Measures = USUAL) -> ElasticLaw:
        """Return the elastic law of ``count`` elements in a row."""

    def gram_law(self, properties: BeamProperties, count: int, n_dim: int = 2) -> GramLaw:
        """Return the law of the polynomial energy as a form in products of vectors."""


@frozen
class QuadraticMap:
    """Sums of products of two components of a vector, and constants.

    Attributes
    ----------
    first, second : ndarray of int, shape (n_products,)
        Which components are multiplied; each pair once.
    matrix : ndarray, shape (n_products, n_out)
    constant : ndarray, shape (n_out,), (1, n_out) or (n_elements, n_out)
    scale : ndarray, shape (n_elements, 1), optional
        Multiplies the whole.
    """

    first: IntArray
    second: IntArray
    matrix: Array
    constant: Array
    scale: Array | None = None

    @classmethod
    def of(cls, full: Array, constant: Array) -> QuadraticMap:
        """Return the map with the factors full[c, d] of each product x_c x_d, shape (n, n, n_out)."""
        return cls(*symmetric(full), constant)

    def __call__(self, x: Array) -> Array:
        """Return the sums, shape (..., n_out), for x of shape (..., n_elements, n)."""
        products = x.take(self.first, axis=-1)
        products *= x.take(self.second, axis=-1)
        out = products @ self.matrix
        out += self.constant
        if self.scale is not None:
            out *= self.scale
        return np.asarray(out)


@frozen
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
    dimension : int
        Of the vectors.

    Notes
    -----
    With h = C g + c - C g0 and its entries written as a matrix over pairs of vectors,

        dU/dV_a = 2 scale sum_b h_ab V_b   and
        d2U/dV_ai dV_cj = 2 scale (h_ac delta_ij + 2 sum_bd C_abcd V_bi V_dj) .

    The Hessian is one product of components and one matrix product: it is asked for in one state, where
    calls cost, not operations.
    """

    quadratic: Array
    linear: Array
    reference: Array
    scale: Array
    dimension: int = 2
    quartic: ClassVar[bool] = True

    @property
    def shared(self) -> Hashable:
        """The form itself; elements differ in linear term and scale only."""
        return self.dimension, self.quadratic.tobytes(), self.reference.tobytes()

    def joined(self, other: GramLaw) -> Self:
        """Return the law of this one's elements followed by the other's."""
        return self.in_turn(other, 1)

    def in_turn(self, other: GramLaw, points: int) -> Self:
        """Return the law of elements of so many points each and of others, point by point."""
        pairs = (self.linear, other.linear), (self.scale, other.scale)
        linear, scale = (in_turn(*pair, points) for pair in pairs)
        return replace(self, linear=linear, scale=scale)

    @cached_property
    def linear_at_zero(self) -> Array:
        """The linear term where g, not d, multiplies C."""
        return self.linear - self.reference @ self.quadratic

    @property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """The two vectors of each product; each pair once."""
        return pairs(self._n_vectors)

    @property
    def packed(self) -> IntArray:
        """Which of the pairs each entry of G is, entries in a row."""
        return packed(self._n_vectors)

    @cached_property
    def _factors(self) -> tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]:
        return factors(self._n_vectors, self.dimension)

    @cached_property
    def coefficients(self) -> tuple[Array, Array, Array | None]:
        """2 dU/dG [J] by pairs: its derivative by products of components, constant part, and common factor.

        Shapes (n_pairs, n_dim * n_pairs), (n_pairs, n_elements or 1, 1) and (n_elements, 1); no factor where
        it is the same for all elements.
        """
        first, second = self.pairs
        entries, matrix = first * self._n_vectors + second, by_pairs(self.quadratic, self.dimension)
        constant, factor = self.linear_at_zero.T[entries, :, None], 2.0 * self.scale[:, None]
        if not np.all(factor == factor[0]):
            return matrix, constant, factor
        alike = np.all(constant == constant[:, :1])
        return factor[0] * matrix, factor[0] * (constant[:, :1] if alike else constant), None

    @cached_property
    def second_derivative(self) -> QuadraticMap:
        """d2U/dV2 [J] as a map of products V_bk V_dl to its entries (ai, cj)."""
        n, (first, second, matrix) = self._n_vectors, curvature(self.quadratic, self.dimension)
        linear = self.linear_at_zero.reshape(-1, n, 1, n, 1)
        constant, factor = linear * np.eye(self.dimension)[:, None], 2.0 * self.scale[:, None]
        constant = constant.reshape(len(self.scale), -1)
        if not np.all(factor == factor[0]):
            return QuadraticMap(first, second, matrix, constant, factor)
        alike = np.all(constant == constant[0])
        constant = constant[:1] if alike else constant
        return QuadraticMap(first, second, factor[0] * matrix, factor[0] * constant)

    @property
    def _n_vectors(self) -> int:
        return math.isqrt(len(self.reference))

    def energy(self, V: Array) -> Array:
        """Return the stored energy [J], shape (..., n_elements)."""
        G = sum(V[..., :, None, k] * V[..., None, :, k] for k in range(self.dimension))
        d = np.reshape(G, (*V.shape[:-2], -1)) - self.reference
        pulled = (d.reshape(-1, len(self.quadratic)) @ self.quadratic).reshape(d.shape)  # all in one product
        return np.asarray(self.scale * np.sum((0.5 * pulled + self.linear) * d, axis=-1))

    def pull(self, v: Array) -> Array:
        """Return dU/dV [J] for `component_rows`, same shape."""
        _, (some, pairs) = self._factors
        return row_products(v.reshape(-1, v.shape[-1]), some, self.weights(v), pairs).reshape(v.shape)

    def shares(self, v: Array) -> Array:
        """Return what `pull` sums over b, 2 scale h_ab V_b, in rows (b, a, component)."""
        _, (some, pairs) = self._factors
        return row_products(v.reshape(-1, v.shape[-1]), some.ravel(), self.weights(v), pairs.ravel())

    def weights(self, v: Array) -> Array:
        """Return 2 dU/dG by pairs, shape (n_pairs, n_elements * n_states)."""
        (first, second), x = self._factors[0], v.reshape(-1, v.shape[-1])
        matrix, constant, factor = self.coefficients
        H = np.dot(matrix, row_products(x, first, x, second))
        by_element = H.reshape(len(H), len(self.scale), -1)
        by_element += constant
        if factor is not None:
            by_element *= factor
        return np.asarray(H)

    def hessian(self, V: Array) -> Array:
        """Return d2U/dV2 [J], shape (..., n_elements, n_vectors * n_dim, n_vectors * n_dim)."""
        flat = V.reshape(*V.shape[:-2], -1)
        return self.second_derivative(flat).reshape(*flat.shape, flat.shape[-1])


def in_turn(first: Array, second: Array, points: int) -> Array:
    """Return what goes with the first points of elements of two beams, then with their second points, ..."""
    both = [one.reshape(points, -1, *one.shape[1:]) for one in (first, second)]
    return np.concatenate(both, axis=1).reshape(-1, *first.shape[1:])


def join_laws(laws: list[Any]) -> ElasticLaw:
    """Return one law for the elements of several of the same kind, in their order."""
    joined: ElasticLaw = reduce(lambda a, b: a.joined(b), laws)
    return joined
