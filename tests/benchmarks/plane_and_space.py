# ruff: noqa: E402
"""CPU of a `cable` pendulum in space over that in the plane.

    python tests/benchmarks/plane_and_space.py [--stiff]

The same beam at the same tolerance in the same minute: on a hinge in the plane of two ground axes, on a hinge
in an oblique plane, and on a ball joint.  Or a stiff one: a steel `continuum` arm on a hub that is spun up.
Median of the ratios of alternating solves; no test.
"""

from __future__ import annotations

import os  # first: the libraries read these names when they are imported

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
import yaml

from hfsim.marching.integration import run_integration
from hfsim.maths.rotations import rotation
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from tests.posed import in_space

PENDULUM = """
hfsim: 1
name: pendulum
gravity: [0.0, -9.81]
ground: {points: {pivot: [0.0, 0.0]}}
materials: {soft: {density: 5540.0, youngs_modulus: 7.0e5}}
sections: {strip: {area: 1.8e-3, second_moment: 1.215e-8}}
bodies: {b1: {type: beam, element: cable, material: soft, section: strip, length: 1.2, elements: 4}}
joints: {pin: {type: revolute, between: [ground.pivot, b1.root]}}
initial: {b1: {angle: 0.0}}
solve: {model: exact, duration: 1.0}
"""
ARM = """
hfsim: 1
name: arm
gravity: [0.0, -9.81]
ground: {points: {pivot: [0.0, 0.0]}}
materials: {steel: {density: 7850.0, youngs_modulus: 2.1e11, poisson_ratio: 0.3}}
sections: {bar: {shape: rectangle, width: 0.01, height: 0.01}}
bodies:
  hub: {type: rigid, mass: 5.0, inertia: 0.05, points: {rim: [0.1, 0.0]}}
  b1: {type: beam, element: continuum, material: steel, section: bar, length: 1.0, elements: 2}
joints:
  axle: {type: driver, between: [ground.pivot, hub], angle: {type: spin_up, rate: 6.0, time: 0.5}}
  mount: {type: fixed, between: [hub.rim, b1.root]}
solve: {model: exact, duration: 0.4, tolerance: 1.0e-5}
"""
OBLIQUE = rotation(np.array([0.4, -0.7, 1.1]))


def decks(elements: int, coordinates: str) -> dict[str, str]:
    """Return the decks by name, that of the plane first."""
    plane = yaml.safe_load(PENDULUM)
    plane["bodies"]["b1"]["elements"] = elements
    plane["solve"]["coordinates"] = coordinates
    found: dict[str, Any] = {"plane": plane}
    for name, R in (("hinge", np.eye(3)), ("oblique hinge", OBLIQUE), ("ball", np.eye(3))):
        found[name] = in_space(plane, R, np.zeros(3))
    pin = found["ball"]["joints"]["pin"]
    found["ball"]["joints"]["pin"] = {"type": "spherical", "between": pin["between"]}
    return {name: yaml.safe_dump(deck) for name, deck in found.items()}


def stiff(elements: int) -> dict[str, str]:
    """Return the decks of the stiff arm by name, that of the plane first."""
    plane = yaml.safe_load(ARM)
    plane["bodies"]["b1"]["elements"] = elements
    space = yaml.safe_load(ARM)
    space["gravity"], space["ground"]["points"]["pivot"] = [0.0, -9.81, 0.0], [0.0, 0.0, 0.0]
    space["bodies"] = plane["bodies"] | {
        "hub": {"type": "rigid", "mass": 5.0, "inertia": [0.05] * 3, "points": {"rim": [0.1, 0.0, 0.0]}}
    }
    space["joints"]["axle"]["axis"] = [0, 0, 1]
    return {name: yaml.safe_dump(deck) for name, deck in (("plane", plane), ("space", space))}


def compare(label: str, texts: dict[str, str], repeats: int) -> None:
    """Print one line: ratios to the first deck, and steps."""
    rounds = [{name: solve(text) for name, text in texts.items()} for _ in range(repeats + 1)]
    cells = []
    for name in texts:
        ratio = median(one[name][0] / one["plane"][0] for one in rounds[1:])
        cells.append(f"{name} {ratio:.2f} ({rounds[0][name][1]} steps)")
    print(f"{label}: " + ", ".join(cells), flush=True)


def solve(text: str) -> tuple[float, int]:
    """Return CPU of the solve [s] and the number of steps."""
    scene = build(parse_deck(text))
    begin = time.process_time()
    done = run_integration(scene, scene.deck.solve)
    return time.process_time() - begin, done.problem.counts.steps


def main() -> None:
    """Print one line for each number of elements and kind of coordinates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--elements", default="2,4,8")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--stiff", action="store_true", help="a stiff arm on a hub instead")
    given = parser.parse_args()
    if given.stiff:
        for elements in map(int, given.elements.split(",")):
            compare(f"stiff, {elements} elements", stiff(elements), given.repeats)
        return
    for coordinates in ("absolute", "frame"):
        for elements in map(int, given.elements.split(",")):
            label, texts = f"{coordinates}, {elements} elements", decks(elements, coordinates)
            compare(label, texts, given.repeats)


if __name__ == "__main__":
    main()
