"""Decks: what is accepted, what is refused, and where the refusal points."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from hfsim.deck.law_specs import LAWS, AngleLaw, PositionLaw
from hfsim.deck.materials import MaterialSpec, SectionProperties
from hfsim.deck.reader import parse
from hfsim.deck.sections import SectionSpec
from hfsim.deck.source import OverrideProblem, parse_source
from hfsim.deck.units import SI_UNITS, UNITS, UnitError, parse_quantity
from hfsim.errors import DeckError
from hfsim.parts.joints import JOINTS
from hfsim.scene.loading import load_deck, parse_deck

HERE = Path(__file__).parent
CASES = sorted((HERE.parents[1] / "cases").glob("*.yaml"))
BROKEN = sorted((HERE / "broken_decks").glob("*.yaml"))
SMALL = """
hfsim: 1
materials: {steel: {density: 7800, youngs_modulus: 2.1e11}}
sections: {bar: {area: 4e-4, second_moment: 1.33e-8}}
bodies: {arm: {type: beam, material: steel, section: bar, length: 2}}
joints: {pin: {type: revolute, between: [ground, arm.root]}}
solve: {duration: 2}
"""


def by_stem(path):
    return path.stem


def problems(text, overrides=()):
    with pytest.raises(DeckError) as caught:
        parse_deck(text, "small.yaml", overrides)
    return caught.value.problems


def scalar(text):
    return parse_source(f"key: {text}").data["key"]


# Broken decks


@pytest.mark.parametrize("path", BROKEN, ids=by_stem)
def test_broken_deck_is_refused_where_it_is_wrong(path):
    expected = re.findall(r"^# expect: (?:(\S+):)?(\d+) ?(\S*)$", path.read_text(), re.MULTILINE)
    expected = [(str(path.parent / file if file else path), line, key) for file, line, key in expected]
    assert expected
    with pytest.raises(DeckError) as caught:
        load_deck(path)
    found = [(one.file or str(path), str(one.line), one.path) for one in caught.value.problems]
    assert sorted(found) == sorted(expected)
    message = str(caught.value)
    for file, line, key in expected:
        assert re.search(rf"{re.escape(file)}:{line}:\d+: error: {re.escape(key)}", message)


def test_what_makes_a_scene_spatial_is_named_where_no_gravity_is_stated():
    with pytest.raises(DeckError, match=r"this scene is spatial: bodies\.hub\.inertia has three"):
        load_deck(HERE / "broken_decks" / "space_two_numbers_elsewhere.yaml")


def test_gravity_of_two_numbers_in_space_is_the_only_error():
    (problem,) = problems("""
hfsim: 1
gravity: [0, -9.81]
materials: {steel: {density: 7850, youngs_modulus: 2.1e11, poisson_ratio: 0.3}}
sections: {flat: {shape: rectangle, width: 0.1, height: 0.02}}
bodies:
  arm: {type: beam, material: steel, section: flat, length: 2}
  hub: {type: rigid, mass: 1, inertia: [1, 1, 1]}
