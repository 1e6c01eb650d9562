"""Base class of deck entries: how one is read, and how it says what is wrong with it.

An entry says what is wrong with it as a whole in `Spec.complaints`.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any, ClassVar, NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import CoreSchema, ErrorDetails
from pydantic_core.core_schema import (
    no_info_before_validator_function,
    no_info_plain_validator_function,
    no_info_wrap_validator_function,
)

from hfsim.deck.complaints import (
    REFUSED,
    Complaint,
    degrees_as_radians,
    refusal,
    refuse_all,
    refused,
    shown,
    wrong_choice,
)
from hfsim.deck.reader import Path
from hfsim.deck.source import did_you_mean, likely
from hfsim.errors import MOST_PROBLEMS


class Around(NamedTuple):
    """The rest of a deck, as far as it could be read.

    Attributes
    ----------
    n_dim : int or None
        Dimensions of space.
    why : str
        Which entry says so, where space has three.
    duration : float or None
        Of the run [s].
    model, elastic_form : str or None
        Of beams that have no model of their own; in which their elastic force is computed.
    channels : tuple of str or None
        Columns of the output.
    """

    n_dim: int | None
    why: str
    duration: float | None
    model: str | None
    elastic_form: str | None
    sections: Mapping[str, Any]
    channels: tuple[str, ...] | None


class Spec(BaseModel):
    """Base of everything a deck may say: frozen, no unknown keys, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    vectors: ClassVar[tuple[str, ...]] = ()
    """Fields whose numbers are as many as the scene has dimensions, or maps of such."""

    spatial: ClassVar[tuple[str, ...] | bool] = ()
    """Fields that only space has; or whether the whole entry is of space only."""

    angles: ClassVar[tuple[str, ...]] = ()
    """Fields that are angles in radians, which may be meant in degrees."""

    planar: ClassVar[tuple[str, ...]] = ()
    """Fields that only the plane has."""

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys that an entry may have, as decks spell them."""
        return list(cls.fields_by_key())

    @classmethod
    def fields_by_key(cls) -> dict[Any, str]:
        """Return the names of fields by their keys in decks."""
        return {info.alias or name: name for name, info in cls.model_fields.items()}

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> CoreSchema:
        """Tell pydantic how the entry is validated."""
        read = no_info_wrap_validator_function(cls._read, handler(source))
        return no_info_before_validator_function(cls._stated, read)

    @classmethod
    def _stated(cls, value: Any) -> Any:
        """Return an entry without its empty keys, where that is how to leave them out."""
        if not isinstance(value, dict) or all(one is not None for one in value.values()):
            return value
        left_out = {info.alias or name for name, info in cls.model_fields.items() if info.default is None}
        return {key: one for key, one in value.items() if one is not None or key not in left_out}

    @classmethod
    def _read(cls, value: Any, read: Callable[[Any], Any]) -> Any:
        """Read an entry; what pydantic refuses is said in deck words."""
        try:
            return read(value)
        except ValidationError as error:
            raise refused(explained(cls, error)) from None

    def complaints(self) -> Iterable[Complaint]:
        """Yield what is wrong with this entry where each key by itself is right."""
        return ()

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield what in this entry, or in one inside it, does not fit the rest of the deck."""
        n_dim, space = around.n_dim, {2: "planar", 3: "spatial"}.get(around.n_dim or 0, "")
        why = f": {around.why}" if n_dim == 3 and around.why else ""
        for path, vector in self._vectors():
            if n_dim and len(vector) != n_dim:
                yield Complaint(path, f"must be a list of {n_dim} numbers: this scene is {space}{why}")
        for key in self._of(self.spatial) if n_dim == 2 else self._of(self.planar) if n_dim == 3 else ():
            yield Complaint((key,), f"a {space} scene has no {key}", on_key=True)
        for key, entry in self._inner():
            yield from (one.inside(key) for one in entry.complaints_in(around))

    def spaces(self) -> Iterator[tuple[int, Path]]:
        """Yield how many dimensions space has by each vector or key in this entry, with its path."""
        if self.spatial is True:
            yield 3, ()
        yield from ((3, (key,)) for key in self._of(self.spatial))
        yield from ((len(vector), path) for path, vector in self._vectors())
        for key, entry in self._inner():
            yield from ((n, (key, *path)) for n, path in entry.spaces())

    def _of(self, keys: tuple[str, ...] | bool) -> tuple[str, ...]:
        """Return which of some fields are stated."""
        return tuple(k for k in keys if getattr(self, k) is not None) if isinstance(keys, tuple) else ()

    def _vectors(self) -> Iterator[tuple[Path, Sequence[float]]]:
        """Yield the vectors in this entry with their keys."""
        for key in self.vectors:
            value = getattr(self, key)
            for name, vector in (value if isinstance(value, dict) else {"": value}).items():
                if isinstance(vector, tuple | list):
                    yield ((key, name) if name else (key,)), vector

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield numbers in this entry, or in one inside it, that look like slips of units but may be meant.

        Numbers that are given with their units count as meant: nothing is told of them.
        """
        for key in self.angles:
            yield from degrees_as_radians(key, getattr(self, key))
        for key, entry in self._inner():
            yield from (one.inside(key) for one in entry.slips_in(around))

    def _inner(self) -> Iterator[tuple[str, "Spec"]]:
        """Yield the entries inside this one with their keys."""
        return ((key, entry) for key, entry in vars(self).items() if isinstance(entry, Spec))

    def model_post_init(self, context: Any, /) -> None:
        """Refuse an entry that has complaints."""
        refuse_all(self.complaints())


class ReadBy:
    """Marks a field's type: a function turns the deck's value into it, or refuses it.

    Pydantic's own validators would look at each function's signature whenever a class is built.

    Attributes
    ----------
    read : callable
        From the deck's value to the field's.
    shape : dict
        What it reads: ``quantity``, the dimension of a number or of text with a unit, with its bounds; with
        ``count`` and ``rows`` a list of so many too, or rows of these.  ``whole``: a number, or one of such
        words.  ``names``: of a registry, or ``others``.  ``entries``: classes, or where they stand, or
        ``others``.  Else a JSON schema as it is.
    """

    def __init__(self, read: Callable[[Any], object], **shape: Any) -> None:
        self.read, self.shape = read, shape

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Tell pydantic how the field is validated."""
        return no_info_plain_validator_function(self.read, metadata={"shape": self.shape})


