"""`hfsim static` and `hfsim.static`: the folder, the words, the exit codes."""

import json

import pytest
from click.testing import CliRunner

import hfsim
from hfsim.cli import app
from hfsim.commands.static import static
from hfsim.scene.shipped import find_deck


def call(*arguments):
    return CliRunner().invoke(static, arguments)


def test_the_folder_is_that_of_a_run_with_one_row(here):
    done = call("pendulum", "--vtk", "--set", "output.shapes=csv")
    assert done.exit_code == 0 and "equilibrium, stable" in done.stdout
    folder = here / "pendulum.static"
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["kind"] == summary["method"] == "static" and summary["stable"] is True
    rows = (folder / "history.csv").read_text().splitlines()
    assert len(rows) == 2 and rows[0].startswith("t,b1.tip.x")
    assert summary["final"]["b1.angle"] == pytest.approx(-1.5707963267948966)
    assert summary["smallest_eigenvalue"] == pytest.approx(11.2745872327)
    assert {"plots/shapes.png", "plots/along_b1.png", "shapes.npz", "shapes.csv", "pendulum.pvd"} <= set(
        summary["files"]
    )
    assert all((folder / name).exists() for name in summary["files"])
    assert call("pendulum").exit_code == 2
    again = call("pendulum", "--force", "--no-plots", "--json")
    assert again.exit_code == 0 and json.loads(again.stdout)["kind"] == "static"
    assert not (folder / "plots" / "shapes.png").exists()


