# ruff: noqa: E501
"""Every integrator on small problems of known solution: order, tolerance, stability, cost, failure."""

from pathlib import Path

import numpy as np
import pytest
from integrated import integrate

import hfsim
from hfsim.errors import LimitReached, SolverFailure
from hfsim.integrators import Limits, Problem, Segment, Trajectory, _trajectory
from hfsim.integrators._tableau import gauss, legendre, radau
from hfsim.integrators._trajectory import two_point_series
from hfsim.integrators.collocation import CollocationMethod, CollocationStepper
from hfsim.integrators.energy import EnergyMethod
from hfsim.integrators.explicit import Explicit
from hfsim.integrators.gear import GEAR, GROWING, Gear
from hfsim.integrators.generalized_alpha import GeneralizedAlpha
from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

TIGHT = 1e-13


def free(t, q, v):
    return q, v


def problem_of(acceleration, dissipates=False, **more):
    return Problem(acceleration, free, dissipates, **more)


def oscillator(w2=1.0, damping=0.0):
    """Return q'' = -w2 q - damping q', each column by itself."""
    return problem_of(lambda t, q, v: -np.asarray(w2) * q - damping * v, damping > 0.0)


def swing():
    """Return a pendulum, q'' = -sin q, driven a little so that time counts too."""
    return problem_of(lambda t, q, v: -np.sin(q) + 0.3 * np.cos(2.0 * t)[:, None])


def run(problem, method, q, v, t_end, step=None, max_steps=None):
    start = (0.0, np.array(q, dtype=float), np.array(v, dtype=float))
    return integrate(problem, method, start, t_end, Limits(step, max_steps), lambda t, q, v: None)


def end_of(problem, method, q, v, t_end, step=None):
    trajectory, stop = run(problem, method, q, v, t_end, step)
    assert stop is None
    assert trajectory.t_end == t_end
    return np.concatenate([trajectory.q, trajectory.v])


FIXED = {
    **{
        f"gauss-{s}": (lambda h, s=s: CollocationMethod("gauss", gauss(s), TIGHT), 2 * s)
        for s in (1, 2, 3, 4)
    },
    **{
        f"radau-{s}": (lambda h, s=s: CollocationMethod("radau", radau(s), TIGHT), 2 * s - 1)
        for s in (1, 2, 3)
    },
    **{
        f"energy-{s}": (lambda h, s=s: EnergyMethod("energy", gauss(s), TIGHT), 2 * s) for s in (1, 2, 3, 4)
    },
    **{f"gear-{k}": (lambda h, k=k: Gear(TIGHT, h, k), k) for k in (1, 2, 3, 4, 5)},
    **{
        f"generalized_alpha-{r}": (lambda h, r=r: GeneralizedAlpha(TIGHT, r), 2) for r in (0.0, 0.5, 0.8, 1.0)
    },
    "explicit": (lambda h: Explicit(TIGHT), 8),
}
STEPS = {1: (400, 800), 2: (100, 200), 3: (80, 160), 4: (60, 120), 5: (80, 160), 6: (16, 32), 8: (8, 16)}
FREE = {
    "gauss": lambda tolerance: CollocationMethod("gauss", gauss(8), tolerance),
    "radau": lambda tolerance: CollocationMethod("radau", radau(6), tolerance),
    "energy": lambda tolerance: EnergyMethod("energy", gauss(4), tolerance),
    "gear": lambda tolerance: Gear(tolerance),
    "generalized_alpha": lambda tolerance: GeneralizedAlpha(tolerance, 0.8),
    "explicit": lambda tolerance: Explicit(tolerance),
}
MOST_EVALUATIONS = {"gauss": 1500, "radau": 1500, "energy": 2400, "gear": 300, "generalized_alpha": 20_000, "explicit": 900}
"""States looked at for one swing of 4 s at tolerance 1e-7: half as many again as measured, rounded up."""
IMPLICIT = [name for name in FREE if name != "explicit"]