class Before:
    """Marks a field's type: a function looks at the deck's value, or changes it, before it is read.

    Attributes
    ----------
    look : callable
        From the deck's value to the one that is read.
    """

    def __init__(self, look: Callable[[Any], object]) -> None:
        self.look = look

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Tell pydantic how the field is validated."""
        return no_info_before_validator_function(self.look, handler(source))


class OneOf:
    """Marks a union of entries: one key of an entry says which class it is read as.

    Pydantic's own unions build all their classes at once; here a class is built, and if need be its module
    imported, when a deck first has such an entry.

    Attributes
    ----------
    key : str
        The key.
    kinds : mapping of str to type or str
        The key's values and the class of each, or where it stands: ``hfsim.parts.joints.fixed.FixedSpec``.
    otherwise : type or str, optional
        The class of entries without the key.
    told_by : mapping of str to type or str
        Other keys by which an entry without the key is another class.
    others : sequence of dict
        JSON schemas of what stands for an entry to what reads before this.
    """

    def __init__(
        self,
        key: str,
        kinds: Mapping[str, type[Spec] | str],
        otherwise: type[Spec] | str | None = None,
        told_by: Mapping[str, type[Spec] | str] | None = None,
        others: Sequence[Mapping[str, str]] = (),
    ) -> None:
        self.key, self.kinds, self.otherwise, self.told_by = key, kinds, otherwise, told_by or {}
        entries = (*self.kinds.values(), *self.told_by.values(), self.otherwise)
        self.shape = {"entries": [one for one in entries if one], "others": others}

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Tell pydantic how the field is validated."""
        return no_info_plain_validator_function(self._read, metadata={"shape": self.shape})

    def _read(self, value: Any) -> Spec:
        if isinstance(value, Spec):
            return value
        if not isinstance(value, dict):
            raise refusal(f"must be a map, not {shown(value)}")
        kind = value.get(self.key)
        spec = self.kinds.get(kind) if isinstance(kind, str) else None
        if self.key not in value:
            spec = next((one for key, one in self.told_by.items() if key in value), self.otherwise)
        if isinstance(spec, str):
            spec = at(spec)
        if spec is not None:
            return spec.model_validate(value)
        if self.key not in value:
            wrong = Complaint((self.key,), "missing key", "it says which kind this entry is", on_key=True)
        else:
            wrong = wrong_choice((self.key,), kind, list(self.kinds))
        raise refused([wrong])


