# ruff: noqa: E402
"""Run the paper's scenes in Exudyn: ``PYTHON exudyn_scenes.py SCENE BUDGET LIMIT REPEATS``.

Meant for a Python that has Exudyn, apart from hfsim's; `peers.py` calls it. Prints one JSON line for each
measured point: method, step, CPU seconds of each repeat of the solver call alone, path of the tip on the
output grid. The times are measured without output (beyond 1 s with it, as it costs next to nothing there).

``SCENE METHOD STEPS FILE`` runs a scene once and writes the path of the tip, as a script would:
`speed.py` calls it so.

Element ObjectANCFCable2D, four to a beam: engineering strain, exact curvature, 5 Gauss points axial, 3 for
bending.
"""

from __future__ import annotations

import json
import math
import sys
import time
from dataclasses import dataclass

sys.exudynFast = True  # type: ignore[attr-defined]  # read by the import: build without range checks

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items  # noqa: N813

ELEMENTS = 4
PIN_MASS = 1e12
"""Holds the root for explicit solvers, which cannot take constraints [kg]."""

HUB_RADIUS, HUB_INERTIA, HUB_STIFFNESS, HUB_ANGLE = 0.5, 10.0, 1000.0, 0.15


@dataclass(frozen=True)
class Beam:
    """Data of a beam, and how it starts: straight along x, turning about its root."""

    length: float
    density: float
    area: float
    second_moment: float
    modulus: float


@dataclass(frozen=True)
class Scenario:
    """One of the paper's scenes."""

    beam: Beam
    duration: float
    interval: float
    beams: int = 1
    rates: tuple[float, ...] = (0.0,)
    gravity: float = 0.0
    hub: bool = False
    explicit: bool = False


RUBBER = Beam(1.2, 5540.0, 1.8e-3, 1.215e-8, 7.0e5)
HARD = Beam(1.2, 5540.0, 1.8e-3, 1.215e-8, 7.0e10)
ALLOY = Beam(4.0, 2766.7, 4.0e-4, 1.33e-8, 6.8952e10)
SCENES = {
    "pendulum": Scenario(RUBBER, 1.0, 0.01, gravity=-9.81, explicit=True),
    "two_beams_relative": Scenario(ALLOY, 2.0, 0.01, beams=2, rates=(4.0, 8.0)),
    "hub_beams": Scenario(HARD, 5.0, 0.02, beams=2, rates=(0.0, 0.0), hub=True),
    "hub_beams_soft": Scenario(RUBBER, 2.0, 0.02, beams=2, rates=(0.0, 0.0), hub=True),
}

SOLVERS = {
    "trapezoidal": (exu.DynamicSolverType.TrapezoidalIndex2, (1e-8, 1e-10)),
    "trapezoidal, loose Newton": (exu.DynamicSolverType.TrapezoidalIndex2, (1e-5, 1e-6)),
    "generalized alpha": (exu.DynamicSolverType.GeneralizedAlpha, (1e-8, 1e-10)),
    "RK44": (exu.DynamicSolverType.RK44, None),
    "RK67": (exu.DynamicSolverType.RK67, None),
}
"""Name: solver, relative and absolute tolerance of Newton; explicit solvers have none."""


