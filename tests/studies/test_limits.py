"""`hfsim stability --limits`: linearisation, theory, measured steps."""

import json
import re
import time

import numpy as np
import pytest
from called import call

import hfsim
from hfsim.integrators import integrator
from hfsim.marching.integration import run_integration
from hfsim.mechanics.modes import LargeModes, modes_by_differences
from hfsim.output.limits import limits_text
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import CASES
from hfsim.studies import limits as module
from hfsim.studies.farm import Farm
from hfsim.studies.limits import Limit, LimitJob, Limits, limits, measure, theory
from hfsim.studies.spectra import LimitsError, Spectrum, fastest_mode, linearise, spectrum

CANTILEVER = """
hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}}
joints: {clamp: {type: fixed, between: [ground, b1.root]}}
solve: {duration: 0.1, model: linear}
"""
WHEEL = """
hfsim: 1
bodies: {wheel: {type: rigid, mass: 1.0, inertia: 0.5}}
joints: {axle: {type: revolute, between: [ground, wheel]}}
springs: {coil: {type: rotational, between: [ground, wheel], stiffness: 50.0}}
initial: {wheel: {angle: 0.5}}
solve: {duration: 20.0}
"""
STANDING = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {rod: {type: rigid, mass: 1.0, inertia: 0.1, points: {low: [-0.5, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, rod.low]}}
initial: {rod: {angle: "90 deg"}}
solve: {duration: 3.0}
"""


@pytest.fixture
def short(monkeypatch):
    """A quarter of the steps in trial runs; theory tells what they can see."""
    monkeypatch.setattr(module, "STEPS", module.STEPS // 4)
    monkeypatch.setattr(module, "_SEEN", module.BLOWN ** (1.0 / (2.0 * module.STEPS)))


def at_start(text, *overrides, model=None):
    loaded = parse_deck(text, "deck", overrides)
    scene = build(loaded, model)
    return spectrum(scene, 0.0, scene.q, scene.v)


@pytest.mark.parametrize("model", ["linear", "lowOrder", "exact", "ancf"])
def test_frequencies_of_a_cantilever(model):
    """First bending frequency within the mesh error of two cubic elements (0.05 %); it does not grow."""
    found = at_start(CANTILEVER, model=model)
    assert found.slowest == pytest.approx(3.51601527 * np.sqrt(70.0 / 0.27), rel=1e-3)
    assert found.growth == 0.0


def test_the_frequency_and_the_growth_of_a_rigid_pendulum():
    """w^2 = m g l / J about the pin, upright with the other sign: the joint is respected."""
    rate = np.sqrt(9.81 * 0.5 / 0.35)
    up, down = at_start(STANDING), at_start(STANDING, "initial.rod.angle=-90 deg")
    assert up.growth == pytest.approx(rate, rel=1e-6)
    assert (down.fastest, down.growth) == (pytest.approx(rate, rel=1e-6), 0.0)


def test_a_driven_scene_is_linearised_on_its_joints():
    """A pendulum on a slider that a driver holds still has one freedom and the frequency of a pendulum."""
    text = """
hfsim: 1
gravity: [0.0, -9.81]
bodies:
  slider: {type: rigid, mass: 1.0, inertia: 1.0}
  rod: {type: rigid, mass: 1.0, inertia: 0.1, points: {low: [-0.5, 0.0]}}
joints:
  rail: {type: prismatic, between: [ground, slider], axis: [0.0, 1.0]}
  motor: {type: driver, between: [ground, slider], position: 0.2, axis: [0.0, 1.0]}
  pin: {type: revolute, between: [slider, rod.low]}
initial: {slider: {angle: 0.0}, rod: {angle: "-90 deg"}}
solve: {duration: 1.0}
"""
    scene = build(parse_deck(text))
    assert linearise(scene, 0.0, scene.q, scene.v).basis.shape == (4, 1)
    found = spectrum(scene, 0.0, scene.q, scene.v)
    assert found.fastest == pytest.approx(np.sqrt(9.81 * 0.5 / 0.35), rel=1e-5)


def test_linear_grows_where_exact_is_stiffened():
    """Two spinning beams, once tension has come up: `linear` has a growing motion, `exact` has none."""
    loaded = load_deck(CASES / "two_beams.yaml", ("solve.duration=0.1", "solve.tolerance=1e-5"))
    growth = {}
    for model in ("linear", "exact"):
        scene = build(loaded, model)
        end = run_integration(scene, scene.deck.solve).trajectory
        growth[model] = spectrum(scene, end.t_end, end.q, end.v).growth
    assert growth["linear"] > 10.0
    assert growth["exact"] == 0.0


UPRIGHT = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.1, points: {pivot: [-0.5, 0.0], rim: [0.2, 0.1]}}
  b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}
joints:
  axle: {type: revolute, between: [ground, hub.pivot]}
  mount: {type: fixed, between: [hub.rim, b1.root]}
initial: {hub: {angle: "90 deg"}}
solve: {duration: 1.0}
"""
SCENES = {
    "cantilever": CANTILEVER,
    "standing": STANDING,
    "damped": CANTILEVER.replace("7.0e10}", "7.0e10, bending_damping: 1.0e-4}"),
    "pressed": CANTILEVER.replace(
        "solve:", "loads: {press: {type: force, at: b1.tip, force: [-100.0, 0.0]}}\nsolve:"
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_analytic_derivative_is_that_of_differences(name):
    scene = build(parse_deck(SCENES[name]), "ancf")
    q = scene.q + 1e-3 * np.sin(np.arange(len(scene.q))) * (name != "standing")
    analytic = linearise(scene, 0.0, q, scene.v)
    differences = modes_by_differences(scene.system, 0.0, q, scene.v)
    assert 100.0 * analytic.precision < differences.precision
    for one in ("stiffness", "damping"):
        ours, theirs = (getattr(found, one) for found in (analytic, differences))
        # bases of the same space, one turned against the other
        turn = differences.basis.T @ analytic.basis
        ours = turn @ ours @ np.linalg.inv(turn)
        assert theirs == pytest.approx(ours, rel=1e-6, abs=1e-7 * np.abs(ours).max())


def test_a_moving_scene_is_seen_in_its_body_frames():
    """A beam that turns evenly: in ground axes the turning itself would count as a frequency."""
    text = CANTILEVER.replace("fixed", "revolute") + "initial: {b1: {angular_velocity: 30.0}}\n"
    scene = build(parse_deck(text), "exact")
    assert scene.system.linearizes
    with_frame = build(parse_deck(text, "deck", ("solve.coordinates=frame",)), "exact")
    ours, theirs = (spectrum(one, 0.0, one.q, one.v) for one in (scene, with_frame))
    assert (ours.slowest, ours.growth) == (pytest.approx(theirs.slowest), pytest.approx(theirs.growth))


@pytest.mark.parametrize("hub", [False, True])
def test_large_scenes_have_their_slowest_and_their_fastest_motions(monkeypatch, hub):
    """Iterations with sparse matrices find what dense algebra finds; with the hub on joints, upright."""
    text = UPRIGHT if hub else CANTILEVER
    monkeypatch.setattr("hfsim.maths.matrices.DENSE_UP_TO", 100)
    monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 100)
    scene = build(parse_deck(text, "deck", ("bodies.b1.elements=40",)), "exact")
    assert bool(scene.system.n_rows) == hub
    dense = spectrum(scene, 0.0, scene.q, scene.v)
    monkeypatch.setattr("hfsim.studies.spectra.MOST_UNKNOWNS", 100)
    assert isinstance(linearise(scene, 0.0, scene.q, scene.v), LargeModes)
    sparse = spectrum(scene, 0.0, scene.q, scene.v)
    for key in ("fastest", "slowest", "growth"):
        assert getattr(sparse, key) == pytest.approx(getattr(dense, key), rel=1e-4), key
    if hub:
        assert sparse.growth > 1.0
    else:
        assert sparse.slowest == pytest.approx(3.51601527 * np.sqrt(70.0 / 0.27), rel=1e-5)


def test_a_large_scene_in_body_frames_is_refused():
    scene = build(parse_deck(CANTILEVER, "deck", ("bodies.b1.elements=110", "solve.coordinates=frame")))
    with pytest.raises(LimitsError, match="unknowns"):
        linearise(scene, 0.0, scene.q, scene.v)


@pytest.mark.timed
def test_every_method_gets_its_share_of_the_budget():
    """With three times the time of one for eight, each method still tells how far it came."""
    methods = ("gauss", "explicit", "gear", "generalized_alpha")
    start = time.perf_counter()
    limits(parse_deck(WHEEL), "exact", ("explicit",), 100.0, 20.0, Farm(2))
    alone = time.perf_counter() - start
    found = limits(parse_deck(WHEEL), "exact", methods, 3.0 * alone, 20.0, Farm(2))
    assert time.perf_counter() - start < 10.0 * alone
    assert not found.lost
    assert [one.method for one in found.limits] == ["gauss", "explicit", *5 * ["gear"], "generalized_alpha"]
    unfinished = [one for one in found.limits if "within" in one.reason]
    assert unfinished and all(one.longest or one in unfinished for one in found.limits)


def test_columns_are_there_where_there_was_no_time_for_any_method():
    (found,) = hfsim.limits("pendulum", methods=["explicit"], models=["exact"], budget=1e-3)
    assert found.lost and len(found["longest"]) == len(found["deviation"]) == 0


def test_limits_are_told_in_whole_words_and_plain_numbers(tmp_path):
    reason = "the motion grows beyond all scale at t = 2.582 s, up to rates of 6e+96: the steps feed it"
    far = Limit("gear", 3, None, 0.121, 0.1215, reason, 0.05388, "so it is said")
    first = Spectrum(0.0, 10.0, 1.0, 0.0, 0.0)
    text = limits_text([Limits("wheel", "exact", (first,), (far,), {})], tmp_path)
    (row,) = (line for line in text.splitlines() if line.startswith("  gear 3"))
    assert "  +125 %  the motion grows" in row and row.endswith("up to...")
    assert len(row) <= 110
    near = Limit("explicit", None, None, 0.9489, 0.9541, "", 0.9489, "so it is said")
    text = limits_text([Limits("wheel", "exact", (first,), (near,), {})], tmp_path)
    assert "0.9489 T 0.9489 T +0 %" in " ".join(text.split()), "the two that are told are as far apart"


def test_theory():
    """Known edges: BDF3 and BDF4 leave the unit disc on the imaginary axis up to 1.94 and 4.71."""
    y = np.linspace(0.1, 6.5, 641)
    for order, edge in ((3, 1.94), (4, 4.71)):
        growing = integrator("gear").stability.growth(y, order) > 1.0 + 1e-9
        assert y[growing].max() == pytest.approx(edge, abs=0.05)
    for order in (1, 2):
        assert (integrator("gear").stability.growth(y, order) <= 1.0 + 1e-12).all()
    # to eighth order the polynomial is the exponential, whose size is one
    assert integrator("explicit").stability.growth(np.array([0.1]), None)[0] == pytest.approx(1.0, abs=1e-13)
    assert theory("radau").longest is None


def test_theory_tells_from_where_modes_grow_and_from_where_that_is_seen():
    """One step of length 5.962 over the frequency was told to grow by nothing: it does by 0.3 %."""
    said = theory("explicit")
    begin, seen = (float(number) for number in re.findall(r"wh = ([\d.]+)", said.words))
    growth = integrator("explicit").stability.growth(np.array([begin - 1e-3, begin + 1e-3, seen]), None)
    assert growth[0] < 1.0 < growth[1] and growth[2] ** (2 * module.STEPS) == pytest.approx(10.0, rel=0.2)
    assert said.longest == pytest.approx(seen / (2.0 * np.pi), rel=1e-3)


@pytest.mark.parametrize(
    ("method", "order"),
    [("explicit", None), ("gear", 3), pytest.param("gear", 5, marks=pytest.mark.slow)],
)
def test_measured_and_predicted_steps_agree_within_a_per_cent(method, order, request):
    if method == "explicit":
        request.getfixturevalue("short")
    found = measure(LimitJob(WHEEL, "wheel", (), "exact", method, order, 30.0))
    assert abs(found.deviation) < 0.01, found
    assert found.beyond - found.longest <= 0.01 * found.beyond


def bdf3_edge(ratio):
    """Return the step, in periods of an undamped mode, from which BDF3 is seen to feed a damped one."""
    root = -ratio + 1j * np.sqrt(1.0 - ratio**2)

    def seen(y):
        polynomial = np.array([11.0 / 6.0 - y * root, -3.0, 1.5, -1.0 / 3.0])
        return np.abs(np.roots(polynomial)).max() > module.BLOWN ** (0.5 / module.STEPS)

    return next(y for y in np.arange(0.05, 2.0, 1e-3) if seen(y)) / (2.0 * np.pi)


@pytest.mark.parametrize(("ratio", "within"), [(1e-10, 0.01), (0.02, 0.03)])
def test_what_dampers_take_hides_no_step_that_feeds_the_motion(ratio, within):
    """They take the more the more there is: their work is no measure of what energy there should be."""
    damped = f"joints.axle.damping={2.0 * ratio * np.sqrt(50.0 * 0.5)}"
    found = measure(LimitJob(WHEEL, "wheel", (damped,), "exact", "gear", 3, 30.0))
    assert found.longest == pytest.approx(bdf3_edge(ratio), rel=within)
    assert found.reason.startswith("the energy grows")


def test_what_a_load_gives_is_no_growth():
    text = WHEEL + "loads: {push: {type: moment, at: wheel, moment: 100.0}}\n"
    stands, feeds = (LimitJob(text, "wheel", (), "exact", "gear", order, 30.0) for order in (2, 3))
    assert measure(stands).beyond is None
    assert measure(feeds).longest == pytest.approx(theory("gear", 3).longest, rel=0.6)


@pytest.mark.usefixtures("short")
def test_a_scene_that_falls_gains_energy_without_blowing_up():
    """What its weight gives in 100 steps is far more than the small swing it is disturbed with."""
    text = CANTILEVER.replace("fixed", "revolute").replace("7.0e10", "7.0e6")
    text = text.replace("hfsim: 1", "hfsim: 1\ngravity: [0.0, -9.81]")
    found = measure(LimitJob(text, "falling", (), "exact", "explicit", None, 30.0))
    assert found.longest == pytest.approx(found.predicted, rel=0.05)


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(
    ("method", "order"), [("gauss", None), ("energy", None), ("gear", 2), ("generalized_alpha", None)]
)
def test_methods_that_stand_any_step(method, order):
    found = measure(LimitJob(WHEEL, "wheel", ("solve.stages=2",), "exact", method, order, 30.0))
    assert found.beyond is None and found.predicted is None
    assert found.longest > 10.0


@pytest.mark.parametrize("model", ["exact", "linear", "ancf"])
def test_the_disturbance_has_no_unit_of_length(model):
    """Of places in metres and slopes alike it was a smaller share of a scene in millimetres."""

    def energy(L):
        scaled = (
            f"bodies.b1.length={L}",
            f"materials.alloy={{density: {2700 / L**3}, youngs_modulus: {7e10 / L}}}",
            f"sections.bar={{area: {1e-4 * L**2}, second_moment: {1e-9 * L**4}}}",
        )
        scene = build(parse_deck(CANTILEVER, "deck", scaled), model)
        _, shape = fastest_mode(scene, 0.0, scene.q, scene.v)
        system, q = scene.system, scene.q[None]
        moving = system.kinetic_energy(system.absolute(q), system.absolute_velocity(q, shape[None]))
        return float(moving[0]) / L**2

    assert energy(1e3) == pytest.approx(energy(1.0), rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("step", [0.9, 1.0, 20.0])
def test_gear_of_low_order_stands_any_step_of_a_cantilever(order, step):
    """The starting values come from Gauss collocation, which must stand them too."""
    scene = build(parse_deck(CANTILEVER), "linear")
    omega, shape = linearise(scene, 0.0, scene.q, scene.v).fastest()
    h = 2.0 * np.pi / omega * step
    update = {"method": "gear", "order": order, "step": h, "duration": 60 * h}
    begin = (0.0, scene.q, scene.v + 1e-6 * omega * shape)
    done = run_integration(scene, scene.deck.solve.model_copy(update=update), start=begin)
    assert done.stop is None
    assert np.abs(done.trajectory.v).max() < np.abs(begin[2]).max()


@pytest.mark.usefixtures("short")
def test_the_command(tmp_path):
    deck = tmp_path / "wheel.yaml"
    deck.write_text(WHEEL)
    order = [
        "stability",
        str(deck),
        "--limits",
        "--methods",
        "explicit,generalized_alpha",
        "-o",
        str(tmp_path / "o"),
    ]
    result = call(*order)
    assert result.exit_code == 0, result.output
    assert "fastest period 0.6283 s" in result.stdout
    facts = json.loads((tmp_path / "o/stability.json").read_text())
    explicit = facts["results"][0]["limits"][0]
    assert abs(explicit["deviation"]) < 0.01
    assert len((tmp_path / "o/limits.csv").read_text().splitlines()) == 3
    assert call(*order, "--step", "1", "--force").exit_code == 2
