"""Rotational springs on beams: their angle counts full turns along the motion, whatever steps are made."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from hfsim.errors import LimitReached, SolverFailure
from hfsim.integrators import METHODS, Limits, Stepping, _loop, choose
from hfsim.marching.integration import problem_of, run_integration
from hfsim.maths import kernel
from hfsim.mechanics.turns import TurnCount, Turning
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate
from hfsim.trust.handover import hand_memory

HEAD = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {{alloy: {{density: 2700.0, youngs_modulus: {modulus}}}}}
sections: {{bar: {{shape: rectangle, width: 5.0e-2, height: 5.0e-2}}}}
"""
BEAM = "{{type: beam, material: alloy, section: bar, length: 1.0, elements: 1}}"
SCENES = {
    "root": f"""
bodies: {{{{b: {BEAM}}}}}
joints: {{{{pin: {{{{type: revolute, between: [ground, b.root]}}}}}}}}
springs: {{{{coil: {{{{type: rotational, between: [ground, b.root], stiffness: 2.0, damping: 0.02}}}}}}}}
initial: {{{{b: {{{{angular_velocity: 20.0}}}}}}}}
""",
    "tip": f"""
bodies: {{{{b: {BEAM}}}}}
joints: {{{{pin: {{{{type: revolute, between: [ground, b.root]}}}}}}}}
springs: {{{{coil: {{{{type: rotational, between: [b.tip, ground], stiffness: 2.0, rest_angle: 3.5}}}}}}}}
initial: {{{{b: {{{{angle: -7.0, angular_velocity: 20.0}}}}}}}}
""",
    "beams": f"""
bodies: {{{{a: {BEAM}, b: {BEAM}}}}}
joints:
  pin: {{{{type: revolute, between: [ground, a.root]}}}}
  hinge: {{{{type: revolute, between: [a.root, b.root]}}}}
springs: {{{{coil: {{{{type: rotational, between: [a.tip, b.root], stiffness: 2.0}}}}}}}}
initial: {{{{b: {{{{angular_velocity: 30.0}}}}}}}}
""",
    "wheel": f"""
bodies: {{{{b: {BEAM}, w: {{{{type: rigid, mass: 1.0, inertia: 0.05}}}}}}}}
joints:
  clamp: {{{{type: fixed, between: [ground, b.root]}}}}
  hinge: {{{{type: revolute, between: [b.tip, w]}}}}
springs: {{{{coil: {{{{type: rotational, between: [w, b.tip], stiffness: 0.05}}}}}}}}
initial: {{{{w: {{{{angular_velocity: 25.0}}}}}}}}
""",
}
TURNING = {"root": "b", "tip": "b", "beams": "b", "wheel": "w"}
STIFF, SOFT = 7e9, 7e7


def deck_of(scene, modulus, duration=1.5, **solve):
    solve = {"duration": duration, "tolerance": 1e-6} | solve
    text = (HEAD + SCENES[scene]).format(modulus=modulus)
    body = TURNING[scene]
    return parse_deck(
        f"{text}\nsolve: {{{', '.join(f'{k}: {v}' for k, v in solve.items())}}}\n"
        f"output: {{interval: 0.05, channels: [{body}.angle, energy.potential, energy.total]}}"
    )


def channels(run):
    assert run.status == "done", run.reason
    return {one.name: one.values for one in run.channels}


@cache
def known(scene, modulus, duration=1.5, **solve):
    """Channels that others are held against."""
    return channels(simulate(deck_of(scene, modulus, duration, **solve), error_estimate=False))


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(
    ("model", "coordinates"),
    [("exact", "absolute"), ("exact", "frame"), ("ancf", "auto"), ("linear", "auto"), ("lowOrder", "auto")],
)
def test_a_stiff_beam_turns_as_a_rigid_one_does(scene, model, coordinates):
    rigid = known(scene, STIFF, 0.8, model="rigid")
    solve = {"model": model, "coordinates": coordinates, "tolerance": 1e-4}
    run = simulate(deck_of(scene, STIFF, 0.8, **solve), error_estimate=False)
    found, angle = channels(run), f"{TURNING[scene]}.angle"
    assert np.ptp(rigid[angle]) > 3.0 * np.pi
    assert found[angle] == pytest.approx(rigid[angle], abs=0.02 * np.ptp(rigid[angle]))
    potential = rigid["energy.potential"]
    assert found["energy.potential"] == pytest.approx(potential, abs=0.05 * potential.max())
    assert run.statistics["energy_drift"] < 1e-3


