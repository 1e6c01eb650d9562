"""Dependent joint equations: few by a dense decomposition, many by sparse factors."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from hfsim.maths.rank import by_joint, dependence

ROWS = 400


def chain(rows=ROWS):
    """Rows of a long chain: each touches five columns, and its neighbours three of these."""
    J, rng = np.zeros((rows, 2 * rows + 3)), np.random.default_rng(1)
    for k in range(rows):
        J[k, 2 * k : 2 * k + 5] = rng.normal(size=5)
    return J


def measured(J):
    n_rows = J.shape[0]
    rows = [slice(k, k + 2) for k in range(0, n_rows, 2)]
    return dependence(J, rows, {f"j{k}": [k] for k in range(len(rows))})


@pytest.mark.parametrize("repeated", [0, 1, 30])
def test_sparse_factors_find_what_the_decomposition_finds(repeated):
    J = chain()
    for k in range(10, 10 + 10 * repeated, 10):
        J[k + 2] = 2.0 * J[k] - J[k + 1]
    dense, sparse = measured(J), measured(csr_array(J))
    assert dense.missing == sparse.missing == repeated
    if repeated:
        assert sparse.joints == dense.joints
        assert max(sparse.size, dense.size) < 1e-14


@pytest.mark.parametrize("apart", [1e-4, 1e-7])
def test_sparse_factors_tell_how_near_to_dependence_rows_are(apart):
    J = chain()
    J[100] = J[90] + apart * J[100]
    dense, sparse = measured(J), measured(csr_array(J))
    assert sparse.missing == 0
    assert sparse.size == pytest.approx(dense.size, rel=0.1)
    assert apart / 10 < sparse.size < apart


@pytest.mark.parametrize("arm", [1e-3, 1.0, 1e3])
def test_what_joints_block_does_not_depend_on_how_each_is_written(arm):
    """Each row of a joint plus many times the other one; the first of the next joint is all but in it."""
    J, mixed = chain(), np.eye(ROWS)
    J[102] = J[100] + 1e-4 * J[102]
    mixed[::2, 1::2] += arm * np.eye(ROWS // 2)
    rows, joints = [slice(k, k + 1) for k in range(ROWS)], {f"j{k}": [k, k + 1] for k in range(0, ROWS, 2)}
    plain, written = (by_joint(one, rows, joints) for one in (J, mixed @ J))
    for k in range(0, ROWS, 2):
        assert plain[k : k + 2] @ plain[k : k + 2].T == pytest.approx(np.eye(2), abs=1e-9)
        assert abs(np.linalg.det(plain[k : k + 2] @ written[k : k + 2].T)) == pytest.approx(1.0)
    expected = dependence(plain, rows, joints)
    sparse = by_joint(csr_array(mixed @ J), rows, joints)
    for found in (dependence(written, rows, joints), dependence(sparse, rows, joints)):
        assert found.missing == 0 and found.size == pytest.approx(expected.size, rel=1e-2)


def test_rows_of_a_joint_that_depend_on_one_another_are_nothing():
    J = chain(6)
    J[1] = 2.0 * J[0]
    rows = [slice(0, 2), slice(2, 6)]
    for kind in (J, csr_array(J)):
        found = dependence(by_joint(kind, rows, {"a": [0]}), rows, {"a": [0], "b": [1]})
        assert (found.missing, found.joints) == (1, ("a",)) and found.size < 1e-15


def test_more_rows_than_columns():
    J = csr_array(np.random.default_rng(2).normal(size=(300, 60)))
    assert measured(J).missing == measured(J.toarray()).missing == 240


def test_more_rows_than_columns_of_which_the_last_alone_hold_some():
    J = np.random.default_rng(3).normal(size=(60, 10))
    J[:40] = J[:40, :2] @ J[40:42]
    for kind in (J, csr_array(J)):
        found = measured(kind)
        assert found.missing == 50
        assert len(found.joints) == 30
    J[:, 9] = 0.0
    J[58, 9] = 1.0
    assert measured(J).missing == 50
    assert "j29" in measured(J).joints and "j0" in measured(J).joints


def test_rows_of_zeros_are_dependent():
    J = np.vstack([chain(300), np.zeros((2, 603))])
    assert measured(J).missing == measured(csr_array(J)).missing == 2
    assert measured(csr_array(J)).joints == ("j150",)


@pytest.mark.filterwarnings("error")
def test_rows_of_zeros_are_missing_without_a_warning():
    found = measured(csr_array((ROWS, 5)))
    assert found.missing == ROWS


def test_in_a_long_loop_the_part_of_each_joint_is_small():
    J = np.eye(ROWS) - np.roll(np.eye(ROWS), 1, axis=1)
    found = dependence(J, [slice(k, k + 1) for k in range(ROWS)], {f"j{k}": [k] for k in range(ROWS)}, 0.06)
    assert found.missing == 1 and len(found.joints) == ROWS
