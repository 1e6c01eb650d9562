# ruff: noqa: E501
"""The model lowOrder in space: that of the plane in any plane, the same however turned; a blade's frequencies."""

from dataclasses import replace
from functools import cache

import numpy as np
import posed
import pytest
import yaml
from analytical import jacobian
from blades import AT_REST, CORIOLIS, FLAP, GROWTH_LINEAR, LAG, LAG_LINEAR, frequencies, off, spectrum
from integrated import integrate
from solved import solved as solution

from hfsim.integrators import Limits
from hfsim.integrators._tableau import gauss, radau
from hfsim.integrators.collocation import CollocationMethod
from hfsim.integrators.gear import Gear
from hfsim.marching.integration import problem_of
from hfsim.maths.rotations import rotation
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

R, SHIFT = rotation(np.array([0.7, -1.1, 0.4])), np.array([0.4, -2.0, 1.3])
PLANE = yaml.safe_load("""
hfsim: 1
gravity: [0.0, -9.81]
materials: {soft: {density: 900.0, youngs_modulus: 2.0e7, axial_damping: 2.0e-4, bending_damping: 1.0e-3}}
sections: {bar: {shape: rectangle, width: 0.05, height: 0.05}}
bodies:
  b1: {type: beam, material: soft, section: bar, length: 1.5, elements: 2, points: {mid: [0.7, 0.0]}}
  b2: {type: beam, material: soft, section: bar, length: 1.0, elements: 2}
  hub: {type: rigid, mass: 1.0, inertia: 0.1, points: {rim: [0.1, 0.0]}}
joints:
  pin: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, b1.root]}
  elbow: {type: revolute, between: [b1.mid, b2.root]}
loads: {push: {type: force, at: b2.tip, force: [0.5, 1.0]}}
initial: {hub: {angle: 0.3, angular_velocity: 2.0}, b1: {angle: 0.3, angular_velocity: 2.0}, b2: {angle: -0.2}}
solve: {model: lowOrder, duration: 0.02, tolerance: 1.0e-11}
output: {interval: 0.01, channels: [b1.tip.x, b1.tip.y, b2.tip.x, b2.tip.y, energy.total, energy.strain]}
""")
SPACE = """
hfsim: 1
gravity: [1.0, 2.0, -9.81]
ground: {{points: {{origin: [0.0, 0.0, 0.0]}}}}
materials: {{soft: {{density: 900.0, youngs_modulus: 2.0e7, bending_damping: 1.0e-3}}}}
sections: {{bar: {{shape: rectangle, width: 0.05, height: 0.05}}}}
bodies:
  b1: {{type: beam, material: soft, section: bar, length: 1.0, elements: 2, element: cable, truncation: {truncation}}}
  b2: {{type: beam, material: soft, section: bar, length: 0.8, elements: 2, element: cable, degree: 4}}
joints:
  ball: {{type: spherical, between: [ground.origin, b1.root]}}
  elbow: {{type: spherical, between: [b1.tip, b2.root]}}
initial:
  b1: {{orientation: {{x: [1.0, 0.0, 0.0], y: [0.0, 1.0, 0.0]}}, angular_velocity: [0.0, 1.0, 2.0]}}
  b2: {{orientation: {{x: [0.0, 1.0, 0.0], y: [0.0, 0.0, 1.0]}}, angular_velocity: [1.0, 1.0, 0.0]}}
solve: {{model: lowOrder, duration: {duration}, tolerance: 1.0e-11}}
output: {{interval: 0.01, channels: [b1.tip.x, b1.tip.y, b1.tip.z, b2.tip.x, b2.tip.y, b2.tip.z, energy.total]}}
"""


def deck(truncation="second_order", duration=0.014):
    return yaml.safe_load(SPACE.format(truncation=truncation, duration=duration))


def solved(data):
    return solution(data)[1]


def columns(result, *names):
    return np.stack([result[name] for name in names], axis=1)


