"""Everything that is registered goes all the way: check, plan, run, pictures, diagnosis, limits.

What is newly registered needs one example in `EXAMPLES`; nothing else here knows any name.  That one file
and one name are enough is shown at the end, by one more of several kinds.
"""

import json
import sys
from copy import deepcopy
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Literal

import click
import numpy as np
import pytest
import yaml
from called import call

from hfsim.cli import COMMANDS
from hfsim.deck.fields import Between
from hfsim.deck.law_specs import LAWS
from hfsim.errors import SolverFailure
from hfsim.integrators import METHODS, Attempt, Integrator, Stability, Stepper
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Budget
from hfsim.maths.frozen import frozen
from hfsim.mechanics.constraints import Shift
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker, joint_support
from hfsim.parts.bodies.models import MODELS
from hfsim.parts.channels import CHANNELS
from hfsim.parts.elements import ELEMENTS, Continuum
from hfsim.parts.forces import LOADS, SPRINGS
from hfsim.parts.joints import JOINTS
from hfsim.parts.specs import JointSpec, SpringSpec
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.scene.rules import RULES
from hfsim.studies.methods import candidates
from hfsim.trust.diagnosis import diagnose

SCENE = {
    "hfsim": 1,
    "name": "example",
    "gravity": [0.0, -9.81],
    "materials": {"rubber": {"density": 1100.0, "youngs_modulus": 5.0e6}},
    "sections": {"bar": {"shape": "rectangle", "width": 0.02, "height": 0.02}},
    "bodies": {
        "hub": {"type": "rigid", "mass": 1.0, "inertia": 0.1, "points": {"rim": [0.5, 0.0]}},
        "arm": {"type": "beam", "material": "rubber", "section": "bar", "length": 1.0, "elements": 1},
    },
    "joints": {
        "pin": {"type": "revolute", "between": ["ground", "hub"]},
        "elbow": {"type": "revolute", "between": ["hub.rim", "arm.root"]},
    },
    "solve": {"duration": 0.01, "tolerance": 1.0e-3},
    "output": {"interval": 0.005, "channels": ["arm.tip.x"]},
}
"""A rigid hub that turns about the ground, and an arm on it; each example changes a little of it."""

SPACE = {
    **SCENE,
    "gravity": [0.0, 0.0, -9.81],
    "bodies": {
        "hub": {"type": "rigid", "mass": 1.0, "inertia": [0.1, 0.2, 0.2], "points": {"rim": [0.5, 0, 0]}},
        "arm": {"type": "rigid", "mass": 1.0, "inertia": [0.1, 0.2, 0.2], "points": {"root": [-0.5, 0, 0]}},
    },
    "joints": {"pin": {"type": "revolute", "between": ["ground", "hub"], "axis": [0, 1, 0]}},
    "output": {"interval": 0.005, "channels": ["arm.x"]},
}
"""Two rigid bodies in space, for what only space has."""

