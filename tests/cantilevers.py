"""Clamped beams along x with loads at their tips, and scenes at rest."""

import numpy as np

from hfsim.mechanics.acting import acting_on
from hfsim.scene.build import build
from hfsim.scene.equilibrium import equilibrium_of, problem_of, why_not
from hfsim.scene.loading import parse_deck


def at_rest(scene, t=0.0):
    """Return absolute coordinates (1, n_x) of a scene at rest at a time."""
    found = equilibrium_of(scene, problem_of(scene, t))
    if found.reason:
        raise why_not(scene, t, found)
    return scene.system.reduction.expand(found.state.z)


def inside(scene, x, places, name="b", u=None):
    """Return the internal forces of a beam in a state (1, n) at t = 1, (n_places, 6); at rest if no rates."""
    system, t, u = scene.system, np.ones(1), np.zeros_like(x) if u is None else u
    a, multipliers = system.solved(t, x, u)
    body = scene.bodies[name]
    acting = acting_on(system, body.columns, t, x, u, multipliers)
    return body.section_forces(x, u, a, acting, np.asarray(places))[0]


def cantilever(
    section, length, force, moment=None, elements=4, degree=3, material=None, more="", gravity=None
):
    """Return the scene of a clamped beam along x with loads at its tip that grow to their size at t = 1.

    It is in the plane or in space as its force is.
    """
    moment = moment or (0.0 if len(force) == 2 else [0.0] * 3)
    moment = list(moment) if isinstance(moment, tuple) else moment
    long = f"length: {length!r}," if length else ""
    more = more if "element:" in more else f"element: cosserat, {more}"
    of = f"material: stuff, {more}" if material else more
    return build(
        parse_deck(
            f"""
hfsim: 1
gravity: {gravity or [0.0] * len(force)}
materials: {{stuff: {{density: 1000.0, {material or "youngs_modulus: 1.0"}}}}}
sections: {{bar: {section}}}
bodies:
  b: {{type: beam, section: bar, {long} elements: {elements}, degree: {degree}, {of}}}
joints: {{clamp: {{type: fixed, between: [ground, b.root]}}}}
loads:
  push: {{type: force, at: b.tip, force: {list(force)}, law: {{type: constant_rate, rate: 1.0}}}}
  turn: {{type: moment, at: b.tip, moment: {moment}, law: {{type: constant_rate, rate: 1.0}}}}
solve: {{duration: 1.0}}
"""
        )
    )


def displacement(scene, x, point="b.tip"):
    """Return how far a point has moved from its place in the undeformed scene [m]."""
    marker = scene.marker(point)
    before = scene.system.absolute(scene.q[None])
    return (marker.position(x) - marker.position(before))[0]
