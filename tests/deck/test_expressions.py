"""Expressions in place of numbers, parameters, and laws of time that are expressions."""

import math
import re
import time

import numpy as np
import pytest
import yaml
from deck.test_deck import SMALL
from pydantic import TypeAdapter

from hfsim.deck.expressions import FUNCTIONS, LONGEST, ExpressionError, bound, evaluated, parsed, substituted
from hfsim.deck.functions_of_time import OF_TIME
from hfsim.deck.law_specs import AngleLaw, ScaleLaw
from hfsim.deck.units import UNITS, words_of_units
from hfsim.errors import DeckError
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate


def value_of(text, **values):
    return evaluated(bound(parsed(text), values), {})


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3 - 4 / 8", 6.5),
        ("2 ** 3 ** 2", 512.0),
        ("-2 ** 2", -4.0),
        ("2 ** -1", 0.5),
        ("2 - 3 - 4", -5.0),
        ("8 / 4 / 2", 1.0),
        ("2 * (a + 1)", 8.0),
        ("- -a", 3.0),
        ("+a", 3.0),
        ("sin(pi / 6) + cos(tau) + log(e)", 2.5),
        ("3 cm + 2mm", 0.032),
        ("sin(30 deg)", 0.5),
        ("7 GPa * 1 mm ** 2", 7000.0),
        ("min(3, a, 1) + max(2, 5) + abs(-1) + hypot(3, 4)", 12.0),
        ("factorial(5) + log(8, 2) + atan2(0, 1) + floor(2.7) + pow(2, 3)", 133.0),
        ("1e3 + .5 + 2.", 1002.5),
    ],
)
def test_values(text, value):
    assert value_of(text, a=3.0) == pytest.approx(value, rel=1e-15)
    tree = parsed(text)
    assert evaluated(parsed(substituted(text, tree, {"a": 3.0})), {}) == value_of(text, a=3.0)


def test_substituted_numbers_keep_their_signs():
    text = "2 ** a - a * -a"
    assert substituted(text, parsed(text), {"a": -3.0}) == "2 ** (-3.0) - (-3.0) * -(-3.0)"


def test_functions_are_those_of_math():
    for name, (least, _, function) in FUNCTIONS.items():
        if name == "factorial":
            continue
        theirs = getattr(math, name, None) or {"abs": abs, "max": max, "min": min}[name]
        args = {"max": ([1.0, 3.0],), "min": ([1.0, 3.0],), "atanh": (0.5,)}.get(name, (1.0, 3.0)[:least])
        assert function(*args) == pytest.approx(theirs(*args))
    assert not {name for name in dir(math) if not name.startswith("_")} - set(FUNCTIONS) - {
        *("pi", "e", "tau", "inf", "nan", "comb", "perm", "gcd", "lcm", "isqrt", "dist", "fsum", "prod"),
        *("frexp", "modf", "ldexp", "isclose", "isfinite", "isinf", "isnan", "nextafter", "ulp", "sumprod"),
        *("fma",),
    }


def test_a_unit_has_one_size_whatever_it_measures():
    for unit, size in words_of_units().items():
        sizes = {float(known[unit]) for known in UNITS.values() if unit in known}
        assert sizes == {size}


