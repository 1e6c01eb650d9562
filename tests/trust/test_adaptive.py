"""`model: auto`: forecasts against closed forms, legs that join, errors within what is stated."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from called import call

from hfsim.marching.integration import run_integration
from hfsim.output.report import as_text
from hfsim.scene.build import build
from hfsim.scene.gauging import rigid_motions
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate
from hfsim.trust import handover
from hfsim.trust.adaptive import Adaptive
from hfsim.trust.handover import hand_over
from hfsim.trust.quasistatic import deformation_of

CASES = Path(__file__).parents[2] / "cases"
HEAD = """hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2, model: auto}}
"""
E, AREA, INERTIA, DENSITY = 7e10, 4e-4, 0.02**4 / 12, 2700.0
CLAMPED = "joints: {clamp: {type: fixed, between: [ground, b1.root]}}\n"
PINNED = "joints: {pin: {type: revolute, between: [ground, b1.root]}}\n"
SOLVE = "solve: {duration: 0.5, tolerance: 1.0e-6, model: linear}\n"
GROWING = (
    HEAD
    + PINNED
    + """gravity: [0.0, -9.81]
loads:
  push: {type: force, at: b1.tip, force: [0.0, 60.0], follower: true,
         law: {type: smooth_step, from: 0, to: 1, start: 0.2, end: 0.7}}
