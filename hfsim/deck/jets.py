"""Jets: values of functions of time with their derivatives, and what is calculated with them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, TypeAlias

import numpy as np

from hfsim.deck.functions_of_time import Rule, exponential, logarithm, power_of
from hfsim.maths.arrays import Array

Jet: TypeAlias = "list[Any] | float"
"""Value and derivatives by time up to some order, arrays or numbers; a number where it is constant."""
Operation: TypeAlias = "Callable[[Jet, Jet], Jet]"


def composed(rule: Rule, u: Sequence[Any]) -> list[Any]:
    """Return the jet of a function, whose derivatives a rule gives, of a jet."""
    y = rule[0](u[0])
    g = [y, *(derivative(u[0], y) for derivative in rule[1 : len(u)])]
    found = [y]
    if len(u) > 1:
        found.append(_product(g[1], u[1]))
    if len(u) > 2:
        found.append(_product(g[2], u[1] * u[1]) + _product(g[1], u[2]))
    return found


def _product(x: Any, y: Any) -> Any:
    """Return x y; most derivatives are of t alone, 1 and 0."""
    if isinstance(y, float) and y in (0.0, 1.0):
        return x if y else 0.0
    return x * y


def _number(a: Jet) -> float:
    assert not isinstance(a, list)
    return a


def _steady(a: float, like: Jet) -> list[Array]:
    """Return the jet of a number, with as many derivatives as another has."""
    assert isinstance(like, list)
    return [np.full_like(like[0], 0.0 if order else a) for order in range(len(like))]


def _plus(a: Jet, b: Jet, sign: float = 1.0) -> Jet:
    if isinstance(a, list) and isinstance(b, list):
        return [x + sign * y for x, y in zip(a, b, strict=True)]
    if isinstance(a, list):
        return [a[0] + sign * _number(b), *a[1:]]
    if isinstance(b, list):
        return [a + sign * b[0], *(sign * y for y in b[1:])]
    return a + sign * b


def times(a: Jet, b: Jet) -> Jet:
    """Return the jet of a product."""
    if isinstance(a, list) and isinstance(b, list):
        found = [a[0] * b[0]]
        if len(a) > 1:
            found.append(_product(b[0], a[1]) + _product(a[0], b[1]))
        if len(a) > 2:
            found.append(_product(b[0], a[2]) + 2.0 * (a[1] * b[1]) + _product(a[0], b[2]))
        return found
    if isinstance(a, list):
        return [x * _number(b) for x in a]
    return [a * y for y in b] if isinstance(b, list) else a * b


def _over(a: Jet, b: Jet) -> Jet:
    if isinstance(b, list):
        return times(a, composed(power_of(-1.0), b))
    return [x / b for x in a] if isinstance(a, list) else a / b


def to_the(a: Jet, b: Jet) -> Jet:
    """Return the jet of a power."""
    if not isinstance(b, list):
        return composed(power_of(b), a) if isinstance(a, list) else a**b
    exponent = times(b, _logarithm(a))
    assert isinstance(exponent, list)
    return composed(exponential, exponent)


def _chosen(choose: Callable[[Any, Any], Any]) -> Callable[[Jet, Jet], Jet]:
    """Return what takes of two jets the one whose value is chosen."""

    def pick(a: Jet, b: Jet) -> Jet:
        if not isinstance(a, list) and not isinstance(b, list):
            return a if choose(a, b) else b
        first = a if isinstance(a, list) else _steady(a, b)
        second = b if isinstance(b, list) else _steady(b, a)
        taken = choose(first[0], second[0])
        return [np.where(taken, x, y) for x, y in zip(first, second, strict=True)]

    return pick


def _logarithm(a: Jet) -> Jet:
    return composed(logarithm, a) if isinstance(a, list) else float(np.log(a))


def _length(*sides: Jet) -> Jet:
    return to_the(reduce(_plus, (times(one, one) for one in sides)), 0.5)


OPERATIONS: dict[str, Operation] = {
    "+": _plus,
    "-": lambda a, b: _plus(a, b, -1.0),
    "*": times,
    "/": _over,
}
"""Those of a chain."""
CALLS: dict[str, Callable[..., Jet]] = {
    "max": lambda *args: reduce(_chosen(np.greater_equal), args),
    "min": lambda *args: reduce(_chosen(np.less_equal), args),
    "hypot": _length,
    "pow": to_the,
    "log": lambda a, base: _over(_logarithm(a), _logarithm(base)),
}
"""Calls with several arguments."""
