"""Damping of lines: of the strain of their energy and of their curvature, at the points of their energy."""

import numpy as np
import pytest
from analytical import along, cable_row_x, cable_row_xx, gauss
from damping import check_damping

from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

AXIAL, BENDING, EA, EI = 0.05, 0.03, 1000.0, 2.0
DECK = """
hfsim: 1
gravity: {gravity}
materials:
  soft: {{density: 900.0, youngs_modulus: 1.0e6, axial_damping: {axial}, bending_damping: {bending}}}
sections: {{bar: {{area: 1.0e-3, second_moment: 2.0e-6}}}}
bodies:
  b: {{type: beam, element: cable, material: soft, section: bar, length: 1.0, elements: 2, {options}}}
solve: {{model: {model}, duration: 1.0}}
"""
KINDS = {
    "green": ("strain: green", 5, 5),
    "green, at points": ("strain: green, curvature: exact, quadrature: {axial: 4, bending: 2}", 4, 2),
    "engineering": ("strain: engineering", 5, 5),
    "engineering, at points": ("strain: engineering, quadrature: {axial: 3, bending: 6}", 3, 6),
    "both": ("strain: engineering, curvature: exact", 5, 5),
    "both, at points": ("strain: engineering, curvature: exact, quadrature: {axial: 5, bending: 3}", 5, 3),
}
EACH = pytest.mark.parametrize("kind", KINDS)
SPACES = pytest.mark.parametrize("n_dim", [2, 3])


def damped(kind, n_dim, model="ancf", axial=AXIAL, bending=BENDING):
    own = {"gravity": [0.0] * n_dim, "model": model, "axial": axial, "bending": bending}
    return build(parse_deck(DECK.format(**own, options=KINDS[kind][0])))


@EACH
@SPACES
def test_a_stretching_bar_pulls_by_its_strain_and_the_rate_of_that(kind, n_dim):
    """With e = t^2 by EA (e + tau e'), e being |r'| - 1; with Green's E = e + e^2 / 2 by (1 + e) of that."""
    system, t = damped(kind, n_dim).system, np.array([0.1, 0.4, 0.6])
    e, rate = t**2, 2.0 * t
    along_it = np.array([0.6, 0.8, 0.0])[:n_dim]
    places = np.array([[0.0], [1.0], [0.5], [1.0], [1.0], [1.0]]) * along_it
    x, u = np.multiply.outer(1.0 + e, places.ravel()), np.multiply.outer(rate, places.ravel())
    tip = system.force(t, x, u).reshape(len(t), -1, n_dim)[:, -2]
    pull = EA * (e + AXIAL * rate)
    if kind.startswith("green"):
        pull = EA * (1.0 + e) * (e + e**2 / 2 + AXIAL * (1.0 + e) * rate)
    assert tip == pytest.approx(-np.outer(pull, along_it), rel=1e-12, abs=1e-9)


@EACH
@SPACES
def test_what_is_lost_is_the_square_of_the_rates_at_the_points_of_the_energy(kind, n_dim, rng):
    system, (_, *points) = damped(kind, n_dim).system, KINDS[kind]
    nodes = np.kron([[0.0], [1.0], [0.5], [1.0], [1.0], [1.0]], np.eye(n_dim)[:1])
    x, u = 0.02 * rng.normal(size=nodes.size) + nodes.ravel(), rng.normal(size=nodes.size)

    def squared(s, element, a, bent):
        r = (x + np.outer(s, u)).reshape(len(s), 6, n_dim)[:, 2 * element : 2 * element + 4]
        r1, r2 = cable_row_x(a, 0.5) @ r, cable_row_xx(a, 0.5) @ r
        square, share = np.sum(r1 * r1, axis=-1), np.sum(r1 * r2, axis=-1)
        if bent:
            return (square * np.sum(r2 * r2, axis=-1) - share**2) / square**2
        return (0.5 * square if kind.startswith("green") else np.sqrt(square)) ** 2

    lost = 0.0
    for bent, (number, factor) in enumerate(zip(points, (EA * AXIAL, EI * BENDING), strict=True)):
        for element in range(2):
            for a, weight in zip(*gauss(number, 0.0, 0.5), strict=True):
                rate = along(lambda s, at=(element, a, bent): squared(s, *at), 1e-3)
                lost += factor * weight * rate**2 / (4.0 * squared(np.zeros(1), element, a, bent)[0])
    assert system.power(np.zeros(1), x[None], u[None])[0] == pytest.approx(-lost, rel=1e-8)


@EACH
@SPACES
def test_damping_of_lines_has_its_slopes_takes_energy_and_resists_no_turning(kind, n_dim, rng):
    check_damping(damped(kind, n_dim), rng, slice(n_dim, None))


@pytest.mark.parametrize("numbers", ["{axial: 5, bending: 3}", "{axial: 2, bending: 1}"])
@pytest.mark.parametrize("model", ["ancf", "linear"])
@SPACES
def test_damping_of_the_undeformed_line_is_its_stiffness_by_the_time(numbers, model, n_dim, rng, monkeypatch):
    """With as few points too as leave some motions without stiffness, and without damping then."""
    monkeypatch.setitem(KINDS, "few", (f"strain: engineering, curvature: exact, quadrature: {numbers}",))
    scene = damped("few", n_dim, model, axial=0.02, bending=0.02)
    x, t, n = scene.system.absolute(scene.q[None]), np.zeros(1), scene.system.n_x
    K, D = np.zeros((n, n)), np.zeros((n, n))
    for part in scene.system.forces:
        for matrix, entries in ((K, part.tangent(t, x, 0.0 * x)), (D, part.rate_tangent(t, x, 0.0 * x))):
            np.add.at(matrix, (entries.rows, entries.columns), entries.values)
    assert np.abs(D - 0.02 * K).max() < 1e-6 * np.abs(D).max()
