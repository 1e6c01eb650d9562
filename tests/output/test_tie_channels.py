# ruff: noqa: E501
"""Channels of joints and springs, and accelerations: laws of what acts, slopes of what moves, balance of power."""

import numpy as np
import pytest
from solved import solved

from hfsim.errors import DeckError
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

PLANE = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {nylon: {density: 1150.0, youngs_modulus: 3.0e7}}
sections: {strip: {shape: rectangle, width: 5 cm, height: 4 cm}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.1, points: {rim: [0.2, 0.0]}}
  arm: {type: beam, material: nylon, section: strip, length: 1.0, elements: 1}
  bob: {type: rigid, mass: 0.3, inertia: 0.01}
joints:
  axle: {type: revolute, between: [ground, hub]}
  turn: {type: motor, between: [ground, hub], torque: 9.0, law: {expression: "cos(t)"}}
  mount: {type: fixed, between: [hub.rim, arm.root]}
  pin: {type: revolute, between: [arm.tip, bob], damping: 0.02}
  hold: {type: servo, between: [hub, arm.tip], position: {expression: "1.2 + 0.1 * sin(3 * t)"}, stiffness: 3.0, damping: 0.1}
springs:
  coil: {type: rotational, between: [ground, hub], stiffness: 2.0, damping: 0.1}
  rope: {type: two_point, between: [ground, arm.tip], stiffness: 20.0, damping: 0.3, rest_length: 0.9}
  idle: {type: two_point, between: [ground, bob], stiffness: 0.0}
solve: {model: MODEL, duration: 0.2, tolerance: 1.0e-9}
output: {interval: 2.0e-5, plots: false, channels: [CHANNELS]}
"""
SPACE = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {nylon: {density: 1150.0, youngs_modulus: 3.0e7}}
sections: {strip: {shape: rectangle, width: 5 cm, height: 4 cm}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.15], points: {rim: [0.2, 0.0, 0.0], top: [0.0, 0.0, 0.3]}}
  arm: {type: beam, material: nylon, section: strip, length: 0.6, elements: 1}
  ring: {type: rigid, mass: 0.3, inertia: [0.01, 0.02, 0.012]}
joints:
  axle: {type: revolute, between: [ground, hub], axis: [0.0, 0.3, 1.0]}
  turn: {type: motor, between: [ground, hub], axis: [0.0, 0.3, 1.0], torque: 9.0, law: {expression: "cos(t)"}}
  mount: {type: fixed, between: [hub.rim, arm.root]}
  slide: {type: cylindrical, between: [hub.top, ring], axis: [0.1, 1.0, 0.2], turning: {damping: 0.05}}
  hold: {type: servo, between: [hub.top, ring], axis: [0.1, 1.0, 0.2], position: 0.03, stiffness: 80.0, damping: 0.2}
springs:
  coil: {type: rotational, between: [hub.top, ring], axis: [0.1, 1.0, 0.2], stiffness: 0.2, damping: 0.01}
  rope: {type: two_point, between: [ground, arm.tip], stiffness: 20.0, damping: 0.3, rest_length: 0.9}
initial: {hub: {angular_velocity: [0.0, 1.2, 4.0]}}
solve: {model: MODEL, duration: 0.2, tolerance: 1.0e-9}
output: {interval: 2.0e-5, plots: false, channels: [CHANNELS]}
"""


def histories(deck, channels, model="exact", **others):
    """Times and the columns asked for."""
    text = deck.replace("MODEL", model).replace("CHANNELS", ", ".join(channels))
    for old, new in others.items():
        assert old in text
        text = text.replace(old, new)
    values, run = solved(text)
    return run.t, dict(zip(channels, values.T, strict=True))


def slope(t, values):
    """Derivative at the times but for two at each end, of fourth order."""
    return (values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]) / (12.0 * (t[1] - t[0]))


