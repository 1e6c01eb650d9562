"""Laws that hold for every element and every choice of strain and curvature."""

import numpy as np
import pytest
from analytical import (
    arc_energy,
    cable_row,
    cable_row_x,
    cable_row_xx,
    continuum_row,
    gauss,
    homogeneous_energy,
    jacobian,
    parabola_energy,
    stretch_energy,
    turned,
)

from hfsim.deck.materials import BeamProperties
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import ELEMENTS, Measures, join_laws

LENGTH = 0.7
STIFFNESS = BeamProperties(
    axial_stiffness=300.0, bending_stiffness=2.0, lame_lambda=500.0, lame_mu=400.0, height=0.3, width=0.2
)
INERTIA = BeamProperties(mass_per_length=1.7, rotary_inertia=0.05, height=0.3)

CABLE_OPTIONS = [(strain, bend) for strain in ("green", "engineering") for bend in ("linear", "exact")]
OPTIONS = [("cable", *o) for o in CABLE_OPTIONS] + [("continuum", "green", "linear")]


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_every_element_is_covered():
    assert {name for name, *_ in OPTIONS} == set(ELEMENTS)


def undeformed(element):
    return BeamMesh(element, 1, INERTIA).undeformed


def positions(element):
    return BeamMesh(element, 1, INERTIA).positions


class Energy:
    """Energy, gradient and Hessian of one element in its nodal components (n_batch, n)."""

    def __init__(self, name, strain, curvature, points=(5, 5)):
        self.element = ELEMENTS[name](LENGTH)
        self.law = self.element.law(STIFFNESS, 1, Measures(strain, curvature, *points))
        self.D = self.element.differences()

    def _vectors(self, p):
        return (self.D @ p.reshape(len(p), -1, 2))[:, None]

    def energy(self, p):
        return self.law.energy(self._vectors(p))[:, 0]

    def gradient(self, p):
        return (self.D.T @ self.law.gradient(self._vectors(p))[:, 0]).reshape(len(p), -1)

    def hessian(self, p):
        D = np.kron(self.D, np.eye(2))
        return D.T @ self.law.hessian(self._vectors(p))[:, 0] @ D


@pytest.fixture(params=OPTIONS, ids="-".join)
def option(request):
    return Energy(*request.param)


def bent(element, rng, size=0.15):
    P = undeformed(element)
    return P + size * rng.normal(size=P.shape) * np.where(positions(element), LENGTH, 1.0)[:, None]


def test_rigid_motion_strains_nothing(option, rng):
    P = undeformed(option.element)
    for angle in (0.0, 0.3, 2.0, -3.0):
        moved = P @ turned(angle).T + positions(option.element)[:, None] * rng.normal(size=2)
        p = moved.reshape(1, -1)
        scale = STIFFNESS.axial_stiffness * LENGTH
        assert abs(option.energy(p)[0]) < 1e-14 * scale
        assert np.abs(option.gradient(p)).max() < 1e-12 * scale / LENGTH


def test_force_is_the_slope_of_the_energy(option, rng):
    p = bent(option.element, rng).ravel()
    slope = jacobian(option.energy, p)
    assert option.gradient(p[None])[0] == pytest.approx(slope, rel=1e-9, abs=1e-9 * np.abs(slope).max())


def test_hessian_is_the_slope_of_the_force_and_symmetric(option, rng):
    p = bent(option.element, rng).ravel()
    H = option.hessian(p[None])[0]
    slope = jacobian(option.gradient, p)
    assert np.abs(H - slope).max() < 1e-9 * np.abs(H).max()
    assert np.abs(H - H.T).max() < 1e-13 * np.abs(H).max()


def test_energy_and_force_turn_with_the_element(option, rng):
    P = bent(option.element, rng)
    A = turned(rng.uniform(-3, 3))
    moved = P @ A.T + positions(option.element)[:, None] * rng.normal(size=2)
    here, there = P.reshape(1, -1), moved.reshape(1, -1)
    assert option.energy(there) == pytest.approx(option.energy(here), rel=1e-12)
    force = option.gradient(here).reshape(-1, 2) @ A.T
    assert np.abs(option.gradient(there).reshape(-1, 2) - force).max() < 1e-12 * np.abs(force).max()


def test_energy_is_positive_at_small_deformation(option):
    H = option.hessian(undeformed(option.element).reshape(1, -1))[0]
    sizes = np.linalg.eigvalsh(H)
    assert sizes[:3] == pytest.approx(np.zeros(3), abs=1e-11 * sizes[-1])
    assert sizes[3] > 1e-6 * sizes[-1]


def test_gauss_points_are_the_ones_asked_for(rng):
    p = bent(ELEMENTS["cable"](LENGTH), rng).reshape(1, -1)
    many = Energy("cable", "engineering", "exact", (12, 12)).energy(p)
    few = Energy("cable", "engineering", "exact", (3, 2)).energy(p)
    assert abs(few - many) > 1e-6 * many
    for points in ((5, 3), (3, 5)):
        a = Energy("cable", "engineering", "linear", points).energy(p)
        b = Energy("cable", "engineering", "linear", (points[0], 9)).energy(p)
        assert a == pytest.approx(b, rel=1e-12)


