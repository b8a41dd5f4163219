"""Displacement inputs equal the Lagrange-multiplier solution, whatever drives, is read or is held."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from boomctl.structure import SecondOrderModel, prescribe_displacement
from tests.references import dense, kkt_response, state_space_response
from tests.strategies import random_machine, seeds, structures

OMEGA = np.array([0.3, 1.1, 1.9, 2.7, 6.0])
S = 1j * OMEGA

# The strategy bounds the condition of M^-1/2 D M^-1/2, which the rounding of a solution grows with, by about 60
# (natural frequencies 1 to 3, a tenth of critical damping, frequencies up to twice the highest).  Rounding errors of
# some thirty sums add up like a random walk, so that 1e-14, 45 units in the last place, leaves a factor of about six.


def tolerance(driven, J, coordinates=None):
    """Return 1e-14 cond(M_qq) cond(J_sr), of the coordinates that the driven model has left."""
    return 1e-14 * np.linalg.cond(dense(driven.M)) * np.linalg.cond(dependent_rows(driven, J, coordinates))


def dependent_rows(driven, J, coordinates=None):
    """Return J_sr, the rows of J that belong to the coordinates that are gone."""
    every = coordinates or tuple(f"q{i}" for i in range(len(J)))
    return J[[i for i, name in enumerate(every) if name not in driven.coordinates]]


def distance(Y, truth):
    """Return the largest difference, relative to the largest entry of each output's row at each frequency."""
    return (np.abs(Y - truth) / np.abs(truth).max(axis=1, keepdims=True)).max()


@given(structures(inputs=3))
def test_displacement_driven_response_is_the_multiplier_solution(structure):
    driven = prescribe_displacement(structure.model, ["f0", "f1"])
    truth, _ = kkt_response((structure.M, structure.C, structure.K), structure.B, structure.L, [0, 1], [2], OMEGA)
    assert distance(driven.frequency_response(OMEGA).frdata, truth) < tolerance(driven, structure.B[:, :2])


@given(structures(inputs=3))
def test_displacement_driven_state_space_is_the_multiplier_solution(structure):
    driven = prescribe_displacement(structure.model, ["f0", "f1"])
    truth, _ = kkt_response((structure.M, structure.C, structure.K), structure.B, structure.L, [0, 1], [2], OMEGA)
    response = state_space_response(driven.to_statespace(), OMEGA)
    assert distance(response, truth) < tolerance(driven, structure.B[:, :2])


@given(structures(inputs=3))
def test_reactions_are_the_multipliers(structure):
    """Held points push as well.  Forces meet the inverse of J_sr twice: once in the motion, once as its dual."""
    driven = prescribe_displacement(structure.model, ["f0"], hold=["f1"], reactions=True)
    _, forces = kkt_response((structure.M, structure.C, structure.K), structure.B, structure.L, [0, 1], [2], OMEGA)
    assert driven.outputs == ("y0", "y1", "f0_force", "f1_force")
    found = driven.frequency_response(OMEGA, outputs=["f0_force", "f1_force"]).frdata
    J = structure.B[:, :2]
    slack = tolerance(driven, J) * np.linalg.cond(dependent_rows(driven, J))
    assert distance(found, forces[:, [0, 2]]) < slack


@given(structures(inputs=3))
def test_reactions_fed_to_the_force_driven_model_move_the_points_as_prescribed(structure):
    """The error of forces is carried to motions by the points' receptance, so it is measured against their product."""
    driven = prescribe_displacement(structure.model, ["f0", "f1"], reactions=True)
    forces = driven.frequency_response(OMEGA, ["f0", "f1"], ["f0_force", "f1_force"]).frdata
    points = SecondOrderModel(
        structure.M,
        structure.C,
        structure.K,
        {"f0": structure.B[:, 0], "f1": structure.B[:, 1]},
        {"p0": structure.B[:, 0], "p1": structure.B[:, 1]},
    )
    receptance = points.frequency_response(OMEGA).frdata
    motion = np.einsum("oif,ijf->ojf", receptance, forces)
    size = np.einsum("oif,ijf->ojf", np.abs(receptance), np.abs(forces)).max()
    assert np.abs(motion - np.eye(2)[:, :, None]).max() < tolerance(driven, structure.B[:, :2]) * size


@given(structures(inputs=3))
def test_held_inputs_equal_prescribed_ones_that_stand_still(structure):
    held = prescribe_displacement(structure.model, ["f1"], hold="f0")
    moved = prescribe_displacement(structure.model, ["f1", "f0"])
    assert held.inputs == ("f1", "f2")
    assert moved.inputs == ("f0", "f1", "f2")
    both = [model.frequency_response(OMEGA, ["f1", "f2"]).frdata for model in (held, moved)]
    assert distance(*both) < tolerance(held, structure.B[:, :2])


