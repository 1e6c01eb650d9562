"""Pendulums on which methods fail that were published as stable.

A mass on a stiff bar turns freely (Crisfield and Shi 1994; Kuhl and Crisfield 1999; Bathe 2007), and one on a
rigid bar falls (Cardona and Geradin 1989; Arnold and Bruels 2007).
"""

from types import SimpleNamespace

import numpy as np
import pytest

from hfsim.integrators._newton import Newton
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

BAR = """
hfsim: 1
bodies: {bob: {type: rigid, mass: 10.0005255, inertia: 1.0}}
springs: {bar: {type: two_point, between: [ground, bob], stiffness: "${1e10 / 3.0443}", rest_length: 3.0443}}
initial: {bob: {position: [3.0443, 0.0], velocity: [0.0, 7.72]}}
solve: {duration: 30.0, method: generalized_alpha, step: 0.1}
output: {interval: 0.5, channels: [energy.total]}
"""


def left(*settings):
    """Return what is left of the energy after 30 s, twelve turns."""
    run = simulate(parse_deck(BAR, "bar.yaml", [f"solve.{one}" for one in settings]), error_estimate=False)
    assert run.status == "done"
    energy = run["energy.total"]
    return energy[-1] / energy[0]


@pytest.mark.parametrize(
    ("rho_inf", "step", "published", "within"),
    [(0.0, 0.2, 0.185258, 1e-6), (0.0, 0.1, 0.432436, 1e-6), (0.5, 0.05, 0.977133, 5e-4),
     pytest.param(0.0, 0.05, 0.775873, 5e-4, marks=pytest.mark.slow),
     pytest.param(0.0, 0.01, 0.995633, 1e-6, marks=pytest.mark.slow),
     pytest.param(0.5, 0.01, 0.999409, 1e-6, marks=pytest.mark.slow)],
)  # fmt: skip
def test_generalized_alpha_damps_a_stiff_bar_as_published(rho_inf, step, published, within):
    """Its periods are 0.34 ms. Published of Green's strain: steps of 50 ms see the difference."""
    assert left(f"rho_inf={rho_inf}", f"step={step}") == pytest.approx(published, abs=within)


def test_a_correction_that_grows_ends_no_iteration():
    """Extrapolating a series that diverges gives a negative number, which is below any goal."""
    sizes = iter([1.0, 10.0, 100.0])
    problem = SimpleNamespace(counts=SimpleNamespace(iterations=0), slopes=None, strains=None)
    assert not Newton(problem, most=3, patience=1).converges(lambda: 1e6 * next(sizes), patience=1)


POINT = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {bob: {type: rigid, mass: 1.0, inertia: 1.0e-6, points: {pivot: [-1.0, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, bob.pivot]}}
solve: {duration: 10.0, method: generalized_alpha}
output: {interval: 0.1, channels: [bob.y, bob.vx, bob.vy, pin.force_x, pin.force_y]}
"""


@pytest.mark.parametrize("rho_inf", [1.0, 0.99, 0.5])
def test_reactions_do_not_ring_without_numerical_damping(rho_inf):
    """Index 3 without damping makes multipliers of 4e5 g here (Cardona and Geradin 1989)."""
    settings = [f"solve.rho_inf={rho_inf}", "solve.step=0.01"]
    run = simulate(parse_deck(POINT, "bob.yaml", settings), error_estimate=False)
    pull = run["bob.vx"] ** 2 + run["bob.vy"] ** 2 - 9.81 * run["bob.y"]
    assert np.hypot(run["pin.force_x"], run["pin.force_y"]) == pytest.approx(pull, abs=1e-5 * 9.81)
    assert np.ptp(pull) > 2.9 * 9.81
