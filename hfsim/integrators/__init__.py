"""Integrators: one file each; `METHODS` names them all."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

from hfsim.integrators._base import (
    Counts,
    Limits,
    Method,
    PlainIncrements,
    Problem,
    Segment,
    Trajectory,
    integrate,
    joined,
)
from hfsim.integrators._tableau import gauss, radau
from hfsim.integrators.collocation import CollocationMethod, Damping
from hfsim.integrators.energy import DEFAULT_STAGES, EnergyMethod
from hfsim.integrators.explicit import Explicit
from hfsim.integrators.gear import Gear
from hfsim.integrators.generalized_alpha import GeneralizedAlpha

GAUSS_STAGES = 20
"""Stages of `gauss` by default: fewer make steps shorter and save no iterations, even at loose tolerances."""
LOOSE = 3e-4
"""Tolerance above which radau makes do with fewer stages."""


class Options(Protocol):
    """What methods read of how a scene is to be solved; a deck's ``solve`` has it all."""

    @property
    def method(self) -> str:
        """Name in `METHODS`, or ``auto``."""

    @property
    def tolerance(self) -> float:
        """Local error per step: metre, radian or slope, relative above 1."""

    @property
    def step(self) -> float | None:
        """Fixed step length [s]."""

    @property
    def order(self) -> int | None:
        """Order, where a method has several."""

    @property
    def stages(self) -> int | None:
        """Stages of a collocation method."""

    @property
    def rho_inf(self) -> float:
        """Spectral radius at infinite frequency."""


def unresolving_stages(tolerance: float) -> int:
    """Return the number of stages for steps that do not resolve the fastest modes.

    Examples
    --------
    >>> [unresolving_stages(tolerance) for tolerance in (1e-3, 1e-4, 1e-8)]
    [16, 20, 24]
    """
    return 16 if tolerance > LOOSE else 20 if tolerance > 1e-5 else 24


def _gauss(solve: Options) -> Method:
    return CollocationMethod("gauss", gauss(solve.stages or GAUSS_STAGES), solve.tolerance)


def _auto(solve: Options) -> Method:
    damping = Damping("radau", partial(radau, solve.stages or unresolving_stages(solve.tolerance)))
    return CollocationMethod("gauss", gauss(solve.stages or GAUSS_STAGES), solve.tolerance, damping)


def _radau(solve: Options) -> Method:
    stages = solve.stages or (6 if solve.tolerance > LOOSE else 10)
    return CollocationMethod("radau", radau(stages), solve.tolerance)


def _energy(solve: Options) -> Method:
    return EnergyMethod("energy", gauss(solve.stages or DEFAULT_STAGES), solve.tolerance)


def _gear(solve: Options) -> Method:
    return Gear(solve.tolerance, solve.step, solve.order)


def _generalized_alpha(solve: Options) -> Method:
    return GeneralizedAlpha(solve.tolerance, solve.rho_inf)


def _explicit(solve: Options) -> Method:
    return Explicit(solve.tolerance)


METHODS: dict[str, Callable[[Options], Method]] = {
    "gauss": _gauss,
    "radau": _radau,
    "energy": _energy,
    "gear": _gear,
    "generalized_alpha": _generalized_alpha,
    "explicit": _explicit,
}


def choose(solve: Options, dissipates: bool) -> Method:
    """Return the method a deck asks for.

    ``auto`` is gauss for steps that resolve the fastest mode and radau for longer ones; all the way radau
    where dampers ask for damping.
    """
    if solve.method == "auto":
        return _radau(solve) if dissipates else _auto(solve)
    return METHODS[solve.method](solve)


__all__ = [
    "METHODS",
    "Counts",
    "Limits",
    "Method",
    "Options",
    "PlainIncrements",
    "Problem",
    "Segment",
    "Trajectory",
    "choose",
    "integrate",
    "joined",
]
