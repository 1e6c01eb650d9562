"""Faults around a run: kills, signals, a full disk, missing places. Each folder must say what it is.

    python tests/faults.py [--count 200] [--seed 1] [--only kills,signals,...]

``kills`` ends runs with SIGKILL at random moments of every phase, looks at what is left, and resumes: the
history must be byte-equal to that of a run without interruption.  Prints a line for each fault found and a
count for each kind of trial; the exit code is 1 if there is any.
"""

import argparse
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

START = """
import sys, hfsim.output.recording, hfsim.marching.record
hfsim.output.recording.EVERY, hfsim.marching.record.BLOCK = 0.1, 0.01
from hfsim.cli import main
sys.argv[0] = "hfsim"
main()
"""
DECKS = {
    "gauss": ("pendulum", "solve.method=gauss", "solve.duration=4"),
    "radau": ("pendulum", "solve.method=radau", "solve.duration=2"),
    "energy": ("pendulum", "solve.method=energy", "solve.step=2e-3", "solve.duration=1"),
    "gear": ("pendulum", "solve.method=gear", "solve.tolerance=1e-5", "solve.duration=1"),
    "gear, fixed steps": ("pendulum", "solve.method=gear", "solve.step=1e-3", "solve.duration=0.5"),
    "generalized_alpha": ("pendulum", "solve.method=generalized_alpha", "solve.tolerance=1e-5"),
    "explicit": ("pendulum", "solve.method=explicit", "solve.tolerance=1e-5", "solve.duration=0.3"),
    "auto": ("hub_beams", "solve.duration=0.3"),
    "lowOrder": ("two_beams", "solve.model=lowOrder", "solve.duration=1"),
    "models chosen in the run": ("pendulum", "solve.model=auto", "solve.duration=3"),
    "parts": (str(Path(__file__).parents[1] / "cases/rules/spare.yaml"), "solve.duration=4"),
}
"""What is run, by a name; a second or two each."""
CODES = {signal.SIGTERM: 143, signal.SIGINT: 130, signal.SIGHUP: 143}
PATIENCE = 20.0
"""Longest time to react to a signal [s]."""


