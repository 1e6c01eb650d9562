"""What damping of beams with sections must be: slopes, power below zero, none of turning."""

from functools import partial

import numpy as np
import pytest
from tangents import forces

from hfsim.parts.elements.forces import MaterialDamping


def check_damping(scene, rng, turning):
    """Hold a scene against the laws of damping; ``turning`` are the freedoms of the body b that turn it."""
    (part,) = (one for one in scene.system.forces if isinstance(one, MaterialDamping))
    n, t, h = scene.system.n_x, np.zeros(1), 1e-6
    x = scene.system.absolute(scene.q[None]) + 0.1 * rng.normal(size=(1, n))
    u, d = rng.normal(size=(1, n)), rng.normal(size=n)
    force = partial(forces, part)
    for entries, slope in (
        (part.tangent(t, x, u), (force(x + h * d, u) - force(x - h * d, u)) / (2 * h)),
        (part.rate_tangent(t, x, u), (force(x, u + h * d) - force(x, u - h * d)) / (2 * h)),
    ):
        K = np.zeros((n, n))
        np.add.at(K, (entries.rows, entries.columns), entries.values)
        assert K @ d == pytest.approx(-slope[0], rel=1e-6, abs=1e-7 * np.abs(slope).max())
    assert part.power(t, x, u)[0] == pytest.approx(float(force(x, u)[0] @ u[0]), rel=1e-12)
    assert part.power(t, x, u)[0] < 0.0
    rate = scene.bodies["b"].freedoms(x[0])[turning]
    turns = np.pad(rate, ((0, 0), (0, n - rate.shape[1])))
    assert np.abs(force(np.repeat(x, len(turns), axis=0), turns)).max() < 1e-12
