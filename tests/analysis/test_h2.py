"""H2 norms: closed forms, invariance, and what makes one infinite."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.analysis import h2_norm
from boomctl.structure import SecondOrderModel
from tests.analysis.loop_cases import chain
from tests.profiles import examples


@given(st.floats(1e-6, 0.9), st.floats(0.1, 100.0))
def test_of_an_oscillator_is_its_closed_form(zeta, omega):
    model = SecondOrderModel([[1.0]], [[2 * zeta * omega]], [[omega**2]], {"f": [1.0]}, {"y": [1.0]})
    found = h2_norm(model)
    assert found.certified
    assert found.value == pytest.approx(1.0 / np.sqrt(4.0 * zeta * omega**3), rel=1e-8)
    assert found.lower <= found.value <= found.upper


@given(st.integers(0, 1000))
@examples(25)
def test_does_not_depend_on_coordinates_and_order_and_follows_units(seed):
    rng = np.random.default_rng(seed)
    system = chain(seed, damping=1e-3).to_statespace()
    n, value = system.nstates, h2_norm(system).value
    T = rng.standard_normal((n, n)) + 3.0 * np.eye(n)
    similar = control.ss(T @ system.A @ np.linalg.inv(T), T @ system.B, system.C @ np.linalg.inv(T), 0.0)
    assert h2_norm(similar).value == pytest.approx(value, rel=1e-5)
    order = rng.permutation(3)
    shuffled = control.ss(system.A, 10.0 * system.B[:, order], system.C[order], 0.0)
    assert h2_norm(shuffled).value == pytest.approx(10.0 * value, rel=1e-8)
    assert h2_norm(chain(seed, damping=1e-3)).value == pytest.approx(value, rel=1e-8)
    columns = [h2_norm(system[:, i]).value for i in range(3)]
    assert np.linalg.norm(columns) == pytest.approx(value, rel=1e-8)


def test_is_infinite_for_reasons_it_names():
    through = control.ss([[-1.0]], [[1.0]], [[1.0]], [[2.0]], inputs=["f"], outputs=["y"])
    assert h2_norm(through).value == np.inf
    assert "feedthrough to 'y' from 'f'" in h2_norm(through).method
    assert "unstable pole at 1" in h2_norm(control.ss([[1.0]], [[1.0]], [[1.0]], 0.0)).method
    undamped = SecondOrderModel([[1.0]], [[0.0]], [[4.0]], {"f": [1.0]}, {"y": [1.0]})
    assert "axis at 0+2j rad/s" in h2_norm(undamped).method
    assert "unstable pole at 2" in h2_norm(control.ss(2.0, 1.0, 1.0, 1.0)).method  # before its feedthrough
