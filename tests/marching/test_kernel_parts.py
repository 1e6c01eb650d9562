"""All that decks can name is recorded, and evaluates to what it does in NumPy, in the plane and in space."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
import yaml
from natively import both, evaluates_alike, native, states
from test_totality import CASES, ELBOW, EXAMPLES, SCENE, SPACE, scene_with

from hfsim.integrators._replayed import Replay
from hfsim.marching.integration import run_integration
from hfsim.maths import kernel
from hfsim.maths.replayed import Replayed
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck

pytestmark = native
ROOT = Path(__file__).resolve().parent.parent.parent
HINGED = {"type": "revolute", "between": ELBOW, "axis": [0, 1, 0]}
SWAY = {"type": "sine", "amplitude": 0.1, "frequency": 2.0}
ARM = SCENE["bodies"]["arm"]
STOPS = {"stiffness": 200.0, "lower": -1e-4, "upper": 1e-3}
LATCH = {"stiffness": 50.0, "damping": 0.1}
DAMPER = {"damping": 0.1, "damping_table": [[-1.0, -3.0], [0.0, 0.0], [0.1, 2.0]]}
TURNING = DAMPER | {"friction": {"torque": 0.2}, "stops": STOPS, "latch": LATCH | {"angle": 2e-3}}
SLIDING = DAMPER | {"friction": {"force": 2.0}, "stops": STOPS, "latch": LATCH | {"distance": 2e-3}}
PULL = [0.1, 0.2, 0.3]


def planar(**changes):
    return changed(SCENE, changes)


def spatial(**changes):
    return changed(SPACE, {"elbow": {"type": "spherical", "between": ELBOW}} | changes)


def changed(deck, changes):
    """Return a deck with other entries: a body 'arm', joints, springs and loads by what they join or load."""
    deck = deepcopy(deck)
    for name, entry in changes.items():
        if name == "arm":
            deck["bodies"]["arm"] = entry
        else:
            kinds = {"coil": "springs", "band": "springs", "load": "loads", "laminate": "sections"}
            kind = kinds.get(name, "joints")
            deck.setdefault(kind, {})[name] = entry
    return yaml.safe_dump(deck)


def about(kind, **entry):
    return {"type": kind, "between": ["ground", "hub"], **entry}


REGISTERED = {
    f"{kind} {name}": scene_with(kind, name, EXAMPLES.get(kind, {name: {}})[name])
    for kind, name in CASES
    if kind not in ("rule", "integrator")
}
BEAMS = {
    f"{where.__name__} {element} {model}": where(arm=ARM | {"element": element, "model": model})
    for where in (planar, spatial)
    for element in ("cable", "continuum", "cosserat")
    for model in ("rigid", "linear", "lowOrder", "exact")
    if (element, model) != ("continuum", "lowOrder")
}
LAMINATE = {"mass_per_length": 1.0, "rotary_inertia": [2e-3, 1e-3, 1e-3], "bending_damping": 1e-3}
LAMINATE["stiffness"] = (np.diag([1e4, 5e3, 5e3, 2.0, 3.0, 4.0]) + np.eye(6, k=3) + np.eye(6, k=-3)).tolist()
BLADE = {key: one for key, one in ARM.items() if key != "material"} | {"section": "laminate"}
COUPLED = {
    f"coupled {model}": spatial(laminate=LAMINATE, arm=BLADE | {"model": model})
    for model in ("rigid", "linear", "lowOrder", "exact")
}
RESISTING = {
    "planar turn": planar(pin=about("revolute", **TURNING)),
    "planar shift": planar(pin=about("prismatic", axis=[0, 1], **SLIDING)),
    "spatial turn": spatial(pin=about("revolute", axis=[0, 1, 0], **TURNING)),
    "spatial both": spatial(pin=about("cylindrical", axis=[1, 0, 1], turning=TURNING, sliding=SLIDING)),
}
IN_SPACE = {
    "revolute": spatial(elbow=HINGED),
    "prismatic": spatial(elbow=HINGED | {"type": "prismatic"}),
    "fixed": spatial(elbow={"type": "fixed", "between": ELBOW}),
    "driver": spatial(elbow=HINGED, drive=HINGED | {"type": "driver", "angle": SWAY}),
    "motor": spatial(elbow=HINGED, drive=HINGED | {"type": "motor", "torque": 0.1, "law": SWAY}),
    "servo": spatial(
        elbow=HINGED, drive=HINGED | {"type": "servo", "angle": 0.3, "stiffness": 2.0, "limit": 1.0}
    ),
    "motion": spatial(elbow={"type": "motion", "between": ELBOW, "y": SWAY}),
    "rotational": spatial(coil=about("rotational", axis=[0, 1, 0], stiffness=3.0, damping=0.1)),
    "two_point": spatial(band={"type": "two_point", "between": ["ground", "arm.root"], "stiffness": 3.0}),
    **{
        f"{kind}{' follower' * follower}": spatial(
            load={"type": kind, "at": "arm", kind: PULL, "follower": follower}
        )
        for kind in ("force", "moment")
        for follower in (False, True)
    },
    "distributed": spatial(arm=ARM, load={"type": "distributed", "on": "arm", "force": PULL}),
}
SPATIAL = {f"spatial {name}": deck for name, deck in IN_SPACE.items()}
DECKS = REGISTERED | BEAMS | COUPLED | RESISTING | SPATIAL
STEPS = {
    f"integrator {name}": scene_with("integrator", name, EXAMPLES["integrator"][name])
    for kind, name in CASES
    if kind == "integrator"
}


@pytest.mark.parametrize("name", DECKS)
def test_every_part_evaluates_to_what_it_does_in_numpy(name):
    evaluates_alike(build(parse_deck(DECKS[name])))


@pytest.mark.slow
@pytest.mark.parametrize("name", DECKS | STEPS)
def test_every_part_moves_as_it_does_in_numpy(name, monkeypatch):
    """To 1e-9, in as many steps but for where rounding decides."""

    def run():
        tolerance = 1e-5 if name in STEPS else 1e-9
        scene = build(
            parse_deck((DECKS | STEPS)[name], "deck", ["solve.duration=0.02", f"solve.tolerance={tolerance}"])
        )
        return run_integration(scene, scene.deck.solve)

    one, other = both(monkeypatch, run)
    assert one.stop is None and other.stop is None
    assert np.abs(one.trajectory.q - other.trajectory.q).max() <= 1e-9
    assert abs(len(one.trajectory.segments) - len(other.trajectory.segments)) <= 1


def test_laws_tables_friction_and_interior_nodes_call_no_python(monkeypatch):
    monkeypatch.setattr(kernel, "KERNEL", "native")
    scene = build(load_deck(ROOT / "cases/door.yaml", ["solve.duration=0.5"]))
    assert run_integration(scene, scene.deck.solve).stop is None
    kept = [one for kept in scene.recordings.values() for one in kept.values()]
    steps = [one.recorded for one in kept if isinstance(one, Replay)]
    assert steps and all(one.calls == [] for one in steps)


@pytest.mark.parametrize("name", BEAMS)
def test_forces_of_all_beams_are_recorded_whole(name):
    """None of them is a call of Python in a recording."""
    scene, rng = build(parse_deck(BEAMS[name])), np.random.default_rng(3)
    for part in scene.system.forces:

        def force(t, x, u, part=part):
            out = np.zeros_like(x)
            part.add_force(t, x, u, out)
            return out

        replayed, (t, q, v) = Replayed(force), states(scene, rng)
        replayed(t, scene.system.absolute(q), scene.system.absolute_velocity(q, v))
        assert replayed.refused is None
