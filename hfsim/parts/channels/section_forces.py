"""Internal forces of beams: what the part beyond a section does to the part before it, in section axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array
from hfsim.mechanics.body import Body
from hfsim.parts.channels._base import ChannelKind, Plot, Samples, body_places

_BENDING = ("bending_moment_y", "bending_moment_z")
_NAMES = {
    2: ("axial_force", "shear_force", "", "", "", "bending_moment"),
    3: ("axial_force", "shear_force_y", "shear_force_z", "torsion_moment", *_BENDING),
}
"""Channel of each column of `Body.section_forces`, by the dimensions of space."""


def _column(column: int) -> Callable[[Samples, str], Array]:
    return lambda samples, point: samples.section_forces(point)[:, column]


def _stress(samples: Samples, point: str) -> Array:
    name, at = split_point(point)
    body = samples.scene.bodies[name]
    return stress(body, samples.section_forces(point)[:, None], body_places(body, at))[:, 0]


def stress(body: Body, forces: Array, places: Array) -> Array:
    """Return the size of the largest normal stress [Pa] in sections at places; 0 if not known.

    Their forces have the shape (..., n_places, 6).
    """
    fibres = body.fibres(places)
    if fibres is None:
        return np.zeros(forces.shape[:-1])
    return np.asarray(fibres.stress(forces[..., 0], forces[..., 4], forces[..., 5]))


def force_columns(body: Body, forces: Array, places: Array, n_dim: int) -> dict[str, Array]:
    """Return what sections at places with forces (..., n_places, 6) have, by the names of the channels.

    Without the stress where that is not known.
    """
    named = {name: forces[..., k] for k, name in enumerate(_NAMES[n_dim]) if name}
    return named if body.fibres(places) is None else named | {"stress": stress(body, forces, places)}


def _kind(name: str, column: int) -> ChannelKind:
    what = name.rpartition("_")[0] if name[-2:] in ("_y", "_z") else name
    return ChannelKind(
        "N" if column < 3 else "N m",
        _column(column),
        "point",
        Plot(what.replace("_", " "), what),
        dimensions=tuple(n_dim for n_dim, names in _NAMES.items() if name in names),
        only_beams=True,
        of_sections=name == "torsion_moment",
        of_strains=True,
    )


_STRESS = ChannelKind(
    "Pa",
    _stress,
    "point",
    Plot("largest normal stress", "stress"),
    only_beams=True,
    of_strains=True,
    of_shape=True,
)
SECTION_FORCES = {
    **{name: _kind(name, column) for names in _NAMES.values() for column, name in enumerate(names) if name},
    "stress": _STRESS,
}
"""Axial and shear force, torsion and bending moment, and stress."""
