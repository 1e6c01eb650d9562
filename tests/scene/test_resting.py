"""Scenes that start from equilibrium: they stay there, take stated rates, and tell where there is none."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import hfsim
from hfsim.errors import DeckError, NoStartError
from hfsim.output.comparison import as_text
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import find_deck
from hfsim.simulate import simulate
from hfsim.studies.compare.result import as_facts

ARM = """
hfsim: 1
name: arm
gravity: [0.0, -9.81]
materials: {m: {density: 2700.0, youngs_modulus: 7.0e9}}
sections: {s: {shape: rectangle, width: 0.02, height: 0.01}}
bodies:
  b: {type: beam, material: m, section: s, length: 1.0, elements: 2}
  c: {type: beam, material: m, section: s, length: 0.8, elements: 2}
joints:
  pin: {type: revolute, between: [ground, b.root]}
  hinge: {type: revolute, between: [b.tip, c.root]}
springs:
  k: {type: rotational, between: [ground, b], stiffness: 50.0}
  l: {type: rotational, between: [b, c], stiffness: 20.0}
initial: {equilibrium: true, b: {angle: 0.3}, c: {angle: 0.1}}
solve: {duration: 10.0, tolerance: 1.0e-9}
output: {channels: [b.tip.x, b.tip.y, c.tip.y, c.angle], plots: false, interval: 0.5}
"""
METHODS = ["gauss", "radau", "gear", "generalized_alpha", "energy"]


def swung(result):
    return max(float(np.abs(one.values - one.values[0]).max()) for one in result.channels)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", ["exact", pytest.param("lowOrder", marks=pytest.mark.slow)])
def test_it_stays_there(model, method):
    if (model, method) == ("lowOrder", "energy"):
        pytest.skip("the method needs a constant mass matrix")
    loaded = parse_deck(ARM, overrides=[f"solve.method={method}", f"solve.model={model}"])
    result = simulate(loaded, error_estimate=False)
    assert result.status == "done" and swung(result) < 1e-9
    assert result["b.tip.y"][0] < np.sin(0.3) - 0.1


@pytest.mark.slow
def test_it_stays_there_with_explicit_steps():
    changes = ["solve.method=explicit", "solve.duration=10.0", "solve.tolerance=1e-10"]
    changes += ["initial.equilibrium=true", "bodies.b1.elements=2"]
    assert swung(simulate(load_deck(find_deck("pendulum"), changes), error_estimate=False)) < 1e-9


def test_a_pendulum_in_space_stays_there():
    changes = ["initial.equilibrium=true", "initial.b1.angular_velocity=0.0", "solve.tolerance=1e-8"]
    result = simulate(load_deck(find_deck("pendulum_3d"), changes), error_estimate=False)
    assert result["b1.tip.z"] == pytest.approx(result["b1.tip.z"][0], abs=1e-9)
    assert result["b1.tip.z"][0] == pytest.approx(-1.25147689, abs=1e-7)


def test_stated_rates_come_on_top():
    rest = build(parse_deck(ARM))
    assert not rest.v.any()
    scene = build(
        parse_deck(ARM, overrides=["initial.b.angular_velocity=2.0", "initial.c.angular_velocity=2.0"])
    )
    assert scene.q == pytest.approx(rest.q, abs=1e-12)
    x, u = scene.system.absolute(scene.q[None]), scene.system.absolute_velocity(scene.q[None], scene.v[None])
    for point in ("b.tip", "c.tip"):
        place, rate = scene.marker(point).position(x)[0], scene.marker(point).velocity(x, u)[0]
        assert rate == pytest.approx((-2.0 * place[1], 2.0 * place[0]), abs=1e-9)


def test_some_bodies_rest_and_the_others_stay_where_they_are():
    scene = build(parse_deck(ARM, overrides=["initial.equilibrium=[c]"]))
    x = scene.system.absolute(scene.q[None])
    assert scene.marker("b.tip").position(x)[0] == pytest.approx((np.cos(0.3), np.sin(0.3)), abs=1e-12)
    before = build(parse_deck(ARM, overrides=["initial.equilibrium=false"]))
    fallen = scene.marker("c.tip").position(x) - before.marker("c.tip").position(
        before.system.absolute(before.q[None])
    )
    assert abs(fallen[0, 1]) > 0.05
    force = scene.system.force(np.zeros(1), x, np.zeros_like(x))
    own = scene.system.reduction.rows >= scene.bodies["c"].columns.start
    left = scene.system.reduction.free_force(force)[0, own]
    assert np.abs(left).max() < 1e-6


BOB = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies:
  arm: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.01]}
  bob: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.01], points: {top: [0, 0, 0.5]}}
joints:
  hinge: {type: revolute, between: [ground, arm]}
  hook: {type: spherical, between: [ground, bob.top]}
initial: {equilibrium: [bob]}
solve: {duration: 0.1}
"""


