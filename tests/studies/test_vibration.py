"""Modes of scenes against closed forms, published values and roots of frequency equations."""

import json
import time
from functools import cache

import numpy as np
import pytest
import yaml
from blades import BLADE, CORIOLIS, ELEMENTS, FLAP, LAG, LAG_LINEAR
from click.testing import CliRunner
from scipy.optimize import brentq
from scipy.special import jn_zeros

import hfsim
from hfsim.cli import app
from hfsim.commands.init import starters
from hfsim.maths import pencils
from hfsim.maths.eigenpairs import _corrected, eigenpairs
from hfsim.maths.pencils import Pencil
from hfsim.output.modes import state_warnings
from hfsim.scene.loading import parse_deck
from hfsim.studies.modes.about import about

PLANE = """hfsim: 1
gravity: [0.0, {gravity}]
materials: {{light: {{density: 1.0, youngs_modulus: {modulus}}}}}
sections: {{bar: {{area: 1.0, second_moment: {moment}}}}}
bodies:
  b: {{type: beam, material: light, section: bar, length: 1.0, elements: {elements}, degree: {degree}}}
joints: {{{joints}}}
{more}
solve: {{model: exact, duration: 1.0}}
"""
ENDS = {
    "clamped-free": ("c: {type: fixed, between: [ground, b.root]}", lambda k: np.cos(k) + 1 / np.cosh(k)),
    "pinned-pinned": (
        "c: {type: revolute, between: [ground, b.root]}, d: {type: revolute, between: [ground.there, b.tip]}",
        np.sin,
    ),
    "clamped-pinned": (
        "c: {type: fixed, between: [ground, b.root]}, d: {type: revolute, between: [ground.there, b.tip]}",
        lambda k: np.sin(k) - np.cos(k) * np.tanh(k),
    ),
    "clamped-clamped": (
        "c: {type: fixed, between: [ground, b.root]}, d: {type: fixed, between: [ground.there, b.tip]}",
        lambda k: np.cos(k) - 1 / np.cosh(k),
    ),
    "pinned-free": (
        "c: {type: revolute, between: [ground, b.root]}",
        lambda k: np.sin(k) - np.cos(k) * np.tanh(k),
    ),
    "free-free": ("", lambda k: np.cos(k) - 1 / np.cosh(k)),
}


def plane(joints, elements=8, alpha=1000.0, degree=3, gravity=0.0, more=""):
    """A planar Euler beam with E I = rho A = L = 1, of a slenderness."""
    more += "\nground: {points: {there: [1.0, 0.0]}}"
    return PLANE.format(
        joints=joints,
        elements=elements,
        modulus=alpha**2,
        moment=alpha**-2,
        degree=degree,
        gravity=gravity,
        more=more,
    )


def found_in(text, count=8, **wanted):
    return hfsim.modes(parse_deck(text), count=count, **wanted)


def circular(found, *kinds):
    """Circular frequencies of all vibrations, or modes of some kinds."""
    return np.array([abs(mode.value.imag) for mode in found.modes if mode.kind in (kinds or ("vibration",))])


def roots(function, count, low=0.5):
    """The first roots of a frequency equation above a bound."""
    x = np.linspace(low, low + 3.2 * (count + 1), 4000)
    y = function(x)
    signs = np.flatnonzero(np.sign(y[1:]) != np.sign(y[:-1]))[:count]
    return np.array([brentq(function, x[k], x[k + 1], xtol=1e-14) for k in signs])


@pytest.mark.parametrize("ends", ENDS)
def test_beams_swing_as_euler_says(ends):
    joints, equation = ENDS[ends]
    expected = roots(equation, 3, 1.0) ** 2
    errors = []
    for elements in (4, 8):
        found = found_in(plane(joints, elements))
        free = [mode.number for mode in found.modes if mode.kind == "rigid"]
        assert free == list(range(1, {"free-free": 4, "pinned-free": 2}.get(ends, 1)))
        assert found.complete
        errors.append(np.abs(circular(found)[:3] / expected - 1.0))
    assert errors[1][:2].max() < 1e-3
    # cubic elements: squares of frequencies converge with the fourth power
    assert np.log2(errors[0][0] / errors[1][0]) == pytest.approx(4.0, abs=0.3)


def test_high_degrees_and_rods_reach_the_exact_values():
    found = found_in(plane(ENDS["clamped-free"][0], 4, alpha=100.0, degree=7))
    bending = roots(ENDS["clamped-free"][1], 4) ** 2
    assert circular(found)[:4] == pytest.approx(bending, rel=1e-8)
    found = found_in(plane(ENDS["clamped-free"][0], 4, alpha=1000.0, degree=7), 60)
    for value in (500.0 * np.pi, 1500.0 * np.pi):
        mode = min(found.modes, key=lambda one: abs(one.value.imag - value))
        assert mode.value.imag == pytest.approx(value, rel=1e-4)
        assert np.abs(mode.shapes["b"][:, 0]).max() == pytest.approx(1.0, rel=1e-6)


SHORT = """hfsim: 1
gravity: [0, 0, 0]
sections:
  bar:
    mass_per_length: 2.0
    rotary_inertia: [0.3, 0.1, 0.2]
    axial_stiffness: 4.0e3
    shear_stiffness: [300.0, 500.0]
    torsion_stiffness: 7.0
    bending_stiffness: [9.0, 16.0]
bodies: {b: {type: beam, section: bar, length: 1.5, elements: 4, degree: 5, element: cosserat}}
joints: {c: {type: fixed, between: [ground, b.root]}}
solve: {model: MODEL, duration: 1.0}
"""


@cache
def timoshenko(count, EI, GA, rho_I, rho_A=2.0, length=1.5):
    """Circular frequencies of a clamped-free Timoshenko beam, from the determinant of its four conditions."""

    def determinant(w):
        A = np.zeros((4, 4))
        # (v, phi, M, V)' = A (v, phi, M, V)
        A[0, 1], A[0, 3], A[1, 2] = 1.0, 1.0 / GA, 1.0 / EI
        A[2, 1], A[2, 3], A[3, 0] = -rho_I * w**2, -1.0, -rho_A * w**2
        values, vectors = np.linalg.eig(length * A.astype(complex))
        T = (vectors * np.exp(values)) @ np.linalg.inv(vectors)
        return np.linalg.det(T[2:, 2:]).real

    w = np.linspace(0.2, 120.0, 1500)
    y = np.array([determinant(one) for one in w])
    signs = np.flatnonzero(np.sign(y[1:]) != np.sign(y[:-1]))[:count]
    return np.array([brentq(determinant, w[k], w[k + 1], xtol=1e-13) for k in signs])


@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact"])
def test_short_beams_swing_as_timoshenko_says_and_twist(model):
    found = found_in(SHORT.replace("MODEL", model), 16)
    # bending about z moves along y, with the first shear stiffness
    expected = [*timoshenko(3, 16.0, 300.0, 0.2), *timoshenko(3, 9.0, 500.0, 0.1)]
    expected += [np.pi / 3.0 * (2 * k - 1) * np.sqrt(7.0 / 0.3) for k in (1, 2)]
    twisting = [mode.value.imag for mode in found.modes if mode.turns_only]
    assert twisting[:2] == pytest.approx(expected[-2:], rel=1e-6)
    here = circular(found)
    for value in expected:
        assert np.abs(here / value - 1.0).min() < 1e-6, value


def test_a_chain_hangs_with_the_zeros_of_bessels_function():
    hung = plane("c: {type: revolute, between: [ground, b.root]}", 12, alpha=1e5, degree=5, gravity=-9.81)
    # next to no stiffness: that of bending is one, so gravity is made large instead
    hung = hung.replace("-9.81", "-1.0e7") + "initial: {b: {angle: '-90 deg'}}\n"
    found = found_in(hung, 4, about="equilibrium")
    assert found.about.lasting
    expected = 0.5 * jn_zeros(0, 3) * np.sqrt(1e7)
    assert circular(found)[:3] == pytest.approx(expected, rel=2e-3)


