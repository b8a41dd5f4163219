"""Wheel tracks: densities, classes, coherence of left and right, seeds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import boomctl as bc
from boomctl.boom import road_psd, track_coherence
from tests.profiles import examples

GROUND = 10_000.0  # m of ground that a seed has


def test_the_classes_are_those_of_the_standard():
    """Geometric means at 0.1 /m in 1e-6 m^3, A to H."""
    found = [float(road_psd(letter, 0.1)[0]) * 1e6 for letter in "ABCDEFGH"]
    assert found == pytest.approx([16, 64, 256, 1024, 4096, 16384, 65536, 262144])
    assert road_psd("C", [0.1, 0.2]) == pytest.approx([256e-6, 64e-6])
    assert road_psd(2, 0.1) == road_psd("C", 0.1)


def summed(road_class, seed, period, low, waves, distance):
    """Return left and right as the sum of their waves one by one: whoever has PCG64 has the track."""
    n = np.arange(1, waves + 1) / period
    drawn = np.random.Generator(np.random.PCG64(seed)).standard_normal((waves, 4)).T
    size = np.sqrt(road_psd(road_class, n) / period * (n >= low))
    common = track_coherence(n, 1.8)
    phase = 2.0 * np.pi * np.outer(distance, n)
    mean = (np.cos(phase) * drawn[0] - np.sin(phase) * drawn[1]) @ (size * np.sqrt(0.5 * (1 + common)))
    half = (np.cos(phase) * drawn[2] - np.sin(phase) * drawn[3]) @ (size * np.sqrt(0.5 * (1 - common)))
    return mean - half, mean + half


@pytest.mark.parametrize("periodic", [False, True])
def test_track_uses_first_random_numbers_of_seed(periodic):
    """A wave after the other; half sum first, then half difference, cosine before sine."""
    period = 20.0 if periodic else GROUND
    track = bc.iso_track("B", 20.0, 11, spacing=0.1, wave_number_range=(0.05, 0.7), periodic=periodic)
    left, right = summed("B", 11, period, 0.05, round(0.7 * period), track.distance)
    assert track.left == pytest.approx(left, abs=1e-11 * np.abs(left).max())
    assert track.right == pytest.approx(right, abs=1e-11 * np.abs(right).max())
    assert track.periodic == periodic
    assert track.length == pytest.approx(20.0)


@given(st.integers(0, 2**53), st.sampled_from((20.0, 60.0)), st.sampled_from((90.0, 700.0)), st.integers(1, 4))
@examples(8)
def test_a_seed_is_the_same_ground_however_long_and_however_fine(seed, short, long, finer):
    one = bc.iso_track("D", short, seed, spacing=0.08, wave_number_range=(0.01, 1.0))
    other = bc.iso_track("D", long, seed, spacing=0.08 / finer, wave_number_range=(0.01, 1.0))
    for side in ("left", "right"):
        heights = getattr(one, side)
        assert getattr(other, side)[::finer][: len(heights)] == pytest.approx(heights, abs=1e-11 * heights.std())


@pytest.mark.slow
def test_long_track_matches_sum_of_waves():
    """Behind many blocks, where phases have gone round ten thousand times."""
    track = bc.iso_track("C", GROUND, 2, spacing=0.01, wave_number_range=(0.01, 3.0))
    at = np.array([1, 32767, 32768, 499_999, 777_777, 999_999, 1_000_000])
    left, right = summed("C", 2, GROUND, 0.01, 30_000, track.spacing * at)
    assert track.left[at] == pytest.approx(left, abs=1e-10 * track.left.std())
    assert track.right[at] == pytest.approx(right, abs=1e-10 * track.right.std())
    assert track.left[0] == pytest.approx(track.left[-1], abs=1e-10 * track.left.std())


@pytest.fixture(scope="module")
def grounds():
    """The amplitudes of three whole grounds (seed, side, wave) up to 0.6 /m, and their wave numbers."""
    found = []
    for seed in range(3):
        track = bc.iso_track("D", GROUND, seed, spacing=0.5, wave_number_range=(0.01, 0.6), width=1.5)
        found.append([np.fft.rfft(side[:-1])[1:6001] / (len(side) - 1) for side in (track.left, track.right)])
    return np.array(found), np.arange(1, 6001) / GROUND


def test_track_density_matches_class(grounds):
    """Shares of the expected size have the mean and the variance of exponential variables, and none is outside."""
    found, n = grounds
    inside = n >= 0.01 * (1 - 1e-9)
    share = 2.0 * np.abs(found[..., inside]) ** 2 * GROUND / road_psd("D", n[inside])
    assert np.abs(found[..., ~inside]).max() < 1e-12 * np.abs(found).max()
    for part in np.array_split(share, 5, axis=2):
        assert part.mean() == pytest.approx(1.0, abs=5.0 / np.sqrt(part.size / 2))
        assert part.var() == pytest.approx(1.0, abs=5.0 * np.sqrt(8.0 / (part.size / 2)))


def test_track_coherence_between_sides(grounds):
    found, n = grounds
    for low, high in ((0.01, 0.04), (0.04, 0.1), (0.1, 0.2), (0.2, 0.4), (0.4, 0.6)):
        chosen = (n >= low) & (n < high)
        left, right = found[:, 0, chosen] * n[chosen], found[:, 1, chosen] * n[chosen]
        common = (left * right.conj()).sum() / (0.5 * (np.abs(left) ** 2 + np.abs(right) ** 2).sum())
        error = 5.0 / np.sqrt(2.0 * left.size)
        assert common.real == pytest.approx(track_coherence(n[chosen], 1.5).mean(), abs=error)
        assert abs(common.imag) < error


@pytest.mark.parametrize(("n", "b"), [(0.02, 1.8), (0.1, 1.8), (0.3, 1.5), (0.2, 0.3)])
def test_the_coherence_is_that_of_ground_alike_in_all_directions(n, b):
    """Cosine transform of (n^2 + m^2)^(-3/2) across the tracks, by quadrature, over its value without distance."""
    across, _ = quad(lambda m: (n * n + m * m) ** -1.5, 0.0, np.inf, weight="cos", wvar=2.0 * np.pi * b)
    assert float(track_coherence(n, b)[0]) == pytest.approx(across * n * n, rel=1e-6)


def test_the_limits_of_coherence():
    together = bc.iso_track("C", 50.0, 1, coherence="full")
    assert (together.left == together.right).all()
    assert track_coherence([0.0, 0.5, 2.0], 1.8, "none") == pytest.approx([0.0, 0.0, 0.0])
    assert track_coherence([0.0, 1e-7, 5.0], 1.8) == pytest.approx([1.0, 1.0, 0.0], abs=1e-9)
    near = bc.iso_track("C", 50.0, 1, width=1e-5)
    assert np.abs(near.left - near.right).max() < 1e-3 * near.left.std()


def test_periodic_track_interpolates_linearly():
    track = bc.iso_track("C", 10.0, 5, periodic=True)
    x = np.array([0.01, 3.37, 9.99])
    assert track.heights(x + 30.0) == pytest.approx(track.heights(x), abs=1e-12)
    assert track.heights([9.99])[0, 0] == pytest.approx(0.5 * (track.left[-1] + track.left[0]))
    assert track.heights(track.distance)[1] == pytest.approx(track.right)


def test_a_bump_is_where_it_should_be():
    track = bc.bump_track(0.08, 0.4, "right", position=3.0, length=10.0)
    assert np.abs(track.left).max() == 0.0
    assert track.right.max() == pytest.approx(0.08)
    assert track.distance[track.right.argmax()] == pytest.approx(3.2)
    assert track.spacing * track.right.sum() == pytest.approx(0.5 * 0.08 * 0.4)
    assert (bc.bump_track(0.08, 0.4, "both").left == bc.bump_track(0.08, 0.4, "left").left).all()


def test_a_track_that_goes_round_may_be_longer_than_a_ground():
    track = bc.iso_track("C", 12e3, 1, spacing=1.0, wave_number_range=(0.01, 0.4), periodic=True)
    assert track.length == 12e3
    assert track.left.std() == pytest.approx(np.sqrt(256e-6 * 0.01 * (1 / 0.01 - 1 / 0.4)), rel=0.3)
