"""`hfsim run --resume`: does what is missing of this deck, of no other, and tells what was there."""

import json

import pytest
from called import call

from hfsim.marching import record
from hfsim.output import recording
from hfsim.output.disk import WriteError
from hfsim.output.plots import motion
from hfsim.output.recording import Recording

PLAIN = ("--no-plots", "--no-error-estimate", "--set", "solve.duration=0.1")
TOO_LONG = ("--set", "solve.method=gauss", "--set", "solve.step=0.5", "--set", "solve.duration=2")


def run(*arguments):
    return call("run", *PLAIN, *arguments, "-o", "out")


def summary():
    return json.loads(open("out/summary.json").read())


LONGER = ("--set", "bodies.b1.length=2")


@pytest.mark.parametrize("status", ["done", "running"])
def test_results_of_a_changed_deck_are_refused_with_the_difference(here, status):
    """Finished, or killed before there was a checkpoint."""
    assert run("pendulum", *LONGER).exit_code == 0
    (here / "out/summary.json").write_text(json.dumps({**summary(), "status": status}))
    before = (here / "out/history.csv").read_bytes()
    refused = run("pendulum", "--resume")
    assert refused.exit_code == 2
    assert "bodies.b1.length: 2.0 then, 1.2 now" in refused.stderr and "--force" in refused.stderr
    assert (here / "out/history.csv").read_bytes() == before
    assert run("pendulum", *LONGER, "--resume", "--set", "output.plots=false").exit_code == 0
    (here / "out/resolved.yaml").unlink()
    (here / "out/summary.json").write_text(json.dumps({**summary(), "status": status}))
    assert "deck_sha256: " in run("pendulum", "--resume").stderr


def test_results_of_another_scene_or_command_are_refused_but_not_of_another_version(here, monkeypatch):
    assert run("two_beams").exit_code == 0
    refused = run("pendulum", "--resume")
    assert refused.exit_code == 2 and "name: two_beams then, pendulum now" in refused.stderr
    assert len(refused.stderr.splitlines()) < 30
    assert call("static", "pendulum", "--no-plots", "-o", "out", "--force").exit_code == 0
    refused = call("run", "pendulum", "-o", "out", "--resume")
    assert refused.exit_code == 2 and "it is a result of hfsim static" in refused.stderr
    assert run("pendulum", "--force").exit_code == 0
    monkeypatch.setattr("hfsim.output.checkpoint.versions", lambda: {"hfsim": "99"})
    assert run("pendulum", "--resume").exit_code == 0


def test_what_was_chosen_for_a_target_is_no_change(here):
    short = ("--set", "solve.duration=0.3", "--set", "solve.method=gauss", "--target-channels", "b1.tip.x")
    search = ("run", "pendulum", "--no-plots", *short, "-o", "out", "--target-error")
    assert call(*search, "0.1").exit_code == 0
    assert "left as it is, done" in call(*search, "0.1", "--budget", "50s", "--resume").stderr
    refused = call(*search, "0.2", "--resume")
    assert refused.exit_code == 2
    assert [line for line in refused.stderr.splitlines() if " then, " in line] == [
        "  solve.target_error: 0.1 then, 0.2 now"
    ]


def test_what_is_left_as_it_is_tells_its_exit_code_and_its_facts(here):
    assert run("pendulum", *TOO_LONG).exit_code == 3
    again = run("pendulum", *TOO_LONG, "--resume")
    assert again.exit_code == 3 and "left as it is, failed" in again.stderr
    two = ("run", "pendulum", "two_beams", *PLAIN, "-o", "both", "--json")
    first, second = call(*two), call(*two, "--resume")
    assert second.stdout == first.stdout and len(second.stdout.splitlines()) == 2
    assert call(*two, "--resume", "--jobs", "2").stdout == first.stdout


@pytest.mark.parametrize("error", [MemoryError(), ZeroDivisionError("a mistake")])
def test_what_lack_of_memory_or_a_mistake_has_ended_goes_on(here, monkeypatch, error):
    """From its last checkpoint; where there is none, from the start."""
    monkeypatch.setattr(record, "BLOCK", 0.003)
    monkeypatch.setattr("hfsim.output.recording.EVERY", 0.0)
    deck = ("pendulum", "--set", "solve.duration=3")
    assert call("run", *PLAIN, *deck, "-o", "whole").exit_code == 0
    take = Recording.rows

    def refuse_from(stop):
        def rows(recording, table):
            if table[-1, 0] > stop:
                raise error
            take(recording, table)

        return rows

    for stop, options, told in ((0.0, (), ""), (1.0, ("--resume",), "anew"), (2.0, ("--resume",), "at row")):
        with monkeypatch.context() as patched:
            patched.setattr(Recording, "rows", refuse_from(stop))
            cut = run(*deck, *options)
        assert cut.exit_code == 1 and summary()["status"] == "failed" and told in cut.stderr
    again = run(*deck, "--resume")
    assert again.exit_code == 0 and "going on at row" in again.stderr and summary()["status"] == "done"
    assert (here / "out/history.csv").read_bytes() == (here / "whole/history.csv").read_bytes()
    assert not (here / "out/checkpoint.npz").exists()