HOSTILE = [
    "__import__('os')",
    "__import__",
    "__builtins__",
    "().__class__",
    "(1).real",
    "a.__class__",
    "a[0]",
    "[1, 2][0]",
    "{1: 2}",
    "{1}",
    "[x for x in (1, 2)]",
    "sum(x for x in (1, 2))",
    "lambda: 1",
    "(lambda: 1)()",
    "sin(1)(2)",
    "sin",
    "f'{a}'",
    "'a'",
    '\\"a\\"',
    "b'a'",
    "(a := 3)",
    "a = 3",
    "sin(x=1)",
    "sin(*a)",
    "max(**a)",
    "sin(",
    "eval('1')",
    "exec('1')",
    "open('x')",
    "print(1)",
    "getattr(a, b)",
    "type(1)",
    "compile('1')",
    "1 if a else 2",
    "a and 2",
    "not a",
    "a < 2",
    "a == 2",
    "a @ 2",
    "a // 2",
    "a % 2",
    "a & 2",
    "a | 2",
    "a << 900000000",
    "~a",
    "await a",
    "yield a",
    "1j",
    "0x10",
    "1_000",
    "...",
    "1;2",
    "a\\n1",
    "import os",
    "9**9**9**9",
    "10**400",
    "2**2**2**2**2**2",
    "1e999",
    "9" * 400,
    "factorial(10**8)",
    "factorial(200)",
    "factorial(2.5)",
    "perm(10**8, 10**7)",
    "comb(10**8, 10**7)",
    "gcd(2, 4)",
    "gamma(1e3)",
    "exp(1e9)",
    "inf",
    "nan",
    "inf - inf",
    "(" * 100 + "1" + ")" * 100,
    "-" * 500 + "1",
    "sin(" * 100 + "1" + ")" * 100,
    "2**" * 200 + "1",
    "+".join(["1"] * LONGEST),
    " " * 3000 + "1",
    "ѕin(1)",
    "ｓｉｎ(1)",
    "π",
    "２ + ２",
    "١",
    "a\u200b",
    "a−1",
    "2×3",
    "a²",
    "$a",
    "${a}",
    "os.system('true')",
    "#",
    "",
    " ",
    "()",
    "sin()",
    "1 2",
    "2 a",
    ",",
    "\\\\",
]


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_expressions_are_refused_with_their_place_in_no_time(text):
    deck = f'parameters:\n  a: 2\n  b: "${{{text}}}"\n' + SMALL.replace(
        "length: 2", f'length: "${{{text}}}"'
    )
    begin = time.process_time()
    with pytest.raises(DeckError) as caught:
        parse_deck(deck, "small.yaml")
    assert time.process_time() - begin < 5.0  # what they ask for would take for ever
    problems = caught.value.problems
    assert [(one.path, one.line) for one in problems] == [("parameters.b", 3), ("bodies.arm.length", 8)]
    lines = deck.splitlines()
    for one in problems:
        assert one.column + one.width - 1 <= len(lines[one.line - 1]) + 1
        assert f"small.yaml:{one.line}:{one.column}: error: {one.path}: " in str(caught.value)


@pytest.mark.parametrize("text", [one for one in HOSTILE if "a" not in one or "(" in one])
def test_hostile_laws_are_refused(text):
    law = f'{{type: force, at: arm.tip, force: [0, 1], law: {{expression: "{text}"}}}}'
    deck = SMALL + f"loads: {{push: {law}}}\n"
    with pytest.raises(DeckError) as caught:
        parse_deck(deck, "small.yaml")
    assert {(one.path, one.line) for one in caught.value.problems} == {("loads.push.law.expression", 8)}


def test_any_text_is_a_number_or_is_refused():
    """Pieces of expressions in a random order cause nothing but an `ExpressionError`."""
    random = np.random.default_rng(1)
    pieces = ["1", "2.", "a", "t", "(", ")", "+", "-", "*", "/", "**", "sin", "max", ",", "cm", "e", "$", " "]
    good = 0
    for _ in range(3000):
        text = "".join(random.choice(pieces, random.integers(1, 9)))
        try:
            good += math.isfinite(value_of(text, a=3.0, t=0.0))
        except (ExpressionError, KeyError):
            continue
    assert good > 100


# Parameters ------------------------------------------------------------------------------------------

