"""Blades of model lowOrder that turn in their plane, against Galerkin's method (Yoo and Shin 1998)."""

from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss

import hfsim

DECK = Path(__file__).parents[2] / "cases" / "verify" / "lag.yaml"
ALPHA = 70.0
"""Slenderness, sqrt(A L^2 / I)."""


def lag_and_stretch(gamma, stretched, count=16):
    """Return circular frequencies of the lag, coupled with the stretch by Coriolis' forces, of a unit blade.

    Tension is that of the straight blade, or of the one that the spin has stretched, whose x + w is
    sin(k x) / (k cos k) with k = gamma / alpha.
    """
    x, w = leggauss(60)
    x, w, k = 0.5 * x + 0.5, 0.5 * w, gamma / ALPHA
    straight = 0.5 * gamma**2 * (1.0 - x * x)
    tension = ALPHA**2 * (np.cos(k * x) / np.cos(k) - 1.0) if stretched else straight
    shapes = [Legendre.basis(k, domain=[0, 1]).convert(kind=Polynomial) for k in range(count)]

    def values(factor, order):
        return np.array([(factor * one).deriv(order)(x) if order else (factor * one)(x) for one in shapes])

    s, ds = (values(Polynomial([0, 1]), k) for k in (0, 1))
    v, dv, ddv = (values(Polynomial([0, 0, 1]), k) for k in (0, 1, 2))
    zero, one = np.zeros((count, count)), np.eye(2 * count)
    M = np.block([[(s * w) @ s.T, zero], [zero, (v * w) @ v.T]])
    along, across = ALPHA**2 * (ds * w) @ ds.T, (ddv * w) @ ddv.T + (dv * w * tension) @ dv.T
    K = np.block([[along, zero], [zero, across]]) - gamma**2 * M
    coriolis = 2.0 * gamma * (v * w) @ s.T
    G = np.block([[zero, -coriolis.T], [coriolis, zero]])
    A = np.block([[0.0 * one, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, G)]])
    found = np.linalg.eigvals(A).imag
    return np.sort(found[found > 1e-6])


def test_galerkin_s_method_gives_the_published_frequencies():
    published = [3.54269166, 22.15784360, 61.83313887, 109.969282]
    assert lag_and_stretch(1.0, stretched=False)[:4] == pytest.approx(published, rel=5e-9)


@pytest.mark.parametrize("gamma", [1.0, 5.0, 10.0])
def test_low_order_lags_as_theory_says_of_a_blade_that_the_spin_has_stretched(gamma):
    found = hfsim.modes(DECK, {"parameters.speed": gamma}, about="steady", count=4)
    expected = lag_and_stretch(gamma, stretched=True)[:4]
    assert 2.0 * np.pi * found.frequencies == pytest.approx(expected, rel=2e-8)
