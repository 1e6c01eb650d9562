"""Exceptions of hfsim; each carries the exit code its kind ends the program with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

MOST_PROBLEMS = 500
"""Problems of a deck that are looked for; whoever makes more of them makes one mistake many times."""
_SHOWN = 50
"""Problems of a deck that are told."""
_LONGEST = 400
"""Characters of a message about a deck; whole lists of names may be in it."""
_WIDEST = 100
"""Characters marked in a line of a deck, half of those shown of a long line."""


def clipped(text: str) -> str:
    """Return a text without the middle part that makes it too long for a message."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 60]} ... {text[-50:]}"


class HfsimError(Exception):
    """Base class of everything hfsim raises on purpose."""

    exit_code = 1

    def __reduce__(self) -> tuple[Any, ...]:
        # what a class takes and what its text is made of need not be the same
        return _revived, (type(self), self.args), self.__dict__


def _revived(kind: type[HfsimError], args: tuple[Any, ...]) -> HfsimError:
    """Return an error as it was in another process, but for its attributes."""
    return kind.__new__(kind, *args)


class KernelError(HfsimError):
    """``HFSIM_KERNEL`` asks for what is not there."""

    exit_code = 2


class ArgumentError(HfsimError):
    """An argument of a function that cannot be meant so."""

    exit_code = 2


class UnfinishedRunError(HfsimError):
    """A run from Python that failed, missed its target or met a limit; ``run`` has what was computed."""

    def __init__(self, run: Any) -> None:
        self.run, self.exit_code = run, run.exit_code
        super().__init__(f"{run.name}: {run.status} at t = {run.stop_time:.6g} s: {run.reason}")


@dataclass(frozen=True, eq=False)
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
    file : str
        The file it stands in; empty where that is the deck's own.
    """

    path: str
    message: str
    hint: str = ""
    line: int = 0
    column: int = 0
    width: int = 1
    file: str = ""

    def headline(self, file: str, kind: str = "error") -> str:
        """Return place, kind, what is wrong and what would be right, in one line."""
        file = self.file or file
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        what = f"{clipped(self.path)}: {clipped(self.message)}" if self.path else clipped(self.message)
        line = f"{place}: {kind}: {what}" + (f" ({clipped(self.hint)})" if self.hint else "")
        return line.replace("\n", "\\n")


class DeckError(HfsimError):
    """A deck (or an override of it) that cannot be run; carries every problem found.

    Attributes
    ----------
    file, text : str
        The deck.
    others : mapping of str to str
        Texts of other files that problems stand in.
    """

    exit_code = 2

    def __init__(
        self, file: str, problems: list[DeckProblem], text: str = "", others: Mapping[str, str] | None = None
    ) -> None:
        self.file = file
        self.problems = problems
        self.text = text
        self.others = others or {}
        super().__init__(self.render())

    def render(self) -> str:
        """Return all problems as ``file:line:column``, the line with a caret, and the remedy."""
        shown = self.problems[:_SHOWN]
        lines = {one.file: self.others.get(one.file, "").splitlines() for one in shown}
        lines[""] = self.text.splitlines()
        blocks = [self._render_problem(problem, lines[problem.file]) for problem in shown]
        count = len(self.problems)
        if count > _SHOWN:
            blocks.append(f"... and {'at least ' if count > MOST_PROBLEMS else ''}{count - _SHOWN} more")
        blocks.append(f"{count} error{'s' if count != 1 else ''}. Nothing was run.")
        return "\n".join(blocks)

    def _render_problem(self, problem: DeckProblem, lines: list[str]) -> str:
        head = problem.headline(self.file)
        if not 0 < problem.line <= len(lines):
            return head
        source, column = _around(lines[problem.line - 1], problem.column)
        caret = " " * (column - 1) + "^" * min(max(1, problem.width), _WIDEST)
        return f"{head}\n{problem.line:5d} | {source}\n      | {caret}"


def _around(line: str, column: int) -> tuple[str, int]:
    """Return a line, or its piece around a column, on paper: tabs and the like are one column wide each."""
    start = max(0, column - 1 - _WIDEST // 2) if len(line) > 2 * _WIDEST else 0
    piece = line[start : start + 2 * _WIDEST]
    return "".join(char if char.isprintable() else " " for char in piece), column - start


class NoStartError(DeckError):
    """A deck whose start, an equilibrium or a steady rotation, is not found with its models."""


class Terminated(KeyboardInterrupt):
    """A signal that ends a program, taken as an interruption from the keyboard is; ``name`` is its name."""

    def __init__(self, name: str = "SIGTERM") -> None:
        super().__init__(name)
        self.name = name


class Interrupted(KeyboardInterrupt):
    """An interruption of a call from Python; ``found`` is what it would return, as far as it came."""

    def __init__(self, words: str, found: Any = None) -> None:
        super().__init__(words)
        self.found = found


INTERRUPTIONS = (130, 143)
"""Exit codes of a program that a signal has ended."""


def interruption_code(stop: KeyboardInterrupt) -> int:
    """Return the exit code of a program that an interruption has ended."""
    return 143 if isinstance(stop, Terminated) else 130


def interruption_words(stop: KeyboardInterrupt) -> str:
    """Return what interrupted a program."""
    if isinstance(stop, Terminated):
        return f"ended by the signal {stop.name}"
    return "interrupted from the keyboard"


@dataclass(eq=False, repr=False)
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
