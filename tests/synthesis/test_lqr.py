"""Regulators: closed forms, invariance, Kalman's inequality, cross weights."""

import control
import numpy as np
import pytest
from hypothesis import given
from scipy import linalg

import boomctl as bc
from tests.profiles import examples
from tests.strategies import seeds
from tests.synthesis.riccati_cases import CASES


def random_system(seed, n=5, m=2, p=2, unstable=True, dt=0.0):
    """Return a system that is often unstable; ``dt``: of discrete time."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    if not unstable:
        A = A - (np.linalg.eigvals(A).real.max() + 0.2) * np.eye(n)
    if dt:
        A = A * rng.uniform(0.3, 1.2) / np.abs(np.linalg.eigvals(A)).max()
    kinds = (("inputs", "u", m), ("outputs", "y", p), ("states", "x", n))
    names = {kind: [f"{letter}{i}" for i in range(count)] for kind, letter, count in kinds}
    return control.ss(A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), np.zeros((p, m)), dt, **names)


def random_weight(seed, n, least=0.1):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    return root @ root.T + least * np.eye(n)


def variance(A, noise, dt):
    """Return the covariance of the states that white noise drives; None if they are not stable."""
    poles = np.linalg.eigvals(A)
    if dt:
        return linalg.solve_discrete_lyapunov(A, noise) if np.abs(poles).max() < 1.0 else None
    return linalg.solve_continuous_lyapunov(A, -noise) if poles.real.max() < 0.0 else None


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_solutions_in_closed_form(case):
    """Of regulators, and of their duals."""
    n, gain, size = len(case.A), np.linalg.solve(case.R, case.B.T @ case.X), np.sqrt(np.diag(case.X))
    design = bc.lqr(control.ss(case.A, case.B, np.eye(n), 0.0), case.Q, case.R)
    dual = bc.kalman(control.ss(case.A.T, np.eye(n), case.B.T, 0.0), case.Q, case.R)
    for F, X in ((design.gain, design.riccati_solution), (dual.gain.T, dual.covariance)):
        assert np.abs((X - case.X) / np.outer(size, size)).max() < 1e-11
        assert pytest.approx(gain, rel=1e-9, abs=1e-11 * np.abs(gain).max()) == F
    assert design.certificate.regulator_riccati.residual < 1e-11
    assert design.poles.real.max() < 0.0


@pytest.mark.parametrize("epsilon", [1.0, 1e-3, 1e-5])
def test_poles_come_near_the_axis_and_the_solution_stays_exact(epsilon):
    # CAREX 2.8: two modes, one damped, one driven, by epsilon
    block = np.array([[-epsilon, 1.0], [-1.0, -epsilon]])
    A = linalg.block_diag(block, -block.T)
    design = bc.lqr(control.ss(A, np.ones((4, 1)), np.eye(4), 0), np.ones((4, 4)), 1.0)
    X = design.riccati_solution
    assert np.linalg.eigvalsh(X).min() > 0.0
    assert np.abs(A.T @ X + X @ A - X @ np.ones((4, 4)) @ X + np.ones((4, 4))).max() < 1e-13 * np.abs(X).max() ** 2
    assert design.poles.real.max() == pytest.approx(-0.5 * epsilon**2, rel=0.1) or epsilon == 1.0
    error = design.certificate.regulator_riccati.cost_error
    assert error < 1e-14 / epsilon**2  # rounding over the distance from the axis


@given(seeds)
@examples(40)
def test_the_gain_follows_units_order_and_coordinates(seed):
    rng = np.random.default_rng(seed)
    system, Q, R = random_system(seed), random_weight(seed, 5), random_weight(seed + 1, 2)
    design = bc.lqr(system, Q, R)
    units = np.diag(10.0 ** rng.uniform(-8, 8, 5))
    order = np.eye(5)[rng.permutation(5)]
    turn = np.linalg.qr(rng.standard_normal((5, 5)))[0]
    effort = np.diag(10.0 ** rng.uniform(-3, 3, 2))
    for T in (units, order, turn):
        inverse = np.linalg.inv(T)
        same = control.ss(inverse @ system.A @ T, inverse @ system.B @ effort, system.C @ T, system.D)
        other = bc.lqr(same, _even(T.T @ Q @ T), _even(effort @ R @ effort))
        assert effort @ other.gain @ inverse == pytest.approx(design.gain, rel=1e-6, abs=1e-7 * abs(design.gain).max())
        assert sorted(other.poles.real) == pytest.approx(sorted(design.poles.real), rel=1e-6)
        size = np.sqrt(np.diag(other.riccati_solution))
        assert np.abs((other.riccati_solution - T.T @ design.riccati_solution @ T) / np.outer(size, size)).max() < 1e-6


@given(seeds)
@examples(40)
def test_kalmans_inequality_and_no_other_gain_costs_less(seed):
    system, Q, R = random_system(seed), random_weight(seed, 5), random_weight(seed + 1, 2)
    design = bc.lqr(system, Q, R)
    assert design.certificate.min_return_difference == pytest.approx(1.0, abs=1e-8)
    assert design.control_loop.output_labels == ["u0", "u1"]
    assert design.certificate.optimality_gap == np.inf  # of a norm without a lower bound
    L = linalg.cholesky(R)
    for w in np.geomspace(1e-2, 1e2, 30):
        loop = design.gain @ np.linalg.solve(1j * w * np.eye(5) - system.A, system.B)
        difference = L @ (np.eye(2) + loop) @ np.linalg.inv(L)
        assert np.linalg.svd(difference, compute_uv=False)[-1] >= 1.0 - 1e-9
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(5)
    for size in (0.0, 1e-3, 1e-1):
        gain = design.gain + size * rng.standard_normal(design.gain.shape)
        run = variance((system.A - system.B @ gain).T, Q + gain.T @ R @ gain, 0.0)
        if size == 0.0:
            assert x @ run @ x == pytest.approx(x @ design.riccati_solution @ x, rel=1e-7)
        elif run is not None:
            assert np.linalg.eigvalsh(run - design.riccati_solution).min() > -1e-9 * np.abs(run).max()
            assert np.trace(run) > np.trace(design.riccati_solution)


@given(seeds)
@examples(40)
def test_lqr_cross_weight_is_change_of_controls(seed):
    rng = np.random.default_rng(seed)
    system, R, Q = random_system(seed), random_weight(seed, 2), random_weight(seed + 1, 5)
    F, D = rng.standard_normal((2, 5)), rng.standard_normal((2, 2))
    plain = bc.lqr(control.ss(system.A - system.B @ F, system.B, system.C, system.D), Q, R)
    crossed = bc.lqr(system, _even(Q + F.T @ R @ F), R, N=F.T @ R)
    size = 1e-8 * abs(plain.riccati_solution).max()
    assert crossed.riccati_solution == pytest.approx(plain.riccati_solution, rel=1e-6, abs=size)
    assert crossed.gain == pytest.approx(plain.gain + F, rel=1e-6, abs=1e-7)
    W, C = np.diag([2.0, 0.5]), system.C
    fed = control.ss(system.A, system.B, C, D, inputs=["u0", "u1"], outputs=["y0", "y1"])
    design = bc.lqr(fed, None, 1.0, output_weight={"y0": 2.0, "y1": 0.5})
    same = bc.lqr(system, _even(C.T @ W @ C), _even(np.eye(2) + D.T @ W @ D), N=C.T @ W @ D)
    assert design.gain == pytest.approx(same.gain, rel=1e-6, abs=1e-8)


def _even(matrix):
    return 0.5 * (matrix + matrix.T)
