"""What is wrong with entries of decks, as their validators say it."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, Self

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from hfsim.deck.reader import Path
from hfsim.deck.source import did_you_mean

REFUSED = "refused"
"""Kind of pydantic's error that carries a complaint."""


class Complaint(NamedTuple):
    """What is wrong with an entry.

    Attributes
    ----------
    path : tuple
        Where, counted from the entry that complains.
    message, hint : str
        What is wrong, and what would be right.
    on_key : bool
        Whether the key is to be marked, not the value.
    """

    path: Path
    message: str
    hint: str = ""
    on_key: bool = False

    def inside(self, *steps: str | int) -> Self:
        """Return the same, its path counted from further out."""
        return self._replace(path=(*steps, *self.path))


def refusal(message: str, hint: str = "", on_key: bool = False) -> PydanticCustomError:
    """Return the exception by which a validator refuses a value, with what would be right."""
    return PydanticCustomError(REFUSED, "{message}", {"message": message, "hint": hint, "on_key": on_key})


def refused(complaints: Sequence[Complaint]) -> ValidationError:
    """Return the exception that makes all complaints at once, each at its own path."""
    errors = [
        InitErrorDetails(type=refusal(one.message, one.hint, one.on_key), loc=one.path, input=None)
        for one in complaints
    ]
    return ValidationError.from_exception_data("entry", errors)


def refuse_all(complaints: Iterable[Complaint]) -> None:
    """Raise all complaints at once; do nothing where there are none."""
    if found := list(complaints):
        raise refused(found)


def wrong_choice(path: Path, given: object, choices: list[str]) -> Complaint:
    """Return what is wrong with a value that is none of the choices."""
    hint = did_you_mean(str(given), choices)
    message = f"must be one of {', '.join(choices)}, not {shown(given)}"
    return Complaint(path, message, hint if "?" in hint else "")


def degrees_as_radians(key: str | int, angle: float | None) -> Iterator[Complaint]:
    """Yield an angle of several turns whose number looks like one of degrees."""
    if angle is not None and abs(angle) > math.tau and (2 * angle).is_integer():
        yield Complaint((key,), f"{angle:g} rad are {angle / math.tau:.3g} turns", f"'{angle:g} deg'?")


def shown(value: object) -> str:
    """Return a deck's value as messages show it."""
    if value is None:
        return "empty"
    if isinstance(value, dict):
        return "a map"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    text = f"'{value}'" if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
