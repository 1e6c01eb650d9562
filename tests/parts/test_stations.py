"""Beams with stations: closed forms of tapered ones, steps, models against one another, stress."""

import numpy as np
import posed
import pytest
import scipy.linalg
import yaml
from cantilevers import at_rest, displacement, inside
from solved import solved as solution
from tapered import CONE, MATERIALS, STEP, TAPER, WAIST, L, deck, gauss, scene_of, sizes

from hfsim.deck.materials import SectionProperties
from hfsim.errors import DeckError
from hfsim.maths.rotations import rotation
from hfsim.mechanics.pose import Twist
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

E, G, RHO = 2.1e8, 2.1e8 / 2.5, 7800.0
CONTINUUM = {"degree": 6, "section_degree": 5, "poisson_ratio": 0.0}
"""Sections stay plane: where they widen across the beam, they bend as theory says without Poisson's ratio."""
KINDS = [
    ("cable", 2, "linear", {"degree": 5}),
    ("cable", 2, "exact", {"degree": 5}),
    ("cable", 2, "ancf", {"degree": 6, "strain": "engineering", "curvature": "exact"}),
    ("cable", 2, "ancf", {"degree": 6}),
    ("cosserat", 2, "linear", {"degree": 5}),
    ("cosserat", 2, "lowOrder", {"degree": 5}),
    ("cosserat", 2, "exact", {"degree": 5}),
    ("cosserat", 3, "exact", {"degree": 5}),
    ("cosserat", 3, "linear", {"degree": 5}),
    ("cosserat", 3, "lowOrder", {"degree": 5}),
    *(("continuum", n_dim, model, CONTINUUM) for n_dim in (2, 3) for model in ("linear", "exact")),
]


@pytest.mark.parametrize(("element", "n_dim", "model", "more"), KINDS)
def test_a_tapered_cantilever_bends_and_stretches_by_its_flexibility(element, n_dim, model, more):
    """v = int P (L - x)^2 / EI + P / kGA dx, and u = int P / EA dx, of any taper: here two."""
    stations = [TAPER[0], {"at": 0.4, "section": "thin"}, {"at": 1.0, "section": "point"}]
    s, w = gauss(stations)
    h, b = sizes(stations, s), np.interp(s, [0.0, 0.4, 1.0], [0.1, 0.1, 0.02])
    bent = np.sum(w * L**3 * (1.0 - s) ** 2 / (E * b * h**3 / 12))
    if element != "cable":
        bent += np.sum(w * L / ((5 / 6 * G if element == "cosserat" else E / 2) * b * h))
    pulled = np.sum(w * L / (E * b * h))
    force = np.zeros(n_dim)
    force[1] = 1e-3
    scene = scene_of(stations, n_dim, model, force.tolist(), element=element, elements=5, **more)
    assert displacement(scene, at_rest(scene, 1.0))[1] == pytest.approx(1e-3 * bent, rel=1e-6)
    if (element, model) == ("cable", "linear"):
        return  # its iteration along the axis does not settle, on uniform beams likewise
    force = np.roll(force, -1)
    scene = scene_of(stations, n_dim, model, force.tolist(), element=element, elements=5, **more)
    assert displacement(scene, at_rest(scene, 1.0))[0] == pytest.approx(1e-3 * pulled, rel=1e-6)


@pytest.mark.parametrize("stations", ["circles", "numbers", "shapes", "materials"])
def test_what_lies_between_stations(stations):
    """Dimensions of one shape and material are linear in between, else the properties are."""
    pairs = {
        "circles": ("rod", "pin", None),
        "numbers": ("numbers", "fewer", None),
        "shapes": ("rod", "pipe", None),
        "materials": ("rod", "pin", "alloy"),
    }
    first, second, material = pairs[stations]
    made = [{"at": 0.0, "section": first}, {"at": 1.0, "section": second, "material": material or "steel"}]
    own = scene_of(made, element="cosserat", elements=1).deck.section_properties("b")
    found, s = own.at(np.array([0.25])), 0.25
    if stations == "circles":
        d = 0.02 - 0.01 * s
        assert found.axial_stiffness[0] == pytest.approx(E * np.pi * d**2 / 4, rel=1e-14)
        assert found.bending_stiffness[0][0] == pytest.approx(E * np.pi * d**4 / 64, rel=1e-14)
        assert found.fibres.moduli[1][0] == pytest.approx(np.pi * d**3 / 32, rel=1e-14)
    else:
        ends = [own.at(np.array([end])) for end in (0.0, 1.0)]
        assert isinstance(found, SectionProperties)
        for name in ("mass_per_length", "axial_stiffness", "torsion_stiffness"):
            a, b = (getattr(end, name) for end in ends)
            assert getattr(found, name) == pytest.approx((1 - s) * a + s * b, rel=1e-14)
            assert abs(a - b) > 0.1 * a


