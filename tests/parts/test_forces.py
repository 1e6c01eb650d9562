"""Springs and loads: lengths and turns, power, frames and laws."""

from dataclasses import replace

import numpy as np
import pytest
import zoo
from analytical import crossed, jacobian
from zoo import MARKERS

from hfsim.deck.laws import LinearLaw, StepLaw
from hfsim.mechanics.force import ConstantForce
from hfsim.mechanics.point_loads import PointForce, PointMoment
from hfsim.parts.forces import LOADS as LOAD_KINDS
from hfsim.parts.forces import SPRINGS as SPRING_KINDS
from hfsim.parts.forces.bushing import BushingSpec
from hfsim.parts.forces.contact import ContactSpec
from hfsim.parts.forces.coupling import CouplingSpec
from hfsim.parts.forces.distributed import DistributedSpec
from hfsim.parts.forces.drag import DragSpec
from hfsim.parts.forces.force import ForceSpec
from hfsim.parts.forces.moment import MomentSpec
from hfsim.parts.forces.rotational import RotationalSpec
from hfsim.parts.forces.two_point import TwoPointSpec
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

START = np.linspace(0.0, 1.0, zoo.N)
REACH = TwoPointSpec(type="two_point", between=("a", "b"), stiffness=70.0, damping=2.0, rest_length=0.4)
T = np.array([0.7])
LAW = LinearLaw(0.5, 2.0)


@pytest.fixture(params=list(MARKERS))
def marker(request):
    return MARKERS[request.param]


def test_every_force_is_covered():
    own = {"force": ForceSpec, "moment": MomentSpec, "rotational": RotationalSpec, "two_point": TwoPointSpec}
    own["distributed"] = DistributedSpec  # in test_distributed.py
    own["drag"] = DragSpec  # in test_drag.py
    own["bushing"] = BushingSpec  # in test_bushings.py
    own["contact"] = ContactSpec  # in test_contacts.py
    own["coupling"] = CouplingSpec  # in test_couplings.py
    assert {k: f"{spec.__module__}.{spec.__name__}" for k, spec in own.items()} == SPRING_KINDS | LOAD_KINDS


def force_of(part, x, u=None, t=T):
    out = np.zeros((1, zoo.N))
    part.add_force(t, x[None], np.zeros((1, zoo.N)) if u is None else u[None], out)
    return out[0]


# ---------------------------------------------------------------- springs (their laws: test_resistances)


def test_spring_of_known_length():
    part = REACH.build(MARKERS["ground"], MARKERS["hub"], START)
    x, u = np.zeros(zoo.N), np.zeros(zoo.N)
    x[:2] = np.add(MARKERS["ground"].pose.origin, [0.3, 0.4])
    u[:2] = [0.6, 0.8]
    # 0.5 m long, rest 0.4 m, 1 m/s along the line
    assert force_of(part, x, u)[:3] == pytest.approx(-(70 * 0.1 + 2.0) * np.array([0.6, 0.8, 0.0]), abs=1e-12)
    assert part.potential_energy(T, x[None])[0] == pytest.approx(70 * 0.1**2 / 2)
    assert part.power(T, x[None], u[None])[0] == pytest.approx(-2.0)


def test_spring_whose_points_meet_has_no_force_to_give():
    part = REACH.build(MARKERS["ground"], MARKERS["hub"], START)
    x = np.zeros(zoo.N)
    x[:2] = MARKERS["ground"].pose.origin
    assert force_of(part, x, np.ones(zoo.N)) == pytest.approx(np.zeros(zoo.N))


def test_rest_length_is_the_first_distance_unless_stated():
    ends = MARKERS["hub"], MARKERS["plate"]
    bare = TwoPointSpec(type="two_point", between=("a", "b"), stiffness=1.0)
    gap = np.subtract(*(end.position(START[None])[0] for end in ends))
    assert bare.build(*ends, START).resistances[0].rest == pytest.approx(np.linalg.norm(gap))
    assert REACH.build(*ends, START).resistances[0].rest == 0.4


