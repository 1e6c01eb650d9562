"""Checkpoints: taken up again by the run they belong to, and by no other."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from called import call

from hfsim.commands import report_error
from hfsim.marching import record
from hfsim.marching.stop import SHIELD
from hfsim.output import disk, recording
from hfsim.output.checkpoint import CHECKPOINT, CheckpointError, put_down, take_up
from hfsim.output.disk import History
from hfsim.output.runfolder import RunFolder, RunLog
from hfsim.output.writers import Provenance

RESOLVED = {"name": "case", "solve": {"duration": 1.0, "tolerance": 1e-6, "max_steps": 5}}
PROVENANCE = Provenance("case.yaml", "0" * 64, (), RESOLVED)
SLOW = """
import sys, hfsim.output.recording, hfsim.marching.record
hfsim.output.recording.EVERY, hfsim.marching.record.BLOCK = 0.0, 0.002
from hfsim.cli import main
main()
"""


@pytest.fixture
def folder(tmp_path):
    history = History(tmp_path / "history.csv", ("x",))
    history.add(np.array([[0.0, 1.0], [0.1, 2.0]]))
    there = history.there
    history.add(np.array([[0.2, 3.0]]))
    put_down(tmp_path, {"steps.q": np.arange(3.0)}, there, PROVENANCE)
    return tmp_path


def test_a_checkpoint_has_the_memory_and_the_rows_until_then(folder):
    found = take_up(folder, PROVENANCE)
    assert np.array_equal(found.memory["steps.q"], np.arange(3.0))
    assert found.memory["table"].tolist() == [[0.0, 1.0], [0.1, 2.0]]
    assert take_up(folder / "elsewhere", PROVENANCE) is None


def test_another_deck_or_version_is_refused_with_the_difference(folder, monkeypatch):
    solve = {**RESOLVED["solve"], "tolerance": 1e-8, "max_steps": 99}
    with pytest.raises(CheckpointError) as refused:
        take_up(folder, PROVENANCE._replace(resolved={**RESOLVED, "solve": solve}))
    assert "solve.tolerance: 1e-06 then, 1e-08 now" in str(refused.value)
    assert "max_steps" not in str(refused.value)
    monkeypatch.setattr("hfsim.output.checkpoint.versions", lambda: {"hfsim": "99"})
    with pytest.raises(CheckpointError, match=r"hfsim: .* then, 99 now"):
        take_up(folder, PROVENANCE)


def test_libraries_not_imported_yet_do_not_count(folder, monkeypatch):
    known = json.loads(str(np.load(folder / CHECKPOINT)["about"]))["versions"]
    monkeypatch.setattr("hfsim.output.checkpoint.versions", lambda: {"hfsim": known["hfsim"]})
    assert take_up(folder, PROVENANCE) is not None


def test_a_checkpoint_that_cannot_be_read_is_told(folder):
    (folder / CHECKPOINT).write_bytes(b"PK\x03\x04 cut short")
    with pytest.raises(CheckpointError, match="cannot be read"):
        take_up(folder, PROVENANCE)


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (b"", "history.csv has 0 of the 20 bytes that are counted on"),
        (b"t,x\n0.0,1.0\n0.1,2.0", "history.csv has 19 of the 20 bytes"),
        (b"t,x\n0.0,1.0\n0.2,3.0\n", "history.csv was changed: its first 20 bytes"),
        (b"t,x\n0.1,2.0\n0.2,3.0\n0.3,4.0\n", "history.csv was changed"),
    ],
)
def test_rows_that_are_not_those_the_checkpoint_counts_on_are_refused(folder, rows, why):
    (folder / "history.csv").write_bytes(rows)
    with pytest.raises(CheckpointError, match=why):
        take_up(folder, PROVENANCE)
    assert (folder / "history.csv").read_bytes() == rows


RUN = ("run", "pendulum", "--no-plots", "--after", "none")


def hfsim(*arguments, **how):
    """Start a process to be killed."""
    command = [sys.executable, "-c", SLOW, *RUN, *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **how)


def here(*arguments):
    """Run the same in this process; return the exit code and what is told."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording, "EVERY", 0.0)
        patch.setattr(record, "BLOCK", 0.002)
        done = call(*RUN, *arguments)
    return done.exit_code, done.stderr


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The history of a run that nothing ends."""
    folder = tmp_path_factory.mktemp("runs") / "whole"
    assert here("-o", str(folder), *LONG)[0] == 0
    return (folder / "history.csv").read_bytes()


LONG = ("--set", "solve.duration=4")


def test_a_run_that_ends_while_its_folder_is_made_says_so(tmp_path, monkeypatch):
    prepare = RunFolder.prepare

    def struck(self, *given):
        prepare(self, *given)
        SHIELD.interrupt(KeyboardInterrupt())

    monkeypatch.setattr(RunFolder, "prepare", struck)
    monkeypatch.setattr(SHIELD, "taken", None)
    assert here("-o", str(tmp_path / "run"))[0] == 130
    assert json.loads((tmp_path / "run/summary.json").read_text())["status"] == "interrupted"


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGKILL,
        signal.SIGTERM,
        pytest.param(signal.SIGINT, marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, marks=pytest.mark.slow),
    ],
)
def test_a_run_that_was_killed_goes_on_as_if_nothing_had_been(tmp_path, number, whole):
    ends = (signal.SIGINT, signal.SIGHUP)
    own = {"preexec_fn": lambda: [signal.signal(one, signal.SIG_DFL) for one in ends]}  # else as of who calls
    killed = tmp_path / "killed"
    process = hfsim("-o", str(killed), *LONG, **own)
    until = time.monotonic() + 60.0
    while not (killed / CHECKPOINT).exists() and time.monotonic() < until:
        time.sleep(0.01)
    process.send_signal(number)
    process.communicate(timeout=60)
    codes = {signal.SIGKILL: -9, signal.SIGINT: 130}
    assert process.returncode == codes.get(number, 143)
    summary = json.loads((killed / "summary.json").read_text())
    assert summary["status"] == ("running" if number == signal.SIGKILL else "interrupted")
    assert (killed / "history.csv").read_text().startswith("t,b1.tip.x")
    assert "going on at row" in here("-o", str(killed), *LONG, "--resume")[1]
    assert (killed / "history.csv").read_bytes() == whole
    assert not (killed / CHECKPOINT).exists()
    assert "left as it is, done" in here("-o", str(killed), *LONG, "--resume")[1]


def assert_summary_is_of_the_rows(folder):
    """Assert that the summary tells the end, last values and extremes of the rows in the history."""
    summary = json.loads((folder / "summary.json").read_text())
    table = np.loadtxt(folder / "history.csv", delimiter=",", skiprows=1, ndmin=2)
    assert summary["end_time"] == summary["stop_time"] == table[-1, 0]
    assert [*summary["final"].values()] == table[-1, 1:].tolist()
    extremes = np.array([table[:, 1:].min(axis=0), table[:, 1:].max(axis=0)])
    assert [*summary["extremes"].values()] == extremes.T.tolist()


def test_a_run_that_a_full_disk_ends_goes_on_from_the_rows_that_fitted(tmp_path, monkeypatch, whole):
    add, added = History.add, []

    def full(self, table):
        added.append(len(table))
        if len(added) == 3:
            raise OSError(28, "No space left on device")
        add(self, table)

    with monkeypatch.context() as patch:
        patch.setattr(record, "BLOCK", 0.002)
        patch.setattr(History, "add", full)
        done = call(*RUN, "-o", str(tmp_path / "out"), *LONG)
    assert (done.exit_code, len(added)) == (5, 3) and "its last rows are missing" in done.stderr
    rows = (tmp_path / "out/history.csv").read_text().splitlines()[1:]
    assert len(rows) == sum(added[:2])
    assert_summary_is_of_the_rows(tmp_path / "out")
    end = float(rows[-1].split(",")[0])
    assert f"limit at t = {end:.6g} s" in done.stderr and f"at t = {end:.9g} s" in done.stdout
    with monkeypatch.context() as patch:
        patch.setattr(record, "BLOCK", 0.002)
        patch.setattr(History, "add", full)
        added.clear()
        assert call(*RUN, "-o", str(tmp_path / "out"), *LONG, "--resume").exit_code == 5
    assert len((tmp_path / "out/history.csv").read_text().splitlines()) > 1 + len(rows)
    assert_summary_is_of_the_rows(tmp_path / "out")
    code, told = here("-o", str(tmp_path / "out"), *LONG, "--resume")
    assert code == 0 and "begun anew" not in told
    assert (tmp_path / "out/history.csv").read_bytes() == whole


def test_a_full_disk_has_room_for_the_summary_of_the_rows_that_fitted(tmp_path, monkeypatch):
    """The disk takes what is written in place of the room that was kept, and nothing else."""
    folder, whole, room, freed = tmp_path / "out", disk.write_whole, [], set()

    def full(self, table):
        room.append((folder / ".summary.json.part").stat().st_size)
        raise OSError(28, "No space left on device")

    def in_room(path, write):
        if room and (path.parent / f".{path.name}.part").exists():
            freed.add(path)
        if room and path not in freed:
            raise OSError(28, "No space left on device")
        whole(path, write)

    monkeypatch.setattr(History, "add", full)
    monkeypatch.setattr(disk, "write_whole", in_room)
    done = call("run", "pendulum", "--set", "solve.duration=0.02", "-o", str(folder))
    assert done.exit_code == 5 and "its last rows are missing; --resume goes on" in done.stderr
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["status"], summary["exit_code"]) == ("limit", 5)
    assert room == [disk.ROOM] and (folder / "summary.json").stat().st_size < disk.ROOM / 3
    assert not (folder / ".summary.json.part").exists() and not (folder / "plots").exists()


def test_a_full_disk_that_refuses_the_summary_too_is_a_limit_all_the_same(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(History, "add", full)
    monkeypatch.setattr(recording, "write_json", full)
    done = call(*RUN, "-o", str(tmp_path / "out"), *LONG)
    assert done.exit_code == 5 and "history.csv: No space left on device; its last rows" in done.stderr
    assert status_of(tmp_path / "out") == "running"
    monkeypatch.undo()
    assert here("-o", str(tmp_path / "out"), *LONG, "--resume")[0] == 0


def test_a_second_process_is_kept_out_of_a_running_folder(tmp_path):
    first = hfsim("-o", str(tmp_path / "out"), "--set", "solve.duration=60")
    until = time.monotonic() + 60.0
    while not (tmp_path / "out/summary.json").exists() and time.monotonic() < until:
        time.sleep(0.01)
    for how in ((), ("--force",), ("--resume", "--set", "solve.duration=60")):
        code, told = here("-o", str(tmp_path / "out"), *how)
        assert code == 2 and "another hfsim is writing" in told
        assert not re.search("replacing|anew|going on", told)
    os.kill(first.pid, signal.SIGKILL)
    first.communicate(timeout=60)


def status_of(folder):
    return json.loads((folder / "summary.json").read_text())["status"]


def test_an_interruption_before_the_first_block_keeps_the_older_checkpoint(tmp_path):
    """Taken up again and interrupted at once, a run must not be back at its beginning."""
    folder = tmp_path / "out"
    first = hfsim("-o", str(folder), "--set", "solve.duration=60")
    until = time.monotonic() + 60.0
    while not (folder / CHECKPOINT).exists() and time.monotonic() < until:
        time.sleep(0.01)
    first.send_signal(signal.SIGTERM)
    first.communicate(timeout=60)
    before = (folder / CHECKPOINT).read_bytes()
    no_blocks = SLOW.replace("0.0, 0.01", "0.0, 1e9")
    command = ["run", "pendulum", "--no-plots", "--resume", "--set", "solve.duration=60", "-o", str(folder)]
    again = subprocess.Popen([sys.executable, "-c", no_blocks, *command], stderr=subprocess.PIPE, text=True)
    assert "going on" in again.stderr.readline() + again.stderr.readline()
    until = time.monotonic() + 60.0
    while status_of(folder) != "running" and time.monotonic() < until:
        time.sleep(0.01)
    again.send_signal(signal.SIGTERM)
    again.communicate(timeout=60)
    assert again.returncode == 143
    assert (folder / CHECKPOINT).read_bytes() == before
    assert CHECKPOINT in json.loads((folder / "summary.json").read_text())["files"]


def test_a_log_that_cannot_be_written_costs_nothing(tmp_path):
    log = RunLog()
    log.to(tmp_path / "gone" / "run.log")
    log.add("nobody hears this")


@pytest.mark.parametrize("after", ["history", "write_json"])
def test_a_run_that_is_killed_while_it_begins_can_begin_again(tmp_path, after):
    """Between making the folder's first files: what is there is known for what it is."""
    folder = tmp_path / "out"
    at = {"history": "recording.write_resolved", "write_json": "recording.History"}[after]
    kill = f"import os, hfsim.output.recording as recording\n{at} = lambda *a, **k: os.kill(os.getpid(), 9)\n"
    for replaced in (False, True):
        if replaced:
            assert here("-o", str(folder), "--force")[0] == 0
        command = ["run", "pendulum", "--no-plots", "-o", str(folder), "--force"]
        assert subprocess.run([sys.executable, "-c", kill + SLOW, *command]).returncode == -signal.SIGKILL
        assert status_of(folder) == "running"
        code, told = here("-o", str(folder), "--resume")
        assert code == 0, told
        assert status_of(folder) == "done"


def test_what_goes_wrong_after_a_signal_is_no_mistake(monkeypatch):
    by = KeyboardInterrupt()
    monkeypatch.setattr(SHIELD, "taken", by)
    with pytest.raises(KeyboardInterrupt):
        report_error(ImportError("initialization failed"))
