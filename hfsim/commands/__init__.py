"""Sub-commands, one file each, and what they share: options, messages, finding and loading decks.

Nothing but click and the standard library is imported at the top of any of these files.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from hfsim.errors import DeckError, HfsimError

if TYPE_CHECKING:
    from hfsim.output.runfolder import RunFolder
    from hfsim.output.writers import Provenance
    from hfsim.scene.loading import LoadedDeck

STARTED = time.perf_counter()
"""When the program started, near enough [s]."""

CASES = Path(__file__).resolve().parent.parent / "scene" / "cases"
"""Decks shipped with hfsim."""

_SEVERITY = (0, 4, 5, 3, 2, 1, 130, 143)
"""Exit codes from harmless to grave."""

_SECONDS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}

_Function = TypeVar("_Function", bound=Callable[..., Any])


class DeckNotFoundError(HfsimError):
    """The deck named on the command line is neither a file nor a shipped case."""

    exit_code = 2


def worst(codes: Iterable[int]) -> int:
    """Return the gravest of several exit codes: 0 < 4 < 5 < 3 < 2 < 1 < 130 < 143; others count as 1.

    Examples
    --------
    >>> worst([0, 3, 5, 4])
    3
    """
    known = (code if code in _SEVERITY else 1 for code in codes)
    return max(known, key=_SEVERITY.index, default=0)


# --- options -------------------------------------------------------------------------------------


def _stacked(*options: Callable[[Any], Any]) -> Callable[[_Function], _Function]:
    def decorate(function: _Function) -> _Function:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def _note_verbose(ctx: click.Context, _: click.Parameter, value: bool) -> bool:
    ctx.find_root().meta["verbose"] = value  # what `report_error` asks when things go wrong
    return value


deck_options = _stacked(
    click.option(
        "--set", "overrides", multiple=True, metavar="KEY=VALUE",
        help="Change an entry of the deck, e.g. bodies.b1.elements=8; may be repeated.",
    ),
)  # fmt: skip

model_option = click.option("--model", metavar="MODEL", help="Short for --set solve.model=MODEL.")

keep_all_option = click.option(
    "--keep-all",
    is_flag=True,
    help="Leave nothing out: short for --set solve.keep_all=true; see 'hfsim plan'.",
)

output_options = _stacked(
    click.option("-o", "--output", type=click.Path(path_type=Path), metavar="DIR", help="Where results go."),
    click.option("--force", is_flag=True, help="Replace the results of a finished run."),
    click.option("--no-plots", is_flag=True, help="Draw no pictures."),
)

talk_options = _stacked(
    click.option("-q", "--quiet", is_flag=True, help="Print errors only (and the JSON, with --json)."),
    click.option("-v", "--verbose", is_flag=True, callback=_note_verbose, help="Tell more; show tracebacks."),
    click.option("--json", "as_json", is_flag=True, help="Print JSON, one object on a line, not text."),
)


def parse_budget(text: str) -> float:
    """Return a time in seconds.

    Examples
    --------
    >>> parse_budget("60s"), parse_budget("2 min"), parse_budget("90")
    (60.0, 120.0, 90.0)

    Raises
    ------
    click.BadParameter
        If it is none.
    """
    found = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(ms|s|min|h)?\s*", text)
    value = float(found[1]) * _SECONDS[found[2] or "s"] if found else 0.0
    if value <= 0.0:
        raise click.BadParameter(f"'{text}' is no time; write e.g. 60s or 2min")
    return value


def time_option(name: str, words: str, default: str | None = None) -> Callable[[Any], Any]:
    """Return an option that takes a time: seconds, or None where none is given and there is no default."""
    return click.option(
        f"--{name}",
        default=default,
        show_default=default is not None,
        metavar="TIME",
        callback=lambda _, __, text: None if text is None else parse_budget(text),
        help=words,
    )


jobs_option = click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=min(2, os.cpu_count() or 1),
    show_default=True,
    help="Processes at a time.",
)


def names(text: str | None) -> tuple[str, ...]:
    """Return the parts of a text between commas, each once.

    Examples
    --------
    >>> names("gauss, radau,gauss"), names(None)
    (('gauss', 'radau'), ())
    """
    return tuple(dict.fromkeys(part.strip() for part in (text or "").split(",") if part.strip()))


def refuse_unknown(kind: str, given: Sequence[str], known: Iterable[str]) -> None:
    """Refuse names that are not known.

    Raises
    ------
    click.UsageError
        Naming the first unknown one, and those there are.
    """
    for name in given:
        if name not in known:
            raise click.UsageError(f"there is no {kind} '{name}'; there are {', '.join(known)}")


# --- messages ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Talk:
    """Results to standard output, everything else to standard error.

    Attributes
    ----------
    quiet, verbose, as_json : bool
        The options of these names.
    """

    quiet: bool = False
    verbose: bool = False
    as_json: bool = False

    def result(self, text: str) -> None:
        """Print a result for people; silent under ``-q`` and ``--json``."""
        if not (self.quiet or self.as_json):
            print_out(text)

    def facts(self, facts: object) -> None:
        """Print a result for programs on one line; only under ``--json``."""
        if self.as_json:
            print_out(json.dumps(facts, allow_nan=False, ensure_ascii=False))

    def note(self, text: str) -> None:
        """Tell something useful to know; silent under ``-q``."""
        if not self.quiet:
            print_error(text)

    def detail(self, text: str) -> None:
        """Tell something only ``-v`` asks for."""
        if self.verbose and not self.quiet:
            print_error(text)


def print_out(text: str) -> None:
    """Print to standard output; a reader that went away (``| head``) is no error."""
    try:
        click.echo(text)
    except BrokenPipeError:
        _redirect_to_nowhere(1)


def print_error(text: str) -> None:
    """Print to standard error."""
    try:
        click.echo(text, err=True)
    except BrokenPipeError:
        _redirect_to_nowhere(2)


def _redirect_to_nowhere(descriptor: int) -> None:
    # the file descriptor itself, or Python would complain when it flushes at exit
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)


def report_error(error: Exception) -> int:
    """Tell what went wrong and return the exit code; a traceback only under ``-v`` or HFSIM_DEBUG."""
    if isinstance(error, DeckError):
        print_error(str(error))
    elif isinstance(error, HfsimError):
        print_error(f"error: {error}")
    else:
        print_error(f"internal error: {type(error).__name__}: {error}")
    _show_traceback(error)
    return error.exit_code if isinstance(error, HfsimError) else 1


def _show_traceback(error: Exception) -> None:
    context = click.get_current_context(silent=True)
    verbose = context is not None and context.find_root().meta.get("verbose", False)
    if verbose or os.environ.get("HFSIM_DEBUG"):
        import traceback

        print_error("".join(traceback.format_exception(error)))
    elif not isinstance(error, HfsimError):
        print_error("This is a mistake in hfsim, not in your deck; -v shows where it happened.")


def plural(count: int, word: str) -> str:
    """Return a count with its noun.

    Examples
    --------
    >>> plural(1, "body"), plural(2, "body"), plural(3, "joint")
    ('1 body', '2 bodies', '3 joints')
    """
    if count == 1:
        return f"1 {word}"
    return f"{count} {word[:-1]}ies" if word.endswith("y") else f"{count} {word}s"


def as_table(rows: Sequence[Sequence[str]], indent: str = "  ") -> str:
    """Return rows of cells as lines with aligned columns; the first column is left-aligned, the others right.

    Examples
    --------
    >>> print(as_table([["model", "cpu"], ["ancf", "0.1 s"]]))
      model    cpu
      ancf   0.1 s
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = [first.ljust(widths[0]), *(c.rjust(w) for c, w in zip(others, widths[1:], strict=True))]
        lines.append((indent + "  ".join(cells)).rstrip())
    return "\n".join(lines)


