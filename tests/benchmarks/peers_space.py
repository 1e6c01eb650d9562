# ruff: noqa: E402
"""Measure hfsim and Exudyn side by side in space: ``python tests/benchmarks/peers_space.py [SCENE...]``.

As `peers.py`: CPU time of the solve call alone, one thread, median of three; the error is the largest
distance of the last point from the converged trajectory of the same equations, hfsim's at a far tighter
tolerance. Beams with sections are not the same elements in both: there each is held against its own
converged trajectory, Exudyn against that with the shortest steps. In a Python that has no Exudyn only hfsim
is measured. No test.
"""

from __future__ import annotations

import os  # first: the libraries read these names when they are imported

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.exudynFast = True  # type: ignore[attr-defined]  # read by the import: build without range checks

import numpy as np

from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import samples_at
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck

try:
    import exudyn as exu
    from exudyn import itemInterface as items  # noqa: N813
    from exudyn.rigidBodyUtilities import RigidBodyInertia, RotationMatrixZ
except ImportError:
    exu = None

DECKS = Path(__file__).parent / "decks"
CASES = Path(__file__).resolve().parents[2] / "cases"
POINTS = {"chain_of_five": "b5.b", "pendulum_in_space": "b1.tip", "right_angle": "second.tip"}
CHANGES = {"right_angle": ["solve.duration=4"]}
OWN_ELEMENT = {"right_angle"}
"""Scenes whose elements are others in Exudyn."""
WAYS = {"hfsim": False, "hfsim again": True}
"""What hfsim is called, and whether it has solved the scene before: then nothing is to be recorded."""
LEVELS = tuple(10.0**-k for k in range(2, 11))
LONGEST = 10.0
"""CPU time that a point may take [s]."""
HALF = np.array([0.5, 0.0, 0.0])
"""From the middle of a link to its end [m]."""
Solve = Callable[[], tuple[float, "np.ndarray | None"]]


def solve_hfsim(name: str, tolerance: float, again: bool = False) -> tuple[float, np.ndarray | None]:
    """Return CPU time of the solve call and path of the last point."""
    settings = [f"solve.tolerance={tolerance:g}", "solve.method=auto", *CHANGES.get(name, [])]
    loaded = load_deck(file_of(name), settings)
    scene = build(loaded)
    if again:
        run_integration(scene, loaded.deck.solve)
    begin = time.process_time()
    done = run_integration(scene, loaded.deck.solve)
    cpu = time.process_time() - begin
    if done.stop is not None:
        return cpu, None
    samples = samples_at(scene, done.trajectory, times_of(name))
    return cpu, np.asarray(scene.marker(POINTS[name]).position(samples.x))


def file_of(name: str) -> Path:
    """Return the deck of a scene: one of its own, or a shipped case."""
    own = DECKS / f"{name}.yaml"
    return own if own.exists() else CASES / f"{name}.yaml"


def times_of(name: str) -> np.ndarray:
    """Return the output times."""
    deck = load_deck(file_of(name), CHANGES.get(name, [])).deck
    return deck.interval * np.arange(round(deck.solve.duration / deck.interval) + 1)


def chain(mbs: object) -> int:
    """Add five bodies on spherical joints; return a sensor at the last end."""
    spins = ((1.0, 0.0, 0.5), (-2.0, 0.0, 0.5), (3.0, 0.0, 0.5), (-1.0, 0.0, 0.5), (2.0, 0.0, 0.5))
    before, place = mbs.CreateGround(), np.zeros(3)
    velocity = np.zeros(3)
    for spin in spins:
        turning = np.cross(spin, HALF)
        body = mbs.CreateRigidBody(
            inertia=RigidBodyInertia(1.0, np.diag([0.02, 0.09, 0.1])),
            referencePosition=list(place + HALF),
            initialVelocity=list(velocity + turning),
            initialAngularVelocity=list(spin),
            gravity=[0.0, 0.0, -9.81],
        )
        mbs.CreateSphericalJoint(itemNumbers=[before, body], position=list(place), show=False)
        before, place, velocity = body, place + 2.0 * HALF, velocity + 2.0 * turning
    return mbs.AddSensor(
        items.SensorBody(
            bodyNumber=before,
            localPosition=[0.5, 0.0, 0.0],
            outputVariableType=exu.OutputVariableType.Position,
            writeToFile=False,
            storeInternal=True,
        )
    )


