"""Springs between two points whose rest length is a law of time: winches and cylinders."""

import numpy as np
import pytest
from natively import native, runs_alike
from solved import parsed

import hfsim
from hfsim.deck.laws import LinearLaw, SineLaw
from hfsim.errors import DeckError
from hfsim.mechanics.resistances import LinearSpring, Stop, Wound
from hfsim.scene.build import build

LAW = "{type: smooth_step, from: 5, to: 3, start: 0.5, end: 2.5}"
CRANE = f"""
hfsim: 1
gravity: [0.0, -9.81]
ground: {{points: {{drum: [0.0, 5.0]}}}}
bodies: {{load: {{type: rigid, mass: 100, inertia: 1}}}}
springs:
  rope:
    type: two_point
    between: [ground.drum, load]
    stiffness: 2.0e5
    damping: 500
    rest_length: {LAW}
initial: {{load: {{position: [0.0, -0.004905]}}}}
solve: {{duration: 3, tolerance: 1.0e-9}}
output: {{interval: 0.05, channels: [load.y, load.vy, rope.force, rope.distance, rope.power, energy.total]}}
"""
RAIL = f"""
hfsim: 1
bodies: {{cart: {{type: rigid, mass: 2, inertia: 1}}}}
joints:
  rail: {{type: prismatic, between: [ground, cart]}}
springs:
  ram:
    {{type: two_point, between: [ground, cart], stiffness: 300, damping: 9, preload: 4, rest_length: {LAW}}}
initial: {{rail: {{distance: 5.0}}}}
solve: {{duration: 3, tolerance: 1.0e-9}}
output: {{interval: 0.1, channels: [rail.distance, cart.vx]}}
"""


def test_a_ram_is_a_servo_along_its_line():
    ram = hfsim.run(parsed(RAIL), error_estimate=False)
    servo = RAIL.replace("springs:\n", "").replace("{type: two_point", "{type: servo")
    servo = servo.replace("preload: 4, rest_length", "position")
    push = "loads: {pull: {type: force, at: cart, force: [-4, 0]}}\ninitial"
    other = hfsim.run(parsed(servo.replace("initial", push)), error_estimate=False)
    for name in ram.units:
        np.testing.assert_allclose(ram[name], other[name], atol=1e-7)


def test_a_winch_lifts_its_load_and_does_the_work_for_it():
    run = hfsim.run(parsed(CRANE), diagnosis=False)
    assert run["load.y"][-1] == pytest.approx(2.0 - 0.004905, abs=1e-3)
    assert run.statistics["energy_drift"] < 1e-9 and run.statistics["error_estimate"] < 1e-5
    weight = 100 * (9.81 + np.gradient(run["load.vy"], run.t))
    np.testing.assert_allclose(weight[2:-2], -run["rope.force"][2:-2], rtol=0.02)
    gained = run["energy.total"][-1] - run["energy.total"][0]
    assert gained == pytest.approx(100 * 9.81 * 2.0, rel=1e-3)
    assert run.statistics["work_done"] == pytest.approx(gained, rel=1e-9)


STANDING = "{times: [0, 1, 3], values: [5, 5, 5]}"


@pytest.mark.parametrize("more", ["", ", release: {time: 1.7}"])
def test_a_length_that_stands_stores_what_one_does_that_is_a_number(more):
    pulled = RAIL.replace("distance: 5.0", "distance: 5.5")
    pulled = pulled.replace("channels: [", "channels: [energy.potential, ")
    energies = []
    for length in ("5.0", STANDING):
        text = pulled.replace(f"rest_length: {LAW}", f"rest_length: {length}{more}")
        energies.append(hfsim.run(parsed(text), error_estimate=False)["energy.potential"])
    assert energies[0][0] == pytest.approx(4 * 0.5 + 0.5 * 300 * 0.5**2)
    np.testing.assert_allclose(energies[1], energies[0], rtol=0, atol=1e-7)


@pytest.mark.parametrize("damping", [0, 9])
def test_it_stores_what_its_stretch_is_and_is_fed_by_what_winds_it(damping):
    """The tension but for the damping, times the rate at which its length shrinks, and the damper's loss."""
    text = RAIL.replace("damping: 9", f"damping: {damping}").replace("interval: 0.1", "interval: 0.001")
    run = hfsim.run(parsed(text.replace("channels: [", "channels: [energy.potential, energy.total, ")))
    y = np.clip(0.5 * (run.t - 0.5), 0.0, 1.0)
    rest, rate = 5.0 - 2.0 * y**3 * (10 - 15 * y + 6 * y**2), -30.0 * y**2 * (1.0 - y) ** 2
    stretch = run["rail.distance"] - rest
    np.testing.assert_allclose(run["energy.potential"], (4 + 150 * stretch) * stretch, atol=1e-9)
    power = -(4 + 300 * stretch) * rate - damping * (run["cart.vx"] - rate) * run["cart.vx"]
    work = np.trapezoid(power, run.t)
    assert run["energy.total"][-1] - run["energy.total"][0] == pytest.approx(work, abs=1e-5)
    assert run.statistics["work_done"] == pytest.approx(work, abs=1e-5)


def test_work_of_what_winds_a_spring_hides_no_drift_of_energy():
    """Where nothing moves, the work of loads on rounding is allowed for: that on the length is none of it."""
    coarse = {"solve.method": "generalized_alpha", "solve.step": 2e-3}
    run = hfsim.run(parsed(CRANE), coarse, error_estimate=False, diagnosis=False)
    assert 1e-7 < run.statistics["energy_drift"] < 1e-3