SWING = """
hfsim: 1
parameters:
  half: "${length / 2}"
  length: 2.0
  rate: 120 rpm
  angle: 30
  n: "${3 + 1}"
gravity: [0, "${-9.81 * cos(angle * pi / 180)}"]
materials: {steel: {density: 7800, youngs_modulus: 2.1e11}}
sections: {bar: {area: "${2 * 200} mm^2", second_moment: 1.33e-8}}
bodies:
  arm: {type: beam, material: steel, section: bar, length: "${length}", elements: "${n}",
    points: {mid: ["${half}", "${3 cm - 30 mm}"]}}
joints: {pin: {type: revolute, between: [ground, arm.root]}}
initial: {arm: {angle: "${angle} deg", angular_velocity: "${rate / 4}"}}
loads: {push: {type: force, at: arm.mid, force: [0, 1], law: {expression: "n * sin(rate * t) * exp(-t)"}}}
solve: {duration: "${1 / 4}"}
"""
PLAIN = """
hfsim: 1
gravity: [0, -8.495709211125344]
materials: {steel: {density: 7800, youngs_modulus: 2.1e11}}
sections: {bar: {area: 4e-4, second_moment: 1.33e-8}}
bodies: {arm: {type: beam, material: steel, section: bar, length: 2, elements: 4, points: {mid: [1.0, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, arm.root]}}
initial: {arm: {angle: "30 deg", angular_velocity: 3.141592653589793}}
loads:
  push:
    {type: force, at: arm.mid, force: [0, 1], law: {expression: "4.0 * sin(12.566370614359172 * t)
      * exp(-t)"}}
solve: {duration: 0.25}
"""


def test_a_deck_with_parameters_is_that_with_their_values():
    loaded, plain = parse_deck(SWING, "swing.yaml"), parse_deck(PLAIN, "swing.yaml")
    assert loaded.deck == plain.deck
    assert loaded.deck_sha256 == plain.deck_sha256
    resolved = loaded.deck.resolved()
    assert "parameters" not in resolved
    assert resolved["bodies"]["arm"]["elements"] == 4
    again = parse_deck(yaml.safe_dump(resolved))
    assert (again.deck, again.deck_sha256) == (loaded.deck, loaded.deck_sha256)


def test_what_depends_on_a_parameter_follows_an_override():
    loaded = parse_deck(SWING, "swing.yaml", ["parameters.length=3", "parameters.n='${half * 4}'"])
    arm = loaded.deck.bodies["arm"]
    assert (arm.length, arm.elements, arm.points["mid"]) == (3.0, 6, (1.5, 0.0))
    assert loaded.deck_sha256 != parse_deck(SWING, "swing.yaml").deck_sha256
    direct = parse_deck(SWING, "swing.yaml", ["bodies.arm.length=${2 * length}"])
    assert direct.deck.bodies["arm"].length == 4.0


def test_a_parameter_that_is_set_and_nothing_uses_is_refused():
    with pytest.raises(DeckError) as caught:
        parse_deck(SWING, "swing.yaml", ["parameters.lenght=3"])
    (problem,) = caught.value.problems
    assert (problem.path, problem.hint) == ("parameters.lenght", "did you mean 'length'?")
    assert "--set: error: parameters.lenght: no expression uses it" in str(caught.value)
    used = parse_deck(SWING, "swing.yaml", ["parameters.own=3", "bodies.arm.length=${own}"])
    assert used.deck.bodies["arm"].length == 3.0


@pytest.mark.parametrize(
    ("value", "what", "hint"),
    [
        ("20 RPM", "'RPM' is not a known unit", "did you mean 'rpm'?"),
        ("400 1/min", "'1/min' is not a known unit", "did you mean 'min', 'rev/min' or '1/s'?"),
        ("1,5 m", "'1,5' is no number", "did you mean '1.5 m'?"),
        ("2 * 3", "not '2 * 3'", 'a unit, or "${2 * 3}"'),
    ],
)
def test_a_parameter_of_an_unknown_unit_is_told_the_known_ones(value, what, hint):
    with pytest.raises(DeckError) as caught:
        parse_deck(SWING, "swing.yaml", [f"parameters.length='{value}'"])
    (problem,) = caught.value.problems
    assert (problem.message, problem.hint) == (f"must be a number, {what}", hint)


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("{own}", "own must be a whole number, not 0.5", '"${own}" is its value'),
        ("{{own}}", "own must be a whole number, not 0.5", '"${own}" is its value'),
        ("{far}", "far must be a whole number, not 0.8 m", '"${far}" is its value'),
        ("$own", "must be a length [m], not '$own'", '"${own}" is the value of a parameter'),
        ("$(own)", "must be a length [m], not '$(own)'", '"${own}" is the value of a parameter'),
    ],
)
def test_a_parameter_written_as_elsewhere_is_told_how_to_write_it(text, message, hint):
    with pytest.raises(DeckError) as caught:
        parse_deck(f"parameters: {{own: 0.5, far: 80 cm}}{SMALL}".replace("length: 2", f'length: "{text}"'))
    (problem,) = caught.value.problems
    assert (problem.path, problem.message, problem.hint) == ("bodies.arm.length", message, hint)


