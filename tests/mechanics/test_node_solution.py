"""The equations solved node by node against the whole matrix of them."""

import numpy as np
import pytest

from hfsim.marching.integration import run_integration
from hfsim.maths.matrices import assemble, dense
from hfsim.mechanics import joint_rows
from hfsim.mechanics.node_joints import NodeJoints
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

HEAD = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {soft: {density: 1100.0, youngs_modulus: 5.0e6, poisson_ratio: 0.4}}
sections: {bar: {shape: rectangle, width: 0.03, height: 0.02}, line: {area: 1.0e-4, second_moment: 1.0e-9}}
"""
FREE = HEAD + "bodies: {b: {type: beam, material: soft, section: bar, length: 1.0, elements: 2}}\n"
MIXED = """
bodies:
  hub: {type: rigid, mass: 2.0, inertia: [[0.1, 0.02, 0.0], [0.02, 0.2, 0.0], [0.0, 0.0, 0.25]],
        points: {rim: [0.1, 0.05, 0.0]}}
  a: {type: beam, material: soft, section: bar, length: 0.5, elements: COUNT}
  rope: {type: beam, material: soft, section: line, length: 0.4, elements: 2,
         element: cable}
  bob: {type: rigid, mass: 0.3, inertia: [1.0e-3, 1.0e-3, 1.5e-3], points: {eye: [0.05, 0.0, 0.02]}}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, a.root]}
  elbow: {type: universal, between: [a.tip, bob.eye], axes: [[0, 1, 0], [0, 0, 1]]}
  knot: {type: spherical, between: [bob, rope.root]}
solve: {duration: 1.0}
"""
CHAIN = """
bodies:
  one: {type: rigid, mass: 1.0, inertia: [0.02, 0.09, 0.1], points: {a: [-0.5, 0, 0], b: [0.5, 0, 0]}}
  two: {type: rigid, mass: 1.0, inertia: [0.02, 0.09, 0.1], points: {a: [-0.5, 0, 0], b: [0.5, 0, 0]}}
joints:
  j1: {type: spherical, between: [ground, one.a]}
  j2: {type: spherical, between: [one.b, two.a]}
solve: {duration: 1.0}
"""
THIN = CHAIN.replace("[0.02, 0.09, 0.1]", "SLENDER", 1).replace("[0.02, 0.09, 0.1]", "FLAT").replace(
    "b: [0.5, 0, 0]", "b: [0.5, 0.1, 0.05]"
)
"""Points off the axis of one body, off the plane of the other."""
INERTIAS = ("SLENDER", "[1.0e-9, 0.1, 0.1]"), ("FLAT", "[0.02, 0.09, 0.11]")


def thin(*inertias, joint="spherical"):
    """The deck of two bodies of which one is slender and one flat, or with these moments."""
    text = HEAD + THIN
    for name, inertia in inertias or INERTIAS:
        text = text.replace(name, inertia)
    return text.replace("j2: {type: spherical", f"j2: {{type: {joint}")


PLANAR = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {soft: {density: 1100.0, youngs_modulus: 5.0e6, poisson_ratio: 0.4}}
sections: {bar: {shape: rectangle, width: 0.03, height: 0.02}}
bodies:
  b: {type: beam, material: soft, section: bar, length: 1.0, elements: 2, element: cosserat}
  disc: {type: rigid, mass: 1.0, inertia: 0.1, points: {rim: [0.1, 0.0]}}
joints:
  pin: {type: revolute, between: [ground, b.root]}
  mount: {type: fixed, between: [b.tip, disc.rim]}
solve: {duration: 1.0}
"""
SCENES = {
    "free": FREE + "solve: {duration: 1.0}\n",
    "mixed": HEAD + MIXED.replace("COUNT", "2"),
    "large": HEAD + MIXED.replace("COUNT", "12"),
    "chain": HEAD + CHAIN,
    "plane": PLANAR,
    "thin": thin(),
    "thin, welded": thin(joint="fixed"),
}


