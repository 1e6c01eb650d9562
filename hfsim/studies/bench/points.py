"""What a bench finds: points with their cost and error, on cells of one model and mesh with its reference."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from hfsim.marching.distance import GROUPS, ChannelScale, gap, group_of
from hfsim.maths.arrays import Array
from hfsim.studies.agreement import tidy


def mesh_words(elements: int, degree: int) -> str:
    """Return a mesh in words.

    Examples
    --------
    >>> mesh_words(4, 3), mesh_words(2, 7), mesh_words(0, 3)
    ('4 elements', '2 elements of degree 7', '0 elements')
    """
    plain = f"{elements} element{'' if elements == 1 else 's'}"
    return plain if degree == 3 else f"{plain} of degree {degree}"


@dataclass(frozen=True)
class ChannelError:
    """Error of one channel of one point.

    Attributes
    ----------
    max_abs : float
        Largest error over time, in `unit`.
    max_relative, rms_relative : float
        Largest and root-mean-square error over the channel's scale [-].
    below_floor : bool
        Whether the error is smaller than the reference's own; the numbers are the floor then.
    judged : bool
        Whether the channel counts for the error of the point.
    """

    channel: str
    unit: str
    max_abs: float
    max_relative: float
    rms_relative: float
    below_floor: bool
    judged: bool


def channel_error(values: Array, truth: Array, scale: ChannelScale, floor: float) -> ChannelError:
    """Return the error of one channel; nothing below the floor is a number.

    Parameters
    ----------
    values, truth : ndarray, shape (n_times,)
        In the unit of the channel.
    floor : float
        Error of `truth` over the scale [-].
    """
    found = gap(values, truth)
    own, rms = found.largest / scale.scale, max(found.rms / scale.scale, floor)
    largest = max(own, floor)
    return ChannelError(
        scale.channel, scale.unit, largest * scale.scale, largest, rms, own <= floor, scale.judged
    )


@dataclass(frozen=True)
class GroupError:
    """Error of one point in one group of channels: see `Point`, whose attributes of these names it gives."""

    error: float | None
    rms_error: float | None
    worst_channel: str
    below_floor: bool
    total_error: float | None = None
    exact_error: float | None = None

    @classmethod
    def of(cls, errors: Iterable[ChannelError], floor: float) -> GroupError:
        """Return the error of some channels, whose reference is not known better than its floor."""
        known = list(errors)
        worst = max(known, key=lambda e: e.max_relative)
        below = worst.max_relative <= floor
        rms = max(floor, *(e.rms_relative for e in known))
        return cls(max(worst.max_relative, floor), rms, worst.channel, below)


def groups_of(units: Collection[str]) -> tuple[str, ...]:
    """Return the groups of some units; the first one is that by which all is recommended.

    Examples
    --------
    >>> groups_of(["N", "rad/s", "m"]), groups_of(["J"])
    (('motion', 'rates', 'forces'), ('energies',))
    """
    found = {group_of(unit) for unit in units}
    return tuple(group for group in (*GROUPS, "others") if group in found)


class _OnMesh:
    """What has a model and a mesh."""

    model: str
    elements: int
    degree: int

    @property
    def mesh(self) -> str:
        """Elements, and their degree unless cubic, in words."""
        return mesh_words(self.elements, self.degree)

    @property
    def place(self) -> tuple[str, int, int]:
        """Model, degree and elements: of what is on one cell."""
        return self.model, self.degree, self.elements


@dataclass(frozen=True)
class Point(_OnMesh):
    """One model, mesh, method and tolerance (or step).

    Attributes
    ----------
    elements : int
        Elements of each beam, the most where the deck has beams differ.
    degree : int
        Highest of their degrees.
    tolerance, step : float or None
        Which of the two was prescribed.
    status, reason : str
        ``done``, ``failed``, ``limit``, ``over budget`` (cut off) or ``skipped``; why.
    cpu, cpu_min, cpu_max : float or None
        CPU time of the integration, median and extremes of `repeats` [s].
    error, rms_error : float or None
        Time error over its scale of the worst judged channel of the first group, the motion where there is
        one: largest over time, root mean square [-].
    below_floor : bool
        Whether `error` is the floor because the true one is smaller.
    total_error : float or None
        Error against the mesh-converged reference [-].
    exact_error : float or None
        Error against the best reference of the model exact (ancf where exact is not swept), that of the model
        included; None where neither is there [-].
    groups : dict of str to GroupError
        The errors of each group of channels; those above are of the first one.
    """

    model: str
    elements: int
    method: str
    tolerance: float | None
    step: float | None
    status: str = "skipped"
    reason: str = ""
    degree: int = 3
    cpu: float | None = None
    cpu_min: float | None = None
    cpu_max: float | None = None
    repeats: int = 0
    steps: int | None = None
    rejected: int | None = None
    newton_iterations: int | None = None
    evaluations: int | None = None
    factorisations: int | None = None
    energy_drift: float | None = None
    error: float | None = None
    rms_error: float | None = None
    worst_channel: str = ""
    below_floor: bool = False
    total_error: float | None = None
    exact_error: float | None = None
    channels: tuple[ChannelError, ...] = ()
    groups: dict[str, GroupError] = field(default_factory=dict)

    def of_group(self, group: str) -> Point:
        """Return the point with the errors of a group in place of those of the first one."""
        found = self.groups.get(group, GroupError(None, None, "", False))
        return replace(self, **vars(found))

    @property
    def at(self) -> str:
        """Tolerance or step as a number."""
        return tidy(self.tolerance or 0.0) if self.step is None else f"{self.step:g} s"

    @property
    def level(self) -> str:
        """Tolerance or step in words."""
        return f"{'tolerance' if self.step is None else 'step'} {self.at}"

    @property
    def judged_error(self) -> float | None:
        """Total error where one is known, else the time error."""
        return self.error if self.total_error is None else self.total_error


@dataclass(frozen=True)
class Cell(_OnMesh):
    """One model on one mesh, with its reference.

    Attributes
    ----------
    elements : int
        Elements of each beam, the most where the deck has beams differ.
    degree : int
        Highest of their degrees.
    status, reason : str
        ``done``, ``failed`` (there is no reference: the model broke down) or ``over budget``.
    reference : str
        How the reference was computed.
    reference_cpu : float
        What it cost, all attempts together [s].
    floor : float or None
        Largest difference of its two methods in any judged channel of the first group over its scale [-].
    floors : dict of str to float
        The same for each channel.
    group_floors : dict of str to float
        The same for each group of channels, the one that all is recommended by first.
    mesh_error, mesh_order : float or None
        Distance to the mesh-converged reference in the worst judged channel of the first group [-]; order by
        which it fell since the coarser mesh.
    mesh_channel : str
        That channel.
    mesh_errors : dict of str to float
        The same distance for each judged channel [-].
    mesh_reference, mesh_reference_degree : int or None
        Elements of that reference and their degree.
    model_error : float or None
        Distance to the reference of the model exact on the same mesh in the worst judged channel of the first
        group [-].
    model_channel : str
        That channel.
    """

    model: str
    elements: int
    unknowns: int
    status: str
    reason: str = ""
    degree: int = 3
    reference: str = ""
    reference_cpu: float = 0.0
    floor: float | None = None
    floors: dict[str, float] = field(default_factory=dict)
    group_floors: dict[str, float] = field(default_factory=dict)
    mesh_error: float | None = None
    mesh_order: float | None = None
    mesh_channel: str = ""
    mesh_errors: dict[str, float] = field(default_factory=dict)
    mesh_reference: int | None = None
    mesh_reference_degree: int = 3
    model_error: float | None = None
    model_channel: str = ""

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of its judged channels, the one that all is recommended by first."""
        return tuple(self.group_floors)

    @property
    def mesh_reference_words(self) -> str:
        """Mesh of the mesh-converged reference in words."""
        return mesh_words(self.mesh_reference or 0, self.mesh_reference_degree)


def observed_order(coarse: Cell, fine: Cell, channel: str | None = None) -> float | None:
    """Return the order by which the mesh error fell from one mesh to a finer one; None if not known.

    Of one channel, or of the worst one.

    Examples
    --------
    >>> coarse, fine = (Cell("exact", n, 4 * n, "done", mesh_error=e) for n, e in ((2, 0.16), (4, 0.01)))
    >>> observed_order(coarse, fine)
    4.0
    """
    both = coarse, fine
    before, after = (c.mesh_error if channel is None else c.mesh_errors.get(channel) for c in both)
    if coarse.degree != fine.degree or not before or not after:
        return None
    return float(np.log(before / after) / np.log(fine.elements / coarse.elements))
