"""Whether small motions about a state that turns meet the same at every angle of the turn."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.matrices import Matrix
from hfsim.mechanics.nearest_rates import NOISE
from hfsim.studies.modes.state import EVEN, About


def stays_even(state: About, shapes: ComplexArray, rates: Array, uncertainty: Array) -> bool:
    """Tell whether modes meet the same stiffness, resistance and joints after a turn by one radian.

    Bearings that are not alike all around, for one, make the coefficients change with time as the axes turn.

    Parameters
    ----------
    state : About
    shapes : ndarray of complex, shape (k, n_x)
        Changes of the absolute coordinates.
    rates, uncertainty : ndarray, shape (k,)
        Sizes of their eigenvalues, and errors of these [1/s].
    """
    turning, system = state.turning, state.system
    if turning is None or not len(shapes):
        return True
    reduction, changes = system.reduction, np.concatenate([shapes.real, shapes.imag])
    turned = turning.along(changes, 1.0 / turning.rate)
    before, after = reduction.free_rates(changes), reduction.free_rates(turned)
    if not np.allclose(reduction.expand_rates(after), turned, atol=EVEN * float(np.abs(turned).max())):
        return False
    own, other = state.motions, state.turned
    gaps = np.abs(other.jacobian @ after.T).max(axis=0, initial=0.0)
    # rows along which nothing moves are rounding themselves
    held = abs(other.jacobian).max() if other.jacobian.shape[0] else 0.0
    sizes = held * np.tile(np.abs(after).reshape(2, len(shapes), -1).max(axis=(0, 2)), 2)
    stiffness = _form(other.stiffness, after) - _form(own.stiffness, before)
    resistance = _form(other.velocity, after) - _form(own.velocity, before)
    noise = NOISE * EVEN * (rates**2 + turning.rate**2) + NOISE * uncertainty * (rates + uncertainty)
    change = np.abs(stiffness) + rates * np.abs(resistance)
    even = np.all(change <= noise * _form(own.mass, before).sum(axis=0))
    # shapes that are known less well may miss joints by more
    unsure = EVEN + NOISE * np.tile(uncertainty / (rates + turning.rate), 2)
    return bool(even and np.all(gaps <= unsure * sizes))


def _form(matrix: Matrix, z: Array) -> Array:
    """Return z^T A z of real and imaginary parts (2 k, n) of shapes, shape (2, k)."""
    return np.asarray(np.sum(z.T * (matrix @ z.T), axis=0)).reshape(2, -1)
