"""How operations on traced arrays are written down: see `hfsim.maths.tape`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import numpy as np

from hfsim.maths.tape import COMPLEX, KINDS, REAL, Tape, offsets
from hfsim.maths.traced import Refused, Traced, owner, plain

BINARY = {
    np.add: "add",
    np.subtract: "sub",
    np.multiply: "mul",
    np.true_divide: "div",
    np.maximum: "max",
    np.minimum: "min",
    np.power: "pow",
    np.hypot: "hyp",
    np.arctan2: "at2",
    np.less: "lt",
    np.less_equal: "le",
    np.greater: "gt",
    np.greater_equal: "ge",
}
UNARY = {
    np.negative: "neg",
    np.absolute: "abs",
    np.square: "sqr",
    np.sqrt: "sqrt",
    np.sin: "sin",
    np.cos: "cos",
    np.tan: "tan",
    np.exp: "exp",
    np.sinh: "sinh",
    np.cosh: "cosh",
    np.sign: "sign",
    np.conjugate: "conj",
}
REDUCED = {np.add: "radd", np.maximum: "rmax", np.minimum: "rmin"}
COMPARED = {"lt", "le", "gt", "ge"}


# ---------------------------------------------------------------------- operands and results


def _raw(tape: Tape, a: Any) -> np.ndarray:
    """Return the memory of an operand."""
    if not isinstance(a, Traced):
        return tape.constant(a)
    if not tape.knows(a):
        raise Refused("memory of unknown origin")
    return a.view(np.ndarray)


def _cast(tape: Tape, a: Any, dtype: np.dtype[Any]) -> Any:
    if a.dtype == dtype:
        return a
    if not isinstance(a, Traced):
        return a.astype(dtype)
    if (a.dtype, dtype) != (REAL, COMPLEX):
        raise Refused(f"{a.dtype} as {dtype}")
    out = tape.own(np.ndarray(a.shape, dtype))
    _emit(tape, "cast_D", out, a)
    return out


def _emit(tape: Tape, code: str, out: Any, *given: Any) -> None:
    """Write down an elementwise operation; operands that overlap with the result are copied before."""
    target = _raw(tape, out)
    operands = [target]
    for one in given:
        a = _raw(tape, one)
        if owner(a) is owner(target) and not _same(a, target) and np.shares_memory(a, target):
            a = _raw(tape, _copied(tape, a.view(Traced), a.copy()))
        operands.append(a)
    shape = target.shape
    strides = [a.strides if a.shape == shape else np.broadcast_to(a, shape).strides for a in operands]
    tape.row(code, shape, operands, strides)


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    one, other = a.__array_interface__, b.__array_interface__
    alike = a.strides == b.strides and a.shape == b.shape and a.dtype == b.dtype
    return bool(alike and one["data"] == other["data"])


def _copied(tape: Tape, a: Traced, made: np.ndarray) -> Any:
    out = tape.own(made)
    _emit(tape, f"copy_{_kind(made.dtype)}", out, a)
    return out


def _kind(dtype: np.dtype[Any]) -> str:
    if dtype not in KINDS:
        raise Refused(f"numbers of type {dtype}")
    return KINDS[dtype]


def _own(tape: Tape, value: Any) -> Any:
    value = np.asarray(value)
    return tape.own(value if value.flags.owndata and value.flags.writeable else value.copy())


# ---------------------------------------------------------------------- operations


def _ufunc(tape: Tape, ufunc: Any, method: str, inputs: Any, out: Any, how: dict[str, Any]) -> Any:
    if out is not None and not isinstance(out, Traced):
        raise Refused("a result outside of the memory")
    if method == "__call__" and not how:
        if ufunc is np.matmul:
            return _matmul(tape, inputs, out)
        name = BINARY.get(ufunc) or UNARY.get(ufunc)
        if name:
            return _elementwise(tape, ufunc, name, inputs, out)
    if method == "reduce" and ufunc in REDUCED and out is None:
        return _reduce(tape, ufunc, *inputs, **how)
    if out is not None:
        raise Refused(f"{ufunc} into an array")
    return called(tape, getattr(ufunc, method), inputs, how)


def _elementwise(tape: Tape, ufunc: Any, name: str, inputs: Any, out: Any) -> Any:
    raw = [plain(a) if isinstance(a, Traced) else a for a in inputs]
    value = ufunc(*raw)
    loop = np.result_type(*raw) if name in COMPARED or name == "abs" else np.asarray(value).dtype
    if loop not in (REAL, COMPLEX):
        raise Refused(f"{ufunc} of {loop}")
    if name == "pow" and np.ndim(inputs[1]) == 0 and not isinstance(inputs[1], Traced) and inputs[1] == 3:
        return _ufunc(tape, np.multiply, "__call__", (inputs[0] * inputs[0], inputs[0]), out, {})
    code = "copy_d" if (name, loop) == ("conj", REAL) else f"{name}_{KINDS[loop]}"
    if not tape.has(code):
        if out is not None:
            raise Refused(f"{ufunc} into an array")
        return called(tape, ufunc, inputs, {})
    operands = [_cast(tape, a if isinstance(a, np.ndarray) else np.asarray(a), loop) for a in inputs]
    found = _own(tape, value) if out is None else out
    _emit(tape, code, found, *operands)
    if out is not None:
        np.copyto(plain(out), value, casting="same_kind")
    return found


def _reduce(
    tape: Tape, ufunc: Any, a: Any, axis: Any = 0, dtype: Any = None, out: Any = None, keepdims: Any = False,
    initial: Any = np._NoValue, where: Any = True,
) -> Any:  # fmt: skip
    if dtype is not None or out is not None or where is not True or a.dtype not in (REAL, COMPLEX):
        raise Refused("a reduction")
    some = range(a.ndim) if axis is None else axis if isinstance(axis, tuple) else (axis,)
    axes = tuple(x % a.ndim for x in some)
    more = {} if initial is np._NoValue or initial is None else {"initial": initial}
    raw, kind = _raw(tape, a), _kind(a.dtype)
    found = _own(tape, ufunc.reduce(raw, axis=axes, keepdims=True, **more))
    rest = raw
    if more or ufunc is np.add:
        begin = np.ndarray((1,) * a.ndim, a.dtype)
        begin[...] = more.get("initial", 0.0)
        _emit(tape, f"copy_{kind}", found, begin)
    else:
        first = tuple(slice(0, 1) if x in axes else slice(None) for x in range(a.ndim))
        _emit(tape, f"copy_{kind}", found, raw[first].view(Traced))
    target = plain(found)
    strides = tuple(0 if x in axes else step for x, step in enumerate(target.strides))
    tape.row(f"{REDUCED[ufunc]}_{kind}", rest.shape, [target, rest], [strides, rest.strides], order=1)
    if keepdims is not np._NoValue and keepdims:
        return found
    return target.reshape([n for x, n in enumerate(target.shape) if x not in axes]).view(Traced)


def _matmul(tape: Tape, inputs: Any, out: Any) -> Any:
    raw = [_raw(tape, a) for a in inputs]
    if out is not None and any(owner(out) is owner(a) for a in raw):
        raise Refused("a product in place")
    value = np.matmul(*raw)
    if value.dtype not in (REAL, COMPLEX):
        raise Refused("a product of whole numbers")
    found = _own(tape, value) if out is None else out
    a, b = (one if one.dtype in (REAL, COMPLEX) else tape.keep(one.astype(float)) for one in raw)
    target = plain(found)
    if a.ndim == 1:
        a, target = a[None], np.expand_dims(target, -1 if b.ndim == 1 else -2)
    if b.ndim == 1:
        b, target = b[:, None], np.expand_dims(target, -1)
    for one, first, second, mode in _real_products(target, a, b):
        tape.matmul(one, first, second, mode)
    if out is not None:
        plain(out)[...] = value
    return found


def _real_products(out: Any, a: Any, b: Any) -> Iterator[tuple[Any, Any, Any, int]]:
    """Yield the products of real matrices that a product of complex ones is."""
    if out.dtype == REAL:
        yield out, a, b, 0
    elif b.dtype == REAL:
        yield out.real, a.real, b, 0
        yield out.imag, a.imag, b, 0
    elif a.dtype == REAL:
        yield out.real, a, b.real, 0
        yield out.imag, a, b.imag, 0
    else:
        yield out.real, a.real, b.real, 0
        yield out.real, a.imag, b.imag, -1
        yield out.imag, a.real, b.imag, 0
        yield out.imag, a.imag, b.real, 1


def _take(tape: Tape, a: Traced, key: Any) -> Any:
    raw, key = _raw(tape, a), _places(key)
    found = raw[(*key, ...)] if not any(one is Ellipsis for one in key) else raw[key]
    if owner(found) is owner(raw):
        return found.view(Traced)
    places, within = _in_rows(offsets(raw)[key])
    out = tape.own(found.copy(order="C"))
    target, places = plain(out), tape.keep(places)
    strides = [target.strides, within, places.strides]
    tape.row(f"gather_{_kind(a.dtype)}", target.shape, [target, raw, places], strides)
    return out


def _put(tape: Tape, a: Traced, key: Any, value: Any) -> None:
    raw, key = _raw(tape, a), _places(key)
    target = raw[(*key, ...)] if not any(one is Ellipsis for one in key) else raw[key]
    given = _cast(tape, value if isinstance(value, np.ndarray) else np.asarray(value), a.dtype)
    v = _raw(tape, given)
    if owner(target) is owner(raw):
        if not _same(v, target):
            _emit(tape, f"copy_{_kind(a.dtype)}", target.view(Traced), given)
            np.copyto(target, v.copy())
        return
    if owner(v) is owner(raw):
        raise Refused("entries moved in place")
    places, within = _in_rows(offsets(raw)[key])
    v, places = np.broadcast_to(v, places.shape), tape.keep(places)
    strides = [within, v.strides, places.strides]
    tape.row(f"scatter_{_kind(a.dtype)}", places.shape, [raw, v, places], strides, order=1)
    raw[key] = v


def _places(key: Any) -> tuple[Any, ...]:
    keys = key if isinstance(key, tuple) else (key,)
    if any(isinstance(one, Traced) for one in keys):
        raise Refused("places that depend on the state")
    return keys


def _in_rows(places: Any) -> tuple[Any, tuple[int, ...]]:
    """Return the places of rows, and the strides within them, if rows are equally spaced; else all places."""
    strides = [0] * places.ndim
    for axis in range(places.ndim - 1, -1, -1):
        n = places.shape[axis]
        if n < 2:
            continue
        steps = np.diff(places, axis=axis)
        step = int(steps.flat[0]) if steps.size else 0
        if not steps.size or (steps != step).any():
            break
        strides[axis] = step
        places = np.broadcast_to(places.take([0], axis=axis), places.shape)
    return places, tuple(strides)


def called(tape: Any, func: Any, args: Any, kwargs: Any) -> Any:
    """Do a function and write it down as a call of Python on the same memory."""

    def bare(a: Any) -> Any:
        if isinstance(a, Traced):
            return _raw(tape, a)
        return type(a)(map(bare, a)) if type(a) in (list, tuple) else a

    args, kwargs = bare(tuple(args)), {name: bare(value) for name, value in kwargs.items()}
    with tape.paused():
        value = func(*args, **kwargs)
    if isinstance(value, np.ndarray) and tape.knows(value):
        return value.view(Traced)
    several = isinstance(value, list | tuple)
    values = [np.asarray(one) for one in (value if several else [value])]
    if any(one.dtype not in KINDS for one in values) or (not several and isinstance(value, bool | np.bool_)):
        raise Refused(f"{func}")
    outs = [tape.own(one.copy()) for one in values]
    targets = [plain(one) for one in outs]

    tape.told.append(str(func))

    def again() -> None:
        found = func(*args, **kwargs)
        for target, one in zip(targets, found if several else [found], strict=True):
            target[...] = one

    tape.call(again)
    if not several:
        return outs[0]
    return type(value)(*outs) if hasattr(value, "_fields") else type(value)(outs)


class Recorder(Tape):
    """A tape that traced arrays write on."""

    ufunc = _ufunc
    take = _take
    put = _put
    copied = _copied
    cast = _cast
    called = called
    emit = _emit
    raw = _raw
    switch: Callable[[Any], None] = staticmethod(lambda tape: None)
    """Makes a tape, or none, the one that records."""
    functions: ClassVar[dict[Any, Callable[..., Any]]] = {}
    """Functions of NumPy that are written down in a way of their own."""
    transparent: ClassVar[set[Any]] = set()
    """Those that are made of other operations alone."""

    def function(self, func: Any, args: Any, kwargs: Any) -> Any:
        """Do a function of NumPy and write it down."""
        own = self.functions.get(func)
        if own is not None:
            return own(self, *args, **kwargs)
        if func in self.transparent:
            return func._implementation(*args, **kwargs)
        return called(self, func, args, kwargs)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Write nothing down for the time being."""
        self.switch(None)
        try:
            yield
        finally:
            self.switch(self)
