"""Polynomials in pieces against SciPy's, evaluated at once, looked up and replayed."""

import numpy as np
import pytest
from natively import native
from scipy.interpolate import CubicSpline, PPoly

from hfsim.maths import piecewise
from hfsim.maths.piecewise import Piecewise
from hfsim.maths.replayed import Replayed

PLACES, VALUES = np.array([-1.0, 0.0, 0.5, 2.0, 2.25]), np.array([1.0, -2.0, 3.0, 0.5, 4.0])
WHERE = np.concatenate([PLACES, np.linspace(-2.0, 3.0, 37)]).reshape(2, 21)


@pytest.mark.parametrize("few", [1, 32])
def test_values_and_derivatives_are_those_of_scipy_also_beyond(few, monkeypatch):
    monkeypatch.setattr(piecewise, "FEW", few)
    curve = CubicSpline(PLACES, VALUES)
    own = Piecewise.of(curve)
    for order in range(5):
        assert own(WHERE, order) == pytest.approx(curve(WHERE, order), rel=1e-13, abs=1e-12)
    assert own.turns() == pytest.approx(curve.derivative().roots(extrapolate=False), rel=1e-13)
    assert np.isnan(own(np.array([np.nan]))).all()


def test_straight_lines_join_points_and_turn_at_none():
    lines = Piecewise.joining(PLACES, VALUES)
    assert lines(WHERE[:, 5:]) == pytest.approx(PPoly(lines.factors, PLACES)(WHERE[:, 5:]))
    assert lines(PLACES) == pytest.approx(VALUES)
    assert lines(WHERE, 2) == pytest.approx(0.0) and not lines.turns().size


@native
@pytest.mark.parametrize(("few", "natively"), [(1, 0), (1, 3000), (32, 0)])
def test_all_pieces_are_replayed(few, natively, monkeypatch):
    """Also those in which nothing was when it was recorded."""
    monkeypatch.setattr(piecewise, "FEW", few)
    monkeypatch.setattr(piecewise, "FEW_NATIVELY", natively)
    own = Piecewise.of(CubicSpline(PLACES, VALUES))
    replayed = Replayed(lambda x: own(x, 1))
    for shift in (0.0, 1.0, 2.0, 9.0):
        x = np.linspace(-1.5, -0.5, 7) + shift
        assert replayed(x) == pytest.approx(own(x, 1), rel=1e-13, abs=1e-13)
    assert replayed.refused is None
