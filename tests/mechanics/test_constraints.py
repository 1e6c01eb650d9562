"""Every marker and every joint against differences, and what a reaction may and may not do."""

from pkgutil import resolve_name

import numpy as np
import pytest
import zoo
from analytical import along, crossed, jacobian, moment_of, turned, twice_along
from zoo import MARKERS, PAIRS

from hfsim.maths.matrices import assemble
from hfsim.mechanics.constraints import Coincide, constraints_of
from hfsim.parts.joints import JOINTS as KINDS
from hfsim.parts.joints.driver import DriverSpec
from hfsim.parts.joints.fixed import FixedSpec
from hfsim.parts.joints.gear import GearSpec
from hfsim.parts.joints.motion import MotionSpec
from hfsim.parts.joints.prismatic import PrismaticSpec
from hfsim.parts.joints.revolute import RevoluteSpec
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

SINE = {"type": "sine", "amplitude": 0.4, "frequency": 0.3, "phase": 0.2, "offset": 0.1}
ENDS = ("ground", "ground")
JOINTS = {
    "revolute": RevoluteSpec(type="revolute", between=ENDS),
    "fixed": FixedSpec(type="fixed", between=ENDS, angle=0.3),
    "prismatic": PrismaticSpec(type="prismatic", between=ENDS, axis=(0.6, 1.1), angle=-0.2),
    "driven_angle": DriverSpec(type="driver", between=ENDS, angle=SINE),
    "driven_distance": DriverSpec(type="driver", between=ENDS, position=SINE, axis=(-0.5, 2.0)),
    "motion": MotionSpec(type="motion", between=ENDS, y=SINE, turn=SINE, angle=0.3),
    "gear": GearSpec(type="gear", between=ENDS, ratio=-2.5, angle=0.3),
    "rack": GearSpec(type="gear", between=ENDS, radius=0.7, axis=(0.6, 1.1)),
}
ROWS = {
    **{"revolute": 2, "fixed": 3, "prismatic": 2, "driven_angle": 1, "driven_distance": 1, "motion": 3},
    **{"gear": 1, "rack": 1},
}


@pytest.fixture(params=list(MARKERS))
def marker(request):
    return MARKERS[request.param]


@pytest.fixture(params=PAIRS, ids="-".join)
def pair(request):
    return tuple(MARKERS[name] for name in request.param)


@pytest.fixture(params=list(JOINTS))
def joint(request, pair):
    return built(JOINTS[request.param], *pair)


def test_every_joint_is_covered():
    specs = {name: resolve_name(kind) for name, kind in KINDS.items()}
    planar = {name: KINDS[name] for name, spec in specs.items() if spec.holds and spec.spatial is not True}
    made = {(spec.type, f"{type(spec).__module__}.{type(spec).__name__}") for spec in JOINTS.values()}
    assert made == set(planar.items())


def built(spec, first, second):
    """The equations of a joint between two markers, and a carrier where it has one."""
    return constraints_of(spec.held(), first, second, *(MARKERS["plate"] for _ in spec.points[2:]))


def trajectory(rng, size=0.3):
    """Quadratic motion of all coordinates: x(s) in a batch, with x, u, a at s = 0."""
    x, u, a = zoo.random_state(rng), size * rng.normal(size=zoo.N), size * rng.normal(size=zoo.N)
    return lambda s: x + np.outer(s, u) + 0.5 * np.outer(s * s, a), x, u, a


def full(marker, J):
    """A Jacobian over all coordinates."""
    out = np.zeros((*J.shape[1:-1], zoo.N))
    out[..., marker.columns] = J[0]
    return out


def dense(constraint, x):
    """Phi_x over all coordinates, (rows, N)."""
    blocks = zip(constraint.ends, constraint.jacobians(x[None]), strict=True)
    return sum(full(marker, block) for marker, block in blocks)


# ---------------------------------------------------------------- markers


