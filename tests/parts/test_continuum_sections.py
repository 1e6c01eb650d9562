"""Static bending, torsion, locking and frequencies of fully parameterised beams, against theory."""

import numpy as np
import pytest
from cantilevers import at_rest, cantilever, displacement

from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

SOFT = "youngs_modulus: 1.0"


def square(side):
    return f"{{shape: rectangle, width: {side!r}, height: {side!r}}}"


def clamped(section, force, elements, degree, section_degree, moment=(0.0, 0.0, 0.0), poisson=0.0):
    """Tip of a clamped beam of unit length, and the scene and state it is of."""
    more = f"element: continuum, section_degree: {section_degree}"
    material = f"{SOFT}, poisson_ratio: {poisson}"
    scene = cantilever(section, 1.0, force, moment, elements, degree, material, more)
    x = at_rest(scene, 1.0)
    return displacement(scene, x), scene, x


def tip_in_the_plane(side, force, elements, section_degree):
    scene = build(
        parse_deck(f"""
hfsim: 1
gravity: [0.0, 0.0]
materials: {{stuff: {{density: 1000.0, {SOFT}}}}}
sections: {{bar: {square(side)}}}
bodies:
  b: {{type: beam, section: bar, length: 1.0, elements: {elements}, material: stuff, element: continuum,
       section_degree: {section_degree}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads: {{push: {{type: force, at: b.tip, force: [0.0, {force!r}], law: {{type: constant_rate, rate: 1.0}}}}}}
solve: {{duration: 1.0}}
""")
    )
    assert scene.system.n_rows == 0  # a clamp at the ground leaves the stretch of r_y alone
    return displacement(scene, at_rest(scene, 1.0))[1]


@pytest.mark.parametrize("n_dim", [2, 3])
def test_a_clamp_holds_the_section_on_any_mesh(n_dim):
    """A small load bends a beam of slenderness 10 as Timoshenko says: F L^3 / 3 EI + F L / GA."""
    side, small = 0.1, 1e-5
    force = 3.0 * small * side**4 / 12
    expected = small * (1.0 + 3.0 * (side**4 / 12) / (0.5 * side**2))
    for elements, section_degree, within in ((1, 2, 2e-6), (8, 2, 2e-6), (64, 2, 2e-6), (64, 1, 2e-4)):
        if n_dim == 2:
            tip = tip_in_the_plane(side, force, elements, section_degree)
        else:
            tip = clamped(square(side), (0.0, 0.0, force), elements, 3, section_degree)[0][2]
        assert tip == pytest.approx(expected, rel=within)


def test_torsion_is_that_of_plane_sections():
    """A section that stays plane has G (I_y + I_z), more than Saint-Venant's GJ unless it is round.

    The clamp holds r_z and r_y follows within a height or so: a shear that counts in thick beams.
    """
    section, I_p = "{shape: rectangle, width: 0.02, height: 0.01}", (0.02 * 0.01**3 + 0.01 * 0.02**3) / 12
    moment = 1e-3 * I_p
    _, scene, x = clamped(section, (0.0, 0.0, 0.0), 2, 3, 1, moment=(moment, 0.0, 0.0))
    frame = scene.marker("b.tip").turned(x, np.eye(3))[0]
    assert np.arctan2(frame[2, 1], frame[1, 1]) == pytest.approx(moment / (0.5 * I_p), rel=2e-4)


def test_linear_sections_do_not_contract_where_they_bend():
    """Poisson's ratio 0.3 bends by lambda + 2 mu, 1.346 E, for any degree: known of the element."""
    side, small = 0.01, 1e-6
    force, factor = 3.0 * small * side**4 / 12, 0.7 / (1.3 * 0.4)
    for degree, section_degree in ((3, 2), (5, 4)):
        tip = clamped(square(side), (0.0, force, 0.0), 4, degree, section_degree, poisson=0.3)[0][1]
        assert tip * factor == pytest.approx(small, rel=4e-3)


SLENDER = (1e1, 1e2, 1e3, 1e4)


def bent(slenderness, elements, degree, section_degree):
    """Tip of a beam that bends by half its length, alike for every slenderness."""
    h = 1.0 / slenderness
    return clamped(square(h), (0.0, h**4 / 6.0, h**4 / 12.0), elements, degree, section_degree)[0]


@pytest.mark.slow
def test_sections_of_one_degree_less_than_the_line_do_not_lock():
    """Errors at equal unknowns, slenderness 10 to 1e4, vary by less than a factor of three."""
    meshes, errors = ((8, 3, 2), (4, 4, 3), (3, 5, 4)), []
    for slenderness in SLENDER:
        exact = bent(slenderness, 4, 8, 7)
        errors.append([np.linalg.norm(bent(slenderness, *mesh) - exact) for mesh in meshes])
    assert (np.max(errors, axis=0) < 3.0 * np.min(errors, axis=0)).all(), errors
    assert np.max(errors, axis=0).tolist() < [3e-5, 2e-6, 1e-7]


@pytest.mark.slow
def test_errors_fall_with_twice_the_degree_of_the_sections():
    exact = bent(1e3, 4, 8, 7)
    for degree, counts in ((3, (8, 16)), (4, (4, 8)), (5, (3, 6))):
        coarse, fine = (np.linalg.norm(bent(1e3, n, degree, degree - 1) - exact) for n in counts)
        assert np.log2(coarse / fine) == pytest.approx(2 * (degree - 1), abs=0.6)


@pytest.mark.slow
def test_the_paper_s_element_locks():
    """It is kept as it is: 12 elements lose four fifths of the displacement of a very slender beam."""
    errors = []
    for slenderness in (1e2, 1e4):
        exact = bent(slenderness, 4, 8, 7)
        errors.append(np.linalg.norm(bent(slenderness, 12, 3, 1) - exact) / np.linalg.norm(exact))
    assert errors[0] == pytest.approx(0.021, abs=0.002)
    assert errors[1] == pytest.approx(0.83, abs=0.01)
