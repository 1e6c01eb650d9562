"""Sums in few places, and symmetric matrices that are made of them."""

from itertools import pairwise

import numpy as np
import pytest

from hfsim.maths import kernel
from hfsim.maths.replayed import Replayed
from hfsim.maths.scattered import ScatteredSums, SymmetricSums

N = 40
LINKS = {
    "band": list(pairwise(range(N))),
    "sparse": [((k - 1) // 4, k) for k in range(1, N)],
    "arrow": [(0, k) for k in range(1, N)],
}


def test_values_of_the_same_place_are_added_up():
    sums = ScatteredSums(np.array([2, 0, 2]), 4)
    assert sums.of(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])).tolist() == [[2, 0, 4, 0], [5, 0, 10, 0]]


def made(kind, rng):
    """Return sums of what links between rows contribute, values of two matrices, and these matrices."""
    numbers = rng.permutation(N)
    links = numbers[np.array(LINKS[kind])]
    pairs = [[np.arange(N)] * 2, links[:, [0, 0]].T, links[:, [1, 1]].T, links.T, links[:, ::-1].T]
    i, j = np.concatenate(pairs, axis=1)
    own, between = rng.uniform(1.0, 2.0, (2, N)), rng.uniform(-1.0, 1.0, (2, len(links)))
    values = np.concatenate([own, *[np.abs(between)] * 2, *[between] * 2], axis=1)
    whole = np.zeros((2, N, N))
    np.add.at(whole, (slice(None), i, j), values)
    return SymmetricSums.of(i, j, N), values, whole


@pytest.mark.parametrize("kind", LINKS)
def test_matrices_are_solved_with_factors_of_the_kind_that_takes_less(kind, rng):
    sums, values, whole = made(kind, rng)
    assert (sums.band is None) == (kind != "band")
    rhs = rng.normal(size=(2, N))
    right = np.linalg.solve(whole, rhs[..., None])[..., 0]
    solve = sums.factorised(values)
    assert solve(rhs) == pytest.approx(right, abs=1e-12)
    assert solve(2.0 * rhs) == pytest.approx(2.0 * right, abs=1e-12)
    with pytest.raises(np.linalg.LinAlgError):
        sums.factorised(0.0 * values)(rhs)


@pytest.mark.skipif(kernel.KERNEL != "native", reason="there is no native kernel")
@pytest.mark.parametrize("kind", LINKS)
def test_a_tape_factorises_anew(kind, rng):
    sums, values, whole = made(kind, rng)
    rhs, solved = rng.normal(size=(2, N)), Replayed(lambda values, rhs: sums.factorised(values)(rhs))
    for scale in (1.0, 2.0):
        right = np.linalg.solve(scale * whole, rhs[..., None])[..., 0]
        assert solved(scale * values, rhs) == pytest.approx(right, abs=1e-12)
    assert solved.refused is None
