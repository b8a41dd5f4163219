"""The plants that tuning is measured on: their numbers are those of the collection, and a bound is the published one."""

import numpy as np
import pytest
from scipy import io

from boomctl.lab.benchmark.scenes.synthesis import published_plants
from boomctl.progress import Deadline
from boomctl.synthesis.hinf.full_order import full_order_bound
from boomctl.synthesis.plants.partition import partition
from tests.test_collections import KEYS, gym_folder, gym_names
from tests.tuning import compleib as plants
from tests.tuning.compleib import plant, plant_names
from tests.tuning.test_compleib import GOALS

PRINTED = [name for name in plant_names() if not plant(name).data]
CUT = 1e-4  # four decimals are left in controlgym, of some numbers without rounding
FULL_ORDER = {"HE4": 22.838}  # a published norm of a gain, which no controller of any order goes below


def test_names_are_those_of_goals_and_of_the_file():
    assert len(set(PRINTED)) == len(PRINTED) == 26
    goals = {goal.plant for goal in GOALS}
    assert goals <= {*PRINTED, *plants._RENUMBERED}
    assert len({(goal.plant, goal.order) for goal in GOALS}) == len(GOALS)
    with pytest.raises(ValueError, match="AC99"):
        plant("AC99")


@pytest.mark.parametrize("name", PRINTED)
def test_a_plant_says_what_it_is_and_from_where(name):
    found = plant(name)
    assert len(found.about) > 5
    assert len(found.source) > 20
    part = partition(found.P, found.nmeas, found.ncon)
    assert part.B2.any(axis=0).all()
    assert part.C2.any(axis=1).all()
    assert not part.D22.any()


@pytest.mark.skipif(not gym_names(), reason="controlgym is not installed")
def test_numbers_are_those_of_controlgym_to_its_decimals():
    """Eleven plants are in both: what was typed in here was rounded there."""
    compared = []
    for stem in gym_names():
        found = io.loadmat(gym_folder() / f"{stem}.mat")
        name = str(found["complib_id"][0]).upper()
        if name not in PRINTED:
            continue
        part = partition(plant(name).P, plant(name).nmeas, plant(name).ncon)
        theirs = {key: np.asarray(found[key], float) for key in KEYS}
        theirs["C2"] = theirs.pop("C")
        for key, values in theirs.items():
            assert np.abs(getattr(part, key) - values).max() < CUT, (name, key)
        compared.append(name)
    assert len(compared) == 11


def test_the_rod_conducts_all_heat_in_the_end():
    """What enters at one end of an insulated rod warms all of it alike, and its slowest mode is a quarter of a cosine."""
    rod = plant("HF1")
    assert rod.P(0.0)[0, 0] == pytest.approx(1.0, abs=1e-9)
    assert rod.P(0.0)[1, 0] == pytest.approx(1.0, abs=1e-9)
    assert rod.P.poles().real.max() == pytest.approx(-((np.pi / 2.0) ** 2) / 131.0, rel=0.01)


@pytest.mark.parametrize("name", FULL_ORDER)
def test_bounds_of_all_orders_are_the_published_ones(name):
    found = plant(name)
    bound = full_order_bound(partition(found.P, found.nmeas, found.ncon), Deadline(20.0))
    assert bound[0] == pytest.approx(FULL_ORDER[name], rel=1e-4)


@pytest.mark.skipif(not gym_names(), reason="controlgym is not installed")
def test_plants_of_controlgym_are_told_apart():
    sizes = {name: (plant(name).states, plant(name).nmeas, plant(name).ncon) for name in plants._RENUMBERED}
    assert sizes == {"AC10": (55, 2, 2), "BDT2": (82, 4, 4), "CM3": (120, 2, 1)}
    assert all(plant(name).data for name in sizes)


def test_without_controlgym_its_plants_are_not_there(monkeypatch):
    monkeypatch.setattr(plants, "find_spec", lambda name: None)
    assert "AC10" not in plant_names()
    with pytest.raises(ValueError, match="controlgym"):
        plant("AC10")


def test_plants_of_the_benchmark_are_those_of_the_collection():
    for name, (P, nmeas, ncon) in published_plants().items():
        found = plant(name)
        assert (nmeas, ncon) == (found.nmeas, found.ncon)
        for key in "ABCD":
            np.testing.assert_array_equal(getattr(P, key), getattr(found.P, key))
