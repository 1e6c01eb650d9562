"""Functions that may be taken of time, with their derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from hfsim.maths.arrays import Array

Rule: TypeAlias = "tuple[Callable[..., Array], Callable[..., Array], Callable[..., Array]]"
"""What gives the value y of a function of u, its first and its second derivative, these of u and y."""


def power_of(exponent: float) -> Rule:
    """Return the rule of u to a power."""
    n = exponent
    return partial(_term, 1.0, n), partial(_term, n, n - 1), partial(_term, n * (n - 1), n - 2)


def _term(factor: float, exponent: float, u: Array, _: Array | None = None) -> Array:
    return factor * u**exponent if factor else np.zeros_like(u)


def _scaled(rule: Rule, factor: float) -> Rule:
    """Return the rule of a multiple of a function whose derivatives are of u alone."""
    y, y1, y2 = rule
    return lambda u: factor * y(u), lambda u, y: factor * y1(u, y), lambda u, y: factor * y2(u, y)


exponential: Rule = np.exp, lambda u, y: y, lambda u, y: y
logarithm: Rule = np.log, lambda u, y: 1 / u, lambda u, y: -1 / u**2
_abs: Rule = np.abs, lambda u, y: np.sign(u), lambda u, y: np.zeros_like(u)

RULES: dict[str, Rule] = {
    "sin": (np.sin, lambda u, y: np.cos(u), lambda u, y: -y),
    "cos": (np.cos, lambda u, y: -np.sin(u), lambda u, y: -y),
    "tan": (np.tan, lambda u, y: 1 + y * y, lambda u, y: 2 * y * (1 + y * y)),
    "asin": (np.arcsin, lambda u, y: 1 / np.sqrt(1 - u * u), lambda u, y: u / np.sqrt(1 - u * u) ** 3),
    "acos": (np.arccos, lambda u, y: -1 / np.sqrt(1 - u * u), lambda u, y: -u / np.sqrt(1 - u * u) ** 3),
    "atan": (np.arctan, lambda u, y: 1 / (1 + u * u), lambda u, y: -2 * u / (1 + u * u) ** 2),
    "sinh": (np.sinh, lambda u, y: np.cosh(u), lambda u, y: y),
    "cosh": (np.cosh, lambda u, y: np.sinh(u), lambda u, y: y),
    "tanh": (np.tanh, lambda u, y: 1 - y * y, lambda u, y: -2 * y * (1 - y * y)),
    "asinh": (np.arcsinh, lambda u, y: 1 / np.sqrt(1 + u * u), lambda u, y: -u / np.sqrt(1 + u * u) ** 3),
    "sqrt": power_of(0.5),
    "exp": exponential,
    "expm1": (np.expm1, lambda u, y: np.exp(u), lambda u, y: np.exp(u)),
    "log": logarithm,
    "log1p": (np.log1p, lambda u, y: 1 / (1 + u), lambda u, y: -1 / (1 + u) ** 2),
    "log10": _scaled(logarithm, 1 / math.log(10)),
    "log2": _scaled(logarithm, 1 / math.log(2)),
    "abs": _abs,
    "fabs": _abs,
    "degrees": _scaled(power_of(1.0), 180 / math.pi),
    "radians": _scaled(power_of(1.0), math.pi / 180),
}
"""Functions of one number that may be taken of t."""
KINKED = ("abs", "fabs", "max", "min")
"""Functions whose rate may jump."""
JUMPS = ("ceil", "copysign", "floor", "fmod", "remainder", "trunc")
"""Functions that jump themselves."""
OF_TIME = (*RULES, "max", "min", "hypot", "pow")
"""Functions that may be taken of t."""
