"""Equilibrium of small scenes by Newton iteration on their forces, tangents and constraints."""

import numpy as np

from hfsim.maths.matrices import assemble, dense
from hfsim.mechanics.acting import acting_on
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

CONVERGED = 1e-9
"""Last step, relative to the largest coordinate: quadratic convergence has made the error far smaller."""


def equilibrium(scene, steps=10):
    """Return absolute coordinates (1, n) at rest at t = 1; loads that grow with time are put on in steps."""
    system = scene.system
    z, multipliers = scene.q[None], np.zeros((1, system.n_rows))
    for t in np.linspace(0.0, 1.0, steps + 1)[1:]:
        z, multipliers = _balanced(system, np.array([t]), z, multipliers)
    return system.absolute(z)


def _balanced(system, t, z, multipliers):
    equations, B, n = system.equations, system.reduction, system.n
    for _ in range(60):
        x = system.absolute(z)
        u = np.zeros_like(x)
        parts = [part.tangent(t, x, u) for part in system.forces]
        parts += equations.phi.stiffness(x, multipliers)
        basis, J = dense(B.basis), dense(equations.phi.jacobian_at(x))
        J, K = J @ basis, basis.T @ assemble(parts, (system.n_x, system.n_x), False) @ basis
        left = B.free_force(system.force(t, x, u)) - multipliers @ J
        matrix = np.block([[K, J.T], [J, np.zeros((len(J), len(J)))]])
        step = np.linalg.solve(matrix, np.concatenate([left, -equations.phi.residual(t, x)], axis=1)[0])
        z, multipliers = z + step[:n], multipliers + step[n:]
        if np.abs(step[:n]).max() < CONVERGED * max(1.0, np.abs(z).max()):
            return z, multipliers
    raise AssertionError(f"no equilibrium at t = {t[0]:g}")


def inside(scene, x, places, name="b", u=None):
    """Return the internal forces of a beam in a state (1, n) at t = 1, (n_places, 6); at rest if no rates."""
    system, t, u = scene.system, np.ones(1), np.zeros_like(x) if u is None else u
    a, multipliers = system.solved(t, x, u)
    body = scene.bodies[name]
    acting = acting_on(system, body.columns, t, x, u, multipliers)
    return body.section_forces(x, u, a, acting, np.asarray(places))[0]


def cantilever(section, length, force, moment=None, elements=4, degree=3, material=None, more=""):
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
gravity: {[0.0] * len(force)}
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
