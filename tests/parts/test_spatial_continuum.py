"""The fully parameterised element in space: laws of its energy, mass and shapes, and scenes with it."""

import numpy as np
import posed
import pytest
import yaml
from analytical import gauss, homogeneous_energy
from beam_laws import DENSITY, LAMBDA, MU, OWN, box
from element_laws import Energy, check_joined, check_slopes, check_undeformed
from solved import solved

from hfsim.maths.rotations import rotation
from hfsim.maths.shapes import gauss_lobatto
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import Continuum, join_laws

LENGTH = 0.7
DEGREES = [(3, 1), (3, 2), (5, 4)]
CASES = [(p, q, n_dim) for p, q in DEGREES for n_dim in (2, 3)]
R = rotation(np.array([0.7, -1.1, 0.4]))


@pytest.fixture(params=CASES, ids=lambda c: f"{c[0]}-{c[1]}-{c[2]}d")
def element(request):
    p, q, n_dim = request.param
    return Continuum.of(LENGTH, p, q, n_dim)


def undeformed(element):
    return BeamMesh(element, 1, OWN).undeformed


def bent(element, rng, size=0.15):
    """Nodal vectors of a deformed element, each component by itself."""
    P = undeformed(element)
    steps = np.where(positions(element), LENGTH, 1.0)[:, None]
    return P + size * rng.normal(size=P.shape) * steps


def energy_of(element, kind="law"):
    return Energy(getattr(element, kind)(OWN, 1), element.differences()[None], element.n_dim)


def positions(element):
    return BeamMesh(element, 1, OWN).positions


def gradients(element, P, xi, y, z):
    """F = (r_x, r_y[, r_z]) as columns, from the element's own shapes."""
    units = np.eye(element.n_dim, dtype=int)
    return np.stack([element.shape(xi, y, tuple(one), z) @ P for one in units], axis=-1)


# ---------------------------------------------------------------- shapes and mass


def test_coordinates_of_the_paper():
    element = Continuum.of(LENGTH, 3, n_dim=3)
    assert (element.stride + element.per_node) * 3 == 24
    assert undeformed(element)[4:].tolist() == [[LENGTH, 0.0, 0.0], *np.eye(3).tolist()]


def test_shapes_against_differences(element):
    h, places = 1e-4, [(0.0, 0.1, -0.05), (0.37, -0.05, 0.03), (1.0, 0.02, 0.08)]
    for xi, y, z in places:
        z *= element.n_dim == 3
        values = {by: element.shape(xi, y, by, z) for by in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (2, 0, 0))}
        steps = {(1, 0, 0): (h / LENGTH, 0, 0), (0, 1, 0): (0, h, 0), (0, 0, 1): (0, 0, h)}
        for by, (a, b, c) in list(steps.items())[: element.n_dim]:
            ends = [element.shape(xi + s * a, y + s * b, (0, 0), z + s * c) for s in (1, -1)]
            assert values[by] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=3e-6)
        ends = [element.shape(xi + s * h / LENGTH, y, (1, 0, 0), z) for s in (1, -1)]
        assert values[2, 0, 0] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-5)
        place = [xi * LENGTH, y, z][: element.n_dim]
        assert element.shape(xi, y, (0, 0), z) @ undeformed(element) == pytest.approx(place, abs=1e-15)


def test_mass_is_the_integral_of_the_shapes(element):
    M = 0.0
    for xi, y, z, weight in box(gauss(12, 0, 1), 4):
        N = element.shape(xi, y, (0, 0), z if element.n_dim == 3 else 0.0)
        M = M + weight * LENGTH * DENSITY * np.outer(N, N)
    assert np.abs(element.mass(OWN) - M).max() < 1e-13 * np.abs(M).max()


# ---------------------------------------------------------------- energy


@pytest.mark.parametrize("kind", ["law", "gram_law", "point_law"])
def test_only_rigid_motions_strain_nothing(element, kind, rng):
    n = element.n_dim
    turns = [rotation(rng.normal(size=3) * ([0.0, 0.0, 2.0] if n == 2 else 1.0))[:n, :n] for _ in range(4)]
    check_undeformed(energy_of(element, kind), undeformed(element), positions(element), turns, rng)


@pytest.mark.parametrize("kind", ["gram_law", "point_law"])
def test_force_and_hessian_are_slopes_of_the_energy(element, kind, rng):
    check_slopes(energy_of(element, kind), bent(element, rng).ravel())


def test_both_laws_are_the_integral_of_the_strains(element, rng):
    """Eq. (20)-(23) from the gradients, lambda/2 tr(e)^2 + mu e:e: exact, or at the Gauss-Lobatto points."""
    P, total = bent(element, rng), 0.0
    line = gauss(14, 0, 1) if element.section_degree == 1 else gauss_lobatto(element.degree)
    for xi, y, z, weight in box(line, 5):
        F = gradients(element, P, xi, y, z if element.n_dim == 3 else 0.0)
        total += homogeneous_energy(F, LAMBDA, MU, weight * LENGTH)
    for kind in ("gram_law", "point_law"):
        assert energy_of(element, kind).energy(P.reshape(1, -1))[0] == pytest.approx(total, rel=1e-12)


def test_laws_of_many_elements_act_one_by_one(element, rng):
    stiff = OWN._replace(axial_stiffness=300.0)
    laws = [element.law(stiff, count) for count in (2, 1)]
    check_joined(join_laws, laws, element.differences() @ np.array([bent(element, rng) for _ in range(3)]))


