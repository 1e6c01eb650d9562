# ruff: noqa: E501
"""The model lowOrder of beams with sections: linear strains with the foreshortening of what is bent."""

import numpy as np
import pytest
import yaml
from beam_laws import check_force_of_energy
from blades import FLAP, LAG, frequencies, off, spectrum
from cantilevers import at_rest, cantilever, displacement, inside
from solved import solved

from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.trust.validity import tip_error

CURVES = {"straight": "length: 1.2", "arc": "axis: {arc: {radius: 1.0, angle: 1.2}}, twist: 0.5"}
ROTOR = """
hfsim: 1
gravity: {gravity}
materials: {{soft: {{density: 1000.0, youngs_modulus: 2.0e7, poisson_ratio: 0.3, axial_damping: {damping}, bending_damping: {damping}}}}}
sections: {{bar: {{shape: rectangle, width: 0.06, height: 0.03}}}}
bodies: {{b: {{type: beam, material: soft, section: bar, elements: 2, degree: {degree}, element: cosserat, {length}}}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
initial: {{b: {{angular_velocity: {rate}}}}}
solve: {{model: {model}, duration: 0.1, tolerance: 1.0e-10}}
output: {{interval: 0.02, channels: [b.tip.x, b.tip.y, energy.total]}}
"""


def rotor(n_dim=3, curve="straight", model="lowOrder", damping=0.0, degree=3, rate=2.0):
    gravity = [0.0, -9.81, 3.0][:n_dim]
    length = CURVES[curve].removesuffix(", twist: 0.5") if n_dim == 2 else CURVES[curve]
    numbers = {"model": model, "damping": damping, "degree": degree, "rate": rate}
    return ROTOR.format(gravity=gravity, length=length, **numbers)


def shortened(mesh, X):
    """The nodal vectors of a line foreshortened from X: integrals of polynomials through the Gauss points."""
    (own, rows), n, le = mesh.point_vectors, mesh.n_dim, mesh.axis.length / mesh.count
    d = (rows @ mesh.undeformed[own])[:, 1:n]
    first = np.cross(d[:, 0], d[:, 1]) if n == 3 else np.stack([d[:, 0, 1], -d[:, 0, 0]], axis=-1)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    t = np.linalg.inv(np.concatenate([first[:, None], d], axis=1))[..., 0]
    slope = (rows @ (X - mesh.undeformed)[own])[:, 0]
    rate = 0.5 * np.sum((d @ slope[..., None])[..., 0] ** 2, axis=-1)[:, None] * t
    rate = rate.reshape(mesh.count, mesh.degree, n)
    xi = mesh.points[0].reshape(mesh.count, -1)[0] / le
    nodes = mesh.node_places[: mesh.degree + 1] / le
    out, gone = X.copy(), np.zeros(n)
    for e in range(mesh.count):
        through = np.polynomial.Polynomial
        lost = [through.fit(xi, c, mesh.degree - 1).integ(lbnd=0.0)(nodes) * le for c in rate[e].T]
        at = n * (mesh.degree * e + np.arange(mesh.degree + 1))
        out[at] = X[at] - gone - np.array(lost).T
        gone = gone + np.array(lost)[:, -1]
    return out


@pytest.mark.parametrize("n_dim", [2, 3])
@pytest.mark.parametrize("curve", CURVES)
def test_energy_is_that_of_linear_strains_before_the_foreshortening(rng, n_dim, curve):
    """Eq. 44-45: the model is linear in a line of which the nodes are the foreshortened places."""
    bodies = [build(parse_deck(rotor(n_dim, curve, model))).bodies["b"] for model in ("linear", "lowOrder")]
    linear, low_order = (body.elastic for body in bodies)
    mesh = bodies[0].mesh
    X = mesh.undeformed + 0.1 * rng.normal(size=mesh.undeformed.shape)
    X[:n_dim] = mesh.undeformed[:n_dim]
    there = shortened(mesh, X)
    assert np.abs(there - X).max() > 0.01
    x, y = (np.zeros((1, linear.columns.stop)) for _ in range(2))
    x[:, linear.columns], y[:, linear.columns] = X.ravel(), there.ravel()
    assert low_order.strain_energy(y) == pytest.approx(linear.strain_energy(x), rel=1e-10)
    assert low_order.strain_energy(x)[0] != pytest.approx(linear.strain_energy(x)[0], rel=1e-2)