def test_a_stiff_beam_on_a_pin_is_a_pendulum():
    hung = (
        plane("c: {type: revolute, between: [ground, b.root]}", 4, gravity=-1e-3)
        + "initial: {b: {angle: '-90 deg'}}\n"
    )
    found = found_in(hung, 3, about="equilibrium")
    assert circular(found)[0] == pytest.approx(np.sqrt(1.5e-3), rel=1e-5)
    assert found.facts()["about"]["steady"]
    assert not found_in(hung.replace("-90", "-80"), 3).facts()["about"]["steady"]


def test_an_equilibrium_that_nothing_holds_is_one_of_many():
    text = plane("c: {type: revolute, between: [ground, b.root]}", 2)
    told = {state: [*state_warnings(found_in(text, 3, about=state))] for state in ("equilibrium", "start")}
    many = "one equilibrium of many, since nothing resists: b: turns about c"
    assert told == {"equilibrium": [many], "start": []}


def blade(model, gamma, alpha, elements):
    section, beam = ELEMENTS["cable"]
    numbers = {"modulus": alpha**2, "moment": alpha**-2, "gamma": float(gamma), "model": model}
    return BLADE.format(
        section=section.format(**numbers),
        element=beam.replace("elements: 6", f"elements: {elements}, degree: 5"),
        **numbers,
    )


@pytest.mark.parametrize("gamma", [1, 3, 5])
def test_blades_that_turn_flap_and_lag_at_published_frequencies(gamma):
    found = found_in(blade("exact", gamma, 3000.0, 3), 2, about="steady")
    lag, flap = circular(found)
    assert flap == pytest.approx(FLAP[gamma], rel=1e-6)
    assert lag == pytest.approx(LAG[gamma], rel=1e-5)
    assert found.about.lasting and not found.facts()["about"]["uneven"]
    assert found.about.turning.spin == pytest.approx([0.0, 0.0, gamma])


@pytest.mark.parametrize("gamma", [1, 3])
@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact"])
def test_their_models_have_the_frequencies_that_theory_gives_them(model, gamma):
    found = found_in(blade(model, gamma, 70.0, 3), 2, about="steady" if model == "exact" else "start")
    expected = CORIOLIS[gamma] if model == "exact" else LAG_LINEAR[gamma]
    # unstretched, at the start, lowOrder has no tension either
    near = 1e-3 if model == "exact" else 1e-6
    assert circular(found)[0] == pytest.approx(expected, rel=near)


def test_linear_blades_diverge_beyond_their_critical_rate():
    start = parse_deck(blade("linear", 1, 3000.0, 3))
    found = hfsim.campbell(start, np.linspace(0.0, 5.0, 6), count=2)
    critical = [one for one in found.crossings if one.order == 0]
    assert [one.rate for one in critical] == pytest.approx([3.51601526850015], rel=1e-6)
    assert {one["kind"] for one in found.facts()["unstable"]} == {"divergence"}
    # at rest at the start, the hinge says about which axis
    resting = blade("linear", 0, 3000.0, 3).replace(
        "constant_rate, rate: 0.0", "spin_up, rate: 5.0, time: 1.0"
    )
    assert "spin_up" in resting
    again = hfsim.campbell(parse_deck(resting), [3.0, 4.0], count=2)
    critical = [one.rate for one in again.crossings if one.order == 0]
    assert critical == pytest.approx([3.51601526850015], rel=1e-6)
    once = [one for one in found.crossings if one.order == 1]
    assert [one.rate for one in once] == pytest.approx(
        [3.51601526850015 / 2**0.5, 3.51601526850015], rel=1e-6
    )


SHAFT = """hfsim: 1
gravity: [0, 0, 0]
sections:
  round:
    mass_per_length: 1.0
    rotary_inertia: [2.0e-6, 1.0e-6, 1.0e-6]
    axial_stiffness: 1.0e6
    shear_stiffness: [1.0e7, 1.0e7]
    torsion_stiffness: 0.8
    bending_stiffness: [1.0, 1.0]
ground: {points: {there: [1.0, 0.0, 0.0]}}
bodies: {s: {type: beam, section: round, length: 1.0, elements: 4, degree: 4, element: cosserat}}
joints:
  left: {type: spherical, between: [ground, s.root]}
  right: {type: spherical, between: [ground.there, s.tip]}
initial: {s: {angular_velocity: [1.0, 0.0, 0.0]}}
solve: {model: exact, duration: 1.0}
"""


@pytest.mark.slow
def test_a_shaft_is_critical_at_its_bending_frequencies():
    found = hfsim.campbell(parse_deck(SHAFT), [6.0, 9.0, 12.0], count=3)
    critical = sorted(one.rate for one in found.crossings if one.order == 0)
    assert critical[0] == pytest.approx(np.pi**2, rel=1e-4)
    # who turns along sees the two whirls of a frequency apart by twice the rate
    seen = circular(found.founds[0])
    assert np.abs(seen - (np.pi**2 - 6.0)).min() < 2e-3 and np.abs(seen - (np.pi**2 + 6.0)).min() < 2e-3


@pytest.mark.parametrize(
    ("damping", "load", "unstable"),
    [(0.0, 20.0, False), (0.0, 20.1, True), (1e-4, 10.9, False), (1e-4, 11.0, True)],
)
def test_becks_column_flutters_beyond_its_critical_load(damping, load, unstable):
    """At 20.0509 E I / L^2, and with a little damping inside it, however little, at 10.94."""
    pushed = plane(
        ENDS["clamped-free"][0], 8, alpha=3000.0, degree=5,
        more=f"loads: {{push: {{type: force, at: b.tip, force: [{-load}, 0.0], follower: true}}}}",
    ).replace("youngs_modulus", f"bending_damping: {damping}, youngs_modulus")  # fmt: skip
    found = found_in(pushed, 4, about="equilibrium")
    assert found.about.lasting
    assert [mode.kind for mode in found.unstable] == (["flutter"] if unstable else [])


BESIDE = """hfsim: 1
gravity: [0, -9.81]
ground: {points: {p: [3, 0], q: [2, 0]}}
bodies:
  a: {type: rigid, mass: 1.0, inertia: 0.1, points: {r: [-0.5, 0]}}
  b: {type: rigid, mass: 1.0, inertia: 0.1}
joints:
  h: {type: revolute, between: [ground, a.r]}
  s: {type: prismatic, between: [ground.p, b], axis: [1, 0], damping: 0.1}
springs: {k: {type: two_point, between: [ground.q, b], stiffness: 4.0, rest_length: 1.0}}
initial: {a: {angle: 90 deg}, b: {position: [3, 0]}}
solve: {duration: 1.0}
"""


def test_what_grows_at_the_rate_of_the_shift_hides_nothing_else():
    """A pendulum that stands on its head beside a damped mass: the shift was the very rate of its fall."""
    rate = np.sqrt(0.5 * 9.81 / (0.1 + 0.25))
    found = hfsim.modes(parse_deck(BESIDE))
    values = sorted((one.value for one in found.modes), key=lambda one: one.real)
    assert values == pytest.approx([-rate, -0.05 + 1j * np.sqrt(4.0 - 0.05**2), rate], rel=1e-6)


SWUNG_OUT = """hfsim: 1
gravity: [0, 0, -9.81]
bodies:
  hub: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {r: [0.2, 0, 0]}}
  arm: {type: rigid, mass: 2.0, inertia: [0.03, 0.035, 0.01], points: {a: [0, 0, 0.6]}}
joints:
  b: {type: revolute, between: [ground, hub]}
  h: {type: revolute, between: [hub.r, arm.a], axis: [0, 1, 0]}
  dr: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 5.0}}
initial:
  steady: {body: hub, rate: 5.0}
  arm: {orientation: {axis: [0, 1, 0], angle: -0.5}}
solve: {duration: 3.0}
"""