class Trials:
    """Trials in a place of their own, with the faults they have shown."""

    def __init__(self, place, seed):
        self.place, self.random = Path(place), random.Random(seed)
        self.faults, self.counts, self.whole = [], {}, {}

    def run(self, what, out, *more, **how):
        deck, *settings = DECKS[what]
        command = [sys.executable, "-c", START, "run", deck, "-o", str(out), *more]
        for setting in settings:
            command += ["--set", setting]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **how)

    def reference(self, what):
        """Return history and wall time of a run that nothing disturbs."""
        if what not in self.whole:
            out, begun = self.place / f"whole {len(self.whole)}", time.perf_counter()
            process = self.run(what, out, "-q", "--no-plots")
            told = process.communicate()[1].decode()
            if process.returncode:
                raise SystemExit(f"{what} does not run: {told}")
            self.whole[what] = (out / "history.csv").read_bytes(), time.perf_counter() - begun
        return self.whole[what]

    def fault(self, kind, words):
        self.faults.append(f"{kind}: {words}")
        print(self.faults[-1], flush=True)

    def look(self, kind, out):
        """Check that all that is in a folder can be read, and return the status it tells."""
        if not out.exists():
            return ""
        for file in sorted(out.rglob("*")):
            if file.is_dir() or file.name.startswith(".") or ".plots.part" in file.parts:
                continue
            try:
                _read(file)
            except Exception as error:
                self.fault(kind, f"{file} cannot be read: {type(error).__name__}: {error}")
        summary = out / "summary.json"
        if not summary.exists():
            history = out / "history.csv"
            if history.exists() and history.read_bytes().count(b"\n") > 1:
                self.fault(kind, f"{out} has rows and says nothing of them")
            return ""
        return json.loads(summary.read_text())["status"]

    def resume(self, kind, what, out):
        """Resume until the run is done, and hold its history against the undisturbed one."""
        process = self.run(what, out, "-q", "--resume", "--no-plots", "--after", "none")
        told = process.communicate()[1].decode()
        if process.returncode or self.look(kind, out) != "done":
            self.fault(kind, f"{what} was not resumed: {process.returncode}, {told}")
        elif (out / "history.csv").read_bytes() != self.reference(what)[0]:
            self.fault(kind, f"{what} resumed in {out} gives another history")
        else:
            shutil.rmtree(out)

    def count(self, kind, outcome):
        key = kind, outcome
        self.counts[key] = self.counts.get(key, 0) + 1

    # --- kinds of trials --------------------------------------------------------------------------

    def kills(self, number):
        """SIGKILL at a random moment."""
        self._ended_by("kills", number, [signal.SIGKILL])

    def signals(self, number):
        """SIGTERM, SIGINT or SIGHUP at a random moment: exit code, status, time to react."""
        self._ended_by("signals", number, list(CODES))

    def _ended_by(self, kind, number, signals):
        what, by = self.random.choice(list(DECKS)), self.random.choice(signals)
        pictures = () if self.random.random() < 0.3 else ("--no-plots",)
        moment = self.random.uniform(0.2, 1.0) * self.reference(what)[1]
        out = self.place / f"{kind} {number}"
        process = self.run(what, out, *pictures)
        try:
            process.wait(moment)
        except subprocess.TimeoutExpired:
            process.send_signal(by)
        sent = time.perf_counter()
        try:
            told = process.communicate(timeout=PATIENCE)[1].decode()
        except subprocess.TimeoutExpired:
            process.kill()
            return self.fault(kind, f"{what} did not end for {PATIENCE} s after {by.name} at {moment:.2f} s")
        code, status = process.returncode, self.look(kind, out)
        self.count(kind, f"{by.name}: {status or 'before the first step'}")
        allowed = {0, -by.value, CODES.get(by, 0)}
        if code == -by.value and not status:  # before the program could take signals
            pass
        elif code not in allowed or "Traceback" in told or "internal error" in told:
            self.fault(kind, f"{what} ended {code} after {by.name} at {moment:.2f} s: {told[-500:]}")
        if by in CODES and code == CODES[by] and status not in ("interrupted", "done", ""):
            self.fault(kind, f"{what}: status {status} after {by.name} at {moment:.2f} s")
        if time.perf_counter() - sent > 5.0:
            self.fault(kind, f"{what} took {time.perf_counter() - sent:.1f} s to end after {by.name}")
        return self.resume(kind, what, out)

    def disk(self, number):
        """A file that may not grow any more, as on a full disk: whole rows, and a run that can be resumed."""
        what, out = self.random.choice(list(DECKS)), self.place / f"disk {number}"
        most = self.random.randint(3000, max(4000, int(0.9 * len(self.reference(what)[0]))))

        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))

        process = self.run(what, out, "--no-plots", preexec_fn=limit)
        told = process.communicate()[1].decode()
        self.count("disk", f"code {process.returncode}")
        if process.returncode not in (1, 5) or "Traceback" in told or "internal error" in told:
            self.fault("disk", f"{what} ended {process.returncode} at {most} bytes: {told[-500:]}")
        self.look("disk", out)
        history = out / "history.csv"
        if history.exists() and history.stat().st_size and not history.read_bytes().endswith(b"\n"):
            self.fault("disk", f"{what} left a row cut in half at {most} bytes")
        self.resume("disk", what, out)

    def places(self, number):
        """Folders that cannot be written to, missing HOME and TMPDIR, closed and broken streams."""
        out = self.place / f"places {number}"
        trials = {
            "no home": {"env": os.environ | dict.fromkeys(("HOME", "TMPDIR", "MPLCONFIGDIR"), "/nowhere")},
            "stdout closed": {"preexec_fn": lambda: os.close(1)},
            "stderr closed": {"preexec_fn": lambda: os.close(2)},
            "all closed": {"preexec_fn": lambda: [os.close(k) for k in (0, 1, 2)]},
        }
        name, how = list(trials.items())[number % len(trials)]
        process = self.run("gauss", out, **how)
        process.communicate()
        status = self.look("places", out)
        self.count("places", f"{name}: code {process.returncode}")
        if process.returncode or status != "done":
            self.fault("places", f"{name}: code {process.returncode}, status {status}")

    def rivals(self, number):
        """Two runs into one folder: one does its work, the other is refused."""
        out = self.place / f"rivals {number}"
        both = [self.run("gauss", out, "--no-plots") for _ in range(2)]
        told = [process.communicate()[1].decode() for process in both]
        codes = sorted(process.returncode for process in both)
        self.count("rivals", f"codes {codes}")
        if codes != [0, 2] or self.look("rivals", out) != "done":
            self.fault("rivals", f"codes {codes}: {told}")

    def memory(self, number):
        """Little memory: an end in words."""
        out, most = self.place / f"memory {number}", self.random.randint(350, 700) * 10**6

        def limit():
            resource.setrlimit(resource.RLIMIT_AS, (most, most))

        process = self.run("auto", out, "--no-plots", "--set", "bodies.b1.elements=400", preexec_fn=limit)
        told = process.communicate()[1].decode()
        self.count("memory", f"code {process.returncode}")
        if process.returncode < 0 or "Traceback" in told or "internal error" in told:
            self.fault("memory", f"ended {process.returncode} with {most} bytes: {told[-300:]}")
        self.look("memory", out)


SHARES = {"kills": 1.0, "signals": 0.5, "disk": 0.1, "places": 0.04, "rivals": 0.02, "memory": 0.03}
"""Kinds of trials, and how many there are of each for one kill."""


def _read(file):
    """Read a result; raises if it is not whole."""
    data = file.read_bytes()
    if file.suffix == ".json":
        json.loads(data, parse_constant=lambda text: 1 / 0)
    elif file.suffix == ".yaml":
        assert yaml.safe_load(data), "empty"
    elif file.suffix == ".png":
        assert data.startswith(b"\x89PNG") and data.endswith(b"IEND\xaeB`\x82"), "not whole"
    elif file.suffix == ".npz":
        import numpy as np

        with np.load(file, allow_pickle=False) as arrays:
            assert len(dict(arrays)), "empty"
    elif file.suffix == ".csv":
        rows = data.decode().split("\n")[:-1]
        assert len({row.count(",") for row in rows}) <= 1, "rows of different length"
        assert all(float(x) - float(x) == 0.0 for row in rows[1:] for x in row.split(",")), "not finite"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=200, help="kills; the other kinds follow")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(SHARES), help="kinds of trials")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="hfsim-faults-") as place:
        trials = Trials(place, chosen.seed)
        for kind in chosen.only.split(","):
            for number in range(max(1, round(chosen.count * SHARES[kind]))):
                getattr(trials, kind)(number)
    for (kind, outcome), number in sorted(trials.counts.items()):
        print(f"{kind:8} {number:4} x {outcome}")
    print(f"{len(trials.faults)} faults")
    return 1 if trials.faults else 0


if __name__ == "__main__":
    sys.exit(main())