def pendulum(mbs: object) -> int:
    """Add four cable elements pinned at the root; return a sensor at the tip."""
    nodes = []
    for k in range(5):
        x = 0.3 * k
        nodes.append(
            mbs.AddNode(
                items.NodePointSlope1(
                    referenceCoordinates=[x, 0.0, 0.0, 1.0, 0.0, 0.0],
                    initialVelocities=[0.0, 3.0 * x, 0.0, 0.0, 3.0, 0.0],
                )
            )
        )
    for first, last in pairwise(nodes):
        cable = mbs.AddObject(
            items.ObjectANCFCable(
                length=0.3,
                massPerLength=5540.0 * 0.0018,
                bendingStiffness=7.0e5 * 1.215e-8,
                axialStiffness=7.0e5 * 0.0018,
                nodeNumbers=[first, last],
                useReducedOrderIntegration=0,
            )
        )
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=cable))
        mbs.AddLoad(items.Gravity(markerNumber=marker, loadVector=[0.0, 0.0, -9.81]))
    ground = mbs.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(items.NodePointGround()), coordinate=0)
    )
    for k in range(3):
        held = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=k))
        mbs.AddObject(items.CoordinateConstraint(markerNumbers=[ground, held]))
    return mbs.AddSensor(
        items.SensorNode(
            nodeNumber=nodes[-1],
            outputVariableType=exu.OutputVariableType.Position,
            writeToFile=False,
            storeInternal=True,
        )
    )


def right_angle(mbs: object) -> int:
    """Add two legs of ten geometrically exact elements, as many intervals as hfsim has; return a sensor."""
    section = exu.BeamSection()
    section.massPerLength, section.inertia = 1.0, np.diag([20.0, 10.0, 10.0])
    section.stiffnessMatrix = np.diag([1e6, 1e6, 1e6, 1e3, 1e3, 1e3])
    ends, quarter = [], RotationMatrixZ(np.pi / 2)
    for start, along, angle in (([0, 0, 0], [0, 1, 0], np.pi / 2), ([0, 10, 0], [-1, 0, 0], np.pi)):
        places = [list(np.array(start) + k * np.array(along)) for k in range(11)]
        nodes = [
            mbs.AddNode(items.NodeRigidBodyRotVecLG(referenceCoordinates=[*place, 0.0, 0.0, angle]))
            for place in places
        ]
        for pair in pairwise(nodes):
            mbs.AddObject(
                items.ObjectBeamGeometricallyExact(nodeNumbers=list(pair), length=1.0, sectionData=section)
            )
        ends.append((nodes[0], nodes[-1]))
    ground = mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=mbs.AddObject(items.ObjectGround())))
    root, elbow, second = (
        mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=node)) for node in (*ends[0], ends[1][0])
    )
    for held in ([ground, root], [elbow, second]):
        mbs.AddObject(items.GenericJoint(markerNumbers=held, rotationMarker0=quarter))
    mbs.AddLoad(
        items.Force(
            markerNumber=mbs.AddMarker(items.MarkerNodePosition(nodeNumber=ends[0][1])),
            loadVector=[0.0, 0.0, 50.0],
            loadVectorUserFunction=lambda _, t, full: [0.0, 0.0, full[2] * max(0.0, min(t, 2.0 - t))],
        )
    )
    return mbs.AddSensor(
        items.SensorNode(
            nodeNumber=ends[1][1],
            outputVariableType=exu.OutputVariableType.Position,
            writeToFile=False,
            storeInternal=True,
        )
    )


MODELS = {"chain_of_five": chain, "pendulum_in_space": pendulum, "right_angle": right_angle}


