"""The reduction's benchmark: both sides are judged by one referee."""

import pytest

from boomctl.lab.benchmark.suspension.run import reduction_lines


@pytest.mark.slow
def test_ours_is_no_less_exact_on_a_small_mesh():
    (row, *_) = reduction_lines(1, lambda text: None, elements=60)
    assert row.error is not None
    assert row.peer_error is not None
    assert 0.0 < row.error <= 1.01 * row.peer_error