def assert_slope(t, values, expected, name):
    size = np.abs(expected).max()
    assert size > 1e-3, name
    assert slope(t, values) == pytest.approx(expected[2:-2], abs=1e-5 * size), name


MODELS = [(PLANE, "exact"), (PLANE, "linear"), (PLANE, "lowOrder"), (SPACE, "exact"), (SPACE, "linear"), (SPACE, "ancf")]


@pytest.mark.parametrize(("deck", "model"), MODELS)
def test_rates_are_slopes(deck, model):
    spatial = deck is SPACE
    axes = "xyz" if spatial else "xy"
    pairs = {f"arm.tip.v{axis}": f"arm.tip.a{axis}" for axis in axes}
    body, turned = ("ring", [f"_{axis}" for axis in "xyz"]) if spatial else ("bob", [""])
    for name in (body, "arm"):
        own = turned[1:] if name == "arm" else turned  # its hub's axle has no x
        pairs |= {f"{name}.angular_velocity{axis}": f"{name}.angular_acceleration{axis}" for axis in own}
    hinge = "slide" if spatial else "pin"
    pairs |= {f"{hinge}.angle": f"{hinge}.angular_velocity", "axle.angle": "axle.angular_velocity"}
    pairs |= {f"{tie}.distance": f"{tie}.distance_rate" for tie in ("rope", "hold")}
    more = {"elements: 1": "elements: 1, section_angle: 0.3"} if spatial else {}
    t, found = histories(deck, [*pairs, *pairs.values(), "arm.tip.acceleration"], model, **more)
    for value, rate in pairs.items():
        assert_slope(t, found[value], found[rate], rate)
    size = np.sqrt(sum(found[f"arm.tip.a{axis}"] ** 2 for axis in axes))
    assert found["arm.tip.acceleration"] == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize("deck", [PLANE, SPACE])
def test_what_is_exerted_follows_the_laws_of_the_deck(deck):
    of_coil = "slide" if deck is SPACE else "axle"
    names = ["turn.torque", "axle.torque", "hold.distance", "hold.distance_rate", "hold.force", "coil.angle"]
    names += ["coil.angular_velocity", "coil.torque", "rope.distance", "rope.distance_rate", "rope.force"]
    names += [f"{of_coil}.angle", f"{of_coil}.angular_velocity", "slide.torque" if deck is SPACE else "pin.torque"]
    t, found = histories(deck, names)
    assert found["turn.torque"] == pytest.approx(9.0 * np.cos(t), abs=1e-12)
    assert found["axle.torque"] == pytest.approx(0.0, abs=1e-12)
    stiffness, damping, goal, rate = 3.0, 0.1, 1.2 + 0.1 * np.sin(3.0 * t), 0.3 * np.cos(3.0 * t)
    if deck is SPACE:
        stiffness, damping, goal, rate = 80.0, 0.2, 0.03, 0.0
        assert found["slide.torque"] == pytest.approx(-0.05 * found["slide.angular_velocity"], abs=1e-12)
    asked = stiffness * (goal - found["hold.distance"]) + damping * (rate - found["hold.distance_rate"])
    assert found["hold.force"] == pytest.approx(asked, abs=1e-12)
    k, d = (0.2, 0.01) if deck is SPACE else (2.0, 0.1)
    assert found["coil.angle"] == pytest.approx(found[f"{of_coil}.angle"], abs=1e-12)
    assert found["coil.torque"] == pytest.approx(-k * found["coil.angle"] - d * found["coil.angular_velocity"], abs=1e-12)
    assert found["rope.force"] == pytest.approx(
        -20.0 * (found["rope.distance"] - 0.9) - 0.3 * found["rope.distance_rate"], abs=1e-12
    )


