"""What tests of several rooms take."""

import os

# two processes with two threads each wait for one another, and sums by threads round in a way of their own
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # reads that
import pytest


@pytest.fixture
def rng():
    """Random numbers, the same in every run."""
    return np.random.default_rng(17)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder that is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
