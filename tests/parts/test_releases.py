"""Springs that let go for good: at a time, or where their force or moment reaches a limit."""

from functools import cache

import numpy as np
import pytest
from natively import both, native
from ropes import BROKEN, ROPE
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from solved import parsed

import hfsim
from hfsim.errors import DeckError
from hfsim.marching import record
from hfsim.marching.integration import run_integration
from hfsim.mechanics.once import events_of
from hfsim.output.modes import state_warnings
from hfsim.scene.build import build

METHODS = {"gauss": 1e-9, "radau": 1e-8, "explicit": 1e-8, "energy": 1e-6, "gear": 1e-4}
METHODS["generalized_alpha"] = 0.02
"""How far the time of it may be off [s]."""
HELD = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {nylon: {density: 1150, youngs_modulus: 3 GPa, poisson_ratio: 0.4, bending_damping: 1.0e-3}}
sections: {rod: {shape: circle, diameter: 3 cm}}
bodies:
  boom: {type: beam, material: nylon, section: rod, length: 0.8, elements: 1}
  load: {type: rigid, mass: 0.5, inertia: [0.001, 0.002, 0.003]}
joints: {hinge: {type: revolute, between: [ground, boom.root], axis: [0, 1, 0]}}
springs:
  stay: {type: rotational, between: [ground, boom.root], axis: [0, 1, 0], stiffness: 900, damping: 1}
  clamp:
    type: bushing
    between: [boom.tip, load]
    stiffness: 2.0e4
    damping: 10
    rotational_stiffness: 50
    release: {time: 0.11, force: 8.5, moment: 4}
solve: {duration: 0.3, tolerance: 1.0e-8}
output: {interval: 0.02, channels: [boom.tip.z, load.z, load.vz, load.rotation_y, clamp.force_z]}
"""


@pytest.mark.parametrize("method", METHODS)
def test_a_rope_breaks_at_its_limit(method):
    changes = {"solve.method": method, "solve.tolerance": 1e-7 if METHODS[method] > 1e-6 else 1e-9}
    run = hfsim.run(parsed(ROPE), changes, error_estimate=False, diagnosis=False)
    assert run.statistics["releases"] == {"springs.rope": pytest.approx(BROKEN, abs=METHODS[method])}
    later = run.t > BROKEN + METHODS[method]
    assert not run["rope.force"][later].any() and run["rope.force"][~later].any()
    speed = 3.0 * np.cos(5.0 * BROKEN)
    np.testing.assert_allclose(run["cart.vx"][later], speed, atol=20 * METHODS[method])
    np.testing.assert_allclose(
        run["cart.x"][later], 1.4 + speed * (run.t[later] - BROKEN), atol=20 * METHODS[method]
    )


STRIP = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {nylon: {density: 1150, youngs_modulus: 3.0e9, bending_damping: 0.001}}
sections: {strip: {shape: rectangle, width: 0.05, height: 0.01}}
ground: {points: {a: [1.0, 0.5]}}
bodies: {arm: {type: beam, material: nylon, section: strip, length: 1.0, elements: 2}}
joints: {m: {type: fixed, between: [ground, arm.root]}}
springs:
  s: {type: two_point, between: [ground.a, arm.tip], stiffness: 100, rest_length: 0.3, release: {time: 0.2}}
solve: {duration: 0.4}
output: {interval: 0.05, channels: [s.force]}
"""
TWICE = {
    "bodies.leg": {"type": "beam", "material": "nylon", "section": "strip", "length": 1.0, "elements": 2},
    "joints.n": {"type": "fixed", "between": ["ground", "leg.root"]},
}


@pytest.mark.parametrize("more", [{}, TWICE], ids=["whole", "parts"])
def test_rows_and_balances_take_releases_where_blocks_of_steps_end(more, monkeypatch):
    """A row at the very time is of what comes then, and the energy that goes is not missing."""
    monkeypatch.setattr(record, "BLOCK", 0.0)
    run = hfsim.run(parsed(STRIP), more, error_estimate=False, diagnosis=False)
    assert run["s.force"][:4].all() and not run["s.force"][4:].any()
    assert run.statistics["energy_drift"] < 1e-5


