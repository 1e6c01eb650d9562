"""Runs that are put down after some steps and taken up again by other objects, or in another process."""

import pickle
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from hfsim.errors import LimitReached
from hfsim.integrators import METHODS, Limits, Stepping, _loop, _often, _pace, choose
from hfsim.marching.integration import problem_of, run_integration
from hfsim.maths import kernel
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

TESTS = Path(__file__).parents[1]
CASES = TESTS.parent / "cases"
STEPS = 10
PUT_DOWN = (1, 6)
HEAD = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e9}}
sections: {bar: {shape: rectangle, width: 1.0e-2, height: 1.0e-2}}
"""
BEAM = "{type: beam, material: alloy, section: bar, length: 1.0, elements: %d}"
SCENES = {
    "plain": f"""{HEAD}
bodies: {{b: {BEAM % 2}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
solve: {{duration: 1.0, tolerance: 1.0e-6}}
""",
    "damped": f"""{HEAD}
bodies: {{b: {BEAM % 2}, disc: {{type: rigid, mass: 0.2, inertia: 1.0e-3}}}}
joints:
  pin: {{type: revolute, between: [ground, b.root]}}
  hinge: {{type: revolute, between: [b.tip, disc]}}
springs:
  coil: {{type: rotational, between: [ground, b.root], stiffness: 3.0, damping: 0.4}}
  line: {{type: two_point, between: [ground, disc], stiffness: 20.0, damping: 2.0}}
solve: {{duration: 1.0, tolerance: 1.0e-6}}
""",
    "loaded": f"""{HEAD}
bodies: {{b: {BEAM % 2}}}
joints:
  pin: {{type: revolute, between: [ground, b.root]}}
  motor: {{type: driver, between: [ground, b.root], angle: {{type: spin_up, rate: 2.0, time: 0.03}}}}
loads:
  push:
    {{type: force, at: b.tip, force: [0.0, 3.0],
     law: {{type: smooth_step, from: 0.0, to: 1.0, start: 0.02, end: 0.021}}}}
  twist:
    {{type: moment, at: b.tip, moment: 0.3,
     law: {{type: table, times: [0.0, 0.01, 0.05, 2.0], values: [0.0, 1.0, -1.0, 0.0]}}}}
solve: {{duration: 1.0, tolerance: 1.0e-6}}
""",
    "loop": f"""{HEAD}
ground: {{points: {{far: [1.0, 0.0]}}}}
bodies:
  crank: {{type: rigid, mass: 0.3, inertia: 2.0e-3, points: {{a: [-0.15, 0.0], b: [0.15, 0.0]}}}}
  coupler: {BEAM % 2}
  rocker: {{type: rigid, mass: 0.3, inertia: 2.0e-3, points: {{a: [-0.15, 0.0], b: [0.15, 0.0]}}}}
joints:
  axle: {{type: revolute, between: [ground, crank.a]}}
  left: {{type: revolute, between: [crank.b, coupler.root]}}
  right: {{type: revolute, between: [coupler.tip, rocker.b]}}
  foot: {{type: revolute, between: [ground.far, rocker.a]}}
initial: {{crank: {{angle: 1.5707963267948966}}}}
solve: {{duration: 1.0, tolerance: 1.0e-6}}
""",
    "sparse": f"""{HEAD}
bodies: {{b: {BEAM % 52}}}
joints: {{pin: {{type: revolute, between: [ground, b.root]}}}}
solve: {{duration: 1.0, tolerance: 1.0e-6}}
""",
}
FIXED = {"explicit": 1e-6, "gear": 2e-5, "generalized_alpha": 2e-4}
"""Lengths of fixed steps [s] of methods that would not hold at 4 ms."""


def stepping(scene, method, step, max_steps=STEPS, coordinates="auto"):
    """Return new objects, from the deck on, and the problem with the counts."""
    settings = [f"solve.method={method}", f"solve.coordinates={coordinates}"]
    built = build(parse_deck(SCENES[scene], overrides=settings))
    solve = built.deck.solve.model_copy(update={"step": step})
    problem = problem_of(built)
    start = (0.0, built.q, built.v)
    limits = Limits(step, max_steps)
    run = Stepping(problem, choose(solve, built.system.dissipates), start, 1.0, limits, lambda t, q, v: None)
    return run, problem.counts


def written(memory):
    file = BytesIO()
    np.savez(file, **memory)
    return file.getvalue()


def read(file):
    return dict(np.load(BytesIO(file), allow_pickle=False))


def same(one, other):
    """Whether all is equal bit for bit."""
    pairs = zip(one, other, strict=True)
    return all(np.array_equal(a, b) and np.asarray(a).dtype == np.asarray(b).dtype for a, b in pairs)


@pytest.mark.parametrize("fixed", [False, True], ids=["free", "fixed"])
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", ["auto", *METHODS])
def test_a_run_that_was_put_down_goes_on_to_the_last_bit(method, scene, fixed, monkeypatch):
    """Also where what Python decided between two steps is then decided natively."""
    step = FIXED.get(method, 4e-3) if fixed else None
    whole, counts = stepping(scene, method, step)
    memories = {0: written(whole.memory())}
    with monkeypatch.context() as one_by_one:
        one_by_one.setattr(_loop, "AT_ONCE", 0)
        for _ in whole:
            memories[len(whole.path.segments)] = written(whole.memory())
    steps = whole.path.segments
    assert isinstance(whole.stop, LimitReached)
    assert len(steps) == STEPS
    for k in PUT_DOWN:
        k = next(one for one in memories if one >= k)
        again, again_counts = stepping(scene, method, step)
        again.recall(read(memories[k]))
        list(again)
        assert all(same(*pair) for pair in zip(again.path.segments, steps[k:], strict=True)), k
        assert vars(again_counts) == vars(counts), k
        assert again.path.methods == whole.path.methods
        assert same(
            (again.path.t_end, again.path.q, again.path.v), (whole.path.t_end, whole.path.q, whole.path.v)
        )
        assert written(again.memory()) == memories[STEPS], k


DRIVEN = """
hfsim: 1
gravity: [0.0, 0.0, -9.81]
bodies: {b: {type: rigid, mass: 1.0, inertia: [0.01, 0.02, 0.015], points: {root: [-0.2, 0.0, 0.0]}}}
joints:
  pin: {type: revolute, between: [ground, b.root], axis: [0.3, 0.5, 0.8]}
  drive:
    {type: driver, between: [ground, b.root], axis: [0.3, 0.5, 0.8],
     angle: {type: sine, amplitude: 0.1, frequency: 20.0}}
solve: {duration: 1.0}
"""


def test_steps_of_what_is_driven_go_on_to_the_last_bit(monkeypatch):
    """Nothing in it swings, so that a first step of its own would be far longer than those that are made."""
    monkeypatch.setitem(SCENES, "driven", DRIVEN)
    whole, _ = stepping("driven", "gauss", 1.67e-4, 40)
    memories = [written(whole.memory()) for _ in whole]
    for k in (4, 34, 35):
        again, counts = stepping("driven", "gauss", 1.67e-4, 40)
        again.recall(read(memories[k]))
        assert all(same(*pair) for pair in zip(again, whole.path.segments[k + 1 :], strict=True)), k
        assert counts.native == (40 if kernel.KERNEL == "native" else 0)


@pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")
@pytest.mark.parametrize(
    "case, stages, tolerance", [("pendulum", 12, 1e-4), ("pendulum", 6, 1e-6), ("door", 6, 1e-5)]
)
def test_what_is_decided_natively_is_so_in_python(case, stages, tolerance, monkeypatch):
    """Of steps that are not solved, that have too large an error, that meet edges, and at the end."""
    made = []
    for at_once in (0, _loop.AT_ONCE):
        monkeypatch.setattr(_loop, "AT_ONCE", at_once)
        settings = [f"solve.tolerance={tolerance}", f"solve.stages={stages}"]
        scene = build(load_deck(CASES / f"{case}.yaml", settings))
        made.append(run_integration(scene, scene.deck.solve))
    one_by_one, at_once = made
    assert one_by_one.problem.counts.rejected > 2
    assert vars(at_once.problem.counts) == vars(one_by_one.problem.counts)
    steps = [done.trajectory.segments for done in made]
    assert all(same(*pair) for pair in zip(*steps, strict=True))
    assert at_once.trajectory.t_end == one_by_one.trajectory.t_end == scene.deck.solve.duration


@pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")
@pytest.mark.parametrize("method", ["gauss", "gear"])
def test_what_is_replayed_from_some_step_on_is_so_in_a_run_that_goes_on(method, monkeypatch):
    """Derivatives by differences among it, which are taken again as they were taken: before that step."""
    monkeypatch.setattr(_often, "EARLY", 4)
    monkeypatch.setattr(_often, "GROWING", 0.0)
    monkeypatch.setattr(_often, "SEEN", 0)
    monkeypatch.setattr(_loop, "AT_ONCE", 1)
    whole, _ = stepping("plain", method, None, coordinates="frame")
    memories = [written(whole.memory()) for _ in whole]
    chosen = [read(memory)["often.chosen"].size for memory in memories]
    assert chosen[2] < chosen[3]
    for k in (2, 3, 4):
        again, _ = stepping("plain", method, None, coordinates="frame")
        again.recall(read(memories[k]))
        assert all(same(*pair) for pair in zip(again, whole.path.segments[k + 1 :], strict=True)), k
        assert written(again.memory()) == memories[-1], k


@pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")
def test_accelerations_at_a_break_are_known_though_its_time_is_no_sum(monkeypatch):
    """t + (end - t) is not always the end: what is known there would be computed once more."""
    times, values = [0.0, *(0.01 * 3.1**k for k in range(6))], [0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 0.0]
    text = f"""
hfsim: 1
bodies: {{mass: {{type: rigid, mass: 2.0, inertia: 1.0}}}}
joints: {{rail: {{type: prismatic, between: [ground, mass]}}}}
springs: {{coil: {{type: two_point, between: [ground, mass], stiffness: 0.02, rest_length: 0.0}}}}
loads:
  push: {{type: force, at: mass, force: [1.0, 0.0], law: {{type: table, times: {times}, values: {values}}}}}
initial: {{mass: {{position: [0.5, 0.0]}}}}
solve: {{duration: 2.5, method: radau, tolerance: 1.0e-3}}
"""
    made = []
    for at_once in (0, _loop.AT_ONCE):
        monkeypatch.setattr(_loop, "AT_ONCE", at_once)
        built = build(parse_deck(text))
        made.append(run_integration(built, built.deck.solve))
    one, other = made
    assert vars(one.problem.counts) == vars(other.problem.counts)
    steps = [done.trajectory.segments for done in made]
    assert all(same(*pair) for pair in zip(*steps, strict=True))
    assert any(step.t + step.h != then.t for step, then in zip(steps[1], steps[1][1:], strict=False))


SCRIPT = """
import pickle, sys
sys.path[:0] = [{tests!r}]
from integrators.test_stepping import read, stepping, written
ends = {{}}
for method, memory in pickle.load(sys.stdin.buffer).items():
    run, _ = stepping({scene!r}, method, None)
    run.recall(read(memory))
    for _ in run:
        pass
    ends[method] = written(run.memory())
pickle.dump(ends, sys.stdout.buffer)
"""


def test_another_process_goes_on_to_the_last_bit(monkeypatch):
    monkeypatch.setattr(_loop, "AT_ONCE", 1)
    memories = {}
    for method in METHODS:
        whole, _ = stepping("damped", method, None)
        memories[method] = [written(whole.memory()) for _ in whole]
    script = SCRIPT.format(tests=str(TESTS), scene="damped")
    begun = pickle.dumps({method: written[4] for method, written in memories.items()})
    done = subprocess.run([sys.executable, "-c", script], input=begun, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr.decode()
    ends = pickle.loads(done.stdout)
    assert len(ends) == len(METHODS)
    for method, end in ends.items():
        assert end == memories[method][-1], method


@pytest.mark.parametrize("broken", ["_attempt", "_memories"])
@pytest.mark.parametrize("method", METHODS)
def test_an_interrupted_step_leaves_nothing_behind(method, broken, monkeypatch):
    """The interruption comes when a step was tried, or while it is being kept."""
    monkeypatch.setattr(_loop, "AT_ONCE", 0)
    whole, _ = stepping("damped", method, None)
    memories = [written(whole.memory()) for _ in whole]
    run, _ = stepping("damped", method, None)
    for k in range(STEPS - 1):
        run.recall(read(memories[k]))
        interrupted(run, broken)
        assert next(run, None) is None
        assert isinstance(run.stop, KeyboardInterrupt)
        assert not run.path.segments
        assert written(run.memory()) == memories[k]
        run.recall(run.memory())
        assert same(next(run), whole.path.segments[k + 1])


@pytest.mark.parametrize("broken", [(_pace.Pace, "note"), (_often.Often, "expect")])
def test_an_interruption_among_ordinary_steps_leaves_none_half_kept(broken, monkeypatch):
    whole, _ = stepping("plain", "gauss", None)
    memories = [written(whole.memory()) for _ in whole]
    run, _ = stepping("plain", "gauss", None)
    calls, through = [], getattr(*broken)

    def ends(*arguments):
        calls.append(arguments)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return through(*arguments)

    monkeypatch.setattr(*broken, ends)
    list(run)
    assert isinstance(run.stop, KeyboardInterrupt)
    run.recall(read(written(run.memory())))
    list(run)
    assert written(run.memory()) == memories[-1]


def interrupted(run, name):
    """Let a method of a run end, once, in an interruption."""
    through = getattr(run, name)

    def ends(*arguments):
        setattr(run, name, through)
        through(*arguments)
        raise KeyboardInterrupt

    setattr(run, name, ends)


def test_a_watch_that_ends_the_run_leaves_the_step_it_saw(monkeypatch):
    monkeypatch.setattr(_loop, "AT_ONCE", 1)
    run, _ = stepping("plain", "gauss", None)
    run._watch = lambda t, q, v: (_ for _ in ()).throw(KeyboardInterrupt)
    assert len(list(run)) == len(run.path.segments) == 1
    assert isinstance(run.stop, KeyboardInterrupt)
    assert read(written(run.memory()))["state.t"] == run.path.t_end > 0.0


@pytest.mark.parametrize("method", ["explicit", "auto"])
def test_a_crawling_run_ends_where_it_would_have(method, monkeypatch):
    """Also among steps that are made at once: what is remembered is of the last that is kept."""
    monkeypatch.setattr(_pace, "WINDOWS", ((4, 0.0), (6, 0.0)))
    monkeypatch.setattr(_pace, "GAINING", np.inf)
    whole, _ = stepping("plain", method, None, max_steps=50)
    with monkeypatch.context() as one_by_one:
        one_by_one.setattr(_loop, "AT_ONCE", 0)
        memories = [written(whole.memory()) for _ in whole]
    assert "crawl" in str(whole.stop) and len(memories) > 2
    for memory in memories:
        run, _ = stepping("plain", method, None, max_steps=50)
        run.recall(read(memory))
        assert len(list(run)) < 2 or kernel.KERNEL == "numpy"
        assert (run.path.t_end, str(run.stop)) == (whole.path.t_end, str(whole.stop))
        assert written(run.memory()) == memories[-1]
