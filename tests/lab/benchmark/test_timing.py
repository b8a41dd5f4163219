"""What run times are measured by: memory is counted, facts are told; grids hold the resonances."""

import numpy as np
import pytest

from boomctl.lab.benchmark.scenes.boom_sigma import resonance_grid
from boomctl.lab.benchmark.timing import environment, peak_memory


@pytest.mark.slow
def test_peak_memory_counts_what_a_call_holds():
    assert peak_memory(lambda: np.zeros(10**6)) == pytest.approx(8e6, rel=0.01)


def test_facts_are_told():
    assert {"processor", "numpy", "python", "cores", "threads"} <= environment().keys()


def test_grid_holds_the_resonances():
    grid = resonance_grid(np.array([-0.5 + 10.0j]), 50, 21)
    assert len(grid) == 71
    assert np.isclose(grid, 10.0).any()
    assert np.isclose(grid, 13.0).any()
    assert (np.diff(grid) > 0.0).all()
