"""Integrators: one file each; `METHODS` names them all.  Files with an underscore are what they share."""

from __future__ import annotations

from pkgutil import resolve_name

from hfsim.integrators._base import Attempt, Integrator, Limits, Method, Options, Stability, Stepper
from hfsim.integrators._loop import Stepping
from hfsim.integrators._memory import Memory, packed, part_of
from hfsim.integrators._often import Recordings
from hfsim.integrators._problem import Counts, PlainIncrements, Problem
from hfsim.integrators._trajectory import Segment, Trajectory, joined

METHODS: dict[str, Integrator | str] = {
    "gauss": "hfsim.integrators.collocation.GAUSS",
    "radau": "hfsim.integrators.collocation.RADAU",
    "energy": "hfsim.integrators.energy.ENERGY",
    "gear": "hfsim.integrators.gear.GEAR",
    "generalized_alpha": "hfsim.integrators.generalized_alpha.GENERALIZED_ALPHA",
    "explicit": "hfsim.integrators.explicit.EXPLICIT",
}
"""Each method, or where it stands: modules are imported when their methods are asked for."""


def integrator(name: str) -> Integrator:
    """Return what is known of a method in `METHODS`."""
    entry = METHODS[name]
    if isinstance(entry, Integrator):
        return entry
    found: Integrator = resolve_name(entry)
    return found


def choose(solve: Options, dissipates: bool) -> Method:
    """Return the method a deck asks for.

    ``auto`` is explicit where few steps make the run; else gauss for steps that resolve the fastest mode and
    radau for longer ones, all the way radau where dampers ask for damping.
    """
    if solve.method == "auto":
        from hfsim.integrators._automatic import chosen

        return chosen(solve, dissipates)
    return integrator(solve.method).make(solve)


def steps_in_absolute_coordinates(method: str) -> bool:
    """Return whether a method, or ``auto``, needs coordinates with a constant mass matrix."""
    return method != "auto" and integrator(method).constant_mass


__all__ = [
    "METHODS",
    "Attempt",
    "Counts",
    "Integrator",
    "Limits",
    "Memory",
    "Method",
    "Options",
    "PlainIncrements",
    "Problem",
    "Recordings",
    "Segment",
    "Stability",
    "Stepper",
    "Stepping",
    "Trajectory",
    "choose",
    "integrator",
    "joined",
    "packed",
    "part_of",
    "steps_in_absolute_coordinates",
]