def test_marker_jacobians(marker, rng):
    x = zoo.random_state(rng)
    place = full(marker, marker.position_jacobian(x[None]))
    assert place == pytest.approx(jacobian(marker.position, x), abs=1e-10)
    spin = full(marker, marker.spin_jacobian(x[None]))
    for axis in np.eye(marker.n_dim):
        slope = jacobian(lambda s, axis=axis: marker.turned(s, axis), x)
        assert pytest.approx(slope, abs=1e-9) == crossed(spin.T, marker.turned(x[None], axis)).T


def test_marker_biases(marker, rng):
    motion, x, u, a = trajectory(rng)
    second = twice_along(lambda s: marker.position(motion(s)))
    J, bias = marker.position_jacobian(x[None]), marker.position_bias(x[None], u[None])[0]
    assert full(marker, J) @ a + bias == pytest.approx(second, abs=1e-8)
    second = along(lambda s: marker.spin(motion(s), u + np.outer(s, a)), h=3e-3)
    J, bias = marker.spin_jacobian(x[None]), marker.spin_bias(x[None], u[None])[0]
    assert full(marker, J) @ a + bias == pytest.approx(second, abs=1e-7)


def test_linear_markers_are_linear(marker, rng):
    x = np.array([zoo.random_state(rng) for _ in range(2)])
    straight = np.allclose(marker.position(x.mean(axis=0)[None])[0], marker.position(x).mean(axis=0))
    assert straight or not marker.linear


def test_markers_follow_a_rigid_motion(marker, rng):
    if marker.columns.stop == 0:
        pytest.skip("the ground does not move")
    x, v, w = zoo.random_state(rng), rng.normal(size=marker.n_dim), rng.normal(size=marker.n_spin)
    u = zoo.rigid_motion(x, v, w)
    velocity = full(marker, marker.position_jacobian(x[None])) @ u
    assert velocity == pytest.approx(v + crossed(w, marker.position(x[None])[0]), abs=1e-12)
    assert full(marker, marker.spin_jacobian(x[None])) @ u == pytest.approx(w, abs=1e-12)


def test_every_marker_has_its_place():
    assert set(zoo.PLACES) | {"ground"} == set(MARKERS)


@pytest.mark.parametrize("name", zoo.PLACES)
def test_markers_of_undeformed_bodies_are_where_the_deck_says(name):
    marker, place = MARKERS[name], zoo.PLACES[name]
    A, origin = np.eye(marker.n_dim), np.array([0.5, -1.0, 0.7])[: marker.n_dim]
    A[:2, :2] = turned(0.8)
    x = zoo.undeformed(A, origin)[None]
    assert marker.position(x)[0] == pytest.approx(origin + A @ place, abs=1e-13)
    for axis in np.eye(marker.n_dim):
        assert marker.turned(x, axis)[0] == pytest.approx(A @ axis, abs=1e-13)


# ---------------------------------------------------------------- constraints


def test_constraint_jacobian(joint, rng):
    x, t = zoo.random_state(rng), 0.4
    for constraint in joint:
        slope = jacobian(lambda s, c=constraint: c.residual(np.full(len(s), t), s), x)
        assert dense(constraint, x) == pytest.approx(slope, abs=2e-9)


def test_constraint_stiffness_is_the_slope_of_its_force(joint, rng):
    x = zoo.random_state(rng)
    for constraint in joint:
        multipliers = rng.normal(size=constraint.rows)

        def force(states, constraint=constraint, multipliers=multipliers):
            return np.array([dense(constraint, state).T @ multipliers for state in states])

        slope = jacobian(force, x)
        stiffness = assemble([constraint.stiffness(x[None], multipliers[None])], (zoo.N, zoo.N))
        assert stiffness == pytest.approx(slope, abs=1e-8 * max(1.0, np.abs(slope).max()))


def test_constraint_acceleration_along_a_motion(joint, rng):
    motion, x, u, a = trajectory(rng)
    t = np.array([0.4])
    for constraint in joint:
        second = twice_along(lambda s, c=constraint: c.residual(t + s, motion(s)))
        own = dense(constraint, x) @ a - constraint.acceleration(t, x[None], u[None])[0]
        assert own == pytest.approx(second, rel=1e-8, abs=3e-8)


