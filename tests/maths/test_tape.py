"""Tapes do what NumPy does, and refuse what they cannot."""

import gc
import pickle
import sys
import threading
import weakref
from itertools import pairwise

import numpy as np
import pytest
from natively import recording

from hfsim.maths import kernel
from hfsim.maths.recorder import Recorder
from hfsim.maths.replayed import Replayed
from hfsim.maths.traced import Refused, apart, outside, plain, row_products, sometimes

pytestmark = pytest.mark.skipif(kernel.KERNEL == "numpy", reason="the kernel was not built")


C = np.random.default_rng(1).standard_normal((5, 7))
Z = np.random.default_rng(2).standard_normal((4, 7, 2)) @ np.array([1.0, 1.0j])
SOME = np.array([3, 0, 2])
RARE = np.zeros((20, 7))
"""A matrix of few entries: none, one, two, three and at the end in its rows."""
RARE[[1, 2, 2, 3, 3, 3, 4], [0, 1, 5, 2, 3, 4, 6]] = np.arange(1.0, 8.0)


def filled(x):
    out = np.zeros((7, 6))
    out[:, SOME] = x[:, :3]
    out[SOME] += 2.0 * x[SOME]
    return out


def overlapping(x):
    out = x.copy()
    out[1:] += out[:-1]
    out[:6, :6] -= out[:6, :6].T
    out[:, 1] += out[:, 0]
    return out


def shifted(x):
    out = np.exp(1j * x)
    out.imag[:, ::2] = x[:, ::2]
    out[:, 0] -= out[:, 5]
    return np.ascontiguousarray(out).view(float)


def swapped(x):
    out, first = x.copy(), x[0, 1]
    out[0, 1], out[1, 1] = out[1, 1], out[0, 1]
    for one in x[:2, 0]:
        one *= 2.0  # a number: nothing of `x` changes
        out[2, 0] += one + first
    return out


def decided(condition, x, y):
    return np.where(condition, x + y, x - y) if sometimes(condition) else x - y


def moved(w2, U, x):
    return (U * np.sqrt(w2)) @ (U.T @ x)


def many(x, y):
    return (x[:, :, None] * y[:, None] + 9.0 * np.eye(6)).reshape(1, 1, 7, 6, 6), y.reshape(1, 1, 7, 6, 1)


