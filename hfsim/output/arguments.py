"""What calls from Python take, and what is said of what they do not take."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from hfsim.deck.ranges import written
from hfsim.deck.source import Setting, did_you_mean
from hfsim.errors import ArgumentError, Interrupted
from hfsim.output.pictures import FORMATS
from hfsim.scene.loading import LoadedDeck

if TYPE_CHECKING:
    from hfsim.output.study import Study
    from hfsim.output.talk import Destination
    from hfsim.studies.cluster import Workers
    from hfsim.studies.farm import Executor

AnyDeck: TypeAlias = "LoadedDeck | Mapping[str, Any] | str | os.PathLike[str]"
"""A file, the name of a shipped case, a deck's data, or a deck that is loaded."""


def deck_text(deck: Mapping[str, Any]) -> str:
    """Return the data of a deck as YAML."""
    import yaml

    return yaml.safe_dump(json.loads(plain("an entry of deck", deck)), sort_keys=False, allow_unicode=True)


def settings(changes: Mapping[str, Any] | None) -> list[Setting]:
    """Return changes as overrides of a deck."""
    pairs = mapping("changes", changes, '{"bodies.b1.length": 2.0}').items()
    return [Setting.by("changes", f"{path}={plain(f'changes: {path}', value)}") for path, value in pairs]


def mapping(argument: str, value: Mapping[str, Any] | None, example: str) -> Mapping[str, Any]:
    """Return a map of entries of a deck; None stands for an empty one.

    Raises
    ------
    ArgumentError
        If it is none.
    """
    if not isinstance(value, Mapping | None):
        raise ArgumentError(f"{argument} is {_a(value)}: it maps entries to values, {example}")
    return value or {}


def model_setting(model: str | None) -> list[Setting]:
    """Return a model that is asked for as an override."""
    return [] if model is None else [Setting.by("model", f"solve.model={plain('model', model)}")]


def plain(what: str, value: Any) -> str:
    """Return JSON, which is YAML too, of plain data and NumPy's numbers and arrays."""

    def plainer(one: Any) -> Any:
        other = one.tolist() if hasattr(one, "tolist") else one
        if type(other) is not type(one):  # a number longer than those of Python stays what it is
            return other
        if isinstance(one, Real):
            return float(one)
        raise ArgumentError(f"{what} is {_a(one)}: a deck has numbers, text, lists and maps")

    try:
        return json.dumps(value, default=plainer)
    except (TypeError, ValueError, ArithmeticError, RecursionError) as error:
        raise ArgumentError(f"{what} cannot be part of a deck: {error}") from error


def no_deck(value: object) -> ArgumentError:
    """Return what refuses something that is no deck."""
    return ArgumentError(
        f"deck is {_a(value)}: give a file, the name of a shipped case, the data of a deck as a mapping, "
        "or what hfsim.load returns"
    )


def _a(value: object) -> str:
    return "None" if value is None else f"of type {type(value).__name__}"


def several(argument: str, names: Sequence[str] | str | None) -> tuple[str, ...]:
    """Return names; a text is one of them, None stands for none.

    Raises
    ------
    ArgumentError
        If they are no texts.
    """
    if names is None or isinstance(names, str):
        return () if names is None else (names,)
    if not isinstance(names, Iterable):
        raise ArgumentError(f"{argument} is {_a(names)}: it is a sequence of texts")
    found = tuple(names)
    if wrong := [name for name in found if not isinstance(name, str)]:
        raise ArgumentError(f"{argument} has an entry {_a(wrong[0])}: it is a sequence of texts")
    return found


def one_of(argument: str, name: str, known: Collection[str]) -> None:
    """Refuse a word that is not known."""
    if name not in known:
        raise ArgumentError(f"{argument} is {name!r}: {did_you_mean(str(name), known)}")


def positive(**given: float | None) -> None:
    """Refuse what is not a positive number; None stands for a default."""
    for argument, value in given.items():
        if value is not None and not (_is_number(value) and 0.0 < value < math.inf):
            raise ArgumentError(f"{argument}: {value} is no positive number")


def real(**given: float | None) -> None:
    """Refuse what is no number; None stands for a default."""
    for argument, value in given.items():
        if value is not None and not _is_number(value):
            raise ArgumentError(f"{argument} is {_a(value)}: it is a number")


def integral(**given: int | None) -> None:
    """Refuse what is no whole number; None stands for a default."""
    real(**given)
    for argument, value in given.items():
        if value is not None and not isinstance(value, Integral):
            raise ArgumentError(f"{argument} is {value}: it is a whole number")


def timed(repeats: int) -> None:
    """Refuse what does not say how often something is timed."""
    integral(repeats=repeats)
    if repeats < 1:
        raise ArgumentError(f"repeats is {repeats}: what is short is timed once at least")


def flags(**given: bool) -> None:
    """Refuse what is neither true nor false: any text would count as true."""
    for argument, value in given.items():
        if not _is_flag(value):
            raise ArgumentError(f"{argument} is {_shown(value)}: it is True or False")


def callback(**given: Callable[..., object] | None) -> None:
    """Refuse what cannot be called; None stands for nothing to call."""
    for argument, value in given.items():
        if value is not None and not callable(value):
            raise ArgumentError(f"{argument} is {_shown(value)}: it is a function")


def _is_flag(value: object) -> bool:
    own = value.tolist() if hasattr(value, "tolist") else value
    return isinstance(own, int) and own in (0, 1)