def test_constraint_rate(joint, rng):
    x, t = zoo.random_state(rng), np.array([0.4])
    for constraint in joint:
        explicit = along(lambda s, c=constraint: c.residual(t + s, np.repeat(x[None], len(s), axis=0)))
        assert constraint.rate(t)[0] == pytest.approx(explicit, abs=1e-10)
        assert constraint.driven == bool(np.abs(explicit).max() > 1e-6)


def test_constant_constraints_are_constant(joint, rng):
    one, other = zoo.random_state(rng), zoo.random_state(rng)
    for constraint in joint:
        same = np.allclose(dense(constraint, one), dense(constraint, other))
        assert same or not constraint.constant


def test_number_of_rows():
    pair = MARKERS["hub"], MARKERS["plate"]
    for name, spec in JOINTS.items():
        constraints = built(spec, *pair)
        assert sum(c.rows for c in constraints) == ROWS[name]
        for c in constraints:
            assert c.residual(np.zeros(1), np.zeros((1, zoo.N))).shape == (1, c.rows)


def test_action_is_reaction(joint, rng):
    """The generalised force of a joint is its reaction on the second body and the opposite on the first."""
    x = zoo.random_state(rng)[None]
    for constraint in joint:
        multipliers = rng.normal(size=(1, constraint.rows))
        force, moment = (part[0] for part in constraint.reaction(x, multipliers))
        first, second = constraint.first, constraint.second
        gap = (second.position(x) - first.position(x))[0]
        # where both points are one the gap is the violation
        turning = 0.0 if isinstance(constraint, Coincide) else moment_of(gap, force)
        on_second = force @ full(second, second.position_jacobian(x))
        on_second = on_second + moment @ full(second, second.spin_jacobian(x))
        if constraint.against:  # these bear a part
            own = full(second, constraint.jacobian(1, x))
            assert on_second == pytest.approx(-multipliers[0] @ own, abs=1e-11)
            continue
        on_first = -force @ full(first, first.position_jacobian(x))
        on_first = on_first - (moment + turning) @ full(first, first.spin_jacobian(x))
        assert on_first + on_second == pytest.approx(-multipliers[0] @ dense(constraint, x[0]), abs=1e-11)


def test_joints_between_bodies_let_them_move_together(joint, rng):
    """No joint resists a common rigid motion: its forces on the bodies balance, moments too."""
    x = zoo.random_state(rng)
    for constraint in joint:
        if 0 in (constraint.first.columns.stop, constraint.second.columns.stop):
            continue
        if isinstance(constraint, Coincide):
            _close_gap(constraint, x)
        assert dense(constraint, x) @ zoo.rigid_motions(x).T == pytest.approx(0.0, abs=1e-11)


def _close_gap(constraint, x):
    t = np.zeros(1)
    for _ in range(30):
        gap = constraint.residual(t, x[None])[0]
        x -= np.linalg.lstsq(dense(constraint, x), gap, rcond=None)[0]
    assert np.abs(constraint.residual(t, x[None])).max() < 1e-12


def test_a_joint_at_rest_does_no_work(pair, rng):
    """Power of the reaction, as force and moment at the two points, in every motion the joint allows."""
    for name in ("revolute", "fixed", "prismatic"):
        x = zoo.random_state(rng)
        joint = built(JOINTS[name], *pair)
        for constraint in joint:
            _close_gap(constraint, x)
            J = dense(constraint, x)
            u = rng.normal(size=zoo.N)
            u -= np.linalg.lstsq(J, J @ u, rcond=None)[0]
            multipliers = rng.normal(size=(1, constraint.rows))
            force, moment = (part[0] for part in constraint.reaction(x[None], multipliers))
            ends = []
            for one in (constraint.first, constraint.second):
                velocity = full(one, one.position_jacobian(x[None])) @ u
                spin = full(one, one.spin_jacobian(x[None])) @ u
                ends.append((one.position(x[None])[0], velocity, spin))
            (a, va, wa), (b, vb, wb) = ends
            back = moment + moment_of(b - a, force)
            assert force @ vb + moment @ wb - force @ va - back @ wa == pytest.approx(0.0, abs=1e-10)