class Model:
    """A scene as Exudyn has it."""

    def __init__(self, scene: Scenario, explicit: bool) -> None:
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.scene = scene
        ground = self.mbs.AddNode(items.NodePointGround())
        self.ground = self.mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
        x, velocity = HUB_RADIUS if scene.hub else 0.0, 0.0
        tip = None
        for rate in scene.rates:
            nodes = self._beam(x, velocity, rate)
            if tip is not None:
                self._hinge(tip, nodes[0])
            elif scene.hub:
                self._hub(nodes[0])
            elif explicit:
                self._heavy(nodes[0])
            else:
                self._pin(nodes[0])
            tip, x, velocity = nodes[-1], x + scene.beam.length, velocity + rate * scene.beam.length
        self.tip = tip
        self.sensor = self.mbs.AddSensor(
            items.SensorNode(
                nodeNumber=tip,
                outputVariableType=exu.OutputVariableType.Position,
                writeToFile=False,
                storeInternal=True,
            )
        )
        self.mbs.Assemble()

    def _beam(self, x: float, velocity: float, rate: float) -> list[int]:
        """Add a beam with its root at x and return its nodes."""
        beam, nodes = self.scene.beam, []
        angle = HUB_ANGLE if self.scene.hub else 0.0
        for k in range(ELEMENTS + 1):
            s = k * beam.length / ELEMENTS
            turn_x, turn_y = math.cos(angle) - 1.0, math.sin(angle)
            nodes.append(
                self.mbs.AddNode(
                    items.Point2DS1(
                        referenceCoordinates=[x + s, 0.0, 1.0, 0.0],
                        initialCoordinates=[(x + s) * turn_x, (x + s) * turn_y, turn_x, turn_y],
                        initialVelocities=[0.0, velocity + rate * s, 0.0, rate],
                    )
                )
            )
        for k in range(ELEMENTS):
            element = self.mbs.AddObject(
                items.Cable2D(
                    physicsLength=beam.length / ELEMENTS,
                    physicsMassPerLength=beam.density * beam.area,
                    physicsBendingStiffness=beam.modulus * beam.second_moment,
                    physicsAxialStiffness=beam.modulus * beam.area,
                    nodeNumbers=[nodes[k], nodes[k + 1]],
                    useReducedOrderIntegration=0,
                )
            )
            if self.scene.gravity:
                marker = self.mbs.AddMarker(items.MarkerBodyMass(bodyNumber=element))
                self.mbs.AddLoad(
                    items.Gravity(markerNumber=marker, loadVector=[0.0, self.scene.gravity, 0.0])
                )
        return nodes

    def _coordinate(self, node: int, coordinate: int) -> int:
        return int(self.mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)))

    def _pin(self, node: int) -> None:
        """Hold the first two coordinates of a node."""
        for k in (0, 1):
            markers = [self.ground, self._coordinate(node, k)]
            self.mbs.AddObject(items.CoordinateConstraint(markerNumbers=markers))

    def _heavy(self, node: int) -> None:
        """Hold a node by its inertia."""
        self.mbs.AddObject(
            items.ObjectGenericODE2(
                nodeNumbers=[node],
                massMatrix=np.diag([PIN_MASS, PIN_MASS, 0.0, 0.0]),
                forceVector=np.zeros(4),
            )
        )

    def _hinge(self, first: int, second: int) -> None:
        for k in (0, 1):
            markers = [self._coordinate(first, k), self._coordinate(second, k)]
            self.mbs.AddObject(items.CoordinateConstraint(markerNumbers=markers))

    def _hub(self, root: int) -> None:
        """Add the hub on its spring and clamp the direction of the root's slope to it."""
        node = self.mbs.AddNode(items.NodeRigidBody2D(initialCoordinates=[0.0, 0.0, HUB_ANGLE]))
        body = self.mbs.AddObject(
            items.ObjectRigidBody2D(physicsMass=1.0, physicsInertia=HUB_INERTIA, nodeNumber=node)
        )
        self._pin(node)
        self.mbs.AddObject(
            items.CoordinateSpringDamper(
                markerNumbers=[self.ground, self._coordinate(node, 2)], stiffness=HUB_STIFFNESS
            )
        )
        rim = self.mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=body, localPosition=[HUB_RADIUS, 0.0, 0.0]))
        slope = self.mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=root))
        self.mbs.AddObject(items.GenericJoint(markerNumbers=[rim, slope], constrainedAxes=[1, 1, 0, 0, 0, 1]))

    def solve(self, method: str, steps: int, output: bool) -> float:
        """Integrate and return the CPU time of the call; negative if the solver fails."""
        solver, tolerances = SOLVERS[method]
        settings = exu.SimulationSettings()
        settings.parallel.numberOfThreads = 1
        settings.displayGlobalTimers = False
        settings.displayComputationTime = False
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.solutionInformation = ""
        settings.solutionSettings.sensorsWritePeriod = (
            self.scene.interval if output else 10.0 * self.scene.duration
        )
        integration = settings.timeIntegration
        integration.numberOfSteps = steps
        integration.endTime = self.scene.duration
        integration.automaticStepSize = False
        integration.adaptiveStep = False
        integration.verboseMode = 0
        if tolerances:
            integration.newton.relativeTolerance, integration.newton.absoluteTolerance = tolerances
            integration.newton.useModifiedNewton = True
            integration.newton.modifiedNewtonJacUpdatePerStep = False
        settings.linearSolverType = exu.LinearSolverType.EXUdense
        begin = time.process_time()
        try:
            good = self.mbs.SolveDynamic(settings, solverType=solver, showHints=False)
        except Exception:
            good = False
        return time.process_time() - begin if good is not False else -1.0

    def path(self) -> np.ndarray:
        """Return times and positions of the tip as stored, shape (n, 3)."""
        return np.asarray(self.mbs.GetSensorStoredData(self.sensor))[:, :3]


