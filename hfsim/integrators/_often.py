"""Functions of a problem that are replayed natively from when they turn out to be called often."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from math import inf
from threading import get_ident
from typing import Any, TypeVar

from hfsim.integrators._memory import Remembering
from hfsim.maths import kernel
from hfsim.maths.replayed import UNREADABLE, Replayed
from hfsim.maths.traced import Recording
from hfsim.mechanics.many_forces import SLOPES

MOST = 1000
"""Coordinates up to which calls cost so much that replaying pays."""
EARLY = 3
"""Steps before which nothing is said of those to come while they grow."""
GROWING = 1.5
"""Growth of a step from which they do."""
SEEN = 2
"""Calls of a function after which it may be recorded."""
MANY = 10
"""Calls to come from which recording a function, which takes as long as three to eight of them, pays."""
SLOPES_FROM = 4
"""The same of slopes of many forces, which takes as long as two of them at any size."""
LARGE = 100
"""Coordinates from which more must be to come: a recording takes ever more of them."""

_Found = TypeVar("_Found")


def _many(n: int, many_forces: bool = False) -> float:
    """Return the number of calls beyond which a recording pays, with so many coordinates.

    Of many small forces calls of Python take most of the time, however many coordinates there are.
    """
    return MANY * max(1.0, n / LARGE) ** (1 if many_forces else 2)


class Recordings(dict[int, dict[Any, Any]]):
    """What is replayed of the equations, by thread; it does not go along into other processes."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Recordings, ()

    @property
    def mine(self) -> dict[Any, Any]:
        """What this thread has: a recording works on memory of its own."""
        return self.setdefault(get_ident(), {})

    def made(self, key: Any, make: Callable[[], _Found]) -> _Found | None:
        """Return a recording of this thread, made when it is first asked for; None if it cannot be made."""
        kept = self.mine
        if key not in kept:
            try:
                kept[key] = make()
            except UNREADABLE as why:
                kept[key] = why
        return None if isinstance(kept[key], Exception) else kept[key]

    def replayed(self, kind: str, function: Callable[..., _Found]) -> Replayed[_Found]:
        """Return a function, replayed from when it is first called, by what names it and its shapes."""
        kept = self.mine
        found: Replayed[_Found] | None = kept.get(kind)
        if found is None:
            found = kept[kind] = Replayed(function)
        return found

    @staticmethod
    def pay(calls: float, n: int) -> bool:
        """Tell whether recordings of functions that are called so often pay, with so many coordinates."""
        return kernel.KERNEL == "native" and n <= MOST and calls > _many(n)


class Often(Remembering):
    """Which functions are replayed in a run.

    That is decided between two steps, from what was counted before and the pace of the run, or at once for
    what is sure to be called often, and remembered: both ways differ in rounding, and a run that is put down
    goes on to the last bit.

    Parameters
    ----------
    recordings : Recordings, optional
        Where recordings are kept, for each thread; without it nothing is replayed.
    start, end : float
        Times between which a run is to be made.
    n : int
        Number of coordinates.
    many_forces : bool
        Whether there are many forces, each computed by itself.
    """

    def __init__(
        self,
        recordings: Recordings | None = None,
        start: float = 0.0,
        end: float = 0.0,
        n: int = 0,
        many_forces: bool = False,
    ) -> None:
        self._start, self._end = start, end
        self.duration = end - start
        """Of the run [s]."""
        self._many = _many(n, many_forces) if n <= MOST or many_forces else inf
        self._wanted = recordings is not None and kernel.KERNEL == "native"
        self._recordings = Recordings() if recordings is None else recordings
        self._steps = 0
        self._asked: dict[str, int] = {}
        self.chosen: tuple[str, ...] = ()
        """Sorted."""

    def call(
        self,
        kind: str,
        function: Callable[..., _Found],
        given: tuple[Any, ...],
    ) -> _Found:
        """Return what a function returns.

        Parameters
        ----------
        kind : str
            Names the function and the shapes of the arrays, in all runs of a scene.
        function : callable
        given : tuple
            Numbers and arrays.
        """
        if Recording.tape is not None or not self.ask(kind):
            return function(*given)
        return self._recordings.replayed(kind, function)(*given)

    def ask(self, kind: str) -> bool:
        """Tell whether a function is replayed; if not, count the call."""
        if kind in self.chosen or not self._wanted:
            return self._wanted
        self._asked = {**self._asked, kind: self._asked.get(kind, 0) + 1}
        return False

    def _pays(self, kind: str, calls: float) -> bool:
        return calls > (SLOPES_FROM if kind.startswith(SLOPES) else self._many)

    def rest(self, t: float) -> float:
        """Return how long the run goes on from a time [s]."""
        return self._end - t

    def need(self, kind: str, calls: float) -> None:
        """Replay from now on what is to be called so often, if that pays."""
        if kind not in self.chosen and self._pays(kind, calls):
            self.take(kind)

    def take(self, *kinds: str) -> None:
        """Replay from now on what is sure to be called often."""
        if self._wanted:
            self.chosen = tuple(sorted({*self.chosen, *kinds}))

    def expect(self, t: float, h: float, following: float) -> None:
        """Choose what is to be replayed from now on.

        Parameters
        ----------
        t, h : float
            When a step ended, and its length [s].
        following : float
            Length of the next one.
        """
        self._steps += 1
        if not self._asked or (self._steps < EARLY and following > GROWING * h):
            return
        # at the pace of the whole run, or at that of its last step if that is longer
        share = (self._end - t) / max(t - self._start, h * self._steps)
        seen = ((kind, asked) for kind, asked in self._asked.items() if asked > SEEN)
        many = [kind for kind, asked in seen if self._pays(kind, asked * share)]
        if many:
            self.take(*many)
            self._asked = {kind: asked for kind, asked in self._asked.items() if kind not in many}

    def replayed(self) -> bool:
        """Tell whether any function was."""
        kept = (self._recordings.mine.get(kind) for kind in self.chosen)
        return any(isinstance(one, Replayed) and one.refused is None for one in kept)

    def memory(self) -> dict[str, Any]:
        """Return what was counted and chosen."""
        names, asked = tuple(self._asked), tuple(self._asked.values())
        return {"steps": self._steps, "asked": asked, "names": names, "chosen": self.chosen}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as the one did whose memory this is."""
        self._steps, self.chosen = memory["steps"], tuple(map(str, memory["chosen"]))
        self._asked = dict(zip(map(str, memory["names"]), map(int, memory["asked"]), strict=True))

    @contextmanager
    def supposed(self, chosen: Iterable[str]) -> Iterator[None]:
        """For the time being, replay these and no others."""
        before = self.chosen, self._asked
        self.chosen = tuple(map(str, chosen))
        try:
            yield
        finally:
            self.chosen, self._asked = before
