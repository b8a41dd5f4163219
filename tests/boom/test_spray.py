"""Spray on the field: what falls is what was sprayed, the dose of a moving nozzle, passes that add up."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.boom.spray import _stay_below
from tests.profiles import examples
from tests.strategies import seeds

X = bc.nozzle_positions()
LINE = bc.boom.Footprint(1.0, 0.0)


def sine(k, speed=2.0, frequency_hz=0.5, duration=40.0, step=1e-3):
    """Return times and a jolt whose speed is ``k`` times the driving speed at most."""
    t = step * np.arange(round(duration / step) + 1)
    w = 2 * np.pi * frequency_hz
    return t, np.ones((len(X), 1)) * (k * speed / w * np.sin(w * t))


def wandering(rng, count, n, size):
    """Return rough and smooth motions with an RMS of ``size`` meters, walking to and fro."""
    steps = rng.standard_normal((count, n))
    smooth = np.cumsum(np.cumsum(steps - steps.mean(axis=1)[:, None], axis=1), axis=1)
    moved = smooth / np.abs(smooth).max() + 0.02 * steps
    return size * moved / moved.std()


@given(seeds, st.floats(0.001, 2.0), st.sampled_from([0.0, 0.03, 0.1, 0.37]), st.sampled_from(["triangle", "box"]))
@examples(30)
def test_all_that_was_sprayed_lies_on_the_ground(seed, size, thickness, shape):
    rng = np.random.default_rng(seed)
    t, moved = 0.02 * np.arange(401), wandering(rng, 6, 401, size)
    x = 0.5 * np.arange(6) - 1.25
    cell = (float(rng.uniform(0.05, 0.4)), float(rng.uniform(0.03, 0.3)))
    footprint = bc.boom.Footprint(float(rng.uniform(0.2, 1.5)), thickness, shape)
    assume(np.ptp(moved) < 10.0)
    result = bc.spray_deposit(t, moved, x, 3.0, footprint=footprint, cell_size=cell)
    area = np.outer(np.diff(result.x_edges), np.diff(result.y_edges))
    assert (result.deposit * area).sum() == pytest.approx(6 * 0.5 * 3.0 * t[-1], rel=1e-9)
    assert result.deposit.min() > -1e-9 * result.deposit.max()


@given(seeds, st.floats(0.01, 1.0), st.sampled_from([0.0, 1e-12, 0.05, 0.6]))
@examples(25)
def test_the_time_spent_behind_an_edge_is_that_of_many_drops(seed, size, thickness):
    """Drops let fall evenly over time and over the thickness, counted."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(41)
    path = 0.5 * t + wandering(rng, 1, 41, size)[0]
    edges = np.arange(path.min() - 1.0, path.max() + 1.0, 0.13)
    found = _stay_below(edges, path, t, thickness)
    drops = np.interp(np.linspace(0.0, 4.0, 40001)[:-1] + 5e-5, t, path)
    offsets = thickness * ((np.arange(16) + 0.5) / 16 - 0.5)
    counted = [np.mean(drops[:, None] + offsets < edge) * 4.0 for edge in edges]
    assert found == pytest.approx(counted, abs=0.02)


@pytest.mark.parametrize("k", [0.0, 0.05, 0.2, 0.5, 0.7])
def test_the_variation_of_a_sine_is_known(k):
    """Dose ``1/(1 + y'/V)`` under a point; over the ground its square has the mean ``1/sqrt(1 - k^2)``."""
    t, moved = sine(k)
    result = bc.spray_deposit(t, moved, X, 2.0, footprint=LINE, cell_size=(0.5, 0.01))
    assert result.cv == pytest.approx(np.sqrt(1.0 / np.sqrt(1.0 - k * k) - 1.0), rel=5e-3, abs=1e-9)
    assert result.max_dose == pytest.approx(1.0 / (1.0 - k), rel=5e-3)
    assert result.min_dose == pytest.approx(1.0 / (1.0 + k), rel=5e-3)
    assert result.relative_tip_speed == pytest.approx(k / np.sqrt(2.0), rel=1e-3)
    assert result.worst_dose == (result.max_dose if k else pytest.approx(1.0))


