"""A small sample of `python tests/fuzz.py`: no deck, however broken, causes an internal error."""

from pathlib import Path

import fuzz
import pytest


def judged(tmp_path, count, run=False):
    found = list(
        fuzz.verdicts(range(count), lambda number: fuzz.mutant(0, number, run), run, tmp_path / "base")
    )
    assert [one.number for one in found] == list(range(count))
    return found


def test_mutants_through_the_check(tmp_path):
    found = judged(tmp_path, 80)
    assert not [(one.number, one.faults) for one in found if one.faults]
    assert {one.code for one in found} == {0, 2}


def test_mutants_through_short_runs(tmp_path):
    found = judged(tmp_path, 8, run=True)
    assert not [(one.number, one.faults) for one in found if one.faults]
    assert 0 in {one.code for one in found}


def test_mutants_follow_from_seed_and_number():
    assert [fuzz.mutant(3, k).data for k in range(20)] == [fuzz.mutant(3, k).data for k in range(20)]
    assert len({fuzz.mutant(3, k).data for k in range(20)}) > 15


def deck_causing(monkeypatch, tmp_path, what):
    """Judge one good deck whose check does something that none may do."""
    import hfsim.simulate

    monkeypatch.setattr(hfsim.simulate, "check", what)
    one = fuzz.Mutant("one", "", fuzz.CASES[0].read_bytes())
    (found,) = fuzz.verdicts([0], lambda number: one, False, tmp_path / "base")
    return " | ".join(found.faults)


def crash(loaded):
    import os
    import signal

    os.kill(os.getpid(), signal.SIGSEGV)


def warn(loaded):
    import numpy as np

    return {"bodies": {}, "unknowns": int(np.float64(1e308) * 10 > 0), "multipliers": 0}


def write(loaded):
    Path("../elsewhere.txt").write_text("")
    return {"bodies": {}, "unknowns": 0, "multipliers": 0}


def tell(loaded):
    import os

    os.write(1, b" \x1b[31m** On entry to DLASCL\n")
    return {"bodies": {}, "unknowns": 0, "multipliers": 0}


@pytest.mark.parametrize(
    ("what", "fault"),
    [
        (lambda loaded: 1 / 0, "internal error: ZeroDivisionError"),
        (crash, "crash of the interpreter: SIGSEGV"),
        (warn, "warning of a library"),
        (write, "wrote "),
        (tell, "control character"),
        (tell, "DLASCL"),
    ],
)
def test_faults_are_found(monkeypatch, tmp_path, what, fault):
    assert fault in deck_causing(monkeypatch, tmp_path, what)


def test_an_endless_check_is_found(monkeypatch, tmp_path):
    def spin(loaded):
        while True:
            pass

    monkeypatch.setattr(fuzz, "CHECK_SECONDS", 0.2)
    assert deck_causing(monkeypatch, tmp_path, spin) == "endless"


@pytest.mark.parametrize(
    ("name", "text", "wrong"),
    [
        ("a.csv", "t,nan.x\n0.0,1e5\n", ""),
        ("a.csv", "t,x\n0.0,nan\n", "nan"),
        ("a.json", '{"nan": "Infinity"}', ""),
        ("a.json", '{"a": [1, -Infinity]}', "-Infinity"),
        ("a.yaml", "nan: 1.5\nb: inf\n", ""),
        ("a.yaml", "a: [1.0, .nan]\n", ".nan"),
    ],
)
def test_numbers_that_are_not_finite_are_found(tmp_path, name, text, wrong):
    (tmp_path / name).write_text(text)
    assert fuzz.not_finite(tmp_path / name) == wrong
