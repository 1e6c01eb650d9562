"""Equilibrium: closed forms and elliptic integrals, all models; what nothing holds; what is stable."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from cantilevers import at_rest, cantilever, displacement
from mechanisms import listed
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc
from solved import doubts

import hfsim
from hfsim.errors import SolverFailure
from hfsim.maths.differences import fine_derivative
from hfsim.mechanics.statics.newton import Effort
from hfsim.mechanics.statics.problem import Level, Problem, State, Tangent
from hfsim.mechanics.statics.relaxation import ENDLESS, relaxed
from hfsim.mechanics.statics.stability import neutral
from hfsim.mechanics.turning import Turning
from hfsim.scene.build import build
from hfsim.scene.equilibrium import (
    Turns,
    equilibrium_of,
    held_by_nothing,
    problem_of,
    why_not,
)
from hfsim.scene.gauging import rigid_motions
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import find_deck
from hfsim.simulate import simulate
from hfsim.studies.static import Wish, failure_of, run_static

BEAM = """
hfsim: 1
gravity: [0.0, {g}]
materials: {{m: {{density: 2700.0, youngs_modulus: 7.0e10}}}}
sections: {{s: {{shape: rectangle, width: 0.02, height: 0.005}}}}
bodies: {{b: {{type: beam, material: m, section: s, length: 1.0, elements: {elements}{more}}}}}
joints: {{{joint}}}
initial: {{b: {{angle: {angle}}}}}
solve: {{duration: 1.0, model: {model}}}
"""
PIN = "pin: {type: revolute, between: [ground, b.root]}"
CLAMP = "clamp: {type: fixed, between: [ground, b.root]}"


def beam(model="exact", g=-9.81, elements=2, joint=PIN, angle=0.0, more=""):
    text = BEAM.format(model=model, g=g, elements=elements, joint=joint, angle=angle, more=more)
    return build(parse_deck(text))


def search(scene, t=0.0):
    return equilibrium_of(scene, problem_of(scene, t))


# --- values ---------------------------------------------------------------------------------------


def elastica(alpha):
    """Return tip angle, shortening and deflection of an inextensible cantilever, alpha = P L^2 / EI."""
    from scipy.optimize import brentq

    def first(k):
        return np.arcsin(1.0 / (k * 2.0**0.5))

    k = brentq(
        lambda k: ellipk(k * k) - ellipkinc(first(k), k * k) - alpha**0.5, 0.5**0.5 + 1e-12, 1.0 - 1e-15,
        xtol=1e-15,
    )  # fmt: skip
    angle = np.arcsin(2.0 * k * k - 1.0)
    w = 1.0 - 2.0 * (ellipe(k * k) - ellipeinc(first(k), k * k)) / alpha**0.5
    return angle, 1.0 - np.sqrt(2.0 * np.sin(angle) / alpha), w


@pytest.mark.parametrize("alpha", [0.2, 1.0, 3.0, pytest.param(10.0, marks=pytest.mark.slow)])
def test_a_transverse_load_bends_a_slender_cantilever_as_the_elastica(alpha):
    stiff = "{area: 1.0e+9, second_moment: 1.0}"
    more = "element: cable, strain: green, curvature: exact, quadrature: {axial: 9, bending: 9}"
    scene = cantilever(stiff, 1.0, [0.0, -alpha], elements=8, degree=7, material=UNIT, more=more)
    _, u, w = elastica(alpha)
    assert displacement(scene, at_rest(scene, 1.0)) == pytest.approx((-u, -w), abs=1e-7)


UNIT = "youngs_modulus: 1.0"
EI = 2.07e11 * 0.1**4 / 12.0
S10 = {
    ("green", "exact"): (-0.5085374819606, -1.2072393545876),
    ("engineering", "exact"): (-0.5085373043258, -1.2072398545497),
}


@pytest.mark.parametrize("measures", S10)
def test_an_extensible_cantilever_has_the_published_tip(measures):
    strain, curvature = measures
    square, steel = "{shape: rectangle, width: 0.1, height: 0.1}", "youngs_modulus: 2.07e+11"
    more = f"element: cable, strain: {strain}, curvature: {curvature}"
    scene = cantilever(square, 2.0, [0.0, -0.75 * EI], elements=8, degree=7, material=steel, more=more)
    assert displacement(scene, at_rest(scene, 1.0)) == pytest.approx(S10[measures], rel=1e-7)


@pytest.mark.parametrize("model", ["exact", "ancf"])
def test_an_end_moment_rolls_a_beam_into_a_circle(model):
    section, more = "{area: 1.0e+4, second_moment: 1.0}", f"element: cable, curvature: exact, model: {model}"
    scene = cantilever(
        section, 1.0, [0.0, 0.0], 2.0 * np.pi, elements=8, degree=7, material=UNIT, more=more
    )
    assert displacement(scene, at_rest(scene, 1.0)) == pytest.approx((-1.0, 0.0), abs=1e-7)


def test_many_elements_take_no_more_iterations_than_few():
    few, many = (search(beam(elements=n, joint=CLAMP)) for n in (16, 256))
    assert not few.relaxed and not many.relaxed
    assert many.effort.iterations <= few.effort.iterations + 2
    assert many.values[0] == pytest.approx(few.values[0], rel=1e-4)


@pytest.mark.parametrize("elements", [16, 256])
def test_the_smallest_eigenvalue_is_the_square_of_a_frequency(elements):
    found = search(beam(g=0.0, joint=CLAMP, elements=elements))
    square = 7e10 * 0.005**2 / 12.0 / 2700.0
    roots = np.array([1.8751040687119612, 4.6940911329741746])
    assert found.values[:2] == pytest.approx(square * roots**4, rel=1e-3)


def test_a_uniform_dead_load_bends_it_as_shooting_says():
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    load = 8.0

    def curve(bend):
        def slopes(s, y):
            return [y[1], load * (1.0 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(slopes, (0.0, 1.0), [0.0, bend, 0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    tip = curve(brentq(lambda bend: curve(bend)[1], -load, 0.0, xtol=1e-14))
    text = f"""
