"""Responses to inputs that run straight between samples: exact solutions, halved steps, shapes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from boomctl.lti.hold import linear_hold_response, matrix_expm1, recursion
from boomctl.lti.system import Lti
from tests.profiles import examples
from tests.strategies import seeds


def random_system(rng, n=4, m=2, p=3):
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(n)
    return Lti(A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m)))


@given(seeds, st.integers(1, 60))
@examples(20)
def test_runs_side_by_side_are_the_recursion(seed, count):
    rng = np.random.default_rng(seed)
    Phi, f, x = 0.5 * rng.standard_normal((3, 3)), rng.standard_normal((3, count)), rng.standard_normal(3)
    found = recursion(Phi, f, x.copy())
    for k in range(count + 1):
        assert found[:, k] == pytest.approx(x, rel=1e-9, abs=1e-9 * np.abs(found).max())
        if k < count:
            x = Phi @ x + f[:, k]


@given(seeds)
@examples(5)
def test_the_response_solves_the_differential_equation(seed):
    rng = np.random.default_rng(seed)
    system, h = random_system(rng), 0.2
    u, x0, t = rng.standard_normal((2, 9)), rng.standard_normal(4), 0.2 * np.arange(9)
    found = linear_hold_response(system, u, h, x0)

    def rate(time, x):
        return system.A @ x + system.B @ [np.interp(time, t, line) for line in u]

    x = solve_ivp(rate, (0, t[-1]), x0, t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.02).y
    assert found == pytest.approx(system.C @ x + system.D @ u, abs=1e-6)


@given(seeds)
@examples(20)
def test_samples_put_on_the_straight_lines_change_nothing(seed):
    rng = np.random.default_rng(seed)
    system, u = random_system(rng), rng.standard_normal((2, 40))
    fine = np.array([np.interp(np.arange(0, 39.2, 0.2), np.arange(40), line) for line in u])
    found, finer = (linear_hold_response(system, w, h, np.zeros(4)) for w, h in ((u, 0.1), (fine, 0.02)))
    assert finer[:, ::5] == pytest.approx(found, abs=1e-10 * np.abs(found).max())


@pytest.mark.parametrize("n", [1, 4, 40, 90])
@pytest.mark.parametrize("pole", [0.0, -0.01, -3.0])
def test_matrix_expm1_chain_matches_closed_form(n, pole):
    """Every entry to rounding, also where paths are longer than the degree of the polynomial, in any units."""
    scale = np.exp2(np.random.default_rng(n).integers(-60, 60, n))
    A = (pole * np.eye(n) + np.eye(n, k=1)) * scale[:, None] / scale
    exact = sum(np.exp(pole) / math.factorial(k) * np.eye(n, k=k) for k in range(1, n)) + np.expm1(pole) * np.eye(n)
    np.testing.assert_allclose(matrix_expm1(A), exact * scale[:, None] / scale, rtol=1e-13)
