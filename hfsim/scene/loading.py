"""From a file to a checked deck.

Pydantic checks each entry; then `hfsim.scene.checks` looks at names in the plain data, so that one bad
entry hides no bad reference elsewhere, and at options and sizes in the entries that could be read.
"""

import hashlib
import json
import typing
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path as FilePath
from typing import Any

from pydantic import TypeAdapter, ValidationError

from hfsim.deck.complaints import Complaint
from hfsim.deck.overrides import left_empty, of_copies, override
from hfsim.deck.source import DeckSource, parse_source, read_source
from hfsim.deck.spec import explained
from hfsim.errors import MOST_PROBLEMS, DeckError
from hfsim.maths.frozen import frozen
from hfsim.parts.bodies.beam import DEFAULT_ELEMENTS, BeamSpec
from hfsim.scene.checks import complaints_of, laws_until, slips_of
from hfsim.scene.schema import Deck

if typing.TYPE_CHECKING:
    from hfsim.scene.published import VerifySpec

DEFAULT_TARGET = 1e-2
"""Target error of decks that leave elements to `run` and state no target [-]."""

_WORKED_OUT = ("parameters", "include")
"""Keys that nothing is left of when a deck has been read."""
_NAMED = 6
"""Bodies that the line on a deck names."""
_VALUES = ("name", "gravity")
"""Top-level keys of values; those of maps may be left empty, as all their entries may be commented out."""


