"""Eigenvectors of matrices some of whose entries are rounding, in motions that constraints allow."""

import numpy as np
import pytest

from hfsim.maths.eigenpairs import _corrected, eigenpairs
from hfsim.maths.eigenvectors import allowed, eigenvectors
from hfsim.maths.pencils import Pencil

ROUNDED = np.array([
    [0.0, 0.0, 0.0, 0.0, -2.64e-34],
    [0.0, 0.0, 0.0, -4.94e-33, 0.0],
    [9.40e-34, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, -1.72e-50],
    [-1.02e-33, 0.0, 1.06e-05, -1.72e-50, -3.39e-04],
])  # fmt: skip
"""Five coordinates of an arm, of which two move; scales that make rows as large as columns are 1e22."""


def test_rounding_does_not_become_the_shape_of_everything():
    values, vectors = eigenvectors(ROUNDED)
    assert np.linalg.norm(vectors, axis=0) == pytest.approx(np.ones(5))
    assert np.abs(ROUNDED @ vectors - vectors * values).max() < 1e-12 * np.abs(ROUNDED).max()
    assert np.abs(vectors[[0, 1, 2, 3], np.argmax(np.abs(values))]).max() < 1e-12


def test_eigenvectors_of_graded_matrices_keep_their_small_values():
    sizes = np.logspace(0.0, -12.0, 7)
    mixed = np.random.default_rng(3).standard_normal((7, 7)) + 4.0 * np.eye(7)
    graded = sizes[:, None] * mixed / sizes
    found, wanted = eigenvectors(graded)[0], np.linalg.eigvals(mixed)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(wanted), rel=1e-9)


def test_matrices_without_numbers_are_refused():
    with pytest.raises(np.linalg.LinAlgError):
        eigenvectors(np.array([[1.0, np.nan], [0.0, 1.0]]))


def test_constraints_leave_coordinates_as_they_are():
    rng = np.random.default_rng(5)
    J = rng.standard_normal((3, 8)) * np.logspace(-3.0, 6.0, 3)[:, None]
    basis, own = allowed(J)
    assert np.abs(J @ basis / np.abs(J).max(axis=1)[:, None]).max() < 1e-14
    assert np.array_equal(basis[own], np.eye(5))
    assert np.array_equal(allowed(np.zeros((0, 2)))[0], np.eye(2))


@pytest.mark.parametrize("resistance", [0.0, 0.02])
def test_eigenproblems_of_small_pencils_hold_no_motion_that_is_forbidden(resistance, monkeypatch):
    """Here the stiffness is not symmetric, so that squares are found by their vectors, too."""
    sizes = []

    def seen(matrix):
        sizes.append(len(matrix))
        return eigenvectors(matrix)

    monkeypatch.setattr("hfsim.maths.eigenpairs.eigenvectors", seen)
    monkeypatch.setattr("hfsim.maths.squares.eigenvectors", seen)
    rng = np.random.default_rng(2)
    root = rng.standard_normal((7, 7))
    K = root @ root.T + np.triu(0.1 * rng.standard_normal((7, 7)))
    J = rng.standard_normal((3, 7))
    found = eigenpairs(Pencil(np.eye(7), resistance * K, K, J), 9)
    assert sizes and set(sizes) == ({4, 8} if resistance else {4})
    assert np.abs(J @ found.vectors).max() < 1e-12 * np.abs(found.vectors).max()
    Z = np.linalg.svd(J)[2][3:].T
    squares = np.linalg.eigvals(Z.T @ K @ Z)
    for value in found.values:
        own = -(value**2) / (1.0 + resistance * value)
        assert np.abs(squares - own).min() < 1e-9 * abs(own)


def test_an_eigenvalue_that_counts_twice_is_known_as_well_as_rounding_lets_it():
    """Next to it both what is left and its slope are rounding: their ratio says nothing."""
    one = np.eye(1)
    pencil = Pencil(one, 2.0 * 3.7 * one, 3.7**2 * one, np.zeros((0, 1)))
    for ulps in range(-6, 7):
        value, error = _corrected(pencil, -3.7 * (1.0 + ulps * np.finfo(float).eps), np.ones(1))
        assert abs(value + 3.7) < 1e-6 and error < 1e-6