@pytest.fixture(params=SCENES)
def scene(request):
    return build(parse_deck(SCENES[request.param]))


def states(scene, rng, count=3):
    """States in which axes are no longer quite orthonormal."""
    q = scene.q + 0.02 * rng.normal(size=(count, scene.system.n))
    return scene.system.absolute(q)


def whole(equations, x):
    """The matrices of eq. (37) for each state, by the free coordinates."""
    B = dense(equations.reduction.basis)
    M = B.T @ dense(equations.constant_mass) @ B
    Phi = np.stack([equations.phi.jacobians(one[None])[0] @ B for one in x])
    zero = np.zeros((len(x), equations.n_rows, equations.n_rows))
    top = np.concatenate([np.repeat(M[None], len(x), 0), Phi.swapaxes(1, 2)], axis=2)
    return np.concatenate([top, np.concatenate([Phi, zero], axis=2)], axis=1), Phi


@pytest.mark.parametrize("unreduced", [False, True], ids=["free", "all"])
def test_accelerations_and_multipliers(scene, unreduced, rng):
    equations = scene.system.unreduced if unreduced else scene.system.equations
    assert equations.by_nodes(3) is not None
    x = states(scene, rng)
    f, gamma = (rng.normal(size=(len(x), count)) for count in (equations.n, equations.n_rows))
    a, multipliers = equations.constrained(x, f, gamma)
    right = np.linalg.solve(whole(equations, x)[0], np.concatenate([f, gamma], axis=1)[..., None])[..., 0]
    size = np.abs(right[:, : equations.n]).max()
    assert a == pytest.approx(right[:, : equations.n], abs=1e-10 * size)
    theirs = right[:, equations.n :]
    assert multipliers == pytest.approx(theirs, rel=1e-8, abs=1e-8 * np.abs(theirs).max())


def test_what_accelerations_miss(scene, rng):
    """Forces leave nothing that the rows would bear; gaps are those of the accelerations."""
    equations, x = scene.system.equations, states(scene, rng)
    f, az = (rng.normal(size=(len(x), count)) for count in (x.shape[1], equations.n))
    u, t = rng.normal(size=x.shape), np.zeros(len(x))
    gamma = equations.phi.curvature(t, x, u)
    free = equations.reduction.free_force(f)
    missing, gaps = equations.by_nodes(3).missing(x, free, gamma, az)
    matrix, Phi = whole(equations, x)
    right = np.linalg.solve(matrix, np.concatenate([free, gamma], axis=1)[..., None])[:, : equations.n, 0]
    assert missing == pytest.approx(right - az, abs=1e-9 * np.abs(right).max())
    assert gaps == pytest.approx(gamma - (Phi @ az[..., None])[..., 0], abs=1e-9 * np.abs(right).max())


@pytest.mark.parametrize("joint", ["spherical", "fixed"])
def test_motions_of_slender_and_flat_bodies_are_orthonormal_in_their_mass(joint, rng):
    scene = build(parse_deck(thin(joint=joint)))
    system, q = scene.system, scene.q
    at = system.linearized(0.0, q, np.zeros(system.n))
    Z, J = at.allowed, at.jacobian
    assert len(Z) == system.n - system.n_rows
    assert np.abs(J @ Z.T).max() < 1e-9 * np.abs(Z).max()
    # the lightest motion is 3e4 times as large as others
    assert pytest.approx(np.eye(len(Z)), abs=1e-6) == Z @ at.mass @ Z.T
    gaps = rng.normal(size=system.n_rows)
    closed, forces = gaps @ at.closing(), rng.normal(size=system.n)
    assert J @ closed == pytest.approx(gaps, abs=1e-8 * np.abs(gaps).max())
    x = system.absolute(q[None])
    moved, _ = system.equations.constrained(x, forces[None], np.zeros((1, system.n_rows)))
    assert at.mobility @ forces == pytest.approx(moved[0], abs=1e-6 * np.abs(moved).max())


