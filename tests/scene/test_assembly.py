# ruff: noqa: E501
"""Closing loops at the start: angles that are not stated, guesses, branches, and what cannot close."""

import re
from functools import partial

import numpy as np
import pytest
from called import call
from cantilevers import at_rest
from scipy.optimize import brentq

import hfsim
from hfsim.commands.init import starters
from hfsim.errors import DeckError
from hfsim.scene import start
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

HEAD = """hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
"""


def link(name, length, kind="rigid"):
    if kind == "beam":
        return f"  {name}: {{type: beam, material: alloy, section: bar, length: {length}, elements: 2}}\n"
    half = length / 2
    points = f"{{root: [{-half}, 0.0], tip: [{half}, 0.0]}}"
    return f"  {name}: {{type: rigid, mass: 1.0, inertia: 0.01, points: {points}}}\n"


def pins(*pairs):
    return "".join(f"  {name}: {{type: revolute, between: [{ends}]}}\n" for name, ends in pairs)


def mechanism(links, joints, ground="{}", extra="", kind="rigid", driven="crank", start=None):
    """Return a loaded deck of links by name and length, and of pins."""
    text = HEAD + f"ground: {{points: {ground}}}\nbodies:\n"
    text += "".join(one if isinstance(one, str) else link(*one, kind) for one in links)
    text += "joints:\n" + pins(*joints)
    if start is not None:
        text += f"  motor: {{type: driver, between: [ground, {driven}], angle: {{type: constant_rate, rate: 1.0, start: {start!r}}}}}\n"
    return parse_deck(text + extra + "solve: {duration: 0.01}\n", "mechanism.yaml")


def four_bar(start=None, lengths=(0.3, 0.9, 0.7), ground=1.0, **options):
    pairs = ("axle", "ground, crank.root"), ("left", "crank.tip, coupler.root")
    pairs += ("right", "coupler.tip, rocker.tip"), ("foot", "ground.far, rocker.root")
    links = zip(("crank", "coupler", "rocker"), lengths, strict=True)
    return mechanism(links, pairs, f"{{far: [{ground}, 0.0]}}", start=start, **options)


def closing(start, lengths=(0.3, 0.9, 0.7)):
    """Angles of coupler and rocker in both ways to close the four-bar, in closed form."""
    a, b, c = lengths
    line = 1.0 - a * np.exp(1j * start)
    d = abs(line)
    lift = np.arccos((b * b + d * d - c * c) / (2 * b * d))
    for side in (1.0, -1.0):
        coupler = np.angle(line) + side * lift
        rocker = np.angle(a * np.exp(1j * start) + b * np.exp(1j * coupler) - 1.0)
        yield float(coupler), float(rocker)


def apart(first, second):
    return max(abs((a - b + np.pi) % (2 * np.pi) - np.pi) for a, b in zip(first, second, strict=True))


def assembled(loaded, model=None):
    """Return the assembly of a deck, the joints of which hold."""
    scene = build(loaded, model)
    x = scene.system.absolute(scene.q[None])
    assert np.abs(scene.system.residual(np.zeros(1), x)).max() < 1e-12
    u = scene.system.absolute_velocity(scene.q[None], scene.v[None])
    assert np.abs(scene.system.drift(np.zeros(1), x, u)).max() < 1e-11
    return scene.assembly


@pytest.mark.parametrize("kind", ["rigid", "beam"])
@pytest.mark.parametrize("degrees", range(0, 360, 10))
def test_every_angle_of_a_crank_that_can_close_does(degrees, kind):
    start = np.radians(degrees)
    found = assembled(four_bar(float(start), kind=kind))
    ways = [tuple(one.values()) for one in (found.closed, *found.branches())]
    assert list(found.closed) == ["coupler", "rocker"] and len(ways) == 2
    for both in closing(start):
        assert min(apart(both, way) for way in ways) < 1e-9, "each of the two ways is found"


@pytest.mark.parametrize("model", ["linear", "lowOrder", "ancf", "rigid"])
def test_the_way_to_close_does_not_depend_on_the_model(model):
    found = assembled(four_bar(0.5, kind="beam"), model)
    assert found.closed == assembled(four_bar(0.5, kind="beam"), "exact").closed


