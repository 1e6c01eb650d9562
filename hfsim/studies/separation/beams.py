"""The soft beam of the paper's section 7.1 as the study runs it: pinned at its root, let go as an arc.

In space, where its section is the rectangle of the same area and second moment, the arc is twisted too.

Batches of beams that differ in their starts are one scene, whose elements share one law: they move at once,
as an ensemble does.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array
from hfsim.parts.elements import ELEMENTS, Element
from hfsim.scene.build import Scene, build
from hfsim.scene.loading import LoadedDeck, parse_deck

LENGTH, MODULUS, DENSITY, AREA, SECOND_MOMENT = 1.2, 7.0e5, 5540.0, 1.8e-3, 1.215e-8
"""The beam of section 7.1 [m, Pa, kg/m^3, m^2, m^4]; Poisson's ratio zero."""

STEPS = 10
"""Steps of a whole run, explicit and fixed: next to nothing but the accelerations is asked for."""

_HEIGHT = math.sqrt(12.0 * SECOND_MOMENT / AREA)

KINDS = {name: (name, 2) for name in ELEMENTS} | {"spatial_continuum": ("continuum", 3)}
"""What is measured: elements of `ELEMENTS` in plane or space."""

TWIST = 0.5
"""Angle by which a beam in space is twisted for each radian that it is bent [-]."""


@dataclass(frozen=True)
class Beams:
    """Equal beams that move at the same time, each from a start of its own.

    Attributes
    ----------
    kind : str
        Of `KINDS`.
    count : int
        Elements of each beam.
    states : int
        Beams.
    """

    kind: str
    count: int
    states: int = 1

    @cached_property
    def element(self) -> Element:
        """One of the elements, which are all equal."""
        return ELEMENTS[KINDS[self.kind][0]].of(LENGTH / self.count, 3, n_dim=self.n_dim)

    @property
    def n_dim(self) -> int:
        """Of the space that the beams move in."""
        return KINDS[self.kind][1]

    @property
    def properties(self) -> BeamProperties:
        """Of every element."""
        return BeamProperties(
            axial_stiffness=MODULUS * AREA,
            bending_stiffness=MODULUS * SECOND_MOMENT,
            lame_mu=0.5 * MODULUS,
            height=_HEIGHT,
            width=AREA / _HEIGHT,
            breadth=AREA / _HEIGHT,
        )

    @property
    def step(self) -> float:
        """A step that explicit methods bear [s]: waves along, bending, of the thickness."""
        le, r = self.element.length, _HEIGHT / math.sqrt(12.0)
        return 0.5 * min(0.1 * le, 0.05 * le**2 / r, 0.1 * _HEIGHT) / math.sqrt(MODULUS / DENSITY)

    @cached_property
    def nodes(self) -> Array:
        """Nodal vectors at the start, shape (n_states, n_nodes, n_per_node, n_dim).

        Arcs, large deformations: the first of one radian, the others up to half as much more.
        """
        bend = np.linspace(1.0, 1.5, self.states)[:, None]
        angle = bend * np.linspace(0.0, 1.0, self.count + 1)
        c, s = np.cos(angle), np.sin(angle)
        place, along, across = (LENGTH / bend * s, LENGTH / bend * (1.0 - c)), (c, s), (-s, c)
        if self.n_dim == 2:
            rows = np.array([place, along, across][: self.element.per_node])
            return np.moveaxis(rows, (0, 1), (-2, -1))
        flat = np.zeros_like(angle)
        first, second = np.array([*across, flat]), np.array([flat, flat, flat + 1.0])
        turn = np.cos(TWIST * angle), np.sin(TWIST * angle)
        sides = turn[0] * first + turn[1] * second, turn[0] * second - turn[1] * first
        rows = np.array([[*place, flat], [*along, flat], *sides])
        return np.moveaxis(rows, (0, 1), (-2, -1))

    @cached_property
    def components(self) -> Array:
        """Nodal components of all elements in columns, as the forms take them, (n, n_states * n_elements)."""
        both = np.concatenate([self.nodes[:, :-1], self.nodes[:, 1:]], axis=2)
        return np.ascontiguousarray(both.reshape(self.states * self.count, -1).T)

    @cached_property
    def deck(self) -> LoadedDeck:
        """The deck of all beams."""
        names = [f"b{k}" for k in range(1, self.states + 1)]
        beam = {"material": "rubber", "section": "strip", "length": LENGTH, "elements": self.count}
        strip: dict[str, str | float] = {"area": AREA, "second_moment": SECOND_MOMENT}
        if self.n_dim == 3:
            strip = {"shape": "rectangle", "height": _HEIGHT, "width": AREA / _HEIGHT}
        pin = {"type": "revolute" if self.n_dim == 2 else "spherical"}
        deck = {
            "hfsim": 1,
            "gravity": [0.0, -9.81, 0.0][: self.n_dim],
            "materials": {"rubber": {"density": DENSITY, "youngs_modulus": MODULUS}},
            "sections": {"strip": strip},
            "bodies": {
                name: {"type": "beam", "element": KINDS[self.kind][0], **beam} for name in names
            },
            "joints": {f"pin_{b}": {**pin, "between": ["ground", f"{b}.root"]} for b in names},
            "solve": {
                "model": "ancf",
                "method": "explicit",
                "step": self.step,
                "duration": STEPS * self.step,
                "keep": ["parts"],
            },
        }
        return parse_deck(json.dumps(deck))

    def scene(self, form: str) -> Scene:
        """Return the beams at the start, their elastic force in one of the forms."""
        scene = build(self.deck.with_solve({"elastic_form": form}))
        x = self.nodes.reshape(1, -1)
        q, v = scene.system.state(x, np.zeros_like(x), np.zeros_like(x))
        return replace(scene, q=q[0], v=v[0])
