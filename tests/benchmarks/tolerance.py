"""Work against error for each tolerance: python tests/benchmarks/tolerance.py.

Error: of time, largest over the output times in the worst channel, relative to its range, against a run at
1e-11. The default of ``solve.tolerance`` rests on this table.
"""

import argparse
import math
import time

from auto_model import scenes as model_scenes

from hfsim.marching.distance import channel_errors, farthest
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
TRUTH = 1e-11
MANIPULATOR = """hfsim: 1
gravity: [0.0, -9.81]
materials: {steel: {density: 7800.0, youngs_modulus: 2.1e11}}
sections: {tube: {area: 4.0e-4, second_moment: 2.0e-8}}
bodies:
  upper: {type: beam, material: steel, section: tube, length: 1.0, elements: 4}
  lower: {type: beam, material: steel, section: tube, length: 0.8, elements: 4}
joints:
  shoulder: {type: revolute, between: [ground, upper.root]}
  elbow: {type: revolute, between: [upper.tip, lower.root]}
springs:
  servo1: {type: rotational, between: [ground, upper], stiffness: 2000.0, damping: 40.0}
  servo2: {type: rotational, between: [upper.tip, lower], stiffness: 800.0, damping: 15.0}
loads:
  push: {type: force, at: lower.tip, force: [0.0, 30.0],
         law: {type: smooth_step, from: 0, to: 1, start: 0.0, end: 0.2}}
solve: {duration: 0.5}
"""


def scenes():
    """Yield names and decks."""
    yield from model_scenes()
    yield "manipulator", parse_deck(MANIPULATOR, "manipulator.yaml")


def table(name, loaded):
    """Print a line for each tolerance."""
    def run(tolerance):
        start = time.process_time()
        done = simulate(loaded.with_solve({"tolerance": tolerance}), error_estimate=False)
        return done, time.process_time() - start

    truth = run(TRUTH)[0]
    for tolerance in TOLERANCES:
        done, cpu = run(tolerance)
        channel, error = farthest(channel_errors(done.channels, truth.channels)[1])
        steps, state = done.statistics["steps"], "" if done.status == "done" else done.status
        cost = f"{name:22} {tolerance:7.0e} {steps:6} {cpu:8.3f}"
        print(f"{cost} {error or math.nan:9.1e}  {channel} {state}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="of the scenes; all without any")
    chosen = parser.parse_args()
    print(f"{'scene':22} {'tol':>7} {'steps':>6} {'CPU [s]':>8} {'error':>9}  channel")
    for name, loaded in scenes():
        if not chosen.names or name in chosen.names:
            table(name, loaded)


if __name__ == "__main__":
    main()