def entry_of(place: str) -> ReadBy:
    """Return what reads an entry as a class that is imported when a deck has one.

    Parameters
    ----------
    place : str
        Where the class stands: ``hfsim.deck.orientation.OrientationSpec``.
    """
    return ReadBy(partial(_read_as, place), entries=[place])


def _read_as(place: str, value: Any) -> Spec:
    spec: type[Spec] = at(place)
    return value if isinstance(value, spec) else spec.model_validate(value)


def named_in(registry: str, *others: str) -> ReadBy:
    """Return what reads a name of a registry, which is imported when a deck says one, or another word.

    Parameters
    ----------
    registry : str
        Where the mapping stands: ``hfsim.parts.elements.ELEMENTS``.
    *others : str
        What may be said besides.
    """
    return ReadBy(partial(_read_name_in, registry, others), names=registry, others=others)


def _read_name_in(registry: str, others: tuple[str, ...], value: object) -> object:
    choices = [*at(registry), *others]
    if value not in choices:
        wrong = wrong_choice((), value, choices)
        raise refusal(wrong.message, wrong.hint)
    return value


def at(place: str) -> Any:
    """Return what stands at ``module.NAME``; the module is imported if need be."""
    module, _, name = place.rpartition(".")
    return getattr(import_module(module), name)


# Pydantic's refusals in deck words --------------------------------------------------------------------

_MESSAGES = {
    "string_type": "must be text",
    "dict_type": "must be a map",
    "model_type": "must be a map",
    "model_attributes_type": "must be a map",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
}
_LENGTHS = {"too_short": ("least", "min_length"), "too_long": ("most", "max_length")}


def explained(spec: type[Spec], error: ValidationError) -> list[Complaint]:
    """Return what pydantic refused of an entry, in deck words.

    Parameters
    ----------
    spec : type
        The class that the entry was read as.
    error : pydantic.ValidationError
        What entries inside it refused is in deck words already.
    """
    items = error.errors(include_url=False)[: MOST_PROBLEMS + 1]
    unknown = [item["loc"] for item in items if item["type"] == "extra_forbidden"]
    words = [(path, likely(str(word), spec.keys())) for *path, word in unknown]
    meant = {(*path, *close) for path, close in words if len(close) == 1}
    told = (item for item in items if item["type"] != "missing" or item["loc"] not in meant)
    return [_explained(spec, item) for item in told if not _counts_good_ones(item)]


def _counts_good_ones(item: ErrorDetails) -> bool:
    """Tell whether a list is refused as too short only because entries of it are."""
    return item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]


def _explained(spec: type[Spec], item: ErrorDetails) -> Complaint:
    kind, context = item["type"], item.get("ctx", {})
    path = tuple(step for step in item["loc"] if step != "[key]")
    on_key = len(path) < len(item["loc"])
    if kind == REFUSED:
        return Complaint(path, context["message"], context["hint"], on_key or context["on_key"])
    if kind == "extra_forbidden":
        return Complaint(path, "unknown key", did_you_mean(str(path[-1]), spec.keys()), True)
    if kind == "missing":
        from hfsim.deck.field_texts import field_texts

        field = spec.fields_by_key()[str(path[-1])]
        return Complaint(path, "missing key", field_texts(spec).get(field, "").rstrip("."), True)
    if kind == "literal_error":
        return wrong_choice(path, item["input"], re.findall(r"'([^']*)'", context["expected"]))
    if kind in _LENGTHS:
        word, bound = _LENGTHS[kind]
        count, given = context[bound], len(item["input"])
        entries = "entry" if count == 1 else "entries"
        return Complaint(path, f"must have at {word} {count} {entries}, not {given or 'none'}", "", on_key)
    message = _MESSAGES[kind].format(**context) if kind in _MESSAGES else item["msg"]
    return Complaint(path, f"{message}, not {shown(item['input'])}", "", on_key)