ELBOW, TO_ARM, AT_TIP = ["hub.rim", "arm.root"], ["ground", "arm.tip"], {"at": "arm.tip"}
EXAMPLES = {
    "joint": {
        "revolute": {"elbow": {"between": ELBOW}},
        "fixed": {"elbow": {"between": ELBOW, "angle": 0.1}},
        "prismatic": {"elbow": {"between": ELBOW, "axis": [1.0, 0.5]}},
        "spherical": {"elbow": {"between": ELBOW}},
        "universal": {"elbow": {"between": ELBOW, "axes": [[1, 0, 0], [0, 1, 0]]}},
        "cylindrical": {"elbow": {"between": ELBOW, "axis": [1, 0, 0]}},
        "driver": {"motor": {"between": ELBOW, "angle": {"type": "constant_rate", "rate": 1.0}}},
        "motion": {"elbow": {"between": ELBOW, "y": {"type": "sine", "amplitude": 0.1, "frequency": 1.0}}},
        "gear": {"mesh": {"between": ["ground", "wheel"], "carrier": "hub", "ratio": 2.0}},
        "motor": {"motor": {"between": ELBOW, "torque": 0.1}},
        "servo": {"motor": {"between": ELBOW, "angle": 0.3, "stiffness": 2.0, "damping": 0.1, "limit": 1.0}},
    },
    "spring": {
        "rotational": {"between": ["ground", "hub"], "stiffness": 3.0, "damping": 0.1},
        "two_point": {"between": TO_ARM, "stiffness": 3.0, "damping": 0.1},
        "bushing": {"between": TO_ARM, "stiffness": 3.0, "release": {"time": 0.01}},
        "contact": {"between": TO_ARM, "stiffness": 3.0, "friction": {"coefficient": 0.3}},
        "coupling": {"of": {"pin": 1.0, "elbow": -2.0}, "stiffness": 3.0, "damping": 0.1},
    },
    "load": {
        "force": AT_TIP | {"force": [0.1, 0.2]},
        "moment": AT_TIP | {"moment": 0.1},
        "drag": AT_TIP | {"density": 1.2, "coefficient": 1.0, "area": 0.1},
        "distributed": {"on": "arm", "force": [0.1, 0.2], "shape": [[0.1, 1], [0.2, 2]], "follower": True},
    },
    "law": {
        "constant": {"value": 0.5},
        "constant_rate": {"rate": 0.5},
        "table": {"times": [0.0, 0.004, 0.02], "values": [0.0, 0.1, 0.1]},
        "smooth_step": {"from": 0.0, "to": 0.1, "start": 0.0, "end": 0.005},
        "spin_up": {"rate": 1.0, "time": 0.005},
        "sine": {"amplitude": 0.1, "frequency": 5.0},
        "expression": {"expression": "0.1 * t * exp(-t)"},
    },
    "element": {"cable": {"degree": 4, "strain": "engineering", "curvature": "exact"}, "continuum": {}},
    "integrator": {
        "gauss": {"stages": 3},
        "radau": {"stages": 2},
        "energy": {"stages": 1},
        "gear": {"order": 2},
        "generalized_alpha": {"rho_inf": 0.5},
        "explicit": {},
    },
    "channel": {
        **{name: f"arm.tip.{name}" for name in ("x", "y", "vx", "vy", "speed", "ax", "ay")},
        **{name: f"arm.tip.{name}" for name in ("acceleration", "deflection", "elongation")},
        **{name: f"arm.root.{name}" for name in ("axial_force", "shear_force", "bending_moment", "stress")},
        **{name: f"hub.{name}" for name in ("angle", "angular_velocity", "angular_acceleration")},
        **{name: f"energy.{name}" for name in ("kinetic", "strain", "potential", "total")},
        **{name: f"momentum.{name}" for name in ("linear_x", "linear_y", "angular")},
        **{name: f"constraint.{name}" for name in ("position", "velocity")},
        **{name: f"pin.{name}" for name in ("force_x", "force_y", "moment", "torque", "power")},
        **{name: f"stay.{name}" for name in ("distance", "distance_rate", "force")},
    },
}
"""For each kind and name, what a deck says besides the name; of models and rules it says no more."""

REGISTERED = {
    "joint": JOINTS,
    "spring": SPRINGS,
    "load": LOADS,
    "law": LAWS,
    "element": ELEMENTS,
    "model": MODELS,
    "integrator": METHODS,
    "channel": [name for name, kinds in CHANNELS.items() if any(2 in kind.dimensions for kind in kinds)],
    "rule": RULES,
}
NEVER_DRAWN = ("law", "integrator", "rule")


def scene_with(kind, name, example):
    """Return the deck that shows one thing."""
    space = kind == "joint" and name in ("spherical", "universal", "cylindrical")
    deck = deepcopy(SPACE if space else SCENE)
    if kind == "joint":
        if name == "gear":
            deck["bodies"]["wheel"] = {"type": "rigid", "mass": 1.0, "inertia": 0.1}
        deck["joints"] |= {label: {"type": name, **entry} for label, entry in example.items()}
        deck["output"]["channels"] += [f"{label}.moment{'_y' * space}" for label in example]
    elif kind in ("spring", "load"):
        deck[f"{kind}s"] = {"shown": {"type": name, **example}}
    elif kind == "law":
        law = {"type": name, **example}
        deck["joints"]["motor"] = {"type": "driver", "between": ELBOW, "angle": law}
        deck["loads"] = {"shown": {"type": "moment", "at": "hub", "moment": 0.1, "law": law}}
    elif kind == "element":
        deck["bodies"]["arm"] |= {"element": name, **example}
    elif kind == "model":
        deck["bodies"]["arm"]["model"] = name
    elif kind == "integrator":
        deck["solve"] |= {"method": name, **example}
    elif kind == "rule":
        deck["solve"]["keep"] = [name]
    return yaml.safe_dump(deck)


