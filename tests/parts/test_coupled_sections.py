"""Sections given by their matrix of stiffness: published and closed forms, and shifted axes."""

import numpy as np
import pytest
from cantilevers import at_rest, cantilever, displacement, inside
from damping import check_damping

from hfsim.errors import DeckError
from hfsim.maths.rotations import skew
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

PLANAR = np.array([[200.0, 5.0, 9.0], [5.0, 80.0, -3.0], [9.0, -3.0, 2.0]])
"""A laminate that bends where it is pulled, and where it is sheared."""


def matrix(C, more=""):
    rotary = [2.0, 1.0, 1.0] if len(C) == 6 else 1.0
    return f"{{mass_per_length: 1.0, rotary_inertia: {rotary}, stiffness: {np.asarray(C).tolist()}{more}}}"


def raised(C):
    """The matrix in space of a planar one."""
    found = np.diag([1.0, 1.0, 70.0, 1.5, 4.0, 1.0])
    found[np.ix_((0, 1, 5), (0, 1, 5))] = C
    return found


def shifted(numbers, y, z):
    """The matrix at a line beside that at which sections resist singly: strains there are e + kappa x d."""
    X = np.eye(6)
    X[:3, 3:] = skew(-np.array([0.0, y, z]))
    return X.T @ np.diag(numbers) @ X


def test_composite_beam_whose_twist_and_bending_are_coupled():
    """Case S17 (a): Wang et al., Wind Energy 20 (2017) 1439, the reference by shooting."""
    C = np.diag([1368.17e3, 88.56e3, 38.78e3, 0.0, 0.0, 0.0])
    C[3:, 3:] = 1e3 * np.array([[16.96, 17.61, -0.351], [17.61, 59.12, -0.37], [-0.351, -0.37, 141.47]])
    scene = cantilever(matrix(C), 10.0, (0.0, 0.0, 150.0), elements=4, degree=6)
    x = at_rest(scene, 1.0)
    moved = displacement(scene, x)
    assert moved == pytest.approx((-0.0902726627566, -0.0647488486259, 1.22973648292), abs=2e-11)
    reach = moved[0] + 10.0
    assert inside(scene, x, [0.0])[0, 4] == pytest.approx(-150.0 * reach, rel=1e-9)


@pytest.mark.parametrize("in_space", [False, True])
def test_a_moment_bends_and_stretches_alike_all_along(in_space):
    """The strains are C^-1 (0, 0, M), and the line is a circle: r' = Gamma_1 d_1 + Gamma_2 d_2."""
    moment, length = 2.5, 1.3
    stretch, shear, kappa = np.linalg.solve(PLANAR, [0.0, 0.0, moment])
    s, c = np.sin(kappa * length) / kappa, (1.0 - np.cos(kappa * length)) / kappa
    tip = np.array([(1.0 + stretch) * s - shear * c - length, (1.0 + stretch) * c + shear * s])
    if in_space:
        scene = cantilever(matrix(raised(PLANAR)), length, (0.0,) * 3, (0.0, 0.0, moment), degree=6)
        assert displacement(scene, at_rest(scene, 1.0)) == pytest.approx([*tip, 0.0], abs=1e-9)
    else:
        scene = cantilever(matrix(PLANAR), length, (0.0, 0.0), moment, degree=6)
        assert displacement(scene, at_rest(scene, 1.0)) == pytest.approx(tip, abs=1e-9)


@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact", "rigid"])
def test_plane_and_space_are_alike(model):
    more = f"model: {model}"
    flat = cantilever(matrix(PLANAR), 1.3, (1.0, 0.4), more=more)
    deep = cantilever(matrix(raised(PLANAR)), 1.3, (1.0, 0.4, 0.0), more=more)
    a, b = (displacement(one, at_rest(one, 1.0)) for one in (flat, deep))
    assert b == pytest.approx([*a, 0.0], abs=1e-11)
    assert (np.abs(a).max() > 0.1) == (model != "rigid")


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
def test_models_agree_with_exact_for_small_loads(model):
    force = (1e-4, -2e-4, 3e-4)
    C = shifted([200.0, 90.0, 70.0, 1.5, 2.0, 4.0], 0.05, -0.08)
    both = (cantilever(matrix(C), 1.0, force, degree=5, more=f"model: {one}") for one in (model, "exact"))
    a, b = (displacement(one, at_rest(one, 1.0)) for one in both)
    assert a == pytest.approx(b, rel=2e-3, abs=2e-4 * np.abs(b).max())


TAPERED = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
sections: {{root: {root}, end: {end}}}
bodies:
  b:
    {{type: beam, length: 1.2, elements: 4, degree: 6, points: {{centre: [1.2, {y}, {z}]}},
     stations: [{{at: 0.0, section: root}}, {{at: 1.0, section: end}}]}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads: {{push: {{type: force, at: b.centre, force: [3.0, -5.0, 4.0]}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_a_line_beside_the_elastic_centre_changes_nothing(share):
    """What is coupled at one line is not at another; in a tapered beam each point has sums of its own."""
    y, z, numbers = 0.05, -0.08, np.array([400.0, 90.0, 70.0, 1.5, 2.0, 4.0])
    found = []
    for place in ((0.0, 0.0), (y, z)):
        ends = numbers, np.r_[numbers[:3], share * numbers[3:]]
        first, last = (matrix(shifted(one, *place)) for one in ends)
        text = TAPERED.format(root=first, end=last, y=place[0], z=place[1])
        scene = build(parse_deck(text))
        found.append(displacement(scene, at_rest(scene, 1.0), "b.centre"))
    assert found[1] == pytest.approx(found[0], abs=1e-10)
    assert (np.abs(found[0]).max() > 0.5) == (share < 1.0)


@pytest.mark.parametrize(
    ("wrong", "told"), [("[[9, 8], [8, 9]]", "3 or 6 rows"), ("[[9, 0, 9], [0, 9, 0], [9, 0, 9]]", "row 3")]
)
def test_matrices_without_an_elastic_energy_are_refused(wrong, told):
    section = f"{{mass_per_length: 1.0, rotary_inertia: 1.0, stiffness: {wrong}}}"
    with pytest.raises(DeckError, match=told):
        cantilever(section, 1.0, (0.0, 1.0))


def test_damping_against_differences(rng):
    times = ", axial_damping: 0.2, bending_damping: 0.3"
    C = shifted([20.0, 9.0, 7.0, 1.5, 2.0, 4.0], 0.05, -0.08)
    check_damping(cantilever(matrix(C, times), 1.0, (0.0, 0.0, 1.0), elements=2, degree=2), rng, slice(4, 5))


def test_damping_is_that_of_the_stiffness_where_times_are_equal(rng):
    C = shifted([20.0, 9.0, 7.0, 1.5, 2.0, 4.0], 0.05, -0.08)
    times = ", axial_damping: 0.2, bending_damping: 0.2"
    scene = cantilever(matrix(C, times), 1.0, (0.0, 0.0, 1.0), degree=2)
    mesh = scene.bodies["b"].mesh
    T, (stiffness, damping) = mesh.strains.mixing, mesh.resisting
    for numbers, wanted in ((stiffness, C), (damping, 0.2 * C)):
        found = np.einsum("ijp,ip,ikp->pjk", T, numbers, T)
        assert found == pytest.approx(np.broadcast_to(wanted, found.shape), abs=1e-12)