def test_rotational_spring_counts_turns_wherever_its_ends_are():
    x = np.zeros(zoo.N)
    x[zoo.PLATE.start + 2] = 0.3 + 2 * np.pi + 0.1
    spec = RotationalSpec(type="rotational", between=("a", "b"), stiffness=30.0, rest_angle=0.3)
    between_rigid = spec.build(MARKERS["hub"], MARKERS["plate"], x)
    assert between_rigid.counter is None
    assert force_of(between_rigid, x)[[2, 5]] == pytest.approx(30 * (2 * np.pi + 0.1) * np.array([1, -1]))
    x[zoo.ROPE] = zoo.CABLE.undeformed.ravel()
    to_beam = spec.build(MARKERS["rope_tip"], MARKERS["plate"], x)
    assert force_of(to_beam, x)[5] == pytest.approx(-3.0)
    for turns in (1, -3):
        to_beam.counter.suppose(0.0, 0.5 + 2 * np.pi * turns)
        assert force_of(to_beam, x)[5] == pytest.approx(-30 * (2 * np.pi * turns + 0.1))


# ---------------------------------------------------------------- loads


def test_load_power_is_force_times_the_velocity_of_the_point(marker, rng):
    x, u = zoo.random_state(rng), rng.normal(size=zoo.N)
    f, m = loads_at(marker, rng)
    velocity, spin = marker.velocity(x[None], u[None])[0], marker.spin(x[None], u[None])[0]
    followed, scale = marker.turned(x[None], np.array(f))[0], LAW.value(0.7)
    for part, expected in (
        (PointForce(marker, None, f, False), f @ velocity),
        (PointForce(marker, None, f, True), followed @ velocity),
        (PointForce(marker, LAW, f, False), scale * (f @ velocity)),
        (PointForce(marker, LAW, f, True), scale * (followed @ velocity)),
        (PointMoment(marker, None, m), m @ spin),
        (PointMoment(marker, LAW, m), scale * (m @ spin)),
    ):
        assert part.exchanges_power
        assert not part.uses_rates
        assert part.power(T, x[None], u[None])[0] == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert force_of(part, x) @ u == pytest.approx(expected, rel=1e-12, abs=1e-12)


def loads_at(marker, rng):
    """A force and a moment at random."""
    return 3.0 * rng.normal(size=marker.n_dim), 1.5 * rng.normal(size=marker.n_spin)


def test_constant_forces_are_slopes_of_the_place(marker, rng):
    x, (f, _) = zoo.random_state(rng), loads_at(marker, rng)
    work = jacobian(lambda s: marker.position(s) @ f, x)
    assert force_of(PointForce(marker, None, f, False), x) == pytest.approx(work, abs=1e-8)


def test_loads_give_their_own_resultant(marker, rng):
    """Their power in a rigid motion is that of a force at the point, or of a couple."""
    if marker.columns.stop == 0:
        pytest.skip("the ground does not move")
    x, v, w = zoo.random_state(rng), rng.normal(size=marker.n_dim), rng.normal(size=marker.n_spin)
    f, m = loads_at(marker, rng)
    motion = zoo.rigid_motion(x, v, w)
    velocity = v + crossed(w, marker.position(x[None])[0])
    assert force_of(PointForce(marker, None, f, False), x) @ motion == pytest.approx(f @ velocity)
    assert force_of(PointMoment(marker, None, m), x) @ motion == pytest.approx(m @ w)


def test_a_follower_force_turns_with_its_body():
    x = np.zeros(zoo.N)
    x[2] = np.pi / 2
    follower = PointForce(MARKERS["hub"], None, (3.0, -2.0), True)
    assert force_of(follower, x)[:3] == pytest.approx([2.0, 3.0, 0.0])
    fixed = PointForce(MARKERS["hub"], None, (3.0, -2.0), False)
    assert force_of(fixed, x)[:3] == pytest.approx([3.0, -2.0, 0.0])


def test_laws_scale_batches_of_times(rng):
    x = np.array([zoo.random_state(rng)] * 3)
    t = np.array([-1.0, 0.25, 5.0])
    law = StepLaw(0.2, 1.0, 0.0, 0.5)
    for bare in (
        PointForce(MARKERS["rope_tip"], None, (1.0, 2.0), True),
        PointMoment(MARKERS["hub"], None, (2.0,)),
    ):
        scaled = replace(bare, law=law)
        one, other = np.zeros_like(x), np.zeros_like(x)
        bare.add_force(t, x, x, one)
        scaled.add_force(t, x, x, other)
        assert other == pytest.approx(one * np.array([0.2, 0.6, 1.0])[:, None], rel=1e-12, abs=1e-12)


