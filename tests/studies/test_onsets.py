"""Where rotors begin to grow, and what grows: against roots of their own equations."""

import numpy as np
import pytest

import hfsim
from hfsim.output.modes import campbell_text
from hfsim.scene.loading import parse_deck
from hfsim.studies.modes import following
from hfsim.studies.modes.about import turning_at
from hfsim.studies.modes.state import ModesError

SLOT = """hfsim: 1
name: slot
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 1.0, points: {q: [-1, 0]}}
  p: {type: rigid, mass: 2.0, inertia: 0.1}
joints:
  axle: {type: revolute, between: [ground, hub]}
  slot: {type: prismatic, between: [hub, p], axis: [1, 0], damping: DAMPING}
springs: {k: {type: two_point, between: [hub.q, p], stiffness: 1000.0, rest_length: 1.0}}
initial: {hub: {angular_velocity: 1.0}}
solve: {duration: 1.0}
"""


def slot(damping):
    """Return a mass in a radial slot: s^2 + (c / 2) s + 500 - W^2 = 0."""
    return parse_deck(SLOT.replace("DAMPING", str(damping)))


def growth_in_a_slot(damping, rate):
    """Return the largest real part of its roots [1/s]."""
    return max(np.roots([1.0, 0.5 * damping, 500.0 - rate**2]).real)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rates", [[20, 25], [25, 30], [0, 25], [20, 22.5], [20, 28.123]], ids=str)
def test_what_grows_at_just_the_size_of_its_stiffness_is_found(rates):
    """The shift at which the inverse is taken was an eigenvalue: it was told that something has no mass."""
    found = hfsim.campbell(slot(0.0), rates)
    for rate, modes in zip(rates, found.founds, strict=True):
        grows = [growth_in_a_slot(0.0, rate)] if rate**2 > 500.0 else []
        assert [mode.growth for mode in modes.unstable] == pytest.approx(grows, rel=1e-9)


@pytest.mark.parametrize("rates", [[0, 10, 25, 30], [20, 25], [22, 23], [0, 99], [10, 22, 23, 25]], ids=str)
@pytest.mark.parametrize("damping", [2.0, 20.0, 40.0, 80.0, 200.0])
@pytest.mark.filterwarnings("error")
def test_what_goes_away_is_told_whatever_it_was_at_the_first_rate(damping, rates):
    """What only decays was followed neither from a rate nor through it: onsets were 0.6 to 12 % off."""
    found = hfsim.campbell(slot(damping), rates)
    told = {one["rate"]: one["growth_rate"] for one in found.facts()["unstable"]}
    expected = {rate: growth_in_a_slot(damping, rate) for rate in rates if rate**2 > 500.0}
    assert told == pytest.approx(expected, rel=1e-8)
    (onset,) = found.onsets
    (critical,) = [one for one in found.crossings if one.order == 0]
    assert onset.rate == critical.rate == pytest.approx(np.sqrt(500.0), rel=1e-4)
    assert onset.frequency == critical.frequency == 0.0 and onset.above


@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_excitations_meet_the_frequency_that_damping_leaves(damping):
    """With n excitations a revolution at W, 500 - (c / 4)^2 - W^2 = (n W)^2; one is at a rate asked for."""
    found = hfsim.campbell(slot(damping), [5, 10, 20, 25])
    told = {one.order: one.rate for one in found.crossings if one.order}
    expected = {n: np.sqrt((500.0 - damping**2 / 16.0) / (1.0 + n**2)) for n in (1, 2, 3)}
    assert told == pytest.approx(expected, rel=1e-6)


