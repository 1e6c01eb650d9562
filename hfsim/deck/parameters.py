"""Parameters of a deck, and the expressions that stand in place of numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from graphlib import CycleError, TopologicalSorter
from typing import Any

from hfsim.deck.expression_law import TIME, checked
from hfsim.deck.expressions import (
    CONSTANTS,
    FUNCTIONS,
    ExpressionError,
    Node,
    bound,
    evaluated,
    names_in,
    parsed,
    substituted,
)
from hfsim.deck.reader import Path
from hfsim.deck.source import DeckSource, OverrideProblem, did_you_mean
from hfsim.deck.units import UNITS, UnitError, parse_quantity, quantity_of_any_kind
from hfsim.errors import DeckProblem

_OPENING = "${"
_WHOLE = re.compile(r"(\s*\$\{)([^{}]*)\}\s*([^{}$]*)")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_EXACT = 2**53
"""Whole numbers below are exact."""

_parsed = lru_cache(maxsize=1000)(parsed)


class _UnknownError(Exception):
    """A parameter has no value, which has been told."""


def _no_number(text: str) -> tuple[str, str]:
    """Return what is wrong with text that is no quantity of any kind, and what would be right."""
    message, hint = f"must be a number, not '{text}'", f'a unit, or "${{{text.strip()}}}"'
    try:
        _parsed(text)
    except ExpressionError:
        try:
            parse_quantity(text, "dimensionless")
        except UnitError as error:
            units = [unit for known in UNITS.values() for unit in known]
            meant = error.hint if error.hint.endswith("?") else ""  # else it lists units of plain numbers
            message, hint = str(error), did_you_mean(error.unit, units) if error.unit else meant
    return message, hint


@dataclass
class Values:
    """Values of the parameters, and what is worked out with them; what is wrong is noted.

    Attributes
    ----------
    bad : set of str
        Parameters without a value, which has been told.
    used : set of str
        Names in expressions.
    units : dict of str to str
        SI units of parameters that are stated with one.
    kinds : str
        What names may be of.
    """

    source: DeckSource
    known: dict[str, float] = field(default_factory=dict)
    bad: set[str] = field(default_factory=set)
    used: set[str] = field(default_factory=set)
    units: dict[str, str] = field(default_factory=dict)
    kinds: str = "parameter"

    @contextmanager
    def knowing(self, indices: Mapping[str, float]) -> Iterator[None]:
        """Know the indices of a copy inside the block."""
        outside, self.known = self.known, {**self.known, **indices}
        yield
        self.known = outside

    # Parameters ----------------------------------------------------------------------------------

    def read(self) -> None:
        """Work out all parameters, in whatever order they stand."""
        stated = self.source.data.get("parameters")
        if stated is not None and not isinstance(stated, dict):
            problem = self.source.problem(("parameters",), "must be a map of names to numbers")
            self.source.fail(("parameters",), problem)
        stated = stated if isinstance(stated, dict) else {}
        waiting: dict[str, list[str]] = {}
        for name, value in stated.items():
            if why := no_name(name):
                self._refuse(name, *why, on_key=True)
            elif isinstance(value, str) and _OPENING in value:
                waiting[name] = list(self._needed(value))
            else:
                self._take(name, value)
        for name in self._ordered(waiting):
            worked_out = self.number(("parameters", name), stated[name])
            if worked_out is None:
                self.bad.add(name)
            else:
                self._take(name, worked_out)

    def _needed(self, value: str) -> Iterator[str]:
        if match := _WHOLE.fullmatch(value):
            try:
                yield from (name.head for name in names_in(_parsed(match[2])))
            except ExpressionError:
                return  # it is told when the value is worked out

    def _ordered(self, waiting: dict[str, list[str]]) -> list[str]:
        """Return the names so that each comes after those it needs; refuse those that need themselves."""
        left = {name: [one for one in needed if one in waiting] for name, needed in waiting.items()}
        while True:
            try:
                return list(TopologicalSorter(left).static_order())
            except CycleError as error:
                circle = error.args[1][:0:-1]
                shown = " -> ".join([*circle[:8], *(["..."] if len(circle) > 8 else []), circle[0]])
                self._refuse(circle[0], f"needs itself: {shown}")
                self.bad.update(circle)
                kept = {name: needed for name, needed in left.items() if name not in circle}
                left = {name: [one for one in needed if one not in circle] for name, needed in kept.items()}

    def _take(self, name: str, value: object) -> None:
        if isinstance(value, str):
            found = quantity_of_any_kind(value)
            if found is None:
                self._refuse(name, *_no_number(value))
                return
            value, self.units[name] = found[0], found[1].strip("-")
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._refuse(name, "must be a number, text with a unit or an expression")
        elif not math.isfinite(value):
            self._refuse(name, f"must be finite, not {value}")
        else:
            self.known[name] = float(value)

    def _refuse(self, name: str, message: str, hint: str = "", on_key: bool = False) -> None:
        path = ("parameters", name)
        self.source.fail(path, self.source.problem(path, message, hint, on_key))
        self.bad.add(name)

    def refuse_unused(self) -> None:
        """Refuse what is set from outside and neither the deck declares nor any expression uses."""
        stated = self.source.data.get("parameters")
        stated = stated if isinstance(stated, dict) else {}
        for name in stated:
            path = ("parameters", name)
            declared = path in self.source.key_marks or not self.source.is_overridden(path)
            if not declared and name not in self.used | self.bad:
                why = "no expression uses it, and the deck has no such parameter"
                self._refuse(name, why, did_you_mean(name, [one for one in stated if one != name]))

    # Entries -------------------------------------------------------------------------------------

    def work_out(self) -> None:
        """Put numbers in place of all expressions of the deck, and into those of laws."""
        for key, value in self.source.data.items():
            if key != "parameters":
                self.fill(self.source.data, (key,), value)
        self.refuse_unused()

    def fill(self, holder: Any, path: Path, value: Any) -> None:
        """Put numbers in place of the expressions at a path and below it."""
        if path in self.source.indices:
            with self.knowing(self.source.indices[path]):
                self._fill(holder, path, value)
        else:
            self._fill(holder, path, value)

    def _fill(self, holder: Any, path: Path, value: Any) -> None:
        if isinstance(value, dict):
            for key, one in value.items():
                if key == "expression" and isinstance(one, str):
                    value[key] = self._law((*path, key), one)
                else:
                    self.fill(value, (*path, key), one)
        elif isinstance(value, list):
            for index, one in enumerate(value):
                self.fill(value, (*path, index), one)
        elif isinstance(value, str) and _OPENING in value:
            number = self.number(path, value)
            if number is not None:
                holder[path[-1]] = number

    def number(self, path: Path, text: str) -> float | str | None:
        """Return the value of an entry with an expression, text if it has a unit; None if wrong."""
        match = _WHOLE.fullmatch(text)
        if match is None:
            self.source.fail(path, self.source.problem(path, *_askew(text)))
            return None
        value = self.value(path, text, match.span(2))
        if value is None:
            return None
        if match[3]:
            return f"{value!r} {match[3].strip()}"
        return int(value) if value.is_integer() and abs(value) < _EXACT else value

    def value(self, path: Path, text: str, part: tuple[int, int], on_key: bool = False) -> float | None:
        """Return the value of the expression in a part of an entry's text, or of its key; None if wrong."""
        try:
            return evaluated(self._with_values(_parsed(text[slice(*part)])), {})
        except (ExpressionError, _UnknownError) as error:
            self._note(path, text, part[0], error, on_key)
            return None

    def _law(self, path: Path, text: str) -> str:
        """Return the expression of a law with values in place of parameters; the same where it is wrong."""
        try:
            if _OPENING in text:
                hint = "write the parameter's name alone"
                raise ExpressionError("here parameters stand without ${ }", hint, text.index(_OPENING), 2)
            tree = _parsed(text, time=TIME)
            checked(self._with_values(tree, TIME))
        except (ExpressionError, _UnknownError) as error:
            self._note(path, text, 0, error)
            return text
        return substituted(text, tree, self.known)

    def _with_values(self, tree: Node, *others: str) -> Node:
        """Return an expression with values in place of parameters.

        Raises
        ------
        ExpressionError
            Where a name is neither a parameter nor one of the others.
        _UnknownError
            Where a parameter has no value.
        """
        names = list(names_in(tree))
        self.used.update(name.head for name in names)
        for name in names:
            if name.head in self.bad:
                raise _UnknownError
            if name.head not in self.known and name.head not in others:
                raise name.wrong(f"there is no {self.kinds} '{name.head}'", self._hint(name.head, others))
        return bound(tree, self.known)

    def _hint(self, name: str, others: Sequence[str]) -> str:
        if name in FUNCTIONS:
            return f"write {name}(...)"
        if name == TIME:
            return "time stands in laws only: {expression: ...}"
        near = did_you_mean(name, [*others, *self.known, *self.bad, *CONSTANTS])
        return near if self.known or near.endswith("?") else ", or use ".join([_DECLARE, *others])

    def _note(
        self, path: Path, text: str, shift: int, error: ExpressionError | _UnknownError, on_key: bool = False
    ) -> None:
        """Note what is wrong in an entry's text, at the very piece where that can be seen in the file."""
        if isinstance(error, _UnknownError):
            self.source.fail(path)
            return
        problem = self.source.problem(path, error.message, error.hint, on_key)
        if not isinstance(problem, OverrideProblem):
            problem = self._placed(problem, text, shift + error.start, error.width)
        self.source.fail(path, problem)

    def _placed(self, problem: DeckProblem, text: str, start: int, width: int) -> DeckProblem:
        lines = self._lines if not problem.file else self.source.others[problem.file].splitlines()
        line = lines[problem.line - 1] if problem.line <= len(lines) else ""
        for at in (problem.column - 1, problem.column):  # plain, or behind a quote
            if line.startswith(text, at):
                column = min(at + start, len(line) - 1) + 1
                return DeckProblem(
                    problem.path, problem.message, problem.hint, problem.line, column, width, problem.file
                )
        return problem

    @cached_property
    def _lines(self) -> list[str]:
        return self.source.text.splitlines()


_DECLARE = "declare it under parameters"


def no_name(name: str) -> tuple[str, str] | None:
    """Return why a word cannot be the name of a parameter or an index."""
    if not _NAME.fullmatch(name):
        return f"'{name}' cannot be a name", "letters, digits and '_', not starting with a digit"
    if name == TIME:
        return f"'{name}' is time in laws", "choose another name"
    if name in FUNCTIONS or name in CONSTANTS:
        return f"'{name}' is taken by mathematics", "choose another name"
    return None


def _askew(text: str) -> tuple[str, str]:
    """Return what is wrong with a text in which an expression is not the whole, save for a unit."""
    if "}" not in text.partition(_OPENING)[2]:
        return "this '${' is never closed", 'write "${length / 2}"'
    hint = 'write "${length / 2}" or "${angle} deg"' + ', in names "blade{k}"' * (text.find(_OPENING) > 0)
    return "an expression is the whole entry, or all but its unit", hint