@pytest.mark.parametrize("override", ["parameters.n=${1 / 0}", "parameters.n=x", "bodies.arm.length=${m}"])
def test_wrong_expressions_of_overrides_are_placed_at_set(override):
    with pytest.raises(DeckError) as caught:
        parse_deck(SWING, "swing.yaml", [override])
    (problem,) = caught.value.problems
    assert f"--set: error: {override.partition('=')[0]}: " in str(caught.value)
    assert problem.line == 0


def test_errors_of_expressions_hide_no_others_and_follow_from_one_another_in_silence():
    text = SWING.replace("length: 2.0", 'length: "${1 / 0}"').replace("section: bar", "section: baar")
    with pytest.raises(DeckError) as caught:
        parse_deck(text)
    assert [one.path for one in caught.value.problems] == ["parameters.length", "bodies.arm.section"]


def test_long_chains_of_parameters():
    chain = "\n".join(f'  p{k}: "${{p{k + 1} + 1}}"' for k in range(3000))
    small = SMALL.replace("length: 2", 'length: "${p0}"')
    deck = parse_deck(f"parameters:\n{chain}\n  p3000: 0{small}").deck
    assert deck.bodies["arm"].length == 3000.0


def test_marks_of_folded_text_stay_in_their_lines():
    text = SMALL.replace("length: 2", 'length: "${1 +\n    2 / 0}"')
    with pytest.raises(DeckError, match=r"small.yaml:5:67: error: bodies.arm.length: a division by zero"):
        parse_deck(text, "small.yaml")


def test_decks_without_expressions_are_read_without_them():
    import subprocess
    import sys

    code = "import sys; from hfsim.scene.loading import parse_deck as p; p(sys.argv[1]); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, SMALL], capture_output=True, text=True, check=True)
    new = ("parameters", "expressions", "expression_law", "including", "tables")
    assert not {f"hfsim.deck.{one}" for one in new} & set(done.stdout.split())


def test_negative_values_fit_into_the_deepest_law():
    law = "(" * 38 + "a" + ")" * 38
    push = f"{{type: force, at: arm.tip, force: [0, 1], law: {{expression: '{law}'}}}}"
    deck = parse_deck(f"parameters: {{a: -2}}{SMALL}loads: {{push: {push}}}").deck
    assert deck.loads["push"].law.constant == -2.0


# Laws ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "law", "hint"),
    [
        ("{own: 1}", "sin(2 * T)", "did you mean 't'?"),
        ("{own: 1}", "sin(2 * w)", "known: t, own, pi, tau, e"),
        ("{}", "sin(2 * T)", "did you mean 't'?"),
        ("null", "sin(2 * w)", "declare it under parameters, or use t"),
    ],
)
def test_time_is_among_the_names_that_a_law_may_mean(parameters, law, hint):
    push = f"{{type: force, at: arm.tip, force: [0, 1], law: {{expression: '{law}'}}}}"
    declared = "" if parameters == "null" else f"parameters: {parameters}"
    with pytest.raises(DeckError) as caught:
        parse_deck(f"{declared}{SMALL}loads: {{push: {push}}}")
    (problem,) = caught.value.problems
    assert (problem.path, problem.hint) == ("loads.push.law.expression", hint)


def law_of(text, **more):
    return TypeAdapter(AngleLaw).validate_python({"expression": text, **more})