def test_what_nothing_holds_is_named_where_only_some_bodies_are_to_rest():
    """Its motions are of the part that could move: an internal error."""
    assert build(parse_deck(BOB)).warnings == [
        "initial.equilibrium: one equilibrium of many, since nothing resists: "
        "bob: turns about hook, 3 axes (1 of these)"
    ]
    with pytest.raises(DeckError, match="nothing holds what the loads push: bob: turns and slides: hook"):
        build(parse_deck(BOB.replace("spherical", "cylindrical")))


LINKS = """
hfsim: 1
gravity: [0.0, -9.81]
bodies:
  b: {type: rigid, mass: 1.0, inertia: 0.1, points: {root: [-0.5, 0.0], tip: [0.5, 0.0]}}
  c: {type: rigid, mass: 1.0, inertia: 0.1, points: {root: [-0.5, 0.0]}}
joints:
  pin: {type: revolute, between: [ground, b.root]}
  hinge: {type: revolute, between: [b.tip, c.root]}
initial: {equilibrium: [b]}
solve: {duration: 0.1}
"""


def test_what_joints_hold_at_both_ends_is_refused():
    """The link from the ground to a body that stays where it is."""
    with pytest.raises(DeckError, match="no place of rest is found: joints hold the same more than once"):
        build(parse_deck(LINKS))


def without(*lines):
    return "\n".join(line for line in ARM.splitlines() if not any(word in line for word in lines))


def test_what_cannot_rest_is_refused_at_its_place():
    why = r"initial\.equilibrium: there is none: nothing holds what the loads push"
    with pytest.raises(DeckError, match=why) as told:
        build(parse_deck(without("pin:", "  k:")))
    assert told.value.exit_code == 2
    upright = [f"initial.{body}.angle=1.5707963267948966" for body in "bc"]
    scene = build(parse_deck(without("springs", "  k:", "  l:"), overrides=upright))
    assert any("not stable" in one for one in scene.warnings)


@pytest.mark.parametrize(
    ("entry", "message"),
    [("[b, d]", "there is no body 'd'"), ("{bodies: [d]}", "there is no body 'd'"), ("3", "must be a map")],
)
def test_slips_in_it_are_told(entry, message):
    with pytest.raises(DeckError, match=message):
        parse_deck(ARM, overrides=[f"initial.equilibrium={entry}"])
    with pytest.raises(DeckError, match=r"must be a map of what is stated of a body"):
        parse_deck(ARM, overrides=["initial.b=true"])


def test_a_joint_may_have_the_name_of_the_start():
    deck = parse_deck(ARM.replace("pin:", "equilibrium:").replace("hinge:", "steady:")).deck
    assert deck.resting == ("b", "c") and hfsim.load(deck.resolved()).deck == deck


@pytest.mark.parametrize("entry", ["true", "false", "[c]"])
def test_a_resolved_deck_says_the_same(entry):
    deck = parse_deck(ARM, overrides=[f"initial.equilibrium={entry}"]).deck
    again = hfsim.load(deck.resolved()).deck
    assert again.resting == deck.resting and again.motions == deck.motions