def test_where_a_nozzle_goes_back_its_passes_add_up():
    """Forward 3 m, back 1 m, forward 3 m, at 1 m/s against the ground: three passes over the middle meter."""
    t = 0.01 * np.arange(701)
    path = np.interp(t, [0.0, 3.0, 4.0, 7.0], [0.0, 3.0, 2.0, 5.0])
    moved = np.ones((24, 1)) * (path - t * 5.0 / 7.0)
    result = bc.spray_deposit(t, moved, X, 5.0 / 7.0, footprint=LINE, cell_size=0.1)
    along = result.deposit[result.x_slice].mean(axis=0)
    middle = 0.5 * (result.y_edges[1:] + result.y_edges[:-1])
    nominal = 5.0 / 7.0
    for low, high, passes in ((0.0, 2.0, 1), (2.0, 3.0, 3), (3.0, 5.0, 1)):
        chosen = (middle > low + 0.06) & (middle < high - 0.06)
        assert along[chosen] == pytest.approx(np.full(chosen.sum(), passes * nominal), rel=1e-6)


@given(seeds, st.integers(-30, 30), st.floats(-100.0, 100.0))
@examples(15)
def test_field_is_the_same_elsewhere_mirrored_and_twice_as_fast(seed, cells, start):
    """Only the path counts: all times halved, all speeds doubled."""
    t, moved, x = 0.02 * np.arange(401), wandering(np.random.default_rng(seed), 8, 401, 0.05), X[8:16]
    here, mirrored = (bc.spray_deposit(t, path, x, 2.0) for path in (moved, moved[::-1]))
    there, fast = bc.spray_deposit(start + t, moved + 0.1 * cells, x, 2.0), bc.spray_deposit(0.5 * t, moved, x, 4.0)
    assert np.allclose(mirrored.deposit[::-1], here.deposit, rtol=0.0, atol=1e-9)
    assert np.allclose(there.deposit, here.deposit, rtol=0.0, atol=1e-7)
    assert there.cv == pytest.approx(here.cv, rel=1e-6)
    assert there.y_edges[0] - here.y_edges[0] == pytest.approx(0.1 * cells, abs=1e-6)
    assert np.allclose(fast.deposit, here.deposit, rtol=0.0, atol=1e-9)
    assert fast.relative_tip_speed == pytest.approx(here.relative_tip_speed)


@pytest.mark.parametrize("shape", ["triangle", "box"])
def test_the_footprint_is_what_it_says(shape):
    """Share left of a place, against the density integrated."""
    footprint = bc.boom.Footprint(0.8, 0.1, shape)
    s = np.linspace(-0.6, 0.6, 4001)
    density = np.where(np.abs(s) < 0.4, 1.0 / 0.8 if shape == "box" else (1 - np.abs(s) / 0.4) / 0.4, 0.0)
    share = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(s))])
    assert footprint.cumulative(s) == pytest.approx(share, abs=1e-3)


def test_straight_boom_matches_all_nozzles():
    rng = np.random.default_rng(1)
    t, tips = 0.02 * np.arange(801), wandering(rng, 2, 801, 0.1)
    every = tips[0] + (tips[1] - tips[0]) * (X[:, None] + 6.0) / 12.0
    short = bc.spray_deposit(t, tips, [-6.0, 6.0], 2.0, nozzles=X)
    assert np.allclose(bc.spray_deposit(t, every, X, 2.0).deposit, short.deposit, rtol=0.0, atol=1e-9)
    assert short.rms_tip_speed == pytest.approx(np.sqrt(np.mean((np.diff(tips) / 0.02) ** 2, axis=1)).max())


def test_jolt_and_yaw_apart_add_up_to_the_motion():
    rng = np.random.default_rng(2)
    moved = wandering(rng, 24, 801, 0.03)
    jolt, yaw = bc.boom.split_jolt_yaw(moved, X)
    assert np.allclose(jolt + yaw, moved, rtol=1e-6, atol=1e-12)
    assert np.allclose(jolt, jolt[::-1], rtol=1e-6, atol=1e-12)
    assert np.allclose(yaw, -yaw[::-1], rtol=1e-6, atol=1e-12)
    t = 0.02 * np.arange(801)
    total, of_jolt, of_yaw = bc.spray_deposit_components(t, jolt, X, 2.0)
    assert of_jolt.cv == pytest.approx(total.cv)
    assert of_yaw.cv == pytest.approx(0.0, abs=1e-9)


def test_small_jolt_and_yaw_vary_independently():
    """Cell by cell the two add; where they are uncorrelated over time their variances do."""
    t = 0.005 * np.arange(24001)
    jolt = 0.02 * np.sin(2 * np.pi * 0.5 * t)
    yaw = 0.01 * np.sin(2 * np.pi * 0.3 * t)
    total, of_jolt, of_yaw = bc.spray_deposit_components(t, jolt + X[:, None] * yaw, X, 3.0)
    assert total.cv**2 == pytest.approx(of_jolt.cv**2 + of_yaw.cv**2, rel=0.03)