solve: {duration: 0.6, tolerance: 1.0e-5}
"""
)


IN_SPACE = (
    GROWING.replace("[0.0, -9.81]", "[0.0, -9.81, 0.0]")
    .replace("model: auto", "model: auto, element: cable")
    .replace("type: revolute", "type: spherical")
    .replace("[0.0, 60.0], follower: true", "[0.0, 600.0, 900.0]")
    .replace("tolerance: 1.0e-5", "tolerance: 3.0e-6")
)


def test_a_spatial_beam_goes_over_from_model_to_model():
    """Pushed ever harder out of its plane; what it ends in is where the exact model ends."""
    chosen = simulate(parse_deck(IN_SPACE), error_estimate=False)
    exact = simulate(parse_deck(IN_SPACE.replace("model: auto", "model: exact")), error_estimate=False)
    assert chosen.status == exact.status == "done"
    assert [one["next_model"] for one in chosen.statistics["auto"]["switches"]] == ["linear", "exact"]
    assert chosen.statistics["energy_drift"] < 1e-5
    for mine, real in zip(chosen.channels[:3], exact.channels[:3], strict=True):
        assert mine.name.startswith("b1.tip")
        assert mine.values == pytest.approx(real.values, abs=0.005 * np.ptp(real.values))


def rigid(text):
    scene = build(parse_deck(text), models={"b1": "rigid"})
    return scene, deformation_of(scene, scene.bodies["b1"], np.zeros(1), scene.q[None], scene.v[None])


def test_bending_of_a_cantilever_by_loads_and_weight():
    force = "f: {type: force, at: b1.tip, force: [50.0, 3.0]}"
    loads = f"loads: {{{force}, m: {{type: moment, at: b1.tip, moment: 2.0}}}}\n"
    _, seen = rigid(HEAD + CLAMPED + loads + "gravity: [0.0, -9.81]\n" + SOLVE)
    expected = 3.0 / 3 + 2.0 / 2 - DENSITY * AREA * 9.81 / 8
    assert seen.tip[0, 0] == pytest.approx(expected / (E * INERTIA), rel=2e-3)
    assert seen.axial[0, :-1] == pytest.approx(50.0 / (E * AREA), rel=1e-12)


def test_stretch_of_a_spinning_beam_and_bending_of_a_falling_one():
    spin = "initial: {b1: {angle: 0.4, angular_velocity: 20.0}}\n"
    _, seen = rigid(HEAD + PINNED + spin + SOLVE)
    assert seen.axial[0] @ seen.weights == pytest.approx(DENSITY * 400.0 / 3 / E, rel=1e-3)
    assert np.abs(seen.tip).max() < 1e-12
    _, seen = rigid(HEAD + PINNED + "gravity: [0.0, -9.81]\n" + SOLVE)
    # weight and inertia of a beam released from the horizontal: M(x) = rho A g x (L - x)^2 / (4 L)
    x = np.linspace(0.0, 1.0, seen.slope.shape[1])
    moment = DENSITY * AREA * 9.81 * (x * (1 - x) ** 2) / 4
    assert E * INERTIA * seen.curvature[0, :, 0] == pytest.approx(moment, abs=1e-9)


def test_what_takes_over_goes_on_in_the_same_place_with_the_same_forces():
    old = build(parse_deck(GROWING), models={"b1": "rigid"})
    path = run_integration(old, old.deck.solve.model_copy(update={"duration": 0.3})).trajectory
    for model in ("linear", "exact"):
        new, gained = hand_over(old, build(old.loaded, models={"b1": model}), path)
        x, y = old.system.absolute(path.q[None]), new.system.absolute(new.q[None])
        seen = deformation_of(old, old.bodies["b1"], np.array([0.3]), path.q[None], path.v[None])
        gap = new.marker("b1.tip").position(y) - old.marker("b1.tip").position(x)
        assert np.linalg.norm(gap) == pytest.approx(abs(seen.tip[0, 0]), rel=0.02)
        energy = new.system.kinetic_energy(x=y, u=new.system.absolute_velocity(new.q[None], new.v[None]))[0]
        assert abs(gained) < 1e-2 * energy
        assert new.start_angles["b1"] == pytest.approx(path.q[2], abs=1e-12)


def tip_error(run, truth):
    mine, real = (np.array([c.values for c in one.channels if ".tip." in c.name]) for one in (run, truth))
    return np.abs(mine - real).max() / np.ptp(real, axis=1).max()


def test_a_beam_moves_up_before_the_error_is_there():
    deck = parse_deck(GROWING + "output: {interval: 0.003, channels: [b1.tip.x, b1.tip.y, b1.angle]}\n")
    run = simulate(deck, error_estimate=True)
    truth = simulate(
        parse_deck(
            GROWING + "output: {interval: 0.003, channels: [b1.tip.x, b1.tip.y, b1.angle]}\n",
            overrides=["bodies.b1.model=exact"],
        ),
        error_estimate=False,
    )
    auto = run.statistics["auto"]
    switch = auto["switches"][0]
    assert switch["model"] == "rigid"
    assert 0.05 < switch["time"] < 0.5
    assert abs(switch["energy_share"]) < 1e-3
    shares = auto["shares"]["b1"]
    assert shares["rigid"] == pytest.approx(switch["time"] / 0.6)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert np.array_equal(run.t, truth.t)
    assert tip_error(run, truth) < 0.01
    # nothing jumps where models change: second differences stay as they are in exact
    for mine, real in zip(run.channels, truth.channels, strict=True):
        bend = [np.abs(np.diff(c.values, 2)).max() for c in (mine, real)]
        assert bend[0] < 2.0 * bend[1] + 1e-5
    assert run.statistics["error_estimate"] < 1e-3
    assert run.outlines["b1"].shape[0] == len(run.t)


@pytest.mark.parametrize(("now", "model"), [(0.0, "exact"), (5.0, "linear")])
def test_what_a_forecast_says_of_times_gone_by_keeps_no_beam_from_a_model(now, model):
    run, times = Adaptive.__new__(Adaptive), np.linspace(0.0, 10.0, 11)
    run.loaded = SimpleNamespace(deck=SimpleNamespace(solve=SimpleNamespace(duration=10.0)))
    run.chosen, run.bound = {"b": "rigid"}, 1e-3
    run.forecast = {"b": {"linear": (times, np.where(times == 1.0, 1.0, 0.0))}}
    assert run._next_model("b", now) == model


def test_stiff_beams_stay_rigid_and_soft_ones_start_exact():
    two = load_deck(CASES / "two_beams.yaml", ["solve.model=auto"])
    run = simulate(two, error_estimate=True)
    assert run.statistics["auto"]["shares"] == {"b1": {"rigid": 1.0}, "b2": {"rigid": 1.0}}
    assert run.statistics["steps"] < 10
    assert run.statistics["error_estimate"] < 1e-3
    soft = simulate(load_deck(CASES / "pendulum.yaml"), model="auto", error_estimate=False)
    truth = simulate(load_deck(CASES / "pendulum.yaml"), error_estimate=False)
    assert soft.statistics["auto"]["shares"] == {"b1": {"exact": 1.0}}
    assert soft.channels[0].values[-1] == truth.channels[0].values[-1]


def test_bodies_of_their_own_model_stay_and_a_tighter_error_moves_up_earlier():
    text = GROWING.replace(
        "{type: beam, material: alloy, section: bar, length: 1.0, elements: 2, model: auto}}",
        "{type: beam, material: alloy, section: bar, length: 1.0, elements: 2, model: exact},"
        " b2: {type: beam, material: alloy, section: bar, length: 0.1, elements: 1, model: auto}}",
    )
    text = text.replace("b1.root]}}", "b1.root]}, weld: {type: fixed, between: [b1.tip, b2.root]}}")
    run = simulate(parse_deck(text, overrides=["solve.duration=0.1"]), error_estimate=False)
    assert run.statistics["auto"]["shares"]["b1"] == {"exact": 1.0}
    times = []
    for error in (0.01, 0.002):
        deck = parse_deck(GROWING, overrides=[f"solve.model_error={error}"])
        times.append(simulate(deck, error_estimate=False).statistics["auto"]["switches"][0]["time"])
    assert times[1] < times[0]


def test_the_command_line_tells_shares_and_changes(tmp_path):
    deck = tmp_path / "case.yaml"
    deck.write_text(GROWING)
    out = tmp_path / "out"
    done = call("run", str(deck), "--no-error-estimate", "-o", str(out))
    assert done.exit_code == 0
    assert "share of time" in done.stdout and "b1 from rigid to " in done.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert summary["auto"]["switches"][-1]["next_model"] == summary["models"]["b1"]


def test_where_rigid_beams_have_not_what_is_asked_for_it_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings = ("solve.model=auto", "solve.duration=0.02", "output.channels=[b1.tip.x, b1.root.axial_force]")
    options = [word for one in settings for word in ("--set", one)]
    done = call("run", "pendulum", "--no-plots", *options)
    assert done.exit_code == 0, done.output
    assert "not rigid: b1.root.axial_force: without strains" in " ".join(done.stdout.split())
    facts = json.loads(next(tmp_path.glob("*.out/summary.json")).read_text())
    assert facts["auto"]["shares"] == {"b1": {"exact": 1.0}}


def test_an_estimate_far_beyond_its_range_is_told_as_such():
    """Of a beam that is next to nothing but weight its terms say 4e+300 %."""
    deck = parse_deck(GROWING.replace("7.0e10", "7.0e2").replace("0.6, tol", "0.02, tol"))
    (first,) = simulate(deck, error_estimate=False).statistics["auto"]["switches"]
    assert "estimated error more than 100 % of" in first["reason"] and "e+" not in first["reason"]


SHAFT = """hfsim: 1
gravity: [0, -9.81, 0]
ground: {points: {r: [1.0, 0, 0]}}
materials: {m: {density: 2700.0, youngs_modulus: 7.0e10, poisson_ratio: 0.3}}
sections: {s: {shape: circle, radius: 0.01}}
bodies:
  sh: {type: beam, material: m, section: s, length: 1.0, elements: 2, degree: 3, points: {p: [0.5, 0, 0]}}
  disc: {type: rigid, mass: 1.0, inertia: [0.02, 0.01, 0.01]}
