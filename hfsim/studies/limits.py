"""How long a fixed step may be: measured by bisection, beside what linear theory says.

The scene is linearised on the manifold of its joints.  The eigenvalues give frequencies, growing motions
(a scene that is physically unstable there) and the fastest period, in multiples of which steps are told.

Eigenvalues are frozen in time.  They are those of the motion where the state lasts in the coordinates of
the model: at rest, and in even rotation for beams with a body frame; rigid bodies and `ancf` count in ground
axes.  Elsewhere a growth rate is that of a state passed through.

Theory is the test equation y'' = -w^2 y.  Per step the amplitude of a mode grows by the largest root of
the method at z = i w h: |R(z)| for one-step methods, the largest root of the characteristic polynomial
for backward differentiation.  Measured is the growth of a small disturbance in the fastest mode.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hfsim.arrays import Array, ComplexArray
from hfsim.balance import balance, step_samples
from hfsim.build import Scene, build
from hfsim.deck import LoadedDeck, parse_deck
from hfsim.errors import HfsimError
from hfsim.integration import run_integration
from hfsim.integrators import DEFAULT_STAGES, Trajectory, default_stages
from hfsim.studies.bench import Budget, OutOfBudgetError
from hfsim.studies.farm import Farm, Task

STEPS = 400
"""Steps of a trial run: a growth of 1 % a step is 50-fold at its end."""
BOUNDS = (0.02, 24.0)
"""Shortest and longest step looked at, in fastest periods."""
WIDTH = 0.01
"""Relative width to which the longest stable step is located."""
AMPLITUDE = 1e-4
"""Largest change of a coordinate by the disturbance, in metres or slopes: small enough to be linear."""
BLOWN = 10.0
"""Energy, over the largest there should be, from which a run has blown up."""
MOST_UNKNOWNS = 400
"""Unknowns up to which a scene is linearised: all is dense here."""
_DIFFERENCE = 1e-3
"""Step of the differences by which the scene is linearised, fourth order: exact for cubic forces."""


# --- linearisation -------------------------------------------------------------------------------


class LimitsError(HfsimError):
    """The scene cannot be linearised."""

    exit_code = 2


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues of the scene linearised in one state.

    Attributes
    ----------
    time : float
        When [s].
    fastest, slowest : float
        Largest and smallest frequency that is not zero [rad/s].
    growth : float
        Largest growth rate of a motion [1/s]; zero where it is not told from round-off.
    noise : float
        Growth rates below this are round-off [1/s].
    """

    time: float
    fastest: float
    slowest: float
    growth: float
    noise: float

    @property
    def period(self) -> float:
        """Fastest period [s]."""
        return 2.0 * np.pi / self.fastest if self.fastest > 0.0 else np.inf


@dataclass(frozen=True)
class Linearised:
    """A scene near one state: y'' = A y + B y' in independent coordinates y.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (n_free, n_free)
        A and B.
    basis : ndarray, shape (n, n_free)
        Changes of the state that the joints allow.
    """

    stiffness: Array
    damping: Array
    basis: Array

    def eigenvalues(self) -> ComplexArray:
        """Return all eigenvalues, shape (2 n_free,) [1/s]."""
        n = len(self.stiffness)
        matrix = np.block([[np.zeros((n, n)), np.eye(n)], [self.stiffness, self.damping]])
        return np.linalg.eigvals(matrix).astype(complex)

    def fastest_mode(self) -> tuple[float, Array]:
        """Return the largest frequency without gyroscopic terms [rad/s] and its shape in the state, (n,)."""
        w2, modes = np.linalg.eig(-self.stiffness)
        k = int(np.argmax(w2.real))
        shape = self.basis @ modes[:, k].real
        return float(np.sqrt(max(w2[k].real, 0.0))), shape / np.abs(shape).max()


def linearise(scene: Scene, t: float, q: Array, v: Array) -> Linearised:
    """Linearise the equations of motion at a state on the manifold of the joints.

    Parameters
    ----------
    scene : Scene
    t : float
    q, v : ndarray, shape (n,)

    Raises
    ------
    LimitsError
        If the scene has too many unknowns for dense algebra.
    """
    system = scene.system
    if system.n > MOST_UNKNOWNS:
        raise LimitsError(f"{system.n} unknowns; scenes are linearised up to {MOST_UNKNOWNS}")
    Z = _allowed(scene, t, q, v)
    n = Z.shape[1]
    steps = _DIFFERENCE * np.concatenate([k * np.eye(n) for k in (-2, -1, 1, 2)])
    nothing = np.zeros_like(steps)
    moved = np.concatenate([np.hstack([steps, nothing]), np.hstack([nothing, steps])])
    y, w = moved[:, :n], moved[:, n:]
    times = np.full(len(moved), t)
    Q, V = system.project(times, q + y @ Z.T, v + w @ Z.T)
    values = system.acceleration(times, Q, V) @ Z
    # where projection has moved the coordinates a little, the chain rule brings them back
    reached = np.hstack([(Q - q) @ Z, (V - v) @ Z])
    slopes = _slopes(values.reshape(2, 4, n, n)) / _DIFFERENCE
    turned = _slopes(reached.reshape(2, 4, n, 2 * n)) / _DIFFERENCE
    J = np.linalg.solve(np.concatenate(turned), np.concatenate(slopes)).T
    return Linearised(J[:, :n], J[:, n:], Z)


