"""Riccati equations: states that cost nothing, unstable ones that must move, meshes on which the peers fail."""

import control
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from scipy import linalg

import boomctl as bc
from boomctl.synthesis.lq.riccati import RiccatiProblem, solution_of
from tests.profiles import examples
from tests.strategies import seeds
from tests.synthesis.test_lqr import random_system

SUSPENSIONS = ("suspension_left", "suspension_right")


def boom_problem(elements, effort=1e-6):
    system = bc.spray_boom(elements=elements).to_statespace(inputs=SUSPENSIONS, outputs=("tip_left", "tip_right"))
    Q = system.C.T @ system.C
    return RiccatiProblem(system.A, system.B, Q, effort * np.eye(2), np.zeros_like(system.B))


def relative_residual(problem, X):
    half, side = problem.A.T @ X, X @ problem.B
    drop = side @ np.linalg.solve(problem.R, side.T)
    size = max(np.linalg.norm(half), np.linalg.norm(drop), np.linalg.norm(problem.Q))
    return np.linalg.norm(half + half.T + problem.Q - drop) / size


@pytest.mark.slow
def test_a_fine_mesh_is_solved_where_scipy_is_not():
    problem = boom_problem(50)
    found = solution_of(problem)
    peer = linalg.solve_continuous_are(problem.A, problem.B, problem.Q, problem.R)
    assert relative_residual(problem, found.X) < 1e-8
    assert relative_residual(problem, found.X) < 1e-4 * relative_residual(problem, peer)
    assert found.cost_error < 1e-6
    assert np.linalg.eigvalsh(found.X).min() > -1e-12 * np.abs(found.X).max()


def test_the_solution_is_right_to_many_digits():
    problem = boom_problem(4)
    found = solution_of(problem)
    with mp.workdps(40):
        A, X, Q = (mp.matrix(m.tolist()) for m in (problem.A, found.X, problem.Q))
        side = X * mp.matrix(problem.B.tolist())
        residual = A.T * X + X * A + Q - side * side.T / mp.mpf(problem.R[0, 0])
        exact = np.array(residual.tolist(), dtype=float)
    closed = problem.A - problem.B @ found.gain
    step = linalg.solve_continuous_lyapunov(closed.T, -exact)
    size = np.sqrt(np.diag(found.X))
    assert np.abs(step / np.outer(size, size)).max() < 1e-9
    assert found.cost_error < 1e-9
    if np.finfo(np.longdouble).nmant > 60:
        assert problem.residual(found.X, found.gain)[0] == pytest.approx(exact, abs=1e-9 * np.abs(exact).max() + 1e-16)


def test_states_without_a_way_to_the_weight_cost_exactly_nothing():
    model = bc.spray_boom(elements=6, accelerometer_bandwidth_hz=50.0)
    weight = {"tip_left": 1.0, "tip_right": 1.0}
    design = bc.lqr(model, None, 1e-6, output_weight=weight, controls=SUSPENSIONS)
    bare = bc.lqr(bc.spray_boom(elements=6), None, 1e-6, output_weight=weight, controls=SUSPENSIONS)
    assert not design.gain[:, -4:].any()
    assert not design.riccati_solution[-4:].any()
    assert design.gain[:, :-4] == pytest.approx(bare.gain, rel=1e-6, abs=1e-9 * np.abs(bare.gain).max())
    assert len(design.poles) == len(bare.poles) + 4


@pytest.mark.parametrize("dt", [0.0, 0.1])
@given(seed=seeds)
@examples(40)
def test_zero_cost_control(dt, seed):
    rng, system = np.random.default_rng(seed), random_system(seed, unstable=False)
    stable, F, R = linalg.expm(dt * system.A) if dt else system.A, rng.standard_normal((2, 5)), np.diag([2.0, 0.3])
    plant = control.ss(stable + system.B @ F, system.B, system.C, 0.0, dt)
    design = bc.lqr(plant, F.T @ R @ F, R, N=F.T @ R)
    assert not design.riccati_solution.any()
    assert design.gain == pytest.approx(F, rel=1e-9, abs=1e-12)


@given(seeds)
@examples(40)
def test_with_no_weight_unstable_poles_are_mirrored(seed):
    system = random_system(seed)
    found = solution_of(RiccatiProblem(system.A, system.B, np.zeros((5, 5)), np.eye(2), np.zeros((5, 2))))
    poles = np.linalg.eigvals(system.A)
    expected = np.where(poles.real > 0.0, -poles.conj(), poles)
    assert np.poly(found.poles).real == pytest.approx(np.poly(expected).real, rel=1e-5, abs=1e-5)


def test_the_solution_says_which_way_was_taken():
    one = np.eye(1)
    mode = RiccatiProblem(np.array([[0.0, 1.0], [-4.0, -0.1]]), np.eye(2)[:, 1:], np.eye(2), one, np.zeros((2, 1)))
    chain = RiccatiProblem(np.array([[0.0, 1.0], [0.0, 0.0]]), np.eye(2)[:, 1:], np.eye(2), one, np.zeros((2, 1)))
    assert solution_of(mode).stages == ("modal coordinates: SLICOT SB02MD",)
    assert solution_of(chain).stages == ("modal coordinates: none", "scaled coordinates: SLICOT SB02MD")
