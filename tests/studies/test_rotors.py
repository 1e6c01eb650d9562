"""Rotors on bearings: modes against matrices put together here, and bearings not alike all around."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import hfsim
from hfsim.mechanics.nearest_rates import without_noise
from hfsim.mechanics.turning import Turning
from hfsim.output.modes import campbell_text, state_warnings
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.studies.modes.about import about, turning_about
from hfsim.studies.modes.following import Followed, Steady

ROTOR = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {pxa: [1, 0, 0.3], pya: [0, 1, 0.3], pxb: [1, 0, -0.5], pyb: [0, 1, -0.5], pz: [0, 0, 1.3]}}
bodies:
  rotor: {type: rigid, mass: 10, inertia: [0.1, 0.1, 0.18], points: {a: [0, 0, 0.3], b: [0, 0, -0.5]}}
  ring_a: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.02]}
  ring_b: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.02]}
joints:
  a: {type: revolute, between: [rotor.a, ring_a]}
  b: {type: revolute, between: [rotor.b, ring_b]}
springs:
  xa: {type: two_point, between: [ground.pxa, ring_a], stiffness: 1.0e5}
  ya: {type: two_point, between: [ground.pya, ring_a], stiffness: ACROSS}
  xb: {type: two_point, between: [ground.pxb, ring_b], stiffness: 1.0e5}
  yb: {type: two_point, between: [ground.pyb, ring_b], stiffness: ACROSS}
  z: {type: two_point, between: [ground.pz, ring_a], stiffness: 1.0e7}
initial:
  rotor: {position: [0, 0, 0], angular_velocity: [0, 0, 10]}
  ring_a: {position: [0, 0, 0.3], angular_velocity: [0, 0, 0]}
  ring_b: {position: [0, 0, -0.5], angular_velocity: [0, 0, 0]}
solve: {duration: 1.0}
"""


def whirls(across, rate):
    """Frequencies [Hz] of a stiff rotor whose bearing rings do not turn, from slow to fast."""
    mass, stiffness = np.diag([10.0, 10.0, 0.1, 0.1]), np.zeros((4, 4))
    for place in (0.3, -0.5):  # shifts x and y and tilts about x and y make displacements of a ring
        x, y = np.array([1.0, 0.0, 0.0, place]), np.array([0.0, 1.0, -place, 0.0])
        mass += np.outer(x, x) + np.outer(y, y) + np.diag([0.0, 0.0, 0.01, 0.01])
        stiffness += 1.0e5 * np.outer(x, x) + across * np.outer(y, y)
    gyroscopic = np.zeros((4, 4))
    gyroscopic[2, 3], gyroscopic[3, 2] = 0.18 * rate, -0.18 * rate
    parts = [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, gyroscopic)]
    values = np.linalg.eigvals(np.block([[np.zeros((4, 4)), np.eye(4)], parts]))
    return np.sort(values.imag[values.imag > 0.0]) / (2.0 * np.pi)


@pytest.mark.parametrize("across", [1.0e5, pytest.param(2.0e4, marks=pytest.mark.slow)])
def test_rotors_in_rings_that_do_not_turn_whirl_as_their_matrices_say(across):
    rates = [10.0, 100.0, 400.0]
    found = hfsim.campbell(parse_deck(ROTOR.replace("ACROSS", str(across))), rates, count=7)
    for rate, modes in zip(rates, found.founds, strict=True):
        seen = [mode.frequency for mode in modes if mode.kind == "vibration" and mode.frequency < 100.0]
        assert np.sort(seen) == pytest.approx(whirls(across, rate), rel=1e-9)
    assert not found.facts()["unsteady_rates"]
    assert "seen from axes at rest" in campbell_text(found, "")


SHAFT = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {ya: [0, 1, 0], za: [0, 0, 1], yb: [1, 1, 0], zb: [1, 0, 1], x: [-1, 0, 0]}}
sections:
  round:
    mass_per_length: 1.0
    rotary_inertia: [2.0e-3, 1.0e-3, 1.0e-3]
    axial_stiffness: 1.0e6
    shear_stiffness: [1.0e7, 1.0e7]
    torsion_stiffness: 1.0e3
    bending_stiffness: [1.0, 1.0]
bodies:
  shaft: {type: beam, section: round, length: 1.0, elements: 4, degree: 4, points: {mid: [0.5, 0, 0]}}
  disc: {type: rigid, mass: 2.0, inertia: [0.1, 0.05, 0.05]}
  ring_a: {type: rigid, mass: 0.1, inertia: [2.0e-4, 1.0e-4, 1.0e-4]}
  ring_b: {type: rigid, mass: 0.1, inertia: [2.0e-4, 1.0e-4, 1.0e-4]}
joints:
  a: {type: revolute, between: [shaft.root, ring_a], axis: [1, 0, 0]}
  b: {type: revolute, between: [shaft.tip, ring_b], axis: [1, 0, 0]}
  weld: {type: fixed, between: [shaft.mid, disc]}
springs:
  ya: {type: two_point, between: [ground.ya, ring_a], stiffness: 50.0}
  za: {type: two_point, between: [ground.za, ring_a], stiffness: 20.0}
  yb: {type: two_point, between: [ground.yb, ring_b], stiffness: 50.0}
  zb: {type: two_point, between: [ground.zb, ring_b], stiffness: 20.0}
  x: {type: two_point, between: [ground.x, ring_a], stiffness: 1.0e6}
