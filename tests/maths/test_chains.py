"""Linear equations of chains against full matrices."""

import numpy as np
import pytest

from hfsim.maths.chains import solve_chain
from hfsim.maths.replayed import Replayed


def chain(rng, batch, n, k):
    """Blocks and couplings of a positive definite matrix, and that itself."""
    blocks, couplings = rng.normal(size=(batch, n, k, k)), rng.normal(size=(batch, n - 1, k, k))
    blocks = blocks @ blocks.swapaxes(2, 3) + 4.0 * k * np.eye(k)
    whole = np.zeros((batch, n, k, n, k))
    for i in range(n):
        whole[:, i, :, i] = blocks[:, i]
    for i in range(n - 1):
        whole[:, i, :, i + 1] = couplings[:, i]
        whole[:, i + 1, :, i] = couplings[:, i].swapaxes(1, 2)
    return blocks, couplings, whole.reshape(batch, n * k, n * k)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8, 11, 16])
@pytest.mark.parametrize("k", [1, 4])
def test_a_chain_is_solved_as_its_full_matrix(n, k, rng):
    blocks, couplings, whole = chain(rng, 3, n, k)
    right = rng.normal(size=(3, n, k, 5))
    given = [one.copy() for one in (blocks, couplings, right)]
    found = solve_chain(blocks, couplings, right)
    expected = np.linalg.solve(whole, right.reshape(3, n * k, 5)).reshape(right.shape)
    assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()
    assert all((a == b).all() for a, b in zip(given, (blocks, couplings, right), strict=True))
    again = Replayed(solve_chain)
    assert np.abs(again(blocks, couplings, right) - found).max() <= 1e-13 * np.abs(found).max()


def test_a_block_without_an_inverse_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        solve_chain(np.zeros((1, 2, 1, 1)), np.ones((1, 1, 1, 1)), np.ones((1, 2, 1, 1)))
