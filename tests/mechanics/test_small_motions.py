"""The linearisation of every body and model against differences of its accelerations."""

import numpy as np
import pytest
from analytical import along
from posed import moved

import hfsim
from hfsim.maths.matrices import dense
from hfsim.maths.rotations import rotation
from hfsim.mechanics.small_motions import small_motions
from hfsim.mechanics.turning import Turning
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

MATERIAL = {"density": 1000.0, "youngs_modulus": 2.0e6, "poisson_ratio": 0.3, "bending_damping": 0.01}
SECTION = {"shape": "rectangle", "width": 0.05, "height": 0.04}
SQUARE = {**SECTION, "height": 0.05}


def crane(element, model, coordinates, n_dim):
    """A hub with a spring, an arm on it, a bob at its tip, tied and pushed, all of it moving."""
    lift = (lambda *a: [*a, 0.0]) if n_dim == 3 else (lambda *a: list(a))
    inertia = [0.01, 0.02, 0.025] if n_dim == 3 else 0.02
    spin = (lambda w: [0.0, 0.0, w]) if n_dim == 3 else (lambda w: w)
    line = element == "cable" and n_dim == 3
    return {
        "hfsim": 1,
        "gravity": [1.0, -9.81, 2.0][:n_dim],
        "ground": {"points": {"pivot": lift(0.0, 0.0), "wall": lift(0.5, 1.0)}},
        "materials": {"rubber": MATERIAL},
        "sections": {"bar": SQUARE if element == "cable" else SECTION},
        "bodies": {
            "hub": {"type": "rigid", "mass": 2.0, "inertia": inertia, "points": {"rim": lift(0.2, 0.0)}},
            "arm": {
                "type": "beam",
                "material": "rubber",
                "section": "bar",
                "length": 1.0,
                "elements": 1,
                "element": element,
                "degree": {"cable": 3, "cosserat": 2, "continuum": 3}[element],
            },
            "bob": {"type": "rigid", "mass": 0.5, "inertia": inertia, "points": {"eye": lift(-0.1, 0.05)}},
        },
        "joints": {
            "axle": {"type": "revolute", "between": ["ground.pivot", "hub"]},
            "mount": {"type": "revolute", "between": ["hub.rim", "arm.root"]},
            "hook": {"type": "spherical" if n_dim == 3 else "revolute", "between": ["arm.tip", "bob.eye"]},
        },
        "springs": {
            "coil": {
                "type": "rotational",
                "between": ["ground.pivot", "hub"] if line else ["hub", "arm.root"],
                "stiffness": 5.0,
                "damping": 0.3,
            },
            "rope": {
                "type": "two_point",
                "between": ["ground.wall", "bob"],
                "stiffness": 30.0,
                "damping": 0.7,
                "rest_length": 0.4,
            },
        },
        "loads": {
            "push": {
                "type": "force",
                "at": "arm.tip",
                "force": lift(-3.0, 0.0 if line else 2.0),
                "follower": True,
            }
        },
        "initial": {
            "hub": {"angular_velocity": spin(1.5)},
            "arm": {"angular_velocity": spin(-0.8)},
            "bob": {"angular_velocity": spin(2.0)},
        },
        "solve": {"duration": 1.0, "model": model, "coordinates": coordinates},
    }


def scene_of(deck):
    import yaml

    return build(parse_deck(yaml.safe_dump(deck)))


def somewhere(scene, size=0.03):
    """A state with all coordinates a little off the start, on the joints."""
    rng = np.random.default_rng(3)
    q, v = (one + size * rng.standard_normal(len(one)) for one in (scene.q, scene.v))
    q, v = scene.system.project(np.zeros(1), q[None], v[None], strict=True)
    return q[0], v[0]


KINDS = [
    *((2, element, model, "frame") for element in ("cable", "cosserat") for model in ("linear", "lowOrder")),
    *(
        (2, element, "exact", way)
        for element in ("cable", "cosserat", "continuum")
        for way in ("frame", "absolute")
    ),
    *((2, "cable", model, "auto") for model in ("rigid", "ancf")),
    (2, "continuum", "linear", "frame"),
    *((3, element, model, "frame") for element in ("cable", "cosserat") for model in ("linear", "lowOrder")),
    *((3, element, "exact", way) for element in ("cable", "cosserat") for way in ("frame", "absolute")),
    *((3, "continuum", model, "frame") for model in ("linear", "exact")),
    *((3, "cosserat", model, "auto") for model in ("rigid", "ancf")),
]