GRAZED = """
hfsim: 1
bodies:
  a: {type: rigid, mass: 2.2119, inertia: 0.1}
  b: {type: rigid, mass: 3.7638, inertia: 0.1}
joints:
  ra: {type: prismatic, between: [ground, a]}
  rb: {type: prismatic, between: [ground, b]}
springs:
  s1: {type: two_point, between: [ground, a], stiffness: 18.4, rest_length: 1.0}
  s2: {type: two_point, between: [a, b], stiffness: 382.7, rest_length: 1.0, release: {force: 16.65}}
initial:
  a: {position: [1.0, 0], velocity: [0.0, 0]}
  b: {position: [2.0, 0], velocity: [0.6633, 0]}
solve: {duration: 6.2}
output: {interval: 0.05, channels: [a.x, b.x, s2.force]}
"""


@cache
def grazed():
    """Times at which the limit is first passed and left again [s]: two modes, in closed form."""
    root = np.diag([2.2119, 3.7638]) ** 0.5
    half = np.linalg.inv(root)
    w2, modes = np.linalg.eigh(half @ np.array([[18.4 + 382.7, -382.7], [-382.7, 382.7]]) @ half)
    w, size = np.sqrt(w2), modes.T @ root @ [0.0, 0.6633]

    def over(t):
        x = half @ modes @ (size / w * np.sin(w * t))
        return 382.7 * abs(x[1] - x[0]) - 16.65

    return brentq(over, 0.44, 0.47), brentq(over, 0.47, 0.5)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("method", ["auto", "gauss", "radau", "explicit"])
def test_a_limit_that_is_passed_and_left_inside_a_step_is_found(method, tolerance):
    changes = {"solve.method": method, "solve.tolerance": tolerance}
    run = hfsim.run(parsed(GRAZED), changes, error_estimate=False, diagnosis=False)
    at = pytest.approx(grazed()[0], abs=1e-3 * tolerance**0.25)
    assert run.statistics["releases"] == {"springs.s2": at}


@pytest.mark.parametrize("method", ["gauss", "radau", "explicit"])
def test_inside_a_fixed_step_it_counts_at_the_end(method):
    first, last = grazed()
    assert first > 0.45 and last < 0.5
    changes = {"solve.method": method, "solve.step": 0.05}
    run = hfsim.run(parsed(GRAZED), changes, error_estimate=False, diagnosis=False)
    assert run.statistics["releases"] == {"springs.s2": pytest.approx(0.5)}


def test_what_it_stored_is_lost_and_no_drift():
    run = hfsim.run(parsed(ROPE))
    assert run.statistics["energy_drift"] < 1e-9 and run.statistics["error_estimate"] < 1e-6
    assert run["energy.total"][[0, -1]] == pytest.approx([9.0, 9.0 - 0.5 * 50 * 0.4**2], rel=1e-8)
    assert run.statistics["work_done"] == pytest.approx(-0.5 * 50 * 0.4**2, rel=1e-8)


@pytest.mark.parametrize(
    ("release", "at"),
    [("{time: 0.07}", 0.07), ("{time: 0.9, force: 20}", BROKEN), ("{force: 40}", None), ("{time: 0}", 0.0)],
)
def test_the_first_of_what_is_stated_counts(release, at):
    run = hfsim.run(parsed(ROPE.replace("{force: 20}", release)), error_estimate=False)
    assert run.statistics["releases"]["springs.rope"] == (None if at is None else pytest.approx(at, abs=1e-9))
    speed = 3.0 if at is None else 3.0 * np.cos(5.0 * at)
    if at is not None:
        assert run["cart.vx"][-1] == pytest.approx(speed, abs=1e-8)
    else:
        np.testing.assert_allclose(run["cart.x"], 1.0 + 0.6 * np.sin(5 * run.t), atol=1e-8)


@pytest.mark.parametrize("step", [0.01, 0.03])
def test_fixed_steps_end_at_its_time(step):
    changes = {"solve.method": "gauss", "solve.step": step, "springs.rope.release": {"time": 0.07}}
    run = hfsim.run(parsed(ROPE), changes, error_estimate=False)
    assert run.statistics["releases"]["springs.rope"] == 0.07
    assert run["cart.vx"][-1] == pytest.approx(3.0 * np.cos(0.35), abs=1e-6)


def test_a_second_run_of_a_scene_begins_with_it_whole():
    scene = build(parsed(ROPE))
    first, second = (run_integration(scene, scene.deck.solve) for _ in range(2))
    np.testing.assert_array_equal(first.trajectory.q, second.trajectory.q)