@pytest.mark.parametrize("deck", [PLANE, SPACE])
def test_powers_balance_what_moves(deck):
    """Without weight, kinetic and strain energy change by the powers of all joints and springs."""
    ties = ["axle", "turn", "mount", "hold", "coil", "rope", "slide" if deck is SPACE else "pin"]
    weight = {"-9.81": "0.0"}
    t, found = histories(deck, ["energy.kinetic", "energy.strain", *(f"{tie}.power" for tie in ties)], **weight)
    powers = sum(found[f"{tie}.power"] for tie in ties)
    assert all(np.abs(found[f"{tie}.power"]).max() < 1e-12 for tie in ("axle", "mount"))
    assert all(np.abs(found[f"{tie}.power"]).max() > 1e-3 for tie in ties[3:])
    assert_slope(t, found["energy.kinetic"] + found["energy.strain"], powers, "power")


DRIVEN = """
hfsim: 1
gravity: [GRAVITY]
bodies:
  hub: {type: rigid, mass: 2.0, inertia: INERTIA, points: {rim: POINT}}
  bob: {type: rigid, mass: 0.5, inertia: INERTIA}
joints:
  JOINTS
springs: {coil: {type: rotational, between: [hub.rim, bob], stiffness: 3.0}}
solve: {duration: 2.0, tolerance: 1.0e-9}
output: {interval: 2.0e-3, plots: false, channels: [energy.total, lead.power, lead.TORQUE, lead.RATE, pin.angle]}
"""
PLANAR = {"GRAVITY": "0.0, -9.81", "INERTIA": "0.1", "POINT": "[0.7, 0.0]"}
SPATIAL = {"GRAVITY": "0.0, -9.81, 0.0", "INERTIA": "[0.1, 0.2, 0.15]", "POINT": "[0.7, 0.0, 0.1]"}
HINGED = "axle: {type: revolute, between: [ground, hub]}, pin: {type: revolute, between: [hub.rim, bob]}"
TURNED = HINGED + ', lead: {type: driver, between: [ground, hub], angle: {expression: "sin(2 * t)"}}'
PUSHED = (
    "slide: {type: prismatic, between: [ground, hub], axis: AXIS}, pin: {type: revolute, between: [hub.rim, bob]},"
    ' lead: {type: driver, between: [ground, hub], axis: AXIS, position: {expression: "0.3 * sin(4 * t)"}}'
)
SHAKEN = (
    'lead: {type: motion, between: [ground, hub], x: {expression: "0.3 * sin(4 * t)"}, y: {expression: "0.2 * t"}},'
    " pin: {type: revolute, between: [hub.rim, bob]}"
)


@pytest.mark.parametrize("space", [PLANAR, SPATIAL])
@pytest.mark.parametrize(("joints", "torque", "rate"), [(TURNED, "torque", "angular_velocity"), (PUSHED, "force", "distance_rate"), (SHAKEN, "force_x", "force_y")])
def test_drivers_put_in_what_the_energy_gains(space, joints, torque, rate):
    text, axis = DRIVEN, "[0.6, 0.8, 0.0]" if space is SPATIAL else "[0.6, 0.8]"
    for old, new in {**space, "JOINTS": "", "TORQUE": torque, "RATE": rate}.items():
        text = text.replace(old, new)
    text = text.replace("joints:\n  \n", "joints: {" + joints.replace("AXIS", axis) + "}\n")
    values, run = solved(text)
    total, power, effort, speed, _ = values.T
    assert_slope(run.t, total, power, "lead.power")
    if joints is not SHAKEN:
        assert power == pytest.approx(effort * speed, abs=1e-9 * np.abs(power).max())


