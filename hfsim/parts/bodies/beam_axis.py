"""Undeformed centre lines of beams: straight, arcs, curves through points; and frames along them.

Lines are curves in space; a beam in the plane has one that stays in the plane of the first two axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.rotations import FIRST, normal, rotation, smallest_rotation
from hfsim.maths.shapes import gauss_legendre

PIECES = 64
"""Pieces of a curve between two of its points, on which its length and its frames are found."""
SAMPLES = 2048
"""Pieces of an axis in which its turns are found."""
_PARTS = 64
MOST_TURN = 0.5 * np.pi
"""Angle by which an element may be curved and twisted [rad]: polynomials follow it no further."""
ROUNDING = 1e-6


class Line:
    """The first axis of the body frame."""

    def at(self, places: Array) -> tuple[Array, Array]:
        """Return points (n, 3) of the line and its frames (n, 3, 3), tangent first, as columns."""
        return np.outer(places, FIRST), np.repeat(np.eye(3)[None], len(places), axis=0)


@dataclass(frozen=True)
class Arc:
    """A circle's arc that starts along the first axis of the body frame, in the plane of the first two.

    Attributes
    ----------
    radius : float
        Positive if it bends towards the second axis [m].
    """

    radius: float

    def at(self, places: Array) -> tuple[Array, Array]:
        """Return points (n, 3) of the line and its frames (n, 3, 3), tangent first, as columns."""
        angles = places / self.radius
        points = np.stack([np.sin(angles), 2.0 * np.sin(0.5 * angles) ** 2, np.zeros_like(angles)], axis=-1)
        return self.radius * points, rotation(angles[:, None] * np.eye(3)[2])


@frozen
class Curve:
    """A cubic spline through points of the body frame, by its own length; its frames do not turn about it.

    Attributes
    ----------
    through : ndarray, shape (n, 3)
        Where it starts is the origin [m].
    """

    through: Array

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline

        chords = np.linalg.norm(np.diff(self.through, axis=0), axis=1)
        return CubicSpline(np.concatenate([[0.0], np.cumsum(chords)]), self.through)

    @cached_property
    def _grid(self) -> tuple[Array, Array]:
        """Parameters and lengths from the start at the ends of all pieces."""
        ends = self._spline.x
        pieces = [np.linspace(a, b, PIECES, endpoint=False) for a, b in pairwise(ends)]
        t = np.concatenate([*pieces, ends[-1:]])
        return t, np.concatenate([[0.0], np.cumsum(self._lengths(t[:-1], t[1:]))])

    def _lengths(self, start: Array, end: Array) -> Array:
        """Return the lengths between parameters (n,)."""
        xi, w = gauss_legendre(5)
        t = start[:, None] + np.outer(end - start, xi)
        return np.asarray(np.linalg.norm(self._spline(t, 1), axis=-1) @ w * (end - start))

    @property
    def length(self) -> float:
        """Of the whole [m]."""
        return float(self._grid[1][-1])

    @cached_property
    def _frames(self) -> Array:
        """Frames at the ends of all pieces, (n, 3, 3): of least rotation from the body frame on."""
        tangents = self._tangents(self._grid[0])
        frames = [smallest_rotation(FIRST, tangents[0])]
        for before, after in pairwise(tangents):
            frames.append(smallest_rotation(before, after) @ frames[-1])
        return np.array(frames)

    def _tangents(self, t: Array) -> Array:
        slopes = self._spline(t, 1)
        return np.asarray(slopes / np.linalg.norm(slopes, axis=-1, keepdims=True))

    def at(self, places: Array) -> tuple[Array, Array]:
        """Return points (n, 3) of the line and its frames (n, 3, 3), tangent first, as columns."""
        t_grid, lengths = self._grid
        piece = np.clip(np.searchsorted(lengths, places, side="right") - 1, 0, len(lengths) - 2)
        start, t = t_grid[piece], np.interp(places, lengths, t_grid)
        for _ in range(3):
            miss = places - lengths[piece] - self._lengths(start, t)
            t = t + miss / np.linalg.norm(self._spline(t, 1), axis=-1)
        before, tangents = self._frames[piece], self._tangents(t)
        pairs = zip(before, tangents, strict=True)
        frames = [smallest_rotation(frame[:, 0], tangent) @ frame for frame, tangent in pairs]
        return np.asarray(self._spline(t)), np.array(frames)


Shape = Line | Arc | Curve


@dataclass(frozen=True)
class Axis:
    """The undeformed centre line of a beam, and how the section's axes are turned about it.

    Attributes
    ----------
    length : float
        [m].
    section_angle, twist : float
        In space, angle at the root from the line's own frame, and by how much more at the tip [rad].
    n_dim : int
        Of the space.
    """

    shape: Shape
    length: float
    section_angle: float = 0.0
    twist: float = 0.0
    n_dim: int = 3

    @classmethod
    def of(cls, spec: Any, n_dim: int = 3) -> Self:
        """Return that of a beam of a deck, a `BeamSpec` with its length."""
        shape = Line() if spec.axis is None else spec.axis.shape
        return cls(shape, spec.length, spec.section_angle or 0.0, spec.twist or 0.0, n_dim)

    @property
    def straight(self) -> bool:
        """Whether the line is."""
        return isinstance(self.shape, Line)

    def at(self, places: Array) -> tuple[Array, Array]:
        """Return points (n, n_dim) of the line and frames (n, n_dim, n_dim), tangent first, as columns."""
        points, frames = self.shape.at(places)
        if self.n_dim == 3:
            return points, frames
        tangents = frames[:, :2, 0]
        return points[:, :2], np.stack([tangents, normal(tangents)], axis=-1)

    def sections(self, places: Array) -> tuple[Array, Array]:
        """Return points of the line and the axes of sections there, as `at`."""
        points, frames = self.at(places)
        if self.n_dim == 2:
            return points, frames
        angles = self.section_angle + self.twist * places / self.length
        return points, np.asarray(frames @ rotation(angles[:, None] * FIRST))

    @cached_property
    def _turns(self) -> tuple[Array, Array]:
        """Places, and between them the section's turn by length in its own axes, (n, 3) [rad/m]."""
        places = np.linspace(0.0, self.length, SAMPLES + 1)
        axes = self.sections(places)[1]
        turn = axes[:-1].swapaxes(1, 2) @ axes[1:]
        about = 0.5 * np.stack([turn[:, k - 1, k - 2] - turn[:, k - 2, k - 1] for k in range(3)], axis=-1)
        return places, about * SAMPLES / self.length

    @property
    def parts(self) -> Array:
        """Middles of parts of the axis in which its sections hardly change, as shares of its length, (n,)."""
        return (np.arange(_PARTS) + 0.5) / _PARTS

    def steepness(self, heights: Array, widths: Array) -> float:
        """Return the largest distance in a section from its line over the line's radius there, in space [-].

        Beyond one, sections of these heights and widths [m] in `parts` cut one another.
        """
        _, about_y, about_z = np.abs(self._turns[1]).T.reshape(3, _PARTS, -1)
        return float((0.5 * (about_y * widths[:, None] + about_z * heights[:, None])).max())

    @property
    def fewest_elements(self) -> int:
        """Elements of which none turns by more than `MOST_TURN` along its length, in space."""
        places, turns = self._turns
        angles = np.concatenate([[0.0], np.cumsum(np.linalg.norm(turns, axis=1))]) * self.length / SAMPLES
        count = max(1, int(np.ceil(angles[-1] / MOST_TURN - ROUNDING)))
        while count < SAMPLES:
            ends = np.interp(np.linspace(0.0, self.length, count + 1), places, angles)
            if np.diff(ends).max() <= MOST_TURN * (1.0 + ROUNDING):
                break
            count += 1
        return count