def test_the_manipulator_takes_few_steps_for_many_digits():
    steps = []
    for tolerance in (1e-6, 1e-8):
        changes = [f"solve.tolerance={tolerance}", "output.plots=false"]
        result = simulate(load_deck(find_deck("manipulator"), changes), error_estimate=False)
        steps.append(result.statistics["steps"])
        assert result["shoulder.force_y"][0] == pytest.approx(74.71296, abs=1e-4)
    assert steps[1] <= 3 * steps[0]


SPIN = """
hfsim: 1
name: spin
gravity: [0.0, 0.0]
materials: {m: {density: 1.2, youngs_modulus: 2.8e7}}
sections: {s: {area: 1.0, second_moment: 5.0e-4}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 1.0}
  b: {type: beam, material: m, section: s, length: 10.0, elements: 8, degree: 5,
      strain: green, curvature: exact}
joints:
  pin: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub, b.root]}
initial: {steady: {body: hub, rate: 6.0}}
solve: {duration: 1.0, tolerance: 1.0e-9}
output: {channels: [b.tip.elongation, b.tip.deflection, b.angular_velocity], plots: false}
"""


@pytest.mark.parametrize(
    ("strain", "model", "extension"),
    [
        ("engineering", "exact", 5.14317455043403e-4),
        ("engineering", "lowOrder", 5.14317455043403e-4),
        ("green", "ancf", 5.14269846180301e-4),
    ],
)
def test_a_rod_that_turns_steadily_is_stretched_and_stays_so(strain, model, extension):
    loaded = parse_deck(SPIN, overrides=[f"solve.model={model}", f"bodies.b.strain={strain}"])
    result = simulate(loaded, error_estimate=False)
    assert result["b.tip.elongation"][0] == pytest.approx(extension, rel=1e-10)
    assert result["b.angular_velocity"][0] == pytest.approx(6.0, rel=1e-12)
    assert swung(result) < 1e-9


@pytest.mark.parametrize(("gravity", "lasts"), [(0.0, True), (-9.81, False)])
def test_a_rotation_that_weight_meets_otherwise_after_a_turn_is_told(gravity, lasts):
    warnings = build(parse_deck(SPIN, overrides=[f"gravity=[0.0, {gravity}]"])).warnings
    assert any("steady at the start alone" in one for one in warnings) is not lasts


@pytest.mark.parametrize(
    ("override", "path"),
    [
        ("initial.hub={angular_velocity: 3.0}", "initial.hub.angular_velocity"),
        ("initial.equilibrium=true", "initial.equilibrium"),
    ],
)
def test_what_a_steady_rotation_decides_cannot_be_stated_beside_it(override, path):
    with pytest.raises(DeckError) as caught:
        parse_deck(SPIN, overrides=[override])
    assert [one.path for one in caught.value.problems] == [path]
    assert parse_deck(SPIN, overrides=["initial.hub={angle: 0.3}", "initial.equilibrium=false"])


def test_a_free_body_turns_about_where_its_velocity_has_it():
    """On a spring of 8 N/m stretched by 0.5 m at 1 m from its foot: a circular orbit at 2 rad/s."""
    text = """hfsim: 1
bodies: {b: {type: rigid, mass: 1.0, inertia: 1.0}}
springs: {k: {type: two_point, between: [ground, b], stiffness: 8.0, rest_length: 0.5}}
initial: {steady: {body: b, rate: 2.0}, b: {position: [1.0, 0.0], velocity: [0.0, 2.0]}}
solve: {duration: 3.0, tolerance: 1.0e-9}
output: {channels: [b.x, b.y]}
"""
    run = simulate(parse_deck(text), error_estimate=False)
    assert np.hypot(run["b.x"], run["b.y"]) == pytest.approx(1.0, abs=1e-7)


