"""Exact steps: inputs that run straight between samples, and plants whose held control changes late."""

import math

import numpy as np
import pytest
from hypothesis import given
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from boomctl.lti.hold import linear_hold_response, matrix_expm1
from boomctl.lti.sampled import sampled_plant
from boomctl.lti.system import Lti
from tests.profiles import examples
from tests.strategies import seeds

DT, COUNT = 0.2, 12


def random_system(rng, n=4, m=2, p=3):
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(n)
    return Lti(A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m)))


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


@pytest.mark.parametrize("seed", [2, 3])
def test_motion_of_dense_matrix_with_equal_poles(seed):
    """Powers of the matrix itself cancel: they leave errors of 1e-3 and more."""
    rng = np.random.default_rng(seed)
    Q, rates = np.linalg.qr(rng.standard_normal((9, 9)))[0], 10.0 ** rng.uniform(-0.3, 0.3, 9)
    A, B, C = np.triu(15.0 * rng.standard_normal((9, 9)), 1) - np.diag(rates), np.ones((9, 1)), np.ones((1, 9))
    u, zero = rng.standard_normal((1, 100)), np.zeros((1, 1))
    triangular, dense = (Lti(T @ A @ T.T, T @ B, C @ T.T, zero) for T in (np.eye(9), Q))
    expected, found = (linear_hold_response(system, u, 0.3, np.zeros(9)) for system in (triangular, dense))
    assert found == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("n", [1, 4, 40, 90])
@pytest.mark.parametrize("pole", [0.0, -0.01, -3.0])
def test_matrix_expm1_chain_matches_closed_form(n, pole):
    """Every entry to rounding, also where paths are longer than the degree of the polynomial, in any units."""
    scale = np.exp2(np.random.default_rng(n).integers(-60, 60, n))
    A = (pole * np.eye(n) + np.eye(n, k=1)) * scale[:, None] / scale
    exact = sum(np.exp(pole) / math.factorial(k) * np.eye(n, k=k) for k in range(1, n)) + np.expm1(pole) * np.eye(n)
    np.testing.assert_allclose(matrix_expm1(A), exact * scale[:, None] / scale, rtol=1e-13)


def moved(plant, x, inputs, duration):
    """Return the state after inputs that stand still."""
    n, m = plant.B.shape
    step = expm(duration * np.block([[plant.A, plant.B], [np.zeros((m, n + m))]]))
    return step[:n, :n] @ x + step[:n, n:] @ inputs


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0, 1.7, 2.0])
@pytest.mark.parametrize("direct", [False, True])
@given(seed=seeds)
@examples(20)
def test_sampled_plant_moves_as_the_plant_between_changes(direct, share, seed):
    """A control that is late, and a disturbance that changes with the samples; outputs just before the control does."""
    rng, n, late = np.random.default_rng(seed), 3, share * DT
    A, B, C, D = (rng.standard_normal(size) for size in ((n, n), (n, 2), (1, n), (1, 2)))
    plant = Lti(A, B, C, direct * D, ("u", "w"), ("y",), ("a", "b", "c"))
    found, (u, w) = sampled_plant(plant, [0], DT, [late]), rng.standard_normal((2, COUNT))

    def acting(time):
        """Return the control just before a time."""
        last = math.ceil((time - late) / DT - 1e-9) - 1
        return u[last] if last >= 0 else 0.0

    x, own = np.zeros(n), np.zeros(len(found.A))
    for k in range(COUNT):
        start, change = k * DT, k * DT + late - DT * int(share)
        inputs = np.array([u[k], w[k]])
        expected = plant.C @ x + plant.D @ [acting(start), w[k]]
        assert found.C @ own + found.D @ inputs == pytest.approx(expected, rel=1e-9, abs=1e-9)
        own = found.A @ own + found.B @ inputs
        x = moved(plant, x, np.array([acting(change), w[k]]), change - start)
        x = moved(plant, x, np.array([acting(start + DT), w[k]]), start + DT - change)