@frozen
class LoadedDeck:
    """A deck and where it came from.

    Attributes
    ----------
    deck : Deck
        With numbers of elements throughout.
    auto_elements : tuple of str
        Beams whose elements the deck leaves to `hfsim run`; it has a target error then.
    published : VerifySpec or None
        Values that the deck states for itself; ``deck.verify`` is None.
    """

    deck: Deck
    source: DeckSource = field(repr=False, compare=False)
    auto_elements: tuple[str, ...] = ()
    published: "VerifySpec | None" = None

    def __repr__(self) -> str:
        """Return what it is in a line: its entries would fill the screen."""
        *first, last = list(self.deck.bodies)[:_NAMED] or ["none"]
        last += "..." if len(self.deck.bodies) > _NAMED else ""
        return f"<Deck {self.deck.name}: bodies {', '.join([*first, last])}; model {self.deck.solve.model}>"

    @property
    def deck_sha256(self) -> str:
        """Hash of the resolved deck, and of which elements are left open."""
        resolved = self.deck.resolved()
        for name in self.auto_elements:
            resolved["bodies"][name]["elements"] = "auto"
        canonical = json.dumps(resolved, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()

    def with_numbers(self, note: Callable[[str], None] | None = None) -> "LoadedDeck":
        """Return the deck with the default elements where it leaves them open, and then without target.

        What was taken is told to `note`.
        """
        if not self.auto_elements:
            return self
        bodies = self.deck.bodies.items()
        beams = {name: body.elements for name, body in bodies if isinstance(body, BeamSpec)}
        taken = {name: beams[name] for name in self.auto_elements}
        if note is not None:
            kinds = {count: [one for one in taken if taken[one] == count] for count in taken.values()}
            words = ", ".join(f"of {', '.join(names)} taken as {count}" for count, names in kinds.items())
            note(f"{self.deck.name}: elements: auto {words}; only hfsim run chooses them")
        numbers = [f"bodies.{name}.elements={count}" for name, count in taken.items()]
        stated = self.source.data["solve"]
        none = [f"solve.{key}=null" for key in ("target_error", "target_channels", "budget") if key in stated]
        return self.changed((*numbers, *none))

    def changed(self, overrides: Sequence[str]) -> "LoadedDeck":
        """Return the deck with further overrides, ``KEY=VALUE`` each, or raise `DeckError`."""
        return parse_deck(self.source.text, self.source.file, (*self.overrides, *overrides))

    @property
    def has_target(self) -> bool:
        """Whether the deck states the error that its run is to reach."""
        return self.deck.solve.target_error is not None

    @property
    def overrides(self) -> tuple[str, ...]:
        """The overrides as given, ``KEY=VALUE``."""
        return self.source.overrides

    def with_solve(self, update: dict[str, Any]) -> "LoadedDeck":
        """Return the same deck solved in another way: entries of ``solve`` by their names."""
        solve = self.deck.solve.model_copy(update=update)
        return replace(self, deck=self.deck.model_copy(update={"solve": solve}))

    def until(self, t: float) -> "LoadedDeck":
        """Return the same deck solved until a time [s].

        Raises
        ------
        DeckError
            If laws of time have no value somewhere until then.
        """
        if found := [self.source.problem(*one) for one in laws_until(self._entries, t)]:
            raise self.source.error(found)
        return self.with_solve({"duration": t})

    @property
    def _entries(self) -> dict[str, Any]:
        return {key: getattr(self.deck, key) for key in Deck.model_fields}

    def line_of(self, path: str) -> int:
        """Return the line of an entry such as ``bodies.b1``, or of the entry around it.

        It is 0 if the entry is overridden or stands in another file.
        """
        mark = self.source.mark(self.source.path_of(path), on_key=True)
        return mark.line if mark and not mark.file else 0

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What looks like slips of units, a line each with its place."""
        found = self.source.once(slips_of(self.source.data, self._entries))
        slips = (self.source.problem(*slip) for slip in found)
        return tuple(slip.headline(self.source.file, "warning") for slip in slips)

    def problem(self, path: str, message: str, hint: str = "") -> DeckError:
        """Return the exception that refuses the entry at a dotted path; for checks made after loading."""
        return self.source.error([self.source.problem(self.source.path_of(path), message, hint)])


def load_deck(path: str | FilePath, overrides: Sequence[str] = ()) -> LoadedDeck:
    """Read a deck file and check it.

    Parameters
    ----------
    path : str or pathlib.Path
        The YAML file.
    overrides : sequence of str
        ``KEY=VALUE`` each, applied before the checks.

    Raises
    ------
    DeckError
        With every problem found.
    """
    return _load(_worked_out(read_source(path), overrides), FilePath(path).stem)


def parse_deck(text: str | bytes, file: str = "deck", overrides: Sequence[str] = ()) -> LoadedDeck:
    """Check a deck given as text; see `load_deck`."""
    return _load(_worked_out(parse_source(text, file), overrides), FilePath(file).stem)


def _worked_out(source: DeckSource, overrides: Sequence[str]) -> DeckSource:
    """Return a deck with its other files, overrides applied, and numbers in place of expressions.

    Raises
    ------
    DeckError
        If a file that the deck includes cannot be added to it.
    """
    if source.data.get("include") is not None:
        from hfsim.deck.files import Folder
        from hfsim.deck.including import include

        include(source, Folder(source.file))
    later = of_copies(source.data, overrides)
    override(source, [one for one in overrides if one not in later], Deck)
    if source.is_overridden(("include",)):
        source.problems.append(source.problem(("include",), "cannot be set", "state it in the deck"))
    said = {"expressions"} if "parameters" in source.data else set()
    _look_for_more(source.data, said)
    if said & {"expressions", "patterns"} or later:
        from hfsim.deck.parameters import Values

        values = Values(source)
        values.read()
        source.known = values.known
        if "patterns" in said:
            from hfsim.deck.repeating import repeat

            repeat(source, values)
        override(source, later, Deck)
        values.work_out()
    if "tables" in said:
        from hfsim.deck.files import Folder
        from hfsim.deck.tables import read_tables

        read_tables(source, Folder(source.file))
    return source


def _look_for_more(data: Any, said: set[str]) -> None:
    """Note whether there are expressions, patterns or tables in other files in some data."""
    if isinstance(data, dict):
        if "expression" in data:
            said.add("expressions")
        if isinstance(data.get("table"), str):
            said.add("tables")
        for key, one in data.items():
            _look_for_more(one, said)
            if "{" in key:
                said.add("patterns")
    elif isinstance(data, list):
        for one in data:
            _look_for_more(one, said)
    elif isinstance(data, str) and "{" in data:
        said.add("expressions" if data.lstrip().startswith("${") else "patterns")  # or within a quantity


def _left_empty(source: DeckSource, key: str) -> bool:
    """Tell whether a deck has a key without the value that it must have; overrides take it out that way."""
    return key in _VALUES and not source.is_overridden((key,))


def _load(source: DeckSource, stem: str) -> LoadedDeck:
    stated = ((key, value) for key, value in source.data.items() if key not in _WORKED_OUT)
    kept = {key: value for key, value in stated if value is not None or _left_empty(source, key)}
    data = {"name": stem, **kept}
    auto = _auto_elements(data)
    _put_nodes_at_steps(data, auto)
    solve = data.get("solve")
    if auto and isinstance(solve, dict) and solve.get("target_error") is None:
        data["solve"] = {**solve, "target_error": DEFAULT_TARGET}
    deck, complaints = None, []
    try:
        deck = Deck.model_validate(data)
        entries = {key: getattr(deck, key) for key in Deck.model_fields}
    except ValidationError as error:
        complaints = explained(Deck, error)
        entries = _readable_entries(data)
    complaints += islice(complaints_of(data, entries), MOST_PROBLEMS + 1)
    complaints += left_empty(source, Deck)
    if "verify" in data:
        from hfsim.scene.published import complaints_of_rows

        changed = {str(path[0]) for path in source.overridden} - {"verify"}
        complaints += complaints_of_rows(source.data, entries, changed, bool(source.patterns))
    if data.get("sweep") is not None:
        from hfsim.scene.swept import complaints_of_sweep

        complaints += complaints_of_sweep(source.data, entries)
    if deck is not None and not complaints and deck.dimension == 3:
        from hfsim.scene.spatial_lines import refusals

        complaints = list(refusals(deck))
    if deck is not None and not complaints:
        complaints = list(_loads_beyond(deck))
    left = (one for one in source.once(complaints) if not source.has_failed(one.path))
    problems = source.problems + [source.problem(*complaint) for complaint in left]
    if problems or deck is None:
        # What follows from a problem at the very same place is left out.
        distinct = {(one.path, one.file, one.line, one.column): one for one in reversed(problems)}
        raise source.error(distinct.values())
    if deck.verify is None:
        return LoadedDeck(deck, source, auto)
    return LoadedDeck(deck.model_copy(update={"verify": None}), source, auto, deck.verify)


def _loads_beyond(deck: Deck) -> Iterator[Complaint]:
    """Yield what loads say of places that are not on their beams."""
    for name, load in deck.loads.items():
        length = getattr(deck.bodies[load.owner], "length", 0.0)
        yield from (one.inside("loads", name) for one in load.beyond(length))


def _auto_elements(data: dict[str, Any]) -> tuple[str, ...]:
    """Return the bodies of a deck's plain data that leave their elements open."""
    bodies = data.get("bodies")
    pairs = bodies.items() if isinstance(bodies, dict) else ()
    return tuple(name for name, body in pairs if isinstance(body, dict) and body.get("elements") == "auto")


def _put_nodes_at_steps(data: dict[str, Any], auto: tuple[str, ...]) -> None:
    """Replace elements that are left open by a number with nodes at the steps of sections, if any."""
    for name in auto:
        body = data["bodies"][name]
        stations = body.get("stations")
        if isinstance(stations, list) and len(stations) > 2:
            from hfsim.deck.stations import elements_for

            places = [one.get("at") if isinstance(one, dict) else None for one in stations]
            body = {**body, "elements": elements_for(places, DEFAULT_ELEMENTS)}
            data["bodies"] = {**data["bodies"], name: body}


def _readable_entries(data: dict[str, Any]) -> dict[str, Any]:
    """Return of each top-level key what can be read, though other parts of the deck are bad."""
    entries: dict[str, Any] = {}
    for key, info in Deck.model_fields.items():
        value, annotation = data.get(key), typing.cast(Any, info.annotation)
        if typing.get_origin(annotation) is dict:
            adapter: TypeAdapter[Any] = TypeAdapter(typing.get_args(annotation)[1])
            pairs = value.items() if isinstance(value, dict) else ()
            read = {name: _read_or_none(adapter, entry) for name, entry in pairs}
            entries[key] = {name: entry for name, entry in read.items() if entry is not None}
        else:
            entries[key] = _read_or_none(TypeAdapter[Any](annotation), value)
    return entries


def _read_or_none(adapter: TypeAdapter[Any], value: Any) -> Any:
    try:
        return adapter.validate_python(value)
    except ValidationError:
        return None