def test_what_each_joint_holds():
    """Residuals of two rigid bodies placed by hand."""
    x, t = np.zeros((1, zoo.N)), np.zeros(1)
    hub, plate = MARKERS["hub"], MARKERS["plate"]
    x[0, zoo.PLATE] = [2.0, 1.0, 0.3]
    x[0, zoo.HUB] = [*plate.position(x)[0], 0.7]
    x[0, zoo.HUB.start : zoo.HUB.start + 2] += 1e-3 * np.array([3.0, -4.0])
    gap = built(JOINTS["revolute"], plate, hub)[0].residual(t, x)
    assert gap[0] == pytest.approx([3e-3, -4e-3], abs=1e-14)
    angle = built(JOINTS["fixed"], plate, hub)[1].residual(t, x)
    assert angle[0] == pytest.approx([0.4 - 0.3], abs=1e-14)
    slide = built(PrismaticSpec(type="prismatic", between=ENDS, axis=(3.0, 4.0)), plate, hub)
    local = turned(-0.3) @ [3e-3, -4e-3]
    across = np.array([-0.8, 0.6]) @ local
    assert slide[0].residual(t, x)[0] == pytest.approx([across], abs=1e-14)
    assert slide[1].residual(t, x)[0] == pytest.approx([0.4], abs=1e-14)
    law = {"type": "constant_rate", "rate": 2.0, "start": 0.1}
    spin = built(DriverSpec(type="driver", between=ENDS, angle=law), plate, hub)[0]
    assert spin.residual(t + 0.1, x)[0] == pytest.approx([0.4 - 0.3], abs=1e-14)
    push = built(DriverSpec(type="driver", between=ENDS, position=law, axis=(0.0, 2.0)), plate, hub)[0]
    assert push.residual(t + 0.1, x)[0] == pytest.approx([local[1] - 0.3], abs=1e-14)
    whole = built(
        DriverSpec(type="driver", between=ENDS, angle={**law, "start": 0.4 + 2 * np.pi}), plate, hub
    )
    assert whole[0].residual(t, x)[0] == pytest.approx([0.0], abs=1e-13)


@pytest.mark.parametrize("turn", [0.0, 400.0])
def test_guides_on_the_ground_are_linear(turn):
    """A cart on a spring; full turns of its stated angle are none that the guide misses."""
    deck = parse_deck(f"""hfsim: 1
bodies: {{cart: {{type: rigid, mass: 2.0, inertia: 0.1}}}}
joints: {{rail: {{type: prismatic, between: [ground, cart], axis: [3, 4], angle: {turn} deg}}}}
springs: {{s: {{type: two_point, between: [ground.far, cart], stiffness: 8.0, rest_length: 1.0}}}}
ground: {{points: {{far: [1.2, 1.6]}}}}
initial: {{cart: {{position: [0.3, 0.4], angle: {turn - 360.0} deg}}}}
solve: {{duration: 1.0}}
output: {{channels: [cart.x, cart.angle]}}
""")
    scene, whole = build(deck), build(deck.with_solve({"keep_all": True}))
    assert whole.system.equations.phi.constant and whole.system.equations.n_rows == 2
    assert (scene.system.n, scene.system.equations.n_rows) == (1, 0)
    run = simulate(deck, error_estimate=False)
    assert run["cart.x"] == pytest.approx(0.6 * (1.0 - 0.5 * np.cos(2.0 * run.t)), abs=1e-7)
    assert run["cart.angle"] == pytest.approx(np.deg2rad(turn - 360.0), abs=1e-12)
    assert run.statistics["constraint_position"] < 1e-12