@pytest.mark.parametrize(
    ("element", "n_dim"), [("cable", 2), *((one, n) for one in ("cosserat", "continuum") for n in (2, 3))]
)
def test_frequencies_of_a_tapered_cantilever(element, n_dim):
    """Height to half, width constant: 3.82379 and 18.3173 (Naguleswaran, J. Sound Vib. 172, 1994)."""
    more = {"degree": 6, "elements": 3, "element": element, **(CONTINUUM if element == "continuum" else {})}
    scene = scene_of(TAPER, n_dim, "linear", length=20.0, **more)
    linear = scene.system.linearized(0.0, scene.q, scene.v)
    free = linear.allowed
    M, K = (free @ one @ free.T for one in (linear.mass, linear.stiffness))
    omega = scipy.linalg.eigvalsh(M, K, subset_by_index=[len(K) - 4, len(K) - 1]) ** -0.5
    scale = np.sqrt(E * 0.02**2 / 12 / RHO) / 400.0
    for expected in (3.82379, 18.3173):
        assert np.abs(omega / scale / expected - 1.0).min() < 2e-5


@pytest.mark.parametrize("n_dim", [2, 3])
@pytest.mark.parametrize("element", ["cable", "cosserat", "continuum"])
@pytest.mark.parametrize("stations", [CONE, STEP, WAIST])
def test_a_rigid_tapered_beam_has_the_mass_and_inertia_of_its_sections(element, n_dim, stations):
    s, w = gauss(stations)
    d, rho = sizes(stations, s), RHO
    if stations is STEP:
        d, rho = np.where(s < 0.5, 0.02, 0.01), np.where(s < 0.5, RHO, 2700.0)
    m = rho * np.pi * d**2 / 4 * w * L
    rotary = np.sum(rho * np.pi * d**4 / 64 * w * L) if element != "cable" else 0.0
    expected = m.sum(), m @ s * L, m @ (s * L) ** 2 + rotary
    scene = scene_of(stations, n_dim, "rigid", element=element, elements=2)
    body, pose = scene.bodies["b"], scene.assembly.poses["b"]
    motions = np.zeros((2, scene.system.n_x))
    units = list(Twist.units(n_dim))
    for row, unit in zip(motions, (units[1], units[-1]), strict=True):
        row[body.columns] = body.moving(pose, unit)
    M = scene.system.equations.momentum(scene.system.absolute(scene.q[None]), motions) @ motions.T
    assert [M[0, 0], M[0, 1], M[1, 1]] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("n_dim", [2, 3])
@pytest.mark.parametrize("model", ["linear", "lowOrder", "ancf"])
@pytest.mark.parametrize("stations", [CONE, WAIST])
def test_flexible_lines_carry_the_same_mass(n_dim, model, stations):
    """Kinetic energy of a turn about the root, of what pulls at a tapered beam."""
    s, w = gauss(stations)
    about_root = np.sum(RHO * np.pi * sizes(stations, s) ** 2 / 4 * w * L * (s * L) ** 2)
    scene = scene_of(stations, n_dim, model, element="cable", elements=2)
    u = np.zeros((1, scene.system.n_x))
    body, turn = scene.bodies["b"], list(Twist.units(n_dim))[-1]
    u[0, body.columns] = body.moving(scene.assembly.poses["b"], turn)
    energy = scene.system.kinetic_energy(scene.system.absolute(scene.q[None]), u)
    assert energy == pytest.approx(0.5 * about_root, rel=1e-12)


TWO_BEAMS = {
    "a": {"type": "beam", "material": "steel", "section": "rod", "length": 0.5 * L},
    "b": {"type": "beam", "material": "alloy", "section": "pin", "length": 0.5 * L},
}


