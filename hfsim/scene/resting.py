"""A scene that starts from its equilibrium, or some bodies of it, with the rates that the deck states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hfsim.errors import NoStartError
from hfsim.maths.arrays import Array
from hfsim.maths.matrices import dense, is_sparse
from hfsim.mechanics.statics.problem import Problem
from hfsim.mechanics.statics.stability import neutral
from hfsim.mechanics.turning import Turning
from hfsim.scene.assembly import UNITS, Assembly, Change, listed
from hfsim.scene.equilibrium import Turns, doubts, equilibrium_of, problem_of, why_not
from hfsim.scene.gauging import Assembled, rigid_motions
from hfsim.scene.initial import AT_REST, STEADY
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.measured import Measured
from hfsim.scene.posed import stated_of_joints
from hfsim.scene.start import ROUGH_RATE

if TYPE_CHECKING:
    from hfsim.mechanics.ties import Tie

FIRM, LOOSE = 1e-3, 1e-9
"""Weights of rates that are stated, and of those that follow from joints, whose own is one."""
BALANCED = 1e-5
"""Part of forces of inertia that may be left over in what floats."""
MISSED = 1e-9
"""Part of the fastest rate by which joints may miss steady rotation."""
EVEN = 1e-4
"""Part of the accelerations of a turn by which others may differ after it, if it goes on as it began."""


class Rest(NamedTuple):
    """The state at the start of a scene at rest.

    Attributes
    ----------
    q, v : ndarray, shape (n,)
    start_angles : dict of str to float
        Angles of body frames, and of joints and springs whose turns nothing else counts [rad].
    rest : tuple of str
        What is to be told of it.
    assembly : Assembly
        With stated rates that were taken as guesses.
    """

    q: Array
    v: Array
    start_angles: dict[str, float]
    rest: tuple[str, ...]
    assembly: Assembly


class StatedRate(NamedTuple):
    """A rate that a deck states beside a steady rotation.

    Attributes
    ----------
    name, quantity : str
        Body or joint, and key, as in ``initial``.
    value : ndarray, shape (n,)
    of : callable
        From coordinates and rates, (n_batch, n_x) each, to what it is there, (n_batch, n).
    exact : bool
        Whether it is no guess.
    """

    name: str
    quantity: str
    value: Array
    of: Callable[[Array, Array], Array]
    exact: bool


def at_rest(scene: Measured) -> Rest:
    """Return the start with those bodies at rest that are to be, under what acts on them at t = 0.

    Raises
    ------
    NoStartError
        If there is no equilibrium.
    """
    spec = scene.deck.steady
    if spec is not None and np.any(spec.rate):
        return _steady(scene)
    loaded, turns = scene.loaded, Turns(scene)
    # a rotation at no rate is rest
    path, some = (AT_REST, scene.deck.resting) if spec is None else (STEADY, tuple(scene.bodies))
    bodies = None if set(some) >= set(scene.bodies) else some
    problem = problem_of(scene, 0.0, turns, bodies=bodies)
    found = equilibrium_of(scene, problem, bodies)
    if found.reason:
        why = why_not(scene, 0.0, found)
        raise _no_start(loaded, f"initial.{path}", f"there is none: {why}", why.remedy)
    x = scene.system.reduction.expand(found.state.z)
    turns(1.0, x)
    told = tuple(f"initial.{path}: {one}" for one in doubts(scene, found, x))
    return _begun(scene, turns, x, _rates(scene, x), told)


def _steady(scene: Measured) -> Rest:
    """Return the start in steady rotation.

    Raises
    ------
    NoStartError
        If there is none, or what the deck states contradicts it, a `DeckError` if not everything can turn
        with the body.
    """
    spec, turns = scene.deck.steady, Turns(scene)
    assert spec is not None
    still = problem_of(scene, 0.0, turns, moving=True)
    stated, x = tuple(_stated(scene)), still.expand(still.start.z)
    turning = turning_with(scene, spec.body)
    along, across = _unheld(scene, still, turning)
    loose = np.concatenate([along, across])
    if len(across):
        turning = _about_mass(scene, x, turning)
    turning = _travelling(scene, turning, _velocity(scene, stated, x, turning, loose))
    problem = replace(still, turning=turning)
    found = equilibrium_of(scene, problem)
    path = f"initial.{STEADY}"
    if found.reason:
        why = why_not(scene, 0.0, found)
        remedy = "a lower rate" if found.limit is not None else why.remedy
        raise _no_start(scene.loaded, path, f"no steady rotation is found: {why}", remedy)
    x = problem.expand(found.state.z)
    turns(1.0, x)
    if len(loose) == len(turning.centre) and not _balanced(scene, x, turning):
        told = "no steady rotation is found: beside the stiffness, what inertia does is rounding"
        raise _no_start(scene.loaded, path, told, "a higher rate, or a start nearer to it")
    x, turning = _put_back(scene, x, turning, loose)
    turning = _travelling(scene, turning, _velocity(scene, stated, x, turning, loose))
    u = turning.rates(x)
    drift = scene.system.unreduced.phi.drift(np.zeros(1), x, u)
    if np.abs(drift).max(initial=0.0) > MISSED * np.abs(u).max(initial=0.0):
        told = f"not everything can turn with '{spec.body}': joints hold some of it"
        raise scene.loaded.problem(path, told, "let all that moves hang on that body")
    changes = tuple(_changes(scene, stated, x, u))
    for one in changes:
        if one.rough > 1.0:
            raise _contradicted(scene.loaded, one)
    told = f"{path}: weight, springs or loads meet it otherwise after a turn: it is steady at the start alone"
    begun = _begun(scene, turns, x, u, () if _goes_on(scene, x, turning) else (told,))
    assembly = replace(scene.assembly, changes=(*scene.assembly.changes, *changes))
    return begun._replace(assembly=assembly)


def _contradicted(loaded: LoadedDeck, change: Change) -> NoStartError:
    """Return the refusal of a stated rate that the steady rotation does not have."""
    unit, off = UNITS[change.quantity], np.linalg.norm(np.subtract(change.taken, change.stated))
    told = f"contradicts the steady rotation by {off:.6g} {unit}"
    hint = f"there it is {listed(change.taken)} {unit}; correct it, or leave it out to let it follow"
    return _no_start(loaded, f"initial.{change.body}.{change.quantity}", told, hint)


def _no_start(loaded: LoadedDeck, path: str, message: str, remedy: str) -> NoStartError:
    """Return the exception that refuses a deck, with its models, at what it says of its start."""
    found = loaded.problem(path, message, remedy)
    return NoStartError(found.file, found.problems, found.text, found.others)


def _goes_on(scene: Assembled, x: Array, turning: Turning) -> bool:
    """Tell whether no more is beside the accelerations of a turn after one radian of it than at (1, n_x)."""
    system, t, seconds = scene.system, np.zeros(1), 1.0 / turning.rate

    def beside(x: Array, travelled: Array) -> Array:
        return system.solved(t, x + travelled, turning.rates(x))[0] - turning.accelerations(x)

    def size(accelerations: Array) -> float:
        return float(np.sqrt(system.kinetic_energy(x, accelerations)[0]))

    try:
        after = size(beside(turning.turned(x, seconds), seconds * turning.travel))
        return bool(after <= size(beside(x, 0.0 * x)) + EVEN * size(turning.accelerations(x)))
    except np.linalg.LinAlgError:
        return True


def turning_with(scene: Assembled, body: str) -> Turning:
    """Return the rotation of everything with a body as it moves at the start."""
    twist, origin = scene.assembly.twists[body], scene.assembly.poses[body].origin
    w, v = twist.spin, twist.velocity
    arm = np.array([-v[1], v[0]]) * w[0] if len(w) == 1 else np.cross(w, v)
    centre = origin + arm / max(float(w @ w), 1e-300)
    sparse = is_sparse(scene.system.equations.constant_mass)
    return Turning.of(scene.bodies.values(), w, centre, sparse)


def _unheld(scene: Assembled, problem: Problem, turning: Turning) -> tuple[Array, Array]:
    """Return directions, (k, n_dim) each, in which nothing holds the scene: along the axis, and across it.

    Across it there are two, or none where something holds the axis.
    """
    n_dim = len(turning.centre)
    axes = np.linalg.svd(np.atleast_2d(turning.spin))[2] if n_dim == 3 else np.eye(n_dim)
    shifts = _shifts(scene, n_dim)

    def unheld(ways: Array) -> Array:
        loose = neutral(problem, problem.begin(), 0.0, ways @ shifts)
        return ways if len(loose) == len(ways) else ways[:0]

    along, across = np.split(axes, [n_dim - 2])
    return unheld(along), unheld(across)


def _shifts(scene: Assembled, n_dim: int) -> Array:
    """Return the rates (n_dim, n_x) of everything that is shifted along the axes of the ground."""
    return np.array([one.travel for one in Turning.units(scene.bodies.values(), n_dim)[:n_dim]])


def _travelling(scene: Assembled, turning: Turning, velocity: Array) -> Turning:
    """Return a rotation whose axis moves on at a velocity (n_dim,)."""
    sparse = is_sparse(turning.matrix)
    return Turning.of(scene.bodies.values(), turning.spin, turning.centre, sparse, velocity)


def _put_back(scene: Measured, x: Array, turning: Turning, loose: Array) -> tuple[Array, Turning]:
    """Return coordinates (1, n_x), and the rotation, shifted to where the deck states positions.

    That is only along directions (k, n_dim) in which nothing holds the scene.
    """
    off = [
        scene.assembly.poses[name].origin - scene.marker(name).position(x)[0]
        for name, own in scene.deck.motions.items()
        if own.position is not None and _moves(scene, name)
    ]
    if not off:
        return x, turning
    way = np.mean(off, axis=0) @ loose.T @ loose
    centre, sparse = turning.centre + way, is_sparse(turning.matrix)
    back = Turning.of(scene.bodies.values(), turning.spin, centre, sparse, turning.velocity)
    return x + way @ _shifts(scene, len(way)), back


def _stated(scene: Measured) -> Iterator[StatedRate]:
    """Yield the rates that a deck states of bodies, as joints have left them, and of joints."""
    for name, own in scene.deck.motions.items():
        if not _moves(scene, name):
            continue
        twist, marker = scene.assembly.twists[name], scene.marker(name)
        if own.velocity is not None:
            yield StatedRate(name, "velocity", twist.velocity, marker.velocity, own.exact)
        if own.angular_velocity is not None:
            yield StatedRate(name, "angular_velocity", twist.spin, marker.spin, own.exact)
    for name, unit, key, value in stated_of_joints(scene.deck, rates=True):
        rate = partial(_rate_of, scene.coordinate(name, unit))
        yield StatedRate(name, key, np.array([value]), rate, True)


def _moves(scene: Assembled, name: str) -> bool:
    return name in scene.bodies and not scene.bodies[name].still


def _rate_of(coordinate: Tie, x: Array, u: Array) -> Array:
    """Return the rates, shape (n_batch, 1), of what a joint leaves free."""
    return coordinate.rate(np.zeros(len(x)), x, u)[:, None]


def _velocity(
    scene: Assembled, stated: Sequence[StatedRate], x: Array, turning: Turning, loose: Array
) -> Array:
    """Return the velocity (n_dim,) of the axis that makes stated ones, along directions (k, n_dim)."""
    ways, u = loose @ _shifts(scene, loose.shape[1]), turning.turned_only(x)
    speeds = [one for one in stated if UNITS[one.quantity] == "m/s"]
    if not len(loose) or not speeds:
        return np.zeros(loose.shape[1])
    rows = np.concatenate([one.of(np.repeat(x, len(ways), axis=0), ways).T for one in speeds])
    missing = np.concatenate([one.value - one.of(x, u)[0] for one in speeds])
    return np.asarray(np.linalg.lstsq(rows, missing, rcond=MISSED)[0] @ loose)


def _changes(scene: Measured, stated: Sequence[StatedRate], x: Array, u: Array) -> Iterator[Change]:
    """Yield which stated rates a steady rotation at coordinates and rates (1, n_x) does not have."""
    if not stated:
        return
    markers = [scene.marker(name) for name in scene.bodies if _moves(scene, name)]
    fastest = {
        "m/s": max(float(np.linalg.norm(one.velocity(x, u))) for one in markers),
        "rad/s": max(float(np.linalg.norm(one.spin(x, u))) for one in markers),
    }
    lengths = {"m/s": scene.assembly.linkage.size, "rad/s": 1.0}
    for name, quantity, value, of, exact in stated:
        unit, taken = UNITS[quantity], of(x, u)[0]
        off, most = float(np.linalg.norm(taken - value)), fastest[unit]
        if off > MISSED * max(most, fastest["rad/s"] * lengths[unit]):
            rough = np.inf if exact else off / (ROUGH_RATE * max(most, 1e-300))
            args = name, quantity, tuple(value.tolist()), tuple(taken.tolist()), rough
            yield Change(*args, by="the steady rotation has")


def _about_mass(scene: Assembled, x: Array, turning: Turning) -> Turning:
    """Return the rotation about the centre of mass in coordinates (1, n_x)."""
    bodies = list(scene.bodies.values())
    centre = Turning.about_mass(bodies, scene.system.equations, x[0])[-1].centre
    return Turning.of(bodies, turning.spin, centre, is_sparse(turning.matrix))


def _balanced(scene: Assembled, x: Array, turning: Turning) -> bool:
    """Tell whether forces of inertia balance one another, as they have to in what floats."""
    rates = np.array([one.rates(x)[0] for one in Turning.units(scene.bodies.values(), len(turning.centre))])
    force = scene.system.equations.momentum(x, turning.accelerations(x))[0]
    return bool(np.all(np.abs(rates @ force) <= BALANCED * (np.abs(rates) @ np.abs(force))))


def _begun(scene: Measured, turns: Turns, x: Array, u: Array, told: tuple[str, ...]) -> Rest:
    """Return the start at coordinates and rates (1, n_x)."""
    q, v = scene.system.state(x, u, turns.q)
    q, v = scene.system.project(np.zeros(1), q, v)
    angles = {**scene.start_angles, **turns.angles}
    for name, body in scene.bodies.items():
        if body.angle_column is not None:
            angles[name] = float(scene.system.arranged(q)[0, body.angle_column])
    return Rest(q[0], v[0], angles, told, scene.assembly)


def _rates(scene: Measured, x: Array) -> Array:
    """Return the rates (1, n_x) with which bodies, as they are deformed, move as the deck states.

    What it does not state follows from the joints, as at any start.
    """
    deck, names = scene.deck, [name for name, body in scene.bodies.items() if not body.still]
    twists = [scene.assembly.twists[name] for name in names]
    wanted = np.concatenate([part for twist in twists for part in (twist.velocity, twist.spin)])
    if not wanted.any():
        return np.zeros_like(x)
    stated = []
    for name, twist in zip(names, twists, strict=True):
        own = deck.motions.get(name)
        stated += [own is not None and own.velocity is not None] * len(twist.velocity)
        stated += [own is not None and own.angular_velocity is not None] * len(twist.spin)
    motions, weights = rigid_motions(scene, x), np.where(stated, FIRM, LOOSE)
    phi = scene.system.unreduced.phi
    held = dense(phi.jacobian_at(x) @ motions.T)
    every, t = np.repeat(x, len(motions), axis=0), np.zeros(len(motions))
    joints = tuple(stated_of_joints(deck, rates=True))
    pace = [FIRM * scene.coordinate(name, unit).rate(t, every, motions)[None] for name, unit, *_ in joints]
    rows = np.concatenate([held, np.diag(weights), *pace])
    aim = np.concatenate([-phi.rate(t[:1])[0], weights * wanted, [FIRM * rate for *_, rate in joints]])
    return np.asarray(np.linalg.lstsq(rows, aim, rcond=1e-14)[0] @ motions)[None]
