# ruff: noqa: I001
"""Measure hfsim and Exudyn on a planar beam with shear: ``python tests/benchmarks/peers_shear.py``.

As `peers_space.py`, but each code is held against its own converged trajectory: Exudyn's
ObjectBeamGeometricallyExact2D interpolates angles where hfsim interpolates section vectors. The error of each
mesh is the distance of that trajectory from that of four elements of degree 6. No test.
"""

from __future__ import annotations

import peers_space as peers  # first: it sets the number of threads

import time
from itertools import pairwise

import numpy as np

from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import samples_at
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck

NAME = "pendulum_with_shear"
DECK = peers.DECKS / f"{NAME}.yaml"
ELEMENTS, LENGTH, WIDTH, HEIGHT = 16, 0.8, 0.06, 0.03
DENSITY, MODULUS, SHEAR_MODULUS = 1000.0, 1.0e7, 1.0e7 / 2.6
FINEST = 25600
"""Steps of Exudyn's own converged trajectory."""
LEVELS = tuple(10.0**-k for k in range(3, 10))


def pendulum(mbs: object) -> int:
    """Add the beam, pinned at its root; return a sensor at its tip."""
    items, A, second = peers.items, WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12
    places = np.linspace(0.0, LENGTH, ELEMENTS + 1)
    nodes = [mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=[x, 0.0, 0.0])) for x in places]
    for ends in pairwise(nodes):
        beam = mbs.AddObject(
            items.ObjectBeamGeometricallyExact2D(
                nodeNumbers=list(ends),
                length=LENGTH / ELEMENTS,
                massPerLength=DENSITY * A,
                crossSectionInertia=DENSITY * second,
                bendingStiffness=MODULUS * second,
                axialStiffness=MODULUS * A,
                shearStiffness=5.0 / 6.0 * SHEAR_MODULUS * A,
            )
        )
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=beam))
        mbs.AddLoad(items.Gravity(markerNumber=marker, loadVector=[0.0, -9.81, 0.0]))
    node = mbs.AddNode(items.NodePointGround())
    ground = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    for k in range(2):
        held = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=k))
        mbs.AddObject(items.CoordinateConstraint(markerNumbers=[ground, held]))
    return mbs.AddSensor(
        items.SensorNode(
            nodeNumber=nodes[-1],
            outputVariableType=peers.exu.OutputVariableType.Position,
            writeToFile=False,
            storeInternal=True,
        )
    )


def solve_hfsim(mesh: list[str], tolerance: float) -> tuple[float, np.ndarray]:
    """Return CPU time of the solve call on a mesh and path of the tip."""
    loaded = load_deck(DECK, [*mesh, f"solve.tolerance={tolerance:g}"])
    scene = build(loaded)
    begin = time.process_time()
    done = run_integration(scene, loaded.deck.solve)
    cpu = time.process_time() - begin
    samples = samples_at(scene, done.trajectory, peers.times_of(NAME))
    return cpu, np.asarray(scene.marker("b.tip").position(samples.x))


def distance(path: np.ndarray, reference: np.ndarray) -> float:
    """Return the largest distance of two paths [m]."""
    return float(np.linalg.norm(path[:, :2] - reference[:, :2], axis=1).max())


def told(code: str, solves: list[peers.Solve], reference: np.ndarray, fine: np.ndarray) -> str:
    """Return a line of the table."""
    points = [(distance(path, reference), cpu) for cpu, path in map(peers.measured, solves)]
    row = (peers.least(points, level) for level in LEVELS)
    cells = " | ".join("-" if cpu is None else f"{cpu:.3f}" for cpu in row)
    return f"| {code} | {distance(reference, fine):.1e} | {cells} |"


def main() -> None:
    """Measure and print the table: errors of meshes [m], and CPU [s] by the error in time [m]."""
    peers.POINTS[NAME], peers.MODELS[NAME] = "b.tip", pendulum
    fine = solve_hfsim(mesh(4, 6), 1e-10)[1]
    print("| | mesh | " + " | ".join(f"{level:.0e}" for level in LEVELS) + " |")
    for elements, degree in ((ELEMENTS, 1), (4, 3)):
        own = mesh(elements, degree)
        solves = [lambda k=k, own=own: solve_hfsim(own, 10.0**-k) for k in range(2, 11)]
        name = f"hfsim, {elements} of degree {degree}"
        print(told(name, solves, solve_hfsim(own, 1e-12)[1], fine))
    if peers.exu:
        method, steps = "GeneralizedAlpha", [50 * 2**k for k in range(9)]
        solves = [lambda s=s: peers.solve_exudyn(NAME, method, s) for s in steps]
        print(told(f"Exudyn, {ELEMENTS}", solves, peers.solve_exudyn(NAME, method, FINEST)[1], fine))


def mesh(elements: int, degree: int) -> list[str]:
    """Return the changes of the deck that make a mesh."""
    return [f"bodies.b.elements={elements}", f"bodies.b.degree={degree}"]


if __name__ == "__main__":
    main()
