"""Cable elements of higher degree: their functions, their energy, and how fast they converge."""

from itertools import pairwise
from operator import methodcaller

import numpy as np
import pytest
from analytical import cable_row_xx, gauss, jacobian, quintic_row
from element_laws import gradient_of

from hfsim.deck.materials import BeamProperties
from hfsim.errors import DeckError
from hfsim.maths.shapes import hierarchic, interior
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import ELASTIC_FORMS, Cable, Measures, elastic_form
from hfsim.parts.elements.cable import LAST_GRAM_DEGREE
from hfsim.parts.elements.polynomial import difference_rows, exact_points, green_linear_law
from hfsim.parts.elements.quadrature import QuadratureLaw
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

LENGTH = 0.7
STIFFNESS = BeamProperties(
    axial_stiffness=300.0, bending_stiffness=2.0, lame_lambda=500.0, lame_mu=400.0, height=0.3, width=0.2
)
INERTIA = BeamProperties(mass_per_length=1.7, rotary_inertia=0.05, height=0.3)
HIGH = [4, 5, 7, 12]


def bent(element, rng, count=1, size=0.1):
    """Difference vectors of elements that are bent at random, shape (1, count, degree, 2)."""
    straight = element.differences() @ BeamMesh(element, 1, INERTIA).undeformed
    return straight + size * rng.normal(size=(1, count, *straight.shape)) / element.degree


# ---------------------------------------------------------------- functions


@pytest.mark.parametrize("degree", HIGH)
def test_interior_functions_vanish_with_their_slopes_at_both_ends(degree):
    ends = np.array([0.0, 1.0])
    for derivative in (0, 1):
        assert not interior(ends, degree, derivative).any()
    assert np.abs(interior(np.linspace(0, 1, 300), degree, 1)).max() < 1.1


@pytest.mark.parametrize("degree", HIGH)
def test_derivatives_of_the_functions(degree):
    x, h = np.linspace(0.05, 0.95, 17), 1e-3
    for order in (1, 2):
        around = [hierarchic(x + k * h, degree, order - 1) for k in (-3, -2, -1, 1, 2, 3)]
        weights = np.array([-1, 9, -45, 45, -9, 1]) / (60 * h)
        slope = sum(w * values for w, values in zip(weights, around, strict=True))
        assert np.abs(hierarchic(x, degree, order) - slope).max() < 1e-7
    with pytest.raises(ValueError, match="order 3"):
        interior(x, degree, 3)


@pytest.mark.parametrize("degree", HIGH)
def test_functions_make_up_all_polynomials_of_their_degree(degree):
    x = np.linspace(0, 1, 40)
    values = hierarchic(x, degree)
    assert values.shape == (40, degree + 1)
    for power in range(degree + 1):
        coefficients, *_ = np.linalg.lstsq(values, x**power, rcond=None)
        assert np.abs(values @ coefficients - x**power).max() < 1e-12


def test_interior_bending_is_uncoupled():
    x, w = gauss(20, 0, 1)
    bend = hierarchic(x, 12, 2)
    K = (bend.T * w) @ bend
    inner = K[2:-2, 2:-2]
    assert np.abs(K[2:-2, [0, 1, -2, -1]]).max() < 1e-11
    assert np.abs(inner - np.diag(np.diag(inner))).max() < 1e-11
    assert np.diag(inner) == pytest.approx(2 * np.arange(2, 11) + 1)


def test_the_quintic_written_out():
    element = Cable(LENGTH, degree=5)
    for x in (0.0, 0.2, 0.55, LENGTH):
        assert element.shape(x / LENGTH) == pytest.approx(quintic_row(x, LENGTH), abs=1e-15)
        ends = element.shape(x / LENGTH, 0.0, (2, 0))[[0, 1, -2, -1]]
        assert ends == pytest.approx(cable_row_xx(x, LENGTH), abs=1e-12)


# ---------------------------------------------------------------- mass and energy


@pytest.mark.parametrize("degree", HIGH)
def test_mass_is_the_integral_of_the_shapes(degree):
    element, M = Cable(LENGTH, degree), 0.0
    for x, weight in zip(*gauss(25, 0, 1), strict=True):
        N, Nx = element.shape(x), element.shape(x, 0.0, (1, 0))
        line = INERTIA.mass_per_length * np.outer(N, N) + INERTIA.rotary_inertia * np.outer(Nx, Nx)
        M = M + weight * LENGTH * line
    assert np.abs(element.mass(INERTIA) - M).max() < 1e-14 * np.abs(M).max()


MEASURES = [Measures(strain, bend) for strain in ("green", "engineering") for bend in ("linear", "exact")]