def test_a_planar_deformation_stores_what_the_planar_element_does(rng):
    """With the out-of-plane section vector unchanged there is no strain across the plane."""
    flat, solid = Continuum.of(LENGTH, 3), Continuum.of(LENGTH, 3, n_dim=3)
    P = bent(flat, rng)
    Q = undeformed(solid)
    Q[[0, 1, 2, 4, 5, 6], :2] = P
    here, there = energy_of(flat), energy_of(solid)
    turned = (Q @ R.T).reshape(1, -1)
    assert there.energy(turned) == pytest.approx(here.energy(P.reshape(1, -1)), rel=1e-12)
    force = (there.gradient(turned).reshape(-1, 3) @ R)[[0, 1, 2, 4, 5, 6]]
    assert force[:, :2].ravel() == pytest.approx(here.gradient(P.reshape(1, -1))[0], abs=1e-10)
    assert np.abs(force[:, 2]).max() < 1e-11


# ---------------------------------------------------------------- scenes

BEAM = "type: beam, material: soft, section: bar, element: continuum"
PLANE = f"""
hfsim: 1
gravity: [0.0, -9.81]
materials: {{soft: {{density: 900.0, youngs_modulus: 2.0e6}}}}
sections: {{bar: {{shape: rectangle, width: 0.06, height: 0.05}}}}
bodies:
  b1: {{{BEAM}, elements: 2, length: 1.5, points: {{side: [0.7, 0.02]}}}}
  b2: {{{BEAM}, elements: 1, length: 1.0}}
joints:
  pin: {{type: revolute, between: [ground, b1.root]}}
  elbow: {{type: fixed, between: [b1.side, b2.root], angle: -0.5}}
initial: {{b1: {{angle: 0.3, angular_velocity: 2.0}}, b2: {{angle: -0.2}}}}
solve: {{duration: 0.12, tolerance: 1.0e-11}}
output: {{interval: 0.04, channels: [b1.tip.x, b1.tip.y, b2.tip.x, b2.tip.y, b1.tip.deflection,
                                    b2.angular_velocity, elbow.moment, energy.total, energy.strain]}}
"""
VECTORS = "b1.tip.", "b2.tip.", "b2.angular_velocity_", "elbow.moment_"


def planar(poisson, model="exact"):
    deck = yaml.safe_load(PLANE)
    deck["materials"]["soft"]["poisson_ratio"] = poisson
    deck["solve"]["model"] = model
    return deck


def spatial(turn, poisson, model="exact", coordinates="auto", tilt=0.0, shift=(0.0, 0.0, 0.0)):
    """The planar scene in a plane of space; with a tilt of its axis and its weight it is no longer planar."""
    deck = posed.in_space(planar(poisson, model), np.eye(3), np.zeros(3))
    deck["gravity"][2] = 9.81 * tilt
    deck["solve"]["coordinates"] = coordinates
    others = ["b1.tip.deflection_y", "b1.tip.deflection_z", "energy.total", "energy.strain"]
    deck["output"]["channels"] = [name + axis for name in VECTORS for axis in "xyz"] + others
    return run(posed.moved(deck, turn, shift))


def run(deck):
    return {channel.name: channel.values for channel in solved(deck)[1].channels}


def vector(found, name):
    return np.stack([found[f"{name}{axis}"] for axis in "xyz"], axis=1)


@pytest.fixture(scope="module")
def tilted():
    return spatial(np.eye(3), 0.3, tilt=0.5)


@pytest.mark.parametrize("model", ["exact", "ancf"])
def test_a_planar_scene_in_a_plane_of_space_moves_as_in_the_plane(model):
    """Poisson's ratio zero: the section vector across the plane stays what it is."""
    plane = run(planar(0.0, model))
    found = spatial(R, 0.0, model)
    for name in ("b1.tip.", "b2.tip."):
        flat = np.stack([plane[name + "x"], plane[name + "y"], 0.0 * plane[name + "x"]], axis=1)
        assert vector(found, name) @ R == pytest.approx(flat, abs=1e-9)
    assert found["b1.tip.deflection_y"] == pytest.approx(plane["b1.tip.deflection"], abs=1e-9)
    assert np.ptp(plane["b1.tip.deflection"]) > 0.05
    spin, moment = vector(found, "b2.angular_velocity_") @ R, vector(found, "elbow.moment_") @ R
    assert spin[:, 2] == pytest.approx(plane["b2.angular_velocity"], abs=1e-7)
    assert moment[:, 2] == pytest.approx(plane["elbow.moment"], abs=1e-6)
    for name in ("energy.total", "energy.strain"):
        assert found[name] == pytest.approx(plane[name], abs=1e-8)


def test_contraction_across_the_plane_is_what_the_plane_leaves_out():
    """The planar element is in plane strain; in space it may become thinner."""
    plane = run(planar(0.3))
    found = spatial(np.eye(3), 0.3)
    assert np.abs(found["b2.tip.x"] - plane["b2.tip.x"]).max() > 1e-4


WAYS = [("ancf", "auto"), ("exact", "frame"), ("exact", "absolute")]


@pytest.mark.parametrize(("model", "coordinates"), WAYS)
def test_exact_in_both_coordinates_and_ancf_are_one(tilted, model, coordinates):
    found = spatial(np.eye(3), 0.3, model, coordinates, tilt=0.5)
    for name, values in tilted.items():
        tolerance = 1e-9 * max(1.0, np.abs(values).max()) if "moment" not in name else 1e-6
        assert found[name] == pytest.approx(values, abs=tolerance), name


def test_a_turned_and_shifted_scene_moves_the_same(tilted):
    shift = np.array([0.3, -2.0, 1.0])
    found = spatial(R, 0.3, tilt=0.5, shift=shift)
    for name in ("b1.tip.", "b2.tip."):
        assert vector(found, name) == pytest.approx(vector(tilted, name) @ R.T + shift, abs=1e-9)
    assert np.abs(tilted["b1.tip.deflection_z"]).max() > 0.02
    assert np.ptp(tilted["energy.total"]) < 1e-9
