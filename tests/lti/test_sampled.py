"""Sampled plants move as the plant does whose held control changes late, followed from change to change."""

from math import ceil

import numpy as np
import pytest
from hypothesis import given
from scipy.linalg import expm

from boomctl.lti.sampled import sampled_plant
from boomctl.lti.system import Lti
from tests.profiles import examples
from tests.strategies import seeds

DT, COUNT = 0.2, 12


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
        last = ceil((time - late) / DT - 1e-9) - 1
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
