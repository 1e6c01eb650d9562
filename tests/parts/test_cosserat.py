"""The element cosserat: laws against differences, published statics, convergence, no locking."""

import numpy as np
import pytest
from cantilevers import at_rest, cantilever, displacement
from damping import check_damping
from element_laws import gradient_of

from hfsim.maths.rotations import rotation
from hfsim.parts.bodies.beam_axis import Curve
from hfsim.parts.elements.cosserat import STRAINS, CosseratLaw
from hfsim.parts.elements.section_strains import PointStrains
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

PRINCETON = "{shape: rectangle, height: 12.377e-3, width: 3.2024e-3}"
ALUMINIUM = "youngs_modulus: 71.7e9, poisson_ratio: 0.31"


def law_and_vectors(rng, n_dim=3, points=4, coupled=False):
    own = STRAINS[n_dim]
    count, vectors = len(own.which), {2: 3, 3: 5}[n_dim]
    stiffness, undeformed = rng.uniform(0.5, 2.0, (count, points)), 0.2 * rng.normal(size=(count, points))
    undeformed[0] += 1.0
    V = 0.3 * rng.normal(size=(2, points, vectors, n_dim))
    V[..., :n_dim, :] += np.eye(n_dim)
    mixing = np.moveaxis(np.triu(rng.normal(size=(points, count, count))), 0, 2) if coupled else None
    return CosseratLaw(stiffness, undeformed, 1, PointStrains(own, mixing)), V


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("n_dim", [2, 3])
def test_gradient_and_hessian_against_differences(rng, n_dim, coupled):
    law, V = law_and_vectors(rng, n_dim, coupled=coupled)
    dV, h = rng.normal(size=V.shape), 1e-6
    change = (law.energy(V + h * dV) - law.energy(V - h * dV)) / (2 * h)
    gradient = gradient_of(law, V)
    assert np.sum(gradient * dV, axis=(-1, -2)) == pytest.approx(change, rel=1e-8, abs=1e-10)
    H, bent = law.hessian(V), (gradient_of(law, V + h * dV) - gradient_of(law, V - h * dV)) / (2 * h)
    assert (H @ dV.reshape(2, 4, -1, 1))[..., 0] == pytest.approx(bent.reshape(2, 4, -1), rel=1e-7, abs=1e-8)
    assert pytest.approx(H.swapaxes(-1, -2), abs=1e-14) == H
    assert law.energy(V)[1] == pytest.approx(law.energy(V[1:])[0], rel=1e-14)


def test_rigid_motions_change_no_strain(rng):
    law, V = law_and_vectors(rng)
    R = rotation(np.array([0.7, -1.9, 2.3]))
    assert law.energy(V @ R.T) == pytest.approx(law.energy(V), rel=1e-13)
    still = np.zeros((1, 1, 5, 3))
    still[0, 0, :3] = np.eye(3) @ R.T
    assert STRAINS[3].of(still[0, 0][..., None])[:, 0] == pytest.approx([1, 0, 0, 0, 0, 0], abs=1e-15)


def test_curvatures_are_the_rates_of_a_triad_along_the_line(rng):
    """d_i' = kappa x d_i with kappa in the triad's own axes."""
    R, kappa, gamma = rotation(rng.normal(size=3)), rng.normal(size=3), rng.normal(size=3)
    bent = np.cross(R @ kappa, R.T)
    v = np.array([R @ gamma, R[:, 1], R[:, 2], bent[1], bent[2]])
    assert STRAINS[3].of(v[..., None])[:, 0] == pytest.approx(np.r_[gamma, kappa], abs=1e-14)


@pytest.mark.parametrize(("force", "bending"), [((0, 1), slice(2, None)), ((0, 0, 1), slice(4, 5))])
def test_damping_against_differences(rng, force, bending):
    damped = "youngs_modulus: 10.0, axial_damping: 0.2, bending_damping: 0.3"
    round_bar = "{shape: circle, radius: 0.1}"
    check_damping(cantilever(round_bar, 1.0, force, elements=2, degree=2, material=damped), rng, bending)


def test_the_section_turns_by_its_angle():
    """A load turned with the section gives a displacement turned with it."""
    angle = 0.7
    force, R = np.array([0.0, -5.0, 3.0]), rotation(np.array([angle, 0.0, 0.0]))
    straight = cantilever(PRINCETON, 0.508, force.tolist(), material=ALUMINIUM)
    turned = cantilever(
        PRINCETON, 0.508, (R @ force).tolist(), material=ALUMINIUM, more=f"section_angle: {angle}"
    )
    a, b = (displacement(one, at_rest(one, 1.0)) for one in (straight, turned))
    assert b == pytest.approx(R @ a, abs=1e-12)


