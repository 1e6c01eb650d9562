"""Patterns: entries that stand once in a deck and are there many times."""

import numpy as np
import pytest
import yaml
from called import call

from hfsim.errors import DeckError
from hfsim.output import api
from hfsim.scene.loading import load_deck, parse_deck

HEAD = """
hfsim: 1
name: rotor
parameters: {n: 3, rate: 60 rpm}
materials: {nylon: {density: 1150, youngs_modulus: 2.5 GPa}}
sections: {rod: {shape: circle, diameter: 2 cm}}
solve: {duration: 0.1}
"""
ROTOR = HEAD + """
bodies:
  hub: {type: rigid, mass: 1, inertia: 0.1, points: {"p{k=1..n}": ["${0.1 * k}", "${k / n}"]}}
  blade{k=1..n}: {type: beam, material: nylon, section: rod, length: "${1 + k / 10}", elements: 1}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount{k=1..n}: {type: fixed, between: ["hub.p{k}", "blade{k}.root"], angle: "${k * 360 / n} deg"}
springs:
  tie{k=2..n}: {type: two_point, between: ["blade{k-1}.tip", "blade{k}.tip"], stiffness: 10}
loads:
  push{k=1..n}:
    type: force
    at: blade{k}.tip
    force: [0, 1]
    law: {expression: "sin(rate * t + k)"}
output: {interval: 0.05, channels: [hub.angle, "blade{k=1..n}.tip.x", "blade{n}.tip.y"]}
"""
WRITTEN_OUT = HEAD + """
bodies:
  hub:
    {type: rigid, mass: 1, inertia: 0.1,
     points: {p1: [0.1, "${1 / 3}"], p2: [0.2, "${2 / 3}"], p3: ["${0.1 * 3}", 1]}}
  blade1: {type: beam, material: nylon, section: rod, length: 1.1, elements: 1}
  blade2: {type: beam, material: nylon, section: rod, length: 1.2, elements: 1}
  blade3: {type: beam, material: nylon, section: rod, length: 1.3, elements: 1}
joints:
  axle: {type: revolute, between: [ground, hub]}
  mount1: {type: fixed, between: [hub.p1, blade1.root], angle: 120 deg}
  mount2: {type: fixed, between: [hub.p2, blade2.root], angle: 240 deg}
  mount3: {type: fixed, between: [hub.p3, blade3.root], angle: 360 deg}
springs:
  tie2: {type: two_point, between: [blade1.tip, blade2.tip], stiffness: 10}
  tie3: {type: two_point, between: [blade2.tip, blade3.tip], stiffness: 10}
loads:
  push1: {type: force, at: blade1.tip, force: [0, 1], law: {expression: "sin(rate * t + 1)"}}
  push2: {type: force, at: blade2.tip, force: [0, 1], law: {expression: "sin(rate * t + 2)"}}
  push3: {type: force, at: blade3.tip, force: [0, 1], law: {expression: "sin(rate * t + 3)"}}
output: {interval: 0.05, channels: [hub.angle, blade1.tip.x, blade2.tip.x, blade3.tip.x, blade3.tip.y]}
"""


def refusals(text, overrides=()):
    with pytest.raises(DeckError) as caught:
        parse_deck(text, "rotor.yaml", overrides)
    return str(caught.value)


def test_a_deck_with_patterns_is_the_same_written_out():
    short, long = parse_deck(ROTOR), parse_deck(WRITTEN_OUT)
    shorter, longer = (str(one.deck.resolved()).replace(".0)", ")") for one in (short, long))
    assert shorter == longer  # but for 'sin(rate * t + 1.0)'
    runs = [api.run(one, error_estimate=False, diagnosis=False) for one in (short, long)]
    for name in ("hub.angle", "blade1.tip.x", "blade3.tip.x", "blade3.tip.y"):
        np.testing.assert_array_equal(runs[0][name], runs[1][name])


def test_resolved_repeats_the_run(tmp_path):
    (tmp_path / "rotor.yaml").write_text(ROTOR)
    assert call("run", tmp_path / "rotor.yaml", "-o", tmp_path / "out", "--no-plots").exit_code == 0
    resolved = tmp_path / "out" / "resolved.yaml"
    assert [*yaml.safe_load(resolved.read_text())["bodies"]] == ["hub", "blade1", "blade2", "blade3"]
    assert load_deck(resolved).deck_sha256 == load_deck(tmp_path / "rotor.yaml").deck_sha256


def test_the_pattern_and_a_copy_are_set_in_whatever_order():
    overrides = ["bodies.blade2.length=3", "bodies.blade{k}.length=${2 * k}", "parameters.n=4"]
    overrides.append("loads.push3=null")
    deck = parse_deck(ROTOR, overrides=overrides).deck
    assert [deck.bodies[f"blade{k}"].length for k in (1, 2, 3, 4)] == [2.0, 3.0, 6.0, 8.0]
    assert [*deck.loads] == ["push1", "push2", "push4"]
    changed = parse_deck(ROTOR, overrides=overrides).changed(["bodies.blade{k}.elements=2"]).deck
    assert [body.elements for body in changed.bodies.values() if hasattr(body, "elements")] == [2] * 4
    assert changed.bodies["blade2"].length == 3.0


