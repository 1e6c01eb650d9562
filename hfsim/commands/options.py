"""Options that several sub-commands take, and how their values are read."""

from __future__ import annotations

import functools
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

import click

from hfsim.output.pictures import FORMATS
from hfsim.output.talk import Destination, Talk

if TYPE_CHECKING:
    from hfsim.studies.cluster import Workers

_Option: TypeAlias = Callable[[Any], Any]

_SECONDS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _gathered(name: str, make: Callable[..., object], **options: _Option) -> Callable[[_Function], _Function]:
    """Return a decorator that adds options and hands their values, made into one, to the parameter `name`."""

    def decorate(function: _Function) -> _Function:
        @functools.wraps(function)
        def call(**values: object) -> object:
            made = make(**{key: values.pop(key) for key in options})
            return function(**{name: made}, **values)

        for option in reversed(options.values()):
            call = option(call)
        return cast(_Function, call)

    return decorate


def _note_verbose(ctx: click.Context, _: click.Parameter, value: bool) -> bool:
    ctx.find_root().meta["verbose"] = value  # what `report_error` asks when things go wrong
    return value


class Place(click.Path):
    """A file or folder; an empty name, as of a variable that is not set, is not the current folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the place that a word of the command line names."""
        if value == "":
            self.fail("the name is empty", param, ctx)
        return super().convert(value, param, ctx)


PLACE = Place(path_type=Path)
"""Type of options that name a file or folder."""


class Finite(click.FloatRange):
    """A number in a range; one that is no number or infinite is in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number that a word of the command line says."""
        number = super().convert(value, param, ctx)
        return number if math.isfinite(number) else self.fail(f"'{value}' is not finite", param, ctx)


POSITIVE = Finite(min=0.0, min_open=True)
"""Type of options that take a positive number."""


def setting_options(*also: str) -> Callable[[_Function], _Function]:
    """Return options that change the deck: ``--set`` and those named of ``model`` and ``keep_all``.

    A command gets all of them as one parameter ``overrides``, a tuple of ``KEY=VALUE``.
    """
    return _gathered("overrides", with_settings, **{key: _SETTINGS[key] for key in ("overrides", *also)})


_SETTINGS = {
    "overrides": click.option(
        "--set", "overrides", multiple=True, metavar="KEY=VALUE",
        help="Change an entry of the deck, e.g. bodies.b1.elements=8; may be repeated.",
    ),
    "model": click.option("--model", metavar="MODEL", help="Short for --set solve.model=MODEL."),
    "keep_all": click.option(
        "--keep-all", is_flag=True,
        help="Leave nothing out: short for --set solve.keep_all=true; see 'hfsim plan'.",
    ),
}  # fmt: skip


def with_settings(
    overrides: Sequence[str], model: str | None = None, keep_all: bool = False
) -> tuple[str, ...]:
    """Return the overrides with ``--model`` and ``--keep-all`` among them; they win over ``--set``."""
    from hfsim.deck.source import Setting

    own = [Setting.by("--model", f"solve.model={model}")] if model else []
    return (*overrides, *own, *(["solve.keep_all=true"] if keep_all else []))


output_options = _gathered(
    "to",
    lambda output, force, no_plots, kind: Destination(output, force, not no_plots, kind),
    output=click.option(
        "-o", "--output", type=PLACE, metavar="DIR", help="Where results go."
    ),
    force=click.option("--force", is_flag=True, help="Replace the results of a finished run."),
    no_plots=click.option("--no-plots", is_flag=True, help="Draw no pictures."),
    kind=click.option(
        "--format", "kind", type=click.Choice(FORMATS), default=FORMATS[0], show_default=True,
        help="Of pictures.",
    ),
)  # fmt: skip
"""A command gets these as one parameter ``to``, a `Destination`."""

talk_options = _gathered(
    "talk",
    Talk,
    quiet=click.option("-q", "--quiet", is_flag=True, help="Print errors only (and the JSON, with --json)."),
    verbose=click.option(
        "-v", "--verbose", is_flag=True, callback=_note_verbose, help="Tell more; show tracebacks."
    ),
    as_json=click.option(
        "--json", "as_json", is_flag=True, help="Print JSON, one object on a line, not text."
    ),
)
"""A command gets these as one parameter ``talk``, a `Talk`."""


def parse_time(text: str) -> float:
    """Return a time in seconds.

    Examples
    --------
    >>> parse_time("60s"), parse_time("2 min"), parse_time("0")
    (60.0, 120.0, 0.0)

    Raises
    ------
    click.BadParameter
        If it is none.
    """
    found = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(ms|s|min|h)?\s*", text)
    if not found:
        raise click.BadParameter(f"'{text}' is no time; write e.g. 60s or 2min")
    return float(found[1]) * _SECONDS[found[2] or "s"]


def parse_budget(text: str) -> float:
    """Return a time in seconds in which something can be done; raise `click.BadParameter` if it is none."""
    if not (value := parse_time(text)):
        raise click.BadParameter(f"in {text} nothing can be done; write e.g. 60s or 2min")
    return value