def deformed(rng, truncation):
    scene = build(parse_deck(yaml.safe_dump(deck(truncation))))
    x = scene.system.absolute(scene.q[None])
    return scene, x + 0.1 * rng.normal(size=x.shape), rng.normal(size=x.shape)


@pytest.mark.parametrize("truncation", ["second_order", "none"])
def test_planar_scene_posed_in_a_plane_of_space(truncation):
    plane = {**PLANE, "bodies": {k: dict(v) for k, v in PLANE["bodies"].items()}}
    for name in ("b1", "b2"):
        plane["bodies"][name]["truncation"] = truncation
    space = posed.in_space(plane, R, SHIFT)
    points = [f"{b}.tip.{c}" for b in ("b1", "b2") for c in "xyz"]
    space["output"] = {"interval": 0.01, "channels": [*points, "energy.total", "energy.strain"]}
    a, b = solved(plane), solved(space)
    energies = "energy.total", "energy.strain"
    for name in ("b1", "b2"):
        expected = columns(a, *(f"{name}.tip.{c}" for c in "xy")) @ R[:, :2].T + SHIFT
        assert columns(b, *(f"{name}.tip.{c}" for c in "xyz")) == pytest.approx(expected, abs=1e-9)
    changes = [(one - one[0]) for one in (columns(a, *energies), columns(b, *energies))]
    assert changes[1] == pytest.approx(changes[0], abs=1e-8)


FREE = """
hfsim: 1
gravity: {gravity}
materials: {{soft: {{density: 900.0, youngs_modulus: 2.0e7}}}}
sections: {{bar: {{shape: rectangle, width: 0.05, height: 0.05}}}}
bodies: {{b1: {{type: beam, material: soft, section: bar, length: 1.5, elements: 2, element: cable, truncation: {truncation}}}}}
solve: {{model: lowOrder, duration: 1.0}}
"""


@pytest.mark.parametrize("truncation", ["second_order", "none"])
def test_accelerations_of_a_much_deformed_beam_are_the_planar_ones(rng, truncation):
    """All terms show where deflections and rates are of the size of the length."""
    plane, space = (build(parse_deck(FREE.format(gravity=g, truncation=truncation))) for g in ([1.0, -9.81], [1.0, -9.81, 0.0]))
    system, n_w = plane.system, plane.bodies["b1"].beam.n_w
    q, v = plane.q[None] + 0.3 * rng.normal(size=(1, system.n)), rng.normal(size=(1, system.n))
    a = system.acceleration(np.zeros(1), q, v)
    mesh = plane.bodies["b1"].beam.mesh

    def vectors(state, undeformed):
        w, v = np.r_[0.0, state[3 : 3 + n_w]], np.r_[0.0, 0.0, state[3 + n_w :]]
        return undeformed * mesh.undeformed[:, 0] + w + 1j * v

    (p, p1, p2), turn = (vectors(s[0], k == 0) for k, s in enumerate((q, v, a))), np.exp(1j * q[0, 2])
    omega, alpha = v[0, 2], a[0, 2]
    local = p, p1 + 1j * omega * p, p2 + 2j * omega * p1 + (1j * alpha - omega**2) * p
    x, u, ax = (
        mesh.positions * complex(*s[0, :2]) + turn * z for s, z in zip((q, v, a), local, strict=True)
    )
    x, u, ax = (np.stack([z.real, z.imag, 0.0 * z.real], axis=-1).reshape(1, -1) for z in (x, u, ax))
    own, t = space.system, np.zeros(1)
    found = own.equations.accelerations(t, x, u, own.force(t, x, u))
    assert found == pytest.approx(ax, abs=1e-9 * np.abs(ax).max())


