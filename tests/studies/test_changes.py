"""What the named axes of studies change in a deck."""

import numpy as np
import pytest

from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate
from hfsim.studies.axes import NAMED, AxisError, point_overrides


def changed(name, value, text):
    """Return a deck before and after an axis has changed it."""
    loaded = parse_deck(text)
    overrides = point_overrides(loaded, [NAMED[name](str(value))], [value])
    return loaded.deck, parse_deck(text, "deck", overrides).deck


# --- slenderness ----------------------------------------------------------------------------------

BEAM = """
hfsim: 1
materials: {{steel: {{density: 7800, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}}}
sections: {{s: {section}}}
bodies: {{arm: {{type: beam, section: s, length: 0.7, {more}}}}}
joints: {{clamp: {{type: fixed, between: [ground, arm.root]}}}}
gravity: {gravity}
solve: {{duration: 1.0}}
output: {{channels: [{channels}]}}
"""
STIFF = "{mass_per_length: 1, rotary_inertia: 1.0e-4, axial_stiffness: 1.2e7, shear_stiffness: 4.0e6, %s}"
MATRIX = "[[1.2e7, 0, 90], [0, 4.0e6, 0], [90, 0, 100]]"
LISTS = "second_moments: [1.0e-9, 3.0e-10], torsion_constant: 2.0e-10, shear_factors: [0.8, 0.7]"
SECTIONS = {
    "rectangle": ("{shape: rectangle, width: 4 cm, height: 1 cm}", 2, 0.01),
    "circle": ("{shape: circle, diameter: 2 cm}", 3, 0.02),
    "radius": ("{shape: circle, radius: 1 cm}", 2, 0.02),
    "tube": ("{shape: tube, outer_radius: 1 cm, inner_radius: 8 mm}", 3, 0.02),
    "numbers": ("{area: 1.0e-4, second_moment: 3.0e-10}", 2, 6e-3),
    "lists": (f"{{area: 1.0e-4, {LISTS}}}", 3, 6e-3),
    "stiffness": (STIFF % "bending_stiffness: 100, bending_damping: 1.0e-4", 2, 0.01),
    "stiffness in space": (STIFF % "torsion_stiffness: 50, bending_stiffness: [300, 100]", 3, 0.01),
    "matrix": (f"{{mass_per_length: 1, rotary_inertia: 1.0e-4, stiffness: {MATRIX}}}", 2, 0.01),
}


def beam_of(name, channels="energy.total"):
    section, n_dim, height = SECTIONS[name]
    more = "element: cosserat" + ("" if "stiffness" in section else ", material: steel")
    gravity = [0.0] * (n_dim - 1) + [-9.81]
    return BEAM.format(section=section, more=more, gravity=gravity, channels=channels), 0.7 / height


@pytest.mark.parametrize("name", SECTIONS)
def test_at_its_own_slenderness_a_beam_is_that_of_the_deck(name):
    text, own = beam_of(name)
    old, new = changed("slenderness", own, text)
    before, after = old.sections["s"], new.sections[new.bodies["arm"].section]
    assert type(after) is type(before) and after.model_fields_set == before.model_fields_set
    for key in before.model_fields_set:
        ours, theirs = getattr(after, key), getattr(before, key)
        assert key == "shape" or np.array(ours) == pytest.approx(np.array(theirs), rel=1e-12), key


@pytest.mark.parametrize("name", SECTIONS)
def test_a_beam_twice_as_slender_has_the_same_section_half_as_large(name):
    text, own = beam_of(name)
    old, new = changed("slenderness", 2.0 * own, text)
    before, after = old.sections["s"], new.sections[new.bodies["arm"].section]
    powers = {"area": 2, "bending": 4, "torsion": 4, "mass_per_length": 2, "rotary": 4}
    powers |= {"axial_stiffness": 2, "shears": 2, "torsion_stiffness": 4}
    compared = [key for key in powers if getattr(before, key, None) is not None]
    for key in compared:
        larger, smaller = np.array(getattr(before, key)), np.array(getattr(after, key))
        assert larger == pytest.approx(2.0 ** powers[key] * smaller), key
    assert {"area", "axial_stiffness"} & set(compared) and "bending" in compared
    if name == "matrix":
        assert after.couplings[4] == pytest.approx(before.couplings[4] / 8.0), "force by curvature"


def test_stress_is_known_at_any_slenderness():
    text, own = beam_of("circle", "arm.root.stress")
    assert changed("slenderness", 3.0 * own, text)[1].channels == ("arm.root.stress",)


def test_sections_of_stations_keep_their_proportions():
    text, _ = beam_of("rectangle")
    thin = "thin: {shape: rectangle, width: 2 cm, height: 5 mm}"
    text = text.replace("sections: {", f"sections: {{{thin}, ").replace(
        "section: s, ", "stations: [{at: 0, section: s}, {at: 1, section: thin}], "
    )
    old, new = changed("slenderness", 35.0, text)
    for before, after in zip(old.bodies["arm"].stations, new.bodies["arm"].stations, strict=True):
        large, small = new.sections[after.section], old.sections[before.section]
        assert (large.height, large.width) == pytest.approx((2.0 * small.height, 2.0 * small.width))


