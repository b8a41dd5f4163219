"""Fine meshes converge to the exact beam for every signal, not only from actuators to tips."""

import numpy as np
import pytest

import boomctl as bc


@pytest.mark.slow
@pytest.mark.parametrize("excitation", ["displacement", "force"])
def test_all_signals_of_meshes_converge_with_fourth_order(excitation):
    p = bc.BoomParameters(spring_distance=3.0)  # springs at nodes
    omega = 2.0 * np.pi * np.geomspace(0.1, 10.0, 20)
    exact = np.asarray(bc.exact_frequency_response(p, omega, excitation=excitation).frdata)
    errors = []
    for elements in (48, 96, 192):
        found = np.asarray(bc.spray_boom(p, elements=elements, excitation=excitation).frequency_response(omega).frdata)
        errors.append((np.abs(found - exact) / np.abs(exact).max(axis=1, keepdims=True)).max())
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([4.0, 4.0], abs=0.3)
    assert errors[-1] < 1e-6
