"""Modes of a scene: what each is, where it moves, and what it looks like."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hfsim.errors import ArgumentError
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.eigenpairs import Eigenpairs, eigenpairs
from hfsim.maths.squares import Unfound
from hfsim.mechanics.turning import Turning
from hfsim.studies.modes.evenness import stays_even
from hfsim.studies.modes.state import EVEN, About, ModesError
from hfsim.studies.modes.sticking import Sticking, sticking

KINDS = {
    "vibration": "swings about the state",
    "decay": "comes back without swinging",
    "rigid": "nothing brings it back, and it goes on by itself",
    "drift": "nothing brings it back, but dampers end it",
    "flutter": "unstable: swings more and more",
    "divergence": "unstable: goes away without swinging",
}
"""What a motion can be."""
UNSTABLE, FREE = ("flutter", "divergence"), ("rigid", "drift")
_STEP = 1e-6
"""Largest change of a coordinate with which shapes are taken, over what it changes by at large."""
_TURNS_ONLY = 1e-4
"""Largest displacement of outlines, where the largest change of a coordinate is one, that is none."""
_RIGID = 1e-6
"""Part of the energy of a motion that may be other than one of everything."""
_AT_RATE = 1e-6
"""Part of the rate of axes by which what everything does may seem to go round at another."""


@dataclass(frozen=True, eq=False)
class Mode:
    """One motion, exp(value t) times its shape.

    Attributes
    ----------
    number : int
        From slow to fast, from one on.
    kind : str
        One of `KINDS`.
    value : complex
        The eigenvalue [1/s].
    uncertainty : float
        What rounding does to it [1/s].
    change : ndarray of complex, shape (n_x,)
        Of the absolute coordinates, of any size.
    """

    number: int
    kind: str
    value: complex
    uncertainty: float
    change: ComplexArray
    about: About

    def __repr__(self) -> str:
        """Return the numbers that tell it from others."""
        return f"<mode {self.number}: {self.kind}, {self.frequency:.6g} Hz, {self.mostly}>"

    @cached_property
    def shapes(self) -> dict[str, ComplexArray]:
        """Displacements of the outline of each body, (n_points, n_dim); the largest of all is one, and real.

        Where only turns are left, the largest change of a coordinate is one.
        """
        found = _shapes(self.about, self.change)
        factor = _scale(self.about, found, self.change)
        return {name: factor * shape for name, shape in found.items()}

    @cached_property
    def shares(self) -> dict[str, float]:
        """Shares of the bodies in the kinetic energy."""
        energy = _energy(self.about, self.change)
        whole = float(energy.sum()) or 1.0
        bodies = self.about.scene.bodies
        return {name: float(energy[body.columns].sum()) / whole for name, body in bodies.items()}

    @property
    def frequency(self) -> float:
        """With which it swings [Hz]."""
        return abs(self.value.imag) / (2.0 * np.pi)

    @property
    def natural_frequency(self) -> float:
        """The size of the eigenvalue: the frequency without its damping [Hz]."""
        return abs(self.value) / (2.0 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Of critical damping [-]: negative where it grows."""
        return -self.value.real / abs(self.value) if self.value.real else 0.0

    @property
    def growth(self) -> float:
        """Growth rate [1/s]."""
        return float(self.value.real)

    @property
    def multiplier(self) -> complex | None:
        """What a period makes of it, if it is one of a periodic motion."""
        return None if self.about.period is None else complex(np.exp(self.value * self.about.period))

    @property
    def unstable(self) -> bool:
        """Whether it grows."""
        return self.kind in UNSTABLE

    @property
    def free(self) -> bool:
        """Whether nothing brings it back."""
        return self.kind in FREE

    @property
    def turns_only(self) -> bool:
        """Whether no point of an outline moves, as where beams twist about their line."""
        largest = max((float(np.abs(one).max(initial=0.0)) for one in self.shapes.values()), default=0.0)
        return largest <= _TURNS_ONLY

    @property
    def mostly(self) -> str:
        """Bodies with most of the kinetic energy."""
        order = sorted(self.shares, key=lambda name: -self.shares[name])
        told = [name for name in order if self.shares[name] > 0.1][:3] or order[:1]
        return ", ".join(f"{name} {100.0 * self.shares[name]:.0f} %" for name in told)

    def facts(self) -> dict[str, Any]:
        """Return its numbers."""
        facts = {
            "mode": self.number,
            "kind": self.kind,
            "frequency": self.frequency,
            "natural_frequency": self.natural_frequency,
            "damping_ratio": self.damping_ratio,
            "growth_rate": self.growth,
            "uncertainty": self.uncertainty,
            "bodies": self.shares,
        }
        if self.multiplier is not None:  # frequencies are not known to multiples of one, nor ratios to them
            facts |= {"natural_frequency": None, "damping_ratio": None}
            facts["multiplier"] = [self.multiplier.real, self.multiplier.imag]
        return facts


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of a scene.

    Attributes
    ----------
    modes : tuple of Mode
        From slow to fast; unstable ones beyond those asked for come last.
    complete : bool or None
        Whether it was checked that none is missing; None if that could not be told.
    whole : bool
        Whether all motions that the scene has were looked at.
    """

    about: About
    modes: tuple[Mode, ...]
    complete: bool | None
    whole: bool

    def __repr__(self) -> str:
        """Return how many there are and the slowest of them."""
        slowest = ", ".join(f"{frequency:.6g}" for frequency in self.frequencies[:3])
        return f"<{len(self)} modes about {self.about.state}: {slowest} Hz ...>"

    def __len__(self) -> int:
        """Return their number."""
        return len(self.modes)

    def __iter__(self) -> Iterator[Mode]:
        """Go through them, from slow to fast."""
        return iter(self.modes)

    def __getitem__(self, number: int) -> Mode:
        """Return a mode by its number."""
        for mode in self.modes:
            if mode.number == number:
                return mode
        raise KeyError(number)

    @property
    def unstable(self) -> tuple[Mode, ...]:
        """Those that grow."""
        return tuple(mode for mode in self.modes if mode.unstable)

    @property
    def frequencies(self) -> Array:
        """Of all modes [Hz]."""
        return np.array([mode.frequency for mode in self.modes])

    @property
    def damping_ratios(self) -> Array:
        """Of all modes [-]."""
        return np.array([mode.damping_ratio for mode in self.modes])

    @cached_property
    def outlines(self) -> dict[str, Array]:
        """The outline of each body in the state, (n_points, n_dim) [m]."""
        x = self.about.motions.x[None]
        return {name: body.outline(x)[0] for name, body in self.about.scene.bodies.items()}

    @cached_property
    def uneven(self) -> bool:
        """Whether they are those at one angle of a turn alone: what acts or holds is other at others."""
        if self.about.unevenness > EVEN:
            return True
        told = np.array([[abs(mode.value), mode.uncertainty] for mode in self.modes]).reshape(-1, 2)
        return not stays_even(self.about, np.array([mode.change for mode in self.modes]), *told.T)

    @cached_property
    def sticking(self) -> list[Sticking]:
        """Friction that sticks in the state and damps some of them."""
        if self.about.period is not None:
            return []
        return sticking(self.about, [(mode.value, mode.change) for mode in self.modes])

    @property
    def steady(self) -> bool:
        """Whether they are those of a state that lasts, at every angle of its turn."""
        return self.about.lasting and not self.uneven

    def facts(self) -> dict[str, Any]:
        """Return all that is known, as plain data."""
        motions, scene = self.about.motions, self.about.scene
        return {
            "status": "done",
            "name": scene.deck.name,
            "model": scene.model,
            "about": self.about.facts()
            | {"steady": self.steady, "uneven": self.uneven},
            "unknowns": motions.mass.shape[0],
            "multipliers": motions.jacobian.shape[0],
            "complete": self.complete,
            "all_looked_at": self.whole,
            "unstable": [mode.number for mode in self.unstable],
            "sticking": {one.place: one.damping for one in self.sticking},
            "modes": [mode.facts() for mode in self.modes],
        }


def check_count(count: int) -> None:
    """Refuse to look for no modes."""
    if count < 1:
        raise ArgumentError(f"count is {count}: one mode at least has to be wanted")


def modes_of(state: About, count: int) -> Modes:
    """Return the slowest modes about a state, and in small scenes all unstable ones.

    Where they would change as axes turn, and nothing but round bodies does turn, these axes stay at rest.

    Raises
    ------
    ArgumentError
        If none is wanted.
    ModesError
        If the pencil is singular.
    """
    check_count(count)
    found = _slowest(state, count)
    other = state.from_axes_at_rest() if found.uneven else None
    return found if other is None else _slowest(other, count)


def _slowest(state: About, count: int) -> Modes:
    pencil = state.motions.pencil
    try:
        found = eigenpairs(pencil, count)
    except Unfound as error:
        raise ModesError(f"{error}: try another --count") from None
    except np.linalg.LinAlgError as error:
        raise ModesError(f"something moves without mass: {error}") from None
    growing = np.flatnonzero(found.values.real > 0.0)
    kept = np.union1d(np.arange(min(count, len(found.values))), growing)
    modes = tuple(_mode(state, found, int(k)) for k in kept)
    return Modes(state, modes, found.complete, not pencil.large)


def _mode(state: About, found: Eigenpairs, k: int) -> Mode:
    value = complex(found.values[k])
    change = np.asarray(state.motions.basis @ found.vectors[:, k])
    uncertainty = float(found.uncertainty[k])
    # what gyroscopic terms alone lead elsewhere, no damper ends either
    goes_on = bool(found.doubled[k]) or not state.motions.damped
    kind = _kind(state, value, uncertainty, goes_on, change)
    return Mode(k + 1, kind, value, uncertainty, change, state)


def kind_of(value: complex, goes_on: bool) -> str:
    """Return what a motion is by its eigenvalue, and by whether it goes on by itself if nothing resists."""
    if not value:
        return "rigid" if goes_on else "drift"
    if value.real > 0.0:
        return "flutter" if value.imag else "divergence"
    return "vibration" if value.imag else "decay"


def _kind(state: About, value: complex, uncertainty: float, goes_on: bool, change: ComplexArray) -> str:
    kind = kind_of(value, goes_on)
    if kind != "vibration" or state.turning is None or value.real:
        return kind
    # seen from axes that turn, what is shifted or tilted goes round at their rate
    spin = float(np.linalg.norm(state.turning.spin))
    around = abs(value.imag - spin) <= _AT_RATE * spin + uncertainty
    return "rigid" if around and _moves_all(state, change) else "vibration"


def _moves_all(state: About, change: ComplexArray) -> bool:
    """Tell whether everything is shifted and turned as one."""
    scene, x = state.scene, state.motions.x[None]
    units = Turning.about_mass(list(scene.bodies.values()), scene.system.equations, x[0])
    rigid = np.array([one.rates(x)[0] for one in units])
    weighted = scene.system.equations.momentum(x, rigid)
    own = np.linalg.lstsq(weighted @ rigid.T, weighted @ change, rcond=None)[0]
    left = change - own @ rigid
    return bool(_energy(state, left).sum() <= _RIGID * _energy(state, change).sum())


def _energy(state: About, change: ComplexArray) -> Array:
    """Return twice the kinetic energy of each coordinate, shape (n_x,)."""
    parts = np.stack([change.real, change.imag])
    return np.asarray(
        np.sum(parts * state.scene.system.equations.momentum(state.motions.x[None], parts), axis=0)
    )


def _largest(state: About, change: ComplexArray) -> float:
    """Return the largest change of a coordinate, over what these change by at large."""
    return float(np.abs(change / state.scene.units).max())


def _shapes(state: About, change: ComplexArray) -> dict[str, ComplexArray]:
    """Return displacements of all outlines by a change of the coordinates, by central differences."""
    step = _STEP / _largest(state, change)
    moves = step * np.stack([change.real, -change.real, change.imag, -change.imag])
    moved = state.motions.x + moves
    found = {}
    for name, body in state.scene.bodies.items():
        points = body.outline(moved)
        found[name] = (points[0] - points[1] + 1j * (points[2] - points[3])) / (2.0 * step)
    return found


def _scale(state: About, shapes: dict[str, ComplexArray], change: ComplexArray) -> complex:
    """Return the factor that makes the largest displacement, or of turns alone the largest, one and real."""
    every = np.concatenate([shape.ravel() for shape in shapes.values()])
    k = int(np.argmax(np.abs(every))) if len(every) else 0
    largest = complex(every[k]) if len(every) else 0.0
    if abs(largest) <= _TURNS_ONLY * state.size * _largest(state, change):
        largest = complex(change[int(np.argmax(np.abs(change)))])
    return 1.0 / largest
