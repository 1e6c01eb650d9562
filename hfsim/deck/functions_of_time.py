"""Functions that may be taken of time: each yields its value, first and second derivative."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import TypeAlias

import numpy as np

from hfsim.maths.arrays import Array

Rule: TypeAlias = "Callable[[Array], Iterator[Array]]"

def _sin(u: Array) -> Iterator[Array]:
    yield np.sin(u)
    yield np.cos(u)
    yield -np.sin(u)


def _cos(u: Array) -> Iterator[Array]:
    yield np.cos(u)
    yield -np.sin(u)
    yield -np.cos(u)


def _tan(u: Array) -> Iterator[Array]:
    y = np.tan(u)
    yield y
    yield 1 + y * y
    yield 2 * y * (1 + y * y)


def _asin(u: Array) -> Iterator[Array]:
    yield np.arcsin(u)
    yield 1 / np.sqrt(1 - u * u)
    yield u / np.sqrt(1 - u * u) ** 3


def _acos(u: Array) -> Iterator[Array]:
    yield np.arccos(u)
    yield -1 / np.sqrt(1 - u * u)
    yield -u / np.sqrt(1 - u * u) ** 3


def _atan(u: Array) -> Iterator[Array]:
    yield np.arctan(u)
    yield 1 / (1 + u * u)
    yield -2 * u / (1 + u * u) ** 2


def _sinh(u: Array) -> Iterator[Array]:
    yield np.sinh(u)
    yield np.cosh(u)
    yield np.sinh(u)


def _cosh(u: Array) -> Iterator[Array]:
    yield np.cosh(u)
    yield np.sinh(u)
    yield np.cosh(u)


def _tanh(u: Array) -> Iterator[Array]:
    y = np.tanh(u)
    yield y
    yield 1 - y * y
    yield -2 * y * (1 - y * y)


def _asinh(u: Array) -> Iterator[Array]:
    yield np.arcsinh(u)
    yield 1 / np.sqrt(1 + u * u)
    yield -u / np.sqrt(1 + u * u) ** 3


def exponential(u: Array) -> Iterator[Array]:
    """Yield exp(u) and its derivatives."""
    y = np.exp(u)
    yield y
    yield y
    yield y


def _expm1(u: Array) -> Iterator[Array]:
    yield np.expm1(u)
    yield from islice(exponential(u), 1, None)


def logarithm(u: Array) -> Iterator[Array]:
    """Yield log(u) and its derivatives."""
    yield np.log(u)
    yield 1 / u
    yield -1 / u**2


def _log1p(u: Array) -> Iterator[Array]:
    yield np.log1p(u)
    yield from islice(logarithm(1 + u), 1, None)


def _abs(u: Array) -> Iterator[Array]:
    yield np.abs(u)
    yield np.sign(u)
    yield np.zeros_like(u)


def power_of(exponent: float) -> Rule:
    """Return what yields u to a power and its derivatives."""

    def rule(u: Array) -> Iterator[Array]:
        factor = 1.0
        for order in range(3):
            yield factor * u ** (exponent - order) if factor else np.zeros_like(u)
            factor *= exponent - order

    return rule


def _scaled(rule: Rule, factor: float) -> Rule:
    return lambda u: (factor * one for one in rule(u))


RULES: dict[str, Rule] = {
    **{"sin": _sin, "cos": _cos, "tan": _tan, "asin": _asin, "acos": _acos, "atan": _atan},
    **{"sinh": _sinh, "cosh": _cosh, "tanh": _tanh, "asinh": _asinh, "sqrt": power_of(0.5)},
    **{"exp": exponential, "expm1": _expm1, "log": logarithm, "log1p": _log1p, "abs": _abs, "fabs": _abs},
    **{"log10": _scaled(logarithm, 1 / math.log(10)), "log2": _scaled(logarithm, 1 / math.log(2))},
    **{"degrees": _scaled(power_of(1.0), 180 / math.pi), "radians": _scaled(power_of(1.0), math.pi / 180)},
}
"""Functions of one number that may be taken of t."""
KINKED = ("abs", "fabs", "max", "min")
"""Functions whose rate may jump."""
JUMPS = ("ceil", "copysign", "floor", "fmod", "remainder", "trunc")
"""Functions that jump themselves."""
OF_TIME = (*RULES, "max", "min", "hypot", "pow")
"""Functions that may be taken of t."""
