"""Validity of the truncated models: what they left out against what they kept, along a run.

A beam of the model `linear` has no foreshortening and no stiffening by tension; one of `lowOrder` has
both, and leaves out the third order in the inertia and the quadratic terms of its curvature.  From the
deformation that the model itself computes these terms follow, and from them an estimate of the error of
the beam's tip, relative to the largest range of a coordinate of the tip over the run, or to how far the tip
is from where it would be undeformed, if that is more:

    linear     (s + (|N v'^2| / |EI v''^2| + T) |v|) / range      s = 1/2 int v'^2, N = EA u1'
    lowOrder   (`CURVATURE` max v'^2 + T) |v| / range       T = `TWIST` phi (phi + 1 - EI_2 / EI_1),
                                                            v deflection of the tip in the body frame,
                                                            phi largest twist, EI_2 about the softer axis
    rigid      2 (|v| (1 + pi/2 n) + |u| (1 + 2 theta)) / range     after n half periods and theta turned

u and v of a rigid beam are those of the same forces at rest (`hfsim.trust.quasistatic`).

In the model linear |N v'^2| is a mean over the time that bending takes to answer, and of what
oscillates, |EI v''^2| and |v|, the largest values so far count.  The estimate is one of order of
magnitude: the error of a phase that grows over many periods is not in it.

A beam that turns faster than it bends, and that lacks more stiffening than it has stiffness in bending,
yields to the centrifugal force: its deflection grows without bound.  It has left its range at `RUNAWAY`
already.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, cumulative, distinct
from hfsim.mechanics.body import Body
from hfsim.mechanics.deformation import Deformation, size
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.build import Scene

LEFT = 5e-3
"""Estimated relative error at which a model has left its range; see tests/benchmarks/validity.py."""
RUNAWAY = 2e-4
"""The same where nothing holds the error: it grows many times over while the beam turns once."""
CURVATURE = 1.9
"""Relative error of a deflection by `lowOrder` over the largest slope squared, measured on a cantilever."""
TWIST = 1.0 / 3.0
"""Relative error of a deflection by `lowOrder` over the twist, measured on cantilevers twisted at the tip."""
RINGING = 2.0
"""Largest deformation under a load that sets in suddenly over that of the same load at rest."""
STEEP = 0.3
"""Slope [rad] from which small angles are no longer small."""
BLOCKED = 1e-9
"""Rate of a joint equation, over the angular velocity, from which a joint blocks turning."""
MAX_STATES = 2000
"""States looked at."""

_ALONG = np.linspace(0.0, 1.0, 65)
"""Places at which beams that are not the same all along are looked at, as shares of their length."""

_WAVE_NUMBERS = {
    ("clamped", "free"): 1.8751,
    ("pinned", "free"): 3.9266,
    ("free", "free"): 4.7300,
    ("pinned", "pinned"): np.pi,
    ("clamped", "pinned"): 3.9266,
    ("clamped", "clamped"): 4.7300,
}
"""First wave number times length of a beam by its ends, the stiffer end first."""


class Beam(NamedTuple):
    """What estimates need of a beam besides its deformation.

    Attributes
    ----------
    axial, bending : float
        EA [N] and EI [N m^2].
    uneven : float
        How much softer it bends about one axis than about the other, 0 to 1 [-]; 0 in the plane.
    frequency : float
        First bending frequency with its ends as the joints hold them [rad/s].
    """

    axial: float
    bending: float
    uneven: float
    frequency: float


class Term(NamedTuple):
    """Something that a model may leave out.

    Attributes
    ----------
    words : str
        That this is no longer small.
    error : callable
        (beam, deformation, times) -> estimated error of the tip [m], shape (n_batch,).
    """

    words: str
    error: Callable[[Beam, Deformation, Array], Array]


def watch_validity(scene: Scene, times: Array, q: Array, v: Array) -> dict[str, Any]:
    """Return where each beam of a truncated model stands, and when it left the range of the model.

    Parameters
    ----------
    times : ndarray, shape (n_times,)
    q, v : ndarray, shape (n_times, n)

    Returns
    -------
    dict of str to dict
        By body: ``left_at`` [s] or None, ``reason``, and ``largest`` with the largest indicators:
        ``estimated_error``, ``slope`` [rad], ``foreshortening`` over length, ``axial_strain`` left out over
        that kept, ``stiffening`` left out over the bending kept, ``inertia`` of third order over that kept,
        ``spin`` over the first bending frequency.  Empty for models that leave nothing out.
    """
    if not len(times) or next(truncated_beams(scene), None) is None:
        return {}
    some = distinct(np.linspace(0, len(times) - 1, min(len(times), MAX_STATES)).astype(int))
    t, q, v = times[some], q[some], v[some]
    x, u = scene.system.absolute(q), scene.system.absolute_velocity(q, v)
    return {body.name: _judge(scene, body, t, x, u) for body in truncated_beams(scene)}


def truncated_beams(scene: Scene) -> Iterator[Body]:
    """Yield the flexible beams whose model leaves terms out."""
    for name, model in scene.models.items():
        if MODELS[model].truncated:
            yield scene.bodies[name]


def validity_warnings(models: Mapping[str, str], validity: dict[str, Any]) -> list[str]:
    """Return a line for each body whose model left its range."""
    return [
        f"body '{name}' left the range of {models[name]} at t = {facts['left_at']:.4g} s: {facts['reason']}; "
        "compare with exact"
        for name, facts in validity.items()
        if facts["left_at"] is not None
    ]


def _judge(scene: Scene, body: Body, t: Array, x: Array, u: Array) -> dict[str, Any]:
    seen = body.deformation(x, u)
    assert seen is not None
    beam, length = _beam(scene, body.name), _length(scene, body.name)
    bent = min(float(np.abs(seen.tip).max()), _reach(scene))
    scale = max(tip_range(scene, body.name, x), bent, 1e-9 * length)
    terms = tip_error(scene, body.name, scene.models[body.name], seen, t)
    error, strain = sum(terms.values(), np.zeros(len(t))) / scale, np.abs(seen.axial).max()
    largest = {
        "estimated_error": float(error.max()),
        "slope": float(seen.steepness.max()),
        "foreshortening": float(seen.shortening.max() / length),
        "axial_strain": float(0.5 * seen.steepness.max() ** 2 / strain) if strain > 0.0 else 0.0,
        "stiffening": float(_stiffening(beam, seen, t).max()),
        "inertia": body.third_order_inertia(x),
        "spin": float(size(seen.spin).max() / beam.frequency),
    }
    loose = _unheld(beam, seen, t) if "stiffening" in terms else np.zeros(len(t), bool)
    left = np.flatnonzero(error > np.where(loose, RUNAWAY, LEFT))
    if not len(left):
        return {"left_at": None, "reason": "", "largest": largest}
    at = int(left[0])
    reason = error_reason(terms, at, seen, error)
    if error[at] <= LEFT:
        ratio = size(seen.spin)[at] / beam.frequency
        reason += f"; it turns {ratio:.2g} times faster than it bends: errors grow"
    return {"left_at": float(t[at]), "reason": reason, "largest": largest}


def _length(scene: Scene, name: str) -> float:
    return scene.bodies[name].points["tip"][0]


def _beam(scene: Scene, name: str) -> Beam:
    beam = scene.deck.section_properties(name).at(_ALONG)
    # the plane is that of x and y; in space the softer of both counts, and along a beam the softest section
    about_y, about_z = (float(np.min(one)) for one in beam.bending_stiffness)
    bending = about_z if scene.deck.dimension == 2 else min(about_y, about_z)
    wave_number = _WAVE_NUMBERS[_ends(scene, name)] / _length(scene, name)
    frequency = wave_number**2 * np.sqrt(bending / float(np.mean(beam.mass_per_length)))
    uneven = 0.0 if scene.deck.dimension == 2 else 1.0 - bending / max(about_y, about_z)
    return Beam(float(np.min(beam.axial_stiffness)), bending, uneven, float(frequency))


def tip_range(scene: Scene, name: str, x: Array) -> float:
    """Return the largest range of a coordinate of a beam's tip [m] in states (n_batch, n).

    At most twice the length of all beams: a model that runs away must not be judged by how far it has run.
    """
    reach = float(np.ptp(scene.marker(f"{name}.tip").position(x), axis=0).max())
    return min(reach, _reach(scene))


def _reach(scene: Scene) -> float:
    """Return twice the length of all beams [m]."""
    return 2.0 * sum(_length(scene, one) for one in scene.models)


def tip_error(scene: Scene, name: str, model: str, seen: Deformation, t: Array) -> dict[str, Array]:
    """Return what a model leaves out at the tip of a beam that deforms so [m], by term, (n_batch,) each.

    Parameters
    ----------
    name : str
        Of the beam.
    model : str
        Need not be that of the scene.
    t : ndarray, shape (n_batch,)
        In order.
    """
    beam = _beam(scene, name)
    return {term: TERMS[term].error(beam, seen, t) for term in MODELS[model].leaves_out}


def error_reason(terms: dict[str, Array], at: int, seen: Deformation, error: Array) -> str:
    """Return in words which term (see `tip_error`) prevails at index ``at``, and how large all are.

    Estimates by small terms say nothing more of one that is not small than that.
    """
    name = max(terms, key=lambda one: float(terms[one][at]))
    slope, share = _told(seen.steepness[at].max(), 10.0), _told(100.0 * error[at], 100.0)
    return f"{TERMS[name].words} (slope {slope} rad, estimated error {share} % of the tip's range)"


def _told(size: float, most: float) -> str:
    return f"{size:.2g}" if size <= most else f"more than {most:g}"


# --- terms ---------------------------------------------------------------------------------------


def _stretch(beam: Beam, seen: Deformation, t: Array) -> Array:
    """Return the elongation left out, the largest so far, and the angle it costs.

    A free spin slows down by twice the share by which the body gets longer.
    """
    turned = cumulative(size(seen.spin), t)
    largest = RINGING * np.maximum.accumulate(np.abs(seen.elongation))
    return np.asarray(largest * (1.0 + 2.0 * turned))


def _bending(beam: Beam, seen: Deformation, t: Array) -> Array:
    """Return the deflection left out, the largest so far, and the phase it costs.

    What bends by a share e of its swing swings slower by e / 2 at most: by pi / 2 of e each half period.
    """
    largest = RINGING * np.maximum.accumulate(size(seen.tip))
    swings = np.max([_half_swings(deflection) for deflection in seen.tip.T], axis=0)
    return np.asarray(largest * (1.0 + 0.5 * np.pi * swings))


def _half_swings(deflection: Array) -> Array:
    """Return how often a deflection has changed sides so far, shape (n_batch,); near zero it has none."""
    reach = np.abs(deflection)
    side = np.sign(np.where(reach > 0.1 * reach.max(initial=0.0), deflection, 0.0))
    there = np.flatnonzero(side)
    turned = np.zeros(len(side))
    turned[there[1:]] = side[there[1:]] != side[there[:-1]]
    return np.cumsum(turned)


def _stiffening(beam: Beam, seen: Deformation, t: Array) -> Array:
    """Return |N v'^2| over the largest EI v''^2 so far, integrals over the beam, shape (n_batch,).

    N v'^2 is its mean over the time that bending takes to answer: waves along the beam do not bend it.
    """
    tension = beam.axial * (seen.axial * seen.steepness**2) @ seen.weights
    left_out = np.abs(_mean_before(t, tension, 1.0 / beam.frequency))
    kept = np.maximum.accumulate(beam.bending * size(seen.curvature) ** 2 @ seen.weights)
    floor = 1e-12 * kept[-1]
    return np.where(kept > floor, left_out / np.where(kept > floor, kept, 1.0), 0.0)


def _mean_before(t: Array, values: Array, window: float) -> Array:
    """Return the mean of a function of time over the window that ends at each time, shape of ``t``."""
    area = cumulative(values, t)
    begin = np.maximum(t - window, t[0])
    length = t - begin
    mean = (area - np.interp(begin, t, area)) / np.where(length > 0.0, length, 1.0)
    return np.where(length > 0.0, mean, values)


def _out_of_line(beam: Beam, seen: Deformation, t: Array) -> Array:
    return np.asarray(_stiffening(beam, seen, t) * np.maximum.accumulate(size(seen.tip)))


def _unheld(beam: Beam, seen: Deformation, t: Array) -> Array:
    """Return when the centrifugal force prevails over the stiffness that is kept, shape (n_batch,)."""
    return np.asarray((_stiffening(beam, seen, t) > 1.0) & (size(seen.spin) > beam.frequency))


def _third_order(beam: Beam, seen: Deformation, t: Array) -> Array:
    return np.asarray(CURVATURE * seen.steepness.max(axis=1) ** 2 * size(seen.tip))


def _turned(beam: Beam, seen: Deformation, t: Array) -> Array:
    """Return by how much the deflection turns with sections that twist: with unequal axes at first order."""
    if seen.twist is None:
        return np.zeros(len(t))
    phi = np.abs(seen.twist).max(axis=1)
    return np.asarray(TWIST * phi * (phi + beam.uneven) * size(seen.tip))


TERMS = {
    "foreshortening": Term(
        "the foreshortening it leaves out is no longer small", lambda beam, seen, t: seen.shortening
    ),
    "stiffening": Term(
        "the stiffening by axial force that it leaves out is no longer small against bending", _out_of_line
    ),
    "bending": Term("the bending it leaves out is no longer small", _bending),
    "stretch": Term("the stretch it leaves out is no longer small", _stretch),
    "twist": Term("the bending that turns with the twist, which it leaves out, is no longer small", _turned),
    "curvature": Term(
        "the terms of third order in the deflection that it leaves out are no longer small", _third_order
    ),
}
"""What models leave out, by the names that `MODELS` states."""


# --- how joints hold the ends --------------------------------------------------------------------


def _ends(scene: Scene, name: str) -> tuple[str, str]:
    """Return how joints hold both ends of a beam, the stiffer one first."""
    root, tip = sorted(
        (_end(scene, f"{name}.{end}") for end in ("root", "tip")), key="clamped pinned free".find
    )
    return root, tip


def _end(scene: Scene, point: str) -> str:
    """Return how joints hold an end; a tip that carries other bodies counts as free."""
    body = scene.bodies[point.split(".")[0]]
    names = {point, point.removesuffix(".root")}
    x, held = scene.system.absolute(scene.q[None]), "free"
    for name, joint in scene.deck.joints.items():
        if not names & set(joint.between):
            continue
        others = (scene.marker(end) for end in joint.between if end not in names)
        if point.endswith(".tip") and not any(marker.grounded for marker in others):
            continue
        held = "pinned" if held == "free" else held
        turning, left_out = _turning(scene, body, point, x), scene.system.redundant
        kept = (scene.system.constraints[k] for k in scene.joints[name])
        for row in (*kept, *(one for one in left_out if one.item == f"joints.{name}")):
            for marker, J in zip(row.ends, row.jacobians(x), strict=True):
                if marker.columns == body.columns and np.abs(J[0] @ turning.T).max(initial=0.0) > BLOCKED:
                    held = "clamped"
    return held


def _turning(scene: Scene, body: Body, point: str, x: Array) -> Array:
    """Return the rates of a body that turns about one of its points, shape (n_spin, n_columns)."""
    n_dim = len(scene.deck.gravity)
    motions = body.freedoms(x[0], scene.start_angles[body.name])
    shifts, spins = motions[:n_dim], motions[n_dim:]
    moved = spins @ scene.marker(point).position_jacobian(x)[0].T
    return np.asarray(spins - moved @ shifts)