@pytest.mark.parametrize("command", [("run",), ("sweep", "--vary", "bodies.b1.length=1,2")])
def test_to_go_on_and_to_replace_are_one_or_the_other(here, command):
    refused = call(*command, "pendulum", "-o", "out", "--resume", "--force")
    assert refused.exit_code == 2 and "one or the other" in refused.stderr
    assert not (here / "out").exists()


def struck(*_):
    raise KeyboardInterrupt


def test_what_a_signal_has_cost_after_the_end_is_made_by_going_on(here, monkeypatch):
    monkeypatch.setattr(record, "BLOCK", 0.01)
    animated = ("run", "pendulum", "--no-plots", "--set", "solve.duration=1", "--animate", "-o", "out")
    with monkeypatch.context() as patch:
        patch.setattr(motion, "animate", struck)
        cut = call(*animated)
    assert cut.exit_code == 130
    assert "pendulum: interrupted after its end" in cut.stderr and "--resume goes on" in cut.stderr
    history = (here / "out/history.csv").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(motion, "animate", struck)
        patch.setattr(Recording, "block", lambda self, memory: None)  # as where it goes on from its last one
        assert call(*animated, "--resume").exit_code == 130
    again = call(*animated, "--resume")
    assert again.exit_code == 0 and "going on at row" in again.stderr
    assert (here / "out/plots/motion.gif").exists() and not (here / "out/checkpoint.npz").exists()
    assert (here / "out/history.csv").read_bytes() == history


@pytest.mark.parametrize("again", [("--resume", "--vtk"), ("--force", "--set", "output.interval=0.05")])
def test_files_that_a_kill_left_unlisted_are_known_as_those_of_their_run(here, monkeypatch, again):
    """Killed once files for ParaView are in their places; a picture of somebody else is beside them."""
    add_extras = recording.add_extras

    def killed(*given):
        add_extras(*given)
        raise SystemExit(9)

    with monkeypatch.context() as patch:
        patch.setattr(recording, "add_extras", killed)
        assert run("pendulum", "--vtk").exit_code == 9
    assert summary()["exit_code"] is None and (here / "out/pendulum.pvd").exists()
    (here / "out/vtk/own.vtu").write_text("mine")
    done = run("pendulum", *again)
    assert (done.exit_code, "warning" in done.stderr) == (0, False), done.stderr
    listed = {f"out/{name}" for name in summary()["files"]}
    there = {str(path.relative_to(here)) for path in here.rglob("*") if path.is_file()}
    assert there == {*listed, "out/vtk/own.vtu"}
    assert ("out/pendulum.pvd" in listed) == ("--vtk" in again)


@pytest.mark.parametrize("where", ["recording.add_extras", "paraview.write_series", "runfolder.announce"])
def test_what_a_full_disk_has_cost_after_the_end_is_made_by_going_on(here, monkeypatch, where):
    def refuse(*_):
        raise (WriteError if where.endswith("extras") else OSError)(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(f"hfsim.output.{where}", refuse)
        cut = run("pendulum", "--vtk", "--report")
        assert cut.exit_code == 1 and "No space left" in cut.stderr
    assert summary()["status"] == "done" and summary()["exit_code"] is None
    assert "after its end" in summary()["reason"]
    assert where.endswith("extras") or ("--resume goes on" in cut.stderr and "done, 0.1 s" in cut.stdout)
    assert not (here / "out/pendulum.pvd").exists() and not (here / "out/report.html").exists()
    again = run("pendulum", "--vtk", "--resume")
    assert again.exit_code == 0 and "left as it is" not in again.stderr
    assert summary()["exit_code"] == 0 and not summary()["reason"] and (here / "out/pendulum.pvd").exists()


def test_a_comparison_ends_as_its_runs_do_on_a_full_disk(here, monkeypatch):
    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("hfsim.output.extras._pictures", refuse)
    cut = call("compare", "rigid", "linear", "--case", "pendulum", "--set", "solve.duration=0.1", "-o", "out")
    assert cut.exit_code == 1 and "No space left" in cut.stderr


def test_a_page_that_the_disk_refuses_is_told_in_the_summary(here, monkeypatch):
    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("hfsim.output.page.write_text", refuse)
    assert run("pendulum", "--report").exit_code == 1
    assert summary()["exit_code"] == 1 and "report.html" not in summary()["files"]
    assert run("pendulum", "--resume").exit_code == 1


def test_force_replaces_results_whose_summary_is_gone(here):
    assert run("pendulum").exit_code == 0
    for spoil in (lambda path: path.unlink(), lambda path: path.write_text("{")):
        spoil(here / "out/summary.json")
        assert run("pendulum").exit_code == 2
        assert run("pendulum", "--force", "--set", "solve.duration=0.05").exit_code == 0
        assert (here / "out/history.csv").read_text().splitlines()[-1].startswith("0.05,")


FEW = ("--set", "solve.max_steps=2", "--set", "solve.step=0.01")


def test_a_limit_says_how_to_go_on(here):
    cut = run("pendulum", *FEW)
    assert cut.exit_code == 5 and "2 steps were made; --resume goes on" in cut.stderr
    assert "--resume" not in call("run", "pendulum", *PLAIN, *FEW, "-o", "-").stderr
