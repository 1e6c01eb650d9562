"""Eliminated joints, sparse matrices, linearised equations and natural increments: all say the same."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from zoo import DEAD_CENTRE

import hfsim.maths.matrices
import hfsim.mechanics.equations
import hfsim.scene.build
from hfsim.integrators import PlainIncrements, Problem
from hfsim.integrators._derivative import Stages
from hfsim.integrators._tableau import gauss, radau
from hfsim.integrators.derivative import computed, derivative
from hfsim.maths.matrices import assemble, dense, is_sparse
from hfsim.mechanics.equations import Equations
from hfsim.mechanics.increments import NaturalIncrements
from hfsim.mechanics.reduction import Reduction
from hfsim.mechanics.turning import Turning
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

HEAD = """
hfsim: 1
name: case
gravity: [0.4, -9.81]
solve: {model: ancf, duration: 1.0}
materials: {soft: {density: 900.0, youngs_modulus: 2.0e7}}
sections: {bar: {shape: rectangle, width: 0.05, height: 0.08}}
bodies:
  hub: {type: rigid, mass: 3.0, inertia: 0.2, points: {rim: [0.3, 0.1]}}
  b1: {type: beam, material: soft, section: bar, length: 1.5, elements: 3}
  b2: {type: beam, material: soft, section: bar, length: 1.5, elements: 3}
"""
SCENES = {
    "chain": """
joints:
  pin: {type: revolute, between: [ground, b1.root]}
  elbow: {type: revolute, between: [b1.tip, b2.root]}
  weight: {type: revolute, between: [b2.tip, hub]}
""",
    "from the tip": """
joints:
  pin: {type: revolute, between: [b1.tip, ground]}
  elbow: {type: revolute, between: [b2.tip, b1.root]}
""",
    "clamped": """
joints:
  wall: {type: fixed, between: [ground, b1.root], angle: 0.7}
  elbow: {type: fixed, between: [b1.tip, b2.root], angle: 0.2}
initial: {b1: {angle: 0.7}, b2: {angle: 0.9}}
""",
    "hub": """
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, b1.root]}
  hinge: {type: revolute, between: [b1.tip, b2.root]}
springs: {coil: {type: rotational, between: [ground, hub], stiffness: 50.0}}
""",
    "hinged on the hub": """
joints:
  axle: {type: revolute, between: [ground, hub]}
  hinge: {type: revolute, between: [hub.rim, b1.root]}
""",
    "on a rail": """
joints:
  rail: {type: prismatic, between: [ground, hub], axis: [-1, 3], angle: 0.3}
  hinge: {type: revolute, between: [hub, b1.root]}
  elbow: {type: revolute, between: [b1.tip, b2.root]}
initial: {hub: {angle: 0.3}}
""",
    "on the rim of what slides": """
joints:
  rail: {type: prismatic, between: [ground, hub], axis: [0, 1]}
  mount: {type: fixed, between: [hub.rim, b1.root]}
  hinge: {type: revolute, between: [b1.tip, b2.root]}
""",
    "loop": """
joints:
  a: {type: revolute, between: [ground, b1.root]}
  b: {type: revolute, between: [b1.tip, b2.root]}
  c: {type: revolute, between: [b2.tip, ground]}
initial: {b1: {angle: 1.0}, b2: {angle: -2.141592653589793}}
""",
    "led by sections": """
  b3: {type: beam, element: cosserat, material: soft, section: bar, length: 1.5, elements: 3}
  b4: {type: beam, element: continuum, degree: 4, section_degree: 3, material: soft, section: bar, length: 2}
joints:
  pin: {type: revolute, between: [ground, b1.root]}
  elbow: {type: revolute, between: [b1.tip, b3.root]}
  wrist: {type: revolute, between: [b3.tip, b4.tip]}
""",
    "clamped by sections": """
  b3: {type: beam, element: continuum, degree: 4, section_degree: 3, material: soft, section: bar, length: 2}
  b4: {type: beam, element: continuum, material: soft, section: bar, length: 2, elements: 2}
joints:
  wall: {type: fixed, between: [ground, b3.root], angle: 0.7}
  slide: {type: prismatic, between: [ground, b4.tip], axis: [1, 2]}
  elbow: {type: revolute, between: [b3.tip, b1.root]}
