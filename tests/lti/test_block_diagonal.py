"""Block-diagonal forms: similar to the matrix, in columns of the condition allowed."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from boomctl.lti.modal import block_diagonal
from tests.profiles import examples

CONDITIONS = st.sampled_from([1e5, 1e6, 2.0**26])


def _checked(A, condition):
    """Return the widths of the blocks, after a look at what they promise."""
    blocks, columns, widths = block_diagonal(A, condition)
    assert np.linalg.cond(columns) <= condition
    ends = np.cumsum(widths)
    inside = linalg.block_diag(*(np.ones((width, width)) for width in widths))
    assert sum(widths) == len(A) == ends[-1]
    np.testing.assert_allclose(A @ columns, columns @ (blocks * inside), atol=1e-12 * condition * np.abs(A).max())
    return widths


@examples(60)
@given(st.integers(0, 10_000), st.integers(1, 14), CONDITIONS)
def test_form_is_similar(seed, n, condition):
    assert max(_checked(np.random.default_rng(seed).standard_normal((n, n)), condition)) <= n


@examples(30)
@given(st.integers(0, 10_000), st.integers(2, 5), CONDITIONS)
def test_poles_that_are_one_stay_together(seed, size, condition):
    rng = np.random.default_rng(seed)
    jordan = linalg.block_diag(np.diag(np.ones(size - 1), 1), np.diag([-1.0, -3.0]))
    V = linalg.qr(rng.standard_normal((len(jordan), len(jordan))))[0]
    assert max(_checked(V @ jordan @ V.T, condition)) == size


def test_an_empty_matrix_has_no_blocks():
    blocks, columns, widths = block_diagonal(np.zeros((0, 0)))
    assert blocks.shape == columns.shape == (0, 0)
    assert widths == []
