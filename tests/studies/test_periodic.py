"""Floquet's multipliers: own equations, steady rotations, equilibria, motions that are searched for."""

import importlib
import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import hfsim
from hfsim.cli import app
from hfsim.errors import ArgumentError, HfsimError
from hfsim.scene.loading import parse_deck

PIVOT = {
    "hfsim": 1,
    "gravity": [0, -9.81],
    "bodies": {
        "slide": {"type": "rigid", "mass": 1, "inertia": 1},
        "bob": {"type": "rigid", "mass": 1, "inertia": 1e-6, "points": {"top": [0, 1]}},
    },
    "joints": {
        "rail": {"type": "prismatic", "between": ["ground", "slide"], "axis": [0, 1]},
        "hinge": {"type": "revolute", "between": ["slide", "bob.top"]},
        "shaker": {
            "type": "driver",
            "between": ["ground", "slide"],
            "axis": [0, 1],
            "position": {"type": "sine", "amplitude": 0.1, "frequency": 1.0},
        },
    },
    "solve": {"duration": 1.0},
}
MASS, BLADE, HINGE, ARM, STIFF, DAMPING, OWN = 5.0, 1.0, 0.3, 1.5, 60.0, 0.4, 0.02


def multipliers(matrices, period, n):
    """Those of M y'' + C y' + K y = 0 with matrices of time."""

    def rates(t, y):
        both = y.reshape(2 * n, -1)
        M, C, K = matrices(t)
        return np.concatenate([both[n:], np.linalg.solve(M, -C @ both[n:] - K @ both[:n])]).ravel()

    begin = np.eye(2 * n).ravel()
    end = solve_ivp(rates, (0.0, period), begin, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    return np.linalg.eigvals(end.reshape(2 * n, 2 * n))


def distances(found, expected):
    """Of each multiplier from the nearest of some, over the period [1/s]."""
    told = np.array([mode.multiplier for mode in found])
    return np.abs(told[:, None] - expected).min(axis=1) / np.abs(told) / found.about.period


@pytest.mark.parametrize(("ratio", "grows"), [(1.5, False), (1.9, True), (2.05, True), (2.6, False)])
def test_a_pendulum_whose_pivot_is_shaken_is_that_of_mathieu(ratio, grows):
    fast = ratio * np.sqrt(9.81)
    period = 2.0 * np.pi / fast
    found = hfsim.modes(PIVOT, {"joints.shaker.position.frequency": 1.0 / period}, period=period)
    one = np.ones((1, 1))
    expected = multipliers(
        lambda t: ((1.0 + 1e-6) * one, 0.0 * one, (9.81 - 0.1 * fast**2 * np.sin(fast * t)) * one), period, 1
    )
    assert bool(found.unstable) is grows
    assert max(distances(found, expected)) < 1e-6
    assert all(distances(found, expected) <= [2.0 * mode.uncertainty for mode in found])
    if grows:  # at half the frequency of the shaker
        assert found.unstable[0].frequency == pytest.approx(0.5 / period)


def rotor(n_blades, rate, mount, size=1.0):
    """A hub on a mount of two stiffnesses that is driven, with blades on lag hinges, of a size."""
    angles = 2.0 * np.pi * np.arange(n_blades) / n_blades
    hub = {f"p{k}": [size * HINGE * np.cos(a), size * HINGE * np.sin(a)] for k, a in enumerate(angles)}
    deck = {
        "hfsim": 1,
        "gravity": [0, 0],
        "bodies": {"hub": {"type": "rigid", "mass": MASS, "inertia": size**2, "points": hub}},
        "joints": {
            "motor": {
                "type": "driver",
                "between": ["ground", "hub"],
                "angle": {"type": "constant_rate", "rate": rate},
            }
        },
        "springs": {
            "mount": {"type": "bushing", "between": ["ground", "hub"], "stiffness": mount, "damping": 2.0}
        },
        "initial": {},
        "solve": {"duration": 1.0},
    }
    for k, angle in enumerate(angles.tolist()):
        blade, between = f"b{k}", [f"hub.p{k}", f"b{k}.in"]
        deck["bodies"][blade] = {
            "type": "rigid",
            "mass": BLADE,
            "inertia": OWN * size**2,
            "points": {"in": [-ARM * size, 0]},
        }
        deck["joints"][f"lag{k}"] = {"type": "revolute", "between": between}
        deck["springs"][f"s{k}"] = {
            **{"type": "rotational", "between": ["hub", blade], "rest_angle": angle},
            **{"stiffness": STIFF * size**2, "damping": DAMPING * size**2},
        }
        deck["initial"][blade] = {"angle": angle, "angular_velocity": rate}
    return deck


def of_rotor(n_blades, rate, mount):
    """The linear equations of that, by hand: the hub's place, then the lag of each blade."""
    n = 2 + n_blades

    def matrices(t):
        M, C, K = np.zeros((3, n, n))
        M[:2, :2], C[:2, :2] = (MASS + n_blades * BLADE) * np.eye(2), 2.0 * np.eye(2)
        K[:2, :2] = np.diag(mount)
        for k in range(2, n):
            at = rate * t + 2.0 * np.pi * (k - 2) / n_blades
            out, across = np.array([np.cos(at), np.sin(at)]), np.array([-np.sin(at), np.cos(at)])
            M[:2, k] = M[k, :2] = BLADE * ARM * across
            C[:2, k], K[:2, k] = -2.0 * rate * BLADE * ARM * out, -(rate**2) * BLADE * ARM * across
            M[k, k], C[k, k] = BLADE * ARM**2 + OWN, DAMPING
            K[k, k] = STIFF + BLADE * ARM * HINGE * rate**2
        return M, C, K

    return multipliers(matrices, 2.0 * np.pi / rate, n)


@pytest.mark.parametrize(
    ("n_blades", "rate", "mount", "size", "grows"),
    [
        (2, 12.0, [900.0, 400.0], 1.0, False),
        (2, 12.0, [900.0, 400.0], 1e-6, False),
        (4, 14.0, [900.0, 500.0], 1e-3, True),
        (3, 12.0, [900.0, 900.0], 1.0, False),
    ],
)
def test_blades_on_a_soft_mount_shake_themselves_as_their_linear_equations_say(
    n_blades, rate, mount, size, grows
):
    found = hfsim.modes(rotor(n_blades, rate, mount, size), period=2.0 * np.pi / rate)
    assert len(found) == n_blades + 2 and found.whole
    assert bool(found.unstable) is grows
    assert max(distances(found, of_rotor(n_blades, rate, mount))) < 1e-7


def test_short_things_move_little_however_far_away_others_are():
    """Two carts 50 m apart on springs of 5 cm across their rails swing at 4.472 and 5.477 rad/s."""
    cart, names = {"type": "rigid", "mass": 1, "inertia": 1e-4}, ("a", "b")
    ground = {"a0": [0, 0], "a1": [0, 0.05], "b0": [0, 50], "b1": [0, 50.05]}
    deck = {"hfsim": 1, "gravity": [0, 0], "bodies": dict.fromkeys(names, cart), "ground": {"points": ground}}
    deck["joints"] = {f"j{k}": {"type": "prismatic", "between": [f"ground.{k}0", k]} for k in names}
    deck["springs"] = {
        f"s{k}": {
            **{"type": "two_point", "between": [f"ground.{k}1", k], "rest_length": 0.04},
            **{"stiffness": stiffness, "damping": 0.2},
        }
        for k, stiffness in zip(names, (100, 150), strict=True)
    }
    found = hfsim.modes(deck | {"solve": {"duration": 1.0}}, period=1.0)
    expected = np.exp(1j * np.array([[1.0], [-1.0]]) * np.sqrt([20.0, 30.0])).ravel()
    assert max(distances(found, expected)) < 1e-5


def test_a_steady_rotation_has_the_modes_that_are_seen_from_the_rotor():
    deck, period = rotor(3, 12.0, [900.0, 900.0]), 2.0 * np.pi / 12.0
    values = np.array([mode.value for mode in hfsim.modes(deck, about="steady", count=20)])
    expected = np.exp(period * np.concatenate([values, values.conj()]))
    assert max(distances(hfsim.modes(deck, period=period), expected)) < 1e-7


@pytest.mark.parametrize(
    ("case", "changes"),
    [
        ("pendulum", {"materials.rubber.bending_damping": 0.01}),
        ("pendulum", {"solve.model": "lowOrder", "gravity": [0, -0.5], "initial.b1.angle": -1.5}),
        pytest.param(
            *("pendulum", {"solve.model": "linear", "materials.rubber.youngs_modulus": 7e9}),
            marks=pytest.mark.slow,
        ),
        ("pendulum_3d", {}),
        ("hub_beams", {}),
    ],
)
def test_an_equilibrium_has_its_own_modes_whatever_period_is_said(case, changes):
    values = np.array([mode.value for mode in hfsim.modes(case, changes, about="equilibrium", count=20)])
    found = hfsim.modes(case, changes | {"initial.equilibrium": True}, period=0.3, count=3)
    expected = np.exp(0.3 * np.concatenate([values, values.conj()]))
    assert len(found) == 3 and max(distances(found, expected)) < 1e-5


SWING = {
    "hfsim": 1,
    "gravity": [0, -9.81],
    "bodies": {"m": {"type": "rigid", "mass": 1, "inertia": 0.1, "points": {"top": [0, 1]}}},
    "joints": {"hinge": {"type": "revolute", "between": ["ground", "m.top"]}},
    "initial": {"m": {"angle": 1.0}},
    "solve": {"duration": 10.0},
}


@pytest.mark.parametrize("amplitude", [0.95, 1.0, 1.05])
def test_a_swing_is_found_by_its_period_and_may_begin_later(amplitude):
    """T = 4 K(sin(a / 2)) sqrt(1.1 / 9.81); each start along it is as good, and so are swings beside it."""
    period = 4.0 * np.sqrt(1.1 / 9.81) * float(ellipk(np.sin(0.5 * amplitude) ** 2))
    found = hfsim.modes(SWING, period=period)
    angle, rate = found.about.motions.x[2], found.about.motions.u[2]
    assert np.cos(angle) - 0.55 / 9.81 * rate**2 == pytest.approx(np.cos(amplitude), abs=1e-7)
    assert [mode.kind for mode in found] == ["rigid"]


SERVO = """hfsim: 1
gravity: [0, -9.81]
bodies:
  hub: {type: rigid, mass: 1, inertia: 1, points: {p: [0.2, 0]}}
  arm: {type: rigid, mass: 1, inertia: 0.1, points: {in: [-0.3, 0]}}
joints:
  a: {type: revolute, between: [ground, hub]}
  s: {type: servo, between: [ground, hub], stiffness: 500, damping: 20, angle: {type: constant_rate, rate: 8}}
  l: {type: revolute, between: [hub.p, arm.in], damping: 0.2}
springs: {k: {type: rotational, between: [hub, arm], stiffness: 10}}
initial: {hub: {angular_velocity: 8}, arm: {angular_velocity: 8}}
solve: {duration: 3}
"""


def of_servo(t, y):
    """Rates of the angles of hub and arm and of their rates, by hand."""
    a, b, w, v = y
    coupled = 0.2 * 0.3 * np.cos(a - b)
    turned = 0.2 * 0.3 * np.sin(a - b)
    servo, spring = 500.0 * (8.0 * t - a) + 20.0 * (8.0 - w), 10.0 * (b - a) + 0.2 * (v - w)
    moments = [
        servo + spring - turned * v * v - 9.81 * 0.2 * np.cos(a),
        -spring + turned * w * w - 9.81 * 0.3 * np.cos(b),
    ]
    return np.concatenate([[w, v], np.linalg.solve([[1.04, coupled], [coupled, 0.19]], moments)])


@pytest.mark.parametrize("at", [None, 10.0 * np.pi / 8.0])
def test_a_rotor_in_its_weight_is_followed_round(at):
    """No steady rotation: the motion that lasts is searched for, with its multipliers of hub and arm."""
    period = 2.0 * np.pi / 8.0
    found = hfsim.modes(parse_deck(SERVO), period=period, at=at)

    def after(y):
        return solve_ivp(of_servo, (0.0, period), y, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]

    x, u = found.about.motions.x, found.about.motions.u
    start = np.array([x[2] - 8.0 * found.about.t, x[5] - 8.0 * found.about.t, u[2], u[5]])
    assert after(start) - start == pytest.approx([2.0 * np.pi, 2.0 * np.pi, 0.0, 0.0], abs=1e-7)
    matrix = np.array([after(start + one) - after(start - one) for one in 1e-6 * np.eye(4)]).T / 2e-6
    assert [mode.kind for mode in found] == ["decay", "decay", "vibration"]
    told = np.array([mode.multiplier for mode in found])
    expected = np.linalg.eigvals(matrix)
    assert np.abs(told[:, None] - expected).min(axis=1).max() < 1e-7
    assert not found.uneven


SLEWED = {
    "hfsim": 1,
    "gravity": [0, 0],
    "materials": {
        "al": {"density": 3000, "youngs_modulus": 7e10, "bending_damping": 5e-4, "axial_damping": 1e-4}
    },
    "sections": {"s": {"shape": "rectangle", "width": 0.02, "height": 0.003}},
    "bodies": {
        "hub": {"type": "rigid", "mass": 1, "inertia": 1, "points": {"rim": [0.1, 0]}},
        "beam": {"type": "beam", "material": "al", "section": "s", "length": 1.0, "elements": 3},
    },
    "joints": {
        "axle": {"type": "revolute", "between": ["ground", "hub"]},
        "clamp": {"type": "fixed", "between": ["hub.rim", "beam.root"]},
        "motor": {
            **{"type": "driver", "between": ["ground", "hub"]},
            "angle": {"type": "sine", "amplitude": 0.05, "frequency": 5.0, "phase": np.pi / 2},
        },
    },
    "solve": {"duration": 1.0},
}


@pytest.mark.slow
def test_fast_motions_follow_where_slow_ones_are_looked_at(monkeypatch):
    """A beam on a hub that swings to and fro, from where it is straight; and what it then does lasts."""
    few = hfsim.modes(SLEWED, period=0.2, count=2)
    monkeypatch.setattr(importlib.import_module("hfsim.studies.modes.next_to"), "OFTEN", np.inf)
    every = hfsim.modes(SLEWED, period=0.2, count=2)
    assert every.whole and not few.whole
    for mode, same in zip(few, every, strict=True):
        off = abs(mode.value - same.value)
        assert off <= 2.0 * max(mode.uncertainty, same.uncertainty) and off < 1e-3 * abs(mode.value)


@pytest.mark.slow
def test_what_foreshortens_as_it_moves_is_no_vibration():
    """Where a start is moved far, what its ends come nearer by is none of the fast motions that go on."""
    first, later = (
        hfsim.modes(SLEWED, {"bodies.beam.elements": 2}, period=0.2, at=at, count=1)[1] for at in (None, 2.0)
    )
    assert first.value == pytest.approx(later.value, abs=1e-5)


def test_what_is_no_period_is_refused():
    for period in (0.0, -1.0, np.inf):
        with pytest.raises(ArgumentError, match="no period"):
            hfsim.modes(SWING, period=period)
    with pytest.raises(ArgumentError, match="two states"):
        hfsim.modes(SWING, period=1.0, at=1.0, about="steady")
    with pytest.raises(HfsimError, match=r"no motion of period 0\.77 s was found next to the start"):
        hfsim.modes(PIVOT, period=0.77)


def test_laws_that_are_other_a_period_later_are_warned_of(here):
    """A push that comes once: what it begins is no motion that goes on."""
    deck = SWING | {
        "initial": {},
        "loads": {"f": {"type": "force", "at": "m", "force": [0, -1.0], "law": {"expression": "1 + t"}}},
    }
    (here / "swing.yaml").write_text(json.dumps(deck))
    done = CliRunner().invoke(app, ["modes", "swing.yaml", "--period", "0.5", "--no-plots"])
    assert done.exit_code == 0 and "what acts is other a period later" in " ".join(done.output.split())


def test_the_command_takes_periods_as_rates_and_writes_multipliers(here):
    (here / "rotor.yaml").write_text(json.dumps(rotor(4, 14.0, [900.0, 500.0])))
    for k, text in enumerate(("14 rad/s", repr(2.0 * np.pi / 14.0), f"{7.0 / np.pi!r} Hz")):
        options = ["--period", text, "-o", f"m{k}", *["--no-plots"][:k]]
        done = CliRunner().invoke(app, ["modes", "rotor.yaml", *options])
        assert done.exit_code == 0 and "unstable: mode 6, flutter" in done.output
        facts = json.loads((here / f"m{k}" / "modes.json").read_text())
        assert facts["about"]["period"] == pytest.approx(2.0 * np.pi / 14.0)
        assert np.hypot(*facts["modes"][5]["multiplier"]) > 1.0 and facts["modes"][5]["damping_ratio"] is None
    assert (here / "m0" / "plots" / "modes.png").exists()
    head = (here / "m0" / "modes.csv").read_text().splitlines()[0]
    assert head.startswith("mode,frequency,growth_rate,uncertainty,kind,multiplier_real,multiplier_imag")
    for bad in (["0"], ["1", "--about", "steady"], ["1", "--spin", "1,2"], ["1", "--matrices", "m.npz"]):
        assert CliRunner().invoke(app, ["modes", "rotor.yaml", "--period", *bad]).exit_code == 2


HUNG = {
    "hfsim": 1,
    "bodies": {"a": {"type": "rigid", "mass": 1, "inertia": 0.1, "points": {"top": [0, 1]}}},
    "solve": {"duration": 1.0},
}
HINGE_OF_A = {"hinge": {"type": "revolute", "between": ["ground", "a.top"]}}


@pytest.mark.parametrize(("joints", "number"), [({}, 3), (HINGE_OF_A, 1)])
def test_what_nothing_brings_back_goes_on_by_itself(joints, number):
    """Two multipliers of one and one motion: an error of either is the root of that of the matrix."""
    found = hfsim.modes(HUNG | {"gravity": [0, 0], "joints": joints}, period=1.0)
    assert [mode.kind for mode in found] == number * ["rigid"]


@pytest.mark.parametrize("rate", [5.0, 20.0, 30.0])
def test_a_rotor_that_nothing_drives_does_not_grow(rate):
    deck = rotor(2, rate, [900.0, 400.0])
    del deck["joints"]["motor"]
    deck["initial"]["hub"] = {"angular_velocity": rate}
    found = hfsim.modes(deck, period=2.0 * np.pi / rate)
    assert [mode.kind for mode in found] == ["rigid", *4 * ["vibration"]] and found.complete
    assert len(hfsim.modes(deck, period=2.0 * np.pi / rate, count=3)) == 3


def test_what_grows_fast_is_moved_by_little():
    """A pendulum that stands on its head: exp(w T) of 7e4, 1e8, and too much to be followed."""
    deck, fast = HUNG | {"gravity": [0, 9.81], "joints": HINGE_OF_A}, np.sqrt(9.81 / 1.1)
    for period in (4.0, 6.0):
        (found,) = hfsim.modes(deck, period=period).unstable
        assert found.value == pytest.approx(fast, abs=1e-4 / period)
    for period in (8.0, 10.0):
        with pytest.raises(HfsimError, match="too much to be followed"):
            hfsim.modes(deck, period=period)


@pytest.mark.parametrize("period", [0.5, 1.5])
def test_laws_of_another_period_are_noticed(period):
    """Of a sine nothing is seen at both ends of half a period."""
    assert hfsim.modes(PIVOT, period=period).uneven and not hfsim.modes(PIVOT, period=1.0).uneven


def test_what_is_wound_up_goes_on_otherwise():
    deck = rotor(2, 8.0, [900.0, 400.0])
    deck["springs"]["coil"] = {"type": "rotational", "between": ["ground", "hub"], "stiffness": 1.0}
    assert hfsim.modes(deck, period=2.0 * np.pi / 8.0).uneven


def test_turns_are_known_where_a_run_has_come_to():
    """In space angles are known to a turn: those of the run count on."""
    text = """hfsim: 1
gravity: [0, 0, 0]
bodies: {a: {type: rigid, mass: 1, inertia: [1, 1, 1]}}
joints:
  h: {type: revolute, between: [ground, a], axis: [0, 0, 1]}
  s: {type: servo, between: [ground, a], axis: [0, 0, 1], stiffness: 5, damping: 1,
      angle: {type: constant_rate, rate: 8}}
initial: {a: {angular_velocity: [0, 0, 8]}}
solve: {duration: 1}
"""
    found = hfsim.modes(parse_deck(text), period=2.0 * np.pi / 8.0, at=4.0)
    assert [mode.growth for mode in found] == pytest.approx([-0.5], abs=1e-7)


def test_what_has_no_freedom_has_no_modes_and_latches_begin_anew():
    welded = {"weld": {"type": "fixed", "between": ["ground", "a"]}}
    assert len(hfsim.modes(HUNG | {"joints": welded}, period=1.0)) == 0
    catch = {"hinge": HINGE_OF_A["hinge"] | {"latch": {"angle": 0.1, "stiffness": 10.0}}}
    deck = HUNG | {"joints": catch, "gravity": [0, -9.81]}
    with pytest.raises(HfsimError, match="begin anew"):
        hfsim.modes(deck, period=1.0, at=1.0)
    with pytest.raises(ArgumentError, match="two states"):
        hfsim.modes(deck, period=1.0, about="equilibrium")
