"""The element cosserat in the plane: strains against those in space, statics, frequencies."""

import numpy as np
import pytest
import scipy.linalg
from cantilevers import at_rest, cantilever, displacement

from hfsim.parts.elements.cosserat import STRAINS
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

ELASTICA = {
    0.2: (0.099636163037402, 0.0026465483405228, 0.06636448214483),
    2.0: (0.78174983155654, 0.16064172082517, 0.49345748039671),
    10.0: (1.4302855388039, 0.55499559775375, 0.8106090248803),
}
"""Case S9: end rotation, shortening and deflection by P L^2 / EI, neither stretched nor sheared."""


def raised(V):
    """The same vectors in space, with a third section axis across the plane."""
    slope, y, bent = np.moveaxis(np.pad(V, ((0, 0), (0, 0), (0, 0), (0, 1))), -2, 0)
    across = np.zeros_like(y)
    across[..., 2] = 1.0
    return np.stack([slope, y, across, bent, np.zeros_like(y)], axis=-2)


def test_strains_are_those_in_space(rng):
    V = 0.3 * rng.normal(size=(2, 4, 3, 2)) + np.eye(3, 2)
    own, space = (STRAINS[k].of(np.moveaxis(v, (-2, -1), (0, 1))) for k, v in ((2, V), (3, raised(V))))
    assert space[list(STRAINS[2].which)] == pytest.approx(own, abs=1e-14)
    assert np.abs(np.delete(space, STRAINS[2].which, axis=0)).max() == 0.0


def stiffness(EA, GA, EI, mass=1.0, inertia=1.0):
    return (
        f"{{mass_per_length: {mass!r}, rotary_inertia: {inertia!r}, axial_stiffness: {EA!r}, "
        f"shear_stiffness: {GA!r}, bending_stiffness: {EI!r}}}"
    )


def bent(scene):
    """Displacement of the tip and how far its section has turned."""
    x = at_rest(scene, 1.0)
    return (*displacement(scene, x), float(scene.marker("b.tip").angle(x)[0]))


@pytest.mark.slow
@pytest.mark.parametrize("turns", [0.25, 1.0, 2.0])
def test_an_end_moment_bends_into_circles(turns):
    """Case S8: M = t EI / L."""
    t = 2.0 * np.pi * turns
    scene = cantilever(stiffness(1e4, 1e4, 3.0), 1.0, (0.0, 0.0), 3.0 * t, elements=6, degree=8)
    x, y, angle = bent(scene)
    assert (x, y) == pytest.approx((np.sin(t) / t - 1.0, (1.0 - np.cos(t)) / t), abs=2e-9)
    assert np.exp(1j * angle) == pytest.approx(np.exp(1j * t), abs=1e-9)


@pytest.mark.parametrize("load", ELASTICA)
def test_the_elastica_is_the_limit_of_stiff_sections(load):
    """Case S9: what is left falls with the compliance in stretch and shear."""
    missed = []
    for stiff in (1e5, 1e6):
        scene = cantilever(stiffness(stiff, stiff, 1.0), 1.0, (0.0, load), elements=4, degree=6)
        x, y, angle = bent(scene)
        missed.append(np.subtract((angle, -x, y), ELASTICA[load]))
    assert np.abs(missed[0]).max() < 2e-4
    assert missed[1] == pytest.approx(0.1 * missed[0], rel=1e-2, abs=1e-8)


PINNED = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {stuff: {density: 1000.0, youngs_modulus: 1.0e7, poisson_ratio: 0.3}}
sections: {bar: {shape: rectangle, width: 0.1, height: 0.2}}
ground: {points: {end: [1.0, 0.0]}}
bodies:
  b: {type: beam, element: cosserat, material: stuff, section: bar, length: 1.0, elements: 2, degree: 8}
joints:
  left: {type: revolute, between: [ground, b.root]}
  right: {type: revolute, between: [ground.end, b.tip]}