hfsim: 1
gravity: [0.0, 0.0]
materials: {{m: {{density: 1.0, youngs_modulus: 1.0}}}}
sections: {{s: {{area: 1.0e+9, second_moment: 1.0}}}}
bodies: {{b: {{type: beam, material: m, section: s, length: 1.0, elements: 8, degree: 7, curvature: exact,
  quadrature: {{axial: 9, bending: 9}}}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads: {{snow: {{type: distributed, on: b, force: [0.0, {-load}]}}}}
solve: {{duration: 1.0}}
"""
    scene = build(parse_deck(text))
    assert scene.marker("b.tip").position(at_rest(scene))[0] == pytest.approx(tip[2:], abs=1e-7)


def test_equations_are_solved_once_for_each_iteration(monkeypatch):
    solved, solve = [], Tangent.solved
    monkeypatch.setattr(Tangent, "solved", lambda *args: solved.append(0) or solve(*args))
    found = search(beam(joint=CLAMP))
    assert found.effort.iterations == len(solved) > 1


def test_forces_and_stiffness_are_taken_once_where_a_step_is_tried_shorter(monkeypatch):
    taken, missing = [], Problem._missing
    monkeypatch.setattr(Problem, "_missing", lambda *args: taken.append(0) or missing(*args))
    scene = beam(model="rigid", angle=0.5 * np.pi - 0.1)
    found = search(scene)
    assert found.relaxed and found.stable
    # one at the start for the first step, and one in each state that is come to
    assert len(taken) <= found.effort.steps + 2


def test_a_servo_rests_where_its_law_has_come_to():
    text = """
hfsim: 1
bodies: {hub: {type: rigid, mass: 1.0, inertia: 1.0}}
joints:
  pin: {type: revolute, between: [ground, hub]}
  motor:
    {type: servo, between: [ground, hub], angle: {type: constant_rate, rate: 2.0}, stiffness: 9, damping: 4}
solve: {duration: 1.0}
output: {channels: [hub.angle, motor.moment]}
"""
    run = run_static(parse_deck(text), Wish(0.5))
    assert [c.values[0] for c in run.channels] == pytest.approx([1.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(("model", "blamed"), [("lowOrder", "model"), ("exact", "deck"), ("rigid", "deck")])
def test_a_rough_model_is_blamed_before_the_joints_where_no_rest_is_found(model, blamed):
    scene = beam(model=model, angle=-0.5 * np.pi)
    found = search(scene)
    lost = replace(found, reason=ENDLESS, neutral=np.eye(1, found.state.z.shape[1]))
    assert why_not(scene, 0.0, lost).kind == blamed


# --- mechanisms -----------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["rigid", "linear", "lowOrder", "exact", "ancf"])
@pytest.mark.parametrize("angle", [0.0, 1.2, -3.0])
def test_a_pendulum_is_let_down_to_where_it_hangs(model, angle):
    scene = beam(model, angle=angle)
    found = search(scene)
    assert found.relaxed and found.stable and not found.reason
    x = scene.system.reduction.expand(found.state.z)
    tip = scene.marker("b.tip").position(x)[0]
    stretch = 2700.0 * 9.81 / (2.0 * 7e10)
    assert tip == pytest.approx((0.0, -1.0 - (stretch if model != "rigid" else 0.0)), abs=1e-10)
    assert found.values[0] == pytest.approx(1.5 * 9.81, rel=1e-3)


def test_a_pendulum_that_stands_upright_is_told_to_be_unstable():
    found = search(beam(angle=0.5 * np.pi))
    assert not found.reason and not found.stable
    assert found.values[0] == pytest.approx(-1.5 * 9.81, rel=1e-2)


THIN = """
hfsim: 1
gravity: {g}
materials: {{m: {{density: 7800.0, youngs_modulus: 2.1e+11, poisson_ratio: 0.3}}}}
sections: {{s: {{shape: rectangle, width: 0.001, height: 0.001}}}}
bodies: {{{bodies}}}
joints: {{{joints}}}
solve: {{duration: 1.0, model: {model}}}
"""


def thin(count, model, element, space=True):
    """Return a chain of strips of 1 m by 1 mm that starts on a level."""
    beams = (
        f"b{k}: {{type: beam, material: m, section: s, length: 1.0, elements: 4, element: {element}}}"
        for k in range(count)
    )
    axis = ", axis: [0, 1, 0]" if space else ""
    ends = ["ground", *(f"b{k}.tip" for k in range(count - 1))]
    hinges = (f"j{k}: {{type: revolute, between: [{end}, b{k}.root]{axis}}}" for k, end in enumerate(ends))
    g = "[0.0, 0.0, -9.81]" if space else "[0.0, -9.81]"
    return build(
        parse_deck(THIN.format(g=g, bodies=", ".join(beams), joints=", ".join(hinges), model=model))
    )


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact"])
def test_thin_sections_do_not_slow_down_what_swings(model, space):
    """Hardly any mass moves as they shear, at 1e6 times the rate at which axes do."""
    found = search(thin(1, model, "cosserat", space))
    assert found.relaxed and found.stable and not found.reason and found.effort.iterations < 30


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("model", ["linear", "exact"])
def test_thin_lines_do_not_answer_what_steps_stretch(model, space):
    """A step turns them by more than their length allows: tension that is none held them up."""
    found = search(thin(1, model, "cable", space))
    assert found.relaxed and found.stable and not found.reason and found.effort.iterations < 30


COIL_AND_LINE = """
hfsim: 1
materials: {{m: {{density: 7800.0, youngs_modulus: 2.1e+11}}}}
sections: {{s: {{shape: rectangle, width: 0.01, height: 0.01}}}}
bodies: {{b: {{type: beam, material: m, section: s, length: 1.0, elements: 4{more}}}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
springs: {{coil: {{type: rotational, between: [ground, b.root], stiffness: {stiffness}}}}}
loads: {{push: {{type: force, at: b.tip, force: [0.0, -1.0]}}}}
solve: {{duration: 1.0, model: {model}}}
"""


@pytest.mark.parametrize("more", ["", ", degree: 5", ", strain: engineering, curvature: exact"])
@pytest.mark.parametrize("model", ["linear", "exact"])
@pytest.mark.parametrize("stiffness", [1.0, 10.0])
def test_a_stiff_line_on_a_soft_coil_turns_with_it(stiffness, model, more):
    """Of one that keeps its length: k a = L P cos a; the model linear found places with huge strains."""
    from scipy.optimize import brentq

    scene = build(parse_deck(COIL_AND_LINE.format(stiffness=stiffness, model=model, more=more)))
    found = search(scene)
    x = scene.system.reduction.expand(found.state.z)
    turn = brentq(lambda a: stiffness * a - np.cos(a), 0.0, 1.5)
    assert scene.marker("b.root").angle(x)[0] == pytest.approx(-turn, rel=1e-3)
    assert not found.reason and found.effort.iterations < 30


def test_a_chain_that_is_let_down_takes_few_steps_that_are_too_long():
    scene = thin(3, "exact", "cosserat")
    found = search(scene)
    x = scene.system.reduction.expand(found.state.z)
    assert scene.marker("b2.tip").position(x)[0] == pytest.approx([0.0, 0.0, -3.0], abs=1e-5)
    assert found.effort.iterations < 40


FOUR_BARS = Path(__file__).parent.parent.parent / "cases/verify/four_bars.yaml"
LINED_UP = ["gravity=[9.81, 0.0]"]
"""So that its bars rest in one line, where its loops could go over into crossed ones."""


@pytest.mark.parametrize("longest", [0.17, 0.2, 0.22])
def test_a_rest_where_joints_lose_their_rank_is_found_by_whatever_steps(longest, monkeypatch):
    """Corrections get no smaller than the root of rounding there."""
    monkeypatch.setattr("hfsim.mechanics.statics.relaxation.MOVE", longest)
    found = search(build(load_deck(FOUR_BARS, LINED_UP)))
    assert not found.reason and found.effort.iterations < 200


def test_a_column_beyond_its_critical_load_is_told_to_be_unstable():
    section = "{area: 1.0e+6, second_moment: 1.0}"
    critical = np.pi**2 / 4.0
    for share in (0.99, 1.01):
        scene = cantilever(section, 1.0, [-share * critical, 0.0], material=UNIT, more="element: cable")
        found = search(scene, 1.0)
        assert found.stable == (share < 1.0) and not found.relaxed


@pytest.mark.parametrize(("trusted", "told"), [(0.3, 0), (-1.0, 1)])
def test_a_rest_whose_unstable_motions_cannot_be_counted_is_doubted(trusted, told, monkeypatch):
    monkeypatch.setattr("hfsim.maths.inertia._TRUSTED", trusted)
    warnings = run_static(beam(joint=CLAMP, elements=80).loaded).statistics["warnings"]
    assert ["whether it is stable is not certain" in one for one in warnings] == [True] * told


def test_what_nothing_holds_is_named():
    scene = beam(joint="")
    found = search(scene)
    told = why_not(scene, 0.0, found)
    assert found.reason and "floats: x, y, turn" in str(told) and told.remedy and told.exit_code == 3
    with pytest.raises(SolverFailure, match="nothing holds"):
        at_rest(scene)


BALANCED = """
hfsim: 1
gravity: [0.0, -9.81]
bodies:
  hub: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{near: [{arm}, 0.0], far: [{other}, 0.0]}}}}
  light: {{type: rigid, mass: 1.0, inertia: 0.1}}
  heavy: {{type: rigid, mass: 3.0, inertia: 0.1}}
joints:
  axle: {{type: revolute, between: [ground, hub]}}
  one: {{type: fixed, between: [hub.near, light]}}
  other: {{type: fixed, between: [hub.far, heavy]}}
initial: {{hub: {{angle: {angle}, angular_velocity: 2.0}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("arm", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_what_is_balanced_stays_at_any_angle(arm, angle):
    """Weight turns it by rounding alone, of which it was let down."""
    deck = parse_deck(BALANCED.format(arm=arm, other=-arm / 3.0, angle=angle))
    scene = build(deck)
    found = search(scene)
    assert np.array_equal(found.state.z, scene.system.reduction.free(scene.system.absolute(scene.q[None])))
    assert held_by_nothing(scene, found.neutral) == ["hub: turns about axle, with light, heavy"]
    assert not found.reason and not len(found.values)
    modes = hfsim.modes(deck, about="equilibrium", count=2)
    assert [mode.kind for mode in modes] == ["rigid"] and modes.about.lasting


@pytest.mark.parametrize("gravity", [0.0, -9.81])
def test_a_wheel_on_its_axle_has_an_equilibrium_at_any_angle(gravity):
    """Nothing at all is stiff."""
    text = (
        f"hfsim: 1\ngravity: [0.0, {gravity}]\nbodies: {{wheel: {{type: rigid, mass: 1.0, inertia: 0.1}}}}\n"
        "joints: {axle: {type: revolute, between: [ground, wheel]}}\n"
        "initial: {wheel: {angle: 0.4, angular_velocity: 3.0}}\nsolve: {duration: 1.0}\n"
    )
    modes = hfsim.modes(parse_deck(text), about="equilibrium")
    assert [mode.kind for mode in modes] == ["rigid"] and modes.about.motions.x[-1] == pytest.approx(0.4)


def test_a_motion_along_which_nothing_pushes_is_left_open():
    found = search(beam(g=0.0))
    assert not found.reason and found.stable and len(found.neutral) == 1
    floating = search(beam(g=0.0, joint=""))
    assert len(floating.neutral) == 3 and floating.values[0] > 1.0


def test_a_body_in_space_is_free_about_the_line_it_hangs_by():
    scene = build(load_deck(find_deck("heavy_top")))
    found = search(scene)
    x = scene.system.reduction.expand(found.state.z)
    assert scene.marker("top").position(x)[0] == pytest.approx((0.0, 0.0, -1.0), abs=1e-10)
    assert len(found.neutral) == 1
    spin = rigid_motions(scene, x)[5] @ scene.system.equations.constant_mass
    assert abs(found.neutral[0] @ spin) > 0.1
    # m g l / (I + m l^2) of a flat one, whose normal has no mass
    assert found.values == pytest.approx([147.15 / 15.234375] * 2, rel=1e-12)


def test_a_model_without_stiffening_says_why_it_finds_no_rest():
    scene = build(load_deck(find_deck("pendulum"), ["solve.model=linear"]))
    with pytest.raises(SolverFailure, match=r"in model linear deflects by .* its length") as told:
        at_rest(scene)
    assert told.value.item == "bodies.b1"


# --- springs, drivers, turns ----------------------------------------------------------------------

ARM = """
hfsim: 1
gravity: [0.0, 0.0{z}]
bodies: {{arm: {{type: rigid, mass: 1.0, inertia: {inertia}}}}}
joints:
  axle: {{type: revolute, between: [ground, arm]}}
springs: {{coil: {{type: rotational, between: [ground, arm], stiffness: 2.0, damping: 0.1}}}}
loads: {{turn: {{type: moment, at: arm, moment: {moment}}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("space", [False, True])
def test_turns_of_a_coil_are_counted(space):
    own = {"z": ", 0.0", "inertia": "[1.0, 1.0, 1.0]", "moment": "[0, 0, 30.0]"}
    scene = build(parse_deck(ARM.format(**(own if space else {"z": "", "inertia": 1.0, "moment": 30.0}))))
    x = at_rest(scene)
    first = scene.marker("arm").turned(x, np.array([1.0, 0.0, 0.0][: 3 if space else 2]))[0]
    assert first[:2] == pytest.approx((np.cos(15.0), np.sin(15.0)), abs=1e-10)


FLAP = """
hfsim: 1
gravity: [0, 0, 0]
bodies: {flap: {type: rigid, mass: 1.0, inertia: [0.01, 0.1, 0.1], points: {in: [-0.3, 0, 0]}}}
joints: {hinge: {type: revolute, between: [ground, flap.in], axis: [0, 1, 1]}}
springs: {coil: {type: rotational, between: [ground, flap.in], axis: [0, 1, 1], stiffness: 0.5}}
initial: {hinge: {angle: -20 deg}}
solve: {duration: 0.1}
output: {channels: [hinge.angle, coil.angle], plots: false}
"""


@pytest.mark.parametrize("rest", [240.0, 700.0, -300.0])
def test_turns_of_a_joint_on_which_nothing_acts_are_counted_on_the_way_to_rest(rest):
    def deck(*changes):
        return parse_deck(FLAP, overrides=[f"springs.coil.rest_angle={rest} deg", *changes])

    begun = simulate(deck("initial.equilibrium=true"), error_estimate=False)
    for run in (run_static(deck()), run_static(deck(), Wish(path=True)), begun):
        for name in ("hinge.angle", "coil.angle"):
            assert np.rad2deg(run[name]) == pytest.approx(np.full_like(run.t, rest), abs=1e-6)


@pytest.mark.parametrize("rest", [60.0, 100.0, 240.0])
def test_a_scene_without_loads_does_not_snap_beyond_a_share_of_them(rest):
    """What holds it back at first does not turn with it, and has a limit that no load has."""
    run = run_static(parse_deck(FLAP, overrides=[f"springs.coil.rest_angle={rest} deg"]))
    assert run.status == "done" and run.statistics["limit"] is None and not run.statistics["warnings"]
    assert np.rad2deg(run.final["hinge.angle"]) == pytest.approx(rest, abs=1e-6)


COILED = """
hfsim: 1
gravity: [0, 0]
materials: {m: {density: 1000.0, youngs_modulus: 2.0e11}}
sections: {s: {shape: rectangle, width: 0.03, height: 0.03}}
bodies:
  a: {type: rigid, mass: 1.0, inertia: 0.05, points: {in: [-0.25, 0], out: [0.25, 0]}}
  b: {type: beam, material: m, section: s, length: 0.5, elements: 1}
  c: {type: rigid, mass: 1.7, inertia: 0.05, points: {in: [-0.25, 0], out: [0.25, 0]}}
joints:
  j: {type: revolute, between: [ground, a.in]}
  k: {type: revolute, between: [a.out, b.root]}
  l: {type: revolute, between: [b.tip, c.in]}
springs:
  p: {type: rotational, between: [ground, a.in], stiffness: 30.74, rest_angle: 60.3 deg}
  q: {type: rotational, between: [a.out, b.root], stiffness: 11.2, rest_angle: -630.6 deg}
  r: {type: rotational, between: [b.tip, c.in], stiffness: 32.54, rest_angle: -671.2 deg}
loads: {turn: {type: moment, at: c.out, moment: -6.49}}
initial: {j: {angle: 5.5 deg}, k: {angle: -164.8 deg}, l: {angle: -23.1 deg}}
solve: {duration: 1}
output: {channels: [j.angle, k.angle, b.angle]}
"""


def test_turns_of_a_beam_are_counted_along_a_path_that_began_anew():
    path = run_static(parse_deck(COILED), Wish(path=True))
    assert path["b.angle"] == pytest.approx(path["j.angle"] + path["k.angle"], abs=1e-4)


def test_another_place_of_rest_to_which_loads_alone_lead_is_told_of():
    changes = ["springs.coil.rest_angle=100 deg", "initial.hinge.angle=-100 deg"]
    deck = parse_deck(FLAP + "loads: {pull: {type: force, at: flap, force: [0, -6, 0]}}", overrides=changes)
    run, path = run_static(deck), run_static(deck, Wish(path=True))
    assert run.final["hinge.angle"] < 0.0 < path.final["hinge.angle"]
    assert run.statistics["limit"] is None and path.statistics["limits"] == []
    (told,) = run.statistics["warnings"]
    assert told.startswith("the scene has another place of rest")


TOGGLE = """
hfsim: 1
gravity: [0, 0]
bodies:
  wall: {type: rigid, mass: 1.0, inertia: 0.1, points: {eye: [1, 0]}}
  block: {type: rigid, mass: 1.0, inertia: 0.1}
joints:
  bolts: {type: fixed, between: [ground, wall]}
  guide: {type: prismatic, between: [ground, block], axis: [0, 1]}
springs: {coil: {type: two_point, between: [wall.eye, block], stiffness: 100, rest_length: 1.1}}
loads: {push: {type: force, at: block, force: [0, -4]}}
initial: {guide: {distance: 0.35}}
solve: {duration: 1}
"""


@pytest.mark.parametrize("height", [0.35, 0.2, 0.6])
def test_the_limit_of_the_loads_is_that_of_their_path_wherever_the_scene_starts(height):
    deck = parse_deck(TOGGLE, overrides=[f"initial.guide.distance={height}"])
    y = np.linspace(0.0, 0.5, 100001)
    limit = float(np.max(100.0 * (1.1 / np.hypot(1.0, y) - 1.0) * y)) / 4.0
    run, path = run_static(deck), run_static(deck, Wish(path=True))
    assert run.statistics["limit"] == pytest.approx(limit, rel=1e-4)
    assert path.statistics["limits"][0] == pytest.approx(limit, rel=1e-7)
    assert path.status == "done" and path.final["block.y"] == pytest.approx(run.final["block.y"], rel=1e-9)


RIDGE = """
hfsim: 1
gravity: [0.3, -9.81]
ground: {points: {g: [0.2, -0.5]}}
bodies: {A: {type: rigid, mass: 0.66, inertia: 0.055, points: {r: [-0.5, 0], m: [-0.13, 0]}}}
joints: {p: {type: revolute, between: [ground, A.r]}}
springs: {s: {type: two_point, between: [ground.g, A.m], stiffness: 150.0, rest_length: 0.3}}
solve: {duration: 1.0}
output: {channels: [A.angle]}
"""


@pytest.mark.parametrize("start", [-1.3, -1.2, -1.1, -1.0])
def test_what_starts_beside_the_edge_between_two_places_of_rest_comes_down_on_its_side(start):
    """Loads that are put on from there lead up to the edge, at -1.134 rad."""
    from scipy.optimize import brentq

    def moment(angle):
        arm = np.array([np.cos(angle), np.sin(angle)])
        way = 0.37 * arm - (0.2, -0.5)
        pull = np.array([0.3, -9.81]) * 0.66 * 0.5 - 0.37 * 150.0 * way * (1.0 - 0.3 / np.linalg.norm(way))
        return pull @ (-arm[1], arm[0])

    way = np.sign(moment(start))
    ahead = start + way * np.arange(0.0, 1.0, 0.01)
    end = next(one for one in ahead if moment(one) * way < 0.0)
    run = run_static(parse_deck(RIDGE, overrides=[f"initial.A.angle={start}"]))
    assert run.final["A.angle"] == pytest.approx(brentq(moment, end - way * 0.01, end), abs=1e-9)
    assert run.statistics["stable"] and not run.statistics["warnings"]


@pytest.mark.parametrize("push", [-0.5, 0.5])
def test_a_small_load_across_leads_away_from_a_dead_centre_as_its_warning_says(push):
    changes = ["initial.guide.distance=0", "loads.push.force=[0, 0]"]
    (told,) = run_static(parse_deck(TOGGLE, overrides=changes)).statistics["warnings"]
    assert told.endswith("a start a little beside it (initial), or a small load across, leads away from it")
    run = run_static(parse_deck(TOGGLE, overrides=[changes[0], f"loads.push.force=[0, {push}]"]))
    y = run.final["block.y"]
    assert run.statistics["stable"] and not run.statistics["warnings"] and y * push > 0.0
    assert 100.0 * (1.1 / np.hypot(1.0, y) - 1.0) * y == pytest.approx(-push, rel=1e-9)


BOW = """
hfsim: 1
materials: {m: {density: 1000.0, youngs_modulus: 2.0e+11}}
sections: {s: {shape: rectangle, width: 0.01, height: 0.01}}
bodies: {bow: {type: beam, material: m, section: s, length: 1.0, elements: 12}}
joints: {clamp: {type: fixed, between: [ground, bow.root]}}
springs: {string: {type: two_point, between: [ground, bow.tip], stiffness: 1.0e+6, rest_length: 0.0}}
loads: {push: {type: force, at: bow.tip, force: [0, 0.1]}}
solve: {duration: 1.0}
output: {channels: [string.force]}
"""


@pytest.mark.parametrize("stiffness", [1e5, 3e5])
def test_a_bow_that_its_string_bends_rests_bent(stiffness):
    """Straight it rests too, on an edge that forces which fade lead to; at its ends are no moments."""
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    def force(m):
        return (2.0 * ellipk(m)) ** 2 * 2.0e11 * 1e-8 / 12.0

    m = brentq(lambda m: 2.0 * ellipe(m) / ellipk(m) - 1.0 - force(m) / stiffness, 0.1, 0.9)
    run = run_static(parse_deck(BOW, overrides=[f"springs.string.stiffness={stiffness}"]))
    assert run.statistics["stable"]
    assert run.final["string.force"] == pytest.approx(-force(m), rel=5e-3)


SOFTENING = """
hfsim: 1
materials: {m: {density: 1000.0, youngs_modulus: 2.0e+11}}
sections: {s: {shape: rectangle, width: 0.03, height: 0.03}}
bodies: {arm: {type: beam, material: m, section: s, length: 1.0, elements: 1}}
joints: {hinge: {type: revolute, between: [ground, arm.root]}}
springs:
  latch: {type: rotational, between: [ground, arm.root], table: [[0, 0], [0.1, 10], [0.2, 0], [99, 0]]}
loads: {turn: {type: moment, at: arm.tip, moment: 5.0}}
initial: {hinge: {angle: 0.18}}
solve: {duration: 1.0}
output: {channels: [hinge.angle, arm.angle, latch.moment]}
"""


def test_an_edge_below_which_nothing_rests_is_told_with_its_own_turns():
    """Beside it the arm turns for ever."""
    run = run_static(parse_deck(SOFTENING))
    assert run.status == "done" and not run.statistics["stable"]
    assert abs(run.final["latch.moment"]) == pytest.approx(5.0, rel=1e-9)
    assert 0.1 < run.final["hinge.angle"] < 0.18
    assert run.final["arm.angle"] == pytest.approx(run.final["hinge.angle"], abs=1e-4)


def test_a_search_that_begins_anew_counts_turns_from_the_start():
    scene = build(parse_deck(FLAP, overrides=["springs.coil.rest_angle=240 deg"]))
    turns = Turns(scene)
    problem = problem_of(scene, 0.0, turns)
    relaxed(problem, problem.begin(), Effort())
    assert np.rad2deg(turns.angles["hinge"]) == pytest.approx(240.0, abs=1e-6)
    turns(0.0, problem.expand(problem.begin().z))
    assert np.rad2deg(turns.angles["hinge"]) == pytest.approx(-20.0, abs=1e-6)


DRIVEN = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {arm: {type: rigid, mass: 2.0, inertia: 1.0, points: {eye: [-1.0, 0.0]}}}
joints:
  pin: {type: revolute, between: [ground, arm.eye]}
  turn: {type: driver, between: [ground, arm], angle: {type: constant_rate, rate: 0.5}}
solve: {duration: 4.0}
output: {channels: [arm.x, arm.y, turn.moment, turn.power]}
"""


def test_drivers_stand_where_they_are_at_the_time():
    run = run_static(parse_deck(DRIVEN), Wish(2.0))
    assert run["arm.x"] == pytest.approx(np.cos(1.0)) and run["arm.y"] == pytest.approx(np.sin(1.0))
    assert run["turn.moment"] == pytest.approx(2.0 * 9.81 * np.cos(1.0), rel=1e-12)
    assert run["turn.power"] == 0.0


@pytest.mark.parametrize("spin", [0.0, 3.0])
@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("princeton", "exact"),
        ("joints", "exact"),
        ("hub_beams", "exact"),
        ("hub_beams", "lowOrder"),
        ("pendulum_3d", "lowOrder"),
    ],
)
def test_tangents_are_the_derivatives_of_what_is_missing(name, model, spin):
    scene = build(load_deck(find_deck(name)), model)
    n_dim = scene.deck.dimension
    axis = [spin] if n_dim == 2 else [0.5 * spin, 0.0, spin]
    turning = Turning.of(scene.bodies.values(), axis, [0.3] * n_dim) if spin else None
    problem = replace(problem_of(scene, 0.7), turning=turning)
    rng = np.random.default_rng(3)
    z = problem.start.z + 0.01 * rng.standard_normal(problem.start.z.shape)
    multipliers = rng.standard_normal(problem.start.multipliers.shape)
    own = problem.tangent(State(z, multipliers), 0.6)

    def held_back(moved):
        return -problem._missing(moved, np.repeat(multipliers, len(moved), axis=0), Level(0.6))[0]

    n = z.shape[1]
    slopes = fine_derivative(held_back, z[0], np.arange(n), np.full(n, 3e-4))
    assert np.abs(own.stiffness - slopes).max() < 1e-9 * np.abs(slopes).max()


def unfound(*given):
    raise np.linalg.LinAlgError("no convergence")


BOOM = """
hfsim: 1
gravity: [0, 0, 0]
materials: {{steel: {{density: 7800, youngs_modulus: 2.0e11, poisson_ratio: 0.3}}}}
sections: {{wire: {{shape: circle, diameter: 2 mm}}}}
bodies: {{b: {{type: beam, material: steel, section: wire, length: 10, elements: {elements}}}}}
{more}
solve: {{duration: 1}}
"""


@pytest.mark.parametrize(("elements", "iterated"), [(4, False), (30, True), (30, False)])
def test_what_is_slow_beside_the_fastest_is_no_rounding(elements, iterated, monkeypatch):
    """Squares of frequencies go from 8e-3 to 6e13; the first are known to five digits.

    Also where an iteration finds none of them, as it does for thin ropes.
    """
    if not iterated:
        monkeypatch.setattr("hfsim.maths.squares._large", unfound)
    clamp = "joints: {c: {type: fixed, between: [ground, b.root]}}"
    unit = 2.0e11 * 0.001**2 / 4.0 / 7800.0 / 10.0**4
    held = search(build(parse_deck(BOOM.format(elements=elements, more=clamp))))
    assert held.stable and not len(held.neutral)
    assert held.values[:2] == pytest.approx(unit * 1.8751040687119612**4, rel=1e-3)
    free = search(build(parse_deck(BOOM.format(elements=elements, more=""))))
    assert free.stable and len(free.neutral) == 6
    assert free.values[:2] == pytest.approx(unit * 4.730040744862704**4, rel=1e-3)


STRING = """
hfsim: 1
gravity: [0.0, -9.81]
ground: {points: {right: [1.0, 0.0]}}
materials: {m: {density: 1100.0, youngs_modulus: 5.0e+6}}
sections: {s: {shape: rectangle, width: 0.02, height: 0.0002}}
bodies: {b: {type: beam, material: m, section: s, length: 1.0, elements: 12, degree: 3, curvature: exact}}
joints:
  left: {type: revolute, between: [ground, b.root]}
  right: {type: revolute, between: [ground.right, b.tip]}
solve: {duration: 1.0}
output: {channels: [b.root.axial_force]}
"""


def test_a_string_that_is_slack_at_first_gets_tight_without_a_snap():
    run = run_static(parse_deck(STRING))
    assert not run.statistics["warnings"] and run.statistics["stable"] and not run.statistics["relaxed"]
    stiffness, weight = 5e6 * 0.02 * 0.0002, 1100.0 * 9.81 * 0.02 * 0.0002
    across = (stiffness * weight**2 / 24.0) ** (1.0 / 3.0)  # of a shallow parabola
    assert run.final["b.root.axial_force"] == pytest.approx(np.hypot(across, 0.5 * weight), rel=0.01)


# --- range of the models --------------------------------------------------------------------------

BENT = """
hfsim: 1
materials: {m: {density: 1.0, youngs_modulus: 1.0}}
sections: {s: {area: 1.0e+6, second_moment: 1.0}}
bodies: {b: {type: beam, material: m, section: s, length: 1.0, elements: 4, degree: 5}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
loads: {turn: {type: moment, at: b.tip, moment: 0.5}}
solve: {duration: 1.0}
output: {channels: [b.tip.y]}
"""


@pytest.mark.parametrize(("model", "moment"), [("linear", 0.05), ("linear", 0.5), ("lowOrder", 0.5)])
def test_a_model_bent_beyond_its_range_is_told(model, moment):
    run = run_static(parse_deck(BENT, overrides=[f"solve.model={model}", f"loads.turn.moment={moment}"]))
    (told,) = doubts(run)
    assert f"body 'b' is beyond the range of {model}" in told and "--model exact" in told
    assert run.statistics["validity"]["b"]["largest"]["estimated_error"] > 5e-3


@pytest.mark.parametrize(("model", "moment"), [("linear", 0.005), ("lowOrder", 0.04), ("exact", 0.5)])
def test_a_model_within_its_range_is_not_doubted(model, moment):
    run = run_static(parse_deck(BENT, overrides=[f"solve.model={model}", f"loads.turn.moment={moment}"]))
    assert not doubts(run)
    assert run.final["b.tip.y"] == pytest.approx((1.0 - np.cos(moment)) / moment, rel=5e-3)


@pytest.mark.parametrize("mass", [0.9, 1.1, 1.3])
def test_joints_hold_together_where_what_others_made_superfluous_is_not_any_more(mass, monkeypatch):
    """At rest the null vector of the joint equations is zero on the row that is left out."""
    monkeypatch.setattr("hfsim.scene.redundancy._Motion.superfluous", lambda self: [21])
    run = hfsim.static("bricard", {"bodies.l2.mass": mass})
    assert run.final["l1.y"] == pytest.approx(-0.3 * 3.0**0.5, abs=1e-8)
    assert run.final["constraint.position"] < 1e-8
    assert any("lose their rank" in one for one in run.statistics["warnings"])


def test_a_rest_where_joints_lose_their_rank_is_told():
    run = hfsim.static(load_deck(FOUR_BARS, LINED_UP))
    assert run.final["b2.top.x"] == pytest.approx(3.0, abs=1e-8)
    (told,) = [one for one in run.statistics["warnings"] if "lose their rank" in one]
    assert "foot0, foot1, foot2, left1, right1, left2, right2" in told
    assert not any("rank" in one for one in hfsim.static("governor").statistics["warnings"])


RAIL = """hfsim: 1
gravity: [0.0, -9.81]
bodies: {{car: {{type: rigid, mass: 100.0, inertia: 0.005}}}}
joints:
  rail: {{type: prismatic, between: [{ends}], axis: {axis}}}
  winch: {{type: servo, between: [ground, car], position: {position}, stiffness: {stiffness}}}
solve: {{duration: 1.0}}
output: {{channels: [car.x, car.y, rail.moment]}}
"""


@pytest.mark.parametrize("ends", ["car, ground", pytest.param("ground, car", marks=pytest.mark.slow)])
def test_no_rank_is_lost_where_a_car_has_slid_far(ends):
    """With its rail's axis in the car, the arm of that rail's force is 25 m long."""
    run = hfsim.static(parse_deck(RAIL.format(ends=ends, axis="[1, 0]", position=25.0, stiffness=1000.0)))
    assert not run.statistics["warnings"] and run.final["car.x"] == pytest.approx(25.0)
    assert run.statistics["steps"] < 400, "a servo's position is a length of the scene"


@pytest.mark.parametrize("ends", ["car, ground", "ground, car"])
def test_what_slides_away_is_told_and_no_dead_centre(ends):
    falling = parse_deck(
        RAIL.format(ends=ends, axis="[0, 1]", position=0.0, stiffness=1.0),
        overrides=["joints.winch.axis=[1, 0]"],
    )
    run = hfsim.static(falling, check=False)
    assert run.failure["class"] == "deck" and "nothing holds what the loads push: car" in run.reason


def test_bricard_s_loop_rests_flat():
    """Its frequency there by the closing condition and the energies of tests/scene/test_spatial_cases.py."""
    run = hfsim.static("bricard")
    assert run.final["l1.y"] == pytest.approx(-0.3 * 3.0**0.5, abs=1e-10)
    assert run.statistics["smallest_eigenvalue"] == pytest.approx((2.0 * np.pi * 0.280415461) ** 2, rel=1e-7)
    assert not any("rank" in one for one in run.statistics["warnings"])


@pytest.mark.parametrize("size", [1e-4, 1e3])
def test_bricard_s_loop_of_any_size_rests_flat(size):
    deck = yaml.safe_load(find_deck("bricard").read_text("utf-8"))
    places = [deck["ground"]["points"]]
    for body in deck["bodies"].values():
        body["mass"] *= size**3
        body["inertia"] = [size**5 * one for one in body["inertia"]]
        places.append(body["points"])
    for points in places:
        points.update({name: [size * one for one in at] for name, at in points.items()})
    run = hfsim.static(parse_deck(yaml.safe_dump(deck)))
    square = (2.0 * np.pi * 0.280415461) ** 2 / size
    assert run.statistics["smallest_eigenvalue"] == pytest.approx(square, rel=1e-7)
    assert not any("rank" in one for one in run.statistics["warnings"])


TURNED = """hfsim: 1
gravity: [0.0, 0.0]
bodies: {m: {type: rigid, mass: 1.0, inertia: 0.1}}
joints:
  d: {type: motion, between: [ground, m], turn: {type: constant_rate, rate: 40}}
springs: {k: {type: rotational, between: [ground, m], stiffness: 0.5}}
solve: {duration: 0.2}
output: {channels: [m.angle, d.moment]}
"""


def test_a_driven_linkage_is_led_through_its_flat_place_as_it_moves():
    """A long step leads to where it is folded over."""
    deck = load_deck(FOUR_BARS.parents[1] / "extreme/four_bar.yaml")
    run = simulate(deck, error_estimate=False)
    for t in (0.3, 0.6):
        led = run_static(deck, Wish(t=t)).final["rocker.angle"]
        assert led == pytest.approx(np.interp(t, run.t, run["rocker.angle"]), abs=1e-3)


HINGED = """
  c: {type: revolute, between: [ground, m]}
  d: {type: driver, between: [ground, m], angle"""


@pytest.mark.parametrize("led", ["\n  d: {type: motion, between: [ground, m], turn", HINGED])
def test_joints_go_along_their_laws_with_all_turns(led):
    deck = TURNED.replace("\n  d: {type: motion, between: [ground, m], turn", led)
    for t in (0.05, 0.1, 0.2):
        run = hfsim.static(parse_deck(deck), at=t)
        assert run.final["d.moment"] == pytest.approx(20.0 * t) and not run.statistics["warnings"]
        assert run.final["m.angle"] == pytest.approx(40.0 * t)


@pytest.mark.parametrize("t", [0.1, 10.0])
def test_a_law_that_is_over_at_once_is_no_snap(t):
    """A thousandth of the time is too short to be followed."""
    law = "{type: smooth_step, from: 0, to: 1.5, start: 0.05, end: 0.0502}"
    deck = TURNED.replace("{type: constant_rate, rate: 40}", law)
    run = hfsim.static(parse_deck(deck), at=t)
    assert run.final["d.moment"] == pytest.approx(0.75) and not run.statistics["warnings"]


def test_many_turns_are_not_followed_and_that_is_told():
    run = hfsim.static(parse_deck(TURNED.replace("rate: 40", "rate: 4000")), at=0.1)
    (told,) = run.statistics["warnings"]
    assert "has turned by 400 rad" in told and run.statistics["steps"] < 10


PRESSED = """hfsim: 1
gravity: [0.0, 0.0]
bodies:
  arm: {type: rigid, mass: 0.3, inertia: 0.02, points: {root: [-0.5, 0.0], tip: [0.5, 0.0]}}
  cart: {type: rigid, mass: 0.3, inertia: 0.002}
initial: {arm: {position: [0.5, 0.0]}, cart: {position: [1.75, 0.0]}}
joints:
  axle: {type: revolute, between: [ground, arm.root]}
  lead: {type: motion, between: [ground, cart], x: {type: smooth_step, from: 1.75, to: 1.5, start: 0, end: 1}}
springs:
  coil: {type: rotational, between: [ground, arm], stiffness: 5.0}
  link: {type: two_point, between: [arm.tip, cart], stiffness: 200.0, rest_length: 0.75}
solve: {duration: 3.0}
output: {channels: [arm.angle]}
"""


def test_what_its_joints_press_over_an_edge_rests_beside_it_and_loads_are_not_blamed():
    from scipy.optimize import brentq

    def moment(angle):
        far = np.hypot(1.5 - np.cos(angle), np.sin(angle))
        return 5.0 * angle + 200.0 * (far - 0.75) * 1.5 * np.sin(angle) / far

    run = hfsim.static(parse_deck(PRESSED), at=1.0)
    assert run.statistics["stable"]
    assert abs(run.final["arm.angle"]) == pytest.approx(brentq(moment, 0.1, 1.0), rel=1e-9)
    assert not any("of the loads" in one for one in run.statistics["warnings"])


def test_full_turns_that_are_lost_where_a_scene_is_let_down_are_warned_of():
    deck = yaml.safe_load(TURNED)
    deck["gravity"] = [0.0, -9.81]
    deck["bodies"]["n"] = {"type": "rigid", "mass": 1.0, "inertia": 0.1, "points": {"in": [-1.0, 0.0]}}
    deck["joints"]["hinge"] = {"type": "revolute", "between": ["m", "n.in"]}
    near, far = (hfsim.static(deck, at=t) for t in (0.05, 0.1))
    assert not near.statistics["warnings"]
    (told,) = far.statistics["warnings"]
    assert "joints.d has turned by 4 rad" in told and "full turns are not counted" in told


ROLLED = """hfsim: 1
gravity: [0.0, 0.0]
sections:
  s: {mass_per_length: 1, rotary_inertia: 0.01, axial_stiffness: 1.0e+4, shear_stiffness: 1.0e+4,
      bending_stiffness: 2}
bodies: {b: {type: beam, section: s, length: 1.0, element: cosserat, elements: 6, degree: 6}}
joints:
  clamp: {type: fixed, between: [ground, b.root]}
  hand:
    type: motion
    between: [ground, b.tip]
    turn: {expression: "tau * (1 - cos(pi * t))"}
    x: {expression: "sin(tau * (1 - cos(pi * t)) + 1e-9) / (tau * (1 - cos(pi * t)) + 1e-9)"}
    y: {expression: "(1 - cos(tau * (1 - cos(pi * t)) + 1e-9)) / (tau * (1 - cos(pi * t)) + 1e-9)"}
solve: {duration: 1.0}
output: {channels: [hand.moment]}
"""


@pytest.mark.parametrize("t", [0.5, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_hand_rolls_a_beam_into_rings(t):
    """Once round, and twice."""
    run = hfsim.static(parse_deck(ROLLED), at=t)
    turn = 2.0 * np.pi * (1.0 - np.cos(np.pi * t))
    assert run.final["hand.moment"] == pytest.approx(2.0 * turn, rel=1e-5)


BECK = """hfsim: 1
gravity: [0, 0, 0]
sections:
  s: {mass_per_length: 1.0, rotary_inertia: [2.0e-4, 1.0e-4, 1.0e-4], axial_stiffness: 1.0e8,
      shear_stiffness: [1.0e8, 1.0e8], torsion_stiffness: 3.0, bending_stiffness: [10.0, 1000.0]}
bodies: {b: {type: beam, section: s, length: 1.0, elements: 6, degree: 3}}
joints: {c: {type: fixed, between: [ground, b.root]}}
loads: {f: {type: force, at: b.tip, force: [-300.0, 0, 0], follower: true}}
solve: {duration: 1.0}
"""


def test_what_flutters_under_a_follower_load_is_not_stable():
    """Beck's column: 20.05 EI / L^2; it swings and grows, at the rate of its modes."""
    run = hfsim.static(parse_deck(BECK))
    assert not run.statistics["stable"]
    assert run.statistics["unstable_from"] == pytest.approx(20.05 / 30.0, rel=0.01)
    growth = max(one.value.real for one in hfsim.modes(parse_deck(BECK), about="equilibrium").modes)
    assert np.sqrt(-run.statistics["smallest_eigenvalue"]) == pytest.approx(growth, rel=1e-5)
    assert hfsim.static(parse_deck(BECK), {"loads.f.force.0": -198.0}).statistics["stable"]


ZIEGLER = """hfsim: 1
gravity: [0, 0]
bodies:
  one: {type: rigid, mass: 2.0, inertia: 1.0e-9, points: {in: [-1, 0]}}
  two: {type: rigid, mass: 1.0, inertia: 1.0e-9, points: {in: [-1, 0]}}
joints:
  a: {type: revolute, between: [ground, one.in]}
  b: {type: revolute, between: [one, two.in]}
springs:
  ka: {type: rotational, between: [ground, one], stiffness: 1.0}
  kb: {type: rotational, between: [one, two], stiffness: 1.0}
loads: {push: {type: force, at: two, force: [-2.0, 0], follower: true}}
solve: {duration: 1.0}
"""


def test_what_a_follower_load_does_no_work_along_is_resisted_still():
    """Ziegler's column at P L / k = 2: (1, 0) K (1, 0) = 0, but det K = 1 and the squares are 1/2 and 1."""
    run = hfsim.static(parse_deck(ZIEGLER))
    assert run.statistics["stable"] and run.statistics["held_by_nothing"] == []
    assert run.statistics["smallest_eigenvalue"] == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("dampers", [(1e-3, 1e-3), (1e-3, 0.0), (0.1, 0.3), (3.0, 1.0)])
@pytest.mark.parametrize("push", [1.0, 1.4, 1.5, 2.05, pytest.param(2.5, marks=pytest.mark.slow), 5.0])
def test_dampers_count_in_what_swings_and_grows(dampers, push):
    """Those of modes; with two alike Ziegler's column flutters from 41/28 k/L on, without any from 2.086."""
    given = {f"springs.{name}.damping": one for name, one in zip(("ka", "kb"), dampers, strict=True)}
    given["loads.push.force.0"] = -push
    found = hfsim.static(parse_deck(ZIEGLER), given).statistics
    growth = max(one.value.real for one in hfsim.modes(parse_deck(ZIEGLER), given, about="equilibrium"))
    assert found["stable"] is (growth <= 0.0)
    if growth > 0.0:
        assert -found["smallest_eigenvalue"] == pytest.approx(growth**2, rel=1e-4)
    if dampers == (1e-3, 1e-3):
        assert found["stable"] is (push < 41.0 / 28.0)


LINE_IN_WIND = """hfsim: 1
gravity: [0, -9.81, 0]
materials: {c: {density: 2700, youngs_modulus: 70 GPa}}
sections: {c: {area: 3.0e-4, second_moments: [1e-10, 1e-10], torsion_constant: 2e-10}}
ground: {points: {b: [200, 10, 0]}}
bodies:
  line:
    {type: beam, material: c, section: c, elements: 16,
     axis: {arc: {radius: 450, angle: "${2 * asin(hypot(200, 10) / 900)}"}}}
joints:
  a: {type: spherical, between: [ground, line.root]}
  b: {type: spherical, between: [ground.b, line.tip]}
loads: {w: {type: distributed, on: line, force: [0, 0, 6]}}
solve: {duration: 1}
output: {channels: [a.force_x, a.force_y, a.force_z], plots: false}
"""


def test_a_thin_line_in_a_side_wind_rolls_to_where_it_rests():
    """An elastic catenary under 7.9461 N/m of weight and 6 N/m sideways; EI = 7 N m^2 turns it by 37 deg."""
    run = hfsim.static(parse_deck(LINE_IN_WIND))
    forces = [run.final[f"a.force_{axis}"] for axis in "xyz"]
    assert forces == pytest.approx([-4371.2788, 581.3563, -604.0097], rel=1e-6)
    assert run.statistics["stable"] and run.statistics["held_by_nothing"] == []


def test_a_search_that_ends_on_its_way_names_nothing_that_holds_nothing(monkeypatch):
    monkeypatch.setattr("hfsim.mechanics.statics.relaxation.MOST", 20)
    run = hfsim.static(parse_deck(LINE_IN_WIND), check=False)
    assert run.reason == "no place of rest is found: it does not come to rest"


HANGING = """hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies: {load: {type: rigid, mass: 2.0, inertia: [0.1, 0.1, 0.1], points: {hook: [0.0, 0.0, 0.5]}}}
joints: {eye: {type: spherical, between: [ground, load.hook]}}
solve: {duration: 1.0}
"""


def test_of_a_joint_only_the_motions_that_nothing_resists_are_told():
    """A load that hangs from a ball joint: weight resists two turns, not that about the vertical."""
    run = hfsim.static(parse_deck(HANGING))
    assert run.statistics["held_by_nothing"] == ["load: turns about eye, 3 axes (1 of these)"]


@pytest.mark.parametrize("moment", [0.0, 1.0])
def test_only_what_the_loads_push_is_told_as_held_by_nothing(moment, monkeypatch):
    """A wheel beside a pendulum whose search ends on its way."""
    text = f"""hfsim: 1
gravity: [0.0, -9.81]
bodies:
  wheel: {{type: rigid, mass: 2.0, inertia: 0.1}}
  bob: {{type: rigid, mass: 2.0, inertia: 0.1, points: {{hook: [-0.5, 0.0]}}}}
joints:
  axle: {{type: revolute, between: [ground, wheel]}}
  eye: {{type: revolute, between: [ground, bob.hook]}}
loads: {{push: {{type: moment, at: wheel, moment: {moment}}}}}
solve: {{duration: 1.0}}
"""
    monkeypatch.setattr("hfsim.mechanics.statics.relaxation.MOST", 3)
    told = "nothing holds what the loads push: wheel" if moment else "no place of rest is found"
    assert hfsim.static(parse_deck(text), check=False).reason.startswith(told)


SPATIAL_FOUR_BAR = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
materials: {{m: {{density: 2700.0, youngs_modulus: 70 GPa, poisson_ratio: 0.3}}}}
sections: {{s: {{shape: circle, diameter: 10 mm}}}}
ground: {{points: {{pivot: {pivot}}}}}
bodies:
  crank: {{type: beam, material: m, section: s, length: {crank!r}, elements: 1, model: rigid}}
  coupler: {{type: beam, material: m, section: s, length: {coupler!r}, elements: 2}}
  rocker: {{type: beam, material: m, section: s, length: {rocker!r}, elements: 1, model: rigid}}
joints:
  axle: {{type: revolute, between: [ground, crank.root], axis: [0, 1, 0]}}
  pin: {{type: spherical, between: [crank.tip, coupler.root]}}
  eye: {{type: spherical, between: [coupler.tip, rocker.tip]}}
  axis: {{type: revolute, between: [ground.pivot, rocker.root], axis: [1, 0, 0]}}
initial:
  crank: {{orientation: {{x: {to_pin}, y: [0, 1, 0]}}}}
  coupler: {{orientation: {{x: {to_eye}, y: {across}}}}}
  rocker: {{orientation: {{x: {to_tip}, y: {aside}}}}}
solve: {{duration: 1.0}}
"""


def test_a_spatial_four_bar_whose_coupler_can_spin_is_let_down_to_rest():
    """Ball joints leave the coupler to spin, which moves hardly any mass: that is no little way to go."""
    from scipy.optimize import minimize_scalar

    pivot, lengths = np.array([0.6, 0.4, 0.1]), (0.2, 0.5)

    def pin(angle):
        return lengths[0] * np.array([np.cos(angle), 0.0, np.sin(angle)])

    def tip(angle):
        return pivot + lengths[1] * np.array([0.0, -np.cos(angle), -np.sin(angle)])

    begin, rocker = 2.5, 1.2
    length = np.linalg.norm(tip(rocker) - pin(begin))

    def closed(angle):
        """Of the rocker's two angles the one on the side of the start."""
        way = pivot - pin(angle)
        cosine = (way @ way + lengths[1] ** 2 - length**2) / (2.0 * lengths[1] * np.hypot(*way[1:]))
        return np.arctan2(way[2], way[1]) + np.arccos(cosine)

    assert closed(begin) == pytest.approx(rocker)

    def height(angle):
        """Of the centre of mass, times its mass."""
        ends = pin(angle)[2], tip(closed(angle))[2]
        return lengths[0] * ends[0] + length * sum(ends) + lengths[1] * (ends[1] + pivot[2])

    rest = minimize_scalar(height, bounds=(-3.0, 0.0), options={"xatol": 1e-10}).x
    x = (tip(rocker) - pin(begin)) / length
    axes = [x, np.cross([0.0, 0.0, 1.0], x), pin(begin) / lengths[0], (tip(rocker) - pivot) / lengths[1]]
    to_eye, across, to_pin, to_tip = (listed(one / np.linalg.norm(one)) for one in axes)
    aside = listed(np.cross([1.0, 0.0, 0.0], axes[3]))
    run = hfsim.static(
        parse_deck(
            SPATIAL_FOUR_BAR.format(
                pivot=listed(pivot), crank=lengths[0], coupler=float(length), rocker=lengths[1],
                to_pin=to_pin, to_eye=to_eye, across=across, to_tip=to_tip, aside=aside,
            )
        )
    )  # fmt: skip
    assert run.statistics["stable"], run.reason
    found = [run.final[f"crank.tip.{k}"] for k in "xyz"]
    assert found == pytest.approx(pin(rest), abs=1e-4)  # the coupler sags
    (told,) = run.statistics["held_by_nothing"]
    assert told.startswith("coupler: turns about pin")


WOUND = """
hfsim: 1
gravity: {gravity}
materials: {{rubber: {{density: 1100, youngs_modulus: 5 MPa, poisson_ratio: 0.45}}}}
sections: {{round: {{shape: circle, diameter: 3 cm}}}}
bodies:
  rod:
    {{type: beam, element: cosserat, material: rubber, section: round, length: 1.0, elements: {elements},
      degree: 1}}
joints: {{clamp: {{type: fixed, between: [ground, rod.root]}}}}
loads: {{wind: {{type: moment, at: rod.tip, moment: {moment}}}}}
solve: {{duration: 1.0}}
output: {{channels: [{channel}]}}
"""


SPACE = pytest.param("[0, 0, 0]", "[0.4, 0, 0]", marks=pytest.mark.slow)


@pytest.mark.parametrize("path", [False, True])
@pytest.mark.parametrize(("gravity", "moment"), [SPACE, ("[0, 0]", "0.4")])
def test_a_mesh_that_cannot_follow_a_load_is_named(gravity, moment, path):
    deck = WOUND.format(gravity=gravity, moment=moment, elements=2, channel="rod.tip.x")
    run = hfsim.static(parse_deck(deck), path=path, check=False)
    assert run.status == "failed" and "one node to the next" in run.reason
    assert (run.failure["class"], run.failure["item"]) == ("model", "bodies.rod")
    assert "bodies.rod.elements=4" in run.failure["try"]
    # beyond, the rod of 1 m got many times longer
    assert max(abs(run["rod.tip.x"])) < 3.0


def test_a_finer_mesh_follows_it():
    deck = WOUND.format(gravity="[0, 0, 0]", moment="[0.4, 0, 0]", elements=32, channel="rod.tip.twist")
    torsion = 0.5 * 5e6 / 1.45 * 0.5 * np.pi * 0.015**4
    assert hfsim.static(parse_deck(deck)).final["rod.tip.twist"] == pytest.approx(0.4 / torsion, rel=1e-2)


def test_joints_that_lose_their_rank_on_the_way_are_told_before_what_else_fails():
    scene = build(load_deck(FOUR_BARS, LINED_UP))
    found = search(scene)
    lost = replace(found, reason=ENDLESS, lost=found.state)
    told = failure_of(scene, 0.0, lost)
    assert "lose their rank" in str(told) and (told.kind, told.item) == ("physical", "joints.foot0")
    begin = replace(found, reason=ENDLESS, lost=problem_of(scene).start)
    assert "rank" not in str(failure_of(scene, 0.0, begin))


def test_a_pendulum_that_swings_down_at_the_end_of_a_beam_snaps_to_nothing():
    """Its loads cannot be put on by and by, from where it points up: nothing says where they could."""
    deck = parse_deck("""hfsim: 1
gravity: [0, -9.81]
materials: {steel: {density: 7800, youngs_modulus: 2.0e11}}
sections: {s: {shape: rectangle, width: 0.02, height: 0.01}}
bodies:
  b: {type: beam, material: steel, section: s, length: 1.0, elements: 4}
  p: {type: rigid, mass: 0.5, inertia: 0.01, points: {pin: [-0.3, 0]}}
joints: {c: {type: fixed, between: [ground, b.root]}, h: {type: revolute, between: [b.tip, p.pin]}}
initial: {p: {angle: 90 deg}}
solve: {duration: 1.0}
""")
    found = hfsim.static(deck)
    assert found.status == "done" and not any("snaps" in warning for warning in found.statistics["warnings"])


@pytest.mark.parametrize(
    ("share", "y"), [pytest.param(0.97, -0.376437, marks=pytest.mark.slow), (1.1, -0.376609)]
)
def test_an_arch_under_a_slanted_push_snaps_to_the_rest_that_its_path_leads_to(share, y):
    """What steps left in its stiff line hid that they led uphill: they went to and fro, by 1e5 J."""
    deck = parse_deck(f"""hfsim: 1
gravity: [0, -9.81]
materials: {{al: {{density: 2700, youngs_modulus: 7.0e10}}}}
sections: {{s: {{shape: rectangle, width: 0.03, height: 0.01}}}}
bodies:
  a:
    {{type: beam, material: al, section: s, length: "${{pi / 3}}", elements: 4, degree: 3, element: cosserat,
    axis: {{arc: {{radius: 1.0, angle: -60 deg}}}}, points: {{mid: ["${{pi / 6}}", 0]}}}}
joints:
  l: {{type: revolute, between: [ground, a.root]}}
  r: {{type: revolute, between: [ground.r, a.tip]}}
ground: {{points: {{r: ["${{sqrt(0.75)}}", -0.5]}}}}
initial: {{a: {{angle: 0.0}}}}
loads: {{push: {{type: force, at: a.mid, force: [{3000 * share}, {-5000 * share}]}}}}
solve: {{duration: 1.0}}
output: {{channels: [a.mid.x, a.mid.y]}}
""")
    found = hfsim.static(deck)
    assert found.statistics["stable"] and found.statistics["steps"] < 60
    assert found.final["a.mid.y"] == pytest.approx(y, abs=2e-6)


WIRE = """hfsim: 1
materials: {{steel: {{density: 7850.0, youngs_modulus: 2.1e11, poisson_ratio: 0.3}}}}
sections: {{wire: {{shape: circle, diameter: {diameter}}}}}
bodies: {{b: {{type: beam, material: steel, section: wire, length: {length}, elements: 4, degree: 4}}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads: {{push: {{type: force, at: b.tip, force: [0, 0, {force}]}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("length", [1e-5, 1e-3, 1.0, 1e3])
def test_wires_of_any_length_are_as_stiff_as_euler_says(length):
    """Ten thousand times as long as thick: stretch over bending stiffness is 1.6e9 in any unit."""
    diameter, root = 1e-4 * length, 1.875104068711961
    deck = WIRE.format(length=length, diameter=diameter, force=3e-10 * length**2)
    found = search(build(parse_deck(deck)))
    expected = root**4 * 2.1e11 * diameter**2 / 16.0 / 7850.0 / length**4
    assert found.stable and found.values[:2] == pytest.approx([expected] * 2, rel=1e-4)


COINCIDENT = """hfsim: 1
gravity: [0, 0]
ground: {points: {seat: [0.3, 0.1]}}
bodies: {rocker: {type: rigid, mass: 0.25, inertia: 3.0e-4, points: {out: [0.3, 0.1]}}}
joints: {piv: {type: revolute, between: [ground, rocker]}}
springs: {s: {type: two_point, between: [ground.seat, rocker.out], stiffness: 20 kN/m, %s}}
solve: {duration: 0.1}
"""


@pytest.mark.parametrize(
    ("spring", "size"), [("rest_length: 0.1", "2000"), ("preload: -300", "300"), ("rest_length: 0", None)]
)
def test_a_force_between_points_in_one_place_has_no_direction_and_that_is_told(spring, size):
    """Any push throws them apart: no stiffness at the place itself tells that."""
    deck = parse_deck(COINCIDENT % spring)
    told = f"both points in one place, where its force of {size} N has no direction"
    found = hfsim.static(deck).statistics
    assert [told in one for one in build(deck).warnings] == ([True] if size else [])
    assert [told in one for one in found["warnings"]] == ([True, True] if size else [])
    assert found["stable"] is (None if size else True)
    assert (found["smallest_eigenvalue"] is None) == bool(size)


def test_what_starts_beyond_a_stop_is_told_of_the_start():
    """Half a turn and more before its stop in space; at rest against it turns are counted from elsewhere."""
    deck = """hfsim: 1
gravity: [0, 0, 0]
bodies: {flap: {type: rigid, mass: 1, inertia: [0.1, 0.1, 0.1], points: {edge: [-0.5, 0, 0]}}}
joints:
  hinge: {type: revolute, between: [ground, flap.edge], axis: [0, 0, 1], stops: {upper: 0, stiffness: 500}}
springs: {coil: {type: rotational, between: [ground, flap], axis: [0, 0, 1], stiffness: 0.5, preload: -1}}
initial: {flap: {angle: -190 deg}}
solve: {duration: 1}
"""
    run = hfsim.static(parse_deck(deck))
    assert not any("beyond its stop" in one for one in run.statistics["warnings"])
    assert run.final["flap.rotation_z"] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_what_nothing_holds_is_told_alike_in_any_unit_of_length(size):
    """Two bodies on a hinge with a coil, which holds them straight, and nothing else."""
    body = {"type": "rigid", "mass": 1.0, "inertia": 0.1 * size**2}
    hinge = {"between": ["a.r", "b.l"]}
    deck = {
        "hfsim": 1,
        "bodies": {"a": body | {"points": {"r": [size, 0.0]}}, "b": body | {"points": {"l": [-size, 0.0]}}},
        "joints": {"h": hinge | {"type": "revolute"}},
        "springs": {"s": hinge | {"type": "rotational", "stiffness": size**2, "rest_angle": 0.2}},
        "solve": {"duration": 1.0},
    }
    assert hfsim.static(deck).statistics["held_by_nothing"] == ["a: floats: x, y, turn"]


def test_only_the_first_motion_that_becomes_unstable_is_located():
    """A shaft that is stiff alike to both sides flutters under any torque, in ever more ways."""
    section = "{shape: rectangle, width: 0.1, height: 0.1}"
    material = "youngs_modulus: 7.0e+9, poisson_ratio: 0.3"
    load, moment = (0.0, 20.0, 20.0), (1.6e4, 0.0, 0.0)
    scene = cantilever(section, 1.0, load, moment, material=material)
    found = equilibrium_of(scene, problem_of(scene, 1.0))
    assert not found.reason and not found.stable and len(found.values[found.values < 0.0]) > 2
    assert 0.0 <= found.crossed < 1e-4
    assert found.effort.steps < 40


ROD = """hfsim: 1
gravity: [0, 0, -9.81]
ground: {{points: {{b: {end}}}}}
bodies:
  rod:
    type: rigid
    mass: 0.05
    inertia: [1.0e-6, 1.5e-3, 1.5e-3]
    points: {{a: [-{half}, 0, 0], b: [{half}, 0, 0]}}
joints:
  one: {{type: spherical, between: [ground, rod.a]}}
  other: {{type: spherical, between: [rod.b, ground.b]}}
initial: {{rod: {{orientation: {{x: {end}, y: {across}}}}}}}
solve: {{duration: 1}}
"""


@pytest.mark.parametrize("end", [[0.519, 0.377, -0.28], [-0.531, -0.395, -0.229], [0.539, 0.056, -0.443]])
def test_a_rod_between_two_balls_is_free_about_its_line(end):
    """What its axes keep of forces at both ends that cancel out is rounding, and no stiffness."""
    half, across = 0.5 * float(np.linalg.norm(end)), np.cross(end, [0.0, 0.0, 1.0]).tolist()
    scene = build(parse_deck(ROD.format(end=end, half=half, across=across)))
    found = equilibrium_of(scene, problem_of(scene))
    assert len(found.neutral) == 1 and not len(found.values)
    assert len(neutral(problem_of(scene), found.state, 1.0, rigid_motions(scene, scene.q[None]))) == 1