LONG = ("gear", "generalized_alpha", "energy", "explicit")


@pytest.mark.parametrize(
    "method", [pytest.param(one, marks=pytest.mark.slow) if one in LONG else one for one in METHODS]
)
def test_every_method_counts_turns(method):
    """A soft beam under a spring with a damper, three turns; the energy has nowhere to go but there."""
    whole = known("root", SOFT, method="radau", tolerance=1e-8)
    run = simulate(deck_of("root", SOFT, method=method, tolerance=1e-6), after=60.0)
    found = channels(run)
    assert whole["b.angle"].max() > 6.0 * np.pi
    assert found["b.angle"] == pytest.approx(whole["b.angle"], abs=5e-3)
    assert found["energy.potential"] == pytest.approx(whole["energy.potential"], rel=2e-3, abs=0.1)
    assert run.statistics["energy_drift"] < 1e-3
    assert run.statistics["error_estimate"] < 1e-3


def test_steps_may_hold_turns_if_the_angle_goes_on_as_it_began():
    scene = build(deck_of("wheel", STIFF, 4.0, method="gauss", tolerance=1e-3))
    done = run_integration(scene, scene.deck.solve)
    turned = [abs(step.v[-1]) * step.h for step in done.trajectory.segments]
    assert done.stop is None
    assert max(turned) > 2.0 * np.pi
    assert done.trajectory.q[-1] == pytest.approx(25.0 * np.sin(4.0), rel=2e-2)


SPUN = """
hfsim: 1
gravity: [0.0, 0.0]
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e7}}
sections: {bar: {shape: rectangle, width: 5.0e-2, height: 5.0e-2}}
bodies: {b: {type: beam, material: alloy, section: bar, length: 1.0, elements: 1}}
joints:
  pin: {type: revolute, between: [ground, b.root]}
  motor: {type: driver, between: [ground, b.root], angle: {type: sine, amplitude: 8.0, frequency: 1.0}}
springs: {coil: {type: rotational, between: [ground, b.root], stiffness: 2.0}}
solve: {duration: 0.2, tolerance: 1.0e-3}
output: {interval: 0.01, channels: [energy.potential]}
"""


def test_a_fixed_step_in_which_turns_cannot_be_counted_ends_the_run_and_a_free_one_is_shortened():
    run = simulate(parse_deck(SPUN), error_estimate=False)
    angle = 8.0 * np.sin(2.0 * np.pi * run.t)
    assert channels(run)["energy.potential"] == pytest.approx(angle**2, abs=1e-3)
    scene = build(parse_deck(SPUN))
    problem = problem_of(scene)
    solve = scene.deck.solve.model_copy(update={"step": 0.2, "method": "radau"})
    start = (0.0, scene.q, scene.v)
    run = Stepping(problem, choose(solve, False), start, 0.2, Limits(0.2), lambda t, q, v: None)
    tried = run._attempt(run._begin(), 1e-4)
    assert tried.solved
    far = tried._replace(series=np.zeros((1, len(tried.q))), seen=None)
    run._stepper.attempt = lambda t, q, v, h: far
    with pytest.raises(SolverFailure, match=r"turns of the angle of springs.coil") as failure:
        run._attempt(run._stepper, 0.1)
    assert failure.value.item == "springs.coil"