@pytest.mark.parametrize("degree", HIGH)
@pytest.mark.parametrize("measures", MEASURES, ids=lambda m: f"{m.strain}-{m.curvature}")
def test_force_and_tangent_are_slopes(degree, measures, rng):
    element = Cable(LENGTH, degree)
    law, V = element.law(STIFFNESS, 1, measures), bent(element, rng)
    flat = (-1, 1, degree, 2)
    force = gradient_of(law, V).ravel()
    slope = jacobian(lambda p: law.energy(p.reshape(flat))[:, 0], V.ravel())
    assert np.abs(force - slope).max() < 1e-9 * np.abs(force).max()
    slope = jacobian(lambda p: gradient_of(law, p.reshape(flat)).reshape(len(p), -1), V.ravel())
    assert np.abs(law.hessian(V)[0, 0] - slope).max() < 1e-9 * np.abs(slope).max()


@pytest.mark.parametrize("degree", [3, *HIGH])
def test_both_forms_of_the_polynomial_energy_are_exact(degree, rng):
    element = Cable(LENGTH, degree)
    V = bent(element, rng, 3)
    products = green_linear_law(STIFFNESS, LENGTH, 3, degree)

    def by_points(n):
        axial = np.full((1, 3), STIFFNESS.axial_stiffness * LENGTH)
        bending = np.full((1, 3), STIFFNESS.bending_stiffness / LENGTH)
        return QuadratureLaw(axial, bending, False, False, n, n, degree)

    enough, more = by_points(exact_points(degree)), by_points(exact_points(degree) + 7)
    asked = (methodcaller("energy", V), lambda law: gradient_of(law, V), methodcaller("hessian", V))
    for of in asked:
        a, b, c = (of(law) for law in (products, enough, more))
        assert np.abs(a - c).max() < 1e-12 * np.abs(c).max()
        assert np.abs(b - c).max() < 1e-12 * np.abs(c).max()
    fewer = by_points(exact_points(degree) - 1)
    # one point fewer misses the highest power alone, which is small
    assert np.abs(fewer.energy(V) - more.energy(V)).max() > 1e-14 * more.energy(V).max()
    chosen = element.law(STIFFNESS, 3)
    assert isinstance(chosen, QuadratureLaw) == (degree > LAST_GRAM_DEGREE)
    for of in asked:
        a, c = (of(law) for law in (chosen, more))
        assert np.abs(a - c).max() < 1e-12 * np.abs(c).max()


def test_default_points_follow_the_degree_and_stated_ones_are_obeyed():
    law = Cable(LENGTH, 6).law(STIFFNESS, 1, Measures("engineering"))
    assert (law.axial_points, law.bending_points) == (11, 11)
    law = Cable(LENGTH, 6).law(STIFFNESS, 1, Measures("engineering", "exact", 5, 3))
    assert (law.axial_points, law.bending_points) == (5, 3)


@pytest.mark.parametrize("degree", [LAST_GRAM_DEGREE, 6])
def test_the_forms_of_the_stiffness_agree(degree, rng):
    element = Cable(LENGTH, degree)
    forms = [elastic_form(name).of(element, STIFFNESS) for name in ELASTIC_FORMS]
    p = BeamMesh(element, 1, INERTIA).undeformed.reshape(-1, 1) + 0.1 * rng.normal(size=(2 * degree + 2, 2))
    for name in ("stiffness", "force", "tangent"):
        first, *others = (getattr(form, name)(p) for form in forms)
        for other in others:
            # K itself may differ by what K p does not see
            if name != "stiffness":
                assert np.abs(other - first).max() < 1e-11 * np.abs(first).max()


# ---------------------------------------------------------------- closed forms


def assembled(count, degree, measures):
    """Mesh of a beam of length 1 with gather matrix and law."""
    mesh = BeamMesh(Cable(1.0 / count, degree), count, BeamProperties(mass_per_length=1.0))
    stiffness = BeamProperties(axial_stiffness=300.0, bending_stiffness=1.0)
    return mesh, mesh.element.law(stiffness, count, measures)


def rolled_up(count, degree, angle):
    """Largest error of the tip of a cantilever that a moment at its end bends into an arc."""
    mesh, law = assembled(count, degree, Measures("engineering", "exact"))
    D = np.kron(mesh.differences, np.eye(2))
    x, keep = mesh.undeformed.ravel().copy(), np.delete(np.arange(2 * mesh.n_vectors), [0, 1, 3])
    shape = (1, count, degree, 2)
    for moment in angle * np.linspace(0.1, 1.0, 10):
        for _ in range(12):
            V = (D @ x).reshape(shape)
            slope = x[-2:]
            square = slope @ slope
            turn = np.array([-slope[1], slope[0]]) / square
            r = D.T @ gradient_of(law, V).ravel()
            r[-2:] -= moment * turn
            K = np.zeros((len(x), len(x)))
            for e, H in enumerate(law.hessian(V)[0]):
                rows = D[2 * degree * e : 2 * degree * (e + 1)]
                K += rows.T @ H @ rows
            K[-2:, -2:] -= moment * (
                np.array([[0.0, -1.0], [1.0, 0.0]]) / square - 2 * np.outer(turn, slope) / square
            )
            step = np.linalg.solve(K[np.ix_(keep, keep)], -r[keep])
            x[keep] += step
            if np.abs(step).max() < 1e-13:
                break
    tip = np.array([np.sin(angle), 1.0 - np.cos(angle)]) / angle
    return np.abs(x[-4:-2] - tip).max()