@pytest.mark.parametrize("side", [0, 1])
def test_a_rough_angle_steers_to_the_nearest_way(side):
    coupler, rocker = list(closing(0.5))[side]
    found = assembled(four_bar(0.5, extra=f"initial: {{rocker: {{angle: {rocker + 0.2!r}}}}}\n"))
    assert found.poses["coupler"].angle == pytest.approx(coupler, abs=1e-9)
    assert found.poses["rocker"].angle == pytest.approx(rocker, abs=1e-9)
    (warning,) = found.warnings()
    assert "initial.rocker.angle" in warning and "0.2 rad off" in warning


@pytest.mark.parametrize(("off", "told"), [(5.9e-7, "note"), (0.087, "warning")])
def test_approximate_angles_are_guesses_and_told(off, told):
    coupler, rocker = next(closing(1.0))
    extra = f"initial: {{crank: {{angle: 1.0}}, coupler: {{angle: {coupler + off!r}}}, rocker: {{angle: {rocker - off!r}}}}}\n"
    found = assembled(four_bar(1.0, extra=extra))
    assert found.poses["coupler"].angle == pytest.approx(coupler, abs=1e-9)
    notes, warnings = found.notes(), found.warnings()
    lines = notes if told == "note" else warnings
    assert len(notes) + len(warnings) == len(lines) == 2
    for name, line in zip(("coupler", "rocker"), lines, strict=True):
        assert f"initial.{name}.angle" in line and f"{off:.3g} rad off" in line


def test_angles_that_agree_stay_as_they_are():
    coupler, rocker = next(closing(1.0))
    extra = f"initial: {{crank: {{angle: 1.0}}, coupler: {{angle: {coupler!r}}}, rocker: {{angle: {rocker!r}}}}}\n"
    found = assembled(four_bar(1.0, extra=extra))
    assert [pose.angle for pose in found.poses.values()] == [1.0, coupler, rocker]
    assert not found.notes() and not found.warnings() and not found.closed


def refused(loaded):
    with pytest.raises(DeckError) as caught:
        build(loaded)
    (problem,) = caught.value.problems
    assert caught.value.exit_code == 2 and problem.line > 0
    return problem


def test_exact_angles_are_no_guesses():
    _, rocker = next(closing(1.0))
    problem = refused(
        four_bar(1.0, extra=f"initial: {{rocker: {{angle: {rocker + 0.01!r}, exact: true}}}}\n")
    )
    assert "exact" in problem.message and "rocker" in problem.hint
    assert problem.path == "joints.foot"
    guess = four_bar(
        1.0, extra=f"initial: {{crank: {{angle: 1.01, exact: true}}, rocker: {{angle: {rocker!r}}}}}\n"
    )
    assert "0.01 rad" in refused(guess).message
    found = assembled(
        four_bar(
            extra=f"initial: {{crank: {{angle: 1.0, exact: true}}, rocker: {{angle: {rocker + 0.1!r}}}}}\n"
        )
    )
    assert found.poses["crank"].angle == 1.0
    assert found.poses["rocker"].angle == pytest.approx(rocker, abs=1e-9)


def test_what_is_far_off_is_refused_with_the_nearest_that_holds():
    coupler, rocker = next(closing(1.0))
    extra = f"initial: {{coupler: {{angle: {coupler + 1.5!r}}}, rocker: {{angle: {rocker + 1.5!r}}}}}\n"
    problem = refused(four_bar(1.0, extra=extra))
    assert f"rocker.angle {rocker:.9g} rad" in problem.hint and "'initial'" in problem.hint


@pytest.mark.parametrize(
    ("start", "lengths", "gap"),
    [
        (0.5, (0.3, 0.2, 0.1), abs(1.0 - 0.3 * np.exp(0.5j)) - 0.3),
        (0.5, (0.3, 2.9, 0.7), 2.2 - abs(1.0 - 0.3 * np.exp(0.5j))),
        (None, (0.3, 0.2, 0.1), 0.4),
        (3.0, (1.0, 0.6, 0.3), abs(1.0 - np.exp(3.0j)) - 0.9),
    ],
)
def test_a_loop_that_cannot_close_is_refused_with_the_smallest_gap(start, lengths, gap):
    problem = refused(four_bar(start, lengths))
    assert problem.path == "joints.foot" and f"where the others close, {gap:.6g} m are left" in problem.message
    assert "initial" not in problem.message + problem.hint, "there is nothing to change there"


