"""The method energy: the total energy to round-off at any step, and what it does not promise."""

import numpy as np
import pytest

from hfsim.errors import DeckError, SolverFailure
from hfsim.integrators import choose, energy
from hfsim.marching.balance import balance, step_samples
from hfsim.marching.integration import problem_of, run_integration
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.studies.spectra import fastest_mode

ARM = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e6}}
sections: {strip: {shape: rectangle, width: 0.05, height: 0.01}}
bodies: {arm: {type: beam, material: rubber, section: strip, length: 1.0, elements: 3}}
joints: {pin: {type: revolute, between: [ground, arm.root]}}
solve: {duration: 1.0, method: energy, step: 0.01}
"""
FLYING = """
hfsim: 1
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e6}}
sections: {strip: {shape: rectangle, width: 0.05, height: 0.01}}
bodies: {arm: {type: beam, material: rubber, section: strip, length: 1.0, elements: 3}}
initial: {arm: {angular_velocity: 3.0, velocity: [1.0, 2.0]}}
solve: {duration: 0.2, method: energy, stages: 2}
"""
CART = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e6}}
sections: {strip: {shape: rectangle, width: 0.05, height: 0.01}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.1}
  arm: {type: beam, material: rubber, section: strip, length: 1.0, elements: 2}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: revolute, between: [hub, arm.root]}
springs: {coil: {type: rotational, between: [ground, hub], stiffness: 20.0}}
initial: {hub: {angle: 1.0}}
solve: {duration: 0.3, method: energy, step: 0.01}
"""

SLIDE = """
hfsim: 1
gravity: [0.0, 0.0]
bodies: {cart: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {rail: {type: prismatic, between: [ground, cart], damping: 1.0e5}}
initial: {cart: {velocity: [1.0, 0.0]}}
solve: {duration: 1.0, method: energy, tolerance: 1.0e-8}
"""


def solved(deck, *overrides, model=None):
    """Return scene and integration of a deck given as text or as the path of a case."""
    loaded = parse_deck(deck, "deck", overrides) if "\n" in deck else load_deck(deck, overrides)
    scene = build(loaded, model)
    return scene, run_integration(scene, scene.deck.solve)


def drift_of(scene, done):
    assert done.stop is None, str(done.stop)
    return balance(scene, step_samples(done.trajectory))["energy_drift"]


def energies(scene, done):
    system, steps = scene.system, step_samples(done.trajectory)
    x, u = system.absolute(steps.q), system.absolute_velocity(steps.q, steps.v)
    return system.kinetic_energy(x, u) + system.strain_energy(x) + system.potential_energy(steps.t, x)


def fastest_period(scene):
    return 2.0 * np.pi / fastest_mode(scene, 0.0, scene.q, scene.v)[0]


# what it promises ----------------------------------------------------------------------------------


@pytest.mark.parametrize("stages", [1, 2, 3, 4])
@pytest.mark.parametrize("model", ["exact", "ancf"])
def test_the_energy_is_kept_to_round_off(stages, model):
    scene, done = solved(ARM, f"solve.stages={stages}", model=model)
    assert drift_of(scene, done) < 1e-13


def test_fewer_points_along_the_path_would_lose_energy(monkeypatch):
    whole = energy.path
    monkeypatch.setattr(energy, "path", lambda stages, points: whole(stages, points - 1))
    assert drift_of(*solved(ARM, "solve.stages=2")) > 1e-9


@pytest.mark.parametrize("stages", [2, 4])
def test_steps_of_a_hundred_periods_of_the_fastest_mode(stages):
    """Two spinning beams of aluminium: what other methods get through, they lose energy.

    Rounding alone makes 1e-14 to 2e-13 of drift with 4 stages, by the seventh digit of the step.
    """
    step = 100.0 * fastest_period(build(load_deck("cases/two_beams.yaml")))
    given = ["solve.duration=0.4", f"solve.step={step}", f"solve.stages={stages}"]
    scene, done = solved("cases/two_beams.yaml", *given, "solve.method=energy")
    assert drift_of(scene, done) < 5e-13
    # nothing bends there: both beams turn as one rigid rod
    ends = done.trajectory.step_ends()
    tip = scene.marker("b2.tip").position(scene.system.absolute(done.trajectory.q[None]))[0]
    assert tip == pytest.approx([8.0 * np.cos(4.0 * ends[-1]), 8.0 * np.sin(4.0 * ends[-1])], abs=0.02)
    assert drift_of(*solved("cases/two_beams.yaml", *given, "solve.method=gauss")) > 1e-8
    assert drift_of(*solved("cases/two_beams.yaml", *given, "solve.method=generalized_alpha")) > 1e-3


@pytest.mark.slow
def test_a_long_swing_with_large_steps():
    given = ["solve.duration=2", "solve.step=0.005"]
    assert drift_of(*solved("cases/pendulum.yaml", *given, "solve.method=energy")) < 1e-12
    for rho in (1.0, 0.9):
        other = "solve.method=generalized_alpha", f"solve.rho_inf={rho}"
        assert drift_of(*solved("cases/pendulum.yaml", *given, *other)) > 1e-2


