"""Places that lead others along."""

import numpy as np
import pytest

from hfsim.maths.matrices import dense
from hfsim.mechanics.leading import Leading
from hfsim.mechanics.reduction import Reduction


def chain(sparse, columns=12):
    """Four places, the first of which may be left out as it stands still."""
    reduction = Reduction.nothing(columns, sparse)
    return reduction, np.arange(columns).reshape(-1, 3)


@pytest.mark.parametrize("sparse", [False, True])
def test_relative_changes_are_those_from_place_to_place(sparse, rng):
    reduction, places = chain(sparse)
    found, change = Leading.of([places], reduction), rng.normal(size=(2, 12))
    steps = change.reshape(2, 4, 3).copy()
    steps[:, 1:] -= change.reshape(2, 4, 3)[:, :-1]
    assert found.relative(change) == pytest.approx(steps.reshape(2, 12), abs=1e-14)
    assert found.absolute(found.relative(change)) == pytest.approx(change, abs=1e-14)
    force = rng.normal(size=(2, 12))
    work = np.sum(force * found.absolute(change), axis=1)
    assert np.sum(found.forces(force) * change, axis=1) == pytest.approx(work)


@pytest.mark.parametrize("sparse", [False, True])
def test_a_chain_begins_where_its_first_place_is(sparse, rng):
    """That is half of the way between those of another chain, or of what is none and does not lead."""
    basis = np.eye(12)[:, 3:]
    basis[0:3, 3:6] = basis[0:3, 6:9] = 0.5 * np.eye(3)
    rows = np.arange(3, 12)
    reduction = Reduction.nothing(12, sparse)
    kind = type(reduction.basis) if sparse else np.asarray
    reduction = Reduction(kind(basis), np.zeros(12), frozenset(), np.zeros(0, dtype=np.intp), rows)
    one, other = np.arange(12).reshape(2, 2, 3)
    found, change = Leading.of([one, other], reduction), rng.normal(size=(1, 9))
    expected = change.copy()
    expected[0, :3] -= 0.5 * (change[0, 3:6] + change[0, 6:9])
    expected[0, 6:] -= change[0, 3:6]
    assert found.relative(change) == pytest.approx(expected, abs=1e-14)
    assert np.linalg.det(dense(found.matrix)) == pytest.approx(1.0)
    assert Leading.of([one], reduction) is None


@pytest.mark.parametrize("sparse", [False, True])
def test_what_leads_itself_does_not_lead(sparse):
    reduction, places = chain(sparse)
    assert Leading.of([places, places[[3, 0]]], reduction) is None
    assert Leading.of([places[:1], places[:0]], reduction) is None
