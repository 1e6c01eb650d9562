"""Rows as they come, and runs that are put down and taken up again: the same bytes, whatever happened."""

import io
from pathlib import Path

import numpy as np
import pytest

import hfsim.marching.record
from hfsim.commands.init import starters
from hfsim.errors import LimitReached
from hfsim.integrators import Segment, Trajectory, _loop
from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import output_times
from hfsim.maths.arrays import at_once
from hfsim.mechanics.system import System
from hfsim.parts.channels import CHANNELS
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate
from hfsim.trust.growth import disturbed_growth

CASES = Path(__file__).parents[2] / "cases"


class Notes:
    """A sink that ends the run after some blocks."""

    def __init__(self, most=10**9):
        self.tables, self.memories, self.most = [], [], most
        self.told = []

    def begin(self, channels):
        self.told.append(tuple(channels))

    def rows(self, table):
        self.tables.append(table)

    def block(self, memory):
        self.memories.append((memory, np.concatenate(self.tables)))
        if len(self.memories) >= self.most:
            raise LimitReached("enough blocks")

    def solved(self, run):
        self.told.append(run.status)

    def put_down(self):
        """Return the last memory as a file gives it back."""
        memory, table = self.memories[-1]
        file = io.BytesIO()
        np.savez(file, **memory())
        file.seek(0)
        return {**np.load(file, allow_pickle=False), "table": table}

    @property
    def table(self):
        return np.concatenate(self.tables)


def run(loaded, sink, memory=None):
    return simulate(loaded, error_estimate=False, outlines=False, sink=sink, memory=memory)


TURNING = """hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 1, model: auto}}
joints: {pin: {type: revolute, between: [ground, b1.root]}}
gravity: [0.0, -9.81]
loads:
  push: {type: force, at: b1.tip, force: [0.0, 60.0], follower: true,
         law: {type: smooth_step, from: 0, to: 1, start: 0.2, end: 0.7}}
solve: {duration: 0.9, tolerance: 1.0e-6, model_error: 1.0e-3}
"""


LATCHED = """hfsim: 1
bodies:
  cart: {type: rigid, mass: 1.0, inertia: 1.0}
  flap: {type: rigid, mass: 4.0, inertia: 0.4, points: {edge: [-0.5, 0]}}
joints:
  rail: {type: prismatic, between: [ground, cart]}
  hinge: {type: revolute, between: [ground, flap.edge], latch: {angle: 1.5, stiffness: 500, damping: 0.5}}
springs:
  drive: {type: rotational, between: [ground, flap], stiffness: 0.2, rest_angle: 2.0}
  band: {type: two_point, between: [ground, cart], stiffness: 5.0}
initial: {cart: {position: [1, 0]}, flap: {angle: 0}}
solve: {duration: 24, method: radau, tolerance: 1.0e-8}
output: {interval: 0.5, channels: [hinge.angle, hinge.torque, energy.total]}
"""


def loaded_from(deck, overrides):
    return load_deck(CASES / deck, overrides) if "\n" not in deck else parse_deck(deck, "deck", overrides)


SCENES = {
    "one body": ("pendulum.yaml",),
    "parts side by side": ("rules/spare.yaml",),
    "variable mass and its watch": ("two_beams.yaml", "solve.model=lowOrder", "solve.duration=0.5"),
    "several models in turn": (TURNING,),
    "a latch, by itself": (LATCHED, "solve.keep=[parts]"),
    "a latch in one of the parts": (LATCHED,),
    "gear": ("pendulum.yaml", "solve.method=gear", "solve.tolerance=1e-4", "solve.duration=0.3"),
}


@pytest.fixture
def short_blocks(monkeypatch):
    monkeypatch.setattr(hfsim.marching.record, "BLOCK", 0.002)
    monkeypatch.setattr(_loop, "AT_ONCE", 3)


@pytest.mark.parametrize("deck, overrides", [(d, o) for d, *o in SCENES.values()], ids=SCENES)
def test_a_run_that_is_put_down_again_and_again_gives_the_same_rows(deck, overrides, short_blocks):
    loaded = loaded_from(deck, overrides)
    whole = Notes()
    reference = run(loaded, whole)
    assert reference.status == "done"
    assert len(whole.memories) >= 3
    memory, rounds = None, 0
    while True:
        notes = Notes(most=2 + 2 * rounds)
        done = run(loaded, notes, memory)
        assert notes.table.tobytes() == whole.table[: len(notes.table)].tobytes()
        if done.status == "done":
            break
        assert done.status == "limit"
        memory, rounds = notes.put_down(), rounds + 1
    assert rounds >= 2
    assert done.t.tobytes() == reference.t.tobytes()
    for mine, theirs in zip(done.channels, reference.channels, strict=True):
        assert mine.values.tobytes() == theirs.values.tobytes()
    for key in ("steps", "rejected", "evaluations", "newton_iterations"):
        assert done.statistics[key] == reference.statistics[key]
    assert done.statistics["energy_drift"] == pytest.approx(reference.statistics["energy_drift"], rel=1e-6)


