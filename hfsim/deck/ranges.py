"""Values that an entry is to have in many runs: ``lin(1, 5, 9)``, ``2, 4, 8``, ``normal(1, 0.1)``."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

from hfsim.deck.source import did_you_mean
from hfsim.deck.units import plain_number, quantity_of_any_kind

Value: TypeAlias = "float | str"
"""A number, or a word such as a method's name."""

MOST = 100_000
"""Values of one entry at most."""
_CALL = re.compile(r"\s*([A-Za-z_]\w*)\s*\(([^()]*)\)\s*")
_DIGITS = 12
"""Digits of values that are computed: text of them reads back the same everywhere."""


class RangeError(ValueError):
    """A text names no values; `hint` says what would be right."""

    def __init__(self, message: str, hint: str = "") -> None:
        self.hint = hint
        super().__init__(f"{message} ({hint})" if hint else message)
        self.message = message


class Distribution(NamedTuple):
    """A kind of random values.

    Attributes
    ----------
    form : str
        How it is written.
    wrong : callable
        Its numbers -> what is wrong with them; empty if nothing is.
    at : callable
        (share, numbers) -> the value below which this share of all is; the share is inside 0 to 1.
    """

    form: str
    wrong: Callable[[Sequence[float]], str]
    at: Callable[[float, Sequence[float]], float]


def _normal(share: float) -> float:
    from statistics import NormalDist

    return NormalDist().inv_cdf(share)


def _ordered(n: Sequence[float]) -> str:
    return "" if n[0] < n[1] else "the first number is below the second"


def _wide(n: Sequence[float]) -> str:
    return "" if n[1] > 0.0 else "the second number, the standard deviation, is above 0"


def _triangle(share: float, n: Sequence[float]) -> float:
    low, peak, high = n
    if share < (peak - low) / (high - low):
        return low + math.sqrt(share * (high - low) * (peak - low))
    return high - math.sqrt((1.0 - share) * (high - low) * (high - peak))


DISTRIBUTIONS = {
    "uniform": Distribution("uniform(low, high)", _ordered, lambda s, n: n[0] + s * (n[1] - n[0])),
    "loguniform": Distribution(
        "loguniform(low, high)",
        lambda n: _ordered(n) or ("" if n[0] > 0.0 else "both numbers are above 0"),
        lambda s, n: n[0] * (n[1] / n[0]) ** s,
    ),
    "normal": Distribution("normal(mean, deviation)", _wide, lambda s, n: n[0] + n[1] * _normal(s)),
    "lognormal": Distribution(
        "lognormal(median, deviation)",  # of the logarithm
        lambda n: _wide(n) or ("" if n[0] > 0.0 else "the median is above 0"),
        lambda s, n: n[0] * math.exp(n[1] * _normal(s)),
    ),
    "triangular": Distribution(
        "triangular(low, peak, high)",
        lambda n: "" if n[0] <= n[1] <= n[2] and n[0] < n[2] else "the numbers are in order",
        _triangle,
    ),
    "integers": Distribution(
        "integers(low, high)",
        lambda n: "" if n[0] <= n[1] and all(x == int(x) for x in n) else "two whole numbers in order",
        lambda s, n: n[0] + math.floor(s * (n[1] - n[0] + 1.0)),
    ),
}
"""Kinds of random values: all of a range alike, and so of its logarithm; about a mean; about a median, its
logarithm with a standard deviation; between ends with a peak; whole numbers, both ends included."""
_SPACED = {"lin": "lin(first, last, count)", "log": "log(first, last, count)"}


