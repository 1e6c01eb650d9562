"""How much of rates each of some motions makes, and what is left of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hfsim.maths.arrays import Array

if TYPE_CHECKING:
    from hfsim.mechanics.equations import Equations

SINGULAR = 1e-9
"""Part of its energy in others from which down a rigid motion is one by itself."""
NOISE = 10.0
"""Factor on rounding, and on the relative error of a fit, below which a share of it is none."""
CANCELLED = 1e2
"""Energy of own turns that rates leave open, over that of all, beyond which they undo what is not there."""
_ROUNDING = 1e-12
"""The least relative error."""


def nearest(equations: Equations, x: Array, columns: Array, wanted: Array) -> tuple[Array, float]:
    """Return factors (k,) of rates (k, n_x) that come nearest to wanted ones, and twice the energy left."""
    if not len(columns):
        return np.zeros(0), float(equations.momentum(x[None], wanted[None])[0] @ wanted)
    momenta = equations.momentum(x[None], columns)
    sizes = np.sqrt(np.maximum(np.sum(momenta * columns, axis=1), 0.0))
    there = sizes > SINGULAR * sizes.max()
    scale = np.where(there, 1.0, 0.0) / np.where(there, sizes, 1.0)
    gram = (momenta @ columns.T) * np.outer(scale, scale)
    factors = scale * (np.linalg.pinv(gram, rcond=SINGULAR, hermitian=True) @ (scale * (momenta @ wanted)))
    left = wanted - factors @ columns
    return factors, float(equations.momentum(x[None], left[None])[0] @ left)


def evening(equations: Equations, x: Array, columns: Array, count: int) -> Array:
    """Return factors (n_x,) that make coordinates alike: lengths, those that shifts change, over the size.

    Of rates (k, n_x) at x (n_x,), the first are rotations about the centre of mass and the others shifts.
    """
    lengths = columns[count:].any(axis=0)
    energies = np.sum(equations.momentum(x[None], columns) * columns, axis=1)
    # a body alone does not move in its turns, but has a radius of gyration
    around = np.sqrt(energies[:count].max() / energies[count]) if energies[count] > 0.0 else 0.0
    size = max(float(around), float(np.abs(columns[:count, lengths]).max(initial=0.0)))
    return np.where(lengths, 1.0 / size if size > 0.0 else 1.0, 1.0)


def split(
    equations: Equations,
    x: Array,
    u: Array,
    a: Array,
    noise: float,
    every: Array,
    whirls: Array,
    even: Array,
    shared: int,
    unlike: bool,
) -> tuple[Array, float] | None:
    """Return factors (k,) of rates (k, n_x) that make rates and accelerations, and the relative error.

    Parameters
    ----------
    x, u, a : ndarray, shape (n_x,)
    noise : float
        Twice the energy that accelerations by rounding would be as rates.
    every, whirls : ndarray, shape (k, n_x)
        Rates, and accelerations that go with them.
    even : ndarray, shape (n_x,)
        What makes coordinates alike.
    shared : int
        Those of everything, before those of single bodies; none of them is wanted where the others do.
    unlike : bool
        Whether those of everything alone do not make the rates.

    Returns
    -------
    tuple or None
        None where they do not make the rates or, as far as these leave them open, the accelerations.
    """
    energy, size = (float(equations.momentum(x[None], one[None])[0] @ one) for one in (u, a))
    factors, missed, idle = least(even * every, even * u)
    factors = factors + nearest(equations, x, idle @ whirls, a - factors @ whirls)[0] @ idle
    alone, error, _ = least(even * every[shared:], even * u)
    own = np.sum(equations.momentum(x[None], every[shared:]) * every[shared:], axis=1)
    for one in (np.concatenate([np.zeros(shared), alone]), factors):
        parts = u - one @ every, a - one @ whirls
        left, rest = (float(equations.momentum(x[None], part[None])[0] @ part) for part in parts)
        made = energy > 0.0 and left <= SINGULAR * energy
        # where rates alone tell, what does not last yet accelerates by more
        told = not len(idle) or (unlike and one is not factors)
        made = made and (told or rest <= SINGULAR * size + noise)
        made = made and (not len(idle) or one[shared:] ** 2 @ own <= CANCELLED * energy)
        if made and (one is factors or error <= NOISE * (missed + _ROUNDING)):
            blur = float(np.sqrt(rest / size)) if size and not told else 0.0
            return without_noise(even * every, even * u, one, missed + blur), missed
    return None


def least(columns: Array, wanted: Array) -> tuple[Array, float, Array]:
    """Return factors (k,) of rates (k, n) by least squares, the relative error, and what changes nothing.

    The latter are combinations of factors, (n_idle, k).
    """
    sizes = np.linalg.norm(columns, axis=1)
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    left, values, ways = np.linalg.svd((columns / sizes[:, None]).T, full_matrices=False)
    told = values > SINGULAR**0.5 * values.max(initial=0.0)
    factors = ((left.T[told] @ wanted) / values[told]) @ ways[told] / sizes
    missed = float(np.linalg.norm(wanted - factors @ columns))
    return factors, missed / (float(np.linalg.norm(wanted)) or 1.0), ways[~told] / sizes


def without_noise(columns: Array, wanted: Array, factors: Array, error: float) -> Array:
    """Return factors (k,) with those at zero that are no more than a relative error of the whole makes."""
    sizes = np.abs(factors) * np.linalg.norm(columns, axis=1)
    kept = sizes > NOISE * (error + _ROUNDING) * sizes.max()
    found = np.where(kept, factors, 0.0)
    found[kept] += least(columns[kept], wanted - found @ columns)[0]
    return found