PAIR = """hfsim: 1
gravity: [0.0, 0.0]
bodies:
  a: {type: rigid, mass: 2.0, inertia: 0.1}
  b: {type: rigid, mass: 1.0, inertia: 0.1}
springs: {s: {type: two_point, between: [a, b], stiffness: 100.0, rest_length: 2.0}}
joints: {r: {type: prismatic, between: [a, b], axis: [1, 0]}}
initial:
  steady: {body: a, rate: 3.0}
  a: {position: [0.5, 0.0], velocity: [0.3, -2.4]}
  r: {distance: 2.0}
solve: {duration: 1.0, tolerance: 1.0e-10}
output: {channels: [a.x, a.y, a.vx, a.vy, r.distance, momentum.linear_x, momentum.linear_y]}
"""
FREE = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies: {b: {type: rigid, mass: 2.0, inertia: [0.1, 0.2, 0.3]}}
joints: {}
initial: {steady: {body: b, rate: [0.0, 0.0, 3.0]}, b: {position: [1.0, 2.0, 3.0], velocity: [4.0, 5.0, 6.0]}}
solve: {duration: 0.5}
output: {channels: [b.x, b.y, b.z, b.angular_velocity_z]}
"""


def test_what_floats_starts_where_it_is_stated_and_moves_on_as_stated():
    """It is stretched to d, 100 (d - 2) = 9 (2/3) d, and its centre of mass d / 3 beside a moves evenly."""
    distance = 200.0 / 94.0
    run = simulate(parse_deck(PAIR), error_estimate=False)
    starts = [run[f"a.{name}"][0] for name in ("x", "y", "vx", "vy")]
    assert starts == pytest.approx([0.5, 0.0, 0.3, -2.4], abs=1e-12)
    assert run["r.distance"] == pytest.approx(distance, abs=1e-8)
    assert run["momentum.linear_x"] == pytest.approx(3.0 * 0.3, abs=1e-8)
    assert run["momentum.linear_y"] == pytest.approx(3.0 * (3.0 * distance / 3.0 - 2.4), abs=1e-8)
    assert not build(parse_deck(PAIR)).warnings


def test_a_free_body_in_space_moves_on_along_and_across_its_axis():
    run = simulate(parse_deck(FREE), error_estimate=False)
    ends = [run[f"b.{name}"][-1] for name in "xyz"]
    assert ends == pytest.approx([3.0, 4.5, 6.0], abs=1e-7)
    assert run["b.angular_velocity_z"] == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize("stated", ["b: {velocity: [0, 0, 0.7]}", "j: {distance_rate: 0.7}"])
def test_what_slides_along_its_axis_screws_on(stated):
    text = FREE.replace("{}", "{j: {type: cylindrical, between: [ground, b], axis: [0, 0, 1]}}")
    text = text.replace("b: {position: [1.0, 2.0, 3.0], velocity: [4.0, 5.0, 6.0]}", stated)
    run = simulate(parse_deck(text), error_estimate=False)
    assert run["b.z"][-1] - run["b.z"][0] == pytest.approx(0.35, abs=1e-9)
    spring = "springs: {k: {type: two_point, between: [ground, b], stiffness: 5}}"
    held = text.replace("initial:", f"{spring}\ninitial:")
    with pytest.raises(NoStartError, match=r"contradicts the steady rotation by 0\.7 m/s"):
        build(parse_deck(held))


@pytest.mark.parametrize(
    ("body", "entry"),
    [
        ("b", "{angular_velocity: 3.0}"),
        ("mount", "{angular_velocity: 0.1}"),
        ("b", "{angular_velocity: 5.9, exact: true}"),
    ],
)
def test_stated_rates_that_a_steady_rotation_does_not_have_are_refused(body, entry):
    hinged = SPIN.replace("mount: {type: fixed", "mount: {type: revolute")
    with pytest.raises(NoStartError, match="contradicts the steady rotation") as told:
        build(parse_deck(hinged, overrides=[f"initial.{body}={entry}"]))
    assert [one.path for one in told.value.problems] == [f"initial.{body}.angular_velocity"]


def test_a_stated_rate_near_that_of_a_steady_rotation_is_a_guess():
    hinged = SPIN.replace("mount: {type: fixed", "mount: {type: revolute")
    scene = build(parse_deck(hinged, overrides=["initial.b={angular_velocity: 6.2}"]))
    assert any("6.2 rad/s is taken as a guess: the steady rotation" in one for one in scene.warnings)
    assert scene.assembly.facts()["changed"] == [
        {"body": "b", "quantity": "angular_velocity", "stated": (6.2,), "taken": (pytest.approx(6.0),)}
    ]


def test_a_blade_in_space_turns_steadily_about_its_hub_s_axis():
    text = SPIN.replace("[0.0, 0.0]", "[0.0, 0.0, 0.0]").replace("inertia: 1.0", "inertia: [1.0, 1.0, 1.0]")
    text = text.replace("strain: green, curvature: exact", "element: cosserat")
    text = text.replace("youngs_modulus: 2.8e7", "youngs_modulus: 2.8e7, poisson_ratio: 0.3")
    text = text.replace("{area: 1.0, second_moment: 5.0e-4}", "{shape: rectangle, width: 0.5, height: 0.2}")
    scene = build(
        parse_deck(
            text.replace(", b.angular_velocity", ", b.angular_velocity_z").replace(
                "b.tip.deflection", "b.tip.deflection_y"
            )
        )
    )
    x, u = scene.system.absolute(scene.q[None]), scene.system.absolute_velocity(scene.q[None], scene.v[None])
    place, rate = scene.marker("b.tip").position(x)[0], scene.marker("b.tip").velocity(x, u)[0]
    assert place[0] == pytest.approx(10.0 + 1.2 * 36.0 * 1000.0 / (3.0 * 2.8e7), rel=1e-6)
    assert rate == pytest.approx((0.0, 6.0 * place[0], 0.0), abs=1e-9)


def test_what_cannot_turn_is_refused_at_its_place():
    held = SPIN.replace("joints:", "joints:\n  stop: {type: fixed, between: [ground, hub]}").replace(
        "  pin: {type: revolute, between: [ground, hub]}\n", ""
    )
    with pytest.raises(DeckError):
        build(parse_deck(held))
    with pytest.raises(DeckError, match="there is no body 'hob'"):
        parse_deck(SPIN, overrides=["initial.steady.body=hob"])
    with pytest.raises(DeckError, match="needs a body and its rate"):
        parse_deck(SPIN, overrides=["initial.steady=true"])


BALL = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies:
  hub:
    {type: rigid, mass: 1.0, inertia: [0.05, 0.06, 0.05],
     points: {p: [0.1, 0.2, -0.15], q: [0.25, 0.2, -0.3], c: [0.1, -0.2, 0.0]}}
  arm:
    {type: rigid, mass: 0.6, inertia: [0.05, 0.055, 0.06],
     points: {r: [-0.1, -0.2, 0.1], e: [0.0, 0.25, -0.2]}}
  ball: {type: rigid, mass: 0.5, inertia: [0.06, 0.055, 0.05], points: {r: [-0.15, -0.3, 0.25]}}
joints:
  axle: {type: revolute, between: [ground, hub.c], axis: [0, 0, 1]}
  hinge: {type: revolute, between: [hub.p, arm.r], axis: [-0.8, 0.7, 1.0]}
  socket: {type: spherical, between: [arm.e, ball.r]}
springs:
  coil: {type: rotational, between: [hub.p, arm.r], stiffness: 25.0, axis: [-0.8, 0.7, 1.0]}
  strut: {type: two_point, between: [hub.q, ball], stiffness: 120.0}
initial: {steady: {body: hub, rate: 0.0}}
solve: {duration: 0.5, tolerance: 1.0e-9}
output: {channels: [coil.angle, strut.distance]}
"""