def test_roll_up_converges_exponentially_with_the_degree():
    errors = [rolled_up(1, degree, np.pi) for degree in (4, 6, 8, 10)]
    assert errors[-1] < 1e-7
    assert all(b < 0.1 * a for a, b in pairwise(errors)), errors


def frequencies(count, degree, pinned=False):
    """Circular frequencies of a beam with length, mass and EI 1, clamped and free or pinned at both ends."""
    mesh, law = assembled(count, degree, Measures())
    straight = (mesh.differences @ mesh.undeformed).reshape(1, count, degree, 2)
    K = np.zeros((mesh.n_vectors, mesh.n_vectors))
    for e, H in enumerate(law.hessian(straight)[0]):
        rows = mesh.differences[degree * e : degree * (e + 1)]
        K += rows.T @ H[1::2, 1::2] @ rows
    keep = np.delete(np.arange(mesh.n_vectors), [0, mesh.n_vectors - 2] if pinned else [0, 1])
    part = np.ix_(keep, keep)
    L = np.linalg.inv(np.linalg.cholesky(mesh.mass[part]))
    return np.sqrt(np.linalg.eigvalsh(L @ K[part] @ L.T))


CANTILEVER = np.array([1.875104068711961, 4.694091132974174]) ** 2


def test_cantilever_frequencies_converge_exponentially_with_the_degree():
    errors = np.array([np.abs(frequencies(1, p)[:2] / CANTILEVER - 1) for p in (3, 5, 7, 9, 11)])
    assert np.all(errors[-1] < 1e-8), errors
    ratios = errors[1:, 0] / errors[:-1, 0]
    # the logarithm of the error falls faster than linearly until round-off
    assert np.all(ratios[:2] < 0.03) and ratios[1] < 2 * ratios[0], errors


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_pinned_frequencies_converge_with_the_elements(degree):
    """The frequency of conforming elements of degree p has an error of order 2 (p - 1)."""
    errors = [abs(frequencies(n, degree, True)[1] / (4 * np.pi**2) - 1) for n in (4, 8)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * (degree - 1), abs=0.2), errors


# ---------------------------------------------------------------- decks

DECK = """
hfsim: 1
name: case
gravity: [0.0, -9.81]
materials: {{rubber: {{density: 5540.0, youngs_modulus: 7.0e5}}}}
sections: {{strip: {{area: 1.8e-3, second_moment: 1.215e-8}}}}
bodies:
  b1: {{type: beam, material: rubber, section: strip, length: 1.2, elements: {elements}, degree: {degree}}}
joints: {{pin: {{type: revolute, between: [ground, b1.root]}}}}
solve: {{coordinates: frame, model: {model}, duration: 0.3, tolerance: 1.0e-10}}
output: {{interval: 0.05, channels: [b1.tip.x, b1.tip.y, b1.angle]}}
"""


def run(model, elements, degree):
    return simulate(
        parse_deck(DECK.format(model=model, elements=elements, degree=degree)), error_estimate=False
    )


@pytest.mark.parametrize(("elements", "degree"), [(2, 5), (1, 7)])
def test_exact_and_ancf_move_alike(elements, degree):
    a, b = (run(model, elements, degree) for model in ("exact", "ancf"))
    assert a.statistics["unknowns"] == 2 * (elements * (degree - 1) + 2)
    for one, other in zip(a.channels, b.channels, strict=True):
        assert np.abs(one.values - other.values).max() < 1e-9


def test_few_elements_of_high_degree_do_what_many_cubic_ones_do(monkeypatch):
    monkeypatch.setitem(globals(), "DECK", DECK.replace("7.0e5", "2.0e8"))
    many, few = run("ancf", 8, 3), run("ancf", 2, 7)
    for one, other in zip(many.channels[:2], few.channels[:2], strict=True):
        assert np.abs(one.values - other.values).max() < 4e-4


@pytest.mark.parametrize("degree", [2, 13, 4.5])
def test_degrees_out_of_range_are_refused(degree):
    with pytest.raises(DeckError, match="degree"):
        parse_deck(DECK.format(model="exact", elements=2, degree=degree))


def test_points_inside_an_element_move_with_its_interior_vectors(rng):
    scene = build(parse_deck(DECK.format(model="ancf", elements=2, degree=6)))
    x = scene.system.absolute(scene.q[None])
    x = x + 0.05 * rng.normal(size=x.shape)
    nodes = x.reshape(-1, 2)
    marker = scene.bodies["b1"].marker((0.9, 0.0))
    rows = Cable(0.6, 6).shape(0.5)
    assert marker.position(x)[0] == pytest.approx(rows @ nodes[5:], abs=1e-14)
    slope = (difference_rows(np.array([0.5]), 1, 6) @ (Cable(0.6, 6).differences() @ nodes[5:]))[0]
    assert marker.angle(x)[0] == pytest.approx(np.arctan2(slope[1], slope[0]), abs=1e-13)
