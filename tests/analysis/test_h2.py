"""H2 norms: a closed form, and what makes one infinite."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.analysis import h2_norm
from boomctl.structure import SecondOrderModel


@given(st.floats(1e-6, 0.9), st.floats(0.1, 100.0))
def test_of_an_oscillator_is_its_closed_form(zeta, omega):
    model = SecondOrderModel([[1.0]], [[2 * zeta * omega]], [[omega**2]], {"f": [1.0]}, {"y": [1.0]})
    found = h2_norm(model)
    assert found.certified
    assert found.value == pytest.approx(1.0 / np.sqrt(4.0 * zeta * omega**3), rel=1e-8)
    assert found.lower_bound <= found.value <= found.upper_bound


def test_is_infinite_for_reasons_it_names():
    through = control.ss([[-1.0]], [[1.0]], [[1.0]], [[2.0]], inputs=["f"], outputs=["y"])
    assert h2_norm(through).value == np.inf
    assert "feedthrough to 'y' from 'f'" in h2_norm(through).method
    assert "unstable pole at 1" in h2_norm(control.ss([[1.0]], [[1.0]], [[1.0]], 0.0)).method
    undamped = SecondOrderModel([[1.0]], [[0.0]], [[4.0]], {"f": [1.0]}, {"y": [1.0]})
    assert "axis at 0+2j rad/s" in h2_norm(undamped).method
    assert "unstable pole at 2" in h2_norm(control.ss(2.0, 1.0, 1.0, 1.0)).method  # before its feedthrough
