"""What is asked of a map of stability, by options or by arguments: axes, names and bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from hfsim.deck.source import refuse_unknown
from hfsim.errors import ArgumentError
from hfsim.integrators import METHODS
from hfsim.parts.bodies.models import MODELS
from hfsim.studies.axes import Axis, AxisError
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
class Plan:
    """What is mapped.

    Attributes
    ----------
    axes : tuple of Axis
        None to two.
    methods, models : tuple of str
        Those of `completed` without any.
    seconds, limit : float
        Wall time that all and one point may take [s].
    tolerance : float
        Of the references, at most a tenth of the deck's [-].
    bisect : float or None
        Relative width to which the end of the class `ending` along the one axis is located.
    """

    axes: tuple[Axis, ...] = ()
    methods: tuple[str, ...] = ()
    models: tuple[str, ...] = ()
    bounds: Bounds = field(default_factory=Bounds)
    seconds: float = 60.0
    limit: float = 20.0
    tolerance: float = 1e-8
    bisect: float | None = None
    ending: str = ENDINGS[0]

    def completed(self, usual_models: Sequence[str], spent: float) -> Plan:
        """Return the same after some time [s], with all methods and usual models where none are named.

        Raises
        ------
        ArgumentError
            If a name is unknown, a bisection has no axis, or an ending no bisection.
        """
        refuse_unknown("method", self.methods, [*METHODS, "auto"])
        refuse_unknown("model", self.models, MODELS)
        self._refuse_bisection()
        methods, models = self.methods or tuple(METHODS), self.models or tuple(usual_models)
        return replace(self, methods=methods, models=models, seconds=max(self.seconds - spent, 0.0))

    def _refuse_bisection(self) -> None:
        if self.bisect is None:
            if self.ending != ENDINGS[0]:
                raise ArgumentError("ending goes with bisect only")
            return
        if len(self.axes) != 1 or not self.axes[0].numeric or len(self.axes[0].values) < 2:
            raise ArgumentError("bisect needs one axis with two numbers or more")
        if self.axes[0].name == "elements":
            raise ArgumentError("bisect needs an axis without gaps, not elements")
