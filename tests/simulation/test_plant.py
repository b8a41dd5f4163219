"""Exact motion over a step: against matrix exponentials, for every kind of pole."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from boomctl.simulation.plant import modal_plant
from tests.profiles import examples
from tests.simulation.cases import random_plant
from tests.strategies import seeds

pytestmark = pytest.mark.filterwarnings("ignore:.*scipy:DeprecationWarning")


def _whole(plant, h):
    """Return the maps over a step in the plant's own coordinates, from one exponential."""
    n, m = plant.nstates, plant.ninputs
    big = np.zeros((n + 2 * m, n + 2 * m))
    big[:n, :n], big[:n, n : n + m], big[n : n + m, n + m :] = plant.A, plant.B, np.eye(m)
    found = linalg.expm(big * h)
    ramp = found[:n, n + m :] / h
    return found[:n, :n], found[:n, n : n + m] - ramp, ramp, found[:n, n : n + m]


@pytest.mark.parametrize(
    "A",
    [
        [[0.0, 1.0], [0.0, 0.0]],
        [[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1.0]],
        [[0.0, 1.0, 0.0, 0.0], [-4.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -4.0, 0.0]],
        [[-1e5, 0.0], [0.0, -1e-3]],
        [[0.5, 2.0], [-2.0, 0.5]],
        [[0.0]],
    ],
)
def test_motion_of_defective_rigid_stiff_and_unstable_plants(A):
    rng = np.random.default_rng(3)
    n = len(A)
    plant = ct.ss(
        A, rng.standard_normal((n, 2)), rng.standard_normal((2, n)), 0.0, inputs=["a", "b"], outputs=["c", "d"]
    )
    modal, h = modal_plant(plant), 0.1
    step, (Phi, first, last, held) = modal.step(h), _whole(plant, h)
    T, back = modal.T, np.linalg.inv(modal.T)
    for ours, theirs in (
        (T @ step.Phi @ back, Phi),
        (T @ step.first, first),
        (T @ step.last, last),
        (T @ step.held, held),
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-10 * max(1.0, np.abs(theirs).max()))
    np.testing.assert_allclose(modal.C @ back, plant.C, atol=1e-9)


@given(seed=seeds, n=st.integers(1, 9), h=st.floats(1e-3, 1.0))
@examples(30)
def test_motion_of_random_plants(seed, n, h):
    plant = random_plant(np.random.default_rng(seed), n)
    modal = modal_plant(plant)
    step, (Phi, first, last, held) = modal.step(h), _whole(plant, h)
    back = np.linalg.inv(modal.T)
    scale = np.linalg.cond(modal.T)
    for ours, theirs in (
        (modal.T @ step.Phi @ back, Phi),
        (modal.T @ step.first, first),
        (modal.T @ step.last, last),
        (modal.T @ step.held, held),
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-12 * scale * max(1.0, np.abs(theirs).max()))


@given(seed=seeds, share=st.floats(0.05, 0.95))
@examples(20)
def test_a_step_with_a_switch_is_two_steps(seed, share):
    plant = modal_plant(random_plant(np.random.default_rng(seed), 4))
    h = 0.3
    whole, early, late = plant.step(h, share * h), plant.step(share * h), plant.step((1.0 - share) * h)
    np.testing.assert_allclose(whole.Phi, late.Phi @ early.Phi, atol=1e-12)
    np.testing.assert_allclose(whole.before, late.Phi @ early.held, atol=1e-12)
    np.testing.assert_allclose(whole.after, late.held, atol=1e-12)


def test_a_large_structure_keeps_its_response_where_its_modes_were_cut():
    model = bc.spray_boom(elements=60)
    modal = modal_plant(model)
    assert len(modal.A) == 120
    omega = 2.0 * np.pi * np.array([0.2, 1.0, 5.0, 20.0])
    resolvent = np.linalg.solve(1j * omega[:, None, None] * np.eye(len(modal.A)) - modal.A, modal.B.astype(complex))
    found = np.moveaxis(modal.C @ resolvent + modal.D, 0, 2)
    true = np.asarray(model.frequency_response(omega).frdata)
    np.testing.assert_allclose(found, true, atol=1e-6 * np.abs(true).max())


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        (3.0, "plant: expected"),
        (ct.ss([[0.5]], [[1.0]], [[1.0]], 0.0, 0.1), "continuous time"),
        (ct.ss([[np.nan]], [[1.0]], [[1.0]], 0.0), "expected finite numbers"),
    ],
)
def test_bad_plants(plant, message):
    with pytest.raises((TypeError, ValueError), match=message):
        modal_plant(plant)
