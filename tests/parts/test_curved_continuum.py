"""Fully parameterised elements in space that are curved, twisted or turned undeformed: laws and statics."""

import json

import numpy as np
import pytest
from analytical import gauss, homogeneous_energy
from beam_laws import DENSITY, LAMBDA, MU, OWN, box
from cantilevers import at_rest, cantilever, displacement, inside
from element_laws import Energy, check_joined, check_moved, check_slopes, check_undeformed

from hfsim.maths.rotations import rotation
from hfsim.maths.shapes import gauss_lobatto
from hfsim.parts.bodies.beam_axis import Arc, Axis, Curve, Line
from hfsim.parts.bodies.spatial_axis_mesh import AxisMesh
from hfsim.parts.elements import ELASTIC_FORMS, Continuum, Measures, join_laws
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

SPLINE = Curve(np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.1], [0.8, 0.4, 0.1], [1.0, 0.7, 0.4]]))
AXES = {
    "arc": Axis(Arc(0.9), 1.4),
    "twisted": Axis(Line(), 1.4, section_angle=0.3, twist=0.9),
    "curve": Axis(SPLINE, SPLINE.length, section_angle=0.3, twist=-0.5),
}
DEGREES = [(3, 1), (3, 2), (5, 4)]
UNITS = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@pytest.fixture(params=[(a, *d) for a in AXES for d in DEGREES], ids=lambda c: "-".join(map(str, c)))
def mesh(request):
    axis, p, q = request.param
    return AxisMesh(Continuum.of(AXES[axis].length / 2, p, q, 3), 2, OWN, AXES[axis])


def bent(mesh, rng, size=0.1):
    """Nodal vectors of the deformed beam, each component by itself."""
    steps = np.where(mesh.positions, mesh.element.length, 1.0)[:, None]
    return mesh.undeformed + size * rng.normal(size=mesh.undeformed.shape) * steps


def energy_of(mesh, form="gram"):
    law, local = mesh.elastic_law(form, Measures(n_dim=3))
    stride, D = mesh.element.stride, np.zeros((mesh.count, len(local), mesh.n_vectors))
    for e in range(mesh.count):
        D[e, :, e * stride : e * stride + local.shape[1]] = local
    return Energy(law, D, 3)


def rule(mesh):
    """Yield (element, xi, y, z, volume) of Gauss points of the whole beam."""
    element = mesh.element
    degree = element.degree
    line = gauss(2 * degree - 1, 0, 1) if element.section_degree == 1 else gauss_lobatto(degree)
    for e in range(mesh.count):
        for *place, weight in box(line, 3):
            yield e, *place, weight * element.length


def gradients(mesh, vectors, e, xi, y=0.0, z=0.0):
    """(r_x, r_y, r_z) as columns at a place of an element."""
    element = mesh.element
    own = vectors[e * element.stride :][: element.stride + 4]
    return np.stack([element.shape(xi, y, by, z) @ own for by in UNITS], axis=-1)


# ---------------------------------------------------------------- undeformed


def test_nodes_are_on_the_axis_and_its_gradients_are_met_between(mesh):
    element, line, vectors = mesh.element, mesh.line, mesh.undeformed
    for e, xi in ((0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)):
        x = (e + xi) * element.length
        (point,), (axes,) = line.sections(np.array([x]))
        assert mesh.shape(x, 0.0, (0, 0, 0)) @ vectors == pytest.approx(point, abs=1e-12)
        assert gradients(mesh, vectors, e, xi) == pytest.approx(axes, abs=1e-12)
    for xi in gauss_lobatto(element.section_degree + 1)[0][1:-1]:
        axes = line.sections(np.array([(1 + xi) * element.length]))[1][0]
        found = gradients(mesh, vectors, 1, xi)
        assert found[:, 1:] == pytest.approx(axes[:, 1:], abs=1e-12)
        assert found[:, 0] == pytest.approx(axes[:, 0], abs=0.03 if element.degree == 3 else 1e-3)


def test_a_straight_level_axis_is_the_straight_beam():
    element = Continuum.of(0.7, 5, 4, 3)
    mesh = AxisMesh(element, 2, OWN, Axis(Line(), 1.4, twist=1e-300))
    flat = AxisMesh(element, 2, OWN, Axis(Line(), 1.4))
    assert mesh.undeformed == pytest.approx(flat.undeformed, abs=1e-15)
    assert mesh.mass == pytest.approx(flat.mass, abs=1e-15)
    p = bent(flat, np.random.default_rng(1)).reshape(1, -1)
    assert energy_of(mesh).energy(p) == pytest.approx(energy_of(flat).energy(p), rel=1e-13)
    assert energy_of(mesh).gradient(p) == pytest.approx(energy_of(flat).gradient(p), abs=1e-11)