DISC = """hfsim: 1
bodies:
  hub: {{type: rigid, mass: 1.0, inertia: 1.0}}
  disc: {{type: rigid, mass: 2.0, inertia: 0.1}}
joints:
  axle: {{type: revolute, between: [ground, hub]}}
  sx: {{type: servo, between: [hub, disc], position: 0, axis: [1, 0], stiffness: 1000, damping: {inner}}}
  sy: {{type: servo, between: [hub, disc], position: 0, axis: [0, 1], stiffness: {across}, damping: {inner}}}
  ex: {{type: servo, between: [ground, disc], position: 0, axis: [1, 0], stiffness: 1.0e-9, damping: {outer}}}
  ey: {{type: servo, between: [ground, disc], position: 0, axis: [0, 1], stiffness: 1.0e-9, damping: {outer}}}
springs: {{t: {{type: rotational, between: [hub, disc], stiffness: 5000.0}}}}
initial: {{hub: {{angular_velocity: 10.0}}, disc: {{angular_velocity: 10.0}}}}
solve: {{duration: 1.0}}
"""


def disc(inner, outer, across=1000.0):
    """Return a disc of 2 kg on springs and dampers that turn, and on dampers at rest."""
    lines = DISC.format(inner=inner, outer=outer, across=across).splitlines()
    return parse_deck("\n".join(one for one in lines if outer or not one.startswith("  e")))


def growth_of_a_disc(inner, outer, rate, across=1000.0):
    """Return the growth rates of its shifts, seen from axes that turn, each twice where it swings [1/s]."""
    turn = np.array([[0.0, -rate], [rate, 0.0]])
    velocity = (inner + outer) / 2.0 * np.eye(2) + 2.0 * turn
    stiffness = np.diag([500.0, across / 2.0]) + turn @ turn + outer / 2.0 * turn
    values = np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -velocity]]))
    return values[values.real > 1e-9]


@pytest.mark.parametrize("count", [2, 6])
@pytest.mark.parametrize("rates", [[0, 20, 33.5, 33.6, 60, 100], [20, 33.5, 60], [100, 0], [-60, 0]], ids=str)
@pytest.mark.filterwarnings("error")
def test_rotors_that_only_decay_at_rest_are_followed(count, rates):
    """Beyond sqrt(k / m) (1 + d / c), of 33.541 rad/s, the damping inside makes it unstable."""
    found = hfsim.campbell(disc(200.0, 100.0), rates, count=count)
    told = {one["rate"]: one["growth_rate"] for one in found.facts()["unstable"]}
    expected = {rate: growth_of_a_disc(200.0, 100.0, rate)[0].real for rate in rates if abs(rate) > 33.55}
    assert told == pytest.approx(expected, rel=1e-6)
    (onset,) = found.onsets
    assert abs(onset.rate) == pytest.approx(np.sqrt(500.0) * 1.5, rel=1e-5)