SPUN = """
hfsim: 1
gravity: [GRAVITY]
materials: {rubber: {density: 1150.0, youngs_modulus: 3.0e7}}
sections: {strip: {shape: rectangle, width: 5 cm, height: 4 cm}}
bodies:
  a: {type: beam, material: rubber, section: strip, length: 0.5, elements: 1}
  b: {type: beam, material: rubber, section: strip, length: 0.5, elements: 1}
joints:
  axle: {type: revolute, between: [ground, a.root]}
  pin: {type: revolute, between: [a.tip, b.root]}
springs: {meter: {type: rotational, between: [b.root, a.tip], stiffness: 0.0}}
initial: {a: {TURN: FIRST, angular_velocity: SPIN}, b: {TURN: SECOND, angular_velocity: OTHER}}
solve: {model: exact, duration: 2.0, tolerance: 1.0e-6}
output: {interval: 0.002, plots: false, channels: [CHANNELS]}
"""
FLAT = {"AXIS": "", "GRAVITY": "0.0, -1.0", "TURN": "angle", "FIRST": "7.0", "SECOND": "-6.0", "SPIN": "9.0", "OTHER": "-12.0"}
DEEP = {"AXIS": "_z", "GRAVITY": "0.0, -1.0, 0.0", "TURN": "orientation", "FIRST": "{axis: [0, 0, 1], angle: 7.0}"}
DEEP |= {"SECOND": "{axis: [0, 0, 1], angle: -6.0}", "SPIN": "[0.0, 0.0, 9.0]", "OTHER": "[0.0, 0.0, -12.0]"}


@pytest.mark.parametrize("words", [FLAT, DEEP])
def test_angles_that_nothing_resists_count_all_turns(words):
    """From what the deck states on, as the integral of their rates."""
    text = SPUN
    for old, new in words.items():
        text = text.replace(old, new)
    names = ["axle.angle", "pin.angle", "meter.angle", "axle.angular_velocity", "pin.angular_velocity"]
    t, found = histories(text, names)
    assert [found[name][0] for name in names[:3]] == pytest.approx([7.0, -13.0, 13.0], abs=1e-9)
    for tie in ("axle", "pin"):
        assert np.ptp(found[f"{tie}.angle"]) > 2.0 * np.pi
        rates = found[f"{tie}.angular_velocity"]
        turned = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(t))])
        assert found[f"{tie}.angle"] - found[f"{tie}.angle"][0] == pytest.approx(turned, abs=0.02)
    assert found["meter.angle"] == pytest.approx(-found["pin.angle"], abs=1e-9)


@pytest.mark.parametrize(
    ("channel", "words"),
    [
        ("mount.angle", "'mount' has no quantity 'angle'"),
        ("mount.power", ""),
        ("turn.distance", "'turn' has no quantity 'distance'"),
        ("hold.angle", "'hold' has no quantity 'angle'"),
        ("rope.torque", "'rope' has no quantity 'torque' (known: force_x, force_y, moment, distance, distance_rate, force, power)"),
        ("ropes.force", "there is no body, joint or spring 'ropes' (did you mean 'rope'?)"),
        ("pin.force_z", "'pin' has no quantity 'force_z'"),
        ("arm.tip.az", "a planar scene has no az ('arm.tip.ax' or 'arm.tip.ay'"),
    ],
)
def test_only_what_a_joint_or_a_spring_has_is_a_channel_of_it(channel, words):
    text = PLANE.replace("MODEL", "exact").replace("CHANNELS", channel)
    if not words:
        parse_deck(text)
        return
    with pytest.raises(DeckError) as caught:
        parse_deck(text)
    assert words in str(caught.value)


def test_an_angle_about_a_line_without_sections_is_refused():
    text = SPACE.replace("MODEL", "exact").replace("elements: 1}", "elements: 1, element: cable}").replace("4 cm", "5 cm")
    text = text.replace("mount: {type: fixed, between: [hub.rim, arm.root]}", "mount: {type: revolute, between: [hub.rim, arm.root], axis: [1.0, 0.0, 0.0]}")
    with pytest.raises(DeckError, match=r"mount\.angle: of a line without sections there is no such angle about its axis"):
        build(parse_deck(text.replace("CHANNELS", "mount.angle")))


