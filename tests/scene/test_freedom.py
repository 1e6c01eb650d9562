# ruff: noqa: E501
"""What the joints leave free: told by name, and warned of where it looks like a slip."""

import json
from pathlib import Path

import pytest
from called import call

from hfsim.commands.check import free_motions
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import check, simulate

CASES = Path(__file__).parents[2] / "cases"
DECKS = [path for path in sorted(CASES.rglob("*.yaml")) if path.name != "expected.yaml"]
HUB = "hub: {type: rigid, mass: 1.0, inertia: 0.1, points: {rim: [0.5, 0.0]}}"
ARM = "arm: {type: rigid, mass: 1.0, inertia: 0.1, points: {root: [-0.5, 0.0], tip: [0.5, 0.0]}}"
AXLE = "axle: {type: revolute, between: [ground, hub]}"
ELBOW = "elbow: {type: revolute, between: [hub.rim, arm.root]}"
MOTOR = "motor: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 1.0}}"
TRIM = "trim: {type: servo, between: [ground, hub], angle: 0.0, stiffness: 1.0}"
LEG = "{type: servo, between: [ground, hub], position: 0.0, stiffness: 1.0"
LEGS = [f"leg_x: {LEG}, axis: [1.0, 0.0]}}", f"leg_y: {LEG}, axis: [0.0, 1.0]}}"]


def scene(bodies, joints=(), extra="", gravity=0.0):
    entries = ("\n  ".join(["", *lines]) if lines else " {}" for lines in (bodies, joints))
    text = "hfsim: 1\ngravity: [0.0, {}]\nbodies:{}\njoints:{}\n{}\nsolve: {{duration: 0.01}}\n"
    return build(parse_deck(text.format(gravity, *entries, extra), "scene.yaml"))


def told(built):
    return [str(motion) for motion in built.free_motions]


def rigid_freedoms(built):
    """Number of rigid motions that the joints leave, from the rank of all their equations."""
    import numpy as np

    link = built.assembly.linkage
    return link.n - np.linalg.matrix_rank(link.equations.jacobians(built.assembly.place[None])[0], 1e-9)


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_shipped_cases_are_told_and_not_nagged(path):
    built = build(load_deck(path))
    told = ("bricard", "space_light_rod")  # one is held too often, one hardly has mass
    assert len(built.warnings) == (1 if path.stem in told else 0)
    rolls = 1 if path.stem == "pendulum_3d" else 0  # that of a line about itself is no motion
    assert sum(motion.number for motion in built.free_motions) == rigid_freedoms(built) - rolls


@pytest.mark.parametrize(
    ("bodies", "joints", "expected"),
    [
        ([HUB], [AXLE], ["hub: turns about axle"]),
        ([HUB], [AXLE.replace("hub]", "hub.rim]")], ["hub: turns about axle"]),
        ([HUB, ARM], [AXLE, ELBOW], ["hub: turns about axle", "arm: turns about elbow"]),
        ([ARM, HUB], [AXLE, ELBOW], ["hub: turns about axle", "arm: turns about elbow"]),
        ([HUB, ARM], [AXLE, ELBOW.replace("revolute", "fixed")], ["hub: turns about axle, with arm"]),
        ([HUB, ARM], [AXLE, MOTOR, ELBOW], ["arm: turns about elbow"]),
        ([HUB, ARM], [AXLE, MOTOR, ELBOW.replace("revolute", "fixed")], []),
        (
            [HUB],
            ["rail: {type: prismatic, between: [ground, hub], axis: [0.0, -2.0]}"],
            ["hub: slides along [0, 1]"],
        ),
        (
            [HUB],
            ["slot: {type: driver, between: [ground, hub], position: 0.0, axis: [0.0, 1.0]}"],
            ["hub: turns and slides: along [1, 0]"],
        ),
        ([HUB], [MOTOR], ["hub: floats: x, y"]),
        ([HUB, ARM], [ELBOW], ["hub: floats: x, y, turn", "arm: turns about elbow"]),
        (
            [HUB],
            [
                "a: {type: driver, between: [ground, hub], position: 0.0, axis: [1.0, 0.0]}",
                "b: {type: driver, between: [ground.far, hub.rim], position: 0.0, axis: [0.0, 1.0]}\nground: {points: {far: [0.5, 0.0]}}",
            ],
            ["hub: turns about [0.5, 0]"],
        ),
    ],
)
def test_free_motions_are_named(bodies, joints, expected):
    built = scene(bodies, joints)
    assert told(built) == expected
    assert sum(motion.number for motion in built.free_motions) == rigid_freedoms(built)


