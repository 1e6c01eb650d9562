"""What the four models must have in common, and what each of them says of itself."""

import numpy as np
import pytest
from analytical import along, cable_row, cable_row_x, cable_row_xx, gauss, jacobian, turned, twice_along
from tangents import check_tangents

from hfsim.maths.matrices import assemble
from hfsim.mechanics.deformation import Deformation
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.linear import LinearElasticForce
from hfsim.parts.bodies.models import MODELS
from hfsim.parts.bodies.planar_low_order import LowOrderBeam
from hfsim.parts.bodies.planar_low_order_body import LowOrderMarker
from hfsim.parts.elements import ELEMENTS
from hfsim.parts.elements.forces import ElasticForce, KelvinVoigtForce
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

DECK = """
hfsim: 1
name: case
gravity: {gravity}
materials:
  soft:
    density: 900.0
    youngs_modulus: 2.0e6
    poisson_ratio: 0.3
    axial_damping: {damping}
    bending_damping: {damping}
sections: {{bar: {{shape: rectangle, width: 0.05, height: 0.08}}}}
bodies:
{bodies}
{rest}
solve: {{model: exact, duration: 1.0, coordinates: frame}}
"""
BEAM = "type: beam, material: soft, section: bar, length: 1.5, elements: 3"
CABLES = ["strain: green", "strain: engineering, curvature: exact"]


def scene_of(model, options="", gravity=(0.0, 0.0), damping=0.0, bodies=None, rest=""):
    bodies = bodies or f"  b1: {{{BEAM}, {options}}}"
    text = DECK.format(gravity=list(gravity), damping=damping, bodies=bodies, rest=rest)
    return build(parse_deck(text), model)


KINDS = [(m, f"element: {e}") for m in MODELS for e in ELEMENTS if (m, e) != ("lowOrder", "continuum")]
KINDS += [(m, "degree: 5") for m in MODELS]


def stiffness_of(part, x, u=None):
    """Minus the derivative of a force by the coordinates, as a matrix."""
    u = np.zeros_like(x) if u is None else u
    return assemble([part.tangent(np.zeros(1), x[None], u[None])], (len(x), len(x)))


def undeformed(scene, angle=0.4):
    """State of the one body at rest, turned and shifted."""
    body = scene.bodies["b1"]
    x = body.placed(Pose.planar((0.3, -0.2), angle))[None]
    near = np.zeros((1, scene.system.n))
    return scene.system.state(x, np.zeros_like(x), near)


def deformed(scene, rng, count=3, size=0.1):
    """Random states and rates: frame anywhere, deformation of relative size ``size``."""
    q0 = undeformed(scene)[0]
    q = q0 + size * rng.normal(size=(count, scene.system.n))
    v = rng.normal(size=q.shape)
    if scene.bodies["b1"].angle_column is not None:
        q[:, :3] += rng.normal(size=(count, 3))
    return q, v


def close(a, b, tolerance):
    scale = np.abs(b).max()
    assert scale > 0
    assert np.abs(a - b).max() <= tolerance * scale


def scene_stride(scene):
    return scene.bodies["b1"].mesh.element.stride


def part_of(scene, kind):
    return next(part for part in scene.system.forces if isinstance(part, kind))


def force_of(part, x, u=None):
    out = np.zeros_like(x)
    part.add_force(np.zeros(len(x)), x, np.zeros_like(x) if u is None else u, out)
    return out


# ---------------------------------------------------------------- mass and kinetic energy


@pytest.mark.parametrize(("model", "options"), KINDS)
def test_mass_is_symmetric_and_positive(model, options):
    system = (scene := scene_of(model, options)).system
    M = system.equations.mass(system.absolute(undeformed(scene)[0]))[0]
    assert np.abs(M - M.T).max() <= 1e-14 * np.abs(M).max()
    assert np.linalg.eigvalsh(M)[0] > 0


