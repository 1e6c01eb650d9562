"""What rules leave out changes no result, and they leave out nothing that a scene needs."""

import json
import re
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np
import pytest
from called import call

from hfsim.deck.fields import Between
from hfsim.errors import DeckError
from hfsim.integrators import Segment, Trajectory, joined
from hfsim.marching.integration import run_integration
from hfsim.marching.plan import plan_of
from hfsim.mechanics.constraints import Along, Shift, Turn
from hfsim.mechanics.resistances import LinearSpring
from hfsim.mechanics.ties import DistanceTie
from hfsim.parts.forces import SPRINGS
from hfsim.parts.joints import JOINTS
from hfsim.parts.specs import JointSpec, SpringSpec
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.rules import RULES
from hfsim.scene.shipped import CASES
from hfsim.simulate import simulate
from hfsim.studies.plan import ALL, firing, largest_difference, measure

SPARE, NEEDED = (CASES / "rules" / f"{name}.yaml" for name in ("spare", "needed"))
SMALL = ["bodies.arm.elements=2", "bodies.blade.elements=1"]
"""Enough to show a rule that has nothing to do with the number of elements."""
ANGLE_FREE = ["output.channels=[b1.tip.x, b1.tip.y, energy.total]"]
FALLING = ["gravity=[0.3, -9.81]"]
CLAMPED = [
    "joints.pin={type: fixed, between: [bracket.top, arm.root], angle: -0.7}",
    "initial.arm={angle: -0.4}",
    "initial.bob={}",
]
IN_USE = {
    "weight": (SPARE, SMALL),
    "springs": (SPARE, SMALL),
    "loads": (SPARE, SMALL),
    "damping": (SPARE, SMALL),
    "standing_drivers": (SPARE, SMALL),
    "fixed_bodies": (SPARE, SMALL),
    "fixed_bodies under gravity": (SPARE, SMALL + FALLING),
    "fixed_bodies with a clamp": (SPARE, SMALL + CLAMPED),
    "tree_joints": (SPARE, SMALL),
    "tree_joints of a stiff chain": (CASES / "two_beams_relative.yaml", []),
    "constant_mass": (SPARE, SMALL),
    "constant_mass and nothing else": (CASES / "pendulum.yaml", []),
    "rates": (CASES / "pendulum.yaml", []),
    "work": (CASES / "pendulum.yaml", []),
    "parts": (SPARE, ["bodies.arm.elements=7", "solve.duration=0.1"]),
    "turns": (CASES / "pendulum.yaml", ANGLE_FREE),
    "plots": (SPARE, SMALL),
    "all": (CASES / "hub_beams_soft.yaml", ["bodies.b1.elements=2", "bodies.b2.elements=2"]),
}
"""Scenes in which a rule leaves something out."""
NOT_HERE = {
    "weight": ["gravity=[0.0, -1.0]"],
    "springs": ["springs.idle.damping=0.1"],
    "loads": ["loads.off.law=1.0", "loads.none.force=[1.0, 0.0]"],
    "damping": ["materials.rubber.axial_damping=1e-4"],
    "standing_drivers": ["joints.stop.angle={type: constant_rate, rate: 1.0, start: 0.5}"],
    "fixed_bodies": ["output.channels=[weld.force_x]"],
    "tree_joints": [
        "solve.coordinates=frame",
        "joints.axle.between=[ground.far, wheel.rim]",
        "joints.post.between=[ground, gauge.eye]",
    ],
    "constant_mass": ["solve.model=lowOrder"],
    "rates": ["springs.coil.damping=0.1"],
    "work": ["loads.none.force=[1.0, 0.0]"],
    "parts": ["solve.step=0.01"],
    "parts, all tied": [
        "springs.idle={type: rotational, between: [bob, wheel], stiffness: 1.0}",
        "joints.stop.between=[wheel, gauge]",
    ],
    "parts, small": SMALL,
    "turns": ["output.channels=[arm.angle, blade.tip.deflection]"],
    "plots": ["output.plots=true"],
}
"""Changes of a scene after which a rule must not fire."""


def cases(table):
    return [pytest.param(label.split(",")[0].split()[0], *entry, id=label) for label, entry in table]


@pytest.mark.parametrize("rule, path, settings", cases(IN_USE.items()))
def test_results_are_the_same_with_and_without(rule, path, settings):
    loaded = load_deck(path, settings)
    assert rule in firing(build(loaded))
    difference, rest = largest_difference(loaded, rule, steps=20)
    assert difference < 1e-12
    # rates carry the rounding of the fastest mode, energies that of the stiffest
    assert rest < 1e-10


