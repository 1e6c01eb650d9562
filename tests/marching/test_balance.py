"""The energy drift of runs that end their steps at rest, do not move at all, or lose energy."""

import numpy as np
import pytest

from hfsim.integrators import Segment, Trajectory
from hfsim.marching.balance import Balance, balance, step_samples
from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.maths.traced import Refused
from hfsim.mechanics.projection import Projection
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.scene.shipped import find_deck
from hfsim.simulate import simulate

needs_kernel = pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")

ROTOR = """
hfsim: 1
bodies: {rotor: {type: rigid, mass: 1.0, inertia: 1.0}}
joints: {axle: {type: revolute, between: [ground, rotor]}}
springs: {coil: {type: rotational, between: [ground, rotor], stiffness: 39.47841760435743}}
initial: {rotor: {angle: 0.5}}
solve: {duration: 1.0, method: gauss, step: 0.5, stages: 16}
"""
RESTING = """
hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 4}}
joints: {pin: {type: revolute, between: [ground, b1.root]}}
initial: {b1: {angle: 0.7}}
solve: {duration: 1.0}
"""


def drift(deck, *overrides):
    scene = build(parse_deck(deck, "deck", overrides))
    done = run_integration(scene, scene.deck.solve)
    assert done.stop is None
    return balance(scene, step_samples(done.trajectory))["energy_drift"]


def test_a_swing_whose_steps_end_at_rest_has_the_energy_of_its_middle():
    """Two steps of half a period: at all their ends the kinetic energy is zero, the spring fully wound."""
    assert drift(ROTOR) < 1e-13


@pytest.mark.parametrize("elements", [1, 4, 16])
@pytest.mark.parametrize("model", ["exact", "ancf", "linear"])
def test_a_scene_at_rest_does_not_drift(elements, model):
    assert drift(RESTING, f"bodies.b1.elements={elements}", f"solve.model={model}") == 0.0


SPRUNG = """
hfsim: 1
bodies:
  m: {type: rigid, mass: 1.0, inertia: 1.0, points: {a: [1.0, 0.0]}}
  n: {type: rigid, mass: 1.0, inertia: 1.0}
springs:
  k: {type: two_point, between: [ground, m], stiffness: 3.0e6, rest_length: 1.0}
  l: {type: two_point, between: [m.a, n], stiffness: 3.0e6, rest_length: 1.2}
initial: {m: {position: [0.6, 0.8]}, n: {position: [2.8, 0.8]}}
solve: {duration: 1.0}
"""


@pytest.mark.parametrize("method", ["gauss", "energy", "gear", "generalized_alpha"])
def test_springs_at_rest_do_not_drift(method):
    """All that moves is what the tolerance leaves of rates, 1e-22 J, and that was told as lost."""
    assert drift(SPRUNG, f"solve.method={method}") == 0.0


HUNG = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies:
  arm: {type: beam, material: alloy, section: bar, length: 1.0, elements: 4}
  bob: {type: rigid, mass: 1.0, inertia: 0.1}
joints:
  clamp: {type: fixed, between: [ground, arm.root]}
  pin: {type: revolute, between: [arm.tip, bob]}
initial: {equilibrium: true}
solve: {duration: 1.0, model: rigid}
"""


def test_weight_on_what_holds_it_does_not_drift():
    """A last digit of the place of the bob is 3e-13 J of its weight, and nothing else changes."""
    assert drift(HUNG) == 0.0


PUSHED = """
hfsim: 1
ground: {points: {wall: [0.043, 0.046]}}
bodies: {b: {type: rigid, mass: 1.0, inertia: 0.01, points: {root: [-0.2, 0.0], tip: [0.2, 0.0]}}}
joints: {clamp: {type: fixed, between: [ground.wall, b.root], angle: -55 deg}}
loads: {f: {type: force, at: b.tip, force: [-3.4, 4.0], law: {type: sine, amplitude: 1.0, frequency: 3.8}}}
solve: {duration: 0.5}
"""


@pytest.mark.parametrize("frequency", [3.8, 4.0])
@pytest.mark.parametrize("method", ["gauss", "energy", "generalized_alpha"])
def test_a_load_on_what_is_held_does_not_drift(method, frequency):
    """Nothing is stored, and the work is that on rounded places; 4 Hz are zero where the step ends."""
    assert drift(PUSHED, f"solve.method={method}", f"loads.f.law.frequency={frequency}") == 0.0


SHAKEN = """
hfsim: 1
gravity: [0.0, -9.81]
bodies: {bar: {type: rigid, mass: 0.1, inertia: 1.0e-3, points: {foot: [-0.15, 0.0]}}}
joints:
  shake: {type: motion, between: [ground, bar.foot], hinged: true,
          y: {type: sine, amplitude: 5 mm, frequency: 30 Hz}}