def test_dose_fractions_count_evaluated_cells():
    t, moved = sine(0.3)
    result = bc.spray_deposit(t, moved, X, 2.0)
    dose = result.evaluated_deposit
    assert result.share_outside_10 == pytest.approx(np.mean(np.abs(dose - 1) > 0.1))
    assert result.share_outside_20 == pytest.approx(np.mean(np.abs(dose - 1) > 0.2))
    assert (result.min_dose, result.max_dose) == pytest.approx((dose.min(), dose.max()))
    assert result.fraction_outside(0.0) == pytest.approx(1.0, abs=0.01)
    assert result.worst_dose in (result.min_dose, result.max_dose)
    assert result.cv == pytest.approx(dose.std() / dose.mean())
    edges = result.x_edges[result.x_slice.start], result.x_edges[result.x_slice.stop]
    assert edges == pytest.approx((X[0], X[-1]), abs=0.1 + 1e-9)


def test_nozzles_of_the_model_are_the_boom_between_its_tips():
    """Where a nozzle is at a tip it is the tip; slowly driven, the boom follows the platform as a rigid one."""
    model = bc.spray_boom(nozzles=[-6.0, -2.0, 2.0, 6.0])
    assert model.output_labels[-4:] == ("nozzle_01", "nozzle_02", "nozzle_03", "nozzle_04")
    Y = model.frequency_response([0.5, 5.0], outputs=["tip_left", "nozzle_01", "tip_right", "nozzle_04"]).frdata
    assert Y[0] == pytest.approx(Y[1])
    assert Y[2] == pytest.approx(Y[3])
    slow = model.frequency_response([1e-4], ["actuator_left", "actuator_right"], ["nozzle_02", "nozzle_03"]).frdata
    half = bc.BoomParameters().actuator_distance / 2
    expected = [[0.5 * (1 + 2.0 / half), 0.5 * (1 - 2.0 / half)], [0.5 * (1 - 2.0 / half), 0.5 * (1 + 2.0 / half)]]
    assert np.abs(slow[:, :, 0] - expected).max() < 1e-5


@pytest.mark.parametrize("nozzles", [[-3.0, 3.0], [-3.0, 0.0, 3.0], bc.nozzle_positions().tolist(), [1.0, 2.0]])
def test_boom_with_nozzles_splits_where_they_are_mirror_images(nozzles):
    model = bc.spray_boom(nozzles=nozzles)
    assert bc.sigma(model).peak == pytest.approx(bc.sigma(bc.spray_boom()).peak, rel=1e-9)
    if nozzles[0] > 0.0:
        with pytest.raises(ValueError, match="not pairs of mirror images"):
            bc.split_symmetric(model)
        return
    jolt, yaw = bc.split_symmetric(model)
    assert jolt.ncoordinates + yaw.ncoordinates == model.ncoordinates
    assert "nozzle_01_sym" in jolt.output_labels
    assert "nozzle_01_anti" in yaw.output_labels


@pytest.mark.parametrize("width", [0.3, *(pytest.param(w, marks=pytest.mark.slow) for w in (1.0, 1.7, 2.0)), 4.0])
@pytest.mark.parametrize("shape", ["triangle", "box"])
def test_cells_are_judged_only_where_all_neighbors_spray(width, shape):
    """One nozzle more at each end changes nothing there, however wide the footprint."""
    t, footprint = 0.01 * np.arange(1001), bc.boom.Footprint(width, 0.1, shape)
    found = bc.spray_deposit(t, np.zeros((24, 1001)), X, 2.5, footprint=footprint)
    longer = np.r_[X[0] - 0.5, X, X[-1] + 0.5]
    more = bc.spray_deposit(t, np.zeros((26, 1001)), longer, 2.5, footprint=footprint)
    start = int(np.flatnonzero(np.isclose(more.x_edges, found.x_edges[found.x_slice.start]))[0])
    same = more.deposit[start : start + len(found.evaluated_deposit), found.y_slice]
    assert np.allclose(same, found.evaluated_deposit, rtol=0.0, atol=1e-9)
    assert len(found.evaluated_deposit) > 20


def test_a_thick_footprint_on_fine_cells_is_done_in_portions(monkeypatch):
    t, moved = 0.01 * np.arange(301), wandering(np.random.default_rng(3), 24, 301, 0.1)
    arguments = (t, moved, X, 2.0)
    options = {"footprint": bc.boom.Footprint(1.0, 1.0), "cell_size": (0.5, 0.01)}
    whole = bc.spray_deposit(*arguments, **options).deposit
    monkeypatch.setattr("boomctl.boom.spray._PORTION", 500)
    assert np.allclose(bc.spray_deposit(*arguments, **options).deposit, whole, rtol=0.0, atol=1e-12)