def seconds(text: str) -> float:
    """Return a time in seconds, with a unit or without.

    Examples
    --------
    >>> seconds("20 ms"), seconds("0.5")
    (0.02, 0.5)

    Raises
    ------
    ValueError
        If it is none.
    """
    from hfsim.deck.units import parse_quantity

    try:
        return float(text)
    except ValueError:
        return parse_quantity(text, "time")


def moment_option(words: str, default: str | None = None) -> _Option:
    """Return the option ``--at``, a time of the scene from 0 on: seconds, or None where none is given."""

    def read(_: click.Context, __: click.Parameter, text: str | None) -> float | None:
        if text is None:
            return None
        with suppress(ValueError):
            if 0.0 <= (moment := seconds(text)) < math.inf:
                return moment
        raise click.BadParameter(f"'{text}' is no time from 0 on; write e.g. 0.5 or 20 ms")

    return click.option("--at", default=default, show_default=True, metavar="T", callback=read, help=words)


def period_option(words: str) -> _Option:
    """Return the option ``--period``: seconds, from a time or from how often; None where none is given."""

    def read(_: click.Context, __: click.Parameter, text: str | None) -> float | None:
        if text is None:
            return None
        from hfsim.deck.units import parse_quantity

        for meant in (
            seconds,
            lambda text: 2.0 * math.pi / parse_quantity(text, "angular_velocity"),
            lambda text: 1.0 / parse_quantity(text, "frequency"),
        ):
            with suppress(ValueError, ZeroDivisionError):
                if 0.0 < (period := meant(text)) < math.inf:
                    return period
        raise click.BadParameter(f"'{text}' is no period; write e.g. 0.5, 20 ms, 50 Hz, 40 rad/s or 600 rpm")

    return click.option("--period", metavar="T", callback=read, help=words)


def time_option(name: str, words: str, default: str | None = None) -> _Option:
    """Return an option that takes a time: seconds, or None where none is given and there is no default."""
    return click.option(
        f"--{name}",
        default=default,
        show_default=default is not None,
        metavar="TIME",
        callback=lambda _, __, text: None if text is None else parse_budget(text),
        help=words,
    )


def count_option(name: str, default: int, words: str) -> _Option:
    """Return an option that says how many, one at least."""
    kind = click.IntRange(min=1)
    return click.option(f"--{name}", type=kind, default=default, show_default=True, help=words)


def _workers(jobs: int, dask: str, dask_config: Path | None) -> Workers:
    from hfsim.studies.cluster import Workers

    if dask and dask_config is not None:
        raise click.UsageError("--dask and --dask-config are one or the other")
    return Workers(jobs, dask, dask_config)


def _workers_options(jobs: _Option) -> Callable[[_Function], _Function]:
    """Return options that say where jobs are done, as one parameter ``workers`` of a command, a `Workers`."""
    return _gathered(
        "workers",
        _workers,
        jobs=jobs,
        dask=click.option(
            "--dask", metavar="ADDRESS", default="",
            help="Work on a cluster of dask.distributed: its scheduler, tcp://HOST:8786, or local.",
        ),
        dask_config=click.option(
            "--dask-config", type=PLACE, metavar="FILE",
            help="Start a cluster as a YAML file says: "
            "cluster: dask_jobqueue.SLURMCluster, options, workers.",
        ),
    )  # fmt: skip


workers_options = _workers_options(count_option("jobs", os.cpu_count() or 1, "Processes at a time."))
"""Where jobs are done: without more, on all cores."""
timing_workers_options = _workers_options(
    count_option("jobs", 1, "Processes at a time; side by side, runs disturb one another's CPU times.")
)
"""The same where jobs are timed: one at a time unless more are asked for."""


def names(text: str | None) -> tuple[str, ...]:
    """Return the parts of a text between commas, each once.

    Examples
    --------
    >>> names("gauss, radau,gauss"), names(None)
    (('gauss', 'radau'), ())
    """
    return tuple(dict.fromkeys(part.strip() for part in (text or "").split(",") if part.strip()))


def not_both(resume: bool, force: bool) -> None:
    """Refuse to go on with what stands there and to replace it: raise `click.UsageError`."""
    if resume and force:
        raise click.UsageError("--resume and --force are one or the other")


@contextmanager
def as_usage() -> Iterator[None]:
    """Tell of arguments that cannot be meant so as of a bad command line: raise `click.UsageError`."""
    from hfsim.errors import ArgumentError

    try:
        yield
    except ArgumentError as error:
        raise click.UsageError(str(error)) from None


def refuse_unknown(kind: str, given: Iterable[str], known: Iterable[str], more: str = "") -> None:
    """Refuse names that are not known; see `hfsim.deck.source.refuse_unknown`."""
    from hfsim.deck.source import refuse_unknown as refuse

    with as_usage():
        refuse(kind, given, known, more)