def test_the_only_mode_of_a_scene_is_followed_however_far_it_swings_out():
    """Frequencies by the effective potential of an arm on a hub."""
    found = hfsim.campbell(parse_deck(SWUNG_OUT), [2.0, 5.0, 10.0])
    assert found.frequencies(1) == pytest.approx([0.546929, 0.844721, 1.80501], rel=1e-5)
    # it is slower than the rotation for a while, between rates that do not tell: both crossings are found
    assert [(one.order, one.frequency * 2.0 * np.pi - one.rate) for one in found.crossings] == [
        (1, pytest.approx(0.0, abs=1e-5)),
        (1, pytest.approx(0.0, abs=1e-5)),
    ]


def test_a_damper_damps_as_its_ratio_says():
    deck = """hfsim: 1
gravity: [0.0, 0.0]
bodies: {bob: {type: rigid, mass: 2.0, inertia: 0.3, points: {pivot: [0.0, 0.7]}}}
joints: {pin: {type: revolute, between: [ground, bob.pivot]}}
springs: {coil: {type: rotational, between: [ground, bob], stiffness: 5.0, damping: DAMPING}}
solve: {duration: 1.0}
"""
    inertia = 0.3 + 2.0 * 0.7**2
    critical = 2.0 * np.sqrt(5.0 * inertia)
    (mode,) = found_in(deck.replace("DAMPING", str(0.3 * critical))).modes
    assert mode.damping_ratio == pytest.approx(0.3, rel=1e-9)
    assert 2.0 * np.pi * mode.natural_frequency == pytest.approx(np.sqrt(5.0 / inertia), rel=1e-9)
    assert mode.kind == "vibration" and mode.shares == {"bob": 1.0}
    found = found_in(deck.replace("DAMPING", str(1.5 * critical)))
    assert [one.kind for one in found.modes] == ["decay", "decay"]
    loose = found_in(deck.replace("DAMPING", "2.0").replace("stiffness: 5.0", "stiffness: 0.0"))
    assert [one.kind for one in loose.modes] == ["drift", "decay"]
    assert loose.modes[1].growth == pytest.approx(-2.0 / inertia, rel=1e-9)