@pytest.mark.parametrize("name", [*OF_TIME, "log base", "power", "constants"])
def test_derivatives_of_every_function_of_time(name):
    u = "0.3 + 0.2 * sin(2 * t)"
    text = {
        "pow": f"pow({u}, t)",
        "hypot": f"hypot({u}, t, 2)",
        "acosh": f"acosh(2 + {u})",
        "max": f"max({u}, -1, t - 9)",
        "min": f"min(7, {u} * t, 8)",
        "log base": f"log({u}, 2 + t)",
        "power": f"({u}) ** -2 + 2 ** ({u}) - t ** 2 / t",
        "constants": f"sin(pi / 3) * e + -({u}) - max(2, 3) * cos(1) + ({u}) / 2",
    }.get(name, f"{name}({u})")
    law = law_of(text).build()
    t, h = np.linspace(0.5, 2.4, 24).reshape(4, 6), 1e-4
    expected = [value_of(text, t=one) for one in t.ravel()]
    np.testing.assert_allclose(law.value(t), np.reshape(expected, t.shape), rtol=1e-14)
    five = np.array([1, -8, 0, 8, -1]) / (12 * h)
    steps = h * np.arange(-2, 3)[:, None, None]
    np.testing.assert_allclose(law.rate(t), np.tensordot(five, law.value(t + steps), 1), atol=1e-9)
    np.testing.assert_allclose(law.acceleration(t), np.tensordot(five, law.rate(t + steps), 1), atol=1e-9)
    assert law.rate(0.7).shape == ()


def test_an_expression_is_the_law_it_spells():
    t = np.linspace(0.0, 3.0, 31)
    sine = TypeAdapter(AngleLaw).validate_python(
        {"type": "sine", "amplitude": "20 deg", "frequency": 1.5, "phase": 0.2, "offset": 1}
    )
    same = law_of("20 deg * sin(2 * pi * 1.5 * t + 0.2) + 1")
    for name in ("value", "rate", "acceleration"):
        theirs, ours = getattr(sine.build(), name)(t), getattr(same.build(), name)(t)
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12)


def test_expressions_without_time_are_constant():
    assert law_of("2 * pi").constant == 2 * math.pi
    assert law_of("t").constant is None
    assert (law_of("3").build().rate(np.zeros(4)) == 0.0).all()


def test_the_turning_of_many_laws_is_looked_at_once(monkeypatch):
    laws = [law_of(f"sin({k} * t + 0.123)").build() for k in range(1, 151)]
    looked, turning = [], type(laws[0]).turning_rates
    monkeypatch.setattr(
        type(laws[0]), "turning_rates", lambda self, t: looked.append(self) or turning(self, t)
    )
    for begin in (0.0, 0.3, 0.6):
        found = [law.period(begin, begin + 0.2, 1.37) for law in laws]
        np.testing.assert_allclose(found, 2.0 * np.pi / np.arange(1, 151))
    assert len(looked) == 150


@pytest.mark.parametrize(
    ("law", "start"),
    [
        ({"expression": "1 - cos(t)", "start": 0.5}, 0.5),
        ({"type": "spin_up", "rate": 6.0, "time": 1.1, "start": 0.25}, 0.25),
        ({"type": "sine", "amplitude": 2.0, "frequency": 0.7, "phase": 0.3, "start": 0.5}, 0.5),
        ({"type": "table", "times": [0, 1, 2, 3], "values": [1, 0, 2, 1], "start": 1}, 1.0),
        ({"type": "constant_rate", "rate": 3.0, "start": 2.0, "delay": 0.5}, 0.5),
    ],
)
def test_before_its_start_a_law_holds_its_first_value(law, start):
    read = TypeAdapter(ScaleLaw).validate_python
    shifted = read(law).build()
    plain = read({key: one for key, one in law.items() if key not in ("start", "delay")} | _own(law)).build()
    t = np.linspace(0.0, 2.0, 41)
    before, after = t < start, t >= start
    for name in ("value", "rate", "acceleration"):
        there = getattr(shifted, name)(t)
        held = float(plain.value(0.0)) if name == "value" else 0.0
        assert (there[before] == held).all()
        np.testing.assert_allclose(there[after], getattr(plain, name)(t[after] - start), rtol=1e-14)
    assert start in shifted.breaks(0, 2.0)
    np.testing.assert_allclose(shifted.period(start, 2.0, 2.0), plain.period(0.0, 2.0 - start, 2.0 - start))


