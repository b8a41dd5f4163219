"""The scenes of reduction: both sides are judged by one referee."""

import pytest

from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.scenes.boom_reduction import boom_reduction_fine


@pytest.mark.slow
def test_ours_is_no_less_exact_on_a_small_mesh():
    found = measured(boom_reduction_fine("quick"), 1e-3, lambda text: None)
    assert all(0.0 < p.error < 1.0 for p in found.points)
    (kept,) = found.kept
    assert kept.held
