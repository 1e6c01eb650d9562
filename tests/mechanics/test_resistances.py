# ruff: noqa: E501
"""Springs, dampers, friction, stops and latches: force from energy, slopes, power; on every kind of marker and coordinate."""

import numpy as np
import pytest
import spatial_zoo
import zoo
from analytical import jacobian

from hfsim.maths.matrices import assemble
from hfsim.mechanics.constraints import Shift, Turn
from hfsim.mechanics.friction import Friction
from hfsim.mechanics.latches import Latch
from hfsim.mechanics.resistances import LinearSpring, Stop
from hfsim.mechanics.spatial_turns import about
from hfsim.mechanics.tabled import Curve, TableDamper, TableSpring
from hfsim.mechanics.ties import DistanceTie, GapTie, tie_on

RESISTANCES = {
    "spring": LinearSpring(30.0, 0.0, 0.2),
    "damped": LinearSpring(30.0, 2.0, 0.2),
    "preloaded": LinearSpring(30.0, 2.0, 0.2, -7.0),
    "table": TableSpring.through([(-0.8, -50.0), (-0.1, -4.0), (0.1, 4.0), (0.5, 5.0), (0.7, 60.0)], 0.1),
    "friction": Friction(4.0, 0.3),
    "stop above": Stop(0.4, 1.0, 200.0, 0.0, 0.3),
    "stop below": Stop(-0.4, -1.0, 200.0, 0.0, 0.3),
    "damped stop above": Stop(0.4, 1.0, 200.0, 0.7, 0.3),
    "damped stop below": Stop(-0.4, -1.0, 200.0, 0.7, 0.3),
    "damper of a table": TableDamper(Curve.through([(-9.0, -50.0), (0.0, 0.0), (2.0, 4.0), (5.0, 5.0), (7.0, 60.0)])),
    "latch": Latch(0.3, 50.0, 0.0, since=np.array([0.2])),
    "damped latch": Latch(0.3, 50.0, 0.8, since=np.array([0.2])),
}
S = np.linspace(-1.2, 1.2, 97)
W = np.array([-40.0, -2.0, -0.3, 0.1, 3.0, 50.0])
H = 1e-6


@pytest.fixture(params=RESISTANCES)
def one(request):
    return RESISTANCES[request.param]


@pytest.fixture
def grid():
    s, w = (part.ravel() for part in np.meshgrid(S, W))
    return np.full_like(s, 0.7), s, w


def test_the_elastic_part_is_the_slope_of_the_energy(one):
    t = np.full_like(S, 0.7)
    slope = (one.energy(t, S + H) - one.energy(t, S - H)) / (2 * H)
    assert one.elastic(t, S) == pytest.approx(slope, abs=1e-6)
    assert one.force(t, S, np.zeros_like(S)) == pytest.approx(one.elastic(t, S), abs=1e-12)


def test_slopes_are_those_of_the_force(one, grid):
    t, s, w = grid
    by_s, by_w = one.slopes(t, s, w)
    step = H * np.maximum(1.0, np.abs(w))
    assert by_s == pytest.approx((one.force(t, s + H, w) - one.force(t, s - H, w)) / (2 * H), abs=2e-3, rel=1e-6)
    found = (one.force(t, s, w + step) - one.force(t, s, w - step)) / (2 * step)
    assert by_w == pytest.approx(found, abs=1e-6, rel=1e-6)


def test_what_is_not_elastic_takes_power_and_never_gives_it(one, grid):
    t, s, w = grid
    lost = (one.force(t, s, w) - one.elastic(t, s)) * w
    assert (lost >= 0.0).all()
    assert (lost.max() > 0.0) == one.uses_rates == one.exchanges_power


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("damping", [0.0, 0.7, 1e3])
def test_a_stop_pushes_only_and_only_beyond_its_limit(side, damping, grid):
    t, s, w = grid
    force = side * Stop(side * 0.4, side, 200.0, damping, 0.3).force(t, s, w)
    beyond = side * s > 0.4
    assert (force[~beyond] == 0.0).all()
    assert (force[beyond] > 0.0).all()


def test_a_stop_is_as_stiff_as_it_says_and_damped_as_hunt_and_crossley():
    stop, t = Stop(0.4, 1.0, 200.0, 0.7, 0.1), np.zeros(1)
    deep = np.array([0.9])
    assert stop.slopes(t, deep, np.zeros(1))[0] == pytest.approx(200.0)
    assert stop.elastic(t, deep) == pytest.approx(200.0 * (0.5 - 0.05))
    small = np.array([1e-4])
    assert stop.force(t, deep, small) / stop.elastic(t, deep) - 1.0 == pytest.approx(0.7 * small, rel=1e-3)


