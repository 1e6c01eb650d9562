"""Which runs a sweep consists of: values of entries for each, by number, none of them kept as a deck."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from hfsim.deck.ranges import RangeError, Value, Values, as_value, read_values, written
from hfsim.errors import MOST_PROBLEMS, DeckError, DeckProblem, HfsimError
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen

SAMPLERS = ("lhs", "sobol", "random")
"""Ways to choose samples: a Latin hypercube, Sobol's sequence (scrambled), independent ones."""
MOST_RUNS = 10_000_000
"""Runs of a sweep."""
_INSIDE = 1e-12
"""Shares keep this distance from 0 and 1, where a distribution may have no value."""


VARY, TABLE, SAMPLE, SAMPLER, SEED = "--vary", "--table", "--sample", "--sampler", "--seed"
"""Options, as what is wrong with them is placed."""


class SweepError(HfsimError):
    """A sweep that cannot be made as it is asked for."""

    exit_code = 2


def refusal(option: str, message: str, hint: str = "") -> DeckError:
    """Return what refuses an option."""
    return DeckError(option, [DeckProblem("", message, hint, file=option)])


@frozen
class Plan:
    """The runs of a sweep.

    Attributes
    ----------
    paths : tuple of str
        Entries that are varied, dotted.
    count : int
        Runs.
    kind : str
        ``grid``, ``sample``, ``table`` or ``sensitivity``.
    facts : dict
        JSON-ready: what was asked for; plans with equal facts are equal.
    values : tuple of Values
        Of each path; of a table those that occur.
    row : callable
        Returns the values of a run; runs count from 0.
    """

    paths: tuple[str, ...]
    count: int
    kind: str
    facts: dict[str, Any]
    values: tuple[Values, ...]
    row: Callable[[int], tuple[Value, ...]] = field(repr=False)

    def told(self, number: int) -> tuple[Value, ...]:
        """Return the values of a run as tables have them; see `Values.in_si`."""
        return tuple(one.in_si(value) for one, value in zip(self.values, self.row(number), strict=True))

    def overrides(self, number: int) -> tuple[str, ...]:
        """Return what a run sets, ``KEY=VALUE``."""
        pairs = zip(self.paths, self.row(number), strict=True)
        return tuple(f"{path}={written(value)}" for path, value in pairs)

    @property
    def by_path(self) -> dict[str, Values]:
        """The values of each path."""
        return dict(zip(self.paths, self.values, strict=True))


def readable(vary: Mapping[str, str], random: bool) -> tuple[dict[str, Values], list[DeckProblem]]:
    """Return the values of each path, and what cannot be read; with `random` there may be distributions."""
    found, wrong = dict[str, Values](), list[DeckProblem]()
    for path, text in vary.items():
        if not text:
            hint = "write lin(first, last, count), log(...) or a, b, c"
            wrong.append(DeckProblem(path, "no values are said", hint, file=VARY))
            continue
        try:
            found[path] = read_values(text)
        except RangeError as error:
            wrong.append(DeckProblem(path, error.message, error.hint, file=VARY))
        else:
            if found[path].kind and not random:
                hint = f"say how many runs: {SAMPLE} N"
                wrong.append(DeckProblem(path, f"{text} is random", hint, file=VARY))
    return found, wrong


def read_all(vary: Mapping[str, str], random: bool) -> dict[str, Values]:
    """Return the values of each path; see `readable`.

    Raises
    ------
    DeckError
        With all that cannot be read.
    """
    found, wrong = readable(vary, random)
    if wrong:
        raise DeckError(VARY, wrong)
    if not found:
        raise refusal(VARY, "nothing is varied", "name entries with their values, or a table of runs")
    return found


def grid(vary: Mapping[str, str]) -> Plan:
    """Return the plan with all combinations of some values, the last path fastest.

    Raises
    ------
    DeckError
        If values cannot be read, are random, or are too many.
    """
    values = read_all(vary, random=False)
    lengths = [len(one.listed) for one in values.values()]
    listed = [one.listed for one in values.values()]
    facts = {"kind": "grid", "vary": dict(vary)}
    row = partial(_combined, listed, lengths)
    return Plan(tuple(values), _few(math.prod(lengths)), "grid", facts, tuple(values.values()), row)


def _combined(listed: Sequence[Sequence[Value]], lengths: Sequence[int], number: int) -> tuple[Value, ...]:
    return tuple(one[int(k)] for one, k in zip(listed, _places(number, lengths), strict=True))


def _places(number: int, lengths: Sequence[int]) -> list[int]:
    """Return the place on each axis of a run of a grid."""
    places = []
    for length in reversed(lengths):
        number, place = divmod(number, length)
        places.append(place)
    return places[::-1]


