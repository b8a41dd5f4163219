"""Polynomials through functions of several variables: those of a polynomial are its own coefficients."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from boomctl.chebyshev import fitted, points_along, series, tried_points


def polynomial(points):
    """Return ``[3 - x, x y^2]`` at some points."""
    return {"f": np.array([[3.0 - x, x * y**2] for x, y in points])}


def rounding(stacks):
    return {name: 1e-12 * np.abs(stack).max(axis=0) for name, stack in stacks.items()}


@pytest.mark.parametrize("degree", range(5))
def test_series_of_chebyshev_polynomial_is_its_unit_vector(degree):
    unit = np.eye(5)[degree]
    found = series(chebyshev.chebval(chebyshev.chebpts1(5), unit))
    np.testing.assert_allclose(found, unit, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(("axis", "count"), [([1.0, 0.0], 2), ([0.0, 1.0], 3)])
def test_points_along_polynomial_are_degree_plus_one(axis, count):
    assert points_along(polynomial, np.array(axis), rounding, 8) == count


def test_fitted_polynomial_has_its_own_coefficients():
    wanted = polynomial(tried_points(2))
    found, off, miss = fitted(polynomial, [2, 3], wanted, rounding, 10.0, "f")
    assert miss <= 10.0
    assert off["f"].max() < 1e-11
    expected = {(): [3.0, 0.0], (0,): [-1.0, 0.0], (0, 1, 1): [0.0, 1.0]}
    assert set(found["f"]) >= set(expected)
    for powers, coefficients in found["f"].items():
        np.testing.assert_allclose(coefficients, expected.get(powers, [0.0, 0.0]), rtol=0.0, atol=1e-12)
