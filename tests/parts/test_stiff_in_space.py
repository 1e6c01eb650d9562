"""Stiff beams in space: increments bodies carry along, strains as variables, and steps they allow."""

import numpy as np
import pytest

from hfsim.integrators import Limits, Stepping, _loop, choose
from hfsim.marching.integration import problem_of, run_integration
from hfsim.maths.rotations import rotation
from hfsim.mechanics.carried import _turned
from hfsim.mechanics.strained import Strains
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

ARM = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {steel: {density: 7850.0, youngs_modulus: 2.1e11, poisson_ratio: 0.3}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.01}}
bodies:
  hub: {type: rigid, mass: 5.0, inertia: [0.05, 0.05, 0.05], points: {rim: [0.1, 0.0, 0.0]}}
  arm: {type: beam, material: steel, section: bar, length: 1.0, elements: 2}
joints:
  axle: {type: driver, between: [ground, hub], axis: [0, 0, 1], angle: {type: spin_up, rate: 6.0, time: 0.5}}
  mount: {type: fixed, between: [hub.rim, arm.root]}
solve: {duration: 0.4}
output: {interval: 0.01, channels: [arm.tip.x, arm.tip.y, arm.tip.z]}
"""
PINNED = ARM.replace("axle: {type: driver", "axle: {type: spherical").replace(
    ", axis: [0, 0, 1], angle: {type: spin_up, rate: 6.0, time: 0.5}", ""
)


def scene_of(*changes, text=ARM):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return build(parse_deck(text))


def solved(**options):
    """The change of a deck to these options of ``solve``."""
    every = {"duration": 0.4} | options
    return "{duration: 0.4}", "{" + ", ".join(f"{key}: {value}" for key, value in every.items()) + "}"


MORE = ("elements: 2", "elements: 8")
LINEAR, LOW_ORDER = (("duration: 0.4", f"duration: 0.4, model: {model}") for model in ("linear", "lowOrder"))
CONTINUUM = ("elements: 2", "elements: 2, element: continuum")
MANY = ("elements: 2", "elements: 8, element: continuum")
HIGHER = ("elements: 2", "elements: 2, element: continuum, degree: 4, section_degree: 3")
TAPERED = (
    "section: bar, length: 1.0, elements: 2",
    "stations: [{at: 0, section: bar}, {at: 1, section: thin}], length: 1.0, elements: 2, element: continuum",
)
THIN = ("height: 0.01}}", "height: 0.01}, thin: {shape: rectangle, width: 0.01, height: 0.005}}")
DAMPED = ("poisson_ratio: 0.3", "poisson_ratio: 0.3, bending_damping: 1.0e-6")


def bent(scene, rng, size=0.02):
    """A state near the start, with directors that are no longer quite of unit length."""
    return scene.q + size * rng.normal(size=scene.system.n)


def turned(q, R, scene):
    """The state of a scene without coordinates on the ground, turned about the origin."""
    return (q.reshape(-1, 3) @ R.T).ravel()


ROUND = ("shape: rectangle, width: 0.02, height: 0.01", "shape: circle, diameter: 0.01")
LINE = [ROUND, ("elements: 2", "elements: 2, element: cable, degree: 5")]


@pytest.mark.parametrize("changes", [[], LINE], ids=["sections", "line"])
def test_carried_increments_are_those_of_turned_frames(changes, rng):
    scene = scene_of(*changes)
    natural, n = scene.system.natural.from_state(bent(scene, rng)), scene.system.n
    q = np.array([bent(scene, rng) for _ in range(3)])
    at, dq, f = natural.geometry(q), rng.normal(size=(3, n)), rng.normal(size=(3, n))
    y = natural.to_natural(at, dq)
    assert natural.from_natural(at, y) == pytest.approx(dq, abs=1e-13)
    assert np.sum(natural.to_natural_forces(at, f) * y, axis=1) == pytest.approx(np.sum(f * dq, axis=1))
    relative = natural.leading.relative(dq)
    assert np.linalg.norm(y, axis=1) == pytest.approx(np.linalg.norm(relative, axis=1))


@pytest.mark.parametrize("angle", [0.0, 1e-7, 0.3, 2.0, np.pi - 1e-4])
def test_frames_of_directions_turn_the_shortest_way(angle, rng):
    before, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    axis = np.cross(before, across)
    after = np.cos(angle) * before + np.sin(angle) * across
    found = _turned(before[None], after[None, None])[0, 0]
    assert found == pytest.approx(rotation(angle * axis), abs=1e-5)
    assert found @ before == pytest.approx(after, abs=1e-12)


HANGING = """
hfsim: 1
materials: {steel: {density: 7850.0, youngs_modulus: 2.1e11}}
sections: {wire: {shape: circle, diameter: 0.01}}
bodies: {arm: {type: beam, element: cable, material: steel, section: wire, length: 1.0, elements: 3}}
joints: {pin: {type: spherical, between: [ground, arm.root]}}
solve: {duration: 0.4}
output: {channels: [arm.tip.x]}
"""


def test_stiffness_of_a_turned_line_is_the_same(rng):
    """As its directions see it, turned the shortest way: along itself and across, if not about itself."""
    scene = scene_of(text=HANGING)
    system, R = scene.system, rotation(np.array([0.0, -1.1, 0.7]))
    natural, unit = system.natural.from_state(scene.q), np.eye(system.n)

    def seen(q):
        T = natural.from_natural(natural.geometry(q[None]), unit)
        return T @ (system.linearized(0.0, q, np.zeros(system.n)).stiffness @ T.T)

    here, there = seen(scene.q), seen(turned(scene.q, R, scene))
    assert there == pytest.approx(here, abs=1e-9 * np.abs(here).max())
    states = scene.q, turned(scene.q, R, scene)
    plain = [system.linearized(0.0, q, np.zeros(system.n)).stiffness for q in states]
    assert np.abs(plain[0] - plain[1]).max() > np.abs(here).max() / 3


def test_carried_increments_of_a_turned_scene_are_the_same(rng):
    """Stiffness, mass and orthonormality do not turn with it."""
    scene = scene_of(text=PINNED)
    system, natural, R = scene.system, scene.system.natural, rotation(np.array([0.4, -1.1, 0.7]))
    unit = np.eye(system.n)

    def seen(q):
        at = natural.geometry(q[None])
        T = natural.from_natural(at, unit)
        found = system.linearized(0.0, q, np.zeros(system.n))
        own = found.jacobian[-3 * 7 :] @ T.T
        return T @ (found.stiffness @ T.T), T @ found.mass @ T.T, own

    q = bent(scene, rng, 1e-3)
    here, there = seen(q), seen(turned(q, R, scene))
    beam = slice(scene.bodies["arm"].columns.start - 3, None)
    assert there[0][beam, beam] == pytest.approx(here[0][beam, beam], abs=1e-9 * np.abs(here[0]).max())
    assert there[1] == pytest.approx(here[1], abs=1e-12)
    assert there[2][:, 3:] == pytest.approx(here[2][:, 3:], abs=1e-12)


@pytest.fixture(
    params=[[], [CONTINUUM], [HIGHER], [THIN, TAPERED], [LINEAR], [LOW_ORDER]],
    ids=["cosserat", "continuum", "higher continuum", "tapered continuum", "linear", "lowOrder"],
)
def either(request):
    """A scene with a beam of an element and a model that has strains."""
    return scene_of(*request.param)


@pytest.mark.parametrize(
    "changes",
    [*([], [MORE], [CONTINUUM], [MANY], [HIGHER], [THIN, TAPERED]), *([LINEAR], [MORE, LOW_ORDER])],
)
def test_strains_and_their_slopes(changes, rng):
    scene = scene_of(*changes)
    strains, q = Strains.of(scene.system), bent(scene, rng)
    eps, dq = 1e-6, rng.normal(size=scene.system.n)
    pair = strains.seen(np.stack([q + eps * dq, q - eps * dq]))
    slope = strains.slopes(q) @ dq
    assert slope == pytest.approx((pair[0] - pair[1]) / (2 * eps), abs=1e-7 * np.abs(slope).max())
    x = scene.system.absolute(q[None])
    energy = 0.5 * np.sum(strains.stiffness * strains.seen(q[None]) ** 2)
    assert energy == pytest.approx(scene.system.strain_energy(x)[0])


def test_forces_of_the_strains_that_are_seen_are_the_forces(either, rng):
    scene = either
    system, strains, t = scene.system, Strains.of(scene.system), np.zeros(3)
    q = np.array([bent(scene, rng) for _ in range(3)])
    x = system.absolute(q)
    same = strains.expected(strains.seen(q)).force(t, x, x)
    assert same == pytest.approx(system.force(t, x, x), rel=1e-12, abs=1e-6)


def test_derivatives_with_expected_strains(either, rng):
    """The stress is that of the expected strains; it changes as the strains of the coordinates do."""
    scene = either
    system, strains, q = scene.system, Strains.of(scene.system), bent(scene, rng)
    given, eps = strains.seen(q[None]) + 0.01 * rng.normal(size=strains.count), 1e-6
    dq = rng.normal(size=system.n)
    moved = np.stack([q + eps * dq, q - eps * dq])
    expected = strains.expected(given + strains.seen(moved) - strains.seen(q[None]))
    x = system.absolute(moved)
    part = next(k for k, one in enumerate(system.forces) if one.strain_stiffness.size)
    f = np.zeros_like(x)
    expected.forces[part].add_force(np.zeros(2), x, x, f)
    entries = strains.expected(given).forces[part].tangent(np.zeros(1), system.absolute(q[None]), x[:1])
    K = np.zeros((system.n_x, system.n_x))
    np.add.at(K, (entries.rows, entries.columns), entries.values)
    change = -K @ system.absolute_velocity(q[None], dq[None])[0]
    assert change == pytest.approx((f[0] - f[1]) / (2 * eps), abs=1e-6 * np.abs(change).max())


@pytest.mark.parametrize(
    ("changes", "method"),
    [
        ([], "auto"),
        ([MORE], "auto"),
        ([DAMPED], "auto"),
        ([], "gauss"),
        ([CONTINUUM], "auto"),
        ([MANY], "auto"),
        ([CONTINUUM, DAMPED], "auto"),
        ([HIGHER], "auto"),
        ([THIN, TAPERED], "auto"),
    ],
    ids=[
        *("dense", "sparse", "damped", "gauss", "continuum", "more continuum", "damped continuum"),
        *("higher continuum", "tapered continuum"),
    ],
)
def test_steps_of_a_stiff_arm_that_is_spun_up(changes, method):
    """Steps follow the motion, not the stiffness: without strains as variables there are hundreds."""
    scene = scene_of(solved(tolerance=1e-5, method=method), *changes)
    done = run_integration(scene, scene.deck.solve)
    counts = done.problem.counts
    assert done.stop is None and counts.steps < 40 and counts.iterations < 350
    exact = scene_of(solved(tolerance=1e-9, method=method), *changes)
    closer = run_integration(exact, exact.deck.solve)
    assert closer.problem.counts.steps < 80
    assert done.trajectory.q == pytest.approx(closer.trajectory.q, abs=3e-5)


def test_the_equations_solved_are_the_same():
    """At short steps, which need no strains as variables, the arm moves in the same way."""
    scene = scene_of(solved(tolerance=1e-9, duration=0.03))
    long = run_integration(scene, scene.deck.solve)
    assert long.problem.counts.steps < 25
    short = scene_of(solved(method="radau", step=2.0e-4, stages=4, duration=0.03))
    fine = run_integration(short, short.deck.solve)
    assert long.trajectory.q == pytest.approx(fine.trajectory.q, abs=1e-8)


def test_a_run_put_down_in_stiff_steps_goes_on_to_the_last_bit(monkeypatch):
    def stepping():
        scene = scene_of()
        solve = scene.deck.solve
        method, start = choose(solve, scene.system.dissipates), (0.0, scene.q, scene.v)
        return Stepping(problem_of(scene), method, start, solve.duration, Limits(), lambda t, q, v: None)

    monkeypatch.setattr(_loop, "AT_ONCE", 2)
    first, again = stepping(), stepping()
    while len(first.path.segments) < 10:
        next(first)
    again.recall(first.memory())
    assert first.path.t_end < 0.4 and "radau" in first.path.names
    ends = [list(steps) and steps.path.q for steps in (first, again)]
    assert np.array_equal(*ends)


def test_rigid_bodies_alone_have_no_strains():
    scene = scene_of(
        ("  arm: {type: beam, material: steel, section: bar, length: 1.0, elements: 2}\n", ""),
        ("  mount: {type: fixed, between: [hub.rim, arm.root]}\n", ""),
        ("arm.tip", "hub"),
    )
    assert Strains.of(scene.system) is None
    assert scene.system.natural.vectors.shape == (3, 3)


WHIP = """
hfsim: 1
gravity: GRAVITY
materials: {soft: {density: 1000.0, youngs_modulus: 1.0e10}}
sections: {bar: {shape: rectangle, width: 1.0e-3, height: 1.0e-3}}
bodies: {b: {type: beam, material: soft, section: bar, length: 1.0, element: cosserat, elements: 4}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
loads: {push: {type: force, at: b.tip, force: FORCE}}
solve: {duration: 0.2, tolerance: 1.0e-4}
"""
IN_PLANE, IN_SPACE = (
    WHIP.replace("GRAVITY", str(gravity)).replace("FORCE", str(force))
    for gravity, force in (([0.0, 0.0], [0.0, 1.0e-3]), ([0.0, 0.0, 0.0], [0.0, 6.0e-4, 8.0e-4]))
)


@pytest.mark.parametrize("text", [IN_PLANE, IN_SPACE, ARM], ids=["plane", "space", "arm"])
def test_models_take_the_steps_of_exact(text):
    """A whip of slenderness 1000 took thirty times as many."""
    steps = []
    for model in ("exact", "linear", "lowOrder"):
        scene = scene_of(("solve: {", f"solve: {{model: {model}, "), text=text)
        done = run_integration(scene, scene.deck.solve)
        assert done.stop is None
        steps.append(done.problem.counts.steps)
    assert max(steps[1:]) <= 1.5 * steps[0] < 60


SWUNG = HANGING.replace("hfsim: 1", "hfsim: 1\ngravity: [0.0, -9.81, 0.0]")


@pytest.mark.parametrize(("elements", "most"), [(3, 60), (40, 70)], ids=["dense", "sparse"])
def test_steps_of_a_stiff_line_that_swings(elements, most):
    """They follow the motion: with stiffness that turns away from the line there were 168 and 187."""
    finer = ("elements: 3", f"elements: {elements}"), ("0.4}", "1.0, tolerance: 1.0e-5}")
    scene = scene_of(*finer, text=SWUNG)
    done = run_integration(scene, scene.deck.solve)
    assert done.problem.counts.steps < most