def test_load_specs_build_what_they_say():
    load = ForceSpec(type="force", at="a", force=(1.0, 2.0), follower=True, law=3.0).build(MARKERS["hub"])
    assert (load.force, load.follower, float(load.law.value(0.0))) == ((1.0, 2.0), True, 3.0)
    moment = MomentSpec(type="moment", at="a", moment=4.0).build(MARKERS["hub"])
    assert (moment.moment, moment.law) == ((4.0,), None)


def test_weight_is_the_slope_of_its_energy(rng):
    part = ConstantForce(zoo.N, np.arange(zoo.N), rng.normal(size=zoo.N))
    x = zoo.random_state(rng)
    slope = jacobian(lambda s: part.potential_energy(np.zeros(len(s)), s), x)
    assert force_of(part, x) == pytest.approx(-slope, abs=1e-10)


def test_damped_material_of_a_continuum_element_is_that_of_its_centre_line():
    deck = """
hfsim: 1
gravity: [0, -9.81]
materials: {rubber: {density: 1000, youngs_modulus: 1e6, axial_damping: 0.002, bending_damping: 0.01}}
sections: {strip: {shape: rectangle, width: 0.05, height: 0.02}}
bodies: {b: {type: beam, material: rubber, section: strip, length: 0.5, elements: 4, element: continuum}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
solve: {duration: 0.1, tolerance: 1e-6}
output: {channels: [energy.total]}
"""
    runs = [simulate(parse_deck(deck.replace("continuum", one))) for one in ("cable", "continuum")]
    assert all(run.statistics["energy_drift"] < 1e-6 for run in runs)
    cable, continuum = (run.channels[0].values[-1] for run in runs)
    assert continuum == pytest.approx(cable, rel=0.2)
    assert continuum < -1e-3


SWING = """
hfsim: 1
bodies: {bob: {type: rigid, mass: 2.0, inertia: 0.5}}
initial: {bob: {position: [1.3, 0.0]}}
solve: {duration: 1.5, tolerance: 1e-10}
output: {plots: false, interval: 0.05, channels: [bob.x, bob.angle, energy.total]}
springs:
"""


@pytest.mark.parametrize(
    "force",
    [
        "stiffness: 50.0, preload: 5.0",
        "table: [[-2.0, -95.0], [-0.1, 0.0], [1.0, 55.0]]",
        "table: [[-0.05, 2.5], [0.05, 7.5]]",
    ],
)
def test_a_preloaded_spring_swings_about_where_it_has_no_force(force):
    """50 N/m with 5 N at 1 m: about 0.9 m, as preload, as a table, and straight on beyond a short one."""
    deck = SWING + f"  coil: {{type: two_point, between: [ground, bob], rest_length: 1.0, {force}}}"
    result = simulate(parse_deck(deck), error_estimate=False)
    expected = 0.9 + 0.4 * np.cos(5.0 * result.t)
    assert result.channels[0].values == pytest.approx(expected, abs=1e-8)
    assert result.statistics["energy_drift"] < 1e-9


def test_a_preloaded_coil_turns_back():
    coil = "type: rotational, between: [ground, bob], stiffness: 8.0, preload: 2.0, rest_angle: 0.1"
    result = simulate(parse_deck(SWING + f"  coil: {{{coil}}}"), error_estimate=False)
    expected = -0.15 * (1.0 - np.cos(4.0 * result.t))
    assert result.channels[1].values == pytest.approx(expected, abs=1e-8)


def test_a_table_of_a_softening_spring_keeps_its_energy():
    rows = "[[-0.5, -60.0], [-0.2, -10.0], [0.0, 0.0], [0.1, 20.0], [0.2, 22.0], [0.6, 23.0]]"
    coil = f"type: two_point, between: [ground, bob], rest_length: 1.0, table: {rows}, damping: 1.0"
    result = simulate(parse_deck(SWING + f"  coil: {{{coil}}}"), error_estimate=False)
    assert result.statistics["energy_drift"] < 1e-6
    assert np.ptp(result.channels[0].values) > 0.4