def test_torsion_with_two_bending_moments():
    """Case S19: factors 0.5768 on the polar moment and 0.8331, 0.7961 for shear."""
    I_z, I_y = 0.4 * 0.2**3 / 12, 0.2 * 0.4**3 / 12
    section = (
        f"{{area: 0.08, second_moments: [{I_y!r}, {I_z!r}], torsion_constant: {0.5768 * (I_y + I_z)!r}, "
        "shear_factors: [0.8331, 0.7961]}"
    )
    scene = cantilever(
        section, 2.0, (0.0, 0.0, 0.0), (0.5e6, 2e6, 0.0), 2, 4, "youngs_modulus: 2.07e11, poisson_ratio: 0.3"
    )
    found = displacement(scene, at_rest(scene, 1.0))
    assert found == pytest.approx((-1.0943798558e-4, -1.8643645616e-4, -1.81174027438e-2), rel=1e-7)


@pytest.mark.slow
def test_roll_up_to_a_full_circle():
    """Case S8: M = 2 pi EI / L bends a cantilever into a closed circle, about either axis of its section."""
    stiff = "{mass_per_length: 1.0, rotary_inertia: [2.0, 1.0, 1.0], axial_stiffness: 1.0e4, "
    stiff += "shear_stiffness: [1.0e4, 1.0e4], torsion_stiffness: 1.0, bending_stiffness: [2.0, 3.0]}"
    for moment in ((0.0, 4.0 * np.pi, 0.0), (0.0, 0.0, 6.0 * np.pi)):
        scene = cantilever(stiff, 1.0, (0.0, 0.0, 0.0), moment, elements=4, degree=6)
        assert displacement(scene, at_rest(scene, 1.0)) == pytest.approx((-1.0, 0.0, 0.0), abs=1e-8)


def test_extensible_cantilever_with_shear():
    """Case S10, row R."""
    length, h, E, k = 2.0, 0.1, 2.07e11, 10 * 1.3 / (12 + 11 * 0.3)
    second = h**4 / 12
    section = f"{{area: {h * h!r}, second_moment: {second!r}, shear_factors: [{k!r}, {k!r}]}}"
    force = (0.0, -3 * E * second / length**2, 0.0)
    scene = cantilever(section, length, force, (0.0,) * 3, 5, 5, f"youngs_modulus: {E}, poisson_ratio: 0.3")
    expected = (-0.5094647177450, -1.2088228295599, 0.0)
    assert displacement(scene, at_rest(scene, 1.0)) == pytest.approx(expected, abs=2e-10)


def test_geradin_cantilever():
    """Case S12, row R: shortening, deflection and rotation."""
    stiff = "{mass_per_length: 1.0, rotary_inertia: [2.0, 1.0, 1.0], axial_stiffness: 4.8e8, "
    stiff += "shear_stiffness: [3.231e8, 3.231e8], torsion_stiffness: 1.0e6, "
    stiff += "bending_stiffness: [9.346e6, 9.346e6]}"
    scene = cantilever(stiff, 5.0, (0.0, 0.0, 6e5), elements=4, degree=5)
    x = at_rest(scene, 1.0)
    assert displacement(scene, x) == pytest.approx((-0.596471272235, 0.0, 2.159693894490), abs=2e-9)
    tip = scene.marker("b.tip").frame(x)[0]
    assert np.arctan2(tip[2, 0], tip[0, 0]) == pytest.approx(0.672006063844, abs=1e-9)


def tip_of(section, length, force, elements, degree, material):
    scene = cantilever(section, length, force, None, elements, degree, material)
    return displacement(scene, at_rest(scene, 1.0))


PLANAR = "{shape: rectangle, width: 0.1, height: 0.5}"


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize(
    ("section", "length", "force", "material"),
    [
        (PLANAR, 2.0, (0.0, 6.25e7), "youngs_modulus: 2.07e11, poisson_ratio: 0.3"),
        (PRINCETON, 0.508, (0.0, -4.0, 4.0), ALUMINIUM),
    ],
    ids=["plane", "space"],
)
def test_errors_at_nodes_fall_with_twice_the_degree(section, length, force, material, degree):
    counts = {1: (8, 16, 32), 2: (4, 8, 16), 3: (2, 4, 8)}[degree]
    meshes = [*((n, degree) for n in counts), (4, 7)]
    *tips, exact = (tip_of(section, length, force, *mesh, material) for mesh in meshes)
    errors = np.linalg.norm(np.array(tips) - exact, axis=1)
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(2 * degree, abs=0.25)


@pytest.mark.parametrize("bent", [(0.0, 2.0), pytest.param((0.0, 2.0, 1.0), marks=pytest.mark.slow)])
def test_no_locking(bent):
    """Slenderness 10 to 1e4, equal unknowns, loads that bend alike: errors differ by less than a tenth."""
    errors = []
    for slenderness in (1e1, 1e2, 1e3, 1e4):
        h = 1.0 / slenderness
        section, force = f"{{shape: rectangle, width: {h!r}, height: {h!r}}}", np.multiply(bent, h**4 / 12.0)
        *tips, exact = (
            tip_of(section, 1.0, force.tolist(), *mesh, "youngs_modulus: 1.0")
            for mesh in ((12, 1), (6, 2), (4, 3), (3, 6))
        )
        errors.append(np.linalg.norm(np.array(tips) - exact, axis=1))
    assert np.max(errors, axis=0) == pytest.approx(np.min(errors, axis=0), rel=0.1)
    assert (np.max(errors, axis=0) < [1e-2, 2e-4, 5e-6]).all()


