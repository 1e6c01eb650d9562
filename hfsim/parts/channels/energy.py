"""Energies of the whole scene."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.parts.channels._base import ChannelKind, Plot, Samples

_PLOT = Plot("energy", "energy")


def _kinetic(samples: Samples, subject: str) -> Array:
    return samples.scene.system.kinetic_energy(samples.x, samples.u)


def _strain(samples: Samples, subject: str) -> Array:
    return samples.scene.system.strain_energy(samples.x)


def _potential(samples: Samples, subject: str) -> Array:
    return samples.scene.system.potential_energy(samples.t, samples.x)


def _total(samples: Samples, subject: str) -> Array:
    return np.asarray(sum(part(samples, subject) for part in (_kinetic, _strain, _potential)))


KINETIC = ChannelKind("J", _kinetic, "energy", _PLOT)
STRAIN = ChannelKind("J", _strain, "energy", _PLOT)
POTENTIAL = ChannelKind("J", _potential, "energy", _PLOT)
"""Of weight and springs."""
TOTAL = ChannelKind("J", _total, "energy", _PLOT, judged="unless conserved")
