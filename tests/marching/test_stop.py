"""Budgets end runs in time, keep what was done, and tell how far they are used."""

import pytest

from hfsim.marching.integration import run_integration
from hfsim.marching.stop import SHIELD, Budget, Shield, TimeUp
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

WHEEL = """hfsim: 1
bodies: {wheel: {type: rigid, mass: 1.0, inertia: 2.0}}
joints: {axle: {type: revolute, between: [ground, wheel]}}
springs: {coil: {type: rotational, between: [ground, wheel], stiffness: 200.0}}
initial: {wheel: {angle: 0.1}}
solve: {duration: 1.0, step: 0.01, method: gear}
"""


class Clock:
    """One second passes each time it is read."""

    now = 0.0

    def __call__(self):
        self.now += 1.0
        return self.now


def test_a_guard_ends_a_run_and_its_steps_are_kept():
    scene, told = build(parse_deck(WHEEL)), []
    budget = Budget(20.0, Clock(), report=told.append)
    done = run_integration(scene, scene.deck.solve, budget.guard())
    assert isinstance(done.stop, TimeUp)
    assert 0 < len(done.trajectory.segments) < 100
    assert done.stop.share == pytest.approx(done.trajectory.t_end)
    assert told == sorted(told) and told[-1] == 1.0
    with pytest.raises(TimeUp, match=r"cut off at .* % of the duration"):
        done.in_time()


def test_a_guard_may_allow_less_than_the_budget():
    guard = Budget(100.0, Clock()).guard(2.5)
    guard(0.1)
    guard(0.2)
    with pytest.raises(TimeUp):
        guard(0.3)


def test_a_budget_of_no_time_is_used_up_at_once():
    budget = Budget(0.0, Clock())
    assert budget.left < 0.0
    with pytest.raises(TimeUp) as stop:
        budget.guard()(0.0)
    assert stop.value.share == 0.0


def test_a_shield_holds_an_interruption_back_until_what_it_guards_is_whole(monkeypatch):
    monkeypatch.setattr(SHIELD, "taken", None)  # which is put back, for the tests that follow
    done = []
    with pytest.raises(KeyboardInterrupt):
        with SHIELD:
            with SHIELD:
                SHIELD.interrupt(KeyboardInterrupt())
                done.append("inner")
            done.append("outer")
        done.append("beyond")
    assert done == ["inner", "outer"]
    with pytest.raises(KeyboardInterrupt):
        SHIELD.interrupt(KeyboardInterrupt())


def test_what_its_parent_shields_holds_nothing_back_in_a_process_forked_off():
    forked = Shield()
    forked.__enter__()
    forked.take_over(1)
    with pytest.raises(KeyboardInterrupt):
        forked.interrupt(KeyboardInterrupt())