def _slopes(values: Array) -> Array:
    """Return fourth-order differences of values at -2, -1, 1 and 2 steps (second axis)."""
    far, near = values[:, 3] - values[:, 0], values[:, 2] - values[:, 1]
    return np.asarray((8.0 * near - far) / 12.0)


def _allowed(scene: Scene, t: float, q: Array, v: Array) -> Array:
    """Return an orthonormal basis of the changes of q that the joints allow, shape (n, n_free)."""
    system = scene.system
    if not system.constraints:
        return np.eye(system.n)
    # projected velocities are what the joints allow; the rates of drivers drop out in differences
    n = system.n
    at, times = np.repeat(q[None], n + 1, axis=0), np.full(n + 1, t)
    rates = v + np.vstack([np.eye(n), np.zeros((1, n))]) * max(1.0, float(np.abs(v).max(initial=0.0)))
    moved = system.project(times, at, rates)[1]
    left, _, _ = np.linalg.svd((moved[:-1] - moved[-1]).T)
    return np.asarray(left[:, : n - system.n_rows])


def spectrum(scene: Scene, t: float, q: Array, v: Array) -> Spectrum:
    """Return the frequencies and the largest growth rate of a scene in one state."""
    found = linearise(scene, t, q, v).eigenvalues()
    sizes = np.abs(found.imag)
    fastest = float(np.abs(found).max(initial=0.0))
    noise = 10.0 * fastest * float(np.sqrt(np.finfo(float).eps / _DIFFERENCE))
    growth = float(found.real.max(initial=0.0))
    swinging = sizes[sizes > max(noise, 1e-9)]
    return Spectrum(
        time=t,
        fastest=float(swinging.max(initial=0.0)),
        slowest=float(swinging.min(initial=fastest)),
        growth=growth if growth > noise else 0.0,
        noise=noise,
    )


def along(scene: Scene, count: int = 9, seconds: float = 20.0) -> tuple[Spectrum, ...]:
    """Return spectra at even times along the motion, solved as the deck says; fewer if it takes too long."""
    found = [spectrum(scene, 0.0, scene.q, scene.v)]
    try:
        done = run_integration(scene, scene.deck.solve, Budget(seconds).guard(seconds))
    except OutOfBudgetError:
        return tuple(found)
    times = np.linspace(0.0, done.trajectory.t_end, count)[1:]
    q, v = done.trajectory.at(times)
    q, v = scene.system.project(times, q, v)
    found += [spectrum(scene, float(t), a, b) for t, a, b in zip(times, q, v, strict=True)]
    return tuple(found)


# --- theory --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Theory:
    """What linear theory says of a method on the imaginary axis.

    Attributes
    ----------
    longest : float or None
        Longest step in periods that a trial run finds stable; None if any step is.
    words : str
    """

    longest: float | None
    words: str


def explicit_growth(y: Array) -> Array:
    """Return |R(iy)| of the explicit pair of order 8, R(z) = sum b A^k 1 z^(k+1) + 1, for y = w h."""
    from scipy.integrate import DOP853

    A, b = DOP853.A[:12, :12], DOP853.B
    R, power, factor = np.ones(len(y), dtype=complex), np.ones(12), 1j * y
    for k in range(12):
        R = R + float(b @ power) * factor ** (k + 1)
        power = A @ power
    return np.abs(R)


def gear_growth(order: int, y: Array) -> Array:
    """Return the largest root of backward differentiation of an order at z = iy: sum_j (1 - x)^j / j = z."""
    base = np.zeros(order + 1)
    for j in range(1, order + 1):
        # (1 - 1/x)^j x^order: coefficients of x^order, x^(order-1), ...
        base[: j + 1] += np.array([(-1.0) ** k * _binomial(j, k) for k in range(j + 1)]) / j
    found = []
    for value in y:
        polynomial = base.astype(complex)
        polynomial[0] -= 1j * value
        found.append(np.abs(np.roots(polynomial)).max())
    return np.array(found)


def _binomial(n: int, k: int) -> float:
    from math import comb

    return float(comb(n, k))