@pytest.fixture(scope="module")
def swung():
    """Where the pendulum is after 3 s, by a method of order 32 with many steps."""
    return end_of(swing(), CollocationMethod("gauss", gauss(16), 1e-14), [1.0], [0.5], 3.0, 0.05)


# order ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIXED)
def test_measured_order_is_the_nominal_one(name, swung):
    make, order = FIXED[name]
    errors = []
    for count in STEPS[order]:
        h = 3.0 / count
        errors.append(np.abs(end_of(swing(), make(h), [1.0], [0.5], 3.0, h) - swung).max())
    assert errors[-1] > 1e-12, "the error is round-off: nothing is measured"
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.9])
def test_generalized_alpha_keeps_its_order_with_dampers(rho):
    exact = damped_solution(3.0)
    errors = []
    for count in (1600, 3200) if rho == 0.0 else (100, 200):
        end = end_of(oscillator(4.0, 0.6), GeneralizedAlpha(TIGHT, rho), [1.0], [0.0], 3.0, 3.0 / count)
        errors.append(abs(end[0] - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


def damped_solution(t):
    """Return q of q'' + 0.6 q' + 4 q = 0 from q = 1 at rest."""
    w = np.sqrt(4.0 - 0.09)
    return np.exp(-0.3 * t) * (np.cos(w * t) + 0.3 / w * np.sin(w * t))


PENDULUM = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {bob: {type: rigid, mass: 1.0, inertia: 0.1, points: {pivot: [0.0, 1.0]}}}
joints: {pin: {type: revolute, between: [ground, bob.pivot]}}
initial: {bob: {angle: 1.0}}
solve: {duration: 1.0}
"""


def constrained():
    """Return the problem and the start of a pendulum in Cartesian coordinates, held by a joint."""
    scene = build(parse_deck(PENDULUM))
    system = scene.system
    return Problem(system.acceleration, system.project, False), scene.q, scene.v


@pytest.mark.parametrize(
    "name",
    [
        "gauss-1",
        "gauss-2",
        "gauss-3",
        "radau-2",
        "radau-3",
        "energy-1",
        "energy-2",
        "energy-3",
        "gear-2",
        "gear-3",
        "gear-4",
        "generalized_alpha-0.8",
    ],
)
def test_projection_keeps_the_order_with_constraints(name):
    make, order = FIXED[name]
    reference = end_of(*with_start(CollocationMethod("gauss", gauss(12), 1e-14)), 1.0, 0.02)
    counts = {2: (100, 200), 3: (80, 160), 4: (40, 80), 5: (20, 40), 6: (10, 20)}[order]
    errors = [np.abs(end_of(*with_start(make(1.0 / n)), 1.0, 1.0 / n) - reference).max() for n in counts]
    assert errors[-1] > 1e-12
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


def with_start(method):
    problem, q, v = constrained()
    return problem, method, q, v


def test_every_step_ends_on_the_constraints():
    problem, q, v = constrained()
    trajectory, stop = run(problem, CollocationMethod("radau", radau(2), 1e-4), q, v, 1.0, 0.02)
    assert stop is None
    system = build(parse_deck(PENDULUM)).system
    for s in trajectory.segments:
        x = s.q[None]
        assert np.abs(system.residual(np.zeros(1), x)).max() < 1e-12
        assert np.abs(system.unreduced.phi.jacobians(x)[0] @ s.v).max() < 1e-12


# tolerance, cost, dense output -----------------------------------------------------------------------


@pytest.mark.parametrize("name", FREE)
def test_the_error_follows_the_tolerance(name, swung):
    errors = {}
    for exponent in (4, 5, 6, 7, 8, 9):
        errors[exponent] = np.abs(
            end_of(swing(), FREE[name](10.0**-exponent), [1.0], [0.5], 3.0) - swung
        ).max()
    for exponent, error in errors.items():
        assert error < 3e3 * 10.0**-exponent
    # a hundred times tighter is better by ten at the least, from the first to the last by three hundred
    for exponent in (4, 5, 6, 7):
        assert errors[exponent + 2] < max(0.1 * errors[exponent], 1e-12)
    assert errors[9] < max(3e-3 * errors[4], 1e-12)


@pytest.mark.parametrize("name", FREE)
def test_the_work_is_bounded(name):
    problem = swing()
    end_of(problem, FREE[name](1e-7), [1.0], [0.5], 4.0)
    counts = problem.counts
    assert 0 < counts.evaluations <= MOST_EVALUATIONS[name]
    assert counts.calls <= counts.evaluations
    assert 0 <= counts.rejected <= 0.3 * counts.steps + 3


@pytest.mark.parametrize("name", FREE)
def test_dense_output_is_as_good_as_the_steps(name):
    trajectory, _ = run(oscillator(), FREE[name](1e-7), [1.0, 0.0], [0.0, 1.0], 5.0)
    times = np.linspace(0.0, 5.0, 400)
    q, v = trajectory.at(times)
    ends = trajectory.step_ends()
    at_ends = np.array([*(step.q for step in trajectory.segments), trajectory.q])
    error_at_ends = np.abs(at_ends - np.stack([np.cos(ends), np.sin(ends)], 1)).max()
    allowed = 3.0 * error_at_ends + 1e-7
    assert np.abs(q - np.stack([np.cos(times), np.sin(times)], 1)).max() < allowed
    assert np.abs(v - np.stack([-np.sin(times), np.cos(times)], 1)).max() < 10.0 * allowed


def test_steps_alike_are_read_as_each_of_them_is(monkeypatch):
    monkeypatch.setattr(_trajectory, "MOST", 40)
    rng = np.random.default_rng(3)
    ends = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, 30))])
    counts = rng.choice([1, 4, 7], 30)
    made = [
        Segment(t, h, *rng.normal(size=(2, 3)), rng.normal(size=(k, 3)))
        for t, h, k in zip(ends.tolist(), np.diff(ends).tolist(), counts.tolist(), strict=False)
    ]
    path = Trajectory(0.0, float(ends[-1]), *rng.normal(size=(2, 3)), made)
    times = np.sort(rng.uniform(0.0, ends[-1], 90))
    q, v = path.at(times)
    for step in made:
        own = (step.t <= times) & (times < step.t + step.h)
        assert [a.tobytes() for a in step.at(times[own])] == [q[own].tobytes(), v[own].tobytes()]
    path.t_end -= 0.3 * made[-1].h  # models may change within a step
    shares, every = np.array([0.0, 0.2, 0.9]), slice(1, None, 2)
    q, v = path.inside(every, shares)
    begin, end = path.step_ends()[:-1][every], path.step_ends()[1:][every]
    assert end[-1] == path.t_end
    there = path.at((begin[:, None] + (end - begin)[:, None] * shares).ravel())
    for found, own in zip((q, v), there, strict=True):
        assert found.shape == (15, 3, 3)
        assert found.reshape(-1, 3) == pytest.approx(own, rel=1e-12, abs=1e-12)


def test_dense_output_joins_the_steps():
    trajectory, _ = run(oscillator(), CollocationMethod("gauss", gauss(6), 1e-8), [1.0], [0.0], 5.0)
    for before, after in zip(trajectory.segments, trajectory.segments[1:], strict=False):
        q, v = before.at(np.array([after.t]))
        assert np.abs(q - after.q).max() < 1e-12
        assert np.abs(v - after.v).max() < 1e-12


def test_fixed_steps_meet_the_end_without_a_sliver():
    trajectory, _ = run(oscillator(), CollocationMethod("gauss", gauss(3), 1e-10), [1.0], [0.0], 1.05, 0.1)
    lengths = [s.h for s in trajectory.segments]
    assert len(lengths) == 11
    assert lengths[:10] == pytest.approx([0.1] * 10)
    assert trajectory.t_end == 1.05


# stability -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("stages", [1, 2, 3, 4, 8])
def test_gauss_keeps_the_energy_of_an_oscillator(stages):
    problem = oscillator([1.0, 40.0])
    method = CollocationMethod("gauss", gauss(stages), TIGHT)
    trajectory, stop = run(problem, method, [1.0, 0.1], [0.0, 0.0], 100.0, 0.1)
    assert stop is None
    assert len(trajectory.segments) == 1000
    energy = [0.5 * (s.v @ s.v + s.q @ (np.array([1.0, 40.0]) * s.q)) for s in trajectory.segments]
    assert np.ptp(energy) < 1e-12 * energy[0]


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_radau_damps_what_is_much_faster_than_the_step(stages):
    problem = oscillator([1.0, 1e8])
    method = CollocationMethod("radau", radau(stages), 1e-10)
    trajectory, stop = run(problem, method, [1.0, 1e-3], [0.0, 0.0], 1.0, 0.05)
    assert stop is None
    assert abs(trajectory.q[1]) < 1e-12
    assert abs(trajectory.v[1]) < 1e-6
    assert trajectory.q[0] == pytest.approx(np.cos(1.0), abs=0.05 if stages == 1 else 1e-3)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.9, 1.0])
def test_generalized_alpha_has_the_spectral_radius_it_is_given(rho):
    assert amplification(rho, 1e6) == pytest.approx(rho, abs=2e-3)
    assert amplification(rho, 1e-2) == pytest.approx(1.0, abs=1e-4)


def amplification(rho, w):
    """Return the spectral radius of a step h = 1 on q'' = -w^2 q, from the recurrence of its iterates."""
    method, problem = GeneralizedAlpha(1e-8, rho), oscillator(w * w)
    states = []
    for q, v, a in np.eye(3):
        stepper = method.start(problem, 0.0, np.array([q]), np.array([v]))
        stepper.smooth = np.array([a])
        attempt = stepper.attempt(0.0, np.array([q]), np.array([v]), 1.0)
        stepper.accept(1.0, attempt.q, attempt.v)
        states.append([attempt.q[0], attempt.v[0], stepper.smooth[0]])
    scale = np.array([1.0, 1.0, 1.0])
    return np.abs(np.linalg.eigvals(np.array(states).T * scale)).max()


@pytest.mark.parametrize("name", IMPLICIT)
def test_a_stiff_oscillator_is_crossed_with_large_steps(name):
    """The fast part starts at its rest position: only the slow one has to be resolved."""

    def acceleration(t, q, v):
        stiff = 1e8 * (q[:, 1] - np.sin(q[:, 0]))
        return np.stack([-q[:, 0], -stiff], axis=1)

    method = CollocationMethod("radau", radau(3), 1e-5) if name == "radau" else FREE[name](1e-5)
    problem = problem_of(acceleration)
    trajectory, stop = run(problem, method, [1.0, np.sin(1.0)], [0.0, 0.0], 2.0, 0.02)
    assert stop is None
    assert problem.counts.steps == 100
    assert trajectory.q[0] == pytest.approx(np.cos(2.0), abs=2e-3)
    assert trajectory.q[1] == pytest.approx(np.sin(np.cos(2.0)), abs=2e-3)


@pytest.mark.parametrize("name", FREE)
def test_dampers_work_with_every_method(name):
    end = end_of(oscillator(4.0, 0.6), FREE[name](1e-7), [1.0], [0.0], 3.0)
    assert end[0] == pytest.approx(damped_solution(3.0), abs=2e-5)


@pytest.mark.parametrize("name", IMPLICIT)
def test_a_stiff_damper_costs_few_steps(name):
    """An overdamped mass: q creeps as exp(-t), while its velocity settles within a microsecond."""
    problem = oscillator(1e6, 1e6 + 1.0)
    trajectory, stop = run(problem, FREE[name](1e-6), [1.0], [-1.0], 2.0)
    assert stop is None
    assert trajectory.q[0] == pytest.approx(np.exp(-2.0), abs=1e-4)
    assert problem.counts.steps < 1500


# failure -------------------------------------------------------------------------------------------


def breaking():
    """Return an oscillator without accelerations after 0.5 s, which does not put up with being asked for ever."""
    calls = []

    def acceleration(t, q, v):
        calls.append(t)
        assert len(calls) < 50_000, "the integrator goes round in circles"
        return np.where(t[:, None] > 0.5, np.nan, -q)

    return problem_of(acceleration)


@pytest.mark.parametrize("name", FREE)
@pytest.mark.parametrize("step", [None, 0.02])
def test_nan_ends_in_a_failure_and_never_in_a_result(name, step):
    method = Gear(1e-6, step) if name == "gear" else FREE[name](1e-6)
    trajectory, stop = run(breaking(), method, [1.0], [0.0], 2.0, step)
    assert isinstance(stop, SolverFailure)
    assert stop.exit_code == 3
    assert 0.3 < stop.time <= 0.5 + 1e-9
    assert trajectory.segments
    assert np.isfinite(trajectory.q).all()
    assert np.isfinite(trajectory.v).all()
    assert trajectory.q[0] == pytest.approx(np.cos(trajectory.t_end), abs=1e-3)


@pytest.mark.parametrize("name", FREE)
def test_nan_at_the_start_is_a_failure(name):
    problem = problem_of(lambda t, q, v: np.full_like(q, np.nan))
    _, stop = run(problem, FREE[name](1e-6), [1.0], [0.0], 1.0)
    assert isinstance(stop, SolverFailure)


@pytest.mark.parametrize("name", FREE)
def test_a_limit_on_steps_ends_the_run(name):
    trajectory, stop = run(swing(), FREE[name](1e-7), [1.0], [0.5], 100.0, max_steps=7)
    assert isinstance(stop, LimitReached)
    assert (stop.exit_code, len(trajectory.segments)) == (5, 7)
    assert stop.time == trajectory.t_end


def test_no_step_ends_where_the_model_makes_no_sense():
    cause = SolverFailure("too far", 0.0, kind="model")
    problem = problem_of(
        lambda t, q, v: -q,
        admissible=lambda q: q[0] > 0.5,
        breakdown=lambda t, q: cause if q[0] < 0.6 else None,
    )
    trajectory, stop = run(problem, CollocationMethod("gauss", gauss(4), 1e-8), [1.0], [0.0], 3.0)
    assert stop is cause
    assert trajectory.q[0] == pytest.approx(0.5, abs=1e-3)


def test_a_keyboard_interrupt_keeps_what_was_done():
    def watch(t, q, v):
        if t > 0.5:
            raise KeyboardInterrupt

    start = (0.0, np.ones(1), np.zeros(1))
    trajectory, stop = integrate(oscillator(), Explicit(1e-8), start, 5.0, Limits(), watch)
    assert isinstance(stop, KeyboardInterrupt)
    assert trajectory.t_end > 0.5


# tables --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "table", [gauss(s) for s in (1, 2, 3, 5, 8, 16)] + [radau(s) for s in (1, 2, 3, 5, 8)]
)
def test_tables_satisfy_the_order_conditions(table):
    s, c = table.stages, table.nodes
    for k in range(1, s + 1):
        assert table.A @ c ** (k - 1) == pytest.approx(c**k / k, abs=1e-13)  # C(s)
    for k in range(1, table.order + 1):
        assert table.b @ c ** (k - 1) == pytest.approx(1.0 / k, abs=1e-13)  # B(p)
    for k in range(1, table.order):
        assert table.b2 @ c ** (k - 1) == pytest.approx(1.0 / (k * (k + 1)), abs=1e-13)
    assert pytest.approx(table.A @ table.A, abs=1e-14) == table.A2


@pytest.mark.parametrize("table", [gauss(s) for s in (1, 2, 4, 12)] + [radau(s) for s in (1, 2, 4, 7)])
def test_tables_are_taken_apart_into_complex_pairs(table):
    z = np.random.default_rng(3).standard_normal((table.stages, 2))
    again = 2.0 * (table.left @ (table.poles[:, None] * (table.right @ z))).real
    # the eigenvectors become ill-conditioned; corrections of an iteration do not mind
    assert again == pytest.approx(table.A @ z, abs=1e-12 if table.stages < 8 else 1e-6)
    assert (table.poles.real > 0.0).all()


def test_gauss_is_symplectic():
    for s in (1, 2, 3, 6):
        A, b = gauss(s).A, gauss(s).b
        assert b[:, None] * A + (b[:, None] * A).T == pytest.approx(np.outer(b, b), abs=1e-14)


def test_radau_ends_at_its_last_stage():
    for s in (1, 2, 3, 6):
        assert radau(s).A[-1] == pytest.approx(radau(s).b, abs=1e-13)
        assert radau(s).A2[-1] == pytest.approx(radau(s).b2, abs=1e-13)


def test_legendre_integrals():
    x, w = np.polynomial.legendre.leggauss(12)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    values, _, _ = legendre(x, 7)
    assert (values.T * w) @ values == pytest.approx(np.diag(1.0 / (2.0 * np.arange(7) + 1.0)), abs=1e-14)
    for end in (0.2, 0.77, 1.0, 1.3):
        inner, inner_once, _ = legendre(end * x, 7)
        _, once, twice = legendre(np.array([end]), 7)
        assert once[0] == pytest.approx(end * (w @ inner), abs=1e-13)
        assert twice[0] == pytest.approx(end * (w @ inner_once), abs=1e-13)


def test_cubic_accelerations_join_both_ends():
    h, rng = 0.3, np.random.default_rng(5)
    ends, start = tuple(rng.standard_normal((3, 2))), tuple(rng.standard_normal((3, 2)))
    segment = Segment(1.0, h, start[0], start[1], two_point_series(h, ends, start))
    q, v = segment.at(np.array([1.0, 1.0 + h]))
    assert q == pytest.approx(np.stack([start[0], ends[0]]), abs=1e-12)
    assert v == pytest.approx(np.stack([start[1], ends[1]]), abs=1e-12)
    values, _, _ = legendre(np.array([0.0, 1.0]), 4)
    assert values @ segment.series == pytest.approx(np.stack([start[2], ends[2]]), abs=1e-11)


def test_jacobians_by_one_batch():
    problem = problem_of(lambda t, q, v: -np.sin(q) - 0.2 * v * v, True)
    q, v = np.array([0.3, -1.0]), np.array([2.0, 0.5])
    by_q, by_v = problem.near(0.0, q, v).slopes()
    assert by_q == pytest.approx(np.diag(-np.cos(q)), abs=1e-6)
    assert by_v == pytest.approx(np.diag(-0.4 * v), abs=1e-6)
    assert (problem.counts.calls, problem.counts.evaluations) == (1, 5)


@pytest.mark.parametrize(("name", "most"), [("gauss", 2.0), ("radau", 2.0), ("energy", 8.5)])
@pytest.mark.parametrize(("w2", "damping"), [(1.0, 0.0), (4.0, 1.0), (1e6, 0.0), (1e6, 2000.0)])
def test_a_linear_motion_costs_few_iterations(name, most, w2, damping):
    """One finds it and, where it is not small by then, one more sees that nothing is left.

    `energy` goes on until rounding alone is left: when, the last digit decides.
    """
    problem = oscillator(w2, damping)
    _, stop = run(problem, FREE[name](1e-6), [1.0], [0.0], 2.0, 0.05)
    assert stop is None and problem.counts.steps == 40
    assert problem.counts.iterations <= most * problem.counts.steps


def test_what_a_stiff_damper_holds_costs_no_second_iteration():
    """The guess of a step knows what dies out at once: accelerations at its start are those of its end."""
    problem = oscillator(1e6, 2000.0)
    run(problem, FREE["gauss"](1e-6), [1.0], [0.0], 2.0, 0.05)
    assert problem.counts.iterations <= 60


@pytest.mark.parametrize("name", ["gauss", "explicit"])
def test_steps_too_long_are_rejected_and_counted(name):
    """A short push in a slow swing is met by steps far too long for it."""

    def pushed(t, q, v):
        return -q + np.exp(-(((t - 2.0) / 0.1) ** 2))[:, None]

    problem = problem_of(pushed)
    _, stop = run(problem, FREE[name](1e-8), [0.0], [0.1], 3.0)
    assert stop is None and 0 < problem.counts.rejected <= 2 * problem.counts.steps


def test_a_step_that_an_older_derivative_does_not_solve_is_solved_with_its_own(monkeypatch):
    refused, through = [], CollocationStepper._iterated

    def iterated(stepper, place):
        if stepper._served and not stepper._old:
            refused.append(place.t)
            return None
        return through(stepper, place)

    monkeypatch.setattr(CollocationStepper, "_iterated", iterated)
    monkeypatch.setattr(CollocationStepper, "replays", False)
    problem = swing()
    _, stop = run(problem, CollocationMethod("gauss", gauss(8), 1e-9), [1.0], [0.0], 20.0, 0.5)
    assert stop is None and refused and problem.counts.rejected == 0


def test_a_stage_where_joints_lose_their_rank_goes_along_with_the_others():
    """The bars of two windows line up 1e-6 s from a stage; the published state at 2 s."""
    deck = Path(__file__).parent.parent.parent / "cases/verify/four_bars.yaml"
    scene = build(load_deck(deck, ["solve.duration=2.0", "solve.step=0.003", "solve.method=gauss"]))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    top = scene.marker("a0.top").position(scene.system.absolute(done.trajectory.q[None]))
    assert top[0] == pytest.approx((0.0578157958, 0.9983272679), abs=1e-7)


COSTS = {
    ("pendulum", 0.3): (58, 7),
    ("two_beams_relative", 0.05): (215, 22),
    ("hub_beams", 0.1): (72, 12),
    ("hub_beams_soft", 0.3): (38, 5),
}
"""Iterations and derivatives of the default method: what ends an iteration, and when a derivative is renewed."""


@pytest.mark.parametrize(("scene", "duration"), COSTS)
def test_scenes_cost_no_more_iterations_than_they_did(scene, duration):
    deck = Path(__file__).parents[2] / "cases" / f"{scene}.yaml"
    built = build(load_deck(deck, [f"solve.duration={duration}"]))
    counts = run_integration(built, built.deck.solve).problem.counts
    iterations, derivatives = COSTS[scene, duration]
    assert counts.iterations <= 1.01 * iterations + 1
    assert counts.factorisations <= derivatives + 1


def test_steps_through_a_stiffness_that_grows_in_time_take_its_derivative_where_it_counts():
    """The derivative of the start does not serve a step over which stiffness grows: one inside the step does."""
    problem = problem_of(lambda t, q, v: -(1.0 + 500.0 * (1.0 + np.tanh(t[:, None] - 2.0))) * q)
    end_of(problem, CollocationMethod("gauss", gauss(16), 1e-8), [1.0], [0.0], 4.0, step=0.5)
    assert problem.counts.iterations <= 70


CASES = Path(__file__).parents[2] / "cases"


@pytest.mark.parametrize(
    "deck, name, tolerance, most",
    [("extreme/slender", "gear", 1e-3, 120), ("extreme/space_blade", "gear", 1e-5, 150),
     ("extreme/space_blade", "generalized_alpha", 1e-5, 150), ("extreme/modulus_high", "gear", 1e-5, 300),
     ("bend_45_continuum", "gear", 1e-4, 100)],
)  # fmt: skip
def test_stiff_beams_take_no_small_steps(deck, name, tolerance, most):
    """A second correction takes back what the first one has stretched; no order lets fast modes grow.

    One that lets them grow is left where steps become shorter.
    """
    settings = [f"solve.method={name}", f"solve.tolerance={tolerance}", f"solve.max_steps={most}"]
    loaded = load_deck(CASES / f"{deck}.yaml", settings)
    assert run_integration(build(loaded), loaded.deck.solve).stop is None


STICK_SLIP = """
hfsim: 1
name: stick_slip
gravity: [0, 0]
bodies: {m: {type: rigid, mass: 1.0, inertia: 0.1}, p: {type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  rail: {type: prismatic, between: [ground, m], friction: {force: 5.0, velocity: 0.001}}
  guide: {type: prismatic, between: [ground, p]}
  crank: {type: driver, between: [ground, p], axis: [1, 0], position: {type: sine, amplitude: 0.3, frequency: 0.5}}
springs: {pull: {type: two_point, between: [p, m], rest_length: 1.0, stiffness: 100.0}}
initial: {m: {position: [1.0, 0]}}
solve: {duration: 10.0, tolerance: 1.0e-4, max_steps: 2000}
"""


def test_gear_regains_its_steps_behind_what_cuts_them_short_without_noise():
    """Differences of a tiny step that grow at once by much are noise: steps had to be ever shorter, and wrong."""
    ends = []
    for method in ("auto", "gear"):
        loaded = parse_deck(STICK_SLIP, "stick_slip.yaml", [f"solve.method={method}"])
        made = run_integration(build(loaded), loaded.deck.solve)
        assert made.stop is None
        ends.append(made.trajectory.q)
    assert abs(ends[1] - ends[0]).max() < 1e-2


SWINGING = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {m: {density: 1200, youngs_modulus: 70 MPa, poisson_ratio: 0.3}}
sections: {s: {shape: rectangle, width: 2 cm, height: 1 cm}}
bodies: {a: {type: beam, element: cosserat, material: m, section: s, length: 0.5, elements: 32}}
joints: {j: {type: revolute, between: [ground, a.root], friction: {torque: 0.05, velocity: 0.01}}}
solve: {duration: 0.03, max_steps: 60}
"""


def test_a_hinge_with_friction_keeps_its_rate_in_the_guess_of_a_step():
    """Of many elements a root is as good as without inertia: dampers of the guess had brought it to rest."""
    loaded = parse_deck(SWINGING, "swinging.yaml")
    assert run_integration(build(loaded), loaded.deck.solve).stop is None


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_orders_let_modes_grow_where_they_are_said_to(order):
    angles = np.geomspace(1e-2, 1e2, 200)
    least, most = GROWING.get(order, (0.0, 0.0))
    inside = (angles > least) & (angles < most)
    growth = GEAR.stability.growth(angles, order) - 1.0
    assert (growth[~inside] < 2e-3).all()
    assert not inside.any() or growth[inside].max() > 0.04


@pytest.mark.parametrize("way", ["native", "numpy"])
def test_corrections_that_lead_too_far_do_so_in_any_unit_of_length(way, monkeypatch):
    """Those of a pendulum of a thousand kilometres were given up for being more than a kilometre."""
    if way == "native" and kernel.KERNEL == "numpy":
        pytest.skip("the kernel was not built")
    monkeypatch.setattr(kernel, "KERNEL", way)

    body = {"type": "rigid", "mass": 1.0}

    def steps(length):
        scene = {
            "hfsim": 1,
            "gravity": [0.0, -9.81 * length],
            "bodies": {"b": body | {"inertia": 0.1 * length**2, "points": {"p": [-length, 0.0]}}},
            "joints": {"pin": {"type": "revolute", "between": ["ground", "b.p"]}},
            "initial": {"pin": {"angle": 0.3}},
            "solve": {"duration": 5.0, "method": "gauss", "tolerance": 1e-6},
        }
        return hfsim.run(scene, error_estimate=False).statistics["steps"]

    assert steps(1e6) <= steps(1.0) + 2