@pytest.mark.parametrize(
    ("rate", "angle"),
    [(0.1, -3.24685198e-05), (0.5, -8.15744482e-04), (1.0, -3.30898e-3), (2.5, -2.166136e-2)],
)
def test_what_inertia_alone_turns_finds_its_steady_place(rate, angle):
    """The least of V - w^2 I / 2 by another program; the place turns on by rounding when nothing holds it."""
    run = hfsim.run(parse_deck(BALL), {"initial.steady.rate": rate}, error_estimate=False)
    assert run["coil.angle"][0] == pytest.approx(angle, rel=2e-6)
    assert run["coil.angle"] == pytest.approx(run["coil.angle"][0], abs=1e-9)
    assert run["strut.distance"] == pytest.approx(run["strut.distance"][0], abs=1e-9)


@pytest.mark.parametrize("text", [SPIN, BALL])
def test_a_steady_rotation_at_no_rate_is_rest(text):
    scene = build(parse_deck(text, overrides=["initial.steady.rate=0.0"]))
    resting = build(parse_deck(text, overrides=["initial={equilibrium: true}"]))
    assert not scene.v.any() and np.array_equal(scene.q, resting.q)
    pushed = ["initial.steady.rate=0.0", "loads={push: {type: moment, at: hub, moment: 1.0}}"]
    with pytest.raises(NoStartError, match=r"initial\.steady: there is none: nothing holds"):
        build(parse_deck(text, overrides=pushed))


