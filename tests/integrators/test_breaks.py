"""Laws of time with breaks: steps end there, and no method misses what happens between two of them."""

from functools import cache, partial
from itertools import pairwise

import numpy as np
import pytest
from integrators.test_integrators import FIXED, FREE, problem_of, run
from solved import parsed

import hfsim
from hfsim.deck.law_specs import LAWS
from hfsim.deck.laws import SineLaw, SplineLaw, StepLaw
from hfsim.integrators import METHODS
from hfsim.integrators._tableau import gauss
from hfsim.integrators.collocation import CollocationMethod
from hfsim.marching.integration import run_integration
from hfsim.maths.piecewise import Piecewise
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

SPECS = {
    "constant": {"value": 2.0},
    "constant_rate": {"rate": 3.0, "start": 1.0},
    "table": {"times": [0.0, 1.0, 1.5, 3.0, 3.2, 4.0, 5.0], "values": [0.0, 0.0, 2.0, -1.0, -1.0, 3.0, 3.0]},
    "smooth_step": {"from": 1.0, "to": -1.0, "start": 0.5, "end": 3.0},
    "spin_up": {"rate": 2.0, "time": 4.0},
    "sine": {"amplitude": 1.0, "frequency": 2.0},
    "expression": {"expression": "2 * sin(3 * t) * exp(-t / 2) + atan(4 * t - 9)"},
}


def test_every_law_is_covered():
    assert set(SPECS) == set(LAWS)


@pytest.mark.parametrize("order", [0, 2])
@pytest.mark.parametrize("kind", LAWS)
def test_laws_are_monotone_between_breaks_or_repeat_themselves(kind, order):
    law = LAWS[kind].model_validate({"type": kind} | SPECS[kind]).build()
    derivative = law.value if order == 0 else law.acceleration
    t = np.linspace(0.0, 5.0, 5001)
    if kind == "sine":
        assert not len(law.breaks(order, 5.0))
        assert derivative(t + law.period(0.0, 5.0, 5.0)) == pytest.approx(derivative(t), abs=1e-9)
        return
    edges = np.unique(np.clip(np.concatenate([[0.0, 5.0], law.breaks(order, 5.0)]), 0.0, 5.0))
    for a, b in pairwise(edges):
        change = np.diff(derivative(np.linspace(a, b, 200)))
        assert (change >= -1e-12).all() or (change <= 1e-12).all()


PUSH = """
hfsim: 1
gravity: [0.0, 0.0]
bodies: {{b: {{type: rigid, mass: 1.0, inertia: 0.1}}}}
loads:
  on:
    {{type: force, at: b, force: [{force}, 0.0],
     law: {{type: smooth_step, from: 0.0, to: 1.0, start: 5.0, end: {middle}}}}}
  off:
    {{type: force, at: b, force: [{force}, 0.0],
     law: {{type: smooth_step, from: 0.0, to: -1.0, start: {middle}, end: {end}}}}}
solve: {{duration: 10.0, method: {method}, tolerance: 1.0e-6}}
"""


@pytest.mark.parametrize("width", [1e-6, 1e-3, 0.3])
@pytest.mark.parametrize("method", ["auto", *METHODS])
def test_a_push_is_never_missed_however_short(method, width):
    """A unit of impulse at 5 s moves a unit of mass by 5 m until 10 s; width is that of both flanks."""
    deck = PUSH.format(force=2.0 / width, middle=5.0 + 0.5 * width, end=5.0 + width, method=method)
    scene = build(parse_deck(deck))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    assert done.trajectory.q[0] == pytest.approx(5.0 - 0.5 * width, abs=2e-5)
    assert done.trajectory.v[0] == pytest.approx(1.0, abs=5e-6)
    assert done.problem.counts.steps < 500
    assert {5.0, 5.0 + 0.5 * width, 5.0 + width} <= set(done.trajectory.step_ends().tolist())


ARM = """
hfsim: 1
gravity: [0.0, 0.0]
bodies:
  a: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{tip: [1.0, 0.0]}}}}
  b: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{p: [-0.5, 0.0]}}}}
joints:
  pin: {{type: revolute, between: [ground, a]}}
  motor: {{type: driver, between: [ground, a], angle: {law}}}
  hinge: {{type: revolute, between: [a.tip, b.p]}}
initial: {{b: {{position: [1.5, 0.0]}}}}
solve: {{duration: 4.0, method: {method}, tolerance: 1.0e-6}}
"""
MOTORS = {
    "step": "{type: smooth_step, from: 0.0, to: 1.0, start: 1.0, end: 2.0}",
    "spin": "{type: spin_up, rate: 1.0, time: 4.0}",
    "table": "{type: table, times: [0, 1, 2, 3, 4], values: [0, 0, 1, 0, 0]}",
}