@dataclass(frozen=True)
class Values:
    """What a text names: a list of values, or a distribution.

    Attributes
    ----------
    listed : tuple of float or str
        Empty for a distribution.
    logarithmic : bool
        Whether they are spaced so.
    kind : str
        A key of `DISTRIBUTIONS`; empty for a list.
    numbers : tuple of float
        Of the distribution.
    si_unit : str
        Of the numbers of a range, where it states units: its values are texts with it.
    """

    listed: tuple[Value, ...]
    logarithmic: bool = False
    kind: str = ""
    numbers: tuple[float, ...] = ()
    si_unit: str = ""

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers, or texts with a unit."""
        return all(not isinstance(self.in_si(value), str) for value in self.listed)

    @cached_property
    def quantities(self) -> dict[Value, tuple[float, str]]:
        """Texts with a unit in SI, and the SI unit; none unless all texts have one."""
        texts = (value for value in self.listed if isinstance(value, str))
        found = {text: quantity_of_any_kind(text) for text in texts}
        sound: dict[Value, tuple[float, str]] = {text: one for text, one in found.items() if one}
        return sound if len(sound) == len(found) else {}

    @property
    def unit(self) -> str:
        """The SI unit of texts with one; empty where they have none, or several."""
        units = {unit.strip("-") for _, unit in self.quantities.values()}
        return units.pop() if len(units) == 1 else self.si_unit

    def in_si(self, value: Value) -> Value:
        """Return a value as tables have it: a text with a unit in SI where all texts have one."""
        if isinstance(value, str) and self.si_unit:
            return float(value.removesuffix(self.si_unit))
        return self.quantities[value][0] if value in self.quantities else value

    def at(self, share: float) -> Value:
        """Return the value below which a share of all is, 0 < share < 1; those of a list count alike."""
        if not self.kind:
            return self.listed[min(int(share * len(self.listed)), len(self.listed) - 1)]
        return _with_unit(f"{DISTRIBUTIONS[self.kind].at(share, self.numbers):.{_DIGITS}g}", self.si_unit)


def read_values(text: str, most: int = MOST) -> Values:
    """Return the values that a text names.

    Parameters
    ----------
    text : str
        ``lin(first, last, count)``, ``log(first, last, count)``, a distribution or values between commas.
    most : int
        Values at most.

    Raises
    ------
    RangeError
        If it names none.

    Examples
    --------
    >>> read_values("log(1, 100, 3)").listed, read_values("gauss, gear").listed
    ((1.0, 10.0, 100.0), ('gauss', 'gear'))
    >>> read_values("[0, -9.81], [0, -1.6]").listed
    ('[0, -9.81]', '[0, -1.6]')
    >>> read_values("normal(1, 0.1)").at(0.5)
    1.0
    """
    called = _CALL.fullmatch(text)
    if called:
        return _called(called[1], [part.strip() for part in called[2].split(",")], text, most)
    words = _between_commas(text)
    if not all(words) or len(words) > most:
        raise RangeError(f"'{text}' is no list of values", "write log(1e5,1e12,8), lin(1,5,9) or 1,2,5")
    values = tuple(dict.fromkeys(as_value(word) for word in words))
    if any(isinstance(value, float) and not math.isfinite(value) for value in values):
        raise RangeError(f"'{text}': values are finite")
    return Values(values)


def _called(name: str, parts: list[str], text: str, most: int) -> Values:
    """Return what a name with numbers in brackets means."""
    forms = {**_SPACED, **{key: one.form for key, one in DISTRIBUTIONS.items()}}
    if name not in forms:
        raise RangeError(f"'{text}': there is no '{name}'", did_you_mean(name, forms))
    form = forms[name]
    numbers, unit = _numbers(parts, len(parts) - (name in _SPACED or name == "lognormal"))
    if name == "integers" and unit:
        numbers = []
    if len(numbers) != 1 + form.count(",") or not all(map(math.isfinite, numbers)):
        count = 1 + form.count(",")
        raise RangeError(f"'{text}': {name} takes {count} numbers, in one unit or none", f"write {form}")
    if name in DISTRIBUTIONS:
        if wrong := DISTRIBUTIONS[name].wrong(numbers):
            raise RangeError(f"'{text}': {form}: {wrong}")
        return Values((), False, name, tuple(numbers), unit)
    return Values(_spaced(name, numbers, text, most, unit), name == "log", si_unit=unit)


def _numbers(parts: Sequence[str], alike: int) -> tuple[list[float], str]:
    """Return the numbers of a range and their SI unit; none where not the first `alike` have it, but 0."""
    pairs: list[tuple[float, str]] = []
    for part in parts:
        number = plain_number(part)
        value, unit = (quantity_of_any_kind(part) or (math.nan, "")) if number is None else (number, "")
        pairs.append((value, unit.strip("-")))
    units = {unit for value, unit in pairs[:alike] if unit or value}
    if len(units) > 1 or any(unit for _, unit in pairs[alike:]):
        return [], ""
    return [value for value, _ in pairs], units.pop() if units else ""


def _with_unit(number: str, unit: str) -> Value:
    return f"{number} {unit}" if unit else float(number)


def _spaced(name: str, numbers: Sequence[float], text: str, most: int, unit: str) -> tuple[Value, ...]:
    first, last, count = numbers
    if count != int(count) or not 1 <= count <= most:
        raise RangeError(f"'{text}': the count is a whole number from 1 to {most}")
    if name == "log" and min(first, last) <= 0.0:
        raise RangeError(f"'{text}': a logarithmic axis has positive ends")
    import numpy as np

    space = np.geomspace if name == "log" else np.linspace
    return tuple(dict.fromkeys(_with_unit(f"{x:.{_DIGITS}g}", unit) for x in space(first, last, int(count))))


def _between_commas(text: str) -> list[str]:
    """Return the parts of a text between commas in no brackets; brackets around all are taken off."""
    words = _split(text)
    if len(words) == 1 and words[0].startswith("[") and words[0].endswith("]"):
        return _split(words[0][1:-1])
    return words


def _split(text: str) -> list[str]:
    words, depth = [""], 0
    for char in text:
        depth += (char in "[{(") - (char in "]})")
        if char == "," and depth == 0:
            words.append("")
        else:
            words[-1] += char
    return [word.strip() for word in words]


def as_value(word: str) -> Value:
    """Return the number that a word is, or else the word."""
    number = plain_number(word)
    return word if number is None else number


def written(value: Value) -> str:
    """Return a value as an override has it: whole numbers without a point.

    Examples
    --------
    >>> written(4.0), written(0.1), written("gear")
    ('4', '0.1', 'gear')
    """
    if isinstance(value, str):
        return value
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))