UNBALANCED = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
ground: {points: {right: [1.0, 0.0, 0.0]}}
materials: {m: {density: 1.0, youngs_modulus: 2.1e11, poisson_ratio: 0.3}}
sections: {s: {shape: circle, diameter: 10 mm}}
bodies:
  left: {type: beam, material: m, section: s, length: 0.5, elements: 1}
  right: {type: beam, material: m, section: s, length: 0.5, elements: 1}
  disc: {type: rigid, mass: 2.0, inertia: [0.01, 0.005, 0.005], points: {hub: [0.0, -1.0e-5, 0.0]}}
joints:
  bearing: {type: revolute, between: [ground, left.root], axis: [1, 0, 0]}
  seat: {type: fixed, between: [left.tip, disc.hub]}
  other: {type: fixed, between: [disc.hub, right.root]}
  end: {type: spherical, between: [ground.right, right.tip]}
initial: {steady: {body: left, rate: [RATE, 0.0, 0.0]}}
solve: {duration: 0.01}
output: {channels: [left.tip.y, left.tip.z]}
"""


@pytest.mark.parametrize("rate", [30.0, 60.0, 90.0, 300.0])
def test_an_unbalanced_disc_turns_steadily_below_and_beyond_the_critical_speed(rate):
    """Beyond it its centre of mass goes inwards (de Laval): the way of the hub is e / (w^2 / rate^2 - 1)."""
    stiffness = 768.0 / 7.0 * 2.1e11 * np.pi * 0.005**4 / 4.0  # clamped at one end, pinned at the other
    run = hfsim.run(parse_deck(UNBALANCED.replace("RATE", str(rate))), error_estimate=False)
    exact = 1.0e-5 / (stiffness / 2.0 / rate**2 - 1.0)
    assert run["left.tip.y"][0] == pytest.approx(exact, rel=6e-3)
    way = np.hypot(run["left.tip.y"], run["left.tip.z"])
    assert way == pytest.approx(abs(exact) + 0.0 * way, rel=6e-3)


FLOATING = """hfsim: 1
gravity: [0, 0, 0]
materials: {carbon: {density: 1600, youngs_modulus: 70 GPa, poisson_ratio: 0.3}}
sections: {flat: {shape: rectangle, width: 0.6, height: 0.004}}
bodies:
  bus: {type: rigid, mass: 120, inertia: [12, 13, 15], points: {r: [0.5, 0, BESIDE]}}
  panel: {type: beam, material: carbon, section: flat, length: 1.0, elements: 2}
