"""Time and memory of a step against the size of the scene.

    python tests/benchmarks/scaling.py [--space | --thin | --net]

Two families: the pendulum of one beam with 16 to 4096 elements, and a chain of 2 to 256 hinged beams of
two elements each; in space beams of both elements and a chain of rigid bodies on ball joints, or of slender
ones, and of flat ones with joints off their plane, and nets of bodies with a spring to each neighbour.
Model `exact`, methods gauss and gear at equal fixed steps.  Each step of a beam is scaled to the element
length, so that the same number of them asks the same of Newton's method.  CPU time, median of repeats; memory
by tracemalloc in a run of its own.
"""

from __future__ import annotations

import argparse
import json
import time
import tracemalloc
from collections.abc import Callable
from functools import partial

import numpy as np

from hfsim.marching.integration import run_integration
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

BEAM = """
hfsim: 1
name: pendulum
gravity: [0.0, -9.81]
materials: {{soft: {{density: 5540.0, youngs_modulus: 7.0e5}}}}
sections: {{strip: {{area: 1.8e-3, second_moment: 1.215e-8}}}}
bodies: {{b1: {{type: beam, material: soft, section: strip, length: 1.2, elements: {count}}}}}
joints: {{pin: {{type: revolute, between: [ground, b1.root]}}}}
solve: {{model: exact, duration: {duration}, method: {method}, step: {step}, stages: 8, order: 2}}
"""
CHAIN = """
hfsim: 1
name: chain
gravity: [0.0, -9.81]
materials: {{soft: {{density: 5540.0, youngs_modulus: 7.0e5}}}}
sections: {{strip: {{area: 1.8e-3, second_moment: 1.215e-8}}}}
bodies:
{bodies}
joints:
{joints}
solve: {{model: exact, duration: {duration}, method: {method}, step: {step}, stages: 8, order: 2}}
"""
SPACE = """
hfsim: 1
name: space
gravity: [0.0, 0.0, -9.81]
materials: {{soft: {{density: 5540.0, youngs_modulus: 7.0e5, poisson_ratio: 0.3}}}}
sections: {{round: {{shape: circle, diameter: 0.04}}}}
bodies:
  b1: {{type: beam, material: soft, section: round, length: 1.2, elements: {count}, element: {element}}}
joints: {{pin: {{type: spherical, between: [ground, b1.root]}}}}
solve: {{model: exact, duration: {duration}, method: {method}, step: {step}, stages: 8, order: 2}}
"""
LINKS = """
hfsim: 1
name: links
gravity: [0.0, 0.0, -9.81]
bodies:
{bodies}
joints:
{joints}
solve: {{duration: {duration}, method: {method}, step: {step}, stages: 8, order: 2}}
"""
NET = """
hfsim: 1
name: net
gravity: [0.0, 0.0, -9.81]
ground: {{points: {points}}}
bodies: {bodies}
springs: {springs}
initial: {initial}
solve: {{duration: {duration}, method: {method}, step: {step}, stages: 8, order: 2}}
"""
STEPS = 10


def beam(count: int, method: str) -> str:
    """Return the deck of the pendulum with `count` elements."""
    step = 4e-3 / count
    return BEAM.format(count=count, method=method, step=step, duration=STEPS * step)


def space(count: int, method: str, element: str) -> str:
    """Return the deck of a beam of `count` elements of a kind on a ball joint."""
    step = 4e-3 / count
    return SPACE.format(count=count, method=method, step=step, duration=STEPS * step, element=element)


def chain(
    count: int,
    method: str,
    deck: str = CHAIN,
    joint: str = "revolute",
    inertia: str = "[0.01, 0.02, 0.02]",
    beside: float = 0.0,
) -> str:
    """Return the deck of a chain of `count` beams, 0.3 m each, or of rigid bodies, joined end to end."""
    names = [f"b{k}" for k in range(count)]
    one = "{{type: beam, material: soft, section: strip, length: 0.3, elements: 2}}"
    if deck is LINKS:
        points = f"{{{{root: [-0.1, 0, {beside}], tip: [0.1, 0, {beside}]}}}}"
        one = f"{{{{type: rigid, mass: 1.0, inertia: {inertia}, points: {points}}}}}"
    ends = ["ground", *(f"{name}.tip" for name in names)]
    joints = [
        f"  j{k}: {{type: {joint}, between: [{ends[k]}, {name}.root]}}" for k, name in enumerate(names)
    ]
    text = deck.replace("{bodies}", "\n".join(f"  {name}: {one}" for name in names))
    text = text.replace("{joints}", "\n".join(joints).replace("{", "{{").replace("}", "}}"))
    step = 1e-3
    return text.format(method=method, step=step, duration=STEPS * step)


