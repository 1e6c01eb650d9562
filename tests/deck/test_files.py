"""Decks of several files: parts that are included, and tables in CSV files."""

import os

import numpy as np
import pytest
import yaml
from called import call

from hfsim.errors import DeckError
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

PARTS = """
include: common/steel.yaml
parameters: {length: 1.0, width: 0.02}
sections: {bar: {shape: rectangle, width: "${width}", height: "${width / 2}"}}
bodies:
  arm: {type: beam, material: steel, section: bar, length: "${length}", elements: 2}
"""
STEEL = "hfsim: 1\nmaterials: {steel: {density: 7800, youngs_modulus: 210 GPa}}\n"
DECK = """
hfsim: 1
name: lift
include: [parts/arm.yaml, parts/common/steel.yaml]
parameters: {length: 2.0}
gravity: [0.0, -9.81]
bodies:
  bob: {type: rigid, mass: 0.1, inertia: 1.0e-3}
joints:
  pin: {type: revolute, between: [ground, arm.root]}
  tie: {type: fixed, between: [arm.tip, bob]}
loads:
  push: {type: force, at: arm.tip, force: [0, 1], law: {table: parts/motor.csv, column: torque}}
solve: {duration: 0.2}
output: {interval: 0.05}
"""
MOTOR = "# t in s\nspeed;t;torque\n1;0;0.5\n\n2;0.1;2.5\n3; 0.3;-1e0\n"


@pytest.fixture
def deck(tmp_path):
    (tmp_path / "parts" / "common").mkdir(parents=True)
    (tmp_path / "parts" / "arm.yaml").write_text(PARTS)
    (tmp_path / "parts" / "common" / "steel.yaml").write_text(STEEL)
    (tmp_path / "parts" / "motor.csv").write_text(MOTOR)
    (tmp_path / "lift.yaml").write_text(
        DECK.replace("column: torque", "column: torque, time_column: t")
    )
    return tmp_path / "lift.yaml"


def changed(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def refusal(path, overrides=()):
    with pytest.raises(DeckError) as caught:
        load_deck(path, overrides)
    return str(caught.value)


def test_parts_tables_and_deck_are_one(deck):
    loaded = load_deck(deck)
    arm = loaded.deck.bodies["arm"]
    assert (arm.length, arm.elements, list(loaded.deck.bodies)) == (2.0, 2, ["bob", "arm"])
    assert loaded.deck.sections["bar"].height == 0.01
    law = loaded.deck.loads["push"].law
    assert (law.times, law.values) == ((0.0, 0.1, 0.3), (0.5, 2.5, -1.0))
    text = yaml.safe_dump(loaded.deck.resolved())
    assert "include" not in text and "csv" not in text
    again = parse_deck(text, "lift.yaml")
    assert (again.deck, again.deck_sha256) == (loaded.deck, loaded.deck_sha256)
    here = parse_deck(deck.read_text(), str(deck), loaded.overrides)
    assert here.deck == loaded.deck
    assert simulate(loaded, error_estimate=False).status == "done"


def test_lines_are_those_of_the_file_that_an_entry_stands_in(deck):
    loaded = load_deck(deck)
    assert loaded.line_of("joints.pin") == 10
    assert loaded.line_of("bodies.arm") == 0
    error = loaded.problem("bodies.arm.elements", "are too few")
    assert f"{deck.parent / 'parts' / 'arm.yaml'}:6:83: error: bodies.arm.elements: are too few" in str(error)
    assert "    6 |   arm: {type: beam" in str(error)


def test_warnings_name_the_file(deck):
    changed(deck.parent / "parts" / "common" / "steel.yaml", "210 GPa", "210")
    (warning,) = load_deck(deck).warnings
    assert warning.startswith(f"{deck.parent / 'parts' / 'common' / 'steel.yaml'}:2:")


def test_overrides_reach_parts_and_tables(deck):
    loaded = load_deck(deck, ["bodies.arm.elements=3", "parameters.width=0.04", "loads.push.law.start=0.1"])
    assert loaded.deck.bodies["arm"].elements == 3
    assert loaded.deck.sections["bar"].width == 0.04
    assert loaded.deck.loads["push"].law.start == 0.1
    law = "loads.push.law={table: parts/motor.csv, time_column: t, column: speed}"
    assert load_deck(deck, [law]).deck.loads["push"].law.values == (1.0, 2.0, 3.0)
    assert "--set: error: loads.push.law.table: " in refusal(deck, ["loads.push.law={table: none.csv}"])
    assert "--set: error: include: cannot be set" in refusal(deck, ["include=parts/arm.yaml"])


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("parts/common/steel.yaml", "7800", "7801"),
        ("parts/arm.yaml", "elements: 2", "elements: 3"),
        ("parts/motor.csv", "2.5", "2.6"),
    ],
)
def test_every_file_counts_in_the_checksum(deck, file, old, new):
    before = load_deck(deck).deck_sha256
    changed(deck.parent / file, old, new)
    assert load_deck(deck).deck_sha256 != before