@pytest.mark.parametrize(("n_dim", "element", "model", "coordinates"), KINDS)
def test_it_is_the_derivative_of_the_accelerations(n_dim, element, model, coordinates):
    scene = scene_of(crane(element, model, coordinates, n_dim))
    system = scene.system
    q, v = somewhere(scene)
    x, u = system.absolute(q[None])[0], system.absolute_velocity(q[None], v[None])[0]
    found = small_motions(system, 0.0, x, u)
    rng = np.random.default_rng(5)
    dq, dv = 0.3 * rng.standard_normal((2, 3, system.n))

    def changed(k):
        """Coordinates, rates and accelerations after changes of q and v by so many times dq and dv."""

        def of(sizes):
            Q, V = q + sizes[:, None] * dq[k], v + sizes[:, None] * dv[k]
            a = system.acceleration(np.zeros(len(Q)), Q, V)
            rates = system.absolute_velocity(Q, V)
            ax = along(lambda t: np.array([system.absolute_velocity(Q + s * V, V + s * a) for s in t]), 1e-3)
            return np.stack([system.absolute(Q), rates, ax], axis=1)

        return along(of, 1e-3)

    M, V, K, J, B = (
        dense(one) for one in (found.mass, found.velocity, found.stiffness, found.jacobian, found.basis)
    )
    Z = np.linalg.svd(J)[2][len(J) :] if len(J) else np.eye(len(M))
    free = np.linalg.pinv(B)
    for k in range(len(dq)):
        y, w, a = (free @ one for one in changed(k))
        forces = M @ a, V @ w, K @ y
        left = Z @ sum(forces)
        assert np.abs(left).max() < 2e-6 * max(np.abs(one).max() for one in forces)


def eigenvalues(found):
    """Those of motions that joints allow."""
    M, V, K, J = (dense(one) for one in (found.mass, found.velocity, found.stiffness, found.jacobian))
    Z = np.linalg.svd(J)[2][len(J) :].T if len(J) else np.eye(len(M))
    M, V, K = (Z.T @ one @ Z for one in (M, V, K))
    n = len(M)
    left = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, V)]])
    return np.linalg.eigvals(left)


@pytest.mark.parametrize(
    ("element", "model"), [("cable", "lowOrder"), ("cosserat", "linear"), ("continuum", "exact")]
)
def test_it_is_the_same_however_a_scene_is_turned(element, model):
    plain = crane(element, model, "frame", 3)
    # the damping of a line, freed of the roll, has no derivative where it is straight and moves
    plain["materials"]["rubber"]["bending_damping"] = 0.0
    R, shift = rotation(np.array([0.4, -1.1, 0.7])), np.array([0.3, -0.2, 0.9])
    found = []
    for deck in (plain, moved(plain, R, shift)):
        scene = scene_of(deck)
        x = scene.system.absolute(scene.q[None])
        u = scene.system.absolute_velocity(scene.q[None], scene.v[None])
        found.append(eigenvalues(small_motions(scene.system, 0.0, x[0], u[0])))
    one, other = (np.sort(np.abs(values)) for values in found)
    assert other == pytest.approx(one, rel=1e-5, abs=1e-3)


