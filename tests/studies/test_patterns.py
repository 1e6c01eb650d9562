"""Patterns in what studies vary and collect."""

from pathlib import Path

import numpy as np
import pytest
from called import call

import hfsim
from hfsim.errors import DeckError

MASSES = """
hfsim: 1
name: masses
parameters: {n: 3}
ground: {points: {wall: [-1, 0]}}
bodies:
  m{k=1..n}: {type: rigid, mass: "${k}", inertia: 0.01}
joints:
  slide{k=1..n}: {type: prismatic, between: [ground, "m{k}"], axis: [1, 0]}
springs:
  coil{k=1..n}: {type: two_point, between: [ground.wall, "m{k}"], stiffness: 100.0, rest_length: 1.0}
loads:
  push{k=1..n}: {type: force, at: "m{k}", force: [1, 0]}
solve: {duration: 0.1}
output: {channels: ["m{k=1..n}.x"]}
"""


@pytest.fixture
def masses(here):
    (here / "masses.yaml").write_text(MASSES)
    return "masses.yaml"


def test_derivatives_by_patterns_are_at_the_one_value_of_all_copies(masses):
    both = ["springs.coil{k}.stiffness", "springs.coil3.stiffness"]
    found = hfsim.sensitivity(masses, both, ["final(m3.x)"])
    one = hfsim.sensitivity(masses, ["springs.coil3.stiffness"], ["final(m3.x)"])
    assert [each.at for each in found] == [100.0, 100.0]
    assert found[0].value == one[0].value
    assert found[1].derivative == pytest.approx(one[0].derivative, rel=1e-4)
    with pytest.raises(DeckError, match=r"m\{k\}\.mass: its copies differ, as 1.0 and 2.0 do, .*one by one"):
        hfsim.sensitivity(masses, ["bodies.m{k}.mass"], ["final(m3.x)"])
    (said,) = hfsim.sensitivity(masses, {"bodies.m{k}.mass": 3.0}, ["final(m3.x)"])
    assert said.at == 3.0 and said.value == one[0].value


def test_counts_have_no_derivatives(masses):
    why = r"parameters\.n: has no derivative, as values beside 3 are refused: n must be a whole number"
    with pytest.raises(DeckError, match=why):
        hfsim.sensitivity(masses, ["parameters.n"], ["final(m3.x)"])


COUNTS = {"parameters.n": [2, 3, 4]}
QUICK = {"error_estimate": False, "jobs": 1}


def of_copy(masses, number, count):
    """The end of one copy in a run of so many."""
    changes = {"parameters.n": count, "output.channels": [f"m{number}.x"]}
    return hfsim.run(masses, changes, error_estimate=False).final[f"m{number}.x"]


def test_what_is_collected_is_of_the_copy_that_each_run_has(masses):
    found = hfsim.sweep(masses, COUNTS, ["final(m{n}.x)"], **QUICK)
    assert found.collected == ("final(m3.x)",)
    own = [of_copy(masses, n, n) for n in (2, 3, 4)]
    np.testing.assert_allclose(found["final(m3.x)"], own, rtol=1e-9)
    assert set(found["status"]) == {"done"} and set(found["reason"]) == {""}


def test_a_copy_of_a_number_is_that_in_each_run_and_nothing_where_there_is_none(masses):
    for text in ("final(m3.x)", "final(m{k=3..n}.x)"):
        found = hfsim.sweep(masses, COUNTS, [text], {"output.channels": ["m{n}.vx"]}, **QUICK)
        expected = [np.nan, of_copy(masses, 3, 3), of_copy(masses, 3, 4)]
        np.testing.assert_allclose(found["final(m3.x)"], expected, rtol=1e-9)
        assert "no channel 'm3.x'" in found["reason"][0]


def test_columns_are_found_by_the_texts_that_ask_for_them(masses):
    texts = ["max(m1.x, 50 ms..)", "at(0.10, m{n}.x)", "final(m{k=1..2}.x)"]
    found = hfsim.sweep(masses, {"parameters.n": [3]}, texts, **QUICK)
    assert found.collected[:2] == ("max(m1.x, 0.05..)", "at(0.1, m3.x)")
    for text, name in zip(texts, found.collected[:2], strict=False):
        assert found[text] is found[name] and text in found
    with pytest.raises(KeyError):
        found[texts[2]]


def test_times_follow_the_parameters_of_each_run(masses):
    found = hfsim.sweep(masses, COUNTS, ["at(${n / 50}, m{k=1..2}.x)"], **QUICK)
    assert found.collected == ("at(0.06, m1.x)", "at(0.06, m2.x)")
    own = [hfsim.sweep(masses, {"parameters.n": [n]}, [f"at({n / 50}, m1.x)"], **QUICK) for n in (2, 3, 4)]
    assert [*found["at(0.06, m1.x)"]] == [one[one.collected[0]][0] for one in own]


def test_without_collect_it_is_the_channels_of_each_run(masses):
    found = hfsim.sweep(masses, COUNTS, (), {"output.channels": ["m1.x", "m{n}.x"]}, **QUICK)
    assert found.collected[0] == "final(m1.x)" and found.collected[3] == "final(m3.x)"
    np.testing.assert_allclose(found["final(m3.x)"], [of_copy(masses, n, n) for n in (2, 3, 4)], rtol=1e-9)
    each = hfsim.sweep(masses, COUNTS, (), **QUICK).collected
    assert each == tuple(f"{kind}(m{k}.x)" for k in (1, 2, 3) for kind in ("final", "min", "max"))


@pytest.mark.parametrize(
    ("collect", "why"),
    [
        (["final(m{q}.x)"], r"final\(m\{q\}\.x\): there is no parameter or index 'q'"),
        (["final(m{n+1}.x)"], r"final\(m4\.x\): there is no body, joint or spring 'm4'"),
        (["final(m{n}.x)", "final(m3.x)"], r"is final\(m3.x\) in the deck, and a column already"),
        (['final("m{n}.x")'], "there is no body"),
    ],
)
def test_what_cannot_be_collected_is_refused_as_it_was_written(masses, collect, why):
    with pytest.raises(DeckError, match=f"^collect: error: .*{why}"):
        hfsim.sweep(masses, COUNTS, collect, **QUICK)


def test_options_take_names_with_braces(masses):
    quick = ("--no-plots", "--set", "solve.duration=0.01")
    swept = call("sweep", masses, "--vary", "bodies.m{k}.mass=1,2", "--collect", "final(m{n}.x)", *quick)
    assert swept.exit_code == 0, swept.stderr
    assert Path("masses.sweep/sweep.csv").read_text().startswith("run,bodies.m{k}.mass,final(m3.x),")
    ran = call("run", masses, "--target-error", "0.1", "--target-channels", "m1.x, m{n}.x", *quick)
    assert ran.exit_code == 0, ran.stderr
    compared = call("compare", "exact", "--case", masses, "--channels", "m{n}.x", *quick)
    assert compared.exit_code == 0, compared.stderr
    refused = call("compare", "exact", "--case", masses, "--channels", "m{q}.x", *quick)
    assert "channel 'm{q}.x': there is no parameter or index 'q'" in refused.stderr