def test_a_count_may_be_a_ratio_of_lengths():
    text = ROTOR.replace("n: 3", "n: 3, span: 2 m, pitch: 0.5 m")
    text = text.replace("push{k=1..n}", "push{k=1..span/pitch-1}")
    assert [*parse_deck(text).deck.loads] == ["push1", "push2", "push3"]


def test_one_copy_of_what_is_inside_is_set():
    deck = parse_deck(ROTOR, overrides=["bodies.hub.points.p2=[7, '${k}']"]).deck
    assert deck.bodies["hub"].points == {"p1": (0.1, 1 / 3), "p2": (7.0, 2.0), "p3": (0.1 * 3, 1.0)}


def test_ranges_depend_on_one_another_and_may_be_empty():
    text = ROTOR.replace('"blade{n}.tip.y"', '"blade{i=2..n}.tip.{x}"').replace("{x}", "vx")
    assert [*parse_deck(text, overrides=["parameters.n=1"]).deck.springs] == []
    points = 'points: {"q{i=1..2}_{j=i..3}": ["${i}", "${j}"], "p{k'
    deck = parse_deck(ROTOR.replace('points: {"p{k', points)).deck
    assert [*deck.bodies["hub"].points][:6] == ["q1_1", "q1_2", "q1_3", "q2_2", "q2_3", "p1"]


def test_patterns_may_stand_in_other_files(tmp_path):
    head, rest = ROTOR.split("joints:")
    (tmp_path / "blades.yaml").write_text(head.replace("length:", "lenght:"))
    (tmp_path / "rotor.yaml").write_text(f"include: blades.yaml\njoints:{rest}")
    with pytest.raises(DeckError) as caught:
        load_deck(tmp_path / "rotor.yaml")
    assert "blades.yaml:11:62: error: bodies.blade1.lenght: unknown key (at k = 1)" in str(caught.value)
    (tmp_path / "blades.yaml").write_text(head)
    assert load_deck(tmp_path / "rotor.yaml").deck_sha256 == parse_deck(ROTOR).deck_sha256


def test_tables_of_copies_take_columns_by_the_index(tmp_path):
    (tmp_path / "gusts.csv").write_text("t,g1,g2,g3\n0,1,2,3\n1,4,5,6\n")
    law = 'law: {table: gusts.csv, column: "g{k}", interpolation: linear}'
    (tmp_path / "rotor.yaml").write_text(ROTOR.replace('law: {expression: "sin(rate * t + k)"}', law))
    assert load_deck(tmp_path / "rotor.yaml").deck.loads["push2"].law.values == (2.0, 5.0)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("push{k=1..n}", "push{k}", "18:8: error: loads.push{k}: there is no parameter or index 'k'"),
        ("push{k=1..n}", "push{n=1..4}", "'n' is a parameter or an index already"),
        ("push{k=1..n}", "push{t=1..4}", "'t' is time in laws"),
        ("push{k=1..n}", "push{k=4..1}", "loads.push{k=4..1}: 4..1 runs backwards"),
        ("push{k=1..n}", "push{k=n..1}", "3..1 runs backwards (k=n..max(1, 2) would have no copies)"),
        ("push{k=1..n}", "push{1..n}", "'{1..n}' is a range without an index"),
        ("push{k=1..n}", "push{k=1...n}", "'{k=1...n}' has three dots, a range has two"),
        ("push{k=1..n}", "push{k=1..rate}", "rate must be a whole number, not 6.28319 rad/s"),
        ("push{k=1..n}", "push{k=1..n/2}", "n/2 must be a whole number, not 1.5"),
        ("push{k=1..n}", "push{k=1..1e9}", "1000000000 copies are too many, at most 10000"),
        ("push{k=1..n}", "push{k=-1.7e308..1.7e308}", "inf copies are too many"),
        ("push{k=1..n}", "push{k=1..-1e300}", "1..-1e+300 runs backwards"),
        ("push{k=1..n}", "push{i=1..9999}{k=1..9999}", "more than 100000 entries in all"),
        ("push{k=1..n}", "push{i=1..11}{k=1..11}", "'push111' is there twice"),
        ("hub: {", "blade2: {", "11:3: error: bodies.blade{k=1..n}: 'blade2' is there twice"),
        ("blade{n}.tip.y", "blade{j}.tip.y", "output.channels.2: there is no parameter or index 'j'"),
        ("blade{n}.tip.y", "blade{j=2..3}.tp.y", "output.channels.2: 'blade2' has no point 'tp' (at j = 2)"),
        ("at: blade{k}", "at: blade{k=1..2}", "a range stands in names of entries and in lists"),
        ('"hub.p{k}"', "hub.p{k}", "quote names with braces in brackets and lists"),
        ('"hub.p{k}"', '"hub.p${k}"', 'in names "blade{k}"'),
        ('"hub.p{k}"', '"hub.p{k - 1}"', "joints.mount1.between.0: 'hub' has no point 'p0' (at k = 1)"),
        ("1 + k / 10", "2 - k", "11:70: error: bodies.blade2.length: must be greater than 0, not 0 (at"),
        ("1 + k / 10", "1 + m / 10", "11:77: error: bodies.blade1.length: there is no parameter or"),
        ("t + k)", "t + kk)", "loads.push1.law.expression: there is no parameter or index 'kk' (at k = 1)"),
    ],
)
def test_what_is_wrong_is_told_at_the_pattern(old, new, told):
    assert ROTOR.count(old) == 1
    message = refusals(ROTOR.replace(old, new))
    assert told in message
    assert message.count(told.split("error: ")[-1]) == 1


