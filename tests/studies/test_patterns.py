"""Patterns in what studies vary and collect."""

import pytest

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
