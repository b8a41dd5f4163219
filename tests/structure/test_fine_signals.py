"""Fine meshes keep their digits for every signal, not only from actuators to tips."""

import numpy as np
import pytest

import boomctl as bc


@pytest.mark.slow
@pytest.mark.parametrize("excitation", ["displacement", "force"])
@pytest.mark.parametrize("elements", [100, 190])
def test_all_signals_of_fine_meshes_are_near_the_exact_beam(elements, excitation):
    p = bc.BoomParameters()
    omega = 2.0 * np.pi * np.geomspace(0.1, 10.0, 20)
    exact = np.asarray(bc.exact_frequency_response(p, omega, excitation=excitation).frdata)
    model = bc.spray_boom(p, elements=elements, excitation=excitation)
    ours = np.asarray(model.frequency_response(omega).frdata)
    assert (np.abs(ours - exact) <= 1e-6 * np.abs(exact).max(axis=1, keepdims=True)).all()
