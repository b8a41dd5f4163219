"""The plants that tuning is measured on: their numbers are those of the collection, and a bound is the published one."""

import numpy as np
import pytest
from scipy import io

from boomctl.lab.benchmark.scenes.synthesis import published_plants
from boomctl.progress import Deadline
from boomctl.synthesis.plants.partition import partition
from boomctl.tuning.full_order import full_order_bound
from tests.test_collections import KEYS, gym_folder, gym_names
from tests.tuning.compleib import exact_names, plant

CUT = 1e-4  # four decimals are left in controlgym, of some numbers without rounding
FULL_ORDER = {"HE4": 22.838}  # a published norm of a gain, which no controller of any order goes below


@pytest.mark.skipif(not gym_names(), reason="controlgym is not installed")
def test_numbers_are_those_of_controlgym_to_its_decimals():
    """Eleven plants are in both: what was typed in here was rounded there."""
    compared = []
    for stem in gym_names():
        found = io.loadmat(gym_folder() / f"{stem}.mat")
        name = str(found["complib_id"][0]).upper()
        if name not in exact_names():
            continue
        part = partition(*plant(name))
        theirs = {key: np.asarray(found[key], float) for key in KEYS}
        theirs["C2"] = theirs.pop("C")
        for key, values in theirs.items():
            assert np.abs(getattr(part, key) - values).max() < CUT, (name, key)
        compared.append(name)
    assert len(compared) == 11


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
