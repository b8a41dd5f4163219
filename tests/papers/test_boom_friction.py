"""The cradle's friction: what it does to the lower singular value, and that both methods say so."""

import numpy as np
import pytest

from boomctl.boom import BoomParameters, spray_boom
from boomctl.papers.anthonis_ramon.friction import BAND_HZ, friction_study, matched_force
from boomctl.plotting import figure_bytes
from boomctl.plotting.boom import draw_friction
from boomctl.structure import split_symmetric

pytestmark = pytest.mark.xdist_group("friction")


@pytest.fixture(scope="module")
def study():
    return friction_study(points=9)


def _reading(study, name):
    return next(reading for reading in study.readings if reading.name.startswith(name))


def test_the_force_matches_the_damping_at_the_cradles_mode(study):
    assert study.matched_hz == pytest.approx(0.9325, abs=1e-3)  # the exact beam's third frequency
    bare = _reading(study, "in place of viscous").balance
    k = int(np.abs(bare.omega / (2 * np.pi) - 1.0).argmin())
    damping = 4.0 * study.force / (np.pi * bare.omega[k] * bare.slip[k])
    assert 0.3 * BoomParameters().cradle_damping < damping < 1.5 * BoomParameters().cradle_damping


@pytest.mark.parametrize("method", ["balance", "swept"])
def test_friction_in_place_of_damping_lowers_the_lower_singular_value_between_2_5_and_3_5_hz(study, method):
    whole, part = (
        study.change(found.omega, found.gain)
        for found in (getattr(_reading(study, name), method) for name in ("in place of viscous", "in place of half"))
    )
    assert 0.4 < whole < 0.8
    assert whole < part < 0.95


@pytest.mark.parametrize("method", ["balance", "swept"])
def test_friction_beside_damping_and_a_stuck_cradle_raise_it(study, method):
    found = getattr(_reading(study, "added"), method)
    assert study.change(found.omega, found.gain) > 1.2
    assert study.change(study.omega, study.stuck) > study.change(found.omega, found.gain)


def test_above_the_band_the_lower_singular_value_is_yaw_and_does_not_feel_the_cradle(study):
    freq_hz = study.omega / (2 * np.pi)
    above, within = (freq_hz > 3.7) & (freq_hz < 4.5), (freq_hz > 2.0) & (freq_hz < 3.4)
    assert (study.jolt[above] > study.yaw[above]).all()
    assert (study.jolt[within] < study.yaw[within]).all()
    for reading in study.readings:
        np.testing.assert_allclose(study.ratio(study.omega, reading.balance.gain)[above], 1.0, atol=1e-12)


def test_both_methods_agree_in_the_band(study):
    for reading in study.readings:
        chosen = (reading.swept.omega >= 2 * np.pi * BAND_HZ[0]) & (reading.swept.omega <= 2 * np.pi * BAND_HZ[1])
        balance = np.interp(reading.swept.omega[chosen], reading.balance.omega, reading.balance.gain)
        assert chosen.sum() >= 3
        np.testing.assert_allclose(reading.swept.gain[chosen], balance, rtol=0.06)


def test_the_force_is_in_proportion_to_the_amplitude():
    jolt, _ = split_symmetric(spray_boom(elements=6))
    small, large = (matched_force(jolt, 160.0, amplitude) for amplitude in (1e-3, 1e-2))
    assert large[0] == pytest.approx(10.0 * small[0], rel=1e-9)
    assert large[1] == small[1]


def test_the_numbers_are_those_of_the_curves(study):
    numbers = study.numbers()
    assert len(numbers) == 1 + 2 * len(study.readings)
    assert min(numbers, key=lambda name: numbers[name]).startswith("friction in place of viscous")
    assert max(numbers, key=lambda name: numbers[name]) == "stuck"


def test_the_picture_is_drawn(study):
    assert figure_bytes(draw_friction(study), "png").startswith(b"\x89PNG")


def test_bad_input():
    with pytest.raises(ValueError, match="amplitude"):
        friction_study(amplitude=0.0)
    with pytest.raises(ValueError, match="points"):
        friction_study(points=2)
