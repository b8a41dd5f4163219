"""How often intervals hold: as often as they say, over many data sets with errors drawn anew.

Whatever their number, what is asked of the share is what chance leaves of it: bounds of the binomial distribution. The
seeds are zero, and stay as they are. Under the profile ``hunt`` there are four times as many data sets.
"""

import control
import numpy as np
import pytest
from scipy import signal, stats

import boomctl as bc
from boomctl.identification import MeasuredFrequencyResponse
from tests.identification.chain import CHAIN, OMEGA, frequencies, response
from tests.profiles import is_hunt

CHANCE = 0.05  # of honest intervals to hold less often than is asked, and more often: of 400 it leaves 93 to 97 %
SAFE = 0.995  # at most, of intervals from blocks, which are wider where few frequencies say something of a parameter


def chain_frequencies(rng):
    """Three frequencies with errors of 2 %: two parameters, one degree of freedom."""
    measured = frequencies(CHAIN) * np.exp(0.02 * rng.standard_normal(3))
    return {"model": frequencies, "data": measured, "modes": (1, 2, 3), "free": ["k1", "k2"]}


def chain_response(rng):
    """A complex response with errors of 5 % of each value."""
    noise = 0.05 * (rng.standard_normal(len(OMEGA)) + 1j * rng.standard_normal(len(OMEGA)))
    measured = control.frd(response(CHAIN, OMEGA) * (1.0 + noise), OMEGA)
    return {"model": response, "data": measured, "free": ["k1", "k3", "c"]}


def chain_noise(rng):
    """A complex response with errors of one size at all frequencies, a tenth of what it is at rest."""
    noise = rng.standard_normal(len(OMEGA)) + 1j * rng.standard_normal(len(OMEGA))
    measured = control.frd(response(CHAIN, OMEGA) + 1e-4 * noise, OMEGA)
    return {"model": response, "data": measured, "free": ["k1", "k3", "c"], "error_model": "absolute"}


def chain_gain(rng):
    """Magnitudes with errors of 5 %: nothing of the phase."""
    gain = np.abs(response(CHAIN, OMEGA)[0]) * np.exp(0.05 * rng.standard_normal(len(OMEGA)))
    curve = MeasuredFrequencyResponse(OMEGA / (2.0 * np.pi), gain, ("gain",))
    return {"model": lambda p: np.abs(response(p)[0]), "data": curve, "free": ["k1", "k3", "c"]}


def held(draw, truth, start, sets, **more):
    """Return the share of intervals that hold the truth, one a parameter, over so many data sets."""
    rng = np.random.default_rng(0)
    hits = []
    for _ in range(sets):
        found = bc.fit(**draw(rng), initial=start, n_starts=1, **more)
        hits.append([low <= truth[name] <= high for name, (low, high) in found.intervals.items()])
    return np.mean(hits, axis=0)


def as_often_as_95_per_cent(share, count, safe):
    """Return whether shares of so many intervals are those of 95 %, or, if they are on the safe side, not always held."""
    low, high = stats.binom.interval(1.0 - 2.0 * CHANCE, count, 0.95)
    hits = np.rint(share * count)
    return (hits >= low) & (share < SAFE if safe else hits <= high)


CASES = [chain_frequencies, chain_response, chain_noise, chain_gain]


@pytest.mark.slow
@pytest.mark.parametrize("draw", CASES)
def test_intervals_of_95_per_cent_hold_as_often(draw):
    """Each parameter by itself."""
    sets = 400 if is_hunt() else 100
    shares = held(draw, CHAIN, CHAIN, sets)
    assert as_often_as_95_per_cent(shares, sets, safe=draw is not chain_frequencies).all(), shares


def correlated(rng):
    """A complex response on a fine grid, its errors correlated over some three lines to either side."""
    omega, c = np.linspace(5.0, 50.0, 150), 4e-3
    e = signal.lfilter([np.sqrt(0.51)], [1.0, -0.7], rng.standard_normal((2, 300)), axis=1)[:, -150:]
    measured = control.frd(response({**CHAIN, "c": c}, omega) * np.exp(0.05 * (e[0] + 1j * e[1])), omega)
    return {"model": lambda p: response(p, omega), "data": measured, "free": ["k1", "k3"]}


@pytest.mark.slow
def test_block_intervals_cover_correlated_errors():
    truth = {**CHAIN, "c": 4e-3}
    assert (held(correlated, truth, truth, 100) > 0.88).all()  # 0.93 and 0.92 seen; chance is 2.5 %
    assert (held(correlated, truth, truth, 100, error_std=0.05) < 0.8).all()