def net(count: int, method: str) -> str:
    """Return the deck of a square net of some `count` bodies on springs, held at its edges."""
    many = round(count**0.5) + 2
    place = {(i, j): [0.1 * i, 0.1 * j, 0.0] for i in range(many) for j in range(many)}
    names = {one: f"{'b' if all(0 < k < many - 1 for k in one) else 'p'}{one[0]}_{one[1]}" for one in place}
    inner = {name: place[one] for one, name in names.items() if name[0] == "b"}
    points = {name: place[one] for one, name in names.items() if name[0] == "p"}
    pairs = [(one, (one[0] + i, one[1] + 1 - i)) for one in place for i in (0, 1)]
    ends = [(names[one], names[other]) for one, other in pairs if other in place]
    tied = [
        [name if name in inner else f"ground.{name}" for name in pair] for pair in ends if {*pair} & {*inner}
    ]
    spring = {"type": "two_point", "stiffness": 100.0, "damping": 0.01, "rest_length": 0.09}
    body = {"type": "rigid", "mass": 0.01, "inertia": [1e-6] * 3}
    return NET.format(
        points=json.dumps(points),
        bodies=json.dumps(dict.fromkeys(inner, body)),
        springs=json.dumps({f"s{k}": {**spring, "between": one} for k, one in enumerate(tied)}),
        initial=json.dumps({name: {"position": one} for name, one in inner.items()}),
        method=method,
        step=1e-2,
        duration=STEPS * 1e-2,
    )


def measure(text: str, repeats: int) -> tuple[float, float, int, float]:
    """Return CPU time of a step and of building [s], unknowns, and the peak memory of the run [MB]."""
    kept = "stages: 8" if "method: gauss" in text else "order: 2"
    dropped = "stages: 8, " if kept == "order: 2" else ", order: 2"
    loaded = parse_deck(text.replace(dropped, ""))
    start = time.process_time()
    scene = build(loaded)
    building = time.process_time() - start
    times = []
    for _ in range(repeats):
        start = time.process_time()
        done = run_integration(scene, scene.deck.solve)
        times.append((time.process_time() - start) / done.problem.counts.steps)
        if done.stop is not None:
            raise SystemExit(f"{scene.deck.name}: {done.stop}")
    tracemalloc.start()
    run_integration(build(loaded), scene.deck.solve)
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return float(np.median(times)), building, scene.system.n, peak


FAMILIES: dict[str, Callable[[int, str], str]] = {
    "elements": beam,
    "bodies": chain,
    "cosserat": partial(space, element="cosserat"),
    "cable": partial(space, element="cable"),
    "links": partial(chain, deck=LINKS, joint="spherical"),
    "slender": partial(chain, deck=LINKS, joint="spherical", inertia="[2.0e-11, 0.02, 0.02]"),
    "net": net,
    "flat": partial(chain, deck=LINKS, joint="spherical", inertia="[0.01, 0.01, 0.02]", beside=0.01),
}
"""Decks by number and method."""


def table(family: str, counts: list[int], method: str, repeats: int, slope_from: int) -> None:
    """Print one family with one method, and the slopes of time and memory."""
    titles = f"{'count':>6} {'unknowns':>9} {'ms a step':>10} {'build s':>8} {'memory MB':>10}"
    print(f"\n{family}, {method}: {titles}")
    rows = []
    for count in counts:
        text = FAMILIES[family](count, method)
        step, building, unknowns, peak = measure(text, repeats)
        rows.append((count, step, peak))
        row = f"{count:>6} {unknowns:>9} {1e3 * step:>10.2f} {building:>8.2f} {peak:>10.1f}"
        print(" " * (len(family) + len(method) + 4) + row, flush=True)
    used = np.log([row for row in rows if row[0] >= slope_from])
    if len(used) > 1:
        slopes = [np.polyfit(used[:, 0], used[:, k], 1)[0] for k in (1, 2)]
        print(f"slope from {slope_from} on: time {slopes[0]:.2f}, memory {slopes[1]:.2f}")


def main() -> None:
    """Measure both families with both methods."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--elements", default="16,64,256,1024,4096")
    parser.add_argument("--bodies", default="2,4,16,64,256")
    parser.add_argument("--methods", default="gauss,gear")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--space", action="store_true", help="beams and bodies in space, 64 to 1024")
    parser.add_argument("--thin", action="store_true", help="slender and flat bodies beside others")
    parser.add_argument("--net", action="store_true", help="nets of springs")
    given = parser.parse_args()
    for method in given.methods.split(","):
        for family in ("cosserat", "cable", "links") if given.space else ():
            table(family, [64, 256, 1024], method, given.repeats, 64)
        for family in ("links", "slender", "flat") if given.thin else ():
            table(family, [20, 64], method, given.repeats, 20)
        if given.net:
            table("net", [25, 100, 400], method, given.repeats, 25)
        if given.space or given.thin or given.net:
            continue
        table("elements", [int(n) for n in given.elements.split(",")], method, given.repeats, 64)
        table("bodies", [int(n) for n in given.bodies.split(",")], method, given.repeats, 16)


if __name__ == "__main__":
    main()
