"""Forces as stiffness times strain, as searches for rest take them: the same force, strains, tangent."""

from functools import partial

import numpy as np
import pytest
from analytical import jacobian

from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

BEAM = """
hfsim: 1
gravity: {gravity}
materials: {{m: {{density: 1000.0, youngs_modulus: 1.0e+6, poisson_ratio: 0.3, bending_damping: 0.01}}}}
sections:
  s: {{shape: rectangle, width: 0.1, height: 0.1}}
  thin: {{shape: rectangle, width: 0.1, height: 0.05}}
bodies: {{b: {{type: beam, material: m, length: 1.0, elements: 2, {more}}}}}
joints: {{pin: {{type: {joint}, between: [ground, b.root]}}}}
solve: {{duration: 1.0, model: {model}}}
"""
EEB = "strain: engineering, curvature: exact"
LINES = ["", "degree: 5", "strain: engineering", "curvature: exact, degree: 4", EEB]
KINDS = [
    *(("exact", line, space) for line in LINES for space in (False, True)),
    ("exact", "stations: [{at: 0.0, section: s}, {at: 1.0, section: thin}]", False),
    ("exact", "element: continuum", False),
    ("exact", "element: continuum, section_degree: 2", False),
    ("linear", "", False),
    ("linear", "", True),
    ("linear", "element: continuum", False),
    ("linear", "element: continuum", True),
]


@pytest.mark.parametrize(("model", "more", "space"), KINDS)
def test_a_force_is_the_same_in_strains(rng, model, more, space):
    more = ", ".join(one for one in ("" if "element" in more else "element: cable", more) if one)
    gravity, joint = ("[0, 0, -9.81]", "spherical") if space else ("[0, -9.81]", "revolute")
    more += "" if "stations" in more else ", section: s"
    scene = build(parse_deck(BEAM.format(gravity=gravity, joint=joint, model=model, more=more)))
    x = scene.system.absolute(scene.q[None])[0]
    x, t, u = x + 0.05 * rng.normal(size=x.shape), np.zeros(1), np.zeros((1, len(x)))
    plain = next(part for part in scene.system.forces if part.in_strains().strain_stiffness.size)
    force = plain.in_strains()
    e, C = force.strain(x[None]), force.strain_stiffness
    at = force.strain_slopes(x[None])
    slopes = np.zeros((len(C), len(x)))
    np.add.at(slopes, (at.rows, at.columns), at.values)
    assert slopes == pytest.approx(jacobian(force.strain, x), abs=1e-7 * np.abs(slopes).max())

    def pushed(part, y=x[None]):
        out = np.zeros_like(y)
        part.add_force(np.zeros(len(y)), y, np.zeros_like(y), out)
        return out

    size = np.abs(pushed(plain)).max()
    assert pushed(force.strained(e)) == pytest.approx(pushed(plain), abs=1e-12 * size)
    other = e + rng.normal(size=e.shape) * np.abs(e).max()
    change = pushed(plain) - pushed(force.strained(other))
    assert change == pytest.approx(((other - e) * C) @ slopes, abs=1e-9 * np.abs(change).max())
    for given in (e, other):
        held = force.strained(given)
        own = np.zeros((len(x), len(x)))
        found = held.tangent(t, x[None], u)
        np.add.at(own, (found.rows, found.columns), found.values)
        right = slopes.T @ (C[:, None] * slopes) - jacobian(partial(pushed, held), x)
        assert own == pytest.approx(right, abs=1e-6 * np.abs(own).max())
