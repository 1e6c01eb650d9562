"""Frequencies, damping and shapes of the small motions of a scene."""

from hfsim.studies.modes.campbell import Campbell, campbell
from hfsim.studies.modes.found import Mode, Modes, modes_of
from hfsim.studies.modes.periodic import periodic
from hfsim.studies.modes.state import About

__all__ = ["About", "Campbell", "Mode", "Modes", "campbell", "modes_of", "periodic"]