joints: {root: {type: fixed, between: [hub, arm.root]}}
solve: {duration: 1}
""")
    assert problem.path == "gravity" and problem.message.startswith("must be a list of 3 numbers")


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("damping", "'axial_damping' or 'bending_damping'"),
        ("damping_ratio", "'poisson_ratio', 'axial_damping' or 'bending_damping'"),
        ("poisson_ration", "'poisson_ratio'"),
        ("axial_dampin", "'axial_damping'"),
    ],
)
def test_all_keys_that_an_unknown_one_may_mean_are_named(key, meant):
    (problem,) = problems(SMALL.replace("density: 7800", f"density: 7800, {key}: 0.01"))
    assert (problem.path, problem.hint) == (f"materials.steel.{key}", f"did you mean {meant}?")


@pytest.mark.parametrize(
    ("key", "slip", "others"),
    [
        ("bodies: {", "bodys: {", 0),
        ("density: 7800", "densty: 7800", 0),
        ("between: [", "betwen: [", 0),
        ("duration: 2", "duraton: 2", 0),
        ("duration: 2", "time: 2", 1),
        ("density: 7800", "densty: 7800, density: 7800", 0),
    ],
)
def test_a_misspelt_key_is_told_once(key, slip, others):
    """What it is meant to be was told to be missing too."""
    assert key in SMALL
    found = problems(SMALL.replace(key, slip))
    assert [one.message for one in found] == [*["missing key"] * others, "unknown key"]


def test_marks_cover_the_wrong_text():
    for path in BROKEN:
        with pytest.raises(DeckError) as caught:
            load_deck(path)
        for one in caught.value.problems:
            lines = Path(one.file or path).read_text().splitlines()
            text = lines[one.line - 1]
            assert one.column >= 1 and one.column + one.width - 1 <= len(text) + 1
            assert one.width == 1 or text[one.column - 1] != " "


def test_message_shows_line_caret_and_remedy():
    text = SMALL.replace("length: 2", "lenght: 2")
    with pytest.raises(DeckError) as caught:
        parse_deck(text, "small.yaml")
    assert "small.yaml:5:59: error: bodies.arm.lenght: unknown key (did you mean 'length'?)" in str(
        caught.value
    )
    caret = next(line for line in str(caught.value).splitlines() if "^^^^^^" in line)
    assert caret.index("^") == len("    5 | ") + 58


def test_refusals_show_numbers_as_written():
    (problem,) = problems(SMALL.replace("length: 2", "length: -5 mm"))
    assert problem.message == "must be greater than 0, not '-5 mm'"
    (problem,) = problems(SMALL.replace("length: 2", "length: 2, elements: 1e30"))
    assert problem.message == "must be at most 100000, not 1e+30"


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("{between: [ground, arm.root]}", "missing key"),
        ("{type: revolut}", f"must be one of {', '.join(JOINTS)}, not 'revolut'"),
        ("{type: 3}", f"must be one of {', '.join(JOINTS)}, not 3"),
        ("[1]", "must be a map, not a list"),
    ],
)
def test_an_entry_must_say_of_which_kind_it_is(kind, message):
    (problem,) = problems(SMALL.replace("{type: revolute, between: [ground, arm.root]}", kind))
    assert (problem.message, problem.line) == (message, 6)


def test_choices_are_listed_once():
    (far,) = problems(SMALL.replace("duration: 2", "duration: 2, method: zzz"))
    (near,) = problems(SMALL.replace("duration: 2", "duration: 2, method: Radau"))
    assert far.message.startswith("must be one of gauss, radau, energy, gear,")
    assert (far.hint, near.hint) == ("", "did you mean 'radau'?")


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "empty"), ("# only a comment\n", "empty"), ("- 1\n", "map of keys"), ("a: \x07", "does not allow")],
)
def test_text_that_is_no_deck(text, message):
    assert message in problems(text)[0].message


def test_missing_and_undecodable_files(tmp_path):
    with pytest.raises(DeckError, match="cannot be read"):
        load_deck(tmp_path / "none.yaml")
    (tmp_path / "latin.yaml").write_bytes("name: Träger".encode("latin-1"))
    with pytest.raises(DeckError, match="UTF-8"):
        load_deck(tmp_path / "latin.yaml")


# Scalars


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("7e5", 7e5),
        ("1e-8", 1e-8),
        ("-.5", -0.5),
        ("12", 12),
        ("0x10", 16),
        ("true", True),
        ("on", "on"),
        ("yes", "yes"),
        ("no", "no"),
        ("12:30:45", "12:30:45"),
        ("2024-01-01", "2024-01-01"),
        ("1_000", "1_000"),
        ("~", None),
        (".inf", math.inf),
        ("-.inf", -math.inf),
    ],
)
def test_scalars_follow_yaml_1_2(text, value):
    assert scalar(text) == value
    assert type(scalar(text)) is type(value)


def test_on_is_a_key_and_nan_a_number():
    assert parse_source("on: 1").data == {"on": 1}
    assert math.isnan(scalar(".nan"))


def test_merge_keys_and_anchors():
    text = "base: &base {a: 1, b: 2}\nother: {<<: *base, b: 3}\nmore: {<<: [*base, {c: 4}]}\nsame: *base\n"
    source = parse_source(text)
    assert source.data["other"] == {"a": 1, "b": 3}
    assert source.data["more"] == {"a": 1, "b": 2, "c": 4}
    assert source.data["same"] == {"a": 1, "b": 2}
    assert source.mark(("other", "a")).line == 1
    assert source.mark(("other", "b")).line == 2
    assert not source.problems


def test_alias_of_itself_is_refused():
    assert any("contain itself" in one.message for one in parse_source("a: &a [1, *a]").problems)


# Units


def test_every_dimension_has_its_si_unit():
    assert UNITS.keys() == SI_UNITS.keys()
    for dimension, unit in SI_UNITS.items():
        if unit != "-":
            assert parse_quantity(f"1 {unit}", dimension) == 1.0


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("12 deg", "angle", math.radians(12)),
        ("7 GPa", "pressure", 7e9),
        ("120 rpm", "angular_velocity", 4 * math.pi),
        ("9 mm", "length", 0.009),
        ("1.1mm", "length", 0.0011),
        ("2.5 kg/m^3", "density", 2.5),
        ("3 kN", "force", 3000.0),
        ("1 ms", "time", 0.001),
        ("-1.33e4 mm^4", "second_moment", -1.33e-8),
        ("4 cm²", "area", 4e-4),
        ("2 N m/deg", "rotational_stiffness", 2 * 180 / math.pi),
        ("36 km/h", "velocity", 10.0),
        ("3 Nm", "moment", 3.0),
        ("3 N mm", "moment", 0.003),
        ("2 Nm s / rad", "rotational_damping", 2.0),
        ("5 %", "dimensionless", 0.05),
    ],
)
def test_units(text, dimension, value):
    assert parse_quantity(text, dimension) == pytest.approx(value, rel=1e-15)


WORDS = {
    **dict.fromkeys(("m", "s", "N", "Pa", "Hz", "rad", "1"), 1.0),
    **{"g": 1e-3, "t": 1e3, "l": 1e-3},
    **{"min": 60.0, "h": 3600.0, "in": 0.0254, "ft": 0.3048, "deg": math.pi / 180, "rev": 2 * math.pi},
    **{"%": 0.01, "°": math.pi / 180, "rpm": math.pi / 30, "g0": 9.80665},
}
PREFIXES = {"u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}


def product_of_words(unit):
    """N*mm2 by newtons and millimetres."""
    found = 1.0
    for sign, word, power in re.findall(r"([*/]?)([a-zA-Z%°]+0?|1)(\d?)", unit):
        value = WORDS[word] if word in WORDS else PREFIXES[word[0]] * WORDS[word[1:]]
        found *= value ** (int(power or 1) * (-1 if sign == "/" else 1))
    return found


@pytest.mark.parametrize("dimension", UNITS)
def test_units_are_the_products_of_their_words(dimension):
    found = {unit: parse_quantity(f"1 {unit}", dimension) for unit in UNITS[dimension]}
    assert found == pytest.approx({unit: product_of_words(unit) for unit in found}, rel=1e-14, abs=0.0)


@pytest.mark.parametrize("text", ["12 kg", "12", "mm", "1 m m", "1,5 m", "nan m", "١ m", ""])
def test_what_is_no_length(text):
    with pytest.raises(UnitError, match=r"must be a length \[m\]"):
        parse_quantity(text, "length")


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("1e3e3", "1e3e3"), ("12..5", "12..5"), ("12..5 cm", "12..5"), ("1e3e3m", "1e3e3"),
        ("1_000", "1_000"), ("1,5 m", "1,5"), ("1.2.3", "1.2.3"), ("3 4 cm", "3 4"), ("1e", "1e"),
        ("2e- m", "2e-"), ("1e2.5", "1e2.5"),
    ],
)  # fmt: skip
def test_what_is_no_number_is_not_told_as_a_unit(text, number):
    with pytest.raises(UnitError) as refused:
        parse_quantity(text, "length")
    assert str(refused.value) == f"must be a length [m], '{number}' is no number"


@pytest.mark.parametrize(
    ("text", "unit"), [("5 em", "em"), ("5eV", "eV"), ("2 1/s", "1/s"), ("1 m m", "m m")]
)
def test_what_is_no_unit_is_told_as_that(text, unit):
    with pytest.raises(UnitError, match=f"'{unit}' is (not a known unit|a unit of)"):
        parse_quantity(text, "length")


@pytest.mark.parametrize("length", ["1e9999 m", "1e9999", "1" + "0" * 400])
def test_numbers_too_large_are_refused(length):
    (problem,) = problems(SMALL.replace("length: 2", f"length: {length}"))
    assert problem.message == "must be finite, not inf"


# Laws

EXAMPLES = {
    "constant": {"value": 2.0},
    "constant_rate": {"rate": 3.0, "start": 1.0},
    "table": {"times": [0, 0.4, 0.9, 1.3, 2], "values": [0, 1, -1, 2, 0.5]},
    "smooth_step": {"from": 1.0, "to": 3.0, "start": 0.3, "end": 1.2},
    "spin_up": {"rate": 6.0, "time": 1.1},
    "sine": {"amplitude": 2.0, "frequency": 0.7, "phase": 0.3, "offset": 1.0},
    "expression": {"expression": "2 * sin(3 * t) * exp(-t / 2) + atan(t) ** 3 / (1 + t)"},
}


def build(kind, **data):
    return TypeAdapter(AngleLaw).validate_python({"type": kind, **data}).build()


@pytest.mark.parametrize("kind", LAWS)
def test_rate_and_acceleration_are_derivatives(kind):
    law = build(kind, **EXAMPLES[kind])
    t = np.linspace(0.05, 1.95, 38).reshape(2, 19)
    h = 1e-5
    assert law.value(t).shape == law.rate(t).shape == law.acceleration(t).shape == t.shape
    assert law.value(0.5).shape == ()
    np.testing.assert_allclose(law.rate(t), (law.value(t + h) - law.value(t - h)) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(law.acceleration(t), (law.rate(t + h) - law.rate(t - h)) / (2 * h), atol=1e-3)


def test_values_of_laws():
    assert build("constant", value=2).value(7.0) == 2.0
    assert build("constant_rate", rate=3, start=1).value(2.0) == 7.0
    table = build("table", **EXAMPLES["table"])
    np.testing.assert_allclose(
        table.value(EXAMPLES["table"]["times"]), EXAMPLES["table"]["values"], atol=1e-14
    )
    step = build("smooth_step", **EXAMPLES["smooth_step"])
    np.testing.assert_allclose(step.value([0.0, 0.3, 0.75, 1.2, 2.0]), [1, 1, 2, 3, 3], atol=1e-14)
    spin = build("spin_up", **EXAMPLES["spin_up"])
    np.testing.assert_allclose(spin.value([0.0, 1.1, 2.1]), [0, 3.3, 9.3], atol=1e-14)
    assert build("sine", **EXAMPLES["sine"]).value(0.0) == pytest.approx(1 + 2 * math.sin(0.3))


@pytest.mark.parametrize("times", [[0, 1], [0, 1, 3]])
def test_short_tables(times):
    law = build("table", times=times, values=[2 * t for t in times])
    assert law.value(0.5) == pytest.approx(1.0)


def test_laws_take_units_of_what_they_drive():
    angle, position = TypeAdapter(AngleLaw), TypeAdapter(PositionLaw)
    assert angle.validate_python("180 deg").build().value(0.0) == pytest.approx(math.pi)
    assert position.validate_python({"type": "constant_rate", "rate": "36 km/h"}).build().rate(0.0) == 10.0
    with pytest.raises(ValueError, match="must be a length"):
        position.validate_python("180 deg")
    with pytest.raises(ValueError, match="angular velocity"):
        angle.validate_python({"type": "spin_up", "rate": "3 Hz", "time": 1})


# Materials and sections


@pytest.mark.parametrize(
    "data",
    [
        {"area": 4e-4, "second_moment": 1.33e-8},
        {"shape": "rectangle", "width": 0.02, "height": 0.03},
        {"shape": "circle", "radius": 0.01},
        {"shape": "circle", "diameter": "20 mm"},
        {"shape": "tube", "outer_radius": 0.01, "inner_radius": 0.008},
    ],
)
def test_equivalent_rectangle_keeps_the_moments(data):
    section = TypeAdapter(SectionSpec).validate_python(data)
    assert section.width * section.height == pytest.approx(section.area, rel=1e-14)
    assert section.width * section.height**3 / 12 == pytest.approx(section.second_moment, rel=1e-14)


def test_section_formulas():
    def section(**data):
        return TypeAdapter(SectionSpec).validate_python(data)

    circle, tube = section(shape="circle", radius=2), section(shape="tube", outer_radius=2, inner_radius=1)
    assert (circle.area, circle.second_moment) == pytest.approx((4 * math.pi, 4 * math.pi))
    assert (tube.area, tube.second_moment) == pytest.approx((3 * math.pi, 15 * math.pi / 4))
    rectangle = section(shape="rectangle", width=2, height=3)
    assert rectangle.second_moment == pytest.approx(4.5)
    assert rectangle.bending == pytest.approx((2.0, 4.5))
    assert section(shape="rectangle", width=1e-3, height=1).torsion == pytest.approx(1e-9 / 3 * 0.99937)
    assert section(shape="rectangle", width=3.2024e-3, height=12.377e-3).torsion == pytest.approx(
        1.13399529628e-10, rel=1e-11
    )
    assert circle.torsion == pytest.approx(8 * math.pi)
    assert circle.shear(0.3) == pytest.approx((7.8 / 8.8,) * 2)
    thin = section(shape="tube", outer_radius=1, inner_radius=1 - 1e-9)
    assert thin.shear(0.3) == pytest.approx((2 * 1.3 / (4 + 0.9),) * 2)
    assert section(area=2, second_moment=3).bending == (3, 3)
    assert section(area=2, second_moment=3).torsion == 6


def test_what_follows_from_material_and_section_in_space():
    material = MaterialSpec(density=2.0, youngs_modulus=30.0, poisson_ratio=0.25, bending_damping=0.1)
    numbers = {"area": 2, "second_moments": [3, 4], "torsion_constant": 5, "shear_factors": [0.5, 0.25]}
    own = SectionProperties.of(material, TypeAdapter(SectionSpec).validate_python(numbers))
    assert own.stiffness == pytest.approx((60.0, 12.0, 6.0, 60.0, 90.0, 120.0))
    assert own.retardation == (0.0, 0.0, 0.0, 0.1, 0.1, 0.1)
    assert (own.mass_per_length, own.rotary_inertia) == (4.0, (6.0, 8.0))
    given = {
        "mass_per_length": 4.0,
        "rotary_inertia": [14, 6, 8],
        "axial_stiffness": 60.0,
        "shear_stiffness": [12, 6],
        "torsion_stiffness": "60 N*m^2",
        "bending_stiffness": [90, 120],
    }
    stated = SectionProperties.of(None, TypeAdapter(SectionSpec).validate_python(given))
    assert stated.stiffness == pytest.approx(own.stiffness)
    assert stated.rotary_inertia == own.rotary_inertia


def test_lame_constants_give_back_modulus_and_ratio():
    steel = MaterialSpec(density=7800, youngs_modulus=2.1e11, poisson_ratio=0.3)
    la, mu = steel.lame_lambda, steel.lame_mu
    assert mu * (3 * la + 2 * mu) / (la + mu) == pytest.approx(2.1e11)
    assert la / (2 * (la + mu)) == pytest.approx(0.3)


# Overrides


def test_overrides_reach_the_deck():
    overrides = ["bodies.arm.elements=8", "gravity=[0, -9.81]", "gravity.0=1", "bodies.arm.length=900 mm"]
    loaded = parse_deck(SMALL, "small.yaml", overrides)
    assert loaded.deck.bodies["arm"].elements == 8
    assert loaded.deck.bodies["arm"].length == 0.9
    assert loaded.deck.gravity == (1.0, -9.81)
    assert loaded.overrides == tuple(overrides)
    assert loaded.line_of("bodies.arm.elements") == 0
    assert loaded.line_of("bodies.arm.section") == 5


@pytest.mark.parametrize("text", [SMALL, SMALL + "initial:\noutput:\n"])
def test_overrides_add_maps_that_the_deck_leaves_out(text):
    overrides = ["initial.arm.angle=0.5", "initial.equilibrium=true", "output.shapes=true"]
    deck = parse_deck(text, "small.yaml", [*overrides, "joints.pin.friction.torque=2 N m"]).deck
    assert deck.motions["arm"].angle == 0.5 and deck.resting == ("arm",)
    assert deck.output.shapes and deck.joints["pin"].friction.torque == 2.0


@pytest.mark.parametrize(
    ("override", "path"),
    [
        ("bodies.arm.elements=0", "bodies.arm.elements"),
        ("bodies.arm.elments=8", "bodies.arm.elments"),
        ("bodies.leg.elements=8", "bodies.leg.elements"),
        ("initial.leg.angle=8", "initial.leg"),
        ("springs.coil.stiffness=8", "springs.coil.stiffness"),
        ("bodies.arm.length.x=8", "bodies.arm.length.x"),
        ("joints.pin.between.2=arm", "joints.pin.between.2"),
        ("joints.pin.between.1=leg", "joints.pin.between.1"),
        ("solve.model=automatic", "solve.model"),
        ("solve.model=[exact", "solve.model"),
        ("bodies.arm={type: beam, type: rigid}", "bodies.arm"),
        ("solve.duration=.nan", "solve.duration"),
        ("solve.duration", "solve.duration"),
    ],
)
def test_bad_overrides_are_placed_at_set(override, path):
    (problem,) = problems(SMALL, [override])
    assert isinstance(problem, OverrideProblem)
    assert (problem.path, problem.line) == (path, 0)
    with pytest.raises(DeckError, match=re.escape(f"--set: error: {path}: ")):
        parse_deck(SMALL, "small.yaml", [override])


# Whole decks


@pytest.mark.parametrize("path", CASES, ids=by_stem)
def test_case_loads_and_comes_back_from_its_resolved_form(path):
    loaded = load_deck(path)
    assert loaded.deck.name == path.stem
    again = parse_deck(yaml.safe_dump(loaded.deck.resolved(), sort_keys=False))
    assert again.deck == loaded.deck
    assert again.deck_sha256 == loaded.deck_sha256
    assert load_deck(path, ["solve.tolerance=1.23e-5"]).deck_sha256 != loaded.deck_sha256


def test_resolved_form_keeps_laws_shapes_and_options():
    text = SMALL.replace("{area: 4e-4, second_moment: 1.33e-8}", "{shape: circle, diameter: 20 mm}") + (
        "ground: {points: {wall: [0, 1]}}\n"
        "loads: {push: {type: force, at: arm.tip, force: [0, 1 kN], follower: true, law: {type: smooth_step, "
        "from: 0, to: 1, start: 0, end: 1}}, twist: {type: moment, at: arm, moment: 2, law: 0.5}}\n"
        "springs: {coil: {type: two_point, between: [ground.wall, arm.tip], stiffness: 10}}\n"
        "initial: {arm: {angle: 12 deg, position: [0, 0]}}\n"
    )
    loaded = parse_deck(text)
    again = parse_deck(yaml.safe_dump(loaded.deck.resolved()))
    assert again.deck == loaded.deck
    assert again.deck_sha256 == loaded.deck_sha256


def test_defaults():
    deck = parse_deck(SMALL, "folder/small.yaml").deck
    assert deck.name == "small"
    assert deck.dimension == 2
    assert deck.interval == deck.output.interval == 0.01
    assert deck.channels == (
        *("arm.tip.x", "arm.tip.y", "arm.tip.deflection", "arm.angle", "arm.angular_velocity"),
        "energy.total",
    )
    assert (deck.solve.model, deck.solve.tolerance, deck.solve.rho_inf) == ("exact", 1e-6, 0.8)
    assert deck.bodies["arm"].elements == 4


def test_keys_whose_entries_are_commented_out():
    deck = parse_deck(SMALL + "springs:\n  # coil: {}\ninitial:\noutput:\n").deck
    assert deck.springs == {}


def test_numbers_that_cannot_be_told_from_their_unit_are_si():
    assert parse_deck(SMALL.replace("length: 2", "length: 2000 mm")).deck == parse_deck(SMALL).deck


def test_problem_of_a_later_stage_names_the_line():
    loaded = parse_deck(SMALL, "small.yaml")
    error = loaded.problem("bodies.arm.length", "does not fit", "make it shorter")
    assert "small.yaml:5:67: error: bodies.arm.length: does not fit (make it shorter)" in str(error)
    assert loaded.line_of("joints.pin") == 6
    assert loaded.line_of("joints.pin.angle") == 6


def test_deck_cannot_be_changed():
    deck = parse_deck(SMALL).deck
    with pytest.raises(ValueError, match="frozen"):
        deck.solve.duration = 3.0


def test_decks_do_not_import_heavy_packages():
    import subprocess
    import sys

    code = "import sys, hfsim.scene.schema; print([m for m in ('scipy', 'matplotlib') if m in sys.modules])"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert output.strip() == "[]"


def test_texts_that_are_read_again_come_back_as_they_were():
    first, second = parse("a: {b: [1, 2]}"), parse("a: {b: [1, 2]}")
    first.data["a"]["b"].append(3)
    first.keys.clear()
    assert second.data == parse("a: {b: [1, 2]}").data == {"a": {"b": [1, 2]}}
    assert second.keys == parse("a: {b: [1, 2]}").keys != {}


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("output.channels=[]", ["must have at least 1 entry, not none"]),
        (f"output.snapshots={[0.001] * 21}", ["must have at most 20 entries, not 21"]),
        ("output.channels=[5, 6]", ["must be text, not 6", "must be text, not 5"]),
        ("solve.target_channels=[]", ["must have at least 1 entry, not none"]),
        ("bodies.b1.axis={points: [[0, 0]]}", ["must have at least 2 entries, not 1"]),
        ("output.channels=", ["has no value"]),
        ("initial.b1.angle=", ["has no value"]),
        ("name=", ["has no value"]),
        ("gravity= ", ["has no value"]),
    ],
)
def test_lists_that_are_too_short_and_values_left_out_are_told_in_deck_words(override, told):
    with pytest.raises(DeckError) as refusal:
        load_deck(HERE.parents[1] / "cases/pendulum.yaml", [override])
    assert sorted(one.message for one in refusal.value.problems) == sorted(told)


@pytest.mark.parametrize("key", ["gravity", "name"])
def test_a_value_left_empty_in_a_deck_is_refused_but_overrides_take_it_out(key):
    text = (HERE.parents[1] / "cases/pendulum.yaml").read_text()
    line = next(one for one in text.splitlines() if one.startswith(f"{key}:"))
    with pytest.raises(DeckError, match=f"{key}: must be .*, not empty"):
        parse_deck(text.replace(line, f"{key}:"))
    assert parse_deck(text, overrides=[f"{key}=null"]).deck.dimension == 2


@pytest.mark.parametrize(
    ("path", "left"),
    [
        ("initial.steady", {"hub": {"angle": 0.5}}),
        ("initial.hub", {"steady": {"body": "hub", "rate": 2.0}}),
        ("initial.hub.angle", {"hub": {}, "steady": {"body": "hub", "rate": 2.0}}),
        ("initial", None),
    ],
)
def test_null_takes_an_entry_out(path, left):
    data = yaml.safe_load(SMALL)
    data |= {"bodies": {"hub": {"type": "rigid", "mass": 1, "inertia": 1}}, "materials": {}, "sections": {}}
    data["joints"] = {"pin": {"type": "revolute", "between": ["ground", "hub"]}}
    data["initial"] = {"hub": {"angle": 0.5}, "steady": {"body": "hub", "rate": 2.0}}
    changed = parse_deck(yaml.safe_dump(data), overrides=[f"{path}=null", "solve.step=null"])
    assert changed.source.data.get("initial") == left
    assert changed.deck.steady is None or path != "initial.steady"


def test_null_takes_nothing_out_that_no_deck_has():
    with pytest.raises(DeckError) as caught:
        parse_deck(SMALL, overrides=["initial.stedy=null", "joints.pni=null", "solve.stpe=null"])
    told = {one.message for one in caught.value.problems}
    assert told == {f"there is no {one} in the deck" for one in ("initial.stedy", "joints.pni", "solve.stpe")}


@pytest.mark.parametrize(
    "path",
    [
        "initial.steady", "initial.equilibrium", "initial.steady.rate", "initial.arm", "initial.arm.angle",
        "initial.pin", "initial.pin.angular_velocity",
        "solve.method", "output.snapshots", "joints.pin.stops.stiffness", "verify.grade", "sweep.vary",
    ],
)  # fmt: skip
def test_null_is_harmless_where_there_is_nothing_to_take_out(path):
    deck = parse_deck(SMALL, overrides=[f"{path}=null"])
    assert deck.source.data == parse_deck(SMALL).source.data


def test_null_is_refused_under_names_and_keys_that_no_deck_has():
    wrong = ["initial.b3", "initial.b3.angle", "initial.steady.rte", "sweep.vari", "sweep.vary.b1"]
    with pytest.raises(DeckError) as caught:
        parse_deck(SMALL, overrides=[f"{path}=null" for path in wrong])
    assert {one.path for one in caught.value.problems} == set(wrong)


def test_a_key_without_a_value_is_refused_but_not_one_of_a_map():
    left = SMALL.replace("solve: {", "solve: {step: , ")
    assert left != SMALL
    with pytest.raises(DeckError) as caught:
        parse_deck(left)
    (problem,) = caught.value.problems
    assert (problem.path, problem.message) == ("solve.step", "is empty") and problem.line
    parse_deck(left.replace("step: ,", "step: null,"))
    parse_deck(left, overrides=["solve.step=0.01"])
    parse_deck(f"{SMALL}springs:\n  # coil: {{}}\n")


@pytest.mark.parametrize(
    ("old", "new", "column", "message", "hint"),
    [
        ("length: 2", "length: 1,5 m", 67, "'1,5 m' is read as two entries", "did you mean '1.5 m'?"),
        ("length: 2", "length: 1,5", 67, "'1,5' is read as two entries", "did you mean '1.5'?"),
        (
            "solve: {duration: 2}", "solve:\n  duration: 1,5 s", 13,
            "must be a time [s], '1,5' is no number", "did you mean '1.5 s'?",
        ),
    ],
)  # fmt: skip
def test_a_decimal_comma_is_told(old, new, column, message, hint):
    (problem,) = problems(SMALL.replace(old, new))
    assert (problem.column, problem.message, problem.hint) == (column, message, hint)


def test_what_is_no_decimal_comma_is_read_or_told_as_before():
    assert parse_source("map: {a: 1, b: 2,c: 3}\nlist: [1,5, 2]").data["list"] == [1, 5, 2]
    (problem,) = problems(SMALL.replace("length: 2", "length: 2, 5 m"))
    assert (problem.path, problem.message) == ("bodies.arm.5 m", "unknown key")


@pytest.mark.parametrize(
    ("key", "text", "told"),
    [
        ("position", "1.2+0.1*sin(3*t)", True),
        ("position", "2 * t", True),
        ("position", "t/2", True),
        ("position", "cos( 1 )", True),
        ("angle", "t", True),
        ("angle", "3 t", False),
        ("position", "1.2 mmm", False),
        ("position", "1/3 m", False),
    ],
)
def test_an_expression_in_the_place_of_a_law_is_told_how_to_be_one(key, text, told):
    driven = SMALL.replace("joints: {", "joints: {d: {type: driver, between: [ground, arm], KEY: LAW}, ")
    with pytest.raises(DeckError) as caught:
        parse_deck(driven.replace("KEY", key).replace("LAW", f"'{text}'"))
    (problem,) = caught.value.problems
    assert problem.path == f"joints.d.{key}" and problem.line == 6
    assert (problem.hint == f'{{expression: "{text}"}}') == told
    assert ("or a law, not the text" in problem.message) == told
    if told:
        parse_deck(driven.replace("KEY", key).replace("LAW", problem.hint))
