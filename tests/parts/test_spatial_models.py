"""Models of beams in space: a planar motion in any plane of space is that of the planar model."""

import json

import numpy as np
import pytest
from analytical import gauss, jacobian
from element_laws import gradient_of

from hfsim.deck.materials import BeamProperties
from hfsim.maths.matrices import assemble
from hfsim.maths.rotations import cross, rotation, rotation_vector
from hfsim.parts.elements import Cable, Measures
from hfsim.parts.elements.forces import KelvinVoigtForce
from hfsim.parts.elements.polynomial import difference_rows
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate
from hfsim.trust.quasistatic import deformation_of

R = rotation(np.array([0.7, -1.1, 0.4]))
"""How the plane is turned that planar decks are put into."""
BEAM = "type: beam, material: soft, section: bar, element: cable, elements: 2"
HEAD = """hfsim: 1
materials:
  soft: {{density: 900.0, youngs_modulus: 2.0e6, axial_damping: {damping}, bending_damping: {damping}}}
sections: {{bar: {{shape: rectangle, width: 0.05, height: 0.05}}}}
solve: {{model: {model}, duration: {duration}, tolerance: 1.0e-11, coordinates: {coordinates}}}
"""
PLANE = """
gravity: [0.0, -9.81]
bodies:
  b1: {{{BEAM}, length: 1.5, points: {{mid: [0.7, 0.0]}}{options}}}
  b2: {{{BEAM}, length: 1.0{options}}}
joints:
  pin: {{type: revolute, between: [ground, b1.root]}}
  elbow: {{type: revolute, between: [b1.mid, b2.root]}}
initial: {{b1: {{angle: 0.3, angular_velocity: 2.0}}, b2: {{angle: -0.2}}}}
output: {{interval: 0.05, channels: [b1.tip.x, b1.tip.y, b2.tip.x, b2.tip.y, energy.total, energy.strain]}}
"""
SPACE = """
gravity: {gravity}
bodies:
  b1: {{{BEAM}, length: 1.5, points: {{mid: [0.7, 0.0, 0.0]}}{options}}}
  b2: {{{BEAM}, length: 1.0{options}}}
joints:
  ball: {{type: spherical, between: [ground, b1.root]}}
  elbow: {{type: spherical, between: [b1.mid, b2.root]}}
initial:
  b1: {{orientation: {{rotation_vector: {first}}}, angular_velocity: {spin}}}
  b2: {{orientation: {{rotation_vector: {second}}}}}
output: {{interval: 0.05, channels: [b1.tip.x, b1.tip.y, b1.tip.z, b2.tip.x, b2.tip.y, b2.tip.z, energy.total,
                                     energy.strain]}}
"""


def both(model, options="", damping=0.0, duration=0.5, coordinates="auto"):
    """The decks of a planar scene and of the same one in a plane of space."""
    turns = [rotation_vector(R @ rotation(np.array([0.0, 0.0, angle]))) for angle in (0.3, -0.2)]
    first, second = (json.dumps(turn.tolist()) for turn in turns)
    head = HEAD.format(damping=damping, model=model, duration=duration, coordinates=coordinates)
    space = SPACE.format(
        BEAM=BEAM,
        options=options,
        gravity=json.dumps((R @ [0.0, -9.81, 0.0]).tolist()),
        first=first,
        second=second,
        spin=json.dumps((2.0 * R[:, 2]).tolist()),
    )
    return parse_deck(head + PLANE.format(BEAM=BEAM, options=options)), parse_deck(head + space)


def points(result, body, n_dim):
    return np.stack([result[f"{body}.tip.{axis}"] for axis in "xyz"[:n_dim]], axis=1)


def run(deck):
    result = simulate(deck, error_estimate=False)
    assert result.status == "done", result.reason
    return result


def check_same_motion(*args, **kwargs):
    plane, space = map(run, both(*args, **kwargs))
    for body in ("b1", "b2"):
        seen = points(space, body, 3) @ R
        assert seen[:, :2] == pytest.approx(points(plane, body, 2), abs=1e-9)
        assert np.abs(seen[:, 2]).max() < 1e-9
    for name in ("energy.total", "energy.strain"):
        assert space[name] == pytest.approx(plane[name], abs=1e-8)


ENGINEERING = ", strain: engineering"


@pytest.mark.parametrize(
    ("model", "options", "damping", "coordinates"),
    [
        ("rigid", "", 0.0, "auto"),
        ("ancf", "", 0.0, "auto"),
        ("exact", ", curvature: exact, quadrature: {axial: 5, bending: 3}", 0.0, "auto"),
        ("exact", ENGINEERING, 0.0, "auto"),
        ("exact", ENGINEERING + ", curvature: exact, degree: 5", 0.0, "auto"),
        ("exact", ENGINEERING + ", curvature: exact", 1e-3, "auto"),
        ("exact", "", 0.0, "frame"),
        ("linear", "", 0.0, "auto"),
        ("linear", "", 1e-3, "absolute"),
    ],
)
def test_a_planar_motion_in_space_is_the_planar_one(model, options, damping, coordinates):
    check_same_motion(model, options, damping, coordinates=coordinates)


# elastic and damping forces ----------------------------------------------------------------------------

LENGTH, DEGREE = 0.6, 4
STIFFNESS = BeamProperties(axial_stiffness=300.0, bending_stiffness=2.0)
OPTIONS = [(s, c) for s in ("green", "engineering") for c in ("linear", "exact")]


def law_of(strain, curvature, n_dim=3):
    return Cable(LENGTH, DEGREE).law(STIFFNESS, 1, Measures(strain, curvature, 12, 12, n_dim))


