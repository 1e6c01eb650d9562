"""Fully parameterised beams with stations: their laws, masses, and curved ones; steps; points in sections."""

import numpy as np
import pytest
import yaml
from analytical import jacobian
from cantilevers import at_rest, displacement
from element_laws import gradient_of
from tapered import MATERIALS, STEP, TAPER, L, deck, scene_of, sizes

from hfsim.deck.materials import BeamProperties, MaterialSpec
from hfsim.deck.section_shapes import CircleSection, RectangleSection
from hfsim.deck.stations import Station, Varied
from hfsim.errors import DeckError
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.bodies.beam_axis import Arc, Axis, Line
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.spatial_axis_mesh import AxisMesh
from hfsim.parts.elements import Continuum, Measures
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

STUFF = MaterialSpec(density=3.0, youngs_modulus=700.0, poisson_ratio=0.3)
OTHER = MaterialSpec(density=2.0, youngs_modulus=500.0, poisson_ratio=0.1)
THICK = RectangleSection(shape="rectangle", width=0.2, height=0.3)
THIN = RectangleSection(shape="rectangle", width=0.1, height=0.15)
ROD = CircleSection(shape="circle", radius=0.1)
EVEN = Varied(BeamProperties.of, (Station(0.0, STUFF, THICK), Station(1.0, STUFF, THICK)))
TAPERED = Varied(
    BeamProperties.of,
    (
        *(Station(0.0, STUFF, THICK), Station(0.5, STUFF, THIN)),
        *(Station(0.5, OTHER, THICK), Station(1.0, STUFF, ROD)),
    ),
)
AXES = {"plane": None, "space": None, "arc": Axis(Arc(0.9), 1.4), "twisted": Axis(Line(), 1.4, 0.3, 0.9)}
DEGREES = [(3, 1), (3, 2), (5, 4)]


def mesh_of(axis, degrees, properties):
    element = Continuum.of(0.7, *degrees, 2 if axis == "plane" else 3)
    if AXES[axis] is None:
        return BeamMesh(element, 2, properties)
    return AxisMesh(element, 2, properties, AXES[axis])


def energies(mesh):
    """Energy, force and tangent of a mesh over all nodal components (n_batch, n)."""
    n_dim, spans = mesh.undeformed.shape[1], mesh.spans
    law, D = mesh.law(Measures(n_dim=n_dim)), mesh.element.differences()

    def vectors(p):
        return D @ p.reshape(len(p), -1, n_dim)[:, spans]

    def gradient(p):
        out = np.zeros((len(p), mesh.n_vectors, n_dim))
        for e, own in enumerate(np.moveaxis(D.T @ gradient_of(law, vectors(p)), 1, 0)):
            out[:, spans[e]] += own
        return out.reshape(len(p), -1)

    def hessian(p):
        out, local = np.zeros((p.shape[1], p.shape[1])), np.kron(D, np.eye(n_dim))
        for e, block in enumerate(law.hessian(vectors(p))[0]):
            columns = (n_dim * spans[e][:, None] + np.arange(n_dim)).ravel()
            out[np.ix_(columns, columns)] += local.T @ block @ local
        return out

    return (lambda p: law.energy(vectors(p)).sum(axis=-1)), gradient, hessian


def bent(mesh):
    steps = np.where(mesh.positions, mesh.element.length, 1.0)[:, None]
    noise = np.random.default_rng(5).normal(size=mesh.undeformed.shape)
    return (mesh.undeformed + 0.1 * noise * steps).ravel()


@pytest.mark.parametrize("degrees", DEGREES)
@pytest.mark.parametrize("axis", AXES)
def test_stations_that_are_all_alike_change_nothing(axis, degrees):
    meshes = [mesh_of(axis, degrees, own) for own in (BeamProperties.of(STUFF, THICK), EVEN)]
    p = bent(meshes[0])[None]
    for both in zip(*map(energies, meshes), strict=True):
        expected, found = (method(p) for method in both)
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    for start in (0.0, 0.3):
        expected, found = (mesh.masses_from(start) for mesh in meshes)
        assert np.abs(found - expected).max() < 1e-14 * np.abs(expected).max()


