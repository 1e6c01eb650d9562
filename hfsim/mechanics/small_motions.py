"""Small motions about a state: the whole linearisation of the equations of motion, for every body and model.

Near a state x0 with rates u0 and accelerations a0, seen from axes that turn with W
(`hfsim.mechanics.turning`), changes y of the coordinates follow

    M y'' + (D + 2 M W) y' + (K + D W + M W^2) y + Phi_x^T l = 0,    Phi_x y = 0,

with K and D the derivatives by x and u of M(x) a0 - F(t, x, u) + Phi_x^T lambda.  In an equilibrium and in
steady rotation the coefficients are constant in time, and these are the equations of all small motions.
About another state they are those of the moment, and depend on the coordinates they are written in.

The derivatives are those of the parts, dense or sparse; of bodies whose mass matrix changes they come from
differences of fourth order.
"""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array, random_signs
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, is_sparse
from hfsim.maths.pencils import Pencil
from hfsim.mechanics.orthonormal import Orthonormal
from hfsim.mechanics.system import System
from hfsim.mechanics.turning import Turning

_EXACT = float(np.finfo(float).eps)
BY_DIFFERENCES = 1e-11
"""Relative errors of the matrices."""
_SAMPLES = 3
"""States next to one that tell what rounding does there."""


@frozen
class SmallMotions:
    """M z'' + V z' + K z + J^T l = 0 with J z = 0, for small changes z of the free coordinates.

    Attributes
    ----------
    mass : Matrix, shape (n, n)
        M, positive definite on the motions that the joints allow.
    velocity : Matrix, shape (n, n)
        V: damping, which is symmetric, and gyroscopic terms, which are not.
    stiffness : Matrix, shape (n, n)
        K with what forces of inertia and joints have of it; symmetric unless loads follow or things turn.
    jacobian : Matrix, shape (n_rows, n)
        J.
    x, u, a : ndarray, shape (n_x,)
        The absolute coordinates about which they are, their rates and accelerations.
    blur : ndarray, shape (n_x,)
        What the last digits of the coordinates do to the accelerations.
    basis : Matrix, shape (n_x, n)
        B, with y = B z the changes of the absolute coordinates.
    turning : Turning or None
        The axes that they are seen from, where these turn.
    precision : float
        Relative error of the matrices.
    rounding : Matrix, shape (n, n)
        What the last digits of the coordinates do to the stiffness: tension of what is stiff, for one.
    damped : bool
        Whether forces depend on rates, other than those of inertia in axes that turn.
    """

    mass: Matrix
    velocity: Matrix
    stiffness: Matrix
    jacobian: Matrix
    x: Array
    u: Array
    a: Array
    blur: Array
    basis: Matrix
    turning: Turning | None
    precision: float
    rounding: Matrix
    damped: bool

    @property
    def pencil(self) -> Pencil:
        """The same as a problem of eigenvalues."""
        spin = 0.0 if self.turning is None else self.turning.rate**2
        own = self.mass, self.velocity, self.stiffness, self.jacobian
        return Pencil(*own, self.precision, 100.0 * _EXACT * spin, self.rounding)


def small_motions(
    system: System, t: float, x: Array, u: Array, turning: Turning | None = None
) -> SmallMotions:
    """Return the small motions about a state.

    Parameters
    ----------
    x, u : ndarray, shape (n_x,)
        Absolute coordinates and rates that fulfil the joints.
    turning : Turning, optional
        Axes to see them from; those of the ground without.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the equations of motion are singular in this state.
    """
    time, x, u = np.array([t]), x[None], u[None]
    equations, reduction = system.equations, system.reduction
    free, multipliers = equations.solve(time, x, u, system.force(time, x, u))
    # one sample may happen to leave the joints nearly without forces
    signs = 1.0 + _EXACT * random_signs((_SAMPLES, x.shape[1]))
    times, beside, rates = np.repeat(time, _SAMPLES), x * signs, np.repeat(u, _SAMPLES, axis=0)
    free_beside, others = equations.solve(times, beside, rates, system.force(times, beside, rates) * signs)
    a, blur = reduction.expand_rates(free), reduction.expand_rates(free_beside[:1] - free)
    K = stiffness(system, time, x, u, a, multipliers)
    rounding = 0.0 * abs(reduction.reduced(K))
    for one, own in zip(beside, others, strict=True):
        rounding = rounding + abs(reduction.reduced(stiffness(system, time, one[None], u, a, own[None]) - K))
    forces, still = blurs_of_forces(system, x, multipliers, system.force(time, x, u)), 0.0 * others
    blurs = equations.constrained(np.repeat(x, _SAMPLES, axis=0), forces, still)[1]
    rounding = rounding + rounding_of_joints(system, x, multipliers, blurs)
    D = resistance(system, time, x, u)
    damped = bool(abs(D).sum() > 0.0)
    M = equations.mass_at(x)
    if turning is not None:
        W = turning.matrix
        MW = M @ W
        K, D = K + D @ W + MW @ W, D + 2.0 * MW
    J = equations.phi.jacobian_at(x) @ reduction.basis
    M, D, K = (reduction.reduced(one) for one in (M, D, K))
    precision = BY_DIFFERENCES if system.variable_mass else _EXACT
    state = x[0], u[0], a[0], blur[0], reduction.basis, turning
    return SmallMotions(M, D, K, J, *state, precision, rounding, damped)


