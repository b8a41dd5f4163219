"""Constants of CasADi functions as arguments: what is lifted out of matrices comes back in its places."""

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from boomctl.symbolic import lifted, symbols
from tests.profiles import examples


@examples(30)
@given(st.integers(1, 5), st.integers(1, 5), st.integers(0, 2**31))
def test_what_is_lifted_comes_back(rows, columns, seed):
    random = np.random.default_rng(seed)
    matrix = random.standard_normal((rows, columns)) * (random.random((rows, columns)) < 0.6)
    vector, number = random.standard_normal(rows), 2.5
    places, constants = lifted((matrix, vector, number))
    symbol, found = symbols(places)
    back = ca.Function("back", [symbol], [ca.densify(each) for each in found])(constants)
    assert np.array_equal(back[0].full(), matrix)
    assert np.array_equal(back[1].full().ravel(), vector)
    assert float(back[2]) == number
    assert found[0].nnz() == np.count_nonzero(matrix)
    assert lifted((matrix * 3.0, -vector, 0.1))[0] == places


def test_rounded_zeros_are_zeros():
    places, constants = lifted((np.array([[1.0, 1e-17], [0.0, -2.0]]),))
    assert constants.tolist() == [1.0, -2.0]
    assert places == lifted((np.eye(2),))[0]
