"""Tapes: what an array function does, written down once and replayed natively.

The NumPy code is the only description of what is computed.  It runs once on `Traced` arrays, which write down
each operation with the memory of its operands (`hfsim.maths.recorder`); all memory made meanwhile is kept, so
that the operations can be repeated on it by `hfsim.maths._replay`, without a call of Python each.  What comes
from outside is a constant, but for inputs.

What cannot be written down as such an operation is a call back to Python on the same memory; where values of
the state decide what is done next, `Refused` is raised, and the caller goes on in NumPy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.kernel import replay
from hfsim.maths.traced import Refused, Traced, address, owner, plain

DIMS, OPERANDS = 5, 4
"""Dimensions and operands of an operation at most, as in ``_replay.c``."""
CODES: dict[str, int] = {} if replay is None else replay.CODES
"""Codes of operations."""
WORDS = 3 + DIMS + OPERANDS * (1 + DIMS)
"""Numbers of 8 bytes that an operation takes: code, dimensions, shape, addresses, strides, one more."""
FIRST_STRIDE = 2 + DIMS + OPERANDS
REAL, COMPLEX, TRUTH = np.dtype(float), np.dtype(complex), np.dtype(bool)
KINDS = {REAL: "d", COMPLEX: "D", TRUTH: "b"}
"""How codes of operations name types of numbers."""
SPARSE = 0.2
"""Part of a constant matrix that is not zero, up to which a product is done entry by entry."""
NARROW = 4
"""Columns below which a product of matrices is done as that of their transposes."""

_Region = tuple[int, int | None]
"""Memory that an operation reads or writes: a buffer, and one part of its complex numbers or None for all."""


class Program:
    """Operations to be repeated."""

    def __init__(self, rows: Sequence[Sequence[int]], calls: list[Callable[[], None]], memory: Any) -> None:
        self._memory = memory
        self.rows, self.calls = np.array(rows, dtype=np.int64).reshape(-1, WORDS), calls

    def __len__(self) -> int:
        """Return the number of operations."""
        return len(self.rows)

    def __call__(self) -> None:
        """Repeat them."""
        assert replay is not None
        replay.run(self.rows, self.calls)


def iterated(
    programs: tuple[Program, Program, Program],
    sizes: tuple[Array, Array],
    limits: tuple[float, float, float, float],
    most: int,
) -> tuple[bool, int]:
    """Repeat what finds a correction and what adds it until an iteration ends.

    Parameters
    ----------
    programs : tuple of Program
        What finds a correction; what adds it if it is small, and if it is not.
    sizes : tuple of ndarray, shape ()
        Where the first one writes the size of the correction's consequence, and of the correction.
    limits : tuple of float
        Those of `hfsim.integrators._ending.Ending`, and below what size a correction is small.
    most : int
        Corrections at most.

    Returns
    -------
    converged : bool
    count : int
        Corrections made.
    """
    assert replay is not None
    count = replay.iterate(*(one.rows for one in programs), programs[0].calls, *sizes, *limits, most)
    return count > 0, abs(count)


class Tape:
    """Memory and the operations on it.

    Attributes
    ----------
    calls : list of callable
        Operations that are done by Python.
    """

    def __init__(self) -> None:
        self.calls: list[Callable[[], None]] = []
        self.told: list[str] = []
        self._rows: list[list[int]] = []
        self._uses: list[tuple[_Region | None, list[_Region]]] = []
        self._known: dict[int, np.ndarray] = {}
        self._inputs: set[int] = set()
        self._constants: dict[Any, tuple[np.ndarray, np.ndarray]] = {}
        self._kept: list[np.ndarray] = []
        self._cuts = [0]

    # ------------------------------------------------------------------ memory

    def input(self, a: Array) -> Any:
        """Return a traced copy of an array that is to be another one at every replay."""
        own = np.array(a)
        self._inputs.add(id(own))
        return self.own(own)

    def own(self, a: np.ndarray) -> Any:
        """Return an array, which nobody else may change, as traced memory."""
        self._known[id(a)] = a
        return a.view(Traced)

    def reads(self, a: np.ndarray) -> bool:
        """Whether any program reads an input."""
        return bool(self.calls) or id(owner(a)) in self._read

    def knows(self, a: np.ndarray) -> bool:
        """Whether an array lies in traced memory."""
        return id(owner(a)) in self._known

    def constant(self, a: Any) -> np.ndarray:
        """Return an array that is what it is now at every replay, whatever becomes of it elsewhere."""
        a = plain(a)
        key = address(a), a.shape, a.strides, a.dtype
        if key not in self._constants:
            self._constants[key] = a, a.copy()  # the array itself, so that nothing else gets its address
        return self._constants[key][1]

    def keep(self, a: Any) -> Any:
        """Return an array that nobody else has; it is kept."""
        self._kept.append(a)
        return a

    # ------------------------------------------------------------------ operations

    def row(
        self,
        code: str,
        shape: tuple[int, ...],
        operands: Sequence[np.ndarray],
        strides: Sequence[tuple[int, ...]],
        order: int = 0,
    ) -> None:
        """Write down an elementwise operation on operands, the first of which is written.

        Parameters
        ----------
        code : str
        shape : tuple of int
        operands : sequence of ndarray
        strides : sequence of tuple of int
            Of each operand, as broadcast to the shape [bytes].
        order : int
            The operand whose memory is passed through in order.
        """
        if 0 in shape:
            return
        dims = [d for d in zip(shape, *strides) if d[0] != 1]  # noqa: B905
        if len(dims) > 1:
            dims.sort(key=lambda d: -abs(d[1 + order]))
        merged: list[tuple[int, ...]] = []
        for n, *steps in dims:
            if merged and merged[-1][1:] == tuple([n * step for step in steps]):
                merged[-1] = (merged[-1][0] * n, *steps)
            else:
                merged.append((n, *steps))
        merged = merged or [(1, *[8] * len(operands))]
        if len(merged) > DIMS:
            raise Refused("too many dimensions")
        row = [0] * WORDS
        row[:2] = CODES[code], len(merged)
        for d, (n, *steps) in enumerate(merged):
            row[2 + d] = n
            row[FIRST_STRIDE + d : FIRST_STRIDE + d + DIMS * len(steps) : DIMS] = steps
        row[2 + DIMS : 2 + DIMS + len(operands)] = map(address, operands)
        self._add(row, operands)

    def matmul(self, out: np.ndarray, a: np.ndarray, b: np.ndarray, mode: int = 0) -> None:
        """Write down a product of real matrices, batch by batch: 0 sets ``out``, 1 adds, -1 subtracts."""
        if 0 in out.shape:
            return
        if a.shape[-1] == 0:
            if mode == 0:
                nothing = self.keep(np.zeros(1))
                self.row("copy_d", out.shape, [out, nothing], [out.strides, (0,) * out.ndim])
            return
        if out.ndim == 2 and self._sparse(out, a, b, mode):
            return
        if out.shape[-1] < NARROW <= out.shape[-2]:
            out, a, b = (one.swapaxes(-1, -2) for one in (out, b, a))
        (m, n), k, batch = out.shape[-2:], a.shape[-1], out.shape[:-2]
        operands = out, a, b
        a, b = np.broadcast_to(a, batch + a.shape[-2:]), np.broadcast_to(b, batch + b.shape[-2:])
        (so, to), (sa, ta), (sb, tb) = (one.strides[-2:] for one in (out, a, b))
        several = [d for d in zip(batch, out.strides, a.strides, b.strides, strict=False) if d[0] != 1]
        while several and several[-1][3] == 0 and several[-1][1:3] == (m * so, m * sa):
            m *= several.pop()[0]
        while several and several[-1][2] == 0 and several[-1][1] == n * to and several[-1][3] == n * tb:
            n *= several.pop()[0]
        if len(several) > 2:
            for k in range(batch[0]):
                self.matmul(out[k], a[k], b[k], mode)
            return
        row = [0] * WORDS
        row[:7] = CODES["matmul"], 5, m, k, n, 1, 1
        row[5 : 5 + len(several)] = [d[0] for d in several]
        row[2 + DIMS : 5 + DIMS] = map(address, operands)
        for x, steps in enumerate(((so, 0, to), (sa, ta, 0), (0, sb, tb))):
            first = FIRST_STRIDE + x * DIMS
            row[first : first + 3 + len(several)] = [*steps, *(d[1 + x] for d in several)]
        row[-1] = mode
        self._add(row, operands)

    def _sparse(self, out: np.ndarray, a: np.ndarray, b: np.ndarray, mode: int) -> bool:
        """Write down a product with a constant that is mostly zero; return whether it is one."""
        if self.knows(a):
            out, a, b = out.T, b.T, a.T
        if self.knows(a) or a.ndim != 2 or b.ndim != 2 or np.count_nonzero(a) > SPARSE * a.size:
            return False
        rows, columns = np.nonzero(a)
        weights = self.keep((-1.0 if mode < 0 else 1.0) * a[rows, columns])
        places = self.keep(np.stack([out.strides[0] * rows, b.strides[0] * columns], axis=1).astype(np.int64))
        if mode == 0:
            self.row("copy_d", out.shape, [out, self.keep(np.zeros(1))], [out.strides, (0, 0)])
        row = [0] * WORDS
        row[:4] = CODES["sparse"], 2, len(weights), out.shape[1]
        row[2 + DIMS : 6 + DIMS] = map(address, (out, weights, b, places))
        row[FIRST_STRIDE + 1], row[FIRST_STRIDE + 2 * DIMS + 1] = out.strides[1], b.strides[1]
        self._add(row, (out, b))
        return True

    def solve(self, out: np.ndarray, a: np.ndarray, b: np.ndarray | None) -> None:
        """Write down the solution of linear equations, batch by batch; without ``b`` an inverse."""
        if 0 in out.shape:
            return
        operands = (out, a) if b is None else (out, a, b)
        batch = out.shape[:-2]
        row = [0] * WORDS
        row[:6] = CODES["solve"], 4, *out.shape[-2:], 1, 1
        row[4 : 4 + len(batch)] = batch
        row[2 + DIMS : 2 + DIMS + len(operands)] = map(address, operands)
        for x, one in enumerate(operands):
            first, steps = FIRST_STRIDE + x * DIMS, np.broadcast_to(one, batch + one.shape[-2:]).strides
            row[first : first + out.ndim] = *steps[-2:], *steps[:-2]
        self._add(row, operands)

    def call(self, function: Callable[[], None]) -> None:
        """Write down a call of Python, on memory that it knows."""
        row = [0] * WORDS
        row[0], row[-1] = CODES["call"], len(self.calls)
        self.calls.append(function)
        self._rows.append(row)
        self._uses.append((None, []))

    def _add(self, row: list[int], operands: Sequence[np.ndarray]) -> None:
        written, *read = map(_region, operands)
        self._rows.append(row)
        self._uses.append((written, read))

    @staticmethod
    def has(code: str) -> bool:
        """Whether there is such an operation."""
        return code in CODES

    @contextmanager
    def attempt(self) -> Iterator[None]:
        """Take back what was written down since, if it is refused."""
        rows, calls = len(self._rows), len(self.calls)
        try:
            yield
        except Refused:
            del self._rows[rows:], self._uses[rows:], self.calls[calls:]
            raise

    # ------------------------------------------------------------------ programs

    def poison(self) -> None:
        """Fill all memory that is no input with what is no number: what nothing writes is then seen."""
        for key, memory in self._known.items():
            if key not in self._inputs and memory.dtype != TRUTH:
                plain(memory).fill(np.nan)

    def cut(self) -> None:
        """End a program; what follows is another one."""
        self._cuts.append(len(self._rows))

    def programs(self, *outputs: np.ndarray) -> list[Program]:
        """Return all programs without operations that lead to no output and no input."""
        alive = self._inputs | {id(owner(one)) for one in outputs}
        if self.calls:
            alive |= set(self._known)
        read: set[_Region] = set()
        kept = [False] * len(self._rows)
        for _ in range(2):  # programs may be repeated: what an earlier operation reads, a later one writes
            for k in range(len(self._rows) - 1, -1, -1):
                written, needed = self._uses[k]
                if written is None or written[0] in alive or _touches(written, read):
                    kept[k] = True
                    read.update(needed)
        self._read = {buffer for buffer, _ in read}
        memory = self._known, self._constants, self._kept
        return [
            Program([self._rows[k] for k in range(first, last) if kept[k]], self.calls, memory)
            for first, last in zip(self._cuts, self._cuts[1:], strict=False)
        ]


def offsets(a: np.ndarray) -> IntArray:
    """Return the distance of each entry from the first one [bytes], of the shape of the array."""
    places = np.zeros(a.shape, dtype=np.int64)
    for axis, (n, stride) in enumerate(zip(a.shape, a.strides, strict=True)):
        places += (stride * np.arange(n)).reshape((-1,) + (1,) * (a.ndim - 1 - axis))
    return places


def _region(a: np.ndarray) -> _Region:
    whole = owner(a)
    if a.dtype != REAL or getattr(whole, "dtype", None) != COMPLEX or any(step % 16 for step in a.strides):
        return id(whole), None
    return id(whole), (address(a) - address(whole)) % 16 // 8


def _touches(written: _Region, read: set[_Region]) -> bool:
    buffer, part = written
    parts = (None, 0, 1) if part is None else (None, part)
    return any((buffer, one) in read for one in parts)
