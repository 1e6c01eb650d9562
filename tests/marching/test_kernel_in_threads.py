"""Integrations in threads and processes: recordings replace functions of NumPy while they are made."""

import multiprocessing
import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from natively import at_once, native

from hfsim.integrators.collocation import automatic
from hfsim.marching.integration import problem_of, run_integration
from hfsim.maths import kernel
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck
from hfsim.scene.shipped import CASES

SCENES = {"pendulum": 0.4, "hub_beams": 0.04, "two_beams": 0.04}


def scene_of(name):
    return build(load_deck(CASES / f"{name}.yaml", [f"solve.duration={SCENES[name]}"]))


def end_of(scene):
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    assert kernel.KERNEL == "numpy" or done.problem.counts.native > 2
    return np.asarray(done.trajectory.q[-1])


@pytest.fixture
def taking_turns():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


def test_threads_find_what_they_find_alone(taking_turns, monkeypatch):
    at_once(monkeypatch)
    alone = [end_of(scene_of(name)) for name in SCENES]
    scenes = [scene_of(name) for name in SCENES]
    with ThreadPoolExecutor(len(scenes)) as threads:
        together = list(threads.map(end_of, scenes))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)


@native
def test_a_stepper_goes_on_in_another_thread(monkeypatch):
    """On memory of that thread's own: another stepper may be at work on that of the first one."""
    at_once(monkeypatch)
    scene = scene_of("pendulum")

    def begun():
        problem = problem_of(scene)
        problem.count_on(len(scene.q), 0.0, 1.0)
        stepper = automatic(scene.deck.solve, dissipates=False).start(problem, 0.0, scene.q, scene.v)
        return stepper, step(stepper)

    def step(stepper):
        return stepper.attempt(0.0, scene.q, scene.v, 0.01).q

    (here, first), (there, second) = begun(), begun()
    np.testing.assert_array_equal(first, second)
    with ThreadPoolExecutor(1) as other:
        np.testing.assert_array_equal(other.submit(step, there).result(), step(here))
        threads = threading.get_ident(), other.submit(threading.get_ident).result()
    assert set(there._problem.recordings) == set(threads)


@native
def test_recordings_do_not_mix(taking_turns):
    """Two threads record at the same time, a third one uses what NumPy has."""
    from hfsim.maths.replayed import Replayed

    stop, kinds, begin = threading.Event(), set(), threading.Barrier(3)

    def other():
        begin.wait()
        while not stop.is_set():
            kinds.update(map(type, (np.zeros(3), np.asarray([1.0]), np.array(np.ones(2)), np.full(2, 1.0))))

    def record(seed):
        rng = np.random.default_rng(seed)
        c = rng.standard_normal((4, 4))

        def function(x):
            out = np.zeros((4, 4))
            for k in range(12):
                out = np.asarray(out) + np.sin(c * (k + 1)) @ x + np.array([x[0], x[1], x[2], x[3]])
            return out

        begin.wait()
        for _ in range(20):
            replayed = Replayed(function)
            replayed(c)
            assert replayed.refused is None
            x = rng.standard_normal((4, 4))
            np.testing.assert_allclose(replayed(x), function(x), rtol=1e-12, atol=1e-11)

    with ThreadPoolExecutor(3) as threads:
        last = threads.submit(other)
        try:
            for one in [threads.submit(record, seed) for seed in (1, 2)]:
                one.result(timeout=60)
        finally:
            stop.set()
        last.result()
    assert kinds == {np.ndarray}


@native
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes of this kind")
def test_a_process_that_is_forked_while_another_thread_records_can_record():
    from hfsim.maths.recording import Recorder, on_tape

    recorded, go_on = threading.Event(), threading.Event()

    def record():
        recorded.set()
        go_on.wait(30)

    thread = threading.Thread(target=on_tape, args=(Recorder(), record))
    thread.start()
    recorded.wait(30)
    child = multiprocessing.get_context("fork").Process(target=_recording_in_a_child)
    child.start()
    child.join(30)
    go_on.set()
    thread.join()
    assert child.exitcode == 0


def _recording_in_a_child():
    from hfsim.maths.recording import ORIGINAL, Recorder, on_tape

    assert np.zeros is ORIGINAL["zeros"]
    assert type(on_tape(Recorder(), lambda: np.zeros(3))) is not np.ndarray
