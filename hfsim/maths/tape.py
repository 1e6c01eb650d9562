"""Tapes: what an array function does, written down once and replayed natively.

The NumPy code is the only description of what is computed.  It runs once on `Traced` arrays, which write down
each operation with the memory of its operands (`hfsim.maths.recorder`); all memory made meanwhile is kept, so
that the operations can be repeated on it by `hfsim.maths._replay`, without a call of Python each.  What comes
from outside is a constant, but for inputs.  Nothing is computed meanwhile: no number is in that memory until
the operations are done, so that one that NumPy takes out of it unnoticed shows later.

What cannot be written down as such an operation is a call back to Python on the same memory; where values of
the state decide what is done next, `Refused` is raised, and the caller goes on in NumPy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from itertools import pairwise
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy import array  # itself, also while something stands in for it

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.kernel import replay
from hfsim.maths.traced import Refused, Traced, is_traced, plain, recorder

_Made = TypeVar("_Made")

CODES: dict[str, int] = {} if replay is None else replay.CODES
"""Codes of operations."""
WORDS = 32
"""Numbers of 8 bytes that an operation takes, as in ``_replay.h``; the first one is its code."""
NOTHING = np.zeros((0, WORDS), dtype=np.int64)
"""No operations."""
REAL, COMPLEX, TRUTH = np.dtype(float), np.dtype(complex), np.dtype(bool)
KINDS = {one: one for one in (REAL, COMPLEX, TRUTH)}
"""Types of numbers that are written down."""


class Program:
    """Operations to be repeated."""

    def __init__(self, rows: np.ndarray, calls: list[Callable[[], None]], memory: Any) -> None:
        self.memory = memory
        self.rows, self.calls = rows, calls

    def __len__(self) -> int:
        """Return the number of operations."""
        return len(self.rows)

    def __call__(self) -> None:
        """Repeat them."""
        assert replay is not None
        replay.run(self.rows, self.calls)


def marched(
    programs: Sequence[Program],
    memory: Sequence[Array],
    rule: Array,
    state: Array,
    rows: Array,
    before: tuple[Array, Array],
) -> bool:
    """Make ordinary steps, as many as there are rows for, and try one more; see ``_repeat.c``.

    Parameters
    ----------
    programs, memory, rule, state
        As in `hfsim.integrators._ordinary`; the state is changed.
    rows : ndarray
        Where kept steps are written.
    before : tuple of ndarray
        Where the state before the attempt, and the place where its derivative was taken, are.

    Returns
    -------
    bool
        Whether one more was tried.
    """
    assert replay is not None
    arrays = (*memory, rule, state, *before, rows)
    tried: bool = replay.march(tuple([one.rows for one in programs]), arrays, programs[0].calls)
    return tried


def joined(programs: Sequence[Program]) -> Program:
    """Return programs of one tape, one after another, as one."""
    return Program(np.concatenate([one.rows for one in programs]), programs[0].calls, programs[0].memory)


class Tape:
    """Memory and the operations on it.

    Attributes
    ----------
    core : hfsim.maths._replay.Tape
        What writes operations down.
    calls : list of callable
        Operations that are done by Python.
    told : list of str
        Their names.
    """

    operations: ClassVar[dict[Any, tuple[int, int]]] = {}
    """Codes of NumPy's operations on real numbers and on complex ones."""

    def __init__(self) -> None:
        assert replay is not None
        self.calls: list[Callable[[], None]] = []
        self.told: list[str] = []
        self._kept: list[np.ndarray] = []
        self._lives: dict[int, tuple[Any, np.ndarray, np.ndarray]] = {}
        self._cuts = [0]
        # arrays refer to the core: it must not refer to what refers to arrays, in loops that nothing finds
        self.core: Any = replay.Tape(Traced, Refused, fixed, (REAL, COMPLEX, TRUTH), self.operations)
        self.knows: Callable[[Any], bool] = self.core.knows
        """Whether an array lies in the memory of the tape."""

    # ------------------------------------------------------------------ memory

    def input(self, a: Array) -> Any:
        """Return traced memory for an array like this that is to be set before every replay."""
        return self.core.new(a.shape, a.itemsize, "input")

    def live(self, a: Array) -> Any:
        """Return a traced copy of an array that others change, to be renewed before every replay."""
        if id(a) not in self._lives:
            own = self.input(a)
            self._lives[id(a)] = own, plain(own), a
        return self._lives[id(a)][0]

    def renew(self) -> None:
        """Take over what others have changed."""
        for _, own, a in self._lives.values():
            own[...] = a

    def own(self, a: Any) -> Any:
        """Return traced memory for an array like this."""
        if a.dtype not in KINDS:
            raise Refused(f"numbers of type {a.dtype}")
        return self.core.new(a.shape, a.itemsize)

    def keep(self, a: Any) -> Any:
        """Return an array that nobody else has; it is kept."""
        self._kept.append(a)
        return a

    # ------------------------------------------------------------------ operations

    def call(self, function: Callable[[], None], *memory: Any) -> None:
        """Write down a call of Python, which reads or writes such memory."""
        self.core.call(len(self.calls), *memory)
        self.calls.append(function)

    @contextmanager
    def attempt(self) -> Iterator[None]:
        """Take back what was written down since, and the programs that ended, if it is refused."""
        rows, calls, cuts = len(self.core), len(self.calls), len(self._cuts)
        try:
            yield
        except Refused:
            self.core.keep(rows)
            del self.calls[calls:], self._cuts[cuts:]
            raise

    def if_recorded(self, make: Callable[..., _Made], *given: Any) -> _Made | None:
        """Return what is made by writing down operations; None, and nothing of it, if that is refused."""
        try:
            with self.attempt():
                return make(*given)
        except Refused:
            return None

    # ------------------------------------------------------------------ programs

    def cut(self) -> None:
        """End a program; what follows is another one."""
        self._cuts.append(self.core.cut())

    def programs(self, *outputs: np.ndarray) -> list[Program]:
        """Return all programs without operations that lead to no output, no input and no call."""
        kept, found = self.core.live(*outputs)
        rows = np.frombuffer(found, dtype=np.int64).reshape(-1, WORDS)
        cuts, memory = [kept.count(1, 0, cut) for cut in self._cuts], (self.core, self._kept)
        return [Program(rows[first:last], self.calls, memory) for first, last in pairwise(cuts)]


def fixed(a: Any) -> np.ndarray:
    """Return a copy of what is no memory of a tape: it is what it is now at every replay."""
    if is_traced(a):
        raise Refused("values of the state in a list")
    value = _entries(a) if hasattr(a, "toarray") else array(a)
    # the kernel knows types by identity: what was pickled has its own
    kind = COMPLEX if value.dtype.kind == "c" else KINDS.get(value.dtype, REAL)
    return value.astype(kind, copy=value.dtype is not kind)


def _entries(matrix: Any) -> np.ndarray:
    """Return the entries of a sparse matrix; what is zero, operations leave out."""
    found: np.ndarray = recorder().plainly(matrix.toarray)
    return found


@lru_cache(maxsize=64)
def offsets(shape: tuple[int, ...], strides: tuple[int, ...]) -> IntArray:
    """Return the distance of each entry of an array from the first one [bytes], of its shape."""
    places = np.zeros(shape, dtype=np.int64)
    for axis, (n, stride) in enumerate(zip(shape, strides, strict=True)):
        places += (stride * np.arange(n)).reshape((-1,) + (1,) * (len(shape) - 1 - axis))
    return places
