"""The explicit method: its coefficients, its steps at the limit of stability and behind breaks."""

import numpy as np
import pytest
from integrators.test_integrators import FREE, oscillator, run

from hfsim.integrators import Limits, Problem, integrate
from hfsim.integrators._nystrom import _alone, _public, order_8


def test_the_coefficients_are_those_that_scipy_shows_everybody():
    alone = _alone()
    assert alone is not None
    for one, other in zip(alone(), _public(), strict=True):
        assert np.array_equal(one, other)


def test_the_table_meets_the_conditions_of_its_order():
    """Of quadrature, at every stage and at the end, and of the double integral."""
    table = order_8()
    c = table.nodes
    for k in range(8):
        assert table.b @ c**k == pytest.approx(1.0 / (k + 1), abs=1e-14)
    for k in range(7):
        assert table.b2 @ c**k == pytest.approx(1.0 / ((k + 1) * (k + 2)), abs=1e-14)
    assert table.A.sum(axis=1) == pytest.approx(c, abs=1e-14)
    assert not np.triu(table.A).any() and c[table.end - 1] == 1.0
    assert np.array_equal(table.A[table.end - 1], table.b)


def test_few_steps_are_rejected_at_the_limit_of_stability():
    """A stiff mode that hardly moves sets the length of the steps: each attempt to lengthen them fails."""
    problem = oscillator([1.0, 1e6])
    trajectory, stop = run(problem, FREE["explicit"](1e-5), [1.0, 1e-6], [0.0, 0.0], 10.0)
    assert stop is None and trajectory.q[0] == pytest.approx(np.cos(10.0), abs=1e-6)
    counts = problem.counts
    assert counts.steps < 2000
    assert counts.rejected < 0.1 * counts.steps


def test_accelerations_that_jump_are_not_taken_over_a_break():
    """Not even where rounding has the step before it end a last digit early."""
    start, jump = 0.0683823211598652, 1.148222951304225
    assert start + (jump - start) < jump
    problem = Problem(
        lambda t, q, v: np.where(t[:, None] < jump, 1.0, 3.0) + 0.0 * q, None, False, breaks=np.array([jump])
    )
    begun = start, np.zeros(1), np.zeros(1)
    trajectory, stop = integrate(problem, FREE["explicit"](1e-6), begun, 2.0, Limits(5.0), lambda *_: None)
    assert stop is None and len(trajectory.segments) == 2
    assert trajectory.v[0] == pytest.approx((jump - start) + 3.0 * (2.0 - jump), abs=1e-13)
