"""Displacement inputs in time: matrix exponentials of the state space and of the prescribed motion agree."""

import numpy as np
import pytest
from hypothesis import given

from boomctl.structure import prescribe_displacement
from tests.references import dense, integrated, motions, prescribed_motion
from tests.strategies import seeds, structures

TIMES = np.array([0.2, 0.7, 1.6])


def driven_states(system, S, R, x0, w0):
    """Return the states and the outputs of a state space whose input is ``R w``, ``w' = S w``."""
    A, B, C, D = (np.asarray(x) for x in (system.A, system.B, system.C, system.D))
    full = np.block([[A, B @ R], [np.zeros((len(S), len(A))), S]])
    x = integrated(full, np.concatenate([x0, w0]), TIMES)
    return x[: len(A)], C @ x[: len(A)] + D @ R @ x[len(A) :]


def start(structure, driven, J, S, R, w0, z, rate):
    """Return ``x1, x2`` of Eqs. (9) and (10) that belong to coordinates and rates; ``d'`` enters where it is known."""
    s = [int(name[1:]) for name in driven.coordinates]
    r = [i for i in range(len(J)) if i not in s]
    T_q, T_d = np.zeros((len(J), len(s))), np.zeros((len(J), len(r)))
    T_q[s], T_d[r] = np.eye(len(s)), np.linalg.inv(J[r].T)
    T_q[r] = -np.linalg.solve(J[r].T, J[s].T)
    M_qq, C_qq = (T_q.T @ X @ T_q for X in (structure.M, structure.C))
    G = np.linalg.solve(M_qq, T_q.T @ structure.M @ T_d)
    A_c = np.linalg.solve(M_qq, T_q.T @ structure.C @ T_d - C_qq @ G)
    d, speed = R @ w0, R @ S @ w0
    order = driven.ports.integrators[0]
    if order == 0:
        return np.concatenate([z[s] + G @ d, rate[s] + G @ speed + A_c @ d])
    if order == 1:
        return np.concatenate([z[s], rate[s] + G @ speed, d])
    return np.concatenate([z[s], rate[s], np.ravel([d, speed], order="F")])


@pytest.mark.parametrize(("motion", "order"), [("displacement", 0), ("velocity", 1), ("acceleration", 2)])
@given(structure=structures(inputs=2), seed=seeds)
def test_polynomial_and_sine_motions_are_followed(structure, seed, motion, order):
    """Every input a cubic polynomial plus a sine, from any state: exponentials of matrices of norm 50 lose some 100 eps."""
    rng = np.random.default_rng(seed)
    S, R, w0 = motions(rng, 2, rng.uniform(0.5, 5.0))
    k = len(structure.M) - 2
    matrices, v0 = (structure.M, structure.C, structure.K), rng.standard_normal((2, k))
    z, _ = prescribed_motion(matrices, structure.B, S, R, w0, v0, TIMES)
    z0, rate0 = prescribed_motion(matrices, structure.B, S, R, w0, v0, [0.0])
    driven = prescribe_displacement(structure.model, ["f0", "f1"], motion=motion)
    x0 = start(structure, driven, structure.B, S, R, w0, z0[:, 0], rate0[:, 0])
    given_motion = R @ np.linalg.matrix_power(S, order)
    _, y = driven_states(driven.to_statespace(), S, given_motion, x0, w0)
    worth = np.linalg.cond(dense(driven.M)) * max(1.0, np.abs(x0).max(), np.abs(z).max())
    assert np.abs(y - structure.L @ z).max() < 1e-13 * worth * np.abs(structure.L).sum(axis=1).max()
