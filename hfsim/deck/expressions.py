"""Arithmetic in decks: text such as ``length / 2 + 3 cm`` to a tree, and a tree to a number.

Nothing of Python ever runs: the text is read by a grammar of its own, which knows numbers, units after
numbers, names, ``+ - * / **``, brackets and calls of the functions listed here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from hfsim.deck.source import did_you_mean
from hfsim.deck.units import words_of_units

LONGEST = 1000
"""Characters of an expression."""
DEEPEST = 40
"""Brackets, calls, signs and powers within one another."""
_GROWTH = 30
"""How many times as long an expression may be after numbers have taken the place of names."""
_SIGNED = 3
"""Pieces that a negative number is within those around the name it took the place of."""
_LARGEST_FACTORIAL = 170
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)|(?P<sign>\*\*|[-+*/(),])|(?P<end>\Z)|(?P<other>.))",
    re.DOTALL,
)
_ALLOWED = "numbers, parameters, + - * / ** ( ) and functions such as sin"


class ExpressionError(ValueError):
    """Text that is no expression, or one without a finite value.

    Attributes
    ----------
    start, width : int
        Which piece of the text is wrong, in characters.
    """

    def __init__(self, message: str, hint: str = "", start: int = 0, width: int = 1) -> None:
        super().__init__(message)
        self.message, self.hint, self.start, self.width = message, hint, start, max(width, 1)


class Node(NamedTuple):
    """A piece of an expression.

    Attributes
    ----------
    kind : str
        ``number``, ``name``, ``call``, ``negative``, ``power``, or ``chain``: operations from left to right.
    head : str
        Name, or function, or the operators of a chain, one character each.
    value : float
        Of a number, units included.
    start, end : int
        Place in the text.
    """

    kind: str
    head: str
    args: tuple[Node, ...]
    value: float
    start: int
    end: int

    def wrong(self, message: str, hint: str = "") -> ExpressionError:
        """Return the exception that refuses this piece."""
        return ExpressionError(message, hint, self.start, self.end - self.start)


class _Token(NamedTuple):
    kind: str
    text: str
    start: int

    @property
    def end(self) -> int:
        return self.start + len(self.text)

    def wrong(self, message: str, hint: str = "") -> ExpressionError:
        return ExpressionError(message, hint, self.start, len(self.text))


def _factorial(x: float) -> float:
    if not (x.is_integer() and 0.0 <= x <= _LARGEST_FACTORIAL):
        raise ValueError
    return float(math.factorial(int(x)))


_ONE = "acos acosh asin asinh atan atanh cbrt ceil cos cosh degrees erf erfc exp exp2 expm1 fabs floor gamma"
_MORE = "lgamma log10 log1p log2 radians sin sinh sqrt tan tanh trunc"
FUNCTIONS: dict[str, tuple[int, int, Callable[..., float]]] = {
    **{name: (1, 1, getattr(math, name)) for name in f"{_ONE} {_MORE}".split()},
    **{name: (2, 2, getattr(math, name)) for name in ("atan2", "copysign", "fmod", "pow", "remainder")},
    "abs": (1, 1, abs),
    "factorial": (1, 1, _factorial),
    "hypot": (1, LONGEST, math.hypot),
    "log": (1, 2, math.log),
    "max": (1, LONGEST, max),
    "min": (1, LONGEST, min),
}
"""Functions by name: fewest and most arguments, and what computes them."""

CONSTANTS = {"pi": math.pi, "tau": math.tau, "e": math.e}


def parsed(text: str, grown: bool = False, time: str = "") -> Node:
    """Return the tree of an expression.

    Parameters
    ----------
    grown : bool
        Whether numbers have taken the place of names in it.
    time : str
        Its name where the expression may be of it: behind a number it is no unit then.

    Raises
    ------
    ExpressionError
        With the first piece that has no place in one.
    """
    if len(text) > (_GROWTH * LONGEST if grown else LONGEST):
        raise ExpressionError(f"an expression has at most {LONGEST} characters, not {len(text)}")
    return _Parser(text, DEEPEST + _SIGNED * grown, time).whole()


class _Parser:
    """Reads an expression from left to right."""

    def __init__(self, text: str, deepest: int, time: str) -> None:
        self._tokens, self._deepest, self._time = list(_tokens(text)), deepest, time
        self._at = self._depth = 0

    @property
    def _next(self) -> _Token:
        return self._tokens[self._at]

    def _take(self, *texts: str) -> _Token | None:
        token = self._next
        if token.text not in texts or token.kind != "sign":
            return None
        self._at += 1
        return token

    def whole(self) -> Node:
        """Return the tree of all."""
        tree = self._chain()
        if self._next.kind != "end":
            self._refuse("an operator must stand before {}")
        return tree

    def _chain(self, signs: tuple[str, ...] = ("+", "-")) -> Node:
        read = self._product if signs == ("+", "-") else self._factor
        args, found = [read()], ""
        while sign := self._take(*signs):
            found += sign.text
            args.append(read())
        return args[0] if not found else Node("chain", found, tuple(args), 0.0, args[0].start, args[-1].end)

    def _product(self) -> Node:
        return self._chain(("*", "/"))

    def _deeper(self) -> None:
        self._depth += 1
        if self._depth > self._deepest:
            raise self._next.wrong(f"more than {self._deepest} pieces within one another")

    def _factor(self) -> Node:
        self._deeper()
        if sign := self._take("-", "+"):
            inner = self._factor()
            node = Node("negative", "", (inner,), 0.0, sign.start, inner.end) if sign.text == "-" else inner
        else:
            node = self._atom()
            if self._take("**"):
                power = self._factor()
                node = Node("power", "", (node, power), 0.0, node.start, power.end)
        self._depth -= 1
        return node

    def _atom(self) -> Node:
        token = self._next
        if self._take("("):
            inner = self._chain()
            return inner._replace(start=token.start, end=self._close(token).end)
        if token.kind == "number":
            return self._number(token)
        if token.kind != "name":
            self._refuse("a number, a name or a bracket must stand in place of {}")
        self._at += 1
        if opening := self._take("("):
            return self._call(token, opening)
        return Node("name", token.text, (), 0.0, token.start, token.end)

    def _number(self, token: _Token) -> Node:
        self._at += 1
        value, unit = float(token.text), self._next
        if unit.kind != "name":
            return Node("number", "", (), _finite(value, token), token.start, token.end)
        if unit.text == self._time:
            meant = f"did you mean '{token.text} * {unit.text}'?"
            raise unit.wrong(f"an operator must stand before '{unit.text}'", meant)
        units = words_of_units()
        if unit.text not in units:
            near = did_you_mean(unit.text, units)
            hint = near if near.endswith("?") else "write * between factors, units with / after the brace"
            raise unit.wrong(f"'{unit.text}' is no unit that can stand in an expression", hint)
        self._at += 1
        return Node("number", "", (), _finite(value * units[unit.text], token), token.start, unit.end)

    def _call(self, name: _Token, opening: _Token) -> Node:
        if name.text not in FUNCTIONS:
            raise name.wrong(f"there is no function '{name.text}'", did_you_mean(name.text, FUNCTIONS))
        args = [] if self._next.text == ")" else [self._chain()]
        while self._take(","):
            args.append(self._chain())
        end = self._close(opening).end
        least, most, _ = FUNCTIONS[name.text]
        if not least <= len(args) <= most:
            wanted = f"{least}" if least == most else f"{least} or more" if most == LONGEST else "1 or 2"
            raise name.wrong(f"{name.text} takes {wanted} numbers, not {len(args)}")
        return Node("call", name.text, tuple(args), 0.0, name.start, end)

    def _close(self, opening: _Token) -> _Token:
        closing = self._take(")")
        if closing is None and self._next.kind == "end":
            raise opening.wrong("this bracket is never closed")
        if closing is None:
            self._refuse("an operator or a closing bracket must stand before {}")
        assert closing is not None
        return closing

    def _refuse(self, message: str) -> None:
        """Refuse the next token."""
        token, hint = self._next, ""
        if token.kind == "end":
            raise token.wrong("an expression is not complete" if self._at else "an expression is empty")
        if token.kind == "other":
            message = "{} has no place in an expression"
            hint = "** raises to a power" if token.text == "^" else _ALLOWED
        raise token.wrong(message.format(f"'{token.text}'" if token.text.isprintable() else "this"), hint)


def _tokens(text: str) -> Iterator[_Token]:
    at = 0
    while True:
        match = _TOKEN.match(text, at)
        assert match is not None and match.lastgroup is not None
        kind = match.lastgroup
        yield _Token(kind, match[kind], match.start(kind))
        if kind == "end":
            return
        at = match.end()


def _finite(value: float, token: _Token) -> float:
    if not math.isfinite(value):
        raise token.wrong("this number is too large")
    return value


def names_in(node: Node) -> Iterator[Node]:
    """Yield the names in an expression, constants aside."""
    if node.kind == "name" and node.head not in CONSTANTS:
        yield node
    for one in node.args:
        yield from names_in(one)


def evaluated(node: Node, values: Mapping[str, float]) -> float:
    """Return the value of an expression.

    Parameters
    ----------
    values : mapping of str to float
        Of all names in it.

    Raises
    ------
    ExpressionError
        Where it has none, or none that is finite.
    """
    if node.kind == "number":
        return node.value
    if node.kind == "name":
        return CONSTANTS[node.head] if node.head in CONSTANTS else values[node.head]
    args = [evaluated(one, values) for one in node.args]
    try:
        value = _applied(node, args)
    except ZeroDivisionError:
        raise node.wrong("a division by zero") from None
    except OverflowError:
        raise node.wrong("the result is too large") from None
    except (ValueError, TypeError):
        raise node.wrong(f"{node.head} has no value at {', '.join(f'{one:g}' for one in args)}") from None
    if isinstance(value, complex):
        raise node.wrong(f"the power {args[1]:g} of {args[0]:g} is complex")
    if not math.isfinite(value):
        raise node.wrong("the result is not finite")
    return float(value)


def _applied(node: Node, args: list[float]) -> float:
    if node.kind == "call":
        return FUNCTIONS[node.head][2](*args)
    if node.kind == "negative":
        return -args[0]
    if node.kind == "power":
        result: float = args[0] ** args[1]
        return result
    value = args[0]
    for sign, one in zip(node.head, args[1:], strict=True):
        value = _OPERATIONS[sign](value, one)
    return value


_OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}


def bound(node: Node, values: Mapping[str, float]) -> Node:
    """Return the same expression with numbers in place of some names."""
    if node.kind == "name" and node.head in values:
        return node._replace(kind="number", value=values[node.head])
    return node._replace(args=tuple(bound(one, values) for one in node.args))


def substituted(text: str, node: Node, values: Mapping[str, float]) -> str:
    """Return the text of an expression with numbers in place of names; it may be longer than `LONGEST`."""
    pieces, at = [], 0
    for name in sorted((one for one in names_in(node) if one.head in values), key=lambda one: one.start):
        value = values[name.head]
        pieces += [text[at : name.start], repr(value) if value >= 0 else f"({value!r})"]
        at = name.end
    return "".join([*pieces, text[at:]])
