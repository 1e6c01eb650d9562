"""Samples of a solution at the output times, and what a channel is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import is_sparse
from hfsim.maths.rotations import wrap
from hfsim.mechanics.body import Acting, Body
from hfsim.mechanics.markers import Marker
from hfsim.mechanics.system import System


class Sampled(Protocol):
    """What channels read of a scene."""

    @property
    def deck(self) -> Any:
        """The deck, with all `channels` that are asked for."""

    @property
    def system(self) -> System:
        """The equations."""

    @property
    def bodies(self) -> Mapping[str, Body]:
        """Bodies by their names."""

    @property
    def joints(self) -> Mapping[str, tuple[int, ...]]:
        """Which constraints of the system each joint is made of."""

    def ties(self, name: str) -> Sequence[Any]:
        """Return what a joint, or a spring, exerts on its coordinates."""

    def coordinate(self, name: str, unit: str) -> Any:
        """Return what measures the angle (``rad``) or the distance (``m``) of a joint or a spring."""

    def marker(self, point: str) -> Marker:
        """Return the marker of a point such as ``b1.tip``."""


@frozen
class Samples:
    """States at the output times, with what several channels need of them.

    Attributes
    ----------
    t : ndarray, shape (n_times,)
    q, v : ndarray, shape (n_times, n)
    turns : dict of str to ndarray, shape (n_times,)
        For bodies without a frame coordinate: an angle close to theirs, full turns included.
    """

    scene: Sampled
    t: Array
    q: Array
    v: Array
    turns: dict[str, Array]

    @cached_property
    def x(self) -> Array:
        """Absolute coordinates."""
        return self.scene.system.absolute(self.q)

    @cached_property
    def u(self) -> Array:
        """Rates of the absolute coordinates."""
        return self.scene.system.absolute_velocity(self.q, self.v)

    @property
    def state(self) -> tuple[Array, Array, Array]:
        """Times, absolute coordinates and their rates."""
        return self.t, self.x, self.u

    @cached_property
    def solved(self) -> tuple[Array, Array]:
        """Accelerations of the absolute coordinates, and multipliers of all joints, (n_times, n_rows)."""
        return self.scene.system.solved(self.t, self.x, self.u)

    @property
    def multipliers(self) -> Array:
        """Lagrange multipliers of all joints, shape (n_times, n_rows)."""
        return self.solved[1]

    def frame_angle(self, body: str) -> Array:
        """Return the angle of a body frame [rad], continuous over full turns."""
        column = self.scene.bodies[body].angle_column
        if column is not None:
            return self.scene.system.arranged(self.q)[:, column]
        measured = self.scene.marker(body).angle(self.x)
        near = self.turns[body]
        return np.asarray(near + wrap(measured - near))

    @cached_property
    def rigid_motions(self) -> list[Array]:
        """Rates (n_times, n_x) of everything: shifts along the axes of the ground, then turns about them."""
        from hfsim.mechanics.turning import Turning

        bodies = tuple(self.scene.bodies.values())
        sparse = is_sparse(self.scene.system.equations.constant_mass)
        return [unit.rates(self.x) for unit in Turning.units(bodies, bodies[0].n_dim, sparse)]

    @cached_property
    def _known_forces(self) -> dict[str, Array]:
        return {}

    @cached_property
    def _acting(self) -> dict[str, Acting]:
        return {}

    def section_forces(self, point: str) -> Array:
        """Return the internal forces of a beam at a point, shape (n_times, 6), as `Body.section_forces`."""
        if point not in self._known_forces:
            name = split_point(point)[0]
            points = [point, *(one for one in self._asked.get(name, ()) if one != point)]
            places = [body_places(self.scene.bodies[name], split_point(one)[1]) for one in points]
            forces = self.forces_along(name, np.concatenate(places))
            self._known_forces.update((one, forces[:, k]) for k, one in enumerate(points))
        return self._known_forces[point]

    @cached_property
    def _asked(self) -> dict[str, dict[str, None]]:
        """Points of each body that channels measure something at: their forces are found together."""
        found = dict[str, dict[str, None]]()
        for channel in self.scene.deck.channels:
            point = channel.rpartition(".")[0]
            name, at = split_point(point)
            body = self.scene.bodies.get(name)
            if body is not None and (not at or at in body.points):
                found.setdefault(name, {})[point] = None
        return found

    def forces_along(self, name: str, places: Array) -> Array:
        """Return the internal forces of a beam at distances from its root, (n_times, n_places, 6)."""
        from hfsim.mechanics.acting import acting_on

        body, (accelerations, multipliers) = self.scene.bodies[name], self.solved
        if name not in self._acting:
            self._acting[name] = acting_on(self.scene.system, body.columns, *self.state, multipliers)
        return body.section_forces(self.x, self.u, accelerations, self._acting[name], places)

    def frame(self, body: str) -> Array:
        """Return the axes of a body frame in space as columns, shape (n_times, 3, 3)."""
        return self.scene.marker(body).frame(self.x)


def body_places(body: Body, point: str) -> Array:
    """Return how far from the root of a beam one of its points, or without a name the root, is, (1,) [m]."""
    return np.array([body.points[point][0] if point else 0.0])


OWNERS = {"body": ("point", "body"), "joint": ("joint", "tie"), "spring": ("joint", "tie")}
"""Subjects of channels that name a body, a joint, a spring."""


class Plot(NamedTuple):
    """A picture of channels against time.

    Attributes
    ----------
    words : str
        Title, and label of the axis before the unit; without them, the quantity.
    stem : str
        Name of its file. Without one, each quantity has a picture by its own name.
    rows : bool
        Whether each quantity has a row of its own and each subject a colour; else each unit and each channel.
    """

    words: str = ""
    stem: str = ""
    rows: bool = False


OF_POSITIONS = Plot("position", "position", rows=True)
OF_ANGLES, OF_SPINS = (Plot(words, words.replace(" ", "_")) for words in ("angle", "angular velocity"))
"""Pictures of several subjects."""


class ChannelKind(NamedTuple):
    """All that is known of channels that end in the same word.

    Attributes
    ----------
    unit : str
        SI unit.
    compute : callable
        The function (samples, subject) -> one value per time.
    subject : str
        What such a channel is of: ``point`` (or body, which is its origin), ``body``, ``joint`` (or spring
        that does one force and one moment to B), ``tie`` (joint or spring, of its angle or distance); or the
        word that stands for the whole scene in its name, such as ``energy``.
    plot : Plot
        The picture it is drawn in.
    dimensions : tuple of int
        Of the spaces that have it.
    only_beams : bool
        Whether the body must be a beam.
    of_turns : bool
        Whether it needs full turns that coordinates may lack: of the body's frame, of a joint's angle.
    of_sections : bool
        Whether the beam's element must have sections, as a cable has not.
    of_strains : bool
        Whether the beam's model must have strains.
    solves : bool
        Whether it needs accelerations and multipliers.
    of_shape : bool
        Whether its section must have a shape that is known.
    judged : str
        When errors in it count: residuals never do, nor does an energy that is conserved.
    measured : str
        Unit of the coordinate that a joint or a spring must have; empty where it need have none.
    others : callable or None
        Other values, (n_times, n), that mean the same as these of all such quantities of a subject, if any.
    """

    unit: str
    compute: Callable[[Samples, str], Array]
    subject: str
    plot: Plot = Plot()
    dimensions: tuple[int, ...] = (2, 3)
    only_beams: bool = False
    of_turns: bool = False
    of_sections: bool = False
    of_strains: bool = False
    solves: bool = False
    of_shape: bool = False
    judged: Literal["always", "unless conserved", "never"] = "always"
    measured: str = ""
    others: Callable[[Array], Array] | None = None

    @property
    def of_scene(self) -> bool:
        """Whether it is of the whole scene."""
        return not any(self.subject in subjects for subjects in OWNERS.values())