BY_PYTHON = ("Python", "outside", "functions", "sums of products by default")
FUNCTIONS = {
    "sums": lambda x, y: x + y[0] - 2.0 * y,
    "powers": lambda x, y: (x**2 + x**3) / (y * y),
    "numbers": lambda x, y: (((x[0] * 2.0 + y[0]) * 3.0 - 1.5) * 0.5 + 4.0) * y,
    "functions": lambda x, y: np.sin(x) * np.cosh(y) + np.arctan2(x, y) + np.hypot(x, y) + np.sqrt(np.abs(x)),
    "extremes": lambda x, y: np.maximum(x, y) + np.minimum(x, 0.0) + np.abs(x).max() + y.min(axis=0),
    "products": lambda x, y: C @ (x @ y.T),
    "products of vectors": lambda x, y: (C @ x[:, 0]) * (x[0] @ y[1]),
    "products of batches": lambda x, y: (x[:, None, :] @ y[:, :, None])[:, 0, 0],
    "products of complex numbers": lambda x, y: ((Z @ x) @ (1j * y).T).real,
    "half of a product": lambda x, y: (Z @ (x + 1j * y)).imag,
    "small products": lambda x, y: (x + 1j * y).reshape(7, 2, 3) @ (y - 2j * x).reshape(7, 3, 2),
    "few entries": lambda x, y: RARE @ x + ((y.T - 2j * x.T) @ RARE.T).T.imag + RARE[:, :6] @ y[:6],
    "few entries of batches": lambda x, y: (
        (np.stack([x.T, y.T]) @ RARE.T)[1] + (x.T[None] @ RARE.T)[0] + (RARE @ np.stack([x, y])).sum(axis=0).T
    ),
    "batches that do not go on": lambda x, y: (
        np.stack([x, y]).swapaxes(1, 2) @ RARE.T
        + x.T[None] @ np.stack([RARE.T, 2.0 * RARE.T])
        + (RARE @ np.broadcast_to(x, (2, 7, 6))).swapaxes(1, 2)
    ),
    "few columns": lambda x, y: (x[:, :2] * 2.0 - y[:, 1:3]).T @ np.maximum(x[:, 3:], y[:, None, 0])[:, ::2],
    "dot": lambda x, y: np.dot(C, x.reshape(7, -1)),
    "selections": lambda x, y: x.take(SOME, axis=0) * 2.0 + y[:3] + x[[1, 1, 4]],
    "products of rows": lambda x, y: (
        row_products(x, np.array([[0, 6], [6, 2]]), y[:, ::-1], np.array([[1, 1], [0, 5]])).sum(axis=0)
        + row_products(x.T.copy(), SOME, y.reshape(6, 7), SOME[::-1])[1:, :6].sum(axis=0)
    ),
    "columns": lambda x, y: x[:, SOME] + y[:, [1, 1, 2]],
    "writing": lambda x, y: filled(x) * y,
    "entries": lambda x, y: swapped(x) + x * y,
    "overlapping": lambda x, y: overlapping(x) + y,
    "totals of many": lambda x, y: (x * y).sum() + x[:, ::2].sum() + np.add.reduce(1j * x, axis=None),
    "totals": lambda x, y: x.sum(axis=0) + np.sum(x * y, axis=-1)[:6] + np.add.reduce(x).sum(),
    "totals inside": lambda x, y: np.add.reduce((x * y).reshape(7, 2, 3), axis=1),
    "cumulative": lambda x, y: np.cumsum(x[:, ::-1], axis=-1)[:, ::-1] * y,
    "joined": lambda x, y: np.concatenate([x, y[:2], np.stack([x[0], y[0]])]),
    "choices": lambda x, y: np.where(x > y, x, 2.0 * y),
    "complex": lambda x, y: np.abs((x + 2j * y) * (1 + 2j)) + ((x + 1j) / (y + 1j)).conj().imag,
    "parts": lambda x, y: shifted(x),
    "repeated": lambda x, y: np.repeat(x[:1], 7, axis=0) * y,
    "bins": lambda x, y: np.bincount(np.array([0, 2, 2, 5]), weights=x[0, :4], minlength=7)[:, None] * y,
    "transposed": lambda x, y: np.ascontiguousarray(x.T).T + np.swapaxes(y.T, 0, 1),
    "turned": lambda x, y: x - y.reshape(6, 7).T * (2.0 * x.reshape(6, 7).T),
    "linear equations": lambda x, y: np.linalg.solve(x[:6], y[:6]) + np.linalg.solve(y[:6].T, x[0]),
    "linear equations in batches": lambda x, y: np.linalg.solve(
        (x[:, :, None] * y[:, None] + 3.0 * np.eye(6)).reshape(1, 7, 6, 6)[:, :, ::-1], y[:, :, None]
    ),
    "complex equations": lambda x, y: np.linalg.solve(x[:6] + 1j * y[:6], C[:1, :6].T).imag * y[:6],
    "constant matrix": lambda x, y: np.linalg.solve(C[:, :5], x[:5]) + np.linalg.solve(x[:5, :5], C[:, :1]),
    "inverses": lambda x, y: np.linalg.inv((x * y)[:6]) + np.linalg.inv(x[:6].T),
    "complex inverses": lambda x, y: (
        np.linalg.inv(np.stack([x[:6] + 1j * y[:6], 1j * x[:6]]))[:, ::2, 1:4].imag
    ),
    "products with inverses": lambda x, y: (
        np.linalg.inv(np.stack([x[:6] + 1j * y[:6], 1j * x[:6]])) @ y[1:, :2]
    ),
    "modes": lambda x, y: moved(*np.linalg.eigh((x + y)[:6] @ (x + y)[:6].T), x[:6]),
    "bases": lambda x, y: np.linalg.qr(x[:, :4], mode="complete")[0] @ y,
    "triangles": lambda x, y: (
        np.linalg.qr(y[:3], mode="complete")[1] + np.linalg.qr(x[:3, :2], mode="complete")[1][1, 1]
    ),
    "dyads": lambda x, y: np.outer(x[:, 0], y[0]) + np.kron(x[:1], y[:, :1]) + np.kron(x[0, :3], y[:, :2]),
    "equal numbers": lambda x, y: np.where(np.rint(x) == np.rint(y), x, np.where(np.rint(x) != 0.0, 1.0, y)),
    "rounded": lambda x, y: np.round(3.0 * x) + np.full_like(x, 2.0) * np.broadcast_arrays(x, y[:1])[1],
    "growth": lambda x, y: np.tanh(x) * np.log(np.abs(y)) + np.clip(x, -0.3, y[0]),
    "arcs": lambda x, y: np.arcsin(np.sin(x)) + np.arccos(np.cos(y)) * np.arctan(x),
    "sums of products": lambda x, y: (
        np.einsum("bi,ij,bj->b", x, y[:6], x)[:, None] * y
        + np.einsum("bij,jk->bik", x.reshape(7, 2, 3), C[:3, :3]).reshape(7, 6)
    ),
    "sums of products by default": lambda x, y: np.einsum("ij,kj", x, y),
    "equations in many axes": lambda x, y: (
        np.linalg.solve(*many(x, y)) + np.linalg.inv(many(x, y)[0])[..., :1]
    ),
    "Python": lambda x, y: np.linalg.pinv(x) @ y + np.ptp(x, axis=0),
    "decided": lambda x, y: decided(np.abs(x).max() > 1.0, x, y),
    "outside": lambda x, y: outside(lambda a: np.where(a.max() > 0, a, -a), x) * y,
}


