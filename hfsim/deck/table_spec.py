"""The law of time that goes through points."""

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from annotated_types import MinLen

from hfsim.deck.complaints import Complaint, degrees_as_radians
from hfsim.deck.fields import Flag, NonNegativeTime, Number, Time, read_text
from hfsim.deck.law_spec import LawSpec
from hfsim.deck.laws import Law, PeriodicLaw, SplineLaw
from hfsim.deck.spec import Around, ReadBy
from hfsim.maths.piecewise import Piecewise

_INSIDE = 9
"""Places in a stretch of a table at which its spline is looked at."""
_FAR = 1.5
"""Distance of a spline from the middle of its values, over their range, from which it swings too far."""
_SAME = 1e-9
"""Difference of two values, over their range, that counts as none."""
_MOST_POINTS = 1_000_000
"""Points of a periodic table in a run."""


class TableSpec(LawSpec):
    """Cubic spline through points (not-a-knot ends, or periodic), or straight lines from point to point."""

    value_keys = ("values",)

    type: Literal["table"] = "table"

    times: Annotated[tuple[Time, ...], MinLen(2)] = ()
    """Times of the points, increasing [s]."""

    values: tuple[Number, ...] = ()
    """Values there [SI of what the law drives]."""

    interpolation: Literal["cubic", "linear"] = "cubic"
    """Between the points; linear where rates may jump, which those of drivers and motions may not."""

    periodic: Flag = False
    """Whether the points are one period, which repeats at all times: the last value is the first one."""

    table: Annotated[str, ReadBy(read_text, type="string")] | None = None
    """CSV file in the deck's folder, with a header, that has the points instead."""

    column: Annotated[str, ReadBy(read_text, type="string")] | None = None
    """Column of its values; the second one without it."""

    time_column: Annotated[str, ReadBy(read_text, type="string")] | None = None
    """Column of its times [s]; the first one without it."""

    unit: Annotated[str, ReadBy(read_text, type="string")] | None = None
    """Unit of values that have none of their own, as all in a CSV file, which are numbers; SI without it."""

    start: NonNegativeTime | None = None
    """Time at which it begins [s]: before, it holds its value at 0; its own times count from there."""

    @property
    def kink(self) -> str:
        """Where its rate jumps: from point to point, unless it is a spline."""
        return super().kink if self.interpolation == "cubic" else " at the points of its table"

    def complaints(self) -> Iterator[Complaint]:
        """Yield points that make no curve."""
        for key in ("times", "values"):
            if key not in self.model_fields_set:
                yield Complaint((key,), "missing key", "or give a table: a CSV file", True)
                return
        if len(self.values) != len(self.times):
            message = f"{len(self.values)} values for {len(self.times)} times"
            yield Complaint(("values",), message, "give one value for each time")
        for index, (before, after) in enumerate(zip(self.times, self.times[1:], strict=False), start=1):
            if after <= before:
                yield Complaint(("times", index), f"times must increase, {after:g} follows {before:g}")
        if not self.periodic or not self.values:
            return
        if abs(self.values[-1] - self.values[0]) > _SAME * np.ptp(self.values):
            why = f"a period ends with its first value, {self.values[0]:g}, not {self.values[-1]:g}"
            yield Complaint(("values", len(self.values) - 1), why, "repeat the first value at the end")

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a table that does not cover the run, or has too many points in it."""
        first, last = self.times[0], self.times[-1]
        if self.periodic:
            points = len(self.times) * (around.duration or 0.0) / (last - first)
            if points > _MOST_POINTS:
                why = f"makes {points:.2g} points in the run, at which steps end; at most {_MOST_POINTS:.0e}"
                yield Complaint(("times",), why, "take fewer, or sine or an expression")
            return
        if around.duration is not None and (first > 0 or last < around.duration - self.begin):
            after = f" after its start at {self.begin:g} s" if self.begin else ""
            needed = f"is needed from 0 to {around.duration:g} s"
            yield Complaint(("times",), f"covers {first:g} s to {last:g} s{after}, and {needed}")

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield points so unevenly apart that the spline swings far beyond them."""
        yield from super().slips_in(around)
        if any(self.complaints()) or self.interpolation != "cubic":
            return
        times, values = np.array(self.times), np.array(self.values)
        inside = times[:-1, None] + np.diff(times)[:, None] * np.linspace(0.0, 1.0, _INSIDE)
        found = np.asarray(self.unshifted().value(inside.ravel()))
        beyond = np.abs(found - 0.5 * (values.max() + values.min()))
        worst = int(beyond.argmax())
        if beyond[worst] > _FAR * np.ptp(values) > 0.0:
            at = inside.ravel()[worst]
            message = f"the spline through the points reaches {found[worst]:.3g} at {at:.4g} s"
            hint = "add points in long stretches, take smooth_step, or interpolation: linear for a load"
            yield Complaint(("values",), message, hint)

    def turns_in_degrees(self) -> Iterator[Complaint]:
        """Yield the largest value of an angle if all together look like degrees."""
        if self.values and all((2 * value).is_integer() for value in self.values):
            largest = max(range(len(self.values)), key=lambda k: abs(self.values[k]))
            for one in degrees_as_radians(largest, self.values[largest]):
                yield one.inside("values")

    def unshifted(self) -> Law:
        """Return the law as if it began at 0."""
        times, values = np.array(self.times), np.array(self.values)
        law = SplineLaw
        if self.periodic:
            law, values[-1] = PeriodicLaw, values[0]
        if self.interpolation == "linear":
            return law(Piecewise.joining(times, values))
        from scipy.interpolate import CubicSpline

        ends = "periodic" if self.periodic else "not-a-knot"
        return law(Piecewise.of(CubicSpline(times, values, bc_type=ends)))
