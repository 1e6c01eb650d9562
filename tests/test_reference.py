"""The paper's scenes against values computed independently beforehand, and `exact` against `ancf`.

Times are chosen so that the whole file takes well under a minute; what needs longer is marked slow.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hfsim.scene.loading import load_deck
from hfsim.simulate import simulate

HERE = Path(__file__).parent
CASES = HERE.parent / "cases"
TWO_ELEMENTS = ("bodies.b1.elements=2", "bodies.b2.elements=2")
EXUDYN = ("strain=engineering", "curvature=exact", "quadrature={axial: 5, bending: 3}")
"""The element of the reference files: ObjectANCFCable2D of Exudyn."""


@cache
def run(case, *overrides, model="exact", error_estimate=False, after=None):
    loaded = load_deck(CASES / f"{case}.yaml", [f"solve.model={model}", *overrides])
    return simulate(loaded, error_estimate=error_estimate, after=after)


def beam_options(bodies, options=EXUDYN):
    return [f"bodies.{body}.{option}" for body in bodies for option in options]


def at(result, name, t):
    row = int(np.argmin(np.abs(result.t - t)))
    assert result.t[row] == pytest.approx(t, abs=1e-12)
    return result[name][row]


# the table of design section 2 -----------------------------------------------------------------------


@pytest.mark.parametrize("model", ["exact", "ancf"])
@pytest.mark.parametrize(
    ("options", "t", "tip"),
    [
        ((), 0.5, (0.37238197, -1.26918744)),
        ((), 1.0, (-1.18581726, -0.13157253)),
        (("curvature=exact",), 1.0, (-1.18502443, -0.13075766)),
        (("strain=engineering", "curvature=exact"), 1.0, (-1.19994797, -0.29103679)),
        (EXUDYN, 1.0, (-1.20024977, -0.29039399)),
    ],
    ids=["green-linear-0.5", "green-linear-1", "green-exact", "engineering-exact", "exudyn-rule"],
)
def test_tip_of_the_pendulum(model, options, t, tip):
    result = run("pendulum", "solve.tolerance=1e-10", *beam_options(["b1"], options), model=model)
    assert result.status == "done"
    assert at(result, "b1.tip.x", t) == pytest.approx(tip[0], abs=1.01e-8)
    assert at(result, "b1.tip.y", t) == pytest.approx(tip[1], abs=1.01e-8)


@pytest.mark.parametrize(
    ("model", "angle", "deflection", "digits"),
    [
        ("exact", 0.07815273, -0.00407107, 8),
        ("ancf", 0.07815273, -0.00407107, 8),
        ("lowOrder", 0.0779084, -0.0032125, 7),
    ],
)
def test_hub_and_beams_with_two_elements(model, angle, deflection, digits):
    result = run("hub_beams", "solve.duration=0.2", "solve.tolerance=1e-10", *TWO_ELEMENTS, model=model)
    half = 0.51 * 10.0**-digits
    assert at(result, "hub.angle", 0.2) == pytest.approx(angle, abs=2 * half)
    assert at(result, "b1.tip.deflection", 0.2) == pytest.approx(deflection, abs=2 * half)


def two_beams(model, duration, interval=0.01, tolerance=1e-8):
    settings = (f"solve.tolerance={tolerance}", f"solve.duration={duration}", *TWO_ELEMENTS)
    settings += (f"output.interval={interval}",)
    return run("two_beams", *settings, model=model)


def test_exact_keeps_the_spinning_beams_straight():
    closely = np.abs(two_beams("exact", 0.5, 0.0005, 1e-9)["b1.tip.deflection"])
    # the reference was sampled every 10 ms; in between there is a little more, never much
    largest = closely[::20].max()
    assert largest == pytest.approx(6.708e-6, abs=0.6e-9)
    assert largest < closely.max() < 6.8e-6


def test_low_order_keeps_the_spinning_beams_straight():
    assert np.abs(two_beams("lowOrder", 0.25)["b1.tip.deflection"]).max() < 1e-5


def test_linear_lets_the_spinning_beams_go():
    result = two_beams("linear", 0.5)
    deflection = np.abs(result["b1.tip.deflection"])
    first = result.t[np.argmax(deflection > 0.1)]
    assert first == pytest.approx(0.17, abs=0.01)
    # orders of magnitude from what exact and lowOrder agree on
    exact = two_beams("exact", 0.5, 0.0005, 1e-9)
    assert deflection.max() > 1e4 * np.abs(exact["b1.tip.deflection"]).max()


@pytest.mark.slow
def test_linear_departs_by_metres():
    result = run("two_beams", *TWO_ELEMENTS, model="linear")
    assert np.abs(result["b1.tip.deflection"]).max() == pytest.approx(6.5, rel=0.1)


def test_positions_of_the_spinning_beams():
    """Benchmark F2, reading 1: green strain, exact curvature."""
    options = beam_options(["b1", "b2"], ("curvature=exact",))
    result = run("two_beams", "solve.duration=0.5", *options)
    assert at(result, "b1.angle", 0.5) == pytest.approx(1.99993752, abs=2e-7)
    assert at(result, "energy.total", 0.0) == pytest.approx(1510.98709333, abs=1e-8)


# exact = ancf ----------------------------------------------------------------------------------------

SCENES = {
    "pendulum": (0.5, 1e-11),
    "two_beams": (0.15, 1e-11),
    "two_beams_relative": (0.1, 1e-11),
    "hub_beams": (0.2, 1e-11),
    "hub_beams_soft": (0.3, 1e-11),
}
"""Case: duration [s] that keeps this test short, tolerance."""


def assert_same_motion(case, duration, tolerance):
    settings = (f"solve.duration={duration}", f"solve.tolerance={tolerance}")
    exact = run(case, *settings, "solve.coordinates=frame", model="exact")
    ancf = run(case, *settings, model="ancf")
    assert exact.status == ancf.status == "done"
    size = max(np.abs(c.values).max() for c in exact.channels if c.name.endswith(("tip.x", "tip.y")))
    for mine, other in zip(exact.channels, ancf.channels, strict=True):
        if mine.unit == "m":
            assert np.abs(mine.values - other.values).max() < 1e-9 * size, mine.name
        elif mine.unit == "rad":
            assert np.abs(mine.values - other.values).max() < 1e-8, mine.name


@pytest.mark.parametrize("case", SCENES)
def test_exact_is_ancf(case):
    assert_same_motion(case, *SCENES[case])


@pytest.mark.slow
@pytest.mark.parametrize("case", SCENES)
def test_exact_is_ancf_over_the_first_second(case):
    assert_same_motion(case, 1.0, 1e-11)


# independent trajectories ----------------------------------------------------------------------------

FILES = {
    "pendulum": (("b1",), "b1", 0.01, 7.4e-13),
    "two_beams_relative": (("b1", "b2"), "b2", 0.01, 1.3e-10),
    "hub_beams": (("b1", "b2"), "b2", 0.02, 5.3e-13),
    "hub_beams_soft": (("b1", "b2"), "b2", 0.02, 3.1e-12),
}
"""File in tests/reference: bodies, the one with the tip, output interval, accuracy its header states [m]."""


def reference(name):
    path = HERE / "reference" / f"{name}.csv"
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return lines[0].split(","), np.array([[float(x) for x in line.split(",")] for line in lines[1:]])


def assert_follows_reference(case, duration, tolerance, allowed, model):
    bodies, last, interval, _ = FILES[case]
    names, rows = reference(case)
    rows = rows[rows[:, 0] <= duration + 1e-9]
    result = run(
        case,
        f"solve.duration={duration}",
        f"solve.tolerance={tolerance}",
        f"output.interval={interval}",
        *beam_options(bodies),
        model=model,
    )
    assert result.status == "done"
    pairs = {"tip_x": f"{last}.tip.x", "tip_y": f"{last}.tip.y", "w1": "b1.tip.deflection"}
    if last == "b2":
        pairs |= {"B1tip_x": "b1.tip.x", "B1tip_y": "b1.tip.y", "w2": "b2.tip.deflection"}
    picked = np.round(rows[:, 0] / interval).astype(int)
    assert len(picked) > 1
    assert np.abs(result.t[picked] - rows[:, 0]).max() < 1e-9
    for column, name in pairs.items():
        assert np.abs(result[name][picked] - rows[:, names.index(column)]).max() < allowed, name


SHORT = [
    ("pendulum", 0.5, 1e-11, 2e-10),
    ("two_beams_relative", 0.1, 1e-11, 1e-9),
    ("hub_beams", 0.2, 1e-11, 1e-10),
    ("hub_beams_soft", 0.3, 1e-11, 1e-10),
]
WHOLE = [
    ("pendulum", 1.0, 1e-12, 1e-11),
    ("two_beams_relative", 2.0, 1e-12, 2e-8),
    ("hub_beams", 5.0, 1e-12, 1e-8),
    ("hub_beams_soft", 2.0, 1e-12, 1e-9),
]


@pytest.mark.parametrize("model", ["exact", "ancf"])
@pytest.mark.parametrize(
    ("case", "duration", "tolerance", "allowed"),
    [*SHORT, *(pytest.param(*row, marks=pytest.mark.slow) for row in WHOLE)],
)
def test_trajectories_of_an_independent_code(case, duration, tolerance, allowed, model):
    assert_follows_reference(case, duration, tolerance, allowed, model)


# where lowOrder ends ---------------------------------------------------------------------------------


def test_low_order_breaks_down_on_the_pendulum():
    result = run("pendulum", "output.interval=0.001", model="lowOrder")
    assert (result.status, result.exit_code) == ("failed", 3)
    assert result.failure["class"] == "model"
    assert result.failure["item"] == "bodies.b1"
    assert f"{result.failure['time']:.3g}" == "0.0307"
    for words in ("mass matrix", "'b1'", "lowOrder", "0.0307"):
        assert words in result.reason
    assert result.t[-1] == pytest.approx(0.030)


def test_low_order_breaks_down_on_the_soft_beams():
    result = run("hub_beams_soft", model="lowOrder")
    assert (result.status, result.exit_code) == ("failed", 3)
    assert result.failure["class"] == "model"
    assert result.failure["item"] in ("bodies.b1", "bodies.b2")
    assert result.failure["time"] == pytest.approx(0.1, abs=0.01)
    for words in ("lowOrder", "'b", "t = 0."):
        assert words in result.reason
    assert result.t == pytest.approx([0.0, 0.02, 0.04, 0.06, 0.08, 0.1][: len(result.t)])
    assert len(result.t) >= 5
    assert all(np.isfinite(c.values).all() and len(c.values) == len(result.t) for c in result.channels)


def test_exact_runs_through_on_the_soft_beams():
    result = run("hub_beams_soft")
    assert (result.status, result.end_time) == ("done", 2.0)
    deflection = result["b1.tip.deflection"]
    # 39 % of the length, as benchmark F3 has it
    assert deflection.max() / 1.2 == pytest.approx(0.39, abs=0.005)


# energy, error estimate ------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["exact", "ancf"])
@pytest.mark.parametrize("case", SCENES)
def test_gauss_keeps_the_energy(case, model):
    duration = {"pendulum": 0.6, "hub_beams_soft": 0.6}.get(case, 0.12)
    settings = (f"solve.duration={duration}", "solve.method=gauss")
    assert run(case, *settings, model=model).statistics["energy_drift"] < 1e-8
    assert run(case, *settings, "solve.tolerance=1e-10", model=model).statistics["energy_drift"] < 1e-10


@pytest.mark.parametrize(("case", "method"), [("pendulum", "gauss"), ("hub_beams", "radau")])
def test_auto_damps_what_its_steps_do_not_resolve(case, method):
    """Stiff scenes take steps of tens of milliseconds, hundreds of periods of their fastest mode."""
    result = run(case, "solve.duration=1.0", "solve.tolerance=1e-4")
    assert result.method == method
    assert result.statistics["steps"] < 40


@pytest.mark.parametrize("case", SCENES)
def test_joints_hold(case):
    result = run(case, "solve.duration=0.1")
    assert result.statistics["constraint_position"] < 1e-10
    assert result.statistics["constraint_velocity"] < 1e-10 * max(1.0, 8.0)


def gear_with_its_error(duration):
    settings = ("solve.method=gear", "solve.step=1e-4", "solve.tolerance=1e-8", f"solve.duration={duration}")
    result = run("pendulum", *settings, error_estimate=True, after=120.0)
    truth = run("pendulum", "solve.tolerance=1e-12", f"solve.duration={duration}")
    assert (result.status, result.method) == ("done", "gear")
    assert result.statistics["steps"] == round(duration / 1e-4)
    told = result.statistics["error_by_channel"]
    for name in ("b1.tip.x", "b1.tip.y"):
        true = np.abs(result[name] - truth[name]).max()
        assert told[name] == pytest.approx(true, rel=0.1, abs=1e-12)
    return told


def test_gear_at_the_settings_of_the_paper_tells_its_error():
    told = gear_with_its_error(0.1)
    assert 0.0 < told["b1.tip.x"] < 1e-6


@pytest.mark.slow
def test_gear_at_the_settings_of_the_paper_over_a_second():
    assert 0.0 < gear_with_its_error(1.0)["b1.tip.x"] < 1e-5


@pytest.mark.parametrize("model", ["exact", "linear"])
@pytest.mark.parametrize("case", ["pendulum", "hub_beams"])
def test_steps_in_either_coordinates_give_the_same_motion(case, model):
    settings = ("solve.duration=0.2", "solve.tolerance=1e-9", "output.interval=0.02")
    own, other = (
        run(case, *settings, f"solve.coordinates={coordinates}", model=model)
        for coordinates in ("frame", "absolute")
    )
    for name in ("b1.tip.x", "b1.tip.deflection", "b1.angle"):
        a, b = own[name], other[name]
        assert np.abs(a - b).max() < 1e-8 * max(1.0, np.abs(a).max())
    assert own.statistics["evaluations"] != other.statistics["evaluations"]
