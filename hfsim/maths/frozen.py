"""Classes of values, made sooner than dataclasses when the program starts."""

from __future__ import annotations

from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, TypeVar, dataclass_transform

_Class = TypeVar("_Class")


@dataclass_transform(eq_default=False, field_specifiers=(field,))
def mutable(cls: type[_Class]) -> type[_Class]:
    """Make a dataclass whose instances differ by identity.

    No text is compiled for it, as dataclasses have it done for each of their methods, in which most of the
    time goes that it takes to make them.
    """
    made = dataclass(init=False, eq=False, repr=False)(cls)
    for name, method in (("__init__", _take), ("__repr__", _shown)):
        if name not in vars(cls):
            setattr(made, name, method)
    return made


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def frozen(cls: type[_Class]) -> type[_Class]:
    """Make a class as `mutable` does, whose instances are not to be changed.

    Type checkers refuse changes.  While the program runs nothing does.
    """
    return mutable(cls)


def _take(self: Any, *values: Any, **named: Any) -> None:
    """Take the values of fields, in their order or by name; those left out have their defaults."""
    own, known = vars(self), self.__dataclass_fields__
    own.update(zip(self.__match_args__, values, strict=False), **named)
    if len(own) < len(values) + len(named) or not own.keys() <= known.keys():
        raise TypeError(f"{type(self).__qualname__}: a value too many, or of no field")
    if len(own) < len(known):
        own.update({one.name: _default(self, one) for one in fields(self) if one.name not in own})
    if hasattr(self, "__post_init__"):
        self.__post_init__()


def _default(self: Any, one: Field[Any]) -> Any:
    if one.default_factory is not MISSING:
        return one.default_factory()
    if one.default is MISSING:
        raise TypeError(f"{type(self).__qualname__}: {one.name} is missing")
    return one.default


def _shown(self: Any) -> str:
    """Return the text of an instance, as dataclasses have it."""
    pairs = (f"{one.name}={getattr(self, one.name)!r}" for one in fields(self) if one.repr)
    return f"{type(self).__qualname__}({', '.join(pairs)})"