def test_a_correction_that_is_small_by_chance_ends_no_iteration():
    """Sizes of a step of the pendulum that was given up at 1.8e-11, and lost 5e-10 J."""
    stagnation = energy._Stagnation(np.zeros(1))
    unfinished = 1.2, 2e-2, 2.4e-3, 7e-6, 1e-7, 2.7e-8, 1.2e-11, 1.4e-9, 2.9e-10, 1.8e-11, 1e-12, 1e-15
    assert all(stagnation.after(size) is None for size in unfinished)
    assert [stagnation.after(size) for size in (2e-16, 3e-16, 2e-16, 3e-16)] == [None, None, None, True]


@pytest.mark.slow
def test_the_energy_after_ten_thousand_steps():
    given = ["solve.duration=40", "solve.step=0.004", "solve.stages=2", "solve.method=energy"]
    assert drift_of(*solved("cases/pendulum.yaml", *given)) < 1e-12


def test_forward_and_back_again():
    scene, done = solved(ARM, "solve.duration=0.5")
    end = done.trajectory
    back = run_integration(scene, scene.deck.solve, start=(0.0, end.q, -end.v)).trajectory
    assert np.abs(back.q - scene.q).max() < 1e-9
    assert np.abs(back.v + scene.v).max() < 1e-7


def test_dead_loads_and_springs_of_rigid_bodies_are_in_the_balance():
    scene, done = solved(CART)
    assert scene.system.quartic
    assert drift_of(scene, done) < 1e-13
    pushed = "loads: {push: {type: force, at: arm.tip, force: [0.0, 5.0]}}\n"
    assert drift_of(*solved(ARM + pushed, "solve.duration=0.3")) < 1e-12


def test_what_a_clamp_leaves_of_a_section_is_in_the_balance():
    """The length of its vector, which iterations did not see: they ended with forces left over."""
    keys = ("element=continuum", "degree=4", "section_degree=3", "elements=1")
    sections = [f"bodies.arm.{key}" for key in keys]
    thick = ["sections.strip.height=0.1", "materials.rubber.poisson_ratio=0.3", "joints.pin.type=fixed"]
    given = [*sections, *thick, "solve.duration=0.02", "solve.step=0.002"]
    pulled = ARM + "loads: {pull: {type: force, at: arm.tip, force: [100.0, 0.0]}}\n"
    assert drift_of(*solved(pulled, *given)) < 1e-13
    damped = pulled.replace("5.0e6}", "5.0e6, axial_damping: 1.0e-3, bending_damping: 1.0e-3}")
    (_, done), (_, other) = (solved(damped, *given, f"solve.method={name}") for name in ("energy", "radau"))
    assert done.trajectory.q == pytest.approx(other.trajectory.q, abs=1e-6)


@pytest.mark.parametrize("step", [0.01, 0.05])
def test_dampers_never_put_energy_in(step):
    brake = "springs: {brake: {type: rotational, between: [ground, arm], stiffness: 0.0, damping: 0.05}}\n"
    damped = ARM.replace("5.0e6}", "5.0e6, bending_damping: 0.01}") + brake
    scene, done = solved(damped, f"solve.step={step}", "solve.stages=2", "solve.duration=0.3")
    assert done.stop is None
    total = energies(scene, done)
    assert np.diff(total).max() < 1e-13 * np.ptp(total)
    assert total[-1] < total[0] - 0.01


def test_the_work_of_dampers_and_loads_is_as_accurate_as_the_steps():
    damped = ARM.replace("5.0e6}", "5.0e6, bending_damping: 0.01}")
    law = "{type: sine, amplitude: 1, frequency: 1}"
    pushed = f"{damped}loads: {{push: {{type: moment, at: arm.tip, moment: 0.1, law: {law}}}}}\n"
    given = ["solve.stages=2", "solve.duration=0.2"]
    drifts = [drift_of(*solved(pushed, f"solve.step={h}", *given)) for h in (0.008, 0.002)]
    assert drifts[0] < 1e-2
    assert drifts[1] < drifts[0] / 100.0


@pytest.mark.parametrize("damping", [10.0, 1e3, 1e5])
@pytest.mark.parametrize("stages", [1, 2, 3, 4])
def test_steps_resolve_what_dampers_stop(stages, damping):
    """x = (1 - exp(-c t)) / c of a mass of one: the path of a step alone tells nothing of how it stops."""
    given = f"joints.rail.damping={damping}", f"solve.stages={stages}", "solve.tolerance=1e-6"
    scene, done = solved(SLIDE, *given)
    t = np.linspace(0.0, 1.0, 201)
    expected = -np.expm1(-damping * t) / damping
    assert scene.system.absolute(done.trajectory.at(t)[0])[:, 0] == pytest.approx(expected, abs=5e-5)
    assert done.problem.counts.steps < 500


# what it does not promise ---------------------------------------------------------------------------


