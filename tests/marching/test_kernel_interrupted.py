"""Signals while the kernel works: they end it soon, what was done is kept, and nothing of it stays behind."""

import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from natively import at_once, iterated, native

from hfsim.integrators._loop import AT_ONCE
from hfsim.marching.integration import run_integration
from hfsim.maths.recorder import Recorder
from hfsim.maths.recording import NUMPY, ORIGINAL
from hfsim.maths.traced import Recording
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck
from hfsim.scene.shipped import CASES

pytestmark = [native, pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers")]
LONG = {
    "hub_beams": ("solve.tolerance=1e-12", "solve.duration=50"),
    "pendulum": ("bodies.b1.elements=48", "solve.tolerance=1e-11", "solve.duration=50"),
}
"""Cases with settings by which they take minutes, the second one in steps of some ten milliseconds."""
HFSIM = str(CASES.parents[1])
SOON = 5.0
"""Time in which a process has to end after a signal, files included; the machine may be busy [s]."""


@contextmanager
def interrupted(after):
    """Let an interruption come some time from now [s]."""

    def interrupt(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, after)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_a_signal_ends_corrections_that_would_go_on():
    """With limits of 0 and corrections of 0 none is ever the last one."""
    tape, sizes = Recorder(), (np.zeros(()), np.zeros(()), np.ones(()))
    tape.cut()
    (nothing,) = tape.programs()
    begun = time.perf_counter()
    with pytest.raises(KeyboardInterrupt), interrupted(0.05):
        iterated(nothing, sizes, (0.0, 0.0, 0.0, 0.0), 2**31 - 1)
    assert time.perf_counter() - begun < 2.0


class Traced:
    """Notes the lines of hfsim that are gone through, and raises an interruption at one of them."""

    def __init__(self, at=-1):
        self.lines, self._at = [], at

    def __enter__(self):
        sys.settrace(self._of)

    def __exit__(self, *raised):
        sys.settrace(None)

    def _of(self, frame, event, arg):
        code = frame.f_code  # `on_tape` ends without calls: signals raise where calls begin and end
        return self._line if code.co_filename.startswith(HFSIM) and code.co_name != "on_tape" else None

    def _line(self, frame, event, arg):
        if event == "line":
            self.lines.append((frame.f_code.co_filename, frame.f_lineno))
            if len(self.lines) > self._at >= 0:
                sys.settrace(None)
                raise KeyboardInterrupt
        return self._line


@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("pendulum", "integrators/_replayed.py"),
        pytest.param("pendulum", "", marks=pytest.mark.slow),
        pytest.param("heavy_top", "", marks=pytest.mark.slow),
    ],
)
def test_after_an_interruption_a_run_is_as_ever(name, files, monkeypatch, rng):
    """In whichever line it came: the scene, with what was recorded by then, does the same to the last bit."""
    at_once(monkeypatch)

    def scene():
        return build(load_deck(CASES / f"{name}.yaml", ["solve.duration=0.1"]))

    def run(scene):
        done = run_integration(scene, scene.deck.solve)
        return done.stop, [step.q.tobytes() for step in (*done.trajectory.segments, done.trajectory)]

    run(scene())
    _, whole = run(scene())
    traced, often, again = Traced(), {}, scene()
    with traced:
        assert run(again) == (None, whole)
    for k, (file, line) in enumerate(traced.lines):
        if file.endswith(files):
            often.setdefault((file, line), []).append(k)
    assert len(often) > 30
    stops = []
    for times in often.values():
        again = scene()
        with suppress(KeyboardInterrupt), Traced(rng.choice(times)):
            stop, path = run(again)
            stops.append(stop)
            assert path[:-1] == whole[: len(path) - 1]
        assert Recording.tape is None
        assert all(NUMPY[one] is own for one, own in ORIGINAL.items())
        assert run(again) == (None, whole)
    assert stops and None not in stops


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("name", LONG)
def test_a_signal_ends_a_run_and_keeps_what_was_done(name, number, code, tmp_path):
    out = tmp_path / "out"
    settings = [word for one in LONG[name] for word in ("--set", one)]
    command = [sys.executable, "-m", "hfsim", "run", name, "--no-plots", "-o", str(out), *settings]
    own = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}  # else as of who calls
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **own) as process:
        wait_for_rows(out / "history.csv")
        process.send_signal(number)
        begun = time.perf_counter()
        _, told = process.communicate(timeout=60.0)
    assert time.perf_counter() - begun < SOON
    assert process.returncode == code and "interrupted at t = " in told and "Traceback" not in told
    facts = json.loads((out / "summary.json").read_text())
    assert (facts["status"], facts["exit_code"], facts["kernel"]) == ("interrupted", code, "native")
    # rejected steps are among them, and those of one call that an interruption takes back
    assert 0 < facts["native_steps"] <= facts["steps"] + facts["rejected"] + AT_ONCE
    rows = (out / "history.csv").read_text().splitlines()
    assert len(rows) > 3 and len({row.count(",") for row in rows}) == 1


def wait_for_rows(path, patience=60.0):
    end = time.monotonic() + patience
    while not path.exists() or path.read_bytes().count(b"\n") < 3:
        assert time.monotonic() < end, "no rows came"
        time.sleep(0.01)