@native
@pytest.mark.parametrize("release", ["{time: 0.11}", "{force: 8.5}", "{moment: 0.02}"])
def test_a_bushing_lets_go_as_one_in_the_kernel_as_in_numpy(release, monkeypatch):
    deck = parsed(HELD.replace("{time: 0.11, force: 8.5, moment: 4}", release))
    one, other = both(monkeypatch, lambda: hfsim.run(deck, error_estimate=False, diagnosis=False))
    assert one.statistics["native_steps"] > 5 and other.statistics["native_steps"] == 0
    let_go = one.statistics["releases"]
    assert let_go == pytest.approx(other.statistics["releases"], abs=1e-8)
    assert list(let_go) == ["springs.clamp"]
    at = let_go["springs.clamp"]
    assert at is not None and 0.0 < at < 0.3
    later = one.t > at
    np.testing.assert_allclose(np.diff(one["load.vz"][later]), -9.81 * 0.02, atol=1e-6)
    assert not one["clamp.force_z"][later].any() and one["clamp.force_z"][~later][1:].all()
    for name in ("boom.tip.z", "load.z", "load.rotation_y"):
        np.testing.assert_allclose(one[name], other[name], atol=1e-7)
    assert one.statistics["energy_drift"] < 1e-6


def test_the_limit_is_that_of_the_whole_force():
    asked = [f"clamp.force_{axis}" for axis in "xyz"]
    changes = {"output.channels": asked, "output.interval": 1e-3}
    deck = parsed(HELD.replace("{time: 0.11, force: 8.5, moment: 4}", "{time: 9}"))
    whole = hfsim.run(deck, changes, error_estimate=False)
    force = np.sqrt(sum(whole[name] ** 2 for name in asked))
    limit = 0.9 * force.max()
    k = int(np.argmax(force >= limit))
    at = brentq(lambda t: np.interp(t, whole.t, force) - limit, whole.t[k - 1], whole.t[k])
    run = hfsim.run(deck, {"springs.clamp.release": {"force": float(limit)}}, error_estimate=False)
    assert run.statistics["releases"]["springs.clamp"] == pytest.approx(at, abs=2e-5)


TURNED = """
hfsim: 1
gravity: [0, 0, 0]
bodies: {b: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}}
springs:
  s: {type: bushing, between: [ground, b], stiffness: 100, rotational_stiffness: 5, release: {moment: 7}}
initial:
  b: {orientation: {rotation_vector: [0.6, 0.6, 0]}, angular_velocity: [5, 5, 0], position: [0, 0, 0]}
solve: {duration: 0.3, tolerance: 1.0e-9}
output: {interval: 0.01, channels: [s.moment_x, s.moment_y, s.moment_z]}
"""


@pytest.mark.parametrize("size", [0.1, 0.6, 0.9])
def test_the_limit_of_the_moment_is_that_of_all_turns_together(size):
    """A turn by a about the mean of two axes: its twists are 2 arctan(tan(a / 2) / sqrt(2))."""

    def moment(a):
        lean = np.tan(0.5 * a) / np.sqrt(2.0)
        return 5.0 * 4.0 * np.arctan(lean) * (1.0 + 2.0 * lean**2) / (1.0 + lean**2) / np.sqrt(2.0)

    def there(t, y):
        return moment(y[0]) - limit

    there.terminal, limit = True, float(moment(np.sqrt(2.0) * (size + 0.1)))
    begin = np.sqrt(2.0) * np.array([size, 5.0])
    exact = {"rtol": 1e-11, "atol": 1e-12, "events": there}
    at = solve_ivp(lambda t, y: [y[1], -moment(y[0]) / 0.1], (0.0, 0.3), begin, **exact).t[-1]
    turn = {"initial.b.orientation.rotation_vector": [size, size, 0]}
    run = hfsim.run(parsed(TURNED), turn | {"springs.s.release.moment": limit}, error_estimate=False)
    assert at < 0.1 and run.statistics["releases"] == {"springs.s": pytest.approx(at, abs=1e-6)}


