"""Frequencies, damping and shapes of the small motions of a scene."""

from hfsim.studies.modes.about import About
from hfsim.studies.modes.campbell import Campbell, campbell
from hfsim.studies.modes.found import Mode, Modes, modes_of

__all__ = ["About", "Campbell", "Mode", "Modes", "campbell", "modes_of"]
