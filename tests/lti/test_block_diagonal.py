"""Block-diagonal forms: those of python-control's search, found without it where poles lie apart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from boomctl.lti.modal import block_diagonal
from boomctl.lti.python_control import control
from tests.profiles import examples

CONDITIONS = st.sampled_from([1e5, 1e6, 2.0**26])


def _checked(A, condition):
    """Return the widths of the blocks, after a look at what they promise."""
    blocks, columns, widths = block_diagonal(A, condition)
    wanted, vectors, sizes = control.bdschur(A, condmax=condition)
    assert widths == sizes.tolist()
    assert (blocks == wanted).all()
    assert (columns == vectors).all()
    assert np.linalg.cond(columns) <= condition
    ends = np.cumsum(widths)
    inside = linalg.block_diag(*(np.ones((width, width)) for width in widths))
    assert sum(widths) == len(A) == ends[-1]
    np.testing.assert_allclose(A @ columns, columns @ (blocks * inside), atol=1e-12 * condition * np.abs(A).max())
    return widths


@examples(60)
@given(st.integers(0, 10_000), st.integers(1, 14), CONDITIONS)
def test_the_form_is_that_of_the_search(seed, n, condition):
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


@pytest.mark.parametrize("A", [np.diag([-1.0, -2.0, -3.0]), np.array([[0.0, 1.0], [-4.0, -0.1]])])
def test_poles_apart_need_no_search(A, monkeypatch):
    monkeypatch.setattr(control, "bdschur", None)
    assert sum(block_diagonal(A)[2]) == len(A)