def test_only_rigid_motions_of_the_undeformed_beam_store_nothing(mesh, rng):
    turns = [rotation(rng.normal(size=3)) for _ in range(3)]
    check_undeformed(energy_of(mesh), mesh.undeformed, mesh.positions, turns, rng)


def test_the_mass_is_that_of_the_section_spread_as_the_undeformed_volume_is(mesh):
    M, length = 0.0, mesh.element.length
    for e in range(mesh.count):
        for xi, y, z, weight in box(gauss(16, 0, 1), 4):
            N = mesh.shape((e + xi) * length, y, (0, 0, 0), z)
            F, middle = (gradients(mesh, mesh.undeformed, e, xi, *at) for at in ((y, z), (0.0, 0.0)))
            share = 1.0 + np.linalg.det(F) - np.linalg.det(middle)  # linear in y and z
            M = M + DENSITY * weight * length * share * np.outer(N, N)
    assert np.abs(mesh.mass - M).max() < 1e-13 * np.abs(M).max()
    assert mesh.vector_masses == pytest.approx(M @ mesh.positions, abs=1e-13)


def test_a_beam_weighs_what_its_sections_do_on_any_mesh(mesh):
    whole = OWN.mass_per_length * mesh.line.length
    assert mesh.positions @ mesh.mass @ mesh.positions == pytest.approx(whole, rel=1e-14)
    part = mesh.positions[: mesh.element.stride + 4]
    half = sum(part @ M @ part for M in mesh.masses_from(0.5))
    assert half == pytest.approx(0.5 * whole, rel=1e-14)


def test_the_centre_of_mass_of_few_elements_is_that_of_the_arc():
    """Outside that of its line, where more material is; errors fall with the square of the length."""
    angle, moment = 1.2, OWN.height**2 / 12.0
    line, chord = Axis(Arc(1.0), angle), np.array([np.sin(angle), 1.0 - np.cos(angle)])
    of_line, inward = np.array([chord[1], angle - chord[0]]) / angle, np.array([-chord[1], chord[0]]) / angle
    for count in (2, 4, 8):
        mesh = AxisMesh(Continuum.of(angle / count, 3, 1, 3), count, OWN, line)
        centre = mesh.mass @ mesh.positions @ mesh.undeformed / (OWN.mass_per_length * angle)
        assert centre == pytest.approx([*(of_line - moment * inward), 0.0], abs=3.2e-3 / count**2)


# ---------------------------------------------------------------- energy


def test_the_law_is_the_integral_of_strains_in_the_material(mesh, rng):
    """Lambda/2 tr(e)^2 + mu e:e of F F0^-1 over det F0 dx dy dz."""
    P, total = bent(mesh, rng), 0.0
    for *place, volume in rule(mesh):
        F0, F = (gradients(mesh, vectors, *place) for vectors in (mesh.undeformed, P))
        total += homogeneous_energy(F @ np.linalg.inv(F0), LAMBDA, MU, volume * np.linalg.det(F0))
    assert energy_of(mesh).energy(P.reshape(1, -1))[0] == pytest.approx(total, rel=1e-12)


def test_force_and_hessian_are_slopes_of_the_energy(mesh, rng):
    check_slopes(energy_of(mesh), bent(mesh, rng).ravel())


def test_turns_and_shifts_change_no_energy(mesh, rng):
    R, shift = rotation(np.array([0.7, -1.1, 0.4])), np.array([3.0, -1.0, 2.0])
    check_moved(energy_of(mesh), bent(mesh, rng), mesh.positions, R, shift)


def test_all_forms_of_the_force_are_one(rng):
    mesh = AxisMesh(Continuum.of(0.7, 3, 1, 3), 2, OWN, AXES["curve"])
    p, expected = np.array([bent(mesh, rng).ravel() for _ in range(2)]), energy_of(mesh)
    for form in ELASTIC_FORMS:
        found = energy_of(mesh, form)
        for method in ("energy", "gradient", "hessian"):
            a, b = getattr(found, method)(p), getattr(expected, method)(p)
            assert np.abs(a - b).max() < 1e-12 * np.abs(b).max(), (form, method)


