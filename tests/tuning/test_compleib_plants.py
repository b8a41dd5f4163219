"""The plants that tuning is measured on: their numbers are those of the collection, and a bound is the published one."""

import numpy as np
import pytest

from boomctl.lab.benchmark.scenes.synthesis import published_plants
from boomctl.progress import Deadline
from boomctl.synthesis.plants.partition import partition
from boomctl.tuning.full_order import full_order_bound
from tests.tuning.compleib import plant

FULL_ORDER = {"HE4": 22.838}  # a published norm of a gain, which no controller of any order goes below


def test_the_rod_conducts_all_heat_in_the_end():
    """What enters at one end of an insulated rod warms all of it alike, and its slowest mode is a quarter of a cosine."""
    rod, *_ = plant("HF1")
    assert rod(0.0)[:2, 0] == pytest.approx(np.ones(2), abs=1e-9)
    assert rod.poles().real.max() == pytest.approx(-((np.pi / 2.0) ** 2) / 131.0, rel=0.01)


@pytest.mark.parametrize("name", FULL_ORDER)
def test_bounds_of_all_orders_are_the_published_ones(name):
    bound = full_order_bound(partition(*plant(name)), Deadline(20.0))
    assert bound[0] == pytest.approx(FULL_ORDER[name], rel=1e-4)


def test_plants_of_the_benchmark_are_those_of_the_collection():
    for name, (P, nmeas, ncon) in published_plants().items():
        found, *counts = plant(name)
        assert [nmeas, ncon] == counts
        for key in "ABCD":
            np.testing.assert_array_equal(getattr(P, key), getattr(found, key))