@pytest.mark.parametrize(
    ("element", "n_dim", "force"),
    [
        ("cable", 2, [0.0, 0.03]),
        ("cosserat", 2, [-0.02, 0.04]),
        ("cosserat", 3, [-0.02, 0.04, 0.01]),
    ],
)
def test_a_stepped_beam_is_two_beams_clamped_together(element, n_dim, force):
    more = {"element": element, "degree": 5}
    whole = deck(STEP, n_dim, "ancf", force, elements=4, **more)
    cut = deck(STEP, n_dim, "ancf", force)
    cut["bodies"] = {name: {**beam, **more, "elements": 2} for name, beam in TWO_BEAMS.items()}
    weld = {"type": "fixed", "between": ["a.tip", "b.root"]}
    cut["joints"] = {"clamp": {"type": "fixed", "between": ["ground", "a.root"]}, "weld": weld}
    moved = []
    for data in (whole, cut):
        scene = build(parse_deck(yaml.safe_dump(data)))
        moved.append(displacement(scene, at_rest(scene, 1.0)))
    assert np.abs(moved[0] - moved[1]).max() < 1e-6 * np.linalg.norm(moved[1])
    assert np.linalg.norm(moved[0]) > 0.1


def solved(data):
    return solution(data)[0]


MADE = [
    TAPER[0],
    {"at": 0.5, "section": "thick"},
    {"at": 0.5, "section": "thin"},
    {"at": 1.0, "section": "point"},
]
ROUND = [
    {"at": 0.0, "section": "rod"},
    {"at": 0.5, "section": "pin"},
    {"at": 0.5, "section": "pin", "material": "alloy"},
    {"at": 1.0, "section": "rod", "material": "alloy"},
]


ELEMENTS = {"cable": {"degree": 4}, "cosserat": {"degree": 2}, "continuum": {"section_degree": 2}}
"""Few unknowns, as models are held against one another on one mesh."""


def pendulum(stations, element, **solve):
    data = deck(stations, 2, element=element, elements=2, **ELEMENTS[element])
    data["gravity"] = [0.0, -9.81]
    data["joints"] = {"pin": {"type": "revolute", "between": ["ground", "b.root"]}}
    del data["loads"]
    data["solve"] = {"duration": 0.1, "tolerance": 1e-9, **solve}
    data["output"] = {"interval": 0.02, "channels": ["b.tip.x", "b.tip.y", "energy.total"]}
    return data


@pytest.mark.parametrize("element", ELEMENTS)
def test_exact_is_ancf(element):
    exact = solved(pendulum(ROUND, element, model="exact", coordinates="frame"))
    assert exact == pytest.approx(solved(pendulum(ROUND, element, model="ancf")), abs=1e-9)
    assert exact[:, 2] == pytest.approx(exact[0, 2], abs=1e-7)
    assert np.ptp(exact[:, 1]) > 0.04


@pytest.mark.parametrize(
    ("model", "element"),
    [
        *((model, one) for one in ("cable", "cosserat") for model in ("ancf", "linear", "lowOrder", "rigid")),
        *((model, "continuum") for model in ("ancf", "linear", "rigid")),
    ],
)
def test_a_tapered_pendulum_posed_in_space_does_the_same(element, model):
    """Models of the planar one, in a tilted plane."""
    data = pendulum(ROUND, element, model=model, duration=0.04)
    data["materials"] = MATERIALS  # without Poisson's ratio: planar continua are in plane strain
    data["initial"] = {"b": {"angle": 0.2}}
    planar = solved(data)
    R, shift = rotation(np.array([0.3, -0.8, 0.5])), np.array([0.4, -1.0, 2.0])
    data["joints"]["pin"]["between"][0] = "ground.origin"
    spatial = posed.in_space(data, R, shift)
    spatial["output"] = {**data["output"], "channels": ["b.tip.x", "b.tip.y", "b.tip.z", "energy.total"]}
    found = (solved(spatial)[:, :3] - shift) @ R
    assert found[:, :2] == pytest.approx(planar[:, :2], abs=1e-8)
    assert found[:, 2] == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize(("pull", "push"), [(1e-3, 0.0), (0.0, 1e-4)])