# --- stiffness and motion -------------------------------------------------------------------------

SPRINGS = """
hfsim: 1
sections: {s: {mass_per_length: 1, rotary_inertia: 1.0e-4, axial_stiffness: 1.0e6, shear_stiffness: 4.0e5,
  bending_stiffness: 100}}
bodies:
  m: {type: rigid, mass: 1.0, inertia: 1}
  n: {type: rigid, mass: 1.0, inertia: 1}
  o: {type: rigid, mass: 1.0, inertia: 1}
  arm: {type: beam, section: s, length: 1.0, element: cosserat}
joints:
  r: {type: prismatic, between: [ground, m], stops: {upper: 2, stiffness: 3.0e3}}
  r2: {type: prismatic, between: [ground, n], latch: {distance: -0.2, stiffness: 2.0e3}}
  clamp: {type: fixed, between: [ground, arm.root]}
ground: {points: {w: [-1, 0]}}
springs:
  linear: {type: two_point, between: [ground.w, n], stiffness: 100, rest_length: 1, preload: 2}
  tabled: {type: two_point, between: [ground.w, m], rest_length: 1, table: [[-1, -100], [0, 0], [1, 100]]}
  mount: {type: bushing, between: [ground, o], stiffness: [10, 20], rotational_stiffness: 5}
initial: {r: {distance: 0.1}, r2: {distance: 0.1}}
solve: {duration: 0.2}
output: {interval: 0.05, channels: [m.x, n.x]}
"""


def test_a_factor_on_stiffness_reaches_all_that_is_elastic():
    old, new = changed("stiffness", 4.0, SPRINGS)
    assert new.springs["tabled"].table == ((-1.0, -400.0), (0.0, 0.0), (1.0, 400.0))
    assert (new.springs["linear"].stiffness, new.springs["linear"].preload) == (400.0, 2.0)
    assert (new.springs["mount"].stiffness, new.springs["mount"].rotational_stiffness) == ((40.0, 80.0), 20.0)
    assert (new.joints["r"].stops.stiffness, new.joints["r2"].latch.stiffness) == (1.2e4, 8e3)
    for key in ("axial_stiffness", "shear_stiffness", "bending_stiffness"):
        assert getattr(new.sections["s"], key) == 4.0 * getattr(old.sections["s"], key), key
    assert new.springs["tabled"].stiffness == 0.0
    matrix = beam_of("matrix")[0]
    assert changed("stiffness", 2.0, matrix)[1].sections["s"].stiffness[0] == (2.4e7, 0.0, 180.0)


def test_springs_by_table_and_by_number_are_scaled_alike():
    text = SPRINGS.replace(", preload: 2", "").replace(", latch: {distance: -0.2, stiffness: 2.0e3}", "")
    overrides = point_overrides(parse_deck(text), [NAMED["stiffness"]("9")], [9.0])
    run = simulate(parse_deck(text, "deck", overrides))
    assert run["m.x"] == pytest.approx(run["n.x"], abs=1e-5)
    assert run["m.x"][-1] == pytest.approx(0.1 * np.cos(np.sqrt(900.0) * 0.2), abs=1e-5)


DRIVEN = """
hfsim: 1
bodies: {b: {type: rigid, mass: 1.0, inertia: 1}}
joints:
  pin: {type: revolute, between: [ground, b]}
  lead: {type: driver, between: [ground, b], angle: LAW}
solve: {duration: 1.0}
"""
LAWS = {
    "sine": ("{type: sine, amplitude: 0.5, frequency: 1, offset: 0.3, phase: 0.4}", 0.3),
    "step": ("{type: smooth_step, from: 0.2, to: 1, start: 0, end: 1}", 0.2),
    "table": ("{times: [0, 0.5, 1], values: [0.2, 0.7, -0.3], interpolation: cubic}", 0.2),
    "periodic": ("{times: [0, 0.3, 0.6], values: [0.2, 0.7, 0.2], periodic: true}", 0.2),
    "expression": ('{expression: "0.3*sin(2*t) + t**2"}', 0.0),
}


@pytest.mark.parametrize("law", LAWS)
def test_a_factor_on_amplitude_reaches_every_law_of_a_driver(law):
    """All go so much farther from where they begin, sines from their mean."""
    text, begin = LAWS[law]
    old, new = changed("amplitude", 3.0, DRIVEN.replace("LAW", text))
    t = np.linspace(0.0, 1.0, 7)
    before, after = (deck.joints["lead"].angle.build().value(t) for deck in (old, new))
    assert after - begin == pytest.approx(3.0 * (before - begin))
    assert np.ptp(before) > 0.1


@pytest.mark.parametrize(
    "entries", ["initial: {b: {angle: 0}}", "loads: {p: {type: moment, at: b, moment: 0}}"]
)
def test_an_axis_of_zeros_is_refused(entries):
    text = DRIVEN.replace("  lead: {type: driver, between: [ground, b], angle: LAW}\n", "") + entries
    with pytest.raises(AxisError, match="nothing in"):
        changed("amplitude", 2.0, text)
