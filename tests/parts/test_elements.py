"""The cable for every choice of strain and curvature, and shapes and masses of all elements in the plane."""

import numpy as np
import pytest
from analytical import (
    arc_energy,
    cable_row,
    cable_row_x,
    cable_row_xx,
    continuum_row,
    gauss,
    parabola_energy,
    stretch_energy,
    turned,
)
from element_laws import Energy, check_joined, check_moved, check_slopes, check_undeformed

from hfsim.deck.materials import BeamProperties
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import ELEMENTS, Measures, join_laws

LENGTH = 0.7
STIFFNESS = BeamProperties(
    axial_stiffness=300.0, bending_stiffness=2.0, lame_lambda=500.0, lame_mu=400.0, height=0.3, width=0.2
)
INERTIA = BeamProperties(mass_per_length=1.7, rotary_inertia=0.05, height=0.3)

CABLE = ELEMENTS["cable"](LENGTH)
OPTIONS = [(strain, bend) for strain in ("green", "engineering") for bend in ("linear", "exact")]


def undeformed(element):
    return BeamMesh(element, 1, INERTIA).undeformed


def positions(element):
    return BeamMesh(element, 1, INERTIA).positions


def energy_of(name, strain="green", curvature="linear", points=(5, 5)):
    element = ELEMENTS[name](LENGTH)
    law = element.law(STIFFNESS, 1, Measures(strain, curvature, *points))
    return Energy(law, element.differences()[None], 2)


@pytest.fixture(params=OPTIONS, ids="-".join)
def option(request):
    return energy_of("cable", *request.param)


def bent(rng, size=0.15):
    P = undeformed(CABLE)
    return P + size * rng.normal(size=P.shape) * np.where(positions(CABLE), LENGTH, 1.0)[:, None]


def test_only_rigid_motions_strain_nothing(option, rng):
    turns = [turned(angle) for angle in (0.0, 0.3, 2.0, -3.0)]
    check_undeformed(option, undeformed(CABLE), positions(CABLE), turns, rng)


def test_force_and_hessian_are_slopes_of_the_energy(option, rng):
    check_slopes(option, bent(rng).ravel())


def test_energy_and_force_turn_with_the_element(option, rng):
    check_moved(option, bent(rng), positions(CABLE), turned(rng.uniform(-3, 3)), rng.normal(size=2))


def test_gauss_points_are_the_ones_asked_for(rng):
    p = bent(rng).reshape(1, -1)
    many = energy_of("cable", "engineering", "exact", (12, 12)).energy(p)
    few = energy_of("cable", "engineering", "exact", (3, 2)).energy(p)
    assert abs(few - many) > 1e-6 * many
    for points in ((5, 3), (3, 5)):
        a = energy_of("cable", "engineering", "linear", points).energy(p)
        b = energy_of("cable", "engineering", "linear", (points[0], 9)).energy(p)
        assert a == pytest.approx(b, rel=1e-12)


@pytest.mark.parametrize(("strain", "curvature"), OPTIONS)
def test_cable_energy_is_the_integral_of_strain_and_curvature(strain, curvature, rng):
    p = bent(rng).reshape(1, -1)
    whole = energy_of("cable", strain, curvature, (20, 20)).energy(p)[0]
    x, w = gauss(40, 0, LENGTH)
    P = p.reshape(-1, 2)
    total = 0.0
    for place, weight in zip(x, w, strict=True):
        s = cable_row_x(place, LENGTH) @ P
        c = cable_row_xx(place, LENGTH) @ P
        stretch = np.linalg.norm(s)
        e = stretch - 1 if strain == "engineering" else (stretch**2 - 1) / 2
        kappa2 = ((s[0] * c[1] - s[1] * c[0]) / stretch**2) ** 2 if curvature == "exact" else c @ c
        total += weight * (STIFFNESS.axial_stiffness * e**2 + STIFFNESS.bending_stiffness * kappa2) / 2
    assert whole == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("option", OPTIONS)
def test_laws_of_many_elements_act_one_by_one(option, rng):
    other = STIFFNESS._replace(bending_stiffness=5.0, axial_stiffness=80.0)
    laws = [CABLE.law(own, count, Measures(*option)) for own, count in ((STIFFNESS, 2), (other, 1))]
    check_joined(join_laws, laws, CABLE.differences() @ np.array([bent(rng) for _ in range(3)]))


# ---------------------------------------------------------------- mass


def test_mass_is_the_integral_of_the_shapes():
    line = np.zeros((4, 4))
    for a, p in zip(*gauss(12, 0, LENGTH), strict=True):
        N, Nx = cable_row(a, LENGTH), cable_row_x(a, LENGTH)
        line += p * (INERTIA.mass_per_length * np.outer(N, N) + INERTIA.rotary_inertia * np.outer(Nx, Nx))
    assert np.abs(CABLE.mass(INERTIA) - line).max() < 1e-13 * np.abs(line).max()


