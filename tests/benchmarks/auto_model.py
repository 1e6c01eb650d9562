"""Measure `model: auto` against exact: error, time, models used: python tests/benchmarks/auto_model.py.

Error: distance of a beam's tip from where `exact` has it, over the largest range of a coordinate of that
tip; of the beams of a scene the worst counts.  Times: CPU of choosing, integrating and sampling, medians
of runs taken in turns.  Exit code 1 if a scene misses the error stated.
"""

import argparse
import statistics
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from validity_study import CANTILEVER, CASES, SPIN_UP

from hfsim.scene.loading import load_deck, parse_deck
from hfsim.simulate import simulate

RAMP = """hfsim: 1
gravity: [0.0, -9.81]
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 4}}
joints: {pin: {type: revolute, between: [ground, b1.root]}}
loads:
  push: {type: force, at: b1.tip, force: [0.0, 300.0], follower: true,
         law: {type: smooth_step, from: 0, to: 1, start: 0.4, end: 1.4}}
solve: {duration: 1.5, tolerance: 1.0e-8}
"""
LINKAGE = """hfsim: 1
gravity: [0.0, -9.81]
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections:
  bar: {shape: rectangle, width: 0.02, height: 0.03}
  strip: {shape: rectangle, width: 0.02, height: 0.003}
bodies:
  crank: {type: beam, material: alloy, section: bar, length: 0.4, elements: 4}
  blade: {type: beam, material: alloy, section: strip, length: 0.8, elements: 4}
joints:
  axle: {type: revolute, between: [ground, crank.root]}
  hinge: {type: revolute, between: [crank.tip, blade.root]}
initial: {crank: {angle: 0.0}, blade: {angle: -1.2}}
solve: {duration: 1.0, tolerance: 1.0e-8}
"""


def scenes():
    """Yield names and decks: the shipped scenes and five more."""
    for name in ("pendulum", "two_beams", "two_beams_relative", "hub_beams", "hub_beams_soft"):
        yield name, load_deck(CASES / f"{name}.yaml", ["output.interval=0.005"])
    yield "pendulum, E = 7e10", load_deck(CASES / "pendulum.yaml", ["materials.rubber.youngs_modulus=7e10"])
    yield "spin-up to 2 rad/s", parse_deck(SPIN_UP, "s.yaml", ["joints.motor.angle.rate=2.0"])
    yield "cantilever, 0.1 N", parse_deck(CANTILEVER, "s.yaml", ["loads.push.force=[0.0,0.1]"])
    yield "growing load", parse_deck(RAMP, "s.yaml")
    yield "bar and blade", parse_deck(LINKAGE, "s.yaml")


def channels(deck, names):
    """Return the deck with the tips' positions as its only channels."""
    wanted = tuple(f"{name}.tip.{axis}" for name in names for axis in "xy")
    object.__setattr__(deck.deck.output, "channels", wanted)


def tip_error(run, truth):
    """Return the error of the worst tip."""
    worst = 0.0
    n = min(len(run.t), len(truth.t))
    for k in range(0, len(truth.channels), 2):
        mine, real = (np.stack([one.channels[k + i].values[:n] for i in (0, 1)]) for one in (run, truth))
        worst = max(worst, float(np.linalg.norm(mine - real, axis=0).max() / np.ptp(real, axis=1).max()))
    return worst


def timed(deck, model):
    """Return a run and its CPU time [s]."""
    begin = time.process_time()
    run = simulate(deck, model, error_estimate=False)
    return run, time.process_time() - begin


def describe(facts):
    """Return which beam spent how much of the time in which model."""
    return "; ".join(
        f"{name} " + ", ".join(f"{model} {share:.0%}" for model, share in shares.items())
        for name, shares in facts["shares"].items()
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    print(f"{'scene':22}{'error':>9}{'exact [s]':>11}{'auto [s]':>10}{'ratio':>7}  models")
    missed = 0
    for name, deck in scenes():
        if given.only not in name:
            continue
        channels(deck, [n for n, one in deck.deck.bodies.items() if one.type == "beam"])
        times = {"exact": [], "auto": []}
        for _ in range(given.repeats):
            for model, taken in times.items():
                run, cpu = timed(deck, model)
                taken.append(cpu)
                if model == "exact":
                    truth = run
        error = tip_error(run, truth) if run.status == "done" else np.inf
        missed += error > deck.deck.solve.model_error
        exact, auto = (statistics.median(taken) for taken in times.values())
        facts = run.statistics["auto"]
        print(
            f"{name:22}{error:9.1e}{exact:11.3f}{auto:10.3f}{exact / auto:7.2f}  {describe(facts)}",
            flush=True,
        )
        for s in facts["switches"]:
            print(
                f"{'':22}at {s['time']:.3g} s {s['body']} {s['model']} -> {s['next_model']}, "
                f"energy {s['energy_gained']:+.1e} J ({s['energy_share']:+.1e})"
            )
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