@pytest.mark.parametrize("scale", [1e-4, pytest.param(1.0, marks=pytest.mark.slow), 1e4])
def test_scenes_of_any_size_close_or_tell_their_gap(scale):
    """Random four-bars, those that can close and those that cannot, against closed forms."""
    rng = np.random.default_rng(7)
    for _ in range(8):
        start, lengths = float(rng.uniform(0.0, 6.0)), rng.uniform(0.1, 2.0, 3)
        d = abs(1.0 - lengths[0] * np.exp(1j * start))
        gap = max(abs(lengths[1] - lengths[2]) - d, d - lengths[1] - lengths[2])
        loaded = four_bar(start, tuple(map(float, scale * lengths)), scale)
        if gap <= 0.0:
            assert len(build(loaded).assembly.branches()) == 1
        else:
            left = re.search(r"where the others close, (\S+) m are left", refused(loaded).message)
            assert float(left[1]) == pytest.approx(gap * scale, rel=1e-5)


@pytest.mark.parametrize("degrees", range(0, 360, 30))
def test_slider_cranks_close(degrees):
    slider = "  slider: {type: rigid, mass: 1.0, inertia: 0.1}\n"
    pairs = ("axle", "ground, crank.root"), ("knee", "crank.tip, rod.root"), ("wrist", "rod.tip, slider")
    start = float(np.radians(degrees))
    loaded = mechanism([("crank", 0.5), ("rod", 1.0), slider], [*pairs], start=start)
    text = loaded.source.text.replace(
        "solve:", "  guide: {type: prismatic, between: [ground, slider]}\nsolve:"
    )
    found = assembled(parse_deck(text))
    assert np.sin(found.poses["rod"].angle) == pytest.approx(-0.5 * np.sin(start), abs=1e-9)


@pytest.mark.parametrize("degrees", range(5, 360, 30))
def test_parallelograms_close(degrees):
    start = float(np.radians(degrees))
    found = assembled(four_bar(start, (0.3, 1.0, 0.3)))
    ways = [tuple(one.values()) for one in (found.closed, *found.branches())]
    assert len(ways) == 2 and min(apart((0.0, start), way) for way in ways) < 1e-7


@pytest.mark.parametrize("degrees", range(0, 360, 30))
def test_a_six_bar_closes(degrees):
    """Watt: a four-bar whose coupler and rocker carry two more links."""
    plate = "  coupler: {type: rigid, mass: 1.0, inertia: 0.1, points: {root: [-0.45, 0.0], tip: [0.45, 0.0], side: [0.0, 0.4]}}\n"
    arm = "  rocker: {type: rigid, mass: 1.0, inertia: 0.1, points: {root: [-0.35, 0.0], tip: [0.35, 0.0], side: [0.5, -0.4]}}\n"
    pairs = ("axle", "ground, crank.root"), ("left", "crank.tip, coupler.root")
    pairs += ("right", "coupler.tip, rocker.tip"), ("foot", "ground.far, rocker.root")
    pairs += (
        ("up", "coupler.side, stay.root"),
        ("down", "rocker.side, strut.root"),
        ("top", "stay.tip, strut.tip"),
    )
    links = [("crank", 0.3), plate, arm, ("stay", 0.8), ("strut", 0.8)]
    found = assembled(mechanism(links, pairs, "{far: [1.0, 0.0]}", start=float(np.radians(degrees))))
    assert set(found.closed) == {"coupler", "rocker", "stay", "strut"}
    assert len(found.branches()) >= 2