@pytest.mark.parametrize("n_dim", [2, 3])
def test_damping_takes_the_power_of_the_rates_of_stretch(rng, n_dim):
    scene = build(parse_deck(rotor(n_dim, "arc", damping=0.01)))
    force, n = scene.bodies["b"].elastic, scene.system.n_x
    x = scene.system.absolute(scene.q[None]) + 0.1 * rng.normal(size=n)
    u, h = rng.normal(size=(1, n)), 1e-6
    strain = lambda y: force.stretched(force.displacements(y))[1]  # noqa: E731
    rate = (strain(x + h * u) - strain(x - h * u)) / (2.0 * h)
    slopes, _ = force.stretched(force.displacements(x))
    assert force.stretching(slopes, force.rates(x, u)) == pytest.approx(rate, abs=1e-6)
    check_force_of_energy(force, x[0], rng)


@pytest.mark.parametrize("n_dim", [2, 3])
def test_energy_is_kept(n_dim):
    values, told = solved(rotor(n_dim))
    size = np.ptp(values[:, 1]) * 9.81 * 1000.0 * 0.06 * 0.03 * 1.2
    assert np.ptp(values[:, -1]) < 1e-7 * size
    assert told.statistics["constraint_position"] < 1e-12


def test_energy_method_takes_it():
    """Its mass matrix is constant, unlike that of a cable."""
    data = yaml.safe_load(rotor(2))
    data["solve"] |= {"method": "energy", "duration": 0.02}
    assert np.ptp(solved(yaml.safe_dump(data))[0][:, -1]) < 1e-8


# ---------------------------------------------------------------- what it is right for

SECTION = "{shape: rectangle, width: 0.2, height: 0.1}"
BENT, TWISTED = ((3e3, 2e4, 3e4), (0.0, 0.0, 0.0)), ((3e3, 2e4, 3e4), (4e3, 0.0, 0.0))
PLANE = ((3e3, 2e4), 0.0)


def distances(model, force, moment):
    """From exact, of the tip at rest under a load and its half."""
    found = []
    for part in (0.5, 0.25):
        loads = tuple(part * f for f in force), tuple(part * m for m in moment) if len(force) == 3 else part * moment
        kinds = (cantilever(SECTION, 1.0, *loads, material="youngs_modulus: 7.0e+9, poisson_ratio: 0.3", more=f"model: {one}") for one in (model, "exact"))
        ends = [displacement(scene, at_rest(scene, 1.0)) for scene in kinds]
        found.append(np.abs(ends[0] - ends[1]).max())
    return found


@pytest.mark.parametrize(("loads", "order"), [(BENT, 3), (TWISTED, 2), (PLANE, 3)])
def test_order_of_the_difference_to_exact(loads, order):
    """The third order is missed, and where torsion bends the second; linear misses the second always."""
    missed, of_linear = distances("lowOrder", *loads), distances("linear", *loads)
    assert np.log2(missed[0] / missed[1]) == pytest.approx(order, abs=0.2)
    assert np.log2(of_linear[0] / of_linear[1]) == pytest.approx(2, abs=0.2)
    assert missed[1] < 0.25 * of_linear[1]


def test_internal_forces_balance_the_load_where_it_is():
    """At the clamp of a beam under tension and a force across, the moment has the arm of the deflected tip."""
    pull, push = 2e5, 2e4
    scene = cantilever(SECTION, 1.0, (pull, push), material="youngs_modulus: 7.0e+9", more="model: lowOrder")
    x = at_rest(scene, 1.0)
    along, across = displacement(scene, x)
    found = inside(scene, x, [0.0])[0]
    assert across > 0.02
    assert found[:2] == pytest.approx([pull, push], rel=1e-3)
    assert found[5] == pytest.approx(push * (1.0 + along) - pull * across, rel=2e-3)


LOADS = {
    "twisted": ((0.0, 20.0, 20.0), (1.6e4, 0.0, 0.0)),
    "bent": ((0.0, 2e4, 2e4), (0.0, 0.0, 0.0)),
    "both": ((0.0, 2e3, 2e3), (4e3, 0.0, 0.0)),
}