def _own(law):
    return {"start": law["start"]} if law.get("type") == "constant_rate" else {}


def test_laws_without_a_value_at_their_start_warn_of_nothing(recwarn):
    assert not law_of("1 + t * log(t)", start=0.5).kink
    assert not np.isfinite(law_of("log(t)").build().rate(0.0))
    assert not recwarn.list


POLES = """
1/(t - 0.50007)  1e-6/(t - 0.50007)**2  (t - 0.50007)**-1  (t - 0.50007)**-2  pow(t - 0.50007, -3)  1/t
t**-0.5  pow(t - 0.50007, -2)  1/abs(t - 0.50007)  abs(t - 0.77771)**-1.5  1/(t - 1)  1/(1 - t)**2
1/(t - 1e-5)**2  1/(1 - sin(3*t))  1/(1 + cos(4*t))  1/(t**2 - 0.5)**2  (1 - sin(3*t))**-0.5
1/(t**2 - 2*0.37*t + 0.37**2)  1/(sin(5*t) - 0.5)**2  1/(exp(t) - 2)**2  1/hypot(t - 0.3, t - 0.3)
1/(cosh(t - 0.4) - 1)  tan(pi/2 + (t - 0.31)**2)  1/max(t - 0.5, 0)  ((t - 0.3)**2)**(-t)
5 + 1/(1000*t - 500.07)**2  (t*(t - 0.333))**-2  1/min((t - 0.3)**2, 0.1)  max(1/(t - 0.50007)**2, 3)
min(1/(t - 0.50007), 10)  max(min(1/(t - 0.50007), 10), -10)  2**(1/(t - 0.2)**2)
min(1/(t - 0.2)**2, 100) + 1/(t - 0.7)**2
"""
FINITE = """
1/(t**2 + 1e-6)  1/(1 + cos(t))  1/(1.0001 + cos(4*t))  1/(1 - 0.999999*sin(3*t))  1/(1e-14 + 1 - sin(3*t))
min(1/t, 10)  1/max(t - 0.5, 0.1)  sin(max(t, 1e-15))/max(t, 1e-15)  1/max((t - 0.5)**2, 1e-6)
1/(abs(t - 0.5) + 1e-9)  (t + 1)**-2  1/((t - 0.50007)**2 + 1e-20)  (t**2 + 1e-6)**-1  pow(t + 0.1, -3)
pow(t - 0.5, 3)  (t - 0.50007)**0  tan(1.5*t)  1/(2 + sin(3000*t))  1/(1.1 - t)  1/(t - 1.0001)**2
1/(t + 1e-12)  ((t - 0.3)**2)**(t + 0.1)  (0.02 + t)**(0.5 - t)  min(1/(t - 0.50007)**2, 100)
min(1/(t - 0.5)**2, 100)*(t - 0.5)  max(-1/(t - 0.50007)**2, -100)  min(abs(t - 0.3)**-1, 5)
min(5, pow(t - 0.3, -2))  1/cosh(10*(t - 0.5))
"""


@pytest.mark.parametrize("text", re.split(r"\s{2,}|\n", POLES.strip()))
def test_a_law_that_divides_by_zero_has_trouble(text):
    found = law_of(text).build().trouble(1.0, (0,))
    assert found is not None and found[1] == "it divides by zero"


@pytest.mark.parametrize("text", re.split(r"\s{2,}|\n", FINITE.strip()))
def test_a_law_that_comes_near_to_it_has_none(text):
    assert law_of(text).build().trouble(1.0, (0,)) is None