def hfsim(*arguments):
    done = call(*arguments)
    assert done.exit_code == 0, f"hfsim {' '.join(map(str, arguments))}\n{done.output}"
    return done.output


def goes_all_the_way(text, folder, pictures=True):
    """Take a deck through check, plan, run and diagnosis; return the folder of its results."""
    deck, results = folder / "example.yaml", folder / "out"
    deck.write_text(text)
    hfsim("check", deck)
    hfsim("plan", deck)
    hfsim("run", deck, "-o", results, *(() if pictures else ("--no-plots",)))
    summary = json.loads(next(results.rglob("summary.json")).read_text())
    assert summary["status"] == "done"
    assert not pictures or list(results.rglob("*.png"))
    scene = build(parse_deck(text))
    done = run_integration(scene, scene.deck.solve)
    failed = done._replace(stop=SolverFailure("made to fail", done.trajectory.t_end))
    assert diagnose(scene, failed, Budget(0.02)).remedy
    return results


CASES = [(kind, name) for kind, names in REGISTERED.items() if kind != "channel" for name in names]


@pytest.mark.parametrize(("kind", "name"), CASES, ids=[f"{kind} {name}" for kind, name in CASES])
def test_all_that_is_registered_goes_all_the_way(kind, name, tmp_path):
    examples = EXAMPLES.get(kind, {name: {}})
    assert name in examples, f"say in EXAMPLES of {__file__} how a deck names the {kind} '{name}'"
    goes_all_the_way(scene_with(kind, name, examples[name]), tmp_path, kind not in NEVER_DRAWN)


@pytest.fixture(scope="module")
def channels(tmp_path_factory):
    """Names and values of what is written of a scene with all channels."""
    deck = deepcopy(SCENE)
    deck["springs"] = {"stay": {"type": "two_point", "between": ["ground", "arm.tip"], "stiffness": 1.0}}
    deck["output"]["channels"] = list(EXAMPLES["channel"].values())
    results = goes_all_the_way(yaml.safe_dump(deck), tmp_path_factory.mktemp("channels"))
    names, *rows = (line.split(",") for line in (results / "history.csv").read_text().splitlines())
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


@pytest.mark.parametrize("name", REGISTERED["channel"])
def test_every_channel_goes_all_the_way(channels, name):
    assert name in EXAMPLES["channel"], f"say in EXAMPLES of {__file__} how a deck names the channel '{name}'"
    values = channels[EXAMPLES["channel"][name]]
    assert len(values) > 1 and np.isfinite(values).all()


@pytest.mark.parametrize("kind", EXAMPLES)
def test_examples_are_of_what_is_registered(kind):
    assert set(EXAMPLES[kind]) <= set(REGISTERED[kind])


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_says_how_it_is_used(command):
    assert f" {command} [OPTIONS]" in hfsim(command, "--help")


def test_the_limits_of_every_integrator_are_measured(tmp_path):
    deck = tmp_path / "example.yaml"
    deck.write_text(yaml.safe_dump(SCENE))
    methods = ",".join(METHODS)
    told = hfsim(
        *("stability", deck, "--limits", "--models", "linear", "--methods", methods, "--budget", "4s"),
        *("--limit", "0.3s", "--no-plots", "-o", tmp_path / "out"),
    )
    for name in METHODS:
        assert name in told
    assert "crash" not in told and "Error" not in told


# One file and one name ---------------------------------------------------------------------------------


class ScissorsSpec(JointSpec):
    """A joint of one's own: point B stays on a line through A that is fixed to A's body."""

    type: Literal["scissors"]
    between: Between

    def held(self):
        return (Shift((0.0, 1.0)),)


class CubicSpec(SpringSpec):
    """A spring of one's own: a force towards A that grows with the cube of the distance."""

    type: Literal["cubic"]
    between: Between
    stiffness: float
    damping: float = 0.0

    def build(self, first, second, start):
        return CubicSpring(first, second, self.stiffness)


@frozen
class CubicSpring(ForcePart):
    """k d^3 along the line between two points."""

    first: Marker
    second: Marker
    stiffness: float

    @property
    def markers(self):
        return self.first, self.second

    @property
    def support(self):
        return joint_support(self.first, self.second)

    def add_force(self, t, x, u, out):
        gap = self.second.position(x) - self.first.position(x)
        force = self.stiffness * np.sum(gap**2, axis=-1, keepdims=True) * gap
        for sign, marker in ((1.0, self.first), (-1.0, self.second)):
            out[:, marker.columns] += sign * np.einsum("...i,...ij", force, marker.position_jacobian(x))

    def potential_energy(self, t, x):
        gap = self.second.position(x) - self.first.position(x)
        return 0.25 * self.stiffness * np.sum(gap**2, axis=-1) ** 2