def test_rest_and_modes_are_those_with_it_and_overload_is_told():
    with_it = hfsim.modes(parsed(ROPE)).frequencies
    assert max(with_it) == pytest.approx(np.sqrt(50 / 2.0) / (2 * np.pi))
    without = hfsim.modes(parsed(ROPE), {"springs.rope.release": {"time": 0}}).frequencies
    assert max(without) == pytest.approx(0.0, abs=1e-9)
    hung = ROPE.replace("bodies:", "gravity: [0, -20]\nbodies:")
    hung = parsed(hung.replace("[1.0, 0.0], vel", "[0.0, -1.0], vel"))
    rest = hfsim.static(hung)
    assert rest.final["rope.force"] == pytest.approx(-40.0)
    assert "springs.rope bears more at rest than it can" in "".join(rest.statistics["warnings"])
    told = "".join(state_warnings(hfsim.modes(hung, about="equilibrium")))
    assert "springs.rope bears more at rest than it can" in told
    holding = hfsim.static(hung, {"springs.rope.release.force": 50}).statistics["warnings"]
    assert "springs.rope" not in "".join(holding)


DAMPED = """
hfsim: 1
bodies: {cart: {type: rigid, mass: 1.0, inertia: 0.1}}
springs:
  rope: {type: two_point, between: [ground, cart], stiffness: 100, damping: 10, rest_length: 1,
         release: {force: 15}}
initial: {cart: {position: [1.2, 0.0], velocity: [-2.0, 0.0]}}
solve: {duration: 0.5, tolerance: 1.0e-9}
output: {interval: 0.05, channels: [cart.x, rope.force]}
"""


@pytest.mark.parametrize("method", ["auto", "gauss", "gear"])
def test_the_force_at_the_start_is_that_of_the_motion(method):
    """20 N of the spring less 20 N of the damper, and 11 N later on; without rates it would be too much."""
    run = hfsim.run(parsed(DAMPED), {"solve.method": method, "solve.tolerance": 1e-7}, error_estimate=False)
    assert run.statistics["releases"] == {"springs.rope": None}
    rates = solve_ivp(
        lambda t, y: [y[1], -100 * (y[0] - 1) - 10 * y[1]], (0, 0.5), [1.2, -2.0], rtol=1e-11, atol=1e-12
    )
    assert run["cart.x"][-1] == pytest.approx(rates.y[0, -1], abs=1e-4)
    still = {"initial.cart.velocity": [0.0, 0.0], "solve.method": method}
    run = hfsim.run(parsed(DAMPED), still, error_estimate=False)
    assert run.statistics["releases"] == {"springs.rope": 0.0}
    np.testing.assert_allclose(run["cart.x"], 1.2)


HUNG = """
hfsim: 1
gravity: [0, -9.81]
bodies: {m: {type: rigid, mass: 1.0, inertia: 0.1}}
joints: {rail: {type: prismatic, between: [ground, m], axis: [0, 1]}}
ground: {points: {top: [0, 1]}}
springs:
  a: {type: two_point, between: [ground.top, m], stiffness: 500, rest_length: 1.0, release: {force: 20}}
  b: {type: two_point, between: [ground.top, m], stiffness: 100, rest_length: 1.0}
initial: {rail: {distance: -0.2}}
solve: {duration: 0.5}
output: {channels: [m.y, a.force]}
"""


def test_what_starts_with_too_much_rests_and_vibrates_with_it():
    deck, at = parsed(HUNG), -9.81 / 600.0
    rest = hfsim.static(deck)
    assert rest.final["m.y"] == pytest.approx(at) and not rest.statistics["warnings"]
    assert max(hfsim.modes(deck).frequencies) == pytest.approx(np.sqrt(600.0) / (2 * np.pi))
    run = hfsim.run(deck, {"initial.equilibrium": True}, error_estimate=False)
    np.testing.assert_allclose(run["m.y"], at, atol=1e-9)
    assert hfsim.run(deck, error_estimate=False).statistics["releases"] == {"springs.a": 0.0}
    weak = {"springs.a.release.force": 5}
    assert "springs.a bears more at rest" in "".join(hfsim.static(deck, weak).statistics["warnings"])


@pytest.mark.parametrize(("at", "stiffness"), [(0.1, 600.0), (0.2, 100.0), (0.3, 100.0)])
def test_at_a_later_time_it_rests_without_what_has_let_go_by_then(at, stiffness):
    deck = {"springs.a.release": {"time": 0.2}, "initial.rail.distance": 0.0}
    rest = hfsim.static(parsed(HUNG), deck, at=at)
    assert rest.final["m.y"] == pytest.approx(-9.81 / stiffness)
    assert max(hfsim.modes(parsed(HUNG), deck, at=at).frequencies) == pytest.approx(
        np.sqrt(stiffness) / (2 * np.pi)
    )


