"""What tests of the native kernel share: recordings made at once, evaluations and runs of both kernels."""

from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest

import hfsim
from hfsim.integrators import _often, collocation
from hfsim.integrators._ordinary import MEMORY, PROGRAMS, Rule, State
from hfsim.maths import kernel
from hfsim.maths.recording import Recorder
from hfsim.maths.replayed import Replayed, jittered
from hfsim.maths.tape import NOTHING, Program, marched
from hfsim.maths.traced import apart
from hfsim.mechanics.projection import Projection
from hfsim.scene.build import build

native = pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")
STATES = 3


def at_once(monkeypatch):
    """Let steps be recorded at once, all else when it comes for the second time."""
    monkeypatch.setattr(collocation, "LASTING", 0)
    for name in ("EARLY", "SEEN", "MANY"):
        monkeypatch.setattr(_often, name, 0)


@contextmanager
def recording(tape):
    """Write down on a tape what a block does."""
    Recorder.switch(tape)
    try:
        yield
    finally:
        Recorder.switch(None)


def both(monkeypatch, call):
    """Return what a call returns with the kernel, and what in NumPy."""
    at_once(monkeypatch)
    found = []
    for way in ("native", "numpy"):
        monkeypatch.setattr(kernel, "KERNEL", way)
        found.append(call())
    return found


def runs_alike(deck, monkeypatch, within):
    """Hold forces and a run of a deck, recorded, against NumPy, channels within parts of their sizes.

    Return the run with the kernel.
    """
    evaluates_alike(build(deck))
    one, other = both(monkeypatch, lambda: hfsim.run(deck, error_estimate=False, diagnosis=False))
    assert one.statistics["native_steps"] and not other.statistics["native_steps"]
    for name in one.units:
        np.testing.assert_allclose(one[name], other[name], atol=within * (1.0 + np.abs(other[name]).max()))
    return one


def states(scene, rng):
    q, v = (np.repeat(one[None], STATES, axis=0) for one in (scene.q, scene.v))
    near = 1.0 + 1e-4 * rng.standard_normal(q.shape)
    return np.array([0.01, 0.1, 0.3]), q * near, v * near + 0.1 * rng.standard_normal(q.shape)


def evaluates_alike(scene):
    """Hold forces, accelerations, balances and projections of a scene against NumPy.

    To 1e-12 of what they amount to, or ten times what the last digit of a state makes, or to the last
    digit of terms that cancel.
    """
    system, rng = scene.system, np.random.default_rng(3)
    for part in system.forces:

        def force(t, q, v, part=part):
            x = system.absolute(q)
            out = np.zeros_like(x)
            apart(part.add_force, t, x, system.absolute_velocity(q, v), out)
            return out

        compare(force, scene, rng)
    compare(system.acceleration, scene, rng)
    if system.balances:
        a = rng.standard_normal((STATES, system.n))
        compare(lambda t, q, v: system.imbalance(t, q, v, a)[0], scene, rng)
    if system.balances and system.n_rows:
        # accelerations cancel in these, which may be 1e12 as large
        compare(lambda t, q, v: system.imbalance(t, q, v, a)[1], scene, rng, system.acceleration)
    if system.n_rows:
        compare(partial(projected, Projection(system)), scene, rng)


def projected(projection, t, q, v):
    x, u, gap, *_ = projection.seen(t, q, v)
    x, gap, _, drift, _ = projection.closer(t, x, u, gap)
    return np.concatenate([*projection.steadier(q, x, u, drift), gap], axis=1)


def compare(function, scene, rng, terms=None):
    """Hold a function against NumPy's; `terms` returns what cancels in it, and is rounded."""
    replayed = Replayed(function)
    replayed(*states(scene, rng))
    assert replayed.refused is None
    for _ in range(2):
        at = states(scene, rng)
        own, near = function(*at), function(*map(jittered, at))
        reach = 10.0 * np.abs(own - near).max(initial=0.0)
        size = np.abs(own).max(initial=0.0)
        rounding = 0.0 if terms is None else np.finfo(float).eps * np.abs(terms(*at)).max(initial=0.0)
        assert np.abs(own - replayed(*at)).max(initial=0.0) <= max(1e-12 * size, reach, rounding, 1e-15)


def iterated(correct, sizes, limits, most):
    """Correct by a program in a step that is empty else; return whether that converges, and when."""
    nothing = Program(NOTHING, correct.calls, None)
    programs = [correct if name == "correct" else nothing for name in PROGRAMS]
    rule = Rule(*limits, most, *np.zeros(len(Rule._fields) - 6), growths=np.ones(2)).told()
    state = np.array(State(1.0, 0.0, 0.0, 1.0, 1.0))
    given = dict(zip(("change", "size", "scale"), sizes, strict=True)) | {"rows": np.empty(0)}
    memory = [given.get(name, np.ones(())) for name in MEMORY]
    before = np.empty_like(state), np.empty(())
    assert marched(programs, memory, rule, state, np.empty((0, 6)), before)
    found = State(*state)
    return bool(found.converged), int(found.iterations)
