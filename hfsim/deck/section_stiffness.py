"""Cross-sections given by their mass and stiffness per length."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Annotated, Any, ClassVar, Literal

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import NonNegativeTime, matrix_of, measures, one_or_list
from hfsim.deck.reader import Path
from hfsim.deck.sections import Moments
from hfsim.deck.spec import Around, Spec

_ROUNDED = 1e-4
"""Part of a moment of inertia, or of a stiffness, that may be the rounding of a printed table."""
_STRAINS = {3: (0, 1, 5), 6: (0, 1, 2, 3, 4, 5)}
"""Which of stretch, shears along y and z, twist, curvatures about y and z a matrix of so many rows has."""
_SINGULAR = 1e-9
"""What a row keeps of its stiffness where the others may follow: less is rounding."""


class MassSection(Spec):
    """What sections given by their mass and stiffness have in common."""

    stiff: ClassVar[Literal[True]] = True
    couplings: ClassVar[tuple[float, ...]] = (0.0,) * 15
    """What of the stiffness matrix of all six strains stands above its diagonal, row by row."""
    one_or_two: ClassVar[tuple[str, ...]]
    """Keys that have one number, or in space a list."""

    mass_per_length: Annotated[float, measures("mass_per_length", above=0)]
    """Mass per length [kg/m]."""

    rotary_inertia: Annotated[Any, one_or_list(3, of="inertia_per_length", above=0)]
    """Moment of inertia per length about the axis across the plane; in space a list: about the beam's axis,
    the section's y and its z axis [kg m]."""

    axial_damping: NonNegativeTime = 0.0
    """Kelvin-Voigt retardation time of stretch and shear [s]."""

    bending_damping: NonNegativeTime = 0.0
    """Kelvin-Voigt retardation time of curvature and twist [s]."""

    def _lists(self) -> Iterator[str]:
        """Yield the keys whose values are lists."""
        return (key for key in self.one_or_two if isinstance(getattr(self, key), tuple))

    def spaces(self) -> Iterator[tuple[int, Path]]:
        """Yield that lists, and what the plane has not, make a scene spatial."""
        yield from super().spaces()
        yield from ((3, (key,)) for key in self._lists())

    def complaints(self) -> Iterator[Complaint]:
        """Yield moments of inertia that no plane section has."""
        if not isinstance(self.rotary_inertia, tuple):
            return
        along, y, z = self.rotary_inertia
        if abs(along - (y + z)) > _ROUNDED * along:
            message = f"that about the axis is {along:g} kg m, the sum of the others {y + z:g} kg m"
            yield Complaint(("rotary_inertia",), message, "in a plane section they are equal")

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield lists in the plane."""
        yield from super().complaints_in(around)
        for key in self._lists() if around.n_dim == 2 else ():
            yield Complaint((key,), "must be one number: this scene is planar")

    @property
    def rotary(self) -> Moments:
        """Moments of inertia per length about the section's y and its z axis [kg m]."""
        own = self.rotary_inertia
        return _both(own[1:] if isinstance(own, tuple) else own)

    @property
    def height(self: Any) -> float:
        """Height of the rectangle with the same stiffness in tension and bending [m]."""
        return math.sqrt(12 * self.bending[1] / self.axial_stiffness)


