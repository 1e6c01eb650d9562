"""Least steps that close gaps, where rows depend on one another; how sparse factors fill."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from hfsim.maths.matrices import DENSE_UP_TO, factorised, ordering, smallest_step


@pytest.mark.parametrize("n", [40, 4 * DENSE_UP_TO + 8])
def test_the_smallest_step_is_that_of_least_squares(n):
    rng = np.random.default_rng(1)
    J = rng.normal(size=(n // 2, n)) * (rng.random((n // 2, n)) < 0.1)
    J[-1] = J[0] + J[1]  # redundant, as joints of closed loops may be
    gap = J @ rng.normal(size=n)
    step = smallest_step(J, gap)
    assert J @ step == pytest.approx(gap, abs=1e-8)
    assert step == pytest.approx(np.linalg.lstsq(J, gap, rcond=1e-10)[0], abs=1e-8)


def bordered(bodies, nodes, links):
    """A sparse matrix of chains, one after the other, each with two long rows that couple all of it."""
    n = bodies * nodes
    whole = np.diag(np.full(n, 4.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    for first in range(0, n, nodes):
        for k in range(links):
            whole[first + k, first : first + nodes] += 0.01
            whole[first : first + nodes, first + k] += 0.01
    return csc_array(whole)


@pytest.mark.parametrize(("bodies", "nodes", "links"), [(1, 400, 0), (1, 400, 2), (3, 130, 2), (5, 100, 4)])
def test_columns_are_ordered_so_that_factors_fill_little(bodies, nodes, links):
    matrix = bordered(bodies, nodes, links)
    factor = splu(matrix, permc_spec=ordering(matrix))
    assert factor.L.nnz + factor.U.nnz < 2.5 * matrix.nnz
    right = np.cos(np.arange(matrix.shape[0]))
    assert matrix @ factorised(matrix)(right) == pytest.approx(right, abs=1e-13)
