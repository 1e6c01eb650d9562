# ruff: noqa: E501
"""Forces along beams: closed forms of statics in all models, work, frames, section forces, balance of energy."""

import math

import numpy as np
import pytest
from analytical import jacobian
from cantilevers import at_rest, inside

from hfsim.errors import DeckError
from hfsim.maths.matrices import assemble
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

E, AREA, SECOND, L = 1e4, 0.1, 0.1**3 / 12, 1.0
EI = E * SECOND
PLANAR = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {stuff: {density: 1.0, youngs_modulus: 1.0e4, poisson_ratio: 0.0}}
sections: {bar: {shape: rectangle, width: 1.0, height: 0.1}}
bodies: {b: {type: beam, material: stuff, section: bar, length: 1.0, elements: 4}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
loads: {wind: {type: distributed, on: b, force: [0.0, -1.0e-6]}}
solve: {duration: 1.0}
output: {plots: false, channels: [b.tip.x, energy.total]}
"""


def scene_of(*settings, deck=PLANAR):
    return build(parse_deck(deck, "deck.yaml", settings))


def tip(scene):
    return scene.marker("b.tip").position(at_rest(scene, 1.0))[0]


MODELS = ["linear", "exact", "ancf"]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("shape", "deflection"),
    [
        ("null", 1 / 8),
        ("[[0.0, 0.0], [1.0, 1.0]]", 11 / 120),
        ("[[0.0, 1.0], [1.0, 0.0]]", 1 / 30),
        ("[[0.3, 1.0], [1.0, 1.0]]", 1 / 8 - (3 * 0.3**4 / 24 + 0.3**3 * 0.7 / 6)),
    ],
)
def test_a_cantilever_bends_as_in_the_books(model, shape, deflection):
    """w L^4 / 8 EI, triangles 11/120 and 1/30; a patch from 0.3 on is all less its first part."""
    scene = scene_of(f"solve.model={model}", f"loads.wind.shape={shape}")
    assert tip(scene)[1] == pytest.approx(-1e-6 * deflection / EI, rel=1e-6)


@pytest.mark.parametrize("element", ["cable", "continuum", "cosserat"])
def test_every_element_carries_it(element):
    """Shear adds w L^2 / 2 kGA where there is one."""
    more = ["bodies.b.degree=5", "bodies.b.section_degree=4"] if element == "continuum" else ["bodies.b.degree=4"]
    if element == "cosserat":
        more = ["bodies.b.degree=6"]
    scene = scene_of(f"bodies.b.element={element}", *more)
    shear = {"cable": 0.0, "cosserat": 0.5 / (5 / 6 * E / 2 * AREA), "continuum": 0.5 / (5 / 6 * E / 2 * AREA)}[element]
    assert tip(scene)[1] == pytest.approx(-1e-6 * (1 / (8 * EI) + shear), rel=1e-6 if element != "continuum" else 2e-3)


SPATIAL = PLANAR.replace("[0.0, 0.0]", "[0.0, 0.0, 0.0]").replace("[0.0, -1.0e-6]", "[0.0, -1.0e-6, 2.0e-6]")


@pytest.mark.parametrize(("element", "models"), [("cable", MODELS), ("cosserat", ["exact", "linear"]), ("continuum", ["exact", "linear"])])
def test_in_space_too(element, models):
    more = ", section_degree: 4" if element == "continuum" else ""
    deck = SPATIAL.replace("length: 1.0", f"length: 1.0, element: {element}, degree: 5{more}")
    I_z = SECOND, AREA * 1.0 / 12
    if element == "cable":
        deck, I_z = deck.replace("width: 1.0, height: 0.1", "width: 0.1, height: 0.1"), (0.1**4 / 12,) * 2
    for model in models:
        found = tip(scene_of(f"solve.model={model}", deck=deck))
        if element == "continuum":
            assert found[1] == pytest.approx(-1e-6 / (8 * EI), rel=0.02)
            continue
        shear = 0.5 / (5 / 6 * E / 2 * AREA) if element == "cosserat" else 0.0
        assert found[1] == pytest.approx(-1e-6 * (1 / (8 * E * I_z[0]) + shear), rel=1e-5)
        assert found[2] == pytest.approx(2e-6 * (1 / (8 * E * I_z[1]) + shear), rel=1e-5)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("shape", ["null", "[[0.3, 1.0], [0.8, 2.0]]"])
def test_sections_hold_what_lies_beyond_them(model, shape):
    """Resultant and moment of the load beyond, at every place: w (L - x) and w (L - x)^2 / 2 if constant."""
    scene = scene_of(f"solve.model={model}", f"loads.wind.shape={shape}")
    x, places = at_rest(scene, 1.0), np.linspace(0.0, 1.0, 9)
    found = inside(scene, x, places)
    s, w = np.linspace(0.0, 1.0, 20001), np.ones(20001)
    if shape != "null":
        w = np.interp(s, [0.3, 0.8], [1.0, 2.0], left=0.0, right=0.0)
    beyond = [s >= place - 1e-12 for place in places]
    force = [np.trapezoid(w[b], s[b]) for b in beyond]
    moment = [np.trapezoid((w * (s - place))[b], s[b]) for b, place in zip(beyond, places, strict=True)]
    assert found[:, 1] == pytest.approx(-1e-6 * np.array(force), abs=1.01e-10)
    assert found[:, 5] == pytest.approx(-1e-6 * np.array(moment), abs=1.01e-10)


SWING = PLANAR.replace("fixed", "revolute").replace("[0.0, -1.0e-6]", "[0.1, -0.3]").replace("1.0e4", "1.0e6")


@pytest.mark.parametrize("model", ["rigid", "linear", "lowOrder", "exact", "ancf"])
@pytest.mark.parametrize("follower", ["false", "true"])
def test_every_model_swings_under_it_and_keeps_account(model, follower):
    law = "loads.wind.law={type: sine, amplitude: 1.0, frequency: 1.4, offset: 1.0}"
    sets = [f"solve.model={model}", f"loads.wind.follower={follower}", law, "solve.tolerance=1e-8", "bodies.b.elements=1", "solve.duration=0.5"]
    result = simulate(parse_deck(SWING, "deck.yaml", sets), error_estimate=False)
    assert result.status == "done"
    assert result.statistics["energy_drift"] < (2e-3 if model == "lowOrder" else 1e-6)
    rigid = simulate(parse_deck(SWING, "deck.yaml", [*sets, "solve.model=rigid"]), error_estimate=False)
    assert np.ptp(rigid.channels[0].values) > 0.1
    assert result.channels[0].values == pytest.approx(rigid.channels[0].values, abs=0.02)


def test_a_rigid_rod_turns_by_the_moment_of_it():
    """I phi'' = w L^2 / 2, the force following."""
    sets = ["solve.model=rigid", "loads.wind.follower=true", "loads.wind.force=[0.0, 0.3]", "output.channels=[b.angle]"]
    result = simulate(parse_deck(SWING, "deck.yaml", sets), error_estimate=False)
    assert result.channels[0].values == pytest.approx(0.5 * (0.3 / 2) / (0.1 / 3) * result.t**2, abs=1e-7)


@pytest.mark.parametrize("deck", [PLANAR, SPATIAL.replace("length: 1.0", "length: 1.0, element: cosserat")], ids=["plane", "space"])
@pytest.mark.parametrize("model", ["exact", "linear", "rigid", "lowOrder"])
@pytest.mark.parametrize("follower", [False, True])
def test_work_tangent_and_resultant(deck, model, follower):
    """Power is that of point forces; of a whole translation it is the resultant's."""
    if model == "lowOrder" and deck is not PLANAR:
        deck = deck.replace("cosserat", "cable")
        if follower:
            deck = deck.replace("[0.0, -1.0e-6, 2.0e-6]", "[-1.0e-6, 0.0, 0.0]")
        deck = deck.replace("width: 1.0", "width: 0.1")
    sets = [f"solve.model={model}", f"loads.wind.follower={str(follower).lower()}", "joints=null", "loads.wind.shape=[[0.2, 1.0], [0.5, 3.0], [0.9, 0.5]]"]
    scene = scene_of(*sets, deck=deck)
    (part,) = (part for part in scene.system.forces if part.item == "loads.wind")
    rng = np.random.default_rng(4)
    x = scene.system.absolute(scene.q[None])
    x = x + 0.05 * rng.normal(size=x.shape)
    u, t, n = rng.normal(size=x.shape), np.zeros(1), x.shape[1]

    def forces(x):
        out = np.zeros_like(x)
        part.add_force(np.zeros(len(x)), x, x, out)
        return out

    force = forces(x)[0]
    assert force @ u[0] == pytest.approx(part.power(t, x, u)[0], rel=1e-12)
    pieces = sum(load[0] @ u[0, marker.columns] for marker, load in part.on_points(t, x, u))
    assert pieces == pytest.approx(part.power(t, x, u)[0], rel=1e-10)
    slope = jacobian(forces, x[0])
    assert assemble([part.tangent(t, x, u)], (n, n), False) == pytest.approx(-slope, abs=1e-5 * (1e-9 + np.abs(slope).max()))
    amount = np.sum(part.forces, axis=0)
    density = 0.3 * 2.0 + 0.4 * 1.75
    assert amount == pytest.approx(density * np.array(scene.deck.loads["wind"].force), rel=1e-12)


@pytest.mark.parametrize("model", ["exact", "linear", "rigid"])
def test_turned_as_a_whole_it_does_the_same(model):
    """A following load does not care where the beam points."""
    runs = []
    for angle in (0.0, 1.1):
        sets = [f"solve.model={model}", "loads.wind.follower=true", f"initial={{b: {{angle: {angle}, angular_velocity: 1.0}}}}"]
        result = simulate(parse_deck(SWING, "deck.yaml", [*sets, "output.channels=[b.tip.deflection, b.angle]", "solve.tolerance=1e-9", "bodies.b.elements=2", "solve.duration=0.3"]), error_estimate=False)
        runs.append([result.channels[0].values, result.channels[1].values - angle])
    assert np.array(runs[1]) == pytest.approx(np.array(runs[0]), abs=1e-7)


ARC = "element: cosserat, axis: {arc: {radius: 2.0, angle: 1.2}}, degree: 6"


@pytest.mark.parametrize("model", ["exact", "linear", "rigid"])
@pytest.mark.parametrize(("deck", "roll"), [(PLANAR, 0.0), (SPATIAL, 0.4)], ids=["plane", "space"])
def test_on_an_arc_it_follows_the_axes_of_the_sections(model, deck, roll):
    """A pressure p across an arc of radius R has the resultant p R [cos a - 1, sin a]; sections may be rolled."""
    about = f", section_angle: {roll}" if roll else ""
    force = [0.3, 2.0] if deck is PLANAR else [0.3, 2.0 * math.cos(roll), -2.0 * math.sin(roll)]
    sets = [f"solve.model={model}", "loads.wind.follower=true", f"loads.wind.force={force}"]
    scene = scene_of(*sets, deck=deck.replace("length: 1.0", ARC + about))
    (part,) = (part for part in scene.system.forces if part.item == "loads.wind")
    x = scene.system.absolute(scene.q[None])
    found = np.sum(part.at_places(np.zeros(1), x, 0.0 * x), axis=0)[0]
    along, across = [np.sin(1.2), 1.0 - np.cos(1.2)], [np.cos(1.2) - 1.0, np.sin(1.2)]
    expected = 2.0 * (0.3 * np.array(along) + 2.0 * np.array(across))
    assert found == pytest.approx([*expected, 0.0][: len(found)], abs=1e-9)


def test_a_shape_beyond_the_beam_is_refused():
    with pytest.raises(DeckError, match=r"1\.2 m is not on 'b', whose length is 1 m"):
        parse_deck(PLANAR, "deck.yaml", ["loads.wind.shape=[[0.2, 1.0], [1.2, 1.0]]"])
