"""Steps are guessed along rigid motions of everything: turns about axes that stand still or move evenly."""

import numpy as np
import pytest

from hfsim.marching.integration import problem_of, run_integration
from hfsim.maths.rotations import rotation
from hfsim.mechanics.carrying import Carrying, CarryingApart
from hfsim.mechanics.turning import Turning, undriven
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

BLADES = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10, bending_damping: 1.0e-4, axial_damping: 1.0e-4}}
sections: {blade: {shape: rectangle, width: 0.2, height: 0.02}}
bodies:
  hub: {type: rigid, mass: 20.0, inertia: INERTIA, points: {one: ONE, other: OTHER}}
  front: {type: beam, material: alloy, section: blade, length: 4.0, elements: 1}
  back: {type: beam, material: alloy, section: blade, length: 4.0, elements: 1}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.one, front.root]}
  counter: {type: fixed, between: [hub.other, back.root], angle: 3.141592653589793}
  drive: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 30.0}}
initial: {steady: {body: hub, rate: 30.0}}
solve: {duration: 2.0, tolerance: 1.0e-5}
output: {interval: 0.5, channels: [front.tip.x, front.tip.y]}
"""
SPACE = {"INERTIA": "[1.0, 1.0, 1.0]", "ONE": "[0.3, 0.0, 0.0]", "OTHER": "[-0.3, 0.0, 0.0]"}
PLANE = {"[0.0, 0.0, 0.0]": "[0.0, 0.0]", "INERTIA": "1.0", "ONE": "[0.3, 0.0]", "OTHER": "[-0.3, 0.0]"}


def blades(words, *changes):
    text = BLADES
    for old, new in [*words.items(), *changes]:
        assert old in text
        text = text.replace(old, new)
    return build(parse_deck(text))


FLYING = (
    ("  axle: {type: revolute, between: [ground, hub]}\n", ""),
    ("  drive: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 30.0}}\n", ""),
    ("initial: {steady: {body: hub, rate: 30.0}}", "initial: {hub: {position: [5.0, -3.0, 1.0]}}"),
)
TIMES = np.array([0.02, 0.1, 0.13])


def carried(scene, spin, centre, velocity):
    """What is carried along of a rigid motion, and where that leads."""
    system = scene.system
    turn = Turning.of(scene.bodies.values(), spin, centre, velocity=velocity)
    x = system.absolute(scene.q[None])
    v, a = (system.reduction.free_rates(one)[0] for one in (turn.rates(x), turn.accelerations(x)))
    found = problem_of(scene).carrying().along(scene.q, v, a, TIMES)
    ways = [turn.turned(x, t)[0] + t * turn.travel for t in TIMES]
    return found, system.reduction.free(np.array(ways)) - scene.q, turn


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (3.0, -1.0, 2.0)])
def test_rigid_motions_are_carried_along(velocity):
    """Whatever axis they turn about, and if it moves on; weights that keep factors apart cost some digits."""
    scene = blades(SPACE, *FLYING)
    found, expected, _ = carried(scene, [4.0, -2.0, 11.0], [0.5, 1.5, -0.7], velocity)
    assert np.abs(expected).max() > 1.0
    assert found.moved == pytest.approx(expected, abs=2e-5)
    assert np.abs(found.v).max() < 2e-5 and np.abs(found.a).max() < 2e-3


def test_what_is_left_turns_along(rng):
    scene, spin = blades(SPACE, *FLYING), np.array([4.0, -2.0, 11.0])
    found, _, turn = carried(scene, spin, np.zeros(3), np.zeros(3))
    changes = rng.normal(size=(len(TIMES), scene.system.n))
    whole = scene.system.reduction.expand_rates(changes).reshape(len(TIMES), -1, 3)
    expected = [one @ rotation(t * spin).T for one, t in zip(whole, TIMES, strict=True)]
    expected = scene.system.reduction.free_rates(np.reshape(expected, (len(TIMES), -1)))
    assert found.seen(changes) == pytest.approx(expected, abs=2e-5)
    assert turn.rate > 1.0


def test_of_what_does_not_move_as_one_the_nearest_rigid_motion_is_carried(rng):
    """What is left has no momentum and no angular momentum."""
    scene = blades(SPACE, *FLYING)
    carrying = problem_of(scene).carrying()
    found = carrying.along(scene.q, *rng.normal(size=(2, scene.system.n)), TIMES)
    x, bodies = scene.system.absolute(scene.q[None]), scene.bodies.values()
    rates = np.concatenate([one.rates(x) for one in Turning.units(bodies, 3)])
    units = scene.system.reduction.free_rates(rates)
    sizes = np.sqrt(np.sum(units @ carrying.mass * units, axis=1) * (found.v @ carrying.mass @ found.v))
    assert (units @ carrying.mass @ found.v) / sizes == pytest.approx(0.0, abs=1e-5)


SWINGING = """
hfsim: 1
gravity: [0.0, -9.81, 0.0]
materials: {steel: {density: 5540.0, youngs_modulus: 7.0e9, poisson_ratio: 0.3}}
sections: {strip: {shape: rectangle, width: 0.2, height: 9.0e-3}}
bodies: {arm: {type: beam, material: steel, section: strip, length: 1.2, elements: 4}}
joints: {pin: {type: revolute, between: [ground.here, arm.root]}}
ground: {points: {here: [2.0, 1.0, 0.5]}}
initial: {arm: {angular_velocity: [0.0, 0.0, 3.0]}}
solve: {duration: 1.0, tolerance: 1.0e-5}
output: {interval: 0.5, channels: [arm.tip.x]}
"""


FREEDOMS = {"revolute": 1, "spherical": 3, "prismatic": 1, "cylindrical": 2, "fixed": 0}


@pytest.mark.parametrize(("joint", "count"), FREEDOMS.items())
def test_only_what_joints_with_the_ground_allow_is_carried(joint, count, rng):
    """What is held stands still, and nothing is strained, whatever the beam does otherwise."""
    scene = build(parse_deck(SWINGING.replace("revolute", joint).replace(", 3.0]", ", 0.0]")))
    x = scene.system.absolute(scene.q[None])
    units = np.concatenate([one.rates(x) for one in Turning.units(scene.bodies.values(), 3)])
    ways = undriven(scene.system.equations, x[0], units)
    carrying = problem_of(scene).carrying()
    assert len(ways) == count
    assert (carrying is None) == (joint in ("prismatic", "fixed"))
    if carrying is not None:
        v = 0.5 * rng.normal(size=scene.system.n)
        whole = scene.system.reduction.expand_rates((v - carrying.along(scene.q, v, v, TIMES).v)[None])
        rigid = np.linalg.lstsq(units.T, whole[0])[0] @ units
        assert np.abs(whole).max() > 0.05 and rigid == pytest.approx(whole[0], abs=1e-9)


def test_pendulums_that_vibrate_take_few_iterations():
    """Shifts of everything that the pin forbids were guessed too: before 357."""
    scene = build(parse_deck(SWINGING.replace("[0.0, 0.0, 3.0]", "[0.0, 0.0, 0.0]")))
    assert run_integration(scene, scene.deck.solve).problem.counts.iterations < 200


def test_large_scenes_are_carried_along_as_small_ones(monkeypatch):
    """With sparse matrices: before, they took nine times the iterations."""
    small = blades(SPACE)
    monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 0)
    large = blades(SPACE)
    a = problem_of(small).single(0.0, small.q, small.v)
    one, other = (problem_of(scene).carrying().along(small.q, small.v, a, TIMES) for scene in (small, large))
    np.testing.assert_allclose(other.moved, one.moved, atol=1e-9)
    done = [run_integration(scene, scene.deck.solve).problem.counts.iterations for scene in (small, large)]
    assert done[1] < 1.2 * done[0]


def test_what_does_not_move_along_the_axis_says_nothing_of_it():
    """Turns about an axis of the ground: shifts along it do not whirl, and rounding is no rate."""
    scene = blades(SPACE, ("elements: 1", "elements: 2"))
    problem, times = problem_of(scene), np.array([2e-5, 4e-5])
    found = problem.carrying().along(scene.q, scene.v, problem.single(0.0, scene.q, scene.v), times)
    assert found.moved == pytest.approx(times[:, None] * scene.v, abs=1e-5)


def test_only_vectors_are_carried():
    assert problem_of(blades(PLANE)).carrying() is None
    assert isinstance(problem_of(blades(SPACE)).carrying(), Carrying)
    framed = blades(SPACE, ("duration: 2.0", "coordinates: frame, duration: 2.0"))
    assert problem_of(framed).carrying() is None


@pytest.mark.parametrize(("words", "most"), [(PLANE, 250), (SPACE, 700)])
def test_steady_rotors_take_few_iterations(words, most):
    """Steps are bounded by the error, not by how far a turn of 60 rad can be guessed: before 1050, 5300."""
    scene = blades(words)
    done = run_integration(scene, scene.deck.solve)
    assert done.problem.counts.iterations < most
    where = scene.marker("front.tip").position(scene.system.absolute(done.trajectory.q[None]))[0][:2]
    start = scene.marker("front.tip").position(scene.system.absolute(scene.q[None]))[0][:2]
    end = rotation(np.array([0.0, 0.0, 60.0]))[:2, :2] @ start
    assert where == pytest.approx(end, abs=1e-4)


SERVO = "}, drive: {type: servo, between: [ground.here, arm.root], stiffness: 9, damping: 1, angle: 0.5"


@pytest.mark.parametrize(
    ("spring", "joint", "carried"),
    [
        ("{type: rotational, between: [ground, arm], stiffness: 10.0}", "", False),
        ("{type: rotational, between: [ground, arm], damping: 10.0}", "", True),
        ("{type: two_point, between: [arm.tip, bob], stiffness: 10.0}", "", True),
        ("{type: two_point, between: [ground.here, arm.tip], stiffness: 10.0}", "", True),
        ("{type: two_point, between: [ground, arm.tip], stiffness: 10.0}", "", False),
        (None, ", stops: {upper: 1.0, stiffness: 100.0}", False),
        (None, ", friction: {torque: 1.0, velocity: 0.1}", True),
        (None, SERVO, True),
    ],
)
def test_nothing_is_carried_that_springs_or_stops_on_the_ground_resist(spring, joint, carried):
    bob = ", bob: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, 1.0]}}\njoints"
    text = SWINGING.replace("}\njoints", bob).replace("arm.root]}", f"arm.root]{joint}}}")
    text += "" if spring is None else f"springs: {{one: {spring}}}\n"
    scene = build(parse_deck(text))
    found = problem_of(scene).carrying()
    if isinstance(found, CarryingApart):  # the bob flies
        columns = scene.system.reduction.numbers[scene.bodies["arm"].columns]
        assert not found.others[-12:].any()
        found = None if found.others[columns.max()] else found
    assert (found is not None) == carried


TWO = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies:
  one: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, 1.0]}
  other: {type: rigid, mass: 2.0, inertia: [3.0, 3.0, 3.0]}
initial:
  one: {position: [2, 1, 0], velocity: [1, 0, 0.5], angular_velocity: [0, 9, 0]}
  other: {velocity: [0, 0, -1], angular_velocity: [3, 0, -4]}
solve: {duration: 1.0}
"""


