"""Boxes of what measurements leave open hold the truth as often as they say, and controllers tuned over them keep it."""

import pickle

import numpy as np
import pytest
from scipy import stats

import boomctl as bc
from boomctl import tunable as T
from boomctl.structure import PolynomialFamily
from tests.identification.chain import CHAIN, frequencies, response_of_record, three_masses
from tests.identification.rig import RIG, START, measured, rig, weighed
from tests.profiles import is_hunt

FREE = list(RIG)
TUNED = 10  # every so many data sets a controller is tuned
CHANCE = 0.02  # of honest boxes to hold the truth less often than is asked: of 100 it leaves 90


@pytest.fixture(scope="module")
def found():
    return bc.fit(rig, measured(np.random.default_rng(0)), FREE, START, starts=1)


def test_the_family_is_the_model_over_the_box(found):
    family = found.family()
    assert isinstance(family, PolynomialFamily)
    assert [family.names, family.size] == [tuple(FREE), 4]
    for seed in range(3):
        delta = np.random.default_rng(seed).uniform(-1.0, 1.0, 4)
        true = rig(family.values(delta))
        for name in ("M", "C", "K"):
            np.testing.assert_allclose(getattr(family.at(delta), name), getattr(true, name), rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(family.at(delta).ports.B, true.ports.B, rtol=1e-12)


def test_a_box_of_all_at_once_is_wider_than_the_intervals_and_a_margin_widens_it_more(found):
    boxes = found.family(), found.family(0.99), found.family(margin=0.1)
    for name, (low, high) in found.intervals.items():
        (a, b), (c, d), (e, f) = (box.ranges[name] for box in boxes)
        assert c < a < low < high < b < d
        np.testing.assert_allclose([e, f], [a / 1.1, b * 1.1], rtol=1e-9)


@pytest.mark.slow
def test_family_of_union_contains_both_boxes(found):
    other = bc.fit(rig, measured(np.random.default_rng(1)), FREE, START, starts=1)
    union = found.family(union_with=[other]).ranges
    for name in FREE:
        ends = np.array([found.family().ranges[name], other.family().ranges[name]])
        np.testing.assert_allclose(union[name], [ends[:, 0].min(), ends[:, 1].max()], rtol=1e-6)
    fewer = bc.fit(rig, measured(np.random.default_rng(1)), ["gain"], RIG, starts=1)
    with pytest.raises(ValueError, match="`union_with` must be results of the same parameters"):
        found.family(union_with=[fewer])


@pytest.mark.slow
def test_a_function_within_a_function_does_not_pickle_and_is_asked_for(found):
    assert pickle.loads(pickle.dumps(found)).family().ranges == found.family().ranges
    own = bc.fit(lambda p: rig(p), measured(np.random.default_rng(0)), FREE, START, starts=1)
    again = pickle.loads(pickle.dumps(own))
    with pytest.raises(ValueError, match="build = None: expected a function"):
        again.family()
    assert again.family(build=rig).ranges == own.family().ranges


def test_what_is_no_family_is_refused_by_name(found):
    numbers = bc.fit(frequencies, frequencies(CHAIN), ["k1", "k2"], CHAIN, starts=1, deviation=0.01)
    with pytest.raises(TypeError, match=r"build: expected a function that makes a SecondOrderModel .* makes ndarray"):
        numbers.family()
    open_ends = bc.fit(frequencies, frequencies(CHAIN)[:2], ["k1", "k2"], CHAIN, starts=1)
    with pytest.raises(
        ValueError, match="family: expected parameters that the measurements bound, got k1 from 0 to inf"
    ):
        open_ends.family()
    for wrong, message in (({"probability": 95}, "probability = 95"), ({"margin": -0.1}, "margin = -0.1")):
        with pytest.raises(ValueError, match=message):
            found.family(**wrong)


def test_a_hub_beam_that_was_fitted_makes_its_family():
    truth = bc.HubBeamParameters(hub_inertia=190.0)
    hz = bc.hub_beam(truth, model="sfoam", modes=2).frequencies_hz()

    def build(p):
        return bc.hub_beam(p, model="sfoam", modes=2)

    found = bc.fit(build, hz, ["density"], bc.HubBeamParameters(density=2800.0), deviation=0.01, starts=1)
    assert found.family().names == ("density",)
    assert found.family().centre.inputs == ("torque", "disturbance_torque", "tip_force")


def test_identified_modes_make_a_family_over_their_frequencies_and_dampings():
    rng, step = np.random.default_rng(0), 0.02
    force = rng.standard_normal((4000, 2))
    mass = three_masses(0.02)
    moved = response_of_record(mass, force, step)
    moved += 0.02 * moved.std(axis=0) * rng.standard_normal(moved.shape)
    identified = bc.identify(
        {"f1": force[:, 0], "f2": force[:, 1]}, {name: moved[:, k] for k, name in enumerate(mass.outputs)}, step,
        band_hz=(0.5, 10.0),
    )  # fmt: skip
    family = identified.family()
    assert family.names == tuple(f"mode_{k}_{what}" for k in (1, 2, 3) for what in ("hz", "damping"))
    delta = rng.uniform(-1.0, 1.0, 6)
    values, poles = family.values(delta), family.at(delta).to_statespace().poles()
    there = sorted(poles[poles.imag > 1.0], key=lambda pole: pole.imag)  # others follow at once
    for k, pole in enumerate(there):
        wanted = values[f"mode_{k + 1}_hz"], values[f"mode_{k + 1}_damping"]
        np.testing.assert_allclose([pole.imag / (2.0 * np.pi), -pole.real / abs(pole)], wanted, rtol=1e-6)
    true = mass.eigenfrequencies_hz(3)
    for k in range(3):
        low, high = family.ranges[f"mode_{k + 1}_hz"]
        assert low < true[k] < high


@pytest.mark.slow
def test_the_box_holds_the_truth_and_a_controller_tuned_over_it_is_stable_there(capsys):
    """Of many data sets: 95 % boxes, Bonferroni's and so a little wide. Every tenth is tuned over, as that takes long."""
    sets = 100 if is_hunt() else 30
    held, stable, proved = 0, 0, 0
    for seed in range(sets):
        fitted = bc.fit(rig, measured(np.random.default_rng(seed)), FREE, START, starts=1)
        family = fitted.family(probability=0.95)
        held += all(low <= RIG[name] <= high for name, (low, high) in family.ranges.items())
        if seed % TUNED == 0:
            design = bc.tune(weighed, structure=T.pid(integral=False, high=200.0), family=family, starts=1)
            stable += bool((bc.close_loop(weighed(rig(RIG)), design.controller).poles().real < 0.0).all())
            proved += bc.robust_stability(family, design.controller).proved
    tuned = sets // TUNED
    with capsys.disabled():
        print(
            f"\n{held} of {sets} boxes hold all; {stable} of {tuned} controllers are stable on the truth, {proved} proved"
        )
    assert held >= stats.binom.ppf(CHANCE, sets, 0.95)
    assert stable == proved == tuned
