# ruff: noqa: E501
"""A blade that turns steadily: published frequencies, and those that a model of it has."""

import numpy as np

from hfsim.maths.eigenpairs import eigenpairs
from hfsim.scene.loading import parse_deck
from hfsim.studies.modes.about import about

SLENDER = 70.0
"""Slenderness of the blade of cases S4 and S5: the root of A L^2 / I."""
FLAP = {1: 3.68164681395796, 2: 4.13731957302536, 3: 4.79727853236308, 4: 5.58500142088482, 5: 6.44954474856865}
LAG = {1: 3.54323626967308, 2: 3.62179696412413, 3: 3.74351189621078, 4: 3.89772252363934, 5: 4.07389585824054}
CORIOLIS = {1: 3.54269166, 2: 3.61956637, 3: 3.73831123, 5: 4.05808214}
AT_REST = 3.51601526850015
LAG_LINEAR = {1: 3.37029282, 2: 2.88999994, 3: 1.83114504}
GROWTH_LINEAR = {4: 1.90259, 5: 3.54137}
CABLE = "{{area: 1.0, second_moment: {moment}}}"
COSSERAT = (
    "{{mass_per_length: 1.0, rotary_inertia: [2.0e-7, 1.0e-7, 1.0e-7], axial_stiffness: {modulus}, "
    "shear_stiffness: [1.0e6, 1.0e6], torsion_stiffness: 1.0, bending_stiffness: [1.0, 1.0]}}"
)
FLAT = (
    "{{mass_per_length: 1.0, rotary_inertia: [1.01e-2, 1.0e-4, 1.0e-2], axial_stiffness: 1.0e4, "
    "shear_stiffness: [1.0e4, 1.0e4], torsion_stiffness: 0.4, bending_stiffness: [1.0, 100.0]}}"
)
BLADE = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {{light: {{density: 1.0, youngs_modulus: {modulus}}}}}
sections: {{bar: {section}}}
bodies: {{b1: {{type: beam, section: bar, length: 1.0, {element}}}}}
joints:
  hinge: {{type: revolute, between: [ground, b1.root]}}
  turn: {{type: driver, between: [ground, b1.root], angle: {{type: constant_rate, rate: {gamma}}}}}
initial: {{b1: {{angular_velocity: {gamma}}}}}
solve: {{model: {model}, duration: 1.0}}
"""
ELEMENTS = {
    "cable": (CABLE, "material: light, elements: 6, element: cable"),
    "cosserat": (COSSERAT, "elements: 3, degree: 4, element: cosserat"),
    "flat": (FLAT, "elements: 3, degree: 4, element: cosserat"),
}


def spectrum(model, gamma, alpha=SLENDER, loaded=False, element="cable"):
    """Eigenvalues of a blade that turns steadily, seen by who turns with it; straight, or in equilibrium."""
    section, beam = ELEMENTS[element]
    numbers = {"modulus": alpha**2, "moment": alpha**-2, "gamma": float(gamma), "model": model}
    deck = parse_deck(BLADE.format(section=section.format(**numbers), element=beam, **numbers))
    return eigenpairs(about(deck, "steady" if loaded else "start").motions.pencil, 60).values


def frequencies(values):
    """The imaginary parts of eigenvalues, none of them twice."""
    found = np.sort(values.imag[values.imag > 0.5])
    return found[np.diff(found, prepend=0.0) > 1e-4]


def off(found, expected):
    """How far the nearest of some numbers is from an expected one, relative to that."""
    return np.abs(found / expected - 1.0).min()