def hfsim(*arguments):
    return call(*arguments)


def test_a_run_goes_on_with_the_same_files_and_not_with_others(deck, monkeypatch):
    """With a checkpoint after each step."""
    monkeypatch.chdir(deck.parent)
    monkeypatch.setattr("hfsim.output.recording.EVERY", 0.0)
    monkeypatch.setattr("hfsim.marching.record.BLOCK", 0.01)
    run = ("run", "lift.yaml", "--no-plots", "--no-error-estimate")
    whole = hfsim(*run, "-o", "whole")
    assert whole.exit_code == 0, whole.stderr
    assert hfsim(*run, "-o", "cut", "--set", "solve.max_steps=9").exit_code == 5
    changed(deck.parent / "parts" / "motor.csv", "2.5", "2.6")
    refused = hfsim(*run, "-o", "cut", "--resume")
    assert refused.exit_code == 2, refused.stderr
    assert "loads.push.law.values: [0.5, 2.5, -1.0] then, [0.5, 2.6, -1.0] now" in refused.stderr
    changed(deck.parent / "parts" / "motor.csv", "2.6", "2.5")
    assert hfsim(*run, "-o", "cut", "--resume").exit_code == 0
    histories = [(deck.parent / name / "history.csv").read_bytes() for name in ("whole", "cut")]
    assert histories[0] == histories[1]
    again = hfsim("run", "whole/resolved.yaml", *run[2:], "-o", "again")
    assert again.exit_code == 0, again.stderr
    assert (deck.parent / "again" / "history.csv").read_bytes() == histories[0]


def test_decks_that_are_no_files_have_no_others(deck, monkeypatch):
    monkeypatch.chdir(deck.parent)
    for name in ("deck", "-", "<stdin>"):
        with pytest.raises(DeckError, match=r":4:11: error: include.0: a deck that is no file has no folder"):
            parse_deck(deck.read_text(), name)
    only = "hfsim: 1\nbodies: {b: {type: rigid, mass: 1, inertia: 1}}\nsolve: {duration: 1}\nloads: {f: LOAD}"
    load = "{type: force, at: b, force: [1, 0], law: {table: parts/motor.csv}}"
    with pytest.raises(DeckError, match=r"deck:4:61: error: loads.f.law.table: a deck that is no file"):
        parse_deck(only.replace("LOAD", load))


