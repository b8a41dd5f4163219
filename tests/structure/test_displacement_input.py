"""Displacement inputs equal the Lagrange-multiplier solution at all frequencies, and the prescribed motion in time."""

import numpy as np
import pytest
from hypothesis import given

from boomctl.structure import SecondOrderModel, prescribe_displacement
from tests.references import integrated, kkt_response, motions, prescribed_motion, state_space_response
from tests.strategies import seeds, structures

OMEGA = np.array([0.3, 1.1, 1.9, 2.7, 6.0])
S = 1j * OMEGA

# The strategy bounds the condition of M^-1/2 D M^-1/2, which the rounding of a solution grows with, by about 60
# (natural frequencies 1 to 3, a tenth of critical damping, frequencies up to twice the highest).  Rounding errors of
# some thirty sums add up like a random walk, so that 1e-14, 45 units in the last place, leaves a factor of about six.


def tolerance(driven, J):
    """Return 1e-14 cond(M_qq) cond(J_sr), of the coordinates that the driven model has left."""
    return 1e-14 * np.linalg.cond(driven.M) * np.linalg.cond(dependent_rows(driven, J))


def dependent_rows(driven, J):
    """Return J_sr, the rows of J that belong to the coordinates that are gone."""
    return J[[i for i in range(len(J)) if f"q{i}" not in driven.coordinates]]


def distance(Y, truth):
    """Return the largest difference, relative to the largest entry of each output's row at each frequency."""
    return (np.abs(Y - truth) / np.abs(truth).max(axis=1, keepdims=True)).max()


@given(structures(inputs=3))
def test_displacement_driven_model_is_the_multiplier_solution(structure):
    driven = prescribe_displacement(structure.model, ["f0", "f1"])
    truth, _ = kkt_response((structure.M, structure.C, structure.K), structure.B, structure.L, [0, 1], [2], OMEGA)
    for response in (driven.frequency_response(OMEGA).frdata, state_space_response(driven.to_statespace(), OMEGA)):
        assert distance(response, truth) < tolerance(driven, structure.B[:, :2])


@given(structures(inputs=3))
def test_reactions_are_the_multipliers(structure):
    """Held points push as well.  Forces meet the inverse of J_sr twice: once in the motion, once as its dual."""
    driven = prescribe_displacement(structure.model, ["f0"], hold=["f1"], reactions=True)
    _, forces = kkt_response((structure.M, structure.C, structure.K), structure.B, structure.L, [0, 1], [2], OMEGA)
    assert driven.output_labels == ("y0", "y1", "f0_force", "f1_force")
    found = driven.frequency_response(OMEGA, outputs=["f0_force", "f1_force"]).frdata
    J = structure.B[:, :2]
    slack = tolerance(driven, J) * np.linalg.cond(dependent_rows(driven, J))
    assert distance(found, forces[:, [0, 2]]) < slack


@pytest.mark.parametrize("reactions", [False, True])
@given(structure=structures(inputs=3))
def test_held_first_and_moved_then_equals_both_at_once(structure, reactions):
    """The reaction of what is held reads the forces that the second step recovers."""
    once = prescribe_displacement(structure.model, "f0", hold="f1", reactions=reactions)
    first = prescribe_displacement(structure.model, hold="f1", reactions=reactions)
    twice = prescribe_displacement(first, "f0", reactions=reactions)
    slack = tolerance(once, structure.B[:, :2]) + tolerance(twice, structure.B[:, :2])
    assert twice.input_labels == once.input_labels
    found, truth = (m.frequency_response(OMEGA, outputs=once.output_labels).frdata for m in (twice, once))
    assert distance(found, truth) < slack


@pytest.mark.parametrize(
    ("motion", "orders"),
    [("velocity", (1, 1)), ("acceleration", (2, 2)), ({"f0": "acceleration", "f1": "displacement"}, (2, 0))],
)
@given(structure=structures(inputs=3))
def test_imposed_rates_are_displacement_over_powers_of_s(structure, motion, orders):
    """Of both points or of each its own, and a force beside them."""
    moved, truth = (prescribe_displacement(structure.model, ["f0", "f1"], motion=m) for m in (motion, "displacement"))
    expected = truth.frequency_response(OMEGA).frdata / np.array([S ** orders[0], S ** orders[1], np.ones(5)])
    assert distance(moved.frequency_response(OMEGA).frdata, expected) < 4e-15
    realized = state_space_response(moved.to_statespace(), OMEGA)
    assert distance(realized, expected) < tolerance(moved, structure.B[:, :2])


def test_no_displacement_at_all_leaves_the_model_as_it_is():
    model = SecondOrderModel(np.eye(2), np.eye(2), np.eye(2), {"f": [1, 0]}, {"y": [0, 1]})
    assert prescribe_displacement(model) is model


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
    worth = np.linalg.cond(driven.M) * max(1.0, np.abs(x0).max(), np.abs(z).max())
    assert np.abs(y - structure.L @ z).max() < 1e-13 * worth * np.abs(structure.L).sum(axis=1).max()
