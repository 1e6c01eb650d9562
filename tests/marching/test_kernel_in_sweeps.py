"""Sweeps in a pool of processes, each of which records for itself."""

import csv
import os
import threading

import pytest
from called import call
from natively import at_once, native

from hfsim.maths import kernel
from hfsim.maths.recorder import Recorder
from hfsim.maths.recording import on_tape

pytestmark = [native, pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes of this kind")]
SCENE = (
    "pendulum",
    "--set",
    "solve.duration=0.05",
    "--vary",
    "gravity.1=lin(-9,-5,8)",
    "--no-plots",
    "--limit",
    "5 s",
)


def swept(folder, jobs):
    """Return the rows of a sweep without their times."""
    told = call("sweep", *SCENE, "--jobs", str(jobs), "-o", str(folder))
    assert told.exit_code == 0, told.output
    with (folder / "sweep.csv").open(newline="") as file:
        return [{key: value for key, value in row.items() if key != "cpu_s"} for row in csv.DictReader(file)]


@pytest.fixture
def recorders(tmp_path, monkeypatch):
    """Return a file that gets the process of each recording that is made."""
    at_once(monkeypatch)
    told, programs = tmp_path / "processes", Recorder.programs

    def noted(self, *kept):
        with told.open("a") as file:
            file.write(f"{os.getpid()}\n")
        return programs(self, *kept)

    monkeypatch.setattr(Recorder, "programs", noted)
    return told


@pytest.mark.slow
def test_a_pool_finds_what_one_process_finds(recorders, tmp_path):
    """To the last digit, also one that begins while another thread records: processes are not forked then."""
    alone = swept(tmp_path / "alone", 1)
    recorders.unlink()
    assert swept(tmp_path / "pooled", 2) == alone and len(alone) == 8
    assert len(set(recorders.read_text().split()) - {str(os.getpid())}) == 2
    stop = threading.Event()

    def record():
        while not stop.is_set():
            on_tape(Recorder(), lambda: stop.wait(0.02))

    thread = threading.Thread(target=record)
    thread.start()
    try:
        assert swept(tmp_path / "beside", 2) == alone
    finally:
        stop.set()
        thread.join()


@pytest.mark.slow
def test_a_pool_with_the_kernel_tells_what_one_in_numpy_tells(recorders, monkeypatch, tmp_path):
    native = swept(tmp_path / "native", 2)
    assert recorders.exists()
    monkeypatch.setattr(kernel, "KERNEL", "numpy")
    for one, other in zip(native, swept(tmp_path / "numpy", 2), strict=True):
        assert one["status"] == other["status"] == "done"
        for name in (name for name in one if "(" in name):
            assert float(one[name]) == pytest.approx(float(other[name]), rel=1e-9, abs=1e-10), name
