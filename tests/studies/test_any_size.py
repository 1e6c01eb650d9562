"""Scenes of any size give the same, scaled: no step or threshold anywhere is one of metres.

Lengths are multiplied by s, densities and times kept: moduli go with s^2, forces with s^4, moments with s^5.
"""

import numpy as np
import pytest

import hfsim
from hfsim.scene.build import build
from hfsim.studies.spectra import spectrum

SMALL, LARGE = 1e-6, 1e3
SCENES = [
    (2, "cable", "linear"),
    (2, "cable", "lowOrder"),
    (2, "cable", "exact"),
    (2, "cosserat", "linear"),
    (3, "cable", "linear"),
    (3, "cable", "lowOrder"),
    (3, "cosserat", "linear"),
    (3, "cosserat", "lowOrder"),
    (3, "continuum", "linear"),
]


def arm(n, element, model, s):
    """An arm on a hub, held by a spring between its nodes, and pushed there by what turns with it."""

    def vector(x, y=0.0):
        return [s * x, s * y, 0.0][:n]

    # of a line the tangent alone is known
    way = vector(0.5) if (n, element) == (3, "cable") else vector(0.0, 0.5)
    push = [s**3 * one for one in way]
    inertia, points = 0.05 * s**5, {"mid": vector(0.37)}
    hub = {"type": "rigid", "mass": 2.0 * s**3, "inertia": inertia if n == 2 else [inertia] * 3}
    beam = {"type": "beam", "element": element, "material": "m", "section": "c", "length": s, "elements": 2}
    coil = {"type": "rotational", "stiffness": 30.0 * s**5, "damping": 0.05 * s**5}
    stay = {"type": "two_point", "stiffness": 200.0 * s**3, "rest_length": 0.5 * s}
    return {
        "hfsim": 1,
        "gravity": vector(0.3, -9.81),
        "materials": {"m": {"density": 1000.0, "youngs_modulus": 3e7 * s**2, "poisson_ratio": 0.3}},
        "sections": {"c": {"shape": "rectangle", "width": 0.05 * s, "height": 0.05 * s}},
        "ground": {"points": {"top": vector(0.4, 0.6)}},
        "bodies": {"hub": {**hub, "points": {"rim": vector(0.1)}}, "b": {**beam, "points": points}},
        "joints": {
            "pin": {"type": "revolute", "between": ["ground", "hub"]},
            "clamp": {"type": "fixed", "between": ["hub.rim", "b.root"]},
        },
        "springs": {
            "coil": {**coil, "between": ["ground", "hub"]},
            "stay": {**stay, "between": ["ground.top", "b.mid"]},
        },
        "loads": {"push": {"type": "force", "at": "b.mid", "force": push, "follower": True}},
        "initial": {"hub": {"angle": 0.2, "angular_velocity": 3.0}},
        "solve": {"model": model, "duration": 0.01, "step": 0.005},
        "output": {"interval": 0.01, "channels": ["b.tip.x", "b.tip.y", "b.mid.x"]},
    }


def told(n, element, model, s):
    """What equilibrium and a run of two steps come to, over the size; frequencies, damping, stiffness."""
    deck = arm(n, element, model, s)
    static, run = hfsim.static(deck), hfsim.run(deck, error_estimate=False, diagnosis=False)
    modes = hfsim.modes(deck, about="equilibrium", count=4)
    places = np.array([*static.final.values(), *run.final.values()]) / s
    return places, modes.frequencies[:4], modes.damping_ratios[:4], static.statistics["smallest_eigenvalue"]


@pytest.mark.parametrize(("n", "element", "model"), SCENES)
def test_scenes_of_any_size_give_the_same_scaled(n, element, model):
    (there, *found), (places, *others) = (told(n, element, model, s) for s in (SMALL, LARGE))
    assert there == pytest.approx(places, abs=1e-9)
    for one, other in zip(found, others, strict=True):
        assert one == pytest.approx(other, rel=1e-7, abs=1e-10)


@pytest.mark.parametrize("model", ["linear", "lowOrder"])
def test_spectra_of_moving_scenes_of_any_size_are_the_same(model):
    """They are taken by differences of accelerations; fast motions leave the slow ones five digits."""
    scenes = (build(hfsim.load(arm(2, "cable", model, s))) for s in (SMALL, 1.0, LARGE))
    small, one, large = (spectrum(scene, 0.0, scene.q, scene.v) for scene in scenes)
    for other in (small, large):
        assert other.fastest == pytest.approx(one.fastest, rel=1e-8)
        assert other.slowest == pytest.approx(one.slowest, rel=1e-4)
