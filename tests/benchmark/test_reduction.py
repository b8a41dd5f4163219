"""The reduction's benchmark: both sides are judged by one referee."""

from boomctl.benchmark.suspension.reduction import reduction_lines


def test_ours_is_no_less_exact_on_a_small_mesh():
    (row, *_) = reduction_lines(elements=60, rounds=1)
    assert row.error is not None
    assert row.peer_error is not None
    assert 0.0 < row.error <= 1.01 * row.peer_error