def test_joint_and_spring_of_one_name_have_reactions_alone():
    text = PLANE.replace("MODEL", "exact").replace("coil:", "pin:")
    parse_deck(text.replace("CHANNELS", "pin.moment"))
    with pytest.raises(DeckError, match=r"a joint and a spring are called 'pin' \(choose another name for one of them\)"):
        parse_deck(text.replace("CHANNELS", "pin.torque"))


def test_angles_keep_their_turns_where_the_model_changes():
    text = SPUN
    for old, new in (FLAT | {"model: exact": "model: auto", "3.0e7": "1.0e9", "elements: 1": "elements: 3"}).items():
        text = text.replace(old, new)
    t, found = histories(text, ["pin.angle", "pin.angular_velocity"])
    _, run = solved(text.replace("CHANNELS", "pin.angle, pin.angular_velocity"))
    assert run.statistics["auto"]["switches"]
    rates = found["pin.angular_velocity"]
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(t))])
    assert np.ptp(turned) > 2.0 * np.pi
    assert found["pin.angle"] == pytest.approx(turned - 13.0, abs=0.02)


@pytest.mark.parametrize("words", [FLAT, DEEP])
def test_angular_accelerations_of_slopes_that_stretch_are_slopes(words):
    text = SPUN.replace("3.0e7", "3.0e5").replace("duration: 2.0, tolerance: 1.0e-6", "duration: 0.1, tolerance: 1.0e-10")
    for old, new in (words | {"interval: 0.002": "interval: 1.0e-4"}).items():
        text = text.replace(old, new)
    pairs = {f"{name}.angular_velocity{axis}": f"{name}.angular_acceleration{axis}" for name in "ab" for axis in [words["AXIS"]]}
    t, found = histories(text, [*pairs, *pairs.values()])
    for value, rate in pairs.items():
        assert_slope(t, found[value], found[rate], rate)


def test_the_torque_of_a_motor_is_what_it_exerts_however_its_body_is_tilted():
    text = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies: {top: {type: rigid, mass: 1.0, inertia: [0.1, 0.2, 0.3]}}
joints:
  ball: {type: spherical, between: [ground, top]}
  turn: {type: motor, between: [ground, top], torque: 0.5}
initial: {top: {angular_velocity: [2.0, 0.0, 0.0]}}
solve: {duration: 1.0}
output: {interval: 0.1, plots: false, channels: [turn.torque, turn.moment_z, top.quaternion_w]}
"""
    values, _ = solved(text)
    assert values[-1, 2] < 0.6
    assert values[:, :2] == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize("n_dim", [2, 3])
def test_springs_between_points_that_are_kept_together_act_on_nothing(n_dim):
    """Where rounding keeps them apart there is no direction either: the pin bears m w^2 r alone."""
    third, about = [", 0.2", "[0.0, 0.0, 1.0]"] if n_dim == 3 else ["", "1.0"]
    text = f"""
hfsim: 1
gravity: [0.0, 0.0{", 0.0" if n_dim == 3 else ""}]
ground: {{points: {{P: [0.1, 0.7{third}]}}}}
bodies: {{a: {{type: rigid, mass: 2.0, inertia: {"[0.1, 0.1, 0.1]" if n_dim == 3 else 0.1}, points: {{p: [0.31, 0.17{third and ", 0.0"}]}}}}}}
joints: {{pin: {{type: revolute, between: [ground.P, a.p]}}}}
springs: {{s: {{type: two_point, between: [ground.P, a.p], stiffness: 10.0, damping: 0.5, preload: 2.0, rest_length: 0.0}}}}
initial: {{a: {{angular_velocity: {about}}}}}
solve: {{duration: 1.0, tolerance: 1.0e-9}}
output: {{interval: 0.1, plots: false, channels: [pin.force_x, pin.force_y, s.force_x, s.force_y, s.distance]}}
"""
    values, _ = solved(text)
    assert np.hypot(values[:, 0], values[:, 1]) == pytest.approx(2.0 * np.hypot(0.31, 0.17), abs=1e-7)
    assert not values[:, 2:].any()