def test_what_nothing_connects_is_carried_part_by_part(rng):
    """Each turns about an axis of its own, and what is left of the other moves on with that one alone."""
    scene = build(parse_deck(TWO))
    problem, reduction = problem_of(scene), scene.system.reduction
    a = problem.single(0.0, scene.q, scene.v)
    found, changes = problem.carrying().along(scene.q, scene.v, a, TIMES), rng.normal(size=(3, len(scene.q)))
    x, moved = reduction.expand(scene.q[None])[0], reduction.expand_rates(found.moved)
    turned, seen = reduction.expand_rates(changes), reduction.expand_rates(found.seen(changes))
    for name, spin, velocity in (("one", [0, 9, 0], [1, 0, 0.5]), ("other", [3, 0, -4], [0, 0, -1])):
        columns = scene.bodies[name].columns
        axes = x[columns].reshape(-1, 3)[1:]
        for t, whole, one, own in zip(TIMES, moved, seen, turned, strict=True):
            R = rotation(t * np.array(spin, dtype=float))
            expected = [t * np.array(velocity), *(R @ axis - axis for axis in axes)]
            assert whole[columns] == pytest.approx(np.ravel(expected), abs=2e-5)
            assert one[columns] == pytest.approx((own[columns].reshape(-1, 3) @ R.T).ravel(), abs=2e-5)
    assert np.abs(found.v).max() < 2e-5 and np.abs(found.a).max() < 2e-3
