"""What a run tells: methods with their stages, digits that each channel's own error leaves."""

import json

import numpy as np
import pytest
from called import call

import hfsim
from hfsim.marching.solution import Channel
from hfsim.output.report import _last, error_of


@pytest.mark.parametrize(
    "method, stages, order",
    [
        ({"method": "gauss", "stages": 5}, {"gauss": 5}, None),
        ({"method": "gear", "order": 2, "step": 1e-3}, None, {"gear": 2}),
        ({"method": "explicit"}, None, None),
    ],
)
def test_stages_and_orders_are_recorded(tmp_path, method, stages, order):
    settings = {**{f"solve.{key}": value for key, value in method.items()}, "solve.duration": 0.01}
    argv = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    argv += ["--no-error-estimate", "--no-diagnosis", "--no-plots", "-o", str(tmp_path / "a")]
    told = call("run", "pendulum", *argv)
    assert told.exit_code == 0, told.output
    summary = json.loads((tmp_path / "a/summary.json").read_text())
    assert (summary["stages"], summary["order"]) == (stages, order)
    words = {"gauss": "gauss (5 stages)", "gear": "gear (order 2)", "explicit": "explicit"}[method["method"]]
    assert f"method {words}\n" in told.output


def test_digits_follow_the_error_of_the_channel_itself():
    run = hfsim.run("pendulum", {"solve.duration": 0.1})
    known = {"error_estimate": 0.5, "mesh_error_estimate": None, "error_by_channel": {"b1.tip.x": 1e-9}}
    known |= {"mesh_error_by_channel": {"b1.tip.x": 1e-6, "b1.tip.y": 1e-3}}
    x, y, other = (Channel(name, "m", run["b1.tip.x"]) for name in ("b1.tip.x", "b1.tip.y", "b1.other"))
    reach = float(x.values.max() - x.values.min())
    assert [error_of(one, known) for one in (x, y, other)] == [1e-6, 1e-3, 0.5 * reach]
    assert error_of(x, {"error_estimate": None, "mesh_error_estimate": None}) is None


@pytest.mark.parametrize(("name", "told"), [("b.x", "0"), ("constraint.position", "1e-15")])
def test_rounding_is_told_as_zero_but_not_of_a_residual(name, told):
    assert _last(Channel(name, "m", np.array([1e-15])), 1.0, None) == told