def test_a_run_that_counts_turns_goes_on_to_the_last_bit(monkeypatch):
    """Where steps made at once end depends on where angles were noted last."""
    monkeypatch.setattr(hfsim.marching.record, "BLOCK", 0.002)
    loaded = load_deck(CASES / "joints.yaml", ["solve.duration=4.0", "output.interval=0.02"])
    whole, notes = Notes(), Notes(most=2)
    reference = run(loaded, whole)
    assert run(loaded, notes).status == "limit"
    done = run(loaded, Notes(), notes.put_down())
    assert done.table.tobytes() == reference.table.tobytes()
    for key in ("energy_drift", "work_done"):
        assert done.statistics[key] == reference.statistics[key]


def test_rows_come_while_the_run_goes_on_and_do_not_depend_on_blocks(short_blocks, monkeypatch):
    loaded = load_deck(CASES / "pendulum.yaml")
    many, one = Notes(), Notes()
    run(loaded, many)
    monkeypatch.setattr(hfsim.marching.record, "BLOCK", np.inf)
    run(loaded, one)
    assert len(many.tables) > 3 and len(one.tables) == 1
    assert many.told == [loaded.deck.channels, "done"]
    assert many.table == pytest.approx(one.table, rel=1e-12, abs=1e-12)


def test_states_of_rows_and_of_power_come_in_batches_however_many_they_are(monkeypatch):
    """All at once those of a run with 1e5 rows took ten gigabytes."""
    sizes = {"project": [], "power": []}

    def noting(name):
        whole = getattr(System, name)

        def noted(system, t, *rest, **how):
            sizes[name].append(len(t))
            return whole(system, t, *rest, **how)

        return noted

    for name in sizes:
        monkeypatch.setattr(System, name, noting(name))
    loaded = load_deck(CASES / "joints.yaml", ["output.interval=1e-5", "solve.duration=0.01"])
    done = run(loaded, None)
    assert len(done.t) == 1001
    most = at_once(build(loaded).system.n)
    assert 1001 / 10 < most < 1001 / 2
    assert sum(sizes["project"]) >= 1001 and 0 < max(sizes["project"]) <= most
    assert 0 < max(sizes["power"]) <= most


def test_where_a_limit_stopped_the_steps_is_told_beside_the_last_row():
    loaded = load_deck(CASES / "pendulum.yaml", ["solve.max_steps=3", "output.interval=0.5"])
    done = run(loaded, None)
    assert (done.status, done.end_time) == ("limit", 0.0)
    assert done.stop_time == done.reached > 1e-3


@pytest.mark.parametrize("interval, rows", [(0.3, [0.0, 0.3, 0.6, 0.9, 1.0]), (5.0, [0.0, 1.0])])
def test_the_last_state_is_written(interval, rows):
    loaded = load_deck(CASES / "pendulum.yaml", [f"output.interval={interval}", "solve.tolerance=1e-4"])
    done = run(loaded, None)
    assert done.t == pytest.approx(rows)
    assert done.end_time == 1.0


def test_a_last_interval_that_rounding_ends_early_is_the_last_row():
    assert 11 * 0.03 < 0.33
    scene = build(load_deck(CASES / "pendulum.yaml", ["solve.duration=0.33", "output.interval=0.03"]))
    assert output_times(scene) == pytest.approx(np.linspace(0.0, 0.33, 12))


def test_rows_end_before_the_first_that_is_not_finite(monkeypatch):
    (good,) = CHANNELS["elongation"]

    def spoiled(samples, subject):
        return np.where(samples.t > 0.5, np.nan, good.compute(samples, subject))

    monkeypatch.setitem(CHANNELS, "elongation", (good._replace(compute=spoiled),))
    loaded = load_deck(CASES / "pendulum.yaml", ["output.channels=[b1.tip.x, b1.tip.elongation]"])
    notes = Notes()
    done = run(loaded, notes)
    assert (done.status, done.exit_code) == ("failed", 3)
    assert "b1.tip.elongation is not finite from t = 0.51 s on" in done.reason
    assert done.end_time == pytest.approx(0.5)
    assert np.isfinite(notes.table).all()


def test_long_runs_keep_less_of_their_steps_but_lose_no_rows(short_blocks, monkeypatch):
    loaded = load_deck(CASES / "pendulum.yaml", ["solve.duration=4", "solve.tolerance=1e-6"])
    whole = Notes()
    run(loaded, whole)
    monkeypatch.setattr(hfsim.marching.record, "MOST_STEPS", 2e4)
    monkeypatch.setattr(hfsim.marching.record, "MOST_STATES", 1e4)
    monkeypatch.setattr("hfsim.integrators._trajectory.RECENT", 4)
    notes = Notes()
    short = simulate(loaded, error_estimate=False, diagnosis=True, sink=notes)
    assert notes.table.tobytes() == whole.table.tobytes()
    assert 2 < len(short.outline_t) < len(short.t)
    assert short.outlines["b1"].shape[0] == len(short.outline_t)


