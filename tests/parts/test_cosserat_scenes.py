"""Scenes with beams of the element cosserat: frequencies, joints, offsets, invariance, what they refuse."""

from pathlib import Path

import numpy as np
import posed
import pytest
import scipy.linalg
import yaml
from cantilevers import cantilever
from published import misses
from solved import solved

from hfsim.errors import DeckError
from hfsim.maths.matrices import dense, is_sparse
from hfsim.maths.rotations import rotation
from hfsim.parts.bodies.axis_spec import AxisSpec
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

CASES = Path(__file__).parent.parent.parent / "cases"
DECK = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {soft: {density: 1000.0, youngs_modulus: 1.0e7, poisson_ratio: 0.3}}
sections: {blade: {shape: rectangle, width: 0.06, height: 0.03}}
ground: {points: {wall: [0.0, 0.0, 0.0]}}
bodies:
  b: {type: beam, material: soft, section: blade, length: 0.8, elements: 1,
       points: {side: [0.4, 0.1, 0.05]}}
  c: {type: beam, material: soft, section: blade, length: 0.5, elements: 1, degree: 2, section_angle: 0.5}
  top: {type: rigid, mass: 0.5, inertia: [0.001, 0.002, 0.0025], points: {rim: [0.1, 0.0, 0.05]}}
joints:
  hinge: {type: revolute, between: [ground.wall, b.root], axis: [0.0, 0.6, 0.8]}
  elbow: {type: universal, between: [b.tip, c.root], axes: [[0, 0, 1], [0, 1, 0]]}
  ball: {type: spherical, between: [b.side, top.rim]}
initial:
  b: {orientation: {rotation_vector: [0.0, 0.0, 0.0]}, angular_velocity: [0.0, 1.2, 1.6]}
  c: {orientation: {rotation_vector: [0.0, 0.0, 0.0]}, angular_velocity: [0.0, 1.2, 1.6]}
  top: {orientation: {rotation_vector: [0.0, 0.0, 0.0]}, angular_velocity: [0.0, 1.2, 1.6]}
solve: {duration: 0.14, tolerance: 1.0e-9}
output:
  interval: 0.05
  channels: [c.tip.x, c.tip.y, c.tip.z, top.x, top.y, top.z, c.tip.twist, energy.total]
"""


@pytest.fixture(scope="module")
def level():
    return solved(DECK)


def test_a_turned_and_shifted_scene_moves_the_same(level):
    R, shift, a = rotation(np.array([0.9, -1.3, 0.4])), np.array([0.3, -2.0, 1.0]), level[0]
    b = solved(posed.moved(yaml.safe_load(DECK), R, shift))[0]
    for k in (0, 3):
        assert b[:, k : k + 3] == pytest.approx(a[:, k : k + 3] @ R.T + shift, abs=1e-8)
    assert b[:, 6] == pytest.approx(a[:, 6], abs=1e-8)
    assert np.ptp(a[:, 7]) < 1e-8
    assert np.abs(a[:, 6]).max() > 1e-3


def test_exact_and_ancf_are_one(level):
    ancf = solved(DECK.replace("solve: {", "solve: {model: ancf, "))[0]
    assert ancf == pytest.approx(level[0], abs=1e-12)


def test_joints_hold(level):
    assert level[1].statistics["constraint_position"] < 1e-12


ROOTS = (1.8751040687119612, 4.6940911329741746)
"""Case S1, clamped and free."""


@pytest.mark.parametrize("more", ["", "element: continuum, section_degree: 5"])
def test_frequencies_of_a_slender_cantilever(more):
    """Bending in both planes, torsion and stretch, of 2 elements of degree 6; a continuum does not warp."""
    E, rho, L, w, h = 1e7, 1000.0, 1.0, 0.004, 0.002
    section = f"{{shape: rectangle, width: {w}, height: {h}}}"
    scene = cantilever(section, L, (0, 0, 0), None, 2, 6, f"youngs_modulus: {E}", more)
    linear = scene.system.linearized(0.0, scene.q, scene.v)
    free = linear.allowed
    omega = np.sqrt(scipy.linalg.eigvalsh(free @ linear.stiffness @ free.T))
    expected = [r**2 * np.sqrt(E / (12 * rho)) * side / L**2 for r in ROOTS for side in (w, h)]
    polar = (w * h**3 + h * w**3) / 12
    J = polar if more else scene.deck.sections["bar"].torsion
    expected += [0.5 * np.pi / L * np.sqrt(E * J / (2.0 * rho * polar)), 0.5 * np.pi / L * np.sqrt(E / rho)]
    for one in expected:
        assert np.abs(omega / one - 1.0).min() < 3e-4
    assert omega[:4] == pytest.approx(sorted(expected)[:4], rel=3e-4)


def test_undeformed_bodies_weigh_and_turn_as_rigid_ones():
    """Mass, first moment and moments of inertia, from momenta of rigid motions."""
    section = "{shape: rectangle, width: 0.2, height: 0.1}"
    scene = cantilever(section, 2.0, (0, 0, 0), material="youngs_modulus: 1")
    body = scene.bodies["b"]
    x = body.placed(scene.assembly.poses["b"])
    motions = np.zeros((6, scene.system.n_x))
    motions[:, body.columns] = body.freedoms(x)
    M = scene.system.equations.momentum(x[None], motions) @ motions.T
    m, L, y, z = 40.0, 2.0, 0.1**2 / 12, 0.2**2 / 12
    assert np.diag(M) == pytest.approx([m, m, m, m * (y + z), m * (L * L / 3 + z), m * (L * L / 3 + y)])
    assert M[1, 5] == pytest.approx(m * L / 2)


@pytest.mark.parametrize("elements", [6, 16])
def test_accelerations_fulfil_the_equations_in_dense_and_sparse_scenes(elements):
    """M a + Phi^T lambda = f and Phi a = gamma in a batch of states, more than are factorised at once."""
    round_bar = "{shape: circle, radius: 0.1}"
    scene = cantilever(round_bar, 1.0, (0, 1, 2), elements=elements, material="youngs_modulus: 9")
    equations, rng = scene.system.equations, np.random.default_rng(5)
    n, count = scene.system.n_x, 80
    x = scene.system.absolute(scene.q[None]) + 0.1 * rng.normal(size=(count, n))
    u, f, t = rng.normal(size=(count, n)), rng.normal(size=(count, n)), np.zeros(count)
    a, multipliers = equations.solve(t, x, u, f)
    basis = dense(equations.reduction.basis)
    assert is_sparse(equations.constant_mass) == (elements == 16)
    for k in (0, 1, count - 1):
        J = dense(equations.phi.jacobian_at(x[k : k + 1])) @ basis
        left = a[k] @ dense(equations.free_mass) + multipliers[k] @ J
        assert left == pytest.approx(f[k] @ basis, abs=1e-9 * np.abs(multipliers[k]).max())
        gamma = equations.phi.curvature(t[:1], x[k : k + 1], u[k : k + 1])[0]
        assert J @ a[k] == pytest.approx(gamma, abs=1e-6)


def test_right_angle_cantilever():
    """Until the load has gone, and the energy that stays; this mesh is 5e-5 m from finer ones."""
    run = simulate(load_deck(CASES / "right_angle.yaml", ["solve.duration=2.2"]), error_estimate=False)
    assert np.abs(misses(run, "right_angle", 2.0)).max() < 6e-5
    assert run.channels[-1].values[-1] == pytest.approx(114.88035, abs=5e-4)


F8 = {
    15.0: (-0.406228, -0.032206, 0.159847, 7.286780, -2.206730, -9.204403),
    20.0: (-0.782339, -0.530376, -2.601943, 0.956802, 4.093003, 0.496028),
    30.0: (1.332901, -0.125769, -0.223688, 1.501012, -1.736554, 0.168538),
}
"""Right-angle cantilever: displacements of elbow and tip, three codes' meshes agree to 5e-6."""