@pytest.mark.parametrize(
    ("option", "why"),
    [
        (("--vary", "gravity"), "--vary goes with --path and --buckling only"),
        (("--count", "2"), "--count goes with --buckling only"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(here, option, why):
    refused = call("pendulum", *option)
    assert refused.exit_code == 2 and why in refused.output
    assert call("pendulum", "--no-plots", "--buckling", "--count", "1", "--vary", "gravity").exit_code != 2


def test_a_run_and_an_equilibrium_of_one_deck_have_folders_of_their_own(here):
    run = ["run", "pendulum", "--no-plots", "--set", "solve.duration=0.01"]
    assert CliRunner().invoke(app, run).exit_code == 0
    assert call("pendulum", "--no-plots").exit_code == 0
    paths = [here / f"pendulum.{kind}/summary.json" for kind in ("out", "static")]
    assert [json.loads(path.read_text()).get("kind") for path in paths] == [None, "static"]


def test_rows_go_to_standard_output(here):
    done = call("pendulum", "--model", "rigid", "-o", "-", "--path")
    head, *rows = done.stdout.splitlines()
    assert head.startswith("t,load,b1.tip.x") and rows
    assert "standard output" in done.stderr and done.exit_code == 0
    done = call("pendulum", "-o", "-")
    assert done.exit_code == 0 and len(done.stdout.splitlines()) == 2
    assert call("pendulum", "-o", "-", "--json").exit_code == 2
    assert not list(here.iterdir())


def test_no_path_begins_where_nothing_holds_what_loads_push(here):
    done = call("flying_spaghetti", "-o", "-", "--path")
    assert done.exit_code == 3 and len(done.stdout.splitlines()) == 2
    assert "no path begins: without the loads nothing holds what they push" in done.stderr
    assert "leave out --path" in done.stderr


def test_what_nothing_holds_ends_with_exit_code_3_and_is_kept(here):
    done = call("flying_spaghetti", "--no-plots")
    assert done.exit_code == 3
    assert "nothing holds what the loads push: noodle: floats" in done.stderr
    summary = json.loads((here / "flying_spaghetti.static" / "summary.json").read_text())
    assert summary["status"] == "failed" and summary["failure"]["item"] == "bodies.noodle"
    assert summary["stable"] is None and summary["load"] == 0.0


def test_a_bad_deck_writes_nothing(here):
    assert call("pendulum", "--set", "bodies.b1.length=-1").exit_code == 2
    assert call("no_such_deck").exit_code == 2
    assert not list(here.iterdir())


def test_from_python_it_is_a_run(here):
    run = hfsim.static("princeton", {"solve.model": "exact"}, at=1.0)
    assert run["beam.tip.z"] == pytest.approx(0.109041568, abs=2e-9) and run.t.tolist() == [1.0]
    assert run.statistics["stable"] and not list(here.iterdir())
    with pytest.raises(hfsim.UnfinishedRunError) as told:
        hfsim.static("flying_spaghetti")
    assert told.value.run.status == "failed"
    kept = hfsim.static("pendulum", output=here / "out", plots=False)
    assert (here / "out" / "summary.json").exists() and kept.exit_code == 0


PUSHED = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {b: {type: rigid, mass: 2.0, inertia: 0.3, points: {p: [-0.4, 0.0]}}}
joints:
  h: {type: revolute, between: [ground, b.p]}
  d: {type: driver, between: [ground, b.p], angle: DRIVEN}
loads: {f: {type: force, at: b, force: [0.0, 1.0], law: LAW}}
solve: {duration: 1.0}
output: {channels: [b.angle]}
"""
ENDING = {
    "{times: [0, 0.3, 0.6, 1], values: [0, 1, 0.5, 2]}": "covers 0 s to 1 s, and is needed from 0 to 2 s",
    "{expression: 1 - sqrt(1.01 - t)}": "it is not finite at t = 1.01 s",
}


@pytest.mark.parametrize("study", [hfsim.static, hfsim.modes])
@pytest.mark.parametrize("law", ENDING)
@pytest.mark.parametrize("place", ["joints.d.angle", "loads.f.law"])
def test_a_time_at_which_a_law_has_no_value_is_refused(tmp_path, study, law, place):
    laws = {"joints.d.angle": "0.0", "loads.f.law": "1.0"} | {place: law}
    deck = tmp_path / "pushed.yaml"
    deck.write_text(PUSHED.replace("DRIVEN", laws["joints.d.angle"]).replace("LAW", laws["loads.f.law"]))
    with pytest.raises(hfsim.DeckError) as told:
        study(deck, at=2.0)
    (problem,) = told.value.problems
    assert problem.path.startswith(place) and problem.message == ENDING[law] and problem.line
    study(deck, at=0.9)


def test_a_time_after_the_run_is_none_after_the_laws(tmp_path):
    deck = tmp_path / "pushed.yaml"
    longer = "{times: [0, 3], values: [0, 1]}"
    deck.write_text(PUSHED.replace("DRIVEN", "{expression: t}").replace("LAW", longer))
    assert hfsim.static(deck, at=1.5).final["b.angle"] == pytest.approx(1.5)


STRAINED = ["b1.tip.x", "b1.root.bending_moment"]


def test_channels_that_a_rigid_beam_has_not_are_left_out_of_equilibria_and_do_not_matter_to_modes(here):
    channels = ["--set", f"output.channels=[{', '.join(STRAINED)}]", "--model", "rigid", "--no-plots"]
    done = call("pendulum", *channels)
    assert done.exit_code == 0 and "b1.tip.x" in done.stdout
    assert "model rigid has no b1.root.bending_moment: left out" in done.stderr
    modes = CliRunner().invoke(app, ["modes", "pendulum", *channels])
    assert modes.exit_code == 0 and "left out" not in modes.output


def test_channels_that_a_rigid_beam_has_not_are_left_out_where_the_model_is_set(here):
    channels, model = ["--set", f"output.channels=[{', '.join(STRAINED)}]"], ["--model", "rigid"]
    short = ["--no-plots", "--set", "solve.duration=0.01"]
    for command, options in (("run", short), ("check", []), ("plan", [])):
        done = CliRunner().invoke(app, [command, "pendulum", *options, *channels, *model])
        assert done.exit_code == 0 and "model rigid has no b1.root.bending_moment: left out" in done.stderr
    assert (here / "pendulum.out/history.csv").read_text().startswith("t,b1.tip.x\n")
    found = hfsim.run("pendulum", {"output.channels": STRAINED, "solve.duration": 0.01}, model="rigid")
    assert [one.name for one in found.channels] == ["b1.tip.x"]
    text = find_deck("pendulum").read_text().replace("model: exact", "model: rigid")
    (here / "own.yaml").write_text(text)
    refused = CliRunner().invoke(app, ["run", "own.yaml", "--force", *channels, *short])
    assert "model: rigid" in text and refused.exit_code == 2 and "no internal forces" in refused.output
    changes = {"solve.model": "rigid", "output.channels": STRAINED}
    assert list(hfsim.static("pendulum", changes).final) == STRAINED[:1]
    alone = changes | {"output.channels": STRAINED[1:]}
    rigid = hfsim.modes("pendulum", {"solve.model": "rigid"})
    assert hfsim.modes("pendulum", alone).frequencies == rigid.frequencies


def test_what_is_doubtful_about_a_start_at_rest_is_told_once(here):
    lying = ["--set", "initial.equilibrium=true", "--set", "gravity=[0, 0]"]
    done = call("pendulum", "--no-plots", *lying, "--set", "initial.b1.angular_velocity=0")
    assert done.exit_code == 0 and done.stderr.count("one equilibrium of many") == 1