@cache
def arm(motor, method, tolerance):
    """Coordinates of the arm at the end."""
    scene = build(parse_deck(ARM.format(law=MOTORS[motor], method=method)))
    solve = scene.deck.solve.model_copy(update={"tolerance": tolerance})
    return run_integration(scene, solve).trajectory.q


@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize("method", METHODS)
def test_what_a_driver_does_between_two_rests_moves_what_hangs_on_it(method, motor):
    """A method that looks at the ends of its steps alone sees no acceleration at either end of the motion."""
    ends = arm(motor, method, 1e-6), arm(motor, "gauss", 1e-9)
    assert abs(ends[1][3]) > 0.1
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)


def pushed(law, **more):
    """Return a mass that a law pushes to and fro."""
    return problem_of(
        lambda t, q, v: law.value(t)[:, None] - 4.0 * q,
        breaks=np.sort(law.breaks(0)),
        period=partial(law.period, t_end=6.0),
        **more,
    )


@pytest.mark.parametrize("name", FREE)
def test_a_load_is_seen_that_is_zero_wherever_one_looks_first(name):
    """Whole numbers of periods, and a table whose points are zero but for a bump between the first two.

    In the middle of one period, and at its end, a sine is zero too.
    """
    from scipy.interpolate import CubicSpline

    humming = SineLaw(1.0, 2.0 * np.pi, 0.0, 0.0)
    bump = SplineLaw(Piecewise.of(CubicSpline(np.arange(7.0), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])))
    for law, end in ((humming, 6.0), (humming, 1.0), (bump, 6.0)):
        exact, _ = run(pushed(law), CollocationMethod("gauss", gauss(12), 1e-12), [0.0], [0.0], end)
        found, _ = run(pushed(law), FREE[name](1e-7), [0.0], [0.0], end)
        assert abs(exact.v[0]) > 0.02
        assert found.q == pytest.approx(exact.q, abs=1e-3)
        assert found.v == pytest.approx(exact.v, abs=1e-3)


OSCILLATIONS = [
    {"type": "sine", "amplitude": 1.0, "frequency": 99.73, "phase": 0.5 * np.pi},
    {"type": "expression", "expression": "cos(2 * pi * 99.73 * t)"},
    {"type": "expression", "expression": "cos(2 * pi * 99.73 * t)", "start": 1e-9},
]


@pytest.mark.parametrize("law", OSCILLATIONS, ids=["sine", "expression", "later"])
@pytest.mark.parametrize("name", FREE)
def test_no_step_spans_so_many_oscillations_that_they_look_like_a_slower_one(name, law):
    """What a mass does that 10 N push to and fro is below the tolerance: nothing else keeps steps short."""
    law = LAWS[law["type"]].model_validate(law).build()
    known = {"period": partial(law.period, t_end=3.0), "breaks": law.breaks(0, 3.0)}
    pushed = problem_of(lambda t, q, v: 10.0 * law.value(t)[:, None] + 0.0 * q, **known)
    found, _ = run(pushed, FREE[name](1e-3), [0.0], [0.0], 3.0)
    w = 2.0 * np.pi * 99.73
    assert found.q == pytest.approx(10.0 * (1.0 - np.cos(3.0 * w)) / w**2, abs=0.05)


@pytest.mark.parametrize(
    "name", ["gauss-2", "radau-2", "energy-2", "gear-3", "gear-5", "generalized_alpha-0.8"]
)
def test_fixed_steps_keep_their_order_across_breaks_off_their_grid(name):
    """Accelerations bend at the breaks, between the times of the grid; whoever steps across loses order."""
    make, order = FIXED[name]
    law = StepLaw(0.0, 30.0, 0.7307, 1.3191)
    exact, _ = run(pushed(law), CollocationMethod("gauss", gauss(12), 1e-13), [1.0], [0.0], 3.0, 0.05)
    errors = []
    for count in {2: (400, 800), 3: (200, 400), 4: (60, 120), 5: (160, 320)}[order]:
        found, _ = run(pushed(law), make(3.0 / count), [1.0], [0.0], 3.0, 3.0 / count)
        errors.append(np.abs(np.concatenate([found.q - exact.q, found.v - exact.v])).max())
        assert {0.7307, 1.3191} <= set(found.step_ends().tolist())
    assert errors[1] > 1e-12
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