@pytest.mark.slow
def test_right_angle_cantilever_to_its_end():
    """Four digits of every row, and the energy to seven: 2 elements a leg of degree 7."""
    finer = [f"bodies.{leg}.degree=7" for leg in ("first", "second")]
    settings = [*finer, "solve.duration=30", "solve.tolerance=1.0e-7"]
    run = simulate(load_deck(CASES / "right_angle.yaml", settings), error_estimate=False)
    places = np.stack([channel.values for channel in run.channels[:6]], axis=1)
    moved = places - [0.0, 10.0, 0.0, -10.0, 10.0, 0.0]
    for t, expected in F8.items():
        assert moved[np.searchsorted(run.t, t - 1e-9)] == pytest.approx(expected, abs=7e-5)
    energy = run.channels[-1].values[run.t >= 2.0]
    assert energy == pytest.approx(np.full(len(energy), 114.88035), abs=4e-5)


GRADIENTS = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {soft: {density: 1000.0, youngs_modulus: 1.0e+7}}
sections: {bar: {shape: rectangle, width: 0.1, height: 0.1}}
bodies: {b: {type: beam, element: continuum, material: soft, section: bar, length: 1.0}}
solve: {duration: 1.0}
"""


def test_a_model_that_a_study_asks_for_and_that_is_not_there_is_refused():
    with pytest.raises(DeckError, match="a continuum element has no model lowOrder in space"):
        build(parse_deck(GRADIENTS), "lowOrder")


TAUT = """
hfsim: 1
gravity: [0.0, 0.0{third}]
materials: {{steel: {{density: 7850.0, youngs_modulus: 2.1e11, poisson_ratio: 0.3, axial_damping: 1.0e-4}}}}
sections: {{strip: {{shape: rectangle, height: {height}, width: {width}}}}}
bodies:
  b: {{type: beam, element: cosserat, material: steel, section: strip, length: 1.0, elements: 4, {more}}}
joints:
  pin: {{type: revolute, between: [ground, b.root]}}
  motor: {{type: driver, between: [ground, b.root], angle: {{type: constant_rate, rate: 21.0}}}}
initial: {{b: {{angular_velocity: 21.0}}}}
solve: {{duration: 0.03, tolerance: 1.0e-8}}
output: {{interval: 0.01, channels: [b.tip.elongation, energy.strain]}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize(
    ("third", "height", "width"), [(", 0.0", 1e-2, 2e-4), (", 0.0", 2e-4, 1e-2), ("", 2e-4, 1e-2)]
)
def test_tension_turns_no_sections_of_thin_strips(third, height, width, degree):
    """Centrifugal forces 400 times the stiffness of bending: the strip stretches as a rod does, no more."""
    deck = TAUT.format(third=third, height=height, width=width, more=f"degree: {degree}")
    run = simulate(parse_deck(deck), outlines=False, error_estimate=False)
    k, off = 21.0 * np.sqrt(7850.0 / 2.1e11), 4e-2 if degree == 1 else 1e-4
    assert run.status == "done"
    assert run["b.tip.elongation"][-1] == pytest.approx(np.tan(k) / k - 1.0, rel=off)


@pytest.mark.parametrize("size", [1e-150, 9e11])
def test_points_of_a_line_as_long_as_no_beam_are_refused(size):
    points = [[0.0, 0.0, 0.0], [size, 0.0, 0.0], [1.1 * size, 0.4 * size, 0.0]]
    with pytest.raises(ValueError, match="the line would be"):
        AxisSpec(points=points)