BEND = "{shape: rectangle, width: 1.0, height: 1.0}"


def test_a_curve_through_points_of_an_arc_is_that_arc():
    a = np.linspace(0.0, np.pi / 4, 41)
    points = [[float(100 * np.sin(one)), float(100 * (np.cos(one) - 1)), 0.0] for one in a]
    tips = []
    for axis in ("axis: {arc: {radius: 100.0, angle: -45 deg}}", f"axis: {{points: {points}}}"):
        scene = cantilever(BEND, 0.0, (0.0, 0.0, 300.0), (0.0,) * 3, 2, 4, "youngs_modulus: 1.0e7", axis)
        tips.append(displacement(scene, at_rest(scene, 1.0)))
    assert tips[1] == pytest.approx(tips[0], abs=1e-5)


def test_a_curve_in_space_keeps_its_length_and_its_frames_square():
    s = np.linspace(0.0, 4.0, 60)
    helix = np.stack([np.sin(s), np.cos(s) - 1.0, 0.5 * s], axis=1)
    curve = Curve(helix)
    assert curve.length == pytest.approx(4.0 * np.sqrt(1.25), rel=1e-6)
    points, frames = curve.at(np.linspace(0.0, curve.length, 50))
    assert frames @ frames.swapaxes(1, 2) == pytest.approx(np.repeat(np.eye(3)[None], 50, axis=0), abs=1e-12)
    slopes = np.gradient(points, np.linspace(0.0, curve.length, 50), axis=0, edge_order=2)
    assert frames[..., 0] == pytest.approx(slopes, abs=2e-3)
    assert np.linalg.norm(slopes, axis=1) == pytest.approx(1.0, abs=2e-3)


def test_points_and_joints_of_a_curved_beam():
    """Points off the line, and a body joined to the tip, are where the undeformed beam has them."""
    deck = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {stuff: {density: 1.0, youngs_modulus: 1.0}}
sections: {bar: {shape: circle, radius: 0.1}}
bodies:
  b: {type: beam, material: stuff, section: bar, axis: {arc: {radius: 2.0, angle: 90 deg}}, elements: 2,
      points: {off: [1.5707963267948966, 0.1, 0.2]}}
  c: {type: rigid, mass: 1.0, inertia: [1, 1, 1], points: {end: [-1.0, 0.0, 0.0]}}
joints:
  clamp: {type: fixed, between: [ground, b.root]}
  ball: {type: fixed, between: [b.tip, c.end]}
solve: {duration: 1.0}
"""
    scene = build(parse_deck(deck))
    x = scene.system.absolute(scene.q[None])
    off = np.sqrt(2.0) * np.array([1.0, -1.0, 0.0]) + [0.0, 2.0, 0.0]
    off += [-0.1 / np.sqrt(2.0), 0.1 / np.sqrt(2.0), 0.2]
    assert scene.marker("b.off").position(x)[0] == pytest.approx(off, abs=1e-12)
    assert scene.marker("c").position(x)[0] == pytest.approx((3.0, 2.0, 0.0), abs=1e-12)
    assert scene.marker("b.tip").frame(x)[0] == pytest.approx(np.eye(3), abs=1e-12)


def test_deformation_in_the_frame_at_the_root():
    """A small force bends as F (L - x) / EI, seen alike from a beam that is turned as a whole."""
    h, length, force = 0.01, 1.0, 1e-11
    section, EI = f"{{shape: rectangle, width: {h}, height: {h}}}", h**4 / 12
    scene = cantilever(section, length, (0.0, force, 2 * force), elements=2, material="youngs_modulus: 1.0")
    body, x = scene.bodies["b"], at_rest(scene, 1.0)
    R, vectors = rotation(np.array([0.4, -1.0, 2.0])), x[:, body.columns].reshape(-1, 3)
    turned = x.copy()
    turned[:, body.columns] = (vectors @ R.T + np.outer(body.mesh.positions, [1.0, 2.0, 3.0])).ravel()
    seen, again = (body.deformation(one, np.zeros_like(one)) for one in (x, turned))
    bent = np.outer(force * (length - seen.places), [1.0, 2.0]) / EI
    assert seen.curvature[0] == pytest.approx(bent, rel=1e-3, abs=1e-6)
    assert seen.tip[0] == pytest.approx(displacement(scene, x)[1:], rel=1e-12)
    assert seen.shortening[0] == pytest.approx(-displacement(scene, x)[0], rel=1e-3)
    for one, other in zip(seen, again, strict=True):
        assert other == pytest.approx(one, abs=1e-12)
