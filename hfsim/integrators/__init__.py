"""Integrators: one file each; `METHODS` names them all."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from hfsim.scene.schema import SolveSpec


GAUSS_STAGES = 20
"""Stages of `gauss` by default: fewer make steps shorter and save no iterations, even at loose tolerances."""
LOOSE = 3e-4
"""Tolerance above which radau makes do with fewer stages."""


def unresolving_stages(tolerance: float) -> int:
    """Return the number of stages for steps that do not resolve the fastest modes.

    Examples
    --------
    >>> [unresolving_stages(tolerance) for tolerance in (1e-3, 1e-4, 1e-8)]
    [16, 20, 24]
    """
    return 16 if tolerance > LOOSE else 20 if tolerance > 1e-5 else 24


def _gauss(solve: SolveSpec) -> Method:
    return CollocationMethod("gauss", gauss(solve.stages or GAUSS_STAGES), solve.tolerance)


def _auto(solve: SolveSpec) -> Method:
    damping = Damping("radau", partial(radau, solve.stages or unresolving_stages(solve.tolerance)))
    return CollocationMethod("gauss", gauss(solve.stages or GAUSS_STAGES), solve.tolerance, damping)


def _radau(solve: SolveSpec) -> Method:
    stages = solve.stages or (6 if solve.tolerance > LOOSE else 10)
    return CollocationMethod("radau", radau(stages), solve.tolerance)


def _energy(solve: SolveSpec) -> Method:
    return EnergyMethod("energy", gauss(solve.stages or DEFAULT_STAGES), solve.tolerance)


def _gear(solve: SolveSpec) -> Method:
    return Gear(solve.tolerance, solve.step, solve.order)


def _generalized_alpha(solve: SolveSpec) -> Method:
    return GeneralizedAlpha(solve.tolerance, solve.rho_inf)


def _explicit(solve: SolveSpec) -> Method:
    return Explicit(solve.tolerance)


METHODS: dict[str, Callable[[SolveSpec], Method]] = {
    "gauss": _gauss,
    "radau": _radau,
    "energy": _energy,
    "gear": _gear,
    "generalized_alpha": _generalized_alpha,
    "explicit": _explicit,
}


def choose(solve: SolveSpec, dissipates: bool) -> Method:
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
    "PlainIncrements",
    "Problem",
    "Segment",
    "Trajectory",
    "choose",
    "integrate",
    "joined",
]