def test_a_condensed_trajectory_is_right_at_the_ends_of_its_steps(monkeypatch):
    rng, path = np.random.default_rng(3), Trajectory(0.0, 0.0, np.zeros(2), np.ones(2))
    for k in range(9):
        step = Segment(float(k), 1.0, path.q, path.v, rng.normal(size=(3, 2)))
        (path.q,), (path.v,) = step.at(np.array([k + 1.0]))
        path.segments.append(step)
        path.t_end = k + 1.0
    times = np.array([0.0, 2.0, 4.0, 6.0, 8.0, 9.0])
    before = path.at(times)
    last = path.segments[-1]
    monkeypatch.setattr("hfsim.integrators._trajectory.RECENT", 1)
    path.condense()
    assert [s.t for s in path.segments] == [0.0, 2.0, 4.0, 6.0, 8.0]
    assert path.segments[-1] is last
    for mine, theirs in zip(path.at(times), before, strict=True):
        assert mine == pytest.approx(theirs, abs=1e-12)


def test_steps_that_are_condensed_end_in_the_coordinates_they_have(monkeypatch):
    """Of any number of terms; where coordinates change between two of them, both stay."""
    rng, path = np.random.default_rng(3), Trajectory(0.0, 0.0, np.zeros(2), np.ones(2))
    for k in range(13):
        step = Segment(float(k), 1.0, path.q, path.v, rng.normal(size=(2 + k % 3, 2)))
        (path.q,), (path.v,) = step.at(np.array([k + 1.0]))
        path.q = path.q + 3.0 * (k == 4)
        path.segments.append(step)
        path.t_end = k + 1.0
    monkeypatch.setattr("hfsim.integrators._trajectory.RECENT", 1)
    monkeypatch.setattr("hfsim.integrators._trajectory.MOST", 4)
    times = np.array([0.0, 2.0, 4.0, 4.9, 6.0, 8.0, 12.0, 13.0])
    before = path.at(times)
    path.condense()
    assert [s.t for s in path.segments] == [0.0, 2.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0]
    for mine, theirs in zip(path.at(times), before, strict=True):
        assert mine == pytest.approx(theirs, abs=1e-12)


def test_what_a_block_costs_does_not_grow_with_the_run(short_blocks, monkeypatch):
    """Bytes are counted of its own steps, not of all so far."""
    counted, size = [], Trajectory.size.fget
    count = property(lambda self: counted.append(len(self.segments)) or size(self))
    monkeypatch.setattr(Trajectory, "size", count)
    done = simulate(load_deck(CASES / "pendulum.yaml", ["solve.duration=4"]), error_estimate=False)
    assert len(counted) > 5
    assert sum(counted) == done.statistics["steps"]


def test_a_leg_without_a_row_yet_can_be_put_down(short_blocks):
    """The first block of the last leg ends before the next output time."""
    loaded = parse_deck(TURNING + "output: {interval: 0.9}\n", "deck")
    notes = Notes(most=1)
    assert run(loaded, notes).status == "limit"
    assert notes.put_down()["record.states"].shape[0] <= 1
    whole, resumed = Notes(), Notes()
    run(loaded, whole)
    run(loaded, resumed, notes.put_down())
    assert resumed.table.tobytes() == whole.table.tobytes()


@pytest.mark.parametrize("deck", ["pendulum.yaml", "rules/spare.yaml"])
def test_what_is_not_known_of_the_beginning_is_not_judged(deck, short_blocks):
    """Growth compares motions from their start: of a run that was taken up again only the end is known."""
    loaded = load_deck(CASES / deck)
    notes = Notes(most=6)
    run(loaded, notes)
    scene = build(loaded)
    record = hfsim.marching.record.Record(memory=notes.put_down())
    done = run_integration(scene, scene.deck.solve, record=record)
    assert done.trajectory.t_start > 0.0
    assert disturbed_growth(scene, done, scene.deck.solve, lambda share: None) is None


def test_where_drivers_leave_nothing_free_no_disturbance_is_judged():
    """What joints leave of a disturbance is their rounding, which grew 1e4-fold for nothing."""
    overrides = ("solve.model=rigid", "solve.duration=0.5")
    scene = build(parse_deck(starters()["slewing_arm"], overrides=overrides))
    done = run_integration(scene, scene.deck.solve)
    assert done.trajectory.t_end == 0.5
    assert disturbed_growth(scene, done, scene.deck.solve, lambda share: None) is None
