"""Wheel tracks: densities, classes, coherence of left and right, seeds, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import boomctl as bc
from boomctl.boom import road_density, track_coherence
from tests.profiles import examples

SEEDS = range(40)


def amplitudes(side):
    """Return the one-sided densities' share of each wave number: squared Fourier amplitudes over two, without the mean."""
    return np.fft.rfft(side)[1:] / len(side)


@pytest.mark.parametrize("road_class", ["A", "D", 7])
def test_the_density_of_the_class_is_recovered_from_many_tracks(road_class):
    """Squared amplitudes over their expected size are chi-squared; their mean is one within five standard errors."""
    shares = []
    for seed in SEEDS:
        track = bc.iso_track(road_class, 100.0, seed)
        n = np.arange(1, len(track.left) // 2 + 1) / track.length
        inside = (n >= 0.01) & (n <= 3.0)
        expected = road_density(road_class, n[inside]) / track.length
        for side in (track.left, track.right):
            found = 2.0 * np.abs(amplitudes(side)) ** 2
            shares.append(found[inside] / expected)
            assert np.abs(found[~inside]).max() < 1e-20 * found.max()
    ratio = np.array(shares)
    assert ratio.mean() == pytest.approx(1.0, abs=5.0 / np.sqrt(ratio.size / 2))
    thirds = [part.mean() for part in np.array_split(ratio, 3, axis=1)]
    assert thirds == pytest.approx([1.0] * 3, abs=5.0 / np.sqrt(ratio.size / 6))


def test_the_classes_are_those_of_the_standard():
    """Geometric means at 0.1 /m in 1e-6 m^3, A to H."""
    found = [float(road_density(letter, 0.1)[0]) * 1e6 for letter in "ABCDEFGH"]
    assert found == pytest.approx([16, 64, 256, 1024, 4096, 16384, 65536, 262144])
    assert road_density("C", [0.1, 0.2]) == pytest.approx([256e-6, 64e-6])


@given(st.integers(0, 2**63), st.integers(0, 6))
@examples(10)
def test_a_class_up_doubles_the_heights(seed, number):
    low, high = (bc.iso_track(k, 30.0, seed) for k in (number, number + 1))
    assert high.left == pytest.approx(2.0 * low.left, rel=1e-12)
    assert high.right == pytest.approx(2.0 * low.right, rel=1e-12)


def test_a_seed_is_a_track():
    first, again, other = (bc.iso_track("D", 40.0, seed) for seed in (3, 3, 4))
    assert (first.left == again.left).all()
    assert (first.right == again.right).all()
    assert np.abs(first.left - other.left).max() > 0.5 * first.left.std()


def test_the_tracks_of_a_seed_are_built_from_its_first_normal_numbers():
    """Half sum first, then half difference, cosine before sine: whoever has PCG64 has the track."""
    track = bc.iso_track("B", 20.0, 11, step=0.1, band=(0.05, 2.0))
    n = np.arange(1, 101) / 20.0
    drawn = np.random.Generator(np.random.PCG64(11)).standard_normal((4, 100))
    size = np.sqrt(road_density("B", n) / 20.0 * (n <= 2.0))
    common = track_coherence(n, 1.8)
    phase = 2.0 * np.pi * np.outer(track.distance, n)
    mean = (np.cos(phase) * drawn[0] - np.sin(phase) * drawn[1]) @ (size * np.sqrt(0.5 * (1 + common)))
    half = (np.cos(phase) * drawn[2] - np.sin(phase) * drawn[3]) @ (size * np.sqrt(0.5 * (1 - common)))
    assert track.left == pytest.approx(mean - half, abs=1e-12 * np.abs(mean).max() * 100)
    assert track.right == pytest.approx(mean + half, abs=1e-12 * np.abs(mean).max() * 100)


@pytest.mark.parametrize(("n", "b"), [(0.02, 1.8), (0.1, 1.8), (0.3, 1.5), (0.2, 0.3)])
def test_the_coherence_is_that_of_ground_alike_in_all_directions(n, b):
    """Cosine transform of (n^2 + m^2)^(-3/2) across the tracks, by quadrature, over its value without distance."""
    across, _ = quad(lambda m: (n * n + m * m) ** -1.5, 0.0, np.inf, weight="cos", wvar=2.0 * np.pi * b)
    assert float(track_coherence(n, b)[0]) == pytest.approx(across * n * n, rel=1e-6)


def test_left_and_right_have_in_common_what_the_coherence_says():
    crosses, powers = [], []
    for seed in SEEDS:
        track = bc.iso_track("C", 200.0, seed, width=1.5)
        left, right = amplitudes(track.left), amplitudes(track.right)
        crosses.append((left * right.conj()).real)
        powers.append(0.5 * (np.abs(left) ** 2 + np.abs(right) ** 2))
    n = np.arange(1, len(crosses[0]) + 1) / track.length
    for low, high in ((0.01, 0.04), (0.04, 0.1), (0.1, 0.2), (0.2, 0.4), (1.0, 3.0)):
        chosen = (n >= low) & (n < high)
        weight = n[chosen] ** 2
        found = (np.array(crosses)[:, chosen] @ weight).sum() / (np.array(powers)[:, chosen] @ weight).sum()
        error = 5.0 / np.sqrt(2.0 * chosen.sum() * len(SEEDS))
        assert found == pytest.approx(track_coherence(n[chosen], 1.5).mean(), abs=error)


def test_the_limits_of_coherence():
    together = bc.iso_track("C", 50.0, 1, coherence="full")
    assert (together.left == together.right).all()
    assert track_coherence([0.0, 0.5, 2.0], 1.8, "none") == pytest.approx([0.0, 0.0, 0.0])
    assert track_coherence([0.0, 1e-7, 5.0], 1.8) == pytest.approx([1.0, 1.0, 0.0], abs=1e-9)
    near = bc.iso_track("C", 50.0, 1, width=1e-5)
    assert np.abs(near.left - near.right).max() < 1e-3 * near.left.std()


def test_a_periodic_track_goes_round_and_runs_straight_between_points():
    track = bc.iso_track("C", 10.0, 5)
    x = np.array([0.01, 3.37, 9.99])
    assert track.heights(x + 30.0) == pytest.approx(track.heights(x), abs=1e-12)
    assert track.heights([9.99])[0, 0] == pytest.approx(0.5 * (track.left[-1] + track.left[0]))
    assert track.heights(track.distance)[1] == pytest.approx(track.right)


def test_a_bump_is_where_it_should_be():
    track = bc.bump_track(0.08, 0.4, "right", position=3.0, length=10.0)
    assert np.abs(track.left).max() == 0.0
    assert track.right.max() == pytest.approx(0.08)
    assert track.distance[track.right.argmax()] == pytest.approx(3.2)
    assert track.step * track.right.sum() == pytest.approx(0.5 * 0.08 * 0.4)
    assert (bc.bump_track(0.08, 0.4, "both").left == bc.bump_track(0.08, 0.4, "left").left).all()


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"road_class": "I"}, ValueError, "unknown road_class 'I'"),
        ({"road_class": 8}, ValueError, "road_class = 8: expected a letter from A to H or a number from 0 to 7"),
        ({"road_class": 2.5}, TypeError, r"road_class = 2\.5: expected a whole number"),
        ({"length": 0.0}, ValueError, r"length = 0\.0: expected a number greater than zero"),
        ({"length": 0.2}, ValueError, r"length = 0\.2: expected at least the shortest wave"),
        ({"length": 20.0, "band": (0.01, 0.04), "step": 1.0}, ValueError, "no wave of the band|shortest wave"),
        ({"seed": -1}, ValueError, "seed = -1: expected a whole number not below 0"),
        ({"seed": 1.0}, TypeError, r"seed = 1\.0"),
        ({"width": np.nan}, ValueError, "width = nan: expected a finite number"),
        ({"step": 0.5}, ValueError, r"step = 0\.5: expected less than 0\.16"),
        ({"band": (3.0, 1.0)}, ValueError, "band = .3, 1.: expected the lower wave number first"),
        ({"band": (0.0, 1.0)}, ValueError, r"band = .*0\.0: expected"),
        ({"coherence": "partial"}, ValueError, "unknown coherence 'partial'"),
    ],
)
def test_a_track_that_cannot_be_is_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        bc.iso_track(**arguments)


