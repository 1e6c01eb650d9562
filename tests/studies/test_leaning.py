"""Modes of leaning tops and wheels, which turn by themselves too, and of what turns far off."""

import numpy as np
import pytest

import hfsim
from hfsim.output.modes import campbell_text, state_warnings
from hfsim.scene.loading import parse_deck
from hfsim.scene.nearby import nearby
from hfsim.studies.modes import about as places

MASS, ARM, ACROSS, ALONG, WEIGHT = 2.0, 0.3, 0.05, 0.02, 2.0 * 9.81 * 0.3
INERTIA = ACROSS + MASS * ARM**2


def nutation_of(tilt, precession, own, along=ALONG, across=INERTIA, weight=WEIGHT):
    """Circular frequency of a top that turns by itself at a rate in all and precesses steadily.

    A th'' = A p^2 sin cos - C w p sin + W sin, with p as the momentum about the vertical keeps it.
    """
    sine, cosine = np.sin(tilt), np.cos(tilt)
    slope = (along * own - 2.0 * precession * across * cosine) / (across * sine)
    bent = across * precession**2 * (cosine**2 - sine**2) - (along * own * precession - weight) * cosine
    return np.sqrt(-(bent + slope * (2.0 * across * precession * cosine - along * own) * sine) / across)


def top(tilt, own, fast=False):
    """A top in regular precession, slow or fast, and its circular frequency of nutation."""
    sine, cosine = np.sin(tilt), np.cos(tilt)
    root = np.sqrt((ALONG * own) ** 2 - 4.0 * INERTIA * cosine * WEIGHT)
    slow = 2.0 * WEIGHT / (ALONG * own + root)
    precession = (ALONG * own + root) / (2.0 * INERTIA * cosine) if fast else slow
    rates = (own - precession * cosine) * np.array([sine, 0.0, cosine]) + [0.0, 0.0, precession]
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0, -9.81],
        "bodies": {
            "top": {
                "type": "rigid",
                "mass": MASS,
                "inertia": [ACROSS, ACROSS, ALONG],
                "points": {"foot": [0.0, 0.0, -ARM]},
            }
        },
        "joints": {"foot": {"type": "spherical", "between": ["ground", "top.foot"]}},
        "initial": {
            "top": {
                "orientation": {"axis": [0, 1, 0], "angle": tilt},
                "angular_velocity": rates.tolist(),
            }
        },
        "solve": {"duration": 1.0},
    }
    return deck, nutation_of(tilt, precession, own)


def swings(found):
    return [2.0 * np.pi * mode.frequency for mode in found if mode.kind == "vibration"]


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize(("tilt", "own"), [(0.7, 160.0), (0.7, 1000.0), (1.2, 400.0), (2.2, 100.0)])
def test_leaning_tops_are_in_steady_rotation_as_they_start(tilt, own, fast):
    """Rounding led 2e-3 rad on in each correction, and the top that stands upright and still was told."""
    deck, nutation = top(tilt, own, fast)
    for state in ("start", "steady"):
        found = hfsim.modes(deck, about=state)
        assert [mode.kind for mode in found] == ["rigid", "rigid", "vibration"]
        assert swings(found) == pytest.approx([nutation], rel=1e-9)
        assert found.about.turning.own and found.steady and not list(state_warnings(found))


def satellite(lean, rate, own):
    """A platform with two wheels that lean to both sides, and the circular frequency of its nutation."""
    ways = [np.array([side * np.sin(lean), 0.0, np.cos(lean)]) for side in (1.0, -1.0)]
    whole, inertia = np.array([5.0, 4.0, 3.0]), np.diag([5.0, 4.0, 3.0])
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0, 0.0],
        "bodies": {
            "bus": {
                "type": "rigid",
                "mass": 10.0,
                "inertia": whole.tolist(),
                "points": {"w1": [0.5, 0.0, 0.0], "w2": [-0.5, 0.0, 0.0]},
            }
        },
        "joints": {},
        "initial": {
            "bus": {
                "position": [0, 0, 0],
                "velocity": [0, 0, 0],
                "orientation": {"axis": [0, 0, 1], "angle": 0},
                "angular_velocity": [0, 0, rate],
            }
        },
        "solve": {"duration": 1.0},
    }
    for name, way, side in zip(("w1", "w2"), ways, (1.0, -1.0), strict=True):
        deck["bodies"][name] = {"type": "rigid", "mass": 1.0, "inertia": [0.02, 0.02, 0.03]}
        axle = {"type": "revolute", "between": [f"bus.{name}", name], "axis": way.tolist()}
        deck["joints"][f"axle_{name}"] = axle
        deck["initial"][name] = {
            "orientation": {"axis": [0, 1, 0], "angle": side * lean},
            "angular_velocity": (own * way + [0.0, 0.0, rate]).tolist(),
        }
        # turns about the axles are not those of the bus: their momenta are kept
        inertia += 0.25 * np.diag([0.0, 1.0, 1.0]) + 0.02 * (np.eye(3) - np.outer(way, way))
    kept = 2.0 * 0.03 * (own + rate * np.cos(lean)) * np.cos(lean)
    about_x, about_y = (kept + (inertia[2, 2] - inertia[k, k]) * rate for k in (0, 1))
    return deck, np.sqrt(about_x * about_y / (inertia[0, 0] * inertia[1, 1]))


