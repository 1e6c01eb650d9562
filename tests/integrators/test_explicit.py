"""The explicit method: its coefficients, its steps at the limit of stability and behind breaks."""

import numpy as np
import pytest
from integrated import integrate
from integrators.test_integrators import FREE, oscillator, problem_of, run

from hfsim.integrators import Limits, Problem
from hfsim.integrators._iteration import Place
from hfsim.integrators._nystrom import Step, _alone, _public, order_6, order_8
from hfsim.integrators._trajectory import Segment
from hfsim.integrators.explicit import Explicit


def test_the_coefficients_are_those_that_scipy_shows_everybody():
    alone = _alone()
    assert alone is not None
    for one, other in zip(alone(), _public(), strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("table", [order_6(), order_8()], ids=["6", "8"])
def test_the_tables_meet_the_conditions_of_their_orders(table):
    """Of quadrature at the end, and of the double integral."""
    c = table.nodes
    for k in range(table.order):
        assert table.b @ c**k == pytest.approx(1.0 / (k + 1), abs=1e-14)
    for k in range(table.order - 1):
        assert table.b2 @ c**k == pytest.approx(1.0 / ((k + 1) * (k + 2)), abs=1e-14)
    assert not np.triu(table.A).any() and (c[0], c[table.end - 1]) == (0.0, 1.0)


def test_the_pair_of_order_8_meets_them_at_every_stage():
    table = order_8()
    assert table.A.sum(axis=1) == pytest.approx(table.nodes, abs=1e-14)
    assert np.array_equal(table.A[table.end - 1], table.b)


def swing():
    return Problem(lambda t, q, v: -np.sin(q) * (1.0 + 0.5 * np.cos(t))[:, None], None, False)


def composed(problem, place, count=1):
    """Make steps of the composition; return their end, and the last of them with what is inside it."""
    table, (t, q, v, h) = order_6(), place
    for _ in range(count):
        step = Step(problem, table, Place(t, q, v, h))
        end = step.end(step.stages(problem.single(t, q, v)))
        last, (t, q, v) = Segment(t, h, q, v, end.series), (t + h, end.q, end.v)
    return q, v, last


def test_the_composition_ends_with_a_kick():
    table = order_6()
    assert table.A.sum(axis=1)[-1] == pytest.approx(1.0 - table.b[-1], abs=1e-15)


def test_the_composition_is_of_order_6_also_where_time_and_state_mix():
    problem, start = swing(), (0.0, np.array([1.2]), np.array([0.4]))
    true, *_ = composed(problem, Place(*start, 3.0 / 512), 512)
    errors = [float(abs(composed(problem, Place(*start, 3.0 / n), n)[0] - true)[0]) for n in (8, 16, 32)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders == pytest.approx([6.0, 6.0], abs=0.6)


def test_the_composition_is_undone_by_steps_back():
    problem, h = swing(), 0.3
    start = np.array([1.2]), np.array([0.4])
    q, v, _ = composed(problem, Place(0.0, *start, h))
    back = composed(problem, Place(h, q, v, -h))
    assert np.abs(np.subtract(back[:2], start)).max() < 1e-15


def test_inside_the_composition_the_motion_is_smooth_and_right():
    problem, start = swing(), (0.0, np.array([1.2]), np.array([0.4]))
    errors = []
    for h in (0.4, 0.2):
        q, v, inside = composed(problem, Place(*start, h))
        positions, rates = inside.at(np.array([0.25 * h, h]))
        true, *_ = composed(problem, Place(*start, 0.25 * h / 64), 64)
        assert (positions[1], rates[1]) == (pytest.approx(q), pytest.approx(v))
        errors.append(abs(positions[0] - true)[0])
    assert errors[0] < 1e-5 and errors[0] / errors[1] == pytest.approx(2.0**6, rel=0.3)


def test_only_rough_steps_of_accelerations_by_position_alone_are_composed():
    by_position, damped = swing(), oscillator([1.0])
    damped.dissipates = True
    assert by_position.positional and not damped.positional
    assert Explicit(1e-3).table(by_position) is order_6()
    assert order_8() is Explicit(1e-3).table(damped) is Explicit(1e-4).table(by_position)
    assert Explicit(1e-3, step=0.1).table(by_position) is order_8()


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


def test_a_limit_of_the_step_is_forgotten_and_no_number_ends():
    """After 142,000 steps without a rejection the factor on the limit was none that Python has."""
    stepper = Explicit(1e-6).start(problem_of(lambda t, q, v: -q), 0.0, np.ones(1), np.zeros(1))
    stepper.attempt(0.0, np.ones(1), np.zeros(1), 1e-3)
    stepper._served = 200_000
    stepper.accept(1e-3, np.ones(1), np.zeros(1))
    assert stepper._cap == np.inf
