"""Squares of slow frequencies by Lanczos' iteration, held against those of dense matrices."""

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_array, eye_array

from hfsim.maths import squares
from hfsim.maths.inertia import count_below
from hfsim.maths.pencils import Pencil

PAIR = np.array([[1.0, -1.0], [-1.0, 1.0]])
"""A spring between two masses, both of which go wherever they like."""


def pencil_of(stiffness):
    n = stiffness.shape[0]
    return Pencil(eye_array(n).tocsr(), csr_array((n, n)), csr_array(stiffness), csr_array((0, n)))


def graded(rng, zeros=160, levels=40):
    """Return a stiffness with many squares that are zero, and others of all sizes and both signs."""
    sizes = 10.0 ** np.linspace(2.0, -14.0, levels)
    every = np.concatenate([np.zeros(zeros), sizes, -sizes])
    basis = np.linalg.qr(rng.standard_normal((len(every), len(every))))[0]
    whole = (basis * every) @ basis.T
    return 0.5 * (whole + whole.T), every


@pytest.mark.parametrize("loose", [0, 30], ids=["pairs", "pairs and loose masses"])
def test_motions_that_nothing_holds_are_no_motions_without_mass(loose):
    """More of them than are looked for: a shift that comes ever nearer to zero says nothing more."""
    parts = [1e6 * PAIR] * 150 + [np.zeros((1, 1))] * loose
    found, _, _ = squares.slowest_squares(pencil_of(block_diag(parts)), 5)
    assert len(found) >= 5 and not found.any()


@pytest.mark.parametrize(
    ("whole", "most"), [(2000, 1000), (100, 7000)], ids=["all are computed", "what converges is taken"]
)
def test_many_squares_that_are_equal_end_the_iteration(whole, most, rng, monkeypatch):
    """They are found one after the other, by rounding: 50 000 solutions do not bring all of them."""
    monkeypatch.setattr(squares, "_WHOLE", whole)
    solved, own = [], Pencil.inverse

    def inverse(pencil, matrix):
        solve = own(pencil, matrix)
        return lambda forces: solved.append(forces.shape) or solve(forces)

    monkeypatch.setattr(Pencil, "inverse", inverse)
    stiffness, every = graded(rng)
    found = squares.squares_of(pencil_of(stiffness), 12)[0].real
    assert len(solved) < most
    assert 2 <= len(found) <= len(every) and (len(found) == len(every)) == (whole > len(every))
    assert (np.abs(found[:, None] - every).min(axis=1) < 1e-12 + 1e-3 * np.abs(found)).all()
    if len(found) == len(every):
        slow = every[np.abs(every) < 1e-3]
        assert np.sort(found[np.abs(found) < 1e-3]) == pytest.approx(np.sort(slow), rel=1e-5, abs=1e-12)


def test_what_grows_leaves_what_is_slow_in_place():
    """Both are told, where the state is unstable in more ways than motions were asked for."""
    every = np.concatenate([-np.linspace(0.01, 1.0, 43), 1e-3 * np.arange(1.0, 258.0) ** 2])
    found, _, complete, _ = squares.squares_of(pencil_of(np.diag(every)), 12)
    assert complete
    assert np.sort(found.real)[:55] == pytest.approx(np.sort(every)[:55], rel=1e-9)


@pytest.mark.parametrize(("trusted", "complete"), [(0.3, True), (-1.0, None)])
def test_it_is_told_where_slow_motions_cannot_be_counted(trusted, complete, monkeypatch):
    monkeypatch.setattr("hfsim.maths.inertia._TRUSTED", trusted)
    every = 1e3 * np.arange(-59.0, 241.0) + 500.0
    found, _, told = squares.slowest_squares(pencil_of(np.diag(every)), 5)
    assert told is complete
    if complete:
        assert len(found) >= 64
        assert np.sort(found.real) == pytest.approx(every[: len(found)], rel=1e-9)


@pytest.mark.parametrize(("off", "counted"), [(1e-12, True), (1e-15, False)])
def test_signs_of_factors_are_believed_unless_their_error_may_have_changed_one(off, counted):
    """Of a matrix with one eigenvalue that is as small as rounding none knows the sign."""
    basis = np.linalg.qr(np.random.default_rng(2).standard_normal((300, 300)))[0]
    every = np.concatenate([[-off], -np.linspace(1.0, 2.0, 30), np.linspace(1.0, 3.0, 269)])
    found = count_below(pencil_of((basis * every) @ basis.T), 0.0)
    assert found == (31 if counted else None)