def on_grid(path: np.ndarray, scene: Scenario) -> list[list[float]] | None:
    """Return the positions at the output times; None if the run does not have them all."""
    times = scene.interval * np.arange(round(scene.duration / scene.interval) + 1)
    at = np.searchsorted(path[:, 0], times - 1e-6 * scene.interval)
    if at[-1] >= len(path) or np.abs(path[at, 0] - times).max() > 1e-6 * scene.interval:
        return None
    return np.asarray(path[at, 1:]).tolist()


def measure(name: str, budget: float, limit: float, repeats: int) -> None:
    """Halve the step of every method until a point takes longer than the limit or the budget is spent."""
    scene = SCENES[name]
    deadline = time.monotonic() + budget
    rows = round(scene.duration / scene.interval)
    divisions = dict.fromkeys((m for m in SOLVERS if SOLVERS[m][1] or scene.explicit), 1)
    failures = dict.fromkeys(divisions, 0)
    last = dict.fromkeys(divisions, 0.0)
    while divisions:
        method = min(divisions, key=lambda one: last[one])
        if time.monotonic() + 4.0 * last[method] > deadline:
            break
        steps, explicit = rows * divisions[method], SOLVERS[method][1] is None
        model = Model(scene, explicit)
        first = model.solve(method, steps, output=True)
        path = on_grid(model.path(), scene) if first >= 0.0 else None
        if path is None or not np.isfinite(path).all() or np.abs(path).max() > 100.0:
            failures[method] += 1
        else:
            times = [first] if first > 1.0 else []
            while len(times) < repeats and sum(times) < 1.0 and time.monotonic() < deadline:
                times.append(Model(scene, explicit).solve(method, steps, output=False))
            last[method] = max(first, 1e-4)
            times = [cpu for cpu in times if cpu >= 0.0] or [first]
            print(json.dumps({"method": method, "step": scene.duration / steps, "cpu": times, "tip": path}))
            sys.stdout.flush()
        divisions[method] *= 2
        if 2.0 * last[method] > limit or failures[method] > 6 or divisions[method] > 2**14:
            del divisions[method]


def run_once(name: str, method: str, steps: int, file: str) -> None:
    """Run a scene and write times and positions of the tip."""
    model = Model(SCENES[name], SOLVERS[method][1] is None)
    if model.solve(method, steps, output=True) < 0.0:
        raise SystemExit(f"{method} fails")
    np.savetxt(file, model.path(), delimiter=",")


if __name__ == "__main__" and sys.argv[2] in SOLVERS:
    run_once(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4])
elif __name__ == "__main__":
    measure(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4]))