@pytest.mark.parametrize("degrees", DEGREES)
@pytest.mark.parametrize("axis", AXES)
def test_force_and_tangent_of_a_tapered_beam_are_slopes_of_its_energy(axis, degrees):
    mesh = mesh_of(axis, degrees, TAPERED)
    (energy, force, tangent), p = energies(mesh), bent(mesh)
    slope, H = jacobian(energy, p), tangent(p[None])
    assert np.abs(force(p[None])[0] - slope).max() < 1e-8 * np.abs(slope).max()
    assert np.abs(H - jacobian(force, p)).max() < 1e-8 * np.abs(H).max()
    assert np.abs(H - H.T).max() < 1e-13 * np.abs(H).max()
    assert abs(energy(mesh.undeformed.reshape(1, -1))[0]) < 1e-24 * energy(p[None])[0]


@pytest.mark.parametrize("axis", AXES)
def test_energy_and_mass_are_those_of_the_sections(axis):
    """A stretch of x, y, z by 1.1, 1.2, 0.9: energy density times volume; mass and moments of sections.

    Volume and mass of a curved beam, whose line goes through the centroids, are those of the straight one.
    """
    mesh = mesh_of(axis, (5, 4), TAPERED)
    n_dim, (energy, _, _) = mesh.undeformed.shape[1], energies(mesh)
    stretches = np.array([1.1, 1.2, 0.9][:n_dim])
    s, w = gauss_legendre(40)
    shares = np.concatenate([0.5 * s, 0.5 + 0.5 * s])
    own, w = TAPERED.at(shares), 1.4 * np.tile(0.5 * w, 2)
    e = 0.5 * (stretches**2 - 1.0)
    area = own.height * own.width
    density = 0.5 * own.lame_lambda * e.sum() ** 2 + own.lame_mu * (e @ e)
    within = 3e-6 if AXES[axis] is None else 1e-5
    found = energy((mesh.undeformed * stretches).reshape(1, -1))[0]
    assert found == pytest.approx(np.sum(w * area * density), rel=within)
    assert mesh.positions @ mesh.mass @ mesh.positions == pytest.approx(
        np.sum(w * own.mass_per_length), rel=within
    )
    if n_dim == 2:
        sections = mesh.undeformed[:, 1]
        about = np.sum(w * own.mass_per_length * own.height**2 / 12)
        assert sections @ mesh.mass @ sections == pytest.approx(about, rel=1e-8)


def test_between_two_materials_stiffness_is_linear():
    """So it is of other elements: EA, EI of both axes and the mass, of the rectangle that has them."""
    ends, own = [TAPERED.at(np.array([at])) for at in (0.5, 1.0)], TAPERED.at(np.array([0.6]))

    def stiffness(one):
        mu, nu = one.lame_mu, 0.5 * one.lame_lambda / (one.lame_lambda + one.lame_mu)
        EA = 2.0 * mu * (1.0 + nu) * one.height * one.width
        return np.stack([EA, EA * one.height**2, EA * one.breadth**2, one.mass_per_length])

    first, second = map(stiffness, ends)
    assert stiffness(own) == pytest.approx(0.8 * first + 0.2 * second, rel=1e-13)
    assert np.abs(first / second - 1.0).min() > 0.1


@pytest.mark.parametrize(("n_dim", "force"), [(2, [-0.02, 0.04]), (3, [-0.02, 0.04, 0.01])])
def test_large_deflections_are_those_of_cosserat(n_dim, force):
    """With a step, bent by an eighth of its length: what is left is shear, whose factor differs."""
    tips = []
    for element in ("cosserat", "continuum"):
        more = {"element": element, "section_degree": 4 if element == "continuum" else 1, "degree": 5}
        scene = scene_of(STEP, n_dim, "ancf", force, poisson_ratio=0.0, elements=4, **more)
        tips.append(displacement(scene, at_rest(scene, 1.0)))
    assert np.abs(tips[1] - tips[0]).max() < 3e-5 * np.linalg.norm(tips[0])
    assert np.linalg.norm(tips[0]) > 0.13 * L


TWO_BEAMS = {
    "a": {"type": "beam", "material": "steel", "section": "rod", "length": 0.5 * L},
    "b": {"type": "beam", "material": "alloy", "section": "pin", "length": 0.5 * L},
}