initial:
  shaft: {angular_velocity: [5.0, 0, 0]}
  disc: {angular_velocity: [5.0, 0, 0]}
  ring_a: {position: [0, 0, 0], angular_velocity: [0, 0, 0]}
  ring_b: {position: [1, 0, 0], angular_velocity: [0, 0, 0]}
solve: {duration: 1.0}
"""


def whirls_of_a_shaft(rate, count, elements=8):
    """Frequencies [Hz] of the same by cubic elements of Euler and Rayleigh: y and slope of nodes, then z."""
    h, n = 1.0 / elements, 2 * (elements + 1)
    shapes = [
        np.poly1d(one)
        for one in ([2.0, -3.0, 0.0, 1.0], [h, -2 * h, h, 0.0], [-2.0, 3.0, 0.0, 0.0], [h, -h, 0.0, 0.0])
    ]

    def integrals(order):
        own = [one.deriv(order) if order else one for one in shapes]
        return np.array([[(a * b).integ()(1.0) for a in own] for b in own]) * h ** (1 - 2 * order)

    mass, tilting, bending = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    for k in range(elements):
        part = np.ix_(range(2 * k, 2 * k + 4), range(2 * k, 2 * k + 4))
        mass[part] += integrals(0)
        tilting[part] += 1.0e-3 * integrals(1)
        bending[part] += integrals(2)
    spun = 2.0 * tilting
    ring = 0.1, 1e-4, 0.0
    for place, (weight, inertia, polar) in ((0, ring), (elements // 2, (2.0, 0.05, 0.1)), (elements, ring)):
        mass[2 * place, 2 * place] += weight
        tilting[2 * place + 1, 2 * place + 1] += inertia
        spun[2 * place + 1, 2 * place + 1] += polar
    held = []
    for stiffness in (50.0, 20.0):
        own = bending.copy()
        own[0, 0] += stiffness
        own[-2, -2] += stiffness
        held.append(own)
    none = np.zeros((n, n))
    M, K = np.kron(np.eye(2), mass + tilting), np.block([[held[0], none], [none, held[1]]])
    G = rate * np.block([[none, spun], [-spun, none]])
    parts = [-np.linalg.solve(M, K), -np.linalg.solve(M, G)]
    values = np.linalg.eigvals(np.block([[np.zeros((2 * n, 2 * n)), np.eye(2 * n)], parts]))
    return np.sort(values.imag[values.imag > 0.0])[:count] / (2.0 * np.pi)


@pytest.mark.slow
def test_round_shafts_on_bearings_not_alike_all_around_are_seen_from_axes_at_rest():
    rates = [5.0, 20.0]
    found = hfsim.campbell(parse_deck(SHAFT), rates, count=10)
    assert not found.facts()["unsteady_rates"] and "seen from axes at rest" in campbell_text(found, "")
    for rate, modes in zip(rates, found.founds, strict=True):
        assert modes.about.turning.own == pytest.approx({"shaft": rate, "disc": rate})
        seen = [mode.frequency for mode in modes if mode.kind == "vibration"][:6]
        assert seen == pytest.approx(whirls_of_a_shaft(rate, 6), rel=1e-4)


PLATE = """hfsim: 1
gravity: [0, 0]
ground: {points: {px: [1, 0], py: [0, 1]}}
bodies: {plate: {type: rigid, mass: 2.0, inertia: 0.3}}
springs:
  x: {type: two_point, between: [ground.px, plate], stiffness: 800.0, damping: 3.0}
  y: {type: two_point, between: [ground.py, plate], stiffness: 800.0, damping: 3.0}
initial: {plate: {position: [0, 0], angular_velocity: 5.0}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("", ""),
        ("py, plate], stiffness: 800.0", "py, plate], stiffness: 799.0"),
        ("py, plate], stiffness: 800.0, damping: 3.0", "py, plate], stiffness: 800.0, damping: 3.1"),
    ],
    ids=["even", "stiffness", "damping"],
)
def test_bearings_that_are_not_alike_all_around_are_told(old, new):
    """The coefficients in axes that turn change with time: there are no frequencies there."""
    found = hfsim.modes(parse_deck(PLATE.replace(old, new)))
    assert found.about.lasting and found.about.axes_turn
    assert found.uneven is bool(new) and found.facts()["about"]["steady"] is not bool(new)
    assert any("not alike all around" in " ".join(one.split()) for one in state_warnings(found)) is bool(new)
    if not new:
        # in axes at rest both are 2 s^2 + 3 s + 800
        s = -0.75 + 1j * np.sqrt(400.0 - 0.75**2)
        seen = [mode.value for mode in found if mode.kind == "vibration"]
        assert np.sort(np.imag(seen)) == pytest.approx(np.imag([s - 5j, s + 5j]), rel=1e-9)
        assert np.real(seen) == pytest.approx(-0.75, rel=1e-9)


def test_rates_without_a_steady_rotation_have_neither_frequencies_nor_crossings():
    """Frozen stiffness in axes that turn made rows, curves and an excitation once a revolution of them."""
    text = PLATE.replace("py, plate], stiffness: 800.0", "py, plate], stiffness: 700.0")
    found = hfsim.campbell(parse_deck(text), [0.0, 5.0, 12.0], count=3)
    assert not found.crossings and found.unsteady == [5.0, 12.0] == found.facts()["unsteady_rates"]
    assert {row["rate"] for row in found.rows()} == {0.0} and np.isnan(found.frequencies(2)[1:]).all()
    assert "no steady rotation at 5, 12 rad/s: neither frequencies" in campbell_text(found, "")