class Sandwich(Continuum):
    """An element of one's own: two thirds of the mass lie in the faces."""

    def mass(self, properties, count=1, start=0.0):
        return super().mass(properties._replace(height=1.5 * properties.height), count, start)


@pytest.mark.parametrize(
    ("registry", "kind", "name", "entry", "example"),
    [
        (JOINTS, "joint", "scissors", ScissorsSpec, {"elbow": {"between": ELBOW}}),
        (SPRINGS, "spring", "cubic", CubicSpec, {"between": TO_ARM, "stiffness": 5.0}),
        (ELEMENTS, "element", "sandwich", Sandwich, {}),
    ],
    ids=("joint", "spring", "element"),
)
def test_one_of_your_own_takes_one_file_and_one_name(
    registry, kind, name, entry, example, tmp_path, monkeypatch
):
    monkeypatch.setitem(registry, name, entry)
    goes_all_the_way(scene_with(kind, name, example), tmp_path)


@dataclass(frozen=True)
class RungeKutta:
    """The classical method of order four, with steps of one length."""

    step: float
    name: str = "classical"
    stages: int | None = None

    def start(self, problem, t, q, v):
        return RungeKuttaStepper(self, problem)


class RungeKuttaStepper(Stepper):
    def __init__(self, method, problem):
        self.name, self.first, self.problem = method.name, method.step, problem

    def attempt(self, t, q, v, h):
        y, a = np.stack([q, v]), self.problem.single(t, q, v)
        slopes = [np.stack([v, a])]
        for share in (0.5, 0.5, 1.0):
            place, rate = y + share * h * slopes[-1]
            slopes.append(np.stack([rate, self.problem.single(t + share * h, place, rate)]))
        q1, v1 = y + h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
        mean = (v1 - v) / h
        swerve = 6.0 * (0.5 * (v + v1) - (q1 - q) / h) / h
        return Attempt(0.5, 1.0, q1, v1, np.stack([mean, swerve]))

    def accept(self, t, q, v):
        pass


def growth_of_runge_kutta(y, order):
    z = 1j * y
    return np.abs(1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0)


@pytest.mark.slow
def test_an_integrator_of_your_own_takes_one_file_and_one_name(tmp_path, monkeypatch):
    own = Integrator(lambda solve: RungeKutta(solve.step or 1e-4), Stability("", growth_of_runge_kutta))
    monkeypatch.setitem(METHODS, "classical", own)
    text = scene_with("integrator", "classical", {})
    results = goes_all_the_way(text, tmp_path)
    assert json.loads((results / "summary.json").read_text())["method"] == "classical"
    gauss = build(parse_deck(text, "deck", ["solve.method=gauss", "solve.tolerance=1e-9"]))
    own = build(parse_deck(text))
    ends = [run_integration(scene, scene.deck.solve).trajectory.q for scene in (gauss, own)]
    assert ends[1] == pytest.approx(ends[0], abs=1e-7)
    deck = tmp_path / "example.yaml"
    short = ("--budget", "4s", "--no-plots")
    told = hfsim("bench", deck, "--methods", "classical,gauss", *short, "-o", tmp_path / "bench")
    assert "classical" in told
    limits = ("stability", deck, "--limits", "--models", "linear", "--methods", "classical")
    told = hfsim(*limits, *short, "-o", tmp_path / "limits")
    assert "undamped modes grow from wh = 2.8" in told
    assert "classical" in candidates("gauss")


def test_a_command_of_your_own_takes_one_file_and_one_name(monkeypatch):
    @click.command()
    @click.argument("deck")
    def weigh(deck):
        """Tell what the bodies of DECK weigh."""
        click.echo(f"{deck}: 1 kg")

    monkeypatch.setitem(COMMANDS, "weigh", "What the bodies of a deck weigh.")
    monkeypatch.setitem(sys.modules, "hfsim.commands.weigh", SimpleNamespace(weigh=weigh))
    assert "What the bodies of a deck weigh." in hfsim("--help")
    assert "Tell what the bodies" in hfsim("weigh", "--help")
    assert hfsim("weigh", "one") == "one: 1 kg\n"