def test_linear_momentum_is_kept_and_angular_momentum_to_the_order():
    changes = []
    for step in (0.004, 0.002):
        scene = build(parse_deck(FLYING, "deck", [f"solve.step={step}"]))
        bent = scene.v + np.random.default_rng(3).standard_normal(len(scene.v))
        done = run_integration(scene, scene.deck.solve, start=(0.0, scene.q, bent))
        assert drift_of(scene, done) < 1e-13
        system, steps = scene.system, step_samples(done.trajectory)
        x, u = system.absolute(steps.q), system.absolute_velocity(steps.q, steps.v)
        p = u @ system.equations.constant_mass
        rows = scene.bodies["arm"].mesh.positions
        total = np.einsum("bni,n->bi", p.reshape(len(p), -1, 2), rows)
        assert np.abs(total - total[0]).max() < 1e-13 * np.abs(total).max()
        about = np.sum(x[:, ::2] * p[:, 1::2] - x[:, 1::2] * p[:, ::2], axis=1)
        changes.append(np.ptp(about) / np.abs(about).max())
    assert changes[0] < 1e-3
    assert changes[1] < changes[0] / 8.0


def test_other_strain_measures_keep_it_to_the_accuracy_of_the_quadrature():
    other = ["bodies.arm.strain=engineering", "bodies.arm.curvature=exact"]
    scene, done = solved(ARM, *other)
    assert not scene.system.quartic
    assert drift_of(scene, done) < 1e-9
    assert drift_of(*solved(ARM, *other, "solve.stages=2")) < 1e-13  # not by 4 points, but 16


def test_joints_that_are_not_linear_keep_it_to_the_order():
    drifts = []
    for step in (0.01, 0.005):
        given = ["solve.duration=0.3", f"solve.step={step}", "solve.method=energy", "solve.stages=2"]
        scene, done = solved("cases/hub_beams_soft.yaml", *given)
        assert not scene.system.quartic
        drifts.append(drift_of(scene, done))
    assert drifts[0] < 1e-5
    assert drifts[1] < drifts[0] / 8.0


@pytest.mark.slow
def test_the_phase_is_only_as_good_as_the_step():
    ends = {}
    for step in (0.02, 0.002):
        _, done = solved(ARM, f"solve.step={step}", "solve.stages=1", "solve.duration=0.5")
        ends[step] = done.trajectory.q
    assert np.abs(ends[0.02] - ends[0.002]).max() > 1e-3


def test_models_without_a_constant_mass_matrix_are_refused():
    with pytest.raises(DeckError, match="constant mass matrix"):
        solved(ARM, model="lowOrder")
    with pytest.raises(DeckError, match="absolute coordinates"):
        solved(ARM, "solve.coordinates=frame")
    scene, done = solved(ARM, model="linear")
    assert not scene.system.charts
    assert drift_of(scene, done) < 1e-9
    scene = build(parse_deck(ARM, "deck", ["solve.method=gauss"]), "linear")
    stop = run_integration(scene, scene.deck.solve.model_copy(update={"method": "energy"})).stop
    assert isinstance(stop, SolverFailure)
    assert (stop.kind, stop.item) == ("deck", "solve.method")


# what its steps cost -------------------------------------------------------------------------------


@pytest.mark.parametrize("deck", ["heavy_top", "door", "governor"])
def test_the_last_resort_is_newtons_iteration(deck):
    """It has the derivative of its equations, with the inertia forces of what spins between joints."""
    scene, rng = build(load_deck(f"cases/{deck}.yaml", ["solve.method=energy"])), np.random.default_rng(1)
    problem, q, v = problem_of(scene), scene.q, scene.v + 0.5 * rng.standard_normal(scene.v.shape)
    stepper, h = choose(scene.deck.solve, False).start(problem, 0.0, q, v), 0.01
    a = problem.single(0.0, q, v) + 0.1 * rng.standard_normal((stepper.table.stages, len(q)))
    change = rng.standard_normal(a.shape)
    ahead, behind = (stepper._defect(0.0, q, v, h, a + way * change) for way in (0.5, -0.5))
    foretold = (stepper._matrix(0.0, q, v, h, a) @ change.ravel()).reshape(a.shape)
    moved = behind - ahead - change
    assert foretold - change == pytest.approx(moved, abs=1e-3 * np.abs(moved).max())


def test_steps_of_fine_meshes_end_at_rounding():
    """Where modes are not known, rounding of fast velocities counts as if it were slow."""
    fine = ("materials.rubber.youngs_modulus=5e7", "sections.strip.height=0.02", "bodies.arm.elements=96")
    deck = ARM.replace("step: 0.01", "tolerance: 1.0e-6, max_steps: 100")
    scene, done = solved(deck, *fine, "solve.duration=0.02")
    assert scene.system.n == 386
    counts = done.problem.counts
    assert counts.steps < 80 and counts.rejected == 0 and counts.factorisations < 8
    assert drift_of(scene, done) < 1e-9
    _, other = solved(deck, *fine, "solve.duration=0.02", "solve.method=gauss", "solve.max_steps=1000")
    assert done.trajectory.q == pytest.approx(other.trajectory.q, abs=1e-6)


def test_spinning_bodies_take_few_derivatives():
    _, done = solved("cases/heavy_top.yaml", "solve.method=energy", "solve.max_steps=20")
    assert done.problem.counts.factorisations < 60
