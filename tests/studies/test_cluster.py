"""Sweeps on clusters of dask.distributed: real schedulers and workers, some of which are killed."""

import csv
import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partialmethod
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

pytest.importorskip("distributed")

from hfsim.cli import app
from hfsim.deck.files import sent
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.studies.cluster import Cluster, ClusterError, Workers, _work
from hfsim.studies.farm import Task

DECK = """
hfsim: 1
name: wheel
include: parts/hub.yaml
joints: {pin: {type: revolute, between: [ground, hub]}}
springs: {coil: {type: rotational, between: [ground, hub], stiffness: 100.0}}
initial: {hub: {angular_velocity: 1.0}}
solve: {duration: 0.5, tolerance: 1.0e-8}
output: {channels: [hub.angle]}
"""
HUB = "bodies: {hub: {type: rigid, mass: 1.0, inertia: 1.0}}\n"


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wheel.yaml").write_text(DECK)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/hub.yaml").write_text(HUB)
    return tmp_path


def test_texts_that_came_with_a_job_stand_for_files(tmp_path):
    deck, hub = str(tmp_path / "far/wheel.yaml"), str(tmp_path / "far/parts/hub.yaml")
    with sent({deck: DECK, hub: HUB}):
        assert "hub" in parse_deck(DECK, deck).deck.bodies
    with pytest.raises(Exception, match="no folder"):
        parse_deck(DECK, deck)


def test_other_versions_are_told():
    value, _, differences = _work({"hfsim": "0.0.0"}, {}, len, "abc")
    assert value is None and "not 0.0.0" in differences


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("workers: 3", "write cluster"),
        ("cluster: dask_jobqueue.NoCluster", "NoCluster|dask_jobqueue"),
        ("cluster: distributed.LocalCluster\nnodes: 3", "write cluster"),
    ],
)
def test_files_that_describe_no_cluster_are_refused(tmp_path, text, why):
    (tmp_path / "cluster.yaml").write_text(text)
    with (
        pytest.raises(ClusterError, match=why),
        Workers(1, config=tmp_path / "cluster.yaml").executor(),
    ):
        pass


# --- real ones -----------------------------------------------------------------------------------


def command(*words, **options):
    return subprocess.Popen([sys.executable, *map(str, words)], stdout=subprocess.DEVNULL, **options)