initial: {bar: {angle: 80 deg}}
solve: {duration: 3.0, method: gauss, stages: 20}
"""


def test_the_work_of_a_shaker_is_counted_as_finely_as_its_steps_are_solved():
    """Steps of two periods, whose error 20 stages keep at 1e-6: 16 points of power told a drift of 8e-5."""
    assert drift(SHAKEN) < 1e-5


@pytest.mark.parametrize("angle", [0.5, 1e-6])
def test_energy_that_is_lost_is_told_however_small_the_motion(angle):
    lossy = ["solve.method=radau", "solve.stages=1", "solve.step=0.01"]
    assert drift(ROTOR, f"initial.rotor.angle={angle}", *lossy) > 0.1


FLUNG = """
hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {area: 1.0e-4, second_moment: 1.0e-9}}
bodies:
  b: {type: beam, material: alloy, section: bar, length: 1.0, elements: 2}
  m: {type: rigid, mass: 1.0, inertia: 1.0}
joints: {pin: {type: revolute, between: [ground, b.root]}}
springs: {k: {type: two_point, between: [ground, m], stiffness: 3.0e6, rest_length: 0.0}}
initial: {m: {position: [1.0, 0.0]}}
solve: {duration: 2.0, method: explicit, step: 4.0e-3}
output: {interval: 0.1, channels: [m.x]}
"""


@pytest.mark.parametrize("size", [1e40, 1e90, 1e160])
def test_a_motion_out_of_all_scale_is_a_drift_and_not_rounding(size):
    """One body is flung away: what rounding its place would do to a stiff beam is no measure of energies."""
    scene = build(parse_deck(FLUNG))
    far = scene.q + size * (np.arange(len(scene.q)) == len(scene.q) - 3)
    segments = [Segment(0.1 * k, 0.1, scene.q, scene.v, np.zeros((1, len(far)))) for k in range(3)]
    with np.errstate(all="ignore"):
        facts = balance(scene, step_samples(Trajectory(0.0, 0.3, far, scene.v, segments)))
    assert facts["energy_drift"] == pytest.approx(1.0, abs=1e-6)


TURNED = """
hfsim: 1
parameters: {a: 180 deg}
bodies: {b: {type: rigid, mass: 1.0, inertia: [1.0, 1.0, 1.0]}}
springs: {m: {type: bushing, between: [ground, b], rotational_stiffness: 1000}}
initial: {b: {position: [0, 0, 0], orientation: {axis: [0, 1, 0], angle: "${a}"}}}
solve: {duration: 0.3}
"""


@pytest.mark.parametrize("stretches", [1, 3])
def test_a_state_at_which_energies_jump_excuses_no_drift(stretches):
    """Half a turn from rest the last digit makes 1e4 J: ten thousand times that was taken for the scale."""
    angles = [180, 90, 80, 70, 60, 50, 40]
    scenes = [build(parse_deck(TURNED, overrides=[f"parameters.a={angle} deg"])) for angle in angles]
    q, v, none = [one.q for one in scenes], scenes[0].v, np.zeros((1, len(scenes[0].q)))
    found = Balance(scenes[-1])
    for some in np.split(np.arange(6), stretches):
        segments = [Segment(0.05 * k, 0.05, q[k], v, none) for k in some]
        end = int(some[-1]) + 1
        found.add(step_samples(Trajectory(0.05 * some[0], 0.05 * end, q[end], v, segments)))
    assert found.facts()["energy_drift"] > 0.5


@pytest.mark.parametrize("method, most", [("generalized_alpha", 1e-4), ("gear", 5e-3), ("energy", 4e-9)])
def test_drift_is_that_of_steps_and_not_of_how_their_inside_leaves_the_joints(method, most):
    """Power of the drivers in states off the joints makes ten times as much of it, and more."""
    settings = (f"solve.method={method}", "solve.tolerance=1e-3", "solve.duration=0.1")
    assert drift(find_deck("joints").read_text(), *settings) < most


CRANK = """
hfsim: 1
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {rod: {shape: circle, diameter: 0.02}}
bodies:
  crank: {type: rigid, mass: 0.5, inertia: 0.01, points: {a: [-0.1, 0.0], b: [0.1, 0.0]}}
  rod: {type: beam, material: alloy, section: rod, length: 0.5, elements: 4}
  slider: {type: rigid, mass: 0.5, inertia: 0.01}