@pytest.mark.parametrize(("strain", "curvature"), CABLE_OPTIONS)
def test_cable_energy_is_the_integral_of_strain_and_curvature(strain, curvature, rng):
    p = bent(ELEMENTS["cable"](LENGTH), rng).reshape(1, -1)
    whole = Energy("cable", strain, curvature, (20, 20)).energy(p)[0]
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


def test_laws_of_many_elements_act_one_by_one(rng):
    for name, strain, curvature in OPTIONS:
        element = ELEMENTS[name](LENGTH)
        other = STIFFNESS._replace(bending_stiffness=5.0, axial_stiffness=80.0)
        if name == "continuum":
            other = STIFFNESS
        laws = [element.law(s, n, Measures(strain, curvature)) for s, n in ((STIFFNESS, 2), (other, 1))]
        V = element.differences() @ np.array([bent(element, rng) for _ in range(3)])
        joined = join_laws(laws)
        for method in ("energy", "gradient", "hessian"):
            parts = [getattr(laws[0], method)(V[None, :2]), getattr(laws[1], method)(V[None, 2:])]
            both = np.concatenate(parts, axis=1)
            assert np.abs(getattr(joined, method)(V[None]) - both).max() < 1e-12 * np.abs(both).max()


# ---------------------------------------------------------------- mass


def test_mass_is_the_integral_of_the_shapes():
    x, wx = gauss(12, 0, LENGTH)
    y, wy = gauss(6, -INERTIA.height / 2, INERTIA.height / 2)
    line, section = np.zeros((4, 4)), np.zeros((6, 6))
    for a, p in zip(x, wx, strict=True):
        N, Nx = cable_row(a, LENGTH), cable_row_x(a, LENGTH)
        line += p * (INERTIA.mass_per_length * np.outer(N, N) + INERTIA.rotary_inertia * np.outer(Nx, Nx))
        for b, q in zip(y, wy, strict=True):
            N = continuum_row(a, b, LENGTH)
            section += p * q * INERTIA.mass_per_length / INERTIA.height * np.outer(N, N)
    expected = {"cable": line, "continuum": section}
    for name, element in ELEMENTS.items():
        M = element(LENGTH).mass(INERTIA)
        assert np.abs(M - expected[name]).max() < 1e-13 * np.abs(M).max()


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
def test_uniform_stretch(stretch):
    for name, strain, curvature in OPTIONS:
        law = Energy(name, strain, curvature)
        P = undeformed(law.element) * [stretch, 1.0]
        energy = law.energy(P.reshape(1, -1))[0]
        if name == "continuum":
            expected = homogeneous_energy(np.diag([stretch, 1.0]), 500.0, 400.0, LENGTH * 0.06)
        else:
            expected = stretch_energy(stretch, 300.0, LENGTH, strain)
        assert energy == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_homogeneous_deformation_of_the_continuum(rng):
    law = Energy("continuum", "green", "linear")
    for _ in range(5):
        F = np.eye(2) + 0.3 * rng.normal(size=(2, 2))
        energy = law.energy((undeformed(law.element) @ F.T).reshape(1, -1))[0]
        assert energy == pytest.approx(homogeneous_energy(F, 500.0, 400.0, LENGTH * 0.06), rel=1e-12)


def test_pure_bending_of_one_element():
    k = 0.6
    P = np.array([[0, 0], [1, 0], [LENGTH, k * LENGTH**2 / 2], [1, k * LENGTH]])
    energy = Energy("cable", "green", "linear").energy(P.reshape(1, -1))[0]
    assert energy == pytest.approx(parabola_energy(k, 300.0, 2.0, LENGTH), rel=1e-12)
    k = 1e-4
    end = [[LENGTH, k * LENGTH**2 / 2], [1, k * LENGTH], [-k * LENGTH, 1]]
    section = np.array([[0, 0], [1, 0], [0, 1], *end])
    energy = Energy("continuum", "green", "linear").energy(section.reshape(1, -1))[0]
    EI = (500.0 + 800.0) * 0.2 * 0.3**3 / 12
    assert energy == pytest.approx(arc_energy(k, EI, LENGTH), rel=1e-6)


def arc(element, count, k, length):
    """Nodal vectors on a circular arc, all gradients of length one."""
    a = np.linspace(0.0, k * length, count + 1)
    place = np.stack([np.sin(a), 1 - np.cos(a)], axis=-1) / k
    along, across = np.stack([np.cos(a), np.sin(a)], -1), np.stack([-np.sin(a), np.cos(a)], -1)
    return np.stack([place, along, across][: element.per_node], axis=1).reshape(-1, 2)


@pytest.mark.parametrize(("strain", "curvature"), CABLE_OPTIONS)
def test_refinement_of_a_circular_arc_converges(strain, curvature):
    k, length, errors = 1.5, 1.0, []
    for count in (2, 4, 8, 16):
        mesh = BeamMesh(ELEMENTS["cable"](length / count), count, INERTIA)
        law = mesh.element.law(STIFFNESS, count, Measures(strain, curvature))
        V = (mesh.differences @ arc(mesh.element, count, k, length)).reshape(1, count, -1, 2)
        errors.append(abs(law.energy(V).sum() - arc_energy(k, STIFFNESS.bending_stiffness, length)))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates[-1] == pytest.approx(4.0, abs=0.15), rates