def test_kinks_and_turns_of_expressions_are_breaks():
    law = law_of("max(0, sin(3 * t)) + abs(t - 1.1)").build()
    kinks = [1.1, math.pi / 3, 2 * math.pi / 3]
    found = law.breaks(0, 2.5)
    for one in [*kinks, math.acos(1 / 3) / 3]:
        assert np.abs(found - one).min() < 1e-4, one
    assert np.abs(found[:, None] - np.array(kinks)).min(axis=0).max() < 1e-12
    assert len(found) < 12
    assert len(law_of("sin(1000 * t)").build().breaks(0, 10.0)) <= 200


@pytest.mark.parametrize("width", [0.05, 0.004, 0.0015])
@pytest.mark.parametrize("at", [2.5013, 5.123, 7.0001])
def test_a_pulse_that_lasts_a_small_part_of_a_run_is_not_missed(width, at):
    law = law_of(f"exp(-((t - {at}) / {width})**2)").build()
    ends = law.breaks(0, 10.0)
    assert len(ends) == 3 and np.abs(ends - at).max() < 5.0 * width + 0.01
    deck = parse_deck(PULSE.replace("LAW", f"exp(-((t - {at}) / {width})**2)"))
    (spin,) = simulate(deck, error_estimate=False).channels
    assert spin.values[-1] == pytest.approx(width * math.sqrt(math.pi) / 0.3, rel=1e-6)


def test_a_table_of_times_needs_no_type():
    text = PULSE.replace('{expression: "LAW"}', "{times: [0, 5, 10], values: [0, 1, 0]}")
    law = parse_deck(text).deck.loads["m"].law
    assert law.type == "table" and law.build().value(5.0) == 1.0


def test_what_fades_away_or_rings_has_no_pulses():
    for law, most in (("exp(-t)", 0), ("sin(0.1 * t)", 0), ("t**2", 0), ("exp(-t) * sin(8 * t)", 30)):
        assert len(law_of(law).build().breaks(0, 10.0)) <= most


PULSE = """
hfsim: 1
bodies: {r: {type: rigid, mass: 2.0, inertia: 0.3}}
joints: {h: {type: revolute, between: [ground, r]}}
loads: {m: {type: moment, at: r, moment: 1.0, law: {expression: "LAW"}}}
solve: {duration: 10.0}
output: {channels: [r.angular_velocity]}
"""
DRIVEN = """
hfsim: 1
gravity: [0, -9.81]
parameters: {a: 40 deg, w: 3}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.1, points: {rim: [0.2, 0]}}
  arm: {type: rigid, mass: 0.5, inertia: 0.1, points: {end: [-0.3, 0.1]}}
joints:
  motor: {type: driver, between: [ground, hub], angle: LAW}
  elbow: {type: revolute, between: [hub.rim, arm.end]}
initial: {arm: {angle: 0.3}}
loads: {push: {type: force, at: arm, force: [2, 1], law: PUSH}}
solve: {duration: 1.0, tolerance: 1.0e-10}
output: {channels: [arm.x, arm.angle, hub.angle, motor.moment, energy.total]}
"""


def final(law, push):
    result = simulate(
        parse_deck(DRIVEN.replace("LAW", law).replace("PUSH", push), "driven.yaml"), error_estimate=False
    )
    assert result.status == "done"
    assert result.statistics["energy_drift"] < 1e-7
    return result.channels


def test_an_expression_drives_and_loads_as_the_law_it_spells():
    sine = final(
        "{type: sine, amplitude: 40 deg, frequency: 0.477464829275686, phase: 0}",
        "{type: sine, amplitude: 1, frequency: 2, phase: 0.3}",
    )
    spelt = final('{expression: "a * sin(w * t)"}', '{expression: "sin(4 * pi * t + 0.3)"}')
    for one, other in zip(sine, spelt, strict=True):
        np.testing.assert_allclose(other.values, one.values, atol=1e-7)


