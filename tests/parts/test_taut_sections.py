"""Beams with section vectors under tension: strings on coarse meshes, and weights that hang."""

import numpy as np
import pytest

import hfsim
from hfsim.parts.elements.cosserat import STRAINS
from hfsim.scene.loading import parse_deck

N, EA, EI, MASS, L = 1000.0, 1e6, 1e-2, 1.0, 20.0
STIFF = {
    2: f"rotary_inertia: 1e-6, shear_stiffness: {EA}, bending_stiffness: {EI}",
    3: f"rotary_inertia: [2e-6, 1e-6, 1e-6], shear_stiffness: [{EA}, {EA}], torsion_stiffness: {EI}, "
    f"bending_stiffness: [{EI}, {EI}]",
}
STRING = """
hfsim: 1
sections: {{s: {{mass_per_length: {mass}, axial_stiffness: {EA}, {stiff}}}}}
bodies:
  c: {{type: beam, element: cosserat, section: s, length: {length}, elements: {elements}, degree: {degree}}}
  g: {{type: rigid, mass: 0.1, inertia: {inertia}}}
ground: {{points: {{e: [{length}, {zeros}]}}}}
joints:
  a: {{type: revolute, {hinge}between: [ground, c.root]}}
  slide: {{type: prismatic, between: [ground.e, g], axis: [1, {zeros}]}}
  b: {{type: revolute, {hinge}between: [g, c.tip]}}
loads: {{pull: {{type: force, at: g, force: [{N}, {zeros}]}}}}
solve: {{duration: 1.0, model: {model}}}
"""


@pytest.mark.parametrize("n_dim", STRAINS)
def test_the_length_of_section_vectors_is_no_stretch(rng, n_dim):
    """Interpolated ones are shorter than one: whatever it is, r' = stretch d1 / |d1| has that stretch."""
    V = rng.normal(size=(2 * n_dim - 1, n_dim, 5))
    first = np.stack([V[1, 1], -V[1, 0]]) if n_dim == 2 else np.cross(V[1], V[2], axis=0)
    V[0] = 1.3 * first / np.linalg.norm(first, axis=0)
    assert STRAINS[n_dim].of(V)[0] == pytest.approx(1.3, rel=1e-14)


@pytest.mark.parametrize(
    ("n_dim", "degree", "model", "error"),
    [
        (2, 1, "exact", 1e-6),
        (2, 2, "ancf", 5e-4),
        (2, 3, "exact", 5e-5),
        (3, 1, "ancf", 1e-5),
        (3, 2, "exact", 5e-4),
        (3, 3, "exact", 5e-5),
    ],
)
def test_a_taut_string_keeps_its_notes(n_dim, degree, model, error):
    """Far beyond 2 sqrt(EA EI) / h; with degree 1 the notes are those of masses on a string without any."""
    elements = {1: 6, 2: 6, 3: 4}[degree]
    text = STRING.format(
        N=N,
        EA=EA,
        mass=MASS,
        length=L,
        stiff=STIFF[n_dim],
        elements=elements,
        degree=degree,
        inertia=1e-3 if n_dim == 2 else [1e-3] * 3,
        zeros=", ".join(["0"] * (n_dim - 1)),
        hinge="" if n_dim == 2 else "axis: [0, 0, 1], ",
        model=model,
    )
    found = hfsim.modes(parse_deck(text), about="equilibrium", count=8)
    assert all(mode.kind == "vibration" for mode in found)
    wave, spacing = np.pi / L * np.arange(1, 3), L / elements
    if degree == 1:
        wave = np.sin(0.5 * wave * spacing) / (0.5 * spacing)
    omega = np.array([mode.value.imag for mode in found])
    for one in wave * np.sqrt(N / MASS / (1.0 + N / EA)):
        assert np.abs(omega / one - 1.0).min() < error


HUNG = """
hfsim: 1
gravity: [{zeros}, -9.81]
materials: {{rubber: {{density: 1100, youngs_modulus: 5 MPa, poisson_ratio: 0.45}}}}
sections: {{round: {{shape: circle, diameter: 1 cm}}}}
bodies:
  cord: {{type: beam, element: cosserat, material: rubber, section: round, length: 1.0{mesh}}}
  bob: {{type: rigid, mass: 4.0, inertia: {inertia}}}
joints:
  hook: {{type: fixed, between: [ground, cord.root], {turn}}}
  knot: {{type: fixed, between: [cord.tip, bob]}}
solve: {{duration: 1.0, model: {model}}}
"""


@pytest.mark.parametrize("n_dim", STRAINS)
@pytest.mark.parametrize(
    ("mesh", "model"), [("", "exact"), ("", "ancf"), (", degree: 1", "exact"), (", degree: 2", "exact")]
)
def test_a_weight_hangs_by_a_cord(n_dim, mesh, model):
    """4 kg that stretch it by a tenth; of the whole length h is a quarter at most."""
    plane = n_dim == 2
    text = HUNG.format(
        zeros="0" if plane else "0, 0",
        inertia=0.01 if plane else [0.01] * 3,
        turn="angle: -90 deg" if plane else "orientation: {axis: [0, 1, 0], angle: 90 deg}",
        mesh=mesh,
        model=model,
    )
    found = hfsim.static(parse_deck(text)).statistics
    assert found["stable"] and not found["warnings"]
