# ruff: noqa: E501
"""Internal forces with closed forms of motion: a rod that spins steadily, and the root of a pendulum."""

import numpy as np
import pytest
from turning import Turning

from hfsim.mechanics.acting import acting_on
from hfsim.mechanics.body import Acting
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

ROD = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {{stuff: {{density: 1000.0, youngs_modulus: 1.0e6, poisson_ratio: 0.3}}}}
sections: {{bar: {{shape: circle, radius: 0.02}}}}
bodies: {{b: {{type: beam, material: stuff, section: bar, length: 1.0, elements: {elements}, degree: {degree}, {more}}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
solve: {{duration: 1.0, model: ancf}}
"""
SPIN, PLACES = 20.0, np.linspace(0.0, 1.0, 21)


def tension_error(elements, degree, more):
    """The largest error of the tension over that at the root.

    Of a rod whose stress is linear in its stretch: E A X'' + rho A w^2 X = 0, X(0) = 0, X'(L) = 1 at the free
    end, so N = E A (cos(k x) / cos(k L) - 1) with k^2 = rho w^2 / E.
    """
    scene = build(parse_deck(ROD.format(elements=elements, degree=degree, more=more)))
    body, spin = scene.bodies["b"], Turning(scene, (0.0, 0.0, SPIN))
    found = body.section_forces(spin.x, 0.0 * spin.x, spin.x @ spin.W @ spin.W, Acting(), PLACES)[0]
    k, EA = SPIN * np.sqrt(1000.0 / 1e6), 1e6 * np.pi * 0.02**2
    expected = EA * (np.cos(k * PLACES) / np.cos(k) - 1.0)
    assert found[:, 1:] == pytest.approx(0.0, abs=1e-8 * expected[0])
    return np.abs(found[:, 0] - expected).max() / expected[0]


LINE = "element: cable, strain: engineering, curvature: exact"


@pytest.mark.parametrize(
    ("more", "degree", "order"),
    [*((LINE, p, q) for p, q in ((3, 4.7), (4, 6))), *(("element: cosserat", p, q) for p, q in ((1, 2), (2, 4), (3, 5)))],
)
def test_the_tension_of_a_spinning_rod_converges(more, degree, order):
    """At 21 places along it, whatever the element; what strains give has the power degree - 2 with a cable."""
    errors = [tension_error(n, degree, more) for n in (2, 4, 8)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(order, abs=0.6)
    assert errors[-1] < {1: 1e-3, 2: 1e-6}.get(degree, 1e-8)


@pytest.mark.parametrize(("more", "degree"), [(LINE, 3), ("element: cosserat", 3)])
def test_the_tension_of_a_spinning_rod_is_that_of_the_closed_form(more, degree):
    assert tension_error(2, degree, more) < 1e-6


THINNER = """
hfsim: 1
gravity: {gravity}
materials: {{stuff: {{density: 1000.0, youngs_modulus: 1.0e6}}}}
sections: {{thick: {{shape: rectangle, width: 0.04, height: 0.04}}, thin: {{shape: rectangle, width: 0.02, height: 0.02}}}}
bodies: {{b: {{type: beam, element: cable, material: stuff, length: 1.0, elements: 1, model: {model},
  stations: [{{at: 0, section: thick}}, {{at: 0.5, section: thick}}, {{at: 1, section: thin}}]}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("model", ["exact", "linear", "lowOrder"])
@pytest.mark.parametrize("n_dim", [2, 3])
def test_what_is_carried_is_the_weight_beyond_where_a_station_is_inside_an_element(model, n_dim):
    """A square of 40 mm up to the half, from there on down to 20 mm at the tip, of 1000 kg/m^3, held where it is."""
    gravity = [0.0, -10.0, *[0.0] * (n_dim - 2)]
    scene = build(parse_deck(THINNER.format(gravity=gravity, model=model)))
    x = scene.system.absolute(scene.q[None])
    found = scene.bodies["b"].section_forces(x, 0.0 * x, 0.0 * x, Acting(), PLACES)[0, :, 1]
    side = 0.04 - 0.04 * np.maximum(PLACES - 0.5, 0.0)
    mass = 1000.0 * (side**3 - 0.02**3) / (3.0 * 0.04) + 1000.0 * 0.04**2 * np.maximum(0.5 - PLACES, 0.0)
    weight = 10.0 * mass
    assert found == pytest.approx(-weight, abs=1e-9)


SHAKEN = """
hfsim: 1
gravity: {gravity}
materials: {{stuff: {{density: 1100.0, youngs_modulus: 5.0e7, axial_damping: 0.01, bending_damping: 0.01}}}}
sections: {{strip: {{shape: rectangle, width: 0.02, height: 0.02}}}}
bodies:
  b: {{type: beam, material: stuff, section: strip, length: 1.0, elements: 2, {more},
      points: {{half: {half}, side: {side}}}}}
  ball: {{type: rigid, mass: 0.3, inertia: {inertia}, points: {{off: {off}}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}, hold: {{type: {hold}, between: [b.half, ball.off]}}}}
springs: {{coil: {{type: two_point, between: [b.side, ball], stiffness: 30.0, rest_length: 0.1, damping: 1.0}}}}
loads:
  wind: {{type: distributed, on: b, force: {force}, shape: [[0.2, 1.0], [0.7, 2.0]], follower: {follower}}}
  push: {{type: force, at: b.tip, force: {force}}}
solve: {{duration: 1.0}}
"""
KINDS = {
    "exact": "element: cable",
    "degree 5": "element: cable, degree: 5, strain: engineering, curvature: exact, model: ancf",
    "linear": "element: cable, model: linear",
    "lowOrder": "element: cable, model: lowOrder, truncation: none",
    "continuum": "element: continuum",
    "continuum, linear": "element: continuum, model: linear",
    "cosserat": "element: cosserat, degree: 2",
    "cosserat, linear": "element: cosserat, degree: 2, model: linear",
    "cosserat, lowOrder": "element: cosserat, degree: 2, model: lowOrder, truncation: none",
    "arc": "element: continuum, axis: {arc: {radius: 1.0, angle: 1.0}}, section_angle: 0.3",
    "turned": "element: cosserat, axis: {arc: {radius: 1.0, angle: 1.0}}, section_angle: 0.3, twist: 0.2",
}
ONLY_IN_SPACE = {"arc", "turned", "cosserat, lowOrder"}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n_dim", [2, 3])
def test_sections_hold_what_joints_exert(kind, n_dim):
    """To rounding in any state, however far from the motion: at the root all of it, across a joint what it takes."""
    if n_dim == 2 and kind in ONLY_IN_SPACE:
        pytest.skip("not in the plane")
    own = {"gravity": [0.3, -9.81], "half": [0.5, 0.0], "side": [0.8, 0.0], "off": [0.1, 0.05], "force": [1.0, -2.0]}
    own = {key: [*value, *[0.0] * (n_dim - 2)] for key, value in own.items()}
    line = "cable" in KINDS[kind] and n_dim == 3
    inertia = [0.01, 0.02, 0.03] if n_dim == 3 else 0.01
    hold, follower = ("spherical", "false") if line else ("fixed", "true")
    more = KINDS[kind].replace("length: 1.0", "") if "axis" in KINDS[kind] else KINDS[kind]
    text = SHAKEN.format(**own, inertia=inertia, hold=hold, more=more, follower=follower)
    if "axis" in more:
        text = text.replace("length: 1.0, ", "")
    scene = build(parse_deck(text))
    system, body, t = scene.system, scene.bodies["b"], np.zeros(1)
    rng = np.random.default_rng(3)
    q, v = system.project(t, scene.q[None] + 0.02 * rng.normal(size=system.n), rng.normal(size=(1, system.n)))
    x, u = system.absolute(q), system.absolute_velocity(q, v)
    a, multipliers = system.solved(t, x, u)
    acting = acting_on(system, body.columns, t, x, u, multipliers)
    at = np.array([0.0, 0.5 - 1e-8, 0.5 + 1e-8, 1.0])
    found = body.section_forces(x, u, a, acting, at)
    axes = body.section_axes(x, at)
    force, moment = (np.einsum("bpij,bpj->bpi", axes, part)[0] for part in (found[..., :3], found[..., 3:]))
    for joint, of_beam in (("clamp", -(force[0], moment[0])[0]), ("hold", force[2] - force[1])):
        exerted = reaction(scene, joint, x, multipliers)
        size = np.abs(found).max()
        assert np.linalg.norm(exerted[0]) > 1e-3 * size
        assert of_beam[:n_dim] == pytest.approx(exerted[0], abs=(1e-10 if joint == "clamp" else 1e-5) * size)
    held = reaction(scene, "clamp", x, multipliers)[1]
    assert -moment[0][-len(held) :] == pytest.approx(held, abs=1e-10 * size)
    taken = reaction(scene, "hold", x, multipliers)[1]
    assert (moment[2] - moment[1])[-len(taken) :] == pytest.approx(taken, abs=1e-5 * size)
    assert force[3][:n_dim] == pytest.approx(own["force"], abs=1e-10 * size)


def reaction(scene, joint, x, multipliers):
    """Return what a joint exerts on its second body."""
    system = scene.system
    parts = [
        system.constraints[k].reaction(x, multipliers[:, system.unreduced.rows[k]]) for k in scene.joints[joint]
    ]
    return tuple(np.asarray(sum(kind))[0] for kind in zip(*parts, strict=True))


PENDULUM = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {{stuff: {{density: 1100.0, youngs_modulus: 5.0e7, axial_damping: 0.01, bending_damping: 0.01}}}}
sections: {{strip: {{shape: rectangle, width: 0.05, height: 0.02}}}}
bodies: {{b: {{type: beam, material: stuff, section: strip, length: 1.0, elements: {elements}, {more}}}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
solve: {{duration: 0.2, tolerance: 1.0e-9}}
output:
  interval: 0.02
  channels: [pin.force_x, pin.force_y, b.angle, b.root.axial_force, b.root.shear_force]
"""


def root_error(elements, more):
    """How far the forces in the root are from what the joint exerts there, over its size."""
    run = simulate(parse_deck(PENDULUM.format(elements=elements, more=more)), error_estimate=False)
    fx, fy, angle, axial, shear = (channel.values for channel in run.channels)
    along = -(fx * np.cos(angle) + fy * np.sin(angle))
    across = fx * np.sin(angle) - fy * np.cos(angle)
    gap = np.hypot(axial - along, shear - across)
    return gap[6:].max() / np.hypot(fx, fy).max()


def test_what_the_root_of_a_pendulum_bears_is_its_reaction():
    assert root_error(2, "degree: 3") < 1e-12