@contextmanager
def cluster(folder, count=2):
    """Start a scheduler and workers by hand, in a folder without decks."""
    place, here = folder / "scheduler.json", {"cwd": folder, "stderr": subprocess.DEVNULL}
    own = ("--scheduler-file", place, "--host", "127.0.0.1", "--no-dashboard")
    started = [command("-m", "distributed.cli.dask_scheduler", *own, "--port", 0, **here)]
    try:
        end = time.monotonic() + 60.0
        while not place.exists() and time.monotonic() < end:
            time.sleep(0.1)
        address = json.loads(place.read_text())["address"]
        alone = ("--nthreads", 1, "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        for _ in range(count):
            started.append(command("-m", "distributed.cli.dask_worker", address, *alone, **here))
        yield address, started
    finally:
        for one in started:
            one.kill()
            one.wait()


GRID = ("--vary", "springs.coil.stiffness=lin(50,150,100)", "--vary", "solve.method=gauss,radau")


def sweep(folder, *options):
    words = ("-m", "hfsim", "sweep", "wheel.yaml", *GRID, "--no-plots", "-o", folder, *options)
    return command(*words, stderr=subprocess.PIPE)


def table(folder):
    with (Path(folder) / "sweep.csv").open(newline="") as file:
        return [{key: value for key, value in row.items() if key != "cpu_s"} for row in csv.DictReader(file)]


def lines(folder):
    path = Path(folder) / "runs.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def wait_for(folder, count):
    end = time.monotonic() + 120.0
    while lines(folder) < count:
        assert time.monotonic() < end, "no runs came"
        time.sleep(0.02)


def finished(process, code=0):
    _, told = process.communicate(timeout=300.0)
    assert process.returncode == code, told.decode()
    return told.decode()


@pytest.mark.slow
def test_processes_dask_and_workers_by_hand_give_one_table(wheel, tmp_path_factory):
    finished(sweep("processes", "--jobs", 2))
    finished(sweep("local", "--dask", "local", "--jobs", 2))
    (wheel / "cluster.yaml").write_text(
        "cluster: distributed.LocalCluster\nworkers: 1\n"
        "options: {n_workers: 1, threads_per_worker: 2, dashboard_address: null}\n"
    )
    finished(sweep("configured", "--dask-config", "cluster.yaml"))
    with cluster(tmp_path_factory.mktemp("far")) as (address, started):
        cut = sweep("cut", "--dask", address)
        wait_for("cut", 30)
        assert lines("cut") < 200
        started[-1].send_signal(signal.SIGKILL)
        finished(cut)
    assert table("processes") == table("local") == table("configured") == table("cut")
    assert lines("cut") == 200


@pytest.mark.slow
def test_what_a_lost_scheduler_leaves_is_gone_on_with(wheel, tmp_path_factory):
    with cluster(tmp_path_factory.mktemp("far")) as (address, started):
        lost = sweep("lost", "--dask", address)
        wait_for("lost", 20)
        started[0].send_signal(signal.SIGKILL)
        assert "--resume" in finished(lost, 5)
    assert 20 <= lines("lost") < 200
    finished(sweep("lost", "--resume"))
    finished(sweep("whole"))
    assert table("lost") == table("whole")
    assert load_deck("wheel.yaml").deck.name == "wheel"


@pytest.mark.slow
class LosesThird:
    """A client whose scheduler is gone when the third job is fetched."""

    jobs = 0

    def nthreads(self):
        return {"a worker": 1}

    def submit(self, *given, key, pure):
        self.jobs += 1
        status = "finished" if self.jobs < 3 else "cancelled"
        return SimpleNamespace(key=key, status=status, result=lambda: (1.0, "", ""))

    def cancel(self, futures):
        pass


class Pool(list):
    add, has_ready, __next__ = list.append, list.__len__, partialmethod(list.pop, 0)


def test_the_job_at_which_a_scheduler_is_lost_is_none_that_was_done(monkeypatch):
    monkeypatch.setattr("hfsim.studies.cluster._distributed", lambda: SimpleNamespace(as_completed=Pool))
    jobs, done = Cluster(1, client=LosesThird()), []
    for key in range(6):
        jobs.add(Task(key, print, key))
    jobs.serve(lambda outcome: done.append(outcome.key))
    assert (done, jobs.unreached()) == ([0, 1], [2, 3, 4, 5])


def test_no_scheduler_is_told_before_anything_runs(wheel, monkeypatch):
    monkeypatch.setattr("hfsim.studies.cluster._CONNECT", 1.0)
    given = ["sweep", "wheel.yaml", "--vary", "springs.coil.stiffness=50,100", "-o", "none"]
    told = CliRunner().invoke(app, [*given, "--dask", "tcp://127.0.0.1:9"])
    assert told.exit_code == 2 and "no scheduler answers" in told.stderr
    assert not (wheel / "none").exists()


@pytest.mark.slow
def test_maps_are_computed_by_dask_too(wheel):
    words = ("stability", "wheel.yaml", "--vary", "springs.coil.stiffness=50,100", "--methods", "gauss,gear",
             "--models", "exact", "--no-plots", "--budget", "3min")  # fmt: skip
    for folder, more in (("plain", ()), ("dask", ("--dask", "local"))):
        finished(command("-m", "hfsim", *words, "-o", folder, "--jobs", 2, *more, stderr=subprocess.PIPE))
    one, other = (json.loads((wheel / folder / "stability.json").read_text()) for folder in ("plain", "dask"))
    seen = [[(p["method"], p["class"], p["time_error"]) for p in facts["points"]] for facts in (one, other)]
    assert seen[0] == seen[1] and len(seen[0]) == 4