def test_slender_and_flat_bodies_cost_no_more_steps_than_others():
    """And no differences: the mass matrix lacks its inverse, not their derivative."""

    def counts(*inertias):
        text = thin(*inertias).replace("duration: 1.0", "duration: 0.5, tolerance: 1.0e-8, method: gauss")
        scene = build(parse_deck(text))
        found = run_integration(scene, scene.deck.solve)
        assert found.stop is None
        return found.problem.counts, scene.system.absolute(found.trajectory.q[None])[0]

    usual, _ = counts(("SLENDER", "[0.01, 0.1, 0.1]"), ("FLAT", "[0.02, 0.09, 0.105]"))
    own, x = counts()
    assert own.evaluations < 1.5 * usual.evaluations
    _, near = counts(("SLENDER", "[2.0e-9, 0.1, 0.1]"), ("FLAT", "[0.02, 0.09, 0.109999999]"))
    assert x == pytest.approx(near, abs=1e-6)


def test_a_light_body_on_a_long_lever_costs_no_more_steps_than_others():
    """Its joint turns it 5e8 times as easily as it moves it: rounding turned the joint's force."""

    def evaluations(inertia):
        text = f"""hfsim: 1
gravity: [0, 0, -9.81]
bodies:
  plate: {{type: rigid, mass: 1, inertia: [1, 1, 1], points: {{hang: [0.3, 0, 10]}}}}
  bob: {{type: rigid, mass: 5, inertia: [{inertia}, {inertia}, {inertia}], points: {{top: [0, 0, 10]}}}}
joints:
  turn: {{type: driver, between: [ground, plate], angle: {{type: constant_rate, rate: 0.05}}}}
  axle: {{type: revolute, between: [ground, plate]}}
  hook: {{type: spherical, between: [plate.hang, bob.top]}}
initial: {{bob: {{orientation: {{axis: [0, 1, 0], angle: 5 deg}}, exact: false}}}}
solve: {{duration: 3, tolerance: 1.0e-7, method: gauss}}
"""
        scene = build(parse_deck(text))
        found = run_integration(scene, scene.deck.solve)
        assert found.stop is None
        return found.problem.counts.evaluations

    assert evaluations(1e-6) < 1.5 * evaluations(1.0)


def links(parents, ring=(), odd="0.02, 0.09, 0.11"):
    """The deck of rigid bodies, some of them odd, each on a ball of another or the ground, with rings."""
    points = "{a: [-0.5, 0, 0], b: [0.5, 0, 0], c: [0.3, 0.2, 0.1]}"
    bodies, joints = [], []
    for k, parent in enumerate(parents):
        inertia = f"[{odd if k % 5 == 3 else '0.02, 0.09, 0.1'}]"
        bodies.append(f"  b{k}: {{type: rigid, mass: 1.0, inertia: {inertia}, points: {points}}}")
        end = "ground" if parent < 0 else f"b{parent}.b"
        joints.append(f"  j{k}: {{type: spherical, between: [{end}, b{k}.a]}}")
    axes = "axes: [[0, 1, 0], [0, 0, 1]]"
    joints += [f"  r{k}: {{type: universal, between: [b{k}.c, b{j}.c], {axes}}}" for k, j in ring]
    return "\n".join([HEAD, "bodies:", *bodies, "joints:", *joints, "solve: {duration: 1.0}"])


