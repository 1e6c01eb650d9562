"""Memory: scenes of many elements are assembled with what their joints touch, and no more."""

import os
import subprocess
import sys

import pytest

ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}


def checked(*arguments):
    """Return exit code, output, messages and the largest memory of `hfsim check` in a process [MB]."""
    command = [sys.executable, "-m", "hfsim", "check", *arguments]
    done = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    )
    out, err = done.stdout.read(), done.stderr.read()
    _, status, used = os.wait4(done.pid, 0)
    done.returncode = os.waitstatus_to_exitcode(status)
    return done.returncode, out, err, used.ru_maxrss / 1024


@pytest.mark.parametrize(("elements", "most"), [(5000, 250), (100_000, 900)])
def test_the_rank_of_the_joints_takes_little_memory(elements, most):
    code, out, _, used = checked("hub_beams", "--set", f"bodies.b1.elements={elements}")
    assert code == 0 and "3 multipliers" in out
    assert used < most