@pytest.mark.parametrize(("lean", "rate", "own"), [(0.3, 0.3, 400.0), (1.2, 0.3, 400.0), (1.2, 1.0, 100.0)])
def test_wheels_that_lean_to_both_sides_keep_their_spin(lean, rate, own):
    deck, nutation = satellite(lean, rate, own)
    assert swings(hfsim.modes(deck, about="steady")) == pytest.approx([nutation], rel=1e-8)


def test_wheels_keep_their_spin_at_all_rates():
    """Everything is the faster; at the rate of the start alone wheels that stand still were told."""
    deck, nutation = satellite(0.3, 0.3, 400.0)
    found = hfsim.campbell(deck, [100.0, 400.0, 500.0], count=8)
    seen = [swings(modes)[0] for modes in found.founds]
    assert seen == pytest.approx(nutation / 400.0 * found.rates, rel=1e-8)


def test_rounding_moves_nothing_on_that_nothing_holds():
    deck, _ = top(0.7, 160.0)
    about = hfsim.modes(deck).about
    x = nearby(about.scene, 0.0, about.motions.x, about.turning)
    assert x == pytest.approx(about.motions.x, abs=1e-11)


BLADE = """hfsim: 1
gravity: [0, 0, 0]
materials: {steel: {density: 7800.0, youngs_modulus: "210 GPa"}}
sections: {rod: {shape: circle, diameter: "1 cm"}}
bodies: {blade: {type: beam, element: cable, material: steel, section: rod, length: 1.0, elements: COUNT}}
joints: {ball: {type: spherical, between: [ground, blade.root]}}
initial: {blade: {orientation: {x: [0.6, 0.64, 0.48], y: [0.8, -0.48, -0.36]}, angular_velocity: RATES}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("count", [2, 60])
def test_lines_that_turn_about_themselves_count_as_one_motion_less(count):
    """A slender rod on a ball joint flaps at the rate itself, and goes round freely."""
    rates = [-20.0 * 0.8, 20.0 * 0.48, 20.0 * 0.36]
    text = BLADE.replace("COUNT", str(count)).replace("RATES", str(rates))
    about = hfsim.modes(parse_deck(text), count=4).about
    x = nearby(about.scene, 0.0, about.motions.x, about.turning)
    # stretched by centrifugal forces alone: rho W^2 (L^2 x - x^3 / 3) / 2 E
    tip = about.scene.marker("blade.tip").position(x[None])[0]
    longer = 7800.0 * 400.0 / 3.0 / 210.0e9
    assert tip == pytest.approx((1.0 + longer) * np.array([0.6, 0.64, 0.48]), abs=1e-9)
    round_, flap = hfsim.modes(parse_deck(text), about="steady", count=4).modes[:2]
    assert round_.value == 0.0 and abs(flap.value) == pytest.approx(20.0, rel=1e-7)


@pytest.mark.parametrize("lost", [True, False])
def test_a_start_that_is_steady_is_taken_wherever_else_a_search_leads(monkeypatch, lost):
    deck, nutation = top(0.7, 160.0)
    upright = np.array([0.0, 0.0, 0.3, *np.eye(3).ravel()])
    monkeypatch.setattr(places, "nearby", lambda *args: None if lost else upright)
    assert swings(hfsim.modes(deck, about="steady")) == pytest.approx([nutation], rel=1e-9)


def test_what_nothing_slows_down_is_not_told_without_its_spin(monkeypatch):
    about = hfsim.modes(top(0.7, 160.0)[0]).about
    monkeypatch.setattr(places, "nearby", lambda *args: None)
    with pytest.raises(hfsim.HfsimError, match=r"top by itself at 1\d\d.* rad/s: no state that lasts"):
        places.turning_at(about, 1.01 * about.turning.rate)


def test_rates_without_a_steady_rotation_near_by_are_told():
    """Slower, the top stands or hangs; at its own rate it leans as it starts, wherever it was before."""
    deck, nutation = top(0.7, 160.0)
    own = hfsim.modes(deck).about.turning.own["top"]
    found = hfsim.campbell(deck, [100.0, own], count=3)
    assert all(modes.about.turning.own for modes in found.founds)
    assert swings(found.founds[1]) == pytest.approx([nutation], rel=1e-9)
    told = " ".join(campbell_text(found, "").split())
    assert "at 100 rad/s the steady rotation is 2.3 rad away" in told and told.count("rad away") == 1


SPUN = """hfsim: 1
gravity: [0, 0, 0]
bodies: {b: {type: rigid, mass: 1.0, inertia: INERTIA}}
initial: {b: {position: [FAR, 0.0, 0.0], velocity: VELOCITY, angular_velocity: RATES}}
solve: {duration: 1.0}
"""


def spun(far, inertia, rates, velocity=(0.0, 0.0, 0.0)):
    text = SPUN.replace("FAR", repr(far)).replace("VELOCITY", str(list(velocity)))
    return hfsim.modes(parse_deck(text.replace("INERTIA", str(inertia)).replace("RATES", str(rates))))


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (50.0, 2.0, 3.0)])
@pytest.mark.parametrize("far", [0.0, 10.0, 2000.0, 1.0e6])
def test_modes_are_the_same_wherever_a_free_body_is_and_however_it_flies(far, velocity):
    """Next to a turn about a far origin, that of a small body was rounding: it grew, or was none."""
    found = spun(far, [0.002, 0.003, 0.004], [0.0, 0.0, 3.75], velocity)
    assert swings(found) == pytest.approx([3.75 * np.sqrt(2.0 * 1.0 / (2.0 * 3.0))], rel=1e-9)
    assert [mode.kind for mode in found].count("rigid") == 5 and found.steady
    nutating = spun(far, [0.003, 0.003, 0.004], [1.0, 0.0, 3.75], velocity)
    assert nutating.steady and nutating.about.turning.spin == pytest.approx([1.0, 0.0, 5.0], rel=1e-9)
    assert nutating.about.turning.own == {"b": pytest.approx(-1.25, rel=1e-9)}


@pytest.mark.parametrize("inertia", [1.0e-3, 1.0e-6, 1.0e-9])
def test_small_balls_on_strings_swing_as_conical_pendulums(inertia):
    """A ball is no round body with an axis, however little beside its arm rounding leaves of it."""
    rate, tilt = float(np.sqrt(9.81 / np.cos(0.8))), np.pi - 0.8
    text = f"""hfsim: 1
gravity: [0, 0, -9.81]
bodies: {{b: {{type: rigid, mass: 1.0, inertia: {[inertia] * 3}, points: {{t: [0, 0, 1.0]}}}}}}
joints: {{p: {{type: spherical, between: [ground, b.t]}}}}
initial: {{b: {{orientation: {{axis: [0, 1, 0], angle: -0.8}}, angular_velocity: [0, 0, {rate!r}]}}}}
solve: {{duration: 1.0}}
"""
    for state in ("start", "steady"):
        found = hfsim.modes(parse_deck(text), about=state)
        assert np.abs(found.about.turning.spin - [0.0, 0.0, rate]).max() < 1e-9 * rate
        (swing,) = swings(found)
        expected = nutation_of(tilt, rate, rate * np.cos(tilt), inertia, 1.0 + inertia, 9.81)
        assert swing == pytest.approx(expected, rel=1e-9 + 1e-15 / inertia)


def test_a_ball_that_is_tilted_while_it_spins_goes_on():
    """It was called a drift, which a damper would end."""
    kinds = [mode.kind for mode in spun(0.7, [0.001, 0.001, 0.001], [0.0, 0.0, 3.75])]
    assert kinds == ["rigid"] * len(kinds)