def _shown(value: object) -> str:
    return repr(value) if isinstance(value, str | int | float) else _a(value)


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def numbers(argument: str, values: Any, kind: type[float] = float) -> tuple[Any, ...]:
    """Return positive numbers, each once; a number alone is one of them.

    Raises
    ------
    ArgumentError
        If one is not positive, or not whole where `kind` is int.
    """
    every = tuple(dict.fromkeys(_each(values)))
    for one in every:
        if not (_is_number(one) and 0.0 < one < math.inf and (kind is float or kind(one) == one)):
            what = "whole number above 0" if kind is int else "positive number"
            raise ArgumentError(f"{argument}: {one!r} is no {what}")
    return tuple(map(kind, every))


def reals(argument: str, values: Any) -> tuple[float, ...]:
    """Return numbers; a number alone is one of them.

    Raises
    ------
    ArgumentError
        If one is none.
    """
    for one in (every := _each(values)):
        if not _is_number(one):
            raise ArgumentError(f"{argument}: {one!r} is no number")
    return tuple(map(float, every))


def _each(values: Any) -> list[Any]:
    values = values.tolist() if hasattr(values, "tolist") else values
    return list(values) if isinstance(values, Iterable) and not isinstance(values, str) else [values]


def values_text(argument: str, values: Any) -> str:
    """Return the values of an entry as text, as the command line has them."""
    if isinstance(values, str):
        return values
    values = values.tolist() if hasattr(values, "tolist") else values
    every = [*values] if isinstance(values, Iterable) and not isinstance(values, Mapping) else [values]
    texts = [value_text(argument, value) for value in every]
    alone = len(texts) == 1 and texts[0].startswith("[")
    return f"[{texts[0]}]" if alone else ", ".join(texts)


def value_text(argument: str, value: Any) -> str:
    """Return one value of an entry as text."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, str):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return written(float(value))
    return plain(argument, value)


def workers(jobs: int, dask: str, dask_config: str | os.PathLike[str] | None) -> Workers:
    """Return where jobs are done; 0 jobs stand for all cores."""
    from hfsim.studies.cluster import Workers

    if jobs < 0:
        raise ArgumentError(f"jobs is {jobs}: so many processes do nothing; 0 is all cores")
    if dask and dask_config is not None:
        raise ArgumentError("dask and dask_config are one or the other")
    return Workers(jobs or os.cpu_count() or 1, dask, None if dask_config is None else Path(dask_config))


def finished(found: Any, interrupted: bool, executor: Executor | None = None) -> None:
    """Raise what has ended a study before its end: a cluster that was lost, or a signal."""
    if executor is not None and executor.lost:
        from hfsim.studies.cluster import ClusterLost

        raise ClusterLost(executor.lost)
    if interrupted:
        raise Interrupted("interrupted from the keyboard", found)


_ARGUMENTS = {
    "--force": "force=True",
    "--resume": "resume=True",
    "-o DIR": "another output",
    "with -o": "as output",
}
"""What options of commands are called here."""


@contextmanager
def in_arguments() -> Iterator[None]:
    """Say by arguments, not by options, what can be done about a folder that must not be written to."""
    from hfsim.output.runfolder import FolderError
    from hfsim.output.sweep_folder import ResumeError

    try:
        yield
    except (FolderError, ResumeError) as error:
        text = str(error)
        for option, argument in _ARGUMENTS.items():
            text = text.replace(option, argument)
        raise type(error)(text) from None


def check_format(plots: bool | str) -> None:
    """Refuse a format that pictures do not have."""
    if not isinstance(plots, str):
        flags(plots=plots)
    elif plots not in FORMATS:
        raise ArgumentError(f"plots have no format '{plots}'; there are {', '.join(FORMATS)}")


def destination(
    output: str | os.PathLike[str] | None, force: bool, plots: bool | str, **also: object
) -> Destination | None:
    """Return where results go; None where they are to be written nowhere.

    Parameters
    ----------
    plots : bool or str
        Whether pictures are drawn, or their format.
    also : object
        Other arguments that say what is written.

    Raises
    ------
    ArgumentError
        If there is no such folder or format, or something is said of what is written, and no folder.
    """
    check_format(plots)
    flags(force=force)
    if output is not None:
        from hfsim.output.talk import Destination

        return Destination(place(output), force, bool(plots), plots if isinstance(plots, str) else FORMATS[0])
    for name, value in {"force": force, **also}.items():
        if value:
            raise ArgumentError(f"{name}={value!r} is of results in a folder: name it, output=FOLDER")
    return None


def place(output: str | os.PathLike[str]) -> Path:
    """Return a folder; an empty name, as of a variable that is not set, is not the current one."""
    if not isinstance(output, str | os.PathLike):
        raise ArgumentError(f"output is {_a(output)}: it is the path of a folder")
    if not os.fspath(output):
        raise ArgumentError("output is empty: it names no folder; '.' is the current one")
    return Path(output)


def study_in(kind: str, to: Destination | None, of: LoadedDeck | str) -> Study | None:
    """Return the study of a deck, or of a name, with its folder granted and nothing of it told.

    None where it is to be written nowhere.
    """
    from hfsim.output.study import Study
    from hfsim.output.talk import Talk
    from hfsim.output.writers import Provenance

    if to is None:
        return None
    name = of if isinstance(of, str) else of.deck.name
    about = {} if isinstance(of, str) else Provenance.of(of, of.source.file, of.overrides).facts()
    with in_arguments():
        return Study.claim(kind, to, name, Talk(quiet=True), about)