def test_waves_are_exact_to_the_last_digit():
    """At all sizes, near their zeros and extremes, and where the C library takes over; products nearly."""
    x = 10.0 ** np.linspace(-12.0, 7.0, 8000) * np.resize([1.0, -1.0], 8000)
    x[::4] = np.rint(x[::4] / (0.5 * np.pi)) * (0.5 * np.pi)
    waves = Replayed(lambda x: (np.sin(x), np.cos(x), np.exp(1j * x), np.exp((1 + 1j) * np.minimum(x, 600))))
    for some in np.concatenate([x, [0.0] * 8]).reshape(8, -1, 1):  # the last ones are far
        some = np.ascontiguousarray(some[:, 0])
        found, expected = waves(some), waves._function(some)
        for one, other, digits in zip(found, expected, (1.5, 1.5, 1.5, 4.0), strict=True):
            for part in ("real", "imag"):
                a, b = getattr(one, part), getattr(other, part)
                assert (np.abs(a - b) <= digits * np.spacing(np.abs(b))).all()
    assert waves.refused is None


def test_growing_functions_are_exact_to_the_last_digits():
    """At all sizes, and where the C library takes over."""
    x = 10.0 ** np.linspace(-12.0, 2.9, 4000) * np.resize([1.0, -1.0], 4000)
    growing = Replayed(lambda x: (np.sinh(x), np.cosh(x), np.abs(np.exp(np.minimum(x, 300)) * (x + 1j))))
    with np.errstate(over="ignore", invalid="ignore"):
        for some in (*x.reshape(8, -1), np.zeros(500)):
            for one, other in zip(growing(some), growing._function(some), strict=True):
                near = np.isfinite(other)
                assert (one[~near] == other[~near]).all()
                assert (np.abs(one - other)[near] <= 4.0 * np.spacing(np.abs(other[near]))).all()
    assert growing.refused is None