@pytest.mark.parametrize("model", [pytest.param("lowOrder", marks=pytest.mark.slow), "linear"])
@pytest.mark.parametrize("width", [0.1, 0.2])
@pytest.mark.parametrize("load", LOADS)
def test_estimates_of_what_is_left_out_are_those_to_exact(model, width, load):
    """Of twisted and of bent cantilevers, with equal and unequal stiffness about both axes."""
    load = LOADS[load]
    section = f"{{shape: rectangle, width: {width}, height: 0.1}}"
    material = "youngs_modulus: 7.0e+9, poisson_ratio: 0.3"
    scene, exact = (cantilever(section, 1.0, *load, material=material, more=f"model: {one}") for one in (model, "exact"))
    x = at_rest(scene, 1.0)
    missed = np.linalg.norm(displacement(scene, x) - displacement(exact, at_rest(exact, 1.0)))
    seen = scene.bodies["b"].deformation(x, np.zeros_like(x))
    told = sum(tip_error(scene, "b", model, seen, np.ones(1)).values())[0]
    assert 0.5 < told / missed < 5.0


@pytest.mark.parametrize("gamma", [1, 3, 5])
def test_frequencies_of_a_rotating_blade(gamma):
    """Cases S3 and S4: flap and lag, which it stiffens like exact."""
    found = frequencies(spectrum("lowOrder", gamma, 700.0, loaded=True, element="cosserat"))
    assert off(found, FLAP[gamma]) < 2e-4
    assert off(found, LAG[gamma]) < 2e-4


@pytest.mark.parametrize("gamma", [0.01, 3, 6])
@pytest.mark.parametrize("model", ["lowOrder", "exact"])
def test_torsion_of_a_flat_blade_is_stiffened_by_its_spin(model, gamma):
    """Of a section flat in the plane of rotation, omega^2 = (pi / 2 L)^2 G J / I_x + (I_z - I_y) / I_x gamma^2."""
    stiff, about_y, about_z = 0.4, 1e-4, 1e-2
    polar = about_y + about_z
    expected = np.sqrt((np.pi / 2) ** 2 * stiff / polar + (about_z - about_y) / polar * gamma**2)
    found = frequencies(spectrum(model, gamma, loaded=True, element="flat"))
    assert off(found, expected) < 5e-6


LINES = """
hfsim: 1
gravity: {gravity}
materials: {{soft: {{density: 1000.0, youngs_modulus: 1.0e10}}}}
sections: {{bar: {{shape: rectangle, width: 1.0e-3, height: 1.0e-3}}}}
bodies: {{b: {{type: beam, material: soft, section: bar, length: 1.0, {mesh}, truncation: none}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads: {{push: {{type: force, at: b.tip, force: {force}}}}}
solve: {{model: {model}, duration: 0.3, tolerance: 1.0e-4}}
output: {{interval: 0.1, channels: {channels}}}
"""
MESHES = {"cable": "element: cable, elements: 8", "cosserat": "element: cosserat, elements: 1, degree: 8"}


@pytest.mark.parametrize("n_dim", [2, 3])
def test_slender_beams_are_the_line_of_a_cable(n_dim):
    """Of slenderness 1000: near the cable with all its inertia terms, further from exact."""
    force = [0.0, 1.0e-3] if n_dim == 2 else [0.0, 6.0e-4, 8.0e-4]
    numbers = {"gravity": [0.0] * n_dim, "force": force, "channels": [f"b.tip.{c}" for c in "xyz"[:n_dim]]}
    cable, own, exact = (
        solved(LINES.format(mesh=MESHES[element], model=model, **numbers))[0]
        for element, model in (("cable", "lowOrder"), ("cosserat", "lowOrder"), ("cosserat", "exact"))
    )
    assert own == pytest.approx(cable, abs=1.5e-4)
    assert np.abs(exact - own).max() > 7e-4


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
def test_steps_in_the_frame_of_a_clamped_root(model):
    """Some modes of the accelerations are parallel there to the last bit."""
    numbers = {"gravity": [0.0] * 3, "force": [0.0, 6.0e-4, 8.0e-4], "channels": [f"b.tip.{c}" for c in "xyz"]}
    text = LINES.format(mesh="element: cosserat, elements: 1, degree: 6", model=model, **numbers)
    text = text.replace("0.3, tolerance: 1.0e-4", "0.05, tolerance: 1.0e-6").replace("0.1", "0.05")
    frame, absolute = (
        solved(text.replace("tolerance", f"coordinates: {one}, tolerance"))[0] for one in ("frame", "absolute")
    )
    assert frame == pytest.approx(absolute, abs=1e-5)