def sample(vary: Mapping[str, str], count: int, sampler: str = SAMPLERS[0], seed: int = 1) -> Plan:
    """Return a plan of random runs; of lists, every value is as likely as any other.

    Raises
    ------
    DeckError
        If values cannot be read, or there are none.
    """
    values = read_all(vary, random=True)
    shares = _shares(_few(count), len(values), sampler, seed)
    spread = tuple(values.values())
    digest = hashlib.sha256(np.round(shares, 9).tobytes()).hexdigest()
    facts = {"kind": "sample", "vary": dict(vary), "count": count, "sampler": sampler, "seed": seed}
    row = partial(_drawn, spread, shares)
    return Plan(tuple(values), count, "sample", {**facts, "sha256": digest}, spread, row)


def _drawn(spread: Sequence[Values], shares: Array, number: int) -> tuple[Value, ...]:
    return tuple(one.at(float(share)) for one, share in zip(spread, shares[number], strict=True))


def _shares(count: int, n_axes: int, sampler: str, seed: int) -> Array:
    """Return points of the unit cube, shape (count, n_axes)."""
    random = np.random.default_rng(seed)
    shares = _sobol(count, n_axes, random) if sampler == "sobol" else random.random((count, n_axes))
    if sampler == "lhs":  # one in each of as many strata; SciPy's own takes a second to import
        strata = random.permuted(np.tile(np.arange(count), (n_axes, 1)), axis=1).T
        shares = (strata + shares) / count
    return np.clip(shares, _INSIDE, 1.0 - _INSIDE)


def _sobol(count: int, n_axes: int, random: np.random.Generator) -> Array:
    from scipy.stats import qmc

    try:
        made = qmc.Sobol(n_axes, rng=random)
    except TypeError:  # older SciPy
        made = qmc.Sobol(n_axes, seed=random)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # numbers of points that are no power of two
        return np.asarray(made.random(count))


def listed(paths: tuple[str, ...], rows: Sequence[tuple[Value, ...]], facts: dict[str, Any]) -> Plan:
    """Return a plan whose runs are listed; ``facts`` has its kind and what makes it another one."""
    spread = tuple(Values(tuple(dict.fromkeys(one))) for one in zip(*rows, strict=True))
    return Plan(paths, _few(len(rows)), facts["kind"], facts, spread, rows.__getitem__)


def table(path: Path) -> Plan:
    """Return the plan that a CSV file states: paths in the first row, then a row for each run.

    Raises
    ------
    DeckError
        With all places in the file where it is wrong.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", "") or error
        raise refusal(TABLE, f"{path} cannot be read: {why}") from None
    lines = csv.reader(io.StringIO(text), skipinitialspace=True)
    paths = tuple(name.strip() for name in next(lines, []))
    wrong = list(_wrong_names(paths))
    columns: list[list[Value]] = [[] for _ in paths]
    for cells in () if wrong else (row for row in lines if any(cell.strip() for cell in row)):
        line = lines.line_num
        if len(cells) != len(paths):
            wrong.append((line, "", f"{len(cells)} values for {len(paths)} columns"))
            continue
        for name, cell, column in zip(paths, cells, columns, strict=True):
            value = _value(cell.strip())
            wrong += [(line, name, value)] if isinstance(value, _Wrong) else []
            column.append(value)
    if wrong:
        file = str(path)
        places = (DeckProblem(name, str(why), "", line, 1, 1, file) for line, name, why in wrong)
        raise DeckError(file, [*islice(places, MOST_PROBLEMS + 1)], "", {file: text})
    if not columns[0]:
        raise refusal(TABLE, f"{path}: there are no rows below the first")
    packed = [np.array(one) if all(isinstance(v, float) for v in one) else one for one in columns]
    facts = {"kind": "table", "table": str(path), "sha256": hashlib.sha256(text.encode()).hexdigest()}
    spread = tuple(Values(tuple(dict.fromkeys(one))) for one in columns)
    return Plan(paths, _few(len(columns[0])), "table", facts, spread, partial(_tabled, packed))


def _tabled(columns: Sequence[Sequence[Value] | Array], number: int) -> tuple[Value, ...]:
    found = (one[number] for one in columns)
    return tuple(value if isinstance(value, str) else float(value) for value in found)


def _wrong_names(paths: tuple[str, ...]) -> Iterator[tuple[int, str, str]]:
    """Yield what is wrong with the first row of a table, with line and entry."""
    if not paths or not all(paths):
        yield 1, "", "the first row names the entries that are varied, e.g. bodies.arm.length"
    elif len(set(paths)) < len(paths):
        yield 1, next(name for name in paths if paths.count(name) > 1), "two columns are called so"


class _Wrong(str):
    """Why a cell has no value."""


def _value(text: str) -> Value:
    if not text:
        return _Wrong("the value is missing")
    value = as_value(text)
    finite = isinstance(value, str) or math.isfinite(value)
    return value if finite else _Wrong(f"'{text}' is not finite")


def _few(count: int) -> int:
    if count < 1:
        raise refusal(SAMPLE, "a sweep has one run at least")
    if count > MOST_RUNS:
        raise refusal(VARY, f"{count} runs are too many; a sweep has at most {MOST_RUNS}")
    return count