@pytest.mark.parametrize("degrees", [-30, -10, 0, 10, 30])
def test_the_peaucellier_linkage_closes(degrees):
    """Its point D runs along a straight line while its crank turns."""
    pairs = ("o1", "ground, long1.root"), ("o2", "ground, long2.root"), ("q", "ground.q, crank.root")
    pairs += ("a1", "long1.tip, near1.root"), ("a2", "long1.tip, far1.root")
    pairs += ("c1", "long2.tip, near2.root"), ("c2", "long2.tip, far2.root")
    pairs += ("b1", "crank.tip, near1.tip"), ("b2", "crank.tip, near2.tip"), ("d", "far1.tip, far2.tip")
    names = ("long1", "long2", "near1", "near2", "far1", "far2", "crank")
    links = list(zip(names, (1.0, 1.0, 0.4, 0.4, 0.4, 0.4, 0.35), strict=True))
    start = float(np.radians(degrees))
    loaded = mechanism(
        links,
        pairs,
        "{q: [0.35, 0.0]}",
        start=start,
        extra="initial: {long1: {angle: 0.3}, long2: {angle: -0.3}}\n",
    )
    found = assembled(loaded)
    tip = found.poses["far1"].placed(np.array([0.2, 0.0]))
    tip2 = found.poses["far2"].placed(np.array([0.2, 0.0]))
    assert tip == pytest.approx(tip2, abs=1e-12)
    if np.linalg.norm(tip - found.poses["crank"].placed(np.array([0.175, 0.0]))) > 1e-6:
        assert tip[0] == pytest.approx((1.0 - 0.16) / 0.7, abs=1e-9)


def test_rough_velocities_are_guesses_and_false_ones_are_refused():
    loaded = four_bar(1.0, extra="initial: {crank: {angular_velocity: 1.001}}\n")
    found = assembled(loaded)
    assert found.twists["crank"].spin[0] == pytest.approx(1.0, abs=1e-12)
    (line,) = (one for one in (*found.notes(), *found.warnings()) if "angular_velocity" in one)
    assert "1.001 rad/s is taken as a guess: the joints allow 1 rad/s" in line
    problem = refused(four_bar(1.0, extra="initial: {crank: {angular_velocity: 1.5}}\n"))
    assert problem.path == "joints.motor" and "0.5 rad/s" in problem.message


@pytest.mark.parametrize(("tip", "far"), [("", ""), (", tip: [1.0, 0.0]", "  elbow: {type: revolute, between: [arm.tip, rod]}\n")])
def test_an_arm_that_is_rounding_of_an_expression_is_none(tip, far):
    """A spin of 1e14 rad/s moved it as fast as was stated; alone, it was the unit, and 6e-17 m were a gap."""
    text = f"""hfsim: 1
bodies:
  arm: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{axle: ["${{0.1 + 0.2 - 0.3}}", 0.0]{tip}}}}}
  rod: {{type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  axle: {{type: revolute, between: [ground, arm.axle]}}
{far}initial: {{arm: {{STATED}}, rod: {{angular_velocity: 1.0}}}}
solve: {{duration: 1.0}}
"""
    with pytest.raises(DeckError, match=r"axle: the initial velocities contradict this joint by 0\.01 m/s"):
        build(parse_deck(text.replace("STATED", "velocity: [0.0, 0.01]")))
    assert not build(parse_deck(text.replace("STATED", "position: [0.0, 0.0]"))).assembly.changes


BAR = "{type: beam, material: steel, section: bar, length: '${s}', elements: 2}"
LUMP = "{type: rigid, mass: '${s**3}', inertia: '${s**5}'}"


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("body", [BAR, LUMP, LUMP.replace("'${s**5}'", "['${s**5}', '${s**5}', '${s**5}']")])
def test_where_joints_are_at_origins_the_size_is_that_of_the_bodies(body, size):
    """It was a metre: half of an arm of a millimetre was a guess, and of one of a micrometre hardly any mass turned."""
    space = "[" in body
    text = f"""hfsim: 1
parameters: {{s: {size}, off: 0.0}}
materials: {{steel: {{density: 7850.0, youngs_modulus: 2.1e11}}}}
sections: {{bar: {{shape: circle, radius: "${{s / 50}}"}}}}
bodies: {{arm: {body}}}
joints: {{pin: {{type: revolute, between: [ground, arm]{", axis: [0, 0, 1]" if space else ""}}}}}
initial: {{arm: {{position: ["${{off * s}}", 0{", 0" if space else ""}]}}}}
solve: {{duration: 1.0}}
"""
    text = text.replace("ground, arm]", "ground, arm.root]") if body is BAR else text
    built, guessed = (build(parse_deck(text.replace("off: 0.0", f"off: {off}"))) for off in (0.0, 0.045))
    assert not built.warnings and len(guessed.assembly.changes) == 1
    with pytest.raises(DeckError, match="contradict this joint by"):
        build(parse_deck(text.replace("off: 0.0", "off: 0.055")))