@pytest.mark.parametrize(("n_dim", "element", "model", "coordinates"), KINDS)
def test_turning_changes_no_shape(n_dim, element, model, coordinates):
    scene = scene_of(crane(element, model, coordinates, n_dim))
    system = scene.system
    x = system.absolute(somewhere(scene)[0][None])
    spin = [0.5, -0.7, 0.9] if n_dim == 3 else [0.9]
    turning = Turning.of(
        scene.bodies.values(), spin, [0.3, 0.1, -0.2][:n_dim], velocity=[1.0, 2.0, 3.0][:n_dim]
    )
    after = turning.turned(x, 0.8)
    assert system.strain_energy(after) == pytest.approx(system.strain_energy(x), rel=1e-9)
    assert system.strain_energy(x)[0] > 1e-3 or model == "rigid"
    before, now = (
        np.concatenate([body.outline(one)[0] for body in scene.bodies.values()]) for one in (x, after)
    )
    centre = turning.centre
    assert np.linalg.norm(now - centre, axis=1) == pytest.approx(np.linalg.norm(before - centre, axis=1))
    R = rotation(0.8 * turning.spin) if n_dim == 3 else rotation(np.array([0.0, 0.0, 0.72]))[:2, :2]
    assert now - centre == pytest.approx((before - centre) @ R.T, abs=1e-12)
    rates = along(lambda t: np.concatenate([turning.turned(x, s) for s in t]))
    assert turning.rates(x)[0] - turning.travel == pytest.approx(rates, abs=1e-9)
    changing = along(lambda t: np.concatenate([turning.turned_only(turning.turned(x, s)) for s in t]))
    assert turning.accelerations(x)[0] == pytest.approx(changing, abs=1e-9)
    shifted = np.concatenate([body.outline(x + turning.travel)[0] for body in scene.bodies.values()])
    assert shifted - before == pytest.approx(np.broadcast_to(turning.velocity, before.shape), abs=1e-12)


def test_a_mass_on_springs_swings_faster_and_slower_for_who_turns():
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0],
        "bodies": {"bob": {"type": "rigid", "mass": 2.0, "inertia": 0.1}},
        "springs": {
            "all_round": {
                "type": "two_point",
                "between": ["ground", "bob"],
                "stiffness": 50.0,
                "rest_length": 0.0,
            }
        },
        "initial": {"bob": {"position": [1e-9, 0.0], "angular_velocity": 3.0}},
        "solve": {"duration": 1.0},
    }
    scene = scene_of(deck)
    turning = Turning.of(scene.bodies.values(), [3.0], [0.0, 0.0])
    x = scene.system.absolute(scene.q[None])
    found = eigenvalues(small_motions(scene.system, 0.0, x[0], turning.rates(x)[0], turning))
    own = np.sqrt(25.0)
    expected = [0.0, 0.0, *(1j * (sign * own + turn) for sign in (-1, 1) for turn in (-3.0, 3.0))]
    assert np.sort(found.imag) == pytest.approx(np.sort(np.imag(expected)), abs=1e-6)


ROD = """hfsim: 1
gravity: [0, 0]
materials: {m: {density: 1000, youngs_modulus: 1.0e8, axial_damping: 0.05, bending_damping: 0.05}}
sections: {s: {shape: rectangle, width: 2 cm, height: 2 cm}}
bodies: {b: {type: beam, material: m, section: s, length: 2, elements: 4}}
initial: {steady: {body: b, rate: 10}}
solve: {duration: 1}
"""
SLIDER = """hfsim: 1
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 1.0}
  disc: {type: rigid, mass: 2.0, inertia: 0.1}
joints:
  axle: {type: revolute, between: [ground, hub]}
  x: {type: servo, between: [hub, disc], position: 0, axis: [1, 0], stiffness: 1000, damping: 100}
  y: {type: servo, between: [hub, disc], position: 0, axis: [0, 1], stiffness: 1000, damping: 100}
springs: {t: {type: rotational, between: [hub, disc], stiffness: 5000.0}}
initial: {hub: {angular_velocity: 10.0}, disc: {angular_velocity: 10.0}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("text", [ROD, SLIDER], ids=["rod", "slider"])
def test_dampers_that_turn_with_what_they_are_in_stiffen_nothing(text):
    """Seen from axes that turn they are at rest: what turns make of their forces cancels.

    One-sided differences left 0.02 Hz of a free rod's turn, and 1e-4 N/m.
    """
    found = hfsim.modes(parse_deck(text), about="steady", count=3)
    assert found[1].kind == "rigid" and found[1].value == 0.0
    stiffness = dense(found.about.motions.stiffness)
    assert stiffness == pytest.approx(stiffness.T, rel=1e-12, abs=1e-10)
    if text == SLIDER:
        assert stiffness[1, 1] == pytest.approx(1000.0 - 2.0 * 10.0**2, rel=1e-12)
