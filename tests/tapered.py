"""Beams with stations and the sections that they have, for tests."""

from itertools import pairwise

import numpy as np
import yaml

from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

SECTIONS = {
    "thick": {"shape": "rectangle", "width": 0.1, "height": 0.02},
    "thin": {"shape": "rectangle", "width": 0.1, "height": 0.01},
    "point": {"shape": "rectangle", "width": 0.02, "height": 0.01},
    "rod": {"shape": "circle", "diameter": 0.02},
    "pin": {"shape": "circle", "radius": 0.005},
    "pipe": {"shape": "tube", "outer_radius": 0.01, "inner_radius": 0.008},
    "numbers": {"area": 1.0e-3, "second_moment": 1.0e-8},
    "fewer": {"area": 5.0e-4, "second_moment": 2.0e-9},
}
MATERIALS = {
    "steel": {"density": 7800.0, "youngs_modulus": 2.1e8},
    "alloy": {"density": 2700.0, "youngs_modulus": 7.0e7},
}
TAPER = [{"at": 0.0, "section": "thick"}, {"at": 1.0, "section": "thin"}]
CONE = [{"at": 0.0, "section": "rod"}, {"at": 1.0, "section": "pin"}]
WAIST = [{"at": 0.0, "section": "rod"}, {"at": 0.3, "section": "pin"}, {"at": 1.0, "section": "rod"}]
STEP = [
    {"at": 0.0, "section": "rod"},
    {"at": 0.5, "section": "rod"},
    {"at": 0.5, "section": "pin", "material": "alloy"},
    {"at": 1.0, "section": "pin", "material": "alloy"},
]
L = 1.5


def deck(stations, n_dim=2, model="ancf", force=None, poisson_ratio=0.25, **beam):
    """A cantilever with a force at its tip that grows to its size at t = 1."""
    body = {"type": "beam", "material": "steel", "length": L, "stations": stations, **beam}
    force = [0.0] * n_dim if force is None else force
    law = {"type": "constant_rate", "rate": 1.0}
    return {
        "hfsim": 1,
        "gravity": [0.0] * n_dim,
        "materials": {name: {**one, "poisson_ratio": poisson_ratio} for name, one in MATERIALS.items()},
        "sections": SECTIONS,
        "bodies": {"b": body},
        "joints": {"clamp": {"type": "fixed", "between": ["ground", "b.root"]}},
        "loads": {"push": {"type": "force", "at": "b.tip", "force": force, "law": law}},
        "solve": {"duration": 1.0, "model": model},
    }


def scene_of(*args, **kwargs):
    return build(parse_deck(yaml.safe_dump(deck(*args, **kwargs))))


def sizes(stations, s):
    """Height, or diameter, at shares of the length by linear interpolation between stations."""
    sections = [SECTIONS[one["section"]] for one in stations]
    size = [one.get("height") or one.get("diameter") or 2.0 * one["radius"] for one in sections]
    return np.interp(s, [one["at"] for one in stations], size)


def gauss(stations, n=40):
    """Places as shares of the length, and weights, of Gauss points between stations."""
    g, w = np.polynomial.legendre.leggauss(n)
    ends = sorted({one["at"] for one in stations})
    parts = [(a + (b - a) * 0.5 * (g + 1.0), (b - a) * 0.5 * w) for a, b in pairwise(ends)]
    return tuple(np.concatenate(one) for one in zip(*parts, strict=True))