def theory(method: str, order: int | None = None) -> Theory:
    """Return what is predicted for undamped modes, steps in periods of the mode.

    A step counts as stable by what a trial run can see: an energy that grows less than `BLOWN`-fold in
    `STEPS` steps.

    Examples
    --------
    >>> theory("gauss").longest is None, round(theory("explicit").longest, 3)
    (True, 0.949)
    """
    if method == "explicit":
        edge = _crossing(explicit_growth, 4.0, 8.0)
        return Theory(edge / (2 * np.pi), f"|R(iwh)| = 1 at wh = {edge:.4g}")
    if method == "gear" and (order or 5) >= 3:
        k = order or 5
        y = np.linspace(0.05, 12.0, 600)
        growth = gear_growth(k, y)
        worst, last = int(growth.argmax()), int(np.nonzero(growth > 1.0 + 1e-9)[0][-1])
        edge = _crossing(lambda at: gear_growth(k, at), 0.0, float(y[worst]))
        words = (
            f"order {k}: undamped modes grow for every wh up to {y[last]:.3g}, by a factor of "
            f"{growth[worst]:.3g} a step at wh = {y[worst]:.3g}; {BLOWN:g}-fold energy in {STEPS} steps "
            f"at wh = {edge:.3g}"
        )
        return Theory(edge / (2 * np.pi), words)
    words = {
        "gauss": "A-stable, |R(iwh)| = 1",
        "radau": "L-stable, |R(iwh)| < 1",
        "energy": "A-stable, |R(iwh)| = 1; keeps the energy of any motion",
        "gear": f"order {order}: A-stable",
        "generalized_alpha": "unconditionally stable for linear scenes",
    }[method]
    return Theory(None, words)


def _crossing(growth: Callable[[Array], Array], low: float, high: float) -> float:
    """Return w h between two values from which a mode grows enough to be seen."""
    seen = BLOWN ** (1.0 / (2.0 * STEPS))
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if growth(np.array([middle]))[0] < seen else (low, middle)
    return low


# --- measurement ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class LimitJob:
    """A method whose longest stable step is to be measured, in a worker process."""

    text: str
    file: str
    overrides: tuple[str, ...]
    model: str
    method: str
    order: int | None
    limit: float


@dataclass(frozen=True)
class Limit:
    """The longest stable step of one method.

    Attributes
    ----------
    method : str
    order : int or None
        Of gear.
    stages : int or None
    longest, beyond : float or None
        Longest step that was stable and the shortest that was not, in fastest periods; None: none found.
    reason : str
        What happens beyond.
    predicted : float or None
        By theory; None for any step.
    words : str
        The theory in words.
    """

    method: str
    order: int | None
    stages: int | None
    longest: float | None
    beyond: float | None
    reason: str
    predicted: float | None
    words: str

    @property
    def deviation(self) -> float | None:
        """How far the measured step is from the predicted one, relative; None where there is no number."""
        if not self.predicted or self.longest is None or self.beyond is None:
            return None
        return 0.5 * (self.longest + self.beyond) / self.predicted - 1.0

    def facts(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**asdict(self), "deviation": self.deviation}


def measure(job: LimitJob) -> Limit:
    """Find the longest stable step of a method: double the step until it fails, then halve the gap."""
    overrides = (*job.overrides, f"solve.method={job.method}")
    scene = build(parse_deck(job.text, job.file, overrides), job.model)
    omega, shape = linearise(scene, 0.0, scene.q, scene.v).fastest_mode()
    period = 2.0 * np.pi / omega
    disturbed = _disturbed(scene, omega, shape)
    budget = Budget(job.limit)
    said = theory(job.method, job.order)
    stages = None
    if job.method in ("gauss", "radau"):
        stages = scene.deck.solve.stages or default_stages(scene.deck.solve.tolerance)
    if job.method == "energy":
        stages = scene.deck.solve.stages or DEFAULT_STAGES
    low, high, reason = None, None, ""
    try:
        step = BOUNDS[0]
        while step <= BOUNDS[1]:
            why = trial(disturbed, job, step * period, budget)
            if why:
                high, reason = step, why
                break
            low, step = step, 2.0 * step
        while low is not None and high is not None and high - low > WIDTH * high:
            middle = float(np.sqrt(low * high))
            why = trial(disturbed, job, middle * period, budget)
            low, high, reason = (low, middle, why) if why else (middle, high, reason)
    except OutOfBudgetError:
        reason = reason or f"no end found within {job.limit:.3g} s"
    return Limit(job.method, job.order, stages, low, high, reason, said.longest, said.words)


def _disturbed(scene: Scene, omega: float, shape: Array) -> Scene:
    """Return the scene with its fastest mode set swinging a little."""
    v = scene.v + AMPLITUDE * omega * shape
    q, v = scene.system.project(np.zeros(1), scene.q[None], v[None])
    return replace(scene, q=q[0], v=v[0])