def test_shifts_and_tilts_of_everything_cross_nothing():
    """Seen from axes that turn they go round at the rate: once a revolution, at every rate."""
    text = """hfsim: 1
gravity: [0, 0, 0]
materials: {carbon: {density: 1600, youngs_modulus: 70 GPa, poisson_ratio: 0.3}}
sections: {flat: {shape: rectangle, width: 0.6, height: 0.004}}
bodies:
  bus: {type: rigid, mass: 120, inertia: [12, 13, 15], points: {r: [0.5, 0, 0]}}
  panel: {type: beam, material: carbon, section: flat, length: 1.0, elements: 2}
joints: {clamp: {type: fixed, between: [bus.r, panel.root]}}
initial: {steady: {body: bus, rate: 1}, bus: {angle: 0, position: [0, 0, 0]}}
solve: {duration: 1}
"""
    found = hfsim.campbell(parse_deck(text), [0.02, 0.2, 1.0], count=8)
    assert [track[0].kind for track in found.tracks].count("rigid") >= 3
    assert not found.crossings


TOWER = """hfsim: 1
gravity: [0, 0, -9.81]
materials: {steel: {density: 7850, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}
sections: {wall: {shape: tube, outer_radius: 1.5, inner_radius: 1.48}}
bodies:
  tower: {type: beam, material: steel, section: wall, length: 50, elements: 2}
  nacelle: {type: rigid, mass: 40000, inertia: [1.0e5, 2.0e5, 2.0e5]}
  rotor: HUB
BLADES
joints:
  foot: {type: fixed, between: [ground, tower.root], orientation: {x: [0, 0, 1], y: [0, 1, 0]}}
  top: {type: fixed, between: [tower.tip, nacelle], orientation: {x: [0, 0, -1], y: [0, 1, 0]}}
  axle: {type: revolute, between: [nacelle, rotor], axis: [1, 0, 0]}
WELDS
initial: {rotor: {angular_velocity: [2.0, 0, 0]}}
solve: {duration: 1}
"""
WELD = "  w{0}: {{type: fixed, between: [rotor.p{0}, k{0}], orientation: {{rotation_vector: [{1}, 0, 0]}}}}"


def tower(count, blade=(1.0e5, 1.0e5, 1.0e5)):
    """A rotor with so many blades of 8000 kg, 10 m from the axis, welded to its hub; one body without."""
    if not count:
        around, along = 4.0e3 + 3 * (8000 * 100 + 1.0e5), 2.0e3 + 3 * (8000 * 50 + 1.0e5)
        hub = f"{{type: rigid, mass: 30000, inertia: [{around}, {along}, {along}]}}"
        return TOWER.replace("HUB", hub).replace("BLADES", "").replace("WELDS", "")
    turns = [2.0 * np.pi * k / count for k in range(count)]
    points = ", ".join(f"p{k}: [0, {10 * np.sin(t)}, {10 * np.cos(t)}]" for k, t in enumerate(turns))
    hub = f"{{type: rigid, mass: 6000, inertia: [4.0e3, 2.0e3, 2.0e3], points: {{{points}}}}}"
    blades = [f"  k{k}: {{type: rigid, mass: 8000, inertia: {list(blade)}}}" for k in range(count)]
    welds = [WELD.format(k, -turn) for k, turn in enumerate(turns)]
    text = TOWER.replace("HUB", hub).replace("BLADES", "\n".join(blades))
    return text.replace("WELDS", "\n".join(welds))


@pytest.mark.parametrize("body", [pytest.param(None, marks=pytest.mark.slow), "rotor"])
def test_three_blades_welded_to_a_hub_are_as_round_as_one_body(body):
    expected = hfsim.campbell(parse_deck(tower(0)), [0.0, 1.5, 3.0], count=5, body=body)
    found = hfsim.campbell(parse_deck(tower(3)), [0.0, 1.5, 3.0], count=5, body=body)
    assert not found.unsteady and not expected.unsteady and "at rest" in campbell_text(found, "")
    assert set(found.founds[1].about.turning.own) == {"rotor", "k0", "k1", "k2"}
    # their weights are in balance but for rounding of what the welds carry
    assert [modes[1].kind for modes in found.founds] == ["rigid"] * 3
    for number in range(2, 6):
        assert found.frequencies(number) == pytest.approx(expected.frequencies(number), rel=1e-8)
    # the tower bends to the side by itself: nothing that turns with the rotor is in it
    assert np.ptp(found.frequencies(3)) < 1e-6 * found.frequencies(3)[0]


def test_plates_as_blades_are_round_together_and_two_blades_are_not():
    plates = parse_deck(tower(3, blade=(2.0e5, 1.5e5, 0.5e5)))
    assert hfsim.modes(plates, about="steady", count=3).steady
    two = hfsim.campbell(parse_deck(tower(2)), [0.0, 1.5], count=5, body="rotor")
    assert two.unsteady == [1.5]


def test_bodies_that_turn_differently_are_told_as_such():
    """It was said that nothing turns, and that a rate be given which was there."""
    two = parse_deck(tower(2))
    for study in (lambda: hfsim.modes(two, about="steady"), lambda: hfsim.campbell(two, [0.0, 1.0])):
        with pytest.raises(hfsim.HfsimError, match=r"turn differently at the start.*--spin-body"):
            study()
    at_rest = parse_deck(tower(2).replace("[2.0, 0, 0]", "[0, 0, 0]"))
    with pytest.raises(hfsim.HfsimError, match="nothing turns at the start: give bodies rates"):
        hfsim.modes(at_rest, about="steady")
    with pytest.raises(hfsim.HfsimError, match="not everything can turn with it: joints hold tower"):
        hfsim.campbell(at_rest, [0.0, 1.0], body="rotor")


