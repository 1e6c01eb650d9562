"""Validity of the truncated models: what they left out against what they kept, along a run.

A beam of the model `linear` has no foreshortening and no stiffening by tension; one of `lowOrder` has
both, and leaves out the third order in the inertia and the quadratic terms of its curvature.  From the
deformation that the model itself computes these terms follow, and from them an estimate of the error of
the beam's tip, relative to the largest range of a coordinate of the tip over the run:

    linear     (s + |N v'^2| / |EI v''^2| |v|) / range      s = 1/2 int v'^2, N = EA u1'
    lowOrder   `CURVATURE` max v'^2 |v| / range             v deflection of the tip in the body frame
    rigid      2 (|v| (1 + pi/2 n) + |u| (1 + 2 theta)) / range     after n half periods and theta turned

u and v of a rigid beam are those of the same forces at rest (`hfsim.trust.quasistatic`).

In the model linear |N v'^2| is a mean over the time that bending takes to answer, and of what
oscillates, |EI v''^2| and |v|, the largest values so far count.  The estimate is one of order of
magnitude: the error of a phase that grows over many periods is not in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from hfsim.maths.arrays import Array, distinct
from hfsim.maths.rotations import as_complex
from hfsim.maths.shapes import gauss_legendre
from hfsim.parts.bodies import BeamSpec
from hfsim.parts.bodies.frame import relative_nodes
from hfsim.parts.bodies.low_order_body import LowOrderBody
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.nodal import NodalBeam
from hfsim.scene.build import Scene

LEFT = 5e-3
"""Estimated relative error at which a model has left its range; see tests/benchmarks/validity.py."""
CURVATURE = 1.9
"""Relative error of a deflection by `lowOrder` over the largest slope squared, measured on a cantilever."""
RINGING = 2.0
"""Largest deformation under a load that sets in suddenly over that of the same load at rest."""
TRUNCATED = ("linear", "lowOrder")
"""Models of flexible beams that leave terms out."""
STEEP = 0.3
"""Slope [rad] from which small angles are no longer small."""
MAX_STATES = 2000
"""States looked at."""

_WAVE_NUMBERS = {
    ("clamped", "free"): 1.8751,
    ("pinned", "free"): 3.9266,
    ("free", "free"): 4.7300,
    ("pinned", "pinned"): np.pi,
    ("clamped", "pinned"): 3.9266,
    ("clamped", "clamped"): 4.7300,
}
"""First wave number times length of a beam by its ends, the stiffer end first."""


class Deformation(NamedTuple):
    """One beam of a truncated model in its body frame, in a batch of states.

    Attributes
    ----------
    axial, slope, curvature : ndarray, shape (n_batch, n_points)
        u1', u2' [-] and u2'' [1/m] at Gauss points; for lowOrder those of w and v.
    tip : ndarray, shape (n_batch,)
        Deflection of the tip [m].
    spin : ndarray, shape (n_batch,)
        Angular velocity of the body frame [rad/s].
    weights : ndarray, shape (n_points,)
        Of the Gauss points [m].
    """

    axial: Array
    slope: Array
    curvature: Array
    tip: Array
    spin: Array
    weights: Array

    @property
    def shortening(self) -> Array:
        """1/2 int u2'^2 dx [m], shape (n_batch,)."""
        return np.asarray(0.5 * self.slope**2 @ self.weights)