joints: {clamp: {type: fixed, between: [bus.r, panel.root]}}
initial: {steady: {body: bus, rate: RATE}, bus: {angle: 0, position: [0, 0, 0]}}
solve: {duration: 1}
"""


@pytest.mark.parametrize("rate", [1e-4, 0.02, 0.1144, 0.2, 1.0])
def test_what_floats_turns_about_its_centre_of_mass_at_any_rate(rate):
    """What holds free motions was more than inertia does at slow rates, at 0.1144 as much."""
    scene = build(parse_deck(FLOATING.replace("BESIDE", "0").replace("RATE", str(rate))))
    x, u = scene.system.absolute(scene.q[None]), scene.system.absolute_velocity(scene.q[None], scene.v[None])
    place, velocity = scene.marker("bus").position(x)[0], scene.marker("bus").velocity(x, u)[0]
    assert place == pytest.approx((0.0, 0.0, 0.0), abs=1e-8)
    assert velocity == pytest.approx((0.0, -rate * 3.84 / 123.84, 0.0), rel=1e-7, abs=1e-7 * rate)


def test_what_floats_turns_about_a_main_axis_of_inertia_or_is_refused():
    text = FLOATING.replace("BESIDE", "0.05")
    scene = build(parse_deck(text.replace("RATE", "1.0")))
    x = scene.system.absolute(scene.q[None])[0]
    assert x[scene.bodies["bus"].columns][5] == pytest.approx(-0.026870, rel=1e-4)
    with pytest.raises(DeckError, match="what inertia does is rounding") as caught:
        build(parse_deck(text.replace("RATE", "0.001")))
    assert "a lower rate" not in str(caught.value)


ROPE = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {m: {density: 5000.0, youngs_modulus: 1.0e11}}
sections: {s: {shape: circle, diameter: 0.016}}
bodies:
  rope: {type: beam, material: m, section: s, length: 8.0, elements: 4}
  load: {type: rigid, mass: 500.0, inertia: 50.0, points: {eye: [0.0, 0.5]}}
joints:
  sheave: {type: revolute, between: [ground, rope.root]}
  hook: {type: revolute, between: [rope.tip, load.eye]}
initial: {equilibrium: true, rope: {angle: -80 deg}}
solve: {duration: 0.01}
output: {channels: [load.x, load.y, rope.root.axial_force], plots: false}
"""


def test_a_model_that_leaves_out_what_holds_a_scene_is_blamed_by_name():
    with pytest.raises(NoStartError, match=r"with the model linear of rope.*exact") as told:
        build(parse_deck(ROPE, overrides=["solve.model=linear"]))
    assert "nothing holds" not in str(told.value)
    changes = {"initial.equilibrium": False, "solve.model": "linear"}
    found = hfsim.static(hfsim.load(yaml.safe_load(ROPE)), changes, check=False)
    assert found.failure["class"] == "model" and found.failure["item"] == "bodies.rope"


def test_a_scene_that_no_model_holds_is_blamed_itself():
    pushed = ROPE.replace("joints:", "loads: {push: {type: moment, at: load, moment: 1.0}}\njoints:")
    pushed = pushed.replace("[0.0, 0.5]", "[0.0, 0.0]")
    with pytest.raises(NoStartError, match="nothing holds what the loads push: load"):
        build(parse_deck(pushed, overrides=["solve.model=linear"]))


def test_a_comparison_goes_on_without_a_model_that_has_no_start():
    found = hfsim.compare(hfsim.load(yaml.safe_load(ROPE)), ["rigid", "linear"], repeats=1)
    assert [one.model for one in found.models] == ["rigid", "linear", "exact"]
    refused = found.result("linear")
    assert refused.status == "refused" and "the model linear of rope" in refused.reason
    assert set(found.runs) == {"rigid", "exact"} and found.verdict == "exact"
    told = as_text(found, Path("out"))
    assert "linear has no start: initial.equilibrium: there is none" in told
    assert as_facts(found)["models"]["linear"]["status"] == "refused"
    with pytest.raises(NoStartError):
        hfsim.compare(hfsim.load(yaml.safe_load(ROPE)), ["linear"], reference="linear")
