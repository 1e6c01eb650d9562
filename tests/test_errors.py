"""Whatever hfsim raises crosses over to another process: a bad value must not end a pool of them."""

import importlib
import pickle
import pkgutil
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

import hfsim
from hfsim.deck.expressions import ExpressionError
from hfsim.deck.quantities import QuantityError
from hfsim.deck.ranges import RangeError
from hfsim.deck.units import UnitError
from hfsim.errors import DeckError, DeckProblem, HfsimError, LimitReached, SolverFailure, Terminated
from hfsim.marching.stop import TimeUp
from hfsim.studies.static import UnknownLoadError

PROBLEM = DeckProblem("bodies.b1.length", "must be above zero", "write 1 m", 3, 5, 4)
ERRORS = [
    DeckError("deck.yaml", [PROBLEM], "hfsim: 1\nbodies:\n  b1: {length: 0}\n", {"other.csv": "1, 2"}),
    LimitReached("the budget of 3 s was used up", 0.5),
    SolverFailure("it breaks", 0.1, "bodies.b1", "model", {"slope": 2.0}, "take exact", "it is bent"),
    SolverFailure(reason="it breaks", time=0.1),
    Terminated("SIGINT"),
    TimeUp("cut off at 3 % of the duration", 0.03),
    UnknownLoadError("push", ["pull"]),
    ExpressionError("unknown name 'x'", "there is y", 3, 1),
    QuantityError("is no length", "write 1 m"),
    RangeError("is no range", "write [0, 1]"),
    UnitError("unknown unit 'foot'", "write m"),
]


def again(error, protocol=pickle.DEFAULT_PROTOCOL):
    return pickle.loads(pickle.dumps(error, protocol))


def kinds(of=HfsimError):
    """Return all subclasses that hfsim has."""
    for module in pkgutil.walk_packages(hfsim.__path__, "hfsim."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    todo, found = [of], []
    while todo:
        found.append(todo.pop())
        todo += found[-1].__subclasses__()
    return found


def raising(length):
    """Run a pendulum, in a process of a pool."""
    changes = {"bodies.b1.length": length, "solve.duration": 0.05}
    return hfsim.run("pendulum", changes, error_estimate=False).status


@pytest.mark.parametrize("protocol", [0, pickle.DEFAULT_PROTOCOL])
@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_keep_text_and_attributes(error, protocol):
    there = again(error, protocol)
    assert type(there) is type(error) and str(there) == str(error) and there.args == error.args
    assert repr(vars(there)) == repr(vars(error))


def test_every_kind_of_error_crosses_over():
    for kind in kinds():
        error = kind.__new__(kind, "text")
        error.place = "bodies.b1"
        there = again(error)
        assert (type(there), there.args, vars(there)) == (kind, ("text",), vars(error))


def test_the_run_of_an_unfinished_one_crosses_over():
    with pytest.raises(hfsim.UnfinishedRunError) as unfinished:
        hfsim.run("pendulum", {"solve.max_steps": 2, "solve.duration": 0.3}, error_estimate=False)
    there = again(unfinished.value)
    assert str(there) == str(unfinished.value) and there.exit_code == 5
    assert (there.run["b1.tip.x"] == unfinished.value.run["b1.tip.x"]).all()


def test_a_bad_value_leaves_the_others_of_a_pool_alone():
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        bad, good = (pool.submit(raising, length) for length in (-1.0, 1.0))
        assert "must be" in str(bad.exception()) and isinstance(bad.exception(), hfsim.DeckError)
        assert good.result() == "done"
