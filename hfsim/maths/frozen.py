"""Classes of values that stay as they are made."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, dataclass_transform

_Class = TypeVar("_Class")


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def frozen(cls: type[_Class]) -> type[_Class]:
    """Make a dataclass whose instances differ by identity and are not to be changed.

    Type checkers refuse changes. While the program runs nothing does: a dataclass that guards itself, with a
    text of its own, takes four times as long to be made, when the program starts, and its instances twice.
    """
    made = dataclass(eq=False, repr=False)(cls)
    if "__repr__" not in vars(cls):
        made.__repr__ = _shown  # type: ignore[method-assign]
    return made


def _shown(self: Any) -> str:
    """Return the text of an instance, as dataclasses have it."""
    pairs = (f"{one.name}={getattr(self, one.name)!r}" for one in fields(self) if one.repr)
    return f"{type(self).__qualname__}({', '.join(pairs)})"