def test_what_it_bears_at_rest_is_that_of_the_time():
    winch = {"type": "constant_rate", "start": 1.0, "rate": -1.0}
    deck = {"springs.a.rest_length": winch, "initial.rail.distance": 0.0}
    for limit, told in ((12.0, True), (50.0, False)):
        rest = hfsim.static(parsed(HUNG), {**deck, "springs.a.release.force": limit}, at=0.2)
        assert rest.final["a.force"] == pytest.approx(-500 * ((9.81 + 400 + 100) / 600 - 0.8))
        assert ("springs.a bears more at rest" in "".join(rest.statistics["warnings"])) is told


@pytest.mark.parametrize("method", ["auto", "gauss", "radau", "gear"])
def test_a_time_at_the_very_end_counts(method):
    deck = {"springs.rope.release": {"time": 0.4}, "solve.duration": 0.4, "solve.method": method}
    run = hfsim.run(parsed(ROPE), deck, error_estimate=False)
    assert run.statistics["releases"] == {"springs.rope": 0.4} and run["rope.force"][-1] == 0.0
    assert run.statistics["energy_drift"] < 1e-4


def test_it_goes_along_where_models_change():
    text = HELD.replace("solve: {", "solve: {model: auto, model_error: 1.0e-4, ")
    models = ({"solve.model": one} for one in ("auto", "exact"))
    auto, exact = (hfsim.run(parsed(text), model, error_estimate=False) for model in models)
    assert auto.statistics["auto"]["switches"]
    at = [run.statistics["releases"]["springs.clamp"] for run in (auto, exact)]
    assert at[0] == pytest.approx(at[1], abs=0.02)


def test_it_is_told_in_the_table_and_a_run_that_was_put_down_knows_it(tmp_path):
    deck = parsed(ROPE)
    whole = hfsim.run(deck, {"solve.duration": 2.0}, error_estimate=False)
    scene = build(deck)
    (event, ties), = events_of(scene.system.forces)
    assert event.item(ties) == "springs.rope" and event.side[0] == 1.0 and np.isinf(event.since[0])
    steps = run_integration(scene, scene.deck.solve).trajectory.segments
    half = next(one for one in steps if one.t > BROKEN)
    assert event.since[0] == pytest.approx(BROKEN, abs=1e-9)
    again = run_integration(scene, scene.deck.solve, start=(half.t, half.q, half.v))
    assert again.trajectory.v[0] == pytest.approx(whole["cart.vx"][-1], abs=1e-8)


@pytest.mark.parametrize(
    ("release", "told"),
    [
        ("{}", "a release needs a time, a force or a moment"),
        ("{moment: 3}", "this spring has no moment by which it could let go (a force, or a time)"),
        ("{force: 0}", "must be greater than 0"),
        ("{time: -1}", "must be at least 0"),
        ("{force: 3}, latch: {distance: 1, stiffness: 1}", "a spring that lets go has no latch"),
        ("{after: 3}", "unknown key"),
    ],
)
def test_what_is_wrong_is_told(release, told):
    with pytest.raises(DeckError) as error:
        build(parsed(ROPE.replace("{force: 20}", release)))
    assert told in str(error.value)


@pytest.mark.parametrize("limit", [700.0, 2000.0])
def test_a_rope_that_is_slack_breaks_or_throws_back(limit):
    """As the manual writes it: straight on both sides of zero but for 1e-9 m."""
    table = "[[-1, 0], [0, 0], [1.0e-9, 5.0e-5], [1, 5.0e4]]"
    rope = f"rest_length: 1.0, table: {table}, release: {{force: {limit}}}"
    text = ROPE.replace("stiffness: 50, rest_length: 1.0, release: {force: 20}", rope)
    run = hfsim.run(parsed(text.replace("[1.0, 0.0]", "[0.4, 0.0]")), error_estimate=False, diagnosis=False)
    rate, stretch = np.sqrt(5.0e4 / 2.0), limit / 5.0e4
    breaks = stretch < 3.0 / rate
    when = 0.2 + np.arcsin(stretch * rate / 3.0) / rate if breaks else None
    assert run.statistics["releases"] == {"springs.rope": pytest.approx(when, abs=1e-9)}
    after = np.sqrt(9.0 - 25000.0 * stretch**2) if breaks else -3.0
    assert run["cart.vx"][10] == pytest.approx(after, abs=1e-6), "at 0.5 s"
    assert run.statistics["energy_drift"] < 1e-9