@pytest.mark.parametrize(
    ("element", "n_dim"), [("cable", 2), *((one, n) for one in ("cosserat", "continuum") for n in (2, 3))]
)
def test_forces_go_on_over_steps_and_stress_is_that_of_the_section(element, n_dim, pull, push):
    """Small load: Q = P, M = P (L - x) also at the step; stress = M / W + N / A of each section."""
    force = np.array([pull, push, 0.0][:n_dim]).tolist()
    more = CONTINUUM if element == "continuum" else {"degree": 6}
    scene = scene_of(MADE, n_dim, "ancf", force, element=element, elements=4, **more)
    body, x = scene.bodies["b"], at_rest(scene, 1.0)
    s = np.array([0.1, 0.5 - 1e-6, 0.5, 0.6, 0.95])
    places, h = s * L, np.array([0.02, 0.02, 0.01, 0.01, 0.01])
    b = np.array([0.1, 0.1, 0.1, 0.084, 0.028])
    found = inside(scene, x, places)[None]
    N, Q, M = (found[0, :, k] for k in (0, 1, 5))
    assert pytest.approx(pull, rel=1e-6, abs=2e-8) == N
    assert pytest.approx(push, rel=1e-6, abs=1e-10) == Q
    assert pytest.approx(push * (L - places), rel=1e-6, abs=1e-10) == M
    stress = body.fibres(places).stress(found[0, :, 0], found[0, :, 4], found[0, :, 5])
    assert stress == pytest.approx(np.abs(M) / (b * h**2 / 6) + np.abs(N) / (b * h), rel=1e-6)


def test_a_step_under_tension_costs_a_cable_accuracy():
    """Its slope vector cannot jump: the stretch is as a step asks for on ever shorter elements only."""
    pulled = 0.5 * L * (1.0 / (E * np.pi * 1e-4) + 1.0 / (7e7 * np.pi * 0.25e-4))
    errors = []
    for elements in (2, 4, 8):
        scene = scene_of(STEP, 2, "ancf", [1e-3, 0.0], element="cable", elements=elements)
        errors.append(displacement(scene, at_rest(scene, 1.0))[0] / (1e-3 * pulled) - 1.0)
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(1.0, abs=0.1)
    assert abs(errors[0]) < 0.1
    scene = scene_of(STEP, 2, "ancf", [1e-3, 0.0], element="cosserat", elements=2)
    assert displacement(scene, at_rest(scene, 1.0))[0] == pytest.approx(1e-3 * pulled, rel=1e-6)


def test_damping_follows_the_material_along_the_beam():
    """Energy lost by a rod that stretches evenly at a rate r: int EA tau r^2 dx."""
    for element in ("cable", "cosserat", "continuum"):
        data = deck(ROUND, 2, element=element, elements=2, degree=3 if element == "continuum" else 4)
        times = {"steel": 0.2, "alloy": 0.3}
        data["materials"] = {k: {**one, "axial_damping": times[k]} for k, one in MATERIALS.items()}
        scene = build(parse_deck(yaml.safe_dump(data)))
        x = scene.system.absolute(scene.q[None])
        body, u = scene.bodies["b"], np.zeros_like(x)
        vectors = body.undeformed.copy()
        if element == "cosserat":
            vectors[~body.positions.astype(bool)] = 0.0
        elif element == "continuum":
            vectors[2::3] = 0.0
        u[0, body.columns] = vectors.ravel()
        s, w = gauss(ROUND)
        EA = np.where(s < 0.5, E * 0.2, 7e7 * 0.3) * np.pi * sizes_of_round(s) ** 2 / 4
        lost = sum(part.power(np.zeros(1), x, u) for part in scene.system.forces)
        assert lost == pytest.approx(-np.sum(w * L * EA), rel=1e-10)


def sizes_of_round(s):
    return np.interp(s, [0.0, 0.5, 1.0], [0.02, 0.01, 0.02])


@pytest.mark.parametrize(("step", "elements"), [(1 / 3, 6), (0.25, 4), (0.4, 5), (0.1234567, 4)])
def test_elements_left_open_have_nodes_at_steps(step, elements):
    """As few as that takes, four or more; a step that no mesh meets is refused as before."""
    at = ((0, "a"), (step, "a"), (step, "b"), (1, "b"))
    stations = ", ".join(f"{{at: {place}, section: {section}}}" for place, section in at)
    text = f"""
hfsim: 1
gravity: [0.0, -9.81]
materials: {{stuff: {{density: 1000.0, youngs_modulus: 1.0e7}}}}
sections: {{a: {{shape: circle, radius: 0.02}}, b: {{shape: circle, radius: 0.01}}}}
bodies: {{b: {{type: beam, material: stuff, length: 1.0, elements: auto, stations: [{stations}]}}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
solve: {{duration: 0.3}}
"""
    if step == 0.1234567:
        with pytest.raises(DeckError, match="is inside one of 4 elements"):
            parse_deck(text)
        return
    notes = []
    loaded = parse_deck(text)
    assert loaded.deck.bodies["b"].elements == elements
    assert loaded.with_numbers(notes.append).deck.bodies["b"].elements == elements
    assert f"elements: auto of b taken as {elements}" in notes[0]
