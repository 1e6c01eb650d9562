"""How large changes of a state are: for each body as against a turn of it by one radian."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hfsim.maths.arrays import Array, BoolArray, IntArray
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, is_sparse
from hfsim.maths.rank import spanning

ALIKE = 1e-12
"""Square of a mixture of motions, over the largest, that is none: a straight line turns about itself."""


@frozen
class Gauge:
    """Measures changes of absolute coordinates by the mass they move, body by body, without a unit.

    Attributes
    ----------
    metric : Matrix, shape (n_x, n_x)
        Mass matrix of the start, with an inverse; no entries between bodies.
    starts : ndarray of int, shape (n_bodies,)
        First coordinate of each body that moves.
    sizes : ndarray, shape (n_bodies,)
        What twice the energy of a body is when it turns with 1 rad/s or shifts by its size in a second [J].
    tied : ndarray, shape (n_bodies,)
        What it is when a body shifts by the size of all that is tied to it: a turn anywhere in a chain of
        bodies moves those beyond it, the farther the longer the chain is [J].
    shared : ndarray, shape (n_bodies,)
        The same of all together that are tied to it [J].
    members : ndarray, shape (n_bodies,)
        How many these are.
    places : ndarray of int, shape (n, n_dim)
        Coordinates that all change alike where a body shifts, one body after the other.
    placed : ndarray of int, shape (n_bodies,)
        Rows at which those of each body begin.
    masses : ndarray, shape (n_bodies,)
        [kg]
    axes : ndarray of int, shape (n_axes, 3)
        Coordinates of unit vectors that turn with bodies and sections in space: about a slender body's axis
        hardly any mass moves, however far it turns.
    directions, firsts : ndarray of int, shape (n,) and (n_directions,)
        Coordinates of vectors that turn with bodies, and of angles, one after the other; where each begins.
    bare : ndarray of bool, shape (n_bodies,)
        Which bodies have none.
    wide : ndarray, shape (n_bodies,)
        What twice the energy of a body is when it shifts by the size of the scene in a second [J].
    turning : ndarray, shape (n_x,)
        What the metric counts besides of squares of directions and angles, so that a body which turns by one
        radian has moved by about one in them: in thin sections hardly any mass moves with these, and the
        stiffness of a scene over its mass would be that of motions which nobody looks at.
    """

    metric: Matrix
    starts: IntArray
    sizes: Array
    tied: Array
    shared: Array
    members: Array
    places: IntArray
    placed: IntArray
    masses: Array
    axes: IntArray
    directions: IntArray
    firsts: IntArray
    bare: BoolArray
    wide: Array
    turning: Array

    def size(self, dx: Array) -> float:
        """Return how far what moves or turns most does in changes (1, n_x): about an angle [rad]."""
        turns = np.linalg.norm(dx[0, self.axes], axis=1)
        momenta = np.asarray(dx @ self.metric)[0, self.places]
        shifting = np.sum(np.add.reduceat(momenta, self.placed) ** 2, axis=1) / self.masses
        moved = (self._each(dx) - shifting) / self.sizes + shifting / self.tied
        return max(_largest(moved), float(turns.max(initial=0.0)))

    def turns(self, dx: Array) -> Array:
        """Return by what angles all that turns does in changes (1, n_x), (n_directions + n_bare,) [rad]."""
        turns = self._along(dx)
        if self.bare.any():
            turns = np.append(turns, np.abs(self._each(dx)[self.bare] / self.sizes[self.bare]))
        return np.asarray(np.sqrt(turns))

    def drawn(self, x: Array) -> float:
        """Return how long the longest direction is at coordinates (1, n_x): about one, but for angles."""
        vectors = np.diff(self.firsts, append=len(self.directions)) > 1
        return _largest(self._along(x)[vectors])

    def _along(self, x: Array) -> Array:
        """Return the square of each direction or angle in coordinates (1, n_x), (n_directions,)."""
        return np.add.reduceat(x[0, self.directions] ** 2, self.firsts) if len(self.firsts) else np.zeros(0)

    def far(self, dx: Array) -> float:
        """Return how far what shifts most does in changes (1, n_x), over the size of the scene."""
        return _largest(self._each(dx) / self.wide)

    def _each(self, dx: Array) -> Array:
        """Return twice the energy of each body with rates (1, n_x), (n_bodies,)."""
        return np.add.reduceat((dx * np.asarray(dx @ self.metric))[0], self.starts)

    @cached_property
    def whole(self) -> Matrix:
        """The metric with each body's share over its size, and its directions, (n_x, n_x)."""
        return self._weighed(self.sizes, self.turning)

    @cached_property
    def together(self) -> Matrix:
        """The same of what is tied together: a chain of many bodies that turns has moved by one as well."""
        return self._weighed(self.shared, self.turning * self._over(self.members))

    def _weighed(self, sizes: Array, turning: Array) -> Matrix:
        weights = self._over(sizes)
        if is_sparse(self.metric):
            from scipy.sparse import diags_array

            return (diags_array(weights) @ self.metric + diags_array(turning)).tocsr()
        return weights[:, None] * self.metric + np.diag(turning)

    @cached_property
    def unit(self) -> Array:
        """By what each coordinate changes where its body has moved by about one, (n_x,)."""
        return np.asarray(1.0 / np.sqrt(self.whole.diagonal()))

    @cached_property
    def broad(self) -> Array:
        """By what each changes where its body turns by one or shifts by the size of the scene, (n_x,)."""
        return np.asarray(1.0 / np.sqrt(self._over(self.wide) * self.metric.diagonal() + self.turning))

    def _over(self, sizes: Array) -> Array:
        """Return one over what each body has, for each of its coordinates, (n_x,)."""
        return np.repeat(1.0 / sizes, np.diff(np.append(self.starts, len(self.turning))))


def _largest(squares: Array) -> float:
    """Return the root of the largest of squares, which rounding may have below zero."""
    return float(np.sqrt(np.abs(squares).max(initial=0.0)))


def resisting(metric: Matrix, motions: Array) -> Matrix:
    """Return what resists motions (k, n) and little else, as much as a metric (n, n) does, shape (n, n).

    Where that is sparse, it holds as few coordinates as it can.
    """
    if is_sparse(metric):
        sizes = metric.diagonal()
        held = spanning((motions * np.sqrt(sizes)).T)
        return assemble([Entries(held, held, sizes[held])], metric.shape, sparse=True)
    weighed = np.asarray(motions @ metric)
    squares, ways = np.linalg.eigh(weighed @ motions.T)
    there = squares > ALIKE * squares[-1]
    unit = (ways[:, there] / np.sqrt(squares[there])).T @ weighed
    return np.asarray(unit.T @ unit)