def check_solved(equations, x, rng):
    """Hold accelerations, multipliers and what accelerations miss against the whole matrix, dense."""
    assert isinstance(equations.by_nodes(len(x)), NodeJoints)
    f, gamma = (rng.normal(size=(len(x), count)) for count in (equations.n, equations.n_rows))
    a, multipliers = equations.constrained(x, f, gamma)
    matrix, Phi = whole(equations, x)
    right = np.linalg.solve(matrix, np.concatenate([f, gamma], axis=1)[..., None])[..., 0]
    size = np.abs(a).max()
    assert a == pytest.approx(right[:, : equations.n], abs=1e-10 * size)
    assert multipliers == pytest.approx(right[:, equations.n :], abs=1e-9 * np.abs(multipliers).max())
    missing, gaps = equations.by_nodes(len(x)).missing(x, f, gamma, 0.5 * a)
    assert missing == pytest.approx(0.5 * a, abs=1e-10 * size)
    assert gaps == pytest.approx(0.5 * (Phi @ a[..., None])[..., 0], abs=1e-9 * size)


LINKED = {
    "chain": (range(-1, 40), ()),
    "fan": ([-1, *[0] * 40], ()),
    "tree": ([(k - 1) // 2 for k in range(63)], ()),
    "loops": (range(-1, 40), ((3, 5), (10, 30))),
    "slender": (range(-1, 40), ((3, 5),), "1.0e-9, 0.1, 0.1"),
    "light": (range(-1, 40), ((3, 5),), "1.0e-8, 1.0e-8, 1.0e-8"),
}


@pytest.mark.parametrize("kind", LINKED)
def test_joints_with_many_coordinates_are_solved_with_matrices_of_few_entries(kind, rng):
    scene = build(parse_deck(links(*LINKED[kind])))
    check_solved(scene.system.equations, states(scene, rng), rng)


def frame(joint, beams=16):
    """The deck of a chain of beams with sections whose joints depend on many coordinates, bent at each."""
    ends = ["ground", *(f"b{k}.tip" for k in range(beams - 1))]
    turns = {"fixed": "orientation: {x: [0.6, 0.0, 0.8], y: [0, 1, 0]}", "revolute": "axis: [0.6, 0, 0.8]"}
    turns["universal"] = "axes: [[0, 1, 0], [0.6, 0, 0.8]]"
    lines = [f"  j{k}: {{type: {joint}, between: [{end}, b{k}.root], {turns[joint]}}}"
             for k, end in enumerate(ends)]
    body = "{type: beam, material: soft, section: bar, length: 0.2, elements: 1, degree: 2}"
    bodies = [f"  b{k}: {body}" for k in range(beams)]
    return "\n".join([HEAD, "bodies:", *bodies, "joints:", *lines, "solve: {duration: 1.0}"])


@pytest.fixture(params=["fixed", "revolute", "universal"])
def many(request):
    return build(parse_deck(frame(request.param)))


def test_many_joints_are_solved_with_matrices_of_theirs_alone(many, rng):
    check_solved(many.system.equations, states(many, rng), rng)


def test_many_equations_with_axes_across_sections_are_those_one_by_one(many, rng, monkeypatch):
    phi = many.system.equations.phi
    monkeypatch.setattr(joint_rows, "MANY", 10**6)
    apart = joint_rows.JointRows(phi.constraints, phi.n_x, phi.sparse)
    assert len(phi._products) == 2 and len(apart._products) == 1
    x, t = states(many, rng), np.zeros(3)
    u, multipliers = rng.normal(size=x.shape), rng.normal(size=(1, phi.n_rows))
    for name, values in (("residual", (t, x)), ("drift", (t, x, u)), ("curvature", (t, x, u))):
        theirs = getattr(apart, name)(*values)
        assert getattr(phi, name)(*values) == pytest.approx(theirs, abs=1e-12 * np.abs(theirs).max()), name
    rows, theirs = (dense(one.jacobian_at(x[:1])) for one in (phi, apart))
    assert rows == pytest.approx(theirs, abs=1e-13)
    assert phi.jacobians(x[:1])[0] == pytest.approx(theirs, abs=1e-13)
    shape = (phi.n_x, phi.n_x)
    bent, theirs = (dense(assemble(one.stiffness(x[:1], multipliers), shape, True)) for one in (phi, apart))
    assert bent == pytest.approx(theirs, abs=1e-12 * np.abs(theirs).max())