def test_links_and_pipes_lead_nowhere(deck, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.yaml").write_text("name: secret\n")
    (outside / "secret.csv").write_text("t,x\n0,1\n1,1\n")
    here = deck.parent
    (here / "link.yaml").symlink_to(outside / "secret.yaml")
    (here / "folder").symlink_to(outside)
    (here / "inner.yaml").symlink_to(here / "parts" / "arm.yaml")
    os.mkfifo(here / "pipe.yaml")
    (here / "loop.yaml").symlink_to(here / "loop.yaml")
    for name in ("link.yaml", "folder/secret.yaml"):
        changed(deck, "parts/arm.yaml", name)
        said = refusal(deck)
        assert "a link that leads out of the deck's folder" in said
        changed(deck, name, "parts/arm.yaml")
    for name in ("pipe.yaml", "loop.yaml", "folder", "n" * 300, "a\\\\b", "C:x", "~/x", "a//../x", "."):
        changed(deck, "[parts/arm.yaml,", f'["{name}",')
        assert ":4:11: error: include.0: " in refusal(deck)
        changed(deck, f'["{name}",', "[parts/arm.yaml,")
    changed(deck, "parts/motor.csv", "folder/secret.csv")
    assert "loads.push.law.table: " in refusal(deck)
    changed(deck, "folder/secret.csv", "parts/motor.csv")
    changed(here / "parts" / "arm.yaml", "common/steel.yaml", "parts/common/steel.yaml")
    changed(deck, "parts/arm.yaml", "inner.yaml")
    assert load_deck(deck).deck.bodies["arm"].length == 2.0


def test_a_link_to_a_deck_is_at_home_where_it_stands(deck, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "lift.yaml").symlink_to(deck)
    assert "parts/arm.yaml is not there" in refusal(elsewhere / "lift.yaml")


@pytest.mark.parametrize(
    ("name", "meant"),
    [("parts/amr.yaml", " (did you mean 'parts/arm.yaml'?)"), ("parts/winch.yaml", ""), ("arm.yaml", "")],
)
def test_of_a_file_that_is_not_there_the_nearest_is_told_as_the_deck_would_name_it(deck, name, meant):
    changed(deck, "parts/arm.yaml", name)
    assert f"{name} is not there{meant}\n" in refusal(deck)


def test_the_files_of_a_deck_are_bounded_together(deck, monkeypatch):
    here = deck.parent
    names = [f"parts/p{k}.yaml" for k in range(120)]
    for k, name in enumerate(names):
        (here / name).write_text(f"parameters: {{p{k}: 1}}\n")
    changed(deck, "include: [", f"include: [{', '.join(names)}, ")
    assert "more than 100 files" in refusal(deck)
    deck.write_text("hfsim: 1\ninclude: [a.yaml, b.yaml]\n")
    for name in ("a", "b"):
        (here / f"{name}.yaml").write_text(f"{name}: [{', '.join(['1'] * 60_000)}]\n")
    assert "b.yaml:1:1: error: more than 100000 entries in all" in refusal(deck)
    monkeypatch.setattr("hfsim.deck.files.LARGEST", 200_000)
    assert "at most 200000 characters together" in refusal(deck)


def test_long_tables_are_refused_and_all_others_taken(deck):
    table = deck.parent / "parts" / "motor.csv"
    rows = "\n".join(f"1\t{k / 1e4}\t{k % 7}" for k in range(20_000))
    table.write_text(f"speed\tt\ttorque\n{rows}\n")
    loaded = load_deck(deck)
    assert len(loaded.deck.loads["push"].law.times) == 20_000
    assert parse_deck(yaml.safe_dump(loaded.deck.resolved()), "lift.yaml").deck == loaded.deck
    table.write_text(f"speed\tt\ttorque\n{rows}\n1\t9\t1\n")
    assert "more than 20000 rows" in refusal(deck)


def test_a_table_in_a_unit_is_that_in_si(deck):
    deck.write_text("""
hfsim: 1
bodies: {b: {type: rigid, mass: 1, inertia: 1}}
joints:
  one: {type: driver, between: [ground, b], angle: {table: turn.csv, unit: deg, start: 0.5}}
solve: {duration: 1}
""")
    (deck.parent / "turn.csv").write_text('"t","angle"\n0,0\n0.5,0\n1,10\n1.5,30\n')
    said = refusal(deck)  # the spline is not at rest where it begins
    assert "its rate jumps at 0.5 s" in said
    changed(deck, ", start: 0.5", "")
    law = load_deck(deck).deck.joints["one"].angle
    np.testing.assert_allclose(law.values, np.radians([0, 0, 10, 30]))


def test_springs_take_their_tables_from_files(deck):
    spring = "springs: {rope: {type: two_point, between: [ground, arm.tip], table: parts/rope.csv}}\nsolve:"
    changed(deck, "solve:", spring)
    (deck.parent / "parts" / "rope.csv").write_text("stretch,force\n-0.1,-50\n0,0\n0.2,30\n")
    rope = load_deck(deck).deck.springs["rope"]
    assert rope.table == ((-0.1, -50.0), (0.0, 0.0), (0.2, 30.0))
    (deck.parent / "parts" / "rope.csv").write_text("stretch,force\n-0.1,-50\n0,0\n0,30\n")
    assert "rope.csv:4:1: error: springs.rope.table.2: the first numbers must increase" in refusal(deck)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("t,torque\n0,0,0,0\n1,0,5,7", {"2:5": "4 values for 2 columns", "3:5": "4 values for 2 columns"}),
        ("t,torque,torque\n0,1,2\n1,2,3", {"1:3": "two columns are called 'torque'"}),
        ('t,torque\n"0,0\n1,1', {"2:1": "t must be a number, not '\"0'"}),
        ("t;torque\n0;'1\n1;1", {"2:3": "torque must be a number, not ''1'"}),
    ],
)
def test_what_a_table_would_lose_is_an_error_at_its_place(deck, rows, said):
    (deck.parent / "parts" / "motor.csv").write_text(rows)
    told = refusal(deck)
    lines = [f"motor.csv:{place}: error: loads.push.law.table: {what}" for place, what in said.items()]
    assert [one for one in lines if one not in told] == [] and told.count("error:") == len(said), told