def test_turning_and_shifting_a_scene_changes_nothing():
    a, b = solved(deck()), solved(posed.moved(deck(), R, SHIFT))
    for name in ("b1.tip", "b2.tip"):
        expected = columns(a, *(f"{name}.{c}" for c in "xyz")) @ R.T + SHIFT
        assert columns(b, *(f"{name}.{c}" for c in "xyz")) == pytest.approx(expected, abs=1e-9)


def test_whole_inertia_force_is_that_of_the_kinetic_energy(rng):
    """Lagrange: d/dt dT/du = dT/dx + Q, so that Q = dT/dx - M' u where accelerations are zero."""
    scene, x, u = deformed(rng, "none")
    body = scene.bodies["b1"]
    beam, own = replace(body.variable_mass, gravity=(0.0, 0.0, 0.0)), body.columns
    rates = u[0, own]
    slope = jacobian(lambda y: 0.5 * (beam.mass(y) @ rates @ rates)[:, None], x[0])[0, own]
    step = 1e-5
    changing = (beam.mass(x + step * u) - beam.mass(x - step * u))[0] / (2.0 * step)
    force = np.zeros_like(x)
    beam.add_force(np.zeros(1), x, u, force)
    expected = slope - changing @ u[0, own]
    assert force[0, own] == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("truncation", ["second_order", "none"])
def test_forces_are_those_of_the_energies(rng, truncation):
    scene, x, _ = deformed(rng, truncation)
    system, force, still = scene.system, np.zeros_like(x), np.zeros_like(x)
    for part in system.forces:
        part.add_force(np.zeros(1), x, still, force)
    energy = lambda y: (system.strain_energy(y) + system.potential_energy(np.zeros(len(y)), y))[:, None]  # noqa: E731
    slope = jacobian(energy, x[0])[0]
    assert force[0] == pytest.approx(-slope, abs=1e-6 * np.abs(slope).max())


def test_energy_is_kept_by_the_whole_inertia_force():
    data = deck("none")
    data["bodies"]["b2"]["truncation"] = "none"
    data["materials"]["soft"].pop("bending_damping")
    energy = columns(solved(data), "energy.total")[:, 0]
    assert np.ptp(energy) < 1e-8 * np.abs(energy).max()


@pytest.mark.slow
def test_turned_over_sections_forces_are_those_of_the_planar_model():
    """Internal forces of the posed scene are the planar ones."""
    channels = [f"b1.mid.{name}" for name in ("axial_force", "shear_force", "bending_moment")]
    plane = {**PLANE, "output": {"interval": 0.01, "channels": channels}}
    space = posed.in_space(plane, R, SHIFT)
    spatial = ["b1.mid.axial_force", "b1.mid.shear_force_y", "b1.mid.bending_moment_z"]
    space["output"] = {"interval": 0.01, "channels": [*spatial, "b1.mid.shear_force_z", "b1.mid.bending_moment_y"]}
    a, b = columns(solved(plane), *channels), solved(space)
    across = columns(b, "b1.mid.shear_force_z", "b1.mid.bending_moment_y")
    size = np.hypot(columns(b, *spatial[1:]), across)
    assert columns(b, spatial[0])[:, 0] == pytest.approx(a[:, 0], abs=1e-7 * np.abs(a).max())
    assert size == pytest.approx(np.abs(a[:, 1:]), abs=1e-7 * np.abs(a).max())


@pytest.mark.parametrize("place", [0.0, 0.37, 1.0])
def test_markers_against_differences(rng, place):
    scene, x, u = deformed(rng, "second_order")
    body, first, step = scene.bodies["b1"], np.eye(3)[0], 1e-4
    marker = body.marker((place, 0.0, 0.0))
    quantities = {
        "position": (marker.position, marker.position_jacobian(x), marker.position_bias(x, u)),
        "axis": (lambda y: marker.axis(y, first), marker.axis_jacobian(x, first), marker.axis_bias(x, u, first)),
    }
    for value, J, bias in quantities.values():
        assert J[0] == pytest.approx(jacobian(value, x[0])[:, body.columns], abs=1e-7)
        second = (value(x + step * u) - 2.0 * value(x) + value(x - step * u)) / step**2
        assert bias == pytest.approx(second, abs=1e-5)
    step = 1e-5
    spin = (marker.spin(x + step * u, u) - marker.spin(x - step * u, u)) / (2.0 * step)
    assert marker.spin_bias(x, u) == pytest.approx(spin, abs=1e-5)


