"""Entries that stand once in a deck and are there many times: patterns such as ``blade{k=1..n}``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from hfsim.deck.parameters import Values, no_name
from hfsim.deck.ranges import written
from hfsim.deck.reader import MOST_ENTRIES, Path
from hfsim.deck.source import DeckSource
from hfsim.errors import DeckProblem

MOST_COPIES = 10_000
"""Copies of a pattern."""
_BRACES = re.compile(r"(?<!\$)\{([^{}]*)\}")
_NUMBER = re.compile(r"\$\{([^{}]*)\}")
_RANGE = re.compile(r"(?<!\$)\{\s*(\w+)\s*=([^{}]*?)\.\.([^{}]*)\}")
_LEFT = {("name",), ("parameters",), ("verify",), ("sweep", "vary")}
"""Where braces are none of patterns, or name them."""
_COLLECT, _CHANNELS, _TEXTS = ("sweep", "collect"), ("output", "channels"), ("texts",)
"""Lists whose texts may have to be worked out anew, with other parameters."""
_RANGES = "a range stands in names of entries and in lists"


def repeat(source: DeckSource, values: Values) -> None:
    """Put copies in place of the patterns of a deck, and numbers in place of braces in its names and texts.

    Raises
    ------
    DeckError
        If names are missing: what follows from that is not worth telling.
    """
    values.kinds = "parameter or index"
    work = _Repeating(source, values, len(source.value_marks))
    work.fill(source.data, ())
    if work.nameless:
        raise source.error({(one.path, one.message): one for one in source.problems}.values())


Key: TypeAlias = tuple[int, tuple[tuple[str, float], ...]]
"""Number of a text in a list, and the indices of its ranges by name."""


def repeated(
    texts: Sequence[str], known: Mapping[str, float]
) -> tuple[dict[Key, str], dict[int, DeckProblem]]:
    """Return the texts that some stand for with values of parameters, and what is wrong, by their numbers.

    Examples
    --------
    >>> repeated(["a{k=1..2}.x", "a{n}.y"], {"n": 2.0})[0]
    {(0, (('k', 1.0),)): 'a1.x', (0, (('k', 2.0),)): 'a2.x', (1, ()): 'a2.y'}
    """
    if not any("{" in one for one in texts):
        return {(number, ()): text for number, text in enumerate(texts)}, {}
    source = DeckSource("", "", {_TEXTS[0]: [*texts]})
    repeat(source, Values(source, {**known}))
    found, wrong = dict[Key, str](), dict[int, DeckProblem]()
    for problem in source.problems:
        wrong.setdefault(int(problem.path.rpartition(".")[2]), problem)
    for place, text in enumerate(source.data[_TEXTS[0]]):
        number = int(source.patterns.get((*_TEXTS, place), place))
        if number not in wrong:
            found[number, tuple(source.indices.get((*_TEXTS, place), {}).items())] = text
    return found, wrong


@dataclass
class _Repeating:
    """Makes the copies.

    Attributes
    ----------
    entries : int
        How many the deck has by now.
    nameless : bool
        Whether an entry has no name, as that is wrong.
    """

    source: DeckSource
    values: Values
    entries: int
    nameless: bool = False

    def fill(self, data: Any, path: Path) -> None:
        """Put copies in place of the patterns in a map or a list, and in those inside."""
        if path in (_COLLECT, _CHANNELS) and isinstance(data, list):
            self.source.as_written[path] = [*data]
        if isinstance(data, dict):
            self._fill_map(data, path)
        elif isinstance(data, list):
            self._fill_list(data, path)
        else:
            return
        for step, one in data.items() if isinstance(data, dict) else enumerate(data):
            here = (*path, step)
            if here == ("verify",):
                self._fill_rows(one)
            if here in _LEFT:
                continue
            with self.values.knowing(self.source.indices.get(here, {})):
                if isinstance(one, str) and "{" in one and step != "expression":
                    plain = self._plain(here, one)
                    data[step] = self._numbers(here, plain) if path in (_COLLECT, _TEXTS) else plain
                else:
                    self.fill(one, here)

    def _fill_rows(self, verify: Any) -> None:
        """Put numbers in place of braces in the quantities of published values."""
        rows = verify.get("rows") if isinstance(verify, dict) else None
        for number, row in enumerate(rows if isinstance(rows, list) else ()):
            text = row.get("quantity") if isinstance(row, dict) else None
            if isinstance(text, str) and "{" in text:
                with self.values.knowing(self._set_by(row)):
                    path = ("verify", "rows", number, "quantity")
                    row["quantity"] = self._numbers(path, self._plain(path, text))

    def _set_by(self, row: dict[str, Any]) -> dict[str, float]:
        """Return the values of the parameters where a row sets some; nothing where it does not."""
        pairs = row["set"].items() if isinstance(row.get("set"), dict) else ()
        parts = [(*str(path).partition("."), value) for path, value in pairs]
        own = {name: value for first, _, name, value in parts if first == "parameters"}
        stated = self.source.data.get("parameters")
        if not own or not isinstance(stated, dict | None):
            return {}
        changed = Values(DeckSource("", "", {"parameters": {**(stated or {}), **own}}))
        changed.read()
        return changed.known

    def _fill_map(self, data: dict[str, Any], path: Path) -> None:
        stated = {**data}
        if not any("{" in key for key in stated):
            return
        data.clear()
        for key, value in stated.items():
            for name, indices in self._copies((*path, key), key, on_key=True) if "{" in key else ((key, {}),):
                if name in data or (name != key and name in stated):
                    self._refuse((*path, key), f"'{name}' is there twice", "give copies other names", True)
                    continue
                data[name] = self._copy(value)
                if name != key:
                    self.source.patterns[(*path, name)] = key
                    self.source.indices[(*path, name)] = indices

    def _fill_list(self, data: list[Any], path: Path) -> None:
        stated = [*data]
        if not any(isinstance(one, str) and _RANGE.search(one) for one in stated):
            return
        data.clear()
        for index, value in enumerate(stated):
            here = (*path, len(data))
            self.source.patterns[here] = index
            made = isinstance(value, str) and _RANGE.search(value)
            for one, indices in [*self._copies(here, value)] if made else ((value, {}),):
                self.source.patterns[(*path, len(data))] = index
                self.source.indices[(*path, len(data))] = indices
                data.append(one)

    def _copy(self, value: Any) -> Any:
        self.entries += 1
        if isinstance(value, dict):
            return {key: self._copy(one) for key, one in value.items()}
        return [self._copy(one) for one in value] if isinstance(value, list) else value

    def _copies(self, path: Path, text: str, on_key: bool = False) -> Iterator[tuple[str, dict[str, float]]]:
        """Yield the names that a name or an entry of a list stands for, and the indices of each."""
        match = _RANGE.search(text)
        if match is None:
            yield self._plain(path, text, on_key), {}
            return
        name = match[1]
        if why := no_name(name) or self._taken(name):
            self._refuse(path, *why, on_key)
            return
        if match[3].startswith("."):
            self._refuse(path, f"'{match[0]}' has three dots, a range has two", '"blade{k=1..4}"', on_key)
            return
        first, last = (self._whole(path, text, match.span(group), on_key) for group in (2, 3))
        if first is None or last is None:
            return
        count = last - first + 1
        if not 0 <= count <= MOST_COPIES:
            many = f"{float(last) - first + 1.0:.10g} copies are too many, at most {MOST_COPIES}"
            backwards = f"{first:.10g}..{last:.10g} runs backwards"
            empty = f"{match[1]}={match[2].strip()}..max({match[3].strip()}, {first - 1:.10g})"
            hint = "" if count > 0 else f"{empty} would have no copies"
            self._refuse(path, many if count > 0 else backwards, hint, on_key)
            return
        for index in range(first, last + 1):
            self.entries += 1
            if self.entries > MOST_ENTRIES:
                self._refuse(path, f"more than {MOST_ENTRIES} entries in all", "", on_key)
                raise self.source.error(self.source.problems)
            with self.values.knowing({name: float(index)}):
                one = f"{text[: match.start()]}{index}{text[match.end() :]}"
                for made, more in self._copies(path, one, on_key):
                    yield made, {name: float(index), **more}

    def _taken(self, name: str) -> tuple[str, str] | None:
        there = name in self.values.known or name in self.values.bad
        return (f"'{name}' is a parameter or an index already", "choose another index") if there else None

    def _plain(self, path: Path, text: str, on_key: bool = False) -> str:
        """Return a text with numbers in place of braces."""
        found, at = "", 0
        for match in _BRACES.finditer(text):
            if "=" in match[1] or ".." in match[1]:
                why = f"is no number: {_RANGES}" if "=" in match[1] else "is a range without an index"
                self._refuse(path, f"'{match[0]}' {why}", '"blade{k=1..4}"', on_key)
                break
            number = self._whole(path, text, match.span(1), on_key)
            if number is None:
                break
            found, at = f"{found}{text[at : match.start()]}{number}", match.end()
        return found + text[at:]

    def _numbers(self, path: Path, text: str) -> str:
        """Return the text of a quantity with numbers in place of expressions."""
        found, at = "", 0
        for match in _NUMBER.finditer(text):
            number = self.values.value(path, text, match.span(1))
            if number is None:
                break
            found, at = f"{found}{text[at : match.start()]}{written(number)}", match.end()
        return found + text[at:]

    def _whole(self, path: Path, text: str, part: tuple[int, int], on_key: bool) -> int | None:
        unit = self.values.units.get(text[slice(*part)].strip(), "")
        value = self.values.value(path, text, part, on_key)
        self.nameless |= on_key and value is None
        if value is not None and (unit or not value.is_integer()):
            piece, shown = text[slice(*part)].strip(), f"{value:g} {unit}".strip()
            hint = f'"${{{piece}}}" is its value' if text.strip("{} ") == piece else ""
            self._refuse(path, f"{piece} must be a whole number, not {shown}", hint, on_key)
            return None
        return None if value is None else int(value)

    def _refuse(self, path: Path, message: str, hint: str, on_key: bool) -> None:
        self.nameless |= on_key
        self.source.fail(path, self.source.problem(path, message, hint, on_key))
