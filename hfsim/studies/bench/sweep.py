"""The grid of a bench: methods, tolerances or steps, models and meshes."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hfsim.deck.source import refuse_unknown
from hfsim.errors import ArgumentError
from hfsim.integrators import METHODS
from hfsim.parts.bodies import BeamSpec
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.loading import LoadedDeck

TOLERANCES = tuple(10.0**-k for k in range(3, 11))
"""Those that are tried where none are named."""
LOOSEST = 0.1


@dataclass(frozen=True)
class Sweep:
    """What is varied.

    Attributes
    ----------
    tolerances : tuple of float
        Loosest first [-]; not used with `steps`.
    steps : tuple of float
        Fixed steps, longest first [s]; empty: steps follow the tolerances.
    elements : tuple of int
        Elements of every beam; empty: as in the deck.
    degrees : tuple of int
        Degrees of every beam of cable elements; empty: as in the deck.
    repeats : int
        How often a short point is timed.
    """

    methods: tuple[str, ...]
    models: tuple[str, ...]
    tolerances: tuple[float, ...] = TOLERANCES
    steps: tuple[float, ...] = ()
    elements: tuple[int, ...] = ()
    degrees: tuple[int, ...] = ()
    repeats: int = 3

    def completed(self, loaded: LoadedDeck) -> Sweep:
        """Return the same with defaults where nothing is named.

        Raises
        ------
        ArgumentError
            If a name is unknown or a number out of range.
        """
        refuse_unknown("method", self.methods, METHODS)
        refuse_unknown("model", self.models, MODELS)
        solve = loaded.deck.solve
        if self.tolerances and self.steps:
            raise ArgumentError("tolerances or steps are varied, not both")
        if any(tolerance > LOOSEST for tolerance in self.tolerances):
            raise ArgumentError(f"a tolerance above {LOOSEST:g} says nothing")
        if any(not 3 <= degree <= 12 for degree in self.degrees):
            raise ArgumentError("degrees go from 3 to 12")
        if any(step > solve.duration for step in self.steps):
            raise ArgumentError(f"a step is longer than the run, {solve.duration:g} s")
        return replace(
            self,
            methods=self.methods or tuple(METHODS),
            models=self.models or (solve.model,),
            tolerances=self.tolerances or TOLERANCES,
        )

    @property
    def levels(self) -> list[float]:
        """Steps or tolerances, cheapest first."""
        return sorted(self.steps or self.tolerances, reverse=True)

    @property
    def meshes(self) -> list[tuple[int | None, int | None]]:
        """Elements and degree of each mesh; None: as in the deck.

        With several degrees, meshes are left out that are finer, by their number of vectors, than the
        finest one of the lowest degree: they would take most of the time and compare with nothing.
        """
        degrees: list[int | None] = [*sorted(self.degrees)] or [None]
        if not self.elements:
            return [(None, degree) for degree in degrees]
        pairs = [(n, degree) for degree in degrees for n in sorted(self.elements)]
        return [(n, p) for n, p in pairs if p is None or n == 1 or n * (p - 1) <= self._finest]

    @property
    def _finest(self) -> int:
        return max(self.elements, default=1) * (min(self.degrees, default=3) - 1)

    @property
    def fine_mesh(self) -> tuple[int | None, int | None, int]:
        """Elements, degree and a factor on the elements of a mesh about twice as fine as the finest one."""
        degree = max(self.degrees, default=None)
        if not self.elements or degree is None:
            return max(self.elements, default=None), degree, 2
        return -(-2 * self._finest // (degree - 1)), degree, 1


def with_mesh(loaded: LoadedDeck, count: int | None, degree: int | None, times: int = 1) -> LoadedDeck:
    """Return the deck with `times` `count` elements of a degree in every beam; None leaves what there is."""
    bodies = dict(loaded.deck.bodies)
    for name, spec in bodies.items():
        if isinstance(spec, BeamSpec):
            order = {} if degree is None or spec.element != "cable" else {"degree": degree}
            mesh = {"elements": times * (count or spec.elements), **order}
            bodies[name] = spec.model_copy(update=mesh)
    return replace(loaded, deck=loaded.deck.model_copy(update={"bodies": bodies}))