solve: {duration: 1.0}
"""


def test_frequencies_of_timoshenko():
    """A thick beam pinned at both ends: both branches of each wave number n pi / L."""
    scene = build(parse_deck(PINNED))
    linear = scene.system.linearized(0.0, scene.q, scene.v)
    free = linear.allowed
    omega = np.sqrt(np.abs(scipy.linalg.eigvalsh(free @ linear.stiffness @ free.T)))
    mass, inertia, EI = 20.0, 1000.0 * 0.1 * 0.2**3 / 12, 1e7 * 0.1 * 0.2**3 / 12
    kGA = 5.0 / 6.0 * 1e7 / 2.6 * 0.02
    for n in (1, 2, 3):
        k2 = (n * np.pi) ** 2
        both = np.roots([mass * inertia, -(kGA * inertia + EI * mass) * k2 - mass * kGA, kGA * EI * k2**2])
        for one in np.sqrt(both):
            assert np.abs(omega / one - 1.0).min() < 1e-6


@pytest.mark.parametrize("axis", ["arc: {radius: 2.0, angle: ANGLE}", "points: POINTS"])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_curved_beam_straightens_under_its_own_moment(axis, sense):
    """A quarter of a circle under M = EI / R is straight; the sections at its ends are across it."""
    a = np.linspace(0.0, 0.5 * np.pi, 60)
    points = np.stack([2.0 * np.sin(a), sense * 2.0 * (1.0 - np.cos(a))], axis=1).tolist()
    more = "axis: {" + axis.replace("ANGLE", f"{sense * 90} deg").replace("POINTS", str(points)) + "}"
    scene = cantilever(stiffness(1e4, 1e4, 3.0), 0.0, (0.0, 0.0), -sense * 1.5, 4, 6, more=more)
    start = scene.marker("b.tip").position(scene.system.absolute(scene.q[None]))[0]
    assert start == pytest.approx((2.0, sense * 2.0), abs=1e-12)
    x = at_rest(scene, 1.0)
    rel = 1e-9 if axis.startswith("arc") else 1e-5
    assert scene.marker("b.tip").position(x)[0] == pytest.approx((np.pi, 0.0), abs=np.pi * rel)
    assert scene.marker("b.tip").angle(x)[0] == pytest.approx(-sense * 0.5 * np.pi, abs=rel)


def test_section_vectors_keep_their_length(rng):
    """Equation, rate, bias and stiffness of a node, as itself and as a product of vectors."""
    scene = cantilever(stiffness(1.0, 1.0, 1.0), 1.0, (0.0, 0.0), elements=1, degree=2)
    *_, c = scene.bodies["b"].own_constraints()
    n, t, h = scene.system.n_x, np.zeros(1), 1e-5
    x, u, multipliers = rng.normal(size=(1, n)), rng.normal(size=(1, n)), rng.normal(size=(1, 1))
    d = x[0, -2:]
    assert c.gap(x)[0] == pytest.approx([0.5 * (d @ d - 1.0)])
    (product,) = c.products
    own = product.first.matrix @ x[0, product.first.columns]
    assert product.weight * own @ d - product.constant == pytest.approx(c.gap(x)[0, 0])
    J, moved = c.jacobian(1, x)[0], [c.gap(x + s * u)[0] for s in (-h, 0.0, h)]
    assert J @ u[0, c.second.columns] == pytest.approx((moved[2] - moved[0]) / (2 * h), rel=1e-8)
    assert c.bias(x, u)[0] == pytest.approx((moved[2] - 2 * moved[1] + moved[0]) / h**2, rel=1e-4)
    assert c.residual(t, x) == pytest.approx(c.gap(x))
    entries = c.stiffness(x, multipliers)
    K = np.zeros((n, n))
    np.add.at(K, (entries.rows, entries.columns), entries.values)
    pulled = [multipliers[0] @ c.jacobian(1, x + s * u)[0] for s in (-h, h)]
    assert (K @ u[0])[c.second.columns] == pytest.approx((pulled[1] - pulled[0]) / (2 * h), rel=1e-8)


@pytest.mark.parametrize("angle", [0.0, 2.5])
def test_deformation_in_the_frame_at_the_root(angle):
    """A small force bends as F (L - x) / EI, and shears a little; turning the whole changes nothing."""
    scene = cantilever(stiffness(1e3, 1e3, 2.0), 1.0, (0.0, 1e-4), elements=2)
    body, x = scene.bodies["b"], at_rest(scene, 1.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = x.copy()
    turned[:, body.columns] = (body.vectors(x) @ turn.T + np.outer(body.positions, [1.0, 2.0])).ravel()
    seen = body.deformation(turned, np.zeros_like(x))
    assert seen.curvature[0, :, 0] == pytest.approx(1e-4 * (1.0 - seen.places) / 2.0, rel=1e-6, abs=1e-12)
    bent = 1e-4 * (seen.places - 0.5 * seen.places**2) / 2.0
    assert seen.slope[0, :, 0] == pytest.approx(bent + 1e-7, rel=1e-3, abs=1e-10)
    assert seen.tip[0] == pytest.approx(displacement(scene, x)[1:], rel=1e-9)
    assert np.abs(seen.axial).max() < 1e-8