def test_a_table_is_met_is_monotone_and_goes_straight_on():
    rows = np.array([(-0.8, -50.0), (-0.1, -4.0), (0.1, 4.0), (0.5, 5.0), (0.7, 60.0)])
    table = TableSpring.through(rows, 0.3)
    assert table.elastic(S, rows[:, 0] + 0.3) == pytest.approx(rows[:, 1], abs=1e-12)
    assert (np.diff(table.elastic(S, np.linspace(-1.0, 1.2, 400))) > 0.0).all()
    beyond = np.array([1.1, 1.2, 1.3])
    assert np.diff(table.elastic(S, beyond), 2) == pytest.approx(0.0, abs=1e-10)
    assert table.energy(S, np.array([0.3])) == 0.0


def test_friction_has_its_level():
    friction, w = Friction(4.0, 0.3), np.array([-3.0, 0.3, 0.6, 3.0])
    assert friction.force(w, w, w) / 4.0 == pytest.approx([-1.0, np.tanh(1.0), np.tanh(2.0), 1.0], abs=1e-8)


# ---------------------------------------------------------------- between markers

PLANAR = {"distance": None, "angle": Turn(), "shift": Shift((3.0, 4.0))}
IN_SPACE = {"distance": None, "angle": about((0.3, -1.0, 0.4), np.eye(3)), "shift": Shift((0.3, -1.0, 0.4))}
ALL = (LinearSpring(30.0, 2.0, 0.1), Friction(4.0, 0.3), Stop(0.2, 1.0, 200.0, 0.4, 0.8))
STILL = (LinearSpring(30.0, 0.0, 0.1, 3.0), TableSpring.through([(-0.5, -9.0), (0.0, 1.0), (0.5, 2.0)], 0.1), Stop(0.2, 1.0, 200.0, 0.0, 0.8), Stop(-0.2, -1.0, 100.0, 0.0, 0.5))


def ties():
    for bodies, coordinates in ((zoo, PLANAR), (spatial_zoo, IN_SPACE)):
        for pair in bodies.PAIRS:
            for kind, held in coordinates.items():
                if held is None or "line" not in pair:
                    yield pytest.param(bodies, pair, held, id="-".join((*pair, kind)))


@pytest.fixture(params=[ALL, STILL], ids=["all", "elastic"])
def resistances(request):
    return request.param


@pytest.mark.parametrize(("bodies", "pair", "held"), list(ties()))
def test_a_tie_on_any_coordinate(bodies, pair, held, resistances):
    """Force from energy, power, tangents; nothing resists a common rigid motion."""
    ends = [bodies.MARKERS[name] for name in pair]
    part = DistanceTie(*ends, resistances) if held is None else tie_on(held, *ends, resistances)
    rng, n = np.random.default_rng(8), bodies.N
    x, u = bodies.random_state(rng), rng.normal(size=n)

    def forces(x, u):
        x, u = np.broadcast_arrays(x, u)
        out = np.zeros(x.shape)
        part.add_force(np.zeros(len(x)), x, u, out)
        return out

    t, still = np.zeros(1), np.zeros((1, n))
    elastic, force = forces(x[None], still)[0], forces(x[None], u[None])[0]
    slope = jacobian(lambda s: part.potential_energy(np.zeros(len(s)), s), x)
    scale = np.abs(slope).max()
    assert scale > 1.0
    assert elastic == pytest.approx(-slope, abs=1e-6 * scale)
    power = part.power(t, x[None], u[None])[0]
    assert (force - elastic) @ u == pytest.approx(power, rel=1e-9, abs=1e-9)
    assert power < 0.0 if part.uses_rates else power == 0.0
    assert part.dissipates == part.exchanges_power == part.uses_rates == (resistances is ALL)
    if not any(end.grounded for end in ends):
        for motion in bodies.rigid_motions(x):
            assert force @ motion == pytest.approx(0.0, abs=1e-9 * np.abs(force).max())
            assert part.power(t, x[None], motion[None])[0] == pytest.approx(0.0, abs=1e-9)
    by_x = assemble([part.tangent(t, x[None], u[None])], (n, n), False)
    slope = jacobian(lambda s: forces(s, u[None]), x)
    assert by_x == pytest.approx(-slope, abs=2e-5 * np.abs(slope).max())
    by_u = assemble([part.rate_tangent(t, x[None], u[None])], (n, n), False)
    assert by_u == pytest.approx(-jacobian(lambda s: forces(x[None], s), u), abs=1e-5 * (1.0 + np.abs(by_u).max()))


def test_distances_along_an_axis_need_no_count_of_turns():
    hub, rope = zoo.MARKERS["hub"], zoo.MARKERS["rope_tip"]
    assert tie_on(Shift((1.0, 0.0)), hub, rope, STILL).counter is None
    assert tie_on(Turn(), hub, rope, STILL).counter is not None
    assert isinstance(tie_on(Turn(), hub, zoo.MARKERS["plate"], STILL), GapTie)
    assert tie_on(Turn(), hub, zoo.MARKERS["plate"], (LinearSpring(1.0),)).quartic
    assert not tie_on(Turn(), hub, zoo.MARKERS["plate"], STILL).quartic
