"""Displacement inputs equal the Lagrange-multiplier solution, whatever drives, is read or is held."""

import numpy as np
import pytest
from hypothesis import given

from boomctl.structure import SecondOrderModel, prescribe_displacement
from tests.references import dense, kkt_response, state_space_response
from tests.strategies import structures

OMEGA = np.array([0.3, 1.1, 1.9, 2.7, 6.0])
S = 1j * OMEGA

# The strategy bounds the condition of M^-1/2 D M^-1/2, which the rounding of a solution grows with, by about 60
# (natural frequencies 1 to 3, a tenth of critical damping, frequencies up to twice the highest).  Rounding errors of
# some thirty sums add up like a random walk, so that 1e-14, 45 units in the last place, leaves a factor of about six.


def tolerance(driven, J):
    """Return 1e-14 cond(M_qq) cond(J_sr), of the coordinates that the driven model has left."""
    return 1e-14 * np.linalg.cond(dense(driven.M)) * np.linalg.cond(dependent_rows(driven, J))


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
