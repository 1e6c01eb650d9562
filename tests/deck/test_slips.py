"""Numbers that look like slips of units: told with their place, silent where a unit is given."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import hfsim
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import check, simulate

SHIPPED = sorted(
    path for path in (Path(__file__).parents[2] / "cases").rglob("*.yaml") if path.stem != "expected"
)
DECK = """
hfsim: 1
gravity: [0, -9.81]
materials: {steel: {density: 7850, youngs_modulus: 2.1e11, poisson_ratio: 0.3}}
sections: {bar: {area: 4e-4, second_moment: 1.33e-8}}
bodies:
  arm: {type: beam, material: steel, section: bar, length: 2}
  hub: {type: rigid, mass: 3, inertia: 0.02, points: {rim: [0.1, 0]}}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, arm.root], angle: 0}
springs: {coil: {type: rotational, between: [ground, hub], stiffness: 20, rest_angle: 0}}
loads:
  push: {type: moment, at: hub, moment: 1, law: {type: smooth_step, from: 0, to: 1, start: 0.1, end: 2}}
initial: {hub: {angle: 0, angular_velocity: 0}}
solve: {duration: 2}
output: {interval: 0.01}
"""


def warnings(*changes, overrides=()):
    text = DECK
    for before, after in changes:
        assert before in text
        text = text.replace(before, after, 1)
    return parse_deck(text, "deck.yaml", overrides).warnings


SLIPS = [
    ("angle: 0, angular", "angle: 30, angular", "initial.hub.angle", "30 rad are 4.77 turns", "'30 deg'?"),
    ("angle: 0}\n", "angle: 90}\n", "joints.mount.angle", "90 rad are 14.3 turns", "'90 deg'?"),
    ("rest_angle: 0", "rest_angle: -45", "springs.coil.rest_angle", "-45 rad are -7.16 turns", "'-45 deg'?"),
    (
        "velocity: 0",
        "velocity: 3000",
        "initial.hub.angular_velocity",
        "3000 rad/s are 2.865e+04",
        "'3000 rpm'?",
    ),
    ("2.1e11", "210", "materials.steel.youngs_modulus", "210 Pa is softer than jelly", "'210 GPa'?"),
    ("2.1e11", "210e3", "materials.steel.youngs_modulus", "a metal's", "'210000 MPa'?"),
    ("7850", "7.85", "materials.steel.density", "7.85 kg/m^3 is no solid's", "'7.85 g/cm3'?"),
    ("7850", "7.85e-9", "materials.steel.density", "no solid's", "'7.85e-09 t/mm3'?"),
    ("7850", "7.85e-6", "materials.steel.density", "no solid's", "'7.85e-06 kg/mm3'?"),
    ("ratio: 0.3", "ratio: -0.3", "materials.steel.poisson_ratio", "-0.3", "0.3?"),
    ("1.33e-8", "1.33e4", "sections.bar.second_moment", "m high", "'13300 mm4'?"),
    ("area: 4e-4", "area: 400", "sections.bar.area", "m high", "'400 mm2'?"),
    ("length: 2", "length: 2000", "bodies.arm.length", "2000 m for a section 0.02 m high", "'2000 mm'?"),
    ("length: 2", "length: 0.015", "bodies.arm.length", "and the beam is 0.015 m long", "in metres?"),
    ("inertia: 0.02", "inertia: 2e4", "bodies.hub.inertia", "81.6 m from its centre", "'20000 kg mm2'?"),
    (
        "start: 0.1, end: 2",
        "start: 100, end: 200",
        "loads.push.law.start",
        "when the run of 2 s is over",
        "ms'?",
    ),
    ("interval: 0.01", "interval: 10", "output.interval", "10 s is longer than the run, 2 s", "'10 ms'?"),
    (
        "type: smooth_step, from: 0, to: 1, start: 0.1, end: 2",
        "type: table, times: [0, 1, 1.001, 1.002, 2], values: [0, 0, 1, 0, 0]",
        "loads.push.law.values",
        "the spline through the points reaches",
        "or interpolation: linear for a load",
    ),
    ("-9.81", "9.81", "gravity.1", "points up", "-9.81?"),
    ("-9.81", "-9810", "gravity.1", "a thousand times the Earth's", "'-9810 mm/s2'?"),
]


@pytest.mark.parametrize(("before", "after", "path", "message", "hint"), SLIPS)
def test_what_looks_like_a_slip_is_told_with_its_place(before, after, path, message, hint):
    (warning,) = warnings((before, after))
    changed = zip(DECK.splitlines(), DECK.replace(before, after, 1).splitlines(), strict=True)
    line = next(number for number, (one, other) in enumerate(changed, 1) if one != other)
    assert warning.startswith(f"deck.yaml:{line}:")
    assert f": warning: {path}: " in warning
    assert message in warning
    assert warning.endswith(f"{hint})")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("angle: 0, angular", "angle: 30 rad, angular"),
        ("velocity: 0", "velocity: 3000 rad/s"),
        ("2.1e11", "210 Pa"),
        ("7850", "7.85 kg/m3"),
        ("length: 2", "length: 2000 m"),
        ("inertia: 0.02", "inertia: 2e4 kg m2"),
        ("interval: 0.01", "interval: 10 s"),
        ("-9.81", "9.81 m/s2"),
    ],
)
def test_a_number_with_its_unit_is_meant(before, after):
    assert warnings((before, after)) == ()


@pytest.mark.parametrize("angle", ["3.14159", "-6.283185307179586", "12.566370614359172", "6", "30 deg"])
def test_angles_in_radians_are_not_doubted(angle):
    assert warnings(("angle: 0, angular", f"angle: {angle}, angular")) == ()


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_no_shipped_deck_is_doubted(path):
    assert load_deck(path).warnings == ()


def led(joint):
    setting = f"joints.led={json.dumps({'between': ['ground', 'hub'], **joint})}"
    return [one.partition("joints.led.")[2] for one in parse_deck(DECK, "deck.yaml", [setting]).warnings]


SERVO = {"type": "servo", "stiffness": 10.0}
SINE = {"type": "sine", "amplitude": 0.3, "frequency": 1}
STEP = {"type": "smooth_step", "from": 0, "to": 90, "start": 0, "end": 1}


@pytest.mark.parametrize(
    ("joint", "told"),
    [
        ({**SERVO, "angle": 45}, "angle: 45 rad are 7.16 turns ('45 deg'?)"),
        ({**SERVO, "angle": {"type": "constant", "value": 45}}, "angle.value: 45 rad are"),
        ({"type": "driver", "angle": STEP}, "angle.to: 90 rad are 14.3 turns ('90 deg'?)"),
        ({"type": "motion", "turn": {**STEP, "from": -30, "to": 0}}, "turn.from: -30 rad are"),
        ({**SERVO, "angle": {**SINE, "amplitude": 30}}, "angle.amplitude: 30 rad are"),
        ({**SERVO, "angle": {**SINE, "phase": 90}}, "angle.phase: 90 rad"),
        ({**SERVO, "angle": {"times": [0, 1, 2], "values": [0, -45, 10]}}, "angle.values.1: -45 rad are"),
    ],
)
def test_degrees_in_laws_that_angles_follow_are_told_as_others_are(joint, told):
    (warning,) = led(joint)
    assert warning.startswith(told)


@pytest.mark.parametrize(
    "joint",
    [
        {**SERVO, "angle": "45 rad"},
        {**SERVO, "angle": {"type": "constant", "value": "45 rad"}},
        {**SERVO, "angle": {"times": [0, 1, 2], "values": [0, 45, 0], "unit": "rad"}},
        {**SERVO, "angle": {"times": [0, 1, 2], "values": [0, 45, 0], "unit": "deg"}},
        {**SERVO, "angle": {"times": [0, 1, 2], "values": [0, 7.2, 14]}},  # counted in radians as measured
        {"type": "driver", "angle": {**STEP, "to": "15 rev"}},
        {"type": "driver", "angle": {**STEP, "to": 12.566370614359172}},
        {"type": "driver", "angle": {"type": "constant_rate", "rate": 90}},
        {"type": "driver", "angle": {"type": "spin_up", "rate": 90, "time": 1}},
        {**SERVO, "angle": {"expression": "90 * t"}},
        {**SERVO, "position": 45},
        {**SERVO, "position": STEP},
    ],
)
def test_turns_in_laws_that_may_be_meant_are_not_doubted(joint):
    assert led(joint) == []


def test_an_override_has_no_line():
    (warning,) = warnings(overrides=["initial.hub.angle=30"])
    assert warning.startswith("--set: warning: initial.hub.angle: 30 rad")


# Sections with little bending stiffness


@pytest.mark.parametrize("strands", [1, 49, 10_000])
def test_wire_ropes_are_accepted(strands):
    """Wires that slide on each other bend one by one: I = A^2 / (4 pi n)."""
    area = 4e-4
    moment = area**2 / (12.566 * strands)
    loaded = parse_deck(DECK.replace("1.33e-8", f"{moment:.6e}"), "deck.yaml")
    assert loaded.warnings == ()
    assert loaded.deck.properties("arm").bending_stiffness == pytest.approx(2.1e11 * moment, rel=1e-5)


def test_ribbons_are_accepted_and_run():
    ribbon = "{shape: rectangle, width: 0.1, height: 1e-5}"
    wide = parse_deck(DECK.replace("{area: 4e-4, second_moment: 1.33e-8}", ribbon)).deck.sections["bar"]
    numbers = f"{{area: {wide.area!r}, second_moment: {wide.second_moment!r}}}"
    text = DECK.replace("{area: 4e-4, second_moment: 1.33e-8}", numbers).replace(
        "duration: 2", "duration: 2e-3"
    )
    loaded = parse_deck(text.replace("interval: 0.01", "interval: 1e-3"), "deck.yaml")
    assert simulate(loaded, error_estimate=False).status == "done"


def test_sections_higher_than_the_beam_is_long_are_accepted():
    loaded = parse_deck(
        DECK.replace("{area: 4e-4, second_moment: 1.33e-8}", "{shape: rectangle, width: 1, height: 3}")
    )
    assert check(loaded)["unknowns"]
    assert len(loaded.warnings) == 1


# Where they are told


def command(*arguments, cwd):
    words = [sys.executable, "-m", "hfsim", *arguments]
    return subprocess.run(words, capture_output=True, text=True, cwd=cwd, timeout=60)


def written(folder):
    """Write a deck with one slip, and return what is told of it."""
    text = DECK.replace("angle: 0, angular", "angle: 30, angular").replace("duration: 2", "duration: 0.002")
    (folder / "deck.yaml").write_text(
        text.replace("interval: 0.01", "interval: 0.001").replace("start: 0.1", "start: 0")
    )
    return "deck.yaml:15:24: warning: initial.hub.angle: 30 rad are 4.77 turns ('30 deg'?)"


def test_slips_are_told_by_check_and_run_and_kept_in_the_summary(tmp_path):
    told = written(tmp_path)
    checked = command("check", "deck.yaml", "--json", cwd=tmp_path)
    assert checked.stderr.splitlines() == [told]
    assert json.loads(checked.stdout)["warnings"] == [told]
    ran = command("run", "deck.yaml", "--no-plots", cwd=tmp_path)
    assert (ran.returncode, ran.stderr.count(told)) == (0, 1)
    assert told in json.loads((tmp_path / "deck.out" / "summary.json").read_text())["warnings"]


def test_slips_are_told_in_python(tmp_path, monkeypatch):
    told = written(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert hfsim.check("deck.yaml")["warnings"] == [told]
    run = hfsim.run("deck.yaml", output="out", plots=False)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert run.statistics["warnings"].count(told) == summary["warnings"].count(told) == 1
    assert hfsim.static("deck.yaml", check=False).statistics["warnings"].count(told) == 1