DURATION = 0.04
METHODS = [("gauss", 2, 4, (10, 20)), ("radau", 2, 3, (40, 80)), ("gear", 2, 2, (100, 200))]


@cache
def ball():
    """One beam on a ball: stiff bending, a mass matrix that changes, multipliers."""
    data = deck()
    data["bodies"].pop("b2"), data["joints"].pop("elbow"), data["initial"].pop("b2")
    data["output"] = {"channels": ["b1.tip.x"]}
    data["materials"]["soft"]["youngs_modulus"] = 2.0e5
    return build(parse_deck(yaml.safe_dump(data)))


def end(method, step):
    scene = ball()
    start = (0.0, scene.q, scene.v)
    path, stop = integrate(problem_of(scene), method, start, DURATION, Limits(step), lambda t, q, v: None)
    assert stop is None
    return np.concatenate([path.q, path.v])


@cache
def true_end():
    return end(CollocationMethod("gauss", gauss(10), 1e-13), 0.005)


@pytest.mark.parametrize(("kind", "stages", "order", "counts"), METHODS)
def test_methods_keep_their_order(kind, stages, order, counts):
    tables = {"gauss": gauss, "radau": radau}

    def method_of(step):
        return Gear(1e-13, step, stages) if kind == "gear" else CollocationMethod(kind, tables[kind](stages), 1e-13)

    steps = [DURATION / n for n in counts]
    errors = [np.abs(end(method_of(step), step) - true_end()).max() for step in steps]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.slow
def test_large_deflections_break_the_model_down_and_say_so():
    data = deck(duration=0.4)
    data["materials"]["soft"] |= {"youngs_modulus": 1.0e6}
    data["solve"]["tolerance"] = 1e-7
    result = simulate(parse_deck(yaml.safe_dump(data)), error_estimate=False)
    assert result.status == "failed"
    assert "model lowOrder stops being positive definite" in result.reason
    assert result.exit_code == 3
    left_at = result.statistics["validity"]["b2"]["left_at"]
    assert left_at is not None and left_at < result.failure["time"]


# ---------------------------------------------------------------- rotating blades


@pytest.mark.parametrize("model", ["lowOrder", "exact"])
@pytest.mark.parametrize("gamma", [1, 3, 5])
def test_frequencies_of_a_rotating_blade(model, gamma):
    """Cases S3 and S4: flap, and lag of a blade so stiff along its axis that Coriolis forces do no more."""
    found = frequencies(spectrum(model, gamma, 700.0, loaded=True))
    assert off(found, FLAP[gamma]) < 5e-5
    assert off(found, LAG[gamma]) < 5e-5
    thick = off(frequencies(spectrum(model, gamma, loaded=True)), CORIOLIS[gamma])
    assert thick < 0.5 * abs(LAG[gamma] / CORIOLIS[gamma] - 1.0)


@pytest.mark.parametrize("gamma", [1, 2, 3, 4, 5])
def test_linear_loses_the_stiffening_of_a_blade(gamma):
    """Case S5: it flaps as at rest, softens in the plane of rotation and diverges above gamma = 3.516."""
    values = spectrum("linear", gamma)
    assert off(frequencies(values), AT_REST) < 5e-5
    if gamma in LAG_LINEAR:
        assert off(frequencies(values), LAG_LINEAR[gamma]) < 5e-5
    else:
        assert off(values.real[np.abs(values.imag) < 1e-6], GROWTH_LINEAR[gamma]) < 5e-5