@pytest.mark.parametrize("rule, settings", cases((k, (v,)) for k, v in NOT_HERE.items()))
def test_a_rule_does_not_fire_where_its_condition_is_not_met(rule, settings):
    assert rule not in firing(build(load_deck(SPARE, settings)))


def test_every_rule_has_both_kinds_of_scene():
    shown = {label.split()[0] for label in IN_USE} - {ALL}
    assert shown == set(RULES)
    assert {label.split(",")[0] for label in NOT_HERE} == set(RULES)


def test_a_scene_that_needs_all_keeps_all():
    scene = build(load_deck(NEEDED))
    assert firing(scene) == [ALL]
    assert plan_of(scene)["left_out"] == []


def test_keep_all_builds_everything():
    loaded = load_deck(SPARE, ["solve.keep_all=true"])
    scene, less = build(loaded), build(load_deck(SPARE))
    assert firing(scene) == [ALL]
    assert (scene.system.n, scene.system.n_rows) == (76, 15)
    assert (less.system.n, less.system.n_rows) == (65, 4)
    # damping of two beams, weight, three springs, two loads, and one elastic force of both beams
    assert (len(scene.system.forces), len(less.system.forces)) == (9, 3)
    assert not scene.parts and len(less.parts) == 3


def test_one_rule_can_be_kept_and_unknown_ones_are_refused():
    scene = build(load_deck(SPARE, ["solve.keep=[weight, parts]"]))
    assert not {"weight", "parts"} & set(firing(scene))
    assert "springs" in firing(scene)
    with pytest.raises(DeckError, match=r"no rule 'wieght'.*did you mean 'weight'"):
        load_deck(SPARE, ["solve.keep=[wieght]"])


# bodies that cannot move ---------------------------------------------------------------------------

TOWER = """
hfsim: 1
name: tower
bodies:
  base: {type: rigid, mass: 1.0, inertia: 1.0, points: {top: [0.0, 1.0]}}
  storey: {type: rigid, mass: 1.0, inertia: 1.0, points: {top: [0.0, 1.0]}}
  bob: {type: rigid, mass: 1.0, inertia: 1.0}
joints:
  b: {type: fixed, between: [storey, base.top], angle: 0.5}
  a: {type: fixed, between: [ground, base], angle: 0.2}
  hinge: {type: revolute, between: [storey.top, bob]}
solve: {model: exact, duration: 0.1}
output: {channels: [storey.top.x, storey.top.y, storey.angle, bob.x]}
"""


def test_bodies_on_welded_bodies_are_folded_too():
    scene = build(parse_deck(TOWER))
    assert scene.left_out["fixed_bodies"] == ("bodies.base", "bodies.storey")
    assert scene.system.n_x == 3
    run = simulate(parse_deck(TOWER), error_estimate=False)
    whole = simulate(parse_deck(TOWER, overrides=["solve.keep_all=true"]), error_estimate=False)
    for mine, theirs in zip(run.channels, whole.channels, strict=True):
        assert mine.values == pytest.approx(theirs.values, abs=1e-12), mine.name


def test_a_scene_in_which_nothing_moves_is_left_as_it_is():
    still = TOWER.replace("revolute", "fixed")
    assert not build(parse_deck(still)).left_out["fixed_bodies"]


def test_a_body_welded_twice_is_still_refused():
    twice = TOWER.replace("solve:", "  c: {type: fixed, between: [ground, base], angle: 0.2}\nsolve:")
    with pytest.raises(DeckError, match="already block"):
        build(parse_deck(twice))


# parts ---------------------------------------------------------------------------------------------


def test_each_part_has_its_own_steps_and_all_are_counted():
    scene = build(load_deck(SPARE))
    assert [part.bodies for part in scene.parts] == [("arm", "bob"), ("wheel", "blade"), ("gauge",)]
    columns = np.concatenate([part.columns for part in scene.parts])
    assert np.array_equal(np.sort(columns), np.arange(scene.system.n))
    for part in scene.parts:
        assert scene.q[part.columns] == pytest.approx(part.scene.q, abs=1e-14)
        assert scene.v[part.columns] == pytest.approx(part.scene.v, abs=1e-14)
    solve = scene.deck.solve.model_copy(update={"duration": 0.05})
    runs = [run_integration(part.scene, solve) for part in scene.parts]
    whole = run_integration(scene, solve)
    assert whole.problem.counts.steps == sum(run.problem.counts.steps for run in runs)
    assert len({run.problem.counts.steps for run in runs}) > 1
    times = np.linspace(0.0, 0.05, 31)
    q, v = whole.trajectory.at(times)
    for part, run in zip(scene.parts, runs, strict=True):
        own = run.trajectory.at(times)
        assert q[:, part.columns] == pytest.approx(own[0], abs=1e-14)
        assert v[:, part.columns] == pytest.approx(own[1], abs=1e-12)