joints:
  h1: {type: revolute, between: [ground, sh.root], axis: [1, 0, 0]}
  h2: {type: revolute, between: [ground.r, sh.tip], axis: [1, 0, 0]}
  f: {type: fixed, between: [sh.p, disc]}
loads: {t: {type: moment, at: disc, moment: [0.3, 0, 0]}}
solve: {duration: 0.5, model: auto}
output: {channels: [disc.angular_velocity_x]}
"""


def test_joints_of_which_equations_are_left_out_hold_as_the_whole_ones():
    """A shaft on two hinges, of one of which nothing is left while it is rigid."""
    inertia = 0.02 + 2700.0 * np.pi * 0.01**4 / 2.0
    run = simulate(parse_deck(SHAFT), error_estimate=False)
    expected = pytest.approx(0.15 / inertia, rel=1e-3)
    assert (run.status, run.final["disc.angular_velocity_x"]) == ("done", expected)


def test_where_models_change_nothing_starts_beyond_its_stop():
    """What takes over 0.3 s after the start has turned by 6 rad: taken for 0 s, that was 0.27 rad beyond."""
    stopped = PINNED.replace("b1.root]", "b1.root], stops: {lower: -1 deg, upper: 3600 deg, stiffness: 100}")
    spin = "initial: {b1: {angle: 0, angular_velocity: 20}}\nsolve: {duration: 0.3}\n"
    old = build(parse_deck(HEAD + stopped + spin), models={"b1": "rigid"})
    path = run_integration(old, old.deck.solve).trajectory
    new, _ = hand_over(old, build(old.loaded, models={"b1": "exact"}), path)
    later = old.deck.solve.model_copy(update={"duration": 0.301})
    run_integration(new, later, start=(0.3, new.q, new.v))
    assert (new.begin, new.warnings) == (0.3, [])
    away = build(parse_deck(HEAD + stopped + spin.replace("angle: 0", "angle: -30 deg")))
    assert any("beyond its stop" in warning for warning in away.warnings)


def free(n_dim, size=1.0, **output):
    """A free rod of sections that is pushed at its tip while it flies."""
    vectors = {"gravity": [0, 0, 0], "force": [0, 500 * size**2, 0], "velocity": [0.5 * size, 0.2 * size, 0],
               "start": [0.3 * size, 0.1 * size, 0]}  # fmt: skip
    own = {name: one[:n_dim] for name, one in vectors.items()}
    deck = {
        "hfsim": 1,
        "name": "rod",
        "gravity": own["gravity"],
        "materials": {"n": {"density": 1150, "youngs_modulus": 1e8, "bending_damping": 0.001}},
        "sections": {"r": {"shape": "rectangle", "width": 0.02 * size, "height": 0.02 * size}},
        "bodies": {"b": {"type": "beam", "element": "cosserat", "material": "n", "section": "r",
                         "length": size, "elements": 3, "model": "auto"}},
        "loads": {"p": {"type": "force", "at": "b.tip", "force": own["force"],
                        "law": {"times": [0, 0.2, 0.21, 0.22, 1], "values": [0, 0, 0.01, 0, 0],
                                "interpolation": "linear"}}},
        "initial": {"b": {"position": own["start"], "velocity": own["velocity"], "angle": 0.4,
                          "angular_velocity": 0.2 if n_dim == 2 else [0.1, 0.1, 0.2]}},
        "solve": {"duration": 0.3},
        "output": {"interval": 0.002, "channels": ["b.tip.x", "b.tip.y"], **output},
    }  # fmt: skip
    return json.dumps(deck)


@pytest.mark.parametrize("n_dim", [2, 3])
def test_a_free_beam_of_sections_goes_over_without_a_turn(n_dim):
    """Nothing is to be closed: the equations of its sections hold in any rigid motion."""
    chosen = simulate(parse_deck(free(n_dim)), error_estimate=False)
    real = parse_deck(free(n_dim).replace('"model": "auto"', '"model": "exact"'))
    exact = simulate(real, error_estimate=False, diagnosis=False)
    (switch,) = chosen.statistics["auto"]["switches"]
    assert (chosen.status, switch["next_model"]) == ("done", "exact")
    assert abs(switch["energy_share"]) < 1e-6
    for mine, other in zip(chosen.channels, exact.channels, strict=True):
        assert mine.values == pytest.approx(other.values, abs=1e-5)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("n_dim", [2, 3])
def test_rigid_motions_close_nothing_of_sections_in_scenes_of_any_size(n_dim, size):
    old = build(parse_deck(free(n_dim, size)), models={"b": "rigid"})
    path = run_integration(old, old.deck.solve.model_copy(update={"duration": 0.1})).trajectory
    new = hand_over(old, build(old.loaded, models={"b": "exact"}), path)[0]
    x, y = old.system.absolute(path.q[None]), new.system.absolute(new.q[None])
    before, after = old.marker("b"), new.marker("b")
    assert after.position(y) == pytest.approx(before.position(x), abs=1e-9 * size)
    assert after.frame(y) == pytest.approx(before.frame(x), abs=1e-9)
    motions = rigid_motions(new, y)
    assert not handover._changes(new.system.unreduced.phi.jacobians(y)[0], motions).any()


@pytest.mark.parametrize("interval", [0.002, 0.25])
def test_a_change_that_finds_no_state_ends_the_run_and_says_so(interval, tmp_path, monkeypatch):
    def blown_up(scene, t, y):
        y *= 1e120

    monkeypatch.setattr(handover, "_close", blown_up)
    deck = tmp_path / "rod.yaml"
    deck.write_text(free(3, interval=interval))
    told = call("run", str(deck), "-o", str(tmp_path / "out"))
    assert told.exit_code == 3, told.output
    failure = json.loads((tmp_path / "out/summary.json").read_text())["failure"]
    assert (failure["class"], failure["item"]) == ("numerical", "bodies.b")
    assert "cannot go over from rigid to exact at t = 0.2 s" in " ".join(told.output.split())
    assert "--set bodies.b.model=exact" in failure["try"]


def test_a_second_run_whose_change_finds_no_state_is_told_as_such(monkeypatch):
    calls, real = [], handover._handed_over

    def second_fails(*given):
        calls.append(given)
        if len(calls) > 1:
            raise np.linalg.LinAlgError("no way")
        return real(*given)

    monkeypatch.setattr(handover, "_handed_over", second_fails)
    run = simulate(parse_deck(free(2)))
    assert run.status == "done" and "no way" in run.statistics["error_estimate_reason"]


def test_a_leg_between_two_output_times_has_no_outlines():
    """Its beam is wound up before the next one."""
    text = free(3, interval=0.05).replace("0.01, 0, 0]", "20.0, 0, 0]")
    run = simulate(parse_deck(text), error_estimate=False, diagnosis=False, outlines=True)
    assert run.status == "failed" and "turns by" in run.reason
    assert len(run.outline_t) == len(run.outlines["b"]) == len(run.t)


def test_energy_that_is_no_number_is_told(tmp_path):
    run = simulate(parse_deck(free(2)), error_estimate=False)
    (switch,) = run.statistics["auto"]["switches"]
    auto = {**run.statistics["auto"], "switches": [{**switch, "energy_gained": None}]}
    facts = {**run.statistics, "auto": auto}
    assert "energy beyond all numbers" in " ".join(as_text(run, facts, tmp_path).split())
