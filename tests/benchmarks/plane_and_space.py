# ruff: noqa: E402
"""CPU of a `cable` pendulum in space over that in the plane: ``python tests/benchmarks/plane_and_space.py``.

The same beam at the same tolerance in the same minute: on a hinge in the plane of two ground axes, on a hinge
in an oblique plane, and on a ball joint.  Median of the ratios of alternating solves; no test.
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
    given = parser.parse_args()
    for coordinates in ("absolute", "frame"):
        for elements in map(int, given.elements.split(",")):
            texts = decks(elements, coordinates)
            rounds = [{name: solve(text) for name, text in texts.items()} for _ in range(given.repeats + 1)]
            cells = []
            for name in texts:
                ratio = median(one[name][0] / one["plane"][0] for one in rounds[1:])
                cells.append(f"{name} {ratio:.2f} ({rounds[0][name][1]} steps)")
            print(f"{coordinates}, {elements} elements: " + ", ".join(cells), flush=True)


if __name__ == "__main__":
    main()