@pytest.mark.parametrize(
    "rows",
    [
        't,torque,remark,x,x\n0,1,"slow, cold",,\n1, "2" ,5" pipe,1,2,,\n',
        't;"force, ""wet"", N";torque\n0;7;1\n1;7;2\n',
    ],
)
def test_a_table_may_have_columns_that_are_not_asked_for(deck, rows):
    (deck.parent / "parts" / "motor.csv").write_text(rows)
    law = load_deck(deck).deck.loads["push"].law
    assert (tuple(law.times), tuple(law.values)) == ((0.0, 1.0), (1.0, 2.0))


def test_only_the_deck_itself_sets_parameters_of_its_parts(deck):
    (deck.parent / "parts" / "other.yaml").write_text("parameters:\n  width: 0.03\n")
    changed(deck, "parts/arm.yaml,", "parts/arm.yaml, parts/other.yaml,")
    said = refusal(deck)
    assert "parts/other.yaml:2:3: error: parameters.width: stands in line 3 of " in said
    assert "parts/arm.yaml too (keep one of the two)" in said
    changed(deck, "parts/other.yaml,", "")
    changed(deck, "parameters: {length: 2.0}", "parameters: [2.0]")
    assert "parts/arm.yaml:3:1: error: parameters: stands in line 5 of " in refusal(deck)


def test_null_takes_out_what_an_included_file_states(deck):
    changed = load_deck(deck, ["bodies.arm.elements=null"])
    assert "elements" in load_deck(deck).source.data["bodies"]["arm"]
    assert "elements" not in changed.source.data["bodies"]["arm"]
    assert load_deck(deck).deck.loads and not load_deck(deck, ["loads.push=null"]).deck.loads
    with pytest.raises(DeckError, match="there is no body 'bob'"):
        load_deck(deck, ["bodies.bob=null"])
    with pytest.raises(DeckError, match=r"--set: error: sections.bar.width: missing key"):
        load_deck(deck, ["sections.bar.width=null"])