GUIDED = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {there: [1, 0, 0]}}
materials: {steel: {density: 7800, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}
sections: {flat: {shape: rectangle, width: 0.018, height: 0.016}}
bodies:
  shaft: {type: beam, material: steel, section: flat, length: 1.0, elements: 2}
  ring: {type: rigid, mass: 0.2, inertia: [2.0e-4, 1.0e-4, 1.0e-4]}
joints:
  left: {type: spherical, between: [ground, shaft.root]}
  right: {type: spherical, between: [shaft.tip, ring]}
  guide: {type: prismatic, between: [ground.there, ring], axis: [1, 0, 0]}
initial: {shaft: {angular_velocity: [10, 0, 0]}, ring: {angular_velocity: [0, 0, 0]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("across", [False, True])
def test_guides_across_a_shaft_that_turns_are_told(across):
    """A joint along the axis holds the same at every angle; one across it lets go of another direction."""
    axis = "axis: [0, 1, 0]}" if across else "axis: [1, 0, 0]}"
    found = hfsim.modes(parse_deck(GUIDED.replace("axis: [1, 0, 0]}", axis)), count=5)
    assert found.about.axes_turn and found.about.lasting
    assert found.about.unevenness == 0.0 and found.uneven is across


DRAGGED = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {there: [1, 0, 0], y: [0, 0.1, 0], my: [0, -0.1, 0], z: [0, 0, 0.1], mz: [0, 0, -0.1]}}
materials: {steel: {density: 7800, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}
sections: {flat: {shape: rectangle, width: 0.018, height: 0.016}}
bodies:
  shaft: {type: beam, material: steel, section: flat, length: 1.0, elements: 2}
  ring:
    type: rigid
    mass: 0.2
    inertia: [2.0e-4, 1.0e-4, 1.0e-4]
    points: {y: [0, 0.05, 0], my: [0, -0.05, 0], z: [0, 0, 0.05], mz: [0, 0, -0.05]}
joints:
  bearing: {type: revolute, between: [shaft.root, ring], axis: [1, 0, 0], damping: 0.01}
  far: {type: spherical, between: [ground.there, shaft.tip]}
springs:
  y: {type: two_point, between: [ground.y, ring.y], stiffness: 5.0e5, preload: 100}
  my: {type: two_point, between: [ground.my, ring.my], stiffness: 5.0e5, preload: 100}
  z: {type: two_point, between: [ground.z, ring.z], stiffness: 5.0e5, preload: 100}
  mz: {type: two_point, between: [ground.mz, ring.mz], stiffness: 5.0e5, preload: 100}
initial: {shaft: {angular_velocity: [10, 0, 0]}, ring: {position: [0, 0, 0], angular_velocity: [0, 0, 0]}}
solve: {duration: 1.0}
"""
DRIVE = "  led: {type: driver, between: [ground, shaft.root], axis: [1, 0, 0], angle: {expression: 10 * t}}\n"


def test_a_ring_that_a_shaft_drags_along_leans_on_its_springs():
    """Its rate tells that it does not turn, though the drag accelerates it at the start.

    It was taken to turn with the shaft, nearly, at a rate of neither.
    """
    text = DRAGGED.replace("springs:\n", DRIVE + "springs:\n")
    for state in ("start", "steady"):
        found = hfsim.modes(parse_deck(text), about=state, count=6)
        assert found.about.turning.spin == pytest.approx([10.0, 0.0, 0.0])
        assert found.about.turning.own == pytest.approx({"ring": -10.0})
        assert found.about.lasting is (state == "steady") and not found.uneven
    inner, outer, rest, tension = 0.05, 0.1, 0.05, 100.0

    def held(twist):
        """Moment and stiffness of the four springs."""
        length = np.sqrt(inner**2 + outer**2 - 2.0 * inner * outer * np.cos(twist))
        slope = inner * outer * np.sin(twist) / length
        pull = tension + 5.0e5 * (length - rest)
        bend = inner * outer * np.cos(twist) / length - slope**2 / length
        return 4.0 * pull * slope, 4.0 * (5.0e5 * slope**2 + pull * bend)

    twist = brentq(lambda one: held(one)[0] - 0.01 * 10.0, 0.0, 0.1)
    expected = np.roots([2.0e-4, 0.01, held(twist)[1]])[0]
    (twisting,) = [mode for mode in found if mode.shares["ring"] > 0.99]
    assert twisting.growth == pytest.approx(expected.real, rel=1e-4)
    assert abs(twisting.value) == pytest.approx(abs(expected), rel=1e-4)


@pytest.mark.slow
def test_a_free_ring_that_a_shaft_drags_along_comes_to_turn_with_it():
    text = "\n".join(line for line in DRAGGED.splitlines() if "preload" not in line)
    text = text.replace("springs:\n", "  ball: {type: spherical, between: [ground, ring]}\n")
    found = hfsim.modes(parse_deck(text), about="steady", count=4)
    assert found.about.lasting and not found.about.turning.own
    assert found.about.turning.spin == pytest.approx([10.0, 0.0, 0.0])
    assert found.about.ended == pytest.approx({"ring": -10.0})
    (told,) = state_warnings(found)
    assert "ring at -10 rad/s; what acts on them ends that" in told


def test_a_round_shaft_hangs_in_its_bearings_while_it_turns():
    """Its sections turn, its bent line does not: a steady rotation under weight across the axis."""
    text = SHAFT.replace("[1.0e7, 1.0e7]", "[1.0e5, 1.0e5]").replace("1.0e6", "1.0e4")
    found = hfsim.modes(parse_deck(text.replace("[0, 0, 0]", "[0, 0, -1.0e-3]", 1)), about="steady", count=6)
    assert found.about.lasting and not found.uneven
    assert found.about.turning.own == pytest.approx({"shaft": 5.0, "disc": 5.0})
    x, scene = found.about.motions.x[None], found.about.scene
    ends = [scene.marker(point).position(x)[0, 2] for point in ("shaft.root", "shaft.mid")]
    # 3.2 kg on two springs; the disc bends the shaft by P L^3 / 48 EI, its own weight by 5 q L^4 / 384 EI
    sag, bent = 3.2e-3 / 40.0, 2.0e-3 / 48.0 + 5.0e-3 / 384.0
    assert ends == pytest.approx([-sag, -sag - bent], rel=1e-3)

DISC = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {y: [0.3, 1.0, 0], z: [0.3, 0.0, 1.0]}}
bodies: {disc: {type: rigid, mass: 2, inertia: [0.04, 0.02, 0.02], points: {a: [0.3, 0, 0]}}}
joints: {ball: {type: spherical, between: [ground, disc]}}
springs:
  y: {type: two_point, between: [ground.y, disc.a], stiffness: 1300, rest_length: 1.0}
  z: {type: two_point, between: [ground.z, disc.a], stiffness: 1000, rest_length: 1.0}
initial: {disc: {angular_velocity: [50, 0, 0]}}
solve: {duration: 1}
"""


def whirls_of_a_disc(rate):
    """(1300 a^2 - J w^2) (1000 a^2 - J w^2) = (J_p rate w)^2, in Hz."""
    first, second, polar = 1300.0 * 0.09, 1000.0 * 0.09, 0.04 * rate
    squares = np.roots([0.02**2, -0.02 * (first + second) - polar**2, first * second])
    return np.sqrt(np.sort(squares.real)) / (2.0 * np.pi)


def test_a_disc_alone_on_unlike_bearings_is_seen_from_axes_at_rest():
    rates = [0.0, 25.48522490345157, 50.0]
    found = hfsim.campbell(parse_deck(DISC), rates, count=3)
    assert not found.facts()["unsteady_rates"]
    for k, rate in enumerate(rates):
        seen = [found.frequencies(number)[k] for number in (2, 3)]
        assert seen == pytest.approx(whirls_of_a_disc(rate), rel=1e-7)
    for state in ("start", "steady"):
        modes = hfsim.modes(parse_deck(DISC), about=state, count=3)
        assert modes.about.turning.own == {"disc": pytest.approx(50.0)}
        assert modes.frequencies[1:] == pytest.approx(whirls_of_a_disc(50.0), rel=1e-7)


def test_a_disc_alone_on_like_bearings_is_seen_from_axes_that_turn():
    modes = hfsim.modes(parse_deck(DISC.replace("1300", "1000")), count=3)
    assert modes.about.turning.spin == pytest.approx([50.0, 0.0, 0.0])
    turns = 50.0 / (2.0 * np.pi)
    square, polar = 1000.0 * 0.09 / 0.02, 0.04 * 50.0 / 0.02
    whirls = np.sqrt(square + polar**2 / 4.0) + polar / 2.0 * np.array([-1.0, 1.0])
    seen = np.sort(abs(whirls / (2.0 * np.pi) * [-1, 1] - turns))
    assert modes.frequencies[1:] == pytest.approx(seen, rel=1e-7)


WHIRLING = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {steel: {density: 1.0e-3, youngs_modulus: 210 GPa, poisson_ratio: 0.3, bending_damping: 0.0002, axial_damping: 0.0002}}
sections: {rod: {shape: circle, diameter: 10 mm}}
bodies:
  left: {type: beam, material: steel, section: rod, length: 0.4, elements: 1, degree: 4}
  right: {type: beam, material: steel, section: rod, length: 0.4, elements: 1, degree: 4}
  disc: {type: rigid, mass: 3.0, inertia: [0.02, 0.0101, 0.0101]}
joints:
  b1: {type: revolute, between: [ground, left.root], axis: [1, 0, 0]}
  h1: {type: fixed, between: [left.tip, disc]}
  h2: {type: fixed, between: [disc, right.root]}
  b2: {type: cylindrical, between: [ground, right.tip], axis: [1, 0, 0]}
initial: {steady: {body: left, rate: [100, 0, 0]}}
solve: {duration: 1.0}
"""  # noqa: E501


@pytest.mark.slow
def test_a_shaft_that_its_inner_damping_makes_unstable_is_followed_through_its_critical_speed():
    """Beyond it the backward mode flutters; a clamped shaft of 192 E I / L^3 and 3 kg has 113.5 rad/s."""
    found = hfsim.campbell(parse_deck(WHIRLING), np.arange(0.0, 301.0, 50.0), count=5)
    own = np.sqrt(192.0 * 210e9 * np.pi * 0.005**4 / 4.0 / 0.8**3 / 3.0)
    slow, fast = ([mode.frequency for mode in found.tracks[k]] for k in (1, 2))
    expected = own / (2.0 * np.pi) + np.outer([-1.0, 1.0], found.rates) / (2.0 * np.pi)
    assert np.array(slow) == pytest.approx(np.abs(expected[0]), abs=0.05)
    assert np.array(fast) == pytest.approx(expected[1], abs=0.05)
    (critical,) = [one for one in found.crossings if one.order == 0]
    assert critical.rate == pytest.approx(own, rel=2e-3)
    assert critical.frequency == pytest.approx(0.0, abs=0.01)
    for one in found.crossings:
        if one.order:
            assert 2.0 * np.pi * one.frequency == pytest.approx(one.order * one.rate, rel=2e-3)


DAMPED_INSIDE = """hfsim: 1
gravity: [0, 0]
ground: {{points: {{px: [1, 0], py: [0, 1]}}}}
bodies:
  hub: {{type: rigid, mass: 1.0, inertia: 0.2, points: {{px: [1, 0], py: [0, 1]}}}}
  plate: {{type: rigid, mass: 2.0, inertia: 0.3}}
joints: {{axle: {{type: revolute, between: [ground, hub]}}}}
springs:
  x: {{type: two_point, between: [hub.px, plate], stiffness: 800.0, damping: {inner}}}
  y: {{type: two_point, between: [hub.py, plate], stiffness: 800.0, damping: {inner}}}
  twist: {{type: rotational, between: [hub, plate], stiffness: 4000.0}}
  air_x: {{type: two_point, between: [ground.px, plate], stiffness: 0.0, damping: {outer}}}
  air_y: {{type: two_point, between: [ground.py, plate], stiffness: 0.0, damping: {outer}}}
initial: {{steady: {{body: hub, rate: 5.0}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("rates", [[0, 10, 25, 60], [60, 10], [-60, 10], [10, 60]], ids=str)
@pytest.mark.parametrize(("inner", "outer"), [pytest.param(3.0, 1.5, marks=pytest.mark.slow), (1.0, 0.2)])
def test_damping_that_turns_makes_a_rotor_unstable_from_a_rate_on(inner, outer, rates):
    """m z'' + (c + d) z' + (k - i c W) z = 0 grows for |W| > (1 + d / c) sqrt(k / m), of 20 rad/s."""
    found = hfsim.campbell(parse_deck(DAMPED_INSIDE.format(inner=inner, outer=outer)), rates, count=4)
    (onset,) = found.onsets
    first = 20.0 * (1.0 + outer / inner)
    assert abs(onset.rate) == pytest.approx(first, rel=1e-6)
    assert onset.above is (onset.rate > 0.0) is (min(rates) >= 0.0)
    assert onset.frequency == pytest.approx((first - 20.0) / (2.0 * np.pi), rel=1e-5)
    where = f"at {onset.rate:.6g} rad/s, {onset.frequency:.6g} Hz: unstable {onset.facts()['grows']}"
    assert where in campbell_text(found, "")
    assert found.facts()["onsets"] == [onset.facts()]


def test_growth_that_sets_in_as_a_root_is_located():
    """A mass on unlike springs that turn with a hub goes away between its frequencies, 20 and 30 rad/s."""
    text = DAMPED_INSIDE.format(inner=0.0, outer=0.0)
    text = text.replace("hub.py, plate], stiffness: 800", "hub.py, plate], stiffness: 1800")
    found = hfsim.campbell(parse_deck(text), [10.0, 24.0, 40.0], count=4)
    assert [one.rate for one in found.onsets] == pytest.approx([20.0, 30.0], rel=1e-3)
    assert [one.above for one in found.onsets] == [True, False]


def test_crossings_are_where_a_mode_is_excited():
    """From two modes of one frequency no sense is known: what is found between may be none."""
    overhung = WHIRLING.replace("mass: 3.0", "mass: 2.0")
    text = "\n".join(line for line in overhung.splitlines() if "right" not in line)
    deck = parse_deck(text.replace("length: 0.4", "length: 0.5"))
    found = hfsim.campbell(deck, [0.0, 50.0, 100.0], count=5)
    assert found.crossings
    for one in found.crossings:
        assert 2.0 * np.pi * one.frequency == pytest.approx(one.order * one.rate, abs=1e-2 * one.rate)


OVERHUNG = """hfsim: 1
gravity: [0, 0, 0]
sections:
  rod:
    mass_per_length: 1.0e-6
    rotary_inertia: [2.0e-9, 1.0e-9, 1.0e-9]
    axial_stiffness: 1.0e7
    shear_stiffness: [4.0e6, 4.0e6]
    torsion_stiffness: 80.0
    bending_stiffness: [100.0, 100.0]
bodies:
  shaft: {type: beam, section: rod, length: 0.5, elements: 2, degree: 3}
  disc: {type: rigid, mass: 2.0, inertia: [0.02, 0.0101, 0.0101]}
joints:
  bearing: {type: revolute, between: [ground, shaft.root], axis: [1, 0, 0]}
  hub: {type: fixed, between: [shaft.tip, disc]}
initial: {steady: {body: shaft, rate: [100, 0, 0]}}
solve: {duration: 1.0}
"""


def overhung_whirls(rate):
    """Frequencies of the disc [rad/s], those that whirl backward below zero, for y + iz and its slope."""
    length, bending, shear = 0.5, 100.0, 4.0e6
    flexible = [[length**3 / (3 * bending) + length / shear, length**2 / (2 * bending)]]
    flexible.append([length**2 / (2 * bending), length / bending])
    mass, spun = np.diag([2.0, 0.0101]), np.diag([0.0, 0.02])
    lower = np.linalg.solve(mass, np.hstack([np.linalg.inv(flexible), rate * spun]))
    return np.sort(np.linalg.eigvals(np.vstack([np.eye(4)[2:], lower])).real)


def overhung_crossings(low, high):
    """(order, rate) of all crossings seen from the shaft, by its own search."""
    found = set()
    for mode, order in np.ndindex(4, 4):
        for times in {order, -order}:

            def apart(rate, mode=mode, times=times):
                return overhung_whirls(rate)[mode] - (1 + times) * rate

            grid = np.linspace(low, high, 400)
            for a, b in pairwise(grid):
                if apart(a) * apart(b) < 0.0:
                    found.add((order, round(brentq(apart, a, b), 2)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "rates", [[0, 100, 200, 300], [1, 100, 300], [-100, 0], [-99, 1, 101], [-350, -133, 84, 301]], ids=str
)
def test_overhung_rotors_keep_their_critical_speed_from_any_rates(rates):
    """At rest the frequencies are equal in pairs, and one of each goes through zero later on."""
    found = hfsim.campbell(parse_deck(OVERHUNG), rates, count=5)
    for rate, modes in zip(rates, found.founds, strict=True):
        seen = np.sort([mode.frequency for mode in modes if mode.kind == "vibration"])[:4]
        assert seen == pytest.approx(np.sort(abs(overhung_whirls(rate) - rate)) / (2.0 * np.pi), rel=1e-4)
    told = [one for one in found.crossings if one.order == 0]
    expected = sorted(rate for order, rate in overhung_crossings(rates[0], rates[-1]) if order == 0)
    assert [one.rate for one in told] == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_crossings_of_rotors_belong_to_the_mode_that_has_them():
    found = hfsim.campbell(parse_deck(OVERHUNG), [0, 100, 200, 300], count=5)
    told = {(one.order, round(one.rate, 2)) for one in found.crossings}
    assert len(told) == len(found.crossings) and told == overhung_crossings(0.5, 299.5)


@pytest.mark.parametrize("rates", [pytest.param([-110, 110], marks=pytest.mark.slow), [20, 10]], ids=str)
def test_modes_that_change_much_between_two_rates_are_followed_there(rates):
    """Two modes were exchanged without a word, and from fast to slow crossings were sought at other modes."""
    found = hfsim.campbell(parse_deck(OVERHUNG), rates, count=5)
    told = {(one.order, round(one.rate, 2)) for one in found.crossings}
    assert len(told) == len(found.crossings) and told == overhung_crossings(*sorted(rates))
    assert found.rates.tolist() == rates and not found.guessed


def test_shapes_that_change_much_are_followed_at_rates_in_between():
    """The mode that whirls as it turns, and as the shaft does not, were exchanged."""
    start = turning_about(about(parse_deck(OVERHUNG)))
    follow = Followed(Steady(start, 5))
    for rate in (-110.0, 100.0):
        follow.reach(rate, start)
    assert len(follow.rates) > 2 and not any(often[-1] for often in follow.guesses)
    before, after = (np.abs(overhung_whirls(rate) - rate) for rate in (-110.0, 100.0))
    ends = {round(a, 2): b for a, b in zip(before, after, strict=True)}
    for track in follow.tracks[1:]:
        first, last = (abs(track[k].value.imag) for k in (0, -1))
        assert last == pytest.approx(ends[round(first, 2)], rel=1e-4)


CLIMBING = """hfsim: 1
gravity: [0, 0]
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 10.0, points: {rim: [1, 0]}}
  arm: {type: rigid, mass: 1.0, inertia: 0.01, points: {pin: [-0.5, 0]}}
  d{k=1..8}: {type: rigid, mass: 1.0, inertia: 1.0}
joints:
  axle: {type: revolute, between: [ground, hub]}
  drive: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 1}}
  pin: {type: revolute, between: [hub.rim, arm.pin]}
  p{k=1..8}: {type: revolute, between: [hub, "d{k}"]}
springs:
  coil: {type: rotational, between: [hub, arm], stiffness: 0.26}
  c{k=1..8}: {type: rotational, between: [hub, "d{k}"], stiffness: "${10*k}"}
solve: {duration: 1.0}
"""


def test_a_mode_that_climbs_beyond_those_looked_at_is_told_as_lost():
    """An arm with the stiffness c + m r l W^2, beside eight discs that keep their frequencies."""
    lost = hfsim.campbell(parse_deck(CLIMBING), [1, 50], count=1)
    assert lost.facts()["guessed"] == [{"mode": 1, "from": 1.0, "to": 50.0, "lost": True}]
    assert "mode 1 between 1 and 50 rad/s is lost" in campbell_text(lost, "")
    found = hfsim.campbell(parse_deck(CLIMBING), [1, 50], count=9)
    rates = np.sqrt((0.26 + 0.5 * np.square([1.0, 50.0])) / 0.26) / (2.0 * np.pi)
    assert found.frequencies(1) == pytest.approx(rates, rel=1e-9)
    assert not found.guessed and "lost" not in campbell_text(found, "")


TWO_WHEELS = """hfsim: 1
gravity: [0, 0, 0]
bodies:
  frame: {type: rigid, mass: 5.0, inertia: [0.1, 0.1, 0.1], points: {u: [0, 0, 0.2], d: [0, 0, -0.2]}}
  w1: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.018]}
  w2: {type: rigid, mass: 1.0, inertia: [0.01, 0.01, 0.018]}
joints:
  a1: {type: revolute, between: [frame.u, w1]}
  a2: {type: revolute, between: [frame.d, w2]}
springs: {m: {type: bushing, between: [ground, frame], stiffness: 1.0e5, rotational_stiffness: 1000}}
initial: {w1: {angular_velocity: [0, 0, 100]}, w2: {angular_velocity: [0, 0, -300]}}
solve: {duration: 0.1}
"""


@pytest.mark.parametrize(("body", "together"), [("w1", -2.0), ("w2", 2.0 / 3.0), (None, 2.0 / 3.0)])
def test_rates_are_those_of_the_rotor_that_is_named(body, together):
    """I z'' - i h z' + k z = 0 with the angular momentum h of both wheels; the slower one was refused."""
    rates = [100.0, 150.0]
    found = hfsim.campbell(parse_deck(TWO_WHEELS), rates, count=4, body=body)
    assert not found.unsteady and "at rest" in campbell_text(found, "")
    tilt = 0.1 + 2.0 * (0.01 + 0.2**2)
    for rate, modes in zip(rates, found.founds, strict=True):
        expected = np.sort(np.abs(np.roots([tilt, -0.018 * together * rate, -1000.0]))) / (2.0 * np.pi)
        assert np.sort([modes[3].frequency, modes[4].frequency]) == pytest.approx(expected, rel=1e-9)


STRIP = """hfsim: 1
gravity: [0, 0, 0]
sections:
  s:
    mass_per_length: 1.728
    rotary_inertia: [9.308e-4, 9.2e-6, 9.216e-4]
    axial_stiffness: 4.48e7
    shear_stiffness: [SHEAR, SHEAR]
    torsion_stiffness: 350
    bending_stiffness: [238.9, 23893]
bodies:
  hub: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {rim: [0.3, 0, 0]}}
  b: {type: beam, element: cosserat, section: s, length: 1.2, elements: 6, degree: 4}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount: {type: fixed, between: [hub.rim, b.root]}
  drive: {type: driver, between: [ground, hub], angle: {type: constant_rate, rate: 1}}
solve: {duration: 0.1}
"""


@pytest.mark.parametrize("shear", [4.48e8, 4.48e9])
def test_blades_stiff_in_shear_turn_steadily_at_all_rates(shear):
    """After a turn rounding grows with what is stiff across the axis; at the start nothing lies there."""
    found = hfsim.campbell(parse_deck(STRIP.replace("SHEAR", str(shear))), [0.0, 0.5, 1.0, 5.0], count=1)
    assert not found.unsteady
    # of Euler's beam, but for the inertia of its sections
    first = 1.875104**2 * np.sqrt(238.9 / 1.728) / 1.2**2 / (2.0 * np.pi)
    assert found.frequencies(1)[0] == pytest.approx(first, rel=1e-4)


MAST = """hfsim: 1
gravity: [0, 0, 0]
materials: {m: {density: 1800, youngs_modulus: 3.0e10, poisson_ratio: 0.3}}
sections: {tube: {shape: circle, diameter: 0.03}}
bodies:
  mast: {type: beam, element: cosserat, material: m, section: tube, length: 0.5, elements: 3, degree: 3}
  bar: {type: rigid, mass: 1.0, inertia: [0.02, 0.003, 0.02]}
joints:
  foot: {type: revolute, between: [ground, mast.root]}
  w: {type: fixed, between: [mast.tip, bar], orientation: {axis: [0, 1, 0], angle: -90 deg}}
initial: {mast: {orientation: {axis: [0, 1, 0], angle: -90 deg}}}
solve: {duration: 0.1}
"""


@pytest.mark.parametrize(("pitch", "turns"), [(0.0, True), (1e-31, True), (1e-14, True), (1e-6, False)])
def test_an_axis_through_the_origin_is_no_screw_by_rounding(monkeypatch, pitch, turns):
    """The velocity of the origin is rounding there, along the axis as well as across it."""
    scene = build(parse_deck(MAST))
    moves = np.array([[0.0, 0.0, pitch, 0.0, 0.0, 1.0]])
    monkeypatch.setattr("hfsim.mechanics.turning.undriven", lambda *_: moves)
    bodies, equations = list(scene.bodies.values()), scene.system.equations
    x = scene.system.absolute(scene.q[None])[0]
    found = Turning.held_by_joints(bodies, equations, x)
    assert (found is not None) is turns
    if turns:
        assert found.spin == pytest.approx([0.0, 0.0, 1.0]) and found.centre == pytest.approx(np.zeros(3))


@pytest.mark.parametrize("elements", [1, 3])
def test_a_mast_turns_about_its_own_line(elements):
    deck = parse_deck(MAST.replace("elements: 3", f"elements: {elements}"))
    assert not hfsim.campbell(deck, [0.0, 20.0], count=1).unsteady


@pytest.mark.parametrize("case", [pytest.param("lag", marks=pytest.mark.slow), "turning_blade"])
def test_blades_that_turn_steadily_are_told_so_at_all_rates(case):
    """Joint equations along which no mode moves are rounding, before a turn and after it."""
    found = hfsim.campbell(load_deck(f"cases/verify/{case}.yaml"), [0.0, 5.0, 10.0, 20.0], count=2)
    assert not found.unsteady
    assert np.isfinite([found.frequencies(number) for number in (1, 2)]).all()


def test_of_what_is_at_rest_nothing_is_left_to_tell_from_noise():
    factors = without_noise(np.eye(3)[:2], np.full(3, 1e-30), np.zeros(2), 1e-12)
    assert np.array_equal(factors, np.zeros(2))
