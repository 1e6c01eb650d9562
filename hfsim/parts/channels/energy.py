"""Energies of the whole scene."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import Samples


def energy(samples: Samples, subject: str, quantity: str) -> Array:
    """Return kinetic, strain, potential (weight and springs) or total energy [J]."""
    system = samples.scene.system
    parts = {
        "kinetic": lambda: system.kinetic_energy(samples.x, samples.u),
        "strain": lambda: system.strain_energy(samples.x),
        "potential": lambda: system.potential_energy(samples.t, samples.x),
    }
    wanted = list(parts) if quantity == "total" else [quantity]
    return np.asarray(sum((parts[name]() for name in wanted), np.zeros(len(samples.t))))