def test_an_undriven_four_bar_has_one_motion_that_takes_all_along():
    links = [ARM.replace("arm", name) for name in ("crank", "coupler", "rocker")]
    joints = [
        "axle: {type: revolute, between: [ground, crank.root]}",
        "left: {type: revolute, between: [crank.tip, coupler.root]}",
        "right: {type: revolute, between: [coupler.tip, rocker.tip]}",
        "foot: {type: revolute, between: [ground.far, rocker.root]}",
    ]
    built = scene(links, joints, "ground: {points: {far: [1.3, 0.0]}}\ninitial: {crank: {angle: 1.0}}")
    assert told(built) == ["crank: turns about axle, with rocker, coupler"]


@pytest.mark.parametrize(
    ("bodies", "joints", "extra", "gravity", "expected"),
    [
        ([HUB], [MOTOR], "", 0.0, "bodies.hub (line 4): floats, though 'motor' turns it"),
        ([HUB], [MOTOR], "", -9.81, "bodies.hub (line 4): floats, though 'motor' turns it"),
        ([HUB, ARM], [MOTOR, ELBOW], "", 0.0, "bodies.hub (line 4): floats, though 'motor' turns it"),
        (
            [HUB],
            [],
            "springs: {coil: {type: rotational, between: [ground, hub], stiffness: 1.0}}",
            0.0,
            "floats, though 'coil' turns it",
        ),
        (
            [HUB, ARM],
            [MOTOR, TRIM, ELBOW],
            "springs: {coil: {type: rotational, between: [hub.rim, arm.root], stiffness: 1.0}}",
            0.0,
            "bodies.hub (line 4): floats, though 'motor' and 'trim' turn it: no joint holds it in place; state a",
        ),
        ([HUB, ARM], [AXLE], "", 0.0, "bodies.arm (line 5): nothing connects 'arm' to the ground"),
        ([HUB, ARM], [ELBOW], "", -9.81, "bodies.hub (line 4): nothing connects 'hub', 'arm' to the ground"),
        ([HUB], [], "", -9.81, "bodies.hub (line 4): nothing connects 'hub' to the ground"),
        (
            [HUB, ARM],
            [AXLE.replace("hub", "arm"), "push: {type: motor, between: [ground, hub], force: 3.0}"],
            "",
            -9.81,
            "bodies.hub (line 4): nothing connects 'hub' to the ground",
        ),
        (
            [HUB, ARM],
            [AXLE, MOTOR],
            "initial: {arm: {position: [2.0, 0.0]}}",
            0.0,
            "joints.motor (line 8): moves 'hub' alone: nothing joins it to other bodies or resists it",
        ),
        (
            [HUB, ARM.replace("inertia: 0.1", "inertia: 1.0e-16").replace("-0.5", "0.0")],
            [AXLE, ELBOW],
            "",
            0.0,
            "hardly any mass resists this free motion: arm: turns about elbow",
        ),
    ],
)
def test_what_looks_like_a_slip_is_warned_of(bodies, joints, extra, gravity, expected):
    (warning,) = scene(bodies, joints, extra, gravity).warnings
    assert expected in warning