def test_laws_of_several_beams_act_one_by_one(rng):
    meshes = [AxisMesh(Continuum.of(0.7, 4, 3, 3), 2, OWN, AXES[name]) for name in ("arc", "twisted")]
    laws = [mesh.law(Measures(n_dim=3)) for mesh in meshes]
    assert laws[0].shared == laws[1].shared
    element = meshes[0].element
    check_joined(join_laws, laws, element.differences() @ rng.normal(size=(4, element.stride + 4, 3)))


# ---------------------------------------------------------------- at rest


def loaded(section, axis, force, elements=2, degree=6, steps=1, moment=(0.0, 0.0, 0.0)):
    """A clamped beam of E = 1 with loads at its tip, and its state."""
    long = None if "axis" in axis else 1.0
    own = f"element: continuum, section_degree: {degree - 1}, {axis}"
    scene = cantilever(section, long, force, moment, elements, degree, "youngs_modulus: 1.0", own)
    return scene, at_rest(scene, 1.0)


def test_a_quarter_ring_bends_as_castigliano_says():
    """Times F R^3: in its plane pi/4, 3 pi/4 - 2, -1/2 over EI; out of it pi/4 / EI + (3 pi/4 - 2) / GJ."""
    h, small = 0.004, 1e-5
    ring, second = "axis: {arc: {radius: 1.0, angle: 90 deg}}", h**4 / 12
    section = f"{{shape: rectangle, width: {h}, height: {h}}}"
    F = small * second
    in_plane = np.array([[np.pi / 4, -0.5, 0.0], [-0.5, 0.75 * np.pi - 2.0, 0.0]])
    for force, expected in zip(np.eye(3), [*in_plane, [0.0, 0.0, np.pi - 2.0]], strict=True):
        scene, x = loaded(section, ring, tuple((F * force).tolist()))
        assert displacement(scene, x) == pytest.approx(small * np.array(expected), abs=1e-4 * small)


def test_a_turned_section_bends_about_its_own_axes():
    """F L^3 / 3E (cos^2 / I_z + sin^2 / I_y), and sin cos (1 / I_z - 1 / I_y) across."""
    height, width, angle, small = 0.02, 0.01, 0.4, 1e-6
    section = f"{{shape: rectangle, width: {width}, height: {height}}}"
    along_y, along_z = 4.0 / (width * height**3), 4.0 / (height * width**3)
    F, c, s = small / along_z, np.cos(angle), np.sin(angle)
    for form in ("section_angle: 0.4", "axis: {points: [[0, 0, 0], [1, 0, 0]]}, section_angle: 0.4"):
        scene, x = loaded(section, form, (0.0, F, 0.0))
        expected = F * np.array([0.0, c * c * along_y + s * s * along_z, s * c * (along_y - along_z)])
        assert displacement(scene, x)[1:] == pytest.approx(expected[1:], abs=4e-4 * small)


STIFF = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
sections:
  bar: {{mass_per_length: 1.0, rotary_inertia: [2.0, 1.0, 1.0], axial_stiffness: {EA},
         shear_stiffness: [{GA}, {GA}], torsion_stiffness: {GJ}, bending_stiffness: [{EI_y}, {EI_z}]}}
