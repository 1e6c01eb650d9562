"""Closed forms and plain differences that tests hold the code against; nothing here imports hfsim."""

import numpy as np

# ---------------------------------------------------------------- differences, sixth order

_FIRST = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
_SECOND = ((1, 3 / 2), (2, -3 / 20), (3, 1 / 90))


def along(function, h=1e-2):
    """First derivative at 0 of a function of one number array (n,) -> (n, ...)."""
    values = function(h * np.arange(-3, 4))
    return sum(c * (values[3 + k] - values[3 - k]) for k, c in _FIRST) / h


def twice_along(function, h=4e-3):
    """Second derivative at 0 of a function of one number array (n,) -> (n, ...)."""
    values = function(h * np.arange(-3, 4))
    return (sum(c * (values[3 + k] + values[3 - k]) for k, c in _SECOND) - 49 / 18 * values[3]) / h**2


def jacobian(function, x, h=1e-3):
    """Derivative of a batched function (n_batch, n) -> (n_batch, ...) at x (n,); the last axis is x."""
    steps = np.concatenate([k * np.eye(len(x)) for k in (-3, -2, -1, 1, 2, 3)])
    values = function(x + h * steps)
    values = values.reshape(6, len(x), *values.shape[1:])
    slope = sum(c * (values[2 + k] - values[3 - k]) for k, c in _FIRST) / h
    return np.moveaxis(slope, 0, -1)


# ---------------------------------------------------------------- shape functions, written out


def cable_row(x, length):
    """Cubic Hermite row of (r1, r1', r2, r2') at x [m]."""
    a = x / length
    return np.array(
        [
            1 - 3 * a**2 + 2 * a**3,
            length * (a - 2 * a**2 + a**3),
            3 * a**2 - 2 * a**3,
            length * (a**3 - a**2),
        ]
    )


def quintic_row(x, length):
    """Row of (r1, r1', two interior vectors, r2, r2') at x [m] of a cable element of degree 5."""
    a, h = x / length, cable_row(x, length)
    bubble = length * (a * (1 - a)) ** 2
    return np.array([h[0], h[1], 5 / 2 * bubble, 7 / 2 * (2 * a - 1) * bubble, h[2], h[3]])


def cable_row_x(x, length):
    """Derivative of `cable_row` by x."""
    a = x / length
    return np.array(
        [(6 * a**2 - 6 * a) / length, 1 - 4 * a + 3 * a**2, (6 * a - 6 * a**2) / length, 3 * a**2 - 2 * a]
    )


def cable_row_xx(x, length):
    """Second derivative of `cable_row` by x."""
    a = x / length
    return np.array(
        [
            (12 * a - 6) / length**2,
            (6 * a - 4) / length,
            (6 - 12 * a) / length**2,
            (6 * a - 2) / length,
        ]
    )


def continuum_row(x, y, length):
    """Row of (r1, r1_x, r1_y, r2, r2_x, r2_y): cubic in x, linear in y."""
    h, a = cable_row(x, length), x / length
    return np.array([h[0], h[1], y * (1 - a), h[2], h[3], y * a])


def continuum_row_x(x, y, length):
    """Derivative of `continuum_row` by x."""
    h = cable_row_x(x, length)
    return np.array([h[0], h[1], -y / length, h[2], h[3], y / length])


def continuum_row_y(x, y, length):
    """Derivative of `continuum_row` by y."""
    a = x / length
    return np.array([0, 0, 1 - a, 0, 0, a])


def gauss(points, low, high):
    """Gauss points and weights on an interval."""
    x, w = np.polynomial.legendre.leggauss(points)
    return 0.5 * (low + high) + 0.5 * (high - low) * x, 0.5 * (high - low) * w


# ---------------------------------------------------------------- energies


def stretch_energy(stretch, EA, length, strain):
    """Energy of a uniformly stretched line."""
    e = stretch - 1 if strain == "engineering" else (stretch**2 - 1) / 2
    return EA * e**2 * length / 2


def parabola_energy(curvature, EA, EI, length):
    """Energy of r = (x, curvature x^2 / 2) with Green strain and curvature r''."""
    return EI * curvature**2 * length / 2 + EA * curvature**4 * length**5 / 40


def arc_energy(curvature, EI, length):
    """Energy of a line bent into a circular arc without stretch."""
    return EI * curvature**2 * length / 2


def homogeneous_energy(F, lame_lambda, lame_mu, volume):
    """Saint Venant-Kirchhoff energy of a uniform deformation gradient F."""
    E = (F.T @ F - np.eye(len(F))) / 2
    return volume * (lame_lambda * np.trace(E) ** 2 / 2 + lame_mu * np.sum(E * E))


# ---------------------------------------------------------------- motion


def turned(angle):
    """Planar rotation matrix."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def crossed(spin, a):
    """Return spin x a: velocities of places (..., n_dim) about the origin, for a spin (1,) or (3,)."""
    a = np.asarray(a)
    return np.cross(spin, a) if a.shape[-1] == 3 else spin * np.stack([-a[..., 1], a[..., 0]], axis=-1)


def moment_of(arm, force):
    """Return arm x force, shape (1,) in the plane and (3,) in space."""
    return np.cross(arm, force) if len(arm) == 3 else np.array([arm[0] * force[1] - arm[1] * force[0]])


def tilde(a):
    """Matrix of the cross product with a spatial vector."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