TOP = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies: {top: {type: rigid, mass: 3.0, inertia: [0.3, 0.3, 0.5], points: {peg: [0.0, 0.0, -0.4]}}}
joints: {peg: {type: spherical, between: [ground, top.peg]}}
initial: {top: {angular_velocity: [0.0, 0.0, SPIN]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("spin", [12.0, 20.0])
def test_a_sleeping_top_precesses_and_nutates(spin):
    inertia, own, weight = 0.3 + 3.0 * 0.16, 0.5, 3.0 * 9.81 * 0.4
    found = found_in(TOP.replace("SPIN", str(spin)))
    root = np.sqrt(complex(own**2 * spin**2 - 4.0 * inertia * weight))
    # seen from axes that turn with it
    expected = [(own * spin + sign * root) / (2.0 * inertia) - spin for sign in (-1.0, 1.0)]
    if own * spin < 2.0 * np.sqrt(inertia * weight):
        (falling,) = found.unstable
        assert falling.kind == "flutter"
        assert falling.growth == pytest.approx(abs(expected[0].imag), rel=1e-8)
        assert falling.value.imag == pytest.approx(abs(expected[0].real), rel=1e-8)
    else:
        assert not found.unstable
        assert np.sort(circular(found)) == pytest.approx(np.sort(np.abs(np.real(expected))), rel=1e-8)


@pytest.mark.parametrize("tilt", [0.7, 1.3])
@pytest.mark.parametrize("precession", [2.0, -1.0])
def test_a_top_that_precesses_steadily_nutates(tilt, precession):
    """Small changes of its tilt have the curvature of the effective potential."""
    own, inertia, weight = 0.5, 0.3 + 3.0 * 0.4**2, 3.0 * 9.81 * 0.4
    total = (inertia * precession**2 * np.cos(tilt) + weight) / (own * precession)
    e = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    relative = total - precession * np.cos(tilt)
    rates = [0.0, 0.0, precession] + relative * e
    x = [float(np.cos(tilt)), 0.0, -float(np.sin(tilt))]
    entry = f"orientation: {{x: {x}, y: [0.0, 1.0, 0.0]}}, angular_velocity"
    found = found_in(TOP.replace("angular_velocity", entry).replace("[0.0, 0.0, SPIN]", str(rates.tolist())))
    assert found.about.lasting and not found.facts()["about"]["uneven"]
    assert found.about.turning.own["top"] == pytest.approx(relative)
    about_z = inertia * precession * np.sin(tilt) ** 2 + own * total * np.cos(tilt)
    h, s, c = about_z - own * total * np.cos(tilt), np.sin(tilt), np.cos(tilt)
    # the second derivative of (p - q cos)^2 / (2 A sin^2) + w cos, p and q being the momenta
    q = own * total
    first = lambda t: ((about_z - q * np.cos(t)) * (q - about_z * np.cos(t)) / np.sin(t) ** 3) / inertia  # noqa: E731
    slope = (8 * (first(tilt + 1e-3) - first(tilt - 1e-3)) - first(tilt + 2e-3) + first(tilt - 2e-3)) / 12e-3
    assert h * (q - about_z * c) / (inertia * s**3) == pytest.approx(weight * s, rel=1e-9)
    assert circular(found)[-1] == pytest.approx(np.sqrt((slope - weight * c) / inertia), rel=1e-8)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_thrown_body_diverges_about_its_middle_axis_alone(axis):
    moments, spin = np.array([1.0, 2.0, 2.8]), 3.0
    rates = [spin * float(k == axis) for k in range(3)]
    deck = TOP.replace("SPIN", "0").replace("[0.0, 0.0, 0]", str(rates)).replace("-9.81", "0.0")
    deck = deck.replace("[0.3, 0.3, 0.5]", "[1.0, 2.0, 2.8]").replace(
        "joints: {peg: {type: spherical, between: [ground, top.peg]}}", ""
    )
    deck = deck.replace(
        "angular_velocity", "position: [0.4, 0.1, 0.7], velocity: [1.0, 2.0, 3.0], angular_velocity"
    )
    found = found_in(deck, 12)
    i, j = (k for k in range(3) if k != axis)
    square = (moments[axis] - moments[i]) * (moments[axis] - moments[j]) / (moments[i] * moments[j])
    assert found.about.lasting
    if axis == 1:
        (falling,) = found.unstable
        assert falling.kind == "divergence"
        assert falling.growth == pytest.approx(spin * np.sqrt(-square), rel=1e-9)
    else:
        assert not found.unstable
        assert np.abs(circular(found) / (spin * np.sqrt(square)) - 1.0).min() < 1e-9


def test_large_scenes_have_the_modes_of_small_ones_and_none_is_missing():
    text = plane(ENDS["clamped-clamped"][0], 60)
    pencil = about(parse_deck(text)).motions.pencil
    assert pencil.large
    large = eigenpairs(pencil, 10)
    assert large.complete
    M, _, K, J = (one.toarray() for one in pencil.matrices)
    Z = np.linalg.svd(J)[2][len(J) :].T if len(J) else np.eye(len(M))
    every = np.sort(np.linalg.eigvals(np.linalg.solve(Z.T @ M @ Z, Z.T @ K @ Z)).real)
    assert large.values.imag[:10] == pytest.approx(np.sqrt(every[:10]), rel=1e-6)
    damped = Pencil(M, 1e-3 * M + 1e-6 * K, K, J)
    some = eigenpairs(damped, 6)
    size = np.sqrt(every[:6])
    assert np.abs(some.values[:6]) == pytest.approx(size, rel=1e-6)
    assert -some.values.real[:6] == pytest.approx(0.5 * (1e-3 + 1e-6 * every[:6]), rel=1e-6)


def test_a_thousand_elements_take_seconds():
    before = time.perf_counter()
    found = found_in(plane(ENDS["clamped-free"][0], 1000), 10)
    assert time.perf_counter() - before < 10.0
    assert found.complete
    expected = roots(ENDS["clamped-free"][1], 5) ** 2
    assert circular(found)[:5] == pytest.approx(expected, rel=1e-3)
    # rounding of the stiffness, which grows with the fourth power of the elements, is told
    for mode, value in zip(found.modes, expected, strict=False):
        assert abs(mode.value.imag - value) < mode.uncertainty + 1e-6 * value


def test_matrices_of_what_cannot_move_are_empty(tmp_path):
    deck = {
        "hfsim": 1,
        "bodies": {"a": {"type": "rigid", "mass": 1.0, "inertia": 0.1}},
        "joints": {"j": {"type": "fixed", "between": ["ground", "a"]}},
        "solve": {"duration": 1.0},
    }
    (tmp_path / "fixed.yaml").write_text(yaml.safe_dump(deck))
    given = ["modes", str(tmp_path / "fixed.yaml"), "-o", str(tmp_path / "out"), "--no-plots"]
    done = CliRunner().invoke(app, [*given, "--matrices", str(tmp_path / "m.npz")])
    assert done.exit_code == 0, done.output
    with np.load(tmp_path / "m.npz") as arrays:
        assert arrays["A"].shape == (0, 0) and arrays["T"].shape == (len(arrays["names"]), 0)


def test_the_command_writes_what_it_tells(tmp_path):
    deck = tmp_path / "beam.yaml"
    deck.write_text(
        "name: beam\n" + plane(ENDS["clamped-free"][0], 4).replace("youngs", "bending_damping: 0.001, youngs")
    )
    file = tmp_path / "m.npz"
    done = CliRunner().invoke(
        app, ["modes", str(deck), "-o", str(tmp_path / "out"), "--count", "4", "--matrices", str(file)]
    )
    assert done.exit_code == 0, done.output
    assert "vibration" in done.stdout and "none is unstable" in done.stdout
    facts = json.loads((tmp_path / "out" / "modes.json").read_text())
    lines = (tmp_path / "out" / "modes.csv").read_text().splitlines()
    assert lines[0].startswith("mode,frequency,damping_ratio") and len(lines) == 5
    assert facts["files"] == ["modes.csv", "modes.json", "plots/modes.png"]
    first = facts["modes"][0]
    assert first["frequency"] == pytest.approx(3.516 / (2 * np.pi), rel=1e-3)
    assert first["damping_ratio"] == pytest.approx(0.5 * 0.001 * 3.516, rel=1e-3)
    with np.load(file) as arrays:
        values = np.linalg.eigvals(arrays["A"])
        M, C, G, K = (arrays[name] for name in "MCGK")
        assert len(arrays["free_names"]) == len(M) and not arrays["J"].size
        assert arrays["T"].shape == (len(arrays["names"]), len(values) // 2)
        assert pytest.approx(C.T) == C and np.abs(G).max() < 1e-12 * np.abs(C).max()
        told = arrays["eigenvalues"]
    for value in told:
        assert np.abs(values - value).min() < 1e-6 * abs(value)
        assert np.linalg.svd(value**2 * M + value * C + K)[1][-1] < 1e-7 * np.abs(K).max()


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_curves_of_a_campbell_diagram_go_through_their_crossings(sense, monkeypatch, tmp_path):
    from hfsim.output.plots import campbell as pictures

    drawn = {}
    monkeypatch.setattr(pictures, "save", lambda figures, folder: drawn.update(figures) or [])
    rates = sense * np.linspace(0.0, 5.0, 3)
    found = hfsim.campbell(parse_deck(blade("linear", 1, 3000.0, 3)), np.sort(rates), count=2)
    pictures.draw_campbell(found, tmp_path)
    lines = drawn["campbell"].axes[0].lines
    excited = [line.get_xydata() for line in lines if line.get_color() == pictures._LINES]
    for one in (one for one in found.crossings if one.order):
        assert np.interp(one.rate, *excited[one.order - 1].T) == pytest.approx(one.frequency)
    curve = lines[0].get_xydata()
    crossings = [(one.rate, one.frequency) for one in found.crossings if one.track == 1]
    assert crossings and all((np.abs(curve - one).max(axis=1) == 0.0).any() for one in crossings)
    assert (np.diff(curve[:, 0]) >= 0.0).all()


def test_the_command_draws_campbell_diagrams_and_says_what_is_unstable(tmp_path):
    deck = tmp_path / "blade.yaml"
    deck.write_text(blade("linear", 1, 70.0, 2))
    run = CliRunner().invoke
    where = ["-o", str(tmp_path / "out"), "--count", "2"]
    done = run(app, ["modes", str(deck), *where, "--spin", "lin(0,5,3)"])
    assert done.exit_code == 0, done.output
    assert "critical" in done.stdout and "divergence" in done.stdout
    assert (tmp_path / "out" / "plots" / "campbell.png").exists()
    rows = (tmp_path / "out" / "campbell.csv").read_text().splitlines()
    assert rows[0].startswith("rate,mode,frequency") and len(rows) == 7
    told = run(app, ["modes", str(deck), *where, "--force", "--csv"])
    assert told.stdout.startswith("mode,frequency,damping_ratio")
    assert run(app, ["modes", str(deck), *where, "--spin", "3"]).exit_code == 2
    assert run(app, ["modes", str(deck), *where]).exit_code == 2
    deck.write_text(plane(ENDS["clamped-free"][0], 2))
    resting = run(app, ["modes", str(deck), *where, "--force", "--about", "steady"])
    assert resting.exit_code == 2 and "nothing turns" in resting.output


def test_a_state_of_a_run_is_seen_from_axes_that_turn():
    thrown = TOP.replace("SPIN", "20.0")
    start, later = (found_in(thrown, 4, **wanted) for wanted in ({}, {"at": 0.3}))
    assert later.facts()["about"]["time"] == 0.3
    assert np.sort(circular(later)) == pytest.approx(np.sort(circular(start)), rel=1e-6)


@pytest.mark.parametrize(("elements", "degree"), [(1, 3), (2, 5), (4, 7), (40, 3)])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_tension_that_is_rounding_makes_no_mode_of_a_thin_strip(elements, degree, angle):
    """Strains of rounding times a large axial stiffness are more than the bending stiffness knows of."""
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0],
        "materials": {"m": {"density": 1.0, "youngs_modulus": 1e6}},
        "sections": {"s": {"area": 1.0, "second_moment": 1e-6}},
        "bodies": {
            "b": {
                "type": "beam", "material": "m", "section": "s", "length": 1.0,
                "elements": elements, "degree": degree,
            }
        },
        "joints": {"pin": {"type": "revolute", "between": ["ground", "b.root"]}},
        "initial": {"b": {"angle": angle}},
        "solve": {"duration": 1.0},
    }  # fmt: skip
    found = hfsim.modes(deck)
    assert [mode.kind for mode in found.modes[:4]] == ["rigid", "vibration", "vibration", "vibration"]
    first = 15.4182057169801 / (2.0 * np.pi)
    assert found.frequencies[1] == pytest.approx(first, rel=0.15 if elements == 1 else 1e-4)
    assert [mode.number for mode in found] == list(range(1, len(found) + 1))
    assert max(len(repr(one)) for one in (found, *found)) < 120 and "vibration" in repr(found[2])


SPIN = """hfsim: 1
gravity: [0.0, 0.0]
materials: {m: {density: 1.2, youngs_modulus: 2.8e7}}
sections: {s: {area: 1.0, second_moment: 5.0e-4}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 1.0}
  b: {type: beam, material: m, section: s, length: 10.0, elements: 4, degree: 5, strain: engineering}
joints:
  pin: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub, b.root]}
initial: {steady: {body: hub, rate: 6.0}}
solve: {model: exact, duration: 1.0}
"""


FLYER = """hfsim: 1
gravity: [0.0, 0.0]
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 1.0, points: {left: [-0.3, 0.0], right: [0.3, 0.0]}}
  one: {type: rigid, mass: 2.0, inertia: 0.4, points: {pin: [-0.5, 0.0]}}
  two: {type: rigid, mass: 2.0, inertia: 0.4, points: {pin: [0.5, 0.0]}}
joints:
  right: {type: revolute, between: [hub.right, one.pin]}
  left: {type: revolute, between: [hub.left, two.pin]}
initial: {hub: {angular_velocity: 2.0}, one: {angular_velocity: ARMS}, two: {angular_velocity: ARMS}}
solve: {duration: 1.0}
"""


def test_a_body_tells_the_axis_where_others_turn_differently(tmp_path):
    rates = [1.0, 4.0]
    found = hfsim.campbell(parse_deck(FLYER.replace("ARMS", "0.0")), rates, body="hub", count=5)
    alike = hfsim.campbell(parse_deck(FLYER.replace("ARMS", "2.0")), rates, count=5)
    # arms that swing together, against the hub: a pendulum's stiffness in the field of the rotation
    inertia, arm, about_all = 0.4 + 2.0 * 0.5**2, 2.0 * 0.5 * 0.3, 1.0 + 2.0 * (0.4 + 2.0 * 0.8**2)
    whole = inertia + arm
    expected = (arm / (inertia - 2.0 * whole**2 / about_all)) ** 0.5
    for one in (found, alike):
        seen = np.array([circular(modes) / rate for modes, rate in zip(one.founds, rates, strict=True)])
        assert np.abs(seen - expected).min(axis=1) == pytest.approx(0.0, abs=1e-8)
    deck = tmp_path / "flyer.yaml"
    deck.write_text(FLYER.replace("ARMS", "0.0"))
    start = ["modes", str(deck), "--force", "--no-plots", "-o", str(tmp_path / "out")]
    run = CliRunner().invoke
    done = run(app, [*start, "--spin", "1,4", "--spin-body", "hub", "--csv"])
    assert done.exit_code == 0 and done.stdout.startswith("rate,mode"), done.output
    for more, told in (
        (["--spin", "1,4"], "--spin-body"),
        (["--spin", "1,4", "--spin-body", "hob"], "no body 'hob'"),
        (["--spin", "1,4", "--spin-body", "one"], "'one' does not turn"),
        (["--spin-body", "hub"], "goes with --spin"),
    ):
        failed = run(app, [*start, *more])
        assert failed.exit_code == 2 and told in failed.output


def test_a_rod_that_starts_in_steady_rotation_is_followed_from_there():
    """What nothing resists, as a turn of a free hub, stays; at the rate of the start it is the start."""
    deck = parse_deck(SPIN)
    found = hfsim.campbell(deck, [2.0, 6.0, 12.0], count=3)
    own, scene = found.founds[1].about, found.founds[1].about.scene
    assert own.turning.spin == pytest.approx([6.0]) and own.lasting
    assert own.motions.x == pytest.approx(scene.system.absolute(scene.q[None])[0], abs=1e-9)
    for rate, one in zip(found.rates, found.founds, strict=True):
        tip = one.about.scene.marker("b.tip").position(one.about.motions.x[None])[0]
        # of E A u'' + m w^2 (s + u) = 0
        wave = rate * np.sqrt(1.2 / 2.8e7)
        assert np.linalg.norm(tip) == pytest.approx(np.tan(10.0 * wave) / wave, rel=1e-9)
        assert one.about.lasting
    driven = "  drive: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 6.0}}"
    again = hfsim.campbell(parse_deck(SPIN.replace("initial:", f"{driven}\ninitial:")), [2.0, 12.0], count=3)
    assert again.founds[-1].about.motions.x == pytest.approx(found.founds[-1].about.motions.x, abs=1e-9)


def test_a_free_hub_is_followed_beyond_critical_rates():
    text = SPIN.replace(", strain: engineering", "").replace("exact", "linear")
    found = hfsim.campbell(parse_deck(text), [4.0, 6.0, 40.0, 400.0], count=3)
    assert all(one.about.lasting for one in found.founds)


def test_modes_of_one_frequency_are_followed_to_where_they_part():
    """A round rod at rest swings all around at one frequency; turning, flap w0^2 + 1.19 W^2 and lag part.

    The shipped blade is at rest at first, and driven: its axis is what its other joints leave.
    """
    found = hfsim.campbell("blade", [0.0, 1.0, 4.0, 8.0], count=2)
    frequencies = np.array([found.frequencies(1), found.frequencies(2)]) * 2.0 * np.pi
    assert np.isfinite(frequencies).all()
    assert frequencies[0, 0] == pytest.approx(frequencies[1, 0], rel=1e-9)
    flap, lag = sorted(frequencies.tolist(), key=max)[::-1]
    rates = np.array([0.0, 1.0, 4.0, 8.0])
    assert np.square(flap) - np.square(lag) == pytest.approx(rates**2, rel=0.05, abs=1e-6)
    assert not found.facts()["unsteady_rates"]
    crossings = {(one.track, one.order): one.rate for one in found.crossings}
    assert len({round(rate, 6) for rate in crossings.values()}) == len(crossings)


WIRE = """hfsim: 1
gravity: [0, 0, 0]
materials: {{steel: {{density: 7800, youngs_modulus: 2.0e11, poisson_ratio: 0.3}}}}
sections: {{wire: {{shape: circle, diameter: {diameter}}}}}
bodies:
  b: {{type: beam, material: steel, section: wire, length: {length}, elements: {elements}}}
  {tip}
{joints}
solve: {{duration: 1}}
"""


def wire(slenderness, elements, length=10.0, load=0.0, free=False):
    """Modes of a round steel wire over its first two frequencies by Euler, with a mass at the tip.

    The latter is a multiple of the mass of the wire.
    """
    diameter = length / slenderness
    mass = 7800.0 * np.pi * diameter**2 / 4.0
    held = ["c: {type: fixed, between: [ground, b.root]}"]
    tip = f"m: {{type: rigid, mass: {load * mass * length}, inertia: [1e-9, 1e-9, 1e-9]}}" if load else ""
    held += ["e: {type: fixed, between: [b.tip, m]}"] if load else []
    joints = "" if free else f"joints: {{{', '.join(held)}}}"
    own = {"diameter": diameter, "length": length, "elements": elements, "tip": tip, "joints": joints}
    found = found_in(WIRE.format(**own), 12)

    def equation(k):
        if free:
            return np.cos(k) - 1.0 / np.cosh(k)
        return np.cos(k) + 1.0 / np.cosh(k) + load * k * (np.cos(k) * np.tanh(k) - np.sin(k))

    speed = (2.0e11 / 7800.0) ** 0.5 * diameter / 4.0 / length**2
    first = np.repeat(roots(equation, 2, 1.0 if free else 0.01), 2) ** 2 * speed
    return found, [mode for mode in found.modes if mode.kind == "vibration"][:4], first


@pytest.mark.parametrize("elements", [4, 8, pytest.param(30, marks=pytest.mark.slow)])
@pytest.mark.parametrize("slenderness", [100, 1000, 5000, 20000])
def test_wires_of_any_slenderness_swing_as_euler_says(slenderness, elements):
    """In the same scene sections turn against their line 1e6 to 1e9 times as fast."""
    for load, free in ((0.0, False), (10.0, False), (0.0, True)):
        found, swinging, expected = wire(slenderness, elements, load=load, free=free)
        assert sum(mode.kind == "rigid" for mode in found.modes) == (6 if free else 0)
        assert not found.unstable
        seen = np.array([mode.value.imag for mode in swinging])
        told = np.array([mode.uncertainty for mode in swinging])
        assert np.all(np.abs(seen - expected) <= 1e-3 * expected + told)
        assert np.all(told <= 1e-2 * expected)


def test_what_goes_away_slowly_is_found_beside_what_joints_hold():
    """The shift next to it is no eigenvalue, though it is as large."""
    square = -(2.0**-30)
    pencil = Pencil(np.eye(2), np.zeros((2, 2)), np.diag([20.0, square]), np.array([[1.0, 0.0]]))
    found = eigenpairs(pencil, 2)
    assert np.sort(found.values.real) == pytest.approx([-(2.0**-15), 2.0**-15], rel=1e-9)



DISC = """hfsim: 1
gravity: [0, 0, 0]
materials: {{steel: {{density: {density}, youngs_modulus: 2.0e11, poisson_ratio: 0.3}}}}
sections: {{c: {{shape: circle, diameter: 1 cm}}}}
bodies:
  sh: {{type: beam, material: steel, section: c, length: 0.5, elements: {elements}, degree: {degree}}}
  di: {{type: rigid, mass: 5, inertia: [0.1, 0.05, 0.05]}}
joints:
  b: {{type: {held}, between: [ground, sh.root]}}
  f: {{type: revolute, between: [sh.tip, di], axis: [1, 0, 0]}}
initial: {{sh: {{angular_velocity: [{shaft}, 0, 0]}}, di: {{angular_velocity: [{spin}, 0, 0]}}}}
solve: {{duration: 1}}
"""


def disc(spin, density=7800.0, elements=2, degree=3, shaft=0.0):
    """Modes of a disc that spins on the free end of a shaft, which is clamped unless it turns, too."""
    held = "revolute, axis: [1, 0, 0]" if shaft else "fixed"
    own = {"density": density, "elements": elements, "degree": degree, "held": held}
    return found_in(DISC.format(spin=spin, shaft=shaft, **own), 7)


def whirls(spin):
    """Circular frequencies of the same disc on a shaft without mass, both ways round.

    Sideways and in turns, r e^iwt and p e^iwt: (12 EI/L^3 - m w^2) r = 6 EI/L^2 p and
    (4 EI/L - I w^2 + C spin w) p = 6 EI/L^2 r.  Shear gives way by 3e-4 of that.
    """
    bending, length, mass = 2.0e11 * np.pi * 0.01**4 / 64.0, 0.5, 5.0
    straight, mixed, turning = 12.0 * bending / length**3, 6.0 * bending / length**2, 4.0 * bending / length
    powers = [
        [-mass * -0.05, -mass * 0.1 * spin, -mass * turning - 0.05 * straight],
        [0.1 * spin * straight, straight * turning - mixed**2],
    ]
    return np.sort(np.abs(np.roots(powers[0] + powers[1])))


@pytest.mark.parametrize("spin", [1e-4, 0.01, 1.0, 30.0, 100.0, 300.0, 1000.0])
@pytest.mark.parametrize(("elements", "degree"), [(1, 3), (2, 3), (2, 4), (3, 3)])
def test_a_disc_that_spins_on_a_clamped_shaft_goes_on_and_on(spin, elements, degree):
    found = disc(spin, elements=elements, degree=degree)
    assert not found.unstable and found.about.turning.own == {"di": pytest.approx(spin, rel=1e-13)}
    assert not found.about.turning.spin.any()
    assert [mode.kind for mode in found.modes] == ["rigid", *["vibration"] * 6]
    assert found.modes[0].value == 0.0
    assert found.facts()["about"]["steady"]


@pytest.mark.parametrize("density", [1e-3, 0.1])
def test_a_shaft_next_to_without_mass_is_clamped_all_the_same(density):
    found = disc(300.0, density)
    assert not found.about.turning.spin.any()
    assert [mode.kind for mode in found.modes[:6]] == ["rigid", *["vibration"] * 5]
    assert circular(found)[:4] == pytest.approx(whirls(300.0), rel=1e-3)
    assert circular(found)[4] == pytest.approx((2.0e11 * np.pi * 0.01**2 / 4.0 / 0.5 / 5.0) ** 0.5, rel=1e-4)


@pytest.mark.parametrize("spin", [0.0, 100.0, 300.0, -100.0])
def test_discs_on_shafts_that_turn_whirl_as_on_those_that_do_not(spin):
    """But for the spin of the shaft; where all turn at 100 rad/s, w is seen as w - 100 from axes that do."""
    found, still = disc(spin, shaft=100.0), disc(spin or 1e-9)
    turning, together = found.about.turning, spin == 100.0
    assert turning.spin == pytest.approx([100.0 * together, 0.0, 0.0], rel=1e-13)
    own = {} if together else {"sh": 100.0, "di": spin}
    assert turning.own == pytest.approx({name: rate for name, rate in own.items() if rate}, rel=1e-13)
    assert not found.unstable and [mode.kind for mode in found.modes[:3]] == ["rigid", "rigid", "vibration"]
    seen, expected = circular(found)[:4], circular(still)[:4]
    if together:
        ways = np.abs(np.add.outer(seen, [-100.0, 100.0])).ravel(), np.abs(100.0 - seen)
        seen = np.concatenate(ways)
    assert all(np.abs(seen - one).min() <= 5e-5 * one for one in expected)


ROD = """hfsim: 1
name: rotor_blade
gravity: [0.0, 0.0, 0.0]
materials: {steel: {density: 7800.0, youngs_modulus: "210 GPa"}}
sections: {rod: {shape: circle, diameter: "1 cm"}}
bodies: {blade: {type: beam, element: cable, material: steel, section: rod, length: 1.0, elements: 4}}
joints:
  hinge: {type: revolute, between: [ground, blade.root]}
  motor: {type: driver, between: [ground, blade.root], angle: {type: constant_rate, rate: 20.0}}
initial: {blade: {angular_velocity: [0.0, 0.0, 20.0]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("rate", [1e-4, 0.01, 0.1])
def test_a_slow_turn_of_a_stiff_rod_is_steady(rate):
    """Beside its stiffness the accelerations are rounding."""
    turn = {"initial.blade.angular_velocity": [0.0, 0.0, rate], "joints.motor.angle.rate": rate}
    assert hfsim.modes(parse_deck(ROD), turn, about="steady", count=1).facts()["about"]["steady"]


def test_a_rod_that_turns_without_tension_is_in_no_equilibrium():
    """It is 1e-6 of its length shorter than it would be, but lags 3 % slower."""
    turn = {"initial.blade.angular_velocity": [0.0, 0.0, 10.0], "joints.motor.angle.rate": 10.0}
    rod = parse_deck(ROD)
    start, steady = (hfsim.modes(rod, turn, about=state, count=1) for state in ("start", "steady"))
    assert start.frequencies[0] < 0.98 * steady.frequencies[0]
    assert not start.about.lasting and steady.about.lasting


@pytest.mark.parametrize("rate", [1e-4, 1e-2, 0.1])
def test_what_falls_while_it_turns_slowly_is_not_taken_apart(rate):
    """Turns at 1e5 rad/s, one against the other, would have the acceleration of its fall."""
    found = hfsim.modes("cases/heavy_top.yaml", {"initial.top.angular_velocity": [0.0, 0.0, rate]}, count=1)
    assert found.about.turning.spin == pytest.approx([0.0, 0.0, rate]) and not found.about.lasting


BLADES = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {m: {density: 1000.0, youngs_modulus: 1.0e9}}
sections: {s: {shape: rectangle, width: 0.05, height: 0.01}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.1}
  front: {type: beam, material: m, section: s, length: 1.0, elements: 2}
  back: {type: beam, material: m, section: s, length: 1.0, elements: 2}
joints:
  axle: {type: revolute, between: [ground, hub]}
  drive: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 2.0}}
  one: {type: fixed, between: [hub, front.root]}
  other: {type: fixed, between: [hub, back.root], angle: 180 deg}
initial: {hub: {angular_velocity: 2.0}}
solve: {duration: 1.0}
"""


def test_equal_blades_are_one_curve_of_the_campbell_diagram():
    from hfsim.output.plots.campbell import _together

    assert _together(hfsim.campbell(parse_deck(BLADES), [2.0, 4.0], count=4)) == [[1, 2], [3, 4]]
    light = parse_deck(BLADES.replace("1.0, elements: 2}\njoints", "1.1, elements: 2}\njoints"))
    assert _together(hfsim.campbell(light, [2.0, 4.0], count=4)) == [[1], [2], [3], [4]]


def test_equal_blades_are_located_once(monkeypatch):
    """Each was located by itself, to the same number, which took twice as long."""
    from hfsim.maths import eigenpairs

    solved, own = [], eigenpairs.squares_of
    monkeypatch.setattr(
        eigenpairs, "squares_of", lambda pencil, count: solved.append(count) or own(pencil, count)
    )
    counts = []
    for length in ("1.0", "1.0001"):
        deck = BLADES.replace("1.0, elements: 2}\njoints", f"{length}, elements: 2}}\njoints")
        found = hfsim.campbell(parse_deck(deck), [2.0, 60.0], count=2)
        first, second = ([one.rate for one in found.crossings if one.track == k] for k in (1, 2))
        assert len(first) == 3 and first == pytest.approx(second, rel=1e-3)
        counts.append(len(solved))
    assert counts[0] < 0.4 * counts[1]  # of both



BOB = """hfsim: 1
gravity: [0, 0]
ground: {points: {p: [0.003, 0.004]}}
bodies: {bob: {type: rigid, mass: 2.0, inertia: 0.3}}
springs: {s: {type: two_point, between: [ground.p, bob], stiffness: 1.0e8, damping: DAMPING REST}}
initial: {bob: {position: [0, 0]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("damping", [0.0, 100.0])
def test_a_short_stiff_spring_holds_nothing_across_it(damping):
    """Without tension; a divergence by exp(26 t) was told, of differences with a step of 1e-7 m."""
    found = hfsim.modes(parse_deck(BOB.replace("DAMPING", str(damping)).replace("REST", "")))
    assert [mode.kind for mode in found] == ["rigid", "rigid", "vibration"]
    assert abs(found[3].value) == pytest.approx(np.sqrt(1.0e8 / 2.0), rel=1e-12)
    assert found[3].growth == pytest.approx(-damping / 4.0, rel=1e-9)


def test_a_spring_without_length_holds_every_way():
    text = BOB.replace("DAMPING REST", "0.0, rest_length: 0").replace("[0.003, 0.004]", "[0, 0]")
    assert circular(hfsim.modes(parse_deck(text))) == pytest.approx([np.sqrt(1.0e8 / 2.0)] * 2, rel=1e-12)


def test_motions_that_nothing_brings_back_are_told_where_their_vectors_are_nearly_alike():
    """Any vectors belong to one eigenvalue; of three, two came 1e-5 apart, and one motion was missing."""
    from hfsim.maths.eigenpairs import _standing

    gyroscopic = np.zeros((4, 4))
    gyroscopic[2, 3], gyroscopic[3, 2] = 1e-3, -1e-3
    pencil = Pencil(np.eye(4), gyroscopic, np.diag([0.0, 0.0, 0.0, 5.0]), np.zeros((0, 4)))
    first, second, third, _ = np.eye(4)
    vectors = np.array([first, first, second, second, second + 1e-5 * third, second + 1e-5 * third])
    for motions in (np.eye(4)[:, :3], np.zeros((4, 0))):
        still, doubled = _standing(pencil, vectors.T.astype(complex), motions.astype(complex))
        assert still.shape[1] == max(2, motions.shape[1]) == doubled.sum()


COASTING = """hfsim: 1
gravity: [0, 0]
bodies:
  a: {type: rigid, mass: 1.0, inertia: 0.3}
  b: {type: rigid, mass: 1.0, inertia: 0.7}
  c: {type: rigid, mass: 1.0, inertia: 0.2}
joints:
  ja: {type: revolute, between: [ground, a]}
  jb: {type: revolute, between: [ground, b], damping: 0.5}
  jc: {type: revolute, between: [a, c], damping: 0.1}
solve: {duration: 1}
"""


def test_what_goes_on_is_told_apart_from_what_dampers_end():
    found = hfsim.modes(parse_deck(COASTING))
    assert [mode.kind for mode in found] == ["rigid", "drift", "drift", "decay", "decay"]
    # a and c turn on at one rate, whatever the drag between them
    assert found[1].shares == pytest.approx({"a": 0.6, "b": 0.0, "c": 0.4}, abs=1e-9)
    assert found[4].growth == pytest.approx(-0.5 / 0.7, rel=1e-9)
    assert found[5].growth == pytest.approx(-0.1 * (1 / 0.3 + 1 / 0.2), rel=1e-9)


OBLIQUE = """hfsim: 1
gravity: [{gravity}]
materials: {{steel: {{density: 7800, youngs_modulus: 2.0e11}}}}
sections: {{bar: {{shape: circle, radius: 0.015}}}}
bodies: {{b: {{type: beam, element: cable, material: steel, section: bar, length: 1.0, elements: 16}}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
initial: {{b: {{angle: -0.8707963267948966}}}}
solve: {{model: {model}, duration: 1.0}}
"""


@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact"])
@pytest.mark.parametrize("more", [[], [0.0]])
def test_a_stiff_pendulum_off_the_axes_swings_as_a_rigid_one(model, more):
    """w^2 = 3 g / 2 L: differences of first order make a stiffness of their own of what is stiff."""
    gravity = ", ".join(map(str, [9.81 * np.sin(0.7), -9.81 * np.cos(0.7), *more]))
    deck = parse_deck(OBLIQUE.format(gravity=gravity, model=model))
    found = hfsim.modes(deck, about="equilibrium", count=1)
    assert 2.0 * np.pi * found.frequencies[0] == pytest.approx(np.sqrt(1.5 * 9.81), rel=1e-4)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_equal_motions_that_are_critically_damped_all_come_back(count):
    """Each has l = -w twice, with one shape: by rounding a pair, or two that nothing seems to bring back."""
    one = np.eye(count)
    found = eigenpairs(Pencil(one, 2.0 * 3.7 * one, 3.7**2 * one, np.zeros((0, count))), 9)
    assert len(found.values) == 2 * count
    assert found.values == pytest.approx(np.full(2 * count, -3.7), abs=1e-6)
    assert not found.doubled.any() and (found.uncertainty < 1e-6).all()


STEM = """hfsim: 1
gravity: [0, 0, -9.81]
bodies:
  disc: {{type: rigid, mass: {mass}, inertia: [{half}, {half}, {whole}], points: {{top: [0, 0, {stem}]}}}}
joints: {{ball: {{type: spherical, between: [ground, disc.top]}}}}
solve: {{duration: 0.1}}
"""


@pytest.mark.parametrize("size", [1e-5, 1e-3, 1.0, 1e3])
def test_flat_bodies_of_any_size_swing(size):
    """Only the normal is stiff, which has no mass: its stiffness over masses elsewhere goes with the unit."""
    whole = 0.3 * size**5
    own = {"mass": 15.0 * size**3, "half": 0.5 * whole, "whole": whole, "stem": size}
    found = hfsim.modes(parse_deck(STEM.format(**own)))
    assert [mode.kind for mode in found] == ["rigid", "vibration", "vibration"]
    assert circular(found) == pytest.approx([np.sqrt(15.0 * 9.81 / 15.15 / size)] * 2, rel=1e-9)


PLATE = """hfsim: 1
bodies: {plate: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, 2.0]}}
initial: {plate: {angular_velocity: [30.0, 0.0, 40.0]}}
solve: {duration: 1.0}
"""


def test_motions_of_one_frequency_are_not_corrected_by_each_other():
    """A free plate turns about its axis and drifts at the rate of the axes that it is seen from."""
    found = hfsim.modes(parse_deck(PLATE))
    told = np.array([mode.uncertainty for mode in found])
    rate = np.hypot(30.0, 80.0)
    assert not found.unstable and np.all(told < 1e-5 * rate)
    values = np.array([mode.value for mode in found])
    assert np.all(np.abs(values - 1j * np.array([0, 0, 0, rate, rate, rate])) <= told)


@pytest.mark.parametrize("off", [1e-7, 3e-4, 3e-3])
def test_what_a_search_far_away_tells_roughly_is_improved_until_it_stands(off):
    """What is a million times as fast as the shift keeps few digits, and was told to grow."""
    rng = np.random.default_rng(3)
    mixed = rng.standard_normal((6, 6)) + 4.0 * np.eye(6)
    rates, ratios = np.array([1.0, 3.0, 1e5, 2.9e6, 3.1e6, 3.4e6]), 1e-4
    M, V, K = (mixed.T @ np.diag(one) @ mixed for one in (np.ones(6), 2.0 * ratios * rates, rates**2))
    exact = rates[4] * (-ratios + 1j * np.sqrt(1.0 - ratios**2))
    rough = np.linalg.inv(mixed)[:, 4] + off * rng.standard_normal(6)
    value, error = _corrected(Pencil(M, V, K, np.zeros((0, 6))), exact * (1.0 + off * (1.0 - 0.3j)), rough)
    assert abs(value - exact) <= error < 1e-8 * abs(exact)


SLIDE = """hfsim: 1
gravity: [0, 0, -9.81]
bodies:
  base: {type: rigid, mass: 1, inertia: [0.1, 0.1, 0.1], points: {p: [0.2, 0.3, 0.1]}}
  sl: {type: rigid, mass: 2, inertia: [0.1, 0.2, 0.3], points: {q: [0.1, -0.1, 0.05]}}
joints:
  f: {type: fixed, between: [ground, base], orientation: {axis: [1, 1, 1], angle: 120 deg}}
  p: {type: prismatic, between: [base.p, sl.q], orientation: {rotation_vector: [0, 0.5, 0]}, damping: 1.5}
  d: {type: servo, between: [base.p, sl.q], position: 0.0, stiffness: 400, damping: 10}
solve: {duration: 1}
"""


def test_one_slide_among_joints_that_hold_all_else_swings_as_by_itself():
    """Next to its eigenvalue hardly anything is left on the diagonal of what is solved there."""
    (found,) = hfsim.modes(parse_deck(SLIDE), about="equilibrium").modes
    assert found.value == pytest.approx(-2.875 + 1j * np.sqrt(200.0 - 2.875**2), rel=1e-12)


@pytest.mark.filterwarnings("error")
def test_what_has_no_extent_is_drawn(tmp_path):
    deck = tmp_path / "wheel.yaml"
    body = "{type: rigid, mass: 1, inertia: 1}"
    deck.write_text(
        f"hfsim: 1\nname: wheel\nbodies: {{a: {body}}}\n"
        "joints: {r: {type: revolute, between: [ground, a]}}\nsolve: {duration: 0.1}\n"
    )
    done = CliRunner().invoke(app, ["modes", str(deck), "-o", str(tmp_path / "out")])
    assert done.exit_code == 0 and (tmp_path / "out" / "plots" / "modes.png").exists(), done.output


BRAKED = """
hfsim: 1
bodies: {wheel: {type: rigid, mass: 1.0, inertia: 2.0}}
joints: {axle: {type: revolute, between: [ground, wheel], friction: {torque: 20.0, velocity: 0.01}}}
initial: {wheel: {angular_velocity: 0.1}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize(("at", "turns"), [(0.01, True), (0.2, False)])
def test_axes_do_not_turn_with_what_friction_has_stopped_but_for_errors(at, turns):
    """Slower than 0.01 rad/s it fades with 1000 1/s: after 0.2 s errors of steps are left."""
    assert (about(parse_deck(BRAKED), at=at).turning is not None) == turns


STUCK = """hfsim: 1
bodies:
  arm: {type: rigid, mass: 5, inertia: 2.0}
  slide: {type: rigid, mass: 1, inertia: 1.0}
joints:
  q: {type: revolute, between: [ground, arm], friction: {torque: 5, velocity: 0.001}}
  s: {type: servo, between: [ground, arm], angle: 0.0, stiffness: 2000, damping: 20}
  p: {type: prismatic, between: [ground, slide], axis: [1, 0], friction: {force: 1.0e-3, velocity: 1.0}}
springs: {k: {type: two_point, between: [ground.far, slide], stiffness: 100, rest_length: 1.0}}
ground: {points: {far: [-1, 0]}}
initial: {arm: {angular_velocity: RATE}}
solve: {duration: 1}
"""


@pytest.mark.parametrize(("rate", "sticks"), [(0.0, True), (0.1, False)])
def test_friction_that_sticks_is_warned_of(rate, sticks):
    """Its level over its velocity is a damper, of 2500 1/s here; one that is small is not worth a word."""
    found = hfsim.modes(parse_deck(STUCK.replace("RATE", str(rate))), count=4)
    expected = {"joints.q.friction": pytest.approx(5000.0)} if sticks else {}
    assert found.facts()["sticking"] == expected
    told = [one for one in state_warnings(found) if "sticks" in one]
    assert len(told) == sticks and all("damper of 5000 N m s/rad" in one for one in told)
    if sticks:
        assert min(mode.growth for mode in found) == pytest.approx(np.roots([2.0, 5020.0, 2000.0]).min())


STUCK_TUBE = """hfsim: 1
gravity: [0, 0, -9.81]
bodies: {b: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {up: [0, 0, 0.5]}}}
joints: {tube: {type: cylindrical, between: [ground, b.up], axis: [1, 0, 0]}}
springs: {s: {type: two_point, between: [ground.far, b.up], stiffness: 10, rest_length: 1}}
ground: {points: {far: [-1, 0, 0]}}
solve: {duration: 1}
"""


@pytest.mark.parametrize(("key", "effort"), [("turning", "torque"), ("sliding", "force")])
def test_friction_that_sticks_is_named_by_its_place_in_a_cylindrical_joint(key, effort):
    friction = f"joints.tube.{key}.friction={{{effort}: 0.5, velocity: 0.1}}"
    found = hfsim.modes(parse_deck(STUCK_TUBE, overrides=[friction]))
    assert found.facts()["sticking"] == {f"joints.tube.{key}.friction": pytest.approx(5.0)}


@pytest.mark.parametrize("damping", [2e-5, 1e-4, 5e-4, 1e-3])
def test_shapes_of_a_damped_arm_are_such_as_its_joints_allow(damping):
    """Rounding in what they forbid was scaled up until the turret, which is driven, was all that moved."""
    overrides = [f"materials.aluminium.bending_damping={damping}"]
    found = hfsim.modes(parse_deck(starters()["slewing_arm"], overrides=overrides), about="equilibrium")
    motions = found.about.motions
    J, basis = motions.jacobian, motions.basis
    z = np.array([np.linalg.lstsq(basis, mode.change)[0] for mode in found.modes]).T
    assert np.abs(J @ z).max() < 1e-9 * np.abs(z).max(axis=0).min()
    for mode, own in zip(found.modes, z.T, strict=True):
        force = (motions.stiffness + mode.value * motions.velocity + mode.value**2 * motions.mass) @ own
        held = J.T @ np.linalg.lstsq(J.T, force)[0]
        assert np.abs(force - held).max() < 1e-6 * np.abs(motions.stiffness @ own).max()
        assert mode.shares.get("turret", 0.0) < 1e-3


def test_motions_that_are_free_do_not_blur_the_others(monkeypatch):
    """A chain of hinged beams that nothing holds: Lanczos' iteration and dense matrices find the same."""
    beam = {"type": "beam", "material": "stuff", "section": "bar", "length": 1.0, "elements": 2}
    hinge = {"type": "revolute"}
    deck = {
        "hfsim": 1,
        "gravity": [0.0, 0.0],
        "materials": {"stuff": {"density": 1000.0, "youngs_modulus": 1e8}},
        "sections": {"bar": {"shape": "circle", "diameter": 0.02}},
        "bodies": {f"b{k}": beam for k in range(48)},
        "joints": {f"j{k}": {**hinge, "between": [f"b{k}.tip", f"b{k + 1}.root"]} for k in range(47)},
        "solve": {"duration": 1.0},
    }
    few = hfsim.modes(deck, count=60).modes
    monkeypatch.setattr(pencils, "SMALL", 1000)
    every = hfsim.modes(deck, count=60).modes
    assert len(few) == len(every) and [one.value == 0.0 for one in few].count(True) == 50
    assert all(abs(a.value - b.value) <= 0.1 * b.uncertainty for a, b in zip(few, every, strict=True))