def stiffness(system: System, t: Array, x: Array, u: Array, a: Array, multipliers: Array) -> Matrix:
    """Return the derivative of M(x) a - F(t, x, u) + Phi_x^T lambda by x in one state, (n_x, n_x).

    Parameters
    ----------
    t : ndarray, shape (1,)
    x, u, a : ndarray, shape (1, n_x)
    multipliers : ndarray, shape (1, n_rows)
    """
    equations = system.equations
    # what is stiff is exact as stiffness times strains, where differences leave a trace of it
    parts, even = list[Entries](), list[Entries]()
    for part in system.together:
        following = part.uses_rates or part.exchanges_power
        (parts if following else even).append(part.in_strains().tangent(t, x, u))
    parts += [body.inertia_slopes(x, a) for body in equations.variable_mass]
    if not equations.phi.constant:
        even += equations.phi.stiffness(x, multipliers)
    shape, sparse = (system.n_x, system.n_x), is_sparse(equations.constant_mass)
    # what has a potential has a symmetric derivative, but for rounding
    conserving = assemble(even, shape, sparse)
    return assemble(parts, shape, sparse) + 0.5 * (conserving + conserving.T)


def blurs_of_forces(system: System, x: Array, multipliers: Array, force: Array) -> Array:
    """Return what the last digits of forces and joint forces are in a state, on free coordinates, (k, n).

    What they do to multipliers may be all that these are, as in a rod between two joints, where the forces at
    its ends balance one another.

    Parameters
    ----------
    x, force : ndarray, shape (1, n_x)
    multipliers : ndarray, shape (1, n_rows)
    """
    equations = system.equations
    sizes = np.abs(force) + np.abs(multipliers) @ abs(equations.phi.jacobian_at(x))
    for one in equations.constraints:
        if isinstance(one, Orthonormal):  # as if seen from other axes, in which all of them bear some
            sizes[:, one.axis_columns] = sizes[:, one.axis_columns].max()
    return np.asarray(_EXACT * random_signs((_SAMPLES, equations.n)) * (sizes @ abs(system.reduction.basis)))


def rounding_of_joints(system: System, x: Array, multipliers: Array, blurs: Array) -> Matrix:
    """Return what rounding leaves of the stiffness of joint forces that cancel out, in free coordinates.

    Shape (n, n); of what is balanced on an axle nothing else is there.

    Parameters
    ----------
    x : ndarray, shape (1, n_x)
    multipliers : ndarray, shape (1, n_rows)
    blurs : ndarray, shape (k, n_rows)
        What rounding of forces does to these.
    """
    phi, basis = system.equations.phi, abs(system.reduction.basis)
    every = (*(_EXACT * multipliers), *blurs) if system.equations.constraints else ()
    parts = [part for one in every for part in phi.stiffness(x, one[None])]
    sizes = [one._replace(values=np.abs(one.values)) for one in parts]
    whole = assemble(sizes, (system.n_x, system.n_x), is_sparse(system.equations.constant_mass))
    return basis.T @ (whole @ basis)


def resistance(system: System, t: Array, x: Array, u: Array) -> Matrix:
    """Return minus the derivative of the forces by the rates in one state, (n_x, n_x)."""
    parts = [part.rate_tangent(t, x, u) for part in system.together if part.uses_rates]
    return assemble(parts, (system.n_x, system.n_x), is_sparse(system.equations.constant_mass))
