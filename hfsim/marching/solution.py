"""What a simulation hands back: times, named columns with units, outlines and statistics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from hfsim.marching.columns import Columns
from hfsim.maths.frozen import frozen

if TYPE_CHECKING:
    from numpy import ndarray

    from hfsim.parts.channels import Samples


class Channel(NamedTuple):
    """One output column.

    Attributes
    ----------
    name : str
        Name as in the deck, e.g. ``b1.tip.x``.
    unit : str
        SI unit, e.g. ``m``; empty for a pure number.
    values : ndarray, shape (n_times,)
        One value for every output time, in `unit`.
    """

    name: str
    unit: str
    values: ndarray


class Snapshot(NamedTuple):
    """The bodies at one time.

    Attributes
    ----------
    t : float
        When [s].
    points : dict of str to ndarray, shape (n_points, n_dim)
        Absolute points along each body [m].
    places : dict of str to ndarray, shape (n_points,)
        Of beams with strains: distances of these points from the root along the undeformed beam [m].
    along : dict of str to dict of str to ndarray, shape (n_points,)
        Of the same: deflection and internal forces there, by the names of the channels.
    rounding : dict of str to dict of str to float
        What of each of these is rounding.
    """

    t: float
    points: dict[str, ndarray]
    places: dict[str, ndarray]
    along: dict[str, dict[str, ndarray]]
    rounding: dict[str, dict[str, float]]


class Fine(Protocol):
    """Channels at more times than the output's."""

    @property
    def curves(self) -> tuple[ndarray, tuple[Channel, ...]]:
        """Times [s] in order, the output's among them, and the channels there."""


@frozen
class Run(Columns):
    """What one simulated model of one scene gives; ``run["b1.tip.x"]`` are the values of a channel.

    Its columns are those of ``history.csv``: ``t``, then the channels, at the output times in SI units.

    Attributes
    ----------
    name : str
        Name of the deck.
    model, method : str
        Model of the beams that have none of their own, ``auto`` where it was chosen in the run; the method
        really used.
    status : str
        ``done``, ``failed``, ``limit`` or ``interrupted``.
    reason : str
        Why it ended early; empty when done.
    t : ndarray, shape (n_times,)
        Output times that were reached [s].
    channels : tuple of Channel
        Columns in the order of the deck.
    outline_t : ndarray, shape (n_outlines,)
        When outlines were taken: at the output times, in long runs at some of them [s].
    outlines : dict of str to ndarray, shape (n_outlines, n_points, n_dim)
        Absolute points [m] of each body's centre line (beam) or of the polyline through
        its frame points (rigid body).
    outline_forces : callable or None
        Gives, for numbers of outlines, the internal forces at these points: by the names of the channels
        that any body has, those of each body, shape (n_numbers, n_points).
    statistics : dict
        JSON-ready facts: ``cpu_s`` and ``wall_s`` (by phase), ``steps``, ``energy_drift``, ``warnings``...
    fine : Fine or None
        The channels at more times than the output's, for curves; nothing is computed before it is asked for.
    snapshots : tuple of Snapshot
        The bodies at the times ``output.snapshots`` that were reached.
    states : sequence of Samples
        States at the output times, in long runs at some of them: ``t``, coordinates and rates that steps are
        made in ``q`` and ``v``, absolute ones ``x`` and ``u``, a row a time; one for each choice of models.
    failure : dict or None
        JSON-ready facts about a failure (``time``, ``item``, ``kind``...), or None.
    exit_code : int
        Exit code this run alone would end the program with.
    reached : float or None
        When the last step that was kept ended [s]; None where none are made.
    """

    _called = "channel"

    name: str
    model: str
    method: str
    status: str
    reason: str
    t: ndarray
    channels: tuple[Channel, ...]
    statistics: dict[str, Any]
    failure: dict[str, Any] | None
    exit_code: int
    outline_t: ndarray | None = None
    outlines: Mapping[str, ndarray] = field(default_factory=dict)
    outline_forces: Callable[[ndarray], dict[str, dict[str, ndarray]]] | None = None
    fine: Fine | None = None
    snapshots: tuple[Snapshot, ...] = ()
    states: Sequence[Samples] = ()
    reached: float | None = None

    def __repr__(self) -> str:
        """Return what it is in a line: its arrays would fill the screen."""
        times, channels = len(self.t), len(self.channels)
        sizes = f"{times} time{'s' * (times != 1)}, {channels} channel{'s' * (channels != 1)}"
        return f"<Run {self.name}: {self.status}, {self.model}, {self.method}, {sizes}>"

    @property
    def columns(self) -> dict[str, ndarray]:  # type: ignore[override]
        """Times and channels by name, shape (n_times,) each."""
        return {"t": self.t, **{channel.name: channel.values for channel in self.channels}}

    @property
    def drawn(self) -> Run:
        """The run with its channels at all times at which they are drawn."""
        if self.fine is None:
            return self
        t, channels = self.fine.curves
        return replace(self, t=t, channels=channels)

    @property
    def outlined(self) -> tuple[ndarray, dict[str, ndarray]] | None:
        """When outlines were taken [s], (n_outlines,), and those of bodies that have any; None without."""
        outlines = {body: points for body, points in self.outlines.items() if points.size}
        return None if self.outline_t is None or not outlines else (self.outline_t, outlines)

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each channel; empty for pure numbers."""
        return {channel.name: channel.unit for channel in self.channels}

    @property
    def final(self) -> dict[str, float]:
        """Last value of each channel; empty if no output time was reached."""
        return {one.name: float(one.values[-1]) for one in self.channels if len(self.t)}

    @property
    def extremes(self) -> dict[str, list[float]]:
        """Smallest and largest value of each channel; empty if no output time was reached."""
        found = ((one.name, one.values) for one in self.channels if len(self.t))
        return {name: [float(values.min()), float(values.max())] for name, values in found}

    def to_dataframe(self) -> Any:
        """Return the channels as a pandas DataFrame over the time ``t``.

        Raises
        ------
        ImportError
            If pandas is not installed: hfsim does not need it.
        """
        pandas: Any = import_module("pandas")
        columns = {channel.name: channel.values for channel in self.channels}
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    @property
    def table(self) -> ndarray:
        """Rows of times and channels, shape (n_times, 1 + n_channels)."""
        import numpy as np

        return np.column_stack([self.t, *(channel.values for channel in self.channels)])

    @property
    def dimension(self) -> int:
        """Of the space that its bodies move in, 2 where none is known."""
        return max((points.shape[-1] for points in self.outlines.values()), default=2)

    @property
    def end_time(self) -> float:
        """Last output time that was reached [s]; 0 when there is none."""
        return float(self.t[-1]) if len(self.t) else 0.0

    @property
    def stop_time(self) -> float:
        """When the computation stopped [s]: the time of the failure where one is known, else that reached."""
        time = (self.failure or {}).get("time")
        if time is None and self.status != "done":
            time = self.reached
        return float(time) if isinstance(time, (int, float)) else self.end_time

    def phase_cpu(self, phase: str) -> float:
        """CPU time of one phase (``build``, ``solve``, ...) [s]; 0 when it was not measured."""
        times = self.statistics.get("cpu_s")
        value = times.get(phase) if isinstance(times, dict) else None
        return float(value) if isinstance(value, (int, float)) else 0.0