@pytest.mark.parametrize("method", METHODS)
def test_turns_are_counted_on_where_a_run_was_put_down(method, monkeypatch):
    monkeypatch.setattr(_loop, "AT_ONCE", 1)

    def stepping(most):
        scene = build(deck_of("root", SOFT, method=method))
        problem, solve = problem_of(scene), scene.deck.solve
        start, limits = (0.0, scene.q, scene.v), Limits(solve.step, most)
        return Stepping(problem, choose(solve, True), start, 1.5, limits, lambda t, q, v: None), scene

    first, scene = stepping(None)
    coil = scene.system.forces[-1]
    for _ in first:
        if coil.counter.now.angle > 2.5 * np.pi:
            break
    memory = first.memory()
    rest = [next(first) for _ in range(5)]
    again, _ = stepping(first._problem.counts.steps)
    again.recall(memory)
    for one, other in zip(again, rest, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    assert isinstance(again.stop, LimitReached)


@pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")
@pytest.mark.parametrize("scene", SCENES)
def test_turns_are_counted_natively_as_step_by_step(scene, monkeypatch):
    """Over some turns, also by angles that leave what was noted of them within one native call."""
    made = []
    for at_once in (0, _loop.AT_ONCE):
        monkeypatch.setattr(_loop, "AT_ONCE", at_once)
        built = build(deck_of(scene, SOFT, method="gauss"))
        done = run_integration(built, built.deck.solve)
        (count,) = (part.counter for part in built.system.forces if part.counter is not None)
        made.append((done.trajectory.segments, done.problem.counts, count.noted))
    (one, counts, noted), (other, others, known) = made
    assert np.ptp([turning.angle for turning in noted]) > 2.0 * np.pi
    assert known == noted
    assert vars(others) == vars(counts)
    pairs = (pair for steps in zip(one, other, strict=True) for pair in zip(*steps, strict=True))
    assert all(np.array_equal(*pair) for pair in pairs)


def test_parts_that_are_integrated_apart_count_their_turns():
    bodies = ", ".join(f"{name}: {BEAM.format()}" for name in "ab")
    deck = (
        HEAD.format(modulus=STIFF)
        + f"""
bodies: {{{bodies}}}
joints:
  left: {{type: revolute, between: [ground, a.root]}}
  right: {{type: revolute, between: [ground, b.root]}}
springs: {{coil: {{type: rotational, between: [ground, b.root], stiffness: 2.0}}}}
initial: {{b: {{angular_velocity: 20.0}}}}
solve: {{duration: 0.8, tolerance: 1.0e-4}}
output: {{interval: 0.05, channels: [b.angle, energy.potential]}}
"""
    )
    deck = deck.replace("elements: 1", "elements: 9")
    scene = build(parse_deck(deck))
    assert len(scene.parts) == 2
    run = simulate(parse_deck(deck), error_estimate=False)
    found = channels(run)
    assert found["b.angle"].max() > 3.0 * np.pi
    assert found["energy.potential"] == pytest.approx(found["b.angle"] ** 2, rel=1e-2, abs=0.5)
    assert run.statistics["energy_drift"] < 1e-3


def test_beams_that_change_their_model_on_the_way_go_on_in_the_same_turn():
    deck = (HEAD + SCENES["root"]).format(modulus=STIFF).replace("damping: 0.02", "damping: 0.0")
    deck += """
loads:
  push:
    {type: moment, at: b.tip, moment: 400.0,
     law: {type: smooth_step, from: 0.0, to: 1.0, start: 0.5, end: 0.6}}
solve: {duration: 0.7, model: auto, model_error: 5.0e-2, tolerance: 1.0e-4}
output: {interval: 0.01, channels: [b.angle, energy.potential]}
"""
    run = simulate(parse_deck(deck), error_estimate=False)
    found = channels(run)
    switch = run.statistics["auto"]["switches"][-1]
    assert switch["model"] == "rigid"
    assert np.interp(switch["time"], run.t, found["b.angle"]) > 2.5 * np.pi
    assert found["energy.potential"] == pytest.approx(found["b.angle"] ** 2, rel=1e-2, abs=0.5)


def test_counts_look_back_to_any_earlier_time():
    """An angle that swings to and fro over some turns, noted every now and then."""

    def angle(t):
        return 20.0 * np.sin(t)

    count = TurnCount()
    steps = np.linspace(0.0, 10.0, 101)
    count.start(Turning(0.0, 0.0, 20.0))
    for a, b in pairwise(steps):
        times = np.linspace(a, b, 17)[1:]
        seen = count.counted(times, np.angle(np.exp(1j * angle(times))))
        assert seen == pytest.approx(angle(times), abs=1e-9)
        count.keep(Turning(b, angle(b), 20.0 * np.cos(b)), count.left(times, seen)[1])
    every = np.linspace(0.0, 10.0, 999)
    for _ in range(2):
        assert count.counted(every, np.angle(np.exp(1j * angle(every)))) == pytest.approx(
            angle(every), abs=1e-9
        )
        count.end()
    assert len(count.noted) < 40


def test_what_was_noted_of_later_times_is_of_no_motion_that_starts_before_them():
    count, here = TurnCount([Turning(0.0, 0.0, 0.0), Turning(5.0, 20.0, 0.0)]), Turning(1.0, 1.0, 0.0)
    count.start(here)
    assert count.noted == [Turning(0.0, 0.0, 0.0), here]


IN_SPACE = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies: {m: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}}
joints: {c: {type: revolute, between: [ground, m], axis: AXIS%s}%s}
%s
solve: {duration: 0.05}
output: {channels: [energy.total, m.angular_velocity_z]}
"""
DRIVER = """,
  d: {type: driver, between: [ground, m], axis: AXIS,
      angle: {type: constant_rate, start: 200 deg, rate: 0}}"""
SPRING = "springs: {k: {type: rotational, between: [ground, m], axis: AXIS, stiffness: 0.5, rest_angle: %s}}"
STOPS = ", stops: {lower: %d deg, upper: %d deg, stiffness: 100}"
STATED = "initial: {m: {angle: %s}}"
OF_THE_AXIS = "initial: {m: {orientation: {axis: AXIS, angle: %s}}}"
VECTOR = "initial: {m: {orientation: {rotation_vector: [0, 0, %s]}}}"
WELDED = """,
  f: {type: fixed, between: [m, n]}"""
ON_A_FREE_BODY = """
hfsim: 1
gravity: [0.0, 0.0, 0.0]
bodies: {bus: {type: rigid, mass: 9, inertia: [1, 1, 1]}, m: {type: rigid, mass: 1, inertia: [0.1, 0.1, 0.1]}}
joints: {c: {type: revolute, between: [bus, m], axis: AXIS}}
springs: {k: {type: rotational, between: [bus, m], axis: AXIS, stiffness: 0.5, rest_angle: 180 deg}}
initial: {m: {angle: %s}}
solve: {duration: 0.05}
output: {channels: [energy.total]}
"""
SECOND = "springs: {k: {type: rotational, between: [n, ground], axis: AXIS, stiffness: 0.5, rest_angle: %s}}"


@pytest.mark.parametrize(
    ("deck", "axis", "energy"),
    [
        (IN_SPACE % (STOPS % (170, 270), "", STATED % "200 deg"), [0, 0, 1], 0.0),
        (IN_SPACE % (STOPS % (-270, -170), "", STATED % "200 deg"), [0, 0, -1], 0.0),
        (IN_SPACE % (STOPS % (170, 270), "", OF_THE_AXIS % "200 deg"), [1, 2, -1], 0.0),
        (IN_SPACE % ("", "", SPRING % "0" + "\n" + STATED % "9.0"), [0, 0, 1], 0.25 * 81.0),
        (IN_SPACE % ("", "", SPRING % "0" + "\n" + OF_THE_AXIS % "-9.0"), [1, 0, 0], 0.25 * 81.0),
        (IN_SPACE % ("", "", SPRING % "0" + "\n" + VECTOR % "9.0"), [0, 0, -1], 0.25 * 81.0),
        (IN_SPACE % ("", WELDED, SECOND % "0" + "\n" + STATED % "9.0"), [0, 0, 1], 0.25 * 81.0),
        (IN_SPACE % ("", DRIVER + WELDED, SECOND % "-180 deg"), [0, 3, 4], 0.25 * np.deg2rad(20.0) ** 2),
        (IN_SPACE % ("", DRIVER, SPRING % "180 deg"), [0, 0, 1], 0.25 * np.deg2rad(20.0) ** 2),
        (ON_A_FREE_BODY % "270 deg", [0, 0, 1], 0.25 * np.deg2rad(90.0) ** 2),
        (ON_A_FREE_BODY % "-9.0", [0, 0, 1], 0.25 * (9.0 + np.pi) ** 2),
    ],
)  # fmt: skip
def test_turns_that_a_deck_states_in_space_count(deck, axis, energy):
    deck = deck.replace("AXIS", str(axis))
    if WELDED in deck:
        deck = deck.replace("0.1]}}", "0.1]}, n: {type: rigid, mass: 1.0, inertia: [0.1, 0.1, 0.1]}}")
    run = simulate(parse_deck(deck), error_estimate=False)
    assert (run.status, run["energy.total"][0]) == ("done", pytest.approx(energy, abs=1e-12))
    assert np.ptp(run["energy.total"]) <= 1e-8 * max(energy, 1.0)


def test_what_takes_over_in_space_goes_on_in_the_same_turn():
    """What it is built from may be at the same place less two turns."""
    deck = (IN_SPACE % ("", "", SPRING % "0")).replace("AXIS", "[0, 0, 1]")
    old, new = (build(parse_deck(f"{deck}initial: {{c: {{angle: {one} deg}}}}")) for one in (760, 40))
    t, x, (spring,) = np.zeros(1), old.system.absolute(old.q[None]), new.system.forces
    hand_memory(old.system, new.system, t, x)
    (one,) = spring.angles
    assert np.rad2deg(one.counter.counted(t, one.angle(x))) == pytest.approx([760.0])


def placed(spatial, joints="", initial="", springs=""):
    """Angles [deg] at the start of hinges, springs and drivers about the axis across the plane, by names."""
    tied = {f"k{n}": pair for n, pair in enumerate(("ground, a", "a, b", "ground, b"))}
    coils = [f"{k}: {{type: rotational, between: [{pair}], stiffness: 1.0}}" for k, pair in tied.items()]
    every = ", ".join((*coils, springs) if springs else coils)
    inertia, gravity = ("[0.1, 0.1, 0.1]", "[0, 0, 0]") if spatial else ("0.1", "[0, 0]")
    run = simulate(
        parse_deck(f"""