def test_parts_do_not_ask_for_internal_forces_of_each_other():
    asked = "output.channels=[arm.root.axial_force, blade.root.axial_force]"
    assert len(build(load_deck(SPARE, [asked])).parts) == 3
    found = simulate(load_deck(SPARE, [asked, "solve.duration=0.01"]))
    assert found.status == "done" and all(np.ptp(one.values) > 0.0 for one in found.channels)


def test_a_part_that_stops_is_named_and_stops_the_scene():
    run = simulate(load_deck(SPARE, ["solve.max_steps=5"]), error_estimate=False)
    assert run.status == "limit"
    assert "in the part of arm, bob" in run.reason or "in the part of wheel, blade" in run.reason
    assert 0.0 < run.end_time < 0.5
    assert all(len(c.values) == len(run.t) for c in run.channels)


def test_joined_steps_are_the_same_polynomials():
    def path(ends, seed, n):
        rng, q, v = np.random.default_rng(seed), np.zeros(n), np.ones(n)
        steps = []
        for a, b in pairwise(ends):
            steps.append(Segment(a, b - a, q, v, rng.normal(size=(5 + seed, n))))
            (q,), (v,) = steps[-1].at(np.array([b]))
        return Trajectory(ends[0], ends[-1], q, v, steps)

    one, other = path([0.0, 0.4, 1.0], 0, 2), path([0.0, 0.1, 0.5, 0.9, 1.0], 1, 3)
    both = Trajectory(0.0, 0.0, np.zeros(5), np.ones(5))
    for end in (0.4, 1.0):  # in two goes: the first ends within a step of the other
        steps, both.q, both.v = joined([(one, np.array([3, 0])), (other, np.array([1, 2, 4]))], both, end)
        both.segments, both.t_end = both.segments + steps, end
    assert both.step_ends() == pytest.approx([0.0, 0.1, 0.4, 0.5, 0.9, 1.0], abs=0)
    times = np.linspace(0.0, 1.0, 41)
    for part, columns in ((one, [3, 0]), (other, [1, 2, 4])):
        for mine, theirs in zip(both.at(times), part.at(times), strict=True):
            assert mine[:, columns] == pytest.approx(theirs, abs=1e-13)


# the plan ------------------------------------------------------------------------------------------


def test_the_plan_tells_what_a_rule_saves():
    plan = plan_of(build(load_deck(CASES / "two_beams.yaml")))
    saves = {entry["rule"]: entry["saves"] for entry in plan["left_out"]}
    assert saves["tree_joints"] == {"unknowns": 4, "multipliers": 4}
    assert saves["weight"] == {"terms of Q": 1, "body-force integrals": 2}
    assert {entry["rule"] for entry in plan["left_out"] + plan["not_left_out"]} == set(RULES)
    assert "sparse from 251" in plan["algebra"]
    assert "cube" in plan_of(build(load_deck(NEEDED)))["algebra"]


def test_the_saving_is_what_building_without_the_rule_costs():
    for rule in ("tree_joints", "fixed_bodies", "weight", "springs", "loads", "damping"):
        planned, without = (plan_of(build(load_deck(SPARE, keep))) for keep in ([], [f"solve.keep=[{rule}]"]))
        saves = next(entry["saves"] for entry in planned["left_out"] if entry["rule"] == rule)
        for size in saves.keys() & planned["sizes"].keys():
            assert without["sizes"][size] - planned["sizes"][size] == saves[size], (rule, size)


@pytest.mark.timed
def test_the_measured_call_is_shorter_with_all_rules():
    for cost in measure(load_deck(CASES / "pendulum.yaml", ["solve.duration=0.02"]), repeats=3, rules=[ALL]):
        assert cost.call_us[0] > cost.call_us[1] > 0.0


class OnLine(Along):
    """A kind of constraint that no other module knows."""

    constant = False


class HeldOnLine:
    def between(self, first, second):
        return (OnLine(first, second, (0.0, 1.0)),)


class OnLineSpec(JointSpec):
    type: Literal["on_line"]
    between: Between

    def held(self):
        return (HeldOnLine(),)


def test_a_new_kind_of_constraint_runs_and_is_planned(monkeypatch):
    monkeypatch.setitem(JOINTS, "on_line", OnLineSpec)
    run = simulate(parse_deck(TOWER.replace("revolute", "on_line")), error_estimate=False)
    assert run.status == "done"
    kept = {entry["item"]: entry for entry in run.statistics["plan"]["kept"]}
    assert kept["joints.hinge"]["multipliers"] == 1 and "along an axis" in kept["joints.hinge"]["reason"]


