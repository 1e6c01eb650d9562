"""What a space says of beams with section vectors: their strains as polynomials of vectors."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from hfsim.maths.arrays import Array


class SectionStrains(NamedTuple):
    """Strains of a section, and their derivatives by the vectors (r', d.., d'..) at a place of the beam.

    Attributes
    ----------
    which : tuple of int
        Which of stretch, shears along y and z, twist, curvatures about y and z there are.
    of : callable
        From vectors (n_vectors, n_dim, ...) to the strains, shape (n_strains, ...).
    pulled : callable
        From vectors and section forces (n_strains, ...) to the forces on the vectors that do their work.
    bent_by : callable
        The derivative of that by the vectors, of vectors (..., n_vectors, n_dim): (..., m, m), m all numbers.
    """

    which: tuple[int, ...]
    of: Callable[[Array], Array]
    pulled: Callable[[Array, Array], Array]
    bent_by: Callable[[Array, Array], Array]
