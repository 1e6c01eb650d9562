"""Equilibrium or steady rotation next to a state: Newton's iteration, in axes that turn if need be."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.pencils import Pencil
from hfsim.mechanics.small_motions import resistance, stiffness
from hfsim.mechanics.system import System
from hfsim.mechanics.turning import Turning

_MOST = 40
_CONVERGED = 1e-11
"""Step over the largest coordinate, or one, at which the iteration ends."""
_LONGEST = 0.2
"""Longest step, likewise."""
_FREE = 1e-9
"""What holds motions that nothing brings back, over the square of the fastest frequency."""


def steady_state(system: System, t: float, x: Array, turning: Turning) -> Array:
    """Return the absolute coordinates (n_x,), next to some, that turn without a change of shape.

    With a spin of zero they are at rest.

    Raises
    ------
    numpy.linalg.LinAlgError
        If none is found.
    """
    equations, reduction, time = system.equations, system.reduction, np.array([t])
    z, multipliers = reduction.free(x[None]), np.zeros((1, equations.n_rows))
    W, size = turning.matrix, max(1.0, float(np.abs(x).max()))
    for _ in range(_MOST):
        place = reduction.expand(z)
        u, a = turning.rates(place), turning.accelerations(place)
        whole = equations.mass(place)[0] if system.variable_mass else equations.constant_mass
        K = stiffness(system, time, place, u, a, multipliers)
        K = reduction.reduced(K + resistance(system, time, place, u) @ W + whole @ W @ W)
        M, J = reduction.reduced(whole), equations.phi.jacobian_at(place) @ reduction.basis
        pencil = Pencil(M, 0.0 * M, K, J)
        force = reduction.free_force(system.force(time, place, u) - equations.momentum(place, a))
        M, _, K, J = pencil.matrices
        left = force[0] - J.T @ multipliers[0]
        gap = -equations.phi.residual(time, place)[0]
        step, more = pencil.answer(K + _FREE * pencil.fastest * M, left, gap)
        longest = float(np.abs(step).max())
        short = min(1.0, _LONGEST * size / max(longest, float(np.finfo(float).tiny)))
        z, multipliers = z + short * step, multipliers + short * more
        if longest <= _CONVERGED * size:
            return np.asarray(reduction.expand(z)[0])
    raise np.linalg.LinAlgError("no state that lasts was found next to it")