def watch_validity(scene: Scene, times: Array, q: Array, v: Array) -> dict[str, Any]:
    """Return where each beam of a truncated model stands, and when it left the range of the model.

    Parameters
    ----------
    scene : Scene
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


def truncated_beams(scene: Scene) -> Iterator[NodalBeam | LowOrderBody]:
    """Yield the beams whose model leaves terms out."""
    for body in scene.bodies.values():
        if isinstance(body, NodalBeam | LowOrderBody) and scene.models[body.name] in TRUNCATED:
            yield body


def validity_warnings(models: Mapping[str, str], validity: dict[str, Any]) -> list[str]:
    """Return a line for each body whose model left its range."""
    return [
        f"body '{name}' left the range of {models[name]} at t = {facts['left_at']:.4g} s: {facts['reason']}; "
        "compare with exact"
        for name, facts in validity.items()
        if facts["left_at"] is not None
    ]


def _judge(scene: Scene, body: NodalBeam | LowOrderBody, t: Array, x: Array, u: Array) -> dict[str, Any]:
    spec = _beam(scene, body.name)
    seen = deformation(body, x, u)
    scale = max(tip_range(scene, body.name, x), 1e-9 * spec.length)
    first, stiffening = _stiffening_of(scene, body.name, seen, t)
    terms = _error_terms(seen, scene.models[body.name], stiffening)
    error = sum(terms.values(), np.zeros(len(t))) / scale
    largest = {
        "estimated_error": float(error.max()),
        "slope": float(np.abs(seen.slope).max()),
        "foreshortening": float(seen.shortening.max() / spec.length),
        "axial_strain": float(_over(0.5 * (seen.slope**2).max(), np.abs(seen.axial).max())),
        "stiffening": float(np.abs(stiffening).max()),
        "inertia": _third_order(body, x),
        "spin": float(np.abs(seen.spin).max() / first),
    }
    left = np.flatnonzero(error > LEFT)
    if not len(left):
        return {"left_at": None, "reason": "", "largest": largest}
    at = int(left[0])
    return {"left_at": float(t[at]), "reason": error_reason(terms, at, seen, error), "largest": largest}


def _beam(scene: Scene, name: str) -> BeamSpec:
    spec = scene.deck.bodies[name]
    assert isinstance(spec, BeamSpec)
    return spec


def tip_range(scene: Scene, name: str, x: Array) -> float:
    """Return the largest range of a coordinate of a beam's tip [m] in states (n_batch, n).

    At most twice the length of all beams: a model that runs away must not be judged by how far it has run.
    """
    reach = float(np.ptp(scene.marker(f"{name}.tip").position(x), axis=0).max())
    lengths = sum(one.length for one in scene.deck.bodies.values() if isinstance(one, BeamSpec))
    return min(reach, 2.0 * lengths)


def tip_error(scene: Scene, name: str, model: str, seen: Deformation, t: Array) -> dict[str, Array]:
    """Return what a model leaves out at the tip of a beam that deforms so [m], by cause, (n_batch,) each.

    Parameters
    ----------
    scene : Scene
    name : str
        Of the beam.
    model : str
        ``rigid``, ``linear`` or ``lowOrder``; need not be that of the scene.
    seen : Deformation
    t : ndarray, shape (n_batch,)
        In order.
    """
    stiffening = _stiffening_of(scene, name, seen, t)[1] if model == "linear" else np.zeros(len(t))
    if model == "rigid":
        return {"bending": _bending_left_out(seen), "stretch": _stretch_left_out(seen, t)}
    return _error_terms(seen, model, stiffening)


def _stiffening_of(scene: Scene, name: str, seen: Deformation, t: Array) -> tuple[float, Array]:
    """Return the first bending frequency of a beam [rad/s] and the stiffening left out, (n_batch,)."""
    beam = scene.deck.properties(name)
    EA, EI = beam.axial_stiffness, beam.bending_stiffness
    first = _first_frequency(scene, name, _beam(scene, name).length, np.sqrt(EI / beam.mass_per_length))
    return first, _stiffening(seen, EA, EI, t, 1.0 / first)


def _error_terms(seen: Deformation, model: str, stiffening: Array) -> dict[str, Array]:
    """Return estimates of the error of the tip [m] by what causes it, each of shape (n_batch,)."""
    steepest = np.abs(seen.slope).max(axis=1)
    if model == "lowOrder":
        return {"curvature": CURVATURE * steepest**2 * np.abs(seen.tip)}
    deflection = np.maximum.accumulate(np.abs(seen.tip))
    return {"foreshortening": seen.shortening, "stiffening": stiffening * deflection}


def _stretch_left_out(seen: Deformation, t: Array) -> Array:
    """Return the elongation left out [m], shape (n_batch,): the largest so far, and the angle it costs.

    A free spin slows down by twice the share by which the body gets longer.
    """
    spin = np.abs(seen.spin)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (spin[1:] + spin[:-1]) * np.diff(t))])
    largest = RINGING * np.maximum.accumulate(np.abs(seen.axial @ seen.weights))
    return np.asarray(largest * (1.0 + 2.0 * turned))


def _bending_left_out(seen: Deformation) -> Array:
    """Return the deflection left out [m], shape (n_batch,): the largest so far, and the phase it costs.

    What bends by a share e of its swing swings slower by e / 2 at most: by pi / 2 of e each half period.
    """
    largest = RINGING * np.maximum.accumulate(np.abs(seen.tip))
    side = np.sign(np.where(np.abs(seen.tip) > 0.1 * np.abs(seen.tip).max(initial=0.0), seen.tip, 0.0))
    sides = side[side != 0.0]
    turned = np.zeros(len(side))
    turned[np.flatnonzero(side)[1:]] = sides[1:] != sides[:-1]
    return np.asarray(largest * (1.0 + 0.5 * np.pi * np.cumsum(turned)))


def error_reason(terms: dict[str, Array], at: int, seen: Deformation, error: Array) -> str:
    """Return in words which term (see `tip_error`) prevails at index ``at``, and how large all are."""
    name = max(terms, key=lambda one: float(terms[one][at]))
    words = {
        "foreshortening": "the foreshortening it leaves out is no longer small",
        "stiffening": "the stiffening by axial force that it leaves out is no longer small against bending",
        "bending": "the bending it leaves out is no longer small",
        "stretch": "the stretch it leaves out is no longer small",
        "curvature": "the terms of third order in the deflection that it leaves out are no longer small",
    }[name]
    slope = float(np.abs(seen.slope[at]).max())
    return f"{words} (slope {slope:.2g} rad, estimated error {100.0 * error[at]:.2g} % of the tip's range)"


def _stiffening(seen: Deformation, EA: float, EI: float, t: Array, window: float) -> Array:
    """Return |N v'^2| over the largest EI v''^2 so far, integrals over the beam, shape (n_batch,).

    N v'^2 is its mean over the time that bending takes to answer: waves along the beam do not bend it.
    """
    left_out = np.abs(_mean_before(t, (EA * seen.axial * seen.slope**2) @ seen.weights, window))
    kept = np.maximum.accumulate((EI * seen.curvature**2) @ seen.weights)
    floor = 1e-12 * kept[-1]
    return np.where(kept > floor, left_out / np.where(kept > floor, kept, 1.0), 0.0)


def _mean_before(t: Array, values: Array, window: float) -> Array:
    """Return the mean of a function of time over the window that ends at each time, shape of ``t``."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])
    begin = np.maximum(t - window, t[0])
    length = t - begin
    mean = (area - np.interp(begin, t, area)) / np.where(length > 0.0, length, 1.0)
    return np.where(length > 0.0, mean, values)


