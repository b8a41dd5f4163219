"""Responses at poles, grids around resonances, the highest peak."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.exceptions import SingularFrequencyWarning
from boomctl.lti.frequency import (
    highest_peak,
    largest_gain,
    resonance_grid,
    singular_values,
    smooth_curve,
)
from boomctl.lti.modal import partial_fractions
from boomctl.lti.system import Lti
from tests.profiles import examples


def test_frequency_at_pole_is_shifted():
    undamped = Lti(
        np.array([[0.0, 1.0], [-4.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))
    )
    with pytest.warns(SingularFrequencyWarning, match="a pole lies at 2 rad/s"):
        found = undamped.response(np.array([1.0, 2.0, 3.0]))[0, 0]
    alone = undamped.response(np.array([1.0, 3.0]))[0, 0]
    assert (found[[0, 2]] == alone).all()
    assert abs(found[1]) > 1e7
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (undamped.response(np.array([2.0]), quiet=True)[0, 0] == found[1]).all()


def test_grid_resolves_every_resonance():
    poles = np.array([-1e-3 + 2j, -1e-3 - 2j, -0.5, -1e-9 + 5j, -1e-9 - 5j])
    grid = resonance_grid(poles, 0.1, 10.0, points=5, narrowest=1e-6, also=[0.0, 20.0])
    assert (np.diff(grid) > 0.0).all()
    assert grid[0] == 0.0
    assert grid[-1] == 20.0
    for place, width in ((2.0, 1e-3), (5.0, 5e-6)):
        assert (np.abs(grid - place) <= 1.01 * width).sum() == 7


@given(st.floats(-7.0, -0.3), st.floats(-2.0, 2.0), st.floats(0.01, 0.99))
def test_peak_matches_closed_form_on_any_grid(decade, scale, offset):
    zeta, w0 = 10.0**decade, 10.0**scale

    def value(omega):  # 1/|r^2 - 1 + 2j zeta r|, its first part written so that no digits cancel
        r = omega / w0
        return 1.0 / np.hypot((r - 1.0) * (r + 1.0), 2.0 * zeta * r)

    step = np.sqrt(0.5) * zeta * w0
    grid = np.array([0.1 * w0, *(w0 * np.sqrt(1.0 - 2.0 * zeta**2) + step * (offset + np.arange(-3, 3))), 20.0 * w0])
    peak, at = highest_peak(value, grid)
    assert peak == pytest.approx(1.0 / (2.0 * zeta * np.sqrt(1.0 - zeta**2)), rel=1e-12)
    assert at == pytest.approx(w0 * np.sqrt(1.0 - 2.0 * zeta**2), abs=1e-5 * zeta * w0 + 1e-15 * w0 / zeta)


@pytest.mark.parametrize("zeta", [1e-4, 0.03, 0.7])
def test_curve_through_resonance_is_smooth(zeta):
    def respond(omega):
        return 1.0 / (1.0 - omega**2 + 2j * zeta * omega)

    grid = resonance_grid(np.array([-zeta + 1j]), 0.1, 10.0)
    omega, curve = smooth_curve(respond, grid)
    np.testing.assert_array_equal(curve, respond(omega))
    assert np.isin(grid, omega).all()
    assert (np.abs(np.diff(curve)) <= 0.05 * (1.0 + np.minimum(np.abs(curve[1:]), np.abs(curve[:-1])))).all()


@given(st.integers(2, 9), st.floats(-12.0, 0.0))
def test_largest_gain_of_nearly_equal_poles(n, decade):
    """Poles -1, -1 - e, ...: their eigenvectors are nearly dependent, and show anything; the gain is at rest."""
    poles = -1.0 - 10.0**decade * np.arange(n)
    A = np.diag(poles) + np.diag(np.ones(n - 1), -1)
    B, C = np.eye(n)[:, :1], np.eye(n)[-1:]
    system = Lti(A, B, C, np.zeros((1, 1)))
    peak, at = largest_gain(partial_fractions(system), system.response)
    assert peak == pytest.approx(1.0 / np.prod(-poles), rel=1e-12)
    assert at < 1e-3


@given(seed=st.integers(0, 10**6), p=st.integers(1, 6), m=st.integers(1, 6))
@examples(200)
def test_singular_values_match_lapack(seed, p, m):
    rng = np.random.default_rng(seed)
    G = (rng.normal(size=(p, m, 40)) + 1j * rng.normal(size=(p, m, 40))) * 10.0 ** rng.uniform(-6.0, 6.0, (p, 1, 40))
    G[:, :, :10] *= 10.0 ** rng.uniform(-6.0, 6.0, (1, m, 10))
    G[:, -1, 10:20] = (1.0 + 1e-9 * rng.normal(size=10)) * G[:, 0, 10:20]  # columns that hardly differ
    G[-1, :, 20:25], G[:, 0, 25:30], G[:, :, 30] = 0.0, 0.0, 0.0
    G[:, :, 31] = np.eye(p, m)  # values that meet
    found, known = singular_values(G), np.linalg.svd(G.transpose(2, 0, 1), compute_uv=False).T
    assert found.shape == known.shape
    assert np.all(np.abs(found - known) <= 1e-14 * known[0])
    assert np.all(np.diff(found, axis=0) <= 0.0)


def test_small_singular_value_accurate_in_any_units():
    G = np.array([[3.0 + 1.0j, 1.0], [2.0, 1.0 - 1.0j]])[:, :, None]
    small = singular_values(G * np.array([1e9, 1.0])[:, None, None])[1, 0]
    determinant, long = abs(G[0, 0, 0] * G[1, 1, 0] - G[0, 1, 0] * G[1, 0, 0]), np.sqrt(11.0)  # the first row's length
    assert small == pytest.approx(determinant / long, rel=1e-12)