initial: {b3: {angle: 0.7}}
""",
}
MULTIPLIERS = {
    "chain": 0,
    "from the tip": 0,
    "clamped": 1,
    "hub": 3,
    "hinged on the hub": 2,
    "on a rail": 0,
    "on the rim of what slides": 3,
    "loop": 2,
    "led by sections": 10,
    "clamped by sections": 1,
}


def scene_of(name, damping="", model="ancf"):
    """Return a scene whose steps are made in absolute coordinates."""
    settings = [f"solve.model={model}", "solve.coordinates=absolute"]
    return build(parse_deck(HEAD.replace("2.0e7", f"2.0e7{damping}") + SCENES[name], overrides=settings))


@pytest.fixture(params=[hfsim.mechanics.equations.FEW, -1], ids=["joint coordinates", "whole matrix"])
def switch(request, monkeypatch):
    """Return what makes small scenes pass for large ones, with few or many coordinates at joints."""

    def to_sparse():
        monkeypatch.setattr(hfsim.mechanics.equations, "FEW", request.param)
        monkeypatch.setattr(hfsim.maths.matrices, "DENSE_UP_TO", 0)
        monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 0)

    return to_sparse


def states(scene, count=3, size=0.02, seed=5):
    """Deformed moving states on the constraints."""
    rng = np.random.default_rng(seed)
    q = scene.q + size * rng.normal(size=(count, scene.system.n))
    return scene.system.project(np.zeros(count), q, rng.normal(size=q.shape))


@pytest.mark.parametrize("name", SCENES)
def test_free_coordinates_move_as_all_with_multipliers(name):
    system = (scene := scene_of(name)).system
    assert system.n_rows == MULTIPLIERS[name]
    q, v = states(scene)
    t = np.zeros(len(q))
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    assert np.abs(system.residual(t, x)).max() < 1e-12
    assert np.abs(system.drift(t, x, u)).max() < 1e-11
    a = system.reduction.expand_rates(system.acceleration(t, q, v))
    whole = system.unreduced.solve(t, x, u, system.force(t, x, u))[0]
    assert a == pytest.approx(whole, abs=1e-10 * np.abs(whole).max())
    back = system.state(x, u, q)
    assert np.allclose(back, (q, v), rtol=0, atol=1e-13)


def test_a_loop_keeps_the_multipliers_that_close_it():
    system = scene_of("loop").system
    assert len(system.reduction.eliminated) == 2
    assert system.unreduced.n_rows == 6


@pytest.mark.parametrize("name", SCENES)
def test_sparse_matrices_give_what_dense_ones_give(name, switch):
    small = scene_of(name)
    q, v = states(small)
    t = np.zeros(len(q))
    a = small.system.acceleration(t, q, v)
    kinetic = small.system.kinetic_energy(small.system.absolute(q), small.system.absolute_velocity(q, v))
    switch()
    large = scene_of(name).system
    assert is_sparse(large.equations.constant_mass)
    assert large.acceleration(t, q, v) == pytest.approx(a, abs=1e-9 * np.abs(a).max())
    x, u = large.absolute(q), large.absolute_velocity(q, v)
    assert large.kinetic_energy(x, u) == pytest.approx(kinetic, rel=1e-12)
    one, other = (system.linearized(0.0, q[0], v[0]) for system in (small.system, large))
    for name in ("mass", "stiffness", "jacobian"):
        value = getattr(one, name)
        if value is not None:
            assert dense(getattr(other, name)) == pytest.approx(value, abs=1e-9 * np.abs(value).max())


def allowed(system, q):
    jacobian = system.linearized(0.0, q, np.zeros_like(q)).jacobian
    if jacobian is None:
        return np.eye(system.n)
    return np.linalg.qr(dense(jacobian).T, mode="complete")[0][:, system.n_rows :]


@pytest.mark.parametrize("name", SCENES)
def test_linearised_equations_are_the_slope_of_the_accelerations(name):
    """At rest, for changes the joints allow: the accelerations along them change by -M^-1 K."""
    system = (scene := scene_of(name)).system
    q = states(scene)[0][0]
    rest = np.zeros_like(q)
    at, Z = system.linearized(0.0, q, rest), allowed(system, q)
    eps = 1e-6

    def forces(y):
        """What accelerates along the joints, at the state that a small change leads to."""
        state, _ = system.project(np.zeros(1), (q + y)[None], rest[None])
        return system.acceleration(np.zeros(1), state, rest[None])[0], state[0]

    slopes = []
    for z in Z.T:
        (ahead, _), (behind, _) = forces(eps * z), forces(-eps * z)
        slopes.append((ahead - behind) / (2 * eps))
    K = Z.T @ dense(at.stiffness) @ Z
    M = Z.T @ dense(at.mass) @ Z
    expected = -np.linalg.solve(M, K)
    found = np.linalg.solve(M, Z.T @ dense(at.mass) @ np.array(slopes).T)
    assert found == pytest.approx(expected, abs=2e-5 * np.abs(expected).max())


@pytest.mark.parametrize("model", ["ancf", "linear"])
@pytest.mark.parametrize("name", SCENES)
def test_natural_increments_go_there_and_back(name, model):
    system = (scene := scene_of(name, model=model)).system
    q, _ = states(scene, 2, 0.05)
    rng = np.random.default_rng(3)
    at = system.natural.geometry(q)
    y = rng.normal(size=q.shape)
    small = system.natural.from_natural(at, y)
    assert system.natural.to_natural(at, small) == pytest.approx(y, abs=1e-11)
    eps = 1e-5
    finite = (system.natural.advance(at, eps * y) - system.natural.advance(at, -eps * y)) / (2 * eps)
    assert finite == pytest.approx(small, abs=1e-8 * np.abs(small).max())


@pytest.mark.parametrize(
    ("name", "model"),
    [
        *[(name, "ancf") for name in ("chain", "from the tip", "clamped", "loop")],
        *[(name, "linear") for name in ("chain", "from the tip", "clamped", "loop", "clamped by sections")],
    ],
)
def test_rates_of_natural_increments_change_as_they_say(name, model):
    """Second ones are derivatives of first ones, where nothing is mounted on what turns by itself."""
    system = (scene := scene_of(name, model=model)).system
    (q, v), h = states(scene, 1, 0.05), 1e-4
    a = np.random.default_rng(7).normal(size=q.shape)

    def first(t):
        return system.natural.rates(system.natural.geometry(q + t * v + 0.5 * t * t * a), v + t * a, a)[0]

    second = system.natural.rates(system.natural.geometry(q), v, a)[1]
    found = (8.0 * (first(h) - first(-h)) - (first(2 * h) - first(-2 * h))) / (12.0 * h)
    assert found == pytest.approx(second, abs=1e-7 * np.abs(second).max())


@pytest.mark.parametrize("model", ["ancf", "linear"])
@pytest.mark.parametrize("name", SCENES)
def test_forces_do_the_same_work_on_natural_increments(name, model):
    system = (scene := scene_of(name, model=model)).system
    q, _ = states(scene, 2, 0.05)
    rng = np.random.default_rng(4)
    at = system.natural.geometry(q)
    f, y = rng.normal(size=q.shape), rng.normal(size=q.shape)
    work = np.sum(f * system.natural.from_natural(at, y), axis=1)
    assert np.sum(system.natural.to_natural_forces(at, f) * y, axis=1) == pytest.approx(work, rel=1e-11)


@pytest.mark.parametrize("name", SCENES)
def test_an_imbalance_is_what_the_accelerations_lack(name):
    """Forces M (q'' - a) and gaps Phi_z (q'' - a), with the accelerations q'' of the equations of motion."""
    system = (scene := scene_of(name)).system
    q, v = states(scene, 2)
    t = np.zeros(len(q))
    rng = np.random.default_rng(5)
    a = rng.normal(size=q.shape)
    lacking = system.acceleration(t, q, v) - a
    forces, gaps = system.imbalance(t, q, v, a)
    expected = lacking @ system.equations.free_mass
    assert forces == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    at = [system.linearized(0.0, *state).jacobian for state in zip(q, v, strict=True)]
    if at[0] is None:
        assert gaps.shape == (len(q), 0)
    else:
        expected = np.stack([J @ one for J, one in zip(at, lacking, strict=True)])
        assert gaps == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("name", SCENES)
def test_residuals_are_alike_from_forces_and_from_accelerations(name):
    """At the state of the derivative itself, where both belong to the same mass matrix."""
    scene = scene_of(name)
    q, v = states(scene, 1)
    t, a = np.zeros(1), np.random.default_rng(6).normal(size=q.shape)
    found = []
    for imbalance in (None, scene.system.imbalance):
        problem = problem_of(scene, natural=True)
        problem.imbalance = imbalance
        d = derivative(problem, 0.0, q[0], v[0], problem.increments)
        found.append(d.residual(problem, Stages(problem.increments.geometry(q), t, q, v, a)))
    assert found[0] == pytest.approx(found[1], abs=1e-8 * np.abs(found[0]).max())


@pytest.mark.parametrize("name", SCENES)
def test_natural_increments_of_joints_that_hold_stay_zero(name):
    """Mounted beams are seen from their hub: moving all the rest leaves the joint closed."""
    system = (scene := scene_of(name)).system
    if name not in ("hub", "hinged on the hub"):
        pytest.skip("nothing is mounted on a rigid body")
    q, v = states(scene, 1)
    at = system.natural.geometry(q)
    y1 = system.natural.rates(at, v, np.zeros_like(q))[0]
    moved = system.natural.advance(at, 3e-3 * y1)
    x = system.absolute(q + moved)
    assert np.abs(system.residual(np.zeros(1), x)).max() < 1e-12


def problem_of(scene, natural=False):
    system = scene.system
    increments = system.natural if natural else PlainIncrements()
    return Problem(
        system.acceleration,
        system.project,
        system.dissipates,
        linearized=system.linearized,
        increments=increments,
    )


@pytest.mark.parametrize("damping", ["", ", axial_damping: 1e-3, bending_damping: 0.02"], ids=["", "damped"])
@pytest.mark.parametrize("natural", [False, True])
@pytest.mark.parametrize("name", SCENES)
def test_corrections_are_alike_dense_and_sparse(name, natural, damping, switch, monkeypatch):
    """Modes, matrices of motions, and factors for each pole solve the same equations."""
    table, h = gauss(4), 3e-3
    scene = scene_of(name, damping)
    q, v = states(scene, 1)
    r = np.random.default_rng(8).normal(size=(4, scene.system.n))
    if not damping:  # modes have a measure of their own for rates at gaps
        r = r @ allowed(scene.system, q[0]) @ allowed(scene.system, q[0]).T
    found = []
    for kind in ("dense", "sparse"):
        if kind == "sparse":
            switch()
        scene = scene_of(name, damping)
        problem = problem_of(scene, natural)
        if natural and kind == "dense":  # what turns is not the same but where all turn as one: see below
            turning = csr_array(scene.system.natural.turning(scene.system.natural.geometry(q), v[0]))
        elif natural:
            monkeypatch.setattr(NaturalIncrements, "turning", lambda *_, known=turning: known)
        d = derivative(problem, 0.0, q[0], v[0], problem.increments if natural else None)
        residual = problem.increments.to_natural(problem.increments.geometry(q), r) if natural else r
        y, change = d.correction(table, h)(d.reading(residual))
        # without modes every change of a velocity counts as one of a slow motion
        most = table.slow(h) * np.abs(table.end_rate @ y).max() / h
        assert 0.0 < change <= most * (1.0 + 1e-12)
        assert kind == "dense" or change == pytest.approx(most)
        found.append((y, d.solver(h * h, h if damping else 0.0)(residual[0])))
    for one, other in zip(*found, strict=True):
        # the stiffness of joint forces comes from difference quotients
        assert one == pytest.approx(other, abs=1e-7 * np.abs(other).max())


@pytest.mark.parametrize("damping", ["", ", axial_damping: 1e-3, bending_damping: 0.02"], ids=["", "damped"])
@pytest.mark.parametrize("name", SCENES)
def test_what_serves_one_correction_is_the_same_map(name, damping):
    """By one factor, of the matrices as they are, as by modes or motions."""
    scene = scene_of(name, damping)
    q, v = states(scene, 1)
    problem, r = problem_of(scene), np.random.default_rng(8).normal(size=scene.system.n)
    found = []
    for once in (False, True):
        here = computed(problem, PlainIncrements(), True, 0.0, q[0], v[0], None, once)
        found.append(here.solver(1e-5, 3e-3)(r))
    assert found[1] == pytest.approx(found[0], abs=1e-9 * np.abs(found[0]).max())


@pytest.mark.parametrize("table", [gauss(1), gauss(7), gauss(16), gauss(24), radau(2), radau(9), radau(20)])
def test_poles_take_the_integration_matrix_apart(table):
    A = 2.0 * ((table.left * table.poles) @ table.right).real
    rounding = 1e-15 * np.abs(table.left).max() * np.abs(table.right).max()
    assert np.abs(A - table.A).max() < 10 * rounding
    assert len(table.poles) == (len(table.nodes) + 1) // 2


def test_reduction_of_nothing_is_the_identity():
    nothing = Reduction.nothing(4, sparse=False)
    z = np.arange(4.0)[None]
    assert nothing.identity and nothing.expand(z) is z and nothing.free(z) is z
    mass = assemble([], (4, 4), sparse=False)
    assert mass.dtype == float
    assert Equations(mass, (), (), nothing).n == 4


def test_a_state_whose_joints_cannot_be_closed_is_refused_where_asked():
    """The slider is asked for beyond the reach of crank and rod."""
    scene = build(parse_deck(DEAD_CENTRE))
    q, v = scene.q[None], scene.v[None]
    scene.system.project(np.array([0.01]), q, v, strict=True)
    scene.system.project(np.array([2.0]), q, v)
    with pytest.raises(np.linalg.LinAlgError, match="cannot be closed"):
        scene.system.project(np.array([2.0]), q, v, strict=True)


@pytest.mark.parametrize("sparse", [False, True], ids=["dense", "sparse"])
@pytest.mark.parametrize("name", ["chain", "from the tip", "hub", "hinged on the hub", "loop"])
def test_changes_turn_with_everything_while_natural_increments_stand_still(name, sparse, monkeypatch):
    if sparse:
        monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 0)
    scene = scene_of(name)
    system, reduction = scene.system, scene.system.reduction
    q, _ = states(scene, 1, 0.05)
    turn, x = Turning.units(scene.bodies.values(), 2)[2], reduction.expand(q)

    def spread(angle):
        at = system.natural.geometry(reduction.free(turn.turned(x, angle)))
        return system.natural.from_natural(at, np.eye(system.n)).T

    found = system.natural.turning(system.natural.geometry(q), reduction.free_rates(turn.rates(x))[0])
    eps = 1e-4
    rates = (spread(eps) - spread(-eps)) @ np.linalg.inv(spread(0.0)) / (2.0 * eps)
    if sparse and name == "hinged on the hub":  # there nothing turns that nothing holds
        rates[reduction.free_columns(scene.bodies["b2"].columns)] = 0.0
    assert np.abs(rates).max() > 0.5
    assert is_sparse(found) == sparse
    assert dense(found) == pytest.approx(rates, abs=1e-6)


def test_turning_fills_no_matrix_of_a_long_chain(monkeypatch):
    """Entries stand where mass and stiffness have theirs, and are twice as many in twice the chain."""
    monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 0)
    counts = []
    for beams in (20, 40):
        scene = build(parse_deck(chain_of(beams)))
        q, v = states(scene, 1, 1e-3)
        problem = problem_of(scene)
        still, turning = (
            derivative(problem, 0.0, q[0], v[0], natural).at for natural in (None, scene.system.natural)
        )
        assert abs(turning.stiffness - still.stiffness).max() > 0.1
        assert turning.stiffness.nnz <= (abs(still.stiffness) + abs(still.mass)).nnz
        counts.append(turning.stiffness.nnz)
    assert counts[1] < 2.1 * counts[0]


@pytest.mark.parametrize(("beams", "sparse"), [(31, False), (41, False), (42, True)])
def test_matrices_are_dense_by_what_joints_leave(beams, sparse):
    system = build(parse_deck(chain_of(beams))).system
    assert system.n == 6 * beams and system.n_x == 8 * beams
    assert is_sparse(system.equations.constant_mass) == is_sparse(system.reduction.basis) == sparse


def chain_of(beams):
    """Return a deck of hinged beams of one element each."""
    one = "  b{}: {{type: beam, material: soft, section: bar, length: 0.1, elements: 1}}\n"
    hinge = "  j{}: {{type: revolute, between: [b{}.tip, b{}.root]}}\n"
    bodies = "".join(one.format(k) for k in range(beams))
    hinges = "".join(hinge.format(k, k, k + 1) for k in range(beams - 1))
    pin = "joints:\n  pin: {type: revolute, between: [ground, b0.root]}\n"
    return f"{HEAD.partition('bodies:')[0]}bodies:\n{bodies}{pin}{hinges}"