@pytest.mark.parametrize(
    ("inner", "outer"), [(0.0, 0.5), (2.0, 3.0), pytest.param(1.0, 5.0, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "rates", [[0, 10, 25, 40], pytest.param([24, 26.5, 40], marks=pytest.mark.slow), [20, 25]], ids=str
)
def test_discs_on_unlike_springs_go_away_between_two_rates(inner, outer, rates):
    """There (k1 - m W^2) (k2 - m W^2) + (d W)^2 = 0."""
    found = hfsim.campbell(disc(inner, outer, 1500.0), rates, count=4)
    squares = np.roots([4.0, outer**2 - 2.0 * 2500.0, 1.5e6])
    expected = sorted(rate for rate in np.sqrt(squares.real) if rates[0] < rate < rates[-1])
    assert [one.rate for one in found.onsets] == pytest.approx(expected, rel=1e-4)
    assert [one.frequency for one in found.onsets] == [0.0] * len(expected)
    assert [one.rate for one in found.crossings if one.order == 0] == pytest.approx(expected, rel=1e-4)
    for rate in rates:
        grows = growth_of_a_disc(inner, outer, rate, 1500.0).real
        told = [one["growth_rate"] for one in found.facts()["unstable"] if one["rate"] == rate]
        assert told == pytest.approx(grows, rel=1e-6)


@pytest.mark.parametrize("outer", [0.0, pytest.param(0.2, marks=pytest.mark.slow)])
def test_a_disc_that_goes_away_only_between_two_rates_is_told(outer):
    """One critical speed was told, amid the range, and no growth: at both ends all decays or swings."""
    found = hfsim.campbell(disc(0.0, outer, 1020.0), [20.0, 25.0], count=2)
    expected = np.sort(np.sqrt(np.roots([4.0, outer**2 - 2.0 * 2020.0, 1.02e6]).real))
    assert [one.rate for one in found.onsets] == pytest.approx(expected, rel=1e-4)
    assert [one.above for one in found.onsets] == [True, False]
    assert [one.rate for one in found.crossings if not one.order] == [one.rate for one in found.onsets]
    assert found.unstable_ranges == [tuple(one.rate for one in found.onsets)]


def test_rates_at_which_something_grows_are_shaded(monkeypatch, tmp_path):
    """With unlike springs from sqrt(500) to sqrt(750), through the rate asked for between them."""
    from hfsim.output.plots import campbell as pictures

    drawn = {}
    monkeypatch.setattr(pictures, "save", lambda figures, folder: drawn.update(figures) or [])
    found = hfsim.campbell(disc(0.0, 0.0, 1500.0), [20.0, 25.0, 30.0], count=4)
    (shaded,) = found.unstable_ranges
    assert shaded == pytest.approx(np.sqrt([500.0, 750.0]), rel=1e-3)
    pictures.draw_campbell(found, tmp_path)
    (span,) = drawn["campbell"].axes[0].patches
    assert (span.get_x(), span.get_x() + span.get_width()) == pytest.approx(shaded)
    assert span.get_label() == "something grows"


OFF_CENTRE = """hfsim: 1
gravity: [0, 0]
bodies:
  axle: {type: rigid, mass: 0.1, inertia: 0.01}
  disc: {type: rigid, mass: 1.0, inertia: 0.02, points: {p: [1.0e-3, 2.0e-3]}}
joints: {r: {type: revolute, between: [ground, axle]}}
springs:
  shaft: {type: bushing, between: [axle, disc.p], stiffness: [9900, 10100], rotational_stiffness: 1.0e5}
initial: {steady: {body: axle, rate: 10}}
solve: {duration: 1.0}
"""


@pytest.mark.slow
def test_a_disc_that_leans_out_far_next_to_its_critical_speed_has_its_diagram():
    """A rate that the search chose there, at which it found no steady state, ended the diagram."""
    found = hfsim.campbell(parse_deck(OFF_CENTRE), [90.0, 110.0], count=3)
    assert found.rates.tolist() == [90.0, 110.0] and all(90.0 < rate < 110.0 for rate in found.missed)


@pytest.mark.parametrize("rates", [[20.0, 25.0], [20.0, 22.5, 25.0]], ids=str)
def test_rates_without_a_steady_state_are_left_out_and_told_once(rates, monkeypatch):
    def refusing(start, rate):
        if 22.0 < rate < 23.0:
            raise ModesError(f"none at {rate:.4g} rad/s")
        return turning_at(start, rate)

    monkeypatch.setattr(following, "turning_at", refusing)
    found = hfsim.campbell(disc(0.0, 0.0, 1500.0), rates, count=4)
    assert found.rates.tolist() == [20.0, 25.0] and 22.5 in found.facts()["missed_rates"]
    assert [one.above for one in found.onsets] == [True]
    told = " ".join(campbell_text(found, "").split())
    assert told.count("left out, as no steady rotation was found there: 22") == 1
    with pytest.raises(ModesError, match=r"none at 22\.5 rad/s"):
        hfsim.campbell(disc(0.0, 0.0, 1500.0), [22.5], count=4)


IN_SPACE = """hfsim: 1
gravity: [0, 0, 0]
bodies:
  axle: {type: rigid, mass: 0.1, inertia: [0.01, 0.01, 0.01]}
  disc: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.02], points: {p: [1.0e-5, 2.0e-5, 0]}}
joints: {r: {type: revolute, between: [ground, axle], axis: [0, 0, 1]}}
springs:
  shaft: {type: bushing, between: [axle, disc.p], stiffness: [9900, 10100, 1e6], rotational_stiffness: 1.0e5}
initial: {steady: {body: axle, rate: 10}}
solve: {duration: 1.0}
"""


def stiffness_off_centre(rate):
    """Return the determinant of what brings back a disc of 1 kg that leans out, at a given momentum.

    With A = K - m W^2, A r = -K e of the centre, it is A + 4 m^2 W^2 r r^T / (J + m r^2).
    """
    springs, inertia = np.diag([9900.0, 10100.0]), 0.01 + 0.02
    left = springs - rate**2 * np.eye(2)
    r = -np.linalg.solve(left, springs @ [1.0e-5, 2.0e-5])
    return np.linalg.det(left + 4.0 * rate**2 * np.outer(r, r) / (inertia + r @ r))


@pytest.mark.slow
def test_an_axle_that_is_free_to_turn_is_not_taken_for_what_goes_away():
    """Off its centre a disc takes the axle along: growth was told of its turning, none as critical."""
    found = hfsim.campbell(parse_deck(IN_SPACE), [90.0, 110.0], count=3)
    rates = np.linspace(99.0, 102.0, 30001)
    above = np.array([stiffness_off_centre(rate) > 0.0 for rate in rates])
    expected = rates[1:][above[1:] != above[:-1]]
    assert [one.rate for one in found.onsets] == pytest.approx(expected, rel=2e-4)
    assert [(one.track, one.above) for one in found.onsets] == [(2, True), (2, False)]
    critical = [(one.track, one.rate) for one in found.crossings if not one.order]
    assert critical == [(one.track, one.rate) for one in found.onsets]


FROM_REST = [
    pytest.param(rates, marks=pytest.mark.slow)
    for rates in ([0, 30], [0, np.sqrt(500.0), 30], [-40, -10, 10, 30])
]


@pytest.mark.parametrize("inner", [2.0, 100.0])
@pytest.mark.parametrize("rates", [[20, np.sqrt(500.0)], [22, 23], [-3, 2], *FROM_REST], ids=str)
def test_critical_rates_are_told_where_growth_begins_as_well(inner, rates):
    """Without damping from outside both are at sqrt(k / m); a rate asked for may be just that."""
    found = hfsim.campbell(disc(inner, 0.0), rates, count=6)
    expected = [one for one in (-np.sqrt(500.0), np.sqrt(500.0)) if rates[0] < one <= rates[-1]]
    critical = sorted({one.rate for one in found.crossings if one.order == 0})
    assert critical == pytest.approx(expected, rel=1e-5)
    begins = [one for one in expected if one < rates[-1]]
    assert [one.rate for one in found.onsets] == pytest.approx(begins, rel=1e-3)


WIDE = [pytest.param(rates, marks=pytest.mark.slow) for rates in ([1, 48], [30, 40, 60])]


@pytest.mark.parametrize("rates", [[38, 39], *WIDE], ids=str)
def test_a_second_motion_of_one_shape_begins_to_go_away(rates):
    """Damping inside lets both go away beyond sqrt(k2 / m), which soon swing: one more than below."""
    found = hfsim.campbell(disc(0.9, 0.0, 3000.0), rates, count=4)
    expected = [one for one in (np.sqrt(500.0), np.sqrt(1500.0)) if rates[0] < one < rates[-1]]
    assert [one.rate for one in found.onsets] == pytest.approx(expected, rel=1e-3)
    assert [one.frequency for one in found.onsets] == [0.0] * len(expected)
    assert all(one.above for one in found.onsets)
