"""Classes of values that stay as they are made."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar, dataclass_transform

_Class = TypeVar("_Class")


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def frozen(cls: type[_Class]) -> type[_Class]:
    """Make a dataclass whose instances differ by identity and are not to be changed.

    Type checkers refuse changes. While the program runs nothing does: a dataclass that guards itself takes
    more than twice as long to be made, when the program starts, and so do its instances.
    """
    return dataclass(eq=False)(cls)