@pytest.mark.parametrize("inertia", [1e-2, 1e-10])
def test_a_place_far_along_a_slide_may_be_as_far_off_it_as_that_is_far(inertia):
    text = f"""hfsim: 1
bodies: {{car: {{type: rigid, mass: 1, inertia: {inertia}}}}}
joints: {{slide: {{type: prismatic, between: [ground, car], axis: [1, 1]}}}}
initial: {{car: {{position: [7.07, 7.0705]}}}}
solve: {{duration: 1.0}}
"""
    assert build(parse_deck(text)).assembly.changes


@pytest.mark.parametrize("size", [1e-3, 1.0, 1.4, 1e3])
@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("large", [False, True])
def test_start_rates_that_nothing_states_have_no_unit_of_length(size, space, large, monkeypatch):
    """A radian beside a metre gave the hub -0.478 rad/s, in kilometres -0.5, in millimetres -0.396."""
    if large:
        monkeypatch.setattr(start, "MOST_ROWS", 0)
    z, axis, inertia = (", 0.0", ", axis: [0, 0, 1]", [0.1] * 3) if space else ("", "", 0.1)
    axle, rim, root = (f"[{size * x}, 0.0{z}]" for x in (-0.2, 0.2, -0.3))
    found = assembled(
        parse_deck(f"""hfsim: 1
gravity: [0.0, 0.0{z}]
bodies:
  hub: {{type: rigid, mass: 1.0, inertia: {inertia}, points: {{axle: {axle}, rim: {rim}}}}}
  arm: {{type: rigid, mass: 1.0, inertia: {inertia}, points: {{root: {root}}}}}
joints:
  axle: {{type: revolute, between: [ground, hub.axle]{axis}}}
  elbow: {{type: revolute, between: [hub.rim, arm.root]{axis}}}
  drive: {{type: driver, between: [hub.rim, arm.root]{axis}, angle: {{type: constant_rate, rate: 1.0}}}}
solve: {{duration: 1.0}}
""")
    )
    hub, arm = found.twists["hub"], found.twists["arm"]
    assert (hub.spin[-1], arm.spin[-1]) == pytest.approx((-0.5, 0.5), abs=1e-7)
    assert (hub.velocity[1], arm.velocity[1]) == pytest.approx((-0.1 * size, -0.05 * size), rel=1e-6)
    link = found.linkage
    assert np.abs(link.slopes_by_rates(found.place) @ (rates_of(found) / link.units) + link.drift).max() < 1e-12


@pytest.mark.parametrize("size", [1e-3, 0.7, 1e3])
@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("stated", ["{}", "{r0: {angle: 0.4}}"])
def test_start_places_that_nothing_states_have_no_unit_of_length(size, space, stated):
    """Lengths were counted in powers of two near the size: in millimetres a rod leaned by 0.02 rad more."""
    turns = [rods(unit, space, stated).place.reshape(4, -1)[:, -1] for unit in (1.0, size)]
    assert turns[1] == pytest.approx(turns[0], abs=1e-9) and np.ptp(turns[0]) > 1.0


def rods(size, space, stated):
    """Return the start of four rods in a loop that leaves two motions."""
    z, axis, inertia = (", 0.0", ", axis: [0, 0, 1]", [0.1] * 3) if space else ("", "", 0.1)

    def rod(length):
        a, b = (f"[{size * length * share}, 0.0{z}]" for share in (-0.3, 0.7))
        return f"{{type: rigid, mass: 1.0, inertia: {inertia}, points: {{a: {a}, b: {b}}}}}"

    def pin(first, second):
        return f"{{type: revolute, between: [{first}, {second}]{axis}}}"

    return assembled(parse_deck(f"""hfsim: 1
ground: {{points: {{end: [{1.4 * size}, {0.3 * size}{z}]}}}}
gravity: [0.0, 0.0{z}]
bodies: {{r0: {rod(1.0)}, r1: {rod(0.8)}, r2: {rod(0.9)}, r3: {rod(0.7)}}}
joints: {{j0: {pin("ground", "r0.a")}, j1: {pin("r0.b", "r1.a")}, j2: {pin("r1.b", "r2.a")},
  j3: {pin("r2.b", "r3.a")}, j4: {pin("r3.b", "ground.end")}}}
initial: {stated}
solve: {{duration: 1.0}}
"""))