@pytest.mark.parametrize(("model", "options"), KINDS)
def test_kinetic_energy_is_half_v_M_v(model, options, rng):
    system = (scene := scene_of(model, options)).system
    q, v = deformed(scene, rng)
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    expected = 0.5 * np.einsum("bi,bij,bj->b", u, system.equations.mass(x), u)
    assert system.kinetic_energy(x, u) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(("model", "options"), KINDS)
def test_kinetic_energy_of_a_rigid_motion(model, options):
    scene = scene_of(model, options)
    body, mass = scene.bodies["b1"], 900 * 0.004 * 1.5
    x, own = body.placed(Pose.planar((0.0, 0.0), 0.7))[None], 900 * 0.05 * 0.08**3 / 12 * 1.5
    u = body.moving(Pose.planar((0.0, 0.0), 0.7), Twist(np.array([0.3, -0.4]), np.array([2.0])))[None]
    centre = np.array([0.3, -0.4]) + 2.0 * 0.75 * np.array([-np.sin(0.7), np.cos(0.7)])
    inertia = mass * 1.5**2 / 12 + (own if "continuum" in options else 0.0)
    expected = mass * centre @ centre / 2 + inertia * 2.0**2 / 2
    assert scene.system.kinetic_energy(x, u)[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("model", ["exact", "linear", "ancf"])
def test_kinetic_energy_is_the_integral_over_the_line(model, rng):
    """From the places of material points along a motion of the state, no mass matrix."""
    system = (scene := scene_of(model)).system
    q, v = (part[:1] for part in deformed(scene, rng))
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    path = system.absolute(q + np.linspace(-3, 3, 7)[:, None] * 1e-2 * v)
    total = 0.0
    for e in range(3):
        for place, weight in zip(*gauss(6, 0.0, 0.5), strict=True):
            N = np.kron(cable_row(place, 0.5), np.eye(2))
            speed = along(lambda s, N=N, e=e: path[:, 4 * e : 4 * e + 8] @ N.T)
            total += 900 * 0.004 * weight * speed @ speed / 2
    assert system.kinetic_energy(x, u)[0] == pytest.approx(total, rel=1e-9)


# ---------------------------------------------------------------- charts


@pytest.mark.parametrize("options", [*(f"element: {e}" for e in ELEMENTS), "degree: 6"])
def test_state_and_absolute_coordinates_are_inverse(options, rng):
    system = (scene := scene_of("exact", options)).system
    q, v = deformed(scene, rng, 5)
    q[:, 2] += [0.0, 7.0, -9.0, 40.0, -100.0]
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    near = q + 0.5
    back, rates = system.state(x, u, near)
    assert np.abs(back - q).max() < 1e-12
    assert np.abs(rates - v).max() < 1e-11


def test_absolute_coordinates_are_places_and_slopes(rng):
    """Eq. (2): r = r0 + A s', for nodal vectors written out."""
    system = (scene := scene_of("exact")).system
    q, _ = deformed(scene, rng, 1)
    A, x = turned(q[0, 2]), system.absolute(q)[0].reshape(-1, 2)
    p = np.concatenate([[0, 0, q[0, 3], 0], q[0, 4:]]).reshape(-1, 2)
    for k, vector in enumerate(p):
        assert x[k] == pytest.approx(A @ vector + (q[0, :2] if k % 2 == 0 else 0.0), abs=1e-13)


HUB = "  hub: {type: rigid, mass: 1.0, inertia: 2.0}"
THREE_BEAMS = f"  b1: {{{BEAM}}}\n  b2: {{{BEAM}}}\n{HUB}\n  b3: {{{BEAM}}}"


def path_of(system, q, v, a):
    """Absolute coordinates along the quadratic motion of a state."""
    return lambda s: system.absolute(q + np.outer(s, v) + np.outer(s * s, a) / 2)


def test_velocities_and_accelerations_of_the_chart_against_differences(rng):
    for bodies in (None, THREE_BEAMS):
        system = (scene := scene_of("exact", bodies=bodies)).system
        start = scene.q[None]
        q, v, a = start + 0.1 * rng.normal(size=start.shape), *rng.normal(size=(2, 1, system.n))
        path = path_of(system, q, v, a)
        close(system.absolute_velocity(q, v)[0], along(path, 1e-3), 1e-10)
        ax = twice_along(path)[None]
        close(system.state_acceleration(system.frames(q), v, ax), a, 1e-8)


# ---------------------------------------------------------------- exact and ancf


@pytest.mark.parametrize("options", [*CABLES, "element: continuum", "degree: 5", f"{CABLES[1]}, degree: 7"])
@pytest.mark.parametrize("joint", ["", "joints: {pin: {type: revolute, between: [ground, b1.tip]}}"])
def test_exact_and_ancf_accelerate_alike(options, joint, rng):
    exact = (scene := scene_of("exact", options, (0.3, -9.81), rest=joint)).system
    ancf = scene_of("ancf", options, (0.3, -9.81), rest=joint).system
    t = np.zeros(1)
    q, v = exact.project(t, *deformed(scene, rng, 1))
    a = exact.acceleration(t, q, v)
    x, u = exact.absolute(q), exact.absolute_velocity(q, v)
    ax = ancf.reduction.expand_rates(ancf.acceleration(t, *ancf.state(x, u, q)))
    close(twice_along(path_of(exact, q, v, a), 0.02 / np.sqrt(np.abs(a).max())), ax[0], 1e-7)
    close(a, exact.state_acceleration(exact.frames(q), v, ax), 1e-12)
    for energy in ("strain_energy", "potential_energy"):
        args = (x,) if energy == "strain_energy" else (t, x)
        assert getattr(exact, energy)(*args) == pytest.approx(getattr(ancf, energy)(*args), rel=1e-13)


# ---------------------------------------------------------------- small motion


def undeformed_hybrid():
    return np.concatenate([[0.0, 0.0, 0.0, 1.0], *[[0.5 * k, 0.0, 1.0, 0.0] for k in (1, 2, 3)]])[None]


def as_low_order(d):
    """Differences of hybrid coordinates (r0, theta, p) sorted into (r0, theta, w, v)."""
    nodes = d[:, 4:].reshape(len(d), -1, 2)
    return np.concatenate([d[:, :3], d[:, 3:4], nodes[..., 0], nodes[..., 1]], axis=1)


def small_accelerations(model, options, eps):
    """Accelerations in (r0, theta, w, v) for the same small deformation and rates in every model."""
    rng = np.random.default_rng(23)
    d, v = eps * rng.normal(size=(2, 1, 16))
    system, t = scene_of(model, options).system, np.zeros(1)
    if model == "lowOrder":
        return system.acceleration(t, as_low_order(d), as_low_order(v))
    q = undeformed_hybrid() + d
    if model != "ancf":
        return as_low_order(system.acceleration(t, q, v))
    exact = scene_of("exact").system
    ax = system.acceleration(t, exact.absolute(q), exact.absolute_velocity(q, v))
    return as_low_order(exact.state_acceleration(exact.frames(q), v, ax))


# with curvature r'' the axial stretch bends too: EI u''^2, which lowOrder does not have
FIRST_ORDER = [
    ("ancf", "curvature: linear"),
    ("ancf", "curvature: exact"),
    ("linear", "curvature: linear"),
    ("linear", "curvature: exact"),
    ("lowOrder", "curvature: exact"),
]


@pytest.mark.parametrize(("model", "options"), FIRST_ORDER)
def test_models_agree_to_first_order_in_small_motion(model, options):
    gaps = []
    for eps in (1e-4, 1e-5):
        reference = small_accelerations("exact", options, eps)
        gap = np.abs(small_accelerations(model, options, eps) - reference).max()
        gaps.append(gap / np.abs(reference).max())
    if model == "ancf":
        assert max(gaps) < 1e-10
    else:
        assert gaps[1] < 1e-3
        assert gaps[0] / gaps[1] == pytest.approx(10, rel=0.1)


# ---------------------------------------------------------------- linear


@pytest.mark.parametrize(
    "options", [CABLES[0], CABLES[1], "element: continuum", f"{CABLES[1]}, degree: 5", "degree: 8"]
)
def test_linear_force_is_the_slope_of_the_exact_one(options):
    scene = scene_of("linear", options)
    exact, linear = part_of(scene_of("ancf", options), ElasticForce), part_of(scene, LinearElasticForce)
    for angle in (0.0, 2.1):
        x = scene.bodies["b1"].placed(Pose.planar((0.3, -0.2), angle))
        slope = jacobian(lambda s: force_of(linear, s), x, 1e-4)
        close(slope, jacobian(lambda s: force_of(exact, s), x, 1e-4), 1e-8)
        close(-stiffness_of(exact, x), slope, 1e-8)


@pytest.mark.parametrize("element", ELEMENTS)
def test_linear_force_is_the_slope_of_its_energy(element, rng):
    system = (scene := scene_of("linear", f"element: {element}")).system
    part = part_of(scene, LinearElasticForce)
    x = system.absolute(deformed(scene, rng, 1)[0])
    close(force_of(part, x)[0], -jacobian(part.strain_energy, x[0]), 1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize("options", ["element: cable", "element: continuum", "degree: 5"])
def test_linear_force_has_its_derivatives(options, damping, rng):
    system = (scene := scene_of("linear", options, damping=damping)).system
    x = system.absolute(deformed(scene, rng, 1, 0.2)[0])
    check_tangents(part_of(scene, LinearElasticForce), x, rng.normal(size=x.shape), 1e-4, 1e-7)


def test_linear_energy_is_quadratic_in_the_body_frame(rng):
    system = scene_of("linear").system
    d = rng.normal(size=(1, 16))
    d[:, :3] = 0.0
    states = undeformed_hybrid() + np.outer([0.1, 0.2, 0.3], d)
    energies = system.strain_energy(system.absolute(states))
    assert energies / energies[0] == pytest.approx([1, 4, 9], rel=1e-10)


def test_exact_force_and_tangent_are_slopes(rng):
    for options in (*CABLES, "element: continuum", "degree: 5", "degree: 8"):
        system = (scene := scene_of("exact", options)).system
        part = part_of(scene, ElasticForce)
        x = system.absolute(deformed(scene, rng, 1, 0.05)[0])
        close(force_of(part, x)[0], -jacobian(part.strain_energy, x[0]), 1e-8)
        close(stiffness_of(part, x[0]), -jacobian(lambda s, p=part: force_of(p, s), x[0]), 1e-8)


# ---------------------------------------------------------------- lowOrder


def low_order(rng, whole, size=0.3, gravity=(0.4, -9.81), degree=3):
    truncation = "none" if whole else "second_order"
    scene = scene_of("lowOrder", f"truncation: {truncation}, degree: {degree}", gravity)
    x, u = rng.normal(size=(2, 1, scene.system.n))
    x[:, 3:] *= size
    return part_of(scene, LowOrderBeam), x, u


@pytest.mark.parametrize("degree", [3, 5])
def test_whole_low_order_force_satisfies_lagrange(rng, degree):
    """M a = Q with Q = dT/dq - (dM v/dq) v - dV/dq from differences of T and V."""
    beam, x, u = low_order(rng, whole=True, degree=degree)

    def momentum(states):
        return beam.mass(states) @ u[0]

    def lagrangian(states):
        stored = beam.strain_energy(states) + beam.potential_energy(np.zeros(len(states)), states)
        return 0.5 * momentum(states) @ u[0] - stored

    expected = jacobian(lagrangian, x[0]) - jacobian(momentum, x[0]) @ u[0]
    close(force_of(beam, x, u)[0], expected, 1e-9)


@pytest.mark.parametrize("degree", [3, 5])
def test_whole_low_order_mass_is_that_of_its_material_points(rng, degree):
    beam, x, _ = low_order(rng, whole=True, degree=degree)
    M = np.zeros((x.shape[1], x.shape[1]))
    for e in range(3):
        for place, weight in zip(*gauss(12, 0.5 * e, 0.5 * (e + 1)), strict=True):
            J = jacobian(LowOrderMarker(beam, place).position, x[0])
            M += 900 * 0.004 * weight * J.T @ J
    close(beam.mass(x)[0], M, 1e-9)


def test_low_order_points_are_equation_44(rng):
    """s' = [x + w - 1/2 int v'^2, v], with w and v from the shapes written out."""
    beam, x, _ = low_order(rng, whole=False)
    _, theta, w, v = (part[0] for part in beam.split(x))
    w, v = np.concatenate([[0.0], w]), np.concatenate([[0.0, 0.0], v])

    def value(nodes, place, derivative=False):
        e = min(int(place / 0.5), 2)
        local = nodes[2 * e : 2 * e + 4]
        return (cable_row_x if derivative else cable_row)(place - 0.5 * e, 0.5) @ local

    for place in (0.0, 0.3, 0.9, 1.5):
        ends = [a for a in (0.5, 1.0) if a < place]
        short = 0.0
        for low, high in zip([0.0, *ends], [*ends, place], strict=True):
            short += sum(c * value(v, a, True) ** 2 / 2 for a, c in zip(*gauss(4, low, high), strict=True))
        s = np.array([place + value(w, place) - short, value(v, place)])
        expected = x[0, :2] + turned(theta) @ s
        assert LowOrderMarker(beam, place).position(x)[0] == pytest.approx(expected, abs=1e-10)


def test_low_order_elastic_energy_is_that_of_w_and_v(rng):
    beam, x, _ = low_order(rng, whole=False)
    _, _, w, v = (part[0] for part in beam.split(x))
    w, v = np.concatenate([[0.0], w]), np.concatenate([[0.0, 0.0], v])
    energy, EA, EI = 0.0, 2e6 * 0.004, 2e6 * 0.05 * 0.08**3 / 12
    for e in range(3):
        nodes = slice(2 * e, 2 * e + 4)
        for a, c in zip(*gauss(5, 0, 0.5), strict=True):
            stretch = cable_row_x(a, 0.5) @ w[nodes]
            bend = cable_row_xx(a, 0.5) @ v[nodes]
            energy += c * (EA * stretch**2 + EI * bend**2) / 2
    assert beam.strain_energy(x)[0] == pytest.approx(energy, rel=1e-8)


def scaled(x, u, eps):
    """Deformation and its rates scaled jointly, the frame and its rates kept."""
    y, w = x.copy(), u.copy()
    y[:, 3:] *= eps
    w[:, 3:] *= eps
    return y, w


@pytest.mark.parametrize("degree", [3, 5])
def test_truncation_drops_third_order_and_only_that(rng, degree):
    whole, x, u = low_order(rng, whole=True, size=1.0, degree=degree)
    cut, *_ = low_order(rng, whole=False, degree=degree)
    gaps = {"mass": [], "force": []}
    for eps in (2e-2, 1e-2):
        y, w = scaled(x, u, eps)
        gaps["mass"].append(np.abs(whole.mass(y) - cut.mass(y)).max())
        gaps["force"].append(np.abs(force_of(whole, y, w) - force_of(cut, y, w)).max())
    for pair in gaps.values():
        assert pair[1] > 0
        assert pair[0] / pair[1] == pytest.approx(8.0, rel=0.15)


def test_what_truncation_leaves_of_the_turning_inertia_is_told(rng):
    whole, x, _ = low_order(rng, whole=True)
    cut, *_ = low_order(rng, whole=False)
    straight = cut.mass(np.zeros_like(x))[0, 2, 2]
    gap = np.abs(whole.mass(x) - cut.mass(x))[0, 2, 2]
    assert cut.third_order_inertia(x) == pytest.approx(gap / straight, rel=1e-12)


def test_truncated_mass_and_force_are_polynomials_of_second_degree(rng):
    cut, x, u = low_order(rng, whole=False, size=1.0)
    for function in (lambda y, w: cut.mass(y), lambda y, w: force_of(cut, y, w)):
        a, b, c, d = (function(*scaled(x, u, eps)) for eps in (0.0, 0.5, 1.0, 1.5))
        assert np.abs(d - 3 * c + 3 * b - a).max() < 1e-12 * np.abs(d).max()


# ---------------------------------------------------------------- damping


FLEXIBLE = [m for m in MODELS if m != "rigid"]
DAMPED = [(m, o) for m in FLEXIBLE for o in CABLES if m != "lowOrder" or o == CABLES[0]]
DAMPED += [(m, "degree: 5") for m in FLEXIBLE]
AT_POINTS = f"{CABLES[1]}, quadrature: {{axial: 5, bending: 3}}"


@pytest.mark.parametrize(("model", "options"), DAMPED)
def test_damping_takes_what_its_force_says_and_nothing_from_rigid_motion(model, options, rng):
    bare, damped = (scene_of(model, options, damping=d) for d in (0.0, 0.02))
    system = damped.system
    assert system.dissipates
    q, v = deformed(damped, rng, 4)
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    t = np.zeros(len(x))
    power = system.power(t, x, u)
    assert np.all(power < 0)
    force = system.force(t, x, u) - bare.system.force(t, x, u)
    assert np.sum(force * u, axis=-1) == pytest.approx(power, rel=1e-9)
    if model == "lowOrder":
        still = np.zeros_like(v)
        still[:, :3] = v[:, :3]
    else:
        nodes = x.reshape(len(x), -1, 2)
        still = 1.3 * np.stack([-nodes[..., 1], nodes[..., 0]], axis=-1)
        still[:, :: scene_stride(damped)] += [0.5, -0.7]
        still = still.reshape(x.shape)
    lost = system.force(t, x, still) - bare.system.force(t, x, still)
    assert np.abs(lost).max() < 1e-12 * np.abs(force).max()
    assert np.abs(system.power(t, x, still)).max() < 1e-14 * np.abs(power).max()


def test_damped_power_is_that_of_strain_and_curvature_rates(rng):
    scene = scene_of("ancf", damping=0.02)
    x, u = deformed(scene, rng, 1)
    lost, EA, EI = 0.0, 2e6 * 0.004, 2e6 * 0.05 * 0.08**3 / 12

    def strain_and_curvature(s, e, a):
        nodes = (x + np.outer(s, u))[:, 4 * e : 4 * e + 8].reshape(len(s), 4, 2)
        r, c = cable_row_x(a, 0.5) @ nodes, cable_row_xx(a, 0.5) @ nodes
        square = np.sum(r * r, axis=-1)
        return np.stack([square / 2, (r[:, 0] * c[:, 1] - r[:, 1] * c[:, 0]) / square], axis=-1)

    for e in range(3):
        for a, weight in zip(*gauss(5, 0, 0.5), strict=True):
            rates = along(lambda s, e=e, a=a: strain_and_curvature(s, e, a), 1e-3)
            lost += 0.02 * weight * rates**2 @ [EA, EI]
    assert scene.system.power(np.zeros(1), x, u)[0] == pytest.approx(-lost, rel=1e-8)


def damping_matrix(model, kind, options=""):
    scene = scene_of(model, options, damping=0.02)
    part, x = part_of(scene, kind), scene.bodies["b1"].placed(Pose.planar((0.0, 0.0), 0.6))
    return jacobian(lambda u: force_of(part, np.repeat(x[None], len(u), axis=0), u), 0 * x)


@pytest.mark.parametrize("options", ["", "degree: 6"])
def test_linear_damping_is_the_exact_one_at_small_deformation(options):
    linear, exact = (LinearElasticForce, KelvinVoigtForce)
    close(damping_matrix("linear", linear, options), damping_matrix("ancf", exact, options), 1e-10)


def test_damping_is_the_stiffness_times_the_retardation_time():
    K = jacobian(lambda s: force_of(part_of(scene_of("lowOrder"), LowOrderBeam), s), np.zeros(16))
    beam = part_of(scene_of("lowOrder", damping=0.02), LowOrderBeam)
    close(jacobian(lambda u: force_of(beam, 0 * u, u), np.zeros(16)), 0.02 * K, 1e-10)
    scene = scene_of("ancf", CABLES[1])
    x = scene.bodies["b1"].placed(Pose.planar((0.0, 0.0), 0.6))
    K = stiffness_of(part_of(scene, ElasticForce), x)
    close(damping_matrix("ancf", KelvinVoigtForce), -0.02 * K, 1e-10)


# ---------------------------------------------------------------- energy

BUSY = """
joints:
  pin: {type: revolute, between: [ground, b1.root]}
  elbow: {type: revolute, between: [b1.tip, b2.root]}
  mount: {type: fixed, between: [b2.tip, hub.rim]}
  drive: {type: driver, between: [ground, b1.root], angle: {type: sine, amplitude: 0.3, frequency: 0.4}}
springs:
  coil: {type: rotational, between: [b1.tip, b2.root], stiffness: 3.0, damping: 0.2}
  line: {type: two_point, between: [ground, hub], stiffness: 20.0, damping: 0.4, rest_length: 0.5}
loads:
  push: {type: force, at: b2.inside, force: [2.0, 1.0], follower: true}
  twist: {type: moment, at: hub, moment: 0.7}
"""


def busy_scene(model, options):
    whole = ", truncation: none" if model == "lowOrder" else ""
    bodies = f"  b1: {{{BEAM}, {options}{whole}}}\n"
    bodies += f"  b2: {{{BEAM}, {options}{whole}, points: {{inside: [0.9, 0.0]}}}}\n"
    bodies += "  hub: {type: rigid, mass: 1.5, inertia: 0.4, points: {rim: [0.2, 0.1]}}"
    return scene_of(model, gravity=(0.3, -9.81), damping=cable_damping(options), bodies=bodies, rest=BUSY)


def cable_damping(options):
    return 0.0 if "continuum" in options else 0.01


@pytest.mark.parametrize(("model", "options"), [*KINDS, ("exact", AT_POINTS), ("ancf", AT_POINTS)])
def test_energy_changes_by_the_power_put_in(model, options, rng):
    scene = busy_scene(model, options)
    system = scene.system
    t = np.full(1, 0.35)
    for size in (0.0, 0.003 if "degree" in options else 0.03):
        q = scene.q[None] + size * rng.normal(size=(1, system.n))
        q, v = system.project(t, q, rng.normal(size=(1, system.n)))
        x, u = system.absolute(q), system.absolute_velocity(q, v)
        drift = (system.unreduced.phi.jacobians(x) @ u[..., None])[..., 0] + system.unreduced.phi.rate(t)
        assert np.abs(drift).max() < 1e-10
        a = system.acceleration(t, q, v)

        def total(s, q=q, v=v, a=a):
            states, rates, times = q + np.outer(s, v), v + np.outer(s, a), np.repeat(t, len(s))
            y, w = system.absolute(states), system.absolute_velocity(states, rates)
            return system.kinetic_energy(y, w) + system.strain_energy(y) + system.potential_energy(times, y)

        rate, scale = along(total, 1e-4), np.linalg.norm(v) * np.linalg.norm(system.force(t, x, u))
        assert system.power(t, x, u)[0] == pytest.approx(rate, abs=1e-8 * scale)


def test_truncated_low_order_says_that_it_may_feed_energy(rng):
    assert low_order(rng, whole=False)[0].truncated
    assert not low_order(rng, whole=True)[0].truncated


@pytest.mark.parametrize("model", [one for one in MODELS if one != "rigid"])
def test_a_beam_dissipates_if_its_material_is_damped_in_any_way(model):
    def dissipates(**damping):
        settings = [f"materials.soft.{key}_damping={value}" for key, value in damping.items()]
        text = DECK.format(gravity=[0, 0], damping=0.0, bodies=f"  b1: {{{BEAM}}}", rest="")
        return build(parse_deck(text, overrides=settings), model).system.dissipates

    assert dissipates(axial=0.01) and dissipates(bending=0.01) and not dissipates()


# ---------------------------------------------------------------- frames


@pytest.mark.parametrize(("model", "options"), [*(k for k in KINDS if k[0] != "rigid"), ("exact", CABLES[1])])
def test_a_free_body_accelerates_alike_in_a_turned_and_shifted_frame(model, options, rng):
    system = (scene := scene_of(model, options)).system
    q, v = deformed(scene, rng, 1)
    t, angle = np.zeros(1), 1.9
    a = system.acceleration(t, q, v)
    moved, rates, expected = q.copy(), v.copy(), a.copy()
    column = scene.bodies["b1"].angle_column
    vectors = slice(0, None if column is None else 2)
    turn = np.kron(np.eye(q[:, vectors].shape[1] // 2), turned(angle))
    for values in (moved, rates, expected):
        values[:, vectors] = values[:, vectors] @ turn.T
    if column is not None:
        moved[:, :2] += [3.0, -1.0]
        moved[:, column] += angle
    tolerance = 1e-9 if column is None else 1e-11
    close(system.acceleration(t, moved, rates), expected, tolerance)


@pytest.mark.parametrize("options", [*CABLES, "degree: 5"])
def test_the_derivative_of_damping_by_place_is_the_slope_of_its_force(options, rng):
    scene = scene_of("ancf", options, damping=0.02)
    part = part_of(scene, KelvinVoigtForce)
    x = scene.system.absolute(deformed(scene, rng, 1, 0.05)[0])[0]
    u = rng.normal(size=x.shape)
    slope = jacobian(lambda s: force_of(part, s, np.repeat(u[None], len(s), axis=0)), x)
    close(stiffness_of(part, x, u), -slope, 1e-5)


# ---------------------------------------------------------------- stretch


@pytest.mark.parametrize("element", ELEMENTS)
def test_the_smallest_stretch_is_found_along_the_whole_beam(element):
    """Along x + a x^2 the stretch is 1 + 2 a x: smallest at the root, or at the tip."""
    scene = scene_of("ancf", f"element: {element}")
    body, system = scene.bodies["b1"], scene.system
    for a, smallest in ((0.1, 1.0), (-0.2, 1.0 - 2 * 0.2 * 1.5)):
        places = np.linspace(0.0, 1.5, 4)
        nodes = np.zeros((4, body.mesh.n_vectors // 4, 2))
        nodes[:, 0, 0], nodes[:, 1, 0] = places + a * places**2, 1.0 + 2.0 * a * places
        nodes[:, 2:, 1] = 1.0
        x = np.zeros((1, system.n_x))
        x[0, body.columns] = nodes.ravel()
        assert body.smallest_stretch(x @ np.eye(system.n_x))[0] == pytest.approx(smallest, rel=1e-12)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_beam_bent_as_another_one_was_has_its_slopes_and_sections(element):
    body = scene_of("exact", f"element: {element}").bodies["b1"]
    places = body.mesh.axis.places
    slope = 0.02 * places**2
    none = np.zeros((1, 1))
    seen = Deformation(
        places, body.mesh.axis.weights, np.zeros((1, len(places))), slope[None, :, None],
        0.04 * places[None, :, None], none, none,
    )  # fmt: skip
    x, u = body.deformed(Pose.planar((0.3, -0.2), 0.7), Twist(np.zeros(2), np.zeros(1)), seen)
    assert not u.any()
    found = body.deformation(x[None], u[None])
    # from the last place to the tip the slope is held: quadratic deflections show it
    assert found.slope[0, :, 0] == pytest.approx(slope, abs=5e-3)
    vectors = x.reshape(-1, 2)
    for k in range(0, len(vectors), body.mesh.element.stride):
        # bending alone stretches nothing, to third order of the slope
        assert np.linalg.norm(vectors[k + 1]) == pytest.approx(1.0, abs=1e-5)
        for across in vectors[k + 2 : k + body.mesh.element.per_node]:
            assert across @ vectors[k + 1] == pytest.approx(0.0, abs=1e-4)
