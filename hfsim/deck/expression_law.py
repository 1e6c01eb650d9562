"""A law of time that is stated as an expression of t, with its exact derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any, TypeAlias

import numpy as np

from hfsim.deck.expressions import Node, evaluated, names_in
from hfsim.deck.functions_of_time import JUMPS, KINKED, OF_TIME, RULES
from hfsim.deck.jets import CALLS, OPERATIONS, Jet, Operation, composed, times, to_the
from hfsim.deck.laws import Law
from hfsim.maths.arrays import Array, BoolArray

TIME = "t"
"""The name of time in an expression."""
SAMPLES = 4000
"""Equal parts of a run at whose ends a law is looked at: what lasts less may be missed."""
MOST_TURNS = 200
"""Turning points at which steps end; a law with more of them oscillates, and steps end at some."""
_SMALLEST = 1e-12
"""Change between samples, over the range of all, that counts as none."""
_QUIET = 1e-6
"""The same that may be missed beside a pulse."""
_PULSE = 1 / 16
"""Part of a run within which a law that is quiet before and behind has a pulse: longer ones are seen."""
_BISECTIONS = 60
_ZOOM, _ZOOMS = 16, 20
"""Parts of its distance to which a smallest value is found each time, and how often: down to rounding."""
_UNEVEN = 4.0
"""Sizes next to a smallest one, over it, from which that is zero but for rounding."""
_BESIDE = 1e-6
"""Part of a run beside a switch where rates are compared."""

_DECLARE = "declare it under parameters, or use t"

_Function: TypeAlias = "Callable[[list[Any]], Jet]"
_Taken: TypeAlias = "tuple[tuple[Node, Node], ...]"
"""Calls of min and max, each with that of its arguments which is meant."""


def of_time(node: Node) -> bool:
    """Tell whether an expression depends on t."""
    return any(name.head == TIME for name in names_in(node))


def folded(node: Node) -> Node:
    """Return the same expression with numbers in place of all that does not depend on t.

    Raises
    ------
    ExpressionError
        Where that has no value.
    """
    if not of_time(node):
        return Node("number", "", (), evaluated(node, {}), node.start, node.end)
    args = [folded(one) for one in node.args]
    signs = node.head
    while node.kind == "chain" and args[0].kind == args[1].kind == "number":
        first = node._replace(head=signs[0], args=tuple(args[:2]))
        args[:2], signs = [folded(first)], signs[1:]
    return node._replace(head=signs, args=tuple(args))


def checked(node: Node) -> Node:
    """Return a folded expression that is a law.

    Raises
    ------
    ExpressionError
        Where a name is not t, a function cannot be taken of it, or a piece has no value.
    """
    for name in names_in(node):
        if name.head != TIME:
            hint = f"did you mean '{TIME}'?" if name.head.lower() == TIME else _DECLARE
            raise name.wrong(f"there is no '{name.head}'", hint)
    for one in _calls(node):
        if one.head not in OF_TIME and of_time(one):
            kind = "jumps" if one.head in JUMPS else "cannot be taken"
            raise one.wrong(f"{one.head} of t {kind}, and no law may do so", f"of t: {', '.join(OF_TIME)}")
    return folded(node)


def _calls(node: Node) -> Iterator[Node]:
    if node.kind == "call":
        yield node
    for one in node.args:
        yield from _calls(one)


def _function(node: Node) -> _Function:
    """Return what takes time, with as many derivatives as are wanted, to the jet of a folded expression."""
    if node.kind == "name":
        return lambda t: t
    if node.kind == "number":
        return lambda t: node.value
    args = [_function(one) for one in node.args]
    if node.kind == "chain":
        operations = [OPERATIONS[sign] for sign in node.head]
        return partial(_chained, args[0], list(zip(operations, args[1:], strict=True)))
    if node.kind == "negative":
        return lambda t: times(-1.0, args[0](t))
    if node.kind == "power":
        return lambda t: to_the(args[0](t), args[1](t))
    if len(args) == 1 and node.head in RULES:
        rule = RULES[node.head]
        return lambda t: composed(rule, args[0](t))  # type: ignore[arg-type]
    call = CALLS[node.head]
    return lambda t: call(*(one(t) for one in args))


def _chained(first: _Function, steps: Sequence[tuple[Operation, _Function]], t: list[Any]) -> Jet:
    value = first(t)
    for operation, one in steps:
        value = operation(value, one(t))
    return value


@dataclass(frozen=True)
class ExpressionLaw(Law):
    """An expression of t; `tree` is folded and has no other name in it."""

    tree: Node

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how it is made elsewhere: what is made of it is of one process."""
        return ExpressionLaw, (self.tree,)

    @cached_property
    def _function(self) -> _Function:
        return _function(self.tree)

    def breaks(self, order: int, t_end: float = math.inf) -> Array:
        """Return kinks and, up to the end, where the derivative of this order turns round or has a pulse."""
        if not math.isfinite(t_end):
            return np.zeros(0)
        t = _times(t_end)
        with np.errstate(all="ignore"):
            y = self._derivative(t, order)
            turns = _turning_points(t, y)
            found = [_pulses(t, y), *(_zeros(one, t) for one in _switches(self.tree))]
            loud = np.flatnonzero(self._is_loud(t)) if self._turning else np.zeros(0, dtype=int)
        every = -(-len(turns) // MOST_TURNS) or 1
        fades = t[1:][loud[-1:][loud[-1:] < SAMPLES]]
        return np.concatenate([turns[::every], fades, *(zeros[:MOST_TURNS] for zeros in found)])

    def period(self, begin: float, end: float, t_end: float) -> float:
        """Return the time in which the argument of a sine or cosine turns once where it turns fastest [s]."""
        if not self._turning:
            return math.inf
        t, rates = _times(t_end), _fastest(self, t_end)
        first, last = np.searchsorted(t, begin, side="right") - 1, np.searchsorted(t, end)
        fastest = float(rates[max(first, 0) : last + 1].max(initial=0.0))
        return 2.0 * math.pi / fastest if fastest else math.inf

    @cached_property
    def _turning(self) -> tuple[_Function, ...]:
        """Arguments of sines and cosines of time."""
        return tuple(map(_function, _turning(self.tree)))

    def turning_rates(self, t: Array) -> Array:
        """Return the largest rate at which they turn [rad/s], zero where the law hardly changes by it."""
        with np.errstate(all="ignore"):
            jets = [one([t, 1.0]) for one in self._turning]
            every = np.abs([one[1] * self._is_loud(t) for one in jets if isinstance(one, list)])
        return np.asarray(np.where(np.isfinite(every), every, 0.0).max(axis=0, initial=0.0))

    def _is_loud(self, t: Array) -> BoolArray:
        """Return when its rate is not next to nothing beside the largest of these times."""
        rate = np.abs(self._derivative(t, 1))
        return np.asarray(~(rate <= _QUIET * rate[np.isfinite(rate)].max(initial=0.0)))

    def trouble(self, t_end: float, orders: Sequence[int]) -> tuple[float, str] | None:
        """Return when, until the end, it or one of its derivatives is not finite, and what that is."""
        t = _times(t_end)
        with np.errstate(all="ignore"):
            for divisor, taken in _divisors(self.tree):
                touched = _touched(divisor, t)
                found = np.concatenate([_changes(divisor, t), touched[_kept(taken, touched)]])
                if len(found):
                    return float(found.min()), "it divides by zero"
            for order in orders:
                wrong = np.flatnonzero(~np.isfinite(self._derivative(t, order)))
                if len(wrong):
                    what = ("it", "its rate", "its acceleration")[order]
                    return float(t[wrong[0]]), f"{what} is not finite"
        return None

    def jump(self, t_end: float) -> float | None:
        """Return when, until the end, its rate jumps where a function of t switches."""
        t = _times(t_end)
        with np.errstate(all="ignore"):
            places = np.concatenate([t[:0], *(_zeros(one, t) for one in _switches(self.tree))])
            around = places[:, None] + _BESIDE * t_end * np.array([-2.0, -1.0, 1.0, 2.0])
            rates = self._derivative(around.ravel(), 1).reshape(-1, 4).T
            change = np.abs(2.0 * rates[2] - rates[3] - (2.0 * rates[1] - rates[0]))
            jumps = places[change > _QUIET * np.abs(self._derivative(t, 1)).max()]
        return float(jumps.min()) if len(jumps) else None

    def _derivative(self, t: Array, order: int) -> Array:
        with np.errstate(all="ignore"):  # what is not finite ends the run by itself
            jet = self._function([t, 1.0, 0.0][: order + 1])
        found = jet[order] if isinstance(jet, list) else jet * (order == 0)
        return found if isinstance(found, np.ndarray) and found.shape == t.shape else np.full(t.shape, found)


def _turning_points(t: Array, y: Array) -> Array:
    """Return where samples turn from growing to falling or back, at the vertex of the parabola there."""
    change = np.diff(y)
    wide = np.abs(change) > _SMALLEST * np.ptp(y)
    kept = np.flatnonzero(wide)
    turned = np.flatnonzero(np.diff(np.sign(change[kept])))
    before, behind = kept[turned], kept[turned + 1]
    vertex = 0.5 * (change[before] + change[behind]) / (change[before] - change[behind])
    level = behind > before + 1
    inner = np.where(level, 0.0, vertex)
    return np.concatenate([t[before + 1] + inner * (t[1] - t[0]), t[behind[level]]])


def _pulses(t: Array, y: Array) -> Array:
    """Return where samples begin and end to change for less long than they stay: no stage may be there."""
    active = np.abs(np.diff(y)) > _QUIET * np.ptp(y)
    flips = np.flatnonzero(np.diff(active, prepend=False, append=False)).reshape(-1, 2)
    lasts, stays = np.diff(flips, axis=1)[:, 0], np.diff(flips.ravel(), prepend=-len(t), append=2 * len(t))
    alone = lasts < np.minimum(_PULSE * len(t), np.minimum(stays[:-1:2], stays[2::2]))
    return t[flips[alone].ravel()]


def _switches(node: Node) -> Iterator[Callable[[Array], Array]]:
    """Yield the functions of time at whose zeros the rate of an expression may jump."""
    if node.kind == "call" and node.head in KINKED and of_time(node):
        for a, b in [(node.args[0], None)] if len(node.args) == 1 else _pairs(node.args):
            yield lambda t, a=a, b=b: _value(a, t) - (0.0 if b is None else _value(b, t))  # type: ignore[misc]
    for one in node.args:
        yield from _switches(one)


def _divisors(node: Node, taken: _Taken = ()) -> Iterator[tuple[Callable[[Array], Array], _Taken]]:
    """Yield the functions of time at whose zeros an expression has a pole, each with what `_kept` takes."""
    yield from ((divisor, taken) for divisor in _own_divisors(node))
    for one in node.args:
        yield from _divisors(one, (*taken, (node, one)) if node.head in ("max", "min") else taken)


def _kept(taken: _Taken, t: Array) -> BoolArray:
    """Tell when min and max, if any are given, take what is in them."""
    kept = np.ones(t.shape, dtype=bool)
    for node, one in taken:
        kept &= _value(node, t) == _value(one, t)
    return kept


def _own_divisors(node: Node) -> Iterator[Callable[[Array], Array]]:
    """Yield those of an expression that are not of a part of it."""
    if node.kind == "chain":
        divisors = [one for sign, one in zip(node.head, node.args[1:], strict=True) if sign == "/"]
        yield from (partial(_value, one) for one in divisors if of_time(one))
    elif (node.kind == "power" or node.head == "pow") and of_time(node.args[0]):
        yield partial(_base, node.args[0], node.args[1])
    elif node.head == "tan" and of_time(node):
        yield lambda t: np.cos(_value(node.args[0], t))


def _base(base: Node, exponent: Node, t: Array) -> Array:
    """Return what a power divides by, of the sign of the quotient; NaN where it does not divide."""
    x, n = _value(base, t), _value(exponent, t)
    return np.where(n < 0.0, np.where(n % 2.0 == 1.0, x, np.abs(x)), np.nan)


@lru_cache(maxsize=16)
def _times(t_end: float) -> Array:
    """Return the times at which laws are looked at."""
    return np.linspace(0.0, t_end, SAMPLES + 1)


@lru_cache(maxsize=1000)
def _fastest(law: ExpressionLaw, t_end: float) -> Array:
    """Return the turning rates of a law at these times."""
    return law.turning_rates(_times(t_end))


def _turning(node: Node) -> Iterator[Node]:
    """Yield the arguments of sines and cosines of time."""
    if node.kind == "call" and node.head in ("sin", "cos") and of_time(node):
        yield node.args[0]
    for one in node.args:
        yield from _turning(one)


def _pairs(nodes: Sequence[Node]) -> Iterator[tuple[Node, Node]]:
    return ((a, b) for k, a in enumerate(nodes) for b in nodes[:k])


def _value(node: Node, t: Array) -> Array:
    jet = _function(node)([t])
    return jet[0] if isinstance(jet, list) else np.full_like(t, jet)


def _zeros(function: Callable[[Array], Array], t: Array) -> Array:
    """Return where a function changes its sign, or is zero at a sample."""
    return np.concatenate([_changes(function, t), t[1:-1][function(t)[1:-1] == 0.0]])


def _touched(function: Callable[[Array], Array], t: Array) -> Array:
    """Return where the size of a function has a minimum next to a sample that is zero but for rounding."""

    def size(t: Array) -> Array:
        return np.nan_to_num(np.abs(function(t.ravel())), nan=np.inf, posinf=np.inf).reshape(t.shape)

    y = np.pad(size(t), 1, constant_values=np.inf)
    place = t[(y[1:-1] < y[:-2]) & (y[1:-1] <= y[2:]), None]
    width = np.full_like(place, t[1] - t[0])
    for _ in range(_ZOOMS):
        near = np.clip(place + width * np.linspace(-1.0, 1.0, 2 * _ZOOM + 1), t[0], t[-1])
        y = size(near)
        place = np.take_along_axis(near, y.argmin(axis=1)[:, None], axis=1)
        width = np.maximum(width / _ZOOM, _ZOOM * np.spacing(place))
    least, most = y.min(axis=1), np.where(np.isinf(y), 0.0, y).max(axis=1)
    found: Array = place[(least == 0.0) | (most > _UNEVEN * least), 0]
    return found


def _changes(function: Callable[[Array], Array], t: Array) -> Array:
    """Return where a function changes its sign between samples, by bisection."""
    sign = np.sign(function(t))
    changes = np.flatnonzero(sign[:-1] * sign[1:] < 0)
    low, high, below = t[changes], t[changes + 1], sign[changes]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        same = np.sign(function(middle)) == below
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return high
