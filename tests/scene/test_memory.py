"""Memory: scenes of many elements are assembled with what their joints touch, and no more."""

import os
import re
import subprocess
import sys
import tracemalloc
from pathlib import Path

import pytest

from hfsim.errors import DeckError
from hfsim.scene import memory
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck

if not os.path.exists("/proc/self/status"):
    pytest.skip("needs /proc", allow_module_level=True)

CASE = Path(__file__).parents[2] / "cases" / "pendulum.yaml"
SCRIPT = """
import atexit
from hfsim.cli import main
atexit.register(lambda: print(open("/proc/self/status").read()))
main()
"""


def checked(*arguments, command="check"):
    """Return exit code, output, messages and the largest memory of a command in a process [MB]."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, command, *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    used = int(re.search(r"VmHWM:\s*(\d+) kB", done.stdout)[1]) / 1024
    return done.returncode, done.stdout, done.stderr, used


@pytest.mark.parametrize(("elements", "most"), [(5000, 250), (100_000, 550)])
def test_the_rank_of_the_joints_takes_little_memory(elements, most):
    code, out, _, used = checked("hub_beams", "--set", f"bodies.b1.elements={elements}")
    assert code == 0 and "3 multipliers" in out
    assert used < most


@pytest.mark.parametrize(
    ("settings", "path", "size"),
    [
        (("solve.model=lowOrder", "bodies.b1.elements=5000"), "bodies.b1.elements", "1.17 TB"),
        (("solve.coordinates=frame", "bodies.b1.elements=20000"), "bodies.b1.elements", "820 GB"),
        (("output.interval=1e-9",), "output.interval", "418 GB"),
        (("solve.model=linear", "bodies.bend.elements=3000"), "bodies.bend.elements", "3.27 TB"),
    ],
)
def test_what_would_not_fit_is_refused_with_its_bytes_before_it_is_asked_for(settings, path, size):
    deck = {"lowOrder": "hub_beams", "linear": "bend_45"}.get(settings[0].split("=")[1], "pendulum")
    code, _, err, used = checked(deck, *(f"--set={setting}" for setting in settings))
    assert code == 2 and used < 120
    assert f"error: {path}: " in err and f"about {size} of memory" in err


def test_what_fits_depends_on_the_memory_that_is_there(monkeypatch):
    loaded = load_deck(CASE, ["solve.coordinates=frame", "bodies.b1.elements=500"])
    build(loaded)
    monkeypatch.setattr(memory, "available", lambda: 4e8)
    with pytest.raises(DeckError, match=r"about 520 MB of memory, of which there are 400 MB"):
        build(loaded)
    build(load_deck(CASE, ["bodies.b1.elements=500"]))
    monkeypatch.setattr(memory, "available", lambda: 1e9)
    with pytest.raises(DeckError, match=r"about 1.2 GB of memory.*: it has 400000 coordinates"):
        build(load_deck(CASE, ["bodies.b1.elements=99999"]))


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
def test_matrices_of_linear_sections_are_some_of_what_a_run_takes(model):
    """Peak of one derivative, which comes before those are factorised."""
    loaded = load_deck(CASE.with_name("bend_45.yaml"), [f"solve.model={model}", "bodies.bend.elements=20"])
    tracemalloc.start()
    scene = build(loaded)
    scene.system.linearized(0.0, scene.q, scene.v)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.2 < peak / scene.bodies["bend"].tables(scene.system.n) < 1.0


def test_factors_of_low_order_are_what_a_run_takes(tmp_path):
    """Peak of a run, beyond what its assembly takes, against what is expected of it."""
    settings = ["solve.model=lowOrder", "bodies.b1.elements=40", "solve.duration=0.002"]
    body = build(load_deck(CASE, settings)).bodies["b1"]
    settings = [f"--set={one}" for one in settings]
    before = checked("pendulum", *settings)[-1]
    quietly = "-q", "--no-plots", "-o", str(tmp_path / "run")
    code, _, _, used = checked("pendulum", *settings, *quietly, command="run")
    assert code == 0
    assert 0.3 < (used - before) * 1024**2 / body.tables(body.columns.stop) < 1.3
