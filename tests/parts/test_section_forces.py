"""Internal forces: balance of cantilevers in closed form, damping, rotation, and what asks for them."""

import numpy as np
import pytest
from cantilevers import at_rest, cantilever, inside

from hfsim.errors import DeckError
from hfsim.parts.bodies.planar_low_order_body import LowOrderBody
from hfsim.parts.bodies.section_axes import along_the_line, in_axes, in_the_plane, square_axes
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

PLACES = np.linspace(0.0, 1.0, 23)
SQUARE = "{shape: rectangle, width: 0.2, height: 0.2}"
STIFF = "{area: 1.0e4, second_moment: 1.0, torsion_constant: 2.0}"


def slopes_of(body, x, derivative=1, places=PLACES):
    rows = np.array([body.mesh.shape(float(a), 0.0, (derivative, 0)) for a in places])
    return rows @ body.vectors(x)


def axes_and_places(body, x):
    """Return section axes, columns, and points at `PLACES`, from the shapes themselves."""
    if hasattr(body, "beam"):
        if body.beam.n_dim == 2:
            return in_the_plane(slopes_of(body, x)), np.pad(slopes_of(body, x, 0), ((0, 0), (0, 0), (0, 1)))
        if hasattr(body.mesh.element, "section_degree"):
            frames = [body.marker((float(a), 0.0, 0.0)).frame(x) for a in PLACES]
            return np.stack(frames, axis=1), slopes_of(body, x, 0)
        grid = np.union1d(PLACES, body.outline_places)
        root = body.marker(body.origin).turned(x, np.eye(3))
        axes = along_the_line(root, slopes_of(body, x, 1, grid))
        return axes[:, np.searchsorted(grid, PLACES)], slopes_of(body, x, 0)
    rows = np.array([body.mesh.shape(float(a))[0] for a in PLACES])
    points = np.pad(rows @ body.vectors(x), ((0, 0), (0, 0), (0, 3 - body.n_dim)))
    return square_axes(body.mesh, body.vectors(x), PLACES), points


def balanced(body, x, force):
    """Return what holds a force [N] at the tip at every section."""
    axes, r = axes_and_places(body, x)
    force = np.broadcast_to(np.array(force), r.shape)
    return in_axes(axes, force, np.cross(r[:, -1:] - r, force))[0]


@pytest.mark.parametrize(
    ("more", "elements", "degree", "moment_error"),
    [
        ("element: cable", 4, 3, 1e-9),
        ("element: cable, strain: engineering, curvature: exact", 3, 3, 1e-9),
        ("element: cable, curvature: exact", 2, 6, 1e-9),
        ("element: continuum", 4, 3, 1e-9),
        ("element: continuum, section_degree: 4", 2, 5, 1e-9),
        ("element: cosserat", 4, 1, 1e-9),
        ("element: cosserat, section_angle: 0.7", 5, 3, 1e-9),
        ("element: cosserat", 3, 6, 1e-9),
    ],
)
def test_a_cantilever_holds_the_force_at_its_tip(more, elements, degree, moment_error):
    """Bent by more than half its length out of the plane: forces to rounding on any mesh."""
    force, (section, E) = (0.0, -2.0, 0.7), (SQUARE, 7500.0) if "continuum" in more else (STIFF, 1.0)
    scene = cantilever(
        section, 1.0, force, elements=elements, degree=degree, material=f"youngs_modulus: {E}", more=more
    )
    body, x = scene.bodies["b"], at_rest(scene, 1.0)
    found, expected = inside(scene, x, PLACES), balanced(body, x, force)
    assert found[:, :3] == pytest.approx(expected[:, :3], abs=1e-8)
    assert found[:, 3:] == pytest.approx(expected[:, 3:], abs=moment_error)
    if "cosserat" not in more:
        assert expected[:, 3] == pytest.approx(0.0, abs=0.2)  # a line bears torsion by its curvature only