class GlueSpec(JointSpec):
    type: Literal["glue"]
    between: Between
    meets = welds = True

    def held(self):
        return Shift(), Turn()


class SlackSpec(SpringSpec):
    type: Literal["slack"]
    between: Between
    acts: ClassVar = False

    def build(self, first, second, start):
        return DistanceTie(first, second, (LinearSpring(0.0, 0.0, 1.0),))


def test_what_entries_of_new_kinds_say_of_themselves_is_enough(monkeypatch):
    monkeypatch.setitem(JOINTS, "glue", GlueSpec)
    monkeypatch.setitem(SPRINGS, "slack", SlackSpec)
    deck = TOWER.replace("fixed", "glue").replace(", angle: 0.5", "").replace(", angle: 0.2", "")
    deck += "springs: {rope: {type: slack, between: [ground, bob]}}\n"
    scene = build(parse_deck(deck))
    assert scene.left_out["fixed_bodies"] == ("bodies.base", "bodies.storey")
    assert scene.left_out["springs"] == ("springs.rope",)
    kept = plan_of(build(parse_deck(deck, overrides=["solve.keep=[springs]"])))["kept"]
    assert "by wish" in next(entry["reason"] for entry in kept if entry["item"] == "springs.rope")


def test_plan_tells_people_and_programs():
    done = call("plan", SPARE, "-v")
    assert done.exit_code == 0
    for name in RULES:
        assert f"  {name}: " in done.output
    facts = json.loads(call("plan", SPARE, "--json", "-q").stdout)
    assert facts["sizes"]["unknowns"] == 65 and facts["keep_all"]["sizes"]["unknowns"] == 76
    kept = json.loads(call("plan", SPARE, "--json", "-q", "--keep-all").stdout)
    assert kept["left_out"] == [] and kept["sizes"]["unknowns"] == 76


def test_a_plan_counts_all_multipliers_and_speaks_to_users():
    """Every equation has its place; kernels and terms are for those who ask for more, in lines that fit."""
    for case in ("governor", "right_angle", "hub_beams", "joints"):
        facts = json.loads(call("plan", case, "--json", "-q").stdout)
        told = sum(entry.get("multipliers", 0) for entry in facts["kept"])
        assert told == facts["sizes"]["multipliers"], case
        text, more = (call("plan", case, *option).stdout for option in ((), ("-v",)))
        assert not re.search("kernel|terms of|eq\\.|The same", text) and "terms of Q" in more
        assert max(map(len, (text + more).split("\n"))) <= 110


def test_plan_measures():
    settings = ("--set", "solve.duration=0.02", "--set", "bodies.b1.elements=1", "--repeats", 1)
    facts = json.loads(call("plan", "pendulum", "--measure", "--json", "-q", *settings).stdout)
    assert {one["rule"] for one in facts["measured"]} == {"damping", "tree_joints", "constant_mass", "rates",
                                                         "work", "all"}  # fmt: skip
    table = call("plan", NEEDED, "--proof", "--repeats", 1).output
    assert "all rules together" in table and "fired in none of them: weight, springs" in table


def test_every_summary_has_the_plan(tmp_path):
    for flags, unknowns in (((), 18), (("--keep-all",), 20)):
        settings = ("--set", "solve.duration=0.02", "--no-plots", "-q", "--force", "-o", tmp_path / "out")
        assert call("run", "pendulum", *settings, *flags).exit_code == 0
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["plan"]["sizes"]["unknowns"] == unknowns


def test_plots_are_drawn_only_if_the_deck_wants_them(tmp_path):
    settings = ("--set", "solve.duration=0.02", "--set", "output.plots=false", "-q", "-o", tmp_path / "out")
    assert call("run", "pendulum", *settings).exit_code == 0
    assert not (tmp_path / "out" / "plots").exists()


def test_compare_keeps_all_on_demand(tmp_path):
    settings = ("--set", "solve.duration=0.02", "--no-plots", "-q", "--repeats", 1, "--keep-all")
    assert call("compare", "ancf", "--case", "pendulum", "-o", tmp_path / "c", *settings).exit_code == 0
    summary = json.loads((tmp_path / "c" / "ancf" / "summary.json").read_text())
    assert summary["plan"]["sizes"]["multipliers"] == 2


def test_forces_keep_their_names_when_others_are_left_out():
    for settings, left in (([], ["pull", "coil"]), (["solve.keep_all=true"], ["pull", "coil", "idle"])):
        forces = build(load_deck(SPARE, settings)).system.forces
        named = {part.item: part for part in forces if part.item.startswith("springs.")}
        assert list(named) == [f"springs.{name}" for name in left]
        assert [part.resistances[0].stiffness for part in named.values()] == [30.0, 4.0, 0.0][: len(left)]
