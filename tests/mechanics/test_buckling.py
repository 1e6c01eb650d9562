"""Critical loads and paths through limit points, against closed forms."""

import numpy as np
import pytest
from cantilevers import cantilever
from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc
from solved import doubts, parsed

import hfsim
from hfsim.maths.rotations import rotation
from hfsim.mechanics.statics.buckling import critical_factors
from hfsim.mechanics.statics.newton import Effort
from hfsim.mechanics.statics.path import Path
from hfsim.output.static import as_text
from hfsim.scene.build import build
from hfsim.scene.equilibrium import problem_of, scaled
from hfsim.scene.loading import parse_deck

COLUMN = "{area: 1.0e+7, second_moment: 1.0}"
UNIT = "youngs_modulus: 1.0"
EXACT = "element: cable, curvature: exact"
EULER = np.pi**2 / 4.0


def column(load, elements=8, degree=5):
    return cantilever(COLUMN, 1.0, [-load, 0.0], elements=elements, degree=degree, material=UNIT, more=EXACT)


@pytest.mark.parametrize(("elements", "degree"), [(8, 5), (70, 3)])
def test_a_clamped_column_gives_way_under_euler_s_loads(elements, degree):
    found = critical_factors(problem_of(column(1.0, elements, degree), 1.0), Effort())
    assert [one.load for one in found] == pytest.approx([EULER, 9.0 * EULER, 25.0 * EULER], rel=2e-5)
    assert found[0].load == pytest.approx(EULER, rel=1e-6)
    assert all(one.found for one in found)


@pytest.mark.parametrize("load", [1e-7, 1e-9])
def test_factors_of_a_load_far_below_them_are_not_hidden_by_rounding(load):
    """Over a short step of such a load the stiffness changes by less than its last digits."""
    found = critical_factors(problem_of(column(load), 1.0), Effort(), 2)
    assert [load * one.load for one in found] == pytest.approx([EULER, 9.0 * EULER], rel=2e-5)
    assert all(one.found for one in found)


STIFF = """hfsim: 1
gravity: %s
bodies: {a: {type: rigid, mass: 1.0, inertia: %s, points: {p: %s}}}
joints: {j: {type: %s, between: [ground, a.p]}}
solve: {duration: 1.0}
"""
FLAT, DEEP = ("[0.0, -9.81]", "0.1", "[0, 1]"), ("[0.0, -9.81, 0.0]", "[0.1, 0.1, 0.1]", "[0, 1, 0]")


@pytest.mark.parametrize("joint", ["fixed", "revolute"])
@pytest.mark.parametrize("numbers", [FLAT, DEEP])
def test_where_nothing_is_elastic_no_load_makes_anything_give_way(numbers, joint):
    """Neither of a body that is held, nor of one that hangs."""
    problem = problem_of(build(parse_deck(STIFF % (*numbers, joint))), 0.0)
    with np.errstate(all="raise"):
        assert critical_factors(problem, Effort()) == []


def test_a_motion_that_is_like_none_is_no_way_to_give_way():
    """A beam under its own weight in a model that loses sight of what it follows."""
    deck = """hfsim: 1
gravity: [0.0, -9.81]
materials: {m: {density: 1000.0, youngs_modulus: 1.0e8}}
sections: {c: {shape: rectangle, width: 0.05, height: 0.05}}
bodies: {b: {type: beam, material: m, section: c, length: 1.0, elements: 4}}
joints: {j: {type: fixed, between: [ground, b.root]}}
solve: {duration: 0.1, model: lowOrder}
output: {interval: 0.05, channels: [b.tip.x]}
"""
    with np.errstate(invalid="raise"):
        assert not any(hfsim.static(parsed(deck), buckling=2).statistics["critical_reached"])


ROUND = """hfsim: 1
gravity: [0, 0, 0]
materials: {m: {density: 1000.0, youngs_modulus: 1.0e9}}
sections: {c: {shape: circle, radius: 0.005}}
bodies: {b: {type: beam, material: m, section: c, length: 1.0, elements: 8}}
joints: {j: {type: fixed, between: [ground, b.root], orientation: {rotation_vector: [0.4, -0.3, 0.9]}}}
loads: {p: {type: force, at: b.tip, force: [%s, %s, %s]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        pytest.param(["bodies.b.elements=40"], marks=pytest.mark.slow),
        pytest.param(["solve.model=lowOrder"], marks=pytest.mark.slow),
        ["bodies.b.element=cable", "bodies.b.degree=5"],
    ],
)
def test_a_round_column_gives_way_to_both_sides_wherever_it_points(overrides):
    """Rounding makes a complex pair of the two factors where the motions do not lie along coordinates."""
    R = rotation(np.array([0.4, -0.3, 0.9]))
    scene = build(parse_deck(ROUND % tuple(-R[:, 0]), overrides=overrides))
    found = critical_factors(problem_of(scene), Effort(), 3)
    euler = EULER * 1e9 * np.pi * 0.005**4 / 4.0
    assert [one.load for one in found[:2]] == pytest.approx([euler, euler], rel=1e-4)
    assert found[2].load == pytest.approx(9.0 * euler, rel=2e-3)
    assert all(one.found for one in found)


STRIP = """hfsim: 1
gravity: [0, 0]
materials: {steel: {density: 7800, youngs_modulus: 2.0e11}}
sections: {s: {shape: rectangle, width: 0.1, height: 1.0e-4}}
bodies:
  b: {type: beam, element: continuum, material: steel, section: s, length: 1.0, elements: 4, degree: 4,
      section_degree: 3}
