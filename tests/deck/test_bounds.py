"""Decks that are too deep, too large or beyond all that is physical are refused in time, with their place."""

import time

import pytest

from hfsim.errors import DeckError
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import check

SMALL = """
hfsim: 1
materials: {steel: {density: 7800, youngs_modulus: 2.1e11}}
sections: {bar: {area: 4e-4, second_moment: 1.33e-8}}
bodies: {arm: {type: beam, material: steel, section: bar, length: 2}}
joints: {pin: {type: revolute, between: [ground, arm.root]}}
solve: {duration: 2}
"""


def refusal(text, overrides=()):
    begin = time.process_time()
    with pytest.raises(DeckError) as caught:
        check(parse_deck(text, "small.yaml", overrides))
    assert time.process_time() - begin < 5.0
    assert all(one.line for one in caught.value.problems) or overrides
    assert len(str(caught.value)) < 100_000
    return caught.value


# Depth and size


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
@pytest.mark.parametrize("depth", [100, 3000, 50_000])
def test_what_is_nested_too_deeply_ends_no_interpreter(opening, depth):
    (problem,) = refusal(SMALL + "ground:\n " + opening * depth).problems
    assert "within one another" in problem.message
    assert problem.line == 9


def test_aliases_that_multiply_are_refused():
    lines = ["x0: &x0 [1, 2, 3]", *(f"x{k}: &x{k} [{', '.join([f'*x{k - 1}'] * 10)}]" for k in range(1, 12))]
    (problem,) = refusal("\n".join(lines) + SMALL).problems
    assert "entries, aliases counted in full" in problem.message


def test_merges_that_multiply_are_refused():
    lines = ["x0: &x0 {a: 1}", *(f"x{k}: &x{k} {{<<: [*x{k - 1}, *x{k - 1}], b: 1}}" for k in range(1, 40))]
    assert "entries" in refusal("\n".join(lines) + SMALL).problems[0].message


def test_maps_that_merge_themselves_are_refused():
    assert any("contain itself" in one.message for one in refusal(SMALL + "ground: &g {<<: *g}").problems)


def test_aliases_that_are_used_often_are_fine():
    many = "".join(f"  arm{k}: *arm\n" for k in range(200))
    deck = parse_deck(
        SMALL.replace("bodies: {arm: {", "bodies:\n  arm: &arm {").replace("2}}\n", "2}\n" + many)
    )
    assert len(deck.deck.bodies) == 201


def test_a_deck_of_many_megabytes_is_refused(tmp_path):
    path = tmp_path / "large.yaml"
    path.write_text(SMALL + "# " + "x" * 5_000_000)
    with pytest.raises(DeckError, match=r"large.yaml:1:1: error: has \d+ characters"):
        load_deck(path)


# Thousands of mistakes

MANY = 10_000


@pytest.mark.parametrize(
    "text",
    [
        "".join(f"key{k}: 1\n" for k in range(MANY)),
        "name: x\n" * MANY,
        "springs: {" + ", ".join(f"s{k}: {{type: x}}" for k in range(MANY)) + "}\n",
        "output: {channels: [" + ", ".join(f"arn.tip.x{k}" for k in range(MANY)) + "]}\n",
        "initial: {" + ", ".join(f"body{k}: {{angle: 1}}" for k in range(MANY)) + "}\n",
    ],
    ids=["unknown keys", "one key", "entries in one line", "channels", "names"],
)
def test_thousands_of_mistakes_are_told_in_brief(text):
    error = refusal(SMALL + text)
    assert f"more\n{len(error.problems)} errors. Nothing was run." in str(error)
    assert "... and " in str(error)


def test_thousands_of_misspelt_names_among_thousands():
    bodies = "".join(f"  body{k}: {{type: rigid, mass: 1, inertia: 1}}\n" for k in range(3000))
    loads = "".join(f"  l{k}: {{type: moment, at: bodi{k}, moment: 1}}\n" for k in range(3000))
    error = refusal(f"hfsim: 1\nsolve: {{duration: 1}}\nbodies:\n{bodies}loads:\n{loads}")
    assert "at least" in str(error)
    assert "there is no body 'bodi0' (did you mean 'body0'?)" in str(error)


def test_long_lines_and_names_are_shown_in_part():
    error = refusal(SMALL.replace("section: bar", " " * 90_000 + "section: " + "x" * 90_000))
    lines = str(error).splitlines()
    assert max(map(len, lines)) < 1000
    mark = next(line for line in lines if "^^^" in line)
    assert lines[lines.index(mark) - 1][mark.index("^")] == "x"


# Numbers


@pytest.mark.parametrize("digits", ["9" * 5000, "-" + "9" * 400, "0x" + "f" * 5000, "0o" + "7" * 5000])
@pytest.mark.parametrize("entry", ["length: 2", "duration: 2", "density: 7800", "hfsim: 1"])
def test_numbers_of_thousands_of_digits(digits, entry):
    (problem, *_) = refusal(SMALL.replace(entry, f"{entry.split(':')[0]}: {digits}")).problems
    assert len(problem.message) < 200