def rates_of(found):
    return np.concatenate([np.concatenate(twist) for twist in found.twists.values()])


def test_drivers_that_contradict_each_other_are_told_without_initial():
    text = four_bar(1.0).source.text.replace(
        "solve:",
        "  brake: {type: driver, between: [ground, crank], angle: {type: constant_rate, rate: 2.0, start: 1.0}}\nsolve:",
    )
    problem = refused(parse_deck(text))
    assert problem.path == "joints.brake" and "initial" not in problem.message + problem.hint


def test_a_run_tells_how_it_was_put_together():
    run = simulate(four_bar(1.0, extra="initial: {rocker: {angle: 1.4}}\n"), error_estimate=False)
    told = run.statistics["assembly"]
    assert list(told["closed"]) == ["coupler"]
    (changed,) = told["changed"]
    assert changed["body"] == "rocker" and changed["stated"] == (1.4,)
    assert [line for line in run.statistics["warnings"] if "initial.rocker.angle" in line]


def test_a_stated_rate_where_nothing_may_move_is_no_guess():
    deck = """hfsim: 1
bodies: {hub: {type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  axle: {type: revolute, between: [ground, hub]}
  motor: {type: driver, between: [ground, hub], angle: 0.0}
initial: {hub: {angular_velocity: 21.0}}
solve: {duration: 0.1}
"""
    with pytest.raises(DeckError, match=r"motor.*contradict this joint by 21 rad/s"):
        build(parse_deck(deck))


def test_a_stated_angle_hides_no_other_way_to_close():
    bar = starters()["four_bar"]
    for stated, other in (("${pi - acos(1 / 9)}", -96.379), ("-96.3794 deg", 96.379)):
        deck = bar.replace("${pi - acos(1 / 9)}", stated)
        (way,) = build(parse_deck(deck, "deck", [])).assembly.branches()
        assert next(iter(way)) == "rocker" and np.degrees(way["rocker"]) == pytest.approx(other, abs=1e-3)
        told = [f"initial.rocker.angle={np.degrees(way['rocker'])} deg"]
        found = build(parse_deck(deck, "deck", told)).assembly.closed
        assert found["coupler"] == pytest.approx(way["coupler"], abs=1e-6)


SCISSORS = """hfsim: 1
parameters: {l: 0.6, n: N}
bodies:
  slider: {type: rigid, mass: 0.1, inertia: 1.0e-4}
  a{k=1..n}: {type: rigid, mass: 0.3, inertia: 0.01, points: {lo: ["${-l/2}", 0], hi: ["${l/2}", 0]}}
  b{k=1..n}: {type: rigid, mass: 0.3, inertia: 0.01, points: {lo: ["${-l/2}", 0], hi: ["${l/2}", 0]}}
joints:
  foot: {type: revolute, between: [ground, a1.lo]}
  rail: {type: prismatic, between: [ground, slider]}
  shoe: {type: revolute, between: [slider, b1.lo]}
  mid{k=1..n}: {type: revolute, between: ["a{k}", "b{k}"]}
  right{k=1..n-1}: {type: revolute, between: ["a{k}.hi", "b{k+1}.lo"]}
  left{k=1..n-1}: {type: revolute, between: ["b{k}.hi", "a{k+1}.lo"]}
  drive: {type: driver, between: [ground, slider], position: 0.5}
initial: {a1: {angle: 35 deg}, b1: {angle: 145 deg}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("pairs", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_other_ways_to_close_are_told_once_and_with_what_takes_each_and_no_other(tmp_path, pairs):
    """Of rough angles, which all ways have alike, it was said that they take each, and ways were told twice."""
    text = SCISSORS.replace("n: N", f"n: {pairs}")
    (tmp_path / "scissors.yaml").write_text(text)
    told = call("check", str(tmp_path / "scissors.yaml")).stdout
    ways = [re.findall(r"(\w+) (\S+) deg", way) for way in re.findall(r"or with (.*?): 'initial", told)]
    taking = [re.findall(r"(\w+): {angle: (\S+) deg}", one) for one in re.findall(r"'initial: {(.*)}'", told)]
    assert len(ways) == len(taking) == 2 ** (pairs - 1) - 1 and "other ways" not in told
    for way, angles in zip(ways, taking, strict=True):
        assert set(angles) < set(way) and [set(angles) <= set(one) for one in ways].count(True) == 1
    found = build(parse_deck(text, "deck", [f"initial.{name}.angle={turn} deg" for name, turn in taking[-1]])).assembly
    closed = [f"{np.degrees(found.poses[name].angle):.4g}" for name, _ in ways[-1]]
    assert closed == [turn for _, turn in ways[-1]]


def test_an_angle_that_joints_hold_anyway_repeats_no_way_to_close():
    loaded = parse_deck("""hfsim: 1