@pytest.mark.parametrize("method", ["gauss", "radau", "energy", "gear", "generalized_alpha", "explicit"])
def test_a_driver_that_begins_later_with_an_acceleration_is_followed(method):
    """Its acceleration jumps: a wheel of inertia 0.2 takes a moment of 0.2 from 0.37 s on."""
    text = f"""
hfsim: 1
gravity: [0, 0]
bodies: {{hub: {{type: rigid, mass: 1.0, inertia: 0.2}}, free: {{type: rigid, mass: 1.0, inertia: 0.2}}}}
joints: {{motor: {{type: driver, between: [ground, hub], angle: {{expression: "t ** 2 / 2", start: 0.37}}}}}}
springs: {{coil: {{type: rotational, between: [hub, free], stiffness: 5.0}}}}
initial: {{free: {{position: [0, 0]}}}}
solve: {{duration: 1.0, tolerance: 1.0e-9, method: {method}}}
output: {{interval: 0.1, channels: [hub.angle, free.angle]}}
"""
    scene = build(parse_deck(text, "wheel.yaml"))
    result = simulate(scene.loaded, error_estimate=False)
    hub, free = (one.values[-1] for one in result.channels)
    past, w = 1.0 - 0.37, 5.0
    assert hub == pytest.approx(past**2 / 2, abs=1e-9)
    assert free == pytest.approx(past**2 / 2 - (1 - math.cos(w * past)) / w**2, abs=2e-6)


@pytest.mark.parametrize("method", ["auto", "gauss", "radau", "gear", "explicit"])
@pytest.mark.parametrize("width", [0.02, 0.3])
def test_a_short_push_by_an_expression_is_not_missed(method, width):
    """A unit of impulse at 5 s moves a unit of mass by 5 m until 10 s."""
    text = f"""
hfsim: 1
gravity: [0.0, 0.0]
bodies: {{b: {{type: rigid, mass: 1.0, inertia: 0.1}}}}
loads:
  on: {{type: force, at: b, force: [{1 / (width * math.sqrt(math.pi))!r}, 0.0],
    law: {{expression: "exp(-((t - 5) / {width}) ** 2)"}}}}
solve: {{duration: 10.0, method: {method}, tolerance: 1.0e-6}}
output: {{channels: [b.x, b.vx]}}
"""
    result = simulate(parse_deck(text), error_estimate=False)
    x, vx = (one.values[-1] for one in result.channels)
    assert (x, vx) == (pytest.approx(5.0, abs=1e-3), pytest.approx(1.0, abs=1e-4))


ENDLESS = """
hfsim: 1
bodies: {hub: {type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  axle: {type: revolute, between: [ground, hub]}
  drive: {type: driver, between: [ground, hub], angle: {expression: "LAW"}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize(("law", "told"), [("sin(t) / t", "it"), ("sqrt(t)", "its rate")])
def test_a_law_that_is_not_finite_is_told_once(law, told):
    with pytest.raises(DeckError) as caught:
        parse_deck(ENDLESS.replace("LAW", law))
    (problem,) = caught.value.problems
    assert problem.message.startswith(f"{told} ") and "t = 0 s" in problem.message


SWITCHED = """
hfsim: 1
bodies: {hub: {type: rigid, mass: 1.0, inertia: 0.2}}
joints: {motor: {type: driver, between: [ground, hub], angle: {expression: "LAW"}}}
solve: {duration: 0.8}
output: {channels: [hub.angle, hub.angular_velocity]}
"""


@pytest.mark.parametrize(
    ("law", "angle"),
    [
        ("pi * (1 - cos(pi * min(t, 0.4) / 0.4)) / 2", math.pi),
        ("max(0, t - 0.3) ** 2", 0.25),
        ("abs(t - 0.2) ** 3", 0.216),
    ],
)
def test_drivers_may_switch_where_the_rate_goes_on(law, angle):
    result = simulate(parse_deck(SWITCHED.replace("LAW", law)), error_estimate=False)
    assert result["hub.angle"][-1] == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize(
    ("law", "place"),
    [("min(t, 0.4)", 0.4), ("t + max(0, sin(5 * t) / 1000)", math.pi / 5), ("abs(t - 0.2)", 0.2)],
)
def test_drivers_whose_rate_jumps_are_refused_with_the_time(law, place):
    with pytest.raises(DeckError, match=rf"joints\.motor\.angle: its rate jumps at t = {place:.4g} s"):
        parse_deck(SWITCHED.replace("LAW", law))