def test_fixed_steps_go_on_from_each_break():
    path, _ = run(pushed(StepLaw(0.0, 1.0, 0.25, 0.53)), FREE["gauss"](1e-6), [0.0], [0.0], 1.0, 0.1)
    ends = [0.0, 0.1, 0.2, 0.25, 0.35, 0.45, 0.53, 0.63, 0.73, 0.83, 0.93, 1.0]
    assert path.step_ends() == pytest.approx(ends, abs=1e-12)


def test_breaks_that_differ_by_rounding_are_one_and_leave_no_sliver():
    breaks = np.array([0.3, 0.1 + 0.2, 0.7, 1.0 - 1e-15, 1.0, 2.0])
    path, stop = run(problem_of(lambda t, q, v: -q, breaks=breaks), FREE["gauss"](1e-6), [1.0], [0.0], 1.0)
    assert stop is None
    assert path.step_ends().tolist() == [0.0, 0.3, 0.7, 1.0]


def test_a_law_that_oscillates_from_later_on_holds_up_nothing_before():
    deck = """hfsim: 1
gravity: [0.0, 0.0]
bodies: {b: {type: rigid, mass: 2.0, inertia: 0.1}}
loads: {f: {type: force, at: b, force: [3.0, 0.0], law: {expression: "sin(tau * 1000 * t)", start: 1.0e6}}}
solve: {duration: 1000000.01}
"""
    done = run_integration(scene := build(parse_deck(deck)), scene.deck.solve)
    assert done.stop is None and done.problem.counts.steps < 100
    assert done.trajectory.q[0] == pytest.approx(1.5 * 0.01 / (2e3 * np.pi), rel=1e-4)


@pytest.mark.parametrize(
    ("law", "most"),
    [
        ("sin(sqrt(t))", 60),
        ("sin(pow(t, 0.3))", 60),
        ("sin(hypot(t, 0))", 60),
        ("sin(tau * 1e5 * t) * exp(-1e3 * t)", 3000),
    ],
)
def test_oscillations_without_a_finite_rate_or_that_fade_hold_up_nothing(law, most):
    deck = f"""hfsim: 1
gravity: [0.0, 0.0]
bodies: {{b: {{type: rigid, mass: 1.0, inertia: 1.0}}}}
loads: {{f: {{type: force, at: b, force: [1.0, 0.0], law: {{expression: "{law}"}}}}}}
solve: {{duration: 1.0}}
"""
    done = run_integration(scene := build(parse_deck(deck)), scene.deck.solve)
    assert done.stop is None and done.problem.counts.steps < most


PULLED = """
hfsim: 1
bodies: {c: {type: rigid, mass: 2.0, inertia: 0.1}}
joints: {r: {type: prismatic, between: [ground, c]}}
springs:
  w:
    type: two_point
    between: [ground, c]
    stiffness: 80
    damping: 30
    rest_length: {expression: "1.2 - 2 * max(t - 0.7, 0)"}
initial: {c: {position: [1.2, 0.0]}}
solve: {duration: 1.0, step: 0.02}
output: {channels: [c.x]}
"""


@pytest.mark.parametrize(
    ("method", "order"),
    [("gauss", 0), ("radau", 0), ("energy", 0), ("explicit", 0), ("gear", 3), ("generalized_alpha", 2)],
)
def test_a_step_up_to_a_break_sees_what_is_before_it(method, order):
    """A damped rest length whose rate jumps at 0.7 s: the order is the method's; 0: no error is left."""
    rates = np.roots([2.0, 30.0, 80.0])  # of the stretch, which is zero then, and grows by 2 m/s
    begin = np.linalg.solve([[1.0, 1.0], rates], [0.0, 2.0])
    right = 1.2 - 2.0 * 0.3 + float(begin @ np.exp(0.3 * rates))
    errors = []
    for step in (0.02, 0.01):
        change = {"solve.method": method, "solve.step": step}
        found = hfsim.run(parsed(PULLED), change, error_estimate=False, diagnosis=False)
        errors.append(abs(found["c.x"][-1] - right))
    if order:
        assert errors[1] < errors[0] / 2.0 ** (order - 0.3)
    else:
        assert max(errors) < 1e-11
