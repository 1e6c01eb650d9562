"""What is asked of a map of stability, by options or by arguments: axes, names and bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from hfsim.deck.source import refuse_unknown
from hfsim.errors import ArgumentError
from hfsim.integrators import METHODS
from hfsim.parts.bodies.models import MODELS
from hfsim.studies.axes import Axis, AxisError
from hfsim.studies.stability.results import Plan
from hfsim.studies.stability.verdict import Bounds

MOST_AXES = 2
ENDINGS = ("accurate", "wrong", "numerical", "model", "physical")
"""Classes whose end a bisection may locate."""


def axes_of(texts: Iterable[tuple[str, Callable[[str], Axis], str]]) -> tuple[Axis, ...]:
    """Return axes, each of what it is asked for by, what reads it (`vary`, or one of `NAMED`), and its text.

    Raises
    ------
    ArgumentError
        If one cannot be read, there are more than two, or one twice.
    """
    found = []
    for place, read, text in texts:
        try:
            found.append(read(text))
        except AxisError as error:
            raise ArgumentError(f"{place}: {error}") from None
    if len(found) > MOST_AXES:
        raise ArgumentError(f"{len(found)} axes; a map has one or two")
    if len({axis.name for axis in found}) < len(found):
        raise ArgumentError(f"two axes vary {found[0].name}")
    return tuple(found)


@dataclass(frozen=True)
class Asked:
    """What is asked for.

    Attributes
    ----------
    methods, models : tuple of str
        All methods without any.
    max_error, max_drift : float
        Bounds of what is accurate [-].
    budget, limit : float
        Wall time that all and one point may take [s].
    bisect : float or None
        Relative width to which the end of the class `ending` is located.
    """

    axes: tuple[Axis, ...] = ()
    methods: tuple[str, ...] = ()
    models: tuple[str, ...] = ()
    max_error: float = 1e-2
    max_drift: float = 1e-3
    budget: float = 60.0
    limit: float = 20.0
    bisect: float | None = None
    ending: str = "accurate"

    def plan(self, usual_models: Sequence[str], spent: float = 0.0) -> Plan:
        """Return what is done where some of the budget has been spent.

        Raises
        ------
        ArgumentError
            If a name is unknown, a bisection has no axis, or an ending no bisection.
        """
        refuse_unknown("method", self.methods, [*METHODS, "auto"])
        refuse_unknown("model", self.models, MODELS)
        self._refuse_bisection()
        return Plan(
            axes=self.axes, methods=self.methods or tuple(METHODS), models=self.models or tuple(usual_models),
            bounds=Bounds(self.max_error, self.max_drift), seconds=max(self.budget - spent, 0.0),
            limit=self.limit,
        )  # fmt: skip

    def _refuse_bisection(self) -> None:
        if self.bisect is None:
            if self.ending != ENDINGS[0]:
                raise ArgumentError("ending goes with bisect only")
            return
        if len(self.axes) != 1 or not self.axes[0].numeric or len(self.axes[0].values) < 2:
            raise ArgumentError("bisect needs one axis with two numbers or more")
        if self.axes[0].name == "elements":
            raise ArgumentError("bisect needs an axis without gaps, not elements")
