"""The derivative of the accelerations taken apart into modes, where nothing dissipates."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.integrators._derivative import ByStep, Correction, Start
from hfsim.integrators._motions import MotionsDerivative, motions_of
from hfsim.integrators._problem import Increments
from hfsim.integrators._tableau import Collocation
from hfsim.maths.arrays import Array, ComplexArray
from hfsim.maths.frozen import mutable
from hfsim.maths.traced import sometimes
from hfsim.mechanics.linearized import Linearized

DRIVEN = 1e-6
"""Motion of joints in a step, in units of their equations, up to which modes are not taken along."""
_Factor = tuple[Any, Any]
SLOW = 1e-2
"""Angle that a mode swings in a step below which its answer to forces is a power of time."""


@mutable
class ModalDerivative(MotionsDerivative):
    """J_q = -R S with S R = diag(w2), where nothing dissipates: every mode is corrected by itself.

    Attributes
    ----------
    w2 : ndarray, shape (n_modes,)
        Squares of the circular frequencies.
    """

    w2: Array

    def __post_init__(self) -> None:
        super().__post_init__()
        self._factors: ByStep[tuple[_Factor, _Factor]] = ByStep()

    def frequency(self) -> Array:
        """Return the largest circular frequency [rad/s]."""
        return np.asarray(np.sqrt(np.abs(self.w2).max(initial=0.0)))

    def ringing(self) -> Array:
        """Return the circular frequencies of all modes [rad/s]."""
        return np.sqrt(np.abs(self.w2))

    @classmethod
    def of(cls, at: Linearized, natural: Increments, q: Array) -> ModalDerivative:
        """Return the modes of a dense linearised system without damping.

        Following loads make the stiffness unsymmetric; corrections do with its symmetric part.
        """
        allowed = at.allowed
        pull = allowed @ at.stiffness
        K = pull @ allowed.T
        w2, U = np.linalg.eigh(0.5 * (K + K.T))
        return cls(natural, *motions_of(at, natural, q, U.T @ allowed, U.T @ pull), w2)

    def free_motion(self, table: Collocation, start: Start, h: float) -> Array:
        """Let each mode swing from its velocity and acceleration at the start of the step.

        What the joints are driven by goes on uniformly accelerated, and takes the modes along.
        """
        omega = np.sqrt(np.abs(self.w2))
        omega = np.where(omega * h < 1e-4, 1e-4 / h, omega)
        tau = (h * table.nodes)[:, None]
        half = 0.5 * tau * omega
        sine, cosine, square = np.sin(half), np.cos(half), omega * omega
        if sometimes(grows := self.w2 < 0.0):
            growing = np.where(grows, half, 0.0)  # what does not swing; functions of zero take no time
            sine, cosine = np.where(grows, np.sinh(growing), sine), np.where(grows, np.cosh(growing), cosine)
            square = np.where(grows, -square, square)
        sine = sine / omega
        once, twice = 2.0 * sine * cosine, 2.0 * sine * sine
        p1, p2 = self.L @ start.first, self._modal_acceleration(start)
        swing = p1 * once + p2 * twice
        if self.joints is None:
            return np.asarray(swing @ self.R.T)
        rate, acceleration = self.joints.jacobian @ start.first, self.joints.jacobian @ start.second
        opened = tau * rate + 0.5 * tau**2 * acceleration
        driven = np.abs(opened[-1]).max(initial=0.0) > DRIVEN
        if sometimes(driven):
            taken = (rate @ self.joints.forces) * _response(tau, once, square, 1)
            taken = taken + (acceleration @ self.joints.forces) * _response(tau, twice, square, 2)
            swing = np.where(driven, swing - taken, swing)
        return np.asarray(swing @ self.R.T + self.joints.closed(opened))

    def _modal_acceleration(self, start: Start) -> Array:
        """Return accelerations of the modes, where the mass matrix is known from the forces behind them."""
        if self.mass is None:
            return self.L @ start.second
        forces = self.increments.to_natural_forces(start.at, (self.mass @ start.acceleration)[None])[0]
        return np.asarray(forces @ self.R + self.L @ start.convective)

    def correction(self, table: Collocation, h: float) -> Correction:
        """Multiply each mode and pole by (h pole)^2 and divide it by 1 + (h pole)^2 w2."""
        factor, mu2 = self._factors.of(h, lambda: self._parted((h * table.poles[:, None]) ** 2))
        poles, m, joints, end_rate = len(table.poles), len(self.w2), self.joints, table.end_rate
        # the stages, and then what they do to rates at the end; what is in no mode counts as if it were slow
        joining = np.concatenate([table.joining, (end_rate @ table.joining)[None]])
        slow = table.slow(h)
        moved = h * np.concatenate([h * table.A2, slow * (end_rate @ table.A2)[None]])
        # a velocity error of a mode swings out to itself over the frequency
        per_rate = 1.0 / np.sqrt(np.abs(self.w2) + 1.0 / slow**2) / h
        R = np.ascontiguousarray(self.R.T)

        def correct(r: Array) -> tuple[Array, Array]:
            r = self._read(r)
            parts = (table.parting @ r).reshape(2, poles, -1)
            z = parts[:, :, :m]
            if joints is not None:
                z = z - _product(mu2, parts[:, :, m:]) @ joints.forces
            modes = joining @ _product(factor, z).reshape(2 * poles, m)
            modes[-1] *= per_rate
            # back in coordinates: amplitudes of nearly parallel modes mean nothing one by one
            y = modes @ R
            if joints is not None:
                y += joints.closed(moved @ r[:, m:])
            return y[:-1], np.abs(y[-1]).max()

        return correct

    def _parted(self, mu2: ComplexArray) -> tuple[_Factor, _Factor]:
        """Return the factors of modes, and those of what joints are driven by."""
        factor = mu2 / (1.0 + mu2 * self.w2)
        return _factor(factor.real, factor.imag), _factor(mu2.real, mu2.imag)

    def inverse(self, by_q: float, by_v: float) -> Array:
        """Put the inverse together from the modes."""
        divisor = 1.0 / (1.0 + by_q * self.w2)
        inverse = np.asarray((self.R * divisor) @ self.L)
        if self.joints is not None:
            coupled = self.joints.closing.T - (self.R * (by_q * divisor)) @ self.joints.forces.T
            inverse = inverse + coupled @ self.joints.jacobian
        return inverse


def _factor(real: Any, imaginary: Any) -> _Factor:
    """Return what multiplies equal parts, and what the other ones."""
    return np.ascontiguousarray(real), np.stack([-imaginary, imaginary])


def _product(factor: _Factor, parts: Any) -> Any:
    """Return complex products of real and imaginary parts (2, n_poles, n)."""
    return factor[0] * parts + factor[1] * parts[::-1]


def _response(tau: Array, free: Array, square: Array, power: int) -> Any:
    """Return how modes at rest answer forces tau^power / power!, beside how they swing by themselves.

    The latter, ``free``, is sin(omega tau) / omega or (1 - cos(omega tau)) / omega^2: what is left of
    tau^power / power!, over omega^2, the ``square``.
    """
    forced = tau**power / power
    slow = np.abs(square) * tau[-1] ** 2 < SLOW**2
    small = forced * tau**2 / ((power + 1) * (power + 2))
    return np.where(slow, small, (forced - free) / np.where(slow, 1.0, square))
