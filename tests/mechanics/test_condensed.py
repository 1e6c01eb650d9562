"""Equations of motion without what roots hold, against the whole equations."""

from dataclasses import replace

import numpy as np
import pytest

from hfsim.mechanics import equations
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

MATERIAL = """
hfsim: 1
name: case
gravity: {gravity}
materials: {{soft: {{density: 900.0, youngs_modulus: 2.0e7}}}}
sections: {{bar: {{shape: {shape}}}}}
"""
PLANE = MATERIAL.format(gravity=[0.0, -9.81], shape="rectangle, width: 0.05, height: 0.04")
SPACE = MATERIAL.format(gravity=[0.0, 1.0, -9.81], shape="circle, diameter: 0.05")
BEAM = "type: beam, material: soft, section: bar, element: cable"
CHAIN = f"""
bodies:
  hub: {{type: rigid, mass: 2.0, inertia: %s, points: {{rim: %s}}}}
  b1: {{{BEAM}, length: 1.5, elements: %d, degree: %d, truncation: %s}}
  b2: {{{BEAM}, length: 1.2, elements: %d}}
  b3: {{{BEAM}, length: 0.7, elements: %d}}
joints:
  pin: {{type: %s, between: [ground, hub]}}
  mount: {{type: fixed, between: [hub.rim, b1.root]}}
  elbow: {{type: %s, between: [b1.tip, b2.root]}}
solve: {{model: lowOrder, duration: 1.0}}
"""


def planar(elements, degree=3, truncation="second_order"):
    first, second = elements
    given = (0.1, [0.2, 0.0], first, degree, truncation, second, first, "revolute", "revolute")
    return build(parse_deck(PLANE + CHAIN % given))


def spatial(elements, degree=3, truncation="second_order"):
    first, second = elements
    inertia, rim = [0.1, 0.1, 0.2], [0.2, 0.0, 0.0]
    given = (inertia, rim, first, degree, truncation, second, first, "spherical", "spherical")
    return build(parse_deck(SPACE + CHAIN % given))


def states(scene, rng, size=0.02, count=4):
    """States near the start with rates, (t, x, u), some of them much deflected."""
    system = scene.system
    q = scene.q + size * rng.normal(size=(count, system.n))
    v = scene.v + rng.normal(size=q.shape)
    return np.zeros(count), system.absolute(q), system.absolute_velocity(q, v)


SCENES = [
    (planar, (7, 4), {}),
    (planar, (3, 3), {"degree": 6}),
    (planar, (5, 2), {"truncation": "none"}),
    (spatial, (4, 3), {}),
    (spatial, (3, 2), {"degree": 5, "truncation": "none"}),
]


@pytest.mark.parametrize(("make", "elements", "options"), SCENES)
def test_accelerations_are_those_of_the_whole_equations(make, elements, options, rng):
    scene = make(elements, **options)
    system = scene.system
    t, x, u = states(scene, rng)
    own = system.equations
    assert own._condensed is not None
    f = system.force(t, x, u)
    a, multipliers = own.solve(t, x, u, f)
    free, gamma = own.reduction.free_force(f), own.phi.curvature(t, x, u)
    expected = own._solve_whole(x, free, gamma)
    for found, other in zip((a, multipliers), expected, strict=True):
        assert np.abs(found - other).max() <= 1e-9 * np.abs(other).max()
    B, J = own.reduction.basis, own.phi.jacobians(x)
    carried = own.mass(x) @ (a @ B.T)[..., None]
    missing = free - (carried[..., 0] + (multipliers[:, None] @ J)[:, 0]) @ B
    assert np.abs(missing).max() <= 1e-12 * np.abs(carried).max()
    assert np.abs((J @ (a @ B.T)[..., None])[..., 0] - gamma).max() <= 1e-11 * np.abs(a).max()


@pytest.mark.parametrize(("make", "elements", "options"), SCENES)
def test_momenta_are_the_mass_matrix_times_rates(make, elements, options, rng):
    scene = make(elements, **options)
    _, x, _ = states(scene, rng, size=0.1)
    for body in scene.system.variable_mass:
        n = body.columns.stop - body.columns.start
        rates = rng.normal(size=(len(x), 3, n))
        expected = rates @ body.mass(x)
        assert np.abs(body.momenta(x, rates) - expected).max() <= 1e-13 * np.abs(expected).max()
        rows, solve = body.condensed(x)
        M = body.mass(x)
        assert np.abs(rows - M[:, : body.inner]).max() <= 1e-13 * np.abs(M).max()
        forces = rng.normal(size=(len(x), 5, n - body.inner))
        answer = solve(forces) @ M[:, body.inner :, body.inner :]
        assert np.abs(answer - forces).max() <= 1e-9 * np.abs(forces).max()


def test_small_scenes_and_constant_masses_are_solved_as_a_whole(monkeypatch):
    scene = planar((7, 4))
    assert scene.system.equations._condensed is not None
    monkeypatch.setattr(equations, "FEW_UNKNOWNS", 1000)
    assert replace(scene.system.equations)._condensed is None
    assert build(scene.loaded, "exact").system.equations._condensed is None


def test_an_indefinite_mass_matrix_is_solved_where_joints_hold_it(rng):
    """What eq. (46) leaves out makes the turning inertia of a coiled beam negative."""
    scene = planar((6, 4))
    system, (t, x, u) = scene.system, states(scene, rng)
    body = system.variable_mass[0]
    x[:, body.columns.stop - body.n_v : body.columns.stop] += 3.0
    own = system.equations
    sizes = np.linalg.eigvalsh(own.mass(x))
    assert (sizes < 0.0).any()
    f = system.force(t, x, u)
    found = own.solve(t, x, u, f)
    expected = own._solve_whole(x, own.reduction.free_force(f), own.phi.curvature(t, x, u))
    for one, other in zip(found, expected, strict=True):
        assert np.abs(one - other).max() <= 1e-7 * np.abs(other).max()