def bent(rng, n_dim=3, size=0.3):
    """Difference vectors of one element, shape (1, 1, n_vectors, n_dim)."""
    V = size * rng.normal(size=(1, 1, DEGREE, n_dim))
    V[..., [0, 1, -1], 0] += 1.0
    return V


@pytest.mark.parametrize(("strain", "curvature"), OPTIONS)
def test_energy_of_a_line_in_space(strain, curvature, rng):
    law, V = law_of(strain, curvature), bent(rng)
    x, w = gauss(12, 0.0, 1.0)
    s, c = (difference_rows(x, k, DEGREE) @ V[0, 0] for k in (1, 2))
    stretch = np.linalg.norm(s, axis=1)
    e = stretch - 1.0 if strain == "engineering" else 0.5 * (stretch**2 - 1.0)
    k = np.cross(s, c) / stretch[:, None] ** 2 if curvature == "exact" else c
    density = 300.0 * LENGTH * e**2 + 2.0 / LENGTH * np.sum(k * k, axis=1)
    assert law.energy(V)[0, 0] == pytest.approx(0.5 * w @ density, rel=1e-12)
    flat = V.reshape(-1)

    def energy(v):
        return law.energy(v.reshape(-1, 1, *V.shape[2:]))[:, 0]

    def gradient(v):
        return gradient_of(law, v.reshape(-1, 1, *V.shape[2:])).reshape(len(v), -1)

    slope = jacobian(lambda v: energy(v)[:, None], flat)[0]
    assert gradient_of(law, V).ravel() == pytest.approx(slope, rel=1e-7)
    H = law.hessian(V)[0, 0]
    assert np.abs(H - jacobian(gradient, flat)).max() < 1e-8 * np.abs(H).max()
    assert np.abs(H - H.T).max() < 1e-13 * np.abs(H).max()
    assert law.energy(V @ R.T) == pytest.approx(law.energy(V), rel=1e-12)


def damper(scene):
    return next(part for part in scene.system.forces if isinstance(part, KelvinVoigtForce))


def test_damping_in_space_resists_no_rigid_motion_and_exerts_none(rng):
    scene = build(both("exact", damping=1e-2)[1])
    part, body = damper(scene), scene.bodies["b1"]
    x = np.zeros((1, scene.system.n_x))
    x[0] = scene.system.absolute(scene.q[None])[0] + 0.2 * rng.normal(size=x.shape[1])
    motions = np.zeros((6, x.shape[1]))
    motions[:, body.columns] = body.freedoms(x[0])
    force, rates = np.zeros_like(motions), rng.normal(size=(1, x.shape[1]))
    part.add_force(np.zeros(6), np.repeat(x, 6, axis=0), motions, force)
    size = np.zeros_like(x)
    part.add_force(np.zeros(1), x, rates, size)
    assert np.abs(force).max() < 1e-9 * np.abs(size).max()
    assert np.abs(motions @ size[0]).max() < 1e-9 * np.abs(size).max()
    assert (size * rates).sum() == pytest.approx(part.power(np.zeros(1), x, rates)[0], rel=1e-12)
    K = assemble([part.rate_tangent(np.zeros(1), x, rates)], (x.shape[1],) * 2)
    assert -K @ rates[0] == pytest.approx(size[0], abs=1e-12 * np.abs(size).max())


def test_all_of_the_rate_of_a_straight_line_s_curvature_is_damped(rng):
    """At rest in a straight line there is no direction yet: both planes count, and to second order in all."""
    scene = build(both("exact", damping=1e-2)[1])
    part, x = damper(scene), scene.system.absolute(scene.q[None])
    u = np.zeros((1, scene.system.n_x))
    slopes = scene.bodies["b1"].columns.start + 3 + np.arange(3)
    u[:, slopes] = rng.normal(size=3)
    t = scene.bodies["b1"].marker((0.0, 0.0, 0.0)).axes(x)[0, 0]
    across, turn = cross(t, u[0, slopes]), rotation(0.8 * t)
    lost = [part.power(np.zeros(1), x, u)[0]]
    u[:, slopes] = turn @ u[0, slopes]
    lost.append(part.power(np.zeros(1), x, u)[0])
    assert lost[0] == pytest.approx(lost[1], rel=1e-9)
    u[:, slopes] = across
    assert abs(part.power(np.zeros(1), x, u)[0]) > 1e-3 * abs(lost[0])


# rigid -----------------------------------------------------------------------------------------------


def test_forces_would_bend_a_rigid_line_in_space_as_in_the_plane():
    seen = []
    for deck in both("rigid"):
        scene = build(deck)
        state = np.zeros(1), scene.q[None], scene.v[None]
        seen.append({name: deformation_of(scene, body, *state) for name, body in scene.bodies.items()})
    plane, space = seen
    for name in ("b1", "b2"):
        assert np.linalg.norm(space[name].tip) == pytest.approx(abs(plane[name].tip[0, 0]), rel=1e-9)
        assert space[name].axial == pytest.approx(plane[name].axial, abs=1e-12)
        assert space[name].steepness == pytest.approx(plane[name].steepness, abs=1e-12)
        assert np.linalg.norm(space[name].spin) == pytest.approx(abs(plane[name].spin[0, 0]))


def test_a_rigid_line_keeps_its_length_and_its_energy_out_of_plane():
    deck = both("rigid", duration=2.0)[1]
    spin = (1.0, 3.0, -2.0)
    initial = deck.deck.initial["b1"].model_copy(update={"angular_velocity": spin})
    changed = deck.deck.model_copy(update={"initial": {**deck.deck.initial, "b1": initial}})
    deck = type(deck)(changed, deck.source)
    result = run(deck)
    assert np.linalg.norm(points(result, "b1", 3), axis=1) == pytest.approx(1.5, abs=1e-12)
    assert np.ptp(result["energy.total"]) < 1e-10
