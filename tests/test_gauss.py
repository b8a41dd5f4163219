"""Collocation coefficients: exact for polynomials, and those that CasADi's nodes give."""

import numpy as np
import pytest

from boomctl.gauss import gauss_method, lagrange_integrals


def test_lagrange_integrals_exact_for_polynomials():
    nodes, at = np.polynomial.legendre.leggauss(7)[0], np.linspace(-1, 1, 5)
    rows = lagrange_integrals(nodes, at)
    for degree in range(7):
        exact = (at ** (degree + 1) - (-1) ** (degree + 1)) / (degree + 1)
        np.testing.assert_allclose(rows @ nodes**degree, exact, atol=1e-14)


@pytest.mark.parametrize("stages", [1, 2, 3, 5, 8])
def test_nodes_weights_and_order(stages):
    import casadi as ca

    method = gauss_method(stages)
    np.testing.assert_allclose(method.nodes, ca.collocation_points(stages, "legendre"), rtol=0, atol=1e-15)
    for degree in range(2 * stages):  # the order of the quadrature
        assert method.weights @ method.nodes**degree == pytest.approx(1.0 / (degree + 1), rel=1e-13)
    for degree in range(stages):
        exact = method.nodes ** (degree + 1) / (degree + 1)
        np.testing.assert_allclose(method.A @ method.nodes**degree, exact, rtol=0, atol=1e-14)
        onward = method.onward @ method.nodes**degree
        np.testing.assert_allclose(onward, (method.nodes + 1.0) ** degree, rtol=1e-9)
