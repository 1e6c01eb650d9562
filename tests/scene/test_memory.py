"""Memory: scenes of many elements are assembled with what their joints touch, and no more."""

import os
import re
import subprocess
import sys

import pytest

if not os.path.exists("/proc/self/status"):
    pytest.skip("needs /proc", allow_module_level=True)

SCRIPT = """
import sys
from hfsim.cli import main
try:
    sys.exit(main())
finally:
    sys.stdout.write(open("/proc/self/status").read())
"""


def checked(*arguments):
    """Return exit code, output, messages and the largest memory of `hfsim check` in a process [MB]."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, "check", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    used = int(re.search(r"VmHWM:\s*(\d+) kB", done.stdout)[1]) / 1024
    return done.returncode, done.stdout, done.stderr, used


@pytest.mark.parametrize(("elements", "most"), [(5000, 250), (100_000, 900)])
def test_the_rank_of_the_joints_takes_little_memory(elements, most):
    code, out, _, used = checked("hub_beams", "--set", f"bodies.b1.elements={elements}")
    assert code == 0 and "3 multipliers" in out
    assert used < most
