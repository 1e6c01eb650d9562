"""Natural increments against their definition: strains, moments and angles of each element, by quadrature."""

import numpy as np
import pytest
from analytical import along, gauss

from hfsim.marching.integration import run_integration
from hfsim.maths.shapes import interior
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

DECK = """
hfsim: 1
name: case
gravity: [0.0, 0.0]
materials: {{alloy: {{density: 2766.7, youngs_modulus: 6.8952e10}}}}
sections: {{bar: {{area: 4.0e-4, second_moment: 1.33e-8}}}}
bodies:
  b1: {{type: beam, material: alloy, section: bar, length: 1.5, elements: 3, degree: {degree}}}
  hub: {{type: rigid, mass: 1.0, inertia: 2.0}}
  b2: {{type: beam, material: alloy, section: bar, length: 1.0, elements: 2, degree: {degree}}}
solve: {{model: {model}, duration: 1.0}}
"""
CASES = [(model, degree) for model in ("exact", "ancf") for degree in (3, 4, 6, 9, 12)]


def scene_of(model, degree):
    return build(parse_deck(DECK.format(model=model, degree=degree)))


def states(scene, rng, count=3, size=0.02):
    q = scene.q + size * rng.normal(size=(count, scene.system.n))
    for body in scene.bodies.values():
        if body.angle_column is not None:
            q[:, body.angle_column] += rng.uniform(-3, 3, size=count)
    return q


def defined(scene, q):
    """Natural coordinates from the state by their definition; angles modulo full turns."""
    x, system = scene.system.absolute(q), scene.system
    y = q.copy()
    for name in ("b1", "b2"):
        body = scene.bodies[name]
        element, count = body.mesh.element, body.mesh.count
        z = x[:, body.columns].reshape(len(q), -1, 2) @ [1, 1j]
        angle = q[:, [body.angle_column]] if body.framed else 0.0
        out = np.log(z) - 1j * angle
        points, weights = gauss(30, 0, 1)
        for e in range(count):
            start = e * element.stride
            end = start + element.stride
            local = z[:, start : end + 2]
            rows = np.array([element.shape(float(p), 0.0, (1, 0)) for p in points])
            strain = (np.abs(local @ rows.T) ** 2 - 1) / 2
            chord = (z[:, end] - z[:, start]) / element.length
            inner = z[:, start + 2 : end] / (chord / np.abs(chord))[:, None]
            moments = strain @ (weights[:, None] * interior(points, element.degree, 1))
            out[:, end] = strain @ weights + 1j * np.angle(chord * np.exp(-1j * np.ravel(angle)))
            out[:, start + 2 : end] = moments + 1j * inner.imag
        out[:, 0] = z[:, 0]
        if body.framed:
            out[:, 1] = out[:, 1].real + 1j * np.ravel(angle)
        y[:, body.columns] = np.stack([out.real, out.imag], axis=-1).reshape(len(q), -1)
    assert system.natural.beams
    return y


def gap(a, b):
    """Difference without full turns, for coordinates that are small numbers."""
    d = a - b
    return d - 2 * np.pi * np.round(d / (2 * np.pi)) * (np.abs(d) > 3)


@pytest.mark.parametrize(("model", "degree"), CASES)
def test_maps_of_small_increments_are_inverse(model, degree, rng):
    scene = scene_of(model, degree)
    natural = scene.system.natural
    at = natural.geometry(states(scene, rng))
    dq = rng.normal(size=(3, scene.system.n))
    y = natural.to_natural(at, dq)
    assert np.abs(natural.from_natural(at, y) - dq).max() < 1e-13
    assert np.abs(natural.to_natural(at, natural.from_natural(at, dq)) - dq).max() < 1e-12


@pytest.mark.parametrize(("model", "degree"), [one for one in CASES if one[0] == "ancf"])
def test_forces_do_the_same_work_on_small_increments(model, degree, rng):
    scene = scene_of(model, degree)
    natural = scene.system.natural
    at = natural.geometry(states(scene, rng))
    f, y = rng.normal(size=(2, 3, scene.system.n))
    work = np.sum(f * natural.from_natural(at, y), axis=1)
    assert np.sum(natural.to_natural_forces(at, f) * y, axis=1) == pytest.approx(work, rel=1e-10)


@pytest.mark.parametrize(("model", "degree"), CASES)
def test_finite_increments_add_to_the_natural_coordinates(model, degree, rng):
    scene = scene_of(model, degree)
    natural, q = scene.system.natural, states(scene, rng)
    y = rng.normal(size=q.shape) * 0.1 / degree**2
    dq = natural.advance(natural.geometry(q), y)
    assert np.abs(gap(defined(scene, q + dq), defined(scene, q) + y)).max() < 1e-14 * (10 + degree)
    assert natural.advance(natural.geometry(q), 0 * y) == pytest.approx(np.zeros(q.shape), abs=1e-15)


@pytest.mark.parametrize(("model", "degree"), CASES)
def test_rates_are_derivatives_of_the_natural_coordinates(model, degree, rng):
    scene = scene_of(model, degree)
    q, v, a = states(scene, rng, 1), *rng.normal(size=(2, 1, scene.system.n))
    natural = scene.system.natural
    y1, y2, _ = natural.rates(natural.geometry(q), v, a)

    def moved(s):
        return gap(defined(scene, q + np.outer(s, v) + np.outer(s * s, a) / 2), defined(scene, q))

    def rates(s):
        path, speed = q + np.outer(s, v) + np.outer(s * s, a) / 2, v + np.outer(s, a)
        pairs = zip(path[:, None], speed[:, None], strict=True)
        return np.concatenate([natural.rates(natural.geometry(x), u, a)[0] for x, u in pairs])

    assert np.abs(along(moved, 1e-3) - y1[0]).max() < 1e-8 * np.abs(y1).max()
    assert np.abs(along(rates, 1e-3) - y2[0]).max() < 1e-8 * np.abs(y2).max()


STIFF = """
hfsim: 1
name: case
gravity: [0.0, 0.0]
materials: {alloy: {density: 2766.7, youngs_modulus: 6.8952e10}}
sections: {bar: {area: 4.0e-4, second_moment: 1.33e-8}}
bodies:
  b1: {type: beam, material: alloy, section: bar, length: 4.0, elements: 3, degree: 8}
  b2: {type: beam, material: alloy, section: bar, length: 4.0, elements: 3, degree: 8}
joints:
  pin: {type: revolute, between: [ground, b1.root]}
  elbow: {type: revolute, between: [b1.tip, b2.root]}
initial: {b1: {angular_velocity: 4.0}, b2: {angular_velocity: 8.0}}
solve: {model: ancf, duration: 0.3, tolerance: 1.0e-4}
"""


def test_steps_stay_long_in_a_stiff_scene(monkeypatch):
    """Without natural coordinates the axial stiffness of a turning beam keeps the steps short."""
    scene = build(parse_deck(STIFF))
    natural = run_integration(scene, scene.deck.solve).problem.counts
    for bound in ("STIFF", "FAR"):
        monkeypatch.setattr(f"hfsim.integrators.collocation.{bound}", np.inf)
    plain = run_integration(scene, scene.deck.solve).problem.counts
    assert natural.steps < 0.8 * plain.steps
    assert natural.iterations < 0.7 * plain.iterations