class StiffnessSection(MassSection):
    """Cross-section given by its mass and stiffness per length; its beam needs no material.

    A number where space has a list stands in space for all that is alike: about, or along, every diameter.
    """

    spatial = ("torsion_stiffness",)
    one_or_two = ("rotary_inertia", "shear_stiffness", "bending_stiffness")

    axial_stiffness: Annotated[float, measures("force", above=0)]
    """EA [N]."""

    shear_stiffness: Annotated[Any, one_or_list(2, of="force", above=0)]
    """k G A; in space a list: of shear along y and along z [N]."""

    torsion_stiffness: Annotated[float, measures("flexural_rigidity", above=0)] | None = None
    """In space: GJ [N m^2]."""

    bending_stiffness: Annotated[Any, one_or_list(2, of="flexural_rigidity", above=0)]
    """EI; in space a list: of bending about y and about z [N m^2]."""

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a missing torsion in space."""
        yield from super().complaints_in(around)
        if around.n_dim == 3 and self.torsion_stiffness is None:
            yield Complaint(("torsion_stiffness",), "missing key", "GJ [N m^2]", True)

    @property
    def shears(self) -> Moments:
        """k_y G A and k_z G A [N]."""
        return _both(self.shear_stiffness)

    @property
    def bending(self) -> Moments:
        """EI_y and EI_z [N m^2]."""
        return _both(self.bending_stiffness)


def dimension_of(count: int, row: int, column: int) -> str:
    """Return that of a number of a stiffness matrix of so many rows."""
    turns = (_STRAINS[count][row] > 2) + (_STRAINS[count][column] > 2)
    return ("force", "moment", "flexural_rigidity")[turns]


class CoupledSection(MassSection):
    """Cross-section given by its mass per length and its matrix of stiffness; its beam needs no material.

    Laminated blades bend where they are pulled, or twist where they are bent.  Forces and moments are those
    at the beam's line, in the axes of the section.
    """

    one_or_two = ("rotary_inertia",)

    stiffness: Annotated[Any, matrix_of((3, 6), dimension_of)]
    """Rows of section forces over strains, in N, N m and N m^2: in space six, of tension, shear along y and
    z, torsion, bending about y and z, by stretch, shears, twist and curvatures; in the plane three, of
    tension, shear and bending."""

    def spaces(self) -> Iterator[tuple[int, Path]]:
        """Yield that six rows make a scene spatial."""
        yield from super().spaces()
        if len(self.stiffness) == 6:
            yield 3, ("stiffness",)

    def complaints(self) -> Iterator[Complaint]:
        """Yield matrices that no elastic energy has."""
        yield from super().complaints()
        C = self.stiffness
        for i, j in combinations(range(len(C)), 2):
            if abs(C[i][j] - C[j][i]) > _ROUNDED * math.sqrt(abs(C[i][i] * C[j][j])):
                both = f"row {i + 1} has {C[i][j]:g} in column {j + 1}", f"row {j + 1} {C[j][i]:g} in {i + 1}"
                message = ", ".join(both)
                yield Complaint(("stiffness",), message, "the matrix of an elastic section is symmetric")
        if (row := _without_energy(C)) is not None:
            message = f"not positive definite: up to row {row + 1} there are strains that store no energy"
            yield Complaint(("stiffness",), message, "are all numbers beside its diagonal in these units?")

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a planar matrix in space."""
        yield from super().complaints_in(around)
        rows = 6 if around.n_dim == 3 else 3
        if len(self.stiffness) != rows:
            space = "spatial" if rows == 6 else "planar"
            yield Complaint(("stiffness",), f"must be a list of {rows} rows: this scene is {space}")

    @property
    def _all(self) -> list[list[float]]:
        """The matrix of all six strains; in the plane none couple with those that it has not."""
        C, which = [[0.0] * 6 for _ in range(6)], _STRAINS[len(self.stiffness)]
        for i, row in zip(which, self.stiffness, strict=True):
            for j, one in zip(which, row, strict=True):
                C[i][j] += 0.5 * one
                C[j][i] += 0.5 * one
        return C

    @property
    def couplings(self) -> tuple[float, ...]:  # type: ignore[override]
        """What stands above the diagonal."""
        C = self._all
        return tuple(C[i][j] for i, j in combinations(range(6), 2))

    @property
    def axial_stiffness(self) -> float:
        """EA [N]."""
        return self._all[0][0]

    @property
    def shears(self) -> Moments:
        """k_y G A and k_z G A [N]."""
        return self._all[1][1], self._all[2][2]

    @property
    def torsion_stiffness(self) -> float:
        """GJ [N m^2]."""
        return self._all[3][3]

    @property
    def bending(self) -> Moments:
        """EI_y and EI_z [N m^2]."""
        return self._all[4][4], self._all[5][5]


def _without_energy(C: Sequence[Sequence[float]]) -> int | None:
    """Return the first row up to which a matrix is not positive definite; None if there is none."""
    left = [list(row) for row in C]
    for k, row in enumerate(left):
        if row[k] <= _SINGULAR * C[k][k] or C[k][k] <= 0.0:
            return k
        for below in left[k + 1 :]:
            share = below[k] / row[k]
            below[:] = [a - share * b for a, b in zip(below, row, strict=True)]
    return None


def _both(numbers: float | tuple[float, ...]) -> Moments:
    """Return two numbers, or one twice."""
    first, second = numbers if isinstance(numbers, tuple) else (numbers, numbers)
    return first, second
