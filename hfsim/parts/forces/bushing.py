"""Bushing: springs and dampers on all shifts and turns between two frames."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Angle, Between, LengthVector, Orientation, one_or_list
from hfsim.deck.laws import LinearLaw
from hfsim.deck.orientation import matrix_of
from hfsim.deck.spec import Around
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import freedoms
from hfsim.mechanics.constraints import Held, Shift, Turn
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.resistances import LinearSpring
from hfsim.mechanics.ties import GapTie, tie_on
from hfsim.parts.joints.fixed import FixedSpec
from hfsim.parts.specs import JointSpec, SpringSpec


class BushingSpec(SpringSpec):
    """A `fixed` joint that gives, as rubber mounts and flexures do: springs and dampers along A's axes and on
    the angle, in space about each axis. Where nothing states where B is, it starts without force.
    """

    vectors = ("stiffness", "damping", "place")
    spatial = ("orientation",)
    angles = ("angle",)
    carries = True
    limits = ("force", "moment")

    type: Literal["bushing"]
    """Kind of spring."""

    between: Between
    """The two points, [A, B]."""

    stiffness: Annotated[Any, one_or_list(2, 3, of="stiffness", at_least=0.0)] = 0.0
    """Stiffness along A's axes: the same, or a list of one for each [N/m]."""

    damping: Annotated[Any, one_or_list(2, 3, of="damping", at_least=0.0)] = 0.0
    """Damping along A's axes, likewise [N s/m]."""

    rotational_stiffness: Annotated[Any, one_or_list(3, of="rotational_stiffness", at_least=0.0)] = 0.0
    """Stiffness of the angle; in space of the angles about A's axes: the same, or a list [N m/rad]."""

    rotational_damping: Annotated[Any, one_or_list(3, of="rotational_damping", at_least=0.0)] = 0.0
    """Damping of these, likewise [N m s/rad]."""

    place: LengthVector | None = None
    """Where B is without force, in A's frame [m]; at A without it."""

    angle: Angle = 0.0
    """Angle of B's frame relative to A's without moment, in space about z [rad]."""

    orientation: Orientation | None = None
    """Orientation of B's frame relative to A's without moment, in space; the same without it."""

    @property
    def framed(self) -> tuple[str, ...]:
        """Both points."""
        return self.between

    def complaints(self) -> Iterator[Complaint]:
        """Yield a bushing that says nothing of its force, and rest that is stated twice."""
        stated = {"stiffness", "damping", "rotational_stiffness", "rotational_damping"}
        if not stated & self.model_fields_set:
            yield Complaint(("stiffness",), "missing key", "or give damping, or those of turns", True)
        if self.orientation is not None and self.angle:
            yield Complaint(("angle",), "orientation says this already", "leave one of them out", True)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield lists about axes that the plane has not."""
        yield from super().complaints_in(around)
        for key in ("rotational_stiffness", "rotational_damping") if around.n_dim == 2 else ():
            if isinstance(getattr(self, key), tuple):
                yield Complaint((key,), "must be a number: in the plane there is one angle")

    @property
    def acts(self) -> bool:
        """Whether it ever exerts a force."""
        each = (self.stiffness, self.damping, self.rotational_stiffness, self.rotational_damping)
        return any(any(one) if isinstance(one, tuple) else one for one in each)

    @property
    def about(self) -> tuple[str, ...]:
        """The axes about which it acts."""
        each = np.broadcast_arrays(np.zeros(3), self.rotational_stiffness, self.rotational_damping)
        return tuple(name for name, acts in zip("xyz", np.any(each, axis=0), strict=True) if acts)

    @property
    def rest_turn(self) -> float:
        """The angle without moment."""
        return self.angle

    @property
    def mount(self) -> JointSpec:
        """The joint that holds B where the bushing is without force."""
        return RestSpec(
            type="fixed",
            between=self.between,
            angle=self.angle,
            orientation=self.orientation,
            place=self.place,
        )

    def firmness(self, n_dim: int) -> tuple[int, int, float, float]:
        """Return how many shifts and turns have a stiffness, how many shifts, and the sums of both."""
        shifts = np.broadcast_to(self.stiffness, n_dim)
        turns = np.broadcast_to(self.rotational_stiffness, freedoms(n_dim) - n_dim)
        along, about = int(np.count_nonzero(shifts)), int(np.count_nonzero(turns))
        return along + about, along, float(np.sum(shifts)), float(np.sum(turns))

    def parts(self, first: Marker, second: Marker, start: Array) -> Iterator[tuple[str, GapTie]]:
        """Yield what acts along and about each axis, by its name."""
        place = self.place or (0.0,) * first.n_dim
        axes = zip(_axes(first.n_dim), place, strict=True)
        shifts = [(name, Shift(axis), at) for (name, axis), at in axes]
        for held, stiffness, damping in (
            (shifts, self.stiffness, self.damping),
            (self._turns(first.n_dim), self.rotational_stiffness, self.rotational_damping),
        ):
            each = (np.broadcast_to(one, len(held)).tolist() for one in (stiffness, damping))
            for (name, what, rest), k, d in zip(held, *each, strict=True):
                if k or d:
                    yield name, tie_on(what, first, second, (LinearSpring(k, d, rest),))

    def _turns(self, n_dim: int) -> list[tuple[str, Held, float]]:
        """Return names of angles, the angles, and where they are without moment."""
        if n_dim == 2:
            return [("turn", Turn(), self.angle)]
        from hfsim.mechanics.directions import direction
        from hfsim.mechanics.spatial_turns import About

        R = matrix_of(self)
        rows = tuple(direction(row) for row in (np.eye(3) if R is None else R))
        return [(f"about_{name}", About(axis, rows), 0.0) for name, axis in _axes(3)]


class RestSpec(FixedSpec):
    """What holds B at a place in A's frame, where a bushing is without force."""

    vectors = ("place",)

    place: LengthVector | None = None
    """Where B is, in A's frame [m]; at A without it."""

    faces: bool = True
    """Whether it holds how B is turned, too."""

    def held(self, facing: Array | None = None) -> tuple[Held, ...]:
        """Return what a fixed joint would hold, at this place."""
        point, *turn = super().held(facing)
        turn = turn if self.faces else []
        if self.place is None:
            return point, *turn
        at = zip(_axes(len(self.place)), self.place, strict=True)
        return *(Shift(axis, LinearLaw(distance)) for (_, axis), distance in at), *turn


def _axes(n_dim: int) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield the axes of a frame with their names."""
    return ((name, tuple(row)) for name, row in zip("xyz", np.eye(n_dim).tolist(), strict=False))