def test_a_bump_that_cannot_be_is_refused():
    with pytest.raises(ValueError, match=r"position = 49\.9: expected the bump to end before the track does"):
        bc.bump_track(0.1, 0.4, position=49.9)
    with pytest.raises(ValueError, match=r"bump_length = 0\.01: expected at least ten steps"):
        bc.bump_track(0.1, 0.01)
    with pytest.raises(ValueError, match="unknown side 'middle'"):
        bc.bump_track(0.1, 0.4, "middle")


def test_heights_of_a_track_are_finite_and_equally_many():
    with pytest.raises(ValueError, match="left: expected finite numbers, got nan at"):
        bc.Track(0.1, np.array([0.0, np.nan]), np.zeros(2), 1.8)
    with pytest.raises(ValueError, match="equally many, got 3 and 2"):
        bc.Track(0.1, np.zeros(3), np.zeros(2), 1.8)


@pytest.mark.parametrize("band", [0.5, None, "ab", (0.01,), (0.01, 1.0, 2.0), (np.nan, 1.0), (0.01, np.inf)])
def test_a_band_that_is_none_is_refused_for_tracks_and_densities(band):
    for call in (lambda: bc.iso_track("C", 50.0, band=band), lambda: bc.platform_density([1.0], band=band)):
        with pytest.raises((TypeError, ValueError), match=r"band = .*expected two wave numbers"):
            call()


def test_the_same_density_is_asked_for_with_the_band_reversed():
    with pytest.raises(ValueError, match="expected the lower wave number first"):
        bc.platform_density([1.0], band=(3.0, 0.01))


def test_tracks_that_memory_does_not_hold_are_refused():
    with pytest.raises(ValueError, match=r"length = 1e\+12: expected at most 5e\+07 steps of 0.02 m"):
        bc.iso_track("C", 1e12)
    with pytest.raises(ValueError, match="length = 50: expected at most"):
        bc.bump_track(0.1, 0.4, step=1e-12)
    with pytest.raises(TypeError, match="periodic = nan: expected True or False"):
        bc.Track(0.1, [0.0, 1.0], [0.0, 1.0], 1.8, periodic=np.nan)