def test_damping_by_a_table_is_that_of_the_stretch_as_that_by_a_number_is():
    """It was that of the distance."""
    by_number, by_table = (
        hfsim.run(parsed(RAIL.replace("damping: 9", damping)), error_estimate=False)
        for damping in ("damping: 9", "damping_table: [[-1, -9], [0, 0], [1, 9]]")
    )
    np.testing.assert_allclose(by_table["rail.distance"], by_number["rail.distance"], atol=1e-8)


@pytest.mark.parametrize("rate", [0.0, 0.5])
def test_steps_end_where_a_table_bends_by_the_rate_of_the_stretch(rate):
    """At half a second a length that is wound has that of one which stands."""
    damping = "damping_table: [[-2, -60], [-0.1, -20], [0, 0], [0.1, 20], [2, 60]]"
    still, law = (
        build(parsed(RAIL.replace("damping: 9, preload: 4", damping).replace(LAW, rest)))
        for rest in ("3.5", f"{{expression: '3.5 + {rate}*(t - 0.5)'}}")
    )
    t, x, u = np.full(3, 0.5), np.repeat(still.system.absolute(still.q[None]), 3, axis=0), np.zeros((3, 3))
    u[:, 0] = [-0.25, 0.0625, 0.375]
    moving = u + np.array([rate, 0.0, 0.0])
    one, other = (next(part for part in scene.system.forces if part.has_edges) for scene in (still, law))
    assert one.edges(t, x, u).shape[1] >= 2
    np.testing.assert_array_equal(other.edges(t, x, moving), one.edges(t, x, u))


def test_edges_of_what_is_wound_go_along_with_its_length():
    stop, t, w = Stop(0.3, 1.0, 1.0, 0.0, 0.01), np.array([0.0, 1.0, 2.0]), np.zeros(3)
    found = Wound(stop, LinearLaw(1.0, 0.5)).past_edges(t, 1.3 + 0.5 * t, w)
    np.testing.assert_allclose(found, [[0.0, -0.01]] * 3, rtol=0, atol=1e-15)


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_its_force_is_the_slope_of_its_energy_and_what_winds_it_feeds_that(damping):
    one = Wound(LinearSpring(30.0, damping, 0.0, 4.0), SineLaw(0.3, 2.0, 0.1, 1.0))
    s, w = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-3, 3, 7)))
    t, h = np.full_like(s, 0.7), 1e-6
    found = [*one.slopes(t, s, w), one.elastic(t, s), one.fed(t, s)]
    changes = [
        one.force(t, s + h, w) - one.force(t, s - h, w),
        one.force(t, s, w + h) - one.force(t, s, w - h),
        one.energy(t, s + h) - one.energy(t, s - h),
        one.energy(t + h, s) - one.energy(t - h, s),
    ]
    np.testing.assert_allclose(found, np.array(changes) / (2 * h), rtol=0, atol=1e-6)
    assert one.force(t, s, one.law.rate(t)) == pytest.approx(one.elastic(t, s))


def test_at_rest_and_in_its_modes_it_is_a_spring_of_the_length_at_the_start():
    moving = CRANE.replace(LAW, "{type: constant_rate, start: 5, rate: -1}")
    rest = hfsim.static(parsed(moving))
    assert rest.final["rope.distance"] == pytest.approx(5.004905, abs=1e-9)
    rates = [hfsim.modes(parsed(text), about="equilibrium").frequencies.max() for text in (CRANE, moving)]
    assert rates == pytest.approx([np.sqrt(2000 - 2.5**2) / (2 * np.pi)] * 2, rel=1e-6)


LET_GO = CRANE.replace("    damping", "    release: {time: 1.7}\n    damping")


@native
@pytest.mark.parametrize("text", [CRANE, CRANE.replace("    damping: 500\n", ""), RAIL, LET_GO])
def test_it_is_recorded_and_may_let_go(text, monkeypatch):
    one = runs_alike(parsed(text), monkeypatch, 1e-6)
    if "release" in text:
        falling = one.t > 1.7
        assert not one["rope.force"][falling].any() and one.statistics["energy_drift"] < 1e-9
        np.testing.assert_allclose(np.diff(one["load.vy"][falling]), -9.81 * 0.05, atol=1e-9)


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("rest_length: -1", "springs.ram.rest_length: must be at least 0, not -1"),
        (f"rest_length: {LAW}, table: [[0, 0], [1, 2]]", "that moves takes a stiffness, no table"),
        ("rest_length: 3 s", "springs.ram.rest_length: "),
        (
            "rest_length: {type: constant_rate, start: 5, rate: -2}",
            "springs.ram.rest_length: is -1 at 3 s, and no length is negative (at least 0 at all times)",
        ),
        ("rest_length: {type: sine, amplitude: 2, frequency: 0.5, offset: 0.2}", "is -1.8 at 1.5 s, and no"),
    ],
)
def test_what_is_wrong_is_told(entry, told):
    text = RAIL.replace(f"rest_length: {LAW}", entry)
    if "table" in entry:
        text = text.replace("stiffness: 300, ", "").replace("preload: 4, ", "")
    with pytest.raises(DeckError) as error:
        build(parsed(text))
    assert told in str(error.value)


@pytest.mark.parametrize("more", ["", ", release: {time: 2.4}"])
def test_a_length_that_is_never_negative_while_it_counts_is_taken(more):
    law = "{times: [0, 1, 3], values: [5, 4, 0], interpolation: linear}" if not more else (
        "{type: constant_rate, start: 5, rate: -2}"
    )
    build(parsed(RAIL.replace(f"rest_length: {LAW}", f"rest_length: {law}{more}")))


def test_a_length_stays_what_it_is_where_decks_are_resolved():
    deck = parsed(RAIL.replace(LAW, "4 m")).deck
    assert parsed(deck.resolved()).deck.springs == deck.springs
    assert deck.springs["ram"].rest_length.constant == 4.0