def test_text_of_thousands_of_digits_is_no_quantity():
    assert "must be a length" in str(refusal(SMALL.replace("length: 2", f"length: '{'9' * 100_000}\n x'")))


@pytest.mark.parametrize(
    ("entry", "other", "path", "message"),
    [
        ("area: 4e-4", "area: 1e-300", "sections.bar.area", "must be at least 1e-24 m^2, not 1e-300"),
        ("area: 4e-4", "area: 1e200", "sections.bar.area", "must be at most 1e+24 m^2, not 1e+200"),
        ("second_moment: 1.33e-8", "second_moment: 1e-300", "sections.bar.second_moment", "1e-48 m^4"),
        (
            "area: 4e-4, second_moment: 1.33e-8",
            "shape: circle, radius: 1e200",
            "sections.bar.radius",
            "1e+12 m",
        ),
        (
            "area: 4e-4, second_moment: 1.33e-8",
            "shape: circle, radius: 1e-300",
            "sections.bar.radius",
            "1e-12 m",
        ),
        ("youngs_modulus: 2.1e11", "youngs_modulus: 1e200 GPa", "materials.steel.youngs_modulus", "1e+18 Pa"),
        ("length: 2", "length: 1e300", "bodies.arm.length", "must be at most 1e+12 m"),
        ("duration: 2", "duration: 1e-300", "solve.duration", "must be at least 1e-18 s"),
        (
            "hfsim: 1",
            "hfsim: 1\ngravity: [0, -1e300]",
            "gravity.1",
            "must be at least -1e+15 m/s^2, not -1e+300",
        ),
    ],
)
def test_numbers_beyond_all_that_is_physical(entry, other, path, message):
    (problem, *_) = refusal(SMALL.replace(entry, other)).problems
    assert problem.path == path
    assert message in problem.message


@pytest.mark.parametrize("law", ["{type: smooth_step, from: 0, to: 1e308, start: 0, end: 1e-9}", "1e308"])
def test_laws_beyond_all_that_is_physical(law):
    load = f"loads: {{push: {{type: force, at: arm.tip, force: [0, 1], law: {law}}}}}"
    assert "must be at most 1e+24, not 1e+308" in str(refusal(SMALL + load))


def test_an_axis_that_is_next_to_nothing_is_zero():
    slide = SMALL.replace("revolute,", "prismatic, axis: [1e-300, 0],")
    assert "an axis cannot be zero" in str(refusal(slide))


def test_the_wall_of_a_tube_may_be_as_thin_as_numbers_go():
    tube = "shape: tube, outer_radius: 0.1, inner_radius: 0.09999999999999999"
    loaded = parse_deck(SMALL.replace("area: 4e-4, second_moment: 1.33e-8", tube))
    assert loaded.deck.properties("arm").bending_stiffness > 0.0


# Names


@pytest.mark.parametrize("name", ["a" * 300, "é" * 60, "-rf", '"\\e[31m"', '"a\\nb"', "a/b"])
def test_names_that_no_folder_should_have(name):
    (problem,) = refusal(f"name: {name}\n{SMALL}").problems
    assert (problem.path, problem.line) == ("name", 1)


def test_names_of_bodies_have_an_end():
    long = "a" * 300
    (problem, *_) = refusal(SMALL.replace("arm", long)).problems
    assert "cannot be a name" in problem.message
    assert len(problem.message) < 100


def test_text_that_is_not_utf8_has_a_place(tmp_path):
    path = tmp_path / "latin.yaml"
    path.write_bytes(b"hfsim: 1\nname: Tr\xe4ger\n")
    with pytest.raises(DeckError, match=r"latin.yaml:2:9: error: is not UTF-8 text \(byte 17\)"):
        load_deck(path)


@pytest.mark.parametrize(
    "override", ["gravity." + "9" * 5000 + "=1", "name=" + "x" * 300, "bodies=" + "[" * 50_000]
)
def test_overrides_are_bound_likewise(override):
    assert len(str(refusal(SMALL, [override]))) < 2000


GIVEN = """
hfsim: 1
gravity: [0, 0, 0]
sections:
  bar: {mass_per_length: 0.4992, rotary_inertia: [ALONG, 2.6624e-6, 2.6624e-6], axial_stiffness: 13.25e6,
        shear_stiffness: [4.22e6, 4.22e6], torsion_stiffness: 45.84, bending_stiffness: [70.66, 70.66]}
bodies: {b: {type: beam, section: bar, length: 0.12}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
solve: {duration: 1}
"""


def test_moments_of_inertia_of_a_printed_table_may_be_rounded():
    """Refused are sums that are seen to be others in the message."""
    parse_deck(GIVEN.replace("ALONG", "5.325e-6"))
    (problem,) = refusal(GIVEN.replace("ALONG", "5.33e-6")).problems
    assert "5.33e-06 kg m" in problem.message and "5.3248e-06 kg m" in problem.message
