"""Friction that sticks in a state: near rest it is a damper, of its level over its velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hfsim.maths.arrays import ComplexArray
from hfsim.mechanics.ties import Tie
from hfsim.studies.modes.state import About

_COUNTS = 1e-2
"""Part of critical damping of a mode from which it is told what makes it."""


@dataclass(frozen=True)
class Sticking:
    """Friction that sticks, and damps modes.

    Attributes
    ----------
    place : str
        In the deck.
    damping : float
        In the unit.
    unit : str
    """

    place: str
    damping: float
    unit: str


def sticking(state: About, modes: Sequence[tuple[complex, ComplexArray]]) -> list[Sticking]:
    """Return what friction sticks in a state, of that which counts in one of the modes.

    Parameters
    ----------
    modes : sequence of tuple
        Eigenvalues, and changes (n_x,) of the absolute coordinates.
    """
    found = list[Sticking]()
    at, x, u = np.array([state.t]), state.motions.x[None], state.motions.u[None]
    for part in (one for one in state.scene.system.forces if isinstance(one, Tie)):
        damping = part.stuck(at, x, u)
        if damping and any(_share(state, part, damping, *mode) > _COUNTS for mode in modes):
            unit = "N m s/rad" if part.unit == "rad" else "N s/m"
            found.append(Sticking(f"{part.item}.friction", damping, unit))
    return found


def _share(state: About, part: Tie, damping: float, value: complex, change: ComplexArray) -> float:
    """Return the part of critical damping that a damper makes of a mode."""
    scene, at, x = state.scene, np.array([state.t]), state.motions.x[None]
    moves = np.stack([change.real, change.imag])
    rates = np.concatenate([part.slip(at, x, one[None]) for one in moves])
    energy = float(np.sum(moves * scene.system.equations.momentum(x, moves)))
    lost, kept = damping * float(np.sum(rates**2)), 2.0 * abs(value) * energy
    return lost / kept if kept else float(np.inf if lost > _COUNTS * energy else 0.0)
