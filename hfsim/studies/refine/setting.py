"""What a refinement chooses, and the moves from one choice to a finer one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hfsim.parts.bodies import BeamSpec
from hfsim.scene.loading import LoadedDeck

_LOOSEST = 1e-3
"""Tolerance to start with, or a tenth of the target."""
_TIGHTEST = 1e-13
_TIGHTER = 30.0
"""Factor by which a move tightens the tolerance."""
_COARSE = 2
"""Elements of each beam to start with, if the deck has more."""
_MAX_DEGREE = 9
"""Highest degree that is chosen: beyond it little is gained, and a change tells little of what is left."""


@dataclass(frozen=True)
class Setting:
    """What the refinement chooses.

    Attributes
    ----------
    mesh : tuple of (body, elements, degree)
        Every beam.
    coordinates, method : str
        As in decks.
    """

    mesh: tuple[tuple[str, int, int], ...]
    tolerance: float
    coordinates: str = "auto"
    method: str = "auto"

    def applied(self, loaded: LoadedDeck) -> LoadedDeck:
        """Return the deck with this setting, and without a target or elements left open."""
        bodies = dict(loaded.deck.bodies)
        for name, elements, degree in self.mesh:
            bodies[name] = bodies[name].model_copy(update={"elements": elements, "degree": degree})
        none = dict.fromkeys(("target_error", "target_channels", "budget"))
        mine = {"tolerance": self.tolerance, "coordinates": self.coordinates, "method": self.method}
        solve = loaded.deck.solve.model_copy(update={**none, **mine})
        deck = loaded.deck.model_copy(update={"bodies": bodies, "solve": solve})
        return replace(loaded, deck=deck, auto_elements=())

    @property
    def vectors(self) -> int:
        """Nodal and interior vectors of all beams."""
        return sum(n * (p - 1) + 2 for _, n, p in self.mesh)


def refined(setting: Setting, kind: str, bodies: Sequence[str]) -> Setting | None:
    """Return a finer setting; None if there is none.

    Parameters
    ----------
    kind : str
        ``elements`` (twice as many), ``degree`` (two more, at most 9) or ``tolerance`` (a 30th).
    bodies : sequence of str
        Beams that are refined.
    """
    if kind == "tolerance":
        tighter = setting.tolerance / _TIGHTER
        return replace(setting, tolerance=float(f"{tighter:.1e}")) if tighter >= _TIGHTEST else None

    def finer(elements: int, degree: int) -> tuple[int, int]:
        if kind == "elements":
            return 2 * elements, degree
        return elements, max(degree, min(degree + 2, _MAX_DEGREE))

    mesh = tuple((name, *(finer(n, p) if name in bodies else (n, p))) for name, n, p in setting.mesh)
    return replace(setting, mesh=mesh) if mesh != setting.mesh else None


def coarse(loaded: LoadedDeck, target: float) -> Setting:
    """Return the setting to begin with: at most two elements a beam to be refined, a loose tolerance."""
    fixed, solve = fixed_meshes(loaded), loaded.deck.solve
    mesh = []
    for name, spec in beams_of(loaded).items():
        most = spec.elements if name in fixed else max(_COARSE, spec.fewest_elements)
        mesh.append((name, min(spec.elements, most), spec.degree))
    return Setting(tuple(mesh), min(_LOOSEST, 0.1 * target), solve.coordinates, solve.method)


def beams_of(loaded: LoadedDeck) -> dict[str, BeamSpec]:
    """Return the beams of a deck by name."""
    return {name: spec for name, spec in loaded.deck.bodies.items() if isinstance(spec, BeamSpec)}


def fixed_meshes(loaded: LoadedDeck) -> tuple[str, ...]:
    """Return the beams whose mesh is kept: those with a number beside others with ``elements: auto``."""
    auto = loaded.auto_elements
    return tuple(name for name in beams_of(loaded) if auto and name not in auto)
