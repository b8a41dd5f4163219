"""CasADi functions in memory shared with NumPy: what they return is what a plain call returns."""

import casadi as ca
import numpy as np
import pytest

from boomctl.simulation.machine.run import BLOCK, at_columns


@pytest.mark.parametrize("count", [1, BLOCK + 1])
def test_at_columns_sparse_function_equals_plain_call(count):
    x, sparse = ca.SX.sym("x", 3), ca.SX(4, 1)
    sparse[0], sparse[2] = x[0] * x[1], ca.sin(x[2])
    function = ca.Function("some", [x], [ca.sumsqr(x), sparse])
    given = np.random.default_rng(count).normal(size=(3, count))
    for found, wanted in zip(at_columns(function, given), function(given), strict=True):
        np.testing.assert_array_equal(found, np.array(ca.densify(wanted)))
