"""Exceptions of hfsim; each carries the exit code its kind ends the program with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


class HfsimError(Exception):
    """Base class of everything hfsim raises on purpose."""

    exit_code = 1


@dataclass(frozen=True)
class DeckProblem:
    """One thing that is wrong with a deck.

    Attributes
    ----------
    path : str
        Dotted path of the entry, e.g. ``bodies.b1.length``.
    message : str
        What is wrong.
    hint : str
        What would be right; may be empty.
    line, column : int
        Position in the file, counted from 1; 0 where the problem has no place in the file.
    width : int
        Length of the marked text.
    """

    path: str
    message: str
    hint: str = ""
    line: int = 0
    column: int = 0
    width: int = 1


class DeckError(HfsimError):
    """A deck (or an override of it) that cannot be run; carries every problem found."""

    exit_code = 2

    def __init__(self, file: str, problems: list[DeckProblem], text: str = "") -> None:
        self.file = file
        self.problems = problems
        self.text = text
        super().__init__(self.render())

    def render(self) -> str:
        """Return all problems as ``file:line:column``, the line with a caret, and the remedy."""
        lines = self.text.splitlines()
        blocks = [self._render_problem(problem, lines) for problem in self.problems]
        count = len(self.problems)
        blocks.append(f"{count} error{'s' if count != 1 else ''}. Nothing was run.")
        return "\n".join(blocks)

    def _render_problem(self, problem: DeckProblem, lines: list[str]) -> str:
        place = f"{self.file}:{problem.line}:{problem.column}" if problem.line else self.file
        head = f"{place}: error: {problem.path + ': ' if problem.path else ''}{problem.message}"
        if problem.hint:
            head += f" ({problem.hint})"
        if not 0 < problem.line <= len(lines):
            return head
        source = lines[problem.line - 1]
        caret = " " * (problem.column - 1) + "^" * max(1, problem.width)
        return f"{head}\n{problem.line:5d} | {source}\n      | {caret}"


class Terminated(KeyboardInterrupt):
    """A signal that ends a program, taken as an interruption from the keyboard is; ``name`` is its name."""

    def __init__(self, name: str = "SIGTERM") -> None:
        super().__init__(name)
        self.name = name


def interruption_code(stop: KeyboardInterrupt) -> int:
    """Return the exit code of a program that an interruption has ended."""
    return 143 if isinstance(stop, Terminated) else 130


@dataclass
class SolverFailure(HfsimError):  # noqa: N818
    """The integration could not go on: the solver failed or the model broke down.

    Attributes
    ----------
    reason : str
        What happened.
    time : float
        When [s].
    item : str
        Dotted deck path of what is to blame; empty where nothing is.
    kind : str
        ``numerical``, ``model``, ``physical`` or ``deck``.
    evidence : dict
        JSON-ready facts the kind rests on.
    remedy : str
        The next thing to try.
    cause : str
        Why, in words that hold as long as the kind does.
    """

    exit_code = 3

    reason: str
    time: float
    item: str = ""
    kind: str = "numerical"
    evidence: dict[str, Any] = field(default_factory=dict)
    remedy: str = ""
    cause: str = ""

    def __str__(self) -> str:
        return f"{self.reason}: {self.cause}" if self.cause else self.reason

    def facts(self, line_of: Callable[[str], int]) -> dict[str, Any]:
        """Return what summaries say of the failure; ``line_of`` gives the deck line of a path, 0 for none."""
        return {
            "class": self.kind,
            "item": self.item,
            "line": (line_of(self.item) or None) if self.item else None,
            "time": self.time,
            "evidence": self.evidence,
            "try": self.remedy,
        }


class LimitReached(HfsimError):  # noqa: N818
    """A stated limit (steps, time) ended the run before its end."""

    exit_code = 5

    def __init__(self, reason: str, time: float | None = None) -> None:
        self.reason = reason
        self.time = time
        super().__init__(reason)