@pytest.mark.parametrize(
    ("bodies", "joints", "extra", "gravity"),
    [
        ([HUB], [], "initial: {hub: {velocity: [1.0, 0.0]}}", -9.81),
        ([HUB], [], "initial: {hub: {angular_velocity: 1.0}}", 0.0),
        ([HUB, ARM], [ELBOW], "initial: {hub: {angular_velocity: 1.0}}", 0.0),
        ([HUB, ARM], [ELBOW], "initial: {arm: {position: [0.0, 0.0]}}", -9.81),
        ([HUB, ARM], [AXLE], "initial: {arm: {position: [2.0, 0.0], velocity: [-1.0, 0.0]}}", 0.0),
        ([HUB], [], "springs: {cord: {type: two_point, between: [ground, hub.rim], stiffness: 1.0}}", -9.81),
        ([HUB], [], "loads: {push: {type: force, at: hub, force: [1.0, 0.0]}}", 0.0),
        ([HUB, ARM], [AXLE, MOTOR, ELBOW], "", -9.81),
        ([HUB, ARM], [MOTOR, ELBOW, LEGS[0], LEGS[1]], "", -9.81),
        ([HUB], LEGS, "", -9.81),
        ([HUB, ARM], [TRIM, ELBOW], "initial: {hub: {position: [0.0, 0.0], velocity: [0.0, 0.0]}}", 0.0),
        ([HUB, ARM], [MOTOR, ELBOW], "initial: {arm: {position: [0.5, 0.0]}}", 0.0),
        *(
            ([HUB, ARM], [AXLE.replace("hub]", f"hub], {resists}"), MOTOR], "initial: {arm: {position: [2.0, 0.0]}}", 0.0)
            for resists in ("damping: 1.0", "friction: {torque: 1.0}", "stops: {lower: -1.0, stiffness: 1.0e+3}")
        ),
    ],
)
def test_what_floats_on_purpose_is_not_nagged(bodies, joints, extra, gravity):
    assert scene(bodies, joints, extra, gravity).warnings == []


@pytest.fixture
def deck(tmp_path):
    text = f"hfsim: 1\nbodies:\n  {HUB}\njoints:\n  {MOTOR}\nsolve: {{duration: 0.01}}\n"
    (tmp_path / "hub.yaml").write_text(text)
    return str(tmp_path / "hub.yaml")


@pytest.mark.parametrize("command", ["check", "plan"])
def test_commands_tell_free_motions_and_warn(command, deck):
    result = call(command, deck)
    assert result.exit_code == 0
    assert (
        "free motions, bodies taken as rigid: 2\n" in result.stdout and "hub: floats: x, y\n" in result.stdout
    )
    assert "warning: bodies.hub (line 3): floats" in result.stderr
    (motion,) = json.loads(call(command, deck, "--json").stdout)["free_motions"]
    assert (motion["body"], motion["number"], motion["text"]) == ("hub", 2, "hub: floats: x, y")


def test_runs_warn_and_keep_the_motions_in_their_plan(deck):
    run = simulate(load_deck(deck), error_estimate=False)
    assert any("bodies.hub (line 3): floats" in one for one in run.statistics["warnings"])
    assert run.statistics["plan"]["free_motions"][0]["kind"] == "floats"


def test_mechanisms_of_many_bodies_are_not_told_apart():
    links = "".join(
        f"  r{k}: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{a: [-0.5, 0.0], b: [0.5, 0.0]}}}}\n"
        for k in range(101)
    )
    ends = ["ground, r0.a", *(f"r{k}.b, r{k + 1}.a" for k in range(100))]
    joints = "".join(f"  j{k}: {{type: revolute, between: [{end}]}}\n" for k, end in enumerate(ends))
    text = f"hfsim: 1\nbodies:\n{links}joints:\n{joints}solve: {{duration: 0.01}}\n"
    facts = check(parse_deck(text))
    assert facts["free_motions"] is None
    assert list(free_motions(facts)) == ["free motions: not told apart in mechanisms of so many bodies"]


def test_a_driver_whose_bearing_was_deleted_is_warned_of():
    """In a loop the other joints still hold the body somewhere: it slides where it was to turn."""
    bars = [
        "crank: {type: rigid, mass: 1.0, inertia: 0.01, points: {a: [-0.15, 0.0], b: [0.15, 0.0]}}",
        "coupler: {type: rigid, mass: 1.0, inertia: 0.1, points: {a: [-0.45, 0.0], b: [0.45, 0.0]}}",
        "rocker: {type: rigid, mass: 1.0, inertia: 0.05, points: {a: [-0.35, 0.0], b: [0.35, 0.0]}}",
    ]
    joints = [
        "o: {type: revolute, between: [ground, crank.a]}",
        "p: {type: revolute, between: [crank.b, coupler.a]}",
        "q: {type: revolute, between: [coupler.b, rocker.b]}",
        "r: {type: revolute, between: [ground.far, rocker.a]}",
        MOTOR.replace("hub", "crank"),
    ]
    far = "ground: {points: {far: [1.0, 0.0]}}"
    assert scene(bars, joints, far).warnings == []
    (warning,) = scene(bars, joints[1:], far).warnings
    assert "joints.motor" in warning
    assert "no joint holds 'crank' and 'ground' together" in warning
