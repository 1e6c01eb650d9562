"""Slopes of the accelerations in space against differences, and the steps that they allow."""

from pathlib import Path

import numpy as np
import pytest

from hfsim.marching.integration import problem_of, run_integration
from hfsim.mechanics.linearized import by_differences
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

CASES = Path(__file__).parents[2] / "cases"
SPIN = 50.0
PLATE = """hfsim: 1
bodies: {plate: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, %r]}}
initial: {plate: {angular_velocity: [30.0, 0.0, 40.0]}}
solve: {duration: %r, tolerance: 1.0e-8, %s}
"""


def made(third, turns, how):
    scene = build(parse_deck(PLATE % (third, turns * 2.0 * np.pi / SPIN, how)))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    return done


def facing(third, turns, how):
    return made(third, turns, how).trajectory.q[3:].reshape(-1, 3)


@pytest.mark.parametrize("case", ["tumbling", "heavy_top", "governor", "bricard"])
def test_slopes_are_those_of_differences(case):
    """With springs, dampers, clamps at the ground; and a second moment matrix that is singular."""
    scene = build(load_deck(CASES / f"{case}.yaml"))
    problem, random = problem_of(scene), np.random.default_rng(0)
    states = [one + 0.01 * random.standard_normal((3, len(one))) for one in (scene.q, scene.v)]
    a, by_q, by_v = problem.slopes(np.zeros(3), *states)
    assert a == pytest.approx(problem.evaluate(np.zeros(3), *states), rel=1e-12, abs=1e-12)
    for k in range(3):
        at = by_differences(problem.evaluate, 0.0, states[0][k], states[1][k], dissipates=True)
        assert by_q[k] == pytest.approx(-at.stiffness, abs=1e-4 * np.abs(at.stiffness).max())
        assert by_v[k] == pytest.approx(-at.damping, abs=1e-4 * np.abs(at.damping).max())


@pytest.mark.parametrize("third", [1.8, 2.0], ids=["round", "flat"])
@pytest.mark.parametrize(("method", "most"), [("gauss", 160), ("auto", 1000)])
def test_steps_of_a_spinning_body_follow_its_accuracy(third, method, most):
    done = made(third, 20, f"method: {method}")
    assert done.problem.counts.steps < most
    assert done.problem.counts.iterations < 500
    fine = facing(third, 20, "method: gauss, stages: 12, step: 0.01")
    ends = done.trajectory.q[3:].reshape(-1, 3)
    assert ends == pytest.approx(fine, abs=1e-9)


@pytest.mark.parametrize("third", [1.8, 2.0], ids=["round", "flat"])
@pytest.mark.parametrize(
    ("how", "turn"),
    [
        ("gauss, stages: 8", 2.0),
        ("radau, stages: 8", 2.0),
        ("gear, order: 2", 0.6),
        ("generalized_alpha", 0.6),
        ("energy", 0.7),
    ],
)
def test_a_spinning_body_can_be_followed_in_long_steps(third, how, turn):
    done = made(third, 5, f"method: {how}, step: {turn / SPIN!r}")
    assert done.problem.counts.iterations < 40 * done.problem.counts.steps


def test_energy_is_kept_where_second_moments_are_singular():
    scene = build(parse_deck(PLATE % (2.0, 1.0, "method: energy, step: 0.005")))
    done = run_integration(scene, scene.deck.solve)
    system = scene.system
    first = system.kinetic_energy(system.absolute(scene.q[None]), scene.v[None])
    last = system.kinetic_energy(system.absolute(done.trajectory.q[None]), done.trajectory.v[None])
    assert done.stop is None
    assert last == pytest.approx(first, rel=1e-10)
