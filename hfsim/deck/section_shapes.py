"""Cross-sections by shape, and what follows from each alone."""

import math
from collections.abc import Iterator
from typing import ClassVar, Literal, Protocol

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import NonNegativeLength, PositiveLength
from hfsim.deck.sections import SHEAR_FACTOR, EquivalentRectangle, Fibres, Moments, Sized
from hfsim.deck.spec import Spec


class _OfRadius(Sized, Protocol):
    @property
    def second_moment(self) -> float: ...

    @property
    def outer_radius(self) -> float: ...


class _Round(EquivalentRectangle):
    """A section that is the same in all directions."""

    @property
    def second_moment(self) -> float:
        """Second moment of area about each diameter [m^4]."""
        raise NotImplementedError

    @property
    def bending(self) -> Moments:
        """I_y and I_z [m^4]."""
        return self.second_moment, self.second_moment

    @property
    def torsion(self) -> float:
        """Torsion constant, the polar moment [m^4]."""
        return 2.0 * self.second_moment

    @property
    def hollow(self) -> float:
        """Inner over outer radius [-]."""
        return 0.0

    @property
    def fibres(self: _OfRadius) -> Fibres:
        """What normal stresses follow from."""
        modulus = self.second_moment / self.outer_radius
        return Fibres(self.area, (modulus, modulus), True)

    def shear(self, poisson_ratio: float) -> Moments:
        """Return the shear factors along y and z (Cowper, J. Appl. Mech. 33, 1966)."""
        nu, m = poisson_ratio, self.hollow**2
        ring = (1.0 + m) ** 2
        k = 6.0 * (1.0 + nu) * ring / ((7.0 + 6.0 * nu) * ring + (20.0 + 12.0 * nu) * m)
        return k, k


class RectangleSection(Spec):
    """Rectangular cross-section: height along y, width along z."""

    stiff: ClassVar[Literal[False]] = False

    shape: Literal["rectangle"]
    """Kind of section."""

    width: PositiveLength
    """Side across the bending plane [m]."""

    height: PositiveLength
    """Side in the bending plane [m]."""

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return self.width * self.height

    @property
    def second_moment(self) -> float:
        """Second moment of area, width height^3 / 12 [m^4]."""
        return self.width * self.height**3 / 12

    @property
    def bending(self) -> Moments:
        """I_y and I_z [m^4]."""
        return self.height * self.width**3 / 12, self.second_moment

    @property
    def fibres(self) -> Fibres:
        """What normal stresses follow from."""
        I_y, I_z = self.bending
        return Fibres(self.area, (2.0 * I_y / self.width, 2.0 * I_z / self.height), False)

    @property
    def torsion(self) -> float:
        """Saint-Venant's torsion constant [m^4]."""
        return rectangle_torsion(self.width, self.height)

    def shear(self, poisson_ratio: float) -> Moments:
        """Return the shear factors along y and z."""
        return SHEAR_FACTOR, SHEAR_FACTOR


class CircleSection(_Round, Spec):
    """Full circular cross-section."""

    shape: Literal["circle"]
    """Kind of section."""

    radius: PositiveLength | None = None
    """Radius [m]; or give the diameter."""

    diameter: PositiveLength | None = None
    """Diameter [m]; or give the radius."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a circle without a size or with two."""
        if (self.radius is None) == (self.diameter is None):
            yield Complaint((), "a circle needs its radius or its diameter, one of the two")

    @property
    def outer_radius(self) -> float:
        """Radius, however it was given [m]."""
        return self.radius if self.radius is not None else (self.diameter or 0.0) / 2

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return math.pi * self.outer_radius**2

    @property
    def second_moment(self) -> float:
        """Second moment of area, pi r^4 / 4 [m^4]."""
        return math.pi * self.outer_radius**4 / 4


class TubeSection(_Round, Spec):
    """Circular tube."""

    shape: Literal["tube"]
    """Kind of section."""

    outer_radius: PositiveLength
    """Outer radius [m]."""

    inner_radius: NonNegativeLength
    """Inner radius [m]."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a tube without a wall."""
        if self.inner_radius >= self.outer_radius:
            yield Complaint(("inner_radius",), f"must be less than the outer radius {self.outer_radius:g} m")

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return math.pi * (self.outer_radius - self.inner_radius) * (self.outer_radius + self.inner_radius)

    @property
    def second_moment(self) -> float:
        """Second moment of area, pi (R^4 - r^4) / 4 [m^4]."""
        return self.area * (self.outer_radius**2 + self.inner_radius**2) / 4

    @property
    def hollow(self) -> float:
        """Inner over outer radius [-]."""
        return self.inner_radius / self.outer_radius


def rectangle_torsion(a: float, b: float) -> float:
    """Return Saint-Venant's torsion constant of a rectangle with sides a and b [m^4].

    J = a b^3 (1/3 - 64 b / (pi^5 a) sum tanh(n pi a / (2 b)) / n^5) over odd n, a the longer side; the part
    of the sum with 1 in the place of tanh is known.

    Examples
    --------
    >>> round(rectangle_torsion(1.0, 1.0), 12)
    0.140577014955
    """
    a, b = max(a, b), min(a, b)
    known = 31.0 / 32.0 * 1.0369277551433699
    beyond = sum((1.0 - math.tanh(0.5 * n * math.pi * a / b)) / n**5 for n in range(1, 25, 2))
    return a * b**3 * (1.0 / 3.0 - 64.0 * b / (math.pi**5 * a) * (known - beyond))