def test_a_stepped_beam_tends_to_two_beams_clamped_together():
    """Its slope cannot jump as shear and stretch do at a step: errors are halved with the elements."""
    missed = []
    for elements in (4, 8):
        more = {"element": "continuum", "degree": 4, "section_degree": 3}
        whole = deck(STEP, 2, "ancf", [-0.02, 0.04], elements=elements, **more)
        cut = deck(STEP, 2, "ancf", [-0.02, 0.04])
        cut["bodies"] = {
            name: {**beam, **more, "elements": elements // 2} for name, beam in TWO_BEAMS.items()
        }
        weld = {"type": "fixed", "between": ["a.tip", "b.root"]}
        cut["joints"] = {"clamp": {"type": "fixed", "between": ["ground", "a.root"]}, "weld": weld}
        scenes = [build(parse_deck(yaml.safe_dump(data))) for data in (whole, cut)]
        tips = [displacement(scene, at_rest(scene, 1.0)) for scene in scenes]
        missed.append(np.abs(tips[0] - tips[1]).max() / np.linalg.norm(tips[1]))
    assert missed[0] < 1e-5
    assert missed[0] / missed[1] == pytest.approx(2.0, abs=0.2)


def test_a_step_under_tension_costs_accuracy_as_of_a_cable():
    E = [MATERIALS[name]["youngs_modulus"] for name in ("steel", "alloy")]
    pulled = 0.5 * L * (1.0 / (E[0] * np.pi * 1e-4) + 1.0 / (E[1] * np.pi * 0.25e-4))
    errors = []
    for elements in (2, 4):
        more = {"element": "continuum", "degree": 4, "section_degree": 3, "elements": elements}
        scene = scene_of(STEP, 2, "ancf", [1e-3, 0.0], poisson_ratio=0.0, **more)
        errors.append(displacement(scene, at_rest(scene, 1.0))[0] / (1e-3 * pulled) - 1.0)
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.01)
    assert -0.07 < errors[0] < -0.05


@pytest.mark.parametrize("place", [0.3, 1.2])
def test_points_are_inside_the_section_at_their_place(place):
    height = sizes(TAPER, place / L)
    for y, inside in ((0.4999 * height, True), (0.5001 * height, False)):
        data = deck(TAPER, element="continuum", points={"edge": [place, float(y)]})
        if inside:
            assert parse_deck(yaml.safe_dump(data)).deck.bodies["b"].points
            continue
        with pytest.raises(DeckError, match=f"is outside the section, {height:.3g} m high"):
            parse_deck(yaml.safe_dump(data))


@pytest.mark.parametrize("sections", [("thick", "thin"), ("thin", "thick")])
def test_points_at_a_step_are_inside_the_larger_section(sections):
    places = [(0.0, sections[0]), (0.5, sections[0]), (0.5, sections[1]), (1.0, sections[1])]
    stations = [{"at": at, "section": name} for at, name in places]
    for height, inside in ((0.0199, True), (0.0201, False)):
        data = deck(stations, element="continuum", points={"edge": [0.5 * L, 0.5 * height]})
        if inside:
            assert parse_deck(yaml.safe_dump(data)).deck.bodies["b"].points
            continue
        with pytest.raises(DeckError, match=r"is outside the section, 0\.02 m high"):
            parse_deck(yaml.safe_dump(data))


def test_sections_of_a_curved_beam_cut_one_another_where_they_are_thick():
    """Of an axis that bends near its tip, where the beam is thin or thick."""
    points = [*([x, 0.0, 0.0] for x in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)), [1.2, 0.05, 0.0], [1.4, 0.2, 0.0]]
    thick, thin = ({"shape": "rectangle", "width": 0.01, "height": height} for height in (1.2, 0.12))

    def loaded(first, second):
        stations = [{"at": 0.0, "section": first}, {"at": 1.0, "section": second}]
        data = deck(stations, 3, element="continuum", elements=6, axis={"points": points})
        del data["bodies"]["b"]["length"]
        data["sections"] = {"thick": thick, "thin": thin}
        return parse_deck(yaml.safe_dump(data))

    assert loaded("thick", "thin").deck.bodies["b"].stations
    with pytest.raises(DeckError, match="sections cut one another"):
        loaded("thin", "thick")
