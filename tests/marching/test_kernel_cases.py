"""Nothing in the shipped cases falls back to NumPy unnoticed: all that is recorded can be replayed."""

import pytest
from natively import at_once, native

from hfsim.errors import HfsimError
from hfsim.marching.integration import run_integration
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck
from hfsim.scene.shipped import CASES

LARGEST = 120
"""Coordinates of a scene that is tried."""
STIFFEST = "slender"
"""Axially 1e9 times stiffer than in bending: finer meshes of it show what is rounded differently."""
SPARSE = "sparse matrices, as in large scenes"
VARIANTS = {
    "as it is": lambda beams: [],
    SPARSE: lambda beams: [],
    "ordinary steps": lambda beams: ["solve.method=gauss"],
    "lowOrder": lambda beams: ["solve.model=lowOrder"],
    "body frames": lambda beams: ["solve.coordinates=frame"],
    "degree 5": lambda beams: [f"bodies.{name}.degree=5" for name in beams],
    "continuum": lambda beams: [f"bodies.{name}.element=continuum" for name in beams],
    "cosserat": lambda beams: [f"bodies.{name}.element=cosserat" for name in beams],
}


def refused(scene):
    """Return why what was to be replayed in three steps is not, and how much was to be."""
    done = run_integration(scene, scene.deck.solve)
    kept = [one for kept in done.problem.recordings.values() for one in kept.values()]
    found = [one if isinstance(one, Exception) else getattr(one, "refused", None) for one in kept]
    return [str(why) for why in found if why is not None], len(kept)


@native
@pytest.mark.slow
@pytest.mark.parametrize("variant", VARIANTS)
def test_nothing_is_refused(variant, monkeypatch):
    at_once(monkeypatch)
    if variant == SPARSE:
        monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 0)
    tried = 0
    for path in sorted(CASES.rglob("*.yaml")):
        try:
            beams = [name for name, body in load_deck(path).deck.bodies.items() if body.type == "beam"]
            scene = build(load_deck(path, ["solve.max_steps=3", *VARIANTS[variant](beams)]))
        except HfsimError:  # a deck of another kind, or one that cannot be had so
            continue
        if len(scene.q) <= LARGEST:
            found, recorded = refused(scene)
            if path.stem == STIFFEST:
                found = [why for why in found if "differ" not in why]
            assert not found, f"{path.stem}: {found}"
            tried += recorded > 0
    assert tried > 20