joints: {c: {type: fixed, between: [ground, b.root]}}
loads: {f: {type: force, at: b.tip, force: [-1.6666666667e-3, 0]}}
solve: {duration: 1.0}
"""
PLATE = [
    "materials.steel={density: 1.0, youngs_modulus: 1.2e7}", "sections.s.height=0.01",
    "bodies.b.elements=6", "loads.f.force=[-0.1, 0]",
]  # fmt: skip


@pytest.mark.parametrize("overrides", [[], PLATE])
def test_a_thin_column_has_its_lowest_factor_though_rounding_hides_when_it_is_reached(overrides):
    """At the factor itself the stiffness is singular, and estimates go to and fro by rounding."""
    found = critical_factors(problem_of(build(parse_deck(STRIP, overrides=overrides))), Effort(), 2)
    assert [one.load for one in found] == pytest.approx([EULER, 9.0 * EULER], rel=2e-3)
    assert all(one.found for one in found)


HEAVY = """
hfsim: 1
gravity: [-1.0, 0.0]
materials: {m: {density: 1.0e-7, youngs_modulus: 1.0}}
sections: {s: {area: 1.0e+7, second_moment: 1.0}}
bodies: {b: {type: beam, material: m, section: s, length: 1.0, elements: 8, degree: 5, curvature: exact}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
loads: {side: {type: force, at: b.tip, force: [0.5, 0.0]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("model", ["exact", "lowOrder"])
def test_a_column_under_its_own_weight_gives_way_at_greenhill_s(model):
    text = HEAVY.replace("[0.5, 0.0]", "[0.0, 0.0]")
    scene = build(parse_deck(text, overrides=[f"solve.model={model}"]))
    found = critical_factors(problem_of(scene), Effort(), 1)
    assert found[0].load == pytest.approx(7.83734743894348, rel=1e-6 if model == "exact" else 1e-4)


def test_factors_can_be_of_some_loads_only():
    lifted = critical_factors(problem_of(build(parse_deck(HEAVY)), varied=["gravity"]), Effort(), 1)
    assert lifted[0].load > 8.5
    pushed = critical_factors(problem_of(build(parse_deck(HEAVY)), varied=["side"]), Effort(), 1)
    assert not pushed


LEANING = """
hfsim: 1
materials: {m: {density: 1.0e-7, youngs_modulus: 1.0}}
sections: {s: {area: 1.0e+7, second_moment: 1.0}}
bodies: {b: {type: beam, material: m, section: s, length: 1.0, elements: 8, degree: 5, curvature: exact}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
loads: {p: {type: force, at: b.tip, force: [-1.0, 0.0]}}
solve: {duration: 1.0}
output: {channels: [b.tip.y]}
"""


PORTAL = """
hfsim: 1
ground: {points: {r: [1.0, 0.0]}}
materials: {m: {density: 7800.0, youngs_modulus: 2.1e+11}}
sections: {s: {shape: rectangle, width: 0.02, height: 0.005}}
bodies:
  c1: {type: beam, material: m, section: s, length: 1.0, elements: 3, degree: 5}
  bm: {type: beam, material: m, section: s, length: 1.0, elements: 3, degree: 5}
  c2: {type: beam, material: m, section: s, length: 1.0, elements: 3, degree: 5}
joints:
  f1: {type: fixed, between: [ground, c1.root], angle: 90 deg}
  k1: {type: fixed, between: [c1.tip, bm.root], angle: -90 deg}
  k2: {type: fixed, between: [bm.tip, c2.root], angle: -90 deg}
  f2: {type: fixed, between: [c2.tip, ground.r], angle: 90 deg}
loads:
  p1: {type: force, at: c1.tip, force: [0.0, -1.0]}
  p2: {type: force, at: c2.root, force: [0.0, -1.0]}
solve: {duration: 1.0}
"""


def test_a_clamped_portal_sways_at_its_critical_load():
    """By slope deflection u cot u = -6 in the columns, whose P L^2 / EI is the square of u."""
    u = brentq(lambda u: u / np.tan(u) + 6.0, 0.5 * np.pi + 1e-9, np.pi - 1e-9)
    found = critical_factors(problem_of(build(parse_deck(PORTAL))), Effort(), 3)
    assert found[0].load == pytest.approx(u**2 * 2.1e11 * 0.02 * 0.005**3 / 12.0, rel=2e-4)
    assert all(one.found for one in found)


def test_a_model_without_stiffening_says_that_it_does_not_buckle():
    run = hfsim.static(parse_deck(PORTAL, overrides=["solve.model=linear"]), buckling=3)
    assert min(run.statistics["critical"]) > 0.0
    assert any("how it buckles: --model exact" in one for one in run.statistics["warnings"])
    settings = ["solve.model=linear", "solve.coordinates=frame"]
    straight = hfsim.static(parse_deck(LEANING, overrides=settings), buckling=3)
    assert straight.statistics["critical"] == [] and "singular" in straight.statistics["critical_reason"]
    assert straight.statistics["critical_reached"] == []
    assert any("how it buckles: --model exact" in one for one in straight.statistics["warnings"])
    pressed_to_nothing = hfsim.static(parse_deck(LEANING, overrides=settings[:1]), buckling=1)
    assert pressed_to_nothing.statistics["critical"] == pytest.approx([1.0e7], rel=1e-3)


TRUSS = """
hfsim: 1
name: truss
gravity: [0.0, 0.0]
ground: {points: {l: [-1.0, 0.0], r: [1.0, 0.0]}}
bodies: {top: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {guide: {type: prismatic, between: [ground, top], axis: [0.0, 1.0]}}
springs:
  a: {type: two_point, between: [ground.l, top], stiffness: 10.0, rest_length: 1.118033988749895}
  b: {type: two_point, between: [ground.r, top], stiffness: 10.0, rest_length: 1.118033988749895}
initial: {top: {position: [0.0, 0.5]}}
loads: {push: {type: force, at: top, force: [0.0, -2.0]}}
solve: {duration: 1.0}
output: {channels: [top.y, guide.force_x, energy.potential]}
"""


def test_the_load_of_a_shallow_truss_is_followed_through_both_limits():
    run = hfsim.static(parse_deck(TRUSS), path=True)
    length = 1.25**0.5
    height = (length ** (2.0 / 3.0) - 1.0) ** 0.5
    limit = 10.0 * height * (length / (1.0 + height**2) ** 0.5 - 1.0)
    assert run.statistics["limits"] == pytest.approx([limit, -limit], rel=1e-9)
    assert not run.statistics["branches"] and run.statistics["stable"]
    y, load = run["top.y"], run["load"]
    assert load == pytest.approx(10.0 * y * (length / (1.0 + y**2) ** 0.5 - 1.0), abs=1e-10)
    assert load[0] == 0.0 and load[-1] == 1.0 and np.all(np.diff(y) < 0.0)


def test_without_the_path_it_snaps_and_that_is_told():
    run = hfsim.static(parse_deck(TRUSS))
    assert run.final["top.y"] == pytest.approx(-0.79663404232, abs=1e-9)
    assert run.statistics["limit"] == pytest.approx(0.21457, abs=1e-4)
    assert any("snaps" in one for one in run.statistics["warnings"])
    assert run.statistics["newton_iterations"] < 200


@pytest.mark.parametrize("over", [1.01, 1.5, 2.0, 5.0])
def test_a_flat_truss_snaps_however_far_beyond_its_limit_and_that_is_told(over):
    rise, length = 0.3, 1.09**0.5
    height = (length ** (2.0 / 3.0) - 1.0) ** 0.5
    limit = 10.0 * 2.0 * height * (length / (1.0 + height**2) ** 0.5 - 1.0)
    springs = {f"springs.{one}.rest_length": length for one in "ab"}
    changes = {"initial.top.position": [0.0, rise], "loads.push.force": [0.0, -over * limit], **springs}
    run = hfsim.static(parse_deck(TRUSS), changes)
    assert run.final["top.y"] < -rise and run.statistics["stable"]
    assert run.statistics["limit"] == pytest.approx(1.0 / over, abs=1e-3)
    assert any("snaps" in one for one in run.statistics["warnings"])


def leaning(load, lean):
    """Return how far the tip of an inextensible column goes across, of length and EI one: the elastica."""

    def length(k):
        return ellipk(k * k) - ellipkinc(np.arcsin(np.sin(0.5 * lean) / k), k * k) - load**0.5

    k = brentq(length, np.sin(0.5 * lean) * (1.0 + 1e-12), 1.0 - 1e-12, xtol=1e-15)
    return (2.0 / load * (np.cos(lean) - np.cos(2.0 * np.arcsin(k)))) ** 0.5


@pytest.mark.parametrize(("share", "lean"), [(1.04, 0.0035), (1.16, 0.0035), (1.5, 0.0035), (2.3, 1e-6)])
def test_a_column_that_leans_bends_to_where_it_leans(share, lean):
    load = share * EULER
    run = hfsim.static(
        parse_deck(LEANING), {"joints.clamp.angle": lean, "loads.p.force": [-load, 0.0]}
    )
    assert run.final["b.tip.y"] == pytest.approx(leaning(load, lean), rel=2e-5)
    assert run.statistics["stable"] and not doubts(run)


@pytest.mark.parametrize("lean", [1e-4, 1e-5, 1e-6])
def test_the_path_of_a_column_that_leans_a_little_turns_off_with_it(lean):
    changes = {"joints.clamp.angle": lean, "loads.p.force": [-1.3 * EULER, 0.0]}
    run = hfsim.static(parse_deck(LEANING), changes, path=True)
    assert run["b.tip.y"][-1] == pytest.approx(leaning(1.3 * EULER, lean), rel=2e-5)
    assert np.all(np.diff(run["b.tip.y"]) > 0.0)
    assert run.statistics["stable"] and not run.statistics["branches"]


def test_a_column_that_leans_a_little_takes_one_step_of_a_moderate_load():
    run = hfsim.static(
        parse_deck(LEANING), {"joints.clamp.angle": 1e-3, "loads.p.force": [-0.3 * EULER, 0.0]}
    )
    assert run.statistics["steps"] == 1


def test_where_a_straight_column_becomes_unstable_is_told():
    run = hfsim.static(parse_deck(LEANING), {"loads.p.force": [-1.6 * EULER, 0.0]})
    assert run.statistics["unstable_from"] == pytest.approx(1.0 / 1.6, abs=1e-4)
    (told,) = doubts(run)
    assert "not stable from 0.625 of the loads on" in told


def test_a_factor_beyond_a_limit_point_is_told_to_be_an_estimate():
    run = hfsim.static(parse_deck(TRUSS), {"loads.push.force": [0.0, -0.2]}, buckling=1)
    assert run.statistics["critical_reached"] == [False]
    (told,) = run.statistics["warnings"]
    assert "extrapolated" in told and "--path" in told
    assert "(not reached)" in as_text(run, {**run.statistics, "mesh_error_estimate": None}, None)


def test_a_branch_on_the_way_is_told_with_its_load():
    path = Path(problem_of(column(3.0), 1.0), Effort())
    assert path.follow() == ""
    ((kind, load, _),) = path.crossings
    assert kind == "branch" and load == pytest.approx(EULER / 3.0, rel=1e-6)
    assert [point.negative for point in path.points][-1] == 1


def test_reactions_on_the_path_are_those_of_the_load_there():
    scene = build(parse_deck(HEAVY))
    half = scaled(scene, None, 0.5)
    t, x = np.zeros(1), scene.system.absolute(scene.q[None])
    assert half.force(t, x, 0.0 * x) == pytest.approx(0.5 * scene.system.force(t, x, 0.0 * x), abs=1e-8)
    run = hfsim.static(parse_deck(HEAVY, overrides=["output={channels: [clamp.force_x]}"]), path=True)
    assert run["clamp.force_x"] == pytest.approx(0.5 * run["load"], abs=1e-6)


FRAME = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {m: {density: 2700.0, youngs_modulus: 7.124e10, poisson_ratio: 0.31}}
sections: {s: {shape: rectangle, width: 0.6 mm, height: 30 mm}}
bodies:
  a: {type: beam, material: m, section: s, length: 0.24, elements: 4, degree: 3}
  b: {type: beam, material: m, section: s, length: 0.24, elements: 4, degree: 3}
joints:
  clamp: {type: fixed, between: [ground, a.root]}
  knee: {type: fixed, between: [a.tip, b.root], orientation: {axis: [0, 0, 1], angle: "-90 deg"}}
loads: {push: {type: force, at: b.tip, force: [1.0, 0.0, 0.0]}}
solve: {duration: 1.0}
"""


@pytest.mark.slow
@pytest.mark.parametrize(("push", "published"), [(1.0, 1.088), (-1.0, 0.6805)])
def test_a_right_angle_frame_gives_way_sideways(push, published):
    """Argyris et al. 1979, Simo and Vu-Quoc 1986; the torsion constant of the thin section is ours."""
    loaded = parse_deck(FRAME, overrides=[f"loads.push.force=[{push}, 0.0, 0.0]"])
    found = critical_factors(problem_of(build(loaded)), Effort(), 1)
    assert found[0].found and found[0].load == pytest.approx(published, rel=5e-3)


ARCH = """
hfsim: 1
ground: {points: {a: [-95.3716950748227, -30.0705799504273], b: [95.3716950748227, -30.0705799504273]}}
materials: {m: {density: 1.0, youngs_modulus: 1.0e6}}
sections: {s: {area: 100.0, second_moment: 1.0, shear_factor: 1.0}}
bodies:
  l: &half {type: beam, material: m, section: s, length: 187.6228945893904, elements: 4, degree: 5,
    element: cosserat, axis: {arc: {radius: 100.0, angle: -107.5 deg}}}
  r: *half
joints:
  base: {type: revolute, between: [ground.a, l.root]}
  crown: {type: fixed, between: [l.tip, r.root], angle: -107.5 deg}
  end: {type: fixed, between: [r.tip, ground.b]}
initial: {l: {angle: 107.5 deg}, r: {angle: 0.0}}
loads: {push: {type: force, at: r.root, force: [0.0, -1000.0]}}
solve: {duration: 1.0}
output: {channels: [r.root.y]}
"""


@pytest.mark.slow
def test_a_deep_arch_snaps_at_its_published_load_and_has_no_estimate_of_it():
    """Hinged and clamped, 215 deg: 8.97 EI/R^2 (DaDeppo and Schmidt, J. Appl. Mech. 42, 1975).

    Its parts turn on the way: extrapolated stiffnesses are singular a little ahead of any load.
    """
    run = hfsim.static(parse_deck(ARCH), path=True, buckling=1)
    assert run.statistics["limits"][0] == pytest.approx(0.897, rel=5e-4) and not run.statistics["branches"]
    assert run.statistics["critical"] == [] and "--path" in run.statistics["critical_reason"]
    assert run.statistics["critical_reached"] == []


BENT = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
materials: {steel: {density: 7850.0, youngs_modulus: 2.0e11, poisson_ratio: 0.3}}
sections: {bar: {shape: rectangle, width: 20 mm, height: 5 mm}}
bodies: {col: {type: beam, material: steel, section: bar, length: 1.0, elements: 2, degree: 4}}
joints: {clamp: {type: fixed, between: [ground, col.root]}}
loads:
  push: {type: force, at: col.tip, force: [-80.0, 0.0, 0.0]}
  side: {type: force, at: col.tip, force: [0.0, 10.0, 0.0]}
solve: {duration: 1.0}
"""


@pytest.mark.slow
def test_what_bends_from_the_start_and_never_gives_way_has_no_critical_load():
    """The straight line through the stiffness of the unloaded scene has a zero at 2 % of these loads."""
    run = hfsim.static(parse_deck(BENT), buckling=2)
    assert run.statistics["critical"] == [] and run.statistics["stable"]


@pytest.mark.slow
def test_a_critical_load_behind_one_that_is_none_is_found():
    """Along the stiff side, which the bending in the weak one leaves alone: 16 times Euler's load there."""
    scene = build(parse_deck(BENT, overrides=["loads.side.force=[0.0, 0.01, 0.0]"]))
    found = critical_factors(problem_of(scene), Effort(), 2)
    assert found[1].load == pytest.approx(16.0 * found[0].load, rel=5e-3)
    assert [one.found for one in found] == [False, True]  # to the weak side it bends, and holds


ROLLED = """
hfsim: 1
gravity: [0.0, 0.0]
parameters: {L: 1.0}
materials: {m: {density: 1.0, youngs_modulus: 1.0}}
sections: {s: {area: "${1e4 * L**2}", second_moment: "${L**4}"}}
bodies: {b: {type: beam, material: m, section: s, length: "${L}", elements: 8, degree: 7, curvature: exact}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
loads: {turn: {type: moment, at: b.tip, moment: "${tau * L**3}"}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("length", [pytest.param(1.0, marks=pytest.mark.slow), 1e3])
def test_what_is_rolled_up_never_gives_way(length):
    """An arc of a circle at any moment; estimates lie equally far ahead of each, and so come back to some."""
    run = hfsim.static(parse_deck(ROLLED, overrides=[f"parameters.L={length}"]), buckling=3)
    assert run.statistics["critical"] == [] and run.statistics["stable"]


SHAFT = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
ground: {points: {far: [1.0, 0.0, 0.0]}}
materials: {m: {density: 2700.0, youngs_modulus: 7.0e+10, poisson_ratio: 0.3}}
sections: {s: {shape: circle, diameter: 0.01}}
bodies: {b: {type: beam, material: m, section: s, length: 1.0, elements: 10, degree: 3}}
joints:
  clamp: {type: fixed, between: [ground, b.root]}
  bearing: {type: cylindrical, between: [ground.far, b.tip], axis: [1, 0, 0]}
loads: {torque: {type: moment, at: b.tip, moment: [1.0, 0.0, 0.0]}}
solve: {duration: 1.0}
"""


@pytest.mark.slow
def test_a_shaft_gives_way_after_two_turns():
    """Held against bending at both ends: tan(M L / 2 EI) = M L / 2 EI; by then it is twisted by 11.7 rad."""
    half = brentq(lambda a: np.sin(a) - a * np.cos(a), 4.0, 4.7)
    found = critical_factors(problem_of(build(parse_deck(SHAFT))), Effort(), 1)
    assert found[0].found
    assert found[0].load == pytest.approx(2.0 * half * 7.0e10 * np.pi * 0.01**4 / 64.0, rel=1e-3)


SMALL = """hfsim: 1
gravity: [0, 0]
parameters: {{L: {length}, h: "${{L / {slenderness}}}"}}
materials: {{m: {{density: 1000.0, youngs_modulus: 1.0e+9}}}}
sections: {{s: {{shape: rectangle, width: "${{h}}", height: "${{h}}"}}}}
bodies: {{b: {{type: beam, element: {element}, material: m, section: s, length: "${{L}}", elements: 6}}}}
joints: {{c: {{type: fixed, between: [ground, b.root]}}}}
loads: {{p: {load}}}
solve: {{duration: 1.0}}
"""
DEAD = 'type: force, at: b.tip, force: ["${-1e9 * h**4 / 12 / L**2}", 0]'
FOLLOWING = 'type: distributed, on: b, force: ["${-LOADe9 * h**4 / 12 / L**3}", 0], follower: true'


@pytest.mark.parametrize("length", [1e2, 1.0, 1e-3, 1e-4])
@pytest.mark.parametrize("element", ["cosserat", "cable"])
def test_critical_factors_do_not_hang_on_the_unit_of_length(length, element):
    deck = SMALL.format(length=length, slenderness=100, element=element, load="{" + DEAD + "}")
    found = critical_factors(problem_of(build(parse_deck(deck))), Effort(), 2)
    assert [one.load for one in found] == pytest.approx([EULER, 9.0 * EULER], rel=2e-3)
    assert all(one.found for one in found)


ROD = """hfsim: 1
gravity: [0, 0, 0]
parameters: {{L: {length}, r: "${{L / 100}}"}}
materials: {{m: {{density: 2000.0, youngs_modulus: 1.0e+12, poisson_ratio: 0.2}}}}
sections: {{s: {{shape: circle, radius: "${{r}}"}}}}
bodies: {{b: {{type: beam, material: m, section: s, length: "${{L}}", elements: 4, degree: 5}}}}
joints: {{c: {{type: fixed, between: [ground, b.root]}}}}
loads: {{p: {{type: force, at: b.tip, force: ["${{-1e12 * pi * r**4 / 4 / L**2}}", 0, 0]}}}}
solve: {{duration: 1.0}}
"""
DEEP = """hfsim: 1
gravity: [0, 0, 0]
parameters: {{L: {length}}}
sections:
  s: {{mass_per_length: 1.0, rotary_inertia: ["${{2 * L**2}}", "${{L**2}}", "${{L**2}}"],
       axial_stiffness: 1.0e+9, shear_stiffness: [1.0e+9, 1.0e+9], torsion_stiffness: "${{L**2}}",
       bending_stiffness: ["${{L**2}}", "${{1e8 * L**2}}"]}}
bodies: {{b: {{type: beam, section: s, length: "${{L}}", elements: 4, degree: 5}}}}
joints: {{c: {{type: fixed, between: [ground, b.root]}}}}
loads: {{p: {{type: force, at: b.tip, force: [0, 1, 0]}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("length", [1.0, pytest.param(1e-3, marks=pytest.mark.slow), 1e-7])
@pytest.mark.parametrize(
    ("deck", "factors"), [(ROD, [EULER, EULER, 9.0 * EULER]), (DEEP, [4.01258, 10.24612, 16.51613])]
)
def test_nor_do_those_in_space(deck, factors, length):
    """Forces on lengths and on turns of sections have no common unit."""
    found = critical_factors(problem_of(build(parse_deck(deck.format(length=length)))), Effort(), 3)
    assert [one.load for one in found] == pytest.approx(factors, rel=2e-3)
    assert all(one.found for one in found)


@pytest.mark.parametrize("length", [1.0, 1e-2, 1e-4])
def test_followers_turn_stiffness_alike_at_any_size(length):
    """Leipholz's column under 30 of the 40.05 E I / L^2 at which it flutters."""
    load = "{" + FOLLOWING.replace("LOAD", "30") + "}"
    deck = SMALL.format(length=length, slenderness=100, element="cable", load=load)
    found = hfsim.modes(parse_deck(deck), about="equilibrium", count=1)
    size = 1e9 * (length / 100.0) ** 2 / 12.0 / 1000.0 / length**4
    assert (2.0 * np.pi * found.frequencies[0]) ** 2 / size == pytest.approx(44.0712, rel=3e-4)


@pytest.mark.parametrize(("load", "stable"), [("30", True), ("45", False)])
@pytest.mark.parametrize(("length", "slenderness"), [(1.0, 10000), (1e-3, 400)])
def test_flutter_is_told_of_what_is_slender_or_small(load, stable, length, slenderness):
    """Stretching is 1e9 times as stiff as bending, beside which loads that follow seem to be rounding."""
    load = "{" + FOLLOWING.replace("LOAD", load) + "}"
    deck = SMALL.format(length=length, slenderness=slenderness, element="cosserat", load=load)
    assert hfsim.static(parse_deck(deck)).statistics["stable"] == stable


BAR = """hfsim: 1
gravity: [0, 0, 0]
ground: {points: {x: [1000, 0, 2], y: [0, 1000, 2]}}
bodies: {b: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {f: [0, 0, -1], top: [0, 0, 1]}}}
joints: {j: {type: spherical, between: [ground, b.f]}}
springs:
  x: {type: two_point, between: [ground.x, b.top], stiffness: 1.0}
  y: {type: two_point, between: [ground.y, b.top], stiffness: 1.0}
loads: {P: {type: force, at: b.top, force: [0, 0, -1.0]}}
initial: {b: {position: [0, 0, 1]}}
solve: {duration: 1.0}
"""


def test_what_may_turn_about_itself_gives_way_all_the_same():
    """A bar of 2 m on a ball joint, its top held by springs: P L = k L^2 to both sides."""
    found = hfsim.static(parse_deck(BAR), buckling=2).statistics
    assert found["critical"] == pytest.approx([2.0, 2.0], rel=1e-6) and all(found["critical_reached"])
    assert hfsim.static(parse_deck(BAR), path=True).status == "done"


CRANE = """hfsim: 1
gravity: {gravity}
materials: {{steel: {{density: {density}, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}}}
sections: {{boom: {{shape: tube, outer_radius: 20 cm, inner_radius: 19 cm}}}}
bodies:
  boom: {{type: beam, material: steel, section: boom, length: 20, elements: 2}}
  rod: {{type: rigid, mass: 8, inertia: {rod}, points: {{up: {up}, down: {down}}}}}
  load: {{type: rigid, mass: 500, inertia: {load}, points: {{eye: {eye}}}}}
joints:
  heel: {{type: fixed, between: [ground, boom.root], {turn}}}
  sheave: {{type: {hinge}, between: [boom.tip, rod.up]}}
  hook: {{type: {hinge}, between: [rod.down, load.eye]}}
initial: {{rod: {{position: {place}}}}}
solve: {{duration: 1.0}}
output: {{channels: [{channels}]}}
"""
PLANE = dict(
    gravity=[0, -9.81], rod=40, load=50, up=[0, 4], down=[0, -4], eye=[0, 0.5], hinge="revolute",
    channels="boom.tip.y",
)  # fmt: skip
SPACE = dict(
    gravity=[0, 0, -9.81], rod=[40, 40, 1], load=[50] * 3, up=[0, 0, 4], down=[0, 0, -4], eye=[0, 0, 0.5],
    hinge="spherical", channels="boom.tip.z",
)  # fmt: skip


def crane(n_dim, luff, density=7850.0):
    """Return a boom from whose tip a rod and a load hang, in which only weight says where they hang."""
    turn = f"angle: {luff} deg" if n_dim == 2 else f"orientation: {{axis: [0, 1, 0], angle: {-luff} deg}}"
    across, up = 20.0 * np.cos(np.radians(luff)), 20.0 * np.sin(np.radians(luff)) - 4.0
    place = [float(across), *[0.0] * (n_dim - 2), float(up)]
    return CRANE.format(**(PLANE if n_dim == 2 else SPACE), turn=turn, place=place, density=density)


@pytest.mark.parametrize("n_dim", [2, 3])
def test_what_hangs_in_a_chain_passes_its_weight_on(n_dim):
    """A boom of next to no mass under Euler's load at its tip; in space what hangs may spin as well."""
    run = hfsim.static(parse_deck(crane(n_dim, 90, 1e-3)), buckling=1)
    stiff = 2.1e11 * np.pi / 4.0 * (0.2**4 - 0.19**4)
    assert run.statistics["critical"] == pytest.approx([EULER * stiff / 20.0**2 / (508.0 * 9.81)], rel=2e-3)
    assert run.statistics["critical_reached"] == [True]


@pytest.mark.parametrize("n_dim", [2, 3])
def test_a_boom_that_bends_under_what_hangs_from_it_is_followed_and_has_no_critical_load(n_dim):
    """It rests stably under the whole load, which is put on from a hundredth of it."""
    rest = hfsim.static(parse_deck(crane(n_dim, 45)), buckling=1)
    assert rest.statistics["stable"] and rest.statistics["critical"] == []
    assert "nothing gives way up to" in rest.statistics["critical_reason"]
    run = hfsim.static(parse_deck(crane(n_dim, 45)), path=True)
    tip = "boom.tip.y" if n_dim == 2 else "boom.tip.z"
    assert run.status == "done" and run["load"][[0, -1]] == pytest.approx([0.01, 1.0])
    assert run.final[tip] == pytest.approx(rest.final[tip], abs=1e-9)
    assert not run.statistics["limits"] and not run.statistics["branches"]


def test_a_path_begins_with_what_rests_under_the_loads_that_are_not_varied():
    """A pendulum that starts on its side and is held by its weight is pushed across."""
    deck = """hfsim: 1
gravity: [0, -10]
bodies: {b: {type: rigid, mass: 1, inertia: 0.1, points: {top: [-1, 0]}}}
joints: {j: {type: revolute, between: [ground, b.top]}}
loads: {push: {type: force, at: b, force: [10, 0]}}
initial: {b: {angle: 0}}
solve: {duration: 1}
output: {channels: [b.angle]}
"""
    run = hfsim.static(parse_deck(deck), path=True, vary=["push"])
    assert run.status == "done" and run["load"][0] == 0.0
    assert run["b.angle"] == pytest.approx(np.arctan(run["load"]) - 0.5 * np.pi, abs=1e-9)


@pytest.mark.parametrize("elements", [6, 40])
def test_a_follower_that_stays_keeps_its_skew_part_while_another_load_grows(elements):
    """cos k L = -F / P, k^2 = (F + P) / E I, of a column under a dead load P beside a follower F."""
    pushed = 'force: ["${-1e9 * h**4 / 12 / L**2}", 0]'
    load = f"{{type: force, at: b.tip, {pushed}}}, q: {{type: force, at: b.tip, {pushed}, follower: true}}"
    deck = SMALL.format(length=1.0, slenderness=100, element="cable", load=load)
    scene = build(parse_deck(deck, overrides=[f"bodies.b.elements={elements}"]))
    found = critical_factors(problem_of(scene, 0.0, None, ("p",)), Effort(), 1)
    dead = brentq(lambda P: np.cos(np.sqrt(1.0 + P)) + 1.0 / P, 1.1, 8.0)
    assert found[0].load == pytest.approx(dead, rel=2e-3)


DROOPING = """hfsim: 1
gravity: {gravity}
materials: {{g: {{density: 1000, youngs_modulus: 1 GPa, poisson_ratio: 0.3}}}}
sections: {{s: {{shape: circle, diameter: 1 cm}}}}
bodies: {{a: {{type: beam, material: g, section: s, length: 0.5, elements: 4, {more}}}}}
joints: {{j: {{type: fixed, between: [ground, a.root]}}}}
solve: {{duration: 1.0}}
output: {{channels: [{channels}]}}
"""


@pytest.mark.parametrize("n_dim", [2, 3])
@pytest.mark.parametrize(
    "more", ["element: cable", "element: cosserat", "element: cable, model: lowOrder"]
)
def test_what_a_root_carries_on_a_path_is_what_its_joint_exerts(more, n_dim):
    """The weight of the load factor, not all of it."""
    gravity = [0.0, 0.0, -9.81] if n_dim == 3 else [0.0, -9.81]
    shear, moment = ("_z", "_y") if n_dim == 3 else ("", "")
    names = [f"a.root.shear_force{shear}", f"a.root.bending_moment{moment}"]
    force, torque = f"j.force_{'z' if n_dim == 3 else 'y'}", f"j.moment{moment}"
    text = DROOPING.format(gravity=gravity, more=more, channels=", ".join([*names, force, torque]))
    found = hfsim.static(parse_deck(text), path=True)
    assert found["load"][0] == 0.0 and found["load"][-1] == 1.0
    assert found[names[0]] == pytest.approx(-found[force], abs=1e-7)
    assert found[names[1]] == pytest.approx(-found[torque], abs=1e-7)
    weight = 1000.0 * np.pi * 0.005**2 * 0.5 * 9.81
    assert found[force] == pytest.approx(weight * found["load"], rel=1e-6, abs=1e-9)


UPRIGHT = """hfsim: 1
gravity: [0.0, 0.0]
materials: {st: {density: 7850, youngs_modulus: 210 GPa, poisson_ratio: 0.3}}
sections: {s: {shape: tube, outer_radius: 1.5, inner_radius: 1.47}}
bodies: {a: {type: beam, material: st, section: s, length: 100, elements: 4}}
joints: {j: {type: fixed, between: [ground, a.root], angle: 90 deg}}
loads: {f: {type: force, at: a.tip, force: [0, -1.0e5]}}
solve: {duration: 1.0}
"""


def test_a_column_that_leans_by_rounding_has_its_factors():
    """The cosine of a right angle is 6e-17, and next to a factor it goes away by far more."""
    upright = hfsim.static(parse_deck(UPRIGHT), buckling=2).statistics
    along = UPRIGHT.replace("angle: 90 deg", "angle: 0 deg").replace("[0, -1.0e5]", "[-1.0e5, 0]")
    lying = hfsim.static(parse_deck(along), buckling=2).statistics
    assert upright["critical"] == pytest.approx(lying["critical"], rel=1e-7)
    assert all(upright["critical_reached"])


SHALLOW = """hfsim: 1
gravity: [0.0, 0.0]
parameters: {R: "${(0.25 + 0.0009) / 0.06}", al: "${asin(0.5 / R)}"}
materials: {m: {density: 1200, youngs_modulus: 1 GPa}}
sections: {s: {shape: rectangle, width: 1 cm, height: 1 cm}}
ground: {points: {r: [1.0, 0]}}
bodies:
  a: {type: beam, element: cosserat, material: m, section: s, elements: 8, degree: 3,
      axis: {arc: {radius: "${R}", angle: "${-2 * al}"}}, points: {mid: ["${al * R}", 0]}}
joints:
  j: {type: revolute, between: [ground, a.root]}
  k: {type: revolute, between: [ground.r, a.tip]}
loads: {f: {type: force, at: a.mid, force: [0, -20]}}
initial: {a: {angle: "${al}"}}
solve: {duration: 1}
"""


def test_an_arch_that_snaps_gives_way_before():
    """Sideways at 4.36 N; straight through it would at 4.84 N, and a shallow arch at 4.379 N."""
    found = hfsim.static(parse_deck(SHALLOW), check=False)
    assert found.statistics["limit"] == pytest.approx(0.242, rel=0.01)
    assert found.statistics["unstable_from"] == pytest.approx(0.21895, rel=0.01)
    assert any("are not stable" in one for one in found.statistics["warnings"])


GABLE = """hfsim: 1
gravity: [0.0, 0.0]
ground: {points: {right: [1.0003553864373, 0.0]}}
materials: {steel: {density: 7850.0, youngs_modulus: 2.0e+11}}
sections: {strip: {shape: rectangle, width: 0.03, height: 0.01}}
bodies:
  left: &half {type: beam, element: cosserat, material: steel, section: strip, length: 0.52, elements: 3,
    degree: 4}
  right: *half
joints:
  a: {type: revolute, between: [ground, left.root]}
  b: {type: fixed, between: [left.tip, right.root], angle: -0.554}
  c: {type: revolute, between: [ground.right, right.tip]}
loads: {push: {type: force, at: left.tip, force: [0.0, -60000.0]}}
initial: {left: {angle: 0.277}, right: {angle: -0.277}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize(
    ("aside", "limit"),
    [
        (0.1, 0.1656632),
        pytest.param(10.0, 0.1656573, marks=pytest.mark.slow),
        pytest.param(100.0, 0.1656340, marks=pytest.mark.slow),
    ],
)
def test_the_path_of_an_arch_that_is_pushed_aside_a_little_turns_round_with_it(aside, limit):
    """Next to the branch of the even arch, at 0.1656635; it comes by another, and turns there too."""
    run = hfsim.static(parse_deck(GABLE), {"loads.push.force": [aside, -60000.0]}, path=True)
    assert run.status == "done" and not run.statistics["branches"]
    told = run.statistics["limits"]
    assert told[0] == pytest.approx(limit, abs=1e-7) and len(told) == 4


def test_the_branch_of_an_even_arch_is_its_critical_load():
    run = hfsim.static(parse_deck(GABLE), path=True, buckling=1)
    assert run.statistics["branches"][0] == pytest.approx(run.statistics["critical"][0], rel=1e-7)


STRETCHED = """hfsim: 1
sections:
  bar: {mass_per_length: 100, rotary_inertia: 10, axial_stiffness: 4.8e8, shear_stiffness: 3.231e8,
        bending_stiffness: 9.346e6}
bodies: {b: {type: beam, element: cosserat, section: bar, length: 5.0, elements: 4, degree: 7}}
joints: {clamp: {type: fixed, between: [ground, b.root]}}
loads: {push: {type: force, at: b.tip, force: [0.0, 6.0e5]}}
solve: {duration: 1.0}
"""


def test_a_path_that_ends_far_beyond_the_loads_has_no_critical_one():
    """The beam is twice as long there, and corrections from before the end lead to other paths."""
    run = hfsim.static(parse_deck(STRETCHED), buckling=1)
    assert run.statistics["critical"] == [] and "--path" in run.statistics["critical_reason"]


HUNG = """hfsim: 1
gravity: [0.0, -9.81]
materials: {steel: {density: 7850.0, youngs_modulus: 2.1e11}}
sections: {bar: {shape: rectangle, width: 0.05, height: 0.05}}
bodies:
  jib: {type: beam, material: steel, section: bar, length: 3.0, elements: 2}
  line: {type: rigid, mass: 0.1, inertia: 0.01, points: {end: [0.5, 0.0]}}
  load: {type: rigid, mass: 100.0, inertia: 5.0}
joints:
  wall: {type: fixed, between: [ground, jib.root]}
  sheave: {type: revolute, between: [jib.tip, line]}
  hook: {type: revolute, between: [line.end, load]}
initial: {line: {angle: -1.0}}
solve: {duration: 1.0}
"""


def test_what_is_loose_along_a_path_is_told():
    found = hfsim.static(parse_deck(HUNG), path=True).statistics
    assert found["held_by_nothing"] == ["load: turns about hook"]
    assert any("nothing resists: load: turns about hook" in one for one in found["warnings"])


ON_ITS_ARM = """hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies:
  arm: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1], points: {axle: [-0.2, 0, 0], tip: [0.2, 0, 0]}}
  disc: {type: rigid, mass: 1.0, inertia: [0.05, 0.1, 0.1]}
joints:
  axle: {type: revolute, between: [ground, arm.axle], axis: [0, 0, 1]}
  spin: {type: revolute, between: [arm.tip, disc], axis: [1, 0, 0]}
springs: {coil: {type: rotational, between: [ground, arm.axle], axis: [0, 0, 1], stiffness: 1.0}}
loads: {push: {type: moment, at: arm, moment: [0.0, 0.0, 2.0]}}
solve: {duration: 1.0}
"""


def test_what_is_loose_turns_along_a_path():
    """The disc spins about the arm wherever that is turned to, and only the spring resists: k / J of both."""
    found = hfsim.static(parse_deck(ON_ITS_ARM), path=True).statistics
    assert found["smallest_eigenvalue"] == pytest.approx(1.0 / 0.4, rel=1e-8)
    assert found["held_by_nothing"] == ["disc: turns about spin, axis [1, 0, 0]"]


@pytest.mark.filterwarnings("error")
def test_weight_along_the_axis_of_a_hinge_is_followed_to_no_overflow():
    deck = parse_deck("""
hfsim: 1
gravity: [0, -9.81, 0]
bodies:
  b: {type: rigid, mass: 1.8, inertia: [0.02, 0.05, 0.05], points: {in: [-0.25, 0, 0], out: [0.25, 0, 0]}}
joints: {j: {type: revolute, between: [ground, b.in], axis: [0, -1, 0]}}
springs:
  k: {type: rotational, between: [ground, b.in], axis: [0, -1, 0], stiffness: 29.56, rest_angle: -146.2 deg}
initial: {j: {angle: -116.4 deg}}
solve: {duration: 1}
""")
    found = hfsim.static(deck, buckling=1).statistics
    assert found["critical"] == [] and "nothing gives way" in found["critical_reason"]


@pytest.mark.parametrize("unit", [2.0**-10, 2.0**-13])
def test_what_stiffness_is_left_hangs_on_no_unit_of_length(unit):
    """A thin right-angled frame pushed in its plane: factors of its sparse matrix alone left five digits."""
    one, other = (hfsim.static(frame_in(size)).statistics["smallest_eigenvalue"] for size in (1.0, unit))
    assert other == pytest.approx(one, rel=2e-7)


def frame_in(unit):
    """Return the frame with lengths of a size, and forces and masses that keep its frequencies."""
    beam = {"type": "beam", "material": "alu", "section": "strip", "length": 0.24 * unit, "elements": 3,
            "element": "cosserat", "degree": 5}  # fmt: skip
    density, modulus = 2700.0 / unit**3, 71.24e9 / unit
    return parsed({
        "hfsim": 1,
        "gravity": [0.0, 0.0, 0.0],
        "materials": {"alu": {"density": density, "youngs_modulus": modulus, "poisson_ratio": 0.31}},
        "sections": {"strip": {"shape": "rectangle", "width": 6e-4 * unit, "height": 0.03 * unit}},
        "bodies": {"one": beam, "two": beam},
        "joints": {
            "clamp": {"type": "fixed", "between": ["ground", "one.root"]},
            "corner": {"type": "fixed", "between": ["one.tip", "two.root"], "angle": -np.pi / 2.0},
        },
        "loads": {"push": {"type": "force", "at": "two.tip", "force": [unit, 0.0, 0.0]}},
        "solve": {"duration": 1.0},
        "output": {"channels": ["two.tip.z"]},
    })  # fmt: skip