hfsim: 1
gravity: {gravity}
bodies: {{{", ".join(f"{k}: {{type: rigid, mass: 1.0, inertia: {inertia}}}" for k in "ab")}}}
joints: {{h: {{type: revolute, between: [ground, a]}}{joints and ", "}{joints}}}
springs: {{{every}}}
initial: {{{initial}}}
solve: {{duration: 1.0e-3}}
output: {{channels: [{", ".join(f"{k}.angle" for k in ("h", *tied, *(["s"] if springs else ())))}]}}
"""),
        error_estimate=False,
    )
    assert run.status == "done", run.reason
    return {k.removesuffix(".angle"): float(np.rad2deg(one[0])) for k, one in channels(run).items()}


HINGED = "i: {type: revolute, between: [a, b]}"
FIXED_AT_200 = "f: {type: fixed, between: [a, b], angle: 200 deg}"
LED = HINGED + ", d: {type: driver, between: [%s], angle: %s deg}"


@pytest.mark.parametrize(
    ("joints", "initial"),
    [
        (FIXED_AT_200, "a: {angle: 720 deg}"),
        (FIXED_AT_200, "b: {angle: 720 deg}"),
        ("m: {type: motion, between: [a, b], turn: 400 deg, angle: 200 deg}", "a: {angle: 10 deg}"),
        (LED % ("a, b", 720), ""),
        (LED % ("a, b", 720), "b: {angle: 10 deg}"),
        (LED % ("a, b", 720), "a: {angle: 10 deg}, b: {angle: 370 deg}"),
        (LED % ("ground, a", 200), "a: {angle: -160 deg, exact: true}"),
        (LED % ("a, ground", 200), "a: {angle: 160 deg}, b: {angle: 0}"),
        (HINGED, "a: {angle: 10 deg}, h: {angle: 730 deg}, b: {angle: 0}"),
        (HINGED, "a: {angle: 10 deg}, b: {angle: 10 deg}, i: {angle: -720 deg}"),
    ],
)
def test_turns_are_counted_from_the_start_in_space_as_in_the_plane(joints, initial):
    assert placed(True, joints, initial) == pytest.approx(placed(False, joints, initial), abs=1e-9)


def about_z(angle, form):
    c, s, half = (float(f(np.deg2rad(angle) / n)) for f, n in ((np.cos, 1), (np.sin, 1), (np.cos, 2)))
    return {
        "angle": f"{{axis: [0, 0, 1], angle: {angle} deg}}",
        "vector": f"{{rotation_vector: [0, 0, {np.deg2rad(angle)}]}}",
        "axes": f"{{x: [{c}, {s}, 0], y: [{-s}, {c}, 0]}}",
        "quaternion": f"{{quaternion: [{half}, 0, 0, {float(np.sin(np.deg2rad(angle) / 2))}]}}",
    }[form]


@pytest.mark.parametrize(
    ("body", "zero", "angle"),
    [
        ((170, "angle"), (200, "angle"), -30),
        ((170, "angle"), (-160, "vector"), 330),
        ((170, "angle"), (200, "axes"), -30),
        ((190, "angle"), (180, "axes"), 10),
        ((190, "angle"), (190, "axes"), 0),
        ((190, "vector"), (-170, "angle"), 360),
        ((190, "quaternion"), (180, "angle"), 10),
        ((166, "quaternion"), (-57, "angle"), -137),
        ((166, "angle"), (-57, "angle"), 223),
        ((300, "angle"), (0, "axes"), 300),
        ((730, "angle"), (90, "quaternion"), 640),
        ((550, "vector"), (180, "axes"), 370),
        ((-550, "angle"), (0.5, "angle"), -550.5),
    ],
)
def test_turns_of_an_orientation_count_where_it_states_them(body, zero, angle):
    """Else the angle is within half a turn, but for full turns that are stated."""
    spring = f"s: {{type: rotational, between: [ground, a], stiffness: 1.0, orientation: {about_z(*zero)}}}"
    found = placed(True, HINGED, f"a: {{orientation: {about_z(*body)}}}", spring)
    assert found["s"] == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize(
    ("more", "angle"),
    [
        (f"orientation: {about_z(200, 'angle')}", 800),
        (f"orientation: {about_z(-300, 'vector')}", 300),
        ("axis: [0, 0, -1]", -600),
    ],
)
def test_turns_that_a_driver_begins_with_count_from_its_zero_and_about_its_axis(more, angle):
    driver = f"d: {{type: driver, between: [ground, a], angle: 600 deg, {more}}}"
    found = placed(True, f"{HINGED}, {driver}")
    assert (found["h"], found["k0"]) == pytest.approx((angle, angle), abs=1e-9)


def test_turns_stated_of_a_joint_count_from_a_tilted_orientation():
    """Its turn about the axis is half a turn at most."""
    tilted = "{quaternion: [0.8, 0.2, -0.1, 0.5]}"
    spring = f"s: {{type: rotational, between: [ground, a], stiffness: 1.0, orientation: {tilted}}}"
    near, far = (placed(True, HINGED, f"h: {{angle: {one} deg}}", spring)["s"] for one in (8, -352))
    assert abs(near) < 180 and far == pytest.approx(near - 360, abs=1e-9)