joints:
  axle: {type: revolute, between: [ground, crank.a]}
  pin: {type: revolute, between: [crank.b, rod.root]}
  wrist: {type: revolute, between: [rod.tip, slider]}
  rail: {type: prismatic, between: [ground, slider], axis: [1, 0]}
  motor: {type: driver, between: [ground, crank], angle: {type: constant_rate, rate: 10.0}}
solve: {duration: 1.0, tolerance: 1.0e-4}
"""


def test_what_drives_stiff_bodies_does_not_seem_to_stretch_them_inside_steps():
    """A rod whose ends were moved onto the joints there, by nanometres, told a drift of 7e-5."""
    assert drift(CRANK) < 5e-6


@needs_kernel
@pytest.mark.parametrize("name", ["joints", "blade"])
def test_states_inside_steps_are_looked_at_natively_as_in_numpy(name, monkeypatch):
    scene = build(load_deck(find_deck(name), ["solve.duration=0.6"]))
    steps = step_samples(run_integration(scene, scene.deck.solve).trajectory)
    points = len(steps.shares)
    kinds = [f"rates on joints of {points} states", f"reactions of {points} states"]
    natively = balance(scene, steps)
    assert all(scene.recordings.mine[kind].refused is None for kind in kinds)
    monkeypatch.setattr(kernel, "KERNEL", "numpy")
    found = balance(scene, steps)
    size = max(abs(found[key]) for key in ("energy_initial", "energy_final", "work_done"))
    assert found["work_done"] and natively == pytest.approx(found, abs=1e-9 * size)
    assert natively["energy_drift"] == pytest.approx(found["energy_drift"], rel=1e-3, abs=1e-11)


@needs_kernel
def test_states_are_looked_at_at_once_where_nothing_can_be_recorded(monkeypatch):
    """Of a first step it is seen that nothing can."""
    sizes, steadied = [], Projection.steadied

    def noted(projection, t, *rest):
        sizes.append(len(t))
        return steadied(projection, t, *rest)

    def refused(*given):
        raise Refused("anything")

    scene = build(load_deck(find_deck("blade"), ["solve.duration=0.6"]))
    steps = step_samples(run_integration(scene, scene.deck.solve).trajectory)
    monkeypatch.setattr(Projection, "steadied", noted)
    monkeypatch.setattr("hfsim.maths.replayed.agree", refused)
    balance(scene, steps)
    points = len(steps.shares)
    assert set(sizes[:-1]) == {points} and sizes[-1] == points * (len(steps.t) - 2)


def test_steps_that_feed_the_motion_end_it_as_a_fault_of_the_method():
    run = simulate(parse_deck(FLUNG.replace("7.0e10", "7.0e5")), error_estimate=False, diagnosis=True)
    assert run.status == "failed"
    assert "beyond all scale" in run.reason
    assert run.failure["class"] == "numerical"
    assert run.failure["item"] == "solve.step"
    assert run.failure["evidence"]["largest_rate"] < 1e100
    assert run.statistics["energy_drift"] > 1e-3