def test_what_is_wrong_in_all_copies_is_told_once():
    message = refusals(ROTOR.replace("length:", "lenght:").replace("interval", "intervall"))
    assert "3 errors" in message  # one key is missing
    assert "bodies.blade1.lenght: unknown key (at k = 1)" in message


def test_what_else_is_wrong_is_told_with_braces_of_texts():
    text = ROTOR.replace("hub.p{k}", "hub.p{q}").replace("type: beam", "type: baem")
    told = refusals(text.replace("revolute", "revolut"))
    assert told.count("error: ") == 3
    assert "parameter or index 'q'" in told and "'baem'" in told and "'revolut'" in told


def test_nothing_follows_from_a_count_that_is_wrong():
    message = refusals(ROTOR.replace("n: 3", 'n: 3, m: "${q}"').replace("blade{k=1..n}:", "blade{k=1..m}:"))
    assert "parameters.m: there is no parameter 'q'" in message and "1 error." in message


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("bodies.blade9.length=1", "there is no bodies.blade9 in the deck"),
        ("bodies.blad{k}.length=1", "did you mean 'blade{k}'?"),
        ("bodies.blade{k=1..n}.length=1", "a pattern is named without its range"),
        ("bodies.blade{k=1..n}={type: rigid, mass: 1}", "a pattern is named without its range"),
        ("bodies.blade{k}.length=-1", "--set: error: bodies.blade1.length: must be greater than 0"),
        ("parameters.m=3", "no expression uses it"),
        ("bodies.blade2.points.q{i}=[1, 0]", "in a copy there are copies of what is inside"),
    ],
)
def test_overrides_that_cannot_be(override, told):
    text = ROTOR.replace('elements: 1}', 'elements: 1, points: {"q{i=1..2}": ["${i / 4}", 0]}}')
    assert told in refusals(text, [override])


def test_an_entry_of_a_list_is_set_by_its_place_in_the_file():
    text = ROTOR.replace("{k=1..n}.tip.x", "{k=n..n+1}.tip.x")
    told = refusals(text, ["output.channels.2=hub.x"])
    assert "23:48: error: output.channels.1: there is no body, joint or spring 'blade4'" in told


def test_no_pattern_is_set_where_several_are_called_so():
    first = "push{k=1..1}: {type: force, at: blade1.tip, force: [0, 1]}"
    text = ROTOR.replace("push{k=1..n}:", f"{first}\n  push{{k=2..n}}:")
    told = refusals(text, ["loads.push{k}.force=[1, 0]"])
    assert "loads.push{k}.force: several patterns are called so" in told
    deck = parse_deck(text, overrides=["loads.push1.force=[1, 0]"]).deck
    assert deck.loads["push1"].force == (1.0, 0.0)


def test_no_pattern_is_set_where_copies_are_written_out():
    assert "the deck has no such pattern" in refusals(WRITTEN_OUT, ["bodies.blade{k}.length=1"])


def test_sweeps_vary_the_count_and_the_pattern(tmp_path):
    vary = '{"bodies.blade{k}.length": [1, 2], parameters.n: [2, 3]}'
    sweep = f'sweep: {{vary: {vary}, collect: ["max(blade{{k=1..2}}.tip.x)"]}}'
    (tmp_path / "rotor.yaml").write_text(ROTOR + sweep)
    done = call("sweep", tmp_path / "rotor.yaml", "-o", tmp_path / "out")
    assert done.exit_code == 0, done.output
    head, *rows = (tmp_path / "out" / "sweep.csv").read_text().splitlines()
    assert head.startswith("run,bodies.blade{k}.length,parameters.n,max(blade1.tip.x),max(blade2.tip.x),")
    assert len(rows) == 4