bodies: {{b: {{type: beam, section: bar, element: cosserat, elements: 4, degree: 4, {axis}}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads:
  push: {{type: force, at: b.tip, force: {force}, law: {{type: constant_rate, rate: 1.0}}}}
solve: {{duration: 1.0}}
"""


def as_cosserat(height, width, axis, force, steps):
    """Displacement of the tip of a cosserat beam with the stiffness of plane sections, E = 1, nu = 0."""
    area, I_y, I_z = height * width, height * width**3 / 12, width * height**3 / 12
    numbers = {"EA": area, "GA": area / 2, "GJ": (I_y + I_z) / 2, "EI_y": I_y, "EI_z": I_z}
    scene = build(parse_deck(STIFF.format(**numbers, axis=axis, force=json.dumps(force))))
    return displacement(scene, at_rest(scene, 1.0))


@pytest.mark.parametrize(
    ("axis", "height", "width", "force", "within"),
    [
        ("axis: {arc: {radius: 1.0, angle: -45 deg}}", 0.0025, 0.0025, (0.0, 0.0, 7.2), 1e-4),
        ("length: 1.0, twist: 1.2, section_angle: 0.3", 0.004, 0.002, (0.0, 0.3, 0.8), 1e-4),
        (
            "axis: {points: [[0, 0, 0], [0.4, 0.1, 0.1], [0.8, 0.4, 0.1], [1.0, 0.7, 0.4]]}, twist: -0.5",
            *(0.004, 0.002, (0.2, 0.3, 0.8), 1e-4),
        ),
    ],
    ids=["bend of 45 degrees", "twisted", "curve"],
)
def test_thin_beams_bend_by_any_amount_as_cosserat(axis, height, width, force, within):
    """Without Poisson's ratio and locking; forces are in E I_y over the square of the length of one."""
    force = tuple(f * height * width**3 / 12 for f in force)
    section = f"{{shape: rectangle, width: {width}, height: {height}}}"
    expected = as_cosserat(height, width, axis, force, 8)
    scene = cantilever(
        section, 0, force, (0.0, 0.0, 0.0), 4, 6, "youngs_modulus: 1.0",
        f"element: continuum, section_degree: 5, {axis}",
    )  # fmt: skip
    found = displacement(scene, at_rest(scene, 1.0))
    assert np.linalg.norm(expected) > 0.15
    assert found == pytest.approx(expected, abs=within * np.linalg.norm(expected))


def test_the_bend_of_45_degrees_as_published():
    """Square section of side one, radius 100, 600 N: sections that stay plane, J = 1/6, GA = 5e6."""
    section = "{shape: rectangle, width: 0.01, height: 0.01}"
    axis = "axis: {arc: {radius: 1.0, angle: -45 deg}}"
    scene, x = loaded(section, axis, (0.0, 0.0, 600e-7 / 1e4), 4, 5, 8)
    tip = 100.0 * scene.marker("b.tip").position(x)[0]
    assert [-tip[1], tip[0], tip[2]] == pytest.approx([15.6848005, 47.1504386, 53.4748588], abs=0.02)


def test_errors_of_an_arc_fall_with_twice_the_degree_of_the_sections():
    """In the plane of the arc, bent by half its length, at any slenderness."""
    for h in (0.1, 1e-3):
        section = f"{{shape: rectangle, width: {h}, height: {h}}}"
        force, axis = (0.0, 2.0 * h**4 / 12, 0.0), "axis: {arc: {radius: 1.0, angle: 1.0}}"

        def tip(count, degree, section=section, force=force, axis=axis):
            scene, x = loaded(section, axis, force, count, degree, 4)
            return displacement(scene, x)

        exact = tip(3, 7)
        assert np.linalg.norm(exact) > 0.3
        for degree, counts in ((3, (2, 4)), (4, (1, 2))):
            coarse, fine = (np.linalg.norm(tip(n, degree) - exact) for n in counts)
            assert np.log2(coarse / fine) == pytest.approx(2 * (degree - 1), abs=0.8)


@pytest.mark.parametrize(("model", "size", "within"), [("exact", 1.0, 1e-9), ("linear", 0.2, 1e-6)])
def test_internal_forces_are_those_of_the_load(model, size, within):
    """At rest under a force and a moment at the tip, in axes of the section; of linear, undeformed ones."""
    axis = f"axis: {{arc: {{radius: 1.0, angle: 60 deg}}}}, section_angle: 0.4, model: {model}"
    force, moment = size * np.array([[3e-9, -2e-9, 4e-9], [1e-9, 2e-9, -3e-9]])
    section = "{shape: rectangle, width: 0.03, height: 0.02}"
    scene, x = loaded(section, axis, tuple(force.tolist()), 4, 5, 1, tuple(moment.tolist()))
    beam, places = scene.bodies["b"], np.array([0.0, 0.3, 0.8, 1.0])
    found = inside(scene, x, places)
    start = scene.system.absolute(scene.q[None])
    if model == "linear":
        assert beam.section_axes(x, places) == pytest.approx(beam.section_axes(start, places), abs=1e-4)
    assert np.linalg.norm(displacement(scene, x)) > 0.05 * size
    tip = scene.marker("b.tip").position(x)[0]
    for place, row in zip(map(float, places), found, strict=True):
        own, y = beam.section_axes(x, np.array([place]))[0, 0], beam.marker((place, 0.0, 0.0))
        there = moment + np.cross(tip - y.position(x)[0], force)
        expected = np.r_[force @ own, there @ own]
        assert row == pytest.approx(expected, abs=within * np.abs(expected).max())