def test_mass_and_rotary_inertia_of_a_rigid_beam():
    own = {"cable": INERTIA.rotary_inertia, "continuum": INERTIA.mass_per_length * INERTIA.height**2 / 12}
    for name, element in ELEMENTS.items():
        mesh = BeamMesh(element(LENGTH / 3), 3, INERTIA)
        assert mesh.positions @ mesh.mass @ mesh.positions == pytest.approx(1.7 * LENGTH, rel=1e-13)
        spin = mesh.undeformed
        inertia = np.sum(spin * (mesh.mass @ spin))
        assert inertia == pytest.approx(1.7 * LENGTH**3 / 3 + own[name] * LENGTH, rel=1e-12)


def test_shapes_and_their_derivatives():
    rows = {"cable": lambda x, y: cable_row(x, LENGTH), "continuum": lambda x, y: continuum_row(x, y, LENGTH)}
    for name, cls in ELEMENTS.items():
        element = cls(LENGTH)
        for xi, y in ((0.0, 0.1), (0.37, -0.05), (1.0, 0.02)):
            assert element.shape(xi, y) == pytest.approx(rows[name](xi * LENGTH, y), abs=1e-14)
            assert element.shape(xi, y) @ positions(element) == pytest.approx(1.0)
            h = 1e-4
            by_x = (element.shape(xi + h / LENGTH, y) - element.shape(xi - h / LENGTH, y)) / (2 * h)
            by_y = (element.shape(xi, y + h) - element.shape(xi, y - h)) / (2 * h)
            ends = [element.shape(xi + s * h / LENGTH, y, (1, 0)) for s in (1, -1)]
            assert element.shape(xi, y, (1, 0)) == pytest.approx(by_x, abs=1e-6)
            assert element.shape(xi, y, (2, 0)) == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-6)
            if name == "continuum":
                assert element.shape(xi, y, (0, 1)) == pytest.approx(by_y, abs=1e-9)


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize("stretch", [0.8, 1.0, 1.3])
@pytest.mark.parametrize(("strain", "curvature"), OPTIONS)
def test_uniform_stretch(strain, curvature, stretch):
    P = undeformed(CABLE) * [stretch, 1.0]
    energy = energy_of("cable", strain, curvature).energy(P.reshape(1, -1))[0]
    assert energy == pytest.approx(stretch_energy(stretch, 300.0, LENGTH, strain), rel=1e-12, abs=1e-12)


def test_pure_bending_of_one_element():
    k = 0.6
    P = np.array([[0, 0], [1, 0], [LENGTH, k * LENGTH**2 / 2], [1, k * LENGTH]])
    energy = energy_of("cable").energy(P.reshape(1, -1))[0]
    assert energy == pytest.approx(parabola_energy(k, 300.0, 2.0, LENGTH), rel=1e-12)
    k = 1e-4
    end = [[LENGTH, k * LENGTH**2 / 2], [1, k * LENGTH], [-k * LENGTH, 1]]
    section = np.array([[0, 0], [1, 0], [0, 1], *end])
    energy = energy_of("continuum").energy(section.reshape(1, -1))[0]
    EI = (500.0 + 800.0) * 0.2 * 0.3**3 / 12
    assert energy == pytest.approx(arc_energy(k, EI, LENGTH), rel=1e-6)


def arc(element, count, k, length):
    """Nodal vectors on a circular arc, all gradients of length one."""
    a = np.linspace(0.0, k * length, count + 1)
    place = np.stack([np.sin(a), 1 - np.cos(a)], axis=-1) / k
    along, across = np.stack([np.cos(a), np.sin(a)], -1), np.stack([-np.sin(a), np.cos(a)], -1)
    return np.stack([place, along, across][: element.per_node], axis=1).reshape(-1, 2)


@pytest.mark.parametrize(("strain", "curvature"), OPTIONS)
def test_refinement_of_a_circular_arc_converges(strain, curvature):
    k, length, errors = 1.5, 1.0, []
    for count in (2, 4, 8, 16):
        mesh = BeamMesh(ELEMENTS["cable"](length / count), count, INERTIA)
        law = mesh.element.law(STIFFNESS, count, Measures(strain, curvature))
        V = (mesh.differences @ arc(mesh.element, count, k, length)).reshape(1, count, -1, 2)
        errors.append(abs(law.energy(V).sum() - arc_energy(k, STIFFNESS.bending_stiffness, length)))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates[-1] == pytest.approx(4.0, abs=0.15), rates