def _over(a: float, b: float) -> float:
    return a / b if b > 0.0 else 0.0


def _third_order(body: NodalBeam | LowOrderBody, x: Array) -> float:
    return body.beam.third_order_inertia(x) if isinstance(body, LowOrderBody) else 0.0


def _first_frequency(scene: Scene, name: str, length: float, wave_speed: float) -> float:
    """Return the first bending frequency [rad/s] of the beam with its ends as the joints hold them."""
    ends = sorted((_end(scene, f"{name}.root"), _end(scene, f"{name}.tip")), key="clamped pinned free".find)
    return float((_WAVE_NUMBERS[ends[0], ends[1]] / length) ** 2 * wave_speed)


def _end(scene: Scene, point: str) -> str:
    """Return how joints hold an end; a tip that carries other bodies counts as free."""
    names = {point, point.removesuffix(".root")}
    grounded = {"ground"} if point.endswith(".tip") else None
    kinds = set()
    for joint in scene.deck.joints.values():
        mine = names & set(joint.between)
        other = {end.split(".")[0] for end in joint.between if end not in names}
        if mine and (grounded is None or other & grounded):
            kinds.add(joint.type)
    if kinds & {"fixed", "prismatic", "driver"}:
        return "clamped"
    return "pinned" if kinds else "free"


def deformation(body: NodalBeam | LowOrderBody, x: Array, u: Array) -> Deformation:
    """Return the deformation of a beam in its body frame.

    Parameters
    ----------
    body : NodalBeam or LowOrderBody
    x, u : ndarray, shape (n_batch, n)
        Absolute coordinates and their rates.
    """
    mesh = body.beam.mesh if isinstance(body, LowOrderBody) else body.mesh
    weights, D1, D2 = _rows(mesh)
    tip = mesh.shape(mesh.length)
    if isinstance(body, LowOrderBody):
        _, _, w, v = body.beam.split(x)
        axial, across, tip_row = w @ D1[:, 1:].T, v, tip[2:]
        D1, D2 = D1[:, 2:], D2[:, 2:]
        spin = body.beam.split(u)[1]
    else:
        origin, tangent, z = relative_nodes(x[:, body.columns].reshape(len(x), -1, 2))
        p = (z - mesh.positions * origin) * tangent.conj()
        axial, across, tip_row = p.real @ D1.T - 1.0, p.imag, tip
        rate = as_complex(u[:, body.columns].reshape(len(u), -1, 2))[:, 1] * tangent[:, 0].conj()
        spin = rate.imag / np.abs(z[:, 1])
    return Deformation(axial, across @ D1.T, across @ D2.T, across @ tip_row, np.asarray(spin), weights)


def _rows(mesh: BeamMesh) -> tuple[Array, Array, Array]:
    """Return weights [m] and the rows of the first and second derivatives at four Gauss points an element."""
    places, w = gauss_legendre(4)
    at = (np.arange(mesh.count)[:, None] + places).ravel() * mesh.element.length
    D1 = np.array([mesh.shape(float(a), 0.0, (1, 0)) for a in at])
    D2 = np.array([mesh.shape(float(a), 0.0, (2, 0)) for a in at])
    return np.tile(w, mesh.count) * mesh.element.length, D1, D2