@pytest.mark.parametrize("n", [1, 2, 3, 7, 31, 32, 33, 50, 64, 97, 200])
def test_totals_of_all_lengths(n, rng):
    totals = Replayed(lambda x: (x.sum(), x.max(), x.min(), (1j * x).sum().imag, x[::2].sum()))
    for x in rng.standard_normal((3, n)):
        for one, other in zip(totals(x), totals._function(x), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-13)
    assert np.isnan(totals(np.where(np.arange(n) == n // 2, np.nan, 1.0))[1])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_is_replayed_is_what_numpy_does(name, rng):
    function = FUNCTIONS[name]
    x, y = rng.standard_normal((2, 7, 6))
    tape = Recorder()
    inputs = tape.input(x), tape.input(y)
    with recording(tape):
        found = function(*inputs)
    tape.cut()
    assert bool(tape.told) == (name in BY_PYTHON)
    (program,) = tape.programs(found)
    for _ in range(2):
        x, y = rng.standard_normal((2, 7, 6))
        for memory, value in zip(inputs, (x, y), strict=True):
            plain(memory)[...] = value
        program()
        np.testing.assert_allclose(plain(found), function(x, y), rtol=1e-12, atol=1e-12)


def test_recordings_end_with_their_last_user(rng):
    def function(x):
        return np.kron(np.triu(x), np.ones((2, 1))) @ C

    tape = Recorder()
    with recording(tape):
        function(tape.input(rng.standard_normal((3, 5))))
    assert tape.calls
    seen = weakref.ref(tape)
    del tape
    gc.collect()
    assert seen() is None


def test_memory_is_used_anew_within_one_program_alone(rng):
    def where(a):
        return a.__array_interface__["data"][0]

    tape, given = Recorder(), rng.standard_normal((3, 5))
    x = tape.input(given)
    with recording(tape):
        begun = where(2.0 * x)
        one = 1.0 - x
        assert where(one) == begun
        one += 3.0 * x
        tape.cut()
        other = 5.0 * x  # would stand in the memory that 3 x had
        tape.cut()
    first, second = tape.programs(one, other)
    plain(x)[...] = given
    second()
    first()
    np.testing.assert_array_equal(plain(other), 5.0 * given)
    np.testing.assert_allclose(plain(one), 1.0 + 2.0 * given, rtol=1e-14)


@pytest.mark.parametrize(
    "function",
    [
        lambda x: x if x.max() > 0.0 else -x,
        lambda x: x * float(x[0, 0]),
        lambda x: x[np.argsort(x[:, 0])],
        lambda x: sum(x.tolist()[0]) * x,
        lambda x: np.ndarray.transpose(np.ndarray.copy(x)) + 1.0,
    ],
)
def test_what_values_decide_or_cannot_be_followed_is_refused(function, rng):
    tape = Recorder()
    x = tape.input(rng.standard_normal((3, 3)))
    with pytest.raises(Refused), recording(tape):
        function(x)
    assert type(np.zeros(2)) is np.ndarray


def masked(x):
    mask = np.zeros(3, bool)
    mask[:] = x < 0
    return np.where(mask, -x, 0.0) + x


def clipped(x):
    out = np.zeros(3)
    np.clip(x, -9.0, 0.0, out=out)
    return x + out


def inverted(x):
    inverse = np.linalg.inv(np.diag([2.0, 3.0, 4.0]) + 0.0 * x)
    inverse += np.minimum(x, 0.0)
    return (inverse @ x[:, None])[:, 0]


def changing(x):
    constant = np.arange(3.0)
    first = np.minimum(x, 0.0) * constant
    constant[:] = 7.0
    return x + first + np.minimum(x, 0.0) * constant


def listed(x):
    return x.reshape(3, 1) + [np.minimum(x[k : k + 1], 0.0) for k in range(3)]


def spread(x):
    out = np.zeros(3)
    out[np.array([[0, 1], [1, 2]])] = (np.minimum(x[0], 0.0) * np.arange(4.0).reshape(2, 2)).T
    return x + out


HELD = np.arange(3.0)


def written(x):
    held = HELD.copy()
    held[1:] = np.minimum(x[1:], 0.0)
    return x + held


@pytest.mark.parametrize(
    "function",
    [
        masked,
        written,
        lambda x: x + float(np.float64(np.minimum(x, 0.0)[0])),
        clipped,
        inverted,
        changing,
        listed,
        spread,
        lambda x: x + np.arange(1.0, 4.0)[x < 0].sum(),
        lambda x: x + np.sum(np.extract(x < 0, x)),
        lambda x: x + (np.ones((3, 3)) * np.minimum(x, 0.0)).trace(),
        lambda x: x + sum(1.0 for one in x.flat if one < 0),
        lambda x: x + np.full(3, np.minimum(x[0], 0.0)),
        lambda x: x + ((1.0 + 2.0j) * np.minimum(x, 0.0) * np.array([1j, 2.0, 3.0], dtype=np.complex64)).real,
    ],
)
def test_what_is_idle_where_it_is_compared_with_numpy_is_right_later(function):
    """Or refused: a value that is not followed would stay what it was."""
    replayed = Replayed(function)
    for x in np.array([0.5, 0.6, 0.7]), np.array([-0.5, 0.6, -0.7]):
        np.testing.assert_allclose(replayed(x), function(x), rtol=1e-14)


def test_values_go_through_any_number_of_rounds():
    tape, rounds = Recorder(), 5
    x = tape.input(np.zeros(1))
    with recording(tape):
        chain = [np.zeros(1) for _ in range(rounds)]
        tape.cut()
        for one, following in pairwise([*chain, x]):
            one[...] = following
        tape.cut()
    begin, program = tape.programs(chain[0])
    begin()
    for k in range(2 * rounds):
        plain(x)[...] = k
        program()
        assert plain(chain[0])[0] == max(k - rounds + 1, 0)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda tape, x: np.linalg.solve(x, x[:, :1]),
        lambda tape, x: np.linalg.solve(x[:, :2], x[:2, :1]),
        lambda tape, x: np.linalg.solve(x[:2], x[:, :1]),
        lambda tape, x: np.linalg.inv(x),
        lambda tape, x: np.linalg.inv(x[:2]) @ x[:, :1],
        lambda tape, x: np.linalg.eigh(x),
        lambda tape, x: x.sum(axis=0, initial=np.zeros(5)),
        lambda tape, x: np.matmul(x[:2], x[:2, :1], out=np.linalg.inv(x[:2])[:, :1]),
        lambda tape, x: row_products(x, np.array([0, 3]), x, np.array([0, 1])),
        lambda tape, x: row_products(x, np.array([0, 1]), x, np.array([0, -1])),
        lambda tape, x: tape.core.row_products(x, np.arange(3), x, np.arange(3), 2),
        lambda tape, x: np.bincount(np.array([0, -1, 1]), weights=x[:, 0]),
        lambda tape, x: tape.core.new((1 << 40, 1 << 40), 8),
        lambda tape, x: tape.core.new((-1,), 8),
    ],
)
def test_what_would_reach_beyond_memory_is_refused(wrong):
    tape = Recorder()
    x = tape.input(np.zeros((3, 2)))
    with recording(tape), pytest.raises(Refused):
        wrong(tape, x)


def test_numbers_of_other_types_are_refused_before_they_are_written():
    tape = Recorder()
    numbers = tape.input(np.arange(1000.0)).view(np.int64)
    with pytest.raises(Refused), recording(tape):
        np.concatenate([numbers, numbers])


def test_a_tape_that_cannot_begin_keeps_nothing():
    given = object()
    before = sys.getrefcount(given)
    for _ in range(100):
        with pytest.raises(TypeError):
            kernel.replay.Tape(given, given, given, 1, {})
    assert sys.getrefcount(given) == before


def test_what_is_written_behind_the_back_of_a_tape_is_noticed(rng):
    """A function in C fills what `numpy.empty` gave: the recording would repeat the first result for ever."""

    def behind(x):
        out = np.empty(4)
        memoryview(plain(out))[1] = 3.0
        return out * x[0, :4]

    replayed = Replayed(behind)
    x = rng.standard_normal((3, 5))
    assert replayed(x).shape == (4,)
    assert "differ" in str(replayed.refused)


def test_a_refused_part_leaves_no_program():
    tape = Recorder()
    x = tape.input(np.ones(3))
    with recording(tape):
        y = x + 1.0
        tape.cut()
        with pytest.raises(Refused), tape.attempt():
            y *= 2.0
            tape.cut()
            bool(x[0])
    assert len(tape.programs(y)) == 1


def test_constants_from_another_process_are_as_good(rng):
    """Their types are not the same objects."""
    there = pickle.loads(pickle.dumps(C))
    replayed = Replayed(lambda x: there @ x)
    for x in rng.standard_normal((3, 7, 2)):
        assert np.allclose(replayed(x), C @ x)
    assert replayed.refused is None


def test_what_rounding_makes_large_is_no_mistake(rng):
    y = rng.standard_normal((97, 97))
    replayed = Replayed(lambda t, x: x @ y - x[:, ::-1] @ y[::-1])
    for _ in range(2):
        replayed(1.0, rng.standard_normal((97, 97)))
    assert replayed.refused is None


def test_what_remains_constant_by_mistake_is_noticed(rng):
    kept = np.zeros(5)

    def lost(x):
        kept[:] = x[0]
        return kept * x[1]

    replayed = Replayed(lost)
    x = rng.standard_normal((3, 5))
    np.testing.assert_array_equal(replayed(x), x[0] * x[1])
    assert replayed.refused is not None


def test_a_mistake_is_noticed_beside_numbers_that_are_not_finite(rng):
    kept = np.zeros(5)

    def lost(x):
        kept[:] = x[0]
        return np.concatenate([kept * x[1], np.sqrt(x[2, :1])])

    replayed = Replayed(lost)
    x = np.abs(rng.standard_normal((3, 5)))
    x[2, 0] = -1.0
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(replayed(x), np.concatenate([x[0] * x[1], [np.nan]]))
    assert replayed.refused is not None


def test_a_refused_part_is_done_by_python(rng):
    def part(x, out):
        out += x if x.max() > 0.0 else 2.0 * x

    def force(x):
        out = np.zeros_like(x)
        apart(part, x, out)
        apart(lambda x, out: out.__iadd__(x * x) is None or None, x, out)
        return 3.0 * out

    replayed = Replayed(force)
    for _ in range(4):
        x = rng.standard_normal((3, 5))
        x[0, 0] = 4.0
        np.testing.assert_allclose(replayed(x), 3.0 * (x + x * x), rtol=1e-14)
    assert replayed.refused is None
    x = -np.abs(x)
    np.testing.assert_allclose(replayed(x), 3.0 * (2.0 * x + x * x), rtol=1e-14)


@pytest.mark.parametrize("unit", [1.0, 1.0 + 0.0j])
def test_singular_equations_are_told(unit):
    replayed = Replayed(lambda x: (np.linalg.inv(unit * x) * 2.0).real)
    replayed(np.eye(3))
    assert replayed.refused is None
    with pytest.raises(np.linalg.LinAlgError, match="Singular"):
        replayed(np.zeros((3, 3)))


def modes(K):
    """Return eigenvalues, what vectors miss of being those of a matrix, and their products."""
    values, vectors = np.linalg.eigh(K)
    return values, K @ vectors - vectors * values, vectors.T @ vectors


@pytest.mark.parametrize("n", [1, 2, 3, 4, 9, 37, 60])
def test_modes_are_those_of_lapack(n, rng):
    """Graded either way, with eigenvalues that repeat or vanish, large, small, all but diagonal."""
    replayed = Replayed(modes)
    random, sizes = rng.standard_normal((n, n)), 10.0 ** np.linspace(0.0, -14.0, n)
    symmetric, Q = random + random.T, np.linalg.qr(random)[0]
    graded = symmetric * sizes * sizes[:, None]
    some = [symmetric, graded, graded[::-1, ::-1], (Q * (np.arange(n) // 3)) @ Q.T, 1e-290 * symmetric]
    some += [
        1e290 * symmetric,
        np.zeros((n, n)),
        np.ones((n, n)),
        np.diag(np.arange(n) // 2 + 1e-20) + 1e-160,
    ]
    some += [np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1), np.diag(sizes) + 1e-18 * symmetric]
    for K in some:
        values, missed, products = replayed(K)
        assert replayed.refused is None
        size = max(np.abs(values).max(), 1e-300)
        np.testing.assert_allclose(values / size, np.linalg.eigvalsh(K) / size, atol=1e-14, rtol=0.0)
        np.testing.assert_allclose(missed / size, 0.0, atol=1e-14, rtol=0.0)
        np.testing.assert_allclose(products, np.eye(n), atol=1e-14, rtol=0.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("n", [1, 2, 5, 40])
def test_modes_of_what_is_not_finite_are_an_error(n, bad):
    replayed = Replayed(modes)
    K = np.diag(np.arange(1.0, n + 1.0))
    replayed(K)
    assert replayed.refused is None
    K[-1, 0] = bad
    with pytest.raises(np.linalg.LinAlgError, match="did not converge"):
        replayed(K)


@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (5, 0), (39, 3), (6, 6), (5, 8)])
def test_bases_are_those_of_lapack(shape, rng):
    """To the sign, also of columns that depend on one another or vanish."""
    replayed = Replayed(lambda a: np.linalg.qr(a, mode="complete")[0])
    for a in (rng.standard_normal(shape), np.eye(*shape), np.zeros(shape)):
        np.testing.assert_allclose(replayed(a), np.linalg.qr(a, mode="complete")[0], atol=1e-14)
    assert replayed.refused is None
    a = rng.standard_normal(shape)
    a[:, -1:] = a[:, :1]
    Q = replayed(a)
    np.testing.assert_allclose(Q.T @ Q, np.eye(len(a)), atol=1e-14)
    assert np.abs(np.tril(Q.T @ a, -1)).max(initial=0.0) < 1e-14 * len(a)


@pytest.mark.parametrize("n", [1, 2, 5, 37, 62])
def test_complex_equations_are_solved_as_by_lapack(n, rng):
    """Also badly scaled ones, and those whose diagonal is zero."""
    replayed = Replayed(lambda x, y, b: (z := np.linalg.inv(x + 1j * y)).real @ b + (z @ (b + 1j)).imag)
    sizes = 10.0 ** rng.uniform(-3.0, 3.0, n)
    for part in (np.ones((n, n)), 1.0 - np.eye(n) if n > 1 else 1.0, np.diag(sizes), sizes[:, None]):
        x, y = rng.standard_normal((2, n, n)) * part
        b = rng.standard_normal((n, 1))
        z = np.linalg.inv(x + 1j * y)
        expected = z.real @ b + (z @ (b + 1j)).imag
        scale = np.linalg.cond(x + 1j * y) * np.abs(expected).max()
        np.testing.assert_allclose(replayed(x, y, b) / scale, expected / scale, atol=1e-14, rtol=0.0)
    assert replayed.refused is None


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_few_equations_are_solved_as_by_lapack(n, rng):
    """Whatever pivots they need; what is singular is told, and what is not finite stays so."""
    replayed = Replayed(np.linalg.solve)
    for part in (1.0, 1.0 - np.eye(n) if n > 1 else 1.0, np.tri(n), 10.0 ** rng.uniform(-9.0, 9.0, (n, 1))):
        a, b = rng.standard_normal((30, n, n)) * part, rng.standard_normal((30, n, 2))
        expected = np.linalg.solve(a, b)
        scale = np.linalg.cond(a)[:, None, None] * np.abs(expected).max(axis=(1, 2), keepdims=True)
        np.testing.assert_allclose(replayed(a, b) / scale, expected / scale, atol=1e-14, rtol=0.0)
    assert np.isnan(replayed(np.where(np.eye(n) == 1.0, np.nan, a), b)).any()
    with pytest.raises(np.linalg.LinAlgError):
        replayed(0.0 * a, b)
    assert replayed.refused is None


def test_what_is_not_finite_stays_so():
    replayed = Replayed(lambda x: np.concatenate([x[:1] / x[1:], [np.abs(x).max(), (x @ x)]]))
    replayed(np.array([1.0, 2.0]))
    with np.errstate(all="ignore"):
        assert np.isinf(replayed(np.array([1.0, 0.0]))[0])
        assert np.isnan(replayed(np.array([np.nan, 2.0]))).all()


def test_other_threads_do_not_notice(rng):
    tape, kinds = Recorder(), []
    with recording(tape):
        thread = threading.Thread(target=lambda: kinds.append(type(np.zeros(3))))
        thread.start()
        thread.join()
    assert kinds == [np.ndarray]