PLANAR = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {{stuff: {{density: 1.0, youngs_modulus: 1.0e4, poisson_ratio: 0.0{damping}}}}}
sections: {{bar: {{shape: rectangle, width: 1.0, height: 0.1}}}}
bodies: {{b: {{type: beam, material: stuff, section: bar, length: 1.0, elements: {elements}{more}}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads: {{push: {{type: force, at: b.tip, force: [-0.3, 1.5], law: {{type: constant_rate, rate: 1.0}}}}}}
solve: {{duration: 1.0, model: {model}}}
"""


@pytest.mark.parametrize(
    ("more", "error"),
    [(", degree: 5", 1e-9), (", element: continuum", 1e-9), (", element: cosserat, degree: 6", 1e-9)],
)
def test_a_planar_cantilever_holds_the_force_at_its_tip(more, error):
    scene = build(parse_deck(PLANAR.format(damping="", elements=4, more=more, model="ancf")))
    body, x = scene.bodies["b"], at_rest(scene, 1.0)
    found, expected = inside(scene, x, PLACES), balanced(body, x, (-0.3, 1.5, 0.0))
    assert found[:, :3] == pytest.approx(expected[:, :3], abs=1e-9)
    assert found[:, 3:] == pytest.approx(expected[:, 3:], abs=error)
    assert np.abs(expected[:, [0, 1, 5]]).max(axis=0) == pytest.approx([1.0, 1.5, 1.3], rel=0.4)


E, EI = 1e4, 1e4 * 0.1**3 / 12


@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact"])
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_models_of_small_deformation_agree_with_beam_theory(model, damping):
    """v = P x^2 (3 L - x) / (6 EI) and u = N x / EA, and their rates, which cubics hold exactly.

    Where damping is what holds part of the load, nothing accelerates, and sections hold all of it.
    """
    times, pull, push, rate = f", axial_damping: {damping}, bending_damping: {2 * damping}", 1e-7, 1e-7, 0.5
    load = [pull * (1.0 + damping * rate), push * (1.0 + 2 * damping * rate)]
    text = PLANAR.format(damping=times, elements=3, more="", model=model)
    scene = build(parse_deck(text.replace("[-0.3, 1.5]", str(load))))
    body = scene.bodies["b"]
    x = state(body, pull, push)
    u = rate * (x - state(body, 0.0, 0.0))
    found = inside(scene, x[None], PLACES, u=u[None])
    expected = np.zeros((len(PLACES), 6))
    expected[:, 0] = pull * (1.0 + damping * rate)
    expected[:, 1] = push * (1.0 + 2 * damping * rate)
    expected[:, 5] = expected[:, 1] * (1.0 - PLACES)
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-11)


def state(body, pull, push):
    """Return coordinates of the beam under a pull and a push at its tip."""
    nodes = np.linspace(0.0, 1.0, 4)
    along = np.stack([nodes * pull / (E * 0.1), np.full(4, pull / (E * 0.1))], axis=1)
    across = push / (6 * EI) * np.stack([nodes**2 * (3 - nodes), 6 * nodes - 3 * nodes**2], axis=1)
    if isinstance(body, LowOrderBody):
        return np.concatenate([np.zeros(3), along.ravel()[1:], across.ravel()[2:]])
    straight = np.stack([nodes, np.ones(4)], axis=1)
    return np.stack([straight + along, across], axis=-1).ravel()


@pytest.mark.parametrize("element", ["cable", pytest.param("cosserat", marks=pytest.mark.slow)])
def test_roll_up_bends_by_its_moment_alone(element):
    """M = 2 pi EI / L: a full circle, whose sections bear nothing but M."""
    section, moment = "{area: 1.0e4, second_moment: 1.0}", 2.0 * np.pi
    degree, more = {"cable": (9, "element: cable, curvature: exact"), "cosserat": (6, "")}[element]
    scene = cantilever(
        section, 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, moment), 4, degree, "youngs_modulus: 1.0", more
    )
    x = at_rest(scene, 1.0)
    found = inside(scene, x, PLACES)
    assert found == pytest.approx(np.tile([0, 0, 0, 0, 0, moment], (len(PLACES), 1)), abs=5e-6)


def test_torsion_and_stress():
    """Axial force, torsion and both bending moments of a bar, and the stress in its corner."""
    section, b, h = "{shape: rectangle, width: 0.2, height: 0.1}", 0.2, 0.1
    scene = cantilever(section, 1.0, (3.0, 0.0, 0.0), (0.4, 0.3, -0.2), 2, 3, "youngs_modulus: 1.0e9")
    body, x = scene.bodies["b"], at_rest(scene, 1.0)
    found = inside(scene, x, PLACES)
    assert found == pytest.approx(np.tile([3.0, 0.0, 0.0, 0.4, 0.3, -0.2], (len(PLACES), 1)), abs=1e-4)
    size = 3.0 / (b * h) + 0.3 * (b / 2) / (h * b**3 / 12) + 0.2 * (h / 2) / (b * h**3 / 12)
    assert body.fibres(PLACES[:1]).stress(*found[0, [0, 4, 5]]) == pytest.approx(size, rel=1e-3)
    round_bar = cantilever("{shape: circle, radius: 0.1}", 1.0, (0, 0, 0), material="youngs_modulus: 1.0")
    bent = round_bar.bodies["b"].fibres(PLACES).stress(0.0, 3.0, -4.0)
    assert bent == pytest.approx(5.0 / (np.pi * 0.1**3 / 4), rel=1e-12)


SPUN = """
hfsim: 1
gravity: {gravity}
materials: {{stuff: {{density: 1.0, youngs_modulus: 1.0e8}}}}
sections: {{bar: {{shape: circle, radius: 0.1}}}}
bodies:
  b: {{type: beam, material: stuff, section: bar, length: 1.0, elements: 2, element: {element}, degree: 5,
      points: {{half: {half}, third: {third}}}}}
joints: {{hinge: {{type: revolute, between: [ground, b.root]}}}}
initial: {{b: {{angular_velocity: 7.0}}}}
solve: {{duration: 0.02, model: exact, method: radau, tolerance: 1.0e-6}}
output:
  interval: 0.02
  channels: [b.half.axial_force, b.third.axial_force, b.third.stress, b.{shear}, b.tip.{bending}]
"""


@pytest.mark.parametrize("element", ["cable", "cosserat", "planar"])
def test_a_turning_beam_pulls_by_what_is_beyond(element):
    """N = rho A omega^2 (L^2 - x^2) / 2, within the ringing of its sudden start."""
    plane = element == "planar"
    text = SPUN.format(
        gravity=[0.0] * (2 if plane else 3),
        element="cable" if plane else element,
        half=[0.5, 0.0] + [0.0] * (not plane),
        third=[1 / 3, 0.0] + [0.0] * (not plane),
        shear="shear_force" if plane else "shear_force_y",
        bending="bending_moment" if plane else "bending_moment_z",
    )
    run = simulate(parse_deck(text), error_estimate=False)
    half, third, stress, shear, bending = (channel.values[-1] for channel in run.channels)
    pull = np.pi * 0.01 * 49.0 / 2
    assert (half, third) == pytest.approx((0.75 * pull, 8 / 9 * pull), rel=2e-2)
    assert stress == pytest.approx(third / (np.pi * 0.01), rel=1e-2)
    assert (shear, bending) == pytest.approx((0.0, 0.0), abs=1e-2 * pull)


@pytest.mark.parametrize(
    ("channel", "more", "words"),
    [
        ("b.tip.shear_force", "", "a spatial scene has no shear_force"),
        ("b.tip.torsion_moment", "element: cable", "a cable element has no torsion_moment"),
        ("b.tip.stress", "", "the section of 'b' has no shape from which a stress follows"),
        ("b.tip.axial_force", "element: cable, model: rigid", "a beam has no internal forces"),
    ],
)
def test_what_there_is_not_is_refused(channel, more, words):
    text = f"""
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {{stuff: {{density: 1.0, youngs_modulus: 1.0}}}}
sections: {{bar: {{area: 1.0, second_moment: 1.0}}}}
bodies: {{b: {{type: beam, material: stuff, section: bar, length: 9.0, {more}}}}}
solve: {{duration: 1.0}}
output: {{channels: [{channel}]}}
"""
    with pytest.raises(DeckError, match=words) as refused:
        build(parse_deck(text))
    assert "deck:8:21:" in str(refused.value)


@pytest.mark.parametrize("section", ["{shap: circle, diameter: 0.1}", "{shape: circle, diameter: 0.1}"])
def test_of_a_misspelled_section_nothing_is_said_of_stresses(section):
    text = f"""
hfsim: 1
gravity: [0.0, 0.0]
materials: {{stuff: {{density: 1.0, youngs_modulus: 1.0}}}}
sections: {{bar: {section}}}
bodies: {{b: {{type: beam, material: stuff, section: {"bar" if "shap:" in section else "bra"}, length: 9.0}}}}
solve: {{duration: 1.0}}
output: {{channels: [b.tip.stress]}}
"""
    with pytest.raises(DeckError, match=r"error: (sections|bodies.b.section)") as refused:
        build(parse_deck(text))
    assert "stress follows" not in str(refused.value)


def test_axes_of_a_line_do_not_turn_about_it():
    """On a helix they turn back against its own normal by torsion times length."""
    s = np.linspace(0.0, 3.0, 400)
    k, tau = 1.2, 0.7
    w = np.hypot(k, tau)
    slopes = np.stack([k * np.cos(w * s), k * np.sin(w * s), np.full(s.size, tau)], axis=-1)[None] / w
    normals = np.stack([-np.sin(w * s), np.cos(w * s), 0.0 * s], axis=-1)
    root = np.stack([slopes[0, 0], normals[0], np.cross(slopes[0, 0], normals[0])], axis=-1)
    y = along_the_line(root[None], slopes)[0, :, :, 1]
    angle = np.arctan2(np.sum(np.cross(normals, y) * slopes[0], axis=1), np.sum(normals * y, axis=1))
    assert angle == pytest.approx(-tau * s, abs=1e-4)


@pytest.mark.parametrize("more", ["element: cable, degree: 6", "element: cosserat, degree: 4"])
def test_weight_bends_by_what_is_beyond(more):
    """Small bending under its own weight: Q = - q (L - x), M = - q (L - x)^2 / 2."""
    text = f"""
hfsim: 1
gravity: [0.0, -1.0e-6, 0.0]
materials: {{stuff: {{density: 1.0, youngs_modulus: 100.0}}}}
sections: {{bar: {{area: 1.0, second_moment: 1.0}}}}
bodies: {{b: {{type: beam, material: stuff, section: bar, length: 1.0, elements: 2, {more}}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
solve: {{duration: 1.0}}
"""
    scene = build(parse_deck(text))
    x = at_rest(scene, 1.0)
    found = inside(scene, x, PLACES)
    left = 1e-6 * (1.0 - PLACES)
    assert found[:, 1] == pytest.approx(-left, abs=1e-11)
    assert found[:, 5] == pytest.approx(-0.5 * left * (1.0 - PLACES), abs=1e-11)