def solve_exudyn(name: str, method: str, steps: int) -> tuple[float, np.ndarray | None]:
    """Return CPU time of Exudyn's solver call, with output on the grid, and path of the last point."""
    times = times_of(name)
    mbs = exu.SystemContainer().AddSystem()
    sensor = MODELS[name](mbs)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.parallel.numberOfThreads = 1
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.solutionInformation = ""
    settings.solutionSettings.sensorsWritePeriod = times[1]
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = steps, times[-1]
    integration.automaticStepSize = integration.adaptiveStep = False
    integration.verboseMode = 0
    # beams with sections do not converge to the tighter tolerances at short steps
    newton = (1e-7, 1e-7) if name in OWN_ELEMENT else (1e-8, 1e-10)
    integration.newton.relativeTolerance, integration.newton.absoluteTolerance = newton
    integration.newton.useModifiedNewton = True
    integration.newton.modifiedNewtonJacUpdatePerStep = False
    settings.linearSolverType = exu.LinearSolverType.EXUdense
    begin = time.process_time()
    try:
        good = mbs.SolveDynamic(settings, solverType=getattr(exu.DynamicSolverType, method), showHints=False)
    except Exception:
        good = False
    cpu = time.process_time() - begin
    path = np.asarray(mbs.GetSensorStoredData(sensor)) if good is not False else np.zeros((0, 4))
    at = np.searchsorted(path[:, 0], times - 1e-6 * times[1])
    return cpu, path[at, 1:] if len(path) and at[-1] < len(path) else None


def measured(solve: Solve) -> tuple[float, np.ndarray | None]:
    """Return the median CPU time of three, of one where that takes long, and the path."""
    cpu, path = solve()
    more = [solve()[0] for _ in range(2)] if cpu < 1.0 and path is not None else []
    return median([cpu, *more]), path


def least(points: list[tuple[float, float]], level: float) -> float | None:
    """Return the least CPU time with which an error is kept, of (error, CPU) points measured."""
    return min((cpu for error, cpu in points if error <= level), default=None)


def compare(name: str) -> None:
    """Measure a scene and print its table."""
    reference = solve_hfsim(name, 1e-10 if name in OWN_ELEMENT else 1e-13)[1]
    runs: dict[str, list[tuple[float, np.ndarray]]] = {code: [] for code in (*WAYS, "Exudyn")}

    def add(code: str, solve: Solve) -> float:
        """Measure a point; return its CPU time, infinite where it fails though others have not."""
        cpu, path = measured(solve)
        if path is None or not np.isfinite(path).all():
            return np.inf if runs[code] else 0.0
        runs[code].append((cpu, path))
        return cpu

    for code, again in WAYS.items():
        cpu = 0.0
        for k in range(1, 12):
            if 4.0 * cpu < LONGEST:
                cpu = add(code, lambda k=k, again=again: solve_hfsim(name, 10.0**-k, again))
    for method in ("TrapezoidalIndex2", "GeneralizedAlpha") if exu else ():
        steps, cpu = len(times_of(name)) - 1, 0.0
        while 2.0 * cpu < LONGEST:
            cpu = add("Exudyn", lambda steps=steps, method=method: solve_exudyn(name, method, steps))
            steps *= 2
    exact = dict.fromkeys(runs, reference)
    if name in OWN_ELEMENT and runs["Exudyn"]:
        # the costliest run has the shortest steps
        exact["Exudyn"] = runs["Exudyn"].pop(int(np.argmax([cpu for cpu, _ in runs["Exudyn"]])))[1]
    points = {
        code: [(float(np.linalg.norm(path - exact[code], axis=1).max()), cpu) for cpu, path in own]
        for code, own in runs.items()
    }
    print(f"\n### {name}\n")
    print("| error [m] |", *(f"{code} [s] |" for code in runs), *(f"Exudyn / {code} |" for code in WAYS))
    print("|---" * (len(runs) + len(WAYS) + 1) + "|")
    for level in LEVELS:
        cpus = [least(points[code], level) for code in runs]
        ratios = [cpus[-1] / own if own and cpus[-1] else None for own in cpus[:-1]]
        cells = [*(one and f"{one:.3g}" for one in cpus), *(one and f"{one:.2g}" for one in ratios)]
        print(f"| {level:.0e} |", *(f"{one or '-'} |" for one in cells))


if __name__ == "__main__":
    if exu is None:
        print("Exudyn left out: this Python cannot import it")
    print("CPU time of the solve call, the cheapest point measured that keeps the error.")
    for one in sys.argv[1:] or POINTS:
        compare(one)