def trial(scene: Scene, job: LimitJob, step: float, budget: Budget) -> str:
    """Make `STEPS` steps of a length [s]; return why it is not stable, empty if it is."""
    update = {"method": job.method, "step": step, "duration": STEPS * step, "order": job.order}
    update |= {"stages": None, "max_steps": None}
    solve = scene.deck.solve.model_copy(update=update)
    done = run_integration(scene, solve, budget.guard(max(budget.left, 0.0)))
    if done.stop is not None:
        return str(done.stop)
    with np.errstate(all="ignore"):
        return _growth(scene, done.trajectory, step)


def _growth(scene: Scene, trajectory: Trajectory, step: float) -> str:
    """Return by how much too much the energy has grown in words; empty if it has not."""
    drift = float(balance(scene.system, step_samples(trajectory))["energy_drift"])
    start = _energy(scene, 0.0, scene.q, scene.v)
    end = _energy(scene, STEPS * step, trajectory.q, trajectory.v)
    if not np.isfinite(drift) or (not scene.system.exchanges_power and end > BLOWN * max(start, 1e-300)):
        return f"the energy grows {end / max(start, 1e-300):.3g}-fold in {STEPS} steps"
    return ""


def _energy(scene: Scene, t: float, q: Array, v: Array) -> float:
    """Return kinetic and strain energy and that of springs and weight above its least so far [J]."""
    system, time = scene.system, np.array([t])
    x, u = system.absolute(q[None]), system.absolute_velocity(q[None], v[None])
    moving = system.kinetic_energy(x, u) + system.strain_energy(x)
    return float((moving + np.abs(system.potential_energy(time, x)))[0])


@dataclass(frozen=True)
class Limits:
    """What a model of a scene can stand.

    Attributes
    ----------
    name, model : str
    spectra : tuple of Spectrum
        At the start and along the motion.
    limits : tuple of Limit
    lost : dict of str to str
        What was not measured, and why.
    """

    name: str
    model: str
    spectra: tuple[Spectrum, ...]
    limits: tuple[Limit, ...]
    lost: dict[str, str]

    def facts(self) -> dict[str, Any]:
        """Return it as plain data, times in seconds and steps in fastest periods."""
        return {
            "name": self.name, "model": self.model,
            "spectra": [{**asdict(s), "period": s.period} for s in self.spectra],
            "limits": [limit.facts() for limit in self.limits], "lost": self.lost,
        }  # fmt: skip


LIMIT_COLUMNS = (
    "model", "method", "order", "stages", "longest", "beyond", "predicted", "deviation", "reason", "words",
)  # fmt: skip
"""Columns of ``limits.csv``; steps in fastest periods."""


def _spectra(job: LimitJob) -> tuple[Spectrum, ...]:
    scene = build(parse_deck(job.text, job.file, job.overrides), job.model)
    return along(scene, seconds=job.limit)


def limits(
    loaded: LoadedDeck, model: str, methods: tuple[str, ...], seconds: float, limit: float, jobs: int
) -> Limits:
    """Measure the longest stable step of each method, gear with each order, in processes of their own.

    Parameters
    ----------
    loaded : LoadedDeck
    model : str
    methods : tuple of str
    seconds, limit : float
        Wall time all and one method may take [s].
    jobs : int
        Processes at a time.

    Raises
    ------
    LimitsError
        If the scene has nothing that swings or too many unknowns.
    """
    scene = build(loaded, model)
    start = spectrum(scene, 0.0, scene.q, scene.v)
    if start.fastest <= 0.0:
        raise LimitsError(f"nothing swings in {loaded.deck.name} at the start: there is no fastest period")
    farm = Farm(jobs, time.perf_counter() + seconds)
    source = loaded.source
    wanted = [(m, k) for m in methods for k in ((1, 2, 3, 4, 5) if m == "gear" else (None,))]
    base = LimitJob(source.text, source.file, loaded.overrides, model, "", None, limit)
    farm.add(Task("spectra", _spectra, base, limit))
    for method, order in wanted:
        farm.add(Task((method, order), measure, replace(base, method=method, order=order), limit))
    found = {outcome.key: outcome for outcome in farm.outcomes()}
    lost = {_title(key): outcome.lost for key, outcome in found.items() if outcome.lost}
    lost |= {_title(key): "the budget was used up" for key in farm.unreached()}
    spectra = found["spectra"].value if "spectra" in found else None
    measured = [found[key].value for key in wanted if key in found and found[key].value is not None]
    return Limits(loaded.deck.name, model, spectra or (start,), tuple(measured), lost)


def _title(key: Any) -> str:
    return key if isinstance(key, str) else f"{key[0]}{f' of order {key[1]}' if key[1] else ''}"