bodies:
  crank: {type: rigid, mass: 1.0, inertia: 0.1, points: {end: [0.3, 0.0]}}
  rod: {type: rigid, mass: 1.0, inertia: 0.1, points: {a: [-0.5, 0.0], b: [0.5, 0.0]}}
  block: {type: rigid, mass: 1.0, inertia: 0.1}
joints:
  axle: {type: revolute, between: [ground, crank]}
  pin: {type: revolute, between: [crank.end, rod.a]}
  wrist: {type: revolute, between: [rod.b, block]}
  guide: {type: prismatic, between: [ground, block], axis: [1, 0]}
initial: {crank: {angle: 40 deg}, block: {angle: 0.0}}
solve: {duration: 0.1}
""")
    (way,) = build(loaded).assembly.branches()
    assert way == {"rod": pytest.approx(np.arcsin(0.3 * np.sin(np.radians(40.0))) - np.pi, abs=1e-9)}


SLACK = """
hfsim: 1
gravity: {gravity}
ground: {{points: {{left: {left}, right: {right}}}}}
materials: {{m: {{density: 1000.0, youngs_modulus: 1.0e+7, poisson_ratio: 0.3}}}}
sections: {{s: {{shape: rectangle, width: 4.0e-4, height: 4.0e-4}}}}
bodies: {{rope: {{type: beam, material: m, section: s, elements: 16, element: cosserat, {length}}}}}
joints:
  one: {{type: {joint}, between: [ground.left, rope.root]}}
  other: {{type: {joint}, between: [ground.right, rope.tip]}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("span", [0.3, 0.8])
def test_what_hangs_slack_is_refused_with_the_arc_that_closes(span, space):
    """And at rest it hangs as a catenary, whose sag is known, where it is not bent too sharply for that."""
    points = {"left": "[0, 0, 0]", "right": f"[{span}, 0, 0]"} if space else {"left": "[0, 0]", "right": f"[{span}, 0]"}
    gravity, joint = ("[0.0, 0.0, -9.81]", "spherical") if space else ("[0.0, -9.81]", "revolute")
    deck = partial(SLACK.format, gravity=gravity, joint=joint, **points)
    problem = refused(parse_deck(deck(length="length: 1.0")))
    assert f"1 m long between points {span:g} m apart" in problem.message
    arc = re.search("'(axis: .*)' in place", problem.hint)[1]
    scene = build(parse_deck(deck(length=arc)))
    if span < 0.5:
        return
    line = scene.bodies["rope"].outline(at_rest(scene))[0]
    a = brentq(lambda a: 2.0 * a * np.sinh(0.5 * span / a) - 1.0, 0.02, 10.0)
    assert line[:, -1].min() == pytest.approx(a * (1.0 - np.cosh(0.5 * span / a)), rel=1e-2)


@pytest.mark.parametrize("space", [2, 3])
@pytest.mark.parametrize(
    "kind",
    [
        {"element": "cable", "degree": 5},
        {"element": "cosserat", "degree": 2},
        {"element": "continuum", "degree": 4, "section_degree": 3},
    ],
    ids=lambda kind: kind["element"],
)
def test_beams_know_how_many_coordinates_they_will_have(kind, space):
    beam = {"type": "beam", "material": "m", "section": "s", "length": 1.0, "elements": 3}
    deck = {
        "hfsim": 1,
        "gravity": [0.0] * space,
        "materials": {"m": {"density": 1.0, "youngs_modulus": 1.0}},
        "sections": {"s": {"shape": "rectangle", "width": 0.1, "height": 0.1}},
        "bodies": {"b": beam | kind},
        "solve": {"duration": 1.0},
    }
    loaded = hfsim.load(deck)
    columns = build(loaded).bodies["b"].columns
    assert loaded.deck.bodies["b"].size(space) == columns.stop - columns.start