@pytest.mark.parametrize("reactions", [False, True])
@given(structure=structures(inputs=3))
def test_held_first_and_moved_then_equals_both_at_once(structure, reactions):
    """The reaction of what is held reads the forces that the second step recovers."""
    once = prescribe_displacement(structure.model, "f0", hold="f1", reactions=reactions)
    first = prescribe_displacement(structure.model, hold="f1", reactions=reactions)
    twice = prescribe_displacement(first, "f0", reactions=reactions)
    slack = tolerance(once, structure.B[:, :2]) + tolerance(twice, structure.B[:, :2])
    assert twice.inputs == once.inputs
    found, truth = (m.frequency_response(OMEGA, outputs=once.outputs).frdata for m in (twice, once))
    assert distance(found, truth) < slack


@given(structures(inputs=3))
def test_motions_of_different_kinds_mix(structure):
    """One point's acceleration and another's displacement imposed on one model, and a force beside them."""
    mixed = prescribe_displacement(structure.model, ["f0", "f1"], motion={"f0": "acceleration", "f1": "displacement"})
    truth = prescribe_displacement(structure.model, ["f0", "f1"]).frequency_response(OMEGA).frdata
    expected = truth / np.array([S**2, np.ones(5), np.ones(5)])
    assert distance(mixed.frequency_response(OMEGA).frdata, expected) < 4e-15
    assert distance(state_space_response(mixed.to_statespace(), OMEGA), expected) < tolerance(mixed, structure.B[:, :2])


@pytest.mark.parametrize(("motion", "order"), [("velocity", 1), ("acceleration", 2)])
@given(structure=structures(inputs=3))
def test_velocity_and_acceleration_are_displacement_over_powers_of_s(structure, motion, order):
    moved, truth = (prescribe_displacement(structure.model, ["f0", "f1"], motion=m) for m in (motion, "displacement"))
    expected = truth.frequency_response(OMEGA).frdata / np.array([S**order, S**order, np.ones(5)])
    assert distance(moved.frequency_response(OMEGA).frdata, expected) < 4e-15
    realized = state_space_response(moved.to_statespace(), OMEGA)
    assert distance(realized, expected) < tolerance(moved, structure.B[:, :2])


@given(structures(inputs=3), seeds)
def test_an_output_of_a_prescribed_point_reads_the_input(structure, seed):
    """Whatever mixture of prescribed points an output reads, dependent and independent coordinates add up to it."""
    mixture = np.random.default_rng(seed).standard_normal(2)
    row = structure.B[:, :2] @ mixture
    forces = {f"f{i}": structure.B[:, i] for i in range(3)}
    model = SecondOrderModel(structure.M, structure.C, structure.K, forces, {"mixture": row})
    driven = prescribe_displacement(model, ["f0", "f1"])
    expected = np.append(mixture, 0.0)[:, None] * np.ones(5)
    slack = tolerance(driven, structure.B[:, :2]) * np.abs(row).max()
    assert np.abs(driven.frequency_response(OMEGA).frdata[0] - expected).max() < slack


@given(seeds, st.sampled_from([["p0"], ["pair"], ["p0", "pair"]]))
def test_machines_with_moved_points_obey_the_multipliers(seed, moved):
    """The length of an actuator between two bodies is a displacement input like any other."""
    model = random_machine(seed).assemble()
    i = [model.inputs.index(name) for name in moved]
    j = [k for k in range(len(model.inputs)) if k not in i]
    B, L = model.ports.B[0], model.ports.L[0]
    assume(np.linalg.cond(B[:, i]) < 100)
    driven = prescribe_displacement(model, moved)
    truth, _ = kkt_response((model.M, model.C, model.K), B, L, i, j, OMEGA)
    found = driven.frequency_response(OMEGA).frdata[:, i + j]
    slack = tolerance(driven, B[:, i], model.coordinates)
    for columns in (slice(0, len(i)), slice(len(i), None)):
        size = max(np.abs(truth[:, columns]).max(), 1e-2)  # of order one, unless a force meets nothing that gives way
        assert np.abs((found - truth)[:, columns]).max() < slack * size


def test_no_displacement_at_all_leaves_the_model_as_it_is():
    model = SecondOrderModel(np.eye(2), np.eye(2), np.eye(2), {"f": [1, 0]}, {"y": [0, 1]})
    assert prescribe_displacement(model) is model
