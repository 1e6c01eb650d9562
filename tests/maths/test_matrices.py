"""Least steps that close gaps: dense and by sparse factors, with rows that depend on one another."""

import numpy as np
import pytest

from hfsim.maths.matrices import DENSE_UP_TO, smallest_step


@pytest.mark.parametrize("n", [40, 4 * DENSE_UP_TO + 8])
def test_the_smallest_step_is_that_of_least_squares(n):
    rng = np.random.default_rng(1)
    J = rng.normal(size=(n // 2, n)) * (rng.random((n // 2, n)) < 0.1)
    J[-1] = J[0] + J[1]  # redundant, as joints of closed loops may be
    gap = J @ rng.normal(size=n)
    step = smallest_step(J, gap)
    assert J @ step == pytest.approx(gap, abs=1e-8)
    assert step == pytest.approx(np.linalg.lstsq(J, gap, rcond=1e-10)[0], abs=1e-8)