def brief(value: float | None) -> str:
    """Return a number with two digits for a table; a dash for one that is not known."""
    return "-" if value is None else f"{value:.1e}"


# --- decks ---------------------------------------------------------------------------------------


def shipped_cases() -> dict[str, Path]:
    """Return the decks shipped with hfsim by name."""
    return {path.stem: path for path in sorted(CASES.glob("*.yaml"))}


def find_deck(argument: str, talk: Talk) -> Path:
    """Return the deck a command-line argument means.

    Parameters
    ----------
    argument : str
        A file, or the bare name of a shipped case.
    talk : Talk
        Is told when a shipped case is taken.

    Returns
    -------
    Path
        An existing file.

    Raises
    ------
    DeckNotFoundError
        If there is neither; the message names what comes near.
    """
    path = Path(argument)
    if path.is_file():
        return path
    cases = shipped_cases()
    if argument in cases:
        talk.note(f"{argument}: using the shipped case {cases[argument]}")
        return cases[argument]
    if path.is_dir():
        raise DeckNotFoundError(f"{argument} is a folder; name a deck, e.g. {path / 'case.yaml'}")
    raise DeckNotFoundError(f"there is no deck {argument}{_near(path, list(cases))}. Nothing was run.")


def _near(path: Path, cases: list[str]) -> str:
    if path.stem in cases:
        return f" (a shipped case has that name: use '{path.stem}')"
    folder = path.parent if path.parent.is_dir() else Path()
    files = [file.name for file in folder.glob("*.y*ml")]
    near = difflib.get_close_matches(path.name, files, 1) or difflib.get_close_matches(path.stem, cases, 1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def load_decks(
    arguments: Sequence[str], overrides: Sequence[str], talk: Talk, finish: Callable[[LoadedDeck], object]
) -> list[LoadedDeck]:
    """Load every deck before anything is done with any, and report the problems of all.

    Parameters
    ----------
    arguments : sequence of str
        Files or names of shipped cases.
    overrides : sequence of str
        ``key=value`` settings for all of them.
    talk : Talk
        For notes.
    finish : callable
        Further checks of a loaded deck; a `HfsimError` from it counts as the deck's.

    Returns
    -------
    list of LoadedDeck
        One for each argument.

    Raises
    ------
    click.exceptions.Exit
        With code 2 if any deck is bad; its problems have been printed then.
    """
    from hfsim.scene.loading import load_deck

    loaded, codes = [], []
    for argument in arguments:
        try:
            deck = load_deck(find_deck(argument, talk), tuple(overrides))
            finish(deck)
            loaded.append(deck)
        except HfsimError as error:
            codes.append(report_error(error))
    if codes:
        raise click.exceptions.Exit(worst(codes))
    return loaded


def assemble(loaded: LoadedDeck) -> None:
    """Build a deck's scene and throw it away, to find what only then shows.

    Raises
    ------
    DeckError
        If it cannot be built.
    """
    from hfsim.simulate import check

    check(loaded)


def with_numbers(loaded: LoadedDeck, talk: Talk) -> LoadedDeck:
    """Return a deck with the default elements where it says auto, and say so: for all commands but `run`."""
    if not loaded.auto_elements:
        return loaded
    from hfsim.parts.bodies.beam import DEFAULT_ELEMENTS

    beams = ", ".join(loaded.auto_elements)
    words = f"elements: auto of {beams} taken as {DEFAULT_ELEMENTS}"
    talk.note(f"{loaded.deck.name}: {words}; only hfsim run chooses them")
    return loaded.with_numbers()


def with_settings(overrides: Sequence[str], model: str | None, keep_all: bool = False) -> tuple[str, ...]:
    """Return the overrides with ``--model`` and ``--keep-all`` among them; they win over ``--set``."""
    own = [f"solve.model={model}"] if model else []
    return (*overrides, *own, *(["solve.keep_all=true"] if keep_all else []))


def claim_study(output: Path | None, deck_name: str, suffix: str, marker: str, force: bool) -> RunFolder:
    """Ask for the folder of a study; `marker` is the file that tells that one there is whole.

    Raises
    ------
    FolderError
        If a finished study stands there, or the folder cannot be written to.
    """
    from hfsim.output.runfolder import FolderError, claim, folder_name

    path = output or Path(folder_name(deck_name, suffix))
    if (path / marker).exists() and not force:
        raise FolderError(f"{path} already holds a study; use --force to replace it, or -o DIR")
    return claim(path, force, marker=marker)


def provenance_of(loaded: LoadedDeck, argument: str, overrides: Sequence[str]) -> Provenance:
    """Return where a run of this deck comes from."""
    from hfsim.output.writers import Provenance

    return Provenance(
        source=argument,
        deck_sha256=loaded.deck_sha256,
        overrides=tuple(overrides),
        resolved=loaded.deck.resolved(),
    )


def command_line() -> str:
    """Return the command line as the user typed it, near enough, for the log."""
    import shlex

    return shlex.join(["hfsim", *sys.argv[1:]])
